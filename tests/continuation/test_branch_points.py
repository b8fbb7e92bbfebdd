"""Branch points: told apart from folds, located, and their kind."""

from __future__ import annotations

import numpy as np
import pytest
from continuation_problems import Scalar, pitchfork

from contbranch.continuation import Outcome, Problem, trace_curve


@pytest.mark.parametrize("start", [-1.0, -1.037, -0.77])
def test_pitchfork_from_its_trivial_branch(start):
    curve = trace_curve(pitchfork(), [0.0], start, (-1.1, 1.0))
    assert curve.status == "complete"
    assert curve.folds == []
    (point,) = curve.branch_points
    assert point.type == "pitchfork"
    assert point.parameter == pytest.approx(0.0, abs=1e-9)
    # The other curve, x² = p, leaves along x.
    assert abs(point.other_parameter) < 1e-4 * abs(point.other_x[0])


def test_pitchfork_from_its_other_branch_is_no_fold():
    """Along x² = p the parameter has a minimum, but the Jacobian's border is singular there: a branch point."""
    curve = trace_curve(pitchfork(), [1.0], 1.0, (-1.0, 1.0))
    assert curve.status == "complete"
    assert curve.folds == []
    (point,) = curve.branch_points
    assert point.type == "pitchfork"
    assert point.parameter == pytest.approx(0.0, abs=1e-9)
    assert curve.x[-1][0] * curve.x[0][0] == pytest.approx(-1.0)  # passed through, to the opposite branch


@pytest.mark.parametrize("start", [-1.0, -0.83])
def test_transcritical_crossing(start):
    problem = Scalar(lambda x, p: p * x - x * x, lambda x, p: p - 2 * x, lambda x, p: x)
    curve = trace_curve(problem, [0.0], start, (-1.0, 1.0))
    (point,) = curve.branch_points
    assert point.type == "transcritical"
    assert point.parameter == pytest.approx(0.0, abs=1e-9)
    assert point.other_x[0] / point.other_parameter == pytest.approx(1.0, rel=1e-3)  # the other curve is x = p


class Ring(Problem):
    """Pitchforks of three coupled unknowns, x (p - L) - x³ with L of eigenvalues 0.5, 1.25 and 2."""

    vectors = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, -1.0, 1.0], [2.0, 0.1, 0.7]]))[0]
    matrix = vectors @ np.diag([0.5, 1.25, 2.0]) @ vectors.T

    def residual(self, x, p):
        return p * x - self.matrix @ x - x**3

    def jacobian(self, x, p):
        return p * np.eye(3) - self.matrix - np.diag(3 * x**2)

    def parameter_derivative(self, x, p):
        return x.copy()

    def morse_index(self, x, p):
        return int(np.sum(np.linalg.eigvalsh(self.jacobian(x, p)) > 0))


def test_every_branch_point_with_its_change_of_index():
    curve = trace_curve(Ring(), np.zeros(3), 0.0, (0.0, 3.0))
    assert [event.kind for event in curve.events] == ["branch point"] * 3
    assert [point.parameter for point in curve.branch_points] == pytest.approx([0.5, 1.25, 2.0], abs=1e-9)
    assert curve.morse_index[0] == 0
    assert curve.morse_index[-1] == 3


class Double(Ring):
    """Two eigenvalues cross at once: the determinant keeps its sign, the Morse index does not."""

    matrix = Ring.vectors @ np.diag([0.7, 0.7, 2.0]) @ Ring.vectors.T


def test_double_branch_point_is_found_by_its_index():
    curve = trace_curve(Double(), np.zeros(3), 0.0, (0.0, 1.5))
    (event,) = curve.events
    assert event.kind == "index change"
    assert (event.before, event.after) == (0, 2)
    assert event.parameter == pytest.approx(0.7, abs=1e-9)
    assert curve.outcome is Outcome.REACHED_EDGE


def test_backward_branch_reports_the_index_in_the_curves_direction():
    curve = trace_curve(Double(), np.zeros(3), 1.4, (0.0, 1.5))
    (event,) = curve.events
    assert (event.before, event.after) == (0, 2)
    assert curve.points[event.index] is not None
    assert curve.parameter[event.index] == event.parameter
