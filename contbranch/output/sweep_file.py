"""Sweeps in HDF5 files that xarray opens: parameters are dimensions, curves lie one behind the other in a group.

A block behind what HDF5 reads has its checksum. Files are written piece by piece: no more than a few MB are in memory.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contbranch.arrays import AnyArray, Columns, Integers
from contbranch.contact.contact import Contact
from contbranch.errors import InputError
from contbranch.results.diagram import Branch, Cost, Diagram, Event, ModelChoice
from contbranch.results.fit_map import FitMap
from contbranch.results.profile import Profile
from contbranch.results.record import VERSION, Values
from contbranch.results.sweep import Sweep, SweepTask, values_at
from contbranch.results.table import quantity

if TYPE_CHECKING:
    import h5py


Record = tuple[Values, Columns]

_BLOCK = 512
_LABEL = b"contbranch: an HDF5 file before this block of %d bytes\nsha256 %s\n"
_PIECE = 1 << 20  # values held before they are written
_LENGTH = "This is a netCDF dimension but not a netCDF variable. %10d"
_GROUP = "tasks"
_PACKED: Values = {"chunks": (1 << 14,), "maxshape": (None,), "compression": 1, "shuffle": True}
_ABOUT = ("status", "message", "wall_s", "key", "computed")
_TIMES = ("key", "run", "wall_s")


def write_sweep(sweep: Sweep, records: Callable[[], Iterable[Record]], path: Path) -> None:
    """Write a sweep whose tasks have all ended; `records`, called twice, gives those of its tasks in their order."""
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs.update({"format": sweep.format, "version": VERSION, "mode": sweep.mode, "message": sweep.message})
        file.attrs["parameters"] = json.dumps(list(sweep.parameters))
        for name in ("description", "unit_names"):
            file[name] = json.dumps(getattr(sweep, name), ensure_ascii=False)
        _write_tasks(file, sweep)
        _write_records(file.create_group(_GROUP), len(sweep.tasks), records)
    with open(path, "ab") as end:
        end.write(_label(path, os.path.getsize(path)))
        end.flush()
        os.fsync(end.fileno())


def _label(path: Path, length: int) -> bytes:
    """The block behind the first bytes of a file, which tells any change of them."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        for piece in iter(partial(file.read, _PIECE), b""):
            digest.update(piece[:length])
            length -= len(piece[:length])
    return (_LABEL % (_BLOCK, digest.hexdigest().encode())).ljust(_BLOCK, b"\n")


def _write_tasks(file: h5py.File, sweep: Sweep) -> None:
    """What is said of each task, along the parameters of a grid or along the tasks."""
    import h5py

    grid, count = sweep.mode == "grid", len(sweep.tasks)
    dimensions = [] if grid else [_scale(file, "task", np.arange(count))]
    for name, values in sweep.axes.items():
        data = np.array(values)
        if grid:
            dimensions.append(_scale(file, name, data))
        else:
            _along(file.create_dataset(name, data=data), dimensions)
        if name in sweep.unit_names:
            file[name].attrs["units"] = sweep.unit_names[name]
    if not grid and sweep.axes:
        file.attrs["coordinates"] = " ".join(sweep.axes)
    text = h5py.string_dtype()
    columns: Values = {name: [getattr(task, name) for task in sweep.tasks] for name in _ABOUT}
    if any(task.source for task in sweep.tasks):
        columns["source"] = [task.source or "" for task in sweep.tasks]
    for name in sweep.names:
        columns[name] = [task.thresholds.get(name, np.nan) for task in sweep.tasks]
    for name, values in columns.items():
        kind = text if isinstance(values[0], str) else None
        flat = np.array(values, dtype=object if kind else None)
        _along(file.create_dataset(name, data=flat.reshape(sweep.shape), dtype=kind), dimensions)
        unit = sweep.unit_names.get(quantity(name, sweep.unit_names))
        if unit and name in sweep.names:
            file[name].attrs["units"] = unit


