"""Explicit approximations to the Maugis-Dugdale contact: Carpick, Ogletree and Salmeron, its modified form, and fits
at zero load.

Equations (47)-(49) and (50)-(53) of the paper; "COS (10), (12)" are those of R. W. Carpick, D. F. Ogletree and M.
Salmeron, J. Colloid Interface Sci. 211, 395 (1999).

The zero-load fits and COS' own parameters are functions of Maugis' lambda = mu_T (9/(2 pi))^(1/3) (43) and give
Maugis' units, in which lengths are in (3 pi w R^2 / (4 E))^(1/3), displacements in that squared over R, and loads in
pi w R (44)-(46).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.theory._inputs import finite, not_below, positive

__all__ = [
    "ASYMPTOTIC_DISPLACEMENT_C5",
    "ASYMPTOTIC_DISPLACEMENT_C6",
    "ASYMPTOTIC_RADIUS_C1",
    "DISPLACEMENT_CONSTANTS",
    "RADIUS_CONSTANTS",
    "alpha",
    "contact_radius",
    "empirical_zero_load_radius",
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
    return np.asarray(positive("zero_load_radius", zero_load_radius) * np.cbrt(((mix + root) / (1.0 + mix)) ** 2))


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
    a = not_below("pull_off_radius", pull_off_radius, 0.0, "it is a length")
    stiffness = 4.0 / 3.0 * positive("modulus", modulus) / positive("radius", radius)
    return np.asarray(positive("pull_off_load", pull_off_load) + stiffness * a**3)


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
    return np.asarray(np.cbrt(0.75 * positive("radius", radius) / positive("modulus", modulus) * bracket))


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
    return np.asarray((stiffness * positive("zero_load_radius", zero_load_radius) ** 3 - offset) / np.sqrt(peak))


def alpha(maugis_lambda: ArrayLike) -> Array:
    """Return the transition parameter for Maugis' lambda, alpha = [1 - exp(-lambda/0.924)] / 1.02, COS (10)."""
    return np.asarray(-np.expm1(-positive("maugis_lambda", maugis_lambda) / 0.924) / 1.02)


def pull_off(maugis_lambda: ArrayLike) -> Array:
    """Return the magnitude of the pull-off load in units of pi w R, COS (12a): 7/4 - (4.04 x - 1)/(4 (4.04 x + 1)), x
    = lambda^1.4.
    """
    x = 4.04 * positive("maugis_lambda", maugis_lambda) ** 1.4
    return np.asarray(1.75 - 0.25 * (x - 1.0) / (x + 1.0))


def empirical_zero_load_radius(maugis_lambda: ArrayLike) -> Array:
    """Return COS' contact radius at zero load in Maugis' units, COS (12b): 1.54 + 0.279 (2.28 x - 1)/(2.28 x + 1), x
    = lambda^1.3.
    """
    x = 2.28 * positive("maugis_lambda", maugis_lambda) ** 1.3
    return np.asarray(1.54 + 0.279 * (x - 1.0) / (x + 1.0))


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


def _constants(constants: tuple[float, ...], count: int) -> tuple[float, ...]:
    values = finite("constants", constants)
    if values.shape != (count,):
        raise InputError(f"constants must be {count} numbers, not {constants!r}")
    return tuple(float(value) for value in values)
