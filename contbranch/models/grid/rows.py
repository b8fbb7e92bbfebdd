"""Rows of a curve on a lattice: what was read off a state, the state itself as far as memory allows, and events."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from contbranch.contact.height_map import HeightMap
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.angle import Hodograph, Turning, in_passing
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import Profile

from .arrays import Array, Mask
from .contact_area import contact_area
from .folds import Refined
from .newton import Equilibrium, Settings, control_held, newton
from .observables import central_gap, far_field, profile, smallest_gap
from .problem import GridProblem
from .resolution import tail_force
from .setup import Setup
from .walk import Direction, Track

__all__ = ["Mark", "Reading", "Row", "crossing", "deferred_profile", "difference", "morse_indices", "read", "state_at"]


class Reading(NamedTuple):
    """The observables of a state, reduced units, with the errors that reading them off the nodes adds.

    The gap at the apex may have closed where no node is in contact yet; it is then zero.
    """

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float
    radius_error: float = 0.0
    gap_error: float = 0.0
    load_error: float = 0.0
    displacement_error: float = 0.0

    @property
    def four(self) -> tuple[float, float, float, float]:
        """Load, displacement, contact radius and central gap."""
        return self.load, self.displacement, self.contact_radius, self.central_gap

    @property
    def errors(self) -> tuple[float, float, float, float]:
        """Their errors."""
        return self.load_error, self.displacement_error, self.radius_error, self.gap_error


def read(setup: Setup, state: Equilibrium, cell: bool = True) -> Reading:
    """Read the observables off a state.

    Parameters
    ----------
    cell : bool
        Whether errors of the finite cell are wanted: what a free cell leaves out, and in a periodic cell what the
        displacement's shift leaves to be desired.
    """
    problem = setup.problem
    energy = problem.total_energy(state.fields)
    load_error = displacement_error = 0.0
    if cell and setup.lattice.kind == "free":
        load_error = tail_force(setup, state)
        # A ring of force at the border moves what is inside by as much as a point force there, twice over to be safe.
        displacement_error = 4.0 * load_error / (math.pi * setup.edge)
    elif cell and not setup.crowded:
        displacement_error = far_field(problem, state).error
    radius = gap = radius_error = gap_error = 0.0
    if state.contact.any():
        area = contact_area(problem, state)
        radius, radius_error = area.radius, area.radius_error
    elif isinstance(setup.contact.tip, HeightMap):
        gap = smallest_gap(state)
    else:
        centre = central_gap(problem, state)
        gap, gap_error = centre.value, centre.error
        if gap == 0.0:
            radius_error = setup.lattice.spacing  # a contact so small that it has no node
    seen = state.load, state.displacement, radius, gap, energy
    return Reading(*seen, radius_error, gap_error, load_error, displacement_error)


@dataclass(eq=False)
class Row:
    """A point of the curve: what was read off it, and its state as far as memory allows."""

    arc: float
    reading: Reading
    pairs: int
    load: float
    u: Array | None = field(default=None, repr=False)
    contact: Mask | None = field(default=None, repr=False)
    mark: Mark | None = None
    averaged: bool = False

    def state(self, problem: GridProblem) -> Equilibrium | None:
        """The equilibrium, if its fields were kept."""
        if self.u is None or self.contact is None:
            return None
        return Equilibrium(problem.fields(self.u, self.load), self.contact, 0.0, self.reading.displacement, True)


@dataclass
class Mark:
    """An event at a row."""

    kind: Literal["fold", "touch", "end"]
    control: Control | None = None
    maximum: bool = False
    refined: Refined | None = None
    shift: Array | None = None
    message: str = ""
    around: tuple[Equilibrium, Equilibrium, Equilibrium] | None = field(default=None, repr=False)
    unresolved: bool = False
    errors: Array | None = None
    potential: float = 0.0


def difference(one: Reading, other: Reading) -> Array:
    """Changes of load, displacement, contact radius and central gap."""
    return np.subtract(one.four, other.four)


def morse_indices(
    count: int,
    folds: Sequence[tuple[int, str]],
    rates: Sequence[float],
    start: int = 0,
    controls: Sequence[Control] = (LOAD, DISPLACEMENT),
    one: Callable[[int, int], bool] = lambda row, other: False,
) -> Hodograph:
    """Morse indices under all controls by counting folds along a curve.

    Folds of load and displacement can lie in one corner of the curve, where both turn round with one step of the
    contact. Their order is then chance, and decides whether the index under displacement control rises or falls there:
    it falls where there is one to lose.

    Parameters
    ----------
    count : int
        Number of rows.
    folds : sequence of (row, kind of control)
    rates : two floats
        Changes of load and displacement where the curve starts.
    start : int
        Index under displacement control there.
    controls : sequence of Control
    one : callable
        Whether two rows are one state.
    """
    if count < 2:
        return Hodograph.empty()
    turning, index, left = Turning(controls), start, list(folds)
    turning.begin(*(rate or 1.0 for rate in rates))
    known: dict[str, Control] = {control.kind: control for control in controls}
    for k, (row, kind) in enumerate(left):
        other = left[k + 1] if k + 1 < len(left) else (row, kind)
        if {kind, other[1]} == {"load", "displacement"} and one(row, other[0]):
            ahead = math.atan2(turning.signs["load"], turning.signs["displacement"])
            order = in_passing((LOAD, DISPLACEMENT), ahead, math.pi if index > 0 else -math.pi)
            kind, left[k + 1] = order[0].kind, (row, order[1].kind)
        if kind == "displacement":
            index += 1 if turning.clockwise(DISPLACEMENT) else -1
        turning.fold(known[kind])
    turning.end()
    return Hodograph(np.repeat(turning.angles, np.diff([0, *(row for row, _ in left), count - 1])), start)


def deferred_profile(setup: Setup, row: Row) -> Callable[[], Profile]:
    """The profile of a row, computed when it is asked for."""

    def made() -> Profile:
        state = row.state(setup.problem)
        if state is None:
            raise InputError("state: its fields were given up to save memory; solve for it with near=")
        return profile(setup.problem, state)

    return made


def crossing(
    setup: Setup, rows: tuple[Row, Row], control: Control, value: float, settings: Settings
) -> Equilibrium | None:
    """The equilibrium between two rows at a value of the control: from the nearer end, within the bracket."""
    problem = setup.problem
    hold = control_held(problem, control, value)
    begin, end = (state_at(problem, row) for row in rows)
    values = [control.value(*row.reading[:2]) for row in rows]
    share = (value - values[0]) / (values[1] - values[0])
    u, load = begin.u + share * (end.u - begin.u), begin.load + share * (end.load - begin.load)
    contact = begin.contact if share < 0.5 else end.contact
    found = newton(problem, np.where(contact, -problem.heights, u), load, hold, contact, settings)
    if found.converged and all(row.averaged for row in rows):
        return found  # the states of these rows lie beside the average
    way = Direction.between(begin, end, setup.length)
    bounds = way.of(begin), way.of(end)
    if found.converged and min(bounds) <= way.of(found) <= max(bounds):
        return found
    # Next to a fold Newton's method leaves the bracket: the curve is followed within it.
    track = Track(problem, [begin, end], way, settings)
    # Soft there, it is known less well than the residual says.
    sharp = replace(settings, tolerance=0.1 * settings.tolerance)
    for part in (1e-2, 1e-9):
        near = track.zero(lambda state: control.value(state.load, state.displacement) - value, *bounds, part)
        if near is not None:
            found = newton(problem, near.u, near.load, hold, near.contact, sharp)
            if found.converged and min(bounds) <= way.of(found) <= max(bounds):
                return found
    return None


def state_at(problem: GridProblem, row: Row) -> Equilibrium:
    """The equilibrium of a row whose fields were kept.

    Raises
    ------
    ModelError
        If they were not.
    """
    state = row.state(problem)
    if state is None:
        raise ModelError("the fields of a row were given up to save memory")
    return state