def _scale(group: h5py.Group, name: str, values: AnyArray) -> h5py.Dataset:
    """A dimension with its values."""
    made = group.create_dataset(name, data=values)
    made.make_scale(name)
    return made


def _along(data: h5py.Dataset, scales: Iterable[h5py.Dataset]) -> h5py.Dataset:
    """Attach a dataset to its dimensions."""
    for number, scale in enumerate(scales):
        data.dims[number].attach_scale(scale)
    return data


def _write_records(group: h5py.Group, count: int, records: Callable[[], Iterable[Record]]) -> None:
    """What tasks have to say, as JSON, and their arrays one behind the other, with the lengths of each."""
    import h5py

    task = _scale(group, "task", np.arange(count))
    about = _along(group.create_dataset("about", (count,), dtype=h5py.string_dtype()), [task])
    kinds: dict[str, np.dtype[Any]] = {}
    counts: dict[str, Integers] = {}
    for index, (said, arrays) in enumerate(records()):
        about[index] = json.dumps({k: v for k, v in said.items() if k not in _TIMES}, ensure_ascii=False)
        for name, values in arrays.items():
            counts.setdefault(_dimension(name), np.zeros(count, dtype=np.int64))[index] = len(values)
            kinds.setdefault(name, values.dtype)
    for name, length in counts.items():
        scale = group.create_dataset(name, (length.sum(),), dtype="f4")
        scale.make_scale(_LENGTH % length.sum())
        _along(group.create_dataset(f"{name}_count", data=length), [task])
    columns = {}  # held open: one that is opened anew unpacks its last piece, and packs it again
    for name, kind in kinds.items():
        scale = group[_dimension(name)]
        columns[name] = group.create_dataset(name, scale.shape, kind, fillvalue=_blank(kind), **_PACKED)
        _along(columns[name], [scale])
    # what a task lacks stays blank
    starts = {name: np.cumsum(length) - length for name, length in counts.items()}
    for index, (_, arrays) in enumerate(records()):
        for name, values in arrays.items():
            start = int(starts[_dimension(name)][index])
            columns[name][start : start + len(values)] = values


def _dimension(name: str) -> str:
    """Along which an array lies."""
    return name.partition(".")[0]


def _blank(kind: np.dtype[Any]) -> float:
    """What stands where a task has no such column."""
    return np.nan if kind.kind == "f" else -1


# Reading


def is_sweep(path: Path) -> bool:
    """Whether a file ends as files of sweeps do."""
    return path.is_file() and _end(path).startswith(_LABEL[:40])


def _end(path: Path) -> bytes:
    with open(path, "rb") as file:
        file.seek(max(os.path.getsize(path) - _BLOCK, 0))
        return file.read()


def load_sweep(path: str | Path) -> Sweep:
    """Read a sweep, without its curves.

    Raises
    ------
    InputError
        If the file is no sweep, or damaged.
    """
    import h5py

    path = Path(path)
    try:
        if _end(path) != _label(path, os.path.getsize(path) - _BLOCK):
            raise InputError(f"path: '{path}' is damaged, or no sweep (it is not what its checksum says)")
        with h5py.File(path, "r") as file:
            return _sweep(file, path)
    except OSError as error:
        raise InputError(f"path: '{path}' cannot be read ({error.strerror or error})") from None


def refuse_later(file: h5py.File, path: Path) -> None:
    """Raise InputError for a file of a later version."""
    version, kind = int(file.attrs["version"]), file.attrs["format"]
    if version > VERSION:
        raise InputError(
            f"path: '{path}' has version {version} of {kind}; must be at most {VERSION}: use a later contbranch"
        )


