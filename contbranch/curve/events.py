"""What happens along a curve of equilibria: folds of every control, values reached, representations that end."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import Event, EventPoint, Happening, Options, Point, Segment
from contbranch.continuation.branching import LeapError
from contbranch.continuation.walk import annotated
from contbranch.continuation.zeros import NEIGHBOURS, Bracket, Functions, Search
from contbranch.control import LOAD, Control
from contbranch.curve.angle import in_passing, short_way
from contbranch.curve.problem import Rates, equilibrium, rates_of, values_of

__all__ = ["NEGATIVE", "Ceiling", "FoldEvent", "Folds", "Margin", "Reached", "Slopes", "rates"]

# Share of a step in which rounding of load and displacement hides their folds.
SHORTEST_PART = 2.0**-12
# Width, relative to its place in the step, to which a fold is located.
ROUNDOFF = 4.0 * float(np.finfo(float).eps)
# Slopes at the ends of a step over corners differ from the mean one by no more than this factor where no folds hide; so
# many corners are passed one by one where they may.
STEEPEST_RATIO, FEW_CORNERS = 3.0, 24
# Margins may be below zero by less than this: a piece may begin a little before its layout is right.
NEGATIVE = 2e-3


def rates(point: Point) -> tuple[float, float]:
    """Rates of load and displacement along the unit tangent."""
    return rates_of(point)[:2]


class Slopes:
    """Rates of the observables along unit tangents, found once for every state of a curve."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[Point, Rates]] = {}

    def __call__(self, point: Point) -> Rates:
        """The rates at a point."""
        state = id(point.x), id(point.problem)
        if state not in self._known:
            self._known[state] = point, rates_of(point)
        known, found = self._known[state]
        if known.tangent_x is point.tangent_x:
            return found
        inner = point.problem.inner  # the tangent is scaled anew with every step
        along = inner(known.tangent_x, point.tangent_x) + known.tangent_parameter * point.tangent_parameter
        factor = along / (inner(known.tangent_x, known.tangent_x) + known.tangent_parameter**2)
        return Rates(*(rate * factor for rate in found))


@dataclass(frozen=True)
class FoldEvent(Event):
    """Extrema of what is controlled along the curve, from the true tangent."""

    control: Control = LOAD

    @property
    def name(self) -> str:  # type: ignore[override]
        """The kind of the control."""
        return self.control.kind

    def value(self, point: Point) -> float:
        """The rate of what is controlled along the unit tangent; where a law has kinks, relative to all observables'.

        Where a kink begins to be felt, the motion of the mesh takes all of the tangent, along which all rates vanish.
        """
        found = rates_of(point)
        rate = self.control.weighted(*found[:2])
        if not equilibrium(point).kinked:
            return rate
        own = values_of(point)
        size = math.hypot(found.load / max(1.0, abs(own.load)), found.displacement / max(1.0, abs(own.displacement)))
        return rate / max(math.hypot(size, found.contact_radius, found.central_gap), float(np.finfo(float).tiny))


@dataclass(frozen=True)
class Reached(Event):
    """A control, or without control the contact radius, reaches a value.

    Attributes
    ----------
    control : Control or None
        Reduced units.
    target : float
        Value of ``control.weighted(load, displacement)``, or of the radius.
    """

    control: Control | None
    target: float
    name: str = "reached"
    terminal: bool = False
    hidden_pairs: ClassVar[bool] = False
    relative_resolution: ClassVar[float] = 1e-9

    def value(self, point: Point) -> float:
        """What is controlled minus its target; of radii by their squares, which grow evenly from first touch on."""
        values = values_of(point)
        if self.control is None:
            away = values.contact_radius - self.target
            return away * (values.contact_radius + self.target) / (2.0 * self.target) if self.target else away
        return self.control.weighted(values.load, values.displacement) - self.target

    def rate(self, rates: Rates) -> float:
        """The derivative of the value next to the target where the observables have these."""
        return rates.contact_radius if self.control is None else self.control.weighted(rates.load, rates.displacement)

    def left_out(self, point: Point) -> float:
        """How far what is controlled may be off by what finer discretisations leave out, too."""
        load, displacement, radius, _ = equilibrium(point).left_out(point.x, point.parameter)
        return radius if self.control is None else self.control.weighted(load, displacement)


class Ceiling(Event):
    """The end of a trace: in contact, or in a film that stays, a control comes up to a value, which events may raise.

    Parameters
    ----------
    control : Control or None
        None: the contact radius.
    target : float
        As for `Reached`.
    """

    name = "end"
    terminal = True
    hidden_pairs = False
    relative_resolution = 1e-9

    def __init__(self, control: Control | None, target: float) -> None:
        self.control, self.target = control, target

    def value(self, point: Point) -> float:
        """What is controlled minus its target."""
        own = point.observables or values_of(point)._asdict()
        if self.control is None:
            return own["contact_radius"] - self.target
        return self.control.weighted(own["load"], own["displacement"]) - self.target

    def counts(self, point: Point) -> bool:
        """Whether a curve may end there: in contact, within the law's core, or in a film that stays."""
        own, problem = point.observables, equilibrium(point)
        return own["contact_radius"] > 0.0 or own["central_gap"] < problem.contact_gap or problem.endures(point)

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """The first passage from below, in contact; beyond the value already, where it rises."""
        begin, end = segment.begin, segment.end
        if self.value(end) < 0.0 or not self.counts(end):
            return []
        if self.value(begin) < 0.0:
            return super().happenings(segment, previous, options)[:1]
        rises = Reached(self.control, self.target).rate(rates_of(end)) > 0.0
        return [Happening(1.0, EventPoint(end, 0.0, 0.0, name=self.name), terminal=True)] if rises else []


