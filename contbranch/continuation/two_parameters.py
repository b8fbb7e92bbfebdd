"""Folds in a second parameter: the curve that they form, and its cusps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from contbranch.continuation.augmented import Augmented
from contbranch.continuation.bordered import as_matrix, bordered_matrix
from contbranch.continuation.curve import Curve, Fold, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.functions import Function, as_problem
from contbranch.continuation.metric import ROUNDING
from contbranch.continuation.newton import CorrectionError, linearise
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import Adaptation, Array, Linearisation, Problem
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
    make_problem: Callable[[float], Problem | Function],
    fold: Fold,
    q: float,
    q_range: tuple[float, float],
    options: Options | None = None,
    *,
    events: Sequence[Event] = (),
    stop: StopAt | None = None,
    callback: Callable[[Point], object] | None = None,
    direction: Literal["both", "forward", "backward"] = "both",
    time_limit: float | None = None,
    norm_limit: float | None = None,
) -> FoldCurve:
    """Follow a fold in a second parameter, through the cusps where it meets another one.

    The unknowns are (x, p), the equations F = 0 and σ = 0 with σ from a bordered system, as in `locate_fold`; its
    derivatives come from the left null vector ψ and differences of the Jacobian along the right one φ,
    dσ = −ψᵀ dJ φ (A. Griewank and G. W. Reddien, IMA J. Numer. Anal. 3 (1983) 295). At a cusp both parameters turn, so
    the curve passes it smoothly.

    Parameters
    ----------
    make_problem : callable
        Returns the problem at a value of q, or the function f(x, p); its discretisation must not change with q. Where
        its Jacobian is no matrix, all columns are asked for.
    fold : Fold
        A fold of ``make_problem(q)``.
    q : float
    q_range : (float, float)
        Lowest and highest second parameter.
    options : Options, optional
        Step control, tolerances.
    events, stop, callback, direction, time_limit, norm_limit
        As for `trace_curve`, of the curve of folds: its state is (x, p), an (n + 1,) array, and its parameter q.

    Returns
    -------
    FoldCurve
        Arrays `q`, `parameter`, `x`, and the `cusps`; `status` and `message` say how it ended.

    Raises
    ------
    InputError
        If q lies outside its range, or the fold is none of ``make_problem(q)``.
    """

    def family(value: float) -> Problem:
        return as_problem(make_problem(value))

    problem = family(q)
    at = problem.linearise(fold.x, fold.parameter)
    scale = max(1.0, abs(fold.parameter)) * float(np.linalg.norm(at.parameter_derivative)) or 1.0
    if not float(np.linalg.norm(at.residual)) <= 1e-6 * scale:
        raise InputError(f"fold is not on the curve of make_problem({q:g}): give the q that it was found with.")
    interval, start = interval_around(q_range, q), np.append(fold.x, fold.parameter)
    width = interval.width if math.isfinite(interval.width) else max(1.0, abs(q))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        beside = at.parameter_derivative / float(at.parameter_derivative @ at.parameter_derivative)
        lengths = _lengths(fold, np.zeros(start.size))
        folds = _Folds(family, np.append(fold.null_vector, 0.0), interval, lengths, beside)
        with suppress(CorrectionError):  # the trace meets it, too, and reports it
            folds = folds.on(folds.reference, lengths=_lengths(fold, width * folds.moved(start, q)))
    options = options or Options(noise=NOISE)
    # Where the fold rests, what rounding changes in units of its lengths is to set no scale.
    floor = max(options.state_floor, ROUNDING**0.5)
    options = replace(options, state_floor=floor, detect_folds=False, detect_branch_points=False)
    follow = partial(trace_curve, callback=callback, direction=direction, time_limit=time_limit, norm_limit=norm_limit)
    return FoldCurve(follow(folds, start, q, q_range, options, [_CuspEvent(), *events], stop))


class _Lengths(NamedTuple):
    """Lengths of x (root mean square) and p, and that over which F bends."""

    state: float
    parameter: float
    bend: float


class _Folds(Augmented):
    """F(x, p; q) = 0 and σ = 0 for (x, p), with σ and the null vectors from bordered systems

        [ F_x  b ] [ φ ]   [ 0 ]                [ F_xᵀ  c ] [ ψ ]   [ 0 ]
        [ c^T  0 ] [ σ ] = [ 1 ]                [ b^T   0 ] [ σ ] = [ 1 ],

    which are regular where F_p is in the range of F_x, too: at the centres of isolas, and where curves cross.
    """

    def __init__(
        self, at: Callable[[float], Problem], reference: Array, interval: Range, lengths: _Lengths, beside: Array
    ) -> None:
        self.lengths, self.beside = lengths, beside
        super().__init__(at, reference, interval)

    def condition(self, point: Point, q: float) -> float:
        """σ, of a null vector of unit length."""
        return point.tangent_parameter

    def on(self, reference: Array, beside: Array | None = None, lengths: _Lengths | None = None) -> Self:
        """The same system with other borders, or in other lengths."""
        beside = self.beside if beside is None else beside
        return type(self)(self.at, reference, self.interval, lengths or self.lengths, beside)

    def column(self, at: Linearisation) -> Array:
        """The border b."""
        return self.beside

    def nearest(self, z: Array, q: float) -> Point:
        """The state itself: σ is known next to solutions, too."""
        return self.own(z, q).point

    def left(self, z: Array, q: float) -> Array:
        """ψ."""
        transposed = self.own(z, q).bordered.solve_transposed(np.zeros(z.size - 1), 1.0)
        return self.beside if transposed is None else transposed[0]

    def jacobian(self, x: Array, p: float) -> Any:
        """Derivative of (F, σ) with respect to (x, p)."""
        at, turn = self.own(x, p).linear, self.turn(x, p)
        return bordered_matrix(at.jacobian, at.parameter_derivative, turn[:-1], turn[-1])

    def turn(self, x: Array, p: float) -> Array:
        """Derivative of σ with respect to (x, p), −ψᵀ d(F_x) φ; along φ it is the curvature."""
        point, left, here = self.own(x, p).point, self.left(x, p), self.at(p)

        def rows(s: float) -> Array:
            there = linearise(here, point.x + s * point.tangent_x, point.parameter)
            return np.append(as_matrix(there.jacobian).T @ left, left @ there.parameter_derivative)

        return -np.asarray(self.difference(rows, self.length(x, point) * ROUNDING ** (1 / 3), -math.inf, math.inf))

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Derivative of (F, σ) with respect to q."""
        point, left = self.own(x, p).point, self.left(x, p)

        def both(s: float) -> Array:
            there = linearise(self.at(p + s), point.x, point.parameter)
            return np.append(there.residual, -float(left @ (as_matrix(there.jacobian) @ point.tangent_x)))

        return np.asarray(self.rate_by_q(both, p))

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """Borders close to the null vectors, where the present ones no longer are."""
        offer, left = super().adapt(x, p), self.left(x, p)
        if offer is None and self.aligned * np.linalg.norm(left) * np.linalg.norm(self.beside) < 1.0:
            return None
        reference = np.append(self.nearest(x, p).tangent_x, 0.0)
        return Adaptation(self.on(reference, left / float(left @ left)), x, lambda vector: vector)

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


class _CuspEvent(Event):
    """Where the curvature of the curve of solutions at its fold passes zero; q may turn at other points, too."""

    name = "cusp"

    def value(self, point: Point) -> float:
        """ψᵀ F_xx φ φ, but for its sign."""
        problem: Any = point.problem
        turn = problem.turn(point.x, point.parameter)
        return float(turn[:-1] @ problem.nearest(point.x, point.parameter).tangent_x)
