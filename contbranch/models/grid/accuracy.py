"""What the lattice adds to a state: a comparison with the lattice that has half, or twice, the nodes a side."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .newton import Equilibrium, Hold, Settings, newton
from .observables import weights
from .reading import read
from .setup import Setup, coarsened, refined
from .walk import Direction, Measure

__all__ = ["Comparison", "compared", "held", "no_comparison", "touched"]


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


def no_comparison(setup: Setup) -> str:
    """A sentence if there is no lattice with half the nodes to compare with; errors of points are then not known."""
    if setup.grid % 4 == 0 and setup.grid >= 16:
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
    """Compare a single state with the coarser lattice's, with what is held there: a row of `hold` fits that lattice."""
    return None if setup.grid % 4 or setup.grid < 16 else _difference(setup, state, hold, settings)


def touched(setup: Setup, touch: Equilibrium, settings: Settings, finer: bool) -> Comparison | None:
    """Compare first touch with another lattice's: the state there whose gap at the apex is zero, without the wall.

    Parameters
    ----------
    setup : Setup
    touch : Equilibrium
        The state without contact whose gap at the apex is zero; None is returned for a tip without an apex.
    finer : bool
        Compare with the lattice that has twice the nodes a side, not with the one that has half of them.
    """
    if setup.crowded or (not finer and (setup.grid % 4 or setup.grid < 16)):
        return None
    other = setup.on(2 * setup.grid if finer else setup.grid // 2)
    start = refined(touch.u, setup.lattice) if finer else coarsened(touch.u)
    apex = weights(other.lattice, 0.0)
    hold = Hold(0.0, 0.0, np.outer(apex, apex))
    without_wall = replace(settings, wall=False, tolerance=min(settings.tolerance, 1e-8))
    found = newton(other.problem, start, touch.load, hold, None, without_wall)
    if not found.converged:
        return None
    energies = [each.problem.total_energy(state.fields) for each, state in ((setup, touch), (other, found))]
    load, displacement = abs(found.load - touch.load), abs(found.displacement - touch.displacement)
    return Comparison(load, displacement, 0.0, 0.0, abs(energies[0] - energies[1]))


def _difference(setup: Setup, state: Equilibrium, hold: Hold, settings: Settings) -> Comparison | None:
    coarse = setup.on(setup.grid // 2)
    problem = coarse.problem
    u = coarsened(state.u, setup.centred)
    share = coarsened(state.contact.astype(np.float64), setup.centred)
    contact = share >= 0.5
    found = newton(problem, np.where(contact, -problem.heights, u), state.load, hold, contact, settings)
    if not found.converged:
        return None
    one, other = read(setup, state, cell=False), read(coarse, found, cell=False)
    load, displacement, radius, gap = (abs(a - b) for a, b in zip(one.four, other.four, strict=True))
    energy = one.energy - other.energy
    along = 0.5 * (one.load + other.load) * (one.displacement - other.displacement)
    return Comparison(load, displacement, radius, gap, abs(energy), abs(energy - along))
