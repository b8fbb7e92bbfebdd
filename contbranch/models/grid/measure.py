"""Lengths and directions on the curve of a lattice, and states between those that are known.

Arclength is measured in displacements where the surfaces interact, and in the load:

    ds² = Σ W du² / ℓ² + (dF/F*)²,     W ∝ (1 + (g/2ℓ)²)⁻², Σ W = 1,

so that it does not depend on the lattice, and a change of the film's shape at nearly constant load and displacement
counts as much as one of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.control import Control

from .newton import Equilibrium, Hold, Settings, Sketch, newton
from .problem import GridProblem

__all__ = ["Direction", "Measure", "Stretch", "following", "lagrange", "predicted", "quietly"]

# Bracket of a fold at the end of its search, as a part of the bracket between rows: the value of the control is known
# to the square of it.
NARROW = 1e-5
# Progresses without a state after which no more are tried.
FAILURES = 2


def quietly() -> np.errstate:
    """Numbers that overflow in a trial state are answered by shorter steps."""
    return np.errstate(over="ignore", invalid="ignore", divide="ignore")


def following(tolerance: float, crowded: bool) -> Settings:
    """Tolerances for corrections from a good prediction: one that does not converge soon is better given up.

    What a step brings is mostly another contact, which a loose solution finds as well; where there are many of them, it
    may find that of another piece of the curve.
    """
    loosest = 0.005 if crowded else 0.1
    return Settings(tolerance=tolerance, steps=15, inner=80, growth=30.0, patience=4, forcing=loosest)


@dataclass(frozen=True)
class Measure:
    """The inner product of steps at one state: weights of the field and of the load."""

    weights: Array
    load_weight: float

    @staticmethod
    def of(gap: Array, load: float, length: float) -> Measure:
        """The measure at a gap and load for a law of a range."""
        weights = 1.0 / np.square(1.0 + np.square(np.minimum(gap / (2.0 * length), 1e6)))
        scale = length + 0.5 * max(gap.min(), 0.0)
        return Measure(weights / (weights.sum() * scale**2), 1.0 / (3.0 + 0.3 * abs(load)) ** 2)

    @staticmethod
    def at(state: Equilibrium, length: float) -> Measure:
        """The measure at a state."""
        return Measure.of(state.fields.gap, state.load, length)

    def apart(self, one: Equilibrium, other: Equilibrium) -> float:
        """The distance of two states."""
        return self.norm(*one.beyond(other))

    def product(self, u: Array, load: float, v: Array, other: float) -> float:
        """Inner product of two steps."""
        return float(np.einsum("ij,ij,ij->", self.weights, u, v)) + self.load_weight * load * other

    def norm(self, u: Array, load: float) -> float:
        """Length of a step."""
        return math.sqrt(self.product(u, load, u, load))


@dataclass(frozen=True)
class Direction:
    """A covector (row, load weight) that measures progress along a piece of the curve."""

    row: Array
    load_weight: float

    @staticmethod
    def along(measure: Measure, u: Array, load: float) -> Direction:
        """The covector of a step."""
        return Direction(measure.weights * u, measure.load_weight * load)

    @staticmethod
    def between(begin: Equilibrium, end: Equilibrium, length: float) -> Direction:
        """The covector of the step from one state to another."""
        return Direction.along(Measure.at(begin, length), *end.beyond(begin))

    def value(self, u: Array, load: float) -> float:
        """Progress at a field and load."""
        return float(np.vdot(self.row, u)) + self.load_weight * load

    def of(self, state: Equilibrium) -> float:
        """Progress at a state."""
        return self.value(state.u, state.load)

    def hold(self, value: float, slack: float) -> Hold:
        """What Newton's method keeps for a given progress."""
        return Hold(value, self.load_weight, self.row, slack)


def lagrange(nodes: Array, at: float) -> tuple[Array, Array]:
    """Weights of the values at the nodes in the interpolating polynomial at a place, and in its derivative."""
    own = np.eye(len(nodes))
    scale = np.prod(nodes[:, None] - nodes + own, axis=1)
    ahead = np.where(own, 1.0, at - nodes)
    slopes = sum(np.where(own[k], 0.0, np.prod(np.where(own[k], 1.0, ahead), axis=1)) for k in range(len(nodes)))
    return np.prod(ahead, axis=1) / scale, slopes / scale


def predicted(problem: GridProblem, states: Sequence[Equilibrium], weights: Array, wall: bool = True) -> Sketch:
    """The combination of states; a node belongs to the contact by the wall's pressure there less the gap outside."""
    walls = [np.where(one.contact, one.fields.excess, -np.minimum(one.fields.gap, 1e3)) for one in states]
    contact = (np.tensordot(weights, walls, 1) > 0.0) & wall
    u = np.where(contact, -problem.heights, np.tensordot(weights, [one.u for one in states], 1))
    return Sketch(u, float(weights @ [one.load for one in states]), contact)


@dataclass
class Stretch:
    """Equilibria by their progress along a direction, each new one interpolated from those known and corrected."""

    problem: GridProblem
    states: list[Equilibrium]
    direction: Direction
    settings: Settings

    def at(self, value: float) -> Equilibrium | None:
        """The equilibrium at a progress; None if it is not found.

        At most four states are used, those nearest in progress and apart from each other.
        """
        progress = np.array([self.direction.of(state) for state in self.states])
        near: list[int] = []
        for k in np.argsort(np.abs(progress - value), kind="stable"):
            if len(near) < 4 and (np.abs(progress[k] - progress[near]) > 1e-6 * np.ptp(progress)).all():
                near.append(k)
        chosen = [self.states[k] for k in near]
        sketch = predicted(self.problem, chosen, lagrange(progress[near], value)[0], self.settings.wall)
        hold = self.direction.hold(value, 1e-3 * np.ptp(progress[near]))
        found = newton(self.problem, sketch.u, sketch.load, hold, sketch.contact, self.settings)
        if not found.converged:
            return None
        self.states.append(found)
        return found

    def zero(
        self, function: Callable[[Equilibrium], float], low: float, high: float, part: float = 1e-9
    ) -> Equilibrium | None:
        """The state between two values of the progress where a function of the state is zero, to a part of the way."""

        def value(progress: float) -> float:
            state = self.at(progress)
            if state is None:
                raise ValueError("no state there")
            return function(state)

        try:
            return self.at(scipy.optimize.brentq(value, low, high, xtol=part * abs(high - low)))
        except ValueError:
            return None

    def extremum(self, control: Control, sign: float, low: float, high: float) -> Equilibrium | None:
        """The state with the largest ``sign · control`` between two values of the progress."""
        best: list[tuple[float, Equilibrium]] = []
        failures = 0

        def depth(value: float) -> float:
            nonlocal failures
            # Between corners of the lattice there may be no state: a fold among them is where the best is.
            state = self.at(value) if failures < FAILURES else None
            if state is None:
                failures += 1
                return np.inf
            best.append((-sign * control.value(state.load, state.displacement), state))
            return best[-1][0]

        scipy.optimize.minimize_scalar(
            depth, bounds=(low, high), method="bounded", options={"xatol": NARROW * (high - low), "maxiter": 25}
        )
        return min(best, key=itemgetter(0))[1] if best else None
