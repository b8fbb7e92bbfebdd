"""Tabulated numbers: their check, and the smooth energy of a tabulated law."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from contbranch.errors import InputError

__all__ = ["EnergyTable", "increasing_from_zero", "numbers"]

FloatArray = NDArray[np.float64]

_LEAST_ROWS: Final = 4
_QUINTIC_ROWS: Final = 8
_DECAYED: Final = 0.01  # a law whose table ends below this part of its maximum is taken to zero


def numbers(values: object, field: str) -> FloatArray:
    """Return `values` as a (n,) array of finite floats, n ≥ 4; InputError, naming `field`, if they are not."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{field}: not all are numbers; must be a list of numbers") from None
    if array.ndim != 1 or array.size < _LEAST_ROWS:
        raise InputError(f"{field}: shape {array.shape}; must be a list of at least {_LEAST_ROWS} numbers")
    if not np.all(np.isfinite(array)):
        bad = int(np.flatnonzero(~np.isfinite(array))[0])
        raise InputError(f"{field}: entry {bad + 1} is {array[bad]}; must be finite numbers")
    return array


def columns(part: object, first: str, second: str) -> tuple[FloatArray, FloatArray]:
    """Return two fields of a frozen dataclass as (n,) arrays and keep them as tuples; the first starts at 0 and rises.

    Raises
    ------
    InputError
        If they are not lists of numbers of one length, or the first is not such.
    """
    one, other = (numbers(getattr(part, name), name) for name in (first, second))
    increasing_from_zero(one, first)
    if other.size != one.size:
        raise InputError(f"{second}: {other.size} numbers for {one.size} {first}; must be as many")
    for name, array in ((first, one), (second, other)):
        object.__setattr__(part, name, tuple(array.tolist()))
    return one, other


def increasing_from_zero(array: FloatArray, field: str) -> None:
    """Raise InputError, naming `field`, unless the (n,) array starts at 0 and increases strictly."""
    if array[0] != 0.0:
        raise InputError(f"{field}: the first is {array[0]:g}; must start at 0")
    steps = np.diff(array)
    if np.any(steps <= 0.0):
        bad = int(np.flatnonzero(steps <= 0.0)[0])
        raise InputError(f"{field}: entry {bad + 2} is not above entry {bad + 1}; must increase strictly")


