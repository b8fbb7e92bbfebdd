"""Rows and events of a journey with their error estimates."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Event, Point
from contbranch.control import LOAD, Control
from contbranch.curve.outcome import RawCurve, RawEvent
from contbranch.curve.stability import Indices, morse_indices
from contbranch.errors import ModelError
from contbranch.results.diagram import Cost, LocalExponent, Profile

from .accuracy import JUMP, Values, refine, ring_problem, row_error
from .journey import Journey, Mark
from .legs import FoldEvent, Reached, Violation, rates
from .profile import profile_of
from .stability import unstable_modes

__all__ = ["assembled", "deferred_profile", "row_errors"]

Array = NDArray[np.float64]

# Estimates of rows: one Newton step on finer panels, and the least as a share of the trace's tolerance.
ROW_SAFETY, ROW_FLOOR = 2.0, 1e-4
# Accuracy to which events are located where only their order is wanted.
TRACE_TOLERANCE = 1e-7
# An edge beyond this share of a tip's extent has reached its end.
NEAR_END = 0.95
CONE = "The Morse indices there are those of both sides: admissible variations form a cone."


def row_errors(points: Sequence[Point]) -> tuple[Array, Array]:
    """Error estimates of load and displacement at rows, (M,) each."""
    load, displacement = np.zeros(len(points)), np.zeros(len(points))
    for k, point in enumerate(points):
        floor = ROW_FLOOR * ring_problem(point).setting.tolerance + JUMP * ring_problem(point).layout.jumps
        own = point.observables
        try:
            found = row_error(point)
        except (CorrectionError, ModelError):
            found = (np.inf, np.inf, np.inf)
        load[k] = ROW_SAFETY * found[0] + floor * max(1.0, abs(own["load"]))
        displacement[k] = ROW_SAFETY * found[1] + floor * max(1.0, abs(own["displacement"]))
    return load, displacement


def rate(point: Point, control: Control) -> float:
    """Rate of what is controlled along the unit tangent."""
    return control.weighted(*rates(point))


def joined_folds(points: Sequence[Point], marks: Sequence[Mark], controls: Sequence[Control]) -> list[Mark]:
    """The marks, with folds added where a rate changes sign between two rows without one (at a change of layout)."""
    found = list(marks)
    for control in controls:
        own = {mark.row for mark in marks if mark.name == control.kind}
        sign = 0.0
        for row, point in enumerate(points):
            if row in own:
                sign = 0.0
                continue
            here = float(np.sign(rate(point, control)))
            if sign and here and here != sign:
                found.append(Mark(row, control.kind, point))
                sign = 0.0
                continue
            sign = here or sign
    return sorted(found, key=lambda mark: mark.row)


def assembled(journey: Journey, accuracy: float | None, start_index: int = 0) -> tuple[RawCurve, Indices]:
    """The curve of a journey; without accuracy its events are left out.

    Parameters
    ----------
    journey : Journey
    accuracy : float or None
        Error allowed to every event, relative to max(1, |value|).
    start_index : int
        Morse index under displacement control where the journey begins.
    """
    points, message = journey.points, journey.message
    if message and points:
        message = f"{message} {_end_of_tip(points[-1])}".strip()
    names = ("load", "displacement", "contact_radius", "central_gap", "energy")
    columns = {name: np.array([point.observables[name] for point in points]) for name in names}
    columns["central_gap"] = np.maximum(columns["central_gap"], 0.0)
    controls: dict[str, Control] = {control.kind: control for control in journey.controls}
    marks = joined_folds(points, journey.marks, journey.controls)
    rows = [mark.row for mark in marks]
    if accuracy is not None or len(set(rows)) < len(rows):  # without accuracy, the order of folds still matters
        found = [refine(mark.point, event_of(mark, controls), accuracy or TRACE_TOLERANCE) for mark in marks]
        marks = [replace(mark, point=point) for mark, (_, point) in zip(marks, found, strict=True)]
        marks, refined = _ordered(marks, [values for values, _ in found], points)
    if accuracy is None:
        refined = []
    folds = [(mark.row, mark.name) for mark in marks if mark.name in controls]
    first = [_first_sign(points, control) for control in journey.controls]
    pulling = first[2] if len(first) > 2 else None
    indices = morse_indices(len(points), folds, first[0], first[1], start_index, pulling)
    events = [_raw(mark, values, indices, points, controls) for mark, values in zip(marks, refined, strict=False)]
    worst = max((value.relative_error() / accuracy for value in refined if accuracy), default=0.0)
    if worst > 1 and not message:
        message = f"An event's error estimate is {worst:.3g} times the accuracy asked."
    if points and not message:
        last = points[-1]
        problem = ring_problem(last)
        if unstable_modes(problem, problem.fields(last.x, last.parameter)) != indices.displacement[-1]:
            message = "The inertia at the end disagrees with the folds counted: a fold was missed or doubled."
    load_error, displacement_error = row_errors(points)
    curve = RawCurve(
        load=columns["load"],
        displacement=columns["displacement"],
        contact_radius=columns["contact_radius"],
        central_gap=columns["central_gap"],
        energy=columns["energy"],
        unstable_load=indices.load if points else np.empty(0, dtype=np.int64),
        unstable_displacement=indices.displacement if points else np.empty(0, dtype=np.int64),
        load_error=load_error,
        displacement_error=displacement_error,
        profiles=[deferred_profile(point) for point in points],
        events=events,
        complete=not message,
        message=message,
        cost=Cost(0.0, 0),
        unknowns=0,
        unstable_spring=indices.spring if "spring" in controls else None,
        unstable_azimuthal=np.zeros(len(points), dtype=np.int64) if all(map(_convex, points)) else None,
        extra={"free_boundaries": True},
    )
    return curve, indices


def _convex(point: Point) -> bool:
    """Whether v″ ≥ 0 wherever the gap floats: then no mode of any symmetry is unstable; others are not examined."""
    return bool((ring_problem(point).fields(point.x, point.parameter).stiffness >= 0).all())


def _end_of_tip(point: Point) -> str:
    """A sentence if the contact has come to the end of a tip of finite extent."""
    problem = ring_problem(point)
    extent = problem.setting.tip.extent
    if not math.isfinite(extent) or not problem.edges or float(point.x[-1]) < NEAR_END * extent:
        return ""
    return "The contact, or the interaction around it, has reached the end of the tip."


def _ordered(
    marks: Sequence[Mark], values: Sequence[Values], points: Sequence[Point]
) -> tuple[list[Mark], list[Values]]:
    """Marks and values in order along the curve: those of one row by their distance from the row before."""

    def place(k: int) -> tuple[int, float]:
        row = marks[k].row
        if sum(mark.row == row for mark in marks) == 1 or row == 0:
            return row, 0.0
        own = points[row - 1].observables
        _, _, radius, gap = values[k].numbers
        return row, abs(radius - own["contact_radius"]) + abs(gap - max(own["central_gap"], 0.0))

    order = sorted(range(len(marks)), key=place)
    return [marks[k] for k in order], [values[k] for k in order]


def event_of(mark: Mark, controls: Mapping[str, Control]) -> Event:
    """The function whose zero a mark is."""
    if mark.name in controls:
        return FoldEvent(controls[mark.name], mark.name)
    if mark.name == "end":
        return Reached(LOAD, mark.point.observables["load"])
    return Violation()


def deferred_profile(point: Point) -> Callable[[], Profile]:
    """The profile of a row, computed when it is asked for."""

    def profile() -> Profile:
        problem = ring_problem(point)
        return profile_of(problem, problem.fields(point.x, point.parameter))

    return profile


def _first_sign(points: Sequence[Point], control: Control) -> int:
    return next((int(s) for point in points if (s := np.sign(rate(point, control)))), 1)


def _raw(
    mark: Mark, values: Values, indices: Indices, points: Sequence[Point], controls: Mapping[str, Control]
) -> RawEvent:
    event = RawEvent(mark.name, mark.row, values.numbers, values.error, point=mark.point)
    if mark.change is not None:
        onward = points[mark.row :]
        return replace(
            event,
            message=f"{mark.change.message} {CONE}",
            local_exponent=(lambda: _sampled(onward, values, LOAD)) if mark.name == "touch" else None,
        )
    if mark.name == "end":
        return event
    control = controls[mark.name]
    pieces, signs = indices.pieces(mark.name)
    before, after = max(mark.row - 1, 0), min(mark.row, len(pieces) - 1)
    return replace(
        event,
        kind="fold",
        control=mark.name,
        stiffness=control.spring_stiffness,
        before=int(pieces[before]),
        after=int(pieces[after]),
        maximum=bool(signs[before] > 0),
        local_exponent=lambda: _sampled(points[mark.row + 1 :], values, control),
    )


def _sampled(points: Sequence[Point], values: Values, control: Control) -> LocalExponent:
    """κ_local from true tangents at the rows beyond an event, as far as control and contact radius both grow.

    The order parameter is the outermost radius of the contact.
    """
    start, uncertain = control.value(*values.numbers[:2]), control.value(*values.error[:2])
    rows: list[tuple[float, float, float, float]] = []
    direction = 0.0
    for point in points:
        problem = ring_problem(point)
        fields = problem.fields(point.x, point.parameter)
        radius = problem.contact_radius(fields)
        own = point.observables
        excess = control.value(own["load"], own["displacement"]) - start
        moved = radius - values.numbers[2]
        if radius == 0.0 or excess == 0.0 or moved == 0.0:
            continue
        direction = direction or float(np.sign(excess))
        if excess * direction <= 0 or (rows and abs(excess) <= rows[-1][0]):
            break
        edge = int(np.flatnonzero(fields.grid.edges == radius)[0])
        radius_rate = float(point.tangent_x[fields.grid.size + edge])
        kappa = excess * radius_rate / (moved * control.value(*rates(point)))
        error = abs(kappa) * (uncertain / abs(excess) + values.error[2] / abs(moved))
        rows.append((abs(excess), abs(moved), kappa, error))
    table = np.array(rows).reshape(-1, 4)
    table = table[table[:, 3] < 0.5]
    return LocalExponent(table[:, 0], table[:, 1], table[:, 2], table[:, 3])
