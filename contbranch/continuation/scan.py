"""Everything that happens inside one step: folds, branch points, changes of index and user events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import bisect

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.branching import branch_points
from contbranch.continuation.curve import BranchPoint, Fold, IndexChange, Located
from contbranch.continuation.events import UNSIGNED, Event, Happening
from contbranch.continuation.folds import locate_fold
from contbranch.continuation.newton import CorrectionError, evaluating, jacobian_rounding
from contbranch.continuation.options import Options
from contbranch.continuation.problem import size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import annotated, point_on
from contbranch.continuation.zeros import ASIDE, Bracket, Functions, Search

# A fold closer to a branch point than this share of the step is the branch point itself, where the parameter has no
# more than this slope (in the metric) at the branch point. Ends of a step with less slope are computed precisely.
LEVEL_DISTANCE, LEVEL_SLOPE = 1e-2, 1e-6
# Share of a part of the step to which a change of the Morse index is located.
INDEX_RESOLUTION = 1e-12


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
    noise = UNSIGNED * jacobian_rounding(segment.begin.problem) * scale

    def level(*places: float) -> bool:
        """Whether the parameter has no slope but for rounding."""
        return all(abs(point_on(segment, theta, options)[0].tangent_parameter) <= noise for theta in places)

    steepest = max(abs(segment.begin.tangent_parameter), abs(segment.end.tangent_parameter))
    if steepest < LEVEL_SLOPE * scale and level(0.0, 1.0):
        return []  # the parameter is constant along this part of the curve
    functions = Functions(
        lambda point: np.array([point.tangent_parameter]), options, lambda point: np.array([point.parameter])
    )
    search = Search(segment, functions, [] if previous is None else [previous.begin])
    found = [fold for bracket in search.brackets() if (fold := _fold(bracket, functions)) is not None]
    if len(found) == 2 and level((found[0].theta + found[1].theta) / 2):
        return []
    return [replace(one, event=replace(one.event, point=annotated(one.event.point))) for one in found]


def _fold(bracket: Bracket, functions: Functions) -> Happening | None:
    """Locate the fold in a bracket by bordered Newton iteration, started from the slope's zero if need be.

    None where there is none: rounding next to a branch point changes the slope's sign, too.
    """
    fold = _fold_by_newton(bracket, bracket.guess)
    return fold or _fold_by_newton(bracket, functions.zero(bracket, 1e-15, 0.0)[0])


def _fold_by_newton(bracket: Bracket, start: float) -> Happening | None:
    """Locate a fold by bordered Newton iteration; None unless it converges into the part of the step.

    Of two neighbouring folds one is a maximum and one a minimum of the parameter: the slope after the fold tells
    whether the right one was found, however close they are.
    """
    segment = bracket.segment
    x, p = segment.at(start)
    try:
        fold = locate_fold(segment.begin.problem, x, p, segment.direction(start), segment.metric, 2 * segment.length)
    except CorrectionError:
        return None
    theta = segment.position(fold.x, fold.parameter)
    near_x, near_p = segment.at(min(max(theta, 0.0), 1.0))
    away = segment.metric.norm(segment.begin.problem, fold.x - near_x, fold.parameter - near_p)
    # The projection on the chord and the cubic's own position differ by the step's curvature.
    if fold.curvature * bracket.last < 0 or not (-0.1 <= theta <= 1.1 and away <= 0.2 * segment.length):
        return None
    return Happening(bracket.whole(theta), fold)


def _coincident(segment: Segment, fold: Located, branch: BranchPoint) -> bool:
    """Whether an extremum of the parameter is that of a curve through a pitchfork rather than a fold."""
    metric = segment.metric
    away = metric.norm(segment.begin.problem, fold.x - branch.x, fold.parameter - branch.parameter)
    level = abs(branch.point.tangent_parameter) < LEVEL_SLOPE * metric.parameter_scale
    return level and away < LEVEL_DISTANCE * segment.length


def _with_index_changes(segment: Segment, found: list[Happening], options: Options) -> list[Happening]:
    """Return what was found, in order, with the changes of the Morse index that it does not explain.

    A fold or a branch point explains what changes at its own place: so the index is compared right behind one and right
    before the next. At the place itself it is undecided.
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
        before, after = (_index(piece, theta, options) if piece.length > 0.0 else None for theta in edges)
        beside += [before, after]
        if before is not None and after is not None:
            located = _index_changes(piece, edges, (before, after), options)
            changes += [replace(h, theta=left + (right - left) * h.theta) for h in located]
    for k, mark in enumerate(marks):
        if isinstance(mark.event, BranchPoint) and len(mark.event.tangents) != 2:
            event = replace(mark.event, before=beside[2 * k + 1], after=beside[2 * k + 2])
            found[found.index(mark)] = replace(mark, event=event)
    return sorted(found + changes, key=lambda happening: happening.theta)


def _index(piece: Segment, theta: float, options: Options) -> int | None:
    """Return the Morse index on the curve at a place of a piece; None if it is not known."""
    if theta in (0.0, 1.0):
        return (piece.begin if theta == 0.0 else piece.end).morse_index
    try:
        point, _ = point_on(piece, theta, options)
    except CorrectionError:
        return None
    with evaluating(point.parameter):
        return point.problem.morse_index(point.x, point.parameter)


def _index_changes(
    piece: Segment, edges: tuple[float, float], indices: tuple[int, int], options: Options
) -> list[Happening]:
    """Locate by bisection where the index passes every number between those at two places of a piece."""
    places: dict[float, list[int]] = {}
    for k in range(min(indices), max(indices)):

        def above(theta: float, k: int = k) -> float:
            value = _index(piece, theta, options)
            return (indices[0] if value is None else value) - k - 0.5

        places.setdefault(float(bisect(above, *edges, xtol=INDEX_RESOLUTION)), []).append(k)
    found, rises = list[Happening](), indices[1] > indices[0]
    for theta, passed in places.items():
        low, high = passed[0], passed[-1] + 1
        state_error = INDEX_RESOLUTION * size_of(piece.begin.problem, piece.chord[0])
        point = annotated(point_on(piece, theta, options)[0], label="index change")
        error = INDEX_RESOLUTION * abs(piece.chord[1])
        before, after = (low, high) if rises else (high, low)
        found.append(Happening(theta, IndexChange(point, error, state_error, before=before, after=after)))
    return found
