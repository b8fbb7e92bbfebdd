"""The whole curve of an axisymmetric contact: far away, through first touch, to a load in contact."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contbranch.analysis.stability import Indices, morse_indices
from contbranch.contact import Contact
from contbranch.continuation import Curve, Event, EventPoint, Options, Outcome, Point, StopAt, trace_curve
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.diagram import Cost, Profile
from contbranch.errors import InputError, ModelError
from contbranch.models.outcome import RawCurve, RawEvent
from contbranch.models.rings.handover import joined
from contbranch.models.rings.journey import Target as RingTarget

from .adapt import start_edges
from .azimuthal import LARGEST_MODE
from .critical import critical_exponent, sampled_exponent
from .equations import ContactCoordinate, Equations
from .locate import Place, Values, refine
from .marks import Mark, confirmed, ordered, signs
from .mesh import Mesh
from .problem import COARSE, ContactProblem, ControlReached, FoldEvent, InadmissibleEvent, Resolution
from .profile import profile_of
from .symmetry import Breaking, critical_eigenvalues, merged, symmetry_breaking

__all__ = ["Target", "Traced", "order_for", "trace"]

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

# Meshes of the trace need not be as fine as those of its events, which are located anew.
TRACE_TOLERANCE = 1e-6
# ... where the rows themselves count, in integrals along the curve, they are finer, as far as round-off lets one mesh.
FINE_TOLERANCE = 1e-9
# Share of the accuracy that the load at the start of the trace may have.
START_SHARE = 0.5
STEPS = Options(
    angle=0.3,
    angle_limit=0.8,
    tolerance=1e-9,
    noise=1e5,
    first_step=0.05,
    detect_folds=False,
    detect_branch_points=False,
    maximum_points=40_000,
)
# A trace with a spring starts where the stiffness of the interaction is about this share of the spring's.
SOFTER = 0.05
# Steps of the gap far away in units of the wavelength of layers.
LONGEST_IN_LAYERS = 0.15
# Changes of h small against the range of the interaction, over the width √(2 range), do not matter for the steps.
STATE_FLOOR = 0.3
# Resolution of events that will not be located anew: close enough to tell the order of coinciding folds of stiff films.
FINE = 1e-11
# A trace ends at this multiple of the largest load of any event, and not below the least load (reduced).
END_FACTOR, LEAST_END = 1.4, 10.0
CONE = "Exactly at first touch admissible variations form a cone, not a space: the indices are those of both sides."
# The rows' error estimates are those of one Newton step on a finer mesh.
ROW_SAFETY = 3.0
# ... with the coarser mesh's linearisation, which leaves errors far below the tolerance undecided.
ROW_FLOOR = 0.02
# Neighbouring folds closer than this multiple of their error estimates are located more sharply, down to this accuracy.
DISTINCT, SHARPEST = 3.0, 1e-12


@dataclass(frozen=True)
class Target:
    """Where a trace ends in contact: where a control has a value, in reduced units; without value: by the events."""

    value: float | None = None
    control: Control = LOAD


@dataclass(frozen=True)
class Traced:
    """A traced curve: its rows with the problems that solved them, and the raw result.

    Where the contact set stops being a disc the model with free boundaries goes on: `handed` is then the last row of
    this one, and the rows behind it belong to `contbranch.models.rings`.
    """

    points: tuple[Point, ...]
    curve: RawCurve
    indices: Indices
    controls: tuple[Control, ...] = (LOAD, DISPLACEMENT)
    handed: int | None = None

    def problem(self, row: int) -> ContactProblem:
        """The problem of a row."""
        problem = self.points[row].problem
        assert isinstance(problem, ContactProblem)
        return problem


def order_for(tolerance: float) -> int:
    """Nodes a panel for a tolerance: high orders pay when many digits are asked for."""
    return int(min(20, max(8, round(6 - math.log10(tolerance) * 0.8))))


def start_problem(
    contact: Contact, accuracy: float, tolerance: float, stiffness: float | None = None
) -> tuple[ContactProblem, float]:
    """The problem far away, where the interaction is negligible at the accuracy asked, and its parameter.

    With a spring, the interaction is also softer than the spring there.
    """
    tip, law = contact.tip, contact.interaction
    coordinate = ContactCoordinate(tip, min(tip.apex_exponent, 2.0))
    resolution = Resolution(tolerance, order_for(tolerance))
    if law is None:
        mesh = Mesh(np.array([0.0, 1.0]), resolution.order)
        return ContactProblem(Equations(tip, law, mesh, coordinate, False), 1.0, resolution), -math.asinh(1.0)
    scale = min(term.range for term in law.terms)
    negligible = min(0.1, START_SHARE * accuracy / (2 * math.pi))
    if stiffness is not None:
        negligible = min(negligible, SOFTER * stiffness * scale / (2 * math.pi))
    far = law.reach(max(negligible, np.finfo(float).tiny))
    width = float(_radius_at(contact, min(far, 4 * max(term.range for term in law.terms))))
    reach = float(_radius_at(contact, far))
    mesh = Mesh(start_edges(width, max(reach, 2 * width)), resolution.order)
    problem = ContactProblem(Equations(tip, law, mesh, coordinate, False), scale, resolution)
    return problem, problem.parameter(-max(far, scale))


def _radius_at(contact: Contact, height: float) -> float:
    """Radius at which the tip's profile has a height."""
    low, high = 0.0, 1.0
    while high < contact.tip.extent and float(contact.tip.height(np.float64(high))) < height:
        low, high = high, 2 * high
    high = min(high, contact.tip.extent)
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if float(contact.tip.height(np.float64(middle))) < height else (low, middle)
    return high


