"""What every model hands over, in reduced units, and how it becomes a Diagram in the contact's own units."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbranch.contact.contact import Contact
from contbranch.control import Control
from contbranch.curve.naming import fold_name, number_layers, thresholds
from contbranch.errors import InputError
from contbranch.results.diagram import (
    Branch,
    CellFields,
    Cost,
    Diagram,
    Event,
    Exponent,
    LocalExponent,
    ModelChoice,
    ModeShape,
    Profile,
    State,
    Window,
)
from contbranch.threads import one_thread

__all__ = ["RawCurve", "RawEvent", "assemble", "fold_names", "state_in_reduced", "state_in_units"]

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class RawEvent:
    """An event in reduced units.

    Attributes
    ----------
    row : int
        Its row among the curve's.
    before, after : int
        Morse indices under its control on both sides along the curve (folds).
    lost_on_increase : bool
        Whether the control has a maximum here (folds).
    stiffness : float or None
        Of the spring (folds of a spring).
    position : float or None
        Place on the curve in units of rows, where it is not the row.
    mode, index, mode_shape : int, int, ModeShape
        The azimuthal mode, which of its eigenvalues, and the shape (symmetry).
    place : object
        Where the model has it, from which it can be followed; None if it cannot.
    point : object
        The point of the curve, where the model has it but cannot follow it.
    exponent, local_exponent : callable
        Deferred, since they cost further solutions.
    verdict : str or None
        Of a fold on a grid, see `Event`.
    """

    kind: str
    row: int
    values: tuple[float, float, float, float]
    error: tuple[float, float, float, float]
    control: str | None = None
    before: int = 0
    after: int = 0
    maximum: bool = False
    message: str = ""
    name: str | None = None
    stiffness: float | None = None
    place: Any = None
    point: Any = None
    position: float | None = None
    mode: int | None = None
    index: int = 1
    mode_shape: ModeShape | None = None
    exponent: Callable[[], Exponent | None] | None = None
    local_exponent: Callable[[], LocalExponent] | None = None
    verdict: str | None = None


@dataclass(frozen=True)
class RawCurve:
    """One connected curve in reduced units; arrays over its rows.

    Attributes
    ----------
    row_errors : array (M, 2) or callable
        Error estimates of load and displacement, or what computes them.
    others : sequence of RawCurve
        Branches that leave the curve. Their folds bear no names and set no thresholds; their messages and costs are
        already in those of the curve.
    """

    load: Array
    displacement: Array
    contact_radius: Array
    central_gap: Array
    energy: Array
    unstable_load: Integers
    unstable_displacement: Integers
    row_errors: Array | Callable[[], Array]
    profiles: Sequence[Callable[[], Profile]]
    events: Sequence[RawEvent]
    complete: bool
    message: str
    cost: Cost
    unknowns: int
    unstable_spring: Integers | None = None
    unstable_azimuthal: Integers | None = None
    critical: Callable[[], Array] | None = None
    fft_pairs: Integers | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    others: Sequence[RawCurve] = ()

    @cached_property
    def errors(self) -> Array:
        """Error estimates of load and displacement at the rows, (M, 2)."""
        return self.row_errors() if callable(self.row_errors) else self.row_errors

    @property
    def load_error(self) -> Array:
        """Error estimates of the load, (M,)."""
        return self.errors[:, 0]

    @property
    def displacement_error(self) -> Array:
        """Error estimates of the displacement, (M,)."""
        return self.errors[:, 1]


@dataclass(frozen=True)
class Origin:
    """What an event was found in: its contact, the raw event with its place in the model, and the model's name."""

    contact: Contact
    raw: RawEvent
    model: str


