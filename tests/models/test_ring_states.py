"""Discs, rings and jumps of the pressure against the half space in real space (`ring_collocation`), and derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from ring_collocation import Annulus, Array, integral, lifted
from scipy.special import ellipe

import contbranch as cb
from contbranch.continuation import Point
from contbranch.control import DISPLACEMENT
from contbranch.curve.problem import equilibrium, oriented
from contbranch.curve.solve import crossings
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.axisymmetric.changes import holding, laid, resolved, solved
from contbranch.models.axisymmetric.equations import ContactCoordinate, Equations
from contbranch.models.axisymmetric.laying import Functions
from contbranch.models.axisymmetric.layout import Layout, Region
from contbranch.models.axisymmetric.mesh import mesh_on
from contbranch.models.axisymmetric.moving import Resolution, order_for
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.axisymmetric.regions import layout_of, least_margin, radii_of

FLOATS, RESTS = "floats", "rests"


@dataclass(frozen=True)
class Case:
    """A curve, and a state on it: what each region does, and at which gap (or in which band below a gap) it does so.

    `pressure` is the law's at a gap, given the band.
    """

    contact: cb.Contact
    displacement: float
    regions: tuple[tuple[str, float], ...]
    pressure: Callable[[Array, float], Array]
    energy: Callable[[Array, float], Array]
    farthest: float = np.inf


def constant(sigma: float, end: float) -> tuple[Callable[[Array, float], Array], Callable[[Array, float], Array]]:
    """Pressure and energy per area of a repulsion that ends at a gap."""
    return (
        lambda gap, below: sigma * np.ones_like(gap) * (below <= end),
        lambda gap, below: sigma * (end - gap) * (below <= end),
    )


def exponential(gap: Array, below: float) -> Array:
    """Pressure, and energy per area, of exp(−g)."""
    return np.exp(-gap)


STEP = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)
WEAK = cb.Contact.reduced(cb.MaugisDugdale, tabor=0.15, sign=-1)
BLUNT = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.Exponential(-1.0, 1.0))
"""A tip so blunt that its repulsive film is thinnest on a ring, where the wall is touched first."""
WALL, LEVEL, INSIDE, OUTSIDE = (RESTS, 0.0), (RESTS, 1.0), (FLOATS, 1.0), (FLOATS, np.inf)
CASES = {
    "disc on a film": Case(STEP, 1.0, (LEVEL, OUTSIDE), *constant(1.0, 1.0)),
    "ring": Case(STEP, 2.38, (INSIDE, LEVEL, OUTSIDE), *constant(1.0, 1.0)),
    "disc and ring": Case(STEP, 5.5, (WALL, INSIDE, LEVEL, OUTSIDE), *constant(1.0, 1.0)),
    "annulus": Case(BLUNT, 3.5, (OUTSIDE, WALL, OUTSIDE), exponential, exponential),
    "jump": Case(WEAK, 1.0, ((FLOATS, 1 / 0.15), OUTSIDE), *constant(0.15, 1 / 0.15)),
}


@pytest.fixture(scope="module")
def curves() -> dict[int, Track]:
    """The curves that have been followed."""
    return {}


def state_of(case: Case, curves: dict[int, Track], accuracy: float = 1e-10) -> Point:
    """The point of a case on its curve."""
    key = id(case.contact)
    if key not in curves:
        farthest = max(other.displacement for other in CASES.values() if other.contact is case.contact) + 1.0
        problem = Axisymmetric().problem(case.contact.to_reduced(), 1e-8)
        curves[key] = trace(problem, Request(1e-8, target=farthest, held=DISPLACEMENT, modes=0))
    (found,) = crossings(curves[key], "displacement", case.displacement, accuracy)
    return found.found.point


def seen(point: Point) -> tuple[ContactProblem, Equations, Functions]:
    """The problem of a point, its equations, and the state as functions of the radius."""
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    equations, fields = problem.seen(point.x, point.parameter)
    return problem, equations, Functions(equations, fields)


@pytest.mark.parametrize("name", CASES)
def test_pressure_lifts_the_surface_to_its_gap(name: str, curves: dict[int, Track]) -> None:
    """Everywhere, and gaps that rest do so; pressures are the law's or between its bounds, continuous, and the load."""
    case = CASES[name]
    point = state_of(case, curves)
    problem, equations, state = seen(point)
    tip, mesh, fields = equations.tip, equations.mesh, state.fields
    a, radii = fields.rim.radius, radii_of(equations, fields)
    ends = np.unique([0.0, *radii, *state.ends])
    assert [region.rests for region in layout_of(equations).regions] == [kind == RESTS for kind, _ in case.regions]

    # The surface, at nodes and in the disc.
    every = slice(None, None, max(1, mesh.size // 40))
    r, gap = np.hypot(mesh.nodes, a)[every], fields.gap[every]
    if a > 0.0:
        within = a * np.linspace(0.02, 0.98, 7)
        r, gap = np.append(within, r), np.append(np.full(7, case.regions[0][1]), gap)
    for k, (kind, level) in enumerate(case.regions):
        if kind == RESTS and k:  # between nodes, too
            within = radii[k - 1] + (radii[k] - radii[k - 1]) * (1 - np.cos(np.linspace(0.02, np.pi - 0.02, 19))) / 2
            r, gap = np.append(r, within), np.append(gap, np.full(19, level))
    lift = np.array([float(lifted(state.pressure, ends, place)) for place in r])
    observed = problem.values(point.x, point.parameter)
    assert observed.displacement == pytest.approx(case.displacement, abs=1e-10)  # the accuracy asked for
    # In a disc of contact the pressure is told by the slope of h, with fewer digits.
    allowed = 1e-7 if name == "disc and ring" else 1e-8
    assert np.abs(lift - (gap + observed.displacement - tip.height(r))).max() < allowed

    # What rests, and what floats.
    places = np.append(radii, np.inf)
    for k, (kind, level) in enumerate(case.regions):
        within = (r > (places[k - 1] if k else 0.0)) & (r < places[k])
        pressed = state.pressure(r[within])
        if kind == RESTS:
            assert gap[within] == pytest.approx(level, abs=1e-12)
            low, high = (float(case.pressure(np.array([level]), one)[0]) for one in (level + 1.0, level))
            assert pressed.min() > low - 1e-8
            assert pressed.max() < high + 1e-4 or level == 0.0  # next to an edge it is told to less
        else:
            assert pressed == pytest.approx(case.pressure(gap[within], level), abs=1e-8)
            assert gap[within].min() > (0.0 if level == np.inf and case.contact is BLUNT else -1e-12)
            assert gap[within].max() < level
    if name != "jump":
        for edge in radii:
            beside = state.pressure(edge * (1 + np.array([-1e-13, 1e-13])))
            assert beside[1] - beside[0] == pytest.approx(0.0, abs=2e-4)  # rounding
    else:
        assert fields.gaps[mesh.size :] == pytest.approx(1 / 0.15, abs=1e-10)

    # Load and energy.
    load = 2 * np.pi * integral(lambda s: s * state.pressure(s), ends)
    assert observed.load == pytest.approx(load, abs=allowed)


@pytest.mark.parametrize("name", ["ring", "disc and ring", "annulus"])
def test_energy_is_what_is_integrated_in_real_space(name: str, curves: dict[int, Track]) -> None:
    """Half of ∫ p w d²r, and the law's energy."""
    case = CASES[name]
    point = state_of(case, curves)
    problem, equations, state = seen(point)
    observed, tip, fields, mesh = problem.values(point.x, point.parameter), equations.tip, state.fields, equations.mesh
    a, radii = fields.rim.radius, radii_of(equations, fields)
    whole, places = 0.0, [0.0, *radii, float(state.ends[-1])]
    for (kind, level), low, high in zip(case.regions, places[:-1], places[1:], strict=True):

        def density(r: Array, kind: str = kind, level: float = level) -> Array:
            floating = mesh.interpolate(fields.gap, np.sqrt(np.maximum(r * r - a * a, 0.0)))
            gap = np.full(len(r), level) if kind == RESTS else floating
            lift = gap + observed.displacement - tip.height(r)
            return r * (state.pressure(r) * lift / 2 + case.energy(gap, level))

        ends = [low, *state.ends[(state.ends > low) & (state.ends < high)], high]
        whole += 2 * np.pi * integral(density, ends)
    assert observed.energy == pytest.approx(whole, abs=2e-7 if name == "disc and ring" else 1e-8)


@pytest.mark.parametrize("name", ["ring", "disc and ring", "annulus", "jump"])
def test_linearisation_is_that_of_differences(name: str, curves: dict[int, Track]) -> None:
    """In the state, in pressures of what rests, in the edges of regions and in the parameter."""
    point = state_of(CASES[name], curves)
    problem, x, p = seen(point)[0], point.x, point.parameter
    n, random = problem.size, np.random.default_rng(3)
    assert x.size - n == (len(problem.mesh.roots) if problem.motion else 0)
    matrix = problem.jacobian(x, p)
    states = [np.append(random.standard_normal(n), np.zeros(x.size - n)) for _ in range(2)]
    for v in [*states, *np.eye(x.size)[n:]]:
        above, below = (problem.residual(x + s * v, p) for s in (1e-5, -1e-5))
        exact = matrix @ v
        # Where edges move, nodes come to places between them, at which the equations hold as well as the mesh is fine.
        assert np.abs((above - below) / 2e-5 - exact).max() < 5e-6 * np.abs(exact).max()
        assert problem.product(x, p)(v) == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())
    above, below = (problem.residual(x, p + s) for s in (1e-5, -1e-5))
    exact = problem.parameter_derivative(x, p)
    assert np.abs((above - below) / 2e-5 - exact).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("name", CASES)
def test_rates_are_those_of_differences(name: str, curves: dict[int, Track]) -> None:
    """Of load, displacement, contact radius and central gap along the curve."""
    point, h = state_of(CASES[name], curves), 1e-5
    problem, direction = equilibrium(point), (point.tangent_x, point.tangent_parameter)
    above, below = (problem.values(point.x + s * direction[0], point.parameter + s * direction[1]) for s in (h, -h))
    rates = problem.rates(point.x, point.parameter, *direction)
    assert rates == pytest.approx([(a - b) / (2 * h) for a, b in zip(above[:4], below[:4], strict=True)], abs=1e-7)


@dataclass(frozen=True)
class Dished(cb.PowerLaw):
    """z = r⁴/2 − r², which touches a wall on a ring about r = 1."""

    def height(self, r: Array) -> Array:
        return r**4 / 2 - r**2

    def height_derivative(self, r: Array) -> Array:
        return 2 * r**3 - 2 * r

    def shape_gap(self, rho: Array, a: float) -> tuple[Array, Array]:
        assert a == 0.0  # there is no disc
        return self.height(rho), np.zeros_like(rho)


@pytest.mark.parametrize(("inner", "outer"), [(0.9, 1.1), (0.7, 1.25)])
def test_annulus_without_interaction(inner: float, outer: float) -> None:
    """Against collocation with ``p = √((r² − b²)(a² − r²)) q(r²)``: outer radius, displacement, load, pressure."""
    assert Annulus(Dished(4.0, 1.0).height, 0.9, (1.0, 1.5), 14).outer == pytest.approx(1.10062933686408, abs=1e-13)
    tip, nothing = Dished(4.0, 1.0), cb.Exponential(-1e-200, 1.0)
    resolution = Resolution(1e-10, order_for(1e-10))
    mesh = mesh_on(np.array([0.0, 0.5, 1.0, 2.0]), resolution.order)
    undeformed = Equations(tip, nothing, mesh, ContactCoordinate(tip, 2.0), False)
    before = Functions(undeformed, undeformed.fields(np.zeros(undeformed.size), 0.1))
    floats, rests = Region(False, 0), Region(True, 0)
    start = ContactProblem(undeformed, 1.0, resolution)
    problem, x, p = laid(start, before, Layout((floats, rests, floats), False), np.array([inner, outer]))
    held = holding((0,))  # the inner edge, to first order
    row = held(problem, x)
    point = resolved(oriented(problem, *solved(problem, x, p, row), row), held)
    problem, equations, state = seen(point)
    found, (b, a) = problem.values(point.x, point.parameter), radii_of(equations, state.fields)
    assert b == pytest.approx(inner, abs=1e-3)
    # Edges are known less well than what does not feel where they are: the exact annulus is that of the displacement.
    given, exact = [float(b), float(b) + 1e-6], []
    while not exact or abs(exact[-1].displacement - found.displacement) > 1e-12:
        exact += [Annulus(tip.height, one, (1.0, 1.5), 13) for one in given[len(exact) :]]
        slope = (exact[-1].displacement - exact[-2].displacement) / (given[-1] - given[-2])
        given.append(given[-1] - (exact[-1].displacement - found.displacement) / slope)
    truth = exact[-1]
    assert found.load == pytest.approx(truth.load, abs=1e-9)
    assert (b, a) == pytest.approx((truth.inner, truth.outer), abs=1e-5)
    assert found.contact_radius == a
    r = b + (a - b) * np.linspace(0.01, 0.99, 25)
    assert state.pressure(r) == pytest.approx(truth.pressure(r), abs=1e-5)
    # V = ½ ∫ p (d − z) d²r
    ends = [truth.inner, truth.outer]
    own = integral(lambda s: np.pi * s * truth.pressure(s) * (truth.displacement - tip.height(s)), ends)
    assert found.energy == pytest.approx(own, abs=1e-9)


def test_a_narrow_ring_is_a_jump(curves: dict[int, Track]) -> None:
    """With the ring far narrower than its radius: F = πσc², d = c²/2 − z0 + 4σc/π."""
    sigma = 0.15
    _, equations, state = seen(state_of(CASES["jump"], curves))
    c = float(radii_of(equations, state.fields)[0])
    assert equations.load(state.fields) == pytest.approx(np.pi * sigma * c * c, rel=1e-10)
    exact = c * c / 2 - 1 / sigma + 4 / np.pi * sigma * c
    assert equations.displacement(state.fields) == pytest.approx(exact, abs=1e-9)


def test_known_pressures() -> None:
    """In `ring_collocation` pressure (2/π)√(a² − r²) lifts by a² − r²/2 (Hertz), a uniform one by (4c/π) E(r/c)
    (K. L. Johnson, Contact Mechanics, §3.4)."""
    a = 1.7
    for r in (0.01, 0.5, 1.69, a):
        lift = lifted(lambda s: 2 / np.pi * np.sqrt((a - s) * (a + s)), [0.0, 0.5, a], r)
        assert float(lift) == pytest.approx(a * a - r * r / 2, abs=1e-13)
        assert float(lifted(np.ones_like, [0.0, a], r)) == pytest.approx(
            4 * a / np.pi * ellipe((r / a) ** 2), abs=1e-13
        )


def test_a_film_up_to_the_rim_of_a_cap() -> None:
    """What is felt there ends with the tip."""
    contact = cb.Contact(cb.SphericalCap(2.0), cb.Gauss(-1.0, 1.0)).to_reduced()
    track = trace(Axisymmetric().problem(contact, 1e-8), Request(1e-8, modes=0))
    point = [one for one in track.points if one.observables["contact_radius"] == 0.0][-1]
    _, equations, state = seen(point)
    tip, fields, d = contact.axisymmetric_tip, state.fields, equations.displacement(state.fields)
    assert fields.pressure[-1] > 0.1 * fields.pressure.max()
    r, ends = equations.mesh.nodes[::3], np.unique(state.ends)
    assert ends[-1] == pytest.approx(tip.extent, rel=1e-9)
    lift = np.array([float(lifted(state.pressure, ends, one)) for one in r])
    assert lift == pytest.approx(fields.gap[::3] + d - tip.height(r), abs=1e-6)
    load = 2 * np.pi * integral(lambda s: s * state.pressure(s), ends)
    assert equations.load(fields) == pytest.approx(load, abs=1e-7)


def test_nothing_breaches_where_all_is_right(curves: dict[int, Track]) -> None:
    """Inequalities hold at every state, and fail where a region is left out: a wall that pulls, surfaces that meet."""
    for case in CASES.values():
        problem, equations, state = seen(state_of(case, curves))
        breach = least_margin(equations, state.fields, problem.scale, problem.narrow_ring)
        assert breach is None or breach.margin > 0.0
