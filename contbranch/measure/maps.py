"""`fit_map`: the force curves of a map fitted as a sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.units import positive_number
from contbranch.errors import InputError, refuse_unknown, warned
from contbranch.measure.fit import fit, named
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.quantities import LINE, RETRACTED
from contbranch.measure.reading import Unread, curves_in
from contbranch.results.fit import Fit, unit_of_value
from contbranch.results.fit_map import FitMap, places_of
from contbranch.results.record import UnitNames, Values
from contbranch.sweeps.design import Listed
from contbranch.sweeps.sweep import sweep
from contbranch.sweeps.tasks import Outcome
from contbranch.watch import Progress

_FITTING = ("fixed", "spring", "law", "leg", "baseline", "max_indentation", "max_force", "min_force")
_READING = ("sensitivity", "columns")
_SWEEPING = ("workers", "retry", "time_limit")
# What names a place: rows with columns, or a number alone.
_PLACES = (("y", "x"), ("row", "column"))


@dataclass(frozen=True)
class Fitting:
    """A task of a sweep: every curve is fitted.

    Attributes
    ----------
    contact : Contact
    free : tuple of str
    settings : dict
        As of `contbranch.fit`.
    time_limit : float or None
        Seconds after which a fit ends incomplete.
    """

    contact: Contact
    free: tuple[str, ...]
    settings: Values
    time_limit: float | None = None
    kind = FitMap

    @property
    def unit_names(self) -> UnitNames:
        """Units of places and values; there is one, though it may be empty, of every value that is free."""
        names = (name for name in (*self.free, *LINE) if name not in self.settings.get("fixed", ()))
        units = {f"{name}{end}": unit_of_value(name) for name in names for end in ("", "_error")}
        return units | dict.fromkeys(("x", "y"), "nm") | dict.fromkeys(("rms", "noise", "pull_off_force"), "nN")

    def describe(self) -> Values:
        """The contact and every setting but the time allowed."""
        return {"task": "fit", "contact": self.contact.describe(), "free": self.free, **self.settings}

    def __call__(self, given: ForceCurve | Unread) -> Outcome:
        """What a curve determines."""
        if isinstance(given, Unread):
            raise given.error
        found = fit(given, self.contact, self.free, **self.settings, time_limit=self.time_limit)
        about = {"status": found.status, "message": found.message, "thresholds": _values(found), "law": found.law}
        every = {name: dict(getattr(found, name)) for name in ("values", "errors")}
        return Outcome({**about, **every, "determined": list(found.determined), "source": given.source}, {})


def _values(found: Fit) -> dict[str, float]:
    """What is told of a fit in a map: nothing that the curve does not determine, and no baselines of retractions."""
    names = [name for name in found.determined if name not in RETRACTED]
    known = {name: found.values[name] for name in names} | {f"{name}_error": found.errors[name] for name in names}
    for jump in found.jumps:
        if jump.name == "pull-off" and jump.measured and math.isfinite(jump.measured["force"]):
            known["pull_off_force"] = jump.measured["force"]
    return known | {"rms": found.rms, "noise": found.noise}


def fit_map(
    curves: str | Path | Sequence[ForceCurve],
    contact: Contact,
    path: str | Path,
    free: Sequence[str] = ("work_of_adhesion", "modulus"),
    progress: Progress | None = None,
    **settings: Any,
) -> FitMap:
    """Fit the force curves of a map on all cores, or on any executor, and write what they determine to one file.

    As in `contbranch.sweep`, every fit is in a journal as soon as it has ended, and what cannot be read or fitted is
    recorded as failed, with the reason. What has no place in a map where most have one is left out, with a warning.

    Parameters
    ----------
    curves : str or Path, or sequence of ForceCurve
        A folder of files, each with one curve or several; a file with several; or curves that have been read.
    contact : Contact
    path : str or Path
        HDF5 file to be written, which xarray opens.
    free : sequence of str
    progress : callable, optional
    **settings
        As of `fit`: ``fixed``, ``spring``, ``law``, ``leg``, ``baseline``, ``max_indentation``, ``max_force``,
        ``min_force``. As of `read_force_curve`, of files: ``sensitivity``, ``columns``. As of `sweep`: ``executor``,
        ``resume``, ``workers``, ``retry``, ``time_limit``, and ``task_limit``: seconds that a fit may take (600).
        ``shape=(rows, columns)``: curves lie row by row, in their order, whatever place they say.

    Raises
    ------
    InputError
        If an argument cannot be used, or the file exists.
    """
    refuse_unknown(settings, (*_FITTING, *_READING, *_SWEEPING, "executor", "resume", "task_limit", "shape"))
    settings = {name: value for name, value in settings.items() if value is not None}
    reading = {name: settings[name] for name in ("spring", *_READING) if name in settings}
    listed = list(curves_in(curves, **reading) if isinstance(curves, str | Path) else curves)
    if not listed:
        raise InputError("curves: none; give at least one")
    executor: Executor | None = settings.get("executor")
    chosen: Values = {name: settings[name] for name in _FITTING if name in settings}
    chosen["fixed"] = named(chosen.get("fixed", ()))
    limit = positive_number(settings.get("task_limit", 600.0), "task_limit")
    task = Fitting(contact, named(free), chosen, limit)
    running = {name: settings[name] for name in _SWEEPING if name in settings}
    design = _laid_out(contact, listed, settings.get("shape"))
    resume = settings.get("resume", False)
    found = sweep(design, path, executor, resume, task=task, progress=progress, **running)
    if not isinstance(found, FitMap):
        raise InputError(f"path: '{path}' holds no map of fits")
    return found


def sized(shape: Any) -> tuple[int, int]:
    """Rows and columns of a map, (8, 8) or "8x8"."""
    parts = shape.split("x") if isinstance(shape, str) else shape
    match parts:
        case [rows, columns] if str(rows).isdecimal() and str(columns).isdecimal() and int(rows) * int(columns):
            return int(rows), int(columns)
    raise InputError(f"shape: {shape!r}; write ROWSxCOLUMNS, for example 8x8")


def _laid_out(contact: Contact, curves: Sequence[ForceCurve | Unread], shape: object) -> Listed:
    """Curves with their places: a grid where they fill one, row by row.

    Left out is what has no place in the map where more than half have one, or all that are curves.
    """
    placed = max(([one for one in curves if set(names) <= set(one.place)] for names in _PLACES), key=len)
    known = set(map(id, placed))
    strays = [one for one in curves if id(one) not in known]
    none = all(isinstance(one, Unread) for one in strays)
    if shape is None and strays and placed and (none or len(placed) > len(strays)):
        words = [str(one.error) if isinstance(one, Unread) else f"'{one.source or 'a curve'}'" for one in strays]
        warned(f"Left out, since their names say no place in the map as those of the others do: {'; '.join(words)}")
        return _laid_out(contact, placed, None)
    places: list[Mapping[str, float]] = [{"number": float(k), **one.place} for k, one in enumerate(curves)]
    if shape is not None:
        rows, columns = sized(shape)
        if len(curves) > rows * columns:
            raise InputError(f"shape: {rows} × {columns}; there are {len(curves)} curves")
        places = [dict(zip(("row", "column"), divmod(k, columns), strict=True)) for k in range(len(curves))]
    names = next((one for one in _PLACES if all(set(one) <= set(place) for place in places)), ("number",))
    columns_of = [np.array([place[name] for place in places], dtype=float) for name in names]
    centres, labels = zip(*map(places_of, columns_of), strict=True)
    size = tuple(one.size for one in centres)
    flat = np.ravel_multi_index(labels, size)
    whole = np.array_equal(np.sort(flat), np.arange(np.prod(size)))
    axes = {name: tuple(one.tolist()) for name, one in zip(names, centres if whole else columns_of, strict=True)}
    ordered = [curves[k] for k in np.argsort(flat)] if whole else curves
    return Listed(contact, axes, "grid" if whole else "zip", ordered)
