"""Axisymmetric tip shapes with their Abel transforms ζ(t) = t ∫_0^t z'(r)/√(t²-r²) dr in closed form.

ζ(a) is the displacement at which the tip alone, without adhesion, makes a contact of radius a.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from contbranch.contact.height_map import HeightMap
from contbranch.contact.tip_profile import Profile
from contbranch.contact.tip_shape import Tip, TipShape, gauss_rule, parabolic_scales
from contbranch.contact.tip_surface import EllipticParaboloid
from contbranch.contact.units import positive_number
from contbranch.errors import InputError

__all__ = [
    "TIPS",
    "Cone",
    "EllipticParaboloid",
    "HeightMap",
    "Parabola",
    "PowerLaw",
    "Profile",
    "SphericalCap",
    "Tip",
    "TipShape",
]

FloatArray = NDArray[np.float64]

_STEEPNESS: Final = "steepness"


def _check(tip: Tip, *names: str) -> None:
    """Replace the fields of `tip` by floats, all of them positive; InputError otherwise."""
    for name in names:
        object.__setattr__(tip, name, positive_number(getattr(tip, name), name))


@dataclass(frozen=True)
class Parabola(Tip):
    """z = r²/(2R), ζ = t²/R.

    Attributes
    ----------
    radius
        R > 0, the radius of curvature, a length.
    """

    name: ClassVar[str] = "parabola"
    dimensions: ClassVar[Mapping[str, str]] = {"radius": "length"}

    radius: float

    def __post_init__(self) -> None:
        _check(self, "radius")

    @property
    def natural_length(self) -> float:
        """R."""
        return self.radius

    def height(self, r: ArrayLike) -> FloatArray:
        """Return r²/(2R)."""
        return np.asarray(np.square(r) / (2.0 * self.radius))

    def height_derivative(self, r: ArrayLike) -> FloatArray:
        """Return r/R."""
        return np.asarray(r) / self.radius

    def transform(self, t: ArrayLike) -> FloatArray:
        """Return t²/R."""
        return np.asarray(np.square(t) / self.radius)

    def transform_derivative(self, t: ArrayLike) -> FloatArray:
        """Return 2t/R."""
        return np.asarray(t) * (2.0 / self.radius)

    def transform_integral(self, a: ArrayLike) -> FloatArray:
        """Return a³/(3R)."""
        a = np.asarray(a)
        return np.asarray(a * a * a / (3.0 * self.radius))

    def transform_square_integral(self, a: ArrayLike) -> FloatArray:
        """Return a⁵/(5R²)."""
        return np.asarray(np.asarray(a) ** 5 / (5.0 * self.radius**2))

    def contact_radius(self, y: ArrayLike) -> FloatArray:
        """Return √(Ry)."""
        return np.asarray(np.sqrt(self.radius * np.asarray(y)))

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[FloatArray, FloatArray]:
        """Return (2/π) [(r²/2 - a²) arccos(a/r) + aρ/2]/R and its derivative, (2a/πR) [aρ/r² - arccos(a/r)]."""
        rho = np.asarray(rho, dtype=np.float64)
        square = rho * rho
        if a == 0.0:
            return square * (0.5 / self.radius), np.zeros_like(rho)
        angle = np.arctan2(rho, a)
        a2, moment = a * a, a * rho
        scale = 1.0 / (math.pi * self.radius)
        gap = ((square - a2) * angle + moment) * scale
        return gap, (moment / (square + a2) - angle) * (2.0 * a * scale)

    def reduced_scales(self, adhesion_length: float) -> tuple[float, float]:
        """Return X = R^(2/3) L^(1/3) and Z = R^(1/3) L^(2/3), (23) and (24)."""
        return parabolic_scales(self.radius, adhesion_length)

    def scaled(self, in_plane: float, normal: float) -> Parabola:
        """Return the parabola in other units."""
        return Parabola(self.radius * (normal / in_plane**2))


@dataclass(frozen=True)
class Cone(Tip):
    """z = s r, ζ = (π/2) s t.

    Attributes
    ----------
    slope
        s > 0, dimensionless: the cotangent of half the opening angle.
    """

    name: ClassVar[str] = "cone"
    dimensions: ClassVar[Mapping[str, str]] = {"slope": "dimensionless"}

    slope: float

    def __post_init__(self) -> None:
        _check(self, "slope")

    @property
    def apex_exponent(self) -> float:
        """1."""
        return 1.0

    @property
    def natural_length(self) -> float:
        """1: a cone has no length of its own."""
        return 1.0

    def height(self, r: ArrayLike) -> FloatArray:
        """Return s r."""
        return self.slope * np.asarray(r, dtype=np.float64)

    def height_derivative(self, r: ArrayLike) -> FloatArray:
        """Return s."""
        return np.full_like(r, self.slope, dtype=np.float64)

    def transform(self, t: ArrayLike) -> FloatArray:
        """Return (π/2) s t."""
        return (0.5 * math.pi * self.slope) * np.asarray(t, dtype=np.float64)

    def transform_derivative(self, t: ArrayLike) -> FloatArray:
        """Return (π/2) s."""
        return np.full_like(t, 0.5 * math.pi * self.slope, dtype=np.float64)

    def transform_integral(self, a: ArrayLike) -> FloatArray:
        """Return (π/4) s a²."""
        return np.asarray((0.25 * math.pi * self.slope) * np.square(a))

    def transform_square_integral(self, a: ArrayLike) -> FloatArray:
        """Return (π s/2)² a³/3."""
        return np.asarray((0.5 * math.pi * self.slope) ** 2 / 3.0 * np.asarray(a) ** 3)

    def contact_radius(self, y: ArrayLike) -> FloatArray:
        """Return y/(πs/2)."""
        return np.asarray(y) / (0.5 * math.pi * self.slope)

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[FloatArray, FloatArray]:
        """Return s [ρ - a arccos(a/r)] and its derivative, s [aρ/r² - arccos(a/r)]."""
        rho = np.asarray(rho, dtype=np.float64)
        if a == 0.0:
            return self.slope * rho, np.full_like(rho, -0.5 * math.pi * self.slope)
        angle = np.arctan2(rho, a)
        return self.slope * (rho - a * angle), self.slope * (a * rho / (rho * rho + a * a) - angle)

    def reduced_scales(self, adhesion_length: float) -> tuple[float, float]:
        """Return X = L/s² and Z = s X."""
        x = adhesion_length / self.slope**2
        return x, self.slope * x

    def scaled(self, in_plane: float, normal: float) -> Cone:
        """Return the cone in other units."""
        return Cone(self.slope * (in_plane / normal))


@dataclass(frozen=True)
class PowerLaw(Tip):
    """z = σ rⁿ/(n ℓ^(n-1)), ζ = σ B(n/2, 1/2)/2 tⁿ/ℓ^(n-1), B the beta function.

    Attributes
    ----------
    exponent
        n ≥ 1: 2 is the parabola of radius ℓ, 1 the cone of slope σ.
    length
        ℓ > 0.
    steepness
        σ, the ratio of the unit of lengths to that of heights; 1 unless the two differ, as in reduced units.
    """

    name: ClassVar[str] = "power-law"
    dimensions: ClassVar[Mapping[str, str]] = {
        "exponent": "dimensionless",
        "length": "length",
        _STEEPNESS: "dimensionless",
    }

    exponent: float
    length: float
    steepness: float = 1.0

    def __post_init__(self) -> None:
        _check(self, "exponent", "length", _STEEPNESS)
        if self.exponent < 1.0:
            raise InputError(f"exponent: {self.exponent:g}; must be at least 1")

    @property
    def apex_exponent(self) -> float:
        """n."""
        return self.exponent

    @property
    def natural_length(self) -> float:
        """ℓ."""
        return self.length

    @property
    def _amplitude(self) -> float:
        """σ ℓ^(1-n), so that z' = amplitude r^(n-1)."""
        return self.steepness * math.pow(self.length, 1.0 - self.exponent)

    @property
    def _transformed(self) -> float:
        """The factor c of ζ = c tⁿ."""
        return 0.5 * self._amplitude * float(scipy.special.beta(0.5 * self.exponent, 0.5))

    def height(self, r: ArrayLike) -> FloatArray:
        """Return σ rⁿ/(n ℓ^(n-1))."""
        return np.asarray((self._amplitude / self.exponent) * np.asarray(r, dtype=np.float64) ** self.exponent)

    def height_derivative(self, r: ArrayLike) -> FloatArray:
        """Return σ (r/ℓ)^(n-1)."""
        return np.asarray(self._amplitude * np.asarray(r, dtype=np.float64) ** (self.exponent - 1.0))

    def transform(self, t: ArrayLike) -> FloatArray:
        """Return c tⁿ."""
        return np.asarray(self._transformed * np.asarray(t, dtype=np.float64) ** self.exponent)

    def transform_derivative(self, t: ArrayLike) -> FloatArray:
        """Return c n t^(n-1)."""
        n = self.exponent
        return np.asarray((self._transformed * n) * np.asarray(t, dtype=np.float64) ** (n - 1.0))

    def transform_integral(self, a: ArrayLike) -> FloatArray:
        """Return c a^(n+1)/(n+1)."""
        n = self.exponent
        return np.asarray(self._transformed / (n + 1.0) * np.asarray(a, dtype=np.float64) ** (n + 1.0))

    def transform_square_integral(self, a: ArrayLike) -> FloatArray:
        """Return c² a^(2n+1)/(2n+1)."""
        n = self.exponent
        return np.asarray(self._transformed**2 / (2.0 * n + 1.0) * np.asarray(a, dtype=np.float64) ** (2.0 * n + 1.0))

    def contact_radius(self, y: ArrayLike) -> FloatArray:
        """Return (y/c)^(1/n)."""
        return np.asarray((np.asarray(y, dtype=np.float64) / self._transformed) ** (1.0 / self.exponent))

    def _gap_far(self, rho: FloatArray, a: float) -> tuple[FloatArray, FloatArray]:
        """Return gap and slope for ρ ≥ a, with ∫_a^r tⁿ/√(r²-t²) dt = rⁿ B(1/2, (n+1)/2)/2 I_(ρ²/r²)(1/2, (n+1)/2)."""
        n, c = self.exponent, self._transformed
        r2 = rho * rho + a * a
        far = r2 > 0.0  # r = 0 only at the apex without contact, where the gap and what multiplies 1/r² vanish
        p, q = 0.5, 0.5 * (n + 1.0)
        part = np.divide(rho * rho, r2, out=np.ones_like(r2), where=far)
        moment = np.asarray((0.5 * scipy.special.beta(p, q) * c) * scipy.special.betainc(p, q, part) * r2 ** (0.5 * n))
        angle = np.where(far, np.arctan2(rho, a), 0.5 * math.pi)
        gap = moment - (c * a**n) * angle
        slope = n * (np.divide(a * moment, r2, out=np.zeros_like(r2), where=far) - c * a ** (n - 1.0) * angle)
        return (2.0 / math.pi) * gap, (2.0 / math.pi) * slope

    def _rise(self, a: float, tau: FloatArray, t: FloatArray) -> FloatArray:
        """Return c (tⁿ - aⁿ) without cancellation."""
        ratio = tau / a
        return np.asarray(
            (self._transformed * a**self.exponent) * np.expm1(0.5 * self.exponent * np.log1p(ratio * ratio))
        )

    def reduced_scales(self, adhesion_length: float) -> tuple[float, float]:
        """Return X with X^(2n-1) = L ℓ^(2n-2)/σ² and Z = σ Xⁿ/ℓ^(n-1)."""
        n = self.exponent
        x = (adhesion_length / self._amplitude**2) ** (1.0 / (2.0 * n - 1.0))
        return x, self._amplitude * x**n

    def scaled(self, in_plane: float, normal: float) -> PowerLaw:
        """Return the tip in other units."""
        return replace(self, length=self.length / in_plane, steepness=self.steepness * (in_plane / normal))


