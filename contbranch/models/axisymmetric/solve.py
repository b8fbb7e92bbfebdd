"""Single equilibria of an axisymmetric contact: where the traced curve meets the value asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contbranch.contact import Contact
from contbranch.continuation import Metric, find_root
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on
from contbranch.diagram import State
from contbranch.errors import InputError, ModelError

from .locate import OPTIONS, Place, refine
from .problem import LoadReached
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
            states.append(_state(traced, row, field, value, accuracy))
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


def _state(traced: Traced, piece: int, field: str, value: float, accuracy: float) -> State:
    """The state with exactly the value asked for, between the rows `piece` and the next (or before the first)."""
    event = None if field == "contact_radius" else LoadReached(value, value if field == "displacement" else None)
    if getattr(traced.curve, field)[piece] > value and piece == 0 and field == "displacement":
        point = traced.points[0]
        place = Place(traced.problem(0), point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
    else:
        place = _between(traced, piece, event, value)
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


def _between(traced: Traced, piece: int, event: LoadReached | None, value: float) -> Place:
    """A place on the piece of curve between two rows: where the event vanishes, or with a given contact radius."""
    begin, end = traced.points[piece], traced.points[piece + 1]
    problem = traced.problem(piece)
    if traced.curve.contact_radius[piece + 1] > 0 and not problem.equations.contact:
        # From first touch into contact: the row belongs to the side without.
        problem = problem.in_contact()
        tangent = problem.direction(begin.x, begin.parameter)
        begin = replace(begin, problem=problem, tangent_x=tangent[0], tangent_parameter=tangent[1])
    mesh = problem.equations.mesh
    other = traced.problem(piece + 1).equations.mesh
    if other is not mesh:
        x = problem.solve_at(other.interpolate(end.x, mesh.nodes), end.parameter)
        end = replace(end, x=x, tangent_x=other.interpolate(end.tangent_x, mesh.nodes))
    end = replace(end, problem=problem)
    if event is None:
        u = problem.parameter(problem.equations.coordinate.of(value, 0.0))
        share = (u - begin.parameter) / (end.parameter - begin.parameter)
        x = problem.solve_at(begin.x + share * (end.x - begin.x), u)
        return Place(problem, x, u, problem.direction(x, u))
    segment = Segment(begin, end, Metric(math.sqrt(problem.inner(end.x, end.x)) + problem.scale, 1.0))
    first, last = event.value(begin), event.value(end)
    if (first > 0) == (last > 0):  # decided by the difference between two meshes
        nearer = begin if abs(first) < abs(last) else end
        return Place(problem, nearer.x, nearer.parameter, (nearer.tangent_x, nearer.tangent_parameter))
    theta = find_root(lambda t: event.value(point_on(segment, t, OPTIONS)[0]), (0.0, first), (1.0, last), 1e-8)
    point, _ = point_on(segment, theta, OPTIONS)
    return Place(problem, point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
