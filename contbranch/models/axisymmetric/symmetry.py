"""Where on a traced curve azimuthal modes m ≥ 1 change stability.

The numbers n_m of unstable modes (see `azimuthal`) are found at every row; where n_m differs between two neighbours,
the eigenvalue of T_m that passes 1 is followed to the place where it does. First touch is a kink of the curve: the
pieces on both sides of it belong to problems of their own. An eigenvalue that passes 1 twice between two rows is not
seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Event, Point
from contbranch.curve.outcome import RawEvent

from .azimuthal import LARGEST_MODE, Count, CriticalMode, counted, critical_eigenvalue, eigenvalues, mode_shape
from .locate import Place, locate, refine
from .piece import piece_between, place_of, zero_between
from .problem import COARSE, ContactProblem

__all__ = ["Breaking", "SymmetryEvent", "critical_at", "critical_eigenvalues", "merged", "symmetry_breaking"]

Integers = NDArray[np.int64]

# Meshes are refined so often before the eigenvalue of a state is taken as it is.
ROUNDS = 4
LARGEST = 1500


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
    relative_resolution: float = COARSE  # type: ignore[misc]

    def value(self, point: Point) -> float:
        """The eigenvalue of T_m minus 1: positive where the mode is unstable."""
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        return float(eigenvalues(problem.equations, fields, self.mode, self.index)[-1]) - 1.0


@dataclass(frozen=True)
class Breaking:
    """What breaks the symmetry along a curve.

    Attributes
    ----------
    counts : tuple of Count
        Numbers of unstable modes at every row.
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


def symmetry_breaking(
    points: Sequence[Point],
    unstable: Sequence[int] | Integers,
    accuracy: float,
    largest_mode: int = LARGEST_MODE,
    progress: Callable[[float, str], None] | None = None,
) -> Breaking:
    """Numbers of unstable azimuthal modes along a curve, and the events at which they change.

    Parameters
    ----------
    points : sequence of Point
        Rows of the curve.
    unstable : sequence of int, (M,)
        n_0, the index under displacement control, at the rows.
    accuracy : float
        Error allowed to the events, relative to max(1, |value|).
    largest_mode : int
        m is examined up to here where nothing settles the rest before.
    progress : callable, optional
        Called with the fraction done (a guess) and what is being done.
    """
    counts: list[Count] = []
    for point, index in zip(points, unstable, strict=False):
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        near = len(counts[-1].modes) if counts else 1
        counts.append(counted(problem.equations, fields, int(index), largest_mode, near))
    found: list[tuple[float, RawEvent]] = []
    lost = 0
    for row, (here, there) in enumerate(pairwise(counts)):
        for event in _changes(here, there):
            if progress is not None:
                progress(0.98, f"locating the loss of symmetry, m = {event.mode}")
            try:
                found.append(_located(points, row, event, accuracy, there.of(event.mode) > here.of(event.mode)))
            except CorrectionError:
                lost += 1
    found.sort(key=lambda item: item[0])
    notes = []
    if not all(count.complete for count in counts):
        notes.append(f"Azimuthal modes above m = {largest_mode} were not examined, and some are unstable.")
    if lost:
        notes.append(f"{lost} symmetry events could not be located: the curve cannot be followed there.")
    return Breaking(tuple(counts), tuple(event for _, event in found), not lost, " ".join(notes))


def critical_at(
    problem: ContactProblem, x: NDArray[np.float64], u: float, m: int, accuracy: float = 1e-6, index: int = 1
) -> CriticalMode:
    """Eigenvalue and mode of a state of the curve, on meshes refined until the error estimate satisfies `accuracy`.

    Where the finest mesh does not, the estimate says so.
    """
    best: CriticalMode | None = None
    for _ in range(ROUNDS):
        found = critical_eigenvalue(problem.equations, problem.fields(x, u), m, index)
        if best is None or found.error < best.error:
            best = found
        if found.error <= accuracy or problem.equations.mesh.size > LARGEST:
            break
        problem, x = problem.on(problem.equations.mesh.finer, x, u)
    assert best is not None
    return best


def critical_eigenvalues(points: Sequence[Point]) -> NDArray[np.float64]:
    """Largest eigenvalue of all m ≥ 1, which is that of m = 1, at every row, (M,), as exact as the rows' meshes.

    Zero, to which the eigenvalues of T_m accumulate, where the interaction stiffens everywhere.
    """
    found = np.zeros(len(points))
    for row, point in enumerate(points):
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        if bool((fields.stiffness < 0).any()):
            found[row] = max(0.0, float(eigenvalues(problem.equations, fields, 1)[0]))
    return found


def merged(events: Sequence[RawEvent], others: Sequence[RawEvent]) -> list[RawEvent]:
    """Both in the order in which they lie on the curve; at one place the former first."""

    def position(event: RawEvent) -> float:
        return float(event.row) if event.position is None else event.position

    return sorted([*events, *others], key=position) if others else list(events)


def _changes(here: Count, there: Count) -> list[SymmetryEvent]:
    """Eigenvalues that pass 1 between two rows."""
    return [
        SymmetryEvent(m, index)
        for m in range(1, max(len(here.modes), len(there.modes)) + 1)
        for index in range(min(here.of(m), there.of(m)) + 1, max(here.of(m), there.of(m)) + 1)
    ]


def _located(
    points: Sequence[Point], row: int, event: SymmetryEvent, accuracy: float, lost: bool
) -> tuple[float, RawEvent]:
    """Position on the curve, and the event."""
    begin, end = piece_between(points[row], points[row + 1])
    values, place = refine(_start(begin, end, event), event, accuracy)
    problem = place.problem
    shape = mode_shape(problem.equations, problem.fields(place.x, place.u), event.mode, event.index)
    share = (place.u - begin.parameter) / (end.parameter - begin.parameter)
    position = row + min(1.0, max(0.0, share))
    kind = "lost" if lost else "regained"
    load, displacement, radius, gap = (float(error) for error in values.error)
    message = f"Stability to variations cos({event.mode}θ) is {kind} along the curve."
    return position, RawEvent(
        "symmetry",
        row,
        values.numbers,
        (load, displacement, radius, gap),
        message=message,
        place=place,
        position=position,
        mode=event.mode,
        index=event.index,
        mode_shape=shape,
    )


def _start(begin: Point, end: Point, event: SymmetryEvent) -> Place:
    """A place close to the event: by a secant from the nearer end, by bracketing if that leaves the piece."""
    first, last = event.value(begin), event.value(end)
    nearer = begin if abs(first) < abs(last) else end
    try:
        place = locate(place_of(nearer), event)
    except CorrectionError:
        return zero_between(begin, end, event)
    low, high = sorted((begin.parameter, end.parameter))
    margin = 1e-6 * (high - low)
    if low - margin <= place.u <= high + margin and _passes(place, event):
        return place
    return zero_between(begin, end, event)


def _passes(place: Place, event: SymmetryEvent) -> bool:
    """Whether the event function all but vanishes at a place."""
    fields = place.problem.fields(place.x, place.u)
    values = eigenvalues(place.problem.equations, fields, event.mode, event.index)
    return abs(float(values[-1]) - 1.0) < 1e-6
