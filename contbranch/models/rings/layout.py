"""Which parts of the surface rest at which gap: regions from the centre outwards."""

from __future__ import annotations

from dataclasses import dataclass

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
    is no pressure at all beyond the last edge (`bounded`).
    """

    regions: tuple[Region, ...]
    bounded: bool

    @property
    def edges(self) -> int:
        """Number of free boundaries."""
        return len(self.regions) - (0 if self.bounded else 1)

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
        return not self.regions[edge].rests and not outside

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
        last = region == len(self.regions) - 1
        if not self.regions[region].rests or region == 0 or (last and not self.bounded):
            return None
        if not last and self.regions[region - 1] == self.regions[region + 1]:
            return None
        return Layout(self.regions[:region] + self.regions[region + 1 :], self.bounded)

    def resting(self, edge: int) -> Region:
        """The resting region at an edge."""
        return self.regions[edge] if self.regions[edge].rests else self.regions[edge + 1]

    def born(self, region: int, new: Region, centre: bool) -> Layout:
        """With a region born inside another one, or at the centre of the first."""
        old = self.regions[region]
        inserted = (new, old) if centre else (old, new, old)
        return Layout(self.regions[:region] + inserted + self.regions[region + 1 :], self.bounded)

    def without(self, region: int) -> Layout | None:
        """Without a region that has shrunk to nothing; None if its neighbours cannot be joined."""
        before, after = self.regions[:region], self.regions[region + 1 :]
        if not before:
            return Layout(after, self.bounded) if after else None
        if not after or before[-1] != after[0]:
            return None
        return Layout(before + after[1:], self.bounded)
