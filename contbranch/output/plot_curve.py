"""Smooth lines: a branch turns round at its folds and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from contbranch.arrays import AnyArray, Array, Flags, Integers
from contbranch.output.smooth import smooth
from contbranch.results.diagram import Branch, Diagram, Event

Columns = dict[str, Array]

COORDINATES = ("load", "displacement", "contact_radius", "central_gap", "energy")
OF_SPRINGS = ("piezo", "deflection")
AREA = "contact_area"

_FINE = 24  # points drawn for each step of the trace


class Line(NamedTuple):
    """A finely drawn branch.

    Attributes
    ----------
    columns : dict of array (M,)
        Every observable.
    step : array (M,)
        The step of the curve a point lies on; the last point of a step is the first of the next, once each.
    position : array (M,)
        Position on the branch in units of its points.
    stable : array (number of steps,)
        Whether a step is stable under the diagram's control.
    """

    columns: Columns
    step: Integers
    position: Array
    stable: Flags


class Piece(NamedTuple):
    """A part of a line with one stability: coordinates (M,) and whether it is stable."""

    x: Array
    y: Array
    stable: bool


def smooth_line(diagram: Diagram, number: int) -> Line:
    """Return branch `number` with located folds and touches inserted and its steps filled in.

    The trace takes long steps where the curve is smooth. Load and displacement are joined by cubic splines of the
    contact radius where that grows; otherwise they, and the contact coordinate (a², or minus the central gap), by
    splines of the arc length between one touch and the next. Between two events all of them are monotonic, and so are
    the cubics.
    """
    branch = diagram.branches[number]
    events = [e for e in diagram.events if e.branch == number and e.kind in ("fold", "touch")]
    knots, position, unstable, touches = _knots(diagram, branch, events)
    if len(position) < 2:
        knots[AREA] = np.pi * knots["contact_radius"] ** 2
        return Line(knots, np.zeros(len(position), dtype=np.int64), position, np.zeros(0, dtype=bool))
    length = _arc_length(knots, events)
    steps = np.arange(len(position) - 1)
    fine = (steps[:, None] + np.arange(_FINE) / _FINE).ravel()
    fine = np.append(fine, len(position) - 1.0)
    at = np.interp(fine, np.arange(len(position)), length)
    columns = {name: np.interp(fine, np.arange(len(position)), knots[name]) for name in COORDINATES}
    for start, stop in pairwise([0, *touches, len(position) - 1]):
        here = (fine >= start) & (fine <= stop)
        part = slice(start, stop + 1)
        radii = knots["contact_radius"][part]
        grows = bool((np.diff(radii) > 0.0).all())
        along, places = (radii, columns["contact_radius"][here]) if grows else (length[part], at[here])
        # Behind first touch all rest as the square of the radius does: they are the same on its other side.
        other = slice(2, 0, -1) if grows and radii[0] == 0.0 else slice(0)
        for name in ("load", "displacement", "energy"):
            own = knots[name][part]
            columns[name][here] = smooth(np.append(-along[other], along), np.append(own[other], own), places)
        if grows:
            continue
        columns["contact_radius"][here] = np.sqrt(np.maximum(smooth(length[part], radii**2, at[here]), 0.0))
        gaps = knots["central_gap"][part]
        columns["central_gap"][here] = np.maximum(smooth(length[part], gaps, at[here]), gaps.min())
    columns[AREA] = np.pi * columns["contact_radius"] ** 2
    if diagram.stiffness:
        columns["deflection"] = columns["load"] / diagram.stiffness
        columns["piezo"] = columns["displacement"] + columns["deflection"]
    step = np.minimum(fine.astype(np.int64), len(steps) - 1)
    return Line(columns, step, np.interp(fine, np.arange(len(position)), position), _stability(unstable))


def observable(source: Any, name: str, stiffness: float | None) -> Any:
    """An observable of an event, a state or a path."""
    if name == AREA:
        return np.pi * source.contact_radius**2
    if name in OF_SPRINGS:
        deflection = source.load / (stiffness or np.inf)
        return deflection if name == "deflection" else source.displacement + deflection
    return getattr(source, name)


def coordinate(diagram: Diagram, event: Event, name: str) -> float:
    """An observable at an event: its energy, too, by dV = F dd from the points beside it."""
    if name != "energy":
        return float(observable(event, name, diagram.stiffness))
    branch = diagram.branches[event.branch]
    beside = np.clip([int(event.position), int(event.position) + 1], 0, len(branch) - 1)
    work = 0.5 * (event.load + branch.load[beside]) * (event.displacement - branch.displacement[beside])
    return float(np.interp(event.position, beside, branch.energy[beside] + work))


def pieces(line: Line, x: str, y: str) -> list[Piece]:
    """Return the parts of a line between changes of stability; each starts where the one before ends."""
    found = []
    cuts = [0, *(np.flatnonzero(line.stable[1:] != line.stable[:-1]) + 1).tolist(), len(line.stable)]
    for start, stop in pairwise(cuts):
        if stop > start:
            part = slice(start * _FINE, stop * _FINE + 1)
            found.append(Piece(line.columns[x][part], line.columns[y][part], bool(line.stable[start])))
    return found


def _knots(diagram: Diagram, branch: Branch, events: list[Event]) -> tuple[Columns, Array, Integers, list[int]]:
    """Return points and events in order: columns, positions, unstable modes and the indices of touches.

    Unstable modes are -1 at a fold of the diagram's control and -2 at other events. Points that are events themselves,
    and points that are not finite, are left out.
    """
    rows = np.arange(len(branch), dtype=float)
    keep = np.isfinite([getattr(branch, name) for name in COORDINATES[:4]]).all(axis=0)
    for event in events:
        keep &= np.abs(rows - event.position) > 1e-6
    order = np.argsort(np.append(rows[keep], [event.position for event in events]), kind="stable")

    def merged(of_rows: AnyArray, of_events: Sequence[float]) -> AnyArray:
        return np.append(of_rows[keep], np.array(of_events, dtype=of_rows.dtype))[order]

    flags = [-1 if e.kind == "fold" and e.control == diagram.control else -2 for e in events]
    unstable = merged(np.asarray(branch.unstable(diagram.control), dtype=np.int64), flags)
    columns = {
        name: merged(getattr(branch, name), [coordinate(diagram, e, name) for e in events]) for name in COORDINATES
    }
    touches = merged(np.zeros(len(branch)), [e.kind == "touch" for e in events])
    return columns, merged(rows, [e.position for e in events]), unstable, np.flatnonzero(touches).tolist()


def _arc_length(knots: Columns, events: list[Event]) -> Array:
    """Return the length along the curve at its knots, in the plane of load and displacement scaled by their extent."""
    steps = np.zeros(len(knots["load"]) - 1)
    for name in ("load", "displacement", "contact_radius"):
        values = [getattr(e, name) for e in events] or knots[name].tolist()
        extent = (max(values) - min(values)) or float(np.ptp(knots[name])) or 1.0
        steps = np.hypot(steps, np.diff(knots[name]) / extent)
    return np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-12 * (1.0 + np.sum(steps))))])


def _stability(unstable: Integers) -> Flags:
    """Return for each step (M - 1,) whether it is stable, from the unstable modes of the M knots."""
    stable = np.zeros(len(unstable) - 1, dtype=bool)
    for i in range(len(stable)):
        known = [n == 0 for n in unstable[i : i + 2] if n >= 0]
        if known:
            stable[i] = all(known)
        elif i > 0:  # between two events inside one step: a fold turns stability over, a touch keeps it
            stable[i] = not stable[i - 1] if unstable[i] == -1 else stable[i - 1]
    return stable
