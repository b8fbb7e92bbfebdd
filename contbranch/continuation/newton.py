"""Newton's method on the curve: from a predicted point to a corrected one, with its true tangent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from contbranch.continuation.bordered import Bordered, SingularBorderedError, Unfactorised, factorise
from contbranch.continuation.curve import Outcome
from contbranch.continuation.metric import Metric
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Linearisation, Problem
from contbranch.watch import check

__all__ = ["Corrected", "CorrectionError", "correct", "correct_start", "linearise", "residual", "tangent_at"]

ROUNDING = float(np.finfo(float).eps)
# A tangent comes from the last Jacobian evaluated; this bounds its distance from the corrected point (in the metric).
TANGENT_DISTANCE = 1e-4
PRECISE_TANGENT_DISTANCE = 1e-10
# Corrections below this (in the metric) may grow once, and tell nothing of how long a step may be: what is stiff in a
# prediction makes the first one small and the second, of what is soft, larger; the third is their square.
SMALL = 1e-3
# Most corrections of a predicted point; what does not contract is given up earlier.
ITERATIONS = 10


class CorrectionError(Exception):
    """No corrected point was reached; `outcome` and `detail` say why."""

    def __init__(self, outcome: Outcome, detail: str):
        super().__init__(detail)
        self.outcome = outcome
        self.detail = detail


@dataclass(frozen=True, slots=True, eq=False)
class Corrected:
    """A point on the curve with its tangent (not yet of unit length), and what Newton's method said on the way."""

    x: Array
    parameter: float
    tangent_x: Array
    tangent_parameter: float
    bordered: Bordered
    iterations: int
    first_correction: float
    contraction: float


def linearise(problem: Problem, x: Array, p: float) -> Linearisation:
    """Return the problem's linearisation, or raise CorrectionError if it fails or is not finite."""
    check()
    try:
        linearisation = problem.linearise(x, p)
    except Exception as error:  # whatever the user's problem raises ends the attempt, with its text kept
        raise CorrectionError(Outcome.EVALUATION_FAILED, _told(error, p)) from error
    if not math.isfinite(float(np.add.reduce(linearisation[0]))):
        raise CorrectionError(Outcome.NOT_FINITE, f"(Residual at parameter {p:.6g}.)")
    return linearisation


def residual(problem: Problem, x: Array, p: float) -> Array:
    """Return the residual, or raise CorrectionError if it fails or is not finite."""
    check()
    try:
        value = problem.residual(x, p)
    except Exception as error:  # as in linearise
        raise CorrectionError(Outcome.EVALUATION_FAILED, _told(error, p)) from error
    if not math.isfinite(float(np.add.reduce(value))):
        raise CorrectionError(Outcome.NOT_FINITE, f"(Residual at parameter {p:.6g}.)")
    return value


def _told(error: Exception, p: float) -> str:
    return f"({type(error).__name__} at parameter {p:.6g}: {error})"


def border(problem: Problem, x: Array, p: float, at: Linearisation, row: tuple[Array, float]) -> Bordered:
    """Factorise [J Fp; row] at a point, or raise CorrectionError."""
    try:
        return factorise(at[1], at[2], row[0], row[1], problem.preconditioner(x, p))
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error


def solve(bordered: Bordered, f: Array, g: float, p: float) -> tuple[Array, float]:
    """Solve a bordered system, or raise CorrectionError if that fails or the solution is not finite."""
    try:
        u, a = bordered.solve(f, g)
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error
    if not math.isfinite(float(np.add.reduce(u)) + a):
        raise CorrectionError(Outcome.NOT_FINITE, f"(Newton's correction at parameter {p:.6g}.)")
    return u, a


