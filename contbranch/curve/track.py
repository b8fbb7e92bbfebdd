"""A followed curve: rows with the problems that solved them, what happens at them, and the angle that judges it all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Outcome, Point
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.angle import Hodograph
from contbranch.curve.problem import EquilibriumProblem, Work, equilibrium
from contbranch.curve.refine import moved, settled

__all__ = ["Mark", "Track", "linked"]

Array = NDArray[np.float64]


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
    """

    row: int
    kind: str
    point: Point
    control: Control | None = None
    margin: str = ""
    message: str = ""


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
    """

    points: tuple[Point, ...]
    onward: Mapping[int, Point]
    gaps: frozenset[int]
    marks: tuple[Mark, ...]
    controls: tuple[Control, ...] = (LOAD, DISPLACEMENT)
    hodograph: Hodograph = field(default_factory=Hodograph.empty)
    complete: bool = True
    message: str = ""
    work: Work = field(default_factory=Work)

    def problem(self, row: int) -> EquilibriumProblem:
        """The problem of a row."""
        return equilibrium(self.points[row])

    def column(self, name: str) -> Array:
        """Load, displacement, contact radius, central gap or energy at the rows, (M,)."""
        return np.array([point.observables[name] for point in self.points])

    @cached_property
    def loads(self) -> Array:
        """Loads of the rows."""
        return self.column("load")

    def controlled(self, control: Control) -> Array:
        """What is controlled at the rows, (M,); monotone between neighbouring rows."""
        return np.array(
            [control.value(point.observables["load"], point.observables["displacement"]) for point in self.points]
        )

    def link(self, piece: int) -> tuple[Point, Point] | None:
        """The ends of a piece as points of one problem, on the discretisation of the first, along the curve.

        None where the curve is not followed between these rows.

        Raises
        ------
        CorrectionError
            If the second end is not found on the first one's discretisation.
        """
        if piece in self.gaps:
            return None
        return linked(self.onward.get(piece, self.points[piece]), self.points[piece + 1])


def linked(begin: Point, end: Point) -> tuple[Point, Point]:
    """Two points of one representation as points of one discretisation, that of the first.

    Raises
    ------
    CorrectionError
        If the second is not found there.
    """
    problem = equilibrium(begin)
    if end.problem is problem:
        return begin, end
    if not problem.joins(equilibrium(end)):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(Two representations have no piece of curve in common.)")
    return begin, settled(moved(end, problem))
