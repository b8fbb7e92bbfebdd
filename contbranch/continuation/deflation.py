"""Deflated Newton's method: further solutions of F(x, p) = 0 at one p, besides those already known.

With the known solutions x_k the method solves ``M(x) F(x, p) = 0``, ``M(x) = prod_k (1/|x − x_k|² + 1)``, which does
not vanish at them. The Newton step of the product is the plain one times a number (P. E. Farrell, A. Birkisson and
S. W. Funke, SIAM J. Sci. Comput. 37 (2015) A2026), so that a Jacobian and its factorisation are all it takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from contbranch.continuation.bordered import SingularBorderedError, factorise
from contbranch.continuation.newton import START_CORRECTIONS
from contbranch.continuation.problem import Array, Problem, size_of
from contbranch.watch import check

# Longest step, relative to the size of the state or the distance of the known solutions.
LONGEST_STEP = 0.5
# Size of a correction at which a solution is found.
SOLVED = 1e-9


def deflated_newton(
    problem: Problem,
    p: float,
    known: Sequence[Array],
    start: Array,
) -> Array | None:
    """Look for a solution other than the known ones, from one start.

    Parameters
    ----------
    problem : Problem
    p : float
        Parameter.
    known : sequence of (n,) arrays
        Solutions at p to keep away from.
    start : (n,) array

    Returns
    -------
    (n,) array or None
        A new solution; None if none was reached.

    Raises
    ------
    UnsolvedError
        If GMRES does not converge for a Jacobian without matrix.
    """
    x, border = np.array(start, dtype=float), np.zeros(np.size(start))
    for _ in range(START_CORRECTIONS):
        check()
        at = problem.linearise(x, p)
        if not np.isfinite(at.residual).all():
            return None
        try:
            bordered = factorise(at.jacobian, border, border, 1.0, problem.preconditioner(x, p))
            step, _ = bordered.solve(-at.residual, 0.0)
        except SingularBorderedError:
            return None
        length, nearest = size_of(problem, step), min((size_of(problem, x - one) for one in known), default=math.inf)
        if not math.isfinite(length):
            return None
        if length < SOLVED:
            return x + step if nearest > 1e3 * SOLVED else None
        factor = _factor(problem, x, step, known)
        longest = LONGEST_STEP * max(min(nearest, 1.0 + size_of(problem, x)), 0.1)
        x = x + factor * min(1.0, longest / (abs(factor) * length)) * step
    return None


def _factor(problem: Problem, x: Array, step: Array, known: Sequence[Array]) -> float:
    """Length of the deflated step in units of the plain one: 1/(1 − d ln M), d along the plain step."""
    rest = 1.0
    for apart in (x - other for other in known):
        square = max(problem.inner(apart, apart), 1e-300)
        rest += 2.0 * problem.inner(apart, step) / (square * (1.0 + square))
    return 1.0 / rest if rest else 1.0


def search(
    problem: Problem,
    p: float,
    known: Sequence[Array],
    starts: Iterable[Array],
) -> list[Array]:
    """Solutions besides the known ones that deflated Newton's method reaches from some starts.

    Every start is used until it yields nothing new.

    Parameters
    ----------
    problem, p, known
        As in `deflated_newton`.
    starts : iterable of (n,) arrays

    Returns
    -------
    list of (n,) arrays
        What was found, in the order in which it was.
    """
    found: list[Array] = []
    for start in starts:
        while (solution := deflated_newton(problem, p, [*known, *found], start)) is not None:
            found.append(solution)
    return found
