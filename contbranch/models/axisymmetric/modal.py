"""The Abel integral of azimuthal variations, ``(A_m h)(r) = (2/π) ∫_a^r (t/r)^m h(t)/√(r² − t²) dt``, on a mesh.

The powers t^m and r^−m never stand alone: their ratio, at most 1, is part of the integrand. So large m neither overflow
nor ask more of the panels' polynomials than h itself does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular

from contbranch.arrays import Array, Indices
from contbranch.models.quadrature import chebyshev_values, gauss, gauss_between

from .equations import Equations, Fields
from .mesh import LONG, NEAR, NEAR_ROOT, Mesh

__all__ = ["ModeSpace", "inner_mode_pressure"]

# Gauss nodes for the gap, a panel, beyond those of the mesh.
EXTRA = 6
# Integrals that are kept: without contact neighbouring states have the same, and few m are asked for.
PLANES = 12
# Close to their panels, integrals have nodes for m up to this at least.
FEW = 32


@dataclass(frozen=True)
class ModeSpace:
    """Trial functions h of one state, orthonormal in ∫ dt, and radii at which their gap is integrated.

    On the innermost panel the functions are even polynomials in tau (times t for odd m, as regularity at the axis asks
    where there is no contact), elsewhere the panels' polynomials. Variations leave the gap where it rests.

    Attributes
    ----------
    mesh : Mesh
    radius : float
        a.
    rho, weights : array (M,)
        ``√(r² − a²)`` and weights of ∫ drho, more of them than the mesh has nodes. The gap of a trial function that
        jumps between panels starts like the root of the distance from there, so the nodes are Gauss' in that root.
    stiffness : array (M,)
        v'' of the state at rho; 0 where the gap rests.
    resting : tuple of int
        The panels on which it does.
    """

    mesh: Mesh
    radius: float
    rho: Array
    weights: Array
    stiffness: Array
    resting: tuple[int, ...] = ()

    @staticmethod
    def of(equations: Equations, fields: Fields) -> ModeSpace:
        """The trial functions of a state; kept with its fields."""
        known = fields.derived.get("modes")
        if isinstance(known, ModeSpace):
            return known
        mesh, a = equations.mesh, fields.rim.radius
        rho, weights = _radii(mesh)
        profile = fields.h - fields.rim_value
        inner, outer = planes(mesh, a, 0)
        shape, _ = equations.tip.shape_gap(rho, a)
        gap = inner @ (mesh.rule.to_even @ profile[: mesh.order]) + outer @ profile[mesh.order :] + shape
        gap = gap + equations.central_gap(fields)
        stiffness, count = np.zeros_like(gap), mesh.order + EXTRA
        resting: list[int] = []
        for nodes, region in equations.divided():
            first, last = nodes.start // mesh.order, nodes.stop // mesh.order
            own = slice(first * count, last * count)
            if region.rests:
                resting += range(first, last)
            else:
                stiffness[own] = equations.law.evaluate(region.index, gap[own]).stiffness
        space = ModeSpace(mesh, a, rho, weights, stiffness, tuple(resting))
        fields.derived["modes"] = space
        return space

    def plane(self, m: int) -> Array:
        """A_m on the orthonormal trial functions, (M, N)."""
        inner, outer = planes(self.mesh, self.radius, m)
        inner = solve_triangular(self._factor(m), inner.T, lower=True).T
        return np.concatenate([inner, outer / np.sqrt(self._outer_weights())], axis=1)

    def basis(self, m: int) -> Array:
        """What spans the trial functions whose gap vanishes where it rests, against all pressures there; (N, N − K)."""
        tested = self._tested()
        whole, _ = np.linalg.qr((tested @ self.plane(m)).T, mode="complete")
        return whole[:, len(tested) :]

    def resting_pressure(self, m: int, vector: Array) -> Array:
        """What a mode of eigenvalue 1, whose h is the transform of its pressure, presses where the gap rests; (M,)."""
        if not self.resting:
            return np.zeros_like(self.rho)
        plane, tested = self.plane(m), self._tested()
        free = vector + np.pi * plane.T @ (self.weights * self.rho * self.stiffness * (plane @ vector))
        nodal = np.linalg.lstsq(np.pi * (tested @ plane).T, free)[0]
        return np.asarray(tested.T @ nodal) / (self.weights * self.rho)

    def _tested(self) -> Array:
        """∫ of the gap times the panels' polynomials of the pressure, r dr, where it rests; (K, M)."""
        n, count, mesh = self.mesh.order, self.mesh.order + EXTRA, self.mesh
        tested = np.zeros((len(self.resting) * n, self.rho.size))
        for k, panel in enumerate(self.resting):
            own = slice(panel * count, (panel + 1) * count)
            values = mesh.rule.lagrange(mesh.local(self.rho[own], np.array([panel])))
            tested[k * n : (k + 1) * n, own] = values.T * self.weights[own] * self.rho[own]
        return tested

    def coefficients(self, m: int, vector: Array) -> tuple[Array, Array]:
        """Coefficients of the even polynomials (times t/L for odd m), and nodal values on the other panels."""
        even = self.mesh.rule.even_order
        inner = solve_triangular(self._factor(m), vector[:even], lower=True, trans="T")
        return inner, vector[even:] / np.sqrt(self._outer_weights())

    def _outer_weights(self) -> Array:
        """Weights of ∫ dt on all panels but the innermost."""
        n, mesh = self.mesh.order, self.mesh
        return mesh.weights[n:] * mesh.nodes[n:] / np.hypot(self.radius, mesh.nodes[n:])

    def _factor(self, m: int) -> Array:
        """Cholesky factor of the mass matrix ∫ dt of the innermost panel's functions."""
        mesh, a = self.mesh, self.radius
        end = np.hypot(a, mesh.innermost)
        # t − a and not t is what carries digits where the panel is short against a.
        reach = mesh.innermost**2 / (end + a)
        beyond, w = gauss_between(np.zeros(()), reach, 2 * mesh.order)
        values = chebyshev_values(mesh.rule.even_order, 2 * beyond * (beyond + 2 * a) / mesh.innermost**2 - 1)
        weights = w * ((a + beyond) / mesh.innermost) ** (2 * (m % 2))
        return np.asarray(np.linalg.cholesky((values * weights) @ values.T))


