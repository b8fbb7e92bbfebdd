"""Force curves from files and folders: CSV, and what afmformats reads (.ibw, .jpk-force, …)."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from contbranch.arrays import AnyArray
from contbranch.contact.text import as_path
from contbranch.contact.units import Quantity, parse
from contbranch.errors import InputError
from contbranch.measure.force_curve import COLUMNS, ForceCurve

_POSITION: tuple[str, ...] = ("x", "y")
_HEADING = re.compile(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
_TEXTS = (".csv", ".txt", ".tsv", ".dat")
_INSTRUMENTS = (".ibw", ".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".h5", ".tab", ".zip")
# Places in a map that are said in names of files: numbers, each behind a separator if there is one.
_NUMBER = r"[_ ]?(-?\d+(?:[.,]\d+)?)"
_NAMED = (
    (re.compile(rf"(?:^|[^a-z])x{_NUMBER}.*?y{_NUMBER}", re.IGNORECASE), ("column", "row")),
    (re.compile(rf"(?:^|[^a-z])r(?:ow)?{_NUMBER}.*?c(?:ol(?:umn)?)?{_NUMBER}", re.IGNORECASE), ("row", "column")),
)

# Places in a map, and what makes the curves there.
_Makers = list[tuple[dict[str, float], Callable[..., ForceCurve]]]


@dataclass(frozen=True)
class Unread:
    """A curve of a map that could not be read, and why."""

    error: InputError
    place: dict[str, float]
    source: str = ""

    def describe(self) -> dict[str, Any]:
        """Its place and what is wrong."""
        return {**self.place, "error": str(self.error)}


def read_force_curve(path: str | Path, spring: Quantity = None, number: int = 0) -> ForceCurve:
    """Read a force curve.

    Parameters
    ----------
    path : str or Path
        A CSV file with a header such as ``piezo [nm],force [nN]`` (or `tip` for `piezo`, `deflection` for `force`), and
        if it has them columns `segment` and `curve`; or a file of an instrument that afmformats can read.
    spring : float or str, optional
        Stiffness of the cantilever, in place of that in the file.
    number : int
        Which curve of a map, from 0.

    Raises
    ------
    InputError
        If the file cannot be read, or is no force curve.
    """
    found = read_force_curves(path, spring)
    if not -len(found) <= number < len(found):
        raise InputError(f"number: {number}; '{path}' holds {len(found)} curves, counted from 0")
    return found[number]


def read_force_curves(path: str | Path, spring: Quantity = None) -> list[ForceCurve]:
    """Read all force curves of a file, such as a map's, or of the files in a folder; see `read_force_curve`."""
    found = []
    for one in curves_in(path, spring):
        if isinstance(one, Unread):
            raise one.error
        found.append(one)
    return found


def curves_in(path: str | Path, spring: Quantity = None) -> Iterator[ForceCurve | Unread]:
    """The curves of a file or folder, those that are none among them; files in the order of the numbers in their names.

    Raises
    ------
    InputError
        If there is no such file, or nothing in the folder has a known suffix.
    """
    path = as_path(path, "curve")
    if path.is_dir():
        files = [one for one in path.iterdir() if one.is_file() and one.suffix.lower() in (*_TEXTS, *_INSTRUMENTS)]
        if not files:
            raise InputError(
                f"curve: no file in '{path}' is one of force curves ({', '.join((*_TEXTS, *_INSTRUMENTS))})"
            )
        files.sort(key=lambda one: [int(k) if k.isdecimal() else k for k in re.split(r"(\d+)", one.name)])
        for file, place in zip(files, _named([one.stem for one in files]), strict=True):
            yield from _in_file(file, spring, place)
    elif path.is_file():
        yield from _in_file(path, spring, {})
    else:
        raise InputError(f"curve: '{path}' is not a file")


def _named(stems: Sequence[str]) -> list[dict[str, float]]:
    """Places in a map, as the names of files have them.

    A dash before a number is its sign, ``x-1_y2``; one that all numbers have, ``x-1-y-2``, only stands between.
    """
    said: list[dict[str, str]] = []
    for stem in stems:
        found = ((names, pattern.search(stem)) for pattern, names in _NAMED)
        said.append(next((dict(zip(names, match.groups(), strict=True)) for names, match in found if match), {}))
    between = all(number.startswith("-") for one in said for number in one.values())
    return [
        {name: float(number.lstrip("-" if between else "").replace(",", ".")) for name, number in one.items()}
        for one in said
    ]


def _in_file(path: Path, spring: Quantity, place: dict[str, float]) -> Iterator[ForceCurve | Unread]:
    try:
        makers = (_of_table if path.suffix.lower() in _TEXTS else _of_instrument)(path, spring)
    except InputError as error:
        yield Unread(error, place, str(path))
        return
    for own, make in makers:
        try:
            yield make(place=place | own)
        except InputError as error:
            said = error if str(path) in str(error) else InputError(f"{error} ('{path}')")
            yield Unread(said, place | own, str(path))


