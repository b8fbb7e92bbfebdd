"""Events of a curve to the accuracy asked for: located on discretisations made for them, compared with finer ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation import CorrectionError, Event, Options, Point
from contbranch.continuation.bordered import Bordered
from contbranch.continuation.newton import evaluating
from contbranch.continuation.walk import corrected_point, unit_tangent
from contbranch.curve.events import Reached
from contbranch.curve.problem import EquilibriumProblem, Four, Rates, equilibrium, rates_of, values_of
from contbranch.errors import ModelError

__all__ = [
    "OPTIONS", "Found", "at_parameter", "further", "moved", "numbers", "refine", "settled",
    "upright",
]  # fmt: skip

OPTIONS = Options(tolerance=1e-13, noise=1e8, patience=5)
# The finer discretisation has an error of its own, and its event is found to first order only.
SAFETY = 3.0
# Least error estimate as a share of the accuracy: both discretisations may happen to agree.
LEAST_ERROR_SHARE = 0.003
# Discretisations for an event aim at this part of the accuracy, since position adds its own error, in so many rounds.
RESOLVING_SHARE, RESOLVING_ROUNDS = 0.25, 3
# Times that a discretisation is replaced by its finer one, and the number of unknowns at which that ends.
ROUNDS, LARGEST = 7, 2200
# A finer one that leaves more than this share of the error has not helped.
GAIN = 0.3
# The parameter itself is the coordinate along the curve where it makes up this share of the tangent's length.
UPRIGHT_COSINE = 0.3
# Secant steps towards an event, and the longest of them, in units of the line.
ITERATIONS, LONGEST = 14, 0.2
# First secant step, in units of the line.
FIRST_STEP = 1e-5
# An event is located to this share of the accuracy.
ENOUGH = 1e-4


@dataclass(frozen=True)
class Found:
    """An event, or a state asked for: load, displacement, contact radius, central gap, their errors, and the point.

    The error of the point's own parameter is known where that was compared with a finer discretisation's.
    """

    numbers: Four
    error: Four
    point: Point
    parameter_error: float = 0.0

    def relative_error(self) -> float:
        """Largest error relative to max(1, |value|)."""
        return float(np.max(np.array(self.error) / np.maximum(1.0, np.abs(self.numbers))))


@dataclass(frozen=True)
class _Place:
    """A point near an event, the derivative of the event along the curve, and how far away the event may be.

    Both are in lengths of the point's own tangent, which another discretisation takes over.
    """

    point: Point
    steepness: float = 0.0
    uncertainty: float = 0.0


def numbers(point: Point) -> Four:
    """Load, displacement, contact radius and central gap of a point."""
    return values_of(point)[:4]


def moved(point: Point, problem: EquilibriumProblem) -> Point:
    """A point carried to another discretisation, not yet a solution there.

    Raises
    ------
    CorrectionError
        If the other cannot be where the point has what it follows.
    """
    old = equilibrium(point)
    if old is problem:
        return point
    with evaluating(point.parameter):
        x, tangent = (old.carried(one, point.x, point.parameter, problem) for one in (point.x, point.tangent_x))
    return replace(point, problem=problem, x=x, tangent_x=tangent, observables={})


def upright(point: Point) -> bool:
    """Whether the parameter is a good coordinate along the curve here."""
    metric = equilibrium(point).metric(point.x)
    size = metric.norm(point.problem, point.tangent_x, point.tangent_parameter)
    return abs(point.tangent_parameter) > UPRIGHT_COSINE * size * metric.parameter_scale


def _measured(point: Point) -> Point:
    """A point with a tangent of unit length: a step's metric may be another, and events are rates along tangents."""
    return unit_tangent(point, equilibrium(point).metric(point.x))


def settled(point: Point) -> Point:
    """The equilibrium next to a point: at its parameter where that is a good coordinate, otherwise across the curve.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    return _Line(point).at(0.0, point)


def at_parameter(point: Point) -> Point:
    """The equilibrium at the parameter of a point.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    line = _Line(point)
    line.upright = True
    return line.at(0.0, point)


