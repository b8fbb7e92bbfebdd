"""Where the curve goes next: polynomials through its last points and tangents, and how far they can be trusted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from contbranch.continuation.curve import Point
from contbranch.continuation.hermite import Hermite
from contbranch.continuation.metric import Metric
from contbranch.continuation.problem import Array

__all__ = ["AIM", "POINTS", "Predictor"]

# Points that the polynomial of highest degree goes through.
POINTS = 3
# An older point is left out where the cosine between its tangent and the present one is below this.
STEEPEST = 0.4
# Error of a prediction, as a share of the step, that is aimed at: Newton's method then takes three or four iterations.
AIM = 0.1
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

    def at(self, s: float) -> list[tuple[Array, float]]:
        """Return the states and parameters foretold for the place s by one, two, ... points."""
        here = self.here
        return [(here.x + moved[:-1], here.parameter + float(moved[-1])) for moved, _ in self._hermite.at(s)]

    def chosen(self, foretold: Sequence[tuple[Array, float]], count: int, reach: float) -> tuple[Array, float]:
        """Return the prediction from `count` points, or from fewer where it strays too far from the tangent."""
        x, p = foretold[0]
        for there, at in foretold[min(count, len(foretold)) - 1 : 0 : -1]:
            if self.metric.norm(self.here.problem, there - x, at - p) <= reach:
                return there, at
        return x, p

    def longest(
        self, s: float, foretold: Sequence[tuple[Array, float]], end: Point, growth: float
    ) -> tuple[float, int]:
        """Return the factor from a step s to the next, and the number of points to foretell that from.

        Parameters
        ----------
        foretold : sequence of (state, parameter)
            What was predicted for the step.
        end : Point
            Where it led.
        growth : float
            Largest factor.
        """
        best = (0.0, 1)
        for count, (x, p) in enumerate(foretold, start=1):
            error = self.metric.norm(self.here.problem, end.x - x, end.parameter - p)
            constant = error / math.prod((s - place) ** 2 for place in self.places[:count])
            places = [0.0, *(place - s for place in self.places)][:count]
            factor = growth
            while factor > SHORTEST and constant * math.prod((factor * s - b) ** 2 for b in places) > AIM * factor * s:
                factor *= 0.9
            best = max(best, (factor, count))
        return best
