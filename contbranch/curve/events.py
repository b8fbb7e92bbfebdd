"""What happens along a curve of equilibria: folds of every control, values reached, representations that end."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

from contbranch.continuation import Event, EventPoint, Happening, Options, Point, Segment, find_root
from contbranch.continuation.probe import SAFETY, doubt_about, slope_keeps_sign
from contbranch.continuation.walk import annotated, point_on
from contbranch.control import LOAD, Control
from contbranch.curve.angle import AMBIGUOUS, in_passing, short_way
from contbranch.curve.problem import equilibrium

__all__ = ["Ceiling", "FoldEvent", "Folds", "Margin", "Reached", "rates"]

# Relative to their place in a step, folds are located so coarsely while tracing (they are refined afterwards); where
# there are several on one part of a step, as sharply as it takes to tell them apart, down to the last.
SHARPER = (3e-3, 1e-3, 1e-5, 1e-7, 1e-10)
# Error of a cubic's slope, as a share of its largest value, where no earlier step tells.
UNTESTED = 0.1
# A quadratic slope of opposite signs at its ends has one zero, unless its error is this share of its values.
CERTAIN = 0.3
# ... or its steepness at the zero is not so much larger than the error: then three zeros may lie there.
STEEP = 6.0
# A cubic's error is θ² (1 − θ)² times a constant, first of all: the largest error of its slope in units of its error in
# the middle, where that of the slope vanishes.
QUARTIC = 16 * math.sqrt(3) / 9
# How often a step is halved in search of hidden pairs of folds.
DEPTH = 6


def rates(point: Point) -> tuple[float, float]:
    """Rates of load and displacement along the unit tangent."""
    found = equilibrium(point).rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
    return found.load, found.displacement


@dataclass(frozen=True)
class FoldEvent(Event):
    """Extrema of what is controlled along the curve, from the true tangent."""

    control: Control = LOAD

    @property
    def name(self) -> str:  # type: ignore[override]
        """The kind of the control."""
        return self.control.kind

    def value(self, point: Point) -> float:
        """The rate of what is controlled along the unit tangent."""
        return self.control.weighted(*rates(point))


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
        """What is controlled minus its target."""
        values = equilibrium(point).values(point.x, point.parameter)
        if self.control is None:
            return values.contact_radius - self.target
        return self.control.weighted(values.load, values.displacement) - self.target


class Ceiling(Event):
    """The end of a trace: in contact, a control comes up to a value, which events may raise.

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
        own = point.observables
        if not own:
            return Reached(self.control, self.target).value(point)
        if self.control is None:
            return own["contact_radius"] - self.target
        return self.control.weighted(own["load"], own["displacement"]) - self.target

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """The first passage from below, in contact; beyond the value already, where it rises."""
        if segment.end.observables["contact_radius"] == 0.0 or self.value(segment.end) < 0.0:
            return []
        if self.value(segment.begin) < 0.0:
            return super().happenings(segment, previous, options)[:1]
        values = equilibrium(segment.end).rates(
            segment.end.x, segment.end.parameter, segment.end.tangent_x, segment.end.tangent_parameter
        )
        control = self.control
        rate = values.contact_radius if control is None else control.weighted(values.load, values.displacement)
        if rate <= 0.0:
            return []
        return [Happening(1.0, EventPoint(segment.end, 0.0, 0.0, name=self.name), terminal=True)]


@dataclass(frozen=True)
class Margin(Event):
    """The representation of the equilibria ends: one of the problem's margins vanishes."""

    name: str
    terminal: bool = True
    hidden_pairs: ClassVar[bool] = False
    relative_resolution: ClassVar[float] = 1e-3

    def value(self, point: Point) -> float:
        """The margin."""
        return equilibrium(point).margins(point.x, point.parameter)[self.name]


Slopes = dict[str, float]


@dataclass(frozen=True)
class _Passage:
    """One fold on a part of a step, between slopes of opposite sign."""

    control: Control
    part: Segment
    begin: float
    end: float
    offset: float
    share: float
    zero: tuple[float, Point]


