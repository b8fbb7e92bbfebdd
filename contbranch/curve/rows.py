"""A followed curve as a result: its rows with error estimates and indices, its events made precise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.contact.units import COARSEST
from contbranch.continuation import CorrectionError, Event, Point
from contbranch.continuation.walk import annotated
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.events import FoldEvent, Margin, Reached
from contbranch.curve.exponents import critical_exponent, sampled_exponent
from contbranch.curve.outcome import RawCurve, RawEvent, no_curve
from contbranch.curve.problem import Values, equilibrium, rates_of
from contbranch.curve.refine import Found, by_defect, moved, numbers, refine, settled
from contbranch.curve.symmetry import Breaking, critical_eigenvalues, has_modes, merged, symmetry_breaking
from contbranch.curve.trace import Request
from contbranch.curve.track import Mark, Track
from contbranch.results.diagram import Branch
from contbranch.results.profile import CellFields
from contbranch.results.record import later
from contbranch.threads import one_thread
from contbranch.watch import finishing, kept, over, tell

__all__ = ["raw_curve"]

CONE = "Exactly at first touch admissible variations form a cone, not a space: the indices are those of both sides."
# A fold where a ring opens is at the opening if they differ by less than errors and this multiple of the accuracy.
OPENING_ERRORS = 10.0
# Accuracy at which neighbouring folds that their errors do not tell apart are located once more.
SHARPEST = 1e-12


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of a law outside of where it was followed
def raw_curve(track: Track, request: Request) -> RawCurve:
    """Rows and events of a curve; without ``request.events``, rows alone."""
    if not track.points:
        return no_curve(track.message, track.work.cost(), track.work.unknowns)
    problem, found = track.problem(0), _refined(track, request) if request.events else []
    unstable = {control: track.hodograph.rows(control) for control in track.controls}
    with finishing():
        pairs = _distinct_folds(track, list(zip(track.marks, found, strict=bool(found))), unstable)
        placed = _placed(track, pairs)
        events = problem.judged([_event(track, *pair) for pair in pairs], track.points, track.controls)
    breaking = Breaking()
    if request.events and request.modes:
        breaking = kept(lambda: symmetry_breaking(track, request), breaking)
    events = merged(events, breaking.events)
    complete, messages = track.complete, [track.message, breaking.message]
    complete &= (breaking.complete or not problem.refinable) and not over()
    contradicted = kept(lambda: _contradicted(track), None) if complete else None
    if contradicted is not None:
        complete = False
        messages.append(_disagreement(contradicted))
    doubtful = contradicted is not None and not over()
    worst = max((event.relative_error() for event in events), default=0.0)
    if over():  # nothing more is computed of it, now or when it is asked for
        events = [replace(event, exponent=None, local_exponent=None) for event in events]
    elif problem.refinable and not worst <= request.accuracy:
        complete = False
        messages.append(_inaccurate(worst, request.accuracy))
    return RawCurve(
        _branch(placed, unstable, breaking),
        events,
        complete,
        " ".join(filter(None, messages)),
        track.work.cost(),
        track.work.unknowns,
        doubtful,
    )


def _inaccurate(worst: float, accuracy: float) -> str:
    """A sentence about the largest error of an event, which is above the accuracy asked."""
    if not math.isfinite(worst):
        return "An event's error estimate is not known; the law, or the tip, has kinks there."
    reached = 10.0 ** math.ceil(math.log10(10.0 * worst))
    other = reached if reached <= COARSEST else 0.01 * accuracy
    return f"An event's error estimate is {worst / accuracy:.3g} times the accuracy asked; ask for {other:.0e}."


def _branch(track: Track, unstable: Mapping[Control, Integers], breaking: Breaking) -> Branch:
    """The rows as a branch of a diagram, in reduced units."""
    points = track.points

    @cache
    def errors() -> Array:
        return np.full((len(points), 2), np.inf) if ended else _row_errors(points)

    ended = over()
    columns: dict[str, Any] = {name: track.column(name) for name in Values._fields}
    columns["central_gap"] = np.maximum(columns["central_gap"], equilibrium(points[0]).wall_gap)
    if "perimeter" in points[0].observables:  # on the nodes of a lattice
        pairs, rim = ([p.observables.get(name, 0.0) for p in points] for name in ("fft_pairs", "perimeter"))
        columns |= {
            "cells": [partial(_cell, point) for point in points],
            "fft_pairs": np.array(pairs, dtype=np.int64),
            "contact_area": np.pi * columns["contact_radius"] ** 2,
            "contact_perimeter": np.array(rim),
            **{name: track.column(name) for name in ("mean_gap", "cell_energy") if name in points[0].observables},
        }
    examined = bool(breaking.counts)
    has_eigenvalues = examined and has_modes(track) and track.problem(0).refinable
    return Branch(
        **columns,
        unstable_load=unstable[LOAD],
        unstable_displacement=unstable[DISPLACEMENT],
        load_error=later(one_thread(lambda: errors()[:, 0])),
        displacement_error=later(one_thread(lambda: errors()[:, 1])),
        profiles=[partial(equilibrium(point).profile, point.x, point.parameter) for point in points],
        unstable_spring=unstable[track.controls[2]] if len(track.controls) > 2 else None,
        unstable_azimuthal=breaking.unstable if examined else None,
        critical_eigenvalue=later(one_thread(lambda: critical_eigenvalues(points))) if has_eigenvalues else None,
    )


def _placed(track: Track, pairs: Sequence[tuple[Mark, Found]]) -> Track:
    """The track with its events as rows: as they were traced, they are those of other discretisations.

    Far away these may differ by more than a step; then the rows stay in their order as they are.
    """
    points = list(track.points)
    for mark, found in pairs:
        row, fold = track.points[mark.row], mark.control is not None
        same = found.point.problem is row.problem and np.array_equal(found.point.x, row.x)
        if same or (fold and mark.row in track.onward):
            continue
        placed = annotated(found.point)
        near = track.points[max(mark.row - 1, 0) : mark.row + 2]
        if not fold or (_is_ahead(near[0], near[0], placed) and _is_ahead(near[-1], placed, near[-1])):
            points[mark.row] = placed
    return replace(track, points=tuple(points))


def _is_ahead(along: Point, begin: Point, end: Point) -> bool:
    """Whether one state is ahead of another in the direction in which the curve passes a row."""
    pairs = zip(rates_of(along), numbers(begin), numbers(end), strict=True)
    return sum(rate * (b - a) / max(1.0, abs(a), abs(b)) ** 2 for rate, a, b in pairs) >= 0.0


def _contradicted(track: Track) -> Point | None:
    """A row whose Morse index under displacement control, by inertia, is not what the folds say."""
    held = track.hodograph.rows(DISPLACEMENT)
    folds = [mark.row for mark in track.marks if mark.kind == "fold"]

    def agrees(row: int) -> bool:
        point = track.points[row]
        for problem in dict.fromkeys((equilibrium(point), equilibrium(point).finer())):
            try:  # a mode that all but rests is told by the finer discretisation
                here = point if problem is point.problem else settled(moved(point, problem))
            except CorrectionError:
                return False
            if problem.unstable(here.x, here.parameter) == held[row]:
                return True
        return False

    for group in track.problem(0).counted_rows(folds, len(track.points) - 1):
        rows = [row for row in group if track.problem(row).countable]
        if rows and not any(map(agrees, rows)):
            return track.points[rows[0]]
    return None


def _disagreement(point: Point) -> str:
    load, displacement = point.observables["load"], point.observables["displacement"]
    finer = "for a hundredth of the accuracy" if equilibrium(point).refinable else "for a finer grid"
    return (
        f"At load {load:.6g}, displacement {displacement:.6g} (reduced) the inertia finds another "
        f"number of unstable modes than the folds say: a fold was missed, or is none; ask {finer}."
    )


# -- events -----------------------------------------------------------------------------------------------------------
def _refined(track: Track, request: Request) -> list[Found]:
    """The marks made precise."""
    found: list[Found] = []

    def locate() -> None:
        opening: Found | None = None
        for k, mark in enumerate(track.marks):
            tell(0.9 + 0.07 * k / len(track.marks), f"locating {mark.kind}")
            own = _located(track, mark.point, _event_of(track, mark), request.accuracy)
            if mark.control is not None and mark.row in track.onward:
                own = _in_corner_of_touch(track, mark, own, request.accuracy)
            if mark.control is None or opening is None or not _is_at_opening(opening, own, request.accuracy):
                opening = own if mark.kind == "topology" else None
            found.append(opening or own)

    kept(locate, None)
    with finishing():  # what was not reached is where the rows have it
        return found + [by_defect(mark.point) for mark in track.marks[len(found) :]]


def _is_at_opening(opening: Found, fold: Found, accuracy: float) -> bool:
    """Whether a fold is where a ring opens before it: load and displacement rest there, and do not tell its place."""
    errors = np.add(fold.error, opening.error)
    allowed = OPENING_ERRORS * accuracy * np.maximum(1.0, np.abs(fold.numbers))
    apart = np.abs(np.subtract(fold.numbers, opening.numbers)) > np.minimum(errors, allowed)
    return not apart[:2].any()


def _located(track: Track, point: Point, event: Event | None, accuracy: float) -> Found:
    """An event made precise.

    One that finer discretisations find beyond an end of its problem is at that end, unless the curve begins there.
    """
    found = refine(point, event, accuracy)
    place, (low, high) = found.point.parameter, equilibrium(found.point).parameter_range
    begins = place < low == track.points[0].parameter
    if not (low <= place <= high or begins) and equilibrium(point).refinable:
        edge = min(max(place, low), high)
        return refine(replace(found.point, parameter=edge, observables={}), None, accuracy)
    return found


def _in_corner_of_touch(track: Track, mark: Mark, corner: Found, accuracy: float) -> Found:
    """A fold in the corner of first touch: it lies between there and the first row of the contact, or before.

    The stiffness of a contact begins with its radius: what the film loses is made up for behind the touch. Where loads
    differ by less than the error of rows, a fold of the film may seem to lie at its end.
    """
    ahead, here = track.onward[mark.row], mark.point.observables
    if mark.control is None or not equilibrium(ahead).refinable or max(here["contact_radius"], here["central_gap"]) > 0:
        return corner
    first, last = ahead.observables["contact_radius"], track.points[mark.row - 1].observables["central_gap"]
    for start in (ahead, mark.point) if first > 0.0 else (mark.point,):
        found = refine(start, FoldEvent(mark.control), accuracy)
        radius, gap = found.numbers[2:]
        if (0.0 < radius <= first or found.error[3] < gap < last) and found.relative_error() <= accuracy:
            return found
    load, displacement, radius, gap = corner.error
    return replace(corner, error=(load, displacement, max(radius, first), gap))


def _event_of(track: Track, mark: Mark) -> Event | None:
    """The function whose zero a mark is; None where the place is the edge of a parameter, or a corner."""
    if mark.control is not None:
        return None if mark.row in track.onward else FoldEvent(mark.control)
    if mark.kind == "end" and mark.name is None:
        return Reached(LOAD, mark.point.observables["load"])
    return Margin(mark.margin) if mark.margin else None


def _distinct_folds(
    track: Track, pairs: Sequence[tuple[Mark, Found]], unstable: Mapping[Control, Integers]
) -> list[tuple[Mark, Found]]:
    """The events but for neighbouring folds of one control that no number tells apart, however sharply located.

    They are rounding's: the Morse indices of the rows between them, `unstable`, become those on both sides.
    """
    distinct = list(pairs)
    for control in track.controls if track.problem(0).refinable else ():
        folds: list[tuple[Mark, Found]] = []
        for pair in pairs:
            if pair[0].control != control:
                continue
            if folds and _coincide(track, folds[-1], pair):
                before, rows = folds.pop(), unstable[control]
                first, last = before[0].row, pair[0].row
                rows[first : last + 1] = rows[max(first - 1, 0)]
                distinct = [one for one in distinct if one is not before and one is not pair]
            else:
                folds.append(pair)
    return distinct


def _coincide(track: Track, one: tuple[Mark, Found], other: tuple[Mark, Found]) -> bool:
    """Whether the errors of two folds leave open that they are one, at the accuracy asked and at the sharpest one."""
    if not _alike(one[1], other[1]):
        return False
    first, second = (_located(track, mark.point, _event_of(track, mark), SHARPEST) for mark, _ in (one, other))
    return _alike(first, second)


def _alike(first: Found, second: Found) -> bool:
    """Whether no number tells two events apart; what is not known tells nothing."""
    room = np.add(first.error, second.error)
    apart = np.abs(np.subtract(first.numbers, second.numbers)) > np.where(np.isfinite(room), room, 0.0)
    return not apart.any()


def _event(track: Track, mark: Mark, found: Found) -> RawEvent:
    event = RawEvent(
        **vars(found), kind=mark.kind, row=mark.row, margin=mark.margin, message=mark.message, name=mark.name
    )
    if mark.control is not None:
        control = mark.control
        in_corner = mark.row in track.onward
        film = in_corner and mark.point.observables["central_gap"] == 0.0 and found.numbers[3] > found.error[3]
        singular = (in_corner and not film) or track.problem(mark.row).cornered
        return replace(
            event,
            control=control.kind,
            stiffness=control.spring_stiffness,
            stable=bool(track.hodograph.rows(control)[mark.row] == 0),
            maximum=bool(track.hodograph.pieces(control)[1][max(mark.row - 1, 0)] > 0),
            position=mark.row - 0.5 if film else None,  # in the film before the touch
            exponent=None if singular else lambda: critical_exponent(found, control),
            local_exponent=None if singular else lambda: sampled_exponent(found, control),
        )
    if mark.kind == "touch":
        beyond = mark.row + (mark.row in track.gaps)  # where the contact there begins with a size of its own
        ahead = track.onward.get(mark.row, track.points[beyond])
        return replace(
            event,
            numbers=(*found.numbers[:3], 0.0),
            error=(*found.error[:3], 0.0),
            message=f"{mark.message} {CONE}".strip(),
            local_exponent=None if equilibrium(ahead).cornered else lambda: sampled_exponent(found, LOAD, ahead),
        )
    return event


# -- rows -------------------------------------------------------------------------------------------------------------
def _row_errors(points: Sequence[Point]) -> Array:
    """Error estimates of load and displacement, (M, 2).

    Differences between two discretisations have a sign, which changes along the curve: at its zeros they say nothing,
    the neighbouring rows of the same discretisation do.
    """
    rows = equilibrium(points[0]).error_rows(len(points))
    own = [_row_error(points[row]) for row in rows]
    found = np.zeros((len(points), 2))
    found[rows] = own
    for (a, first), (b, second) in pairwise(zip(rows, own, strict=True)):
        if b > a + 1 or (points[a].problem is points[b].problem and np.isfinite((first, second)).all()):
            found[a : b + 1] = np.maximum(found[a : b + 1], np.maximum(first, second))
    return found


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _row_error(point: Point) -> tuple[float, float]:
    try:
        load, displacement = equilibrium(point).row_error(point)
    except Exception:  # a user's law may raise anything, a finer discretisation may be too much: it is not known then
        return math.inf, math.inf
    return (load, displacement) if math.isfinite(load + displacement) else (math.inf, math.inf)


def _cell(point: Point) -> CellFields:
    found: CellFields = equilibrium(point).described(point.x, point.parameter)["in_cell"]()
    return found
