"""Derivatives of the Maugis-Dugdale curve to any order, by arithmetic of truncated power series.

Loads and displacements near a fold need second and third derivatives with respect to the contact radius (or the
central gap); all functions of the rim angle are explicit, so their Taylor series follow exactly, without a step to
choose.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from contbranch.theory._dugdale import Angle, Zone, opening_of_contact, opening_of_zone
from contbranch.theory._inputs import FloatArray

__all__ = ["LocalExpansion", "in_central_gap", "in_contact_radius"]


class LocalExpansion(NamedTuple):
    """Derivatives of load and displacement along the curve.

    Attributes
    ----------
    coordinate : str
        "contact_radius" in contact (first touch included), "central_gap" without: what the derivatives are taken with
        respect to.
    value : float
        The coordinate where they are taken.
    load, displacement : array
        Derivatives of order 0, 1, 2, ... in reduced units.
    """

    coordinate: Literal["contact_radius", "central_gap"]
    value: float
    load: FloatArray
    displacement: FloatArray


def in_contact_radius(zone: Zone, angle: Angle, order: int) -> LocalExpansion:
    """Return the derivatives up to ``order`` with respect to the contact radius at one rim angle."""
    size = order + 1
    theta, cos, sin = (float(x) for x in angle)
    radius, modulus, strain = float(zone.radius), float(zone.modulus), float(zone.strain)
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1.0, size)]))
    turn = np.resize([sin, cos, -sin, -cos], size + 1)
    sine, cosine = turn[:size] / factorial, turn[1:] / factorial
    at = np.zeros(size)
    at[:2] = [theta, 1.0][:size]
    # A' = 2 theta sin cos and B' = theta cos, so both series start from the accurate values at the point itself
    contact = _integral(float(opening_of_contact(angle)), 2.0 * _times(at, _times(sine, cosine)))
    attraction = strain * _integral(float(opening_of_zone(angle)), _times(at, cosine))
    u = 0.5 * np.pi * float(zone.interaction_range)
    c = u * _reciprocal(attraction + _root(_times(attraction, attraction) + u / radius * contact))
    a, s = _times(c, cosine), _times(c, sine)
    cube, swept = _times(a, _times(a, a)), _times(c, _times(c, at + _times(sine, cosine)))
    load = modulus * (4.0 / 3.0 * cube / radius - 2.0 * strain * swept)
    displacement = _times(a, a) / radius - 2.0 * strain * s
    inner = _reversion(a)
    return LocalExpansion(
        "contact_radius", float(a[0]), _compose(load, inner) * factorial, _compose(displacement, inner) * factorial
    )


def in_central_gap(zone: Zone, c: float, order: int) -> LocalExpansion:
    """Return the derivatives up to ``order`` with respect to the central gap without contact, where both are
    quadratic in c.
    """
    size = order + 1
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1.0, size)]))
    radius, stress, strain, z0 = (float(x) for x in (zone.radius, zone.stress, zone.strain, zone.interaction_range))
    slope = (2.0 - 4.0 / np.pi) * strain
    gap, load, displacement = np.zeros((3, max(size, 3)))
    gap[:3] = z0 - slope * c - 0.5 * c * c / radius, -slope - c / radius, -0.5 / radius
    load[:3] = -np.pi * stress * np.array([c * c, 2.0 * c, 1.0])
    displacement[:3] = -gap[:3] - 2.0 * strain * np.array([c, 1.0, 0.0])
    inner = _reversion(gap[:size])
    return LocalExpansion(
        "central_gap",
        float(gap[0]),
        _compose(load[:size], inner) * factorial,
        _compose(displacement[:size], inner) * factorial,
    )


# A power series is an array of its coefficients, the constant first; results have the length of the first argument.


def _times(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.convolve(x, y)[: x.size])


def _integral(constant: float, slope: FloatArray) -> FloatArray:
    return np.concatenate([[constant], slope[:-1] / np.arange(1.0, slope.size)])


def _reciprocal(x: FloatArray) -> FloatArray:
    y = np.zeros_like(x)
    y[0] = 1.0 / x[0]
    for k in range(1, x.size):
        y[k] = -y[0] * np.dot(x[1 : k + 1], y[k - 1 :: -1])
    return y


def _root(x: FloatArray) -> FloatArray:
    y = np.zeros_like(x)
    y[0] = np.sqrt(x[0])
    for k in range(1, x.size):
        y[k] = 0.5 * (x[k] - np.dot(y[1:k], y[k - 1 : 0 : -1])) / y[0]
    return y


def _compose(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """Return outer(inner(x)) for an inner series without constant."""
    y = np.zeros_like(outer)
    for coefficient in outer[::-1]:
        y = _times(y, inner)
        y[0] += coefficient
    return y


def _reversion(x: FloatArray) -> FloatArray:
    """Return the series of t in x(t) - x(0), by as many substitutions as there are orders."""
    identity = np.zeros_like(x)
    identity[1] = 1.0
    tail = np.concatenate([[0.0, 0.0], x[2:]])
    y: FloatArray = identity / x[1]
    for _ in range(x.size):
        y = np.asarray((identity - _compose(tail, y)) / x[1])
    return y
