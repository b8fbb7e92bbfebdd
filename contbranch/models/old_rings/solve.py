"""Single equilibria: where the traced curve meets the value asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.continuation import CorrectionError, Event, Point, find_root
from contbranch.continuation.walk import corrected_point
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.stability import Indices
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import Profile, State

from .accuracy import JUMP, OPTIONS, SAFETY, Values, locate, moved, refine, ring_problem, settled
from .journey import Target
from .legs import Reached, oriented, unit_metric
from .meshing import finer as finer_panels
from .profile import profile_of
from .trace import Traced, trace

__all__ = ["between", "energy_at", "indices_on", "located_between", "solve_all", "state_between", "state_of"]

Progress = Callable[[float, str], None]

# Radii, in units of the interaction's reach over the tip, at which the gap of a state without forces is given.
RADII = np.linspace(0.0, 2.0, 41)

# Rounding of an energy, relative to max(1, |value|).
ENERGY_ROUNDING = 1e-13


def solve_all(
    contact: Contact,
    field: str,
    value: float,
    accuracy: float,
    progress: Progress | None = None,
    control: Control = LOAD,
) -> tuple[list[State], Traced]:
    """Every equilibrium on the curve with the given load, displacement or contact radius, in order along the curve.

    Parameters
    ----------
    contact : Contact
        In reduced units.
    field : {"load", "displacement", "contact_radius"}
    value : float
        Reduced units.
    accuracy : float
        Error allowed to the other quantities, relative to max(1, |value|).
    control : Control
        A spring whose stability is wanted, too.

    Returns
    -------
    states, traced
        No state if the curve does not reach the value; the curve tells what it reaches.

    Raises
    ------
    ModelError
        If the curve ends before the value could be reached.
    InputError
        If the value is out of range whatever the curve does.
    """
    if field == "contact_radius" and not 0 < value < contact.axisymmetric_tip.extent:
        raise InputError(f"contact_radius: {value:g}; must be greater than zero (and within the tip)")
    beyond = value + 1e-9 * abs(value)
    own = {"load": LOAD, "displacement": DISPLACEMENT}.get(field)
    traced = trace(contact, accuracy, Target(), progress, events=False, control=control)
    reached = getattr(traced.curve, field)
    if traced.curve.complete and len(reached) and value > reached[-1]:
        traced = trace(contact, accuracy, Target(beyond, own), progress, events=False, control=control)
        reached = getattr(traced.curve, field)
    states = []
    if len(reached) and (
        (field == "displacement" and value < reached[0]) or (field == "load" and 0 <= value <= reached[0])
    ):
        states.append(_without_forces(contact, traced, value if field == "displacement" else None, field))
    for row in range(len(reached) - 1):
        low, high = reached[row], reached[row + 1]
        if min(low, high) < value <= max(low, high) and (field != "contact_radius" or high > 0):
            begin, end = traced.points[row], traced.points[row + 1]
            unstable = indices_on(traced.curve, traced.indices, row)
            states.append(state_between(begin, end, unstable, field, value, accuracy))
    if not states and not traced.curve.complete:
        raise ModelError(f"{field}: the curve ends before {value:.6g} is reached. {traced.curve.message}")
    return states, traced


def _without_forces(contact: Contact, traced: Traced, displacement: float | None, field: str) -> State:
    """The state before the trace begins, where the interaction is negligible at the accuracy asked."""
    first = float(traced.curve.displacement[0])
    d = first if displacement is None else displacement
    scale = math.sqrt(abs(d)) if d else 1.0
    r = scale * RADII[scale * RADII < contact.axisymmetric_tip.extent]
    none = np.zeros_like(r)
    load = abs(float(traced.curve.load[0]))
    error = {"load": load, "displacement": 0.0 if field == "displacement" else load, "contact_radius": 0.0}
    return State(
        load=0.0,
        displacement=d,
        contact_radius=0.0,
        central_gap=-d,
        energy=0.0,
        unstable_load=0,
        unstable_displacement=0,
        residual=0.0,
        error={**error, "central_gap": load},
        profile=Profile(r, contact.axisymmetric_tip.height(r) - d, none, none),
    )


def between(begin: Point, end: Point, event: Event) -> Point:
    """The point between two rows at which an event function vanishes.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    problem = ring_problem(begin)
    if ring_problem(end).layout != problem.layout:
        # A change of the contact set lies at one of both rows: the one with more regions is right between them, and
        # where its narrow region cannot be solved for, the other all but is.
        sides = [begin, end.turned()]
        if ring_problem(end).edges > problem.edges:
            sides.reverse()
        try:
            return locate(sides[0], event)
        except CorrectionError:
            return locate(sides[1], event)
    there = ring_problem(end).carried(end.x, end.x, problem)
    metric = unit_metric(problem, begin.x)
    direction = there - begin.x, end.parameter - begin.parameter

    def at(theta: float) -> Point:
        x, d = begin.x + theta * direction[0], begin.parameter + theta * direction[1]
        return corrected_point(problem, x, d, direction, metric, OPTIONS)[0]

    first, last = event.value(begin), event.value(end)
    if (first > 0) == (last > 0):  # which errors of the discretisation can cause
        return locate(begin if abs(first) < abs(last) else end, event)
    theta = find_root(lambda t: event.value(at(t)), (0.0, first), (1.0, last), 1e-9)
    return at(theta)


