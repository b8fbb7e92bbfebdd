"""Rows close enough for lines drawn between them to show the curve, however long the steps were."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import CorrectionError, Point
from contbranch.continuation.walk import adapted, annotated, point_on
from contbranch.curve.events import Slopes
from contbranch.curve.problem import STEPS, equilibrium
from contbranch.curve.track import linked, piece

__all__ = ["Spacing"]

SEEN = ("load", "displacement", "contact_radius")
# A straight line between neighbouring rows strays at most about this far from the curve, in units of the curve's
# extent in load, displacement and contact radius.
STRAY = 0.002


class Spacing:
    """How far straight lines between rows stray from a curve, and the rows that are missing between them.

    Parameters
    ----------
    points : sequence of Point
        The rows: their extent is the unit.
    slopes : Slopes
        What is known of the rates at the rows.
    """

    def __init__(self, points: Sequence[Point], slopes: Slopes) -> None:
        self.slopes = slopes
        seen = np.array([_seen(point) for point in points])
        self.extent = np.maximum(np.ptp(seen, axis=0), 1e-9 * (1.0 + np.abs(seen).max(axis=0)))

    def stray(self, begin: Point, end: Point) -> float:
        """How far an arc with these ends and tangents is from its chord: |chord| tan(ψ/2)/2, ψ between both."""
        chord = (_seen(end) - _seen(begin)) / self.extent
        length = float(np.linalg.norm(chord))
        widest = 0.0
        for point in (begin, end):
            rates = self.slopes(point)
            along = np.array([getattr(rates, name) for name in SEEN]) / self.extent
            across = float(np.linalg.norm(along - chord * (along @ chord) / length**2)) if length > 0.0 else 0.0
            widest = max(widest, math.atan2(across * length, float(along @ chord)))
        return 0.5 * length * math.tan(min(0.5 * widest, 0.25 * math.pi))

    def between(self, begin: Point, end: Point, marked: bool) -> list[Point]:
        """The rows that are missing between two.

        Between two events, `marked`, that a drawing tells apart there is one at least: it shows the stability there.
        """
        apart = marked and float(np.linalg.norm((_seen(end) - _seen(begin)) / self.extent)) > STRAY
        stray = self.stray(begin, end)
        if not equilibrium(begin).refinable or not (apart or stray > STRAY):
            return []
        # The distance of an arc from its chord is quadratic in its length.
        parts = max(math.ceil(math.sqrt(stray / STRAY)), 1 + apart)
        try:
            segment = piece(*linked(begin, end))
            shares = np.arange(1, parts) / parts
            found = [annotated(point_on(segment, share, STEPS, precise=False)[0]) for share in shares.tolist()]
            # Where the end asked for a better discretisation, rows on the way there may do so, too.
            refined = end.problem is not begin.problem
            return [adapted(point, segment.metric, STEPS)[0] for point in found] if refined else found
        except CorrectionError:  # two rows that no piece of curve joins: nothing is known between them
            return []


def _seen(point: Point) -> Array:
    return np.array([point.observables[name] for name in SEEN])
