"""Folds of averages over the nodes that join a contact, against the axisymmetric model, which has no nodes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import contbranch as cb
from contbranch.contact.contact import Contact
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves
from contbranch.models.grid.averaging import half_width, pieces
from contbranch.models.grid.equilibria import LatticeProblem
from contbranch.models.grid.measure import Direction, quietly

REPULSION = cb.Contact.reduced("gauss", tabor=2.0, sign=-1)
ATTRACTION = cb.Contact.reduced("exponential", tabor=2.0)
SMALL = cb.Contact.reduced("gauss", tabor=0.74, sign=-1)  # a fold within the first two rows of nodes


@cache
def on_lattice(contact: Contact, cell: float, grid: int) -> cb.Diagram:
    """The curve on a lattice, as several tests look at it."""
    return cb.trace(contact, model=cb.FreeSpace(cell=cell, grid=grid))


@cache
def exact(contact: Contact) -> cb.Diagram:
    """That of the axisymmetric model."""
    return cb.trace(contact)


def folds(diagram: cb.Diagram) -> list[tuple[str | None, str | None]]:
    return [(event.control, event.name) for event in diagram.events if event.kind == "fold"]


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize(
    ("contact", "cell", "grid", "name", "within"),
    [
        (REPULSION, 9.0, 64, "wetting_load", 0.05),
        (REPULSION, 9.0, 96, "wetting_load", 0.01),
        (SMALL, 9.31, 64, "wetting_load", 1e-3),
        (ATTRACTION, 10.0, 64, "pull_off_load", 5e-3),
    ],
)
def test_folds_are_the_contacts(contact: Contact, cell: float, grid: int, name: str, within: float) -> None:
    """Where single nodes make folds by the dozen: those of the contact, no other, and errors that hold."""
    found, known = on_lattice(contact, cell, grid), exact(contact)
    assert found.status == "complete"
    assert folds(found) == folds(known)
    assert abs(found.thresholds[name] - known.thresholds[name]) < within
    for event in found.events:
        if event.verdict == "averaged":
            (other,) = (e for e in known.events if (e.kind, e.control, e.name) == ("fold", event.control, event.name))
            for field in ("load", "displacement", "contact_radius"):
                assert abs(getattr(event, field) - getattr(other, field)) <= event.error[field]
    assert {event.verdict for event in found.events if event.contact_radius > 0.0 and event.kind == "fold"} == {
        "averaged"
    }


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_folds_of_a_film_next_to_each_other_are_two() -> None:
    """Squeeze-out under load and under displacement, where the film turns round sharply."""
    contact = cb.Contact.reduced("gauss", tabor=1.954, sign=-1)
    found = cb.trace(contact, "displacement", model=cb.FreeSpace(cell=9.19, grid=96), max_load=17.0, modes=0)
    exact = cb.trace(contact, "displacement", accuracy=1e-9, max_load=17.0, modes=0)
    for control in ("load", "displacement"):
        own, other = (next(e for e in one.folds(control) if e.name == "squeeze-out") for one in (found, exact))
        for field in ("load", "displacement"):
            assert abs(getattr(own, field) - getattr(other, field)) <= own.error[field] < 5e-5


def test_pieces_join_where_a_node_has_neither_gap_nor_pressure() -> None:
    curves = LatticeCurves(REPULSION, cb.FreeSpace(cell=9.0, grid=96))
    points = curves.track(Request(1e-6, target=14.5, modes=0, events=False)).points
    film = [point for point in points if point.observables["contact_radius"] == 0.0]
    setup, count = film[0].problem.setup, 0
    problem = LatticeProblem(setup, 1e-8, True, film)
    with quietly():
        towards = Direction.between(*(point.problem.at(point) for point in film[-2:]), setup.length)
        place = problem.corners.behind(problem.at(film[-1]), (0, 0), towards)
        for piece in pieces(problem, place):
            for state in (piece.begin, piece.end):
                rest = np.abs(problem.corners.margins(state))
                assert rest.min() < 1e-6
            assert piece.end.fields.gap.min() > -1e-6
            assert piece.middle.fields.excess[piece.middle.contact].min() > -1e-4
            count += 1
            if piece.end.contact.sum() > 60:
                break
    assert count > 20


def test_windows_fit_the_contact() -> None:
    """A part of the contact radius where that is small, some rows of nodes where it is not, few of many nodes."""
    assert half_width(0.0, 0.1) == pytest.approx(0.16)
    assert half_width(0.5, 0.1) == pytest.approx(0.3)
    assert half_width(1.0, 0.1) == pytest.approx(0.35)
    assert half_width(5.0, 0.1) == pytest.approx(0.22)


@pytest.mark.parametrize("grid", [10**6, 10**9])
def test_a_grid_larger_than_the_memory_is_refused(grid: int) -> None:
    with pytest.raises(cb.InputError, match=r"grid: 10+; it would take \S+ GiB of memory, .* use at most \d+"):
        cb.trace(REPULSION, model=cb.FreeSpace(cell=9.0, grid=grid))


@pytest.mark.parametrize(
    ("contact", "cell", "max_load", "name"),
    [
        (cb.Contact.reduced("gauss", tabor=0.89, sign=-1), 10.5, 9.0, "wetting"),
        (cb.Contact.reduced("exponential", tabor=0.8524), 12.5, 0.5, "pull-off"),
    ],
)
def test_folds_within_the_first_row_of_nodes(contact: Contact, cell: float, max_load: float, name: str) -> None:
    """At radii of a third of a row: the average knows where first touch is, and that nothing is linear behind it."""

    def fold(diagram: cb.Diagram) -> cb.Event:
        (found,) = (e for e in diagram.events if (e.kind, e.control, e.name) == ("fold", "displacement", name))
        return found

    models = cb.FreeSpace(cell=cell, grid=96), "auto"
    found, exact = (fold(cb.trace(contact, model=model, max_load=max_load, modes=0)) for model in models)
    assert exact.contact_radius < 0.6 * cell / 96
    for field in ("displacement", "contact_radius"):
        assert abs(getattr(found, field) - getattr(exact, field)) <= found.error[field]
    assert found.error["displacement"] < 7e-4


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_a_lattice_that_is_hopeless_states_no_error() -> None:
    """Van der Waals repulsion, fourteen times as stiff as the lattice: first touch is off by a fifth of its load."""
    contact = cb.Contact.reduced("van-der-waals", tabor=3.33, sign=-1)
    found = cb.trace(contact, "displacement", model=cb.FreeSpace(cell=11.9, grid=48), modes=0)
    exact = cb.trace(contact, "displacement", modes=0)
    for event in found.events:
        (other,) = (e for e in exact.events if (e.kind, e.control, e.name) == (event.kind, event.control, event.name))
        assert abs(event.load - other.load) <= event.error["load"]


def test_a_fold_at_a_row_is_one_fold() -> None:
    """Here a step ends within 1e-5 of the squeeze-out fold: it was two folds that no error could tell apart."""
    contact = cb.Contact.reduced("gauss", tabor=0.8199181789703047, sign=-1)
    found = cb.trace(contact, "displacement", model=cb.FreeSpace(cell=11.58146480150417, grid=48), modes=0)
    assert folds(found) == [("load", "squeeze-out"), ("load", "wetting")]


def test_exponents_of_averaged_folds() -> None:
    """κ next to the wetting folds is that of the axisymmetric model, within the errors stated, and 1/2 in the end."""
    diagrams = exact(REPULSION), on_lattice(REPULSION, 9.0, 96)
    for control in ("load", "displacement"):
        folds = [next(e for e in d.events if (e.control, e.name) == (control, "wetting")) for d in diagrams]
        true, found = (d.local_exponent(fold) for d, fold in zip(diagrams, folds, strict=True))
        assert len(found.kappa) > 5
        assert found.error.min() < 0.1
        expected = np.interp(np.log(found.excess), np.log(true.excess), true.kappa)
        assert (np.abs(found.kappa - expected) <= found.error).all()
        known, averaged = (fold.exponent for fold in folds)
        assert known is not None
        assert averaged is not None
        assert averaged.prefactor == pytest.approx(known.prefactor, rel=0.03)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
def test_curvatures_of_averaged_folds_are_the_contacts() -> None:
    """Told over rows of nodes, not by the ripples: prefactor and crossover of the pull-off, as without a grid."""
    diagrams = exact(ATTRACTION), on_lattice(ATTRACTION, 10.0, 64)
    known, found = (next(e for e in d.events if (e.control, e.name) == ("load", "pull-off")) for d in diagrams)
    assert found.exponent.prefactor == pytest.approx(known.exponent.prefactor, rel=0.02)
    assert found.exponent.crossover_load == pytest.approx(known.exponent.crossover_load, rel=0.3)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize(("law", "tabor", "cell"), [(cb.Exponential, 1.0, 10.0), (cb.VanDerWaals, 1.1789, 12.0)])
def test_rows_turn_round_at_folds_alone_where_averages_begin_and_end(law, tabor: float, cell: float) -> None:
    """Rows of the lattice's own ripple about the average that they follow, or precede."""
    contact = cb.Contact.reduced(law, tabor=tabor)
    diagram = cb.trace(contact, model=cb.FreeSpace(cell=cell, grid=48), max_load=12.0)
    (branch,) = diagram.branches
    events = np.array([event.position for event in diagram.events])
    assert len(np.unique(branch.contact_radius[branch.contact_radius > 0.0])) == (branch.contact_radius > 0.0).sum()
    for values in (branch.load, branch.displacement):
        rises = np.diff(values)
        turns = 1 + np.flatnonzero(rises[1:] * rises[:-1] < 0.0)
        assert all(np.abs(events - turn).min() <= 1.0 for turn in turns)
