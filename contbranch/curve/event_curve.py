"""An event followed along its curve in a second parameter: through first touch, past cusps, where it meets others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.contact.family import Family
from contbranch.contact.units import Scales
from contbranch.continuation import CorrectionError, Event, Outcome, Point, Segment, StopAt, correct
from contbranch.continuation.edge import Range, land
from contbranch.continuation.follow import follow
from contbranch.continuation.newton import tangent_at
from contbranch.continuation.outcomes import End
from contbranch.continuation.problem import Array
from contbranch.continuation.walk import annotated, to_point
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.augmented import STEPS, Augmented, Condition, Fold, Held, Locus, Other, augmented
from contbranch.curve.events import Margin, rates
from contbranch.curve.problem import EquilibriumProblem, equilibrium
from contbranch.curve.refine import Found, moved, refine, settled
from contbranch.errors import ModelError
from contbranch.results.followed import FollowedPoint, Special

__all__ = ["EventCurve", "condition_for"]

Progress = Callable[[float, str], None]

# Beside first touch a curve starts at this w (or smaller ones), and one that comes to half of it has come to it.
BESIDE = (0.06, 0.02, 0.006, 0.002)
# A curve passes first touch no more often than this.
PASSAGES = 8
# Error of loads along the curve; where it may lead far away, the stiffness of a weak spring is that of the interaction
# there. Loads this many times larger count as none, or those below a share of the accuracy.
TOLERANCE, FAR_TOLERANCE, RESOLVED, NEGLIGIBLE = 3e-7, 1e-9, 60.0, 0.5
# Discretisations are made anew so often at the start.
REMESHES = 3
# Relative to their place in a step, events are located so coarsely while following; they are refined afterwards.
COARSE = 0.03
# What differences leave undecided of a tangent's component.
TANGENT_NOISE = 2e-10
KEYS = ("load", "displacement", "contact_radius", "central_gap")
ENDED = (Outcome.REACHED_EDGE, Outcome.STARTED_ON_EDGE)


class Turn(Event):
    """The parameter turns round: two events merge."""

    name = "cusp"
    relative_resolution = COARSE
    noise = TANGENT_NOISE

    def value(self, point: Point) -> float:
        """Component of the tangent."""
        return point.tangent_parameter


class Edge(Event):
    """First touch, or another edge of the equilibria's parameter: exactly, or, with no states beyond, close to it."""

    name = "touch"
    terminal = True
    hidden_pairs = False

    def __init__(self, beside: float = 0.0) -> None:
        self.beside = beside

    def value(self, point: Point) -> float:
        """Distance of w."""
        problem, w = augmented(point), float(point.x[-1])
        low, high = map(problem.root, problem.base.parameter_range)
        return min(w - low, high - w) - (0.0 if problem.base.beyond_edge else 0.5 * self.beside)


class Meeting(Event):
    """The rate of another control vanishes, too.

    Parameters
    ----------
    name : str
    weights : callable
        Of load and displacement, at the parameter's coordinate.
    """

    relative_resolution = COARSE

    def __init__(self, name: str, weights: Callable[[float], tuple[float, float]]) -> None:
        self.name, self.weights = name, weights

    def value(self, point: Point) -> float:
        """Weighted rates of load and displacement along the equilibria at fixed parameter."""
        return float(np.dot(self.weights(point.parameter), rates(augmented(point).held(point))))


def condition_for(family: Family, place: Point, control: Control | None, event: Event | None) -> Condition:
    """What makes a place an event: the fold of a control (reduced units), an edge of the parameter, another event."""
    if event is not None:
        return Other(event)
    if control is None or place.parameter in equilibrium(place).parameter_range:
        return Held(place.parameter, corner=control is not None)
    return Fold(family, control)


