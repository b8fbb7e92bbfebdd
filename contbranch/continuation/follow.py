"""What is asked of a curve, and one direction of it: predict, correct, judge, look inside the step, accept."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.branching import LeapError
from contbranch.continuation.curve import Curve, End, EventPoint, Fold, Located, Outcome, Point
from contbranch.continuation.edge import Escape, Range, closes, land
from contbranch.continuation.events import Event, Happening
from contbranch.continuation.metric import Balance
from contbranch.continuation.newton import CorrectionError, correct
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import UnresolvedError, size_of
from contbranch.continuation.scan import scan
from contbranch.continuation.segment import Segment
from contbranch.continuation.stability import HopfEvent, Spectrum, with_stability
from contbranch.continuation.step import (
    AFTER_FAILURE,
    FAILED_ERROR_SHARE,
    FORETOLD_CONTRACTION,
    POINTS,
    RECOVERY_FACTOR,
    Predictor,
    judge,
)
from contbranch.continuation.walk import adapted, annotated, examined, to_point, unit_tangent
from contbranch.errors import InputError
from contbranch.watch import INTERRUPTIONS, LATE, Interruption, Watch, caught, watched


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
    """An accepted step, and how long the next one should be in units of it."""

    segment: Segment
    happenings: list[Happening]
    end: End | None
    factor: float


def follow(
    start: Point, balance: Balance, interval: Range, options: Options, events: Sequence[Event], stop: StopAt
) -> Branch:
    """Follow the curve from `start` along its tangent to its end in that direction."""
    return Course(options, events, stop).follow(start, balance, interval)


class Course:
    """The options of a curve: events to locate, limits that end it and the function to call, as in `trace_curve`."""

    def __init__(
        self,
        options: Options | None = None,
        events: Sequence[Event] = (),
        stop: StopAt | None = None,
        callback: Callable[[Point], object] | None = None,
        stability: bool = False,
        time_limit: float | None = None,
        norm_limit: float | None = None,
    ) -> None:
        for name, limit in (("time_limit", time_limit), ("norm_limit", norm_limit)):
            if limit is not None and not limit > 0:
                raise InputError(f"{name} is {limit!r}: give a positive number, or None for no limit.")
        self.options, self.events, self.stop = options or Options(), list(events), stop or StopAt()
        self.spectrum = Spectrum() if stability else None
        if self.spectrum is not None:
            self.events.append(HopfEvent(self.spectrum))
        self.callback, self.time_limit = callback, time_limit
        self.norm_limit = math.inf if norm_limit is None else norm_limit

    def follow(self, start: Point, balance: Balance, interval: Range) -> Branch:
        """Follow the curve from a point along its tangent."""
        return _Direction(start, balance, interval, self).followed()

    def visit(self, point: Point) -> End | None:
        """Tell of a point that was accepted; return the end if the curve is to end there."""
        if self.callback is not None:
            try:
                self.callback(point)
            except Exception as error:
                caught(error)
                raise Interruption from error
        above = self.norm_limit < math.inf and size_of(point.problem, point.x) > self.norm_limit
        return End(Outcome.NORM_LIMIT) if above else None

    def curves(self, compute: Callable[[], list[Curve]]) -> tuple[list[Curve], Watch]:
        """Return the curves that are computed within the time limit, and the watch that hands them over."""
        # Overflow in a trial point is answered by a shorter step; a warning would only alarm.
        with watched(limit=self.time_limit) as watch, np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                found = compute()
            except CorrectionError as error:
                told = error.outcome in (Outcome.NOT_FINITE, Outcome.EVALUATION_FAILED)
                found = [_nothing(End(error.outcome if told else Outcome.START_FAILED, error.detail))]
            except INTERRUPTIONS as error:
                caught(error)
                found = [_nothing(End(Outcome.INTERRUPTED))]
            if self.spectrum is not None:
                found = [with_stability(curve, self.spectrum) for curve in found]
        if watch.reason.startswith(LATE):
            found = [replace(curve, ends=(_late(curve.ends[0]), _late(curve.ends[1]))) for curve in found]
        return found, watch


def _nothing(end: End) -> Curve:
    return Curve((), (), (end, end))


def _late(end: End) -> End:
    return End(Outcome.TIME_LIMIT) if end.outcome is Outcome.INTERRUPTED else end


# Corners that are passed one by one where steps hide what happens.
CORNERS = 4


class _Direction:
    """One direction of a curve, with what has been followed of it.

    The last points, on one discretisation, foretell the next; the first attempt at it is a step of that length.
    """

    def __init__(self, start: Point, balance: Balance, interval: Range, course: Course) -> None:
        options = course.options
        self.start, self.interval, self.course, self.options = start, interval, course, options
        self.branch = Branch([], [], End(Outcome.MAXIMUM_POINTS))
        self.balance = balance.sized(size_of(start.problem, start.x), start.parameter)
        self.metric = self.balance.metric(options.weight, options.state_floor)
        self.recent, self.count, self.reach = [start], 1, math.inf
        self.corners = 0
        self.escape = Escape(interval, options.edge_tolerance)
        self.step = options.first_step * self.metric.norm(start.problem, start.tangent_x, start.tangent_parameter)

    def followed(self) -> Branch:
        """Take steps to the end."""
        for _ in range(self.options.maximum_points):
            try:
                taken = self._take()
                end = self._record(taken)
                if end is None:
                    self._go_on_from(taken)
                    end = self.escape.passed(taken.segment.end, self.balance)
            except CorrectionError as error:
                end = End(error.outcome, error.detail, error.__cause__)
            except (OverflowError, ZeroDivisionError) as error:
                end = End(Outcome.NOT_FINITE, "(Lengths along the curve overflow.)", error)
            except INTERRUPTIONS as error:
                caught(error)
                end = End(Outcome.INTERRUPTED)
            if end is not None:
                return replace(self.branch, end=self.escape.explained(end))
        return replace(self.branch, end=self.escape.explained(self.branch.end))

    def _predictor(self) -> Predictor:
        self.recent[-1] = unit_tangent(self.recent[-1], self.metric)
        return Predictor(self.recent, self.metric)

    def _take(self) -> _Step:
        """Take one step, shortening it until it succeeds; raise the last failure when it has become too short.

        Once, where it leads to what the discretisation does not resolve, it is taken again on one made for that.
        """
        predictor, options, step = self._predictor(), self.options, self.step
        if self.corners or predictor.here.problem.by_corners:
            self.corners = max(self.corners - 1, 0)
            with suppress(CorrectionError):  # a step may do where no corner is found
                return self._to_corner(predictor.here)
        growth, foresee, missed = options.growth, True, 0.0
        failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve turns too sharply.)")
        while True:
            here, metric = predictor.here, predictor.metric
            if here.tangent_parameter != 0.0:
                farthest = min(
                    options.largest_parameter_step * self.interval.width, here.problem.farthest(here.parameter)
                )
                step = min(step, farthest / abs(here.tangent_parameter))
            if not step >= options.smallest_step:
                try:
                    return self._to_corner(here)
                except CorrectionError:
                    raise failure from failure.__cause__
            foretold = predictor.at(step)
            near, end = predictor.chosen(foretold, self.count, 0.5 * options.angle_limit * step), None
            try:
                corrected = correct(here.problem, near, predictor.row, metric, options)
                end = to_point(here.problem, corrected, metric, options.detect_branch_points)
                judgement = judge(here, end, corrected, metric, options)
                constants = predictor.constants(step, foretold, end)
                before = (
                    FAILED_ERROR_SHARE * predictor.error(missed, constants, self.count)
                    if missed
                    else RECOVERY_FACTOR * self.reach
                )
                told = corrected.contraction  # nothing, where Newton's method had next to nothing to do
                self.reach = min(before, corrected.first_correction * FORETOLD_CONTRACTION / told if told else math.inf)
                longest, self.count = predictor.longest(step, constants, growth, self.reach)
                if judgement.accepted:
                    segment, happenings, stop = self._look_inside(
                        Segment(here, examined(end), metric), corrected.bordered
                    )
                    return _Step(segment, happenings, stop, min(judgement.factor, longest, growth))
                step *= judgement.factor
            except CorrectionError as error:
                if foresee and end is not None and isinstance(error.__cause__, UnresolvedError):
                    foresee = False
                    if not self._prepared(end):
                        step *= AFTER_FAILURE
                    predictor = self._predictor()
                    continue
                failure, missed = error, step
                step *= AFTER_FAILURE
            except LeapError as error:
                if error.to_corner:
                    with suppress(CorrectionError):
                        taken = self._to_corner(here)
                        self.corners = CORNERS - 1
                        return taken
                failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(Every step leaps to another part of the curve.)")
                step *= AFTER_FAILURE
            growth = 1.0  # what has failed once is not tried again at once

    def _to_corner(self, here: Point) -> _Step:
        """Go to the next corner of the curve; CorrectionError where it has none."""
        corner = here.problem.corner(here)
        if corner is None:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The next corner of the curve was not found.)")
        before, behind = (examined(unit_tangent(point, self.metric)) for point in corner)
        segment, happenings, end = self._look_inside(Segment(here, before, self.metric), None)
        if end is None:
            turn = Segment(before, behind, self.metric)  # without a length
            happenings += [one for event in self.course.events for one in event.happenings(turn, None, self.options)]
            segment = Segment(here, behind, self.metric)
        return _Step(segment, happenings, end, 1.0)

    def _prepared(self, ahead: Point) -> bool:
        """Whether the last points were carried to a discretisation made for what lies ahead."""
        begin = self.recent[-1]
        try:
            here, carry = adapted(begin, self.metric, self.options, ahead)
        except CorrectionError:
            return False
        if here is begin:
            return False
        if self.branch.points:
            self.branch.points[-1] = here
        else:
            self.branch = replace(self.branch, start=here)
        self._carry(carry, here, self.recent[:-1])
        return True

    def _go_on_from(self, taken: _Step) -> None:
        """Measure lengths anew behind a step, and carry its end to the discretisation that its problem prefers."""
        options, begin, end = self.options, taken.segment.begin, taken.segment.end
        dx, dp = end.x - begin.x, end.parameter - begin.parameter
        self.balance = self.balance.advance(size_of(begin.problem, dx), abs(dp))
        self.balance = self.balance.sized(size_of(end.problem, end.x), end.parameter)
        self.metric = self.balance.metric(options.weight, options.state_floor)
        self.step = taken.factor * self.metric.norm(begin.problem, dx, dp)
        try:
            here, carry = adapted(end, self.metric, options)
        except CorrectionError as error:
            if not isinstance(error.__cause__, UnresolvedError):
                raise
            here = end  # a discretisation that shows less than the present one
        if here is end:
            self.recent = [*self.recent, here][-POINTS:]
        else:
            self.branch.points[-1] = here
            self._carry(carry, here, self.recent)

    def _carry(self, carry: Callable[[Point], Point] | None, here: Point, before: Sequence[Point]) -> None:
        try:
            self.recent = [*(map(carry, before) if carry else ()), here][-POINTS:]
        except CorrectionError:  # earlier points may not have what the new discretisation follows
            self.recent = [here]

    def _look_inside(self, segment: Segment, ahead: Bordered | None) -> tuple[Segment, list[Happening], End | None]:
        """Cut a step where the curve ends, and return what happens in it.

        The curve may also leave the range and come back within the step; then it has a fold outside the range.
        """
        interval, options = self.interval, self.options
        end: End | None = None
        if self.branch.points:  # it has left its start
            closing = closes(segment, self.start, options)
            if closing is not None:
                segment = Segment(segment.begin, closing, segment.metric)
                end = End(Outcome.CLOSED)
        edge = interval.edge_beyond(segment.end.parameter)
        if edge is not None:
            segment = Segment(segment.begin, annotated(land(segment, edge, options), label="edge"), segment.metric)
            end = End(Outcome.REACHED_EDGE)
        last = Segment(self.recent[-2], self.recent[-1], segment.metric) if len(self.recent) > 1 else None
        happenings = scan(segment, self.course.events, options, last, ahead if end is None else None)
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
            if end is not None:  # so close to the edge changes of the parameter are but rounding
                happenings = [h for h in happenings if isinstance(h.event, EventPoint) or not self._at_edge(h.event)]
        return segment, happenings, end

    def _at_edge(self, at: Point | Located) -> bool:
        return self.interval.edge_close_to(at.parameter, self.options.edge_tolerance) is not None

    def _arrives(self, segment: Segment) -> tuple[Segment, End | None]:
        """End the curve where it comes to an edge, or so close to it without crossing that it never will."""
        point = segment.end
        edge = self.interval.edge_close_to(point.parameter, self.options.edge_tolerance)
        leaves = edge is not None and (edge - point.parameter) * point.tangent_parameter < 0
        if edge is None or (leaves and self._at_edge(segment.begin)):
            return segment, None
        if point.parameter == edge:
            return segment, End(Outcome.REACHED_EDGE)
        try:
            landed = land(segment, edge, self.options)
        except CorrectionError:
            return segment, End(Outcome.APPROACHES_EDGE)
        return Segment(segment.begin, annotated(landed, label="edge"), segment.metric), End(Outcome.REACHED_EDGE)

    def _record(self, taken: _Step) -> End | None:
        """Append a step's events and end point to the branch; return the end if a stop condition is met."""
        branch, stop = self.branch, self.course.stop
        for happening in taken.happenings:
            branch.events.append((happening.event, len(branch.points)))
            ended = self._append(happening.event.point)
            if isinstance(happening.event, Fold) and stop.folds == sum(isinstance(e, Fold) for e, _ in branch.events):
                return End(Outcome.STOPPED_AT_FOLD)
            if happening.terminal:
                return End(Outcome.STOPPED_AT_EVENT)
            if ended is not None:
                return ended
        if taken.happenings and taken.happenings[-1].event.point is taken.segment.end:
            return taken.end  # a corner that is an event
        ended = self._append(taken.segment.end)
        if taken.end is not None:
            return taken.end
        if stop.predicate is not None and stop.predicate(taken.segment.end):
            return End(Outcome.STOPPED_BY_PREDICATE)
        return ended

    def _append(self, point: Point) -> End | None:
        self.branch.points.append(point)
        return self.course.visit(point)
