"""The driver: follows a curve from its start, in both directions, to its ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.curve import Curve, End, Located, Outcome, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.folds import second_derivative
from contbranch.continuation.follow import Branch, follow
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
from contbranch.watch import watched

# How often the scales of a start next to a fold are improved.
BENDS = 10


def trace_curve(
    problem: Problem,
    x0: npt.ArrayLike,
    p0: float,
    parameter_range: tuple[float, float],
    options: Options | None = None,
    events: Sequence[Event] = (),
    stop: StopAt | None = None,
) -> Curve:
    """Follow the solution curve of F(x, p) = 0 through (x0, p0) in both directions.

    Each direction ends where p leaves the range (exactly on its edge), where the curve closes, or at a stop
    condition; a start on an edge goes inwards. What could be followed is always returned; `Curve.status`,
    `Curve.message` and `Curve.ends` say whether and why something is missing.

    Parameters
    ----------
    problem : Problem
        F and its derivatives.
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

    Returns
    -------
    Curve
        Points, folds, branch points, events and how the curve ended, oriented so that p increases at the start.

    Raises
    ------
    InputError
        If the start or the range cannot be used. Failures of the problem are not raised but reported.
    KeyboardInterrupt
        With the curve followed so far as its attribute ``partial``.
    """
    options = options or Options()
    stop = stop or StopAt()
    interval = interval_around(parameter_range, p0)
    x = np.atleast_1d(np.array(x0, dtype=float))
    if x.ndim != 1 or x.size == 0 or not np.all(np.isfinite(x)):
        raise InputError("x0 must be a one-dimensional array of finite numbers with at least one element.")
    # Overflow in a trial point is answered by a shorter step; a warning would only alarm.
    with watched() as watch, np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            _check_shapes(problem, x, float(p0))
            start, balance = _start(problem, x, float(p0), interval, options)
        except CorrectionError as error:
            told = error.outcome in (Outcome.NOT_FINITE, Outcome.EVALUATION_FAILED)
            end = End(error.outcome if told else Outcome.START_FAILED, error.detail)
            return Curve((), (), (end, end))
        curve = joined(start, *_both_directions(start, balance, interval, options, events, stop))
    return watch.passed(curve)


def interval_around(parameter_range: tuple[float, float], p0: float) -> Range:
    """Return the range as an interval, or raise InputError if it does not hold the start."""
    low, high = (float(edge) for edge in parameter_range)
    if not low < high:
        raise InputError(f"parameter_range is ({low}, {high}): give the lower edge first.")
    if not (math.isfinite(p0) and low <= p0 <= high):
        raise InputError(f"p0 is {p0}: give a start inside parameter_range ({low}, {high}).")
    return Range(low, high)


def _check_shapes(problem: Problem, x: Array, p: float) -> None:
    """Raise InputError where what the problem returns at the start has another shape than it must have."""
    at = linearise(problem, x, p)
    parts = ("residual", at.residual, (x.size,)), ("parameter_derivative", at.parameter_derivative, (x.size,))
    for name, value, wanted in (*parts, ("jacobian", at.jacobian, (x.size, x.size))):
        if np.shape(value) != wanted and getattr(value, "shape", ()) != wanted:
            raise InputError(f"{type(problem).__name__}.{name} has the shape {np.shape(value)}: return {wanted}.")


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


def _both_directions(
    start: Point, balance: Balance, interval: Range, options: Options, events: Sequence[Event], stop: StopAt
) -> tuple[Branch, Branch]:
    """Follow the curve forwards and, unless it closes, backwards."""
    reverse = start.turned()
    skipped = Branch([], [], End(Outcome.STARTED_ON_EDGE))
    inwards = abs(start.tangent_parameter) > 1e-12
    if start.parameter == interval.high and inwards:
        return skipped, follow(reverse, balance, interval, options, events, stop)
    forward = follow(start, balance, interval, options, events, stop)
    if forward.end.outcome is Outcome.CLOSED:
        return forward, Branch([], [], End(Outcome.CLOSED))
    if start.parameter == interval.low and inwards:
        return forward, skipped
    return forward, follow(reverse, balance, interval, options, events, stop)


def joined(start: Point, forward: Branch, backward: Branch) -> Curve:
    """Return one curve from both branches, oriented along the forward one."""
    before = [point.turned() for point in reversed(backward.points)]
    points = (*before, start, *forward.points)
    located: list[Located] = []
    for event, index in reversed(backward.events):
        located.append(replace(event.turned(), index=len(before) - 1 - index))
    located += [replace(event, index=len(before) + 1 + index) for event, index in forward.events]
    closed = forward.end.outcome is Outcome.CLOSED
    return Curve(points, tuple(located), (backward.end, forward.end), closed)
