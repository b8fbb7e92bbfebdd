"""Damped dynamics of a tip on a lattice (GFMD) towards a stable equilibrium, to compare with.

Minimise an energy of u under inequalities. With the force f = -∂energy/∂u on what is free to move (0 elsewhere), a
momentum π and a mobility W (symmetric, positive on what is free to move, the inverse of the masses), motion is

    dπ/dt = f - (damping),      du/dt = W π.

A mobility that resembles the inverse of the energy's second variation makes all modes equally fast. On a lattice the
mean of u is driven by a constant force, or through a compliance: with F = (value + w mean(u))/c, as a displacement
or a spring has it, the mean mode gets the stiffness K̂(0) = w/(c A), and the load pressure that u demands is

    K u + F/A = K_c u + b,      b = value/(c A).

The masses are K̂ + m (mass weighting: all modes about equally fast), taken on the nodes that are free to move: with R
dropping what the wall holds, the mobility is W = R (K_c + m)⁻¹ R. So nodes at the wall have neither velocity nor
influence, and what is at rest is in equilibrium. Nodes that overlap are put on the wall and lose their momentum;
nodes that the wall would have to pull leave it.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from contbranch.errors import InputError
from contbranch.models.grid.newton import Equilibrium, Hold, rms
from contbranch.models.grid.problem import Fields, GridProblem

__all__ = ["DEFAULT", "Ending", "LatticeMotion", "Motion", "MotionSettings", "Place", "System", "equilibrium"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
P = TypeVar("P")


class Ending(enum.StrEnum):
    """Why the motion was ended."""

    CONVERGED = "the residual asked for was reached"
    STEPS = "the number of steps allowed was reached before the residual asked for"
    INTERRUPTED = "interrupted on request before the residual asked for was reached"
    ESCAPED = "no stable state is reached: the load pulls the surfaces apart, and nothing further out can hold them"
    UNSTABLE = "the state reached is unstable, and the motion comes back to it whenever it is pushed"
    DIVERGED = "the force is not finite"


@dataclass(frozen=True)
class MotionSettings:
    """When to end, and how long the steps are.

    Attributes
    ----------
    tolerance : float
        Residual to reach, as the problem defines it.
    steps : int
        Steps at most.
    safety : float
        Time step relative to that of marginal stability.
    """

    tolerance: float = 1e-8
    steps: int = 2000
    safety: float = 0.8


DEFAULT = MotionSettings()


class System(Protocol[P]):
    """A problem as dynamics see it; P is one with everything known there."""

    @property
    def stiffest(self) -> float:
        """Estimate of the largest eigenvalue of W · (second variation); should it be too low, steps are corrected."""
        ...

    def force(self, place: P) -> Array:
        """f, zero where nothing can move."""
        ...

    def residual(self, place: P) -> float:
        """The measure of convergence."""
        ...

    def confine(self, place: P, momentum: Array) -> Array:
        """The momentum without the part of what cannot move."""
        ...

    def mobility(self, place: P, momentum: Array) -> Array:
        """W π."""
        ...

    def move(self, place: P, momentum: Array | None, velocity: Array, time: float) -> P:
        """The place reached, made admissible; ``velocity`` is W π, unless no momentum is given."""
        ...

    def change(self, before: P, after: P) -> Array:
        """The change of u from one place to another: not that of the velocity where it had to be made admissible."""
        ...

    def slowing(self, place: P, change: Array) -> float:
        """By what factor, at most 1, a change of u must be shortened lest the interactions change altogether."""
        ...

    def ending(self, place: P, velocity: Array) -> Ending | None:
        """A reason of the problem's own to end."""
        ...


class Relaxed(NamedTuple, Generic[P]):
    """Where the motion ended, after how many steps, and why."""

    place: P
    steps: int
    ending: Ending


