"""Curves in files: arrays, and a text that says what they are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import contbranch.continuation.curve as parts
from contbranch.arrays import Array
from contbranch.continuation.curve import Curve, Outcome, Point
from contbranch.continuation.problem import Problem
from contbranch.errors import InputError, ModelError


class _Absent(Problem):
    """The problem of a curve from a file, which has none."""

    def residual(self, x: Array, p: float) -> Array:
        """Raise ModelError."""
        raise ModelError("The curve is from a file, which does not hold its equations: trace it again.")


def save(curve: Curve, path: str | Path) -> None:
    """Write a curve, see `Curve.save`."""
    arrays: list[Any] = []

    def plain(value: Any) -> Any:
        """Return what JSON knows, for what it does not know."""
        if isinstance(value, np.ndarray):
            arrays.append(value)
            return {"@array": f"arr_{len(arrays) - 1}"}
        if isinstance(value, Outcome):
            return {"@outcome": value.name}
        if is_dataclass(value):
            names = [part.name for part in fields(value) if part.name not in ("problem", "cause")]
            return {"@part": type(value).__name__, **{name: getattr(value, name) for name in names}}
        if isinstance(value, Mapping):
            return dict(value)
        return value.item()  # a number of numpy's

    text = json.dumps(curve, default=plain)
    with open(path, "wb") as file:
        np.savez_compressed(file, *arrays, curve=np.array(text))


def load_curve(path: str | Path) -> Curve:
    """Read a curve that `Curve.save` wrote.

    It has all numbers, events and ends, but no problem: what needs one, such as `switch_branch`, raises `ModelError`.

    Raises
    ------
    InputError
        If the file is not there, or is none that `Curve.save` wrote.
    """

    def made(values: dict[str, Any]) -> Any:
        if "@array" in values:
            return file[values["@array"]]
        if "@outcome" in values:
            return Outcome[values["@outcome"]]
        if "@part" not in values:
            return values
        part = known[values.pop("@part")]
        given: dict[str, Any] = {"problem": problem} if part is Point else {}
        return part(**given, **{name: tuple(v) if isinstance(v, list) else v for name, v in values.items()})

    problem = _Absent()
    known: dict[str, Any] = {name: part for name, part in vars(parts).items() if is_dataclass(part)}
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            curve: Curve = json.loads(str(file["curve"]), object_hook=made)
    except Exception as error:  # numpy, zip and JSON stumble over anything
        raise InputError(f"path: '{path}' cannot be read as a curve ({error}); give what Curve.save wrote.") from error
    return replace(curve, events=tuple(replace(event, point=curve.points[event.index]) for event in curve.events))
