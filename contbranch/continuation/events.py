"""Functions along a curve whose zeros are events."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contbranch.continuation.curve import EventPoint, Located, Outcome, Point
from contbranch.continuation.newton import CorrectionError, evaluating
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import annotated
from contbranch.continuation.zeros import Functions, Search

# A value below this multiple of its error has no sign.
UNSIGNED = 1e2


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
        step = float(np.cbrt(np.finfo(float).eps)) * max(size, slope) / slope
        dx, dp = step * point.tangent_x, step * point.tangent_parameter
        above = problem.observables(point.x + dx, point.parameter + dp)[self.observable]
        below = problem.observables(point.x - dx, point.parameter - dp)[self.observable]
        return (above - below) / (2 * step)


def zeros(event: Event, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
    """Return the zeros of an event's value inside the step, in order."""

    def values(point: Point) -> Array:
        with evaluating(point.parameter, f" in event {event.name!r}"):
            value = float(event.value(point))
        if not math.isfinite(value):
            raise CorrectionError(Outcome.NOT_FINITE, f"(Event {event.name!r} at parameter {point.parameter:.6g}.)")
        return np.array([value])

    def primitives(point: Point) -> Array:
        return np.array([event.primitive(point)], dtype=float)

    known = event.primitive(segment.begin) is not None
    functions = Functions(values, options, primitives if known else None)
    search = Search(segment, functions, [] if previous is None else [previous.begin])
    found = []
    for bracket in search.brackets() if event.hidden_pairs else search.crossed():
        part = bracket.segment
        theta, point = functions.zero(bracket, event.resolution, event.relative_resolution)
        miss = abs(functions.at(point)[0]) / abs(bracket.last - bracket.first)
        miss += event.resolution + event.relative_resolution * theta
        change = part.end.x - part.begin.x
        located = EventPoint(
            annotated(point, label=event.name),
            4 * miss * abs(part.end.parameter - part.begin.parameter) + 1e-15 * abs(point.parameter),
            4 * miss * size_of(point.problem, change),
            name=event.name,
        )
        found.append(Happening(bracket.whole(theta), located, event.terminal))
    return found
