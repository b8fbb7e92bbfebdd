"""Following the curve of equilibria of a lattice problem through folds and changes of the contact set.

A point is predicted by the polynomial through the last points in the arclength s, and corrected by Newton's method in
the plane through the prediction normal to the predicted direction. Arclength is measured in displacements where the
surfaces interact, and in the load:

    ds² = Σ W du² / ℓ² + (dF/F*)²,     W ∝ (1 + (g/2ℓ)²)⁻², Σ W = 1,

so that it does not depend on the lattice, and a change of the film's shape at nearly constant load and displacement
counts as much as one of these. The contact set changes node by node: the curve has a small kink at every change, which
the steps pass over, and a correction of the contact set belongs to every Newton step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from .arrays import Array
from .newton import Equilibrium, Hold, Settings, Sketch, newton
from .problem import GridProblem
from .setup import Setup, carried
from .units import REDUCED_VALUES, UnitValues

__all__ = ["Direction", "Measure", "Point", "Track", "WalkOptions", "Walker", "beside", "following", "quietly"]


# Steps in s: the first, and the limits.
FIRST, LEAST, MOST = 0.05, 2e-4, 0.5
# Part of a step by which a prediction may miss, as goal of the step control.
CURVATURE = 0.02
# Least cosine between the predicted direction and the step, and degree of the predicting polynomial.
ANGLE, ORDER = 0.9, 2


@dataclass(frozen=True)
class WalkOptions:
    """How a curve is followed.

    Attributes
    ----------
    tolerance : float
        Residual of every point, relative.
    period : float
        Length of the curve over which the contact moves by one row of nodes.
    noise : float
        Distance by which it may miss at any rate: changes of the contact set make predictions no better.
    hops : bool
        Whether corners of the lattice's own may be passed by longer steps.
    """

    tolerance: float = 1e-7
    period: float = 0.02
    noise: float = 1e-3
    hops: bool = True


def quietly() -> np.errstate:
    """Numbers that overflow in a trial state are answered by shorter steps."""
    return np.errstate(over="ignore", invalid="ignore", divide="ignore")


def following(tolerance: float) -> Settings:
    """Tolerances for corrections from a good prediction: one that does not converge soon is better given up."""
    return Settings(tolerance=tolerance, steps=15, inner=80, growth=30.0, patience=4)


@dataclass(frozen=True)
class Point:
    """An equilibrium with its arclength."""

    arc: float
    state: Equilibrium

    @property
    def load(self) -> float:
        """F."""
        return self.state.load

    @property
    def displacement(self) -> float:
        """Displacement of the far field d."""
        return self.state.displacement


@dataclass(frozen=True)
class Measure:
    """The inner product of steps at one state: weights of the field and of the load."""

    weights: Array
    load_weight: float

    @staticmethod
    def of(gap: Array, load: float, length: float) -> Measure:
        """The measure at a gap and load for a law of a range."""
        weights = (1.0 + np.minimum(gap / (2.0 * length), 1e6) ** 2) ** -2
        scale = length + 0.5 * max(gap.min(), 0.0)
        return Measure(weights / (weights.sum() * scale**2), 1.0 / (3.0 + 0.3 * abs(load)) ** 2)

    @staticmethod
    def at(state: Equilibrium, length: float) -> Measure:
        """The measure at a state."""
        return Measure.of(state.fields.gap, state.load, length)

    def apart(self, one: Equilibrium, other: Equilibrium) -> float:
        """The distance of two states."""
        return self.norm(one.u - other.u, one.load - other.load)

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
        return Direction.along(Measure.at(begin, length), end.u - begin.u, end.load - begin.load)

    def value(self, u: Array, load: float) -> float:
        """Progress at a field and load."""
        return float(np.vdot(self.row, u)) + self.load_weight * load

    def of(self, state: Equilibrium) -> float:
        """Progress at a state."""
        return self.value(state.u, state.load)

    def hold(self, value: float, slack: float) -> Hold:
        """What Newton's method keeps for a given progress."""
        return Hold(value, self.load_weight, self.row, slack)

    def corrected(self, problem: GridProblem, sketch: Sketch, slack: float, settings: Settings) -> Equilibrium | None:
        """The equilibrium with the progress of a trial state; None if it is not found."""
        u, load, contact = sketch
        hold = self.hold(self.value(u, load), slack)
        found = newton(problem, np.where(contact, -problem.heights, u), load, hold, contact, settings)
        return found if found.converged else None


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
class Track:
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


