"""Solutions that fulfil one condition besides, as a curve in a second parameter: a minimally augmented system.

    F(x, p; q) = 0                  solutions
    G(x, p; q) = 0                  the condition: at a fold, the parameter's component of the tangent at fixed q

for the unknowns (x, p), with q as the parameter: one equation and one unknown more than F alone (W. J. F. Govaerts,
Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 4). The tangent v of the curve of solutions
at fixed q comes from the bordered matrix

    [ F_x  F_p ] [ v_x ]   [ 0 ]
    [   c^T    ] [ v_p ] = [ 1 ].

G is taken at the state moved onto the solutions by one Newton step with that matrix, at fixed c·(x, p). Its derivative
is then a multiple of c^T, and only its rates along the two tangents of the surface of solutions (v, and the change with
q at fixed c·(x, p)) are needed, which differences give. They enter the rate of convergence and the tangents, not the
solutions. Where the rate along v vanishes, q turns round: two of these points merge, at a cusp. A condition whose own
derivatives are known takes them instead (`contbranch.continuation.two_parameters`), another column than F_p, too.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np

from contbranch.continuation.bordered import Bordered, as_matrix, bordered_matrix, factorise
from contbranch.continuation.curve import Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.metric import ROUNDING
from contbranch.continuation.newton import border, evaluating, linearise, residual, solve
from contbranch.continuation.problem import Adaptation, Array, Linearisation, Problem

__all__ = ["Augmented", "Sheet", "Turn"]

# A state farther from the solutions than this, relative to itself, is moved onto them before the condition is taken.
ON_SURFACE = 1e-9
# Problems that are kept: those at a point, and as many beside it as a difference takes.
PROBLEMS = 8


@dataclass(frozen=True, eq=False)
class Sheet:
    """The solutions at fixed q around a state: the state with its unit tangent, the linearisation, and its matrix."""

    point: Point
    linear: Linearisation
    bordered: Bordered

    def solve(self, f: Array) -> tuple[Array, float]:
        """The (x, p) with ``F_x x + F_p p = f`` and no component along the border."""
        return solve(self.bordered, f, 0.0, self.point.parameter)


class Augmented(Problem):
    """The augmented system of a family of problems; `inner` and `dual` are those of (x, p).

    Parameters
    ----------
    at : callable
        The problem F at a value of q.
    reference : array (n + 1,)
        Direction (x, p) that borders the matrix, and orients tangents.
    interval : Range
        Of q: beyond it the family need not exist.

    Attributes
    ----------
    aligned : float
        Cosine between the border and the tangent below which the tangent becomes the border.
    """

    aligned: float = 0.7

    def __init__(self, at: Callable[[float], Problem], reference: Array, interval: Range) -> None:
        self.at = at if hasattr(at, "cache_info") else lru_cache(PROBLEMS)(at)
        self.reference, self.interval = reference, interval
        self.border = self.dual(reference / math.sqrt(self.inner(reference, reference)))
        self._own: tuple[Array, float, Sheet] | None = None
        self._nearest: tuple[Array, float, Point] | None = None

    @abstractmethod
    def condition(self, point: Point, q: float) -> float:
        """G at a solution with its unit tangent at fixed q."""

    @abstractmethod
    def on(self, reference: Array) -> Self:
        """The same system with another border."""

    # -- the last component of the state: p, or a function of it ------------------------------------------------------
    def split(self, z: Array) -> tuple[Array, float]:
        """(x, p) of a state."""
        return z[:-1], float(z[-1])

    def stretch(self, w: float) -> float:
        """Derivative of p with respect to the last component."""
        return 1.0

    def inside(self, p: float) -> float:
        """P, or the nearest value for which F is known."""
        return p

    def ahead(self, z: Array, point: Point, s: float) -> tuple[Array, float]:
        """(x, p) at a distance along the tangent, in terms of the state's last component."""
        return point.x + s * point.tangent_x, point.parameter + s * point.tangent_parameter

    def room(self, z: Array, point: Point) -> tuple[float, float]:
        """Distances along the tangent, backwards and forwards, between which F is known."""
        return -math.inf, math.inf

    def length(self, z: Array, point: Point) -> float:
        """Distance along the tangent over which the condition changes by its own size."""
        return 1.0

    def column(self, at: Linearisation) -> Array:
        """What borders F_x besides c."""
        return at.parameter_derivative

    # -- solutions at fixed q -----------------------------------------------------------------------------------------
    def sheet(self, x: Array, p: float, q: float) -> Sheet:
        """Linearisation and tangent at (x, p; q).

        Raises
        ------
        CorrectionError
            If the state cannot be evaluated.
        """
        problem = self.at(q)
        linear = linearise(problem, x, p)
        linear = linear._replace(jacobian=as_matrix(linear.jacobian))
        column = linear._replace(parameter_derivative=self.column(linear))
        bordered = border(problem, x, p, column, (self.border[:-1], float(self.border[-1])))
        tangent = np.append(*solve(bordered, np.zeros_like(x), 1.0, p))
        tangent /= math.sqrt(self.inner(tangent, tangent))
        return Sheet(Point(problem, x, p, tangent[:-1], float(tangent[-1])), linear, bordered)

    def own(self, z: Array, q: float) -> Sheet:
        """The linearisation at a state."""
        if self._own is None or self._own[0] is not z or self._own[1] != q:
            self._own = (z, q, self.sheet(*self.split(z), q))
        return self._own[2]

    def nearest(self, z: Array, q: float) -> Point:
        """The solution next to a state."""
        if self._nearest is None or self._nearest[0] is not z or self._nearest[1] != q:
            own = self.own(z, q)
            point, (dx, dp) = own.point, own.solve(-own.linear.residual)
            if math.sqrt(self.inner(step := np.append(dx, dp), step)) > ON_SURFACE:
                point = self.sheet(point.x + dx, self.inside(point.parameter + dp), q).point
            self._nearest = (z, q, point)
        return self._nearest[2]

    # -- the augmented system -----------------------------------------------------------------------------------------
    def residual(self, x: Array, p: float) -> Array:
        """(F, G), shape (n + 1,)."""
        return np.append(self.own(x, p).linear.residual, self.condition(self.nearest(x, p), p))

    def jacobian(self, x: Array, p: float) -> Any:
        """Derivative of (F, G) with respect to (x, p), shape (n + 1, n + 1)."""
        sheet, stretch = self.own(x, p), self.stretch(float(x[-1]))
        # G changes along the border alone, at its rate along the tangent.
        row = np.append(self.border[:-1] / max(stretch, 1e-8), self.border[-1])
        tangent = np.append(stretch * sheet.point.tangent_x, sheet.point.tangent_parameter)
        row *= self.rate_along(x, sheet.point, p) / float(row @ tangent)
        return bordered_matrix(sheet.linear.jacobian, stretch * sheet.linear.parameter_derivative, row[:-1], row[-1])

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Rates of F with q at fixed (x, p), and of the condition along the surface of solutions, at fixed c·(x, p)."""
        sheet, q = self.own(x, p), p
        x, p = sheet.point.x, sheet.point.parameter
        rate = np.asarray(self.rate_by_q(lambda s: residual(self.at(q + s), x, p), q))
        dx, dp = sheet.solve(-rate)
        return np.append(rate, self.rate_by_q(lambda s: self._level(x + s * dx, self.inside(p + s * dp), q + s), q))

    def rate_by_q(self, of: Callable[[float], Any], q: float) -> Any:
        """Derivative by q of a function of its change.

        The step balances rounding, relative to the size of q, with truncation, relative to the distance from an edge of
        the range, at which derivatives may be infinite.
        """
        back, forth = self.interval.low - q, self.interval.high - q
        size = max(min(1.0, self.interval.width), abs(q))
        distance = min(size, -back, forth)
        if not distance > ROUNDING * size:
            distance = size
        step = (ROUNDING * size * distance**2) ** (1 / 3)
        return self.difference(of, step, back, forth)

    def rate_along(self, z: Array, point: Point, q: float) -> float:
        """Rate of the condition along the tangent at fixed q."""
        length = self.length(z, point) * ROUNDING ** (1 / 3)
        return float(self.difference(lambda s: self._level(*self.ahead(z, point, s), q), length, *self.room(z, point)))

    def difference(self, of: Callable[[float], Any], step: float, low: float, high: float) -> Any:
        """Derivative at zero of a function that is known between two places: a central difference, if there is room.

        To one side otherwise, of the same order.
        """
        if -step >= low and step <= high:
            return (of(step) - of(-step)) / (2 * step)
        side = step if -step < low else -step
        return (4 * of(side) - of(2 * side) - 3 * of(0.0)) / (2 * side)

    def _level(self, x: Array, p: float, q: float) -> float:
        """The condition next to a solution; where it is tangent to the surface a step leaves that by its square."""
        return self.condition(self.sheet(x, p, q).point, q)

    def moved(self, z: Array, q: float) -> Array:
        """Derivative of the solution (x, p) of both equations with respect to q, shape (n + 1,).

        Raises
        ------
        CorrectionError
            If it cannot be evaluated.
        """
        none = np.zeros(z.size)
        with evaluating(q):
            matrix, rate = self.jacobian(z, q), self.parameter_derivative(z, q)
            return solve(factorise(matrix, none, none, 1.0), -rate, 0.0, q)[0]

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A border close to the tangent, where the present one no longer is."""
        tangent = tangent_of(self.nearest(x, p))
        if abs(float(self.border @ tangent)) >= self.aligned:
            return None
        return Adaptation(self.on(tangent), x, lambda vector: vector)


def tangent_of(point: Point) -> Array:
    """The tangent (x, p) of a point, shape (n + 1,)."""
    return np.append(point.tangent_x, point.tangent_parameter)


class Turn(Event):
    """The parameter q turns round, and two solutions of both equations merge: of folds, at a cusp."""

    name = "cusp"
    noise = 2e-10  # of differences in tangents

    def value(self, point: Point) -> float:
        """Component of the tangent."""
        return point.tangent_parameter
