"""Following the curve of one layout: the events that end it, and points on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import Adaptation, CorrectionError, Event, Metric, Options, Outcome, Point, StopAt
from contbranch.continuation.curve import EventPoint
from contbranch.continuation.edge import Range
from contbranch.continuation.follow import Branch, follow
from contbranch.continuation.metric import Balance
from contbranch.continuation.newton import border, correct, linearise, residual, tangent_at
from contbranch.continuation.walk import annotated
from contbranch.control import LOAD, Control

from .constraints import least_margin
from .meshing import adapted
from .panels import Panels
from .problem import RingProblem

__all__ = [
    "FoldEvent",
    "Narrow",
    "Reached",
    "Violation",
    "follow_leg",
    "located",
    "oriented",
    "rates",
    "solved",
    "thresholds",
    "unit_metric",
]

Array = NDArray[np.float64]

STEPS = Options(
    angle=0.3,
    angle_limit=0.8,
    tolerance=1e-9,
    noise=1e6,
    first_step=0.05,
    detect_folds=False,
    detect_branch_points=False,
    maximum_points=3_000,
)
# Pressures below this share of the interaction's own, 1/range, do not matter for the steps of a curve without contact.
STATE_FLOOR = 0.02
# Newton's method far from a solution: most iterations, the relative correction from which it is left to itself, the
# growth of the residual that is accepted, and how often a step is halved to avoid more.
APPROACHES, NEARLY, GROWS, HALVINGS = 30, 1e-3, 1.5, 6
# A region narrower than this share of the one it was born with vanishes.
NARROW = 0.5
# A resting ring between two bands may be replaced by a jump of the pressure below this share of the outermost radius:
# both differ by a tenth of its square (measured against the closed form), see `accuracy.JUMP`.
NARROW_RING = 1e-4
# A region that was not born on the way vanishes below this share of the outermost edge.
NARROWEST = 1e-3
COARSE = 1e-6


class AdaptingProblem(RingProblem):
    """A `RingProblem` whose panels follow the solution along the curve."""

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """Split and join panels where the solution asks for it."""
        fields = self.fields(x, p)
        allowed = self.setting.tolerance * max(1.0, abs(self.load(fields)))
        panels = adapted(self, fields, allowed)
        if panels is None:
            return None
        other = self.on(panels)
        return Adaptation(other, self.carried(x, x, other), lambda vector: self.carried(vector, x, other))

    def on(self, panels: Panels) -> AdaptingProblem:
        """The same regions on other panels."""
        return AdaptingProblem(self.setting, self.layout, panels)


@dataclass(frozen=True)
class FoldEvent(Event):
    """Extrema of what is controlled along the curve, from the true tangent."""

    control: Control = LOAD
    name: str = "load"
    terminal: bool = False
    relative_resolution: ClassVar[float] = COARSE

    def primitive(self, point: Point) -> float:
        """What is controlled, up to a positive factor."""
        return self.control.weighted(point.observables["load"], point.observables["displacement"])

    def value(self, point: Point) -> float:
        """Its rate along the unit tangent."""
        return self.control.weighted(*rates(point))


def rates(point: Point) -> tuple[float, float]:
    """Rates of load and displacement along the unit tangent."""
    problem = point.problem
    assert isinstance(problem, RingProblem)
    fields = problem.fields(point.x, point.parameter)
    return problem.load_rate(fields, point.tangent_x), point.tangent_parameter


@dataclass(frozen=True)
class Violation(Event):
    """An inequality of the layout fails."""

    name: str = "breach"
    terminal: bool = True
    hidden_pairs: ClassVar[bool] = False
    relative_resolution: ClassVar[float] = COARSE

    def value(self, point: Point) -> float:
        """The least margin, at most 1."""
        problem = point.problem
        assert isinstance(problem, RingProblem)
        breach = least_margin(problem, problem.fields(point.x, point.parameter))
        return 1.0 if breach is None else min(breach.margin, 1.0)


@dataclass(frozen=True)
class Narrow(Event):
    """A region has all but vanished."""

    thresholds: tuple[float, ...] = ()
    name: str = "narrow"
    terminal: bool = True
    hidden_pairs: ClassVar[bool] = False
    relative_resolution: ClassVar[float] = 1e-3

    def value(self, point: Point) -> float:
        """The smallest width over its threshold, less 1, at most 1."""
        problem = point.problem
        assert isinstance(problem, RingProblem)
        fields = problem.fields(point.x, point.parameter)
        widths = problem.widths(fields) / fields.grid.edges[-1] if problem.edges else ()
        vanishing = [w / t - 1 for w, t in zip(widths, self.thresholds, strict=True) if t > 0]
        return min(1.0, *vanishing) if vanishing else 1.0


class Reached(Event):
    """What is controlled, or the contact radius, reaches a value.

    Parameters
    ----------
    control : Control or None
        Reduced units; None: the contact radius.
    target : float
        Value of ``control.weighted(load, displacement)``, or of the radius.
    """

    name = "end"
    terminal = True
    hidden_pairs = False
    relative_resolution = 1e-9

    def __init__(self, control: Control | None, target: float) -> None:
        self.control, self.target = control, target

    def value(self, point: Point) -> float:
        """Value minus target."""
        problem = point.problem
        assert isinstance(problem, RingProblem)
        fields = problem.fields(point.x, point.parameter)
        if self.control is None:
            return problem.contact_radius(fields) - self.target
        return self.control.weighted(problem.load(fields), point.parameter) - self.target


# -- points -----------------------------------------------------------------------------------------------------------
def unit_metric(problem: RingProblem, x: Array) -> Metric:
    """Lengths relative to the state and to the displacement's own scale."""
    return Metric(math.sqrt(problem.inner(x, x)) + 1e-300, max(problem.setting.scale, 1e-300))


