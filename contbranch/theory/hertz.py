"""Contact without adhesion: Hertz (parabola), Love and Sneddon (cone), Galin and Sneddon (power law).

All follow from the Abel transform zeta of the tip: d = zeta(a), F = 2 E [a zeta(a) - int_0^a zeta dt] and
p(r) = (E/pi) int_r^a zeta'(t)/sqrt(t^2-r^2) dt, with the effective modulus E.

I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.theory._inputs import not_below, not_negative, positive
from contbranch.theory._power_law import PowerLaw

__all__ = [
    "cone_displacement",
    "cone_load",
    "cone_pressure",
    "contact_radius",
    "contact_radius_at_displacement",
    "displacement",
    "gap",
    "load",
    "power_law_contact_radius",
    "power_law_displacement",
    "power_law_load",
    "power_law_pressure",
    "pressure",
]

_PRESSES = "without adhesion a contact only bears pressing loads"


def load(contact_radius: ArrayLike, *, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0) -> Array:
    """Return the load on a parabola, F = 4 E a^3 / (3 R).

    Parameters
    ----------
    contact_radius : array_like
        Contact radius a >= 0, in units of length.
    radius, modulus : array_like
        Radius of curvature R and effective modulus E, both > 0.

    Raises
    ------
    InputError
        If a length is negative or a constant not positive; so for every function here.
    """
    a = not_negative("contact_radius", contact_radius)
    return 4.0 / 3.0 * positive("modulus", modulus) / positive("radius", radius) * a**3


def displacement(contact_radius: ArrayLike, *, radius: ArrayLike = 1.0) -> Array:
    """Return the displacement of a parabola, d = a^2 / R; parameters as in `load`."""
    return not_negative("contact_radius", contact_radius) ** 2 / positive("radius", radius)


def contact_radius(load: ArrayLike, *, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0) -> Array:
    """Return the contact radius under a load F >= 0 on a parabola, a^3 = 3 R F / (4 E)."""
    force = not_below("load", load, 0.0, _PRESSES)
    return np.cbrt(0.75 * positive("radius", radius) * force / positive("modulus", modulus))


def contact_radius_at_displacement(displacement: ArrayLike, *, radius: ArrayLike = 1.0) -> Array:
    """Return the contact radius at a displacement d >= 0 of a parabola, a = sqrt(R d)."""
    d = not_below("displacement", displacement, 0.0, "a contact without adhesion starts at 0")
    return np.sqrt(positive("radius", radius) * d)


def pressure(r: ArrayLike, contact_radius: ArrayLike, *, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0) -> Array:
    """Return the pressure under a parabola, p = 2 E sqrt(a^2-r^2) / (pi R) for r < a and 0 outside."""
    a = not_negative("contact_radius", contact_radius)
    return positive("modulus", modulus) * PowerLaw.parabola(radius).stress(not_negative("r", r), a)


def gap(r: ArrayLike, contact_radius: ArrayLike, *, radius: ArrayLike = 1.0) -> Array:
    """Return the gap outside a parabola, g = (2/pi) [(r^2/2 - a^2) arccos(a/r) + (a/2) sqrt(r^2-a^2)] / R, 0 inside."""
    a = not_negative("contact_radius", contact_radius)
    distance = not_negative("r", r)
    rho = np.sqrt(np.maximum((distance - a) * (distance + a), 0.0))
    bracket = (0.5 * distance**2 - a**2) * np.arctan2(rho, a) + 0.5 * a * rho
    return np.where(rho > 0.0, 2.0 / np.pi * bracket / positive("radius", radius), 0.0)


def cone_load(contact_radius: ArrayLike, *, slope: ArrayLike = 1.0, modulus: ArrayLike = 1.0) -> Array:
    """Return the load on a cone z = slope * r, F = (pi/2) E slope a^2 (Love, Sneddon)."""
    a = not_negative("contact_radius", contact_radius)
    return 2.0 * positive("modulus", modulus) * PowerLaw.cone(slope).deficit(a)


def cone_displacement(contact_radius: ArrayLike, *, slope: ArrayLike = 1.0) -> Array:
    """Return the displacement of a cone z = slope * r, d = (pi/2) slope a."""
    return PowerLaw.cone(slope).transform(not_negative("contact_radius", contact_radius))


def cone_pressure(
    r: ArrayLike, contact_radius: ArrayLike, *, slope: ArrayLike = 1.0, modulus: ArrayLike = 1.0
) -> Array:
    """Return the pressure under a cone, p = (E slope / 2) arcosh(a/r) for r < a and 0 outside; r > 0, as it diverges
    on the axis.
    """
    a = not_negative("contact_radius", contact_radius)
    ratio = np.maximum(a / positive("r", r), 1.0)
    return 0.5 * positive("modulus", modulus) * positive("slope", slope) * np.arccosh(ratio)


def power_law_load(
    contact_radius: ArrayLike, *, exponent: ArrayLike, length: ArrayLike = 1.0, modulus: ArrayLike = 1.0
) -> Array:
    """Return the load on a tip z = r^n / (n L^(n-1)), F = E B(n/2,1/2) n/(n+1) a^(n+1) / L^(n-1) (Galin, Sneddon).

    Parameters
    ----------
    contact_radius : array_like
        Contact radius a >= 0, in units of length.
    exponent : array_like
        Exponent n >= 1; 1 is a cone of slope 1, 2 a parabola of radius L.
    length, modulus : array_like
        Length L of the tip and effective modulus E, both > 0.
    """
    a = not_negative("contact_radius", contact_radius)
    return 2.0 * positive("modulus", modulus) * PowerLaw.of(exponent, length).deficit(a)


def power_law_displacement(contact_radius: ArrayLike, *, exponent: ArrayLike, length: ArrayLike = 1.0) -> Array:
    """Return the displacement of a power-law tip, d = B(n/2,1/2) a^n / (2 L^(n-1)); parameters as in
    `power_law_load`.
    """
    return PowerLaw.of(exponent, length).transform(not_negative("contact_radius", contact_radius))


def power_law_contact_radius(
    load: ArrayLike, *, exponent: ArrayLike, length: ArrayLike = 1.0, modulus: ArrayLike = 1.0
) -> Array:
    """Return the contact radius of a power-law tip under a load F >= 0, the inverse of `power_law_load`."""
    tip = PowerLaw.of(exponent, length)
    n = tip.exponent
    force = not_below("load", load, 0.0, _PRESSES) / positive("modulus", modulus)
    return (force * (n + 1.0) / (2.0 * n * tip.strength)) ** (1.0 / (n + 1.0))


def power_law_pressure(
    r: ArrayLike, contact_radius: ArrayLike, *, exponent: ArrayLike, length: ArrayLike = 1.0, modulus: ArrayLike = 1.0
) -> Array:
    """Return the pressure under a power-law tip, p = (E/pi) int_r^a zeta'(t)/sqrt(t^2-r^2) dt, 0 outside.

    The integral is n zeta(a)/a y 2F1(1, 1-n/2; 3/2; y^2) with y = sqrt(1-r^2/a^2); infinite on the axis for exponent 1.
    """
    a = not_negative("contact_radius", contact_radius)
    stress = PowerLaw.of(exponent, length).stress(not_negative("r", r), a)
    return positive("modulus", modulus) * stress
