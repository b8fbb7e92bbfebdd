"""The nodes of a rectangular cell, and what elasticity is on them: periodic, or alone in free space.

Both kinds are one: with u = w - d (displacement of the surface less that of the far field), the pressure is

    p = K u + F/A,      K̂(0) = 0,

where A is the area of the array that is transformed, and the displacement of the far field is d = C F - mean(u).

- Periodic cell: K̂ = E|q|/2 (8)-(10), A its area. The mean displacement has no elastic energy. The images of a square
  cell of edge L shift it against that of the far field of a single contact: C = 3.90026492/(π E L), the sum over the
  images of the point force less its mean. Another cell has the C of the square cell of its area. Of a line contact,
  which is one node wide, d is the displacement against the surface at the distance L of a single line of force:
  C = 2 ln(2π)/(π E L_y).
- Free space: pressures in the cell act through 1/(π E r), in an array of twice the edges. The kernel ends with the
  rectangle |x| <= L_x, |y| <= L_y, so that no node of the cell feels images. Its values on the nodes are those of the
  kernel that ends at a radius D beyond the corners of that, whose transform (2/E|q|) ∫_0^(|q|D) J0(t) dt is known
  (Vico, Greengard & Ferrando, J. Comput. Phys. 323, 191 (2016)), in an array with edges of at least L + D. Their
  transform Ŝ on the array of twice the edges is positive, for a square within 10 % of 2/E|q|, so that K̂ = 1/Ŝ; Ŝ(0),
  for a square up to the spacing 8 ln(1 + √2) L/(π E), gives C = Ŝ(0)/A.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.contact.bodies import Body

from .transforms import Counter, Transform, orders

__all__ = ["IMAGE_SUM", "Kind", "Lattice"]

Kind = Literal["periodic", "free"]

# Σ over the periodic images of a point force on a square lattice of edge 1, less the mean: minus the Madelung constant
# of a square lattice of charges in a neutralising plane (Bonsall & Maradudin, Phys. Rev. B 15, 1959, 1977).
IMAGE_SUM = 3.900264920001955
# The least compliance of a mean displacement, in units of the half space's.
RIGID = 1e-9
# D over the diagonal of the cell: beyond 1, so that the disc does not end within the rectangle.
CUT = 1.5


@lru_cache(maxsize=8)
def _free_compliance(edges: tuple[float, float], shape: tuple[int, int], body: Body | None = None) -> Array:
    """Ŝ of the kernel that ends with the rectangle, at q = π/L times whole numbers from 0 to N, (N + 1, M + 1)."""
    reach = CUT * math.hypot(*edges)
    spacings = [edge / nodes for edge, nodes in zip(edges, shape, strict=True)]
    halves = [math.ceil(0.5 * (edge + reach) / step) for edge, step in zip(edges, spacings, strict=True)]
    waves = [np.pi / (half * step) * np.arange(half + 1.0) for half, step in zip(halves, spacings, strict=True)]
    q = np.hypot(waves[0][:, None], waves[1])
    q[0, 0] = 1.0
    disc = 2.0 / q * scipy.special.itj0y0((reach * q).ravel())[0].reshape(q.shape)
    disc[0, 0] = 2.0 * reach
    kernel = scipy.fft.dctn(disc, type=1)[: shape[0] + 1, : shape[1] + 1] / (4.0 * math.prod(halves))
    if body is not None:
        x, y = (step * np.arange(count + 1.0) for step, count in zip(spacings, shape, strict=True))
        kernel += math.prod(spacings) * body.added(np.hypot(x[:, None], y))
    return np.asarray(scipy.fft.dctn(kernel, type=1))


@dataclass(frozen=True)
class Lattice:
    """A rectangular lattice of N × M nodes in a cell with the edges L_x and L_y (reduced units, E = 1).

    The nodes lie at (i + 1/2) L/N from the cell's border, so that none lies on a mirror line. A cell one node wide is a
    line contact, the same everywhere along that edge.

    Attributes
    ----------
    kind : {"periodic", "free"}
    edges : (float, float)
        L_x and L_y.
    nodes : (int, int)
        N and M; even where `quarter`.
    quarter : bool
        Whether fields are symmetric about both middle lines, and only the quarter with x, y > 0 is kept.
    body : Body or None
        A layered body in place of the half space.
    """

    kind: Kind
    edges: tuple[float, float]
    nodes: tuple[int, int]
    quarter: bool = True
    body: Body | None = None

    @property
    def spacings(self) -> tuple[float, float]:
        """Distances of neighbouring nodes along x and along y."""
        return self.edges[0] / self.nodes[0], self.edges[1] / self.nodes[1]

    @property
    def spacing(self) -> float:
        """The longer of them; that along a line contact."""
        return max(step for step, nodes in zip(self.spacings, self.nodes, strict=True) if nodes > 1)

    @property
    def line(self) -> bool:
        """Whether the cell is one node wide."""
        return min(self.nodes) == 1

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the array of a field, padding included."""
        rows, columns = self.inside
        return (2 * rows, 2 * columns) if self.kind == "free" else (rows, columns)

    @property
    def inside(self) -> tuple[int, int]:
        """How many of its rows and columns belong to the cell; the others are padding."""
        rows, columns = self.nodes
        return (rows // 2, columns // 2) if self.quarter else (rows, columns)

    @property
    def cell(self) -> tuple[slice, slice]:
        """The part of an array that belongs to the cell."""
        return np.s_[: self.inside[0], : self.inside[1]]

    @property
    def size(self) -> int:
        """Nodes of the array of a field."""
        return math.prod(self.shape)

    @property
    def multiplicity(self) -> int:
        """Nodes for which one of the array stands."""
        return 4 if self.quarter else 1

    @property
    def node_area(self) -> float:
        """Area for which one node of the array stands."""
        return math.prod(self.spacings) * self.multiplicity

    @property
    def area(self) -> float:
        """Area of the whole array, padding included."""
        return self.node_area * self.size

    @property
    def compliance(self) -> float:
        """C of d = C F - mean(u)."""
        if self.kind == "free":
            return float(_free_compliance(self.edges, self.nodes, self.body)[0, 0]) / self.area
        if self.line:
            half_space = 2.0 * math.log(2.0 * math.pi) / (math.pi * self.edges[self.nodes.index(1)])
        else:
            half_space = IMAGE_SUM / (math.pi * math.sqrt(math.prod(self.edges)))
        if self.body is None:
            return half_space
        # An incompressible layer on a rigid base has no mean displacement: as good as none.
        own = self.body.far * half_space + 2.0 * self.body.mean * self.body.thickness / self.area
        return max(own, RIGID * half_space)

    @cached_property
    def axes(self) -> tuple[Array, Array]:
        """Coordinates of the array's rows and columns, from the middle of the cell; padding too."""
        numbers = [np.arange(0.5, count) for count in self.shape]
        firsts = [0.0 if self.quarter else 0.5 * edge for edge in self.edges]
        x, y = (np.asarray(k * h - x0) for k, h, x0 in zip(numbers, self.spacings, firsts, strict=True))
        return x, y

    @cached_property
    def distance(self) -> Array:
        """Distance of every node from the middle of the cell."""
        return np.asarray(np.hypot(self.axes[0][:, None], self.axes[1]))

    def fill(self, values: Array) -> Array:
        """Heights of the cell on the whole array: there is no tip on the padding."""
        whole = np.full(self.shape, np.inf)
        whole[self.cell] = values
        return whole

    @property
    def symbol(self) -> Array:
        """K̂ at every coefficient of a transform."""
        numbers = orders(self.shape, self.quarter)
        if self.kind == "periodic":
            # From whole numbers where edges are equal, so that a quarter and the whole lattice have the same digits.
            ratio = self.edges[0] / self.edges[1]
            half = np.asarray(np.pi / self.edges[0] * np.sqrt(numbers[0] ** 2 + (ratio * numbers[1]) ** 2))
            if self.body is not None:
                half[half > 0.0] /= self.body.response(2.0 * self.body.thickness * half[half > 0.0])
            return half
        rows, columns = (np.abs(order).astype(int) for order in numbers)
        stiffness: Array = 1.0 / _free_compliance(self.edges, self.nodes, self.body)[rows, columns]
        stiffness[(rows == 0) & (columns == 0)] = 0.0
        return stiffness

    @property
    def held_symbol(self) -> Array:
        """K̂ with the stiffness 1/(C A) of the mean, which is that of the far field where its displacement is held."""
        symbol = self.symbol
        symbol[0, 0] = 1.0 / (self.compliance * self.area)
        return symbol

    @property
    def stiffest(self) -> float:
        """K̂ of the shortest wave of a periodic lattice."""
        return 0.5 * np.pi * math.hypot(*(1.0 / h for h, n in zip(self.spacings, self.nodes, strict=True) if n > 1))

    def transform(self, counter: Counter, threads: int = 1) -> Transform:
        """Plans for fields on this lattice."""
        return Transform(self.shape, self.quarter, threads, counter)

    def whole(self) -> Lattice:
        """The same lattice without symmetry."""
        return replace(self, quarter=False)

    def unfold(self, values: Array) -> Array:
        """A field of the quarter on the array of the whole lattice, padding included."""
        if not self.quarter:
            return np.array(values)
        rows = np.concatenate([values[::-1], values])
        whole = np.concatenate([rows[:, ::-1], rows], axis=1)
        # The whole array begins at the border of the cell, that of two quarters where the padding does.
        offsets = [inside - size for inside, size in zip(self.inside, self.shape, strict=True)]
        return np.roll(whole, offsets, (0, 1))
