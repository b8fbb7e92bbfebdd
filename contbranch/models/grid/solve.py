"""Single equilibria on a lattice: at a load, a displacement or with a spring, from the sketches there are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.curves import Coexisting
from contbranch.curve.trace import Request
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import State
from contbranch.results.record import OBSERVABLES
from contbranch.watch import kept

from .accuracy import held
from .newton import Equilibrium, Hold, Settings, Sketch, control_held, newton, settings_for
from .observables import cell_fields, mean_gap, profile
from .resolution import Resolution, border_message, fills, repetition, rounded_up, warn
from .rows import crossing, read
from .setup import Setup
from .size import chosen_size
from .sketch import copied, drawn, relatives
from .stability import morse
from .trace import trace
from .walk import quietly

__all__ = ["Asked", "find_all", "solve_all"]

# Two states are one if their fields differ by less than this part of the law's range.
SAME = 1e-3


@dataclass(frozen=True)
class Asked:
    """A load or displacement (reduced units) for which equilibria on a lattice are wanted."""

    setup: Setup
    request: Request
    field: str
    value: float

    @property
    def settings(self) -> Settings:
        """Newton's method, for the accuracy asked."""
        return settings_for(self.request.accuracy)

    @property
    def control(self) -> Control:
        """What is given."""
        return DISPLACEMENT if self.field == "displacement" else LOAD

    @property
    def hold(self) -> Hold:
        """What is held."""
        return control_held(self.setup.problem, self.control, self.value)

    def answer(self, states: Sequence[State], **known: Any) -> Coexisting:
        """The states as an answer, with what is known of them."""
        lowest = min((getattr(state, self.field) for state in states), default=math.inf)
        size, cost = self.setup.lattice.size**2, self.setup.counter.cost()
        return Coexisting(tuple(states), (True,) * len(states), lowest, cost, size, **known)


def solve_all(setup: Setup, request: Request, field: str, value: float, near: State | None = None) -> Coexisting:
    """Equilibria with a load or displacement on a lattice: one for every sketch that leads to one.

    A state of the same lattice given as `near` is the only start, if Newton's method finds an equilibrium from it.

    Raises
    ------
    InputError
        For a contact radius, which a lattice cannot hold.
    """
    if field == "contact_radius":
        raise InputError("contact_radius: a lattice cannot hold it; give a load or a displacement")
    asked = Asked(setup, request, field, value)
    settings, hold = asked.settings, asked.hold
    equilibria: list[Equilibrium] = []
    related: list[State] = []
    own = False
    with quietly():
        start = None if near is None else copied(setup, near)
        if start is not None:
            found = newton(setup.problem, start.u, start.load, hold, start.contact, settings)
            equilibria += [found] if found.converged else []
        if not equilibria:
            related, own = relatives(setup.contact, field, value)
            for sketch in [drawn(setup, state) for state in related] or trials(setup, field, value):
                one = reached(setup, sketch, hold, settings)
                if one is not None and all(np.abs(one.u - o.u).max() >= SAME * setup.length for o in equilibria):
                    equilibria.append(one)
        if not equilibria:
            raise _unreached(setup, field, value, bool(related))
        states = [state_of(asked, found) for found in equilibria]
    border = "" if setup.crowded else _border(asked, equilibria[0])
    notes = [Resolution.of(setup).message, repetition(setup), border]
    for note in notes:
        warn(note)
    if own and related:
        count = len(related)
        notes.insert(0, f"The axisymmetric model has {count} equilibri{'um' if count == 1 else 'a'} here.")
    else:
        notes.insert(0, "Whether other equilibria exist has not been searched.")
    return asked.answer(states, message=" ".join(note for note in notes if note))


def _border(asked: Asked, state: Equilibrium) -> str:
    """A sentence if contact or interaction have reached the border of the cell."""
    setup = asked.setup
    if not fills(setup, state):
        return border_message(setup, state.fields.gap, state.load)
    # Heights and gaps at the border do not tell how far a contact would go: the cell that would be chosen does.
    wanted, _ = chosen_size(
        setup.contact, setup.kind, (None, setup.grid), (asked.field, asked.value), asked.request.accuracy
    )
    load, edge = state.load * setup.units.load, max(wanted, 2.0 * setup.edge) * setup.units.in_plane
    return (
        f"The cell is too small: the contact has reached its border at load {load:.6g}; use a cell of about "
        f"{rounded_up(edge)} or more."
    )


