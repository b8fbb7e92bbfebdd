"""A law in bands between its levels, which tells gaps, too."""

from __future__ import annotations

import math

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.models.axisymmetric import law

__all__ = ["BandedLaw"]

# Iterations that invert a law, how far they go in units of the first one's, and the share of the largest pressure to
# which they do.
INVERSIONS, FARTHEST, ROUNDING = 30, 4.0, 1e-13


class BandedLaw(law.BandedLaw):
    """The same with ends of bands, and inverted."""

    def ceiling(self, band: int) -> float:
        """The upper end of a band."""
        return self.levels[band + 1] if band < self.outermost else math.inf

    def gap(self, band: int, pressure: Array, near: Array) -> tuple[Array, Array]:
        """Gaps at which a band's law has given pressures, near others, and its stiffness there, 0 where none was found.

        Newton's method, for pressures that fall with the gap, no farther than a few of its first steps.
        """
        gap, scale, room = near, magnitude(pressure), np.full(near.shape, math.inf)
        for _ in range(INVERSIONS):
            _, answer, stiffness = self.evaluate(band, gap)
            off = answer - pressure
            step = np.divide(off, stiffness, out=np.zeros_like(off), where=stiffness > 0.0)
            room = FARTHEST * np.abs(step) if gap is near else room
            gap = np.clip(gap + step, near - room, near + room)
            if not (np.abs(off) > ROUNDING * scale).any():
                break
        return gap, np.where((np.abs(off) <= ROUNDING * scale) & (stiffness > 0.0), stiffness, 0.0)
