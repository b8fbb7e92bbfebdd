"""Events of a curve to the accuracy asked for: located on discretisations made for them, compared with finer ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import CorrectionError, Event, Options, Point
from contbranch.continuation.bordered import Bordered
from contbranch.continuation.newton import evaluating
from contbranch.continuation.walk import corrected_point, unit_tangent
from contbranch.curve.events import Reached
from contbranch.curve.problem import EquilibriumProblem, Four, Rates, equilibrium, rates_of, values_of
from contbranch.curve.tolerances import DEFECT_SAFETY
from contbranch.errors import ModelError

__all__ = [
    "OPTIONS", "Found", "at_parameter", "further", "moved", "numbers", "refine", "settled",
    "upright",
]  # fmt: skip

OPTIONS = Options(tolerance=1e-13, noise=1e8, patience=5)
# Least error estimate as a share of the accuracy, since both discretisations may happen to agree.
LEAST_ERROR_SHARE = 0.003
# Discretisations for an event aim at this part of the accuracy, since position adds its own error, in so many rounds.
RESOLVING_SHARE, RESOLVING_ROUNDS = 0.25, 3
# Number of unknowns at which a discretisation is no longer replaced by its finer one.
LARGEST = 2200
# A finer one that leaves more than this share of the error has not helped.
GAIN = 0.3
# Where higher order does not help, panels are halved for this share of the error wanted, in the end all.
HALVED_SHARES = 0.1, 0.0
# An event is located to this share of the accuracy.
ENOUGH = 1e-4
# The parameter itself is the coordinate along the curve where it makes up this share of the tangent's length.
UPRIGHT_COSINE = 0.3
# Secant steps towards an event, and the longest of them, in units of the line.
ITERATIONS, LONGEST = 14, 0.2
# A secant over less than the first step lowers the value at least by this factor, unless what is left is rounding.
LEAST_DECREASE = 0.5
# First secant step, in units of the line; where the curve is not found a longer one is shortened by the second factor.
FIRST_STEP, RETREAT = 1e-5, 0.2


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
    return _Line(point, by_parameter=True).at(0.0, point)


def further(point: Point, length: float) -> Point:
    """The equilibrium ahead of a point along its tangent: by a change of the parameter where that is a coordinate.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    line = _Line(point, by_parameter=equilibrium(point).ordered)
    return line.at(math.copysign(1.0, point.tangent_parameter) * length if line.upright else length, point)


class _Line:
    """A coordinate along the curve through a point: the parameter where that serves, otherwise the arclength."""

    def __init__(self, point: Point, by_parameter: bool = False) -> None:
        problem = equilibrium(point)
        self.problem, self.metric = problem, problem.metric(point.x)
        size = self.metric.norm(problem, point.tangent_x, point.tangent_parameter)
        self.direction = point.tangent_x / size, point.tangent_parameter / size
        self.upright = by_parameter or upright(point)
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
    best, noise = (left, point), event.noise
    for k in range(ITERATIONS):
        step = math.copysign(min(abs(step), LONGEST * line.unit), step)
        if not abs(step) > least:
            break
        try:
            point = line.at(s + step, point, s)
        except CorrectionError:
            step *= RETREAT
            if abs(step) > least:
                continue
            raise
        before, left = left, event.value(point)
        if k > 0 and abs(step) < FIRST_STEP * line.unit and abs(left) > LEAST_DECREASE * abs(best[0]):
            noise = max(noise, abs(left))  # what is left of the value is rounding
            break
        best = min(best, (left, point), key=lambda one: abs(one[0]))
        s, steepness = s + step, (left - before) / step
        step = -left / steepness if steepness else 0.0
    left, point = best
    uncertainty = min((abs(left) + noise) / abs(steepness), 1e-3 * line.unit) if steepness else 0.0
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
    point = _measured(point)
    best: Found | None = None
    stated = equilibrium(point).stated(point, event)
    if stated is not None:
        best = Found(numbers(point), stated, point)
    for place in _places(point, event, accuracy) if best is None else ():
        found = _best(place, event, accuracy)
        if found is not None and (best is None or found.relative_error() < best.relative_error()):
            best = found
        if best is not None and best.relative_error() <= accuracy:
            break
    best = best or by_defect(point, located=event is None)
    return _held(best, event) if isinstance(event, Reached) else best


