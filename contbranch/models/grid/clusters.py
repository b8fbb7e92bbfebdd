"""The linearised problem on few clusters of nodes: what preconditions its solution on all of them.

Nodes are single at the rim of the contact and where the law is stiff, and gathered into squares of 2, 4 and 8 nodes a
side as the solution becomes smooth. With the influence of a square on another, from the lattice's own response to a
pressure (summed over the mirror images where fields are symmetric), the equations on the squares are a small dense
matrix, in single precision. It knows what no filter does: the contact, the localised softening next to its rim, the
film.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from contbranch.arrays import Array, Flags, Integers

from .lattice import Lattice

__all__ = ["Clusters", "Influence", "Squares"]

# Nodes a side of the largest squares, and how often these fit into a cell at least.
LARGEST, PARTS = 8, 32
# Squares of s nodes a side keep NEAR (s - 1) nodes away from the rim, and s h |v''| below RESOLVED.
NEAR, RESOLVED = 2, 2.0
# Squares at most, for every node along one side of what is transformed (a half of it without mirrors) and at all: with
# more the factorisation takes longer than what it saves. Fewer are found by making them larger, at the rim last.
PER_SIDE, MOST = 6, 2000
# Relative change of v'' up to which a factorisation serves on, and number of nodes that join or leave the contact: of
# all, and of those in larger squares, which it does not see.
STALE, CHANGES, HIDDEN = 0.3, 24, 8
# Nodes by which tables of influence reach farther at least than they did.
SLACK = 64


class Squares(NamedTuple):
    """Squares of nodes: their sizes and first nodes, (m,) each, and the square of every node of the zone."""

    sizes: Integers
    x: Integers
    y: Integers
    of_node: Integers


@dataclass
class Influence:
    """Displacements of squares of nodes by pressures on squares of nodes, at fixed displacement of the far field.

    Attributes
    ----------
    lattice : Lattice
    """

    lattice: Lattice
    _reach: tuple[int, int] = (0, 0)
    _tables: dict[tuple[int, int], Array] = field(default_factory=dict)

    def _table(self, rows: int, columns: int) -> Array:
        """Mean displacement of a square for unit pressure on one no larger, by the offset of their first nodes.

        Offsets are in units of the smaller size, of which squares' places are multiples.
        """
        if (rows, columns) not in self._tables:
            # Of twice a size: the mean (rows) or the sum (columns) of that of four squares, one size apart.
            if rows > columns:
                part, step, share = self._table(rows // 2, columns), -rows // 2 // columns, 0.5
            elif columns > 1:
                part, step, share = self._table(rows, columns // 2), 1, 1.0
            else:
                part, step, share = self._response(), 0, 0.5
            for axis in self._wide:
                part = share * (part + np.roll(part, step, axis))
            self._tables[rows, columns] = part[::2, ::2].copy() if rows == columns > 1 else part
        return self._tables[rows, columns]

    def _response(self) -> Array:
        """Displacement by unit pressure on one node, as far as is needed."""
        whole = self.lattice.whole()
        response = np.fft.irfft2(1.0 / whole.held_symbol, s=whole.shape)
        for axis in (0, 1):
            response = response.take(np.arange(self._widths[axis]) - self._reach[axis], axis, mode="wrap")
        return response.astype(np.float32)

    @property
    def _wide(self) -> list[int]:
        """Axes along which there are several nodes."""
        return [axis for axis in (0, 1) if self.lattice.nodes[axis] > 1]

    @property
    def _widths(self) -> tuple[int, int]:
        """Number of offsets of squares from squares and, where there are any, from their mirror images."""
        images = 3 if self.lattice.quarter else 2
        return images * self._reach[0], images * self._reach[1]

    def matrix(self, squares: Squares) -> Array:
        """Mean displacements of all squares (rows) for unit pressures on each (columns)."""
        sizes, x, y, _ = squares
        largest = int(sizes.max(initial=1))
        # Tables of large squares are wrong at their borders, by the sizes of both.
        m, unit = sizes.size, max(SLACK, largest)
        wanted = [int(places.max(initial=0)) + 3 * largest for places in (x, y)]
        if any(reach > old or old % largest for reach, old in zip(wanted, self._reach, strict=True)):
            rows, columns = (-(-max(reach, old) // unit) * unit for reach, old in zip(wanted, self._reach, strict=True))
            self._reach = rows, columns
            self._tables.clear()
        sources = [(x, y)]
        if self.lattice.quarter:
            sources += [(x, -y - sizes), (-x - sizes, y), (-x - sizes, -y - sizes)]
        found: Array = np.empty((m, m), np.float32)
        edges = np.flatnonzero(np.diff(sizes, prepend=0, append=0))
        groups = [slice(int(begin), int(end)) for begin, end in pairwise(edges)]
        for k, b in enumerate(groups):
            size = int(sizes[b.start])
            width = self._widths[1] // size
            places = [(width * own[b] + other[b]) // size for own, other in sources]
            for a in groups[: k + 1]:
                table = self._table(int(sizes[a.start]), size)
                lines = (width * (x[a] + self._reach[0]) + y[a] + self._reach[1]) // size
                found[a, b] = sum(table.take(lines[:, None] - source) for source in places)
                ratio = (sizes[a.start] / size) ** len(self._wide)
                np.multiply(found[a, b].T, ratio, out=found[b, a])
        return found


def gathered(lattice: Lattice, contact: Flags, stiffness: Array, zone: Flags) -> Squares:
    """Gather the nodes of a zone into squares.

    Parameters
    ----------
    lattice : Lattice
    contact, stiffness, zone : array of the lattice's shape
        Stiffness is 0 in contact. The nodes' squares are in the order of the zone's nodes.
    """
    largest = max(LARGEST, 1 << max(0, (max(lattice.nodes) // PARTS).bit_length() - 1))
    # The nodes beyond the zone, on its far sides, do not matter.
    ends = [int(np.flatnonzero(zone.any(axis)).max(initial=0)) + 1 for axis in (1, 0)]
    used = np.s_[: ends[0], : ends[1]]
    missing = [(0, -end % largest) for end in ends]
    contact, zone = np.pad(contact[used], missing, "edge"), np.pad(zone[used], missing)
    softness = np.pad(lattice.spacing * np.abs(stiffness[used]), missing)
    rim = np.zeros_like(zone)
    for first, last in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        changes = contact[first] != contact[last]
        rim[first] |= changes
        rim[last] |= changes
    far: Integers = np.full(zone.shape, max(zone.shape))
    if rim.any():
        far[:] = scipy.ndimage.distance_transform_cdt(~rim, metric="chessboard")
    # Of the squares of every size: whether they hold nodes of the zone, how far the rim is, and the largest h |v''|.
    levels = [(zone, far, softness)]
    while 1 << (len(levels) - 1) < largest:
        some, least, stiffest = (values.reshape(len(values) // 2, 2, -1, 2) for values in levels[-1])
        levels.append((np.logical_or.reduce(some, (1, 3)), least.min((1, 3)), stiffest.max((1, 3))))
    most = min(MOST, PER_SIDE * max(lattice.shape) // (1 if lattice.quarter else 2))
    smallest, near, resolved = 0, NEAR, RESOLVED
    while True:
        squares = _squares(levels, smallest, near, resolved)
        if squares.sizes.size <= most or smallest + 1 == len(levels):
            return squares
        if near:
            near -= 1
        elif resolved < 8.0:
            resolved *= 2.0
        else:
            smallest, resolved = smallest + 1, RESOLVED


def _squares(levels: list[tuple[Flags, Integers, Array]], smallest: int, near: int, resolved: float) -> Squares:
    """The largest squares that are fit, of 2^smallest nodes a side at least."""
    number = np.full(levels[-1][0].shape, -1)
    found, count = [], 0
    for level in range(len(levels) - 1, -1, -1):
        occupied, far, softness = levels[level]
        size = 1 << level
        if level >= smallest:
            fits = occupied & (number < 0)
            if level > smallest:
                fits &= (far > near * (size - 1)) & (size * softness < resolved)
            x, y = np.nonzero(fits)
            number[fits] = count + np.arange(x.size)
            found.append(np.array([np.full(x.size, size), size * x, size * y]))
            count += x.size
        if level:
            number = number.repeat(2, 0).repeat(2, 1)
    sizes, first, second = np.concatenate(found, axis=1)
    return Squares(sizes, first, second, number[levels[0][0]])


@dataclass
class Clusters:
    """The equations on clusters, factorised: on free nodes y + v″ (S y - δd), in contact α (S y - δd).

    Attributes
    ----------
    influence : Influence
    contact, zone : array of bool
        Where the wall is, and where pressures change.
    stiffness : array
        v″ on the zone's nodes, 0 in contact.
    weight : float
        α.
    """

    influence: Influence
    contact: Flags
    zone: Flags
    stiffness: Array
    weight: float

    def __post_init__(self) -> None:
        h = self.influence.lattice.spacing
        whole = np.zeros(self.zone.shape)
        whole[self.zone] = self.stiffness
        squares = gathered(self.influence.lattice, self.contact, whole, self.zone)
        self.square, m = squares.of_node, squares.sizes.size
        self.nodes = np.bincount(self.square, minlength=m)
        self.single = squares.sizes[self.square] == 1
        # Within a square the pressure answers its own short waves, half of whose length is its edge.
        self.wave = np.pi / (squares.sizes[self.square] * h)
        self.influences = self.influence.matrix(squares)
        self.held = self.contact[self.zone]
        self._factorise()

    def _factorise(self) -> None:
        m, held, self._first = self.nodes.size, self.held, self.held
        self.touching = np.bincount(self.square, held, m) > 0.5 * self.nodes
        # Where contact and free nodes are in one square, the square is what most of them are.
        kept = held == self.touching[self.square]
        own = np.where(held, self.weight, self.stiffness)
        self._scale = np.bincount(self.square, own * kept, m) / np.bincount(self.square, kept, m)
        lattice = self.influence.lattice
        matrix = np.empty((m + 1, m + 1), self.influences.dtype)
        np.multiply(self._scale[:, None], self.influences, out=matrix[:m, :m])
        matrix[np.arange(m), np.arange(m)] += ~self.touching
        matrix[:m, m] = -self._scale
        # Any border will do that makes the matrix regular at folds.
        matrix[m, :m] = lattice.compliance * lattice.node_area * self.nodes
        matrix[m, m] = 1.0
        self._factors = scipy.linalg.lu_factor(matrix.T, overwrite_a=True, check_finite=False)
        rest = np.where(held, 0.75 * self.wave / self.weight, 1.0 / (1.0 + np.maximum(own, 0.0) / self.wave))
        self.rest = np.where(self.single, 0.0, rest)
        self._columns: dict[int, Array] = {}
        self._change()

    def _change(self) -> None:
        """The rows of nodes that have changed since: A⁻¹ - Z (1 + R Z)⁻¹ R A⁻¹ with these rows' change R, Z = A⁻¹."""
        changed = np.flatnonzero((self.held != self._first) & self.single)
        places, m = self.square[changed], self.nodes.size
        rows = np.hstack([self.influences[places], np.full((places.size, 1), -1.0)])
        rows *= (np.where(self.held, self.weight, self.stiffness)[changed] - self._scale[places])[:, None]
        rows[np.arange(places.size), places] += np.where(self.held[changed], -1.0, 1.0)
        new = [place for place in places.tolist() if place not in self._columns]
        if new:
            self._columns.update(zip(new, self._back(np.eye(m + 1)[new].T).T, strict=True))
        columns = np.array([self._columns[place] for place in places.tolist()]).reshape(-1, m + 1).T
        self._low = columns @ np.linalg.inv(np.eye(places.size) + rows @ columns), rows
        self.aside = self._inverse(np.eye(1, m + 1, m)[0])

    def _back(self, vector: Array) -> Array:
        # By LAPACK itself: what SciPy asks besides takes as long.
        return np.asarray(scipy.linalg.lapack.sgetrs(*self._factors, vector, trans=1)[0], np.float64)

    def _inverse(self, vector: Array) -> Array:
        found, (columns, rows) = self._back(vector), self._low
        return found - columns @ (rows @ found)

    def serves(self, contact: Flags, zone: Flags) -> bool:
        """Whether these are the clusters for a contact and a zone, or are but for few nodes at its rim."""
        if (zone & ~self.zone).any():
            return False
        changed = self._first != contact[self.zone]
        return int(changed.sum()) <= CHANGES and int((changed & ~self.single).sum()) <= HIDDEN

    def renew(self, contact: Flags, stiffness: Array) -> None:
        """Go over to another contact, and another v″, given on all nodes, where it differs by more than matters."""
        held, now = contact[self.zone], stiffness[self.zone]
        same = held == self.held
        self.held = held
        stale = same & (np.abs(now - self.stiffness) > STALE * np.maximum(np.abs(now), self.wave))
        if stale.any():
            self.stiffness = now
            self._factorise()
        elif not same.all():
            self.stiffness = np.where(same, self.stiffness, now)
            self._change()

    def border(self, row: Array) -> Array:
        """A row of the equations on the zone's nodes, and on δd, as one of those on clusters."""
        return np.append(np.bincount(self.square, row[:-1], self.nodes.size), row[-1])

    def solve(self, vector: Array, border: Array) -> Array:
        """An approximate solution (y on the zone's nodes, δd) with a border."""
        mean = np.bincount(self.square, vector[:-1], self.nodes.size) / self.nodes
        found = self._inverse(np.append(mean, 0.0))
        # A border may be empty, where there is no way from one state to another.
        found += (vector[-1] - border @ found) / (border @ self.aside or np.inf) * self.aside
        return np.append(found.take(self.square) + self.rest * (vector[:-1] - mean.take(self.square)), found[-1])
