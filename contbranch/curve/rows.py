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
from contbranch.control import LOAD, Control
from contbranch.curve.events import Balanced, FoldEvent, Margin, Reached
from contbranch.curve.exponents import critical_exponent, sampled_exponent
from contbranch.curve.outcome import RawCurve, RawEvent, no_curve
from contbranch.curve.problem import equilibrium, rates_of, valued
from contbranch.curve.refine import Found, at_parameter, by_defect, moved, refine, settled
from contbranch.curve.symmetry import Breaking, critical_eigenvalues, has_modes, merged, symmetry_breaking
from contbranch.curve.trace import Request
from contbranch.curve.track import Mark, Track
from contbranch.results.profile import CellFields, Profile
from contbranch.results.record import OBSERVABLES
from contbranch.threads import one_thread
from contbranch.watch import finishing, kept, over, tell

__all__ = ["raw_curve"]

CONE = "Exactly at first touch admissible variations form a cone, not a space: the indices are those of both sides."
# Accuracy at which neighbouring folds that their errors do not tell apart are located once more.
SHARPEST = 1e-12
# The rows' error estimates are those of one Newton step on a finer discretisation, with a floor.
ROW_SAFETY, ROW_FLOOR = 3.0, 2e-8
# What a fold may be off where a contact begins on a lattice, in units of what changes from the row before.
BEGINNING = 1.1
# Where the discretisation was given, errors are found at every so many rows, and indices at these shares of parts of
# the curve with more than a few rows.
STRIDE, SHARES, FEW = 6, (0.5, 0.3, 0.7), 6


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of a law outside of where it was followed
def raw_curve(track: Track, request: Request) -> RawCurve:
    """Rows and events of a curve; without ``request.events``, rows alone."""
    if not track.points:
        return no_curve(track.message, track.work.cost(), track.work.unknowns)
    found = _refined(track, request) if request.events else []
    unstable = {control: track.hodograph.rows(control) for control in track.controls}
    with finishing():
        events = [_event(track, mark, one) for mark, one in zip(track.marks, found, strict=False)]
        none = _pairs_of_rounding(track, found, unstable)
        events = [event for k, event in enumerate(events) if k not in none]
        if track.problem(0).given:
            _doubtful(track, events)
        placed = _placed(track, found)
    breaking = Breaking()
    if request.events and request.modes:
        breaking = kept(lambda: symmetry_breaking(track, request), breaking)
    events = merged(events, breaking.events)
    complete, messages = track.complete, [track.message, breaking.message]
    given, held = track.problem(0).given, unstable[track.controls[1]]
    complete &= (breaking.complete or given) and not over()
    wrong = kept(lambda: _contradicted(track), list[int]()) if complete else []
    if wrong:
        complete = False
        messages.append(_disagreement(track, wrong))
    broken = [Found(event.values, event.error, event.place) for event in breaking.events]
    doubtful = track.complete and bool(wrong) and not over()
    worst = float(np.max([one.relative_error() for one in (*found, *broken)], initial=0.0)) / request.accuracy
    if over():  # nothing more is computed of it, now or when it is asked for
        events = [replace(event, exponent=None, local_exponent=None) for event in events]
    elif not (worst <= 1.0 or given):
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
        held,
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
        if breaking.counts and has_modes(track) and not given
        else None,
        doubtful=doubtful,
        **_on_nodes(track),
    )


def _placed(track: Track, found: Sequence[Found]) -> Track:
    """The track with the rows at which the contact set changes where that was found to be: as they were traced, they
    may lie before the rows that they follow, or beyond the next ones."""
    points = list(track.points)
    for mark, one in zip(track.marks, found, strict=False):
        if mark.kind in ("touch", "topology") and not track.problem(mark.row).given:
            points[mark.row] = valued(one.point)
    return replace(track, points=tuple(points))


def _on_nodes(track: Track) -> dict[str, Any]:
    """What rows on a lattice have besides."""
    if "perimeter" not in track.points[0].observables:
        return {}
    pairs, rim = ([point.observables.get(name, 0.0) for point in track.points] for name in ("fft_pairs", "perimeter"))
    area = np.pi * track.column("contact_radius") ** 2
    found = {"fft_pairs": np.array(pairs, dtype=np.int64), "contact_area": area, "contact_perimeter": np.array(rim)}
    return {**found, "cells": [_deferred_cell(point) for point in track.points]}


