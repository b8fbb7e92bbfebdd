"""Indices and symmetry events of traces on lattices, and the branches that leave them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from grid_states import traced
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves, branches as branches_module
from contbranch.models.grid.branches import departure, follow_branch
from contbranch.models.grid.measure import quietly
from contbranch.models.grid.newton import Hold, Settings, hold_control, newton
from contbranch.models.grid.resolution import GridWarning
from contbranch.models.grid.setup import Setup
from contbranch.models.grid.stability import SECTORS
from contbranch.models.grid.switching import kept_symmetry, mirrored

# Flatter than a parabola: the film is thinnest on a ring, which breaks up.
FLAT = cb.Contact(cb.PowerLaw(3.0, 1.0), cb.Gauss(-1.0, 0.4))
ROUND = cb.Contact(cb.Parabola(1.0), cb.Gauss(-1.0, 1.0))
EDGE = 8.0
RING = 6.0  # holds the ring
REQUEST = Request(1e-6)


@pytest.fixture(scope="module")
def expected():
    return traced(FLAT, 1e-7)


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
def flat():
    """Fewer nodes than the warning asks for, enough for what happens before the film closes."""
    with pytest.warns(GridWarning, match="at least 96"):
        return Traced(FLAT, cb.FreeSpace(RING, 64), Request(1e-6, target=17.0))


@pytest.fixture(scope="module")
def parabola():
    return Traced(ROUND, cb.FreeSpace(EDGE, 64))


# Events


def before_touch(traced):
    """The symmetry events of the film; with few nodes in contact the lattice has its own."""
    touch = next(event.row for event in traced.curve.events if event.kind == "touch")
    return [event for event in traced.curve.events if event.kind == "symmetry" and event.row < touch]


def test_symmetry_events_are_those_of_the_axisymmetric_model(flat, expected):
    """m = 1, 2, 3 are lost, and 3 and 2 regained, before the film closes; errors bound what the lattice leaves."""
    events = before_touch(flat)
    others = [event for event in expected.curve.events if event.kind == "symmetry"][: len(events)]
    assert [event.mode for event in events] == [1, 2, 3, 3, 2]
    assert [event.mode for event in others] == [1, 2, 3, 3, 2]
    for event, other in zip(events, others, strict=True):
        assert event.index == other.index
        assert event.message == other.message
        assert event.numbers[:2] == pytest.approx(other.numbers[:2], rel=1e-5)
        assert all(abs(a - b) <= c for a, b, c in zip(event.numbers, other.numbers, event.error, strict=True))
        assert event.error[0] < 0.01 * event.numbers[0]
        assert event.row <= event.position <= event.row + 1
        loads = flat.curve.branch.load[event.row : event.row + 2]
        assert loads.min() <= event.numbers[0] <= loads.max()


def test_numbers_of_azimuthal_modes_change_at_the_events(flat, expected):
    """One more behind every event at which stability is lost; where a state is stable at fixed displacement, none."""
    events = before_touch(flat)
    column = flat.curve.branch.unstable_azimuthal[: events[-1].row + 3]
    count = np.zeros(len(column), dtype=int)
    for event in events:
        count[event.row + 1 :] += 1 if "lost" in event.message else -1
    assert np.array_equal(column, count)
    assert not column[flat.indices.rows(DISPLACEMENT)[: len(column)] == 0].any()
    changes = expected.curve.branch.unstable_azimuthal[
        np.flatnonzero(np.diff(expected.curve.branch.unstable_azimuthal)) + 1
    ]
    steps = [1 if "lost" in event.message else -1 for event in events]
    assert list(np.cumsum(steps)) == list(changes[: len(events)])


def test_a_parabola_keeps_its_symmetry(parabola):
    """Proven in the half space; confirmed where indices are checked, at little cost."""
    assert parabola.curve.complete
    assert parabola.curve.message == ""
    assert not parabola.curve.branch.unstable_azimuthal.any()
    assert max(parabola.indices.rows(DISPLACEMENT)) == 1
    assert 0 < parabola.curve.cost.stability_pairs < 0.15 * parabola.curve.cost.fft_pairs


def test_without_modes_none_are_examined():
    curve = Traced(ROUND, cb.FreeSpace(EDGE, 32), Request(1e-5, modes=0)).curve
    assert curve.branch.unstable_azimuthal is None
    assert curve.cost.stability_pairs > 0


def test_a_convex_energy_is_not_examined():
    """v'' ≥ 0: one equilibrium for every displacement."""
    contact = cb.Contact(cb.Parabola(1.0), cb.Exponential(-1.0, 1.0))
    curve = Traced(contact, cb.FreeSpace(2.0 * EDGE, 32), Request(1e-5)).curve
    assert curve.cost.stability_pairs == 0
    assert not curve.branch.unstable_azimuthal.any()


def test_a_fold_that_is_missing_contradicts(parabola):
    """Counted with one fold too many or too few, the index is not that of the eigenvalues."""
    request = Request(1e-6, modes=0)
    turns = parabola.indices.turns
    folds = [mark.row for mark in parabola.track.marks if mark.kind == "fold"]
    for row in (folds[0] // 2, (folds[0] + folds[1]) // 2 + 1, len(turns[LOAD]) - 4):
        turned = {control: own - (np.arange(len(own)) >= row) for control, own in turns.items()}
        with quietly():
            found = raw_curve(replace(parabola.track, hodograph=replace(parabola.indices, turns=turned)), request)
        assert not found.complete
        assert "a fold was missed, or is none" in found.message


# Branches


@pytest.mark.parametrize("kind", ["periodic", "free"])
@pytest.mark.parametrize("sector", SECTORS)
def test_a_branch_keeps_another_symmetry_than_it_breaks(kind, sector):
    lattice = Setup(FLAT, kind, 4.0, 8).lattice
    values = np.random.default_rng(2).standard_normal((lattice.size, lattice.size))
    if sector in (SECTORS[0], SECTORS[3]):
        sign = -1.0 if sector == SECTORS[0] else 1.0
        values = values + sign * values.T
    whole = lattice.unfold(values, sector)
    kept = kept_symmetry(lattice.whole(), sector, True)
    assert np.allclose(kept(whole), whole)
    assert np.allclose(mirrored(lattice.whole(), whole, sector), -whole)


def asymmetry(branch):
    """Of every row: root mean square of the difference from its image."""
    return np.array([np.sqrt(np.mean(branch.problem(0).odd(point.x) ** 2)) for point in branch.points])


def first_branch(flat, points, request=REQUEST):
    """The branch that leaves at the first event: its track and its rows."""
    track = follow_branch(before_touch(flat)[0], request, points=points)
    with quietly():
        return track, raw_curve(track, request)


@pytest.fixture(scope="module")
def branch(flat):
    return first_branch(flat, 12)


def test_the_branch_of_the_first_mode_is_followed(flat, branch):
    """A dozen equilibria to the solver's tolerance, without the symmetry; the mirror that is kept is kept."""
    track, curve = branch
    event = departure(before_touch(flat)[0])
    assert (event.mode, event.sector) == (1, SECTORS[1])
    assert len(track.points) >= 12
    assert (np.diff(asymmetry(track)) > 0).all()
    problem = track.problem(0)
    for point in track.points:
        state = problem.at(point)
        excess = np.where(state.contact, np.minimum(state.fields.excess, 0.0), state.fields.excess)
        assert np.linalg.norm(excess) <= 1e-6 * np.linalg.norm(state.fields.elastic)
        assert np.abs(state.u - mirrored(problem.setup.lattice, state.u, ("even", "odd"))).max() < 1e-4
    assert (np.diff(curve.branch.load) < 0).all()


