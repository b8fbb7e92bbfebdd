"""Everything that happens inside one step: folds, branch points, changes of index and user events."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from contbranch.continuation.branching import locate_branch_point, unresolved_branch_point
from contbranch.continuation.curve import EventPoint, Fold, IndexChange, Located, Point
from contbranch.continuation.events import Event
from contbranch.continuation.folds import locate_fold
from contbranch.continuation.locate import Sample, find_root, sign_changes
from contbranch.continuation.newton import CorrectionError
from contbranch.continuation.options import Options
from contbranch.continuation.outcomes import Outcome
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import annotated, point_on

__all__ = ["Happening", "LeapError", "scan"]

# A quadratic for the slope (or three values of an event) that falls inside the step below this share of its values at
# the ends is followed up by points of the curve: the cubic is not to be trusted beyond that.
SUSPICIOUS = 0.5
# So is a value smaller than this share of the variation over the step: the cubic's own error is of that size.
DOUBTFUL = 0.03
# An extremum of the parameter closer to a branch point than this share of the step is the branch point itself. On the
# curve next to it the matrix is nearly singular, so an extremum found without the bordered system is less certain.
COINCIDENT = 1e-6
COINCIDENT_ON_CURVE = 1e-2
# Where a step that begins on a zero is taken to begin.
BEYOND = 1e-6
# How often a step is halved to explain a change of the Morse index.
HALVINGS = 40


class LeapError(Exception):
    """The step has leapt from one part of the curve to another: both ends lie on it, but not as neighbours."""


@dataclass(frozen=True, slots=True, eq=False)
class Happening:
    """A located event, its position θ within the step, and whether the curve is to end there."""

    theta: float
    event: Located
    terminal: bool = False


def scan(segment: Segment, events: Sequence[Event], options: Options) -> list[Happening]:
    """Return what happens between two points of the curve, in order.

    Raises
    ------
    LeapError
        If the bordered determinant changes sign without a branch point in between.
    CorrectionError
        If the problem fails inside the step.
    """
    found: list[Happening] = []
    begin, end = segment.begin, segment.end
    branch = None
    if options.detect_branch_points and begin.determinant_sign is not None:
        crossed = end.determinant_sign is not None and begin.determinant_sign != end.determinant_sign
        if crossed:
            branch = locate_branch_point(segment) or unresolved_branch_point(segment)
            if branch is None:
                raise LeapError
            found.append(Happening(branch[0], replace(branch[1], point=annotated(branch[1].point))))
    if options.detect_folds:
        folds = _folds(segment, options)
        if branch is not None:
            folds = [fold for fold in folds if not _coincident(segment, fold.event, branch[1])]
        found += folds
    for event_function in events:
        found += _zeros(segment, event_function, options)
    found += _unexplained(segment, found, options)
    return sorted(found, key=lambda happening: happening.theta)


def _suspicious_slope(segment: Segment) -> float | None:
    """Return the θ where the slope of the cubic p(θ) comes closest to zero between ends of one sign, if close."""
    _, c1, c2, c3 = segment.parameter_coefficients()
    sign = math.copysign(1.0, c1)
    if c3 * sign <= 0.0:
        return None  # the slope is largest, not smallest, inside
    theta = -c2 / (3 * c3)
    if not -0.1 < theta < 1.1:
        return None
    theta = min(max(theta, 0.01), 0.99)
    lowest = sign * (c1 + theta * (2 * c2 + theta * 3 * c3))
    ends = min(abs(c1), abs(c1 + 2 * c2 + 3 * c3))
    variation = abs(2 * c2) + abs(3 * c3)
    return theta if lowest < max(SUSPICIOUS * ends, DOUBTFUL * variation) else None


def _folds(segment: Segment, options: Options) -> list[Happening]:
    begin, end = segment.begin.tangent_parameter, segment.end.tangent_parameter
    if begin == 0.0:
        return []  # the step starts on a fold, which the step before has reported
    same = end != 0.0 and (begin > 0) == (end > 0)
    guess = _suspicious_slope(segment) if same else None
    if same and guess is None:
        return []

    def slope(theta: float) -> float:
        return point_on(segment, theta, options)[0].tangent_parameter

    brackets = sign_changes(slope, (0.0, begin), (1.0, end), guess)
    found = []
    for first, last in brackets:
        start = _line_zero(first, last) if same else _cubic_zero(segment)
        fold = _fold_by_newton(segment, start, first[0], last[0], last[1])
        if fold is None:
            theta = find_root(slope, first, last)
            near = max(1e-6, 0.1 * (last[0] - first[0]))
            fold = _fold_by_newton(segment, theta, theta - near, theta + near, last[1])
            fold = fold or _fold_on_curve(segment, theta, options)
        found.append(fold)
    return [replace(one, event=replace(one.event, point=annotated(one.event.point))) for one in found]


def _coincident(segment: Segment, fold: Located, branch: Located) -> bool:
    """Whether an extremum of the parameter is that of a curve through a pitchfork rather than a fold."""
    away = segment.metric.norm(segment.begin.problem, fold.x - branch.x, fold.parameter - branch.parameter)
    certain = isinstance(fold, Fold) and math.isfinite(fold.curvature)
    return away < (COINCIDENT if certain else COINCIDENT_ON_CURVE) * segment.length


def _line_zero(first: Sample, last: Sample) -> float:
    return first[0] + (last[0] - first[0]) * first[1] / (first[1] - last[1])


def _cubic_zero(segment: Segment) -> float:
    """Return the zero of the cubic's slope in a step whose ends have slopes of opposite sign."""
    _, c1, c2, c3 = segment.parameter_coefficients()
    root = math.sqrt(max(c2 * c2 - 3 * c1 * c3, 0.0))
    # Of the two forms of either root the one without cancellation: q is the larger of -c2 ± root in modulus.
    q = -(c2 + math.copysign(root, c2))
    candidates = [q / (3 * c3) if c3 != 0.0 else math.nan, c1 / q if q != 0.0 else math.nan]
    inside = [theta for theta in candidates if 0.0 <= theta <= 1.0]
    return inside[0] if inside else 0.5


