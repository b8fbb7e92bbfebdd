"""What a grid says of its own limits: error estimates, filled cells, and values beyond the default end of a curve."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import contbranch as cb
from contbranch.errors import InputError
from contbranch.output.summary import with_error
from contbranch.watch import Interruption

FILM = cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1)


@pytest.mark.parametrize("displacement", [2.5, 6.0])
def test_errors_at_a_displacement_are_of_the_size_of_the_errors(displacement):
    """Against the axisymmetric model, which shares no lattice: errors below estimates, and these of a sensible size."""
    exact = cb.solve(FILM, displacement=displacement, accuracy=1e-9)
    state = cb.solve(FILM, displacement=displacement, model=cb.FreeSpace(cell=12.0, grid=96))
    assert state.error["displacement"] < 1e-5
    assert abs(state.load - exact.load) < 2.0 * state.error["load"]
    assert abs(state.contact_radius - exact.contact_radius) < 2.0 * state.error["contact_radius"]
    assert state.error["load"] < 0.01 * exact.load
    assert state.error["contact_radius"] < 0.1 * exact.contact_radius


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize("law", [None, cb.Gauss])
def test_a_contact_that_fills_its_cell_is_not_silent(law):
    """The contact radius is (3F/4)^(1/3) by Hertz, more than half of the cell of 8: it needs one of 2 a at least."""
    load = 1000.0
    contact = cb.Contact.reduced(law, **({} if law is None else {"sign": -1}))
    message = cb.solve(contact, load=load, model=cb.FreeSpace(cell=8.0, grid=48)).message
    assert "contact has reached its border" in message
    cell = float(message.split("use a cell of about ")[1].split()[0])
    assert 2.0 * (0.75 * load) ** (1.0 / 3.0) < cell < 100.0


@pytest.mark.parametrize("displacement", [6.0, -40.0])
def test_find_all_goes_as_far_as_the_displacement_asked_for(displacement):
    exact = cb.solve(FILM, displacement=displacement)
    found = cb.find_all(FILM, displacement=displacement, model=cb.FreeSpace(cell=12.0, grid=48))
    assert len(found.states) == 1
    assert found.states[0].load == pytest.approx(exact.load, abs=max(1e-8, 0.01 * abs(exact.load)))


@pytest.mark.filterwarnings("error::contbranch.GridWarning")
def test_the_cell_chosen_for_find_all_holds_the_curve():
    contact = cb.Contact(cb.EllipticParaboloid(1.4, 1.0 / 1.4), FILM.interaction)
    found = cb.find_all(contact, load=1.0, model=cb.FreeSpace(grid=48))
    assert len(found.states) == 1
    assert "cell" not in found.message


def test_a_grid_without_a_half_says_that_errors_are_unknown():
    diagram = cb.trace(FILM, model=cb.FreeSpace(cell=8.0, grid=38), max_load=9.0)
    assert "divisible by 4, such as 40" in diagram.message


def test_a_contact_without_a_node_has_an_uncertain_radius():
    """The fold in displacement lies after first touch; its radius is 0.1674 by the axisymmetric model."""
    contact = cb.Contact.reduced(cb.Exponential)
    diagram = cb.trace(contact, model=cb.Periodic(cell=12.0, grid=64), max_load=1.0)
    fold = list(diagram.folds("displacement"))[-1]
    touch = next(event for event in diagram.events if event.kind == "touch")
    assert touch.central_gap == 0.0
    assert touch.error["contact_radius"] == 0.0
    assert fold.position > touch.position
    assert math.isfinite(fold.error["contact_radius"])
    assert abs(fold.contact_radius - 0.16745) < fold.error["contact_radius"] < 2.0


def test_near_must_be_a_state():
    with pytest.raises(InputError, match="near: int"):
        cb.solve(FILM, load=1.0, near=3, model=cb.FreeSpace(cell=8.0, grid=16))


@pytest.mark.parametrize("limit", [1.0, 8.06])
def test_the_end_of_a_curve_replaces_no_event(limit):
    """The curve ends in contact beyond both folds of the load; by the axisymmetric model there is one such state."""
    diagram = cb.trace(FILM, model=cb.FreeSpace(cell=8.0, grid=48), max_load=limit)
    assert diagram.status == "complete"
    assert [event.name for event in diagram.folds("load")] == ["squeeze-out", "wetting"]
    end = diagram.events[-1]
    assert end.kind == "end"
    states = cb.solve(FILM, load=end.load).states
    contact = next(state for state in states if state.contact_radius > 0.2)
    assert end.displacement == pytest.approx(contact.displacement, abs=0.02)


def test_a_cell_that_is_not_that_of_the_map_is_named_in_the_units_of_the_contact():
    nodes = np.arange(16) * 120.0 / 16.0
    heights = 5.0 * (2.0 - np.cos(2.0 * np.pi * nodes / 120.0)[:, None] - np.cos(2.0 * np.pi * nodes / 120.0))
    law = cb.Gauss(work_of_adhesion=0.1, range=5.0)
    contact = cb.Contact.physical(tip=cb.HeightMap(heights, 120.0), interaction=law, modulus="1 GPa")
    with pytest.raises(InputError, match="cell: 100; the height map has the cell 120"):
        cb.solve(contact, load=1.0, model=cb.Periodic(cell=100.0))


def test_an_unknown_error_is_printed_as_one():
    assert with_error(8.03242666, math.inf) == "8.03242666(?)"


def test_a_map_that_is_not_periodic_is_said_to_be_repeated():
    """A measured map, here half of a periodic one, has a step where the cell repeats it."""
    cut = cb.HeightMap.self_affine(64, 2.0, 0.8, rms_slope=0.3, seed=3).heights[:32, :32]
    law = cb.Gauss(0.02, 0.5)
    with pytest.warns(cb.GridWarning, match=r"^The height map is not periodic: across the edges .* use model='free'"):
        state = cb.solve(cb.Contact(cb.HeightMap(cut, 1.0), law), load=0.5, model=cb.Periodic())
    assert "The height map is not periodic" in state.message
    assert "periodic" not in cb.solve(cb.Contact(cb.HeightMap(cut, 1.0), law), load=0.5, model=cb.FreeSpace()).message


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_the_advice_for_a_tilted_map_is_to_level_it() -> None:
    """A window would make a cushion of the tilt: 25.8 % contact instead of 4.2 %."""
    rough = np.array(cb.HeightMap.self_affine(64, 1e4, 0.8, rms_height=35.0, seed=1).heights)
    tilted = rough + np.linspace(-390.0, 390.0, 64)[:, None]
    message = cb.solve(cb.Contact(cb.HeightMap(tilted, cell=1e4)), load=1e5).message
    assert "with that step; subtract its tilt with detrend='plane'." in message
    level = cb.HeightMap(tilted, cell=1e4, detrend="plane")
    assert level.rms_height == pytest.approx(35.0, rel=0.06)
    assert not level.tilted


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize(
    ("contact", "displacement", "held"),
    [
        (cb.Contact(cb.PowerLaw(1.93, 1.0), cb.VanDerWaals(-1.0, 1.145)), -1.49, "load"),
        (cb.Contact(cb.SphericalCap(5.0), cb.Exponential(-1.0, 1.886)), -2.16, "displacement"),
        (cb.Contact(cb.Parabola(1.0), cb.InverseSquare(1.0, 0.8)), 1.0, "load"),
    ],
)
def test_what_a_cell_leaves_out_of_what_is_held_is_felt_in_the_rest(
    contact: cb.Contact, displacement: float, held: str
) -> None:
    """The force from beyond a free cell is no part of the load that is held."""
    true = cb.solve(contact, displacement=displacement, accuracy=1e-8)
    state = cb.solve(contact, **{held: getattr(true, held)}, model=cb.FreeSpace(grid=96))
    for name in ("load", "displacement", "contact_radius", "central_gap"):
        assert abs(getattr(state, name) - getattr(true, name)) <= state.error[name] + true.error[name] + 1e-9, name


def test_the_gap_within_a_ring_of_contact_is_open() -> None:
    """A flat tip touches on a ring first; there was no gap, and no error of it, wherever a node was in contact."""
    contact = cb.Contact(cb.PowerLaw(2.89, 1.0), cb.Exponential(-1.0, 0.88))
    state = cb.solve(contact, displacement=4.1, model=cb.FreeSpace(cell=8.0, grid=48))
    true = cb.solve(contact, displacement=4.1, accuracy=1e-4)
    assert 0.0 < state.contact_radius < true.contact_radius  # of a disc of the same area; the outer rim
    assert state.error["contact_radius"] > 0.0
    assert true.central_gap > 20 * true.error["central_gap"]
    assert abs(state.central_gap - true.central_gap) < state.error["central_gap"] < 1e-3


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_a_gap_that_may_be_closed_may_be_a_contact() -> None:
    """Of nodes too coarse for the law: the true contact has a radius of half a spacing, and the lattice has none."""
    contact = cb.Contact(cb.PowerLaw(1.73, 1.0), cb.VanDerWaals(1.0, 0.642))
    true = cb.solve(contact, displacement=-1.307)
    state = cb.solve(contact, displacement=-1.307, model=cb.FreeSpace(grid=32))
    assert true.contact_radius > state.contact_radius == 0.0
    assert 0.0 < state.central_gap < state.error["central_gap"]
    assert true.contact_radius < state.error["contact_radius"]


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize(
    ("tip", "law", "displacement"),
    [
        (cb.Parabola(1.0), cb.Exponential(1.0, 2.1), -11.2),
        (cb.Parabola(1.0), cb.VanDerWaals(-1.0, 3.9), 0.8),
        (cb.PowerLaw(1.73, 1.0), cb.VanDerWaals(1.0, 0.6), -32.0),
        (cb.Cone(0.5), cb.Exponential(1.0, 4.0), -20.0),
    ],
    ids=["film", "contact", "apart", "cone"],
)
def test_energies_lack_what_lies_beyond_a_free_cell(tip: cb.Tip, law: cb.Interaction, displacement: float) -> None:
    """They lack forty times and more what two lattices in the same cell differ by."""
    contact = cb.Contact(tip, law)
    true = cb.solve(contact, displacement=displacement, accuracy=1e-8)
    state = cb.solve(contact, displacement=displacement, model=cb.FreeSpace(grid=48))
    assert 0.02 * state.error["energy"] < abs(state.energy - true.energy) < state.error["energy"]


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_the_edge_of_a_cap_is_known_to_be_a_staircase() -> None:
    """A film that presses on the edge: lattices of N and N/2 nodes both miss part of the step of its pressure there."""
    contact = cb.Contact(cb.SphericalCap(5.0), cb.Gauss(-1.0, 1.617))
    true = cb.trace(contact, "displacement", 1e-7, max_load=5.0, modes=0)
    found = cb.trace(contact, "displacement", max_load=5.0, model=cb.FreeSpace(grid=72), modes=0)
    assert [(e.kind, e.name, e.control) for e in found.events] == [(e.kind, e.name, e.control) for e in true.events]
    for one, other in zip(found.events[:-1], true.events[:-1], strict=True):
        for name in ("load", "displacement", "contact_radius", "central_gap"):
            off = abs(getattr(one, name) - getattr(other, name))
            assert off <= one.error[name] + other.error[name], (one.name, one.control, name)
            assert one.error[name] < 0.05 * max(1.0, abs(getattr(other, name)))


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_states_next_to_first_touch_are_found_between_the_film_and_the_average() -> None:
    """A row of the lattice and one of the average of its arcs have no representation in common."""
    contact = cb.Contact(cb.EllipticParaboloid(2.0, 0.5), cb.VanDerWaals(-1.0, 1.1))
    model = cb.FreeSpace(cell=10.0, grid=48)
    branch = cb.trace(contact, "displacement", model=model).branches[0]
    row = int(np.flatnonzero(branch.contact_radius > 0.0)[0])
    for share, k in ((0.7, row - 1), (0.2, row)):
        d, load = (float((1 - share) * c[k] + share * c[k + 1]) for c in (branch.displacement, branch.load))
        states = cb.find_all(contact, displacement=d, model=model)
        loads = sorted(state.load for state in states)
        assert len(loads) == 3
        assert min(np.diff(loads)) > 1e-4  # none twice
        assert min(abs(one - load) for one in loads) < 0.2  # rows are far apart, errors of 0.03


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_a_cell_is_chosen_for_a_tip_far_away() -> None:
    """Farther than its interaction reaches: there is a state, with next to no load."""
    contact = cb.Contact(cb.EllipticParaboloid(2.0, 0.5), cb.Exponential(1.0, 0.8))
    for found in (
        cb.solve(contact, displacement=-40.0, model=cb.FreeSpace(grid=48)),
        cb.find_all(contact, displacement=-40.0, model=cb.FreeSpace(grid=48))[0],
    ):
        assert found.central_gap == pytest.approx(40.0, abs=0.1)
        assert abs(found.load) < 0.01


def test_the_value_of_a_row_is_found_again() -> None:
    """In other units it may differ from that row's by rounding, and the state found from it lies beyond the row."""
    tip = cb.HeightMap.self_affine(48, 10.0, 0.6, rms_slope=0.2, seed=3)
    contact, model = cb.Contact(tip, cb.Exponential(-0.1, 0.7)), cb.Periodic(grid=48)
    branch = cb.trace(contact, max_load=2.0, model=model).branches[0]
    for row in range(1, len(branch.load) - 1, 6):
        for off in (1e-10, -1e-10):
            states = cb.find_all(contact, load=float(branch.load[row]) * (1.0 + off), model=model)
            assert min(abs(s.displacement - branch.displacement[row]) for s in states) < 1e-4


