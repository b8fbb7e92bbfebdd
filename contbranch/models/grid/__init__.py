"""Elastic contact on square lattices with fast transforms: a periodic cell, or a cell alone in free space."""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.models.grid.curves import LatticeCurves as LatticeCurves
    from contbranch.models.grid.model import FreeSpace as FreeSpace, Periodic as Periodic
    from contbranch.models.grid.resolution import GridWarning as GridWarning

__getattr__, __dir__, __all__ = lazily(
    __name__, {".curves": "LatticeCurves", ".model": "FreeSpace Periodic", ".resolution": "GridWarning"}
)
