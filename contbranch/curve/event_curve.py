"""An event followed along its curve in a second parameter: through first touch, past cusps, where it meets others."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from contbranch.continuation import CorrectionError, End, Event, Outcome, Point, Segment, StopAt
from contbranch.continuation.augmented import Turn, tangent_of
from contbranch.continuation.edge import Range, land
from contbranch.continuation.follow import follow
from contbranch.continuation.walk import annotated
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.augmented import STEPS, Condition, EventProblem, augmented
from contbranch.curve.events import Margin, rates
from contbranch.curve.outcome import measured
from contbranch.curve.problem import equilibrium, values_of
from contbranch.curve.refine import Found, by_defect, moved, refine, settled
from contbranch.errors import ModelError
from contbranch.results.followed import FollowedPoint, Special
from contbranch.watch import INTERRUPTIONS, caught, finishing, over, tell

__all__ = ["EventCurve"]

# Distances in w from first touch from which the curve on its other side is tried, the larger ones first. A curve that
# comes to half the first of them, and is not found behind, is followed closer, down to the last: onsets become
# continuous like that.
TOUCH_ROOTS, CLOSER, STARTS, CLOSEST = 0.06, 0.3, 4, 1e-8
# Error of loads along the curve; where it may lead far away, the stiffness of a weak spring is that of the interaction
# there. Loads this many times larger count as none, or those below a share of the accuracy.
TOLERANCE, FAR_TOLERANCE, RESOLVED, NEGLIGIBLE = 3e-7, 1e-9, 60.0, 0.5
CUSP = "Two folds merge: a cusp. The curve goes on as the other fold."
PAIR = "Two events of this kind merge: the parameter has an extremum along them."
COINCIDENCE = "Load and displacement have their folds at the same state, and with them every spring."
MEETING = "A fold of this control lies exactly at first touch."
MET = "A fold of this control lies at the same state."
THROUGH = "The fold passes first touch: on one side it has contact, on the other none."
CORNER = "Two folds, one with contact and one without, meet at first touch and end there: a kinked cusp."
AT_TOUCH = "The event lies exactly at first touch."
UNDESCRIBED = "The event has come to the gap at which the table of the law ends."
ENDED = (Outcome.REACHED_EDGE, Outcome.STARTED_ON_EDGE)


@dataclass(frozen=True)
class Meeting(Event):
    """A function of the points of the curve vanishes: another event lies at the same state."""

    function: Callable[[Point], float]
    name: str

    def value(self, point: Point) -> float:
        """The function."""
        return self.function(point)


class Ending(Meeting):
    """A function of the points of the curve vanishes where its representation ends."""

    terminal = True
    hidden_pairs = False


def _to_touch(point: Point) -> float:
    """Distance of w from first touch, or from another edge of the equilibria's parameter."""
    problem, w = augmented(point), float(point.x[-1])
    low, high = map(problem.root, problem.base.parameter_range)
    return min(w - low, high - w)


def _to_table_end(point: Point) -> float:
    """How much smaller the gap is than the last one that the law's table describes."""
    held = augmented(point).held(point)
    return equilibrium(held).described_to - values_of(held).central_gap


def _rate(point: Point, weights: Callable[[float], tuple[float, float]]) -> float:
    """Weighted rates of load and displacement along the equilibria at fixed parameter."""
    return float(np.dot(weights(point.parameter), rates(augmented(point).held(point))))


