"""An event as a curve: equilibrium and the event's condition together, with one parameter of the contact free.

    R(h, u; q) = 0                  equilibrium
    G(h, u; q) = 0                  the condition: for a fold, the rate of what is controlled along the curve of
                                    equilibria at fixed q

with the state z = (h, w) and the family's coordinate q as parameter (a minimally augmented system: one equation more,
one unknown more). The tangent v of the curve of equilibria at fixed q comes from the bordered matrix

    [ R_h  R_u ] [ v_h ]   [ 0 ]
    [   c^T    ] [ v_u ] = [ 1 ].

G is taken at the state moved onto the equilibria by one Newton step with that matrix, at fixed c·(h, u). Its derivative
is then a multiple of c^T, and only its rates along the two tangents of the surface of equilibria (v, and the change
with q) are needed, which differences give. They enter the rate of convergence and the tangents, not the solutions.

Without contact w = u. In contact the load has a term of order a³ beside a², so that conditions are smooth in the
radius a and not in a² ~ u: there w = u^(1/m), with the contact coordinate y = a^m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from contbranch.continuation import Adaptation, Linearisation, Problem
from contbranch.errors import ModelError

from .conditions import Condition, Sheet, Surface
from .mesh import Mesh
from .problem import ContactProblem

__all__ = ["EventProblem"]

Array = NDArray[np.float64]

# Central differences of the condition: second order while tracing, fourth order where tangents themselves are results.
STEP, FINE_STEP = 1e-4, 2e-3
# ... over lengths in the contact coordinate that are small against its own value, but not below this one.
LEAST_LENGTH = 1e-2
# A state farther from equilibrium than this, relative to itself, is moved onto it before the condition is taken.
NEAR = 1e-9
# The border is the contact coordinate itself where the tangent has at least this component of it; otherwise a reference
# direction, replaced when it is farther than this (cosine) from the tangent.
UPRIGHT, ALIGNED = 1e-3, 0.7
# A negative contact coordinate of this size is rounding.
ZERO = 1e-12


class EventProblem(Problem):
    """The augmented system on one mesh, on one side of first touch.

    Parameters
    ----------
    surface : Surface
    mesh : Mesh
    contact : bool
    condition : Condition
    reference : (array (N,), float)
        Direction (h, u) to which tangents are compared: it borders the matrix, and orients them.
    sharpness : float
        As `ContactProblem` has it.
    fine : bool
        Whether derivatives of the condition are taken to fourth order.
    """

    def __init__(
        self,
        surface: Surface,
        mesh: Mesh,
        contact: bool,
        condition: Condition,
        reference: tuple[Array, float],
        sharpness: float = 1.0,
        fine: bool = False,
    ) -> None:
        self.surface, self.mesh, self.contact, self.condition = surface, mesh, contact, condition
        self.reference, self.sharpness, self.fine = reference, sharpness, fine
        self._weights = np.append(mesh.weights / surface.size**2, 1.0)
        direction = np.append(*reference)
        direction /= math.sqrt(self.inner(direction, direction))
        self.upright = abs(float(direction[-1])) > UPRIGHT
        self._border = self.dual(direction)
        if self.upright:
            self._border = np.zeros(direction.size)
            self._border[-1] = math.copysign(1.0, float(direction[-1]))
        self._kept: list[tuple[Array, float, Sheet]] = []
        self.power = surface.power if contact else 1.0

    # -- state --------------------------------------------------------------------------------------------------------
    def split(self, x: Array) -> tuple[Array, float]:
        """(h, u) of a state; u is NaN where there is none."""
        w = float(x[-1])
        if not self.contact:
            return x[:-1], w
        return x[:-1], max(w, 0.0) ** self.power if w >= -ZERO else math.nan

    def joined(self, h: Array, u: float) -> Array:
        """The state of (h, u)."""
        return np.append(h, max(u, 0.0) ** (1 / self.power) if self.contact else u)

    def _stretch(self, w: float) -> float:
        """du/dw."""
        return self.power * w ** (self.power - 1) if self.contact else 1.0

    def member(self, q: float) -> ContactProblem:
        """The equilibrium problem at q."""
        return self.surface.problem(q, self.mesh, self.contact, self.sharpness)

    def inner(self, u: Array, v: Array) -> float:
        """∫ u v dtau in units of a typical state, plus the product of the last components."""
        return float((self._weights * u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        return self._weights * u

    # -- equilibria at fixed q ----------------------------------------------------------------------------------------
    def sheet(self, h: Array, u: float, q: float) -> Sheet:
        """Linearisation and tangent at (h, u; q).

        Raises
        ------
        ModelError
            If the state cannot be evaluated.
        """
        if not math.isfinite(u):
            raise ModelError("no contact of negative radius")
        problem = self.member(q)
        problem.resolution.newton += 1
        fields = problem.fields(h, u)
        if not fields.finite:
            raise ModelError("the interaction is not defined at this state")
        slope = problem.equations.slopes(fields)[1] * (problem.scale * math.cosh(u))
        n = self.mesh.size
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = problem.equations.jacobian(fields)
        matrix[:n, n] = slope
        matrix[n] = self._border
        factors = lu_factor(matrix, overwrite_a=True, check_finite=False)
        v = lu_solve(factors, np.append(np.zeros(n), 1.0), check_finite=False)
        v /= math.sqrt(self.inner(v, v))
        return Sheet(problem, fields, u, (v[:-1], float(v[-1])), factors)

    def on_sheet(self, x: Array, q: float) -> Sheet:
        """The linearisation at the equilibrium next to a state: at the state itself where that is one."""
        for known, value, sheet in self._kept:
            if known is x and value == q:
                return sheet
        h, u = self.split(x)
        sheet = self._nearest(h, u, q)
        self._kept = [(x, q, sheet), *self._kept[:3]]
        return sheet

    def _nearest(self, h: Array, u: float, q: float) -> Sheet:
        sheet = self.sheet(h, u, q)
        dh, du = sheet.solve(-sheet.fields.residual)
        moved = float(np.abs(dh).max()) / max(float(np.abs(h).max()), 1e-3 * self.surface.scale) + abs(du)
        if moved <= NEAR:
            return sheet
        return self.sheet(h + dh, max(u + du, 0.0) if self.contact else u + du, q)

    def level(self, h: Array, u: float, q: float) -> float:
        """The condition's value at the equilibrium next to (h, u)."""
        return self.condition.value(self._nearest(h, u, q), q)

    # -- the augmented system -----------------------------------------------------------------------------------------
    def residual(self, x: Array, p: float) -> Array:
        """(R, G), (N + 1,)."""
        h, u = self.split(x)
        if not math.isfinite(u):
            return np.full(x.size, math.nan)
        fields = self.member(p).fields(h, u)
        if not fields.finite:
            return np.append(fields.residual, math.nan)
        return np.append(fields.residual, self.condition.value(self.on_sheet(x, p), p))

    def jacobian(self, x: Array, p: float) -> Array:
        """d(R, G)/d(h, w), (N + 1, N + 1)."""
        return np.asarray(self.linearise(x, p).jacobian)

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual, its derivatives with respect to state and parameter."""
        h, u = self.split(x)
        n = self.mesh.size
        if not math.isfinite(u):
            return Linearisation(np.full(n + 1, math.nan), np.empty((0, 0)), np.empty(0))
        sheet = self.sheet(h, u, p)
        fields, problem = sheet.fields, sheet.problem
        stretch = self._stretch(float(x[-1]))
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = problem.equations.jacobian(fields)
        matrix[:n, n] = problem.equations.slopes(fields)[1] * (problem.scale * math.cosh(u)) * stretch
        residual_rate = self._residual_rate(h, u, p)
        value = self.condition.value(self.on_sheet(x, p), p)
        along, direction = self._along(sheet, float(x[-1]), p)
        border = self._border.copy()
        border[:-1] /= max(stretch, 1e-8)
        matrix[n] = along * border / float(border @ direction)
        change = self._across(sheet, residual_rate, p)
        return Linearisation(np.append(fields.residual, value), matrix, np.append(residual_rate, change))

    def _residual_rate(self, h: Array, u: float, q: float) -> Array:
        """dR/dq at fixed (h, u)."""
        if self.surface.family.spacing == "angle":
            return np.zeros_like(h)
        step = 1e-5
        above, below = (self.member(q + s).fields(h, u).residual for s in (step, -step))
        rate: Array = (above - below) / (2 * step)
        return rate

    def _differences(self, length: float) -> tuple[Array, Array]:
        """Offsets and weights of a central difference."""
        if self.fine:
            step = FINE_STEP * length
            return step * np.array([-2.0, -1.0, 1.0, 2.0]), np.array([1.0, -8.0, 8.0, -1.0]) / (12 * step)
        step = STEP * length
        return step * np.array([-1.0, 1.0]), np.array([-1.0, 1.0]) / (2 * step)

    def _one_sided(self, length: float) -> tuple[Array, Array]:
        """Offsets and weights of a difference to one side, where the other has no states."""
        if self.fine:
            step = FINE_STEP * length
            weights = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / (12 * step)
            return step * np.arange(5.0), weights
        step = STEP * length
        return step * np.array([0.0, 1.0, 2.0]), np.array([-1.5, 2.0, -0.5]) / step

    def _along(self, sheet: Sheet, w: float, q: float) -> tuple[float, Array]:
        """Rate of the condition along the tangent in (h, w), and that tangent times du/dw, (N + 1,)."""
        v_h, v_u = sheet.tangent
        stretch = self._stretch(w)
        direction = np.append(stretch * v_h, v_u)
        length = min(1.0, max(abs(w), LEAST_LENGTH))
        offsets, weights = self._differences(length)
        if self.contact and w + float(offsets.min()) * abs(v_u) < 0:
            offsets, weights = self._one_sided(math.copysign(length, v_u))
        h, u = sheet.fields.h, sheet.u
        total = 0.0
        for offset, weight in zip(offsets, weights, strict=True):
            u_there = max(w + offset * v_u, 0.0) ** self.power if self.contact else w + offset * v_u
            share = (u_there - u) / v_u if abs(v_u) > 1e-8 else offset * stretch
            total += weight * self.level(h + share * v_h, u_there, q)
        return float(total), direction

    def _across(self, sheet: Sheet, residual_rate: Array, q: float) -> float:
        """Rate of the condition with q along the surface of equilibria, at fixed c·(h, u)."""
        h_rate, u_rate = sheet.solve(-residual_rate)
        offsets, weights = self._differences(1.0)
        total = 0.0
        for offset, weight in zip(offsets, weights, strict=True):
            u = sheet.u + offset * u_rate
            level = self.level(sheet.fields.h + offset * h_rate, max(u, 0.0) if self.contact else u, q + offset)
            total += weight * level
        return float(total)

    # -- observables, meshes ------------------------------------------------------------------------------------------
    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """What the equilibrium problem records."""
        h, u = self.split(x)
        return self.member(p).observables(h, u)

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A mesh for this solution, and a reference direction close to its tangent, where needed."""
        h, u = self.split(x)
        offer = self.member(p).adapt(h, u)
        if offer is None:
            v = np.append(*self.on_sheet(x, p).tangent)
            aligned = abs(float(self._border @ v))
            if aligned >= 0.5 * UPRIGHT if self.upright else aligned >= ALIGNED and abs(v[-1]) < 3 * UPRIGHT:
                return None
            return Adaptation(self.on(self.mesh, (v[:-1], float(v[-1]))), x, lambda vector: vector)
        member = offer.problem
        assert isinstance(member, ContactProblem)
        mesh = member.equations.mesh
        v_h, v_u = self.on_sheet(x, p).tangent
        reference = (self.mesh.interpolate(v_h, mesh.nodes), v_u)
        problem = self.on(mesh, reference, member.sharpness)
        return Adaptation(problem, np.append(offer.x, x[-1]), lambda vector: self.carried(vector, mesh))

    def carried(self, vector: Array, mesh: Mesh) -> Array:
        """A state or direction (N + 1,) on another mesh."""
        return np.append(self.mesh.interpolate(vector[:-1], mesh.nodes), vector[-1])

    def on(
        self, mesh: Mesh, reference: tuple[Array, float], sharpness: float | None = None, fine: bool | None = None
    ) -> EventProblem:
        """The same event on another mesh, with another reference direction."""
        return EventProblem(
            self.surface,
            mesh,
            self.contact,
            self.condition,
            reference,
            self.sharpness if sharpness is None else sharpness,
            self.fine if fine is None else fine,
        )

    def other_side(self, contact: bool, reference: tuple[Array, float]) -> EventProblem:
        """The same event on the other side of first touch."""
        return EventProblem(self.surface, self.mesh, contact, self.condition, reference, self.sharpness, self.fine)
