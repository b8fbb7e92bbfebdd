"""The curve on a lattice arc by arc: as long as the contact stays it is smooth, and it has a corner at every change.

At a corner a node has neither gap nor wall pressure. That is an equation, and a corner is found with it: the node's gap
is held at zero while the node counts as free. No corner, fold or reversal of the lattice's own can then be passed over,
and none needs a small step: behind a corner the curve goes on along the arc of the new contact, in the direction in
which the node is pressed, or opens.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array, Flags

from .linear import Change
from .measure import Direction, Measure
from .newton import Equilibrium, Hold, Settings, newton, tangent
from .problem import Fields, GridProblem

__all__ = ["Arc", "arcs", "onward", "pressed"]

# Violations of the inequalities that are rounding, relative to the largest gap in play and to the pressure.
LOOSE = 1e-6
# Gap at a corner, in ranges of the law, and length of an arc that is none.
CLOSED, SHORT = 1e-7, 1e-9
# Targets tried for one corner, and steps along one arc.
TARGETS, STEPS = 8, 40
# Newton steps up to which the next one along an arc may be longer.
EASY = 3
# Residual of a state in the middle of an arc: what is read off it is not known any better.
MIDDLE = 1e-4


@dataclass(frozen=True)
class Arc:
    """Three equilibria of one contact, where it begins, in the middle, and where it ends, and the tangents (u, F) at
    both ends."""

    begin: Equilibrium
    middle: Equilibrium
    end: Equilibrium
    tangents: tuple[tuple[Array, float], tuple[Array, float]]


@dataclass(frozen=True)
class _Way:
    """A direction of the curve at a state, of unit length, its change of the pressure, and the measure that says so."""

    measure: Measure
    u: Array
    load: float
    pressure: Array

    @property
    def direction(self) -> Direction:
        return Direction.along(self.measure, self.u, self.load)

    def bent(self, before: _Way, size: float) -> tuple[Array, float]:
        """Half the change of the way over a distance."""
        return 0.5 / size * (self.u - before.u), 0.5 / size * (self.load - before.load)

    def beyond(self, begin: Equilibrium, end: Equilibrium) -> _Way:
        """From the way at one state that at another: a parabola's."""
        size = self.measure.apart(begin, end)
        if size < SHORT:
            return self
        elastic = end.fields.elastic - begin.fields.elastic
        return _Way(
            self.measure,
            2.0 / size * (end.u - begin.u) - self.u,
            2.0 / size * (end.load - begin.load) - self.load,
            2.0 / size * elastic - self.pressure,
        )

    def turned(self) -> _Way:
        return _Way(self.measure, -self.u, -self.load, -self.pressure)


