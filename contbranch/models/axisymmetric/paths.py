"""The traced curve of an axisymmetric contact as a quasi-static path needs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.curve.quasi_static import Stop, next_along
from contbranch.errors import ModelError
from contbranch.models.rings.paths import RingWalk
from contbranch.models.rings.trace import Traced as RingTraced
from contbranch.results.diagram import State

from .arc import points_between, work_along
from .crossing import Crossing, control_values, cross, cross_before, energy_at, state_at
from .locate import Place, Values
from .problem import ContactProblem
from .relaxation import relax
from .trace import Traced

__all__ = ["TracedWalk"]

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

# The fold may lie a little aside on the meshes of the relaxation: where that has not left it, it is pushed harder.
PUSHES = (1.0, 10.0, 100.0)
# It has arrived at a state that is so close in u.
ARRIVED = 0.1


class TracedWalk:
    """A traced curve under one control (an `analysis.hysteresis.Walk`), reduced units.

    Parameters
    ----------
    traced : Traced
        With its events, and with the control if that is a spring.
    control : Control
    accuracy : float
        Error allowed to the states between which the path jumps, relative to max(1, |value|).

    Attributes
    ----------
    notes : list of (Stop, Stop)
        Folds, and states after them, between which the relaxation was not followed and energies do not decide.
    beyond : RingWalk or None
        The same of the rows at which the contact set is no disc, see `Traced.handed`.
    """

    follows = False

    def __init__(self, traced: Traced, control: Control, accuracy: float) -> None:
        self.traced, self._control, self.accuracy = traced, control, accuracy
        self.notes: list[tuple[Stop, Stop]] = []
        self.beyond: RingWalk | None = None
        if traced.handed is not None:
            rings = RingTraced(traced.points, traced.curve, traced.indices)
            self.beyond = RingWalk(rings, control, accuracy, traced.handed + 1)

    @property
    def control(self) -> Control:
        """The control."""
        return self._control

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows."""
        return control_values(self.traced, self._control)

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
            if event.kind == "fold" and event.control == self._control.kind and event.place is not None:
                values = Values(*event.values, event.error)
                crossing = Crossing(min(event.row, len(self.unstable) - 1), values, event.place)
                found[event.row] = self._stop(crossing, crossing.piece, event.row)
        if self.beyond is not None:
            found |= self.beyond.folds()
        return found

    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row."""
        return self._folds

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        curve = self.traced.curve
        return State(
            float(curve.load[row]),
            float(curve.displacement[row]),
            float(curve.contact_radius[row]),
            float(curve.central_gap[row]),
            float(curve.energy[row]),
            int(curve.unstable_load[row]),
            int(curve.unstable_displacement[row]),
            0.0,
        )

    def stop(self, row: int) -> Stop:
        """A row as a stop."""
        if self.beyond is not None and row >= self.beyond.first:
            return self.beyond.stop(row)
        point = self.traced.points[row]
        place = Place(self.traced.problem(row), point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
        state, piece = self.row(row), min(row, len(self.unstable) - 1)
        values = Values(state.load, state.displacement, state.contact_radius, state.central_gap, (0.0,) * 4)
        return Stop(piece, state, Crossing(piece, values, place), row)

    def between(self, begin: Stop, end: Stop, count: int) -> list[State]:
        """States between two stops on one piece of the curve, without profiles."""
        discs = [isinstance(stop.place, Crossing) for stop in (begin, end)]
        if self.beyond is not None and not all(discs):  # between both models' representations of one state is nothing
            return [] if any(discs) else self.beyond.between(begin, end, count)
        first, last = (begin, end) if _position(begin) <= _position(end) else (end, begin)
        states = []
        for point in points_between(_point(first), _point(last), count):
            problem = point.problem
            assert isinstance(problem, ContactProblem)
            equations, fields = problem.equations, problem.fields(point.x, point.parameter)
            gap = 0.0 if equations.contact else max(0.0, -fields.y)
            values = equations.load(fields), equations.displacement(fields), fields.rim.radius, gap
            states.append(State(*values, equations.energy(fields), 0, 0, 0.0))
        return states if first is begin else states[::-1]

    def crossing(self, piece: int, value: float) -> Stop:
        """The state on a piece at a value of the control."""
        if self.beyond is not None and piece >= self.beyond.first - 1:
            return self.beyond.crossing(piece, value)
        return self._stop(cross(self.traced, piece, self._control, value, self.accuracy), piece)

    def before(self, value: float) -> Stop | None:
        """The state farther away than the first row."""
        if self._control.kind == "load":
            return None
        return self._stop(cross_before(self.traced, self._control, value, self.accuracy), -1)

    def _stop(self, crossing: Crossing, piece: int, row: int | None = None) -> Stop:
        return Stop(piece, state_at(self.traced, crossing), crossing, row, energy_at(crossing)[1])

    def relaxed(self, fold: Stop, candidates: Sequence[Stop]) -> Stop | None:
        """Which of several stable states overdamped relaxation from a fold reaches, by following the relaxation.

        That is possible with discs of contact alone. Where it does not come to rest at one of the states with
        a disc, it is the next one along the curve, and `notes` says so unless the energies along the curve decide.
        """
        discs = [stop for stop in candidates if isinstance(stop.place, Crossing)]
        if isinstance(fold.place, Crossing) and discs:
            try:
                return self._settled(fold, discs, self.beyond is not None)
            except ModelError:
                end, certain = next_along(self, fold, candidates)  # it leaves the discs, or cannot be followed
        else:
            end, certain = next_along(self, fold, candidates)
        if not certain:
            self.notes.append((fold, end))
        return end

    def _settled(self, fold: Stop, candidates: Sequence[Stop], guarded: bool) -> Stop:
        """The candidate at which the relaxation from a fold comes to rest."""
        assert fold.row is not None
        place: Place = fold.place.place
        problem = place.problem
        fields = problem.fields(place.x, place.u)
        # From the tangents: far away the values of neighbouring rows differ by less than their errors.
        direction = 1 if self.rising[max(fold.row - 1, 0)] > 0 else -1
        value = self._control.value(fold.state.load, fold.state.displacement)

        def apart(stop: Stop, y: float) -> float:
            other = problem.equations.coordinate.of(stop.state.contact_radius, stop.state.central_gap)
            return abs(math.asinh(other / problem.scale) - math.asinh(y / problem.scale))

        for push in PUSHES:
            state = problem.equations, fields.h, fields.y, problem.scale
            end = relax(*state, self._control, value, direction, push=push, guarded=guarded)
            if not end.settled:
                raise ModelError(
                    f"the relaxation from the fold at load {fold.state.load:.6g} did not come to rest: it stopped at "
                    f"load {end.load:.6g}, displacement {end.displacement:.6g}"
                )
            nearest = min(candidates, key=lambda stop: apart(stop, end.y))
            if apart(nearest, end.y) <= ARRIVED:
                return nearest
            if apart(fold, end.y) > ARRIVED:
                break  # it has left the fold
        raise ModelError(
            f"the relaxation from the fold at load {fold.state.load:.6g} came to rest at load {end.load:.6g}, "
            f"displacement {end.displacement:.6g}, where the traced curve has no stable state"
        )

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another.

        Raises
        ------
        ModelError
            If the curve cannot be followed between them.
        """
        if _position(begin) > _position(end):
            return -self.work(end, begin)
        inner = range(begin.piece + 1, (end.row if end.row is not None else end.piece + 1))
        if begin.row is not None:
            inner = range(begin.row + 1, inner.stop)
        points: list[Point] = []
        for stop in (begin, *(self.stop(row) for row in inner), end):
            points.append(_point(stop))
        discs = [point for point in points if isinstance(point.problem, ContactProblem)]
        others = points[len(discs) :]
        total = 0.0
        try:
            if len(discs) > 1:
                total += work_along(discs, 0.1 * self.accuracy)
        except CorrectionError as error:
            raise ModelError(f"work along the curve: the curve cannot be followed there. {error}") from error
        if others:
            assert self.beyond is not None
            total += self.beyond.along(others)
        if discs and others:  # one state in both models, whose displacements differ by their errors
            first, last = discs[-1].observables, others[0]
            total += first["load"] * (last.parameter - first["displacement"])
        return total


def _position(stop: Stop) -> tuple[float, float]:
    """Order along the curve, with the parameter deciding within a piece."""
    at = stop.row if stop.row is not None else stop.piece + 0.5
    return float(at), 0.0


def _point(stop: Stop) -> Point:
    if isinstance(stop.place, Point):
        return stop.place
    place: Place = stop.place.place
    equations, fields = place.problem.equations, place.problem.fields(place.x, place.u)
    observables = {"load": equations.load(fields), "displacement": equations.displacement(fields)}
    return Point(place.problem, place.x, place.u, place.direction[0], place.direction[1], observables=observables)
