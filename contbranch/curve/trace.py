"""The whole curve of a contact: one problem after the other, from its start to a load in contact."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from contbranch.continuation import CorrectionError, End, EventPoint, Outcome, Point, StopAt
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
MOST_PROBLEMS = 80
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
        return tracing.track(problem) if tracing.rows else _nothing(problem, request, tracing.message)


def _nothing(problem: EquilibriumProblem, request: Request, message: str) -> Track:
    """A curve that could not be begun."""
    return Track(controls=request.controls, complete=False, message=message.strip(), work=problem.work)


@dataclass(eq=False)
class _Row:
    """A row while its curve is followed.

    Attributes
    ----------
    point : Point
    onward : Point or None
        The same equilibrium as the next problem has it.
    gap : bool
        Whether the piece behind the row joins problems that cannot be joined.
    marks : list of Mark
        What happens there; their rows are not yet numbered.
    """

    point: Point
    onward: Point | None = None
    gap: bool = False
    marks: list[Mark] = field(default_factory=list)

    @property
    def leaving(self) -> Point:
        """The row as the piece behind it has it."""
        return self.onward or self.point

    @property
    def fold(self) -> Control | None:
        """The control whose fold the row is."""
        return next((mark.control for mark in self.marks if mark.control is not None), None)

    def mark(self, kind: str, **what: Any) -> None:
        """Say what happens here."""
        self.marks.append(Mark(-1, kind, self.point, **what))


class _Tracing:
    """A curve while it is followed: rows so far, and how the problems join."""

    def __init__(self, request: Request, begins: str | None = None) -> None:
        self.request, self.begins, self.slopes = request, begins, Slopes()
        self.rows: list[_Row] = []
        self.largest, self.complete, self.message, self.lost = -math.inf, False, "", False
        asked, held = request.target, request.held
        target = LEAST_END if asked is None else held.target(asked) if held is not None else asked
        self.end = Ceiling(held, target)

    def follow(self, start: Point) -> None:
        """Follow the curve from a point to its end."""
        self.rows.append(_Row(start))
        if self.request.target is None:
            self.end.target = max(LEAST_END, END_FACTOR * start.observables["load"])
        if self.begins:
            self.rows[0].mark("end", name=self.begins)
        joint = Succession("", start, (start,))
        for _ in range(MOST_PROBLEMS):
            following = self._piece(joint)
            if following is None:
                return
            joint = following
        self.message = "The contact set changes without end."

    def _piece(self, joint: Succession) -> Succession | None:
        """Follow one problem; return what succeeds it, or None at the end of the curve."""
        begin, branch = self.rows[-1], self._leaving(joint)
        if branch.start is not None and begin.onward is not None:
            begin.onward = branch.start
        elif branch.start is not None:
            begin.point = branch.start
        rows = [_Row(point) for point in branch.points]
        controls = {control.kind: control for control in self.request.controls}
        for event, index in branch.events:
            if isinstance(event, EventPoint) and event.name in controls:
                rows[index].mark("fold", control=controls[event.name])
        self.rows += rows
        last = branch.points[-1] if rows else begin.leaving
        problem, name = equilibrium(last), _stopped(branch)
        if name == self.end.name:
            self.complete, self.message = True, problem.ending(name, last)
            self.rows[-1].mark("end", message=self.message)
            return None
        if over():
            return None
        if not name:
            blame(branch.end.cause)
            self.message = f"{branch.end.message} {problem.ending('', last)}".strip()
            self.lost = branch.end.outcome is Outcome.STEP_TOO_SMALL or isinstance(branch.end.cause, UnresolvedError)
            return None
        margin, name = "" if name == EDGE else name, problem.cause(name, last)
        why = problem.ending(name, last)
        try:
            found = problem.successor(name, [begin.leaving, *branch.points])
        except (ModelError, CorrectionError) as error:
            found, why, self.lost = None, f"{why} It could not be followed beyond: {error}.".strip(), True
        if found is None:
            self._stop(margin, name, why)
        else:
            self._join(found, margin)
        return found

    def _leaving(self, joint: Succession) -> Branch:
        """The piece from the first start from which the curve leaves; nothing without one."""
        branch = Branch([], [], End(Outcome.STEP_TOO_SMALL))
        for start in joint.tried():
            if joint.same and len(self.rows) > 1:
                self.rows[-1].onward = start
            branch = self._followed(start, joint.step)
            if len(branch.points) > 1 or (branch.points and _stopped(branch) not in ("", self.end.name)):
                break
        return branch

    def _followed(self, start: Point, step: float | None) -> Branch:
        """The piece from a start."""
        problem = equilibrium(start)
        folds = Folds(() if problem.convex else self.request.controls, self._raise_end, self.slopes)
        stop = StopAt(predicate=self._report_progress)
        balance, leaving = problem.balance(start, step), problem.leaving(start, step)
        margins = [Margin(name) for name in problem.margins(start.x, start.parameter)]
        interval, options = Range(*problem.parameter_range), problem.steps(leaving)
        return follow(leaving, balance, interval, options, [folds, *margins, self.end], stop)

    def _join(self, found: Succession, margin: str) -> None:
        """Append the event at which one problem takes over from another."""
        del self.rows[len(self.rows) - found.dropped :]
        self._append(found.event)
        if found.kind:
            self.rows[-1].mark(found.kind, margin=found.margin or margin, message=found.message)
            self._raise_end(found.event)
        if not found.same:
            self._append(found.starts[0])

    def _append(self, point: Point) -> None:
        """Append a row that the present problem's piece has not reached."""
        if self.rows:
            self.rows[-1].gap = not equilibrium(self.rows[-1].leaving).joins(equilibrium(point))
        self.rows.append(_Row(point))

    def _stop(self, margin: str, name: str, message: str) -> None:
        """The curve ends at its last row that is a state of contact."""
        own = margin
        while len(self.rows) > 1 and _margin(self.rows[-1].point, margin) < -NEGATIVE:
            self._forget(len(self.rows) - 1)
            own = ""
        last = self.rows[-1]
        if name == TIP_EDGE:
            load = last.point.observables["load"]  # contact may be out of reach, and larger loads with it
            self.complete = self.request.target is None or (self.end.control is LOAD and load >= self.end.target)
            if not self.complete:
                message += " What was asked lies beyond: ask for less, or describe the tip farther out."
            last.mark("end", margin=own, message=message, name=name)
        elif margin:
            last.mark("inadmissible", margin=own)
        elif not message:
            message = "The curve leaves the range of its parameter before what was asked."
            message += " Ask for less, or, if it has turned back, for a hundredth of the accuracy."
        self.message = message

    def _raise_end(self, point: Point) -> None:
        """Raise the end beyond the load of an event."""
        load, problem = point.observables["load"], equilibrium(point)
        self.largest = max(self.largest, load)
        if not problem.refinable and point.observables["contact_radius"] > 0.0 and self.request.held is LOAD:
            # No curve ends where the error of a fold leaves open whether it is beyond.
            error = abs(problem.defect(point).load)
            self.end.target = max(self.end.target, load + error) if math.isfinite(error) else self.end.target
        if self.request.target is None:
            self.end.target = max(self.end.target, END_FACTOR * self.largest)

    def _report_progress(self, point: Point) -> bool:
        """Report progress, guessed from the load: most of the way is the approach."""
        load, radius = point.observables["load"], point.observables["contact_radius"]
        tell(min(0.1 + 0.8 * max(0.0, load) / max(self.end.target, 1.0), 0.9), f"load {load:.4g}, contact {radius:.4g}")
        return False

    # -- rows between, folds in corners, indices ---------------------------------------------------------------------
    def fill(self) -> None:
        """Compute the rows that are missing for lines between rows to show the curve."""
        spacing = Spacing([row.point for row in self.rows], self.slopes)
        filled = self.rows[:1]
        for row, ahead in pairwise(self.rows):
            if not row.gap:
                apart = bool(row.marks and ahead.marks)
                filled += map(_Row, spacing.between(row.leaving, ahead.point, apart))
            filled.append(ahead)
        self.rows = filled

    def cut(self) -> None:
        """Forget what lies behind the last row with finite numbers."""
        for k, row in enumerate(self.rows):
            if not all(map(math.isfinite, (*self.slopes(row.point)[:2], *row.point.observables.values()))):
                self.complete, self.message = False, f"From row {k} on numbers are not finite. {self.message}".strip()
                self._forget(k)
                return

    def _forget(self, row: int) -> None:
        """Forget a row and all behind it."""
        del self.rows[row:]
        if self.rows:
            self.rows[-1].gap, self.rows[-1].onward = False, None

    def track(self, problem: EquilibriumProblem) -> Track:
        """The curve with its hodograph, and with the folds that lie in corners."""
        rows, start = self.rows, self.rows[0].point
        index = equilibrium(start).unstable(start.x, start.parameter)
        turning = Turning(self.request.controls, *self._rates(start))
        marks = [*rows[0].marks]
        for k in range(1, len(rows)):
            if rows[k].fold is not None and self._is_reversed(turning, k, index):
                rows[k : k + 2] = rows[k + 1], rows[k]
            row, fold = rows[k], rows[k].fold
            passed = turning.row(*self._rates(row.point)) if fold is None else turning.fold(fold)
            if row.onward is not None:
                passed += self._corner_folds(turning, k)
            own = [*row.marks, *(Mark(k, "fold", row.point, control) for control in passed)]
            marks += [replace(mark, row=k) for mark in own]
        hodograph = turning.hodograph(index)
        pieces = hodograph.pieces(DISPLACEMENT)[0]
        # There are no states of a negative index: behind a fold the curve has turned back on itself.
        if len(pieces) and pieces[-1] < 0:
            self._forget(max(int(np.argmax(pieces < 0)), 1))
            ending = equilibrium(rows[-1].point).ending("", rows[-1].point)
            self.complete, self.lost, self.message = False, True, f"{Outcome.TURNED_BACK.value} {ending}"
            return self.track(problem)
        return Track(
            tuple(row.point for row in rows),
            {k: row.onward for k, row in enumerate(rows) if row.onward is not None},
            frozenset(k for k, row in enumerate(rows) if row.gap),
            tuple(replace(mark, row=max(mark.row, 0)) for mark in marks),
            self.request.controls,
            hodograph,
            self.complete,
            self.message,
            problem.work,
            self.lost,
        )

    def _rates(self, point: Point) -> tuple[float, float]:
        """Rates of load and displacement: where none is unstable both grow, whatever rounding makes of them."""
        load, displacement = self.slopes(point)[:2]
        return (abs(load), abs(displacement)) if equilibrium(point).convex else (load, displacement)

    def _is_reversed(self, turning: Turning, row: int, index: int) -> bool:
        """Whether folds of different controls at a row and at the next come in the other order than their places say.

        Where load and displacement rest together rounding decides the places. The curve turns by half a turn one way or
        the other, and the Morse index behind both folds, by inertia, tells which.
        """
        near = self.rows[row : row + 3]
        if len(near) < 3 or any(one.onward is not None for one in near) or near[2].fold is not None:
            return False
        both, after = [one.fold for one in near[:2]], near[2].point
        if both[1] is None or both[0] == both[1]:
            return False
        counted = []
        for order in (both, both[::-1]):
            trial = deepcopy(turning)
            for control in filter(None, order):
                trial.fold(control)
            trial.row(*self.slopes(after)[:2])
            counted.append(int(trial.hodograph(index).pieces(DISPLACEMENT)[0][-1]))
        return counted[0] != equilibrium(after).unstable(after.x, after.parameter) == counted[1]

    def _corner_folds(self, turning: Turning, row: int) -> list[Control]:
        """The folds in the corner where one problem takes over from another."""
        behind, ahead = self.rows[row - 1].point, self.rows[row].leaving
        load, displacement = self._rates(ahead)
        turn = short_way(math.atan2(load, displacement) - turning.direction)
        if abs(turn) > AMBIGUOUS * math.pi:
            before, after = (equilibrium(p).unstable(p.x, p.parameter) for p in (behind, ahead))
            ways = turn, turn - math.copysign(2 * math.pi, turn)
            turn = next((way for way in ways if _raised(turning.direction, way) == after - before), turn)
        passed = turning.corner(turn)
        # What rests exactly at a joint, and goes the other way behind it, has its fold there, too.
        for other in self.rows[row + 1 : row + 2]:
            passed += turning.rested(math.atan2(*self._rates(other.point)))
        return passed


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
