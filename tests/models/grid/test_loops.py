"""Quasi-static loops on lattices, against those of the axisymmetric model, which shares nothing with a lattice."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

import contbranch as cb
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.paths import CurveWalk
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves, equilibria
from contbranch.models.grid.equilibria import LatticeProblem

REPULSION = cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1)
ATTRACTION = cb.Contact.reduced(cb.Gauss, tabor=2.5)
CELL_64 = cb.FreeSpace(cell=12.0, grid=64)
CELL = cb.FreeSpace(cell=8.0, grid=64)


def agree(found: cb.Hysteresis, expected: cb.Hysteresis, tolerance: float) -> None:
    """Check jumps and energies within the error estimates, and these within a tolerance."""
    assert found.closed
    assert [jump.name for jump in found.jumps] == [jump.name for jump in expected.jumps]
    for jump, true in zip(found.jumps, expected.jumps, strict=True):
        assert jump.position == pytest.approx(true.position, abs=tolerance)
        assert abs(jump.dissipated - true.dissipated) <= jump.error + true.error
        assert jump.error <= tolerance
    assert abs(found.dissipated - expected.dissipated) <= found.error + expected.error


def test_repulsion_under_load() -> None:
    agree(*(cb.hysteresis(REPULSION, max_load=9.0, model=model) for model in (CELL, "auto")), 8e-3)


def test_attraction_under_displacement_control() -> None:
    found = cb.hysteresis(ATTRACTION, control="displacement", max_load=0.2, model=CELL)
    agree(found, cb.hysteresis(ATTRACTION, control="displacement", max_load=0.2), 2e-2)
    # the area between the branches is computed from loads and displacements alone, the dissipated energy from V
    for jump in found.jumps:
        assert jump.area == pytest.approx(jump.dissipated, rel=1e-3)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_where_a_jump_lands_next_to_an_average_is_known_by_that() -> None:
    """Half the nodes a side are too few for the law, and say nothing. The loop leads through the average."""
    contact = cb.Contact.reduced("exponential", tabor=1.5)
    loop, exact = (cb.hysteresis(contact, "displacement", max_load=0.2, **how) for how in ({"model": CELL_64}, {}))
    assert abs(loop.dissipated - exact.dissipated) < min(1e-2, loop.error)
    found, true = loop.jumps[0].to, exact.jumps[0].to
    for name in ("load", "contact_radius"):
        assert abs(getattr(found, name) - getattr(true, name)) <= found.error[name] < 0.2


def test_spring() -> None:
    """A spring so soft that the contact is lost to where nothing but rounding is left of the pressure."""
    contact = cb.Contact.reduced(cb.Gauss, tabor=1.0)
    spring = cb.Spring(1.0)
    found = cb.hysteresis(contact, control=spring, max_load=0.2, model=CELL)
    agree(found, cb.hysteresis(contact, control=spring, max_load=0.2), 2e-2)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_attraction_under_load_does_not_close() -> None:
    found = cb.hysteresis(ATTRACTION, max_load=1.0, model=cb.FreeSpace(cell=8.0, grid=48), accuracy=1e-4)
    assert not found.closed
    assert found.dissipated is None
    assert "infinite separation" in found.message


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_crossings_lie_at_the_value() -> None:
    request = Request(1e-6, DISPLACEMENT, 1.0)
    track = LatticeCurves(ATTRACTION, cb.FreeSpace(cell=8.0, grid=48)).track(request)
    walk = CurveWalk(track, (), DISPLACEMENT, 1e-6)
    stable = np.flatnonzero(walk.unstable == 0)
    for piece in (stable[2], stable[-2]):
        value = 0.3 * walk.values[piece] + 0.7 * walk.values[piece + 1]
        stop = walk.crossing(int(piece), float(value))
        assert stop.state.displacement == pytest.approx(value, abs=1e-9)
        ends = [walk.row(int(piece) + k).load for k in (0, 1)]
        assert min(ends) < stop.state.load < max(ends)


def test_events_on_grids_cannot_be_followed() -> None:
    event = cb.trace(REPULSION, model=cb.FreeSpace(cell=8.0, grid=32), max_load=9.0, accuracy=1e-4).events[0]
    with pytest.raises(cb.InputError, match="found on a grid"):
        cb.follow(event, vary="tabor", to=2.0)
    rough = cb.HeightMap.self_affine(16, 4.0, 0.8, rms_height=0.3, radius=1.0)
    contact = cb.Contact(tip=rough, interaction=cb.Gauss(work_of_adhesion=-1.0, range=0.3), modulus=1.0)
    with pytest.raises(cb.InputError, match="contact: its tip needs a grid"):
        cb.phase_diagram(contact, vary="tabor", between=(0.5, 1.0))


def test_a_soft_spring_is_held_as_exactly_as_a_load() -> None:
    """What the linear solver leaves of a soft spring's equation goes into the load: as way of the tip it would be far
    from the wall, and Newton's method found no state between two rows."""
    contact = cb.Contact.reduced(cb.Gauss, tabor=0.7)
    loop = cb.hysteresis(contact, control="spring:1e-4", model=cb.FreeSpace(cell=9.0, grid=48), accuracy=1e-4)
    assert (loop.status, [jump.name for jump in loop.jumps]) == ("complete", ["jump-in", "pull-off"])
    pull_off = loop.jumps[1]
    assert pull_off.dissipated == pytest.approx(pull_off.start.load**2 / 2e-4, rel=1e-3)  # the spring's energy


