"""What a problem F(x, p) = 0 must offer to be followed."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbranch.arrays import Array

if TYPE_CHECKING:
    from contbranch.continuation.curve import Point

__all__ = ["Adaptation", "Array", "Direction", "Linearisation", "Problem", "Solution", "UnresolvedError", "size_of"]


# A state and a parameter, or their rates.
Direction = tuple[Array, float]

_CUBE_ROOT_OF_ROUNDING = float(np.finfo(float).eps ** (1 / 3))


def size_of(problem: Problem, u: Array) -> float:
    """Return the norm of a state that belongs to `Problem.inner`."""
    return math.sqrt(max(problem.inner(u, u), 0.0))


class UnresolvedError(Exception):
    """Raised by `Problem.examine`: a solution that its discretisation does not resolve.

    A step to it is repeated on the discretisation that `Problem.adapt` offers for it, or shorter.
    """


class Linearisation(NamedTuple):
    """Residual (n,), Jacobian (n, n) and derivative with respect to the parameter (n,) at one point."""

    residual: Array
    jacobian: Any
    parameter_derivative: Array


class Solution(NamedTuple):
    """A solution and a direction of the curve there: state, parameter, and their rates."""

    x: Array
    parameter: float
    tangent_x: Array
    tangent_parameter: float


class Adaptation(NamedTuple):
    """A new discretisation of the same curve.

    Attributes
    ----------
    problem : Problem
        The problem on the new discretisation. The old one stays untouched: earlier points still belong to it.
    x : (m,) array
        The state, carried over to the new discretisation.
    transfer : callable, optional
        Carries any vector of states, a tangent for instance, from the old discretisation to the new one.
    moved : callable, optional
        Carries a state and a tangent of the curve there, ``moved(x, p, tangent_x, tangent_p)``, where that depends on
        the state.
    """

    problem: Problem
    x: Array
    transfer: Callable[[Array], Array] | None = None
    moved: Callable[[Array, float, Array, float], tuple[Array, Array]] | None = None


class Problem(ABC):
    """A family of equations F(x, p) = 0 with n unknowns x and one parameter p.

    Only `residual` must be written; a `jacobian` makes it fast. A problem should be a function of (x, p) alone: the
    curve is followed in two directions, and every point keeps the problem object it was computed with.

    Attributes
    ----------
    ordered : bool
        Whether the parameter changes one way along the curve, and so is a coordinate on it: a step that turns it is
        repeated shorter.
    """

    ordered: bool = False

    @abstractmethod
    def residual(self, x: Array, p: float) -> Array:
        """Return F(x, p), shape (n,)."""

    def jacobian(self, x: Array, p: float) -> Any:
        """Return dF/dx, shape (n, n): a dense array, a scipy sparse matrix or array, or a LinearOperator.

        Default: central differences, column by column, 2n residuals. The steps are h = 6e-6 max(|x_i|, r, 1), r the
        root mean square of x, and the error about h²/6 times the third derivatives plus 1e-11 |F|: nine to ten digits
        of a function that varies over lengths of order one. Points, folds and branch points stay as accurate as the
        residual, whose zeros they are; they are only reached a little more slowly.
        """
        size = max(1.0, math.sqrt(float(x @ x) / x.size))
        matrix = np.empty((x.size, x.size))
        for i, step in enumerate(_CUBE_ROOT_OF_ROUNDING * np.maximum(np.abs(x), size)):
            above, below = x.copy(), x.copy()
            above[i] += step
            below[i] -= step
            matrix[:, i] = (self.residual(above, p) - self.residual(below, p)) / (above[i] - below[i])
        return matrix

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Return dF/dp, shape (n,). Default: a central difference, with an error of about 1e-10 relative."""
        step = _CUBE_ROOT_OF_ROUNDING * max(1.0, abs(p))
        above, below = p + step, p - step
        difference: Array = (self.residual(x, above) - self.residual(x, below)) / (above - below)
        return difference

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Return residual, Jacobian and parameter derivative together, for problems where they share work."""
        return Linearisation(self.residual(x, p), self.jacobian(x, p), self.parameter_derivative(x, p))

    def product(self, x: Array, p: float) -> Callable[[Array], Array]:
        """Return what multiplies a vector by dF/dx at little cost, and with as small rounding errors as that allows.

        With it, or with a sparse Jacobian, accurate points and tangents need no factorisation of their own: the one of
        a point next to them serves. Default: the Jacobian.
        """
        together = type(self).jacobian is Problem.jacobian and type(self).linearise is not Problem.linearise
        jacobian = self.linearise(x, p).jacobian if together else self.jacobian(x, p)
        return lambda vector: jacobian @ vector

    def second_derivative(self, x: Array, p: float, u: Array, a: float) -> Array | None:
        """Return the second derivative of F along (u, a), d²F(x + s u, p + s a)/ds² at s = 0, shape (n,).

        Default: None, and the engine takes a second difference of residuals. It enters the rate at which folds
        are located, not their position.
        """
        return None

    def inner(self, u: Array, v: Array) -> float:
        """Return the inner product of two states, which measures steps and angles.

        Default: the mean of u v, so that refining a uniform grid changes neither steps nor number of points. On a
        graded mesh, override it (and `dual`) with the quadrature of the integral of u v.
        """
        return float(u @ v) / u.size

    def dual(self, u: Array) -> Array:
        """Return the vector w with w @ v = inner(u, v) for all v. Default: u/n."""
        return u / u.size

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """Return named numbers to record at every point. Default: none."""
        return {}

    def examine(self, x: Array, p: float) -> None:
        """Look at the solution to which a step has led. Default: whatever was found is resolved.

        Raises
        ------
        UnresolvedError
            If the discretisation does not resolve it.
        """
        return

    def morse_index(self, x: Array, p: float) -> int | None:
        """Return the number of unstable directions, None if it is not known (the default)."""
        return None

    def preconditioner(self, x: Array, p: float) -> Callable[[Array], Array] | None:
        """Return a function that applies an approximate inverse of dF/dx; only for Jacobians without matrix."""
        return None

    def in_plane(self, x: Array, p: float, row: Direction, precise: bool) -> Solution | None:
        """Return the solution near (x, p) where `row` has the value that it has there, by means of the problem's own.

        Default: None, and the engine takes Newton's method with `linearise`. For problems that are not smooth, and for
        those whose linear systems have solvers of their own. `precise` asks for an accurate tangent.

        Raises
        ------
        CorrectionError
            If it was not found.
        """
        return None

    def corner(self, point: Point) -> tuple[Point, Point] | None:
        """Return the next corner of a piecewise smooth curve ahead of a point, with the tangents before and behind it.

        Asked for where steps that pass corners have become too short. Default: None, the curve has none.

        Raises
        ------
        CorrectionError
            If it was not found.
        """
        return None

    @property
    def by_corners(self) -> bool:
        """Whether the curve is followed from corner to corner, without steps that pass some."""
        return False

    def farthest(self, p: float) -> float:
        """Return the largest change of the parameter in a step from p. Default: infinite."""
        return math.inf

    def adapt(self, x: Array, p: float) -> Adaptation | Array | None:
        """Offer a better discretisation after an accepted point; None (the default) keeps the present one.

        An array alone is the state on the new discretisation of the same problem object (which then tells the
        discretisations apart by their length).
        """
        return None
