"""The slope dF/dd of the curve from the response to a rigid motion at a fixed rim, which loses no digits."""

from __future__ import annotations

import numpy as np

from contbranch.arrays import Array, magnitude

from .adapt import Solver
from .equations import Equations, Fields

__all__ = ["load_per_displacement", "rates_of_answer"]

# An answer by another state's factors is made good until what is missed no longer falls by this factor, and is taken if
# that is then so small a share of it.
FALLS, MISSED = 0.3, 1e-10


def load_per_displacement(equations: Equations, fields: Fields, solve: Solver | None = None) -> float:
    """dF/dd = 2 (a + ∫_a^∞ δh dt) with (1 − B k A) δh = −B k s, in units of E: rim and its motion do not enter.

    The gap answers a rigid motion by −s (s = 1 without contact), and phi(a) = 0 keeps the motion of the rim out.
    Algebraic tails of the law add what lies beyond the mesh. Exact at any equilibrium but displacement folds, where
    the slope is infinite; where it all but vanishes it is a small number with a small error, which the rate of the
    load along the curve is not.

    Parameters
    ----------
    solve : callable, optional
        Solves linear systems with the Jacobian, nearly, if it is factorised already, here or at a state next to it.
    """
    pushed = equations.answered(fields, np.ones_like(fields.h))
    known = None if solve is None else _made_good(equations, fields, pushed, solve)
    if known is None:
        response = equations.response(fields)
        response.flat[:: len(response) + 1] += 1.0
        answer: Array = np.asarray(np.linalg.solve(response, pushed), dtype=np.float64)
    else:  # the Jacobian is that matrix less pushed rimᵀ (Sherman and Morrison)
        answer = known / (1.0 + equations.rim_row @ known)
    load, displacement = rates_of_answer(equations, fields, answer)
    return load / displacement


def rates_of_answer(equations: Equations, fields: Fields, answer: Array) -> tuple[float, float]:
    """Rates of load and displacement with a rigid motion with which h changes by so much, (N,): tiny far from it."""
    load = 2.0 * (fields.rim.radius + float(fields.rim.weights @ answer))
    beyond, last = equations.beyond(fields), float(fields.rim.plane[-1] @ (answer - 1.0))
    load += beyond.load_per_displacement - beyond.load_per_gap * last
    return load, 1.0 + beyond.shift_per_displacement - beyond.shift_per_gap * last


def _made_good(equations: Equations, fields: Fields, f: Array, solve: Solver) -> Array | None:
    """What the Jacobian takes to f, by a solver that is nearly right; None if that is too far from right."""
    answer, before = solve(f), np.inf
    while True:
        change = solve(f - equations.multiplied(fields, answer))
        missed = magnitude(change)
        if not missed < FALLS * before:
            return answer if missed <= MISSED * magnitude(answer) else None
        answer, before = answer + change, missed
