"""The whole curve of a contact on a lattice, with its folds, its first touch, and error estimates."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.symmetry import merged
from contbranch.curve.trace import Request
from contbranch.models.grid.indices import Indices, morse_indices
from contbranch.results.diagram import Cost

from .accuracy import Comparison, compared, no_comparison, touched
from .arrays import Array
from .folds import coarser_touch, locate_fold, locate_touch, touches
from .kept import first_index
from .newton import Equilibrium, Hold, newton
from .observables import interpolate
from .problem import Fields
from .ramp import jump_message
from .reading import Reading, read
from .resolution import Resolution, border_energy, border_message, fills, warn
from .rows import Mark, Row, deferred_profile, difference
from .setup import Setup
from .start import beginning
from .symmetry import Breaking
from .symmetry_events import symmetry_events
from .verdicts import LARGEST_REFINED, MOST_REFINED, judge, raw_event
from .verification import too_coarse, verify_curve
from .walk import Measure, Point, Walker, WalkOptions, following

__all__ = ["Traced", "followed", "trace"]

# From the last points, the message with which a curve ends and whether the last point lies beyond; None: it goes on.
Ending = Callable[[Sequence[Point]], tuple[str, bool] | None]

# A trace without a largest load ends at this multiple of the largest load of any event, and at this load at least.
BEYOND, AT_LEAST = 1.4, 10.0
# Memory for the fields of rows, from which profiles are made when they are asked for.
KEPT_BYTES = 600e6
# Rows between two comparisons with a coarser lattice.
SPACING = 6
# Distance by which predictions may miss where much happens on short parts of the curve.
CLOSE = 3e-3
# So many points in a row that lie on known parts of the curve end it; the last rows are no known part.
RETURNS, RECENT = 4, 6


@dataclass(frozen=True)
class Traced:
    """A traced curve: its rows, the raw result, and where it was traced."""

    setup: Setup
    rows: tuple[Row, ...]
    curve: RawCurve
    indices: Indices
    breakings: tuple[Breaking, ...] = ()


@dataclass
class _Tracer:
    """State of a trace."""

    setup: Setup
    request: Request
    verdicts: bool = False
    start: tuple[Equilibrium, Equilibrium] | None = None
    ending: Ending | None = None
    symmetry: Callable[[Array], Array] | None = None
    beyond: float | None = None
    rows: list[Row] = field(default_factory=list)
    comparisons: list[tuple[float, Comparison]] = field(default_factory=list)
    kept: float = 0.0
    notes: list[str] = field(default_factory=list)
    returns: int = 0

    def __post_init__(self) -> None:
        self.problem = self.setup.problem
        tolerance = min(max(self.request.accuracy, 1e-10), 1e-6)
        period = self.setup.lattice.spacing / self.setup.length
        self.options = WalkOptions(tolerance=tolerance, period=period, noise=max(1e-3, 0.05 * period))
        self.settings = following(tolerance)
        fine = Resolution.of(self.setup.lattice, self.setup.law).ratio <= 1.0
        if self.setup.crowded and fine:
            # Contacts of single asperities are small parts of the surface: what happens to one of them is a short part
            # of the curve, over which a step that moves all contacts by a node would leap.
            self.options = replace(self.options, hops=False, noise=CLOSE)
        self.history = 5 if self.setup.lattice.size > 1024 else 12

    # The walk

    def run(self) -> str:
        """Follow the curve to its end; the reason why it ended early, or nothing."""
        began = self.start or beginning(self.setup, self.request.accuracy, self.settings)
        if isinstance(began, str):
            return began
        walker = Walker(self.problem, self.setup.length, self.options, units=self.setup.units)
        walker.begin(*began)
        for point in walker.points:
            self._add(point)
        while True:
            if not walker.step():
                return self._stuck(walker.message)
            points = walker.points
            ended = None if self.ending is None else self.ending(points)
            if ended is not None and ended[1]:
                return self._end(ended[0])
            self._add(points[-1])
            self._events(points)
            if (len(self.rows) - 1) % SPACING == 0:
                self._compare(points)
            if ended is not None:
                return self._end(ended[0])
            if self._done(points):
                return ""
            reason = self._unrepresentable(points[-1].state)
            if reason:
                return reason
            self.returns = self.returns + 1 if self._returned(points[-1]) else 0
            if self.returns == RETURNS:
                units, last = self.setup.units, points[-1]
                place = f"load {last.load * units.load:.6g}, displacement {last.displacement * units.normal:.6g}"
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
        if self.request.target is not None:
            return self.request.target
        loads = [row.load for row in self.rows if row.mark is not None]
        return max(AT_LEAST, BEYOND * max(loads, default=0.0))

    def _done(self, points: Sequence[Point]) -> bool:
        """Whether the last step has passed the largest load in contact; the curve is then closed exactly there."""
        before, last = points[-2], points[-1]
        goal = self._goal()
        if last.load < goal or last.load < before.load or not last.state.contact.any():
            return False
        if self.beyond is not None:
            if last.displacement < self.beyond:
                return False
            self._end()
            return True
        # A fold may lie within the last step: the nearest row before the end is on the same side of it.
        near = max((row for row in self.rows if row.arc < last.arc), key=lambda row: row.arc)
        share = (goal - near.load) / (last.load - near.load) if last.load > near.load else 0.0
        if near.u is not None and 0.0 < share < 1.0:
            u = near.u + share * (last.state.u - near.u)
            end = newton(self.problem, u, goal, Hold(goal), near.contact, self.settings)
            low, high = sorted((near.reading.displacement, last.displacement))
            if end.converged and low <= end.displacement <= high:
                arc = near.arc + share * (last.arc - near.arc)
                self.rows = [row for row in self.rows if row.arc < arc]
                self._add(Point(arc, end), Mark("end"))
                return True
        self._end()
        return True

    def _end(self, message: str = "") -> str:
        """Let the last row be the end of the curve."""
        last = max(self.rows, key=lambda row: row.arc)
        if last.mark is None:
            last.mark = Mark("end", message=message)
        return ""

    def _unrepresentable(self, state: Equilibrium) -> str:
        lattice = self.problem.lattice
        rim = fills(self.setup, state) or self.rows[-1].reading.contact_radius > 0.49 * lattice.edge
        if rim and not self.setup.crowded:
            load = state.load * self.setup.units.load
            return f"The contact has reached the border of the cell at load {load:.6g}; use a larger cell"
        return ""

    def _stuck(self, message: str) -> str:
        resolution = Resolution.of(self.setup.lattice, self.setup.law)
        remedy = f"; the grid is too coarse for this interaction, use at least {resolution.grid}"
        return message + (remedy if resolution.ratio > 1.0 else "; try a finer grid or a larger cell")

    def _report(self, point: Point) -> None:
        if self.request.progress is not None:
            done = min(0.98, max(0.0, point.load / self._goal()))
            self.request.progress(done, f"load {point.load * self.setup.units.load:.4g}, {len(self.rows)} points")

    # Events

    def _events(self, points: Sequence[Point]) -> None:
        if len(points) < 3:
            return
        for control in self.request.controls:
            a, b, c = (control.value(point.load, point.displacement) for point in points[-3:])
            tiny = 1e-9 * max(1.0, abs(b))
            if (b - a) * (c - b) < 0.0 and max(abs(b - a), abs(c - b)) > tiny:
                self._fold(list(points), control, b > a)
        closed = [touches(point.state, partial(clearance, self.setup)) for point in points[-2:]]
        if closed[0] != closed[1]:
            self._touch(list(points))

    def _fold(self, points: list[Point], control: Control, maximum: bool) -> None:
        value = [control.value(point.load, point.displacement) for point in points[-3:]]
        height = max(abs(value[0] - value[1]), abs(value[2] - value[1]))
        found = (
            None
            if height < self._indifferent(control)
            else locate_fold(self.problem, points[-4:], control, self.settings)
        )
        sign = 1.0 if maximum else -1.0
        if found is None or sign * control.value(found.load, found.displacement) < sign * value[1]:
            found = points[-2].state  # the middle one is close
        mark = Mark("fold", control, maximum)
        before = points[-3]
        measure = Measure.at(before.state, self.setup.length)
        arc = before.arc + measure.norm(found.u - before.state.u, found.load - before.load)
        if self.verdicts:
            mark.around = points[-3].state.slim(), found.slim(), points[-1].state.slim()
        self._add(Point(min(arc, points[-1].arc), found), mark)

    def _indifferent(self, control: Control) -> float:
        """Height over the points around it below which a fold in contact need not be located.

        That is far below the lattice's error; where a lattice has many folds of its own, its error.
        """
        if not self.comparisons or not self.comparisons[-1][1].contact_radius:
            return 0.0
        last = self.comparisons[-1][1]
        many = sum(row.mark is not None and row.mark.kind == "fold" for row in self.rows) > MOST_REFINED
        return (1.0 if many else 0.1) * abs(control.value(last.load, last.displacement))

    def _touch(self, points: list[Point]) -> None:
        gap = partial(clearance, self.setup)
        found = locate_touch(self.problem, points, gap, self.settings)
        if found is None:
            return
        open_points = [point for point in points if not touches(point.state, gap)]
        free = open_points[-1]
        measure = Measure.at(free.state, self.setup.length)
        way = measure.norm(found.u - free.state.u, found.load - free.load)
        arc = free.arc + (way if free.arc < points[-1].arc else -way)
        mark = Mark("touch")
        finer = self.verdicts and self.setup.lattice.size <= LARGEST_REFINED
        other = touched(self.setup, found, self.settings, finer=True) if finer else None
        coarse = None
        if other is None:
            coarse = coarser_touch(self.setup, [*open_points[-2:], Point(arc, found)], clearance, self.settings)
        if other is not None:
            # From N to 2N, as for folds.
            mark.shift = 2.0 * other.load, 2.0 * other.displacement, 0.0, 0.0
        elif coarse is not None:
            mark.shift = difference(read(self.setup.on(self.setup.grid // 2), coarse), read(self.setup, found))
        self._add(Point(arc, found), mark)
        # what is left of the gap is rounding
        self.rows[-1].reading = self.rows[-1].reading._replace(central_gap=0.0, gap_error=0.0, radius_error=0.0)

    # Accuracy

    def _compare(self, points: Sequence[Point]) -> None:
        found = compared(self.setup, points[-2].state, points[-1].state, self.settings)
        if found is not None:
            self.comparisons.append((points[-1].arc, found))

    # The result

    def outcome(self, message: str, began: float) -> Traced:
        """Rows in order, indices, events."""
        self.rows.sort(key=lambda row: row.arc)
        rows = self.rows
        columns = {name: np.array([getattr(row.reading, name) for row in rows]) for name in Reading._fields}
        errors = self._errors(np.array([row.arc for row in rows]), columns)
        judge(self.setup, rows, self.request.controls, errors, self.settings)
        marks = [(k, row.mark) for k, row in enumerate(rows) if row.mark is not None]
        # Pairs of folds that are the lattice's own do not count for stability.
        folds = [
            (k, mark.control.kind)
            for k, mark in marks
            if mark.kind == "fold" and mark.control is not None and not mark.unresolved
        ]
        load_error, displacement_error = errors[:2]
        turning = [row for row, kind in folds if kind != "spring"]
        first = 0 if self.symmetry is None else first_index(self.setup, rows, turning, self.symmetry)
        indices = _indices(columns, folds, self.request.controls, first)
        inner = [[k for k, mark in marks if mark.unresolved and mark.control == c] for c in (LOAD, DISPLACEMENT)]
        checked = verify_curve(
            self.setup, rows, indices, turning, self.request.accuracy, self.request.modes, self.symmetry, inner
        )
        # What the lattice is too coarse for, the message names already.
        complete = not message and (not checked.contradicted or too_coarse(self.setup))
        own = [(float(a), float(b), float(c), float(d)) for a, b, c, d in zip(*errors, strict=True)]
        events = [raw_event(self.setup, rows, k, mark, own[k], indices) for k, mark in marks]
        events = merged(events, symmetry_events(self.setup, rows, checked.breakings, own, self.settings))
        wall = time.perf_counter() - began
        cost = Cost(wall, self.setup.counter.newton, self.setup.counter.equilibrium, self.setup.counter.stability)
        curve = RawCurve(
            load=columns["load"],
            displacement=columns["displacement"],
            contact_radius=columns["contact_radius"],
            central_gap=columns["central_gap"],
            energy=columns["energy"],
            unstable_load=indices.load if rows else np.empty(0, dtype=np.int64),
            unstable_displacement=indices.displacement if rows else np.empty(0, dtype=np.int64),
            row_errors=np.stack([load_error, displacement_error], axis=1),
            profiles=[deferred_profile(self.setup, row) for row in rows],
            events=events,
            complete=complete,
            message=" ".join([f"{message}." if message else "", *self.notes, *checked.notes]).strip(),
            cost=cost,
            unknowns=self.setup.lattice.size**2,
            unstable_spring=indices.spring if any(c.kind == "spring" for c in self.request.controls) else None,
            unstable_azimuthal=checked.azimuthal,
            fft_pairs=np.array([row.pairs for row in rows], dtype=np.int64),
        )
        return Traced(self.setup, tuple(rows), curve, indices, checked.breakings)

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
        load = load + columns["load_error"] + tolerance * np.maximum(1.0, np.abs(columns["load"]))
        displacement = displacement + columns["displacement_error"]
        displacement += tolerance * np.maximum(1.0, np.abs(columns["displacement"]))
        radius = np.where(columns["contact_radius"] > 0.0, radius, 0.0) + columns["radius_error"]
        gap = np.where(columns["central_gap"] > 0.0, gap + columns["gap_error"] + tolerance, 0.0)
        return load, displacement, radius, gap


def trace(setup: Setup, request: Request, verdicts: bool = True, beyond: float | None = None) -> Traced:
    """Follow a contact's curve on a lattice from far away to a load in contact.

    Parameters
    ----------
    setup : Setup
    request : Request
        Equations are solved to its accuracy; events on a lattice are as good as their error estimates say. Its target
        is a load. Without modes, those that break a symmetry of the tip are not examined.
    verdicts : bool
        Whether every fold is looked for on the lattice with twice the nodes a side.
    beyond : float, optional
        A displacement that the curve passes before it ends, besides the load.
    """
    began = time.perf_counter()
    tracer = _Tracer(setup, request, verdicts, beyond=beyond)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        tracer.notes += [Resolution.of(setup.lattice, setup.law).message]
        tracer.notes += [jump_message(setup.law)]
        for note in tracer.notes:
            warn(note)
        message = tracer.run()
        worst = _reaching(tracer)
        warn(worst)
        tracer.notes = [note for note in (*tracer.notes, worst, no_comparison(setup)) if note]
        return tracer.outcome(message, began)


def followed(
    setup: Setup,
    request: Request,
    start: tuple[Equilibrium, Equilibrium],
    ending: Ending,
    kept: Callable[[Array], Array],
) -> Traced:
    """Follow a curve from two of its states to where it ends.

    Parameters
    ----------
    setup : Setup
        On the whole lattice.
    request : Request
        As for `trace`.
    start : two Equilibrium
        The first, and one close to it in the direction in which to go.
    ending : callable
    kept : callable
        The symmetry that the states have: the image of a field.
    """
    began = time.perf_counter()
    tracer = _Tracer(setup, request, start=start, ending=ending, symmetry=kept)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        message = tracer.run()
        return tracer.outcome(message, began)


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
            worst = share, border_message(tracer.setup, state)
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


def _indices(
    columns: dict[str, Array], folds: Sequence[tuple[int, str]], controls: Sequence[Control], start: int
) -> Indices:
    count = len(columns["load"])
    if count < 2:
        return morse_indices(count, [], 1, 1)
    loading, approaching = (1 if columns[name][1] >= columns[name][0] else -1 for name in ("load", "displacement"))
    pulling = None
    for control in controls:
        if control.kind == "spring":
            first, second = (control.value(columns["load"][k], columns["displacement"][k]) for k in (0, 1))
            pulling = 1 if second >= first else -1
    return morse_indices(
        count, _corners(columns, folds, loading * approaching, start), loading, approaching, start, pulling
    )


def _corners(
    columns: dict[str, Array], folds: Sequence[tuple[int, str]], slope: int, index: int
) -> list[tuple[int, str]]:
    """Put folds of load and displacement that lie in one corner of the curve at one row, in the order that they have.

    Where both turn round at once, with one step of the contact, their order on the curve is chance. It decides whether
    the index under displacement control rises or falls there: it falls where there is one to lose.
    """
    found: list[tuple[int, str]] = []
    rest = list(folds)
    while rest:
        (row, control), *rest = rest
        both = {control, rest[0][1]} == {"load", "displacement"} if rest else False
        if both and _same(columns, row, rest[0][0]):
            rest = rest[1:]
            # With a rising slope the index falls if the displacement turns first, with a falling one if it turns last.
            falls = index > 0
            first, second = ("displacement", "load") if falls == (slope > 0) else ("load", "displacement")
            found += [(row, first), (row, second)]
            index += -1 if falls else 1
            continue
        if control == "displacement":
            index += 1 if slope < 0 else -1
        if control != "spring":
            slope = -slope
        found.append((row, control))
    return found


def _same(columns: dict[str, Array], row: int, other: int) -> bool:
    """Whether two rows are one state in contact, but for rounding; a film has no corners."""
    if columns["contact_radius"][row] == 0.0:
        return False
    names = ("load", "displacement", "contact_radius")
    return all(abs(columns[n][row] - columns[n][other]) <= 1e-6 * max(1.0, abs(columns[n][row])) for n in names)
