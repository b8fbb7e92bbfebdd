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
from contbranch.theory._power_law import PowerLaw, with_shape

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


def load(contact_radius: ArrayLike, *, modulus: ArrayLike = 1.0, **shape: ArrayLike) -> Array:
    """Return the load, F = 2 E [a zeta(a) - int_0^a zeta dt].

    It is 4 E a^3 / (3 R) of a parabola, (pi/2) E slope a^2 of a cone (Love, Sneddon), and
    E B(n/2,1/2) n/(n+1) a^(n+1) / L^(n-1) of a power law (Galin, Sneddon).

    Parameters
    ----------
    contact_radius : array_like
        Contact radius a >= 0, in units of length.
    modulus : array_like
        Effective modulus E > 0.
    **shape : array_like
        ``radius``, R > 0 (by default 1) of a parabola; ``slope`` of a cone z = slope * r; or ``exponent`` n >= 1 and
        ``length`` L > 0 (by default 1) of z = r^n / (n L^(n-1)).

    Raises
    ------
    InputError
        If a length is negative or a constant not positive; so for every function here.
    """
    a = not_negative("contact_radius", contact_radius)
    return 2.0 * positive("modulus", modulus) * PowerLaw.of(**shape).deficit(a)


def displacement(contact_radius: ArrayLike, **shape: ArrayLike) -> Array:
    """Return the displacement, d = zeta(a): a^2 / R of a parabola, (pi/2) slope a of a cone, and B(n/2,1/2) a^n / (2
    L^(n-1)) of a power law; the shape as in `load`.
    """
    return PowerLaw.of(**shape).transform(not_negative("contact_radius", contact_radius))


def contact_radius(load: ArrayLike, *, modulus: ArrayLike = 1.0, **shape: ArrayLike) -> Array:
    """Return the contact radius under a load F >= 0, the inverse of `load`: a^3 = 3 R F / (4 E) of a parabola."""
    tip = PowerLaw.of(**shape)
    n = tip.exponent
    force = not_below("load", load, 0.0, "without adhesion a contact only bears pressing loads")
    return (force / positive("modulus", modulus) * (n + 1.0) / (2.0 * n * tip.strength)) ** (1.0 / (n + 1.0))


def contact_radius_at_displacement(displacement: ArrayLike, **shape: ArrayLike) -> Array:
    """Return the contact radius at a displacement d >= 0, the inverse of `displacement`: sqrt(R d) of a parabola."""
    tip = PowerLaw.of(**shape)
    d = not_below("displacement", displacement, 0.0, "a contact without adhesion starts at 0")
    return (d / tip.strength) ** (1.0 / tip.exponent)


def pressure(r: ArrayLike, contact_radius: ArrayLike, *, modulus: ArrayLike = 1.0, **shape: ArrayLike) -> Array:
    """Return the pressure, p = (E/pi) int_r^a zeta'(t)/sqrt(t^2-r^2) dt for r < a, 0 outside; the shape as in `load`.

    It is 2 E sqrt(a^2-r^2) / (pi R) under a parabola and (E slope / 2) arcosh(a/r) under a cone. The integral is
    n zeta(a)/a y 2F1(1, 1-n/2; 3/2; y^2) with y = sqrt(1-r^2/a^2); infinite on the axis for exponent 1.
    """
    a = not_negative("contact_radius", contact_radius)
    return positive("modulus", modulus) * PowerLaw.of(**shape).stress(not_negative("r", r), a)


def gap(r: ArrayLike, contact_radius: ArrayLike, *, radius: ArrayLike = 1.0) -> Array:
    """Return the gap outside a parabola, g = (2/pi) [(r^2/2 - a^2) arccos(a/r) + (a/2) sqrt(r^2-a^2)] / R, 0 inside."""
    a = not_negative("contact_radius", contact_radius)
    distance = not_negative("r", r)
    rho = np.sqrt(np.maximum((distance - a) * (distance + a), 0.0))
    bracket = (0.5 * distance**2 - a**2) * np.arctan2(rho, a) + 0.5 * a * rho
    return np.where(rho > 0.0, 2.0 / np.pi * bracket / positive("radius", radius), 0.0)


# The same for a cone and for other powers, where no parabola is meant.
cone_load, cone_displacement = with_shape(load, slope=1.0), with_shape(displacement, slope=1.0)
cone_pressure = with_shape(pressure, slope=1.0)
power_law_load, power_law_displacement = with_shape(load, length=1.0), with_shape(displacement, length=1.0)
power_law_contact_radius, power_law_pressure = with_shape(contact_radius, length=1.0), with_shape(pressure, length=1.0)
