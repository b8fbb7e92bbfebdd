"""Points of the curve: corrected, with unit tangent, and with what the problem says about them."""

from __future__ import annotations

import math
from dataclasses import replace

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.curve import Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import Corrected, CorrectionError, correct
from contbranch.continuation.options import Options
from contbranch.continuation.outcomes import Outcome
from contbranch.continuation.problem import Array, Problem
from contbranch.continuation.segment import Segment

__all__ = ["annotated", "corrected_point", "point_on", "to_point"]

Direction = tuple[Array, float]


def to_point(problem: Problem, corrected: Corrected, metric: Metric, sign: bool = True) -> Point:
    """Return a corrected point with unit tangent and, if `sign`, the sign of the bordered determinant."""
    size = metric.norm(problem, corrected.tangent_x, corrected.tangent_parameter)
    return Point(
        problem,
        corrected.x,
        corrected.parameter,
        corrected.tangent_x / size,
        corrected.tangent_parameter / size,
        corrected.bordered.determinant_sign() if sign else None,
    )


def annotated(point: Point, label: str | None = None) -> Point:
    """Return the point with the problem's Morse index and observables.

    Raises
    ------
    CorrectionError
        If the problem fails at them.
    """
    problem = point.problem
    kind = type(problem)
    asks_index = kind.morse_index is not Problem.morse_index
    asks_observables = kind.observables is not Problem.observables
    if not (asks_index or asks_observables or label is not None):
        return point
    try:
        return replace(
            point,
            morse_index=problem.morse_index(point.x, point.parameter) if asks_index else None,
            observables=problem.observables(point.x, point.parameter) if asks_observables else {},
            label=point.label if label is None else label,
        )
    except Exception as error:  # as for residuals: the user's code ends the attempt, its text is kept
        detail = f"({type(error).__name__} at parameter {point.parameter:.6g}: {error})"
        raise CorrectionError(Outcome.EVALUATION_FAILED, detail) from error


def corrected_point(
    problem: Problem, x: Array, p: float, direction: tuple[Array, float], metric: Metric, options: Options
) -> tuple[Point, Bordered]:
    """Correct (x, p) precisely in the plane normal to a direction; return the point and its bordered matrix."""
    return _in_plane(problem, (x, p), direction, metric, options, True)


def point_on(segment: Segment, theta: float, options: Options, precise: bool = True) -> tuple[Point, Bordered]:
    """Return the point of the curve at the fraction θ of a segment, and its bordered matrix."""
    direction = segment.direction(theta)
    return _in_plane(segment.begin.problem, segment.at(theta), direction, segment.metric, options, precise)


def _in_plane(
    problem: Problem, near: Direction, direction: Direction, metric: Metric, options: Options, precise: bool
) -> tuple[Point, Bordered]:
    size = metric.norm(problem, *direction)
    if not (size > 0 and math.isfinite(size)):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The step has no length.)")
    row = metric.row(problem, direction[0] / size, direction[1] / size)
    corrected = correct(problem, *near, row, metric, tolerance=options.tolerance, noise=options.noise, precise=precise)
    return to_point(problem, corrected, metric, sign=False), corrected.bordered
