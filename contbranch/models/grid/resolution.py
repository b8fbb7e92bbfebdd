"""Whether a lattice can represent a contact: checked before anything is solved, and once a state is known.

- The law must not be stiffer than elasticity is on the scale of a few nodes, or a node at the rim snaps in by itself:
  the lattice's curve grows folds of its own (lattice trapping), and contact radii depend on the path. A wave over eight
  nodes has the stiffness E q/2 with q = 2π/(8 Δ), a quarter of the stiffest one along an axis: this must exceed the
  largest -v''.
- The cell must hold what interacts: at its border the law must have decayed.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.height_map import HeightMap
from contbranch.contact.interactions import Interaction
from contbranch.errors import InputError, number_of, warned
from contbranch.grid_size import LEAST_GRID

from .lattice import Lattice
from .newton import Equilibrium
from .problem import GridProblem
from .setup import Setup

__all__ = [
    "HOPELESS",
    "GridWarning",
    "Resolution",
    "border_energy",
    "edge_force",
    "map_message",
    "needed_grid",
    "refuse_too_large",
    "tail_energy",
    "tail_force",
    "warn",
]

# Nodes in the shortest wave that must be stiffer than the law.
WAVE = 8.0
# Where the law is stiffer than the lattice by this factor, averages mean nothing, nor does what another lattice says.
HOPELESS = 3.5
# Fields of the size of the lattice that a trace holds at a time, about.
FIELDS = 40
# What the law may still have at the border of the cell, as a part of its reference work.
DECAYED = 1e-3
# Where more of it is left, what is outside of the cell is no small correction: by how much it changes loads is unknown.
LOUD = 0.1
# Heights that change by this factor more across the edge of the cell than elsewhere belong to no periodic map.
STEP = 4.0
# Nodes of a height map that a message names.
MOST_NAMED = 5


class GridWarning(UserWarning):
    """A lattice is too coarse or a cell too small for the digits that are given; the message names the remedy."""


@dataclass(frozen=True)
class Resolution:
    """The law's stiffness against the lattice's.

    Attributes
    ----------
    law, lattice : float
        Largest -v'' of the law, and E q/2 of the wave over eight nodes.
    grid : int
        Nodes a side with which the two are equal in this cell.
    memory : float
        What these take, bytes.
    """

    law: float
    lattice: float
    grid: int
    memory: float = 0.0

    @property
    def ratio(self) -> float:
        """Above 1 folds can be the lattice's own."""
        return self.law / self.lattice

    @property
    def message(self) -> str:
        """A sentence, empty if the lattice is fine enough."""
        if self.ratio <= 1.0:
            return ""
        return (
            f"The grid is too coarse for the interaction: its stiffness |v''| = {self.law:.3g} exceeds "
            f"{self.lattice:.3g} of a wave over {WAVE:.0f} nodes, and folds may be the lattice's own; {self.remedy}."
        )

    @property
    def remedy(self) -> str:
        """What to change, if the lattice is too coarse."""
        if self.memory <= memory_here():
            return f"use a grid of at least {self.grid}"
        return (
            f"a grid of {self.grid} would take {self.memory / 2**30:.3g} GiB: use a smaller cell, or an interaction of "
            "longer range or less work of adhesion"
        )

    def fails(self, state: Equilibrium) -> bool:
        """Whether the law is far stiffer than the lattice at the gaps of a state, next to the contact above all."""
        softening = np.where(state.contact, 0.0, -state.fields.stiffness).max()
        return bool(max(softening, self.law * state.contact.any()) > HOPELESS * self.lattice)

    @staticmethod
    def of(setup: Setup) -> Resolution:
        """Compare the law with the lattice."""
        stiffness = math.pi / (WAVE * setup.lattice.spacing)
        grid = needed_grid(setup.lattice.spacing * setup.grid, setup.law)
        memory = memory_of(setup) * (grid / setup.grid) ** (1 if setup.lattice.line else 2)
        return Resolution(concavity(setup.law), stiffness, grid, memory)


def map_message(setup: Setup) -> str:
    """Sentences if a height map has spikes, or a periodic cell repeats it with a step; empty otherwise."""
    tip = setup.contact.tip
    if not isinstance(tip, HeightMap):
        return ""
    said, spikes = "", tip.spikes
    if spikes:
        named = [f"[{i}, {j}]" for i, j in spikes[:MOST_NAMED]] + ["…"] * (len(spikes) > MOST_NAMED)
        said = (
            f"The height map has {number_of(len(spikes), 'spike', 'spikes')} towards the wall, at {', '.join(named)}, "
            "like dust or outliers, which touch first; if they are none of the surface, set them to NaN and give "
            "fill=True. "
        )
    if setup.lattice.kind != "periodic" or tip.edge_step < STEP:
        return said.rstrip()
    remedy = "subtract its tilt with detrend='plane'" if tip.tilted else "use model='free', or a map that is periodic"
    return said + (
        f"The height map is not periodic: across the edges of the cell its heights change {tip.edge_step:.3g} times as "
        f"much as between other neighbouring nodes, and the cell repeats it with that step; {remedy}."
    )


def memory_of(setup: Setup) -> float:
    """Bytes that a trace on a lattice takes, about."""
    return 8.0 * FIELDS * setup.lattice.size


