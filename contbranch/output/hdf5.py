"""Diagrams in HDF5 files; the layout is described in ``docs/file-layout.md``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from contbranch.contact.height_map import HeightMap
from contbranch.errors import InputError, ModelError
from contbranch.results.diagram import (
    OBSERVABLES,
    Branch,
    Cost,
    Diagram,
    Event,
    Exponent,
    LocalExponent,
    ModelChoice,
    ModeShape,
    Profile,
    Solution,
    State,
    Window,
)

if TYPE_CHECKING:
    import h5py

    from contbranch.contact.contact import Contact

__all__ = ["FORMAT", "VERSION", "load", "save", "save_document", "save_solution"]

FORMAT: Final = "contbranch-diagram"
VERSION: Final = 1

_CURVE: Final = (*OBSERVABLES, "energy", "load_error", "displacement_error")
_INDICES: Final = ("unstable_load", "unstable_displacement")
_CRITICAL: Final = "critical_eigenvalue"
_OPTIONAL: Final = ("unstable_spring", "unstable_azimuthal", "fft_pairs")
_PROFILE: Final = ("r", "gap", "pressure", "wall_pressure")
_LOCAL: Final = ("excess", "order_parameter", "kappa", "error")
_SHAPE: Final = ("r", "gap", "pressure")
_WINDOW: Final = ("start", "stop", "kappa", "kappa_error", "prefactor")
_INTEGERS: Final = ("branch", "mode")
_TEXTS: Final = ("kind", "control", "name", "message", "verdict", "order_parameter")
_UNIT: Final = {  # where it is not the unit of the same name
    "load_error": "load",
    "displacement_error": "displacement",
    "r": "contact_radius",
    "wall_pressure": "pressure",
}


def save(diagram: Diagram, path: str | Path) -> None:
    """Write a diagram to an HDF5 file, which replaces `path` only when it is complete.

    Local exponents are computed and stored for every fold and touch that has one, gap and pressure profiles for every
    point that has them, and the critical eigenvalue of azimuthal modes, so that a loaded diagram answers what the
    present one does.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with _writable(Path(path)) as file:
        _write(file, diagram)


def save_solution(solution: Solution, path: str | Path, *, every: bool = False) -> None:
    """Write a solution, or with `every` all states found, as a diagram whose branches have one point each.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    contact = solution.contact
    save(
        Diagram(
            contact=contact,
            branches=tuple(_point(state) for state in ((solution.states or (solution,)) if every else (solution,))),
            events=(),
            thresholds={},
            model=solution.model,
            cost=solution.cost,
            status=solution.status,
            message=solution.message,
            description={} if contact is None else contact.describe(),
            unit_names={} if contact is None else contact.units.names,
        ),
        path,
    )


def save_document(document: Mapping[str, Any], path: str | Path) -> None:
    """Write a document, that of a loop or of a followed event, to an HDF5 file as it is.

    Objects are groups, lists of numbers datasets (NaN for null), lists of objects groups numbered from 0, everything
    else attributes; what is null has none.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with _writable(Path(path)) as file:
        _write_object(file, document)


def _write_object(group: h5py.Group, content: Mapping[str, Any]) -> None:
    for key, value in content.items():
        if isinstance(value, Mapping):
            _write_object(group.create_group(key), value)
        elif isinstance(value, list) and all(isinstance(item, Mapping) for item in value) and value:
            _write_object(group.create_group(key), {str(k): item for k, item in enumerate(value)})
        elif isinstance(value, list):
            group.create_dataset(key, data=np.array([np.nan if item is None else item for item in value], dtype=float))
        elif value is not None:
            group.attrs[key] = value


