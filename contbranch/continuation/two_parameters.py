"""Folds in a second parameter: the curve that they form, and its cusps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from contbranch.continuation.bordered import as_matrix, bordered_matrix, factorise
from contbranch.continuation.curve import Curve, Fold, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.functions import Function, as_problem
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import Adaptation, Array, Linearisation, Problem
from contbranch.continuation.trace import interval_around, trace_curve
from contbranch.errors import InputError

STEP = float(np.finfo(float).eps ** (1 / 3))
# Lengths of state and parameter are no smaller than this share of what bending asks for.
ASIDE = 1e-3
# A border is replaced when the cosine between it and the null vector it stands for has fallen below this.
ALIGNED = 0.5
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

    The unknowns are (x, p), the equations F = 0 and σ = 0 with σ from the bordered system of `locate_fold`; its
    derivatives come from the left null vector ψ and differences of the Jacobian along the right one φ,
    dσ = −ψᵀ dJ φ (A. Griewank and G. W. Reddien, IMA J. Numer. Anal. 3 (1983) 295). A cusp is where ψᵀ F_xx φ φ = 0;
    both parameters turn there, so the curve passes it smoothly.

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
    column = at.parameter_derivative / float(at.parameter_derivative @ at.parameter_derivative)
    row = fold.null_vector / float(fold.null_vector @ fold.null_vector)
    augmented = _FoldProblem(family, row, column, _Lengths(1.0, 1.0, 1.0, interval_around(q_range, q)))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        augmented.lengths = augmented.measured(fold, q)
    options = options or Options(noise=NOISE)
    options = replace(options, detect_folds=False, detect_branch_points=False)
    found = trace_curve(
        augmented,
        np.append(fold.x, fold.parameter),
        q,
        q_range,
        options,
        [_CuspEvent(), *events],
        stop,
        callback=callback,
        direction=direction,
        time_limit=time_limit,
        norm_limit=norm_limit,
    )
    return FoldCurve(found)


class _Lengths(NamedTuple):
    """Lengths of x (root mean square) and p, that over which F bends, and the range of q."""

    state: float
    parameter: float
    bend: float
    interval: Range


class _Seen(NamedTuple):
    """The augmented system at one point, with the null vectors φ and ψ, and ψᵀ F_xx φ φ."""

    linearisation: Linearisation
    right: Array
    left: Array
    curvature: float


class _FoldProblem(Problem):
    """F(x, p; q) = 0 and σ(x, p; q) = 0 for (x, p), with a border that stays close to the null vectors."""

    def __init__(self, make_problem: Callable[[float], Problem], row: Array, column: Array, lengths: _Lengths) -> None:
        self.make_problem, self.row, self.column, self.lengths = make_problem, row, column, lengths
        self._last: tuple[Array, float, _Seen] | None = None

    def residual(self, x: Array, p: float) -> Array:
        """(F, σ), shape (n + 1,)."""
        return self.linearise(x, p).residual

    def linearise(self, x: Array, p: float) -> Linearisation:
        """(F, σ) and its derivatives."""
        return self.seen(x, p).linearisation

    def jacobian(self, x: Array, p: float) -> Any:
        """Derivative of (F, σ) with respect to (x, p)."""
        return self.seen(x, p).linearisation.jacobian

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Derivative of (F, σ) with respect to q."""
        return self.seen(x, p).linearisation.parameter_derivative

    def seen(self, z: Array, q: float) -> _Seen:
        """Return what there is to know at (x, p; q)."""
        if self._last is not None and self._last[0] is z and self._last[1] == q:
            return self._last[2]
        x, p, problem = z[:-1], float(z[-1]), self.make_problem(q)
        at = problem.linearise(x, p)
        bordered = factorise(as_matrix(at.jacobian), self.column, self.row, 0.0)
        right, sigma = bordered.solve(np.zeros_like(x), 1.0)
        transposed = bordered.solve_transposed(np.zeros_like(x), 1.0)
        left = self.column if transposed is None else transposed[0]

        def rates(of: list[tuple[float, Linearisation]]) -> list[Array]:
            """Sums of F, ψᵀJ and ψᵀF_p with weights."""
            parts = [
                (
                    weight * one.residual,
                    weight * (as_matrix(one.jacobian).T @ left),
                    weight * (left @ one.parameter_derivative),
                )
                for weight, one in of
            ]
            return [sum(part[1:], part[0]) for part in zip(*parts, strict=True)]

        step = STEP * max(self.lengths.bend, float(np.abs(x).max())) / float(np.abs(right).max())
        _, bend, slant = rates([(0.5 * s / step, problem.linearise(x + s * step * right, p)) for s in (-1, 1)])
        interval = self.lengths.interval
        change = STEP * max(min(1.0, interval.width), abs(q))
        # Beyond its range a family may not exist: at an edge the difference is one-sided, of the same order.
        side = 0
        if interval.low <= q < interval.low + change:
            side = 1
        elif interval.high >= q > interval.high - change:
            side = -1
        places = ((-3, 0), (4, side), (-1, 2 * side)) if side else ((-1, -1), (1, 1))
        shares = [0.5 * weight * (side or 1) / change for weight, _ in places]
        there = [self.make_problem(q + by * change).linearise(x, p) for _, by in places]
        push, turn, _ = rates(list(zip(shares, there, strict=True)))
        matrix = bordered_matrix(at.jacobian, at.parameter_derivative, -bend, -float(slant))
        linearisation = Linearisation(np.append(at.residual, sigma), matrix, np.append(push, -float(turn @ right)))
        found = _Seen(linearisation, right, left, float(bend @ right))
        self._last = (z, q, found)
        return found

    def inner(self, u: Array, v: Array) -> float:
        """Mean square of x and square of p, in units of their lengths."""
        return float(self.dual(u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        lengths = self.lengths
        return np.append(u[:-1] / ((u.size - 1) * lengths.state**2), u[-1] / lengths.parameter**2)

    def measured(self, fold: Fold, q: float) -> _Lengths:
        """Lengths of x and p: their sizes, and how far q moves them; neither is rounding beside the other.

        Where x changes by s next to a fold, p does by curvature s²/2.
        """
        move, height = self._moved(fold, q)
        state, height = _mean(fold.x) + _mean(move), abs(fold.parameter) + height
        curvature = abs(fold.curvature) if math.isfinite(fold.curvature) else 0.0
        if curvature == 0.0:
            return _Lengths(state or 1.0, height or 1.0, 1.0, self.lengths.interval)
        curvature *= fold.x.size / float(fold.null_vector @ fold.null_vector)
        bend = math.sqrt(2 * height / curvature)
        state = max(state, ASIDE * bend)
        height = max(height, ASIDE * curvature * state**2 / 2)
        return _Lengths(state or 1.0, height or 1.0, min(1.0, max(bend, state)) or 1.0, self.lengths.interval)

    def _moved(self, fold: Fold, q: float) -> tuple[Array, float]:
        """By how much the fold moves over the range of q, as far as its rate tells."""
        still, width = np.zeros_like(fold.x), self.lengths.interval.width
        try:
            at = self.seen(np.append(fold.x, fold.parameter), q).linearisation
            border = np.zeros(fold.x.size + 1)
            move, _ = factorise(at.jacobian, border, border, 1.0).solve(-at.parameter_derivative, 0.0)
        except Exception:  # of whatever kind, the trace meets it, too, and reports it
            return still, 0.0
        move = move * (width if math.isfinite(width) else max(1.0, abs(q)))
        return (move[:-1], abs(float(move[-1]))) if np.isfinite(move).all() else (still, 0.0)

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """Replace borders that have turned away from the null vectors."""
        seen = self.seen(x, p)
        pairs = ((seen.right, self.row), (seen.left, self.column))
        if all(ALIGNED * np.linalg.norm(a) * np.linalg.norm(b) < 1 for a, b in pairs):
            return None
        row, column = (a / float(a @ a) for a, _ in pairs)
        return Adaptation(_FoldProblem(self.make_problem, row, column, self.lengths), x, lambda vector: vector)


def _mean(x: Array) -> float:
    """The root mean square."""
    return math.sqrt(float(x @ x) / x.size)


class _CuspEvent(Event):
    """Where the curvature of the curve at its fold passes zero."""

    name = "cusp"

    def value(self, point: Point) -> float:
        """Return ψᵀ F_xx φ φ."""
        problem: Any = point.problem
        return float(problem.seen(point.x, point.parameter).curvature)
