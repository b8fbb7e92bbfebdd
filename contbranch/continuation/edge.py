"""The ends of a curve: landing exactly on an edge of the parameter range, and coming back to the start."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation.curve import End, Outcome, Point
from contbranch.continuation.locate import find_root
from contbranch.continuation.metric import ROUNDING, Balance
from contbranch.continuation.newton import CorrectionError, correct
from contbranch.continuation.options import Options
from contbranch.continuation.problem import size_of
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on, to_point

# Factor by which a state grows, while the parameter is at rest, that runs to infinity; and, where values overflow or
# Newton's method fails, the factor from which on that is the reason.
ESCAPE_GROWTH, OVERFLOW_GROWTH = 1e2, 2.0
OVERFLOWS = (Outcome.NOT_FINITE, Outcome.STEP_TOO_SMALL, Outcome.EVALUATION_FAILED, Outcome.MAXIMUM_POINTS)
# Distance from the start, as a share of the step, at which a closed curve comes back to it.
CLOSED = 1e-5


@dataclass(frozen=True, slots=True)
class Range:
    """The interval of the parameter in which a curve is followed."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """Length of the interval."""
        return self.high - self.low

    def contains(self, p: float) -> bool:
        """Whether a parameter lies in the interval, edges included."""
        return self.low <= p <= self.high

    def edge_beyond(self, p: float) -> float | None:
        """Return the edge that lies between p and the interval, None if p is inside."""
        if p > self.high:
            return self.high
        return self.low if p < self.low else None

    def edge_close_to(self, p: float, tolerance: float) -> float | None:
        """Return the edge within tolerance times the width of p, if there is one."""
        if not math.isfinite(self.width):
            return None
        for edge in (self.low, self.high):
            if abs(p - edge) <= tolerance * self.width:
                return edge
        return None


class Escape:
    """Tells when the state of a curve runs to infinity: it grows while the parameter stays where it is.

    Attributes
    ----------
    parameter, size : float
        Where the parameter has come to rest, and the size of the state there, or its scale if that is larger.
    """

    def __init__(self, interval: Range, tolerance: float) -> None:
        self.width, self.tolerance = interval.width, tolerance
        self.parameter = self.last = math.inf
        self.size, self.growth, self.resolution = 0.0, 1.0, 0.0

    def passed(self, point: Point, balance: Balance) -> End | None:
        """Take note of a point; return the end of the curve where there is no more to it."""
        size, path = size_of(point.problem, point.x), max(balance.parameter_total, abs(point.parameter))
        self.resolution = self.tolerance * min(self.width, path)
        if math.isfinite(self.width):
            self.resolution = max(self.resolution, 1e2 * ROUNDING * self.width)
        if not abs(point.parameter - self.parameter) <= self.resolution:
            self.parameter, self.size = point.parameter, max(size, balance.state)
        self.growth, self.last = size / self.size if self.size > 0.0 else 1.0, point.parameter
        return self._end if self.growth > ESCAPE_GROWTH else None

    def explained(self, end: End) -> End:
        """Return the reason of an end on the way to infinity, where values overflow or digits run out."""
        return self._end if end.outcome in OVERFLOWS and self.growth > OVERFLOW_GROWTH else end

    @property
    def _end(self) -> End:
        value = round(self.last / self.resolution) * self.resolution
        return End(Outcome.RUNS_TO_INFINITY, f"(The parameter approaches {value:.9g}.)")


def land(segment: Segment, edge: float, options: Options) -> Point:
    """Return the first point of a segment whose parameter is the edge, exactly.

    Raises
    ------
    CorrectionError
        If the curve cannot be corrected there.
    """
    problem, metric, begin = segment.begin.problem, segment.metric, segment.begin.parameter - edge

    def predicted(theta: float) -> float:
        return segment.at(theta)[1] - edge

    far = predicted(1.0)
    guess = 1.0 if far == 0.0 or (far > 0) == (begin > 0) else find_root(predicted, (0.0, begin), (1.0, far))
    x, _ = segment.at(guess)
    slope = metric.unit(problem, *segment.direction(guess))[1] / metric.parameter_scale
    if abs(slope) > 1e-3:
        fixed = (np.zeros_like(x), math.copysign(1.0, slope) / metric.parameter_scale)
        point = to_point(problem, correct(problem, (x, edge), fixed, metric, options), metric)
        if metric.norm(problem, point.x - x, 0.0) <= 0.2 * segment.length:
            return replace(point, parameter=edge, label="edge")

    # The curve all but touches the edge: there its parameter determines the state badly, its arclength does not.
    def along(theta: float) -> float:
        return point_on(segment, theta, options)[0].parameter - edge

    last = along(1.0)
    if (last > 0) == (begin > 0):
        detail = f"(The edge {edge:.6g} of the parameter range was not found on the curve.)"
        raise CorrectionError(Outcome.STEP_TOO_SMALL, detail)
    point, bordered = point_on(segment, find_root(along, (0.0, begin), (1.0, last)), options)
    return replace(point, parameter=edge, determinant_sign=bordered.determinant_sign(), label="edge")


def closes(segment: Segment, start: Point, options: Options) -> Point | None:
    """Return the start, as the segment's new end, if the curve passes through it inside the segment.

    The curve's own point in the plane through the start must be the start itself, not one of a neighbouring sheet.
    """
    problem, metric = segment.begin.problem, segment.metric
    if start.x.shape != segment.begin.x.shape:
        return None
    theta = segment.position(start.x, start.parameter)
    if not -0.5 < theta < 1.5:
        return None
    theta = segment.foot(start.x, start.parameter, theta)
    if not 0.0 < theta <= 1.0 + 1e-9:
        return None
    try:
        point, _ = point_on(segment, theta, options)
    except CorrectionError:
        return None
    apart = metric.norm(problem, point.x - start.x, point.parameter - start.parameter)
    return start if apart <= CLOSED * segment.length else None