def solved(problem: RingProblem, x: Array, d: float, row: tuple[Array, float] | None = None) -> tuple[Array, float]:
    """The solution near (x, d) in the plane that `row` is normal to (by default: at fixed displacement).

    Newton's method, with steps shortened so that edges move by no more than a share of the distances between them and
    the residual does not grow much: a guess at a new layout may be far from the solution.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    row = (np.zeros_like(x), 1.0) if row is None else row
    metric = unit_metric(problem, x)
    count = problem.edges
    size = math.inf
    for _ in range(APPROACHES):
        at = linearise(problem, x, d)
        dx, dd = border(problem, x, d, at, row).solve(-at[0], 0.0)
        size = metric.norm(problem, dx, dd)
        if not math.isfinite(size):
            break
        if size < NEARLY:
            done = correct(problem, x, d, row, metric, tolerance=1e-12, noise=1e6, maximum_iterations=12)
            return done.x, done.parameter
        edges = x[x.size - count :]
        room = np.diff(np.concatenate([[0.0], edges]))
        moved = np.abs(dx[x.size - count :]).max(initial=0.0)
        share = min(1.0, 0.3 * float(room.min()) / moved if moved > 0 else 1.0)
        before = float(np.abs(at[0]).max())
        for _ in range(HALVINGS):
            trial = x + share * dx, d + share * dd
            try:
                after = float(np.abs(residual(problem, *trial)).max())
            except CorrectionError:
                after = math.inf
            if after < GROWS * before:
                break
            share /= 2
        x, d = trial
    raise CorrectionError(Outcome.START_FAILED, f"(Newton's last correction was {size:.2g} of the state.)")


def oriented(problem: RingProblem, x: Array, d: float, direction: tuple[Array, float]) -> Point:
    """The point with its unit tangent, along the direction given rather than against it."""
    u, a, _ = tangent_at(problem, x, d)
    metric = unit_metric(problem, x)
    sign = 1.0 if metric.dot(problem, u, a, *direction) >= 0 else -1.0
    size = sign * metric.norm(problem, u, a)
    return annotated(Point(problem, x, d, u / size, a / size), label="start")


def follow_leg(start: Point, events: list[Event], stop: StopAt, step: float) -> Branch:
    """Follow a layout's curve from a point along its tangent; `step`: length of the first step, as the edges move.

    Without edges the step is one of displacement, and pressures far below the interaction's own do not shorten steps.
    """
    problem = start.problem
    assert isinstance(problem, RingProblem)
    u = math.sqrt(problem.inner(start.tangent_x, start.tangent_x))
    state = 20 * step
    options = STEPS
    if problem.edges == 0:
        options = replace(STEPS, state_floor=STATE_FLOOR / problem.setting.scale)
        parameter = 20 * step
        state = max(u / max(abs(start.tangent_parameter), 1e-300) * parameter, 1e-300)
    else:
        parameter = max(state * abs(start.tangent_parameter) / max(u, 1e-300), 1e-9)
    return follow(start, Balance(state, parameter), Range(-math.inf, math.inf), options, events, stop)


def thresholds(problem: RingProblem, x: Array) -> tuple[float, ...]:
    """Widths below which regions vanish, in shares of the outermost edge; 0 for a region that cannot vanish."""
    edges = x[x.size - problem.edges :]
    shares = np.diff(np.concatenate([[0.0], edges])) / edges[-1] if len(edges) else np.zeros(0)
    found = []
    for k, share in enumerate(shares):
        if problem.layout.without(k) is not None:
            found.append(float(min(NARROWEST, NARROW * share)))
        elif problem.layout.collapsed(k) is not None:
            found.append(float(min(NARROW_RING, NARROW * share)))
        else:
            found.append(0.0)
    return tuple(found)


def located(branch: Branch, name: str) -> Point | None:
    """The event with which a leg ended, if it has that name."""
    last = branch.events[-1][0] if branch.events else None
    return last.point if isinstance(last, EventPoint) and last.name == name else None
