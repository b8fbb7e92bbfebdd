"""Branch points: where another curve crosses the one that is followed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contbranch.continuation.bordered import Bordered, SingularBorderedError, as_matrix, bordered_matrix, factorise
from contbranch.continuation.curve import BranchPoint, Outcome, Point
from contbranch.continuation.folds import second_derivative
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import ROUNDING, CorrectionError, border, linearise, residual, solve
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Direction, Linearisation, Problem, size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on

# μ at the saddle, as a share of its change over the step. Of a true branch point it is rounding; where it is larger
# the two curves pass each other, and a step that saw the determinant change sign has leapt from one to the other.
CONFIRMED = 1e-9
# A direction whose parameter component (in the metric) is below this is that of an extremum of the parameter.
FLAT = 1e-4
# Below this length a change of the determinant's sign is reported as a branch point even if no simple one is found.
UNRESOLVED = 1e-5
# Down to this length a branch point that is not found says that the step has leapt; below it, where the matrices at
# both ends foretell it, that it is no simple one.
SHORT = 0.02
# ... and that rounding hides the curve between several.
HIDDEN = 1e-3
# Share of what follows by which a matrix is taken beside the place where it is singular.
SINGULAR = 1e-9
_FIFTH_ROOT_OF_ROUNDING = ROUNDING**0.2
# Several branch points are in one place where a solution is larger than at the ends of the step by this factor.
SEVERAL = 1e2
# Pieces of a step that are looked into at most: more of them are rounding's.
PIECES = 300
# Dimensions of the space in which the largest eigenvalues of a pencil are looked for.
SPACE = 10
# A step that has passed to another curve is farther off its own cubic in the middle, as a share of its length and the
# angle (at least this) by which it turns, or points elsewhere, as a share of that angle, than a curve is.
SLIGHT, OFF, ASTRAY = 0.2, 0.02, 0.1
# Share of a step over which F is differenced along its cubic.
ALONG = 1e-3
# A branch point this much farther from where it is foretold, relative to the nearer end, may be another step's.
NEAR = 0.5
# A piece is divided between two singular places that are farther apart than this share of it, otherwise beside them, by
# this share of what lies there.
APART, ASIDE = 0.1, 0.03

Kind = Literal["pitchfork", "transcritical", "branch point"]


@dataclass(frozen=True, slots=True, eq=False)
class _Saddle:
    """State of the iteration: μ with its gradient and Hessian in (α, β), and the directions of α and β."""

    back: Direction
    mu: float
    gradient: Array
    hessian: Array
    alpha: Direction
    beta: Direction


class LeapError(Exception):
    """The step has leapt from one part of the curve to another: both ends lie on it, but not as neighbours."""


def branch_points(segment: Segment, ahead: Bordered | None, options: Options) -> list[tuple[float, BranchPoint]]:
    """Return the branch points of a step, with their places in it, in order.

    The determinant's sign tells an odd number of them from an even one, and the matrices at both ends how many: where
    that is not one, the step is divided.

    Parameters
    ----------
    segment : Segment
        The step.
    ahead : Bordered, optional
        The matrix at its end, as far as Newton's method has it; otherwise it is factorised.
    options : Options
        Tolerances.

    Raises
    ------
    LeapError
        If the step has passed from one curve to another that crosses it or passes by, if the determinant changes sign
        without a branch point in between, or if there seems no end of them.
    CorrectionError
        If the curve cannot be found inside the step.
    """
    if segment.begin.determinant_sign is None or segment.end.determinant_sign is None:
        return []
    if ahead is None:
        ahead = _matrix(segment.end, segment)
    if segment.length > UNRESOLVED and _kinked(segment, ahead):
        raise LeapError
    found, pieces = list[tuple[float, BranchPoint]](), [(segment, ahead, 0.0, 1.0)]
    for _ in range(PIECES):
        if not pieces:
            return found
        piece, matrix, offset, share = pieces.pop()
        if piece is not segment and piece.length > UNRESOLVED and _bent(piece, options):
            raise LeapError
        inside, division = _looked_into(piece, matrix, options)
        found += [(offset + share * theta, one) for theta, one in inside]
        if division is not None:
            theta, point, between = division
            first, last = Segment(piece.begin, point, piece.metric), Segment(point, piece.end, piece.metric)
            pieces += [
                (last, matrix, offset + share * theta, share * (1.0 - theta)),
                (first, between, offset, share * theta),
            ]
    raise LeapError


def _looked_into(
    piece: Segment, ahead: Bordered, options: Options
) -> tuple[list[tuple[float, BranchPoint]], tuple[float, Point, Bordered] | None]:
    """Return the branch points of a piece of a step, or where to divide it, with the point and the matrix there."""
    crossed = piece.begin.determinant_sign != piece.end.determinant_sign
    places = _singular(piece, ahead)
    if not places and not crossed:
        return [], None
    if len(places) <= 1 and crossed:
        foretold = places[0] if places else 0.5
        found = locate_branch_point(piece, foretold) or unresolved_branch_point(piece)
        if found is None and (piece.length > SHORT or not places):
            raise LeapError
        near = found is not None and abs(found[0] - foretold) <= NEAR * min(foretold, 1.0 - foretold)
        if found is not None and (near or piece.length <= UNRESOLVED):
            return [found], None
    elif piece.length <= UNRESOLVED:
        return _coinciding(piece), None
    theta = _between(places)
    try:
        point, _ = point_on(piece, theta, options)
        bordered = _matrix(point, piece)
    except CorrectionError:
        # Next to several that coincide rounding hides the curve.
        if piece.length > HIDDEN or len(places) <= 1:
            raise
        return _coinciding(piece), None
    return [], (theta, replace(point, determinant_sign=bordered.determinant_sign()), bordered)


def _kinked(segment: Segment, ahead: Bordered) -> bool:
    """Whether a step turns like two curves that cross, from the one to the other, rather than like one.

    What is left of F and of its change along the cubic, in the middle, tells how far off the curve the cubic is there.
    """
    problem, metric, (x, p) = segment.begin.problem, segment.metric, segment.at(0.5)
    begin, end = (_tangent(point, segment) for point in (segment.begin, segment.end))
    angle = max(metric.angle(problem, *begin, *end), SLIGHT)
    u, a = segment.direction(0.5)
    left = residual(problem, x, p)
    after, before = (residual(problem, x + by * u, p + by * a) for by in (ALONG, -ALONG))
    off = metric.norm(problem, *solve(ahead, left, 0.0, p))
    astray = metric.norm(problem, *solve(ahead, (after - before) / (2 * ALONG), 0.0, p))
    return off > OFF * angle * segment.length or astray > ASTRAY * angle * metric.norm(problem, u, a)


def _bent(segment: Segment, options: Options) -> bool:
    """Whether a piece of a step turns by more than a step may: it has come to another curve in between.

    Where two curves pass each other, what goes straight on from the one to the other has such pieces.
    """
    metric, problem = segment.metric, segment.begin.problem
    chord = metric.unit(problem, *segment.chord)
    angles = [metric.angle(problem, *_tangent(point, segment), *chord) for point in (segment.begin, segment.end)]
    return max(angles) > options.angle_limit


def _singular(segment: Segment, ahead: Bordered) -> list[float]:
    """Return the places θ at which [J Fp; tᵀ] is singular if it changes linearly along the step, in order.

    With M(θ) = M₁ + (1 − θ) (M₀ − M₁), det M(θ) = 0 where −1/(1 − θ) is an eigenvalue of M₁⁻¹ M₀ − 1: one of −1 or
    less. In M₀ the tangent is turned to that of M₁, the plane of both alone, since it is the rest of the space that
    matters.
    """
    problem, metric, n = segment.begin.problem, segment.metric, segment.begin.x.size
    begin, end = (_tangent(point, segment) for point in (segment.begin, segment.end))
    at = linearise(problem, segment.begin.x, segment.begin.parameter)
    row = metric.row(problem, *begin)
    matrix = bordered_matrix(at[1], at[2], *row)
    there, own, other = np.append(*begin), np.append(*metric.row(problem, *end)), np.append(*row)
    both = (there + np.append(*end)) / (1.0 + own @ there)
    units = np.append(np.full(n, metric.state_scale), metric.parameter_scale)

    def product(v: Array) -> Array:
        image = matrix @ (units * v - (own + other) @ (units * v) * both + 2.0 * (own @ (units * v)) * there)
        return np.asarray(np.append(*ahead.solve(image[:n], float(image[n]))) / units - v)

    projected = _projected(product, n + 1)
    values = np.linalg.eigvals(projected) if np.isfinite(projected).all() else np.zeros(0)
    # Two that are close to each other may look complex.
    return sorted(float(1.0 + 1.0 / v.real) for v in values if v.real <= -1.0 and abs(v.imag) <= 0.5 * abs(v.real))


def _projected(product: Callable[[Array], Array], size: int) -> Array:
    """Return a matrix with the largest eigenvalues of an operator: its projection on a Krylov space (Arnoldi)."""
    count = min(size, SPACE)
    basis, projected = np.zeros((count + 1, size)), np.zeros((count + 1, count))
    start = np.cos(1.0 + np.arange(size) ** 2 % 7919)
    basis[0] = start / np.linalg.norm(start)
    for k in range(count):
        image = product(basis[k])
        scale = float(np.linalg.norm(image))
        for _ in range(2):  # rounding leaves some of the others
            shares = basis[: k + 1] @ image
            projected[: k + 1, k] += shares
            image = image - shares @ basis[: k + 1]
        projected[k + 1, k] = np.linalg.norm(image)
        if not projected[k + 1, k] > ROUNDING * size * scale:
            return projected[: k + 1, : k + 1]
        basis[k + 1] = image / projected[k + 1, k]
    return projected[:count]


def _matrix(point: Point, segment: Segment) -> Bordered:
    """Factorise the matrix bordered by a point's tangent."""
    at = linearise(point.problem, point.x, point.parameter)
    row = segment.metric.row(point.problem, *_tangent(point, segment))
    return border(point.problem, point.x, point.parameter, at, row)


