"""Force curves from files and folders: tables of text, and what afmformats reads (.ibw, .jpk-force, …)."""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from contbranch.arrays import AnyArray, Array
from contbranch.contact.text import as_path
from contbranch.contact.units import Quantity, parse
from contbranch.errors import InputError
from contbranch.measure.force_curve import COLUMNS, ForceCurve, numbers, scale, stiffness_of

# Names of a text's columns by what they hold: one text, ``piezo=NAME,force=NAME``, or a mapping.
Names = str | Mapping[str, str] | None

# Those of our tables, and of texts that Optics11, JPK and NanoScope export, the last with the legs side by side. A
# minus reverses a column: heights of JPK fall towards the surface.
_OWN = {role: role for role in (*COLUMNS, "segment", "curve", "x", "y")}
_HEIGHTS = ("smoothedMeasuredHeight", "measuredHeight", "smoothedStrainGaugeHeight", "strainGaugeHeight", "height")
_RAMPS = ",".join(f"piezo=Calc_Ramp_{leg}_nm [nm],deflection=Defl_{{0}}_{leg} [{{0}}]" for leg in ("Ex", "Rt"))
_EXPORTS = ["piezo=Piezo (nm),deflection=Cantilever (nm)", *map(_RAMPS.format, ("nm", "V"))]
_EXPORTS += [f"force=vDeflection,piezo=-{height}" for height in _HEIGHTS]
# A name with a unit in brackets, a line of numbers, a spring constant, and usual suffixes.
_NAME = re.compile(r"^(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?$", re.DOTALL)
_NUMBERS = re.compile(r"[\d.,;eE+\s-]*\d[\d.,;eE+\s-]*")
_SPRING = re.compile(r"(?:k \(N/m\)|# springConstant:)\s+(\d+[.,]?\d*(?:[eE][+-]?\d+)?)")
_TEXTS = (".csv", ".txt", ".tsv", ".dat")
_INSTRUMENTS = (".ibw", ".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".h5", ".tab", ".zip")
# What a file may lack, with how it is given, and what helps where a file cannot be read.
_MISSING = {"spring constant": "--spring '0.5 N/m'", "sensitivity": "--sensitivity '50 nm/V'"}
_REMEDY = "install contbranch[afm], unpack it, or export it as text (NanoScope: Export, ASCII) and name the --columns"
# A segment that moves by a smaller share of the way of the piezo is a pause: creep 0.05 in measured files, legs 0.7.
HELD = 0.1
# Places in a map that are said in names of files: numbers, each behind a separator if there is one.
_ROW, _COLUMN = (rf"[_ ]?(?P<{name}>-?\d+(?:[.,]\d+)?)" for name in ("row", "column"))
_FORMS = (rf"(?<![a-z])x{_COLUMN}.*?y{_ROW}", rf"(?<![a-z])r(?:ow)?{_ROW}.*?c(?:ol(?:umn)?)?{_COLUMN}")

# Places in a map, and what makes the curves there.
_Makers = Iterator[tuple[dict[str, float], Callable[..., ForceCurve]]]
# Of a column by what it holds: its place in a row, its sign and its unit.
_Places = dict[str, tuple[int, float, str]]
# The line of names, what is between them, how many, and where columns are; twice where the legs lie side by side.
_Table = tuple[int, str, int, list[_Places]]


@dataclass(frozen=True)
class Unread:
    """A curve of a map that could not be read, and why."""

    error: InputError
    place: dict[str, float]
    source: str = ""

    def describe(self) -> dict[str, Any]:
        """Its place and what is wrong."""
        return {**self.place, "error": str(self.error)}


def read_force_curve(
    path: str | Path, spring: Quantity = None, number: int = 0, *, sensitivity: Quantity = None, columns: Names = None
) -> ForceCurve:
    """Read a force curve.

    Parameters
    ----------
    path : str or Path
        A text with columns such as ``piezo [nm],force [nN]`` (or `tip` for `piezo`, `deflection` for `force`), and with
        `segment`, `curve`, `x` and `y` if it has them; or a file of an instrument: what afmformats can read, and texts
        that JPK, Optics11 and NanoScope export.
    spring : float or str, optional
        Stiffness of the cantilever, in place of that in the file. What an instrument calls a force is its deflection
        times the stiffness in its file, and changes with it; a column `force` of a table does not.
    number : int
        Which curve of a map, from 0.
    sensitivity : float or str, optional
        Deflection by voltage, such as ``"50 nm/V"``, where a deflection is in volts; or in place of the one in a file
        of an instrument, whose deflections and forces change with it.
    columns : str or mapping, optional
        What the columns of a text hold: ``"piezo=Height (nm),deflection=Defl (V)"``, names from a line anywhere in it;
        piezo, tip, force, deflection, segment, curve, x or y. A minus reverses a column, as heights that fall towards
        the surface need: ``piezo=-Height (nm)``. Units are those in brackets, of a line of units below the names, or
        added: ``piezo=Ramp_nm [nm]``. Where approach and retraction lie side by side, both are named, one after the
        other: ``piezo=Z ex,force=F ex,piezo=Z rt,force=F rt``.

    Raises
    ------
    InputError
        If the file cannot be read, or is no force curve.
    """
    found = read_force_curves(path, spring, sensitivity=sensitivity, columns=columns)
    if not -len(found) <= number < len(found):
        raise InputError(f"number: {number}; '{path}' holds {len(found)} curves, counted from 0")
    return found[number]


def read_force_curves(
    path: str | Path, spring: Quantity = None, *, sensitivity: Quantity = None, columns: Names = None
) -> list[ForceCurve]:
    """Read all force curves of a file, such as a map's, or of the files in a folder; see `read_force_curve`."""
    found = list(curves_in(path, spring, sensitivity, columns))
    if unread := [one for one in found if isinstance(one, Unread)]:
        raise unread[0].error
    return [one for one in found if isinstance(one, ForceCurve)]


def curves_in(
    path: str | Path, spring: Quantity = None, sensitivity: Quantity = None, columns: Names = None
) -> Iterator[ForceCurve | Unread]:
    """The curves of a file or folder, those that are none among them; files in the order of the numbers in their names.

    Of a folder, a file with an unusual suffix is passed over if it is no curve.

    Raises
    ------
    InputError
        If there is no such file, or no curve in the folder and nothing with a usual suffix.
    """
    path, usual, there = as_path(path, "curve"), (*_TEXTS, *_INSTRUMENTS), False
    files = [path] if path.is_file() else [one for one in path.glob("[!.]*") if one.is_file()]
    files.sort(key=lambda one: [int(k) if k.isdecimal() else k for k in re.split(r"(\d+)", one.name)])
    for file, place in zip(files, [{}] if path.is_file() else _named([one.stem for one in files]), strict=True):
        found = list(_in_file(file, place, columns, spring, sensitivity))
        if path.is_file() or file.suffix.lower() in usual or any(isinstance(one, ForceCurve) for one in found):
            there = True
            yield from found
    if not there:
        raise InputError(f"curve: '{path}' is not a file, nor a folder with one of force curves ({', '.join(usual)})")


def _named(stems: Sequence[str]) -> list[dict[str, float]]:
    """Places in a map, as the names of files have them.

    A dash before a number is its sign, ``x-1_y2``; one that all numbers have, ``x-1-y-2``, only stands between.
    """
    found = [[one for form in _FORMS if (one := re.search(form, stem, re.IGNORECASE))] for stem in stems]
    said = [one[0].groupdict() if one else {} for one in found]
    sign = "-" if all(number.startswith("-") for one in said for number in one.values()) else ""
    return [{name: float(text.lstrip(sign).replace(",", ".")) for name, text in one.items()} for one in said]


def _in_file(path: Path, place: dict[str, float], names: Names, *given: Quantity) -> Iterator[ForceCurve | Unread]:
    """The curves of a file, with this spring and sensitivity; for one that cannot be read, why, and of which file."""
    try:
        lines = _lines(path)
        table = _heading(lines, names)
        makers = list(_of_table(table, lines, *given) if table else _of_instrument(path, lines, *given))
    except (InputError, OSError) as error:
        yield Unread(InputError(f"{error} ('{path}')"), place, str(path))
        return
    for own, make in makers:
        try:
            yield make(place=place | own, source=str(path)).with_spring(given[0])
        except InputError as error:
            yield Unread(InputError(f"{error} ('{path}')"), place | own, str(path))


def _lines(path: Path) -> list[str]:
    """Lines of a file if it is a text."""
    with path.open("rb") as file:
        content = b"" if b"\0" in (begin := file.read(1024)) else begin + file.read()
    if not begin.strip():
        raise InputError("curve: the file is empty")
    try:
        return content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:  # of Windows
        return content.decode("latin-1").splitlines()


def _legs_by_way(piezo: Array, segment: AnyArray) -> AnyArray | None:
    """Names of legs and pauses by how the piezo moves in the segments of a file; None for a single segment.

    It still moves on for some samples after it was told to turn: they are in neither leg, whose fits they worsen.
    """
    numbers, way = np.unique(segment), np.arange(piezo.size) - np.argmax(piezo)
    words = np.full(piezo.size, "approach")
    for own in (segment == number for number in numbers):
        share = (piezo[own][-1] - piezo[own][0]) / max(float(np.ptp(piezo)), 1e-300)
        words[own] = "pause" if abs(share) < HELD else "approach" if share > 0.0 else "retract"
    if words[-1] != "approach":
        words[((words == "approach") & (way > 0)) | ((words == "retract") & (way < 0))] = "pause"
    return words if numbers.size > 1 else None


# Texts


def _legs_named(columns: str | Mapping[str, str]) -> list[dict[str, str]]:
    """Names of columns by what they hold; two where approach and retraction lie side by side."""
    text = columns if isinstance(columns, str) else ",".join(map("=".join, columns.items()))
    pairs = re.findall(r"(\w+)\s*=\s*(.+?)\s*(?:,(?=\s*\w+\s*=)|$)", text)
    first, last = dict(reversed(pairs)), dict(pairs)
    return [first] if first == last else [first, last]


def _cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line; where spaces are between them, a unit in brackets belongs to the name before it."""
    own = re.sub(r"\s+(?=[\[(])", "", line).split() if delimiter == " " else line.split(delimiter)
    return [cell.strip(' "') for cell in own]


def _places(cells: Sequence[str], names: Mapping[str, str]) -> _Places:
    """Where columns of these names are; nowhere if one is missing that is needed."""
    places: _Places = {}
    twice = ""
    for role, name in names.items():
        ((bare, unit),) = _NAME.findall(name.lstrip("-"))
        for k, cell in enumerate(cells):
            ((one, own),) = _NAME.findall(cell)
            if bare.casefold() == cell.casefold() or (bare.casefold() == one.casefold() and unit in ("", own)):
                twice = name if role in places else twice
                places[role] = (k, -1.0 if name.startswith("-") else 1.0, unit or own)
    enough = {"piezo", "tip"} & set(places) and {"force", "deflection"} & set(places)
    if enough and twice:
        raise InputError(f"curve: more than one column {twice}; leave one, or name it with its unit")
    return places if enough and (names is _OWN or len(places) == len(names)) else {}


def _heading(lines: Sequence[str], columns: Names) -> _Table | None:
    """The first line with names that are known, or given; none in a text of another kind."""
    known = [[_OWN], *map(_legs_named, _EXPORTS)] if columns is None else [_legs_named(columns)]
    for number, line in enumerate(lines):
        delimiter = next((one for one in "\t;," if one in line), " ")
        cells = [] if _NUMBERS.fullmatch(line) else _cells(line.lstrip("# ").removeprefix("columns:"), delimiter)
        for legs in ([_places(cells, one) for one in names] for names in known):
            below = next((one for one in lines[number + 1 :] if one.strip() and one[0] != "#"), "") if all(legs) else ""
            if all(legs) and (delimiter != " " or len(cells) == len(below.split())):  # and no sentence
                return number, delimiter, len(cells), legs
    if lines and columns is not None:
        raise InputError(_unknown(lines, columns))
    return None


def _of_table(table: _Table, lines: Sequence[str], spring: Quantity, sensitivity: Quantity) -> _Makers:
    """Curves of a text with names of columns that are known.

    Lines without a digit, such as one of units below the names or one at the end, are no rows, nor are those without a
    value in any column that is needed, as where one leg is longer than the other beside it.
    """
    start, delimiter, width, legs = table
    told = next((float(one[1].replace(",", ".")) for one in map(_SPRING.match, lines) if one), None)
    segments = np.cumsum([line.startswith("# segment:") for line in lines])
    below = [k for k in range(start + 1, len(lines)) if re.match(r"[^#]*\d", lines[k])]
    above = (line for line in lines[start + 1 : next(iter(below), start)] if re.match(r"# units:|\s*[^#\s]", line))
    units = _cells(next(above, "").removeprefix("# units: "), delimiter) + width * [""]
    rows: list[list[str]] = []
    for leg, places in enumerate(legs):
        for k in below:
            cells = _cells(lines[k], delimiter) + width * [""]
            if any(cells[width:]):
                much = f"row {k + 1} has {len(cells) - width} values for {width} columns"
                raise InputError(f"curve: {much}; decimal commas need another separator, such as a semicolon")
            if any(needed := [cells[place].replace(",", ".") for place, *_ in map(places.__getitem__, legs[0])]):
                rows.append([str(leg or segments[k]), *needed])
    if not rows:
        raise InputError("curve: the file has no rows below the names of its columns")
    columns: dict[str, AnyArray] = {}
    for role, texts in zip(("segment", *legs[0]), zip(*rows, strict=True), strict=True):
        columns[role] = np.array(texts)
        if role not in ("segment", "curve"):
            columns[role] = legs[0][role][1] * numbers([text or "nan" for text in texts], role)
    unit_of = {role: unit or units[place].strip("[]()") for role, (place, _, unit) in legs[0].items()}
    if unit_of.get("force") in ("m", "V"):  # of JPK
        columns["deflection"], unit_of["deflection"] = columns.pop("force"), unit_of.pop("force")
    about: dict[str, Any] = {"spring": told or spring, "deflected": told is not None, "sensitivity": sensitivity}
    about["units"] = {role: unit_of[role] for role in COLUMNS if unit_of.get(role)}
    labels = columns.pop("curve", np.zeros(len(rows)))
    for label in dict.fromkeys(labels.tolist()):
        own: dict[str, Any] = {role: values[labels == label] for role, values in columns.items()}
        at = {k: parse(f"{own.pop(k)[0]} {unit_of[k] or 'nm'}", "length", f"curve: {k}") for k in "xy" if k in own}
        if len(legs) == 1 and "segment" not in legs[0]:
            own["segment"] = _legs_by_way(own["piezo" if "piezo" in own else "tip"], own["segment"])
        yield at, partial(ForceCurve, **about, **own)


def _unknown(lines: Sequence[str], columns: Names = None) -> str:
    """That columns are not found; what they are called may be said in the line above the first numbers."""
    first = next((k for k, line in enumerate(lines) if _NUMBERS.fullmatch(line)), 0)
    above = lines[max(first - 1, 0)].strip()[:80]
    wanted = "piezo (or tip) and force (or deflection)" if columns is None else repr(columns)
    remedy = "write piezo [nm],force [nN] above the numbers, or give the names with --columns 'piezo=NAME,force=NAME'"
    return f"curve: the file has no columns {wanted} in its line {above!r}; {remedy}"


# Instruments


@contextmanager
def _reading(otherwise: str = "") -> Iterator[None]:
    """What afmformats prints is put aside, and what it raises, which may be anything, is an InputError."""
    try:
        with redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        if missing := [option for key, option in _MISSING.items() if key in getattr(error, "meta_keys", ())]:
            otherwise = f"curve: the file does not tell all that is needed: give {' and '.join(missing)}"
        said = f"curve: the file cannot be read by afmformats ({type(error).__name__}: {error}); {_REMEDY}"
        raise InputError(otherwise or said) from None


def _of_instrument(path: Path, lines: Sequence[str], spring: Quantity, sensitivity: Quantity) -> _Makers:
    """Curves that afmformats reads: SI units, heights that fall towards the surface."""
    given = {} if spring is None else {"spring constant": stiffness_of(spring)}
    if sensitivity is not None:
        factor, unit = (1.0, "nA") if path.suffix == ".txt" else (1e-9, "V")  # nA in texts of NT-MDT
        given["sensitivity"] = factor * scale("deflection", unit, sensitivity)
    with _reading(_unknown(lines) if lines and path.suffix.lower() not in _INSTRUMENTS else ""):
        import afmformats

        try:
            groups = afmformats.load_data(path)
        except afmformats.errors.MissingMetaDataError:
            groups = afmformats.load_data(path, meta_override=given)
    for data in groups:
        at = {key: 1e9 * float(data.metadata.get(f"position {key}", math.nan)) for key in ("x", "y")}
        place = at if all(map(math.isfinite, at.values())) else {}
        yield place, partial(_of_data, data, spring, given.get("sensitivity"))


def _of_data(data: Any, spring: Quantity, sensitivity: float | None, **about: Any) -> ForceCurve:
    """A curve; its forces are those of the spring that its file tells, if it does, and change with another."""
    with _reading():
        height = "height (measured)" if "height (measured)" in data.columns else "height (piezo)"
        piezo, force = -1e9 * np.asarray(data[height]), 1e9 * np.asarray(data["force"])
        segment = _legs_by_way(piezo, np.asarray(data["segment"])) if "segment" in data.columns else None
    if sensitivity is not None:
        if "sensitivity" not in data.metadata:
            raise InputError(
                f"sensitivity: {1e9 * sensitivity:g} nm/V; the file holds forces, not its own: leave it out"
            )
        force *= sensitivity / data.metadata["sensitivity"]
    told = data.metadata.get("spring constant")
    return ForceCurve(piezo, force, told or spring, segment, deflected=told is not None, **about)
