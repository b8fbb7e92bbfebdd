"""Step control: whether a step is good, and how long the next one should be."""

from __future__ import annotations

import math
from dataclasses import dataclass

from contbranch.continuation.curve import Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import Corrected
from contbranch.continuation.options import Options

__all__ = ["AFTER_FAILURE", "Judgement", "judge"]

# Newton's contraction that the step control aims at: a few digits more with every iteration (P. Deuflhard, Newton
# Methods for Nonlinear Problems, Springer 2011, sec. 5.1, aims at 1/4 to 1/8).
CONTRACTION = 0.1
# A failed step says nothing about how much too long it was.
AFTER_FAILURE = 0.3


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether a step is accepted, and the factor from its length to that of the next attempt."""

    accepted: bool
    factor: float


def judge(begin: Point, end: Point, corrected: Corrected, metric: Metric, options: Options) -> Judgement:
    """Judge a step by true tangents and by the contraction of Newton's method.

    The angle between the tangents at both ends, and the angles between either of them and the chord, must stay below
    the limit: the first guards against steps round a fold, the others against a step that leaps onto another part
    of the curve (whose tangent may happen to be parallel).
    """
    problem = begin.problem
    chord_x, chord_p = end.x - begin.x, end.parameter - begin.parameter
    length = metric.norm(problem, chord_x, chord_p)
    if length == 0.0:
        return Judgement(False, AFTER_FAILURE)
    chord_x, chord_p = chord_x / length, chord_p / length
    angle = metric.angle(problem, begin.tangent_x, begin.tangent_parameter, end.tangent_x, end.tangent_parameter)
    leave = metric.angle(problem, begin.tangent_x, begin.tangent_parameter, chord_x, chord_p)
    arrive = metric.angle(problem, end.tangent_x, end.tangent_parameter, chord_x, chord_p)
    # On an arc either angle with the chord is half the angle between the tangents.
    worst = max(angle, 2 * leave, 2 * arrive)
    factor = options.angle / worst if worst > 0 else math.inf
    if worst > options.angle_limit:
        return Judgement(False, min(max(0.8 * factor, 0.1), 0.7))
    if corrected.contraction > CONTRACTION:
        factor = min(factor, math.sqrt(CONTRACTION / corrected.contraction))
    return Judgement(True, min(max(factor, 0.2), options.growth))
