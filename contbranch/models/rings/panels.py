"""Panels between free boundaries, and the elastic displacement that the pressure on them causes.

Fields have half-order edges at the free boundaries ``e``: they are smooth in ``y = √|r − e|``, so the panels carry
Gauss–Legendre nodes in y. The displacement is the integral over rings of pressure,

    w(r) = ∫ k(r, s) p(s) ds,     k = (4/πE) s K(m)/(r + s),     m = 4rs/(r + s)²,
    ∂k/∂s = (2/πE) (K(m)/(r + s) + E(m)/(r − s))

(K, E(m): complete elliptic integrals), with the logarithm at s = r integrated by nodes that cluster there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from contbranch.arrays import Array, Indices
from contbranch.models.quadrature import gauss, legendre_values, panel_rule

__all__ = ["Grid", "Panels"]

# Panels whose distance from a target exceeds this multiple of their length are integrated with their own nodes.
NEAR = 1.0
# Exponent of the substitution that clusters nodes at the logarithm, and Gauss nodes beyond twice the panel's: the lift
# by a panel ten thousand times longer than another is right to 3e-12 there.
CLUSTER, MORE = 4, 16
# Radii of which pairs are taken at a time.
TILE = 64


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
    front : float
        The gap at a front, 0 without. That is an anchor like an edge, beyond all of these: where the gap rises steeply
        it has panels that move with it.
    """

    order: int
    halves: tuple[tuple[float, ...], ...]
    outer: tuple[float, ...] = ()
    infinite: bool = True
    front: float = 0.0


@cache
def clustered(order: int) -> tuple[Array, Array, Array]:
    """Rules on [0, 1] whose nodes cluster: at 0, at 1, and at every node of a panel, from below and from above.

    Returns
    -------
    places, weights : array (K, m)
    values : array (K, m, n)
        What takes the nodal values of a panel to the places.
    """
    rule = panel_rule(order)
    z, w = gauss(2 * order + MORE)
    u = ((z + 1) / 2) ** CLUSTER
    density = CLUSTER * ((z + 1) / 2) ** (CLUSTER - 1) * w / 2
    node = (rule.nodes[:, None] + 1) / 2
    places = np.concatenate([[u, 1 - u], node * (1 - u), node + (1 - node) * u])
    weights = np.concatenate([[density, density], node * density, (1 - node) * density])
    values = np.moveaxis(legendre_values(order, 2 * places - 1), 0, -1) @ rule.to_legendre
    return places, weights, values


class Near(NamedTuple):
    """Pairs of a target and a panel whose logarithm needs nodes of its own, in the order of their rules.

    Attributes
    ----------
    target, panel : integer array (pairs,)
    radius, weight : array (pairs, m)
        Nodes, and weights of ∫ ds.
    share : array (pairs, m)
        K(m)/(r + s).
    parts : list of slice
        The pairs of each rule, see `clustered`.
    """

    target: Indices
    panel: Indices
    radius: Array
    weight: Array
    share: Array
    parts: list[slice]


