"""Contact on discs and annuli, and the repulsive Maugis–Dugdale law with its ring of constant gap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from followed import virial
from numpy.polynomial import Polynomial
from ring_reference import Rings as Reference
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar

import contbranch as cb
from contbranch.continuation import Point
from contbranch.continuation.walk import annotated
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.events import Margin
from contbranch.curve.outcome import RawEvent
from contbranch.curve.problem import equilibrium
from contbranch.curve.refine import refine
from contbranch.curve.rows import raw_curve
from contbranch.curve.solve import crossings, state_on
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.axisymmetric.regions import layout_of


@dataclass(frozen=True)
class Screened(cb.Interaction):
    """f = (1 + x) exp(−x)."""

    name = ""

    def shape(self, x):
        """f, f', f''."""
        fall = np.exp(-x)
        return (1 + x) * fall, -x * fall, (x - 1) * fall


@dataclass(frozen=True)
class Ramp(cb.Interaction):
    """A pressure that falls linearly to zero at x = 2: there its slope jumps."""

    def shape(self, x):
        left = np.maximum(1 - x / 2, 0.0)
        return left**2, -left, np.where(x < 2, 0.5, 0.0)


STEP = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)
BLUNT = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.Exponential(-1.0, 1.0))
"""A tip so blunt that its repulsive film is thinnest on a ring, where the wall is touched first."""


def followed(contact: cb.Contact, accuracy: float, target: float | None, held: Control = LOAD) -> Track:
    """The curve of a contact in reduced units."""
    request = Request(accuracy, target=target, held=held, modes=0)
    return trace(Axisymmetric().problem(contact, accuracy), request)


@pytest.fixture(scope="module")
def step() -> Track:
    """The curve of the repulsive Maugis–Dugdale law at tabor = 1, out to d = 6."""
    return followed(STEP, 1e-9, 6.0, DISPLACEMENT)


@pytest.fixture(scope="module")
def annulus() -> cb.Diagram:
    """The curve of the blunt tip."""
    return cb.trace(BLUNT, accuracy=1e-7, modes=0)


def at(track: Track, displacement: float) -> cb.State:
    """The state at a displacement of a curve along which it grows."""
    (found,) = crossings(track, "displacement", displacement, 1e-9)
    return state_on(track, found)


def problem_of(point: Point) -> ContactProblem:
    """The problem of a point."""
    assert isinstance(point.problem, ContactProblem)
    return point.problem


def nearest(track: Track, displacement: float) -> Point:
    """The row closest to a displacement."""
    return track.points[int(np.argmin(np.abs(track.column("displacement") - displacement)))]


def loads_grow(branch: cb.Branch) -> bool:
    """Whether the load grows from row to row once the law is felt; before, there is none."""
    felt = int(np.flatnonzero(branch.load)[0])
    return bool((np.diff(branch.load[max(felt - 1, 0) :]) > 0.0).all())


def first_change(contact: cb.Contact, accuracy: float, target: float = 0.1) -> RawEvent:
    """The first change of the contact set, on a curve that ends where the wall is touched."""
    request = Request(accuracy, target=target, modes=0)
    events = raw_curve(trace(Axisymmetric().problem(contact, accuracy), request), request).events
    return next(event for event in events if event.kind == "topology")


def test_disc_opens_where_hertz_pressure_reaches_the_law() -> None:
    """Up to then Hertz' contact with a wall at g = z0: p(0) = 2c/π = σ, d + z0 = c², F = 4c³/3."""
    sigma = tabor = 2.5
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor, sign=-1)
    event = first_change(contact, 1e-8)
    c = math.pi * sigma / 2
    for value, error, exact in zip(
        event.numbers, event.error, (4 / 3 * c**3, c * c - 1 / tabor, 0.0, 1 / tabor), strict=True
    ):
        assert abs(value - exact) <= error or value == exact
        assert error <= 1e-8 * max(1.0, abs(exact))


