"""Tables of results: CSV with units in the header, pandas, xarray."""

from __future__ import annotations

import csv
import io
import json
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contbranch.errors import InputError
from contbranch.output.document import head
from contbranch.output.files import write
from contbranch.results.record import Values
from contbranch.results.table import Table

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from contbranch.results.record import Result


def write_csv(table: Table, path: str | Path) -> None:
    """Write the table as `as_csv` has it.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write(path, as_csv(table).encode())


def as_csv(table: Table) -> str:
    """The table as text: a line of names with units, then numbers with all their digits, ``nan`` for what is not known.

    Read it with `pandas.read_csv`, or without names by ``numpy.loadtxt(path, delimiter=",", skiprows=1)``.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.headings)
    writer.writerows(zip(*(values.tolist() for values in table.columns.values()), strict=True))
    return text.getvalue()


def as_dataframe(table: Table) -> pd.DataFrame:
    """The table for pandas, its columns called as in CSV files.

    Raises
    ------
    InputError
        If pandas is not installed.
    """
    columns = dict(zip(table.headings, table.columns.values(), strict=True))
    frame: pd.DataFrame = _library("pandas", "to_dataframe").DataFrame(columns)
    return frame


def as_xarray(result: Result) -> xr.Dataset:
    """The tables of a result for xarray: a dimension a table, with units as attributes.

    Raises
    ------
    InputError
        If xarray is not installed.
    """
    library, found = _library("xarray", "to_xarray"), dict[str, Any]()
    for number, (row, table) in enumerate(result.tables().items()):
        for name, values in table.columns.items():
            units = {"units": table.units[name]} if name in table.units else {}
            found[f"{row}_{name}" if number else name] = (row, values, units)
    about: Values = {**head(result), **{key: getattr(result, key) for key in ("status", "message")}}
    attrs = {key: json.dumps(value) if isinstance(value, dict) else value for key, value in about.items()}
    data: xr.Dataset = library.Dataset(found, attrs=attrs)
    return data


def _library(name: str, field: str) -> Any:
    """An optional library."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise InputError(f"{field}: {name} is not installed; install contbranch[tables]") from None
