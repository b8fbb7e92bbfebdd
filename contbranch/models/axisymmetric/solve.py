"""Single equilibria of an axisymmetric contact: where the traced curve meets the value asked for."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from contbranch.contact import Contact
from contbranch.diagram import State
from contbranch.errors import InputError, ModelError

from .locate import Place, refine
from .problem import ContactProblem, LoadReached
from .profile import profile_of
from .trace import Target, Traced, trace

__all__ = ["solve_all"]

Progress = Callable[[float, str], None]


def solve_all(
    contact: Contact, field: str, value: float, accuracy: float, progress: Progress | None = None
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
    if field == "contact_radius" and not 0 < value < contact.tip.extent:
        raise InputError(f"contact_radius: {value:g}; must be greater than zero (and within the tip)")
    traced = trace(contact, accuracy, Target(), progress, events=False)
    reached = getattr(traced.curve, field)
    if traced.curve.complete and value > reached[-1]:
        traced = trace(contact, accuracy, _target(contact, field, value, traced), progress, events=False)
        reached = getattr(traced.curve, field)
    states = []
    if field == "displacement" and value < reached[0] and len(reached):
        states.append(_state(traced, 0, field, value, accuracy))
    for row in range(len(reached) - 1):
        low, high = reached[row], reached[row + 1]
        if min(low, high) < value <= max(low, high) and (field != "contact_radius" or high > 0):
            nearer = (
                row
                if abs(low - value) < abs(high - value) and not (field == "contact_radius" and low == 0)
                else row + 1
            )
            states.append(_state(traced, nearer, field, value, accuracy, row))
    if not states and not traced.curve.complete:
        raise ModelError(f"{field}: the curve ends before {value:.6g} is reached. {traced.curve.message}")
    return states, traced


def _target(contact: Contact, field: str, value: float, traced: Traced) -> Target:
    if field == "load":
        return Target(load=value * (1 + 1e-9))
    if field == "displacement":
        return Target(displacement=value + 1e-9 * abs(value))
    a = np.float64(value)
    hertz = 2 * float(a * contact.tip.transform(a) - contact.tip.transform_integral(a))
    return Target(load=1.2 * (hertz + float(traced.curve.load[-1]) + 2 * math.pi))


def _state(traced: Traced, row: int, field: str, value: float, accuracy: float, piece: int = 0) -> State:
    """The state with exactly the value asked for, starting from a row next to it."""
    point = traced.points[row]
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    place = Place(problem, point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
    if not problem.equations.contact and traced.curve.contact_radius[piece + 1] > 0:
        # From first touch into contact: the row belongs to the side without.
        problem = problem.in_contact()
        place = Place(problem, point.x, point.parameter, problem.direction(point.x, point.parameter))
    event = None
    if field == "contact_radius":
        u = problem.parameter(problem.equations.coordinate.of(value, 0.0))
        place = Place(problem, problem.solve_at(point.x, u), u, place.direction)
    elif field == "load":
        event = LoadReached(value)
    else:
        event = LoadReached(math.inf, value)
    values, place = refine(place, event, accuracy)
    problem = place.problem
    fields = problem.fields(place.x, place.u)
    numbers, errors = list(values.numbers), list(values.error)
    index = ("load", "displacement", "contact_radius").index(field)
    numbers[index], errors[index] = value, 0.0
    keys = ("load", "displacement", "contact_radius", "central_gap")
    return State(
        load=numbers[0],
        displacement=numbers[1],
        contact_radius=numbers[2],
        central_gap=numbers[3],
        energy=problem.equations.energy(fields),
        unstable_load=int(traced.indices.load_pieces[piece]),
        unstable_displacement=int(traced.indices.displacement_pieces[piece]),
        residual=float(np.abs(fields.residual).max() / max(1e-300, np.abs(fields.h).max())) if fields.h.any() else 0.0,
        error=dict(zip(keys, errors, strict=True)),
        profile=profile_of(problem.equations, fields),
    )