@pytest.mark.parametrize(("displacement", "end"), [(2.380, 2.4), (5.5, 3.2)])
def test_ring_against_active_sets(step: Track, displacement: float, end: float) -> None:
    """F, ring and contact agree with rings of uniform pressure (`ring_reference`), the better the finer."""
    state = at(step, displacement)
    assert state.error["load"] < 1e-8 * state.load
    wall = state.r[state.wall_pressure > 1e-9]
    ring = state.r[(np.abs(state.gap - 1.0) < 1e-12) & (state.pressure > 1e-9)]
    for count, allowed in ((150, 1e-3), (600, 6e-5)):
        reference = Reference(count, end)
        pressure, sets = reference.step_law(reference.r**2 / 2, displacement, 1.0, 1.0)
        assert abs(reference.load(pressure) - state.load) < allowed
        width = 2 * end / count
        resting = reference.r[sets == 1]
        assert np.abs(resting[[0, -1]] - ring[[0, -1]]).max() < width
        touched = reference.r[sets == 3]
        assert (touched[-1] if len(touched) else 0.0) == pytest.approx(wall[-1] if len(wall) else 0.0, abs=width)


def test_load_of_the_ring_at_2_380(step: Track) -> None:
    """F ≈ 8.2297 (an independent fine solution with rings and active sets, design notes), one stable state."""
    state = at(step, 2.380)
    assert state.load == pytest.approx(8.2297, abs=5e-4)
    assert (state.unstable_load, state.unstable_displacement, state.contact_radius) == (0, 0, 0.0)


def test_energy_of_the_ring(step: Track) -> None:
    """dV/dd = F by Boole's rule over [4.0, 4.4] (before touch), and the virial 5V = 2dF + 3V_fr + 2∫ g p_fr d²r.

    V_fr follows from the profile; on the ring the pressure is the interaction's, on the contact it does no work.
    """
    nodes = np.linspace(4.0, 4.4, 5)
    states = [at(step, float(d)) for d in nodes]
    work = 0.4 / 90 * np.array([7, 32, 12, 32, 7]) @ [state.load for state in states]
    assert states[-1].energy - states[0].energy == pytest.approx(float(work), abs=1e-8)
    for displacement in (4.2, 5.8):
        point = nearest(step, displacement)
        values, (surface, pressed) = equilibrium(point).values(point.x, point.parameter), virial(point)
        whole = 2 * values.displacement * values.load + 3 * surface + 2 * pressed
        assert 5 * values.energy == pytest.approx(whole, rel=2e-8)


def test_narrow_ring_becomes_a_jump() -> None:
    """With the ring far narrower than its radius: F = πσc², d = c²/2 − z0 + 4σc/π (design notes, §3, σ < 0 there)."""
    tabor = 0.15
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor, sign=-1)
    state = cb.solve(contact, load=4.5, accuracy=1e-8)
    c = math.sqrt(4.5 / (math.pi * tabor))
    exact = c * c / 2 - 1 / tabor + 4 / math.pi * tabor * c
    assert state.contact_radius == 0.0
    assert abs(state.displacement - exact) <= state.error["displacement"] <= 1e-8 * max(1.0, abs(exact))


def test_maugis_dugdale_repulsion_from_a_users_view() -> None:
    """A complete diagram with touch, no fold (the energy is convex), and one state at every load."""
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.6, sign=-1)
    diagram = cb.trace(contact, accuracy=1e-4, modes=0, max_load=42.0)
    assert (diagram.status, diagram.model.kind) == ("complete", "axisymmetric")
    assert [event.kind for event in diagram.events] == ["topology", "touch", "end"]
    branch = diagram.branches[0]
    assert not branch.unstable_load.any()
    assert not branch.unstable_displacement.any()
    assert loads_grow(branch)
    assert np.all(np.diff(branch.displacement) > 0)
    touch = diagram.events[1]
    solution = cb.solve(contact, load=1.1 * touch.load, accuracy=1e-4)
    assert solution.contact_radius > 0
    assert len(solution.states) == 1
    assert solution.displacement == pytest.approx(np.interp(solution.load, branch.load, branch.displacement), rel=1e-3)
    assert diagram.local_exponent(touch).kappa[0] == pytest.approx(0.5, abs=0.01)


def test_two_steps_of_pressure() -> None:
    """Each level holds a ring, which becomes a jump; the energy is convex."""
    diagram = cb.trace(
        cb.Contact(cb.Parabola(1.0), cb.MaugisDugdale(-0.5, 0.7) + cb.MaugisDugdale(-0.5, 1.5)),
        accuracy=1e-4,
        max_load=18.0,  # touched at 17.2
        modes=0,
    )
    branch = diagram.branches[0]
    assert (diagram.status, diagram.events[-1].kind) == ("complete", "end")
    assert branch.contact_radius[-1] > 0
    assert loads_grow(branch)
    assert np.all(np.diff(branch.displacement) > 0)