def located_between(begin: Point, end: Point, event: Event, accuracy: float) -> tuple[Values, Point]:
    """The state between two rows at which an event function vanishes: values with error estimates, and the point.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    point = between(begin, end, event)
    problem = ring_problem(point)
    point = oriented(problem, point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
    return refine(point, event, accuracy)


def state_of(
    values: Values, point: Point, unstable: tuple[int, int, int | None], given: Mapping[str, float] | None = None
) -> State:
    """The state of a point, reduced units; `given` are observables known exactly, since they were asked for."""
    problem, known = ring_problem(point), given or {}
    fields = problem.fields(point.x, point.parameter)
    keys = ("load", "displacement", "contact_radius", "central_gap")
    numbers = {**dict(zip(keys, values.numbers, strict=True)), **known}
    errors = {**dict(zip(keys, values.error, strict=True)), **dict.fromkeys(known, 0.0)}
    energy, potential_error = energy_at(values, point)
    errors["energy"] = potential_error + abs(values.numbers[0]) * values.error[1]
    residual = np.abs(problem.residual(point.x, point.parameter)).max() / max(1e-300, np.abs(fields.pressure).max())
    return State(
        load=numbers["load"],
        displacement=numbers["displacement"],
        contact_radius=numbers["contact_radius"],
        central_gap=numbers["central_gap"],
        energy=energy,
        unstable_load=unstable[0],
        unstable_displacement=unstable[1],
        unstable_spring=unstable[2],
        residual=float(residual),
        error=errors,
        profile=profile_of(problem, fields),
    )


def energy_at(values: Values, point: Point) -> tuple[float, float]:
    """Energy V_ela + V_fr of a state, and the error estimate of V − F d at its load.

    That is stationary with respect to errors of the state, and compared with a state on finer panels.
    """
    problem = ring_problem(point)
    energy = problem.energy(problem.fields(point.x, point.parameter))
    load, displacement = values.numbers[:2]
    try:
        finer = settled(moved(point, problem.on(finer_panels(problem.panels))), None)
    except CorrectionError:
        return energy, abs(load) * values.error[1] + abs(displacement) * values.error[0]
    fine = ring_problem(finer)
    change = fine.energy(fine.fields(finer.x, finer.parameter)) - energy
    change -= load * (finer.parameter - point.parameter)
    left_out = JUMP * problem.layout.jumps
    return energy, SAFETY * abs(change) + (ENERGY_ROUNDING + left_out) * max(1.0, abs(energy))


def state_between(
    begin: Point, end: Point, unstable: tuple[int, int, int | None], field: str, value: float, accuracy: float
) -> State:
    """The state with exactly the value asked for, between two rows.

    Parameters
    ----------
    unstable : (int, int, int or None)
        Morse indices there under load, displacement and spring control.

    Raises
    ------
    ModelError
        If it was not found.
    """
    event = Reached({"load": LOAD, "displacement": DISPLACEMENT}.get(field), value)
    try:
        values, point = located_between(begin, end, event, accuracy)
    except CorrectionError as error:
        raise ModelError(f"{field}: no state at {value:.6g} was found on the curve {error.detail}") from error
    return state_of(values, point, unstable, {field: value})


def indices_on(curve: RawCurve, indices: Indices, piece: int) -> tuple[int, int, int | None]:
    """Morse indices on a piece under load, displacement and spring control (None without a spring)."""
    spring = None if curve.unstable_spring is None else int(indices.spring_pieces[piece])
    return int(indices.load_pieces[piece]), int(indices.displacement_pieces[piece]), spring
