"""The whole curve of a contact on a lattice, with its folds, its first touch, and error estimates."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from contbranch.analysis.stability import Indices, morse_indices
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.diagram import Cost, Profile
from contbranch.models.outcome import RawCurve, RawEvent

from .accuracy import Comparison, compared
from .folds import Refined, locate_fold, locate_touch, refine_fold
from .newton import Equilibrium, Hold, Settings, newton
from .observables import interpolate
from .problem import Fields
from .reading import Reading, read
from .resolution import Resolution, border_energy, border_message
from .setup import Setup
from .start import beginning
from .walk import Measure, Point, Walker, WalkOptions

__all__ = ["Row", "Traced", "trace"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Progress = Callable[[float, str], None]

# A trace without a largest load ends at this multiple of the largest load of any event, and at this load at least.
BEYOND, AT_LEAST = 1.4, 10.0
# Memory for the fields of rows, from which profiles are made when they are asked for.
KEPT_BYTES = 600e6
# Rows between two comparisons with a coarser lattice.
SPACING = 6
# Folds that are looked for on a finer lattice, and the largest array on which they are.
MOST_REFINED, LARGEST_REFINED = 12, 1024
# Distance by which predictions may miss where much happens on short parts of the curve.
CLOSE = 3e-3
# So many points in a row that lie on known parts of the curve end it; the last rows are no known part.
RETURNS, RECENT = 4, 6
# A fold that moves by less, relative to max(1, |value|), is said to stay.
STAYS = 1e-3


@dataclass
class Row:
    """A point of the curve: what was read off it, and its state as far as memory allows."""

    arc: float
    reading: Reading
    pairs: int
    load: float
    u: Array | None = field(default=None, repr=False)
    contact: Mask | None = field(default=None, repr=False)
    mark: Mark | None = None


@dataclass
class Mark:
    """An event at a row."""

    kind: Literal["fold", "touch", "end"]
    control: Control | None = None
    maximum: bool = False
    refined: Refined | None = None
    shift: tuple[float, float, float, float] | None = None
    message: str = ""

    @property
    def artefact(self) -> bool:
        """Whether it is a fold of the lattice only."""
        return self.refined is not None and self.refined.verdict == "vanished"


@dataclass(frozen=True)
class Traced:
    """A traced curve: its rows, the raw result, and where it was traced."""

    setup: Setup
    rows: tuple[Row, ...]
    curve: RawCurve
    indices: Indices


@dataclass
class _Tracer:
    """State of a trace."""

    setup: Setup
    accuracy: float
    limit: float | None
    controls: tuple[Control, ...]
    verdicts: bool
    progress: Progress | None
    rows: list[Row] = field(default_factory=list)
    comparisons: list[tuple[float, Comparison]] = field(default_factory=list)
    kept: float = 0.0
    notes: list[str] = field(default_factory=list)
    returns: int = 0

    def __post_init__(self) -> None:
        self.problem = self.setup.problem
        tolerance = min(max(self.accuracy, 1e-10), 1e-6)
        period = self.setup.lattice.spacing / self.setup.length
        self.options = WalkOptions(tolerance=tolerance, period=period, noise=max(1e-3, 0.05 * period))
        fine = Resolution.of(self.setup.lattice, self.setup.contact.interaction).ratio <= 1.0
        if self.setup.crowded and fine:
            # Contacts of single asperities are small parts of the surface: what happens to one of them is a short part
            # of the curve, over which a step that moves all contacts by a node would leap.
            self.options = replace(self.options, hops=False, noise=CLOSE)
        self.settings = Settings(tolerance=tolerance)
        self.history = 5 if self.setup.lattice.size > 1024 else 12

    # The walk

    def run(self) -> str:
        """Follow the curve to its end; the reason why it ended early, or nothing."""
        began = beginning(self.setup, self.accuracy, self.settings)
        if isinstance(began, str):
            return began
        walker = Walker(self.problem, self.setup.length, self.options)
        walker.begin(*began)
        for point in walker.points:
            self._add(point)
        while True:
            if not walker.step():
                return self._stuck(walker.message)
            points = walker.points
            self._add(points[-1])
            self._events(points)
            if (len(self.rows) - 1) % SPACING == 0:
                self._compare(points)
            if self._done(points):
                return ""
            reason = self._unrepresentable(points[-1].state)
            if reason:
                return reason
            self.returns = self.returns + 1 if self._returned(points[-1]) else 0
            if self.returns == RETURNS:
                place = f"load {points[-1].load:.6g}, displacement {points[-1].displacement:.6g}"
                return f"The walk has come back to a part of the curve that it knows, at {place}; try a finer grid"
            if len(self.rows) >= self.options.points:
                return f"The curve has more than {self.options.points} points; ask for a smaller range"
            del points[: -self.history]
            self._report(points[-1])

    def _add(self, point: Point, mark: Mark | None = None) -> None:
        state = point.state
        row = Row(point.arc, read(self.setup, state), state.pairs, state.load, mark=mark)
        size = state.u.nbytes + state.contact.nbytes
        if self.kept + size <= KEPT_BYTES:
            row.u, row.contact = state.u, state.contact
            self.kept += size
        self.rows.append(row)

    def _returned(self, point: Point) -> bool:
        """Whether a point lies on a piece of the curve between earlier rows: a step has leapt to it."""
        earlier = sorted(self.rows[: -2 * RECENT], key=lambda row: row.arc)
        for first, second in pairwise(earlier):
            rise, run = second.load - first.load, second.reading.displacement - first.reading.displacement
            up, along = point.load - first.load, point.displacement - first.reading.displacement
            length = rise * rise + run * run
            share = (up * rise + along * run) / length if length > 0.0 else -1.0
            if not 0.0 <= share <= 1.0 or first.u is None or second.u is None:
                continue
            if (up - share * rise) ** 2 + (along - share * run) ** 2 > 1e-4 * length:
                continue
            change = second.u - first.u
            if np.abs(point.state.u - first.u - share * change).max() <= 0.1 * np.abs(change).max():
                return True
        return False

    def _goal(self) -> float:
        if self.limit is not None:
            return self.limit
        loads = [row.load for row in self.rows if row.mark is not None]
        return max(AT_LEAST, BEYOND * max(loads, default=0.0))

    def _done(self, points: Sequence[Point]) -> bool:
        """Whether the last step has passed the largest load in contact; the curve is then closed exactly there."""
        before, last = points[-2], points[-1]
        goal = self._goal()
        if last.load < goal or last.load < before.load or not last.state.contact.any():
            return False
        share = (goal - before.load) / (last.load - before.load)
        if 0.0 < share < 1.0:
            u = before.state.u + share * (last.state.u - before.state.u)
            end = newton(self.problem, u, goal, Hold(goal), before.state.contact, self.settings)
            if end.converged:
                self.rows.pop()
                self._add(Point(before.arc + share * (last.arc - before.arc), end), Mark("end"))
                return True
        self.rows[-1].mark = Mark("end")
        return True

    def _unrepresentable(self, state: Equilibrium) -> str:
        lattice = self.problem.lattice
        inner = state.contact[: lattice.inside, : lattice.inside]
        rim = inner[-1, :].any() or inner[:, -1].any()
        if rim and not self.setup.crowded:
            return f"The contact has reached the border of the cell at load {state.load:.6g}; use a larger cell"
        return ""

    def _stuck(self, message: str) -> str:
        resolution = Resolution.of(self.setup.lattice, self.setup.contact.interaction)
        remedy = f"; the grid is too coarse for this interaction, use at least {resolution.grid}"
        return message + (remedy if resolution.ratio > 1.0 else "; try a finer grid or a larger cell")

    def _report(self, point: Point) -> None:
        if self.progress is not None:
            done = min(0.98, max(0.0, point.load / self._goal()))
            self.progress(done, f"load {point.load:.4g}, {len(self.rows)} points")

    # Events

    def _events(self, points: Sequence[Point]) -> None:
        if len(points) < 3:
            return
        for control in self.controls:
            a, b, c = (control.value(point.load, point.displacement) for point in points[-3:])
            tiny = 1e-9 * max(1.0, abs(b))
            if (b - a) * (c - b) < 0.0 and max(abs(b - a), abs(c - b)) > tiny:
                self._fold(list(points), control, b > a)
        touched = [bool(point.state.contact.any()) for point in points[-2:]]
        if touched[0] != touched[1]:
            self._touch(list(points))

    def _fold(self, points: list[Point], control: Control, maximum: bool) -> None:
        found = locate_fold(self.problem, points[-4:], control, self.settings)
        if found is None:
            return
        mark = Mark("fold", control, maximum)
        before = points[-3]
        measure = Measure.at(before.state, self.setup.length)
        arc = before.arc + measure.norm(found.u - before.state.u, found.load - before.load)
        examined = sum(row.mark is not None and row.mark.refined is not None for row in self.rows)
        if self.verdicts and self.setup.lattice.size <= LARGEST_REFINED and examined < MOST_REFINED:
            mark.refined = refine_fold(self.setup, (before.state, found, points[-1].state), control, self.settings)
            if mark.refined.state is not None:
                fine = self.setup.on(2 * self.setup.grid)
                mark.shift = _difference(read(fine, mark.refined.state), read(self.setup, found))
        self._add(Point(min(arc, points[-1].arc), found), mark)

    def _touch(self, points: list[Point]) -> None:
        found = locate_touch(self.problem, points, partial(clearance, self.setup), self.settings)
        if found is None:
            return
        free = next(point for point in reversed(points) if not point.state.contact.any())
        measure = Measure.at(free.state, self.setup.length)
        way = measure.norm(found.u - free.state.u, found.load - free.load)
        arc = free.arc + (way if free.arc < points[-1].arc else -way)
        self._add(Point(arc, found), Mark("touch"))

    # Accuracy

    def _compare(self, points: Sequence[Point]) -> None:
        found = compared(self.setup, points[-2].state, points[-1].state, self.settings)
        if found is not None:
            self.comparisons.append((points[-1].arc, found))

    # The result

    def outcome(self, message: str, wall: float) -> Traced:
        """Rows in order, indices, events."""
        self.rows.sort(key=lambda row: row.arc)
        rows = self.rows
        columns = {name: np.array([getattr(row.reading, name) for row in rows]) for name in Reading._fields}
        arcs = np.array([row.arc for row in rows])
        marks = [(k, row.mark) for k, row in enumerate(rows) if row.mark is not None]
        folds = [(k, mark.control.kind) for k, mark in marks if mark.kind == "fold" and mark.control is not None]
        load_error, displacement_error, radius_error, gap_error = self._errors(arcs, columns)
        indices = _indices(columns, folds, self.controls)
        events = [
            _event(
                k, mark, rows[k].reading, (load_error[k], displacement_error[k], radius_error[k], gap_error[k]), indices
            )
            for k, mark in marks
        ]
        cost = Cost(wall, self.setup.counter.newton, self.setup.counter.equilibrium, self.setup.counter.stability)
        curve = RawCurve(
            load=columns["load"],
            displacement=columns["displacement"],
            contact_radius=columns["contact_radius"],
            central_gap=columns["central_gap"],
            energy=columns["energy"],
            unstable_load=indices.load if rows else np.empty(0, dtype=np.int64),
            unstable_displacement=indices.displacement if rows else np.empty(0, dtype=np.int64),
            load_error=load_error,
            displacement_error=displacement_error,
            profiles=[deferred_profile(self.setup, row) for row in rows],
            events=events,
            complete=not message,
            message=" ".join([f"{message}." if message else "", *self.notes]).strip(),
            cost=cost,
            unknowns=self.setup.lattice.size**2,
            unstable_spring=indices.spring if any(c.kind == "spring" for c in self.controls) else None,
            fft_pairs=np.array([row.pairs for row in rows], dtype=np.int64),
        )
        return Traced(self.setup, tuple(rows), curve, indices)

    def _errors(self, arcs: Array, columns: dict[str, Array]) -> tuple[Array, Array, Array, Array]:
        """Error estimates of the rows' observables, interpolated between those rows that were compared."""
        if not self.comparisons:
            return tuple(np.full(len(arcs), np.inf) for _ in range(4))  # type: ignore[return-value]
        places = np.array([arc for arc, _ in self.comparisons])
        table = np.array([comparison.four for _, comparison in self.comparisons])
        # the larger of two neighbours: what lies between may be anything up to it
        upper = np.maximum(table, np.maximum(np.roll(table, 1, axis=0), np.roll(table, -1, axis=0)))
        upper[0], upper[-1] = table[:2].max(axis=0), table[-2:].max(axis=0)
        load, displacement, radius, gap = (np.interp(arcs, places, upper[:, k]) for k in range(4))
        tolerance = self.settings.tolerance
        load = load + tolerance * np.maximum(1.0, np.abs(columns["load"]))
        displacement = displacement + tolerance * np.maximum(1.0, np.abs(columns["displacement"]))
        radius = np.where(columns["contact_radius"] > 0.0, radius + columns["radius_error"], 0.0)
        gap = np.where(columns["central_gap"] > 0.0, gap + columns["gap_error"] + tolerance, 0.0)
        return load, displacement, radius, gap


