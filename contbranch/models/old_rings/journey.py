"""Legs of one layout each, joined through the changes of the contact set to one curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from contbranch.continuation import CorrectionError, Event, Point, StopAt
from contbranch.continuation.curve import EventPoint
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.errors import ModelError

from .accuracy import ring_problem
from .changes import passed, seeded
from .constraints import least_margin
from .legs import FoldEvent, Narrow, Reached, Violation, follow_leg, located, thresholds
from .topology import Change, change

__all__ = ["Journey", "Mark", "Target"]

Progress = Callable[[float, str], None]

# A trace ends at this multiple of the largest load of any event, and not below the least load (reduced).
END_FACTOR, LEAST_END = 1.4, 10.0
# Changes of the contact set after which a trace gives up.
CHANGES = 60


@dataclass(frozen=True)
class Target:
    """Where a trace ends: at a value of what is controlled, or of the contact radius; without value, by the events.

    Attributes
    ----------
    value : float or None
        Value of ``control.weighted(load, displacement)``, or of the contact radius; reduced units.
    control : Control or None
        None: the contact radius.
    """

    value: float | None = None
    control: Control | None = LOAD


@dataclass(frozen=True)
class Mark:
    """A row at which something happens; for changes of the contact set with their name."""

    row: int
    name: str
    point: Point
    change: Change | None = None


@dataclass
class Journey:
    """Legs joined to one curve.

    Attributes
    ----------
    points : list of Point
        Rows; each keeps the problem that solved it.
    marks : list of Mark
    message : str
        Why the curve ends before its target; empty if it does not.
    """

    target: Target
    controls: Sequence[Control] = (LOAD, DISPLACEMENT)
    largest: float = 0.0
    progress: Progress | None = None
    points: list[Point] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    message: str = ""

    def __post_init__(self) -> None:
        value = self.target.value
        at = max(LEAST_END, END_FACTOR * self.largest) if value is None else value
        self.end = Reached(self.target.control, at)

    # -- one leg after the other --------------------------------------------------------------------------------------
    def run(self, start: Point, step: float) -> None:
        """Follow the curve from a point through all changes of the contact set to the target."""
        self.points.append(start)
        point = start
        for _ in range(CHANGES):
            try:
                following = self._leg(point, step)
            except (ModelError, CorrectionError) as error:
                self.message = f"The curve could not be followed through a change of the contact set: {error}."
                return
            if following is None:
                return
            point, step = following
        self.message = "The contact set changes without end."

    def _leg(self, point: Point, step: float) -> tuple[Point, float] | None:
        """Follow one layout; return where the next one begins, or None at the end."""
        problem = ring_problem(point)
        limits = thresholds(problem, point.x)
        events: list[Event] = [
            *(FoldEvent(control, control.kind) for control in self.controls),
            Violation(),
            Narrow(limits),
        ]
        if self.target.value is not None or any(
            region.rests and region.index == 0 for region in problem.layout.regions
        ):
            events.append(self.end)
        branch = follow_leg(point, events, StopAt(predicate=self._told), step)
        offset = len(self.points)
        kinds = {control.kind for control in self.controls}
        for event, index in branch.events:
            if isinstance(event, EventPoint) and event.name in kinds:
                self.marks.append(Mark(offset + index, event.name, event.point))
                self._raise_end(event.point)
        narrow = located(branch, "narrow")
        points = branch.points[:-1] if narrow is not None else branch.points
        self.points += points
        breached = located(branch, "breach")
        if breached is not None:
            return self._born(breached)
        if narrow is not None:
            return self._vanished(narrow, limits)
        if located(branch, "end") is not None:
            self.marks.append(Mark(len(self.points) - 1, "end", self.points[-1]))
            return None
        self.message = branch.end.message
        return None

    def _raise_end(self, point: Point) -> None:
        if self.target.value is None:
            self.largest = max(self.largest, point.observables["load"])
            self.end.target = max(self.end.target, END_FACTOR * self.largest)

    def _told(self, point: Point) -> bool:
        if self.progress is not None and len(self.points) % 5 == 0:
            share = point.observables["load"] / self.end.target if self.end.control is not None else 0.5
            self.progress(
                0.9 * min(max(share, 0.0), 1.0), f"{len(self.points)} points, load {point.observables['load']:.4g}"
            )
        return False

    def _mark_change(self, point: Point, growing: bool) -> None:
        problem = ring_problem(point)
        breach = least_margin(problem, problem.fields(point.x, point.parameter))
        if breach is None:
            raise ModelError("where the contact set changes its inequality could not be told")
        levels = problem.setting.law.levels
        found = change(problem.layout, breach.region, breach.radius, breach.new, levels, growing)
        self.marks.append(Mark(len(self.points) - 1, found.kind, point, found))
        self._raise_end(point)

    def _born(self, point: Point) -> tuple[Point, float]:
        """Pass into the layout with a new region."""
        problem = ring_problem(point)
        breach = least_margin(problem, problem.fields(point.x, point.parameter))
        if breach is None:
            raise ModelError("where the contact set changes its inequality could not be told")
        self._mark_change(point, True)
        born = seeded(point, breach)
        self.points.append(born)
        widths = ring_problem(born).widths(ring_problem(born).fields(born.x, born.parameter))
        return born, 0.3 * float(widths.min())

    def _vanished(self, point: Point, limits: tuple[float, ...]) -> tuple[Point, float]:
        """Pass into the layout without a region that has shrunk to nothing; the event lies where that layout begins to
        be right."""
        width = float(ring_problem(point).widths(ring_problem(point).fields(point.x, point.parameter)).min())
        joined, jump = passed(point, limits)
        if jump:  # no change of the contact set, only of how it is represented
            self.points.append(joined)
            return joined, 1e-2 * float(joined.x[-1])
        start = joined
        if Violation().value(joined) > 0:  # it has been right for a while: look back
            start = joined.turned()
        branch = follow_leg(start, [Violation()], StopAt(), 0.3 * width)
        found = located(branch, "breach")
        if found is None:
            raise ModelError(f"a region vanished, but not where its inequality says {branch.end.message}")
        if start is not joined:
            found, following = found.turned(), joined
        else:
            onward = follow_leg(found, [], StopAt(predicate=lambda p: Violation().value(p) > 0), 0.3 * width)
            following = onward.points[-1]
        self.points.append(found)
        self._mark_change(found, False)
        self.points.append(following)
        return following, max(width, 1e-3)
