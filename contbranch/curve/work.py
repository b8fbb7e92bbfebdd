"""Work along a followed curve: ∫ F dd between two of its points, by quadrature of high order."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebint, chebmul
from scipy.fft import dct

from contbranch.continuation import Point
from contbranch.continuation.walk import point_on
from contbranch.curve.problem import values_of
from contbranch.curve.refine import OPTIONS
from contbranch.curve.track import piece

__all__ = ["Piece", "corner_work", "work_along"]


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

    def work(self, tolerance: float) -> float:
        """∫ F dd, with a quadrature error below the tolerance.

        Load and displacement are polynomials through Chebyshev–Lobatto nodes, as in Clenshaw–Curtis quadrature; the
        number of intervals is doubled, which keeps the nodes there are.
        """
        known: dict[float, tuple[float, float]] = {}
        found = change = math.inf
        for intervals in (2, 4, 8, 16, 32):
            places = (0.5 + 0.5 * np.cos(np.pi * np.arange(intervals + 1) / intervals)).tolist()
            known |= {x: _held(self.point(x)) for x in places if x not in known}
            coefficients = dct([known[x] for x in places], type=1, axis=0) / intervals
            coefficients[[0, -1]] /= 2.0
            displacement, load = coefficients.T  # of Chebyshev polynomials over -1 ... 1
            last, before = found, change
            found = float(chebint(chebmul(load, chebder(displacement)), lbnd=-1.0).sum())
            change = abs(found - last)
            # The rules converge geometrically, so the next change is smaller by the last ratio at least.
            if change * min(1.0, change / before if 0.0 < before < math.inf else 1.0) <= tolerance:
                break
        return found


def _held(point: Point) -> tuple[float, float]:
    """Displacement and load of a point on its own discretisation."""
    values = values_of(point)
    return values.displacement, values.load


def corner_work(begin: Point, end: Point) -> float:
    """∫ F dd between two points that no piece of curve joins, by the trapezoidal rule."""
    (first, load), (last, load_there) = _held(begin), _held(end)
    return 0.5 * (last - first) * (load + load_there)


def work_along(begin: Point, pieces: Iterable[Piece | Point], end: Point, tolerance: float) -> float:
    """∫ F dd over the pieces of curve between two points, reduced units.

    Where the discretisation changes, the displacement jumps by its error, and the state lies a little farther along the
    curve, which counts: only then is the work the difference of the energies at both ends.

    Parameters
    ----------
    pieces : iterable of Piece or Point
        From the begin to the end; points where no problem joins them with the next.
    tolerance : float
        Quadrature error allowed on a piece.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    parts, last = list[float](), begin
    for part in [*pieces, end]:
        first, behind = (part.begin, part.end) if isinstance(part, Piece) else (part, part)
        parts += [corner_work(last, first), part.work(tolerance) if isinstance(part, Piece) else 0.0]
        last = behind
    return math.fsum(parts)
