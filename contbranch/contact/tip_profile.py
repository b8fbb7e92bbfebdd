"""A tip given by a table of heights."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import ClassVar, Literal

import numpy as np
import scipy
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.tables import columns, increasing_from_zero, pieces_scaled, scattered, smoothed, with_fields
from contbranch.contact.tip_shape import Tip, gauss_rule
from contbranch.errors import InputError

End = Literal["not-a-knot", "clamped", "natural"]

_MOST_ROWS = 1000  # the fit solves a dense system of that order
# The table's length in units of ρ where heights that scatter are smoothed.
_BEND = 4.0
_QUARTER = 0.5 * math.pi
_DEGREE = 18  # of a polynomial for a power series that converges up to 1, on half of that
_MIDDLE = 1e-8  # the middle of a contact, in units of its radius
_FAR = 3.0  # beyond this multiple of the table's last radius


def _smoothed(radii: Array, heights: Array, power: float) -> tuple[Array, str]:
    """Return heights without their scatter, be it that of heights or of their logarithms, and that in words.

    What is smoothed is ln z/r^n as a function of ln(1 + (r/ρ)^n): constant around the apex, and nearly straight where
    the tip is another power of r farther out.
    """
    places, logarithms = radii[1:], np.log(heights[1:] / radii[1:] ** power)
    (own, uneven), (relative, other) = scattered(radii, heights), scattered(places, logarithms)
    if not (own or relative):
        return heights, ""
    told, scatter = f"{own:.2g}", own / heights[1:]
    if not own or (relative and other < uneven):
        told, scatter = f"{relative:.2g} of themselves", np.full_like(places, relative)
    x = np.log1p((_BEND * places / places[-1]) ** power)
    heights = np.append(0.0, places**power * np.exp(smoothed(x, logarithms, scatter, 3)(x)))
    return heights, f"the table of heights scatters by {told} and is smoothed"


def _fit(radii: Array, heights: Array, sharp: bool, end: End) -> scipy.interpolate.PPoly:
    """Return the spline ζ whose tip has the `heights`: they are linear in its values at the radii."""
    start: End = "not-a-knot" if sharp else "clamped"
    bases = scipy.interpolate.CubicSpline(radii, np.eye(radii.size), bc_type=(start, end))
    matrix = sum(_cell_moments(radii, power) @ bases.c[3 - power] for power in (1, 2, 3))
    values = np.zeros_like(radii)
    values[1:] = np.linalg.solve((2.0 / math.pi) * np.asarray(matrix)[:, 1:], heights[1:])
    coefficients = scipy.interpolate.CubicSpline(radii, values, bc_type=(start, end)).c
    if not sharp:
        coefficients[2, 0] = 0.0  # the slope at the apex, which rounding could make negative
    return scipy.interpolate.PPoly(coefficients, radii)


def _cell_moments(radii: Array, power: int) -> Array:
    """Return ∫ d(s^power)/ds arccos(t/r) dt, (n-1, n-1), over the cells (s = t - their start) for all radii r > 0."""
    x, w = gauss_rule(14)
    moments = np.zeros((radii.size - 1, radii.size - 1))
    widths = np.diff(radii)
    for row, r in enumerate(radii[1:]):
        width = widths[:row, None]
        angle = np.arccos((radii[:row, None] + width * x) / r)
        moments[row, :row] = (angle * x ** (power - 1)) @ w * (power * widths[:row] ** power)
        # the cell that ends at r: with t = r - width v² the arccosine, 2 arcsin √((r-t)/2r), is smooth in v
        angle = 2.0 * np.arcsin(x * math.sqrt(0.5 * widths[row] / r))
        moments[row, row] = (angle * (1.0 - x * x) ** (power - 1) * 2.0 * x) @ w * (power * widths[row] ** power)
    return moments


def _third_derivatives(pieces: scipy.interpolate.PPoly) -> Array:
    """Return the third derivative of each piece of a spline from the second ones at the knots.

    So they agree to rounding with a second derivative that is continuous; those of the pieces themselves do not, and
    the difference grows with the cube of the distance from the knot.
    """
    return np.diff(pieces(pieces.x, 2)) / np.diff(pieces.x)


def _continued(pieces: scipy.interpolate.PPoly) -> scipy.interpolate.PPoly:
    """Return the pieces with a last one of second degree that goes on with value, slope and curvature but rounding."""
    end = float(pieces.x[-1])
    level, slope, bend = (float(pieces(end, order)) for order in range(3))
    last = np.array([[0.0], [0.5 * bend * (bend * end > 1e-12 * slope)], [slope], [level]])
    return scipy.interpolate.PPoly(np.concatenate([pieces.c, last], axis=1), np.append(pieces.x, 2.0 * end))


def _kernels(x: Array, least: int = 1) -> Array:
    """Return K_m(θ) = ∫_0^θ (cos φ - cos θ)^m dφ, Legendre functions of cos θ (Mehler, Dirichlet), m = `least` … 3.

    With x = sin²(θ/2) in [0, 1/2] it is √(π/2) m!/Γ(m + 3/2) (2x)^(m+1/2) ₂F₁(1/2, 1/2; m + 3/2; x).
    """
    double = 2.0 * x
    found = np.polynomial.polynomial.polyval(2.0 * double - 1.0, _kernel_series()[:, least - 1 :])
    factor = np.sqrt(double) * double ** (least - 1)
    for k in range(len(found)):  # by place: of a single angle found[k] is a number
        factor = factor * double
        found[k] *= factor
    return np.asarray(found)


@cache
def _kernel_series() -> Array:
    """Return the polynomials of 4x − 1 that are all of them but their powers of 2x, (degree + 1, 3)."""
    nodes, m = chebyshev.chebpts1(_DEGREE + 1), np.array([1, 2, 3])
    values = scipy.special.hyp2f1(0.5, 0.5, m + 1.5, 0.25 * (nodes[:, None] + 1.0))
    scale = math.sqrt(0.5 * math.pi) * scipy.special.factorial(m) / scipy.special.gamma(m + 1.5)
    return np.stack([chebyshev.cheb2poly(own) for own in (scale * chebyshev.chebfit(nodes, values, _DEGREE)).T], axis=1)


@dataclass(frozen=True)
class Profile(Tip):
    """A tip given by a table of heights, joined so that its Abel transform is a cubic spline.

    Attributes
    ----------
    radii
        (n,) 4 ≤ n ≤ 1000, increasing from 0, lengths.
    heights
        (n,) increasing from 0.
    apex
        ``"smooth"``: horizontal at r = 0; ``"sharp"``: its slope there follows from the table.

    Notes
    -----
    ζ is the cubic spline with knots at the radii whose tip has exactly the heights given; heights that scatter are
    smoothed as far as their scatter goes. Beyond the last radius ζ goes on with its last curvature (as for a
    parabola), or straight (as for a cone) where that would be negative; results say from which load on it matters.
    """

    name = "profile"
    closed = True
    dimensions: ClassVar[Mapping[str, str]] = {"radii": "length", "heights": "length", "apex": "text"}

    radii: tuple[float, ...]
    heights: tuple[float, ...]
    apex: str = "smooth"
    _spline: scipy.interpolate.PPoly = field(init=False, repr=False, compare=False)
    _told: str = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.apex not in ("smooth", "sharp"):
            raise InputError(f"apex: {self.apex!r}; must be 'smooth' or 'sharp'")
        radii, heights = columns(self, "radii", "heights")
        increasing_from_zero(heights, "heights")
        if radii.size > _MOST_ROWS:
            raise InputError(f"radii: {radii.size} entries; must be at most {_MOST_ROWS}: thin out the table")
        sharp = self.apex == "sharp"
        heights, told = _smoothed(radii, heights, self.apex_exponent)
        object.__setattr__(self, "_told", told)
        pieces = _fit(radii, heights, sharp, "not-a-knot")
        if pieces(radii[-1], 2) < 0.0:  # would bend down beyond the table: let it end straight
            pieces = _fit(radii, heights, sharp, "natural")
        object.__setattr__(self, "_spline", _continued(pieces))

    @cached_property
    def _integrals(self) -> tuple[scipy.interpolate.PPoly, scipy.interpolate.PPoly]:
        """∫ζ and ∫ζ²."""
        squares = np.array([np.convolve(piece, piece) for piece in self._spline.c.T]).T
        return self._spline.antiderivative(), scipy.interpolate.PPoly(squares, self._spline.x).antiderivative()

    @cached_property
    def _jumps(self) -> Array:
        """(n-1,) the jumps J of ζ's third derivative at all radii b > 0: a cubic J (t-b)³/6 is added there."""
        return np.diff(_third_derivatives(self._spline))

    @property
    def limitation(self) -> str:
        """By how much the heights scatter."""
        return self._told

    @property
    def table_end(self) -> float:
        """The last radius of the table."""
        return self.radii[-1]

    @property
    def apex_exponent(self) -> float:
        """2 for a smooth apex, 1 for a sharp one."""
        return 1.0 if self.apex == "sharp" else 2.0

    @property
    def natural_length(self) -> float:
        """The radius of curvature at a smooth apex, r²/(2z) of the last entry for a sharp or flat one."""
        apex = 0.0 if self.apex == "sharp" else float(self._spline(0.0, 2)) / 2.0
        outer = self.radii[-1] ** 2 / (2.0 * self.heights[-1])
        return 1.0 / apex if apex * outer > 0.01 else outer

    def height(self, r: ArrayLike) -> Array:
        """Return the profile: the table's heights at its radii."""
        return self.shape_gap(r, 0.0)[0]

    def height_derivative(self, r: ArrayLike) -> Array:
        """Return z'(r) = (2/π) ∫_0^r ζ' t/√(r²-t²) dt/r."""
        r = np.asarray(r, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (2.0 / math.pi) * self._moments(r, 0.0)[1] / r
        return np.where(r > 0.0, slope, (2.0 / math.pi) * self.transform_derivative(0.0))

    def transform(self, t: ArrayLike) -> Array:
        """Return the spline ζ(t)."""
        return _at(self._spline, t)

    def transform_derivative(self, t: ArrayLike) -> Array:
        """Return ζ'(t)."""
        return _at(self._spline, t, 1)

    def _integral(self, a: ArrayLike, power: int) -> Array:
        """Return the integral of the spline or its square."""
        return _at(self._integrals[power - 1], a)

    def contact_pressure(self, r: ArrayLike, a: float) -> Array:
        """Return the pressure in a contact of radius `a` without interaction, piece by piece in closed form."""
        r = np.asarray(r, dtype=float)
        if self.apex == "sharp":
            known = np.where(r > 0.0, r, a)
        else:
            known = np.maximum(r, _MIDDLE * a)
        knots = self._spline.x[:-1]
        cubic, square, linear = 3.0 * self._spline.c[0], 2.0 * self._spline.c[1], self._spline.c[2]
        ends = np.append(knots, np.inf)
        t = np.clip(ends, known[..., None], a)
        root = np.sqrt((t - known[..., None]) * (t + known[..., None]))
        angle = np.arcsinh(root / known[..., None])
        parts = angle, root, 0.5 * (t * root + known[..., None] ** 2 * angle)
        slopes = linear - square * knots + cubic * knots**2, square - 2.0 * cubic * knots, cubic
        found = sum(np.diff(part) @ slope for part, slope in zip(parts, slopes, strict=True))
        return np.where((r == 0.0) & (self.apex == "sharp"), math.inf, found / math.pi)

    def shape_gap(self, rho: ArrayLike, a: float) -> tuple[Array, Array]:
        """Return g = (2/π) ∫_a^r (ζ(t) - ζ(a))/√(r²-t²) dt and its derivative with respect to `a` at fixed ρ."""
        gap, moment, r2, angle = self._moments(np.asarray(rho, dtype=float), a)
        ratio = np.divide(a, r2, out=np.zeros_like(r2), where=r2 > 0.0)
        slope = ratio * moment - self._taylor(a)[1] * angle
        return (2.0 / math.pi) * gap, (2.0 / math.pi) * slope

    def _moments(self, rho: Array, a: float) -> tuple[Array, Array, Array, Array]:
        """Return ∫_a^r (ζ - ζ(a))/√(r²-t²) dt, ∫_a^r ζ' t/√(r²-t²) dt, r² and arccos(a/r).

        With I_m(b) = ∫_b^r (t-b)^m/√(r²-t²) dt = r^m K_m(arccos(b/r)), the cubic at `a` and every knot b between `a`
        and r add their multiples of the I_m; far beyond the table, where they would cancel, the root is smooth in it.
        """
        r2 = rho * rho + a * a
        r, end = np.sqrt(r2), float(self._spline.x[-2])
        angle = np.where(r2 > 0.0, np.arctan2(rho, a), _QUARTER)
        gap, moment = self._piece(r, a, angle)
        outside = self._spline.x[1:-1] > a
        knots, jumps = self._spline.x[1:-1][outside], self._jumps[outside] / 6.0
        far = np.asarray(r > (_FAR * end if a < end else math.inf))
        passed = (r[..., None] > knots) & ~far[..., None]
        with np.errstate(divide="ignore"):
            x = 0.5 * (1.0 - (knots / r[..., None])[passed])
        second, third = np.zeros((2, *passed.shape))
        second[passed], third[passed] = _kernels(x, 2)
        cubes = (r2 * r) * (third @ jumps)
        gap = np.asarray(gap + cubes)
        moment = np.asarray(moment + 3.0 * (cubes + r2 * (second @ (jumps * knots))))
        if far.any():
            x, w = gauss_rule()
            begins = np.append(a, knots[:-1])[:, None]
            t, weights = (begins + (knots[:, None] - begins) * x).ravel(), ((knots[:, None] - begins) * w).ravel()
            root, beyond = 1.0 / np.sqrt(r2[far, None] - t * t), np.arccos(end / r[far])
            rise, level = self.transform(t), float(self._spline(a))
            own, own_moment = self._piece(r[far], end, beyond)
            gap[far] = own + (float(self._spline(end)) - level) * beyond + root @ ((rise - level) * weights)
            moment[far] = own_moment + root @ (self.transform_derivative(t) * t * weights)
        return gap, moment, r2, angle

    def _piece(self, r: Array, b: float, angle: Array) -> tuple[Array, Array]:
        """Return the integrals of `_moments` from b to r = b/cos(angle) of the polynomial that the spline is at b."""
        c = self._taylor(b)
        x = np.sin(0.5 * angle) ** 2
        first, second, third = np.multiply.accumulate([r, r, r], axis=0) * _kernels(x)
        moment = c[1] * (first + b * angle) + 2.0 * c[2] * (second + b * first) + 3.0 * c[3] * (third + b * second)
        return c[1] * first + c[2] * second + c[3] * third, moment

    def _taylor(self, b: float) -> tuple[float, float, float, float]:
        """Return the coefficients, from the lowest on, of the polynomial of t − b that the spline is at b."""
        cells, knots = self._spline.c, self._spline.x
        k = min(max(int(knots.searchsorted(b, side="right")) - 1, 0), len(knots) - 2)
        (p, q, s, z), away = cells[:, k].tolist(), b - float(knots[k])
        return z + away * (s + away * (q + away * p)), s + away * (2 * q + 3 * away * p), q + 3 * away * p, p

    def scaled(self, in_plane: float, normal: float) -> Profile:
        """Return the table in other units, with its spline, which takes long to make."""
        return with_fields(
            self,
            radii=tuple(r / in_plane for r in self.radii),
            heights=tuple(z / normal for z in self.heights),
            _spline=pieces_scaled(self._spline, in_plane, normal),
        )


def _at(pieces: scipy.interpolate.PPoly, places: ArrayLike, order: int = 0) -> Array:
    return pieces(np.asarray(places, dtype=float), order)
