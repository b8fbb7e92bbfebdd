"""From a contact to its problem on a lattice, and fields from one lattice to another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.contact.interactions import Interaction

from .arrays import Array, Mask
from .lattice import Kind, Lattice
from .problem import GridProblem
from .ramp import on_lattice
from .transforms import Counter
from .units import REDUCED_VALUES, UnitValues

__all__ = ["Setup", "UnitValues", "coarsened", "refined", "refined_mask"]


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
        return GridProblem(lattice, lattice.fill(np.asarray(heights)), self.law, self.threads, self.counter)

    @cached_property
    def law(self) -> Interaction | None:
        """The contact's law as the lattice represents it."""
        return on_lattice(self.contact.interaction, self.lattice.spacing)

    @property
    def length(self) -> float:
        """The range of the law; without one, the tip's own length."""
        law = self.contact.interaction
        return law.range if law is not None else self.contact.tip.natural_length

    def on(self, grid: int) -> Setup:
        """The same contact on another grid."""
        return replace(self, grid=grid)

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
    if lattice.quarter:
        from scipy.fft import dctn, idctn

        n = values.shape[0]
        spectrum = np.zeros((2 * n, 2 * n))
        spectrum[:n, :n] = dctn(values, type=2)
        return np.asarray(4.0 * idctn(spectrum, type=2))
    n = values.shape[0]
    half = n // 2
    spectrum = np.fft.fftshift(np.fft.fft2(values))
    # the shortest wave has no partner of the opposite sign: half of it on either side
    padded = np.zeros((2 * n, 2 * n), dtype=complex)
    block = np.zeros((n + 1, n + 1), dtype=complex)
    block[:n, :n] = spectrum
    block[0, :] *= 0.5
    block[n, :] = block[0, :]
    block[:, 0] *= 0.5
    block[:, n] = block[:, 0]
    padded[half : half + n + 1, half : half + n + 1] = block
    if centred:
        turns = np.fft.fftshift(np.fft.fftfreq(2 * n)) * 2.0 * np.pi
        shift = np.exp(-0.5j * turns)
        padded *= shift[:, None] * shift[None, :]
    return np.asarray(4.0 * np.fft.ifft2(np.fft.ifftshift(padded)).real)


def refined_mask(mask: Mask) -> Mask:
    """Nodes of the finer lattice that lie in the squares of the coarse one's."""
    return np.repeat(np.repeat(mask, 2, axis=0), 2, axis=1)
