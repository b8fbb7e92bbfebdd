"""Explicit approximations to the Maugis-Dugdale contact: Carpick, Ogletree and Salmeron, its modified form, and fits
at zero load.

Equations (47)-(49) and (50)-(53) of the paper; "COS (10), (12)" are those of R. W. Carpick, D. F. Ogletree and M.
Salmeron, J. Colloid Interface Sci. 211, 395 (1999).

The zero-load fits and COS' own parameters are functions of Maugis' lambda = mu_T (9/(2 pi))^(1/3) (43) and give
Maugis' units, in which lengths are in (3 pi w R^2 / (4 E))^(1/3), displacements in that squared over R, and loads in
pi w R (44)-(46).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.theory._inputs import finite, not_below, not_negative, positive
from contbranch.theory._roots import rising

__all__ = [
    "ASYMPTOTIC_DISPLACEMENT_C5",
    "ASYMPTOTIC_DISPLACEMENT_C6",
    "ASYMPTOTIC_RADIUS_C1",
    "DISPLACEMENT_CONSTANTS",
    "FORMS",
    "RADIUS_CONSTANTS",
    "Fitted",
    "alpha",
    "contact_radius",
    "empirical_zero_load_radius",
    "fit",
    "modified_alpha",
    "modified_contact_radius",
    "modified_offset",
    "pull_off",
    "zero_load_displacement",
    "zero_load_radius",
]

RADIUS_CONSTANTS = (0.8, -1.285, 0.8, -0.435)
"""c1 to c4 of (52) as printed; the leading constants are the exact limits, the rest is a fit."""

DISPLACEMENT_CONSTANTS = (-1.5, 0.1845, 6.71)
"""c5 to c7 of (53) as printed."""

ASYMPTOTIC_RADIUS_C1 = np.pi / 3.0
"""Exact first correction for lambda -> 0: radius at zero load 2^(1/3) + (pi/3) lambda + ..."""

ASYMPTOTIC_DISPLACEMENT_C5 = -8.0 / (3.0 * np.sqrt(np.pi))
"""Exact first correction for lambda -> 0: displacement at zero load 4^(1/3) - 8/(3 sqrt(pi)) sqrt(lambda) + ..."""

ASYMPTOTIC_DISPLACEMENT_C6 = np.cbrt(6.0) / 36.0
"""Exact first correction for lambda -> inf: displacement at zero load (4/3)^(1/3) + 6^(1/3)/36 / lambda^2 + ..."""

_NONE = 1e-150  # a radius that is none

FORMS = ("cos", "modified", "free")
"""What `fit` can fit: (47); (48) with (49); and (48) with a free exponent in place of the square root."""


def contact_radius(
    load: ArrayLike, *, zero_load_radius: ArrayLike, pull_off_load: ArrayLike, alpha: ArrayLike
) -> Array:
    """Return the contact radius of the COS equation, a = a0 [(alpha + sqrt(1 + F/F_p)) / (1 + alpha)]^(2/3) (47).

    Parameters
    ----------
    load : array_like
        Load F >= -F_p, in any unit of force.
    zero_load_radius, pull_off_load : array_like
        Radius a0 > 0 without load, in the unit of the result, and the magnitude F_p > 0 of the pull-off load.
    alpha : array_like
        Transition parameter between 0 (DMT) and 1 (JKR).

    Raises
    ------
    InputError
        If a load is below pull-off, or a parameter negative.
    """
    peak = positive("pull_off_load", pull_off_load)
    force = not_below("load", load, -peak, "pull-off; lower loads have no contact")
    mix = not_below("alpha", alpha, 0.0, "0 is DMT, 1 is JKR")
    root = np.sqrt(np.maximum(1.0 + force / peak, 0.0))
    return positive("zero_load_radius", zero_load_radius) * np.cbrt(((mix + root) / (1.0 + mix)) ** 2)


def modified_offset(
    *, pull_off_load: ArrayLike, pull_off_radius: ArrayLike, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0
) -> Array:
    """Return F0 = F_p + 4 E a_p^3 / (3 R) of (49), a_p being the contact radius at pull-off.

    Printed as a_c(0); but only the radius at the load -F_p makes (48) exact there, and gives 3 pi in the JKR limit
    (7.5 pi as printed).

    Parameters
    ----------
    pull_off_load, pull_off_radius : array_like
        Magnitude F_p > 0 of the pull-off load and contact radius a_p >= 0 there.
    radius, modulus : array_like
        Radius of curvature R and effective modulus E, both > 0.
    """
    a = not_negative("pull_off_radius", pull_off_radius)
    stiffness = 4.0 / 3.0 * positive("modulus", modulus) / positive("radius", radius)
    return positive("pull_off_load", pull_off_load) + stiffness * a**3


def modified_contact_radius(
    load: ArrayLike,
    *,
    pull_off_load: ArrayLike,
    pull_off_radius: ArrayLike,
    alpha: ArrayLike,
    radius: ArrayLike = 1.0,
    modulus: ArrayLike = 1.0,
) -> Array:
    """Return the contact radius of the modified COS equation, a^3 = (3R/4E) [F + F0 + alpha sqrt(F + F_p)] (48).

    Parameters
    ----------
    load : array_like
        Load F >= -F_p.
    pull_off_load, pull_off_radius, radius, modulus : array_like
        As in `modified_offset`, which gives F0.
    alpha : array_like
        Free parameter, in square roots of force: 0 for DMT, sqrt(6 pi w R) for JKR; see `modified_alpha`.

    Raises
    ------
    InputError
        If a load is below pull-off, or a parameter out of its range.
    """
    peak = positive("pull_off_load", pull_off_load)
    force = not_below("load", load, -peak, "pull-off; lower loads have no contact")
    offset = modified_offset(pull_off_load=peak, pull_off_radius=pull_off_radius, radius=radius, modulus=modulus)
    bracket = force + offset + finite("alpha", alpha) * np.sqrt(np.maximum(force + peak, 0.0))
    return np.cbrt(0.75 * positive("radius", radius) / positive("modulus", modulus) * bracket)


def modified_alpha(
    *,
    zero_load_radius: ArrayLike,
    pull_off_load: ArrayLike,
    pull_off_radius: ArrayLike,
    radius: ArrayLike = 1.0,
    modulus: ArrayLike = 1.0,
) -> Array:
    """Return the alpha of (48) with which it has the given radius at zero load; the other parameters as in
    `modified_offset`.
    """
    peak = positive("pull_off_load", pull_off_load)
    stiffness = 4.0 / 3.0 * positive("modulus", modulus) / positive("radius", radius)
    offset = modified_offset(pull_off_load=peak, pull_off_radius=pull_off_radius, radius=radius, modulus=modulus)
    return (stiffness * positive("zero_load_radius", zero_load_radius) ** 3 - offset) / np.sqrt(peak)


def alpha(maugis_lambda: ArrayLike) -> Array:
    """Return the transition parameter for Maugis' lambda, alpha = [1 - exp(-lambda/0.924)] / 1.02, COS (10)."""
    return -np.expm1(-positive("maugis_lambda", maugis_lambda) / 0.924) / 1.02


