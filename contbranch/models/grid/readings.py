"""What is seen of a state on a lattice in the plane of load and displacement, and what its nodes leave open."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from contbranch.contact.height_map import HeightMap
from contbranch.curve.problem import Four

from .contact_area import contact_area
from .newton import Equilibrium
from .observables import central_gap, far_field_error, interpolate, smallest_gap
from .ramp import ramp_errors
from .resolution import edge_force, tail_force
from .setup import Setup

__all__ = ["Reading", "clearance", "read"]


class Reading(NamedTuple):
    """The observables of a state, reduced units, with the errors that reading them off the nodes adds.

    The gap at the apex may have closed where no node is in contact yet; it is then zero.
    """

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float
    perimeter: float = 0.0
    load_error: float = 0.0
    displacement_error: float = 0.0
    radius_error: float = 0.0
    gap_error: float = 0.0

    @property
    def errors(self) -> Four:
        """Those of load, displacement, contact radius and central gap."""
        return self.load_error, self.displacement_error, self.radius_error, self.gap_error


def read(setup: Setup, state: Equilibrium, cell: bool = True) -> Reading:
    """Read the observables off a state.

    Parameters
    ----------
    cell : bool
        Whether errors of the finite cell are wanted: what a free cell leaves out, and in a periodic cell what the
        displacement's shift leaves to be desired.
    """
    problem = setup.problem
    load_error = displacement_error = 0.0
    if cell and setup.lattice.kind == "free":
        load_error = tail_force(setup, state)
        # A ring of force at the border moves what is inside by as much as a point force there, twice over to be safe.
        displacement_error = 4.0 * load_error / (math.pi * setup.edge)
    elif cell and not setup.crowded:
        displacement_error = far_field_error(problem, state)
    if cell and (edge := edge_force(setup, state)):
        load_error += edge
        displacement_error += 2.0 * edge / (math.pi * setup.contact.axisymmetric_tip.extent)
    radius = gap = radius_error = gap_error = perimeter = 0.0
    if state.contact.any():
        area = contact_area(problem, state)
        radius, radius_error, perimeter = area.radius, area.radius_error, area.perimeter
    if not isinstance(setup.contact.tip, HeightMap):
        gap, gap_error = central_gap(problem, state)  # open within a ring of contact
        if gap == 0.0 == radius:
            radius_error = setup.lattice.spacing  # a contact so small that it has no node
    elif not state.contact.any():
        gap = smallest_gap(state)
    if cell and radius == 0.0:  # at the rim of a contact what a ramp adds and takes is nearly the same
        inside = np.isfinite(problem.heights)
        gaps = np.maximum(state.fields.gap[inside], 0.0)
        force, length = ramp_errors(setup.law, gaps, setup.lattice.node_area, gap)
        load_error, gap_error, displacement_error = load_error + force, gap_error + length, displacement_error + length
    seen = state.load, state.displacement, radius, gap, problem.total_energy(state.fields)
    return Reading(*seen, perimeter, load_error, displacement_error, radius_error, gap_error)


def clearance(setup: Setup, state: Equilibrium) -> float:
    """The gap that closes at first touch: that at the apex, or the smallest of the nodes."""
    smallest = float(state.fields.gap.min())
    return smallest if setup.crowded else min(smallest, interpolate(setup.lattice, state.u, 0.0, 0.0))
