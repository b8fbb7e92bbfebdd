"""Following the curve of equilibria on a lattice through folds and changes of the contact set.

A point is predicted by the polynomial through the last points in the arclength (`measure`), and corrected by Newton's
method in the plane through the prediction normal to the predicted direction. The contact set changes node by node: the
curve has a small corner at every change, over which the steps pass, and a correction of the contact set belongs to
every Newton step. Tangents are those of the arcs between corners; so the direction of a row is that from row to row.
"""

from __future__ import annotations

import math
from bisect import insort
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import CorrectionError, End, EventPoint, Outcome, Point, StopAt
from contbranch.continuation.follow import Branch
from contbranch.curve.angle import in_passing, short_way
from contbranch.curve.events import Ceiling, Folds
from contbranch.curve.problem import rates_of
from contbranch.watch import finishing, kept, over

from .arcs import Arc, arcs, onward
from .averaging import JOINT, averaged, half_width, turned
from .keeping import Keeping
from .measure import Direction, Measure, Stretch, lagrange, predicted
from .newton import Equilibrium, newton, tangent
from .readings import clearance
from .resolution import HOPELESS, fills

if TYPE_CHECKING:
    from contbranch.control import Control

    from .equilibria import LatticeProblem

__all__ = ["Walker"]

# Steps in s: the first, and the limits: the least without contact, where the film may give way in one spot, and with
# it; the most, and where there are many contacts.
FIRST, SHORTEST, LEAST_STEP, MOST_STEP, MOST_OF_MANY = 0.05, 1e-6, 2e-4, 0.5, 0.25
# Part of a step by which a prediction may miss, as goal of the step control.
CURVATURE = 0.02
# Least cosine between the predicted direction and the step, and degree of the predicting polynomial.
ANGLE, ORDER = 0.9, 2
# Distance by which predictions may miss at any rate, and where much happens on short parts of the curve.
NOISE, CLOSE = 1e-3, 3e-3
# A fold closer to a row than this part of the way between the rows on its sides takes the row's place.
SINGLE = 0.05
# Changes of load and displacement that are rounding, relative to max(1, |value|).
ROUNDING = 1e-9
# Steps of a rough contact that may hide folds are made shorter, down to this: then the corners are followed; the factor
# by which slopes differ there, and tolerance of tangents.
LOOK, STEEPEST, LOOSELY = 0.04, 3.0, 0.03
# Corners at most around one fold, and those at a time where steps fail.
MOST_CORNERS, CORNERS = 40, 6
# Points at most, and those from which is predicted.
MOST_POINTS, HISTORY = 2000, 12
# A contact without a node has a gap of no more than this multiple of the least height of a node.
OPENS = 4.0
# So many points in a row that lie on known parts of the curve end it; the last rows before first touch, and twice as
# many behind it, are no known part.
RETURNS, RECENT = 4, 6


class Place(NamedTuple):
    """An equilibrium with its arclength."""

    arc: float
    state: Equilibrium


class Row(NamedTuple):
    """A point with its arclength, and the name of what happens there."""

    arc: float
    point: Point
    event: str = ""

    @property
    def place(self) -> Array:
        """Load and displacement."""
        return np.array([self.point.observables[name] for name in ("load", "displacement")])

    @property
    def radius(self) -> float:
        """That of the contact."""
        return self.point.observables["contact_radius"]


