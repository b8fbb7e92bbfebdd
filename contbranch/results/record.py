"""Results describe their fields: documents, files and comparisons are made from what is said here, and nowhere else.

A result is a frozen dataclass that derives from `Record`. Of a field, its annotation says the kind of value and whether
it may be None, its name the quantity in whose unit it is; what else there is to say is said with `described`.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import Field, dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self, TypeVar, dataclass_transform

import numpy as np

from contbranch.arrays import plain
from contbranch.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from contbranch.contact.contact import Contact
    from contbranch.results.table import Table, Tables


Kind = TypeVar("Kind")
Status = Literal["complete", "incomplete"]
# Values by name: what documents hold, and what records are made of.
Values = dict[str, Any]
# Units by the quantities that are in them.
UnitNames = Mapping[str, str]

# Of documents and files.
VERSION = 1
OBSERVABLES = ("load", "displacement", "contact_radius", "central_gap")
# Quantities of fields that have another name; a field NAME_error is in the unit of NAME.
_QUANTITIES = {"r": "radius", "x": "radius", "y": "radius", "wall_pressure": "pressure"}
HEAD = ("contact", "description", "unit_names")  # every document begins with them
_KINDS = {"float": float, "int": int, "str": str}


def described(**options: Any) -> Any:
    """Return a field of a record with its description.

    Parameters
    ----------
    unit : str
        The quantity of ``contact.units.names`` in whose unit it is, where it is not that of the field's name.
    kind : type
        What a table holds of it, where the annotation does not say it: a `Record` for its columns, or ``dict`` for one
        column a key, the four observables; default: nothing.
    key : str
        Its name in documents, where it is not the field's.
    written : {True, False, "if known"}
        Whether documents have it; `None` is null, or left out if it is written only "if known".
    computed : callable
        What returns the value, from the record, of a field that may hold a callable instead, which computes it when it
        is asked for. Files and pickles hold the value; comparisons leave it aside.
    late : bool
        Likewise of a field that computes it itself, as a `Late`.
    **options
        As for `dataclasses.field`.
    """
    said = {
        name: options.pop(name) for name in ("unit", "kind", "key", "written", "computed", "late") if name in options
    }
    if said.keys() & {"computed", "late"}:
        options = {"repr": False, "compare": False, **options}
    return field(metadata=said, **options)


def key_of(item: Field[Any]) -> str:
    """The name of a field in documents and files."""
    return str(item.metadata.get("key", item.name))


def unit_of(item: Field[Any]) -> str:
    """The quantity in whose unit a field is."""
    return str(item.metadata.get("unit", quantity_of(item.name)))


def quantity_of(name: str) -> str:
    """The quantity in whose unit an array of that name is."""
    name = name.removesuffix("_error")
    return _QUANTITIES.get(name, name)


def kind_of(item: Field[Any]) -> Any:
    """What a table holds of a field; None: nothing."""
    return item.metadata.get("kind", _KINDS.get(str(item.type).removesuffix(" | None")))


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(described,))
def record(kind: type[Kind]) -> type[Kind]:
    """Make a class a dataclass, frozen and compared as `Record` says."""
    made = dataclass(frozen=True, eq=False, repr=False)(kind)
    for item in fields(made):  # type: ignore[arg-type]
        if "late" in item.metadata:
            setattr(made, item.name, Late(item.name))
    return made


def given(value: Any) -> Any:
    """What is given: as it is, or by what computes it."""
    return value() if callable(value) else value


def later(compute: Callable[[], Any]) -> Any:
    """What computes the value of a `Late` field, in the place of the value."""
    return compute


class Late:
    """A field that may be given as a callable, which computes its value when that is first asked for.

    It is put in the place of the field once the class is a dataclass.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, instance: object, owner: type) -> Any:
        if instance is None:
            return self
        value = instance.__dict__[self.name]
        if callable(value):
            value = instance.__dict__[self.name] = value()
        return value

    def __set__(self, instance: object, value: Any) -> None:
        instance.__dict__[self.name] = value


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """A frozen dataclass that compares arrays by their values, and is pickled and copied whatever computes its parts.

    Pickled, it holds plain data only: what is computed when asked for has been computed. Copies share what computes.
    """

    def held(self, name: str) -> Any:
        """The value of a field, computed if need be."""
        computed = self.__dataclass_fields__[name].metadata.get("computed")
        return getattr(self, name) if computed is None else computed(self)

    def items(self) -> Values:
        """What documents hold, by its name there."""
        found = {}
        for item in fields(self):
            written = item.metadata.get("written", item.name not in HEAD)
            value: Any = self.held(item.name) if written else None
            if kind_of(item) is dict:
                value = {name: value.get(name) for name in OBSERVABLES}
            if value is not None or written is True:
                found[key_of(item)] = value
        return found

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        compared = (item.name for item in fields(self) if item.compare)
        return all(same(getattr(self, name), getattr(other, name)) for name in compared)

    __hash__ = None  # type: ignore[assignment]  # arrays have none

    def __repr__(self) -> str:
        """The fields that have a value, in three lines at most."""
        shown = ((item.name, self.__dict__.get(item.name)) for item in fields(self) if item.repr)
        listed = ", ".join(f"{name}={_brief(value)}" for name, value in shown if not _nothing(value))
        return shorten(f"{type(self).__name__}({listed})", 3)

    def __getstate__(self) -> Values:
        return {item.name: self.held(item.name) for item in fields(self)}

    def __copy__(self) -> Self:
        return self._with(self.__dict__)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        shared = {item.name for item in fields(self) if item.metadata.keys() & {"computed", "late"}}
        return self._with({k: v if k in shared else deepcopy(v, memo) for k, v in self.__dict__.items()})

    def _with(self, values: Mapping[str, Any]) -> Self:
        copied = object.__new__(type(self))
        copied.__dict__.update(values)
        return copied


