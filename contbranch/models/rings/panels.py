"""Panels between free boundaries, and the elastic displacement that the pressure on them causes.

Fields have half-order edges at the free boundaries ``e``: they are smooth in ``y = √|r − e|``, so the panels carry
Gauss–Legendre nodes in y. The displacement is the integral over rings of pressure,

    w(r) = ∫ k(r, s) p(s) ds,     k = (4/πE) s K(m)/(r + s),     m = 4rs/(r + s)²

(K: complete elliptic integral of the first kind), with the logarithm at s = r integrated by nodes that cluster there.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipkm1

from contbranch.models.quadrature import gauss, legendre_values, panel_rule

__all__ = ["Grid", "Panels"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Panels whose distance from a target exceeds this multiple of their length are integrated with their own nodes.
NEAR = 1.0
# Exponent of the substitution that clusters nodes at the logarithm: with 2n + 8 Gauss nodes its error is 1e-13.
CLUSTER = 4


@dataclass(frozen=True)
class Panels:
    """How the regions are cut into panels, whatever the edges' positions.

    Attributes
    ----------
    order : int
        Nodes a panel.
    halves : tuple of tuple of float
        Breaks ``0 < f < … < 1`` of the pieces between anchors, in shares of the piece's length in y. A first region
        that ends at an edge is one piece, anchored there; a region between two edges consists of two, each anchored at
        its own edge and joined half-way.
    outer : tuple of float
        Breaks ``0 < y`` of the region that reaches to infinity: distances from the last edge are y² (with no edge:
        radii y).
    infinite : bool
        Whether a last panel in end/r takes it to infinity.
    """

    order: int
    halves: tuple[tuple[float, ...], ...]
    outer: tuple[float, ...] = ()
    infinite: bool = True


class Grid:
    """Panels for given edges: nodes, weights, the elastic response and its derivatives with respect to the edges.

    Attributes
    ----------
    r, weights : array (N,)
        Radii of the nodes, and weights of ∫ dr.
    region : integer array (P,)
        Region of each panel.
    breaks : array (P, 2)
        Inner and outer radius of each panel.
    moves : array (E, P, 2)
        Their derivatives with respect to the edges.
    """

    def __init__(self, panels: Panels, edges: Array, bounded: bool) -> None:
        self.panels = panels
        self.order = panels.order
        self.rule = panel_rule(panels.order)
        self.edges = edges
        self._cut(bounded)
        x = np.broadcast_to((self.rule.nodes + 1) / 2, (self.count, self.order))
        radius, slope = self._map(np.arange(self.count)[:, None], x)
        self.r: Array = radius.ravel()
        self.weights: Array = (slope * self.rule.weights / 2).ravel()
        self.size = len(self.r)
        self._near: list[tuple[Indices, Indices, Array, Array]] | None = None

    # -- geometry -----------------------------------------------------------------------------------------------------
    def _cut(self, bounded: bool) -> None:
        """Panels from the centre outwards: region, anchor, sign (+1: r = anchor + y², −1, 0: y itself, 2: end/r), y
        range."""
        edges, count = self.edges, len(self.edges)
        unit = np.eye(count)
        rows: list[tuple[int, float, int, float, float]] = []
        breaks: list[tuple[float, float]] = []
        moves: list[tuple[Array, Array]] = []
        halves = iter(self.panels.halves)

        def piece(region: int, anchor: float, move: Array, far: float, far_move: Array, sign: int) -> None:
            """Panels between an anchor and the far end of its piece, from the centre outwards."""
            shares = np.array([0.0, *next(halves), 1.0])
            if sign < 0:
                shares = shares[::-1]
            root = math.sqrt(abs(far - anchor))
            for a, b in itertools.pairwise(shares):
                rows.append((region, anchor, sign, a * root, b * root))
                breaks.append((anchor + (far - anchor) * a * a, anchor + (far - anchor) * b * b))
                moves.append((move + (far_move - move) * a * a, move + (far_move - move) * b * b))

        for region in range(count):
            edge, move = float(edges[region]), unit[region]
            if region == 0:
                piece(0, edge, move, 0.0, 0 * move, -1)
                continue
            before, before_move = float(edges[region - 1]), unit[region - 1]
            middle, middle_move = (before + edge) / 2, (before_move + move) / 2
            piece(region, before, before_move, middle, middle_move, 1)
            piece(region, edge, move, middle, middle_move, -1)
        if not bounded:
            anchor = float(edges[-1]) if count else 0.0
            move = unit[-1] if count else np.zeros(0)
            sign = 1 if count else 0
            y = np.array([0.0, *self.panels.outer])
            radii = anchor + (y * y if count else y)
            for k in range(len(y) - 1):
                rows.append((count, anchor, sign, y[k], y[k + 1]))
                breaks.append((radii[k], radii[k + 1]))
                moves.append((move, move))
            if self.panels.infinite:
                rows.append((count, float(radii[-1]), 2, 0.0, 1.0))
                breaks.append((float(radii[-1]), math.inf))
                moves.append((move, move))
        self.count = len(rows)
        self.region = np.array([row[0] for row in rows])
        self.anchor = np.array([row[1] for row in rows])
        self.sign = np.array([row[2] for row in rows])
        self.start = np.array([row[3] for row in rows])
        self.stop = np.array([row[4] for row in rows])
        self.breaks = np.array(breaks)
        self.moves = np.array(moves).reshape(self.count, 2, count).transpose(2, 0, 1)
        self.of_node = np.repeat(self.region, self.order)

    def _map(self, panel: Indices, x: Array) -> tuple[Array, Array]:
        """Radius and dr/dx at places x in [0, 1] of panels; shapes broadcast."""
        sign, anchor, a, b = self.sign[panel], self.anchor[panel], self.start[panel], self.stop[panel]
        y = a + (b - a) * x
        root = np.abs(sign) == 1
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = np.where(root, anchor + sign * y * y, np.where(sign == 0, y, anchor / (1 - x)))
            slope = np.where(root, 2 * sign * y * (b - a), np.where(sign == 0, b - a, anchor / (1 - x) ** 2))
        return radius, slope

    def motion(self, edge: int) -> tuple[Array, Array]:
        """∂r/∂(edge) at the nodes and its derivative with respect to r, (N,) each: linear on every panel."""
        shift, rate = self._motion_at(edge, np.repeat(np.arange(self.count), self.order), self.r)
        return shift, rate

    def _motion_at(self, edge: int, panel: Indices, r: Array) -> tuple[Array, Array]:
        inner, outer = self.breaks[panel, 0], self.breaks[panel, 1]
        v, u = self.moves[edge, panel, 0], self.moves[edge, panel, 1]
        infinite = self.sign[panel] == 2
        with np.errstate(invalid="ignore", divide="ignore"):
            rate = np.where(infinite, v / inner, (u - v) / (outer - inner))
        return v + rate * (r - inner), rate

    # -- elastic response ---------------------------------------------------------------------------------------------
    def _near_points(self) -> list[tuple[Indices, Indices, Array, Array]]:
        """(target, panel, x, weight of dx) of the pairs whose logarithm needs its own nodes; x, weight: (pairs, m)."""
        if self._near is None:
            r, inner, outer = self.r[:, None], self.breaks[:, 0], self.breaks[:, 1]
            length = np.where(self.sign == 2, inner, outer - inner)
            distance = np.maximum(0.0, np.maximum(inner - r, r - outer))
            target, panel = np.nonzero(distance < NEAR * length)
            own = panel == target // self.order
            z, w = gauss(2 * self.order + 8)
            u = (z + 1) / 2
            clustered, density = u**CLUSTER, CLUSTER * u ** (CLUSTER - 1) * w / 2
            others, their = target[~own], panel[~own]
            # At the end nearest to the target; the panels' x runs from the centre outwards.
            far_side = self.r[others] > self.breaks[their, 1] - 1e-300
            x = np.where(far_side[:, None], 1 - clustered, clustered)
            found = [(others, their, x, np.broadcast_to(density, x.shape))]
            mine, self_panel = target[own], panel[own]
            place = ((self.rule.nodes + 1) / 2)[mine % self.order][:, None]
            found.append((mine, self_panel, place * (1 - clustered), place * density))
            found.append((mine, self_panel, place + (1 - place) * clustered, (1 - place) * density))
            self._near = found
        return self._near

    def response(self) -> Array:
        """W with ``w = W @ p`` at the nodes, (N, N)."""
        r, s = self.r[:, None], self.r[None, :]
        matrix = _kernel(r, s) * self.weights
        view = matrix.reshape(self.size, self.count, self.order)
        for k, (target, panel, x, density) in enumerate(self._near_points()):
            radius, slope = self._map(panel[:, None], x)
            factor = _kernel(self.r[target][:, None], radius) * slope * density
            values = legendre_values(self.order, 2 * x - 1)
            rows = np.einsum("kpm,pm->pk", values, factor) @ self.rule.to_legendre
            if k == 2:
                view[target, panel] += rows
            else:
                view[target, panel] = rows
        return matrix

    def moved(self, pressure: Array) -> Array:
        """d(W @ p)/d(edges) at fixed nodal pressures, targets moving with their nodes, (N, E)."""
        edges = len(self.edges)
        result = np.zeros((self.size, edges))
        if edges == 0:
            return result
        panel_of = np.repeat(np.arange(self.count), self.order)
        at_nodes = [self._motion_at(e, panel_of, self.r) for e in range(edges)]
        far = np.ones((self.size, self.count), dtype=bool)
        coefficients = pressure.reshape(self.count, self.order) @ self.rule.to_legendre.T
        for target, panel, x, density in self._near_points():
            far[target, panel] = False
            radius, slope = self._map(panel[:, None], x)
            p = np.einsum("kpm,pk->pm", legendre_values(self.order, 2 * x - 1), coefficients[panel])
            carried = p * slope * density
            parts = _shape_parts(self.r[target][:, None], radius)
            for e in range(edges):
                shift, rate = self._motion_at(e, panel[:, None], radius)
                own = at_nodes[e][0][target][:, None]
                terms = _shape_derivative(parts, self.r[target][:, None], radius, own, shift, rate)
                result[:, e] += np.bincount(target, (terms * carried).sum(axis=1), self.size)
        r, s = self.r[:, None], self.r[None, :]
        parts = _shape_parts(r, s)
        carried = np.where(np.repeat(far, self.order, axis=1), pressure * self.weights, 0.0)
        for e in range(edges):
            shift, rate = at_nodes[e]
            result[:, e] += (_shape_derivative(parts, r, s, shift[:, None], shift, rate) * carried).sum(axis=1)
        return result

    def at_edge(self, edge: int, pressure: Array) -> tuple[Array, Array]:
        """Row of the elastic displacement at an edge, (N,), and its derivatives with respect to the edges, (E,)."""
        r = np.array([[self.edges[edge]]])
        row, (panel, radius, carried) = self._row(float(self.edges[edge]))
        moved = np.zeros(len(self.edges))
        near = np.einsum("pmk,pk->pm", carried, pressure.reshape(self.count, self.order)[panel])
        far = pressure * self.weights
        far.reshape(self.count, self.order)[panel] = 0.0
        panel_of = np.repeat(np.arange(self.count), self.order)
        for e in range(len(self.edges)):
            own = np.array([[float(e == edge)]])
            shift, rate = self._motion_at(e, panel[:, None], radius)
            moved[e] = (_shape_derivative(_shape_parts(r, radius), r, radius, own, shift, rate) * near).sum()
            shift, rate = self._motion_at(e, panel_of, self.r)
            s = self.r[None, :]
            moved[e] += (_shape_derivative(_shape_parts(r, s), r, s, own, shift, rate) * far).sum()
        return row, moved

    def lift_at(self, radii: Array, pressure: Array) -> Array:
        """Elastic displacement at radii that lie in no panel, or at the end of one, (M,)."""
        return np.array([float(self._row(float(r))[0] @ pressure) for r in radii])

    def _row(self, radius: float) -> tuple[Array, tuple[Indices, Array, Array]]:
        """Row of the displacement at a radius outside of panels; the near panels, their nodes for it, and what takes
        nodal values to values times ds at these nodes, (panels, m, n)."""
        r = np.array([[radius]])
        inner, outer = self.breaks[:, 0], self.breaks[:, 1]
        length = np.where(self.sign == 2, inner, outer - inner)
        distance = np.maximum(0.0, np.maximum(inner - radius, radius - outer))
        panel = np.flatnonzero(distance < NEAR * length)
        row = (_kernel(r, self.r[None, :]) * self.weights)[0]
        z, w = gauss(2 * self.order + 8)
        u = (z + 1) / 2
        below = np.abs(outer - radius)[panel] < np.abs(inner - radius)[panel]
        x = np.where(below[:, None], 1 - u**CLUSTER, u**CLUSTER)
        density = CLUSTER * u ** (CLUSTER - 1) * w / 2
        s, slope = self._map(panel[:, None], x)
        values = legendre_values(self.order, 2 * x - 1)
        carried = np.einsum("kpm,kn->pmn", values, self.rule.to_legendre) * (slope * density)[:, :, None]
        row.reshape(self.count, self.order)[panel] = np.einsum("pm,pmn->pn", _kernel(r, s), carried)
        return row, (panel, s, carried)

    # -- fields -------------------------------------------------------------------------------------------------------
    def coefficients(self, values: Array) -> Array:
        """Legendre coefficients of nodal values, (P, n)."""
        return np.asarray(values.reshape(self.count, self.order) @ self.rule.to_legendre.T)

    def at_end(self, panel: int, outer: bool) -> Array:
        """Row that extrapolates nodal values to an end of a panel, (N,)."""
        row = np.zeros(self.size)
        ends = legendre_values(self.order, np.array([1.0 if outer else -1.0]))[:, 0]
        row[panel * self.order : (panel + 1) * self.order] = ends @ self.rule.to_legendre
        return row

    def interpolate(self, values: Array, points: Array, region: Indices | None = None) -> Array:
        """Values at radii of the panels' polynomials; `region` says on which side of an edge each radius lies."""
        panel = np.clip(np.searchsorted(self.breaks[:, 1], points, side="left"), 0, self.count - 1)
        if region is not None:
            first = np.searchsorted(self.region, region, side="left")
            last = np.searchsorted(self.region, region, side="right") - 1
            panel = np.clip(panel, np.minimum(first, self.count - 1), np.maximum(last, 0))
        x = np.clip(self.place(panel, points), 0.0, 1.0)
        rows = legendre_values(self.order, 2 * x - 1)
        result = np.einsum("kp,pk->p", rows, self.coefficients(values)[panel])
        return np.where(points > self.breaks[-1, 1], 0.0, result)

    def place(self, panel: Indices, r: Array) -> Array:
        """Place x in [0, 1] of radii on their panels."""
        sign, anchor = self.sign[panel], self.anchor[panel]
        with np.errstate(divide="ignore", invalid="ignore"):
            y = np.where(np.abs(sign) == 1, np.sqrt(np.maximum(sign * (r - anchor), 0.0)), r)
            x = (y - self.start[panel]) / (self.stop[panel] - self.start[panel])
            return np.asarray(np.where(sign == 2, 1 - anchor / r, x))

    def sample(self, panel: int, x: Array) -> Array:
        """Radii at places x of a panel."""
        return self._map(np.full(x.shape, panel), x)[0]


