"""Abel transform of power-law tips z = coefficient * r^n, shared by Hertz and JKR."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.theory._inputs import not_below, positive

Result = TypeVar("Result")


def with_shape(function: Callable[..., Result], **shape: float) -> Callable[..., Result]:
    """Return the function, and what is said of it, for a kind of shape, of which these are the numbers not given."""
    own = partial(function, **shape)
    own.__doc__ = function.__doc__
    return own


@dataclass(frozen=True)
class PowerLaw:
    """Transform zeta(t) = t int_0^t z'(r)/sqrt(t^2-r^2) dr = strength * t^exponent of a tip z = r^n / (n length^(n-1)).

    A cone is the exponent 1 with the strength multiplied by its slope, a parabola the exponent 2 with its radius as
    length.
    """

    exponent: Array
    strength: Array

    @classmethod
    def of(
        cls,
        radius: ArrayLike | None = None,
        slope: ArrayLike | None = None,
        exponent: ArrayLike | None = None,
        length: ArrayLike | None = None,
    ) -> PowerLaw:
        """Return the transform of a shape by its numbers.

        Parameters
        ----------
        radius : array_like, optional
            R > 0 (1 without any number) of a parabola, z = r^2 / (2 R): strength = 1 / R.
        slope : array_like, optional
            Of a cone, z = slope * r: strength = pi slope / 2.
        exponent, length : array_like, optional
            n >= 1 and L > 0 (1 if not given) of z = r^n / (n L^(n-1)): strength = B(n/2, 1/2) / (2 L^(n-1)).

        Raises
        ------
        InputError
            If the numbers are those of more than one shape, or out of range.
        """
        powers = exponent is not None or length is not None
        if (radius is not None) + (slope is not None) + powers > 1:
            raise InputError("radius, slope, exponent, length: those of one shape: radius, slope, or the last two")
        if slope is not None:
            return cls(np.asarray(1.0), np.asarray(0.5 * np.pi * positive("slope", slope)))
        if not powers:
            return cls(np.asarray(2.0), np.asarray(1.0 / positive("radius", 1.0 if radius is None else radius)))
        if exponent is None:
            raise InputError("exponent must be given with the length of a power law")
        why = "a blunter power has no finite pressure at the rim of the tip"
        n = not_below("exponent", positive("exponent", exponent), 1.0, why)
        height = positive("length", 1.0 if length is None else length) ** (n - 1.0)
        return cls(n, np.asarray(0.5 * scipy.special.beta(0.5 * n, 0.5) / height))

    def transform(self, t: Array) -> Array:
        """Return zeta(t)."""
        return self.strength * t**self.exponent

    def deficit(self, t: Array) -> Array:
        """Return t zeta(t) - int_0^t zeta, which is the Hertzian load over 2 E."""
        n = self.exponent
        return self.strength * n / (n + 1.0) * t ** (n + 1.0)

    def stress(self, r: Array, contact_radius: Array) -> Array:
        """Return (1/pi) int_r^a zeta'(t)/sqrt(t^2-r^2) dt, the Hertzian pressure over E; 0 outside."""
        n, a = self.exponent, contact_radius
        y = np.sqrt(np.maximum((a - r) * (a + r), 0.0)) / np.where(a > 0.0, a, 1.0)
        # Pfaff's form of the hypergeometric function is finite at the centre for n > 1 and gives artanh for the cone
        shape = y * scipy.special.hyp2f1(1.0, 1.0 - 0.5 * n, 1.5, y * y)
        return self.strength * n * a ** (n - 1.0) / np.pi * shape
