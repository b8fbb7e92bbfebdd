"""The whole curve of a contact: one problem after the other, from its start to a load in contact."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace

import numpy as np

from contbranch.continuation import CorrectionError, EventPoint, Outcome, Point, StopAt
from contbranch.continuation.edge import Range
from contbranch.continuation.follow import Branch, follow
from contbranch.continuation.problem import UnresolvedError
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.angle import AMBIGUOUS, Turning, alpha, short_way
from contbranch.curve.events import NEGATIVE, Ceiling, Folds, Margin, Slopes
from contbranch.curve.problem import EquilibriumProblem, Succession, equilibrium
from contbranch.curve.spacing import Spacing
from contbranch.curve.tolerances import of_rows
from contbranch.curve.track import Mark, Track
from contbranch.errors import InputError, ModelError
from contbranch.watch import blame, finishing, kept, over, tell

__all__ = ["Request", "follow_from", "trace"]

# A trace ends at this multiple of the largest load of any event, and not below the least load (reduced).
END_FACTOR, LEAST_END = 1.4, 10.0
# Changes of the problem after which a trace gives up.
PIECES = 80
# Share of the first step that is taken where that leads to the end of the curve at once.
SHORTER = 1e-3
EDGE = "edge"
# The margin where the contact has grown to the edge of the tip, where its description ends.
TIP_EDGE = "tip-edge"


@dataclass(frozen=True)
class Request:
    """What is asked of a curve, reduced units.

    Attributes
    ----------
    accuracy : float
        Error allowed to every event, relative to max(1, |value|).
    control : Control
        A spring, whose folds are located besides those of load and displacement.
    target : float or None
        Where the curve ends, in contact: a value of `held`; None: by the events.
    held : Control or None
        None: the contact radius.
    modes : int
        Largest azimuthal mode number examined; 0: none.
    events : bool
        Whether events are made precise; without, the result has none.
    fine : bool
        Whether rows are to be as accurate as the events, as far as round-off allows.
    """

    accuracy: float
    control: Control = LOAD
    target: float | None = None
    held: Control | None = LOAD
    modes: int = 32
    events: bool = True
    fine: bool = False

    @property
    def controls(self) -> tuple[Control, ...]:
        """The controls whose folds are located."""
        return (LOAD, DISPLACEMENT, *((self.control,) if self.control.kind == "spring" else ()))


def trace(problem: EquilibriumProblem, request: Request) -> Track:
    """Follow the curve of a contact from the start of its first problem through all that succeed it."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # answered by shorter steps, or reported
        try:
            if request.fine:
                problem = problem.rows_within(of_rows(request.accuracy))
            start = problem.start(request.control)
        except InputError:
            raise
        except CorrectionError as error:
            blame(error.__cause__)
            return _nothing(problem, request, f"{Outcome.START_FAILED.value} {error.detail}")
        except Exception as error:  # a law written by the user may raise anything; its text is kept
            blame(error)
            message = f"The interaction cannot be evaluated far away: {type(error).__name__}: {error}"
            return _nothing(problem, request, message)
        asked = request.held is LOAD and request.target is not None
        if asked and start.observables["load"] >= _Tracing(request).end.target:
            return replace(_nothing(problem, request, "The curve begins at a larger load."), points=(start,))
        return follow_from(start, request, problem)


def follow_from(start: Point, request: Request, problem: EquilibriumProblem | None = None) -> Track:
    """Follow a curve from one of its points, in the sense of its tangent, through all problems that succeed its own."""
    begins = "table-end" if problem and math.isfinite(problem.described_to) else None
    tracing, problem = _Tracing(request, begins), problem or equilibrium(start)
    kept(lambda: tracing.follow(start), None)
    if request.events and not over():  # otherwise nothing but single states is wanted of the curve
        kept(tracing.fill, None)
    with finishing():
        tracing.cut()
        return tracing.track(problem) if tracing.points else _nothing(problem, request, tracing.message)


def _nothing(problem: EquilibriumProblem, request: Request, message: str) -> Track:
    """A curve that could not be begun."""
    controls = request.controls
    return Track((), {}, frozenset(), (), controls, complete=False, message=message.strip(), work=problem.work)


