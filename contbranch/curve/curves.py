"""What is asked of a contact's curve, and what any model's equilibrium problem answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.units import FINEST
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.find import disconnected
from contbranch.curve.outcome import RawCurve, no_curve, not_followed, state_in_units
from contbranch.curve.paths import CurveWalk
from contbranch.curve.problem import ROW_SAFETY, EquilibriumProblem
from contbranch.curve.quasi_static import Jump, Leg, Stop, quasi_static
from contbranch.curve.refine import Found
from contbranch.curve.rows import raw_curve
from contbranch.curve.solve import CONTROLS, Crossing, crossings, state_apart, state_on
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import Cost, State
from contbranch.results.record import OBSERVABLES
from contbranch.watch import over

__all__ = ["Coexisting", "FollowedCurves", "Model", "Route", "landed"]

# A curve is continued until what a path jumps to lies on it: beyond the fold's value by this share, and as often.
BEYOND, EXTENSIONS = 1e-3, 8
# The rows of a path count themselves, in integrals along it: they are as accurate as the events, down to this. So are
# those that tell whether a value so close to a fold, relative to max(1, |value|), is passed.
FINE, BESIDE = 1e-9, 3e-6
# A curve that is lost, or in doubt, is followed again at this share of the accuracy.
FINER = 0.01
# A curve goes on beyond a value asked for by this share.
PAST = 1e-9
# Curves on which states were looked for that are kept, since the next state asked for is often one of the same contact,
# and rows above which they take too much memory for that.
RECENT, LONGEST = 2, 300
_recent: dict[tuple[Any, ...], Track] = {}
Reading = TypeVar("Reading", Track, RawCurve)


class Model(Protocol):
    """A model: what makes an equilibrium problem of a contact.

    It may also have a method ``obstacle(contact)`` that returns why it does not represent a contact, as the end of a
    sentence, or None.

    Attributes
    ----------
    name : str
        As it is called in results.
    """

    name: ClassVar[str]

    def problem(self, contact: Contact, accuracy: float) -> EquilibriumProblem:
        """The first problem of the curve of a contact in reduced units, for events of an accuracy."""


@dataclass(frozen=True)
class Coexisting:
    """Equilibria with one load, displacement or contact radius, reduced units.

    Attributes
    ----------
    states : tuple of State
        Those on the curve in its order, then the others.
    connected : tuple of bool
        Whether each lies on the curve.
    lowest : float
        Least value that the curve reaches.
    cost, unknowns : Cost, int
    complete : bool
    message : str
        What else is known of them.
    window : (float, float)
        Displacements between which they were looked for.
    searched : str
        Whether there are others, as the end of a sentence.
    excess : float
        Largest error of a state in units of what is allowed, unless the discretisation is given; 0 without states.
    """

    states: tuple[State, ...] = ()
    connected: tuple[bool, ...] = ()
    lowest: float = math.inf
    cost: Cost = field(default_factory=lambda: Cost(0.0, 0))
    unknowns: int = 0
    complete: bool = True
    message: str = ""
    window: tuple[float, float] = (0.0, 0.0)
    searched: str = "the search had not begun"
    excess: float = 0.0


@dataclass(frozen=True)
class Route:
    """A quasi-static path along a curve, reduced units.

    Attributes
    ----------
    walk : CurveWalk
    legs, jumps : list of Leg, list of Jump
    curve : RawCurve
        On which it runs.
    complete : bool
    message : str
    """

    walk: CurveWalk
    legs: Sequence[Leg] = ()
    jumps: Sequence[Jump] = ()
    curve: RawCurve = field(default_factory=no_curve)
    complete: bool = False
    message: str = ""


@dataclass(frozen=True)
class FollowedCurves:
    """Curves of a contact whose model makes an equilibrium problem of it.

    Attributes
    ----------
    contact : Contact
        In its own units.
    model : Model
    """

    contact: Contact
    model: Model

    @cached_property
    def reduced(self) -> Contact:
        """The contact in reduced units."""
        return self.contact.to_reduced()

    def trace(self, request: Request) -> RawCurve:
        """The whole curve with its events."""
        return self._read(request, lambda track: raw_curve(track, request))

    def problem(self, request: Request) -> EquilibriumProblem:
        """The first problem of the curve."""
        return self.model.problem(self.reduced, request.accuracy)

    def track(self, request: Request, tolerance: float | None = None) -> Track:
        """The curve with the problems that solved its rows, these within a tolerance if one is given."""
        return self._read(request, lambda track: track, tolerance)

    def _read(self, request: Request, read: Callable[[Track], Reading], tolerance: float | None = None) -> Reading:
        """What is read off the curve.

        Where it is lost, or what is read of all of it is in doubt, it is followed once more with finer discretisations,
        from its start, unless its contact is one of those that are not followed.
        """

        def followed(accuracy: float) -> Track:
            problem = self.model.problem(self.reduced, accuracy)
            return trace(problem if tolerance is None else problem.rows_within(tolerance), request)

        track, finer = followed(request.accuracy), FINER * request.accuracy
        once = not track.points or track.problem(0).given or finer < FINEST or bool(not_followed(self.contact))
        first = None if track.lost and not (once or over()) else read(track)
        if first is not None and (once or over() or not first.doubtful):
            return first
        again = read(followed(finer))
        what = "The curve was lost" if track.lost else "Its events are in doubt"
        if again.complete:
            return replace(again, message=f"{what} at this accuracy, but not at {finer:g}. {again.message}".strip())
        first = read(track) if first is None else first
        too = "At a hundredth of the accuracy it is incomplete, too: ask for less."
        return first if over() else replace(first, message=f"{first.message} {too}")

    def recent(self, request: Request, tolerance: float | None = None) -> Track:
        """The same, not followed anew if it was among the last ones.

        What is done with it leaves no trace: numbers do not depend on what was asked before.
        """
        parts = (self.model, self.contact.tip, *terms_of(self.contact.interaction))
        if not all(type(part).__module__.startswith("contbranch.") for part in parts):  # others need not stay the same
            return self.track(request, tolerance)
        key = (self.model, self.reduced, request, tolerance)
        track = _recent.pop(key, None) or self.track(request, tolerance)
        if over() or not 0 < len(track.points) < LONGEST or track.problem(0).given:  # grids take too much memory, too
            return track
        _recent[key] = track
        for old in list(_recent)[:-RECENT]:
            _recent.pop(old, None)
        return deepcopy(track, {id(control): control for control in (LOAD, DISPLACEMENT)})

    def solve(self, request: Request, field: str, value: float, near: State | None = None) -> Coexisting:
        """Equilibria on the curve with a load, displacement or contact radius, in order along it.

        Raises
        ------
        ModelError
            If the curve ends before the value could be reached.
        InputError
            If the value is out of range whatever the curve does.
        """
        track, found = self._crossings(request, field, value)
        if not found and not track.complete and not over():
            own = value * self.contact.scales.of_fields[field]
            raise ModelError(f"{field}: the curve ends before {own:.6g} is reached. {track.message}")
        states = tuple(state_on(track, one, {field: value}) for one in found)
        return _coexisting(track, request, field, states, (True,) * len(states))

    def find_all(self, request: Request, field: str, value: float, window: tuple[float, float] | None) -> Coexisting:
        """Equilibria with a load or displacement: on the curve, and off it where the problem offers a search."""
        track, known = self._crossings(request, field, value)
        curve = raw_curve(track, replace(request, events=False))
        if window is None:
            # Farther away than the trace begins, too; and what is solved for lies beside rows by more than it is told.
            solved = [value] if field == "displacement" else [one.found.numbers[1] for one in known]
            reached = [*curve.displacement, *solved] or [0.0]
            window = (float(min(reached)), float(max(reached)))
        others: list[Found] | None = []
        searched = ""
        if len(track.points) > 1:
            searched = track.problem(0).complete_by
            held = LOAD if field == "load" else DISPLACEMENT
            others = [] if searched or over() else disconnected(track, known, held, value, request.accuracy)
        given = {field: value}
        states = [state_on(track, one, given) for one in known]
        states += [state_apart(one, track.controls, given) for one in others or ()]
        kept = [(s, k < len(known)) for k, s in enumerate(states) if window[0] <= s.displacement <= window[1]]
        apart = sum(not joined for _, joined in kept)
        if others is None:
            searched = "others were not looked for off the curve"
        elif not searched:
            none = "the search off the curve " + ("was not finished" if over() else "found no other")
            searched = f"{apart} not connected to the curve" if apart else none
        found = _coexisting(track, request, field, tuple(s for s, _ in kept), tuple(joined for _, joined in kept))
        return replace(found, complete=curve.complete, message=curve.message, window=window, searched=searched)

    def path(self, request: Request) -> Route:
        """The quasi-static path under a control."""
        control, tolerance = request.control, max(FINE, request.accuracy) / ROW_SAFETY
        request, landings = replace(request, modes=0), dict[Hashable, int | None]()
        for _ in range(EXTENSIONS):
            track = self.track(request, tolerance)
            curve = raw_curve(track, request)
            walk = CurveWalk(track, curve.events, control, request.accuracy, landings=landings)
            legs, jumps, failed = quasi_static(walk) if len(track.points) > 1 else ([], [], "")
            lost = [jump for jump in jumps if jump.end is None and jump.direction > 0]
            if not (lost and curve.complete) or walk.astray or failed or over():
                break
            value = control.of(lost[0].begin.state)
            request = replace(request, target=value + BEYOND * max(1.0, abs(value)), held=control)
        notes = [landed(self.contact, *note) for note in walk.notes]
        notes += [left(self.contact, *one) for one in walk.astray]
        complete = curve.complete and not (walk.astray or failed or lost)
        return Route(walk, legs, jumps, curve, complete, " ".join([curve.message, *notes, failed]).strip())

    def _crossings(self, request: Request, field: str, value: float) -> tuple[Track, list[Crossing]]:
        """Where the curve has a value, in order along it.

        Raises
        ------
        InputError
            If the value is out of range whatever the curve does.
        """
        control: Control | None = CONTROLS[field]
        if control is None and not 0 < value < self.reduced.axisymmetric_tip.extent:
            raise InputError(f"contact_radius: {value:g}; must be greater than zero (and within the tip)")
        request = replace(request, events=False, modes=0)
        track = self.recent(request)
        if track.complete and not over() and value > track.column(field)[-1]:
            request = replace(request, target=value + PAST * abs(value), held=control)
            track = self.recent(request)
        folds = (m.point.observables[field] for m in track.marks if m.kind == "fold" and m.control == control)
        beside = any(abs(fold - value) <= BESIDE * max(1.0, abs(value)) for fold in folds)
        if beside and request.accuracy < BESIDE and not over():
            problem, tolerance = self.problem(request), max(FINE, request.accuracy) / ROW_SAFETY
            if problem.rows_within(tolerance) is not problem:
                track = self.recent(request, tolerance)
        return track, crossings(track, field, value, request.accuracy)


def _coexisting(
    track: Track, request: Request, field: str, states: tuple[State, ...], connected: tuple[bool, ...]
) -> Coexisting:
    column = track.column(field)
    if field == "contact_radius":  # it begins at first touch, or with a ring
        column = np.array([a for k, (a, b) in enumerate(pairwise(column)) if b > 0 and k not in track.gaps])
    lowest = float(column.min(initial=float("inf")))
    off = [state.error[name] / max(1.0, abs(getattr(state, name))) for state in states for name in OBSERVABLES]
    excess = 0.0 if not off or track.problem(0).given else max(off) / request.accuracy
    return Coexisting(states, connected, lowest, track.work.cost(), track.work.unknowns, excess=excess)


def left(contact: Contact, fold: Stop, end: State) -> str:
    """A sentence on a relaxation that has left the curve, in the contact's units."""
    begin, after = state_in_units(contact, fold.state), state_in_units(contact, end)
    return (
        f"The relaxation from the fold at load {begin.load:.6g}, displacement {begin.displacement:.6g} ends in a "
        f"state that is not on the traced curve (load {after.load:.6g}, displacement {after.displacement:.6g})."
    )


def landed(contact: Contact, fold: Stop, end: Stop) -> str:
    """A sentence on a landing that was not followed, in the contact's units."""
    begin, after = state_in_units(contact, fold.state), state_in_units(contact, end.state)
    return (
        f"After the fold at load {begin.load:.6g} the path goes on at the next stable state along the curve (load "
        f"{after.load:.6g}, displacement {after.displacement:.6g}): the relaxation was not followed there, and "
        "energies along the curve do not exclude that it ends at another one, see `others` of the jump."
    )