def curvature(before: Array, after: Array, change: Array, momentum: Array, velocity: Array, time: float) -> float:
    """Rayleigh's quotient v·Hv / v·π along the last step, from the forces before and after it; a squared frequency.

    What is held at either end is left out, and so is what the velocity would have done but for inequalities: then it is
    an underestimate.
    """
    kinetic = float(np.vdot(momentum, velocity))
    if kinetic <= 0.0:
        return 0.0
    moved = (before != 0.0) & (after != 0.0)
    return float(np.vdot(change, (before - after) * moved)) / (time * time * kinetic)


class Motion(Generic[P]):
    """Green's-function molecular dynamics: damped motion of modes whose masses are weighted with their stiffness.

    Damped leapfrog, with the damping of the slowest mode that still moves, critical for it:

        (1 + γτ/2) π' = (1 - γτ/2) π + τ f,      u' = u + τ W π',      γ = 2ω,   ω² = v·Hv / v·π,

    H the second variation, Hv from the change of the force in the last step. Momentum that works against the force is
    dropped.

    References: Campañá & Müser, Phys. Rev. B 74, 075420 (2006) (dynamics of the modes); Underwood, in Computational
    Methods for Transient Analysis (1983), 245 (damping from Rayleigh's quotient); O'Donoghue & Candès, Found. Comput.
    Math. 15, 715 (2015) (restarts).

    The motion begins at rest; steps are at the limit of stability, which is corrected as stiffer modes show up.
    """

    def __init__(self, system: System[P], place: P, settings: MotionSettings = DEFAULT) -> None:
        self.system, self.place, self.settings = system, place, settings
        self.force = system.force(place)
        self.momentum = self.change = np.zeros_like(self.force)
        self.steep, self.stiffest = 0.0, system.stiffest
        self.time = self.longest

    @property
    def longest(self) -> float:
        """The longest time step."""
        return 2.0 * self.settings.safety / math.sqrt(self.stiffest)

    def steer(self, against: bool) -> None:
        """Change the momentum before a step; whether the last one worked against the force."""
        damping = min(math.sqrt(max(self.steep, 0.0)) * self.time, 1.0)
        kept = 0.0 if against else 1.0 - damping
        self.momentum = (kept * self.momentum + self.time * self.force) / (1.0 + damping)

    def ended(self, step: int, velocity: Array) -> Ending | None:
        """Whether the motion ends here, and why."""
        residual = self.system.residual(self.place)
        if not math.isfinite(residual):
            return Ending.DIVERGED
        if residual <= self.settings.tolerance:
            return Ending.CONVERGED
        return self.system.ending(self.place, velocity) or (Ending.STEPS if step == self.settings.steps else None)

    def run(self) -> Relaxed[P]:
        """Relax until the residual asked for is reached."""
        system, velocity = self.system, self.change
        step = 0
        while (ending := self.ended(step, velocity)) is None:
            self.momentum = system.confine(self.place, self.momentum)
            self.steer(bool(np.vdot(self.force, self.change) < 0.0))
            velocity = system.mobility(self.place, self.momentum)
            slowing = system.slowing(self.place, self.time * velocity)
            self.momentum, velocity = slowing * self.momentum, slowing * velocity
            before, start = self.force, self.place
            self.place = system.move(start, self.momentum, velocity, self.time)
            self.force, self.change = system.force(self.place), system.change(start, self.place)
            self.steep = curvature(before, self.force, self.change, self.momentum, velocity, self.time)
            self.stiffest = max(self.stiffest, self.steep)
            self.time = min(self.time, self.longest)
            step += 1
        return Relaxed(self.place, step, ending)


# Steps after which K u, kept up to date without transforms, is computed anew.
_RENEW = 50


class Place(NamedTuple):
    """A trial state: fields, the nodes that the wall holds, the force, the residual, and the age of K u."""

    fields: Fields
    held: Mask
    force: Array
    residual: float
    age: int


