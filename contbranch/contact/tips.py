"""Axisymmetric tip shapes with their Abel transforms ζ(t) = t ∫_0^t z'(r)/√(t²-r²) dr in closed form.

ζ(a) is the displacement at which the tip alone, without adhesion, makes a contact of radius a.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import ClassVar

import numpy as np
import scipy
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.height_map import HeightMap
from contbranch.contact.tip_profile import Profile
from contbranch.contact.tip_shape import Tip, TipShape, gauss_rule
from contbranch.contact.tip_surface import EllipticParaboloid
from contbranch.contact.units import finite_number, make_positive, positive_number
from contbranch.errors import InputError

__all__ = [
    "TIPS",
    "Cone",
    "EllipticParaboloid",
    "HeightMap",
    "Hyperboloid",
    "Parabola",
    "PowerLaw",
    "Profile",
    "SphericalCap",
    "Tip",
    "TipShape",
    "WavySphere",
]


# Step of tables of Struve functions, of which a spline of degree 7 is right to 1e-14.
_STRUVE_STEP = 0.05


@dataclass(frozen=True)
class _Monomial(Tip):
    """z = s rⁿ/n, ζ = c tⁿ with n = `apex_exponent`, s = `_amplitude` and c = s B(n/2, 1/2)/2, B the beta function."""

    closed = True

    def __post_init__(self) -> None:
        make_positive(self, *self.parameters())

    @property
    def _amplitude(self) -> float:
        raise NotImplementedError

    @cached_property
    def _transformed(self) -> float:
        return 0.5 * self._amplitude * float(scipy.special.beta(0.5 * self.apex_exponent, 0.5))

    def height(self, r: ArrayLike) -> Array:
        """Return s rⁿ/n."""
        return _power(self._amplitude / self.apex_exponent, r, self.apex_exponent)

    def height_derivative(self, r: ArrayLike) -> Array:
        """Return s r^(n-1)."""
        return _power(self._amplitude, r, self.apex_exponent - 1.0)

    def transform(self, t: ArrayLike) -> Array:
        """Return c tⁿ."""
        return _power(self._transformed, t, self.apex_exponent)

    def transform_derivative(self, t: ArrayLike) -> Array:
        """Return c n t^(n-1)."""
        return _power(self._transformed * self.apex_exponent, t, self.apex_exponent - 1.0)

    def _integral(self, a: ArrayLike, power: int) -> Array:
        """Return c^m a^(mn+1)/(mn+1)."""
        order = power * self.apex_exponent + 1.0
        return _power(self._transformed**power / order, a, order)

    def _gap_far(self, rho: Array, a: float) -> tuple[Array, Array]:
        """Return gap and slope for ρ ≥ a, with ∫_a^r tⁿ/√(r²-t²) dt = rⁿ B(1/2, (n+1)/2)/2 I_(ρ²/r²)(1/2, (n+1)/2)."""
        n, c = self.apex_exponent, self._transformed
        r2 = rho * rho + a * a
        far = r2 > 0.0  # r = 0 only at the apex without contact, where the gap and what multiplies 1/r² vanish
        p, q = 0.5, 0.5 * (n + 1.0)
        part = np.divide(rho * rho, r2, out=np.ones_like(r2), where=far)
        moment = np.asarray((0.5 * scipy.special.beta(p, q) * c) * scipy.special.betainc(p, q, part) * r2 ** (0.5 * n))
        angle = np.where(far, np.arctan2(rho, a), 0.5 * math.pi)
        gap = moment - (c * a**n) * angle
        slope = n * (np.divide(a * moment, r2, out=np.zeros_like(r2), where=far) - c * a ** (n - 1.0) * angle)
        return (2.0 / math.pi) * gap, (2.0 / math.pi) * slope

    def _rise(self, a: float, tau: Array, t: Array) -> Array:
        """Return c (tⁿ - aⁿ) without cancellation."""
        n, ratio = self.apex_exponent, tau / a
        return np.asarray((self._transformed * a**n) * np.expm1(0.5 * n * np.log1p(ratio * ratio)))

    def contact_radius(self, y: ArrayLike) -> Array:
        """Return (y/c)^(1/n)."""
        return _power(1.0, np.asarray(y) / self._transformed, 1.0 / self.apex_exponent)

    def radius_at(self, height: float) -> float:
        """Return (n z/s)^(1/n)."""
        return float((self.apex_exponent * height / self._amplitude) ** (1.0 / self.apex_exponent))

    def reduced_scales(self, adhesion_length: float) -> tuple[float, float]:
        """Return X with X^(2n-1) = L/s² and Z = s Xⁿ."""
        n, s = self.apex_exponent, self._amplitude
        x = (adhesion_length / s**2) ** (1.0 / (2.0 * n - 1.0))
        return x, s * x**n


def _power(factor: float, base: ArrayLike, exponent: float) -> Array:
    return factor * np.asarray(base, dtype=float) ** exponent


@dataclass(frozen=True)
class Parabola(_Monomial):
    """z = r²/(2R), ζ = t²/R.

    Attributes
    ----------
    radius
        R > 0, the radius of curvature, a length.
    """

    name = "parabola"
    dimensions: ClassVar[Mapping[str, str]] = {"radius": "length"}

    radius: float

    @property
    def natural_length(self) -> float:
        """R."""
        return self.radius

    @property
    def _amplitude(self) -> float:
        return 1.0 / self.radius

    @property
    def _transformed(self) -> float:
        return 1.0 / self.radius

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[Array, Array]:
        """Return (2/π) [(r²/2 - a²) arccos(a/r) + aρ/2]/R and its derivative, (2a/πR) [aρ/r² - arccos(a/r)]."""
        rho = np.asarray(rho, dtype=float)
        square = rho * rho
        if a == 0.0:
            return square * (0.5 / self.radius), np.zeros_like(rho)
        angle = np.arctan2(rho, a)
        a2, moment = a * a, a * rho
        scale = 1.0 / (math.pi * self.radius)
        gap = ((square - a2) * angle + moment) * scale
        return gap, (moment / (square + a2) - angle) * (2.0 * a * scale)

    def scaled(self, in_plane: float, normal: float) -> Parabola:
        """Return the parabola in other units."""
        return Parabola(self.radius * (normal / in_plane**2))


@dataclass(frozen=True)
class Cone(_Monomial):
    """z = s r, ζ = (π/2) s t.

    Attributes
    ----------
    slope
        s > 0, dimensionless: the cotangent of half the opening angle.
    """

    name = "cone"

    slope: float

    @property
    def apex_exponent(self) -> float:
        """1."""
        return 1.0

    @property
    def natural_length(self) -> float:
        """1: a cone has no length of its own."""
        return 1.0

    @property
    def _amplitude(self) -> float:
        return self.slope

    def scaled(self, in_plane: float, normal: float) -> Cone:
        """Return the cone in other units."""
        return Cone(self.slope * (in_plane / normal))


@dataclass(frozen=True)
class PowerLaw(_Monomial):
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

    name = "power-law"
    dimensions: ClassVar[Mapping[str, str]] = {"length": "length"}

    exponent: float
    length: float
    steepness: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
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

    def scaled(self, in_plane: float, normal: float) -> PowerLaw:
        """Return the tip in other units."""
        return replace(self, length=self.length / in_plane, steepness=self.steepness * (in_plane / normal))


# Of [x − (1 − x²) artanh x]/2 = Σ x^(2k+3)/((2k+1)(2k+3)), to rounding for x < 0.4.
_CAP_SERIES = 1.0 / ((2.0 * np.arange(20.0) + 1.0) * (2.0 * np.arange(20.0) + 3.0))


@dataclass(frozen=True)
class WavySphere(Tip):
    """z = r²/(2R) + A (1 - cos(2πr/λ)): a sphere with concentric waves (P. R. Guduru, J. Mech. Phys. Solids 55, 445
    (2007)), or with a dimple or bump of the size of its first wave.

    Attributes
    ----------
    radius
        R > 0 of the sphere, a length.
    amplitude
        A, a height; A < 0 begins with a bump that is blunter than the sphere, as long as 1/R + (2π/λ)² A > 0.
    wavelength
        λ > 0, a length.
    """

    name = "wavy-sphere"
    dimensions: ClassVar[Mapping[str, str]] = {"radius": "length", "amplitude": "length", "wavelength": "length"}

    radius: float
    amplitude: float
    wavelength: float

    def __post_init__(self) -> None:
        make_positive(self, "radius", "wavelength")
        object.__setattr__(self, "amplitude", finite_number(self.amplitude, "amplitude"))
        if self._curvature <= 0.0:
            raise InputError(
                f"amplitude: {self.amplitude:g}; must be above {-1.0 / (self.radius * self._wave**2):g}: otherwise the "
                "apex is no summit"
            )

    @property
    def _wave(self) -> float:
        return 2.0 * math.pi / self.wavelength

    @property
    def _curvature(self) -> float:
        return 1.0 / self.radius + self.amplitude * self._wave**2

    @property
    def natural_length(self) -> float:
        """R."""
        return self.radius

    def height(self, r: ArrayLike) -> Array:
        """Return the profile z(r)."""
        r = np.asarray(r, dtype=float)
        return np.asarray(r * r / (2.0 * self.radius) + 2.0 * self.amplitude * np.sin(0.5 * self._wave * r) ** 2)

    def height_derivative(self, r: ArrayLike) -> Array:
        """Return z'(r)."""
        r = np.asarray(r, dtype=float)
        return np.asarray(r / self.radius + self.amplitude * self._wave * np.sin(self._wave * r))

    def transform(self, t: ArrayLike) -> Array:
        """Return ζ = t²/R + (π/2) A k t H₀(k t), with Struve's function."""
        t = np.asarray(t, dtype=float)
        x = self._wave * t
        return np.asarray(t * t / self.radius + 0.5 * math.pi * self.amplitude * x * _struve(0, x))

    def transform_derivative(self, t: ArrayLike) -> Array:
        """Return ζ' = 2t/R + (π/2) A k [H₀(k t) + k t (2/π - H₁(k t))]."""
        t = np.asarray(t, dtype=float)
        x = self._wave * t
        waves = _struve(0, x) + x * (2.0 / math.pi - _struve(1, x))
        return np.asarray(2.0 * t / self.radius + 0.5 * math.pi * self.amplitude * self._wave * waves)

    def scaled(self, in_plane: float, normal: float) -> WavySphere:
        """Return the tip in other units."""
        radius = self.radius * normal / in_plane**2
        return WavySphere(radius, self.amplitude / normal, self.wavelength / in_plane)