def _sweep(file: h5py.File, path: Path) -> Sweep:
    refuse_later(file, path)
    mode: Any = file.attrs["mode"]
    axes = {name: tuple(file[name][()].tolist()) for name in json.loads(file.attrs["parameters"])}
    data = {name: file[name] for name in file.keys() - {*axes, "task", "description", "unit_names", _GROUP}}
    found = {n: (one.asstr() if one.dtype.kind == "O" else one)[()].ravel().tolist() for n, one in data.items()}
    about = [found.pop(name) for name in _ABOUT]
    sources = found.pop("source", [""] * len(about[0]))  # files of earlier days have none
    tasks = []
    for index, said in enumerate(zip(*about, strict=True)):
        values = {name: found[name][index] for name in sorted(found) if found[name][index] == found[name][index]}
        known: Values = {"parameters": values_at(axes, mode, index), "thresholds": values}
        known["source"] = sources[index] or None
        tasks.append(SweepTask(index=index, **known, **dict(zip(_ABOUT, said, strict=True))))
    described: Values = {name: json.loads(file[name][()]) for name in ("description", "unit_names")}
    kind = FitMap if file.attrs["format"] == FitMap.format else Sweep
    return kind(
        parameters=tuple(axes),
        axes=axes,
        mode=mode,
        tasks=tuple(tasks),
        computed=0,
        reused=len(tasks),
        cost=Cost(sum(task.wall_s for task in tasks), 0),
        path=path,
        contact=rebuilt(described["description"]),
        message=str(file.attrs["message"]),
        **described,
    )


def rebuilt(description: Mapping[str, Any]) -> Contact | None:
    """The contact of a description, or None if its tip or one of its laws is not known, being the user's."""
    try:
        return Contact.from_description(description)
    except InputError:
        return None


def records_of(sweep: Sweep, indices: Iterable[int]) -> Iterator[Record]:
    """What the file holds of tasks: what they say, and their arrays."""
    import h5py

    with h5py.File(sweep.path, "r") as file:
        group = file[_GROUP]
        counts = {name.removesuffix("_count"): group[name][()] for name in group if name.endswith("_count")}
        stops = {name: np.cumsum(lengths) for name, lengths in counts.items()}
        for index in indices:
            arrays = {}
            for name in (name for name in group if "." in name):
                stop, length = int(stops[_dimension(name)][index]), int(counts[_dimension(name)][index])
                values = group[name][stop - length : stop]
                blank = np.isnan(values) if values.dtype.kind == "f" else values == -1
                if not blank.all():
                    arrays[name] = values
            yield {**json.loads(group["about"][index]), "wall_s": sweep.tasks[index].wall_s}, arrays


def diagram_of(sweep: Sweep, index: int, record: Record) -> Diagram:
    """The diagram of a task, as far as it was kept."""
    about, arrays = record
    points = {name.removeprefix("point."): values for name, values in arrays.items() if name.startswith("point.")}
    which, nodes = points.pop("branch", np.zeros(0, dtype=int)), points.pop("nodes", None)
    ends = None if nodes is None else np.cumsum([0, *nodes])
    branches = []
    for number in range(int(which.max(initial=-1)) + 1):
        here = np.flatnonzero(which == number)
        profiles = () if ends is None else tuple(_profile(arrays, ends[k], ends[k + 1]) for k in here)
        known: Values = {name: values[here] for name, values in points.items()}
        known |= dict.fromkeys(("load_error", "displacement_error"), np.full(len(here), np.nan))
        branches.append(Branch(**known, profiles=profiles))
    events = tuple(Event(**said) for said in about.get("events", ()))
    kept = ("status", "message", "thresholds", "control", "accuracy", "stiffness")
    description = about.get("contact", {})  # files of earlier days have none
    return Diagram(
        contact=rebuilt(description),
        branches=tuple(branches),
        events=events,
        model=ModelChoice(**about["model"]),
        cost=Cost(sweep.tasks[index].wall_s, 0),
        description=description,
        unit_names=sweep.unit_names,
        **{name: about[name] for name in kept if name in about},
    )


def read_diagram(sweep: Sweep, index: int) -> Diagram:
    """The diagram of a task, read from the sweep's file."""
    return diagram_of(sweep, index, next(records_of(sweep, [index])))


def _profile(arrays: Columns, start: int, stop: int) -> Profile:
    return Profile(*(arrays[f"node.{name}"][start:stop] for name in ("r", "gap", "pressure", "wall_pressure")))
