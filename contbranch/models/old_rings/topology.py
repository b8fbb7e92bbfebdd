"""What a change of the contact set is called."""

from __future__ import annotations

from dataclasses import dataclass

from .layout import Layout, Region

__all__ = ["Change", "change"]


@dataclass(frozen=True)
class Change:
    """A change of the contact set: `kind` of the event and a sentence."""

    kind: str
    message: str


def change(before: Layout, region: int, radius: float, new: Region, levels: tuple[float, ...], growing: bool) -> Change:
    """The change in which a region is born inside (or, not growing, vanishes into) another one of `before`.

    Parameters
    ----------
    before : Layout
        The layout without the narrow region.
    region : int
        The region in which it lies.
    radius : float
        Where; 0 at the centre.
    """
    place = "at the centre" if radius == 0.0 else f"on a ring of radius {radius:.6g}"
    wall = new.index == 0 if new.rests else before.regions[region].index == 0
    where = "the wall" if wall else f"a gap of {levels[(new if new.rests else before.regions[region]).index]:.6g}"
    alone = not any(r.rests and r.index == 0 for r in before.regions)
    if new.rests:
        verb = "comes to rest at" if growing else "leaves"
        kind = "touch" if wall and radius == 0.0 and alone else "topology"
        return Change(kind, f"The surface {verb} {where} {place}.")
    verb = "lifts from" if growing else "comes to rest at"
    shape = "a disc opens into a ring" if radius == 0.0 else "an annulus opens"
    if not growing:
        shape = "a ring closes to a disc" if radius == 0.0 else "an annulus closes"
    return Change("topology", f"The surface {verb} {where} {place}: {shape}.")
