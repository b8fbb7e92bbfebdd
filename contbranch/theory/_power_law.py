"""Abel transform of power-law tips z = coefficient * r^n, shared by Hertz and JKR."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.theory._inputs import not_below, positive


@dataclass(frozen=True)
class PowerLaw:
    """Transform zeta(t) = t int_0^t z'(r)/sqrt(t^2-r^2) dr = strength * t^exponent of a tip z = r^n / (n length^(n-1)).

    A cone is the exponent 1 with the strength multiplied by its slope, a parabola the exponent 2 with its radius as
    length.
    """

    exponent: Array
    strength: Array

    @classmethod
    def of(cls, exponent: ArrayLike, length: ArrayLike) -> PowerLaw:
        """Return the transform of z = r^n / (n length^(n-1)): strength = B(n/2, 1/2) / (2 length^(n-1))."""
        n = not_below(
            "exponent",
            positive("exponent", exponent),
            1.0,
            "a blunter power has no finite pressure at the rim of the tip",
        )
        return cls(n, np.asarray(0.5 * scipy.special.beta(0.5 * n, 0.5) / positive("length", length) ** (n - 1.0)))

    @classmethod
    def parabola(cls, radius: ArrayLike) -> PowerLaw:
        """Return the transform of z = r^2 / (2 radius): strength = 1 / radius."""
        return cls(np.asarray(2.0), np.asarray(1.0 / positive("radius", radius)))

    @classmethod
    def cone(cls, slope: ArrayLike) -> PowerLaw:
        """Return the transform of z = slope * r: strength = pi slope / 2."""
        return cls(np.asarray(1.0), np.asarray(0.5 * np.pi * positive("slope", slope)))

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
