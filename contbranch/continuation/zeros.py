"""Zeros of functions along one step of a curve, pairs inside the step included.

Inside a step a function is that of the polynomial through both ends and the points around, with their tangents. The
polynomial through one point less tells the error. Where both leave room for a pair of zeros, the step is divided at a
point of the curve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation.curve import Outcome, Point
from contbranch.continuation.locate import find_root
from contbranch.continuation.newton import CorrectionError
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Array
from contbranch.continuation.segment import Segment
from contbranch.continuation.step import STEEPEST, Hermite
from contbranch.continuation.walk import Across, annotated, point_on

__all__ = ["Bracket", "Functions", "Search"]

# The better of two polynomials is trusted within this multiple of their difference: eight times that has been seen.
INTERPOLATION_SAFETY = 10.0
# A part in which both differ by more than this share of the largest value has features that neither of them shows. The
# error where no other point is known is the same share.
RESOLVED_SHARE = 0.01
# A dip below this share of the smaller value of both ends is looked at on the curve in any case.
DIP_SHARE = 0.5
# Samples inside a part: of known quantities the slope costs next to nothing, of a function every value is computed.
SLOPE_SAMPLES, VALUE_SAMPLES = 79, 4
# Points on the curve that the search of one step may cost.
MOST_POINTS = 60
# Points besides its ends that tell what happens in a part.
NEIGHBOURS = 2
# Places closer than this share of a part are one point on two discretisations. A step that begins on a zero is taken to
# begin as far beyond it.
SAME_POINT = 1e-6
# Share of a step or a part by which it is divided aside from a zero or an end, or looked at beside an event.
ASIDE = 1e-3


class Bracket(NamedTuple):
    """A zero of one function in a part of a step.

    Attributes
    ----------
    number : int
        Of the function.
    segment : Segment
        The part.
    first, last : float
        Values at its ends, of opposite sign.
    guess : float
        Where the polynomial has its zero, as a fraction θ of the part.
    offset, share : float
        The fraction θ of the part is offset + share θ in the step.
    """

    number: int
    segment: Segment
    first: float
    last: float
    guess: float
    offset: float = 0.0
    share: float = 1.0

    def whole(self, theta: float) -> float:
        """Return the position within the whole step."""
        return self.offset + self.share * theta


@dataclass(frozen=True, slots=True, eq=False)
class Functions:
    """K functions along a curve.

    Attributes
    ----------
    values : callable
        Their values (K,) at a point.
    options : Options
        For points computed inside a step.
    primitives : callable, optional
        Quantities (K,) at a point whose derivatives along the unit tangent are the functions.
    power : float
        m where the primitives are smooth in p^(1/m) on a curve that the parameter orders.
    shortest : float
        Share of a step below which errors hide what happens: it is not divided any further.
    known : dict
        Values at points already seen.
    """

    values: Callable[[Point], Array]
    options: Options
    primitives: Callable[[Point], Array] | None = None
    power: float = 1.0
    shortest: float = SAME_POINT
    known: dict[Point, Array] = field(default_factory=dict)

    def at(self, point: Point) -> Array:
        """Return the values (K,) at a point."""
        if point not in self.known:
            self.known[point] = np.array(self.values(point), dtype=float)
        return self.known[point]

    def zero(self, bracket: Bracket, resolution: float, relative: float) -> tuple[float, Point]:
        """Return the position θ of the zero in the part of a bracket, and the point of the curve there."""
        seen: dict[float, Point] = {}
        across = Across(bracket.segment, bracket.guess, self.options)

        def value(theta: float) -> float:
            seen[theta] = across.at(theta)
            return float(self.at(seen[theta])[bracket.number])

        first, last = (0.0, bracket.first), (1.0, bracket.last)
        theta = find_root(value, first, last, resolution, relative, bracket.guess)
        if theta not in seen:
            value(theta)
        return theta, seen[theta]


class _Seen(NamedTuple):
    """A point at the place z, with dq/ds for the coordinate q = z^m along the curve."""

    point: Point
    place: float
    rate: float


class _Part(NamedTuple):
    """A part of the step, where in the step it begins, and its share of it."""

    first: _Seen
    last: _Seen
    offset: float = 0.0
    share: float = 1.0


class Search:
    """The zeros of several functions in a step.

    The coordinate q is the place along the chord, or the parameter where that orders the points.

    Parameters
    ----------
    segment : Segment
        The step.
    functions : Functions
    past : sequence of Point
        Earlier points on the same discretisation.
    """

    def __init__(self, segment: Segment, functions: Functions, past: Sequence[Point] = ()) -> None:
        self.segment, self.functions = segment, functions
        self.problem = segment.begin.problem
        self.power = functions.power if self.problem.ordered else 1.0
        begin, end = segment.begin, segment.end
        ends = [one for one in map(self._seen, (begin, end)) if one is not None]
        same = SAME_POINT * (ends[1].place - ends[0].place)
        earlier = [one for one in map(self._seen, past) if one is not None and ends[0].place - one.place > same]
        self.ends, self.seen = ends, [*earlier, *ends]
        value = functions.at(begin)
        if not value.all():  # a zero at the begin belongs to the step before
            beyond = functions.values(point_on(segment, SAME_POINT, functions.options)[0])
            functions.known[begin] = np.where(value == 0.0, beyond, value)
        # A function that vanishes along this part of the curve has no zeros.
        self.rests = functions.known[begin] == 0.0

    def brackets(self) -> list[Bracket]:
        """Return brackets of all zeros."""
        found: list[Bracket] = []
        if self.segment.length == 0.0:
            return found
        parts = [_Part(self.ends[0], self.ends[1])]
        while parts:
            part = parts.pop()
            share, zeros = self._judged(part)
            divisible = part.share > self.functions.shortest and len(self.functions.known) < MOST_POINTS
            if share is not None and divisible:
                parts += self._divided(part, share)
                self.seen.append(parts[-1].last)
                continue
            found += [self._bracket(part, *one) for one in (zeros if share is None else self._crossed(part))]
        return found

    @property
    def points(self) -> list[Point]:
        """The points seen, the earlier ones included, in order."""
        return [one.point for one in sorted(self.seen, key=lambda one: one.place)]

    def _seen(self, point: Point) -> _Seen | None:
        """Return a point over the coordinate, None where the curve is no graph over it."""
        begin, end, metric = self.segment.begin, self.segment.end, self.segment.metric
        rise = end.parameter - begin.parameter
        if self.problem.ordered:
            q, rate = math.copysign(point.parameter, rise * point.parameter), abs(point.tangent_parameter)
        else:
            chord = end.x - begin.x
            q = metric.dot(self.problem, point.x - begin.x, point.parameter - begin.parameter, chord, rise)
            rate = metric.dot(self.problem, point.tangent_x, point.tangent_parameter, chord, rise)
            size = metric.norm(self.problem, point.tangent_x, point.tangent_parameter) * self.segment.length
            if rate < STEEPEST * size and point is not begin and point is not end:
                return None
            rate = max(rate, STEEPEST * size)
        return _Seen(point, math.copysign(abs(q) ** (1 / self.power), q), rate)

    def _judged(self, part: _Part) -> tuple[float | None, list[tuple[int, float]]]:
        """Return where to divide a part, None if its zeros are certain; and functions with the share of their zeros."""
        if part.last.place - part.first.place <= 64 * np.finfo(float).eps * abs(part.first.place):
            return None, self._crossed(part)
        rated = self.functions.primitives is not None  # slopes are those by q
        count = SLOPE_SAMPLES if rated else VALUE_SAMPLES
        shares, zeros = np.linspace(0.0, 1.0, count + 2), list[tuple[int, float]]()
        inside, doubt = self._inside(part, shares)
        ends = np.array([self.functions.at(one.point) / (one.rate if rated else 1.0) for one in part[:2]]).T
        signs = np.copysign(1.0, ends[:, :1])
        values = signs * np.concatenate((ends[:, :1], inside, ends[:, 1:]), axis=1)
        for k in np.flatnonzero(~clear(values, doubt) & ~self.rests):
            share = division(values[k], doubt[k])
            if share is not None:
                return share, zeros
            if values[k, -1] > 0.0:
                continue
            i = int(np.argmax(values[k] <= 0.0))
            if not _falls(values[k], doubt[k], i):  # there may be two zeros more
                return float(shares[i - 1] + shares[i]) / 2, zeros
            ahead = values[k, i - 1] / (values[k, i - 1] - values[k, i])
            zeros.append((int(k), float(shares[i - 1] + ahead * (shares[i] - shares[i - 1]))))
        return None, zeros

    def crossed(self) -> list[Bracket]:
        """Return brackets of the zeros that the ends of the step tell, without a look inside."""
        part = _Part(self.ends[0], self.ends[1])
        return [self._bracket(part, *one) for one in self._crossed(part)]

    def _crossed(self, part: _Part) -> list[tuple[int, float]]:
        """Return the zeros that the ends of a part tell, where it is not divided any further."""
        first, last = (self.functions.at(one.point) for one in part[:2])
        crossed = ~self.rests & ((first > 0) != (last > 0))
        return [(int(k), float(first[k] / (first[k] - last[k]))) for k in np.flatnonzero(crossed)]

    def _stretch(self, place: Array) -> Array:
        """Return dq/dz."""
        return np.asarray(self.power * np.abs(place) ** (self.power - 1.0))

    def _inside(self, part: _Part, shares: Array) -> tuple[Array, Array]:
        """Return the functions inside a part and their errors, (K, n) each, without the first and last share.

        Of functions with primitives their derivatives by q, which have the same zeros.
        """
        begin, length = part.first.place, part.last.place - part.first.place
        away = {abs(one.place - begin - length / 2) - length / 2: one for one in self.seen}
        besides = [away[far] for far in sorted(away) if far > SAME_POINT * length]
        nodes = [part.first, part.last, *besides[:NEIGHBOURS]]
        places, at = [one.place for one in nodes], begin + shares[1:-1] * length
        stretches = self._stretch(np.array(places)) / np.array([one.rate for one in nodes])
        if self.functions.primitives is None:
            return self._evaluated(part, nodes, stretches, at)
        held = [self.functions.primitives(one.point) for one in nodes]
        slopes = [self.functions.at(one.point) * stretch for one, stretch in zip(nodes, stretches, strict=True)]
        found = [slope.T / self._stretch(at) for slope in Hermite(places, held, slopes).slopes(at)]
        return found[-1], self._differ(found if besides else found[-1:])

    def _evaluated(self, part: _Part, nodes: Sequence[_Seen], stretches: Array, at: Array) -> tuple[Array, Array]:
        """Return functions without primitives at predicted states: those of the polynomials through the points."""
        points = [one.point for one in nodes]
        states = [np.append(point.x, point.parameter) for point in points]
        tangents = [np.append(point.tangent_x, point.tangent_parameter) for point in points]
        curve = Hermite([one.place for one in nodes], states, list(stretches[:, None] * np.array(tangents)))
        segment = Segment(part.first.point, part.last.point, self.segment.metric)
        rows = [[self.functions.values(_predicted(segment, *one)) for one in curve.at(z)[1:][-2:]] for z in at]
        found = [values.T for values in np.array(rows).transpose(1, 0, 2)]
        return found[-1], self._differ(found)

    def _differ(self, found: Sequence[Array]) -> Array:
        return np.asarray(np.abs(found[-1] - found[0]) if len(found) > 1 else RESOLVED_SHARE * np.abs(found[-1]))

    def _divided(self, part: _Part, share: float) -> list[_Part]:
        """Return both parts of a part, the first one last; the point between them is no zero."""
        segment = Segment(part.first.point, part.last.point, self.segment.metric)
        for nudged in (share, share + ASIDE * (1 - share)):
            theta = self._theta(part, segment, nudged)
            point = annotated(point_on(segment, theta, self.functions.options, precise=False)[0])
            if (self.functions.at(point) != 0.0)[~self.rests].all():
                break
        middle = self._seen(point)
        if middle is None:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve turns back within a step.)")
        return [
            _Part(middle, part.last, part.offset + part.share * theta, part.share * (1 - theta)),
            _Part(part.first, middle, part.offset, part.share * theta),
        ]

    def _bracket(self, part: _Part, number: int, share: float) -> Bracket:
        """Return the zero of a function at about a share of a part."""
        segment = Segment(part.first.point, part.last.point, self.segment.metric)
        first, last = (float(self.functions.at(one.point)[number]) for one in part[:2])
        return Bracket(number, segment, first, last, self._theta(part, segment, share), part.offset, part.share)

    def _theta(self, part: _Part, segment: Segment, share: float) -> float:
        """Return the fraction on a segment's cubic at a share of the way by z."""
        places = np.array([part.first.place, part.last.place, 0.0])
        places[2] = places[0] + share * (places[1] - places[0])
        begin, end, wanted = np.copysign(np.abs(places) ** self.power, places)
        goal = (wanted - begin) / (end - begin)
        rates = np.array([part.first.rate * segment.scale_begin, part.last.rate * segment.scale_end])
        leave, arrive = (end - begin) / np.maximum(rates, STEEPEST * (end - begin))
        theta = goal * (goal * (3 - 2 * goal) + (1 - goal) * ((1 - goal) * leave - goal * arrive))
        return float(theta if 0.0 < theta < 1.0 else goal)


