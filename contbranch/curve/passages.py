"""Brackets of folds within a step: where what is controlled may turn round, by what is seen at the points around."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Outcome, Point, Segment
from contbranch.continuation.events import UNTESTED, Bracket, Probe, clear, division
from contbranch.continuation.step import STEEPEST, Hermite
from contbranch.continuation.walk import point_on
from contbranch.control import Control
from contbranch.curve.problem import equilibrium, valued

__all__ = ["BESIDES", "Search", "Seen"]

Array = NDArray[np.float64]

# Where a part of a step is looked at.
EVENLY = np.linspace(0.0, 1.0, 41)
# Points besides the ends of a part that tell what happens inside; if possible none closer to it than this share of its
# length, and none that is one of its ends, up to rounding.
BESIDES, APART, SAME = 2, 0.1, 1e-6
# Points that the search of one step may cost, and the least part of it that is divided.
MOST, LEAST = 60, 2.0**-12
# Places closer than this, relative to where they are, are one.
ROUNDING = 1e-14


class Seen(NamedTuple):
    """A point at a place z along the curve: dq/ds for q = z^m, load and displacement as F + i d, and its slope dz."""

    point: Point
    place: float
    rate: float
    held: complex
    slope: complex


class _Part(NamedTuple):
    """A part of the step, where in the step it begins, and its share of it."""

    first: Seen
    last: Seen
    offset: float = 0.0
    share: float = 1.0


class Search:
    """The folds of several controls in a step.

    Inside, load and displacement are polynomials in a coordinate z, through the ends and the points around with their
    slopes; the one through a point less tells their error. z is the parameter, to the power in which they are smooth,
    where it orders the points; otherwise it is the place along the chord.

    Parameters
    ----------
    segment : Segment
        The step.
    rates : callable
        Rates of load and displacement at a point, along its unit tangent.
    probes : mapping of Control to Probe
        What the controls do there.
    """

    def __init__(
        self, segment: Segment, rates: Callable[[Point], tuple[float, float]], probes: Mapping[Control, Probe]
    ) -> None:
        self.segment, self.rates, self.probes = segment, rates, probes
        self.problem = equilibrium(segment.begin)
        self.power = self.problem.power if self.problem.ordered else 1.0

    def seen(self, point: Point) -> Seen | None:
        """A point over the coordinate; None where the curve is no graph over it."""
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
        place = math.copysign(abs(q) ** (1 / self.power), q)
        own = point.observables
        slope = complex(*self.rates(point)) * (self._stretch(place) / rate)
        return Seen(point, place, rate, complex(own["load"], own["displacement"]), slope)

    def brackets(self, past: Sequence[Seen]) -> tuple[list[tuple[Control, Bracket]], list[Seen]]:
        """Brackets of all zeros, and the points in order, the earlier ones included."""
        begin, end = self.seen(self.segment.begin), self.seen(self.segment.end)
        found: list[tuple[Control, Bracket]] = []
        if not self.probes or self.segment.length == 0.0 or begin is None or end is None:
            return found, []
        same = SAME * (end.place - begin.place)  # one point on two discretisations
        points = [*(one for one in past if begin.place - one.place > same), begin, end]
        most = len(points) + MOST
        parts = [_Part(begin, end)]
        while parts:
            part = parts.pop()
            share, crossing = self._judged(part, points)
            if share is not None and part.share > LEAST and len(points) < most:
                parts += self._divided(part, share)
                points.append(parts[-1].last)
                continue
            if share is not None:
                crossing = self._crossed(part)
            found += [(control, self._bracket(part, control, guess)) for control, guess in crossing]
        return found, sorted(points, key=lambda one: one.place)

    def _judged(self, part: _Part, points: Sequence[Seen]) -> tuple[float | None, list[tuple[Control, float]]]:
        """Where to divide a part, None if its zeros are certain; and where the zeros are."""
        if part.last.place - part.first.place <= ROUNDING * abs(part.first.place):
            return None, self._crossed(part)
        crossing: list[tuple[Control, float]] = []
        inside, doubt = self._inside(part, points, EVENLY)
        ends = np.array([[probe.at(one.point) / one.rate for one in part[:2]] for probe in self.probes.values()])
        signs = np.copysign(1.0, ends[:, :1])
        seen = signs * np.concatenate((ends[:, :1], inside, ends[:, 1:]), axis=1)
        for k in np.flatnonzero(~clear(seen, doubt)):
            control, sign, values = list(self.probes)[k], signs[k], seen[k]
            share = division(values, doubt[k])
            if share is not None:
                return share, crossing
            if values[-1] > 0.0:
                continue
            i = int(np.argmax(values <= 0.0))  # once more between these two, where there may be two zeros more
            shares = np.linspace(EVENLY[i - 1], EVENLY[i], len(EVENLY))
            finer, unsure = self._inside(part, points, shares)
            values = np.concatenate(((values[i - 1],), sign * finer[k], (values[i],)))
            share = division(values, unsure[k])
            if share is not None:
                return float(shares[0] + share * (shares[-1] - shares[0])), crossing
            i = int(np.argmax(values <= 0.0))
            ahead = values[i - 1] / (values[i - 1] - values[i])
            crossing.append((control, float(shares[i - 1] + ahead * (shares[i] - shares[i - 1]))))
        return None, crossing

    def _crossed(self, part: _Part) -> list[tuple[Control, float]]:
        """Zeros that the ends of a part tell, where it is not divided any further."""
        ends = {control: [probe.at(one.point) for one in part[:2]] for control, probe in self.probes.items()}
        return [(control, a / (a - b)) for control, (a, b) in ends.items() if (a > 0) != (b > 0)]

    def _stretch(self, place: Any) -> Any:
        """dq/dz."""
        return self.power * abs(place) ** (self.power - 1) if self.power != 1.0 else 1.0

    def _inside(self, part: _Part, points: Sequence[Seen], shares: Array) -> tuple[Array, Array]:
        """Rates by q of all controls inside a part, and their errors, (K, n) each; not at the first and last share."""
        begin, length = part.first.place, part.last.place - part.first.place
        away = {abs(one.place - begin - length / 2) - length / 2: one for one in points}
        order = [far for far in sorted(away) if far > max(SAME * length, ROUNDING * abs(begin))]
        besides = [away[far] for far in [far for far in order if far > APART * length] or order[-1:]][:BESIDES]
        nodes = [part.first, part.last, *besides]
        places = begin + shares[1:-1] * length
        curve = Hermite([one.place for one in nodes], [one.held for one in nodes], [one.slope for one in nodes])
        weights = np.array([control.weights for control in self.probes])
        found = [weights @ slope.view(float).reshape(-1, 2).T for slope in curve.slopes(places)]
        if self.power != 1.0:
            found = [rates / self._stretch(places) for rates in found]
        return found[-1], np.abs(found[-1] - found[0]) if besides else UNTESTED * np.abs(found[-1])

    def _divided(self, part: _Part, share: float) -> list[_Part]:
        """Both parts of a part, the first one last; the point between them is no zero."""
        segment = Segment(part.first.point, part.last.point, self.segment.metric)
        probes = list(self.probes.values())
        for nudged in (share, share + 1e-3 * (1 - share)):
            theta = self._theta(part, segment, nudged)
            point = point_on(segment, theta, probes[0].options, precise=False)[0]
            if all(probe.at(point) for probe in probes):
                break
        middle = self.seen(valued(point))
        if middle is None:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve turns back within a step.)")
        return [
            _Part(middle, part.last, part.offset + part.share * theta, part.share * (1 - theta)),
            _Part(part.first, middle, part.offset, part.share * theta),
        ]

    def _bracket(self, part: _Part, control: Control, share: float) -> Bracket:
        """The zero of the rate of a control at about a share of a part."""
        segment = Segment(part.first.point, part.last.point, self.segment.metric)
        first, last = (self.probes[control].at(one.point) for one in (part.first, part.last))
        guess = self._theta(part, segment, share)
        return Bracket(segment, (0.0, first), (1.0, last), guess, part.offset, part.share)

    def _theta(self, part: _Part, segment: Segment, share: float) -> float:
        """The place on a segment's cubic at a share of the way by z."""
        places = np.array([part.first.place, part.last.place, 0.0])
        places[2] = places[0] + share * (places[1] - places[0])
        begin, end, wanted = np.copysign(np.abs(places) ** self.power, places)
        leave, arrive = (
            part.first.rate * segment.scale_begin / (end - begin),
            part.last.rate * segment.scale_end / (end - begin),
        )
        goal = (wanted - begin) / (end - begin)
        theta = goal
        for _ in range(3):
            rest = theta * (leave + theta * (3 - 2 * leave - arrive + theta * (leave + arrive - 2))) - goal
            slope = leave + theta * (2 * (3 - 2 * leave - arrive) + theta * 3 * (leave + arrive - 2))
            theta = min(max(theta - rest / slope, 0.0), 1.0) if slope > 0.0 else theta
        return float(theta)
