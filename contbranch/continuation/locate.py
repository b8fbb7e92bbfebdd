"""Zeros of a function of one variable, in few evaluations: each costs a corrected point of the curve."""

from __future__ import annotations

import math
from collections.abc import Callable

__all__ = ["find_root", "sign_changes"]

Sample = tuple[float, float]

# A hidden pair closer to an end than this share of the interval is not looked for.
BESIDE = 1e-4
# A smallest value that has not fallen much in this many trials is taken for the smallest.
PATIENCE = 3


def find_root(
    function: Callable[[float], float], begin: Sample, end: Sample, tolerance: float = 1e-15, relative: float = 0.0
) -> float:
    """Return a zero of a continuous function between two samples of opposite sign.

    Chandrupatla's method: inverse quadratic interpolation where it can be trusted, bisection otherwise; the bracket
    never widens, and convergence is superlinear (T. R. Chandrupatla, Adv. Eng. Softw. 28 (1997) 145).

    Parameters
    ----------
    function : callable
        Evaluated inside the bracket only.
    begin, end : (position, value)
        The bracket.
    tolerance : float
        Absolute width to which the position is determined.
    relative : float
        Width relative to the position that is enough.

    Raises
    ------
    ValueError
        If the values have the same sign.
    """
    (a, fa), (b, fb) = end, begin
    if fa == 0.0:
        return a
    if fb == 0.0:
        return b
    if (fa > 0) == (fb > 0):
        raise ValueError("find_root needs values of opposite sign at both ends.")
    t = fa / (fa - fb)  # first guess: the secant
    c, fc = a, fa
    for _ in range(100):
        x = a + t * (b - a)
        fx = function(x)
        if (fx > 0) == (fa > 0):
            c, fc = a, fa
        else:
            c, fc = b, fb
            b, fb = a, fa
        a, fa = x, fx
        best = a if abs(fa) < abs(fb) else b
        width = abs(b - a)
        resolution = (2e-16 + 0.5 * relative) * abs(best) + 0.5 * tolerance
        limit = resolution / width if width > 0 else 1.0
        if limit > 0.5 or fa == 0.0:
            return best if fa != 0.0 else a
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        else:
            t = 0.5
        t = min(max(t, limit), 1 - limit)
    return best


def sign_changes(
    function: Callable[[float], float], begin: Sample, end: Sample, guess: float | None = None
) -> list[tuple[Sample, Sample]]:
    """Return the brackets of a function's zeros between two samples, a hidden pair of zeros included.

    Parameters
    ----------
    function : callable
        Evaluated only if `guess` is given.
    begin, end : (position, value)
        The ends.
    guess : float, optional
        Where the function is suspected to come closest to zero, or to have the other sign, between ends of the same
        sign. From there (or from right beside an end, if the guess is no closer to zero than the ends are) the
        smallest value is sought by parabolas until a sign change is seen or excluded.
    """
    if end[1] == 0.0 or (begin[1] > 0) != (end[1] > 0):
        return [(begin, end)]
    if guess is None:
        return []
    middle = _other_sign(function, begin, end, guess)
    return [] if middle is None else [(begin, middle), (middle, end)]


def _other_sign(function: Callable[[float], float], begin: Sample, end: Sample, guess: float) -> Sample | None:
    """Return a sample of the other sign between two of the same sign, None if the function stays away from zero."""
    sign = 1.0 if begin[1] > 0 else -1.0

    def distance(position: float) -> float:
        return sign * function(position)

    left, right = (begin[0], sign * begin[1]), (end[0], sign * end[1])
    width = end[0] - begin[0]
    middle = (guess, distance(guess))
    for beside in (begin[0] + BESIDE * width, end[0] - BESIDE * width):
        if middle[1] >= min(left[1], right[1]):
            middle = (beside, distance(beside))
    resting = 0
    for _ in range(60):
        if middle[1] <= 0:
            return middle[0], sign * middle[1]
        if middle[1] >= min(left[1], right[1]) or resting == PATIENCE:
            return None
        vertex, lowest = _vertex(left, middle, right)
        width = right[0] - left[0]
        if width < 1e-14 or not math.isfinite(vertex):
            return None
        # Two samples must not coincide: step a little to the longer side instead.
        if abs(vertex - middle[0]) < 1e-3 * width:
            longer = 1.0 if right[0] - middle[0] > middle[0] - left[0] else -1.0
            vertex = middle[0] + longer * 1e-2 * width
        before = middle[1]
        left, middle, right = _narrow(left, middle, right, (vertex, distance(vertex)))
        resting = resting + 1 if middle[1] > 0.7 * before and lowest > 0 else 0
    return None


def _vertex(left: Sample, middle: Sample, right: Sample) -> Sample:
    """Return the lowest point of the parabola through three samples, the middle one lowest."""
    h0, h1 = middle[0] - left[0], right[0] - middle[0]
    s0, s1 = (middle[1] - left[1]) / h0, (right[1] - middle[1]) / h1
    bend = (s1 - s0) / (h0 + h1)
    slope = (s0 * h1 + s1 * h0) / (h0 + h1)
    if bend <= 0:
        return math.nan, math.nan
    return middle[0] - slope / (2 * bend), middle[1] - slope**2 / (4 * bend)


def _narrow(left: Sample, middle: Sample, right: Sample, trial: Sample) -> tuple[Sample, Sample, Sample]:
    """Return the three samples around the lowest value, one of four left out."""
    first, second = (trial, middle) if trial[0] < middle[0] else (middle, trial)
    if first[1] <= second[1]:
        return left, first, second
    return first, second, right
