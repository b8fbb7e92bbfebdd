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
# reverses a column: heights of JPK fall towards the surface.
_OWN = {role: role for role in (*COLUMNS, "segment", "curve", "x", "y")}
_HEIGHTS = ("smoothedMeasuredHeight", "measuredHeight", "smoothedStrainGaugeHeight", "strainGaugeHeight", "height")
_KNOWN = [[_OWN], [{"piezo": "Piezo (nm)", "deflection": "Cantilever (nm)"}]]
_KNOWN += [[{"piezo": f"-{height}", "force": "vDeflection"}] for height in _HEIGHTS]
_KNOWN += [
    [{"piezo": f"Calc_Ramp_{leg}_nm [nm]", "deflection": f"Defl_{unit}_{leg} [{unit}]"} for leg in ("Ex", "Rt")]
    for unit in ("nm", "V")
]
_HEADING = re.compile(r"(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?")
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
_NAMED = [
    re.compile(rf"(?<![a-z]){form}", re.IGNORECASE)
    for form in (rf"x{_COLUMN}.*?y{_ROW}", rf"r(?:ow)?{_ROW}.*?c(?:ol(?:umn)?)?{_COLUMN}")
]

# Places in a map, and what makes the curves there.
_Makers = list[tuple[dict[str, float], Callable[..., ForceCurve]]]
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


@dataclass(frozen=True)
class _File:
    """A file, and how it is to be read."""

    path: Path
    spring: Quantity
    sensitivity: Quantity
    columns: Names

    def curve(self, told: float | None, **columns: Any) -> ForceCurve:
        """A curve; its forces are those of the spring that its file tells, if it does, and change with another."""
        first = self.spring if told is None else told
        curve = ForceCurve(spring=first, deflected=told is not None, source=str(self.path), **columns)
        return curve.with_spring(self.spring)


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
    found = []
    for one in curves_in(path, spring, sensitivity, columns):
        if isinstance(one, Unread):
            raise one.error
        found.append(one)
    return found


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
    path, usual = as_path(path, "curve"), (*_TEXTS, *_INSTRUMENTS)
    if path.is_dir():
        files = [one for one in path.iterdir() if one.is_file() and not one.name.startswith(".")]
        files.sort(key=lambda one: [int(k) if k.isdecimal() else k for k in re.split(r"(\d+)", one.name)])
        there = False
        for file, place in zip(files, _named([one.stem for one in files]), strict=True):
            found = list(_in_file(_File(file, spring, sensitivity, columns), place))
            if file.suffix.lower() in usual or not isinstance(found[0], Unread):
                there = True
                yield from found
        if not there:
            raise InputError(f"curve: no file in '{path}' is one of force curves ({', '.join(usual)})")
    elif path.is_file():
        yield from _in_file(_File(path, spring, sensitivity, columns), {})
    else:
        raise InputError(f"curve: '{path}' is not a file")


def _named(stems: Sequence[str]) -> list[dict[str, float]]:
    """Places in a map, as the names of files have them.

    A dash before a number is its sign, ``x-1_y2``; one that all numbers have, ``x-1-y-2``, only stands between.
    """
    said = [next((one.groupdict() for pattern in _NAMED if (one := pattern.search(stem))), {}) for stem in stems]
    sign = "-" if all(number.startswith("-") for one in said for number in one.values()) else ""
    return [{name: float(text.lstrip(sign).replace(",", ".")) for name, text in one.items()} for one in said]


def _in_file(file: _File, place: dict[str, float]) -> Iterator[ForceCurve | Unread]:
    """The curves of a file; of those that cannot be read, what is wrong, with its name."""
    source = str(file.path)
    try:
        lines = _lines(file.path)
        makers = _of_table(file, lines) or _of_instrument(file, lines)
    except InputError as error:
        yield Unread(InputError(f"{error} ('{source}')"), place, source)
        return
    for own, make in makers:
        try:
            yield make(place=place | own)
        except InputError as error:
            yield Unread(InputError(f"{error} ('{source}')"), place | own, source)


def _lines(path: Path) -> list[str]:
    """Lines of a file if it is a text."""
    try:
        with path.open("rb") as file:
            content = b"" if b"\0" in (begin := file.read(1024)) else begin + file.read()
    except OSError as error:
        raise InputError(f"curve: the file cannot be read ({error.strerror})") from None
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
    parts = [part.partition("=") for part in re.split(r",\s*(?=\w+\s*=)", text)]
    pairs = [(role.strip(), name.strip()) for role, _, name in parts]
    first, last = dict(reversed(pairs)), dict(pairs)
    if not _enough(first) or not all(role in _OWN and name for role, name in pairs):
        wanted = f"piezo=NAME,force=NAME with names in the file, of {', '.join(_OWN)}"
        raise InputError(f"columns: {text!r}; must be {wanted}")
    return [first] if first == last else [first, last]


