"""A followed curve: rows with the problems that solved them, what happens at them, and the angle that judges it all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import CorrectionError, Event, Outcome, Point, Segment, find_root
from contbranch.continuation.walk import point_on
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.angle import Hodograph
from contbranch.curve.problem import EquilibriumProblem, Work, equilibrium
from contbranch.curve.refine import OPTIONS, moved, settled

__all__ = ["Mark", "Track", "between", "linked", "piece"]


@dataclass(frozen=True)
class Mark:
    """A row at which something happens.

    Attributes
    ----------
    row : int
    kind : str
        ``"fold"``, ``"touch"``, ``"topology"``, ``"inadmissible"``, ``"end"``.
    point : Point
        The row itself.
    control : Control or None
        Of a fold.
    margin : str
        The margin that vanishes here; empty without.
    message : str
    name : str or None
        Of the event, where the description of tip or law ends.
    """

    row: int
    kind: str
    point: Point
    control: Control | None = None
    margin: str = ""
    message: str = ""
    name: str | None = None


@dataclass(frozen=True)
class Track:
    """Rows of one connected curve, reduced units.

    Attributes
    ----------
    points : tuple of Point, M
        Rows, each with the problem that solved it; ``observables`` are its values.
    onward : mapping of int to Point
        At rows where one problem takes over from another: the same equilibrium as the next problem has it.
    gaps : frozenset of int
        Pieces k (between rows k and k + 1) whose ends belong to problems that cannot be joined.
    marks : tuple of Mark
        In order along the curve.
    controls : tuple of Control
        Load, displacement, and a spring if one was asked for: whose folds are rows.
    hodograph : Hodograph
        The direction of (d', F') along the curve: Morse indices and signs of change under any control.
    complete, message : bool, str
        Whether the curve reached its end; why not.
    work : Work
    lost : bool
        Whether it ends where it could not be followed, though it goes on.
    """

    points: tuple[Point, ...] = ()
    onward: Mapping[int, Point] = field(default_factory=dict)
    gaps: frozenset[int] = frozenset()
    marks: tuple[Mark, ...] = ()
    controls: tuple[Control, ...] = (LOAD, DISPLACEMENT)
    hodograph: Hodograph = field(default_factory=Hodograph)
    complete: bool = True
    message: str = ""
    work: Work = field(default_factory=Work)
    lost: bool = False
    doubtful: ClassVar[bool] = False  # before its events are known

    def problem(self, row: int) -> EquilibriumProblem:
        """The problem of a row."""
        return equilibrium(self.points[row])

    def column(self, name: str) -> Array:
        """Load, displacement, contact radius, central gap or energy at the rows, (M,)."""
        return np.array([point.observables[name] for point in self.points])

    def controlled(self, control: Control) -> Array:
        """What is controlled at the rows, (M,); monotone between neighbouring rows."""
        return np.array(
            [control.value(point.observables["load"], point.observables["displacement"]) for point in self.points]
        )

    def link(self, piece: int) -> tuple[Point, Point] | None:
        """The ends of a piece as points of one problem, on the discretisation of either, along the curve.

        None where the curve is not followed between these rows.

        Raises
        ------
        CorrectionError
            If neither end is found on the other's discretisation.
        """
        if piece in self.gaps:
            return None
        return linked(self.onward.get(piece, self.points[piece]), self.points[piece + 1])


def linked(begin: Point, end: Point) -> tuple[Point, Point]:
    """Two points of one representation as points of one discretisation: that of the first, or else of the second.

    Raises
    ------
    CorrectionError
        If neither is found there.
    """
    problem = equilibrium(begin)
    if end.problem is problem:
        return begin, end
    if not problem.joins(equilibrium(end)):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(Two representations have no piece of curve in common.)")
    try:
        return begin, settled(moved(end, problem))
    except CorrectionError:
        return settled(moved(begin, equilibrium(end))), end


def between(ends: tuple[Point, Point] | None, event: Event, tolerance: float = 1e-8) -> tuple[float, Point]:
    """Where an event vanishes between two points of `Track.link`, to a share of the piece: the share, and the point.

    Where both values have one sign, which differences between two discretisations can cause, the end with the smaller.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    if ends is None:
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve is not followed between these rows.)")
    begin, end = ends
    first, last = event.value(begin), event.value(end)
    if (first > 0) == (last > 0):
        return (0.0, begin) if abs(first) < abs(last) else (1.0, end)
    segment = piece(begin, end)
    share = find_root(lambda s: event.value(point_on(segment, s, OPTIONS)[0]), (0.0, first), (1.0, last), tolerance)
    return share, point_on(segment, share, OPTIONS)[0]


def piece(begin: Point, end: Point) -> Segment:
    """The piece of curve between two points of one discretisation, with tangents along it."""
    problem = equilibrium(begin)

    def along(point: Point) -> Point:
        metric = problem.metric(end.x)
        dx, dp = end.x - begin.x, end.parameter - begin.parameter
        ahead = metric.dot(problem, dx, dp, point.tangent_x, point.tangent_parameter)
        return point if ahead >= 0 else point.turned()

    return Segment(along(begin), along(end), problem.metric(end.x))