def _contradicted(track: Track) -> list[int]:
    """Rows whose Morse index under displacement control, by inertia, is not what the folds say: the last, and where the
    discretisation was given, one in every part between two folds."""
    held, last = track.hodograph.rows(track.controls[1]), len(track.points) - 1
    parts = [[last]] if len(held) > 1 else []
    if track.problem(0).given:
        edges = [0, *sorted({mark.row for mark in track.marks if mark.kind == "fold"}), last]
        for first, behind in pairwise(edges):
            inner = [first + round(share * (behind - first)) for share in SHARES]
            inside = [row for row in dict.fromkeys(inner) if first < row < behind]
            parts += [inside] if behind - first > FEW else []

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

    known = [[row for row in rows if track.problem(row).countable] for rows in parts]
    return [rows[0] for rows in known if rows and not any(map(agrees, rows))]


def _disagreement(track: Track, rows: Sequence[int]) -> str:
    if not track.problem(0).given:
        return (
            "The inertia at the end disagrees with the folds counted: a fold was missed or doubled; "
            "ask for a hundredth of the accuracy."
        )
    own = track.points[rows[0]].observables
    return (
        f"In {len(rows)} parts of the curve eigenvalues find another number of unstable modes than the folds say, "
        f"first at load {own['load']:.6g}, displacement {own['displacement']:.6g} (reduced): "
        "a fold was missed, or is none; try a finer grid."
    )


# -- events -----------------------------------------------------------------------------------------------------------
def _refined(track: Track, request: Request) -> list[Found]:
    """The marks made precise."""
    found: list[Found] = []

    def locate() -> None:
        for k, mark in enumerate(track.marks):
            tell(0.9 + 0.07 * k / len(track.marks), f"locating {mark.kind}")
            beside = found[-1].point if found else None
            own = _located(mark.point, _event_of(track, mark), request.accuracy, beside)
            if mark.control is not None and mark.row in track.onward:
                own = _beside(track, mark, own, request.accuracy)
            found.append(own)

    kept(locate, None)
    with finishing():  # what was not reached is where the rows have it
        return found + [by_defect(mark.point, _event_of(track, mark)) for mark in track.marks[len(found) :]]


def _located(point: Point, event: Event | None, accuracy: float, beside: Point | None) -> Found:
    """An event made precise, by another model of the same state where the present one does not get as far."""
    found = refine(point, event, accuracy, beside)
    low, high = equilibrium(found.point).parameter_range
    if not (low <= found.point.parameter <= high or equilibrium(point).given):
        edge = min(max(found.point.parameter, low), high)
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
    if mark.control is None or equilibrium(ahead).given or here["contact_radius"] > 0.0 or here["central_gap"] > 0.0:
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


def _pairs_of_rounding(track: Track, found: list[Found], unstable: Mapping[Control, Integers]) -> set[int]:
    """Neighbouring folds of one control that no number tells apart, however sharply they are located: they are none.

    The Morse indices of the rows between them, `unstable`, are those on both sides.
    """
    none = set[int]()
    for control in () if track.problem(0).given else track.controls:
        folds: list[int] = []
        for k, mark in enumerate(track.marks[: len(found)]):
            if mark.control != control:
                continue
            if folds and _coincide(track, found, folds[-1], k):
                before, rows = folds.pop(), unstable[control]
                first = track.marks[before].row
                rows[first : mark.row + 1] = rows[max(first - 1, 0)]
                none |= {before, k}
            else:
                folds.append(k)
    return none


def _coincide(track: Track, found: list[Found], *pair: int) -> bool:
    """Whether the errors of two folds leave open that they are one, at the accuracy asked and at the sharpest one."""
    for sharper in (False, True):
        for k in pair if sharper else ():
            found[k] = _located(found[k].point, _event_of(track, track.marks[k]), SHARPEST, None)
        first, second = (found[k] for k in pair)
        if (np.abs(np.subtract(first.numbers, second.numbers)) > np.add(first.error, second.error)).any():
            return False
    return True


def _event(track: Track, mark: Mark, found: Found) -> RawEvent:
    margin, error = "" if mark.margin == "edge" else mark.margin, found.error
    beside = track.points[max(mark.row - 1, 0)].observables
    if (
        mark.control is not None
        and track.problem(mark.row).given
        and beside["contact_radius"] == 0.0 < found.numbers[2]
    ):
        # On the lattice a contact begins with some nodes: the fold may be anywhere between these and none.
        pairs = zip(error, found.numbers, (beside[name] for name in OBSERVABLES), strict=True)
        load, displacement, radius, gap = (max(own, BEGINNING * abs(here - there)) for own, here, there in pairs)
        error = load, displacement, radius, gap
    event = RawEvent(mark.kind, mark.row, found.numbers, error, place=found.point, margin=margin, message=mark.message)
    event = replace(event, name=mark.name)
    if mark.control is not None:
        control = mark.control
        pieces, rising = track.hodograph.pieces(control)
        before, after = max(mark.row - 1, 0), min(mark.row, len(pieces) - 1)
        # Between rows of nodes that were given only an average is a function.
        problem = track.problem(mark.row)
        gap = track.points[mark.row].observables["central_gap"]
        sooner = mark.row in track.onward and gap == 0.0 and found.numbers[3] > found.error[3]  # in the film before it
        corner = (mark.row in track.onward and not sooner) or (problem.given and not problem.ordered)
        point = found.point
        verdict, message = equilibrium(point).verdict(point, control, error)
        return replace(
            event,
            verdict=verdict,
            message=message,
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
            local_exponent=None if track.problem(mark.row).given else lambda: sampled_exponent(found, LOAD, ahead),
        )
    return event


