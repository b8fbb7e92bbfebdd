"""Work along a followed curve: ∫ F dd between two of its points, by quadrature of high order."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import Point
from contbranch.continuation.walk import point_on
from contbranch.curve.events import rates
from contbranch.curve.problem import values_of
from contbranch.curve.refine import OPTIONS
from contbranch.curve.track import piece

__all__ = ["Piece", "corner_work", "work_along"]

# Points a piece, ends included: doubled (nested) until the error that the last two changes promise is small enough.
NODES = (3, 5, 9, 17, 33)
# A slope dF/dd that is all but infinite (relative to the change of load) says nothing about the work.
STEEP = 1e-3


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


@dataclass(frozen=True)
class Piece:
    """Two points of one discretisation and the curve between them, over a coordinate x from 0 to 1.

    Attributes
    ----------
    begin, end : Point
        Along the curve.
    kinks : (bool, bool)
        Whether load and displacement have half-order terms at either end, as where one problem takes over from another
        (at first touch the load has a term y^(3/2)); x is then the square root of the distance from there.
    """

    begin: Point
    end: Point
    kinks: tuple[bool, bool] = (False, False)
    _known: dict[float, tuple[float, float]] = field(default_factory=dict, init=False, repr=False)

    def point(self, x: float) -> Point:
        """The point of the curve at x.

        Raises
        ------
        CorrectionError
            If the curve cannot be followed there.
        """
        if x in (0.0, 1.0):
            return self.end if x else self.begin
        segment = piece(self.begin, self.end)
        if segment.length == 0.0:
            return self.begin
        begins, ends = self.kinks
        share = 0.5 * (1 - math.cos(math.pi * x)) if begins and ends else x * x if begins else x
        return point_on(segment, 1 - (1 - x) ** 2 if ends and not begins else share, OPTIONS)[0]

    def value(self, x: float) -> tuple[float, float]:
        """Displacement and load at x."""
        x = round(x, 14)  # nested rules share their nodes
        if x not in self._known:
            self._known[x] = own(self.point(x))
        return self._known[x]

    def work(self, tolerance: float) -> float:
        """∫ F dd, with a quadrature error below the tolerance."""
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


def own(point: Point) -> tuple[float, float]:
    """Displacement and load of a point on its own discretisation."""
    values = values_of(point)
    return values.displacement, values.load


def corner_work(begin: Point, end: Point) -> float:
    """∫ F dd between two points that no piece of curve joins, from loads and slopes at both ends."""
    if begin is end:
        return 0.0
    (first, load), (last, load_there) = own(begin), own(end)
    change = last - first
    slopes = []
    for point in (begin, end):
        load_rate, rate = rates(point)
        if not abs(rate) > STEEP * abs(load_rate):
            return 0.5 * change * (load + load_there)
        slopes.append(load_rate / rate)
    return 0.5 * change * (load + load_there) + change * change * (slopes[0] - slopes[1]) / 12


def work_along(begin: Point, pieces: Iterable[Piece | tuple[Point, Point]], end: Point, tolerance: float) -> float:
    """∫ F dd over the pieces of curve between two points, reduced units.

    Where the discretisation changes, the displacement jumps by its error, and the state lies a little farther along the
    curve, which counts: only then is the work the difference of the energies at both ends.

    Parameters
    ----------
    pieces : iterable of Piece or (Point, Point)
        From the begin to the end; pairs of points where no problem joins them.
    tolerance : float
        Quadrature error allowed on a piece.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    parts, last = list[float](), begin
    for part in pieces:
        first, behind = (part.begin, part.end) if isinstance(part, Piece) else part
        parts += [corner_work(last, first), part.work(tolerance) if isinstance(part, Piece) else corner_work(*part)]
        last = behind
    return math.fsum([*parts, corner_work(last, end)])