class _End:
    """Raises the target load as events with larger loads are met."""

    def __init__(self, target: Target, largest: float) -> None:
        self.fixed = target.value is not None
        self.event = ControlReached(
            target.control, 0.0 if target.value is None else target.control.target(target.value)
        )
        self.largest = largest
        self.last = -math.inf
        if not self.fixed:
            self.update(largest)

    def update(self, load: float) -> None:
        self.largest = max(self.largest, load)
        if not self.fixed:
            self.event.target = max(LEAST_END, END_FACTOR * self.largest)

    def __call__(self, point: Point) -> bool:
        load = point.observables["load"]
        if load < self.last:  # beyond a maximum of the load, which is an event
            self.update(self.last)
        self.last = load
        return False


def trace(
    contact: Contact,
    accuracy: float,
    target: Target,
    progress: Progress | None = None,
    events: bool = True,
    control: Control = LOAD,
    fine: bool = False,
    modes: int = LARGEST_MODE,
) -> Traced:
    """Follow a reduced contact's curve and locate its events.

    Parameters
    ----------
    contact : Contact
        In reduced units.
    accuracy : float
        Error allowed to every event, relative to max(1, |value|).
    target : Target
    progress : callable, optional
        Called with the fraction done (a guess) and what is being done.
    events : bool
        Whether events are made precise; without, the result has none, and its rows are as accurate as the trace.
    control : Control
        A spring (reduced units), whose folds are located besides those of load and displacement.
    fine : bool
        Whether the rows are to be as accurate as the events, down to 1e-9.
    modes : int
        Largest azimuthal mode number examined where events are located; 0: none.
    """
    began = time.perf_counter()
    controls = (LOAD, DISPLACEMENT, *((control,) if control.kind == "spring" else ()))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # answered by shorter steps, or reported
        try:
            allowed = max(FINE_TOLERANCE if fine else TRACE_TOLERANCE, accuracy)
            tolerance = allowed * (1 - ROW_FLOOR) / ROW_SAFETY
            problem, u = start_problem(contact, accuracy, tolerance, control.spring_stiffness)
        except InputError:
            raise
        except Exception as error:  # a law written by the user may raise anything; its text is kept
            return _nothing(f"The interaction cannot be evaluated far away: {type(error).__name__}: {error}")
        located = _Located(*_legs(problem, u, target, controls, progress, COARSE if events else FINE), controls)
        raw, indices = located.raw(contact, accuracy if events else None, progress, modes)
        points, handed = located.points, None
        if located.stopped_being_a_disc:
            try:
                ending = RingTarget(target.value, target.control)
                wanted = accuracy if events else None
                points, raw, indices, handed = joined(points, raw, indices, ending, controls, wanted)
            except ModelError as error:
                raw = replace(raw, message=f"{raw.message} It could not be followed beyond: {error}.")
    cost = Cost(time.perf_counter() - began, problem.resolution.newton)
    unknowns = max(raw.unknowns, problem.resolution.unknowns)
    return Traced(points, replace(raw, cost=cost, unknowns=unknowns), indices, controls, handed)


