"""The exact curve as a raw result, like that of every other model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.exponents import crossover_excess, fitted_window
from contbranch.curve.outcome import RawCurve, RawEvent
from contbranch.models.exact.curve import ExactCurve
from contbranch.models.exact.results import ExactEvent, ExactState
from contbranch.models.exact.series import LocalExpansion
from contbranch.results.diagram import Cost, Exponent, LocalExponent, Profile, State

__all__ = ["exact_outcome", "exact_state", "plain_state"]

Array = NDArray[np.float64]

ROUNDING = 1e-14
# Excess of the control over which exponents are sampled and fitted (reduced units).
WINDOW = (1e-2, 1e1)
SAMPLES = np.geomspace(1e-8, 1e2, 101)


def exact_outcome(curve: ExactCurve, max_load: float | None, control: Control = LOAD) -> RawCurve:
    """The whole curve with its events, and those of a spring, in reduced units."""
    began = time.perf_counter()
    stiffness = control.spring_stiffness
    states = curve.sample(160, max_load=max_load, stiffness=stiffness)
    found = [*curve.events, *(() if stiffness is None else curve.spring_events(stiffness))]
    own = sorted((e for e in found if e.state.parameter <= states.parameter[-1]), key=lambda e: e.state.parameter)
    events = [_event(curve, event, states.parameter, stiffness) for event in own]
    last = len(states.parameter) - 1
    end = states.state(last)
    values = (end.load, end.displacement, end.contact_radius, end.central_gap)
    events.append(RawEvent("end", last, values, _rounding(values)))
    return RawCurve(
        states.load,
        states.displacement,
        states.contact_radius,
        states.central_gap,
        states.energy,
        states.unstable_load,
        states.unstable_displacement,
        ROUNDING * np.maximum(1.0, np.abs(states.load)),
        ROUNDING * np.maximum(1.0, np.abs(states.displacement)),
        [_deferred_profile(curve, states.state(k)) for k in range(last + 1)],
        events,
        True,
        "",
        Cost(time.perf_counter() - began, 0),
        1,
        unstable_spring=None if stiffness is None else curve.unstable_spring(states, stiffness),
        # The gap of a parabola under attraction grows with the radius: no azimuthal mode is unstable (see `azimuthal`).
        unstable_azimuthal=np.zeros_like(states.unstable_displacement),
    )


def plain_state(state: ExactState) -> State:
    """A state without profile, reduced units."""
    values = (state.load, state.displacement, state.contact_radius, state.central_gap)
    keys = ("load", "displacement", "contact_radius", "central_gap")
    error = dict(zip(keys, _rounding(values), strict=True))
    return State(*values, state.energy, state.unstable_load, state.unstable_displacement, 0.0, error)


def exact_state(curve: ExactCurve, state: ExactState, stiffness: float | None = None) -> State:
    """A state with its profile, and its stability under a spring, in reduced units."""
    profile = curve.profile(state)
    keys = ("load", "displacement", "contact_radius", "central_gap")
    values = (state.load, state.displacement, state.contact_radius, state.central_gap)
    return State(
        *values,
        state.energy,
        state.unstable_load,
        state.unstable_displacement,
        0.0,
        dict(zip(keys, _rounding(values), strict=True)),
        Profile(profile.r, profile.gap, profile.pressure, profile.wall_pressure),
        None if stiffness is None else int(curve.unstable_spring_at(state.parameter, stiffness)),
    )


def _rounding(values: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    load, displacement, radius, gap = (ROUNDING * max(1.0, abs(value)) if value else 0.0 for value in values)
    return load, displacement, radius, gap


def _deferred_profile(curve: ExactCurve, state: ExactState) -> Callable[[], Profile]:
    def profile() -> Profile:
        found = curve.profile(state)
        return Profile(found.r, found.gap, found.pressure, found.wall_pressure)

    return profile


def _event(curve: ExactCurve, event: ExactEvent, parameters: Array, stiffness: float | None) -> RawEvent:
    state = event.state
    keys = ("load", "displacement", "contact_radius", "central_gap")
    row = int(np.argmin(np.abs(parameters - state.parameter)))
    values = (state.load, state.displacement, state.contact_radius, state.central_gap)
    error = tuple(event.error[key] for key in keys)
    own_stiffness = stiffness if event.control == "spring" else None
    raw = RawEvent(
        event.kind,
        row,
        values,
        (error[0], error[1], error[2], error[3]),
        event.control,
        name=event.name,
        stiffness=own_stiffness,
        place=event,
    )
    smooth = event.kind == "touch" or event.name == "pull-off"
    if not smooth:  # at the edge of the interaction the curve has a corner, not a quadratic fold
        return raw
    control = LOAD
    if event.control == "spring" and stiffness is not None:
        control = Control("spring", stiffness)
    elif event.control == "displacement":
        control = DISPLACEMENT
    return replace(
        raw,
        exponent=None if event.kind == "touch" else lambda: _exponent(curve, event, control),
        local_exponent=lambda: _local(curve, event, control),
    )


def _exponent(curve: ExactCurve, event: ExactEvent, control: Control) -> Exponent:
    expansion = curve.expansion(event.state, 3)
    derivatives = _controlled(control, expansion)
    return Exponent(
        0.5,
        crossover_excess(float(derivatives[2]), float(derivatives[3])),
        fitted_window(_local(curve, event, control), *WINDOW),
        math.sqrt(2 / abs(float(derivatives[2]))),
        expansion.coordinate,
    )


def _controlled(control: Control, expansion: LocalExpansion) -> Array:
    """Derivatives of what is controlled with respect to the order parameter."""
    if control.kind == "spring":
        return np.asarray(expansion.displacement + expansion.load / control.stiffness)
    return np.asarray(expansion.load if control.kind == "load" else expansion.displacement)


def _local(curve: ExactCurve, event: ExactEvent, control: Control) -> LocalExponent:
    """κ_local along the contact side, from slopes in closed form (the contact radius, or the gap where there is
    none)."""
    state = event.state
    in_contact = state.contact_radius > 0 or event.kind == "touch"
    start = control.value(state.load, state.displacement)
    order = state.contact_radius if in_contact else state.central_gap
    rows: list[tuple[float, float, float, float]] = []
    for step in np.geomspace(1e-6, 10.0, 90):
        parameter = state.parameter + step * (
            max(1.0, curve.touch_radius) if in_contact else abs(state.parameter) / 10.0
        )
        if not in_contact and parameter >= 0:
            break
        expansion = curve.expansion(curve.states(parameter).state(0), 1)
        values = _controlled(control, expansion)
        excess, moved = float(values[0]) - start, float(expansion.value) - order
        if not rows:
            direction = 1.0 if excess > 0 else -1.0
        if excess * direction <= 0 or (rows and abs(excess) <= rows[-1][0]):
            break
        kappa = excess / (moved * float(values[1]))
        scale = max(1.0, abs(start))
        rows.append((abs(excess), abs(moved), kappa, abs(kappa) * ROUNDING * (scale / abs(excess) + 1.0 / abs(moved))))
        if abs(excess) > SAMPLES[-1]:
            break
    table = np.array(rows).reshape(-1, 4)
    table = table[table[:, 3] < 0.5]
    return LocalExponent(table[:, 0], table[:, 1], table[:, 2], table[:, 3])