def _radii(mesh: Mesh) -> tuple[Array, Array]:
    """`ModeSpace.rho` and `ModeSpace.weights` of a mesh."""
    z, w = gauss(mesh.order + EXTRA)
    u, length, outer = (z + 1) / 2, np.diff(mesh.edges)[:, None], mesh.root[:, None] > 0
    # Next to a root beyond, where the gap goes like x log x, they are as dense as next to the inner end.
    share, rate = np.where(outer, u * u * (3 - 2 * u), u * u), np.where(outer, 3 * u * (1 - u), u)
    return (mesh.edges[:-1, None] + length * share).ravel(), (length * rate * w).ravel()


def planes(mesh: Mesh, a: float, m: int) -> tuple[Array, Array]:
    """A_m on the innermost panel's functions and on the other nodal values; where it is stretched it stays the same."""
    base, factor = mesh.source or (mesh, 1.0)
    return _planes(base, a / factor, m)


@lru_cache(PLANES)
def _planes(mesh: Mesh, a: float, m: int) -> tuple[Array, Array]:
    rho, _ = _radii(mesh)
    return inner_plane(mesh, a, rho, m), outer_plane(mesh, a, m)


def inner_plane(mesh: Mesh, a: float, rho: Array, m: int) -> Array:
    """A_m on the innermost panel's functions at `rho`: even Chebyshev polynomials in tau, times t/L for odd m; (M, E).

    With t = r sin θ both the root and the rim disappear: (2/π) ∫ sin^m θ h dθ.
    """
    length = mesh.innermost
    theta, weights = mesh.angles(a, rho, mesh.order + 8 + m // 2)
    r, start, sine = np.hypot(a, rho)[:, None], np.arctan2(a, rho)[:, None], np.sin(theta)
    t = r * sine
    factors = (2 / np.pi) * weights * sine**m * (t / length) ** (m % 2)
    # tau² = (t − a)(t + a), with t − a from the angles' difference: r (sin θ − sin θ_0).
    above = 2 * r * np.cos((theta + start) / 2) * np.sin((theta - start) / 2)
    values = chebyshev_values(mesh.rule.even_order, 2 * above * (t + a) / length**2 - 1)
    return np.asarray(np.einsum("kim,im->ik", values, factors))


def outer_plane(mesh: Mesh, a: float, m: int) -> Array:
    """A_m on the nodal values of all panels but the innermost, at their radii; (M, N − n)."""
    far, ratio, row, panel = _far(mesh, a)
    matrix = far * np.exp(m * ratio)
    if mesh.panels > 1:
        values, factors, ratio = _near(mesh, a, max(m, FEW))
        blocks = matrix.reshape(len(matrix), mesh.panels - 1, mesh.order)
        blocks[row, panel] = np.einsum("kpi,pi->pk", values, factors * np.exp(m * ratio))
    return matrix


@lru_cache(1)
def _far(mesh: Mesh, a: float) -> tuple[Array, Array, Indices, Indices]:
    """A_0 on panels far from their targets, (M, N − n), ln(t/r) there, and the pairs of targets and panels that are
    close to each other."""
    n, rho = mesh.order, _radii(mesh)[0]
    tau, weights = mesh.nodes[n:], mesh.weights[n:]
    t, r = np.hypot(a, tau), np.hypot(a, rho)[:, None]
    difference = rho[:, None] ** 2 - tau**2
    with np.errstate(invalid="ignore", divide="ignore"):
        far = (2 / np.pi) * weights * (tau / t) / np.sqrt(difference)
    far[~(difference > 0)] = 0.0
    left, right = mesh.edges[1:-1], mesh.edges[2:]
    touched = left < rho[:, None]
    distance = np.maximum(0.0, rho[:, None] - right)
    near = np.where(mesh.root[1:] == 0, NEAR, NEAR_ROOT) * (right - left)
    row, panel = np.nonzero(touched & (distance < near))
    blocks = far.reshape(len(rho), mesh.panels - 1, n)
    blocks[~touched] = 0.0
    blocks[row, panel] = 0.0
    return far, np.minimum(0.0, np.log(t) - np.log(r)), row, panel


@lru_cache(1)
def _near(mesh: Mesh, a: float, most: int) -> tuple[Array, Array, Array]:
    """The same for pairs close to each other, with tau = rho sin ψ: the polynomials of a panel's nodes, (n, pairs, i),
    weights of A_0, and ln(t/r), (pairs, i), for m up to `most`."""
    _, _, row, panel = _far(mesh, a)
    rho = _radii(mesh)[0][row]
    tau, weights, local = _arcs(mesh, rho, panel + 1, mesh.order + 8 + most // 2)
    t, r = np.hypot(a, tau), np.hypot(a, rho)[:, None]
    values = np.tensordot(mesh.rule.to_chebyshev.T, chebyshev_values(mesh.order, local), 1)
    return values, (2 / np.pi) * weights * (tau / t), np.log(t / r)


def _arcs(mesh: Mesh, rho: Array, panel: Indices, count: int) -> tuple[Array, Array, Array]:
    """Nodes tau on panels below targets rho, weights of ∫ dtau/√(rho² − tau²), and z there; (pairs, count) each.

    With tau = rho sin ψ. On panels with a root s is the root of the distance from there, and so is that of the target:
    s = s_rho sin ψ from an inner end; from an outer one s = s_rho cosh y, or |s_rho| sinh y for a target beyond.
    """
    if not mesh.roots:
        tau, weights = mesh.arcs(rho, panel, count)
        return tau, weights, mesh.local(tau, panel[:, None])
    count += mesh.order + LONG
    tau, weights = mesh.arcs(rho, panel, count)
    local, root = mesh.local(tau, panel[:, None]), mesh.root[panel]
    length, rule = 2 * mesh.half[panel], gauss(count)
    for kind in (-1, 1, 2):
        if kind < 0:
            pick = np.flatnonzero(root < 0)
            own = (rho[pick] - mesh.edges[panel[pick]]) / length[pick]
            low, high = np.zeros_like(own), np.arcsin(np.minimum(1.0, 1 / np.sqrt(own)))
        else:
            away = (mesh.edges[panel + 1] - rho) / length
            pick = np.flatnonzero((root > 0) & ((away > 0) == (kind == 1)))
            own = np.abs(away[pick])
            low, high = np.zeros_like(own), (np.arccosh if kind == 1 else np.arcsinh)(1 / np.sqrt(own))
        y = (low + (high - low) / 2)[:, None] + ((high - low) / 2)[:, None] * rule[0]
        s = np.sqrt(own)[:, None] * {-1: np.sin, 1: np.cosh, 2: np.sinh}[kind](y)
        if kind < 0:
            tau[pick], local[pick] = mesh.edges[panel[pick]][:, None] + length[pick][:, None] * s * s, 2 * s - 1
        else:
            tau[pick], local[pick] = mesh.edges[panel[pick] + 1][:, None] - length[pick][:, None] * s * s, 1 - 2 * s
        measure = ((high - low) / 2)[:, None] * rule[1] * 2 * np.sqrt(length[pick])[:, None] * s
        weights[pick] = measure / np.sqrt(rho[pick][:, None] + tau[pick])
    return tau, weights, local


def inner_mode_pressure(space: ModeSpace, m: int, vector: Array, r: Array) -> Array:
    """Pressure of a mode at radii r < a inside the contact, (K,).

    The inverse of B_m with h = 0 for t < a:
    ``π p(r) = −(r/a)^m h(a+)/√(a² − r²) − ∫_a^∞ r^m (t^−m h)' / √(t² − r²) dt``.
    The first term, singular at the rim, is the rim's shift.
    """
    mesh, a, n = space.mesh, space.radius, space.mesh.order
    inner, outer = space.coefficients(m, vector)
    distance = np.maximum(a * a - r * r, 0.0)
    even = mesh.rule.even_order
    odd = m % 2

    # Innermost panel: f = t^−m h is even in tau, and with w² = tau² + a² − r² the integral is 2 ∫ df/d(tau²) dw.
    w, weights = gauss_between(np.sqrt(distance), np.sqrt(mesh.innermost**2 + distance), mesh.order + 8)
    squares = w * w - distance[:, None]
    t = np.sqrt(a * a + squares)
    local = 2 * squares / mesh.innermost**2 - 1
    values = chebyshev_values(even, local)
    plain = np.tensordot(inner, values, 1)
    slope = np.tensordot(mesh.rule.even_slopes @ inner, values, 1) * (2 / mesh.innermost**2)
    power = (t / mesh.innermost) ** odd * (r[:, None] / t) ** m
    total = 2 * (power * (slope - (m - odd) / 2 * plain / t**2) * weights).sum(axis=1)

    # The other panels, at their nodes.
    t = np.hypot(a, mesh.nodes[n:])
    rate = ((outer.reshape(-1, n) @ mesh.rule.derivative.T) / mesh.scale[1:]).ravel()
    rate = mesh.weights[n:] * (rate - m * outer * mesh.nodes[n:] / t**2)
    total = total + ((r[:, None] / t) ** m / np.sqrt(mesh.nodes[n:] ** 2 + distance[:, None])) @ rate
    if space.resting:  # h jumps where a resting ring ends
        ends, jumps = mesh.edges[1:], mesh.jumps(np.concatenate([np.zeros(n), outer]))
        within = np.hypot(a, ends[1:])
        total -= ((r[:, None] / within) ** m / np.sqrt(ends[1:] ** 2 + distance[:, None])) @ jumps[1:]
    rim = float(inner @ (-1.0) ** np.arange(even)) * (a / mesh.innermost) ** odd
    return np.asarray(-((r / a) ** m * rim / np.sqrt(distance) + total) / np.pi)