def pull_off(maugis_lambda: ArrayLike) -> Array:
    """Return the magnitude of the pull-off load in units of pi w R, COS (12a): 7/4 - (4.04 x - 1)/(4 (4.04 x + 1)), x
    = lambda^1.4.
    """
    x = 4.04 * positive("maugis_lambda", maugis_lambda) ** 1.4
    return 1.75 - 0.25 * (x - 1.0) / (x + 1.0)


def empirical_zero_load_radius(maugis_lambda: ArrayLike) -> Array:
    """Return COS' contact radius at zero load in Maugis' units, COS (12b): 1.54 + 0.279 (2.28 x - 1)/(2.28 x + 1), x
    = lambda^1.3.
    """
    x = 2.28 * positive("maugis_lambda", maugis_lambda) ** 1.3
    return 1.54 + 0.279 * (x - 1.0) / (x + 1.0)


def zero_load_radius(
    maugis_lambda: ArrayLike, *, constants: tuple[float, float, float, float] = RADIUS_CONSTANTS
) -> Array:
    """Return the contact radius at zero load in Maugis' units, (52); within 0.28 % for lambda from 1e-3 to 1e3.

    Parameters
    ----------
    maugis_lambda : array_like
        Maugis' parameter lambda > 0.
    constants : tuple of float
        c1 to c4, by default those printed.
    """
    x = positive("maugis_lambda", maugis_lambda)
    c1, c2, c3, c4 = _constants(constants, 4)
    # numerator and denominator of (52) times lambda^2, which has no powers that overflow for small lambda
    top = np.cbrt(2.0) + c1 * x + c2 * x**2 + np.cbrt(6.0) * c3 * x**4
    return np.asarray(top / (1.0 + c4 * x**2 + c3 * x**4))