def _legs(
    problem: ContactProblem,
    u: float,
    target: Target,
    controls: Sequence[Control],
    progress: Progress | None,
    resolution: float,
) -> tuple[list[Curve], bool]:
    """The curve without contact, and the one in contact if first touch is reached."""
    told = _Told(progress, u)
    steps = replace(STEPS, state_floor=STATE_FLOOR * problem.scale * (2 * problem.scale) ** 0.25)
    law = problem.equations.interaction
    if law is not None and math.isfinite(law.wave):
        # Far away a step may be long, since the elastic body answers little; not so long as to miss a layer.
        longest = LONGEST_IN_LAYERS * law.wave / (problem.scale * math.cosh(u) * abs(u))
        steps = replace(steps, largest_parameter_step=min(steps.largest_parameter_step, longest))
    folds: list[Event] = [
        *(FoldEvent(control, name=control.kind, relative_resolution=resolution) for control in controls),
        InadmissibleEvent(),
    ]
    end = _End(target, -math.inf)
    bound = [end.event] if end.fixed else []
    first = trace_curve(
        problem, np.zeros(problem.equations.mesh.size), u, (u, 0.0), steps, [*folds, *bound], StopAt(predicate=told)
    )
    touched = bool(first.points) and first.ends[1].outcome is Outcome.REACHED_EDGE and first.points[-1].parameter == 0.0
    if not touched:
        return [first], False
    last = first.points[-1]
    assert isinstance(last.problem, ContactProblem)
    for point in first.points:
        if point.label in ("load", "spring", "edge"):
            end.update(point.observables["load"])
    stop = StopAt(predicate=lambda point: told(point) or end(point))
    within = (0.0, math.inf)
    contact_problem, x = last.problem.in_contact(), last.x
    second = trace_curve(contact_problem, x, 0.0, within, steps, [*folds, end.event], stop)
    if len(second.points) < 2:
        # A stiff film answers a tiny contact on a length far below the innermost panel: start with graded panels.
        contact_problem, x = contact_problem.graded(x)
        second = trace_curve(contact_problem, x, 0.0, within, steps, [*folds, end.event], stop)
    return [first, second], True


def _nothing(message: str) -> Traced:
    """The result of a trace that could not start."""
    empty, none = np.empty(0), np.empty(0, dtype=np.int64)
    curve = RawCurve(
        *(empty,) * 5,
        none,
        none,
        empty,
        empty,
        profiles=(),
        events=(),
        complete=False,
        message=message,
        cost=Cost(0.0, 0),
        unknowns=0,
    )
    return Traced((), curve, Indices(*(none,) * 9))


class _Told:
    """Progress, guessed from the parameter: most of the way is the approach to first touch."""

    def __init__(self, progress: Progress | None, start: float) -> None:
        self.progress, self.start, self.count = progress, start, 0

    def __call__(self, point: Point) -> bool:
        self.count += 1
        if self.progress is not None:
            u = point.parameter
            share = 0.6 * (1 - u / self.start) if u < 0 else 0.6 + 0.3 * u / (u + 2)
            self.progress(share, f"{self.count} points, load {point.observables['load']:.4g}")
        return False


