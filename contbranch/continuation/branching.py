"""Branch points: where other curves cross the one that is followed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from contbranch.continuation.bordered import Bordered, SingularBorderedError, bordered_matrix, factorise
from contbranch.continuation.curve import BranchPoint, Outcome, Point
from contbranch.continuation.folds import SECOND_DIFFERENCE_STEP, second_derivative
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

# μ at a branch point over its change along the step. A true branch point has rounding there; where it is larger, the
# curves pass each other at a distance.
SADDLE_HEIGHT = 1e-9
# Vectors in a block of the Krylov space, which is the largest multiplicity found, and the dimension of the space.
BLOCK, KRYLOV_DIMENSION = 6, 18
# Shares of the step on either side of a foretold place between which it is foretold again.
CLOSER = (0.1, 0.01)
# Shares of a step closer than this are one place.
SAME_PLACE = 1e-6
# Radius, in the metric, at which curves through a multiple branch point are looked for, the number of starts for each
# pair of null vectors, the most null vectors, and the angle between directions that belong to one curve.
SEARCH_RADIUS, SEARCHES, MOST_SEARCHED, SAME_DIRECTION = 1e-3, 15, 3, 0.05
# Distance from the curve, as a share of the step's length, at which the middle of its cubic shows a leap.
LEAP_DISTANCE = 0.004
# Size of a correction, in the metric, from which on those that do not contract are rounding.
ROUGHLY = 1e-7
# Errors of second derivatives in units of rounding.
CURVATURE_ERRORS = 100.0


class LeapError(Exception):
    """The step has leapt to another part of the curve, or its branch points are not clear: a shorter one may be."""


class _Reduced(NamedTuple):
    """Lyapunov-Schmidt reduction at a point, with m null vectors; see `_located`."""

    matrix: Bordered
    at: Linearisation
    back: Array  # (n+1,)
    directions: list[Array]  # m + 1 of (n+1,), of unit length
    mu: Array  # (m,)
    gradient: Array  # (m+1, m)
    hessian: Array  # (m+1, m+1, m)


def branch_points(segment: Segment, ahead: Bordered | None, options: Options) -> list[tuple[float, BranchPoint]]:
    """Return the branch points of a step, with their places in it, in order.

    The determinant's sign tells an odd number of them from an even one, and the matrices at both ends where they are.

    Parameters
    ----------
    segment : Segment
        The step.
    ahead : Bordered, optional
        The matrix at its end, bordered by the tangent at its begin; otherwise it is factorised.
    options : Options
        Tolerances.

    Raises
    ------
    LeapError
        If the step has passed from one curve to another, or if the branch points that the matrices at both ends
        foretell are not those that are found.
    """
    problem, metric, begin, end = segment.begin.problem, segment.metric, segment.begin, segment.end
    if begin.determinant_sign is None or end.determinant_sign is None:
        return []
    row = metric.row(problem, *metric.unit(problem, begin.tangent_x, begin.tangent_parameter))
    first = linearise(problem, begin.x, begin.parameter)
    last = ahead or border(problem, end.x, end.parameter, linearise(problem, end.x, end.parameter), row)
    if _leaps(segment, last):
        raise LeapError
    crossed = begin.determinant_sign != end.determinant_sign
    found: list[tuple[float, BranchPoint, int]] = []
    places = _singular(bordered_matrix(first[1], first[2], *row), last, metric)[0]
    for place in places:
        near = _closer(segment, place, row)
        one = None if near is None else _located(segment, near, row, options)
        if one is not None and all(abs(one[0] - theta) > SAME_PLACE for theta, _, _ in found):
            found.append(one)
    count = sum(multiplicity for _, _, multiplicity in found)
    if count < len(places) or count % 2 != crossed:
        if found or crossed:
            raise LeapError
        # A small eigenvalue may be foretold to vanish by less than the matrix bends in the step.
        between = point_on(segment, float(np.mean(places)), options)[1]
        if between.determinant_sign() != begin.determinant_sign:
            raise LeapError
    return sorted(((theta, event) for theta, event, _ in found), key=lambda one: one[0])


def _leaps(segment: Segment, last: Bordered) -> bool:
    """Whether the middle of a step's cubic is far off the curve, as where it leads from one curve to another."""
    problem, metric, (x, p) = segment.begin.problem, segment.metric, segment.at(0.5)
    near = LEAP_DISTANCE * segment.length
    off = solve(last, residual(problem, x, p), 0.0, p)
    if metric.norm(problem, *off) <= near:
        return False
    # What rounding of F makes of a point where the matrix is soft is no distance from the curve.
    rounding = ROUNDING * residual_terms(linearise(problem, x, p), x, p) * _arbitrary(x.size, 1)[:, 0]
    soft = solve(last, rounding, 0.0, p)
    share = metric.dot(problem, *off, *soft) / metric.dot(problem, *soft, *soft)
    return metric.norm(problem, off[0] - share * soft[0], off[1] - share * soft[1]) > near


