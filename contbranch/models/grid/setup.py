"""From a contact to its problem on a lattice, and fields from one lattice to another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.contact.interactions import Interaction
from contbranch.errors import InputError
from contbranch.grid_size import LEAST_GRID

from .lattice import Kind, Lattice
from .observables import weights
from .problem import GridProblem
from .ramp import on_lattice
from .transforms import Counter
from .units import REDUCED_VALUES, UnitValues

__all__ = ["Setup", "UnitValues", "coarsened", "doubled", "refined"]


@dataclass(frozen=True)
class Setup:
    """A reduced contact in a cell.

    Attributes
    ----------
    contact : Contact
        In reduced units.
    kind : {"periodic", "free"}
    edges : (float, float)
    nodes : (int, int)
        Along each edge.
    symmetric : bool
        Whether mirror symmetries of the tip may be used.
    threads : int
    counter : Counter
        Shared by the problems on all grids.
    units : UnitValues
        What reduced units are worth in the contact's own, for messages.
    """

    contact: Contact
    kind: Kind
    edges: tuple[float, float]
    nodes: tuple[int, int]
    symmetric: bool = True
    threads: int = 1
    counter: Counter = field(default_factory=Counter)
    units: UnitValues = REDUCED_VALUES

    @property
    def quarter(self) -> bool:
        """Whether a quarter of the cell is enough."""
        tip = self.contact.tip
        return self.symmetric and tip.mirror_symmetric and not isinstance(tip, HeightMap)

    @cached_property
    def lattice(self) -> Lattice:
        """The lattice."""
        return Lattice(self.kind, self.edges, self.nodes, self.quarter, self.contact.body)

    @cached_property
    def problem(self) -> GridProblem:
        """The problem on the lattice, with its plans."""
        tip, lattice = self.contact.tip, self.lattice
        if isinstance(tip, HeightMap):
            heights = tip.on_grid(self.nodes)
        else:
            x, y = (axis[part] for axis, part in zip(lattice.axes, lattice.cell, strict=True))
            heights = tip.surface(x[:, None], y[None, :])
            if not np.isfinite(heights).any():
                raise InputError("grid: no node of it lies under the tip; take a finer grid or a smaller cell")
        return GridProblem(lattice, lattice.fill(heights), self.law, self.threads, self.counter)

    def of_cell(self, load: float, displacement: float, energy: float) -> dict[str, float]:
        """What a state is in a periodic cell by itself: the mean gap, and the energy without C F²/2.

        The displacement, and with it the energy, is otherwise that of the far field of a single contact. Nothing in
        free space, or where the tip ends.
        """
        compliance = self.lattice.compliance
        if self.kind == "free" or not np.isfinite(self.mean_height):
            return {}
        gap = self.mean_height + compliance * load - displacement
        return {"mean_gap": gap, "cell_energy": energy - 0.5 * compliance * load**2}

    @cached_property
    def mean_height(self) -> float:
        """Mean of the tip's heights over the cell."""
        return float(self.problem.heights[self.lattice.cell].mean())

    @cached_property
    def law(self) -> Interaction | None:
        """The contact's law as the lattice represents it."""
        return on_lattice(self.contact.interaction, self.lattice.spacing)

    @property
    def edge(self) -> float:
        """The shorter edge of the cell; that along a line contact."""
        return min(edge for edge, nodes in zip(self.edges, self.nodes, strict=True) if nodes > 1)

    @property
    def grid(self) -> int:
        """Nodes along the edge with the most of them."""
        return max(self.nodes)

    @property
    def length(self) -> float:
        """The range of the law; without one, the tip's own length."""
        law = self.contact.interaction
        return law.range if law is not None else self.contact.tip.natural_length

    @cached_property
    def coarse(self) -> Setup | None:
        """The same contact on half the nodes a side, if they are enough to compare with."""
        parts, least = 4 if self.quarter else 2, 2 * LEAST_GRID
        if any(n > 1 and (n % parts or n < least) for n in self.nodes):
            return None
        return replace(self, nodes=(max(self.nodes[0] // 2, 1), max(self.nodes[1] // 2, 1)))

    @cached_property
    def fine(self) -> Setup:
        """The same contact on twice the nodes a side."""
        rows, columns = (2 * n if n > 1 else 1 for n in self.nodes)
        return replace(self, nodes=(rows, columns))

    def whole(self) -> Setup:
        """The same contact without use of symmetries."""
        return replace(self, symmetric=False)

    @property
    def crowded(self) -> bool:
        """Whether the tip fills its cell, so that contact and interaction reach the border by right."""
        return isinstance(self.contact.tip, HeightMap)

    @property
    def centred(self) -> bool:
        """Whether nodes lie in the middle of their squares (else on a corner, as those of a height map)."""
        return not isinstance(self.contact.tip, HeightMap)


def coarsened(values: Array, centred: bool = True) -> Array:
    """A field on the lattice with half the nodes a side."""
    if not centred:
        return np.array(values[::2, ::2])
    rows, columns = (count // 2 for count in values.shape)
    return np.asarray(values.reshape(rows, 2, columns, 2).mean(axis=(1, 3)))


def doubled(flags: Flags, shape: tuple[int, int]) -> Flags:
    """The nodes of a finer lattice that lie next to those flagged."""
    for axis in (0, 1):
        flags = flags.repeat(shape[axis] // flags.shape[axis], axis)
    return flags


def refined(values: Array, lattice: Lattice, centred: bool = True) -> Array:
    """A field on the lattice with twice the nodes a side, by its trigonometric interpolant.

    Parameters
    ----------
    values : array
        Even about the middle lines if the lattice is a quarter.
    lattice : Lattice
        On which it is given.
    """
    for side, (axis, spacing) in enumerate(zip(lattice.axes, lattice.spacings, strict=True)):
        if lattice.nodes[side] > 1:
            first = axis[0] - 0.25 * spacing * centred
            between = weights(lattice, side, first + 0.5 * spacing * np.arange(2 * len(axis))[:, None])
            values = between @ values if side == 0 else values @ between.T
    return values
