"""From a quasi-static path in reduced units to the loop in the contact's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.control import Control
from contbranch.curve.curves import Route
from contbranch.curve.outcome import fold_names, state_in_units
from contbranch.curve.quasi_static import Jump as RawJump, Leg, Stop
from contbranch.results.diagram import Cost, ModelChoice, State
from contbranch.results.loop import Hysteresis, Jump, Path
from contbranch.results.record import OBSERVABLES, later
from contbranch.threads import one_thread
from contbranch.watch import kept

__all__ = ["loop"]

# So many points a leg where load, displacement or contact radius change, and between two points of the curve.
PATH_POINTS, MOST_BETWEEN = 40, 15


def loop(contact: Contact, route: Route, control: Control, choice: ModelChoice, cost: Cost) -> Hysteresis:
    """The loop of a path.

    Parameters
    ----------
    control : Control
        In the contact's units.
    """
    return _Loop(contact, route, control).result(choice, cost)


class _Loop:
    """A path and what turns it into the contact's units."""

    def __init__(self, contact: Contact, route: Route, control: Control) -> None:
        self.contact, self.route, self.control = contact, route, control
        self.walk, self.held = route.walk, route.walk.control
        names = fold_names(contact, route.curve.events)
        own = zip(route.curve.events, names, strict=True)
        self.names = {e.row: name for e, name in own if e.kind == "fold" and e.control == control.kind}

    def result(self, choice: ModelChoice, cost: Cost) -> Hysteresis:
        """The loop."""
        legs, jumps = self.route.legs, tuple(self._jump(jump) for jump in self.route.jumps)
        lost = [jump for jump in jumps if jump.to is None]
        # What holds the tip by more than a load keeps it at a finite separation.
        complete = self.route.complete and (not lost or self.control.kind == "load")
        closed = complete and bool(legs) and not lost
        return Hysteresis(
            path=self._path(),
            jumps=jumps,
            dissipated=math.fsum(jump.dissipated or 0.0 for jump in jumps) if closed else None,
            error=math.fsum(jump.error or 0.0 for jump in jumps) if closed else None,
            closed=closed,
            model=choice,
            cost=cost,
            control=self.control.kind,
            stiffness=self.control.spring_stiffness,
            status="complete" if complete else "incomplete",
            message=self._message(jumps, lost, complete, closed),
            contact=self.contact,
            area=later(self._work) if closed else None,
        )

    def _message(self, jumps: Sequence[Jump], lost: Sequence[Jump], complete: bool, closed: bool) -> str:
        message = self.route.message
        if lost and complete:
            what = f"at {lost[0].name}" if lost[0].name else "at the fold"
            return (
                f"{message} The loop does not close: {what} (load {lost[0].start.load:.6g}) the contact is lost to "
                "infinite separation, since no state of lower energy exists there under load control; "
                "what is dissipated has no bound."
            ).strip()
        if lost:
            return f"{message} Where the jump from {lost[0].name or 'the fold'} ends was not reached.".strip()
        if complete and not self.route.legs:
            return f"There is no stable state under {self.control.kind} control."
        if closed and not jumps:
            return f"No jumps: the path is reversible under {self.control.kind} control."
        return message

    # -- jumps --------------------------------------------------------------------------------------------------------
    def _jump(self, jump: RawJump) -> Jump:
        begin, end, units = jump.begin, jump.end, self.contact.scales
        value = self.held.of(begin.state)
        position = value * (units.load if self.held.kind == "load" else units.normal)
        start, name = state_in_units(self.contact, begin.state), self.names.get(jump.row)
        others = tuple(state_in_units(self.contact, stop.state) for stop in jump.others)
        if end is None:
            return Jump(name, position, start, None, None, None, others)
        before, after = (self.held.height(value, state) for state in (begin.state, end.state))
        return Jump(
            name,
            position,
            start,
            state_in_units(self.contact, end.state),
            (before - after) * units.energy,
            self._uncertainty(begin, end) * units.energy,
            others,
            later(lambda: self._area(begin, end, value) * units.energy),
        )

    def _uncertainty(self, begin: Stop, end: Stop) -> float:
        """Error estimate of what a jump dissipates.

        The energy of contact and drive is stationary at both states, but for the value of the control at the fold: it
        changes with that by the difference of what is conjugate to the control.
        """
        control, first, last = self.held, begin.state, end.state
        error = first.error
        if control.kind == "load":
            moved = abs(first.displacement - last.displacement) * error.get("load", 0.0)
        else:
            position = error.get("displacement", 0.0)
            if control.kind == "spring":
                position += error.get("load", 0.0) / control.stiffness
            moved = abs(first.load - last.load) * position
        size = max(1.0, abs(first.energy), abs(last.energy))
        return begin.uncertainty + end.uncertainty + moved + 1e-15 * size

    # -- areas --------------------------------------------------------------------------------------------------------
    @one_thread
    def _area(self, begin: Stop, end: Stop, value: float) -> float:
        """∫ (F_drive − F) dd from the fold to the state after the jump, along the curve."""
        return self._driven(value, begin.state, end.state) - self.walk.work(begin, end)

    def _driven(self, value: float, begin: State, end: State) -> float:
        """Work of the drive on the tip at a fixed value of the control, which states have but for rounding."""
        before, after = (self.held.potential(value, state.load, state.displacement) for state in (begin, end))
        return before - after

    @one_thread
    def _work(self) -> float:
        """Work of the drive on the tip around the loop: ∫ F dd along the legs, and during the jumps."""
        ends = (self._stops(leg) for leg in self.route.legs)
        parts = [self.walk.work(stops[0], stops[-1]) for stops in ends if stops]
        for jump in self.route.jumps:
            if jump.end is not None:
                value = self.held.of(jump.begin.state)
                parts.append(self._driven(value, jump.begin.state, jump.end.state))
        return math.fsum(parts) * self.contact.scales.energy

    # -- the path -----------------------------------------------------------------------------------------------------
    def _stops(self, leg: Leg) -> list[Stop]:
        """The stops of a leg in its order."""
        begin, end = ([] if stop is None else [stop] for stop in (leg.begin, leg.end))
        return [*begin, *(self.walk.stop(row) for row in leg.rows), *end]

    def _leg(self, leg: Leg) -> list[State]:
        """The states of a leg, close enough to one another that straight lines between them show the curve."""
        stops = self._stops(leg)
        if not stops:
            return []
        table = np.array([[stop.state.load, stop.state.displacement, stop.state.contact_radius] for stop in stops])
        extent = np.ptp(table, axis=0)
        states = [stops[0].state]
        for begin, end, before, after in zip(stops[:-1], stops[1:], table[:-1], table[1:], strict=True):
            change = np.abs(after - before) / np.where(extent > 0.0, extent, 1.0)
            count = min(MOST_BETWEEN, math.ceil(float(change.max()) * PATH_POINTS) - 1)
            if count > 0 and begin.piece != -1 and end.piece != -1:
                states += kept(partial(self.walk.between, begin, end, count), [])
            states.append(end.state)
        return states

    def _path(self) -> Path:
        units = self.contact.scales.of_fields
        legs = [self._leg(leg) for leg in self.route.legs]
        landing = self.route.legs[-1].begin if legs else None
        if landing is not None and landing.piece < 0:  # farther away than the curve begins: the loop closes there
            legs[0].insert(0, landing.state)
        states = [state for own in legs for state in own]
        columns: dict[str, Any] = {
            name: np.array([getattr(state, name) for state in states]) * units[name]
            for name in (*OBSERVABLES, "energy")
        }
        pairs = zip(columns["load"], columns["displacement"], strict=True)
        lengths = [len(own) for own in legs]
        return Path(
            **columns,
            position=np.array([self.control.value(load, displacement) for load, displacement in pairs]),
            direction=np.repeat(np.array([leg.direction for leg in self.route.legs], dtype=np.int64), lengths),
            leg=np.repeat(np.arange(len(legs), dtype=np.int64), lengths),
        )
