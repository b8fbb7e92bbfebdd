"""Functions along a curve whose zeros are wanted, and the brackets of these zeros within one step.

What a function does inside a step is told by the polynomial through both ends, and how far that can be trusted by the
one that goes through a neighbouring point besides. Where the two leave room for a hidden pair of zeros, points of the
curve itself are computed inside the step.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation.curve import EventPoint, Located, Outcome, Point
from contbranch.continuation.locate import Sample, find_root
from contbranch.continuation.newton import CorrectionError, evaluating
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.step import STEEPEST, Hermite
from contbranch.continuation.walk import Across, annotated, point_on

Value = Callable[[Point], float]

# The better of two polynomials is trusted within this multiple of their difference: eight times that has been seen.
SAFETY = 10.0
# A step in which both differ by more than this share of the largest value has features that neither of them shows.
RESOLVED = 0.01
# Error as a share of the function's values where there is no neighbouring point.
UNTESTED = 0.01
# A value inside that falls below this share of the smaller one of both ends is followed up in any case.
SUSPICIOUS = 0.5
# How often a step is divided in search of hidden zeros, and how many points that may cost.
DEPTH, MOST = 12, 60
# ... and the share of it that is cut off at least.
SIDE = 1e-4
# Where functions are looked at inside a step: the slope of a known quantity costs next to nothing.
CHEAP, DEAR = np.linspace(0.0, 1.0, 11)[1:-1], np.array([0.25, 0.5, 0.75])


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """Two samples of opposite sign on a segment (a step or part of one).

    Attributes
    ----------
    segment : Segment
        The part of the step.
    first, last : (position, value)
        Samples, positions within that part.
    guess : float
        Where the polynomial has its zero.
    offset, share : float
        Position θ in the part is offset + share θ in the whole step.
    """

    segment: Segment
    first: Sample
    last: Sample
    guess: float
    offset: float = 0.0
    share: float = 1.0

    def whole(self, theta: float) -> float:
        """Return the position within the whole step."""
        return self.offset + self.share * theta


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """A function along the curve whose zeros are wanted.

    Attributes
    ----------
    value : callable
        The function at a point of the curve.
    options : Options
        For points computed inside a step.
    primitive : callable, optional
        A quantity whose derivative along the unit tangent is the function.
    known : dict
        Values at points already seen.
    """

    value: Value
    options: Options
    primitive: Callable[[Point], float | None] | None = None
    known: dict[Point, float] = field(default_factory=dict)

    def at(self, point: Point) -> float:
        """Return the function's value at a point."""
        if point not in self.known:
            self.known[point] = self.value(point)
        return self.known[point]

    def brackets(self, segment: Segment, previous: Segment | None) -> list[Bracket]:
        """Return brackets of all zeros inside a step, given the step before on the same discretisation."""
        return self._search(segment, None if previous is None else previous.begin, DEPTH, 0.0, 1.0)

    def zero(
        self, bracket: Bracket, resolution: float, relative: float, across: Across | None = None
    ) -> tuple[float, Point]:
        """Return the position of the zero in a bracket, and the point of the curve there (of those `across`)."""
        seen: dict[float, Point] = {}
        across = across or Across(bracket.segment, bracket.guess, self.options)

        def value(theta: float) -> float:
            seen[theta] = across.at(theta)
            return self.at(seen[theta])

        theta = find_root(value, bracket.first, bracket.last, resolution, relative, bracket.guess)
        if theta not in seen:
            value(theta)
        return theta, seen[theta]

    def _search(self, segment: Segment, third: Point | None, depth: int, offset: float, share: float) -> list[Bracket]:
        if segment.length == 0.0:  # halved to rounding
            return []
        begin, end = self.at(segment.begin), self.at(segment.end)
        inside, doubt = self._inside(segment, third)
        if self.primitive is None and not _resolved(np.array([begin, *inside, end]), doubt):
            inside, doubt = self._computed(segment, begin, end)
        values = math.copysign(1.0, begin) * np.concatenate([[begin], inside, [end]])
        goes_on = depth > 0 and len(self.known) < MOST
        theta = division(values, doubt) if goes_on else None
        if theta is None and values[-1] > 0:
            return []
        if theta is None:
            i = int(np.argmax(values <= 0)) - 1
            if goes_on and not _straight(values, doubt, i):
                theta = (i + 0.5) / (len(values) - 1)
            else:
                guess = (i + values[i] / (values[i] - values[i + 1])) / (len(values) - 1)
                return [Bracket(segment, (0.0, begin), (1.0, end), float(guess), offset, share)]
        point = annotated(point_on(segment, theta, self.options, precise=False)[0])
        if self.at(point) == 0.0:  # a zero belongs to one part alone
            theta += 1e-3 * (1 - theta)
            point = annotated(point_on(segment, theta, self.options, precise=False)[0])
        left, right = Segment(segment.begin, point, segment.metric), Segment(point, segment.end, segment.metric)
        return [
            *self._search(left, segment.end, depth - 1, offset, share * theta),
            *self._search(right, segment.begin, depth - 1, offset + share * theta, share * (1 - theta)),
        ]

    def _inside(self, segment: Segment, third: Point | None) -> tuple[Array, Array]:
        """Return the function's values on the polynomial at even distances inside a segment, and their errors."""
        points, places, along = _seen_from_chord(segment, third)
        if self.primitive is not None:
            thetas: Array = CHEAP
            heights = [self.primitive(point) for point in points]
            rates = [self.at(point) / rate for point, rate in zip(points, along, strict=True)]
            # Back from lengths along the chord to lengths along the curve.
            stretch = (1 - thetas) * along[0] + thetas * along[1]
            found = [slope * stretch for _, slope in Hermite(places, heights, rates).at(thetas * places[1])[1:]]
        else:
            thetas = DEAR
            states = [np.append(point.x, point.parameter) for point in points]
            turns = [np.append(q.tangent_x, q.tangent_parameter) / rate for q, rate in zip(points, along, strict=True)]
            curve = Hermite(places, states, turns)
            rows = [[self.value(_point(segment, *at)) for at in curve.at(theta * places[1])[1:]] for theta in thetas]
            found = list(np.array(rows).T)
        error = (
            np.abs(found[-1] - found[0]) if len(found) > 1 else np.full(len(thetas), UNTESTED * np.abs(found[0]).max())
        )
        return found[-1], error

    def _computed(self, segment: Segment, begin: float, end: float) -> tuple[Array, Array]:
        """The same at points of the curve itself, of which only what they leave open between them is uncertain."""
        a, b, c = (self.at(point_on(segment, theta, self.options, precise=False)[0]) for theta in DEAR)
        by_others = (3 * begin + 6 * b - end) / 8, (4 * (a + c) - begin - end) / 6, (6 * b - begin + 3 * end) / 8
        return np.array([a, b, c]), np.abs(np.array([a, b, c]) - by_others)