def _arbitrary(n: int, count: int) -> Array:
    return np.random.default_rng(0).standard_normal((n, count))


def _singular(first: Any, last: Bordered, metric: Metric) -> tuple[list[float], Array]:
    """Return the places θ at which [J Fp; t] is singular if it changes linearly, and its null vectors there, (n+1, m).

    With M(θ) = M₁ + (1 − θ) (M₀ − M₁), det M(θ) = 0 where −1/(1 − θ) is an eigenvalue of B = M₁⁻¹ M₀ − 1: one of −1 or
    less. Those are found by projection on a block Krylov space.
    """
    size = first.shape[0]
    # Of like sizes in the equations: far along a run to infinity the path has no part along the parameter.
    jacobian, slope = (float(abs(part).max()) for part in (first[:-1, :-1], first[:-1, [-1]]))
    largest = metric.state_scale * jacobian / slope if slope else math.inf
    units = np.append(np.full(size - 1, metric.state_scale), min(metric.parameter_scale, largest))[:, None]
    vectors, images = _arbitrary(size, min(BLOCK, size)), np.empty((size, 0))
    while images.shape[1] < min(KRYLOV_DIMENSION, size):
        basis = np.linalg.qr(vectors)[0]
        fresh = basis[:, images.shape[1] :]
        solved = [np.append(*solve(last, load[:-1], float(load[-1]), math.nan)) for load in (first @ (units * fresh)).T]
        images = np.hstack([images, np.array(solved).T / units - fresh])
        vectors = np.hstack([vectors, images[:, -fresh.shape[1] :]])
    projected = basis.T @ images
    values = np.linalg.eigvals(projected)
    # Two that are close to each other may look complex.
    places = sorted(float(1.0 + 1.0 / v.real) for v in values if v.real <= -1.0 and abs(v.imag) <= 0.5 * abs(v.real))
    if not places:
        return places, np.empty((size, 0))
    at_mean = np.eye(len(projected)) + (1.0 - np.mean(places)) * projected
    return places, units * (basis @ np.linalg.svd(at_mean)[2][-len(places) :].T)


class _Near(NamedTuple):
    """A place at which the matrix is singular, with null vectors from the left (m, n) and, as rows, right (m, n+1)."""

    place: float
    left: Array
    right: Array


def _closer(segment: Segment, place: float, row: Direction) -> _Near | None:
    """Return a foretold place as foretold from matrices close to it; None if these foretell none."""
    problem, metric = segment.begin.problem, segment.metric
    for aside in CLOSER:
        (x, p), (y, q) = segment.at(place - aside), segment.at(place + aside)
        first, end = linearise(problem, x, p), linearise(problem, y, q)
        last = border(problem, y, q, end, row)
        inside, null_vectors = _singular(bordered_matrix(first[1], first[2], *row), last, metric)
        if not inside:
            return None
        place += (2.0 * min(inside, key=lambda theta: abs(theta - 0.5)) - 1.0) * aside
    right = [np.append(*metric.row(problem, *metric.unit(problem, v[:-1], float(v[-1])))) for v in null_vectors.T]
    left = np.array([last.solve_transposed(v[:-1], float(v[-1]))[0] for v in right])
    return _Near(place, left / np.linalg.norm(left, axis=1, keepdims=True), np.array(right))


