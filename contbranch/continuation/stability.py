"""Eigenvalues of the Jacobian along a curve, and the Hopf points where a pair of complex ones crosses the axis."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from contbranch.arrays import AnyArray
from contbranch.continuation.bordered import DENSE_UP_TO, as_matrix
from contbranch.continuation.curve import Curve, HopfPoint, Located, Point, stacked
from contbranch.continuation.events import Event, Happening
from contbranch.continuation.newton import ROUNDING, CorrectionError, evaluating
from contbranch.continuation.options import Options
from contbranch.continuation.problem import Problem, size_of
from contbranch.continuation.segment import Segment, segment_between

# Rows up to which all eigenvalues of a sparse matrix are computed where no few can be told to hold the unstable ones.
DENSE_AT_MOST = 2000
# A real part below this multiple of the error of the eigenvalues has no sign.
UNSIGNED = 1e2
# Share of a step on either side of a Hopf point by which the slope is measured there.
SLOPE_HALF_WIDTH = 1e-3
# Two pairs that cross closer than this share of a step are one event, as where a symmetry makes them equal.
SAME_PLACE = 1e-8


class Spectrum:
    """Eigenvalues of f_x at points of a curve, by falling real part; each is computed once."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, float], AnyArray] = {}

    def __call__(self, point: Point) -> AnyArray:
        """Return the eigenvalues at a point; CorrectionError if that fails."""
        place = hash(point.x.tobytes()), point.parameter
        if place not in self._known:
            with evaluating(point.parameter, " in eigenvalues"):
                values = _eigenvalues(point.problem.linearise(point.x, point.parameter).jacobian)
            self._known[place] = values[np.argsort(-values.real, kind="stable")]
        return self._known[place]


def _eigenvalues(jacobian: Any) -> AnyArray:
    """Return all eigenvalues of a matrix; of a large sparse one all that are unstable, and some that are not."""
    matrix = as_matrix(jacobian)
    if isinstance(matrix, np.ndarray):
        return np.linalg.eigvals(matrix)
    n = matrix.shape[0]
    found = _unstable_of_sparse(scipy.sparse.csc_array(matrix)) if n > DENSE_UP_TO else None
    if found is None and n > DENSE_AT_MOST:
        raise ArithmeticError(f"bounds do not tell which few of {n} eigenvalues are unstable: trace without stability")
    return np.linalg.eigvals(matrix.toarray()) if found is None else found


def _unstable_of_sparse(matrix: Any) -> AnyArray | None:
    """Return the eigenvalues nearest the middle of where unstable ones can be, far enough to hold them all.

    Real and imaginary parts are bounded by the eigenvalues of the symmetric and of the antisymmetric part (Bendixson),
    these by the sums of rows (Gershgorin). None if the bounds do not help.
    """
    even, odd = (matrix + matrix.T) / 2, abs(matrix - matrix.T) / 2
    diagonal = even.diagonal()
    right = float((diagonal - abs(diagonal) + abs(even).sum(axis=1)).max())
    # At no eigenvalue: not at zero, where folds have one, and at no round share of the bound.
    middle = max(right / math.sqrt(5), ROUNDING ** (1 / 3) * float(abs(matrix).sum(axis=1).max()))
    reach = math.hypot(max(middle, right - middle), float(odd.sum(axis=1).max()))
    start = np.cos(1.0 + np.arange(diagonal.size) ** 2 % 7919)  # without any symmetry
    for count in (10, 40, 160):
        if count > diagonal.size // 4:
            break
        found: AnyArray = scipy.sparse.linalg.eigs(matrix, count, sigma=middle, v0=start, return_eigenvectors=False)
        if float(abs(found - middle).max()) > reach:
            return found
    return None


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
            for zero in Event.happenings(HopfEvent(self.spectrum, first), segment, None, options):
                at, pair = zero.event, self._crossing_pair(zero.event.point, UNSIGNED * rounding)
                if pair is None or any(abs(zero.theta - other.theta) < SAME_PLACE for other in found):
                    continue
                located = self._located(segment, zero.theta, at, first, rounding)
                found.append(Happening(zero.theta, replace(located, frequency=float(abs(pair.imag)))))
        return found

    def _located(self, segment: Segment, theta: float, at: Located, first: int, rounding: float) -> HopfPoint:
        """Return the Hopf point at a place of a step, with errors by the slope of the sum there."""
        sums = []
        for place in (theta - SLOPE_HALF_WIDTH, theta + SLOPE_HALF_WIDTH):
            x, p = segment.at(place)
            sums.append(self._sums(replace(at.point, x=x, parameter=p))[first])
        slope = max(abs(sums[1] - sums[0]) / (2 * SLOPE_HALF_WIDTH), np.finfo(float).tiny)
        share = float((abs(self._sums(at.point)[first]) + rounding) / slope)
        u, a = segment.direction(theta)
        size = ROUNDING * abs(at.parameter), ROUNDING * size_of(at.point.problem, at.x)
        error, state_error = 4 * (share * abs(a) + size[0]), 4 * (share * size_of(at.point.problem, u) + size[1])
        return HopfPoint(replace(at.point, label="hopf"), error, state_error)

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
