"""A contact as a function of one number: Tabor coefficient, a parameter of tip or law, a share, a spring's stiffness.

Along a family the units stay those of the contact it starts from: reduced units are those scales, too, and are not made
anew for every member.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.parameters import Parameter, numbers_of, with_number
from contbranch.contact.units import Scales, finite_number, positive_number
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.errors import InputError, nearest

Vary = str | Callable[[float], Contact]

# In contact files the modulus stands in a table of that name.
_MATERIAL = "material."
# A value in its unit as coordinate, the value at a coordinate, and its derivative.
_SPACINGS: dict[str, tuple[Callable[[float], float], ...]] = {
    "logarithmic": (math.log, math.exp, math.exp),
    "angle": (
        math.atan,
        lambda angle: math.tan(angle) if angle < 0.5 * math.pi else math.inf,
        lambda angle: max(math.cos(angle), 1e-150) ** -2,
    ),
    "linear": (float, float, lambda _: 1.0),
}


@dataclass(frozen=True)
class Family:
    """Contacts with one parameter, and a coordinate of that parameter in which equal steps matter equally.

    Attributes
    ----------
    name : str
        Of the parameter, as it is reported.
    start : float
        Its value at the contact from which the family starts, in that contact's units.
    contact : Contact
        That contact.
    member : callable
        The contact at a value of the parameter.
    spacing : {"logarithmic", "linear", "angle"}
        Coordinate: ln|value|, the value, or the angle arctan K of a stiffness in reduced units.
    """

    name: str
    start: float
    contact: Contact
    member: Callable[[float], Contact]
    spacing: Literal["logarithmic", "linear", "angle"]

    @property
    def _unit(self) -> float:
        return {"logarithmic": self.start, "angle": self.contact.scales.stiffness, "linear": 1.0}[self.spacing]

    def coordinate(self, value: float) -> float:
        """The coordinate of a value; a stiffness may be 0 or infinite."""
        return _SPACINGS[self.spacing][0](value / self._unit)

    def value(self, coordinate: float) -> float:
        """The value at a coordinate."""
        return self._unit * _SPACINGS[self.spacing][1](coordinate)

    def rate(self, coordinate: float) -> float:
        """Derivative of the value with respect to the coordinate."""
        return self._unit * _SPACINGS[self.spacing][2](coordinate)

    def control(self, coordinate: float, control: Control) -> Control:
        """The control at a coordinate (reduced units): a spring of that stiffness, or the one given."""
        if self.spacing != "angle":
            return control.scaled(self.member(self.value(coordinate)).modulus / self.contact.modulus)
        if 0.0 < coordinate < 0.5 * math.pi:
            return Control("spring", math.tan(coordinate))
        return LOAD if coordinate <= 0.0 else DISPLACEMENT

    def scales(self, contact: Contact) -> Scales:
        """Units of the start, with the member's own modulus."""
        start = self.contact.scales
        return Scales(start.in_plane, start.normal, contact.modulus)

    def reduced(self, coordinate: float) -> tuple[Contact, Scales]:
        """A member in the units of the start, in which its modulus is 1, and those units."""
        contact = self.contact if self.spacing == "angle" else self.member(self.value(coordinate))
        scales = self.scales(contact)
        law = contact.interaction
        scaled = None if law is None else law.scaled(scales.normal, scales.energy_per_area)
        body = None if contact.body is None else contact.body.scaled(scales.in_plane, scales.modulus)
        return Contact(contact.axisymmetric_tip.scaled(scales.in_plane, scales.normal), scaled, body=body), scales


def family_of(
    contact: Contact, vary: Vary, to: float, start: float | None = None, control: str | None = None
) -> Family:
    """The family that a user names.

    Parameters
    ----------
    contact : Contact
        Where it starts.
    vary : str or callable
        ``"tabor"`` (all lengths of the interaction scaled by one factor), ``"share"`` (β of a sum of two laws,
        (1 − β)·law₁ + β·law₂, each at the full amplitude |Δγ₁| + |Δγ₂|), ``"stiffness"`` (of a spring), ``"modulus"``,
        ``"tip.radius"`` and the like, ``"interaction[1].range"`` and the like, laws counted from 0
        (``"interaction.range"`` for a single one), or a function of one number that returns a contact.
    to : float
        Where it is to end; a value of the other sign than the present one needs steps that are not relative.
    start : float, optional
        Present value of the parameter of a function; required for one, and only for one.
    control : str, optional
        Control of the event; a load fold starts at the stiffness 0, a displacement fold at infinity.

    Raises
    ------
    InputError
        If the contact has no such parameter, or a value cannot be used.
    """
    if callable(vary):
        return _own(contact, vary, start)
    if not isinstance(vary, str):
        raise InputError(f"vary: {type(vary).__name__}; must be the name of a parameter or a function")
    vary = vary.removeprefix(_MATERIAL)
    if vary == "stiffness":
        return Family(vary, _stiffness(start, control), contact, lambda _: contact, "angle")
    if start is not None:
        raise InputError(f"start: {start:g}; the present value of {vary} is known, leave it out")
    if vary == "share":
        return _share(contact)
    own = _named(contact, vary)
    if vary in ("tabor", "modulus"):
        positive_number(to, "to")
    # a phase may change sign, or be zero: steps in it are not relative
    relative = not vary.endswith(".phase") and own.value * finite_number(to, "to") > 0
    return Family(vary, own.value, contact, own.contact, "logarithmic" if relative else "linear")


