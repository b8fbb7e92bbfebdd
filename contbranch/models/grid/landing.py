"""Where a tip on a lattice comes to rest: overdamped relaxation to the neighbourhood of a stable state, Newton's method
to its place.

Let the half space be viscous, p = K (u + τ ∂u/∂t). An implicit step of length t then changes the free nodes by

    (K + θ v'') δu = -θ p_c,      θ = t/(t + τ),

Newton's equations with a part of the interaction. Without the softening, v'' < 0, on the left the energy can but
decrease; with it steps are longer. Where little changes, as next to a fold and at the end, they grow longer still,
θ → 1. The mean of u is as viscous as the far field of the contact is stiff, 1/C, whatever is held. Gaps change by less
in a step than the interaction notices.

A state found by Newton's method from where this has come to is taken only if it is the one that was about to be
reached: the energy's slope on the straight line to it decreases to zero, by about half on half the way, and it is
stable. Otherwise the relaxation goes on, until it has converged by itself.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array, Flags, magnitude

from .linear import Border, Linear
from .newton import Equilibrium, Hold, Settings, hold_control, newton, rms, tangent
from .problem import Fields, GridProblem
from .stability import Stability, as_stability

__all__ = ["ESCAPED", "STEPS", "UNSTABLE", "land", "stable"]

# Why there is no state.
ESCAPED = "no stable state is reached: the load pulls the surfaces apart, and nothing further out can hold them"
STEPS = "the number of steps allowed was reached before the residual asked for"
UNSTABLE = "the state reached is unstable, and the relaxation comes back to it whenever it is pushed"
# θ, and the change of a gap in a step at most, relative to the law's range plus the gap.
THETA, STRIDE = 0.9, 0.2
# Inner tolerance of a step, relative, and products at most.
LOOSE, PRODUCTS = 0.05, 30
# Sets of nodes at the wall that are tried for one step, and the part of them that may be left to the next one: single
# contacts of a few nodes are caught by the lattice.
SETS, UNDECIDED = 6, 0.01
# Change of a gap by a step from which on steps grow no longer, and how much at least the viscosity is felt.
AIM, FELT = 0.02, 1e-3
# Residual from which on Newton's method is tried, by how much less for another attempt, and the change of a gap within
# which what it finds is near.
NEAR, NEARER, CLOSE = 0.01, 0.1, 0.15
# Gap in ranges that is none.
ROUNDED = 1e-12
# Residual below which a law is no longer felt, and pushes at most.
FAINT, KICKS = 1e-6, 5


def shortest_length(problem: GridProblem) -> float:
    """The length over which the interaction changes; the cell's longer edge without one."""
    law = problem.law
    return max(problem.lattice.edges) if law is None else min(min(term.range for term in law.terms), 0.25 * law.wave)


def extent(problem: GridProblem, gap: Array, change: Array) -> float:
    """Largest change of a gap, relative to the interaction's range plus the gap."""
    return float(np.max(np.abs(change) / (shortest_length(problem) + gap)))


class _Place(NamedTuple):
    """A trial state out of the wall, the nodes that the wall holds, the force, its residual, and the energy."""

    fields: Fields
    held: Flags
    force: Array
    residual: float
    energy: float


