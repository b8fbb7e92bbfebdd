"""A followed curve as a result: its rows with error estimates and indices, its events made precise."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.contact.units import COARSEST
from contbranch.continuation import CorrectionError, Event, Point
from contbranch.continuation.walk import annotated
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.events import Balanced, FoldEvent, Margin, Reached
from contbranch.curve.exponents import critical_exponent, sampled_exponent
from contbranch.curve.outcome import RawCurve, RawEvent, no_curve
from contbranch.curve.problem import equilibrium, rates_of
from contbranch.curve.refine import Found, at_parameter, by_defect, moved, numbers, refine, settled
from contbranch.curve.symmetry import Breaking, critical_eigenvalues, has_modes, merged, symmetry_breaking
from contbranch.curve.trace import Request
from contbranch.curve.track import Mark, Track
from contbranch.results.profile import CellFields, Profile
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
        events = [_event(track, mark, one) for mark, one in zip(track.marks, found, strict=False)]
        none = _pairs_of_rounding(track, found, unstable)
        events = [event for k, event in enumerate(events) if k not in none]
        events = problem.judged(events, track.points, track.controls)
        placed = _placed(track, found)
        found = [one for k, one in enumerate(found) if k not in none]
    breaking = Breaking()
    if request.events and request.modes:
        breaking = kept(lambda: symmetry_breaking(track, request), breaking)
    events = merged(events, breaking.events)
    complete, messages = track.complete, [track.message, breaking.message]
    complete &= (breaking.complete or not problem.refinable) and not over()
    wrong = kept(lambda: _contradicted(track), list[int]()) if complete else []
    if wrong:
        complete = False
        messages.append(_disagreement(track, wrong))
    broken = [Found(event.values, event.error, event.place) for event in breaking.events]
    doubtful = track.complete and bool(wrong) and not over()
    worst = float(np.max([one.relative_error() for one in (*found, *broken)], initial=0.0)) / request.accuracy
    if over():  # nothing more is computed of it, now or when it is asked for
        events = [replace(event, exponent=None, local_exponent=None) for event in events]
    elif problem.refinable and not worst <= 1.0:
        complete = False
        much = "is not known; the law, or the tip, has kinks there"
        if math.isfinite(worst):
            reached = 10.0 ** math.ceil(math.log10(10.0 * worst * request.accuracy))
            other = request.accuracy * (100 if 100 * request.accuracy <= COARSEST else 0.01)
            much = f"is {worst:.3g} times the accuracy asked; ask for {reached if reached <= COARSEST else other:.0e}"
        messages.append(f"An event's error estimate {much}.")
    errors = np.full((len(track.points), 2), np.inf) if over() else one_thread(lambda: _row_errors(track.points))
    track = placed
    load, displacement = track.column("load"), track.column("displacement")
    return RawCurve(
        load,
        displacement,
        track.column("contact_radius"),
        np.maximum(track.column("central_gap"), 0.0),
        track.column("energy"),
        unstable[LOAD],
        unstable[DISPLACEMENT],
        errors,
        profiles=[_deferred_profile(point) for point in track.points],
        events=events,
        complete=complete,
        message=" ".join(filter(None, messages)),
        cost=track.work.cost(),
        unknowns=track.work.unknowns,
        unstable_spring=unstable[track.controls[2]] if len(track.controls) > 2 else None,
        unstable_azimuthal=breaking.unstable if breaking.counts else None,
        critical=(lambda: critical_eigenvalues(track.points))
        if breaking.counts and has_modes(track) and problem.refinable
        else None,
        doubtful=doubtful,
        **_on_nodes(track),
    )


def _placed(track: Track, found: Sequence[Found]) -> Track:
    """The track with its events as rows: as they were traced, they are those of other discretisations.

    Far away these may differ by more than a step; then the rows stay in their order as they are.
    """
    points = list(track.points)
    for mark, one in zip(track.marks, found, strict=False):
        near, row = track.points[max(mark.row - 1, 0) : mark.row + 2], track.points[mark.row]
        corner = mark.kind == "fold" and mark.row in track.onward
        if corner or (one.point.problem is row.problem and np.array_equal(one.point.x, row.x)):
            continue
        placed = annotated(one.point)
        if mark.kind != "fold" or (_leads(near[0], near[0], placed) and _leads(near[-1], placed, near[-1])):
            points[mark.row] = placed
    return replace(track, points=tuple(points))


def _leads(along: Point, begin: Point, end: Point) -> bool:
    """Whether one state is ahead of another in the direction in which the curve passes a row."""
    pairs = zip(rates_of(along), numbers(begin), numbers(end), strict=True)
    return sum(rate * (b - a) / max(1.0, abs(a), abs(b)) ** 2 for rate, a, b in pairs) >= 0.0


def _on_nodes(track: Track) -> dict[str, Any]:
    """What rows on a lattice have besides."""
    if "perimeter" not in track.points[0].observables:
        return {}
    pairs, rim = ([point.observables.get(name, 0.0) for point in track.points] for name in ("fft_pairs", "perimeter"))
    area = np.pi * track.column("contact_radius") ** 2
    found = {"fft_pairs": np.array(pairs, dtype=np.int64), "contact_area": area, "contact_perimeter": np.array(rim)}
    return {**found, "cells": [_deferred_cell(point) for point in track.points]}


def _contradicted(track: Track) -> list[int]:
    """Rows whose Morse index under displacement control, by inertia, is not what the folds say."""
    held, last = track.hodograph.rows(DISPLACEMENT), len(track.points) - 1
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

    groups = [
        [row for row in rows if track.problem(row).countable] for rows in track.problem(0).counted_rows(folds, last)
    ]
    return [rows[0] for rows in groups if rows and not any(map(agrees, rows))]


def _disagreement(track: Track, rows: Sequence[int]) -> str:
    own = track.points[rows[0]].observables
    finer = "for a hundredth of the accuracy" if track.problem(0).refinable else "for a finer grid"
    return (
        f"At load {own['load']:.6g}, displacement {own['displacement']:.6g} (reduced) the inertia finds another "
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
                own = _beside(track, mark, own, request.accuracy)
            if mark.control is None or opening is None or not _rests_at(opening, own, request.accuracy):
                opening = own if mark.kind == "topology" else None
            found.append(opening or own)

    kept(locate, None)
    with finishing():  # what was not reached is where the rows have it
        return found + [by_defect(mark.point) for mark in track.marks[len(found) :]]


def _rests_at(opening: Found, fold: Found, accuracy: float) -> bool:
    """Whether a fold is where a ring opens before it: load and displacement rest there, and do not tell its place."""
    values, errors = np.array(fold.numbers[:2]), np.array(fold.error[:2]) + opening.error[:2]
    allowed = OPENING_ERRORS * accuracy * np.maximum(1.0, np.abs(values))
    return bool((np.abs(values - opening.numbers[:2]) <= np.minimum(errors, allowed)).all())


def _located(track: Track, point: Point, event: Event | None, accuracy: float) -> Found:
    """An event made precise, by another model of the same state where the present one does not get as far.

    One that finer discretisations find beyond an end of its problem is at that end, unless the curve begins there.
    """
    found = refine(point, event, accuracy)
    place, (low, high) = found.point.parameter, equilibrium(found.point).parameter_range
    begins = place < low == track.points[0].parameter
    if not (low <= place <= high or begins) and equilibrium(point).refinable:
        edge = min(max(place, low), high)
        return refine(replace(found.point, parameter=edge, observables={}), None, accuracy)
    if found.relative_error() <= accuracy or isinstance(event, Margin):
        return found
    others = (refine(other, event, accuracy) for other in equilibrium(point).otherwise(point))
    return min([found, *others], key=Found.relative_error)


def _beside(track: Track, mark: Mark, corner: Found, accuracy: float) -> Found:
    """A fold in the corner of first touch: it lies between there and the first row of the contact, or before.

    The stiffness of a contact begins with its radius: what the film loses is made up for behind the touch. Where loads
    differ by less than the error of rows, a fold of the film may seem to lie at its end.
    """
    ahead, here = track.onward[mark.row], track.points[mark.row].observables
    first = ahead.observables["contact_radius"]
    if (
        mark.control is None
        or not equilibrium(ahead).refinable
        or here["contact_radius"] > 0.0
        or here["central_gap"] > 0.0
    ):
        return corner
    if first > 0.0:
        event = Balanced(mark.control)
        found = refine(_foretold(ahead, event), event, accuracy)
        if 0.0 < found.numbers[2] <= first and found.relative_error() <= accuracy:
            return found
    found = refine(mark.point, FoldEvent(mark.control), accuracy)
    last = track.points[mark.row - 1].observables["central_gap"]
    if found.error[3] < found.numbers[3] < last and found.relative_error() <= accuracy:
        return found
    load, displacement, radius, gap = corner.error
    return replace(corner, error=(load, displacement, max(radius, first), gap))


def _foretold(ahead: Point, event: Balanced) -> Point:
    """Where slope and control balance behind a touch, as its first row foretells: a contact adds its diameter."""
    problem, radius = equilibrium(ahead), ahead.observables["contact_radius"]
    place = radius - event.value(ahead) / 2.0
    if problem.slope(ahead.x, ahead.parameter) is None or not 0.0 < place < radius:
        return ahead
    rates = rates_of(ahead)
    power = radius * ahead.tangent_parameter / (ahead.parameter * rates.contact_radius)  # of the radius, next to touch
    try:
        return at_parameter(replace(ahead, parameter=ahead.parameter * (place / radius) ** power, observables={}))
    except CorrectionError:
        return ahead


def _event_of(track: Track, mark: Mark) -> Event | None:
    """The function whose zero a mark is; None where the place is the edge of a parameter, or a corner."""
    if mark.control is not None:
        return None if mark.row in track.onward else FoldEvent(mark.control)
    if mark.kind == "end" and mark.name is None:
        return Reached(LOAD, mark.point.observables["load"])
    return Margin(mark.margin) if mark.margin and mark.margin != "edge" else None


def _pairs_of_rounding(track: Track, found: Sequence[Found], unstable: Mapping[Control, Integers]) -> set[int]:
    """Neighbouring folds of one control that no number tells apart, however sharply they are located: they are none.

    The Morse indices of the rows between them, `unstable`, are those on both sides.
    """
    none = set[int]()
    for control in track.controls if track.problem(0).refinable else ():
        folds: list[int] = []
        for k, mark in enumerate(track.marks[: len(found)]):
            if mark.control != control:
                continue
            if folds and _coincide(track, (track.marks[folds[-1]], mark), (found[folds[-1]], found[k])):
                before, rows = folds.pop(), unstable[control]
                first = track.marks[before].row
                rows[first : mark.row + 1] = rows[max(first - 1, 0)]
                none |= {before, k}
            else:
                folds.append(k)
    return none


def _coincide(track: Track, marks: Sequence[Mark], pair: Sequence[Found]) -> bool:
    """Whether the errors of two folds leave open that they are one, at the accuracy asked and at the sharpest one."""
    return _alike(*pair) and _alike(*(_located(track, mark.point, _event_of(track, mark), SHARPEST) for mark in marks))


def _alike(first: Found, second: Found) -> bool:
    """Whether no number tells two events apart; what is not known tells nothing."""
    room = np.add(first.error, second.error)
    apart = np.abs(np.subtract(first.numbers, second.numbers)) > np.where(np.isfinite(room), room, 0.0)
    return not apart.any()


def _event(track: Track, mark: Mark, found: Found) -> RawEvent:
    margin = "" if mark.margin == "edge" else mark.margin
    event = RawEvent(
        mark.kind, mark.row, found.numbers, found.error, place=found.point, margin=margin, message=mark.message
    )
    event = replace(event, name=mark.name)
    if mark.control is not None:
        control = mark.control
        pieces, rising = track.hodograph.pieces(control)
        before, after = max(mark.row - 1, 0), min(mark.row, len(pieces) - 1)
        gap = track.points[mark.row].observables["central_gap"]
        sooner = mark.row in track.onward and gap == 0.0 and found.numbers[3] > found.error[3]  # in the film before it
        corner = (mark.row in track.onward and not sooner) or track.problem(mark.row).cornered
        return replace(
            event,
            control=control.kind,
            stiffness=control.spring_stiffness,
            before=int(pieces[before]),
            after=int(pieces[after]),
            maximum=bool(rising[before] > 0),
            position=mark.row - 0.5 if sooner else None,
            exponent=None if corner else lambda: critical_exponent(found, control),
            local_exponent=None if corner else lambda: sampled_exponent(found, control),
        )
    if mark.kind == "touch":
        beyond = mark.row + (mark.row in track.gaps)  # where the contact there begins with a size of its own
        ahead = track.onward.get(mark.row, track.points[beyond])
        return replace(
            event,
            values=(*found.numbers[:3], 0.0),
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


def _deferred_cell(point: Point) -> Callable[[], CellFields]:
    return lambda: equilibrium(point).described(point.x, point.parameter)["in_cell"]()


def _deferred_profile(point: Point) -> Callable[[], Profile]:
    return lambda: equilibrium(point).profile(point.x, point.parameter)