@record
class Result(Record):
    """What a computation returns: it is written to files and documents of a format."""

    format: ClassVar[str]
    contact: Contact | None = described(kw_only=True, default=None)
    # of a contact that cannot be made again
    description: Mapping[str, Any] = described(kw_only=True, default_factory=dict, compare=False)
    unit_names: UnitNames = described(kw_only=True, default_factory=dict, compare=False)
    status: Status = described(kw_only=True, default="complete")
    message: str = described(kw_only=True, default="")

    def told(self) -> str:
        """What it says of itself in a line."""
        return ""

    @property
    def outcome(self) -> str:
        """Its status, for people."""
        return self.status

    @property
    def units(self) -> UnitNames:
        """Units of its numbers by quantity; none where they are reduced."""
        return self.unit_names if self.contact is None else self.contact.units.names

    def __repr__(self) -> str:
        """Kind, contact and status, what there is to say in a line, and the message: three lines at most."""
        contact = "" if self.contact is None else f" of {self.contact.brief}"
        lines = [f"{type(self).__name__}{contact}: {self.outcome}", self.told(), self.message]
        return "\n".join(shorten(line, 1) for line in lines if line)

    def __str__(self) -> str:
        """All that the command line prints."""
        from contbranch.output.summary import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        """What notebooks show: the figure, and what is printed."""
        from contbranch.output.notebook import as_html

        return as_html(self)

    def _repr_png_(self) -> bytes | None:
        from contbranch.output.notebook import as_png

        return as_png(self)

    def body(self) -> Mapping[str, Any]:
        """What its document holds besides format, contact and units."""
        return self.items()

    def document(self) -> Values:
        """Return the JSON document: a dictionary of plain values, with None for what JSON cannot hold."""
        return {**self.head(), **plain(self.body())}

    def head(self) -> Values:
        """What its document begins with: format, the contact, and the unit of every quantity if it is physical."""
        described = self.description or ({} if self.contact is None else self.contact.describe())
        names = dict(self.units)
        units = {"units": "physical", "unit_names": names} if names else {"units": "reduced"}
        return {"format": self.format, "version": VERSION, "contact": plain(described), **units}

    def save(self, path: str | Path) -> None:
        """Write an HDF5 file; see ``docs/file-layout.md``.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        from contbranch.output.hdf5 import save

        save(self, path)

    def tables(self) -> Tables:
        """Its tables, by what a row is: the one of `to_csv` and `to_dataframe` first."""
        raise NotImplementedError(f"{type(self).__name__} has no table")

    def table(self) -> Table:
        """The first of its `tables`."""
        return next(iter(self.tables().values()))

    def to_csv(self, path: str | Path) -> None:
        """Write the table as text: one line of names with units, ``load [nN],displacement [nm],…``, then numbers.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        self.table().to_csv(path)

    def to_dataframe(self) -> pd.DataFrame:
        """The table for pandas, its columns called as in a CSV file.

        Raises
        ------
        InputError
            If pandas is not installed (extra ``tables``).
        """
        table = self.table()
        columns = dict(zip(table.headings, table.columns.values(), strict=True))
        frame: pd.DataFrame = _library("pandas", "to_dataframe").DataFrame(columns)
        return frame

    def to_xarray(self) -> xr.Dataset:
        """The tables for xarray: a dimension for each, units as attributes.

        Raises
        ------
        InputError
            If xarray is not installed (extra ``tables``).
        """
        library, found = _library("xarray", "to_xarray"), dict[str, Any]()
        for number, (row, table) in enumerate(self.tables().items()):
            for name, values in table.columns.items():
                units = {"units": table.units[name]} if name in table.units else {}
                found[f"{row}_{name}" if number else name] = (row, values, units)
        about = {**self.head(), "status": self.status, "message": self.message}
        attrs = {key: json.dumps(value) if isinstance(value, dict) else value for key, value in about.items()}
        data: xr.Dataset = library.Dataset(found, attrs=attrs)
        return data


