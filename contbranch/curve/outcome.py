"""What every model hands over, in reduced units, and how it becomes a Diagram in the contact's own units."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.law_check import jumping
from contbranch.contact.tips import Parabola
from contbranch.contact.units import Scales
from contbranch.continuation import CorrectionError
from contbranch.control import Control, Spring, as_control
from contbranch.curve.naming import fold_name, number_layers, signs_of, tell_apart, threshold_events
from contbranch.curve.problem import equilibrium
from contbranch.curve.refine import Found
from contbranch.errors import InputError
from contbranch.results.diagram import Branch, Cost, Diagram, Event, Exponent, LocalExponent, ModelChoice, State
from contbranch.results.profile import ModeShape
from contbranch.results.record import OBSERVABLES, Record, later
from contbranch.threads import one_thread
from contbranch.watch import over

__all__ = [
    "RawCurve", "RawEvent", "assemble", "fold_names", "measured", "no_curve", "not_followed", "state_in_reduced",
    "state_in_units", "unit_of_control",
]  # fmt: skip

# Tabor coefficients below which curves of repulsion and of attraction are followed to their end.
STIFFEST = 128, 1000
Kind = TypeVar("Kind", bound=Record)


@dataclass(frozen=True, kw_only=True)
class RawEvent(Found):
    """An event in reduced units, with the point of the model from which it can be followed.

    Attributes
    ----------
    kind : str
    row : int
        Its row among the curve's.
    control : str or None
        Of a fold.
    stable : bool
        Whether a stable part of the curve ends here under the control (folds).
    maximum : bool
        Whether the control has a maximum here (folds).
    message : str
    name : str or None
    stiffness : float or None
        Of the spring (folds of a spring).
    margin : str
        Of the point's problem, which vanishes there; empty for a fold, and where its parameter is known.
    position : float or None
        Place on the curve in units of rows, where it is not the row.
    mode, index, mode_shape : int, int, ModeShape
        The azimuthal mode, which of its eigenvalues, and the shape (symmetry).
    exponent, local_exponent : callable
        Deferred, since they cost further solutions.
    verdict : str or None
        Of a fold on a grid, see `Event`.
    """

    kind: str
    row: int
    control: str | None = None
    stable: bool = False
    maximum: bool = False
    message: str = ""
    name: str | None = None
    stiffness: float | None = None
    margin: str = ""
    position: float | None = None
    mode: int | None = None
    index: int = 1
    mode_shape: ModeShape | None = None
    exponent: Callable[[], Exponent | None] | None = None
    local_exponent: Callable[[], LocalExponent] | None = None
    verdict: str | None = None


@dataclass(frozen=True)
class RawCurve:
    """One connected curve in reduced units.

    Attributes
    ----------
    branch : Branch
        Its rows.
    events : sequence of RawEvent
    complete : bool
    message : str
    cost : Cost
    unknowns : int
    doubtful : bool
        Whether rows and events contradict each other.
    others : sequence of RawCurve
        Branches that leave the curve. Their folds bear no names and set no thresholds; their messages and costs are
        already in those of the curve.
    """

    branch: Branch
    events: Sequence[RawEvent]
    complete: bool
    message: str
    cost: Cost
    unknowns: int
    doubtful: bool = False
    others: Sequence[RawCurve] = ()


def no_curve(message: str = "", cost: Cost | None = None, unknowns: int = 0) -> RawCurve:
    """A curve without rows."""
    empty, none = np.empty(0), np.empty(0, dtype=np.int64)
    branch = Branch(*(empty,) * 5, none, none, load_error=empty, displacement_error=empty, unstable_spring=none)
    return RawCurve(branch, (), False, message, cost or Cost(0.0, 0), unknowns)


@dataclass(frozen=True)
class Origin:
    """What an event was found in: its contact, the raw event with its place in the model, and the model's name."""

    contact: Contact
    raw: RawEvent
    model: str


def measured(values: Sequence[float], scales: Scales) -> dict[str, Any]:
    """The four observables by name, from reduced units to those of a contact."""
    units = scales.of_fields
    return {name: float(value) * units[name] for name, value in zip(OBSERVABLES, values, strict=True)}


