"""Newton's method from afar: states of a new layout, and states on panels made for them."""

from __future__ import annotations

import math

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.continuation import CorrectionError, Options, Outcome, Point
from contbranch.continuation.newton import border, correct, linearise, residual
from contbranch.curve.problem import oriented

from .equations import RingEquations, rings
from .front import preferred

__all__ = ["resolved", "solved"]

Row = tuple[Array, float]

# Most iterations, the relative correction from which the iteration is left to itself, the growth of the residual that
# is accepted, and how often a step is halved to avoid more.
APPROACHES, NEARLY, GROWS, HALVINGS = 30, 1e-3, 1.5, 6
# A correction that is this many times the one before is astray: those that lead to a state grow by a fifth at most.
LEAPS = 2.5
# ... and how far it goes then.
PRECISE = Options(tolerance=1e-12, noise=1e8)
# Rounds of meshing and solving for one state.
ROUNDS = 6


def solved(problem: RingEquations, x: Array, d: float, row: Row) -> tuple[Array, float]:
    """The solution near (x, d) in the plane that `row` is normal to.

    Newton's method, with steps shortened so that no width changes by more than a share of itself and the residual does
    not grow much: a guess at a new layout may be far from the solution.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    metric, count = problem.metric(x), problem.edges
    size = math.inf
    for _ in range(APPROACHES):
        at = linearise(problem, x, d)
        dx, dd = border(problem, x, d, at, row).solve(-at[0], 0.0)
        last, size = size, metric.norm(problem, dx, dd)
        if not (math.isfinite(size) and size < LEAPS * last):
            break
        if size < NEARLY:
            done = correct(problem, (x, d), row, metric, PRECISE)
            return done.x, done.parameter
        room, change = (np.diff(vector[x.size - count :], prepend=0.0) for vector in (x, dx))
        share = min(1.0, 0.3 / max(float((np.abs(change) / room).max(initial=0.0)), 1e-300))
        before = magnitude(at[0])
        for _ in range(HALVINGS):
            trial = x + share * dx, d + share * dd
            try:
                after = magnitude(residual(problem, *trial))
            except CorrectionError:
                after = math.inf
            if after < GROWS * before:
                break
            share /= 2
        x, d = trial
    raise CorrectionError(Outcome.START_FAILED, f"(Newton's last correction was {size:.2g} of the state.)")


def resolved(point: Point, held: Row | None = None) -> Point:
    """The point on panels that resolve it.

    Parameters
    ----------
    held : (array (E,), float), optional
        What is held of edges and displacement; by default the solution is sought across the curve.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    for _ in range(ROUNDS):
        problem, d = rings(point), point.parameter
        panels = preferred(problem, problem.fields(point.x, d))
        if panels is None:
            break
        other = problem.on(panels)
        x, tangent = (problem.carried(vector, point.x, point.parameter, other) for vector in (point.x, point.tangent_x))
        if held is None:
            row = other.metric(x).row(other, tangent, point.tangent_parameter)
        else:
            row = np.zeros(x.size), held[1]
            row[0][x.size - other.edges :][: len(held[0])] = held[0]
        point = oriented(other, *solved(other, x, d, row), (tangent, point.tangent_parameter))
    return point
