"""Branch points: where other curves cross the one that is followed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from contbranch.continuation.bordered import Bordered, SingularBorderedError, bordered_matrix, factorise
from contbranch.continuation.curve import BranchPoint, Outcome, Point
from contbranch.continuation.events import UNSIGNED
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
# Vectors in a block of a Krylov space: the largest multiplicity that is found.
BLOCK_SIZE = 6
# Share of the step on either side of a foretold place between which it is foretold once more, and then by its square.
PREDICTION_HALF_WIDTH = 0.1
# Places within a step, as shares of it, that agree to so many decimals are one.
PLACE_DECIMALS = 6
# Size of a correction, in the metric, from which on those that do not contract are rounding.
STALLED_CORRECTION = 1e-7
# Radius, in the metric, at which curves through a multiple branch point are looked for, the number of starts for each
# pair of null vectors, and the most null vectors.
SEARCH_RADIUS, SEARCHES, MOST_SEARCHED = 1e-3, 15, 3
# Distance from the curve, as a share of the step's length, at which the middle of its cubic shows a leap.
LEAP_DISTANCE = 0.002

Kind = Literal["pitchfork", "transcritical", "branch point"]


class LeapError(Exception):
    """The step has leapt to another part of the curve, or what happens in it is not clear: a shorter one may be.

    Parameters
    ----------
    to_corner : bool
        Whether the curve is to be followed to its next corner instead, see `Problem.corner`.
    """

    def __init__(self, to_corner: bool = False) -> None:
        super().__init__()
        self.to_corner = to_corner


class _Near(NamedTuple):
    """A place at which the matrix is singular, with m null vectors: left (m, n), and right as rows (m, n+1)."""

    place: float
    left: Array
    right: Array


class _Reduced(NamedTuple):
    """Lyapunov-Schmidt reduction at a point, with m null vectors; see `_located`."""

    matrix: Bordered
    at: Linearisation
    back: Array  # (n+1,)
    directions: Array  # (m+1, n+1), of unit length
    mu: Array  # (m,)
    gradient: Array  # (m, m+1)
    hessian: Array  # (m, m+1, m+1)


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
    ahead = ahead or _bordered(problem, (end.x, end.parameter), row)
    if _leaps(segment, ahead):
        raise LeapError
    places, _ = _singular(problem, (begin.x, begin.parameter), ahead, row, metric)
    closer = (_closer(segment, place, row) for place in places)
    near = {round(one.place, PLACE_DECIMALS): one for one in closer if one is not None}
    located = (_located(segment, one, row, options) for one in near.values())
    found = {round(one[0], PLACE_DECIMALS): one for one in located if one is not None}
    count = sum(multiplicity for _, _, multiplicity in found.values())
    crossed = begin.determinant_sign != end.determinant_sign
    if count < len(places) or count % 2 != crossed:
        if found or crossed:
            raise LeapError
        # A small eigenvalue may be foretold to vanish by less than the matrix bends in the step.
        between = point_on(segment, float(np.mean(places)), options)[1]
        if between.determinant_sign() != begin.determinant_sign:
            raise LeapError
    return [found[place][:2] for place in sorted(found)]


def _leaps(segment: Segment, ahead: Bordered) -> bool:
    """Whether the middle of a step's cubic is far off the curve, as where it leads from one curve to another."""
    problem, metric, (x, p) = segment.begin.problem, segment.metric, segment.at(0.5)
    near = LEAP_DISTANCE * segment.length
    off = solve(ahead, residual(problem, x, p), 0.0, p)
    if metric.norm(problem, *off) <= near:
        return False
    # Along a direction in which rounding of F costs a point half its digits, the solution tells no distance.
    noise = np.random.default_rng(0).standard_normal(x.size)
    rounding = ROUNDING * residual_terms(linearise(problem, x, p), x, p) * noise
    soft = solve(ahead, rounding, 0.0, p)
    if metric.norm(problem, *soft) <= math.sqrt(ROUNDING) * segment.length:
        return True
    share = metric.dot(problem, *off, *soft) / metric.dot(problem, *soft, *soft)
    return metric.norm(problem, off[0] - share * soft[0], off[1] - share * soft[1]) > near


def _bordered(problem: Problem, at: Direction, row: Direction) -> Bordered:
    return border(problem, *at, linearise(problem, *at), row)