@dataclass(frozen=True)
class Margin(Event):
    """The representation of the equilibria ends: one of the problem's margins vanishes."""

    name: str
    terminal: bool = True
    hidden_pairs: ClassVar[bool] = False
    relative_resolution: ClassVar[float] = 1e-10

    def value(self, point: Point) -> float:
        """The margin."""
        return equilibrium(point).margin(point.x, point.parameter, self.name)

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """Where it vanishes; at once where it has been negative for a whole step, on a discretisation that shows it."""
        found = super().happenings(segment, previous, options)
        if found or max(self.value(segment.begin), self.value(segment.end)) > -NEGATIVE:
            return found
        return [Happening(1.0, EventPoint(segment.end, 0.0, 0.0, name=self.name), terminal=True)]


class Folds(Event):
    """The folds of all controls within a step, in the order in which the direction of (d', F') passes theirs.

    Parameters
    ----------
    controls : sequence of Control
    told : callable
        Called with every fold found.
    slopes : Slopes
    """

    name = "fold"

    def __init__(self, controls: Sequence[Control], told: Callable[[Point], None], slopes: Slopes) -> None:
        self.controls, self.told, self.slopes = controls, told, slopes
        self._past: list[Point] = []

    def value(self, point: Point) -> float:
        """The rate of the first control."""
        return float(self._along(point)[0])

    def _along(self, point: Point) -> Array:
        return np.array([control.weighted(*self.slopes(point)[:2]) for control in self.controls])

    def _held(self, point: Point) -> Array:
        own = point.observables or values_of(point)._asdict()
        return np.array([control.weighted(own["load"], own["displacement"]) for control in self.controls])

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """Every fold in the step once."""
        if not self.controls:
            return []
        if segment.length == 0.0:
            return self._in_corner(segment)
        problem = equilibrium(segment.begin)
        functions = Functions(self._along, options, self._held, problem.power, SHORTEST_PART)
        if not segment.begin.problem.ordered:
            self._past = [] if previous is None else [previous.begin]
        search = Search(segment, functions, self._past)
        if problem.cornered:
            self._refuse_hidden(segment, problem.corners_between(segment.begin, segment.end))
        brackets = search.crossed() if problem.cornered else search.brackets()
        found = [self._located(segment, functions, bracket) for bracket in brackets]
        self._past = search.points[-1 - NEIGHBOURS :]
        found.sort(key=lambda happening: happening.theta)
        for happening in found:
            self.told(happening.event.point)
        return found

    def _refuse_hidden(self, segment: Segment, corners: int) -> None:
        """See that the slopes at the ends of a step leave no room for a pair of folds at the corners in between.

        Raises
        ------
        LeapError
            If one may be hidden, as slopes that differ from the mean one by more than a factor say.
        """
        if not corners:
            return
        begin, end = segment.begin, segment.end
        mean = self._held(end) - self._held(begin)
        slopes = np.array([self._along(begin) * segment.scale_begin, self._along(end) * segment.scale_end])
        agree = (slopes * mean >= mean**2 / STEEPEST_RATIO) & (slopes * mean <= mean**2 * STEEPEST_RATIO)
        if ((slopes[0] * slopes[1] > 0.0) & ~agree.all(axis=0)).any():
            raise LeapError(to_corner=corners <= FEW_CORNERS)

    def _in_corner(self, corner: Segment) -> list[Happening]:
        """The folds in a corner, as the direction turns there on the shorter way."""
        ways = [math.atan2(*self.slopes(point)[:2]) for point in (corner.begin, corner.end)]
        passed = in_passing(self.controls, ways[0], short_way(ways[1] - ways[0]))
        points = [*(replace(corner.end) for _ in passed[1:]), corner.end][: len(passed)]
        for point in points:
            self.told(point)
        events = (EventPoint(point, 0.0, 0.0, name=one.kind) for point, one in zip(points, passed, strict=True))
        return [Happening(1.0, event) for event in events]

    def _located(self, segment: Segment, functions: Functions, bracket: Bracket) -> Happening:
        """The fold in a bracket, located to rounding, or to what the problem's own solutions tell."""
        resolution = equilibrium(bracket.segment.begin).fold_resolution
        control, (theta, point) = self.controls[bracket.number], functions.zero(bracket, resolution, ROUNDOFF)
        theta = segment.foot(point.x, point.parameter, bracket.whole(theta))
        point = annotated(replace(point, observables={}), label=control.kind)
        return Happening(theta, EventPoint(point, 0.0, 0.0, name=control.kind))
