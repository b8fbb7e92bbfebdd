"""Which parts of the surface rest at which gap: regions from the centre outwards."""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["Layout", "Region"]


@dataclass(frozen=True)
class Region:
    """A disc or annulus (or what lies outside of all of them).

    Attributes
    ----------
    rests : bool
        Whether the gap rests at a level there, with an unknown pressure; otherwise it floats within a band, with the
        law's pressure.
    index : int
        Level or band, see `BandedLaw`.
    """

    rests: bool
    index: int


@dataclass(frozen=True)
class Layout:
    """Regions from the centre outwards.

    Resting and floating ones alternate, except where a resting ring is too narrow to matter: there the two floating
    regions that it separates join at a *jump* of the law's pressure. The last region reaches to infinity, unless there
    is no pressure at all beyond the last edge (`bounded`): that is free, or the edge of the tip, up to which it is felt
    then (`whole`).
    """

    regions: tuple[Region, ...]
    bounded: bool
    whole: bool = False

    @property
    def edges(self) -> int:
        """Number of boundaries, the edge of a tip that is felt as a whole among them."""
        return len(self.regions) - (0 if self.bounded else 1)

    @property
    def single(self) -> bool:
        """Whether one disc of contact with the wall is all that rests, or nothing does."""
        *resting, around = self.regions
        return not around.rests and resting in ([], [Region(True, 0)])

    def neighbour(self, edge: int) -> tuple[int, Region]:
        """The resting region at an edge (0: inside of it, 1: outside of it), and the floating one (its band)."""
        inner = self.regions[edge]
        outer = self.regions[edge + 1] if edge + 1 < len(self.regions) else None
        if inner.rests:
            return 0, outer if outer is not None else Region(False, inner.index)
        return 1, inner

    def jump(self, edge: int) -> bool:
        """Whether the floating regions of two bands meet at an edge."""
        outside = self.regions[edge + 1].rests if edge + 1 < len(self.regions) else False
        return not (self.regions[edge].rests or outside or self.ends(edge))

    def ends(self, edge: int) -> bool:
        """Whether an edge is that of the tip."""
        return self.whole and edge == len(self.regions) - 1

    @property
    def jumps(self) -> bool:
        """Whether there is a jump anywhere."""
        return any(self.jump(edge) for edge in range(self.edges))

    def jump_level(self, edge: int) -> int:
        """The level at which two bands meet."""
        if edge + 1 < len(self.regions):
            return max(self.regions[edge].index, self.regions[edge + 1].index)
        return self.regions[edge].index + 1

    def collapsed(self, region: int) -> Layout | None:
        """With a narrow resting ring replaced by a jump; None if it does not separate two bands."""
        before, own, after = self.regions[:region], self.regions[region : region + 1], self.regions[region + 1 :]
        if not before or not any(gone.rests for gone in own) or not (after or self.bounded):
            return None
        return None if after and before[-1] == after[0] else replace(self, regions=before + after)

    def resting(self, edge: int) -> Region:
        """The resting region at an edge."""
        return self.regions[edge] if self.regions[edge].rests else self.regions[edge + 1]

    def born(self, region: int, new: Region, centre: bool) -> Layout:
        """With a region born inside another one, or at the centre of the first."""
        old = self.regions[region]
        inserted = (new, old) if centre else (old, new, old)
        return replace(self, regions=self.regions[:region] + inserted + self.regions[region + 1 :])

    def without(self, region: int) -> Layout | None:
        """Without a region that has shrunk to nothing; None if its neighbours cannot be joined.

        What lies outside of a bounded layout counts as its last region where the tip ends: that may vanish.
        """
        before, after = self.regions[:region], self.regions[region + 1 :]
        if not before:
            return replace(self, regions=after) if after else None
        if not after and (self.whole or region == len(self.regions)) and not before[-1].rests:
            return replace(self, regions=before, whole=True)
        return replace(self, regions=before + after[1:]) if after and before[-1] == after[0] else None
