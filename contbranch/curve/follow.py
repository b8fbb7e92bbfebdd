"""`follow`: an event of a diagram as a curve in a second parameter, whatever the model that found it."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from contbranch.contact.family import Family, Vary, family_of, value_of
from contbranch.contact.units import Quantity, accuracy_of
from contbranch.continuation import Point
from contbranch.control import Control, as_control
from contbranch.curve.augmented import Condition
from contbranch.curve.event_curve import EventCurve
from contbranch.curve.events import Margin
from contbranch.curve.outcome import Origin
from contbranch.curve.problem import EquilibriumProblem, equilibrium
from contbranch.curve.symmetry import SymmetryEvent
from contbranch.errors import InputError
from contbranch.results.diagram import Cost, Event, ModelChoice
from contbranch.results.followed import Followed
from contbranch.results.record import OBSERVABLES
from contbranch.threads import one_thread
from contbranch.watch import Progress, kept, over, told, watched

__all__ = ["follow", "followed"]

FOLLOWED = ("fold", "touch", "topology", "symmetry")


@one_thread
def follow(
    event: Event,
    vary: Vary = "tabor",
    to: Quantity | Sequence[Quantity] = 1.0,
    *,
    start: float | None = None,
    accuracy: float = 1e-6,
    progress: Progress | None = None,
    time_limit: float | None = None,
) -> Followed:
    """Follow an event of a traced diagram in a parameter of its contact: codimension two.

    Parameters
    ----------
    event : Event
        A fold, first touch, change of the contact set or loss of symmetry, taken from ``diagram.events``.
    vary : str or callable
        ``"tabor"``, ``"share"`` (of the second of two laws), ``"stiffness"`` (of the spring), ``"modulus"``,
        ``"tip.radius"``, ``"interaction[0].range"`` and the like, or a function that returns the contact for a number.
        Everything else stays fixed, in fixed units: those of the event's contact.
    to : float or pair of floats
        Value of the parameter, in the contact's units or a text such as ``"2 nm"``, at which the curve ends (stiffness:
        0 and infinity are load and displacement control); two values, one below and one above the present one, follow
        the event both ways.
    start : float, optional
        Present value of the parameter of a function.
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units.
    progress : callable, optional
        Called as ``progress(fraction, text)`` now and then; see `trace`.
    time_limit : float, optional
        Seconds after which the curve is given as far as it is known; see `trace`.

    Returns
    -------
    Followed
        The curve, its special points, and `at`, which solves for the event at any one value.

    Raises
    ------
    InputError
        If an argument cannot be used.
    ModelError
        If the event is not found again.
    """
    origin, _ = _origin(event)
    accuracy_of(accuracy)
    present = event.stiffness if vary == "stiffness" and start is None else start
    values = tuple(to) if isinstance(to, Sequence) and not isinstance(to, str) else (to,)
    if not 1 <= len(values) <= 2:
        raise InputError(f"to: {len(values)} values; give one, or one below and one above the present one")
    goals = tuple(value_of(origin.contact, vary, value, "to") for value in values)
    family = family_of(origin.contact, vary, goals[0], present, event.control)
    values = _ordered(family, goals)
    with watched(progress, time_limit) as watch:
        found = followed(event, family, values, accuracy)
    return watch.passed(found)


@one_thread
def followed(event: Event, family: Family, goals: tuple[float, ...], accuracy: float) -> Followed:
    """Follow an event in a family that starts at its own contact, to one value or to one on each side.

    Raises
    ------
    InputError
        If the event cannot be followed.
    ModelError
        If it is not found again.
    """
    began = time.perf_counter()
    origin, place = _origin(event)
    control, edge = None, None
    what: SymmetryEvent | Margin | None = None
    if event.kind == "fold":
        named = Control("spring", event.stiffness) if event.stiffness is not None else as_control(event.control)
        control = named.scaled(origin.contact.scales.stiffness)
    if event.kind == "symmetry" and origin.raw.mode is not None:
        what = SymmetryEvent(origin.raw.mode, origin.raw.index)
    elif event.kind == "topology" and origin.raw.margin:
        what = Margin(origin.raw.margin)
    elif control is None or place.parameter in equilibrium(place).parameter_range:
        edge = place.parameter
    work = equilibrium(place).work
    before = work.newton
    curve = EventCurve(Condition(family, control, what, edge), goals, accuracy)
    kept(lambda: curve.trace(place), None)
    columns = {family.name: "value", **{key: key for key in OBSERVABLES}}
    return Followed(
        parameter=family.name,
        curve={name: np.array([getattr(row, key) for row in curve.rows]) for name, key in columns.items()},
        error={key: np.array([row.error[key] for row in curve.rows]) for key in OBSERVABLES},
        special=curve.special,
        event=event,
        contact=family.contact,
        model=ModelChoice(origin.model, f"The event was found in the {origin.model} model.", work.unknowns),
        cost=Cost(time.perf_counter() - began, work.newton - before),
        accuracy=accuracy,
        status="complete" if curve.complete and not over() else "incomplete",
        message=told(curve.message),
        unit_names=family.contact.units.names,
        solver=one_thread(lambda value: curve.at(value_of(family.contact, family.name, value, "value"))),
    )


def _origin(event: Event) -> tuple[Origin, Point]:
    """What an event was found in, and where."""
    if not isinstance(event, Event):
        raise InputError(f"event: {type(event).__name__}; must be an event of a diagram, such as diagram.events[0]")
    if event.kind not in FOLLOWED:
        raise InputError(
            f"event: {event.kind}; only folds, first touch, changes of the contact set and losses of "
            "symmetry can be followed"
        )
    origin = event.origin
    place = origin.raw.point if isinstance(origin, Origin) else None
    if not isinstance(origin, Origin) or place is None or type(equilibrium(place)).member is EquilibriumProblem.member:
        raise InputError(
            "event: its state is not kept, for it was loaded or found on a grid; only an event of a fresh trace by the "
            "exact or axisymmetric model can be followed"
        )
    if origin.contact.interaction is None:
        raise InputError("event: without interaction first touch stays at zero load and displacement")
    return origin, place


def _ordered(family: Family, goals: tuple[float, ...]) -> tuple[float, ...]:
    """The values asked for, without the present one; their members must exist."""
    for value in goals:
        if family.spacing == "angle":
            if not value >= 0.0:
                raise InputError(f"to: {value:g}; a stiffness must be at least 0, or infinite")
        elif family.spacing == "logarithmic" and not value / family.start > 0.0:
            raise InputError(f"to: {value:g}; must have the sign of the present {family.name}, {family.start:g}")
        else:
            try:
                family.member(value)
            except InputError as error:
                raise InputError(f"to: {value:g}; {str(error).removeprefix('vary: ')}") from error
    other = tuple(value for value in dict.fromkeys(goals) if not math.isclose(value, family.start))
    if not other:
        raise InputError(f"to: {goals[0]:g}; is the present value of {family.name}, give another one")
    if len(other) == 2 and not min(other) < family.start < max(other):
        raise InputError(
            f"to: {other[0]:g}, {other[1]:g}; the present {family.name}, {family.start:g}, does not lie between them"
        )
    return other
