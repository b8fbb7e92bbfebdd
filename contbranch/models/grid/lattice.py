"""The nodes of a square cell, and what elasticity is on them: periodic, or alone in free space.

Both kinds are one: with u = w - d (displacement of the surface less that of the far field), the pressure is

    p = K u + F/A,      K̂(0) = 0,

where A is the area of the array that is transformed, and the displacement of the far field is d = C F - mean(u).

- Periodic cell of edge L: K̂ = E|q|/2 (8)-(10), A = L². The mean displacement has no elastic energy. The cell's images
  shift it against that of the far field of a single contact: C = 3.90026492/(π E L), the sum over the images of the
  point force less its mean.
- Free space: pressures in the cell act through 1/(π E r), in an array of twice the edge. The kernel ends with the
  square |x|, |y| <= L, so that no node of the cell feels images. Its values on the nodes are those of the kernel that
  ends at the radius D > √2 L, whose transform (2/E|q|) ∫_0^(|q|D) J0(t) dt is known (Vico, Greengard & Ferrando, J.
  Comput. Phys. 323, 191 (2016)), in an array of edge 4L >= L + D. Their transform Ŝ on the array of edge 2L is
  positive, within 10 % of 2/E|q|, so that K̂ = 1/Ŝ; Ŝ(0), up to the spacing 8 ln(1 + √2) L/(π E), gives C = Ŝ(0)/A.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
import scipy

from contbranch.arrays import Array

from .transforms import Counter, Transform, orders, wavenumbers

__all__ = ["IMAGE_SUM", "Kind", "Lattice"]

Kind = Literal["periodic", "free"]

# Σ over the periodic images of a point force on a square lattice of edge 1, less the mean: minus the Madelung constant
# of a square lattice of charges in a neutralising plane (Bonsall & Maradudin, Phys. Rev. B 15, 1959, 1977).
IMAGE_SUM = 3.900264920001955
# D over L: as far from √2, beyond which it does not end within the square, as from 3, where images would be felt.
CUT = 0.5 * (math.sqrt(2.0) + 3.0)


@lru_cache(maxsize=8)
def _square_compliance(grid: int) -> Array:
    """Ŝ/L of the kernel that ends with the square, at q = π/L times whole numbers from 0 to N, (N + 1, N + 1)."""
    numbers = np.arange(2 * grid + 1.0)
    q = 0.5 * np.pi * np.hypot(numbers[:, None], numbers[None, :])
    q[0, 0] = 1.0
    disc = 2.0 / q * scipy.special.itj0y0((CUT * q).ravel())[0].reshape(q.shape)
    disc[0, 0] = 2.0 * CUT
    kernel = scipy.fft.dctn(disc, type=1)[: grid + 1, : grid + 1] / (4.0 * grid) ** 2
    return np.asarray(scipy.fft.dctn(kernel, type=1))


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
        if self.kind == "periodic":
            return IMAGE_SUM / (np.pi * self.edge)
        return float(_square_compliance(self.grid)[0, 0]) / (4.0 * self.edge)

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

    @property
    def symbol(self) -> Array:
        """K̂ at every coefficient of a transform."""
        if self.kind == "periodic":
            return 0.5 * wavenumbers(self.size, self.spacing, self.quarter)
        rows, columns = (np.abs(numbers).astype(int) for numbers in orders(self.size, self.quarter))
        stiffness: Array = 1.0 / (self.edge * _square_compliance(self.grid)[rows, columns])
        stiffness[(rows == 0) & (columns == 0)] = 0.0
        return stiffness

    @property
    def held_symbol(self) -> Array:
        """K̂ with the stiffness 1/(C A) of the mean, which is that of the far field where its displacement is held."""
        symbol = self.symbol
        symbol[0, 0] = 1.0 / (self.compliance * self.area)
        return symbol

    def transform(self, counter: Counter, threads: int = 1) -> Transform:
        """Plans for fields on this lattice."""
        return Transform(self.size, self.quarter, threads, counter)

    def whole(self) -> Lattice:
        """The same lattice without symmetry."""
        return Lattice(self.kind, self.edge, self.grid, quarter=False)

    def unfold(self, values: Array) -> Array:
        """A field of the quarter on the array of the whole lattice, padding included."""
        if not self.quarter:
            return np.array(values)
        rows = np.concatenate([values[::-1], values])
        whole = np.concatenate([rows[:, ::-1], rows], axis=1)
        # The whole array begins at the border of the cell, that of two quarters where the padding does.
        offset = self.inside - self.size
        return np.roll(whole, (offset, offset), (0, 1))