def zero_load_displacement(
    maugis_lambda: ArrayLike, *, constants: tuple[float, float, float] = DISPLACEMENT_CONSTANTS
) -> Array:
    """Return the displacement at zero load in Maugis' units, (53); within 0.30 % for lambda from 1e-3 to 1e3.

    Parameters
    ----------
    maugis_lambda : array_like
        Maugis' parameter lambda > 0.
    constants : tuple of float
        c5 to c7, by default those printed.
    """
    x = positive("maugis_lambda", maugis_lambda)
    c5, c6, c7 = _constants(constants, 3)
    top = np.cbrt(4.0) / x ** (5.0 / 6.0) + c5 / np.cbrt(x) + c7 * (c6 + np.cbrt(4.0 / 3.0) * x**2)
    return np.asarray(top / (x ** (-5.0 / 6.0) + c7 * x**2))


@dataclass(frozen=True)
class Fitted:
    """A contact branch in closed form, as `fit` returns it, in the units of what was fitted.

    With x = F + F_p and K = 4E/(3R) the radius obeys (47), or K (a^3 - a_p^3) = x + alpha x^exponent, and the
    displacement d = a^2/R - sqrt(lift[0] + lift[1] a), which contains JKR (lift[0] = 0) and DMT (both zero). Below
    the pull-off radius x grows again: the branch goes on through the fold of the load, as far as that of the
    displacement.

    Attributes
    ----------
    form : str
        One of `FORMS`.
    pull_off_load, pull_off_radius, zero_load_radius : float
        F_p > 0, a_p and a_0, not fitted but those of the branch.
    alpha, exponent : float
        Fitted; the exponent is 1/2 unless it is free.
    lift : (float, float)
        Fitted to the displacement, NaN where none was given.
    error, displacement_error : float
        Largest relative error of the contact radius and largest error of the displacement over what was fitted.
    radius, modulus : float
        R and E.
    """

    form: str
    pull_off_load: float
    pull_off_radius: float
    zero_load_radius: float
    alpha: float
    exponent: float
    lift: tuple[float, float]
    error: float
    displacement_error: float
    radius: float
    modulus: float

    def contact_radius(self, load: ArrayLike) -> Array:
        """Return the contact radius at loads from pull-off upwards."""
        force = not_below("load", load, -self.pull_off_load, "pull-off; lower loads have no contact")
        return self._radius(np.maximum(force + self.pull_off_load, 0.0))

    def _radius(self, above: Array) -> Array:
        if self.form == "cos":
            root = np.sqrt(above / self.pull_off_load)
            return self.zero_load_radius * np.cbrt(((self.alpha + root) / (1.0 + self.alpha)) ** 2)
        excess = (above + self.alpha * above**self.exponent) * 0.75 * self.radius / self.modulus
        return np.cbrt(self.pull_off_radius**3 + excess)

    def load(self, contact_radius: ArrayLike) -> Array:
        """Return the load at contact radii, also below that of pull-off, where it rises again."""
        a = not_negative("contact_radius", contact_radius)
        if self.form == "cos":
            root = (1.0 + self.alpha) * (a / self.zero_load_radius) ** 1.5 - self.alpha
            return self.pull_off_load * (root**2 - 1.0)
        # s = +-x^exponent, of which |s|^(1/exponent) + alpha s is convex: Newton's method comes from above
        power, alpha = 1.0 / self.exponent, max(self.alpha, 0.0)
        least = (alpha / power) ** (1.0 / (power - 1.0))  # -s where the sum is smallest
        target = (a**3 - self.pull_off_radius**3) * self.modulus / (0.75 * self.radius)
        s = np.maximum(target, 0.0) ** self.exponent
        for _ in range(60):
            rate = power * np.sign(s) * np.abs(s) ** (power - 1.0) + self.alpha
            change = (np.abs(s) ** power + self.alpha * s - target) / np.where(rate > 0.0, rate, np.inf)
            s = np.maximum(s - change, -least)
        return np.abs(s) ** power - self.pull_off_load

    def displacement(self, contact_radius: ArrayLike) -> Array:
        """Return the displacement at contact radii."""
        a = not_negative("contact_radius", contact_radius)
        return a**2 / self.radius - np.sqrt(np.maximum(self.lift[0] + self.lift[1] * a, 0.0))

    @property
    def detachment_radius(self) -> float:
        """Contact radius at which the displacement is least: there, or at a = 0, its control loses the contact."""
        constant, slope = self.lift
        if not slope > 0.0:
            return 0.0
        cubic = np.roots(np.array([16.0 * slope, 16.0 * constant, 0.0, -((slope * self.radius) ** 2)]))
        return float(cubic.real[np.abs(cubic.imag) < 1e-9 * np.abs(cubic)].max(initial=0.0))

    def force(self, displacement: ArrayLike) -> Array:
        """Return F(d) of a tip whose displacement is prescribed and that has not lost contact; 0 where it has."""
        d, least = finite("displacement", displacement), self.detachment_radius
        constant, slope = self.lift
        beyond = np.sqrt(self.radius * (np.maximum(d, 0.0) + np.sqrt(abs(constant)))) + np.cbrt(
            self.radius**2 * abs(slope)
        )
        a = rising(lambda radius: self.displacement(radius) - d, max(least, _NONE), 2.0 * beyond + _NONE)
        return np.where(d < float(self.displacement(least)), 0.0, self.load(a))


