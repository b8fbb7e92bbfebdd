"""The grid models: a periodic cell, and a cell in free space, for any tip and every law."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar, Self

from contbranch.contact.contact import WIDEST, Contact
from contbranch.contact.height_map import HeightMap
from contbranch.contact.units import positive_number
from contbranch.errors import InputError
from contbranch.grid_size import grid_points

from .units import REDUCED_VALUES, UnitValues

if TYPE_CHECKING:
    from .lattice import Kind
    from .setup import Setup

__all__ = ["FreeSpace", "Periodic"]

# Spacings of nodes that a layer has in free space at least, where its response is taken at the nodes.
THINNEST = 2.0


@dataclass(frozen=True)
class _Cell:
    """What both models have in common.

    Attributes
    ----------
    cell : float, optional
        Edge of the square cell, in the contact's unit of length; default: that of a height map, or large enough for
        what interacts.
    grid : int, optional
        Nodes along the edge, even and at least 8, best without prime factors above 7; of a height map those along the
        edge that has the most. Default: those of the height map, or chosen from the accuracy asked for.
    threads : int
        Of the transforms.
    units : UnitValues
        Set where the model is used: what reduced units are worth, for messages.

    Raises
    ------
    InputError
        For a cell, grid or number of threads that cannot be used.
    """

    name: ClassVar[Kind]

    cell: float | None = None
    grid: int | None = None
    threads: int = 1
    units: UnitValues = field(default=REDUCED_VALUES, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.cell is not None:
            object.__setattr__(self, "cell", positive_number(self.cell, "cell"))
        if self.grid is not None:
            object.__setattr__(self, "grid", grid_points(self.grid, "grid"))
        if isinstance(self.threads, bool) or not isinstance(self.threads, int) or self.threads < 1:
            raise InputError(f"threads: {self.threads!r}; must be a whole number, 1 at least")

    def scaled(self, contact: Contact) -> Self:
        """Return the model with its cell in the reduced units of a contact."""
        scales = contact.scales
        units = UnitValues(scales.in_plane, scales.normal, scales.load)
        cell = None if self.cell is None else self.cell / scales.in_plane
        if cell is not None and not 1.0 / WIDEST < cell < WIDEST:
            raise InputError(
                f"cell: {cell:.3g} of the contact's own lengths; must be within {1.0 / WIDEST:g} to {WIDEST:g}"
            )
        return replace(self, cell=cell, units=units)

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        soft = contact.interaction is not None and contact.interaction.wall < 0.0
        return "on a grid a law needs a wall: use core='wall'" if soft else None

    def setup(self, contact: Contact, field: str | None, value: float | None, accuracy: float) -> Setup:
        """The lattice for a reduced contact: as given, and what is not given chosen for a load or displacement."""
        cell, grid = self.cell, self.grid
        tip = contact.tip
        if isinstance(tip, HeightMap):
            if cell is not None and not tip.covers(cell):
                unit = self.units.in_plane
                own = " x ".join(f"{edge * unit:g}" for edge in tip.edges)
                raise InputError(f"cell: {cell * unit:g}; the height map has the cell {own}: leave cell out")
            edges, nodes = tip.edges, tip.points if grid is None else tip.nodes_of(grid)
            if self.name == "free" and 1 in nodes:
                raise InputError("model: free; a line contact needs a periodic cell: use model='periodic'")
        else:
            if cell is None or grid is None:
                from .size import chosen_size  # which traces a model without a grid

                cell, grid = chosen_size(contact, self.name, (cell, grid), (field, value), accuracy)
            edges, nodes = (cell, cell), (grid, grid)
        body, spacing = contact.body, max(edge / count for edge, count in zip(edges, nodes, strict=True))
        if self.name == "free" and body is not None and body.thickness < THINNEST * spacing:
            raise InputError(
                f"model: free; the layer is thinner than {THINNEST:g} spacings of its nodes: use model='periodic'"
            )
        from .setup import Setup

        found = Setup(contact, self.name, edges, nodes, threads=self.threads, units=self.units)
        from .resolution import refuse_too_large

        refuse_too_large(found)
        return found


@dataclass(frozen=True)
class Periodic(_Cell):
    """A periodic cell: a square array of tips, or a surface that repeats.

    The displacement is that of the far field of a single tip: the cell's finite-size shift is applied.
    """

    name: ClassVar[Kind] = "periodic"


@dataclass(frozen=True)
class FreeSpace(_Cell):
    """A cell alone on the half space: pressures act through 1/(πEr), without images.

    What interacts must lie within the disc inscribed in the cell.
    """

    name: ClassVar[Kind] = "free"