@dataclass(frozen=True)
class SphericalCap(Tip):
    """z = σ (R - √(R²-r²)) for r < R, ζ = σ t artanh(t/R); beyond r = R there is no tip and heights are infinite.

    Attributes
    ----------
    radius
        R > 0, the radius of the sphere.
    steepness
        σ, the ratio of the unit of lengths to that of heights; 1 unless the two differ, as in reduced units.
    """

    name: ClassVar[str] = "spherical-cap"
    dimensions: ClassVar[Mapping[str, str]] = {"radius": "length", _STEEPNESS: "dimensionless"}

    radius: float
    steepness: float = 1.0

    def __post_init__(self) -> None:
        _check(self, "radius", _STEEPNESS)

    @property
    def extent(self) -> float:
        """R."""
        return self.radius

    @property
    def natural_length(self) -> float:
        """R."""
        return self.radius

    def height(self, r: ArrayLike) -> FloatArray:
        """Return σ r²/(R + √(R²-r²)), infinite beyond R."""
        x = np.asarray(r, dtype=np.float64) / self.radius
        square = x * x
        inside = square <= 1.0
        return np.where(inside, self.steepness * self.radius * square / (1.0 + _root(square)), math.inf)

    def height_derivative(self, r: ArrayLike) -> FloatArray:
        """Return σ r/√(R²-r²), infinite from R on."""
        x = np.asarray(r, dtype=np.float64) / self.radius
        return np.divide(self.steepness * x, _root(x * x), out=np.full_like(x, math.inf), where=np.abs(x) < 1.0)

    def transform(self, t: ArrayLike) -> FloatArray:
        """Return σ t artanh(t/R), infinite from R on."""
        x = np.asarray(t, dtype=np.float64) / self.radius
        value = np.arctanh(x, out=np.full_like(x, math.inf), where=x < 1.0)
        return np.asarray(self.steepness * self.radius * x * value)

    def transform_derivative(self, t: ArrayLike) -> FloatArray:
        """Return σ [artanh(x) + x/(1-x²)], x = t/R, infinite from R on."""
        x = np.asarray(t, dtype=np.float64) / self.radius
        inside = x < 1.0
        value = np.arctanh(x, out=np.full_like(x, math.inf), where=inside)
        return np.asarray(self.steepness * (value + np.divide(x, 1.0 - x * x, out=np.zeros_like(x), where=inside)))

    def transform_integral(self, a: ArrayLike) -> FloatArray:
        """Return σ ∫_0^a t artanh(t/R) dt; with t = R tanh u, σ R² ∫ u tanh u/cosh² u du."""
        return self.steepness * self.radius**2 * self._integral(a, lambda u, tangent: u * tangent)

    def transform_square_integral(self, a: ArrayLike) -> FloatArray:
        """Return σ² ∫_0^a (t artanh(t/R))² dt; with t = R tanh u, σ² R³ ∫ (u tanh u)²/cosh² u du."""
        return self.steepness**2 * self.radius**3 * self._integral(a, lambda u, tangent: (u * tangent) ** 2)

    def _integral(self, a: ArrayLike, function: Callable[[FloatArray, FloatArray], FloatArray]) -> FloatArray:
        """Return ∫_0^U function(u, tanh u)/cosh² u du with tanh U = a/R < 1, so U < 19: on 20 panels."""
        x, w = gauss_rule()
        x, w = ((x + np.arange(20.0)[:, None]) / 20.0).ravel(), np.tile(w / 20.0, 20)
        end = np.arctanh(np.asarray(a, dtype=np.float64) / self.radius)
        u = end[..., None] * x
        return np.asarray(end * ((function(u, np.tanh(u)) / np.cosh(u) ** 2) @ w))

    def contact_radius(self, y: ArrayLike) -> FloatArray:
        """Return R tanh u with u tanh u = y/(σR), by Newton's method from above."""
        wanted = np.asarray(y, dtype=np.float64) / (self.steepness * self.radius)
        u = 0.5 * (wanted + np.sqrt(wanted * wanted + 4.0 * wanted))  # above the root, since u tanh u ≥ u²/(1+u)
        u = np.maximum(u, 1e-300)
        for _ in range(12):
            tangent = np.tanh(u)
            u = u - (u * tangent - wanted) / (tangent + u * (1.0 - tangent * tangent))
        return np.where(wanted == 0.0, 0.0, self.radius * np.tanh(u))

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[FloatArray, FloatArray]:
        """Return gap and slope; by quadrature far from the equator, in closed form near it, infinite beyond."""
        rho = np.asarray(rho, dtype=np.float64)
        gap, slope = np.full_like(rho, math.inf), np.full_like(rho, math.inf)
        r = np.hypot(rho, a)
        low, high = r < 0.5 * self.radius, (r >= 0.5 * self.radius) & (r < self.radius)
        if np.any(low):
            gap[low], slope[low] = super().shape_gap(rho[low], a)
        if np.any(high):
            gap[high], slope[high] = self._gap_near_equator(rho[high], a)
        return gap, slope

    def _gap_near_equator(self, rho: FloatArray, a: float) -> tuple[FloatArray, FloatArray]:
        """Return gap and slope for r < R in elementary functions; they lose digits for r ≪ R.

        With k = √(1-r²/R²): ∫_a^r t artanh(t/R)/√(r²-t²) dt = ρ artanh(a/R) + R arccos(a/r) - k R arctan2(ρ, k a).
        """
        radius, x = self.radius, a / self.radius
        r2 = rho * rho + a * a
        k = np.sqrt((radius - np.sqrt(r2)) * (radius + np.sqrt(r2))) / radius
        angle = np.arctan2(rho, a)
        steep = math.atanh(x)
        moment = rho * steep + radius * angle - k * radius * np.arctan2(rho, k * a)
        gap = moment - a * steep * angle
        # (a/r²) ∫ ζ' t/√(r²-t²) dt - ζ'(a) arccos(a/r), and ζ' t = ζ + (t²/R)/(1-t²/R²)
        extra = radius * (np.arctan2(rho, k * a) / k - angle)
        slope = (a / r2) * (moment + extra) - (steep + x / (1.0 - x * x)) * angle
        scale = self.steepness * 2.0 / math.pi
        return scale * gap, scale * slope

    def reduced_scales(self, adhesion_length: float) -> tuple[float, float]:
        """Return the scales of the parabola with the curvature of the apex, (23) and (24)."""
        return parabolic_scales(self.radius / self.steepness, adhesion_length)

    def scaled(self, in_plane: float, normal: float) -> SphericalCap:
        """Return the cap in other units."""
        return SphericalCap(self.radius / in_plane, self.steepness * (in_plane / normal))


def _root(square: FloatArray) -> FloatArray:
    """Return √(1-square), 0 where the root would be imaginary."""
    return np.asarray(np.sqrt(np.maximum(1.0 - square, 0.0)))


_SHAPES: Final[tuple[type[TipShape], ...]] = (
    Parabola,
    Cone,
    PowerLaw,
    SphericalCap,
    Profile,
    EllipticParaboloid,
    HeightMap,
)
TIPS: Final[Mapping[str, type[TipShape]]] = {shape.name: shape for shape in _SHAPES}