@contextmanager
def _writable(path: Path) -> Iterator[h5py.File]:
    """A new HDF5 file that takes its name when it is complete.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    import h5py

    unfinished = path.with_name(path.name + ".part")
    try:
        with h5py.File(unfinished, "w") as file:
            yield file
        os.replace(unfinished, path)
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split())
        raise InputError(f"path: '{path}' cannot be written ({reason}); give a writable file") from None
    finally:
        unfinished.unlink(missing_ok=True)


def _point(state: State) -> Branch:
    """Return a branch of one point."""
    columns: dict[str, Any] = {name: np.array([getattr(state, name)]) for name in (*OBSERVABLES, "energy", *_INDICES)}
    columns |= {f"{name}_error": np.array([state.error.get(name, np.nan)]) for name in ("load", "displacement")}
    for name in _OPTIONAL:
        value = getattr(state, name, None)  # what only curves have is not kept
        if value is not None:
            columns[name] = np.array([value])
    return Branch(**columns, profiles=() if state.profile is None else (state.profile,))


def load(path: str | Path) -> Diagram:
    """Read a diagram from an HDF5 file that `save` wrote.

    The contact is None where it cannot be made again: a law or tip defined outside the package.

    Raises
    ------
    InputError
        If the file is missing, no HDF5 file, of another format, of a later version, or damaged.
    """
    import h5py

    path = Path(path)
    if not path.is_file():
        raise InputError(f"path: '{path}' is not a file; give an HDF5 file that contbranch wrote")
    if not h5py.is_hdf5(path):
        raise InputError(f"path: '{path}' is not an HDF5 file; give one that contbranch wrote")
    try:
        with h5py.File(path, "r") as file:
            _check_format(file, path)
            return _read(file)
    except InputError:
        raise
    except (OSError, KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        reason = " ".join(str(error).replace('"', "").split())
        raise InputError(f"path: '{path}' is damaged ({reason}); write it again") from None


def _check_format(file: h5py.File, path: Path) -> None:
    """Raise InputError unless the file holds a diagram of a version that can be read here."""
    found = file.attrs.get("format")
    if found != FORMAT:
        raise InputError(f"path: '{path}' holds {found or 'something else'}; must hold a {FORMAT}")
    version = int(file.attrs["version"])
    if version > VERSION:
        raise InputError(
            f"path: '{path}' has version {version} of {FORMAT}; must be at most {VERSION}: use a later contbranch"
        )


# Writing


def _write(file: h5py.File, diagram: Diagram) -> None:
    from contbranch.output.document import diagram_document

    head = diagram_document(diagram)
    names = head.get("unit_names", {})
    file.attrs["format"] = FORMAT
    file.attrs["version"] = VERSION
    for key in ("units", "control", "accuracy", "status", "message"):
        file.attrs[key] = head[key]
    if diagram.stiffness is not None:
        file.attrs["stiffness"] = diagram.stiffness
    file["unit_names"] = json.dumps(names, ensure_ascii=False)
    file["contact"] = json.dumps(head["contact"], ensure_ascii=False)  # no attribute: a tabulated law may be long
    tip = None if diagram.contact is None else diagram.contact.tip
    if isinstance(tip, HeightMap):  # of which the description has only a digest
        _write_arrays(file.create_group("tip"), tip, ("heights",), {"heights": names.get("gap", "")})
    file.create_group("model").attrs.update(asdict(diagram.model))
    file.create_group("cost").attrs.update(asdict(diagram.cost))
    thresholds = file.create_group("thresholds")
    for key, value in diagram.thresholds.items():
        thresholds.attrs[key] = float(value)
    branches = file.create_group("branches")
    for number, branch in enumerate(diagram.branches):
        _write_branch(branches.create_group(str(number)), branch, names)
    _write_events(file.create_group("events"), diagram.events)
    local = file.create_group("local_exponents")
    for number, event in enumerate(diagram.events):
        found = _local_exponent(diagram, event)
        if found is not None:
            _write_arrays(local.create_group(str(number)), found, _LOCAL, {})
    shapes = file.create_group("mode_shapes")
    for number, event in enumerate(diagram.events):
        if event.mode_shape is not None:
            group = shapes.create_group(str(number))
            group.attrs["mode"] = event.mode_shape.mode
            _write_arrays(group, event.mode_shape, _SHAPE, {"r": names.get("contact_radius", "")})


def _write_arrays(group: h5py.Group, source: object, columns: Sequence[str], names: Mapping[str, str]) -> None:
    """Write attributes of `source` as datasets, each with its unit where the contact is physical."""
    for column in columns:
        dataset = group.create_dataset(column, data=np.asarray(getattr(source, column)))
        unit = names.get(_UNIT.get(column, column))
        if unit:
            dataset.attrs["unit"] = unit


def _write_branch(group: h5py.Group, branch: Branch, names: Mapping[str, str]) -> None:
    optional = [name for name in (*_OPTIONAL, _CRITICAL) if getattr(branch, name) is not None]
    _write_arrays(group, branch, (*_CURVE, *_INDICES, *optional), names)
    profiles = [profile() if callable(profile) else profile for profile in branch.profiles]
    if not profiles:
        return
    joined = Profile(*(np.concatenate([getattr(profile, column) for profile in profiles]) for column in _PROFILE))
    inner = group.create_group("profiles")
    _write_arrays(inner, joined, _PROFILE, names)
    inner["offsets"] = np.cumsum([0, *(len(profile.r) for profile in profiles)])


def _write_events(group: h5py.Group, events: Sequence[Event]) -> None:
    """Write events as columns: NaN and the empty text stand for what does not apply."""
    rows = [_event_row(event) for event in events]
    for column in _event_row(_BLANK):
        values = [row[column] for row in rows]
        if column in _TEXTS:
            import h5py

            group.create_dataset(column, data=values, shape=(len(values),), dtype=h5py.string_dtype())
        else:
            group[column] = np.array(values, dtype=np.int64 if column in _INTEGERS else np.float64)


def _event_row(event: Event) -> dict[str, Any]:
    """Return the columns of one event."""
    exponent = event.exponent or Exponent(np.nan, None, None, None, "")
    window = exponent.window or Window(*5 * (np.nan,))
    return {
        "kind": event.kind,
        "control": event.control or "",
        "name": event.name or "",
        "message": event.message,
        **{name: getattr(event, name) for name in OBSERVABLES},
        **{f"{name}_error": event.error.get(name, np.nan) for name in OBSERVABLES},
        "kappa": exponent.kappa,
        "crossover_load": _or_nan(exponent.crossover_load),
        "prefactor": _or_nan(exponent.prefactor),
        "order_parameter": exponent.order_parameter,
        **{f"window_{name}": getattr(window, name) for name in _WINDOW},
        "stiffness": _or_nan(event.stiffness),
        "mode": event.mode or 0,
        "verdict": event.verdict or "",
        "branch": event.branch,
        "position": event.position,
    }


_BLANK: Final = Event("end", 0.0, 0.0, 0.0, 0.0, {})


def _local_exponent(diagram: Diagram, event: Event) -> LocalExponent | None:
    """Return the local exponent of an event, or None for an event that has none."""
    if event.kind not in ("fold", "touch") or diagram.local_exponents is None:
        return None
    try:
        return diagram.local_exponent(event)
    except (InputError, ModelError):  # the curve ends too close to the event: there is nothing to store
        return None


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


# Reading


def _read(file: h5py.File) -> Diagram:
    description = json.loads(file["contact"].asstr()[()])
    model, cost = file["model"].attrs, file["cost"].attrs
    events = _read_events(file["events"], file.get("mode_shapes", {}))
    return Diagram(
        contact=_rebuilt(description, file.get("tip")),
        branches=tuple(_read_branch(file["branches"][str(i)]) for i in range(len(file["branches"]))),
        events=events,
        thresholds={key: float(value) for key, value in file["thresholds"].attrs.items()},
        model=ModelChoice(kind=model["kind"], why=model["why"], unknowns=int(model["unknowns"])),
        cost=Cost(
            float(cost["wall_s"]), int(cost["newton"]), int(cost["fft_pairs"]), int(cost.get("stability_pairs", 0))
        ),
        control=file.attrs["control"],
        stiffness=float(file.attrs["stiffness"]) if "stiffness" in file.attrs else None,
        accuracy=float(file.attrs["accuracy"]),
        status=file.attrs["status"],
        message=file.attrs["message"],
        description=description,
        unit_names=json.loads(file["unit_names"].asstr()[()]),
        local_exponents={
            int(key): LocalExponent(*_arrays(group, _LOCAL)) for key, group in file["local_exponents"].items()
        },
    )


def _arrays(group: h5py.Group, columns: Sequence[str]) -> list[NDArray[np.float64]]:
    return [np.asarray(group[column][()], dtype=np.float64) for column in columns]


def _read_branch(group: h5py.Group) -> Branch:
    columns: dict[str, Any] = dict(zip(_CURVE, _arrays(group, _CURVE), strict=True))
    indices = (*_INDICES, *(name for name in _OPTIONAL if name in group))
    columns |= {name: np.asarray(group[name][()], dtype=np.int64) for name in indices}
    profiles: tuple[Profile, ...] = ()
    if "profiles" in group:
        fields = _arrays(group["profiles"], _PROFILE)
        offsets = group["profiles"]["offsets"][()]
        profiles = tuple(Profile(*(array[i:j] for array in fields)) for i, j in pairwise(offsets))
    critical = np.asarray(group[_CRITICAL][()], dtype=np.float64) if _CRITICAL in group else None
    return Branch(**columns, profiles=profiles, critical=critical)


def _read_events(group: h5py.Group, shapes: Mapping[str, h5py.Group]) -> tuple[Event, ...]:
    names = [
        name for name in _event_row(_BLANK) if name not in ("mode", "verdict") or name in group
    ]  # early files lack them
    columns = {name: group[name].asstr()[()] if name in _TEXTS else group[name][()] for name in names}
    rows = [{name: column[i] for name, column in columns.items()} for i in range(len(columns["kind"]))]
    return tuple(_event(row, shapes.get(str(i))) for i, row in enumerate(rows))


def _event(row: Mapping[str, Any], shape: h5py.Group | None) -> Event:
    exponent = None
    if row["order_parameter"]:
        window = Window(*(float(row[f"window_{name}"]) for name in _WINDOW))
        exponent = Exponent(
            kappa=float(row["kappa"]),
            crossover_load=_or_none(row["crossover_load"]),
            window=None if np.isnan(window.start) else window,
            prefactor=_or_none(row["prefactor"]),
            order_parameter=row["order_parameter"],
        )
    return Event(
        kind=row["kind"],
        **{name: float(row[name]) for name in OBSERVABLES},
        error={name: float(row[f"{name}_error"]) for name in OBSERVABLES},
        control=row["control"] or None,
        name=row["name"] or None,
        critical=exponent,
        stiffness=_or_none(row["stiffness"]),
        message=row["message"],
        branch=int(row["branch"]),
        position=float(row["position"]),
        mode=int(row.get("mode", 0)) or None,
        verdict=row.get("verdict") or None,
        mode_shape=None if shape is None else ModeShape(int(shape.attrs["mode"]), *_arrays(shape, _SHAPE)),
    )


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _rebuilt(description: Mapping[str, Any], tip: h5py.Group | None) -> Contact | None:
    """Return the contact of a description, or None if the package does not know its tip or one of its laws.

    A height map has its heights in the group `tip`.
    """
    from contbranch.contact.contact import Contact

    if tip is not None:
        heights = np.asarray(tip["heights"][()], dtype=np.float64)
        description = {**description, "tip": {**description["tip"], "heights": heights}}
    try:
        return Contact.from_description(description)
    except InputError:
        return None
