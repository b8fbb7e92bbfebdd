"""Curves whose discretisation changes on the way, and problems that share work or choose their inner product."""

from __future__ import annotations

import numpy as np
import pytest
from continuation_problems import Bratu

from contbranch.continuation import Adaptation, Linearisation, Options, StopAt, trace_curve


class Refining(Bratu):
    """Bratu's problem that doubles its grid when u grows; the points of the old grid are among the new ones."""

    transferring = True

    def adapt(self, x, p):
        wanted = 15 if x.max() < 0.5 else 31 if x.max() < 2.0 else 63
        if wanted <= self.n:
            return None
        finer = Refining(2 * self.n + 1, self.kind)

        def transfer(u):
            old, new = np.linspace(0, 1, self.n + 2), np.linspace(0, 1, finer.n + 2)
            return np.interp(new, old, np.concatenate([[0.0], u, [0.0]]))[1:-1]

        return Adaptation(finer, transfer(x), transfer if self.transferring else None)

    def observables(self, x, p):
        return {"height": x.max()}


class Untold(Refining):
    """The same without a transfer of tangents."""

    transferring = False


@pytest.mark.parametrize("kind", [Refining, Untold])
def test_curve_goes_on_through_changes_of_grid(kind):
    curve = trace_curve(kind(15), np.zeros(15), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1))
    assert curve.status == "complete"
    assert {x.size for x in curve.x} >= {15, 31, 63}
    for point in curve.points:
        assert np.abs(point.problem.residual(point.x, point.parameter)).max() < 1e-8
    assert len(curve.folds) == 1
    # The fold belongs to the grid of 31 points: compare with a curve that has it from the start.
    fixed = trace_curve(Bratu(31), np.zeros(31), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1))
    assert curve.folds[0].x.size == 31
    assert curve.folds[0].parameter == pytest.approx(fixed.folds[0].parameter, abs=1e-12)
    height = curve.observable("height")
    assert np.all(np.diff(height) > 0)  # never turned round


def test_backward_branch_starts_on_the_first_grid():
    curve = trace_curve(Refining(15), np.zeros(15), 0.5, (-3.0, 4.0), stop=StopAt(folds=1))
    assert curve.x[0].size == 15
    assert curve.parameter[0] == -3.0
    assert curve.status == "complete"


def test_array_alone_is_the_same_problem_on_another_grid():
    class BySize(Bratu):
        def residual(self, x, p):
            return super().residual(x, p) if x.size == self.n else Bratu(x.size).residual(x, p)

        def jacobian(self, x, p):
            return super().jacobian(x, p) if x.size == self.n else Bratu(x.size).jacobian(x, p)

        def adapt(self, x, p):
            if x.size != self.n or x.max() < 0.3:
                return None
            return np.interp(np.linspace(0, 1, 33), np.linspace(0, 1, 17), np.concatenate([[0.0], x, [0.0]]))[1:-1]

    curve = trace_curve(BySize(15), np.zeros(15), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1))
    fixed = trace_curve(Bratu(31), np.zeros(31), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1))
    assert curve.folds[0].parameter == pytest.approx(fixed.folds[0].parameter, abs=1e-12)


def test_failing_adaptation_is_told():
    class Fails(Bratu):
        def adapt(self, x, p):
            raise MemoryError("too many points")

    curve = trace_curve(Fails(15), np.zeros(15), 0.0, (0.0, 4.0))
    assert curve.status == "incomplete"
    assert "too many points" in curve.message
    assert len(curve.points) == 2


def test_tangents_that_cannot_be_carried_are_told():
    class Fails(Bratu):
        def adapt(self, x, p):
            def moved(x, p, x_rate, p_rate):
                raise ArithmeticError("nothing is left of the mesh")

            return Adaptation(Bratu(15), x, moved=moved)

    curve = trace_curve(Fails(15), np.zeros(15), 0.0, (0.0, 4.0))
    assert curve.status == "incomplete"
    assert "nothing is left of the mesh" in curve.message


def test_shared_linearisation_replaces_the_separate_calls():
    class Shared(Bratu):
        calls = 0

        def linearise(self, x, p):
            self.calls += 1
            e = np.exp(x)
            jacobian = self.laplace.toarray()
            jacobian[np.diag_indices(self.n)] += p * e
            return Linearisation(self.laplace @ x + p * e, jacobian, e)

        def jacobian(self, x, p):
            raise AssertionError("linearise shares this work")

    problem = Shared(100)
    curve = trace_curve(problem, np.zeros(100), 0.0, (0.0, 4.0))
    reference = trace_curve(Bratu(100), np.zeros(100), 0.0, (0.0, 4.0))
    assert curve.folds[0].parameter == pytest.approx(reference.folds[0].parameter, abs=1e-13)
    # Two Jacobians a point (predicted and once corrected), and few more for the fold.
    assert problem.calls < 6 * len(curve.points)


def test_own_inner_product_measures_the_steps():
    """On a graded mesh of the same curve, the quadrature as inner product gives the steps of the uniform mesh."""

    class Weighted(Bratu):
        weights = np.full(50, 1 / 50)

        def inner(self, u, v):
            return float(u @ (self.weights * v))

        def dual(self, u):
            return self.weights * u

    heavier = Weighted(50)
    heavier.weights = np.full(50, 7.0)  # any constant factor: the balance of the scales takes it out
    options = Options(edge_tolerance=0.1)
    curve = trace_curve(heavier, np.zeros(50), 0.0, (0.0, 4.0), options)
    reference = trace_curve(Bratu(50), np.zeros(50), 0.0, (0.0, 4.0), options)
    assert len(curve.points) == len(reference.points)
    np.testing.assert_allclose(curve.parameter, reference.parameter, rtol=1e-8)
