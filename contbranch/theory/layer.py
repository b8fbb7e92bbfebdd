"""Contact with a layered body without range: Hertz, Sneddon and JKR, from one integral equation.

With the pressure's transform h, which vanishes beyond the contact radius a, and the layer's K,

    h + K h = d - zeta on 0 < t < a,    (K h)(t) = (2/pi) int_0^inf (S(qH) - 1) cos(qt) int_0^a cos(qs) h(s) ds dq,

F = 2 E int h dt, and h(a) = -sqrt(2 pi a w/E) with the work of adhesion w (0: Hertz, Sneddon).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.bodies import Body
from contbranch.contact.tip_shape import Tip
from contbranch.theory._inputs import not_negative, positive

__all__ = ["Disc", "curve"]

# Gauss nodes in the disc, at least and for every thickness that the radius has: with these all digits of Hertz' load
# are there from a/H = 0.01 to 30.
NODES = 24, 8.0


class Disc:
    """A contact of radius a: everything linear in the displacement, E = 1.

    Parameters
    ----------
    tip : Tip
    body : Body
    radius : float
        a > 0.
    neck : float
        sqrt(2 pi a w/E).

    Attributes
    ----------
    displacement, load, energy : float
        d, F and the elastic energy.
    unit : array (M,)
        h at the nodes by a unit displacement, `weights` those of the integral over t.
    unit_at_rim : float
        The same at the rim.
    """

    def __init__(self, tip: Tip, body: Body, radius: float, neck: float = 0.0) -> None:
        x, w = np.polynomial.legendre.leggauss(NODES[0] + math.ceil(NODES[1] * radius / body.thickness))
        t, self.weights = 0.5 * radius * (x + 1.0), 0.5 * radius * w
        q, shares = body.waves(2.0 * radius)
        cosines = np.cos(np.multiply.outer(t, q))
        weighted = (2.0 / math.pi) * (shares[:, None] * cosines.T) * self.weights
        matrix = np.eye(t.size) + cosines @ weighted
        heights = tip.transform(t)
        self.unit, lowered = np.linalg.solve(matrix, np.column_stack([np.ones_like(t), heights])).T
        rim = np.cos(radius * q) @ weighted
        self.unit_at_rim = 1.0 - float(rim @ self.unit)
        self.displacement = (float(tip.transform(radius)) - float(rim @ lowered) - neck) / self.unit_at_rim
        h = self.displacement * self.unit - lowered
        self.load = 2.0 * float(self.weights @ h)
        self.energy = float(self.weights @ (h * (self.displacement - heights)))

    @property
    def stiffness(self) -> float:
        """Load by a unit displacement of a flat punch of that radius."""
        return 2.0 * float(self.weights @ self.unit)


def curve(
    tip: Tip, radii: ArrayLike, body: Body, *, modulus: float = 1.0, work_of_adhesion: float = 0.0
) -> tuple[Array, Array]:
    """Return load and displacement of an axisymmetric tip on a layered body.

    Parameters
    ----------
    tip : Tip
    radii : array_like (M,)
        Contact radii a > 0.
    body : ElasticLayer or Coating
    modulus : float
        Effective modulus E > 0 of the layer.
    work_of_adhesion : float
        w >= 0; 0: Hertz (a parabola), Sneddon (any tip); otherwise JKR.

    Returns
    -------
    load, displacement : array (M,)

    Raises
    ------
    InputError
        If a radius is not positive, or a constant not possible.
    """
    a, e = positive("radii", radii), float(positive("modulus", modulus))
    w = float(not_negative("work_of_adhesion", work_of_adhesion))
    own = body.scaled(1.0, e)
    discs = [Disc(tip, own, one, math.sqrt(2.0 * math.pi * one * w / e)) for one in np.atleast_1d(a).tolist()]
    return e * np.array([disc.load for disc in discs]), np.array([disc.displacement for disc in discs])
