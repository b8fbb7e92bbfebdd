"""The whole curve of a contact on a lattice, with its folds, its first touch, and error estimates."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from operator import itemgetter

import numpy as np

from contbranch.control import LOAD, Control
from contbranch.curve.angle import Hodograph
from contbranch.curve.outcome import RawCurve
from contbranch.curve.symmetry import merged
from contbranch.curve.trace import Request
from contbranch.watch import kept, over, tell

from .accuracy import compared, no_comparison, touched
from .arcs import arcs
from .arrays import Array
from .averaging import LEAST, MEASURED, Average, Fold, Samples, half_width, turned
from .folds import coarser_touch, locate_fold, locate_touch, touches
from .newton import Equilibrium, Settings, hold_control, newton
from .observables import interpolate
from .ramp import jump_message
from .resolution import Resolution, border_energy, border_message, fills, repetition, warn
from .rows import Mark, Reading, Row, crossing, deferred_profile, difference, morse_indices, read, state_at
from .setup import Setup
from .switching import first_index
from .symmetry import Breaking
from .symmetry_events import symmetry_events
from .verdicts import LARGEST_REFINED, MOST_REFINED, judge, raw_event
from .verification import Verification, verify_curve
from .walk import Measure, Point, Walker, WalkOptions, following, quietly

__all__ = ["Traced", "followed", "trace"]

# From the last points, the message with which a curve ends and whether the last point lies beyond; None: it goes on.
Ending = Callable[[Sequence[Point]], tuple[str, bool] | None]

# A trace without a largest load ends at this multiple of the largest load of any event, and at this load at least.
BEYOND, AT_LEAST = 1.4, 10.0
# Memory for the fields of rows, from which profiles are made when they are asked for.
KEPT_BYTES = 600e6
# The first gap at most, in heights of the tip at the border of the cell: from there on all of the cell acts alike.
FURTHEST = 1.0
# Points at most.
MOST_POINTS = 2000
# Rows between two comparisons with a coarser lattice.
SPACING = 6
# Distance by which predictions may miss where much happens on short parts of the curve.
CLOSE = 3e-3
# Arcs at most of one average, and rows of nodes for which they are followed where steps lead nowhere.
MOST_ARCS, STUCK = 3000, 2.0
# Where the law is stiffer than the lattice by this factor, a contact of many nodes cannot be followed.
COARSE, SMALL = 1.6, 128
# ... and one of few; by this factor averages mean nothing.
FEW, HOPELESS = 2.2, 3.5
# Contact radius, in rows of nodes, below which a fold of the lattice may be the same as one of the average.
NEAR = 3.5
# Rows of an average, a row of nodes.
AVERAGED_ROWS = 2
# So many points in a row that lie on known parts of the curve end it; the last rows are no known part.
RETURNS, RECENT = 4, 6


@dataclass(frozen=True)
class Traced:
    """A traced curve: its rows, the raw result, and where it was traced."""

    setup: Setup
    rows: tuple[Row, ...]
    curve: RawCurve
    indices: Hodograph
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
    comparisons: list[tuple[float, Array]] = field(default_factory=list)
    kept: float = 0.0
    notes: list[str] = field(default_factory=list)
    returns: int = 0
    samples: Samples = field(default_factory=Samples)
    stretch: tuple[float, float] = (np.inf, -np.inf)
    centre: float = 0.0
    checked: float = -1.0

    def __post_init__(self) -> None:
        self.problem = self.setup.problem
        tolerance = min(max(self.request.accuracy, 1e-10), 1e-6)
        period = self.setup.lattice.spacing / self.setup.length
        self.options = WalkOptions(tolerance=tolerance, period=period, noise=max(1e-3, 0.05 * period))
        self.settings = following(tolerance)
        self.resolution = Resolution.of(self.setup)
        if self.setup.crowded and self.resolution.ratio <= 1.0:
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
                if self._average(walker):
                    continue
                return self._stuck(walker.message)
            points = walker.points
            ended = None if self.ending is None else self.ending(points)
            if ended is not None and ended[1]:
                return self._end(ended[0])
            self._add(points[-1])
            if len(points) > 2:
                self._events(points)
                if self.averaging and self._turned() and self._average(walker):
                    continue
            if (len(self.rows) - 1) % SPACING == 0:
                found = compared(self.setup, points[-2].state, points[-1].state, self.settings)
                self.comparisons += [] if found is None else [(points[-1].arc, found.four)]
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
            if len(self.rows) >= MOST_POINTS:
                return f"The curve has more than {MOST_POINTS} points; ask for a smaller range"
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
        place = np.array([point.load, point.displacement])
        for first, second in pairwise(earlier):
            begin, end = (np.array(row.reading[:2]) for row in (first, second))
            way, past = end - begin, place - begin
            share = past @ way / (way @ way or -1.0)
            if first.u is None or second.u is None or not 0.0 <= share <= 1.0:
                continue
            aside, change = past - share * way, second.u - first.u
            if aside @ aside > 1e-4 * (way @ way):
                continue
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
        if self.beyond is not None and last.displacement < self.beyond:
            return False
        # A fold may lie within the last step: the nearest row before the end is on the same side of it.
        near = max((row for row in self.rows if row.arc < last.arc), key=lambda row: row.arc)
        end = None
        ends = near, max(self.rows, key=lambda row: row.arc)
        if self.beyond is None and near.load < goal <= last.load and all(row.u is not None for row in ends):
            end = crossing(self.setup, ends, LOAD, goal, self.settings)
        if end is not None:
            arc = near.arc + (goal - near.load) / (last.load - near.load) * (last.arc - near.arc)
            self.rows = [row for row in self.rows if row.arc < arc]
            self._add(Point(arc, end))
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
        remedy = f"; the grid is too coarse for this interaction, {self.resolution.remedy}"
        return message + (remedy if self.resolution.ratio > 1.0 else "; try a finer grid or a larger cell")

    def _report(self, point: Point) -> None:
        done = min(0.98, max(0.0, point.load / self._goal()))
        tell(done, f"load {point.load * self.setup.units.load:.4g}, {len(self.rows)} points")

    @property
    def finer(self) -> bool:
        """Whether the curve may well be complete on the lattice with twice the nodes a side, which is not too large."""
        return 1.0 < self.resolution.ratio <= HOPELESS and 2 * self.setup.lattice.size <= LARGEST_REFINED

    # Averages

    @property
    def averaging(self) -> bool:
        """Whether folds in contact are those of averages."""
        return self.setup.averaging and not self.setup.crowded and self.resolution.ratio <= HOPELESS

    def _turned(self) -> bool:
        """Whether a control has turned round in contact since this was last asked."""
        spacing = self.setup.lattice.spacing
        self.checked, centre = turned(self.rows, self.request.controls, spacing, self.checked)
        self.centre = self.centre if centre is None else centre
        return centre is not None

    def _average(self, walker: Walker) -> bool:
        """Follow the curve arc by arc around the present point, and go on behind; whether that could be done."""
        if not self.averaging:
            return False
        rows = sorted(self.rows, key=lambda row: row.arc)
        spacing = self.setup.lattice.spacing
        radius = rows[-1].reading.contact_radius if walker.message else self.centre
        wide = half_width(radius, spacing)
        samples, start = self.samples, self.stretch[0]
        if samples.last is not None and samples.ends[-1] >= radius - 1.5 * wide:
            begin, end = samples.last.middle, samples.last.end
            way = (
                end,
                replace(end, fields=end.fields._replace(u=2.0 * end.u - begin.u, load=2.0 * end.load - begin.load)),
            )
        else:
            kept = [k for k, row in enumerate(rows[:-1]) if row.u is not None and not row.averaged]
            below = [k for k in kept if rows[k].reading.contact_radius <= max(radius - 1.3 * wide, 0.0)]
            if not below or rows[below[-1] + 1].u is None:
                return False
            way = state_at(self.problem, rows[below[-1]]), state_at(self.problem, rows[below[-1] + 1])
            samples, start = Samples(), rows[below[-1]].arc
            touch = next((row for row in rows if row.mark is not None and row.mark.kind == "touch"), None)
            if touch is not None and not way[0].contact.any():
                samples.begin(touch.reading, spacing)
        touching = bool(way[0].contact.any())
        if not self._sampled(samples, way, radius + (STUCK * spacing if walker.message else 0.0)):
            return False
        self._replaced(samples, start, touching)
        last = samples.last
        if last is None:
            return False
        walker.points = [Point(self.stretch[1] - samples.lengths[-1], last.begin), Point(self.stretch[1], last.end)]
        walker.step_size, walker.message = self.options.period, ""
        return True

    def _sampled(self, samples: Samples, way: tuple[Equilibrium, Equilibrium], reach: float) -> bool:
        """Follow arcs until a contact radius, and every fold behind it, lies well inside; whether it was reached."""
        spacing, wanted, known = self.setup.lattice.spacing, reach, len(samples.ends)
        for arc in arcs(self.problem, self.setup.length, way, self.settings):
            end = samples.add(self.setup, arc)
            if end >= reach + 1.3 * half_width(reach, spacing):
                folds = [fold.radius for _, fold in self._folds(samples) if fold.radius > reach]
                reach = max(folds, default=reach)
                if reach + 1.1 * half_width(reach, spacing) < end:
                    break
            if end < max(samples.ends) - STUCK * spacing or end > 0.49 * self.setup.edge:
                break
            if len(samples.ends) - known > MOST_ARCS:
                break
        return len(samples.ends) > known + 2 and bool(samples.radius) and samples.radius[-1] > wanted

    def _folds(self, samples: Samples) -> list[tuple[Control, Fold]]:
        average = Average(samples, self.setup.lattice.spacing)
        return [(control, fold) for control in self.request.controls for fold in average.folds(control)]

    def _replaced(self, samples: Samples, start: float, touching: bool) -> None:
        """Put rows of the average in the place of those that it spans."""
        average = Average(samples, self.setup.lattice.spacing)
        places = start + np.cumsum(samples.lengths)
        radii = np.maximum.accumulate(samples.ends)
        folds = [one for one in self._folds(samples) if not self._known(*one)]
        kept = [row for row in self.rows if self._stays(row, folds, row.arc <= start)]
        touched = any(row.mark is not None and row.mark.kind == "touch" for row in kept)
        self.rows = kept
        if not (touching or touched):
            before = [Point(row.arc, state_at(self.problem, row)) for row in kept[-3:] if row.u is not None]
            first = samples.state(0.0)
            fields = self.problem.fields(first.u, first.load)
            self._touch([*before, Point(float(places[-1]), replace(first, fields=fields))])
        count = max(3, int(AVERAGED_ROWS * (average.last - average.first) / average.spacing))
        marks: list[tuple[float, Mark | None]] = [
            (radius, None) for radius in np.linspace(average.first, average.last, count)[1:].tolist()
        ]
        for control, fold in folds:
            own = samples.state(fold.radius)
            seen = read(self.setup, replace(own, fields=self.problem.fields(own.u, own.load)))
            errors = max(1.0, self.resolution.ratio) * np.append(fold.errors[[1, 2, 0]], 0.0)
            errors += [seen.load_error, seen.displacement_error, 0.0, 0.0]
            mark = Mark("fold", control, fold.maximum, errors=errors, potential=fold.potential)
            mark.message = f"The average over {fold.arcs} changes of the contact on the lattice."
            marks.append((fold.radius, mark))
        for radius, event in sorted(marks, key=itemgetter(0)):
            place = float(np.interp(radius, np.append(average.first, radii), np.append(start, places)))
            (load, displacement, energy), state = average.at(radius)[0].tolist(), samples.state(radius)
            rim = float(np.interp(radius, samples.radius, samples.perimeters))
            seen = Reading(load, displacement, radius, 0.0, energy, MEASURED * average.spacing, perimeter=rim)
            self.rows.append(Row(place, seen, state.pairs, state.load, state.u, state.contact, event, averaged=True))
        self.samples, self.stretch = samples, (start, float(places[-1]))
        self.checked = average.last - 0.7 * half_width(average.last, average.spacing)

    def _known(self, control: Control, fold: Fold) -> bool:
        """Whether a fold of an average is one of a contact of few nodes, located on the lattice itself."""
        least = LEAST * self.setup.lattice.spacing
        if fold.radius > least:
            return False
        marks = [row.mark for row in self.rows if row.mark is not None and 0.0 < row.reading.contact_radius < least]
        return any(mark.control == control and mark.maximum == fold.maximum for mark in marks)

    def _stays(self, row: Row, folds: Sequence[tuple[Control, Fold]], before: bool) -> bool:
        """Whether a row stays where an average takes the place of others: an event of a contact of few nodes."""
        mark, spacing, radius = row.mark, self.setup.lattice.spacing, row.reading.contact_radius
        if mark is None or mark.kind != "fold" or mark.errors is not None or radius == 0.0:
            return before or (mark is not None and mark.kind == "touch")
        again = any(
            mark.control == control and mark.maximum == fold.maximum and fold.radius < NEAR * spacing
            for control, fold in folds
        )
        return radius < LEAST * spacing and not again

    # Events

    def _events(self, points: Sequence[Point]) -> None:
        for control in self.request.controls:
            values = np.array([control.value(point.load, point.displacement) for point in points[-3:]])
            if self._left_to_averages(points[-2]):
                continue
            rise, fall = np.diff(values)
            if rise * fall < 0.0 and max(abs(rise), abs(fall)) > 1e-9 * max(1.0, abs(values[1])):
                self._fold(points, control, values)
        closed = [touches(point.state, self.clearance) for point in points[-2:]]
        if closed[0] != closed[1]:
            self._touch(points)

    def _left_to_averages(self, point: Point) -> bool:
        """Whether a fold at a point is sought by averages: not where the contact has too few nodes for them."""
        if not self.averaging or not point.state.contact.any():
            return False
        few = read(self.setup, point.state, cell=False).contact_radius < LEAST * self.setup.lattice.spacing
        return not few or self.resolution.ratio > 1.0

    def _fold(self, points: Sequence[Point], control: Control, values: Array) -> None:
        before, middle, after = points[-3:]
        maximum = bool(values[1] > values[0])
        found = None
        if np.abs(values - values[1]).max() >= self._indifferent(control):
            found = locate_fold(self.problem, [point.state for point in points[-4:]], control, self.settings)
        if found is None or (control.value(found.load, found.displacement) < values[1]) == maximum:
            found = middle.state  # it is close
        arc = before.arc + Measure.at(before.state, self.setup.length).apart(found, before.state)
        around = (before.state.slim(), found.slim(), after.state.slim()) if self.verdicts else None
        self._add(Point(min(arc, after.arc), found), Mark("fold", control, maximum, around=around))

    def _indifferent(self, control: Control) -> float:
        """Height over the points around it below which a fold in contact need not be located.

        That is far below the lattice's error; where a lattice has many folds of its own, its error.
        """
        load, displacement, radius, _ = self.comparisons[-1][1] if self.comparisons else np.zeros(4)
        if not radius:
            return 0.0
        many = sum(row.mark is not None and row.mark.kind == "fold" for row in self.rows) > MOST_REFINED
        return (1.0 if many else 0.1) * abs(control.value(load, displacement))

    def _touch(self, points: Sequence[Point]) -> None:
        found = locate_touch(self.problem, [point.state for point in points], self.clearance, self.settings)
        if found is None:
            return
        free = [point for point in points if not touches(point.state, self.clearance)]
        way = Measure.at(free[-1].state, self.setup.length).apart(found, free[-1].state)
        finer = self.verdicts and self.setup.lattice.size <= LARGEST_REFINED
        other = touched(self.setup, found, self.settings) if finer else None
        mark = Mark("touch")
        if other is not None:
            # From N to 2N, as for folds.
            mark.shift = 2.0 * np.array([other.load - found.load, other.displacement - found.displacement, 0.0, 0.0])
        else:
            states = [*(point.state for point in free[-2:]), found]
            coarse = coarser_touch(self.setup, states, clearance, self.settings)
            if coarse is not None and self.setup.coarse is not None:
                mark.shift = difference(read(self.setup.coarse, coarse), read(self.setup, found))
        self._add(Point(free[-1].arc + (way if free[-1] is not points[-1] else -way), found), mark)
        # what is left of the gap is rounding
        self.rows[-1].reading = self.rows[-1].reading._replace(central_gap=0.0, gap_error=0.0, radius_error=0.0)

    def clearance(self, state: Equilibrium) -> float:
        """The gap that closes at first touch."""
        return clearance(self.setup, state)

    # The result

    def outcome(self, message: str, began: float) -> Traced:
        """Rows in order, indices, events."""
        self.rows.sort(key=lambda row: row.arc)
        setup, rows, request = self.setup, self.rows, self.request
        seen = np.array([row.reading[:5] for row in rows]).reshape(-1, 5)
        errors = self._errors(seen)
        kept(lambda: judge(setup, rows, request.controls, errors, self.settings), None)
        marks = [(k, row.mark) for k, row in enumerate(rows) if row.mark is not None]
        folds = [(k, mark.control.kind, mark.unresolved) for k, mark in marks if mark.control is not None]
        # Pairs of folds that are the lattice's own do not count for stability.
        counted = [(k, kind) for k, kind, unresolved in folds if not unresolved]
        turning = [k for k, kind in counted if kind != "spring"]
        inner = [[k for k, own, doubtful in folds if doubtful and own == kind] for kind in ("load", "displacement")]
        first = 0 if self.symmetry is None else kept(partial(first_index, setup, rows, turning, self.symmetry), 0)
        rates = np.diff(seen[:2, :2], axis=0).ravel()
        indices = morse_indices(len(rows), counted, rates.tolist(), first, request.controls, partial(_one, seen))
        verify = partial(verify_curve, setup, rows, indices, turning, request.accuracy)
        checked = kept(lambda: verify(request.modes, self.symmetry, inner), Verification())
        events = [raw_event(setup, rows, k, mark, errors[k], indices) for k, mark in marks]
        breaking = partial(symmetry_events, setup, rows, checked.breakings, errors, self.settings)
        events = merged(events, kept(breaking, []))
        by_load, held, *by_spring = [indices.rows(control)[: len(rows)] for control in request.controls]
        load, displacement, radius, gap, energy = seen.T
        curve = RawCurve(
            load,
            displacement,
            radius,
            gap,
            energy,
            by_load,
            held,
            errors[:, :2],
            profiles=[deferred_profile(setup, row) for row in rows],
            events=events,
            # What the lattice is too coarse for, the message names already.
            complete=not message and (not checked.contradicted or self.resolution.ratio > 1.0),
            message=" ".join([f"{message}." if message else "", *self.notes, *checked.notes]).strip(),
            cost=setup.counter.cost(time.perf_counter() - began),
            unknowns=setup.lattice.size**2,
            unstable_spring=by_spring[0] if by_spring else None,
            unstable_azimuthal=checked.azimuthal,
            fft_pairs=np.array([row.pairs for row in rows], dtype=np.int64),
            contact_area=np.pi * radius**2,
            contact_perimeter=np.array([row.reading.perimeter for row in rows]),
        )
        return Traced(setup, tuple(rows), curve, indices, checked.breakings)

    def _errors(self, seen: Array) -> Array:
        """Error estimates of the rows' four observables, interpolated between those rows that were compared."""
        if not self.comparisons:
            return np.full((len(seen), 4), np.inf)
        places, found = zip(*self.comparisons, strict=True)
        # the larger of two neighbours: what lies between may be anything up to it
        padded = np.pad(found, ((1, 1), (0, 0)), mode="edge")
        upper = np.maximum.reduce([padded[:-2], padded[1:-1], padded[2:]])
        arcs, values = [row.arc for row in self.rows], np.abs(seen[:, :4])
        errors = np.stack([np.interp(arcs, places, column) for column in upper.T], axis=1)
        errors += self.settings.tolerance * np.where([1, 1, 0, 0], np.maximum(1.0, values), [0.0, 0.0, 0.0, 1.0])
        errors += [row.reading.errors for row in self.rows]
        apart = seen[:, 2] == 0.0
        errors[apart, 2] = [row.reading.radius_error for row in self.rows if row.reading.contact_radius == 0.0]
        errors[values[:, 3] == 0.0, 3] = 0.0
        return errors


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
    with quietly():
        tracer.notes = [tracer.resolution.message, repetition(setup), jump_message(setup.law)]
        for note in tracer.notes:
            warn(note)
        coarse = tracer.finer and tracer.resolution.ratio > (COARSE if setup.lattice.size > SMALL else FEW)
        message = "" if coarse else kept(tracer.run, "")
        if (message or coarse) and not over() and setup.averaging and not setup.crowded and tracer.finer:
            finer = trace(setup.fine, request, verdicts, beyond)
            note = f"On a grid of {setup.grid} nodes the curve cannot be followed: this is that on twice as many."
            return replace(finer, curve=replace(finer.curve, message=f"{note} {finer.curve.message}".strip()))
        worst = _reaching(tracer)
        warn(worst)
        tracer.notes = [note for note in (*tracer.notes, worst, no_comparison(setup)) if note]
        return tracer.outcome(message, began)


