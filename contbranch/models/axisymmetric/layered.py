"""The same equations for a layered body, whose surface follows U = h + K h in place of h.

With the pressure's transform h and the layer's K (`contbranch.theory.layer`) the gap, the rim and the displacement are
those of a half space with U for h:

    h = abel p outside,    h + K h = d - zeta in the disc.

Within the disc h is known at Gauss nodes from this equation of the second kind and is eliminated, so that U outside is
linear in h outside and in d. K is a product of few cosines, of which no kernel is formed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.bodies import Body
from contbranch.theory.layer import NODES
from contbranch.watch import check

from .equations import NOTHING, Equations, Fields, _Beyond
from .rim import Rim

__all__ = ["LayeredEquations"]

# Step of the contact radius for differences, relative, and at least in units of the innermost panel.
STEP, LEAST = 1e-4, 1e-3
# An eigenvalue with an imaginary part below this share is real: stability is that of a symmetric operator.
REAL = 1e-6
# Rims of which the layer is kept.
KEPT = 4


class _Plate(NamedTuple):
    """The layer around one rim: linear maps of h outside, (N,), of d, and of the tip.

    Attributes
    ----------
    raised : array (N, N), (N,), (N,)
        U outside by h, by d and by the tip; at fixed d.
    rim : array (N,), float, float
        U at the rim likewise.
    load : array (N,), float, float
        ∫_0^∞ h dt likewise.
    inner : array (M, N), (M,), (M,)
        h within likewise.
    places, weights : array (M,)
        Within.
    """

    raised: tuple[Array, Array, Array]
    rim: tuple[Array, float, float]
    load: tuple[Array, float, float]
    inner: tuple[Array, Array, Array]
    places: Array
    weights: Array


@dataclass(eq=False, repr=False)
class LayeredEquations(Equations):
    """Residual, linearisation and observables of one contact on a layered body on one mesh.

    Parameters
    ----------
    body : Body
        In reduced units.
    """

    body: Body | None = None

    @cached_property
    def layer(self) -> Body:
        """The body."""
        if self.body is None:
            raise TypeError("layered equations need a body")
        return self.body

    # -- the layer ----------------------------------------------------------------------------------------------------
    @cached_property
    def _waves(self) -> tuple[Array, Array]:
        """Wavenumbers q and (2/π) (S - 1) dq that resolve cos(qt) out to the mesh's end."""
        q, shares = self.layer.waves(1.5 * float(self.mesh.end))
        return q, (2.0 / math.pi) * shares

    def _plate(self, rim: Rim) -> _Plate:
        """The layer around a rim; the last ones are kept."""
        kept: dict[float, _Plate] = self.__dict__.setdefault("_plates", {})
        if rim.radius not in kept:
            if len(kept) >= KEPT:
                kept.clear()
            kept[rim.radius] = self._made(rim)
        return kept[rim.radius]

    def _made(self, rim: Rim) -> _Plate:
        check()
        (q, share), mesh, a = self._waves, self.mesh, rim.radius
        outer, at_rim = np.cos(np.multiply.outer(np.hypot(a, mesh.nodes), q)), np.cos(a * q)
        by_outer = share[:, None] * (outer * rim.weights[:, None]).T
        raised, row = outer @ by_outer, self.rim_row + at_rim @ by_outer
        raised.flat[:: mesh.size + 1] += 1.0
        none, empty = np.zeros(mesh.size), np.zeros(0)
        if a == 0.0:
            inner = np.zeros((0, mesh.size)), empty, empty
            return _Plate((raised, none, none), (row, 0.0, 0.0), (rim.weights, 0.0, 0.0), inner, empty, empty)
        x, w = np.polynomial.legendre.leggauss(NODES[0] + math.ceil(NODES[1] * a / self.layer.thickness))
        t, w = 0.5 * a * (x + 1.0), 0.5 * a * w
        within = np.cos(np.multiply.outer(t, q))
        by_inner = (share[:, None] * within.T) * w
        matrix = within @ by_inner
        matrix.flat[:: t.size + 1] += 1.0
        right = np.column_stack([np.ones_like(t), -self.tip.transform(t), -(within @ by_outer)])
        answers = np.linalg.solve(matrix, right)
        by_d, by_tip, by_h = (np.asarray(one, float) for one in (answers[:, 0], answers[:, 1], answers[:, 2:]))
        back, back_rim = outer @ by_inner, at_rim @ by_inner
        return _Plate(
            (raised + back @ by_h, back @ by_d, back @ by_tip),
            (row + back_rim @ by_h, float(back_rim @ by_d), float(back_rim @ by_tip)),
            (rim.weights + w @ by_h, float(w @ by_d), float(w @ by_tip)),
            (by_h, by_d, by_tip),
            t,
            w,
        )

    def _depth(self, plate: _Plate, h: Array, a: float) -> float:
        """d, where U at the rim is d - ζ(a) in contact; 0 without, where nothing within depends on it."""
        if a == 0.0:
            return 0.0
        row, by_d, by_tip = plate.rim
        return (float(row @ h) + by_tip + float(self.tip.transform(np.float64(a)))) / (1.0 - by_d)

    def _all(self, plate: _Plate, h: Array, a: float) -> tuple[Array, float, float]:
        """U outside, U at the rim, and ∫ h."""
        d = self._depth(plate, h, a)
        raised, rim, load = ((one[0] @ h + d * one[1] + one[2]) for one in (plate.raised, plate.rim, plate.load))
        return raised, float(rim), float(load)

    def _raised(self, h: Array, rim: Rim) -> tuple[Array, float]:
        """U outside, and at the rim."""
        return self._all(self._plate(rim), h, rim.radius)[:2]

    def rim_gradient(self, fields: Fields) -> Array:
        """Derivative of U at the rim with respect to h."""
        row, by_d, _ = self._plate(fields.rim).rim
        return row / (1.0 - by_d)

    def _gradient(self, fields: Fields) -> Array:
        """Derivative of U outside less that at the rim with respect to h, (N, N)."""
        raised, by_d, _ = self._plate(fields.rim).raised
        row = self.rim_gradient(fields)
        return np.asarray(raised + np.multiply.outer(by_d - 1.0, row) if self.contact else raised - row)

    def _moved(self, fields: Fields) -> tuple[Array, float, float]:
        """Rates of U outside, U at the rim and ∫ h with y at fixed h: the rim moves."""
        if not self.contact:
            return np.zeros(self.mesh.size), 0.0, 0.0
        if "moved" not in fields.derived:
            a, h = fields.rim.radius, fields.h
            step = max(STEP * a, LEAST * self.mesh.innermost)
            ends = (max(a - step, 0.0), a + step)
            less, more = (self._all(self._made(rim), h, rim.radius) for rim in (Rim(self.mesh, end) for end in ends))
            length = float(ends[1] ** self.coordinate.power - ends[0] ** self.coordinate.power)
            changes = (more[0] - less[0], more[1] - less[1], more[2] - less[2])
            fields.derived["moved"] = changes[0] / length, changes[1] / length, changes[2] / length
        raised, rim, load = fields.derived["moved"]
        return raised, rim, load

    # -- linearisation ------------------------------------------------------------------------------------------------
    def jacobian(self, fields: Fields) -> Array:
        """dR/dh at fixed y."""
        matrix = np.asarray(self.response(fields) @ self._gradient(fields))
        matrix.flat[:: self.mesh.size + 1] += 1.0
        return matrix

    def multiplied(self, fields: Fields, h: Array) -> Array:
        """``jacobian @ h``."""
        return h + self.answered(fields, self._gradient(fields) @ h)

    def _gap_slope(self, fields: Fields) -> Array:
        raised, rim, _ = self._moved(fields)
        return super()._gap_slope(fields) + fields.rim.bent(raised - rim)

    # -- observables --------------------------------------------------------------------------------------------------
    def _own_load(self, fields: Fields) -> float:
        """2 ∫ h dt within the mesh."""
        return 2.0 * self._all(self._plate(fields.rim), fields.h, fields.rim.radius)[2]

    def _inside(self, fields: Fields) -> Array:
        """h at the nodes within."""
        plate = self._plate(fields.rim)
        by_h, by_d, by_tip = plate.inner
        return np.asarray(by_h @ fields.h + self._depth(plate, fields.h, fields.rim.radius) * by_d + by_tip)

    def energy(self, fields: Fields) -> float:
        """V_ela + V_fr, V_ela = ∫ h (h + K h) dt."""
        plate, a = self._plate(fields.rim), fields.rim.radius
        elastic = float(fields.rim.weights @ (fields.h * fields.raised))
        if a > 0.0:
            within = self._depth(plate, fields.h, a) - self.tip.transform(plate.places)
            elastic += float(plate.weights @ (self._inside(fields) * within))
        return elastic + self._surface(fields) + self.beyond(fields).energy

    def beyond(self, fields: Fields) -> _Beyond:
        """Load and energy of the interaction beyond the mesh, which does not lift what is far from it."""
        found = super().beyond(fields)
        none = {"shift": 0.0, "shift_per_displacement": 0.0, "shift_per_gap": 0.0}
        return found if found is NOTHING else replace(found, **none)

    def gradients(self, fields: Fields) -> tuple[Array, Array]:
        """Derivatives of load and displacement with respect to the nodal values of h at fixed y."""
        row = self.rim_gradient(fields)
        by_h, by_d, _ = self._plate(fields.rim).load
        load, beyond = 2.0 * (by_h + by_d * row), self.beyond(fields)
        if beyond is not NOTHING:
            load = load + beyond.load_per_displacement * row
            load -= beyond.load_per_gap * (fields.rim.plane[-1] @ self._gradient(fields))
        return load, row

    def load_change(self, fields: Fields, step: Array) -> float:
        """Change of the load within the mesh with h."""
        by_h, by_d, _ = self._plate(fields.rim).load
        return 2.0 * float((by_h + by_d * self.rim_gradient(fields)) @ step)

    def rates(
        self, fields: Fields, h_rate: Array, y_rate: float, stretching: float = 0.0, power: float = 0.0
    ) -> tuple[float, float]:
        """Directional derivatives of load and displacement along (h_rate, y_rate)."""
        by_h, row = self.gradients(fields)
        _, rim, own = self._moved(fields)
        lift = rim + self.coordinate.slopes(fields.y)[2] if self.contact else 1.0
        load, beyond = float(by_h @ h_rate) + 2.0 * own * y_rate, self.beyond(fields)
        if beyond is not NOTHING:
            gap = float(self.slopes(fields)[0][self.mesh.size - 1])
            load += (beyond.load_per_displacement * lift - beyond.load_per_gap * gap) * y_rate
        return load, float(row @ h_rate) + lift * y_rate

    def load_per_displacement(self, fields: Fields) -> float:
        """dF/dd at a fixed rim."""
        (raised, by_d, _), (by_h, load, _) = self._plate(fields.rim).raised, self._plate(fields.rim).load
        response = self.response(fields)
        matrix = response @ raised
        matrix.flat[:: self.mesh.size + 1] += 1.0
        return 2.0 * (float(by_h @ np.linalg.solve(matrix, response @ (1.0 - by_d))) + load)

    def unstable_modes(self, fields: Fields, finely: bool = True) -> int:
        """Morse index under displacement control (m = 0): negative eigenvalues of 1 + v'' C with the compliance C."""
        matrix = np.asarray(self.response(fields) @ self._plate(fields.rim).raised[0])
        matrix.flat[:: self.mesh.size + 1] += 1.0
        values = np.linalg.eigvals(matrix)
        real = np.abs(values.imag) <= REAL * np.abs(values)
        return int((values.real[real] < 0.0).sum())

    def inner_pressure(self, fields: Fields, r: Array) -> Array:
        """Total pressure within: that of the tip alone, what the layer's K h adds, less what h outside pulls."""
        plate, a, (q, share) = self._plate(fields.rim), fields.rim.radius, self._waves
        outer = np.cos(np.multiply.outer(np.hypot(a, self.mesh.nodes), q))
        within = np.cos(np.multiply.outer(plate.places, q))
        amplitudes = share * ((fields.rim.weights * fields.h) @ outer + (plate.weights * self._inside(fields)) @ within)
        x, weights = np.polynomial.legendre.leggauss(48)
        reach = np.sqrt(np.maximum((a - r) * (a + r), 0.0))
        places = np.hypot(r[:, None], 0.5 * reach[:, None] * (x + 1.0))
        slope = -(np.sin(np.multiply.outer(places, q)) @ (q * amplitudes)) / np.maximum(places, 1e-300)
        bent = 0.5 * reach * (slope @ weights)
        pulled = self._pulled(fields, np.maximum((a - r) * (a + r), 0.0))
        return np.asarray(self.tip.contact_pressure(r, a) + (bent - pulled) / np.pi)
