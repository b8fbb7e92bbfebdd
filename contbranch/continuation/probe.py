"""Brackets of the zeros of a function along one step, pairs hidden between ends of the same sign included.

The cubic through both ends shows what the function does inside the step; how far it can be trusted is known from how
well the cubic of the step before foretold this step's end. Where that leaves room for a hidden pair of zeros, points of
the curve itself are computed inside the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

from contbranch.continuation.curve import Point
from contbranch.continuation.locate import Sample, sign_changes
from contbranch.continuation.options import Options
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on

__all__ = [
    "Bracket",
    "Probe",
    "brackets",
    "doubt_about",
    "doubt_about_parameter",
    "no_hidden_folds",
    "slope_keeps_sign",
    "surprise",
]

Value = Callable[[Point], float]
Cubic = tuple[float, float, float, float]

# Largest error of the derivative of a cubic Hermite interpolant, h³ f''''/216 √3.
INTERPOLATION = math.sqrt(3) / 216
# Estimates of errors are good to a factor of a few.
SAFETY = 4.0
# The cubic is not trusted beyond this share of a function's variation over the step.
TRUST = 0.03
# A value inside that falls below this share of the smaller one of both ends is followed up in any case.
SUSPICIOUS = 0.5
# Below this dp/ds (in the metric) the parameter rests up to rounding.
RESTING = 1e-8
# How often a step is halved in search of hidden zeros.
DEPTH = 6


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """Two samples of opposite sign on a segment (a step or part of one).

    Attributes
    ----------
    segment : Segment
        The part of the step.
    first, last : (position, value)
        Samples, positions within that part.
    offset, share : float
        Position θ in the part is offset + share θ in the whole step.
    """

    segment: Segment
    first: Sample
    last: Sample
    offset: float = 0.0
    share: float = 1.0

    def whole(self, theta: float) -> float:
        """Return the position within the whole step."""
        return self.offset + self.share * theta


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """A function along the curve, and the error to be expected of its values on the cubic.

    `doubt` is None where no earlier step tells.
    """

    value: Value
    options: Options
    doubt: float | None


def foretold_to_inside(ratio: float) -> float:
    """Return the share of the error of the foretold slope at the end that is to be expected inside the step.

    With h the earlier step and θ = 1 + ratio, the cubic's slope is wrong by θ (θ - 1) (2 θ - 1)/12 h³ f'''' where it
    is extrapolated to, and by at most √3/216 (ratio h)³ f'''' inside the new step.
    """
    theta = 1 + ratio
    return INTERPOLATION * ratio**3 / (theta * (theta - 1) * (2 * theta - 1) / 12)


def doubt_about_parameter(segment: Segment, previous: Segment | None) -> float | None:
    """Return the error to be expected of the cubic's dp/dθ inside a step."""
    if previous is None or previous.length == 0.0:
        return None
    return doubt_about(
        segment.parameter_coefficients(), previous.parameter_coefficients(), segment.length / previous.length
    )


def doubt_about(cubic: Cubic, previous: Cubic, ratio: float) -> float:
    """Return the error to be expected of a cubic's slope inside a step, `ratio` times as long as the step before."""
    return SAFETY * foretold_to_inside(ratio) * _foretold_slope_error(cubic, previous, ratio)


def surprise(segment: Segment, previous: Segment | None) -> float:
    """Return the error of dp/dθ foretold for the end of a step, relative to dp/dθ; 0 where p rests or none is known."""
    if previous is None or previous.length == 0.0:
        return 0.0
    begin = abs(segment.begin.tangent_parameter * segment.scale_begin)
    end = abs(segment.end.tangent_parameter * segment.scale_end)
    largest = max(begin, end)
    if largest < RESTING * segment.length * segment.metric.parameter_scale:
        return 0.0
    ratio = segment.length / previous.length
    error = _foretold_slope_error(segment.parameter_coefficients(), previous.parameter_coefficients(), ratio)
    return error / largest


def _foretold_slope_error(cubic: Cubic, previous: Cubic, ratio: float) -> float:
    """Return the difference between the slope at the end of a step and what the cubic of the step before foretold."""
    theta = 1 + ratio
    _, c1, c2, c3 = previous
    foretold = (c1 + theta * (2 * c2 + theta * 3 * c3)) * ratio
    _, e1, e2, e3 = cubic
    return abs(foretold - (e1 + 2 * e2 + 3 * e3))


