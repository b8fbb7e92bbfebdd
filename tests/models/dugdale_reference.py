"""Maugis-Dugdale attraction under any axisymmetric tip, to 30 digits, from formulas and tip shapes of its own.

The pressure is −σ, σ = w/z0, where the gap is less than z0, E = 1, and the tip z(r) has the transform
ζ(t) = t ∫_0^t z'(s)/√(t²−s²) ds, which rises. With the radii a of the contact and c of the attraction::

    no contact:  d = z(c) − z0 − (4/π) σ c,        F = −π σ c²,    g(0) = −d − 2 σ c
    contact:     d = ζ(a) − 2 σ √(c²−a²),          F = 2 [d a − ∫_0^a ζ dt] − 2 σ [c² θ − a √(c²−a²)]
                 z0 = (2/π) ∫_0^θ [ζ(c cos φ) − ζ(a)] dφ + (4/π) σ c [θ sin θ − (1 − cos θ)],   cos θ = a/c

and dF = 2 a dd − 4 σ c θ dc. In contact the curve is run through by the angle θ, from π/2 at first touch towards 0, and
c, which grows along the whole curve, is the only root of the last condition.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import mpmath
import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar
from scipy.special import elliprf

# Digits of all sums, and log10 of cot θ between which folds in contact are looked for, with the distance of the looks.
DIGITS, LOOKS, SPACING = 30, (-5.0, 4.0), 0.5
Number = Any


class State(NamedTuple):
    """One equilibrium, with the slopes of load and displacement as functions of c."""

    load: Number
    displacement: Number
    contact_radius: Number
    zone_radius: Number
    central_gap: Number
    load_slope: Number
    displacement_slope: Number


def root(function: Callable[[Number], Number], low: Number, high: Number) -> Number:
    """A zero between two places where the signs differ, by false position with half weights and bisection."""
    low, high = mpmath.mpf(low), mpmath.mpf(high)
    f, g = function(low), function(high)
    if f == 0 or g == 0:
        return low if f == 0 else high
    if f * g > 0:
        raise ValueError("no change of sign")
    for count in range(400):
        middle = (low + high) / 2 if count % 8 == 7 else (low * g - high * f) / (g - f)
        value = function(middle)
        if value == 0 or abs(high - low) < mpmath.mpf(10) ** (4 - DIGITS) * (1 + abs(middle)):
            return middle
        if value * g < 0:
            low, f = high, g
        else:
            f *= g / (g + value)
        previous, high, g = high, middle, value
        if abs(high - previous) < mpmath.mpf(10) ** (3 - DIGITS) * (1 + abs(middle)):
            return middle
    raise ValueError("no convergence")


class Shape(ABC):
    """A tip: its height and transform, with derivatives and integrals, as functions of mpmath numbers."""

    # The largest radius of the attraction.
    end: float = math.inf

    @abstractmethod
    def height(self, r: Number) -> Number:
        """z(r)."""

    @abstractmethod
    def slope(self, r: Number) -> Number:
        """z'(r)."""

    @abstractmethod
    def transform(self, t: Number) -> tuple[Number, Number, Number]:
        """ζ(t), ζ'(t) and ∫_0^t ζ."""

    @abstractmethod
    def rise(self, c: Number, theta: Number) -> tuple[Number, Number]:
        """∫_0^θ [ζ(c cos φ) − ζ(c cos θ)] dφ and its derivative with respect to c."""

    def radius_of_slope(self, slope: Number) -> Number:
        """r with z'(r) = slope; 0 if the apex is steeper, infinite if the tip is less steep everywhere."""
        low, high = mpmath.mpf("1e-25"), mpmath.mpf(1)
        if self.slope(low) >= slope:
            return mpmath.mpf(0)
        while self.slope(high) < slope and high < 1e25:
            high *= 2
        if self.slope(high) < slope:
            return mpmath.inf
        return mpmath.exp(root(lambda x: self.slope(mpmath.exp(x)) - slope, mpmath.log(low), mpmath.log(high)))