@dataclass
class EventCurve:
    """One event along the parameter of a family.

    Attributes
    ----------
    family : Family
    condition : Condition
    to : tuple of float
        One value of the parameter, or one on each side of the start.
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units.
    progress : callable or None
    rows : list of FollowedPoint
        Along the curve, in the contact's units; the special ones are `Special`. It begins at the event or, followed
        both ways, at the end with the lower value.
    complete, message : bool, str
    """

    family: Family
    condition: Condition
    to: tuple[float, ...]
    accuracy: float
    progress: Progress | None = None

    def __post_init__(self) -> None:
        self.tolerance = FAR_TOLERANCE if self.family.spacing == "angle" else TOLERANCE
        self.negligible = max(NEGLIGIBLE * self.accuracy, RESOLVED * self.tolerance)
        self.q = self.family.coordinate(self.family.start)
        self.known = {self.q: self.family.start, **{self.family.coordinate(value): value for value in self.to}}
        self.interval = Range(min(self.known), max(self.known))
        self.touching = isinstance(self.condition, Held)
        self.rows: list[FollowedPoint] = []
        self.points: list[Point] = []
        self.complete, self.message = True, ""

    # -- the curve ----------------------------------------------------------------------------------------------------
    def trace(self, place: Point) -> None:
        """Follow the event from where it was found.

        Raises
        ------
        ModelError
            If it is not found again.
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                start = self._start(place)
            except CorrectionError as error:
                message = f"follow: the event was not found again at its start. {error.outcome.value} {error.detail}"
                raise ModelError(message.strip()) from error
            self.beside = min(BESIDE[0], abs(float(start.x[-1])))
            backward, first = self._onward(start.turned())
            forward, last = self._onward(start)
            points, ends = [*(point.turned() for point in reversed(backward)), start, *forward], (first, last)
            if not forward:  # the curve begins at the event
                points, ends = [point.turned() for point in reversed(points)], (last, first)
            self._refine(points, ends)

    def _start(self, place: Point) -> Point:
        """The event on a discretisation as fine as the curve needs, towards larger values of the parameter."""
        base = equilibrium(place)
        size = math.sqrt(base.inner(place.x, place.x)) or base.scale
        locus = Locus(self.family, self.condition, (self.interval.low, self.interval.high), size)
        problem = base.member(self.family.reduced(self.q)[0], self.tolerance)
        own = self._resolved(replace(place, problem=problem))  # the event may come from a trace for fewer digits
        problem, x = equilibrium(own), own.x
        if self.touching:  # its tangent, on its own side
            v, a, _ = tangent_at(problem, x, own.parameter)
            own = replace(own, tangent_x=v, tangent_parameter=a)
        system = Augmented(locus, problem, (own.tangent_x, own.tangent_parameter))
        row = np.zeros(x.size + 1), 1.0
        z = system.joined(x, own.parameter)
        point = to_point(system, correct(system, z, self.q, row, system.metric(z), precise=True), system.metric(z))
        return annotated(replace(point, parameter=self.q), label="start")

    def _resolved(self, point: Point) -> Point:
        """A point on a discretisation as fine as the curve needs."""
        for _ in range(REMESHES):
            problem = equilibrium(point)
            if problem.defect(point).relative(problem.values(point.x, point.parameter)) <= self.tolerance:
                break
            point = settled(moved(point, problem.resolving(point, self.tolerance)))
        return annotated(point, label="")

    def _onward(self, start: Point) -> tuple[list[Point], End]:
        """The curve from a point along its tangent, through first touch as often as it comes there, and how it ends."""
        points, end = self._piece(start, self.beside)
        for _ in range(PASSAGES):
            if end.outcome is not Outcome.STOPPED_AT_EVENT or points[-1].label != "touch":
                break
            try:
                self._touched(points)
                following = self._beyond(points[-1], augmented(points[-2] if len(points) > 1 else start).base)
            except CorrectionError as error:
                return points, End(error.outcome, f"(Beyond first touch: {error.detail})")
            points += following[0]
            end = following[1]
        return points, end

    def _piece(self, start: Point, beside: float) -> tuple[list[Point], End]:
        """The curve from a point along its tangent, in one representation of the equilibria."""
        outward = start.parameter == (self.interval.high if start.tangent_parameter > 0 else self.interval.low)
        if outward and abs(start.tangent_parameter) > 1e-12:
            return [], End(Outcome.STARTED_ON_EDGE)
        problem = augmented(start)
        events: list[Event] = [Turn(), *(Margin(name) for name in problem.margins(start.x, start.parameter))]
        if isinstance(self.condition, Fold):
            events.append(Meeting("coincidence", self._crossed))
        elif not (isinstance(self.condition, Held) and self.condition.corner):
            events += [Meeting(control.kind, lambda _, c=control: c.weights) for control in (LOAD, DISPLACEMENT)]  # type: ignore[misc]
        if not self.touching:
            events.append(Edge(beside))
        stop = StopAt(predicate=self._far)
        branch = follow(start, problem.balance(start), self.interval, STEPS, events, stop)
        return branch.points, branch.end

    def _crossed(self, q: float) -> tuple[float, float]:
        """Weights of the control at a right angle to the event's own."""
        first, second = self.condition.weights(q)
        return -second, first

    def _far(self, point: Point) -> bool:
        """Whether the interaction is negligible: the load, and what the gap could still change of it."""
        if self.progress is not None:
            share = abs(point.parameter - self.q) / self.interval.width
            self.progress(0.6 * share, f"{self.family.name} {self.family.value(point.parameter):.4g}")
        values = augmented(point).values(point.x, point.parameter)
        if self.touching or abs(values.load) > self.negligible or values.central_gap < equilibrium(point).scale:
            return False
        held = augmented(point).held(point)
        rate = equilibrium(held).rates(held.x, held.parameter, held.tangent_x, held.tangent_parameter)
        return abs(rate.load * values.central_gap) <= self.negligible * abs(rate.central_gap)

    # -- first touch --------------------------------------------------------------------------------------------------
    def _touched(self, points: list[Point]) -> None:
        """Append first touch itself to points that end in a contact too small to go on with."""
        last = points[-1]
        problem = augmented(last)
        if problem.base.beyond_edge:
            return
        points[-1] = replace(last, label="")
        edge = self._edge(last)
        others = _others(last, edge)
        if not others:
            raise CorrectionError(Outcome.STEP_TOO_SMALL, "(Nothing is known of what is there.)")
        x = settled(others[0]).x
        other = problem.on(equilibrium(others[0]), (others[0].tangent_x, others[0].tangent_parameter))
        w = other.root(edge)
        points.append(replace(_at_place(other, np.append(x, w), last.parameter), label="touch"))

    def _edge(self, point: Point) -> float:
        """The edge of the equilibria's parameter next to a point."""
        problem = augmented(point)
        p = problem.parameter(float(point.x[-1]))
        return min(problem.base.parameter_range, key=lambda edge: abs(edge - p))

    def _beyond(self, touch: Point, left: EquilibriumProblem) -> tuple[list[Point], End]:
        """The curve on the other side of first touch, seen from the representation that was left.

        Raises
        ------
        CorrectionError
            If it is not found there.
        """
        failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve was not found there.)")
        problem, edge = augmented(touch), self._edge(touch)
        crossed = type(problem.base) is not type(left) or problem.base.parameter_range != left.parameter_range
        for state in [_own(touch, edge)] if crossed else _others(touch, edge):
            base = equilibrium(state)
            rate = state.tangent_x / state.tangent_parameter
            other = problem.on(base, (rate, 1.0))
            inward = 1.0 if edge == base.parameter_range[0] else -1.0
            for beside in BESIDE:
                w = other.root(edge) + inward * beside
                try:
                    z = np.append(state.x + (other.parameter(w) - edge) * rate, w)
                    start = self._resolved(_at_place(other, z, touch.parameter))
                except CorrectionError as error:
                    failure = error
                    continue
                if not self.interval.contains(start.parameter):
                    failure = CorrectionError(Outcome.REACHED_EDGE, "(The curve leaves the range at first touch.)")
                    continue
                start = start if start.tangent_x[-1] * inward > 0 else start.turned()
                points, end = self._piece(start, beside)
                if points:
                    return [start, *points], end
        raise failure

    # -- points made precise ------------------------------------------------------------------------------------------
    def _refine(self, points: list[Point], ends: tuple[End, End]) -> None:
        """Rows and special points from the points of the curve."""
        messages: list[str] = []
        self.points = points
        for k, point in enumerate(points):
            if self.progress is not None:
                self.progress(0.6 + 0.4 * k / len(points), f"{len(self.special)} special points")
            try:
                found = self._special(k)
            except CorrectionError as error:
                where = f"{self.family.name} = {self._value(point.parameter):.6g}"
                messages.append(f"The point at {where} ({point.label}) could not be made precise. {error.detail}")
                found = None
            self.rows.append(found or self._row(point))
        self.complete = not messages
        for k, end in zip((0, len(points) - 1), ends, strict=True):
            kind, message = self._ending(points[k], end, len(points))
            self.complete &= end.outcome in ENDED or kind == "infinite-separation"
            messages.append(message)
            if kind:
                self.rows[k] = _as_special(self.rows[k], kind, k, message)
        worst = max(self._relative(row, point) for row, point in zip(self.rows, points, strict=True))
        if worst > self.accuracy:
            self.complete = False
            messages.append(f"An error estimate is {worst / self.accuracy:.3g} times the accuracy asked.")
        self.message = " ".join(dict.fromkeys(filter(None, messages)))

    @property
    def special(self) -> tuple[Special, ...]:
        """The special points, in order."""
        return tuple(row for row in self.rows if isinstance(row, Special))

    def _units(self, point: Point) -> tuple[float, ...]:
        scales: Scales = self.family.reduced(point.parameter)[1]
        return scales.load, scales.normal, scales.in_plane, scales.normal

    def _value(self, q: float) -> float:
        """Value of the parameter at a coordinate, exactly what was asked for at the ends."""
        return self.known.get(q, self.family.value(q))

    def _scaled(self, found: Found, at: Point, of_value: float = 0.0) -> FollowedPoint:
        units = self._units(at)
        load, displacement, radius, gap = (value * unit for value, unit in zip(found.numbers, units, strict=True))
        error = {key: float(e) * unit for key, e, unit in zip(KEYS, found.error, units, strict=True)}
        error[self.family.name] = of_value
        return FollowedPoint(self.family.name, self._value(at.parameter), load, displacement, radius, gap, error)

    def _relative(self, row: FollowedPoint, point: Point) -> float:
        units = self._units(point)
        return max(row.error[k] / max(unit, abs(float(getattr(row, k)))) for k, unit in zip(KEYS, units, strict=True))

    def _row(self, point: Point) -> FollowedPoint:
        """The event at the parameter of a point of the curve, located there on discretisations made for it."""
        held = augmented(point).held(point)
        if isinstance(self.condition, Held):
            held = replace(held, parameter=self.condition.parameter)
        return self._scaled(refine(held, self.condition.event(point.parameter), self.accuracy), point)

    def _special(self, k: int) -> Special | None:
        """A point of codimension two made precise; None at other points."""
        point = self.points[k]
        fold = isinstance(self.condition, Fold)
        before, after = (self.points[min(max(j, 0), len(self.points) - 1)].parameter for j in (k - 1, k + 1))
        passing = (point.parameter - before) * (after - point.parameter) > 0 or k in (0, len(self.points) - 1)
        controls = {"load": LOAD, "displacement": DISPLACEMENT}
        event: Event
        if point.label == "cusp":
            kind, event = "cusp", Turn()
            message = CUSP if fold else PAIR
        elif point.label == "coincidence":
            kind, event, message = "coincidence", Meeting("", self._crossed), COINCIDENCE
        elif point.label in controls:
            weights = controls[point.label].weights
            event = Meeting("", lambda _: weights)
            kind, message = ("fold-through-touch", MEETING) if self.touching else ("coincidence", MET)
        elif point.label == "touch":
            event, message = Edge(), (THROUGH if passing else CORNER) if fold else AT_TOUCH
            kind = ("fold-through-touch" if passing else "cusp-at-touch") if fold else "through-touch"
        else:
            return None
        problem = augmented(point)
        held = problem.held(point)
        fine = problem.on(problem.base, (held.tangent_x, held.tangent_parameter), fine=point.label == "cusp")
        found = refine(settled(replace(point, problem=fine)), event, self.accuracy)
        if self.touching or point.label == "touch":
            found = replace(found, numbers=(*found.numbers[:2], 0.0, 0.0), error=(*found.error[:2], 0.0, 0.0))
        q = found.point.parameter
        row = self._scaled(found, found.point, found.parameter_error * abs(self.family.rate(q)))
        return _as_special(row, kind, k, message, point.label if point.label in controls else None)

    def _ending(self, last: Point, end: End, count: int) -> tuple[str, str]:
        """The kind of special point that an end is, if any, and a sentence."""
        if end.outcome is Outcome.STOPPED_BY_PREDICATE:
            return "infinite-separation", "The event leaves to infinite separation."
        if end.outcome in ENDED:
            if self.family.spacing == "angle" and last.parameter in (0.0, 0.5 * math.pi):
                kind = "load-fold" if last.parameter == 0.0 else "displacement-fold"
                return kind, f"The fold of the spring has become a {kind.replace('-', ' ')}."
            if end.outcome is Outcome.REACHED_EDGE and last.parameter == self.q and count > 1:
                return "", f"The curve turns and comes back to the present {self.family.name}."
            return "", ""
        if end.outcome is Outcome.STOPPED_AT_EVENT:
            held = augmented(last).held(last)
            return "inadmissible", equilibrium(held).ending(last.label or "", held)
        return "", end.message

    # -- single values ------------------------------------------------------------------------------------------------
    def at(self, value: float) -> tuple[FollowedPoint, ...]:
        """The event at exactly one value of the parameter, as often as the curve passes it.

        Raises
        ------
        ModelError
            If it is not found again.
        """
        q = self.family.coordinate(value)
        found: list[FollowedPoint] = []
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for k, (point, row) in enumerate(zip(self.points, self.rows, strict=True)):
                if row.value == value or point.parameter == q:
                    found.append(row)
                elif k and (self.points[k - 1].parameter - q) * (point.parameter - q) < 0:
                    try:
                        between = _between(self.points[k - 1], point, q)
                    except CorrectionError as error:
                        where = f"{self.family.value(q):.9g}"
                        raise ModelError(f"at: the event was not found at {where}. {error.detail}") from error
                    found.append(replace(self._row(between), value=value))
        return tuple(found)


