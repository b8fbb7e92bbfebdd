"""Branch points: where other curves cross the one that is followed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contbranch.continuation.bordered import (
    Bordered,
    SingularBorderedError,
    as_matrix,
    bordered_matrix,
    factorise,
)
from contbranch.continuation.curve import BranchPoint, Outcome, Point
from contbranch.continuation.folds import second_derivative
from contbranch.continuation.metric import ROUNDING, Metric
from contbranch.continuation.newton import (
    CORRECTIONS,
    CorrectionError,
    border,
    differenced,
    jacobian_rounding,
    linearise,
    residual,
    residual_terms,
    solve,
)
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Direction, Linearisation, Problem, size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import corrected_point, point_on

# μ at the saddle, as a share of its change over the step. Of a true branch point it is rounding; where it is larger
# the two curves pass each other, and a step that saw the determinant change sign has leapt from one to the other.
SADDLE_HEIGHT = 1e-9
# Length of a step below which a change of the determinant's sign is reported as a branch point of unknown curves.
UNRESOLVED_LENGTH = 1e-5
# Shares of a step closer than this are one place.
SAME_PLACE = 1e-6
# A direction is a null vector where a matrix shrinks it by this factor more than the matrices at the step's ends do.
NULL_VECTOR_GROWTH = 1e3
# Dimensions of the space in which the largest eigenvalues of a pencil, or null vectors, are looked for.
KRYLOV_DIMENSION, MOST_NULL_VECTORS = 10, 6
# Shares of a step by which matrices are compared on either side of a place where several curves cross.
BOTH_SIDES = (1e-2, 3e-5)
# Radius, in the metric, at which curves through a branch point of several are looked for, for this many null vectors at
# most, and the angle between directions that belong to one curve.
SEARCH_RADIUS, SEARCHES, MOST_SEARCHED, SAME_DIRECTION = 1e-3, 15, 3, 0.05
# Distance from the curve at which the middle of a step's cubic shows a leap to another curve: a share of its length and
# of the angle (at least this) by which it turns.
LEAP_DISTANCE, LEAP_ANGLE = 0.02, 0.2
# Shift off a singular point, as a share of a step: exact zeros have no factors.
SHIFT = 1e-9
# Errors of second derivatives in units of rounding.
CURVATURE_ROUNDINGS = 10.0

Kind = Literal["pitchfork", "transcritical"]


@dataclass(frozen=True, slots=True, eq=False)
class _Saddle:
    """State of the iteration: μ with its gradient and Hessian in (α, β), the directions of α and β, the matrix."""

    back: Direction
    mu: float
    gradient: Array
    hessian: Array
    alpha: Direction
    beta: Direction
    at: Linearisation
    matrix: Bordered


class LeapError(Exception):
    """The step has leapt from one part of the curve to another, or holds more than can be told: a shorter one may."""


def branch_points(segment: Segment, ahead: Bordered | None, options: Options) -> list[tuple[float, BranchPoint]]:
    """Return the branch points of a step, with their places in it, in order.

    The determinant's sign tells an odd number of them from an even one, and the matrices at both ends where they are.

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
        If the step has passed from one curve to another, or if the branch points that the matrices at both ends
        foretell are not those that are found.
    """
    if segment.begin.determinant_sign is None or segment.end.determinant_sign is None:
        return []
    crossed = segment.begin.determinant_sign != segment.end.determinant_sign
    ahead = ahead or _matrix(segment.end, segment)
    if segment.length > UNRESOLVED_LENGTH and _kinked(segment, ahead):
        raise LeapError
    places = _singular(segment, ahead)
    if not places and not crossed:
        return []
    found: list[tuple[float, BranchPoint, int]] = []
    for place in places or [0.5]:
        one = _simple(segment, place) or _multiple(segment, place, options)
        if one is not None and all(abs(one[0] - theta) > SAME_PLACE for theta, _, _ in found):
            found.append(one)
    count = sum(multiplicity for _, _, multiplicity in found)
    if count >= len(places) and count % 2 == crossed:
        return sorted(((theta, event) for theta, event, _ in found), key=lambda one: one[0])
    if not found and not crossed:  # a small eigenvalue is foretold to vanish by less than its matrix bends in the step
        point, _ = point_on(segment, float(np.mean(places)), options)
        if _matrix(point, segment).determinant_sign() == segment.begin.determinant_sign:
            return []
    if segment.length > UNRESOLVED_LENGTH:
        raise LeapError
    return [_within(segment)] if crossed else []


def _kinked(segment: Segment, ahead: Bordered) -> bool:
    """Whether a step turns like two curves that cross, from the one to the other, rather than like one.

    What is left of F in the middle of the cubic tells how far off the curve it is there.
    """
    problem, metric, (x, p) = segment.begin.problem, segment.metric, segment.at(0.5)
    angle = metric.angle(problem, *_tangent(segment.begin, segment), *_tangent(segment.end, segment))
    near = LEAP_DISTANCE * max(angle, LEAP_ANGLE) * segment.length
    off = solve(ahead, residual(problem, x, p), 0.0, p)
    if metric.norm(problem, *off) <= near:
        return False
    # What rounding of F makes of a point where the matrix is soft is no distance from the curve.
    rounding = ROUNDING * residual_terms(linearise(problem, x, p), x, p) * np.cos(1.0 + np.arange(x.size) ** 2 % 7919)
    soft = solve(ahead, rounding, 0.0, p)
    share = metric.dot(problem, *off, *soft) / metric.dot(problem, *soft, *soft)
    return metric.norm(problem, off[0] - share * soft[0], off[1] - share * soft[1]) > near


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
    # Of like sizes in the equations: far beyond a run to infinity the parameter's part of the path is none.
    largest = [float(abs(part).max()) for part in (as_matrix(at.jacobian), at.parameter_derivative)]
    size = min(metric.parameter_scale, metric.state_scale * largest[0] / largest[1] if largest[1] else math.inf)
    units = np.append(np.full(n, metric.state_scale), size)

    def product(v: Array) -> Array:
        image = matrix @ (units * v - (own + other) @ (units * v) * both + 2.0 * (own @ (units * v)) * there)
        return np.asarray(np.append(*ahead.solve(image[:n], float(image[n]))) / units - v)

    projected = _projected(product, n + 1)
    values = np.linalg.eigvals(projected) if np.isfinite(projected).all() else np.zeros(0)
    # Two that are close to each other may look complex.
    return sorted(float(1.0 + 1.0 / v.real) for v in values if v.real <= -1.0 and abs(v.imag) <= 0.5 * abs(v.real))


def _projected(product: Callable[[Array], Array], size: int) -> Array:
    """Return a matrix with the largest eigenvalues of an operator: its projection on a Krylov space (Arnoldi)."""
    count = min(size, KRYLOV_DIMENSION)
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


def _simple(segment: Segment, start: float) -> tuple[float, BranchPoint, int] | None:
    """Locate a branch point at which one other curve crosses; None if there is none.

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
    (theta, event, 1) or None
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
            if size <= 4 * ROUNDING or (stalled and again):
                simple = x.size == 1 or _null_vectors(segment, x, p).shape[1] == 1
                return _report(segment, saddle, x, p, dx, dp) if simple else None
            previous = size
    except (CorrectionError, np.linalg.LinAlgError):
        return None
    return None


