"""Variations on a lattice as cos mθ and sin mθ: which m, and how they depend on the radius."""

from __future__ import annotations

import numpy as np

from contbranch.results.diagram import ModeShape

from .arrays import Array
from .lattice import Lattice
from .newton import Equilibrium
from .problem import GridProblem
from .stability import Sector, Stability
from .transforms import EVEN

__all__ = ["angular_content", "mode_shape"]


# Largest number of periods around the axis that is told from others.
LARGEST = 32
# Mean of cos² mθ over the nodes of a ring, 1/2 if there are many, below which the ring is too small for the mode.
RESOLVED = 0.2


def angular_content(lattice: Lattice, values: Array, weight: Array, sector: Sector) -> Array:
    """Shares of cos mθ (sin mθ, if it is odd in y) in the square of a variation of a quarter, m = 0 … 32.

    Rings of the width of two nodes are projected one by one; a mode with more periods than half the nodes of a ring is
    left out there.

    Parameters
    ----------
    values, weight : array (n, n)
        The variation, and how much of it counts where.
    """
    counted = np.broadcast_to(weight, values.shape) > 0.0
    if not counted.any():
        return np.zeros(LARGEST + 1)
    r, theta = (coordinate[counted] for coordinate in _polar(lattice, values.shape))
    ring = (r / (2.0 * lattice.spacing)).astype(int)
    w, x = np.broadcast_to(weight, values.shape)[counted], values[counted]
    rings = int(ring.max()) + 1
    total = np.bincount(ring, w, rings)
    content = np.zeros(LARGEST + 1)
    for m in _numbers(sector):
        wave = _wave(sector, m, theta)
        norm = np.bincount(ring, w * wave**2, rings)
        product = np.bincount(ring, w * wave * x, rings)
        seen = (total > 0.0) & (norm > RESOLVED * total)
        content[m] = float((product[seen] ** 2 / norm[seen]).sum())
    return content / float((w * x * x).sum())


def mode_shape(problem: GridProblem, equilibrium: Equilibrium, vector: Array, sector: Sector, mode: int) -> ModeShape:
    """Gap and pressure of a variation against the radius, from its projections on rings of the width of one node."""
    lattice = problem.lattice
    r, theta = _polar(lattice, vector.shape)
    cell = np.zeros(vector.shape, dtype=bool)
    cell[: lattice.inside, : lattice.inside] = True
    cell &= r < 0.5 * lattice.edge
    ring = (r[cell] / lattice.spacing).astype(int)
    wave = _wave(sector, mode, theta[cell])
    norm, nodes = np.bincount(ring, wave**2), np.bincount(ring)
    pressure = Stability(problem).variation(equilibrium, sector).pressure(vector)
    seen = norm > RESOLVED * nodes
    radius = np.bincount(ring, wave**2 * r[cell])[seen] / norm[seen]
    gap = np.bincount(ring, wave * vector[cell])[seen] / norm[seen]
    answer = np.bincount(ring, wave * pressure[cell])[seen] / norm[seen]
    scale = 1.0 / gap[np.argmax(np.abs(gap))]
    return ModeShape(mode, radius, scale * gap, scale * answer)


def _numbers(sector: Sector) -> range:
    """m of the waves that a sector contains."""
    if sector == EVEN:
        return range(0, LARGEST + 1, 2)
    return range(2, LARGEST + 1, 2) if sector == ("odd", "odd") else range(1, LARGEST + 1, 2)


def _wave(sector: Sector, m: int, theta: Array) -> Array:
    """cos mθ where the sector is even in y, else sin mθ."""
    return np.cos(m * theta) if sector[1] == "even" else np.sin(m * theta)


def _polar(lattice: Lattice, shape: tuple[int, ...]) -> tuple[Array, Array]:
    x = lattice.axis[: shape[0]]
    return np.hypot(x[:, None], x), np.arctan2(x[None, :], x[:, None])
