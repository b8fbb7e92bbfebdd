"""The traced curve of a contact on a lattice as a quasi-static path needs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from contbranch.control import Control
from contbranch.curve.quasi_static import Jump, Stop, next_along
from contbranch.errors import ModelError
from contbranch.results.diagram import State

from .accuracy import compared, held
from .arrays import Array, Integers
from .landing import land
from .newton import Equilibrium, Hold, Settings, newton
from .reading import Reading, read
from .solve import control_held, crossing, state_at
from .trace import Traced
from .walk import Direction, Measure, Point, between

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
        self.traced, self._control, self.accuracy = traced, control, accuracy
        self.setup, self.problem = traced.setup, traced.setup.problem
        self.settings = Settings(tolerance=min(max(1e-2 * accuracy, 1e-10), 1e-8))
        self.notes: list[tuple[Stop, Stop]] = []
        self.astray: list[tuple[Stop, State]] = []
        self._crossings: dict[tuple[int, float], Stop] = {}
        self._between: dict[tuple[int, int, int], list[State]] = {}

    @property
    def control(self) -> Control:
        """The control."""
        return self._control

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows."""
        return np.array([self._control.value(row.load, row.reading.displacement) for row in self.traced.rows])

    @property
    def unstable(self) -> Integers:
        """Morse index under the control on the pieces."""
        return self.traced.indices.pieces(self._control.kind)[0]

    @property
    def rising(self) -> Integers:
        """Signs of the change of what is controlled on the pieces."""
        return self.traced.indices.pieces(self._control.kind)[1]

    @cached_property
    def _folds(self) -> dict[int, Stop]:
        found = {}
        names = ("load", "displacement", "contact_radius", "central_gap")
        for event in self.traced.curve.events:
            if event.kind == "fold" and event.control == self._control.kind:
                stop = self.stop(event.row)
                error = dict(zip(names, (float(value) for value in event.error), strict=True))
                found[event.row] = replace(stop, state=replace(stop.state, error=error))
        return found

    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row."""
        return self._folds

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        curve = self.traced.curve
        return _state(
            self.traced.rows[row].reading, int(curve.unstable_load[row]), int(curve.unstable_displacement[row])
        )

    def stop(self, row: int) -> Stop:
        """A row as a stop."""
        return Stop(min(row, len(self.unstable) - 1), self.row(row), state_at(self.problem, self.traced.rows[row]), row)

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
        change, load_change = end.u - begin.u, end.load - begin.load
        direction = Direction.along(Measure.at(begin, self.setup.length), change, load_change)
        bounds = [direction.value(state.u, state.load) for state in (begin, end)]
        points = [Point(0.0, begin), Point(1.0, end)]
        found = []
        for share in shares:
            goal = bounds[0] + float(share) * (bounds[1] - bounds[0])
            state = between(self.problem, points, direction, goal, self.settings)
            if state.converged:
                found.append(state)
        return found

    def crossing(self, piece: int, value: float) -> Stop:
        """The state on a piece at a value of the control.

        Raises
        ------
        ModelError
            If the curve cannot be followed there.
        """
        key = piece, value
        if key not in self._crossings:
            rows = self.traced.rows[piece], self.traced.rows[piece + 1]
            ends = self.values[piece], self.values[piece + 1]
            exact = [row for row, end in zip(rows, ends, strict=True) if end == value]
            if exact:
                state: Equilibrium | None = state_at(self.problem, exact[0])
            else:
                state = crossing(self.setup, rows, self._control, value, self.settings)
            if state is None:
                raise ModelError(f"no state was found on the curve where the {self._control.kind} is {value:.6g}")
            self._crossings[key] = self._stop(state, piece)
        return self._crossings[key]

    def before(self, value: float) -> Stop | None:
        """The state farther away than the first row; None under load.

        Raises
        ------
        ModelError
            If it was not found.
        """
        if self._control.kind == "load":
            return None
        start = state_at(self.problem, self.traced.rows[0])
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
        assert fold.row is not None
        onward = 1 if fold.row > 0 and self.unstable[fold.row - 1] == 0 else -1
        value = self._control.value(fold.state.load, fold.state.displacement)
        end = None
        for push in range(1, PUSHES + 1):
            row = fold.row + push * onward
            if not 0 <= row < len(self.traced.rows) or (push > 1 and self.unstable[min(row, row - onward)] == 0):
                break
            beyond = state_at(self.problem, self.traced.rows[row])
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                end = land(self.problem, beyond.u, beyond.load, self._hold(value), self.settings.tolerance)
            if not end.converged:
                continue
            nearest = min(candidates, key=partial(self._apart, end), default=None)
            if nearest is not None and self._apart(end, nearest) <= SAME:
                return nearest
            if self._apart(end, fold) > LEFT:
                break
        if end is not None and end.converged and self._apart(end, fold) <= LEFT:
            end = self._forced(fold, end, value, -onward)
            nearest = min(candidates, key=partial(self._apart, end), default=None)
            if nearest is not None and self._apart(end, nearest) <= SAME:
                return nearest
        if end is not None and end.converged:
            self.astray.append((fold, _state(read(self.setup, end), 0, 0)))
            return None
        if not candidates:
            return None
        following, certain = next_along(self, fold, candidates)
        if not certain:
            self.notes.append((fold, following))
        return following

    def _forced(self, fold: Stop, state: Equilibrium, value: float, stable: int) -> Equilibrium:
        """Relax once more with the control beyond the fold by the lattice's error: what still holds it is smaller.

        The stable part, from which the fold is reached, lies in the direction `stable` of the rows.
        """
        assert fold.row is not None
        error = fold.state.error
        uncertain = self._control.value(error.get("load", 0.0), error.get("displacement", 0.0))
        if not math.isfinite(uncertain):
            return state
        reached = self.values[min(max(fold.row + FAR * stable, 0), len(self.values) - 1)]
        beyond = value + math.copysign(uncertain, value - float(reached))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return land(self.problem, state.u, state.load, self._hold(beyond), self.settings.tolerance)

    def _apart(self, state: Equilibrium, stop: Stop) -> float:
        """Largest difference between two states' gaps, relative to the law's range."""
        return float(np.abs(stop.place.u - state.u).max()) / self.setup.length

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another, by quadrature of parabolas through states on it."""
        if _position(begin) > _position(end):
            return -self.work(end, begin)
        start = begin.row if begin.row is not None else begin.piece
        stop = end.row if end.row is not None else end.piece + 1
        inner = [state_at(self.problem, row) for row in self.traced.rows[start + 1 : stop]]
        states = [begin.place, *inner, end.place]
        return math.fsum(self._piece(first, second, 0) for first, second in pairwise(states))

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
        ends = [
            (self._potential(jump.begin), None if jump.end is None else self._potential(jump.end)) for jump in jumps
        ]
        known = [value for pair in ends for value in pair if value is not None and math.isfinite(value)]
        most = max(known, default=math.inf)
        return [
            replace(
                jump,
                begin=replace(jump.begin, uncertainty=min(begin, most)),
                end=None if jump.end is None or end is None else replace(jump.end, uncertainty=min(end, most)),
            )
            for jump, (begin, end) in zip(jumps, ends, strict=True)
        ]

    def _potential(self, stop: Stop) -> float:
        """Error estimate of a state's energy, from the coarse lattice in the plane across the curve; else infinite."""
        if self.setup.grid % 4:
            return math.inf
        if stop.piece < 0:
            value = self._control.value(stop.state.load, stop.state.displacement)
            coarse = self.setup.on(self.setup.grid // 2).problem
            found = held(self.setup, stop.place, control_held(coarse, self._control, value), self.settings)
            # out there, where rounding may be all that is left, energies are no larger than their errors
            return abs(stop.state.energy) if found is None else found.potential
        row = stop.piece if stop.row is None else stop.row
        potentials = []
        for other in (row - 1, row + 1):
            if 0 <= other < len(self.traced.rows):
                before = state_at(self.problem, self.traced.rows[other])
                found = compared(self.setup, before, stop.place, self.settings)
                if found is not None:
                    potentials.append(found.potential)
        # Where one plane meets another part of the coarse lattice's curve, the other one need not.
        return min(potentials, default=math.inf)

    def _hold(self, value: float) -> Hold:
        return control_held(self.setup.problem, self._control, value)

    def _stop(self, state: Equilibrium, piece: int) -> Stop:
        load, displacement = (int(kind[max(piece, 0)]) for kind in self._pieces)
        return Stop(piece, _state(read(self.setup, state), load, displacement), state)

    @cached_property
    def _pieces(self) -> tuple[Integers, Integers]:
        indices = self.traced.indices
        return indices.pieces("load")[0], indices.pieces("displacement")[0]


def _state(reading: Reading, unstable_load: int, unstable_displacement: int) -> State:
    return State(*reading.four, reading.energy, unstable_load, unstable_displacement, 0.0)


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