def _of_table(path: Path, spring: Quantity) -> _Makers:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"curve: '{path}' cannot be read ({error})") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(f"curve: '{path}' is empty; must have a header such as piezo [nm],force [nN] and rows")
    delimiter = max(",;\t", key=lines[0].count)
    heading, *rows = csv.reader(lines, delimiter=delimiter)
    headings = [_HEADING.fullmatch(cell) for cell in heading]
    names = [match[1].lower() if match else "" for match in headings]
    if not {"piezo", "tip"} & set(names) or not {"force", "deflection"} & set(names):
        listed = ", ".join(filter(None, names))
        nameless = f"no names of columns in its first line, {lines[0].strip()[:40]!r}"
        said = f"the columns {listed}" if listed else nameless
        raise InputError(f"curve: '{path}' has {said}; needs piezo (or tip) and force")
    if twice := sorted({name for name in names if name and names.count(name) > 1}):
        raise InputError(f"curve: '{path}' has more than one column {twice[0]}; leave one")
    for k, row in enumerate(rows, start=2):
        if any(cell.strip() for cell in row[len(names) :]):
            raise InputError(
                f"curve: '{path}', row {k} has {len(row)} values for {len(names)} columns; decimal commas need another "
                "separator, such as a semicolon"
            )
    decimal = "." if delimiter == "," else ","
    columns: dict[str, AnyArray] = {}
    for place, name in enumerate(names):
        if name in ("segment", "curve", *COLUMNS, *_POSITION):
            kind = str if name in ("segment", "curve") else float
            columns[name] = np.array([_cell(row, place, f"'{path}', row {k}: {name}", kind, decimal)
                                      for k, row in enumerate(rows, start=2)])  # fmt: skip
    units = {name: match[2] for name, match in zip(names, headings, strict=True) if match and match[2]}
    where = {name: columns.pop(name) for name in _POSITION if name in columns}
    for name, values in where.items():
        values *= parse(f"1 {units.pop(name, 'nm')}", "length", f"curve: unit of {name}")
    units = {name: unit for name, unit in units.items() if name in COLUMNS}
    maps = columns.pop("curve", np.zeros(len(rows)))
    found: _Makers = []
    for part in (np.flatnonzero(maps == one) for one in dict.fromkeys(maps.tolist())):
        own = {name: values[part] for name, values in columns.items()}
        place_of = {name: float(values[part[0]]) for name, values in where.items()}
        found.append((place_of, partial(ForceCurve, spring=spring, units=units, source=str(path), **own)))
    return found


def _cell(row: list[str], place: int, what: str, kind: type, decimal: str) -> Any:
    """A cell of a row: a text, or a number, of which there may be none."""
    if place >= len(row):
        raise InputError(f"curve: {what} is missing")
    try:
        return row[place] if kind is str else float(row[place].replace(decimal, ".").strip() or "nan")
    except ValueError:
        raise InputError(f"curve: {what} {row[place]!r} is not a number") from None


def _of_instrument(path: Path, spring: Quantity) -> _Makers:
    """Curves that afmformats reads: SI units, heights that fall towards the surface; split at the turn of the piezo."""
    try:
        import afmformats
    except ImportError:
        raise InputError(
            f"curve: '{path}' needs afmformats: pip install 'contbranch[afm]', or give a CSV file"
        ) from None
    try:
        with redirect_stderr(io.StringIO()):  # where they print tracebacks
            groups = afmformats.load_data(path)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # its readers raise what they like for a file that they do not know
        raise InputError(f"curve: '{path}' cannot be read by afmformats ({type(error).__name__}: {error})") from None
    return [(_position(data.metadata), partial(_of_data, data, path, spring)) for data in groups]


def _of_data(data: Any, path: Path, spring: Quantity, place: dict[str, float]) -> ForceCurve:
    heights = [name for name in ("height (measured)", "height (piezo)") if name in data.columns]
    if not heights or "force" not in data.columns:
        raise InputError(f"curve: '{path}' has {', '.join(data.columns)}; needs a force and a height of the piezo")
    stiffness = data.metadata.get("spring constant") if spring is None else spring
    piezo, force = -1e9 * np.asarray(data[heights[0]]), 1e9 * np.asarray(data["force"])
    return ForceCurve(piezo=piezo, force=force, spring=stiffness, source=str(path), place=place)


def _position(metadata: Any) -> dict[str, float]:
    """Where in a map a curve was measured, in nm, or its row and column."""
    for names, factor, keys in (
        (("position x", "position y"), 1e9, _POSITION),
        (("grid index x", "grid index y"), 1.0, ("column", "row")),
    ):
        known = [float(metadata.get(name, math.nan)) for name in names]
        if all(map(math.isfinite, known)):
            return {key: factor * value for key, value in zip(keys, known, strict=True)}
    return {}
