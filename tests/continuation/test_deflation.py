"""Deflated Newton's method on problems whose solutions are known."""

from __future__ import annotations

import numpy as np
import pytest

from contbranch.continuation import Problem, trace_curve
from contbranch.continuation.deflation import deflated_newton, search


class Cubic(Problem):
    """(x − 1)(x − 2)(x − 5) = p in every component, independently: 3ⁿ solutions at p = 0."""

    def residual(self, x, p):
        return (x - 1) * (x - 2) * (x - 5) - p

    def jacobian(self, x, p):
        return np.diag((x - 2) * (x - 5) + (x - 1) * (x - 5) + (x - 1) * (x - 2))


def test_two_starts_lead_to_the_three_solutions_of_a_cubic():
    found = search(Cubic(), 0.0, [], [np.array([1.3]), np.array([4.0])])
    assert sorted(float(x[0]) for x in found) == pytest.approx([1.0, 2.0, 5.0])


def test_what_is_known_is_not_found_again():
    problem = Cubic()
    known = [np.array([1.0, 1.0])]
    found = search(problem, 0.0, known, [np.array([1.1, 1.2]), np.array([4.0, 1.0])])
    assert len(found) >= 4
    for x in found:
        assert np.abs(problem.residual(x, 0.0)).max() < 1e-9
    rounded = {tuple(np.round(x, 6)) for x in [*found, *known]}
    assert len(rounded) == len(found) + 1


class Isola(Problem):
    """(y + 1)(x² + p² − 1 + y²) with x, y: a curve y = −1 for all p, and circles that nothing joins with it.

    As two equations: x (y + 1) = 0 would join them; here G = [x − 3 + (y + 1) q, (y + 1) (q)], q = x² + p² − 4.
    """

    def residual(self, x, p):
        q = x[0] ** 2 + p**2 - 4
        return np.array([(x[1] + 1) * q, x[1] + 1 + q * (x[0] - 3) * 0.1])

    def jacobian(self, x, p):
        q, dq = x[0] ** 2 + p**2 - 4, 2 * x[0]
        return np.array([[(x[1] + 1) * dq, q], [0.1 * (dq * (x[0] - 3) + q), 1.0]])


def test_a_closed_curve_that_continuation_does_not_reach():
    """At y = −1, q (x − 3) = 0: the line x = 3, y = −1 for all p, and the circle x² + p² = 4, y = −1 apart from it."""
    problem = Isola()
    curve = trace_curve(problem, np.array([3.0, -1.0]), -5.0, (-5.0, 5.0))
    assert curve.status == "complete"
    assert all(abs(point.x[0] - 3.0) < 1e-9 for point in curve.points)
    starts = [np.array([x, -0.9]) for x in (-3.0, 0.5, 2.5)]
    found = search(problem, 0.5, [np.array([3.0, -1.0])], starts)
    radius = np.sqrt(4 - 0.25)
    assert sorted(float(x[0]) for x in found) == pytest.approx([-radius, radius])


def test_no_solution_is_no_solution():
    class Nothing(Problem):
        def residual(self, x, p):
            return x**2 + 1

        def jacobian(self, x, p):
            return np.diag(2 * x)

    assert deflated_newton(Nothing(), 0.0, [], np.array([0.7])) is None
