"""Overdamped relaxation of an axisymmetric contact after a fold, to tell which of several stable states it reaches.

The half space is given a viscosity (Kelvin and Voigt's): ``q = (E/2)(h + dh/dt)`` in units of the viscous time, so that
the flow is the steepest descent of the energy in the norm ∫ h² dt of the elastic energy, with the wall and the drive as
constraints. An implicit Euler step of length 1/s is equilibrium with another elasticity, for the pressures p(r):

    g = A h + f − d,      (1 + s) h = s h_n + B p,      p = p_fr(g),  or g rests at a level of the law
    F = 2 ∫ [h + s (h − h_n)] dt + 2 c s (d − d_n)

with the Abel integrals A and B (`plane` and `abel`, a = 0) and the undeformed tip f. The tip as a whole has a drag of
the same viscosity over the width c = √(2 z0) of the interaction: without it a rigid tip pushed beyond its largest load
would have no state to go to. Whatever the contact set, every node floats in a band of the law or rests at a level
(semismooth Newton's method); one mesh serves, since the flow only decides between states that are known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array, Flags, Indices, magnitude
from contbranch.control import Control
from contbranch.watch import check

from .equations import Equations
from .laying import Functions
from .mesh import Mesh, mesh_on

__all__ = ["Release"]

# To leave the fold, the load is moved on by this share of the interaction's own, a displacement by that of its range;
# where the flow does not leave it, by so many times more: the fold lies a little aside on the mesh of the flow.
NUDGE, PUSHES = 1e-3, (1.0, 10.0, 100.0)
# Changes of gaps in a step, in ranges: aimed at, and allowed.
AIM, LARGEST = 0.2, 0.4
# Lengths of steps, in viscous times, and the largest factor from one to the next.
FIRST_STEP, LONGEST, SHORTEST, GROWTH = 0.1, 1e14, 1e-6, 5.0
STEPS, NEWTON, CONVERGED = 400, 20, 1e-9
# Panels over the radius within which a state is felt, the innermost one's share of them, nodes each, and by how much
# longer each is beyond, up to this multiple of the radius. What moves passes nodes, so that few on each are best.
PANELS, INNERMOST, ORDER, LONGER, REACH = 60, 0.02, 2, 1.3, 20.0
# A pressure is felt that is this share of the largest.
FELT = 1e-3
# It has arrived at a state so close, in ranges, and closer by this factor than to any other.
ARRIVED, CLOSER = 0.3, 2.0


@dataclass(frozen=True)
class _State:
    """h, pressure and gap at the nodes; the bands in which these float, or the levels at which they rest."""

    h: Array
    pressure: Array
    gap: Array
    displacement: float
    index: Indices
    rests: Flags

    @property
    def felt(self) -> Flags:
        """Where there is much of the pressure."""
        return np.asarray(np.abs(self.pressure) >= FELT * magnitude(self.pressure))

    def apart(self, other: _State) -> float:
        """The largest difference of gaps where either is felt."""
        return magnitude((self.gap - other.gap)[self.felt | other.felt])


def _mesh(states: Sequence[Functions]) -> Mesh:
    """Panels that resolve all of some states as far as they are felt, and longer ones beyond."""
    sizes = []
    for state in states:
        pressure = np.abs(state.fields.pressure)
        outermost = state.equations.mesh.nodes[pressure >= FELT * magnitude(pressure)].max()
        sizes.append(math.hypot(float(outermost), state.fields.rim.radius))
    last = min(REACH * max(sizes), states[0].equations.tip.extent)
    edges = [0.0, INNERMOST * min(sizes) / PANELS]
    while edges[-1] < last:
        step = min((size / PANELS for size in sizes if size > edges[-1]), default=math.inf)
        edges.append(min(edges[-1] + min(step, (LONGER - 1) * edges[-1]), last))
    return mesh_on(np.array(edges), ORDER)


@dataclass(frozen=True)
class Release:
    """A state at a fold that is let go, with the control held at its value there.

    Attributes
    ----------
    fold : Functions
    scale : float
        Range of the interaction.
    control : Control
    direction : int
        1 if the fold was reached by raising the control, −1 by lowering it.
    """

    fold: Functions
    scale: float
    control: Control
    direction: int

    def nearest(self, others: Sequence[Functions]) -> int | None:
        """Which of several stable states it comes to rest at; None if at none of them."""
        flow = _Flow(self.fold.equations, _mesh([self.fold, *others]), self.control, self.scale)
        begin, ends = flow.state(self.fold), [flow.state(other) for other in others]
        strength = 2 * math.pi * float((flow.mesh.weights * flow.mesh.nodes) @ np.abs(begin.pressure))
        nudge = strength if self.control.kind == "load" else self.scale
        if self.control.kind == "spring":
            nudge = min(nudge, strength / self.control.stiffness)
        value = self.control.value(2 * float(flow.mesh.weights @ begin.h), begin.displacement)
        for push in PUSHES:
            end = flow.end(begin, self.control.target(value + self.direction * push * NUDGE * nudge))
            if end is None:
                return None
            apart = [other.apart(end) for other in ends]
            first, second = [*np.sort(apart), math.inf][:2]
            if first <= min(ARRIVED * self.scale, second / CLOSER):
                return int(np.argmin(apart))
            if begin.apart(end) > ARRIVED * self.scale:
                return None  # it has left the fold
        return None


class _Flow:
    """Implicit steps on one mesh."""

    def __init__(self, equations: Equations, mesh: Mesh, control: Control, scale: float) -> None:
        self.mesh, self.control, self.law, self.scale = mesh, control, equations.law, scale
        self.compliance, self.tip = mesh.plane @ mesh.abel, equations.tip.height(mesh.nodes)
        self.load_row, self.drag = 2 * mesh.weights @ mesh.abel, 2 * math.sqrt(2 * scale)
        self.levels = np.array(self.law.levels)
        self.low, self.high = np.transpose([self.law.bounds(level) for level in range(len(self.levels))])

    def state(self, known: Functions) -> _State:
        """A state on this mesh."""
        h, pressure = known.transformed(self.mesh.nodes), known.pressure(self.mesh.nodes)
        displacement = known.equations.displacement(known.fields)
        gap = self.mesh.plane @ h + self.tip - displacement
        band = np.maximum(np.searchsorted(self.levels, gap, side="right") - 1, 0)
        return _State(h, pressure, gap, displacement, band, np.zeros(len(gap), dtype=bool))

    def end(self, state: _State, target: float) -> _State | None:
        """Where a state comes to rest; None if it does not."""
        step = FIRST_STEP
        for _ in range(STEPS):
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # answered by a shorter step
                found = self.stepped(state, 1.0 / step, target)
            moved = math.inf if found is None else magnitude((found.gap - state.gap)[state.felt]) / self.scale
            if found is None or not moved <= LARGEST:
                step /= GROWTH
                if step < SHORTEST:
                    return None
                continue
            state = found
            if step >= LONGEST:
                return state
            step *= min(GROWTH, max(1 / GROWTH, AIM / max(moved, 1e-12)))
        return None

    def stepped(self, state: _State, s: float, target: float) -> _State | None:
        """One implicit step; None if Newton's method fails."""
        n, (first, second), drag = self.mesh.size, self.control.weights, self.drag * s
        elastic, before = self.compliance / (1 + s), s / (1 + s) * (self.mesh.plane @ state.h) + self.tip
        pressure, d, index, rests = state.pressure, state.displacement, state.index, state.rests
        gap, matrix = elastic @ pressure + before - d, np.empty((n + 1, n + 1))
        for _ in range(NEWTON):
            check()
            own, stiffness = np.zeros(n), np.zeros(n)
            for band in np.unique(index):
                on = (index == band) & ~rests
                _, own[on], stiffness[on] = self.law.evaluate(int(band), gap[on])
            slope = np.where(rests, 1.0, stiffness)
            matrix[:n, :n] = slope[:, None] * elastic
            matrix[:n, :n].flat[:: n + 1] += ~rests
            matrix[:n, n] = -slope
            matrix[n, :n], matrix[n, n] = first * self.load_row, second + first * drag
            off = np.where(rests, gap - self.levels[index], pressure - own)
            held = first * (self.load_row @ pressure + drag * (d - state.displacement)) + second * d - target
            change = np.linalg.solve(matrix, -np.append(off, held))
            if not np.isfinite(change).all():
                return None
            pressure, d, last = pressure + change[:n], d + float(change[n]), gap
            gap = elastic @ pressure + before - d
            index, new = self._sorted(gap, pressure, index, rests)
            same, rests = bool((new == rests).all()), new
            if same and magnitude(gap - last) < CONVERGED * max(self.scale, abs(d)):
                h = (s * state.h + self.mesh.abel @ pressure) / (1 + s)
                return _State(h, pressure, gap, d, index, rests)
        return None

    def _sorted(self, gap: Array, pressure: Array, index: Indices, rests: Flags) -> tuple[Indices, Flags]:
        """In which bands nodes float and at which levels they rest next, by the inequalities that they violate."""
        pulls, pushes = rests & (pressure < self.low[index]), rests & (pressure > self.high[index])
        falls = ~rests & (gap < self.levels[index])
        climbs = ~rests & (gap > np.append(self.levels[1:], np.inf)[index])
        index = index - pushes + climbs
        stays = self.low[index] < self.high[index]
        return index - (falls & ~stays), (rests & ~pulls & ~pushes) | ((falls | climbs) & stays)
