"""Numbers of unstable modes of equilibria on lattices under every control."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contbranch.models.grid.linear import Border, Linear
from contbranch.models.grid.newton import Equilibrium, hold_control
from contbranch.models.grid.problem import GridProblem
from contbranch.models.grid.stability import Spectrum, Stability, as_stability


@dataclass(frozen=True)
class Morse:
    """The spectrum, dF/dd along the curve, and pairs spent."""

    spectrum: Spectrum
    slope: float
    pairs: int

    @property
    def displacement(self) -> int:
        """Index at fixed displacement."""
        return self.spectrum.index

    @property
    def load(self) -> int:
        """Index at fixed load."""
        return self.spring(0.0)

    def spring(self, stiffness: float) -> int:
        """Index under the control of a spring of that stiffness: 0 is a load."""
        return self.displacement + int(self.slope + stiffness < 0.0)


def slope(problem: GridProblem, equilibrium: Equilibrium, tolerance: float = 1e-8) -> float:
    """dF/dd along the curve, from one linear solve; infinite at a fold of the displacement."""
    hold = hold_control(problem, 0.0, 1.0, 0.0)
    border = Border(problem, hold.row, hold.load_weight)
    with as_stability(problem):
        linear = Linear(problem, equilibrium.fields.stiffness, equilibrium.contact, border)
        return linear.solve(np.zeros(problem.shape), 1.0, tolerance).load


def morse(stability: Stability | GridProblem, equilibrium: Equilibrium, rate: float | None = None) -> Morse:
    """Index of a state."""
    own = stability if isinstance(stability, Stability) else Stability(stability)
    before = own.problem.counter.stability
    rate = slope(own.problem, equilibrium) if rate is None else rate
    return Morse(own.spectrum(equilibrium), rate, own.problem.counter.stability - before)
