"""Everything that happens inside one step: folds, branch points, changes of index and user events."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.branching import branch_points
from contbranch.continuation.curve import BranchPoint, Fold, IndexChange, Located
from contbranch.continuation.events import Event, Happening
from contbranch.continuation.folds import locate_fold
from contbranch.continuation.newton import CorrectionError, evaluating, jacobian_rounding
from contbranch.continuation.options import Options
from contbranch.continuation.problem import size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import annotated, point_on
from contbranch.continuation.zeros import Bracket, Functions, Search

# A curve whose unit tangent has a parameter component below this (in the metric) is vertical up to rounding; those of a
# step's ends are known well enough to tell from this one on.
VERTICAL, UNSURE_SLOPE = 1e-11, 1e-8
# Slope of the parameter (in the metric) that is none, in units of the Jacobian's rounding.
SLOPE_ROUNDINGS = 10.0
# An extremum of the parameter closer to a branch point than this share of the step is the branch point itself; the
# second one where the curve itself has no more than this slope (in the metric) at the branch point.
SAME_POINT, LEVEL_DISTANCE, LEVEL_SLOPE = 1e-6, 1e-2, 1e-6
# How often a step is halved to explain a change of the Morse index.
HALVINGS = 40
# Share of the way to the next one by which the index of an event is taken beside it: right there it is undecided.
ASIDE = 1e-3


def scan(
    segment: Segment,
    events: Sequence[Event],
    options: Options,
    previous: Segment | None = None,
    ahead: Bordered | None = None,
) -> list[Happening]:
    """Return what happens between two points of the curve, in order.

    Parameters
    ----------
    segment : Segment
        The step.
    events : sequence of Event
        What to look for besides folds and branch points.
    options : Options
        Tolerances.
    previous : Segment, optional
        The step before, which tells how far the cubic of this one can be trusted.
    ahead : Bordered, optional
        The matrix with which Newton's method came to the end of this one.

    Raises
    ------
    LeapError
        If the bordered determinant changes sign without a branch point in between.
    CorrectionError
        If the problem fails inside the step.
    """
    found: list[Happening] = []
    branches = branch_points(segment, ahead, options) if options.detect_branch_points else []
    found += [Happening(theta, replace(one, point=annotated(one.point))) for theta, one in branches]
    if options.detect_folds:
        folds = _folds(segment, previous, options)
        found += [fold for fold in folds if not any(_coincident(segment, fold.event, one) for _, one in branches)]
    for event_function in events:
        found += event_function.happenings(segment, previous, options)
    return _with_index_changes(segment, sorted(found, key=lambda happening: happening.theta), options)


def _folds(segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
    """Return the folds inside a step."""
    scale = segment.metric.parameter_scale
    begin, end = segment.begin.tangent_parameter, segment.end.tangent_parameter
    if max(abs(begin), abs(end)) < UNSURE_SLOPE * scale:
        precise = [point_on(segment, theta, options)[0].tangent_parameter for theta in (0.0, 1.0)]
        if max(map(abs, precise)) < VERTICAL * scale:
            return []  # the parameter is constant along this part of the curve
    functions = Functions(
        lambda point: np.array([point.tangent_parameter]), options, lambda point: np.array([point.parameter])
    )
    search = Search(segment, functions, [] if previous is None else [previous.begin])
    found = [fold for bracket in search.brackets() if (fold := _fold(bracket, functions)) is not None]
    if len(found) == 2:  # none, where the slope between them is no larger than its error
        between, _ = point_on(segment, (found[0].theta + found[1].theta) / 2, options)
        if abs(between.tangent_parameter) <= SLOPE_ROUNDINGS * jacobian_rounding(between.problem) * scale:
            return []
    return [replace(one, event=replace(one.event, point=annotated(one.event.point))) for one in found]


def _fold(bracket: Bracket, functions: Functions) -> Happening | None:
    """Locate the fold in a bracket by bordered Newton iteration, started from the slope's zero if need be.

    None where there is none: rounding next to a branch point changes the slope's sign, too.
    """
    fold = _fold_by_newton(bracket.segment, bracket.guess, bracket.last)
    if fold is None:
        theta, _ = functions.zero(bracket, 1e-15, 0.0)
        fold = _fold_by_newton(bracket.segment, theta, bracket.last, 0.1)
    return fold and replace(fold, theta=bracket.whole(fold.theta))


def _coincident(segment: Segment, fold: Located, branch: BranchPoint) -> bool:
    """Whether an extremum of the parameter is that of a curve through a pitchfork rather than a fold."""
    metric = segment.metric
    away = metric.norm(segment.begin.problem, fold.x - branch.x, fold.parameter - branch.parameter)
    level = abs(branch.point.tangent_parameter) < LEVEL_SLOPE * metric.parameter_scale
    return away < (LEVEL_DISTANCE if level else SAME_POINT) * segment.length


def _fold_by_newton(
    segment: Segment, start: float, slope_after: float | None = None, near: float = math.inf
) -> Happening | None:
    """Locate a fold by bordered Newton iteration; None unless it converges into the segment, or `near` the start.

    Of two neighbouring folds one is a maximum and one a minimum of the parameter: the slope after the fold tells
    whether the right one was found, however close they are.
    """
    x, p = segment.at(start)
    direction = segment.direction(start)
    try:
        fold = locate_fold(segment.begin.problem, x, p, direction, segment.metric, 2 * segment.length)
    except CorrectionError:
        return None
    if slope_after is not None and fold.curvature * slope_after < 0:
        return None
    theta = segment.position(fold.x, fold.parameter)
    # The projection on the chord and the cubic's own position differ by the step's curvature.
    if not (-0.1 <= theta <= 1.1 and abs(theta - start) <= near):
        return None
    near_x, near_p = segment.at(min(max(theta, 0.0), 1.0))
    away = segment.metric.norm(segment.begin.problem, fold.x - near_x, fold.parameter - near_p)
    return Happening(theta, fold) if away <= 0.2 * segment.length else None


def _with_index_changes(segment: Segment, found: list[Happening], options: Options) -> list[Happening]:
    """Return what was found, in order, with the changes of the Morse index that it does not explain.

    A fold or a branch point explains what changes at its own place: so the index is compared right behind one and right
    before the next, on the cubic between them, which is close enough to the curve there.
    """
    begin, end = segment.begin, segment.end
    marks = [h for h in found if isinstance(h.event, (Fold, BranchPoint))]
    if begin.morse_index is None or end.morse_index is None or (not marks and begin.morse_index == end.morse_index):
        return found
    stations = [(0.0, begin), *((h.theta, h.event.point) for h in marks), (1.0, end)]
    changes, beside = list[Happening](), list[int | None]()
    for (left, first), (right, last) in pairwise(stations):
        piece = Segment(first, last, segment.metric)
        edges = (0.0 if first is begin else ASIDE, 1.0 if last is end else 1.0 - ASIDE)
        indices = [_index(piece, theta) for theta in edges] if piece.length > 0.0 else [None, None]
        beside += indices
        if None not in indices and indices[0] != indices[1]:
            changes += [replace(h, theta=left + (right - left) * h.theta) for h in _halve(piece, edges, options)]
    for k, mark in enumerate(marks):
        if isinstance(mark.event, BranchPoint) and len(mark.event.tangents) != 2:
            event = replace(mark.event, before=beside[2 * k + 1], after=beside[2 * k + 2])
            found[found.index(mark)] = replace(mark, event=event)
    return sorted(found + changes, key=lambda happening: happening.theta)


def _index(piece: Segment, theta: float, options: Options | None = None) -> int | None:
    """Return the Morse index on the cubic of a piece, or with options on the curve itself; None if it is not known."""
    if theta in (0.0, 1.0):
        return (piece.begin if theta == 0.0 else piece.end).morse_index
    x, p = piece.at(theta)
    if options is not None:
        try:
            point, _ = point_on(piece, theta, options)
        except CorrectionError:
            return None
        x, p = point.x, point.parameter
    with evaluating(p):
        return piece.begin.problem.morse_index(x, p)


def _halve(piece: Segment, interval: tuple[float, float], options: Options) -> list[Happening]:
    """Locate the changes of the index between two places of a piece by bisection."""
    left, right = interval
    first, last = (_index(piece, theta, options) for theta in interval)
    if first is None or last is None or first == last:
        return []
    for _ in range(HALVINGS):
        middle = (left + right) / 2
        value = _index(piece, middle, options)
        if value is None:
            break
        if value not in (first, last):
            return _halve(piece, (left, middle), options) + _halve(piece, (middle, right), options)
        left, right = (middle, right) if value == first else (left, middle)
    theta, width = (left + right) / 2, right - left
    if options.detect_folds:
        fold = _fold_by_newton(piece, theta, near=1e-3)
        if fold is not None:
            return [replace(fold, event=replace(fold.event, point=annotated(fold.event.point)))]
    state_error = width * size_of(piece.begin.problem, piece.chord[0])
    point = annotated(point_on(piece, theta, options)[0], label="index change")
    located = IndexChange(point, width * abs(piece.chord[1]), state_error, before=first, after=last)
    return [Happening(theta, located)]
