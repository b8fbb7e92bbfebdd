"""Maugis-Dugdale contact of a parabola: constant attraction up to the range z0, exact with and without contact.

Equations (33)-(42) of the paper with the prefactor 4/3 restored in (35), and the solution without contact. For R = E
= 1, sigma = w/z0 and the rim c of the interaction::

    contact:     d = a^2 - 2 sigma sqrt(c^2-a^2),   F = 4 [(d a - a^3/3)/2 - sigma int_a^c sqrt(c^2-t^2) dt],
                 z0 = (2/pi) [int_a^c (t^2-d)/sqrt(c^2-t^2) dt - 2 sigma (c-a)]
    no contact:  d = c^2/2 - z0 - (4/pi) sigma c,   F = -pi sigma c^2,   g(0) = -d - 2 sigma c

Repulsion (w < 0) is refused: the jump of pressure at c would give the gap an infinite slope of the wrong sign there,
so the gap would fall below z0 outside c; the true solution has a ring of constant gap z0 that this closed form does
not contain.

D. Maugis, J. Colloid Interface Sci. 150, 243 (1992).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.theory._dugdale import Angle, Zone, opening_of_contact, opening_of_zone
from contbranch.theory._inputs import finite, not_negative

__all__ = [
    "CRITICAL_TABOR",
    "AuxiliaryFunctions",
    "Curve",
    "auxiliary_functions",
    "contact",
    "displacement_fold",
    "first_touch",
    "gap",
    "load_fold",
    "pressure",
    "separated",
    "zero_load",
]

CRITICAL_TABOR = float(np.cbrt(np.pi / (8.0 * (1.0 - 1.0 / np.pi))))
"""Tabor coefficient below which the fold under displacement control has no contact, [pi/(8(1-1/pi))]^(1/3) =
0.832065719951667.
"""


class Curve(NamedTuple):
    """Equilibria of the Maugis-Dugdale contact, as arrays of one shape.

    Attributes
    ----------
    load, displacement : array
        Load (> 0 presses) and displacement of the far field (> 0 is indentation).
    contact_radius, interaction_radius : array
        Radius of the contact (0 without) and of the zone in which the gap is below the range of the attraction.
    rim_angle : array
        arccos(contact_radius / interaction_radius), in radians: c - a = 2 c sin^2(rim_angle/2) keeps its digits where
        a and c agree in most of theirs.
    central_gap : array
        Gap on the axis, 0 in contact.
    energy : array
        Elastic energy plus energy of the interaction, which is -work_of_adhesion per area inside the contact.
    """

    load: Array
    displacement: Array
    contact_radius: Array
    interaction_radius: Array
    rim_angle: Array
    central_gap: Array
    energy: Array


class AuxiliaryFunctions(NamedTuple):
    """Maugis' functions of m = c/a, (36), (38), (40) and (42)."""

    f: Array
    g: Array
    h: Array
    j: Array


def auxiliary_functions(m: ArrayLike) -> AuxiliaryFunctions:
    """Return f, g, h and j of (36)-(42) for m = c/a > 1, without cancellation for m -> 1.

    The limits are those printed, except (37): f -> (pi/2)(m^2 - 2) for m -> infinity.

    Raises
    ------
    InputError
        If m is not greater than 1.
    """
    ratio = finite("m", m)
    if np.any(ratio <= 1.0):
        raise InputError(f"m = c/a must be greater than 1, not {ratio[ratio <= 1.0].flat[0]}")
    j = np.sqrt((ratio - 1.0) * (ratio + 1.0))
    angle = Angle.from_tangent(np.asarray(j))
    h = j + ratio**2 * angle.theta
    return AuxiliaryFunctions(
        2.0 * ratio**2 * opening_of_contact(angle), ratio * opening_of_zone(angle), h, np.asarray(j)
    )


def contact(
    contact_radius: ArrayLike,
    *,
    radius: ArrayLike = 1.0,
    modulus: ArrayLike = 1.0,
    work_of_adhesion: ArrayLike = 1.0,
    interaction_range: ArrayLike = 1.0,
) -> Curve:
    """Return the equilibria with the given contact radii, (33)-(35); radius 0 is first touch.

    Parameters
    ----------
    contact_radius : array_like
        Contact radius a >= 0, in units of length.
    radius, modulus, work_of_adhesion, interaction_range : array_like
        Radius of curvature R, effective modulus E, work of adhesion w > 0 and range z0, all > 0. With the reduced
        default of the first three, interaction_range is the inverse of the Tabor coefficient.

    Raises
    ------
    InputError
        If a constant is not positive (repulsion included) or a contact radius negative.
    """
    zone = _zone(radius=radius, modulus=modulus, work_of_adhesion=work_of_adhesion, interaction_range=interaction_range)
    a = not_negative("contact_radius", contact_radius)
    found = in_contact(zone, zone.tangent_at(a))
    return found._replace(contact_radius=np.asarray(np.broadcast_to(a, np.shape(found.load))))


