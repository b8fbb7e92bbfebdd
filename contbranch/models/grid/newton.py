"""Semismooth Newton (primal-dual active set) for an equilibrium on a lattice.

One step, at a trial state with contact nodes A and free nodes I: u = -z on A, and on I

    [ K + v''    b ] [ δu ]     [ -p_c - K_IA δu_A ]
    [   cᵀ       ω ] [ δF ]  =  [ -(what is held)  ]        b = 1/A (the load, spread over the area),

where ``c·u + ω F = value`` is what is held: a load (then δF is known and the border is absent), a displacement, a
spring, or the progress along a curve. Then nodes of I that overlap join the contact, and nodes of A with negative
wall pressure leave it. The inner systems are solved by GMRES to a tolerance tied to the residual, with (K + constant)⁻¹
restricted to I as preconditioner: indefinite on unstable branches, and not symmetric along a curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from contbranch.control import Control
from contbranch.models.grid.solvers.gmres import gmres

from .arrays import Array, Mask
from .problem import Fields, GridProblem

# Memory for the basis of the inner iteration.
BASIS_BYTES = 1e9
# Shortest part of a step that is tried when the residual grows.
SHORTEST = 0.125

__all__ = ["Equilibrium", "Hold", "Settings", "Sketch", "control_held", "hold_control", "newton", "settings_for"]


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
    nodes = problem.lattice.size**2
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
    """

    tolerance: float = 1e-8
    steps: int = 30
    inner: int = 200
    forcing: float = 0.03
    growth: float = 1e3
    patience: int = 30
    wall: bool = True


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
    first : float
        Residual of the trial state.
    reason : str
        Why it has not converged, where that is known.
    """

    fields: Fields
    contact: Mask
    residual: float
    displacement: float
    converged: bool
    steps: int = 0
    pairs: int = 0
    first: float = 0.0
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


def settings_for(accuracy: float) -> Settings:
    """Tolerances for states of an accuracy."""
    return Settings(tolerance=min(max(1e-2 * accuracy, 1e-10), 1e-8))


class Sketch(NamedTuple):
    """A trial state: the field u, the load, the contact."""

    u: Array
    load: float
    contact: Mask


class Linearised:
    """The operator A of one step with its preconditioner M⁻¹, bordered unless the load is held.

    Vectors are fields, flat, with δF as last entry. With S = (K + shift)⁻¹ and z = S y, K z = y - shift z costs no
    transform; only what the contact takes away from z does.
    """

    def __init__(self, problem: GridProblem, stiffness: Array, free: Mask, hold: Hold, shift: float) -> None:
        self.problem = problem
        self.mask = free.astype(np.float64)
        self.diagonal = stiffness * self.mask
        self.nodes = self.mask.size
        self.shift = shift
        self.smoother = problem.smoother(shift)
        self.unrestricted = bool(free.all())
        self.bordered = hold.row is not None
        if hold.row is not None:
            # Row and column are scaled to the size of the field's entries.
            row, column = (hold.row * self.mask).ravel(), self.mask.ravel() / problem.lattice.area
            # all nodes may be in contact in a trial state
            self.column_scale = 1.0 / (float(np.linalg.norm(column)) or 1.0)
            norm = max(float(np.linalg.norm(row)), 1e-6 * abs(hold.load_weight) * self.column_scale) or 1.0
            self.row_scale = 1.0 / norm
            self.row, self.column = row * self.row_scale, column * self.column_scale
            self.corner = hold.load_weight * self.row_scale * self.column_scale

    def product(self, y: Array) -> tuple[Array, Array]:
        """A M⁻¹ y and M⁻¹ y."""
        shape = self.mask.shape
        given = y[: self.nodes].reshape(shape)
        image, smoothed = np.empty_like(y), np.empty_like(y)
        field, smooth = (vector[: self.nodes].reshape(shape) for vector in (image, smoothed))
        self.problem.transform.filter(self.smoother, given, smooth)
        if self.unrestricted:
            np.multiply(self.diagonal - self.shift, smooth, out=field)
            field += given
        else:
            smooth *= self.mask
            self.problem.stiffness(smooth, field)
            field *= self.mask
            field += self.diagonal * smooth
        if self.bordered:
            smoothed[-1] = y[-1]
            image[:-1] += y[-1] * self.column
            image[-1] = self.row @ smoothed[:-1] + self.corner * y[-1]
        return image, smoothed


def newton(
    problem: GridProblem,
    u: Array,
    load: float,
    hold: Hold,
    contact: Mask | None = None,
    settings: Settings = Settings(),
    shift: float | None = None,
) -> Equilibrium:
    """Solve for an equilibrium from a trial state.

    Parameters
    ----------
    problem : GridProblem
    u, load : array, float
        Trial state.
    hold : Hold
    contact : array of bool, optional
        Trial contact; default: nodes where the trial state overlaps with the wall.
    settings : Settings
    shift : float, optional
        Constant of the preconditioner; default: from the size of the cell.

    Returns
    -------
    Equilibrium
        With ``converged`` False if the iteration failed, and the last state.
    """
    before = problem.counter.equilibrium
    shift = 0.8 / problem.lattice.edge if shift is None else shift
    if contact is None or not settings.wall:
        contact = (problem.heights + u <= 0.0) & settings.wall
    if hold.row is None:
        load = hold.value / hold.load_weight
    trial = _Trial.at(problem, np.where(contact, -problem.heights, u), load, contact)
    first = best = trial.residual
    steady, waited, step = False, 0, 0
    while True:
        held = hold.excess(trial.fields.u, trial.fields.load)
        done = trial.residual <= max(settings.tolerance, trial.rounding) and abs(held) <= hold.allowed
        failed = not math.isfinite(trial.residual) or trial.residual > settings.growth * max(best, 1e-3)
        if done or failed or step == settings.steps or waited > settings.patience:
            displacement = problem.displacement(trial.fields.u, trial.fields.load)
            pairs = problem.counter.equilibrium - before
            return Equilibrium(trial.fields, trial.contact, trial.residual, displacement, done, step, pairs, first)
        older = trial
        kept = older.contact & (older.fields.excess > 0.0)
        change, load_change = _newton_step(problem, older, kept, hold, held, steady, settings, shift)
        length = 1.0
        while True:
            trial = older.moved(problem, length * change, length * load_change, kept, settings.wall)
            # Where the law softens, nodes that leave the wall together can overshoot. The first step may well come from
            # an equilibrium that is not where it is to be held.
            if step == 0 or trial.residual <= max(1.2 * older.residual, settings.tolerance) or length <= SHORTEST:
                break
            length *= 0.5
        steady = length == 1.0 and bool((trial.contact == older.contact).all())
        step += 1
        problem.counter.newton += 1
        waited += 1
        if trial.residual <= 0.5 * best:
            best, waited = trial.residual, 0


@dataclass(frozen=True)
class _Trial:
    """A trial state, with its residual and what rounding leaves in that."""

    fields: Fields
    contact: Mask
    residual: float
    rounding: float

    @staticmethod
    def at(problem: GridProblem, u: Array, load: float, contact: Mask) -> _Trial:
        fields = problem.fields(u, load)
        excess = fields.excess
        violated = np.where(contact, np.minimum(excess, 0.0), excess)
        size = _rms(fields.elastic) or 1.0
        return _Trial(fields, contact, _rms(violated) / size, problem.rounding(u) / size)

    def moved(self, problem: GridProblem, change: Array, load_change: float, kept: Mask, wall: bool) -> _Trial:
        """The trial state after a step; what overlaps then joins the contact at once."""
        u = self.fields.u + change
        contact = kept | (problem.heights + u < 0.0) if wall else kept
        np.copyto(u, -problem.heights, where=contact)
        return _Trial.at(problem, u, self.fields.load + load_change, contact)


def _newton_step(
    problem: GridProblem,
    trial: _Trial,
    contact: Mask,
    hold: Hold,
    held: float,
    steady: bool,
    settings: Settings,
    shift: float,
) -> tuple[Array, float]:
    """Newton's step for a contact set: the changes of the field and of the load."""
    free = ~contact
    operator = Linearised(problem, trial.fields.stiffness, free, hold, shift)
    vector = (-trial.fields.excess * free).ravel()
    if operator.bordered:
        vector = np.append(vector, -operator.row_scale * held)
    restart = int(min(60, max(10, BASIS_BYTES / (2 * vector.nbytes))))
    forcing = _forcing(trial.residual, steady, settings)
    found = gmres(operator.product, vector, forcing, settings.inner, restart)
    change = found[: free.size].reshape(free.shape)
    return change, operator.column_scale * float(found[-1]) if operator.bordered else 0.0


def _forcing(residual: float, steady: bool, settings: Settings) -> float:
    """Inner tolerance: no tighter than a step can use while the contact set changes, nor than is asked for at last."""
    wanted = min(settings.forcing, 0.3 * math.sqrt(residual)) if steady else settings.forcing
    return min(max(wanted, 0.3 * settings.tolerance / max(residual, settings.tolerance)), settings.forcing)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))
