"""Where a tip on a lattice ends up: dynamics to the neighbourhood of a stable state, Newton's method to its place.

Newton's method alone ends in any equilibrium, or in none; dynamics alone are slow in the end. A state found by Newton's
method from where the motion has come to is taken only if it is the one that the motion was about to reach: the energy's
slope on the straight line to it decreases to zero, by about half on half the way, and its second variation is positive.
Otherwise the motion goes on, until it has converged by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from contbranch.models.grid.solvers.lowest import Lowest, lowest
from contbranch.models.grid.solvers.motion import Ending, Motion, MotionSettings

from .arrays import Array, Mask
from .newton import Equilibrium, Hold, Settings, newton
from .problem import GridProblem
from .relaxation import LatticeMotion, Place, equilibrium
from .stability import as_stability

__all__ = ["land", "settle", "softest"]


# Steps for which the contact must have stayed as it is before Newton's method is tried.
_STEADY = 3
# Each further attempt is made when the residual has fallen by this factor.
_CLOSER = 0.03
# A second variation is called negative from here on, relative to the masses: rounding is well below.
_NEGATIVE = -1e-9
_KICKS = 5


def softest(problem: GridProblem, state: Equilibrium, hold: Hold) -> Lowest:
    """Lowest eigenvalue of the second variation under what is held, relative to the masses of the dynamics.

    Only fields with the symmetry of the lattice are asked. Pairs are counted as those of stability.
    """
    motion = LatticeMotion(problem, hold)
    with as_stability(problem):
        place = motion.place(state.u)
        # Modes of negative curvature live where the interaction softens.
        noise = np.random.default_rng(0).standard_normal(problem.shape)
        stiffness = np.abs(place.fields.stiffness)
        start = stiffness * (1.0 + 0.5 * noise) + 1e-3 * (1.0 + stiffness.max()) * (1.0 + noise)
        return lowest(partial(motion.variation, place), partial(motion.mobility, place), motion.confine(place, start))


@dataclass
class _Near:
    """Whether the motion is where Newton's method is worth an attempt."""

    residual: float
    held: Mask | None = None
    steady: int = 0

    def __call__(self, place: Place) -> bool:
        same = self.held is not None and np.array_equal(place.held, self.held)
        self.steady = self.steady + 1 if same else 0
        self.held = place.held
        return self.steady >= _STEADY and place.residual <= self.residual


class Pace(NamedTuple):
    """The residual from which on Newton's method is tried, and the largest step relative to the interaction's range."""

    first: float
    stride: float


CAREFUL = Pace(1e-3, 0.1)


def land(
    problem: GridProblem,
    u: Array,
    load: float,
    hold: Hold,
    tolerance: float = 1e-8,
    steps: int = 5000,
    pace: Pace = CAREFUL,
) -> Equilibrium:
    """Follow the dynamics from a state that is none any more, as beyond a fold, to the stable state where they end.

    Parameters
    ----------
    problem : GridProblem
    u, load : array, float
        Start: the last state before the jump.
    hold : Hold
        Load, displacement or spring after the jump.
    tolerance : float
        Residual to reach.
    steps : int
        Steps of the dynamics at most, in all.
    pace : Pace

    Returns
    -------
    Equilibrium
        Not converged, with a reason, if there is no stable state to be reached.

    Raises
    ------
    InputError
        If what is held is no load, displacement or spring.
    """
    before = problem.counter.equilibrium
    motion = LatticeMotion(problem, hold, stride=pace.stride)
    place = motion.place(u)
    goal, used, kicks = pace.first, 0, 0
    while True:
        motion.until = _Near(goal) if goal > tolerance else None
        place, more, ending = Motion(motion, place, MotionSettings(tolerance, steps - used)).run()
        used += more
        if ending is Ending.INTERRUPTED:
            state = newton(
                problem,
                place.fields.u,
                place.fields.load,
                hold,
                place.held,
                Settings(tolerance, steps=8, inner=100, growth=2.0),
            )
            if state.converged and motion.leads_to(place, state.u) and softest(problem, state, hold).value > _NEGATIVE:
                return replace(state, steps=used + state.steps, pairs=problem.counter.equilibrium - before)
            goal = _CLOSER * min(goal, place.residual)
            continue
        state = equilibrium(motion, place, used, problem.counter.equilibrium - before, ending)
        if not state.converged or softest(problem, state, hold).value > _NEGATIVE:
            return state
        if kicks == _KICKS:
            return replace(state, converged=False, reason=Ending.UNSTABLE.value)
        # A start on an unstable state: the motion leaves it only if pushed.
        kicks, goal = kicks + 1, pace.first
        place = motion.place(place.fields.u + motion.push(place, seed=kicks))


settle = partial(land, pace=Pace(0.03, 0.25))
"""Find a stable state from any start, however bad; as `land`, with longer steps and Newton's method tried sooner."""
