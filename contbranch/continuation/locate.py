"""Zeros of a function of one variable, in few evaluations: each costs a corrected point of the curve."""

from __future__ import annotations

from collections.abc import Callable

Sample = tuple[float, float]

# A position is good enough if the secant's estimate of its error is by this factor.
SECANT_SAFETY = 4.0
# Interpolation from a value below this share of those at the bracket's ends, over less than this share of the distance
# from them, lowers the value at least by the second factor, unless what is left is rounding.
RESOLVED_SHARE, LEAST_DECREASE = 1e-5, 0.5


def find_root(
    function: Callable[[float], float],
    begin: Sample,
    end: Sample,
    tolerance: float = 1e-15,
    relative: float = 0.0,
    guess: float | None = None,
) -> float:
    """Return a zero of a continuous function between two samples of opposite sign.

    Chandrupatla's method: inverse quadratic interpolation where it can be trusted, bisection otherwise; the bracket
    never widens, and convergence is superlinear (T. R. Chandrupatla, Adv. Eng. Softw. 28 (1997) 145). It ends early
    where the function's noise hides the zero.

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
    guess : float, optional
        Where to look first; by default where the secant has its zero.

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
    t = fa / (fa - fb) if guess is None else (guess - a) / (b - a)
    low, high, small = a, b, RESOLVED_SHARE * min(abs(fa), abs(fb))
    c, fc, interpolated = a, fa, True
    for _ in range(100):
        x = a + t * (b - a)
        fx = function(x)
        # By the secant's slope, which may be several times the one at the zero.
        if fx != fa and SECANT_SAFETY * abs(fx * (x - a) / (fx - fa)) <= tolerance + relative * abs(x):
            return x
        least, known = min((abs(fa), a), (abs(fb), b))
        near = abs(x - a) < RESOLVED_SHARE * min(abs(x - low), abs(x - high))
        if interpolated and near and least < small and abs(fx) > LEAST_DECREASE * least:
            return x if abs(fx) < least else known
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
            break
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        interpolated = phi**2 < xi and (1 - phi) ** 2 < 1 - xi
        if interpolated:
            t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        else:
            t = 0.5
        t = min(max(t, limit), 1 - limit)
    return best