def _tangent(point: Point, segment: Segment) -> Direction:
    return segment.metric.unit(segment.begin.problem, point.tangent_x, point.tangent_parameter)


def _between(places: list[float]) -> float:
    """Return where to divide a piece: in the widest gap between places on [0, 1], beside them if they coincide."""
    gaps = np.diff(places)
    if len(gaps) and gaps.max() > APART:
        return float(places[int(gaps.argmax())] + gaps.max() / 2)
    if not places:
        return 0.5
    before, behind = places[0], 1.0 - places[-1]
    return before * (1.0 - ASIDE) if before > behind else 1.0 - behind * (1.0 - ASIDE)


def locate_branch_point(segment: Segment, start: float) -> tuple[float, BranchPoint] | None:
    """Locate the branch point between two points of opposite determinant; None if there is none after all.

    The start is where the matrices at both ends foretell it.

    Near a branch point the matrix [J Fp; tᵀ] is singular, but with its left and right null vectors l and r

        [ J   Fp   l ] [ y' ]   [ 0 ]     [ 0 ]
        [ t        0 ] [    ] = [ 1 ]  or [ 0 ]
        [ r        0 ] [ μ' ]   [ 0 ]     [ 1 ]

    is regular. It parametrises a surface y(α, β) on which F(y) + μ l = 0, with α counted along t and β along r
    (Lyapunov-Schmidt reduction). The curves are the lines μ = 0, and a branch point is a saddle of μ at height zero:
    Newton's method solves ∇μ = 0, with the Hessian from second derivatives of F. The quadratic form of the Hessian
    vanishes along the two curves' directions. (W. Govaerts, Numerical Methods for Bifurcations of Dynamical
    Equilibria, SIAM 2000, ch. 6.)

    Returns
    -------
    (theta, event) or None
        Position within the segment, and the branch point.
    """
    problem, metric = segment.begin.problem, segment.metric
    try:
        row, left, right = _reduction(segment, start)
        x, p = segment.at(start)
        previous, stalled = math.inf, False
        for _ in range(15):
            saddle = _saddle(segment, x, p, row, (left, right))
            step = -np.linalg.solve(saddle.hessian, saddle.gradient)
            dx = saddle.back[0] + step[0] * saddle.alpha[0] + step[1] * saddle.beta[0]
            dp = saddle.back[1] + step[0] * saddle.alpha[1] + step[1] * saddle.beta[1]
            size = metric.norm(problem, dx, dp)
            if not size <= 2 * segment.length:
                return None
            x, p = x + dx, float(p + dp)
            # Once, a correction back onto the curve may be as large as the one before along it.
            again, stalled = stalled, size < 1e-7 and size > 0.1 * previous
            if size <= 1e-13 or (stalled and again):
                simple = _simple(segment, x, p, row, (left, right))
                return _report(segment, saddle, x, p, dx, dp) if simple else None
            previous = size
    except (CorrectionError, np.linalg.LinAlgError):
        return None
    return None


