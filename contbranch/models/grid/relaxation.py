"""Damped dynamics of a tip on a lattice towards a stable equilibrium; they never end in an unstable one.

The mean of u is driven by a constant force, or through a compliance: with F = (value + w mean(u))/c, as a displacement
or a spring has it, the mean mode gets the stiffness K̂(0) = w/(c A), and the load pressure that u demands is

    K u + F/A = K_c u + b,      b = value/(c A).

The masses are K̂ + m (mass weighting: all modes about equally fast), taken on the nodes that are free to move: with R
dropping what the wall holds, the mobility is W = R (K_c + m)⁻¹ R. So nodes at the wall have neither velocity nor
influence, and what is at rest is in equilibrium. Nodes that overlap are put on the wall and lose their momentum;
nodes that the wall would have to pull leave it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contbranch.errors import InputError
from contbranch.models.grid.solvers.motion import Ending

from .arrays import Array, Mask
from .newton import Equilibrium, Hold
from .problem import Fields, GridProblem

__all__ = ["LatticeMotion", "Place", "equilibrium", "stiffest_interaction"]

# Steps after which K u, kept up to date without transforms, is computed anew.
_RENEW = 50


# Change of gaps, relative to the interaction's range plus the gap, up to which two states are near each other.
_CLOSE = 0.1


class Place(NamedTuple):
    """A trial state: fields, the nodes that the wall holds, the force, the residual, and the age of K u."""

    fields: Fields
    held: Mask
    force: Array
    residual: float
    age: int


@dataclass
class LatticeMotion:
    """A problem on a lattice with what is held, as dynamics see it (`contbranch.models.grid.solvers.motion.System`).

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
        return -row * self.problem.lattice.size**2 / (self.hold.load_weight * self.problem.lattice.area)

    @cached_property
    def mass(self) -> float:
        """m: between the softest mode of the cell, 2/L, and the stiffest interaction, which takes the fewest steps."""
        softest = 2.0 / self.problem.lattice.edge
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
        residual = _rms(force) / (_rms(elastic) or 1.0)
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

    def leads_to(self, place: Place, u: Array) -> bool:
        """Whether a state is near, and the energy falls on the straight line to it as it does towards a minimum.

        Near means that gaps change by less than the interaction notices. The slope of the energy must be that of a
        parabola at three points, but for a third: forces (less the wall's) work along the change, half as much on half
        the way, and no more at its end. One pair.
        """
        change = u - place.fields.u
        if self.extent(place, change) > _CLOSE:
            return False
        start = float(np.vdot(place.force, change))
        if not np.any(change):
            return True
        middle = self.place(place.fields.u + 0.5 * change)
        half = float(np.vdot(np.where(place.held, 0.0, middle.force), change))
        return start > 0.0 and abs(half / start - 0.5) < 0.3

    def push(self, place: Place, seed: int) -> Array:
        """A small change of u at random, at most a tenth of the interaction's range; one pair."""
        noise = self.confine(place, np.random.default_rng(seed).standard_normal(self.problem.shape))
        change = self.mobility(place, noise)
        return np.asarray(0.1 * _length(self.problem) / float(np.abs(change).max()) * change)

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
        rigid = softening[at].max() < 1.0 / self.problem.lattice.edge
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
        return problem.lattice.edge
    return min(min(term.range for term in problem.law.terms), 0.25 * problem.law.wave)


def equilibrium(motion: LatticeMotion, place: Place, steps: int, pairs: int, ending: Ending) -> Equilibrium:
    """The outcome of a motion as that of a solver."""
    fields = place.fields
    displacement = motion.problem.displacement(fields.u, fields.load)
    converged = ending is Ending.CONVERGED
    reason = "" if converged else ending.value
    return Equilibrium(fields, place.held, place.residual, displacement, converged, steps, pairs, reason)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))
