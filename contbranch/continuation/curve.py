"""The result of a trace: points, events and how it ended. Plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from contbranch.arrays import AnyArray, Array
from contbranch.continuation.problem import Direction, Problem
from contbranch.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from contbranch.continuation.plotting import Quantity


class Outcome(Enum):
    """Why a curve ends where it ends; the value is the sentence to show.

    Attributes
    ----------
    complete : bool
        Whether nothing of the curve asked for is missing.
    """

    REACHED_EDGE = "The curve reached the edge of the parameter range.", True
    APPROACHES_EDGE = "The curve approaches the edge of the parameter range without reaching it.", True
    STARTED_ON_EDGE = "The curve starts on the edge of the parameter range.", True
    CLOSED = "The curve is closed: it came back to its start.", True
    ONE_DIRECTION = "The other direction was not asked for.", True
    STOPPED_AT_FOLD = "The number of folds asked for was reached.", True
    STOPPED_AT_EVENT = "The event asked for was reached.", True
    STOPPED_BY_PREDICATE = "The stop condition given by the user was met.", True
    NORM_LIMIT = "The state's norm exceeds norm_limit.", True
    RUNS_TO_INFINITY = "The state grows without bound, to infinity, at a finite value of the parameter."
    MAXIMUM_POINTS = "The largest number of points allowed was reached before the end of the curve."
    TIME_LIMIT = "The time limit was reached before the end of the curve."
    START_FAILED = "No solution was found near the start."
    STEP_TOO_SMALL = "Newton's method failed at the smallest step."
    TURNED_BACK = "The steps turned back along the curve."
    NOT_FINITE = "The problem returned values that are not finite, even at the smallest step."
    INTERRUPTED = "The computation was interrupted."
    EVALUATION_FAILED = "The problem raised an error, even at the smallest step."

    complete: bool

    def __new__(cls, sentence: str, complete: bool = False) -> Self:
        """Make an outcome from its sentence."""
        outcome = object.__new__(cls)
        outcome._value_, outcome.complete = sentence, complete
        return outcome


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
    before, after : int or None
        Morse indices of the curve on either side, where the index changes there or several curves cross.
    """

    point: Point
    error: float
    state_error: float
    index: int = -1
    before: int | None = None
    after: int | None = None

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
        return replace(self, point=self.point.turned(), before=self.after, after=self.before)


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

    def turned(self) -> Self:
        """Return the fold as seen along the opposite direction of the curve."""
        return replace(Located.turned(self), null_vector=-self.null_vector)


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
    """

    type: Literal["pitchfork", "transcritical", "branch point"] = "branch point"
    tangents: tuple[Direction, ...] = ()
    scales: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        if not self.tangents:
            own = self.point.tangent_x, self.point.tangent_parameter
            object.__setattr__(self, "tangents", (own,))

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

    def turned(self) -> Self:
        """Return the branch point as seen along the opposite direction of the curve."""
        return replace(Located.turned(self), tangents=tuple((-u, -a) for u, a in self.tangents))


@dataclass(frozen=True, slots=True, eq=False)
class IndexChange(Located):
    """A change of the Morse index that no fold and no simple branch point explains."""

    @property
    def kind(self) -> str:
        """Kind of the event."""
        return "index change"


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


def stacked(rows: Sequence[AnyArray]) -> AnyArray:
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
    eigenvalues : (m, n) array or None
        Of the Jacobian f_x at the points, by falling real part; nan where they could not be computed. An array of m
        arrays where their number changes on the way. None unless ``stability=True`` was asked for.
    unstable : (m,) array or None
        How many of them have a positive real part; at an event the lower number of those on the sides that were
        followed. -1 where that is not known.
    unstable_between : (m - 1,) array or None
        The same between the points and their next.
    """

    points: tuple[Point, ...]
    events: tuple[Located, ...]
    ends: tuple[End, End]
    closed: bool = False
    eigenvalues: AnyArray | None = None
    unstable: AnyArray | None = None
    unstable_between: AnyArray | None = None

    @cached_property
    def parameter(self) -> Array:
        """Parameters of the points, shape (m,)."""
        return np.array([point.parameter for point in self.points])

    @cached_property
    def x(self) -> AnyArray:
        """States of the points, shape (m, n); an array of m arrays where the discretisation was adapted on the way."""
        return stacked([point.x for point in self.points])

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

    @property
    def hopf_points(self) -> list[HopfPoint]:
        """The Hopf points, in order along the curve."""
        return [event for event in self.events if isinstance(event, HopfPoint)]

    def named(self, name: str) -> list[EventPoint]:
        """Return the user events of one name, in order along the curve."""
        return [event for event in self.events if isinstance(event, EventPoint) and event.name == name]

    def plot(self, x: Quantity = "parameter", y: Quantity = 0, ax: Axes | None = None, **line: Any) -> Figure:
        """Draw the curve with its folds, branch points and other events: a bifurcation diagram.

        It is drawn through the tangents, by a cubic between any two points; solid where it is stable and dashed where
        it is not, if that is known (`trace_curve` with ``stability=True``). To draw several curves in one diagram give
        them the same axes.

        Parameters
        ----------
        x, y : str, int or callable
            What to draw: "parameter", a component of the state by its number, a function of (x, p), or an observable
            by its name. Observables are known at the points alone, with straight lines between them.
        ax : matplotlib Axes, optional
            Where to draw; by default in a new figure.
        **line
            Properties of the line, as for matplotlib's `plot`: color, linewidth, label.

        Returns
        -------
        matplotlib Figure
        """
        from contbranch.continuation.plotting import draw

        return draw(self, x, y, ax, line)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a row for every point: parameter, x[0], x[1], ..., observables, event and, where known, unstable.

        The state is left out where its length changes along the curve. `event` is the kind of event at the point.

        Raises
        ------
        InputError
            If pandas is not installed (extra ``tables``).
        """
        try:
            import pandas as pd
        except ModuleNotFoundError:
            raise InputError("to_dataframe: pandas is not installed; install contbranch[tables].") from None
        state = self.x.T if self.x.ndim == 2 else ()
        names = self.points[0].observables if self.points else ()
        kinds = {event.index: event.kind for event in self.events}
        columns = {"parameter": self.parameter, **{f"x[{i}]": row for i, row in enumerate(state)}}
        columns |= {name: self.observable(name) for name in names}
        if self.unstable is not None:
            columns["unstable"] = self.unstable
        return pd.DataFrame({**columns, "event": [kinds.get(i, "") for i in range(len(self.points))]})

    def save(self, path: str | Path) -> None:
        """Write the curve to a file of numpy's (.npz) that `load_curve` reads: all numbers, events and ends.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        from contbranch.continuation.storage import save

        save(self, path)

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