def followed(
    setup: Setup,
    request: Request,
    start: tuple[Equilibrium, Equilibrium],
    ending: Ending,
    image: Callable[[Array], Array],
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
    image : callable
        Of a field, which is that field: the symmetry that the states have.
    """
    began = time.perf_counter()
    tracer = _Tracer(setup, request, start=start, ending=ending, symmetry=image)
    with quietly():
        message = kept(tracer.run, "")
        return tracer.outcome(message, began)


def _reaching(tracer: _Tracer) -> str:
    """Where along the curve the interaction reaches furthest beyond the border of the cell."""
    setup, heights = tracer.setup, tracer.problem.heights
    gaps = (
        (heights + row.u, row.load) for row in tracer.rows if row.u is not None and row.reading.contact_radius > 0.0
    )
    worst = max(gaps, key=lambda gap: border_energy(setup.problem, gap[0]), default=None)
    return "" if setup.crowded or worst is None else border_message(setup, *worst)


def clearance(setup: Setup, state: Equilibrium) -> float:
    """The gap that closes at first touch: that at the apex, or the smallest of the nodes."""
    smallest = float(state.fields.gap.min())
    return smallest if setup.crowded else min(smallest, interpolate(setup.lattice, state.u, 0.0, 0.0))


def _one(seen: Array, row: int, other: int) -> bool:
    """Whether two rows are one state in contact, but for rounding; a film has no corners."""
    own = seen[row, :3]
    return bool(own[2] and (np.abs(own - seen[other, :3]) <= 1e-6 * np.maximum(1.0, np.abs(own))).all())


def beginning(setup: Setup, accuracy: float, settings: Settings) -> tuple[Equilibrium, Equilibrium] | str:
    """Two states without contact, one a little closer than the other; the reason if there are none."""
    problem = setup.problem
    law = setup.law
    if law is None:
        return "There is no interaction with which the contact could begin; use the axisymmetric model"
    inside = problem.heights[: setup.lattice.inside, : setup.lattice.inside]
    finite = inside[np.isfinite(inside)]
    most = max(10.0 * setup.length, FURTHEST * float(finite.max()))
    displacement = -min(law.reach(accuracy), most)
    step = 0.05 * max(setup.length, 0.2 * abs(displacement))
    if not law.evaluate(np.array([-displacement])).pressure.any():
        displacement -= 1.5 * step  # a law that ends: two states beyond its end, from where the walk goes in
    u = np.full(problem.shape, -displacement)
    load = problem.lattice.node_area * float(problem.respond(problem.heights + u)[1].sum())
    held = [hold_control(problem, 0.0, 1.0, displacement + way) for way in (0.0, step)]
    first = newton(problem, u, load, held[0], None, settings)
    second = newton(problem, first.u - step, first.load, held[1], None, settings)
    if not (first.converged and second.converged):
        return "No equilibrium without contact was found to begin with; try a finer grid"
    return first, second
