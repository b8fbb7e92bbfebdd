"""What the lattice adds to a state: a comparison with the lattice that has half, or twice, the nodes a side."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from contbranch.control import Control

from .arrays import Array
from .newton import Equilibrium, Hold, Settings, control_held, newton
from .observables import weights
from .rows import difference, read
from .setup import Setup, carried
from .walk import beside

__all__ = ["Comparison", "compared", "held", "no_comparison", "touched"]


class Comparison(NamedTuple):
    """By how much the observables of a state change when the lattice is coarsened once.

    If errors fall at least in proportion to the spacing, this is at least the error on the finer of the two.

    Attributes
    ----------
    four : array (4,)
        Of load, displacement, contact radius and central gap.
    potential : float
        Of V - F d at the same load: the change of V less that which goes with the changes along a curve, F dd.
    """

    four: Array
    potential: float


def no_comparison(setup: Setup) -> str:
    """A sentence if there is no lattice with half the nodes to compare with; errors of points are then not known."""
    if setup.coarse is not None:
        return ""
    fitting = 2 * setup.grid if setup.crowded else max(16, 4 * math.ceil(setup.grid / 4))
    return f"Errors of points are not known on a grid of {setup.grid}: use one divisible by 4, such as {fitting}."


def compared(setup: Setup, before: Equilibrium, state: Equilibrium, settings: Settings) -> Comparison | None:
    """Compare a state of a curve with the coarser lattice's, in the plane across the curve; None if that has none.

    Parameters
    ----------
    setup : Setup
    before : Equilibrium
        A state earlier on the curve, which gives its direction.
    """
    coarse = setup.coarse
    found = None if coarse is None else beside(setup, coarse, state, (before, state), settings)
    return None if coarse is None or found is None else _difference(setup, state, coarse, found)


def held(setup: Setup, state: Equilibrium, control: Control, value: float, settings: Settings) -> Comparison | None:
    """Compare a single state with the coarser lattice's at a value of a control."""
    coarse = setup.coarse
    if coarse is None:
        return None
    u, load, contact = carried(setup, coarse, state)
    start = np.where(contact, -coarse.problem.heights, u)
    found = newton(coarse.problem, start, load, control_held(coarse.problem, control, value), contact, settings)
    return _difference(setup, state, coarse, found) if found.converged else None


def touched(setup: Setup, touch: Equilibrium, settings: Settings) -> Equilibrium | None:
    """First touch on the finer lattice: the state whose gap at the apex is zero, without the wall.

    Parameters
    ----------
    setup : Setup
    touch : Equilibrium
        The state without contact whose gap at the apex is zero; None is returned for a tip without an apex.
    """
    if setup.crowded:
        return None
    apex = weights(setup.fine.lattice, 0.0)
    bare = replace(settings, wall=False, tolerance=min(settings.tolerance, 1e-8))
    hold = Hold(0.0, 0.0, np.outer(apex, apex))
    found = newton(setup.fine.problem, carried(setup, setup.fine, touch).u, touch.load, hold, None, bare)
    return found if found.converged else None


def _difference(setup: Setup, state: Equilibrium, coarse: Setup, found: Equilibrium) -> Comparison:
    one, other = read(setup, state, cell=False), read(coarse, found, cell=False)
    along = 0.5 * (one.load + other.load) * (one.displacement - other.displacement)
    return Comparison(abs(difference(one, other)), abs(one.energy - other.energy - along))
