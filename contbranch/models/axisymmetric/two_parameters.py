"""An event of the axisymmetric model followed in a second parameter, through first touch and past cusps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contbranch.contact.family import Family
from contbranch.continuation import CorrectionError, Curve, Event, Options, Outcome, Point, StopAt, trace_curve
from contbranch.continuation.edge import land
from contbranch.continuation.segment import Segment
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.errors import InputError, ModelError
from contbranch.models.event_curve import Four, RawEventCurve, RawPoint, RawSpecial

from .conditions import Condition, EventCondition, FoldCondition, Surface, TouchCondition
from .event_problem import EventProblem
from .locate import REMESHES, Place, refine
from .located import TRACE_TOLERANCE
from .meetings import MESSAGES, SPECIAL, Inadmissible, Meeting, Touch, Turn
from .problem import FoldEvent, Resolution
from .special import LENGTHS, TANGENT_NOISE, at_place, event_problem, precise
from .trace import START_SHARE, order_for

__all__ = ["follow_event"]

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

STEPS = Options(
    angle=0.3,
    angle_limit=0.8,
    tolerance=1e-9,
    noise=1e5,
    first_step=0.02,
    detect_folds=False,
    detect_branch_points=False,
    maximum_points=600,
)
# Beside first touch a curve starts at this contact coordinate (or smaller ones), and one that comes to half of it has
# come to first touch.
BESIDE = (0.06, 0.02, 0.006, 0.002)
# A curve passes first touch no more often than this.
PASSAGES = 8
# Error of loads along the curve where it may lead far away, and the energy of the interaction, in multiples of it, up
# to which it is followed there.
FAR_TOLERANCE, RESOLVED = 1e-9, 10.0


@dataclass(frozen=True)
class _Part:
    """Points in order, and how the curve goes on after the last: at first touch, or not."""

    points: list[Point]
    outcome: Outcome
    detail: str


def follow_event(
    family: Family, place: Place, what: Control | Event | None, to: tuple[float, ...], accuracy: float,
    progress: Progress | None = None,
) -> RawEventCurve:  # fmt: skip
    """Follow an event to the values `to` of the family's parameter.

    Parameters
    ----------
    place : Place
        The event at the start of the family, in reduced units.
    what : Control, Event or None
        The control (reduced units) whose fold it is, another event of the curves of equilibria, or first touch.
    to : tuple of float
        One value, or one on each side of the start.
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units.
    """
    return _Following(family, place, what, to, accuracy, progress).result()


class _Following:
    """One event on its way."""

    def __init__(
        self, family: Family, place: Place, what: Control | Event | None, to: tuple[float, ...], accuracy: float,
        progress: Progress | None,
    ) -> None:  # fmt: skip
        self.family, self.accuracy, self.progress = family, accuracy, progress
        self.touch, self.fold = what is None, isinstance(what, Control)
        self.event = what if isinstance(what, Event) else None
        # The stiffness of a weak spring is that of the interaction far away, where loads are small.
        tolerance = FAR_TOLERANCE if family.spacing == "angle" else TRACE_TOLERANCE / 3
        self.resolution = Resolution(tolerance, order_for(tolerance))
        self.condition: Condition = TouchCondition()
        if isinstance(what, Control):
            self.condition = FoldCondition(family, what)
        elif what is not None:
            self.condition = EventCondition(what)
        problem = place.problem
        size = math.sqrt(problem.inner(place.x, place.x)) or problem.scale
        surface = Surface(family, problem.scale, problem.equations.coordinate.power, self.resolution, size)
        self.surface = surface
        self.q = family.coordinate(family.start)
        contact = problem.equations.contact and not self.touch
        self.start, self.x = self._starting(place, contact, problem.sharpness)
        self.begin = 0
        self.goals = {family.coordinate(value): value for value in to}
        ends = [self.q, *self.goals]
        self.interval = (min(ends), max(ends))
        if not self.interval[0] < self.interval[1]:
            raise InputError(f"to: {to[0]:g}; is the present value of {family.name}, give another one")
        self.reach = max(START_SHARE * accuracy / (2 * math.pi), RESOLVED * tolerance)

    def _starting(self, place: Place, contact: bool, sharpness: float) -> tuple[EventProblem, Array]:
        """The augmented system and its state at the start, on a mesh as fine as the curve needs."""
        member = self.surface.problem(self.q, place.problem.equations.mesh, contact, sharpness)
        x, u, v = place.x, place.u, place.direction
        for _ in range(REMESHES):  # the event may come from a trace for fewer digits
            if member.relative_error(member.fields(x, u)) <= self.resolution.tolerance:
                break
            old, (member, x) = member.equations.mesh, member.remeshed(x, u)
            v = (old.interpolate(v[0], member.equations.mesh.nodes), v[1])
        direction = member.direction(x, u) if self.touch else v
        start = EventProblem(self.surface, member.equations.mesh, contact, self.condition, direction, member.sharpness)
        return start, start.joined(x, u)

    # -- the curve ----------------------------------------------------------------------------------------------------
    def result(self) -> RawEventCurve:
        """The curve with its points and special points made precise."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            beside = min(BESIDE[0], abs(float(self.x[-1])))
            curve = self._traced(self.start, self.x, self.q, beside)
            if not curve.points:
                raise ModelError(f"follow: the event was not found again at its start. {curve.message}")
            count = len(curve.points)
            backward = self._ongoing(_Part([p.turned() for p in reversed(curve.points)], *_end(curve, 0)))
            forward = self._ongoing(_Part(list(curve.points), *_end(curve, 1)))
            own = forward.points[:count]
            own[0] = backward.points[count - 1].turned() if count > 1 else own[0]
            behind = [p.turned() for p in reversed(backward.points[count:])]
            self.begin = len(behind) + next(k for k, point in enumerate(own) if point.label == "start")
            points = behind + own + forward.points[count:]
            return self._assembled(points, (backward, forward))

    def _traced(self, problem: EventProblem, x: Array, q: float, beside: float) -> Curve:
        events: list[Event] = [Turn(), Inadmissible()]
        if self.fold:
            events.append(Meeting("coincidence", self._crossed))
        else:
            events += [Meeting("load", lambda _: LOAD.weights), Meeting("displacement", lambda _: DISPLACEMENT.weights)]
        if not self.touch:
            events.append(Touch(beside))
        stop = StopAt(predicate=self._far)
        low, high = self.interval
        return trace_curve(problem, x, min(max(q, low), high), self.interval, STEPS, events, stop)

    def _crossed(self, q: float) -> tuple[float, float]:
        """Weights of the control at a right angle to the event's own."""
        first, second = self.condition.weights(q)
        return -second, first

    def _far(self, point: Point) -> bool:
        """Whether the interaction is negligible at the accuracy asked for."""
        if self.progress is not None:
            low, high = self.interval
            share = abs(point.parameter - self.q) / (high - low)
            self.progress(0.6 * share, f"{self.family.name} {self.family.value(point.parameter):.4g}")
        problem = event_problem(point)
        if problem.contact or self.touch:
            return False
        member = problem.member(point.parameter)
        law = member.equations.interaction
        return law is not None and -member.coordinate(float(point.x[-1])) > law.reach(self.reach)

    def _ongoing(self, part: _Part) -> _Part:
        """A part continued on the other side of first touch, and on its own again, as often as it comes there."""
        points, outcome, detail = list(part.points), part.outcome, part.detail
        for _ in range(PASSAGES):
            if outcome is not Outcome.STOPPED_AT_EVENT or points[-1].label != "touch":
                break
            try:
                inside = event_problem(points[-1]).contact
                if inside:
                    points[-1] = replace(points[-1], label="")
                    points.append(self._touching(points[-1]))
                beyond = self._beyond(points[-1], not inside)
            except CorrectionError as error:
                return _Part(points, error.outcome, f"(Beyond first touch: {error.detail})")
            points += beyond.points
            outcome, detail = beyond.outcome, beyond.detail
        return _Part(points, outcome, detail)

    def _touching(self, point: Point) -> Point:
        """First touch itself, without contact, from a point with a tiny one."""
        problem = event_problem(point)
        h, _ = problem.split(point.x)
        member = self.surface.problem(point.parameter, problem.mesh, False)
        h = member.solve_at(h, 0.0)
        other = problem.other_side(False, member.direction(h, 0.0))
        return replace(at_place(other, np.append(h, 0.0), point.parameter, 0.0), label="touch")

    def _beyond(self, touch: Point, contact: bool) -> _Part:
        """The curve on one side of first touch, from there on."""
        failure = CorrectionError(Outcome.STEP_TOO_SMALL, "(The curve was not found there.)")
        for graded in (False, True) if contact else (False,):
            problem, x = event_problem(touch), touch.x
            if graded:  # a stiff film answers a tiny contact on a length far below the innermost panel
                without = self.surface.problem(touch.parameter, problem.mesh, False)
                finer, h = without.graded(x[:-1])
                problem, x = problem.on(finer.equations.mesh, finer.direction(h, 0.0)), np.append(h, 0.0)
            member = self.surface.problem(touch.parameter, problem.mesh, contact)
            rate = member.direction(x[:-1], 0.0)[0]
            other = problem.other_side(contact, (rate, 1.0))
            for beside in BESIDE:
                w = beside if contact else -beside
                u = beside**other.power if contact else w
                try:
                    start = at_place(other, np.append(x[:-1] + u * rate, w), touch.parameter, w)
                except CorrectionError as error:
                    failure = error
                    continue
                low, high = self.interval
                if not low <= start.parameter <= high:
                    failure = CorrectionError(Outcome.REACHED_EDGE, "(The curve leaves the range at first touch.)")
                    continue
                part = self._away(self._traced(other, start.x, start.parameter, beside))
                if part is not None:
                    return part
        raise failure

    def _away(self, curve: Curve) -> _Part | None:
        """The curve away from the touch near which it was started."""
        if len(curve.points) < 2:
            return None
        begin = next(i for i, point in enumerate(curve.points) if point.label == "start")
        touching = [
            which
            for which in (0, 1)
            if curve.ends[which].outcome is Outcome.STOPPED_AT_EVENT and curve.points[-which].label == "touch"
        ]
        if not touching:
            return None
        which = min(touching, key=lambda k: begin if k == 0 else len(curve.points) - 1 - begin)
        if which == 0:
            return _Part(list(curve.points[1:]), *_end(curve, 1))
        return _Part([point.turned() for point in reversed(curve.points[:-1])], *_end(curve, 0))

    # -- points made precise ------------------------------------------------------------------------------------------
    def _assembled(self, points: list[Point], parts: tuple[_Part, _Part]) -> RawEventCurve:
        rows: list[RawPoint] = []
        special: list[RawSpecial] = []
        messages: list[str] = []
        for k, point in enumerate(points):
            if self.progress is not None:
                self.progress(0.6 + 0.4 * k / len(points), f"{len(special)} special points")
            found = self._special(points, k) if point.label in SPECIAL else None
            if isinstance(found, str):
                messages.append(found)
            elif found is not None:
                special.append(found)
                rows.append(found.point)
                continue
            rows.append(self.row(point))
        complete = not messages
        for part, index in zip(parts, (0, len(points) - 1), strict=True):
            ended, message, kind = self._ending(part)
            complete &= ended
            if message:
                messages.append(message)
            if kind is not None:
                special.append(RawSpecial(kind, index, rows[index], 0.0, message=message))
        worst = max(_relative(row, self._units(point)) for row, point in zip(rows, points, strict=True))
        if worst > self.accuracy:
            complete = False
            messages.append(f"An error estimate is {worst / self.accuracy:.3g} times the accuracy asked.")
        special.sort(key=lambda one: one.index)
        self.points, self.rows = points, rows
        return RawEventCurve(
            tuple(rows),
            tuple(special),
            self.at,
            complete,
            " ".join(dict.fromkeys(messages)),
            self.resolution.newton,
            self.resolution.unknowns,
            self.begin,
        )

    def _units(self, point: Point) -> Four:
        scales = self.family.reduced(point.parameter)[2]
        return scales.load, scales.normal, scales.in_plane, scales.normal

    def _value(self, q: float) -> float:
        """Value of the parameter at a coordinate, exactly what was asked for at the ends."""
        return self.goals.get(q, self.family.start if q == self.q else self.family.value(q))

    def _raw(self, point: Point, values: Four, error: Four) -> RawPoint:
        units = self._units(point)
        scaled = [v * s for v, s in zip(values, units, strict=True)]
        errors = [float(e) * s for e, s in zip(error, units, strict=True)]
        return RawPoint(
            self._value(point.parameter),
            (scaled[0], scaled[1], scaled[2], scaled[3]),
            (errors[0], errors[1], errors[2], errors[3]),
        )

    def row(self, point: Point) -> RawPoint:
        """The event at the parameter of a point of the curve, located there on meshes made for it."""
        problem = event_problem(point)
        h, u = problem.split(point.x)
        u = 0.0 if self.touch else u
        member = problem.member(point.parameter)
        control = self.condition.control(point.parameter)
        event = self.event if control is None else FoldEvent(control, name=control.kind)
        place = Place(member, h, u, problem.on_sheet(point.x, point.parameter).tangent)
        values, _ = refine(place, event, self.accuracy)
        return self._raw(point, values.numbers, values.error)

    def _special(self, points: list[Point], k: int) -> RawSpecial | str:
        """A special point made precise, or a sentence that says why it could not be."""
        point = points[k]
        kind, control, message, value, noise = self._kind(points, k)
        try:
            found = precise(point, value, self.accuracy, noise)
        except CorrectionError as error:
            where = f"{self.family.name} = {self._value(point.parameter):.6g}"
            return f"The point at {where} ({kind}) could not be made precise. {error.detail}"
        rate = abs(self.family.rate(found.q))
        values, uncertain = found.numbers, found.error
        if self.touch or point.label == "touch":
            values, uncertain = (*values[:2], 0.0, 0.0), (*uncertain[:2], 0.0, 0.0)
        row = self._raw(found.point, values, uncertain)
        return RawSpecial(kind, k, row, found.q_error * rate, control, message)

    def _kind(self, points: list[Point], k: int) -> tuple[str, str | None, str, Callable[[Point], float], float]:
        """Name, control and message of a special point, the function that vanishes there, and its noise."""
        point = points[k]
        if point.label == "cusp":
            message = MESSAGES["cusp" if self.fold else "pair"]
            return "cusp", None, message, Turn().value, TANGENT_NOISE
        if point.label == "coincidence":
            return "coincidence", None, MESSAGES["coincidence"], Meeting("", self._crossed).value, 0.0
        if point.label in ("load", "displacement"):
            weights = (LOAD if point.label == "load" else DISPLACEMENT).weights
            meeting = Meeting(point.label, lambda _: weights)
            if self.touch:
                return "fold-through-touch", point.label, MESSAGES["meeting"], meeting.value, 0.0
            return "coincidence", point.label, MESSAGES["met"], meeting.value, 0.0
        before, after = points[max(k - 1, 0)].parameter, points[min(k + 1, len(points) - 1)].parameter
        through = (point.parameter - before) * (after - point.parameter) > 0 or not self.fold
        kind = "fold-through-touch" if through or k in (0, len(points) - 1) else "cusp-at-touch"
        message = MESSAGES[kind] if self.fold else "The event lies exactly at first touch."
        return kind if self.fold else "through-touch", None, message, lambda there: float(there.x[-1]), 0.0

    def _ending(self, part: _Part) -> tuple[bool, str, str | None]:
        """Whether an end is one that was to be expected, a sentence, and the kind of special point that it is."""
        last = part.points[-1]
        name = self.family.name
        if part.outcome is Outcome.STOPPED_BY_PREDICATE:
            return True, "The event leaves to infinite separation.", "infinite-separation"
        if part.outcome in (Outcome.REACHED_EDGE, Outcome.STARTED_ON_EDGE):
            if self.family.spacing == "angle" and last.parameter in (0.0, 0.5 * math.pi):
                kind = "load-fold" if last.parameter == 0.0 else "displacement-fold"
                return True, f"The fold of the spring has become a {kind.replace('-', ' ')}.", kind
            if part.outcome is Outcome.REACHED_EDGE and last.parameter == self.q and len(part.points) > 1:
                return True, f"The curve turns and comes back to the present {name}.", None
            return True, "", None
        if last.label == "inadmissible":
            return False, "The contact set stops being a disc.", "inadmissible"
        return False, f"{part.outcome.value} {part.detail}".strip(), None

    # -- single values ------------------------------------------------------------------------------------------------
    def at(self, value: float) -> list[RawPoint]:
        """The event at exactly one value of the parameter, as often as the curve passes it."""
        q = self.family.coordinate(value)
        found: list[RawPoint] = []
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for k, (point, row) in enumerate(zip(self.points, self.rows, strict=True)):
                if row.value == value or point.parameter == q:
                    found.append(row)
                elif k and (self.points[k - 1].parameter - q) * (point.parameter - q) < 0:
                    found.append(self.row(self._between(self.points[k - 1], point, q)))
        return found

    def _between(self, begin: Point, end: Point, q: float) -> Point:
        """The point of the curve at a coordinate between two neighbouring points.

        Raises
        ------
        ModelError
            If it is not found.
        """
        try:
            if event_problem(begin).contact != event_problem(end).contact:
                # First touch belongs to the side without contact; carry it to the other.
                if event_problem(begin).contact:
                    end = self._inward(end, event_problem(begin))
                else:
                    begin = self._inward(begin, event_problem(end))
            problem, other = event_problem(begin), event_problem(end)
            if other.mesh is not problem.mesh:
                carried = [other.carried(vector, problem.mesh) for vector in (end.x, end.tangent_x)]
                end = replace(end, x=carried[0], tangent_x=carried[1])
            segment = Segment(begin, replace(end, problem=problem), LENGTHS)
            return replace(land(segment, q, STEPS), parameter=q)
        except CorrectionError as error:
            raise ModelError(f"at: the event was not found at {self.family.value(q):.9g}. {error.detail}") from error

    def _inward(self, touch: Point, problem: EventProblem) -> Point:
        """First touch as a point of the side with contact."""
        x = event_problem(touch).carried(touch.x, problem.mesh)
        x[-1] = 0.0
        point = at_place(problem, x, touch.parameter, 0.0)
        same = LENGTHS.dot(
            problem,
            point.tangent_x,
            point.tangent_parameter,
            event_problem(touch).carried(touch.tangent_x, problem.mesh),
            touch.tangent_parameter,
        )
        return point if same >= 0 else point.turned()


def _end(curve: Curve, which: int) -> tuple[Outcome, str]:
    return curve.ends[which].outcome, curve.ends[which].detail


def _relative(row: RawPoint, units: Four) -> float:
    return max(e / max(s, abs(v)) for e, v, s in zip(row.error, row.numbers, units, strict=True))
