"""Axisymmetric contact with any number of discs and annuli, and gaps that rest where the law's pressure jumps.

`law` (levels at which a gap can rest, bands between them), `layout` (regions), `panels` (nodes between free boundaries,
elastic response), `equations` (equilibrium), `constraints` (the inequalities), `meshing`, `newton` (states from afar),
`changes` and `topology` (the next layout), `start`, `stability`, `profile`, `problem` (what a curve is made of),
`handover` (curves that begin with a disc), `model`.
"""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.models.rings.model import Rings as Rings

__getattr__, __dir__, __all__ = lazily(__name__, {".model": "Rings"})