@dataclass
class EventCurve:
    """One event along the parameter of a family.

    Attributes
    ----------
    condition : Condition
        With the family.
    to : tuple of float
        One value of the parameter, or one on each side of the start.
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units.
    rows : list of FollowedPoint
        Along the curve, in the contact's units; the special ones are `Special`. It begins at the event or, followed
        both ways, at the end with the lower value.
    complete, message : bool, str
    """

    condition: Condition
    to: tuple[float, ...]
    accuracy: float

    def __post_init__(self) -> None:
        self.family = self.condition.family
        self.tolerance = FAR_TOLERANCE if self.family.spacing == "angle" else TOLERANCE
        self.least_load = max(NEGLIGIBLE * self.accuracy, RESOLVED * self.tolerance)
        self.q = self.family.coordinate(self.family.start)
        self.known = {self.q: self.family.start, **{self.family.coordinate(value): value for value in self.to}}
        self.interval = Range(min(self.known), max(self.known))
        self.touching = self.condition.edge is not None
        weights = {"load": lambda _: LOAD.weights, "displacement": lambda _: DISPLACEMENT.weights}
        if self.condition.folds:
            weights = {"coincidence": self._crossed}
        elif self.condition.control is not None:  # a fold in a corner
            weights = {}
        met: list[Event] = [Meeting(partial(_rate, weights=own), name) for name, own in weights.items()]
        self.meetings = {event.name: event for event in (Turn(), *met)}
        self.rows: list[FollowedPoint] = []
        self.points: list[Point] = []
        self.scale = self.beside = 0.0
        self.worst, self.complete, self.message = 0.0, True, ""
        law = self.family.contact.interaction
        # An interaction that begins at a gap is negligible there, and nowhere does its event leave.
        self.begins = law is not None and math.isfinite(law.kink) and not law.evaluate(2.0 * law.kink).pressure

    def _crossed(self, q: float) -> tuple[float, float]:
        """Weights of the control at a right angle to that of the fold."""
        first, second = self.condition.weights(q)
        return -second, first

    # -- the curve ----------------------------------------------------------------------------------------------------
    def trace(self, place: Point) -> None:
        """Follow the event from where it was found.

        Raises
        ------
        InputError
            If the model has no such member of the family.
        ModelError
            If it is not found again.
        """
        self.scale = equilibrium(place).scale
        for q in self.known:
            equilibrium(place).member(self.family.reduced(q)[0])
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                start = self._start(place)
            except CorrectionError as error:
                message = f"follow: the event was not found again at its start. {error.outcome.value} {error.detail}"
                remedy = "Trace with a hundredth of the accuracy, and follow its event."
                raise ModelError(f"{message.strip()} {remedy}") from error
            backward, first = self._onward(start.turned())
            forward, last = self._onward(start)
            points, ends = [*(point.turned() for point in reversed(backward)), start, *forward], (first, last)
            if not forward:  # the curve begins at the event
                points, ends = [point.turned() for point in reversed(points)], (last, first)
            self._refine(points, ends)

    def _start(self, place: Point) -> Point:
        """The event on a discretisation as fine as the curve needs, towards larger values of the parameter."""
        base = equilibrium(place)
        problem = base.member(self.family.reduced(self.q)[0], self.tolerance)
        own = self._resolved(replace(place, problem=problem))  # the event may come from a trace for fewer digits
        system = EventProblem.around(self.condition, own, self.interval)
        return annotated(system.solved(system.joined(own.x, own.parameter), self.q), label="start")

    def _resolved(self, point: Point) -> Point:
        """A point on a discretisation as fine as the curve needs."""
        problem = equilibrium(point)
        if problem.defect(point).relative(values_of(point)) > self.tolerance:
            point = settled(moved(point, problem.resolving(point, self.tolerance)))
        return annotated(point, label="")

    def _onward(self, start: Point) -> tuple[list[Point], End]:
        """The curve from a point along its tangent, through first touch as often as it comes there, and how it ends."""
        points, end = self._piece(start, min(TOUCH_ROOTS, abs(float(start.x[-1]))))
        while points and points[-1].label == "touch" and len(points) < STEPS.maximum_points:
            try:
                beyond, end = self._beyond(points)
            except CorrectionError as error:
                if CLOSER * self.beside < CLOSEST or points[-1].label == "touch":
                    return points, End(error.outcome, f"(Beyond first touch: {error.detail})")
                beyond, end = self._piece(points[-1], CLOSER * self.beside)  # it was not so close
            points += beyond
        return points, end

    def _piece(self, start: Point, beside: float) -> tuple[list[Point], End]:
        """The curve from a point along its tangent, in one representation of the equilibria."""
        outward = start.parameter == (self.interval.high if start.tangent_parameter > 0 else self.interval.low)
        if outward and abs(start.tangent_parameter) > 1e-12:
            return [], End(Outcome.STARTED_ON_EDGE)
        problem = augmented(start)
        margins: Iterable[Event] = (Margin(name) for name in problem.margins(start.x, start.parameter))
        if isinstance(self.condition.event, Margin):  # one of them vanishes all along
            margins = ()
        self.beside = beside
        events = [*self.meetings.values(), *margins]
        if math.isfinite(problem.base.described_to):
            events.append(Ending(_to_table_end, "table-end"))
        if not self.touching and np.isfinite(problem.base.parameter_range).any():
            least = 0.0 if problem.base.beyond_edge else 0.5 * beside  # there are no states beyond
            events.append(Ending(lambda point: _to_touch(point) - least, "touch"))
        branch = follow(start, problem.balance(start), self.interval, STEPS, events, StopAt(predicate=self._report))
        # Where the interaction has become negligible within the last step, what follows is rounding.
        last = next((k for k, point in enumerate(branch.points) if self._negligible(point)), None)
        if last is None:
            return branch.points, branch.end
        return [*branch.points[:last], replace(branch.points[last], label="")], End(Outcome.STOPPED_BY_PREDICATE)

    def _report(self, point: Point) -> bool:
        """Tell how far it is; whether the curve is to end."""
        share = abs(point.parameter - self.q) / self.interval.width
        tell(0.6 * share, f"{self.family.name} {self.family.value(point.parameter):.4g}")
        return self._negligible(point)

    def _negligible(self, point: Point) -> bool:
        """Whether the interaction is negligible: the load, and its mean from here to infinity."""
        load, energy, gap = (abs(point.observables[name]) for name in ("load", "energy", "central_gap"))
        negligible = max(load, energy / max(gap, self.scale)) <= self.least_load
        return negligible and gap > self.scale and not (self.touching or self.begins)

    # -- first touch --------------------------------------------------------------------------------------------------
    def _beyond(self, points: list[Point]) -> tuple[list[Point], End]:
        """The curve on the other side of first touch, to which points have come.

        A contact too small to go on with is not first touch itself, which is then appended to the points.

        Raises
        ------
        CorrectionError
            If it is not found there.
        """
        last = points[-1]
        problem = augmented(last)
        x, p = problem.split(last.x)
        edge = min(problem.base.parameter_range, key=lambda one: abs(one - p))
        others = equilibrium(problem.held(last)).across(x, edge)  # first touch as the problem behind it has it
        if not problem.base.beyond_edge:
            points[-1] = replace(last, label="")
            for touch in others[:1]:
                behind = problem.on(tangent_of(touch), equilibrium(touch))
                touch = self._within(behind.solved(behind.joined(touch.x, edge), last.parameter, place=True))
                points.append(replace(touch, label="touch"))
        failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve was not found there.)")
        for touch, k in itertools.product(others, range(STARTS)):
            beside, rate = TOUCH_ROOTS * CLOSER**k, touch.tangent_x / touch.tangent_parameter
            behind = problem.on(np.append(rate, 1.0), equilibrium(touch))
            inward = 1.0 if edge == behind.base.parameter_range[0] else -1.0
            w = behind.root(edge) + inward * beside
            try:
                z = np.append(touch.x + (behind.parameter(w) - edge) * rate, w)
                start = self._within(self._resolved(behind.solved(z, points[-1].parameter, place=True)))
            except CorrectionError as error:
                failure = error
                continue
            start = start if start.tangent_x[-1] * inward > 0 else start.turned()
            following, end = self._piece(start, beside)
            if following:
                return [start, *following], end
        raise failure

    def _within(self, point: Point) -> Point:
        """The point, if the range asked for does not end before it.

        Raises
        ------
        CorrectionError
            If it does.
        """
        if not self.interval.contains(point.parameter):
            raise CorrectionError(Outcome.REACHED_EDGE, "(The curve leaves the range at first touch.)")
        return point

    # -- points made precise ------------------------------------------------------------------------------------------
    def _refine(self, points: list[Point], ends: tuple[End, End]) -> None:
        """Rows and special points from the points of the curve."""
        messages: list[str] = []
        self.points = points
        for k, point in enumerate(points):
            try:
                tell(0.6 + 0.4 * k / len(points), f"{len(self.special)} special points")
                row = self._special(k) or self._row(point)
            except INTERRUPTIONS as error:
                caught(error)
                with finishing():
                    row = self._row(point, precise=False)
            except CorrectionError as error:
                where = f"{self.family.name} = {self._value(point.parameter):.6g}"
                messages.append(f"The point at {where} ({point.label}) could not be made precise. {error.detail}")
                row = self._row(point)
            self.rows.append(row)
        self.complete = not messages
        for k, end in zip((0, len(points) - 1), ends, strict=True):
            kind, message = self._ending(points[k], end, len(points))
            self.complete &= end.outcome in ENDED or kind in ("infinite-separation", "table-end")
            messages.append(message)
            if kind:
                self.rows[k] = _as_special(self.rows[k], k, kind, message)
        if over():
            self.complete = False
        elif self.worst > self.accuracy:
            self.complete = False
            messages.append(f"An error estimate is {self.worst / self.accuracy:.3g} times the accuracy asked.")
        self.message = " ".join(dict.fromkeys(filter(None, messages)))

    @property
    def special(self) -> tuple[Special, ...]:
        """The special points, in order."""
        return tuple(row for row in self.rows if isinstance(row, Special))

    def _value(self, q: float) -> float:
        """Value of the parameter at a coordinate, exactly what was asked for at the ends."""
        return self.known.get(q, self.family.value(q))

    def _scaled(self, found: Found, at: Point, of_value: float = 0.0) -> FollowedPoint:
        """In the contact's units."""
        self.worst = max(self.worst, found.relative_error())
        scales = self.family.reduced(at.parameter)[1]
        error = {**measured(found.error, scales), self.family.name: of_value}
        return FollowedPoint(
            self.family.name, self._value(at.parameter), **measured(found.numbers, scales), error=error
        )

    def _row(self, point: Point, precise: bool = True) -> FollowedPoint:
        """The event at the parameter of a point of the curve, located there on discretisations made for it."""
        held = augmented(point).held(point)
        if self.condition.edge is not None:
            held = replace(held, parameter=self.condition.edge)
        event = self.condition.at(point.parameter)
        return self._scaled(refine(held, event, self.accuracy) if precise else by_defect(held), point)

    def _special(self, k: int) -> Special | None:
        """A point of codimension two made precise; None at other points."""
        point = self.points[k]
        label = point.label or ""
        if label not in self.meetings and label != "touch":
            return None
        problem = augmented(point)
        upright = problem.on(tangent_of(problem.held(point)))
        event = self.meetings.get(label) or Meeting(_to_touch, "touch")
        found = refine(settled(replace(point, problem=upright)), event, self.accuracy)
        if self.touching or label == "touch":
            found = replace(found, numbers=(*found.numbers[:2], 0.0, 0.0), error=(*found.error[:2], 0.0, 0.0))
        row = self._scaled(found, found.point, found.parameter_error * abs(self.family.rate(found.point.parameter)))
        return _as_special(row, k, *self._named(label, k), label if label in ("load", "displacement") else None)

    def _named(self, label: str, k: int) -> tuple[str, str]:
        """Kind and message of a special point."""
        fold = self.condition.folds
        if label == "cusp":
            return label, CUSP if fold else PAIR
        if label == "coincidence":
            return label, COINCIDENCE
        if label != "touch":
            return ("fold-through-touch", MEETING) if self.touching else ("coincidence", MET)
        if not fold:
            return "through-touch", AT_TOUCH
        return ("fold-through-touch", THROUGH) if self._passing(k) else ("cusp-at-touch", CORNER)

    def _passing(self, k: int) -> bool:
        """Whether the parameter goes on in the same sense at a point."""
        if k in (0, len(self.points) - 1):
            return True
        before, after = np.diff([point.parameter for point in self.points[k - 1 : k + 2]])
        return bool(before * after > 0)

    def _ending(self, last: Point, end: End, count: int) -> tuple[str, str]:
        """The kind of special point that an end is, if any, and a sentence."""
        if last.observables and self._negligible(last):
            return "infinite-separation", "The event leaves to infinite separation."
        if end.outcome in ENDED:
            if self.family.spacing == "angle" and last.parameter in (0.0, 0.5 * math.pi):
                kind = "load-fold" if last.parameter == 0.0 else "displacement-fold"
                return kind, f"The fold of the spring has become a {kind.replace('-', ' ')}."
            if end.outcome is Outcome.REACHED_EDGE and last.parameter == self.q and count > 1:
                return "", f"The curve turns and comes back to the present {self.family.name}."
            return "", ""
        if end.outcome is Outcome.STOPPED_AT_EVENT:
            if last.label == "table-end":
                return last.label, UNDESCRIBED
            held = augmented(last).held(last)
            return "inadmissible", equilibrium(held).ending(last.label or "", held)
        return "", "" if end.outcome is Outcome.INTERRUPTED else end.message

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


def _as_special(row: FollowedPoint, index: int, kind: str, message: str, control: str | None = None) -> Special:
    """A row of the curve as a special point."""
    return Special(**{**vars(row), "kind": kind, "index": index, "control": control, "message": message})


def _between(begin: Point, end: Point, q: float) -> Point:
    """The point of the curve at a coordinate between two neighbouring points.

    Raises
    ------
    CorrectionError
        If it is not found.
    """
    if augmented(begin).base.parameter_range == augmented(end).base.parameter_range:
        end = settled(moved(end, augmented(begin)))
        return replace(land(Segment(begin, end, augmented(begin).metric(begin.x)), q, STEPS), parameter=q)
    # First touch belongs to one of its sides only; the curve is that of the other.
    touch, own = (begin, end) if begin.label == "touch" else (end, begin)
    problem, there = augmented(own), augmented(touch)
    x, p = there.split(touch.x)
    z = problem.joined(there.base.carried(x, x, p, problem.base), p)
    share = (q - touch.parameter) / (own.parameter - touch.parameter)
    return problem.solved(z + share * (own.x - z), q)