def _singular(
    problem: Problem, at: Direction, ahead: Bordered, row: Direction, metric: Metric
) -> tuple[list[float], Array]:
    """Return the places θ at which [J Fp; t] is singular if it changes linearly, and its null vectors there, (n+1, m).

    With M(θ) = M₁ + (1 − θ) (M₀ − M₁), det M(θ) = 0 where −1/(1 − θ) is an eigenvalue of B = M₁⁻¹ M₀ − 1: one of −1 or
    less. Those are found by projection on a block Krylov space.
    """
    _, jacobian, slope = linearise(problem, *at)
    matrix, size = bordered_matrix(jacobian, slope, *row), slope.size + 1
    # Of like sizes in the equations: far along a run to infinity the path has no part along the parameter.
    sizes = [float(abs(part).max()) for part in (matrix[:-1, :-1], slope)]
    longest = metric.state_scale * sizes[0] / sizes[1] if min(sizes) > 0.0 else math.inf
    units = np.append(np.full(size - 1, metric.state_scale), min(metric.parameter_scale, longest))[:, None]
    vectors, images = np.random.default_rng(0).standard_normal((size, min(BLOCK_SIZE, size))), np.empty((size, 0))
    while images.shape[1] < min(3 * BLOCK_SIZE, size):
        basis = np.linalg.qr(vectors)[0]
        fresh = basis[:, images.shape[1] :]
        solved = [np.append(*solve(ahead, load[:-1], float(load[-1]), at[1])) for load in (matrix @ (units * fresh)).T]
        fresh = np.array(solved).T / units - fresh
        images, vectors = np.hstack([images, fresh]), np.hstack([vectors, fresh])
    projected = basis.T @ images
    values = np.linalg.eigvals(projected) if np.isfinite(projected).all() else np.empty(0)
    # Two that are close to each other may look complex.
    places = sorted(float(1.0 + 1.0 / v.real) for v in values if v.real <= -1.0 and abs(v.imag) <= 0.5 * abs(v.real))
    if not places:
        return places, np.empty((size, 0))
    between = np.eye(len(values)) + (1.0 - np.mean(places)) * projected
    return places, units * (basis @ np.linalg.svd(between)[2][-len(places) :].T)


def _closer(segment: Segment, place: float, row: Direction) -> _Near | None:
    """Return a foretold place as foretold from matrices close to it; None if these foretell none."""
    problem, metric = segment.begin.problem, segment.metric
    for aside in (PREDICTION_HALF_WIDTH, PREDICTION_HALF_WIDTH**2):
        ahead = _bordered(problem, segment.at(place + aside), row)
        inside, null_vectors = _singular(problem, segment.at(place - aside), ahead, row, metric)
        if not inside:
            return None
        place += (2.0 * min(inside, key=lambda theta: abs(theta - 0.5)) - 1.0) * aside
    right = [np.append(*metric.row(problem, *metric.unit(problem, *_pair(v)))) for v in null_vectors.T]
    left = np.array([solved[0] for v in right if (solved := ahead.solve_transposed(*_pair(v))) is not None])
    return _Near(place, left / np.linalg.norm(left, axis=1, keepdims=True), np.array(right))


def _pair(y: Array) -> Direction:
    return y[:-1], float(y[-1])


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
            slopes, rates = reduced.gradient.ravel(), reduced.hessian.reshape(-1, m + 1)
            step = np.linalg.lstsq(rates, -slopes)[0]
            change = reduced.back + step @ reduced.directions
            previous, size = size, metric.norm(problem, *_pair(change))
            if not size <= 2 * segment.length:
                return None
            y = y + change
            # Once, a correction back onto the curve may be as large as the one before along it.
            stalled += 0.5 * previous < size < STALLED_CORRECTION
            if size <= 4 * ROUNDING or stalled == 2:
                break
    except (CorrectionError, np.linalg.LinAlgError):
        return None
    x, p = _pair(y)
    theta = segment.position(x, p)
    # Where several branch points lie close to each other the slopes do not vanish in one place.
    curvature = float(np.abs(rates).max()) or math.nan
    height, spread = float(np.abs(reduced.mu).max()) / curvature, float(np.abs(slopes + rates @ step).max()) / curvature
    highest = max(SADDLE_HEIGHT * segment.length**2, 1e3 * ROUNDING)
    if not (
        size < STALLED_CORRECTION and -0.05 <= theta <= 1.05 and height <= highest and spread <= math.sqrt(highest)
    ):
        return None
    along = metric.unit(problem, *segment.direction(min(max(theta, 0.0), 1.0)))
    point = Point(problem, x, p, *along, label="branch point")
    kind: Kind
    if m > 1:
        tangents, kind = _search(point, reduced, metric, options), "branch point"
    elif np.linalg.det(reduced.hessian[0]) < 0.0:
        tangents, kind = _directions(point, reduced, metric), _type(segment, reduced, y)
    else:
        return None
    point = replace(point, tangent_x=tangents[0][0], tangent_parameter=tangents[0][1])
    rough = (ROUNDING**0.8 if differenced(problem) else ROUNDING) + spread  # of differences of fourth order
    error = 4 * (abs(change[-1]) + ROUNDING * abs(p) + rough * metric.parameter_scale)
    state_error = 4 * (size_of(problem, change[:-1]) + ROUNDING * size_of(problem, x) + rough * metric.state_scale)
    scales = (metric.state_scale, metric.parameter_scale)
    return theta, BranchPoint(point, error, state_error, type=kind, tangents=tangents, scales=scales), m


