"""Newton's method on the curve: from a predicted point to a corrected one, with its true tangent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from contbranch.continuation.bordered import Bordered, SingularBorderedError, SparseBordered, as_matrix, factorise
from contbranch.continuation.curve import Outcome
from contbranch.continuation.metric import Metric
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Direction, Linearisation, Problem, size_of
from contbranch.watch import check

ROUNDING = float(np.finfo(float).eps)
# A tangent comes from the last Jacobian evaluated; this bounds its distance from the corrected point (in the metric).
TANGENT_DISTANCE = 1e-4
PRECISE_TANGENT_DISTANCE = 1e-10
# Corrections below this (in the metric) may grow once, and tell nothing of how long a step may be: what is stiff in a
# prediction makes the first one small and the second, of what is soft, larger; the third is their square.
SMALL = 1e-3
# Where a problem multiplies by its Jacobian at little cost, the matrix factorised for a correction of that size serves
# for a precise point's next ones as long as they contract by this factor, and for the tangent, refined so often.
CONTRACTS, POLISHINGS = 0.1, 8
# ... and for those of steps where matrices are this large, and residuals cost little beside them. What a kept one
# leaves of a residual would count as a discretisation's error: it is to be smaller than otherwise by this factor.
LARGE, KEPT = 150, 1e-2
# Last correction above which the matrix before it does not tell the sign of the determinant behind it: what is soft in
# other directions than that of the correction, as where a symmetry is about to be lost, changes by many times as much.
SIGNED = 1e-7
# Most corrections of a predicted point; what does not contract is given up earlier.
ITERATIONS = 10
# ... and of a start.
START_ITERATIONS = 50


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
    first_correction: float
    contraction: float


class evaluating:  # a context, like suppress
    """Turn whatever the user's code raises into a CorrectionError, which ends the attempt and keeps its text."""

    def __init__(self, p: float, where: str = "") -> None:
        self.p, self.where = p, where

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, _: object) -> None:
        if isinstance(error, Exception):
            detail = f"({type(error).__name__}{self.where} at parameter {self.p:.6g}: {error})"
            raise CorrectionError(Outcome.EVALUATION_FAILED, detail) from error


def linearise(problem: Problem, x: Array, p: float) -> Linearisation:
    """Return the problem's linearisation, or raise CorrectionError if it fails or is not finite."""
    check()
    with evaluating(p):
        linearisation = problem.linearise(x, p)
    _finite(linearisation[0], p)
    return linearisation


def residual(problem: Problem, x: Array, p: float) -> Array:
    """Return the residual, or raise CorrectionError if it fails or is not finite."""
    check()
    with evaluating(p):
        value = problem.residual(x, p)
    _finite(value, p)
    return value


def _finite(value: Array, p: float, what: str = "Residual", rest: float = 0.0) -> None:
    if not math.isfinite(float(np.add.reduce(value)) + rest):
        raise CorrectionError(Outcome.NOT_FINITE, f"({what} at parameter {p:.6g}.)")


def border(problem: Problem, x: Array, p: float, at: Linearisation, row: Direction) -> Bordered:
    """Factorise [J Fp; row] at a point, or raise CorrectionError."""
    try:
        return factorise(at[1], at[2], row[0], row[1], problem.preconditioner(x, p))
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error


def solve(bordered: Bordered, f: Array, g: float, p: float) -> Direction:
    """Solve a bordered system, or raise CorrectionError if that fails or the solution is not finite."""
    try:
        u, a = bordered.solve(f, g)
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error
    _finite(u, p, "Newton's correction", a)
    return u, a


