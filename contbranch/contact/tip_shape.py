"""What a tip is: a surface above the plane (`TipShape`); if axisymmetric, a profile with its Abel transform (`Tip`).

The axisymmetric shapes are in `tips`, the others in `tip_surface` and `height_map`. Heights and lengths are in the
contact's own units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array

_ORDER = 24  # Gauss-Legendre nodes for the gap: the worst analytic integrand (a = rho) loses a factor 10 with each node
_PEAK, _MIDDLE = 32, 1e-7  # of the pressure in the middle; which that is at this share of the radius, too
# Ends of pieces, in units of the logarithm of the radius from the rim, where ζ' is steep towards the edge of a tip.
_TOWARDS_EDGE = (0.0, 0.02, 0.1, 0.4, 1.5, math.inf)
_ROUND = 4.0  # apex exponent from which on polynomials tell ζ'/t next to the apex


# Change of integrals of the transform by twice as many panels that is rounding, panels at most, and the radii for which
# they are counted, as powers of 2 of the natural length.
RESOLVED, MOST_PANELS, OCTAVES = 1e-12, 128, range(-8, 5)


@cache
def _composite(panels: int) -> tuple[Array, Array]:
    """Return nodes and weights of the rule on each of so many equal parts of [0, 1]."""
    x, w = gauss_rule()
    return ((np.arange(panels)[:, None] + x) / panels).ravel(), np.tile(w, panels) / panels


@cache
def gauss_rule(order: int = _ORDER) -> tuple[Array, Array]:
    """Return (order,) nodes and weights of Gauss and Legendre on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(order)
    return 0.5 * (x + 1.0), 0.5 * w


