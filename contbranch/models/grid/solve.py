"""Single equilibria on a lattice: at a load or a displacement, from the sketches there are."""

from __future__ import annotations

import math

import numpy as np

from contbranch.control import LOAD, Control
from contbranch.curve.curves import Coexisting
from contbranch.curve.events import Reached
from contbranch.curve.refine import refine
from contbranch.curve.solve import CONTROLS, state_apart
from contbranch.curve.trace import Request
from contbranch.errors import InputError, ModelError, number_of
from contbranch.results.diagram import State

from .equilibria import LatticeProblem
from .measure import quietly
from .newton import Equilibrium, Hold, Settings, Sketch, control_held, hold_control, newton, settings_for, tangent
from .problem import GridProblem
from .resolution import Resolution, fills, map_message, rounded_up, warn
from .setup import Setup
from .size import border_message, chosen_size
from .sketch import copied, drawn, relatives

__all__ = ["reached", "solve_all"]

# Two states are one if their fields differ by less than this part of the law's range.
SAME = 1e-3
# Residual of a contact without interaction from which a search begins, and its load in addition to the one wanted, as a
# share of the largest pull on all of the cell.
BARE, PULL_SHARE = 1e-6, 0.5


def solve_all(setup: Setup, request: Request, field: str, value: float, near: State | None = None) -> Coexisting:
    """Equilibria with a load, displacement or mean gap on a lattice: one for every sketch that leads to one.

    A state of the same lattice given as `near` is the only start, if Newton's method finds an equilibrium from it.

    Raises
    ------
    InputError
        For a contact radius, which a lattice cannot hold, and a mean gap in free space.
    """
    control, held = _control(setup, field, value)
    settings, hold = settings_for(request.accuracy), control_held(setup.problem, control, held)
    problem = LatticeProblem(setup, settings.tolerance, wall=True)
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
            for sketch in [drawn(setup, state) for state in related] or trials(setup, control, held):
                one = reached(setup, sketch, hold, settings, relax=field != "mean_gap")
                if one is not None and all(np.abs(one.u - o.u).max() >= SAME * setup.length for o in equilibria):
                    equilibria.append(one)
        if not equilibria:
            raise _unreached(setup, field, value, bool(related))
        states = []
        for state in equilibria:
            along = tangent(setup.problem, state, hold_control(setup.problem, 0.0, 1.0, 0.0), 1e-8)
            event = Reached(control, control.target(held))
            known = refine(problem.point(state, (along.field, along.load)), event, request.accuracy)
            states.append(state_apart(known, request.controls))
    border = "" if setup.crowded else _border(setup, equilibria[0], (field, value), request.accuracy)
    notes = [Resolution.of(setup).message, map_message(setup), border]
    for note in notes:
        warn(note)
    if own and related:
        notes.insert(0, f"The axisymmetric model has {number_of(len(related), 'equilibrium', 'equilibria')} here.")
    else:
        notes.insert(0, "Whether other equilibria exist has not been searched.")
    lowest = min((getattr(state, field) for state in states), default=math.inf)
    message, cost = " ".join(filter(None, notes)), setup.counter.cost()
    return Coexisting(tuple(states), (True,) * len(states), lowest, cost, problem.size, message=message)


def _control(setup: Setup, field: str, value: float) -> tuple[Control, float]:
    """What is held, and at which value.

    The mean gap is that of a cell's mean plane, z̄ - (d - C F): a spring of the stiffness -1/C.
    """
    if field == "mean_gap":
        if setup.kind == "free" or not math.isfinite(setup.mean_height):
            raise InputError("mean_gap: only that of a periodic cell under a tip that fills it; give a displacement")
        return Control("spring", -1.0 / setup.lattice.compliance), setup.mean_height - value
    control = CONTROLS[field]
    if control is None:
        raise InputError("contact_radius: a lattice cannot hold it; give a load or a displacement")
    return control, value


def _border(setup: Setup, state: Equilibrium, asked: tuple[str, float], accuracy: float) -> str:
    """A sentence if contact or interaction have reached the border of the cell."""
    if not fills(setup, state):
        return border_message(setup, state.fields.gap, state.load, asked)
    # Heights and gaps at the border do not tell how far a contact would go: the cell that would be chosen does.
    wanted, _ = chosen_size(setup.contact, setup.kind, (None, setup.grid), asked, accuracy)
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


def reached(setup: Setup, sketch: Sketch, hold: Hold, settings: Settings, relax: bool = True) -> Equilibrium | None:
    """The equilibrium next to a sketch, by Newton's method; where that fails, the stable one where it comes to rest."""
    from .landing import land

    problem = setup.problem
    found = newton(problem, sketch.u, sketch.load, hold, sketch.contact, settings)
    if not found.converged and relax:
        found = land(problem, sketch.u, hold, settings.tolerance)
    return found if found.converged else None


def trials(setup: Setup, control: Control, value: float) -> list[Sketch]:
    """Starts for relaxation, for a tip without likeness: pressed to the wall, and undeformed, just apart.

    The former are contacts without interaction, which is convex: at what is held, and at a larger load, from where
    attractive surfaces come apart no further than they have to.
    """
    problem, nothing = setup.problem, np.zeros(setup.problem.shape, dtype=bool)
    heights = np.where(np.isfinite(problem.heights), problem.heights, 0.0)
    # Flat, as if every height below the mean pressure's work were in contact.
    depth = float(np.quantile(heights[setup.lattice.cell], 0.3))
    flat, load = -np.minimum(heights, depth), value if control == LOAD else 0.0
    pressed = Sketch(flat, load, np.isfinite(problem.heights) & (problem.heights + flat <= 0.0))
    starts, law = [], problem.law
    bare = GridProblem(problem.lattice, problem.heights, None, problem.threads, problem.counter)
    deepest = 0.0 if law is None else -float(law.evaluate(np.zeros(1)).energy[0]) / law.range
    pull = max(0.0, deepest) * math.prod(setup.edges)
    holds = [control_held(bare, control, value)] if value > 0.0 else []
    holds += [Hold(abs(load) + PULL_SHARE * pull)] if pull else []
    for hold in holds if law is not None else ():
        found = newton(bare, flat, hold.value, hold, pressed.contact, Settings(tolerance=BARE))
        starts += [Sketch(found.u, found.load, found.contact)] if found.converged else []
    return [*(starts or [pressed]), Sketch(np.full(problem.shape, setup.length), load, nothing)]