class Folds(Event):
    """The folds of all controls within a step, in the order in which the direction of (d', F') passes theirs.

    Parameters
    ----------
    controls : sequence of Control
    told : callable
        Called with every fold found.
    """

    name = "fold"

    def __init__(self, controls: Sequence[Control], told: Callable[[Point], None]) -> None:
        self.controls, self.told = controls, told
        self._known: list[tuple[Point, tuple[float, float]]] = []
        self._signs: dict[str, float] = {}

    def value(self, point: Point) -> float:
        """The rate of the first control."""
        return self.controls[0].weighted(*self._rates(point))

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """Every fold in the step once."""
        doubts: Slopes = {}
        for control in self.controls:
            begin, end = self._slope(segment.begin, control) * segment.scale_begin, self._end_slope(segment, control)
            if previous is None or previous.length == 0.0:
                doubts[control.kind] = UNTESTED * max(abs(begin), abs(end))
            else:
                ratio = segment.length / previous.length
                doubts[control.kind] = doubt_about(self._cubic(segment, control), self._cubic(previous, control), ratio)
        passages = self._passages(segment, doubts, options, DEPTH, 0.0, 1.0)
        found: list[Happening] = []
        for part in dict.fromkeys(id(p.part) for p in passages):
            found += self._located([p for p in passages if id(p.part) == part], options)
        for control in self.controls:
            slope = self._slope(segment.end, control)
            if slope:
                self._signs[control.kind] = slope
        for happening in found:
            self.told(happening.event.point)
        return found

    # -- which folds there are ----------------------------------------------------------------------------------------
    def _rates(self, point: Point) -> tuple[float, float]:
        """Rates along the unit tangent, which is scaled anew with every step."""
        for known, values in self._known:
            if known.x is point.x and known.problem is point.problem:
                own, other = known.tangent_parameter, point.tangent_parameter
                problem = point.problem
                if abs(own) > 1e-12:
                    factor = other / own
                else:
                    factor = problem.inner(point.tangent_x, known.tangent_x) / problem.inner(
                        known.tangent_x, known.tangent_x
                    )
                return values[0] * factor, values[1] * factor
        found = rates(point)
        self._known = [(point, found), *self._known[:5]]
        return found

    def _slope(self, point: Point, control: Control) -> float:
        return control.weighted(*self._rates(point))

    def _end_slope(self, segment: Segment, control: Control) -> float:
        return self._slope(segment.end, control) * segment.scale_end

    def _cubic(self, segment: Segment, control: Control) -> tuple[float, float, float, float]:
        """Coefficients of the cubic in θ through the values of what is controlled, with its slopes, at both ends."""
        a, b = segment.begin.observables, segment.end.observables
        first = control.weighted(a["load"], a["displacement"])
        rise = control.weighted(b["load"], b["displacement"]) - first
        begin, end = self._slope(segment.begin, control) * segment.scale_begin, self._end_slope(segment, control)
        return first, begin, 3 * rise - 2 * begin - end, begin + end - 2 * rise

    def _passages(
        self, part: Segment, doubts: Slopes, options: Options, depth: int, offset: float, share: float
    ) -> list[_Passage]:
        """The folds on a part of a step, at most one of each control on each piece that the part is cut into."""
        found = []
        for control in self.controls:
            cubic, doubt = self._cubic(part, control), doubts[control.kind]
            begin, end = cubic[1], self._end_slope(part, control)
            if offset == 0.0 and begin == 0.0:  # a zero at the end of the step before belongs to this one
                begin = math.copysign(0.0, self._signs.get(control.kind, end))
            if end == 0.0 or (begin == 0.0 and math.copysign(1.0, begin) == math.copysign(1.0, end)):
                continue  # what is controlled rests, or a fold at the very end: the next step has it
            passes = math.copysign(1.0, begin) != math.copysign(1.0, end)
            clear = _passes_once(cubic, doubt) if passes else slope_keeps_sign(cubic, doubt)
            if not clear and depth:
                return self._halves(part, doubts, options, depth, (offset, share))
            if passes:
                found.append(_Passage(control, part, begin, end, offset, share, (0.0, part.begin)))
        found = [replace(passage, zero=self._zero(passage, options, SHARPER[0])) for passage in found]
        if depth:
            sampled = doubts | {p.control.kind: SAFETY * self._error(p) for p in found if p.zero[0]}
            if not all(_passes_once(self._cubic(part, p.control), sampled[p.control.kind]) for p in found):
                return self._halves(part, sampled, options, depth, (offset, share))
        return found

    def _error(self, passage: _Passage) -> float:
        """Largest error of the slope of a cubic, from what it says at the fold that it led to."""
        c0, c1, c2, c3 = self._cubic(passage.part, passage.control)
        theta, point = passage.zero
        load, displacement = equilibrium(point).values(point.x, point.parameter)[:2]
        foretold = c0 + theta * (c1 + theta * (c2 + theta * c3))
        off = passage.control.weighted(load, displacement) - foretold
        turned = c1 + theta * (2 * c2 + theta * 3 * c3)
        one = theta * (1 - theta)
        return QUARTIC / 16 * math.hypot(off, turned) / math.hypot(one * one, 2 * one * (1 - 2 * theta))

    def _halves(
        self, part: Segment, doubts: Slopes, options: Options, depth: int, place: tuple[float, float]
    ) -> list[_Passage]:
        """The folds on both halves of a part."""
        middle = point_on(part, 0.5, options)[0]
        middle = replace(middle, observables=equilibrium(middle).values(middle.x, middle.parameter)._asdict())
        left, right = Segment(part.begin, middle, part.metric), Segment(middle, part.end, part.metric)
        halved: Slopes = {}
        for control in self.controls:
            c0, c1, c2, c3 = self._cubic(part, control)
            own = middle.observables
            off = control.weighted(own["load"], own["displacement"]) - (c0 + c1 / 2 + c2 / 4 + c3 / 8)
            # Slopes per half a part are half as large.
            turned = self._slope(middle, control) * left.scale_end - (c1 + c2 + 0.75 * c3) / 2
            halved[control.kind] = SAFETY * (abs(turned) + QUARTIC * abs(off) / 16) + doubts[control.kind] / 16
        offset, half = place[0], place[1] / 2
        found = self._passages(left, halved, options, depth - 1, offset, half)
        for control in self.controls:
            slope = self._slope(middle, control)
            if slope:
                self._signs[control.kind] = slope
        return found + self._passages(right, halved, options, depth - 1, offset + half, half)

    # -- where they are -----------------------------------------------------------------------------------------------
    def _located(self, passages: list[_Passage], options: Options) -> list[Happening]:
        """Folds of different controls on one part, in order: located as sharply as it takes to tell them apart."""
        for resolution in SHARPER if len(passages) > 1 else SHARPER[:1]:
            coarse = resolution == SHARPER[0]
            found = [(p, *(p.zero if coarse else self._zero(p, options, resolution))) for p in passages]
            found.sort(key=lambda one: one[1])
            thetas = [theta for _, theta, _ in found]
            if all(b - a > 4 * resolution * b for a, b in pairwise(thetas)):
                break
        else:
            order = [control.kind for control in self._turned(passages[0].part)]
            found.sort(key=lambda one: order.index(one[0].control.kind) if one[0].control.kind in order else -1)
            thetas = [sum(thetas) / len(thetas)] * len(found)
        return [
            self._happening(passage, theta, point, resolution)
            for (passage, _, point), theta in zip(found, thetas, strict=True)
        ]

    def _turned(self, part: Segment) -> list[Control]:
        """The controls in the order in which (d', F') passes their folds on a part where places do not tell.

        Where it turns by about half a turn, the Morse indices at both ends say which way.
        """
        (load, displacement), (load_end, displacement_end) = self._rates(part.begin), self._rates(part.end)
        begin = math.atan2(load, displacement)
        turn = short_way(math.atan2(load_end, displacement_end) - begin)
        if abs(turn) > AMBIGUOUS * math.pi / 2:
            first, last = (equilibrium(p).unstable(p.x, p.parameter) for p in (part.begin, part.end))
            if first != last:
                turn = math.copysign(turn, first - last) if abs(turn) > 0 else math.pi
        whole = math.copysign(math.pi * (1 - 1e-12), turn)
        return in_passing(self.controls, begin, whole)

    def _zero(self, passage: _Passage, options: Options, resolution: float) -> tuple[float, Point]:
        """Position of a fold in the part, and the point there."""
        part, control = passage.part, passage.control
        points: dict[float, Point] = {}

        def slope(theta: float) -> float:
            points[theta] = point_on(part, theta, options)[0]
            return control.weighted(*rates(points[theta]))

        begin = passage.begin / part.scale_begin, passage.end / part.scale_end
        _, c1, c2, c3 = self._cubic(part, control)
        first, last = (0.0, begin[0]), (1.0, begin[1])
        if passage.begin == 0.0:
            return 0.0, part.begin
        guess = _zero_of_slope(c1, c2, c3)
        value = slope(guess)
        if abs(value) > resolution * min(abs(begin[0]), abs(begin[1])):
            if (value > 0) == (first[1] > 0):
                first = guess, value
            else:
                last = guess, value
            guess = find_root(slope, first, last, 0.0, resolution)
            if guess not in points:
                slope(guess)
        return guess, points[guess]

    def _happening(self, passage: _Passage, theta: float, point: Point, resolution: float) -> Happening:
        part = passage.part
        point = annotated(replace(point, observables={}), label=passage.control.kind)
        change = part.end.x - part.begin.x
        located = EventPoint(
            point,
            resolution * abs(part.end.parameter - part.begin.parameter),
            resolution * math.sqrt(point.problem.inner(change, change)),
            name=passage.control.kind,
        )
        return Happening(passage.offset + passage.share * theta, located)


def _passes_once(cubic: tuple[float, float, float, float], doubt: float) -> bool:
    """Whether a slope with opposite signs at the ends has one zero, as far as its error tells."""
    _, c1, c2, c3 = cubic
    end = abs(c1 + 2 * c2 + 3 * c3)
    steepness = abs(2 * c2 + 6 * c3 * _zero_of_slope(c1, c2, c3))
    # A pair may hide next to an end whose slope is smaller than the error.
    apart = end > doubt and (abs(c1) > doubt or c1 == 0.0)
    return apart and doubt < CERTAIN * max(abs(c1), end) and steepness > STEEP * doubt


def _zero_of_slope(c1: float, c2: float, c3: float) -> float:
    """The zero in (0, 1) of c1 + 2 c2 θ + 3 c3 θ², which has opposite signs at the ends."""
    root = math.sqrt(max(c2 * c2 - 3 * c1 * c3, 0.0))
    q = -(c2 + math.copysign(root, c2))
    candidates = [q / (3 * c3) if c3 else math.nan, c1 / q if q else math.nan]
    return next((theta for theta in candidates if 0.0 < theta < 1.0), 0.5)
