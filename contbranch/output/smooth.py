"""Cubics through knots, as in scipy.interpolate, whose import takes twice as long as the trace of a curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

__all__ = ["monotonic", "spline"]

Array = NDArray[np.float64]


def monotonic(knots: Array, values: Array, at: Array) -> Array:
    """Interpolate without overshoot (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 300 (1984)); two knots: a line.

    Slopes are weighted harmonic means of those of the neighbouring steps, zero where these differ in sign.
    """
    step, chord = _steps(knots, values)
    if len(knots) == 2:
        return np.interp(at, knots, values)
    weights = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    left, right = chord[:-1], chord[1:]
    same = left * right > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (weights[0] + weights[1]) / (weights[0] / left + weights[1] / right)
    ends = [_end(*step[:2], *chord[:2]), _end(*step[:-3:-1], *chord[:-3:-1])]
    return _hermite(knots, values, np.concatenate([ends[:1], np.where(same, mean, 0.0), ends[1:]]), at)


def spline(knots: Array, values: Array, at: Array) -> Array:
    """Interpolate with two continuous derivatives, the third one also at the last knot but one at either end."""
    step, chord = _steps(knots, values)
    if len(knots) == 3:  # one parabola
        return np.asarray(np.polynomial.polynomial.Polynomial.fit(knots, values, 2)(at))
    bands, right = np.empty((3, len(knots))), np.empty(len(knots))
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = step[:-1], 2.0 * (step[1:] + step[:-1]), step[1:]
    right[1:-1] = 3.0 * (step[1:] * chord[:-1] + step[:-1] * chord[1:])
    for row, beside, (h, k), (m, n) in ((0, (0, 1), step[:2], chord[:2]), (-1, (2, -2), step[:-3:-1], chord[:-3:-1])):
        bands[1, row], bands[beside], right[row] = k, h + k, ((2.0 * (h + k) + h) * k * m + h * h * n) / (h + k)
    return _hermite(knots, values, solve_banded((1, 1), bands, right), at)


def _steps(knots: Array, values: Array) -> tuple[Array, Array]:
    """Lengths of the steps and slopes of the chords."""
    step = np.diff(knots)
    return step, np.diff(values) / step


def _end(step: float, beyond: float, chord: float, next_chord: float) -> float:
    """The slope at an end: of the parabola through three knots, unless that would overshoot."""
    slope = ((2.0 * step + beyond) * chord - step * next_chord) / (step + beyond)
    if slope * chord <= 0.0:
        return 0.0
    return 3.0 * chord if chord * next_chord <= 0.0 and abs(slope) > 3.0 * abs(chord) else slope


def _hermite(knots: Array, values: Array, slopes: Array, at: Array) -> Array:
    """The cubics with these values and slopes at the knots."""
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    h = knots[i + 1] - knots[i]
    t = (at - knots[i]) / h
    rise = values[i + 1] - values[i]
    start, stop = h * slopes[i], h * slopes[i + 1]
    return np.asarray(values[i] + t * (start + t * (3.0 * rise - 2.0 * start - stop + t * (start + stop - 2.0 * rise))))
