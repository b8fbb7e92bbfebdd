"""Indices of traces on lattices, and single states however they are found."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import contbranch as cb
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves
from contbranch.models.grid.measure import quietly
from contbranch.models.grid.newton import Hold, Settings, hold_control, newton
from contbranch.models.grid.setup import Setup

ROUND = cb.Contact(cb.Parabola(1.0), cb.Gauss(-1.0, 1.0))
EDGE = 8.0
REQUEST = Request(1e-6)


class Traced:
    """A curve on a lattice, its rows and events."""

    def __init__(self, contact, model, request=REQUEST):
        self.track = LatticeCurves(contact, model).track(request)
        with quietly():
            self.curve = raw_curve(self.track, request)
        self.points = self.track.points
        self.indices = self.track.hodograph
        self.setup = self.track.problem(0).setup


@pytest.fixture(scope="module")
def parabola():
    return Traced(ROUND, cb.FreeSpace(EDGE, 64))


def test_indices_are_confirmed_at_little_cost(parabola):
    assert parabola.curve.complete
    assert parabola.curve.message == ""
    assert max(parabola.indices.rows(DISPLACEMENT)) == 1
    assert 0 < parabola.curve.cost.stability_pairs < 0.15 * parabola.curve.cost.fft_pairs


def test_a_convex_energy_is_not_examined():
    """v'' ≥ 0: one equilibrium for every displacement."""
    contact = cb.Contact(cb.Parabola(1.0), cb.Exponential(-1.0, 1.0))
    curve = Traced(contact, cb.FreeSpace(2.0 * EDGE, 32), Request(1e-5)).curve
    assert curve.cost.stability_pairs == 0


def test_a_fold_that_is_missing_contradicts(parabola):
    """Counted with one fold too many or too few, the index is not that of the eigenvalues."""
    request = Request(1e-6, modes=0)
    turns = parabola.indices.turns
    folds = [mark.row for mark in parabola.track.marks if mark.kind == "fold"]
    for row in (folds[0] // 2, (folds[0] + folds[1]) // 2 + 1):
        turned = {control: own - (np.arange(len(own)) >= row) for control, own in turns.items()}
        with quietly():
            found = raw_curve(replace(parabola.track, hodograph=replace(parabola.indices, turns=turned)), request)
        assert not found.complete
        assert "a fold was missed, or is none" in found.message


# One state, however it is found


@pytest.mark.parametrize("kind", ["periodic", "free"])
def test_quarter_and_whole_lattice_agree(kind):
    """The same held states from the same starts: load and displacement to 1e-10, contact and film."""
    setup = Setup(ROUND, kind, (EDGE, EDGE), (32, 32))
    whole = setup.whole()
    settings = Settings(tolerance=1e-12)
    for load, weights, value in ((9.0, (1.0, 0.0), 9.0), (2.0, (0.0, 1.0), 1.0), (12.0, (1.0, 0.0), 12.0)):
        start = (
            np.maximum(0.3 - setup.problem.heights, -1.0) if load < 12.0 else -np.minimum(setup.problem.heights, 1.5)
        )
        found = []
        for one, u in ((setup, start), (whole, setup.lattice.unfold(start))):
            found.append(newton(one.problem, u, load, hold_control(one.problem, *weights, value), settings=settings))
        quarter, full = found
        assert quarter.converged
        assert full.converged
        assert full.load == pytest.approx(quarter.load, abs=1e-10)
        assert full.displacement == pytest.approx(quarter.displacement, abs=1e-10)
        assert np.abs(full.u - setup.lattice.unfold(quarter.u)).max() < 1e-9


def test_load_and_displacement_lead_to_the_same_states(parabola):
    """At a row's load, and at its displacement, starting with its state: the same fields, on unstable parts too."""
    problem, settings = parabola.setup.problem, Settings(tolerance=1e-11)
    folds = [mark.row for mark in parabola.track.marks if mark.kind == "fold"]
    edges = [0, *folds, len(parabola.points) - 1]
    own = [k for k, point in enumerate(parabola.points) if point.x.size == problem.heights.size]
    for first, last in pairwise(edges):
        inside = [k for k in own if first < k < last]
        if not inside:
            continue
        point = parabola.points[inside[len(inside) // 2]]
        row = point.problem.at(point)
        by_load = newton(problem, row.u, row.load, Hold(row.load), row.contact, settings)
        hold = hold_control(problem, 0.0, 1.0, by_load.displacement)
        by_displacement = newton(problem, row.u, row.load, hold, row.contact, settings)
        assert by_load.converged
        assert by_displacement.converged
        assert np.abs(by_load.u - by_displacement.u).max() < 1e-8
        assert by_displacement.load == pytest.approx(row.load, abs=1e-8)


def test_an_end_next_to_folds_is_the_last_row():
    """A map of a few waves under repulsion, ended where the contact has just grown: each fold keeps its mark.

    Besides, single nodes make folds that differ by less than the lattice's error, and say so.
    """
    nodes = np.arange(48) / 48 * 2.0 * np.pi
    waves = np.cos(nodes[:, None]) + 0.8 * np.cos(nodes + 0.4) + 0.3 * np.cos(2.0 * nodes[:, None] + nodes)
    contact = cb.Contact(cb.HeightMap(0.6 * waves, cell=EDGE, radius=1.0), cb.Gauss(-1.0, 1.0))
    found = Traced(contact, cb.Periodic(EDGE, 48), Request(1e-6, target=20.0))
    known = [event for event in found.curve.events if event.kind != "touch" and event.verdict != "unresolved"]
    marks = [(event.kind, event.control) for event in known]
    kinds = [("fold", "load"), ("fold", "displacement")]
    assert marks == [*kinds, *kinds[::-1], ("end", None)]
    assert found.curve.events[-1].row == len(found.points) - 1
    assert found.curve.complete
    assert found.indices.rows(LOAD)[-1] == 0
