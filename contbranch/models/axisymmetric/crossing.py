"""Where a traced curve meets a value of load, displacement, spring position or contact radius."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import Metric, find_root
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on
from contbranch.control import Control
from contbranch.diagram import State

from .locate import OPTIONS, SAFETY, Place, Values, refine
from .problem import ControlReached
from .profile import profile_of
from .trace import Traced

__all__ = ["Crossing", "control_values", "cross", "cross_before", "pieces_at", "state_at"]

Array = NDArray[np.float64]

# Rounding of an energy, relative to max(1, |value|).
ROUNDING = 1e-13


@dataclass(frozen=True)
class Crossing:
    """A state on the curve: between which rows it lies, its values and the place on the mesh that gave them."""

    piece: int
    values: Values
    place: Place

    @property
    def position(self) -> float:
        """Coordinate along the curve where the parameter is monotone: its contact parameter u."""
        return self.place.u


def control_values(traced: Traced, control: Control) -> Array:
    """What is controlled at every row, (M,)."""
    curve = traced.curve
    if control.kind == "spring":
        return curve.displacement + curve.load / control.stiffness
    return curve.load if control.kind == "load" else curve.displacement


def pieces_at(reached: Array, value: float) -> list[int]:
    """Pieces of the curve (between rows i and i + 1) on which a quantity, monotone on each, passes a value."""
    low, high = np.minimum(reached[:-1], reached[1:]), np.maximum(reached[:-1], reached[1:])
    return [int(k) for k in np.flatnonzero((low < value) & (value <= high))]


def cross(traced: Traced, piece: int, control: Control | None, value: float, accuracy: float) -> Crossing:
    """The state between two rows at which a control, or without control the contact radius, has a value."""
    event = None if control is None else ControlReached(control, control.target(value))
    values, place = refine(_between(traced, piece, event, value), event, accuracy)
    return Crossing(piece, values, place)


def cross_before(traced: Traced, control: Control, value: float, accuracy: float) -> Crossing:
    """The state before the curve's first row, farther away, at a displacement or position of a spring."""
    event = ControlReached(control, control.target(value))
    point = traced.points[0]
    place = Place(traced.problem(0), point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
    values, place = refine(place, event, accuracy)
    return Crossing(0, values, place)


def state_at(traced: Traced, crossing: Crossing, given: dict[str, float] | None = None) -> State:
    """The state of a crossing in reduced units; `given` are observables known exactly, since they were asked for."""
    values, place, piece, indices = crossing.values, crossing.place, crossing.piece, traced.indices
    keys = ("load", "displacement", "contact_radius", "central_gap")
    known = given or {}
    numbers = {**dict(zip(keys, values.numbers, strict=True)), **known}
    errors = {**dict(zip(keys, values.error, strict=True)), **dict.fromkeys(known, 0.0)}
    fields = place.problem.fields(place.x, place.u)
    energy, errors["energy"] = energy_at(crossing)
    return State(
        **numbers,
        energy=energy,
        unstable_load=int(indices.load_pieces[piece]),
        unstable_displacement=int(indices.displacement_pieces[piece]),
        unstable_spring=int(indices.spring_pieces[piece]) if len(traced.controls) > 2 else None,
        residual=float(np.abs(fields.residual).max() / max(1e-300, np.abs(fields.h).max())) if fields.h.any() else 0.0,
        error=errors,
        profile=profile_of(place.problem.equations, fields),
    )


def energy_at(crossing: Crossing) -> tuple[float, float]:
    """Energy V_ela + V_fr of a state and its error estimate, from the same contact coordinate on the finer mesh.

    The change of V − F d is of second order in what is wrong with the state; the rest of the error of V is F times
    that of the displacement.
    """
    place, values = crossing.place, crossing.values
    problem = place.problem
    fields = problem.fields(place.x, place.u)
    finer, x = problem.on(problem.equations.mesh.finer, place.x, place.u)
    fine = finer.fields(x, place.u)
    energy = problem.equations.energy(fields)
    change = finer.equations.energy(fine) - energy
    change -= values.load * (finer.equations.displacement(fine) - problem.equations.displacement(fields))
    error = SAFETY * abs(change) + abs(values.load) * values.error[1] + ROUNDING * max(1.0, abs(energy))
    return energy, error


def _between(traced: Traced, piece: int, event: ControlReached | None, value: float) -> Place:
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
