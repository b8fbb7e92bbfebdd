"""Damped dynamics: what they need to know of a problem, and what they answer.

Minimise an energy of u under inequalities. With the force f = -∂energy/∂u on what is free to move (0 elsewhere), a
momentum π and a mobility W (symmetric, positive on what is free to move, the inverse of the masses), motion is

    dπ/dt = f - (damping),      du/dt = W π.

A mobility that resembles the inverse of the energy's second variation makes all modes equally fast.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from contbranch.models.grid.arrays import Array

__all__ = ["DEFAULT", "Ending", "Motion", "MotionSettings", "Relaxed", "System", "curvature"]

Place = TypeVar("Place")


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


class System(Protocol[Place]):
    """A problem as dynamics see it; a Place is one with everything known there."""

    @property
    def stiffest(self) -> float:
        """Estimate of the largest eigenvalue of W · (second variation); should it be too low, steps are corrected."""
        ...

    def force(self, place: Place) -> Array:
        """f, zero where nothing can move."""
        ...

    def residual(self, place: Place) -> float:
        """The measure of convergence."""
        ...

    def confine(self, place: Place, momentum: Array) -> Array:
        """The momentum without the part of what cannot move."""
        ...

    def mobility(self, place: Place, momentum: Array) -> Array:
        """W π."""
        ...

    def move(self, place: Place, momentum: Array | None, velocity: Array, time: float) -> Place:
        """The place reached, made admissible; ``velocity`` is W π, unless no momentum is given."""
        ...

    def change(self, before: Place, after: Place) -> Array:
        """The change of u from one place to another: not that of the velocity where it had to be made admissible."""
        ...

    def slowing(self, place: Place, change: Array) -> float:
        """By what factor, at most 1, a change of u must be shortened lest the interactions change altogether."""
        ...

    def ending(self, place: Place, velocity: Array) -> Ending | None:
        """A reason of the problem's own to end."""
        ...


class Relaxed(NamedTuple, Generic[Place]):
    """Where the motion ended, after how many steps, and why."""

    place: Place
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


class Motion(Generic[Place]):
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

    def __init__(self, system: System[Place], place: Place, settings: MotionSettings = DEFAULT) -> None:
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

    def run(self) -> Relaxed[Place]:
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
