"""A followed curve as a quasi-static path needs it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.curve.outcome import RawEvent
from contbranch.curve.problem import AstrayError, Values, equilibrium, rates_of, values_of
from contbranch.curve.quasi_static import Stop, next_along
from contbranch.curve.refine import Found
from contbranch.curve.solve import Crossing, before, crossing, energy_at, seen, state_on
from contbranch.curve.track import Track, linked
from contbranch.curve.work import Piece, work_along
from contbranch.results.diagram import State

__all__ = ["CurveWalk"]

# Quadrature error allowed on a piece, as a share of the accuracy, or in units of rounding.
SHARE, ROUNDINGS = 0.1, 10.0
# ... and where the discretisation was given; it then may be too large for states between rows.
GIVEN, LARGE = 1e-5, 128**2


@dataclass(frozen=True)
class CurveWalk:
    """A followed curve under one control, as a path needs it, reduced units. Rows are points; pieces lie between them.

    Attributes
    ----------
    track : Track
        Followed with the control if that is a spring.
    events : sequence of RawEvent
        The curve's, made precise.
    control : Control
    accuracy : float
        Error allowed to the states between which the path jumps, relative to max(1, |value|).
    notes : list of (Stop, Stop)
        Folds, and states after them, between which the relaxation was not followed and energies do not decide.
    astray : list of (Stop, State)
        Folds from which the relaxation ends in a state that is not on the curve, and that state.
    landings : dict
        Which of several states relaxations have reached, by the numbers of them all: on the same curve, too, where that
        was not followed as far.
    """

    track: Track
    events: Sequence[RawEvent]
    control: Control
    accuracy: float
    notes: list[tuple[Stop, Stop]] = field(default_factory=list)
    astray: list[tuple[Stop, State]] = field(default_factory=list)
    landings: dict[Hashable, int | None] = field(default_factory=dict, repr=False)
    _crossings: dict[tuple[int, float], Stop] = field(default_factory=dict, init=False, repr=False)
    _between: dict[tuple[int, int, int], list[State]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def empty(cls, control: Control) -> CurveWalk:
        """Of a curve that is not known."""
        return cls(Track((), {}, frozenset(), ()), (), control, 0.0)

    @property
    def follows(self) -> bool:
        """Where the discretisation was given, curves need not hold all states: relaxations are always followed."""
        return self.track.problem(0).given

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows, at folds as they were located: there rows may be short of it. (On lattices a
        fold is that of an average, which no row need reach.)"""
        values = self.track.controlled(self.control)
        for event in self._bends if not self.follows else ():
            values[event.row] = self.control.value(*event.values[:2])
        return values

    @cached_property
    def unstable(self) -> Integers:
        """Morse index under the control on the pieces; where it rests while the curve goes on, it holds nothing.

        Folds of several controls may be one state: between their rows the curve does not go on.
        """
        index = self.track.hodograph.pieces(self.control)[0]
        columns = [self.track.column(name) for name in ("load", "displacement", "contact_radius", "central_gap")]
        goes_on = np.any(np.diff(columns) != 0.0, axis=0)
        return np.where((np.diff(self.values) == 0.0) & goes_on, np.maximum(index, 1), index)

    @cached_property
    def rising(self) -> Integers:
        """Signs of the change of what is controlled on the pieces."""
        return self.track.hodograph.pieces(self.control)[1]

    @cached_property
    def _folds(self) -> dict[int, Stop]:
        return {
            e.row: self._stop(Crossing(self._piece(e.row), Found(e.values, e.error, e.place)), e.row)
            for e in self._bends
        }

    @property
    def _bends(self) -> list[RawEvent]:
        """The folds of the control."""
        return [event for event in self.events if event.kind == "fold" and event.control == self.control.kind]

    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row."""
        return self._folds

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        own = self.track.points[row].observables
        load, displacement, radius, gap, energy = (own[name] for name in Values._fields)
        return State(load, displacement, radius, max(gap, 0.0), energy, 0, 0, 0.0)

    def stop(self, row: int) -> Stop:
        """A row as a stop."""
        return Stop(self._piece(row), self.row(row), self.track.points[row], row)

    def _piece(self, row: int) -> int:
        return min(row, len(self.unstable) - 1)

    def _stop(self, crossing: Crossing, row: int | None = None) -> Stop:
        found = crossing.found
        return Stop(crossing.piece, state_on(self.track, crossing), found.point, row, energy_at(found)[1])

    def crossing(self, piece: int, value: float) -> Stop:
        """The state on a piece at a value of the control.

        Raises
        ------
        ModelError
            If it was not found.
        """
        key = piece, value
        if key not in self._crossings:
            there = crossing(self.track, piece, self.control, value, self.accuracy)
            self._crossings[key] = self._stop(replace(there, found=self._uncertain(there.found, value)))
        return self._crossings[key]

    def _uncertain(self, found: Found, value: float) -> Found:
        """A state at the value of a fold, with what that value's own error adds to its error estimates."""
        errors = [fold.state.error for fold in self._folds.values() if self.control.of(fold.state) == value]
        missed = max((self.control.weighted(error["load"], error["displacement"]) for error in errors), default=0.0)
        point = found.point
        moves = rates_of(point)
        pace = abs(self.control.weighted(moves.load, moves.displacement))
        if not missed or not pace:
            return found
        load, displacement, radius, gap = (
            error + abs(move) * missed / pace for error, move in zip(found.error, moves, strict=True)
        )
        return replace(found, error=(load, displacement, radius, gap))

    def before(self, value: float) -> Stop | None:
        """The state farther away than the first row; None under load, which holds nothing out there.

        Raises
        ------
        ModelError
            If it was not found.
        """
        found = None if self.control.kind == "load" else before(self.track, self.control, value, self.accuracy)
        return None if found is None else self._stop(found)

    def between(self, begin: Stop, end: Stop, count: int) -> list[State]:
        """States between two stops on one piece of the curve, without profiles; fewer where it cannot be followed."""
        first, last = (begin, end) if _position(begin) <= _position(end) else (end, begin)
        # The way back passes what the way there has passed.
        key = id(first.place), id(last.place), count
        if key not in self._between:
            self._between[key] = [seen(point) for point in self._points(first, last, count)]
        states = self._between[key]
        return list(states) if first is begin else states[::-1]

    def _points(self, begin: Stop, end: Stop, count: int) -> list[Point]:
        points: list[Point] = []
        problem = equilibrium(begin.place)
        if problem.given and problem.size > LARGE:
            return points
        try:
            piece = self._joined(begin, end)
            if isinstance(piece, Piece):
                for k in range(count):
                    points.append(piece.point((k + 1) / (count + 1)))
        except CorrectionError:
            return points
        return points

    def _joined(self, begin: Stop, end: Stop) -> Piece | tuple[Point, Point]:
        """The curve between two stops on one piece."""
        onward = self.track.onward
        first = begin.place if begin.row is None else onward.get(begin.row, begin.place)
        piece = begin.piece if begin.row is None else begin.row
        problem = equilibrium(first)
        if piece in self.track.gaps or problem.cornered or not problem.joins(equilibrium(end.place)):
            return first, end.place
        return Piece(*linked(first, end.place), (begin.row in onward, end.row in onward))

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another; the change of energy where it is not found between rows."""
        if _position(begin) > _position(end):
            return -self.work(end, begin)
        first = (begin.piece if begin.row is None else begin.row) + 1
        rows = range(first, end.piece + 1 if end.row is None else end.row)
        stops = [begin, *(self.stop(row) for row in rows), end]
        row = end.row
        if row is not None and row in self.track.onward and not self.track.problem(row).joins(equilibrium(end.place)):
            stops.insert(-1, self.stop(row))  # a fold on the far side of a touch
        try:
            pieces = [self._joined(*ends) for ends in pairwise(stops)]
            return work_along(begin.place, pieces, end.place, self._allowed)
        except CorrectionError:
            there, here = (values_of(point) for point in (end.place, begin.place))
            return there.energy - here.energy

    @cached_property
    def _allowed(self) -> float:
        """Quadrature error allowed on a piece; equations without errors of their own are integrated as exactly."""
        problem = self.track.problem(0)
        if problem.given:
            return GIVEN
        return SHARE * self.accuracy if problem.finer() is not problem else ROUNDINGS * problem.rounding

    def relaxed(self, fold: Stop, candidates: Sequence[Stop]) -> Stop | None:
        """Which of several stable states overdamped relaxation from a fold reaches.

        It is followed among states of the fold's own kind where the model can. Otherwise, or where it comes to rest at
        none of them, it is the next one along the curve, and `notes` says so unless the energies along the curve
        decide.
        """
        problem = equilibrium(fold.place)
        alike = [stop for stop in candidates if problem.relaxes_to(equilibrium(stop.place))]
        if (alike or self.follows) and fold.row is not None:
            # From the tangents: far away the values of neighbouring rows differ by less than their errors.
            direction = 1 if self.rising[max(fold.row - 1, 0)] > 0 else -1
            guarded = not all(problem.relaxes_to(equilibrium(point)) for point in self.track.points)
            places = [stop.place for stop in alike]
            numbers = (guarded, *(values_of(place) for place in (fold.place, *places)))
            try:
                if numbers not in self.landings:
                    self.landings[numbers] = problem.relaxed(fold.place, self.control, direction, places, guarded)
                reached = self.landings[numbers]
            except AstrayError as astray:
                self.astray.append((fold, astray.state))
                return None
            if reached is not None:
                return alike[reached]
        if not candidates:
            return None
        end, certain = next_along(self, fold, candidates)
        if not certain:
            self.notes.append((fold, end))
        return end


def _position(stop: Stop) -> float:
    """Order along the curve."""
    return float(stop.row if stop.row is not None else stop.piece + 0.5)
