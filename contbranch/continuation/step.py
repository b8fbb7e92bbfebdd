"""The next step: where the curve is foretold to go, how far that can be trusted, whether it was good."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contbranch.continuation.curve import Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.newton import Corrected
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array, Direction


class Hermite:
    """The polynomials through values and slopes at the first one, two, three ... of some places, in Newton's form.

    Parameters
    ----------
    places : sequence of float
        All different.
    values, slopes : sequence of float or (n,) arrays
    """

    def __init__(self, places: Sequence[float], values: Sequence[Any], slopes: Sequence[Any]) -> None:
        self._nodes = [place for place in places for _ in range(2)]
        # Divided differences with every place taken twice: the first differences at a double place are the slopes.
        column = [value for value in values for _ in range(2)]
        coefficients = [column[0]]
        for order in range(1, len(column)):
            column = [
                slopes[i // 2]
                if order == 1 and i % 2 == 0
                else (column[i + 1] - column[i]) / (self._nodes[i + order] - self._nodes[i])
                for i in range(len(column) - 1)
            ]
            coefficients.append(column[0])
        self._coefficients = np.array(coefficients)

    def at(self, s: float | Array) -> list[tuple[Any, Any]]:
        """Return value and slope at s of the polynomials through one, two, ... places."""
        basis, slopes = [s * 0.0 + 1.0], [s * 0.0]
        for node in self._nodes[:-1]:
            away = s - node
            slopes.append(slopes[-1] * away + basis[-1])
            basis.append(basis[-1] * away)
        own, rate, coefficients = np.array(basis).T, np.array(slopes).T, self._coefficients
        counts = range(2, len(self._nodes) + 1, 2)
        return [(own[..., :k] @ coefficients[:k], rate[..., :k] @ coefficients[:k]) for k in counts]

    def slopes(self, s: Array) -> list[Array]:
        """Return the slopes of the last two polynomials (of the only one) where s is none of the places."""
        away = np.subtract.outer(s, self._nodes[:-1])
        rates = np.multiply.accumulate(away, axis=1) * np.add.accumulate(1.0 / away, axis=1)
        least = max(len(self._nodes) - 2, 2)
        return [rates[:, : k - 1] @ self._coefficients[1:k] for k in range(least, len(self._nodes) + 1, 2)]


# Points that the polynomial of highest degree goes through.
POINTS = 3
# An older point is left out where the cosine between its tangent and the present one is below this.
STEEPEST = 0.4
# Error of a prediction, as a share of the step, that is aimed at: Newton's method then takes three or four iterations.
PREDICTION_ERROR_SHARE = 0.1
# What a step is at least multiplied by.
SHORTEST = 0.2


class Predictor:
    """Polynomials through the last one, two, three points of a curve and their tangents.

    Close to its last point y0 the curve is a graph over the tangent t0 there: s = <t0, y - y0> is the place of every
    point y, and dy/ds = t/<t0, t>. The corrector works at constant s, so the difference between a predicted and a
    corrected point is the error of the polynomial alone, C Π (s - s_i)² with the places s_i of its points: one step
    measures C for every polynomial, and foretells the length at which each of them is good enough.

    Parameters
    ----------
    points : sequence of Point
        The last points on one discretisation, in order; the tangent of the last one has unit length in the metric.
    metric : Metric
    """

    def __init__(self, points: Sequence[Point], metric: Metric) -> None:
        self.here, self.metric = points[-1], metric
        here = self.here
        self.row = metric.row(here.problem, here.tangent_x, here.tangent_parameter)
        c, d = self.row
        self.places = [0.0]
        moved = [np.zeros(here.x.size + 1)]
        slopes = [np.append(here.tangent_x, here.tangent_parameter)]
        for point in points[-2::-1]:
            chord = np.append(point.x - here.x, point.parameter - here.parameter)
            place = float(c @ chord[:-1]) + d * float(chord[-1])
            along = float(c @ point.tangent_x) + d * point.tangent_parameter
            size = metric.norm(here.problem, point.tangent_x, point.tangent_parameter)
            if not (place < self.places[-1] and along > STEEPEST * size):
                break
            self.places.append(place)
            moved.append(chord)
            slopes.append(np.append(point.tangent_x, point.tangent_parameter) / along)
        self._hermite = Hermite(self.places, moved, slopes)

    def at(self, s: float) -> list[Direction]:
        """Return the states and parameters foretold for the place s by one, two, ... points."""
        here = self.here
        return [(here.x + moved[:-1], here.parameter + float(moved[-1])) for moved, _ in self._hermite.at(s)]

    def chosen(self, foretold: Sequence[Direction], count: int, reach: float) -> Direction:
        """Return the prediction from `count` points, or from fewer where it strays too far from the tangent."""
        x, p = foretold[0]
        for there, at in foretold[min(count, len(foretold)) - 1 : 0 : -1]:
            if self.metric.norm(self.here.problem, there - x, at - p) <= reach:
                return there, at
        return x, p

    def constants(self, s: float, foretold: Sequence[Direction], end: Point) -> list[float]:
        """Return C of the polynomials through one, two, ... points, from where a step s led and what was foretold."""
        found = []
        for count, (x, p) in enumerate(foretold, start=1):
            error = self.metric.norm(self.here.problem, end.x - x, end.parameter - p)
            found.append(error / math.prod((s - place) ** 2 for place in self.places[:count]))
        return found

    def error(self, s: float, constants: Sequence[float], count: int) -> float:
        """Return the error of what `count` points foretell for the place s."""
        count = min(count, len(constants))
        return constants[count - 1] * math.prod((s - place) ** 2 for place in self.places[:count])

    def longest(
        self, s: float, constants: Sequence[float], growth: float, largest: float = math.inf
    ) -> tuple[float, int]:
        """Return the factor from a step s to the next, and the number of points to foretell that from.

        Parameters
        ----------
        constants : sequence of float
            What the step has told, see `constants`.
        growth : float
            Largest factor.
        largest : float
            Error of a prediction from which Newton's method still converges well.
        """
        best = (0.0, 1)
        for count, constant in enumerate(constants, start=1):
            places = [0.0, *(place - s for place in self.places)][:count]
            factor = growth
            while factor > SHORTEST and constant * math.prod((factor * s - b) ** 2 for b in places) > min(
                PREDICTION_ERROR_SHARE * factor * s, largest
            ):
                factor *= 0.9
            best = max(best, (factor, count))
        return best


# ... and at most what the one of a step foretells, which is proportional to the error of the prediction.
FORETOLD_CONTRACTION = 0.3
# Newton's contraction that the step control aims at: a few digits more with every iteration (P. Deuflhard, Newton
# Methods for Nonlinear Problems, Springer 2011, sec. 5.1, aims at 1/4 to 1/8).
CONTRACTION = 0.1
# A failed step says nothing about how much too long it was.
AFTER_FAILURE = 0.5
# Share of the error of a prediction at which Newton's method has failed that the next ones aim at, and the factor by
# which that grows from step to step.
FAILED_ERROR_SHARE, RECOVERY_FACTOR = 0.5, 1.3


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
    chord = end.x - begin.x, end.parameter - begin.parameter
    leaving, arriving = ((point.tangent_x, point.tangent_parameter) for point in (begin, end))
    if metric.norm(problem, *chord) == 0.0 or (problem.ordered and leaving[1] * arriving[1] < 0.0):
        return Judgement(False, AFTER_FAILURE)
    chord = metric.unit(problem, *chord)
    angle = metric.angle(problem, *leaving, *arriving)
    leave, arrive = (metric.angle(problem, *tangent, *chord) for tangent in (leaving, arriving))
    # On an arc either angle with the chord is half the angle between the tangents.
    worst = max(angle, 2 * leave, 2 * arrive)
    factor = options.angle / worst if worst > 0 else math.inf
    if worst > options.angle_limit:
        return Judgement(False, min(max(0.8 * factor, 0.1), 0.7))
    if corrected.contraction > CONTRACTION:
        factor = min(factor, math.sqrt(CONTRACTION / corrected.contraction))
    return Judgement(True, min(max(factor, 0.2), options.growth))