def test_a_hole_in_a_film_under_a_sharp_tip() -> None:
    """The pressure has a cusp in the middle: a tiny hole takes by far more displacement than the film is thick."""
    contact = cb.Contact(cb.PowerLaw(1.3, 1.0), cb.MaugisDugdale(-1.0, 0.2))
    diagram = cb.trace(contact, "displacement", accuracy=1e-3, modes=0)
    assert (diagram.status, [event.kind for event in diagram.events]) == ("complete", ["topology", "touch", "end"])
    branch = diagram.branches[0]
    assert loads_grow(branch)
    work = np.sum(np.diff(branch.displacement) * (branch.load[1:] + branch.load[:-1]) / 2)
    assert np.ptp(branch.energy) == pytest.approx(work, rel=1e-2)


def test_rows_before_the_wall_is_touched_on_a_ring() -> None:
    """Under a constant pressure no panel need resolve the gap: rows had passed its minimum, and loads turned back."""
    contact = cb.Contact(cb.PowerLaw(5.137, 1.0), cb.MaugisDugdale(-1.0, 1.0))
    branch = cb.trace(contact, accuracy=1e-4, max_load=8.5, modes=0).branches[0]  # touched at 7.75
    assert loads_grow(branch)
    (touched,) = np.flatnonzero(np.diff(branch.contact_radius > 0))
    assert min(branch.state(row).profile.gap.min() for row in range(touched - 2, touched + 3)) > -1e-6


def test_pressure_largest_on_a_ring() -> None:
    """Under z = r⁴/4 the pressure reaches σ on a ring, with p ∝ (1 + 2x²)√(1 − x²) (Abel) at x² = 1/2.

    p(r) = (1/π)∫_r^c ζ'(t)/√(t² − r²) dt with ζ = 2t⁴/3 gives (8/9π) c³ (1 + 2x²)√(1 − x²), which is σ = 1 there for
    c³ = (9π/8)/√2.
    """
    contact = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.MaugisDugdale(-1.0, 1.0))
    event = first_change(contact, 1e-6)
    c = (9 * math.pi / 8 / math.sqrt(2)) ** (1 / 3)
    assert event.numbers[1] == pytest.approx(2 / 3 * c**4 - 1, abs=event.error[1])
    assert event.numbers[0] == pytest.approx(2 * (2 / 3) * c**5 * 4 / 5, abs=event.error[0])


def test_contact_begins_on_a_ring(annulus: cb.Diagram) -> None:
    """The contact set is born as an annulus and closes to a disc; both are events, and the curve goes on to its end."""
    assert annulus.status == "complete"
    assert [event.kind for event in annulus.events] == ["topology", "topology", "end"]
    born, closed, end = annulus.events
    assert born.contact_radius == 0
    assert born.central_gap > 0
    assert closed.contact_radius > 0
    assert closed.central_gap == 0
    assert end.contact_radius > closed.contact_radius
    assert max(event.error["load"] / event.load for event in annulus.events) < 1e-7
    # v″ ≥ 0: a convex energy has no fold.
    assert not annulus.branches[0].unstable_load.any()
    assert not annulus.branches[0].unstable_displacement.any()


def test_annulus_against_active_sets(annulus: cb.Diagram) -> None:
    """F and the annulus at d = 3.5 agree with rings of uniform pressure and active sets (`ring_reference`)."""
    branch = annulus.branches[0]
    row = int(np.argmin(np.abs(branch.displacement - 3.5)))
    state, displacement = branch.state(row), float(branch.displacement[row])
    touched = state.r[state.wall_pressure > 1e-7]
    for count, allowed in ((150, 1e-3), (600, 6e-5)):
        reference = Reference(count, 2.6)
        height = BLUNT.tip.height(reference.r)
        pressure, contact = reference.smooth_law(height, displacement, lambda g: (np.exp(-g), -np.exp(-g)))
        assert abs(reference.load(pressure) - state.load) < allowed
        assert np.abs(reference.r[contact][[0, -1]] - touched[[0, -1]]).max() < 2 * 2.6 / count


def test_single_state_with_an_annulus(annulus: cb.Diagram) -> None:
    """`solve` finds a state beyond the change of the contact set; its energy is that at birth and the load's work."""
    born, branch = annulus.events[0], annulus.branches[0]
    state = cb.solve(BLUNT, displacement=3.25, accuracy=1e-5)
    assert state.contact_radius > 0
    assert state.central_gap > 0
    assert born.displacement < 3.25
    row = round(born.position)
    behind = branch.displacement > born.displacement
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = (3.25 - born.displacement) / 2
    d, load = (np.concatenate([[c[row]], c[behind]]) for c in (branch.displacement, branch.load))
    work = half * weights @ CubicSpline(d, load)(born.displacement + half * (1 + nodes))
    assert state.energy - branch.energy[row] == pytest.approx(float(work), abs=1e-5)