def _held(found: Found, event: Reached) -> Found:
    """With what a value that is held, but read off with what is left out, or rounded, leaves open of the others."""
    point, problem = found.point, equilibrium(found.point)
    rates = rates_of(point)
    missed = event.left_out(point) + problem.rounding * max(1.0, abs(event.target))
    besides = _along(point, missed / (abs(event.rate(rates)) or math.inf))
    held = "contact_radius" if event.control is None else event.control.kind
    besides[[name == held or value == 0.0 for name, value in zip(rates._fields, found.numbers, strict=True)]] = 0.0
    return replace(found, error=tuple((found.error + besides).tolist()))


def _along(point: Point, length: float) -> Array:
    """By how much load, displacement, contact radius and gap change over a length along the curve."""
    return np.array([abs(rate) * length if rate and length else 0.0 for rate in rates_of(point)])


def _places(point: Point, event: Event | None, accuracy: float) -> Iterator[_Place]:
    """Where to begin: on discretisations made for the event, and on the point's own, which may turn out better."""
    aimed = point
    try:
        for _ in range(RESOLVING_ROUNDS):
            carried = moved(aimed, equilibrium(aimed).resolving(aimed, RESOLVING_SHARE * accuracy))
            if carried is aimed:
                break
            aimed = at_parameter(carried) if event is None else settled(carried)
    except (CorrectionError, ModelError):
        aimed = point
    if aimed is not point:
        yield _Place(aimed)
    yield _Place(point)


def _best(place: _Place, event: Event | None, accuracy: float) -> Found | None:
    """The event on a discretisation and ever finer ones, until the estimate satisfies; None if not found.

    Where solutions are made of pieces, or higher order has not helped, the comparison is also with a discretisation of
    other edges: two with the same edges may agree by chance.
    """
    best: Found | None = None
    last, rough, shares = math.inf, False, iter(HALVED_SHARES)
    try:
        place = _located(place, event, accuracy)
    except (CorrectionError, ModelError):
        return None
    try:
        while True:
            problem = equilibrium(place.point)
            doubled = problem.doubled() if rough or problem.pieced else problem
            others = [other for other in (problem.finer(), doubled) if other is not problem]
            fine = [_located(place, event, accuracy, other) for other in others]
            found = _compared(place, fine, accuracy)
            error = found.relative_error()
            if best is None or error < best.relative_error():
                best = found
            if not fine or error <= accuracy or others[0].size > LARGEST or not problem.refinable:
                return best
            rough |= error > GAIN * last
            last = error
            if not rough:
                place = fine[0]
                continue
            halved = problem.halved(place.point, next(shares) * RESOLVING_SHARE * accuracy / error)
            place = _located(place, event, accuracy, halved)
    except StopIteration:  # what is left is rounding
        return best
    except (CorrectionError, ModelError):
        # What has been reached stands, with its own error estimate.
        return best or by_defect(place.point)


def _compared(place: _Place, finer: Sequence[_Place], accuracy: float) -> Found:
    """The event with error estimates, by those on finer discretisations, if there are any."""
    point, problem = place.point, equilibrium(place.point)
    own = np.array(numbers(point))
    off = np.max([np.abs(np.subtract(numbers(one.point), own)) for one in (place, *finer)], axis=0)
    floor = problem.rounding + (LEAST_ERROR_SHARE * accuracy if finer else 0.0)
    along = 2 * max(one.uncertainty for one in (place, *finer))  # what rounding leaves open
    error = DEFECT_SAFETY * off + floor * np.maximum(1.0, np.abs(own)) + _along(point, along)
    error += problem.left_out(point.x, point.parameter)
    error[(own == 0.0) & (off == 0.0)] = 0.0  # zero by its nature: a radius without contact, a gap in contact
    p = point.parameter
    missed = max((abs(p - one.point.parameter) for one in finer), default=0.0)
    of_parameter = DEFECT_SAFETY * missed + floor * max(1.0, abs(p)) + abs(point.tangent_parameter) * along
    return Found(tuple(own.tolist()), tuple(error.tolist()), point, of_parameter)


def by_defect(point: Point, located: bool = True) -> Found:
    """The point with the error estimates of one Newton step, where a finer discretisation could not be followed.

    An event that is not `located` on the point's discretisation may be anywhere.
    """
    point = _measured(point)
    problem, own = equilibrium(point), numbers(point)
    defect = problem.defect(point)
    along = abs(defect.state) / (float(np.abs(point.tangent_x).max()) or math.inf) if located else math.inf
    error = 2 * DEFECT_SAFETY * np.abs([defect.load, defect.displacement, 0.0, 0.0]) + _along(point, 2 * along)
    return Found(own, tuple((error + problem.rounding * np.maximum(1.0, np.abs(own))).tolist()), point)