def fit(
    load: ArrayLike,
    contact_radius: ArrayLike,
    displacement: ArrayLike | None = None,
    *,
    form: str = "free",
    radius: float = 1.0,
    modulus: float = 1.0,
) -> Fitted:
    """Fit (47), (48) or (48) with a free exponent to the contact branch of any attraction.

    Pull-off and, for (47), the radius at zero load are kept exactly; what is left is fitted by least squares of the
    relative error of the contact radius, with equal weight for every point given.

    Parameters
    ----------
    load, contact_radius : array_like (M,)
        Stable contacts in order of the load, from pull-off itself (the first) to a positive load; M > 3.
    displacement : array_like (M,), optional
        Without it the result has no displacements and no F(d).
    form : str
        One of `FORMS`.
    radius, modulus : float
        Radius of curvature of the parabola and effective modulus.

    Raises
    ------
    InputError
        If the form is unknown, or the arrays are not such a branch.
    """
    if form not in FORMS:
        raise InputError(f"form must be one of {', '.join(FORMS)}, not {form!r}")
    force, a = finite("load", load), positive("contact_radius", contact_radius)
    if force.shape != a.shape or force.ndim != 1 or len(force) < 4 or np.any(np.diff(force) <= 0.0):
        raise InputError("load must be at least four increasing numbers, with as many contact radii")
    if np.any(np.diff(a) <= 0.0) or not force[0] < 0.0 < force[-1]:
        raise InputError("contact_radius must grow with a load that goes from pull-off (< 0) through zero")
    free = float(CubicSpline(a, force).solve(0.0, extrapolate=False)[-1])
    peak, least = -float(force[0]), float(a[0])
    constants = {"zero_load_radius": free, "pull_off_load": peak, "pull_off_radius": least}
    elastic = {"radius": radius, "modulus": modulus}

    def made(parameters: Array) -> Fitted:
        exponent = float(parameters[1]) if form == "free" else 0.5
        head = (form, peak, least, free, float(parameters[0]), exponent)
        return Fitted(*head, (np.nan, np.nan), np.nan, np.nan, radius, modulus)

    def wrong(parameters: Array) -> Array:
        return made(parameters)._radius(force + peak) / a - 1.0

    start = 0.5 if form == "cos" else float(modified_alpha(**constants, **elastic))
    guess = np.array([start, 0.5][: 1 + (form == "free")])
    bare = form == "cos"  # its α has no dimension, and turns at 0, where the radius at pull-off vanishes from the form
    scale = np.array([max(abs(start), 0.1 if bare else 0.1 * np.sqrt(peak)), 0.1][: len(guess)])
    # of an exponent of 1 and more F(a) would not be unique
    bounds = np.array([[0.0 if bare else -np.inf, 0.05], [np.inf, 0.95]])[:, : len(guess)]
    best = made(least_squares(wrong, guess, x_scale=scale, bounds=tuple(bounds), xtol=1e-12, ftol=1e-12).x)
    lift, apart = (np.nan, np.nan), np.nan
    if displacement is not None:
        d = finite("displacement", displacement)
        if d.shape != a.shape:
            raise InputError("displacement must be as many numbers as load")
        slope, constant = np.polyfit(a, (a**2 / radius - d) ** 2, 1)
        lift = (float(constant), float(slope))
        apart = float(np.abs(replace(best, lift=lift).displacement(a) - d).max())
    return replace(
        best, lift=lift, error=float(np.abs(best._radius(force + peak) / a - 1.0).max()), displacement_error=apart
    )


def _constants(constants: tuple[float, ...], count: int) -> tuple[float, ...]:
    values = finite("constants", constants)
    if values.shape != (count,):
        raise InputError(f"constants must be {count} numbers, not {constants!r}")
    return tuple(float(value) for value in values)