def unresolved_branch_point(segment: Segment) -> tuple[float, BranchPoint] | None:
    """Return the middle of a very short step across which the determinant changes sign without a simple crossing."""
    return None if segment.length > UNRESOLVED else _within(segment)


def _coinciding(segment: Segment) -> list[tuple[float, BranchPoint]]:
    """Return several branch points that cannot be told from each other as one, unless an index tells of them better."""
    told = type(segment.begin.problem).morse_index is not Problem.morse_index
    return [] if told else [_within(segment)]


def _within(segment: Segment) -> tuple[float, BranchPoint]:
    """Return the middle of a step, its lengths being the errors."""
    x, p = segment.at(0.5)
    problem = segment.begin.problem
    point = Point(problem, x, p, *segment.metric.unit(problem, *segment.direction(0.5)), label="branch point")
    state_error = size_of(problem, segment.end.x - segment.begin.x)
    return 0.5, BranchPoint(point, abs(segment.end.parameter - segment.begin.parameter), state_error)


def _reduction(segment: Segment, theta: float) -> tuple[Direction, Array, Array]:
    """Return the row t, and the null vectors l (n) and r (as a row, n+1) of the matrix interpolated at θ.

    Inverse iteration at either end would find what is smallest there, which depends on units: this one is singular.
    """
    problem, metric = segment.begin.problem, segment.metric
    row = metric.row(problem, *metric.unit(problem, *segment.chord))
    n, rest = row[0].size, SINGULAR * (1.0 - theta)  # beside it: exact zeros have no factors
    (_, first, before), (_, last, after) = (
        linearise(problem, point.x, point.parameter) for point in (segment.begin, segment.end)
    )
    share = theta + rest
    jacobian = (1.0 - share) * as_matrix(first) + share * as_matrix(last)
    bordered = border(
        problem, *segment.at(theta), Linearisation(before, jacobian, before + share * (after - before)), row
    )
    left = np.cos(1.0 + np.arange(n) ** 2 % 7919)
    for _ in range(2):
        u, a = solve(bordered, left, 0.0, segment.begin.parameter)
        u, a = metric.unit(problem, u, a)
        right = np.append(*metric.row(problem, u, a))
        solved = bordered.solve_transposed(right[:n], float(right[n]))
        if solved is None:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(No transposed solves.)")
        left = solved[0] / np.linalg.norm(solved[0])
    if not np.all(np.isfinite(left)):
        raise CorrectionError(Outcome.NOT_FINITE, "(The bordered matrix is singular.)")
    return row, left, right