def trace(
    setup: Setup,
    accuracy: float,
    limit: float | None,
    control: Control = LOAD,
    progress: Progress | None = None,
    verdicts: bool = True,
) -> Traced:
    """Follow a contact's curve on a lattice from far away to a load in contact.

    Parameters
    ----------
    setup : Setup
    accuracy : float
        Equations are solved to it; events on a lattice are as good as their error estimates say.
    limit : float or None
        Load at which the curve ends, in contact; None: 1.4 times the largest of any event, at least 10.
    control : Control
        A spring (reduced units), whose folds are located besides those of load and displacement.
    progress : callable, optional
    verdicts : bool
        Whether every fold is looked for on the lattice with twice the nodes a side.
    """
    began = time.perf_counter()
    controls = (LOAD, DISPLACEMENT, *((control,) if control.kind == "spring" else ()))
    tracer = _Tracer(setup, accuracy, limit, controls, verdicts, progress)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        tracer.notes += [Resolution.of(setup.lattice, setup.contact.interaction).message]
        message = tracer.run()
        worst = _reaching(tracer)
        tracer.notes = [note for note in (*tracer.notes, worst) if note]
        return tracer.outcome(message, time.perf_counter() - began)


def _reaching(tracer: _Tracer) -> str:
    """Where along the curve the interaction reaches furthest beyond the border of the cell."""
    worst: tuple[float, str] = (0.0, "")
    for row in tracer.rows:
        if row.u is None or row.contact is None or tracer.setup.crowded:
            continue
        gap = tracer.problem.heights + row.u
        state = Equilibrium(_only_gap(row, gap), row.contact, 0.0, 0.0, True)
        share = border_energy(tracer.problem, state)
        if share > worst[0] and row.reading.contact_radius > 0.0:
            worst = share, border_message(tracer.problem, state)
    return worst[1]


