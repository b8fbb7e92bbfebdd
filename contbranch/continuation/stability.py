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
from contbranch.continuation.events import UNSIGNED, Event, Happening
from contbranch.continuation.metric import ROUNDING
from contbranch.continuation.newton import CorrectionError, evaluating, jacobian_rounding
from contbranch.continuation.options import Options
from contbranch.continuation.problem import size_of
from contbranch.continuation.segment import Segment, segment_between
from contbranch.continuation.zeros import ASIDE

# Rows up to which all eigenvalues of a sparse matrix are computed where no few can be told to hold the unstable ones.
DENSE_AT_MOST = 2000


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
    # Not nearer to zero than to the bound, and at no eigenvalue: not at zero, where folds have one, nor a round share.
    middle = max(right / math.sqrt(3), ROUNDING ** (1 / 3) * float(abs(matrix).sum(axis=1).max()))
    reach = math.hypot(middle, float(odd.sum(axis=1).max()))
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

    Eigenvalues are taken by falling real part: the number of unstable ones passes k where the real part of the k-th is
    zero, which is continuous, whatever becomes of the others. A real eigenvalue that crosses is a fold or branch point.

    Parameters
    ----------
    which : int
        The eigenvalue that `value` belongs to, from 0.
    """

    name = "hopf"

    def __init__(self, spectrum: Spectrum, which: int = 0) -> None:
        self.spectrum, self.which = spectrum, which

    def value(self, point: Point) -> float:
        """Return the real part of the eigenvalue."""
        return float(self.spectrum(point)[self.which].real)

    def happenings(self, segment: Segment, previous: Segment | None, options: Options) -> list[Happening]:
        """Return the Hopf points within a step.

        Looked for are zeros of all real parts that have both signs at the ends of the step and at places inside, and of
        the two next to them.
        """
        inside = [replace(segment.begin, x=x, parameter=p) for x, p in map(segment.at, (0.25, 0.5, 0.75))]
        real = [self.spectrum(point).real for point in (segment.begin, *inside, segment.end)]
        positive = [int(np.count_nonzero(parts > 0)) for parts in real]
        error = _rounding(segment.end, self.spectrum(segment.end))
        found: list[Happening] = []
        for which in range(max(min(positive) - 1, 0), min(max(positive) + 1, *(parts.size for parts in real))):
            if max(abs(parts[which]) for parts in real) <= UNSIGNED * error:
                continue  # on the axis all along, as in conservative systems
            event, known = HopfEvent(self.spectrum, which), list(found)
            for zero in Event.happenings(event, segment, None, options):
                pair = self._crossing_pair(zero.event.point, UNSIGNED * error)
                if pair is not None:
                    point = event.located(segment, zero.theta, zero.event.point, pair, error)
                    if not any(_same(point, other.event) for other in known):
                        found.append(Happening(zero.theta, point))
        return found

    def located(self, segment: Segment, theta: float, at: Point, pair: complex, rounding: float) -> HopfPoint:
        """Return the Hopf point at a place of a step, with errors by the slope of the real part there."""
        beside = (segment.at(theta + side) for side in (-ASIDE, ASIDE))
        below, above = (self.value(replace(at, x=x, parameter=p)) for x, p in beside)
        slope = max(abs(above - below) / (2 * ASIDE), float(np.finfo(float).tiny))
        share = (abs(self.value(at)) + rounding) / slope
        u, a = segment.direction(theta)
        error = 4 * (share * abs(a) + ROUNDING * abs(at.parameter))
        state_error = 4 * (share * size_of(at.problem, u) + ROUNDING * size_of(at.problem, at.x))
        return HopfPoint(replace(at, label="hopf"), error, state_error, frequency=float(abs(pair.imag)))

    def _crossing_pair(self, point: Point, noise: float) -> complex | None:
        """Return the eigenvalue of a complex pair on the imaginary axis; None where there is none."""
        values = self.spectrum(point)
        values = values[np.abs(values.imag) > noise]
        nearest = values[np.argmin(np.abs(values.real))] if values.size else None
        return nearest if nearest is not None and abs(nearest.real) <= noise + ROUNDING**0.5 * abs(nearest) else None


def _same(one: Located, other: Located) -> bool:
    """Whether two points are one but for their errors: of both eigenvalues of a pair, or of pairs that are equal."""
    apart = size_of(one.point.problem, one.x - other.x), abs(one.parameter - other.parameter)
    return apart[0] <= one.state_error + other.state_error and apart[1] <= one.error + other.error


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
    return jacobian_rounding(point.problem) * float(np.abs(values).max())
