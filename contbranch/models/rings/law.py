"""An interaction law as smooth pieces between levels of the gap at which surfaces can rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import Interaction, MaugisDugdale, Response, Sum

__all__ = ["BandedLaw"]


# Iterations that invert a law, how far they go in units of the first one's, and the share of the largest pressure to
# which they do.
INVERSIONS, FARTHEST, ROUNDING = 30, 4.0, 1e-13


@dataclass(frozen=True)
class BandedLaw:
    """Levels of the gap with a pressure between bounds on them, and the smooth law in the bands between them.

    Level 0 is the wall, ``g = 0``; every repulsive Maugis–Dugdale law adds a level at its range, where its pressure
    jumps from ``sigma`` to 0 with growing gap: there the gap may rest with any pressure in between. Band `k` lies
    between level `k` and level `k + 1` (or infinity).

    Parameters
    ----------
    interaction : Interaction or None
        In reduced units; Maugis–Dugdale attraction, whose pressure jumps the other way, is not represented.
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
        """Gaps at which the surfaces can rest, increasing from 0."""
        return (0.0, *sorted({term.range for term in self._steps}))

    @property
    def outermost(self) -> int:
        """The band that reaches to infinite gaps."""
        return len(self.levels) - 1

    def vanishes(self, band: int) -> bool:
        """Whether there is no pressure at all in a band."""
        return self.smooth is None and band == self.outermost

    def ceiling(self, band: int) -> float:
        """The upper end of a band."""
        return self.levels[band + 1] if band < self.outermost else math.inf

    def evaluate(self, band: int, gap: Array) -> Response:
        """Energy per area, pressure and stiffness of a band's own law, continued beyond its ends."""
        zero = np.zeros_like(gap)
        energy, pressure, stiffness = self.smooth.evaluate(gap) if self.smooth is not None else (zero, zero, zero)
        for step in self._steps:
            if step.range > self.levels[band]:
                sigma = -step.work_of_adhesion / step.range
                energy, pressure = energy + sigma * (step.range - gap), pressure + sigma
        return Response(energy, pressure, stiffness)

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

    def pressure(self, band: int, level: int) -> float:
        """Pressure of a band's law at a level."""
        return float(self.evaluate(band, np.array([self.levels[level]])).pressure[0])

    def energy(self, level: int) -> float:
        """Energy per area at a level, where the bands on both sides agree."""
        return float(self.evaluate(level, np.array([self.levels[level]])).energy[0])

    def bounds(self, level: int) -> tuple[float, float]:
        """Least and largest pressure with which the gap rests at a level."""
        return self.pressure(level, level), self.pressure(level - 1, level) if level else math.inf
