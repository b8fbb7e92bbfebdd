"""Tabulated numbers: their check, and the smooth energy of a tabulated law."""

from __future__ import annotations

import itertools
import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Made = TypeVar("Made", bound="DataclassInstance")

_LEAST_ROWS = 4
# Bounds of a table, within which no power of its numbers overflows: of entries, and of their distances in the last one.
_LARGEST, _CLOSEST = 1e30, 1e-12
_QUINTIC_ROWS = 8
# A table scatters where fourth differences change sign more often than this, as those of smooth numbers do not, by more
# than this share of its largest entry; in that many rows at least.
_ALTERNATING = 0.5
_SCATTERED = 1e-7
_SCATTER_ROWS = 12
_SEEN = 3.0  # standard deviations by which values of such a table differ from nothing
_LOOSER, _LOOSER_ROUNDS = 1.25, 12  # a spline that swings is allowed so much more of the scatter, so often
# Of a law taken as the exponential of a spline: how soon its slope comes to rest beyond the table, ln of what is
# nothing, and pieces in units of its decay.
_STRAIGHTER, _NOTHING, _FINE = 0.25, 41.0, 8.0
# What takes a table to zero joins so many derivatives at least; it swings where it exceeds the table's last value, at
# one of so many places and by more than rounding, or has the other sign beyond a share of it.
_LEAST_MATCHED, _SAMPLES, _ROUNDED, _BELOW = 3, 33, 1e-9, 0.05
_DECAYED = 0.01  # a law whose table ends below this part of its maximum is taken to zero


