"""The whole curve of an axisymmetric contact: far away, through first touch, to a load in contact."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contbranch.contact.contact import Contact
from contbranch.continuation import Curve, Event, Options, Outcome, Point, StopAt, trace_curve
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.stability import Indices
from contbranch.errors import InputError, ModelError
from contbranch.models.old_rings.handover import joined
from contbranch.models.old_rings.journey import Target as RingTarget
from contbranch.results.diagram import Cost

from .adapt import start_edges
from .azimuthal import LARGEST_MODE
from .equations import ContactCoordinate, Equations
from .located import ROW_FLOOR, ROW_SAFETY, TRACE_TOLERANCE, Located
from .mesh import Mesh
from .problem import COARSE, ContactProblem, ControlReached, FoldEvent, InadmissibleEvent, Resolution

__all__ = ["Target", "Traced", "order_for", "trace"]

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

# Where the rows of a trace count themselves, in integrals along the curve, they are finer, as far as round-off allows.
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
    tip, law = contact.axisymmetric_tip, contact.interaction
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
    tip = contact.axisymmetric_tip
    low, high = 0.0, 1.0
    while high < tip.extent and float(tip.height(np.float64(high))) < height:
        low, high = high, 2 * high
    high = min(high, tip.extent)
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if float(tip.height(np.float64(middle))) < height else (low, middle)
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
        located = Located(*_legs(problem, u, target, controls, progress, COARSE if events else FINE), controls)
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
