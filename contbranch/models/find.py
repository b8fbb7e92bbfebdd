"""`find_all`: every equilibrium at one load or displacement, and the barriers between the stable ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.units import finite_number
from contbranch.control import Control, Spring, as_control
from contbranch.curve.outcome import RawCurve, state_in_units
from contbranch.errors import InputError
from contbranch.models.choice import Model, choose
from contbranch.models.exact.model import Exact
from contbranch.models.exact.outcome import exact_outcome, exact_state
from contbranch.models.run import check
from contbranch.results.diagram import ModelChoice, Solution, State
from contbranch.results.equilibria import Barrier, Equilibria
from contbranch.threads import one_thread

__all__ = ["best_of", "find_all"]

Progress = Callable[[float, str], None]


@one_thread
def find_all(
    contact: Contact,
    *,
    load: float | None = None,
    displacement: float | None = None,
    window: tuple[float, float] | None = None,
    control: str | Spring | None = None,
    accuracy: float = 1e-6,
    model: str | Model = "auto",
    progress: Progress | None = None,
) -> Equilibria:
    """Find every equilibrium at a load or a displacement: on the traced curve, and by deflation what is not on it.

    Deflated Newton's method starts from states all along the curve and from undeformed ones. No finite search can prove
    that there is nothing else; the message says what was done.

    Parameters
    ----------
    contact : Contact
    load, displacement : float
        Exactly one of them, in the contact's units.
    window : (float, float), optional
        Displacements between which equilibria are looked for; default: the traced range and the displacement asked for.
    control : {"load", "displacement"} or Spring, optional
        Whose stability counts; by default that of the quantity given.
    accuracy, model, progress
        As in `solve`.

    Returns
    -------
    Equilibria
        Without states if there are none in the window.

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    began = time.perf_counter()
    if (load is None) == (displacement is None):
        raise InputError("find_all: give one of load and displacement, not both and not none")
    field = "load" if load is not None else "displacement"
    value = finite_number(load if load is not None else displacement, field)
    driven = check(contact, control or field, accuracy)
    scales = contact.scales
    reduced = driven.scaled(scales.stiffness)
    unit = scales.load if field == "load" else scales.normal
    inside = None if window is None else _window(window, scales.normal)
    chosen, why = choose(contact, model)
    if isinstance(chosen, Exact):
        curve = chosen.curve(contact)
        raw = exact_outcome(curve, None)
        reach = float(raw.load.min())
        every = [] if field == "load" and value / unit < reach else curve.solve(**{field: value / unit})
        found = [exact_state(curve, state, reduced.spring_stiffness) for state in every]
        lowest = [float(raw.displacement.min()), *([value / unit] if field == "displacement" else [])]
        used = inside or (min(lowest), max([float(raw.displacement.max()), *(s.displacement for s in found)]))
        found = [state for state in found if used[0] <= state.displacement <= used[1]]
        connected = [True] * len(found)
    else:
        found, connected, used, raw = chosen.find_all(
            contact.to_reduced(), field, value / unit, accuracy, inside, progress, reduced
        )
    states = tuple(state_in_units(contact, state) for state in found)
    return Equilibria(
        states=states,
        connected=tuple(connected),
        barriers=_barriers(states, connected, driven),
        window=(used[0] * scales.normal, used[1] * scales.normal),
        control=driven.kind,
        stiffness=driven.spring_stiffness,
        model=ModelChoice(chosen.name, why, raw.unknowns),  # type: ignore[arg-type]
        cost=replace(raw.cost, wall_s=time.perf_counter() - began),
        status="complete" if raw.complete else "incomplete",
        message=_message(states, connected, driven, isinstance(chosen, Exact), raw),
        contact=contact,
    )


def best_of(found: Equilibria) -> Solution:
    """The best of all equilibria as `solve` chooses it, with the others behind it.

    Raises
    ------
    InputError
        If there is none.
    """
    if not found.states:
        low, high = found.window
        raise InputError(f"load, displacement: no equilibrium there with a displacement from {low:.6g} to {high:.6g}")
    stable = [state for state in found.states if state.stable(found.control)]
    control = as_control(found.control if found.stiffness is None else Spring(found.stiffness))
    best = min(stable or found.states, key=lambda state: _height(state, control))
    values = {item.name: getattr(best, item.name) for item in fields(State)}
    return Solution(
        **values,
        model=found.model,
        cost=found.cost,
        status=found.status,
        message=found.message,
        states=found.states,
        contact=found.contact,
    )


def _window(window: Sequence[float], unit: float) -> tuple[float, float]:
    if len(window) != 2:
        raise InputError(f"window: {window!r}; must be two displacements")
    low, high = (finite_number(value, "window") / unit for value in window)
    if not low < high:
        raise InputError(f"window: {window!r}; the first displacement must be the smaller one")
    return low, high


def _message(states: Sequence[State], connected: Sequence[bool], control: Control, exact: bool, raw: RawCurve) -> str:
    count, apart = len(states), len(states) - sum(connected)
    stable = sum(state.stable(control) for state in states)
    words = (
        f"{count} equilibri{'um' if count == 1 else 'a'} in the window, {stable} stable under {control.kind} control"
    )
    if exact:
        return f"{words}; all there are, by the closed form."
    if raw.fft_pairs is not None:
        words += "; others were not looked for off the curve."
    elif raw.extra.get("free_boundaries"):
        words += "; others were not looked for off the curve, whose contact set is not a disc everywhere."
    else:
        words += f"; {apart} not connected to the curve." if apart else "; the search off the curve found no other."
    return f"{words} {raw.message}".strip()


def _barriers(states: Sequence[State], connected: Sequence[bool], control: Control) -> tuple[Barrier, ...]:
    """Barriers between consecutive stable states of the curve with one saddle between them."""
    on_curve = [k for k, joined in enumerate(connected) if joined]
    indices = np.array([states[k].unstable(control) for k in on_curve])
    found = []
    for place in range(1, len(on_curve) - 1):
        if indices[place] != 1 or indices[place - 1] != 0 or indices[place + 1] != 0:
            continue
        before, saddle, after = on_curve[place - 1 : place + 2]
        top = _height(states[saddle], control)
        heights = top - _height(states[before], control), top - _height(states[after], control)
        found.append(Barrier((before, after), saddle, heights))
    return tuple(found)


def _height(state: State, control: Control) -> float:
    """Energy of contact and drive."""
    value = control.value(state.load, state.displacement)
    return state.energy + control.potential(value, state.load, state.displacement)
