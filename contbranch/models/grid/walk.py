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
from dataclasses import dataclass, field

import numpy as np

from .arrays import Array
from .newton import Equilibrium, Hold, Settings, newton
from .problem import GridProblem
from .units import REDUCED_VALUES, UnitValues

__all__ = ["Direction", "Measure", "Point", "WalkOptions", "Walker", "between", "following"]


@dataclass(frozen=True)
class WalkOptions:
    """How a curve is followed.

    Attributes
    ----------
    tolerance : float
        Residual of every point, relative.
    first, least, most : float
        Steps in s: the first, and the limits.
    curvature : float
        Part of a step by which a prediction may miss, as goal of the step control.
    period : float
        Length of the curve over which the contact moves by one row of nodes.
    noise : float
        Distance by which it may miss at any rate: changes of the contact set make predictions no better.
    angle : float
        Least cosine between the predicted direction and the step.
    order : int
        Degree of the predicting polynomial.
    points : int
        Points at most.
    hops : bool
        Whether corners of the lattice's own may be passed by longer steps.
    """

    tolerance: float = 1e-7
    first: float = 0.05
    least: float = 2e-4
    most: float = 0.5
    curvature: float = 0.02
    period: float = 0.02
    noise: float = 1e-3
    angle: float = 0.9
    order: int = 2
    points: int = 2000
    hops: bool = True


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
    def at(state: Equilibrium, length: float) -> Measure:
        """The measure at a state for a law of a range."""
        ratio = np.minimum(state.fields.gap / (2.0 * length), 1e6)
        weights = (1.0 + ratio * ratio) ** -2
        scale = length + 0.5 * max(float(state.fields.gap.min()), 0.0)
        weights /= float(weights.sum()) * scale**2
        return Measure(weights, 1.0 / (3.0 + 0.3 * abs(state.load)) ** 2)

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

    def value(self, u: Array, load: float) -> float:
        """Progress at a state."""
        return float(np.vdot(self.row, u)) + self.load_weight * load

    def hold(self, value: float, slack: float) -> Hold:
        """What Newton's method keeps for a given progress."""
        return Hold(value, self.load_weight, self.row, slack)


def lagrange(nodes: list[float], at: float) -> tuple[list[float], list[float]]:
    """Weights of the values at the nodes in the interpolating polynomial at a place, and in its derivative."""
    weights, slopes = [], []
    for i, own in enumerate(nodes):
        others = [other for j, other in enumerate(nodes) if j != i]
        scale = math.prod(own - other for other in others)
        weights.append(math.prod(at - other for other in others) / scale)
        slope = sum(math.prod(at - other for k, other in enumerate(others) if k != left) for left in range(len(others)))
        slopes.append(slope / scale)
    return weights, slopes


def combined(weights: list[float], fields: list[Array]) -> Array:
    """Σ weights · fields."""
    total = weights[0] * fields[0]
    for weight, values in zip(weights[1:], fields[1:], strict=True):
        total += weight * values
    return np.asarray(total)