class Grid:
    """Panels for given edges: nodes, weights, the elastic response and its derivatives with respect to the edges.

    Attributes
    ----------
    anchors, edges : array (A,), (E,)
        The edges and the front, and the edges.
    r, weights : array (N,)
        Radii of the nodes, and weights of ∫ dr.
    region : integer array (P,)
        Region of each panel.
    breaks : array (P, 2)
        Inner and outer radius of each panel.
    moves, stretch : array (A, P)
        Derivatives of the inner radius with respect to the anchors, and those of r − inner, relative to it.
    """

    def __init__(self, panels: Panels, anchors: Array, bounded: bool) -> None:
        self.panels = panels
        self.order = panels.order
        self.rule = panel_rule(panels.order)
        self.anchors, self.edges = anchors, anchors[: len(anchors) - (panels.front > 0)]
        self._cut(bounded)
        x = np.broadcast_to((self.rule.nodes + 1) / 2, (self.count, self.order))
        radius, slope = self._map(np.arange(self.count)[:, None], x)
        self.r: Array = radius.ravel()
        self.weights: Array = (slope * self.rule.weights / 2).ravel()
        self.size = len(self.r)
        self._pairs: tuple[Array, Near] | None = None

    # -- geometry -----------------------------------------------------------------------------------------------------
    def _cut(self, bounded: bool) -> None:
        """Panels from the centre outwards: region, anchor, sign (+1: r = anchor + y², −1, 0: y itself, 2: end/r), y
        range."""
        edges, count = self.anchors, len(self.anchors)
        unit = np.eye(count)
        # Region, sign, derivatives of the anchor and of the far end of the piece, and shares of the root of its length.
        rows: list[tuple[int, int, Array, Array, float, float]] = []
        halves = iter(self.panels.halves)

        def piece(region: int, move: Array, far_move: Array, sign: int) -> None:
            """Panels between an anchor and the far end of its piece, from the centre outwards."""
            shares = (0.0, *next(halves), 1.0)[::sign]
            rows.extend((region, sign, move, far_move, a, b) for a, b in itertools.pairwise(shares))

        for region, move in enumerate(unit):
            if region == 0:
                piece(0, move, 0 * move, -1)
                continue
            middle = (unit[region - 1] + move) / 2
            piece(region, unit[region - 1], middle, 1)
            piece(region, move, middle, -1)
        if not bounded:
            move = unit[-1] if count else np.zeros(0)
            y = (0.0, *self.panels.outer)
            rows.extend((count, 1 if count else 0, move, move, a, b) for a, b in itertools.pairwise(y))
            if self.panels.infinite:
                rows.append((count, 2, move, move, 0.0, 1.0))
        self.count = len(rows)
        self.region, self.sign, moves, far_moves, a, b = (np.array(column) for column in zip(*rows, strict=True))
        sign, anchor = self.sign, moves @ edges
        length = np.where(self.region == count, 1.0, far_moves @ edges - anchor)
        root = np.sqrt(np.abs(length))
        self.start, self.stop = a * root, b * root
        ends = np.where(sign == 0, 1.0, length) * np.where(sign == 0, [a, b], np.square([a, b])) + anchor
        self.inner, self.outer = ends
        if self.sign[-1] == 2:
            anchor[-1] = self.inner[-1] = self.outer[-2]
            self.outer[-1] = math.inf
        self.anchor, self.breaks = anchor, ends.T
        stretched = (far_moves - moves).T
        self.moves = moves.T + stretched * a**2
        with np.errstate(invalid="ignore", divide="ignore"):  # the last panel may be infinite, or begin at 0
            self.length = np.where(sign == 2, self.inner, self.outer - self.inner)
            self.stretch = np.where(sign == 2, self.moves / self.inner, stretched * (b**2 - a**2) / self.length)
        self.region = np.minimum(self.region, len(self.edges))
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
        stretch = np.repeat(self.stretch[edge], self.order)
        inner, move = np.repeat(self.inner, self.order), np.repeat(self.moves[edge], self.order)
        return move + stretch * (self.r - inner), stretch

    def divided(self, parts: int) -> tuple[Array, Array, Array]:
        """Nodes on equal parts of every panel, (P, m), weights of ∫ d²r, and what takes nodal values there, (n, m)."""
        x = ((np.arange(parts)[:, None] + (self.rule.nodes + 1) / 2) / parts).ravel()
        radius, slope = self._map(np.arange(self.count)[:, None], x)
        area = math.pi / parts * np.tile(self.rule.weights, parts) * radius * slope
        return radius, area, self.rule.to_legendre.T @ legendre_values(self.order, 2 * x - 1)

    # -- elastic response ---------------------------------------------------------------------------------------------
    def _near(self, r: Array) -> NDArray[np.bool_]:
        """Which panels are near radii, (M, P)."""
        distance = np.maximum(0.0, np.maximum(self.inner - r[:, None], r[:, None] - self.outer))
        return np.asarray(distance < NEAR * self.length)

    def _shares(self) -> tuple[Array, Near]:
        """K(m)/(r + s) between all nodes, (N, N), and the pairs of nodes and panels near each other."""
        if self._pairs is None:
            target, panel = np.nonzero(self._near(self.r))
            own, node = panel == target // self.order, target % self.order
            # At the end nearest to the target; the panels' x runs from the centre outwards.
            rule = np.where(own, 2 + node, self.r[target] > self.outer[panel] - 1e-300)
            target, panel = np.append(target, target[own]), np.append(panel, panel[own])
            rule = np.append(rule, 2 + self.order + node[own])
            order = np.argsort(rule, kind="stable")
            target, panel, rule = target[order], panel[order], rule[order]
            places, weights, _ = clustered(self.order)
            ends = np.searchsorted(rule, np.arange(len(places) + 1))
            radius, slope = self._map(panel[:, None], places[rule])
            parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
            near = _share(self.r[target][:, None], radius)
            pairs = Near(target, panel, radius, slope * weights[rule], near, parts)
            self._pairs = _among(_share, self.r), pairs
        return self._pairs

    def forget(self) -> None:
        """Drop what has been kept to save work; it is made again when it is asked for."""
        self._pairs = None

    def response(self) -> Array:
        """W with ``w = W @ p`` at the nodes, (N, N)."""
        shares, near = self._shares()
        matrix = shares * ((4 / np.pi) * self.r * self.weights)
        factor = (4 / np.pi) * near.radius * near.share * near.weight
        view = matrix.reshape(self.size, self.count, self.order)
        view[near.target, near.panel] = 0.0
        for part, values in zip(near.parts, clustered(self.order)[2], strict=True):
            view[near.target[part], near.panel[part]] += factor[part] @ values
        return matrix

    def moved(self, pressure: Array) -> Array:
        """d(W @ p)/d(edges) at fixed nodal pressures, targets moving with their nodes, (N, E)."""
        if len(self.anchors) == 0:
            return np.zeros((self.size, 0))
        shares, near = self._shares()
        r, weighted = self.r[:, None], (pressure * self.weights)[:, None]
        shares, rates = shares.copy(), 0.5 * (shares + _among(_second, self.r, -1))
        for kernel in (shares, rates):
            kernel.reshape(self.size, self.count, self.order)[near.target, near.panel] = 0.0
        motion, stretched = np.moveaxis(np.array([self.motion(k) for k in range(len(self.anchors))]), 0, -1)
        far = rates @ (weighted * motion) + shares @ (r * weighted * stretched)
        # The kernel has no length: what it gains where s moves it loses where r moves along.
        far = (4 / np.pi) * (far - motion * (rates @ (r * weighted) / r))
        nodal = pressure.reshape(self.count, self.order)[near.panel]
        density = near.weight.copy()
        for part, values in zip(near.parts, clustered(self.order)[2], strict=True):
            density[part] *= nodal[part] @ values.T
        sources = near.radius, near.radius - self.inner[near.panel][:, None]
        flat, shape = near.target * self.count + near.panel, (self.size, self.count)
        target, inner, stretch = (
            np.bincount(flat, own, self.size * self.count).reshape(shape)
            for own in _moved(self.r[near.target][:, None], sources, near.share, density)
        )
        return np.asarray(far + target.sum(axis=1)[:, None] * motion + inner @ self.moves.T + stretch @ self.stretch.T)

    def at_edge(self, edge: int, pressure: Array) -> tuple[Array, Array]:
        """Row of the elastic displacement at an edge, (N,), and its derivatives with respect to the edges, (E,)."""
        row, (_, panel, radius, carried) = self._rows(self.anchors[edge : edge + 1])
        r, nodal = np.array([[self.anchors[edge]]]), pressure.reshape(self.count, self.order)
        near = np.einsum("pmk,pk->pm", carried, nodal[panel])
        far = nodal * self.weights.reshape(nodal.shape)
        far[panel] = 0.0
        s, moved = self.r.reshape(nodal.shape), np.zeros(len(self.anchors))
        for k, t, c in ((slice(None), s, far), (panel, radius, near)):
            target, inner, stretch = _moved(r, (t, t - self.inner[k][:, None]), _share(r, t), c)
            moved += self.moves[:, k] @ inner + self.stretch[:, k] @ stretch
            moved[edge] += target.sum()
        return row[0], moved

    def lift_at(self, radii: Array, pressure: Array) -> Array:
        """Elastic displacement at radii above zero wherever they lie, (M,)."""
        return np.asarray(self._rows(radii)[0] @ pressure)

    def _rows(self, radii: Array) -> tuple[Array, tuple[Indices, Indices, Array, Array]]:
        """Rows of the displacement at radii, (M, N), the pairs of radii and panels near them, nodes on both sides of
        the radius in each, and what takes nodal values to values times ds at these nodes, (pairs, m, n)."""
        r = radii[:, None]
        target, panel = np.nonzero(self._near(radii))
        x = np.clip(self.place(panel, radii[target]), 0.0, 1.0)[:, None]
        u, density = (rule[0] for rule in clustered(self.order)[:2])
        places = np.concatenate([x * (1 - u), x + (1 - x) * u], axis=1)
        s, slope = self._map(panel[:, None], places)
        weights = slope * np.concatenate([x * density, (1 - x) * density], axis=1)
        values = np.moveaxis(legendre_values(self.order, 2 * places - 1), 0, -1) @ self.rule.to_legendre
        carried = values * weights[:, :, None]
        rows = (4 / np.pi) * self.r * self.weights * _share(r, self.r)
        kernel = (4 / np.pi) * s * _share(r[target], s)
        rows.reshape(len(radii), self.count, self.order)[target, panel] = np.einsum("pm,pmn->pn", kernel, carried)
        return rows, (target, panel, s, carried)

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
        """Values at radii of the panels' polynomials; `region` says on which side of an edge each radius lies.

        On the panel to infinity that is one of r³ times the values: what it makes of a pressure has a finite load.
        """
        panel, rows, _ = self._at(points, region)
        nodal = values * self._cubed(np.repeat(np.arange(self.count), self.order), self.r)
        result = np.einsum("kp,pk->p", rows, self.coefficients(nodal)[panel]) / self._cubed(panel, points)
        return np.where(points > self.breaks[-1, 1], 0.0, result)

    def _cubed(self, panel: Indices, r: Array) -> Array:
        """The cube of radii on the panel to infinity, in units of its inner end; 1 elsewhere."""
        far = self.sign[panel] == 2
        return np.asarray(np.divide(r, self.inner[panel], out=np.ones(r.shape), where=far) ** 3)

    def slopes(self, values: Array, points: Array, region: Indices | None = None) -> Array:
        """Derivatives with respect to r of the panels' polynomials, at radii."""
        panel, rows, slope = self._at(points, region)
        rates = self.coefficients((values.reshape(self.count, -1) @ self.rule.derivative.T).ravel())
        return np.asarray(2 * np.einsum("kp,pk->p", rows, rates[panel]) / slope)

    def motions(self, rates: Array, points: Array, region: Indices | None = None) -> Array:
        """Velocities of the panels' points at radii where the anchors move with given ones."""
        panel = self._at(points, region)[0]
        return np.asarray((rates @ self.moves)[panel] + (rates @ self.stretch)[panel] * (points - self.inner[panel]))

    def _at(self, points: Array, region: Indices | None) -> tuple[Indices, Array, Array]:
        """Panels of radii, the Legendre polynomials there, (n, M), and dr/dx."""
        panel = np.clip(np.searchsorted(self.breaks[:, 1], points, side="left"), 0, self.count - 1)
        if region is not None:
            first = np.searchsorted(self.region, region, side="left")
            last = np.searchsorted(self.region, region, side="right") - 1
            panel = np.clip(panel, np.minimum(first, self.count - 1), np.maximum(last, 0))
        x = np.clip(self.place(panel, points), 0.0, 1.0)
        return panel, legendre_values(self.order, 2 * x - 1), self._map(panel, x)[1]

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


