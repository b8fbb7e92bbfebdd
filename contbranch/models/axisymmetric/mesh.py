"""Panels of Gauss–Legendre nodes, and the two Abel integrals on them.

With the rim radius ``a`` and the coordinates ``tau = sqrt(t² − a²)`` and ``rho = sqrt(r² − a²)`` the kernels lose the
rim:
``√(r² − t²) = √(rho² − tau²)`` and ``s ds = sigma dsigma``. So the matrices below are computed once per mesh, and a
moving rim only scales columns by ``tau/t``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from contbranch.arrays import Array, Indices
from contbranch.models.quadrature import gauss_between, legendre_values, panel_rule

__all__ = ["Mesh"]

# A source panel closer to the target than this many of its own lengths is integrated with the kernel's substitution;
# farther away the kernel is analytic in a Bernstein ellipse of parameter > 5.8 and the panel's own nodes suffice.
NEAR = 1.0
# How `Mesh.finer` is refined; with these, errors of the coarser mesh are measured to about a tenth of themselves.
FINER_GRADING = 0.25
FINER_ORDER_SHARE = 3
FINER_REACH = 2.0


class Mesh:
    """Panels ``[edges[k], edges[k+1]]`` with `order` nodes each, from tau = 0 outwards.

    Parameters
    ----------
    edges : array (P + 1,)
        Increasing, ``edges[0] = 0``; reduced in-plane units.
    order : int
        Nodes a panel.

    Attributes
    ----------
    nodes, weights : array (N,)
        Nodes tau (and rho: they are the same) and Gauss weights; N = P · order.
    plane : array (N, N)
        ``(plane @ f)(rho) = (2/π) ∫_0^rho f(tau) / √(rho² − tau²) dtau``.
    abel : array (N, N)
        ``(abel @ p)(tau) = 2 ∫_tau^∞ sigma p(sigma) / √(sigma² − tau²) dsigma`` (E = 1; nothing beyond the last edge).
    """

    def __init__(self, edges: Array, order: int) -> None:
        self.edges = np.asarray(edges, dtype=float)
        self.rule = panel_rule(order)
        self.order = order
        self.half = np.diff(self.edges) / 2
        self.panels = len(self.half)
        nodes, weights = gauss_between(self.edges[:-1], self.edges[1:], order)
        self.nodes, self.weights = nodes.ravel(), weights.ravel()
        self.size = len(self.nodes)
        self.innermost = float(self.edges[1])
        self.plane = self._plane()
        self.abel = self._abel()

    @cached_property
    def finer(self) -> Mesh:
        """A mesh on which this one's discretisation errors have all but vanished: graded, longer and of higher
        order."""
        grading = [0.0, FINER_GRADING * self.innermost]
        end = FINER_REACH * self.edges[-1]
        return Mesh(
            np.concatenate([grading, self.edges[1:], [end]]), self.order + max(3, self.order // FINER_ORDER_SHARE)
        )

    def forget(self) -> None:
        """Drop the finer mesh, which is made again when it is asked for."""
        for name in ("finer", "to_finer"):
            self.__dict__.pop(name, None)

    def halved(self) -> Mesh:
        """A mesh with every panel cut in two, of the same order."""
        return Mesh(np.sort(np.concatenate([self.edges, (self.edges[:-1] + self.edges[1:]) / 2])), self.order)

    @cached_property
    def to_finer(self) -> Array:
        """Nodal values here -> values of the panels' polynomials at the nodes of `finer`; 0 beyond the last edge."""
        points = self.finer.nodes
        panel, local = self._locate(points)
        rows = legendre_values(self.order, local).T @ self.rule.to_legendre
        matrix = np.zeros((len(points), self.panels, self.order))
        matrix[np.arange(len(points)), panel] = np.where(points <= self.edges[-1], 1.0, 0.0)[:, None] * rows
        return matrix.reshape(len(points), self.size)

    # -- the matrices -------------------------------------------------------------------------------------------------
    def _pairs(self, above: bool) -> tuple[Indices, Indices]:
        """(node, panel) pairs whose kernel needs its substitution; `above`: panels that reach beyond the node."""
        left, right = self.edges[:-1], self.edges[1:]
        x = self.nodes[:, None]
        touched = (right > x) if above else (left < x)
        distance = np.maximum(0.0, np.maximum(left - x, x - right))
        node, panel = np.nonzero(touched & (distance < NEAR * (right - left)))
        return node, panel

    def arcs(self, rho: Array, panel: Indices, count: int) -> tuple[Array, Array]:
        """Nodes tau = rho sin(theta) on panels below targets rho, and weights of ∫ dtheta; (pairs, count) each."""
        end = np.arcsin(np.minimum(1.0, self.edges[panel + 1] / rho))
        theta, weights = gauss_between(np.arcsin(self.edges[panel] / rho), end, count)
        return rho[:, None] * np.sin(theta), weights

    def angles(self, a: float, rho: Array, count: int) -> tuple[Array, Array]:
        """Nodes theta on the innermost panel, t = r sin(theta), for targets rho, and weights; (M, count) each."""
        upper = np.minimum(rho, self.innermost)
        end = np.arctan2(np.hypot(a, upper), np.sqrt(np.maximum(rho**2 - upper**2, 0.0)))
        return gauss_between(np.arctan2(a, rho), end, count)

    def moments(self, points: Array, panel: Indices, factors: Array) -> Array:
        """Weights of the panel's nodal values in ``Σ_m factors · f(points)``; (pairs, m) -> (pairs, order)."""
        local = (points - self.edges[panel][:, None]) / self.half[panel][:, None] - 1.0
        values = legendre_values(self.order, local)
        return np.asarray(np.einsum("kpm,pm->pk", values, factors) @ self.rule.to_legendre)

    def _fill(self, matrix: Array, node: Indices, panel: Indices, rows: Array) -> None:
        matrix.reshape(self.size, self.panels, self.order)[node, panel] = rows

    def _plane(self) -> Array:
        x = self.nodes
        difference = x[:, None] ** 2 - x[None, :] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            matrix = np.where(difference > 0, (2 / np.pi) * self.weights / np.sqrt(difference), 0.0)
        node, panel = self._pairs(above=False)
        # tau = rho sin(theta) removes the half-order weight and leaves a polynomial in sin(theta).
        tau, weights = self.arcs(x[node], panel, self.order + 6)
        self._fill(matrix, node, panel, self.moments(tau, panel, (2 / np.pi) * weights))
        matrix.reshape(self.size, self.panels, self.order)[self.edges[None, :-1] >= x[:, None]] = 0.0
        return matrix

    def _abel(self) -> Array:
        x = self.nodes
        difference = x[None, :] ** 2 - x[:, None] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            matrix = np.where(difference > 0, 2 * self.weights * x / np.sqrt(difference), 0.0)
        node, panel = self._pairs(above=True)
        for inner, count in ((True, 2 * self.order + 16), (False, self.order + 10)):
            # sigma = tau cosh(y) removes the weight; seen from the innermost nodes the range of y is long.
            pick = (panel == 0) == inner
            rows, cols = node[pick], panel[pick]
            tau = x[rows]
            start = np.arccosh(np.maximum(1.0, self.edges[cols] / tau))
            end = np.arccosh(self.edges[cols + 1] / tau)
            y, weights = gauss_between(start, end, count)
            sigma = tau[:, None] * np.cosh(y)
            self._fill(matrix, rows, cols, self.moments(sigma, cols, 2 * weights * sigma))
        matrix.reshape(self.size, self.panels, self.order)[self.edges[None, 1:] <= x[:, None]] = 0.0
        return matrix

    # -- fields on the mesh -------------------------------------------------------------------------------------------
    def interpolate(self, values: Array, points: Array) -> Array:
        """Values at `points` of the panel polynomials through nodal `values`; 0 beyond the last edge."""
        panel, local = self._locate(points)
        coefficients = values.reshape(self.panels, self.order) @ self.rule.to_legendre.T
        inside = np.einsum("kp,pk->p", legendre_values(self.order, local), coefficients[panel])
        return np.where(points <= self.edges[-1], inside, 0.0)

    def derivative(self, values: Array) -> Array:
        """Derivative with respect to tau, at the nodes, of the panel polynomials through nodal values; (N,)."""
        slopes = values.reshape(self.panels, self.order) @ self.rule.derivative.T
        return np.asarray((slopes / self.half[:, None]).ravel())

    def _locate(self, points: Array) -> tuple[Indices, Array]:
        """Panel of each point and its place there, in [−1, 1]; points beyond the mesh belong to the last panel."""
        panel = np.clip(np.searchsorted(self.edges, points, side="right") - 1, 0, self.panels - 1)
        return panel, (points - self.edges[panel]) / self.half[panel] - 1.0