def further(point: Point, length: float) -> Point:
    """The equilibrium ahead of a point along its tangent: by a change of the parameter where that is a coordinate.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    line = _Line(point)
    line.upright |= line.problem.ordered
    return line.at(math.copysign(1.0, point.tangent_parameter) * length if line.upright else length, point)


class _Line:
    """A coordinate along the curve through a point: the parameter where that serves, otherwise the arclength."""

    def __init__(self, point: Point) -> None:
        problem = equilibrium(point)
        self.problem, self.metric = problem, problem.metric(point.x)
        size = self.metric.norm(problem, point.tangent_x, point.tangent_parameter)
        self.direction = point.tangent_x / size, point.tangent_parameter / size
        self.upright = upright(point)
        self.origin = point
        self.matrix: Bordered | None = None
        # Places next to the edge of a representation matter relative to their distance from it.
        self.unit = self.metric.parameter_scale if self.upright else 1.0
        pace = 1.0 if self.upright else max(abs(self.direction[1]), float(np.finfo(float).tiny))
        for edge in problem.parameter_range:
            if edge != point.parameter:
                self.unit = min(self.unit, abs(point.parameter - edge) / pace)

    def speed(self, point: Point) -> float:
        """Length of the point's own tangent per unit of the coordinate."""
        if self.upright:
            return 1.0 / point.tangent_parameter
        return 1.0 / self.metric.dot(self.problem, point.tangent_x, point.tangent_parameter, *self.direction)

    def at(self, place: float, near: Point, from_place: float = 0.0) -> Point:
        """The point of the curve at a coordinate, predicted from a point of known coordinate."""
        ahead = (place - from_place) * self.speed(near)
        x, p = near.x + ahead * near.tangent_x, near.parameter + ahead * near.tangent_parameter
        direction = self.direction
        if self.upright:
            p = self.origin.parameter + place
            direction = np.zeros_like(x), math.copysign(1.0, self.origin.tangent_parameter)
        point, self.matrix = corrected_point(self.problem, (x, p), direction, self.metric, OPTIONS, self.matrix)
        return replace(point, parameter=p) if self.upright else point

    def rates(self, point: Point) -> Rates:
        """Rates of the observables per unit of the coordinate."""
        own = self.problem.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        speed = self.speed(point)
        return Rates(*(rate * speed for rate in own))


def _located(place: _Place, event: Event | None, accuracy: float, problem: EquilibriumProblem | None = None) -> _Place:
    """The zero of the event function near a place, by secants; without an event the place at its own parameter.

    The event is located on the problem of the place unless another one is given.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    point = moved(place.point, problem or equilibrium(place.point))
    if event is None:
        return _Place(at_parameter(point))
    line = _Line(point)
    steepness = place.steepness * line.speed(point)
    if point is not place.point:
        point = line.at(0.0, point)
    enough = ENOUGH * accuracy if line.problem.size > 1 else 0.0  # what is not discretised has all its digits
    least = max(line.problem.rounding, enough) * line.unit
    s, left = 0.0, event.value(point)
    if isinstance(event, Reached):
        steepness = event.rate(line.rates(point))
    step = -left / steepness if steepness else FIRST_STEP * line.unit
    best = left, point
    for _ in range(ITERATIONS):
        step = math.copysign(min(abs(step), LONGEST * line.unit), step)
        if not abs(step) > least:
            break
        point = line.at(s + step, point, s)
        before, left = left, event.value(point)
        best = min(best, (left, point), key=lambda one: abs(one[0]))
        s, steepness = s + step, (left - before) / step
        step = -left / steepness if steepness else 0.0
    left, point = best
    uncertainty = min((abs(left) + event.noise) / abs(steepness), 1e-3 * line.unit) if steepness else 0.0
    speed = line.speed(point)
    return _Place(point, steepness / speed, uncertainty * abs(speed))


def refine(point: Point, event: Event | None, accuracy: float) -> Found:
    """An event with error estimates within the accuracy if they can be had, and the point that gave its values.

    The estimate is the difference to the same event on the finer discretisation. The values are those of the coarser
    one: their error is known, that of the finer one is only known to be smaller. Where the curve cannot be followed on
    a finer one, the estimate is that of one Newton step towards it.

    Parameters
    ----------
    point : Point
        Close to the event.
    event : Event or None
        None: the point at its own parameter.
    accuracy : float
        Error allowed to all four numbers, relative to max(1, |value|).
    """
    found = _refined(point, event, accuracy)
    return _held(found, event) if isinstance(event, Reached) else found


def _held(found: Found, event: Reached) -> Found:
    """With what a value that is held, but read off with what is left out, or rounded, leaves open of the others."""
    point, problem = found.point, equilibrium(found.point)
    missed = event.left_out(point) + problem.rounding * max(1.0, abs(event.target))
    if missed == 0.0:
        return found
    rates = rates_of(point)
    steepness = abs(event.rate(rates)) or math.inf
    held = "contact_radius" if event.control is None else event.control.kind
    load, displacement, radius, gap = (
        e if name == held or value == 0.0 else e + missed * abs(rate) / steepness
        for name, e, rate, value in zip(rates._fields, found.error, rates, found.numbers, strict=True)
    )
    return replace(found, error=(load, displacement, radius, gap))


def _refined(point: Point, event: Event | None, accuracy: float) -> Found:
    point, best = _measured(point), None
    stated = equilibrium(point).stated(point, event)
    if stated is not None:
        return Found(numbers(point), stated, point)
    for place in _places(point, event, accuracy):
        found = _best(place, event, accuracy)
        if found is not None and (best is None or found.relative_error() < best.relative_error()):
            best = found
        if best is not None and best.relative_error() <= accuracy:
            break
    return best or by_defect(point, located=event is None)


def _places(point: Point, event: Event | None, accuracy: float) -> Iterator[_Place]:
    """Where to begin: on discretisations made for the event, and on the point's own, which may turn out better."""
    own = equilibrium(point)
    if own.moves:  # what resolves the event itself would not resolve the way to it
        with suppress(CorrectionError, ModelError):  # the whole that moves serves as well
            point = _located(_Place(point), event, accuracy).point
            yield _located(_Place(point), event, accuracy, own.close_to(point))
        yield _Place(point)
    aimed = point
    try:
        for _ in range(RESOLVING_ROUNDS):
            problem = equilibrium(aimed).resolving(aimed, RESOLVING_SHARE * accuracy)
            if problem is aimed.problem:
                break
            carried = moved(aimed, problem)
            aimed = at_parameter(carried) if event is None else settled(carried)
    except (CorrectionError, ModelError):
        aimed = point
    if aimed is not point:
        yield _Place(aimed)
    if not own.moves:
        yield _Place(point)


