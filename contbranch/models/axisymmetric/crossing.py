"""Where a traced curve meets a value of load, displacement, spring position or contact radius."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbranch.control import Control
from contbranch.results.diagram import State

from .azimuthal import counted
from .locate import SAFETY, Place, Values, refine
from .piece import piece_between, zero_between
from .problem import ContactProblem, ControlReached
from .profile import profile_of
from .trace import Traced

__all__ = ["Crossing", "control_values", "cross", "cross_before", "energy_at", "pieces_at", "state_apart", "state_at"]

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
    # Out there the tip feels next to nothing: its displacement is all but minus the gap, and the position is that, too.
    problem = traced.problem(0)
    u = problem.parameter(value)
    x = problem.solve_at(np.zeros(problem.equations.mesh.size), u)
    values, place = refine(Place(problem, x, u, problem.direction(x, u)), event, accuracy)
    return Crossing(0, values, place)


def state_at(traced: Traced, crossing: Crossing, given: dict[str, float] | None = None) -> State:
    """The state of a crossing in reduced units; `given` are observables known exactly, since they were asked for."""
    piece, indices = crossing.piece, traced.indices
    unstable = int(indices.load_pieces[piece]), int(indices.displacement_pieces[piece])
    spring = int(indices.spring_pieces[piece]) if len(traced.controls) > 2 else None
    return _state(crossing, (*unstable, spring), given)


def state_apart(crossing: Crossing, controls: Sequence[Control], given: dict[str, float] | None = None) -> State:
    """The same for a state that is not on the traced curve: its Morse indices by inertia and by the slope dF/dd."""
    place = crossing.place
    problem, fields = place.problem, place.problem.fields(place.x, place.u)
    held = problem.equations.unstable_modes(fields)
    load_rate, displacement_rate = problem.rates(place.x, place.u, *place.direction)

    def freed(control: Control) -> int:
        return held + int(control.weighted(load_rate, displacement_rate) * displacement_rate < 0)

    spring = freed(controls[2]) if len(controls) > 2 else None
    return _state(crossing, (freed(controls[0]), held, spring), given)


def _state(crossing: Crossing, unstable: tuple[int, int, int | None], given: dict[str, float] | None) -> State:
    values, place = crossing.values, crossing.place
    keys = ("load", "displacement", "contact_radius", "central_gap")
    known = given or {}
    numbers = {**dict(zip(keys, values.numbers, strict=True)), **known}
    errors = {**dict(zip(keys, values.error, strict=True)), **dict.fromkeys(known, 0.0)}
    fields = place.problem.fields(place.x, place.u)
    energy, potential_error = energy_at(crossing)
    errors["energy"] = potential_error + abs(values.load) * values.error[1]
    return State(
        load=numbers["load"],
        displacement=numbers["displacement"],
        contact_radius=numbers["contact_radius"],
        central_gap=numbers["central_gap"],
        energy=energy,
        unstable_load=unstable[0],
        unstable_displacement=unstable[1],
        unstable_spring=unstable[2],
        residual=float(np.abs(fields.residual).max() / max(1e-300, np.abs(fields.h).max())) if fields.h.any() else 0.0,
        error=errors,
        profile=profile_of(place.problem.equations, fields),
        unstable_azimuthal=counted(place.problem.equations, fields, unstable[1]).total,
    )


def energy_at(crossing: Crossing) -> tuple[float, float]:
    """Energy V_ela + V_fr of a state, and the error estimate of V − F d at its load.

    The latter is stationary along the curve, so it does not matter that the same contact coordinate is compared on the
    finer mesh; the rest of the error of V is F times that of the displacement.
    """
    place, values = crossing.place, crossing.values
    problem = place.problem
    fields = problem.fields(place.x, place.u)
    finer, x = problem.on(problem.equations.mesh.finer, place.x, place.u)
    fine = finer.fields(x, place.u)
    energy = problem.equations.energy(fields)
    change = finer.equations.energy(fine) - energy
    change -= values.load * (finer.equations.displacement(fine) - problem.equations.displacement(fields))
    error = SAFETY * abs(change) + ROUNDING * max(1.0, abs(energy))
    return energy, error


def _between(traced: Traced, piece: int, event: ControlReached | None, value: float) -> Place:
    """A place on the piece of curve between two rows: where the event vanishes, or with a given contact radius."""
    begin, end = piece_between(traced.points[piece], traced.points[piece + 1])
    if event is not None:
        return zero_between(begin, end, event)
    problem = begin.problem
    assert isinstance(problem, ContactProblem)
    u = problem.parameter(problem.equations.coordinate.of(value, 0.0))
    share = (u - begin.parameter) / (end.parameter - begin.parameter)
    x = problem.solve_at(begin.x + share * (end.x - begin.x), u)
    return Place(problem, x, u, problem.direction(x, u))
