"""Lengths and directions on the curve of a lattice.

Arclength is measured in displacements where the surfaces interact, and in the load:

    ds² = Σ W du² / ℓ² + (dF/F*)²,     W ∝ (1 + (g/2ℓ)²)⁻², Σ W = 1,

so that it does not depend on the lattice, and a change of the film's shape at nearly constant load and displacement
counts as much as one of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array

from .newton import Equilibrium, Hold, Settings

__all__ = ["Direction", "Measure", "following", "quietly"]


def quietly() -> np.errstate:
    """Numbers that overflow in a trial state are answered by shorter steps."""
    return np.errstate(over="ignore", invalid="ignore", divide="ignore")


def following(tolerance: float, crowded: bool) -> Settings:
    """Tolerances for corrections from a good prediction: one that does not converge soon is better given up.

    What a step brings is mostly another contact, which a loose solution finds as well; where there are many of them, it
    may find that of another piece of the curve.
    """
    loosest = 0.005 if crowded else 0.1
    return Settings(tolerance=tolerance, steps=15, inner=80, growth=30.0, patience=4, forcing=loosest)


@dataclass(frozen=True)
class Measure:
    """The inner product of steps at one state: weights of the field and of the load."""

    weights: Array
    load_weight: float

    @staticmethod
    def of(gap: Array, load: float, length: float) -> Measure:
        """The measure at a gap and load for a law of a range."""
        weights = 1.0 / np.square(1.0 + np.square(np.minimum(gap / (2.0 * length), 1e6)))
        scale = length + 0.5 * max(gap.min(), 0.0)
        return Measure(weights / (weights.sum() * scale**2), 1.0 / (3.0 + 0.3 * abs(load)) ** 2)

    @staticmethod
    def at(state: Equilibrium, length: float) -> Measure:
        """The measure at a state."""
        return Measure.of(state.fields.gap, state.load, length)

    def apart(self, one: Equilibrium, other: Equilibrium) -> float:
        """The distance of two states."""
        return self.norm(*one.beyond(other))

    def product(self, u: Array, load: float, v: Array, other: float) -> float:
        """Inner product of two steps."""
        return float(np.einsum("ij,ij,ij->", self.weights, u, v)) + self.load_weight * load * other

    def norm(self, u: Array, load: float) -> float:
        """Length of a step."""
        return math.sqrt(self.product(u, load, u, load))


@dataclass(frozen=True)
class Direction:
    """A covector (row, load weight) that measures progress along a piece of the curve."""

    row: Array
    load_weight: float

    @staticmethod
    def along(measure: Measure, u: Array, load: float) -> Direction:
        """The covector of a step."""
        return Direction(measure.weights * u, measure.load_weight * load)

    @staticmethod
    def between(begin: Equilibrium, end: Equilibrium, length: float) -> Direction:
        """The covector of the step from one state to another."""
        return Direction.along(Measure.at(begin, length), *end.beyond(begin))

    def value(self, u: Array, load: float) -> float:
        """Progress at a field and load."""
        return float(np.vdot(self.row, u)) + self.load_weight * load

    def of(self, state: Equilibrium) -> float:
        """Progress at a state."""
        return self.value(state.u, state.load)

    def hold(self, value: float, slack: float) -> Hold:
        """What Newton's method keeps for a given progress."""
        return Hold(value, self.load_weight, self.row, slack)