def _saddle(segment: Segment, x: Array, p: float, row: Direction, null_vectors: tuple[Array, Array]) -> _Saddle:
    """Return μ with its derivatives at (x, p)."""
    problem, metric, n = segment.begin.problem, segment.metric, x.size
    at = linearise(problem, x, p)
    matrix = _augmented(at, row, null_vectors)

    def solved(f: Array, g: float, h: float) -> tuple[Direction, float]:
        y, multiplier = solve(matrix, np.append(f, g), h, p)
        return (y[:n], float(y[n])), multiplier

    nothing = np.zeros(n)
    back, mu = solved(-at[0], 0.0, 0.0)
    alpha, mu_alpha = solved(nothing, 1.0, 0.0)
    beta, mu_beta = solved(nothing, 0.0, 1.0)

    def slope(direction: Direction, multiplier: float) -> float:
        """The multiplier's rate along a direction, free from the errors of a matrix of differences."""
        rate = _derivative(problem, x, p, direction, metric)
        return multiplier + solved(-rate - multiplier * null_vectors[0], 0.0, 0.0)[1]

    if _differenced(problem):
        mu_alpha, mu_beta = slope(alpha, mu_alpha), slope(beta, mu_beta)

    def bend(direction: Direction) -> float:
        d = second_derivative(problem, x, p, direction, metric, at[0])
        return solved(-d, 0.0, 0.0)[1]

    aa, bb = bend(alpha), bend(beta)
    # The directions differ in length by far: scaling one brings both to bear on the mixed derivative.
    scale = metric.norm(problem, *alpha) / metric.norm(problem, *beta)
    both = (alpha[0] + scale * beta[0], alpha[1] + scale * beta[1])
    ab = (bend(both) - aa - scale**2 * bb) / (2 * scale)
    return _Saddle(back, mu, np.array([mu_alpha, mu_beta]), np.array([[aa, ab], [ab, bb]]), alpha, beta)


def _differenced(problem: Problem) -> bool:
    """Whether the problem leaves its Jacobian to differences."""
    kind = type(problem)
    return kind.jacobian is Problem.jacobian and kind.linearise is Problem.linearise


def _derivative(problem: Problem, x: Array, p: float, along: Direction, metric: Metric) -> Array:
    """Return the derivative of F along a direction, by differences of fourth order."""
    u, a = along
    step = _FIFTH_ROOT_OF_ROUNDING / metric.norm(problem, u, a)
    near, far = (
        (residual(problem, x + s * u, p + s * a) - residual(problem, x - s * u, p - s * a)) / (2 * s)
        for s in (step, 2 * step)
    )
    return np.asarray((4 * near - far) / 3)


