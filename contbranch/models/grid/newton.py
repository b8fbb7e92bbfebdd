"""Semismooth Newton (primal-dual active set) for an equilibrium on a lattice.

One step, at a trial state with contact nodes A and free nodes I, brings the nodes of A to the wall and on I solves

    [ K + v''    b ] [ δu ]     [ -p_c               ]
    [   cᵀ       ω ] [ δF ]  =  [ -(what is held)    ]        b = 1/A (the load, spread over the area),

where ``c·u + ω F = value`` is what is held: a load, a displacement, a spring, or the progress along a curve
(`linear`). Then nodes of I that overlap join the contact, and nodes of A with negative wall pressure leave it. The
pressure K u + F/A changes by what the linear system says it does, so that a step needs no transform besides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.control import Control

from .linear import Border, Change, Linear
from .problem import Fields, GridProblem

# Shortest part of a step that is tried when the residual grows.
SHORTEST = 0.125
# Rounding of pressures, in reduced units, beyond which a state says nothing: so far away any load would seem balanced.
UNTOLD = 1e-6
# How much softer than the stiffest wave of the lattice those are that an overlap excites.
LONGER = 1.0 / 16.0

__all__ = [
    "Equilibrium",
    "Hold",
    "Settings",
    "Sketch",
    "control_held",
    "hold_control",
    "newton",
    "rms",
    "settings_for",
    "tangent",
]


@dataclass(frozen=True)
class Hold:
    """What is kept during the iteration: ``Σ row · u + load_weight · F = value``.

    Attributes
    ----------
    value : float
    load_weight : float
        ω.
    row : array, float or None
        c, a field or one number for all nodes; None for a load alone.
    slack : float, optional
        How far an equilibrium may be from the value; default: rounding.
    """

    value: float
    load_weight: float = 1.0
    row: Array | float | None = None
    slack: float | None = None

    @property
    def allowed(self) -> float:
        """How far an equilibrium may be from what is held."""
        return 1e-11 * max(1.0, abs(self.value)) if self.slack is None else self.slack

    def excess(self, u: Array, load: float) -> float:
        """How far a trial state is from what is held."""
        return self.product(u) + self.load_weight * load - self.value

    def product(self, u: Array) -> float:
        """Σ row · u."""
        if self.row is None:
            return 0.0
        return float(self.row * u.sum()) if isinstance(self.row, float) else float(np.vdot(self.row, u))


def hold_control(problem: GridProblem, load_weight: float, displacement_weight: float, value: float) -> Hold:
    """Hold ``load_weight · F + displacement_weight · d``, with d = C F - mean(u)."""
    if displacement_weight == 0.0:
        return Hold(value, load_weight)
    nodes = problem.lattice.size
    whole = load_weight + displacement_weight * problem.lattice.compliance
    return Hold(value, whole, -displacement_weight / nodes)


def control_held(problem: GridProblem, control: Control, value: float) -> Hold:
    """What is held at a value of a control."""
    if control.kind == "load":
        return Hold(value)
    return hold_control(problem, 1.0 / control.stiffness if control.kind == "spring" else 0.0, 1.0, value)


@dataclass(frozen=True)
class Settings:
    """Tolerances of the iteration.

    Attributes
    ----------
    tolerance : float
        Residual to reach, relative (see `Equilibrium.residual`).
    steps : int
        Newton steps at most.
    inner : int
        Krylov iterations at most in a step.
    forcing : float
        Loosest inner tolerance.
    growth : float
        Growth of the residual that is taken as failure.
    patience : int
        Steps after which the residual must have fallen to half of what it was, or the iteration has failed.
    wall : bool
        Whether gaps must not be negative; without the wall there is no contact.
    frozen : bool
        Whether the contact stays as it is given, whatever its pressures and the gaps outside are.
    """

    tolerance: float = 1e-8
    steps: int = 30
    inner: int = 200
    forcing: float = 0.005
    growth: float = 1e3
    patience: int = 30
    wall: bool = True
    frozen: bool = False


@dataclass(frozen=True)
class Equilibrium:
    """A state on the lattice, and how well it is one.

    Attributes
    ----------
    fields : Fields
    contact : array of bool
        Nodes at the wall.
    residual : float
        Root mean square of p_c on the free nodes and of its negative part in contact, relative to that of the pressure.
    displacement : float
    converged : bool
    steps, pairs : int
        Steps and pairs of transforms spent.
    reason : str
        Why it has not converged, where that is known.
    """

    fields: Fields
    contact: Flags
    residual: float
    displacement: float
    converged: bool
    steps: int = 0
    pairs: int = 0
    reason: str = ""

    def slim(self) -> Equilibrium:
        """The state with its u, load and contact only; other fields are not to be used."""
        u = self.fields.u
        return replace(self, fields=Fields(u, self.fields.load, u, u, u, u, u))

    @property
    def load(self) -> float:
        """F."""
        return self.fields.load

    @property
    def u(self) -> Array:
        """The unknown field."""
        return self.fields.u

    def beyond(self, other: Equilibrium) -> tuple[Array, float]:
        """The step from another state: changes of field and load."""
        return self.u - other.u, self.load - other.load


def settings_for(accuracy: float) -> Settings:
    """Tolerances for states of an accuracy."""
    return Settings(tolerance=min(max(1e-3 * accuracy, 1e-10), 1e-9))


class Sketch(NamedTuple):
    """A trial state: the field u, the load, the contact."""

    u: Array
    load: float
    contact: Flags


def newton(
    problem: GridProblem,
    u: Array | Fields,
    load: float,
    hold: Hold,
    contact: Flags | None = None,
    settings: Settings = Settings(),
) -> Equilibrium:
    """Solve for an equilibrium from a trial state.

    Parameters
    ----------
    problem : GridProblem
    u, load : array or Fields, float
        Trial state, or everything at it.
    hold : Hold
    contact : array of bool, optional
        Trial contact; default: nodes where the trial state overlaps with the wall.
    settings : Settings

    Returns
    -------
    Equilibrium
        With ``converged`` False if the iteration failed, and the last state.
    """
    before = problem.counter.equilibrium
    if contact is None or not settings.wall:
        contact = (problem.heights + (u.u if isinstance(u, Fields) else u) <= 0.0) & settings.wall
    if hold.row is None:
        load = hold.value / hold.load_weight
    fields = u if isinstance(u, Fields) else problem.fields(u, load, contact)
    trial = _Trial.at(problem, fields, contact, settings.frozen)
    border: Border | None = None
    best = trial.merit
    steady, waited, step = False, 0, 0
    while True:
        fields = trial.fields
        held = hold.excess(fields.u, fields.load)
        done = trial.residual <= max(settings.tolerance, trial.rounding) and abs(held) <= hold.allowed
        failed = not math.isfinite(trial.merit) or trial.merit > settings.growth * max(best, 1e-3)
        if problem.rounding(fields.u) > UNTOLD:
            done, failed = False, True
        if done or failed or step == settings.steps or waited > settings.patience:
            touching = fields._replace(u=np.where(trial.contact, -problem.heights, fields.u))
            displacement = problem.displacement(touching.u, fields.load)
            pairs = problem.counter.equilibrium - before
            return Equilibrium(touching, trial.contact, trial.residual, displacement, done, step, pairs)
        older, kept, border = trial, trial.kept, border or Border(problem, hold.row, hold.load_weight)
        linear = Linear(problem, fields.stiffness, kept, border)
        right = np.where(kept, -(problem.heights + fields.u), -fields.excess)
        change = linear.solve(right, -held, _forcing(trial.merit, steady, settings), settings.inner)
        length = 1.0
        while True:
            trial = older.moved(problem, change, length, kept, settings.wall)
            # Where the law softens, nodes that leave the wall together can overshoot. The first step may well come from
            # an equilibrium that is not where it is to be held.
            if step == 0 or trial.merit <= max(1.2 * older.merit, settings.tolerance) or length <= SHORTEST:
                break
            length *= 0.5
        steady = length == 1.0 and bool((trial.contact == older.contact).all())
        step += 1
        problem.counter.newton += 1
        waited += 1
        if trial.merit <= 0.5 * best:
            best, waited = trial.merit, 0


@dataclass(frozen=True)
class _Trial:
    """A trial state, with its residual and what rounding leaves in that.

    Nodes in contact may miss the wall until the end. What the wall then changes is at most the stiffest wave of the
    lattice times the distance, which belongs to the residual; by how much longer waves make of it steps are judged.
    """

    fields: Fields
    contact: Flags
    residual: float
    merit: float
    rounding: float
    kept: Flags
    frozen: bool = False

    @staticmethod
    def at(problem: GridProblem, fields: Fields, contact: Flags, frozen: bool = False) -> _Trial:
        excess = fields.excess
        missed = problem.lattice.stiffest * np.where(contact, problem.heights + fields.u, 0.0)
        kept = contact & ((excess > missed) | frozen)
        violated = np.where(contact, 0.0 if frozen else np.minimum(excess - missed, 0.0), excess)
        size = rms(fields.elastic) or 1.0
        own, wall = rms(violated) / size, rms(missed) / size
        rounding = problem.rounding(fields.u) / size
        return _Trial(fields, contact, own + wall, own + LONGER * wall, rounding, kept, frozen)

    def moved(self, problem: GridProblem, change: Change, length: float, kept: Flags, wall: bool) -> _Trial:
        """The trial state after a part of a step; what overlaps then joins the contact."""
        before = self.fields
        u, load = before.u + length * change.field, before.load + length * change.load
        contact = kept | (problem.heights + u < 0.0) if wall and not self.frozen else kept
        elastic = before.elastic + length * change.pressure
        return _Trial.at(problem, problem.evaluated(u, load, elastic, contact), contact, self.frozen)


def tangent(
    problem: GridProblem, state: Equilibrium, hold: Hold, tolerance: float = 1e-3, near: Change | None = None
) -> Change:
    """The direction of the curve at an equilibrium while its contact stays, with unit progress in what is held.

    Parameters
    ----------
    near : Change, optional
        A direction of any length that is near it.
    """
    border = Border(problem, hold.row, hold.load_weight)
    linear = Linear(problem, state.fields.stiffness, state.contact, border)
    if near is not None:
        size = border.met(near)
        near = Change(near.field / size, near.load / size, near.pressure / size, 0.0)
    return linear.solve(np.zeros(problem.shape), 1.0, tolerance, near=near)


def _forcing(residual: float, steady: bool, settings: Settings) -> float:
    """Inner tolerance: no tighter than a step can use while the contact set changes, nor than is asked for at last."""
    wanted = min(settings.forcing, 0.3 * math.sqrt(residual)) if steady else settings.forcing
    return max(wanted, 0.02 * settings.tolerance / max(residual, settings.tolerance))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.linalg.norm(values)) / math.sqrt(values.size)
