"""The linear systems of a lattice, against dense matrices and the transforms themselves."""

from __future__ import annotations

import numpy as np
import pytest
from lattice_cases import from_axisymmetric, paraboloid

import contbranch as cb
from contbranch.models.grid.clusters import Influence, Squares, gathered
from contbranch.models.grid.linear import Border, Linear

KINDS = pytest.mark.parametrize("kind", ["periodic", "free"])
QUARTER = pytest.mark.parametrize("quarter", [True, False])


@KINDS
@QUARTER
def test_influence_is_that_of_the_transforms(kind, quarter):
    problem = paraboloid(kind, 8.0, 32, quarter=quarter)
    random = np.random.default_rng(1)
    sizes = np.repeat([8, 4, 2, 1], 3)
    corners = [sizes * random.integers(0, problem.lattice.inside[0] // sizes) for _ in range(2)]
    spots = [np.s_[x : x + s, y : y + s] for s, x, y in zip(sizes, *corners, strict=True)]
    expected = np.empty((sizes.size, sizes.size))
    for column, source in enumerate(spots):
        pressure = np.zeros(problem.shape)
        pressure[source] = 1.0
        moved = problem.displaced(pressure)
        expected[:, column] = [moved[spot].mean() for spot in spots]
    squares = Squares(sizes, *corners, np.zeros(0, dtype=np.int64))
    assert Influence(problem.lattice).matrix(squares) == pytest.approx(expected, rel=1e-6)  # single precision is enough


@QUARTER
def test_every_node_of_the_zone_is_in_one_square(quarter):
    """Squares do not overlap, are fine at the rim and coarse away from it, and no more than allowed."""
    problem = paraboloid("periodic", 8.0, 256, quarter=quarter)
    contact, zone = problem.heights < (0.5 if quarter else 0.05), problem.heights < 3.0
    squares = gathered(problem.lattice, contact, np.zeros(problem.shape), zone)
    owner = np.full(problem.shape, -1)
    owner[zone] = squares.of_node
    for number, (size, x, y) in enumerate(zip(*squares[:3], strict=True)):
        inside = owner[x : x + size, y : y + size]
        assert np.isin(inside, [number, -1]).all()
        assert (inside == number).any()
        assert contact[x : x + size, y : y + size].all() or not contact[x : x + size, y : y + size].any()
    assert squares.sizes.size <= 8 * 128
    assert squares.sizes.max() >= 8


def dense(problem, stiffness, contact, row, weight):
    """The bordered matrix by columns."""
    n = contact.size
    matrix = np.zeros((n + 1, n + 1))
    for k in range(n):
        unit = np.zeros(n)
        unit[k] = 1.0
        matrix[:n, k] = problem.stiffness(unit.reshape(problem.shape)).ravel() + stiffness.ravel() * unit
    matrix[:n, n] = 1.0 / problem.lattice.area
    held = np.flatnonzero(contact)
    matrix[held] = 0.0
    matrix[held, held] = 1.0
    matrix[n, :n] = 0.0 if row is None else np.broadcast_to(row, problem.shape).ravel()
    matrix[n, n] = weight
    return matrix


@KINDS
@QUARTER
@pytest.mark.parametrize("held", ["load", "displacement", "progress"])
def test_solution_is_that_of_the_dense_matrix(kind, quarter, held):
    """With softening and stiffening nodes, with and without the law far away, for two right-hand sides."""
    problem = paraboloid(kind, 4.0, 16, quarter=quarter)
    random = np.random.default_rng(3)
    contact = problem.heights < 0.3
    stiffness = np.where(problem.heights < 2.0, random.uniform(-1.0, 2.0, problem.shape), 0.0)
    row = {"load": None, "displacement": -1.0 / contact.size, "progress": random.uniform(size=problem.shape)}[held]
    weight = problem.lattice.compliance if held == "displacement" else 1.0
    matrix = dense(problem, stiffness, contact, row, weight)
    linear = Linear(problem, stiffness, contact, Border(problem, row, weight))
    spent = []
    for f, g in ((random.standard_normal(problem.shape), 0.3), (np.zeros(problem.shape), 1.0)):
        before = problem.counter.equilibrium
        found = linear.solve(f, g, 1e-12)
        spent.append(problem.counter.equilibrium - before)
        expected = np.linalg.solve(matrix, np.append(f, g))
        assert found.field.ravel() == pytest.approx(expected[:-1], rel=1e-8, abs=1e-8 * np.abs(expected).max())
        assert found.load == pytest.approx(expected[-1], rel=1e-7, abs=1e-8)
        elastic = problem.stiffness(found.field) + found.load / problem.lattice.area
        assert found.pressure == pytest.approx(elastic, rel=1e-7, abs=1e-7 * np.abs(elastic).max())
    assert linear.solve(f, g, 1e-11).residual <= 1e-11
    assert problem.counter.equilibrium - before == spent[1] + 1  # the one above: the solution is known


@pytest.mark.parametrize(("freed", "most"), [(0, 16), (8, 18), (43, 20)])
def test_freed_nodes_at_a_stiff_rim_cost_little(freed, most):
    """A freed node has an eigenvalue of its own, far below zero, that no filter knows: v″ = -4."""
    problem, found, _ = from_axisymmetric("periodic", 13.0, 256, cb.Gauss, 2.0, -1, 20.0)
    excess = np.where(found.contact, found.fields.excess, np.inf)
    contact = found.contact.copy()
    contact.ravel()[np.argsort(excess, axis=None)[:freed]] = False
    linear = Linear(problem, found.fields.stiffness, contact, Border(problem, None, 1.0))
    before = problem.counter.equilibrium
    right = np.where(contact, 0.0, -found.fields.excess) + np.where(contact, 0.0, 1e-3 * np.exp(-problem.heights))
    assert linear.solve(right, 0.0, 1e-6).residual <= 1e-6
    assert problem.counter.equilibrium - before <= most