def memory_here() -> float:
    """Bytes of this machine's memory; infinite where that is not known."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def refuse_too_large(setup: Setup) -> None:
    """Refuse a lattice that is larger than the memory.

    Raises
    ------
    InputError
        With the memory that it would take, and what fits.
    """
    wanted, here = memory_of(setup), memory_here()
    if wanted > here:
        fits = 2 * int(0.5 * setup.grid * math.sqrt(here / wanted))
        raise InputError(
            f"grid: {setup.grid}; it would take {wanted / 2**30:.3g} GiB of memory, and this machine has "
            f"{here / 2**30:.3g} GiB: use at most {fits}, or a smaller cell with the same distance of nodes"
        )


def concavity(law: Interaction | None) -> float:
    """The largest -v'' of a law at gaps from zero on."""
    if law is None:
        return 0.0
    gaps = np.concatenate([np.linspace(0.0, 10.0, 2001), np.geomspace(10.0, 1e3, 200)])
    ranges = [term.range for term in law.terms]
    sampled = [law.evaluate(gaps * length).stiffness for length in ranges]
    return max(0.0, *(float(-np.nanmin(np.where(np.isfinite(values), values, 0.0))) for values in sampled))


def needed_grid(edge: float, law: Interaction | None) -> int:
    """The smallest fast grid in a cell of an edge that is fine enough for a law."""
    return _fast_above(WAVE * edge * concavity(law) / math.pi)


def _fast_above(nodes: float) -> int:
    """The smallest multiple of 4 without prime factors above 7 that is no less; half its nodes make a coarser grid."""
    least = max(LEAST_GRID, math.ceil(nodes))
    powers = [[prime**k for k in range(1 + int(math.log(least, prime)))] for prime in (3, 5, 7)]
    return min(odd << max(2, ((least - 1) // odd).bit_length()) for odd in map(math.prod, itertools.product(*powers)))


def smallest_on_border(lattice: Lattice, values: Array) -> float:
    """The smallest value on the border of the cell."""
    own = values[lattice.cell]
    sides = -1 if lattice.quarter else [0, -1]
    return float(min(own[sides].min(), own[:, sides].min()))


def border_energy(problem: GridProblem, gap: Array) -> float:
    """|v| at the border of the cell, relative to the law's reference work."""
    law = problem.law
    if law is None:
        return 0.0
    nearest = max(smallest_on_border(problem.lattice, gap), 0.0)
    return float(abs(law.evaluate(np.array([nearest])).energy[0])) / law.reference_work


def tail_force(setup: Setup, state: Equilibrium) -> float:
    """Force of the interaction outside a free cell, which it leaves out: ∫ p_fr d²r = 2π (r |v| + ∫ |v| dr)/g′."""
    return _outside(setup, state, lambda gaps, energies, radii: radii[0] * energies[0] + _trapezoid(energies, radii))


def tail_energy(setup: Setup, state: Equilibrium) -> float:
    """Energy of the interaction outside a free cell, which it leaves out: ∫ v d²r = 2π ∫ |v| r dg/g′.

    By as much V changes at fixed displacement, and V − F d at fixed load, since they are stationary.
    """
    return _outside(setup, state, lambda gaps, energies, radii: _trapezoid(energies * radii, gaps))


def _trapezoid(values: Array, places: Array) -> float:
    return float((values[1:] + values[:-1]) @ np.diff(places)) / 2.0


def _outside(setup: Setup, state: Equilibrium, integral: Callable[[Array, Array, Array], float]) -> float:
    """2π/g′ times an integral over gaps, |v| and radii outside a free cell.

    The gap beyond the border is continued with its slope g′ there, as for a tip that steepens; an estimate from above.
    Infinite where the interaction has hardly decayed there: it would deform what is inside.
    """
    lattice, law = setup.lattice, setup.law
    if law is None or setup.crowded or lattice.kind == "periodic":
        return 0.0
    if border_energy(setup.problem, state.fields.gap) > LOUD:
        return math.inf
    last, middle = lattice.inside[0] - 1, 0 if lattice.quarter else lattice.nodes[0] // 2
    gap = state.fields.gap
    outer, inner = (min(float(gap[k, middle]), float(gap[middle, k])) for k in (last, last - 1))
    if not (math.isfinite(outer) and outer > inner):
        return 0.0
    slope, nearest = (outer - inner) / lattice.spacing, max(outer, 0.0)
    beyond = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 60) * (nearest + law.range)])
    gaps, radii = nearest + beyond, 0.5 * setup.edge + beyond / slope
    return 2.0 * math.pi / slope * float(integral(gaps, np.abs(law.evaluate(gaps).energy), radii))


def edge_force(setup: Setup, state: Equilibrium) -> float:
    """Force at the edge of a tip that ends within the cell, where its nodes cover more than its area or less: p |ΔA|.

    The edge is a step of the pressure, which halved lattices, whose nodes cover other areas, may miss alike.
    """
    tip, law = setup.contact.tip.axisymmetric, setup.law
    if law is None or tip is None or not tip.extent < setup.edge / 2:
        return 0.0
    under = np.isfinite(setup.problem.heights)
    off = abs(float(under.sum()) * setup.lattice.node_area - math.pi * tip.extent**2)
    ring = under & (setup.lattice.distance > tip.extent - setup.lattice.spacing)
    pressure = np.abs(law.evaluate(np.maximum(state.fields.gap[ring], 0.0)).pressure)
    return off * float(pressure.max(initial=0.0))


def fills(setup: Setup, state: Equilibrium) -> bool:
    """Whether a contact that should end within the cell has reached its border."""
    lattice = setup.lattice
    if setup.crowded:
        return False
    inner = state.contact[lattice.cell]
    return bool(inner[-1, :].any() or inner[:, -1].any())


def rounded_up(value: float) -> str:
    """Return a positive number rounded up to two digits."""
    digits = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / digits) * digits:.6g}"


def warn(message: str) -> None:
    """Issue a warning about a grid, if there is anything to say."""
    if message:
        warned(message, GridWarning)
