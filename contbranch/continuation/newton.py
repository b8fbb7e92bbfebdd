"""Newton's method on the curve: from a predicted point to a corrected one, with its true tangent."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contbranch.continuation.bordered import (
    Bordered,
    SingularBorderedError,
    SparseBordered,
    UnsolvedError,
    as_matrix,
    factorise,
)
from contbranch.continuation.curve import Outcome
from contbranch.continuation.metric import ROUNDING, Metric
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Direction, Linearisation, Problem, size_of
from contbranch.watch import check

# Largest last correction (in the metric) behind which the Jacobian before it serves for the tangent.
TANGENT_DISTANCE = 1e-4
PRECISE_TANGENT_DISTANCE = 1e-10
# Corrections below this (in the metric) may grow once, and tell nothing of how long a step may be: what is stiff in a
# prediction makes the first one small and the second, of what is soft, larger; the third is their square.
SMALL_CORRECTION = 1e-3
# A correction that is no smaller than this share of the one before does not contract as Newton's do.
STALL_RATIO = 0.1
# Where a product with the Jacobian costs little beside its factorisation, the one of a small correction serves for the
# next ones as long as they contract by STALL_RATIO, in steps from this size of the system on.
KEPT_FROM_SIZE = 150
# What a kept matrix leaves of a residual would count as a discretisation's error: steps aim at this much less.
KEPT_SHARE = 1e-2
# Last correction above which the matrix before it does not tell the sign of the determinant behind it: what is soft in
# other directions than that of the correction, as where a symmetry is about to be lost, changes by many times as much.
SIGN_DISTANCE = 1e-7
# Most corrections of a predicted point, of a start, and of a tangent.
CORRECTIONS, START_CORRECTIONS, TANGENT_CORRECTIONS = 10, 50, 8
# A start is a solution if no component of its residual is larger than this multiple of rounding, ...
START_ROUNDINGS = 4.0
# ... if Newton's correction is below this share of it, or if rounding hides how to lower the residual and the
# correction is below this share of the way to it.
START_TOLERANCE, START_STALL = 1e-10, 1e-6

# Change of a unit tangent by a refinement from which on the equations do not determine it.
UNDETERMINED_TANGENT = 1e-3
AT_BIFURCATION = "(The start is a bifurcation: a solution at which several curves cross. Start beside it.)"


class CorrectionError(Exception):
    """No corrected point was reached; `outcome` and `detail` say why."""

    def __init__(self, outcome: Outcome, detail: str):
        super().__init__(detail)
        self.outcome = outcome
        self.detail = detail


@dataclass(frozen=True, slots=True, eq=False)
class Corrected:
    """A point on the curve with its tangent (not yet of unit length), and what Newton's method said on the way.

    The uncertainty is a length: Newton's last correction, where the residual is at rounding and it tells nothing.
    """

    x: Array
    parameter: float
    tangent_x: Array
    tangent_parameter: float
    bordered: Bordered
    first_correction: float
    contraction: float
    uncertainty: float = 0.0


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
    except (SingularBorderedError, UnsolvedError) as error:
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
        The matrix of a point close by, with the same row: it is kept where matrices are, see `STALL_RATIO`.

    Raises
    ------
    CorrectionError
        If the iteration does not contract, or the problem fails.
    """
    x, p = near
    own = problem.in_plane(x, p, row, precise)
    if own is not None:
        return Corrected(*own, Bordered(), 0.0, 0.0)
    rounding = 16 * ROUNDING * (size_of(problem, x) / metric.state_scale + abs(p) / metric.parameter_scale)
    tolerance = max(options.tolerance, rounding)
    close = max(PRECISE_TANGENT_DISTANCE if precise else TANGENT_DISTANCE, rounding)
    first = previous = height = highest = math.inf
    contraction = worst = 0.0
    slow = False
    keeps = (precise or x.size >= KEPT_FROM_SIZE) and _multiplies(problem, bordered)
    kept = keeps and bordered is not None
    share = 1.0 if precise else KEPT_SHARE
    trusted = 1.0  # contraction from which on a matrix is kept
    at: Linearisation | None = None
    for iteration in range(1, CORRECTIONS + 1):
        if kept and bordered is not None:
            left = residual(problem, x, p)
        else:
            at = linearise(problem, x, p)
            left, bordered = at.residual, border(problem, x, p, at, row)
            keeps = (precise or x.size >= KEPT_FROM_SIZE) and _multiplies(problem, bordered)
        dx, dp = solve(bordered, -left, 0.0, p)
        size = metric.norm(problem, dx, dp)
        grows = iteration == 2 and tolerance < size < SMALL_CORRECTION  # if at all: what is soft
        stalls = iteration > 1 and size > STALL_RATIO * previous
        rests = stalls and size > tolerance and float(np.abs(left).max()) > 0.5 * height  # the residual, too
        rounded = rests and is_rounding(left, at or linearise(problem, x, p), x, p, Options.noise)
        if kept and size > max(min(previous, SMALL_CORRECTION), tolerance) and not (grows or rounded):
            kept, trusted = False, STALL_RATIO  # not taken: it leads away, or from too far
            continue
        if not rounded:
            x, p = x + dx, p + dp
        height, highest = float(np.abs(left).max()), height
        if iteration == 1:
            first = size
            done = size <= max(tolerance, close * (precise and not kept))  # the next one is about its square
        else:
            contraction = size / previous if previous > 0 else 0.0
            # The next correction, by the matrix kept or by its own.
            left_over = contraction * size / share if kept else contraction**2 * size
            done = rounded or ((kept or size <= close) and left_over <= tolerance)
            done |= stalls and not kept and size <= options.noise * rounding
            # Where the matrix is soft, corrections are rounding while the residual falls as it should.
            again, slow = slow or size > SMALL_CORRECTION, contraction > 0.5 and not kept and height > 0.5 * highest
            if not done and ((slow and again and iteration > options.patience) or not math.isfinite(size)):
                raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(Newton's corrections contract by {contraction:.2g}.)")
            if size > SMALL_CORRECTION:
                worst = max(worst, contraction)
        if done:
            if options.detect_branch_points and not precise and (kept or size > SIGN_DISTANCE):
                at = linearise(problem, x, p)
                bordered, kept = border(problem, x, p, at, row), False
            u, a = solve(bordered, np.zeros_like(x), 1.0, p)
            if kept or (precise and size > tolerance):
                u, a = _refined(problem, row, bordered, (x, p, u, a), (metric, close))
            return Corrected(x, p, u, a, bordered, first, worst, size if rounded else 0.0)
        previous = size
        kept = keeps and size < SMALL_CORRECTION and (grows or contraction < (STALL_RATIO if kept else trusted))
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
    for _ in range(TANGENT_CORRECTIONS):
        du, da = solve(bordered, -product(u) - a * slope, 1.0 - float(row[0] @ u) - row[1] * a, p)
        u, a = u + du, a + da
        if metric.norm(problem, du, da) <= share * metric.norm(problem, u, a):
            break
    return u, a


def residual_terms(at: Linearisation, x: Array, p: float) -> Array:
    """Return |J||x| + |Fp p|, shape (n,): times the unit roundoff, that is what rounding of x and p makes of F."""
    jacobian = at.jacobian if hasattr(at.jacobian, "matvec") else abs(as_matrix(at.jacobian))
    return np.asarray(np.abs(jacobian @ np.abs(x)) + np.abs(at.parameter_derivative * p))


def differenced(problem: Problem) -> bool:
    """Whether the problem leaves its Jacobian to differences."""
    kind = type(problem)
    return kind.jacobian is Problem.jacobian and kind.linearise is Problem.linearise


def jacobian_rounding(problem: Problem) -> float:
    """Return the relative rounding of a Jacobian: that of central differences where it is left to them."""
    return ROUNDING ** (2 / 3) if differenced(problem) else ROUNDING


def is_rounding(f: Array, at: Linearisation, x: Array, p: float, multiple: float) -> bool:
    """Whether no component of a residual is larger than a multiple of what rounding of x and p makes of it."""
    return bool(np.all(np.abs(f) <= multiple * ROUNDING * residual_terms(at, x, p)))


def correct_start(problem: Problem, x: Array, p: float) -> tuple[Array, float]:
    """Return a solution at fixed p near x by damped Newton iteration, and how far the iteration has gone.

    Raises
    ------
    CorrectionError
        With the residual that was reached.
    """
    x = np.array(x, dtype=float)
    row, travelled = (np.zeros_like(x), 1.0), 0.0
    at = linearise(problem, x, p)
    for _ in range(START_CORRECTIONS):
        size = float(np.linalg.norm(at.residual))
        if is_rounding(at.residual, at, x, p, START_ROUNDINGS):
            return x, travelled
        try:
            dx, _ = solve(border(problem, x, p, at, row), -at.residual, 0.0, p)
        except CorrectionError as error:
            if is_rounding(at.residual, at, x, p, Options.noise):  # a fold
                return x, travelled
            detail = f"({error} The residual's norm at parameter {p:.6g} is {size:.3g}.)"
            raise CorrectionError(Outcome.START_FAILED, detail) from error
        correction = size_of(problem, dx)
        travelled += correction
        if correction <= START_TOLERANCE * size_of(problem, x + dx):
            return x + dx, travelled
        lower = _damped(problem, x, p, dx, size)
        if lower is None:
            break
        x, at = lower
    if correction <= START_STALL * max(size_of(problem, x), travelled):
        return x, travelled
    detail = f"(The residual's norm at parameter {p:.6g} is still {size:.3g}.)"
    raise CorrectionError(Outcome.START_FAILED, detail)


def _damped(problem: Problem, x: Array, p: float, dx: Array, size: float) -> tuple[Array, Linearisation] | None:
    """Take the largest of the steps dx, dx/2, dx/4, ... that lowers the residual's norm; None if none does."""
    failure: CorrectionError | None = None
    for halvings in range(20):
        trial = x + dx * 0.5**halvings
        try:
            at = linearise(problem, trial, p)
        except CorrectionError as error:
            failure = error
            continue
        if np.linalg.norm(at.residual) <= (1 - 0.1 * 0.5**halvings) * size:
            return trial, at
    if failure is not None:
        raise failure
    return None


def tangent_at(problem: Problem, x: Array, p: float) -> tuple[Array, float, Bordered]:
    """Return a tangent at a solution when none is known yet, and the matrix bordered by it.

    The first border is an arbitrary fixed direction, which is transversal to the curve unless by accident; the
    tangent found with it is the border of a second solve, which makes it accurate.
    """
    at = linearise(problem, x, p)
    arbitrary = np.cos(1.0 + np.arange(x.size) ** 2 % 7919)
    row = (problem.dual(arbitrary), 0.7)
    for _ in range(2):
        try:
            bordered = border(problem, x, p, at, row)
        except CorrectionError as error:
            raise CorrectionError(Outcome.START_FAILED, AT_BIFURCATION) from error
        u, a = solve(bordered, np.zeros_like(x), 1.0, p)
        size = math.sqrt(max(problem.inner(u, u), 0.0) + a * a)
        u, a = u / size, a / size
        row = (problem.dual(u), a)
    du, da = solve(bordered, -(at.jacobian @ u + a * at.parameter_derivative), 0.0, p)
    if math.sqrt(max(problem.inner(du, du), 0.0) + da * da) > UNDETERMINED_TANGENT:
        raise CorrectionError(Outcome.START_FAILED, AT_BIFURCATION)
    if size_of(problem, du) > 0.5 * size_of(problem, u):  # rounding, of a state at rest
        u = np.zeros_like(x)
    return u, a, bordered
