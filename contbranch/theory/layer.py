"""Contact with a layered body without range: Hertz, Sneddon and JKR, from one integral equation.

With the pressure's transform h, which vanishes beyond the contact radius a, and the layer's K,

    h + K h = d - zeta on 0 < t < a,    (K h)(t) = (2/pi) int_0^inf (S(qH) - 1) cos(qt) int_0^a cos(qs) h(s) ds dq,

F = 2 E int h dt, and h(a) = -sqrt(2 pi a w/E) with the work of adhesion w (0: Hertz, Sneddon).
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.bodies import END, Body
from contbranch.contact.tip_shape import Tip
from contbranch.theory._inputs import not_negative, positive

__all__ = ["Disc", "curve"]

# Gauss nodes in the wavenumber and in the disc, at least and for every thickness that the radius has: with these all
# digits of Hertz' load are there from a/H = 0.01 to 30.
WAVES, NODES = (64, 30.0), (24, 8.0)
# Nodes of the pressure and of the gap.
INTEGRALS = 48


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
    """

    def __init__(self, tip: Tip, body: Body, radius: float, neck: float = 0.0) -> None:
        self.tip, self.body, self.radius, self.neck = tip, body, radius, neck
        thicknesses = radius / body.thickness
        x, w = np.polynomial.legendre.leggauss(NODES[0] + math.ceil(NODES[1] * thicknesses))
        self.t, self.w = 0.5 * radius * (x + 1.0), 0.5 * radius * w
        self._waves = self._spectrum(radius)
        cosines = self._cosines(self.t)
        self._weighted = (2.0 / math.pi) * (self._waves[1][:, None] * cosines.T) * self.w
        matrix = np.eye(self.t.size) + cosines @ self._weighted
        ones, heights = np.linalg.solve(matrix, np.column_stack([np.ones_like(self.t), tip.transform(self.t)])).T
        rim = self._cosines(np.array([radius]))[0] @ self._weighted
        # Of a unit displacement, and of a change of the radius.
        self.unit, self.unit_at_rim = ones, 1.0 - float(rim @ ones)
        level = float(tip.transform(radius)) - float(rim @ heights)
        self.displacement = (level - neck) / self.unit_at_rim
        self.h = self.displacement * ones - heights
        self.load = 2.0 * float(self.w @ self.h)
        self.energy = float(self.w @ (self.h * (self.displacement - tip.transform(self.t))))

    def _spectrum(self, reach: float) -> tuple[Array, Array]:
        """Wavenumbers q and weights of (S - 1) dq that resolve cos(qt) up to a radius."""
        x, w = np.polynomial.legendre.leggauss(WAVES[0] + math.ceil(WAVES[1] * reach / self.body.thickness))
        q = 0.5 * END * (x + 1.0)
        return q / self.body.thickness, 0.5 * END / self.body.thickness * w * (self.body.response(q) - 1.0)

    def _cosines(self, t: Array) -> Array:
        return np.cos(np.multiply.outer(t, self._waves[0]))

    @cached_property
    def _amplitudes(self) -> Array:
        """Of cos(qt) in K h."""
        return np.asarray(self._weighted @ self.h)

    def deepened(self, t: Array) -> Array:
        """K h."""
        return np.asarray(self._cosines(t) @ self._amplitudes)

    def slope(self, t: Array) -> Array:
        """h'(t) in the disc."""
        sines = np.sin(np.multiply.outer(t, self._waves[0]))
        return np.asarray(sines @ (self._waves[0] * self._amplitudes) - self.tip.transform_derivative(t))

    @property
    def stiffness(self) -> float:
        """Load by a unit displacement of a flat punch of that radius."""
        return 2.0 * float(self.w @ self.unit)

    @property
    def rates(self) -> tuple[float, float]:
        """dF/da and dd/da of a contact without adhesion: h(a) stays 0."""
        growth = -float(self.slope(np.array([self.radius]))[0]) / self.unit_at_rim
        return growth * self.stiffness, growth

    def pressure(self, r: Array) -> Array:
        """p = -(1/pi) int_r^a h'/sqrt(t² - r²) dt of a contact without adhesion."""
        x, w = np.polynomial.legendre.leggauss(INTEGRALS)
        reach = np.sqrt(np.maximum((self.radius - r) * (self.radius + r), 0.0))
        t = np.hypot(r[:, None], 0.5 * reach[:, None] * (x + 1.0))
        return np.asarray(-0.5 * reach * ((self.slope(t) / np.maximum(t, 1e-300)) @ w) / math.pi)

    def gap(self, r: Array) -> Array:
        """The gap around a contact without adhesion: the tip's own, and what the layer's K h adds."""
        own = self.tip.shape_gap(np.sqrt((r - self.radius) * (r + self.radius)), self.radius)[0]
        x, w = np.polynomial.legendre.leggauss(INTEGRALS)
        begin = np.arcsin(self.radius / r)[:, None]
        t = r[:, None] * np.sin(begin + 0.5 * (0.5 * math.pi - begin) * (x + 1.0))
        rise = self.deepened(t) - self.deepened(np.array([self.radius]))[0]
        return np.asarray(own + (0.5 * math.pi - begin[:, 0]) / math.pi * (rise @ w))


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
