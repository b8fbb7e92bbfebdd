"""`trace` and `solve`: from a contact to its diagram or its equilibrium, whatever the model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import fields as dataclass_fields

from contbranch.contact.contact import Contact
from contbranch.contact.units import finite_number, positive_number
from contbranch.control import Control, Spring, as_control
from contbranch.curve.outcome import RawCurve, assemble, state_in_reduced, state_in_units
from contbranch.errors import InputError
from contbranch.models.choice import Model, choose
from contbranch.models.exact.model import Exact
from contbranch.models.exact.outcome import exact_outcome, exact_state
from contbranch.models.grid import FreeSpace, Periodic
from contbranch.results.diagram import Cost, Diagram, ModelChoice, Solution, State
from contbranch.threads import one_thread

__all__ = ["check", "solve", "trace"]

Progress = Callable[[float, str], None]

FINEST, COARSEST = 1e-13, 1e-2


@one_thread
def trace(
    contact: Contact,
    control: str | Spring = "load",
    accuracy: float = 1e-6,
    max_load: float | None = None,
    model: str | Model = "auto",
    progress: Progress | None = None,
    modes: int = 32,
) -> Diagram:
    """Trace the whole curve of equilibria of a contact, stable and unstable, and locate its events.

    Parameters
    ----------
    contact : Contact
    control : {"load", "displacement"} or Spring
        The control whose stability plots speak of. Folds of load and displacement are reported always, those of a
        spring besides.
    accuracy : float
        Error allowed to every event and threshold, relative to max(1, |value|) in reduced units; 1e-13 to 1e-2.
    max_load : float, optional
        Load (in the contact's units) at which the curve ends; default: in contact, at 1.4 times the largest load of any
        event, and at least 10 in reduced units.
    model : str or model object
        ``"auto"``, ``"exact"``, ``"axisymmetric"``, ``"periodic"``, ``"free"``, or an object such as ``cb.Exact()`` or
        ``cb.Periodic(cell=10.0, grid=256)``. ``"auto"`` takes a grid only for tips without axial symmetry.
    progress : callable, optional
        Called as ``progress(fraction, text)`` now and then.
    modes : int
        Azimuthal modes cos mθ are examined from m = 1 up to here at most, fewer where the rest is known to be stable;
        0: none, and no ``unstable_azimuthal``.

    Returns
    -------
    Diagram
        With status ``incomplete`` and a message where the curve could not be followed to its end; what was traced is
        kept.

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    driven = check(contact, control, accuracy)
    reduced = driven.scaled(contact.scales.stiffness)
    chosen, why = choose(contact, model)
    if not isinstance(modes, int) or modes < 0:
        raise InputError(f"modes: {modes!r}; must be a whole number, zero or greater")
    limit = None if max_load is None else positive_number(max_load, "max_load") / contact.scales.load
    if isinstance(chosen, Exact):
        curve = chosen.curve(contact)
        raw = exact_outcome(curve, limit, reduced)
    else:
        raw = chosen.trace(contact.to_reduced(), accuracy, limit, progress, reduced, modes)
    return assemble(contact, raw, ModelChoice(chosen.name, why, raw.unknowns), driven, accuracy)  # type: ignore[arg-type]


@one_thread
def solve(
    contact: Contact,
    *,
    load: float | None = None,
    displacement: float | None = None,
    contact_radius: float | None = None,
    near: State | None = None,
    control: str | Spring | None = None,
    accuracy: float = 1e-6,
    model: str | Model = "auto",
    progress: Progress | None = None,
) -> Solution:
    """Find the equilibrium at a load, displacement or contact radius (exactly one of them, in the contact's units).

    Where several exist, the stable one that is lowest in energy − F d (load) or in energy (displacement) is returned,
    or the one closest to `near`; all of them are in ``solution.states``.

    Parameters
    ----------
    near : State, optional
        A state whose nearest relative is wanted instead of the lowest. On a grid a state of the same grid is the start.
    control : {"load", "displacement"} or Spring, optional
        Whose stability counts; by default that of the quantity given (load for a contact radius).
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units.

    Raises
    ------
    InputError
        If the value cannot be reached; the message says which ones can.
    ModelError
        If the computation failed.
    """
    began = time.perf_counter()
    given = {"load": load, "displacement": displacement, "contact_radius": contact_radius}
    asked = {name: value for name, value in given.items() if value is not None}
    if len(asked) != 1:
        raise InputError(f"solve: give exactly one of load, displacement and contact_radius, not {len(asked)}")
    ((field, value),) = asked.items()
    driven = check(contact, control or ("displacement" if field == "displacement" else "load"), accuracy)
    reduced = driven.scaled(contact.scales.stiffness)
    value = finite_number(value, field)
    if near is not None and not isinstance(near, State):
        raise InputError(f"near: {type(near).__name__}; must be a State, such as a solution or a branch's state")
    scales = contact.scales
    unit = {"load": scales.load, "displacement": scales.normal, "contact_radius": scales.in_plane}[field]
    chosen, why = choose(contact, model)
    if isinstance(chosen, Exact):
        curve = chosen.curve(contact)
        raw = exact_outcome(curve, None)
        lowest = min(raw.load)
        found: list[State] = []
        if field != "load" or value / unit >= lowest:
            exact = curve.solve(**{field: value / unit})
            found = [exact_state(curve, state, reduced.spring_stiffness) for state in exact]
    elif isinstance(chosen, Periodic | FreeSpace):
        start = None if near is None else state_in_reduced(contact, near)
        found, raw = chosen.solve(contact.to_reduced(), field, value / unit, accuracy, progress, reduced, start)
    else:
        found, raw = chosen.solve(contact.to_reduced(), field, value / unit, accuracy, progress, reduced)
    if not found:
        raise InputError(f"{field}: {value:g} cannot be reached; {_reachable(raw, field, unit)}")
    states = tuple(state_in_units(contact, state) for state in found)
    best, message = _best(states, driven, near)
    if isinstance(chosen, Periodic | FreeSpace):
        unstable = "" if any(state.stable(driven) for state in states) else " None of those found is stable."
        message = raw.message + unstable
    spent = raw.cost
    cost = Cost(time.perf_counter() - began, spent.newton, spent.fft_pairs, spent.stability_pairs)
    values = {item.name: getattr(best, item.name) for item in dataclass_fields(State)}
    return Solution(
        **values,
        model=ModelChoice(chosen.name, why, raw.unknowns),  # type: ignore[arg-type]
        cost=cost,
        message=message,
        states=(best, *(state for state in states if state is not best)),
        contact=contact,
    )


def _best(states: tuple[State, ...], control: Control, near: State | None) -> tuple[State, str]:
    stable = [state for state in states if state.stable(control)]
    count = len(states)
    message = (
        f"{count} equilibri{'um' if count == 1 else 'a'} on the curve, "
        f"{len(stable)} stable under {control.kind} control."
    )
    if near is not None:

        def distance(state: State) -> float:
            names = ("load", "displacement", "contact_radius", "central_gap")
            return math.hypot(*(getattr(state, name) - getattr(near, name) for name in names))

        return min(states, key=distance), message

    def height(state: State) -> float:
        value = control.value(state.load, state.displacement)
        return state.energy + control.potential(value, state.load, state.displacement)

    if stable:
        return min(stable, key=height), message
    return min(states, key=height), message + " None is stable; the lowest one is returned."


def _reachable(raw: RawCurve, field: str, unit: float) -> str:
    values = getattr(raw, field)
    low = float(values.min()) * unit
    name = {"load": "loads", "displacement": "displacements", "contact_radius": "contact radii"}[field]
    if field == "contact_radius":
        return f"{name} greater than zero are reachable"
    return f"{name} from {low:.10g} upwards are reachable"


def check(contact: Contact, control: object, accuracy: float) -> Control:
    """Check what every computation is given, and return the control."""
    if not isinstance(contact, Contact):
        raise InputError(f"contact: {type(contact).__name__}; must be a Contact, made by cb.Contact(...)")
    driven = as_control(control)
    number = finite_number(accuracy, "accuracy")
    if not FINEST <= number <= COARSEST:
        raise InputError(f"accuracy: {number:g}; must lie between {FINEST:g} and {COARSEST:g}")
    return driven