def _multiple(segment: Segment, place: float, options: Options) -> tuple[float, BranchPoint, int] | None:
    """Locate a point at which several other curves cross, from the matrices close to it on both sides; None if these
    tell of none."""
    problem, metric = segment.begin.problem, segment.metric
    try:
        for aside in BOTH_SIDES:
            begin, end = (point_on(segment, place + by, options)[0] for by in (-aside, aside))
            piece = Segment(begin, end, metric)
            inside = _singular(piece, _matrix(end, piece))
            if not inside:
                return None
            middle = float(np.mean(inside))
            place += (2.0 * middle - 1.0) * aside
        x, p = piece.at(middle)
        null_vectors = _null_vectors(piece, x, p)
    except CorrectionError:
        return None
    if null_vectors.shape[1] < 2:
        return None
    tangent = metric.unit(problem, *piece.direction(middle))
    point = Point(problem, x, p, *tangent, label="branch point")
    error = aside * (aside + max(inside) - min(inside)) * segment.length
    scales = (metric.state_scale, metric.parameter_scale)
    tangents = _crossing(segment, point, null_vectors, options)
    event = BranchPoint(point, error * scales[1], error * scales[0], tangents=tangents, scales=scales)
    return place, event, null_vectors.shape[1]


def _null_vectors(segment: Segment, x: Array, p: float) -> Array:
    """Return the null vectors of [J Fp] at a point of a segment, but for the tangent, in units of the scales; (n+1, m).

    They are what the inverse of the matrix bordered by the tangent enlarges there, but not at the ends of the segment.
    """
    problem, metric, n = segment.begin.problem, segment.metric, x.size
    units = np.append(np.full(n, metric.state_scale), metric.parameter_scale)
    row = metric.row(problem, *metric.unit(problem, *segment.chord))
    count = min(n + 1, MOST_NULL_VECTORS)
    loads = np.cos(1.0 + np.arange((n + 1) * count) ** 2 % 7919).reshape(count, n + 1)
    beside = x + SHIFT * segment.chord[0], p + SHIFT * segment.chord[1]
    ends = [(point.x, point.parameter) for point in (segment.begin, segment.end)]
    enlarged = []
    for there, q in (*ends, beside):
        matrix = border(problem, there, q, linearise(problem, there, q), row)
        images = [np.append(*solve(matrix, load[:n], float(load[n]), q)) / units for load in loads]
        vectors, sizes, _ = np.linalg.svd(np.array(images).T, full_matrices=False)
        enlarged.append(sizes)
    return np.asarray(vectors[:, enlarged[2] > NULL_VECTOR_GROWTH * np.maximum(enlarged[0], enlarged[1])])


