"""Locating folds and first touch on a lattice, and what becomes of a fold on a finer lattice.

A fold of a control is an extremum of its value along the curve. On a lattice it can lie within a smooth piece or at a
kink, so that it is found as the extremum of a function of one variable, the progress along a fixed direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from typing import Literal

import numpy as np
import scipy

from contbranch.control import Control

from .newton import Equilibrium, Hold, Settings, Sketch, hold_control, newton
from .problem import GridProblem
from .setup import Setup, carried
from .walk import Direction, Measure, Track

__all__ = ["Refined", "coarser_touch", "locate_fold", "locate_touch", "refine_fold", "touches"]


# Bracket of a fold at the end of its search, as a part of the bracket between rows: the value of the control is known
# to the square of it.
NARROW = 1e-5
# Progresses without a state after which no more are tried.
FAILURES = 2


@dataclass(frozen=True)
class Refined:
    """What became of a fold on the lattice with twice the nodes a side.

    Attributes
    ----------
    verdict : {"found", "vanished", "unknown"}
    state : Equilibrium or None
        The fold there.
    moved : float
        By how much it has moved along the curve, in arclength.
    """

    verdict: Literal["found", "vanished", "unknown"]
    state: Equilibrium | None = None
    moved: float = 0.0


def _extremum(track: Track, control: Control, sign: float, low: float, high: float) -> Equilibrium | None:
    """The state on a track with the largest ``sign · control`` between two values of the progress."""
    best: list[tuple[float, Equilibrium]] = []
    failures = 0

    def depth(value: float) -> float:
        nonlocal failures
        # Between kinks of the lattice there may be no state: a fold among them is where the best is.
        state = track.at(value) if failures < FAILURES else None
        if state is None:
            failures += 1
            return np.inf
        best.append((-sign * control.value(state.load, state.displacement), state))
        return best[-1][0]

    scipy.optimize.minimize_scalar(
        depth, bounds=(low, high), method="bounded", options={"xatol": NARROW * (high - low), "maxiter": 25}
    )
    return min(best, key=itemgetter(0))[1] if best else None


def locate_fold(
    problem: GridProblem, states: list[Equilibrium], control: Control, settings: Settings
) -> Equilibrium | None:
    """The extremum of a control between the first and the last of three consecutive states.

    Parameters
    ----------
    states : list of Equilibrium
        The last three are those around the fold; earlier ones help to predict.
    """
    before, middle, after = states[-3:]
    direction = Direction.along(Measure.at(middle, 1.0), after.u - before.u, after.load - before.load)
    rise = control.value(middle.load - before.load, middle.displacement - before.displacement)
    track = Track(problem, states, direction, replace(settings, tolerance=min(settings.tolerance, 1e-8)))
    return _extremum(track, control, float(np.sign(rise)), direction.of(before), direction.of(after))


def refine_fold(
    setup: Setup, states: tuple[Equilibrium, Equilibrium, Equilibrium], control: Control, settings: Settings
) -> Refined:
    """Look for a fold on the lattice with twice the nodes a side.

    Parameters
    ----------
    setup : Setup
        With the lattice on which the fold was found.
    states : three Equilibrium
        Before the fold, at the fold, and after it.
    """
    problem = setup.fine.problem
    before, middle, after = sketches = [carried(setup, setup.fine, state) for state in states]
    value = [control.value(state.load, state.displacement) for state in states]
    sign = 1.0 if value[1] >= max(value[0], value[2]) else -1.0
    gap = problem.heights + np.where(middle.contact, -problem.heights, middle.u)
    measure = Measure.of(gap, middle.load, setup.length)
    change = after.u - before.u, after.load - before.load
    direction = Direction.along(measure, *change)
    slack = 1e-6 * abs(direction.value(*change))
    first = direction.corrected(problem, middle, slack, settings)
    if first is None:
        return Refined("unknown")
    moved, load_moved = first.u - middle.u, first.load - middle.load
    around = []
    for sketch in sketches[::2]:
        start = Sketch(sketch.u + moved, sketch.load + load_moved, sketch.contact)
        found = direction.corrected(problem, start, slack, settings)
        if found is None:
            return Refined("unknown")
        around.append(found)
    track = Track(problem, [first, *around], direction, settings)

    def height(state: Equilibrium) -> float:
        return sign * control.value(state.load, state.displacement)

    left, centre, right = around[0], first, around[1]
    for _ in range(5):
        ends = direction.of(left), direction.of(right)
        if height(centre) >= max(height(left), height(right)):
            found = _extremum(track, control, sign, *ends)
            return Refined("unknown") if found is None else Refined("found", found, measure.apart(found, first))
        outwards = height(right) > height(left)
        beyond = track.at(2.0 * ends[1] - ends[0] if outwards else 2.0 * ends[0] - ends[1])
        if beyond is None:
            return Refined("unknown")
        left, centre, right = (left, right, beyond) if outwards else (beyond, left, right)
    return Refined("vanished")


def coarser_touch(
    setup: Setup, states: list[Equilibrium], clearance: Callable[[Setup, Equilibrium], float], settings: Settings
) -> Equilibrium | None:
    """First touch on the lattice with half the nodes a side, from the states around it on this one; None without.

    Parameters
    ----------
    states : list of Equilibrium
        Without contact, the last two around the touch.
    """
    coarse = setup.coarse
    if coarse is None:
        return None
    problem, bare = coarse.problem, replace(settings, wall=False)
    known = []
    for state in states:
        u = carried(setup, coarse, state).u
        # Next to a fold of the displacement the load does.
        for hold in (hold_control(problem, 0.0, 1.0, state.displacement), Hold(state.load)):
            found = newton(problem, u, state.load, hold, None, bare)
            if found.converged:
                known.append(found)
                break
    if len(known) < 2:
        return None
    direction = Direction.between(known[-2], known[-1], setup.length)
    low, high = (direction.of(state) for state in known[-2:])
    track = Track(problem, known, direction, bare)
    for _ in range(4):
        ends = track.at(low), track.at(high)
        if ends[0] is None or ends[1] is None:
            return None
        if clearance(coarse, ends[0]) * clearance(coarse, ends[1]) <= 0.0:
            return track.zero(partial(clearance, coarse), low, high)
        low, high = 2.0 * low - high, 2.0 * high - low
    return None


def touches(state: Equilibrium, clearance: Callable[[Equilibrium], float]) -> bool:
    """Whether nodes are in contact, or the gap has closed between them."""
    return bool(state.contact.any()) or clearance(state) <= 0.0


def locate_touch(
    problem: GridProblem, states: list[Equilibrium], clearance: Callable[[Equilibrium], float], settings: Settings
) -> Equilibrium | None:
    """The state without contact whose clearance is zero, as if the wall were not there.

    Parameters
    ----------
    states : list of Equilibrium
        The last is the first that touches (or the last that does, if the contact is lost); those before it do not.
    clearance : callable
        Of a state without contact: the gap that closes.
    """
    free, closed = ([state for state in states if touches(state, clearance) == wanted] for wanted in (False, True))
    if len(free) < 2 or not closed:
        return None
    direction = Direction.between(free[-1], closed[-1], 1.0)
    bare = replace(settings, wall=False, tolerance=min(settings.tolerance, 1e-8))
    track = Track(problem, free[-3:], direction, bare)
    low, high = direction.of(free[-1]), direction.of(closed[-1])
    beyond = track.at(high)
    return None if beyond is None or clearance(beyond) > 0.0 else track.zero(clearance, low, high)
