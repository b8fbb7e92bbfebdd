"""Cubics through knots, without scipy.interpolate, whose import takes twice as long as the trace of a curve."""

from __future__ import annotations

import numpy as np

from contbranch.arrays import Array

_FINE = 32  # points for each step of a path


def smooth(knots: Array, values: Array, at: Array, *, bounded: bool = True, flat: bool = False) -> Array:
    """Interpolate with cubics whose slopes at the knots are those of parabolas through neighbours; two knots: a line.

    `flat`: its slope at the last end is zero.

    Where it would leave the range of two neighbouring values its slopes are reduced (`bounded`), as by Hyman, SIAM J.
    Sci. Stat. Comput. 4, 645 (1983): to three times the smaller slope of the chords beside the knot, and to zero where
    these differ in sign.
    """
    if len(knots) < 3:
        return np.interp(at, knots, values)
    step = np.diff(knots)
    chord = np.diff(values) / step
    slopes = np.gradient(values, knots, edge_order=2)
    slopes[-1] *= not flat
    if bounded:
        before, after = np.append(chord[:1], chord), np.append(chord, chord[-1:])
        largest = 3.0 * np.minimum(np.abs(before), np.abs(after)) * (before * after > 0.0)
        slopes = np.sign(before) * np.clip(np.sign(before) * slopes, 0.0, largest)
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    t, rise, start, stop = (at - knots[i]) / step[i], step[i] * chord[i], step[i] * slopes[i], step[i] * slopes[i + 1]
    return values[i] + t * (start + t * (3.0 * rise - 2.0 * start - stop + t * (start + stop - 2.0 * rise)))


def smooth_path(*columns: Array, bounded: bool = True, flat: bool = False) -> list[Array]:
    """Fill in the steps of a path, given as columns (N,), with cubics of the chord length in units of its extent.

    If it ends `flat`, at a fold, the first column, and what is equal to it, has an extremum there.
    """
    step = np.linalg.norm([np.diff(column) / (np.ptp(column) or 1.0) for column in columns], axis=0)
    kept = np.append(True, step > 0.0)
    length = np.append(0.0, np.cumsum(step[step > 0.0]))
    count = len(length) - 1
    at = np.interp(np.linspace(0.0, count, _FINE * count + 1), np.arange(count + 1), length)
    ends = [flat and np.array_equal(column, columns[0]) for column in columns]
    return [smooth(length, c[kept], at, bounded=bounded, flat=end) for c, end in zip(columns, ends, strict=True)]
