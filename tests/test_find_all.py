"""Coexisting equilibria: counts, stability, barriers, and what the traced curve alone does not show."""

from __future__ import annotations

import json

import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.find import disconnected
from contbranch.curve.solve import crossings, pieces_at
from contbranch.curve.trace import Request, trace


@pytest.fixture(scope="module")
def gauss():
    """What coexists at a load between the folds, at 47.45 and 83.87, of Gauss repulsion with μ_T = 4."""
    return cb.find_all(cb.Contact.reduced("gauss", 4.0, -1), load=60.0, accuracy=1e-8)


def test_film_and_contact_coexist_between_the_folds(gauss):
    for found, load, count in ((gauss, 60.0, 3), (cb.find_all(gauss.contact, load=100.0), 100.0, 1)):
        assert len(found) == count
        assert sum(state.unstable_load > 0 for state in found) == (count == 3)
        assert all(state.load == load for state in found)


def test_the_barrier_is_the_area_up_to_the_saddle(gauss):
    """dV/dd = F: the potential V − F₀ d rises from film to saddle by ∫ (F − F₀) dd along the curve."""
    contact, found = gauss.contact, gauss
    (told,) = (line for line in str(found).splitlines() if line.startswith("(0, 2)"))
    assert told.split()[2:] == ["1", *(f"{height:.6g}" for height in found.barriers[0].heights)]
    (barrier,) = found.barriers
    assert (barrier.stable, barrier.saddle) == ((0, 2), 1)
    walk = FollowedCurves(contact, cb.Axisymmetric()).path(Request(1e-9)).walk
    stops = [walk.crossing(piece, 60.0) for piece in pieces_at(walk.values, 60.0)]
    for side, stop, sense in ((0, stops[0], 1), (1, stops[2], -1)):
        first, last = (stop, stops[1]) if sense > 0 else (stops[1], stop)
        work = walk.work(first, last) - 60.0 * (last.state.displacement - first.state.displacement)
        assert barrier.heights[side] == pytest.approx(sense * work, abs=1e-7)
        assert barrier.heights[side] > 0


def test_the_closed_form_gives_all_there_are():
    found = cb.find_all(cb.Contact.reduced("maugis-dugdale", 1.0), displacement=-1.3)
    assert [state.unstable_displacement for state in found] == [0, 1, 0]
    assert [state.contact_radius > 0 for state in found] == [False, False, True]
    assert found.model.kind == "exact"
    assert len(found.stable) == 2


@pytest.mark.parametrize(
    ("law", "tabor", "sign", "field", "value"),
    [("gauss", 4.0, -1, "load", 60.0), ("exponential", 4.0, 1, "displacement", -1.0)],
)
def test_deflation_finds_what_the_curve_does_not_show(law, tabor, sign, field, value):
    """A curve that only shows its far end, as one that ends there would: every equilibrium beyond is found all the
    same, with each of them hidden in turn."""
    contact = cb.Contact.reduced(law, tabor, sign)
    track = trace(cb.Axisymmetric().problem(contact, 1e-8), Request(1e-8, events=False))
    found = crossings(track, field, value, 1e-8)
    control = LOAD if field == "load" else DISPLACEMENT
    for hidden in range(len(found)):
        known = [crossing for k, crossing in enumerate(found) if k != hidden]
        (other,) = disconnected(track, known, control, value, 1e-8)
        for a, b in zip(other.numbers, found[hidden].found.numbers, strict=True):
            assert a == pytest.approx(b, abs=1e-6 * max(1.0, abs(b)))