@dataclass
class _Follower:
    """Arcs of one problem."""

    problem: GridProblem
    length: float
    period: float
    settings: Settings

    def __post_init__(self) -> None:
        self.cap = self.period
        self.settings = replace(self.settings, frozen=True, steps=8, inner=200, growth=1e3, patience=3, forcing=0.01)

    def way(self, state: Equilibrium, towards: Direction | _Way) -> _Way | None:
        """The tangent at a state, its progress in a direction positive; it may be known to be near another."""
        near = Change(towards.u, towards.load, towards.pressure, 0.0) if isinstance(towards, _Way) else None
        direction = towards.direction if isinstance(towards, _Way) else towards
        u, load, pressure, _ = tangent(self.problem, state, direction.hold(0.0, 0.0), near=near)
        measure = Measure.at(state, self.length)
        size = measure.norm(u, load)
        return _Way(measure, u / size, load / size, pressure / size) if np.isfinite(size) and size > 0.0 else None

    def margins(self, state: Equilibrium) -> Array:
        """What must not be negative: the wall's pressure in contact, the gap outside, each in its unit."""
        own = np.where(state.contact, state.fields.excess / self._pressure, state.fields.gap / self.length)
        return np.where(np.isfinite(own), own, np.inf)

    @property
    def _pressure(self) -> float:
        return 0.5 / self.period

    def events(self, state: Equilibrium, way: _Way) -> tuple[float, tuple[int, int]]:
        """How far ahead the first node changes, by the tangent, and which."""
        rate = np.where(state.contact, way.pressure / self._pressure, way.u / self.length)
        margin = np.maximum(self.margins(state), 0.0)
        ahead = np.where(rate < 0.0, margin / np.where(rate < 0.0, -rate, 1.0), np.inf)
        node = _least(ahead)
        return float(ahead[node]), node

    def orbit(self, node: tuple[int, int]) -> Flags:
        """A node and its image where x and y can be exchanged."""
        own = np.zeros(self.problem.shape, dtype=bool)
        own[node] = True
        return own | own.T if self.problem.swapped else own

    def corner(self, state: Equilibrium, u: Array, load: float, node: tuple[int, int]) -> Equilibrium | None:
        """The state near a trial state in which a node has neither gap nor pressure, with the node's new contact."""
        row = np.zeros(self.problem.shape)
        row[node] = 1.0
        own = self.orbit(node)
        free = state.contact & ~own
        hold = Hold(-float(self.problem.heights[node]), 0.0, row, CLOSED * self.length)
        found = newton(self.problem, np.where(own, -self.problem.heights, u), load, hold, free, self.settings)
        return replace(found, contact=found.contact if state.contact[node] else free | own) if found.converged else None

    def beside(
        self, state: Equilibrium, u: Array | Fields, load: float, along: Direction, tolerance: float = 0.0
    ) -> Equilibrium | None:
        """The state of the same contact with the progress of a trial state."""
        own = u.u if isinstance(u, Fields) else u
        slack = 1e-4 * abs(along.value(own - state.u, load - state.load))
        hold = along.hold(along.value(own, load), slack)
        settings = replace(self.settings, tolerance=max(tolerance, self.settings.tolerance))
        found = newton(self.problem, u, load, hold, state.contact, settings)
        return found if found.converged else None

    def first(
        self, state: Equilibrium, ahead: Equilibrium, known: tuple[int, int] | None = None
    ) -> tuple[int, int] | None:
        """The node that changes first between two states of one contact; if no other does, the one that is known."""
        begin, end = self.margins(state), self.margins(replace(ahead, contact=state.contact))
        begin = np.maximum(begin, 0.0)
        broken = end < -LOOSE
        if known is not None:
            broken[known] = False
        if not broken.any():
            return known
        return _least(np.where(broken, begin / np.where(broken, begin - end, 1.0), np.inf))

    def arc(self, begin: Equilibrium, way: _Way) -> tuple[Arc, tuple[int, int], _Way] | None:
        """From a state to the next corner: the arc, the node that changes there, and the way before it."""
        state, last, cap = begin, way, self.cap
        bend: tuple[Array | float, float] = 0.0, 0.0
        for _ in range(STEPS):
            distance, node = self.events(state, last)
            step = min(distance, cap)
            target: tuple[int, int] | None = node if distance <= cap else None
            u, load = state.u + step * (last.u + step * bend[0]), state.load + step * (last.load + step * bend[1])
            if target is None:
                there = self.beside(state, u, load, last.direction)
                if there is None:
                    cap = 0.5 * step
                    continue
                target = self.first(state, there)
                if target is None:
                    onward = self.way(there, last.beyond(state, there))
                    if onward is None:
                        return None
                    longer = 2.0 * step if there.steps <= EASY else step
                    bend = onward.bent(last, last.measure.apart(there, state))
                    state, last = there, onward
                    self.cap = cap = min(longer, self.period)
                    continue
                u, load = 0.5 * (state.u + there.u), 0.5 * (state.load + there.load)
            found = self._targeted(state, u, load, target, last, max(4.0 * step, 0.3 * self.period))
            if found is not None:
                end, node = found
                ahead = last.beyond(state, end)
                tangents = (way.u, way.load), (ahead.u, ahead.load)
                return Arc(begin, self._middle(begin, end, way), end, tangents), node, ahead
            if step < 1e-6 * self.period:
                return None
            cap = 0.5 * step
        return None

    def _targeted(
        self, state: Equilibrium, u: Array, load: float, target: tuple[int, int], way: _Way, most: float
    ) -> tuple[Equilibrium, tuple[int, int]] | None:
        """The first corner ahead of a state, sought at one node after the other."""
        for _ in range(TARGETS):
            end = self.corner(state, u, load, target)
            if end is None or way.measure.apart(end, state) > most:
                return None
            if way.direction.value(*end.beyond(state)) < -1e-9:
                return None
            first = self.first(state, end, target)
            if first is None or first == target:
                return end, target
            target, u, load = first, 0.5 * (state.u + end.u), 0.5 * (state.load + end.load)
        return None

    def _middle(self, begin: Equilibrium, end: Equilibrium, way: _Way) -> Equilibrium:
        """The state half the way along an arc."""
        change = end.beyond(begin)
        size = way.measure.norm(*change)
        if size < SHORT:
            return begin
        bend = 0.25 * size
        # a parabola through both ends with the tangent at the first
        u = begin.u + bend * way.u + 0.25 * change[0]
        load = begin.load + bend * way.load + 0.25 * change[1]
        elastic = begin.fields.elastic + bend * way.pressure + 0.25 * (end.fields.elastic - begin.fields.elastic)
        trial = self.problem.evaluated(u, load, elastic, begin.contact)
        return self.beside(begin, trial, load, Direction.along(way.measure, *change), MIDDLE) or begin

    def onward(self, end: Equilibrium, node: tuple[int, int], way: _Way) -> _Way | None:
        """The direction of the curve behind a corner: the node is pressed, or opens."""
        found = self.way(end, way)
        if found is None:
            return None
        rate = (found.pressure if end.contact[node] else found.u)[node]
        return found if rate > 0.0 else found.turned()


