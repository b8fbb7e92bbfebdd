"""Trial states for a lattice from the axisymmetric model: of the tip itself, or of the parabola most like it.

Heights tell which radius of a parabola a node corresponds to, r = √(2 R z) with R = 1 in reduced units: exact for a
parabola, and a fair start for any tip with one round summit. Where the tip is axisymmetric its own profile is used.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.contact.tips import Parabola
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.trace import Request
from contbranch.errors import InputError, ModelError
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.results.diagram import State

from .newton import Sketch
from .setup import Setup

__all__ = ["copied", "drawn", "relatives"]


def relatives(contact: Contact, field: str, value: float) -> tuple[list[State], bool]:
    """Equilibria of the axisymmetric model at a load or displacement, with their profiles.

    Returns
    -------
    states : list of State
        Empty where the model has none, or does not represent tip or law.
    own : bool
        Whether they are of this contact, not of a parabola in place of its tip.
    """
    own = contact.tip.is_axisymmetric and contact.body is None
    if isinstance(contact.tip, HeightMap):
        return [], False
    likeness = replace(contact, body=None, tip=contact.tip if contact.tip.is_axisymmetric else Parabola(1.0))
    try:
        return list(FollowedCurves(likeness, Axisymmetric()).solve(Request(1e-5), field, value).states), own
    except (InputError, ModelError):
        return [], own


def drawn(setup: Setup, state: State) -> Sketch:
    """A state of the axisymmetric model on a lattice: its gap, and outside its profile the field of a point force."""
    heights, distance = setup.problem.heights, setup.lattice.distance
    inside = np.isfinite(heights)
    likeness = distance if setup.contact.tip.is_axisymmetric else np.sqrt(2.0 * np.where(inside, heights, np.inf))
    gap = np.interp(likeness, state.r, state.gap, right=np.inf)
    return _sketch(setup, state, gap, inside & (likeness < state.contact_radius))


def copied(setup: Setup, state: State) -> Sketch | None:
    """A reduced state of a grid model as a start, if it has the nodes of this lattice; None if it has not."""
    lattice = setup.lattice
    if state.in_cell is None or state.cell.gap.shape != lattice.nodes:
        return None
    rows, columns = (n // 2 if lattice.quarter else 0 for n in lattice.nodes)
    gap = lattice.fill(state.cell.gap[rows:, columns:])
    return _sketch(setup, state, gap, (gap <= 0.0) & np.isfinite(setup.problem.heights))


def _sketch(setup: Setup, state: State, gap: Array, contact: Flags) -> Sketch:
    """A trial state by its gap, and where that is not known the field of a point force."""
    lattice, heights = setup.lattice, setup.problem.heights
    far = -state.displacement + state.load / (math.pi * np.maximum(lattice.distance, lattice.spacing))
    with np.errstate(invalid="ignore"):
        own = gap - heights
    return Sketch(np.where(contact, -heights, np.where(np.isfinite(own), own, far)), state.load, contact)
