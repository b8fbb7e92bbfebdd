"""Johnson, Kendall and Roberts: adhesion of infinitely short range, for a parabola, a cone and power-law tips.

For any tip with the Abel transform zeta(t), contact of radius a has

    d = zeta(a) - sqrt(2 pi a w / E),      F = 2 E [d a - int_0^a zeta dt],

so dF/da = 2 E [a zeta' - (3/2) sqrt(2 pi a w/E)] and a dd/da = a zeta' - (1/2) sqrt(2 pi a w/E) locate the folds.
Equation (28) of the paper is the parabola, zeta = t^2/R.

K. L. Johnson, K. Kendall and A. D. Roberts, Proc. R. Soc. A 324, 301 (1971).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from contbranch.arrays import Array
from contbranch.contact.tip_shape import Tip
from contbranch.errors import InputError, look_up
from contbranch.theory._inputs import not_below, not_negative, positive
from contbranch.theory._power_law import PowerLaw, with_shape
from contbranch.theory._roots import rising

__all__ = [
    "Fold",
    "cone_displacement",
    "cone_displacement_fold",
    "cone_load",
    "cone_load_fold",
    "contact_radius",
    "contact_radius_at_displacement",
    "curve",
    "displacement",
    "displacement_fold",
    "folds",
    "load",
    "load_fold",
    "power_law_displacement",
    "power_law_displacement_fold",
    "power_law_load",
    "power_law_load_fold",
]


class Fold(NamedTuple):
    """A fold of the curve of equilibria: its load, displacement and contact radius."""

    load: Array
    displacement: Array
    contact_radius: Array


def load(
    contact_radius: ArrayLike, *, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0, **shape: ArrayLike
) -> Array:
    """Return the load, Hertz' load minus sqrt(8 pi w E a^3): 4 E a^3 / (3 R) - sqrt(8 pi w E a^3) of a parabola.

    Parameters
    ----------
    contact_radius : array_like
        Contact radius a >= 0, in units of length.
    modulus, work_of_adhesion : array_like
        Effective modulus E and work of adhesion w, all > 0.
    **shape : array_like
        ``radius``, R > 0 (by default 1) of a parabola; ``slope`` of a cone z = slope * r; or ``exponent`` n >= 1 and
        ``length`` L > 0 (by default 1) of z = r^n / (n L^(n-1)).

    Raises
    ------
    InputError
        If a length is negative or a constant not positive; so for every function here.
    """
    return _state(PowerLaw.of(**shape), contact_radius, modulus, work_of_adhesion).load


def displacement(
    contact_radius: ArrayLike, *, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0, **shape: ArrayLike
) -> Array:
    """Return the displacement, d = zeta(a) - sqrt(2 pi a w / E): a^2 / R less that of a parabola, (pi/2) slope a of a
    cone; parameters as in `load`.
    """
    return _state(PowerLaw.of(**shape), contact_radius, modulus, work_of_adhesion).displacement


def contact_radius(
    load: ArrayLike,
    *,
    radius: ArrayLike = 1.0,
    modulus: ArrayLike = 1.0,
    work_of_adhesion: ArrayLike = 1.0,
    stable: bool = True,
) -> Array:
    """Return the contact radius under a load, a^3 = (3R/4E) [F + 3 pi w R +- sqrt(6 pi w R F + (3 pi w R)^2)] (28).

    Parameters
    ----------
    load : array_like
        Load F >= -(3/2) pi w R; for the unstable part also F <= 0.
    radius, modulus, work_of_adhesion : array_like
        As in `load`.
    stable : bool
        Whether to return the part that is stable under load control (sign +) or the other, which ends at a = 0 for F
        = 0.

    Raises
    ------
    InputError
        If a load is below pull-off, or above 0 on the unstable part.
    """
    rim = positive("radius", radius)
    half = 1.5 * np.pi * positive("work_of_adhesion", work_of_adhesion) * rim
    force = not_below("load", load, -half, "pull-off; lower loads have no contact")
    outer = force + 2.0 * half + 2.0 * np.sqrt(half * np.maximum(force + half, 0.0))
    if not stable:
        not_below("the negative of load", -force, 0.0, "the unstable part ends at load 0")
        outer = force**2 / outer  # the product of both roots is F^2, and this form does not cancel
    return np.cbrt(0.75 * rim / positive("modulus", modulus) * outer)


def contact_radius_at_displacement(
    displacement: ArrayLike, *, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0
) -> Array:
    """Return the contact radius at a displacement, on the part that is stable under displacement control.

    Raises
    ------
    InputError
        If a displacement is below that of the displacement fold.
    """
    fold = displacement_fold(radius=radius, modulus=modulus, work_of_adhesion=work_of_adhesion)
    d = not_below("displacement", displacement, fold.displacement, "pull-off under displacement control")
    tip, rim = PowerLaw.of(radius), positive("radius", radius)
    beyond = 2.0 * np.sqrt(rim * np.abs(d)) + 4.0 * fold.contact_radius  # where the displacement is larger
    constants = {"modulus": modulus, "work_of_adhesion": work_of_adhesion}
    return rising(lambda a: _state(tip, a, **constants).displacement - d, fold.contact_radius, beyond)


def load_fold(*, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0, **shape: ArrayLike) -> Fold:
    """Return the pull-off under load control, n zeta(a) = (3/2) sqrt(2 pi a w / E); parameters as in `load`.

    For a parabola, F = -(3/2) pi w R at a^3 = 9 pi w R^2 / (8 E), d = -a^2 / (3R); for a cone,
    F = -54 w^2 / (pi E slope^3) at a = 18 w / (pi E slope^2), d = 3 w / (E slope).
    """
    return fold(PowerLaw.of(**shape), 1.5, modulus, work_of_adhesion)


def displacement_fold(*, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0, **shape: ArrayLike) -> Fold:
    """Return the pull-off under displacement control, n zeta(a) = (1/2) sqrt(2 pi a w / E); parameters as in `load`.

    For a parabola, F = -(5/6) pi w R at a^3 = pi w R^2 / (8 E), d = -3 a^2 / R; for a cone, d = -w / (E slope) at
    a = 2 w / (pi E slope^2).
    """
    return fold(PowerLaw.of(**shape), 0.5, modulus, work_of_adhesion)


def curve(tip: Tip, radii: ArrayLike, *, modulus: float = 1.0, work_of_adhesion: float = 1.0) -> tuple[Array, Array]:
    """Return load and displacement of any axisymmetric tip, d = zeta(a) - sqrt(2 pi a w/E), F = 2 E [d a - int zeta].

    Parameters
    ----------
    tip : Tip
        Such as ``WavySphere(radius, amplitude, wavelength)``.
    radii : array_like (M,)
        Contact radii a >= 0 within the tip. The contact is a disc: where a wavy tip would touch outside of it, too, the
        curve is that of a contact which has been pressed together before.
    modulus, work_of_adhesion : float
        E and w > 0.

    Returns
    -------
    load, displacement : array (M,)

    Raises
    ------
    InputError
        If the tip is not axisymmetric, a radius negative or a constant not positive.
    """
    if not isinstance(tip, Tip):
        raise InputError(f"tip: {type(tip).__name__}; must be an axisymmetric tip such as Parabola(1.0)")
    a = not_negative("radii", radii)
    e, w = positive("modulus", modulus), positive("work_of_adhesion", work_of_adhesion)
    d = tip.transform(a) - np.sqrt(2.0 * np.pi * a * w / e)
    return np.asarray(2.0 * e * (d * a - tip.transform_integral(a))), np.asarray(d)


def folds(
    tip: Tip, radii: ArrayLike, control: str = "load", *, modulus: float = 1.0, work_of_adhesion: float = 1.0
) -> list[Fold]:
    """Return the extrema of load or displacement of `curve`: a zeta'(a) = share sqrt(2 pi a w/E), share 3/2 or 1/2.

    Parameters
    ----------
    tip, modulus, work_of_adhesion
        As in `curve`.
    radii : array_like (M,)
        Increasing contact radii > 0; an extremum is found where the slope has different signs at neighbouring ones.
    control : {"load", "displacement"}

    Returns
    -------
    list of Fold
        By contact radius.
    """
    share: float = look_up(control, {"load": 1.5, "displacement": 0.5}, "control")
    neck = share * math.sqrt(2.0 * math.pi * work_of_adhesion / modulus)

    def slope(a: float) -> float:
        return math.sqrt(a) * float(tip.transform_derivative(a)) - neck

    places = np.asarray(radii, dtype=float)
    changes = np.flatnonzero(np.diff(np.sign(np.sqrt(places) * tip.transform_derivative(places) - neck)))
    roots = [brentq(slope, float(places[k]), float(places[k + 1]), rtol=1e-14) for k in changes]
    loads, displacements = curve(tip, roots, modulus=modulus, work_of_adhesion=work_of_adhesion)
    return [Fold(*map(np.asarray, one)) for one in zip(loads, displacements, roots, strict=True)]


# The same for a cone and for other powers, where no parabola is meant.
cone_load, cone_displacement = with_shape(load, slope=1.0), with_shape(displacement, slope=1.0)
cone_load_fold, cone_displacement_fold = with_shape(load_fold, slope=1.0), with_shape(displacement_fold, slope=1.0)
power_law_load, power_law_displacement = with_shape(load, length=1.0), with_shape(displacement, length=1.0)
power_law_load_fold = with_shape(load_fold, length=1.0)
power_law_displacement_fold = with_shape(displacement_fold, length=1.0)


def _state(tip: PowerLaw, contact_radius: ArrayLike, modulus: ArrayLike, work_of_adhesion: ArrayLike) -> Fold:
    """The equilibrium with a contact radius: adhesion lowers the displacement at fixed radius by sqrt(2 pi a w / E)."""
    a = not_negative("contact_radius", contact_radius)
    e, w = positive("modulus", modulus), positive("work_of_adhesion", work_of_adhesion)
    neck = np.sqrt(2.0 * np.pi * a * w / e)
    return Fold(2.0 * e * (tip.deficit(a) - a * neck), tip.transform(a) - neck, a)


def fold(tip: PowerLaw, share: float, modulus: ArrayLike, work_of_adhesion: ArrayLike) -> Fold:
    """Return where n zeta(a) = share * sqrt(2 pi a w / E); share is 3/2 for the load and 1/2 for the displacement."""
    ratio = positive("work_of_adhesion", work_of_adhesion) / positive("modulus", modulus)
    n = tip.exponent
    a = np.asarray((share * np.sqrt(2.0 * np.pi * ratio) / (n * tip.strength)) ** (1.0 / (n - 0.5)))
    return _state(tip, a, modulus, work_of_adhesion)
