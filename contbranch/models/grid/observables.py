"""What is read off an equilibrium on a lattice: gap at the apex, displacement of the far field, profiles and fields.

Values between the nodes are those of the trigonometric interpolant of u, which is a smooth periodic function where the
tip's heights are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contbranch.results.profile import CellFields, Profile

from .arrays import Array
from .lattice import Lattice
from .newton import Equilibrium
from .problem import GridProblem

__all__ = [
    "CellFields",
    "CentralGap",
    "FarField",
    "cell_fields",
    "central_gap",
    "far_field",
    "image_curvature",
    "interpolate",
    "mean_gap",
    "profile",
    "smallest_gap",
    "weights",
]


# Σ 1/R³ over the square lattice without its origin, 4 ζ(3/2) β(3/2) (Lorenz-Hardy); by the parity of the coordinates it
# is 2√2 - 1 times that about the middle of the cells, and 4 - √2 times about the middle of their edges.
_CUBES = 9.033621683100950
_AT_CORNER, _AT_EDGE = (2.0 * math.sqrt(2.0) - 1.0) * _CUBES, (4.0 - math.sqrt(2.0)) * _CUBES
# The combination of the displacements at corner and edge that takes the point force of every image away, and (30).
_CORNER, _EDGE = 3.0 + 2.0 * math.sqrt(2.0), -2.0 - 2.0 * math.sqrt(2.0)
_CORNER_ROUNDED, _EDGE_ROUNDED = 6.0, -5.0
# What a curvature of the images' field changes at fixed load: d(FQ)/dF = 8/3 Q for a contact without interaction.
_GROWTH = 8.0 / 3.0
# What higher orders add: relative to the mean of r²/L², measured for contacts without interaction.
_LEADING, _HIGHER = 1.1, 5.0
# Sixth-order interpolation of an even function in the middle between nodes.
_MIDPOINT = np.array([150.0, -25.0, 3.0]) / 128.0


@dataclass(frozen=True)
class CentralGap:
    """Gap at the tip's apex and the error estimate of its interpolation between the nodes."""

    value: float
    error: float


@dataclass(frozen=True)
class FarField:
    """Displacement of the far field of a single contact, three ways, with what the finite cell leaves in each.

    Attributes
    ----------
    displacement, error : float
        From the mean of u and the finite-size shift, d = C F - mean(u). In free space the cell leaves no error.
    from_points, from_points_error : float or None
        d = (3+2√2) u_X - (2+2√2) u_M with the paper's displacement u = -(w - d) at the cell's corner X and the middle M
        of its edge: (30) in the form that is exact for a point force. None in free space.
    rounded, rounded_error : float or None
        (30) as printed, 6 u_X - 5 u_M.
    """

    displacement: float
    error: float
    from_points: float | None = None
    from_points_error: float | None = None
    rounded: float | None = None
    rounded_error: float | None = None


def interpolate(lattice: Lattice, values: Array, x: float, y: float) -> float:
    """The trigonometric interpolant of a field (even, on a quarter) at a point, coordinates from the middle."""
    return float(weights(lattice, x) @ values @ weights(lattice, y))


def central_gap(problem: GridProblem, equilibrium: Equilibrium, apex_height: float = 0.0) -> CentralGap:
    """Gap at the middle of the cell: 0 in contact.

    Parameters
    ----------
    problem : GridProblem
    equilibrium : Equilibrium
    apex_height : float
        Height of the tip there.
    """
    half = problem.lattice.grid // 2
    around = slice(0, 1) if problem.lattice.quarter else slice(half - 1, half + 1)
    if equilibrium.contact[around, around].all():
        return CentralGap(0.0, 0.0)
    u = equilibrium.u
    gap = apex_height + interpolate(problem.lattice, u, 0.0, 0.0)
    nearest = u[:3, :3] if problem.lattice.quarter else _folded(u[half - 3 : half + 3, half - 3 : half + 3])
    # An interpolant of an order that any smooth profile deserves; the trigonometric one is better.
    error = abs(apex_height + float(_MIDPOINT @ nearest @ _MIDPOINT) - gap)
    return CentralGap(max(gap, 0.0), error)


def smallest_gap(equilibrium: Equilibrium) -> float:
    """Smallest gap of all nodes: for tips without a single apex."""
    return max(float(equilibrium.fields.gap.min()), 0.0)


def mean_gap(problem: GridProblem, equilibrium: Equilibrium) -> float:
    """Mean gap over the nodes of the cell where there is a tip."""
    gap = equilibrium.fields.gap
    return float(gap[np.isfinite(gap)].mean())


