"""JSON documents of results: plain dictionaries, in the units of the contact, with null for what does not exist."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from contbranch.contact.contact import Contact
    from contbranch.results.diagram import Branch, Cost, Diagram, Event, Exponent, ModelChoice, Solution, State, Window
    from contbranch.results.loop import Hysteresis, Jump

__all__ = ["VERSION", "diagram_document", "loop_document", "solution_document"]

VERSION: Final = 1

_OBSERVABLES: Final = ("load", "displacement", "contact_radius", "central_gap")
_INDICES: Final = ("unstable_load", "unstable_displacement")
_OPTIONAL: Final = ("unstable_spring", "unstable_azimuthal", "fft_pairs")
_COLUMNS: Final = (*_OBSERVABLES, "energy", *_INDICES, "load_error", "displacement_error")


def diagram_document(diagram: Diagram) -> dict[str, Any]:
    """Return a diagram as a JSON-able dictionary of format ``contbranch-diagram``, version 1.

    Numbers are in the contact's units (`units`, `unit_names`); NaN and infinity become None. Besides what the format
    requires, branches have `load_error` and `displacement_error`, exponents `prefactor` and `order_parameter`, and
    events `stiffness`, `mode`, `message`, `branch` and `position`. Branches have `unstable_spring` and
    `unstable_azimuthal` where these are known.
    """
    return {
        "format": "contbranch-diagram",
        "version": VERSION,
        "contact": _plain(diagram.description) or _contact(diagram.contact),
        **_units(diagram.contact, diagram.unit_names),
        "control": diagram.control,
        **({"stiffness": _number(diagram.stiffness)} if diagram.stiffness is not None else {}),
        "accuracy": diagram.accuracy,
        "model": _model(diagram.model),
        "branches": [_branch(branch) for branch in diagram.branches],
        "events": [_event(event) for event in diagram.events],
        "thresholds": {name: _number(value) for name, value in diagram.thresholds.items()},
        "cost": _cost(diagram.cost),
        "status": diagram.status,
        "message": diagram.message,
    }


def solution_document(solution: Solution, *, every: bool = False) -> dict[str, Any]:
    """Return a solution as a JSON-able dictionary; its list `states` holds the solution, or with `every` all found."""
    states = (solution.states or (solution,)) if every else (solution,)
    return {
        "format": "contbranch-solution",
        "version": VERSION,
        "contact": _contact(solution.contact),
        **_units(solution.contact, {}),
        "model": _model(solution.model),
        "states": [_state(state) for state in states],
        "cost": _cost(solution.cost),
        "status": solution.status,
        "message": solution.message,
    }


def _number(value: float | None) -> float | None:
    """Return a Python float, or None for what JSON cannot hold."""
    if value is None or not math.isfinite(value):
        return None
    return float(value)


def _numbers(values: ArrayLike) -> list[Any]:
    """Return an array as a list, with None in place of NaN and infinity; integers stay integers."""
    array = np.asarray(values)
    listed: list[Any] = array.tolist()
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        return [_number(value) for value in listed]
    return listed


def loop_document(loop: Hysteresis) -> dict[str, Any]:
    """Return a hysteresis loop as a JSON-able dictionary: path, jumps, dissipated, and what every document has."""
    path = loop.path
    return {
        "format": "contbranch-loop",
        "version": VERSION,
        "contact": _contact(loop.contact),
        **_units(loop.contact, {}),
        "control": loop.control,
        **({"stiffness": _number(loop.stiffness)} if loop.stiffness is not None else {}),
        "model": _model(loop.model),
        "path": {item.name: _numbers(path[item.name]) for item in fields(path)},
        "jumps": [_jump(jump) for jump in loop.jumps],
        "dissipated": _number(loop.dissipated),
        "error": _number(loop.error),
        "closed": loop.closed,
        "cost": _cost(loop.cost),
        "status": loop.status,
        "message": loop.message,
    }


def _jump(jump: Jump) -> dict[str, Any]:
    return {
        "name": jump.name,
        "position": _number(jump.position),
        "from": _state(jump.start),
        "to": None if jump.to is None else _state(jump.to),
        "dissipated": _number(jump.dissipated),
        "error": _number(jump.error),
    }


def _plain(value: Any) -> Any:
    """Return a nested description with only what JSON can hold."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _numbers(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return _number(value)
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _contact(contact: Contact | None) -> Any:
    return {} if contact is None else _plain(contact.describe())


def _units(contact: Contact | None, unit_names: Mapping[str, str]) -> dict[str, Any]:
    """Return the kind of units and, for physical ones, the unit of every quantity."""
    names = dict(unit_names) if contact is None else dict(contact.units.names)
    return {"units": "physical", "unit_names": names} if names else {"units": "reduced"}


def _model(model: ModelChoice) -> dict[str, Any]:
    return {"kind": model.kind, "why": model.why, "unknowns": model.unknowns}


def _cost(cost: Cost) -> dict[str, Any]:
    return {
        "wall_s": _number(cost.wall_s),
        "newton": cost.newton,
        "fft_pairs": cost.fft_pairs,
        "stability_pairs": cost.stability_pairs,
    }


def _branch(branch: Branch) -> dict[str, list[Any]]:
    optional = {name: getattr(branch, name) for name in _OPTIONAL}
    columns = {name: getattr(branch, name) for name in _COLUMNS}
    return {name: _numbers(values) for name, values in (columns | optional).items() if values is not None}


def _observables(state: State | Event) -> dict[str, Any]:
    """Return the four observables and, under `error`, their error estimates."""
    values: dict[str, Any] = {name: _number(getattr(state, name)) for name in _OBSERVABLES}
    return values | {"error": {name: _number(state.error.get(name)) for name in _OBSERVABLES}}


def _event(event: Event) -> dict[str, Any]:
    return {
        "kind": event.kind,
        "control": event.control,
        "name": event.name,
        **_observables(event),
        "exponent": _exponent(event.exponent),
        "stiffness": _number(event.stiffness),
        "mode": event.mode,
        "verdict": event.verdict,
        "message": event.message,
        "branch": event.branch,
        "position": _number(event.position),
    }


def _exponent(exponent: Exponent | None) -> dict[str, Any] | None:
    if exponent is None:
        return None
    return {
        "kappa": _number(exponent.kappa),
        "crossover_load": _number(exponent.crossover_load),
        "window": _window(exponent.window),
        "prefactor": _number(exponent.prefactor),
        "order_parameter": exponent.order_parameter,
    }


def _window(window: Window | None) -> dict[str, Any] | None:
    if window is None:
        return None
    return {
        "from": _number(window.start),
        "to": _number(window.stop),
        "kappa": _number(window.kappa),
        "kappa_error": _number(window.kappa_error),
        "prefactor": _number(window.prefactor),
    }


def _state(state: State) -> dict[str, Any]:
    return {
        **_observables(state),
        "energy": _number(state.energy),
        "unstable_load": int(state.unstable_load),
        "unstable_displacement": int(state.unstable_displacement),
        **({} if state.unstable_spring is None else {"unstable_spring": int(state.unstable_spring)}),
        "unstable_azimuthal": int(state.unstable_azimuthal),
        "residual": _number(state.residual),
        **({} if state.mean_gap is None else {"mean_gap": _number(state.mean_gap)}),
    }
