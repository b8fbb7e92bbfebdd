"""`hysteresis`: from a contact and a control to its quasi-static loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.units import positive_number
from contbranch.control import LOAD, Control, Spring
from contbranch.curve.outcome import RawCurve, assemble, state_in_units
from contbranch.curve.quasi_static import Jump as RawJump
from contbranch.curve.quasi_static import Leg, Stop, quasi_static
from contbranch.models.axisymmetric.paths import TracedWalk
from contbranch.models.axisymmetric.trace import Target
from contbranch.models.axisymmetric.trace import trace as trace_axisymmetric
from contbranch.models.choice import Model, choose
from contbranch.models.exact.model import Exact
from contbranch.models.exact.walk import ExactWalk
from contbranch.models.grid import FreeSpace, Periodic
from contbranch.models.grid.paths import GridWalk
from contbranch.models.grid.trace import trace as trace_grid
from contbranch.models.rings import Rings
from contbranch.models.rings.journey import Target as RingTarget
from contbranch.models.rings.paths import RingWalk
from contbranch.models.rings.trace import trace as trace_rings
from contbranch.models.run import check
from contbranch.results.diagram import Cost, Diagram, ModelChoice, State
from contbranch.results.loop import Hysteresis, Jump, Path
from contbranch.threads import one_thread

__all__ = ["hysteresis"]

Progress = Callable[[float, str], None]

# A trace is continued until what the path jumps to lies on it: beyond the fold's value by this share, and as often.
BEYOND, EXTENSIONS = 1e-3, 3
# On a lattice up to a load greater by this factor.
FURTHER = 1.5
# So many points a leg where load, displacement or contact radius change, and between two points of the trace.
PATH_POINTS, MOST_BETWEEN = 40, 15
COLUMNS = ("load", "displacement", "contact_radius", "central_gap", "energy")


@one_thread
def hysteresis(
    contact: Contact,
    control: str | Spring = "load",
    accuracy: float = 1e-6,
    max_load: float | None = None,
    model: str | Model = "auto",
    progress: Progress | None = None,
) -> Hysteresis:
    """Follow the quasi-static loop of a contact: the control is raised, then lowered, with a jump at every fold.

    After a jump the system is where overdamped relaxation from the fold ends. Where the contact set is no disc, the
    relaxation is not followed: the system is then in the next stable state along the curve that is lower than the fold,
    and the message says so unless the saddles along the curve are too high for any other. Energies are those of contact
    and drive: V − F d under load, V under displacement control, V + K (D − d)²/2 with a spring.

    Parameters
    ----------
    contact : Contact
    control : {"load", "displacement"} or Spring
    accuracy : float
        Error allowed to jumps and dissipated energies, relative to max(1, |value|) in reduced units.
    max_load : float, optional
        Load, in contact, at which the path turns round; default as in `trace`, and far enough for every jump.
    model, progress
        As in `trace`.

    Returns
    -------
    Hysteresis
        With `dissipated` None, and a message, where the loop does not close.

    Raises
    ------
    InputError
        If an argument cannot be used.
    ModelError
        If the relaxation after a jump cannot be followed.
    """
    began = time.perf_counter()
    driven = check(contact, control, accuracy)
    reduced = driven.scaled(contact.scales.stiffness)
    chosen, why = choose(contact, model)
    limit = None if max_load is None else positive_number(max_load, "max_load") / contact.scales.load
    walk: ExactWalk | TracedWalk | RingWalk | GridWalk
    if isinstance(chosen, Exact):
        walk = ExactWalk(chosen.curve(contact), reduced, limit)
        names: dict[int, str | None] = walk.names()
        unknowns, newton, complete, message = 1, 0, True, ""
        legs, jumps = quasi_static(walk)
    else:
        walk, legs, jumps = _traced_path(chosen, contact.to_reduced(), reduced, accuracy, limit, progress)
        raw = walk.traced.curve
        unknowns, newton, complete, message = raw.unknowns, raw.cost.newton, raw.complete, raw.message
        message = " ".join([raw.message, *(_landed(contact, *note) for note in walk.notes)]).strip()
        if isinstance(walk, GridWalk):
            jumps = walk.appraised(jumps)
            complete = complete and not walk.astray
            message = " ".join([message, *(_astray(contact, *found) for found in walk.astray)]).strip()
        names = _names(contact, raw, driven, accuracy)
    builder = _Builder(contact, walk, names, driven)
    cost = Cost(time.perf_counter() - began, newton)
    return builder.loop(legs, jumps, ModelChoice(chosen.name, why, unknowns), cost, complete, message)  # type: ignore[arg-type]


def _traced_path(
    model: Model, contact: Contact, control: Control, accuracy: float, limit: float | None, progress: Progress | None
) -> tuple[TracedWalk | RingWalk | GridWalk, list[Leg], list[RawJump]]:
    """Trace as far as the path needs, and the path."""
    if isinstance(model, Periodic | FreeSpace):
        return _grid_path(model, contact, control, accuracy, limit, progress)
    assert not isinstance(model, Exact)
    target: tuple[float | None, Control] = limit, LOAD
    for _ in range(EXTENSIONS):
        walk: TracedWalk | RingWalk
        if isinstance(model, Rings):
            walk = RingWalk(
                trace_rings(contact, accuracy, RingTarget(*target), progress, control=control), control, accuracy
            )
        else:
            traced = trace_axisymmetric(contact, accuracy, Target(*target), progress, control=control, fine=True)
            walk = TracedWalk(traced, control, accuracy)
        legs, jumps = quasi_static(walk) if len(walk.traced.points) > 1 else ([], [])
        lost = [jump for jump in jumps if jump.end is None and jump.direction > 0]
        if not (lost and walk.traced.curve.complete):
            break
        value = control.value(lost[0].begin.state.load, lost[0].begin.state.displacement)
        target = value + BEYOND * max(1.0, abs(value)), control
    return walk, legs, jumps


def _grid_path(
    model: Periodic | FreeSpace,
    contact: Contact,
    control: Control,
    accuracy: float,
    limit: float | None,
    progress: Progress | None,
) -> tuple[GridWalk, list[Leg], list[RawJump]]:
    """Trace on a lattice as far as the path needs, and the path."""
    setup = model.setup(contact, None, limit, accuracy)
    for _ in range(EXTENSIONS):
        traced = trace_grid(setup, accuracy, limit, control, progress)
        walk = GridWalk(traced, control, accuracy)
        legs, jumps = quasi_static(walk) if len(traced.rows) > 1 else ([], [])
        lost = any(jump.end is None and jump.direction > 0 for jump in jumps)
        if not lost or walk.astray or not traced.curve.complete:
            break
        limit = FURTHER * float(traced.curve.load[-1])
    return walk, legs, jumps


def _names(contact: Contact, curve: RawCurve, control: Control, accuracy: float) -> dict[int, str | None]:
    """Names of the folds by row, as a diagram has them."""
    named: Diagram = assemble(contact, curve, ModelChoice("axisymmetric", "", 0), control, accuracy)
    return {int(e.position): e.name for e in named.events if e.kind == "fold" and e.control == control.kind}


def _landed(contact: Contact, fold: Stop, end: Stop) -> str:
    """A sentence on a landing that was not followed, in the contact's units."""
    begin, after = state_in_units(contact, fold.state), state_in_units(contact, end.state)
    return (
        f"After the fold at load {begin.load:.6g} the path goes on at the next stable state along the curve (load "
        f"{after.load:.6g}, displacement {after.displacement:.6g}): the relaxation was not followed there, and "
        "energies along the curve do not exclude that it ends at another one, see `others` of the jump."
    )


