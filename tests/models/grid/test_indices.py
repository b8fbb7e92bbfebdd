"""Folds and Morse indices along a lattice's chain of arcs, whose direction jumps where a node joins the contact."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import contbranch as cb
from contbranch.continuation import Point, StopAt
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.angle import Turning
from contbranch.curve.events import Ceiling, Folds, Slopes
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves
from contbranch.models.grid.equilibria import LatticeProblem
from contbranch.models.grid.walk import Row, Walker

REPULSION = cb.Contact.reduced("gauss", tabor=2.0, sign=-1)
CONTROLS = {"load": LOAD, "displacement": DISPLACEMENT}


@cache
def walker() -> Walker:
    model = cb.FreeSpace(cell=9.0, grid=96, averaging=False)
    problem = LatticeProblem(LatticeCurves(REPULSION, model).setup(Request(1e-6)), wall=True)
    return Walker(problem, Folds(tuple(CONTROLS.values()), print, Slopes()), Ceiling(LOAD, 10.0), StopAt())


def chain(places: list[tuple[float, float]], spacing: float = 1.0) -> list[Row]:
    """Rows at displacements and loads, so many rows of nodes apart."""
    problem = walker().problem
    return [
        Row(
            float(k),
            Point(
                problem,
                np.zeros(problem.size),
                load,
                np.zeros(problem.size),
                1.0,
                observables={
                    "load": load,
                    "displacement": displacement,
                    "contact_radius": k * spacing * walker().spacing,
                },
            ),
        )
        for k, (displacement, load) in enumerate(places)
    ]


@pytest.mark.parametrize(
    ("before", "after", "order", "start", "end"),
    [
        ((-0.3, -1.0), (1.0, 0.5), ["displacement", "load"], 1, 0),  # wetting: what follows is stable
        ((1.0, 0.3), (-0.3, -1.0), ["load", "displacement"], 0, 1),  # squeeze-out
        ((1.0, -0.3), (-0.5, 1.0), ["load", "displacement"], 1, 0),
        ((-0.5, 1.0), (1.0, -0.3), ["displacement", "load"], 0, 1),
        ((1.0, 0.5), (1.0, -0.5), ["load"], 0, 0),
    ],
)
def test_folds_of_one_corner_come_as_the_direction_turns_the_shorter_way(
    before: tuple[float, float], after: tuple[float, float], order: list[str], start: int, end: int
) -> None:
    ahead, beyond = np.add((20.0, 20.0), before), np.add((20.0, 20.0), np.add(before, after))
    rows = walker()._cornered(chain([(20.0, 20.0), tuple(ahead), tuple(ahead), tuple(beyond)]))
    assert [row.event for row in rows if row.event] == order
    turning = Turning(tuple(CONTROLS.values()), *reversed(before))
    for kind in order:
        turning.fold(CONTROLS[kind])
    assert turning.row(*reversed(after)) == []
    indices = turning.hodograph(start)
    (by_load, rise), (held, forward) = indices.pieces(LOAD), indices.pieces(DISPLACEMENT)
    assert (held[0], held[-1]) == (start, end)
    # One more mode is unstable at a fixed load than at a fixed displacement where the load falls with the displacement.
    assert (by_load - held == (rise * forward < 0)).all()
    assert ((forward[0], rise[0]), (forward[-1], rise[-1])) == (tuple(np.sign(before)), tuple(np.sign(after)))


def test_what_single_nodes_do_is_passed_over() -> None:
    """A displacement that goes back by a little has folds where it does over more than a row of nodes."""
    places = [(20.0, 20.0), (10.0, 10.0), (10.5, 9.9), (10.0, 9.0), (9.0, 8.0), (20.0, 20.0)]
    events = {
        apart: [row.event for row in walker()._cornered(chain(places, apart)) if row.event] for apart in (0.5, 1.5)
    }
    once = ["displacement", "load"]
    assert sorted(events[0.5]) == once
    assert [event for event in events[1.5] if event == "displacement"] == ["displacement"] * 3


def test_the_lattices_own_curve_has_the_folds_of_the_contact() -> None:
    found = cb.trace(REPULSION, model=cb.FreeSpace(cell=9.0, grid=96, averaging=False), modes=0)
    exact = cb.trace(REPULSION, modes=0)
    assert found.status == "complete", found.message
    order = [(event.kind, event.control, event.name) for event in found.events]
    fold = "fold"
    assert order == [
        (fold, "load", "squeeze-out"),
        (fold, "displacement", "squeeze-out"),
        ("touch", None, None),
        (fold, "displacement", "wetting"),
        (fold, "load", "wetting"),
        ("end", None, None),
    ]
    assert "averaged" not in {event.verdict for event in found.events}
    assert found.thresholds["wetting_load"] == pytest.approx(exact.thresholds["wetting_load"], abs=5.4e-2)
    branch = found.branches[0]
    for indices in (branch.unstable_load, branch.unstable_displacement):
        assert indices[np.r_[True, np.diff(indices) != 0]].tolist() == [0, 1, 0]
    # The wetting folds of a lattice are where the values are least.
    contact = branch.contact_radius > 0.0
    for event in found.events[3:5]:
        assert event.control is not None
        values = getattr(branch, event.control)[contact]
        assert getattr(event, event.control) == pytest.approx(values.min(), abs=1e-6)