def _augmented(at: Linearisation, row: Direction, null_vectors: tuple[Array, Array]) -> Bordered:
    """Factorise the matrix with both null vectors, or raise CorrectionError."""
    left, right = null_vectors
    # μ belongs to F alone: the row t stays exact, so that α is a coordinate.
    column = np.append(left, 0.0)
    try:
        return factorise(bordered_matrix(at[1], at[2], *row), column, right, 0.0)
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error


def _simple(segment: Segment, x: Array, p: float, row: Direction, null_vectors: tuple[Array, Array]) -> bool:
    """Whether no more than two curves cross: otherwise the matrix with both null vectors is singular, too."""
    if x.size == 1:
        return True
    problem, metric = segment.begin.problem, segment.metric
    load = np.append(np.cos(1.0 + np.arange(x.size) ** 2 % 7919), 0.0)
    sizes = []
    for at, q in ((x, p), (segment.begin.x, segment.begin.parameter), (segment.end.x, segment.end.parameter)):
        y, _ = solve(_augmented(linearise(problem, at, q), row, null_vectors), load, 0.0, q)
        sizes.append(metric.norm(problem, y[:-1], float(y[-1])))
    return sizes[0] < SEVERAL * max(sizes[1:])


def _report(
    segment: Segment, saddle: _Saddle, x: Array, p: float, dx: Array, dp: float
) -> tuple[float, BranchPoint] | None:
    """Return the branch point with both directions, if it is one and lies in the step."""
    problem, metric = segment.begin.problem, segment.metric
    theta = segment.position(x, p)
    near_x, near_p = segment.at(min(max(theta, 0.0), 1.0))
    away = metric.norm(problem, x - near_x, p - near_p)
    if not -0.05 <= theta <= 1.05 or away > 0.2 * segment.length:
        return None
    # Lengths in which α and β change by one step, to compare μ with its own change.
    units = np.array([1 / metric.norm(problem, *saddle.alpha), 1 / metric.norm(problem, *saddle.beta)])
    form = saddle.hessian * np.outer(units, units)
    size = float(np.max(np.abs(form)))
    discriminant = form[0, 1] ** 2 - form[0, 0] * form[1, 1]
    if not discriminant > 0 or abs(saddle.mu) > size * max(CONFIRMED * segment.length**2, 1e3 * ROUNDING):
        return None
    along, other = _directions(segment, saddle, form, units, theta)
    flat = min(abs(along[1]), abs(other[1])) < FLAT * metric.parameter_scale
    type_: Kind = "pitchfork" if flat else "transcritical"
    point = Point(problem, x, p, along[0], along[1], label="branch point")
    rough = _FIFTH_ROOT_OF_ROUNDING**4 if _differenced(problem) else ROUNDING  # of differences of fourth order
    error = 4 * (abs(float(dp)) + ROUNDING * abs(p) + rough * metric.parameter_scale)
    state_error = 4 * (size_of(problem, dx) + ROUNDING * size_of(problem, x) + rough * metric.state_scale)
    scales = (metric.state_scale, metric.parameter_scale)
    other_x, other_p = other
    return theta, BranchPoint(
        point, error, state_error, type=type_, other_x=other_x, other_parameter=other_p, scales=scales
    )


def _directions(
    segment: Segment, saddle: _Saddle, form: Array, units: Array, theta: float
) -> tuple[Direction, Direction]:
    """Return the unit directions in which the quadratic form vanishes, that of the curve followed first."""
    problem, metric = segment.begin.problem, segment.metric
    values, vectors = np.linalg.eigh(form)
    slope = math.sqrt(-values[0] / values[1])
    followed = segment.direction(min(max(theta, 0.0), 1.0))
    candidates = []
    for sign in (1.0, -1.0):
        a, b = (vectors[:, 0] + sign * slope * vectors[:, 1]) * units
        u, v = a * saddle.alpha[0] + b * saddle.beta[0], a * saddle.alpha[1] + b * saddle.beta[1]
        size = metric.norm(problem, u, v)
        along = metric.dot(problem, u, v, *followed) / size
        factor = math.copysign(1 / size, along)
        candidates.append((abs(along), (u * factor, float(v * factor))))
    candidates.sort(key=lambda candidate: candidate[0], reverse=True)
    return candidates[0][1], candidates[1][1]
