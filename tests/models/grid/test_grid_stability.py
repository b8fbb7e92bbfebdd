"""Stability on lattices: against dense matrices, finite differences, and the axisymmetric model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from grid_indices import morse, slope
from grid_states import Row, grid_problem, traced
from scipy.linalg import eigh

import contbranch as cb
from contbranch.models.grid.lattice import IMAGE_SUM, Lattice
from contbranch.models.grid.newton import Equilibrium, Hold, hold_control, newton
from contbranch.models.grid.problem import GridProblem
from contbranch.models.grid.stability import Stability
from contbranch.models.grid.transforms import Counter
from contbranch.models.grid.variation import Precision

FLAT = cb.Contact(cb.PowerLaw(3.0, 1.0), cb.Gauss(-1.0, 0.4))
EXACT = Precision(tolerance=1e-7, share=1e-7, guard=2, basis=40)


def elliptic(kind, edge, grid, law, ratio=1.5, quarter=False) -> GridProblem:
    """A tip without symmetry about the diagonal."""
    lattice = Lattice(kind, (edge, edge), (grid, grid), quarter)
    x = lattice.axes[0][: lattice.inside[0]]
    return GridProblem(lattice, lattice.fill(x[:, None] ** 2 / 2 + ratio * x**2 / 2), law)


def periodic_stiffness(lattice: Lattice) -> np.ndarray:
    """K_d as a matrix, column by column: |q|/2, and 1/(C L²) for the mean, with C of the images of a point force."""
    n = lattice.nodes[0]
    q = 2 * np.pi * np.fft.fftfreq(n, lattice.edges[0] / n)
    symbol = np.hypot(q[:, None], q) / 2
    symbol[0, 0] = np.pi / (IMAGE_SUM * lattice.edges[0])
    columns = np.fft.ifft2(symbol * np.fft.fft2(np.eye(n * n).reshape(-1, n, n))).real
    return columns.reshape(n * n, n * n).T


@pytest.mark.parametrize("kind", ["periodic", "free"])
def test_elasticity_of_a_quarter_is_that_of_the_whole_lattice(kind):
    """The same field, whole and by its quarter; in free space K̂ itself is known to nine digits."""
    lattice, whole = Lattice(kind, (5.0, 5.0), (16, 16)), Lattice(kind, (5.0, 5.0), (16, 16), quarter=False)
    values = np.random.default_rng(3).standard_normal(lattice.shape)
    own, other = lattice.transform(Counter()), whole.transform(Counter())
    found = own.filter(lattice.symbol * own.normalisation, values)
    expected = other.filter(whole.symbol * other.normalisation, lattice.unfold(values))
    assert lattice.unfold(found) == pytest.approx(expected, abs=1e-8)


# Gaps x²/2 and y² times a factor, plus a constant, and the contact's radius. The matrices are those of any state,
# whether it is an equilibrium or not; these soften here and there, over few or many nodes.
STATES = {
    "softening, stable": (0.42, 0.5, 0.0),
    "unstable": (0.3, 0.08, 0.0),
    "very unstable": (0.2, 0.04, 0.0),
    "contact": (0.05, 0.2, 0.9),
    "contact, unstable": (0.05, 0.1, 0.9),
}


@pytest.fixture(scope="module", params=STATES.values(), ids=STATES.keys())
def state(request):
    """A state, and what is known of it."""
    offset, factor, radius = request.param
    problem = elliptic("periodic", 6.0, 16, cb.Gauss(-1.0, 0.5))
    x = problem.lattice.axes[0]
    gap = offset + factor * (x[:, None] ** 2 / 2 + x**2)
    contact = np.hypot(x[:, None], x) < radius
    u = np.where(contact, 0.0, gap) - problem.heights
    found = Equilibrium(problem.fields(u, 1.0), contact, 0.0, problem.displacement(u, 1.0), True)
    return problem, found


def dense(problem: GridProblem, found: Equilibrium) -> tuple[np.ndarray, np.ndarray]:
    """(K_d + v'')_II and (K_d)_II of the whole lattice."""
    lattice = problem.lattice
    free = ~lattice.unfold(found.contact.astype(float)).astype(bool).ravel()
    stiffness = lattice.unfold(found.fields.stiffness).ravel()
    elastic = periodic_stiffness(lattice)[np.ix_(free, free)]
    return elastic + np.diag(stiffness[free]), elastic


def test_eigenvalues_are_those_of_a_dense_matrix(state):
    problem, found = state
    expected = eigh(*dense(problem, found), eigvals_only=True)
    spectrum = Stability(problem).spectrum(found, EXACT, count=6)
    # Of all below the highest none is missing; those at 1 are many, and of no interest.
    lowest = spectrum.eigenvalues[spectrum.eigenvalues <= min(0.99, spectrum.eigenvalues[-1])]
    assert lowest == pytest.approx(expected[: len(lowest)], abs=1e-8)
    assert len(lowest) >= 3


def test_a_quarter_has_the_even_modes(state):
    problem, found = state
    quarter = elliptic("periodic", 6.0, 16, problem.law, quarter=True)
    half = problem.lattice.nodes[0] // 2
    fields = found.fields._replace(stiffness=found.fields.stiffness[half:, half:])
    even = Stability(quarter).spectrum(replace(found, fields=fields, contact=found.contact[half:, half:]), EXACT)
    whole = Stability(problem).spectrum(found, EXACT, count=6)
    mirrored = np.einsum("kij,kij->k", whole.vectors[:, ::-1, ::-1], whole.vectors) > 0.0
    along = np.einsum("kij,kij->k", whole.vectors[:, ::-1], whole.vectors) > 0.0
    assert even.index == np.count_nonzero(whole.eigenvalues[mirrored & along] < 0.0)
    if even.eigenvalues.size:
        assert even.eigenvalues[0] == pytest.approx(whole.eigenvalues[0], abs=1e-8)


def test_error_bounds_hold_at_low_precision(state):
    problem, found = state
    exact = Stability(problem).spectrum(found, EXACT, count=6)
    loose = Stability(problem).spectrum(found, Precision(tolerance=0.05, share=0.3), count=2)
    for value, error in zip(loose.eigenvalues, loose.errors, strict=True):
        if value < 1.0:
            assert np.abs(exact.eigenvalues - value).min() <= error


def test_index_is_the_inertia_under_both_controls(state):
    """Holding the load, the mean has no elasticity: the same matrix with K̂(0) = 0."""
    problem, found = state
    held, _ = dense(problem, found)
    lattice = problem.lattice
    free_mean = held - np.full_like(held, np.pi / (IMAGE_SUM * lattice.edges[0]) / lattice.nodes[0] ** 2)
    index = morse(problem, found)
    assert index.displacement == (np.linalg.eigvalsh(held) < 0).sum()
    assert index.load == (np.linalg.eigvalsh(free_mean) < 0).sum()
    assert not index.spectrum.uncertain


def test_slope_is_that_of_the_dense_system(state):
    """(K + v'') x = -δF/A with K̂(0) = 0, and δd = C δF - mean(x)."""
    problem, found = state
    held, _ = dense(problem, found)
    lattice = problem.lattice
    compliance = IMAGE_SUM / (np.pi * lattice.edges[0])
    matrix = held - np.full_like(held, 1.0 / (compliance * lattice.edges[0] ** 2 * lattice.nodes[0] ** 2))
    x = np.linalg.solve(matrix, np.full(len(matrix), -1.0 / lattice.edges[0] ** 2))
    rate = 1.0 / (compliance - x.sum() / lattice.nodes[0] ** 2)
    assert slope(problem, found) == pytest.approx(rate, rel=1e-6)
    index = morse(problem, found, rate)
    assert index.spring(0.0) == index.load
    assert index.spring(1e9) == index.displacement
    assert index.spring(-rate + 1e-6) == index.displacement
    assert index.spring(-rate - 1e-6) == index.displacement + 1


@pytest.mark.parametrize("displacement", [-1.5, 1.0])
def test_slope_is_that_of_neighbouring_equilibria(displacement):
    """Under attraction, before contact with dF/dd < 0, and in contact."""
    problem = elliptic("periodic", 6.0, 16, cb.Gauss(1.0, 0.7))
    u, load, contact, loads = np.full(problem.shape, -displacement), 0.0, None, []
    step = 1e-4
    for one in (displacement, displacement - step, displacement + step):
        end = newton(problem, u, load, hold_control(problem, 0.0, 1.0, one), contact)
        assert end.converged
        u, load, contact = end.u, end.load, end.contact
        loads.append(load)
        if len(loads) == 1:
            rate = slope(problem, end)
    assert rate == pytest.approx((loads[2] - loads[1]) / (2 * step), rel=1e-4)
    assert (rate < 0) == (displacement < 0)


def test_work_is_counted_apart(state):
    problem, found = state
    before = problem.counter.equilibrium, problem.counter.stability
    index = morse(problem, found)
    assert problem.counter.equilibrium == before[0]
    assert problem.counter.stability == before[1] + index.pairs
    assert problem.counter.target == "equilibrium"


def test_nothing_softens_without_an_interaction():
    problem = elliptic("free", 6.0, 16, None)
    found = newton(problem, -np.minimum(problem.heights, 0.5), 1.0, Hold(1.0))
    index = morse(problem, found, 1.0)
    assert (index.load, index.displacement, index.pairs) == (0, 0, 0)
    assert not index.spectrum.uncertain


@pytest.fixture(scope="module")
def flat():
    return traced(FLAT)


def test_eigenvalues_are_those_of_azimuthal_modes(flat):
    """A film unstable to m = 1, 2, 3: κ are those of T_m, each twice.

    The lattice and its cell change them by 4e-4 (64² against 256²).
    """
    rows = [Row(FLAT, flat, k) for k in range(len(flat.points))]
    row = next(row for row in rows if row.load > 1.0 and row.n_0 == 1 and len(row.azimuthal) == 3)
    problem = grid_problem(FLAT, "free", 8.0, 64, quarter=False)
    found = row.on(problem)
    index = morse(Stability(problem, EXACT), found)
    expected = [row.eigenvalues(m)[0] for m in (1, 1, 2, 2, 3, 3)]
    assert index.displacement == 7
    assert index.spectrum.eigenvalues[1:7] == pytest.approx(sorted(expected), rel=2e-3, abs=2e-3)


CURVES = {
    "repulsion": (cb.Contact.reduced(cb.Gauss, 1.0, -1), 10.0, 96),
    "attraction": (cb.Contact.reduced(cb.Gauss, 1.5), 10.0, 96),
}


@pytest.mark.parametrize(("contact", "edge", "grid"), CURVES.values(), ids=CURVES.keys())
def test_indices_along_a_curve(contact, edge, grid):
    """Both folds of an S, and pull-off, under both controls, one search beginning where the last one ended.

    Rows within 0.1 % of a fold's load or first touch may lie on its other side on the lattice.
    """
    curve = traced(contact)
    problem = grid_problem(contact, "free", edge, grid)
    stability = Stability(problem)
    folds = [event.numbers[0] for event in curve.curve.events if event.kind in ("fold", "touch")]
    indices, pairs = set(), []
    for k in range(len(curve.points)):
        row = Row(contact, curve, k)
        small = abs(row.load) < 0.05 or row.fields.rim.radius > 0.2 * edge
        if small or any(abs(row.load - load) < 0.001 * abs(load) for load in folds):
            continue
        found = row.on(problem)
        index = morse(stability, found)
        assert (index.load, index.displacement) == (row.n_load, row.n_0)
        indices.add((index.load, index.displacement))
        pairs.append(index.pairs)
    assert {(0, 0), (1, 0)} <= indices
    assert max(pairs) < 60
