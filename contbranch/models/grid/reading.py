"""What a row or an event says of an equilibrium on a lattice."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .newton import Equilibrium
from .problem import GridProblem

__all__ = ["Reading", "read"]


class Reading(NamedTuple):
    """The observables of a state, reduced units; `radius_error` is that of the sub-grid contact radius."""

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float
    radius_error: float = 0.0

    @property
    def four(self) -> tuple[float, float, float, float]:
        """Load, displacement, contact radius and central gap."""
        return self.load, self.displacement, self.contact_radius, self.central_gap


def read(problem: GridProblem, state: Equilibrium) -> Reading:
    """Read the observables off a state."""
    contact = int(state.contact.sum())
    radius = float(np.sqrt(contact * problem.lattice.node_area / np.pi))
    gap = 0.0 if contact else max(float(state.fields.gap.min()), 0.0)
    return Reading(state.load, state.displacement, radius, gap, problem.total_energy(state.fields))
