"""The numbers of a contact by the names that people give them, and contacts with another value of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from contbranch.contact.contact import Contact, dimensions, make, nearest
from contbranch.contact.interaction_law import terms_of
from contbranch.errors import InputError

__all__ = ["Parameter", "parameters_of", "read_quantities"]


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


def parameters_of(contact: Contact) -> dict[str, Parameter]:
    """Return the modulus, the numbers of the tip and those of the laws: `range`, or `range[0]` in a sum."""
    terms = terms_of(contact.interaction)

    def with_term(value: float, k: int, name: str) -> Contact:
        changed = make(type(terms[k]), {**terms[k].parameters(), name: value})
        return replace(contact, interaction=sum([*terms[:k], changed, *terms[k + 1 :]]) or None)

    def with_tip(value: float, name: str) -> Contact:
        return replace(contact, tip=make(type(contact.tip), {**contact.tip.parameters(), name: value}))

    found = [Parameter("modulus", contact.modulus, "pressure", lambda value: replace(contact, modulus=value))]
    found += [
        Parameter(name, value, dimension, partial(with_tip, name=name))
        for name, value, dimension in _numbers(contact.tip)
    ]
    for k, term in enumerate(terms):
        place = f"[{k}]" if len(terms) > 1 else ""
        found += [
            Parameter(name + place, value, dimension, partial(with_term, k=k, name=name))
            for name, value, dimension in _numbers(term)
        ]
    return {one.name: one for one in found}


def _numbers(part: Any) -> list[tuple[str, float, str]]:
    """Name, value and dimension of the numbers of a tip or law from which it can be made again."""
    known = dimensions(type(part))
    own = part.parameters().items()
    real = ((name, value) for name, value in own if isinstance(value, int | float) and not isinstance(value, bool))
    return [(name, float(value), known[name]) for name, value in real if name in known]


def read_quantities(contact: Contact, given: Mapping[str, object], field: str) -> dict[str, float]:
    """Return quantities for parameters of a contact, by name, in its units.

    Raises
    ------
    InputError
        For a name that is not known, a unit that does not fit, or a number that is negative.
    """
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