def numbers(values: object, field: str) -> Array:
    """Return `values` as a (n,) array of finite floats, n ≥ 4; InputError, naming `field`, if they are not."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{field}: not all are numbers; must be a list of numbers") from None
    if array.ndim != 1 or array.size < _LEAST_ROWS:
        raise InputError(f"{field}: shape {array.shape}; must be a list of at least {_LEAST_ROWS} numbers")
    if not np.all(np.isfinite(array)):
        bad = int(np.flatnonzero(~np.isfinite(array))[0])
        raise InputError(f"{field}: entry {bad + 1} is {array[bad]}; must be finite numbers")
    return array


def columns(part: object, first: str, second: str) -> tuple[Array, Array]:
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
    if np.diff(one).min() < _CLOSEST * one[-1]:
        raise InputError(f"{first}: entries closer than {_CLOSEST:g} of the last one; thin out the table")
    for name, array in ((first, one), (second, other)):
        size = float(np.abs(array).max())
        if size and not 1.0 / _LARGEST < size < _LARGEST:
            raise InputError(f"{name}: up to {size:g}; must be between {1.0 / _LARGEST:g} and {_LARGEST:g}")
        object.__setattr__(part, name, tuple(array.tolist()))
    return one, other


def increasing_from_zero(array: Array, field: str) -> None:
    """Raise InputError, naming `field`, unless the (n,) array starts at 0 and increases strictly."""
    if array[0] != 0.0:
        raise InputError(f"{field}: the first is {array[0]:g}; must start at 0")
    steps = np.diff(array)
    if np.any(steps <= 0.0):
        bad = int(np.flatnonzero(steps <= 0.0)[0])
        raise InputError(f"{field}: entry {bad + 2} is not above entry {bad + 1}; must increase strictly")


class Table(NamedTuple):
    """A law's energy per area as pieces of polynomials of the gap, 0 beyond the last but one.

    Attributes
    ----------
    energy
    decayed
        Whether that had happened where the table ends.
    scatter
        Standard deviation of what was smoothed away; 0: nothing.
    """

    energy: scipy.interpolate.PPoly
    decayed: bool
    scatter: float

    def scaled(self, normal: float, energy: float, per: float) -> Table:
        """Return the law in other units: of the gap, the energy per area, and what was given in the table."""
        return Table(pieces_scaled(self.energy, normal, energy), self.decayed, self.scatter / per)


def pieces_scaled(pieces: scipy.interpolate.PPoly, place: float, value: float) -> scipy.interpolate.PPoly:
    """Return pieces in other units of the place and the value."""
    powers = np.arange(len(pieces.c))[::-1, None]
    return scipy.interpolate.PPoly(pieces.c * float(place) ** powers / value, pieces.x / place)


def with_fields(own: Made, **changed: Any) -> Made:
    """Return a frozen dataclass with other values of some fields, without what makes it anew from a table."""
    found = object.__new__(type(own))
    for item in fields(own):
        object.__setattr__(found, item.name, changed.get(item.name, getattr(own, item.name)))
    return found


def scattered(places: Array, values: Array) -> tuple[float, float]:
    """Return the standard deviation of what makes values scatter, and how much larger than its median its mean is.

    It is 0 where they are smooth; its mean exceeds its median more where the scatter is not alike everywhere.
    """
    if values.size < _SCATTER_ROWS:
        return 0.0, math.inf
    # fourth divided differences, as sums with weights of square sum 1
    x, y = (np.lib.stride_tricks.sliding_window_view(one, 5) for one in (places, values))
    weights = 1.0 / np.prod(x[:, :, None] - x[:, None] + np.eye(5), axis=2)
    differences = np.sum(weights * y, axis=1) / np.linalg.norm(weights, axis=1)
    median, mean = float(np.median(np.abs(differences))), float(np.mean(np.abs(differences)))
    scatter = median / 0.6745
    alternating = np.mean(differences[1:] * differences[:-1] < 0.0)
    smooth = alternating < _ALTERNATING or scatter < _SCATTERED * np.max(np.abs(values))
    return (0.0, math.inf) if smooth else (scatter, mean / median)


def smoothed(places: Array, values: Array, scatter: float | Array, degree: int) -> scipy.interpolate.BSpline:
    """Return a spline with as few knots as the scatter of the values allows, or through values without scatter.

    With fewer where it would swing between the places, as with almost as many knots as values.
    """
    if not np.any(scatter):
        return scipy.interpolate.make_interp_spline(places, values, k=degree)
    deviation = np.broadcast_to(scatter, values.shape)
    for allowed in places.size * _LOOSER ** np.arange(_LOOSER_ROUNDS):
        knots = scipy.interpolate.splrep(places, values, 1.0 / deviation, k=degree, s=allowed)
        spline = scipy.interpolate.BSpline(*knots)
        if not _swings(spline, places, deviation):
            break
    return spline


def _swings(spline: scipy.interpolate.BSpline, places: Array, deviation: Array) -> bool:
    """Whether a spline leaves its values at two places by more than these, or those next to them, differ."""
    own = spline(places)
    apart = np.pad(np.abs(np.diff(own)), 1)
    room = np.maximum.reduce([apart[:-2], apart[1:-1], apart[2:]])
    room += _SEEN * np.maximum(deviation[1:], deviation[:-1])
    between = spline((places[1:] + places[:-1]) / 2) - (own[1:] + own[:-1]) / 2
    return bool((np.abs(between) > room).any())


def _pieces(spline: scipy.interpolate.BSpline) -> scipy.interpolate.PPoly:
    """Return a spline as pieces, each of a length."""
    pieces = scipy.interpolate.PPoly.from_spline((spline.t, spline.c, spline.k))
    return scipy.interpolate.PPoly(pieces.c[:, np.diff(pieces.x) > 0], np.unique(pieces.x))


def _exponential(gaps: Array, values: Array, scatter: float, degree: int) -> scipy.interpolate.PPoly | None:
    """Return ±exp s as pieces, s a spline through logarithms of energies that goes on ever straighter beyond them.

    None where energies change sign, or do not fall in the end. Laws that decay are far from polynomials, but not their
    logarithms: a spline of these neither swings between coarse rows nor has a sign of its own where it has decayed.
    """
    own = values * np.sign(values[0])
    count = int(np.argmax(np.append(own, -1.0) <= _SEEN * scatter))
    if count <= degree or own[count:].min(initial=0.0) < -2.0 * _SEEN * scatter:
        return None
    places, seen = gaps[:count], own[:count]
    spline = smoothed(places, np.log(seen), scatter / seen, degree)
    end = float(places[-1])
    level, slope, bow = (float(spline(end, order)) for order in range(3))
    if not slope < 0.0:
        return None
    length = -_STRAIGHTER * slope / max(abs(bow), 1e-9 * slope**2)
    last = end - max(level - math.log(seen[0]) + _NOTHING, 1.0) / (slope + bow * length)

    def rates(at: Array) -> Array:  # s and its derivatives
        fade = np.exp(-np.maximum(at - end, 0.0) / length)
        straight = np.array([
            level + slope * (at - end) + bow * length * (at - end - length * (1.0 - fade)),
            slope + bow * length * (1.0 - fade), bow * fade, -bow / length * fade,
        ])  # fmt: skip
        inside = np.minimum(at, end)
        return np.where(at < end, [spline(inside, order) for order in range(4)], straight)

    coarse = np.append(np.unique(spline.t), np.linspace(end, last, 20)[1:])
    steep = np.abs(rates(coarse)[1])
    steep = np.maximum(steep[1:], steep[:-1]) + np.sqrt(np.abs(rates((coarse[1:] + coarse[:-1]) / 2)[2]))
    counts = np.ceil(_FINE * np.diff(coarse) * steep).astype(int) + 1
    starts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(coarse[:-1], coarse[1:], counts, strict=True)]
    knots = np.append(np.concatenate(starts), last)
    s, first, second, third = rates(knots)
    ratios = [np.ones_like(s), first, second + first**2, third + 3 * first * second + first**3]
    derivatives = (np.sign(values[0]) * np.exp(s) * np.array(ratios[: (degree + 4) // 2])).T
    return scipy.interpolate.PPoly.from_bernstein_basis(scipy.interpolate.BPoly.from_derivatives(knots, derivatives))


def energy_of_table(gaps: Array, values: Array, kind: str) -> Table:
    """Return the law of a table.

    Parameters
    ----------
    gaps
        (n,) increasing from 0.
    values
        (n,) "energies" or "pressures".
    kind
        Which of the two.
    """
    told = gaps, values
    scatter, _ = scattered(gaps, values)
    # Energies are differentiated once more: both give pressures with continuous curvature, whose kinks cost digits.
    degree = 5 if kind == "energies" and gaps.size >= _QUINTIC_ROWS and not scatter else 3
    spline = smoothed(gaps, values, scatter, degree)
    seen = int(np.flatnonzero(np.abs(spline(gaps)) > _SEEN * scatter)[-1]) + 1 if scatter else 0
    if _QUINTIC_ROWS <= seen < gaps.size:  # beyond, there is nothing but scatter
        gaps, values = gaps[:seen], values[:seen]
        spline = smoothed(gaps, values, scatter, degree)
    level, slope, *higher = (float(spline(gaps[-1], order)) for order in range(spline.k))
    decayed = abs(level) <= _DECAYED * np.max(np.abs(values))
    if kind == "energies":  # a constant tail has no force, so the force must have decayed as well
        decayed = decayed and abs(slope) <= _DECAYED * np.max(np.abs(spline(gaps, 1)))
    decayed = decayed or gaps.size < told[0].size or abs(level) <= 2.0 * _SEEN * scatter
    derivatives = (level, slope, *higher)[: 3 if scatter else spline.k]
    tail = _to_zero(float(gaps[-1]), float(gaps[-2]), derivatives)
    pieces = _joined(_pieces(spline), tail)
    if kind == "energies" and values[0]:
        pieces = _exponential(*told, scatter, degree) or pieces
    if kind == "pressures":
        integral = pieces.antiderivative()
        pieces = scipy.interpolate.PPoly(-integral.c, integral.x)
        pieces.c[-1] += float(integral(integral.x[-1]))
    beyond = scipy.interpolate.PPoly(np.zeros_like(pieces.c[:, :1]), pieces.x[-1] * np.array([1.0, 2.0]))
    return Table(_joined(pieces, beyond), bool(decayed), scatter)


def _to_zero(end: float, before: float, derivatives: tuple[float, ...]) -> scipy.interpolate.PPoly:
    """Return a polynomial that starts at `end` with value and derivatives given and ends with all of them zero.

    With fewer derivatives, or sooner, where it would swing: the higher ones of a spline that ends are known badly.
    """
    level, slope = derivatives[:2]
    decay = abs(level / slope) if slope != 0.0 else 0.0
    widest, least = min(max(4.0 * decay, end - before), end), min(end - before, end)
    room = abs(level) + max(math.copysign(slope, level * slope), 0.0) * least
    widths = widest * 0.5 ** np.arange(1 + max(0, math.floor(math.log2(widest / least))))
    tails = list[tuple[float, scipy.interpolate.BPoly]]()
    for count, width in itertools.product(range(len(derivatives), _LEAST_MATCHED - 1, -1), widths.tolist()):
        ends = [list(derivatives[:count]), [0.0] * count]
        tail = scipy.interpolate.BPoly.from_derivatives([end, end + width], ends)
        values = tail(np.linspace(end, end + width, _SAMPLES)) * math.copysign(1.0, level)
        tails.append((max(float(values.max()), -float(values.min()) / _BELOW) - room, tail))
        if tails[-1][0] <= _ROUNDED * room:
            break
    return scipy.interpolate.PPoly.from_bernstein_basis(min(tails, key=lambda one: one[0])[1])


def _joined(first: scipy.interpolate.PPoly, second: scipy.interpolate.PPoly) -> scipy.interpolate.PPoly:
    """Return the two piecewise polynomials, of which the second starts where the first ends, as one."""
    degree = max(first.c.shape[0], second.c.shape[0])
    padded = [np.concatenate([np.zeros((degree - p.c.shape[0], p.c.shape[1])), p.c]) for p in (first, second)]
    return scipy.interpolate.PPoly(np.concatenate(padded, axis=1), np.concatenate([first.x, second.x[1:]]))
