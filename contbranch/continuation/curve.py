"""The result of a trace: points, events and how it ended. Plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    MAXIMUM_POINTS = "The largest number of points allowed was reached before the end of the curve."
    START_FAILED = "No solution was found near the start."
    STEP_TOO_SMALL = "Newton's method failed at the smallest step."
    TURNED_BACK = "The steps turned back along the curve."
    NOT_FINITE = "The problem returned values that are not finite, even at the smallest step."
    NORM_LIMIT = "The largest norm of the state that was asked for was exceeded."
    ONE_DIRECTION = "The other direction was not asked for."
    TIME_LIMIT = "The time limit was reached before the end of the curve."
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
        Outcome.NORM_LIMIT,
        Outcome.ONE_DIRECTION,
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
        "pitchfork" (one of the two curves is at an extremum of the parameter there), "transcritical", or
        "branch point" where the second derivatives do not tell.
    other_x, other_parameter : (n,) array, float
        Direction of the crossing curve, where it could be computed.
    scales : (float, float)
        Lengths of state and parameter that the trace took for one where it found the point.
    """

    type: Literal["pitchfork", "transcritical", "branch point"] = "branch point"
    other_x: Array | None = None
    other_parameter: float | None = None
    scales: tuple[float, float] = (1.0, 1.0)

    @property
    def tangents(self) -> tuple[Direction, ...]:
        """Directions (u, a) in which x and p change along the curves that meet here, that of the one followed first.

        Only that one where the others could not be computed.
        """
        followed = self.point.tangent_x, self.point.tangent_parameter
        if self.other_x is None or self.other_parameter is None:
            return (followed,)
        return followed, (self.other_x, self.other_parameter)

    @property
    def kind(self) -> str:
        """Kind of the event."""
        return "branch point"


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


@dataclass(frozen=True, slots=True, eq=False)
class HopfPoint(EventPoint):
    """A point where a pair of complex eigenvalues of f_x crosses the imaginary axis, for x' = f(x, p).

    Attributes
    ----------
    frequency : float
        ω > 0 of the eigenvalues ±iω. The period of the oscillations that begin here is 2π/ω.
    """

    name: str = "hopf"
    frequency: float = float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class Stability:
    """Stability along a curve of m points.

    Attributes
    ----------
    eigenvalues : tuple of (n,) arrays
        Of the Jacobian at the points, by falling real part.
    unstable : (m,) array
        How many have a positive real part; -1 where that is not known.
    between : (m - 1,) array
        The same between the points and their next.
    """

    eigenvalues: tuple[AnyArray, ...]
    unstable: AnyArray
    between: AnyArray


def _stacked(rows: Sequence[AnyArray]) -> AnyArray:
    """Return rows as a matrix, or as an array of arrays where their lengths differ."""
    if len({row.size for row in rows}) <= 1:
        return np.array(rows)
    ragged = np.empty(len(rows), dtype=object)
    ragged[:] = rows
    return ragged


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
    stability : Stability or None
        Eigenvalues and how many are unstable, where they were asked for.
    """

    points: tuple[Point, ...]
    events: tuple[Located, ...]
    ends: tuple[End, End]
    closed: bool = False
    stability: Stability | None = None

    @cached_property
    def parameter(self) -> Array:
        """Parameters of the points, shape (m,)."""
        return np.array([point.parameter for point in self.points])

    @cached_property
    def x(self) -> AnyArray:
        """States of the points, shape (m, n); an array of m arrays where the discretisation was adapted on the way."""
        return _stacked([point.x for point in self.points])

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

    @cached_property
    def eigenvalues(self) -> AnyArray | None:
        """Eigenvalues of f_x by falling real part, shape (m, n), see `trace_curve`; None unless asked for.

        An array of m arrays where their number changes on the way. nan where they could not be computed.
        """
        return None if self.stability is None else _stacked(self.stability.eigenvalues)

    @property
    def unstable(self) -> AnyArray | None:
        """How many eigenvalues of f_x have a positive real part, shape (m,); None unless asked for.

        At an event it is the number on that side that has fewer. -1 where the eigenvalues could not be computed.
        """
        return None if self.stability is None else self.stability.unstable

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

    @property
    def hopf_points(self) -> list[HopfPoint]:
        """The Hopf points, in order along the curve."""
        return [event for event in self.events if isinstance(event, HopfPoint)]

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
