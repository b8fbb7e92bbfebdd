"""Ends of curves: exact edges, stop conditions, failures told in sentences with the part traced kept."""

from __future__ import annotations

import math

import numpy as np
import pytest
from continuation_problems import Bratu, Scalar, circle, graph

from contbranch.continuation import Crossing, Options, Outcome, Problem, StopAt, trace_curve
from contbranch.errors import InputError


def test_both_edges_are_hit_exactly():
    curve = trace_curve(graph(np.sinh, np.cosh), [0.0], 0.0, (-0.3, 0.7))
    assert curve.parameter[0] == -0.3
    assert curve.parameter[-1] == 0.7
    assert curve.x[-1][0] == pytest.approx(math.asinh(0.7), abs=1e-13)
    assert [end.outcome for end in curve.ends] == [Outcome.REACHED_EDGE, Outcome.REACHED_EDGE]
    assert np.all(np.diff(curve.parameter) > 0)


@pytest.mark.parametrize(("start", "other"), [(-1.0, 2.0), (2.0, -1.0)])
def test_start_on_an_edge_goes_inwards(start, other):
    curve = trace_curve(graph(np.sinh, np.cosh), [math.asinh(start)], start, (-1.0, 2.0))
    assert curve.status == "complete"
    assert sorted((curve.parameter[0], curve.parameter[-1])) == [-1.0, 2.0]
    assert Outcome.STARTED_ON_EDGE in [end.outcome for end in curve.ends]
    assert other in (curve.parameter[0], curve.parameter[-1])
    assert len(set(curve.parameter)) == len(curve.parameter)


def test_range_cuts_the_circle():
    curve = trace_curve(circle(), [0.9], 0.3, (-2.0, 0.5))
    assert not curve.closed
    assert curve.parameter[0] == 0.5
    assert curve.parameter[-1] == 0.5
    assert curve.x[0][0] == pytest.approx(-math.sqrt(0.75))
    assert curve.x[-1][0] == pytest.approx(math.sqrt(0.75))
    assert [fold.parameter for fold in curve.folds] == pytest.approx([-1.0])


def test_excursion_beyond_the_edge_within_a_step_ends_the_curve():
    """The circle leaves the range by 1e-4 at its fold and is back before the step is over."""
    edge = 1 - 1e-4
    curve = trace_curve(circle(), [0.9], 0.3, (-2.0, edge))
    assert not curve.closed
    assert curve.parameter[0] == edge
    assert curve.parameter[-1] == edge
    assert abs(curve.x[-1][0]) == pytest.approx(math.sqrt(1 - edge**2), rel=1e-9)
    assert max(curve.parameter) == edge


def test_curve_that_approaches_an_edge_for_ever():
    """The upper branch of Bratu's problem comes back to λ = 0 at infinite u."""
    curve = trace_curve(Bratu(20), np.zeros(20), 0.0, (0.0, 4.0))
    assert curve.ends[1].outcome is Outcome.APPROACHES_EDGE
    assert curve.status == "complete"
    assert 0 < curve.parameter[-1] <= 4e-9


@pytest.mark.parametrize("k", [1, 2, 5])
def test_stop_at_the_kth_fold(k):
    problem = graph(lambda x: x + np.sin(8 * x), lambda x: 1 + 8 * np.cos(8 * x))
    curve = trace_curve(problem, [0.0], 0.0, (-2.0, 10.0), stop=StopAt(folds=k))
    forward = [fold for fold in curve.folds if fold.x[0] > 0]
    assert len(forward) == k
    assert curve.ends[1].outcome is Outcome.STOPPED_AT_FOLD
    assert curve.status == "complete"
    assert curve.parameter[-1] == curve.folds[-1].parameter
    assert curve.points[-1].label == "fold"


def test_stop_at_a_predicate_and_at_a_terminal_event():
    problem = graph(np.sinh, np.cosh)
    curve = trace_curve(problem, [0.0], 0.0, (0.0, 50.0), stop=StopAt(predicate=lambda point: point.x[0] > 1))
    assert curve.ends[1].outcome is Outcome.STOPPED_BY_PREDICATE
    assert curve.x[-2][0] <= 1 < curve.x[-1][0]
    crossing = Crossing(lambda x, p: x[0] - 1, name="one", terminal=True)
    curve = trace_curve(problem, [0.0], 0.0, (0.0, 50.0), events=[crossing])
    assert curve.ends[1].outcome is Outcome.STOPPED_AT_EVENT
    assert curve.x[-1][0] == pytest.approx(1.0, abs=1e-14)
    assert curve.parameter[-1] == pytest.approx(math.sinh(1.0), abs=1e-13)


def test_largest_number_of_points():
    curve = trace_curve(graph(np.sinh, np.cosh), [0.0], 0.0, (0.0, 50.0), Options(maximum_points=3))
    assert curve.status == "incomplete"
    assert curve.outcome is Outcome.MAXIMUM_POINTS
    assert len(curve.points) == 4


