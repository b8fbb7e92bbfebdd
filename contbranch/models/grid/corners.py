"""The curve on a lattice piece by piece: it is smooth as long as the contact stays, and has a corner at every change.

At a corner a node has neither gap nor wall pressure. That is an equation, and a corner is found with it: the node's gap
is held at zero while the node counts as free. Behind a corner the rates of change solve a problem of complementarity:
with D the nodes that have neither gap nor pressure there (several, where a map repeats itself),

    ṗ ≥ 0,  ġ ≥ 0,  ṗ ġ = 0      on D,

and the sense is that in which the node that led to the corner is pressed, or opens.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array, Flags

from .linear import Change
from .measure import Direction, Measure
from .newton import Equilibrium, Hold, Settings, newton, tangent
from .problem import GridProblem

__all__ = ["Corners", "Way"]

# Gaps in ranges of the law, and pressures in the lattice's unit, that are zero at a corner, and the error of its own.
ZERO_MARGIN, CORNER_ERROR = 1e-6, 1e-7
# Gap in ranges of a node that has just opened.
OPEN = 1e-9
# Length of a piece that is none.
NO_LENGTH = 1e-9
# Nodes tried for one corner, steps along one piece, and sets tried behind one corner.
MOST_TARGETS, MOST_STEPS, MOST_SETS = 8, 40, 8
# Newton steps up to which the next step along a piece may be longer.
FEW_STEPS = 3
# Longest distance of a corner from where it was expected, in rows of nodes.
FARTHEST = 0.3


class Way(NamedTuple):
    """A direction of the curve at a state, of unit length, its change of the pressure, and the measure that says so."""

    measure: Measure
    u: Array
    load: float
    pressure: Array

    @property
    def direction(self) -> Direction:
        """Its covector."""
        return Direction.along(self.measure, self.u, self.load)

    def beyond(self, begin: Equilibrium, end: Equilibrium) -> tuple[Array, float]:
        """From the direction at one state that at another, with the same contact: a parabola's."""
        size = max(self.measure.apart(begin, end), NO_LENGTH)
        change = end.beyond(begin)
        return 2.0 / size * change[0] - self.u, 2.0 / size * change[1] - self.load

    def turned(self) -> Way:
        """The opposite one."""
        return Way(self.measure, -self.u, -self.load, -self.pressure)


