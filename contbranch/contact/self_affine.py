"""Self-affine random surfaces on a periodic cell."""

from __future__ import annotations

import math

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.contact.height_source import LEAST_POINTS
from contbranch.contact.units import finite_number, positive_number
from contbranch.errors import InputError


def self_affine_heights(
    n: int,
    cell: float,
    hurst: float,
    *,
    rms_slope: float | None = None,
    rms_height: float | None = None,
    seed: int = 0,
    short_cutoff: float | None = None,
    long_cutoff: float | None = None,
) -> Array:
    """Return heights with the power spectrum C(q) ∝ q^(-2(1+H)) between two cutoffs and random phases.

    Every wave within the cutoffs has the amplitude √C(q) exactly and a phase drawn from `seed`; the sum of many is
    Gaussian. The phase of a wave does not depend on `n`: with the same cutoffs, grids of different `n` sample the same
    surface.

    Parameters
    ----------
    n
        Nodes along each edge, at least 8.
    cell
        Edge of the periodic cell.
    hurst
        H from 0 to 1.
    rms_slope, rms_height
        √⟨|∇h|²⟩ or √⟨h²⟩; exactly one of them.
    seed
        Whole number, zero or greater.
    short_cutoff, long_cutoff
        Shortest and longest wavelength; by default four node spacings and the edge of the cell.

    Returns
    -------
    heights
        (n, n), with the mean 0.

    Raises
    ------
    InputError
        If a value is wrong, or no wave of the cell lies within the cutoffs.
    """
    n, seed = _whole(n, "n", LEAST_POINTS), _whole(seed, "seed", 0)
    cell, hurst = positive_number(cell, "cell"), finite_number(hurst, "hurst")
    if not 0.0 <= hurst <= 1.0:
        raise InputError(f"hurst: {hurst:g}; must be from 0 to 1")
    if (rms_slope is None) == (rms_height is None):
        raise InputError("rms_slope, rms_height: give exactly one of them")
    short = 4.0 * cell / n if short_cutoff is None else positive_number(short_cutoff, "short_cutoff")
    long = cell if long_cutoff is None else positive_number(long_cutoff, "long_cutoff")
    if short * n <= 2.0 * cell:
        raise InputError(f"short_cutoff: {short:g}; must be greater than two node spacings, {2.0 * cell / n:g}")
    k, m = _half_plane(math.floor(cell / short * (1.0 + 1e-12)))
    order = np.hypot(k, m)  # wavelength: cell/order
    phase = 2.0 * math.pi * np.random.default_rng(seed).random(k.size)
    inside = (order * short <= cell * (1.0 + 1e-12)) & (order * long >= cell * (1.0 - 1e-12))
    if not np.any(inside):
        raise InputError(f"short_cutoff, long_cutoff: {short:g}, {long:g}; no wave of a cell of {cell:g} lies between")
    k, m, order, phase = k[inside], m[inside], order[inside], phase[inside]
    amplitude = order ** (-1.0 - hurst)
    # Each wave of the half plane, with its conjugate, is 2 a cos(q·x + φ), whose mean square is 2 a².
    if rms_slope is not None:
        wave = 2.0 * math.pi / cell * order
        amplitude *= positive_number(rms_slope, "rms_slope") / math.sqrt(2.0 * float(np.sum((wave * amplitude) ** 2)))
    else:
        amplitude *= positive_number(rms_height, "rms_height") / math.sqrt(2.0 * float(np.sum(amplitude**2)))
    spectrum = np.zeros((n, n), dtype=np.complex128)
    waves = amplitude * np.exp(1j * phase)
    spectrum[k, m] = waves
    spectrum[-k, -m] = np.conj(waves)
    return np.fft.ifft2(spectrum).real * n**2


def _half_plane(largest: int) -> tuple[Integers, Integers]:
    """Return the wave vectors (k, m), one of each pair ±, by max(|k|, |m|): those of a larger grid follow."""
    numbers = np.arange(-largest, largest + 1)
    k, m = (part.ravel() for part in np.meshgrid(numbers, numbers, indexing="ij"))
    half = (k > 0) | ((k == 0) & (m > 0))
    k, m = k[half], m[half]
    order = np.lexsort((m, k, np.maximum(np.abs(k), np.abs(m))))
    return k[order], m[order]


def _whole(value: object, field: str, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{field}: {value!r}; must be a whole number, at least {least}")
    return int(value)
