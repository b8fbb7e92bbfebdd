"""Azimuthal eigenvalues in real space: rings of pressure on a half space, with nothing of the Abel transform.

A pressure p(r') cos mθ on a ring lifts the surface at r by ``C_m(r, r') p r' dr'``, with (E = 1, x < y the two radii)

    C_m = (1/π) ∮ cos mφ / |r − r'| dφ = 2 (1/2)_m/m! x^m/y^(m+1) ₂F₁(1/2, m + 1/2; m + 1; x²/y²),

which is 2/(π √(xy)) Q_(m−1/2)((x² + y²)/2xy). In a contact disc the pressure cancels the displacement.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, gamma, hyp2f1, poch

Array = NDArray[np.float64]
Radius = Callable[[Array], Array]

LEVELS = 30  # dyadic pieces towards a logarithmic singularity
ORDER = 12


def ring(m: int, r: Array, other: Array) -> Array:
    """C_m(r, r'); close to r = r' by the expansion in 1 − x²/y² with its logarithm (DLMF 15.8.10)."""
    x, y = np.minimum(r, other), np.maximum(r, other)
    gap = np.maximum((y - x) * (y + x) / y**2, 1e-300)
    close = gap < 0.1
    series, factor = np.zeros_like(gap), np.ones_like(gap)
    for n in range(16):
        brackets = np.log(gap) - 2 * digamma(n + 1.0) + digamma(0.5 + n) + digamma(m + 0.5 + n)
        series -= factor * brackets
        factor *= (0.5 + n) * (m + 0.5 + n) / (n + 1.0) ** 2 * np.where(close, gap, 0.0)
    series *= gamma(m + 1.0) / (gamma(0.5) * gamma(m + 0.5))
    far = hyp2f1(0.5, m + 0.5, m + 1.0, np.where(close, 0.0, (x / y) ** 2))
    return np.asarray(2 * poch(0.5, m) / poch(1.0, m) * (x / y) ** m / y * np.where(close, series, far))


class Rings:
    """Panels in a coordinate s on which pressure · r dr/ds is smooth, with r(s) and dr/ds."""

    def __init__(self, edges: Array, radius: Radius, area: Radius) -> None:
        z, w = np.polynomial.legendre.leggauss(ORDER)
        self.edges, self.radius, self.area = edges, radius, area
        half = np.diff(edges) / 2
        self.s = ((edges[:-1] + half)[:, None] + half[:, None] * z).ravel()
        self.weights = (half[:, None] * w).ravel()
        self.r = radius(self.s)
        self.z, self.w = z, w
        self.inverse = np.linalg.inv(np.polynomial.legendre.legvander(z, ORDER - 1))

    def compliance(self, m: int, targets: Array, own: Array | None, where: float) -> Array:
        """Displacement at radii `targets` for nodal values of the pressure; (targets, nodes).

        `own` are the targets' coordinates s; without, they lie beyond the end at the coordinate `where`.
        """
        matrix = ring(m, targets[:, None], self.r) * self.weights * self.area(self.s)
        for i, target in enumerate(targets):
            place = where if own is None else own[i]
            for panel, (low, high) in enumerate(zip(self.edges[:-1], self.edges[1:], strict=True)):
                if max(low - place, place - high) < 1.5 * (high - low):
                    block = slice(panel * ORDER, (panel + 1) * ORDER)
                    matrix[i, block] = self._near(m, float(target), min(max(place, low), high), low, high)
        return matrix

    def _near(self, m: int, target: float, place: float, low: float, high: float) -> Array:
        steps = 0.5 ** np.arange(LEVELS + 1)
        pieces = [
            np.concatenate([place + (end - place) * steps, [place]]) for end in (low, high) if abs(end - place) > 0
        ]
        total = np.zeros(ORDER)
        for ends in pieces:
            begin, half = ends[:-1], np.diff(ends) / 2
            s = ((begin + half)[:, None] + half[:, None] * self.z).ravel()
            weights = (np.abs(half)[:, None] * self.w).ravel()
            values = weights * self.area(s) * ring(m, np.array(target), self.radius(s))
            local = 2 * (s - low) / (high - low) - 1
            total += values @ np.polynomial.legendre.legvander(local, ORDER - 1)
        return np.asarray(total @ self.inverse)


def disc_rings(a: float) -> Rings:
    """Rings inside a contact; their nodal values are s times the pressure, ``s = √(1 − r²/a²)``, smooth at the rim."""
    edges = np.concatenate([[0.0], 0.3 ** np.arange(6, 0, -1), [0.6, 0.85, 1.0]])
    return Rings(edges, lambda s: a * np.sqrt(np.maximum(1 - s * s, 0.0)), lambda s: np.full_like(s, a * a))


def ring_eigenvalues(m: int, a: float, edges: Array, stiffness: Callable[[Array], Array]) -> Array:
    """Eigenvalues λ of ``C k η = λ η`` outside a contact disc of radius a, k = −stiffness(rho), in decreasing order.

    `edges` are panels in ``rho = √(r² − a²)``.
    """
    if a == 0:
        free = Rings(edges, lambda s: s, lambda s: s)
        matrix = free.compliance(m, free.r, free.s, 0.0)
    else:
        free = Rings(edges, lambda s: np.sqrt(a * a + s * s), lambda s: s)
        disc = disc_rings(a)
        inside = disc.compliance(m, disc.r, disc.s, 0.0)
        on_free = disc.compliance(m, free.r, None, 0.0)
        on_disc = free.compliance(m, disc.r, None, 0.0)
        matrix = free.compliance(m, free.r, free.s, 0.0) - on_free @ np.linalg.solve(inside, on_disc)
    found = np.linalg.eigvals(-matrix * stiffness(free.s))
    return np.sort(found.real)[::-1]
