"""One page on which a diagram, a loop or a sweep is explored: HTML without anything from outside."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbranch.arrays import Array, plain
from contbranch.contact.contact import Contact
from contbranch.errors import InputError
from contbranch.output.plot_curve import COORDINATES, OF_SPRINGS, coordinate, observable, smooth_line
from contbranch.results.diagram import Branch, Diagram
from contbranch.results.fit_map import FitMap
from contbranch.results.loop import Hysteresis
from contbranch.results.record import Result, given
from contbranch.results.sweep import Sweep

# What the page holds as JSON.
_Json = dict[str, Any]
_RANGES = 8.0  # of the interaction: the largest gap that is shown
_BUDGET = 4_000_000  # numbers in the profiles of a page, which take some three bytes each
_STEPS = (3, 8)  # of 24 points drawn for each step of a trace: taken of a single one, and of many
_MANY = 8
_DIGITS = (7, 5)  # of what is packed, of few curves and of many
_SIDE = 48  # nodes a side of a map
_TINY = 1e-30


def page(result: Result, curve: Diagram | None = None) -> str:
    """Return the page of a diagram, a loop or a sweep.

    Parameters
    ----------
    result : Diagram, Hysteresis or Sweep
    curve : Diagram, optional
        The curve on which a loop lies, with the states along it.

    Raises
    ------
    InputError
        If the result has no curve.
    """
    packed = _Packed()
    title = repr(result).splitlines()[0].rpartition(":")[0]
    if isinstance(result, FitMap):
        raise InputError("result: a map of fits has no curves to show; draw it with contbranch show --plot")
    if isinstance(result, Sweep):
        title = f"{title.partition(', μ_T')[0]} over {' × '.join(result.parameters) or 'contacts'}"
    known: _Json = {"title": title, "parameters": [], "axes": {}, "units": result.units}
    if isinstance(result, Diagram):
        known["items"] = [packed.diagram(result, result.contact, {})]
    elif isinstance(result, Hysteresis):
        known["items"] = [_of_loop(result, curve, packed)]
    elif isinstance(result, Sweep):
        known |= {"items": list(_of_sweep(result, packed)), "units": result.unit_names}
        known |= {name: getattr(result, name) for name in ("parameters", "axes", "mode")}
    else:
        raise InputError(f"result: {type(result).__name__}; a page shows a diagram, a loop or a sweep")
    known["digits"] = packed.digits
    text = json.dumps(plain(known), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    folder = files("contbranch.output")
    parts = {"TITLE": escape(title), "DATA": text, "ARRAYS": packed.text()}
    parts["SCRIPT"] = folder.joinpath("page.js").read_text(encoding="utf-8")
    whole = folder.joinpath("page.html").read_text(encoding="utf-8")
    for name, part in parts.items():
        whole = whole.replace(f"@{name}@", part)
    return whole


class _Packed:
    """Arrays of a page, one behind the other as numbers of four bytes; what refers to one is [start, length]."""

    def __init__(self) -> None:
        self._parts: list[NDArray[np.float32]] = []
        self._length, self.count = 0, 1

    def put(self, values: ArrayLike) -> list[int]:
        """Take an array."""
        part = np.asarray(values, dtype=np.float32).ravel()
        self._parts.append(part)
        self._length += len(part)
        return [self._length - len(part), len(part)]

    @property
    def digits(self) -> int:
        """Decimal digits that the numbers have."""
        return _DIGITS[self.count > _MANY]

    def text(self) -> str:
        """All arrays, packed byte by byte: the first bytes of neighbours are alike."""
        whole = np.concatenate([*self._parts, np.zeros(1, np.float32)])
        if self.digits < _DIGITS[0]:
            whole = (((whole.view(np.uint32) + 0x40) >> 7) << 7).view(np.float32)
        planes = whole.astype("<f4").view(np.uint8).reshape(-1, 4).T
        return base64.b64encode(gzip.compress(planes.tobytes(), 6, mtime=0)).decode()

    def diagram(self, diagram: Diagram, contact: Contact | None, about: Mapping[str, Any]) -> _Json:
        """What the page needs of a diagram."""
        controls = ["load", "displacement", *(["spring"] if diagram.stiffness else [])]
        ranges = [law.get("range", 0.0) for law in diagram.description.get("interaction", [])]
        limit = _RANGES * float(max(ranges, default=0.0))  # of the gap; 0: whatever there is
        events = [
            {name: getattr(event, name) for name in ("kind", "control", "name", "mode", "position", "branch")}
            | {name: coordinate(diagram, event, name) for name in _columns(diagram) if name != "energy"}
            | {"energy": coordinate(diagram, event, "energy") if len(diagram.branches) else None}
            for event in diagram.events
        ]
        branches = [self._branch(diagram, number, controls, limit) for number in range(len(diagram.branches))]
        kept = ("status", "message", "thresholds", "control", "stiffness")
        found = {name: getattr(diagram, name) for name in kept} | {"events": events, "branches": branches, **about}
        if contact is not None and contact.tip.axisymmetric is not None and limit:
            with suppress(InputError):
                reach = max((max(branch.get("reach", 0.0), 0.0) for branch in branches), default=0.0)
                r = np.linspace(0.0, reach or 1.0, 65)
                found["tip"] = {"r": self.put(r), "z": self.put(contact.axisymmetric_tip.height(r))}
        return {**found, "model": diagram.model.kind, "controls": controls, "limit": limit}

    def _branch(self, diagram: Diagram, number: int, controls: list[str], limit: float) -> _Json:
        branch = diagram.branches[number]
        every = _STEPS[self.count > _MANY]
        lines = [smooth_line(replace(diagram, control=control), number) for control in controls]
        line = lines[0]
        taken = np.unique([*range(0, len(line.position), every), max(len(line.position) - 1, 0)])
        taken = taken[taken < len(line.position)]
        fine = {name: self.put(column[taken]) for name, column in line.columns.items()}
        stable = {
            control: self.put(one.stable[one.step[taken]] if len(one.stable) else np.zeros(len(taken)))
            for control, one in zip(controls, lines, strict=True)
        }
        rows = {name: self.put(observable(branch, name, diagram.stiffness)) for name in _columns(diagram)}
        unstable = {control: self.put(branch.unstable(control)) for control in controls}
        found = {"fine": fine, "position": self.put(line.position[taken]), "stable": stable, "rows": rows}
        return {**found, "unstable": unstable, **self._profiles(branch, limit), **self._maps(branch)}

    def _maps(self, branch: Branch) -> _Json:
        """Gap (zero in contact alone) and pressure of every row of a grid model, on a page of few curves."""
        if not len(branch.cells) or self.count > _MANY:
            return {}
        shown = [branch.state(row).cell.shown(_SIDE) for row in range(len(branch))]
        gaps = [np.where(cell.wall_pressure > 0.0, 0.0, np.maximum(cell.gap, _TINY)) for cell in shown]
        edges = [(cell.x[0], cell.x[-1], len(cell.x), cell.y[0], cell.y[-1], len(cell.y)) for cell in shown]
        joined = {"gap": gaps, "pressure": [cell.pressure for cell in shown]}
        found = {name: self.put(np.concatenate([field.T.ravel() for field in of])) for name, of in joined.items()}
        return {"maps": {**found, "edges": self.put(edges)}}

    def _profiles(self, branch: Branch, limit: float) -> _Json:
        """Gap and pressure of every row as far as they are shown: computed nodes, fewer of them on a page of many."""
        if not len(branch.profiles):
            return {}
        most = max(16, _BUDGET // (3 * self.count * len(branch)))
        columns: dict[str, list[Array]] = {"r": [], "gap": [], "pressure": []}
        counts, reach = [], 0.0
        for one, radius in zip(branch.profiles, branch.contact_radius, strict=True):
            profile = given(one)
            beyond = np.flatnonzero(profile.gap > 1.25 * (limit or np.inf))
            last = max(int(beyond[0]) + 1, 2) if beyond.size else len(profile.r)
            reach = max(reach, *profile.r[:last][profile.gap[:last] <= (limit or np.inf)][-1:].tolist(), 0.0)
            nodes = np.unique(np.linspace(0, last - 1, min(last, most)).round().astype(int))
            if radius > 0.0:  # the kink at the rim
                nodes = np.union1d(nodes, [int(np.argmin(np.abs(profile.r[:last] - radius)))])
            for name, listed in columns.items():
                listed.append(getattr(profile, name)[nodes])
            counts.append(len(nodes))
        return {name: self.put(np.concatenate(listed)) for name, listed in columns.items()} | {
            "counts": self.put(counts),
            "reach": reach,
        }


def _columns(result: Diagram | Hysteresis) -> tuple[str, ...]:
    return (*COORDINATES, *(OF_SPRINGS if result.stiffness else ()))


def _of_sweep(sweep: Sweep, packed: _Packed) -> Iterator[_Json]:
    from contbranch.output.sweep_file import diagram_of, records_of

    packed.count = max(1, len(sweep.tasks) - len(sweep.failed))
    for task, record in zip(sweep.tasks, records_of(sweep, range(len(sweep.tasks))), strict=True):
        about = {"parameters": task.parameters, "index": task.index}
        if task.status == "failed":
            nothing = dict.fromkeys(("branches", "events", "controls"), ())
            yield {**about, "status": task.status, "message": task.message, **nothing}
        else:
            diagram = diagram_of(sweep, task.index, record)
            yield packed.diagram(diagram, diagram.contact, about)


def _of_loop(loop: Hysteresis, curve: Diagram | None, packed: _Packed) -> _Json:
    """A loop, and behind it the curve of its contact."""
    path = loop.path
    about = {name: getattr(loop, name) for name in ("status", "message", "control", "stiffness")}
    item: _Json = {"branches": [], "events": [], "controls": [loop.control], "thresholds": {}}
    if curve is not None:
        item = packed.diagram(curve, loop.contact, {})
    found = {name: packed.put(observable(path, name, loop.stiffness)) for name in (*_columns(loop), "leg", "direction")}
    return {**item, **about, "loop": {**found, "jumps": loop.jumps, "dissipated": loop.dissipated}}
