"""Trial states for a lattice from the axisymmetric model: of the tip itself, or of the parabola most like it.

Heights tell which radius of a parabola a node corresponds to, r = √(2 R z) with R = 1 in reduced units: exact for a
parabola, and a fair start for any tip with one round summit. Where the tip is axisymmetric its own profile is used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.contact.tips import Parabola
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.trace import Request
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import State

from .arrays import Array, Mask
from .setup import Setup

__all__ = ["Sketch", "copied", "drawn", "relatives"]


@dataclass(frozen=True)
class Sketch:
    """A trial state: the field u, the load, the contact."""

    u: Array
    load: float
    contact: Mask


def relatives(contact: Contact, field: str, value: float) -> tuple[list[State], bool]:
    """Equilibria of the axisymmetric model at a load or displacement, with their profiles.

    Returns
    -------
    states : list of State
        Empty where the model has none, or does not represent tip or law.
    own : bool
        Whether they are of this contact, not of a parabola in place of its tip.
    """
    own = contact.tip.is_axisymmetric
    if isinstance(contact.tip, HeightMap):
        return [], False
    likeness = contact if own else replace(contact, tip=Parabola(1.0))
    from contbranch.models.choice import axisymmetric

    model = axisymmetric(likeness)
    if model is None:
        return [], own
    try:
        return list(FollowedCurves(likeness, model).solve(Request(1e-6), field, value).states), own
    except (InputError, ModelError):
        return [], own


def drawn(setup: Setup, state: State) -> Sketch:
    """A state of the axisymmetric model on a lattice: its gap, and outside its profile the field of a point force."""
    lattice, problem = setup.lattice, setup.problem
    x, y = lattice.axis[:, None], lattice.axis[None, :]
    distance = np.hypot(x, y)
    heights = problem.heights
    inside = np.isfinite(heights)
    likeness = distance if setup.contact.tip.is_axisymmetric else np.sqrt(2.0 * np.where(inside, heights, np.inf))
    gap = np.interp(likeness, state.r, state.gap, right=np.inf)
    known = inside & np.isfinite(gap)
    with np.errstate(invalid="ignore"):
        far = -state.displacement + state.load / (math.pi * np.maximum(distance, lattice.spacing))
        u = np.where(known, gap - heights, far)
    contact = inside & (likeness < state.contact_radius)
    return Sketch(np.where(contact, -heights, u), state.load, contact)


def copied(setup: Setup, state: State) -> Sketch | None:
    """A reduced state of a grid model as a start, if it has the nodes of this lattice; None if it has not."""
    if state.in_cell is None:
        return None
    fields = state.cell
    lattice, problem = setup.lattice, setup.problem
    if fields.gap.shape != (lattice.grid, lattice.grid):
        return None
    half = lattice.grid // 2
    part = slice(half, None) if lattice.quarter else slice(None)
    inside = slice(0, lattice.inside)
    distance = np.hypot(lattice.axis[:, None], lattice.axis[None, :])
    u = -state.displacement + state.load / (math.pi * np.maximum(distance, lattice.spacing))
    with np.errstate(invalid="ignore"):
        own = fields.gap[part, part] - problem.heights[inside, inside]
    u[inside, inside] = np.where(np.isfinite(own), own, u[inside, inside])
    contact = np.zeros(problem.shape, dtype=bool)
    contact[inside, inside] = (fields.gap[part, part] <= 0.0) & np.isfinite(problem.heights[inside, inside])
    return Sketch(np.where(contact, -problem.heights, u), state.load, contact)
