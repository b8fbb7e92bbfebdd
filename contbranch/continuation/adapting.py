"""Carrying a point and its tangent over to another discretisation."""

from __future__ import annotations

import math
from collections.abc import Callable

from contbranch.continuation.curve import Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import CorrectionError, correct, tangent_at
from contbranch.continuation.options import Options
from contbranch.continuation.outcomes import Outcome
from contbranch.continuation.problem import Adaptation, Array, Problem
from contbranch.continuation.walk import annotated, to_point

__all__ = ["adapted"]

# Below this parameter component (in the metric) the sign of dp/ds does not orient a tangent reliably.
NEARLY_VERTICAL = 0.05


def adapted(point: Point, metric: Metric, options: Options) -> tuple[Point, Callable[[Array], Array] | None]:
    """Return the point on the discretisation its problem prefers, and what carries earlier ones there, if possible.

    Raises
    ------
    CorrectionError
        If the point cannot be corrected there.
    """
    problem = point.problem
    if type(problem).adapt is Problem.adapt:
        return point, None
    try:
        offer = problem.adapt(point.x, point.parameter)
    except Exception as error:  # the user's code ends the curve, its text is kept
        detail = f"({type(error).__name__} in adapt at parameter {point.parameter:.6g}: {error})"
        raise CorrectionError(Outcome.EVALUATION_FAILED, detail) from error
    if offer is None:
        return point, None
    if not isinstance(offer, Adaptation):
        offer = Adaptation(problem, offer)
    direction = _direction(point, offer, metric)
    size = metric.norm(offer.problem, *direction)
    row = metric.row(offer.problem, direction[0] / size, direction[1] / size)
    corrected = correct(
        offer.problem, offer.x, point.parameter, row, metric, tolerance=options.tolerance, noise=options.noise
    )
    return annotated(to_point(offer.problem, corrected, metric), label=point.label), offer.transfer


def _direction(point: Point, offer: Adaptation, metric: Metric) -> tuple[Array, float]:
    """Return the old tangent on the new discretisation, or a new tangent oriented like the old one."""
    if offer.transfer is not None:
        return offer.transfer(point.tangent_x), point.tangent_parameter
    if offer.x.shape == point.x.shape:
        return point.tangent_x, point.tangent_parameter
    u, a, _ = tangent_at(offer.problem, offer.x, point.parameter)
    size = metric.norm(offer.problem, u, a)
    u, a = u / size, a / size
    old = point.tangent_parameter
    if abs(old) > NEARLY_VERTICAL * metric.parameter_scale:
        same = (a > 0) == (old > 0)
    else:
        same = _agreement(point, offer, u, a) >= 0
    return (u, a) if same else (-u, -a)


def _agreement(point: Point, offer: Adaptation, u: Array, a: float) -> float:
    """Return how well two tangents agree, by the changes of the observables along them (and of the parameter)."""
    before = _changes(point.problem, point.x, point.parameter, point.tangent_x, point.tangent_parameter)
    after = _changes(offer.problem, offer.x, point.parameter, u, a)
    return sum(before[name] * after[name] for name in before if name in after)


def _changes(problem: Problem, x: Array, p: float, u: Array, a: float) -> dict[str, float]:
    """Return the directional derivatives of the observables, scaled to values of order one, and of the parameter."""
    size = math.sqrt(problem.inner(u, u) + a * a)
    step = 1e-6 * max(1.0, math.sqrt(problem.inner(x, x))) / size
    above, below = problem.observables(x + step * u, p + step * a), problem.observables(x - step * u, p - step * a)
    changes = {name: (above[name] - below[name]) / (2 * step) for name in above}
    largest = max((abs(change) for change in changes.values()), default=0.0)
    scaled = {name: change / largest for name, change in changes.items()} if largest > 0 else {}
    return {"": a / size, **scaled}