@dataclass
class Walker:
    """A walk along a curve.

    Attributes
    ----------
    problem : GridProblem
    length : float
        ℓ, the range of the law.
    options : WalkOptions
    points : list of Point
        The last that were accepted; whoever walks may delete all but the last few.
    message : str
        Why the walk could not go on; empty as long as it can.
    units : UnitValues
        For the message.
    """

    problem: GridProblem
    length: float
    options: WalkOptions = field(default_factory=WalkOptions)
    points: list[Point] = field(default_factory=list)
    message: str = ""
    units: UnitValues = REDUCED_VALUES

    def __post_init__(self) -> None:
        self.step_size = FIRST

    @property
    def settings(self) -> Settings:
        """Tolerances of the corrections."""
        return following(self.options.tolerance)

    def begin(self, start: Equilibrium, onward: Equilibrium) -> None:
        """Set out from one equilibrium towards another close to it."""
        distance = Measure.at(start, self.length).apart(onward, start)
        self.points = [Point(0.0, start), Point(distance, onward)]
        self.step_size = min(FIRST, 2.0 * distance)

    def step(self) -> bool:
        """Go one step on; False, and a message, if that is not possible."""
        options = self.options
        hopped = False
        while self.step_size >= LEAST:
            if options.hops and not hopped and self.step_size < 0.25 * options.period:
                if self._hop():
                    return True
                hopped = True
            angle = ANGLE if self.step_size > options.period else 0.5
            accepted = self._attempt(self.step_size, ORDER, angle, 0.15)
            if accepted is not None:
                point, miss, failed = accepted
                self.points.append(point)
                goal = max(CURVATURE * self.step_size, options.noise)
                growth = math.sqrt(goal / max(miss, 1e-12))
                self.step_size = min(MOST, self.step_size * min(1.6 if not failed else 1.0, max(0.5, growth)))
                return True
            self.step_size *= 0.5
        last = self.points[-1]
        self.message = (
            f"The curve could not be followed beyond load {last.load * self.units.load:.6g}, displacement "
            f"{last.displacement * self.units.normal:.6g}: no equilibrium was found within the smallest step"
        )
        return False

    def _hop(self) -> bool:
        """Pass corners of the lattice's own, which are a period apart, by a longer step along the mean direction."""
        if not self.points[-1].state.contact.any():
            return False
        for factor in (1.0, 2.0, 0.5, 4.0):
            size = factor * self.options.period
            accepted = self._attempt(size, 1, 0.5, 0.8)
            if accepted is not None:
                self.points.append(accepted[0])
                self.step_size = size
                return True
        return False

    def recent(self, count: int, size: float) -> list[Point]:
        """The last point and earlier ones at distances that suit a step: kinks of the lattice lie closer."""
        chosen = [self.points[-1]]
        for point in reversed(self.points[:-1]):
            if chosen[-1].arc - point.arc >= 0.5 * size:
                chosen.append(point)
            if len(chosen) == count:
                break
        if len(chosen) == 1:
            chosen.append(self.points[0] if len(self.points) < 3 else self.points[-2])
        return chosen[::-1]

    def _retraced(self, state: Equilibrium, distance: float) -> bool:
        """Whether a state lies closer to an earlier point than to the last one: the walk has turned round."""
        others = [point.state for point in self.points[:-1]]
        return any(Measure.at(other, self.length).apart(state, other) < 0.9 * distance for other in others)

    def _attempt(self, size: float, order: int, angle: float, loose: float) -> tuple[Point, float, bool] | None:
        """A step of a given size: the point, by how much the prediction missed, and whether that was much."""
        past = self.recent(order + 1, size)
        last, states = past[-1].state, [point.state for point in past]
        arcs = np.array([point.arc for point in past])
        weights, slopes = lagrange(arcs, arcs[-1] + size)
        u, load, contact = predicted(self.problem, states, weights)
        rate = np.tensordot(slopes, [state.u for state in states], 1), float(slopes @ [point.load for point in past])
        measure = Measure.at(last, self.length)
        direction = Direction.along(measure, *rate)
        hold = direction.hold(direction.value(u, load), 1e-3 * size * measure.product(*rate, *rate))
        found = newton(self.problem, u, load, hold, contact, self.settings)
        if not found.converged:
            return None
        miss = measure.norm(found.u - u, found.load - load)
        change = found.u - last.u, found.load - last.load
        distance = measure.norm(*change)
        cosine = direction.value(*change) / (distance * measure.norm(*rate)) if distance > 0 else 0.0
        allowed = max(loose * size, 4.0 * self.options.noise)
        if cosine < angle or miss > allowed or distance > 4.0 * size or self._retraced(found, distance):
            return None
        return Point(past[-1].arc + distance, found), miss, miss > 0.5 * allowed


def beside(
    setup: Setup, other: Setup, state: Equilibrium, way: tuple[Equilibrium, Equilibrium], settings: Settings
) -> Equilibrium | None:
    """The state on another lattice in the plane through a state and across the way from one state to another."""
    sketch, begin, end = (carried(setup, other, one) for one in (state, *way))
    change = end.u - begin.u, end.load - begin.load
    direction = Direction.along(Measure.of(other.problem.heights + sketch.u, state.load, setup.length), *change)
    return direction.corrected(other.problem, sketch, 1e-6 * abs(direction.value(*change)), settings)