@pytest.mark.parametrize("displacement", [1.0, 3.0, 5.8])
def test_stated_errors_bound_true_ones(step: Track, displacement: float) -> None:
    """On a disc at rest, with a hole in it, and with contact inside of the ring."""
    exact = at(step, displacement)
    for accuracy in (1e-4, 1e-6):
        state = cb.solve(STEP, displacement=displacement, accuracy=accuracy)
        for name in ("load", "contact_radius"):
            assert abs(getattr(state, name) - getattr(exact, name)) <= state.error[name] + exact.error[name]
        assert state.error["load"] <= accuracy * state.load


def test_a_disc_at_rest_is_followed_by_a_ring(step: Track) -> None:
    """At p(0) = σ a region in the band below is born at the centre, and the state goes on from d = π²/4 − 1."""
    mark = next(mark for mark in step.marks if mark.kind == "topology")
    event = annotated(refine(mark.point, Margin(mark.margin), 1e-9).point)
    found = equilibrium(event).successor("inadmissible", [event])
    assert found is not None
    assert (found.kind, found.same) == ("topology", False)
    assert "a disc opens into a ring" in found.message
    (start,) = found.starts
    layout = layout_of(problem_of(start).equations)
    assert [(region.rests, region.index) for region in layout.regions] == [(False, 0), (True, 1), (False, 1)]
    assert 0 < equilibrium(start).values(start.x, start.parameter).displacement - (math.pi**2 / 4 - 1) < 1e-2
    ahead = equilibrium(start).rates(start.x, start.parameter, start.tangent_x, start.tangent_parameter)
    assert ahead.load > 0 < ahead.displacement
    assert min(equilibrium(start).margins(start.x, start.parameter).values()) > 0
    assert not equilibrium(event).joins(equilibrium(start))


def test_an_error_is_told_in_the_coordinate_of_the_finer_discretisation() -> None:
    """First contact in a film of long range, which one has along the parameter and the other across the curve."""
    contact = cb.Contact(cb.PowerLaw(3.1, 1.0), Screened(1.0, 73.5))
    diagram, exact = (cb.trace(contact, accuracy=accuracy, modes=0) for accuracy in (1e-8, 1e-10))
    first, true = (
        next(event for event in one.events if event.kind in ("touch", "topology")) for one in (diagram, exact)
    )
    assert diagram.status == "complete"
    assert abs(first.displacement - true.displacement) <= first.error["displacement"] <= 1e-8


def test_farther_away_than_the_beginning() -> None:
    """Without pressure beyond the range the tip floats freely; the first loads are those of Hertz."""
    free = cb.solve(STEP, displacement=-3.0, accuracy=1e-6)
    assert (free.load, free.displacement, free.contact_radius, free.central_gap) == (0.0, -3.0, 0.0, 3.0)
    assert free.energy == 0.0
    small = cb.solve(STEP, load=1e-8, accuracy=1e-9)
    assert small.displacement == pytest.approx((3 / 4 * 1e-8) ** (2 / 3) - 1, abs=1e-12)
    film = cb.solve(BLUNT, displacement=-25.0, accuracy=1e-6)
    # Next to nothing bends: F = 2π ∫ exp(−g) r dr with g = 25 + r⁴/4.
    load = 2 * math.pi * math.exp(-25.0) * math.sqrt(math.pi) / 2
    assert film.load == pytest.approx(load, rel=1e-8)


@pytest.mark.parametrize(("tip", "range_"), [(cb.Cone(1.0), 9.0), (cb.PowerLaw(1.3, 1.0), 300.0)])
def test_films_under_a_uniform_pressure(tip: cb.Tip, range_: float) -> None:
    """Rings are narrow under steep tips: σ acts on a disc r < c with the gap z0 at c.

    It lifts the centre by 2σc, the edge by 4σc/π, so that at first touch z(c) = z0 + (2 − 4/π)σc.
    """
    diagram, sigma = cb.trace(cb.Contact(tip, cb.MaugisDugdale(-1.0, range_)), modes=0), 1 / range_
    touch = next(event for event in diagram.events if event.kind == "touch")
    height = Polynomial([-range_, (4 / math.pi - 2) * sigma])
    c = brentq(lambda c: float(tip.height(c)) + height(c), 0.0, 2 * range_)
    assert touch.load == pytest.approx(math.pi * sigma * c * c, rel=1e-7)
    assert touch.displacement == pytest.approx(2 * sigma * c, abs=1e-6)
    assert diagram.status == "complete"
    assert diagram.events[-1].name is None


