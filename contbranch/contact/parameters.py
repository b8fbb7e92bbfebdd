"""The numbers of a contact by the names that people give them, and contacts with another value of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from contbranch.contact.contact import Contact, dimensions, make
from contbranch.contact.interaction_law import terms_of
from contbranch.errors import InputError, nearest


@dataclass(frozen=True)
class Parameter:
    """A number of a contact.

    Attributes
    ----------
    name : str
    value : float
        In the contact's units.
    dimension : str
        As `units` has it.
    contact : callable
        The contact with another value of it.
    """

    name: str
    value: float
    dimension: str
    contact: Callable[[float], Contact]


def numbers_of(contact: Contact) -> dict[str, Parameter]:
    """Return all numbers of a contact by their places: ``modulus``, ``tip.radius``, ``interaction[0].range``."""
    parts: list[Any] = [contact.tip, *terms_of(contact.interaction)]

    def changed(value: float, k: int, name: str) -> Contact:
        tip, *terms = (with_number(part, name, value) if i == k else part for i, part in enumerate(parts))
        return replace(contact, tip=tip, interaction=sum(terms) or None)

    body: Any = contact.body
    modulus = Parameter("modulus", contact.modulus, "pressure", lambda value: replace(contact, modulus=value))
    found = {"modulus": modulus}
    for k, part in enumerate(parts):
        known, end = dimensions(type(part)), f"[{k - 1}]"
        place = f"interaction{end}" if k else "tip"
        for name, value in part.parameters().items():
            if isinstance(value, int | float) and not isinstance(value, bool) and name in known:
                own = name + end if k and len(parts) > 2 else name
                made = partial(changed, k=k, name=name)
                found[f"{place}.{name}"] = Parameter(own, float(value), known[name], made)
    for name, value in {} if body is None else body.parameters().items():
        if isinstance(value, float):
            made = partial(lambda value, own: replace(contact, body=with_number(body, own, value)), own=name)
            found[name] = Parameter(name, value, dimensions(type(body))[name], made)
    return found


def with_number(part: Any, name: str, value: float) -> Any:
    """Return a tip or law with another value of a number."""
    return make(type(part), {**part.parameters(), name: value})


def parameters_of(contact: Contact) -> dict[str, Parameter]:
    """Return the modulus, the numbers of the tip and those of the laws by their own names: `range[0]` in a sum."""
    return {one.name: one for one in numbers_of(contact).values()}


def read_quantities(contact: Contact, given: Mapping[str, object], field: str) -> dict[str, float]:
    """Return quantities for parameters of a contact, by name, in its units.

    Raises
    ------
    InputError
        For a name that is not known, a unit that does not fit, or a number that is negative.
    """
    if not isinstance(given, Mapping):
        raise InputError(
            f"{field}: {type(given).__name__}; must be a mapping of parameters, such as {{'modulus': 0.1}}"
        )
    known, found = parameters_of(contact), {}
    for name, value in given.items():
        if name not in known:
            words = f"must be one of {', '.join(known)}{nearest(name, known)}"
            raise InputError(f"{field}: {name!r} is not a parameter of the contact; {words}")
        number = contact.units.read(value, known[name].dimension, f"{field} {name}")
        if number < 0.0:
            raise InputError(f"{field}: {name}={value}; an uncertainty must not be negative")
        found[name] = number
    return found
