"""Where a followed curve meets a value of load, displacement, spring position or contact radius."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import CorrectionError, Point
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.events import Reached
from contbranch.curve.problem import Values, equilibrium, rates_of, values_of
from contbranch.curve.refine import Found, moved, numbers, refine, settled
from contbranch.curve.track import Track, between
from contbranch.errors import ModelError
from contbranch.results.diagram import State
from contbranch.results.record import OBSERVABLES
from contbranch.watch import finishing, kept

__all__ = ["CONTROLS", "Crossing", "before", "crossing", "crossings", "pieces_at", "state_apart", "state_on"]

# What may be asked for; a contact radius is no control.
CONTROLS: Mapping[str, Control | None] = {"load": LOAD, "displacement": DISPLACEMENT, "contact_radius": None}
# The finer discretisation that an energy is compared with has an error of its own; sums of energies round.
SAFETY = 3.0


@dataclass(frozen=True)
class Crossing:
    """A state and the piece of the curve it lies on; −1 for before the first row or off the curve."""

    piece: int
    found: Found


def pieces_at(reached: Array, value: float) -> list[int]:
    """Pieces of the curve (between rows i and i + 1) on which a quantity, monotone on each, passes a value.

    Where it rests it tells no states, and so not the one with which it begins to move or comes to rest.
    """
    low, high = np.minimum(reached[:-1], reached[1:]), np.maximum(reached[:-1], reached[1:])
    resting = reached[np.append(low == high, False) | np.append(False, low == high)]
    return [int(k) for k in np.flatnonzero((low < value) & (value <= high)) if value not in resting or value < high[k]]


def crossings(track: Track, field: str, value: float, accuracy: float) -> list[Crossing]:
    """Where the curve has a load, displacement or contact radius, in order along it; without contact there is none.

    If the computation is interrupted, those found so far.

    Raises
    ------
    ModelError
        If a state could not be found where the rows say there is one.
    """
    control, reached = CONTROLS[field], track.column(field)
    found: list[Crossing] = []

    def search() -> None:
        if len(reached) < 2:
            return
        if control is not None and _farther(control, value, float(reached[0])):
            first = before(track, control, value, accuracy)
            found.extend([] if first is None else [first])
        for k in pieces_at(reached, value):
            # Where a ring appears the radius jumps, and no state has what lies between.
            if control is not None or (reached[k + 1] > 0 and k not in track.gaps):
                found.append(crossing(track, k, control, value, accuracy))

    kept(search, None)
    return found


def _farther(control: Control, value: float, first: float) -> bool:
    """Whether a value lies on the way from infinite separation to the first row."""
    return value < first if control.kind != "load" else 0.0 <= value / first <= 1.0 if first else value == 0.0


def before(track: Track, control: Control, value: float, accuracy: float) -> Crossing | None:
    """The state before the first row, farther away, at a value of a control; None where there is none.

    Raises
    ------
    ModelError
        If it could not be found.
    """
    try:
        near = track.problem(0).before(control, value)
    except CorrectionError as error:
        raise ModelError(f"no state was found before the curve's first row {error.detail}") from error
    return None if near is None else Crossing(-1, refine(near, Reached(control, control.target(value)), accuracy))


def crossing(track: Track, piece: int, control: Control | None, value: float, accuracy: float) -> Crossing:
    """The state between two rows at which a control, or without control the contact radius, has a value.

    Raises
    ------
    ModelError
        If the curve cannot be followed there.
    """
    event = Reached(control, value if control is None else control.target(value))
    begin, end = track.onward.get(piece, track.points[piece]), track.points[piece + 1]
    try:
        nearest = [begin, end.turned()]
        with suppress(CorrectionError):  # of two rows that no piece joins: with the one whose problem has the state
            nearest = [between(track.link(piece), event)[1]]
        found = _refined(nearest, event, accuracy)
        if len(nearest) == 1:
            found += _refined(_beside(track, piece, event, found[0]), event, accuracy)
    except CorrectionError as error:
        name = "contact radius" if control is None else control.kind
        raise ModelError(
            f"no state was found on the curve at a {name} of {value:.6g} (reduced), where there is one: "
            f"ask for a hundredth of the accuracy. {error.detail}"
        ) from error
    return Crossing(piece, _decided(found, event) if len(found) > 1 else found[0])


def _refined(nearest: Sequence[Point], event: Reached, accuracy: float) -> list[Found]:
    """The states found from these points.

    Raises
    ------
    CorrectionError
        If from one there is none, and what was found from the others is none that its problem has.
    """
    found, last = [], None
    for near in nearest:
        try:
            found.append(refine(near, event, accuracy))
        except CorrectionError as error:
            last = error
    if last is not None and not any(_meets(one, event, one) for one in found):
        raise last
    return found


def _beside(track: Track, piece: int, event: Reached, found: Found) -> list[Point]:
    """Where a state may be next to a row at which one problem takes over from another, on either side: what problem it
    belongs to is no matter of rows that are less accurate."""
    own = equilibrium(found.point)
    edge = min(own.parameter_range, key=lambda one: abs(one - found.point.parameter))
    if _meets(found, event, found) and abs(edge - found.point.parameter) > found.parameter_error:
        return []
    row = min((piece, piece + 1), key=lambda k: abs(event.value(track.points[k])))
    if row not in track.onward or not 0 < row < len(track.points) - 1:
        return []
    before, here, after = (event.value(track.points[k]) for k in (row - 1, row, row + 1))
    if (here > before) != (after > here):  # a fold: there are two states
        return []
    return [track.points[row], track.onward[row]]


def _meets(found: Found, event: Reached, other: Found) -> bool:
    """Whether a state is one that its problem has, at the value asked for, within the errors of it or another one."""
    low, high = equilibrium(found.point).parameter_range
    error = other.error[2] if event.control is None else event.control.weighted(*other.error[:2])
    inside = low - found.parameter_error <= found.point.parameter <= high + found.parameter_error
    return inside and abs(event.value(found.point)) <= error


def _decided(found: Sequence[Found], event: Reached) -> Found:
    """Of states on both sides of a row that which there is, with errors that say what else there may be."""
    best = min(found, key=lambda one: (not _meets(one, event, one), one.relative_error()))
    error = np.array(best.error)
    for one in found:
        if _meets(one, event, best):
            off = np.abs(np.subtract(one.numbers, best.numbers))
            error = np.maximum(error, off + (np.array(one.error) if one is not best else 0.0))
            for length in (-one.parameter_error, one.parameter_error):  # what rests beyond first touch moves before it
                _, _, *there = numbers(replace(one.point, parameter=one.point.parameter + length))
                error[2:] = np.maximum(error[2:], np.abs(np.subtract(there, best.numbers[2:])))
    load, displacement, radius, gap = error.tolist()
    return replace(best, error=(load, displacement, radius, gap))


def state_on(track: Track, crossing: Crossing, given: Mapping[str, float] | None = None) -> State:
    """The state of a crossing, reduced units; `given` are observables known exactly, since they were asked for."""
    piece = max(crossing.piece, 0)
    indices = [int(track.hodograph.pieces(control)[0][piece]) for control in track.controls]
    return _state(crossing.found, indices, given or {})


def state_apart(found: Found, controls: Sequence[Control], given: Mapping[str, float] | None = None) -> State:
    """The same for a state off the curve: its Morse indices by inertia and by the slope dF/dd."""
    point = found.point
    held = equilibrium(point).unstable(point.x, point.parameter)
    load, displacement, *_ = rates_of(point)
    # Freeing the displacement makes one direction more unstable where dF/dd + K < 0.
    freed = [control.weighted(load, displacement) * displacement < 0 for control in controls]
    return _state(found, [held + int(more) for more in freed], given or {})


@finishing()
def _state(found: Found, indices: Sequence[int], given: Mapping[str, float]) -> State:
    point = found.point
    problem, state, p = equilibrium(point), point.x, point.parameter
    pairs = zip(OBSERVABLES, found.numbers, strict=True)
    load, displacement, radius, gap = (given.get(name, value) for name, value in pairs)
    error = dict(zip(OBSERVABLES, found.error, strict=True)) | dict.fromkeys(given, 0.0)
    energy, uncertain = energy_at(found)
    error["energy"] = uncertain + abs(found.numbers[0]) * found.error[1] + problem.energy_left_out(state, p)
    size = float(np.abs(state).max(initial=0.0))
    azimuthal = problem.azimuthal(state, p, indices[1])
    return State(
        load,
        displacement,
        radius,
        gap,
        energy,
        unstable_load=indices[0],
        unstable_displacement=indices[1],
        unstable_spring=indices[2] if len(indices) > 2 else None,
        residual=float(np.abs(problem.residual(state, p)).max() / size) if size else 0.0,
        error=error,
        profile=problem.profile(state, p),
        unstable_azimuthal=0 if azimuthal is None else azimuthal.total,
        **problem.described(state, p),
    )


def energy_at(found: Found) -> tuple[float, float]:
    """Energy V_ela + V_fr of a state, and the error estimate of V − F d at its load.

    The latter is stationary at equilibrium, so it does not matter which state of the finer discretisation next to it is
    compared; the rest of the error of V is F times that of the displacement.
    """
    point = found.point
    problem = equilibrium(point)
    here = values_of(point)
    rounding = SAFETY * problem.rounding * max(1.0, abs(here.energy))
    rounding += problem.energy_scatter(point.x, point.parameter)
    finer = problem.compared()
    if finer is problem:
        return here.energy, rounding
    try:
        fine = settled(moved(point, finer))
    except CorrectionError:
        return here.energy, abs(here.load) * found.error[1] + abs(here.displacement) * found.error[0]
    there = finer.values(fine.x, fine.parameter)
    change = there.energy - here.energy - here.load * (there.displacement - here.displacement)
    # What was given is compared with something coarser, whose error is the larger one.
    return here.energy, (SAFETY if problem.refinable else 1.0) * abs(change) + rounding


def seen(point: Point) -> State:
    """A point of the curve as a state without profile and indices, as a path shows it."""
    own = point.observables or values_of(point)._asdict()
    load, displacement, radius, gap, energy = (own[name] for name in Values._fields)
    return State(load, displacement, radius, max(gap, 0.0), energy, 0, 0, 0.0)
