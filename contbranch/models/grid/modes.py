"""Unstable modes of the states on a lattice: those with the symmetry of the tip, and those that break it.

The latter are told by the number m of periods around the axis that dominates in them, and by their eigenvalues. Around
an axis cos mθ and sin mθ are one: of an axisymmetric tip those are found that are even about the axis of x.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.height_map import HeightMap
from contbranch.continuation import CorrectionError, Outcome
from contbranch.curve.problem import Count
from contbranch.results.diagram import ModeShape

from .angular import angular_content, mode_shape
from .newton import Equilibrium
from .resolution import concavity
from .setup import Setup
from .stability import Sector, Spectrum, Stability, as_stability
from .transforms import EVEN
from .variation import Precision

__all__ = ["Mode", "Modes"]

# Share of an even variation's square that is periodic around the axis, from which on it is no axisymmetric one.
PERIODIC = 0.5
# Nodes in a wave around the axis at least: shorter ones are the lattice's own.
NODES = 6.0
# Precision with which an eigenvalue is followed to its zero: it has the square of the vectors' errors.
FOLLOWED = Precision(tolerance=1e-4, share=1e-2)
# Sectors that show all modes of an axisymmetric tip, and those whose modes break a symmetry of others.
ROUND: tuple[Sector, ...] = (EVEN, ("odd", "even"))
ODD: tuple[Sector, ...] = (("odd", "even"), ("even", "odd"), ("odd", "odd"))


class Mode(NamedTuple):
    """An eigenvalue λ with its sector and its variation, (n, n)."""

    value: float
    sector: Sector | None
    vector: Array


class Modes:
    """The modes of the states of one lattice.

    Parameters
    ----------
    setup : Setup
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.stability = Stability(setup.problem)
        self.convex = concavity(setup.law) == 0.0
        tip = setup.contact.tip
        self.axisymmetric = tip.is_axisymmetric and not isinstance(tip, HeightMap) and setup.quarter
        self.sectors = ROUND if self.axisymmetric else ODD
        self._known: tuple[Equilibrium, int, list[Mode]] | None = None
        self._counted: tuple[Equilibrium | None, Count] = None, Count()

    def symmetric(self, state: Equilibrium) -> int:
        """Number of unstable modes with the symmetry of the tip, at fixed displacement."""
        if self.convex:
            return 0
        spectrum = self.stability.spectrum(state, self.stability.sectors[0])
        return self._periods(state, spectrum, spectrum.index).count(0)

    def _periods(self, state: Equilibrium, spectrum: Spectrum, count: int | None = None) -> list[int]:
        """The number of periods of the first variations of a sector, by default of all that are known.

        It is 0 where the variation has the symmetry of the tip, and −1 where its waves are too short for the lattice.
        """
        sector, vectors = spectrum.sector, spectrum.vectors[:count]
        if sector is None or (sector == EVEN and not self.axisymmetric):
            return [0] * len(vectors)
        weight, found, lattice = np.abs(state.fields.stiffness), [], self.setup.lattice
        radius = np.hypot(lattice.axis[:, None], lattice.axis)
        most = 2.0 * math.pi * float((weight * radius).sum() / weight.sum()) / (NODES * lattice.spacing)
        for vector in vectors:
            content = angular_content(self.setup.lattice, vector, weight, sector)
            m = int(content.argmax()) if sector == EVEN else int(content[1:].argmax()) + 1
            own = m == 0 or (sector == EVEN and content[m] <= PERIODIC)
            found.append(0 if own else m if m <= max(most, 2.0) else -1)
        return found

    @property
    def blunt(self) -> bool:
        """Whether the shape of an axisymmetric tip forbids that it breaks the symmetry: ζ'(t)/t does not increase.

        See `contbranch.models.axisymmetric.azimuthal`.
        """
        tip = self.setup.contact.tip.axisymmetric
        if tip is None or self.setup.kind != "free":
            return False
        t = np.linspace(0.0, 1.0, 201)[1:] * min(self.setup.edge, tip.extent)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            ratio = tip.transform_derivative(t) / t
        return bool((np.diff(ratio) <= 1e-12 * np.abs(ratio[1:])).all())

    def count(self, state: Equilibrium) -> Count:
        """Unstable modes that break a symmetry, by their periods."""
        if self.convex or self.blunt:
            return Count()
        if self._counted[0] is state:  # rows of an average share states
            return self._counted[1]
        if self.axisymmetric:
            # cos θ loses its stability first (see `blunt`); what the images of a cell alone would break is their own.
            first = self.stability.spectrum(state, ROUND[1])
            spectra = [] if first.stable else [first, self.stability.spectrum(state, EVEN)]
        else:
            ordered = self.setup.kind == "free"
            spectra = list(self.stability.spectra(state, self.sectors, ordered).values())
        found = Counter(m for one in spectra if one.index for m in self._periods(state, one, one.index) if m > 0)
        self._counted = state, Count(tuple(found[m] for m in range(1, max(found, default=0) + 1)))
        return self._counted[1]

    def of(self, state: Equilibrium, m: int, index: int) -> Mode:
        """The mode with m periods whose eigenvalue is the index-th from the lowest, 1 for the first.

        Raises
        ------
        CorrectionError
            If it is not among the lowest ones.
        """
        own = [sector for sector in self.sectors if ((sector[0] != sector[1]) == (m % 2 == 1))]
        known = self._known
        if known is None or known[0] is not state or known[1] != m or len(known[2]) < index:
            count = index
            while count <= FOLLOWED.basis // 2:
                found = []
                for sector in own:
                    spectrum = self.stability.spectrum(state, sector, FOLLOWED, count)
                    each = zip(self._periods(state, spectrum), spectrum.eigenvalues, spectrum.vectors, strict=True)
                    found += [Mode(float(value), sector, vector) for n, value, vector in each if n == m]
                self._known = known = state, m, sorted(found, key=lambda mode: mode.value)
                if len(found) >= index:
                    break
                count += 2
        if known is None or len(known[2]) < index:
            raise CorrectionError(Outcome.EVALUATION_FAILED, f"(No mode with {m} periods was found.)")
        return known[2][index - 1]

    def eigenvalue(self, state: Equilibrium, m: int, index: int) -> float:
        """1 − λ: above 1 the mode is unstable."""
        with as_stability(self.setup.problem):
            return 1.0 - self.of(state, m, index).value

    def shape(self, state: Equilibrium, m: int, index: int) -> ModeShape:
        """Gap and pressure of a mode against the radius."""
        mode = self.of(state, m, index)
        return mode_shape(self.setup.problem, state, mode.vector, mode.sector or EVEN, m)

    def name(self, state: Equilibrium, m: int, index: int) -> str:
        """What the mode is called."""
        if self.axisymmetric:
            return f"variations cos({m}θ)"
        sector = self.of(state, m, index).sector or EVEN
        odd = [axis for axis, parity in zip("xy", sector, strict=True) if parity == "odd"]
        return f"variations that are odd in {' and '.join(odd)}"
