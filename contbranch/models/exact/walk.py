"""The exact curve of Maugis-Dugdale attraction as a quasi-static path needs it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

from contbranch.control import Control
from contbranch.curve.quasi_static import Stop
from contbranch.models.exact.curve import ExactCurve
from contbranch.models.exact.outcome import exact_state, plain_state
from contbranch.models.exact.results import ExactState
from contbranch.results.diagram import State

__all__ = ["ExactWalk"]

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class ExactWalk:
    """The exact curve under one control (an `analysis.hysteresis.Walk`), reduced units.

    Parameters
    ----------
    curve : ExactCurve
    control : Control
    max_load : float or None
        Load at which the curve ends, in contact.
    """

    follows = False

    def __init__(self, curve: ExactCurve, control: Control, max_load: float | None) -> None:
        self.curve, self._control = curve, control
        stiffness = control.spring_stiffness
        found = curve.events if stiffness is None else curve.spring_events(stiffness)
        self._events = [event for event in found if event.control == control.kind]
        # far enough for what the contact jumps to when it is pulled off
        lost = [control.value(event.state.load, event.state.displacement) for event in self._events]
        lowest = min(lost, default=0.0) if control.kind != "load" else 0.0
        far = max(1.5, 1.1 * abs(lowest) / curve.interaction_range)
        self._states = curve.sample(160, max_load=max_load, far=far, stiffness=stiffness)

    @property
    def control(self) -> Control:
        """The control."""
        return self._control

    @property
    def loads(self) -> Array:
        """Loads of the rows."""
        return self._states.load

    @cached_property
    def values(self) -> Array:
        """What is controlled at the rows."""
        states = self._states
        if self._control.kind == "spring":
            return np.asarray(states.displacement + states.load / self._control.stiffness)
        return np.asarray(states.load if self._control.kind == "load" else states.displacement)

    @cached_property
    def unstable(self) -> Integers:
        """Morse index under the control on the pieces; beyond the range a load holds nothing."""
        states, control = self._states, self._control
        middle = (states.parameter[1:] + states.parameter[:-1]) / 2
        if control.kind == "spring":
            return np.asarray([int(self.curve.unstable_spring_at(s, control.stiffness)) for s in middle])
        judged = self.curve.states(middle)
        if control.kind == "displacement":
            return judged.unstable_displacement
        return np.where(middle < -1.0, 1, judged.unstable_load)

    @property
    def rising(self) -> Integers:
        """Signs of the change of what is controlled on the pieces."""
        return np.sign(np.diff(self.values)).astype(np.int64)

    @cached_property
    def _folds(self) -> dict[int, Stop]:
        found = {}
        for event in self._events:
            row = int(np.argmin(np.abs(self._states.parameter - event.state.parameter)))
            state = exact_state(self.curve, event.state, self._control.spring_stiffness)
            found[row] = Stop(min(row, len(self._states.parameter) - 2), state, event.state, row)
        return found

    def folds(self) -> dict[int, Stop]:
        """The folds of the control, by row."""
        return self._folds

    def names(self) -> dict[int, str | None]:
        """Names of those folds."""
        return {
            row: next(event.name for event in self._events if event.state is stop.place)
            for row, stop in self._folds.items()
        }

    def row(self, row: int) -> State:
        """The state of a row, without profile."""
        return plain_state(self._states.state(row))

    def stop(self, row: int) -> Stop:
        """A row as a stop."""
        return Stop(min(row, len(self._states.parameter) - 2), self.row(row), self._states.state(row), row)

    def between(self, begin: Stop, end: Stop, count: int) -> list[State]:
        """States between two stops, without profiles."""
        inner = np.linspace(begin.place.parameter, end.place.parameter, count + 2)[1:-1]
        states = self.curve.states(inner)
        return [plain_state(states.state(k)) for k in range(count)]

    def crossing(self, piece: int, value: float) -> Stop:
        """The state on a piece at a value of the control."""
        first, last = (float(self._states.parameter[k]) for k in (piece, piece + 1))

        def excess(s: float) -> float:
            state = self.curve.states(s).state(0)
            return self._control.value(state.load, state.displacement) - value

        at = first if excess(first) == 0.0 else last if excess(last) == 0.0 else None
        if at is None:
            at = brentq(excess, first, last, xtol=1e-15, rtol=4 * np.finfo(float).eps)
        state = self.curve.states(at).state(0)
        return Stop(piece, exact_state(self.curve, state, self._control.spring_stiffness), state)

    def before(self, value: float) -> Stop | None:
        """Nothing: the rows begin where nothing is left to come."""
        return None

    def relaxed(self, fold: Stop, candidates: Sequence[Stop]) -> Stop | None:
        """The only candidate there can be: of one stable part without contact and one with, the other one."""
        return candidates[0]

    def work(self, begin: Stop, end: Stop) -> float:
        """∫ F dd along the curve from one stop to another, by adaptive quadrature of the closed form's slopes."""
        first, last = begin.place, end.place
        assert isinstance(first, ExactState)
        assert isinstance(last, ExactState)
        if first.parameter > last.parameter:
            return -self.work(end, begin)

        def integrand(s: float) -> float:
            if s <= -1.0:
                return 0.0
            state = self.curve.states(s).state(0)
            expansion = self.curve.expansion(state, 1)
            moved = float(expansion.displacement[1])
            if s < 0.0:  # there the expansion is in the central gap, and c = (1 + s) c_touch
                c, b = state.interaction_radius, self.curve.touch_radius
                moved = (c - 4.0 / np.pi * self.curve.tabor) * b
            return state.load * moved

        breaks = [first.parameter, *(x for x in (-1.0, 0.0) if first.parameter < x < last.parameter), last.parameter]
        total = 0.0
        for a, b in pairwise(breaks):
            if b <= -1.0:
                continue
            total += quad(integrand, a, b, epsabs=1e-12, epsrel=1e-12, limit=200)[0]
        return total
