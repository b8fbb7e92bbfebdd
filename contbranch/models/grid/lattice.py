"""The nodes of a square cell, and what elasticity is on them: periodic, or alone in free space.

Both kinds are one: with u = w - d (displacement of the surface less that of the far field), the pressure is

    p = K u + F/A,      K̂(0) = 0,

where A is the area of the array that is transformed, and the displacement of the far field is d = C F - mean(u).

- Periodic cell of edge L: K̂ = E|q|/2 (8)-(10), A = L². The mean displacement has no elastic energy. The cell's images
  shift it against that of the far field of a single contact: C = 3.90026492/(π E L), the sum over the images of the
  point force less its mean.
- Free space: pressures within the disc inscribed in the cell act through 1/(π E r) up to the distance L, in an array of
  twice the edge, whose images are then too far to be felt. The transform of the kernel cut off at r = L,
  Ŝ(q) = (2/E|q|) ∫_0^(|q|L) J0(t) dt, is positive, so that K̂ = 1/Ŝ; Ŝ(0) = 2L/E gives C = Ŝ(0)/A = 1/(2 E L).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy

from contbranch.arrays import Array

from .transforms import EVEN, Counter, Sector, Transform, wavenumbers

__all__ = ["IMAGE_SUM", "Kind", "Lattice"]

Kind = Literal["periodic", "free"]

# Σ over the periodic images of a point force on a square lattice of edge 1, less the mean: minus the Madelung constant
# of a square lattice of charges in a neutralising plane (Bonsall & Maradudin, Phys. Rev. B 15, 1959, 1977).
IMAGE_SUM = 3.900264920001955


@dataclass(frozen=True)
class Lattice:
    """A square lattice of N × N nodes in a cell of edge L (reduced units, E = 1).

    The nodes lie at (i + 1/2) L/N from the cell's border, so that none lies on a mirror line.

    Attributes
    ----------
    kind : {"periodic", "free"}
    edge : float
        L.
    grid : int
        N, even.
    quarter : bool
        Whether fields are symmetric about both middle lines, and only the quarter with x, y > 0 is kept.
    """

    kind: Kind
    edge: float
    grid: int
    quarter: bool = True

    @property
    def spacing(self) -> float:
        """Distance of neighbouring nodes."""
        return self.edge / self.grid

    @property
    def size(self) -> int:
        """Nodes along one side of the array of a field."""
        whole = self.grid if self.kind == "periodic" else 2 * self.grid
        return whole // 2 if self.quarter else whole

    @property
    def inside(self) -> int:
        """How many of them belong to the cell; the others are padding."""
        return self.grid // 2 if self.quarter else self.grid

    @property
    def multiplicity(self) -> int:
        """Nodes for which one of the array stands."""
        return 4 if self.quarter else 1

    @property
    def node_area(self) -> float:
        """Area for which one node of the array stands."""
        return self.spacing**2 * self.multiplicity

    @property
    def area(self) -> float:
        """Area of the whole array, padding included."""
        return self.node_area * self.size**2

    @property
    def compliance(self) -> float:
        """C of d = C F - mean(u)."""
        return IMAGE_SUM / (np.pi * self.edge) if self.kind == "periodic" else 0.5 / self.edge

    @cached_property
    def axis(self) -> Array:
        """Coordinates of the nodes along one side, from the middle of the cell; padding too, (size,)."""
        nodes = (np.arange(self.size) + 0.5) * self.spacing
        return np.asarray(nodes if self.quarter else nodes - 0.5 * self.edge)

    def fill(self, values: Array) -> Array:
        """Heights of the cell, (inside, inside), on the whole array: there is no tip on the padding."""
        if self.size == self.inside:
            return np.array(values, dtype=np.float64)
        whole = np.full((self.size, self.size), np.inf)
        whole[: self.inside, : self.inside] = values
        return whole

    def symbol(self, parity: Sector | None) -> Array:
        """K̂ at every coefficient of a transform."""
        q = wavenumbers(self.size, self.spacing, parity)
        if self.kind == "periodic":
            return 0.5 * q
        nowhere = q == 0.0
        safe = np.where(nowhere, 1.0, q)
        stiffness = 0.5 * safe / scipy.special.itj0y0((safe * self.edge).ravel())[0].reshape(q.shape)
        stiffness[nowhere] = 0.0
        return stiffness

    def held_symbol(self, parity: Sector | None) -> Array:
        """K̂ with the stiffness 1/(C A) of the mean, which is that of the far field where its displacement is held."""
        symbol = self.symbol(parity)
        if parity in (None, EVEN):
            symbol[0, 0] = 1.0 / (self.compliance * self.area)
        return symbol

    def transform(self, counter: Counter, threads: int = 1, parity: Sector = EVEN) -> Transform:
        """Plans for fields on this lattice."""
        return Transform(self.size, parity if self.quarter else None, threads, counter)

    def whole(self) -> Lattice:
        """The same lattice without symmetry."""
        return Lattice(self.kind, self.edge, self.grid, quarter=False)

    def unfold(self, values: Array, parity: Sector = EVEN) -> Array:
        """A field of the quarter on the array of the whole lattice, padding included."""
        if not self.quarter:
            return np.array(values)
        signs = [1.0 if p == "even" else -1.0 for p in parity]
        rows = np.concatenate([signs[0] * values[::-1], values])
        whole = np.concatenate([signs[1] * rows[:, ::-1], rows], axis=1)
        # The whole array begins at the border of the cell, that of two quarters where the padding does.
        offset = self.inside - self.size
        return np.roll(whole, (offset, offset), (0, 1))