def _doubtful(track: Track, events: list[RawEvent]) -> None:
    """Mark folds next to each other that differ by less than the errors of both, or that cannot both be.

    Smallest differences come first, and belong to the error of what is left next to them. Maxima and minima of a
    control alternate; of two of a kind the less sure is marked.
    """
    for control in track.controls:
        own = [k for k, event in enumerate(events) if (event.kind, event.control) == ("fold", control.kind)]
        while len(own) > 1:
            at = {k: control.weighted(*events[k].values[:2]) for k in own}
            heights = np.array(list(at.values()))
            common = [equilibrium(events[k].place).shared(events[k].place) for k in own]
            errors = np.array(
                [control.weighted(*np.subtract(events[k].error[:2], c)) for k, c in zip(own, common, strict=True)]
            )
            apart = np.abs(np.diff(heights)) / np.minimum(errors[1:], errors[:-1])
            place = int(np.argmin(apart))
            if not apart[place] < 1.0:
                break
            pair = own[place : place + 2]
            del own[place : place + 2]
            ripple = np.abs(np.subtract(events[pair[0]].values, events[pair[1]].values))
            for k in sorted(own[max(place - 1, 0) : place + 1], key=lambda k: abs(at[k] - at[pair[0]]))[:1]:
                events[k] = replace(events[k], error=tuple(np.maximum(events[k].error, ripple).tolist()))
            for k in pair:
                message = "It differs from the fold next to it by less than the lattice's error."
                events[k] = replace(events[k], verdict="unresolved", message=message)
        for a, b in pairwise(own):
            if events[a].verdict and events[b].verdict and events[a].maximum == events[b].maximum:
                worse = max(a, b, key=lambda k: control.weighted(*events[k].error[:2]))
                message = "Between it and the fold next to it, which is of the same kind, there is no other."
                events[worse] = replace(events[worse], verdict="unresolved", message=message)


# -- rows -------------------------------------------------------------------------------------------------------------
def _row_errors(points: Sequence[Point]) -> Array:
    """Error estimates of load and displacement, (M, 2).

    Differences between two discretisations have a sign, which changes along the curve: at its zeros they say nothing,
    the neighbouring rows of the same discretisation do.
    """
    if equilibrium(points[0]).given:
        return _given_errors(points)
    own = np.array([_row_error(point) for point in points])
    found = own.copy()
    for k, (first, second) in enumerate(pairwise(points)):
        if first.problem is second.problem and np.isfinite(own[k : k + 2]).all():
            found[k : k + 2] = np.maximum(found[k : k + 2], own[k : k + 2].max(axis=0))
    return found


def _given_errors(points: Sequence[Point]) -> Array:
    """Error estimates at some rows, and between them the larger one of both sides."""
    rows = sorted({*range(0, len(points), STRIDE), len(points) - 1})
    own = np.array([_row_error(points[row]) for row in rows])
    place = np.searchsorted(rows, np.arange(len(points)))
    return np.asarray(np.maximum(own[place], own[np.maximum(place - 1, 0)]))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _row_error(point: Point) -> Sequence[float]:
    """Error estimates of load and displacement."""
    problem, own = equilibrium(point), point.observables
    try:
        defect = problem.defect(point)[:2]
        left_out = problem.left_out(point.x, point.parameter)[:2]
    except Exception:  # a user's law may raise anything, a finer discretisation may be too much: it is not known then
        defect = math.inf, math.inf
    if not np.isfinite(defect).all():
        return math.inf, math.inf
    floor = ROW_FLOOR if problem.finer() is not problem else problem.rounding
    return [
        (1.0 if problem.given else ROW_SAFETY) * abs(error) + floor * max(1.0, abs(own[name])) + besides
        for error, name, besides in zip(defect, ("load", "displacement"), left_out, strict=True)
    ]


def _deferred_cell(point: Point) -> Callable[[], CellFields]:
    return lambda: equilibrium(point).described(point.x, point.parameter)["in_cell"]()


def _deferred_profile(point: Point) -> Callable[[], Profile]:
    return lambda: equilibrium(point).profile(point.x, point.parameter)
