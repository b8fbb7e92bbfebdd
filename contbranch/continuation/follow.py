"""One direction of a curve: predict, correct, judge, look inside the step, accept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from contbranch.continuation.curve import End, Fold, Located, Outcome, Point
from contbranch.continuation.edge import Range, closes, land
from contbranch.continuation.events import Event, Happening
from contbranch.continuation.metric import Balance, Metric
from contbranch.continuation.newton import CorrectionError, correct
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import UnresolvedError, size_of
from contbranch.continuation.scan import LeapError, scan
from contbranch.continuation.segment import Segment
from contbranch.continuation.step import AFTER_FAILURE, CONTRACTS, POINTS, Predictor, judge
from contbranch.continuation.walk import adapted, annotated, to_point
from contbranch.watch import INTERRUPTIONS, caught


@dataclass(frozen=True, slots=True)
class Branch:
    """One direction from the start: its points, its events with their index among them, and its end.

    The start as well, where it has been carried to the discretisation on which the first step was taken.
    """

    points: list[Point]
    events: list[tuple[Located, int]]
    end: End
    start: Point | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """An accepted step; how long the next one should be in units of it, and from how many points to predict it."""

    segment: Segment
    happenings: list[Happening]
    end: End | None
    factor: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class _Ahead:
    """Where a step of some length leads, which the discretisation does not resolve."""

    point: Point
    step: float


def follow(
    start: Point,
    balance: Balance,
    interval: Range,
    options: Options,
    events: Sequence[Event],
    stop: StopAt,
) -> Branch:
    """Follow the curve from `start` along its tangent to its end in that direction."""
    return _Direction(start, interval, options, events, stop).followed(balance)


@dataclass(frozen=True, slots=True, eq=False)
class _Direction:
    """One direction of a curve: its start, how far it goes and what is looked for on the way."""

    start: Point
    interval: Range
    options: Options
    events: Sequence[Event]
    stop: StopAt

    def followed(self, balance: Balance) -> Branch:
        """Take steps to the end."""
        options, recent = self.options, [self.start]
        metric = balance.metric(options.weight, options.state_floor)
        step = options.first_step * metric.norm(self.start.problem, self.start.tangent_x, self.start.tangent_parameter)
        branch = Branch([], [], End(Outcome.MAXIMUM_POINTS))
        last: Segment | None = None
        count, foresee = 1, True
        for _ in range(options.maximum_points):
            recent[-1] = _unit(recent[-1], metric)
            try:
                taken = self._take(Predictor(recent, metric), last, step, (count, bool(branch.points), foresee))
                foresee = not isinstance(taken, _Ahead)
                if isinstance(taken, _Ahead):
                    step, begin = taken.step, recent[-1]
                    try:
                        here, carry = adapted(begin, metric, options, taken.point)
                    except CorrectionError:
                        here = begin
                    if here is begin:
                        step *= AFTER_FAILURE
                        continue
                    assert carry is not None
                    if branch.points:
                        branch.points[-1] = here
                    else:
                        branch = replace(branch, start=here)
                    recent = [*map(carry, recent[:-1]), here]
                    last = Segment(recent[-2], here, metric) if len(recent) > 1 else None
                    continue
                end = self._record(branch, taken)
                if end is not None:
                    return replace(branch, end=end)
                begin, here = taken.segment.begin, taken.segment.end
                dx, dp = here.x - begin.x, here.parameter - begin.parameter
                balance = balance.advance(size_of(begin.problem, dx), abs(dp))
                metric = balance.metric(options.weight, options.state_floor)
                step, count = taken.factor * metric.norm(begin.problem, dx, dp), taken.count
                here, carry = adapted(here, metric, options)
            except CorrectionError as error:
                return replace(branch, end=End(error.outcome, error.detail, error.__cause__))
            except INTERRUPTIONS as error:
                caught(error)
                return replace(branch, end=End(Outcome.INTERRUPTED))
            if here is not branch.points[-1]:
                branch.points[-1] = here
                try:
                    recent = [] if carry is None else [carry(point) for point in recent]
                except CorrectionError:  # earlier points may not have what the new one's discretisation follows
                    recent = []
            recent = [*recent, here][-POINTS:]
            last = Segment(recent[-2], here, metric) if len(recent) > 1 else None
        return branch

    def _take(
        self, predictor: Predictor, last: Segment | None, step: float, how: tuple[int, bool, bool]
    ) -> _Step | _Ahead:
        """Take one step, shortening it until it succeeds; raise the last failure when it has become too short.

        How: from how many points it is foretold, whether the curve has left its start, and whether a step that leads to
        what is not resolved is given back.
        """
        count, away, foresee = how
        here, metric, options = predictor.here, predictor.metric, self.options
        growth = options.growth
        if math.isfinite(self.interval.width) and here.tangent_parameter != 0.0:
            step = min(step, options.largest_parameter_step * self.interval.width / abs(here.tangent_parameter))
        failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve turns too sharply.)")
        while step >= options.smallest_step:
            foretold = predictor.at(step)
            near = predictor.chosen(foretold, count, 0.5 * options.angle_limit * step)
            try:
                corrected = correct(here.problem, near, predictor.row, metric, options)
                end = to_point(here.problem, corrected, metric, options.detect_branch_points)
                judgement = judge(here, end, corrected, metric, options)
                largest = corrected.first_correction * CONTRACTS / max(corrected.contraction, 1e-9)
                longest, count = predictor.longest(step, foretold, end, growth, largest)
                if judgement.accepted:
                    segment = Segment(here, annotated(end), metric)
                    segment, happenings, stop = self._look_inside(segment, last, away)
                    return _Step(segment, happenings, stop, min(judgement.factor, longest, growth), count)
                step *= judgement.factor
            except CorrectionError as error:
                if foresee and isinstance(error.__cause__, UnresolvedError):
                    return _Ahead(end, step)
                failure = error
                step *= AFTER_FAILURE
            except LeapError:
                failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(Every step leaps to another part of the curve.)")
                step *= AFTER_FAILURE
            growth = 1.0  # what has failed once is not tried again at once
        raise failure

    def _look_inside(
        self, segment: Segment, last: Segment | None, away: bool
    ) -> tuple[Segment, list[Happening], End | None]:
        """Cut a step where the curve ends, and return what happens in it.

        The curve may also leave the range and come back within the step; then it has a fold outside the range.
        """
        interval, options = self.interval, self.options
        end: End | None = None
        if away:
            closing = closes(segment, self.start, options)
            if closing is not None:
                segment = Segment(segment.begin, closing, segment.metric)
                end = End(Outcome.CLOSED)
        edge = interval.edge_beyond(segment.end.parameter)
        if edge is not None:
            segment = Segment(segment.begin, annotated(land(segment, edge, options), label="edge"), segment.metric)
            end = End(Outcome.REACHED_EDGE)
        happenings = scan(segment, self.events, options, last)
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
            segment, end = self._arrives(segment)
        return segment, happenings, end

    def _arrives(self, segment: Segment) -> tuple[Segment, End | None]:
        """End the curve where it comes to an edge, or so close to it without crossing that it never will."""
        point = segment.end
        edge = self.interval.edge_close_to(point.parameter, self.options.edge_tolerance)
        if edge is None or (edge - point.parameter) * point.tangent_parameter < 0:
            return segment, None
        if point.parameter == edge:
            return segment, End(Outcome.REACHED_EDGE)
        try:
            landed = land(segment, edge, self.options)
        except CorrectionError:
            return segment, End(Outcome.APPROACHES_EDGE)
        return Segment(segment.begin, annotated(landed, label="edge"), segment.metric), End(Outcome.REACHED_EDGE)

    def _record(self, branch: Branch, taken: _Step) -> End | None:
        """Append a step's events and end point to the branch; return the end if a stop condition is met."""
        stop = self.stop
        for happening in taken.happenings:
            branch.events.append((happening.event, len(branch.points)))
            branch.points.append(happening.event.point)
            if isinstance(happening.event, Fold) and stop.folds == sum(isinstance(e, Fold) for e, _ in branch.events):
                return End(Outcome.STOPPED_AT_FOLD)
            if happening.terminal:
                return End(Outcome.STOPPED_AT_EVENT)
        branch.points.append(taken.segment.end)
        if taken.end is not None:
            return taken.end
        if stop.predicate is not None and stop.predicate(taken.segment.end):
            return End(Outcome.STOPPED_BY_PREDICATE)
        return None


def _unit(point: Point, metric: Metric) -> Point:
    """Return the point with its tangent scaled to unit length in the metric of the next step."""
    u, a = metric.unit(point.problem, point.tangent_x, point.tangent_parameter)
    return replace(point, tangent_x=u, tangent_parameter=a)