def test_a_film_under_a_cone_begins_with_a_narrow_ring() -> None:
    """Its ring is a little wider than those that are replaced by jumps: 1.7e-3 of its radius at z0 = 5."""
    contact = cb.Contact(cb.Cone(1.0), cb.MaugisDugdale(-1.0, 5.0))
    coarse, fine = (cb.trace(contact, accuracy=accuracy, modes=0) for accuracy in (1e-6, 1e-8))
    for one, other in zip(coarse.events, fine.events, strict=True):
        assert (one.kind, other.kind) in (("touch", "touch"), ("end", "end"))
    touch, exact = coarse.events[0], fine.events[0]
    for name in ("load", "displacement"):
        allowed = touch.error[name] + exact.error[name]
        assert abs(getattr(touch, name) - getattr(exact, name)) <= allowed <= 2e-6 * abs(touch.load)


def test_a_film_that_reaches_farther_than_its_cap() -> None:
    """The curve ends where the pressure acts on the whole cap: F = πσc², d = z(c) − z0 + 4σc/π at its edge c."""
    range_ = 80.0
    diagram = cb.trace(cb.Contact(cb.SphericalCap(1.0), cb.MaugisDugdale(-1.0, range_)), modes=0)
    end = diagram.events[-1]
    assert diagram.status == "complete"
    assert (end.kind, end.name, end.contact_radius) == ("end", "tip-edge", 0.0)
    assert "range of the interaction" in end.message
    c = math.sqrt(end.load * range_ / math.pi)
    assert c == pytest.approx(1.0, abs=2e-3)
    exact = 1 - math.sqrt(1 - c * c) - range_ + 4 / math.pi * c / range_
    assert abs(end.displacement - exact) <= end.error["displacement"] <= 1e-6 * range_


@pytest.mark.parametrize("sigma", [0.1, 3.0])
def test_films_under_cones_are_similar(sigma: float) -> None:
    """Nothing but the range has a length: until the wall is touched F ∝ (d + z0)²."""
    diagram = cb.trace(cb.Contact(cb.Cone(1.0), cb.MaugisDugdale(-1.0, 1 / sigma)), accuracy=1e-7, modes=0)
    before = (diagram.branches[0].contact_radius == 0) & (diagram.branches[0].load > 0)
    load, displacement = diagram.branches[0].load[before], diagram.branches[0].displacement[before]
    assert diagram.status == "complete"
    assert load / (displacement + 1 / sigma) ** 2 == pytest.approx(load[-1] / (displacement[-1] + 1 / sigma) ** 2)


def test_the_weakest_films_open_where_the_pressure_reaches_the_law() -> None:
    """Ranges of a thousand radii: p(r) = (1/π) ∫_r^c ζ'/√(t² − r²) dt with ζ = κtⁿ reaches σ, d = κcⁿ − z0."""
    exponent, range_ = 4.3, 1e3
    tip = cb.PowerLaw(exponent, 1.0)
    event = first_change(cb.Contact(tip, cb.MaugisDugdale(-1.0, range_)), 1e-6)
    kappa, (s, w) = float(tip.transform(1.0)), np.polynomial.legendre.leggauss(200)

    def pressure(r: float) -> float:
        """Where c = 1; t = √(r² + s²), 0 < s < √(1 − r²), and s = u⁴ for what is not smooth at the centre."""
        u = (s + 1) / 2 * (1 - r * r) ** (1 / 8)
        t = np.hypot(r, u**4)
        return float(w @ (4 * u**3 * t ** (exponent - 2))) * (1 - r * r) ** (1 / 8) / 2 * exponent * kappa / math.pi

    largest = -minimize_scalar(lambda r: -pressure(r), bounds=(0.0, 0.99), method="bounded").fun
    c = (1 / range_ / max(largest, pressure(0.0))) ** (1 / (exponent - 1))
    assert event.numbers[0] == pytest.approx(2 * kappa * c ** (exponent + 1) * exponent / (exponent + 1), rel=2e-4)
    assert event.numbers[1] == pytest.approx(kappa * c**exponent - range_, abs=event.error[1])


