"""Work along the traced curve: ∫ F dd between two of its points, by quadrature of high order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import Metric, Point
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on

from .locate import OPTIONS
from .piece import piece_between
from .problem import ContactProblem

__all__ = ["points_between", "work_along"]

Array = NDArray[np.float64]

# Points a piece, ends included: doubled (nested) until the error that the last two changes promise is small enough.
NODES = (3, 5, 9, 17, 33)


@cache
def lobatto(count: int) -> tuple[Array, Array, Array]:
    """Chebyshev–Lobatto nodes on [0, 1], weights of Clenshaw–Curtis, and the matrix that differentiates."""
    angle = np.pi * np.arange(count) / (count - 1)
    x = (1 - np.cos(angle)) / 2
    powers = np.polynomial.chebyshev.chebvander(2 * x - 1, count - 1)
    slopes = np.stack(
        [np.polynomial.chebyshev.chebval(2 * x - 1, np.polynomial.chebyshev.chebder(row)) * 2 for row in np.eye(count)],
        axis=1,
    )
    inverse = np.linalg.inv(powers)
    k = np.arange(count)
    moments = np.where(k % 2 == 0, 1.0 / (1.0 - k.astype(float) ** 2 + (k == 1)), 0.0)
    return x, moments @ inverse, slopes @ inverse


def work_along(points: Sequence[Point], tolerance: float) -> float:
    """∫ F dd over the pieces of curve between consecutive points, reduced units.

    On each piece load and displacement are polynomials of a parameter along the curve; next to first touch, where the
    load has a term y^(3/2), of its square root. Where the mesh changes, the displacement jumps by its discretisation
    error, which counts: only then is the work the difference of the energies at both ends.

    Parameters
    ----------
    tolerance : float
        Quadrature error allowed on a piece.
    """
    parts: list[float] = []
    last: float | None = None
    for begin, end in pairwise(points):
        piece = _Piece(*piece_between(begin, end))
        parts.append(piece.work(tolerance))
        first, load = piece.value(0.0)
        if last is not None:
            parts.append(load * (first - last))
        last = piece.value(1.0)[0]
    if last is not None:
        final, load = _own(points[-1])
        parts.append(load * (final - last))
    return math.fsum(parts)


def _own(point: Point) -> tuple[float, float]:
    """Displacement and load of a point on its own mesh."""
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    fields = problem.fields(point.x, point.parameter)
    return problem.equations.displacement(fields), problem.equations.load(fields)


def points_between(begin: Point, end: Point, count: int) -> list[Point]:
    """Points of the curve between two neighbouring ones, without observables."""
    piece = _Piece(*piece_between(begin, end))
    return [piece.point((k + 1) / (count + 1)) for k in range(count)]


class _Piece:
    """Displacement and load between two neighbouring points as functions of x from 0 to 1."""

    def __init__(self, begin: Point, end: Point) -> None:
        problem = begin.problem
        assert isinstance(problem, ContactProblem)
        self.problem, self.begin, self.end = problem, begin, end
        self.segment = Segment(begin, end, Metric(math.sqrt(problem.inner(end.x, end.x)) + problem.scale, 1.0))
        self.known: dict[float, tuple[float, float]] = {}

    def work(self, tolerance: float) -> float:
        """∫ F dd."""
        found, change = math.inf, math.inf
        for count in NODES:
            x, weights, slope = lobatto(count)
            values = np.array([self.value(float(share)) for share in x])
            last, before = found, change
            found = float(weights @ (values[:, 1] * (slope @ values[:, 0])))
            change = abs(found - last)
            # The rules converge geometrically, so the next change is smaller by the last ratio at least.
            if change * min(1.0, change / before if 0.0 < before < math.inf else 1.0) <= tolerance:
                break
        return found

    def point(self, x: float) -> Point:
        """The point of the curve at x."""
        if x == 0.0 or self.segment.length == 0.0:
            return self.begin
        if x == 1.0:
            return self.end
        theta = x
        if self.problem.equations.contact and self.begin.parameter == 0.0:
            theta = x * x
        elif self.problem.equations.contact and self.end.parameter == 0.0:
            theta = 1 - (1 - x) ** 2
        return point_on(self.segment, theta, OPTIONS)[0]

    def value(self, x: float) -> tuple[float, float]:
        """Displacement and load at x."""
        x = round(x, 14)  # nested rules share their nodes
        if x not in self.known:
            self.known[x] = _own(self.point(x))
        return self.known[x]
