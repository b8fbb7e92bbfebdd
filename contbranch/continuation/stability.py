"""Eigenvalues of the Jacobian along a curve, and the Hopf points where a pair of complex ones crosses the axis."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from contbranch.arrays import AnyArray
from contbranch.continuation.bordered import DENSE_UP_TO, as_matrix
from contbranch.continuation.curve import Curve, HopfPoint, Point, stacked
from contbranch.continuation.events import Event, Happening, zeros
from contbranch.continuation.newton import ROUNDING, CorrectionError, evaluating
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Problem, size_of
from contbranch.continuation.segment import Segment, segment_between

# How many eigenvalues of a large sparse matrix are computed.
NEAREST_ZERO = 10
# A real part below this multiple of the error of the eigenvalues has no sign.
UNSIGNED = 1e2
# Two pairs that cross closer than this share of a step are one event, as where a symmetry makes them equal.
SAME = 1e-8


class Spectrum:
    """Eigenvalues of f_x at points of a curve, by falling real part; each is computed once."""

    def __init__(self) -> None:
        self._known: dict[tuple[bytes, float], AnyArray] = {}

    def __call__(self, point: Point) -> AnyArray:
        """Return the eigenvalues at a point; CorrectionError if that fails."""
        place = point.x.tobytes(), point.parameter
        if place not in self._known:
            with evaluating(point.parameter, " in eigenvalues"):
                values = _eigenvalues(point.problem.linearise(point.x, point.parameter).jacobian)
            self._known[place] = values[np.argsort(-values.real, kind="stable")]
        return self._known[place]


def _eigenvalues(jacobian: Any) -> AnyArray:
    """Return all eigenvalues of a matrix, of a large sparse one those nearest zero.

    The shift is off zero by what makes the shifted matrix regular where the matrix itself is singular.
    """
    n, matrix = jacobian.shape[0], as_matrix(jacobian)
    if isinstance(matrix, np.ndarray):
        return np.linalg.eigvals(matrix)
    if n <= DENSE_UP_TO:
        return np.linalg.eigvals(matrix.toarray())
    matrix = scipy.sparse.csc_array(matrix)
    shift = ROUNDING ** (1 / 3) * scipy.sparse.linalg.norm(matrix, 1)
    start = np.cos(1.0 + np.arange(n) ** 2 % 7919)  # without any symmetry
    found: AnyArray = scipy.sparse.linalg.eigs(matrix, NEAREST_ZERO, sigma=shift, v0=start, return_eigenvectors=False)
    return found


class HopfEvent(Event):
    """Where a pair of complex eigenvalues of f_x crosses the imaginary axis.

    The sum of the real parts of two eigenvalues that are neighbours by real part is zero there, keeps its sign where a
    real one crosses, and is smooth where a pair becomes two real ones. (It is zero at neutral saddles, λ and −λ, too.)

    Parameters
    ----------
    first : int
        Which two are meant by `value`: this one and the next.
    """

    name = "hopf"

    def __init__(self, spectrum: Spectrum, first: int = 0) -> None:
        self.spectrum, self.first = spectrum, first

    def value(self, point: Point) -> float:
        """Return the sum of the real parts of two eigenvalues."""
        return float(self._sums(point)[self.first])

    def _sums(self, point: Point) -> AnyArray:
        real = self.spectrum(point).real
        return np.asarray(real[:-1] + real[1:])

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """Return the Hopf points within a step: zeros of the sums whose signs change, and of the two nearest zero."""
        begin, end = self._sums(segment.begin), self._sums(segment.end)
        few, many = sorted(int(np.count_nonzero(sums > 0)) for sums in (begin, end))
        rounding = _rounding(segment.end, self.spectrum(segment.end))
        found: list[Happening] = []
        for first in range(max(few - 1, 0), min(many + 1, begin.size, end.size)):
            if max(abs(begin[first]), abs(end[first])) <= UNSIGNED * rounding:
                continue  # on the axis all along, as in conservative systems
            for zero in zeros(HopfEvent(self.spectrum, first), segment, None, options):
                at, pair = zero.event, self._crossing_pair(zero.event.point, UNSIGNED * rounding)
                if pair is None or any(abs(zero.theta - other.theta) < SAME for other in found):
                    continue
                share = rounding / abs(end[first] - begin[first])
                located = HopfPoint(
                    replace(at.point, label="hopf"),
                    at.error + share * abs(segment.end.parameter - segment.begin.parameter),
                    at.state_error + share * size_of(at.point.problem, segment.end.x - segment.begin.x),
                    frequency=float(abs(pair.imag)),
                )
                found.append(Happening(zero.theta, located))
        return found

    def _crossing_pair(self, point: Point, noise: float) -> complex | None:
        """Return the eigenvalue of a complex pair on the imaginary axis; None where there is none."""
        values = self.spectrum(point)
        values = values[np.abs(values.imag) > noise]
        nearest = values[np.argmin(np.abs(values.real))] if values.size else None
        return nearest if nearest is not None and abs(nearest.real) <= noise + ROUNDING**0.5 * abs(nearest) else None


def with_stability(curve: Curve, spectrum: Spectrum) -> Curve:
    """Return the curve with the eigenvalues at its points.

    At an event an eigenvalue may be zero but for rounding. What is unstable there is counted beside it: at the next
    points if they are none, otherwise half-way.
    """

    def values(point: Point) -> AnyArray:
        try:
            return spectrum(point)
        except CorrectionError:
            return np.full(point.x.size, np.nan + 0j)

    points = curve.points
    eigenvalues = list(map(values, points))
    counts = np.array(list(map(_unstable, points, eigenvalues)), dtype=int)
    at_event = np.isin(np.arange(len(points)), [event.index for event in curve.events])
    between = np.maximum(np.where(at_event, -1, counts)[:-1], np.where(at_event, -1, counts)[1:])
    for i in np.flatnonzero(at_event[:-1] & at_event[1:]):
        x, p = segment_between(points[i], points[i + 1]).at(0.5)
        middle = replace(points[i], x=x, parameter=p)
        between[i] = _unstable(middle, values(middle))
    for i in np.flatnonzero(at_event) if len(points) > 1 else ():
        counts[i] = between[max(i - 1, 0) : i + 1].min()
    return replace(curve, eigenvalues=stacked(eigenvalues), unstable=counts, unstable_between=between)


def _unstable(point: Point, values: AnyArray) -> int:
    """Return how many eigenvalues have a positive real part; -1 where they are not known."""
    if np.isnan(values).any():
        return -1
    return int(np.count_nonzero(values.real > UNSIGNED * _rounding(point, values)))


def _rounding(point: Point, values: AnyArray) -> float:
    """Return the error of eigenvalues: rounding of the largest, or what central differences leave of its digits."""
    differences = type(point.problem).jacobian is Problem.jacobian
    return (ROUNDING ** (2 / 3) if differences else ROUNDING) * float(np.abs(values).max())