def _library(name: str, field: str) -> Any:
    """An optional library."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise InputError(f"{field}: {name} is not installed; install contbranch[tables]") from None


def shorten(text: str, lines: int) -> str:
    """Return a text wrapped into lines, with an ellipsis where it is longer."""
    return "\n".join(textwrap.wrap(text, 118, max_lines=lines, placeholder=" …", break_on_hyphens=False))


def _nothing(value: Any) -> bool:
    return value is None or (isinstance(value, str | tuple) and not value)


def _brief(value: Any) -> str:
    """A value in a few words: arrays by their shapes, what is computed when asked for not at all."""
    if isinstance(value, np.ndarray):
        return f"array {value.shape}"
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_brief(one)}" for key, one in value.items()) + "}"
    if isinstance(value, tuple) and len(value) > 1 and isinstance(value[0], Record):
        return f"{len(value)} × {type(value[0]).__name__}"
    return "…" if callable(value) else repr(value)


class Column(NamedTuple):
    """A column of a table of records.

    Attributes
    ----------
    name, unit : str
    kind : type
        ``float``, ``int`` or ``str``.
    path : tuple
        Names of the attributes (keys of mappings) that lead to its value.
    """

    name: str
    unit: str
    kind: type
    path: tuple[str, ...]

    def of(self, record: object) -> Any:
        """The value of a record; None where there is none."""
        for name in self.path:
            if isinstance(record, Record):
                record = record.held(name)
            else:
                record = record.get(name) if isinstance(record, Mapping) else None
        return record


def columns(kind: type[Record], prefix: str = "", path: tuple[str, ...] = ()) -> Iterator[Column]:
    """Columns of a table of records, those of records within them included."""
    for item in fields(kind):
        held, within = kind_of(item), (*path, item.name)
        if held is dict:
            yield from (Column(f"{one}_{item.name}", one, float, (*within, one)) for one in OBSERVABLES)
        elif held in _KINDS.values():
            yield Column(prefix + item.name, unit_of(item), held, within)
        elif held is not None:
            yield from columns(held, f"{item.name}_" if path else "", within)


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal: arrays in shape and every number, NaN like NaN."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        one, other = np.asarray(one), np.asarray(other)
        return np.array_equal(one, other, equal_nan="f" in one.dtype.kind + other.dtype.kind)
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, Sequence) and isinstance(other, Sequence) and not isinstance(one, str):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(one == other or (one != one and other != other))