def _only_gap(row: Row, gap: Array) -> Fields:
    assert row.u is not None
    return Fields(row.u, row.load, row.u, gap, row.u, row.u, row.u)


def clearance(setup: Setup, state: Equilibrium) -> float:
    """The gap that closes at first touch: that at the apex, or the smallest of the nodes."""
    smallest = float(state.fields.gap.min())
    if setup.crowded:
        return smallest
    return min(smallest, interpolate(setup.lattice, state.u, 0.0, 0.0))


def _difference(one: Reading, other: Reading) -> tuple[float, float, float, float]:
    return tuple(a - b for a, b in zip(one.four, other.four, strict=True))  # type: ignore[return-value]


def _indices(columns: dict[str, Array], folds: Sequence[tuple[int, str]], controls: Sequence[Control]) -> Indices:
    count = len(columns["load"])
    if count < 2:
        return morse_indices(count, [], 1, 1)
    loading = 1 if columns["load"][1] >= columns["load"][0] else -1
    pulling = None
    for control in controls:
        if control.kind == "spring":
            first, second = (control.value(columns["load"][k], columns["displacement"][k]) for k in (0, 1))
            pulling = 1 if second >= first else -1
    return morse_indices(count, folds, loading, 1, 0, pulling)


def _event(
    row: int, mark: Mark, reading: Reading, error: tuple[float, float, float, float], indices: Indices
) -> RawEvent:
    if mark.kind != "fold" or mark.control is None:
        return RawEvent(mark.kind, row, reading.four, error, message=mark.message)
    pieces, _ = indices.pieces(mark.control.kind)
    before, after = max(row - 1, 0), min(row, len(pieces) - 1)
    verdict, message = _verdict(mark, reading)
    if mark.shift is not None:
        # From N to 2N the error falls at least by half: it is at most twice the shift.
        error = tuple(2.0 * abs(shift) + 1e-9 for shift in mark.shift)  # type: ignore[assignment]
    return RawEvent(
        "fold",
        row,
        reading.four,
        error,
        control=mark.control.kind,
        stiffness=mark.control.spring_stiffness,
        before=int(pieces[before]),
        after=int(pieces[after]),
        maximum=mark.maximum,
        message=message,
        verdict=verdict,
    )


def _verdict(mark: Mark, reading: Reading) -> tuple[str | None, str]:
    if mark.refined is None or mark.refined.verdict == "unknown" or mark.control is None:
        return None, "Whether it stays on a finer grid was not found."
    if mark.refined.verdict == "vanished" or mark.shift is None:
        return "vanishes", "It vanishes on the grid with twice the nodes: the lattice's own."
    moved = mark.control.value(mark.shift[0], mark.shift[1])
    value = mark.control.value(reading.load, reading.displacement)
    stays = abs(moved) <= STAYS * max(1.0, abs(value))
    words = "stays" if stays else "moves"
    return words, f"On the grid with twice the nodes it {words}: by {moved:.3g} in what is controlled."


def deferred_profile(setup: Setup, row: Row) -> Callable[[], Profile]:
    """The profile of a row, computed when it is asked for."""

    def made() -> Profile:
        from contbranch.errors import InputError

        from .observables import profile

        if row.u is None or row.contact is None:
            raise InputError("state: its fields were given up to save memory; solve for it with near=")
        problem = setup.problem
        fields = problem.fields(row.u, row.load)
        state = Equilibrium(fields, row.contact, 0.0, row.reading.displacement, True)
        return profile(problem, state)

    return made
