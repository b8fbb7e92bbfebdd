"""The curve of a contact by a model: traced, asked for states, and followed as a quasi-static path."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.units import FINEST
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.find import disconnected
from contbranch.curve.outcome import RawCurve, no_curve, not_followed, state_in_units
from contbranch.curve.paths import CurveWalk
from contbranch.curve.problem import EquilibriumProblem
from contbranch.curve.quasi_static import Jump, Leg, quasi_static
from contbranch.curve.refine import Found
from contbranch.curve.rows import raw_curve
from contbranch.curve.solve import CONTROLS, Crossing, crossings, state_apart, state_on
from contbranch.curve.tolerances import FINEST_ROWS, LANDING_MARGIN, ORDINARY_ROWS, RETRY_FACTOR, of_rows
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import Cost, State
from contbranch.results.loop import Hysteresis
from contbranch.results.record import OBSERVABLES
from contbranch.watch import over

__all__ = ["Coexisting", "FollowedCurves", "Model", "Route"]

# How often a curve is continued until what a path jumps to lies on it.
EXTENSIONS = 8
# What is said of jumps whose ends are not certain.
ASSUMED = (
    "After the fold at {} the path goes on at the next stable state along the curve ({}): the relaxation was not "
    "followed there, and energies along the curve do not exclude that it ends at another one, see `others` of the jump."
)
OFF_CURVE = "The relaxation from the fold at {} ends in a state that is not on the traced curve ({})."
# The last curve on which states were looked for: the next state asked for is often one of the same contact.
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
        Largest error of a state in units of what is allowed; 0 without states, or where the discretisation is given.
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

    walk: CurveWalk = field(default_factory=CurveWalk)
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

    def track(self, request: Request) -> Track:
        """The curve with the problems that solved its rows."""
        return self._read(request, lambda track: track)

    def _read(self, request: Request, read: Callable[[Track], Reading]) -> Reading:
        """What is read off the curve.

        Where it is lost, or what is read of all of it is in doubt, it is followed once more with finer discretisations,
        from its start, unless its contact is one of those that are not followed.
        """

        def followed(accuracy: float) -> Track:
            return trace(self.model.problem(self.reduced, accuracy), request)

        track, finer = followed(request.accuracy), RETRY_FACTOR * request.accuracy
        first = read(track)
        failed = track.points and (track.lost or first.doubtful)
        if not failed or finer < FINEST or not_followed(self.contact) or over():
            return first
        again = read(followed(finer))
        if again.complete:
            what = "The curve was lost" if track.lost else "Its events are in doubt"
            return replace(again, message=f"{what} at this accuracy, but not at {finer:g}. {again.message}".strip())
        too = "At a hundredth of the accuracy it is incomplete, too: ask for less."
        return first if over() else replace(first, message=f"{first.message} {too}")

    def recent(self, request: Request) -> Track:
        """The curve, not followed anew if it was the last one.

        What is done with it leaves no trace: numbers do not depend on what was asked before.
        """
        parts = (self.model, self.contact.tip, *terms_of(self.contact.interaction))
        if not all(type(part).__module__.startswith("contbranch.") for part in parts):  # others may change
            return self.track(request)
        key = (self.model, self.reduced, request)
        track = _recent.get(key) or self.track(request)
        if over() or not track.points:
            return track
        _recent.clear()
        _recent[key] = track
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
        return _coexisting(track, request, field, [(state_on(track, one, {field: value}), True) for one in found])

    def find_all(self, request: Request, field: str, value: float, window: tuple[float, float] | None) -> Coexisting:
        """Equilibria with a load or displacement: on the curve, and off it where the problem offers a search."""
        track, known = self._crossings(request, field, value)
        curve = raw_curve(track, replace(request, events=False))
        if window is None:
            # Farther away than the trace begins, too; and what is solved for lies beside rows by more than it is told.
            solved = [value] if field == "displacement" else [one.found.numbers[1] for one in known]
            reached = [*curve.branch.displacement, *solved] or [0.0]
            window = (float(min(reached)), float(max(reached)))
        searched = track.problem(0).complete_by if track.points else ""
        others: list[Found] | None = []
        if len(track.points) > 1 and not searched and not over():
            held = LOAD if field == "load" else DISPLACEMENT
            others = disconnected(track, known, held, value, request.accuracy)
        states = [(state_on(track, one, {field: value}), True) for one in known]
        states += [(state_apart(one, track.controls, {field: value}), False) for one in others or ()]
        inside = [(state, joined) for state, joined in states if window[0] <= state.displacement <= window[1]]
        apart = sum(not joined for _, joined in inside)
        if others is None:
            searched = "others were not looked for off the curve"
        elif apart:
            searched = f"{apart} not connected to the curve"
        elif not searched:
            searched = "the search off the curve " + ("was not finished" if over() else "found no other")
        found = _coexisting(track, request, field, inside)
        return replace(found, complete=curve.complete, message=curve.message, window=window, searched=searched)

    def cycle(self, request: Request, control: Control, steps: int, file: Path | None) -> Hysteresis:
        """A quasi-static cycle by relaxation alone, of grids.

        Raises
        ------
        InputError
            For other models.
        """
        raise InputError("method: 'relaxation' is for grids; give model='periodic' or 'free', or method='curve'")

    def path(self, request: Request) -> Route:
        """The quasi-static path under a control."""
        control, request = request.control, replace(request, modes=0, fine=True)
        for _ in range(EXTENSIONS):
            track = self.track(request)
            curve = raw_curve(track, request)
            walk = CurveWalk(track, curve.events, control, request.accuracy)
            legs, jumps, failed = quasi_static(walk) if len(track.points) > 1 else ([], [], "")
            endless = [jump for jump in jumps if jump.end is None and jump.direction > 0]
            if not (endless and curve.complete) or walk.off_curve or failed or over():
                break
            value = control.of(endless[0].begin.state)
            request = replace(request, target=value + LANDING_MARGIN * max(1.0, abs(value)), held=control)

        def place(state: State) -> str:
            own = state_in_units(self.contact, state)
            return f"load {own.load:.6g}, displacement {own.displacement:.6g}"

        notes = [ASSUMED.format(place(fold.state), place(end.state)) for fold, end in walk.assumed]
        notes += [OFF_CURVE.format(place(fold.state), place(state)) for fold, state in walk.off_curve]
        complete = curve.complete and not (walk.off_curve or failed or endless)
        return Route(walk, legs, jumps, curve, complete, " ".join([curve.message, *notes, failed]).strip())

    def _crossings(self, request: Request, field: str, value: float) -> tuple[Track, list[Crossing]]:
        """Where the curve has a value, in order along it.

        Raises
        ------
        InputError
            If the value is out of range whatever the curve does.
        """
        if field not in CONTROLS:
            raise InputError(f"{field}: only that of a periodic cell can be held; give model='periodic'")
        control: Control | None = CONTROLS[field]
        if control is None and not 0 < value < self.reduced.axisymmetric_tip.extent:
            raise InputError(f"contact_radius: {value:g}; must be greater than zero (and within the tip)")
        request, accuracy = replace(request, events=False, modes=0), request.accuracy
        track = self.recent(request)
        if track.complete and not over() and value > track.column(field)[-1]:
            request = replace(request, target=value + FINEST_ROWS * abs(value), held=control)
            track = self.track(request)
        folds = (m.point.observables[field] for m in track.marks if m.kind == "fold" and m.control == control)
        near = ORDINARY_ROWS * max(1.0, abs(value))
        if accuracy < ORDINARY_ROWS and any(abs(fold - value) <= near for fold in folds) and not over():
            problem = self.problem(request)
            if problem.rows_within(of_rows(accuracy)) is not problem:
                track = self.track(replace(request, fine=True))
        return track, crossings(track, field, value, accuracy)


def _coexisting(track: Track, request: Request, field: str, states: Sequence[tuple[State, bool]]) -> Coexisting:
    """States and whether they are connected, with what is to be said of the curve."""
    column = track.column(field)
    if field == "contact_radius":  # it begins at first touch, or with a ring
        column = np.array([a for k, (a, b) in enumerate(pairwise(column)) if b > 0 and k not in track.gaps])
    lowest = float(column.min(initial=math.inf))
    found, connected = tuple(state for state, _ in states), tuple(joined for _, joined in states)
    off = [state.error[name] / max(1.0, abs(getattr(state, name))) for state in found for name in OBSERVABLES]
    excess = max(off, default=0.0) / request.accuracy
    return Coexisting(found, connected, lowest, track.work.cost(), track.work.unknowns, excess=excess)
