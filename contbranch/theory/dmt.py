"""Derjaguin, Muller and Toporov: adhesion of infinitely long range, a Hertzian contact under the load F + 2 pi w R.

Equation (27) of the paper. B. V. Derjaguin, V. M. Muller and Yu. P. Toporov, J. Colloid Interface Sci. 53, 314 (1975).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.theory import hertz
from contbranch.theory._inputs import not_below, positive

__all__ = ["contact_radius", "displacement", "load", "pull_off_load"]


def pull_off_load(*, radius: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0) -> Array:
    """Return the lowest load in contact, F = -2 pi w R, where the contact radius vanishes."""
    return -2.0 * np.pi * positive("work_of_adhesion", work_of_adhesion) * positive("radius", radius)


def load(
    contact_radius: ArrayLike, *, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0
) -> Array:
    """Return the load, F = 4 E a^3 / (3 R) - 2 pi w R.

    Parameters
    ----------
    contact_radius : array_like
        Contact radius a >= 0, in units of length.
    radius, modulus, work_of_adhesion : array_like
        Radius of curvature R, effective modulus E and work of adhesion w, all > 0.

    Raises
    ------
    InputError
        If a length is negative or a constant not positive; so for every function here.
    """
    attraction = pull_off_load(radius=radius, work_of_adhesion=work_of_adhesion)
    return hertz.load(contact_radius, radius=radius, modulus=modulus) + attraction


def displacement(contact_radius: ArrayLike, *, radius: ArrayLike = 1.0) -> Array:
    """Return the displacement, d = a^2 / R as without adhesion."""
    return hertz.displacement(contact_radius, radius=radius)


def contact_radius(
    load: ArrayLike, *, radius: ArrayLike = 1.0, modulus: ArrayLike = 1.0, work_of_adhesion: ArrayLike = 1.0
) -> Array:
    """Return the contact radius, a^3 = (3R/4E) (F + 2 pi w R) (27), for loads from -2 pi w R upwards.

    Raises
    ------
    InputError
        If a load is below the pull-off load.
    """
    lowest = pull_off_load(radius=radius, work_of_adhesion=work_of_adhesion)
    force = not_below("load", load, lowest, "pull-off; lower loads have no contact")
    return hertz.contact_radius(force - lowest, radius=radius, modulus=modulus)