@pytest.mark.parametrize(
    ("contact", "displacement", "accuracy", "count"),
    [
        (cb.Contact(cb.Cone(0.979), cb.Gauss(1.0, 0.018683)), -0.925422, 1e-6, 3),  # far away, and two in contact
        (cb.Contact(cb.SphericalCap(1.739), cb.Layered(-1.0, 2.48045, 4.886487)), 2.435629, 1e-6, 3),
    ],
)
def test_what_a_coarse_mesh_adds_is_no_equilibrium(contact, displacement, accuracy, count):
    """Coarse meshes of the search hold steep fronts back, and do not end where a cap does; their states are no others,
    nor are those that differ by their errors."""
    found = cb.find_all(contact, displacement=displacement, control="displacement", accuracy=accuracy)
    assert len(found) == count == sum(found.connected)
    assert all(state.error["load"] <= accuracy * max(1.0, abs(state.load)) for state in found)


def test_the_state_asked_for_is_not_left_out_for_the_error_of_the_last_row():
    """The curve is traced a little beyond the load; at large ones its last row is told with less room than that."""
    assert len(cb.find_all(cb.Contact(cb.Cone(0.322), cb.Exponential(-1.0, 0.15)), load=3e5)) == 1


def test_the_window_limits_the_displacements():
    contact = cb.Contact.reduced("gauss", 4.0, -1)
    found = cb.find_all(contact, load=60.0, window=(12.15, 20.0))
    assert [state.contact_radius > 1 for state in found] == [True]
    assert found.window == (12.15, 20.0)
    assert found.barriers == ()


@pytest.mark.parametrize(
    "contact",
    [
        cb.Contact.reduced("maugis-dugdale", 1.0),
        cb.Contact.reduced("maugis-dugdale", 1.0, -1),
        # Strong laws of short range, whose gaps deflation tries to open beyond the largest number.
        cb.Contact(cb.Parabola(1.0), cb.VanDerWaals(1.0, 0.15) + cb.Exponential(-2.0, 0.3)),
    ],
)
def test_far_away_there_is_one_equilibrium(contact):
    """Before the curve begins the surfaces hardly feel each other: the gap is −d."""
    (state,) = cb.find_all(contact, displacement=-1000.0)
    assert state.central_gap == pytest.approx(1000.0, rel=1e-6)
    assert state.stable("displacement")


@pytest.mark.parametrize("arguments", [{}, {"load": 1.0, "displacement": 1.0}, {"load": 1.0, "window": (1.0, 0.0)}])
def test_wrong_arguments_are_named(arguments):
    with pytest.raises(cb.InputError, match=r"load|window"):
        cb.find_all(cb.Contact.reduced("gauss", 1.0, -1), **arguments)


def test_nothing_to_find():
    found = cb.find_all(cb.Contact.reduced("exponential", 1.0), load=-50.0)
    assert len(found) == 0
    assert found.status == "complete"
    assert "0 equilibria" in found.message


def test_the_command_lists_all(capsys):
    arguments = ["solve", "--interaction", "gauss", "--tabor", "4", "--repulsive", "--load", "60", "--all"]
    assert main([*arguments, "--json", "-"]) == 0
    states = json.loads(capsys.readouterr().out)["states"]
    assert len(states) == 3
    assert sum(state["unstable_load"] > 0 for state in states) == 1
    assert main([*arguments[:-2], "-1e3", "--all"]) == 2
    assert "no equilibrium" in capsys.readouterr().err


def test_next_to_a_fold_rows_are_as_accurate_as_what_is_asked():
    """Two states meet at a fold; rows with an error larger than its distance would tell of neither, or of both."""
    contact = cb.Contact(cb.PowerLaw(5.8, 1.0), cb.Layered(-1.0, 77.0, 500.0), 1000.0)
    diagram = cb.trace(contact, accuracy=1e-9, modes=0)
    fold = next(event for event in diagram.folds("load") if event.name == "pull-off-2")
    inside, outside = (cb.find_all(contact, load=fold.load + s, accuracy=1e-9).states for s in (2e-8, -2e-8))
    assert len(inside) == len(outside) + 2
    gaps = sorted(abs(state.central_gap - fold.central_gap) for state in inside)[:2]
    assert gaps[0] == pytest.approx(gaps[1], rel=0.1)
