"""The rows of a traced curve as one result, with its events made precise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contbranch.contact.contact import Contact
from contbranch.continuation import Curve, Event, EventPoint, Outcome, Point
from contbranch.control import LOAD, Control
from contbranch.curve.outcome import RawCurve, RawEvent
from contbranch.curve.stability import Indices, morse_indices
from contbranch.results.diagram import Cost, Profile

from .critical import critical_exponent, sampled_exponent
from .locate import Place, Values, refine
from .marks import Mark, confirmed, ordered, signs
from .problem import ContactProblem, ControlReached, FoldEvent, InadmissibleEvent
from .profile import profile_of
from .symmetry import Breaking, critical_eigenvalues, merged, symmetry_breaking

__all__ = ["ROW_FLOOR", "ROW_SAFETY", "TRACE_TOLERANCE", "Located"]

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

# Meshes of the trace need not be as fine as those of its events, which are located anew.
TRACE_TOLERANCE = 1e-6
CONE = "Exactly at first touch admissible variations form a cone, not a space: the indices are those of both sides."
# The rows' error estimates are those of one Newton step on a finer mesh.
ROW_SAFETY = 3.0
# ... with the coarser mesh's linearisation, which leaves errors far below the tolerance undecided.
ROW_FLOOR = 0.02
# Neighbouring folds closer than this multiple of their error estimates are located more sharply, down to this accuracy.
DISTINCT, SHARPEST = 3.0, 1e-12
# Folds found so close to one another (in u, relative to min(1, |u|)) are at one place.
SAME_PLACE = 1e-9


class Located:
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
        repeated = repetitions([mark.name for mark in self.marks], [place.u for _, place in found])
        self.marks = [mark for k, mark in enumerate(self.marks) if k not in repeated]
        found = [one for k, one in enumerate(found) if k not in repeated]
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
        if not (self.points and math.isfinite(contact.axisymmetric_tip.extent)):
            return ""
        point = self.points[-1]
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        r = np.hypot(problem.equations.mesh.nodes, fields.rim.radius)
        felt = r[np.abs(fields.pressure) > 1e-3 * np.abs(fields.pressure).max()]
        if max(fields.rim.radius, float(felt.max(initial=0.0))) < 0.9 * contact.axisymmetric_tip.extent:
            return ""
        return "The contact, or the interaction around it, has reached the end of the tip."


def repetitions(names: Sequence[str], positions: Sequence[float]) -> set[int]:
    """Members of marks of one fold that stand for noise: a rate that changes its sign thrice within rounding.

    Three marks of one control that are found at one place are one fold; of two, each may be one of a pair that is too
    narrow to be told apart.

    Parameters
    ----------
    names : sequence of str
        Names of the marks in their order along the curve.
    positions : sequence of float
        Parameters u at which they were found.
    """
    dropped: set[int] = set()
    for name in set(names):
        run: list[int] = []
        for k in [k for k, other in enumerate(names) if other == name]:
            if run and abs(positions[k] - positions[run[-1]]) > SAME_PLACE * min(1.0, abs(positions[k])):
                run = []
            run.append(k)
            if len(run) == 3:
                dropped |= set(run[1:])
                run = run[:1]
    return dropped


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