def test_a_map_lies_where_it_was_given() -> None:
    """Below its one summit the gap is least, on every grid at the coordinates of that node."""
    x = np.arange(32) * 0.25
    heights = 0.3 * (1 - np.exp(-((x[:, None] - 2.0) ** 2 + (x - 5.0) ** 2) / 1.5))
    tip = cb.HeightMap(heights, cell=8.0)
    for grid in (32, 64):
        state = cb.solve(cb.Contact(tip, cb.Exponential(-0.02, 0.3)), load=0.05, model=cb.Periodic(grid=grid))
        cell = state.cell
        lowest = np.unravel_index(np.argmin(cell.gap), cell.gap.shape)
        assert (cell.x[lowest[0]], cell.y[lowest[1]]) == (2.0, 5.0)
        assert cell.gap[lowest] < 0.9 * cell.gap.max()


def test_steep_tips_are_noted_on_grids_too() -> None:
    known = {"modulus": "1 GPa", "interaction": cb.Exponential(0.02, 0.3)}
    heights = np.random.default_rng(0).random((16, 16))
    for tip, model, words in (
        (cb.EllipticParaboloid(10.0, 9.0), cb.FreeSpace(cell=40.0, grid=32), "at the rim of the contact exceeds 0.3"),
        (cb.HeightMap(heights, cell="8 nm"), cb.Periodic(grid=16), r"slope \(rms\) exceeds 0.3"),
    ):
        assert re.search(words, cb.solve(cb.Contact.physical(tip=tip, **known), load=100.0, model=model).message)


