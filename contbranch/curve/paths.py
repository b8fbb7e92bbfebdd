"""A followed curve as a quasi-static path needs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.continuation import CorrectionError, Point
from contbranch.control import LOAD, Control
from contbranch.curve.outcome import RawEvent
from contbranch.curve.problem import AstrayError, equilibrium, rates_of, values_of
from contbranch.curve.quasi_static import Stop, next_along
from contbranch.curve.solve import Crossing, before, crossing, energy_at, seen, state_on
from contbranch.curve.tolerances import QUADRATURE_SHARE
from contbranch.curve.track import Track, linked
from contbranch.curve.work import Piece, work_along
from contbranch.results.diagram import State

__all__ = ["CurveWalk"]


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
    assumed : list of (Stop, Stop)
        Folds, and states after them, between which the relaxation was not followed and energies do not decide.
    off_curve : list of (Stop, State)
        Folds from which the relaxation ends in a state that is not on the curve, and that state.
    """

    track: Track = field(default_factory=Track)
    events: Sequence[RawEvent] = ()
    control: Control = LOAD
    accuracy: float = 0.0
    assumed: list[tuple[Stop, Stop]] = field(default_factory=list)
    off_curve: list[tuple[Stop, State]] = field(default_factory=list)
    _crossings: dict[tuple[int, float], Stop] = field(default_factory=dict, init=False, repr=False)
    _between: dict[tuple[int, int, int], list[State]] = field(default_factory=dict, init=False, repr=False)

    @property
    def relaxes_off_curve(self) -> bool:
        """Whether stable states need not lie on the curve: relaxations are then always followed."""
        return not self.track.problem(0).refinable

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows, at folds as they were located: there rows may be short of it. (On lattices a
        fold is that of an average, which no row need reach.)"""
        values = self.track.controlled(self.control)
        if not self.relaxes_off_curve:
            values[[*self.folds]] = [self.control.of(fold.state) for fold in self.folds.values()]
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
    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row."""
        own = (event for event in self.events if event.kind == "fold" and event.control == self.control.kind)
        return {e.row: self._stop(Crossing(self._piece(e.row), e), e.row) for e in own}

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        return seen(self.track.points[row])

    def stop(self, row: int) -> Stop:
        """A row as a stop: the fold, as it was located, where there is one."""
        return self.folds.get(row) or self._at_row(row)

    def _at_row(self, row: int) -> Stop:
        return Stop(self._piece(row), self.row(row), self.track.points[row], row)

    def _piece(self, row: int) -> int:
        return min(row, len(self.track.points) - 2)

    def _stop(self, crossing: Crossing, row: int | None = None) -> Stop:
        found = crossing.found
        return Stop(crossing.piece, state_on(self.track, crossing), found.point, row, energy_at(found)[1])

    def crossing(self, piece: int, value: float, value_error: float = 0.0) -> Stop:
        """The state on a piece at a value of the control.

        Parameters
        ----------
        value_error : float
            Error of ``w·(F, d)`` at that value, see `Control.weighted`, which adds to the errors of the state.

        Raises
        ------
        ModelError
            If it was not found.
        """
        key = piece, value
        if key not in self._crossings:
            found = crossing(self.track, piece, self.control, value, self.accuracy).found
            rates = rates_of(found.point)
            pace = abs(self.control.weighted(rates.load, rates.displacement)) or math.inf
            error = np.add(found.error, np.abs(rates) * (value_error / pace))
            self._crossings[key] = self._stop(Crossing(piece, replace(found, error=tuple(error.tolist()))))
        return self._crossings[key]

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
        if begin.position > end.position:  # the way back passes what the way there has passed
            return self.between(end, begin, count)[::-1]
        key = id(begin.place), id(end.place), count
        if key not in self._between:
            states = self._between[key] = []
            with suppress(CorrectionError):
                for piece in self._parts(begin, end) if equilibrium(begin.place).states_between else ():
                    if isinstance(piece, Piece):
                        states += (seen(piece.point((k + 1) / (count + 1))) for k in range(count))
        return self._between[key]

    def _parts(self, begin: Stop, end: Stop) -> list[Piece | Point]:
        """The curve between two stops on one piece: that, or where no problem joins them its ends.

        Raises
        ------
        CorrectionError
            If neither end is found on the other's discretisation.
        """
        onward = self.track.onward
        first = begin.place if begin.row is None else onward.get(begin.row, begin.place)
        problem, gap = equilibrium(first), math.floor(begin.position) in self.track.gaps
        if gap or problem.cornered or not problem.joins(equilibrium(end.place)):
            return [first, end.place]
        return [Piece(*linked(first, end.place), (begin.row in onward, end.row in onward))]

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another; the change of energy where it is not found between rows."""
        if begin.position > end.position:
            return -self.work(end, begin)
        row = math.ceil(end.position)
        stops = [begin, *map(self._at_row, range(math.floor(begin.position) + 1, row)), end]
        if end.row in self.track.onward and not self.track.problem(row).joins(equilibrium(end.place)):
            stops.insert(-1, self._at_row(row))  # a fold on the far side of a touch
        problem = self.track.problem(0)
        # Equations without discretisation errors are integrated to rounding.
        share = 0.0 if problem.finer() is problem else QUADRATURE_SHARE * self.accuracy
        try:
            parts = [part for ends in pairwise(stops) for part in self._parts(*ends)]
            return work_along(begin.place, parts, end.place, max(share, 10.0 * problem.rounding))
        except CorrectionError:
            return values_of(end.place).energy - values_of(begin.place).energy

    def relaxed(self, fold: Stop, candidates: Sequence[Stop], direction: int) -> Stop | None:
        """Which of several stable states overdamped relaxation from a fold reaches.

        It is followed among states of the fold's own kind where the model can. Otherwise, or where it comes to rest at
        none of them, it is the next one along the curve, and `assumed` says so unless the energies along the curve
        decide.
        """
        problem = equilibrium(fold.place)
        alike = [stop for stop in candidates if problem.relaxes_to(equilibrium(stop.place))]
        if alike or self.relaxes_off_curve:
            places = [stop.place for stop in alike]
            try:
                reached = problem.relaxed(fold.place, self.control, direction, places)
            except AstrayError as astray:
                self.off_curve.append((fold, astray.state))
                return None
            if reached is not None:
                return alike[reached]
        if not candidates:
            return None
        end, certain = next_along(self, fold, candidates)
        if not certain:
            self.assumed.append((fold, end))
        return end