def _kernel(r: Array, s: Array) -> Array:
    total = r + s
    q = (r - s) / total
    with np.errstate(invalid="ignore", divide="ignore"):
        value = (4 / np.pi) * s / total * ellipkm1(q * q)
    return np.asarray(np.where(np.isfinite(value), value, 0.0))


def _shape_parts(r: Array, s: Array) -> tuple[Array, Array]:
    """K(m) and [E(m) − (1 − m) K(m)] / (2 (r − s))."""
    q = (r - s) / (r + s)
    m1 = q * q
    with np.errstate(invalid="ignore", divide="ignore"):
        first = ellipkm1(m1)
        first = np.where(np.isfinite(first), first, 0.0)
        quotient = (ellipe(1 - m1) - m1 * first) / (2 * (r - s))
    return first, np.where(np.isfinite(quotient), quotient, 0.0)


def _shape_derivative(parts: tuple[Array, Array], r: Array, s: Array, v: Array, u: Array, rate: Array) -> Array:
    """d(k ds)/de / ds where the target moves with v and the source with u(s), ``du/ds = rate``."""
    first, quotient = parts
    total = r + s
    inner = s * (quotient * (u / s - v / r) - first * (v + u) / total**2)
    return np.asarray((4 / np.pi) * (inner + first / total * (u + s * rate)))
