"""Fields of a state, as functions of the radius or on the nodes of a cell. Plain data."""

from __future__ import annotations

from typing import Any

import numpy as np

from contbranch.arrays import Array, Flags, Integers
from contbranch.results.record import Record, described, record

# Pressures below this share of the largest are not worth being shown, around a tip that stands alone.
FAINT = 0.01


@record
class Profile(Record):
    """Fields of one state as functions of the radius, in the contact's units.

    Attributes
    ----------
    r, gap, pressure, wall_pressure : array (M,)
        Radius (increasing, from the centre), gap, total pressure and the wall's share of it (zero outside the contact).
    """

    r: Array
    gap: Array
    pressure: Array
    wall_pressure: Array


@record
class ModeShape(Record):
    """A variation ``cos(mode · θ)`` of an axisymmetric state, as a function of the radius.

    Attributes
    ----------
    mode : int
        Number of periods around the axis.
    r : array (M,)
        Radius, increasing, in the contact's unit of length.
    gap : array (M,)
        Change of the gap, scaled so that the largest is 1; zero inside the contact.
    pressure : array (M,)
        Change of the total pressure for that change of the gap: in the unit of pressure over that of the gap. Inside
        the contact it grows without bound towards the rim, which shifts.
    """

    mode: int
    r: Array
    gap: Array = described(unit="")
    pressure: Array = described(unit="")


@record
class CellFields(Record):
    """Fields on the nodes of a square cell, in the contact's units.

    Attributes
    ----------
    x, y : array (N,)
        Coordinates of the nodes along the first and the second index: the tip's middle is at x = y = 0, and node [0, 0]
        of a height map.
    gap, pressure, wall_pressure : array (N, N)
        Gap, total pressure, and the wall's share of it (zero outside the contact).
    """

    x: Array
    y: Array
    gap: Array
    pressure: Array
    wall_pressure: Array

    def patches(self, periodic: bool = True) -> Integers:
        """Nodes of every connected patch of contact, the largest first; nodes are connected along rows and columns.

        Parameters
        ----------
        periodic
            Whether a patch goes on across the border of the cell.
        """
        from scipy.ndimage import label  # slow to import, and seldom needed
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        labels, count = label(self.gap <= 0.0)
        borders = np.hstack([[labels[0], labels[-1]], [labels[:, 0], labels[:, -1]]])
        first, last = borders[:, (borders > 0).all(axis=0) & periodic]
        graph = coo_array((np.ones(first.size), (first, last)), (count + 1, count + 1))
        patches = connected_components(graph, directed=False)[1]
        sizes = np.bincount(patches[labels[labels > 0]])
        return np.sort(sizes[sizes > 0])[::-1]

    def shown(self, nodes: int | None = None) -> CellFields:
        """The part with pressure, as it is, or at `nodes` nodes a side or fewer and in single precision."""
        loud = np.abs(self.pressure) > FAINT * np.abs(self.pressure).max(initial=0.0)
        x, y = (_taken(loud.any(axis=axis), nodes) for axis in (1, 0))
        fields: Any = (
            field[x, y].astype(np.float32 if nodes else np.float64)
            for field in (self.gap, self.pressure, self.wall_pressure)
        )
        return CellFields(self.x[x], self.y[y], *fields)


def _taken(loud: Flags, nodes: int | None) -> slice:
    """The nodes along one side from the first to the last with pressure, and a margin of an eighth."""
    found = np.flatnonzero(loud) if loud.any() else np.array([0, len(loud) - 1])
    margin = 1 + (found[-1] - found[0]) // 8
    first, last = max(found[0] - margin, 0), min(found[-1] + margin + 1, len(loud))
    return slice(first, last, -(-(last - first) // nodes) if nodes else 1)
