"""What damped dynamics need to know of a problem, and what they answer: shared by `gfmd` and `fire`.

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
from numpy.typing import NDArray

__all__ = ["DEFAULT", "Ending", "MotionSettings", "Relaxed", "System", "curvature", "ending_of"]

Array = NDArray[np.float64]
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


def ending_of(system: System[Place], place: Place, velocity: Array, tolerance: float) -> Ending | None:
    """Whether the motion ends here, and why."""
    residual = system.residual(place)
    if not math.isfinite(residual):
        return Ending.DIVERGED
    return Ending.CONVERGED if residual <= tolerance else system.ending(place, velocity)


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