def test_the_branch_inherits_what_the_curve_loses(flat, branch):
    """Before the event one axisymmetric mode is unstable and no other; so it is on the branch, close to it."""
    _, curve = branch
    assert flat.indices.rows(DISPLACEMENT)[before_touch(flat)[0].row + 1] == 1
    assert curve.branch.unstable_displacement[1] == 1
    assert curve.branch.unstable_azimuthal[1] == 0


def test_refinement_keeps_the_branch(branch):
    """At twice the spacing: asymmetry and displacement at the same loads; in contact so few nodes need no curve."""
    with pytest.warns(GridWarning, match="at least 96"):
        coarse_flat = Traced(FLAT, cb.FreeSpace(RING, 32, averaging=False), Request(1e-6, target=17.0))
    coarse, coarse_curve = first_branch(coarse_flat, 6, Request(1e-6, modes=0))
    fine, fine_curve = branch
    rows, fine_rows = coarse_curve.branch, fine_curve.branch
    assert coarse.problem(0).setup.lattice.grid < fine.problem(0).setup.lattice.grid
    low, high = (
        max(found.load.min() for found in (rows, fine_rows)),
        min(found.load.max() for found in (rows, fine_rows)),
    )
    for values, others, tolerance in (
        (rows.displacement, fine_rows.displacement, 1e-3),
        (asymmetry(coarse) ** 2, asymmetry(fine) ** 2, 0.06),
    ):
        coarse_curve = CubicSpline(rows.load[::-1], values[::-1])
        fine_curve = CubicSpline(fine_rows.load[::-1], others[::-1])
        loads = np.linspace(low + 0.1 * (high - low), high, 8)
        assert coarse_curve(loads) == pytest.approx(fine_curve(loads), rel=tolerance)


def test_branches_belong_to_the_diagram_if_asked_for(monkeypatch, tmp_path):
    monkeypatch.setattr(branches_module, "POINTS", 2)
    with pytest.warns(GridWarning, match="at least 96"):
        diagram = cb.trace(FLAT, model=cb.FreeSpace(RING, 32, averaging=False, branches=True), max_load=17.0)
    symmetry = [event for event in diagram.events if event.kind == "symmetry" and event.branch == 0]
    assert len(diagram.branches) == 1 + len(symmetry)
    for number, event in enumerate(symmetry, start=1):
        branch = diagram.branches[number]
        assert abs(branch.load[0] - event.load) < 0.05 * event.load
        assert branch.state(1).r.size > 0
        ends = [end for end in diagram.events if end.branch == number]
        assert [end.kind for end in ends if end.kind == "end"] == ["end"]
        assert "2 points" in ends[-1].message
    assert all(event.branch == 0 for event in diagram.events if event.name)
    diagram.save(tmp_path / "flat.h5")
    again = cb.load(tmp_path / "flat.h5")
    assert np.array_equal(again.branches[1].load, diagram.branches[1].load)
    assert [event.branch for event in again.events] == [event.branch for event in diagram.events]


# One state, however it is found


@pytest.mark.parametrize("kind", ["periodic", "free"])
def test_quarter_and_whole_lattice_agree(kind):
    """The same held states from the same starts: load and displacement to 1e-10, contact and film."""
    setup = Setup(ROUND, kind, EDGE, 32)
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