def _crossing(segment: Segment, here: Point, null_vectors: Array, options: Options) -> tuple[Direction, ...]:
    """Return the directions of the curves through a branch point, the followed one's first, by solutions close by.

    From combinations of the tangent and the null vectors Newton's method leads to points of the curves.
    """
    problem, metric, n = here.problem, segment.metric, here.x.size
    units = np.append(np.full(n, metric.state_scale), metric.parameter_scale)
    found = [(here.tangent_x, here.tangent_parameter)]
    count, patient = null_vectors.shape[1], replace(options, patience=CORRECTIONS)
    basis = [metric.unit(problem, v[:n], float(v[n])) for v in (units[:, None] * null_vectors).T]
    starts = np.random.default_rng(0).standard_normal((SEARCHES * count**2, count + 1))
    for shares in starts if count <= MOST_SEARCHED else ():
        parts = list(zip(shares, [found[0], *basis], strict=True))
        u, a = metric.unit(
            problem, sum(share * v for share, (v, _) in parts), sum(share * b for share, (_, b) in parts)
        )
        near = here.x + SEARCH_RADIUS * u, here.parameter + SEARCH_RADIUS * a
        try:
            point, _ = corrected_point(problem, near, (u, a), metric, patient)
        except CorrectionError:
            continue
        v, b = metric.unit(problem, point.x - here.x, point.parameter - here.parameter)
        cosines = [abs(metric.dot(problem, v, b, *one)) for one in found]
        if metric.dot(problem, u, a, v, b) > 0.5 and max(cosines) < math.cos(SAME_DIRECTION):
            found.append((v, b))
    return tuple(found)


def _within(segment: Segment) -> tuple[float, BranchPoint]:
    """Return the middle of a step across which the determinant changes its sign, its lengths being the errors."""
    x, p = segment.at(0.5)
    problem = segment.begin.problem
    tangent = segment.metric.unit(problem, *segment.direction(0.5))
    point = Point(problem, x, p, *tangent, label="branch point")
    state_error = size_of(problem, segment.end.x - segment.begin.x)
    return 0.5, BranchPoint(
        point, abs(segment.end.parameter - segment.begin.parameter), state_error, tangents=(tangent,)
    )


