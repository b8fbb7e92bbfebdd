"""Panels of Gauss–Legendre nodes, and the two Abel integrals on them.

With the rim radius ``a`` and the coordinates ``tau = sqrt(t² − a²)`` and ``rho = sqrt(r² − a²)`` the kernels lose the
rim:
``√(r² − t²) = √(rho² − tau²)`` and ``s ds = sigma dsigma``. So the matrices below are computed once per mesh, and a
moving rim only scales columns by ``tau/t``.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array, Flags, Indices
from contbranch.models.quadrature import (
    chebyshev_values,
    gauss,
    gauss_between,
    half_order_rule,
    panel_rule,
    rooted_coefficients,
    rooted_derivative,
    rooted_rule,
    rooted_values,
)
from contbranch.watch import check

__all__ = ["Mesh", "mesh_on"]

# A source panel closer to the target than this many of its own lengths is integrated with the kernel's substitution;
# farther away the kernel is analytic in a Bernstein ellipse of parameter > 5.8 and the panel's own nodes suffice.
NEAR = 1.0
# ... or, if it has a root, closer than this many.
NEAR_ROOT = 3.0
# On a panel this many of its half lengths from the mirror image of a target the kernel's other root is smooth.
SMOOTH = 3.0
# Gauss nodes, besides twice a panel's, where a substitution leaves a long range.
LONG = 16
# Further Gauss nodes for the smooth factor of a kernel, and for x log x next to an edge, as a multiple of a panel's.
SMOOTH_FACTOR, LOGARITHM = 12, 2
# Powers of `rooted_values` for h and for its slope, times the rate of distances.
OF_VALUES, OF_SLOPES = 3, 1
# Meshes that are kept.
MESHES = 16
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
    bounded : bool
        Whether there is nothing beyond the last edge, where functions then end like square roots.
    roots : tuple of int
        Indices of edges at which functions on either side are polynomials in the square root of the distance, and
        those that `plane` integrates have x log x besides; at least 2, and no panel has two of them.

    Attributes
    ----------
    root : array (P,)
        −1 on panels with a root at their inner end, 1 at their outer end, 0 without.
    shares, stretching : array (P, n)
        Where nodes are on their panels, as shares of the panel's length, and the derivative of that in ``(z + 1)/2``.
    scale : array (P, n)
        dtau/dz at the nodes; functions are polynomials in z, from −1 to 1 on each panel.
    nodes, weights : array (N,)
        Nodes tau (and rho: they are the same) and Gauss weights; N = P · order.
    plane : array (N, N)
        ``(plane @ f)(rho) = (2/π) ∫_0^rho f(tau) / √(rho² − tau²) dtau``.
    abel : array (N, N)
        ``(abel @ p)(tau) = 2 ∫_tau^∞ sigma p(sigma) / √(sigma² − tau²) dsigma`` (E = 1; nothing beyond the last edge).
    """

    def __init__(self, edges: Array, order: int, bounded: bool = False, roots: tuple[int, ...] = ()) -> None:
        self.bounded, self.roots = bounded, roots
        self.source: tuple[Mesh, float] | None = None  # what it was stretched from, and by how much
        self.edges = np.asarray(edges, dtype=float)
        self.rule = panel_rule(order)
        self.order = order
        self.half = np.diff(self.edges) / 2
        self.panels = len(self.half)
        nodes, weights = gauss_between(self.edges[:-1], self.edges[1:], order)
        if any(k < 2 or k - 1 in roots for k in roots):
            raise ValueError("a panel has a root at either end, or the innermost one has one")
        self.root = np.zeros(self.panels, dtype=np.intp)
        self.root[[k - 1 for k in roots]] = 1
        self.root[[k for k in roots if k < self.panels]] = -1
        u, root = (1 + self.rule.nodes) / 2, self.root[:, None]
        self.shares, self.stretching = _shares(u, root), _stretching(u, root)
        self.scale = self.half[:, None] * self.stretching
        if roots:
            nodes = np.where(root == 0, nodes, self.edges[:-1, None] + 2 * self.half[:, None] * self.shares)
            weights = self.rule.weights * self.scale
        self.nodes, self.weights = nodes.ravel(), weights.ravel()
        self.size = len(self.nodes)
        self.innermost, self.end = float(self.edges[1]), self.edges[-1]
        self.stretch = 1.0

    @cached_property
    def finer(self) -> Mesh:
        """A mesh on which this one's discretisation errors have all but vanished: graded, towards roots, too, longer
        (graded at its other end) and of higher order."""
        if self.source is not None:
            mesh, factor = self.source
            return mesh.finer.stretched(factor)
        order, length = self.order + max(3, self.order // FINER_ORDER_SHARE), 2 * self.half
        inner, outer = self.root < 0, self.root > 0
        inner[0], outer[-1] = True, outer[-1] or self.bounded
        cuts = [(self.edges[:-1] + FINER_GRADING * length)[inner], (self.edges[1:] - FINER_GRADING * length)[outer]]
        longer = [] if self.bounded else [FINER_REACH * self.end]
        edges = np.sort(np.concatenate([self.edges, *cuts, longer]))
        return mesh_on(edges, order, self.bounded, tuple(np.searchsorted(edges, self.edges[list(self.roots)]).tolist()))

    def stretched(self, factor: float) -> Mesh:
        """The mesh with all lengths multiplied by a factor: `plane` stays as it is, and `abel` grows with them."""
        mesh = copy.copy(self)
        mesh.forget()
        for name in ("plane_to_targets", "slopes_to_targets"):
            mesh.__dict__.pop(name, None)
        mesh.source = self, factor
        for name in ("edges", "end", "half", "nodes", "weights", "innermost", "scale", "stretch"):
            setattr(mesh, name, factor * getattr(self, name))
        return mesh

    @cached_property
    def _kernels(self) -> tuple[Array, Array]:
        """`plane`, and `abel` before the mesh was stretched; many a mesh only has nodes to interpolate at."""
        return self.source[0]._kernels if self.source else self._matrices()

    @property
    def plane(self) -> Array:
        """The first integral."""
        return self._kernels[0]

    @property
    def targets(self) -> Array:
        """Where gaps are known: the nodes, and the root edges, (N + R,)."""
        return np.append(self.nodes, self.edges[list(self.roots)]) if self.roots else self.nodes

    @property
    def abel(self) -> Array:
        """The second one in full, which states of a moving mesh do without."""
        return self.stretch * self._kernels[1]

    def abel_of(self, pressure: Array) -> Array:
        """``abel @ pressure``, (N,)."""
        return self.stretch * (self._kernels[1] @ pressure)

    def abel_with(self, weights: Array) -> Array:
        """``abel * weights``, (N, N)."""
        return self._kernels[1] * (self.stretch * weights)

    def abel_drift(self, pressure: Array, edges: Array, nodes: Array) -> Array:
        """Rates of ``abel @ pressure`` where edges and nodes move at rates linear on every panel; (m, P + 1) and
        (m, N) -> (m, N).

        The transform is homogeneous: tau d/dtau of it is that of p + sigma dp/dsigma. Where the panels' polynomials do
        not meet, an edge passes from one to the other.
        """
        slope, relative = self.derivative(pressure), nodes / self.nodes
        rate = relative * self.abel_of(pressure + self.nodes * slope) - (nodes * slope) @ self.abel.T
        return rate + self.passing(2 * self.edges[1:] * self.jumps(pressure), edges, relative, True)

    def jumps(self, values: Array) -> Array:
        """By how much the panels' polynomials are larger than those of the next panel at their outer ends, (P,)."""
        ends = values.reshape(self.panels, self.order) @ self.rule.lagrange(np.array([-1.0, 1.0])).T
        return np.asarray(ends[:, 1] - np.append(ends[1:, 0], 0.0))

    def passing(self, jumps: Array, edges: Array, relative: Array, outwards: bool) -> Array:
        """What jumps at the panels' outer ends add where these pass nodes, or all targets, that move at relative rates,
        in the kernel 1/√|σ² − tau²|, (m, N); of those ends that are farther out, or of the others."""
        ends, nodes = self.edges[1:, None], self.targets[: relative.shape[-1]]
        felt = ends > nodes if outwards else ends < nodes  # a root edge moves with its own target
        kernel = jumps[:, None] * felt / np.sqrt(np.where(felt, np.abs(ends - nodes) * (ends + nodes), 1.0))
        return np.asarray(edges[:, 1:] @ kernel - relative * (self.edges[1:] @ kernel))

    @cached_property
    def to_finer(self) -> Array:
        """Nodal values here -> values of the panels' polynomials at the nodes of `finer`; 0 beyond the last edge."""
        if self.source is not None:
            return self.source[0].to_finer
        points = self.finer.nodes
        panel, rows = self._lagrange(points)
        matrix = np.zeros((len(points), self.panels, self.order))
        matrix[np.arange(len(points)), panel] = rows
        return matrix.reshape(len(points), self.size)

    def before_finer(self, matrix: Array) -> Array:
        """``matrix @ to_finer``, panel by panel; (N, fine nodes) -> (N, nodes)."""
        product, ends = np.empty((len(matrix), self.size)), np.searchsorted(self.finer.nodes, self.edges[1:])
        for k, (begin, end) in enumerate(pairwise([0, *ends[:-1], len(self.finer.nodes)])):
            own = slice(k * self.order, (k + 1) * self.order)
            np.matmul(matrix[:, begin:end], self.to_finer[begin:end, own], out=product[:, own])
        return product

    @cached_property
    def from_finer(self) -> Callable[[Array], Array]:
        """Nodal values on `finer` -> values of its panels' polynomials at the nodes here."""
        return self.finer.sampler(self.nodes)

    def forget(self) -> None:
        """Drop what leads to the finer mesh, which is made again when it is asked for."""
        for name in ("finer", "to_finer", "from_finer"):
            self.__dict__.pop(name, None)

    # -- the matrices -------------------------------------------------------------------------------------------------
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

    def local(self, points: Array, panel: Indices) -> Array:
        """z at points tau of panels; of one shape, or (pairs, m) and (pairs, 1)."""
        local = (points - self.edges[panel]) / self.half[panel] - 1.0
        if self.roots:
            root = self.root[panel]
            away = np.where(root > 0, self.edges[panel + 1] - points, points - self.edges[panel])
            s = np.sqrt(np.maximum(away, 0.0) / (2 * self.half[panel]))
            local = np.where(root == 0, local, root * (1 - 2 * s))
        return np.asarray(local)

    def _projected(self, local: Array, factors: Array) -> Array:
        """Weights of a panel's Chebyshev coefficients in ``Σ_m factors · f(z)``; (pairs, m) -> (pairs, order)."""
        values = chebyshev_values(self.order, local, factors)
        return np.asarray(np.add.reduce(values, axis=2).T)  # whose last digits do not depend on the other rows

    def _matrices(self) -> tuple[Array, Array]:
        """Both Abel integrals: the kernels at the nodes, and blocks for panels close to each other."""
        n, squares = self.order, self.nodes**2
        plane, kernel = np.zeros((2, self.size, self.size))  # the latter transposed
        down, up = (2 / np.pi) * self.weights, 2 * self.weights * self.nodes
        for k in range(n, self.size, n):
            own, rows = np.subtract(squares[k : k + n, None], squares[:k]), slice(k, k + n)
            np.divide(1.0, np.sqrt(own, out=own), out=own)
            np.multiply(own, down[:k], out=plane[rows, :k])
            np.multiply(own, up[rows, None], out=kernel[rows, :k])
        shape, close = (self.panels, n, self.panels, n), self._close
        target, source = np.nonzero(np.tril(close))
        plane.reshape(shape)[target, :, source, :] = self._near(target, source, False)
        target, source = np.nonzero(np.triu(close))
        kernel.reshape(shape)[source, :, target, :] = self._near(target, source, True).transpose(0, 2, 1)
        return plane, kernel.T

    @property
    def _close(self) -> Flags:
        """Whether panels (rows) are close to others (columns), on which the kernel is not smooth then, (P, P)."""
        apart = self.edges[:-1, None] - self.edges[1:]
        near = np.where(self.root == 0, NEAR, NEAR_ROOT) * np.diff(self.edges)
        return np.asarray(np.maximum(apart, apart.T) < near)

    def _near(self, target: Indices, source: Indices, upwards: bool, power: int = OF_VALUES) -> Array:
        """The blocks of either integral for pairs of panels, (pairs, order, order); `power`: see `rooted_values`."""
        n, blocks = self.order, np.empty((len(target), self.order, self.order))
        root, own = (-1 if upwards else 1) * self.root[source], target == source
        smooth = self.edges[source] + self.half[source] + self.edges[target] >= SMOOTH * self.half[source]
        smooth, across = smooth | (root != 0), (root > 0) & ~own
        for same in (True, False):
            for rooted in (True, False) if self.roots else (False,):
                if (pick := np.flatnonzero(smooth & ~across & (own == same) & ((root != 0) == rooted))).size:
                    blocks[pick] = self._smooth(target[pick], source[pick], upwards, same, power)
        if (pick := np.flatnonzero(~smooth)).size:
            nodes, panel = self.nodes.reshape(-1, n)[target[pick]].ravel(), np.repeat(source[pick], n)
            rows = self._up(nodes, panel) if upwards else self._down(nodes, panel)
            blocks[pick] = rows.reshape(-1, n, n) @ self.rule.to_chebyshev
        if (pick := np.flatnonzero(across)).size:
            blocks[pick] = self._across(target[pick], source[pick], upwards, power)
        return blocks * self.stretching[source, None] if self.roots else blocks

    def _smooth(self, target: Indices, source: Indices, upwards: bool, own: bool, power: int) -> Array:
        """The same where 1/√|rho² − tau²| is 1/√|z_rho − z_tau|, whose moments are known in full, times what is smooth.

        Upwards all is seen in a mirror. On panels with a root the differences of squares of the distances from it,
        ``s_rho² − s_tau²``, are products, too.
        """
        sign, bends = -1 if upwards else 1, not upwards and bool(self.root[source].any())
        rule = half_order_rule(self.order, LOGARITHM * self.order if bends else SMOOTH_FACTOR)
        half, nodes = self.half[source][:, None], self.nodes.reshape(-1, self.order)[target]
        root = sign * self.root[source]
        tau = self.edges[source][:, None] + 2 * half * _shares((1 + sign * rule.nodes) / 2, sign * root[:, None])
        factors = 2 * tau if upwards else np.full_like(tau, 2 / np.pi)
        smooth = (np.sqrt(half) * factors)[:, None] / np.sqrt(nodes[:, :, None] + tau[:, None])
        if own:
            weights = rule.own[root]
            weights = weights[:, ::-1] if upwards else weights
        else:
            away = self._beyond(target, source, upwards) / half
            if self.roots:
                away = np.where(root[:, None] == 0, away, away / (1 + np.sqrt(1 + away / 2)))
                rooted = np.flatnonzero(root)
                smooth[rooted] *= np.sqrt(2 / (3 + away[rooted, :, None] + rule.nodes))
            weights = rule.beyond(away)
        if bends:
            values = rooted_rule(self.order, power, len(rule.nodes))
            both = np.where(root[:, None, None] < 0, values, values[::-1, ::-1])
            return np.asarray(np.matmul(weights * smooth, both))
        return np.asarray((weights * smooth) @ (rule.values[:, ::-1] if upwards else rule.values))

    def _across(self, target: Indices, source: Indices, upwards: bool, power: int) -> Array:
        """The same for targets beyond the root of a panel: s = √(distance / length) sinh(y) removes the weight."""
        sign, half = -1 if upwards else 1, self.half[source][:, None, None]
        width = np.sqrt(self._beyond(target, source, upwards) / (2 * half[:, 0]))
        y, weights = gauss_between(np.zeros_like(width), np.arcsinh(1 / width), 2 * self.order + LONG)
        s = width[:, :, None] * np.sinh(y)
        tau = self.edges[source + (not upwards)][:, None, None] - sign * 2 * half * s * s
        factors = 2 * tau if upwards else 2 / np.pi
        weights *= factors * np.sqrt(2 * half / (self.nodes.reshape(-1, self.order)[target][:, :, None] + tau))
        shape = -1, y.shape[-1]
        if upwards:
            rows = self._projected((2 * s - 1).reshape(shape), weights.reshape(shape))
            return np.asarray(rows.reshape(-1, self.order, self.order) @ self.rule.to_chebyshev)
        values = rooted_values(self.order, power, s.reshape(shape), weights.reshape(shape))
        rows = np.add.reduce(values, axis=2).T.reshape(-1, self.order, self.order)
        return np.asarray((rows @ rooted_coefficients(self.order, power))[:, :, ::-1])

    def _beyond(self, target: Indices, source: Indices, upwards: bool) -> Array:
        """Distances of the nodes of panels from the nearer ends of others, (pairs, n); to all their digits."""
        low, high, sign = (target, source, -1) if upwards else (source, target, 1)
        within = _shares((1 + sign * self.rule.nodes) / 2, sign * self.root[target][:, None])
        return np.asarray((self.edges[high] - self.edges[low + 1])[:, None] + 2 * self.half[target][:, None] * within)

    def _down(self, rho: Array, panel: Indices) -> Array:
        """Rows of `plane`: tau = rho sin(theta) removes the weight, and leaves a polynomial in sin(theta)."""
        tau, weights = self.arcs(rho, panel, self.order + 6)
        return self._projected(self.local(tau, panel[:, None]), (2 / np.pi) * weights)

    def _up(self, tau: Array, panel: Indices) -> Array:
        """Rows of `abel`: sigma = tau cosh(y) removes the weight; from the innermost nodes the range of y is long."""
        start = np.arccosh(np.maximum(1.0, self.edges[panel] / tau))
        end = np.arccosh(self.edges[panel + 1] / tau)
        rows = np.empty((len(tau), self.order))
        for inner, count in ((True, 2 * self.order + LONG), (False, self.order + 10)):
            pick = (panel == 0) == inner
            y, weights = gauss_between(start[pick], end[pick], count)
            sigma = tau[pick, None] * np.cosh(y)
            rows[pick] = self._projected(self.local(sigma, panel[pick, None]), 2 * weights * sigma)
        return rows

    @cached_property
    def plane_to_targets(self) -> Array:
        """`plane`, and the same at the root edges, where polynomials of the gap, which goes like x log x, say little;
        (N + R, N)."""
        return self.source[0].plane_to_targets if self.source else self._to_targets(False)

    @cached_property
    def slopes_to_targets(self) -> Array:
        """`plane_to_targets` for slopes of what goes like x log x next to the roots, (N + R, N)."""
        return self.source[0].slopes_to_targets if self.source else self._to_targets(True)

    def _to_targets(self, slopes: bool) -> Array:
        """The first integral with rows of the root edges."""
        if not self.roots:
            return self.plane
        kernel = self.plane
        if slopes:
            target, source = np.nonzero(np.tril(self._close) & (self.root != 0))
            kernel, shape = kernel.copy(), (self.panels, self.order, self.panels, self.order)
            kernel.reshape(shape)[target, :, source, :] = self._near(target, source, False, OF_SLOPES)
        rule, n, rows = self.rule, self.order, np.zeros((len(self.roots), self.size))
        nodes, weights = gauss(2 * n + LONG)
        values, bent = rule.lagrange(nodes), rooted_rule(n, 2, len(nodes))[::-1, ::-1]
        for row, root in zip(rows, self.roots, strict=True):
            for k in range(root):
                kind, direct = self.root[k], slopes and k == root - 1
                z, w = (rule.nodes, rule.weights) if direct else (nodes, weights)
                share = _shares((1 - z) / 2, -kind)  # of the way from the outer end
                away = self.edges[root] - self.edges[k + 1] + 2 * self.half[k] * share
                factor = w * self.half[k] * _stretching((1 + z) / 2, kind)
                factor *= (2 / np.pi) / np.sqrt(away * (2 * self.edges[root] - away))
                own = bent[::kind, ::kind] if kind and not slopes else values
                row[k * n : (k + 1) * n] = factor if direct else factor @ own
        return np.vstack([kernel, rows])

    # -- fields on the mesh -------------------------------------------------------------------------------------------
    def interpolate(self, values: Array, points: Array) -> Array:
        """Values at `points` of the panel polynomials through nodal `values`; 0 beyond the last edge."""
        return self.sampler(points)(values)

    def sampler(self, points: Array) -> Callable[[Array], Array]:
        """What `interpolate` does at `points`, for many functions."""
        panel, rows = self._lagrange(points)
        return lambda values: np.add.reduce(rows * values.reshape(self.panels, self.order)[panel], axis=1)

    def derivative(self, values: Array) -> Array:
        """Derivative with respect to tau, at the nodes, of the panel polynomials through nodal values; (N,)."""
        slopes = values.reshape(self.panels, self.order) @ self.rule.derivative.T
        return (slopes / self.scale).ravel()

    def slope(self, values: Array) -> Array:
        """Derivative of h, which goes like x log x next to a root, with respect to tau, at the nodes; (N,)."""
        slopes = values.reshape(self.panels, self.order) @ self.rule.derivative.T
        if self.roots:
            matrix = rooted_derivative(self.order)
            for sign, own in ((-1, matrix), (1, -matrix[::-1, ::-1])):
                slopes[self.root == sign] = values.reshape(self.panels, self.order)[self.root == sign] @ own.T
        return (slopes / self.scale).ravel()

    def rises(self, values: Array) -> tuple[Array, Array]:
        """Places beyond the innermost panel and by how much h rises around each, for integrals of its slope; (M,)."""
        n, products = self.order, (self.slope(values) * self.scale.ravel()).reshape(self.panels, self.order)
        places, found = self.nodes.reshape(self.panels, n), products * self.rule.weights
        if not self.roots:
            return places[1:].ravel(), found[1:].ravel()
        nodes, weights = gauss((1 + LOGARITHM) * n)
        finely, parts = rooted_rule(n, OF_SLOPES, len(nodes)), []
        for k in range(1, self.panels):
            kind = self.root[k]
            if kind:
                own = finely if kind < 0 else finely[::-1, ::-1]
                shares = _shares((1 + nodes) / 2, kind)
                parts.append((self.edges[k] + 2 * self.half[k] * shares, weights * (own @ products[k])))
            else:
                parts.append((places[k], found[k]))
        return np.concatenate([one[0] for one in parts]), np.concatenate([one[1] for one in parts])

    def row(self, place: float, beyond: bool = False) -> tuple[slice, Array]:
        """The nodes of the panel on which a place lies, of two the inner one unless `beyond`, and their weights in a
        value there."""
        panel = np.searchsorted(self.edges[1:-1], [place], side="right" if beyond else "left")
        nodes = slice(int(panel[0]) * self.order, (int(panel[0]) + 1) * self.order)
        return nodes, self.rule.lagrange(self.local(np.array([place]), panel))[0]

    def _lagrange(self, points: Array) -> tuple[Indices, Array]:
        """Panel of each point, and what it takes of the panel's nodal values: (P,), (P, n); 0 beyond the last edge."""
        panel = np.searchsorted(self.edges[1:-1], points, side="right")
        rows = self.rule.lagrange(self.local(np.minimum(points, self.end), panel))
        rows[points > self.end] = 0.0
        return panel, rows


def mesh_on(edges: Array, order: int, bounded: bool = False, roots: tuple[int, ...] = ()) -> Mesh:
    """The mesh of these edges, one of the last ones if it is known: neighbouring events ask for the same."""
    check()
    return _mesh_on(tuple(edges.tolist()), order, bounded, roots)


def forget() -> None:
    """Forget the last meshes, so that time is measured as in a process of its own."""
    _mesh_on.cache_clear()


@lru_cache(MESHES)
def _mesh_on(edges: tuple[float, ...], order: int, bounded: bool, roots: tuple[int, ...]) -> Mesh:
    return Mesh(np.array(edges), order, bounded, roots)


def _shares(u: Array, root: Indices) -> Array:
    """Where panels' points at u = (1 + z)/2 are, as shares of their lengths from the inner end: u, u² or u(2 − u).

    From the outer end it is the same with 1 − u and −root.
    """
    return np.where(root == 0, u, np.where(root < 0, u * u, u * (2 - u)))


def _stretching(u: Array, root: Indices) -> Array:
    """The derivative of that."""
    return np.where(root == 0, 1.0, np.where(root < 0, 2 * u, 2 * (1 - u)))
