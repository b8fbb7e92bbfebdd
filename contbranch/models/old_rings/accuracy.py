"""Events to the accuracy asked for, and error estimates: the same on finer panels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Event, Options, Point, factorise
from contbranch.continuation.newton import linearise
from contbranch.continuation.walk import corrected_point

from .legs import NARROW_RING, unit_metric
from .meshing import adapted, finer
from .problem import RingProblem

__all__ = ["Values", "locate", "refine", "row_error"]

Array = NDArray[np.float64]
Four = tuple[float, float, float, float]

OPTIONS = Options(tolerance=1e-13, noise=1e8)
# The finer panels have an error of their own.
SAFETY = 2.0
# Least estimate as a share of the accuracy (panels may agree by chance), and rounding relative to max(1, |value|).
FLOOR, ROUNDING = 0.002, 1e-12
# What a jump in place of a narrow resting ring leaves out, relative to max(1, |value|).
JUMP = 0.1 * NARROW_RING**2
# Panels for an event aim at this part of the accuracy.
AIM = 0.1
ROUNDS, LARGEST = 5, 900


@dataclass(frozen=True)
class Values:
    """Load, displacement, contact radius and central gap with their error estimates, reduced units."""

    numbers: Four
    error: Four

    def relative_error(self) -> float:
        """Largest error relative to max(1, |value|)."""
        return max(e / max(1.0, abs(v)) for e, v in zip(self.error, self.numbers, strict=True))


def ring_problem(point: Point) -> RingProblem:
    """The problem of a point."""
    problem = point.problem
    assert isinstance(problem, RingProblem)
    return problem


def numbers(point: Point) -> Four:
    """Load, displacement, contact radius and central gap."""
    load, displacement, radius, gap = ring_problem(point).numbers(point.x, point.parameter)
    return load, displacement, radius, max(gap, 0.0)


def locate(point: Point, event: Event) -> Point:
    """The zero of the event function near a point, by a secant iteration along the tangent there.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    problem = ring_problem(point)
    metric = unit_metric(problem, point.x)
    size = metric.norm(problem, point.tangent_x, point.tangent_parameter)
    dx, dd = point.tangent_x / size, point.tangent_parameter / size
    length = 1e-4 * math.sqrt(metric.norm(problem, point.x, 0.0))

    def at(s: float, near: Point, ahead: float) -> tuple[Point, float]:
        x, d = near.x + ahead * near.tangent_x, near.parameter + ahead * near.tangent_parameter
        found, _ = corrected_point(problem, x, d, (dx, dd), metric, OPTIONS)
        return found, event.value(found)

    here, value = at(0.0, point, 0.0)
    best, steepness, s = (abs(value), here), 0.0, 0.0
    for iteration in range(14):
        step = -value / steepness if steepness else length
        step = math.copysign(min(abs(step), 0.1), step)
        if iteration and abs(step) <= 1e-13:
            break
        there, after = at(s + step, here, step)
        if after != value and (abs(step) > 1e-8 or not steepness):
            steepness = (after - value) / step
        stalled = abs(after) >= 0.5 * best[0]
        here, value, s = there, after, s + step
        if abs(value) < best[0]:
            best = (abs(value), here)
        if value == 0.0 or (stalled and abs(step) < 1e-8):
            break
    return best[1]


def moved(point: Point, problem: RingProblem) -> Point:
    """A point carried to other panels, not yet a solution there."""
    old = ring_problem(point)
    return Point(
        problem,
        old.carried(point.x, point.x, problem),
        point.parameter,
        old.carried(point.tangent_x, point.x, problem),
        point.tangent_parameter,
    )


def settled(point: Point, event: Event | None) -> Point:
    """The event near a point, or (without event) the solution in the plane normal to its tangent."""
    if event is not None:
        return locate(point, event)
    metric = unit_metric(ring_problem(point), point.x)
    direction = point.tangent_x, point.tangent_parameter
    return corrected_point(point.problem, point.x, point.parameter, direction, metric, OPTIONS)[0]


def refine(point: Point, event: Event | None, accuracy: float) -> tuple[Values, Point]:
    """Values at an event with error estimates within the accuracy if that can be reached, and the point they belong to.

    The estimate is the difference to the same event on finer panels; these take over until it is small enough.
    """
    problem, start = ring_problem(point), point
    for _ in range(3):
        fields = problem.fields(start.x, start.parameter)
        panels = adapted(problem, fields, AIM * accuracy * max(1.0, abs(problem.load(fields))))
        if panels is None:
            break
        problem = problem.on(panels)
        try:
            start = settled(moved(start, problem), None)
        except CorrectionError:
            break
        problem = ring_problem(start)
    best = _best(start, event, accuracy)
    if best is None and start is not point:  # joined panels may be too coarse to begin with
        best = _best(point, event, accuracy)
    # What has been reached stands, with its own error estimate.
    return best if best is not None else (by_defect(point), point)


def _best(point: Point, event: Event | None, accuracy: float) -> tuple[Values, Point] | None:
    """Values at an event on a point's panels and ever finer ones; None if it was not found there."""
    best: tuple[Values, Point] | None = None
    try:
        here = settled(point, event)
        for _ in range(ROUNDS):
            problem = ring_problem(here)
            there = settled(moved(here, problem.on(finer(problem.panels))), event)
            values = compared(numbers(here), numbers(there), accuracy, problem.layout.jumps)
            if best is None or values.relative_error() < best[0].relative_error():
                best = values, here
            if values.relative_error() <= accuracy or problem.fields(here.x, here.parameter).grid.size > LARGEST:
                break
            here = there
    except CorrectionError:
        return best
    return best


def compared(here: Four, there: Four, accuracy: float, jump: bool) -> Values:
    """Values with the differences between two discretisations as errors."""
    floor = ROUNDING + FLOOR * accuracy + JUMP * jump
    error = tuple(
        SAFETY * abs(a - b) + floor * max(1.0, abs(a)) if a or b else 0.0 for a, b in zip(here, there, strict=True)
    )
    return Values(here, (error[0], error[1], error[2], error[3]))


def by_defect(point: Point) -> Values:
    """Values with the errors of one Newton step on finer panels, where more was not to be had."""
    load, displacement, radius = row_error(point)
    return Values(numbers(point), (3 * load, 3 * displacement, 3 * radius, 3 * displacement))


def row_error(point: Point) -> tuple[float, float, float]:
    """Errors of load, displacement and outermost edge at a row: one Newton step on finer panels, across the curve."""
    problem = ring_problem(point)
    fine = problem.on(finer(problem.panels))
    there = moved(point, fine)
    metric = unit_metric(fine, there.x)
    row = metric.row(fine, there.tangent_x, there.tangent_parameter)
    at = linearise(fine, there.x, there.parameter)
    dx, dd = factorise(at[1], at[2], row[0], row[1]).solve(-at[0], 0.0)
    fields = fine.fields(there.x, there.parameter)
    load = fine.load(fields) + fine.load_rate(fields, dx) - problem.load(problem.fields(point.x, point.parameter))
    edges = np.abs(dx[fields.grid.size :])
    return abs(load), abs(dd), float(edges.max(initial=0.0))
