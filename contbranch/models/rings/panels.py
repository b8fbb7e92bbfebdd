"""Panels between free boundaries, and the elastic displacement that the pressure on them causes.

Fields have half-order edges at the free boundaries ``e``: they are smooth in ``y = √|r − e|``, so the panels carry
Gauss–Legendre nodes in y. The displacement is the integral over rings of pressure,

    w(r) = ∫ k(r, s) p(s) ds,     k = (4/πE) s K(m)/(r + s),     m = 4rs/(r + s)²

(K(m): complete elliptic integral), with the logarithm at s = r integrated by nodes that cluster there. Where panels
move with velocities ṡ and carry their pressures along, w changes at a given place by ``[k p ṡ] − ∫ k p′ ṡ ds``, the
bracket summed over the panels' ends; and since k has no length, ``r w′ = ∫ k (s p)′ ds − [k s p]``: where panels are
far away, no derivative of k is needed.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy

from contbranch.arrays import Array, Flags, Indices
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


Rules = list[tuple[slice, Array]]


class Near(NamedTuple):
    """Pairs of a target and a panel whose logarithm needs nodes of its own, those of one rule after those of another.

    Attributes
    ----------
    target, panel : integer array (pairs,)
    radius, weight : array (pairs, m)
        Nodes, and weights of ∫ ds.
    share : array (pairs, m)
        K(m)/(r + s).
    rules : list of (slice, array (m, n))
        Pairs, and what takes the nodal values of their panels to the nodes.
    outer : integer array (K,)
        Pairs with the panel to infinity, where the polynomial is one of r³ times the values.
    cubes, fading : array (n,), (K, m)
        r³ at its nodes, and 1/r³ at those of the pairs, in units of its inner end.
    """

    target: Indices
    panel: Indices
    radius: Array
    weight: Array
    share: Array
    rules: Rules
    outer: Indices
    cubes: Array
    fading: Array

    def values(self, nodal: Array) -> Array:
        """What panels have at their nodes, (P, n), at the pairs' nodes, (pairs, m)."""
        own, found = nodal[self.panel], np.empty(self.share.shape)
        own[self.outer] *= self.cubes
        for part, values in self.rules:
            found[part] = own[part] @ values.T
        found[self.outer] *= self.fading
        return found

    def put(self, far: Array, order: int) -> None:
        """Rows (M, N) that take nodal pressures to displacements, right but where panels are near, put right there."""
        factor = (4 / np.pi) * self.radius * self.share * self.weight
        rows = np.empty((len(factor), order))
        factor[self.outer] *= self.fading
        for part, values in self.rules:
            rows[part] = factor[part] @ values
        rows[self.outer] *= self.cubes
        view = far.reshape(len(far), -1, order)
        view[self.target, self.panel] = 0.0
        np.add.at(view, (self.target, self.panel), rows)


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
        sign, anchor, a, span = self.sign[panel], self.anchor[panel], self.start[panel], (self.stop - self.start)[panel]
        bend, far = np.where(sign == 2, 0, sign), sign == 2
        y = a + span * x
        radius, slope = anchor + y * (bend * y + (sign == 0)), span * (2 * bend * y + (sign == 0))
        if far.any():
            with np.errstate(divide="ignore"):
                radius, slope = np.where(far, anchor / (1 - x), radius), np.where(far, anchor / (1 - x) ** 2, slope)
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
    def _near(self, r: Array) -> Flags:
        """Which panels are near radii, (M, P); that to infinity is near all within."""
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
            places, weights, values = clustered(self.order)
            ends = np.searchsorted(rule, np.arange(len(places) + 1))
            rules = [(slice(*pair), own) for pair, own in zip(itertools.pairwise(ends), values, strict=True)]
            near = self._near_pairs(self.r, target, panel, places[rule], weights[rule], rules)
            self._pairs = _among(self.r), near
        return self._pairs

    def _near_pairs(self, r: Array, target: Indices, panel: Indices, x: Array, span: Array, rules: Rules) -> Near:
        """Pairs with their nodes, at places x of their panels with weights of ∫ dx, and kernels."""
        radius, slope = self._map(panel[:, None], x)
        outer = np.flatnonzero(self.sign[panel] == 2)
        end = self.inner[-1] if outer.size else 1.0
        cubes, fading = (self.r[-self.order :] / end) ** 3, (end / radius[outer]) ** 3
        share = _share(r[target][:, None], radius)
        return Near(target, panel, radius, slope * span, share, rules, outer, cubes, fading)

    def forget(self) -> None:
        """Drop what has been kept to save work; it is made again when it is asked for."""
        self._pairs = None

    def response(self) -> Array:
        """W with ``w = W @ p`` at the nodes, (N, N)."""
        shares, near = self._shares()
        matrix = shares * ((4 / np.pi) * self.r * self.weights)
        near.put(matrix, self.order)
        return matrix

    def moved(self, pressure: Array) -> Array:
        """d(W @ p)/d(edges) at fixed nodal pressures, targets moving with their nodes, (N, E)."""
        if len(self.anchors) == 0:
            return np.zeros((self.size, 0))
        return self._moved(self.r, self._motions(), *self._shares(), pressure)

    def _motions(self) -> Array:
        """How the nodes move with each of the anchors, (N, A)."""
        return np.transpose([self.motion(k)[0] for k in range(len(self.anchors))])

    def _moved(self, r: Array, motion: Array, shares: Array, near: Near, pressure: Array) -> Array:
        """Derivatives with respect to the anchors of the displacement at radii that move, (M, A) as their `motion`.

        Those of the sums that `response` consists of: of panels near the radius as they are, of the others by parts.
        `shares` is K(m)/(r + s) at the nodes, (M, N).
        """
        away, nodal = np.ones((len(r), self.count)), pressure.reshape(self.count, self.order)
        away[near.target, near.panel] = 0.0
        far = (shares.reshape(len(r), self.count, self.order) * away[:, :, None]).reshape(shares.shape)
        turned = (nodal @ self.rule.derivative.T * self.rule.weights).ravel()  # p′ ds
        density = np.column_stack([self.weights * pressure + self.r * turned, turned[:, None] * self._motions()])
        whole = far @ (self.r[:, None] * density)  # r w′, and less the rates at which w changes
        radii = np.append(self.inner, self.outer[-1] if np.isfinite(self.outer[-1]) else 0.0)  # nothing at infinity
        kernel, steps = _share(r[:, None], radii) * radii, (self.moves, self.moves + self.stretch * self.length)
        for side, end, sign in ((0, -1.0, -1.0), (1, 1.0, 1.0)):
            places = slice(side, side + self.count)
            values = sign * nodal @ self.rule.lagrange(np.array([end]))[0]
            whole -= (kernel[:, places] * away) @ (np.vstack([radii[places], steps[side]]) * values).T
        carried = near.weight * near.values(nodal)
        source = 0.5 * (near.share + _second(r[near.target][:, None], near.radius)) * carried
        own = (near.radius * source).sum(axis=1)
        along = source.sum(axis=1) * self.moves[:, near.panel]
        stretched = source * (near.radius - self.inner[near.panel][:, None])
        stretched += near.share * near.radius * carried
        along += stretched.sum(axis=1) * self.stretch[:, near.panel]
        np.subtract.at(whole, near.target, np.vstack([own, along]).T)
        return (4 / np.pi) * (whole[:, :1] / r[:, None] * motion - whole[:, 1:])

    def at_edge(self, edge: int, pressure: Array) -> tuple[Array, Array]:
        """Row of the elastic displacement at an edge, (N,), and its derivatives with respect to the edges, (E,)."""
        r = self.anchors[edge : edge + 1]
        rows, shares, near = self._rows(r)
        return rows[0], self._moved(r, np.eye(len(self.anchors))[[edge]], shares, near, pressure)[0]

    def lift_at(self, radii: Array, pressure: Array) -> Array:
        """Elastic displacement at radii above zero wherever they lie, (M,)."""
        return self._rows(radii)[0] @ pressure

    def _rows(self, radii: Array) -> tuple[Array, Array, Near]:
        """Rows of the displacement at radii, (M, N), K(m)/(r + s) at the nodes, (M, N), and the pairs of radii and
        panels near them, nodes on both sides of the radius in each."""
        target, panel = np.nonzero(self._near(radii))
        x = np.clip(self.place(panel, radii[target]), 0.0, 1.0)[:, None]
        u, density = (rule[0] for rule in clustered(self.order)[:2])
        places = np.concatenate([x * (1 - u), x + (1 - x) * u], axis=1)
        span = np.concatenate([x * density, (1 - x) * density], axis=1)
        values = np.moveaxis(legendre_values(self.order, 2 * places - 1), 0, -1) @ self.rule.to_legendre
        rules = [(slice(k, k + 1), own) for k, own in enumerate(values)]
        near = self._near_pairs(radii, target, panel, places, span, rules)
        shares = _share(radii[:, None], self.r)
        rows = (4 / np.pi) * self.r * self.weights * shares
        near.put(rows, self.order)
        return rows, shares, near

    # -- fields -------------------------------------------------------------------------------------------------------
    def coefficients(self, values: Array) -> Array:
        """Legendre coefficients of nodal values, (P, n)."""
        return values.reshape(self.count, self.order) @ self.rule.to_legendre.T

    def at_end(self, panel: int, outer: bool) -> Array:
        """Row that extrapolates nodal values to an end of a panel, (N,)."""
        row = np.zeros(self.size)
        row[panel * self.order : (panel + 1) * self.order] = self.rule.lagrange(np.array([1.0 if outer else -1.0]))[0]
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
            return np.where(sign == 2, 1 - anchor / r, x)


def _among(r: Array) -> Array:
    """K(m)/(r + s) between all radii, (N, N), each pair once."""
    values = np.empty((len(r), len(r)))
    for k in range(0, len(r), TILE):
        own, others = slice(k, k + TILE), slice(k, None)
        values[own, others] = _share(r[own, None], r[others])
        values[others, own] = values[own, others].T
    return values


def _share(r: Array, s: Array) -> Array:
    """K(m)/(r + s); 0 where it is infinite."""
    total = r + s
    with np.errstate(invalid="ignore", divide="ignore"):
        value = scipy.special.ellipkm1(((r - s) / total) ** 2) / total
    value[~np.isfinite(value)] = 0.0
    return value


def _second(r: Array, s: Array) -> Array:
    """E(m)/(r − s); 0 where it is infinite."""
    apart = r - s
    value = scipy.special.ellipe(1 - (apart / (r + s)) ** 2)
    return np.divide(value, apart, out=np.zeros(apart.shape), where=apart != 0.0)