def test_folds_of_a_spring_and_of_the_load_in_one_state_end_a_stable_part() -> None:
    """The rows of both are equal: between them the curve does not go on, and does not rest either."""
    columns = {
        "load": [2.0, 1.0, 1.0, 2.0],
        "displacement": [0.0, 1.0, 1.0, 2.0],
        "contact_radius": [1.0, 2.0, 2.0, 3.0],
        "central_gap": [0.0] * 4,
    }

    def walk(columns):
        track = SimpleNamespace(
            column=lambda name: np.array(columns[name]),
            controlled=lambda _: np.array(columns["load"]),
            hodograph=SimpleNamespace(pieces=lambda _: (np.array([1, 0, 0]), np.array([-1, 1, 1]))),
            problem=lambda _: SimpleNamespace(refinable=False),
        )
        return CurveWalk(track, (), LOAD, 1e-6)

    assert walk(columns).unstable.tolist() == [1, 0, 0]
    resting = {**columns, "displacement": [0.0, 1.0, 1.5, 2.0]}
    assert walk(resting).unstable.tolist() == [1, 1, 0]


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_surfaces_all_at_the_wall_are_told_by_their_load() -> None:
    """Their displacements are the same; the loop asks for the state at zero load between two of them."""
    tip = cb.HeightMap.self_affine(16, cell=10.0, hurst=0.8, rms_slope=0.1, seed=3)
    contact = cb.Contact(tip, cb.Exponential(work_of_adhesion=0.1, range=0.6))
    branch = cb.trace(contact, max_load=1.0).branches[0]
    full = branch.contact_radius == branch.contact_radius[-1]
    assert full.sum() > 1
    assert np.all(np.diff(branch.load[full]) != 0.0)
    loop = cb.hysteresis(contact, max_load=1.0)
    assert (loop.status, loop.path.load[0]) == ("complete", pytest.approx(0.0, abs=1e-9))


@pytest.fixture(scope="module")
def rough() -> cb.Contact:
    heights = cb.HeightMap.self_affine(48, cell=2000.0, hurst=0.8, rms_slope=0.05, seed=3).heights
    tip = cb.HeightMap(heights, cell=2000.0, peaks=True)
    return cb.Contact(tip, cb.Exponential(work_of_adhesion=0.05, range=3.0), modulus=1.0)


SPRING = cb.Spring(1000.0)


def test_relaxations_beyond_a_fold_come_back_to_its_spring_position(rough: cb.Contact) -> None:
    loop = cb.hysteresis(rough, control=SPRING, max_load=500.0)
    assert (loop.status, len(loop.jumps)) == ("complete", 5)
    for jump in loop.jumps:
        for state in (jump.start, jump.to):
            assert state.displacement + state.load / SPRING.stiffness == pytest.approx(jump.position, abs=1e-6)


def test_a_state_off_the_curve_is_told_at_the_spring_position_of_the_fold(
    rough: cb.Contact, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LatticeProblem, "away", lambda *_: np.inf)
    loop = cb.hysteresis(rough, control=SPRING, max_load=500.0)
    assert (loop.status, len(loop.jumps)) == ("incomplete", 1)
    found = re.search(r"not on the traced curve \(load (\S+), displacement (\S+)\)", loop.message)
    load, displacement = map(float, found.groups())
    assert displacement + load / SPRING.stiffness == pytest.approx(loop.jumps[0].position, abs=1e-3)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize("stiffness", [1e-5, 1e-3, 1e-2])
