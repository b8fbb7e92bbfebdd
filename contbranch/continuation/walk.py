"""Points of the curve: corrected, with unit tangent, with what the problem says, and on another discretisation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.curve import Outcome, Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import Corrected, CorrectionError, correct, evaluating, tangent_at
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Adaptation, Direction, Problem, size_of
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
    problem = point.problem
    kind = type(problem)
    asks_index = kind.morse_index is not Problem.morse_index
    asks_observables = kind.observables is not Problem.observables
    if not (asks_index or asks_observables or label is not None):
        return point
    with evaluating(point.parameter):
        return replace(
            point,
            morse_index=problem.morse_index(point.x, point.parameter) if asks_index else None,
            observables=problem.observables(point.x, point.parameter) if asks_observables else {},
            label=point.label if label is None else label,
        )


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
    problem: Problem, near: Direction, along: Direction, metric: Metric, options: Options, kept: Bordered | None = None
) -> tuple[Point, Bordered]:
    """Correct (x, p) precisely in the plane normal to a direction; return the point and its bordered matrix.

    The matrix kept of another point in a plane normal to the same direction saves one where it serves, see `correct`.
    """
    corrected = correct(problem, near, _normal(problem, along, metric), metric, options, True, kept)
    return to_point(problem, corrected, metric, sign=False), corrected.bordered


def point_on(segment: Segment, theta: float, options: Options, precise: bool = True) -> tuple[Point, Bordered]:
    """Return the point of the curve at the fraction θ of a segment, and its bordered matrix."""
    problem, metric = segment.begin.problem, segment.metric
    row = _normal(problem, segment.direction(theta), metric)
    corrected = correct(problem, segment.at(theta), row, metric, options, precise)
    return to_point(problem, corrected, metric, sign=False), corrected.bordered


def _normal(problem: Problem, direction: Direction, metric: Metric) -> Direction:
    """The border of the plane normal to a direction; CorrectionError if that has no length."""
    size = metric.norm(problem, *direction)
    if not (size > 0 and math.isfinite(size)):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The step has no length.)")
    return metric.row(problem, *metric.unit(problem, *direction))


# Shares of a segment by which points lie aside that stand in for one in a place where rounding hides the curve.
STAND_IN_SHARE = 0.01


class Across:
    """Points of the curve next to a segment, in planes normal to its direction at one fraction θ.

    They share a bordered matrix as far as it serves. Next to a branch point it is all but singular and rounding hides
    the curve: a point there is interpolated between points a little way off, if they are known better.
    """

    def __init__(self, segment: Segment, theta: float, options: Options) -> None:
        self.segment, self.options = segment, options
        self.row = _normal(segment.begin.problem, segment.direction(theta), segment.metric)
        self.bordered: Bordered | None = None

    def at(self, theta: float) -> Point:
        """The point at the fraction θ of the segment."""
        failure: CorrectionError | None = None
        metric, uncertainty = self.segment.metric, math.inf
        try:
            point, uncertainty = self._corrected(theta)
        except CorrectionError as error:
            failure = error
        if uncertainty == 0.0 or not self.options.detect_branch_points:
            if failure is not None:
                raise failure
            return point
        (begin, before), (end, behind) = (self._corrected(theta + by) for by in (-STAND_IN_SHARE, STAND_IN_SHARE))
        if max(before, behind) > uncertainty:
            return point
        around = Segment(begin, end, metric)
        return Point(begin.problem, *around.at(0.5), *metric.unit(begin.problem, *around.direction(0.5)))

    def _corrected(self, theta: float) -> tuple[Point, float]:
        """The point, and its uncertainty where rounding hides it."""
        segment = self.segment
        problem, metric = segment.begin.problem, segment.metric
        corrected = correct(problem, segment.at(theta), self.row, metric, self.options, True, self.bordered)
        self.bordered = corrected.bordered
        return to_point(problem, corrected, metric, sign=False), corrected.uncertainty


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
    problem = point.problem
    if type(problem).adapt is Problem.adapt:
        return point, None
    at = ahead or point
    with evaluating(at.parameter, " in adapt"):
        offer = problem.adapt(at.x, at.parameter)
    if offer is None:
        return point, None
    if not isinstance(offer, Adaptation):
        offer = Adaptation(problem, offer)
    carry = _carry(offer)
    if ahead is not None:
        if carry is None or offer.moved is not None:  # what the state ahead asks for may not suit this one
            return point, None
        there = carry(point)
        upright = abs(point.tangent_parameter) > NEARLY_VERTICAL * metric.parameter_scale
        along = (np.zeros_like(there.x), 1.0) if upright else (there.tangent_x, there.tangent_parameter)
        row = metric.row(offer.problem, *along)
        corrected = correct(offer.problem, (there.x, point.parameter), row, metric, options)
        there = replace(there, x=corrected.x, parameter=point.parameter if upright else corrected.parameter)
        return examined(there, label=point.label), carry
    row = metric.row(offer.problem, *metric.unit(offer.problem, *_direction(point, offer, metric)))
    corrected = correct(offer.problem, (offer.x, point.parameter), row, metric, options)
    found = to_point(offer.problem, corrected, metric)
    before, after = point.tangent_parameter, found.tangent_parameter
    if problem.ordered or min(abs(before), abs(after)) > NEARLY_VERTICAL * metric.parameter_scale:
        turned = before * after < 0.0
    else:  # the state's own rate may not have been resolved, and less so as the discretisation moves through it
        turned = offer.moved is not None and _agreement(point, found) < 0.0
    if turned:
        found = found.turned()
    return examined(found, label=point.label), carry


def _carry(offer: Adaptation) -> Callable[[Point], Point] | None:
    """What carries earlier points to the new discretisation: close to the curve there, which is enough to predict."""
    transfer, moved = offer.transfer, offer.moved
    if moved is None and transfer is None:
        return None

    def carry(point: Point) -> Point:
        if moved is not None:
            with evaluating(point.parameter, " in adapt"):
                x, tangent = moved(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        elif transfer is not None:
            x, tangent = transfer(point.x), transfer(point.tangent_x)
        return replace(point, problem=offer.problem, x=x, tangent_x=tangent)

    return carry


def _direction(point: Point, offer: Adaptation, metric: Metric) -> Direction:
    """Return the old tangent on the new discretisation, or a new tangent oriented like the old one."""
    if offer.moved is not None:
        with evaluating(point.parameter, " in adapt"):
            moved = offer.moved(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        return moved[1], point.tangent_parameter
    if offer.transfer is not None:
        return offer.transfer(point.tangent_x), point.tangent_parameter
    if offer.x.shape == point.x.shape:
        return point.tangent_x, point.tangent_parameter
    u, a = metric.unit(offer.problem, *tangent_at(offer.problem, offer.x, point.parameter)[:2])
    old = point.tangent_parameter
    if abs(old) > NEARLY_VERTICAL * metric.parameter_scale:
        same = (a > 0) == (old > 0)
    else:
        same = _agreement(point, Point(offer.problem, offer.x, point.parameter, u, a)) >= 0
    return (u, a) if same else (-u, -a)


def _agreement(before: Point, after: Point) -> float:
    """Return how well two tangents agree, by the changes of the observables along them (and of the parameter)."""
    with evaluating(before.parameter, " in adapt"):
        one, other = _changes(before), _changes(after)
    return sum(one[name] * other[name] for name in one if name in other)


def _changes(point: Point) -> dict[str, float]:
    """Return the directional derivatives of the observables, scaled to values of order one, and of the parameter."""
    problem, x, p, u, a = point.problem, point.x, point.parameter, point.tangent_x, point.tangent_parameter
    size = math.sqrt(problem.inner(u, u) + a * a)
    step = 1e-6 * max(1.0, size_of(problem, x)) / size
    above, below = problem.observables(x + step * u, p + step * a), problem.observables(x - step * u, p - step * a)
    changes = {name: (above[name] - below[name]) / (2 * step) for name in above}
    largest = max((abs(change) for change in changes.values()), default=0.0)
    scaled = {name: change / largest for name, change in changes.items()} if largest > 0 else {}
    return {"": a / size, **scaled}


def unit_tangent(point: Point, metric: Metric) -> Point:
    """Return the point with its tangent scaled to unit length in a metric: that of the next step, or of an event."""
    u, a = metric.unit(point.problem, point.tangent_x, point.tangent_parameter)
    return replace(point, tangent_x=u, tangent_parameter=a)
