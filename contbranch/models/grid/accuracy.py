"""What the lattice adds to a state: a comparison with the lattice that has half the nodes a side."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .newton import Equilibrium, Hold, Settings, newton
from .reading import read
from .setup import Setup, coarsened
from .walk import Direction, Measure

__all__ = ["Comparison", "compared", "held"]


@dataclass(frozen=True)
class Comparison:
    """By how much the observables of a state change when the lattice is coarsened once.

    If errors fall at least in proportion to the spacing, this is at least the error on the finer of the two.

    Attributes
    ----------
    potential : float
        Of V - F d at the same load: the change of V less that which goes with the changes along a curve, F dd.
    """

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float
    potential: float = math.inf

    @property
    def four(self) -> tuple[float, float, float, float]:
        """Of load, displacement, contact radius and central gap."""
        return self.load, self.displacement, self.contact_radius, self.central_gap


def compared(setup: Setup, before: Equilibrium, state: Equilibrium, settings: Settings) -> Comparison | None:
    """Compare a state of a curve with the coarser lattice's, in the plane across the curve; None if that has none.

    Parameters
    ----------
    setup : Setup
    before : Equilibrium
        A state earlier on the curve, which gives its direction.
    """
    if setup.grid % 4 or setup.grid < 16:
        return None
    coarse = setup.on(setup.grid // 2)
    problem = coarse.problem
    u = coarsened(state.u, setup.centred)
    sketch = Equilibrium(problem.fields(u, state.load), problem.heights + u <= 0.0, 0.0, 0.0, False)
    change = u - coarsened(before.u, setup.centred)
    direction = Direction.along(Measure.at(sketch, setup.length), change, state.load - before.load)
    slack = 1e-6 * abs(direction.value(change, state.load - before.load))
    return _difference(setup, state, direction.hold(direction.value(u, state.load), slack), settings)


def held(setup: Setup, state: Equilibrium, hold: Hold, settings: Settings) -> Comparison | None:
    """Compare a single state with the coarser lattice's with the same load or control."""
    return None if setup.grid % 4 or setup.grid < 16 else _difference(setup, state, hold, settings)


def _difference(setup: Setup, state: Equilibrium, hold: Hold, settings: Settings) -> Comparison | None:
    coarse = setup.on(setup.grid // 2)
    problem = coarse.problem
    u = coarsened(state.u, setup.centred)
    share = coarsened(state.contact.astype(np.float64), setup.centred)
    contact = share >= 0.5
    found = newton(problem, np.where(contact, -problem.heights, u), state.load, hold, contact, settings)
    if not found.converged:
        return None
    one, other = read(setup, state), read(coarse, found)
    values = [abs(a - b) for a, b in zip((*one.four, one.energy), (*other.four, other.energy), strict=True)]
    along = 0.5 * (one.load + other.load) * (one.displacement - other.displacement)
    return Comparison(*values, potential=abs(one.energy - other.energy - along))