def _reduction(segment: Segment, theta: float) -> tuple[Direction, Array, Array]:
    """Return the row t, and the null vectors l (n) and r (as a row, n+1) of the matrix interpolated at θ.

    Inverse iteration at either end would find what is smallest there, which depends on units: this one is singular.
    """
    problem, metric = segment.begin.problem, segment.metric
    row = metric.row(problem, *metric.unit(problem, *segment.chord))
    n, rest = row[0].size, SHIFT * (1.0 - theta)  # beside it: exact zeros have no factors
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

    if differenced(problem):
        mu_alpha, mu_beta = slope(alpha, mu_alpha), slope(beta, mu_beta)

    def bend(direction: Direction) -> float:
        d = second_derivative(problem, x, p, direction, metric, at[0])
        return solved(-d, 0.0, 0.0)[1]

    aa, bb = bend(alpha), bend(beta)
    # The directions differ in length by far: scaling one brings both to bear on the mixed derivative.
    scale = metric.norm(problem, *alpha) / metric.norm(problem, *beta)
    both = (alpha[0] + scale * beta[0], alpha[1] + scale * beta[1])
    ab = (bend(both) - aa - scale**2 * bb) / (2 * scale)
    hessian = np.array([[aa, ab], [ab, bb]])
    return _Saddle(back, mu, np.array([mu_alpha, mu_beta]), hessian, alpha, beta, at, matrix)


def _derivative(problem: Problem, x: Array, p: float, along: Direction, metric: Metric) -> Array:
    """Return the derivative of F along a direction, by differences of fourth order."""
    u, a = along
    step = ROUNDING**0.2 / metric.norm(problem, u, a)
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


def _report(
    segment: Segment, saddle: _Saddle, x: Array, p: float, dx: Array, dp: float
) -> tuple[float, BranchPoint, int] | None:
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
    if not discriminant > 0 or abs(saddle.mu) > size * max(SADDLE_HEIGHT * segment.length**2, 1e3 * ROUNDING):
        return None
    along, other = _directions(segment, saddle, form, units, theta)
    point = Point(problem, x, p, along[0], along[1], label="branch point")
    rough = ROUNDING**0.8 if differenced(problem) else ROUNDING  # of differences of fourth order
    error = 4 * (abs(float(dp)) + ROUNDING * abs(p) + rough * metric.parameter_scale)
    state_error = 4 * (size_of(problem, dx) + ROUNDING * size_of(problem, x) + rough * metric.state_scale)
    scales = (metric.state_scale, metric.parameter_scale)
    type_ = _type(segment, saddle, x, p)
    return theta, BranchPoint(point, error, state_error, type=type_, tangents=(along, other), scales=scales), 1


def _type(segment: Segment, saddle: _Saddle, x: Array, p: float) -> Kind:
    """Tell whether one of the two curves is at an extremum of the parameter, by the normal form a p z + b z² + c z³.

    b is ψᵀ F_xx φ φ with the null vectors ψ and φ of J at constant p. It is zero where it is no larger than its error:
    rounding of F in a second difference, and of ψ.
    """
    problem, metric, n = segment.begin.problem, segment.metric, x.size
    (u, a), (v, b) = saddle.alpha, saddle.beta
    phi = b * u - a * v
    phi = phi / metric.norm(problem, phi, 0.0)
    d = second_derivative(problem, x, p, (phi, 0.0), metric, residual(problem, x, p))
    transposed = saddle.matrix.solve_transposed(np.zeros(n + 1), 1.0)
    psi = np.zeros(n) if transposed is None else transposed[0][:n]
    step, states = ROUNDING**0.25, np.full(n, metric.state_scale)
    ends = (linearise(problem, point.x, point.parameter) for point in (segment.begin, segment.end))
    rows = sum(residual_terms(at, states, metric.parameter_scale) for at in ends)
    inexact = 1e2 * jacobian_rounding(problem)
    error = 4.0 * ROUNDING / step**2 * float(np.abs(psi) @ residual_terms(saddle.at, np.abs(x) + step * np.abs(phi), p))
    error += inexact * float(np.linalg.norm(psi * rows) * np.linalg.norm(d / np.where(rows > 0.0, rows, 1.0)))
    return "pitchfork" if abs(float(psi @ d)) <= CURVATURE_ROUNDINGS * error else "transcritical"


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