def correct(
    problem: Problem,
    near: Direction,
    row: Direction,
    metric: Metric,
    options: Options,
    precise: bool = False,
    bordered: Bordered | None = None,
) -> Corrected:
    """Correct a predicted point (x, p) onto the curve, in the plane through it that `row` is normal to.

    Newton's method on

        [ J    Fp ] [ dx ]     [ F ]
        [ row     ] [ dp ] = - [ 0 ]

    whose last matrix also gives the tangent, [J Fp; row] (u, a) = (0, 1). Convergence is judged by the corrections:
    if they contract by θ, the next one of a quadratically convergent iteration is θ² times the present one.

    Parameters
    ----------
    bordered : Bordered, optional
        The matrix of a point close by, with the same row: it is kept where matrices are, see `CONTRACTS`.

    Raises
    ------
    CorrectionError
        If the iteration does not contract, or the problem fails.
    """
    x, p = near
    own = problem.in_plane(x, p, row, precise)
    if own is not None:
        return Corrected(*own, Bordered(), 0.0, 0.0)
    tolerance, noise = options.tolerance, options.noise
    close = PRECISE_TANGENT_DISTANCE if precise else TANGENT_DISTANCE
    floor = _rounding_floor(problem, x, p, metric)
    noise *= floor
    first = previous = math.inf
    contraction = 0.0
    worst = 0.0
    slow = False
    polishes = (precise or x.size >= LARGE) and _multiplies(problem, bordered)
    kept = polishes and bordered is not None
    share = 1.0 if precise else KEPT
    trusted = 1.0  # contraction from which on a matrix is kept
    for iteration in range(1, ITERATIONS + 1):
        if kept and bordered is not None:
            left = residual(problem, x, p)
        else:
            at = linearise(problem, x, p)
            left, bordered = at[0], border(problem, x, p, at, row)
            polishes = (precise or x.size >= LARGE) and _multiplies(problem, bordered)
        dx, dp = solve(bordered, -left, 0.0, p)
        size = metric.norm(problem, dx, dp)
        grows = iteration == 2 and noise < size < SMALL  # if at all: what is soft, see SMALL
        rounded = kept and iteration > 1 and size <= _roughness(problem, x, p, metric)
        # Not taken: it leads away, or from too far.
        if kept and size > max(min(previous, SMALL), tolerance, floor) and not (grows or rounded):
            kept, trusted = False, CONTRACTS
            continue
        x = x + dx
        p = p + dp
        if iteration == 1:
            first = size
            done = size <= max(tolerance, floor, close * (precise and not kept))  # the next one is about its square
        else:
            contraction = size / previous if previous > 0 else 0.0
            # The next correction, by the matrix kept or by its own.
            left_over = contraction * size / share if kept else contraction**2 * size
            done = rounded or ((kept or size <= max(close, floor)) and left_over <= max(tolerance, floor))
            # What no longer contracts close to rounding is as good as it gets.
            if not (done or kept) and contraction > 0.1:
                done = size <= max(noise, _roughness(problem, x, p, metric))
            again, slow = slow or size > SMALL, contraction > 0.5 and not kept  # otherwise its own matrix is next
            if not done and ((slow and again and iteration > options.patience) or not math.isfinite(size)):
                raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(Newton's corrections contract by {contraction:.2g}.)")
            if size > max(SMALL, noise):
                worst = max(worst, contraction)
        if done:
            if problem.delicate:
                dx, dp = solve(bordered, -residual(problem, x, p), 0.0, p)
                if metric.norm(problem, dx, dp) <= max(size, noise):  # otherwise it leads away
                    x, p = x + dx, p + dp
            if options.detect_branch_points and not precise and (kept or size > SIGNED):
                at = linearise(problem, x, p)
                bordered, kept = border(problem, x, p, at, row), False
            u, a = solve(bordered, np.zeros_like(x), 1.0, p)
            if kept or problem.delicate:
                u, a = _refined(problem, row, bordered, (x, p, u, a), (metric, close))
            problem.corrected(x, p, partial(_at_fixed_parameter, bordered, (u, a)))
            return Corrected(x, p, u, a, bordered, first, worst)
        previous = size
        kept = polishes and size < SMALL and (grows or contraction < (CONTRACTS if kept else trusted))
    raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(The last correction was {previous:.2g} of the step's scale.)")


def _multiplies(problem: Problem, bordered: Bordered | None) -> bool:
    """Whether a product with the Jacobian costs little beside its factorisation."""
    return type(problem).product is not Problem.product or isinstance(bordered, SparseBordered)


def _refined(
    problem: Problem,
    row: Direction,
    bordered: Bordered,
    at: tuple[Array, float, Array, float],
    fine: tuple[Metric, float],
) -> Direction:
    """The tangent at a point, from a matrix factorised next to it and products at the point itself.

    Until a change is below a share of it: the next is as much smaller again.
    """
    x, p, u, a = at
    metric, share = fine
    with evaluating(p):
        product, slope = problem.product(x, p), problem.parameter_derivative(x, p)
    for _ in range(POLISHINGS):
        du, da = solve(bordered, -product(u) - a * slope, 1.0 - float(row[0] @ u) - row[1] * a, p)
        u, a = u + du, a + da
        if metric.norm(problem, du, da) <= share * metric.norm(problem, u, a):
            break
    return u, a


def _at_fixed_parameter(bordered: Bordered, tangent: Direction, f: Array) -> Array:
    """Solve J v = f with a bordered matrix and its tangent, J u = −a Fp."""
    v, b = bordered.solve(f, 0.0)
    return v - b / tangent[1] * tangent[0]


def _rounding_floor(problem: Problem, x: Array, p: float, metric: Metric) -> float:
    return 16 * ROUNDING * (size_of(problem, x) / metric.state_scale + abs(p) / metric.parameter_scale)


def _roughness(problem: Problem, x: Array, p: float, metric: Metric) -> float:
    """Rounding as slopes see it."""
    return _rounding_floor(problem, x * (-1.0) ** np.arange(x.size), p, metric)


def correct_start(problem: Problem, x: Array, p: float) -> Array:
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
    for _ in range(START_ITERATIONS):
        size = float(np.linalg.norm(at[0]))
        if size == 0.0:
            return x
        try:
            dx, _zero = solve(border(problem, x, p, at, row), -at[0], 0.0, p)
        except CorrectionError as error:
            if size <= _residual_rounding(at, x, p):
                return x  # a fold
            detail = f"(The Jacobian at parameter {p:.6g} is singular and the residual's norm {size:.3g}.)"
            raise CorrectionError(Outcome.START_FAILED, detail) from error
        correction = size_of(problem, dx)
        scale = size_of(problem, x + dx)
        if correction <= 1e-10 * scale or (correction <= 1e-6 * scale and correction > 0.1 * previous):
            return x + dx
        try:
            x, at = _damped(problem, x, p, dx, size)
        except CorrectionError:
            if size <= _residual_rounding(at, x, p):
                return x
            raise
        previous = correction
    size = float(np.linalg.norm(at[0]))
    if size <= _residual_rounding(at, x, p) or size == 0.0:
        return x
    raise CorrectionError(Outcome.START_FAILED, f"(The residual's norm at parameter {p:.6g} is still {size:.3g}.)")


def _residual_rounding(at: Linearisation, x: Array, p: float) -> float:
    """Size of residuals that are rounding's, of x and p."""
    jacobian = abs(as_matrix(at.jacobian)) if not hasattr(at.jacobian, "matvec") else at.jacobian
    terms = jacobian @ np.abs(x) + np.abs(at.parameter_derivative * p)
    return 1e2 * ROUNDING * float(np.linalg.norm(terms))


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
