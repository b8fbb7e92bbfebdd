"""Folds to machine precision, by Newton's method on the bordered system."""

from __future__ import annotations

import math

import numpy as np

from contbranch.continuation.curve import Fold, Outcome, Point
from contbranch.continuation.metric import ROUNDING, Metric
from contbranch.continuation.newton import START_CORRECTIONS, CorrectionError, border, linearise, residual, solve
from contbranch.continuation.problem import Array, Direction, Problem, size_of

# Step, in the metric, of second differences.
SECOND_DIFFERENCE_STEP = ROUNDING**0.25


def second_derivative(problem: Problem, x: Array, p: float, along: Direction, metric: Metric, here: Array) -> Array:
    """Return d²F(x + s u, p + s a)/ds² at s = 0: the problem's own, else a second difference of residuals."""
    u, a = along
    own = problem.second_derivative(x, p, u, a)
    if own is not None:
        return own
    step = SECOND_DIFFERENCE_STEP / metric.norm(problem, u, a)
    above = residual(problem, x + step * u, p + step * a)
    below = residual(problem, x - step * u, p - step * a)
    difference: Array = (above - 2 * here + below) / step**2
    return difference


def locate_fold(
    problem: Problem,
    x: Array,
    p: float,
    direction: Direction,
    metric: Metric,
    reach: float,
) -> Fold:
    """Locate a fold near (x, p) by Newton's method on F = 0, σ = 0, with σ from the bordered system

        [ J    Fp ] [ φ ]   [ 0 ]
        [ vᵀ   0  ] [ σ ] = [ 1 ]

    whose matrix is regular at a quadratic fold. (φ, σ) is a tangent of the curve, scaled so that v @ φ = 1; σ = 0 is
    the fold, where φ is the null vector. With s along (φ, σ) the same matrix gives, from D = d²F/ds², the curvature:
    M (φ', σ') = (-D, 0); so Newton's step on the curve is s = -σ/σ', plus M⁻¹(-F, 0) back onto the curve. The error
    of D changes the speed of convergence only.

    Parameters
    ----------
    direction : ((n,) array, float)
        The curve's tangent near the fold; its state part is the v above, and it orients the null vector.
    reach : float
        Length, in the metric, within which the fold must lie.

    Raises
    ------
    CorrectionError
        If it is not found within reach.
    """
    length = metric.norm(problem, direction[0], 0.0)
    if length == 0.0:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The state does not change along the curve.)")
    row = (metric.row(problem, direction[0], 0.0)[0] / length, 0.0)
    travelled = 0.0
    previous = math.inf
    # Steps below this are rounding: the position along the curve is known to about the root of it only through the
    # second derivative, but to `best` through the null vector.
    floor = 1e2 * ROUNDING * (1 + size_of(problem, x) / metric.state_scale)
    for _ in range(START_CORRECTIONS):
        at = linearise(problem, x, p)
        bordered = border(problem, x, p, at, row)
        back_x, back_p = solve(bordered, -at[0], 0.0, p)
        phi, sigma = solve(bordered, np.zeros_like(x), 1.0, p)
        d = second_derivative(problem, x, p, (phi, sigma), metric, at[0])
        bend_x, bend_p = solve(bordered, -d, 0.0, p)
        if bend_p == 0.0:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The parameter's second derivative vanishes.)")
        s = -sigma / bend_p
        size = abs(s) * metric.norm(problem, phi, sigma) + metric.norm(problem, back_x, back_p)
        travelled += size
        if not travelled <= reach:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The fold lies outside the step.)")
        x = x + back_x + s * phi + 0.5 * s * s * bend_x
        p = p + back_p + s * sigma + 0.5 * s * s * bend_p
        # Close to a cusp the iteration contracts by a half only: what stays larger than that is rounding.
        if size <= floor or (size < 1e-8 and size > 0.7 * previous):
            norm = size_of(problem, phi)
            point = Point(problem, x, p, phi / metric.norm(problem, phi, 0.0), 0.0, label="fold")
            error = 4 * abs(back_p) + 2 * abs(s * sigma) + 4 * ROUNDING * (abs(p) + metric.parameter_scale)
            state_error = 4 * (abs(s) * norm + size_of(problem, back_x))
            state_error += 4 * ROUNDING * (size_of(problem, x) + metric.state_scale)
            return Fold(point, error, state_error, null_vector=phi / norm, curvature=bend_p / norm**2)
        previous = size
    raise CorrectionError(Outcome.STEP_TOO_SMALL, "(Newton's method on the fold did not converge.)")
