"""A curve with free boundaries as a quasi-static path needs it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.curve.quasi_static import Stop, next_along
from contbranch.errors import ModelError
from contbranch.results.diagram import State

from .accuracy import Values, locate, refine, ring_problem
from .legs import AdaptingProblem, Reached, oriented, solved
from .solve import energy_at, indices_on, located_between, state_of
from .trace import Traced
from .work import points_between, work_along

__all__ = ["RingWalk", "values_of"]

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

# Rounds of meshing and solving for a state before the first row.
ROUNDS = 6


def values_of(traced: Traced, control: Control) -> Array:
    """What is controlled at every row, (M,)."""
    curve = traced.curve
    if control.kind == "spring":
        return curve.displacement + curve.load / control.stiffness
    return curve.load if control.kind == "load" else curve.displacement


class RingWalk:
    """A traced curve under one control (an `analysis.hysteresis.Walk`), reduced units.

    Parameters
    ----------
    traced : Traced
        With its events, and with the control if that is a spring.
    control : Control
    accuracy : float
        Error allowed to the states between which the path jumps, relative to max(1, |value|).
    first : int
        The first row that belongs to this model.

    Attributes
    ----------
    notes : list of (Stop, Stop)
        Folds, and states after them, between which the relaxation was not followed and energies do not decide.
    """

    follows = False

    def __init__(self, traced: Traced, control: Control, accuracy: float, first: int = 0) -> None:
        self.traced, self._control, self.accuracy, self.first = traced, control, accuracy, first
        self.notes: list[tuple[Stop, Stop]] = []
        self._between: dict[tuple[int, int, int], list[State]] = {}

    @property
    def control(self) -> Control:
        """The control."""
        return self._control

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows."""
        return values_of(self.traced, self._control)

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
        for event in self.traced.curve.events:
            if event.kind == "fold" and event.control == self._control.kind and isinstance(event.point, Point):
                piece = min(event.row, len(self.unstable) - 1)
                found[event.row] = self._stop(Values(event.values, event.error), event.point, piece, event.row)
        return found

    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row, as far as they belong to this model."""
        return self._folds

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        curve = self.traced.curve
        return State(
            load=float(curve.load[row]),
            displacement=float(curve.displacement[row]),
            contact_radius=float(curve.contact_radius[row]),
            central_gap=float(curve.central_gap[row]),
            energy=float(curve.energy[row]),
            unstable_load=int(curve.unstable_load[row]),
            unstable_displacement=int(curve.unstable_displacement[row]),
            residual=0.0,
        )

    def stop(self, row: int) -> Stop:
        """A row as a stop."""
        return Stop(min(row, len(self.unstable) - 1), self.row(row), self.traced.points[row], row)

    def between(self, begin: Stop, end: Stop, count: int) -> list[State]:
        """States between two stops on one piece of the curve, without profiles; fewer next to a change."""
        first, last = (begin, end) if _position(begin) <= _position(end) else (end, begin)
        # The way back passes what the way there has passed.
        key = id(first.place), id(last.place), count
        if key not in self._between:
            self._between[key] = self._states(first.place, last.place, count)
        states = self._between[key]
        return list(states) if first is begin else states[::-1]

    @staticmethod
    def _states(begin: Point, end: Point, count: int) -> list[State]:
        try:
            points = points_between(begin, end, count)
        except CorrectionError:
            return []
        states = []
        for problem, x, d in points:
            load, displacement, radius, gap = problem.numbers(x, d)
            energy = problem.energy(problem.fields(x, d))
            states.append(State(load, displacement, radius, max(gap, 0.0), energy, 0, 0, 0.0))
        return states

    def crossing(self, piece: int, value: float) -> Stop:
        """The state on a piece at a value of the control.

        Raises
        ------
        ModelError
            If the curve cannot be followed there.
        """
        event = Reached(self._control, self._control.target(value))
        points, first = self.traced.points, max(piece, self.first)
        try:
            if piece < first or first + 1 == len(points):  # between both models' representations of one state
                values, point = refine(locate(points[first], event), event, self.accuracy)
            else:
                values, point = located_between(points[first], points[first + 1], event, self.accuracy)
        except CorrectionError as error:
            raise ModelError(
                f"no state was found on the curve where the {self._control.kind} is {value:.6g} {error.detail}"
            ) from error
        return self._stop(values, point, piece)

    def before(self, value: float) -> Stop | None:
        """The state farther away than the first row; None under load, and for laws that only repel and end.

        Raises
        ------
        ModelError
            If it was not found.
        """
        start = self.traced.points[0]
        problem = ring_problem(start)
        law = problem.setting.law
        # Without any pressure beyond the law's range nothing attracts, and nothing jumps out there.
        if self._control.kind == "load" or law.vanishes(law.outermost) or not isinstance(problem, AdaptingProblem):
            return None
        event = Reached(self._control, self._control.target(value))
        try:
            # Out there the tip feels next to nothing: its displacement and the position of a spring all but agree.
            x, d = solved(problem, 0.0 * start.x, value)
            for _ in range(ROUNDS):
                offer = problem.adapt(x, d)
                if offer is None:
                    break
                assert isinstance(offer.problem, AdaptingProblem)
                problem = offer.problem
                x, d = solved(problem, offer.x, d)
            values, point = refine(oriented(problem, x, d, (0.0 * x, 1.0)), event, self.accuracy)
        except CorrectionError as error:
            raise ModelError(f"no state was found before the curve's first row {error.detail}") from error
        return self._stop(values, point, -1)

    def _stop(self, values: Values, point: Point, piece: int, row: int | None = None) -> Stop:
        unstable = indices_on(self.traced.curve, self.traced.indices, max(piece, 0))
        return Stop(piece, state_of(values, point, unstable), point, row, energy_at(values, point)[1])

    def relaxed(self, fold: Stop, candidates: Sequence[Stop]) -> Stop | None:
        """Which of several stable states relaxation from a fold reaches: the next one along the curve.

        The relaxation itself is not followed; where the energies along the curve do not decide, `notes` says so.
        """
        end, certain = next_along(self, fold, candidates)
        if not certain:
            self.notes.append((fold, end))
        return end

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another.

        Raises
        ------
        ModelError
            If the curve cannot be followed between them.
        """
        if _position(begin) > _position(end):
            return -self.work(end, begin)
        start = begin.row if begin.row is not None else begin.piece
        stop = end.row if end.row is not None else end.piece + 1
        return self.along([begin.place, *self.traced.points[max(start + 1, self.first) : stop], end.place])

    def along(self, points: Sequence[Point]) -> float:
        """∫ F dd along consecutive points.

        Raises
        ------
        ModelError
            If the curve cannot be followed between them.
        """
        try:
            return work_along(points, 0.1 * self.accuracy)
        except CorrectionError as error:
            raise ModelError(f"work along the curve: the curve cannot be followed there. {error}") from error


def _position(stop: Stop) -> float:
    return float(stop.row if stop.row is not None else stop.piece + 0.5)