def arcs(
    problem: GridProblem, length: float, start: tuple[Equilibrium, Equilibrium], settings: Settings
) -> Iterator[Arc]:
    """The arcs of the curve from a state on, until one is not found.

    Parameters
    ----------
    length : float
        The law's range.
    start : two Equilibrium
        The first, and one ahead of it that tells the sense in which to go.
    settings : Settings
        Of its tolerance.
    """
    follower = _Follower(problem, length, problem.lattice.spacing / length, settings)
    state = start[0]
    way = follower.way(state, Direction.between(*start, length))
    while way is not None:
        found = follower.arc(state, way)
        if found is None:
            return
        arc, node, last = found
        yield arc
        state = arc.end
        way = follower.onward(state, node, last)


def onward(before: Equilibrium, state: Equilibrium) -> tuple[Equilibrium, Equilibrium]:
    """A state, and as far ahead of it as another is behind: a start of arcs."""
    fields = state.fields._replace(u=2.0 * state.u - before.u, load=2.0 * state.load - before.load)
    return state, replace(state, fields=fields)


def pressed(
    problem: GridProblem, length: float, touch: Equilibrium, towards: Direction, settings: Settings
) -> tuple[tuple[Array, float] | None, Flags]:
    """The direction of the curve behind first touch, where a node has just closed and is pressed; and that node.

    Parameters
    ----------
    towards : Direction
        That of the curve before it, or another that is not across the curve.
    """
    follower = _Follower(problem, length, problem.lattice.spacing / length, settings)
    node = _least(touch.fields.gap)
    state = replace(touch, contact=follower.orbit(node))
    way = follower.way(state, towards)
    found = None if way is None else follower.onward(state, node, way)
    return None if found is None else (found.u, found.load), state.contact


def _least(values: Array) -> tuple[int, int]:
    """The node with the least value."""
    row, column = np.unravel_index(int(np.argmin(values)), values.shape)
    return int(row), int(column)