@dataclass(frozen=True)
class Powers(Shape):
    """z = Σ k rⁿ/n of the pairs (k, n); ζ = Σ k B(n/2, 1/2)/2 tⁿ."""

    terms: tuple[tuple[float, float], ...]

    def height(self, r: Number) -> Number:
        return mpmath.fsum(k * r**n / n for k, n in self.terms)

    def slope(self, r: Number) -> Number:
        return mpmath.fsum(k * r ** (mpmath.mpf(n) - 1) for k, n in self.terms)

    def _transformed(self) -> list[tuple[Number, Number]]:
        half = mpmath.mpf(1) / 2
        return [(k * mpmath.beta(n * half, half) / 2, mpmath.mpf(n)) for k, n in self.terms]

    def transform(self, t: Number) -> tuple[Number, Number, Number]:
        own = self._transformed()
        return (
            mpmath.fsum(k * t**n for k, n in own),
            mpmath.fsum(k * n * t ** (n - 1) for k, n in own),
            mpmath.fsum(k * t ** (n + 1) / (n + 1) for k, n in own),
        )

    def rise(self, c: Number, theta: Number) -> tuple[Number, Number]:
        half, cos, square = mpmath.mpf(1) / 2, mpmath.cos(theta), mpmath.sin(theta) ** 2
        value = slope = mpmath.mpf(0)
        for k, n in self._transformed():
            # ∫_0^θ cosⁿ φ dφ by Euler's incomplete integral of the first kind
            share = mpmath.betainc(half, (n + 1) / 2, 0, square) / 2 - theta * cos**n
            value += k * c**n * share
            slope += k * n * c ** (n - 1) * share
        return value, slope


@dataclass(frozen=True)
class Sphere(Shape):
    """z = R − √(R²−r²), ζ = t artanh(t/R)."""

    radius: float

    @property
    def end(self) -> float:  # type: ignore[override]
        return 0.99 * self.radius

    def height(self, r: Number) -> Number:
        return self.radius - mpmath.sqrt(self.radius**2 - r * r)

    def slope(self, r: Number) -> Number:
        return r / mpmath.sqrt(self.radius**2 - r * r)

    def radius_of_slope(self, slope: Number) -> Number:
        return self.radius * slope / mpmath.sqrt(1 + slope * slope)

    def transform(self, t: Number) -> tuple[Number, Number, Number]:
        x = t / self.radius
        logarithm = mpmath.atanh(x)
        integral = self.radius**2 * (x - (1 - x * x) * logarithm) / 2
        return t * logarithm, logarithm + x / (1 - x * x), integral

    def rise(self, c: Number, theta: Number) -> tuple[Number, Number]:
        # ∫ t artanh(t/R)/√(c²−t²) dt in elementary functions, with k = √(1 − c²/R²)
        radius, cos, sin = self.radius, mpmath.cos(theta), mpmath.sin(theta)
        x, k, tangent = c * cos / radius, mpmath.sqrt(1 - (c / radius) ** 2), sin / cos
        level, slope, _ = self.transform(c * cos)
        angle = mpmath.atan(tangent / k)
        value = c * sin * mpmath.atanh(x) + radius * (theta - k * angle)
        rate = sin * (mpmath.atanh(x) + x / (1 - x * x)) + c / (radius * k) * (
            angle - tangent * k / (k * k + tangent**2)
        )
        return value - level * theta, rate - slope * cos * theta


