"""Single equilibria of an axisymmetric contact: where the traced curve meets the value asked for."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.errors import InputError, ModelError
from contbranch.models.rings.solve import indices_on, state_between
from contbranch.results.diagram import State

from .crossing import Crossing, cross, cross_before, pieces_at, state_apart, state_at
from .search import disconnected
from .trace import Target, Traced, trace

__all__ = ["crossings", "find_all", "solve_all"]

Progress = Callable[[float, str], None]


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
    found, traced = crossings(contact, field, value, accuracy, progress, control)
    states = [state_at(traced, crossing, {field: value}) for crossing in found]
    states += states_beyond(traced, field, value, accuracy)
    if not states and not traced.curve.complete:
        raise ModelError(f"{field}: the curve ends before {value:.6g} is reached. {traced.curve.message}")
    return states, traced


def find_all(
    contact: Contact,
    field: str,
    value: float,
    accuracy: float,
    window: tuple[float, float] | None,
    progress: Progress | None = None,
    control: Control = LOAD,
) -> tuple[list[State], list[bool], tuple[float, float], Traced]:
    """Every equilibrium with a given load or displacement in a window of displacements, on the curve and off it.

    Parameters
    ----------
    window : (float, float) or None
        Displacements, reduced units; None: the traced range, and the displacement asked for.

    Returns
    -------
    states, connected, window, traced
        Which of the states lie on the traced curve, and the window used.
    """
    found, traced = crossings(contact, field, value, accuracy, progress, control)
    reached = traced.curve.displacement
    if window is None:
        window = (float(reached.min()), float(reached.max())) if len(reached) else (-math.inf, math.inf)
        if field == "displacement":  # farther away than the trace begins, too
            window = (min(window[0], value), max(window[1], value))
    held = LOAD if field == "load" else DISPLACEMENT
    others: list[Crossing] = []
    if len(traced.points) > 1 and contact.interaction is not None and traced.handed is None:
        others = disconnected(traced, found, held, value, accuracy)
    states, connected = [], []
    for crossings_here, on_curve in ((found, True), (others, False)):
        for crossing in crossings_here:
            if not window[0] <= (value if field == "displacement" else crossing.values.displacement) <= window[1]:
                continue
            given = {field: value}
            on = state_at(traced, crossing, given) if on_curve else state_apart(crossing, traced.controls, given)
            states.append(on)
            connected.append(on_curve)
    for state in states_beyond(traced, field, value, accuracy):
        if window[0] <= state.displacement <= window[1]:
            states.append(state)
            connected.append(True)
    return states, connected, window, traced


def crossings(
    contact: Contact,
    field: str,
    value: float,
    accuracy: float,
    progress: Progress | None = None,
    control: Control = LOAD,
) -> tuple[list[Crossing], Traced]:
    """Where the curve has a value, in order along it; arguments as for `solve_all`.

    Raises
    ------
    InputError
        If the value is out of range whatever the curve does.
    """
    if field == "contact_radius" and not 0 < value < contact.axisymmetric_tip.extent:
        raise InputError(f"contact_radius: {value:g}; must be greater than zero (and within the tip)")
    traced = trace(contact, accuracy, Target(), progress, events=False, control=control)
    reached = getattr(traced.curve, field)
    if traced.curve.complete and value > reached[-1]:
        target = _target(contact, field, value, traced)
        traced = trace(contact, accuracy, target, progress, events=False, control=control)
        reached = getattr(traced.curve, field)
    own = {"load": LOAD, "displacement": DISPLACEMENT}.get(field)
    found = []
    if field == "displacement" and len(reached) and value < reached[0]:
        found.append(cross_before(traced, DISPLACEMENT, value, accuracy))
    for piece in pieces_at(reached, value):
        if (field == "contact_radius" and reached[piece + 1] == 0) or _beyond(traced, piece):
            continue
        found.append(cross(traced, piece, own, value, accuracy))
    return found, traced


def _beyond(traced: Traced, piece: int) -> bool:
    """Whether a piece belongs to the model with free boundaries, see `Traced.handed`."""
    return traced.handed is not None and piece >= traced.handed


def states_beyond(traced: Traced, field: str, value: float, accuracy: float) -> list[State]:
    """The states with a value where the contact set is no disc any more."""
    reached, states = getattr(traced.curve, field), []
    for piece in pieces_at(reached, value):
        if not _beyond(traced, piece) or (field == "contact_radius" and reached[piece + 1] == 0):
            continue
        assert traced.handed is not None
        first = max(piece, traced.handed + 1)
        begin, end = traced.points[first], traced.points[first + 1]
        unstable = indices_on(traced.curve, traced.indices, piece)
        states.append(state_between(begin, end, unstable, field, value, accuracy))
    return states


def _target(contact: Contact, field: str, value: float, traced: Traced) -> Target:
    if field == "load":
        return Target(value * (1 + 1e-9))
    if field == "displacement":
        return Target(value + 1e-9 * abs(value), DISPLACEMENT)
    a, tip = np.float64(value), contact.axisymmetric_tip
    hertz = 2 * float(a * tip.transform(a) - tip.transform_integral(a))
    return Target(1.2 * (hertz + float(traced.curve.load[-1]) + 2 * math.pi))