def correct(
    problem: Problem,
    near: tuple[Array, float],
    row: tuple[Array, float],
    metric: Metric,
    options: Options,
    precise: bool = False,
) -> Corrected:
    """Correct a predicted point (x, p) onto the curve, in the plane through it that `row` is normal to.

    Newton's method on

        [ J    Fp ] [ dx ]     [ F ]
        [ row     ] [ dp ] = - [ 0 ]

    whose last matrix also gives the tangent, [J Fp; row] (u, a) = (0, 1). Convergence is judged by the corrections:
    if they contract by θ, the next one of a quadratically convergent iteration is θ² times the present one.

    Raises
    ------
    CorrectionError
        If the iteration does not contract, or the problem fails.
    """
    x, p = near
    own = problem.in_plane(x, p, row, precise)
    if own is not None:
        return Corrected(*own, Unfactorised(), 1, 0.0, 0.0)
    tolerance, noise = options.tolerance, options.noise
    close = PRECISE_TANGENT_DISTANCE if precise else TANGENT_DISTANCE
    floor = _rounding_floor(problem, x, p, metric)
    noise *= floor
    first = previous = math.inf
    contraction = 0.0
    worst = 0.0
    slow = False
    for iteration in range(1, ITERATIONS + 1):
        last, at = (x, p), linearise(problem, x, p)
        bordered = border(problem, x, p, at, row)
        dx, dp = solve(bordered, -at[0], 0.0, p)
        x = x + dx
        p = p + dp
        size = metric.norm(problem, dx, dp)
        if iteration == 1:
            first = size
            done = size <= max(tolerance, floor, close * precise)  # the next one is about its square
        else:
            contraction = size / previous if previous > 0 else 0.0
            done = size <= max(close, floor) and contraction**2 * size <= max(tolerance, floor)
            # What no longer contracts close to rounding is as good as it gets.
            if not done and contraction > 0.1:
                rough = x * (-1.0) ** np.arange(x.size)  # as slopes see rounding
                done = size <= max(noise, _rounding_floor(problem, rough, p, metric))
            again, slow = slow or size > SMALL, contraction > 0.5
            if not done and ((slow and again) or not math.isfinite(size)):
                raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(Newton's corrections contract by {contraction:.2g}.)")
            if size > max(SMALL, noise):
                worst = max(worst, contraction)
        if done:
            u, a = solve(bordered, np.zeros_like(x), 1.0, p)
            product = problem.product(*last, at[1])
            if product is not None:
                rest = -product(u) - a * at[2]
                du, da = solve(bordered, rest, 1.0 - float(row[0] @ u) - row[1] * a, p)
                dx, dp = solve(bordered, -residual(problem, x, p), 0.0, p)
                x, p, u, a = x + dx, p + dp, u + du, a + da
            problem.corrected(x, p, partial(_at_fixed_parameter, bordered, (u, a)))
            return Corrected(x, p, u, a, bordered, iteration, first, worst)
        previous = size
    raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(The last correction was {previous:.2g} of the step's scale.)")


def _at_fixed_parameter(bordered: Bordered, tangent: tuple[Array, float], f: Array) -> Array:
    """Solve J v = f with a bordered matrix and its tangent, J u = −a Fp."""
    v, b = bordered.solve(f, 0.0)
    return v - b / tangent[1] * tangent[0]


def _rounding_floor(problem: Problem, x: Array, p: float, metric: Metric) -> float:
    state = math.sqrt(max(problem.inner(x, x), 0.0))
    return 16 * ROUNDING * (state / metric.state_scale + abs(p) / metric.parameter_scale)


def correct_start(problem: Problem, x: Array, p: float, maximum_iterations: int = 50) -> Array:
    """Return a solution at fixed p near x by damped Newton iteration.

    Raises
    ------
    CorrectionError
        With the residual that was reached.
    """
    x = np.array(x, dtype=float)
    row = (np.zeros_like(x), 1.0)
    previous = math.inf
    at = linearise(problem, x, p)
    for _ in range(maximum_iterations):
        size = float(np.linalg.norm(at[0]))
        if size == 0.0:
            return x
        try:
            dx, _zero = solve(border(problem, x, p, at, row), -at[0], 0.0, p)
        except CorrectionError as error:
            detail = f"(The Jacobian at parameter {p:.6g} is singular and the residual's norm {size:.3g}.)"
            raise CorrectionError(Outcome.START_FAILED, detail) from error
        correction = math.sqrt(max(problem.inner(dx, dx), 0.0))
        scale = math.sqrt(max(problem.inner(x + dx, x + dx), 0.0))
        if correction <= 1e-10 * scale or (correction <= 1e-6 * scale and correction > 0.1 * previous):
            return x + dx
        x, at = _damped(problem, x, p, dx, size)
        previous = correction
    size = float(np.linalg.norm(at[0]))
    raise CorrectionError(Outcome.START_FAILED, f"(The residual's norm at parameter {p:.6g} is still {size:.3g}.)")


def _damped(problem: Problem, x: Array, p: float, dx: Array, size: float) -> tuple[Array, Linearisation]:
    """Take the largest of the steps dx, dx/2, dx/4, ... that lowers the residual's norm."""
    failure: CorrectionError | None = None
    for halvings in range(20):
        trial = x + dx * 0.5**halvings
        try:
            at = linearise(problem, trial, p)
        except CorrectionError as error:
            failure = error
            continue
        # Close to the solution rounding decides which residual is smaller: then any step will do.
        if np.linalg.norm(at[0]) <= (1 - 0.1 * 0.5**halvings) * size or size < 1e-12:
            return trial, at
    if failure is not None:
        raise failure
    raise CorrectionError(
        Outcome.START_FAILED, f"(The residual's norm at parameter {p:.6g} is {size:.3g} and cannot be lowered.)"
    )


def tangent_at(problem: Problem, x: Array, p: float) -> tuple[Array, float, Bordered]:
    """Return a tangent at a solution when none is known yet, and the matrix bordered by it.

    The first border is an arbitrary fixed direction, which is transversal to the curve unless by accident; the
    tangent found with it is the border of a second solve, which makes it accurate.
    """
    at = linearise(problem, x, p)
    arbitrary = np.cos(1.0 + np.arange(x.size) ** 2 % 7919)
    row = (problem.dual(arbitrary), 0.7)
    for _ in range(2):
        bordered = border(problem, x, p, at, row)
        u, a = solve(bordered, np.zeros_like(x), 1.0, p)
        size = math.sqrt(max(problem.inner(u, u), 0.0) + a * a)
        row = (problem.dual(u / size), a / size)
    return u / size, a / size, bordered
