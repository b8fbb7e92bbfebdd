"""Events of the curve to the accuracy asked for: located anew on meshes made for them, and compared with finer ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Event, Metric, Options, Point
from contbranch.continuation.walk import corrected_point

from .near_touch import fold_at_tiny_radius, graded, is_tiny
from .problem import ContactProblem, FoldEvent

__all__ = ["Place", "Values", "locate", "refine"]

Array = NDArray[np.float64]

# The finer mesh has an error of its own, and its event is found to first order only.
SAFETY = 3.0
# Least error estimate as a share of the accuracy: both meshes may happen to agree.
FLOOR = 0.003
# Rounding of a solution, relative to max(1, |value|).
ROUNDING = 4e-14
# An event this close (in u, relative to min(1, |u|)) needs no further iteration.
CLOSE = 1e-4
OPTIONS = Options(tolerance=1e-13, noise=1e8)
# Meshes for an event aim at this part of the accuracy, since position adds its own error, in at most so many rounds.
AIM, REMESHES = 0.25, 3
# Times that a mesh is replaced by its finer one, and the number of unknowns at which that ends.
ROUNDS = 6
LARGEST = 1500
# A finer mesh that leaves more than this share of the error has not helped.
GAIN = 0.1
# One that makes the error so much larger has met round-off.
WORSE = 3.0


@dataclass(frozen=True)
class Place:
    """A point of the curve at which an event function vanishes, on one mesh.

    Attributes
    ----------
    problem, x, u : ContactProblem, array (N,), float
    direction : (array (N,), float)
        Tangent.
    steepness : float or None
        Derivative of the event function with respect to the distance along the curve, in this problem's metric.
    uncertainty : float
        What rounding leaves open of u.
    """

    problem: ContactProblem
    x: Array
    u: float
    direction: tuple[Array, float]
    steepness: float | None = None
    uncertainty: float = 0.0

    def metric(self) -> Metric:
        """Lengths along the curve: the parameter's, and the state relative to itself."""
        return Metric(math.sqrt(self.problem.inner(self.x, self.x)) + self.problem.scale, 1.0)


@dataclass(frozen=True)
class Values:
    """Load, displacement, contact radius and central gap in reduced units, with their error estimates."""

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    error: tuple[float, float, float, float]

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """The four values."""
        return self.load, self.displacement, self.contact_radius, self.central_gap

    def relative_error(self) -> float:
        """Largest error relative to max(1, |value|)."""
        return max(e / max(1.0, abs(v)) for e, v in zip(self.error, self.numbers, strict=True))


def numbers(place: Place) -> tuple[float, float, float, float]:
    """Load, displacement, contact radius and central gap, reduced units."""
    equations = place.problem.equations
    fields = place.problem.fields(place.x, place.u)
    gap = 0.0 if equations.contact else max(0.0, -fields.y)
    return equations.load(fields), equations.displacement(fields), fields.rim.radius, gap


