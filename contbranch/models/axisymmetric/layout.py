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

    Resting and floating ones alternate, except where the pressure jumps between two bands: where an attraction ends, or
    where a resting ring is too narrow to matter. The last region reaches to infinity, unless it ends at the last edge
    (`bounded`), beyond which there is no pressure.
    """

    regions: tuple[Region, ...]
    bounded: bool

    def born(self, region: int, new: Region, centre: bool) -> Layout:
        """With a region born inside another one, or at the centre of the first."""
        old = self.regions[region]
        return self._with(region, (new, old) if centre else (old, new, old), region + 1)

    def without(self, region: int) -> Layout | None:
        """Without a region that has shrunk to nothing; None if its neighbours cannot be joined."""
        before, after = self.regions[:region], self.regions[region + 1 :]
        if not before:
            return self._with(0, (), 1) if after else None
        return self._with(region, (), region + 2) if after and before[-1] == after[0] else None

    def collapsed(self, region: int) -> Layout | None:
        """With a narrow resting ring replaced by a jump; None if it does not separate two bands."""
        before, after = self.regions[:region], self.regions[region + 1 :]
        if not before or not self.regions[region].rests or not (after or self.bounded):
            return None
        return None if after and before[-1] == after[0] else self._with(region, (), region + 1)

    def _with(self, first: int, new: tuple[Region, ...], last: int) -> Layout:
        """With other regions in place of some."""
        return Layout(self.regions[:first] + new + self.regions[last:], self.bounded)
