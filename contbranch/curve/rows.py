"""A followed curve as a result: its rows with error estimates and indices, its events made precise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import Event, Point
from contbranch.control import LOAD
from contbranch.curve.events import FoldEvent, Margin, Reached
from contbranch.curve.exponents import critical_exponent, sampled_exponent
from contbranch.curve.outcome import RawCurve, RawEvent, no_curve
from contbranch.curve.problem import equilibrium
from contbranch.curve.refine import Found, by_defect, refine
from contbranch.curve.symmetry import Breaking, critical_eigenvalues, has_modes, merged, symmetry_breaking
from contbranch.curve.trace import Request
from contbranch.curve.track import Mark, Track
from contbranch.results.diagram import Cost, Profile
from contbranch.threads import one_thread
from contbranch.watch import finishing, kept, over, tell

__all__ = ["raw_curve"]

CONE = "Exactly at first touch admissible variations form a cone, not a space: the indices are those of both sides."
# Neighbouring folds closer than this multiple of their error estimates are located more sharply, down to this accuracy.
DISTINCT, SHARPEST = 3.0, 1e-12
# The rows' error estimates are those of one Newton step on a finer discretisation, with a floor.
ROW_SAFETY, ROW_FLOOR = 3.0, 2e-8


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of a law outside of where it was followed
def raw_curve(track: Track, request: Request) -> RawCurve:
    """Rows and events of a curve; without ``request.events``, rows alone."""
    if not track.points:
        return no_curve(track.message, Cost(0.0, track.work.newton), track.work.unknowns)
    found = _refined(track, request) if request.events else []
    events = [_event(track, mark, one) for mark, one in zip(track.marks, found, strict=False)]
    breaking = Breaking()
    if request.events and request.modes:
        breaking = kept(lambda: symmetry_breaking(track, request), breaking)
        events = merged(events, breaking.events)
    complete, messages = track.complete, [track.message, breaking.message]
    complete &= breaking.complete
    held = track.hodograph.rows(track.controls[1])
    if complete and not _end_agrees(track):
        complete = False
        messages.append("The inertia at the end disagrees with the folds counted: a fold was missed or doubled.")
    worst = float(np.max([one.relative_error() for one in found], initial=0.0)) / request.accuracy
    if over():  # nothing more is computed of it, now or when it is asked for
        events = [replace(event, exponent=None, local_exponent=None) for event in events]
    elif not worst <= 1.0:
        complete = False
        much = f"is {worst:.3g} times the accuracy asked" if math.isfinite(worst) else "is not known"
        messages.append(f"An event's error estimate {much}.")
    load, displacement = track.column("load"), track.column("displacement")
    return RawCurve(
        load,
        displacement,
        track.column("contact_radius"),
        np.maximum(track.column("central_gap"), 0.0),
        track.column("energy"),
        track.hodograph.rows(LOAD),
        held,
        np.full((len(load), 2), np.inf) if over() else one_thread(lambda: _row_errors(track.points)),
        profiles=[_deferred_profile(point) for point in track.points],
        events=events,
        complete=complete,
        message=" ".join(filter(None, messages)),
        cost=Cost(0.0, track.work.newton),
        unknowns=track.work.unknowns,
        unstable_spring=track.hodograph.rows(track.controls[2]) if len(track.controls) > 2 else None,
        unstable_azimuthal=breaking.unstable if breaking.counts else None,
        critical=(lambda: critical_eigenvalues(track.points)) if breaking.counts and has_modes(track) else None,
    )


def _end_agrees(track: Track) -> bool:
    """Whether the Morse index under displacement control at the last row, by inertia, is what the folds say."""
    last, held = track.points[-1], track.hodograph.pieces(track.controls[1])[0]
    return len(held) == 0 or equilibrium(last).unstable(last.x, last.parameter) == held[-1]


# -- events -----------------------------------------------------------------------------------------------------------
def _refined(track: Track, request: Request) -> list[Found]:
    """The marks made precise."""
    found: list[Found] = []

    def locate() -> None:
        for k, mark in enumerate(track.marks):
            tell(0.9 + 0.07 * k / len(track.marks), f"locating {mark.kind}")
            beside = found[-1].point if found else None
            found.append(refine(mark.point, _event_of(track, mark), request.accuracy, beside))
        _sharpen(track, found, request.accuracy)

    kept(locate, None)
    with finishing():  # what was not reached is where the rows have it
        return found + [by_defect(mark.point, _event_of(track, mark)) for mark in track.marks[len(found) :]]


def _event_of(track: Track, mark: Mark) -> Event | None:
    """The function whose zero a mark is; None where the place is the edge of a parameter, or a corner."""
    if mark.control is not None:
        return None if mark.row in track.onward else FoldEvent(mark.control)
    if mark.kind == "end":
        return Reached(LOAD, mark.point.observables["load"])
    return Margin(mark.margin) if mark.margin and mark.margin != "edge" else None


def _sharpen(track: Track, found: list[Found], accuracy: float) -> None:
    """Locate folds anew that their error estimates do not tell apart."""
    for control in track.controls:
        members = [k for k, mark in enumerate(track.marks) if mark.control == control and mark.row not in track.onward]
        for a, b in pairwise(members):
            allowed = accuracy
            while allowed > SHARPEST:
                first, second = found[a], found[b]
                apart = abs(control.weighted(*first.numbers[:2]) - control.weighted(*second.numbers[:2]))
                if apart > DISTINCT * (control.weighted(*first.error[:2]) + control.weighted(*second.error[:2])):
                    break
                allowed *= 0.01
                for k in (a, b):
                    better = refine(found[k].point, FoldEvent(control), allowed)
                    if better.relative_error() < found[k].relative_error():
                        found[k] = better


def _event(track: Track, mark: Mark, found: Found) -> RawEvent:
    margin = "" if mark.margin == "edge" else mark.margin
    event = RawEvent(
        mark.kind, mark.row, found.numbers, found.error, place=found.point, margin=margin, message=mark.message
    )
    if mark.control is not None:
        control = mark.control
        pieces, rising = track.hodograph.pieces(control)
        before, after = max(mark.row - 1, 0), min(mark.row, len(pieces) - 1)
        corner = mark.row in track.onward
        return replace(
            event,
            control=control.kind,
            stiffness=control.spring_stiffness,
            before=int(pieces[before]),
            after=int(pieces[after]),
            maximum=bool(rising[before] > 0),
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
            local_exponent=lambda: sampled_exponent(found, LOAD, ahead),
        )
    return event


# -- rows -------------------------------------------------------------------------------------------------------------
def _row_errors(points: Sequence[Point]) -> Array:
    """Error estimates of load and displacement, (M, 2).

    Differences between two discretisations have a sign, which changes along the curve: at its zeros they say nothing,
    the neighbouring rows of the same discretisation do.
    """
    own = np.array([_row_error(point) for point in points])
    found = own.copy()
    for k, (first, second) in enumerate(pairwise(points)):
        if first.problem is second.problem and np.isfinite(own[k : k + 2]).all():
            found[k : k + 2] = np.maximum(found[k : k + 2], own[k : k + 2].max(axis=0))
    return found


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _row_error(point: Point) -> Sequence[float]:
    """Error estimates of load and displacement."""
    problem, own = equilibrium(point), point.observables
    try:
        defect = problem.defect(point)[:2]
    except Exception:  # a user's law may raise anything, a finer discretisation may be too much: it is not known then
        defect = math.inf, math.inf
    if not np.isfinite(defect).all():
        return math.inf, math.inf
    floor = ROW_FLOOR if problem.finer() is not problem else problem.rounding
    return [
        ROW_SAFETY * abs(error) + floor * max(1.0, abs(own[name]))
        for error, name in zip(defect, ("load", "displacement"), strict=True)
    ]


def _deferred_profile(point: Point) -> Callable[[], Profile]:
    return lambda: equilibrium(point).profile(point.x, point.parameter)
