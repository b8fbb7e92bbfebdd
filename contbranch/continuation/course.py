"""What is asked of a curve besides its start and range: what to look for, what ends it, and who is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from contbranch.continuation.curve import Curve, End, Outcome, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.follow import Branch, follow
from contbranch.continuation.metric import Balance
from contbranch.continuation.newton import CorrectionError
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import size_of
from contbranch.continuation.stability import HopfEvent, Spectrum, with_stability
from contbranch.errors import InputError
from contbranch.watch import INTERRUPTIONS, LATE, Interruption, Watch, caught, watched


class Course:
    """Follows curves with the keywords that `trace_curve` documents."""

    def __init__(
        self,
        options: Options | None,
        events: Sequence[Event],
        stop: StopAt | None,
        callback: Callable[[Point], object] | None,
        stability: bool,
        time_limit: float | None,
        norm_limit: float | None,
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
        return follow(start, balance, interval, self.options, self.events, self.stop, self._visit)

    def _visit(self, point: Point) -> End | None:
        if self.callback is not None:
            try:
                self.callback(point)
            except Exception as error:
                caught(error)
                raise Interruption from error
        return End(Outcome.NORM_LIMIT) if size_of(point.problem, point.x) > self.norm_limit else None

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
