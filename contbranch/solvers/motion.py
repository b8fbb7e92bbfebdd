"""What damped dynamics need to know of a problem, and what they answer: shared by `gfmd` and `fire`.

Minimise an energy of u under inequalities. With the force f = -∂energy/∂u on what is free to move (0 elsewhere), a
momentum π and a mobility W (symmetric, positive on what is free to move, the inverse of the masses), motion is

    dπ/dt = f - (damping),      du/dt = W π.

A mobility that resembles the inverse of the energy's second variation makes all modes equally fast.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Ending", "MotionSettings", "Relaxed", "System"]

Array = NDArray[np.float64]
Place = TypeVar("Place")


class Ending(enum.StrEnum):
    """Why the motion was ended."""

    CONVERGED = "the residual asked for was reached"
    STEPS = "the number of steps allowed was reached before the residual asked for"
    INTERRUPTED = "interrupted on request before the residual asked for was reached"
    ESCAPED = "no stable state: the surfaces are pulled apart beyond the interaction's reach"
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


class System(Protocol[Place]):
    """A problem as dynamics see it; a Place is one with everything known there.

    Attributes
    ----------
    stiffest : float
        Estimate of the largest eigenvalue of W · (second variation): steps are corrected should it be too low.
    """

    @property
    def stiffest(self) -> float: ...

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

    def move(self, place: Place, momentum: Array, velocity: Array, time: float) -> Place:
        """The place reached, made admissible; ``velocity`` is W π."""
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
