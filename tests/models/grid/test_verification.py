"""Indices and symmetry events of traces on lattices, and the branches that leave them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from grid_states import Row, grid_problem, traced
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.trace import Request
from contbranch.models.grid import branches as branches_module
from contbranch.models.grid.branches import follow_branch
from contbranch.models.grid.newton import Hold, Settings, hold_control, newton
from contbranch.models.grid.resolution import GridWarning
from contbranch.models.grid.rows import morse_indices
from contbranch.models.grid.setup import Setup
from contbranch.models.grid.stability import SECTORS, Stability
from contbranch.models.grid.switching import kept_symmetry, mirrored
from contbranch.models.grid.symmetry import symmetry_breaking
from contbranch.models.grid.trace import trace
from contbranch.models.grid.verification import pieces, verify_curve

# Flatter than a parabola: the film is thinnest on a ring, which breaks up.
FLAT = cb.Contact(cb.PowerLaw(3.0, 1.0), cb.Gauss(-1.0, 0.4))
ROUND = cb.Contact(cb.Parabola(1.0), cb.Gauss(-1.0, 1.0))
EDGE = 8.0


@pytest.fixture(scope="module")
def expected():
    return traced(FLAT, 1e-8)


@pytest.fixture(scope="module")
def flat():
    """Half as many nodes as the warning asks for, enough for what happens before the film closes."""
    with pytest.warns(GridWarning, match="at least 128"):
        return trace(Setup(FLAT, "free", EDGE, 64), Request(1e-6), verdicts=False)


@pytest.fixture(scope="module")
def parabola():
    return trace(Setup(ROUND, "free", EDGE, 64), Request(1e-6), verdicts=False)


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
        assert event.values[:2] == pytest.approx(other.values[:2], rel=1e-5)
        assert all(abs(a - b) <= c for a, b, c in zip(event.values, other.values, event.error, strict=True))
        assert event.error[0] < 0.01 * event.values[0]
        assert event.row <= event.position <= event.row + 1
        loads = flat.curve.load[event.row : event.row + 2]
        assert loads.min() <= event.values[0] <= loads.max()


def test_numbers_of_azimuthal_modes_change_at_the_events(flat, expected):
    """One more behind every event at which stability is lost; where a state is stable at fixed displacement, none."""
    events = before_touch(flat)
    column = flat.curve.unstable_azimuthal[: events[-1].row + 3]
    count = np.zeros(len(column), dtype=int)
    for event in events:
        count[event.row + 1 :] += 1 if "lost" in event.message else -1
    assert np.array_equal(column, count)
    assert not column[flat.indices.rows(DISPLACEMENT)[: len(column)] == 0].any()
    changes = expected.curve.unstable_azimuthal[np.flatnonzero(np.diff(expected.curve.unstable_azimuthal)) + 1]
    assert list(column[[event.row + 1 for event in events]]) == list(changes[: len(events)])


def test_a_parabola_keeps_its_symmetry(parabola):
    """Proven in the half space; confirmed where indices are checked, at little cost."""
    assert parabola.curve.complete
    assert parabola.curve.message == ""
    assert not parabola.curve.unstable_azimuthal.any()
    assert max(parabola.indices.rows(DISPLACEMENT)) == 1
    assert 0 < parabola.curve.cost.stability_pairs < 0.15 * parabola.curve.cost.fft_pairs


def test_without_modes_none_are_examined():
    curve = trace(Setup(ROUND, "free", EDGE, 32), Request(1e-5, modes=0), verdicts=False).curve
    assert curve.unstable_azimuthal is None
    assert curve.cost.stability_pairs > 0


def test_a_convex_energy_is_not_examined():
    """v'' ≥ 0: one equilibrium for every displacement."""
    contact = cb.Contact(cb.Parabola(1.0), cb.Exponential(-1.0, 1.0))
    curve = trace(Setup(contact, "free", 2.0 * EDGE, 32), Request(1e-5), verdicts=False).curve
    assert curve.cost.stability_pairs == 0
    assert not curve.unstable_azimuthal.any()


def test_pieces_are_those_between_folds():
    assert pieces(10, [3, 4, 7]) == [(0, 3), (3, 4), (4, 7), (7, 9)]
    assert pieces(2, []) == [(0, 1)]


def test_a_fold_that_is_missing_contradicts(parabola):
    """Counted without one of the folds, or with one too many, the index is not that of the eigenvalues."""
    events = [event for event in parabola.curve.events if event.kind == "fold"]
    folds = [(event.row, event.control) for event in events]
    count = len(parabola.rows)

    def verified(counted):
        rows = [row for row, _ in counted]
        return verify_curve(parabola.setup, parabola.rows, morse_indices(count, counted, (1, 1)), rows, 1e-6)

    assert not verified(folds).contradicted
    assert verified(folds).notes == ()
    for left in range(len(folds)):
        found = verified(folds[:left] + folds[left + 1 :])
        assert found.contradicted
        assert "a fold was missed, or is none" in found.notes[0]
    assert verified([*folds, (count - 4, "load")]).contradicted


def test_rows_without_fields_are_not_checked_silently(parabola):
    rows = [replace(row, u=None, contact=None) for row in parabola.rows]
    folds = [event.row for event in parabola.curve.events if event.kind == "fold"]
    found = verify_curve(parabola.setup, rows, parabola.indices, folds, 1e-6)
    assert not found.contradicted
    assert any("memory was short" in note for note in found.notes)


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


def asymmetry(branch, sector):
    """Of every row: root mean square of the difference from its image."""
    lattice = branch.setup.lattice
    return np.array([np.sqrt(np.mean((row.u - mirrored(lattice, row.u, sector)) ** 2)) for row in branch.rows])


@pytest.fixture(scope="module")
def branch(flat):
    return follow_branch(flat.setup, flat.breakings[0], Request(1e-6), points=12)


def test_the_branch_of_the_first_mode_is_followed(flat, branch):
    """A dozen equilibria to the solver's tolerance, without the symmetry; the mirror that is kept is kept."""
    event = flat.breakings[0]
    assert (event.mode, event.kind.sector) == (1, SECTORS[1])
    problem = branch.setup.problem
    assert len(branch.rows) >= 12
    size = asymmetry(branch, event.kind.sector)
    assert (np.diff(size) > 0).all()
    for row in branch.rows:
        fields = problem.fields(row.u, row.load)
        excess = np.where(row.contact, np.minimum(fields.excess, 0.0), fields.excess)
        assert np.linalg.norm(excess) <= 1e-6 * np.linalg.norm(fields.elastic)
        assert np.abs(row.u - mirrored(branch.setup.lattice, row.u, ("even", "odd"))).max() < 1e-4
    assert (np.diff(branch.curve.load) < 0).all()
    assert [event.kind for event in branch.curve.events].count("touch") == 1