CUSP = "Two folds merge: a cusp. The curve goes on as the other fold."
PAIR = "Two events of this kind merge: the parameter has an extremum along them."
COINCIDENCE = "Load and displacement have their folds at the same state, and with them every spring."
MEETING = "A fold of this control lies exactly at first touch."
MET = "A fold of this control lies at the same state."
THROUGH = "The fold passes first touch: on one side it has contact, on the other none."
CORNER = "Two folds, one with contact and one without, meet at first touch and end there: a kinked cusp."
AT_TOUCH = "The event lies exactly at first touch."


def _as_special(row: FollowedPoint, kind: str, index: int, message: str, control: str | None = None) -> Special:
    known = {name: getattr(row, name) for name in ("parameter", "value", *KEYS, "error")}
    return Special(**known, kind=kind, index=index, control=control, message=message)


def _at_place(problem: Augmented, z: Array, q: float) -> Point:
    """The point of the curve with the state's w: q is found.

    Raises
    ------
    CorrectionError
        If there is none close by.
    """
    w = float(z[-1])
    row = np.zeros(z.size)
    row[-1] = 1.0
    metric = problem.metric(z)
    corrected = correct(problem, z, q, (row, 0.0), metric, tolerance=1e-12, noise=1e8, precise=True)
    point = to_point(problem, corrected, metric, sign=False)
    return replace(point, x=np.append(point.x[:-1], w))


