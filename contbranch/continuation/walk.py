"""Points of the curve: corrected, with unit tangent, with what the problem says, and on another discretisation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.curve import Outcome, Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import Corrected, CorrectionError, correct, evaluating, tangent_at
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Adaptation, Direction, Problem
from contbranch.continuation.segment import Segment


def to_point(problem: Problem, corrected: Corrected, metric: Metric, sign: bool = True) -> Point:
    """Return a corrected point with unit tangent and, if `sign`, the sign of the bordered determinant."""
    tangent = metric.unit(problem, corrected.tangent_x, corrected.tangent_parameter)
    determinant_sign = corrected.bordered.determinant_sign() if sign else None
    return Point(problem, corrected.x, corrected.parameter, *tangent, determinant_sign)


def annotated(point: Point, label: str | None = None) -> Point:
    """Return the point with the problem's Morse index and observables.

    Raises
    ------
    CorrectionError
        If the problem fails at them.
    """
    problem, x, p = point.problem, point.x, point.parameter
    with evaluating(p):
        index, observables = problem.morse_index(x, p), problem.observables(x, p)
    return replace(point, morse_index=index, observables=observables, label=point.label if label is None else label)


def examined(point: Point, label: str | None = None) -> Point:
    """Return the point of a step with what the problem says of it, if its discretisation resolves it.

    Raises
    ------
    CorrectionError
        If it does not, or if the problem fails.
    """
    with evaluating(point.parameter):
        point.problem.examine(point.x, point.parameter)
    return annotated(point, label)


def corrected_point(
    problem: Problem,
    near: Direction,
    along: Direction,
    metric: Metric,
    options: Options,
    kept: Bordered | None = None,
    precise: bool = True,
) -> tuple[Point, Bordered]:
    """Correct (x, p) in the plane normal to a direction; return the point and its bordered matrix.

    The matrix kept of another point in a plane normal to the same direction saves one where it serves, see `correct`.
    """
    corrected = correct(problem, near, _normal(problem, along, metric), metric, options, precise, kept)
    return to_point(problem, corrected, metric, sign=False), corrected.bordered


def point_on(segment: Segment, theta: float, options: Options, precise: bool = True) -> tuple[Point, Bordered]:
    """Return the point of the curve at the fraction θ of a segment, and its bordered matrix."""
    near, along = segment.at(theta), segment.direction(theta)
    return corrected_point(segment.begin.problem, near, along, segment.metric, options, precise=precise)


def _normal(problem: Problem, direction: Direction, metric: Metric) -> Direction:
    """Return the border of the plane normal to a direction; CorrectionError if that has no length."""
    size = metric.norm(problem, *direction)
    if not (size > 0 and math.isfinite(size)):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The step has no length.)")
    return metric.row(problem, *metric.unit(problem, *direction))


# Shares of a segment by which points lie aside that stand in for one in a place where rounding hides the curve.
STAND_IN_SHARE = 0.01


class Across:
    """Points of the curve next to a segment, in planes normal to its direction at one fraction θ.

    They share a bordered matrix as far as it serves. Next to a branch point it is all but singular and rounding hides
    the curve: a point there is interpolated between points a little way off.
    """

    def __init__(self, segment: Segment, theta: float, options: Options) -> None:
        self.segment, self.options = segment, options
        self.row = _normal(segment.begin.problem, segment.direction(theta), segment.metric)
        self.bordered: Bordered | None = None

    def at(self, theta: float) -> Point:
        """The point at the fraction θ of the segment."""
        point, hidden = self._corrected(theta)
        if not (hidden and self.options.detect_branch_points):
            return point
        (begin, _), (end, _) = (self._corrected(theta + by) for by in (-STAND_IN_SHARE, STAND_IN_SHARE))
        around = Segment(begin, end, self.segment.metric)
        return Point(begin.problem, *around.at(0.5), *around.metric.unit(begin.problem, *around.direction(0.5)))

    def _corrected(self, theta: float) -> tuple[Point, bool]:
        """The point, and whether rounding hides its place."""
        segment, problem = self.segment, self.segment.begin.problem
        corrected = correct(problem, segment.at(theta), self.row, segment.metric, self.options, True, self.bordered)
        self.bordered = corrected.bordered
        return to_point(problem, corrected, segment.metric, sign=False), corrected.hidden


# Below this parameter component (in the metric) the sign of dp/ds does not orient a tangent reliably.
NEARLY_VERTICAL = 0.05


def adapted(
    point: Point, metric: Metric, options: Options, ahead: Point | None = None
) -> tuple[Point, Callable[[Point], Point] | None]:
    """Return the point on the discretisation its problem prefers, and what carries earlier ones there, if possible.

    Parameters
    ----------
    ahead : Point, optional
        Where a step from the point leads, for which the discretisation is to be made.

    Raises
    ------
    CorrectionError
        If the point cannot be corrected there.
    """
    problem, p = point.problem, point.parameter
    with evaluating(p, " in adapt"):
        offer = problem.adapt(point.x, p) if ahead is None else problem.adapt(ahead.x, ahead.parameter)
    if offer is None:
        return point, None
    if not isinstance(offer, Adaptation):
        offer = Adaptation(problem, offer)
    carry, x = _carry(offer), offer.x
    if ahead is not None and (carry is None or offer.moved is not None):  # may not suit the state here
        return point, None
    steepness, least = point.tangent_parameter, NEARLY_VERTICAL * metric.parameter_scale
    if carry is not None:
        carried = carry(point)
        u, a, x = carried.tangent_x, carried.tangent_parameter, carried.x if ahead is not None else x
    elif abs(steepness) < least:  # nothing tells which way the curve goes on there: it is asked again behind the fold
        return point, None
    else:
        u, a, _ = tangent_at(offer.problem, x, p)
        u, a = math.copysign(1.0, a * steepness) * u, math.copysign(a, steepness)
    row = metric.row(offer.problem, *metric.unit(offer.problem, u, a))
    found = to_point(offer.problem, correct(offer.problem, (x, p), row, metric, options), metric)
    # A tangent that was not resolved may point backwards, but not where the parameter tells the way.
    told = problem.ordered or min(abs(steepness), abs(found.tangent_parameter)) > least
    if told and steepness * found.tangent_parameter < 0.0:
        found = found.turned()
    return examined(found, label=point.label), carry


def _carry(offer: Adaptation) -> Callable[[Point], Point] | None:
    """What carries earlier points to the new discretisation: close to the curve there, which is enough to predict."""
    transfer, moved = offer.transfer, offer.moved
    if moved is None and transfer is None:
        return None

    def carry(point: Point) -> Point:
        with evaluating(point.parameter, " in adapt"):
            if moved is not None:
                x, tangent = moved(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
            elif transfer is not None:
                x, tangent = transfer(point.x), transfer(point.tangent_x)
        return replace(point, problem=offer.problem, x=x, tangent_x=tangent)

    return carry


def unit_tangent(point: Point, metric: Metric) -> Point:
    """Return the point with its tangent scaled to unit length in a metric: that of the next step, or of an event."""
    u, a = metric.unit(point.problem, point.tangent_x, point.tangent_parameter)
    return replace(point, tangent_x=u, tangent_parameter=a)