def far_field(problem: GridProblem, equilibrium: Equilibrium) -> FarField:
    """Displacement of the far field in three ways.

    Over the contact, the images of a pressure with F and Q = ∫ p r² d²r in a cell of edge L add

        (-3.9003 F/L + 9.0336 (F r² + Q)/(4 L³))/(πE)

    to the displacement: the first term is the finite-size shift. The second acts as a change of the tip's height and
    lowers V - F d by 9.0336 F Q/(4π E L³), hence raises d by the derivative of that by F; what is not known of it is
    taken from the contact without interaction, with ∫ |p| r² for Q. At the points X and M the spread of the pressure
    adds Q/(4π E L³) times the sums of 1/R³ about them.
    """
    lattice = problem.lattice
    d = equilibrium.displacement
    if lattice.kind == "free":
        return FarField(d, 0.0)
    square = lattice.axis**2
    pressure = np.abs(equilibrium.fields.elastic)
    moment = lattice.node_area * float(square @ pressure.sum(axis=1) + pressure.sum(axis=0) @ square)
    unit = moment / (4.0 * math.pi * lattice.edge**3)
    total = lattice.node_area * float(pressure.sum())
    unit *= _LEADING + _HIGHER * moment / (total * lattice.edge**2) if total > 0.0 else _LEADING
    error = _GROWTH * _CUBES * unit
    half = 0.5 * lattice.edge
    corner = -interpolate(lattice, equilibrium.u, half, half)
    edge = -0.5 * (interpolate(lattice, equilibrium.u, half, 0.0) + interpolate(lattice, equilibrium.u, 0.0, half))
    points_error = error + abs(_CORNER * _AT_CORNER + _EDGE * _AT_EDGE) * unit
    from_points = _CORNER * corner + _EDGE * edge
    rounded = _CORNER_ROUNDED * corner + _EDGE_ROUNDED * edge
    # The point forces that the rounded factors leave.
    rounding = abs((_CORNER_ROUNDED - _CORNER) * (corner - edge))
    return FarField(d, error, from_points, points_error, rounded, points_error + rounding)


def image_curvature(problem: GridProblem, equilibrium: Equilibrium) -> float:
    """How much the images in a periodic cell add to the curvature of a tip, κ of r²/2 → (1 + κ) r²/2, to leading order.

    κ = 9.0336 F/(2π E L³) (see `far_field`): without interaction the contact radius is smaller by κ/3 than that of a
    single contact at the same load, 0.125 % at a = L/8. Zero in free space.
    """
    lattice = problem.lattice
    return _CUBES * equilibrium.load / (2.0 * math.pi * lattice.edge**3) if lattice.kind == "periodic" else 0.0


def cell_fields(problem: GridProblem, equilibrium: Equilibrium) -> CellFields:
    """Unfold gap and pressures on the nodes of the whole cell."""
    lattice = problem.lattice
    n = lattice.grid
    axis = lattice.whole().axis[:n]
    return CellFields(axis, axis.copy(), *(lattice.unfold(field)[:n, :n] for field in _observed(equilibrium)))


def profile(problem: GridProblem, equilibrium: Equilibrium, points: int = 2000) -> Profile:
    """Gap and pressures as functions of the distance from the middle of the cell, up to its edge.

    Nodes at equal distance are averaged, and where there are more than `points` distances, those within bins of equal
    width: for an axisymmetric tip, what the anisotropy of lattice and cell leaves is averaged out. For other tips these
    are means over circles; use `cell_fields` for the fields themselves.
    """
    lattice = problem.lattice
    inside = lattice.inside
    axis = lattice.axis[:inside]
    radius = np.hypot(axis[:, None], axis[None, :])
    kept = radius <= 0.5 * lattice.edge
    r = radius[kept]
    # Squared distances are integers in units of half the spacing squared.
    keys = np.rint((2.0 * r / lattice.spacing) ** 2).astype(np.int64)
    numbers = np.unique(keys, return_inverse=True)[1].ravel()
    if numbers.max() + 1 > points:
        bins = np.minimum((r / (0.5 * lattice.edge) * points).astype(np.int64), points - 1)
        numbers = np.unique(bins, return_inverse=True)[1].ravel()
    counts = np.bincount(numbers)

    def averaged(values: Array) -> Array:
        return np.asarray(np.bincount(numbers, weights=values) / counts)

    gap, pressure, wall = (averaged(field[:inside, :inside][kept]) for field in _observed(equilibrium))
    return Profile(r=averaged(r), gap=gap, pressure=pressure, wall_pressure=wall)


def _observed(equilibrium: Equilibrium) -> tuple[Array, Array, Array]:
    """Gap, total pressure and wall pressure on the nodes."""
    fields = equilibrium.fields
    wall = np.where(equilibrium.contact, np.maximum(fields.excess, 0.0), 0.0)
    return np.maximum(fields.gap, 0.0), fields.pressure + wall, wall


def weights(lattice: Lattice, x: float | Array) -> Array:
    """Weights of the nodes of one side in the trigonometric interpolant at x, or at every x of a column."""
    if not lattice.quarter:
        return _dirichlet(x - lattice.axis, lattice.size, lattice.spacing)
    nodes = 2 * lattice.size
    return _dirichlet(x - lattice.axis, nodes, lattice.spacing) + _dirichlet(x + lattice.axis, nodes, lattice.spacing)


def _dirichlet(x: Array, nodes: int, spacing: float) -> Array:
    """The periodic interpolant, of an even number of nodes, of 1 at x = 0 and 0 at the other nodes."""
    half = np.pi * x / (nodes * spacing)
    tangent = np.tan(half)
    at_node = np.abs(np.sin(half)) < 1e-14
    return np.where(at_node, 1.0, np.sin(nodes * half) / (nodes * np.where(at_node, 1.0, tangent)))


def _folded(values: Array) -> Array:
    """Means of a field on 6 × 6 nodes over both mirror images, from the middle outwards, (3, 3)."""
    rows = 0.5 * (values[2::-1] + values[3:])
    return np.asarray(0.5 * (rows[:, 2::-1] + rows[:, 3:]))
