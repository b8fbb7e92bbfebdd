"""Gauss–Legendre panels: nodes, weights, and the polynomials through nodal values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from contbranch.arrays import Array

__all__ = [
    "HalfOrderRule",
    "PanelRule",
    "chebyshev_values",
    "gauss",
    "gauss_between",
    "half_order_rule",
    "legendre_values",
    "panel_rule",
    "rooted_coefficients",
    "rooted_derivative",
    "rooted_rule",
    "rooted_values",
    "start_edges",
]

# Nodes of an integral for a panel's own root per polynomial: the substitution makes them exponentials.
OWN_ROOT = 3


@dataclass(frozen=True)
class PanelRule:
    """What all panels of one order share: nodes on [−1, 1], weights and transforms to polynomial coefficients."""

    order: int
    nodes: Array  # (n,)
    weights: Array  # (n,)
    to_legendre: Array  # (n, n): nodal values -> Legendre coefficients
    to_chebyshev: Array  # (n, n): nodal values -> Chebyshev coefficients
    even_order: int  # number of even polynomials in tau on the innermost panel
    to_even: Array  # (m, n): nodal values -> Chebyshev coefficients in (tau/L)²; least squares
    even_slopes: Array  # (m, m): Chebyshev coefficients -> those of the derivative with respect to the argument
    project_even: Array  # (n, n): nodal values -> values of their even fit at the nodes
    rim: Array  # (n,): nodal values -> value of the even fit at tau = 0
    derivative: Array  # (n, n): nodal values -> derivative at the nodes, on [−1, 1]
    barycentric: Array  # (n,): weights of Lagrange's polynomials in their barycentric form

    def lagrange(self, local: Array) -> Array:
        """The polynomials that are 1 at one node each, at places (P,) on [−1, 1]; (P, n)."""
        away = local[:, None] - self.nodes
        away[away == 0.0] = np.finfo(float).tiny  # on the node itself its own polynomial outweighs all others
        terms = self.barycentric / away
        return np.asarray(terms / np.add.reduce(terms, axis=1)[:, None])


def legendre_values(count: int, x: Array) -> Array:
    """Legendre polynomials 0 … count − 1 at `x`; shape (count, *x.shape)."""
    values = np.empty((count, *x.shape))
    values[0] = 1.0
    if count > 1:
        values[1] = x
    for k in range(1, count - 1):
        np.multiply(x, values[k], out=values[k + 1])
        values[k + 1] *= (2 * k + 1) / (k + 1)
        values[k + 1] -= (k / (k + 1)) * values[k - 1]
    return values


def chebyshev_values(count: int, x: Array, factors: Array | float = 1.0) -> Array:
    """Chebyshev polynomials 0 … count − 1 at `x`, times factors; shape (count, *x.shape)."""
    values = np.empty((count, *x.shape))
    values[0] = factors
    if count > 1:
        np.multiply(x, factors, out=values[1])
    twice = 2 * x
    for k in range(1, count - 1):
        np.multiply(twice, values[k], out=values[k + 1])
        values[k + 1] -= values[k - 1]
    return values


def rooted_values(order: int, power: int, s: Array, factors: Array | float = 1.0) -> Array:
    """Polynomials in s and what ``s^power log s`` has besides these, times factors; shape (order, *s.shape).

    Next to an edge, from which distances are s², the pressure goes like s, h like s² log s, h times their rate like
    s³ log s, and the slope of h times their rate like s log s.
    """
    values = chebyshev_values(order, 2 * s - 1, factors)
    known, scale = _smooth_part(order, power)
    values[-1] = (factors * s**power * np.log(s) - np.tensordot(known, values[:-1], 1)) / scale
    return values


@cache
def _smooth_part(order: int, power: int) -> tuple[Array, float]:
    """Chebyshev coefficients of ``s^power log s`` up to the degree order − 2, and that of the next degree."""
    angles = (np.arange(200) + 0.5) * np.pi / 200
    s = (1 + np.cos(angles)) / 2
    found = 2 * np.cos(np.outer(np.arange(order), angles)) @ (s**power * np.log(s)) / 200
    found[0] /= 2
    return found[:-1], float(found[-1])


@cache
def rooted_coefficients(order: int, power: int) -> Array:
    """Values at the nodes of a panel that begins at an edge -> coefficients of `rooted_values`; (order, order)."""
    values = rooted_values(order, power, (1 + panel_rule(order).nodes) / 2)
    return np.asarray(np.linalg.inv(values.T), dtype=np.float64)


@cache
def rooted_rule(order: int, power: int, count: int) -> Array:
    """Values at the nodes of a panel that begins at an edge -> those at the nodes of another order; (count, order)."""
    return np.asarray(
        rooted_values(order, power, (1 + gauss(count)[0]) / 2).T @ rooted_coefficients(order, power), dtype=np.float64
    )


@cache
def rooted_derivative(order: int) -> Array:
    """Values of h at the nodes of a panel that begins at an edge -> its derivative by z; (order, order)."""
    s = (1 + panel_rule(order).nodes) / 2
    known, scale = _smooth_part(order, 2)
    slopes = np.zeros((order, order))
    slopes[:-1] = chebyshev.chebval(2 * s - 1, chebyshev.chebder(np.eye(order - 1)))
    slopes[-1] = ((2 * np.log(s) + 1) * s / 2 - known @ slopes[:-1]) / scale
    return np.asarray(slopes.T @ rooted_coefficients(order, 2), dtype=np.float64)


@dataclass(frozen=True)
class HalfOrderRule:
    """Integrals with the weight 1/√(x − t) over a panel, t from −1 to 1 or x, of its polynomial times a smooth factor.

    With that factor at the nodes, ``weights * factor @ values`` is what the panel's nodal values are multiplied by.
    On a panel with a root the weight is ``√2/√((x − t)(2 ± (x + t)))``.
    """

    nodes: Array  # (m,): Gauss nodes, more of them than a panel has
    values: Array  # (m, n): a panel's nodal values -> values at the nodes
    own: Array  # (3, n, m): weights where x is a node of the panel; without a root, with one at t = 1, at t = −1
    projection: Array  # (m, m): values at the nodes -> Legendre coefficients, divided by k + 1/2

    def beyond(self, away: Array) -> Array:
        """Weights where x lies beyond the panel's end by as much, (...,) -> (..., m).

        ``1/√(x − t) = √(2s) Σ s^k P_k(t)`` with ``s = x − √(x² − 1)``: Legendre's generating function.
        """
        s = 1 / (1 + away + np.sqrt(away * (away + 2)))
        powers = np.empty((len(self.nodes), *away.shape))
        np.sqrt(2 * s, out=powers[0])
        for k in range(1, len(powers)):
            np.multiply(powers[k - 1], s, out=powers[k])
        return (powers.reshape(len(powers), away.size).T @ self.projection).reshape(*away.shape, len(powers))


@cache
def half_order_rule(order: int, factor: int) -> HalfOrderRule:
    """The rule for panels of `order` nodes, with as many further ones for the smooth factor.

    Within the panel ``∫ P_k(t)/√(x − t) dt = (T_k(x) + T_{k+1}(x)) / ((k + 1/2) √(1 + x))`` from −1 to x. Distances s
    from a root, (1 ± t)/2, have the weight 1/√|s_x² − s²|, which s = s_x cosh y removes, or s = s_x sin y.
    """
    rule = panel_rule(order)
    nodes, weights = gauss(order + factor)
    count = len(nodes)
    projection = legendre_values(count, nodes) * weights
    chebyshev = chebyshev_values(count + 1, rule.nodes)
    own = [((chebyshev[:-1] + chebyshev[1:]) / np.sqrt(1 + rule.nodes)).T @ projection]
    s = (1 + rule.nodes) / 2
    flipped, right = s[::-1], np.full(order, np.pi / 2)
    for sign, own_s, end, function in ((-1, flipped, np.arccosh(1 / flipped), np.cosh), (1, s, right, np.sin)):
        y, scale = gauss_between(np.zeros(order), end, OWN_ROOT * count)
        values = legendre_values(count, sign * (2 * own_s[:, None] * function(y) - 1))
        moments = (values * scale).sum(axis=2).T * (np.arange(count) + 0.5)
        own.append(np.sqrt(2) * moments @ projection)
    return HalfOrderRule(nodes, rule.lagrange(nodes), np.array(own), projection)


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Gauss–Legendre nodes and weights on [−1, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


def gauss_between(start: Array, end: Array, count: int) -> tuple[Array, Array]:
    """Gauss–Legendre nodes and weights from `start` to `end`, arrays of any one shape; (..., count) each."""
    nodes, weights = gauss(count)
    half = np.asarray((end - start) / 2)[..., None]
    return ((start + end) / 2)[..., None] + half * nodes, half * weights


def start_edges(width: float, reach: float) -> Array:
    """Panels for a first solution whose pressure varies over `width`, out to `reach`."""
    count = max(1, int(np.ceil(np.log2(max(reach / width, 2.0)))))
    return np.concatenate([[0.0], reach * 0.5 ** np.arange(count - 1, -1, -1.0)])


@cache
def panel_rule(order: int) -> PanelRule:
    """The rule of `order` Gauss–Legendre nodes a panel."""
    nodes, weights = gauss(order)
    to_legendre = (np.arange(order) + 0.5)[:, None] * legendre_values(order, nodes) * weights
    even_order = max(3, int(0.75 * order))
    squares = ((1 + nodes) / 2) ** 2
    vandermonde = chebyshev_values(even_order, 2 * squares - 1).T
    to_even = np.asarray(np.linalg.pinv(vandermonde), dtype=np.float64)
    even_slopes = np.zeros((even_order, even_order))
    even_slopes[:-1] = np.polynomial.chebyshev.chebder(np.eye(even_order))
    signs = (-1.0) ** np.arange(even_order)
    slopes = np.polynomial.legendre.legder(np.eye(order))
    derivative = np.polynomial.legendre.legval(nodes, slopes).T @ to_legendre
    return PanelRule(
        order,
        nodes,
        weights,
        to_legendre,
        np.asarray(np.linalg.inv(chebyshev_values(order, nodes).T), dtype=np.float64),
        even_order,
        to_even,
        even_slopes,
        vandermonde @ to_even,
        signs @ to_even,
        derivative,
        np.asarray((-1.0) ** np.arange(order) * np.sqrt((1 - nodes**2) * weights), dtype=np.float64),
    )