def test_energy_under_a_rough_tip() -> None:
    """dV = F dd by Simpson's rule where the pressure is constant and the gap is not smooth."""
    radii = np.linspace(0.0, 8.0, 13)
    heights = radii**2 / 2 * (1 + 1e-3 * np.cos(7 * np.arange(13) ** 2))
    contact = cb.Contact(cb.Profile(tuple(radii), tuple(heights)), cb.MaugisDugdale(-1.0, 20.0)).to_reduced()
    track = followed(contact, 1e-4, -1.7, DISPLACEMENT)
    states = [at(track, float(d)) for d in np.linspace(-2.2, -1.8, 3)]
    work = 0.4 / 6 * np.array([1, 4, 1]) @ [state.load for state in states]
    assert states[-1].energy - states[0].energy == pytest.approx(float(work), abs=1e-6)


def test_weak_films_begin_with_a_disc_at_rest() -> None:
    """A disc at rest at the gap z0 is Hertz' contact until its peak 2c/π is the law's pressure σ = μ_T.

    There, F = 4c³/3 = π³σ³/6 and d = c² − z0. A rigid tip squeezes the film out at 2πR|Δγ|.
    """
    tabor = 1 / 64
    diagram = cb.trace(cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor, sign=-1), modes=0)
    topology, touch = (event for event in diagram.events if event.kind in ("topology", "touch"))
    assert diagram.status == "complete"
    assert topology.load == pytest.approx(np.pi**3 * tabor**3 / 6, abs=1e-6 * max(1, tabor))
    assert topology.displacement == pytest.approx((np.pi * tabor / 2) ** 2 - 1 / tabor, abs=1e-6 / tabor)
    assert 0.0 < touch.load / (2 * np.pi) - 1.0 < 2.0 * tabor**1.5


def test_a_soft_film_that_ends_with_a_kink_has_no_folds() -> None:
    """Around a ring the kink moves with the panels; a ring on panels without it turns round what it was not to."""
    contact = cb.Contact(cb.PowerLaw(4.17, 1.0), Ramp(-1.0, 274.0))
    coarse, fine = (cb.trace(contact, accuracy=accuracy, modes=0) for accuracy in (1e-6, 1e-8))
    for diagram in (coarse, fine):
        assert diagram.status == "complete", diagram.message
        assert not list(diagram.folds("load"))
        assert np.all(np.diff(diagram.branches[0].load) > 0.0)
        assert not diagram.branches[0].unstable_load.any()
    for one, other in zip(coarse.events, fine.events, strict=True):
        assert abs(one.load - other.load) <= one.error["load"] + other.error["load"]


def test_rows_lie_where_the_contact_set_changes() -> None:
    """Load and displacement grow through every change under a flat tip pressed by a constant repulsion."""
    tip = cb.PowerLaw(5.382, 1.0)
    law = cb.MaugisDugdale(-1.0, tip.reduced_scales(1.0)[1] / 0.0121)
    diagram = cb.trace(cb.Contact(tip, law), accuracy=1e-8, modes=0)
    changes, branch = [event for event in diagram.events if event.kind == "topology"], diagram.branches[0]
    assert len(changes) == 4
    assert not list(diagram.folds("load"))
    assert loads_grow(branch)
    assert (np.diff(branch.displacement) > 0.0).all()
    for event in changes:
        row = round(event.position)
        assert branch.load[row] == event.load
        assert branch.displacement[row] == event.displacement


def test_a_ring_closes_to_a_disc() -> None:
    """A film under a flat tip is squeezed out on a ring, which closes to a disc: errors bound where it does."""
    contact = cb.Contact(cb.PowerLaw(3.5, 1.0), cb.Exponential(-1.0, 8.0), 1.0)
    coarse, fine = (cb.trace(contact, accuracy=accuracy, max_load=8.0, modes=0) for accuracy in (1e-5, 1e-8))
    for diagram in (coarse, fine):
        assert diagram.status == "complete", diagram.message
        _, closing = (event for event in diagram.events if event.kind == "topology")
        assert "closes to a disc" in closing.message
    for one, other in zip(coarse.events, fine.events, strict=True):
        assert (one.kind, one.control) == (other.kind, other.control)
        for name in ("load", "displacement", "contact_radius", "central_gap"):
            allowed = one.error[name] + other.error[name]
            assert abs(getattr(one, name) - getattr(other, name)) <= allowed, (one.kind, name)
    end = coarse.branches[0].unstable_displacement[-1], fine.branches[0].unstable_displacement[-1]
    assert end[0] == end[1]