def _fold_by_newton(
    segment: Segment, start: float, lowest: float, highest: float, slope_after: float | None = None
) -> Happening | None:
    """Locate a fold by bordered Newton iteration; None unless it converges into the bracket.

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
    slack = 1e-3 * (highest - lowest) if highest - lowest < 0.5 else 0.1
    if not lowest - slack <= theta <= highest + slack:
        return None
    near_x, near_p = segment.at(min(max(theta, 0.0), 1.0))
    away = segment.metric.norm(segment.begin.problem, fold.x - near_x, fold.parameter - near_p)
    return Happening(theta, fold) if away <= 0.2 * segment.length else None


def _fold_on_curve(segment: Segment, theta: float, options: Options) -> Happening:
    """Return a fold as the zero of the slope along the curve, where the bordered system does not converge."""
    point, _ = point_on(segment, theta, options)
    problem = point.problem
    norm = math.sqrt(problem.inner(point.tangent_x, point.tangent_x))
    error = abs(point.tangent_parameter) * segment.length * 1e-6 + 1e-14 * abs(point.parameter)
    fold = Fold(
        replace(point, label="fold"),
        error,
        1e-8 * segment.length * segment.metric.state_scale,
        null_vector=point.tangent_x / norm,
    )
    return Happening(theta, fold)


def _zeros(segment: Segment, event: Event, options: Options) -> list[Happening]:
    """Return the zeros of a user's event function inside the step, a pair between ends of the same sign included."""

    def value(theta: float) -> float:
        return _value(event, point_on(segment, theta, options)[0])

    begin, end = (0.0, _value(event, segment.begin)), (1.0, _value(event, segment.end))
    if begin[1] == 0.0:
        begin = (BEYOND, value(BEYOND))  # the zero itself was reported by the step before
    guess = None
    if end[1] != 0.0 and (begin[1] > 0) == (end[1] > 0):
        guess = _suspicion(segment, event, begin[1], end[1])
        if guess is None:
            return []
    found = []
    for first, last in sign_changes(value, begin, end, guess):
        theta = find_root(value, first, last)
        point = annotated(point_on(segment, theta, options)[0], label=event.name)
        steepness = abs(last[1] - first[1]) / (last[0] - first[0])
        miss = abs(_value(event, point)) / steepness + 1e-15
        change = segment.end.x - segment.begin.x
        located = EventPoint(
            point,
            4 * miss * abs(segment.end.parameter - segment.begin.parameter) + 1e-15 * abs(point.parameter),
            4 * miss * math.sqrt(point.problem.inner(change, change)),
            name=event.name,
        )
        found.append(Happening(theta, located, event.terminal))
    return found


def _suspicion(segment: Segment, event: Event, begin: float, end: float) -> float | None:
    """Return the θ where two zeros may hide between ends of the same sign, by points of the cubic."""
    sign = 1.0 if begin > 0 else -1.0
    samples = []
    for theta in (0.25, 0.5, 0.75):
        x, p = segment.at(theta)
        dx, dp = segment.direction(theta)
        size = segment.metric.norm(segment.begin.problem, dx, dp)
        point = replace(segment.begin, x=x, parameter=p, tangent_x=dx / size, tangent_parameter=dp / size)
        samples.append((sign * _value(event, point), theta))
    lowest, theta = min(samples)
    ends = min(abs(begin), abs(end))
    variation = max(abs(begin), abs(end), max(samples)[0]) - min(ends, lowest)
    # Three samples see a parabola's dip down to a quarter of a step from its bottom, unless that is beside an end.
    return theta if min(lowest, ends) < DOUBTFUL * variation or lowest < 0.75 * ends else None


def _value(event: Event, point: Point) -> float:
    try:
        value = float(event.value(point))
    except Exception as error:  # the user's code ends the attempt, its text is kept
        detail = f"({type(error).__name__} in event {event.name!r} at parameter {point.parameter:.6g}: {error})"
        raise CorrectionError(Outcome.EVALUATION_FAILED, detail) from error
    if not math.isfinite(value):
        raise CorrectionError(Outcome.NOT_FINITE, f"(Event {event.name!r} at parameter {point.parameter:.6g}.)")
    return value


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
        fold = _fold_by_newton(segment, theta, theta - 1e-3, theta + 1e-3)
        if fold is not None:
            return [replace(fold, event=replace(fold.event, point=annotated(fold.event.point)))]
    point = annotated(point_on(segment, theta, options)[0], label="index change")
    width = right - left
    change = segment.end.x - segment.begin.x
    located = IndexChange(
        point,
        width * abs(segment.end.parameter - segment.begin.parameter),
        width * math.sqrt(point.problem.inner(change, change)),
        before=first,
        after=last,
    )
    return [Happening(theta, located)]
