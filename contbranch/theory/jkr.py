"""Johnson, Kendall and Roberts: adhesion of infinitely short range, for a parabola, a cone and power-law tips.

For any tip with the Abel transform zeta(t), contact of radius a has

    d = zeta(a) - sqrt(2 pi a w / E),      F = 2 E [d a - int_0^a zeta dt],

so dF/da = 2 E [a zeta' - (3/2) sqrt(2 pi a w/E)] and a dd/da = a zeta' - (1/2) sqrt(2 pi a w/E) locate the folds.
Equation (28) of the paper is the parabola, zeta = t^2/R.

K. L. Johnson, K. Kendall and A. D. Roberts, Proc. R. Soc. A 324, 301 (1971).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
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
    "displacement",
    "displacement_fold",
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