def _resolved(values: Array, doubt: Array) -> bool:
    """Whether the errors inside a step leave something of what is seen there."""
    return float(doubt.max()) <= RESOLVED * float(np.abs(values).max())


def clear(values: Array, doubt: Array) -> NDArray[np.bool_]:
    """Return whether functions seen as in `division`, (..., n), are certainly of one sign, as nearly always; (...)."""
    largest, least = doubt.max(axis=-1), np.minimum(values[..., 0], values[..., -1])
    lowest = values.min(axis=-1) - np.maximum(0.0, _bends(values).max(axis=-1)) / 8
    resolved = largest <= RESOLVED * np.abs(values).max(axis=-1)
    return np.asarray(resolved & (lowest > np.maximum(np.maximum(SAFETY * largest, SUSPICIOUS * least), 0.0)))


def _straight(values: Array, doubt: Array, i: int) -> bool:
    """Whether a function seen as in `division` certainly falls all the way from sample i to the next."""
    bend, error = np.pad(np.abs(_bends(values)), 1)[i : i + 2].max(), np.pad(doubt, 1)[i : i + 2].sum()
    return bool(abs(values[i + 1] - values[i]) > bend / 2 + SAFETY * error)


def _bends(values: Array) -> Array:
    """Return the second differences of functions at even distances."""
    return np.asarray(values[..., :-2] - 2 * values[..., 1:-1] + values[..., 2:])


