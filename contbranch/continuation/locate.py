"""Zeros of a function of one variable, in few evaluations: each costs a corrected point of the curve."""

from __future__ import annotations

from collections.abc import Callable

Sample = tuple[float, float]

# A position is good enough if the secant's estimate of its error is by this factor.
SECANT_SAFETY = 4.0
# Where the bracket is so narrow, as a share of the first, and values so small, of those at its ends, a value that is
# larger than one farther from the zero is noise; after so many the zero cannot be told any better.
NARROW, SMALL, ROUGH = 1e-3, 0.1, 2


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
    if fa == 0.0 or fb == 0.0:
        return a if fa == 0.0 else b
    if (fa > 0) == (fb > 0):
        raise ValueError("find_root needs values of opposite sign at both ends.")
    t = fa / (fa - fb) if guess is None else (guess - a) / (b - a)
    narrow, small, rough = NARROW * abs(b - a), SMALL * min(abs(fa), abs(fb)), 0
    for _ in range(100):
        x = a + t * (b - a)
        fx = function(x)
        # By the secant's slope, which may be several times the one at the zero.
        if fx != fa and SECANT_SAFETY * abs(fx * (x - a) / (fx - fa)) <= tolerance + relative * abs(x):
            return x
        same = (fx > 0) == (fa > 0)
        rough += abs(b - a) < narrow and abs(fa if same else fb) < abs(fx) < small
        if rough == ROUGH:
            return min((abs(fa), a), (abs(fb), b), (abs(fx), x))[1]
        if same:
            c, fc = a, fa
        else:
            c, fc, b, fb = b, fb, a, fa
        a, fa = x, fx
        best, width = a if abs(fa) < abs(fb) else b, abs(b - a)
        resolution = (2e-16 + 0.5 * relative) * abs(best) + 0.5 * tolerance
        limit = resolution / width if width > 0 else 1.0
        if limit > 0.5 or fa == 0.0:
            break
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        t = 0.5
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        t = min(max(t, limit), 1 - limit)
    return best
