"""From a contact to its problem on a lattice, and fields from one lattice to another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.contact.interactions import Interaction
from contbranch.errors import InputError

from .lattice import Kind, Lattice
from .observables import weights
from .problem import GridProblem
from .ramp import on_lattice
from .transforms import Counter
from .units import REDUCED_VALUES, UnitValues

__all__ = ["Setup", "UnitValues", "coarsened", "refined"]


@dataclass(frozen=True)
class Setup:
    """A reduced contact in a cell.

    Attributes
    ----------
    contact : Contact
        In reduced units.
    kind : {"periodic", "free"}
    edge : float
    grid : int
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
    edge: float
    grid: int
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
        return Lattice(self.kind, self.edge, self.grid, self.quarter)

    @cached_property
    def problem(self) -> GridProblem:
        """The problem on the lattice, with its plans."""
        tip, lattice = self.contact.tip, self.lattice
        if isinstance(tip, HeightMap):
            heights = tip.on_grid(self.edge, self.grid)
        else:
            axis = lattice.axis[: lattice.inside]
            heights = tip.surface(axis[:, None], axis[None, :])
            if not np.isfinite(heights).any():
                raise InputError("grid: no node of it lies under the tip; take a finer grid or a smaller cell")
        return GridProblem(lattice, lattice.fill(heights), self.law, self.threads, self.counter)

    @cached_property
    def law(self) -> Interaction | None:
        """The contact's law as the lattice represents it."""
        return on_lattice(self.contact.interaction, self.lattice.spacing)

    @property
    def length(self) -> float:
        """The range of the law; without one, the tip's own length."""
        law = self.contact.interaction
        return law.range if law is not None else self.contact.tip.natural_length

    @cached_property
    def coarse(self) -> Setup | None:
        """The same contact on half the nodes a side, if they are enough to compare with."""
        return None if self.grid % 4 or self.grid < 16 else replace(self, grid=self.grid // 2)

    @cached_property
    def fine(self) -> Setup:
        """The same contact on twice the nodes a side."""
        return replace(self, grid=2 * self.grid)

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
    n = values.shape[0] // 2
    return np.asarray(values.reshape(n, 2, n, 2).mean(axis=(1, 3)))


def refined(values: Array, lattice: Lattice, centred: bool = True) -> Array:
    """A field on the lattice with twice the nodes a side, by its trigonometric interpolant.

    Parameters
    ----------
    values : array
        Even about the middle lines if the lattice is a quarter.
    lattice : Lattice
        On which it is given.
    """
    first = lattice.axis[0] - 0.25 * lattice.spacing * centred
    between = weights(lattice, first + 0.5 * lattice.spacing * np.arange(2 * lattice.size)[:, None])
    return between @ values @ between.T