def _predicted(segment: Segment, state: Array, direction: Array) -> Point:
    """Return a point off the curve but close to it, with a unit tangent."""
    u, a = segment.metric.unit(segment.begin.problem, direction[:-1], float(direction[-1]))
    return replace(segment.begin, x=state[:-1], parameter=float(state[-1]), tangent_x=u, tangent_parameter=a, label="")


def clear(values: Array, doubt: Array) -> NDArray[np.bool_]:
    """Return whether functions seen as in `division`, (..., n), are certainly of one sign, as nearly always; (...)."""
    largest, least = doubt.max(axis=-1), np.minimum(values[..., 0], values[..., -1])
    lowest = values.min(axis=-1) - np.maximum(0.0, _bends(values).max(axis=-1)) / 8
    resolved = largest <= RESOLVED_SHARE * np.abs(values).max(axis=-1)
    return np.asarray(
        resolved & (lowest > np.maximum(np.maximum(INTERPOLATION_SAFETY * largest, DIP_SHARE * least), 0.0))
    )


def division(values: Array, doubt: Array) -> float | None:
    """Return where to divide a step, seen at even distances, the first value positive; None if its zeros are certain.

    The errors are those inside the step; at the ends there is none.
    """
    spaces = len(values) - 1
    if doubt.max() > RESOLVED_SHARE * np.abs(values).max():
        return 0.5
    bends = _bends(values)
    crossings = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
    if len(crossings) > 1:
        between = np.arange(crossings[0] + 1, crossings[1] + 1)
        return float(between[np.argmax(np.abs(values[between]))]) / spaces
    # Between two samples the function is a parabola: first + (last - first) t - bend t (1 - t)/2.
    sign = np.ones(spaces)
    if len(crossings):
        sign[crossings[0] :] = -1.0
    first, last = sign * values[:-1], sign * values[1:]
    bend = np.maximum(sign * np.append(bends[0], bends), sign * np.append(bends, bends[-1]))
    bend = np.maximum(bend, np.finfo(float).tiny)
    t = np.clip(0.5 - (last - first) / bend, 0.0, 1.0)
    lowest = first + (last - first) * t - bend * t * (1 - t) / 2
    error = INTERPOLATION_SAFETY * np.concatenate([[0.0], doubt, [0.0]])
    left_over = lowest - error[:-1] * (1 - t) - error[1:] * t
    # A dip far below both ends is followed up in any case.
    dips = (t > 0) & (t < 1) & (lowest < DIP_SHARE * min(values[0], abs(values[-1])))
    left_over = np.where(dips, np.minimum(left_over, 0.0), left_over)
    left_over[crossings] = np.inf
    i = int(np.argmin(left_over))
    if left_over[i] > 0:
        return None
    return float(np.clip((i + t[i]) / spaces, ASIDE, 1 - ASIDE))


def _falls(values: Array, doubt: Array, i: int) -> bool:
    """Return whether a function seen as in `division` certainly falls all the way from sample i - 1 to sample i."""
    bend, error = np.pad(np.abs(_bends(values)), 1)[i - 1 : i + 1].max(), np.pad(doubt, 1)[i - 1 : i + 1].sum()
    return bool(values[i - 1] - values[i] > bend / 2 + INTERPOLATION_SAFETY * error)


def _bends(values: Array) -> Array:
    """Return the second differences of functions at even distances."""
    return np.asarray(values[..., :-2] - 2 * values[..., 1:-1] + values[..., 2:])
