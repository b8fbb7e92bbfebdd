"""The result of a trace: points, events and how it ended. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Self

import numpy as np

from contbranch.arrays import AnyArray, Array
from contbranch.continuation.problem import Direction, Problem, size_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Outcome(Enum):
    """Why a curve ends where it ends; the value is the sentence to show."""

    REACHED_EDGE = "The curve reached the edge of the parameter range."
    APPROACHES_EDGE = "The curve approaches the edge of the parameter range without reaching it."
    STARTED_ON_EDGE = "The curve starts on the edge of the parameter range."
    CLOSED = "The curve is closed: it came back to its start."
    STOPPED_AT_FOLD = "The number of folds asked for was reached."
    STOPPED_AT_EVENT = "The event asked for was reached."
    STOPPED_BY_PREDICATE = "The stop condition given by the user was met."
    RUNS_TO_INFINITY = "The state grows without bound, to infinity, at a finite value of the parameter."
    MAXIMUM_POINTS = "The largest number of points allowed was reached before the end of the curve."
    START_FAILED = "No solution was found near the start."
    STEP_TOO_SMALL = "Newton's method failed at the smallest step."
    TURNED_BACK = "The steps turned back along the curve."
    NOT_FINITE = "The problem returned values that are not finite, even at the smallest step."
    INTERRUPTED = "The computation was interrupted."
    EVALUATION_FAILED = "The problem raised an error, even at the smallest step."

    @property
    def complete(self) -> bool:
        """Whether nothing of the curve asked for is missing."""
        return self in _COMPLETE


_COMPLETE = frozenset(
    {
        Outcome.REACHED_EDGE,
        Outcome.APPROACHES_EDGE,
        Outcome.STARTED_ON_EDGE,
        Outcome.CLOSED,
        Outcome.STOPPED_AT_FOLD,
        Outcome.STOPPED_AT_EVENT,
        Outcome.STOPPED_BY_PREDICATE,
    }
)


@dataclass(frozen=True, slots=True)
class End:
    """One end of a curve: why it is there, details (an error's text, a residual) where there are any, and the error."""

    outcome: Outcome
    detail: str = ""
    cause: BaseException | None = None

    @property
    def message(self) -> str:
        """The outcome's sentence, followed by the details."""
        return f"{self.outcome.value} {self.detail}".strip()


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """One computed point of a curve.

    Attributes
    ----------
    problem : Problem
        The problem, on the discretisation that `x` belongs to.
    x : (n,) array
        State.
    parameter : float
        Parameter p.
    tangent_x, tangent_parameter : (n,) array, float
        Unit tangent along the curve's direction, in the metric that was in use at this point.
    determinant_sign : int or None
        Sign of the bordered determinant; it changes at simple branch points and not at folds.
    morse_index : int or None
        Number of unstable directions, if the problem knows it.
    observables : mapping
        What the problem recorded.
    label : str
        "" for an ordinary point, otherwise the kind of event or end that put it there.
    """

    problem: Problem
    x: Array
    parameter: float
    tangent_x: Array
    tangent_parameter: float
    determinant_sign: int | None = None
    morse_index: int | None = None
    observables: Mapping[str, float] = field(default_factory=dict)
    label: str = ""

    def turned(self) -> Point:
        """Return the point as seen along the opposite direction of the curve."""
        sign = None if self.determinant_sign is None else -self.determinant_sign
        return replace(
            self, tangent_x=-self.tangent_x, tangent_parameter=-self.tangent_parameter, determinant_sign=sign
        )


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """A point of the curve where something happens, located to machine precision.

    Attributes
    ----------
    point : Point
        The point of the curve.
    error : float
        Estimated error of the parameter.
    state_error : float
        Estimated error of the state, in the norm of `Problem.inner`.
    index : int
        Its place among the curve's points.
    """

    point: Point
    error: float
    state_error: float
    index: int = -1

    @property
    def parameter(self) -> float:
        """Parameter of the event."""
        return self.point.parameter

    @property
    def x(self) -> Array:
        """State of the event."""
        return self.point.x

    @property
    def observables(self) -> Mapping[str, float]:
        """What the problem recorded at the event."""
        return self.point.observables

    @property
    def kind(self) -> str:
        """Kind of the event."""
        return "event"

    def turned(self) -> Self:
        """Return the event as seen along the opposite direction of the curve."""
        return replace(self, point=self.point.turned())


@dataclass(frozen=True, slots=True, eq=False)
class Fold(Located):
    """A quadratic extremum of the parameter along the curve.

    Near it x = x_fold + α φ + O(α²) and p = p_fold + curvature α²/2 + O(α³), with φ the null vector of the Jacobian.

    Attributes
    ----------
    null_vector : (n,) array
        φ, with inner(φ, φ) = 1, along the curve's direction.
    curvature : float
        d²p/dα². Positive: the parameter has a minimum here.
    """

    null_vector: Array = field(default_factory=lambda: np.empty(0))
    curvature: float = float("nan")

    @property
    def kind(self) -> str:
        """Kind of the event."""
        return "fold"

    def turned(self) -> Fold:
        """Return the fold as seen along the opposite direction of the curve."""
        return replace(self, point=self.point.turned(), null_vector=-self.null_vector)


@dataclass(frozen=True, slots=True, eq=False)
class BranchPoint(Located):
    """A point where another curve crosses this one.

    Attributes
    ----------
    type : str
        Where one other curve crosses, "pitchfork" (one of the two is at an extremum of the parameter there) or
        "transcritical"; "branch point" where several do, or where the second derivatives do not tell.
    tangents : tuple of ((n,) array, float)
        Unit directions of all curves that cross here as far as they are known, that of this one first. With
        `type` "branch point" and a single one, how the others go is not known.
    scales : (float, float)
        Lengths of state and parameter that the trace took for one where it found the point.
    before, after : int or None
        Morse indices of the curve on either side, where several curves cross and the problem knows them.
    """

    type: Literal["pitchfork", "transcritical", "branch point"] = "branch point"
    tangents: tuple[Direction, ...] = ()
    scales: tuple[float, float] = (1.0, 1.0)
    before: int | None = None
    after: int | None = None

    @property
    def other_x(self) -> Array | None:
        """State part of the direction of the crossing curve, None if there is not a single one."""
        return self.tangents[1][0] if len(self.tangents) == 2 else None

    @property
    def other_parameter(self) -> float | None:
        """Parameter part of the direction of the crossing curve, None if there is not a single one."""
        return self.tangents[1][1] if len(self.tangents) == 2 else None

    @property
    def kind(self) -> str:
        """Kind of the event; that of several curves is a change of the index, where that is known."""
        return "branch point" if self.before == self.after else "index change"

    def turned(self) -> BranchPoint:
        """Return the branch point as seen along the opposite direction of the curve."""
        tangents = tuple((-u, -a) for u, a in self.tangents)
        return replace(self, point=self.point.turned(), tangents=tangents, before=self.after, after=self.before)


@dataclass(frozen=True, slots=True, eq=False)
class IndexChange(Located):
    """A change of the Morse index that no fold and no simple branch point explains."""

    before: int = 0
    after: int = 0

    @property
    def kind(self) -> str:
        """Kind of the event."""
        return "index change"

    def turned(self) -> IndexChange:
        """Return the change as seen along the opposite direction of the curve."""
        return replace(self, point=self.point.turned(), before=self.after, after=self.before)


@dataclass(frozen=True, slots=True, eq=False)
class EventPoint(Located):
    """A zero of a user's event function."""

    name: str = "event"

    @property
    def kind(self) -> str:
        """Kind of the event: the name that the user gave."""
        return self.name


@dataclass(frozen=True)
class Curve:
    """A solution curve.

    Attributes
    ----------
    points : tuple of Point
        In order along the curve, events and ends included.
    events : tuple of Located
        Folds, branch points, changes of index and user events, in order along the curve.
    ends : (End, End)
        How the curve ends before its first and after its last point.
    closed : bool
        Whether the curve came back to its start; first and last point are then the same.
    """

    points: tuple[Point, ...]
    events: tuple[Located, ...]
    ends: tuple[End, End]
    closed: bool = False

    @cached_property
    def parameter(self) -> Array:
        """Parameters of the points, shape (m,)."""
        return np.array([point.parameter for point in self.points])

    @cached_property
    def x(self) -> AnyArray:
        """States of the points, shape (m, n); an array of m arrays where the discretisation was adapted on the way."""
        states = [point.x for point in self.points]
        if len({state.size for state in states}) <= 1:
            return np.array(states)
        ragged = np.empty(len(states), dtype=object)
        ragged[:] = states
        return ragged

    @cached_property
    def tangent_parameter(self) -> Array:
        """Parameter components of the unit tangents, shape (m,)."""
        return np.array([point.tangent_parameter for point in self.points])

    @property
    def tangent_x(self) -> list[Array]:
        """State components of the unit tangents."""
        return [point.tangent_x for point in self.points]

    @property
    def morse_index(self) -> list[int | None]:
        """Morse indices of the points."""
        return [point.morse_index for point in self.points]

    def observable(self, name: str) -> Array:
        """Return one observable along the curve, shape (m,).

        Raises
        ------
        KeyError
            If the problem records no observable of that name.
        """
        return np.array([point.observables[name] for point in self.points])

    @property
    def folds(self) -> list[Fold]:
        """The folds, in order along the curve."""
        return [event for event in self.events if isinstance(event, Fold)]

    @property
    def branch_points(self) -> list[BranchPoint]:
        """The branch points, in order along the curve."""
        return [event for event in self.events if isinstance(event, BranchPoint)]

    def named(self, name: str) -> list[EventPoint]:
        """Return the user events of one name, in order along the curve."""
        return [event for event in self.events if isinstance(event, EventPoint) and event.name == name]

    def plot(self, observable: str | int | None = None) -> Figure:
        """Draw the curve over the parameter, with its folds, branch points and other events.

        Parameters
        ----------
        observable : str or int, optional
            What to draw: an observable by name, a component of the state by number; by default the state's norm
            (of `Problem.inner`).
        """
        from matplotlib.figure import Figure

        def height(point: Point) -> float:
            if observable is None:
                return size_of(point.problem, point.x)
            return point.observables[observable] if isinstance(observable, str) else float(point.x[observable])

        figure = Figure(layout="constrained")
        shown = "‖x‖" if observable is None else observable if isinstance(observable, str) else f"x[{observable}]"
        axes = figure.add_subplot(xlabel="p", ylabel=shown)
        axes.plot(self.parameter, [height(point) for point in self.points], ".-", markersize=3)
        markers = {"fold": "o", "branch point": "s"}
        for kind in dict.fromkeys(event.kind for event in self.events):
            events = [event for event in self.events if event.kind == kind]
            heights = [height(event.point) for event in events]
            axes.plot([event.parameter for event in events], heights, markers.get(kind, "x"), label=kind)
        if self.events:
            axes.legend()
        return figure

    @property
    def outcome(self) -> Outcome:
        """The outcome that matters most: what kept the curve from being complete, if anything did."""
        first, last = self.ends
        return first.outcome if last.outcome.complete and not first.outcome.complete else last.outcome

    @property
    def status(self) -> Literal["complete", "incomplete"]:
        """Whether the curve asked for was followed to both ends."""
        return "complete" if all(end.outcome.complete for end in self.ends) else "incomplete"

    @property
    def message(self) -> str:
        """How the curve ended, as sentences; what kept it from being complete comes first."""
        messages = [end.message for end in sorted(self.ends, key=lambda end: end.outcome.complete)]
        return " ".join(dict.fromkeys(messages))
