"""Contact on discs and annuli, and the repulsive Maugis–Dugdale law with its ring of constant gap."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from contbranch.models.rings.journey import Target
from contbranch.models.rings.legs import solved
from contbranch.models.rings.solve import indices_on, state_between
from contbranch.models.rings.trace import Traced, trace
from ring_reference import Rings as Reference

import contbranch as cb
from contbranch.control import DISPLACEMENT
from contbranch.models.rings.panels import Grid, Panels
from contbranch.models.rings.problem import RingProblem

BLUNT = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.Exponential(-1.0, 1.0))
"""A tip so blunt that its repulsive film is thinnest on a ring, where the wall is touched first."""


@pytest.fixture(scope="module")
def step() -> Traced:
    """The curve of the repulsive Maugis–Dugdale law at tabor = 1, out to d = 6."""
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)
    return trace(contact, 1e-9, Target(6.0, DISPLACEMENT))


@pytest.fixture(scope="module")
def annulus() -> cb.Diagram:
    """The curve of the blunt tip."""
    return cb.trace(BLUNT, accuracy=1e-7)


def at(traced: Traced, displacement: float) -> cb.State:
    """The state at a displacement of a curve along which it grows."""
    piece = int(np.searchsorted(traced.curve.displacement, displacement)) - 1
    unstable = indices_on(traced.curve, traced.indices, piece)
    begin, end = traced.points[piece : piece + 2]
    return state_between(begin, end, unstable, "displacement", displacement, 1e-9)


def test_elastic_response_of_hertz() -> None:
    """Pressure (2/π)√(a² − r²) lifts the surface by a² − r²/2 (Hertz), whatever panels a second edge makes of it."""
    a = 1.7
    grid = Grid(Panels(14, ((0.3,), (0.3,), (0.3,))), np.array([0.9, a]), bounded=True)
    pressure = 2 / np.pi * np.sqrt(a * a - grid.r**2)
    assert np.abs(grid.response() @ pressure - (a * a - grid.r**2 / 2)).max() < 1e-11


@pytest.mark.parametrize("bounded", [True, False])
def test_response_to_moving_edges(bounded: bool) -> None:
    """The derivative with respect to the edges is that of central differences."""
    panels = Panels(10, ((0.3,), (0.4,), (0.2,)), () if bounded else (0.5, 1.2))
    edges, step = np.array([0.7, 1.6]), 1e-5
    grid = Grid(panels, edges, bounded)
    pressure = np.exp(-grid.r) if bounded else 1 / (1 + grid.r**2) ** 3
    moved = grid.moved(pressure)
    for k in range(2):
        shift = step * np.eye(2)[k]
        above, below = (Grid(panels, edges + s, bounded).response() @ pressure for s in (shift, -shift))
        assert np.abs((above - below) / (2 * step) - moved[:, k]).max() < 1e-8 * np.abs(moved).max()


@pytest.mark.parametrize("tabor", [0.4, 1.0, 2.5])
def test_disc_opens_where_hertz_pressure_reaches_the_law(tabor: float) -> None:
    """Up to then Hertz' contact with a wall at g = z0: p(0) = 2c/π = σ, d + z0 = c², F = 4c³/3."""
    sigma = tabor
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor, sign=-1)
    curve = trace(contact, 1e-8, Target(1.01 * 4 / 3 * (math.pi * sigma / 2) ** 3)).curve
    event = next(event for event in curve.events if event.kind == "topology")
    c = math.pi * sigma / 2
    for value, error, exact in zip(
        event.values, event.error, (4 / 3 * c**3, c * c - 1 / tabor, 0.0, 1 / tabor), strict=True
    ):
        assert abs(value - exact) <= error or value == exact
        assert error <= 1e-8 * max(1.0, abs(exact))


@pytest.mark.parametrize(("displacement", "end"), [(2.380, 2.4), (5.5, 3.2)])
def test_ring_against_active_sets(step: Traced, displacement: float, end: float) -> None:
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


def test_load_of_the_ring_at_2_380(step: Traced) -> None:
    """F ≈ 8.2297 (an independent fine solution with rings and active sets, design notes), one stable state."""
    state = at(step, 2.380)
    assert state.load == pytest.approx(8.2297, abs=5e-4)
    assert (state.unstable_load, state.unstable_displacement, state.contact_radius) == (0, 0, 0.0)