def _best(place: _Place, event: Event | None, accuracy: float) -> Found | None:
    """The event on a discretisation and ever finer ones, until the estimate satisfies; None if not found.

    Where solutions are made of pieces, or higher order has not helped, the comparison is also with a discretisation of
    other edges: two with the same edges may agree by chance.
    """
    best: Found | None = None
    last, rough = math.inf, False
    try:
        place = _located(place, event, accuracy)
    except (CorrectionError, ModelError):
        return None
    try:
        for _ in range(ROUNDS):
            problem = equilibrium(place.point)
            doubled = problem.doubled() if rough or problem.pieced else problem
            others = [other for other in (problem.finer(), doubled) if other is not problem]
            fine = [_located(place, event, accuracy, other) for other in others]
            found = _compared(place, fine, accuracy)
            if not fine:
                return found
            error = found.relative_error()
            if best is None or error < best.relative_error():
                best = found
            if error <= accuracy or others[0].size > LARGEST or not problem.refinable:
                break
            rough |= error > GAIN * last
            last = error
            place = fine[0] if not rough else _located(place, event, accuracy, problem.doubled())
    except (CorrectionError, ModelError):
        # What has been reached stands, with its own error estimate.
        return best or by_defect(place.point)
    return best


def _compared(place: _Place, finer: Sequence[_Place], accuracy: float) -> Found:
    """The event with error estimates, by those on finer discretisations, if there are any."""
    point, here, there = place.point, numbers(place.point), [numbers(one.point) for one in finer]
    problem, moves = equilibrium(point), rates_of(point)
    floor = problem.rounding + (LEAST_ERROR_SHARE * accuracy if finer else 0.0)
    uncertainty = max(one.uncertainty for one in (place, *finer))
    off = np.max(np.abs(np.subtract([here, *there], here)), axis=0)

    def error(a: float, off: float, rate: float, besides: float = 0.0) -> float:
        unsettled = 2 * abs(rate) * uncertainty if uncertainty else 0.0  # what rounding leaves open
        return SAFETY * off + floor * max(1.0, abs(a)) + unsettled + besides

    left_out = problem.left_out(point.x, point.parameter)
    load, displacement, radius, gap = (
        # What is zero by its nature has no error: the radius without contact, the gap in contact, the load far away.
        0.0 if a == change == 0.0 else error(a, float(change), rate, besides)
        for a, change, rate, besides in zip(here, off, moves, left_out, strict=True)
    )
    missed = max((abs(point.parameter - one.point.parameter) for one in finer), default=0.0)
    parameter = error(point.parameter, missed, point.tangent_parameter)
    return Found(here, (load, displacement, radius, gap), point, parameter)


def by_defect(point: Point, located: bool = True) -> Found:
    """The point with the error estimates of one Newton step, where a finer discretisation could not be followed.

    An event that is not `located` on the point's discretisation may be anywhere.
    """
    point = _measured(point)
    problem = equilibrium(point)
    defect, here, moves = problem.defect(point), numbers(point), rates_of(point)
    along = abs(defect.state) / (float(np.abs(point.tangent_x).max()) or math.inf) if located else math.inf
    load, displacement, radius, gap = (
        2 * SAFETY * abs(e) + problem.rounding * max(1.0, abs(v)) + (2 * abs(rate) * along if rate else 0.0)
        for e, v, rate in zip((*defect[:2], 0.0, 0.0), here, moves, strict=True)
    )
    return Found(here, (load, displacement, radius, gap), point)