def test_soft_springs_pull_the_contact_off_over_the_barriers_of_the_lattice(stiffness: float) -> None:
    """Between its nodes a lattice holds the contact at loads beyond the fold, which is that of an average."""
    contact, spring = cb.Contact.reduced(cb.Exponential, tabor=1.0), cb.Spring(stiffness)
    loop = cb.hysteresis(contact, control=spring, model=cb.FreeSpace(cell=10.0, grid=48), accuracy=1e-4)
    exact = cb.hysteresis(contact, control=spring)
    assert (loop.status, [jump.name for jump in loop.jumps]) == ("complete", ["jump-in", "pull-off"])
    assert abs(loop.dissipated - exact.dissipated) <= loop.error + exact.error
    found, true = loop.jumps[1], exact.jumps[1]
    assert abs(found.to.displacement - true.to.displacement) <= found.start.error["load"] / stiffness


def small_map(seed: int) -> cb.Contact:
    """A rough surface of few nodes that attracts."""
    heights = cb.HeightMap.self_affine(32, cell=2000.0, hurst=0.8, rms_slope=0.05, seed=seed).heights
    tip = cb.HeightMap(heights, cell=2000.0, peaks=True)
    return cb.Contact(tip, cb.Exponential(work_of_adhesion=0.05, range=3.0), modulus=1.0)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_steps_along_a_rough_contact_pass_over_no_folds_but_shallow_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    def folds() -> list[cb.Event]:
        return list(cb.trace(small_map(4), control="displacement", max_load=500.0).folds("displacement"))

    found = folds()
    monkeypatch.setattr(equilibria, "ANGLE", 0.1)
    close = folds()
    pairs = zip(close[::2], close[1::2], strict=True)
    deep = [fold for pair in pairs if abs(pair[0].displacement - pair[1].displacement) > 1e-3 for fold in pair]
    assert len(deep) == 4
    for fold in deep:
        assert min(abs(fold.load - other.load) for other in found) < 0.01 * abs(fold.load)


# Of `small_map(3)`, by `tests/reference/explicit_relaxation.py`, the displacement raised and lowered in steps of 5e-4
# from 3.5 to 3.772, of 4e-3 to 7.42 and of 1e-3 from 7.38 to 7.6: between which displacements the load jumps, and the
# load behind the jump.
RAISED = [
    (3.7245, 3.725, -2656.3),
    (3.7255, 3.726, -2719.8),
    (3.7635, 3.764, -2967.9),
    (7.425, 7.426, -4719.1),
    (7.441, 7.442, -5250.5),
    (7.576, 7.577, -5584.2),
]
LOWERED = [
    (7.574, 7.573, -5500.6),
    (7.408, 7.407, -4469.7),
    (3.7635, 3.763, -2925.7),
    (3.725, 3.7245, -2647.9),
    (3.7025, 3.702, -2198.7),
]


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_jumps_of_a_small_map_are_those_of_explicit_relaxation() -> None:
    """Some folds are a single arc of one contact apart: where the steps begin must not decide whether they are seen."""
    loop = cb.hysteresis(small_map(3), control="displacement", max_load=500.0)
    assert loop.status == "complete"
    assert len(loop.jumps) == len(RAISED + LOWERED)
    for jump, (before, behind, load) in zip(loop.jumps, RAISED + LOWERED, strict=True):
        assert min(before, behind) < jump.position < max(before, behind)
        assert abs(jump.to.load - load) < 6.0  # the displacement is up to a step further


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_small_contacts_are_pulled_off_over_the_barriers_of_the_lattice() -> None:
    """The arcs next to the fold reach beyond it by fifty times the error of their average."""
    contact = cb.Contact.reduced(cb.Exponential, tabor=1.0)
    loop = cb.hysteresis(contact, "displacement", model=cb.FreeSpace(cell=10.0, grid=96), accuracy=1e-4)
    assert (loop.status, [jump.name for jump in loop.jumps]) == ("complete", ["jump-in", "pull-off"])


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_a_soft_spring_leads_to_where_no_load_is_left() -> None:
    """On half the nodes, with which the state there is compared, none is to be told by its load."""
    contact = cb.Contact.reduced(cb.Gauss, tabor=1.0)
    loop = cb.hysteresis(contact, cb.Spring(1e-4), model=cb.FreeSpace(cell=8.0, grid=64), accuracy=1e-4)
    assert (loop.status, len(loop.jumps)) == ("complete", 2)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_a_spring_loses_no_contact_to_infinite_separation() -> None:
    """So softly held, the tip comes to rest farther away than the curve begins."""
    contact = cb.Contact.reduced(cb.VanDerWaals, tabor=1.0)
    loop = cb.hysteresis(contact, cb.Spring(1e-4), model=cb.FreeSpace(cell=8.0, grid=32), accuracy=1e-4)
    assert (loop.status, loop.closed, loop.jumps[-1].to) == ("incomplete", False, None)
    assert "Where the jump from pull-off ends was not reached." in loop.message
