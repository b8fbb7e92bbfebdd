"""Folds of curves in closed form: none missed, none invented, none turned back at."""

from __future__ import annotations

import math

import numpy as np
import pytest
from continuation_problems import Scalar, circle, cusp, graph, pitchfork

from contbranch.continuation import Options, Outcome, Problem, StopAt, trace_curve


def test_circle_is_closed_and_has_two_folds():
    curve = trace_curve(circle(), [0.9], 0.3, (-2.0, 2.0))
    assert curve.closed
    assert curve.status == "complete"
    assert curve.outcome is Outcome.CLOSED
    assert [fold.parameter for fold in curve.folds] == pytest.approx([1.0, -1.0], abs=1e-14)
    assert [fold.x[0] for fold in curve.folds] == pytest.approx([0.0, 0.0], abs=1e-10)
    # On the circle d²p/dx² = -1/p at x = 0.
    assert [fold.curvature for fold in curve.folds] == pytest.approx([-1.0, 1.0], rel=1e-6)
    assert curve.points[0].x == curve.points[-1].x
    # Once round and no further: the angle grows monotonically (clockwise, as p increases at the start).
    angle = np.unwrap(np.arctan2([x[0] for x in curve.x], curve.parameter))
    assert np.all(np.diff(angle) < 0)
    assert angle[0] - angle[-1] == pytest.approx(2 * math.pi)