def _located(segment: Segment, near: _Near, row: Direction, options: Options) -> tuple[float, BranchPoint, int] | None:
    """Locate a branch point from the place at which it is foretold; None if there is none.

    Near a branch point the matrix [J Fp; tᵀ] is singular, but with its m left and right null vectors L and R

        [ J   Fp   L ] [ y' ]   [ 0 ]     [ 0 ]
        [ t        0 ] [    ] = [ 1 ]  or [ 0 ]
        [ R        0 ] [ μ' ]   [ 0 ]     [ 1 ]

    is regular. It parametrises a surface y(α, β) on which F(y) + L μ = 0, with α counted along t and β along R
    (Lyapunov-Schmidt reduction). The curves are the lines μ = 0, and at a branch point all slopes of μ vanish:
    the Gauss-Newton method solves ∇μ = 0, with the Hessian from second derivatives of F. (W. Govaerts, Numerical
    Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 6.)

    Returns
    -------
    (theta, event, m) or None
        Position within the segment, the branch point and its multiplicity.
    """
    problem, metric, m = segment.begin.problem, segment.metric, len(near.left)
    y, size, stalled = np.append(*segment.at(near.place)), math.inf, 0
    try:
        for _ in range(CORRECTIONS):
            reduced = _reduced(problem, y, metric, row, near)
            slopes = reduced.gradient.ravel()
            step = np.linalg.lstsq(np.moveaxis(reduced.hessian, 1, 2).reshape(-1, m + 1), -slopes)[0]
            change = reduced.back + step @ reduced.directions
            previous, size = size, metric.norm(problem, change[:-1], float(change[-1]))
            if not size <= 2 * segment.length:
                return None
            y = y + change
            # Once, a correction back onto the curve may be as large as the one before along it.
            stalled += 0.5 * previous < size < ROUGHLY
            if size <= 4 * ROUNDING or stalled == 2:
                break
    except (CorrectionError, np.linalg.LinAlgError):
        return None
    x, p = y[:-1], float(y[-1])
    theta = segment.position(x, p)
    near_x, near_p = segment.at(min(max(theta, 0.0), 1.0))
    if not (size < ROUGHLY and -0.05 <= theta <= 1.05):
        return None
    if metric.norm(problem, x - near_x, p - near_p) > 0.2 * segment.length:
        return None
    curvature = float(np.abs(reduced.hessian).max())
    height = max(SADDLE_HEIGHT * segment.length**2, 1e3 * ROUNDING)
    spread = float(np.abs(slopes + np.moveaxis(reduced.hessian, 1, 2).reshape(-1, m + 1) @ step).max()) / curvature
    if np.abs(reduced.mu).max() > curvature * height or spread > math.sqrt(height):
        return None
    along = metric.unit(problem, *segment.direction(min(max(theta, 0.0), 1.0)))
    type_: Literal["pitchfork", "transcritical", "branch point"] = "branch point"
    if m == 1:
        values, vectors = np.linalg.eigh(reduced.hessian[:, :, 0])
        if not values[0] < 0.0 < values[1]:
            return None
        tangents = _directions(segment, reduced, along)
        type_ = _type(segment, reduced, y)
    else:
        tangents = _search(Point(problem, x, p, *along), near, reduced, metric, options)
    point = Point(problem, x, p, *tangents[0], label="branch point")
    rough = ROUNDING**0.8 if differenced(problem) else ROUNDING  # of differences of fourth order
    rough += spread
    error = 4 * (abs(float(change[-1])) + ROUNDING * abs(p) + rough * metric.parameter_scale)
    state_error = 4 * (size_of(problem, change[:-1]) + ROUNDING * size_of(problem, x) + rough * metric.state_scale)
    scales = (metric.state_scale, metric.parameter_scale)
    return theta, BranchPoint(point, error, state_error, type=type_, tangents=tangents, scales=scales), m


def _reduced(problem: Problem, y: Array, metric: Metric, row: Direction, near: _Near) -> _Reduced:
    """Return μ with its derivatives at y = (x, p), in directions of unit length."""
    x, p, n, m = y[:-1], float(y[-1]), y.size - 1, len(near.left)
    at = linearise(problem, x, p)
    matrix = bordered_matrix(at[1], at[2], *row)
    # μ belongs to F alone: the row t stays exact, so that α is a coordinate.
    for k in range(m - 1):
        matrix = bordered_matrix(
            matrix, np.append(near.left[k], np.zeros(1 + k)), np.append(near.right[k], np.zeros(k)), 0.0
        )
    try:
        bordered = factorise(matrix, np.append(near.left[-1], np.zeros(m)), np.append(near.right[-1], np.zeros(m - 1)), 0.0)
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error

    def solved(f: Array, shares: Array) -> tuple[Array, Array]:
        load = np.append(f, shares)
        z = np.append(*solve(bordered, load[:-1], float(load[-1]), p))
        return z[: n + 1], z[n + 1 :]

    def bend(direction: Array) -> Array:
        d = second_derivative(problem, x, p, (direction[:-1], float(direction[-1])), metric, at[0])
        return solved(-d, np.zeros(m + 1))[1]

    back, mu = solved(-at[0], np.zeros(m + 1))
    directions, gradient = [], []
    for unit in np.eye(m + 1):
        direction, slope = solved(np.zeros(n), unit)
        size = metric.norm(problem, direction[:-1], float(direction[-1]))
        direction, slope = direction / size, slope / size
        if differenced(problem):  # free from the errors of a matrix of differences
            rate = _derivative(problem, x, p, direction)
            slope = slope + solved(-rate - slope @ near.left, np.zeros(m + 1))[1]
        directions.append(direction)
        gradient.append(slope)
    own = [bend(direction) for direction in directions]
    hessian = np.empty((m + 1, m + 1, m))
    for i in range(m + 1):
        for j in range(i + 1):
            both = own[i] if i == j else (bend(directions[i] + directions[j]) - own[i] - own[j]) / 2
            hessian[i, j] = hessian[j, i] = both
    return _Reduced(bordered, at, back, directions, mu, np.array(gradient), hessian)


