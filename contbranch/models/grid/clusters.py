"""The linearised problem on few clusters of nodes: what preconditions its solution on all of them.

Nodes are single at the rim of the contact and where the law is stiff, and gathered into squares of 2, 4 and 8 nodes a
side as the solution becomes smooth. With the influence of a square on another, from the lattice's own response to a
pressure (summed over the mirror images where fields are symmetric), the equations on the squares are a small dense
matrix. It knows what no filter does: the contact, the localised softening next to its rim, the film.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy

from .arrays import Array, Integers, Mask
from .lattice import Lattice

__all__ = ["Clusters", "Influence", "gathered"]

# Nodes a side of the largest squares.
LARGEST = 8
# Squares of s nodes a side keep NEAR (s - 1) nodes away from the rim, and s h |v''| below RESOLVED there.
NEAR, RESOLVED = 3, 2.0
# Clusters at most: beyond, they begin at twice the size.
MOST = 2000


@dataclass
class Influence:
    """Displacements of squares of nodes by pressures on squares of nodes, at fixed displacement of the far field.

    Attributes
    ----------
    lattice : Lattice
    """

    lattice: Lattice
    _tables: dict[tuple[int, int], Array] = field(default_factory=dict)

    @property
    def period(self) -> int:
        """Nodes after which a field repeats itself."""
        return self.lattice.size * (2 if self.lattice.quarter else 1)

    @cached_property
    def _response(self) -> Array:
        return 1.0 / self.lattice.whole().held_symbol(None)

    def table(self, rows: int, columns: int) -> Array:
        """Mean displacement of a square for unit pressure on another, by the offset of their first nodes; flat."""
        if (rows, columns) not in self._tables:
            m = self.period
            turn = np.exp(-2j * np.pi * np.fft.fftfreq(m))
            box = np.conj(sum(turn**k for k in range(rows))) / rows * sum(turn**k for k in range(columns))
            filtered = self._response * box[:, None] * box[: m // 2 + 1]
            self._tables[rows, columns] = np.fft.irfft2(filtered, s=(m, m)).ravel()
        return self._tables[rows, columns]

    def matrix(self, sizes: Integers, corners: tuple[Integers, Integers]) -> Array:
        """Mean displacements of all squares (rows) for unit pressures on each (columns)."""
        m = self.period
        found = np.empty((sizes.size, sizes.size))
        groups = [(int(size), np.flatnonzero(sizes == size)) for size in np.unique(sizes)]
        for rows, a in groups:
            for columns, b in groups:
                table = self.table(rows, columns)
                x, y = (self._offsets(corner[a][:, None], corner[b], columns) for corner in corners)
                block = sum(table[m * dx + dy] for dx in x for dy in y)
                found[a[:, None], b] = block
        return found

    def _offsets(self, rows: Integers, columns: Integers, size: int) -> list[Integers]:
        """Offsets of squares from squares, and from their mirror images."""
        apart = [(rows - columns) % self.period]
        return [*apart, (rows + columns + size) % self.period] if self.lattice.quarter else apart


def gathered(
    contact: Mask, stiffness: Array, zone: Mask, spacing: float, most: int = MOST
) -> tuple[Integers, tuple[Integers, Integers], Integers]:
    """Gather the nodes of a zone into squares: sizes and first nodes of these, and the square of every node.

    Parameters
    ----------
    contact, stiffness, zone : array (n, n)
        The numbers of the nodes' squares are in the order of the zone's nodes.
    """
    smallest, near, resolved = 1, NEAR, RESOLVED
    n = -(-contact.shape[0] // LARGEST) * LARGEST
    contact, stiffness, zone = (np.pad(a, (0, n - len(a))) for a in (contact, np.abs(stiffness), zone))
    softness = np.where(contact, 0.0, stiffness) * spacing
    rim = np.zeros_like(zone)
    for axis in (0, 1):
        first, last = (np.s_[:-1], np.s_[1:]) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
        changes = contact[first] != contact[last]
        rim[first] |= changes
        rim[last] |= changes
    far = n if not rim.any() else scipy.ndimage.distance_transform_cdt(~rim, metric="chessboard")
    far = np.broadcast_to(far, rim.shape)
    while True:
        squares, label = _squares((contact, softness, zone, far), smallest, near, resolved)
        if squares[0].size <= most:
            return squares[0], (squares[1], squares[2]), label
        if near > 1:
            near -= 1
        elif resolved < 8.0:
            resolved *= 2.0
        elif smallest < LARGEST:
            smallest, resolved = 2 * smallest, RESOLVED
        else:
            return squares[0], (squares[1], squares[2]), label


def _squares(
    fields: tuple[Mask, Array, Mask, Integers], smallest: int, near: int, resolved: float
) -> tuple[Integers, Integers]:
    """Sizes and first nodes, (3, m), and the square of every node of the zone."""
    contact, softness, zone, far = fields
    n = len(zone)
    left, number = zone.copy(), np.zeros((n, n), dtype=np.int64)
    found, count, size = [], 0, LARGEST
    while size >= smallest:
        m = n // size
        blocks = (m, size, m, size)
        fits = left.reshape(blocks).any((1, 3))
        if size > smallest:
            fits &= far.reshape(blocks).min((1, 3)) > near * (size - 1)
            fits &= size * softness.reshape(blocks).max((1, 3)) < resolved
        x, y = np.nonzero(fits)
        found.append(np.array([np.full(x.size, size), size * x, size * y]))
        labels = np.zeros((m, m), dtype=np.int64)
        labels[x, y] = count + np.arange(x.size)
        covered = np.repeat(np.repeat(fits, size, 0), size, 1) & left
        number[covered] = np.repeat(np.repeat(labels, size, 0), size, 1)[covered]
        left &= ~covered
        count += x.size
        size //= 2
    return np.concatenate(found, axis=1), number[zone]


class Clusters:
    """The bordered equations on clusters, factorised.

    On free nodes y + v″ (S y - δd), in contact α (S y - δd), for changes y of the pressure and δd of the displacement.

    Parameters
    ----------
    influence : Influence
    contact, stiffness, zone : array (n, n)
        Where pressures change, and v″ there.
    weight : float
        α.
    border : array
        The last row: its entries on the zone's nodes, and that of δd.
    """

    def __init__(self, influence: Influence, fields: tuple[Mask, Array, Mask], weight: float, border: Array) -> None:
        contact, stiffness, zone = fields
        h = influence.lattice.spacing
        sizes, corners, self.square = gathered(contact, stiffness, zone, h)
        m, held = sizes.size, contact[zone]
        self.nodes = np.bincount(self.square, minlength=m)
        own = np.where(held, weight, stiffness[zone])
        touching = np.bincount(self.square, held, m) > 0.5 * self.nodes
        kept = held == touching[self.square]
        scale = np.bincount(self.square, own * kept, m) / np.bincount(self.square, kept, m)
        matrix = np.empty((m + 1, m + 1))
        matrix[:m, :m] = scale[:, None] * influence.matrix(sizes, corners)
        matrix[np.arange(m), np.arange(m)] += ~touching
        matrix[:m, m] = -scale
        matrix[m, :m] = np.bincount(self.square, border[:-1], m)
        matrix[m, m] = border[-1]
        self.factors = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
        # Within a square the pressure answers its own short waves, half of whose length is its edge.
        wave = np.pi / (sizes[self.square] * h)
        rest = np.where(held, 0.75 * wave / weight, 1.0 / (1.0 + np.maximum(own, 0.0) / wave))
        self.rest = np.where((sizes[self.square] > 1), rest, 0.0)

    def solve(self, vector: Array) -> Array:
        """An approximate solution (y on the zone's nodes, δd)."""
        mean = np.bincount(self.square, vector[:-1], self.nodes.size) / self.nodes
        found = scipy.linalg.lu_solve(self.factors, np.append(mean, vector[-1]), check_finite=False)
        return np.append(found[self.square] + self.rest * (vector[:-1] - mean[self.square]), found[-1])
