"""Quasi-static cycles on a lattice by relaxation alone, without the curve: for maps whose curve is too long.

What is controlled goes up and down in equal steps. Each begins with the state before it, moved with the control, from
where overdamped relaxation leads to the next stable state (`landing`). A step is a jump if it does not lead back: the
relaxation from its end at the value of its begin ends elsewhere than there. Energies are those of contact and drive; a
step from H₀ to H₁ with the slopes s = dH/dv dissipates H₀ + (s₀ + s₁) Δv/2 - H₁, known to |s₀ - s₁| Δv/2, since the
jump may be anywhere within the step.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import h5py
import numpy as np

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.outcome import state_in_units
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import CellFields, ModelChoice, State
from contbranch.results.loop import Hysteresis, Jump, Path
from contbranch.results.record import OBSERVABLES
from contbranch.watch import INTERRUPTIONS, caught, over, tell, told

from .landing import CLOSE, ESCAPED, extent, land
from .measure import quietly
from .newton import Equilibrium, control_held, settings_for
from .observables import cell_fields, mean_gap
from .readings import read
from .resolution import DECAYED
from .setup import Setup
from .solve import trials

__all__ = ["cycle"]

# Columns of the rows of a cycle.
OTHERS = ("energy", "mean_gap", "residual")
COLUMNS = (*OBSERVABLES, *OTHERS, "direction", "jump", "dissipated", "error")
JUMP = COLUMNS.index("jump")
# Nodes up to which the fields of the states before and behind jumps are kept in memory, 2 MB each.
KEPT_NODES = 512**2
# Steps below zero load in which an attractive contact must have come apart, in those up to the largest load.
APART = 10


def cycle(
    setup: Setup, contact: Contact, control: Control, largest: float, steps: int, file: FilePath | None
) -> Hysteresis:
    """The cycle of a contact, as far as it gets before it is interrupted.

    Parameters
    ----------
    setup : Setup
        Of the reduced contact.
    contact : Contact
    control : Control
        In the contact's units.
    largest : float
        Load at which the cycle turns round, reduced.
    steps : int
        From the first state to the one with that load.
    file : Path or None
        Where the states are kept, and from which an interrupted cycle goes on.

    Raises
    ------
    InputError
        If the file is one of another cycle.
    """
    driven, reason = control.scaled(contact.scales.stiffness), ""
    lattice = f"{setup.kind} {setup.edges} {setup.nodes}"
    with _Journal(file, setup, f"{contact.describe()} {lattice} {control} {largest} {steps}") as journal:
        try:
            with quietly():
                reason = _Cycle(setup, driven, largest, steps).run(journal)
        except INTERRUPTIONS as error:
            caught(error)
    return _loop(setup, contact, control, journal, reason)


class _Cycle:
    """What is controlled, and how it changes."""

    def __init__(self, setup: Setup, control: Control, largest: float, steps: int) -> None:
        self.setup, self.nodes, self.control = setup, setup.problem, control
        self.tolerance = settings_for(1e-6).tolerance
        law = setup.law
        self.attracts = law is not None and bool(
            law.evaluate(law.range * np.linspace(0.0, 10.0, 201)).pressure.min() < 0
        )
        first = 0.0 if law is None else -law.reach(DECAYED)
        if control.kind == "load":
            self.step = largest / steps
            self.values = self.step * np.arange(1.0, steps + 1.0)
        else:
            top = self._pressed(largest)
            self.step = (control.value(top.load, top.displacement) - first) / steps
            self.values = first + self.step * np.arange(float(law is None), steps + 1.0)

    def _pressed(self, load: float) -> Equilibrium:
        """The state in contact at a load."""
        found = land(
            self.nodes, trials(self.setup, LOAD, load)[0].u, control_held(self.nodes, LOAD, load), self.tolerance
        )
        if not found.converged:
            raise ModelError(
                f"max_load: no stable state was reached at {load * self.setup.units.load:g}, {found.reason}"
            )
        return found

    def run(self, journal: _Journal) -> str:
        """Go on to the end; why there is no state any more, if there is none."""
        count = len(self.values)
        down = count - 1 if self.control.kind != "load" or not self.attracts else APART * count
        place = journal.last(self.nodes.shape)
        for k in range(len(journal.rows), count + down):
            up = k < count
            value = float(self.values[k]) if up else float(self.values[-1]) - (k - count + 1) * self.step
            before = value if k == 0 else value - self.step if up else value + self.step
            tell(
                k / (2.0 * count),
                f"relaxing at {self.control.kind} {value * self.setup.units.of(self.control.kind):.4g}",
            )
            if place is None:
                far = np.full(self.nodes.shape, -value if self.control.kind != "load" else self.setup.length)
                found, lost = self._landed(far, value), None
            else:
                state = self._state(*place)
                found, lost = self._onward(state, before, value)
            if not found.converged:
                return found.reason
            place = found.u, found.load
            journal.add(found, self._row(found, 1 if up else -1, lost))
        return ""

    def _state(self, u: Array, load: float) -> Equilibrium:
        contact = self.nodes.heights + u <= 0.0
        return Equilibrium(self.nodes.fields(u, load, contact), contact, 0.0, self.nodes.displacement(u, load), True)

    def _landed(self, u: Array, value: float) -> Equilibrium:
        return land(self.nodes, u, control_held(self.nodes, self.control, value), self.tolerance)

    def _onward(
        self, state: Equilibrium, before: float, value: float
    ) -> tuple[Equilibrium, tuple[float, float] | None]:
        """The next state, and of a jump what it dissipates and the error of that."""
        shift = value - before if self.control == DISPLACEMENT else 0.0
        start = np.maximum(state.u - shift, -self.nodes.heights)
        found = self._landed(start, value)
        if not found.converged or self.setup.law is None or self._near(state, found.u - start):
            return found, None
        back = self._landed(np.maximum(found.u + shift, -self.nodes.heights), before)
        if back.converged and self._near(state, back.u - state.u):
            return found, None
        first, last = (self._height(one, at) for one, at in ((state, before), (found, value)))
        slopes = [-one.displacement if self.control.kind == "load" else one.load for one in (state, found)]
        step = value - before
        return found, (first - last + 0.5 * sum(slopes) * step, 0.5 * abs((slopes[1] - slopes[0]) * step))

    def _near(self, state: Equilibrium, change: Array) -> bool:
        return extent(self.nodes, state.fields.gap, change) <= CLOSE

    def _height(self, state: Equilibrium, value: float) -> float:
        energy = self.nodes.total_energy(state.fields)
        return energy + self.control.potential(value, state.load, state.displacement)

    def _row(self, state: Equilibrium, direction: int, lost: tuple[float, float] | None) -> list[float]:
        seen = read(self.setup, state)[:5]
        jump = (1.0, *lost) if lost else (0.0, 0.0, 0.0)
        return [*seen, mean_gap(self.nodes, state), state.residual, float(direction), *jump]


class _Journal:
    """The rows of a cycle, in memory and in a file, which has the gaps of all states and the last two fields, too."""

    def __init__(self, path: FilePath | None, setup: Setup, description: str) -> None:
        self.path, self.setup, self.description = path, setup, description
        self.rows: list[list[float]] = []
        self.fields: dict[int, Equilibrium] = {}
        self.file: h5py.File | None = None

    def __enter__(self) -> _Journal:
        if self.path is None:
            return self
        try:
            self.file = file = h5py.File(self.path, "a")
        except OSError:
            raise InputError(f"file: '{self.path}' cannot be opened or made as HDF5; give another name") from None
        lattice = self.setup.lattice
        if not len(file):
            file.create_dataset(
                "rows", (0, len(COLUMNS)), "f8", maxshape=(None, len(COLUMNS)), chunks=(64, len(COLUMNS))
            )
            file["rows"].attrs["columns"] = COLUMNS
            shape = lattice.whole().nodes
            file.create_dataset("gap", (0, *shape), "f4", maxshape=(None, *shape), chunks=(1, *shape))
            file.create_dataset("u", (2, *lattice.shape), "f8")
            file.attrs["cycle"] = self.description
        elif file.attrs.get("cycle") != self.description:
            file.close()
            raise InputError(
                f"file: '{self.path}' holds another cycle; give another name, or the arguments of that one"
            )
        self.rows = file["rows"][()].tolist()
        return self

    def __exit__(self, *error: object) -> None:
        if self.file is not None:
            self.file.close()

    def last(self, shape: tuple[int, int]) -> tuple[Array, float] | None:
        """Field and load of the last state; None if there is none."""
        if self.file is None or not self.rows:
            return None
        return self.file["u"][(len(self.rows) - 1) % 2], self.rows[-1][0]

    def add(self, state: Equilibrium, row: list[float]) -> None:
        """Keep a state."""
        k = len(self.rows)
        if self.file is not None:
            cell = cell_fields(self.setup.problem, state, self.setup.centred)
            self.file["u"][k % 2] = state.u
            for name, values in (("gap", cell.gap), ("rows", row)):
                self.file[name].resize(k + 1, 0)
                self.file[name][k] = values
            self.file.flush()
        if state.u.size <= KEPT_NODES:
            self.fields[k] = state.slim()
        if k and not row[JUMP] and not self.rows[-1][JUMP]:
            self.fields.pop(k - 1, None)
        self.rows.append(row)


def _loop(setup: Setup, contact: Contact, control: Control, journal: _Journal, reason: str) -> Hysteresis:
    """Rows as a loop in the contact's units."""
    rows, units = journal.rows, contact.scales.of_fields
    table = dict(zip(COLUMNS, np.array(rows).reshape(-1, len(COLUMNS)).T, strict=True))
    columns = {name: table[name] * units[name] for name in (*OBSERVABLES, "energy")}
    jumps, turned = table["jump"] > 0.0, np.diff(table["direction"], prepend=1.0) < 0.0

    def state(k: int) -> State:
        numbers: dict[str, Any] = {name: float(table[name][k]) for name in (*OBSERVABLES, *OTHERS)}
        fields = journal.fields.get(k)
        cell = None if fields is None else partial(_fields, setup, fields)
        return state_in_units(contact, State(**numbers, unstable_load=0, unstable_displacement=0, in_cell=cell))

    def jump(k: int, end: State | None) -> Jump:
        start, unit = state(k - 1), contact.scales.energy
        lost, error = (float(table[name][k]) * unit for name in ("dissipated", "error")) if end else (None, None)
        return Jump(None, control.of(start), start, end, lost, error)

    found = [jump(k, state(k)) for k in np.flatnonzero(jumps).tolist()]
    interrupted = over()
    apart = bool(rows) and reason == ESCAPED
    if apart:
        found.append(jump(len(rows), None))
    complete = not interrupted and (not reason or apart)
    closed = complete and not apart
    message = (
        f"By relaxation in steps of {control.kind}; a jump lies within the step behind the state that it starts from."
    )
    if apart:
        message += f" The loop does not close: behind load {found[-1].start.load:.6g} the surfaces come apart for good."
    elif reason:
        message += f" No further state was reached, since {reason}."
    return Hysteresis(
        path=Path(
            **columns,
            position=np.array(
                [control.value(*pair) for pair in zip(columns["load"], columns["displacement"], strict=True)]
            ),
            direction=table["direction"].astype(np.int64),
            leg=np.cumsum(jumps | turned),
        ),
        jumps=tuple(found),
        dissipated=math.fsum(jump.dissipated or 0.0 for jump in found) if closed else None,
        error=math.fsum(jump.error or 0.0 for jump in found) if closed else None,
        closed=closed,
        model=ModelChoice(setup.kind, "", setup.lattice.size),
        cost=setup.counter.cost(),
        control=control.kind,
        stiffness=control.spring_stiffness,
        status="complete" if complete else "incomplete",
        message=told(message),
        contact=contact,
    )


def _fields(setup: Setup, state: Equilibrium) -> CellFields:
    whole = replace(state, fields=setup.problem.fields(state.u, state.load, state.contact))
    return cell_fields(setup.problem, whole, setup.centred)