def in_units(record: Kind, scales: Scales, convert: Callable[[Any, float], Any] = operator.mul) -> Kind:
    """A record with all its quantities, and those of what it holds, in a contact's units; with division, in reduced."""
    units = scales.of_fields

    def converted(name: str, value: Any) -> Any:
        if isinstance(value, Record):
            return in_units(value, scales, convert)
        if isinstance(value, Mapping):
            return {key: converted(key, one) for key, one in value.items()}
        if isinstance(value, tuple | list):
            return [converted(name, one) for one in value]
        if callable(value):
            return lambda: converted(name, value())
        return value if value is None or name not in units else convert(value, units[name])

    held = {item.name: record.__dict__[item.name] for item in fields(record)}
    return replace(record, **{name: converted(name.removesuffix("_error"), value) for name, value in held.items()})


def state_in_units(contact: Contact, state: State) -> State:
    """A reduced state in the contact's own units."""
    return in_units(state, contact.scales)


def state_in_reduced(contact: Contact, state: State) -> State:
    """A state of a contact in reduced units, with its fields on a cell but no others; a start for a grid model."""
    return in_units(replace(state, error={}, profile=None), contact.scales, operator.truediv)


def unit_of_control(scales: Scales, control: str | None) -> float:
    """Unit of what is controlled: the position of a spring's end is a length."""
    return scales.load if control in (None, "load") else scales.normal


def _exponent(scales: Scales, exponent: Exponent | None, control: str | None) -> Exponent | None:
    if exponent is None:
        return None
    unit, order = unit_of_control(scales, control), scales.of_fields[exponent.order_parameter]
    window, crossover, prefactor = exponent.window, exponent.crossover_load, exponent.prefactor
    if window is not None:
        amplitude = window.prefactor * order / unit**window.kappa
        window = replace(window, start=window.start * unit, stop=window.stop * unit, prefactor=amplitude)
    return replace(
        exponent,
        crossover_load=None if crossover is None else crossover * unit,
        window=window,
        prefactor=None if prefactor is None else prefactor * order / unit**exponent.kappa,
    )


def _local_exponent(scales: Scales, raw: RawEvent, name: str) -> LocalExponent:
    """The local exponent of an event.

    Raises
    ------
    InputError
        If it has none.
    """
    if raw.local_exponent is None:
        raise InputError(f"event: this {name} has no exponent: it is a corner, or nodes' own")
    found = raw.local_exponent()
    order = "contact_radius" if raw.numbers[2] > 0 or raw.kind == "touch" else "central_gap"
    return replace(
        found,
        excess=found.excess * unit_of_control(scales, raw.control),
        order_parameter=found.order_parameter * scales.of_fields[order],
    )


def fold_names(contact: Contact, events: Sequence[RawEvent]) -> list[str | None]:
    """Names of events, None for those without."""
    names, signs = [], signs_of(contact.interaction)
    for raw in events:
        name = raw.name
        artefact = raw.verdict in ("vanishes", "unresolved")
        if raw.kind == "fold" and name is None and raw.stable and not artefact:
            name = fold_name(signs, raw.control, raw.numbers[0], raw.maximum)
        names.append(name)
    controls = [raw.control for raw in events]
    numbered = number_layers(names, controls, contact.interaction)
    return tell_apart(numbered, controls, [(raw.numbers[0], raw.numbers[1]) for raw in events])


def _event(contact: Contact, raw: RawEvent, name: str | None, branch: int, model: str) -> Event:
    scales, shape, source = contact.scales, raw.mode_shape, raw.exponent
    if shape is not None:
        slope = scales.pressure / scales.normal
        shape = replace(shape, r=shape.r * scales.in_plane, pressure=shape.pressure * slope)
    return Event(
        **{key: getattr(raw, key) for key in ("kind", "control", "message", "mode", "verdict")},
        **measured(raw.numbers, scales),
        error=measured(raw.error, scales),
        name=name,
        stiffness=None if raw.stiffness is None else raw.stiffness * scales.stiffness,
        branch=branch,
        position=float(raw.row) if raw.position is None else raw.position,
        mode_shape=shape,
        origin=Origin(contact, raw, model),
        critical=None if source is None else one_thread(lambda: _exponent(scales, source(), raw.control)),
    )


