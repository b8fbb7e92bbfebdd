"""Functions along a curve whose zeros a user wants located."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from contbranch.continuation.curve import EventPoint, Located, Point
from contbranch.continuation.newton import CorrectionError
from contbranch.continuation.options import Options
from contbranch.continuation.outcomes import Outcome
from contbranch.continuation.probe import Bracket, Probe
from contbranch.continuation.problem import Array
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import annotated, point_on

__all__ = ["Crossing", "Event", "Extremum", "Happening", "TangentCrossing", "zeros"]

# Where a step that begins on a zero is taken to begin.
BEYOND = 1e-6

_CUBE_ROOT_OF_ROUNDING = 6e-6


@dataclass(frozen=True, slots=True, eq=False)
class Happening:
    """A located event, its position θ within the step, and whether the curve is to end there."""

    theta: float
    event: Located
    terminal: bool = False


class Event(ABC):
    """A number along the curve; its zeros are the event.

    Attributes
    ----------
    name : str
        Name of the located points.
    terminal : bool
        Whether the curve is to end at the first zero.
    hidden_pairs : bool
        Whether two zeros within one step are looked for, too. Without, a step whose ends have values of the same sign
        costs nothing more.
    resolution : float
        Share of the step to which zeros are located; the default is machine precision.
    relative_resolution : float
        The same relative to the position in the step, so that zeros right behind its start are still told from it.
    noise : float
        What a value leaves undecided, where it does not have the digits that rounding would leave.
    """

    name: str = "event"
    terminal: bool = False
    hidden_pairs: ClassVar[bool] = True
    resolution: ClassVar[float] = 1e-15
    relative_resolution: ClassVar[float] = 0.0
    noise: ClassVar[float] = 0.0

    @abstractmethod
    def value(self, point: Point) -> float:
        """Return the number at a point of the curve; `point` has problem, x, parameter and the unit tangent."""

    def primitive(self, point: Point) -> float | None:
        """Return a quantity whose derivative along the unit tangent is `value`, or None (the default).

        With it, pairs of zeros within a step are excluded from what is known at its ends, without evaluations inside.
        """
        return None

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """Return what happens within one accepted step, in order along it.

        Default: the zeros of `value`, told by its signs at both ends and, with `hidden_pairs`, by what the cubic
        through them leaves room for. An event that knows its own zeros better (a count, an angle, a sum over parts)
        overrides this; points inside the step come from `walk.point_on(segment, theta, options)`.

        Parameters
        ----------
        segment : Segment
            The step, both ends corrected; positions θ run from 0 to 1.
        previous : Segment or None
            The step before on the same discretisation, if there is one.
        options : Options
            Settings of the trace.

        Returns
        -------
        list of Happening
            Position in the step, located event (an `EventPoint`, or any `Located`), and whether the curve ends there.
        """
        return zeros(self, segment, previous, options)


@dataclass(frozen=True)
class Crossing(Event):
    """Zeros of a function of state and parameter, function(x, p)."""

    function: Callable[[Array, float], float]
    name: str = "crossing"
    terminal: bool = False

    def value(self, point: Point) -> float:
        """Return function(x, p)."""
        return float(self.function(point.x, point.parameter))


@dataclass(frozen=True)
class TangentCrossing(Event):
    """Zeros of a function of state, parameter and unit tangent, function(x, p, tangent_x, tangent_p)."""

    function: Callable[[Array, float, Array, float], float]
    name: str = "crossing"
    terminal: bool = False

    def value(self, point: Point) -> float:
        """Return function(x, p, tangent_x, tangent_p)."""
        return float(self.function(point.x, point.parameter, point.tangent_x, point.tangent_parameter))


@dataclass(frozen=True)
class Extremum(Event):
    """Extrema of one of the problem's observables along the curve.

    The derivative along the curve is a central difference along the true tangent, so the position is good to about
    1e-10 and the extreme value to rounding. Where the observable is a component of x, a `TangentCrossing` on that
    component of the tangent is exact and costs nothing.
    """

    observable: str
    name: str = ""
    terminal: bool = False

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", f"extremum of {self.observable}")

    def value(self, point: Point) -> float:
        """Return the derivative of the observable along the unit tangent."""
        problem = point.problem
        size = math.sqrt(problem.inner(point.x, point.x) + point.parameter**2)
        slope = math.sqrt(problem.inner(point.tangent_x, point.tangent_x) + point.tangent_parameter**2)
        step = _CUBE_ROOT_OF_ROUNDING * max(size, slope) / slope
        dx, dp = step * point.tangent_x, step * point.tangent_parameter
        above = problem.observables(point.x + dx, point.parameter + dp)[self.observable]
        below = problem.observables(point.x - dx, point.parameter - dp)[self.observable]
        return (above - below) / (2 * step)


def zeros(event: Event, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
    """Return the zeros of an event's value inside the step, in order."""
    primitive = None if event.primitive(segment.begin) is None else event.primitive
    probe = Probe(partial(_value, event), options, primitive)
    begin, end = probe.at(segment.begin), probe.at(segment.end)
    if begin == 0.0:
        # The zero itself belongs to the step before.
        begin = probe.known[segment.begin] = probe.value(point_on(segment, BEYOND, options)[0])
        if begin == 0.0:
            return []  # it vanishes along this part of the curve
    if event.hidden_pairs:
        parts = probe.brackets(segment, previous)
    else:
        guess = begin / (begin - end) if begin != end else 0.5
        parts = [Bracket(segment, (0.0, begin), (1.0, end), guess)] if end == 0.0 or (begin > 0) != (end > 0) else []
    found = []
    for bracket in parts:
        part, first, last = bracket.segment, bracket.first, bracket.last
        theta, point = probe.zero(bracket, event.resolution, event.relative_resolution)
        steepness = abs(last[1] - first[1])
        miss = abs(probe.at(point)) / steepness + event.resolution + event.relative_resolution * theta
        change = part.end.x - part.begin.x
        located = EventPoint(
            annotated(point, label=event.name),
            4 * miss * abs(part.end.parameter - part.begin.parameter) + 1e-15 * abs(point.parameter),
            4 * miss * math.sqrt(point.problem.inner(change, change)),
            name=event.name,
        )
        found.append(Happening(bracket.whole(theta), located, event.terminal))
    return found


def _value(event: Event, point: Point) -> float:
    try:
        value = float(event.value(point))
    except Exception as error:  # the user's code ends the attempt, its text is kept
        detail = f"({type(error).__name__} in event {event.name!r} at parameter {point.parameter:.6g}: {error})"
        raise CorrectionError(Outcome.EVALUATION_FAILED, detail) from error
    if not math.isfinite(value):
        raise CorrectionError(Outcome.NOT_FINITE, f"(Event {event.name!r} at parameter {point.parameter:.6g}.)")
    return value