class _Scaling:
    """From reduced units to a contact's."""

    def __init__(self, contact: Contact) -> None:
        scales = contact.scales
        self.load, self.normal, self.in_plane = scales.load, scales.normal, scales.in_plane
        self.energy, self.pressure = scales.energy, scales.pressure
        self.stiffness = scales.stiffness
        self.four = (self.load, self.normal, self.in_plane, self.normal)

    def values(self, reduced: Sequence[float]) -> list[float]:
        return [value * scale for value, scale in zip(reduced, self.four, strict=True)]

    def profile(self, profile: Profile) -> Profile:
        return Profile(
            profile.r * self.in_plane,
            profile.gap * self.normal,
            profile.pressure * self.pressure,
            profile.wall_pressure * self.pressure,
        )

    def cell(self, fields: CellFields) -> CellFields:
        return CellFields(
            fields.x * self.in_plane,
            fields.y * self.in_plane,
            fields.gap * self.normal,
            fields.pressure * self.pressure,
            fields.wall_pressure * self.pressure,
        )

    def mode_shape(self, shape: ModeShape) -> ModeShape:
        scale = self.pressure / self.normal
        return ModeShape(shape.mode, shape.r * self.in_plane, shape.gap, shape.pressure * scale)

    def of(self, control: str | None) -> float:
        return self.normal if control == "displacement" else self.load

    def order(self, parameter: str) -> float:
        return self.in_plane if parameter == "contact_radius" else self.normal

    def exponent(self, exponent: Exponent | None, control: str | None) -> Exponent | None:
        if exponent is None:
            return None
        scale, order, window = self.of(control), self.order(exponent.order_parameter), exponent.window
        return Exponent(
            exponent.kappa,
            None if exponent.crossover_load is None else exponent.crossover_load * scale,
            None
            if window is None
            else Window(
                window.start * scale,
                window.stop * scale,
                window.kappa,
                window.kappa_error,
                window.prefactor * order / scale**window.kappa,
            ),
            None if exponent.prefactor is None else exponent.prefactor * order / scale**exponent.kappa,
            exponent.order_parameter,
        )


def fold_names(contact: Contact, events: Sequence[RawEvent]) -> list[str | None]:
    """Names of events, None for those without."""
    names = []
    for raw in events:
        name = raw.name
        artefact = raw.verdict in ("vanishes", "unresolved")
        if raw.kind == "fold" and name is None and min(raw.before, raw.after) == 0 and not artefact:
            name = fold_name(contact.interaction, raw.control, raw.values[0], raw.maximum)
        names.append(name)
    return number_layers(names, [raw.control for raw in events], contact.interaction)


def _event(contact: Contact, scaling: _Scaling, raw: RawEvent, name: str | None, model: str) -> Event:
    load, displacement, radius, gap = scaling.values(raw.values)
    keys = ("load", "displacement", "contact_radius", "central_gap")
    source = raw.exponent
    return Event(
        kind=raw.kind,  # type: ignore[arg-type]
        load=load,
        displacement=displacement,
        contact_radius=radius,
        central_gap=gap,
        error=dict(zip(keys, scaling.values(raw.error), strict=True)),
        control=raw.control,
        name=name,
        message=raw.message,
        stiffness=None if raw.stiffness is None else raw.stiffness * scaling.stiffness,
        position=float(raw.row) if raw.position is None else raw.position,
        mode=raw.mode,
        verdict=raw.verdict,
        mode_shape=None if raw.mode_shape is None else scaling.mode_shape(raw.mode_shape),
        origin=None if raw.place is None else Origin(contact, raw, model),
        critical=None if source is None else one_thread(lambda: scaling.exponent(source(), raw.control)),
    )


def _branch(scaling: _Scaling, curve: RawCurve) -> Branch:
    return Branch(
        curve.load * scaling.load,
        curve.displacement * scaling.normal,
        curve.contact_radius * scaling.in_plane,
        curve.central_gap * scaling.normal,
        curve.energy * scaling.energy,
        curve.unstable_load,
        curve.unstable_displacement,
        lambda: curve.load_error * scaling.load,  # type: ignore[arg-type]
        lambda: curve.displacement_error * scaling.normal,  # type: ignore[arg-type]
        [lambda source=source: scaling.profile(source()) for source in curve.profiles],  # type: ignore[misc]
        curve.unstable_spring,
        curve.unstable_azimuthal,
        curve.critical,
        curve.fft_pairs,
    )