def test_the_branch_inherits_what_the_curve_loses(flat, branch):
    """Before the event one axisymmetric mode is unstable and no other; so it is on the branch, close to it."""
    event = flat.breakings[0]
    assert flat.indices.rows(DISPLACEMENT)[event.row + 1] == 1
    assert branch.curve.unstable_displacement[1] == 1
    assert branch.curve.unstable_azimuthal[1] == 0


def test_refinement_keeps_the_branch(branch, expected):
    """The event on 128² nodes, from rows of the axisymmetric model; asymmetry and displacement at the same loads."""
    event = next(event for event in expected.curve.events if event.kind == "symmetry")
    rows = [Row(FLAT, expected, row) for row in (event.row, event.row + 1)]
    setup = Setup(FLAT, "free", EDGE, 128)
    problem = grid_problem(FLAT, "free", EDGE, 128)
    stability = Stability(problem)
    points = [row.on(problem) for row in rows]
    found, _ = symmetry_breaking(problem, points, [stability.morse(point) for point in points], 1e-6, stability)
    fine = follow_branch(setup, found[0], Request(1e-6, modes=0), points=6)
    low, high = fine.curve.load.min(), branch.curve.load.max()
    sector = SECTORS[1]
    for values, others, tolerance in (
        (branch.curve.displacement, fine.curve.displacement, 1e-3),
        (asymmetry(branch, sector) ** 2, asymmetry(fine, sector) ** 2, 0.06),
    ):
        coarse_curve = CubicSpline(branch.curve.load[::-1], values[::-1])
        fine_curve = CubicSpline(fine.curve.load[::-1], others[::-1])
        loads = np.linspace(low + 0.1 * (high - low), high, 8)
        assert coarse_curve(loads) == pytest.approx(fine_curve(loads), rel=tolerance)


def test_branches_belong_to_the_diagram_if_asked_for(monkeypatch, tmp_path):
    monkeypatch.setattr(branches_module, "POINTS", 3)
    with pytest.warns(GridWarning, match="at least 128"):
        diagram = cb.trace(FLAT, model=cb.FreeSpace(EDGE, 64, branches=True), max_load=17.0)
    symmetry = [event for event in diagram.events if event.kind == "symmetry" and event.branch == 0]
    assert len(diagram.branches) == 1 + len(symmetry)
    for number, event in enumerate(symmetry, start=1):
        branch = diagram.branches[number]
        assert abs(branch.load[0] - event.load) < 0.05 * event.load
        assert branch.state(1).r.size > 0
        ends = [end for end in diagram.events if end.branch == number]
        assert [end.kind for end in ends if end.kind == "end"] == ["end"]
        assert "3 points" in ends[-1].message
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
    problem = parabola.setup.problem
    settings = Settings(tolerance=1e-11)
    folds = [event.row for event in parabola.curve.events if event.kind == "fold"]
    for first, last in pieces(len(parabola.rows), folds):
        row = parabola.rows[(first + last) // 2]
        if last - first < 2:
            continue
        by_load = newton(problem, row.u, row.load, Hold(row.load), row.contact, settings)
        hold = hold_control(problem, 0.0, 1.0, by_load.displacement)
        by_displacement = newton(problem, row.u, row.load, hold, row.contact, settings)
        assert by_load.converged
        assert by_displacement.converged
        assert np.abs(by_load.u - by_displacement.u).max() < 1e-8
        assert by_displacement.load == pytest.approx(row.load, abs=1e-8)


def test_an_end_next_to_folds_is_the_last_row():
    """A map of a few waves under repulsion, ended where the contact has just grown: each fold keeps its mark."""
    nodes = np.arange(48) / 48 * 2.0 * np.pi
    waves = np.cos(nodes[:, None]) + 0.8 * np.cos(nodes + 0.4) + 0.3 * np.cos(2.0 * nodes[:, None] + nodes)
    contact = cb.Contact(cb.HeightMap(0.6 * waves, cell=EDGE, radius=1.0), cb.Gauss(-1.0, 1.0))
    found = trace(Setup(contact.to_reduced(), "periodic", EDGE, 48), Request(1e-6, target=20.0), verdicts=False)
    marks = [(event.kind, event.control) for event in found.curve.events if event.kind != "touch"]
    kinds = [("fold", "load"), ("fold", "displacement")]
    assert marks == [*kinds, *kinds[::-1], ("end", None)]
    assert found.curve.events[-1].row == len(found.rows) - 1
    assert found.curve.complete
    assert found.indices.rows(LOAD)[-1] == 0
