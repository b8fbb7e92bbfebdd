"""Elastic contact on square lattices with fast transforms: a periodic cell, or a cell alone in free space."""

from .curves import LatticeCurves
from .model import FreeSpace, Periodic
from .resolution import GridWarning

__all__ = ["FreeSpace", "GridWarning", "LatticeCurves", "Periodic"]
