"""Special points of a followed event to the accuracy asked for, on meshes made for them and on finer ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation import CorrectionError, Metric, Options, Point, correct
from contbranch.continuation.walk import corrected_point, to_point
from contbranch.models.event_curve import Four

from .event_problem import EventProblem
from .locate import AIM, FLOOR, LARGEST, REMESHES, ROUNDING, SAFETY

__all__ = ["LENGTHS", "Precise", "at_place", "event_problem", "numbers", "precise"]

# States are measured in units of their own size, the family's coordinate in its own.
LENGTHS = Metric(1.0, 1.0)
OPTIONS = Options(tolerance=1e-13, noise=1e8)
ROUNDS = 4
# What differences leave undecided of a tangent's component.
TANGENT_NOISE = 2e-10

Value = Callable[[Point], float]


@dataclass(frozen=True)
class Precise:
    """A special point: the family's coordinate, the four observables (reduced units), errors, and the curve's point."""

    q: float
    q_error: float
    numbers: Four
    error: Four
    point: Point


def event_problem(point: Point) -> EventProblem:
    """The problem of a point of a followed event."""
    assert isinstance(point.problem, EventProblem)
    return point.problem


def numbers(point: Point) -> Four:
    """Load, displacement, contact radius and central gap in reduced units."""
    problem = event_problem(point)
    h, u = problem.split(point.x)
    member = problem.member(point.parameter)
    fields = member.fields(h, u)
    gap = 0.0 if problem.contact else max(0.0, -fields.y)
    return member.equations.load(fields), member.equations.displacement(fields), fields.rim.radius, gap


def at_place(problem: EventProblem, x: np.ndarray, q: float, w: float) -> Point:
    """The point of the curve with a given contact coordinate w: q is found.

    Raises
    ------
    CorrectionError
        If there is none close by.
    """
    x = x.copy()
    x[-1] = w
    row = np.zeros(x.size)
    row[-1] = 1.0
    corrected = correct(problem, x, q, (row, 0.0), LENGTHS, tolerance=1e-12, noise=1e8, precise=True)
    point = to_point(problem, corrected, LENGTHS, sign=False)
    point.x[-1] = w
    return point


def located(point: Point, value: Value) -> tuple[Point, float]:
    """The zero of a function along the curve near a point, by a secant iteration, and what is left open of its position
    (in the coordinate of arclength).

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    problem = point.problem
    direction = (point.tangent_x, point.tangent_parameter)

    def at(x: np.ndarray, q: float) -> tuple[Point, float]:
        found, _ = corrected_point(problem, x, q, direction, LENGTHS, OPTIONS)
        if LENGTHS.dot(problem, found.tangent_x, found.tangent_parameter, *direction) < 0:
            found = found.turned()
        return found, value(found)

    here, level = at(point.x, point.parameter)
    best, slope, step = (abs(level), here), 0.0, 1e-4
    for iteration in range(14):
        there, other = at(here.x + step * here.tangent_x, here.parameter + step * here.tangent_parameter)
        if other != level and (abs(step) > 1e-7 or not slope):
            slope = (other - level) / step
        stalled = abs(other) >= 0.5 * best[0]
        here, level = there, other
        if abs(level) < best[0]:
            best = (abs(level), here)
        if not slope or level == 0.0 or (iteration > 1 and stalled and abs(step) < 1e-8):
            break
        step = math.copysign(min(abs(level / slope), 0.1), -level / slope)
        if abs(step) < 1e-14:
            break
    return best[1], best[0] / abs(slope) if slope else 0.0


def moved(point: Point, problem: EventProblem) -> Point:
    """A point carried to the problem on another mesh (not corrected)."""
    old, mesh = event_problem(point), problem.mesh
    return replace(point, problem=problem, x=old.carried(point.x, mesh), tangent_x=old.carried(point.tangent_x, mesh))


def on_mesh(point: Point, mesh: object, sharpness: float, fine: bool) -> Point:
    """A point on another mesh; `fine`: with differences of fourth order, where tangents are results."""
    problem = event_problem(point)
    v_h, v_u = problem.on_sheet(point.x, point.parameter).tangent
    reference = (problem.mesh.interpolate(v_h, mesh.nodes), v_u)  # type: ignore[attr-defined]
    return moved(point, problem.on(mesh, reference, sharpness, fine))  # type: ignore[arg-type]


def precise(point: Point, value: Value, accuracy: float, noise: float = 0.0) -> Precise:
    """A special point with error estimates within the accuracy if that can be reached.

    Parameters
    ----------
    value : callable
        Vanishes there along the curve.
    accuracy : float
        Relative to max(1, |value|), reduced units.
    noise : float
        What differences leave undecided of `value`, where it depends on the tangent of the curve.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed to it.
    """
    fine = noise > 0.0
    for _ in range(REMESHES):
        problem = event_problem(point)
        h, u = problem.split(point.x)
        member = problem.member(point.parameter)
        if member.relative_error(member.fields(h, u)) <= AIM * accuracy:
            break
        trial, _ = member.remeshed(h, u, AIM * accuracy)
        point = on_mesh(point, trial.equations.mesh, trial.sharpness, fine)
        point, _ = located(point, value)
    problem = event_problem(point)
    here, open_here = located(on_mesh(point, problem.mesh, problem.sharpness, fine), value)
    found: Precise | None = None
    for _ in range(ROUNDS):
        try:
            own = event_problem(here)
            there, open_there = located(on_mesh(here, own.mesh.finer, own.sharpness, fine), value)
        except CorrectionError:
            if found is None:
                raise
            break  # what has been reached stands, with its own error estimate
        candidate = _compared(here, there, open_here + open_there + noise, accuracy)
        if found is None or _relative(candidate) < _relative(found):
            found = candidate
        if _relative(candidate) <= accuracy or event_problem(there).mesh.size > LARGEST:
            break
        here, open_here = there, open_there
    assert found is not None
    return found


def _compared(here: Point, there: Point, position: float, accuracy: float) -> Precise:
    values, others = numbers(here), numbers(there)
    ahead, _ = corrected_point(
        here.problem,
        here.x + 1e-5 * here.tangent_x,
        here.parameter + 1e-5 * here.tangent_parameter,
        (here.tangent_x, here.tangent_parameter),
        LENGTHS,
        OPTIONS,
    )
    floor = ROUNDING + FLOOR * accuracy
    error = [
        float(SAFETY * abs(a - b) + floor * max(1.0, abs(a)) + 2 * position * abs(c - a) / 1e-5) if a or b else 0.0
        for a, b, c in zip(values, others, numbers(ahead), strict=True)
    ]
    rate = abs(ahead.parameter - here.parameter) / 1e-5
    q_error = SAFETY * abs(here.parameter - there.parameter) + floor + 2 * position * rate
    return Precise(here.parameter, q_error, values, (error[0], error[1], error[2], error[3]), here)


def _relative(found: Precise) -> float:
    own = max(e / max(1.0, abs(v)) for e, v in zip(found.error, found.numbers, strict=True))
    return max(own, found.q_error)