def separated(
    interaction_radius: ArrayLike,
    **constants: ArrayLike,
) -> Curve:
    """Return the equilibria without contact for the given radii c of the interaction, from 0 (d = -z0) to first touch.

    Parameters
    ----------
    interaction_radius : array_like
        Radius c of the disc where the gap is below the range; between 0 and ``first_touch().interaction_radius``.
    **constants : array_like
        radius, modulus, work_of_adhesion and interaction_range as in `contact`; so for every function here.

    Raises
    ------
    InputError
        If c is negative or the surfaces would touch.
    """
    zone = _zone(**constants)
    c = not_negative("interaction_radius", interaction_radius)
    beyond = c - zone.touch_radius()
    if np.any(beyond > 8.0 * np.finfo(float).eps * c):
        raise InputError(
            f"interaction_radius must be at most that of first touch, {np.min(zone.touch_radius()):.12g}, "
            f"not {np.max(c)}; the surfaces are in contact beyond"
        )
    return without_contact(zone, np.asarray(np.minimum(c, zone.touch_radius())))


def first_touch(
    **constants: ArrayLike,
) -> Curve:
    """Return the equilibrium in which the central gap just closes; parameters as in `contact`."""
    zone = _zone(**constants)
    touch = without_contact(zone, zone.touch_radius())
    return touch._replace(central_gap=np.zeros_like(touch.load))


def zero_load(
    **constants: ArrayLike,
) -> Curve:
    """Return the contact without load, (50)-(51) in its limits; parameters as in `contact`."""
    zone = _zone(**constants)
    low, _ = zone.tangent_range()
    tau = zone.root(lambda angle: -zone.load(angle, zone.interaction_radius(angle)), low, load_fold_tangent(zone))
    found = in_contact(zone, tau)
    return found._replace(load=np.zeros_like(found.load))


def load_fold(
    **constants: ArrayLike,
) -> Curve:
    """Return the pull-off under load control, dF = 0, which always lies in contact; parameters as in `contact`."""
    zone = _zone(**constants)
    return in_contact(zone, load_fold_tangent(zone))


def displacement_fold(
    **constants: ArrayLike,
) -> Curve:
    """Return the pull-off under displacement control, dd = 0; parameters as in `contact`.

    Below `CRITICAL_TABOR` it has no contact and lies at c = (4/pi) sigma R / E.
    """
    zone = _zone(**constants)
    c = 4.0 / np.pi * zone.strain * zone.radius
    apart = c < zone.touch_radius()
    touching = in_contact(zone, displacement_fold_tangent(zone))
    separate = without_contact(zone, np.asarray(np.minimum(c, zone.touch_radius())))
    return Curve(*(np.where(apart, x, y) for x, y in zip(separate, touching, strict=True)))


def gap(
    r: ArrayLike,
    state: Curve,
    **constants: ArrayLike,
) -> Array:
    """Return the gap at the distances r from the axis, for one state or states that broadcast with r.

    Implements g = (2/pi) int_a^r [t^2/R - d - 2 (sigma/E) sqrt(c^2-t^2)] / sqrt(r^2-t^2) dt with the elliptic part in
    Carlson's symmetric integrals, all of whose terms are positive. Constants as in `contact`.
    """
    zone = _zone(**constants)
    r, a, c, s = np.broadcast_arrays(
        not_negative("r", r),
        state.contact_radius,
        state.interaction_radius,
        state.interaction_radius * np.sin(state.rim_angle),
    )
    outside = r > a
    rho = np.sqrt(np.where(outside, (r - a) * (r + a), 1.0))
    safe = np.where(outside, r, np.hypot(a, rho))
    open_angle = np.arctan2(rho, a)
    parabola = safe**2 / zone.radius * opening_of_contact(Angle(open_angle, a / safe, rho / safe))
    lift = np.where(a > 0.0, 2.0 * zone.strain * s, -state.displacement)  # a^2/R - d
    elastic = _zone_integral(safe, rho, a, c, s)
    return np.where(
        outside, 2.0 / np.pi * (parabola + lift * open_angle - 2.0 * zone.strain * elastic), state.central_gap
    )


