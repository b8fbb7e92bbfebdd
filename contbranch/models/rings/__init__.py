"""Axisymmetric contact with any number of discs and annuli, and gaps that rest where the law's pressure jumps.

From the discretisation to the results: `law` (levels at which a gap can rest, bands between them), `layout` (regions),
`panels` (nodes between free boundaries, elastic response), `problem` (equilibrium), `meshing`, `constraints` (the
inequalities), `legs` (the curve of one layout), `changes` (the next one), `topology`, `journey` (all legs), `start`,
`accuracy` (errors), `stability`, `profile`, `results`, `trace`, `solve`, `handover` (curves that begin with a disc),
`model`.
"""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.models.rings.model import Rings

__all__ = ["Rings"]

__getattr__, __dir__ = lazily(__name__, {".model": "Rings"})
