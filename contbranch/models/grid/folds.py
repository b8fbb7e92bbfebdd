"""Locating folds and first touch on a lattice, and what becomes of a fold on a finer lattice.

A fold of a control is an extremum of its value along the curve. On a lattice it can lie within a smooth piece or at a
kink, so that it is found as the extremum of a function of one variable, the progress along a fixed direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

from contbranch.control import Control

from .arrays import Array, Mask
from .newton import Equilibrium, Hold, Settings, hold_control, newton
from .problem import GridProblem
from .setup import Setup, coarsened, refined, refined_mask
from .walk import Direction, Measure, Point, between

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


class _Track:
    """Equilibria by their progress along a direction, each new one interpolated from those known."""

    def __init__(self, problem: GridProblem, points: list[Point], direction: Direction, settings: Settings) -> None:
        self.problem, self.points, self.direction, self.settings = problem, list(points), direction, settings

    def progress(self, state: Equilibrium) -> float:
        return self.direction.value(state.u, state.load)

    def at(self, value: float) -> Equilibrium | None:
        """The equilibrium at a progress; None if it is not found."""
        found = between(self.problem, self.points, self.direction, value, self.settings)
        if found.converged:
            self.points.append(Point(0.0, found))
            return found
        return None

    def extremum(self, control: Control, sign: float, low: float, high: float) -> Equilibrium | None:
        """The state with the largest ``sign · control`` between two values of the progress."""
        best: list[Equilibrium] = []
        failures = 0

        def height(value: float) -> float:
            nonlocal failures
            # Between kinks of the lattice there may be no state: a fold among them is where the best is.
            state = self.at(value) if failures < FAILURES else None
            if state is None:
                failures += 1
                return np.inf
            best.append(state)
            return -sign * control.value(state.load, state.displacement)

        scipy.optimize.minimize_scalar(
            height, bounds=(low, high), method="bounded", options={"xatol": NARROW * (high - low), "maxiter": 25}
        )
        if not best:
            return None
        return max(best, key=lambda state: sign * control.value(state.load, state.displacement))


def locate_fold(problem: GridProblem, points: list[Point], control: Control, settings: Settings) -> Equilibrium | None:
    """The extremum of a control between the first and the last of three consecutive points.

    Parameters
    ----------
    points : list of Point
        The last three are those around the fold; earlier ones help to predict.
    """
    before, middle, after = (point.state for point in points[-3:])
    direction = Direction.along(Measure.at(middle, 1.0), after.u - before.u, after.load - before.load)
    value = [control.value(state.load, state.displacement) for state in (before, middle, after)]
    track = _Track(problem, points, direction, replace(settings, tolerance=min(settings.tolerance, 1e-8)))
    return track.extremum(control, float(np.sign(value[1] - value[0])), track.progress(before), track.progress(after))


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
    fine = setup.on(2 * setup.grid)
    problem = fine.problem
    raised = [refined(state.u, setup.lattice, setup.centred) for state in states]
    value = [control.value(state.load, state.displacement) for state in states]
    sign = 1.0 if value[1] >= max(value[0], value[2]) else -1.0
    contact = refined_mask(states[1].contact)
    guess = np.where(contact, -problem.heights, raised[1])
    sketch = problem.fields(guess, states[1].load)
    middle = Equilibrium(sketch, contact, 0.0, problem.displacement(guess, states[1].load), False)
    measure = Measure.at(middle, setup.length)
    direction = Direction.along(measure, raised[2] - raised[0], states[2].load - states[0].load)

    def solved(u: Array, load: float, contact: Mask) -> Equilibrium | None:
        slack = 1e-6 * abs(direction.value(raised[2] - raised[0], states[2].load - states[0].load))
        start = np.where(contact, -problem.heights, u)
        found = newton(problem, start, load, direction.hold(direction.value(u, load), slack), contact, settings)
        return found if found.converged else None

    first = solved(raised[1], states[1].load, contact)
    if first is None:
        return Refined("unknown")
    moved, load_moved = first.u - raised[1], first.load - states[1].load
    known = [Point(0.0, first)]
    for k in (0, 2):
        found = solved(raised[k] + moved, states[k].load + load_moved, refined_mask(states[k].contact))
        if found is None:
            return Refined("unknown")
        known.append(Point(0.0, found))
    track = _Track(problem, known, direction, settings)

    def height(state: Equilibrium) -> float:
        return sign * control.value(state.load, state.displacement)

    left, centre, right = known[1].state, known[0].state, known[2].state
    for _ in range(5):
        if height(centre) >= max(height(left), height(right)):
            found = track.extremum(control, sign, track.progress(left), track.progress(right))
            if found is None:
                return Refined("unknown")
            return Refined("found", found, measure.norm(found.u - first.u, found.load - first.load))
        width = track.progress(right) - track.progress(left)
        outwards = 1.0 if height(right) > height(left) else -1.0
        edge = right if outwards > 0 else left
        beyond = track.at(track.progress(edge) + outwards * width)
        if beyond is None:
            return Refined("unknown")
        left, centre, right = (left, right, beyond) if outwards > 0 else (beyond, left, right)
    return Refined("vanished")


def coarser_touch(
    setup: Setup, points: list[Point], clearance: Callable[[Setup, Equilibrium], float], settings: Settings
) -> Equilibrium | None:
    """First touch on the lattice with half the nodes a side, from the points around it on this one; None without.

    Parameters
    ----------
    points : list of Point
        Without contact, the last two around the touch.
    """
    if setup.grid % 4 or setup.grid < 16:
        return None
    coarse = setup.on(setup.grid // 2)
    bare = replace(settings, wall=False)
    known = []
    for point in points:
        u = coarsened(point.state.u, setup.centred)
        hold = hold_control(coarse.problem, 0.0, 1.0, point.displacement)
        found = newton(coarse.problem, u, point.load, hold, None, bare)
        if not found.converged:
            # Next to a fold of the displacement the load does.
            found = newton(coarse.problem, u, point.load, Hold(point.load), None, bare)
        if found.converged:
            known.append(Point(point.arc, found))
    if len(known) < 2:
        return None
    ends = known[-2].state, known[-1].state
    direction = Direction.along(Measure.at(ends[0], setup.length), ends[1].u - ends[0].u, ends[1].load - ends[0].load)
    track = _Track(coarse.problem, known, direction, bare)
    low, high = track.progress(ends[0]), track.progress(ends[1])
    for _ in range(4):
        found_low, found_high = track.at(low), track.at(high)
        if found_low is None or found_high is None:
            return None
        if clearance(coarse, found_low) * clearance(coarse, found_high) <= 0.0:
            return _root(track, lambda state: clearance(coarse, state), low, high)
        low, high = low - (high - low), high + (high - low)
    return None


def _root(track: _Track, function: Callable[[Equilibrium], float], low: float, high: float) -> Equilibrium | None:
    """The state on a track where a function of the state is zero."""
    states: dict[float, Equilibrium] = {}

    def value(progress: float) -> float:
        state = track.at(progress)
        if state is None:
            raise ValueError("no state without contact")
        states[progress] = state
        return function(state)

    try:
        root = float(scipy.optimize.brentq(value, low, high, xtol=1e-9 * (high - low)))
        value(root)
    except ValueError:
        return None
    return states[root]


def touches(state: Equilibrium, clearance: Callable[[Equilibrium], float]) -> bool:
    """Whether nodes are in contact, or the gap has closed between them."""
    return bool(state.contact.any()) or clearance(state) <= 0.0


def locate_touch(
    problem: GridProblem, points: list[Point], clearance: Callable[[Equilibrium], float], settings: Settings
) -> Equilibrium | None:
    """The state without contact whose clearance is zero, as if the wall were not there.

    Parameters
    ----------
    points : list of Point
        The last is the first that touches (or the last that does, if the contact is lost); those before it do not.
    clearance : callable
        Of a state without contact: the gap that closes.
    """
    touching = [touches(point.state, clearance) for point in points]
    free = [point for point, closed in zip(points, touching, strict=True) if not closed][-3:]
    closed = next((point for point, closed in zip(points[::-1], touching[::-1], strict=True) if closed), None)
    if len(free) < 2 or closed is None:
        return None
    ends = free[-1].state, closed.state
    direction = Direction.along(Measure.at(ends[0], 1.0), ends[1].u - ends[0].u, ends[1].load - ends[0].load)
    track = _Track(problem, free, direction, replace(settings, wall=False, tolerance=min(settings.tolerance, 1e-8)))
    low, high = track.progress(ends[0]), track.progress(ends[1])
    beyond = track.at(high)
    if beyond is None or clearance(beyond) > 0.0:
        return None
    return _root(track, clearance, low, high)
