"""An interaction law as smooth pieces between the gaps at which its pressure jumps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import Interaction, MaugisDugdale, Response, Sum

__all__ = ["BandedLaw"]

# Places a wavelength at which layers are looked for, as far as the energy per area exceeds this share of the law's.
PLACES_PER_WAVE, WEAKEST_LAYER = 64, 1e-3


@dataclass(frozen=True)
class BandedLaw:
    """Levels of the gap at which the pressure jumps, and the smooth law in the bands between them.

    Level 0 is the wall, ``g = 0``, or less within a soft core; every Maugis–Dugdale law adds a level at its range.
    Where a repulsion ends the gap may rest with any pressure between those of both sides; where an attraction does the
    gap passes. Band `k` lies between level `k` and level `k + 1` (or infinity).

    Parameters
    ----------
    interaction : Interaction or None
        In reduced units.
    """

    interaction: Interaction | None

    @cached_property
    def _steps(self) -> tuple[MaugisDugdale, ...]:
        terms = terms_of(self.interaction)
        return tuple(sorted((t for t in terms if isinstance(t, MaugisDugdale)), key=lambda term: term.range))

    @cached_property
    def smooth(self) -> Interaction | None:
        """The part of the law without jumps."""
        terms = terms_of(self.interaction)
        rest = tuple(term for term in terms if not isinstance(term, MaugisDugdale))
        return None if not rest else rest[0] if len(rest) == 1 else Sum(rest)

    @cached_property
    def levels(self) -> tuple[float, ...]:
        """Gaps at which the pressure jumps, increasing from the wall's, 0 unless the law has a soft core."""
        return (
            0.0 if self.interaction is None else self.interaction.wall,
            *sorted({term.range for term in self._steps}),
        )

    @cached_property
    def layers(self) -> tuple[float, ...]:
        """Gaps between layers of the fluid, where the smooth law gives way most, from the wall on."""
        if self.smooth is None or math.isinf(wave := self.smooth.wave):
            return ()
        gaps = np.arange(0.0, self.smooth.reach(WEAKEST_LAYER), wave / PLACES_PER_WAVE)
        stiffness = self.smooth.evaluate(gaps).stiffness
        least = (stiffness[1:-1] < stiffness[:-2]) & (stiffness[1:-1] <= stiffness[2:]) & (stiffness[1:-1] < 0.0)
        k = np.flatnonzero(least) + 1
        below, at, above = stiffness[k - 1], stiffness[k], stiffness[k + 1]
        return tuple((gaps[k] + (gaps[1] - gaps[0]) * (below - above) / (2 * (below - 2 * at + above))).tolist())

    def holds(self, level: int) -> bool:
        """Whether the gap can rest at a level: at the wall, and where a repulsion ends."""
        if level == 0:
            return True
        above, below = self.bounds(level)
        return above < below

    @property
    def outermost(self) -> int:
        """The band that reaches to infinite gaps."""
        return len(self.levels) - 1

    def vanishes(self, band: int) -> bool:
        """Whether there is no pressure at all in a band."""
        return self.smooth is None and band == self.outermost

    def evaluate(self, band: int, gap: Array) -> Response:
        """Energy per area, pressure and stiffness of a band's own law, continued beyond its ends."""
        zero = np.zeros_like(gap)
        energy, pressure, stiffness = self.smooth.evaluate(gap) if self.smooth is not None else (zero, zero, zero)
        for step in self._steps:
            if step.range > self.levels[band]:
                sigma = -step.work_of_adhesion / step.range
                energy, pressure = energy + sigma * (step.range - gap), pressure + sigma
        return Response(energy, pressure, stiffness)

    def pressure(self, band: int, level: int) -> float:
        """Pressure of a band's law at a level."""
        return float(self.evaluate(band, np.array([self.levels[level]])).pressure[0])

    def energy(self, level: int) -> float:
        """Energy per area at a level, where the bands on both sides agree."""
        return float(self.evaluate(level, np.array([self.levels[level]])).energy[0])

    def bounds(self, level: int) -> tuple[float, float]:
        """Pressures next to a level, above it and below; between them the gap may rest if the first is the lower."""
        return self.pressure(level, level), self.pressure(level - 1, level) if level else math.inf
