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
from contbranch.measure.force_curve import COLUMNS, ForceCurve, scale, stiffness_of

# Names of a text's columns by what they hold: one text, ``piezo=NAME,force=NAME``, or a mapping.
Names = str | Mapping[str, str] | None

# Those of our tables, and of texts that Optics11, JPK and NanoScope export, the last with the legs side by side. A minus
# reverses a column, for heights of JPK fall towards the surface.
_OWN = {role: role for role in (*COLUMNS, "segment", "curve", "x", "y")}
_HEIGHTS = ("smoothedMeasuredHeight", "measuredHeight", "smoothedStrainGaugeHeight", "strainGaugeHeight", "height")
_RAMP, _BENT = "Calc_Ramp_{}_nm [nm]", "Defl_{1}_{0} [{1}]"
_KNOWN = [[_OWN], [{"piezo": "Piezo (nm)", "deflection": "Cantilever (nm)"}]]
_KNOWN += [[{"piezo": f"-{height}", "force": "vDeflection"}] for height in _HEIGHTS]
_KNOWN += [
    [{"piezo": _RAMP.format(leg), "deflection": _BENT.format(leg, unit)} for leg in ("Ex", "Rt")]
    for unit in ("nm", "V")
]
# Parts of texts: a name with a unit in brackets, a line of numbers, a row that is no comment, a spring constant.
_NAME = re.compile(r"^(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?$", re.DOTALL)
_NUMBERS = re.compile(r"[\d.,;eE+\s-]*\d[\d.,;eE+\s-]*")
_SPRING = re.compile(r"(?:k \(N/m\)|# springConstant:)\s+(\d+[.,]?\d*(?:[eE][+-]?\d+)?)")
_TEXTS = (".csv", ".txt", ".tsv", ".dat")
_INSTRUMENTS = (".ibw", ".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".h5", ".tab", ".zip")
# What a file may lack, and how it is given.
_MISSING = {"spring constant": "--spring '0.5 N/m'", "sensitivity": "--sensitivity '50 nm/V'"}
# A segment that moves by a smaller share of the way of the piezo is a pause: creep 0.05 in measured files, legs 0.7.
HELD = 0.1
# Places in a map that are said in names of files: numbers, each behind a separator if there is one.
_ROW, _COLUMN = (rf"[_ ]?(?P<{name}>-?\d+(?:[.,]\d+)?)" for name in ("row", "column"))
_FORMS = (rf"(?<![a-z])x{_COLUMN}.*?y{_ROW}", rf"(?<![a-z])r(?:ow)?{_ROW}.*?c(?:ol(?:umn)?)?{_COLUMN}")

# Places in a map, and what makes the curves there.
_Makers = Iterator[tuple[dict[str, float], Callable[..., ForceCurve]]]
# Of a column by what it holds: its place in a row, its sign and its unit.
_Places = dict[str, tuple[int, float, str]]


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
    for one in found:
        if isinstance(one, Unread):
            raise one.error
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
        found = list(_in_file(file, place, spring, sensitivity, columns))
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


def _in_file(
    path: Path, place: dict[str, float], spring: Quantity, sensitivity: Quantity, columns: Names
) -> Iterator[ForceCurve | Unread]:
    """The curves of a file; of those that cannot be read, what is wrong, with its name."""
    source = str(path)
    try:
        lines = _lines(path)
        table = _heading(lines, columns)
        makers = list(
            _of_table(lines, table, spring, sensitivity) if table else _of_instrument(path, lines, spring, sensitivity)
        )
    except (InputError, OSError) as error:
        yield Unread(InputError(f"{error} ('{source}')"), place, source)
        return
    for own, make in makers:
        try:
            yield make(place=place | own, source=source).with_spring(spring)
        except InputError as error:
            yield Unread(InputError(f"{error} ('{source}')"), place | own, source)


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
    pairs = re.findall(r"(\w+)\s*=\s*(.*?)\s*(?:,(?=\s*\w+\s*=)|$)", text)
    first, last = dict(reversed(pairs)), dict(pairs)
    if not _enough(first) or not all(role in _OWN and name for role, name in pairs):
        raise InputError(
            f"columns: {text!r}; must be piezo=NAME,force=NAME with names in the file, of {', '.join(_OWN)}"
        )
    return [first] if first == last else [first, last]


def _enough(names: Mapping[str, object]) -> bool:
    """Whether there is a position and a force."""
    return bool({"piezo", "tip"} & set(names)) and bool({"force", "deflection"} & set(names))


def _cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line; where spaces are between them, a unit in brackets belongs to the name before it."""
    own = re.sub(r"\s+(?=[\[(])", "", line).split() if delimiter == " " else line.split(delimiter)
    return [cell.strip(' "') for cell in own]


def _places(cells: Sequence[str], names: Mapping[str, str]) -> _Places:
    """Where columns of these names are; nowhere if one is missing that is needed."""
    places: _Places = {}
    for role, name in names.items():
        ((bare, unit),) = _NAME.findall(name.lstrip("-"))
        for k, cell in enumerate(cells):
            ((one, own),) = _NAME.findall(cell)
            if bare.casefold() == cell.casefold() or (bare.casefold() == one.casefold() and unit in ("", own)):
                if role in places:
                    raise InputError(f"curve: more than one column {name}; leave one, or name it with its unit")
                places[role] = (k, -1.0 if name.startswith("-") else 1.0, unit or own)
    return places if _enough(places) and (names is _OWN or len(places) == len(names)) else {}


def _heading(lines: Sequence[str], columns: Names) -> tuple[int, str, int, list[_Places]] | None:
    """The line with names that are known, what is between them, how many, and where those are that are needed."""
    known = _KNOWN if columns is None else [_legs_named(columns)]
    for number, line in enumerate(lines):
        delimiter = next((one for one in "\t;," if one in line), " ")
        cells = [] if _NUMBERS.fullmatch(line) else _cells(line.lstrip("# ").removeprefix("columns:"), delimiter)
        for legs in ([_places(cells, one) for one in names] for names in known):
            below = next((one for one in lines[number + 1 :] if one.strip() and one[0] != "#"), "") if all(legs) else ""
            if all(legs) and (delimiter != " " or len(cells) == len(below.split())):  # and no sentence
                return number, delimiter, len(cells), legs
    if lines and columns is not None:
        raise _unknown(lines, columns)
    return None


def _of_table(
    lines: Sequence[str], table: tuple[int, str, int, list[_Places]], spring: Quantity, sensitivity: Quantity
) -> _Makers:
    """Curves of a text with names of columns that are known."""
    start, delimiter, width, legs = table
    told = next((float(one[1].replace(",", ".")) for one in map(_SPRING.match, lines) if one), None)
    segments = np.cumsum([line.startswith("# segment:") for line in lines])
    below = [k for k in range(start + 1, len(lines)) if re.match(r"[^#]*\d", lines[k])]
    above = (line for line in lines[start + 1 : next(iter(below), start)] if re.match(r"# units:|\s*[^#\s]", line))
    units = _cells(next(above, "").removeprefix("# units: "), delimiter) + width * [""]
    rows = []
    for leg, places in enumerate(legs):
        for k in below:
            if row := _row(k, lines[k], delimiter, width, places):
                rows.append({"segment": leg or segments[k], **row})
    if not rows:
        raise InputError("curve: the file has no rows below the names of its columns")
    columns = {role: np.array([row[role] for row in rows]) for role in rows[0]}
    unit_of = {role: unit or units[place].strip("[]()") for role, (place, _, unit) in legs[0].items()}
    if unit_of.get("force") in ("m", "V"):  # of JPK
        columns["deflection"], unit_of["deflection"] = columns.pop("force"), unit_of.pop("force")
    known: dict[str, Any] = {
        "units": {role: unit_of[role] for role in COLUMNS if unit_of.get(role)},
        "sensitivity": sensitivity,
        "spring": told or spring,
        "deflected": told is not None,
    }
    numbers = columns.pop("curve", np.zeros(len(rows)))
    for number in dict.fromkeys(numbers.tolist()):
        own: dict[str, Any] = {role: values[numbers == number] for role, values in columns.items()}
        where = [(role, f"{own.pop(role)[0]} {unit_of[role] or 'nm'}") for role in ("x", "y") if role in own]
        if len(legs) == 1 and "segment" not in legs[0]:
            own["segment"] = _legs_by_way(own["piezo" if "piezo" in own else "tip"], own["segment"])
        yield (
            {role: parse(text, "length", f"curve: {role}") for role, text in where},
            partial(ForceCurve, **known, **own),
        )


def _row(number: int, line: str, delimiter: str, width: int, places: _Places) -> dict[str, Any]:
    """What a row holds, NaN where it ends early; nothing where all cells are empty."""
    cells, decimal = _cells(line, delimiter) + width * [""], "." if delimiter == "," else ","
    try:
        if any(cells[width:]):
            raise ValueError
        row = {
            role: cells[place]
            if role in ("segment", "curve")
            else sign * float(cells[place].replace(decimal, ".") or "nan")
            for role, (place, sign, _) in places.items()
        }
    except ValueError:
        much = f"row {number + 1} has {len(cells) - width} values for {width} columns"
        remedy = "decimal commas need another separator, such as a semicolon, and other texts must go"
        raise InputError(f"curve: {much}; {remedy}: {line[:80]!r}") from None
    return row if any(cells[place] for place, *_ in places.values()) else {}


def _unknown(lines: Sequence[str], columns: Names = None) -> InputError:
    """That columns are not found; what they are called may be said in the line above the first numbers."""
    first = next((k for k, line in enumerate(lines) if _NUMBERS.fullmatch(line)), 0)
    above = lines[max(first - 1, 0)].strip()[:80]
    wanted = "piezo (or tip) and force (or deflection)" if columns is None else repr(columns)
    remedy = "write piezo [nm],force [nN] above the numbers, or give the names with --columns 'piezo=NAME,force=NAME'"
    return InputError(f"curve: the file has no columns {wanted} in its line {above!r}; {remedy}")


# Instruments


@contextmanager
def _reading(unknown: InputError | None = None) -> Iterator[None]:
    """What afmformats prints is put aside, and what it raises, which may be anything, is an InputError."""
    try:
        with redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        missing = [key for key in _MISSING if key in getattr(error, "meta_keys", ())]
        said = f"cannot be read by afmformats ({type(error).__name__}: {error}); unpack it, or export it as text "
        said += "(NanoScope Analysis: Export, ASCII) and name the columns with --columns"
        if missing:
            said = f"does not tell {' and '.join(missing)}: give {' and '.join(_MISSING[key] for key in missing)}"
        elif isinstance(error, ImportError):
            said = "needs afmformats: pip install 'contbranch[afm]', or give a CSV file"
        raise (None if missing else unknown) or InputError(f"curve: the file {said}") from None


def _of_instrument(path: Path, lines: Sequence[str], spring: Quantity, sensitivity: Quantity) -> _Makers:
    """Curves that afmformats reads: SI units, heights that fall towards the surface."""
    given = {} if spring is None else {"spring constant": stiffness_of(spring)}
    if sensitivity is not None:
        factor, unit = (1.0, "nA") if path.suffix == ".txt" else (1e-9, "V")  # nA in texts of NT-MDT
        given["sensitivity"] = factor * scale("deflection", unit, sensitivity)
    with _reading(_unknown(lines) if lines and path.suffix.lower() not in _INSTRUMENTS else None):
        import afmformats

        try:
            groups = afmformats.load_data(path)
        except afmformats.errors.MissingMetaDataError:
            groups = afmformats.load_data(path, meta_override=given)
    for data in groups:
        place = {key: 1e9 * float(data.metadata.get(f"position {key}", math.nan)) for key in ("x", "y")}
        known = all(map(math.isfinite, place.values()))
        yield place if known else {}, partial(_of_data, data, spring, given.get("sensitivity"))


def _of_data(data: Any, spring: Quantity, sensitivity: float | None, **about: Any) -> ForceCurve:
    """A curve; its forces are those of the spring that its file tells, if it does, and change with another."""
    with _reading():
        height = "height (measured)" if "height (measured)" in data.columns else "height (piezo)"
        piezo, force = -1e9 * np.asarray(data[height]), 1e9 * np.asarray(data["force"])
        segment = _legs_by_way(piezo, np.asarray(data["segment"])) if "segment" in data.columns else None
    if sensitivity is not None:
        if "sensitivity" not in data.metadata:
            raise InputError("sensitivity: given; the file holds forces, and not its own: leave it out")
        force *= sensitivity / data.metadata["sensitivity"]
    told = data.metadata.get("spring constant")
    return ForceCurve(piezo, force, told or spring, segment, deflected=told is not None, **about)