class _Relaxation:
    """Steps under what is held: a load, a displacement or a spring."""

    def __init__(self, problem: GridProblem, hold: Hold) -> None:
        self.problem, self.hold = problem, hold
        lattice = problem.lattice
        self.range = shortest_length(problem)
        self.base = hold.value / (hold.load_weight * lattice.area)
        # dF/d(mean u) of what is held
        self.stiffness = 0.0 if hold.row is None else -float(hold.row) * lattice.size / hold.load_weight

    def place(self, u: Array) -> _Place:
        """Everything at a trial field, moved out of the wall."""
        problem, hold = self.problem, self.hold
        u = np.where(problem.heights + u <= ROUNDED * self.range, -problem.heights, u)
        fields = problem.fields(u, (hold.value - hold.product(u)) / hold.load_weight)
        excess = fields.excess
        held = (fields.gap <= 0.0) & (excess > 0.0)
        force = np.where(held, 0.0, -excess)
        energy = float(0.5 * np.vdot(u, fields.elastic + self.base) + fields.energy.sum())
        return _Place(fields, held, force, rms(force) / (rms(fields.elastic) or 1.0), energy)

    def change(self, place: _Place, soft: float) -> Array | None:
        """δu of an implicit step, with a part of the law's softening; None if it should be tried with none.

        At its end nothing overlaps.
        """
        problem, lattice, fields, held = self.problem, self.problem.lattice, place.fields, place.held
        theta = max(THETA, soft)
        mean = theta * self.stiffness + (1.0 - theta) / lattice.compliance
        stiffness = np.where(fields.stiffness > 0.0, theta, soft) * fields.stiffness
        border = Border(problem, mean / lattice.size, -1.0)
        for _ in range(SETS):
            linear = Linear(problem, stiffness, held, border)
            right = np.where(held, -fields.gap, -theta * fields.excess)
            change = linear.solve(right, 0.0, LOOSE, PRODUCTS)
            if soft and change.residual > LOOSE:
                return None
            wall = change.pressure + stiffness * change.field + theta * fields.excess
            before, held = held, np.where(held, wall > 0.0, fields.gap + change.field < 0.0)
            if (held == before).all():
                break
        if soft and np.count_nonzero(held != before) > UNDECIDED * np.count_nonzero(held):
            return None
        return np.where(held, -fields.gap, change.field)

    def extent(self, place: _Place, change: Array) -> float:
        """Largest change of a gap, relative to the interaction's range plus the gap."""
        return extent(self.problem, place.fields.gap, change)

    def leads_to(self, place: _Place, state: Equilibrium) -> bool:
        """Whether a state is near, and the energy falls on the straight line to it as it does towards a minimum.

        Its slope must be that of a parabola, but for a third, on half the way.
        """
        change = state.u - place.fields.u
        if self.extent(place, change) > CLOSE:
            return False
        slope = float(np.vdot(place.force, change))
        middle = self.place(place.fields.u + 0.5 * change)
        half = float(np.vdot(np.where(place.held, 0.0, middle.force), change))
        return not change.any() or (slope > 0.0 and abs(half / slope - 0.5) < 0.3)

    def escaped(self, place: _Place) -> bool:
        """Whether a load has pulled the surfaces apart."""
        law, fields = self.problem.law, place.fields
        apart = 0.0 if law is None else law.reach(FAINT)
        return self.hold.row is None and fields.load <= 0.0 and float(fields.gap.min()) > apart

    def push(self, place: _Place, seed: int) -> Array:
        """A small change of u at random."""
        noise = np.where(place.held, 0.0, np.random.default_rng(seed).standard_normal(self.problem.shape))
        change = self.problem.transform.filter(self.problem.smoother(1.0 / self.range), noise)
        return 0.1 * self.range / magnitude(change) * change


def _softer(part: float, extent: float) -> float:
    """The part of the softening in the next step: up to θ at once, on to 1 while gaps change little."""
    if part < THETA:
        return min(2.0 * part + 0.1, THETA)
    return 1.0 - min(max((1.0 - part) * min(max(extent / AIM, 0.5), 2.0), FELT), 1.0 - THETA)


def stable(problem: GridProblem, state: Equilibrium, hold: Hold) -> bool:
    """Whether no variation with the symmetry of the lattice lowers the energy under what is held.

    To the modes at fixed displacement another control adds one where what is held falls as the displacement grows.
    """
    with as_stability(problem):
        if Stability(problem).spectrum(state).index:
            return False
        along = tangent(problem, state, hold_control(problem, 0.0, 1.0, 0.0))
        return hold.product(along.field) + hold.load_weight * along.load > 0.0


def land(problem: GridProblem, u: Array, hold: Hold, tolerance: float = 1e-8, steps: int = 500) -> Equilibrium:
    """Relax a state that is none any more, as beyond a fold, or any other start, to the stable state where that ends.

    Parameters
    ----------
    problem : GridProblem
    u : array
        Start: the last state before the jump.
    hold : Hold
        Load, displacement or spring after the jump.
    tolerance : float
        Residual to reach.
    steps : int
        Steps at most, in all.

    Returns
    -------
    Equilibrium
        Not converged, with a reason, if there is no stable state to be reached.
    """
    before = problem.counter.equilibrium
    motion = _Relaxation(problem, hold)
    place, soft, goal, kicks, reason = motion.place(u), 0.0, NEAR, 0, STEPS
    for step in range(steps + 1):
        state, spent = None, problem.counter.equilibrium - before
        if motion.escaped(place) or kicks > KICKS:
            reason = UNSTABLE if kicks > KICKS else ESCAPED
            break
        if place.residual <= max(goal, tolerance):
            settings = Settings(tolerance, steps=8, inner=100, growth=2.0)
            found = newton(problem, place.fields.u, place.fields.load, hold, place.held, settings)
            if found.converged and motion.leads_to(place, found):
                state = replace(found, steps=step, pairs=spent + found.pairs)
            goal = NEARER * place.residual
        if state is not None and stable(problem, state, hold):
            return state
        if state is not None and place.residual <= tolerance:
            # A start on an unstable state: it is left only if pushed.
            kicks, goal = kicks + 1, NEAR
            place = motion.place(place.fields.u + motion.push(place, seed=kicks))
        for part in (soft, 0.0):
            change = motion.change(place, part)
            if change is None:
                continue
            extent = motion.extent(place, change)
            longest = STRIDE / max(extent, STRIDE)
            after = motion.place(place.fields.u + longest * change)
            # Modes that are unstable within the step turn its sense.
            if after.energy <= place.energy:
                break
        place, soft = after, _softer(part, extent)
    fields = place.fields
    displacement, spent = problem.displacement(fields.u, fields.load), problem.counter.equilibrium - before
    return Equilibrium(fields, place.held, place.residual, displacement, False, step, spent, reason)