def _derivative(problem: Problem, x: Array, p: float, along: Array) -> Array:
    """Return the derivative of F along a direction of unit length, by differences of fourth order."""
    u, a, step = along[:-1], float(along[-1]), ROUNDING**0.2
    near, far = (
        (residual(problem, x + s * u, p + s * a) - residual(problem, x - s * u, p - s * a)) / (2 * s)
        for s in (step, 2 * step)
    )
    return np.asarray((4 * near - far) / 3)


def _directions(segment: Segment, reduced: _Reduced, followed: Direction) -> tuple[Direction, Direction]:
    """Return the unit directions in which the quadratic form of μ vanishes, that of the curve followed first."""
    problem, metric = segment.begin.problem, segment.metric
    values, vectors = np.linalg.eigh(reduced.hessian[:, :, 0])
    slope = math.sqrt(-values[0] / values[1])
    candidates = []
    for sign in (1.0, -1.0):
        direction = (vectors[:, 0] + sign * slope * vectors[:, 1]) @ reduced.directions
        u, a = metric.unit(problem, direction[:-1], float(direction[-1]))
        along = metric.dot(problem, u, a, *followed)
        factor = math.copysign(1.0, along)
        candidates.append((abs(along), (u * factor, a * factor)))
    candidates.sort(key=lambda candidate: candidate[0], reverse=True)
    return candidates[0][1], candidates[1][1]


def _type(segment: Segment, reduced: _Reduced, y: Array) -> Literal["pitchfork", "transcritical"]:
    """Tell whether one of the two curves is at an extremum of the parameter, by the normal form a p z + b z² + c z³.

    b is ψᵀ F_xx φ φ with the null vectors ψ and φ of J at constant p. It is zero where it is no larger than its error:
    rounding of F in a second difference, and of ψ.
    """
    problem, metric, x, p = segment.begin.problem, segment.metric, y[:-1], float(y[-1])
    alpha, beta = reduced.directions
    phi = beta[-1] * alpha[:-1] - alpha[-1] * beta[:-1]
    phi = phi / metric.norm(problem, phi, 0.0)
    d = second_derivative(problem, x, p, (phi, 0.0), metric, reduced.at.residual)
    transposed = reduced.matrix.solve_transposed(np.zeros(y.size), 1.0)
    psi = np.zeros(x.size) if transposed is None else transposed[0][: x.size]
    states = np.abs(x) + SECOND_DIFFERENCE_STEP * np.abs(phi)
    error = ROUNDING / SECOND_DIFFERENCE_STEP**2 * float(np.abs(psi) @ residual_terms(reduced.at, states, p))
    begin = linearise(problem, segment.begin.x, segment.begin.parameter)
    rows = residual_terms(begin, np.full(x.size, metric.state_scale), metric.parameter_scale)
    rows[rows == 0.0] = 1.0
    error += jacobian_rounding(problem) * float(np.linalg.norm(psi * rows) * np.linalg.norm(d / rows))
    return "pitchfork" if abs(float(psi @ d)) <= CURVATURE_ERRORS * error else "transcritical"


def _search(
    here: Point, near: _Near, reduced: _Reduced, metric: Metric, options: Options
) -> tuple[Direction, ...]:
    """Return the directions of the curves through a multiple branch point, the followed one's first.

    From combinations of the tangent and the null vectors Newton's method leads to points of the curves close by.
    """
    problem = here.problem
    found = [(here.tangent_x, here.tangent_parameter)]
    count, patient = len(reduced.directions), replace(options, patience=CORRECTIONS)
    starts = np.random.default_rng(0).standard_normal((SEARCHES * (count - 1) ** 2, count))
    for shares in starts if count - 1 <= MOST_SEARCHED else ():
        direction = shares @ reduced.directions
        u, a = metric.unit(problem, direction[:-1], float(direction[-1]))
        beside = here.x + SEARCH_RADIUS * u, here.parameter + SEARCH_RADIUS * a
        try:
            point, _ = corrected_point(problem, beside, (u, a), metric, patient)
        except CorrectionError:
            continue
        v, b = metric.unit(problem, point.x - here.x, point.parameter - here.parameter)
        cosines = [abs(metric.dot(problem, v, b, *one)) for one in found]
        if metric.dot(problem, u, a, v, b) > 0.5 and max(cosines) < math.cos(SAME_DIRECTION):
            found.append((v, b))
    return tuple(found)