def assemble(contact: Contact, curve: RawCurve, choice: ModelChoice, control: Control, accuracy: float) -> Diagram:
    """The diagram of a curve: events named, thresholds collected, everything in the contact's own units."""
    scaling = _Scaling(contact)
    names = fold_names(contact, curve.events)
    named = zip(curve.events, names, strict=True)
    events = tuple(_event(contact, scaling, raw, name, choice.kind) for raw, name in named)
    raws = [*curve.events]
    branches = [_branch(scaling, curve)]
    for number, other in enumerate(curve.others, start=1):
        branches.append(_branch(scaling, other))
        raws += other.events
        others = (_event(contact, scaling, raw, None, choice.kind) for raw in other.events)
        events += tuple(replace(event, branch=number) for event in others)
    terms = contact.interaction.terms if contact.interaction is not None else ()
    repulsive = bool(terms) and all(term.work_of_adhesion < 0 for term in terms)

    @one_thread
    def local_exponents(event: Event) -> LocalExponent:
        raw = raws[events.index(event)]
        if raw.local_exponent is None:
            raise InputError(f"event: the curve has a corner at this {event.name or event.kind}, and no exponent")
        found = raw.local_exponent()
        parameter = "contact_radius" if raw.values[2] > 0 or raw.kind == "touch" else "central_gap"
        return LocalExponent(
            found.excess * scaling.of(raw.control),
            found.order_parameter * scaling.order(parameter),
            found.kappa,
            found.error,
        )

    return Diagram(
        contact=contact,
        branches=tuple(branches),
        events=events,
        thresholds=thresholds(events[: len(curve.events)], repulsive) if curve.complete or events else {},
        model=choice,
        cost=curve.cost,
        control=control.kind,
        stiffness=control.spring_stiffness,
        accuracy=accuracy,
        status="complete" if curve.complete else "incomplete",
        message=curve.message,
        description=contact.describe(),
        unit_names=contact.units.names,
        local_exponents=local_exponents,
    )


def state_in_units(contact: Contact, state: State) -> State:
    """A reduced state in the contact's own units."""
    scaling = _Scaling(contact)
    keys = ("load", "displacement", "contact_radius", "central_gap")
    scales = {**dict(zip(keys, scaling.four, strict=True)), "energy": scaling.energy}
    return State(
        state.load * scaling.load,
        state.displacement * scaling.normal,
        state.contact_radius * scaling.in_plane,
        state.central_gap * scaling.normal,
        state.energy * scaling.energy,
        state.unstable_load,
        state.unstable_displacement,
        state.residual,
        {key: value * scales[key] for key, value in state.error.items()},
        None if state.profile is None else scaling.profile(state.profile),
        state.unstable_spring,
        state.unstable_azimuthal,
        None if state.mean_gap is None else state.mean_gap * scaling.normal,
        None if state.in_cell is None else lambda: scaling.cell(state.cell),
    )


def state_in_reduced(contact: Contact, state: State) -> State:
    """Load, displacement and fields on a cell of a state of a contact, in reduced units; a start for a grid model."""
    scales = contact.scales
    source = state.in_cell

    def cell() -> CellFields:
        own = state.cell
        return CellFields(
            own.x / scales.in_plane,
            own.y / scales.in_plane,
            own.gap / scales.normal,
            own.pressure / scales.pressure,
            own.wall_pressure / scales.pressure,
        )

    return State(
        load=state.load / scales.load,
        displacement=state.displacement / scales.normal,
        contact_radius=state.contact_radius / scales.in_plane,
        central_gap=state.central_gap / scales.normal,
        energy=state.energy / scales.energy,
        unstable_load=state.unstable_load,
        unstable_displacement=state.unstable_displacement,
        residual=state.residual,
        in_cell=None if source is None else cell,
    )
