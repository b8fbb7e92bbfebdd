"""Numbers of unstable modes of equilibria on lattices under every control, from the spectra of all sectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contbranch.models.grid.linear import Border, Linear
from contbranch.models.grid.newton import Equilibrium, hold_control
from contbranch.models.grid.problem import GridProblem
from contbranch.models.grid.stability import SECTORS, Sector, Spectrum, Stability, as_stability
from contbranch.models.grid.transforms import EVEN


@dataclass(frozen=True)
class Morse:
    """Spectra of all sectors, dF/dd along the curve, pairs spent, and whether x and y can be exchanged."""

    spectra: Mapping[Sector | None, Spectrum]
    slope: float
    pairs: int
    swapped: bool

    @property
    def displacement(self) -> int:
        """Index at fixed displacement, all sectors."""
        return sum(spectrum.index for spectrum in self.spectra.values())

    @property
    def load(self) -> int:
        """Index at fixed load, all sectors."""
        return self.spring(0.0)

    def spring(self, stiffness: float) -> int:
        """Index under the control of a spring of that stiffness: 0 is a load."""
        return self.displacement + int(self.slope + stiffness < 0.0)

    @property
    def breaking(self) -> int:
        """Unstable modes that lack a symmetry of the state: one of the mirrors, or the exchange of x and y."""
        odd = sum(found.index for sector, found in self.spectra.items() if sector not in (EVEN, None))
        even = self.spectra.get(EVEN)
        if even is None or not self.swapped:
            return odd
        return odd + int(((even.eigenvalues < 0.0) & (exchange(even) < 0.0)).sum())

    @property
    def symmetric(self) -> int:
        """Index at fixed displacement of variations with the symmetry of the state."""
        return self.displacement - self.breaking

    @property
    def uncertain(self) -> bool:
        """Whether a sign is within its error."""
        return any(spectrum.uncertain for spectrum in self.spectra.values())


def exchange(spectrum: Spectrum) -> np.ndarray:
    """What an exchange of x and y does to the vectors: 1 or -1, or in between where it is no symmetry of the state."""
    vectors = spectrum.vectors
    return np.einsum("kij,kji->k", vectors, vectors) / np.einsum("kij,kij->k", vectors, vectors)


def slope(problem: GridProblem, equilibrium: Equilibrium, tolerance: float = 1e-8) -> float:
    """dF/dd along the curve, from one linear solve; infinite at a fold of the displacement."""
    hold = hold_control(problem, 0.0, 1.0, 0.0)
    border = Border(problem, hold.row, hold.load_weight)
    with as_stability(problem):
        linear = Linear(problem, equilibrium.fields.stiffness, equilibrium.contact, border)
        return linear.solve(np.zeros(problem.shape), 1.0, tolerance).load


def morse(
    stability: Stability | GridProblem, equilibrium: Equilibrium, rate: float | None = None, count: int = 0
) -> Morse:
    """Index of a state; with a count eigenvalues are found even in sectors that are known to be stable."""
    own = stability if isinstance(stability, Stability) else Stability(stability)
    problem = own.problem
    before = problem.counter.stability
    rate = slope(problem, equilibrium) if rate is None else rate
    spectra: dict[Sector | None, Spectrum]
    if problem.lattice.quarter:
        ordered = not count and (problem.lattice.kind == "free" or rate >= 0.0)
        spectra = {**own.spectra(equilibrium, SECTORS, ordered, count)}
    else:
        spectra = {None: own.spectrum(equilibrium, None, count=count)}
    return Morse(spectra, rate, problem.counter.stability - before, own.swapped)