def _reduced(problem: Problem, y: Array, metric: Metric, row: Direction, near: _Near) -> _Reduced:
    """Return μ with its derivatives at y = (x, p), in directions of unit length."""
    (x, p), m = _pair(y), len(near.left)
    at, nothing = linearise(problem, x, p), np.zeros(m + 1)
    matrix = bordered_matrix(at[1], at[2], *row)
    # μ belongs to F alone: the row t stays exact, so that α is a coordinate.
    left, right = (np.pad(vectors, ((0, 0), (0, m + 1))) for vectors in (near.left, near.right))
    for k in range(m - 1):
        matrix = bordered_matrix(matrix, left[k, : y.size + k], right[k, : y.size + k], 0.0)
    try:
        bordered = factorise(matrix, left[-1, : y.size + m - 1], right[-1, : y.size + m - 1], 0.0)
    except SingularBorderedError as error:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, f"({error})") from error

    def solved(f: Array, shares: Array = nothing) -> tuple[Array, Array]:
        z = np.append(*solve(bordered, *_pair(np.append(f, shares)), p))
        return z[: y.size], z[y.size :]

    def bend(direction: Array) -> Array:
        return solved(-second_derivative(problem, x, p, _pair(direction), metric, at[0]))[1]

    back, mu = solved(-at[0])
    directions, gradient = [], []
    for unit in np.eye(m + 1):
        direction, slope = solved(np.zeros(x.size), unit)
        size = metric.norm(problem, *_pair(direction))
        direction, slope = direction / size, slope / size
        if differenced(problem):  # free from the errors of a matrix of differences
            slope = slope + solved(-_derivative(problem, x, p, direction) - slope @ near.left)[1]
        directions.append(direction)
        gradient.append(slope)
    hessian = np.empty((m, m + 1, m + 1))
    for i, u in enumerate(directions):
        hessian[:, i, i] = bend(u)
        for j, v in enumerate(directions[:i]):
            hessian[:, i, j] = hessian[:, j, i] = (bend(u + v) - hessian[:, i, i] - hessian[:, j, j]) / 2
    return _Reduced(bordered, at, back, np.array(directions), mu, np.array(gradient).T, hessian)


def _derivative(problem: Problem, x: Array, p: float, along: Array) -> Array:
    """Return the derivative of F along a direction of unit length, by differences of fourth order."""
    u, a, step = along[:-1], float(along[-1]), ROUNDING**0.2
    near, far = (
        (residual(problem, x + s * u, p + s * a) - residual(problem, x - s * u, p - s * a)) / (2 * s)
        for s in (step, 2 * step)
    )
    return np.asarray((4 * near - far) / 3)


def _directions(here: Point, reduced: _Reduced, metric: Metric) -> tuple[Direction, ...]:
    """Return the unit directions in which the quadratic form of μ vanishes, that of the curve followed first."""
    values, vectors = np.linalg.eigh(reduced.hessian[0])
    found = []
    for sign in (1.0, -1.0):
        shares = math.sqrt(values[1]) * vectors[:, 0] + sign * math.sqrt(-values[0]) * vectors[:, 1]
        u, a = metric.unit(here.problem, *_pair(shares @ reduced.directions))
        along = metric.dot(here.problem, u, a, here.tangent_x, here.tangent_parameter)
        found.append((-abs(along), (u, a) if along > 0.0 else (-u, -a)))
    return tuple(direction for _, direction in sorted(found, key=lambda one: one[0]))


def _type(segment: Segment, reduced: _Reduced, y: Array) -> Kind:
    """Tell whether one of the two curves is at an extremum of the parameter, by the normal form a p z + b z² + c z³.

    b is ψᵀ F_xx φ φ with the null vectors ψ and φ of J at constant p. It is zero where it is no larger than its error:
    rounding of F in a second difference, and of ψ.
    """
    problem, metric, (x, p) = segment.begin.problem, segment.metric, _pair(y)
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
    return "pitchfork" if abs(float(psi @ d)) <= UNSIGNED * error else "transcritical"


def _search(here: Point, reduced: _Reduced, metric: Metric, options: Options) -> tuple[Direction, ...]:
    """Return the directions of the curves through a multiple branch point, the followed one's first.

    From combinations of the tangent and the null vectors Newton's method leads to points close by. Two whose
    directions differ by less than the root of their distance are on one curve.
    """
    problem, m, patient = here.problem, len(reduced.mu), replace(options, patience=CORRECTIONS)
    found = [(here.tangent_x, here.tangent_parameter)]
    for shares in np.random.default_rng(0).standard_normal((SEARCHES * m**2, m + 1)) if m <= MOST_SEARCHED else ():
        u, a = metric.unit(problem, *_pair(shares @ reduced.directions))
        beside = here.x + SEARCH_RADIUS * u, here.parameter + SEARCH_RADIUS * a
        try:
            point, _ = corrected_point(problem, beside, (u, a), metric, patient)
        except CorrectionError:
            continue
        v, b = metric.unit(problem, point.x - here.x, point.parameter - here.parameter)
        known = max(abs(metric.dot(problem, v, b, *one)) for one in found)
        if metric.dot(problem, u, a, v, b) > 0.5 and known < math.cos(math.sqrt(SEARCH_RADIUS)):
            found.append((v, b))
    return tuple(found)
