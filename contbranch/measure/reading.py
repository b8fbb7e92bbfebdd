"""Force curves from files: CSV, and what afmformats reads (.ibw, .jpk-force, …)."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from contbranch.errors import InputError
from contbranch.measure.force_curve import COLUMNS, ForceCurve

__all__ = ["read_force_curve", "read_force_curves"]

_HEADING: Final = re.compile(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
_TEXTS: Final = (".csv", ".txt", ".tsv", ".dat")


def read_force_curve(path: str | Path, spring: float | str | None = None, number: int = 0) -> ForceCurve:
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


def read_force_curves(path: str | Path, spring: float | str | None = None) -> list[ForceCurve]:
    """Read all force curves of a file, such as a map's; see `read_force_curve`."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"curve: '{path}' is not a file")
    if path.suffix.lower() in _TEXTS:
        return _of_table(path, spring)
    return _of_instrument(path, spring)


def _of_table(path: Path, spring: float | str | None) -> list[ForceCurve]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"curve: '{path}' cannot be read ({error})") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(f"curve: '{path}' is empty; must have a header such as piezo [nm],force [nN] and rows")
    delimiter = max(",;\t", key=lines[0].count)
    headings = [_HEADING.fullmatch(cell) for cell in next(csv.reader(lines[:1], delimiter=delimiter))]
    names = [match[1].lower() if match else "" for match in headings]
    wanted = [k for k, name in enumerate(names) if name in (*COLUMNS, "segment", "curve")]
    if not {"piezo", "tip"} & set(names) or not {"force", "deflection"} & set(names):
        raise InputError(
            f"curve: '{path}' has the columns {', '.join(filter(None, names))}; needs piezo (or tip) and force"
        )
    rows = list(csv.reader(lines[1:], delimiter=delimiter))
    for number, row in enumerate(rows, start=2):
        if len(row) < len(names):
            raise InputError(f"curve: '{path}', row {number}: {len(row)} values; must be {len(names)}")
    columns: dict[str, list[Any]] = {names[k]: [row[k] for row in rows] for k in wanted}
    units = {names[k]: match[2] for k in wanted if (match := headings[k]) and match[2] and names[k] in COLUMNS}
    for name in set(columns) & set(COLUMNS):
        columns[name] = _numbers(columns[name], name, path, decimal="." if delimiter == "," else ",")
    maps = np.array(columns.pop("curve", ["0"] * len(rows)))
    parts = [np.flatnonzero(maps == one) for one in dict.fromkeys(maps.tolist())]
    return [
        ForceCurve(
            spring=spring,
            units=units,
            source=str(path),
            **{name: np.array(values)[part] for name, values in columns.items()},
        )
        for part in parts
    ]


def _numbers(cells: list[str], name: str, path: Path, decimal: str) -> list[float]:
    found = []
    for number, cell in enumerate(cells, start=2):
        try:
            found.append(float(cell.replace(decimal, ".").strip() or "nan"))
        except ValueError:
            raise InputError(f"curve: '{path}', row {number}: {name} {cell!r} is not a number") from None
    return found


def _of_instrument(path: Path, spring: float | str | None) -> list[ForceCurve]:
    """Curves that afmformats reads: SI units, heights that fall towards the surface; split at the turn of the piezo."""
    try:
        import afmformats
    except ImportError:
        raise InputError(
            f"curve: '{path}' needs afmformats: pip install 'contbranch[afm]', or give a CSV file"
        ) from None
    try:
        groups = afmformats.load_data(path)
    except Exception as error:  # its readers raise what they like for a file that they do not know
        raise InputError(f"curve: '{path}' cannot be read by afmformats ({type(error).__name__}: {error})") from None
    found = []
    for data in groups:
        heights = [name for name in ("height (measured)", "height (piezo)") if name in data.columns]
        if not heights or "force" not in data.columns:
            raise InputError(f"curve: '{path}' has {', '.join(data.columns)}; needs a force and a height of the piezo")
        stiffness = data.metadata.get("spring constant") if spring is None else spring
        piezo, force = -1e9 * np.asarray(data[heights[0]]), 1e9 * np.asarray(data["force"])
        found.append(ForceCurve(piezo=piezo, force=force, spring=stiffness, source=str(path)))
    return found