def test_energy_of_the_ring(step: Traced) -> None:
    """dV/dd = F by Boole's rule over [4.0, 4.4] (before touch), and the virial 5V = 2dF + 3V_fr + 2∫ g p_fr d²r.

    V_fr follows from the profile; on the ring the pressure is the interaction's, on the contact it does no work.
    """
    nodes = np.linspace(4.0, 4.4, 5)
    states = [at(step, float(d)) for d in nodes]
    work = 0.4 / 90 * np.array([7, 32, 12, 32, 7]) @ [state.load for state in states]
    assert states[-1].energy - states[0].energy == pytest.approx(float(work), abs=1e-9)
    for displacement in (4.2, 5.8):
        row = int(np.argmin(np.abs(step.curve.displacement - displacement)))
        point = step.points[row]
        problem = point.problem
        assert isinstance(problem, RingProblem)
        fields = problem.fields(point.x, point.parameter)
        area = 2 * math.pi * fields.grid.weights * fields.grid.r
        interaction = float(area @ problem.density(fields))
        work = float(area @ (fields.gap * fields.pressure))
        virial = 2 * point.parameter * problem.load(fields) + 3 * interaction + 2 * work
        assert 5 * problem.energy(fields) == pytest.approx(virial, rel=2e-8)


def test_narrow_ring_becomes_a_jump() -> None:
    """With the ring far narrower than its radius: F = πσc², d = c²/2 − z0 + 4σc/π (design notes, §3, σ < 0 there)."""
    tabor = 0.15
    traced = trace(cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor, sign=-1), 1e-8, Target(4.0))
    last = traced.points[-1]
    c = float(last.x[-1])
    assert last.observables["contact_radius"] == 0.0
    assert traced.curve.load[-1] == pytest.approx(math.pi * tabor * c * c, rel=1e-10)
    assert traced.curve.displacement[-1] == pytest.approx(c * c / 2 - 1 / tabor + 4 / math.pi * tabor * c, abs=1e-9)


def test_maugis_dugdale_repulsion_from_a_users_view() -> None:
    """A complete diagram with touch, no fold (the energy is convex), and one state at every load."""
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.6, sign=-1)
    diagram = cb.trace(contact)
    assert (diagram.status, diagram.model.kind) == ("complete", "axisymmetric")
    assert [event.kind for event in diagram.events] == ["topology", "touch", "end"]
    branch = diagram.branches[0]
    assert not branch.unstable_load.any()
    assert not branch.unstable_displacement.any()
    assert np.all(np.diff(branch.load) > 0)
    assert np.all(np.diff(branch.displacement) > 0)
    touch = diagram.events[1]
    solution = cb.solve(contact, load=1.1 * touch.load)
    assert solution.contact_radius > 0
    assert len(solution.states) == 1
    assert solution.displacement == pytest.approx(cb.solve(contact, displacement=solution.displacement).displacement)
    assert diagram.local_exponent(touch).kappa[0] == pytest.approx(0.5, abs=0.01)


def test_pressure_largest_on_a_ring() -> None:
    """Under z = r⁴/4 the pressure reaches σ on a ring, with p ∝ (1 + 2x²)√(1 − x²) (Abel) at x² = 1/2.

    p(r) = (1/π)∫_r^c ζ'(t)/√(t² − r²) dt with ζ = 2t⁴/3 gives (8/9π) c³ (1 + 2x²)√(1 − x²), which is σ = 1 there for
    c³ = (9π/8)/√2.
    """
    contact = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.MaugisDugdale(-1.0, 1.0))
    curve = trace(contact, 1e-7, Target(5.0)).curve
    event = next(event for event in curve.events if event.kind == "topology")
    c = (9 * math.pi / 8 / math.sqrt(2)) ** (1 / 3)
    assert event.values[1] == pytest.approx(2 / 3 * c**4 - 1, abs=event.error[1])
    assert event.values[0] == pytest.approx(2 * (2 / 3) * c**5 * 4 / 5, abs=event.error[0])


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
    """`solve` finds states beyond the change of the contact set; their energies differ by the work of the load."""
    born = annulus.events[0]
    nodes = np.linspace(3.2, 3.3, 3)
    states = [cb.solve(BLUNT, displacement=float(d), accuracy=1e-8) for d in nodes]
    assert all(state.contact_radius > 0 and state.central_gap > 0 for state in states)
    assert born.displacement < 3.2
    work = 0.1 / 6 * np.array([1, 4, 1]) @ [state.load for state in states]
    assert states[-1].energy - states[0].energy == pytest.approx(float(work), abs=1e-7)


def test_convergence_with_the_order(step: Traced) -> None:
    """At fixed displacement the load's error falls by more than a factor 10 with every two nodes a panel."""
    row = int(np.argmin(np.abs(step.curve.displacement - 3.0)))
    point = step.points[row]
    problem = point.problem
    assert isinstance(problem, RingProblem)
    coarse = replace(problem.panels, halves=((0.3,), (0.3,), (0.3,)))
    loads = []
    for order in (4, 6, 8, 16):
        other = problem.on(replace(coarse, order=order))
        x, d = solved(other, problem.carried(point.x, point.x, other), point.parameter)
        loads.append(other.load(other.fields(x, d)))
    errors = np.abs(np.array(loads[:-1]) - loads[-1])
    assert np.all(errors[1:] < 0.1 * errors[:-1])
    assert errors[-1] < 1e-8
