"""Branch points: where the bordered matrix of a curve is singular."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.curve import BranchPoint, Point
from contbranch.continuation.folds import second_derivative
from contbranch.continuation.locate import find_root
from contbranch.continuation.newton import CorrectionError, border, linearise
from contbranch.continuation.options import Options
from contbranch.continuation.outcomes import Outcome
from contbranch.continuation.problem import Array, Problem
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on

__all__ = ["Crossings", "locate_branch_point"]

# Of a true branch point the test function falls to rounding; where a step has leapt to another part of the curve it
# jumps from one sign to the other instead.
CONFIRMED = 1e-6
# Right at a branch point the matrix is singular; this far beside it (a share of the step) it is not.
BESIDE = 1e-10
# The tangent at a branch point is extrapolated from those at this share of the step before and after it.
ASIDE = 0.02
# A direction whose parameter component (in the metric) is below this is that of an extremum.
FLAT = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """A located branch point and its position within the step."""

    theta: float
    event: BranchPoint


@dataclass(frozen=True, slots=True, eq=False)
class _Vectors:
    """Approximate right and left null vectors (n+1) of the bordered matrix."""

    right: tuple[Array, float]
    left: tuple[Array, float]


def _null_vectors(bordered: Bordered, n: int) -> _Vectors:
    """Return approximate null vectors by two inverse iterations on MᵀM."""
    right: tuple[Array, float] = (np.cos(1.0 + np.arange(n) ** 2 % 7919), 0.5)
    left = right
    for _ in range(2):
        solved = bordered.solve_transposed(*right)
        if solved is None:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(No transposed solves.)")
        left = _unit(*solved)
        right = _unit(*bordered.solve(*left))
    return _Vectors(right, left)


def _unit(u: Array, a: float) -> tuple[Array, float]:
    size = math.sqrt(float(u @ u) + a * a)
    if not math.isfinite(size) or size == 0.0:
        raise CorrectionError(Outcome.NOT_FINITE, "(The bordered matrix is singular.)")
    return u / size, a / size


def _test(bordered: Bordered, vectors: _Vectors) -> float:
    """Return τ = 1/(rᵀ M⁻¹ l): a smooth function along the curve that vanishes where M is singular."""
    u, a = bordered.solve(*vectors.left)
    value = float(vectors.right[0] @ u) + vectors.right[1] * a
    return 1 / value if value != 0.0 else math.inf


def locate_branch_point(segment: Segment, options: Options) -> Crossings | None:
    """Locate the branch point between two points of opposite determinant; None if there is none after all.

    The test function is that of a doubly bordered matrix, τ = 1/(rᵀ M⁻¹ l) with l, r close to M's null vectors.
    """
    problem = segment.begin.problem
    at_begin, m_begin = point_on(segment, 0.0, options)
    _, m_end = point_on(segment, 1.0, options)
    # The null vectors of the end closer to the branch point (smaller τ) serve for the whole step.
    vectors = _null_vectors(m_begin, at_begin.x.size)
    begin, end = _test(m_begin, vectors), _test(m_end, vectors)
    if abs(end) < abs(begin):
        vectors = _null_vectors(m_end, at_begin.x.size)
        begin, end = _test(m_begin, vectors), _test(m_end, vectors)
    if (begin > 0) == (end > 0):
        return None
    known: list[tuple[float, float, Point | None]] = [(0.0, begin, None), (1.0, end, None)]

    def evaluate(theta: float) -> float:
        for position in (theta, theta + BESIDE, theta - BESIDE):
            try:
                point, bordered = point_on(segment, position, options)
                value = _test(bordered, vectors)
            except CorrectionError:
                continue
            known.append((position, value, point))
            return value
        # The matrix is too close to singular for Newton's method: close enough.
        return 0.0

    theta = find_root(evaluate, (0.0, begin), (1.0, end), tolerance=1e-14)
    nearest = min(known, key=lambda sample: (sample[2] is None, abs(sample[0] - theta)))
    if nearest[2] is None or abs(nearest[1]) > CONFIRMED * max(abs(begin), abs(end)):
        return None
    tangent_x, tangent_parameter = _tangent(segment, nearest[0], options)
    point = replace(nearest[2], label="branch point", tangent_x=tangent_x, tangent_parameter=tangent_parameter)
    distance = max(abs(nearest[0] - theta), 1e-12)
    state_error = distance * math.sqrt(problem.inner(segment.end.x - segment.begin.x, segment.end.x - segment.begin.x))
    error = distance * (abs(segment.end.parameter - segment.begin.parameter) + 1e-15)
    type_, other = _classify(point, segment)
    event = BranchPoint(point, error, state_error, type=type_)
    if other is not None:
        event = replace(event, other_x=other[0], other_parameter=other[1])
    return Crossings(theta, event)


def _tangent(segment: Segment, theta: float, options: Options) -> tuple[Array, float]:
    """Return the curve's unit tangent at a branch point from tangents on both sides.

    At the point itself the matrix has two null vectors, and a solve returns any mixture of them. The mean of the
    tangents at ±δ has an error of order δ²; two distances remove that order too.
    """
    means = []
    for aside in (ASIDE, 2 * ASIDE):
        before, _ = point_on(segment, theta - aside, options)
        after, _ = point_on(segment, theta + aside, options)
        means.append(
            (
                (before.tangent_x + after.tangent_x) / 2,
                (before.tangent_parameter + after.tangent_parameter) / 2,
            )
        )
    (near_x, near_p), (far_x, far_p) = means
    x, p = (4 * near_x - far_x) / 3, (4 * near_p - far_p) / 3
    size = segment.metric.norm(segment.begin.problem, x, p)
    return x / size, p / size


def _classify(
    point: Point, segment: Segment
) -> tuple[Literal["pitchfork", "transcritical", "branch point"], tuple[Array, float] | None]:
    """Tell a pitchfork from a transcritical crossing by the algebraic branching equation.

    With t the tangent, z the second null vector and l the left null vector of [J Fp], the directions α t + β z of the
    curves through the point obey a11 α² + 2 a12 α β + a22 β² = 0, aij = l @ d²F[.,.]; a11 = 0 as t is one of them, so
    the other is -a22/(2 a12) t + z (E. L. Allgower, K. Georg, Numerical Continuation Methods, SIAM 2003, sec. 8.3).
    """
    problem, metric = point.problem, segment.metric
    t = (point.tangent_x, point.tangent_parameter)
    try:
        here = linearise(problem, point.x, point.parameter)
        row = metric.row(problem, *t)
        vectors = _null_vectors(border(problem, point.x, point.parameter, here, row), point.x.size)
        z = _normal_to(t, vectors.right, problem, segment)
        a12, a22 = _branching_coefficients(problem, point, t, z, vectors.left[0], segment, here[0])
    except CorrectionError:
        return "branch point", None
    size = max(abs(a12), abs(a22))
    if not size > 0 or abs(a12) < 1e-3 * size:
        return "branch point", None
    ratio = -a22 / (2 * a12)
    other_x, other_p = ratio * t[0] + z[0], ratio * t[1] + z[1]
    norm = metric.norm(problem, other_x, other_p)
    other_x, other_p = other_x / norm, other_p / norm
    flat = min(abs(t[1]), abs(other_p)) < FLAT * metric.parameter_scale
    return ("pitchfork" if flat else "transcritical"), (other_x, other_p)


def _normal_to(
    t: tuple[Array, float], z: tuple[Array, float], problem: Problem, segment: Segment
) -> tuple[Array, float]:
    """Return z without its part along t, of unit length."""
    metric = segment.metric
    along = metric.dot(problem, *t, *z) / metric.dot(problem, *t, *t)
    x, p = z[0] - along * t[0], z[1] - along * t[1]
    size = metric.norm(problem, x, p)
    return x / size, p / size


def _branching_coefficients(
    problem: Problem,
    point: Point,
    t: tuple[Array, float],
    z: tuple[Array, float],
    left: Array,
    segment: Segment,
    here: Array,
) -> tuple[float, float]:
    """Return a12 and a22 of the algebraic branching equation."""
    x, p, metric = point.x, point.parameter, segment.metric
    # Offsets must stay well above the distance to the exact branch point: here second differences are enough.
    a11 = float(left @ second_derivative(problem, x, p, *t, metric, here))  # zero but for errors
    a22 = float(left @ second_derivative(problem, x, p, *z, metric, here))
    both = (t[0] + z[0], t[1] + z[1])
    mixed = float(left @ second_derivative(problem, x, p, *both, metric, here))
    return (mixed - a11 - a22) / 2, a22