def _astray(contact: Contact, fold: Stop, end: State) -> str:
    """A sentence on a relaxation that has left the curve, in the contact's units."""
    begin, after = state_in_units(contact, fold.state), state_in_units(contact, end)
    return (
        f"The relaxation from the fold at load {begin.load:.6g}, displacement {begin.displacement:.6g} ends in a state "
        f"that is not on the traced curve (load {after.load:.6g}, displacement {after.displacement:.6g})."
    )


class _Builder:
    """From legs and jumps in reduced units to the loop in the contact's own."""

    def __init__(
        self,
        contact: Contact,
        walk: ExactWalk | TracedWalk | RingWalk | GridWalk,
        names: dict[int, str | None],
        control: Control,
    ) -> None:
        self.contact, self.walk, self.names, self.control = contact, walk, names, control

    def loop(
        self,
        legs: Sequence[Leg],
        raw_jumps: Sequence[RawJump],
        choice: ModelChoice,
        cost: Cost,
        complete: bool,
        message: str,
    ) -> Hysteresis:
        """The loop."""
        jumps = tuple(self._jump(jump) for jump in raw_jumps)
        lost = [jump for jump in jumps if jump.to is None]
        closed = complete and bool(legs) and not lost
        total = math.fsum(jump.dissipated or 0.0 for jump in jumps) if closed else None
        error = math.fsum(jump.error or 0.0 for jump in jumps) if closed else None
        if lost and complete:
            message = f"{message} {self._open(lost[0])}".strip()
        elif lost:
            message = f"{message} Where the jump from {lost[0].name or 'the fold'} ends was not reached.".strip()
        elif complete and not legs:
            message = f"There is no stable state under {self.control.kind} control."
        elif closed and not jumps:
            message = f"No jumps: the path is reversible under {self.control.kind} control."
        return Hysteresis(
            path=self._path(legs),
            jumps=jumps,
            dissipated=total,
            error=error,
            closed=closed,
            model=choice,
            cost=cost,
            control=self.control.kind,
            stiffness=self.control.spring_stiffness,
            status="complete" if complete else "incomplete",
            message=message,
            contact=self.contact,
            _area=(lambda: self._work(legs, raw_jumps)) if closed else None,
        )

    def _open(self, jump: Jump) -> str:
        what = f"at {jump.name}" if jump.name else "at the fold"
        where = f"(load {jump.start.load:.6g})"
        return (
            f"The loop does not close: {what} {where} the contact is lost to infinite separation, since no state of "
            f"lower energy exists there under {self.control.kind} control; what is dissipated has no bound."
        )

    def _jump(self, jump: RawJump) -> Jump:
        control, begin, end = self.walk.control, jump.begin.state, jump.end.state if jump.end else None
        value = control.value(begin.load, begin.displacement)
        units = self.contact.scales
        position = value * (units.load if control.kind == "load" else units.normal)
        dissipated = error = None
        if end is not None:
            before = begin.energy + control.potential(value, begin.load, begin.displacement)
            after = end.energy + control.potential(value, end.load, end.displacement)
            dissipated = (before - after) * units.energy
            error = self._uncertainty(jump.begin, jump.end) * units.energy
        other_end = jump.end
        return Jump(
            self.names.get(jump.row),
            position,
            state_in_units(self.contact, begin),
            None if end is None else state_in_units(self.contact, end),
            dissipated,
            error,
            tuple(state_in_units(self.contact, stop.state) for stop in jump.others),
            None if other_end is None else lambda: self._area(jump.begin, other_end, value) * units.energy,
        )

    def _uncertainty(self, begin: Stop, end: Stop | None) -> float:
        """Error estimate of what a jump dissipates.

        The energy of contact and drive is stationary at both states, but for the value of the control at the fold: it
        changes with that by the difference of what is conjugate to the control.
        """
        assert end is not None
        control, first, last = self.walk.control, begin.state, end.state
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

    @one_thread
    def _area(self, begin: Stop, end: Stop, value: float) -> float:
        """∫ (F_drive − F) dd from the fold to the state after the jump, along the curve."""
        control = self.walk.control
        work = self.walk.work(begin, end)
        return self._driven(control, value, begin.state, end.state) - work

    @staticmethod
    def _driven(control: Control, value: float, begin: State, end: State) -> float:
        """Work of the drive on the tip at a fixed value of the control."""
        if control.kind == "load":
            return value * (end.displacement - begin.displacement)
        if control.kind == "spring":
            return 0.5 * (begin.load + end.load) * (end.displacement - begin.displacement)
        return 0.0

    @one_thread
    def _work(self, legs: Sequence[Leg], jumps: Sequence[RawJump]) -> float:
        """Work of the drive on the tip around the loop: ∫ F dd along the legs, and during the jumps."""
        parts = []
        for leg in legs:
            first, last = self._ends(leg)
            if first is not None and last is not None:
                parts.append(self.walk.work(first, last))
        for jump in jumps:
            if jump.end is not None:
                value = self.walk.control.value(jump.begin.state.load, jump.begin.state.displacement)
                parts.append(self._driven(self.walk.control, value, jump.begin.state, jump.end.state))
        return math.fsum(parts) * self.contact.scales.energy

    def _ends(self, leg: Leg) -> tuple[Stop | None, Stop | None]:
        first = leg.begin if leg.begin is not None else self.walk.stop(leg.rows[0]) if leg.rows else None
        last = leg.end if leg.end is not None else self.walk.stop(leg.rows[-1]) if leg.rows else None
        return first, last

    def _leg(self, leg: Leg) -> list[State]:
        """The states of a leg, close enough to one another that straight lines between them show the curve."""
        stops = [leg.begin] if leg.begin is not None else []
        stops += [self.walk.stop(row) for row in leg.rows]
        stops += [leg.end] if leg.end is not None else []
        if not stops:
            return []
        table = np.array([[stop.state.load, stop.state.displacement, stop.state.contact_radius] for stop in stops])
        extent = np.ptp(table, axis=0)
        states = [stops[0].state]
        for begin, end, before, after in zip(stops[:-1], stops[1:], table[:-1], table[1:], strict=True):
            change = np.abs(after - before) / np.where(extent > 0.0, extent, 1.0)
            count = min(MOST_BETWEEN, math.ceil(float(change.max()) * PATH_POINTS) - 1)
            if count > 0 and begin.piece != -1 and end.piece != -1:
                states += self.walk.between(begin, end, count)
            states.append(end.state)
        return states

    def _path(self, legs: Sequence[Leg]) -> Path:
        scales = self.contact.scales
        units = dict(
            zip(COLUMNS, (scales.load, scales.normal, scales.in_plane, scales.normal, scales.energy), strict=True)
        )
        states: list[State] = []
        directions: list[int] = []
        numbers: list[int] = []
        for number, leg in enumerate(legs):
            own = self._leg(leg)
            states += own
            directions += [leg.direction] * len(own)
            numbers += [number] * len(own)
        columns: dict[str, Any] = {
            name: np.array([getattr(state, name) for state in states]) * unit for name, unit in units.items()
        }
        control = self.control
        position = np.array(
            [control.value(f, d) for f, d in zip(columns["load"], columns["displacement"], strict=True)]
        )
        integers = {"direction": directions, "leg": numbers}
        columns |= {name: np.array(values, dtype=np.int64) for name, values in integers.items()}
        return Path(**columns, position=position)