def _own(contact: Contact, vary: Callable[[float], Contact], start: float | None) -> Family:
    if start is None:
        raise InputError("start: missing; give the present value of the parameter that the function takes")

    def member(value: float) -> Contact:
        try:
            found = vary(value)
        except InputError:
            raise
        except Exception as error:  # a function written by the user may raise anything; its text is kept
            raise InputError(f"vary: the function fails at {value:g}: {type(error).__name__}: {error}") from error
        if not isinstance(found, Contact):
            raise InputError(f"vary: the function returned {type(found).__name__} at {value:g}; must return a Contact")
        return found

    present = finite_number(start, "start")
    at_start = member(present)
    kinds = [[type(law) for law in terms_of(one.interaction)] for one in (at_start, contact)]
    first, second = ([number.value for number in numbers_of(one).values()] for one in (at_start, contact))
    whole = (at_start.tip, at_start.units) == (contact.tip, contact.units) and kinds[0] == kinds[1]
    if not (whole and np.allclose(first, second, rtol=1e-12, atol=1e-300)):
        raise InputError(f"start: {start:g}; the function does not return the event's own contact there")
    return Family("parameter", present, contact, member, "linear")


def _stiffness(start: float | None, control: str | None) -> float:
    if start is not None:
        return start
    if control not in ("load", "displacement"):
        raise InputError("vary: stiffness; only folds of a spring, of load or of displacement depend on it")
    return 0.0 if control == "load" else math.inf


def _share(contact: Contact) -> Family:
    terms = terms_of(contact.interaction)
    if len(terms) != 2:
        raise InputError(f"vary: share; needs an interaction that is the sum of two laws, not of {len(terms)}")
    first, second = terms
    full = abs(first.work_of_adhesion) + abs(second.work_of_adhesion)
    signs = [math.copysign(full, law.work_of_adhesion) for law in terms]

    def member(share: float) -> Contact:
        amplitudes = ((1.0 - share) * signs[0], share * signs[1])
        laws = [with_number(law, "work_of_adhesion", w) for law, w in zip(terms, amplitudes, strict=True) if w != 0.0]
        return replace(contact, interaction=sum(laws))

    return Family("share", abs(second.work_of_adhesion) / full, contact, member, "linear")


def member(contact: Contact, parameters: Mapping[str, float]) -> Contact:
    """A contact with other values of some parameters.

    Raises
    ------
    InputError
        As `family_of`.
    """
    for name, value in parameters.items():
        contact = family_of(contact, name, value).member(value)
    return contact


def _named(contact: Contact, vary: str) -> Parameter:
    """The parameter of a name."""
    terms, law, present = terms_of(contact.interaction), contact.interaction, contact.tabor
    if vary == "tabor":
        if law is None or present is None:
            raise InputError("vary: tabor; the contact has no interaction")
        return Parameter(
            vary, present, "dimensionless", lambda value: replace(contact, interaction=law.scaled(value / present, 1.0))
        )
    known, parts = (
        numbers_of(contact),
        {"tip": contact.tip, **{f"interaction[{k}]": one for k, one in enumerate(terms)}},
    )
    place, _, field = vary.rpartition(".")
    if place == "interaction" and len(terms) == 1:
        place = "interaction[0]"
    if place in parts:
        own = {key.removeprefix(f"{place}."): one for key, one in known.items() if key.startswith(f"{place}.")}
        if field not in own:
            listed = f"{type(parts[place]).__name__} has the numbers {', '.join(own) or 'none'}{nearest(field, own)}"
            raise InputError(f"vary: {vary!r}; {listed}")
        return own[field]
    if place.startswith("interaction"):
        words = f"the interaction has {len(terms)} laws, counted from 0: write interaction[K].{field}"
        raise InputError(f"vary: {vary!r}; {words}")
    names = ("tabor", "share", "stiffness", "modulus", "tip.NAME", "interaction[K].NAME")
    if vary not in known:
        raise InputError(f"vary: {vary!r}; must be one of {', '.join(names)}{nearest(vary, (*names, *known))}")
    return known[vary]


def value_of(contact: Contact, vary: Vary, value: object, field: str) -> float:
    """A value for a parameter: a number in the contact's units, or a text with a unit; a stiffness may be infinite.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    if vary == "stiffness" and value in (math.inf, "inf"):
        return math.inf
    if isinstance(vary, str) and isinstance(value, str):
        return contact.units.read(value, dimension_of(contact, vary), field)
    return finite_number(value, field)


def dimension_of(contact: Contact, name: str) -> str:
    """The dimension of a parameter that can be varied.

    Raises
    ------
    InputError
        If the contact has no such parameter.
    """
    name = name.removeprefix(_MATERIAL)
    own = {"stiffness": "stiffness", "share": "dimensionless"}
    return own[name] if name in own else _named(contact, name).dimension
