"""One direction of a curve: predict, correct, judge, look inside the step, accept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from contbranch.continuation.adapting import adapted
from contbranch.continuation.curve import Fold, Located, Point
from contbranch.continuation.edge import Range, closes, land
from contbranch.continuation.events import Event, Happening
from contbranch.continuation.metric import Balance, Metric
from contbranch.continuation.newton import CorrectionError, correct
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.outcomes import End, Outcome
from contbranch.continuation.probe import surprise
from contbranch.continuation.problem import Array
from contbranch.continuation.scan import LeapError, scan
from contbranch.continuation.segment import Segment
from contbranch.continuation.step import after_failure, judge
from contbranch.continuation.walk import annotated, to_point

__all__ = ["Branch", "follow"]


@dataclass(frozen=True, slots=True)
class Branch:
    """One direction from the start: its points, its events with their index among them, and its end."""

    points: list[Point]
    events: list[tuple[Located, int]]
    end: End


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """An accepted step."""

    segment: Segment
    happenings: list[Happening]
    end: End | None
    factor: float


def follow(
    start: Point,
    balance: Balance,
    interval: Range,
    options: Options,
    events: Sequence[Event],
    stop: StopAt,
) -> Branch:
    """Follow the curve from `start` along its tangent to its end in that direction."""
    here = start
    segment: Segment | None = None
    metric = balance.metric(options.weight, options.state_floor)
    step = options.first_step * metric.norm(here.problem, here.tangent_x, here.tangent_parameter)
    branch = Branch([], [], End(Outcome.MAXIMUM_POINTS))
    folds = 0
    for _ in range(options.maximum_points):
        here = _unit(here, metric)
        try:
            taken = _take(here, segment, step, metric, interval, options, events, start if branch.points else None)
        except CorrectionError as error:
            return replace(branch, end=End(error.outcome, error.detail))
        segment = taken.segment
        end = _record(branch, taken, stop, folds)
        folds = sum(isinstance(event, Fold) for event, _index in branch.events)
        if end is not None:
            return replace(branch, end=end)
        state_change, parameter_change = _changes(segment)
        balance = balance.advance(state_change, parameter_change)
        metric = balance.metric(options.weight, options.state_floor)
        try:
            here, changed = adapted(branch.points[-1], metric, options)
        except CorrectionError as error:
            return replace(branch, end=End(error.outcome, error.detail))
        if changed:
            branch.points[-1] = here
            segment_for_length = segment
            segment = None
        else:
            segment_for_length = segment = Segment(segment.begin, segment.end, metric)
        step = taken.factor * metric.norm(
            segment_for_length.begin.problem,
            segment_for_length.end.x - segment_for_length.begin.x,
            parameter_change,
        )
    return branch


def _unit(point: Point, metric: Metric) -> Point:
    """Return the point with its tangent scaled to unit length in the metric of the next step."""
    size = metric.norm(point.problem, point.tangent_x, point.tangent_parameter)
    return replace(point, tangent_x=point.tangent_x / size, tangent_parameter=point.tangent_parameter / size)


def _changes(segment: Segment) -> tuple[float, float]:
    dx = segment.end.x - segment.begin.x
    return (
        math.sqrt(max(segment.begin.problem.inner(dx, dx), 0.0)),
        abs(segment.end.parameter - segment.begin.parameter),
    )


def _predict(here: Point, segment: Segment | None, step: float, metric: Metric, limit: float) -> tuple[Array, float]:
    """Extrapolate the cubic through the last two points, or the tangent where the two disagree too much."""
    x = here.x + step * here.tangent_x
    p = here.parameter + step * here.tangent_parameter
    if segment is None or segment.length == 0.0:
        return x, p
    cubic_x, cubic_p = segment.at(1 + step / segment.length)
    apart = metric.norm(here.problem, cubic_x - x, cubic_p - p)
    return (cubic_x, cubic_p) if apart <= 0.5 * limit * step else (x, p)


def _take(
    here: Point,
    last: Segment | None,
    step: float,
    metric: Metric,
    interval: Range,
    options: Options,
    events: Sequence[Event],
    start: Point | None,
) -> _Step:
    """Take one step, shortening it until it succeeds; raise the last failure when it has become too short."""
    failed = False
    if math.isfinite(interval.width) and here.tangent_parameter != 0.0:
        longest = options.largest_parameter_step * interval.width
        step = min(step, longest / abs(here.tangent_parameter))
    failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve turns too sharply.)")
    while step >= options.smallest_step:
        x, p = _predict(here, last, step, metric, options.angle_limit)
        row = metric.row(here.problem, here.tangent_x, here.tangent_parameter)
        try:
            corrected = correct(here.problem, x, p, row, metric, tolerance=options.tolerance, noise=options.noise)
            end = to_point(here.problem, corrected, metric, options.detect_branch_points)
            judgement = judge(here, end, corrected, metric, options, surprise(Segment(here, end, metric), last))
            if not judgement.accepted:
                step *= judgement.factor
                failed = True
                continue
            segment = Segment(here, annotated(end), metric)
            segment, happenings, stop = _look_inside(segment, last, interval, options, events, start)
        except CorrectionError as error:
            failure = error
            step = after_failure(step)
            failed = True
            continue
        except LeapError:
            failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(Every step leaps to another part of the curve.)")
            step = after_failure(step)
            failed = True
            continue
        return _Step(segment, happenings, stop, min(judgement.factor, 1.0) if failed else judgement.factor)
    raise failure


def _look_inside(
    segment: Segment,
    last: Segment | None,
    interval: Range,
    options: Options,
    events: Sequence[Event],
    start: Point | None,
) -> tuple[Segment, list[Happening], End | None]:
    """Cut a step where the curve ends, and return what happens in it.

    The curve may also leave the range and come back within the step; then it has a fold outside the range.
    """
    end: End | None = None
    if start is not None:
        closing = closes(segment, start, options)
        if closing is not None:
            segment = Segment(segment.begin, closing, segment.metric)
            end = End(Outcome.CLOSED)
    edge = interval.edge_beyond(segment.end.parameter)
    if edge is not None:
        segment = Segment(segment.begin, annotated(land(segment, edge, options), label="edge"), segment.metric)
        end = End(Outcome.REACHED_EDGE)
    happenings = scan(segment, events, options, last)
    outside = next((h for h in happenings if not interval.contains(h.event.parameter)), None)
    if outside is not None:
        edge = interval.edge_beyond(outside.event.parameter)
        assert edge is not None
        to_outside = Segment(segment.begin, outside.event.point, segment.metric)
        cut = annotated(land(to_outside, edge, options), label="edge")
        segment = Segment(segment.begin, cut, segment.metric)
        happenings = [h for h in happenings if h.theta < outside.theta and interval.contains(h.event.parameter)]
        end = End(Outcome.REACHED_EDGE)
    if end is None:
        segment, end = _arrives(segment, interval, options)
    return segment, happenings, end


def _arrives(segment: Segment, interval: Range, options: Options) -> tuple[Segment, End | None]:
    """End the curve where it comes to an edge, or so close to it without crossing that it never will."""
    point = segment.end
    edge = interval.edge_close_to(point.parameter, options.edge_tolerance)
    if edge is None or (edge - point.parameter) * point.tangent_parameter < 0:
        return segment, None
    if point.parameter == edge:
        return segment, End(Outcome.REACHED_EDGE)
    try:
        landed = land(segment, edge, options)
    except CorrectionError:
        return segment, End(Outcome.APPROACHES_EDGE)
    return Segment(segment.begin, annotated(landed, label="edge"), segment.metric), End(Outcome.REACHED_EDGE)


def _record(branch: Branch, taken: _Step, stop: StopAt, folds: int) -> End | None:
    """Append a step's events and end point to the branch; return the end if a stop condition is met."""
    for happening in taken.happenings:
        branch.events.append((happening.event, len(branch.points)))
        branch.points.append(happening.event.point)
        if isinstance(happening.event, Fold):
            folds += 1
            if stop.folds is not None and folds >= stop.folds:
                return End(Outcome.STOPPED_AT_FOLD)
        if happening.terminal:
            return End(Outcome.STOPPED_AT_EVENT)
    branch.points.append(taken.segment.end)
    if taken.end is not None:
        return taken.end
    if stop.predicate is not None and stop.predicate(taken.segment.end):
        return End(Outcome.STOPPED_BY_PREDICATE)
    return None
