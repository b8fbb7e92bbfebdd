"""Where on a curve azimuthal modes m ≥ 1 change stability.

The numbers n_m of unstable modes are found at every row; where n_m differs between two neighbours, the eigenvalue of
the mode that passes 1 is followed to the place where it does. An eigenvalue that passes 1 twice between two rows is not
seen. Where several axisymmetric modes are unstable, as in snakes of rings, hundreds pass it: they are but counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.continuation import CorrectionError, Event, Point
from contbranch.control import DISPLACEMENT
from contbranch.curve.outcome import RawEvent
from contbranch.curve.problem import Count, equilibrium
from contbranch.curve.refine import Found, moved, refine, settled
from contbranch.curve.trace import Request
from contbranch.curve.track import Track, between
from contbranch.watch import tell

__all__ = ["Breaking", "SymmetryEvent", "critical_eigenvalues", "has_modes", "merged", "symmetry_breaking"]


# Where more axisymmetric modes than this are unstable at fixed displacement, changes are counted and not located.
FEW = 2


@dataclass(frozen=True)
class SymmetryEvent(Event):
    """An eigenvalue of the azimuthal mode m passes 1.

    Attributes
    ----------
    mode : int
        m.
    index : int
        Which eigenvalue, counted from the largest.
    """

    mode: int
    index: int = 1
    name: str = "symmetry"
    terminal: bool = False

    def value(self, point: Point) -> float:
        """The eigenvalue minus 1: positive where the mode is unstable."""
        return equilibrium(point).mode_eigenvalue(point.x, point.parameter, self.mode, self.index) - 1.0


@dataclass(frozen=True)
class Breaking:
    """What breaks the symmetry along a curve.

    Attributes
    ----------
    counts : tuple of Count
        Numbers of unstable modes at every row; none where the model does not examine them.
    events : tuple of RawEvent
        In the order in which they lie on the curve.
    complete : bool
        Whether every change of the numbers was located.
    message : str
        Empty, or what is missing.
    """

    counts: tuple[Count, ...] = ()
    events: tuple[RawEvent, ...] = ()
    complete: bool = True
    message: str = ""

    @property
    def unstable(self) -> Integers:
        """Number of unstable modes of all m ≥ 1 at every row, (M,)."""
        return np.array([count.total for count in self.counts], dtype=np.int64)


def symmetry_breaking(track: Track, request: Request) -> Breaking:
    """Numbers of unstable azimuthal modes along a curve, and the events at which they change."""
    counts: list[Count | None] = []
    indices = track.hodograph.rows(DISPLACEMENT)
    for point, index in zip(track.points, indices, strict=True):
        tell(0.97, "counting modes that break the symmetry")
        last = counts[-1] if counts else None
        near = last.modes if last is not None else ()
        counts.append(equilibrium(point).azimuthal(point.x, point.parameter, int(index), request.modes, near))
    # An eigenvalue next to 1 may have passed it on a row's mesh alone.
    few = (indices <= FEW) | (not track.problem(0).refinable)
    few = few[:-1] & few[1:]
    changes = [row for row in _differ(counts) if few[row]]
    for row in sorted({*changes, *(row + 1 for row in changes)}):
        counts[row] = _surely(track.points[row], int(indices[row]), counts[row], request.modes)
    found: list[RawEvent] = []
    lost = 0
    differ = _differ(counts)
    for row in differ:
        here, there = counts[row : row + 2]
        if here is None or there is None or not few[row]:
            continue
        passing = _changes(here, there) if track.problem(row).tells_modes else []
        for event in passing:
            tell(0.98, f"locating the loss of symmetry, m = {event.mode}")
            try:
                share, refined = _located(track, row, event, request.accuracy)
                kind = "lost" if there.of(event.mode) > here.of(event.mode) else "regained"
                kind += " with the change of the contact set" if row in track.gaps else " along the curve"
                found.append(_event(refined, row + share, event, kind))
            except CorrectionError:
                lost += 1
    notes = []
    known = tuple(count for count in counts if count is not None)
    if not all(count.complete for count in known):
        notes.append(f"Azimuthal modes above m = {request.modes} were not examined, and some are unstable.")
    if not few[differ].all():
        notes.append(f"Where more than {FEW} axisymmetric modes are unstable, losses of symmetry were not located.")
    if lost:
        notes.append(f"{lost} symmetry events could not be located: the curve cannot be followed there.")
    everywhere = known if len(known) == len(counts) else ()
    return Breaking(everywhere, tuple(sorted(found, key=_position)), not lost, " ".join(notes))


def _located(track: Track, row: int, event: SymmetryEvent, accuracy: float) -> tuple[float, Found]:
    """Where an eigenvalue passes 1 between a row and the next one, as a share of the way, and the state.

    Between a change of the contact set and the first row behind it, where a ring is narrow, it is taken to be that
    change: eigenvalues answer the logarithm of the width.

    Raises
    ------
    CorrectionError
        If the curve cannot be followed there.
    """
    ends = track.link(row)
    if ends is None:
        return 0.0, refine(track.points[row], None, accuracy)
    share, start = between(ends, event)
    return share, refine(start, event, accuracy)


def _differ(counts: Sequence[Count | None]) -> list[int]:
    """Rows that have other numbers than the next ones."""
    return [row for row, pair in enumerate(pairwise(counts)) if None not in pair and pair[0] != pair[1]]


def _surely(point: Point, unstable: int, count: Count | None, limit: int) -> Count | None:
    """The numbers of unstable modes of a row on a finer discretisation, where there is one."""
    finer = equilibrium(point).finer()
    if count is None or finer is point.problem:
        return count
    try:
        fine = settled(moved(point, finer))
    except CorrectionError:
        return count
    return equilibrium(fine).azimuthal(fine.x, fine.parameter, unstable, limit, count.modes)


def has_modes(track: Track) -> bool:
    """Whether the eigenvalues of azimuthal modes are known at every row, and not only how many are unstable."""
    return all(equilibrium(point).tells_modes for point in track.points)


def critical_eigenvalues(points: Sequence[Point]) -> Array:
    """Largest eigenvalue of all m ≥ 1, which is that of m = 1, at every row, (M,), as exact as the rows' meshes.

    Zero, to which the eigenvalues accumulate, where the interaction stiffens everywhere.
    """
    return np.array([max(0.0, equilibrium(p).mode_eigenvalue(p.x, p.parameter, 1)) for p in points])


def merged(events: Sequence[RawEvent], others: Sequence[RawEvent]) -> list[RawEvent]:
    """Both in the order in which they lie on the curve; at one place the former first."""
    return sorted([*events, *others], key=_position)


def _position(event: RawEvent) -> float:
    return float(event.row) if event.position is None else event.position


def _changes(here: Count, there: Count) -> list[SymmetryEvent]:
    """Eigenvalues that pass 1 between two rows."""
    return [
        SymmetryEvent(m, index)
        for m in range(1, max(len(here.modes), len(there.modes)) + 1)
        for index in range(min(here.of(m), there.of(m)) + 1, max(here.of(m), there.of(m)) + 1)
    ]


def _event(found: Found, position: float, event: SymmetryEvent, kind: str) -> RawEvent:
    """The event at a place between rows."""
    point = found.point
    which = point.x, point.parameter, event.mode, event.index
    shape, named = equilibrium(point).mode_shape(*which), equilibrium(point).variations(*which)
    return RawEvent(
        **vars(found),
        kind="symmetry",
        row=int(position),
        message=f"Stability to {named} is {kind}.",
        position=position,
        mode=event.mode,
        index=event.index,
        mode_shape=shape,
    )
