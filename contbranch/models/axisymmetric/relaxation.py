"""Overdamped relaxation of an axisymmetric contact after a fold, to tell which of several stable states it reaches.

The half space is given a viscosity (Kelvin and Voigt's): ``q = (E/2)(h + dh/dt)`` in units of the viscous time, so that
the flow is the steepest descent of the energy in the norm ∫ h² dt of the elastic energy, with the wall and the drive as
constraints. An implicit Euler step of length 1/s minimises V + s ∫ (h − h_n)² dt:

    (1 + s) h(t) − s h_n(t) = 2 ∫_t^∞ σ p_fr(g) / √(σ² − t²) dσ  for t > a,   phi(a) = 0
    F = 2 ∫ [h + s (h − h_n)] dt

which is equilibrium with another elasticity: the same unknowns, the same rim condition. The tip as a whole has a drag
of the same viscosity over the width c = √(2 z0) of the interaction, which adds 2 c s (d − d_n) to F: without it a rigid
tip pushed beyond its largest load would have no state to go to.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.control import Control
from contbranch.watch import check

from .adapt import adapted_edges, needed_reach
from .equations import Equations
from .mesh import mesh_on

__all__ = ["Release"]

# To leave the fold, the load is moved on by this share of the interaction's own, a displacement by that of its range.
NUDGE = 1e-4
# Change of the contact parameter u in a step (without contact also of the gap in units of twice the range): aimed at,
# allowed, and allowed past a stable state, whose basin a longer step might leap over.
AIM, LARGEST, PASSING = 0.05, 0.15, 0.01
FIRST_STEP, LONGEST, SHORTEST = 0.1, 1e14, 1e-6
# Largest factor from one step to the next, and by how much it grows again where a step failed.
GROWTH, RECOVERY = 3.0, 1.3
STEPS, NEWTON = 2000, 20
# Newton's method is given up where its corrections have not halved for so many: a shorter step costs less than luck.
PATIENCE = 4
# The control is pushed on by so much more where the flow does not leave the fold; it has arrived at a state so close in
# u.
PUSHES, ARRIVED = (1.0, 10.0, 100.0), 0.1
# Meshes for the flow: it decides between states, which are then found to the accuracy asked.
TOLERANCE = 1e-4
# Where attraction and repulsion all but cancel, the load is this small a share of what either could carry, or smaller.
SMALLEST_SHARE = 1e-7


class _State:
    """h on the mesh of its own rim, and the functions of t that the next step needs."""

    def __init__(self, equations: Equations, h: Array, y: float) -> None:
        self.equations, self.h, self.y = equations, h, y
        self.fields = equations.fields(h, y)
        self.displacement = equations.displacement(self.fields)
        self.load = equations.load(self.fields)

    @property
    def strength(self) -> float:
        """2π ∫ |p_fr| r dr, the load that the interaction could carry."""
        mesh = self.equations.mesh
        return 2 * math.pi * float((mesh.weights * mesh.nodes) @ np.abs(self.fields.pressure))

    def profile(self, t: Array) -> Array:
        """h(t) for any t: d − zeta(t) inside the contact, 0 beyond the mesh."""
        a = self.fields.rim.radius
        tau = np.sqrt(np.maximum(t * t - a * a, 0.0))
        outside = self.equations.mesh.interpolate(self.h, tau)
        if a == 0.0:
            return outside
        inside = self.displacement - self.equations.tip.transform(np.minimum(t, a))
        return np.where(t < a, inside, outside)


@dataclass(frozen=True)
class Release:
    """A state at a fold that is let go, with the control held at its value there.

    Attributes
    ----------
    equations, h, y : Equations, array (N,), float
        The fold.
    scale : float
        Range of the interaction; y = scale · sinh(u).
    control : Control
    direction : int
        1 if the fold was reached by raising the control, −1 by lowering it.
    guarded : bool
        Stop, without having settled, where the surfaces would penetrate one another outside the disc.
    """

    equations: Equations
    h: Array
    y: float
    scale: float
    control: Control
    direction: int
    guarded: bool

    def end(self, push: float, others: Sequence[float]) -> float | None:
        """The contact parameter y at which it comes to rest; None if it does not.

        Parameters
        ----------
        push : float
            Factor of the little by which the control is moved on to leave the fold.
        others : sequence of float
            Contact parameters y of stable states: what bounds their basins may be close behind them.
        """
        state = _State(self.equations, self.h, self.y)
        share, held = self._held(state, push)
        step, rate, growth = FIRST_STEP, 0.0, GROWTH
        for _ in range(STEPS):
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # answered by a shorter step
                state = _remeshed(state, share)
                found = _implicit(state, 1.0 / step, rate * step, held)
            moved = math.inf if found is None else _moved(found.y, state.y, self.scale)
            passed = found is not None and any((y - state.y) * (y - found.y) < 0.0 for y in others)
            if found is None or moved > (PASSING if passed else LARGEST):
                step /= GROWTH
                rate, growth = 0.0, 1.0
                if step < SHORTEST:
                    break
                continue
            rate = (found.y - state.y) / step
            state = found
            if self.guarded and float(state.fields.gap.min()) < 0.0:
                break
            if step >= LONGEST:
                return state.y
            step = min(step * min(growth, max(0.5, AIM / max(moved, 1e-12))), LONGEST)
            growth = min(GROWTH, RECOVERY * growth)
        return None

    def _held(self, state: _State, push: float) -> tuple[float, _Held]:
        """How small the forces at play are, as a share of what the interaction could carry, and what is held."""
        control, value = self.control, self.control.value(state.load, state.displacement)
        # A load that is small compared with the forces at play is nudged, and the flow resolved, by its own measure.
        share = 1.0
        if control.kind == "load" and not self.equations.contact and state.strength > 0.0:
            share = min(1.0, max(SMALLEST_SHARE, abs(value) / state.strength))
        nudge = share * state.strength if control.kind == "load" else self.scale
        if control.kind == "spring":
            nudge = min(nudge, state.strength / control.stiffness)
        target = control.target(value + self.direction * push * NUDGE * nudge)
        return share, _Held(control, target, 2 * math.sqrt(2 * self.scale))

    def nearest(self, others: Sequence[float]) -> int | None:
        """Which of several contact parameters y it comes to rest at; None if at none of them.

        The fold may lie a little aside on the meshes of the relaxation: where that has not left it, it is pushed
        harder.
        """
        for push in PUSHES:
            end = self.end(push, others)
            if end is None:
                return None
            apart = [_moved(y, end, self.scale, far=0.0) for y in others]
            nearest = int(np.argmin(apart))
            if apart[nearest] <= ARRIVED:
                return nearest
            if _moved(self.y, end, self.scale, far=0.0) > ARRIVED:
                return None  # it has left the fold
        return None


@dataclass(frozen=True)
class _Held:
    """What the drive does: ``w·(F, d)`` = target, against a drag of the tip as a whole."""

    control: Control
    target: float
    drag: float


def _moved(y: float, before: float, scale: float, far: float = 0.5) -> float:
    """How far one state is from another: in u, without contact at least in this share of the gap in ranges."""
    moved = abs(math.asinh(y / scale) - math.asinh(before / scale))
    return moved if max(y, before) > 0.0 else max(moved, far * abs(y - before) / scale)


def _remeshed(state: _State, share: float) -> _State:
    """The state on a mesh that follows it."""
    equations, fields = state.equations, state.fields
    allowed = TOLERANCE * share * state.strength
    reach = needed_reach(equations, fields, 0.1 * allowed)
    end = float(equations.mesh.end)
    edges = np.append(equations.mesh.edges, reach) if reach > 1.05 * end else None
    if edges is None:
        edges = adapted_edges(equations, fields, 0.1 * allowed, max(reach, 0.5 * end), equations.mesh)
        if len(edges) == len(equations.mesh.edges):
            return state
    mesh = mesh_on(edges, equations.mesh.order)
    return _State(equations.on(mesh), equations.mesh.interpolate(state.h, mesh.nodes), state.y)


def _implicit(state: _State, s: float, ahead: float, held: _Held) -> _State | None:
    """One implicit step, on the side of first touch on which it ends; None if Newton's method fails."""
    contact = state.y + ahead > 0.0
    for _ in range(2):
        y = state.y + ahead
        if (y > 0.0) != contact:
            y = 0.0
        found = _newton(state, state.equations.touching(contact), y, s, held)
        if found is not None:
            return found
        contact, ahead = not contact, 0.0
    return None


