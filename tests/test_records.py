"""Results are plain data: they compare by their numbers, pickle, copy, and are written as documents and files."""

from __future__ import annotations

import copy
import json
import pickle
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import contbranch as cb
from contbranch.output.hdf5 import load
from contbranch.results.diagram import Event
from contbranch.results.record import Record, columns
from contbranch.watch import patient

CELL = cb.Contact(cb.HeightMap(np.random.default_rng(0).normal(size=(16, 16)), 3.0), cb.Gauss(0.1, 0.5))
RESTING = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)
PHYSICAL = cb.Contact.physical(
    radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="-40 mN/m", range="1 nm"
)
ATTRACTION = cb.Contact.reduced("exponential", tabor=2.0)
EXACT = cb.Contact.reduced("maugis-dugdale", tabor=1.0)


MAKERS = {
    "diagram": lambda made: cb.trace(PHYSICAL, accuracy=1e-4),
    "with a spring": lambda made: cb.trace(ATTRACTION, control=cb.Spring(2.0), accuracy=1e-4, max_load=1.0),
    "exact diagram": lambda made: cb.trace(EXACT),
    "rings": lambda made: cb.trace(RESTING, accuracy=1e-3, max_load=1.0, modes=0),
    "event": lambda made: made["diagram"].events[0],
    "state": lambda made: made["diagram"].branches[0].state(3),
    "solution": lambda made: cb.solve(PHYSICAL, load=265.0, accuracy=1e-4),
    "on a grid": lambda made: cb.solve(CELL, load=1.0),
    "exact solution": lambda made: cb.solve(EXACT, load=0.5),
    "equilibria": lambda made: cb.find_all(PHYSICAL, load=265.0, accuracy=1e-4),
    "loop": lambda made: cb.hysteresis(ATTRACTION, control=cb.Spring(2.0), accuracy=1e-4, max_load=1.0),
    "exact loop": lambda made: cb.hysteresis(EXACT, control="displacement", accuracy=1e-4),
    "followed": lambda made: cb.follow(pull_off(made["with a spring"]), vary="tabor", to=1.5, accuracy=1e-4),
    "phase": lambda made: cb.phase_diagram(EXACT, "tabor", (0.5, 1.5), "displacement", samples=3, accuracy=1e-4),
    "local exponent": lambda made: made["diagram"].local_exponent(next(made["diagram"].folds("load"))),
}


class Results(dict[str, Record]):
    """A result of every kind, and of the models whose results hold what computes their parts, made when asked for."""

    def __missing__(self, kind: str) -> Record:
        return self.setdefault(kind, MAKERS[kind](self))


def pull_off(diagram: cb.Diagram) -> Event:
    return next(event for event in diagram.folds("load") if event.name == "pull-off")


@pytest.fixture(scope="module")
def results() -> Results:
    return Results()


@pytest.mark.parametrize("kind", MAKERS)
def test_copies_are_equal(results: dict[str, Record], kind: str) -> None:
    result = results[kind]
    for other in (copy.copy(result), copy.deepcopy(result), pickle.loads(pickle.dumps(result))):
        assert type(other) is type(result)
        assert other is not result
        assert other == result
    assert pickle.loads(pickle.dumps(other)) == result  # what was pickled, which computes nothing any more


@pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind not in ("event", "state", "local exponent")])
def test_documents_are_json_and_files_hold_them(results: dict[str, Record], kind: str, tmp_path: Path) -> None:
    result = results[kind]
    document = result.document()
    assert {"format", "version", "contact", "units", "status", "message", "cost"} <= set(document)
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert pickle.loads(pickle.dumps(result)).document() == document
    result.save(tmp_path / "x.h5")
    with h5py.File(tmp_path / "x.h5") as file:
        stored = file.attrs["format"]
    assert stored == ("contbranch-diagram" if "solution" in document["format"] else document["format"])


def test_a_pickled_diagram_answers_what_the_traced_one_does(results: dict[str, Record]) -> None:
    diagram = results["diagram"]
    other = pickle.loads(pickle.dumps(diagram))
    for event, same in zip(diagram.events, other.events, strict=True):
        assert same.exponent == event.exponent
        if event.kind == "fold":
            assert other.local_exponent(same) == diagram.local_exponent(event)
    for number in (0, 5):
        assert other.branches[0].state(number).profile == diagram.branches[0].state(number).profile
    assert other.branches[0].critical_eigenvalue == pytest.approx(diagram.branches[0].critical_eigenvalue)
    loop = results["loop"]
    assert pickle.loads(pickle.dumps(loop)).area == loop.area
    grid = results["on a grid"]
    assert pickle.loads(pickle.dumps(grid)).cell == grid.cell


def test_local_exponents_are_sampled_once_unless_that_has_ended_early() -> None:
    diagram = cb.trace(PHYSICAL, accuracy=1e-4, modes=0)
    fold = next(diagram.folds("load"))
    with patient(0.0):
        early = diagram.local_exponent(fold)
    whole = diagram.local_exponent(fold)
    assert len(early.kappa) < len(whole.kappa)
    assert diagram.local_exponent(fold) is whole


def test_what_was_pickled_says_that_it_cannot_be_solved_again(results: dict[str, Record]) -> None:
    followed = results["followed"]
    assert copy.deepcopy(followed).at(1.75) == followed.at(1.75)
    with pytest.raises(cb.InputError, match="follow the event again"):
        pickle.loads(pickle.dumps(followed)).at(1.75)
    with pytest.raises(cb.InputError, match="event"):
        cb.follow(pickle.loads(pickle.dumps(results["event"])), vary="tabor", to=1.0)


def test_results_that_differ_in_one_number_are_not_equal(results: dict[str, Record]) -> None:
    diagram = results["diagram"]
    branch = diagram.branches[0]
    load = branch.load.copy()
    load[-1] += 1e-9
    assert diagram != replace(diagram, branches=(replace(branch, load=load),))
    assert diagram != replace(diagram, events=diagram.events[1:])
    assert diagram != results["with a spring"]
    state = branch.state(2)
    assert state != replace(state, profile=None)
    unknown = replace(state, energy=np.nan)
    assert unknown == replace(unknown)


def test_a_saved_diagram_is_equal_to_the_traced_one(results: dict[str, Record], tmp_path: Path) -> None:
    for kind in ("diagram", "with a spring", "exact diagram"):
        results[kind].save(tmp_path / "x.h5")
        found = load(tmp_path / "x.h5")
        assert found == results[kind]
        assert [event.exponent for event in found.events] == [event.exponent for event in results[kind].events]


def test_columns_of_events_are_those_of_the_documented_table() -> None:
    documented = (Path(__file__).parent.parent / "docs" / "file-layout.md").read_text(encoding="utf-8")
    names = [column.name for column in columns(Event)]
    assert len(set(names)) == len(names)
    assert [name for name in names if f"`{name}`" not in documented] == []