def wall_function(state: Equilibrium) -> Array:
    """The wall's pressure in contact, minus the gap outside: positive where a node belongs to the contact."""
    return np.where(state.contact, state.fields.excess, -np.minimum(state.fields.gap, 1e3))


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
    failures : int
        Steps that were refused.
    units : UnitValues
        For the message.
    """

    problem: GridProblem
    length: float
    options: WalkOptions = field(default_factory=WalkOptions)
    points: list[Point] = field(default_factory=list)
    message: str = ""
    failures: int = 0
    units: UnitValues = REDUCED_VALUES

    def __post_init__(self) -> None:
        self.step_size = self.options.first

    @property
    def settings(self) -> Settings:
        """Tolerances of the corrections."""
        return following(self.options.tolerance)

    def begin(self, start: Equilibrium, onward: Equilibrium) -> None:
        """Set out from one equilibrium towards another close to it."""
        distance = Measure.at(start, self.length).norm(onward.u - start.u, onward.load - start.load)
        self.points = [Point(0.0, start), Point(distance, onward)]
        self.step_size = min(self.options.first, 2.0 * distance)

    def step(self) -> bool:
        """Go one step on; False, and a message, if that is not possible."""
        options = self.options
        hopped = False
        while self.step_size >= options.least:
            if options.hops and not hopped and self.step_size < 0.25 * options.period:
                if self._hop():
                    return True
                hopped = True
            angle = options.angle if self.step_size > options.period else 0.5
            accepted = self._attempt(self.step_size, options.order, angle, 0.15)
            if accepted is not None:
                point, miss, failed = accepted
                self.points.append(point)
                goal = max(options.curvature * self.step_size, options.noise)
                growth = math.sqrt(goal / max(miss, 1e-12))
                self.step_size = min(options.most, self.step_size * min(1.6 if not failed else 1.0, max(0.5, growth)))
                return True
            self.failures += 1
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
        for point in self.points[:-1]:
            other = Measure.at(point.state, self.length)
            if other.norm(state.u - point.state.u, state.load - point.load) < 0.9 * distance:
                return True
        return False

    def _attempt(self, size: float, order: int, angle: float, loose: float) -> tuple[Point, float, bool] | None:
        """A step of a given size: the point, by how much the prediction missed, and whether that was much."""
        past = self.recent(order + 1, size)
        last = past[-1].state
        arcs = [point.arc for point in past]
        weights, slopes = lagrange(arcs, arcs[-1] + size)
        u = combined(weights, [point.state.u for point in past])
        load = math.fsum(w * point.load for w, point in zip(weights, past, strict=True))
        rate = combined(slopes, [point.state.u for point in past])
        load_rate = math.fsum(w * point.load for w, point in zip(slopes, past, strict=True))
        contact = combined(weights, [wall_function(point.state) for point in past]) > 0.0
        np.copyto(u, -self.problem.heights, where=contact)
        measure = Measure.at(last, self.length)
        direction = Direction.along(measure, rate, load_rate)
        slack = 1e-3 * size * measure.product(rate, load_rate, rate, load_rate)
        found = newton(self.problem, u, load, direction.hold(direction.value(u, load), slack), contact, self.settings)
        if not found.converged:
            return None
        miss = measure.norm(found.u - u, found.load - load)
        change, load_change = found.u - last.u, found.load - last.load
        distance = measure.norm(change, load_change)
        progress = direction.value(change, load_change)
        cosine = progress / (distance * measure.norm(rate, load_rate)) if distance > 0 else 0.0
        allowed = max(loose * size, 4.0 * self.options.noise)
        if cosine < angle or miss > allowed or distance > 4.0 * size or self._retraced(found, distance):
            return None
        return Point(past[-1].arc + distance, found), miss, miss > 0.5 * allowed


def between(
    problem: GridProblem, points: list[Point], direction: Direction, value: float, settings: Settings
) -> Equilibrium:
    """The equilibrium with a given progress along a direction, interpolated between points and corrected.

    Parameters
    ----------
    points : list of Point
        At least two around the place, at most four are used, those nearest in progress and apart from each other.
    """
    progress = [direction.value(point.state.u, point.load) for point in points]
    apart = 1e-6 * (max(progress) - min(progress))
    nearest: list[int] = []
    for k in sorted(range(len(points)), key=lambda k: abs(progress[k] - value)):
        if len(nearest) < 4 and all(abs(progress[k] - progress[other]) > apart for other in nearest):
            nearest.append(k)
    chosen = [points[k] for k in nearest]
    progress = [progress[k] for k in nearest]
    weights, _ = lagrange(progress, value)
    u = combined(weights, [point.state.u for point in chosen])
    load = math.fsum(w * point.load for w, point in zip(weights, chosen, strict=True))
    contact = (combined(weights, [wall_function(point.state) for point in chosen]) > 0.0) & settings.wall
    np.copyto(u, -problem.heights, where=contact)
    slack = 1e-3 * (max(progress) - min(progress))
    return newton(problem, u, load, direction.hold(value, slack), contact, settings)
