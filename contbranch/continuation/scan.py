"""Everything that happens inside one step: folds, branch points, changes of index and user events."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contbranch.continuation.bordered import Bordered
from contbranch.continuation.branching import branch_points
from contbranch.continuation.curve import BranchPoint, EventPoint, Fold, IndexChange, Located, Point
from contbranch.continuation.events import Event, Happening
from contbranch.continuation.folds import locate_fold
from contbranch.continuation.newton import CorrectionError
from contbranch.continuation.options import Options
from contbranch.continuation.problem import size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import annotated, point_on
from contbranch.continuation.zeros import Bracket, Functions, Search

# A curve whose unit tangent has a parameter component below this (in the metric) is vertical up to rounding.
VERTICAL = 1e-11
# An extremum of the parameter closer to a branch point than this share of the step is the branch point itself. On the
# curve next to it the matrix is nearly singular, so an extremum found without the bordered system is less certain.
COINCIDENT = 1e-6
COINCIDENT_ON_CURVE = 1e-2
# ... and so is one next to a branch point at which the curve itself has no more than this slope (in the metric).
LEVEL = 1e-6
# How often a step is halved to explain a change of the Morse index.
HALVINGS = 40


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
    found += _unexplained(segment, found, options)
    return sorted(found, key=lambda happening: happening.theta)


def _folds(segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
    """Return the folds inside a step."""
    begin, end = segment.begin.tangent_parameter, segment.end.tangent_parameter
    if max(abs(begin), abs(end)) < VERTICAL * segment.metric.parameter_scale:
        return []  # the parameter is constant along this part of the curve
    functions = Functions(
        lambda point: np.array([point.tangent_parameter]), options, lambda point: np.array([point.parameter])
    )
    search = Search(segment, functions, [] if previous is None else [previous.begin])
    found = [_fold(bracket, functions) for bracket in search.brackets()]
    return [replace(one, event=replace(one.event, point=annotated(one.event.point))) for one in found]


def _fold(bracket: Bracket, functions: Functions) -> Happening:
    """Locate the fold in a bracket by bordered Newton iteration, failing that as a zero of the slope."""
    segment = bracket.segment
    fold = _fold_by_newton(segment, bracket.guess, bracket.last)
    if fold is None:
        theta, point = functions.zero(bracket, 1e-15, 0.0)
        fold = _fold_by_newton(segment, theta, bracket.last, 0.1) or _fold_on_curve(segment, theta, point)
    return replace(fold, theta=bracket.whole(fold.theta))


def _coincident(segment: Segment, fold: Located, branch: BranchPoint) -> bool:
    """Whether an extremum of the parameter is that of a curve through a pitchfork rather than a fold."""
    metric = segment.metric
    away = metric.norm(segment.begin.problem, fold.x - branch.x, fold.parameter - branch.parameter)
    level = abs(branch.point.tangent_parameter) < LEVEL * metric.parameter_scale
    certain = isinstance(fold, Fold) and math.isfinite(fold.curvature) and not level
    return away < (COINCIDENT if certain else COINCIDENT_ON_CURVE) * segment.length


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


def _fold_on_curve(segment: Segment, theta: float, point: Point) -> Happening:
    """Return a fold as the zero of the slope along the curve, where the bordered system does not converge."""
    problem = point.problem
    norm = size_of(problem, point.tangent_x)
    error = abs(point.tangent_parameter) * segment.length * 1e-6 + 1e-14 * abs(point.parameter)
    fold = Fold(
        replace(point, label="fold"),
        error,
        1e-8 * segment.length * segment.metric.state_scale,
        null_vector=point.tangent_x / norm,
    )
    return Happening(theta, fold)


def _unexplained(segment: Segment, found: list[Happening], options: Options) -> list[Happening]:
    """Return changes of the Morse index inside the step that the events found so far do not explain.

    Between two events the index is constant. So it is compared at the ends of every piece between events, close to
    them; where it differs the piece is halved until the change is located or turns out to be a fold.
    """
    begin, end = segment.begin, segment.end
    if begin.morse_index is None or end.morse_index is None:
        return []
    marks = [h.theta for h in found if not isinstance(h.event, EventPoint)]
    if begin.morse_index == end.morse_index and not marks:
        return []
    if len(marks) == 1 and abs(begin.morse_index - end.morse_index) == 1:
        return []

    def index(theta: float) -> int | None:
        return annotated(point_on(segment, theta, options)[0]).morse_index

    edges = [0.0, *sorted(marks), 1.0]
    changes = []
    for left, right in pairwise(edges):
        # Right at an event the index is undecided; a small distance from it, it is not.
        aside = 1e-3 * (right - left)
        first = begin.morse_index if left == 0.0 else index(left + aside)
        last = end.morse_index if right == 1.0 else index(right - aside)
        inside = (left + (aside if left > 0 else 0.0), right - (aside if right < 1 else 0.0))
        if first is not None and last is not None and first != last:
            changes += _halve(segment, index, inside, (first, last), options)
    return changes


def _halve(
    segment: Segment,
    index: Callable[[float], int | None],
    interval: tuple[float, float],
    values: tuple[int, int],
    options: Options,
) -> list[Happening]:
    """Locate the changes of the index in an interval by bisection."""
    left, right = interval
    first, last = values
    for _ in range(HALVINGS):
        middle = (left + right) / 2
        value = index(middle)
        if value is None:
            break
        if value not in (first, last):
            return _halve(segment, index, (left, middle), (first, value), options) + _halve(
                segment, index, (middle, right), (value, last), options
            )
        if value == first:
            left = middle
        else:
            right = middle
    theta = (left + right) / 2
    if options.detect_folds:
        fold = _fold_by_newton(segment, theta, near=1e-3)
        if fold is not None:
            return [replace(fold, event=replace(fold.event, point=annotated(fold.event.point)))]
    point = annotated(point_on(segment, theta, options)[0], label="index change")
    width = right - left
    change = segment.end.x - segment.begin.x
    located = IndexChange(
        point,
        width * abs(segment.end.parameter - segment.begin.parameter),
        width * size_of(point.problem, change),
        before=first,
        after=last,
    )
    return [Happening(theta, located)]
