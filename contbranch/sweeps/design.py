"""What varies in a sweep: contacts with their parameters, as a grid or side by side."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.family import dimension_of, family_of, member
from contbranch.contact.file import parsed, read_contact
from contbranch.contact.text import as_path
from contbranch.contact.units import finite_number, positive_number
from contbranch.errors import InputError, look_up, refuse_unknown
from contbranch.grid_size import named_model
from contbranch.results.sweep import values_at

_RANGE = ("from", "to", "count", "spacing")
_SWEEP = ("mode", "vary", "keep", "task_limit")


@dataclass(frozen=True)
class Design(Sequence[Contact]):
    """Contacts that differ in some parameters, each made when it is asked for.

    Attributes
    ----------
    contact : Contact
        Of which the parameters not named are.
    axes : dict of tuple of float
        Values by the name of the parameter, in the contact's units.
    mode : {"grid", "zip"}
        All combinations, the last parameter changing fastest, or the first values, the second values, ….
    """

    contact: Contact
    axes: Mapping[str, tuple[float, ...]]
    mode: Literal["grid", "zip"] = "grid"

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values of each parameter of a grid; otherwise the number of contacts."""
        counts = tuple(len(values) for values in self.axes.values())
        return counts if self.mode == "grid" else counts[:1]

    def __len__(self) -> int:
        return math.prod(self.shape)

    def parameters(self, index: int) -> dict[str, float]:
        """Values of a contact's parameters."""
        return values_at(self.axes, self.mode, index)

    def source(self, index: int) -> str | None:
        """Where what is given there is from, if it says so, as a curve says its file."""
        return None

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"index {index} of {len(self)} contacts")
        return member(self.contact, self.parameters(index % len(self)))


@dataclass(frozen=True)
class Listed(Design):
    """Contacts, or whatever else a task takes, as they come, with parameters: one value each, or those of a grid.

    Attributes
    ----------
    given : sequence
        What the contact, the first of them, stands for.
    """

    mode: Literal["grid", "zip"] = "zip"
    given: Sequence[Any] = ()

    def __len__(self) -> int:
        return len(self.given)

    def __getitem__(self, index: Any) -> Any:
        return self.given[index]

    def source(self, index: int) -> str | None:
        """The attribute `source` of what is given there."""
        found = getattr(self.given[index], "source", None)
        return found if isinstance(found, str) and found else None


def listed(contacts: Sequence[Any]) -> Listed:
    """Contacts with the numbers in which they differ."""
    for number, contact in enumerate(contacts):
        if not hasattr(contact, "describe"):
            raise InputError(f"contacts: number {number} is {type(contact).__name__}; must be a Contact")
        if getattr(contact, "units", None) != getattr(contacts[0], "units", None):
            raise InputError(f"contacts: number {number} has other units than number 0; let all be in the same")
    rows = [dict(_numbers(contact.describe())) for contact in contacts]
    names = dict.fromkeys(name for row in rows for name in row)
    axes = {name: tuple(row.get(name, math.nan) for row in rows) for name in names}
    axes = {name: values for name, values in axes.items() if len(set(values)) > 1}
    if len(axes) > 1:  # it follows from the others
        axes.pop("tabor", None)
    return Listed(contacts[0], axes, given=contacts)


