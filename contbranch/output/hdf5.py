"""Results in HDF5 files; the layout is described in ``docs/file-layout.md``.

A file is made in memory and written at once, behind a block with its checksum; nothing is read of one that differs.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from contbranch.contact.height_map import HeightMap
from contbranch.contact.text import as_path
from contbranch.errors import InputError, ModelError, warned
from contbranch.output import files
from contbranch.output.sweep_file import is_sweep, load_sweep, rebuilt, refuse_later
from contbranch.results.activated import Activated, ActivatedJump
from contbranch.results.advice import Advice, Candidate
from contbranch.results.diagram import (
    PATIENCE as LONGEST,
    Branch,
    Cost,
    Diagram,
    Event,
    Exponent,
    LocalExponent,
    ModelChoice,
    Solution,
    State,
    Window,
)
from contbranch.results.equilibria import Barrier, Equilibria
from contbranch.results.fit import Correlations, Fit, FitJump, LawFit
from contbranch.results.fit_map import FitMap
from contbranch.results.followed import Followed, Special
from contbranch.results.loop import Hysteresis, Jump, Path as LoopPath
from contbranch.results.phase import Part, PhaseDiagram
from contbranch.results.profile import CellFields, ModeShape, Profile
from contbranch.results.record import (
    HEAD,
    Record,
    Result,
    UnitNames,
    Values,
    columns,
    key_of,
    kind_of,
    quantity_of,
    same,
)
from contbranch.results.sweep import Sweep
from contbranch.watch import kept, patient

if TYPE_CHECKING:
    import h5py


Kind = TypeVar("Kind", bound=Record)
Kept = TypeVar("Kept")

# What can be read again, besides sweeps.
_KINDS = (Diagram, Hysteresis, Followed, Equilibria, PhaseDiagram, Fit, Advice, Activated)
# What of a diagram is not read as a document is.
_APART = {"contact", "unit_names", "tip", "events", "mode_shapes", "local_exponents"}
# What stands in a column of a table where there is no value: modes are counted from 1.
_BLANK = {float: math.nan, int: 0, str: ""}
# Records within documents.
_PARTS: Values = {
    one.__name__: one
    for one in (
        *(Branch, State, ModelChoice, Cost, Event, Exponent, Window, LoopPath, Jump, Special, Followed, Part, Barrier),
        *(ActivatedJump, Profile, CellFields, Correlations, FitJump, LawFit, Candidate),
    )
}
_ARRAYS: Values = {"Array": float, "Integers": np.int64}
_PLAIN: Values = {"bool": bool, "int": int, "float": float, "str": str}
# The block before what HDF5 reads: the least size that it allows, and what is written there.
_BLOCK = 512
# A program that reads everything in a file.
_READER = """import h5py, io, sys

def read(name, item):
    list(item.attrs.items())
    if isinstance(item, h5py.Dataset):
        item[()]