def test_a_film_as_far_away_as_rounding_goes_bears_no_load() -> None:
    """So far away that a unit in the last place of u weighs more than the load, any load would seem balanced."""
    tip = cb.HeightMap.self_affine(32, 10.0, 0.8, rms_slope=0.1, seed=1)
    contact = cb.Contact(tip, cb.Exponential(0.02, 0.3))
    for load in (0.02, 0.1):
        states = cb.find_all(contact, load=load).states if load == 0.02 else cb.solve(contact, load=load).states
        assert states
        assert all(abs(state.displacement) < 100.0 for state in states)
        assert all(math.isfinite(state.error["energy"]) for state in states)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_a_contact_does_not_open_again_by_a_leap() -> None:
    """Steps that fail behind first touch must not end on the film, along which the curve would run back for ever."""
    contact = cb.Contact(cb.Parabola(1.0), cb.VanDerWaals(-1.0, 0.73))
    film = cb.trace(contact, model=cb.FreeSpace(cell=10.0, grid=96), max_load=12.0, modes=0)
    assert film.status == "complete", film.message
    assert film.branches[0].displacement.min() == film.branches[0].displacement[0]
    exact = cb.trace(contact, max_load=12.0, modes=0)
    for name in ("squeeze_out_load", "wetting_load", "touch_load"):
        event = min(film.events, key=lambda one, load=film.thresholds[name]: abs(one.load - load))
        assert abs(film.thresholds[name] - exact.thresholds[name]) <= event.error["load"]


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize("cell", [12.0, 22.0])
def test_a_cell_too_small_for_a_cone_is_known_to_be(cell: float) -> None:
    """Heights of a cone grow as the distance only: outside of a small cell there is more than what is inside."""
    contact = cb.Contact(cb.Cone(slope=0.5), cb.Exponential(-1.0, 1.0))
    exact = next(event for event in cb.trace(contact, modes=0).events if event.kind == "touch")
    diagram = cb.trace(contact, model=cb.FreeSpace(cell=cell, grid=48))
    touch = next(event for event in diagram.events if event.kind == "touch")
    assert abs(touch.load - exact.load) <= 1.5 * touch.error["load"]
    advised = float(re.search("use a cell of about ([0-9.]+)", diagram.message)[1])
    assert advised > 70.0


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_films_on_a_ramp_say_how_wide_it_is() -> None:
    film = cb.Contact(cb.PowerLaw(2.887, 1.0), cb.MaugisDugdale(-1.0, 0.635))
    repelled = cb.trace(film, model=cb.FreeSpace(cell=12.0, grid=48), max_load=22.0)
    assert "a ramp of ±50 % of its range" in repelled.message


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_advice_that_is_interrupted_costs_no_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise Interruption

    monkeypatch.setattr("contbranch.models.grid.size.chosen_size", interrupted)
    contact = cb.Contact(cb.Cone(slope=0.5), cb.Exponential(-1.0, 1.0))
    diagram = cb.trace(contact, model=cb.FreeSpace(cell=12.0, grid=48))
    assert len(diagram.branches[0]) > 10
    assert "use a cell of about" in diagram.message