def _struve(order: int, x: Array) -> Array:
    """Return Struve's function, from a table: SciPy's takes 5 µs each."""
    return np.asarray(_struve_spline(order, max(3, math.ceil(math.log2(float(np.max(x, initial=0.0)) + 1.0))))(x))


@cache
def _struve_spline(order: int, octave: int) -> scipy.interpolate.BSpline:
    x = np.arange(0.0, 2.0**octave + _STRUVE_STEP, _STRUVE_STEP)
    return scipy.interpolate.make_interp_spline(x, scipy.special.struve(order, x), 7)


@dataclass(frozen=True)
class Hyperboloid(Tip):
    """z = s (√(r² + b²) - b) with b = s R: a cone with a round end, as of conical and pyramidal probes.

    Its transform is that of B. B. Akhremitchev and G. C. Walker, Langmuir 15, 5630 (1999).

    Attributes
    ----------
    slope
        s > 0 of the cone, the cotangent of its half angle.
    radius
        R > 0 of the end, a length.
    """

    name = "hyperboloid"
    dimensions: ClassVar[Mapping[str, str]] = {"radius": "length"}

    slope: float
    radius: float

    def __post_init__(self) -> None:
        make_positive(self, "slope", "radius")

    @staticmethod
    def pyramid(half_angle: float, radius: float) -> Hyperboloid:
        """Return the tip whose cross sections far from its end are as large as those of a pyramid with four sides.

        Parameters
        ----------
        half_angle
            Between axis and faces, in degrees.
        radius
            Of the end.
        """
        angle = positive_number(half_angle, "half_angle")
        if angle >= 90.0:
            raise InputError(f"half_angle: {angle:g}; must be below 90 degrees")
        return Hyperboloid(0.5 * math.sqrt(math.pi) / math.tan(math.radians(angle)), radius)

    @property
    def _width(self) -> float:
        return self.slope * self.radius

    @property
    def natural_length(self) -> float:
        """R."""
        return self.radius

    def height(self, r: ArrayLike) -> Array:
        """Return the profile z(r)."""
        r = np.asarray(r, dtype=float)
        return np.asarray(self.slope * r * (r / (np.hypot(r, self._width) + self._width)))

    def height_derivative(self, r: ArrayLike) -> Array:
        """Return z'(r)."""
        r = np.asarray(r, dtype=float)
        return np.asarray(self.slope * r / np.hypot(r, self._width))

    def transform(self, t: ArrayLike) -> Array:
        """Return ζ = s t arctan(t/b)."""
        t = np.asarray(t, dtype=float)
        return np.asarray(self.slope * t * np.arctan(t / self._width))

    def transform_derivative(self, t: ArrayLike) -> Array:
        """Return ζ' = s [arctan(t/b) + bt/(b² + t²)]."""
        x = np.asarray(t, dtype=float) / self._width
        return np.asarray(self.slope * (np.arctan(x) + x / (1.0 + x * x)))

    def scaled(self, in_plane: float, normal: float) -> Hyperboloid:
        """Return the tip in other units."""
        return Hyperboloid(self.slope * in_plane / normal, self.radius * normal / in_plane**2)


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

    closed = True
    name = "spherical-cap"
    dimensions: ClassVar[Mapping[str, str]] = {"radius": "length"}

    radius: float
    steepness: float = 1.0

    def __post_init__(self) -> None:
        make_positive(self, *self.parameters())

    @property
    def extent(self) -> float:
        """R."""
        return self.radius

    @property
    def natural_length(self) -> float:
        """R."""
        return self.radius

    def height(self, r: ArrayLike) -> Array:
        """Return σ r²/(R + √(R²-r²)), infinite beyond R."""
        x = np.asarray(r, dtype=float) / self.radius
        square = x * x
        inside = square <= 1.0
        return np.where(inside, self.steepness * self.radius * square / (1.0 + _root(square)), math.inf)

    def height_derivative(self, r: ArrayLike) -> Array:
        """Return σ r/√(R²-r²), infinite from R on."""
        x = np.asarray(r, dtype=float) / self.radius
        return np.divide(self.steepness * x, _root(x * x), out=np.full_like(x, math.inf), where=np.abs(x) < 1.0)

    def transform(self, t: ArrayLike) -> Array:
        """Return σ t artanh(t/R), infinite from R on."""
        x = np.asarray(t, dtype=float) / self.radius
        value = np.arctanh(x, out=np.full_like(x, math.inf), where=x < 1.0)
        return self.steepness * self.radius * x * value

    def transform_derivative(self, t: ArrayLike) -> Array:
        """Return σ [artanh(x) + x/(1-x²)], x = t/R, infinite from R on."""
        x = np.asarray(t, dtype=float) / self.radius
        inside = x < 1.0
        value = np.arctanh(x, out=np.full_like(x, math.inf), where=inside)
        return self.steepness * (value + np.divide(x, 1.0 - x * x, out=np.zeros_like(x), where=inside))

    def _integral(self, a: ArrayLike, power: int) -> Array:
        """Return ∫_0^a ζ^m dt: σ R² [x − (1 − x²) artanh x]/2 for m = 1, x = a/R, by its series where that cancels.

        With t = R tanh u, σ^m R^(m+1) ∫ (u tanh u)^m/cosh² u du, u < 19: on 20 panels.
        """
        share = np.asarray(a, dtype=float) / self.radius
        end = np.arctanh(share)
        if power == 1:
            squares = share * share
            series = share * squares * polynomial.polyval(squares, _CAP_SERIES)
            closed = 0.5 * (share - (1.0 - squares) * end)
            return np.asarray(self.steepness * self.radius**2 * np.where(share < 0.4, series, closed))
        x, w = gauss_rule()
        x, w = ((x + np.arange(20.0)[:, None]) / 20.0).ravel(), np.tile(w / 20.0, 20)
        u = end[..., None] * x
        scale = self.steepness**power * self.radius ** (power + 1) * end
        return np.asarray(scale * (((u * np.tanh(u)) ** power / np.cosh(u) ** 2) @ w))

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[Array, Array]:
        """Return gap and slope; by quadrature far from the equator, in closed form near it, infinite beyond."""
        rho = np.asarray(rho, dtype=float)
        gap, slope = np.full_like(rho, math.inf), np.full_like(rho, math.inf)
        r = np.hypot(rho, a)
        low, high = r < 0.5 * self.radius, (r >= 0.5 * self.radius) & (r < self.radius)
        if np.any(low):
            gap[low], slope[low] = super().shape_gap(rho[low], a)
        if np.any(high):
            gap[high], slope[high] = self._gap_near_equator(rho[high], a)
        return gap, slope

    def _gap_near_equator(self, rho: Array, a: float) -> tuple[Array, Array]:
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
        return Parabola(self.radius / self.steepness).reduced_scales(adhesion_length)

    def scaled(self, in_plane: float, normal: float) -> SphericalCap:
        """Return the cap in other units."""
        return SphericalCap(self.radius / in_plane, self.steepness * (in_plane / normal))


def _root(square: Array) -> Array:
    """Return √(1-square), 0 where the root would be imaginary."""
    return np.sqrt(np.maximum(1.0 - square, 0.0))


_SHAPES: tuple[type[TipShape], ...] = (
    Parabola,
    Cone,
    PowerLaw,
    SphericalCap,
    Profile,
    EllipticParaboloid,
    HeightMap,
    Hyperboloid,
    WavySphere,
)
TIPS: Mapping[str, type[TipShape]] = {shape.name: shape for shape in _SHAPES}