@dataclass
class Walker:
    """A walk along a piece of curve.

    Attributes
    ----------
    problem : LatticeProblem
    folds : Folds
        Whose controls are watched.
    end : Ceiling
    stop : StopAt
    looks : bool
        Whether steps that may hide folds of a rough contact are left for its corners.
    """

    problem: LatticeProblem
    folds: Folds
    end: Ceiling
    stop: StopAt
    looks: bool = True

    def __post_init__(self) -> None:
        problem = self.problem
        self.setup, self.nodes, self.settings = problem.setup, problem.nodes, problem.settings
        self.resolution = problem.resolution
        self.spacing = self.setup.lattice.spacing
        # Length of the curve over which the contact moves by one row of nodes.
        self.period = self.spacing / self.setup.length
        self.noise = max(NOISE, 0.05 * self.period)
        # Contacts of single asperities are small parts of the surface: what happens to one of them is a short part of
        # the curve, over which a step that moves all contacts by a node would leap.
        self.hops = not (self.setup.crowded and self.resolution.ratio <= 1.0)
        self.longest = MOST_STEP
        if not self.hops:
            self.noise, self.longest = CLOSE, MOST_OF_MANY
        self.averaging = self.setup.averaging and not self.setup.crowded and self.resolution.ratio <= HOPELESS
        self._sharp = replace(self.settings, tolerance=min(self.settings.tolerance, 1e-8))
        self.places: list[Place] = []
        self.rows: list[Row] = []
        self.queue: list[Equilibrium] = []
        # Which node changes at a corner tells the direction behind it: from there on the same arcs go on.
        self.arcs: Iterator[Arc] = iter(())
        self.corner: Equilibrium | None = None
        self.film = [Row(0.0, point) for point in problem.film]
        self.step_size, self.checked, self.returns = FIRST, -1.0, 0
        self.kept = Keeping()
        self._tangents = deque[tuple[Equilibrium, tuple[Array, float]]](maxlen=4)

    # -- the piece ----------------------------------------------------------------------------------------------------
    def branch(self, start: Point) -> Branch:
        """The piece that begins at a point, in the direction of its tangent."""
        state, shape = self.problem.at(start), self.nodes.shape
        back = state.u - start.tangent_x.reshape(shape), state.load - start.tangent_parameter
        before = replace(state, fields=state.fields._replace(u=back[0], load=back[1]))
        distance = Measure.at(state, self.setup.length).apart(state, before)
        self.places = [Place(-distance, before), Place(0.0, state)]
        self.step_size = min(FIRST, 2.0 * distance)
        self.rows = [Row(0.0, start)]
        # An interrupted walk has what it has passed.
        end = kept(self._run, End(Outcome.REACHED_EDGE))
        with finishing():
            if over() and self._averages:  # an average could still take the place of rows
                sure = self.checked - 1.5 * half_width(max(self.checked, 0.0), self.spacing)
                known = (row for row in self.rows[1:] if row.radius <= sure)
                self.rows = [self.rows[0], *known]
            if end.outcome is Outcome.TURNED_BACK or (over() and self.returns):
                while len(self.rows) > 1 and self._lies_on([*self.film, *self.rows[:-1]], self.rows[-1]):
                    self.rows.pop()
            return self._branch(end)

    def _run(self) -> End:
        """Follow the piece to its end."""
        problem, met, lost = self.problem, End(Outcome.STOPPED_AT_EVENT), End(Outcome.REACHED_EDGE)
        while len(self.rows) < MOST_POINTS:
            if not self._step():
                if self._averages and self._averaged(self.rows[-1].radius, stuck=True):
                    return met
                return lost
            if not problem.wall and self._touched():
                return met
            self._add(self.places[-1])
            self._turns()
            ended, last = self._beyond(), self.rows[-1]
            if self._averages:
                controls, seen = self.folds.controls, self._seen()
                self.checked, centre = turned(seen, controls, self.spacing, self.checked, ended)
                if centre is not None and self._averaged(centre):
                    return met
            if ended:
                self._close()
                return met
            returned = self._lies_on([*self.film[:-RECENT], *self.rows[: -2 * RECENT]], last)
            self.returns = self.returns + 1 if returned else 0
            outgrown = not self.setup.crowded and last.radius > 0.49 * self.setup.edge
            if fills(self.setup, self.places[-1].state) or outgrown:
                return lost
            if self.returns == RETURNS:
                return End(Outcome.TURNED_BACK)
            if self.stop.predicate is not None and self.stop.predicate(last.point):
                self.rows[-1] = self.rows[-1]._replace(event=self.end.name)
                return met
            del self.places[:-HISTORY]
        return lost

    def _add(self, place: Place, event: str = "") -> Point:
        """Put a row in its place, with its fields, from which profiles are made when they are asked for."""
        before = self.places[-2].state if len(self.places) > 1 else place.state
        point = self.problem.point(place.state, place.state.beyond(before))
        point = replace(point, x=self.kept(point.x), tangent_x=self.kept(point.tangent_x))
        self._put(Row(place.arc, point, event))
        return point

    def _put(self, row: Row) -> None:
        insort(self.rows, row, key=itemgetter(0))

    def _branch(self, end: End) -> Branch:
        """The rows, with the directions between them."""
        rows = self._cornered(self.rows) if self._chained else self._joined(self.rows)
        points = [row.point for row in rows]
        known = points
        if rows[-1].event == "average":  # what it spans is dropped
            first = next((k for k, row in enumerate(rows) if row.radius >= points[-1].parameter), 2)
            known = points[: max(first, 2)]
        branch = Branch([], [], end)
        for k, row in enumerate(rows[1:], start=1):
            point = row.point
            if point.problem is self.problem:
                point = self._directed(point, *self._around(known if k < len(known) else points, k), bool(row.event))
            if row.event:
                branch.events.append((EventPoint(point, 0.0, 0.0, name=row.event), k - 1))
            branch.points.append(point)
        return branch

    def _joined(self, rows: list[Row]) -> list[Row]:
        """Behind an average without the first rows that turn back for a moment: what turns round is in averages."""
        if self.problem.past is None:
            return rows
        first, *rest = rows
        while len(rest) > 1 and not rest[0].event and abs(rest[0].radius - first.radius) < JOINT * self.spacing:
            if ((rest[0].place - first.place) * (rest[1].place - rest[0].place) >= 0.0).all():
                break
            del rest[0]
        return [first, *rest]

    def _cornered(self, rows: list[Row]) -> list[Row]:
        """The rows of a chain of arcs, with the folds where its direction turns from one row to the next.

        Several controls may turn round in one corner: they do so in the order in which (d', F') passes their directions
        on the shorter way, with a row each. Steps pass over what single nodes do; what they met of it by chance is
        left out.
        """
        controls, places = self.folds.controls, list[Row]()
        for row in rows:  # what was located may be a row already
            if places and row.event not in ("average", self.end.name) and self._one(places[-1], row):
                continue
            places.append(row._replace(event="") if any(row.event == c.kind for c in controls) else row)
        while self.hops and (ripple := self._ripple(places)) is not None:
            del places[ripple]
        ways = [math.atan2(*change) for change in np.diff([row.place for row in places], axis=0)]
        found = places[:1]
        for row, (before, after) in zip(places[1:], [*pairwise(ways), (0.0, 0.0)], strict=False):
            passed = [] if row.event else in_passing(controls, before, short_way(after - before))
            found += [row._replace(event=control.kind) for control in passed] or [row]
        return found

    def _ripple(self, rows: list[Row]) -> slice | None:
        """Rows along which a control goes back within a row of nodes, by less than it goes before and behind."""
        radius = np.array([row.radius for row in rows])
        for control in self.folds.controls:
            values = np.array([control.value(*row.place) for row in rows])
            rises = np.diff(values)
            turns = np.r_[0, np.flatnonzero(rises[:-1] * rises[1:] < 0.0) + 1, len(rows) - 1]
            swings = np.abs(np.diff(values[turns]))
            for k in range(1, len(swings) - 1):
                first, last = turns[k], turns[k + 1]
                if swings[k] < min(swings[k - 1], swings[k + 1]) and abs(radius[last] - radius[first]) < self.spacing:
                    return slice(first, last + 1)
        return None

    def _one(self, row: Row, other: Row) -> bool:
        """Whether two rows are one state, but for rounding."""
        return bool((np.abs(row.place - other.place) <= ROUNDING * np.maximum(1.0, np.abs(row.place))).all())

    def _directed(self, point: Point, before: Point, after: Point, event: bool) -> Point:
        """A row with its direction: that of the parabola through rows on both sides; the tangent where it is asked."""
        if not point.x.size == before.x.size == after.x.size:
            return point
        ways = [(end.x - start.x, end.parameter - start.parameter) for start, end in ((before, point), (point, after))]
        first, last = (math.sqrt(self.problem.inner(x, x)) + abs(load) for x, load in ways)
        # Rows may be one, and there is none before the first and behind the last; single nodes are averaged over.
        plain = first * last == 0.0 or self._averages
        weights = (1.0, 1.0) if plain else (last / first, first / last)
        (x, load), (further, more) = ways
        along = weights[0] * x + weights[1] * further, weights[0] * load + weights[1] * more
        point = replace(point, tangent_x=along[0], tangent_parameter=along[1])
        return self.problem.tangential(point) if event and not self.problem.wall else point

    def _around(self, points: list[Point], k: int) -> tuple[Point, Point]:
        """The rows between which the direction of a row is taken: those next to it; with averages, outside of what
        single nodes do."""
        own = [p for p in points if p.problem is points[k].problem or p is points[0]]
        place = own.index(points[k])
        first, last = max(place - 1, 0), min(place + 1, len(own) - 1)
        # A fold may be one of the rows.
        first -= first > 0 and own[first].parameter == own[place].parameter
        last += last + 1 < len(own) and own[last].parameter == own[place].parameter
        if self._averages:
            radii = [p.observables["contact_radius"] for p in own]
            half = 0.5 * half_width(radii[place], self.spacing)
            while first > 0 and radii[place] - radii[first] < half:
                first -= 1
            while last < len(own) - 1 and radii[last] - radii[place] < half:
                last += 1
        return own[first], own[last]

    def _seen(self) -> Array:
        """Load, displacement and contact radius of the rows; first of all, just behind the first one."""
        seen = [[*row.place, row.radius] for row in self.rows]
        start = self.rows[0].point
        ahead = self.problem.rates(start.x, start.parameter, start.tangent_x, start.tangent_parameter)[:2]
        small = 1e-3 * self.setup.length / (max(map(abs, ahead)) or 1.0)
        seen.insert(0, [seen[0][0] - small * ahead[0], seen[0][1] - small * ahead[1], seen[0][2]])
        return np.array(seen)

    # -- what happens -------------------------------------------------------------------------------------------------
    def _touched(self) -> bool:
        """Whether the gap has closed within the last step, which then ends there."""
        if clearance(self.setup, self.places[-1].state) > 0.0:
            return False
        last = self.places.pop()
        states = [place.state for place in self.places[-3:] if place.arc >= 0.0]
        way = Direction.between(states[-1], last.state, self.setup.length)
        stretch = Stretch(self.nodes, [*states, last.state], way, self._sharp)
        found = stretch.zero(lambda state: clearance(self.setup, state), way.of(states[-1]), way.of(last.state))
        state = found or last.state
        self.places.append(Place(self.places[-1].arc + self._apart(self.places[-1].state, state), state))
        self._turns()
        self._turns_late()
        point = self._add(self.places[-1], "touch")
        self.rows[-1] = self.rows[-1]._replace(
            point=replace(point, observables={**point.observables, "central_gap": 0.0})
        )
        return True

    def _apart(self, one: Equilibrium, other: Equilibrium) -> float:
        return Measure.at(one, self.setup.length).apart(other, one)

    def _turns(self) -> None:
        """Locate the folds around the last point but one."""
        # The first place of all is none of the curve's.
        if len(self.places) < 3 or self.places[-3].arc < 0.0 or self._averages:
            return
        before, middle, after = self.places[-3:]
        turned: list[tuple[Control, float]] = []
        for control in self.folds.controls:
            values = [control.value(place.state.load, place.state.displacement) for place in (before, middle, after)]
            rise, fall = np.diff(values)
            if rise * fall < 0.0 and max(abs(rise), abs(fall)) > ROUNDING * max(1.0, abs(values[1])):
                turned.append((control, float(np.sign(rise))))
        self._locate(turned, before, middle, after)

    def _locate(self, turned: Sequence[tuple[Control, float]], before: Place, middle: Place, after: Place) -> None:
        """Append the folds of controls with their senses, of which places on both sides and one between are known."""
        if not turned:
            return
        way = Direction.along(Measure.at(middle.state, self.setup.length), *after.state.beyond(before.state))
        known = [place.state for place in self.places[-4:] if place.arc >= 0.0]
        if self._chained and self.hops:  # a step passes few corners
            known = [*self._corners(before.state, middle.state, after.state, way), *known]
        stretch, low, high = Stretch(self.nodes, known, way, self._sharp), way.of(before.state), way.of(after.state)
        for control, sign in turned:
            stretch.extremum(control, sign, low, high)
        inside = [middle.state, *(state for state in stretch.states if low < way.of(state) < high)]
        for control, sign in turned:
            heights = [sign * control.value(state.load, state.displacement) for state in inside]
            found = inside[int(np.argmax(heights))]
            near = middle if way.of(found) > way.of(middle.state) else before
            arc = near.arc + self._apart(near.state, found)
            if self._chained or abs(arc - middle.arc) < SINGLE * (after.arc - before.arc):
                # What is found takes the place of the row that told of it.
                self.rows = [self.rows[0], *(row for row in self.rows[1:] if row.arc != middle.arc or row.event)]
            if arc > 0.0:
                self.folds.told(self._add(Place(min(arc, after.arc), found), control.kind))

    @property
    def _averages(self) -> bool:
        """Whether folds are sought by averages: behind first touch, and behind another average."""
        return self.averaging and bool(self.problem.film or self.problem.past is not None)

    @property
    def _chained(self) -> bool:
        """Whether rows are a chain of the lattice's own arcs, no averages."""
        return self.problem.wall and not self.averaging

    def _corners(self, begin: Equilibrium, middle: Equilibrium, end: Equilibrium, way: Direction) -> list[Equilibrium]:
        """The states at the corners between two of a chain, and half the way between them."""
        found: list[Equilibrium] = []
        for arc in islice(arcs(self.nodes, self.setup.length, (begin, middle), self._sharp), MOST_CORNERS):
            found += [arc.middle, arc.end]
            if way.of(arc.end) > way.of(end):
                break
        return found

    def _turns_late(self) -> None:
        """Locate the folds between the last two states before first touch, by the tangent there."""
        before, after = self.places[-2:]
        point = self.problem.tangential(self.problem.point(after.state, after.state.beyond(before.state)))
        load, displacement, *_ = rates_of(point)
        turned = []
        for control in self.folds.controls:
            values = [control.value(place.state.load, place.state.displacement) for place in (before, after)]
            if (values[1] - values[0]) * control.value(load, displacement) < 0.0:
                turned.append((control, float(np.sign(values[1] - values[0]))))
        self._locate(turned, before, before, after)

    def _averaged(self, centre: float, stuck: bool = False) -> bool:
        """Let the average take over around a contact radius; whether that could be done."""
        first = averaged(self.problem, [row.point for row in self.rows], centre, self.folds.controls, stuck)
        if first is None:
            return False
        self.rows.append(Row(self.rows[-1].arc, first, "average"))
        return True

    def _beyond(self) -> bool:
        """Whether the last step has passed the end in contact."""
        near, last = (row.point for row in self.rows[-2:])
        ahead = self.end.value(last)
        return self.end.counts(last) and ahead >= max(0.0, self.end.value(near))

    def _close(self) -> None:
        """Close the curve exactly at its end."""
        near, last = (row.point for row in self.rows[-2:])
        control, found = self.end.control, last
        if self.end.value(near) < 0.0 and control is not None and near.x.size and last.x.size:
            value = self.end.target if control.kind != "spring" else self.end.target / control.target(1.0)
            with suppress(CorrectionError):
                found = self.problem.meeting(near, last, control, value)
        self.rows[-1] = self.rows[-1]._replace(point=found, event=self.end.name)

    def _lies_on(self, rows: list[Row], row: Row) -> bool:
        """Whether a row lies on the curve through others: a step has turned round, or leapt there."""
        here, place = row.point, row.place
        for first, second in pairwise(rows):
            way, past = second.place - first.place, place - first.place
            share = past @ way / (way @ way or -1.0)
            if not (first.point.x.size == second.point.x.size == here.x.size and 0.0 <= share <= 1.0):
                continue
            aside, change = past - share * way, second.point.x - first.point.x
            if aside @ aside > 1e-4 * (way @ way):
                continue
            if np.abs(here.x - first.point.x - share * change).max() <= 0.1 * np.abs(change).max():
                return True
        return False

    # -- steps --------------------------------------------------------------------------------------------------------
    def _step(self) -> bool:
        """Go one step on; False if that is not possible."""
        if self.queue:
            return self._next()
        if self.setup.crowded and self.problem.wall and len(self.rows) == 1 and self._next():
            return True
        hopped, begun = not self.hops, self.step_size
        while self.step_size >= (LEAST_STEP if self.problem.wall else SHORTEST):
            if not hopped and self.step_size < 0.25 * self.period:
                if self._hop():
                    return True
                hopped = True
            angle = ANGLE if self.step_size > self.period else 0.5
            accepted = self._attempt(self.step_size, ORDER, angle, 0.15)
            hides = accepted is not None and self._hides(accepted[0])
            if hides and self.step_size < LOOK and self.problem.wall and self._next():
                return True
            if accepted is not None and (not hides or self.step_size < LOOK):
                place, miss, failed = accepted
                self.places.append(place)
                goal = max(CURVATURE * self.step_size, self.noise)
                growth = math.sqrt(goal / max(miss, 1e-12))
                self.step_size = min(self.longest, self.step_size * min(1.6 if not failed else 1.0, max(0.5, growth)))
                return True
            self.step_size *= 0.5
        self.step_size = begun
        return self.setup.crowded and self.problem.wall and self._next()

    def _hides(self, place: Place) -> bool:
        """Whether a control may turn round within a step, by the tangents at both ends.

        The tangents' slopes then differ from the mean one by more than a factor, or in sign.
        """
        if self.hops or (self.step_size < LOOK and not (self.problem.wall and self.looks)):
            return False
        begin, change = self.places[-1].state, place.state.beyond(self.places[-1].state)
        way = Direction.along(Measure.at(place.state, self.setup.length), *change)
        ends = [self._tangent(state, way) for state in (begin, place.state)]
        for control in self.folds.controls:
            mean, *slopes = (
                control.value(load, self.nodes.displacement(u, load)) / way.value(u, load)
                for u, load in (change, *ends)
            )
            if any(not mean**2 / STEEPEST <= slope * mean <= STEEPEST * mean**2 for slope in slopes):
                return True
        return False

    def _tangent(self, state: Equilibrium, way: Direction) -> tuple[Array, float]:
        """The direction of the curve at an end of a step, known from the last one or not."""
        for known, direction in self._tangents:
            if known is state:
                return direction
        direction = tangent(self.nodes, state, way.hold(0.0, 0.0), LOOSELY)[:2]
        self._tangents.append((state, direction))
        return direction

    def _next(self) -> bool:
        """Go on to the next corner of a rough contact where steps fail; several at a time."""
        if not self.queue:
            if self.corner is not self.places[-1].state:
                way = onward(*(place.state for place in self.places[-2:]))
                self.arcs = arcs(self.nodes, self.setup.length, way, self._sharp)
            for arc in islice(self.arcs, CORNERS):
                if self._arc_turned(arc):
                    self.queue, self.corner = self._ahead(self.queue), None
                    break
                self.corner = arc.end
                for state in (*self._bends(arc), arc.end):
                    # Between states as close as their errors a control would seem to turn round.
                    if self._apart([self.places[-1].state, *self.queue][-1], state) > LEAST_STEP:
                        self.queue.append(state)
            if not self.queue:
                return False
        begin, state = self.places[-1], self.queue.pop(0)
        self.places.append(Place(begin.arc + self._apart(begin.state, state), state))
        return True

    def _arc_turned(self, arc: Arc) -> bool:
        """Whether an arc ends where the curve has been: where several nodes change in one place, rounding may turn the
        direction round."""
        measure, known = Measure.at(arc.end, self.setup.length), [place.state for place in self.places] + self.queue
        length = measure.apart(arc.begin, arc.end)
        return any(measure.apart(state, arc.end) < 0.1 * length for state in known if state is not arc.begin)

    def _ahead(self, states: list[Equilibrium]) -> list[Equilibrium]:
        """The states up to the one that is farthest from the last place."""
        apart = [self._apart(self.places[-1].state, state) for state in states]
        return states[: int(np.argmax(apart)) + 1] if max(apart, default=0.0) > LEAST_STEP else []

    def _bends(self, arc: Arc) -> list[Equilibrium]:
        """The states of an arc at which a control turns round, by the tangents at its ends."""
        way = Direction.between(arc.begin, arc.end, self.setup.length)
        stretch = Stretch(self.nodes, [arc.begin, arc.middle, arc.end], way, self._sharp)
        found = []
        for control in self.folds.controls:
            first, last = (control.value(load, self.nodes.displacement(u, load)) for u, load in arc.tangents)
            if first * last < 0.0:
                found.append(stretch.extremum(control, first, way.of(arc.begin), way.of(arc.end)))
        return sorted(filter(None, found), key=way.of)

    def _hop(self) -> bool:
        """Pass corners of the lattice's own, which are a period apart, by a longer step along the mean direction."""
        if not self.places[-1].state.contact.any():
            return False
        for factor in (1.0, 0.5, 2.0, 4.0):
            size = factor * self.period
            accepted = self._attempt(size, 1, 0.5, 0.8)
            if accepted is not None:
                self.places.append(accepted[0])
                self.step_size = size
                return True
        return False

    def _recent(self, count: int, size: float) -> list[Place]:
        """The last place and earlier ones at distances that suit a step: corners of the lattice lie closer."""
        chosen = [self.places[-1]]
        for place in reversed(self.places[:-1]):
            if chosen[-1].arc - place.arc >= 0.5 * size:
                chosen.append(place)
            if len(chosen) == count:
                break
        if len(chosen) == 1:
            chosen.append(self.places[0] if len(self.places) < 3 else self.places[-2])
        return chosen[::-1]

    def _attempt(self, size: float, order: int, angle: float, loose: float) -> tuple[Place, float, bool] | None:
        """A step of a given size: the place, by how much the prediction missed, and whether that was much."""
        past = self._recent(order + 1, size)
        last, states = past[-1].state, [place.state for place in past]
        arcs = np.array([place.arc for place in past])
        weights, slopes = lagrange(arcs, arcs[-1] + size)
        u, load, contact = predicted(self.nodes, states, weights, self.problem.wall)
        # Rounding is not to choose among states that turn into each other.
        u, contact = 0.5 * (u + self.problem.kept(u)), contact & (self.problem.kept(contact.astype(float)) > 0.5)
        rate = np.tensordot(slopes, [state.u for state in states], 1), float(slopes @ [state.load for state in states])
        measure = Measure.at(last, self.setup.length)
        direction = Direction.along(measure, *rate)
        hold = direction.hold(direction.value(u, load), 1e-3 * size * measure.product(*rate, *rate))
        found = newton(self.nodes, u, load, hold, contact, self.settings)
        if not found.converged:
            return None
        miss = measure.norm(found.u - u, found.load - load)
        change = found.beyond(last)
        distance = measure.norm(*change)
        cosine = direction.value(*change) / (distance * measure.norm(*rate)) if distance > 0 else 0.0
        # A step shorter than what may be missed could be a leap; corners of a chain are found by themselves.
        allowed = max(loose * size, 4.0 * self.noise if self.hops else min(4.0 * self.noise, size))
        if self._parted(found):
            return None
        if cosine < angle or miss > allowed or distance > 4.0 * size or self._retraced(found, distance):
            return None
        return Place(past[-1].arc + distance, found), miss, miss > 0.5 * allowed

    def _parted(self, state: Equilibrium) -> bool:
        """Whether a single contact has opened again within a step, by more than between nodes: that is a leap."""
        if self.setup.crowded or state.contact.any() or not self.places[-1].state.contact.any():
            return False
        return clearance(self.setup, state) > OPENS * float(self.nodes.heights.min())

    def _retraced(self, state: Equilibrium, distance: float) -> bool:
        """Whether a state lies closer to an earlier one than to the last: the walk has turned round."""
        measure = Measure.at(state, self.setup.length)
        return any(measure.apart(place.state, state) < 0.9 * distance for place in self.places[:-1])
