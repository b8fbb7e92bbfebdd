"""What a row or an event says of an equilibrium on a lattice."""

from __future__ import annotations

from typing import NamedTuple

from contbranch.height_map import HeightMap

from .contact_area import contact_area
from .newton import Equilibrium
from .observables import central_gap, smallest_gap
from .setup import Setup

__all__ = ["Reading", "read"]


class Reading(NamedTuple):
    """The observables of a state, reduced units, with the errors that reading them off the nodes adds.

    The gap at the apex may have closed where no node is in contact yet; it is then zero.
    """

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float
    radius_error: float = 0.0
    gap_error: float = 0.0

    @property
    def four(self) -> tuple[float, float, float, float]:
        """Load, displacement, contact radius and central gap."""
        return self.load, self.displacement, self.contact_radius, self.central_gap


def read(setup: Setup, state: Equilibrium) -> Reading:
    """Read the observables off a state."""
    problem = setup.problem
    energy = problem.total_energy(state.fields)
    if state.contact.any():
        area = contact_area(problem, state)
        return Reading(state.load, state.displacement, area.radius, 0.0, energy, area.radius_error)
    if isinstance(setup.contact.tip, HeightMap):
        return Reading(state.load, state.displacement, 0.0, smallest_gap(state), energy)
    gap = central_gap(problem, state)
    return Reading(state.load, state.displacement, 0.0, gap.value, energy, 0.0, gap.error)