@dataclass
class Corners:
    """Finds the corners of one problem's curve.

    Attributes
    ----------
    problem : GridProblem
    length : float
        The law's range.
    settings : Settings
        Of the tolerance.
    """

    problem: GridProblem
    length: float
    settings: Settings

    def __post_init__(self) -> None:
        self.period = self.problem.lattice.spacing / self.length
        self.settings = replace(
            self.settings, wall=True, frozen=True, steps=15, inner=200, growth=1e3, patience=8, forcing=0.01
        )

    def way(self, state: Equilibrium, towards: Direction | Way) -> Way | None:
        """The tangent at a state, its progress in a direction positive; it may be known to be near another."""
        near = Change(towards.u, towards.load, towards.pressure, 0.0) if isinstance(towards, Way) else None
        direction = towards.direction if isinstance(towards, Way) else towards
        u, load, pressure, _ = tangent(self.problem, state, direction.hold(0.0, 0.0), near=near)
        measure = Measure.at(state, self.length)
        size = measure.norm(u, load)
        return Way(measure, u / size, load / size, pressure / size) if np.isfinite(size) and size > 0.0 else None

    def along(self, state: Equilibrium, u: Array, load: float) -> Way:
        """A direction of the curve that is known; one pair of transforms."""
        measure = Measure.at(state, self.length)
        size = measure.norm(u, load)
        pressure = self.problem.stiffness(u) + load / self.problem.lattice.area
        return Way(measure, u / size, load / size, pressure / size)

    def margins(self, state: Equilibrium) -> Array:
        """What must not be negative: the wall's pressure in contact, the gap outside, each in its unit."""
        own = np.where(state.contact, state.fields.excess * 2.0 * self.period, state.fields.gap / self.length)
        return np.where(np.isfinite(own), own, np.inf)

    def _rates(self, contact: Flags, way: Way) -> Array:
        """Those of the margins."""
        return np.where(contact, way.pressure * 2.0 * self.period, way.u / self.length)

    def next(self, state: Equilibrium, way: Way) -> tuple[Equilibrium, tuple[int, int]] | None:
        """The next corner ahead of a state, with the contact before it, and the node that leads there."""
        step = self.period
        for _ in range(MOST_STEPS):
            rate, margin = self._rates(state.contact, way), np.maximum(self.margins(state), 0.0)
            ahead = np.where(rate < 0.0, margin / np.where(rate < 0.0, -rate, 1.0), np.inf)
            node = _least(ahead)
            distance = min(float(ahead[node]), step)
            u, load = state.u + distance * way.u, state.load + distance * way.load
            if distance < ahead[node]:
                there = self.beside(state, u, load, way.direction)
                if there is None:
                    step *= 0.5
                    continue
                first = self._first(state, there)
                if first is None:
                    onward = self.way(there, way)
                    if onward is None:
                        return None
                    state, way, step = there, onward, 2.0 * step if there.steps <= FEW_STEPS else step
                    step = min(step, self.period)
                    continue
                node, u, load = first, 0.5 * (state.u + there.u), 0.5 * (state.load + there.load)
            found = self._targeted(state, u, load, node, way, max(4.0 * distance, FARTHEST * self.period))
            if found is not None:
                return found
            if distance < 1e-6 * self.period:
                return None
            step = 0.5 * distance
        return None

    def _targeted(
        self, state: Equilibrium, u: Array, load: float, target: tuple[int, int], way: Way, most: float
    ) -> tuple[Equilibrium, tuple[int, int]] | None:
        """The first corner ahead of a state, sought at one node after the other, with its node."""
        for _ in range(MOST_TARGETS):
            end = self.at(state, u, load, target)
            if end is None or way.measure.apart(end, state) > most:
                return None
            if way.direction.value(*end.beyond(state)) < -NO_LENGTH:
                return None
            first = self._first(state, end, target)
            if first is None or first == target:
                return end, target
            target, u, load = first, 0.5 * (state.u + end.u), 0.5 * (state.load + end.load)
        return None

    def at(self, state: Equilibrium, u: Array, load: float, node: tuple[int, int]) -> Equilibrium | None:
        """The state near a trial state in which a node has neither gap nor pressure, with the contact before it."""
        row = np.zeros(self.problem.shape)
        row[node] = 1.0
        free = state.contact & (row == 0.0)
        hold = Hold(-float(self.problem.heights[node]), 0.0, row, CORNER_ERROR * self.length)
        found = newton(self.problem, np.where(row, -self.problem.heights, u), load, hold, free, self.settings)
        return replace(found, contact=state.contact) if found.converged else None

    def beside(self, state: Equilibrium, u: Array, load: float, along: Direction) -> Equilibrium | None:
        """The state of the same contact with the progress of a trial state."""
        slack = 1e-4 * abs(along.value(u - state.u, load - state.load))
        found = newton(self.problem, u, load, along.hold(along.value(u, load), slack), state.contact, self.settings)
        return found if found.converged else None

    def _first(
        self, state: Equilibrium, ahead: Equilibrium, known: tuple[int, int] | None = None
    ) -> tuple[int, int] | None:
        """The node that changes first between two states of one contact; if no other does, the one that is known."""
        begin, end = np.maximum(self.margins(state), 0.0), self.margins(replace(ahead, contact=state.contact))
        broken = end < -ZERO_MARGIN
        if known is not None:
            broken[known] = False
        if not broken.any():
            return known
        return _least(np.where(broken, begin / np.where(broken, begin - end, 1.0), np.inf))

    def behind(
        self, corner: Equilibrium, node: tuple[int, int], towards: Direction | Way
    ) -> tuple[Equilibrium, Way] | None:
        """The contact behind a corner, and the direction of the curve there.

        Parameters
        ----------
        corner : Equilibrium
            With the contact before it.
        node : (int, int)
            The node that led there.
        towards : Direction or Way
            Any that is not across the curve.
        """
        undecided = np.abs(self.margins(corner)) <= ZERO_MARGIN
        undecided[node] = True
        contact = corner.contact ^ undecided
        for _ in range(MOST_SETS):
            # Gaps tell the contact.
            opened = np.maximum(corner.u, OPEN * self.length - self.problem.heights)
            u = np.where(contact, -self.problem.heights, opened)
            state = replace(corner, fields=corner.fields._replace(u=u), contact=contact)
            way = self.way(state, towards)
            if way is None:
                return None
            if (way.pressure if contact[node] else way.u)[node] < 0.0:
                way = way.turned()
            wrong = undecided & (self._rates(contact, way) < 0.0)
            if not wrong.any():
                return state, way
            contact = contact ^ wrong
        return None


def _least(values: Array) -> tuple[int, int]:
    """The node with the least value."""
    row, column = np.unravel_index(int(np.argmin(values)), values.shape)
    return int(row), int(column)