def _unreached(setup: Setup, field: str, value: float, known: bool) -> InputError | ModelError:
    """The error where no start led to an equilibrium."""
    own = value * setup.units.of(field)
    if setup.contact.tip.is_axisymmetric and not known:
        return InputError(f"{field}: {own:g} cannot be reached; the axisymmetric model has no state there")
    return ModelError(
        f"{field}: no equilibrium was found at {own:g} on the grid of {setup.grid} nodes in a cell of "
        f"{setup.edge * setup.units.in_plane:g}; trace the curve to see what exists, or try a finer grid"
    )


def reached(setup: Setup, sketch: Sketch, hold: Hold, settings: Settings) -> Equilibrium | None:
    """The equilibrium next to a sketch, by Newton's method; where that fails, the stable one that dynamics reach."""
    from .landing import settle

    problem = setup.problem
    found = newton(problem, sketch.u, sketch.load, hold, sketch.contact, settings)
    if not found.converged:
        found = settle(problem, sketch.u, sketch.load, hold, settings.tolerance)
    return found if found.converged else None


def trials(setup: Setup, field: str, value: float) -> list[Sketch]:
    """Two starts for dynamics, for a tip without likeness: undeformed, just apart, and pressed flat by the load."""
    problem = setup.problem
    heights = np.where(np.isfinite(problem.heights), problem.heights, 0.0)
    apart = setup.length
    # Pressed flat: as if every height below the mean pressure's work were in contact.
    depth = float(np.quantile(heights[: setup.lattice.inside, : setup.lattice.inside], 0.3))
    nothing = np.zeros(problem.shape, dtype=bool)
    flat = -np.minimum(heights, depth)
    load = value if field == "load" else 0.0
    return [
        Sketch(flat, load, np.isfinite(problem.heights) & (problem.heights + flat <= 0.0)),
        Sketch(np.full(problem.shape, apart), load, nothing),
    ]


def state_of(asked: Asked, found: Equilibrium) -> State:
    """An equilibrium as a state, with error estimates from the coarser lattice and its Morse indices."""
    setup, settings = asked.setup, asked.settings
    problem = setup.problem
    reading = read(setup, found)
    found_there = held(setup, found, asked.control, asked.value, settings)
    error = np.full(4, np.inf) if found_there is None else np.array(found_there.four)
    apart = reading.contact_radius == 0.0
    error[2:] = np.where([apart, not apart], 0.0, error[2:])
    error += settings.tolerance * np.where([1, 1, not apart, apart], np.maximum(1.0, np.abs(reading.four)), 0.0)
    error += [*reading.errors[:3], 0.0]
    indices = morse(problem, found)
    spring = asked.request.control.spring_stiffness

    def index(stiffness: float) -> int:
        return indices.symmetric + int(indices.slope + stiffness < 0.0)

    return State(
        *reading[:5],
        unstable_load=index(0.0),
        unstable_displacement=indices.symmetric,
        residual=found.residual,
        error=dict(zip(OBSERVABLES, error.tolist(), strict=True)),
        profile=profile(problem, found),
        unstable_spring=None if spring is None else index(spring),
        unstable_azimuthal=indices.breaking,
        mean_gap=mean_gap(problem, found),
        in_cell=lambda: cell_fields(problem, found),
    )


def find_all(
    setup: Setup, request: Request, field: str, value: float, window: tuple[float, float] | None
) -> Coexisting:
    """Every equilibrium with a value on the traced curve of the lattice, within a window of displacements."""
    asked = Asked(setup, request, field, value)
    limit = max(value, 0.0) * 1.1 + 1.0 if field == "load" else None
    beyond = value if field == "displacement" else None
    traced = trace(setup, replace(request, target=limit, modes=0), verdicts=False, beyond=beyond)
    settings, hold, problem = asked.settings, asked.hold, setup.problem
    rows = [row for row in traced.rows if row.u is not None]
    states: list[State] = []

    def search() -> None:
        for pair in pairwise(rows):
            low, high = (asked.control.value(*row.reading[:2]) - value for row in pair)
            found = crossing(setup, pair, asked.control, value, settings) if low * high < 0.0 or high == 0.0 else None
            states.extend([] if found is None else [state_of(asked, found)])
        if field == "displacement" and rows and value < rows[0].reading.displacement:
            # The curve begins where the interaction is negligible; further away nothing but a rigid shift changes.
            found = newton(problem, np.full(problem.shape, -value), rows[0].load, hold, None, settings)
            states.extend([state_of(asked, found)] if found.converged else [])

    with quietly():
        kept(search, None)
    curve = traced.curve
    reach = [*curve.displacement.tolist(), *([value] if field == "displacement" else [])]
    used = window or (min(reach), max(reach))
    return asked.answer(
        [state for state in states if used[0] <= state.displacement <= used[1]],
        complete=curve.complete,
        message=curve.message,
        window=used,
        searched="others were not looked for off the curve",
    )
