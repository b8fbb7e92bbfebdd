"""Folds in a second parameter: the curve that they form, and its cusps."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, Self

import numpy as np

from contbranch.continuation.augmented import Augmented, Turn
from contbranch.continuation.curve import Curve, Fold, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.newton import ROUNDING, CorrectionError
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Problem
from contbranch.continuation.trace import interval_around, trace_curve
from contbranch.errors import InputError

# Lengths of state and parameter are no smaller than this share of what bending asks for.
LEAST_LENGTH = 1e-3
# Noise of residuals that hold a Jacobian by differences, in units of rounding.
NOISE = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Cusp:
    """Where two folds meet and vanish: the curvature of the curve at the fold passes zero."""

    q: float
    parameter: float
    x: Array


@dataclass(frozen=True)
class FoldCurve:
    """The folds of a family of problems.

    Attributes
    ----------
    curve : Curve
        The curve of the augmented system, with state (x, p) and parameter q.
    """

    curve: Curve

    @cached_property
    def q(self) -> Array:
        """Second parameters, shape (M,)."""
        return self.curve.parameter

    @cached_property
    def parameter(self) -> Array:
        """First parameters of the folds, shape (M,)."""
        return np.array([point.x[-1] for point in self.curve.points])

    @cached_property
    def x(self) -> Array:
        """States of the folds, shape (M, n)."""
        return np.array([point.x[:-1] for point in self.curve.points])

    @cached_property
    def cusps(self) -> list[Cusp]:
        """The cusps, in order along the curve."""
        return [Cusp(event.parameter, float(event.x[-1]), event.x[:-1]) for event in self.curve.named("cusp")]

    @property
    def status(self) -> Literal["complete", "incomplete"]:
        """Whether the curve was followed to both ends."""
        return self.curve.status

    @property
    def message(self) -> str:
        """How the curve ended, as sentences."""
        return self.curve.message


def trace_folds(
    make_problem: Callable[[float], Problem],
    fold: Fold,
    q: float,
    q_range: tuple[float, float],
    options: Options | None = None,
) -> FoldCurve:
    """Follow a fold in a second parameter, through the cusps where it meets another one.

    The unknowns are (x, p), the equations F = 0 and p' = 0, with p' the component of the unit tangent at fixed q, see
    `contbranch.continuation.augmented`. At a cusp both parameters turn, so the curve passes it smoothly.

    Parameters
    ----------
    make_problem : callable
        Returns the problem at a value of q; its discretisation must not change with q. Where its Jacobian is no matrix,
        all columns are asked for.
    fold : Fold
        A fold of ``make_problem(q)``.
    q : float
    q_range : (float, float)
        Lowest and highest second parameter.
    options : Options, optional
        Step control, tolerances.

    Returns
    -------
    FoldCurve
        Arrays `q`, `parameter`, `x`, and the `cusps`; `status` and `message` say how it ended.

    Raises
    ------
    InputError
        If q lies outside its range, or the fold is none of ``make_problem(q)``.
    """
    problem = make_problem(q)
    at = problem.linearise(fold.x, fold.parameter)
    scale = max(1.0, abs(fold.parameter)) * float(np.linalg.norm(at.parameter_derivative)) or 1.0
    if not float(np.linalg.norm(at.residual)) <= 1e-6 * scale:
        raise InputError(f"fold is not on the curve of make_problem({q:g}): give the q that it was found with.")
    interval, start = interval_around(q_range, q), np.append(fold.x, fold.parameter)
    width = interval.width if math.isfinite(interval.width) else max(1.0, abs(q))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        folds = _Folds(make_problem, np.append(fold.null_vector, 0.0), interval, _lengths(fold, np.zeros(start.size)))
        with suppress(CorrectionError):  # the trace meets it, too, and reports it
            folds = folds.measured(_lengths(fold, width * folds.moved(start, q)))
    options = options or Options(noise=NOISE)
    # Where the fold rests, what rounding changes in units of its lengths is to set no scale.
    floor = max(options.state_floor, ROUNDING**0.5)
    options = replace(options, state_floor=floor, detect_folds=False, detect_branch_points=False)
    return FoldCurve(trace_curve(folds, start, q, q_range, options, [Turn()]))


class _Lengths(NamedTuple):
    """Lengths of x (root mean square) and p, and that over which F bends."""

    state: float
    parameter: float
    bend: float


class _Folds(Augmented):
    """F(x, p; q) = 0 and p' = 0 for (x, p)."""

    def __init__(self, at: Callable[[float], Problem], reference: Array, interval: Range, lengths: _Lengths) -> None:
        self.lengths = lengths
        super().__init__(at, reference, interval)

    def condition(self, point: Point, q: float) -> float:
        """The parameter's component of the unit tangent, in its length."""
        return point.tangent_parameter / self.lengths.parameter

    def on(self, reference: Array) -> Self:
        """The same system with another border."""
        return type(self)(self.at, reference, self.interval, self.lengths)

    def measured(self, lengths: _Lengths) -> Self:
        """The same system in other lengths."""
        return type(self)(self.at, self.reference, self.interval, lengths)

    def length(self, z: Array, point: Point) -> float:
        """The length over which F bends, or rounding allows."""
        return max(self.lengths.bend, float(np.abs(point.x).max())) / float(np.abs(point.tangent_x).max())

    def inner(self, u: Array, v: Array) -> float:
        """Mean square of x and square of p, in units of their lengths."""
        return float(self.dual(u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        lengths = self.lengths
        return np.append(u[:-1] / ((u.size - 1) * lengths.state**2), u[-1] / lengths.parameter**2)


def _lengths(fold: Fold, move: Array) -> _Lengths:
    """Lengths of x and p: their sizes, and how far q moves them; neither is rounding beside the other.

    Where x changes by s next to a fold, p does by curvature s²/2. A state with which p changes by less than its error
    is zero; a parameter that is less than its error has the length of which that is the rounding.
    """
    curvature = abs(fold.curvature) * fold.x.size / float(fold.null_vector @ fold.null_vector)
    curvature = curvature if math.isfinite(curvature) else 0.0
    state, height = _mean(fold.x), abs(fold.parameter)
    state = _mean(move[:-1]) + (state if curvature * state**2 / 2 > fold.error else 0.0)
    height = abs(float(move[-1])) + (height if height > fold.error else fold.error / (4 * ROUNDING))
    bend = math.sqrt(2 * height / curvature) if curvature else 0.0
    state = max(state, LEAST_LENGTH * bend)
    height = max(height, LEAST_LENGTH * curvature * state**2 / 2)
    return _Lengths(state or 1.0, height or 1.0, min(1.0, max(bend, state)) or 1.0)


def _mean(x: Array) -> float:
    """The root mean square."""
    return math.sqrt(float(x @ x) / x.size)
