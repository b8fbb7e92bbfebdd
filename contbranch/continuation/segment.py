"""The piece of curve between two neighbouring points."""

from __future__ import annotations

from contbranch.continuation.curve import Point
from contbranch.continuation.metric import Metric
from contbranch.continuation.problem import Array, Direction, size_of

# Steps towards a point's fraction, which contract by how far it lies off the cubic in units of its radius of curvature.
FEET = 3


class Segment:
    """Two points of a curve on the same discretisation, joined by the cubic that fits both and their tangents.

    Positions are fractions θ from 0 (begin) to 1 (end).
    """

    def __init__(self, begin: Point, end: Point, metric: Metric):
        self.begin, self.end, self.metric = begin, end, metric
        self.chord = end.x - begin.x, end.parameter - begin.parameter
        self.length = metric.norm(begin.problem, *self.chord)
        # Tangents are stored with unit length in the metric of their own step: bring both to that of this one.
        self.scale_begin = self.length / metric.norm(begin.problem, begin.tangent_x, begin.tangent_parameter)
        self.scale_end = self.length / metric.norm(end.problem, end.tangent_x, end.tangent_parameter)

    def at(self, theta: float) -> Direction:
        """Return the cubic's state and parameter at θ (θ > 1 extrapolates)."""
        a, b = self.begin, self.end
        one = 1 - theta
        h00, h01 = (1 + 2 * theta) * one**2, theta**2 * (3 - 2 * theta)
        h10 = theta * one**2 * self.scale_begin
        h11 = -(theta**2) * one * self.scale_end
        x = h00 * a.x + h01 * b.x + h10 * a.tangent_x + h11 * b.tangent_x
        p = h00 * a.parameter + h01 * b.parameter + h10 * a.tangent_parameter + h11 * b.tangent_parameter
        return x, p

    def direction(self, theta: float) -> Direction:
        """Return the cubic's derivative with respect to θ."""
        a, b, (chord_x, chord_p) = self.begin, self.end, self.chord
        d01 = 6 * theta * (1 - theta)
        d10 = (1 - 4 * theta + 3 * theta**2) * self.scale_begin
        d11 = (3 * theta**2 - 2 * theta) * self.scale_end
        x = d01 * chord_x + d10 * a.tangent_x + d11 * b.tangent_x
        p = d01 * chord_p + d10 * a.tangent_parameter + d11 * b.tangent_parameter
        return x, p

    def foot(self, x: Array, p: float, theta: float) -> float:
        """Return the fraction whose plane a point lies in, next to a given one: that of `point_on` of the segment.

        Parts of a segment have cubics of their own, on which a point's fraction is another.
        """
        problem = self.begin.problem
        for _ in range(FEET):
            (near_x, near_p), along = self.at(theta), self.direction(theta)
            size = self.metric.dot(problem, *along, *along)
            theta += self.metric.dot(problem, x - near_x, p - near_p, *along) / size
        return theta

    def position(self, x: Array, p: float) -> float:
        """Return the fraction θ of a point near the segment, by its projection on the chord."""
        a = self.begin
        along = self.metric.dot(a.problem, x - a.x, p - a.parameter, *self.chord)
        return along / self.length**2 if self.length > 0 else 0.0


def segment_between(begin: Point, end: Point) -> Segment:
    """Return the segment between two points in a metric of its own, in which state and parameter count alike."""
    change = size_of(begin.problem, end.x - begin.x), abs(end.parameter - begin.parameter)
    return Segment(begin, end, Metric(change[0] or 1.0, change[1] or 1.0))
