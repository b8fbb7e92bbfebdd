"""From a quasi-static path in reduced units to the loop in the contact's own."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.control import Control
from contbranch.curve.curves import Route
from contbranch.curve.outcome import fold_names, state_in_units, unit_of_control
from contbranch.curve.paths import CurveWalk
from contbranch.curve.quasi_static import Jump as RawJump, Leg
from contbranch.results.diagram import Cost, ModelChoice, State
from contbranch.results.loop import Hysteresis, Jump, Path
from contbranch.results.record import OBSERVABLES, later
from contbranch.threads import one_thread
from contbranch.watch import kept

__all__ = ["loop"]

# So many points a leg where load, displacement or contact radius change.
POINTS_PER_LEG = 40


def loop(contact: Contact, route: Route, control: Control, choice: ModelChoice, cost: Cost) -> Hysteresis:
    """The loop of a path.

    Parameters
    ----------
    control : Control
        In the contact's units.
    """
    named = zip(route.curve.events, fold_names(contact, route.curve.events), strict=True)
    names: dict[int | None, str | None] = {
        event.row: name for event, name in named if (event.kind, event.control) == ("fold", control.kind)
    }
    jumps = tuple(_jump(contact, route.walk, jump, names.get(jump.begin.row)) for jump in route.jumps)
    endless = next((jump for jump in jumps if jump.to is None), None)
    # What holds the tip by more than a load keeps it at a finite separation.
    complete = route.complete and (endless is None or control.kind == "load")
    closed = complete and bool(route.legs) and endless is None
    message, fold = route.message, (endless and endless.name) or "the fold"
    if endless and complete:
        message += (
            f" The loop does not close: at {fold} (load {endless.start.load:.6g}) the contact is lost to infinite "
            "separation, since no state of lower energy exists there under load control; what is dissipated has no "
            "bound."
        )
    elif endless:
        message += f" Where the jump from {fold} ends was not reached."
    elif complete and not route.legs:
        message = f"There is no stable state under {control.kind} control."
    elif closed and not jumps:
        message = f"No jumps: the path is reversible under {control.kind} control."
    return Hysteresis(
        path=_path(contact, route, control),
        jumps=jumps,
        dissipated=math.fsum(jump.dissipated or 0.0 for jump in jumps) if closed else None,
        error=math.fsum(jump.error or 0.0 for jump in jumps) if closed else None,
        closed=closed,
        model=choice,
        cost=cost,
        control=control.kind,
        stiffness=control.spring_stiffness,
        status="complete" if complete else "incomplete",
        message=message.strip(),
        contact=contact,
        area=later(one_thread(lambda: _area(route) * contact.scales.energy)) if closed else None,
    )


def _jump(contact: Contact, walk: CurveWalk, jump: RawJump, name: str | None) -> Jump:
    control, begin, end = walk.control, jump.begin, jump.end
    first, unit = begin.state, contact.scales.energy
    value = control.of(first)
    position, start = value * unit_of_control(contact.scales, control.kind), state_in_units(contact, first)
    others = tuple(state_in_units(contact, stop.state) for stop in jump.others)
    if end is None:
        return Jump(name, position, start, None, None, None, others)
    last = end.state
    # The energy of contact and drive is stationary at both states, but for the value of the control at the fold: it
    # changes with that by the difference of what is conjugate to the control.
    conjugate = "displacement" if control.kind == "load" else "load"
    moved = abs(getattr(first, conjugate) - getattr(last, conjugate)) * control.value(
        first.error["load"], first.error["displacement"]
    )
    rounding = 1e-15 * max(1.0, abs(first.energy), abs(last.energy))
    return Jump(
        name,
        position,
        start,
        state_in_units(contact, last),
        (control.height(value, first) - control.height(value, last)) * unit,
        (begin.uncertainty + end.uncertainty + moved + rounding) * unit,
        others,
        later(one_thread(lambda: (_driven(control, first, last) - walk.work(begin, end)) * unit)),
    )


def _driven(control: Control, begin: State, end: State) -> float:
    """Work of the drive on the tip in a jump, at the value of the control that both states have but for rounding."""
    value = control.of(begin)
    before, after = (control.potential(value, state.load, state.displacement) for state in (begin, end))
    return before - after


def _area(route: Route) -> float:
    """Work of the drive on the tip around the loop: ∫ F dd along the legs, and during the jumps."""
    along = [route.walk.work(leg.begin, leg.end) for leg in route.legs]
    ends = [(jump.begin.state, jump.end.state) for jump in route.jumps if jump.end is not None]
    return math.fsum([*along, *(_driven(route.walk.control, *states) for states in ends)])


def _leg(route: Route, leg: Leg) -> list[State]:
    """The states of a leg, close enough to one another that straight lines between them show the curve."""
    states = [leg.begin.state]
    table = np.array([[stop.state.load, stop.state.displacement, stop.state.contact_radius] for stop in leg.stops])
    extent = np.ptp(table, axis=0)
    changes = np.abs(np.diff(table, axis=0)) / np.where(extent > 0.0, extent, 1.0)
    for begin, end, change in zip(leg.stops[:-1], leg.stops[1:], changes, strict=True):
        count = math.ceil(float(change.max()) * POINTS_PER_LEG) - 1
        if count > 0 and begin.piece != -1 and end.piece != -1:
            states += kept(partial(route.walk.between, begin, end, count), [])
        states.append(end.state)
    return states


def _path(contact: Contact, route: Route, control: Control) -> Path:
    units = contact.scales.of_fields
    legs = [_leg(route, leg) for leg in route.legs]
    if legs and route.legs[-1].begin.piece < 0:  # farther away than the curve begins: the loop closes there
        legs[0].insert(0, route.legs[-1].begin.state)
    states, lengths = [state for own in legs for state in own], [len(own) for own in legs]
    columns: dict[str, Any] = {
        name: np.array([getattr(state, name) for state in states]) * units[name] for name in (*OBSERVABLES, "energy")
    }
    pairs = zip(columns["load"], columns["displacement"], strict=True)
    return Path(
        **columns,
        position=np.array([control.value(*pair) for pair in pairs]),
        direction=np.repeat(np.array([leg.direction for leg in route.legs], dtype=np.int64), lengths),
        leg=np.repeat(np.arange(len(legs), dtype=np.int64), lengths),
    )