def division(values: Array, doubt: Array) -> float | None:
    """Return where to divide a step, seen at even distances, the first value positive; None if its zeros are certain.

    The errors are those inside the step; at the ends there is none.
    """
    spaces = len(values) - 1
    if not _resolved(values, doubt):
        return 0.5
    if clear(values, doubt):
        return None
    bends = _bends(values)
    crossings = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
    if len(crossings) > 1:
        between = np.arange(crossings[0] + 1, crossings[1] + 1)
        return float(between[np.argmax(np.abs(values[between]))]) / spaces
    # Between two samples the function is a parabola: first + (last - first) t - bend t (1 - t)/2.
    sign = np.ones(spaces)
    if len(crossings):
        sign[crossings[0] :] = -1.0
    first, last = sign * values[:-1], sign * values[1:]
    bend = np.maximum(sign * np.append(bends[0], bends), sign * np.append(bends, bends[-1]))
    bend = np.maximum(bend, np.finfo(float).tiny)
    t = np.clip(0.5 - (last - first) / bend, 0.0, 1.0)
    lowest = first + (last - first) * t - bend * t * (1 - t) / 2
    error = SAFETY * np.concatenate([[0.0], doubt, [0.0]])
    left_over = lowest - error[:-1] * (1 - t) - error[1:] * t
    # A dip far below both ends is followed up in any case.
    dips = (t > 0) & (t < 1) & (lowest < SUSPICIOUS * min(values[0], abs(values[-1])))
    left_over = np.where(dips, np.minimum(left_over, 0.0), left_over)
    left_over[crossings] = np.inf
    i = int(np.argmin(left_over))
    if left_over[i] > 0:
        return None
    return float(np.clip((i + t[i]) / spaces, SIDE, 1 - SIDE))


def _seen_from_chord(segment: Segment, third: Point | None) -> tuple[list[Point], list[float], list[float]]:
    """Return the points of a step and a third one, their places along its chord, and the slopes of these places.

    The third is left out where the curve is no graph over the chord up to there.
    """
    begin, end, metric = segment.begin, segment.end, segment.metric
    problem = begin.problem
    c, d = metric.row(problem, (end.x - begin.x) / segment.length, (end.parameter - begin.parameter) / segment.length)
    points: list[Point] = []
    places: list[float] = []
    along: list[float] = []
    for point in (begin, end) if third is None else (begin, end, third):
        place = float(c @ (point.x - begin.x)) + d * (point.parameter - begin.parameter)
        slope = float(c @ point.tangent_x) + d * point.tangent_parameter
        least = STEEPEST * metric.norm(problem, point.tangent_x, point.tangent_parameter)
        if point is third and (slope < least or 0.0 <= place <= places[1]):
            break
        points.append(point)
        places.append(place)
        along.append(max(slope, least))
    return points, places, along


def _point(segment: Segment, state: Array, direction: Array) -> Point:
    """Return a point off the curve but close to it, with a unit tangent."""
    u, a = segment.metric.unit(segment.begin.problem, direction[:-1], float(direction[-1]))
    return replace(segment.begin, x=state[:-1], parameter=float(state[-1]), tangent_x=u, tangent_parameter=a, label="")


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
            4 * miss * size_of(point.problem, change),
            name=event.name,
        )
        found.append(Happening(bracket.whole(theta), located, event.terminal))
    return found


def _value(event: Event, point: Point) -> float:
    with evaluating(point.parameter, f" in event {event.name!r}"):
        value = float(event.value(point))
    if not math.isfinite(value):
        raise CorrectionError(Outcome.NOT_FINITE, f"(Event {event.name!r} at parameter {point.parameter:.6g}.)")
    return value