def _enough(names: Mapping[str, object]) -> bool:
    """Whether there is a position and a force."""
    return bool({"piezo", "tip"} & set(names)) and bool({"force", "deflection"} & set(names))


def _cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line; where spaces are between them, a unit in brackets belongs to the name before it."""
    own = re.sub(r"\s+(?=[\[(])", "", line).split() if delimiter == " " else line.split(delimiter)
    return [cell.strip(' "') for cell in own]


def _bare(name: str) -> tuple[str, str]:
    """A name in small letters, and the unit in brackets behind it."""
    match = _HEADING.fullmatch(name)
    return (match[1].casefold(), match[2] or "") if match else ("", "")


def _places(cells: Sequence[str], names: Mapping[str, str]) -> _Places:
    """Where columns of these names are; nowhere if one is missing that is needed."""
    places: _Places = {}
    twice = ""
    for role, name in names.items():
        sign, (bare, unit) = -1.0 if name.startswith("-") else 1.0, _bare(name.lstrip("-"))
        for k, cell in enumerate(cells):
            one, own = _bare(cell)
            if cell.casefold() == bare or (one == bare and unit in ("", own)):
                twice = name if role in places else twice
                places[role] = (k, sign, unit or own)
    if not _enough(places) or (names is not _OWN and len(places) < len(names)):
        return {}
    if twice:
        raise InputError(f"curve: more than one column {twice}; leave one, or name it with its unit")
    return places


def _heading(columns: Names, lines: Sequence[str]) -> tuple[int, str, int, list[_Places]] | None:
    """The line with names that are known, what is between them, how many, and where those are that are needed."""
    known = _KNOWN if columns is None else [_legs_named(columns)]
    for number, line in enumerate(lines):
        if _NUMBERS.fullmatch(line):
            continue
        delimiter = next((one for one in "\t;," if one in line), " ")
        cells = _cells(line.lstrip("# ").removeprefix("columns:"), delimiter)
        legs = next((legs for names in known if all(legs := [_places(cells, one) for one in names])), [])
        below = next((one for one in lines[number + 1 :] if legs and one.strip() and not one.startswith("#")), "")
        if legs and (delimiter != " " or len(cells) == len(below.split())):  # and no sentence
            return number, delimiter, len(cells), legs
    if lines and columns is not None:
        raise _unknown(columns, lines)
    return None


def _of_table(file: _File, lines: Sequence[str]) -> _Makers:
    """Curves of a text with names of columns that are known; none of another."""
    if (heading := _heading(file.columns, lines)) is None:
        return []
    start, delimiter, width, legs = heading
    told = next((float(match[1].replace(",", ".")) for line in lines if (match := _SPRING.match(line))), None)
    units = next((line.split()[2:] for line in lines if line.startswith("# units:")), [])
    segments = np.cumsum([line.startswith("# segment:") for line in lines])
    below = [k for k in range(start + 1, len(lines)) if lines[k].strip() and not lines[k].lstrip().startswith("#")]
    if below and not re.search(r"\d", lines[below[0]]):
        units = [cell.strip("[]()") for cell in _cells(lines[below.pop(0)], delimiter)]
    rows: list[dict[str, Any]] = []
    for leg, places in enumerate(legs):
        for k in below:
            cells = _cells(lines[k], delimiter) + width * [""]
            if len(legs) > 1 and not all(cells[place] for place, *_ in places.values()):
                continue
            try:
                row = _row(cells, width, places, "." if delimiter == "," else ",")
            except ValueError:
                much = f"row {k + 1} has {len(cells) - width} values for {width} columns"
                remedy = "decimal commas need another separator, such as a semicolon, and other texts must go"
                raise InputError(f"curve: {much}; {remedy}: {lines[k][:80]!r}") from None
            rows.append({"segment": leg or segments[k], **row})
    if not rows:
        raise InputError("curve: the file has no rows below the names of its columns")
    columns = {role: np.array([row[role] for row in rows]) for role in rows[0]}
    unit_of = {role: unit or "".join(units[place : place + 1]) for role, (place, _, unit) in legs[0].items()}
    if unit_of.get("force") in ("m", "V"):  # of JPK
        columns["deflection"], unit_of["deflection"] = columns.pop("force"), unit_of.pop("force")
    known = {role: unit_of[role] for role in COLUMNS if unit_of.get(role)}
    numbers = columns.pop("curve", np.zeros(len(rows)))
    makers: _Makers = []
    for number in dict.fromkeys(numbers.tolist()):
        own: dict[str, Any] = {role: values[numbers == number] for role, values in columns.items()}
        where = {role: parse(f"{own.pop(role)[0]} {unit_of[role] or 'nm'}", "length", f"curve: {role}")
                 for role in ("x", "y") if role in own}  # fmt: skip
        if len(legs) == 1 and "segment" not in legs[0]:
            own["segment"] = _legs_by_way(own["piezo" if "piezo" in own else "tip"], own["segment"])
        makers.append((where, partial(file.curve, told, units=known, sensitivity=file.sensitivity, **own)))
    return makers


def _row(cells: Sequence[str], width: int, places: _Places, decimal: str) -> dict[str, Any]:
    """What a row holds, NaN where it ends early; ValueError for one that is too long, or has a text for a number."""
    if any(cells[width:]):
        raise ValueError
    return {
        role: cells[place]
        if role in ("segment", "curve")
        else sign * float(cells[place].replace(decimal, ".") or "nan")
        for role, (place, sign, _) in places.items()
    }


def _unknown(columns: Names, lines: Sequence[str]) -> InputError:
    """That columns are not found; what they are called may be said in the line above the first numbers."""
    first = next((k for k, line in enumerate(lines) if _NUMBERS.fullmatch(line)), 0)
    above = lines[max(first - 1, 0)].strip()[:80]
    wanted = "piezo (or tip) and force (or deflection)" if columns is None else f"{columns!r}"
    remedy = "write piezo [nm],force [nN] above the numbers, or give the names with --columns 'piezo=NAME,force=NAME'"
    return InputError(f"curve: the file has no columns {wanted} in its line {above!r}; {remedy}")


# Instruments


@contextmanager
def _reading(file: _File, lines: Sequence[str] = ()) -> Iterator[None]:
    """What afmformats prints is put aside, and what it raises, which may be anything, is an InputError."""
    try:
        with redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (KeyboardInterrupt, SystemExit, InputError):
        raise
    except BaseException as error:
        said = f"cannot be read by afmformats ({type(error).__name__}: {error}); unpack it, or export it as text "
        said += "(NanoScope Analysis: Export, ASCII) and name the columns with --columns"
        if isinstance(error, ImportError):
            said = "needs afmformats: pip install 'contbranch[afm]', or give a CSV file"
        elif missing := [key for key in _MISSING if key in getattr(error, "meta_keys", ())]:
            said = f"does not tell {' and '.join(missing)}: give {' and '.join(_MISSING[key] for key in missing)}"
        elif lines and file.path.suffix.lower() not in _INSTRUMENTS:
            raise _unknown(None, lines) from None
        raise InputError(f"curve: the file {said}") from None


def _of_instrument(file: _File, lines: Sequence[str]) -> _Makers:
    """Curves that afmformats reads: SI units, heights that fall towards the surface."""
    given = {} if file.spring is None else {"spring constant": stiffness_of(file.spring)}
    if file.sensitivity is not None:
        factor, unit = (1.0, "nA") if file.path.suffix == ".txt" else (1e-9, "V")  # nA in texts of NT-MDT
        given["sensitivity"] = factor * scale("deflection", unit, file.sensitivity)
    with _reading(file, lines):
        import afmformats

        try:
            groups = afmformats.load_data(file.path)
        except afmformats.errors.MissingMetaDataError:
            groups = afmformats.load_data(file.path, meta_override=given)
    return [(_position(data.metadata), partial(_of_data, file, data, given.get("sensitivity"))) for data in groups]


def _of_data(file: _File, data: Any, sensitivity: float | None, place: dict[str, float]) -> ForceCurve:
    with _reading(file):
        heights = [name for name in ("height (measured)", "height (piezo)") if name in data.columns]
        if not heights or "force" not in data.columns:
            raise InputError(f"curve: it has {', '.join(data.columns)}; needs a force and a height of the piezo")
        piezo, force = -1e9 * np.asarray(data[heights[0]]), 1e9 * np.asarray(data["force"])
        segment = _legs_by_way(piezo, np.asarray(data["segment"])) if "segment" in data.columns else None
    if sensitivity is not None:
        if "sensitivity" not in data.metadata:
            raise InputError(f"sensitivity: {file.sensitivity!r}; the file holds forces, and not its own: leave it out")
        force *= sensitivity / data.metadata["sensitivity"]
    return file.curve(data.metadata.get("spring constant"), piezo=piezo, force=force, segment=segment, place=place)


def _position(metadata: Mapping[str, Any]) -> dict[str, float]:
    """Where in a map a curve was measured, in nm, or its row and column."""
    for factor, names in ((1e9, {"x": "position x", "y": "position y"}),
                          (1.0, {"column": "grid index x", "row": "grid index y"})):  # fmt: skip
        known = {key: factor * float(metadata.get(name, math.nan)) for key, name in names.items()}
        if all(map(math.isfinite, known.values())):
            return known
    return {}