def locate(place: Place, event: Event | None) -> Place:
    """The zero of the event function near a place, by a secant iteration on the curve; u itself stays if event is None.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    problem = place.problem
    if event is None:
        return Place(problem, problem.solve_at(place.x, place.u), place.u, place.direction)
    if isinstance(event, FoldEvent) and is_tiny(problem, place.u):
        return _tiny(problem, place.x, place.u, event)
    metric = place.metric()
    dx, du = place.direction
    size = metric.norm(problem, dx, du)
    dx, du = dx / size, du / size

    def at(s: float, near: Point | None) -> tuple[Point, float]:
        x, u = place.x + s * dx, place.u + s * du
        if near is not None:  # the last point knows the curve better than the tangent at the first
            ahead = s - near_position
            x, u = near.x + ahead * near.tangent_x, near.parameter + ahead * near.tangent_parameter
        point, _ = corrected_point(problem, x, u, (dx, du), metric, OPTIONS)
        return point, event.value(point)

    near_position = 0.0
    point, value = at(0.0, None)
    steepness = place.steepness or 0.0
    s, best = 0.0, (abs(value), point)
    # Positions matter relative to u: folds in tiny contacts lie at tiny u.
    unit = min(1.0, abs(place.u) / max(abs(du), 1e-300)) if place.u else 1.0
    for iteration in range(14):
        step = -value / steepness if steepness else 1e-4 * unit
        step = math.copysign(min(abs(step), 0.2 * unit), step)
        if iteration and abs(step) <= 1e-13 * unit:
            break
        near_position = s
        new_point, new_value = at(s + step, point)
        if new_value != value and (abs(step) > 1e-7 * unit or not steepness):
            steepness = (new_value - value) / step
        s, point, value = s + step, new_point, new_value
        stalled = abs(value) >= 0.5 * best[0]
        if abs(value) < best[0]:
            best = (abs(value), point)
        if value == 0.0 or (stalled and abs(step) < 1e-8 * unit):
            break
    point = best[1]
    if isinstance(event, FoldEvent) and is_tiny(problem, point.parameter):
        return _tiny(problem, point.x, point.parameter, event)
    tangent = (point.tangent_x, point.tangent_parameter)
    uncertainty = best[0] / abs(steepness) * abs(point.tangent_parameter) if steepness else 0.0
    uncertainty = min(uncertainty, 1e-3 * min(1.0, abs(point.parameter)))
    return Place(problem, point.x, point.parameter, tangent, steepness or None, uncertainty)


def _tiny(problem: ContactProblem, x: Array, u: float, event: FoldEvent) -> Place:
    tiny = fold_at_tiny_radius(problem, x, u, event.control)
    return Place(problem, tiny.x, tiny.u, tiny.direction, None, tiny.uncertainty)


def moved(place: Place, problem: ContactProblem, x: Array) -> Place:
    """A place carried to another mesh."""
    old, nodes = place.problem.equations.mesh, problem.equations.mesh.nodes
    direction = (old.interpolate(place.direction[0], nodes), place.direction[1])
    return Place(problem, x, place.u, direction, place.steepness)


def refine(place: Place, event: Event | None, accuracy: float) -> tuple[Values, Place]:
    """Values at an event with error estimates within the accuracy, and the place on the mesh that gave them.

    The estimate is the difference to the same event on ``mesh.finer``. The values are those of the coarser mesh: their
    error is known, that of the finer one is only known to be smaller.

    Where the curve cannot be followed on a finer mesh, the estimate is that of one Newton step towards it.
    """
    for _ in range(REMESHES):
        problem = place.problem
        if problem.relative_error(problem.fields(place.x, place.u)) <= AIM * accuracy:
            break
        problem, x = problem.remeshed(place.x, place.u, AIM * accuracy)
        place = moved(place, problem, x)
    try:
        place = locate(place, event)
        if isinstance(event, FoldEvent) and is_tiny(place.problem, place.u):
            place = locate(moved(place, *graded(place.problem, place.x, place.u)), event)
    except CorrectionError:
        return _by_defect(place, event), place
    best: tuple[Values, Place] | None = None
    last = math.inf
    for _ in range(ROUNDS):
        problem, x = place.problem.on(place.problem.equations.mesh.finer, place.x, place.u, solve=event is None)
        fine = moved(place, problem, x)
        try:
            there = None if event is None else _nudged(fine, event)
            if there is None:
                fine = locate(fine, event)
                there = numbers(fine)
            values = _compared(place, there, accuracy)
            if best is None or values.relative_error() < best[0].relative_error():
                best = (values, place)
            error = values.relative_error()
            if error <= accuracy or problem.equations.mesh.size > LARGEST:
                break
            if error > WORSE * last:
                break  # round-off has taken over
            if error > GAIN * last:
                # Higher order does not help where the law has kinks, as tables have: halve the panels.
                problem, x = place.problem.on(place.problem.equations.mesh.halved(), place.x, place.u)
                fine = moved(place, problem, x)
            last = error
            place = locate(fine, event)
        except CorrectionError:
            break  # what has been reached stands, with its own error estimate
    return best if best is not None else (_by_defect(place, event), place)


def _by_defect(place: Place, event: Event | None) -> Values:
    """Values with the error estimates of one Newton step, where the finer mesh could not be followed.

    An event that was not located itself adds how far away it may be, by a Newton step along the parameter.
    """
    defect = place.problem.error(place.problem.fields(place.x, place.u))
    here = numbers(place)
    along = defect.state / max(float(np.abs(place.direction[0]).max()), 1e-300)
    missed = 0.0 if event is None else _distance(place, event)
    shift = min(place.uncertainty + along * abs(place.direction[1]) + missed, 1.0)
    aside = numbers(Place(place.problem, place.x, place.u + shift, place.direction))
    error = [
        2 * SAFETY * abs(e) + ROUNDING * max(1.0, abs(v))
        for e, v in zip((defect.load, defect.displacement), here, strict=False)
    ]
    moves = [2 * abs(a - b) for a, b in zip(aside[2:], here[2:], strict=True)]
    if missed:
        there = place.problem.solve_at(place.x, place.u + shift)
        moved_to = numbers(Place(place.problem, there, place.u + shift, place.direction))
        error = [e + 2 * abs(a - b) for e, a, b in zip(error, moved_to, here, strict=False)]
    return Values(*here, (error[0], error[1], moves[0], moves[1]))


def _distance(place: Place, event: Event) -> float:
    """Distance in the parameter to the zero of an event function, by one secant step at fixed parameters."""
    problem = place.problem

    def value(u: float) -> float:
        x = problem.solve_at(place.x, u)
        return event.value(Point(problem, x, u, *problem.direction(x, u)))

    step = 1e-4 * min(1.0, abs(place.u)) or 1e-8
    here, there = value(place.u), value(place.u + step)
    distance = abs(here * step / (there - here)) if there != here else math.inf
    return distance if math.isfinite(distance) else math.inf


def _nudged(place: Place, event: Event) -> tuple[float, float, float, float] | None:
    """What `numbers` will be at the event, from one point close to it; None if it is not close.

    The event is as far away as one Newton step says; over that distance load and displacement change at their rates.
    """
    if not place.steepness:
        return None
    problem = place.problem
    metric = place.metric()
    size = metric.norm(problem, *place.direction)
    direction = (place.direction[0] / size, place.direction[1] / size)
    point, _ = corrected_point(problem, place.x, place.u, direction, metric, OPTIONS)
    step = -event.value(point) / place.steepness
    if not abs(step) < CLOSE * min(1.0, abs(point.parameter) / max(abs(point.tangent_parameter), 1e-300)):
        return None
    rates = problem.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
    u = point.parameter + step * point.tangent_parameter
    load, displacement, _, _ = numbers(Place(problem, point.x, point.parameter, direction))
    equations, y = problem.equations, problem.coordinate(u)
    radius = equations.coordinate.radius(y) if equations.contact else 0.0
    # Half of the rate at this end: where it vanishes at the other, the load (or displacement) has an extremum.
    share = [
        0.5 if isinstance(event, FoldEvent) and event.control.kind == name else 1.0 for name in ("load", "displacement")
    ]
    return (
        load + share[0] * rates[0] * step,
        displacement + share[1] * rates[1] * step,
        radius,
        0.0 if equations.contact else max(0.0, -y),
    )


def _compared(place: Place, there: tuple[float, float, float, float], accuracy: float) -> Values:
    here = numbers(place)
    # What rounding leaves open of the position moves contact radius and gap (load and displacement are all but
    # stationary).
    aside = numbers(Place(place.problem, place.x, place.u + place.uncertainty, place.direction))
    floor = ROUNDING + FLOOR * accuracy
    position = (0.0, 0.0, abs(aside[2] - here[2]), abs(aside[3] - here[3]))
    # Without contact the radius is exactly zero, in contact the gap; at first touch, both.
    contact = place.problem.equations.contact
    uncertain = (True, True, contact and place.u != 0.0, not contact and place.u != 0.0)
    error = [
        SAFETY * abs(a - b) + floor * max(1.0, abs(a)) + 2 * p if a or b or some else 0.0
        for a, b, p, some in zip(here, there, position, uncertain, strict=True)
    ]
    return Values(*here, (error[0], error[1], error[2], error[3]))
