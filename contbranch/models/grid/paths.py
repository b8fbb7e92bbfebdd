"""The traced curve of a contact on a lattice as a quasi-static path needs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.quasi_static import Jump, Stop, next_along
from contbranch.errors import ModelError
from contbranch.results.diagram import State
from contbranch.results.record import OBSERVABLES

from .accuracy import compared, held
from .arrays import Array, Integers
from .landing import land
from .newton import Equilibrium, Hold, control_held, newton, settings_for
from .rows import Reading, crossing, read, state_at
from .trace import Traced
from .walk import Direction, Track, quietly

__all__ = ["GridWalk"]


# Two states are one if no gap differs by more than this part of the law's range: relaxations and Newton's method stop
# at different residuals, and soft states are far apart for the same one.
SAME = 0.02
# A relaxation that has come no farther than this part of the range has not left the fold; starts that are tried then.
LEFT, PUSHES = 0.3, 4
# Rows from a fold at which its stable part is looked for, past corners of the lattice's own.
FAR = 6
# Nodes from which on a path is drawn through the rows alone: they lie close, and every further state costs transforms.
FINE = 128**2
# An excess of pressure that may be neglected.
NOTHING = 1e-12
# Bisections of a piece for the work along it, and the difference of parabola and chord that needs none.
DEPTH, STRAIGHT = 3, 1e-3


class GridWalk:
    """A traced curve on a lattice under one control (a `quasi_static.Walk`), reduced units.

    Parameters
    ----------
    traced : Traced
        With its events, and with the control if that is a spring; all rows with their fields.
    control : Control
    accuracy : float
        Error allowed to the solution of the equations; what the lattice adds is estimated, see `appraised`.

    Attributes
    ----------
    notes : list of (Stop, Stop)
        Folds, and states after them, between which the relaxation could not be followed and energies do not decide.
    astray : list of (Stop, State)
        Folds from which the relaxation ends in a state that is not on the curve, and that state.

    Raises
    ------
    ModelError
        If the fields of some rows were given up to save memory.
    """

    # Curves of lattices need not hold all states: whatever energies say, relaxations are followed.
    follows = True

    def __init__(self, traced: Traced, control: Control, accuracy: float) -> None:
        if any(row.u is None for row in traced.rows):
            raise ModelError(
                "hysteresis: the curve has too many points to keep the fields of all; use a coarser grid or a smaller "
                "max_load"
            )
        self.traced, self.control = traced, control
        self.setup, self.problem = traced.setup, traced.setup.problem
        self.settings = settings_for(accuracy)
        self.notes: list[tuple[Stop, Stop]] = []
        self.astray: list[tuple[Stop, State]] = []
        self._crossings: dict[tuple[int, float], Stop] = {}
        self._between: dict[tuple[int, int, int], list[State]] = {}

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows."""
        return np.array([self.control.value(*row.reading[:2]) for row in self.traced.rows])

    @property
    def unstable(self) -> Integers:
        """Morse index under the control on the pieces."""
        return self.traced.indices.pieces(self.control)[0]

    @property
    def rising(self) -> Integers:
        """Signs of the change of what is controlled on the pieces."""
        return self.traced.indices.pieces(self.control)[1]

    @cached_property
    def _folds(self) -> dict[int, Stop]:
        found = {}
        for event in self.traced.curve.events:
            if event.kind == "fold" and event.control == self.control.kind:
                stop = self.stop(event.row)
                error = dict(zip(OBSERVABLES, event.error, strict=True))
                found[event.row] = replace(stop, state=replace(stop.state, error=error))
        return found

    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row."""
        return self._folds

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        curve = self.traced.curve
        indices = int(curve.unstable_load[row]), int(curve.unstable_displacement[row])
        return _state(self.traced.rows[row].reading, *indices)

    def stop(self, row: int) -> Stop:
        """A row as a stop."""
        return Stop(min(row, len(self.unstable) - 1), self.row(row), self._at(row), row)

    def _at(self, row: int) -> Equilibrium:
        return state_at(self.problem, self.traced.rows[row])

    def between(self, begin: Stop, end: Stop, count: int) -> list[State]:
        """States between two stops on one piece of the curve, without profiles; none on large lattices."""
        if self.problem.heights.size > FINE:
            return []
        first, last = (begin, end) if _position(begin) <= _position(end) else (end, begin)
        key = _identity(first), _identity(last), count
        if key not in self._between:
            found = self._states(first.place, last.place, np.linspace(0.0, 1.0, count + 2)[1:-1])
            indices = first.state.unstable_load, first.state.unstable_displacement
            self._between[key] = [_state(read(self.setup, state), *indices) for state in found]
        states = self._between[key]
        return list(states) if first is begin else states[::-1]

    def _states(self, begin: Equilibrium, end: Equilibrium, shares: Array | Sequence[float]) -> list[Equilibrium]:
        """Equilibria at parts of the way between two, fewer where the curve has a corner."""
        direction = Direction.between(begin, end, self.setup.length)
        low, high = direction.of(begin), direction.of(end)
        states = (
            Track(self.problem, [begin, end], direction, self.settings).at(low + share * (high - low))
            for share in shares
        )
        return [state for state in states if state is not None]

    def crossing(self, piece: int, value: float) -> Stop:
        """The state on a piece at a value of the control.

        Raises
        ------
        ModelError
            If the curve cannot be followed there.
        """
        key = piece, value
        if key not in self._crossings:
            exact = [row for row in (piece, piece + 1) if self.values[row] == value]
            rows = self.traced.rows[piece], self.traced.rows[piece + 1]
            state = self._at(exact[0]) if exact else crossing(self.setup, rows, self.control, value, self.settings)
            if state is None:
                raise ModelError(f"no state was found on the curve where the {self.control.kind} is {value:.6g}")
            self._crossings[key] = self._stop(state, piece)
        return self._crossings[key]

    def before(self, value: float) -> Stop | None:
        """The state farther away than the first row; None under load.

        Raises
        ------
        ModelError
            If it was not found.
        """
        if self.control.kind == "load":
            return None
        start = self._at(0)
        # Out there displacement and position of a spring all but agree.
        u = start.u + (self.values[0] - value)
        found = newton(self.problem, u, start.load, self._hold(value), None, self.settings)
        # Residuals are relative to the pressure, of which rounding leaves little out there.
        left = found.residual * float(np.abs(found.fields.elastic).max())
        if not found.converged and not left <= NOTHING:
            raise ModelError(f"no state was found before the curve's first row, where the control is {value:.6g}")
        return self._stop(found, -1)

    def relaxed(self, fold: Stop, candidates: Sequence[Stop]) -> Stop | None:
        """Which of several stable states overdamped relaxation from a fold reaches, by following the relaxation.

        It starts at the fold's value from the state on the curve a little beyond the fold, where the curve goes on as
        the saddle that has just merged with the stable state: at the fold's value that side is downhill. Where it has
        not left the fold (the lattice's own barriers are next to it), it starts farther along. Where the relaxation
        comes to rest in a state that is not on the curve, none is reached, and `astray` says so.
        """
        start = self._row(fold)
        onward = 1 if start > 0 and self.unstable[start - 1] == 0 else -1
        value = self.control.value(fold.state.load, fold.state.displacement)
        end = None
        for push in range(1, PUSHES + 1):
            row = start + push * onward
            if not 0 <= row < len(self.traced.rows) or (push > 1 and self.unstable[min(row, row - onward)] == 0):
                break
            end = self._landed(self._at(row), value)
            if not end.converged:
                continue
            reached = self._reached(end, candidates)
            if reached is not None:
                return reached
            if self._apart(end, fold) > LEFT:
                break
        if end is not None and end.converged and self._apart(end, fold) <= LEFT:
            end = self._forced(fold, end, value, start - FAR * onward)
            reached = self._reached(end, candidates)
            if reached is not None:
                return reached
        if end is not None and end.converged:
            self.astray.append((fold, _state(read(self.setup, end), 0, 0)))
            return None
        if not candidates:
            return None
        following, certain = next_along(self, fold, candidates)
        if not certain:
            self.notes.append((fold, following))
        return following

    def _landed(self, start: Equilibrium, value: float) -> Equilibrium:
        """Where a relaxation at a value of the control ends."""
        with quietly():
            return land(self.problem, start.u, start.load, self._hold(value), self.settings.tolerance)

    def _reached(self, end: Equilibrium, candidates: Sequence[Stop]) -> Stop | None:
        """The stop that a state is."""
        nearest = min(candidates, key=partial(self._apart, end), default=None)
        return None if nearest is None or self._apart(end, nearest) > SAME else nearest

    def _forced(self, fold: Stop, state: Equilibrium, value: float, stable: int) -> Equilibrium:
        """Relax once more with the control beyond the fold by the lattice's error: what still holds it is smaller.

        The row `stable` lies on the stable part from which the fold is reached, or beyond its end.
        """
        error = fold.state.error
        uncertain = self.control.value(error.get("load", 0.0), error.get("displacement", 0.0))
        if not math.isfinite(uncertain):
            return state
        reached = self.values[np.clip(stable, 0, len(self.values) - 1)]
        return self._landed(state, value + math.copysign(uncertain, value - reached))

    def _apart(self, state: Equilibrium, stop: Stop) -> float:
        """Largest difference between two states' gaps, relative to the law's range."""
        return float(np.abs(stop.place.u - state.u).max()) / self.setup.length

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another, by quadrature of parabolas through states on it.

        Of the average it is the change of the energy: its states lie beside it.
        """
        if _position(begin) > _position(end):
            return -self.work(end, begin)
        last = end.piece + 1 if end.row is None else end.row
        stops = [begin, *map(self.stop, range(self._row(begin) + 1, last)), end]
        return math.fsum(
            two.state.energy - one.state.energy
            if self._averaged(one) and self._averaged(two)
            else self._piece(one.place, two.place, 0)
            for one, two in pairwise(stops)
        )

    def _averaged(self, stop: Stop) -> bool:
        return stop.row is not None and self.traced.rows[stop.row].averaged

    def _piece(self, begin: Equilibrium, end: Equilibrium, depth: int) -> float:
        straight = 0.5 * (begin.load + end.load) * (end.displacement - begin.displacement)
        inner = self._states(begin, end, [0.5]) if np.abs(end.u - begin.u).max() > 0.0 else []
        if not inner:
            return straight
        middle = inner[0]
        curved = _parabola(*((state.load, state.displacement) for state in (begin, middle, end)))
        if depth == DEPTH or abs(curved - straight) <= STRAIGHT:
            return curved
        return self._piece(begin, middle, depth + 1) + self._piece(middle, end, depth + 1)

    def appraised(self, jumps: Sequence[Jump]) -> list[Jump]:
        """Jumps whose ends know by how much the lattice may be wrong in the energy of contact and drive.

        That is by how much the energy changes on the lattice with half the nodes a side, apart from what goes with a
        change of load and displacement along the curve: see `Comparison.potential`. Where that lattice has no such
        state, it is the largest estimate of all the other ends.
        """
        known = [[None if stop is None else self._potential(stop) for stop in (j.begin, j.end)] for j in jumps]
        finite = [value for pair in known for value in pair if value is not None and math.isfinite(value)]
        most = max(finite, default=math.inf)

        def estimated(stop: Stop | None, value: float | None) -> Any:
            return None if stop is None or value is None else replace(stop, uncertainty=min(value, most))

        return [
            replace(jump, begin=estimated(jump.begin, begin), end=estimated(jump.end, end))
            for jump, (begin, end) in zip(jumps, known, strict=True)
        ]

    def _potential(self, stop: Stop) -> float:
        """Error estimate of a state's energy, from the coarse lattice in the plane across the curve; else infinite."""
        if stop.piece < 0:
            value = self.control.value(stop.state.load, stop.state.displacement)
            found = held(self.setup, stop.place, self.control, value, self.settings)
            if self.setup.grid % 4:
                return math.inf
            # out there, where rounding may be all that is left, energies are no larger than their errors
            return abs(stop.state.energy) if found is None else found.potential
        if self._averaged(stop):
            return max(row.mark.potential for row in self.traced.rows if row.mark is not None)
        row, count = self._row(stop), len(self.traced.rows)
        around = [self._at(other) for other in (row - 1, row + 1) if 0 <= other < count]
        compares = (compared(self.setup, before, stop.place, self.settings) for before in around)
        # Where one plane meets another part of the coarse lattice's curve, the other one need not.
        return min((found.potential for found in compares if found is not None), default=math.inf)

    @staticmethod
    def _row(stop: Stop) -> int:
        """The row of a stop, or the one before it."""
        return stop.piece if stop.row is None else stop.row

    def _hold(self, value: float) -> Hold:
        return control_held(self.setup.problem, self.control, value)

    def _stop(self, state: Equilibrium, piece: int) -> Stop:
        indices = (int(self.traced.indices.pieces(control)[0][max(piece, 0)]) for control in (LOAD, DISPLACEMENT))
        return Stop(piece, _state(read(self.setup, state), *indices), state)


def _state(reading: Reading, unstable_load: int, unstable_displacement: int) -> State:
    return State(*reading[:5], unstable_load, unstable_displacement, 0.0)


def _position(stop: Stop) -> float:
    return float(stop.row if stop.row is not None else stop.piece + 0.5)


def _identity(stop: Stop) -> int:
    """Rows are made into stops anew each time; other stops are kept."""
    return stop.row if stop.row is not None else -1 - id(stop.place)


def _parabola(*points: tuple[float, float]) -> float:
    """∫ F dd along the parabola (F, d)(s) through its values at s = 0, 1/2 and 1; exact by Simpson's rule."""
    (f0, d0), (f1, d1), (f2, d2) = points
    rates = -3.0 * d0 + 4.0 * d1 - d2, d2 - d0, d0 - 4.0 * d1 + 3.0 * d2
    return (f0 * rates[0] + 4.0 * f1 * rates[1] + f2 * rates[2]) / 6.0
