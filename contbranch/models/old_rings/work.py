"""Along a curve with free boundaries: points between rows, and the work ∫ F dd."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Point
from contbranch.continuation.newton import border, linearise
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import corrected_point, point_on
from contbranch.control import DISPLACEMENT

from .accuracy import OPTIONS, moved, ring_problem
from .legs import Reached, oriented, rates, solved, unit_metric
from .problem import RingProblem
from .solve import between

__all__ = ["points_between", "work_along"]

Array = NDArray[np.float64]

# Halvings of a piece for the quadrature; of the change that two halves make they are wrong by a 15th, if pieces are
# short enough: what is accepted is the smaller.
HALVINGS, GAIN, SURE = 7, 15.0, 3.0
# Steps of Newton's method shorter than this (relative to the state) leave next to nothing for a second one.
ONE_STEP = 1e-3
GAUSS = np.polynomial.legendre.leggauss(3)


def work_along(points: Sequence[Point], tolerance: float) -> float:
    """∫ F dd over the pieces of curve between consecutive points, reduced units.

    On a piece load and displacement are the cubics with the curve's own tangents at both ends, and pieces are halved
    until the halves agree with the whole. Where panels change, the displacement jumps by its discretisation error,
    which counts: only then is the work the difference of the energies at both ends.

    Parameters
    ----------
    tolerance : float
        Quadrature error allowed on a piece.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    parts: list[float] = []
    last: float | None = None
    for first, second in pairwise(points):
        begin, end = _piece(first, second)
        load = ring_problem(begin).load(ring_problem(begin).fields(begin.x, begin.parameter))
        if last is not None:
            parts.append(load * (begin.parameter - last))
        parts.append(_work(begin, end, tolerance, HALVINGS))
        last = end.parameter
    return math.fsum(parts)


def points_between(begin: Point, end: Point, count: int) -> list[tuple[RingProblem, Array, float]]:
    """States (problem, x, d) between two neighbouring points; fewer where they cannot be had (next to a change).

    One step of Newton's method from the cubic between both, where that is close enough to be all that is needed.
    """
    begin, end = _piece(begin, end)
    problem = ring_problem(begin)
    same = ring_problem(end) is problem
    found = []
    for k in range(count):
        share = (k + 1) / (count + 1)
        try:
            if same and (near := _nearly(Segment(begin, end, unit_metric(problem, begin.x)), share)) is not None:
                found.append((problem, *near))
            else:
                point = _inside(begin, end, share)
                found.append((ring_problem(point), point.x, point.parameter))
        except CorrectionError:
            continue
    return found


def _nearly(segment: Segment, share: float) -> tuple[Array, float] | None:
    """The state at a share of a segment by one step of Newton's method, None if that step is too long."""
    problem = segment.begin.problem
    x, d = segment.at(share)
    along = segment.direction(share)
    size = segment.metric.norm(problem, *along)
    if not size > 0:
        return None
    row = segment.metric.row(problem, along[0] / size, along[1] / size)
    at = linearise(problem, x, d)
    dx, dd = border(problem, x, d, at, row).solve(-at[0], 0.0)
    return (x + dx, d + dd) if segment.metric.norm(problem, dx, dd) < ONE_STEP else None


def _piece(begin: Point, end: Point) -> tuple[Point, Point]:
    """Two neighbouring points with tangents along the piece, and on the panels of the first if their layouts agree."""
    problem = ring_problem(begin)
    if ring_problem(end).layout != problem.layout:
        return begin, end
    metric = unit_metric(problem, begin.x)
    if ring_problem(end) is not problem:
        there = moved(end, problem)
        end, _ = corrected_point(
            problem, there.x, there.parameter, (there.tangent_x, there.tangent_parameter), metric, OPTIONS
        )
    chord = end.x - begin.x, end.parameter - begin.parameter

    def along(point: Point) -> Point:
        ahead = metric.dot(problem, point.tangent_x, point.tangent_parameter, *chord)
        return point if ahead >= 0 else point.turned()

    return along(begin), along(replace(end, problem=problem))


def _inside(begin: Point, end: Point, share: float) -> Point:
    problem = ring_problem(begin)
    if ring_problem(end).layout != problem.layout:
        at = begin.parameter + share * (end.parameter - begin.parameter)
        return between(begin, end, Reached(DISPLACEMENT, at))
    try:
        return point_on(Segment(begin, end, unit_metric(problem, begin.x)), share, OPTIONS)[0]
    except CorrectionError:
        # Far away pressures grow by orders of magnitude in a step, which no cubic follows: the displacement leads.
        if problem.edges:
            raise
    d = begin.parameter + share * (end.parameter - begin.parameter)
    x, _ = solved(problem, begin.x, d)
    return oriented(problem, x, d, (end.x - begin.x, end.parameter - begin.parameter))


def _work(begin: Point, end: Point, tolerance: float, halvings: int) -> float:
    """∫ F dd on a piece."""
    whole = _estimate(begin, end)
    if halvings == 0 or begin.parameter == end.parameter:
        return whole
    try:
        middle = _inside(begin, end, 0.5)
        first, second = _piece(begin, middle), _piece(middle, end)
    except CorrectionError:
        if ring_problem(begin).layout == ring_problem(end).layout:
            raise
        return whole  # as narrow as regions get: what the tangents tell is all there is
    halves = _estimate(*first) + _estimate(*second)
    if abs(halves - whole) <= SURE * tolerance:
        return halves + (halves - whole) / GAIN
    return sum(_work(*half, tolerance / 2, halvings - 1) for half in (first, second))


def _estimate(begin: Point, end: Point) -> float:
    """∫ F dd with the cubics that have the values and tangents of both ends."""
    (first, last), (first_rate, last_rate) = zip(*(_loads(point) for point in (begin, end)), strict=True)
    change = end.parameter - begin.parameter
    if ring_problem(end).layout != ring_problem(begin).layout:
        # The lengths of both tangents are not comparable, but their slopes are.
        (load_0, d_0), (load_1, d_1) = first_rate, last_rate
        trapezoid = 0.5 * change * (first + last)
        steepest = 1e-3 * min(abs(d_0), abs(d_1)) * max(1.0, abs(last - first) / max(abs(change), 1e-300))
        if max(abs(load_0), abs(load_1)) * 1e-6 > steepest:
            return float(trapezoid)
        return float(trapezoid + change * change * (load_0 / d_0 - load_1 / d_1) / 12)
    segment = Segment(begin, end, unit_metric(ring_problem(begin), begin.x))
    if segment.length == 0.0:
        return 0.0
    theta = (GAUSS[0] + 1) / 2
    loads = _cubic(theta, first, last, first_rate[0] * segment.scale_begin, last_rate[0] * segment.scale_end)[0]
    moves = _cubic(theta, 0.0, change, first_rate[1] * segment.scale_begin, last_rate[1] * segment.scale_end)[1]
    return float((GAUSS[1] / 2) @ (loads * moves))


def _loads(point: Point) -> tuple[float, tuple[float, float]]:
    problem = ring_problem(point)
    return problem.load(problem.fields(point.x, point.parameter)), rates(point)


def _cubic(t: Array, first: float, last: float, slope: float, end_slope: float) -> tuple[Array, Array]:
    """Hermite's cubic on [0, 1] and its derivative."""
    c2, c3 = 3 * (last - first) - 2 * slope - end_slope, slope + end_slope - 2 * (last - first)
    return first + t * (slope + t * (c2 + t * c3)), slope + t * (2 * c2 + 3 * t * c3)