file = h5py.File(io.BytesIO(sys.stdin.buffer.read()))
read("", file)
file.visititems(read)
"""
# Seconds for which a file without checksum is tried out.
PATIENCE = 20.0
_LABEL = "contbranch: an HDF5 file behind this block of {} bytes\nsha256 {}\n"
_HDF5 = b"\x89HDF\r\n\x1a\n"


def save(result: Result, path: str | Path) -> None:
    """Write a result to an HDF5 file, which replaces `path` only when it is complete.

    It is stored with what is computed when asked for: local exponents, profiles, the critical eigenvalue of azimuthal
    modes, areas of loops, so that a loaded one answers what the present one does; of an event that was followed without
    its exponent. A solution is stored as a diagram whose branches have one point each.

    Raises
    ------
    InputError
        If the file cannot be written, or the file of a sweep is not there any more.
    """
    with files.reserved(path) as place:
        place.write(content(result))


def content(result: Result) -> bytes:
    """What `save` writes: of a sweep a copy of its file."""
    if isinstance(result, Sweep):
        if not is_sweep(result.path):
            raise InputError(f"path: the sweep's own file '{result.path}' is not there or not complete; resume it")
        return result.path.read_bytes()
    if isinstance(result, Solution):
        result = _as_diagram(result)
    import h5py

    with h5py.File("memory", "w", driver="core", backing_store=False, userblock_size=_BLOCK) as file:
        _write_result(file, result)
        file.flush()
        image: bytes = file.id.get_file_image()
    return _label(image) + image


def _label(image: bytes) -> bytes:
    """The block before an image of an HDF5 file, which tells any change of it."""
    return _LABEL.format(_BLOCK, hashlib.sha256(image).hexdigest()).encode().ljust(_BLOCK, b"\n")


def _as_diagram(solution: Solution) -> Diagram:
    """A diagram of the states found."""
    names = ("contact", "model", "cost", "status", "message", "control", "stiffness", "accuracy")
    kept = {name: getattr(solution, name) for name in names}
    branches = tuple(_point(state) for state in solution.known)
    return Diagram(branches=branches, events=(), thresholds={}, unit_names=solution.units, **kept)


def _point(state: State) -> Branch:
    """Return a branch of one point."""
    known: Values = {item.name: getattr(state, item.name, None) for item in fields(Branch)}
    known |= {f"{name}_error": state.error.get(name, math.nan) for name in ("load", "displacement")}
    found = {name: np.array([value]) for name, value in known.items() if value is not None}
    cells = () if state.in_cell is None else (state.cell,)
    return Branch(**found, profiles=() if state.profile is None else (state.profile,), cells=cells)


def load(
    path: str | Path,
) -> Diagram | Hysteresis | Followed | Equilibria | PhaseDiagram | Fit | Advice | Activated | Sweep:
    """Read what `save` wrote: a diagram, loop, followed event, equilibria, phase diagram, fit, advice or sweep.

    The contact is None, with a warning, where it cannot be made again: a law or tip of the user's that is not imported.

    Raises
    ------
    InputError
        If the file is missing, no HDF5 file, of another format, of a later version, or damaged.
    """
    import h5py

    path = as_path(path)
    if is_sweep(path):
        return load_sweep(path)
    image, verified = _verified(path)
    try:
        if not verified:
            _try_out(image)
        with h5py.File(io.BytesIO(image), "r") as file:
            kind = _kind_of(file, path)
            if not verified:
                text = f"'{path}' has no checksum, as older versions wrote it: what it holds cannot be verified"
                warned(f"{text}; save it again")
            found = _read_diagram(file) if kind is Diagram else _made(kind, _read_object(file), file.get("tip"))
        if not verified:
            _use(found)
    except InputError:
        raise
    except Exception as error:  # of a file without checksum: HDF5 and what reads it may stumble over anything
        reason = " ".join(str(error).replace('"', "").split())
        raise InputError(f"path: '{path}' is damaged ({reason}); write it again") from None
    if found.contact is None:
        text = f"'{path}': the contact has a tip or law that is not at hand; import its class first, or do without"
        warned(text)
    return found


def _try_out(image: bytes) -> None:
    """Raise OSError for a file on which HDF5 hangs or crashes: a process of its own reads everything in it first.

    (Damaged as they may be, files that it survives do nothing worse than raise errors.)
    """
    try:
        child = subprocess.run([sys.executable, "-c", _READER], input=image, capture_output=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        raise OSError("HDF5 comes to no end with it") from None
    if child.returncode not in (0, 1):  # 1: an error that is raised here as well
        raise OSError("HDF5 crashes on it")


def _use(found: Result) -> None:
    """Raise what a result of which parts may be missing, or of another kind, raises when it is used."""
    from contbranch.output.page import page
    from contbranch.output.plot import draw

    for use in (str, content, lambda one: one.table().csv(), draw, page):
        with suppress(InputError, ModelError, NotImplementedError):
            use(found)


def _verified(path: Path) -> tuple[bytes, bool]:
    """The image of an HDF5 file that is what was written, or of one that has no checksum, and which of them it is."""
    if not path.is_file():
        raise InputError(f"path: '{path}' is not a file; give an HDF5 file that contbranch wrote")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"path: '{path}' cannot be read ({error.strerror}); give a readable file") from None
    image = data[_BLOCK:]
    if data[:_BLOCK] == _label(image):
        return image, True
    if data.startswith(_HDF5):
        return data, False
    if _HDF5 not in data[: _BLOCK + len(_HDF5)] and not data.startswith(b"contbranch: "):
        raise InputError(f"path: '{path}' is not an HDF5 file; give one that contbranch wrote")
    raise InputError(f"path: '{path}' is damaged (it is not what its checksum says); write it again")


def _kind_of(file: h5py.File, path: Path) -> Any:
    """What the file holds; InputError if it is nothing that can be read here, or of a later version."""
    found = file.attrs.get("format")
    kinds: dict[str, Any] = {kind.format: kind for kind in _KINDS}
    if found in (Sweep.format, FitMap.format):  # which end with their checksum
        raise InputError(f"path: '{path}' is damaged (its end is not what was written); run the sweep again")
    if found not in kinds:
        raise InputError(f"path: '{path}' holds {found or 'something else'}; must hold one of {', '.join(kinds)}")
    refuse_later(file, path)
    return kinds[found]


# Writing


def _write_result(file: h5py.File, result: Result) -> None:
    top = result.head()
    names = top.get("unit_names", {})
    file.attrs.update({key: top[key] for key in ("format", "version", "units")})
    for key, value in (("unit_names", names), ("contact", top["contact"])):
        if isinstance(result, Diagram):
            file[key] = json.dumps(value, ensure_ascii=False)  # no attribute: a tabulated law may be long
        else:
            _write(file, key, value, {})
    tip = None if result.contact is None else result.contact.tip
    if isinstance(tip, HeightMap):  # of which the description has only a digest
        _write(file, "tip", {"heights": tip.heights}, {"heights": names.get("gap", "")})
    for key, value in _parts("", result):
        _write(file, key, value, names)
    if isinstance(result, Diagram):
        shapes = {k: event.mode_shape for k, event in enumerate(result.events) if event.mode_shape is not None}
        _write(file, "mode_shapes", shapes, {"radius": names.get("radius", "")})  # the rest is relative to the gap


def _write(group: h5py.Group, name: str, value: Any, names: UnitNames) -> None:
    """Write a value: an array as dataset with its unit, numbers and texts as attributes, everything else as groups.

    A list of numbers is an array, with NaN for null; in a mapping null is an attribute without value.
    """
    import h5py

    if value is None or (name in ("profiles", "cells") and not value):
        return
    listed = isinstance(value, list | tuple) and name != "events"
    if listed and value and all(isinstance(item, str) for item in value):
        group[name] = list(value)
        return
    if listed and not any(isinstance(item, list | tuple | Mapping | Record) for item in value):
        value = np.array([np.nan if item is None else item for item in value], dtype=float)
    if isinstance(value, np.ndarray):
        data = group.create_dataset(name, data=value, compression="gzip" if value.ndim > 1 else None)
        if unit := names.get(quantity_of(name)):
            data.attrs["unit"] = unit
    elif isinstance(value, int | float | str | np.generic):
        group.attrs[name] = value
    elif name == "events":
        _write_table(group.create_group(name), Event, value, names)
    else:
        inner = group.create_group(name, track_order=isinstance(value, Mapping))  # read in the order of a dictionary
        for key, one in _parts(name, value):
            if one is None and isinstance(value, Mapping):
                inner.attrs[str(key)] = h5py.Empty("f8")
            _write(inner, str(key), one, names)


def _parts(name: str, value: Any) -> Iterable[tuple[Any, Any]]:
    """What a group holds: of profiles their arrays one behind the other, and where each begins."""
    if name == "profiles":
        joined = {item.name: np.concatenate([getattr(one, item.name) for one in value]) for item in fields(Profile)}
        return {**joined, "offsets": np.cumsum([0, *(len(one.r) for one in value)])}.items()
    if isinstance(value, Event):  # what was followed, without its exponent, which takes long
        return value.brief().items()
    if isinstance(value, Record):
        own = [item for item in fields(value) if item.name not in HEAD]
        found = {**value.items(), **{key_of(item): value.held(item.name) for item in own if item.name != "area"}}
        if isinstance(value, Jump | Hysteresis):
            found["area"] = _area(value)
        if name and isinstance(value, Result):  # a part of another, whose contact may differ
            found["contact"] = value.head()["contact"]
        return found.items()
    return value.items() if isinstance(value, Mapping) else enumerate(value)


def _area(record: Jump | Hysteresis) -> float | None:
    """An area that nobody has asked for, as far as some seconds go."""
    with suppress(ModelError), patient(LONGEST):
        return kept(lambda: record.area, None)
    return None


def _write_table(group: h5py.Group, kind: type[Record], records: Sequence[Record], names: UnitNames) -> None:
    """Write records as columns with their units."""
    import h5py

    for column in columns(kind):
        found = [column.of(record) for record in records]
        values = [_BLANK[column.kind] if value is None else value for value in found]
        form = {float: np.float64, int: np.int64, str: h5py.string_dtype()}[column.kind]
        data = group.create_dataset(column.name, data=values, shape=(len(values),), dtype=form)
        if unit := names.get(column.unit):
            data.attrs["unit"] = unit


# Reading


def _read_diagram(file: h5py.File) -> Diagram:
    content = {key: _read(file[key]) for key in file.keys() - _APART}
    content |= {key: _python(value) for key, value in file.attrs.items()} | {"events": ()}
    texts = {key: json.loads(file[key].asstr()[()]) for key in ("contact", "unit_names")}
    found = _made(Diagram, {**content, **texts, "description": texts["contact"]}, file.get("tip"))
    exponents = {int(key): _made(LocalExponent, _read_object(group)) for key, group in file["local_exponents"].items()}
    events = _read_events(file["events"], file.get("mode_shapes", {}))
    return replace(found, events=events, local_exponents=exponents)


def _read(item: h5py.Group | h5py.Dataset) -> Any:
    return _read_object(item) if hasattr(item, "keys") else _read_array(item)


def _read_object(group: h5py.Group) -> Any:
    """What `_write` wrote."""
    found = {key: _read(item) for key, item in group.items()}
    if found and all(key.isdigit() for key in found) and not group.attrs:
        return [found[str(number)] for number in range(len(found))]
    return found | {key: _python(value) for key, value in group.attrs.items()}


def _read_array(data: h5py.Dataset) -> Any:
    return (data.asstr() if data.dtype.kind == "O" else data)[()]


def _python(value: Any) -> Any:
    """An attribute as Python has it."""
    if getattr(value, "shape", ()) is None:  # it has no value
        return None
    return value.item() if isinstance(value, np.generic) else value


def _made(kind: type[Kind], content: Mapping[str, Any], tip: h5py.Group | None = None) -> Kind:
    """The record of an object of a document; KeyError where something is missing that has no default.

    `tip`: where the heights of its contact's height map are, which are not in the document.
    """
    found: Values = {}
    for item in fields(kind):
        name, said = key_of(item), str(item.type)
        inner = next((_PARTS[word] for word in re.findall(r"\w+", said) if word in _PARTS), None)
        value = content.get(name)
        if name == "contact" and issubclass(kind, Result):
            own = {} if tip is None else {"tip": {**content[name]["tip"], "heights": tip["heights"][()]}}
            value = rebuilt({**content[name], **own})
        elif name == "profiles" and value is not None:
            joined, parts = _made(Profile, value), pairwise(value["offsets"])
            value = tuple(Profile(*(getattr(joined, one.name)[i:j] for one in fields(Profile))) for i, j in parts)
        elif name == "cells" and value is not None:
            value = tuple(_made(CellFields, one) for one in value)
        elif inner is not None and value is not None:
            value = _nested(
                inner, value, {"contact": content.get("contact"), "unit_names": content.get("unit_names", {})}
            )
        elif (plain := re.match(r"tuple\[(bool|int|float|str)\b", said)) and value is not None:
            blank = "None" in said  # written as NaN
            value = tuple(None if blank and one != one else _PLAIN[plain[1]](one) for one in value)
        elif (one := _ARRAYS.get(said.removesuffix(" | None"))) is not None and value is not None:
            value = np.asarray(value, one)
        if name in content or "None" in said:
            found[item.name] = value
        elif item.default is MISSING and item.default_factory is MISSING:
            raise KeyError(f"{kind.__name__} has no {name}")
    return kind(**found)


def _nested(kind: type[Kind], value: Any, outer: Values) -> Any:
    """The record of an object within another, or records of a list of them; results share the contact of the outer."""
    if isinstance(value, Mapping):
        return _made(kind, {**outer, **value} if issubclass(kind, Result) else value)
    return tuple(_nested(kind, one, outer) for one in value)


def _read_events(group: h5py.Group, shapes: Mapping[str, h5py.Group]) -> tuple[Event, ...]:
    # Files of the first version have no modes and verdicts: what may be None may be missing.
    there = [column for column in columns(Event) if column.name in group]
    read = {column.path: group[column.name] for column in there}
    listed = [_read_array(data).tolist() for data in read.values()]
    events = [_assembled(Event, dict(zip(read, row, strict=True))) for row in zip(*listed, strict=True)]
    modes = {int(number): _made(ModeShape, _read_object(shape)) for number, shape in shapes.items()}
    return tuple(replace(event, mode_shape=modes.get(number)) for number, event in enumerate(events))


def _assembled(kind: type[Kind], cells: Mapping[tuple[str, ...], Any], path: tuple[str, ...] = ()) -> Kind:
    """The record of a row of a table, whose cells are found by their path in it."""
    found: Values = {}
    for item in fields(kind):
        held, within = kind_of(item), (*path, item.name)
        inside = {other: cell for other, cell in cells.items() if other[: len(within)] == within}
        if held is None:
            continue
        if "None" in str(item.type) and all(same(cell, _BLANK[type(cell)]) for cell in inside.values()):
            found[item.name] = None
        elif issubclass(held, Record):
            found[item.name] = _assembled(held, cells, within)
        else:
            found[item.name] = {one[-1]: cell for one, cell in inside.items()} if held is dict else cells[within]
    return kind(**found)