def precise(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with `DIGITS` digits."""

    def with_digits(*values: Any) -> Any:
        with mpmath.workdps(DIGITS):
            return function(*values)

    return with_digits


class Dugdale:
    """The equilibria of a tip with the work of adhesion w and the range z0, E = 1."""

    def __init__(self, shape: Shape, work: float, reach: float) -> None:
        self.shape = shape
        with mpmath.workdps(DIGITS):
            self.reach = mpmath.mpf(reach)
            self.stress = mpmath.mpf(work) / self.reach

    @precise
    def apart(self, c: Number) -> State:
        """Without contact."""
        d = self.shape.height(c) - self.reach - 4 / mpmath.pi * self.stress * c
        slope = self.shape.slope(c) - 4 / mpmath.pi * self.stress
        gap = -d - 2 * self.stress * c
        pull = mpmath.pi * self.stress * c
        return State(-pull * c, d, mpmath.mpf(0), mpmath.mpf(c), gap, -2 * pull, slope)

    @precise
    def touch(self) -> State:
        """First touch, on the axis: without contact the gap grows with the radius."""
        linear = (2 - 4 / mpmath.pi) * self.stress
        c = min(
            self.reach / linear, self.shape.end
        )  # too large; Newton's method falls to the root of a convex function
        for _ in range(300):
            step = (self.shape.height(c) + linear * c - self.reach) / (self.shape.slope(c) + linear)
            c -= step
            if abs(step) < 1e-27 * c:
                break
        return self.apart(c)

    @precise
    def contact(self, theta: Number) -> State:
        """In contact, with arccos(a/c) = θ."""
        cos, sin, sigma = mpmath.cos(theta), mpmath.sin(theta), self.stress
        opening = theta * sin - 2 * mpmath.sin(theta / 2) ** 2
        c = min(mpmath.pi * self.reach / (4 * sigma * opening), self.shape.end)  # too large, as at first touch
        for count in range(300):
            value, slope = self.shape.rise(c, theta)
            bracket = 2 / mpmath.pi * (slope + 2 * sigma * opening)
            step = (2 / mpmath.pi * (value + 2 * sigma * opening * c) - self.reach) / bracket
            if count == 0 and step < 0:
                raise ValueError("the attraction reaches the end of the tip")
            c -= step
            if abs(step) < 1e-26 * c:
                break
        a, s = c * cos, c * sin
        level, rate, integral = self.shape.transform(a)
        d = level - 2 * sigma * s
        load = 2 * (d * a - integral) - 2 * sigma * (c * c * theta - a * s)
        # dθ/dc from the condition for c: at fixed c its right side changes by (2/π) θ [ζ'(a) s + 2 σ a] dθ
        turn = -bracket / (2 / mpmath.pi * theta * (rate * s + 2 * sigma * a))
        d_slope = rate * (cos - s * turn) - 2 * sigma * (sin + a * turn)
        load_slope = 2 * a * d_slope - 4 * sigma * c * theta
        return State(load, d, a, c, mpmath.mpf(0), load_slope, d_slope)

    @precise
    def contact_of_radius(self, a: float) -> State:
        """In contact, with the contact radius a."""

        def excess(place: Number) -> Number:
            try:
                return mpmath.log(self.contact(mpmath.acot(mpmath.exp(place))).contact_radius / a)
            except ValueError:
                return mpmath.log(self.shape.end / a)

        low, high = mpmath.mpf(-2), mpmath.mpf(2)
        while excess(low) > 0:
            low -= 4
        while excess(high) < 0:
            high += 4
        return self.contact(mpmath.acot(mpmath.exp(root(excess, low, high))))

    @precise
    def folds(self, name: str) -> list[State]:
        """All folds of ``"load"`` or ``"displacement"`` with attraction, in the order of the curve."""
        field = f"{name}_slope"
        found = []
        if name == "displacement":
            bend = self.shape.radius_of_slope(4 / mpmath.pi * self.stress)
            if 0 < bend < self.touch().zone_radius:
                found.append(self.apart(bend))

        def slope(place: Number) -> Number:
            return getattr(self.contact(mpmath.acot(mpmath.mpf(10) ** place)), field)

        places = np.arange(LOOKS[0], LOOKS[1] + SPACING, SPACING)
        values = []
        with suppress(ValueError):
            for place in places:
                values.append(slope(place))
        for (low, before), (high, after) in pairwise(zip(places, values, strict=False)):
            if before * after < 0:
                found.append(self.contact(mpmath.acot(mpmath.mpf(10) ** root(slope, low, high))))
        return found

    def jumps_in(self) -> bool:
        """Whether the displacement falls as the attraction begins, at d = −z0."""
        with mpmath.workdps(DIGITS):
            return bool(self.shape.slope(mpmath.mpf("1e-25")) < 4 / mpmath.pi * self.stress)

    @precise
    def energy(self, state: State) -> Number:
        """∫ h² dt − π w c² + σ times the volume of the gap, with h = d − ζ in contact and −2 σ √(c²−t²) around it."""
        a, c, d, sigma = state.contact_radius, state.zone_radius, state.displacement, self.stress

        def around(angle: Number) -> Number:
            # t = c sin(angle); the volume of the gap is 4 ∫ (ζ − d + h) √(c²−t²) dt
            root = c * mpmath.cos(angle)
            h = -2 * sigma * root
            return (h * h + 4 * sigma * (self.shape.transform(c * mpmath.sin(angle))[0] - d + h) * root) * root

        inside = mpmath.quad(lambda t: (d - self.shape.transform(t)[0]) ** 2, [0, a]) if a > 0 else 0
        outside = mpmath.quad(around, [mpmath.asin(a / c), mpmath.pi / 2])
        return inside + outside - mpmath.pi * sigma * self.reach * c * c


def rigid_pull_off(height: Callable[[float], float], work: float, reach: float, far: float) -> float:
    """The load of an undeformed tip of monotonic height as it touches, under −σ for gaps up to z0, by quadrature.

    It is the limit of the pull-off load for small w/E, also for tips sharper than a parabola, whose attraction grows as
    they are pressed in: the wall then soon carries more.
    """
    stress = work / reach
    edge = brentq(lambda r: height(r) - reach, 0.0, far, xtol=1e-14)
    return -2.0 * math.pi * quad(lambda r: stress * r, 0.0, edge, epsabs=0.0, epsrel=1e-13)[0]


class Panels:
    """−σ up to the radius c with a smooth pressure besides, by the kernel of a ring of pressure around the contact.

    A ring of radius s and pressure p around a contact of radius a displaces the surface by ``k(r, s) p s ds``,

        k = (4/π) ∫_a^min(r,s) dt/√((r²−t²)(s²−t²)),

    an elliptic integral; for a = 0 it is Boussinesq's. Pressures are polynomials of τ = √(s²−a²) on panels that are
    graded towards the edge of the attraction, where the gap has a slope ∝ ln|r − c|.

    Parameters
    ----------
    transform, transform_integral
        ζ and ∫_0^t ζ.
    stress, reach
        σ and z0.
    smooth
        Pressure and its derivative as functions of the gap.
    far
        The τ beyond which the smooth pressure vanishes.
    order, grading
        Nodes of a panel, and panels on each side of the edge, each of a third of the size of the one before it.
    """

    def __init__(
        self,
        transform: Callable[[Number], Number],
        transform_integral: Callable[[float], float],
        stress: float,
        reach: float,
        smooth: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
        far: float,
        order: int = 12,
        grading: int = 9,
    ) -> None:
        self.transform, self.transform_integral, self.smooth = transform, transform_integral, smooth
        self.stress, self.reach, self.far, self.order = stress, reach, far, order
        self.shares = np.append(3.0 ** -np.arange(grading + 1.0), 0.0)

    def _displaced(self, a: float, edges: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Displacements at the ρ of `places` by unit pressures at the nodes of all panels."""
        fine, weight = np.polynomial.legendre.leggauss(24)
        v, weight = 0.5 * (fine + 1.0), 0.5 * weight
        coefficients = np.linalg.inv(np.polynomial.legendre.legvander(x, x.size - 1))
        found = []
        for low, high in pairwise(edges):
            split = np.clip(places, low, high)[:, None]
            total = 0.0
            for end in (low, high):
                # quartic in v, so that the logarithm at τ = ρ does no harm
                tau = split + (end - split) * v**4
                step = np.abs(end - split) * 4.0 * v**3 * weight
                lower, upper = np.minimum(tau, places[:, None]), np.maximum(tau, places[:, None])
                apart = np.maximum((upper - lower) * (upper + lower) / upper**2, 1e-40)
                square = a * a + lower * lower
                share = np.divide(lower, np.sqrt(square), out=np.ones_like(lower), where=square > 0.0)
                inner = np.divide(a * a, square, out=np.zeros_like(lower), where=square > 0.0)
                kernel = 4.0 / math.pi * tau * share / upper * elliprf(inner * apart, apart, 1.0)
                basis = np.polynomial.legendre.legvander((2.0 * tau - low - high) / (high - low), x.size - 1)
                total = total + np.einsum("ij,ijk->ik", kernel * step, basis)
            found.append(total @ coefficients)
        return np.concatenate(found, axis=1)

    def _undeformed(self, a: float, rho: np.ndarray) -> np.ndarray:
        """(2/π) ∫_a^r (ζ(t) − ζ(a))/√(r²−t²) dt."""
        x, w = np.polynomial.legendre.leggauss(40)
        angle = np.arctan2(rho, a)
        t = np.hypot(rho, a)[:, None] * np.cos(0.5 * angle[:, None] * (x + 1.0))
        return (self.transform(t) - self.transform(a)) @ w * angle / math.pi

    def state(self, a: float, edge: float) -> tuple[float, float, float, float]:
        """Load, displacement, gap on the axis, and the excess of the gap at τ = `edge` over the range.

        Without contact (a = 0) the displacement is that for which the excess vanishes.
        """
        edges = np.concatenate([edge * (1.0 - self.shares), (edge + (self.far - edge) * self.shares[::-1])[1:]])
        x, w = np.polynomial.legendre.leggauss(self.order)
        half = 0.5 * np.diff(edges)[:, None]
        tau = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * x).ravel()
        weights, pull = (half * w).ravel(), np.where(tau < edge, self.stress, 0.0)
        places = np.concatenate([tau, [1e-9 * edge, edge]])
        matrix, known = self._displaced(a, edges, places, x), self._undeformed(a, places)
        if a > 0.0:
            # d = ζ(a) + h(a) with h(a) = 2 ∫ p dτ
            matrix = matrix - (4.0 / math.pi) * np.outer(np.arctan2(places, a), weights)
        else:
            last, known = known[-1], known - known[-1] + self.reach
            own, matrix = matrix[-1], matrix - matrix[-1]
        gap = known[:-2] - matrix[:-2] @ pull
        for _ in range(100):
            pressure, stiffness = self.smooth(gap)
            residual = gap - known[:-2] - matrix[:-2] @ (pressure - pull)
            step = np.linalg.solve(np.eye(gap.size) - matrix[:-2] * stiffness, residual)
            largest = float(np.max(np.abs(step)))
            gap = gap - step * min(1.0, 0.3 * self.reach / max(largest, 1e-300))
            if largest < 1e-13 * self.reach:
                break
        pressure = self.smooth(gap)[0] - pull
        if a > 0.0:
            d = float(self.transform(a)) + 2.0 * float(weights @ pressure)
        else:
            d = float(last + own @ pressure) - self.reach
        load = 2.0 * (a * d - self.transform_integral(a)) + 4.0 * float((weights * tau * np.arctan2(tau, a)) @ pressure)
        centre, rim = known[-2:] + matrix[-2:] @ pressure
        return load, d, float(centre), float(rim) - self.reach

    def touching(self, a: float, bracket: tuple[float, float]) -> tuple[float, float]:
        """Load and displacement with the contact radius a > 0."""
        edge = brentq(lambda edge: self.state(a, edge)[3], *bracket, xtol=1e-13, rtol=1e-13)
        return self.state(a, edge)[:2]

    def apart(self, displacement: float, bracket: tuple[float, float]) -> tuple[float, float]:
        """Load and displacement without contact at a displacement, between two radii of the edge."""
        edge = brentq(lambda edge: self.state(0.0, edge)[1] - displacement, *bracket, xtol=1e-13, rtol=1e-13)
        return self.state(0.0, edge)[:2]


def least(function: Callable[[float], float], low: float, high: float) -> float:
    """The least value of a smooth function with one minimum between two places."""
    found = minimize_scalar(function, bounds=(low, high), method="bounded", options={"xatol": 1e-7 * (high - low)})
    return float(found.fun)
