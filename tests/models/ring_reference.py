"""An independent solution of axisymmetric contact: rings of uniform pressure with active sets, of low order.

The displacement of a uniformly loaded disc is known in closed form (K. L. Johnson, Contact Mechanics, 1985, §3.4); a
ring is the difference of two discs. The gap is collocated at the middle of the rings.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipkm1

Array = NDArray[np.float64]


def disc_displacement(radius: Array, r: Array) -> Array:
    """Displacement at `r` caused by unit pressure on discs (E = 1), (M, N)."""
    r, b = r[:, None], radius[None, :]
    ratio = np.minimum(r / b, 1.0) ** 2
    inside = 4 * b / np.pi * ellipe(ratio)
    rest = np.maximum(1 - np.minimum(b / r, 1.0) ** 2, 1e-300)
    outside = 4 * r / np.pi * (ellipe(1 - rest) - rest * ellipkm1(rest))
    return np.where(r < b, inside, outside)


class Rings:
    """Equal rings out to a radius."""

    def __init__(self, count: int, end: float) -> None:
        edges = np.linspace(0.0, end, count + 1)
        self.r = (edges[1:] + edges[:-1]) / 2
        discs = disc_displacement(np.maximum(edges, 1e-300), self.r)
        self.w = discs[:, 1:] - discs[:, :-1]
        self.area = np.pi * (edges[1:] ** 2 - edges[:-1] ** 2)

    def load(self, pressure: Array) -> float:
        """F."""
        return float(self.area @ pressure)

    def step_law(self, height: Array, d: float, sigma: float, range_: float) -> tuple[Array, Array]:
        """Pressure and set of every ring (0: none, 1: gap at the range, 2: σ, 3: wall) for Maugis–Dugdale repulsion."""
        scale = 1 / np.diag(self.w)
        sets = np.where(height - d < range_, 1, 0)
        pressure = np.zeros(len(self.r))
        for _ in range(400):
            fixed = np.where(sets == 2, sigma, 0.0)
            rests = (sets == 1) | (sets == 3)
            level = np.where(sets == 1, range_, 0.0)
            known = height - d + self.w[:, ~rests] @ fixed[~rests]
            pressure = fixed.copy()
            pressure[rests] = np.linalg.solve(self.w[np.ix_(rests, rests)], (level - known)[rests])
            gap = height - d + self.w @ pressure
            at_range = pressure + scale * (range_ - gap)
            at_wall = pressure - scale * gap
            new = np.where(at_range <= 0, 0, np.where(at_range < sigma, 1, np.where(at_wall > sigma, 3, 2)))
            # One step from set to set at a time: sets 0 and 2, or 1 and 3, are no neighbours.
            new = np.clip(new, sets - 1, sets + 1)
            if np.array_equal(new, sets):
                return pressure, sets
            sets = new
        raise AssertionError("the active sets of the reference have not settled")

    def smooth_law(
        self, height: Array, d: float, law: Callable[[Array], tuple[Array, Array]]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Pressure, and where the wall is touched, for a law that returns pressure and dp/dg; semismooth Newton."""
        scale = 1 / np.diag(self.w)
        touched = np.zeros(len(self.r), dtype=bool)
        pressure = law(np.maximum(height - d, 0.0))[0]
        for _ in range(200):
            gap = height - d + self.w @ pressure
            own, slope = law(np.maximum(gap, 0.0))
            contact = pressure - own - scale * gap > 0
            matrix = np.where(contact[:, None], self.w, np.eye(len(self.r)) - slope[:, None] * self.w)
            residual = np.where(contact, gap, pressure - own)
            change = np.linalg.solve(matrix, -residual)
            pressure = pressure + change
            if np.array_equal(contact, touched) and np.abs(change).max() < 1e-12:
                return pressure, contact
            touched = contact
        raise AssertionError("the active sets of the reference have not settled")
