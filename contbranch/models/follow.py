"""`follow`: an event of a diagram as a curve in a second parameter, whatever the model."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.family import Family, Vary, family_of
from contbranch.contact.units import finite_number
from contbranch.continuation import Event as LocatedEvent
from contbranch.control import Control, as_control
from contbranch.curve.outcome import Origin
from contbranch.errors import InputError
from contbranch.models.axisymmetric.locate import Place
from contbranch.models.axisymmetric.symmetry import SymmetryEvent
from contbranch.models.axisymmetric.two_parameters import follow_event
from contbranch.models.event_curve import RawEventCurve, RawPoint, RawSpecial
from contbranch.models.exact.follow import follow_exact
from contbranch.models.exact.results import ExactEvent
from contbranch.models.run import COARSEST, FINEST
from contbranch.results.diagram import Cost, Event, ModelChoice
from contbranch.results.followed import Followed, FollowedPoint, Special
from contbranch.threads import one_thread

__all__ = ["follow", "follow_in"]

Progress = Callable[[float, str], None]

KEYS = ("load", "displacement", "contact_radius", "central_gap")
FOLLOWED = ("fold", "touch", "symmetry")


@one_thread
def follow(
    event: Event,
    vary: Vary = "tabor",
    to: float | Sequence[float] = 1.0,
    *,
    start: float | None = None,
    accuracy: float = 1e-6,
    progress: Progress | None = None,
) -> Followed:
    """Follow an event of a traced diagram in a parameter of its contact: codimension two.

    Parameters
    ----------
    event : Event
        A fold, first touch or loss of symmetry, taken from ``diagram.events``.
    vary : str or callable
        ``"tabor"``, ``"share"`` (of the second of two laws), ``"stiffness"`` (of the spring), ``"modulus"``,
        ``"tip.radius"``, ``"interaction[1].range"`` and the like, or a function that returns the contact for a number.
        Everything else stays fixed, in fixed units: those of the event's contact.
    to : float or pair of floats
        Value of the parameter, in the contact's units, at which the curve ends (stiffness: 0 and infinity are load and
        displacement control); two values, one below and one above the present one, follow the event both ways.
    start : float, optional
        Present value of the parameter of a function.
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units.
    progress : callable, optional
        Called as ``progress(fraction, text)`` now and then.

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
    origin = _origin(event)
    if not FINEST <= finite_number(accuracy, "accuracy") <= COARSEST:
        raise InputError(f"accuracy: {accuracy:g}; must lie between {FINEST:g} and {COARSEST:g}")
    present = event.stiffness if vary == "stiffness" and start is None else start
    goals = _goals(to, vary)
    family = family_of(origin.contact, vary, goals[0], present, event.control)
    return follow_in(event, family, _ordered(family, goals), accuracy, progress)


@one_thread
def follow_in(
    event: Event, family: Family, goals: tuple[float, ...], accuracy: float, progress: Progress | None = None
) -> Followed:
    """Follow an event in a family that starts at its own contact, to one value or to one on each side.

    Raises
    ------
    InputError
        If the event cannot be followed.
    ModelError
        If it is not found again.
    """
    began = time.perf_counter()
    origin = _origin(event)
    contact, place = origin.contact, origin.raw.place
    control = _control(event)
    if isinstance(place, ExactEvent):
        raw = follow_exact(family, place, control, goals)
        choice = ModelChoice("exact", "The event was found in closed form.", raw.unknowns)
    elif isinstance(place, Place):
        what: Control | LocatedEvent | None = None if control is None else control.scaled(contact.scales.stiffness)
        if event.kind == "symmetry" and origin.raw.mode is not None:
            what = SymmetryEvent(origin.raw.mode, origin.raw.index)
        raw = follow_event(family, place, what, goals, accuracy, progress)
        choice = ModelChoice("axisymmetric", "The event was found in the axisymmetric model.", raw.unknowns)
    else:
        raise InputError(f"event: {event.kind}; the model that found it cannot follow it")
    cost = Cost(time.perf_counter() - began, raw.newton)
    return _followed(family, event, raw, choice, cost, accuracy)