@pytest.mark.parametrize("scale_x", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("scale_p", [1e-6, 1.0, 1e6])
def test_units_of_state_and_parameter_do_not_matter(scale_x, scale_p):
    problem = Scalar(
        lambda x, p: (x / scale_x) ** 2 + (p / scale_p) ** 2 - 1,
        lambda x, p: 2 * x / scale_x**2,
        lambda x, p: 2 * p / scale_p**2,
    )
    curve = trace_curve(problem, [0.9 * scale_x], 0.3 * scale_p, (-2 * scale_p, 2 * scale_p))
    assert curve.closed
    assert [fold.parameter / scale_p for fold in curve.folds] == pytest.approx([1.0, -1.0], abs=1e-13)
    reference = trace_curve(circle(), [0.9], 0.3, (-2.0, 2.0))
    assert len(curve.points) == len(reference.points)


@pytest.mark.parametrize("exponent", range(13))
def test_cusp_folds_however_close(exponent):
    """x³ - λ x - μ has its folds at 27 μ² = 4 λ³, x = ±√(λ/3); for λ = 1e-12 they are 1e-6 apart in x."""
    lam = 10.0**-exponent
    curve = trace_curve(cusp(lam), [-2.0], -8 + 2 * lam, (-8.0, 8.0))
    assert curve.status == "complete"
    assert len(curve.folds) == 2
    for fold, sign in zip(curve.folds, (-1, 1), strict=True):
        assert fold.x[0] == pytest.approx(sign * math.sqrt(lam / 3), rel=1e-6)
        assert -sign * fold.parameter == pytest.approx(math.sqrt(4 * lam**3 / 27), rel=1e-9)
        assert fold.curvature * sign > 0
    assert len(curve.points) < 50


@pytest.mark.parametrize("lam", [0.0, -1e-12, -1e-8, -1e-4, -1e-1])
def test_no_fold_on_the_other_side_of_the_cusp(lam):
    curve = trace_curve(cusp(lam), [-2.0], -8 + 2 * lam, (-9.0, 9.0))
    assert curve.status == "complete"
    assert curve.events == ()


@pytest.mark.parametrize("separation", [0.3, 0.03, 1e-3, 1e-5])
@pytest.mark.parametrize("place", [0.0, 0.137, 0.391])
def test_two_folds_closer_than_a_step(separation, place):
    """p = x³/3 - δ² x about x = place has folds at place ± δ, on a curve that is otherwise almost straight."""
    problem = graph(
        lambda x: (x - place) ** 3 / 3 - separation**2 * (x - place),
        lambda x: (x - place) ** 2 - separation**2,
    )
    curve = trace_curve(problem, [-3.0], float(problem.f(-3.0, 0.0)), (-15.0, 15.0))
    assert curve.status == "complete"
    assert [fold.x[0] for fold in curve.folds] == pytest.approx([place - separation, place + separation], abs=1e-9)
    between = [x[0] for x in curve.x if abs(x[0] - place) < separation]
    if separation < 0.01:
        assert not between  # no step ended between them: the pair was found inside one


@pytest.mark.parametrize("sharpness", [1e-1, 1e-3, 1e-5, 1e-7])
def test_sharp_fold_is_passed_and_not_retraced(sharpness):
    """p = 1 - x²/ε: the legs of the parabola are all but parallel where the steps are long."""
    problem = graph(lambda x: 1 - x * x / sharpness, lambda x: -2 * x / sharpness)
    curve = trace_curve(problem, [math.sqrt(sharpness)], 0.0, (0.0, 2.0))
    assert curve.status == "complete"
    assert len(curve.folds) == 1
    assert curve.folds[0].parameter == pytest.approx(1.0, abs=1e-14)
    x = np.array(curve.x)[:, 0]
    assert np.all(np.diff(x) < 0)
    assert x[-1] == pytest.approx(-math.sqrt(sharpness))


@pytest.mark.parametrize("imperfection", [1e-1, 1e-2, 1e-3, 1e-5, 1e-7])
def test_imperfect_pitchfork_stays_on_its_sheet(imperfection):
    """p x - x³ + ε: one curve without folds, and one with a fold at p = 3 (ε/2)^(2/3), x = -(ε/2)^(1/3)."""
    upper = trace_curve(pitchfork(imperfection), [1.0], 1.0, (-1.0, 1.0))
    assert upper.status == "complete"
    assert upper.events == ()
    assert all(x[0] > 0 for x in upper.x)
    lower = trace_curve(pitchfork(imperfection), [-1.0], 1.0, (-1.0, 1.0))
    assert lower.status == "complete"
    assert [event.kind for event in lower.events] == ["fold"]
    assert lower.folds[0].parameter == pytest.approx(3 * (imperfection / 2) ** (2 / 3), rel=1e-12)
    assert lower.folds[0].x[0] == pytest.approx(-((imperfection / 2) ** (1 / 3)), rel=1e-8)
    assert all(x[0] < 0 for x in lower.x)


def test_many_folds_are_all_found():
    """p = x + sin(8 x): folds at cos(8 x) = -1/8."""
    problem = graph(lambda x: x + np.sin(8 * x), lambda x: 1 + 8 * np.cos(8 * x))
    curve = trace_curve(problem, [0.0], 0.0, (-10.0, 10.0), Options(largest_parameter_step=1.0))
    assert curve.status == "complete"
    base = math.acos(-1 / 8) / 8
    every = [s * base + k * math.pi / 4 for k in range(-20, 21) for s in (1, -1)]
    first, last = curve.x[0][0], curve.x[-1][0]
    expected = sorted(x for x in every if first < x < last)
    assert len(expected) > 40
    assert [fold.x[0] for fold in curve.folds] == pytest.approx(expected, abs=1e-10)


def test_error_of_the_fold_covers_its_true_error():
    for shift in np.linspace(0.0, 1.0, 7):
        problem = graph(lambda x, s=shift: math.e + s - np.cosh(x - s) * 1.7, lambda x, s=shift: -1.7 * np.sinh(x - s))
        curve = trace_curve(problem, [shift - 1.0], float(problem.f(shift - 1.0, 0.0)), (-3.0, 5.0))
        fold = curve.folds[0]
        assert abs(fold.parameter - (math.e + shift - 1.7)) <= fold.error < 1e-12
        assert abs(fold.x[0] - shift) <= fold.state_error < 1e-9


def test_own_second_derivative_is_used():
    """A wrong second derivative slows Newton's method on the fold but cannot move the fold."""

    class Wrong(Problem):
        asked = 0

        def residual(self, x, p):
            return x**2 + p - 1

        def jacobian(self, x, p):
            return np.diag(2 * x)

        def parameter_derivative(self, x, p):
            return np.ones(1)

        def second_derivative(self, x, p, u, a):
            self.asked += 1
            return 2.1 * u**2

    problem = Wrong()
    curve = trace_curve(problem, [1.0], 0.0, (0.0, 2.0))
    assert problem.asked > 0
    assert curve.folds[0].parameter == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize("seed", range(40))
def test_folds_of_random_polynomials(seed):
    """p = P(x) with two random pairs of folds, 2e-3 to 0.6 apart, and a single fold; P' has exactly these zeros."""
    generator = np.random.default_rng(seed)
    centres = generator.uniform([-2.0, 0.2], [-0.2, 2.0])
    halves = 10 ** generator.uniform(-3.0, -0.5, 2)
    roots = np.sort([*(centres - halves), *(centres + halves), generator.uniform(-2.5, 2.5)])
    slope = np.poly(roots)
    height = np.polyint(slope)
    problem = graph(lambda x: np.polyval(height, x), lambda x: np.polyval(slope, x))
    start = float(np.polyval(height, -3.0))
    curve = trace_curve(problem, [-3.0], start, (-1e4, 1e4), stop=StopAt(predicate=lambda point: abs(point.x[0]) > 3.5))
    assert curve.status == "complete"
    assert sorted(fold.x[0] for fold in curve.folds) == pytest.approx(roots, abs=1e-8)