def _among(function: Callable[[Array, Array], Array], r: Array, sign: int = 1) -> Array:
    """A symmetric (sign −1: antisymmetric) function between all radii, (N, N), each pair once."""
    values = np.empty((len(r), len(r)))
    for k in range(0, len(r), TILE):
        own, others = slice(k, k + TILE), slice(k, None)
        values[own, others] = function(r[own, None], r[others])
        values[others, own] = sign * values[own, others].T
    return values


def _share(r: Array, s: Array) -> Array:
    """K(m)/(r + s); 0 where it is infinite."""
    total = r + s
    with np.errstate(invalid="ignore", divide="ignore"):
        value = scipy.special.ellipkm1(((r - s) / total) ** 2) / total
    value[~np.isfinite(value)] = 0.0
    return np.asarray(value)


def _second(r: Array, s: Array) -> Array:
    """E(m)/(r − s); 0 where it is infinite."""
    apart = r - s
    value = scipy.special.ellipe(1 - (apart / (r + s)) ** 2)
    return np.divide(value, apart, out=np.zeros(apart.shape), where=apart != 0.0)


def _moved(r: Array, sources: tuple[Array, Array], share: Array, carried: Array) -> tuple[Array, Array, Array]:
    """Parts of the derivative of ∫ k p ds over panels (the last axis) with respect to motions.

    Those of the target r, of the panels' inner ends, and stretching, where s moves in proportion to its distance from
    there; `sources` are s and that distance. The kernel has no length: what it gains where s moves it loses where r
    moves along.
    """
    s, beyond = sources
    source = (2 / np.pi) * (share + _second(r, s)) * carried
    stretch = source * beyond + (4 / np.pi) * share * s * carried
    return -(s / r * source).sum(axis=-1), source.sum(axis=-1), stretch.sum(axis=-1)