def _origin(event: Event) -> Origin:
    if not isinstance(event, Event):
        raise InputError(f"event: {type(event).__name__}; must be an event of a diagram, such as diagram.events[0]")
    if event.kind not in FOLLOWED:
        raise InputError(f"event: {event.kind}; only folds, first touch and losses of symmetry can be followed")
    if not isinstance(event.origin, Origin):
        raise InputError(
            "event: its state is not kept, for it was loaded, found on a grid, or its contact set is not a disc (as of "
            "repulsive maugis-dugdale laws); only an event of a fresh trace by the exact or axisymmetric model, with a "
            "disc or without contact, can be followed"
        )
    if event.origin.contact.interaction is None:
        raise InputError("event: without interaction first touch stays at zero load and displacement")
    return event.origin


def _goals(to: float | Sequence[float], vary: Vary) -> tuple[float, ...]:
    values = tuple(to) if isinstance(to, Sequence) else (to,)
    if not 1 <= len(values) <= 2:
        raise InputError(f"to: {len(values)} values; give one, or one below and one above the present one")
    return tuple(float(v) if vary == "stiffness" else finite_number(v, "to") for v in values)


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
    other = tuple(value for value in dict.fromkeys(goals) if value != family.start)
    if not other:
        raise InputError(f"to: {goals[0]:g}; is the present value of {family.name}, give another one")
    if len(other) == 2 and not min(other) < family.start < max(other):
        raise InputError(
            f"to: {other[0]:g}, {other[1]:g}; the present {family.name}, {family.start:g}, does not lie between them"
        )
    return other


def _control(event: Event) -> Control | None:
    """The control of a fold, in the contact's units."""
    if event.kind != "fold":
        return None
    if event.control == "spring":
        assert event.stiffness is not None
        return Control("spring", event.stiffness)
    return as_control(event.control)


def _followed(
    family: Family, event: Event, raw: RawEventCurve, choice: ModelChoice, cost: Cost, accuracy: float
) -> Followed:
    points, special = raw.points, raw.special
    last = len(points) - 1
    turned = raw.start == last  # the curve begins at the event
    if turned:
        points = points[::-1]
        special = tuple(sorted((_turned(one, last) for one in special), key=lambda one: one.index))

    def at(value: float) -> tuple[FollowedPoint, ...]:
        found = [_point(family, point) for point in raw.at(float(value))]
        return tuple(found[::-1] if turned else found)

    curve = {family.name: np.array([point.value for point in points])}
    error = {}
    for k, key in enumerate(KEYS):
        curve[key] = np.array([point.numbers[k] for point in points])
        error[key] = np.array([point.error[k] for point in points])
    contact: Contact = family.contact
    return Followed(
        parameter=family.name,
        curve=curve,
        error=error,
        special=tuple(_special(family, one) for one in special),
        event=event,
        contact=contact,
        model=choice,
        cost=cost,
        accuracy=accuracy,
        status="complete" if raw.complete else "incomplete",
        message=raw.message,
        unit_names=contact.units.names,
        solver=one_thread(at),
    )


def _turned(one: RawSpecial, last: int) -> RawSpecial:
    return RawSpecial(one.kind, last - one.index, one.point, one.value_error, one.control, one.message)


def _error(family: Family, point: RawPoint, of_value: float) -> dict[str, float]:
    return {family.name: of_value, **dict(zip(KEYS, point.error, strict=True))}


def _point(family: Family, point: RawPoint) -> FollowedPoint:
    return FollowedPoint(family.name, point.value, *point.numbers, _error(family, point, 0.0))


def _special(family: Family, one: RawSpecial) -> Special:
    return Special(
        family.name,
        one.point.value,
        *one.point.numbers,
        _error(family, one.point, one.value_error),
        kind=one.kind,
        index=one.index,
        control=one.control,
        message=one.message,
    )