@dataclass(frozen=True)
class TipShape:
    """A rigid tip of any shape: what a contact, and a model on a grid, need of it.

    A new shape without axial symmetry writes `natural_length`, `surface` and `scaled`, and `reduced_scales` if its
    apex is no paraboloid; an axisymmetric one is a `Tip`.
    """

    name: ClassVar[str] = ""
    dimensions: ClassVar[Mapping[str, str]] = {}

    @property
    def axisymmetric(self) -> Tip | None:
        """The same tip as one with a profile and its transform, if it is axisymmetric; otherwise None."""
        return None

    @property
    def limitation(self) -> str:
        """What is to be said of whatever is computed with the tip, in words; mostly nothing."""
        return ""

    @property
    def is_axisymmetric(self) -> bool:
        """Whether the height depends on the distance from the apex alone."""
        return self.axisymmetric is not None

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the surface is the same under x → -x and under y → -y."""
        return self.is_axisymmetric

    @property
    def natural_length(self) -> float:
        """A length of the tip itself, which sets the scales where no interaction does."""
        raise self._lacks("natural_length")

    def surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the height above the point that is first to touch, at places in the plane.

        Parameters
        ----------
        x, y
            Coordinates of any shapes that fit each other; where the tip has one apex, it is at x = y = 0.

        Returns
        -------
        heights
            Of the common shape, 0 where the tip is lowest; infinite beyond a tip of finite extent.
        """
        raise self._lacks("surface(x, y)")

    def reduced_scales(self, adhesion_length: float) -> tuple[float, float]:
        """Return the units in plane and along the normal, X = R^(2/3) L^(1/3) and Z = R^(1/3) L^(2/3), (23), (24).

        R is `natural_length`; a tip that is no paraboloid at its apex has others, with Z² = L X.

        Parameters
        ----------
        adhesion_length
            L = |Δγ|/E.
        """
        r, h = math.cbrt(self.natural_length), math.cbrt(adhesion_length)
        return r * r * h, r * h * h

    def scaled(self, in_plane: float, normal: float) -> Self:
        """Return the tip in other units, worth `in_plane` (lengths in the plane) and `normal` (heights) of these."""
        raise self._lacks("scaled(in_plane, normal)")

    def _lacks(self, what: str) -> NotImplementedError:
        return NotImplementedError(f"{type(self).__name__} must define {what}")

    def parameters(self) -> dict[str, Any]:
        """Return the fields from which the tip can be made again, by name."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.init}

    def described(self) -> dict[str, Any]:
        """Return what a description in JSON says of the tip: its parameters, unless these are too long."""
        return self.parameters()


@dataclass(frozen=True)
class Tip(TipShape):
    """A rigid tip with the axisymmetric profile z(r), z(0) = 0. All functions of radii take and return any shape.

    A new shape writes `natural_length`, `height`, `height_derivative`, `transform`, `transform_derivative` and
    `scaled`, and `reduced_scales` if its apex is no paraboloid; the rest is done by Gauss-Legendre quadrature unless
    the shape has it in closed form,
    to rounding where the transform is analytic.
    """

    closed: ClassVar[bool] = False  # whether what is integrated is a polynomial, or known otherwise

    @property
    def axisymmetric(self) -> Tip:
        """The tip itself."""
        return self

    @property
    def limitation(self) -> str:
        """How well quadrature resolves the transform, where that is not to rounding."""
        worst = 0.0 if self.closed else max(self._panels(k)[1] for k in OCTAVES)
        return "" if worst <= RESOLVED else f"integrals of its transform are resolved to {worst:.1g} only"

    def rule(self, reach: float) -> tuple[Array, Array]:
        """Return nodes and weights of quadrature on [0, 1] for functions of the transform up to a radius."""
        if self.closed:
            return gauss_rule()
        octave = math.ceil(math.log2(max(reach / self.natural_length, 1e-300)))
        return _composite(self._panels(max(octave, OCTAVES[0]))[0])

    def _panels(self, octave: int) -> tuple[int, float]:
        """Return the panels for radii up to 2^k natural lengths, and what twice as many change, relative."""
        known: dict[int, tuple[int, float]] = self.__dict__.setdefault("_known_panels", {})
        if octave not in known:
            reach, panels = min(self.natural_length * 2.0**octave, 0.5 * self.extent), 1
            before: Array = np.full(2, math.inf)
            while panels <= MOST_PANELS:
                x, w = _composite(panels)
                found = np.array([self.transform_derivative(reach * one) @ w for one in (x, np.sin(0.5 * math.pi * x))])
                changed = float(np.abs(found - before).max() / max(np.abs(found).max(), 1e-300))
                if changed <= RESOLVED:
                    break
                before, panels = found, 2 * panels
            known[octave] = max(panels // 2, 1), changed
        return known[octave]

    @property
    def extent(self) -> float:
        """The radius beyond which the tip does not exist (and its height is infinite)."""
        return math.inf

    @property
    def table_end(self) -> float:
        """The radius beyond which the tip is the continuation of a description that ends."""
        return math.inf

    @property
    def apex_exponent(self) -> float:
        """The exponent n with which the profile starts, z ∝ r^n."""
        return 2.0

    def surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return z(√(x² + y²))."""
        return self.height(np.hypot(x, y))

    def height(self, r: ArrayLike) -> Array:
        """Return the profile z(r)."""
        raise self._lacks("height(r)")

    def height_derivative(self, r: ArrayLike) -> Array:
        """Return z'(r)."""
        raise self._lacks("height_derivative(r)")

    def transform(self, t: ArrayLike) -> Array:
        """Return ζ(t) = t ∫_0^t z'(r)/√(t²-r²) dr, the displacement at which the tip's contact radius is t."""
        raise self._lacks("transform(t)")

    def transform_derivative(self, t: ArrayLike) -> Array:
        """Return ζ'(t)."""
        raise self._lacks("transform_derivative(t)")

    def transform_integral(self, a: ArrayLike) -> Array:
        """Return ∫_0^a ζ dt."""
        return self._integral(a, 1)

    def transform_square_integral(self, a: ArrayLike) -> Array:
        """Return ∫_0^a ζ² dt."""
        return self._integral(a, 2)

    def _integral(self, a: ArrayLike, power: int) -> Array:
        """Return ∫_0^a ζ^m dt."""
        end = np.asarray(a, dtype=float)
        x, w = self.rule(float(np.max(end, initial=0.0)))
        return end * (self.transform(end[..., None] * x) ** power @ w)

    def contact_pressure(self, r: ArrayLike, a: float) -> Array:
        """Return the pressure in a contact of radius `a` without interaction, for a unit plane-strain modulus.

        Parameters
        ----------
        r
            Radii from 0 to `a`, any shape; at 0 the pressure is infinite where the apex is sharp.

        Returns
        -------
        pressure
            p = (1/π) ∫_r^a ζ'(t)/√(t² - r²) dt, of the shape of `r`.
        """
        r = np.asarray(r, dtype=float)
        own, reach = r[..., None], np.sqrt(np.maximum((a - r) * (a + r), 0.0))
        x, w = self.rule(a)
        if self.apex_exponent < _ROUND:  # t = r cosh y
            y, found = np.arcsinh(reach / np.where(r > 0.0, r, 1.0)), np.zeros_like(r)
            ends = _TOWARDS_EDGE if math.isfinite(self.extent) else (0.0, math.inf)
            for near, far in pairwise(np.minimum(end, y) for end in ends):  # distances from the rim
                places = (y - far)[..., None] + (far - near)[..., None] * x
                found = found + (far - near) * (self.transform_derivative(own * np.cosh(places)) @ w)
        else:
            t = np.hypot(own, reach[..., None] * x)
            found = reach * ((self.transform_derivative(t) / t) @ w)
        if not (r > 0.0).all():
            middle = math.inf
            if self.apex_exponent > 1.0:  # t = a u^m, since ζ'/t is no polynomial
                u, weights = gauss_rule(_PEAK)
                power = 4.0 / (self.apex_exponent - 1.0)
                middle = power * float(weights @ (self.transform_derivative(a * u**power) / u))
                if math.isfinite(self.extent):
                    middle = math.pi * float(self.contact_pressure(np.array([_MIDDLE * a]), a)[0])
            found = np.where(r > 0.0, found, middle)
        return np.asarray(found / math.pi)

    def contact_radius(self, y: ArrayLike) -> Array:
        """Return a ≥ 0 with ζ(a) = y ≥ 0."""
        solve = np.vectorize(lambda wanted: inverse(self.transform, wanted, self.natural_length), otypes=[float])
        return np.asarray(solve(y))

    def radius_at(self, height: float) -> float:
        """Return the radius at which the profile has a height; where the tip ends if it is lower."""
        return inverse(self.height, height, 1.0, self.extent)

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[Array, Array]:
        """Return the gap around a contact of radius `a` without interaction, and its derivative with respect to `a`.

        Parameters
        ----------
        rho
            Places outside the rim by ρ = √(r² - a²) ≥ 0, any shape.
        a
            The radius of the contact; for 0 the gap is the height.

        Returns
        -------
        gap, slope
            g = (2/π) ∫_a^r (ζ(t) - ζ(a))/√(r² - t²) dt and (∂g/∂a) at fixed ρ, of the shape of `rho`.
        """
        rho = np.asarray(rho, dtype=float)
        gap, slope = np.empty_like(rho), np.empty_like(rho)
        near = rho < a
        gap[near], slope[near] = self._gap_near(rho[near], a)
        gap[~near], slope[~near] = self._gap_far(rho[~near], a)
        return gap, slope

    def _gap_near(self, rho: Array, a: float) -> tuple[Array, Array]:
        """Return gap and slope for ρ < a: with τ = ρ sin ψ, t² = a² + τ², g = (2/π) ∫_0^(π/2) (ζ(t) - ζ(a)) τ/t dψ."""
        x, w = self.rule(2.0 * a)
        tau = rho[..., None] * np.sin(0.5 * math.pi * x)
        t = np.sqrt(a * a + tau * tau)
        ratio = tau / t
        rise = self._rise(a, tau, t)
        slope_at_rim = float(self.transform_derivative(a))
        turn = (self.transform_derivative(t) * (a / t) - slope_at_rim - rise * (a / (t * t))) * ratio
        return (rise * ratio) @ w, turn @ w

    def _gap_far(self, rho: Array, a: float) -> tuple[Array, Array]:
        """Return gap and slope for ρ ≥ a: g = z(r) - (2/π) [∫_0^a ζ(t)/√(r² - t²) dt + ζ(a) arccos(a/r)]."""
        r2 = rho * rho + a * a
        r = np.sqrt(r2)
        level, slope_at_rim = float(self.transform(a)), float(self.transform_derivative(a))
        angle = np.where(r2 > 0.0, np.arctan2(rho, a), 0.5 * math.pi)
        if a == 0.0:
            return np.asarray(self.height(r), dtype=float), np.full_like(r, -slope_at_rim)
        x, w = self.rule(a)
        t, values = a * x, a * w * self.transform(a * x)
        left = r2[..., None] - t * t
        gap = self.height(r) - (2.0 / math.pi) * ((values / np.sqrt(left)).sum(axis=-1) + level * angle)
        inner = level * (1.0 / rho - rho / r2) - a * (values / left**1.5).sum(axis=-1)
        return gap, self.height_derivative(r) * (a / r) - (2.0 / math.pi) * (inner + slope_at_rim * angle)

    def _rise(self, a: float, tau: Array, t: Array) -> Array:
        """Return ζ(t) - ζ(a) for t² = a² + τ²; shapes override it that have it without cancellation."""
        return self.transform(t) - float(self.transform(a))


def inverse(function: Callable[[float], Any], value: float, first: float, end: float = math.inf) -> float:
    """Return x ≥ 0 at which a function that rises from 0 has a `value`; `end` if it is less up to there.

    `first` is where the search begins.
    """
    high = first
    while high < end and float(function(high)) < value:
        high *= 2.0
    high = min(high, end)
    if float(function(high)) <= value:
        return high
    return float(scipy.optimize.brentq(lambda x: float(function(x)) - value, 0.0, high, xtol=1e-300, rtol=1e-15))