def _numbers(value: object, name: str = "") -> Iterator[tuple[str, float]]:
    """The numbers in a description, by the names that `varied` has for them."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _numbers(one, f"{name}.{key}".lstrip(".").replace("material.", ""))
    elif isinstance(value, list):
        for number, one in enumerate(value):
            if isinstance(one, Mapping):
                yield from _numbers(one, f"{name}[{number}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)


def varied(contact: Contact, vary: Mapping[str, Sequence[Any]], mode: str = "grid") -> Design:
    """Contacts that differ from one in some parameters: what `contbranch.sweep` takes.

    Parameters
    ----------
    contact : Contact
    vary : mapping
        Lists of values by the name of the parameter: ``"tip.radius"``, ``"interaction[0].range"``, ``"modulus"``,
        ``"tabor"`` or ``"share"``, as for `contbranch.follow`. Numbers in the contact's units, or texts with units.
    mode : {"grid", "zip"}
        All combinations, or the first values of all, the second values, ….

    Raises
    ------
    InputError
        If the contact has no such parameter, or a value cannot be used.
    """
    look_up(mode, {"grid": 0, "zip": 0}, "mode")
    if not (isinstance(vary, Mapping) and vary):
        raise InputError(f"vary: {vary!r}; name at least one parameter with its values, for example tip.radius")
    axes = {}
    for name, values in vary.items():
        if name == "stiffness":
            raise InputError("vary: stiffness; sweep over contacts, with one control=cb.Spring(stiffness) for all")
        if isinstance(values, str) or not np.iterable(values) or not len(values):
            raise InputError(f"vary: {name} is {values!r}; must be a list of values")
        dimension = dimension_of(contact, name)
        read = [contact.units.read(value, dimension, f"vary: {name}") for value in values]
        for value in read:
            try:
                family_of(contact, name, value).member(value)
            except InputError as error:  # which may name what is made of it: radius, to, …
                field, _, told = str(error).partition(": ")
                raise InputError(f"vary: {told}" if field == "vary" else f"vary: {name}: {told}") from None
        axes[name] = tuple(read)
    places = {name.removeprefix("material.").replace("interaction.", "interaction[0]."): name for name in axes}
    if len(places) < len(axes):
        twice = next(name for name in axes if name not in places.values())
        raise InputError(f"vary: {twice} is there twice, under two names; leave one out")
    counts = {name: len(values) for name, values in axes.items()}
    if mode == "zip" and len(set(counts.values())) > 1:
        told = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise InputError(f"vary: lists of different lengths ({told}); mode zip takes one value of each at a time")
    design = Design(contact, axes, mode)  # type: ignore[arg-type]  # one of the two
    for index in (0, len(design) - 1):
        _refuse_overwritten(contact, design.parameters(index))
    return design


def _refuse_overwritten(contact: Contact, values: Mapping[str, float]) -> None:
    """Refuse parameters that one set after them changes, as a work of adhesion does the Tabor coefficient."""
    names = list(values)
    for k, name in enumerate(names):
        try:
            contact = member(contact, {name: values[name]})
        except InputError:
            if not k:
                raise
            raise InputError(
                f"vary: {name} cannot be set once {names[k - 1]} is {values[names[k - 1]]:g}; name it before that"
            ) from None
    for name, value in values.items():
        try:
            present = family_of(contact, name, value).start
        except InputError:  # of a law that has no share any more
            continue
        if not math.isclose(present, value, rel_tol=1e-9, abs_tol=1e-12):
            later = ", ".join(names[names.index(name) + 1 :])
            raise InputError(
                f"vary: {name} is {present:g} and no longer {value:g} once {later} is set after it; change the order, "
                "or leave one out"
            )


def read_sweep(path: str | Path) -> tuple[Design, dict[str, Any]]:
    """Return the contacts of a sweep file, and the settings of `contbranch.sweep` that it gives.

    A sweep file is a contact file with a table of what varies::

        [sweep]
        mode = "grid"                # the default, or "zip"
        keep = "curves"              # thresholds, curves or profiles
        task_limit = 600             # seconds
        [sweep.vary]
        "interaction[0].range" = ["0.5 nm", "1 nm"]
        "tip.radius" = { from = "0.5 um", to = "5 um", count = 20, spacing = "log" }

    Raises
    ------
    InputError
        As for a contact file, and for a table that cannot be used; the message names the field.
    """
    contact, options = read_contact(path)
    table = parsed(as_path(path)).get("sweep")
    if not isinstance(table, dict) or "vary" not in table:
        raise InputError(f"sweep.vary: missing; '{path}' needs a table [sweep.vary] of parameters and their values")
    if not isinstance(table["vary"], dict):
        raise InputError(f"sweep.vary: {table['vary']!r}; must be a table [sweep.vary] of parameters and their values")
    refuse_unknown(table, _SWEEP, "sweep.")
    try:
        vary = {name: _values(contact, name, given) for name, given in table["vary"].items()}
        design = varied(contact, vary, table.get("mode", "grid"))
    except InputError as error:
        raise InputError(f"sweep.{error}") from None
    settings: dict[str, Any] = {name: table[name] for name in ("keep", "task_limit") if name in table}
    settings |= {name: options[name] for name in ("control", "accuracy", "max_load", "model") if name in options}
    if "model" in settings:
        settings["model"] = named_model(settings["model"], options.get("cell"), options.get("grid"))
    return design, settings


def _values(contact: Contact, name: str, given: object) -> list[Any]:
    """The values of a parameter in a sweep file, which have units if the contact's have."""
    field = f"vary.{name}"
    dimension = dimension_of(contact, name)

    def number(value: object) -> float:
        with_unit = isinstance(value, str)
        if dimension != "dimensionless" and with_unit != contact.units.physical:
            remedy = "drop the unit" if with_unit else "add the unit"
            raise InputError(f"{field}: {value!r}; {remedy}: units for all numbers of a file or for none")
        return contact.units.read(value, dimension, field)

    if isinstance(given, list):
        return [number(value) for value in given]
    if not isinstance(given, dict):
        raise InputError(f"{field}: {given!r}; must be a list, or a table {{ from, to, count, spacing }}")
    refuse_unknown(given, _RANGE, f"{field}.")
    for key in _RANGE[:3]:
        if key not in given:
            raise InputError(f"{field}.{key}: missing; write {{ from = A, to = B, count = N }}")
    count = given["count"]
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise InputError(f"{field}.count: {count!r}; must be a whole number, 1 or greater")
    first, last = (finite_number(number(given[key]), f"{field}.{key}") for key in ("from", "to"))
    spacing = look_up(given.get("spacing", "linear"), {"linear": np.linspace, "log": np.geomspace}, f"{field}.spacing")
    if spacing is np.geomspace:
        positive_number(first * last, f"{field}: from × to, with spacing log,")
    found: list[float] = spacing(first, last, count).tolist()
    return found
