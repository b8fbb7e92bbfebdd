"""Newton's method on the curve: from a predicted point to a corrected one, with its true tangent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np

from contbranch.continuation.bordered import Bordered, SingularBorderedError, UnsolvedError, as_matrix, factorise
from contbranch.continuation.curve import Outcome
from contbranch.continuation.metric import ROUNDING, Metric
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Direction, Linearisation, Problem, size_of
from contbranch.watch import check

# Largest last correction (in the metric) behind which the matrix before it still serves: for the tangent of a step; for
# the sign of its determinant, which changes by many times as much where a symmetry is about to be lost; and for a
# tangent as accurate as its point.
TANGENT_DISTANCE, SIGN_DISTANCE, PRECISE_DISTANCE = 1e-4, 1e-7, 1e-10
# Corrections below this (in the metric) may grow: what is stiff in a prediction makes the first one small and the
# second, of what is soft, larger; the third is their square. A matrix farther from a point does not serve for it.
SMALL_CORRECTION = 1e-3
# A correction that is larger than this share of the one before does not contract as Newton's do.
STALL_RATIO = 0.1
# Most corrections of a predicted point or a tangent, and of a start.
CORRECTIONS, START_CORRECTIONS = 10, 50
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
    """A point on the curve with its tangent (not yet of unit length) and the bordered matrix next to it.

    Hidden is a point on whose place rounding of the residual leaves Newton's corrections no say.
    """

    x: Array
    parameter: float
    tangent_x: Array
    tangent_parameter: float
    bordered: Bordered
    hidden: bool = False


@contextmanager
def evaluating(p: float, where: str = "") -> Iterator[None]:
    """Turn whatever the user's code raises into a CorrectionError, which ends the attempt and keeps its text."""
    try:
        yield
    except Exception as error:
        detail = f"({type(error).__name__}{where} at parameter {p:.6g}: {error})"
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
        The matrix of a point close by, with the same row: it serves where the problem has a `product` of its own.

    Raises
    ------
    CorrectionError
        If the iteration does not contract, or the problem fails.
    """
    x, p = near
    own = problem.in_plane(x, p, row, precise)
    if own is not None:
        return Corrected(*own, Bordered())
    rounding = 16 * ROUNDING * (size_of(problem, x) / metric.state_scale + abs(p) / metric.parameter_scale)
    tolerance = max(options.tolerance, rounding)
    signed = options.detect_branch_points and not precise
    close = max(PRECISE_DISTANCE if precise else SIGN_DISTANCE if signed else TANGENT_DISTANCE, rounding)
    previous = height = math.inf
    # Where products with the Jacobian cost little beside its factorisation, that of a small correction serves for the
    # next ones as long as they contract by `STALL_RATIO`; the sign of a determinant needs the point's own.
    keeps = type(problem).product is not Problem.product and not signed
    kept = keeps and bordered is not None
    for iteration in range(1, CORRECTIONS + 1):
        if kept and bordered is not None:
            left = residual(problem, x, p)
        else:
            at = linearise(problem, x, p)
            left, bordered = at.residual, border(problem, x, p, at, row)
        dx, dp = solve(bordered, -left, 0.0, p)
        size = metric.norm(problem, dx, dp)
        contraction = size / previous
        stalls = contraction > STALL_RATIO
        if kept and size > max(min(previous, SMALL_CORRECTION), tolerance):  # not taken: it leads away
            kept = False
            continue
        height, highest = float(np.abs(left).max()), height
        rests = stalls and not kept and size > tolerance and height > 0.5 * highest  # the residual, too
        rounded = rests and is_rounding(left, at, x, p, Options.noise)
        if not rounded:
            x, p = x + dx, p + dp
        if iteration == 1:
            done = size <= max(tolerance, close * (precise and not kept))  # the next one is about its square
        else:
            left_over = contraction * size if kept else contraction**2 * size
            done = rounded or (left_over <= tolerance and (kept or size <= close))
            done |= stalls and not kept and size <= options.noise * rounding
            failed = contraction > 0.5 and size > SMALL_CORRECTION and iteration > options.patience + 1
            if not done and (failed or not math.isfinite(size)):
                raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(Newton's corrections contract by {contraction:.2g}.)")
        if done:
            if kept or (precise and size > tolerance):
                u, a = _tangent(problem, (x, p), row, bordered, (metric, close))
            else:
                u, a = solve(bordered, np.zeros_like(x), 1.0, p)
            problem.corrected(x, p, partial(_at_fixed_parameter, bordered, (u, a)))
            return Corrected(x, p, u, a, bordered, rounded)
        previous = size
        kept = keeps and size < SMALL_CORRECTION and not (kept and stalls)
    raise CorrectionError(Outcome.STEP_TOO_SMALL, f"(The last correction was {previous:.2g} of the step's scale.)")


def _tangent(
    problem: Problem, at: Direction, row: Direction, bordered: Bordered, close: tuple[Metric, float]
) -> Direction:
    """Return the tangent at a point, from a matrix factorised next to it and products at the point itself.

    It is refined until a change is below a share of it, `close`: the next is as much smaller again.
    """
    (x, p), (metric, share) = at, close
    u, a = solve(bordered, np.zeros_like(x), 1.0, p)
    with evaluating(p):
        product, slope = problem.product(x, p), problem.parameter_derivative(x, p)
    for _ in range(CORRECTIONS):
        du, da = solve(bordered, -product(u) - a * slope, 1.0 - float(row[0] @ u) - row[1] * a, p)
        u, a = u + du, a + da
        if metric.norm(problem, du, da) <= share * metric.norm(problem, u, a):
            break
    return u, a


def _at_fixed_parameter(bordered: Bordered, tangent: Direction, f: Array) -> Array:
    """Solve J v = f with a bordered matrix and its tangent, J u = −a Fp."""
    v, b = bordered.solve(f, 0.0)
    return v - b / tangent[1] * tangent[0]


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