@dataclass
class LatticeMotion:
    """A problem on a lattice with what is held, as dynamics see it (`System`).

    Attributes
    ----------
    problem : GridProblem
    hold : Hold
        Load, displacement or spring.
    until : callable, optional
        Interrupt the motion where this is true.
    stride : float
        Largest change of a gap in one step, relative to the interaction's range plus the gap.

    Raises
    ------
    InputError
        If what is held is no load, displacement or spring.
    """

    problem: GridProblem
    hold: Hold
    until: Callable[[Place], bool] | None = None
    stride: float = 0.1

    def __post_init__(self) -> None:
        row = self.hold.row
        if isinstance(row, np.ndarray) or self.hold.load_weight <= 0.0 or (row is not None and row > 0.0):
            raise InputError("hold: dynamics need a load, a displacement or a spring; make it with hold_control")

    @cached_property
    def base(self) -> float:
        """b."""
        return self.hold.value / (self.hold.load_weight * self.problem.lattice.area)

    @cached_property
    def mean_stiffness(self) -> float:
        """K̂(0)."""
        row = 0.0 if self.hold.row is None else float(self.hold.row)
        return -row * self.problem.lattice.size / (self.hold.load_weight * self.problem.lattice.area)

    @cached_property
    def mass(self) -> float:
        """m: between the softest mode of the cell, 2/L, and the stiffest interaction, which takes the fewest steps."""
        softest = 2.0 / self.problem.lattice.edges[0]
        return max(softest, math.sqrt(softest * stiffest_interaction(self.problem)))

    @cached_property
    def mean_mass(self) -> float:
        """Mass of the mean mode: as stiff as the far field is, at least."""
        return max(self.mean_stiffness, 1.0 / (self.problem.lattice.compliance * self.problem.lattice.area))

    @cached_property
    def _mobility(self) -> Array:
        inverse = self.problem.smoother(self.mass)
        inverse[0, 0] = self.problem.transform.normalisation / self.mean_mass
        return inverse

    @cached_property
    def stiffest(self) -> float:
        """Estimate of the largest eigenvalue of W (K_c + v'')."""
        return max(1.0, stiffest_interaction(self.problem) / self.mass)

    def place(self, u: Array) -> Place:
        """Everything at a trial field, moved out of the wall; one pair."""
        u = np.maximum(u, -self.problem.heights)
        return self._place(u, self.problem.stiffness(u) + self.load(u) / self.problem.lattice.area, 0)

    def load(self, u: Array) -> float:
        """F."""
        return (self.hold.value - self.hold.product(u)) / self.hold.load_weight

    def _place(self, u: Array, elastic: Array, age: int) -> Place:
        gap = self.problem.heights + u
        fields = Fields(u, self.load(u), elastic, gap, *self.problem.respond(gap))
        excess = fields.excess
        held = (gap <= 0.0) & (excess > 0.0)
        force = np.where(held, 0.0, -excess)
        residual = rms(force) / (rms(elastic) or 1.0)
        return Place(fields, held, force, residual, age)

    def force(self, place: Place) -> Array:
        """p_fr - K u - F/A, 0 where the wall holds."""
        return place.force

    def residual(self, place: Place) -> float:
        """Root mean square of the force relative to that of the pressure, as `Equilibrium.residual`."""
        return place.residual

    def confine(self, place: Place, momentum: Array) -> Array:
        """The momentum of the nodes that the wall does not hold."""
        return np.where(place.held, 0.0, momentum)

    def mobility(self, place: Place, momentum: Array) -> Array:
        """R (K_c + m)⁻¹ R π; one pair."""
        velocity = self.problem.transform.filter(self._mobility, momentum)
        velocity[place.held] = 0.0
        return velocity

    def move(self, place: Place, momentum: Array | None, velocity: Array, time: float) -> Place:
        """Follow the velocity; one pair if the wall is met or has been recently, otherwise none."""
        u = place.fields.u + time * velocity
        overlap = self.problem.heights + u < 0.0
        if momentum is None or overlap.any() or place.held.any() or place.age >= _RENEW:
            return self.place(u)
        # K_c W π = π - m W π, but for the mean mode
        mean = (self.mean_stiffness - self.mean_mass + self.mass) * velocity.mean()
        change = momentum - self.mass * velocity + mean
        return self._place(u, place.fields.elastic + time * change, place.age + 1)

    def change(self, before: Place, after: Place) -> Array:
        """The change of u."""
        return after.fields.u - before.fields.u

    def extent(self, place: Place, change: Array) -> float:
        """Largest change of a gap, relative to the interaction's range plus the gap."""
        return np.max(np.abs(change) / (_length(self.problem) + place.fields.gap))

    def slowing(self, place: Place, change: Array) -> float:
        """Keep to the stride: the first steps, if long, may leap into another state than the one that is near."""
        largest = self.extent(place, change)
        return 1.0 if largest <= self.stride else self.stride / largest

    def variation(self, place: Place, velocity: Array) -> Array:
        """R (K_c + v'') v, the second variation of the energy along a velocity; one pair."""
        change = self.problem.stiffness(velocity)
        change += place.fields.stiffness * velocity + self.mean_stiffness * velocity.mean()
        change[place.held] = 0.0
        return change

    def energy(self, place: Place) -> float:
        """The energy that the motion minimises, less a constant: elastic, interaction, and work of what is held."""
        f = place.fields
        total = float(0.5 * np.vdot(f.u, f.elastic + self.base) + f.energy.sum())
        return self.problem.lattice.node_area * total

    def ending(self, place: Place, velocity: Array) -> Ending | None:
        """Interrupted on request, or pulled apart by a load that nothing further out can balance."""
        if self.until is not None and self.until(place):
            return Ending.INTERRUPTED
        load = place.fields.load
        if self.mean_stiffness > 0.0 or load > 0.0 or place.held.any() or velocity.mean() <= 0.0:
            return None
        gaps, pull, softening = self._outwards
        at = np.clip(np.searchsorted(gaps, place.fields.gap) - 1, 0, None)
        # Nothing snaps in on the way, as no elastic mode is as soft as the interaction
        rigid = softening[at].max() < 1.0 / self.problem.lattice.edges[0]
        strongest = self.problem.lattice.node_area * pull[at].sum()
        return Ending.ESCAPED if rigid and strongest <= -0.9 * load else None

    @cached_property
    def _outwards(self) -> tuple[Array, Array, Array]:
        """Gaps, and the largest attraction and the largest -v'' at these or larger ones."""
        gaps = _length(self.problem) * np.concatenate([[0.0], np.geomspace(1e-3, 1e6, 3000), [np.inf]])
        _, pressure, stiffness = self.problem.respond(gaps)
        pull, softening = (
            np.maximum.accumulate(np.maximum(-values, 0.0)[::-1])[::-1] for values in (pressure, stiffness)
        )
        return gaps, pull, softening


def stiffest_interaction(problem: GridProblem) -> float:
    """Largest v'' at any gap, 0 at least."""
    gaps = np.concatenate([[0.0], _length(problem) * np.geomspace(1e-2, 1e3, 1000)])
    return max(0.0, float(problem.respond(gaps)[2].max()))


def _length(problem: GridProblem) -> float:
    """Shortest length on which the interaction changes; the cell's edge without one."""
    if problem.law is None:
        return problem.lattice.edges[0]
    return min(min(term.range for term in problem.law.terms), 0.25 * problem.law.wave)


def equilibrium(motion: LatticeMotion, place: Place, steps: int, pairs: int, ending: Ending) -> Equilibrium:
    """The outcome of a motion as that of a solver."""
    fields = place.fields
    displacement = motion.problem.displacement(fields.u, fields.load)
    converged = ending is Ending.CONVERGED
    reason = "" if converged else ending.value
    return Equilibrium(fields, place.held, place.residual, displacement, converged, steps, pairs, reason)