def test_nan_keeps_the_part_traced():
    problem = Scalar(lambda x, p: x - p if p < 0.5 else math.nan, lambda x, p: 1.0, lambda x, p: -1.0)
    curve = trace_curve(problem, [0.0], 0.0, (0.0, 1.0))
    assert curve.status == "incomplete"
    assert curve.outcome is Outcome.NOT_FINITE
    assert 0.49 < curve.parameter[-1] < 0.5
    assert curve.message.startswith(Outcome.NOT_FINITE.value)


def test_error_of_the_problem_keeps_the_part_traced_and_its_text():
    def f(x, p):
        if p > 0.5:
            raise RuntimeError("the table ends here")
        return x - p

    curve = trace_curve(Scalar(f, lambda x, p: 1.0, lambda x, p: -1.0), [0.0], 0.0, (0.0, 1.0))
    assert curve.status == "incomplete"
    assert curve.outcome is Outcome.EVALUATION_FAILED
    assert "RuntimeError" in curve.message
    assert "the table ends here" in curve.message
    assert 0.49 < curve.parameter[-1] <= 0.5


def test_error_in_observables_is_kept_too():
    class Fails(Problem):
        def residual(self, x, p):
            return x - p

        def jacobian(self, x, p):
            return np.eye(1)

        def observables(self, x, p):
            if p > 0.5:
                raise KeyError("load")
            return {"load": p}

    curve = trace_curve(Fails(), [0.0], 0.0, (0.0, 1.0))
    assert curve.outcome is Outcome.EVALUATION_FAILED
    assert "load" in curve.message
    np.testing.assert_array_equal(curve.observable("load"), curve.parameter)


def test_curve_that_breaks_off_fails_at_the_smallest_step():
    """|x|^(1/2)-like kink upwards: √(1 - p) + x = 0 has no continuation beyond p = 1 and is no fold of F either."""
    problem = Scalar(
        lambda x, p: x + (p if p < 1 else 3.0 + x * 0), lambda x, p: 1.0, lambda x, p: 1.0 if p < 1 else 0.0
    )
    curve = trace_curve(problem, [0.0], 0.0, (0.0, 2.0))
    assert curve.status == "incomplete"
    assert curve.outcome is Outcome.STEP_TOO_SMALL
    assert curve.parameter[-1] == pytest.approx(1.0, abs=1e-6)


def test_start_without_solution_explains_itself():
    problem = Scalar(lambda x, p: x * x + 1 + p, lambda x, p: 2 * x)
    curve = trace_curve(problem, [1.0], 0.0, (-0.5, 1.0))
    assert curve.status == "incomplete"
    assert curve.outcome is Outcome.START_FAILED
    assert curve.points == ()
    assert "residual" in curve.message


def test_nan_at_the_start_is_told():
    curve = trace_curve(Scalar(lambda x, p: math.nan, lambda x, p: 1.0), [1.0], 0.0, (0.0, 1.0))
    assert curve.outcome is Outcome.NOT_FINITE
    assert curve.points == ()


@pytest.mark.parametrize(
    ("x0", "p0", "interval", "word"),
    [
        ([1.0], 3.0, (0.0, 1.0), "p0"),
        ([1.0], 0.0, (1.0, 0.0), "parameter_range"),
        ([math.nan], 0.0, (0.0, 1.0), "x0"),
        ([[1.0]], 0.0, (0.0, 1.0), "x0"),
    ],
)
def test_unusable_input_is_refused(x0, p0, interval, word):
    with pytest.raises(InputError, match=word):
        trace_curve(circle(), x0, p0, interval)


@pytest.mark.parametrize("field", ["angle", "tolerance", "first_step", "smallest_step", "weight"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_options_are_validated(field, value):
    with pytest.raises(InputError, match=field):
        Options(**{field: value})


def test_infinite_range_and_start_at_a_fold():
    curve = trace_curve(circle(), [0.0], 1.0, (-math.inf, math.inf))
    assert curve.closed
    assert sorted(round(fold.parameter, 12) for fold in curve.folds) in ([-1.0], [-1.0, 1.0])
    assert len(curve.points) < 80


def test_crude_start_is_corrected():
    curve = trace_curve(graph(np.sinh, np.cosh), [5.0], 0.2, (0.0, 1.0))
    assert curve.status == "complete"
    assert curve.parameter[0] == 0.0
    assert curve.x[0][0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("size", [1, 3])
def test_a_straight_line_takes_few_points(size):
    """A prediction that is exact but for rounding says nothing of how far the next one may reach."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        slope, start = 3.0 * rng.standard_normal(size), rng.standard_normal(size)
        curve = trace_curve(Line(slope, start), start, 0.0, (0.0, 1000.0))
        assert curve.status == "complete"
        assert len(curve.points) < 20


class Line(Problem):
    """x = slope p + start."""

    def __init__(self, slope, start):
        self.slope, self.start = slope, start

    def residual(self, x, p):
        return x - self.slope * p - self.start

    def jacobian(self, x, p):
        return np.eye(x.size)

    def parameter_derivative(self, x, p):
        return -self.slope
