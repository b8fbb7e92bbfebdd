"""Where a problem multiplies by its Jacobian, fewer matrices are factorised, and points and tangents are as exact."""

import numpy as np
import pytest

from contbranch.continuation import Metric, Options, Problem
from contbranch.continuation.newton import correct
from contbranch.continuation.walk import corrected_point

N = 12


class Bent(Problem):
    """x_i + p x_i³/3 + ε (Σ x)² = p b_i, coupled, with a Jacobian that changes from point to point."""

    def __init__(self):
        self.b, self.matrices = np.cos(np.arange(N)), 0

    def residual(self, x, p):
        return x + p * x**3 / 3 + 0.1 * x.sum() ** 2 - p * self.b

    def _jacobian(self, x, p):
        return np.diag(1 + p * x**2) + 0.2 * x.sum()

    def jacobian(self, x, p):
        self.matrices += 1
        return self._jacobian(x, p)

    def parameter_derivative(self, x, p):
        return x**3 / 3 - self.b


class Multiplies(Bent):
    """The same with products."""

    def product(self, x, p):
        matrix = self._jacobian(x, p)
        return lambda v: matrix @ v


def test_kept_matrix():
    found = []
    for problem in (Bent(), Multiplies()):
        row = problem.dual(np.ones(N) / np.sqrt(N)), 0.5
        near = 0.4 * problem.b, 0.5
        one = correct(problem, near, row, Metric(1.0, 1.0), Options(tolerance=1e-13), precise=True)
        rate = problem._jacobian(one.x, one.parameter) @ one.tangent_x
        rate += one.tangent_parameter * problem.parameter_derivative(one.x, one.parameter)
        assert np.abs(problem.residual(one.x, one.parameter)).max() < 1e-12
        assert np.abs(rate).max() < 1e-9 * np.abs(one.tangent_x).max()
        found.append(problem.matrices)
    assert found[1] < found[0]


@pytest.mark.parametrize(("aside", "matrices"), [(1e-6, 0), (0.05, 1)], ids=["next to it", "far away"])
def test_matrix_of_a_point_close_by(aside, matrices):
    """It serves for a point and its tangent as far as Newton's method contracts by it, and else its own one does."""
    problem, metric, options = Multiplies(), Metric(1.0, 1.0), Options(tolerance=1e-13)
    direction = np.ones(N) / np.sqrt(N), 0.5
    first, matrix = corrected_point(problem, (0.4 * problem.b, 0.5), direction, metric, options)
    near = first.x + aside * first.tangent_x, first.parameter + aside * first.tangent_parameter
    own, _ = corrected_point(problem, near, direction, metric, options)
    problem.matrices = 0
    kept, _ = corrected_point(problem, near, direction, metric, options, matrix)
    assert (problem.matrices > 0) == (matrices > 0)
    assert kept.parameter == pytest.approx(own.parameter, rel=1e-13)
    np.testing.assert_allclose(kept.x, own.x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(kept.tangent_x, own.tangent_x, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("aside", [1e-11, 1e-8, 1e-4])
def test_tangents_are_those_at_the_point(aside):
    """On x = 10⁴ p²/2 the tangent turns by 10⁴ times the last correction, however small that is."""

    class Parabola(Problem):
        def residual(self, x, p):
            return x - 5e3 * p**2

        def jacobian(self, x, p):
            return np.eye(1)

        def parameter_derivative(self, x, p):
            return np.array([-1e4 * p])

    near = np.array([5e3 * 0.3**2]), 0.3 + aside
    point, _ = corrected_point(Parabola(), near, (np.ones(1), 0.0), Metric(1.0, 1.0), Options(tolerance=1e-13))
    assert point.tangent_x[0] / point.tangent_parameter == pytest.approx(1e4 * point.parameter, rel=1e-14)