class _Located:
    """The rows of both legs as one curve, and its events made precise."""

    def __init__(self, curves: list[Curve], touched: bool, controls: Sequence[Control]) -> None:
        self.curves = curves
        self.controls: dict[str, Control] = {control.kind: control for control in controls}
        self.points = tuple(curves[0].points) + (tuple(curves[1].points[1:]) if touched else ())
        self.touch_row = len(curves[0].points) - 1 if touched else None
        offsets = [0, len(curves[0].points) - 1]
        marks = [
            Mark(offset + event.index, event.name, event.point)
            for curve, offset in zip(curves, offsets, strict=False)
            for event in curve.events
            if isinstance(event, EventPoint)
        ]
        self.marks = confirmed(self.points, marks, controls)

    def raw(
        self, contact: Contact, accuracy: float | None, progress: Progress | None, modes: int
    ) -> tuple[RawCurve, Indices]:
        """Arrays and events."""
        points = self.points
        columns = {
            name: np.array([point.observables[name] for point in points])
            for name in (
                "load",
                "displacement",
                "contact_radius",
                "central_gap",
                "energy",
                "load_error",
                "displacement_error",
            )
        }
        refined = [] if accuracy is None else self._refined(accuracy, progress)
        folds = [(mark.row, mark.name) for mark in self.marks if mark.name in self.controls]
        along = signs(points[: folds[0][0]] if folds else points, list(self.controls.values()))
        first = [next((sign[k] for sign in along if sign[k]), 1) for k in range(len(self.controls))]
        indices = morse_indices(len(points), folds, first[0], first[1], pulling=first[2] if len(first) > 2 else None)
        events = [
            self._event(mark.row, mark.name, *found, indices) for mark, found in zip(self.marks, refined, strict=False)
        ]
        breaking = Breaking()
        if accuracy is not None and modes:
            breaking = symmetry_breaking(points, indices.displacement, accuracy, modes, progress)
            events = merged(events, breaking.events)
        complete, message = self._outcome(contact)
        complete, message = complete and breaking.complete, f"{message} {breaking.message}".strip()
        if complete and self._unstable_at_end() != indices.displacement_pieces[-1]:
            complete, message = (
                False,
                "The inertia at the end disagrees with the folds counted: a fold was missed or doubled.",
            )
        worst = max((_relative_error(event) / accuracy for event in events if accuracy), default=0.0)
        if worst > 1:
            complete, message = (
                False,
                f"{message} An event's error estimate is {worst:.3g} times the accuracy asked.".strip(),
            )
        profiles = [_deferred_profile(point) for point in points]
        curve = RawCurve(
            columns["load"],
            columns["displacement"],
            columns["contact_radius"],
            columns["central_gap"],
            columns["energy"],
            indices.load,
            indices.displacement,
            _row_errors(columns["load_error"], columns["load"]),
            _row_errors(columns["displacement_error"], columns["displacement"]),
            profiles,
            events,
            complete,
            message,
            Cost(0.0, 0),
            0,
            unstable_spring=indices.spring if "spring" in self.controls else None,
            unstable_azimuthal=breaking.unstable if breaking.counts else None,
            critical=lambda: critical_eigenvalues(points),
        )
        return curve, indices

    def _unstable_at_end(self) -> int:
        """Morse index under displacement control at the last point, by inertia: a check of the counting."""
        point = self.points[-1]
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        # Deep in contact the rough answer is nearly always 0, which is what is expected; any other is checked finely.
        return problem.equations.unstable_modes(fields, finely=False) and problem.equations.unstable_modes(fields)

    def _refined(self, accuracy: float, progress: Progress | None) -> list[tuple[Values, Place]]:
        """Values and places of all marks, first touch among them, whose order is that of their precise places."""
        if self.touch_row is not None:
            self.marks.append(Mark(self.touch_row, "touch", self.points[self.touch_row]))
        self.marks.sort(key=lambda mark: mark.row)
        found: list[tuple[Values, Place]] = []
        for k, mark in enumerate(self.marks):
            if progress is not None:
                progress(0.9 + 0.1 * k / len(self.marks), f"locating {mark.name}")
            found.append(self._precise(mark.point, mark.name, accuracy))
        self._sharpen([mark.name for mark in self.marks], found, accuracy)
        for k in range(len(found) - 1):
            here, there = self.marks[k], self.marks[k + 1]
            forward = here.point.tangent_parameter
            apart = (found[k + 1][1].u - found[k][1].u) * forward
            if there.row == here.row + 1 and apart < 0 and "touch" not in (here.name, there.name):
                # Neighbours without a point between them change places, but not rows.
                self.marks[k], self.marks[k + 1] = replace(there, row=here.row), replace(here, row=there.row)
                found[k], found[k + 1] = found[k + 1], found[k]
        # Where places agree to rounding, theory has the last word.
        places = {(mark.name, id(mark.point)): one for mark, one in zip(self.marks, found, strict=True)}
        self.marks = ordered(self.points, self.marks, list(self.controls.values()), [place.u for _, place in found])
        return [places[mark.name, id(mark.point)] for mark in self.marks]

    def _precise(self, point: Point, name: str, accuracy: float) -> tuple[Values, Place]:
        """Values and place of what a point of the trace marks."""
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        place = Place(problem, point.x, point.parameter, (point.tangent_x, point.tangent_parameter))
        event: Event | None = None
        if name == "end":
            event = ControlReached(LOAD, problem.equations.load(problem.fields(point.x, point.parameter)))
        elif name == "inadmissible":
            event = InadmissibleEvent(tolerance=0.0)
        elif name != "touch":
            event = FoldEvent(self.controls[name], name=name)
        return refine(place, event, accuracy)

    def _sharpen(self, names: list[str], refined: list[tuple[Values, Place]], accuracy: float) -> None:
        """Locate folds anew that their error estimates do not tell apart."""
        for kind, control in self.controls.items():
            members = [k for k, name in enumerate(names) if name == kind]
            for a, b in pairwise(members):
                allowed = accuracy
                while allowed > SHARPEST:
                    (first, _), (second, _) = refined[a], refined[b]
                    apart = abs(control.weighted(*first.numbers[:2]) - control.weighted(*second.numbers[:2]))
                    if apart > DISTINCT * (control.weighted(*first.error[:2]) + control.weighted(*second.error[:2])):
                        break
                    allowed *= 0.01
                    for k in (a, b):
                        refined[k] = refine(refined[k][1], FoldEvent(control, name=kind), allowed)

    def _event(self, row: int, name: str, values: Values, place: Place, indices: Indices) -> RawEvent:
        event = RawEvent(name, row, values.numbers, values.error, place=place)
        if name == "touch":
            return replace(event, message=CONE, local_exponent=lambda: sampled_exponent(place, values, LOAD))
        if name == "inadmissible":
            return replace(event, message="The contact set stops being a disc: see the message of the diagram.")
        if name == "end":
            return event
        control = self.controls[name]
        pieces, signs = indices.pieces(name)
        before, after = max(row - 1, 0), min(row, len(pieces) - 1)
        return replace(
            event,
            kind="fold",
            control=name,
            stiffness=control.spring_stiffness,
            before=int(pieces[before]),
            after=int(pieces[after]),
            maximum=bool(signs[before] > 0),
            exponent=lambda: critical_exponent(place, values, control),
            local_exponent=lambda: sampled_exponent(place, values, control),
        )

    @property
    def stopped_being_a_disc(self) -> bool:
        """Whether the curve ended because its contact set is no disc any more."""
        return any(mark.name == "inadmissible" for mark in self.marks)

    def _outcome(self, contact: Contact) -> tuple[bool, str]:
        last = self.curves[-1]
        end = last.ends[1]
        reached = bool(last.events) and isinstance(last.events[-1], EventPoint) and last.events[-1].name == "end"
        if end.outcome is Outcome.STOPPED_AT_EVENT and reached:
            return True, ""
        if end.outcome is Outcome.STOPPED_AT_EVENT:
            return False, (
                "The branch ends where the contact set stops being a disc: the gap would close outside the contact, "
                "or the wall "
                "would have to pull."
            )
        message = " ".join(dict.fromkeys(e.message for e in last.ends if not e.outcome.complete)) or end.message
        limitation = contact.interaction.limitation if contact.interaction is not None else ""
        return False, f"{message} {limitation} {self._end_of_tip(contact)}".strip()

    def _end_of_tip(self, contact: Contact) -> str:
        """A sentence if the interaction has come to the end of a tip of finite extent."""
        if not (self.points and math.isfinite(contact.tip.extent)):
            return ""
        point = self.points[-1]
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        r = np.hypot(problem.equations.mesh.nodes, fields.rim.radius)
        felt = r[np.abs(fields.pressure) > 1e-3 * np.abs(fields.pressure).max()]
        if max(fields.rim.radius, float(felt.max(initial=0.0))) < 0.9 * contact.tip.extent:
            return ""
        return "The contact, or the interaction around it, has reached the end of the tip."


def _relative_error(event: RawEvent) -> float:
    return max(error / max(1.0, abs(value)) for error, value in zip(event.error, event.values, strict=True))


def _row_errors(defect: Array, values: Array) -> Array:
    return ROW_SAFETY * np.abs(defect) + ROW_FLOOR * TRACE_TOLERANCE * np.maximum(1.0, np.abs(values))


def _deferred_profile(point: Point) -> Callable[[], Profile]:
    def profile() -> Profile:
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        return profile_of(problem.equations, problem.fields(point.x, point.parameter))

    return profile