@dataclass
class _Tracing:
    """A curve while it is followed: rows so far, and how the problems join."""

    request: Request
    begins: str | None = None
    points: list[Point] = field(default_factory=list)
    onward: dict[int, Point] = field(default_factory=dict)
    gaps: set[int] = field(default_factory=set)
    marks: list[Mark] = field(default_factory=list)
    largest: float = -math.inf
    complete: bool = False
    message: str = ""
    lost: bool = False
    slopes: Slopes = field(default_factory=Slopes)

    def __post_init__(self) -> None:
        asked, held = self.request.target, self.request.held
        target = LEAST_END if asked is None else held.target(asked) if held is not None else asked
        self.end = Ceiling(held, target)

    def follow(self, start: Point) -> None:
        """Follow the curve from a point to its end."""
        self.points.append(start)
        if self.request.target is None:
            self.end.target = max(LEAST_END, END_FACTOR * start.observables["load"])
        if self.begins:
            self.marks.append(Mark(0, "end", start, margin=EDGE, name=self.begins))
        joint = Succession("", start, (start,))
        for _ in range(PIECES):
            following = self._piece(joint)
            if following is None:
                return
            joint = following
        self.message = "The contact set changes without end."

    def _piece(self, joint: Succession) -> Succession | None:
        """Follow one problem; return what succeeds it, or None at the end of the curve."""
        first = len(self.points)
        branch = self._leaving(joint)
        if branch.start is not None:
            (self.onward if first - 1 in self.onward else self.points)[first - 1] = branch.start
        start = self.onward.get(first - 1, self.points[-1])
        self.points += branch.points
        controls = {control.kind: control for control in self.request.controls}
        for event, index in branch.events:
            if isinstance(event, EventPoint) and event.name in controls:
                self.marks.append(Mark(first + index, "fold", event.point, controls[event.name]))
        last = branch.points[-1] if branch.points else start
        problem, name = equilibrium(last), _stopped(branch)
        if name == self.end.name:
            self.complete = True
            self.message = message = problem.ending(name, last)
            self.marks.append(Mark(len(self.points) - 1, "end", last, message=message))
            return None
        if over():
            return None
        if not name:
            blame(branch.end.cause)
            self.message = f"{branch.end.message} {problem.ending('', last)}".strip()
            self.lost = branch.end.outcome is Outcome.STEP_TOO_SMALL or isinstance(branch.end.cause, UnresolvedError)
            return None
        margin, name = name, problem.cause(name, last)
        try:
            found = problem.successor(name, [start, *branch.points])
        except (ModelError, CorrectionError) as error:
            why = f"{problem.ending(name, last)} It could not be followed beyond: {error}."
            self._stop(margin, name, why.strip())
            self.lost = True
            return None
        if found is None:
            self._stop(margin, name, problem.ending(name, last))
            return None
        self._join(found, margin)
        return found

    def _leaving(self, joint: Succession) -> Branch:
        """The piece from the first start from which the curve leaves."""
        branch = None
        for start, share in ((start, share) for start in joint.tried() for share in (1.0, SHORTER)):
            if joint.same and len(self.points) > 1:
                self.onward[len(self.points) - 1] = start
            problem = equilibrium(start)
            controls = () if problem.convex else self.request.controls
            folds, stop = Folds(controls, self._met, self.slopes), StopAt(predicate=self._told)
            branch = problem.walked(start, folds, self.end, stop)
            if branch is None:
                margins = [Margin(name) for name in problem.margins(start.x, start.parameter)]
                interval = Range(*problem.parameter_range)
                balance = problem.balance(start, joint.step)
                start = problem.leaving(start, joint.step)
                leaving = replace(
                    start, tangent_x=share * start.tangent_x, tangent_parameter=share * start.tangent_parameter
                )
                branch = follow(leaving, balance, interval, problem.steps(start), [folds, *margins, self.end], stop)
            if len(branch.points) > 1 or (branch.points and _stopped(branch) not in ("", self.end.name)):
                break
        if branch is None:
            raise ModelError("a problem without a start")
        return branch

    def _join(self, found: Succession, margin: str) -> None:
        """Append the event at which one problem takes over from another."""
        if found.dropped:
            kept = len(self.points) - found.dropped
            self.marks = [mark for mark in self.marks if mark.row < kept]
            del self.points[kept:]
        self._append(found.event)
        row = len(self.points) - 1
        if found.kind:
            self.marks.append(Mark(row, found.kind, found.event, margin=found.margin or margin, message=found.message))
            self._met(found.event)
        if not found.same:
            self._append(found.starts[0])

    def _append(self, point: Point) -> None:
        """Append a row that the present problem's piece has not reached."""
        last = len(self.points) - 1
        if last >= 0 and not equilibrium(self.onward.get(last, self.points[last])).joins(equilibrium(point)):
            self.gaps.add(last)
        self.points.append(point)

    def _stop(self, margin: str, name: str, message: str) -> None:
        own = margin
        while len(self.points) > 1 and _margin(self.points[-1], margin) < -NEGATIVE:  # rows are states of contact
            self._forget(len(self.points) - 1)
            own = ""
        row, last = len(self.points) - 1, self.points[-1]
        if name == TIP_EDGE:
            load = last.observables["load"]  # contact may be out of reach, and larger loads with it
            self.complete = self.request.target is None or (self.end.control is LOAD and load >= self.end.target)
            if not self.complete:
                message += " What was asked lies beyond: ask for less, or describe the tip farther out."
            self.marks.append(Mark(row, "end", last, margin=own, message=message, name=name))
        elif margin != EDGE:
            self.marks.append(Mark(row, "inadmissible", last, margin=own))
        elif not message:
            message = "The curve leaves the range of its parameter before what was asked."
            message += " Ask for less, or, if it has turned back, for a hundredth of the accuracy."
        self.message = message

    def _met(self, point: Point) -> None:
        """Raise the end beyond the load of an event."""
        load, problem = point.observables["load"], equilibrium(point)
        self.largest = max(self.largest, load)
        if not problem.refinable and point.observables["contact_radius"] > 0.0 and self.request.held is LOAD:
            # No curve ends where the error of a fold leaves open whether it is beyond.
            error = abs(problem.defect(point).load)
            self.end.target = max(self.end.target, load + error) if math.isfinite(error) else self.end.target
        if self.request.target is None:
            self.end.target = max(self.end.target, END_FACTOR * self.largest)

    def _told(self, point: Point) -> bool:
        """Report progress, guessed from the load: most of the way is the approach."""
        load, radius = point.observables["load"], point.observables["contact_radius"]
        tell(min(0.1 + 0.8 * max(0.0, load) / max(self.end.target, 1.0), 0.9), f"load {load:.4g}, contact {radius:.4g}")
        return False

    # -- rows between, folds in corners, indices ---------------------------------------------------------------------
    def fill(self) -> None:
        """Compute the rows that are missing for lines between rows to show the curve."""
        spacing, marked = Spacing(self.points, self.slopes), {mark.row for mark in self.marks}
        missing = spacing.missing(self.onward, self.points, self.gaps, marked)
        place = np.arange(len(self.points)) + np.cumsum([0, *map(len, missing)])
        self.points = [
            row for point, behind in zip(self.points, [*missing, []], strict=True) for row in (point, *behind)
        ]
        self.onward = {int(place[row]): point for row, point in self.onward.items()}
        self.gaps = {int(place[row]) for row in self.gaps}
        self.marks = [replace(mark, row=int(place[mark.row])) for mark in self.marks]

    def cut(self) -> None:
        """Forget what lies behind the last row with finite numbers."""
        for row, point in enumerate(self.points):
            if not all(map(math.isfinite, (*self.slopes(point), *point.observables.values()))):
                self.complete, self.message = False, f"From row {row} on numbers are not finite. {self.message}".strip()
                self._forget(row)
                return

    def _forget(self, row: int) -> None:
        """Forget a row and all behind it."""
        self.marks = [mark for mark in self.marks if mark.row < row]
        self.onward = {key: value for key, value in self.onward.items() if key < row}
        self.gaps = {key for key in self.gaps if key < row - 1}
        del self.points[row:]

    def _turn_back(self, row: int) -> None:
        """Forget what lies behind a row at which the curve has turned back on itself.

        The row, too, since its tangent is that of the way back; of one where a problem takes over, the start alone.
        """
        self._forget(row + 1 if row in self.onward else max(row, 1))
        self.onward.pop(row, None)
        self.marks = [mark for mark in self.marks if mark.row < row or mark.kind != "fold"]
        self.complete, self.lost = False, True
        self.message = f"{Outcome.TURNED_BACK.value} {equilibrium(self.points[-1]).ending('', self.points[-1])}"

    def track(self, problem: EquilibriumProblem) -> Track:
        """The curve with its hodograph, and with the folds that lie in corners."""
        marks = sorted(self.marks, key=lambda mark: mark.row)
        folds = {}
        for mark in marks:
            if mark.control is not None:
                folds[mark.row] = mark.control
        start = self.points[0]
        index = equilibrium(start).unstable(start.x, start.parameter)
        turning = Turning(self.request.controls, *self._rates(start))
        extra: list[Mark] = []
        for row in range(1, len(self.points)):
            point = self.points[row]
            if row in folds:
                if self._reversed(turning, folds, row, index):
                    here, there = row, row + 1
                    self.points[here], self.points[there] = self.points[there], self.points[here]
                    folds[here], folds[there] = folds[there], folds[here]
                    swap = {here: there, there: here}
                    marks = [replace(mark, row=swap.get(mark.row, mark.row)) for mark in marks]
                turning.fold(folds[row])
            else:
                missed = turning.row(*self._rates(point))
                extra += [Mark(row, "fold", point, control) for control in missed]
            if row in self.onward:
                extra += self._corner(turning, row)
        # At one row the event that makes the corner comes first.
        marks = sorted([*marks, *extra], key=lambda mark: mark.row)
        hodograph = turning.hodograph(index)
        pieces = hodograph.pieces(DISPLACEMENT)[0]
        if len(pieces) and pieces[-1] < 0:  # the curve only seems to go on behind a fold
            self._turn_back(int(np.argmax(pieces < 0)))
            return self.track(problem)
        return Track(
            tuple(self.points),
            self.onward,
            frozenset(self.gaps),
            tuple(marks),
            self.request.controls,
            hodograph,
            self.complete,
            self.message,
            problem.work,
            self.lost,
        )

    def _rates(self, point: Point) -> tuple[float, float]:
        """Rates of load and displacement: where none is unstable both grow, whatever rounding makes of them."""
        load, displacement = self.slopes(point)
        return (abs(load), abs(displacement)) if equilibrium(point).convex else (load, displacement)

    def _reversed(self, turning: Turning, folds: Mapping[int, Control], row: int, index: int) -> bool:
        """Whether two folds of different controls between two rows come in the other order than their places say.

        Where load and displacement rest together rounding decides the places. The curve turns by half a turn one way or
        the other, and the Morse index behind both folds, by inertia, tells which if they differ by less than errors.
        """
        both, behind = (folds[row], folds.get(row + 1, folds[row])), row + 2
        joints = {row, row + 1, behind} & {*self.onward, *folds}
        if both[0] == both[1] or behind >= len(self.points) or joints != {row, row + 1}:
            return False
        pair, after, counted = self.points[row:behind], self.points[behind], []
        first, last = (np.array([point.observables[name] for name in ("load", "displacement")]) for point in pair)
        if (np.abs(first - last) > sum(np.abs(equilibrium(point).defect(point)[:2]) for point in pair)).any():
            return False
        for order in (both, both[::-1]):
            trial = deepcopy(turning)
            for control in order:
                trial.fold(control)
            trial.row(*self.slopes(after))
            counted.append(int(trial.hodograph(index).pieces(DISPLACEMENT)[0][-1]))
        return counted[0] != equilibrium(after).unstable(after.x, after.parameter) == counted[1]

    def _corner(self, turning: Turning, row: int) -> list[Mark]:
        """The folds in the corner where one problem takes over from another."""
        ahead = self.onward[row]
        load, displacement = self._rates(ahead)
        turn = short_way(math.atan2(load, displacement) - turning.direction)
        if abs(turn) > AMBIGUOUS * math.pi:
            behind = self.points[row - 1]
            before, after = (equilibrium(p).unstable(p.x, p.parameter) for p in (behind, ahead))
            ways = turn, turn - math.copysign(2 * math.pi, turn)
            turn = next((way for way in ways if _raised(turning.direction, way) == after - before), turn)
        passed = turning.corner(turn)
        # What rests exactly at a joint, and goes the other way behind it, has its fold there, too.
        for point in self.points[row + 1 : row + 2]:
            passed += turning.rested(math.atan2(*self._rates(point)))
        return [Mark(row, "fold", replace(self.points[row]), control) for control in passed]


def _raised(begin: float, turn: float) -> int:
    """By how much a turn raises the Morse index under displacement control."""
    first, last = (math.floor((angle - alpha(DISPLACEMENT)) / math.pi) for angle in (begin, begin + turn))
    return first - last


def _margin(point: Point, name: str) -> float:
    """A margin of a point; 0 where its problem has none of that name."""
    return equilibrium(point).margins(point.x, point.parameter).get(name, 0.0)


def _stopped(branch: Branch) -> str:
    """The margin, edge or end at which a piece stopped; empty if it could not be followed."""
    if branch.end.outcome is Outcome.STOPPED_AT_EVENT:
        event = branch.events[-1][0]
        return event.name if isinstance(event, EventPoint) else ""
    return EDGE if branch.end.outcome is Outcome.REACHED_EDGE else ""