def _newton(state: _State, equations: Equations, y: float, s: float, held: _Held) -> _State | None:
    """Newton's method for (h, y) on one side of first touch."""
    tau = equations.mesh.nodes
    first, second = held.control.weights

    def radius(at: float) -> float:
        return equations.coordinate.radius(at) if equations.contact else 0.0

    def before(at: float) -> Array:
        return state.profile(np.hypot(tau, radius(at)))

    h = old = before(y)
    n = equations.mesh.size
    floor = 0.0 if equations.contact else -math.inf
    last = smallest = math.inf
    waited = 0
    for _ in range(NEWTON):
        check()
        fields = equations.fields(h, y)
        if not fields.finite:
            return None
        if equations.contact:
            old = before(y)
        load, displacement = equations.load(fields), equations.displacement(fields)
        residual = fields.residual + s * (h - old)
        felt = load + s * (load - state.load) + held.drag * s * (displacement - state.displacement)
        excess = first * felt + second * displacement - held.target
        width = 1e-6 * max(1e-3, abs(y))
        drift = (before(y + width) - old) / width if equations.contact else np.zeros(n)
        rim = fields.rim
        lift = equations.coordinate.slopes(y)[2] if equations.contact else 1.0
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = equations.jacobian(fields)
        matrix[:n, :n].flat[:: n + 1] += s
        matrix[:n, n] = equations.slopes(fields)[1] - s * drift
        load_row = 2 * (rim.weights + rim.radius * equations.rim_row)
        moving = second + first * held.drag * s
        matrix[n, :n] = first * (1 + s) * load_row + moving * equations.rim_row
        load_slope, _ = equations.rates(fields, np.zeros(n), 1.0)
        matrix[n, n] = first * (1 + s) * load_slope + moving * lift
        try:
            change = np.linalg.solve(matrix, -np.append(residual, excess))
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(change).all():
            return None
        deformed, moved = magnitude(change[:n]), abs(float(change[n]))
        size = deformed + moved
        halved = size < 0.5 * smallest
        smallest, waited = (size, 0) if halved else (smallest, waited + 1)
        if size > 1e3 * max(1.0, last) or waited >= PATIENCE:
            return None
        last = size
        h, y = h + change[:n], y + float(change[n])
        if equations.contact and y < 0.0:
            y = 0.0
        if not equations.contact and y > 0.0:
            return None  # the surfaces meet: the step ends in contact
        # Far away all deformations are tiny, and so is what tells one state from the next: their errors are relative.
        if deformed < 1e-9 * magnitude(h) and moved < 1e-9 * max(1.0, abs(y)):
            return _State(equations, h, y) if y > floor else None
    return None
