"""The other curve through a branch point."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from contbranch.continuation.curve import BranchPoint, Curve, End, Outcome, Point
from contbranch.continuation.edge import Range
from contbranch.continuation.events import Event
from contbranch.continuation.follow import Branch, Course
from contbranch.continuation.metric import Balance, Metric
from contbranch.continuation.newton import CorrectionError
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import Direction
from contbranch.continuation.trace import interval_around, joined
from contbranch.continuation.walk import annotated, corrected_point
from contbranch.errors import InputError

# Shortest step off the branch point, in the metric; up to a hundred times as long ones are tried.
FIRST_STEP = 1e-4
# The point reached must be this much closer to the crossing curve's tangent than the curve given is.
CLOSER_RATIO = 0.3


def switch_branch(
    curve: Curve,
    branch_point: BranchPoint,
    parameter_range: tuple[float, float],
    options: Options | None = None,
    *,
    events: Sequence[Event] = (),
    stop: StopAt | None = None,
    callback: Callable[[Point], object] | None = None,
    stability: bool = False,
    time_limit: float | None = None,
    norm_limit: float | None = None,
) -> list[Curve]:
    """Follow the curves that cross at a branch point, without the one given, in both directions each.

    The branch point is among the points and events of each. Their directions there are `BranchPoint.tangents`: with one
    crossing curve from the second derivatives of F (Keller's algebraic bifurcation equation, in H. B. Keller, Numerical
    solution of bifurcation and nonlinear eigenvalue problems, in P. H. Rabinowitz, Applications of Bifurcation Theory,
    Academic Press 1977), with several from solutions close by. The first point on either side comes from Newton's
    method in the plane normal to the direction.

    Parameters
    ----------
    curve : Curve
        The curve on which the branch point was found.
    branch_point : BranchPoint
        One of `curve.branch_points`.
    parameter_range : (float, float)
        Lowest and highest parameter, as for `trace_curve`.
    options : Options, optional
        Step control, tolerances.
    events, stop, callback, stability, time_limit, norm_limit
        As for `trace_curve`.

    Returns
    -------
    list of Curve
        Oriented so that the parameter does not decrease at the branch point; empty where no point off the given
        curve is reached.

    Raises
    ------
    InputError
        If the branch point is not one of the curve, lies outside the range, or no crossing direction is known.
    """
    if all(branch_point is not known for known in curve.branch_points):
        raise InputError("branch_point is not one of the curve's: give one of curve.branch_points.")
    if len(branch_point.tangents) < 2:
        raise InputError("branch_point has no known crossing direction: more than two curves may meet there.")
    interval = interval_around(parameter_range, branch_point.parameter)
    course = Course(options, events, stop, callback, stability, time_limit, norm_limit)
    branch_point.point.problem.residual(branch_point.x, branch_point.parameter)  # a curve from a file raises here

    def crossing_curves() -> list[Curve]:
        found = (_crossing(branch_point, k, interval, course) for k in range(1, len(branch_point.tangents)))
        return [curve for curve in found if curve is not None]

    found, watch = course.curves(crossing_curves)
    return watch.passed(found)


def _crossing(branch_point: BranchPoint, k: int, interval: Range, course: Course) -> Curve | None:
    """Follow the curve of the k-th tangent in both directions; None if no point of it is reached."""
    options, balance = course.options, Balance(*branch_point.scales)
    metric = balance.metric(options.weight, options.state_floor)
    problem, (u, a) = branch_point.point.problem, branch_point.tangents[k]
    if a < 0:
        u, a = -u, -a
    halves = []
    for along in ((u, a), (-u, -a)):
        start = _beside(branch_point, along, metric, options)
        if start is None or not interval.contains(start.parameter):
            halves.append(Branch([], [], End(Outcome.START_FAILED, "(No point beside the branch point.)")))
            continue
        half = course.follow(start, balance, interval)
        if half.end.outcome is Outcome.CLOSED:
            return joined(start, half, Branch([], [], half.end))
        halves.append(Branch([start, *half.points], [(event, i + 1) for event, i in half.events], half.end))
    if not any(half.points for half in halves):
        return None
    u, a = metric.unit(problem, u, a)
    centre = replace(branch_point.point, tangent_x=u, tangent_parameter=a, determinant_sign=None)
    others = [tangent for i, tangent in enumerate(branch_point.tangents) if i != k]
    crossing = replace(branch_point, point=centre, tangents=((u, a), *others), before=None, after=None)
    forward, backward = halves
    # The branch point itself comes right before the points of the forward half.
    return joined(centre, replace(forward, events=[(crossing, -1), *forward.events]), backward)


def _beside(branch_point: BranchPoint, along: Direction, metric: Metric, options: Options) -> Point | None:
    """Return a point of the crossing curve a short step off the branch point, its tangent away from it."""
    here, problem = branch_point.point, branch_point.point.problem
    u, a = metric.unit(problem, *along)
    cosine = metric.dot(problem, u, a, *metric.unit(problem, here.tangent_x, here.tangent_parameter))
    allowed = CLOSER_RATIO * math.sqrt(max(1 - cosine**2, 0.0))
    for step in (FIRST_STEP, 10 * FIRST_STEP, 100 * FIRST_STEP):
        x, p = here.x + step * u, here.parameter + step * a
        try:
            point, bordered = corrected_point(problem, (x, p), (u, a), metric, options)
            if metric.norm(problem, point.x - x, point.parameter - p) <= allowed * step:
                return annotated(replace(point, determinant_sign=bordered.determinant_sign()))
        except CorrectionError:
            continue
    return None
