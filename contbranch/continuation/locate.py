"""Zeros of a function of one variable, each value of which costs a corrected point of the curve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

Sample = tuple[float, float]


def find_root(
    function: Callable[[float], float],
    begin: Sample,
    end: Sample,
    tolerance: float = 1e-15,
    relative: float = 0.0,
    guess: float | None = None,
) -> float:
    """Return a zero of a continuous function between two samples of opposite sign, by Brent's method.

    Parameters
    ----------
    function : callable
        Evaluated inside the bracket only.
    begin, end : (position, value)
        The bracket.
    tolerance : float
        Absolute error of the position that is allowed.
    relative : float
        Error relative to the position that is allowed.
    guess : float, optional
        Where to look first.

    Raises
    ------
    ValueError
        If the values have the same sign.
    """
    known = dict((begin, end))
    if (begin[1] > 0.0) == (end[1] > 0.0) and begin[1] != 0.0 and end[1] != 0.0:
        raise ValueError("find_root needs values of opposite sign at both ends.")

    def value(place: float) -> float:
        if place not in known:
            known[place] = function(place)
        return known[place]

    low, high = sorted((begin[0], end[0]))
    if guess is not None and low < guess < high and 0.0 not in known.values():
        low, high = (low, guess) if (value(guess) > 0.0) != (value(low) > 0.0) else (guess, high)
    rounding, tiny = 4 * float(np.finfo(float).eps), float(np.finfo(float).tiny)
    xtol, rtol = max(tolerance, tiny), max(relative, rounding)
    return float(brentq(value, low, high, xtol=xtol, rtol=rtol, full_output=True, disp=False)[0])
