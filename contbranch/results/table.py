"""Columns of numbers with names and units: what tables for people and programs are made from."""

from __future__ import annotations

import io
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contbranch.arrays import AnyArray, Columns
from contbranch.results.record import Record, UnitNames, columns, quantity_of

_LEAD = ("load", "displacement", "contact_radius", "central_gap", "energy")
# What stands where there is no value, by the kind of the column; integers with gaps are written as floats.
_BLANK = {float: np.nan, int: np.nan, str: ""}


def with_unit(words: str, unit: str) -> str:
    """Return words with a unit, if there is one."""
    return f"{words} ({unit})" if unit else words


class Table(NamedTuple):
    """Columns of one length.

    Attributes
    ----------
    columns : dict of array (M,)
        By name, in order.
    units : dict
        Units of those that have one.
    """

    columns: Columns
    units: UnitNames

    @property
    def headings(self) -> list[str]:
        """Names with units, ``load [nN]``."""
        return [f"{name} [{self.units[name]}]" if name in self.units else name for name in self.columns]

    def csv(self) -> str:
        """The table as text: a line of names with units, then numbers with all their digits, ``nan`` for what is not
        known.

        Read it with `pandas.read_csv`, or without names by ``numpy.loadtxt(path, delimiter=",", skiprows=1)``.
        """
        import csv  # what most commands do not write is not imported for them

        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.headings)
        writer.writerows(zip(*(values.tolist() for values in self.columns.values()), strict=True))
        return text.getvalue()

    def to_csv(self, path: str | Path) -> None:
        """Write that text; InputError if the file cannot be written."""
        from contbranch.output.files import write

        write(path, self.csv().encode())


# Tables by what a row is.
Tables = dict[str, Table]


def quantity(threshold: str, known: Collection[str] = ()) -> str:
    """The quantity in whose unit a threshold is, if it has none of its own."""
    if threshold in known:
        return threshold
    return "contact_radius" if threshold.endswith("radius") else threshold.rpartition("_")[2]


def of_columns(columns: Columns, unit_names: UnitNames, **other: str) -> Table:
    """Return a table of arrays; their names tell their units, save those of `other`, which are in that quantity's."""
    units = {name: unit_names.get(other.get(name, quantity_of(name)), "") for name in columns}
    return Table(columns, {name: unit for name, unit in units.items() if unit})


def of_records(kind: type[Record], records: Sequence[Record], unit_names: UnitNames) -> Table:
    """Return a table of records, without the columns that none of them has a value for."""
    found, units = {}, {}
    for column in columns(kind):
        values = [column.of(record) for record in records]
        if records and all(value is None for value in values):
            continue
        blank = _BLANK[column.kind]
        found[column.name] = np.array([blank if value is None else value for value in values])
        units[column.name] = unit_names.get(column.unit, "")
    return Table(found, {name: unit for name, unit in units.items() if unit})


def joined(name: str, parts: Iterable[Columns]) -> dict[str, AnyArray]:
    """Return the columns of several parts one below the other, with a column that counts the parts."""
    listed = list(parts)
    names = [key for key in listed[0] if all(key in part for part in listed)] if listed else []
    found: dict[str, AnyArray] = {key: np.concatenate([part[key] for part in listed]) for key in names}
    number = {name: np.repeat(np.arange(len(listed)), [len(part[names[0]]) for part in listed] if names else [])}
    lead: dict[str, AnyArray] = {key: found.pop(key) for key in _LEAD if key in found}
    return {**lead, **number, **found}
