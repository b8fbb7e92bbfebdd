"""Pressures on a half space in real space, ring by ring, with nothing of the Abel transform.

A ring of radius s lifts the surface at r by ``k(r, s) p(s) ds`` (E = 1), with the complete elliptic integral K:

    k = (4/π) s/(r + s) K(m),   m = 4rs/(r + s)²,   so that 1 − m = ((r − s)/(r + s))².
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipkm1

Array = NDArray[np.float64]

# Steps of the double exponential rule, and where it ends: next to the ends of an interval weights have died away.
STEP, LAST = 0.08, 3.3


def rule(low: float, high: float) -> tuple[Array, Array, Array]:
    """Places, by how much they differ from the nearer end, and weights, for any root or logarithm at the ends."""
    t = STEP * np.arange(-np.floor(LAST / STEP), np.floor(LAST / STEP) + 1)
    near = 1 / (1 + np.exp(np.pi * np.sinh(np.abs(t))))  # share of the way from the nearer end
    weights = (high - low) * STEP * np.pi * np.cosh(t) * near * (1 - near)
    away = np.where(t < 0, 1.0, -1.0) * near * (high - low)
    return np.where(t < 0, low, high) + away, away, weights


def lifted(pressure: Callable[[Array], Array], ends: Sequence[float] | Array, r: float) -> Array:
    """Displacement at r of a pressure (..., radii) that is smooth between the radii `ends`."""
    total: Array = np.zeros(())
    for low, high in pairwise(np.unique([*ends, *([r] if ends[0] < r < ends[-1] else [])]).tolist()):
        s, away, weights = rule(low, high)
        apart = np.where((s < (low + high) / 2) & (low == r) | (s > (low + high) / 2) & (high == r), away, s - r)
        least = np.maximum((apart / (s + r)) ** 2, 1e-300)
        kernel = 4 / np.pi * s / (r + s) * ellipkm1(least)
        total = total + pressure(s) @ (weights * kernel)
    return np.asarray(total)


def integral(function: Callable[[Array], Array], ends: Sequence[float] | Array) -> float:
    """∫ over radii of what is smooth between `ends`."""
    rules = [rule(low, high) for low, high in pairwise(ends)]
    return float(sum(weights @ function(s) for s, _, weights in rules))


class Annulus:
    """Contact without interaction on b < r < a with a tip of a height z(r): ``p = √((r² − b²)(a² − r²)) q(r²)``.

    Which outer radius belongs to an inner one is found from one collocation point more than there are unknowns.

    Attributes
    ----------
    outer, displacement, load : float
    """

    def __init__(
        self, height: Callable[[Array], Array], inner: float, bracket: tuple[float, float], count: int
    ) -> None:
        self.inner, self._count, self._height = inner, count, height
        self.outer = float(brentq(lambda a: self._solved(a)[0], *bracket, xtol=1e-14))
        _, self._series, self.displacement = self._solved(self.outer)
        ends = [inner, self.outer]
        self.load = 2 * np.pi * integral(lambda r: self.pressure(r) * r, ends)

    def pressure(self, r: Array) -> Array:
        """Pressure at radii."""
        return np.asarray(self._series @ self._basis(r, self.outer))

    def _basis(self, r: Array, outer: float) -> Array:
        b, a = self.inner, outer
        local = (2 * r * r - a * a - b * b) / ((a - b) * (a + b))
        root = np.sqrt(np.maximum((r - b) * (r + b) * (a - r) * (a + r), 0.0))
        return root * chebyshev.chebvander(local, self._count - 1).T

    def _solved(self, outer: float) -> tuple[float, Array, float]:
        """What is left of the surplus equation, the coefficients of q, and the displacement."""
        n = self._count
        z = np.cos(np.pi * (np.arange(n + 2) + 0.5) / (n + 2))
        r = np.sqrt((outer**2 + self.inner**2) / 2 + (outer**2 - self.inner**2) / 2 * z)
        lift = np.array([lifted(lambda s: self._basis(s, outer), [self.inner, outer], one) for one in r])
        matrix = np.column_stack([lift, -np.ones(n + 2), z**0 * chebyshev.chebval(z, np.eye(n + 2)[n + 1])])
        # A surplus equation, as an unknown multiple of the finest Chebyshev polynomial.
        found = np.linalg.solve(matrix, -self._height(r))
        return float(found[-1]), found[:n], float(found[n])
