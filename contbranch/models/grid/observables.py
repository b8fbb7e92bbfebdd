"""What is read off an equilibrium on a lattice: gap at the apex, displacement of the far field, profiles and fields.

Values between the nodes are those of the trigonometric interpolant of u, which is a smooth periodic function where the
tip's heights are not.
"""

from __future__ import annotations

import math

import numpy as np

from contbranch.arrays import Array
from contbranch.results.profile import CellFields, Profile

from .lattice import Lattice
from .newton import Equilibrium
from .problem import GridProblem

__all__ = [
    "CUBES",
    "CellFields",
    "cell_fields",
    "central_gap",
    "far_field_error",
    "images",
    "interpolate",
    "mean_gap",
    "profile",
    "smallest_gap",
    "weights",
]


# Σ 1/R³ over the square lattice without its origin, 4 ζ(3/2) β(3/2) (Lorenz-Hardy).
CUBES = 9.033621683100950
# What a curvature of the images' field changes at fixed load: d(FQ)/dF = 8/3 Q for a contact without interaction.
_GROWTH = 8.0 / 3.0
# What higher orders add: relative to the mean of r²/L², measured for contacts without interaction.
_LEADING, _HIGHER = 1.1, 5.0
# Sixth-order interpolation of an even function in the middle between nodes.
_MIDPOINT = np.array([150.0, -25.0, 3.0]) / 128.0


def interpolate(lattice: Lattice, values: Array, x: float, y: float) -> float:
    """The trigonometric interpolant of a field (even, on a quarter) at a point, coordinates from the middle."""
    return float(weights(lattice, 0, x) @ values @ weights(lattice, 1, y))


def central_gap(problem: GridProblem, equilibrium: Equilibrium) -> tuple[float, float]:
    """Gap at the middle of the cell, where the tip has its apex: 0 in contact; the error of its interpolation there."""
    half = problem.lattice.nodes[0] // 2
    around = slice(0, 1) if problem.lattice.quarter else slice(half - 1, half + 1)
    if equilibrium.contact[around, around].all():
        return 0.0, 0.0
    u = equilibrium.u
    gap = interpolate(problem.lattice, u, 0.0, 0.0)
    nearest = u[:3, :3] if problem.lattice.quarter else _folded(u[half - 3 : half + 3, half - 3 : half + 3])
    # An interpolant of an order that any smooth profile deserves; the trigonometric one is better.
    error = abs(float(_MIDPOINT @ nearest @ _MIDPOINT) - gap)
    return max(gap, 0.0), error


def smallest_gap(equilibrium: Equilibrium) -> float:
    """Smallest gap of all nodes: for tips without a single apex."""
    return max(float(equilibrium.fields.gap.min()), 0.0)


def mean_gap(problem: GridProblem, equilibrium: Equilibrium) -> float:
    """Mean gap over the nodes of the cell where there is a tip."""
    gap = equilibrium.fields.gap
    return float(gap[np.isfinite(gap)].mean())


def images(problem: GridProblem, equilibrium: Equilibrium) -> float:
    """Q/(4π E L³) with what higher orders add: the unit of what a periodic cell's images leave open; 0 in free space.

    Over the contact, the images of a pressure with F and Q = ∫ p r² d²r in a cell of edge L add

        (-3.9003 F/L + 9.0336 (F r² + Q)/(4 L³))/(πE)

    to the displacement: the first term is the finite-size shift. The second acts as a change of the tip's height.
    """
    lattice = problem.lattice
    if lattice.kind == "free":
        return 0.0
    edge, pressure = lattice.edges[0], np.abs(equilibrium.fields.elastic)
    moment = lattice.node_area * float(np.vdot(lattice.distance**2, pressure))
    total = lattice.node_area * pressure.sum()
    higher = _HIGHER * moment / (total * edge**2) if total > 0.0 else 0.0
    return float(moment / (4.0 * math.pi * edge**3) * (_LEADING + higher))