def pressure(
    r: ArrayLike,
    state: Curve,
    **constants: ArrayLike,
) -> tuple[Array, Array]:
    """Return the total pressure and the wall's share of it at the distances r from the axis.

    Inside the contact the wall bears p_c = (2/pi) [(E/R) y + sigma arctan(y / sqrt(c^2-a^2))] with y = sqrt(a^2-r^2),
    which is never negative; the total is p_c - sigma there, -sigma in the zone and 0 beyond. Constants as in
    `contact`.
    """
    zone = _zone(**constants)
    r = not_negative("r", r)
    a, c = state.contact_radius, state.interaction_radius
    y = np.sqrt(np.maximum((a - r) * (a + r), 0.0))
    wall = 2.0 / np.pi * (zone.modulus / zone.radius * y + zone.stress * np.arctan2(y, c * np.sin(state.rim_angle)))
    wall = np.where(r < a, wall, 0.0)
    return np.asarray(wall - np.where(r < c, zone.stress, 0.0)), np.asarray(wall)


# What follows serves the exact model too.


def in_contact(zone: Zone, tau: Array | float) -> Curve:
    """Return the equilibria with contact whose rim angles have the tangents ``tau``."""
    angle = Angle.from_tangent(tau)
    c = zone.interaction_radius(angle)
    d = zone.displacement(angle, c)
    return Curve(zone.load(angle, c), d, c * angle.cos, c, angle.theta + 0.0 * c, 0.0 * c, zone.energy(angle, c, d))


def without_contact(zone: Zone, c: Array | float) -> Curve:
    """Return the equilibria without contact whose interaction has the radius ``c``."""
    touch = zone.touch_radius()
    # z0 - c^2/(2R) - (2-4/pi)(sigma/E) c in factors: exactly zero at first touch, no cancellation before it
    central_gap = 0.5 * (touch - c) * (c / zone.radius + 2.0 * zone.interaction_range / touch)
    d = -central_gap - 2.0 * zone.strain * c
    right = Angle(0.5 * np.pi + 0.0 * d, 0.0 * d, 1.0 + 0.0 * d)
    load = 0.0 - np.pi * zone.stress * c * c
    return Curve(load, d, 0.0 * d, c + 0.0 * d, right.theta, central_gap, zone.energy(right, c, d))


def load_fold_tangent(zone: Zone) -> Array:
    """Return tan(rim angle) at the load fold; there is exactly one, as dF/dtheta > 0 at first touch and < 0 far into
    contact.
    """
    return zone.root(lambda angle: zone.slopes(angle).load, *zone.tangent_range())


def displacement_fold_tangent(zone: Zone) -> Array:
    """Return tan(rim angle) at the displacement fold in contact, of no meaning where that fold has no contact."""
    return zone.root(lambda angle: zone.slopes(angle).displacement, *zone.tangent_range())


def _zone(
    *,
    radius: ArrayLike = 1.0,
    modulus: ArrayLike = 1.0,
    work_of_adhesion: ArrayLike = 1.0,
    interaction_range: ArrayLike = 1.0,
) -> Zone:
    given = {"radius": radius, "modulus": modulus}
    given |= {"work_of_adhesion": work_of_adhesion, "interaction_range": interaction_range}
    return Zone(*np.broadcast_arrays(*(finite(name, value) for name, value in given.items())))


def _zone_integral(r: Array, rho: Array, a: Array, c: Array, s: Array) -> Array:
    """Return int_a^min(r,c) sqrt(c^2-t^2) / sqrt(r^2-t^2) dt with rho = sqrt(r^2-a^2) and s = sqrt(c^2-a^2)."""
    inside, beyond = rho < s, rho > s
    # c^2-r^2 = s^2-rho^2 keeps its digits where c and r are close to a
    depth = np.where(inside, (s - rho) * (s + rho), 1.0)
    share = np.where(inside, (a / r) ** 2, 1.0)
    within = (rho / r) * (
        depth * scipy.special.elliprf(depth, np.where(inside, s, 1.0) ** 2, share * depth)
        + rho**2 * depth / 3.0 * scipy.special.elliprd(np.where(inside, s, 1.0) ** 2, share * depth, depth)
    )
    past = np.where(beyond & (c > 0.0), (rho - s) * (rho + s), 1.0)
    width = np.where(c > 0.0, c, 1.0)
    outer = (
        s**3
        * past
        / (3.0 * width)
        * scipy.special.elliprd(np.where(beyond, rho, 1.0) ** 2, past * (a / width) ** 2, past)
    )
    middle = 2.0 * width * np.sin(0.5 * np.arctan2(s, a)) ** 2
    return np.where(inside, within, np.where(beyond, outer, middle))