@dataclass(frozen=True, eq=False)
class EnergyTable:
    """Energy per area as a piecewise polynomial of the gap, from the origin of the table to its end.

    Attributes
    ----------
    starts
        (m,) where the pieces start; the last piece, beyond the end, is 0 or NaN.
    coefficients
        (k, m) of the powers of (gap - start), highest first.
    limitation
        What is missing beyond the end, in words; empty if the law has decayed there.
    """

    starts: FloatArray
    coefficients: FloatArray
    integral: scipy.interpolate.PPoly
    limitation: str
    energy_at_contact: float
    largest_energy: float
    largest_pressure: float

    @staticmethod
    def of(gaps: FloatArray, values: FloatArray, kind: str) -> EnergyTable:
        """Return the table of (n,) `values`, which are "energies" or "pressures", at (n,) `gaps`.

        Raises
        ------
        InputError
            If the lengths differ, the gaps do not increase from 0, or the law has no energy at contact.
        """
        increasing_from_zero(gaps, "gaps")
        if values.size != gaps.size:
            raise InputError(f"{kind}: {values.size} numbers for {gaps.size} gaps; must be as many")
        # Energies are differentiated once more: both give a pressure with continuous curvature, whose kinks cost
        # digits.
        spline = scipy.interpolate.make_interp_spline(
            gaps, values, k=5 if kind == "energies" and gaps.size >= _QUINTIC_ROWS else 3
        )
        pieces = scipy.interpolate.PPoly.from_spline((spline.t, spline.c, spline.k))
        pieces = scipy.interpolate.PPoly(pieces.c[:, np.diff(pieces.x) > 0], np.unique(pieces.x))
        smooth = range(spline.k)
        level, slope, *higher = (float(spline(gaps[-1], order)) for order in smooth)
        decayed = abs(level) <= _DECAYED * np.max(np.abs(values))
        if kind == "energies":  # a constant tail has no force, so the force must have decayed as well
            decayed = decayed and abs(slope) <= _DECAYED * np.max(np.abs(spline(gaps, 1)))
        if decayed:
            pieces = _joined(pieces, _to_zero(float(gaps[-1]), float(gaps[-2]), (level, slope, *higher)))
        if kind == "pressures":
            pieces = _energy_of_pressure(pieces)
        limitation = "" if decayed else f"the table of {kind} ends at a gap of {gaps[-1]:g} before the law has decayed"
        return EnergyTable._of_pieces(pieces, gaps, limitation)

    @staticmethod
    def _of_pieces(pieces: scipy.interpolate.PPoly, gaps: FloatArray, limitation: str) -> EnergyTable:
        dense = np.concatenate([gaps, 0.5 * (gaps[1:] + gaps[:-1])])
        largest_energy = float(np.max(np.abs(pieces(dense))))
        largest_pressure = float(np.max(np.abs(pieces(dense, 1))))
        at_contact = float(pieces(0.0))
        if at_contact == 0.0 or largest_pressure == 0.0:
            raise InputError(
                "gaps: the law has no energy at gap 0; give a table whose energy does not vanish at contact"
            )
        beyond = np.full((pieces.c.shape[0], 1), 0.0 if not limitation else math.nan)
        coefficients = np.ascontiguousarray(np.concatenate([pieces.c, beyond], axis=1))
        return EnergyTable(
            starts=np.array(pieces.x),
            coefficients=coefficients,
            integral=pieces.antiderivative(),
            limitation=limitation,
            energy_at_contact=at_contact,
            largest_energy=largest_energy,
            largest_pressure=largest_pressure,
        )

    @property
    def end(self) -> float:
        """The gap beyond which the law is zero, or unknown."""
        return float(self.starts[-1])

    def evaluate(self, gap: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return energy, pressure -v' and stiffness v'' at `gap` (any shape); the first piece serves below 0."""
        gap = np.minimum(gap, 2.0 * self.end)  # so that the piece beyond the end is never asked for 0 · ∞
        piece = np.maximum(np.searchsorted(self.starts, gap, side="right") - 1, 0)
        x = gap - self.starts[piece]
        coefficients = self.coefficients[:, piece]
        value, slope, half_curvature = coefficients[0], np.zeros_like(x), np.zeros_like(x)
        for row in coefficients[1:]:  # Horner's scheme for the value and its derivatives together
            half_curvature = half_curvature * x + slope
            slope = slope * x + value
            value = value * x + row
        return value, -slope, 2.0 * half_curvature

    def reach(self, level: float) -> float:
        """Return a gap beyond which |v| ≤ `level` as far as the table goes."""
        gaps = np.unique(np.linspace(self.starts[:-1], self.starts[1:], 9))
        above = np.flatnonzero(np.abs(self.evaluate(gaps)[0]) > level)
        if above.size == 0:
            return 0.0
        return float(gaps[min(int(above[-1]) + 1, gaps.size - 1)])

    def tail_energy(self, gap: FloatArray) -> FloatArray:
        """Return ∫ v dg from `gap` (any shape) to infinity; NaN if the table ends too early."""
        if self.limitation:
            return np.full_like(gap, math.nan)
        return np.asarray(self.integral(self.end) - self.integral(np.minimum(gap, self.end)))


def _to_zero(end: float, before: float, derivatives: tuple[float, ...]) -> scipy.interpolate.PPoly:
    """Return the polynomial that starts at `end` with value and derivatives given and ends with all of them zero."""
    level, slope = derivatives[:2]
    decay = abs(level / slope) if slope != 0.0 else 0.0
    width = min(max(4.0 * decay, end - before), end)
    pieces = scipy.interpolate.BPoly.from_derivatives([end, end + width], [list(derivatives), [0.0] * len(derivatives)])
    return scipy.interpolate.PPoly.from_bernstein_basis(pieces)


def _joined(first: scipy.interpolate.PPoly, second: scipy.interpolate.PPoly) -> scipy.interpolate.PPoly:
    """Return the two piecewise polynomials, of which the second starts where the first ends, as one."""
    degree = max(first.c.shape[0], second.c.shape[0])
    padded = [np.concatenate([np.zeros((degree - p.c.shape[0], p.c.shape[1])), p.c]) for p in (first, second)]
    return scipy.interpolate.PPoly(np.concatenate(padded, axis=1), np.concatenate([first.x, second.x[1:]]))


def _energy_of_pressure(pressure: scipy.interpolate.PPoly) -> scipy.interpolate.PPoly:
    """Return v with v' = -p and v = 0 at the end."""
    integral = pressure.antiderivative()
    coefficients = -integral.c
    coefficients[-1] += float(integral(pressure.x[-1]))
    return scipy.interpolate.PPoly(coefficients, integral.x)
