"""Variations on a lattice as cos mθ and sin mθ: which m, and how they depend on the radius."""

from __future__ import annotations

import numpy as np

from contbranch.arrays import Array
from contbranch.results.diagram import ModeShape

from .lattice import Lattice
from .newton import Equilibrium
from .problem import GridProblem
from .stability import Sector, Stability
from .transforms import EVEN

__all__ = ["angular_content", "mode_shape"]


# Largest number of periods around the axis that is told from others.
LARGEST = 32
# Weight, relative, of nodes that do not count.
FAINT = 1e-3
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
    counted = weight > FAINT * weight.max()
    content = np.zeros(LARGEST + 1)
    if not counted.any():
        return content
    r, theta = (coordinate[counted] for coordinate in _polar(lattice, values.shape))
    w, x = weight[counted], values[counted]
    for m in _numbers(sector):
        wave = _wave(sector, m, theta)
        norm, product = _projected(r / (2.0 * lattice.spacing), w, wave, wave * x)
        content[m] = (product**2 / norm).sum()
    content /= (w * x * x).sum()
    return content


def mode_shape(problem: GridProblem, equilibrium: Equilibrium, vector: Array, sector: Sector, mode: int) -> ModeShape:
    """Gap and pressure of a variation against the radius, from its projections on rings of the width of one node."""
    lattice = problem.lattice
    r, theta = _polar(lattice, vector.shape)
    n = lattice.inside
    cell = (r < 0.5 * lattice.edge) & np.pad(np.ones((n, n), dtype=bool), (0, len(r) - n))
    pressure = Stability(problem).variation(equilibrium, sector).pressure(vector)
    wave, at = _wave(sector, mode, theta[cell]), r[cell]
    fields = wave * at, vector[cell], pressure[cell]
    norm, *parts = _projected(at / lattice.spacing, np.ones_like(at), wave, *(wave * field for field in fields))
    radius, gap, answer = (part / norm for part in parts)
    scale = 1.0 / gap[np.argmax(np.abs(gap))]
    return ModeShape(mode, radius, scale * gap, scale * answer)


def _projected(rings: Array, weight: Array, wave: Array, *fields: Array) -> Array:
    """Sums of the wave's square, and of fields, over every ring that is large enough for the wave."""
    ring = rings.astype(int)
    sums = np.array([np.bincount(ring, weight * field) for field in (np.ones_like(wave), wave**2, *fields)])
    return sums[1:, (sums[0] > 0.0) & (sums[1] > RESOLVED * sums[0])]


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
