"""Equilibrium of a tip on a lattice: pressures, energies and the operators of the linearised problem.

Unknowns are u = w - d on the nodes (`lattice`) and the load F; the gap is g = z + u. In equilibrium

    p_c = K u + F/A - p_fr(g)  is 0 where g > 0, and ≥ 0 where g = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.contact.interactions import Interaction

from .clusters import Clusters, Influence
from .lattice import Lattice
from .transforms import Counter, Transform

__all__ = ["Fields", "GridProblem"]


class Fields(NamedTuple):
    """Everything at one trial state; arrays of the lattice's shape.

    Attributes
    ----------
    u, load
        The unknowns.
    elastic
        K u + F/A, the pressure that elasticity demands.
    gap
        z + u; infinite on the padding.
    energy, pressure, stiffness
        v, p_fr = -v' and v'' at the gap.
    """

    u: Array
    load: float
    elastic: Array
    gap: Array
    energy: Array
    pressure: Array
    stiffness: Array

    @property
    def excess(self) -> Array:
        """K u + F/A - p_fr: zero in equilibrium, the wall's pressure in contact."""
        return self.elastic - self.pressure


@dataclass
class GridProblem:
    """A tip and a law on a lattice, in reduced units (E = 1).

    Attributes
    ----------
    lattice : Lattice
    heights : array of the lattice's shape
        z ≥ 0; infinite where there is no tip.
    law : Interaction or None
    threads : int
    counter : Counter
    """

    lattice: Lattice
    heights: Array
    law: Interaction | None
    threads: int = 1
    counter: Counter = field(default_factory=Counter)
    _clusters: Clusters | None = field(default=None, init=False, repr=False)

    @cached_property
    def transform(self) -> Transform:
        """Plans for fields with the symmetry of the lattice."""
        return self.lattice.transform(self.counter, self.threads)

    @cached_property
    def symbol(self) -> Array:
        """K̂."""
        return self.lattice.symbol

    @cached_property
    def _stiffness_filter(self) -> Array:
        return self.symbol * self.transform.normalisation

    @cached_property
    def reach(self) -> float:
        """Gap beyond which the law's energy is below 1e-16 of its reference: there nothing needs to be evaluated."""
        return 0.0 if self.law is None else self.law.reach(1e-16)

    @cached_property
    def swapped(self) -> bool:
        """Whether the tip is the same with x and y exchanged."""
        same = self.lattice.edges[0] == self.lattice.edges[1] and self.shape[0] == self.shape[1]
        return same and bool(np.allclose(self.heights, self.heights.T, rtol=1e-12, atol=0.0))

    @cached_property
    def mirrored(self) -> bool:
        """Whether the whole of a tip is here that is its own mirror image."""
        inside = self.heights[self.lattice.cell]
        return not self.lattice.quarter and bool(np.allclose(inside, inside[::-1], rtol=1e-12, atol=0.0))

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of a field."""
        return self.lattice.shape

    def stiffness(self, u: Array) -> Array:
        """K u; one pair."""
        return self.transform.filter(self._stiffness_filter, u)

    def clusters(self, contact: Flags, stiffness: Array, zone: Flags, made: Flags) -> Clusters:
        """The linearised equations on clusters of nodes: those used last, where they serve.

        Parameters
        ----------
        contact, zone : array of bool
        stiffness : array
            v″, 0 in contact.
        made : array of bool
            The zone of those that are made where none serve.
        """
        if self._clusters is not None and self._clusters.serves(contact, zone):
            self._clusters.renew(contact, stiffness)
            return self._clusters
        influence = Influence(self.lattice) if self._clusters is None else self._clusters.influence
        self._clusters = Clusters(influence, contact, made, stiffness[made], 0.5 / self.lattice.spacing)
        return self._clusters

    @cached_property
    def _compliance_filter(self) -> Array:
        return self.transform.normalisation / self.lattice.held_symbol

    def displaced(self, pressure: Array) -> Array:
        """S p = u + d, the displacement by a pressure; one pair."""
        return self.transform.filter(self._compliance_filter, pressure)

    def rounding(self, u: Array) -> float:
        """What the rounding of u to double precision may leave in K u: far away it is more than the pressures."""
        return float(np.spacing(np.abs(u).max())) * self.lattice.stiffest

    def smoother(self, shift: float) -> Array:
        """The filter of (K + shift)⁻¹."""
        return self.transform.normalisation / (self.symbol + shift)

    def respond(self, gap: Array) -> tuple[Array, Array, Array]:
        """v, p_fr and v'' at gaps of any shape; zero where the gap is infinite."""
        zero = np.zeros_like(gap)
        if self.law is None:
            return zero, zero.copy(), zero.copy()
        near = gap < self.reach
        if near.all():
            response = self.law.evaluate(gap)
            return response.energy, response.pressure, response.stiffness
        energy, pressure, stiffness = zero, zero.copy(), zero.copy()
        response = self.law.evaluate(gap[near])
        energy[near], pressure[near], stiffness[near] = response.energy, response.pressure, response.stiffness
        return energy, pressure, stiffness

    def fields(self, u: Array, load: float, contact: Flags | None = None) -> Fields:
        """Evaluate everything at a trial state, with the law at the wall where it is in contact; one pair."""
        # K does not see the mean: without it rounding is that of the deformation, however far away the tip is.
        return self.evaluated(u, load, self.stiffness(u - u.mean()) + load / self.lattice.area, contact)

    def evaluated(self, u: Array, load: float, elastic: Array, contact: Flags | None) -> Fields:
        """Everything at a trial state whose pressure K u + F/A is known."""
        gap = self.heights + u
        if contact is not None:
            gap[contact] = 0.0
        return Fields(u, load, elastic, gap, *self.respond(gap))

    def displacement(self, u: Array, load: float) -> float:
        """Displacement of the far field, d = C F - mean(u)."""
        return self.lattice.compliance * load - float(u.mean())

    def total_energy(self, fields: Fields) -> float:
        """V_ela + V_fr; half the work of C is what the far field has in addition to the lattice."""
        elastic = 0.5 * np.vdot(fields.u, fields.elastic - fields.load / self.lattice.area)
        own = self.lattice.node_area * float(elastic + fields.energy.sum())
        return own + 0.5 * self.lattice.compliance * fields.load**2