def assemble(contact: Contact, curve: RawCurve, choice: ModelChoice, control: Control, accuracy: float) -> Diagram:
    """The diagram of a curve: events named, thresholds collected, everything in the contact's own units."""
    curves = [curve, *curve.others]
    names = [fold_names(contact, curve.events)]
    names += [[None] * len(other.events) for other in curve.others]
    raws = [(raw, name, k) for k, own in enumerate(curves) for raw, name in zip(own.events, names[k], strict=True)]
    events = tuple(_event(contact, *raw, choice.kind) for raw in raws)
    repulsive = signs_of(contact.interaction) == (False, True)
    named = threshold_events(events[: len(curve.events)], repulsive) if curve.complete or events else {}
    sampled: dict[int, LocalExponent] = {}

    @one_thread
    def local_exponents(event: Event) -> LocalExponent:
        number = events.index(event)
        name = event.name or event.kind
        found = sampled.get(number) or _local_exponent(contact.scales, raws[number][0], name)
        return found if over() else sampled.setdefault(number, found)  # what has ended early is sampled again

    return Diagram(
        contact=contact,
        branches=tuple(in_units(own.branch, contact.scales) for own in curves),
        events=events,
        thresholds={name: getattr(event, key) for name, (event, key) in named.items()},
        model=choice,
        cost=curve.cost,
        control=control.kind,
        stiffness=control.spring_stiffness,
        accuracy=accuracy,
        status="complete" if curve.complete else "incomplete",
        message=f"{curve.message}{'' if curve.complete else not_followed(contact)}",
        description=contact.describe(),
        unit_names=contact.units.names,
        local_exponents=local_exponents,
        sensitivities=later(one_thread(lambda: _sensitivities(contact, named, accuracy))),
    )


def not_followed(contact: Contact) -> str:
    """What holds in the limit of stiff interactions, or which law's pressure jumps; empty for what is followed."""
    if jump := jumping(contact.interaction):
        return f" {jump}"
    tabor, terms = contact.tabor or 0.0, terms_of(contact.interaction)
    adhesive = sum(term.work_of_adhesion for term in terms) > 0
    most, limit = STIFFEST[adhesive], "JKR's (contbranch.theory.jkr)" if adhesive else "Hertz'"
    simple = len(terms) == 1 and not math.isfinite(terms[0].wave) and isinstance(contact.tip, Parabola)
    if tabor < most or not simple:  # of others the limit is another, or not known
        return ""
    return f" Stiffer than what is followed to its end (μ_T = {tabor:.3g}, up to {most}): take the limit, {limit}."


def _sensitivities(
    contact: Contact, thresholds: Mapping[str, tuple[Event, str]], accuracy: float
) -> dict[str, dict[str, float]] | None:
    """Derivatives of the thresholds by parameter, in the contact's units, unknown where the curve cannot be followed
    next to an event; None where the model knows no other contacts on the same discretisation."""
    from contbranch.curve.sensitivity import Sensitivities

    sensitivities: Sensitivities | None = None
    known: dict[int, dict[str, dict[str, float]]] = {}
    for event, _ in thresholds.values():
        place = event.origin.raw.point
        if not equilibrium(place).has_family:
            return None
        if id(event) not in known:
            driven = event.control if event.stiffness is None else Spring(event.stiffness)
            control = None if driven is None else as_control(driven)
            wanted = {key for other, key in thresholds.values() if other is event}
            sensitivities = sensitivities or Sensitivities(contact, accuracy)
            try:
                known[id(event)] = sensitivities.at(place, control, event.origin.raw.margin, wanted)
            except CorrectionError:
                known[id(event)] = {key: dict.fromkeys(sensitivities.values, math.nan) for key in wanted}
    return {name: known[id(event)][key] for name, (event, key) in thresholds.items()}