def _own(touch: Point, edge: float) -> Point:
    """First touch as an equilibrium on its own side."""
    problem = augmented(touch).member(touch.parameter)
    return Point(problem, touch.x[:-1], edge, *tangent_at(problem, touch.x[:-1], edge)[:2])


def _others(touch: Point, edge: float) -> Sequence[Point]:
    """First touch as equilibria of the representations on its other side."""
    return augmented(touch).member(touch.parameter).across(touch.x[:-1], edge)


def _between(begin: Point, end: Point, q: float) -> Point:
    """The point of the curve at a coordinate between two neighbouring points.

    Raises
    ------
    CorrectionError
        If it is not found.
    """
    first, last = augmented(begin), augmented(end)
    if first.base.parameter_range != last.base.parameter_range:  # first touch, carried to the side of its neighbour
        if begin.label == "touch":
            begin = _on_side_of(begin, last, end)
        else:
            end = _on_side_of(end, first, begin)
    end = settled(moved(end, augmented(begin)))
    return replace(land(Segment(begin, end, first.metric(begin.x)), q, STEPS), parameter=q)


def _on_side_of(touch: Point, problem: Augmented, neighbour: Point) -> Point:
    """First touch as a point of another representation."""
    edge = min(problem.base.parameter_range, key=lambda p: abs(p - problem.split(neighbour.x)[1]))
    state = _others(touch, edge)[0]
    base = equilibrium(state)
    x = base.carried(state.x, state.x, problem.base)
    point = _at_place(problem, problem.joined(x, edge), touch.parameter)
    chord = point.x - neighbour.x, point.parameter - neighbour.parameter
    along = problem.metric(point.x).dot(problem, point.tangent_x, point.tangent_parameter, *chord)
    ahead = problem.metric(point.x).dot(problem, neighbour.tangent_x, neighbour.tangent_parameter, *chord)
    return point if along * ahead >= 0 else point.turned()