def far_field_error(problem: GridProblem, equilibrium: Equilibrium) -> float:
    """What the images leave in the displacement of the far field of a single contact, d = C F - mean(u).

    The change of the tip's height lowers V - F d by 9.0336 F Q/(4π E L³), hence raises d by the derivative of that by
    F; what is not known of it is taken from the contact without interaction, with ∫ |p| r² for Q.
    """
    return _GROWTH * CUBES * images(problem, equilibrium)


def cell_fields(problem: GridProblem, equilibrium: Equilibrium, centred: bool = True) -> CellFields:
    """Unfold gap and pressures on the nodes of the whole cell.

    Coordinates count from its middle, or, of a height map, whose nodes are not `centred`, from node [0, 0].
    """
    lattice, whole = problem.lattice, problem.lattice.whole()
    if centred:
        x, y = (axis[part] for axis, part in zip(whole.axes, whole.cell, strict=True))
    else:
        x, y = (step * np.arange(float(count)) for step, count in zip(whole.spacings, whole.nodes, strict=True))
    return CellFields(x, y, *(lattice.unfold(field)[whole.cell] for field in _observed(equilibrium)))


def profile(problem: GridProblem, equilibrium: Equilibrium, points: int = 2000) -> Profile:
    """Gap and pressures as functions of the distance from the middle of the cell, up to its edge.

    Nodes at equal distance are averaged, and where there are more than `points` distances, those within bins of equal
    width: for an axisymmetric tip, what the anisotropy of lattice and cell leaves is averaged out. For other tips these
    are means over circles; use `cell_fields` for the fields themselves.
    """
    lattice = problem.lattice
    radius = lattice.distance[lattice.cell]
    edge = min(edge for edge, nodes in zip(lattice.edges, lattice.nodes, strict=True) if nodes > 1)
    kept = radius <= 0.5 * edge
    r = radius[kept]
    # Squared distances are integers in units of half the spacing squared, where spacings are equal.
    keys = np.rint((2.0 * r / lattice.spacing) ** 2).astype(np.int64)
    numbers = np.unique(keys, return_inverse=True)[1].ravel()
    if numbers.max() + 1 > points:
        bins = np.minimum((r / (0.5 * edge) * points).astype(np.int64), points - 1)
        numbers = np.unique(bins, return_inverse=True)[1].ravel()
    counts = np.bincount(numbers)

    def averaged(values: Array) -> Array:
        return np.bincount(numbers, weights=values) / counts

    gap, pressure, wall = (averaged(field[lattice.cell][kept]) for field in _observed(equilibrium))
    return Profile(r=averaged(r), gap=gap, pressure=pressure, wall_pressure=wall)


def _observed(equilibrium: Equilibrium) -> tuple[Array, Array, Array]:
    """Gap, total pressure and wall pressure on the nodes."""
    fields = equilibrium.fields
    wall = np.where(equilibrium.contact, np.maximum(fields.excess, 0.0), 0.0)
    return np.maximum(fields.gap, 0.0), fields.pressure + wall, wall


def weights(lattice: Lattice, side: int, x: float | Array) -> Array:
    """Weights of the rows (side 0) or columns (1) in the trigonometric interpolant at x, or at every x of a column."""
    axis, nodes, spacing = lattice.axes[side], lattice.shape[side], lattice.spacings[side]
    if not lattice.quarter:
        return _dirichlet(x - axis, nodes, spacing)
    return _dirichlet(x - axis, 2 * nodes, spacing) + _dirichlet(x + axis, 2 * nodes, spacing)


def _dirichlet(x: Array, nodes: int, spacing: float) -> Array:
    """The periodic interpolant of 1 at x = 0 and 0 at the other nodes."""
    half = np.pi * x / (nodes * spacing)
    divisor = np.sin(half) if nodes % 2 else np.tan(half)
    at_node = np.abs(np.sin(half)) < 1e-14
    return np.where(at_node, 1.0, np.sin(nodes * half) / (nodes * np.where(at_node, 1.0, divisor)))


def _folded(values: Array) -> Array:
    """Means of a field on 6 × 6 nodes over both mirror images, from the middle outwards, (3, 3)."""
    rows = 0.5 * (values[2::-1] + values[3:])
    return 0.5 * (rows[:, 2::-1] + rows[:, 3:])