def no_hidden_folds(segment: Segment, doubt: float | None) -> bool:
    """Whether the slope of the cubic p(θ) has one sign on the step and stays farther from zero than its error."""
    return slope_keeps_sign(segment.parameter_coefficients(), doubt)


def slope_keeps_sign(cubic: Cubic, doubt: float | None) -> bool:
    """Whether the slope of a cubic has one sign on the step and stays farther from zero than its error."""
    if doubt is None:
        return False
    _, c1, c2, c3 = cubic
    end = c1 + 2 * c2 + 3 * c3
    if (c1 > 0) != (end > 0) or c1 == 0.0 or end == 0.0:
        return False
    sign = math.copysign(1.0, c1)
    lower, higher = min(abs(c1), abs(end)), max(abs(c1), abs(end))
    lowest = lower
    if c3 * sign > 0.0 and 0.0 < -c2 / (3 * c3) < 1.0:
        lowest = sign * (c1 - c2 * c2 / (3 * c3))
    return lowest > max(doubt, TRUST * (higher - lowest), SUSPICIOUS * lower)


def brackets(segment: Segment, probe: Probe, begin: float, end: float) -> list[Bracket]:
    """Return brackets of all zeros of a function inside a step, given its values at both ends."""
    return _brackets(segment, probe.value, begin, end, probe.doubt, probe.options, DEPTH, 0.0, 1.0)


def _brackets(
    segment: Segment,
    value: Value,
    begin: float,
    end: float,
    doubt: float | None,
    options: Options,
    depth: int,
    offset: float,
    share: float,
) -> list[Bracket]:
    opposite = end == 0.0 or (begin > 0) != (end > 0)
    whole = Bracket(segment, (0.0, begin), (1.0, end), offset, share)
    if depth == 0:
        return [whole] if opposite else []
    sign = 1.0 if begin > 0 else -1.0
    inside = [sign * value_on_cubic(segment, theta, value) for theta in (0.25, 0.5, 0.75)]
    values = [sign * begin, *inside, sign * end]
    variation = max(values) - min(values)
    error = math.inf if doubt is None else max(doubt, TRUST * variation)
    if opposite:
        crossings = sum((a > 0) != (b > 0) for a, b in pairwise(values))
        if crossings == 1 and error < 0.3 * max(abs(begin), abs(end)):
            return [whole]
    else:
        bend = max(abs(values[i - 1] - 2 * values[i] + values[i + 1]) for i in (1, 2, 3))
        # Between samples a parabola dips by an eighth of their second difference.
        if min(values) - bend / 8 > max(error, SUSPICIOUS * min(abs(begin), abs(end))):
            return []
        if error < 0.1 * variation:
            guess = min((w, theta) for w, theta in zip(inside, (0.25, 0.5, 0.75), strict=True))[1]
            found = sign_changes(
                lambda theta: value(point_on(segment, theta, options)[0]), (0.0, begin), (1.0, end), guess
            )
            return [Bracket(segment, first, last, offset, share) for first, last in found]
    middle, _ = point_on(segment, 0.5, options)
    at_middle = value(middle)
    discrepancy = abs(sign * at_middle - inside[1])
    left_over = SAFETY * discrepancy + (0.0 if doubt is None else doubt / 8)
    left, right = Segment(segment.begin, middle, segment.metric), Segment(middle, segment.end, segment.metric)
    half = share / 2
    found_left = _brackets(left, value, begin, at_middle, left_over, options, depth - 1, offset, half)
    if at_middle == 0.0:
        at_middle = -begin  # the zero itself belongs to the left half
    return found_left + _brackets(right, value, at_middle, end, left_over, options, depth - 1, offset + half, half)


def value_on_cubic(segment: Segment, theta: float, value: Value) -> float:
    """Return the value of a function at a point of the cubic, which is close to the curve but not on it."""
    x, p = segment.at(theta)
    dx, dp = segment.direction(theta)
    size = segment.metric.norm(segment.begin.problem, dx, dp)
    return value(replace(segment.begin, x=x, parameter=p, tangent_x=dx / size, tangent_parameter=dp / size, label=""))
