"""The driver: follows a curve from its start, in both directions, to its ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.curve import Curve, End, Outcome, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.folds import second_derivative
from contbranch.continuation.follow import Branch, Course
from contbranch.continuation.functions import Function, JacobianFunction, as_problem, checked
from contbranch.continuation.metric import Balance, Metric
from contbranch.continuation.newton import (
    CorrectionError,
    border,
    correct_start,
    linearise,
    residual,
    solve,
    tangent_at,
)
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import Array, Direction, Problem, size_of
from contbranch.continuation.walk import annotated
from contbranch.errors import InputError

# How often the scales of a start next to a fold are improved.
BENDS = 10


def trace_curve(
    f: Problem | Function,
    x0: npt.ArrayLike,
    p0: float,
    parameter_range: tuple[float, float],
    options: Options | None = None,
    events: Sequence[Event] = (),
    stop: StopAt | None = None,
    *,
    jacobian: JacobianFunction | None = None,
    parameter_derivative: Function | None = None,
    callback: Callable[[Point], object] | None = None,
    stability: bool = False,
    direction: Literal["both", "forward", "backward"] = "both",
    time_limit: float | None = None,
    norm_limit: float | None = None,
) -> Curve:
    """Follow the solution curve of F(x, p) = 0 through (x0, p0).

    Each direction ends where p leaves the range (exactly on its edge), where the curve closes, or at a stop
    condition; a start on an edge goes inwards. What could be followed is always returned; `Curve.status`,
    `Curve.message` and `Curve.ends` say whether and why something is missing.

    Parameters
    ----------
    f : callable or Problem
        F as a function f(x, p) of the state, an (n,) array, and the parameter, a float, which returns n numbers; where
        n is one, x is a (1,) array and a number may be returned. Or an object of a subclass of `Problem`, for more than
        derivatives: inner products, observables, discretisations that adapt.
    x0 : (n,) array_like
        State close to a solution at p0.
    p0 : float
        Parameter of the start, inside the range.
    parameter_range : (float, float)
        Lowest and highest parameter; either may be infinite.
    options : Options, optional
        Step control, tolerances.
    events : sequence of Event
        Functions whose zeros along the curve are located.
    stop : StopAt, optional
        Conditions that end the curve earlier.
    jacobian : callable, optional
        dF/dx as a function of (x, p), where f is a function: (n, n), dense, a scipy sparse array or matrix, or a
        `LinearOperator`. By default central differences, see `Problem.jacobian`.
    parameter_derivative : callable, optional
        dF/dp as a function of (x, p), (n,), where f is a function. By default a central difference.
    callback : callable, optional
        Called with every `Point` behind the start when it is accepted. `contbranch.Stop` raised there ends the curve;
        any other exception, too, and is passed on.
    stability : bool
        Whether to compute the eigenvalues of the Jacobian f_x, which tell the stability of the equilibria of
        x' = f(x, p): `Curve.eigenvalues`, `Curve.unstable`, and Hopf points among the events, `Curve.hopf_points`.
        Of a sparse matrix with more than 128 rows not all are computed: those that are unstable and some that are not,
        by ARPACK, as many as bounds of the real and imaginary parts ask for; where these ask for too many, all, and
        with more than 2000 rows the curve ends. About seven eigenvalue problems are solved for each point. Give the
        `jacobian`: differences leave ten digits of the eigenvalues.
    direction : {"both", "forward", "backward"}
        Where to follow the curve from its start: forward, p increases there.
    time_limit : float, optional
        Seconds after which the curve ends.
    norm_limit : float, optional
        The curve ends behind the first point at which the state's norm, that of `Problem.inner` (by default the root
        mean square of x), is larger.

    Returns
    -------
    Curve
        Points, folds, branch points, events and how the curve ended, oriented so that p increases at the start.

    Raises
    ------
    InputError
        If the start, the range or the shape of what F returns cannot be used, or if F writes it into the same array
        again. Failures of F are not raised but reported.
    TypeError
        If f is neither a function nor a `Problem`.
    KeyboardInterrupt, or what the callback raises
        With the curve followed so far as its attribute ``partial``.
    """
    course = Course(options, events, stop, callback, stability, time_limit, norm_limit)
    problem = as_problem(f, jacobian, parameter_derivative)
    if direction not in ("both", "forward", "backward"):
        raise InputError(f"direction is {direction!r}: give 'both', 'forward' or 'backward'.")
    interval = interval_around(parameter_range, p0)
    x = np.atleast_1d(np.array(x0, dtype=float))
    if x.ndim != 1 or x.size == 0 or not np.all(np.isfinite(x)):
        raise InputError("x0 must be a one-dimensional array of finite numbers with at least one element.")

    def compute() -> list[Curve]:
        unchanged = checked(problem, x, float(p0))
        try:
            start, balance = _start(problem, x, float(p0), interval, course.options)
            unchanged()
            return [joined(start, *_ways(start, balance, interval, direction, course))]
        finally:
            unchanged()

    (curve,), watch = course.curves(compute)
    return watch.passed(curve)


def interval_around(parameter_range: tuple[float, float], p0: float) -> Range:
    """Return the range as an interval, or raise InputError if it does not hold the start."""
    low, high = (float(edge) for edge in parameter_range)
    if not low < high:
        raise InputError(f"parameter_range is ({low}, {high}): give the lower edge first.")
    if not (math.isfinite(p0) and low <= p0 <= high):
        raise InputError(f"p0 is {p0}: give a start inside parameter_range ({low}, {high}).")
    return Range(low, high)


def _start(problem: Problem, x: Array, p: float, interval: Range, options: Options) -> tuple[Point, Balance]:
    """Return the corrected start, oriented towards increasing p, and the first scales."""
    x, travelled = correct_start(problem, x, p)
    u, a, bordered = tangent_at(problem, x, p)
    if a < 0:
        u, a = -u, -a
    slope = size_of(problem, u)
    balance = Balance.ahead(slope, a, size_of(problem, x), p, interval.width)
    width = interval.width if math.isfinite(interval.width) else max(1.0, abs(p))
    if slope * width > 1e3 * a * size_of(problem, x):
        balance = _bending(problem, x, p, (u / slope, a / slope), bordered, balance, width)
    balance = balance.sized(max(size_of(problem, x), travelled), p)
    metric = balance.metric(options.weight, options.state_floor)
    u, a = metric.unit(problem, u, a)
    # The determinant's sign belongs to the orientation: rebordering with the oriented, scaled tangent settles it.
    sign = border(problem, x, p, linearise(problem, x, p), metric.row(problem, u, a)).determinant_sign()
    # A fold at the very start lies in one of the two directions.
    point = annotated(Point(problem, x, p, u, a or 1e-300, sign), label="start")
    return point, balance


def _bending(
    problem: Problem, x: Array, p: float, along: Direction, bordered: Bordered, balance: Balance, width: float
) -> Balance:
    """Return scales of a start next to a fold, where the parameter changes by curvature s²/2 with the state by s."""
    here, scale, found = residual(problem, x, p), balance.state, balance
    straight = width / along[1] if along[1] > 0 else math.inf
    for _ in range(BENDS):
        try:
            d = second_derivative(problem, x, p, along, Metric(scale, width), here)
            bend = abs(solve(bordered, -d, 0.0, p)[1])
        except CorrectionError:
            scale *= 1e-3
            continue
        if bend == 0.0:
            scale *= 1e3
            continue
        state = math.sqrt(2 * width / bend)
        if not 0 < state < 0.1 * straight:
            return balance
        found = Balance(state, width)
        if 0.5 < found.state / scale < 2:
            break
        scale = state
    return found


def _ways(start: Point, balance: Balance, interval: Range, direction: str, course: Course) -> tuple[Branch, Branch]:
    """Follow the curve forwards and, unless it closes, backwards, as far as that is asked for."""
    ways: list[Branch] = []
    for way, point, edge in (("forward", start, interval.high), ("backward", start.turned(), interval.low)):
        if direction not in ("both", way):
            end = End(Outcome.ONE_DIRECTION)
        elif start.parameter == edge and abs(start.tangent_parameter) > 1e-12:
            end = End(Outcome.STARTED_ON_EDGE)
        elif ways and ways[0].end.outcome is Outcome.CLOSED:
            end = ways[0].end
        else:
            ways.append(course.follow(point, balance, interval))
            continue
        ways.append(Branch([], [], end))
    return ways[0], ways[1]


def joined(start: Point, forward: Branch, backward: Branch) -> Curve:
    """Return one curve from both branches, oriented along the forward one."""
    before = [point.turned() for point in reversed(backward.points)]
    points = (*before, start, *forward.points)
    located = [(event.turned(), len(before) - 1 - index) for event, index in reversed(backward.events)]
    located += [(event, len(before) + 1 + index) for event, index in forward.events]
    events = tuple(replace(event, point=points[index], index=index) for event, index in located)
    closed = Outcome.CLOSED in (backward.end.outcome, forward.end.outcome)
    return Curve(points, events, (backward.end, forward.end), closed)
