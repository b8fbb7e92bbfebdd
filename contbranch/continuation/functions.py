"""Plain functions f(x, p) as problems, and what is asked of whatever problem is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import issparse

from contbranch.continuation.deflation import search
from contbranch.continuation.newton import evaluating, linearise
from contbranch.continuation.problem import Array, Problem
from contbranch.errors import InputError
from contbranch.watch import watched

Function = Callable[[Array, float], npt.ArrayLike]
JacobianFunction = Callable[[Array, float], Any]


class FunctionProblem(Problem):
    """F(x, p) = 0 given by functions. They may change the x that they are given, and what they return is copied."""

    def __init__(self, function: Function, derivative: Function | None) -> None:
        self.function, self.derivative = function, derivative

    def residual(self, x: Array, p: float) -> Array:
        """Return F(x, p)."""
        return _copied(self.function(x.copy(), p), 1)

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Return dF/dp: what the function given returns, otherwise a difference."""
        if self.derivative is None:
            return super().parameter_derivative(x, p)
        return _copied(self.derivative(x.copy(), p), 1)


class _WithJacobian(FunctionProblem):
    """The same with a function for the Jacobian."""

    def __init__(self, function: Function, derivative: Function | None, matrix: JacobianFunction) -> None:
        super().__init__(function, derivative)
        self.matrix = matrix

    def jacobian(self, x: Array, p: float) -> Any:
        """Return dF/dx."""
        found = self.matrix(x.copy(), p)
        return found if issparse(found) or hasattr(found, "matvec") else _copied(found, 2)


def _copied(value: npt.ArrayLike, dimensions: int) -> Array:
    """A copy as an array of real numbers; of one equation a number will do."""
    found = np.array(value, ndmin=dimensions if np.size(value) == 1 else 0)
    return found.astype(float, casting="same_kind")


def as_problem(
    f: Problem | Function,
    jacobian: JacobianFunction | None = None,
    parameter_derivative: Function | None = None,
) -> Problem:
    """Return a problem as it is, and functions of (x, p) as a problem.

    Raises
    ------
    TypeError
        If f is neither, or a problem is given with functions for its derivatives.
    """
    if isinstance(f, Problem):
        if jacobian is not None or parameter_derivative is not None:
            raise TypeError(f"f is a {type(f).__name__}, whose own methods give the derivatives: leave them out.")
        return f
    if isinstance(f, type):
        raise TypeError(f"f is the class {f.__name__}: give an object of it, {f.__name__}(...).")
    if not callable(f):
        raise TypeError(f"f is {f!r}: give a function f(x, p) or an object of a subclass of Problem.")
    if jacobian is None:
        return FunctionProblem(f, parameter_derivative)
    return _WithJacobian(f, parameter_derivative, jacobian)


def checked(problem: Problem, x: Array, p: float) -> Callable[[], None]:
    """Look at what the problem returns at the start; return what looks later whether that has been written over.

    Raises
    ------
    InputError
        If something has another shape than it must have.
    CorrectionError
        If the problem fails.
    """
    owner = type(problem).__name__
    written: list[tuple[Any, int]] = []

    def check(name: str, value: Any, wanted: tuple[int, ...]) -> None:
        memory: Any = getattr(value, "data", None)
        if hasattr(memory, "tobytes"):
            written.append((memory, hash(memory.tobytes())))
        shape = np.shape(value) or getattr(value, "shape", ())
        if shape != wanted:
            whose = name.replace("residual", "f") if isinstance(problem, FunctionProblem) else f"{owner}.{name}"
            how = ", for instance by numpy.ravel" if shape == (*wanted, 1) else ""
            raise InputError(f"{whose} has the shape {shape}: return {wanted}{how}.")

    with evaluating(p):
        first = problem.residual(x, p)
    check("residual", first, x.shape)
    at = linearise(problem, x, p)
    check("parameter_derivative", at.parameter_derivative, x.shape)
    check("jacobian", at.jacobian, 2 * x.shape)

    def unchanged() -> None:
        if any(hash(place.tobytes()) != before for place, before in written):
            raise InputError(f"{owner} writes what it returns into the same array again: return a new one, by .copy().")

    return unchanged


def other_solutions(
    f: Problem | Function,
    p: float,
    known: Iterable[npt.ArrayLike],
    starts: Iterable[npt.ArrayLike],
    *,
    jacobian: JacobianFunction | None = None,
) -> list[Array]:
    """Look for solutions of F(x, p) = 0 at one p besides those already known, on whichever curve they lie.

    Newton's method is applied to M(x) F(x, p) = 0 with M(x) = ∏ (1/‖x − x_k‖² + 1) over the solutions x_k already
    known, which does not vanish at them (deflation: P. E. Farrell, A. Birkisson and S. W. Funke, SIAM J. Sci. Comput.
    37 (2015) A2026). Every start is used until it leads to nothing new. What is found is a start for `trace_curve`;
    that nothing is found does not prove that there is nothing.

    Parameters
    ----------
    f : callable or Problem
        F, as for `trace_curve`.
    p : float
        Parameter.
    known : iterable of (n,) array_like
        Solutions at p; may be empty.
    starts : iterable of (n,) array_like
        Where Newton's method begins: a known solution with a disturbance, or a guess.
    jacobian : callable, optional
        dF/dx as a function of (x, p), where f is a function.

    Returns
    -------
    list of (n,) arrays
        Solutions, each different from the known ones and from one another, in the order in which they were found.

    Raises
    ------
    TypeError
        If f is neither a function nor a `Problem`.
    """
    problem = as_problem(f, jacobian)
    with watched(), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return search(problem, float(p), [_copied(x, 1) for x in known], (_copied(x, 1) for x in starts))
