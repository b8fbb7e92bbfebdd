"""Area and radius of the contact on a lattice, below the spacing, with error estimates.

Near a rim without singular pressure, at distance s from it on either side,

    p_c = κ s^(1/2)      inside,          g = (4κ/3E) s^(3/2)      outside,

to leading order. So the last node in contact and the first free one beside it place the rim between them: with
y = κ^(-2/3) the two distances p_c² y³ and (3g/4)^(2/3) y sum up to the distance of the nodes along the normal. This
uses nothing but the two nodes, hence it does not feel how the law bends both profiles further away, and works for
contacts of a few nodes and for any number of patches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Mask
from .lattice import Lattice
from .newton import Equilibrium
from .problem import GridProblem

__all__ = ["ContactArea", "Rim", "contact_area", "rim_of"]

# Smoothings of the contact's indicator whose gradient is the normal of the rim: a width of about two nodes.
_SMOOTHINGS = 3
# Noise of the rim's place (in spacings, at a radius of so many spacings) and its growth for smaller ones; what the
# law's stiffness times the spacing adds; and the place of a contact of few nodes, which carries its load on a disc that
# the lattice chooses: at a radius of one spacing, and the power with which it falls.
_NOISE, _RADIUS_OF_NOISE, _GROWTH = 0.022, 32.0, 0.5
_BENT = 0.15
_FEW, _FEW_POWER = 0.5, 1.8
# Such that the true error, of contacts of all laws at random, is below the estimate in 95 % of the cases.
_SAFETY = 1.5


@dataclass(frozen=True)
class ContactArea:
    """Contact area and radius, in reduced units.

    Attributes
    ----------
    radius, radius_error : float
        √(A/π), for a contact of any shape, and its error estimate.
    area, area_error : float
        A and its error estimate.
    nodes : int
        Nodes of the whole lattice in contact.
    perimeter : float
        Length of the rim.
    """

    radius: float = 0.0
    radius_error: float = 0.0
    area: float = 0.0
    area_error: float = 0.0
    nodes: int = 0
    perimeter: float = 0.0


@dataclass(frozen=True)
class Rim:
    """Pairs of neighbouring nodes, one in contact and one free.

    Attributes
    ----------
    lattice : Lattice
    nodes : int
        Nodes of the array in contact.
    cosine : array (M,)
        |cos| of the angle between line and normal.
    fraction : array (M,)
        Where the rim lies between the two nodes, 0 (contact) to 1.
    """

    lattice: Lattice
    nodes: int
    cosine: Array
    fraction: Array

    @property
    def shares(self) -> Array:
        """Of the rim between the lines of both directions, by the angle; in halves for a few nodes."""
        x = np.clip(2.0 * self.cosine**2 - 0.5, 0.0, 1.0)
        share = np.clip((self.nodes * self.lattice.multiplicity - 12.0) / 48.0, 0.0, 1.0)
        return np.asarray(share * x * x * (3.0 - 2.0 * x) + 0.5 * (1.0 - share))

    @property
    def area(self) -> float:
        """Area within the rim: each pair moves the border of the last node's square."""
        return self.lattice.node_area * (self.nodes + float(self.shares @ (self.fraction - 0.5)))

    @property
    def length(self) -> float:
        """Length of a rim halfway between the pairs: lines along x and y count a piece of it |cos| and |sin| times."""
        return self.lattice.node_area / self.lattice.spacing * float(self.cosine.sum())


def contact_area(problem: GridProblem, equilibrium: Equilibrium) -> ContactArea:
    """Measure the contact of an equilibrium.

    Without a node in contact all is zero, with an error of what may lie between the nodes at the smallest gap.
    """
    contact, fields, lattice = equilibrium.contact, equilibrium.fields, problem.lattice
    if not contact.any():
        radius = _hidden(problem, fields.gap)
        return ContactArea(radius_error=radius, area_error=math.pi * radius**2)
    wall = np.where(contact, np.maximum(fields.excess, 0.0), 0.0)
    rim, h = rim_of(lattice, contact, wall, fields.gap), lattice.spacing
    nodes, counted = rim.nodes * lattice.multiplicity, lattice.node_area * rim.nodes
    if rim.cosine.size == 0:  # the whole cell
        return ContactArea(math.sqrt(counted / math.pi), 0.0, counted, 0.0, nodes)
    area = rim.area if rim.area > 0.0 else counted
    radius = math.sqrt(area / math.pi)
    # the rim of the nodes' squares, shrunk to the area
    perimeter = rim.length * math.sqrt(area / counted)
    noise = _NOISE * (_RADIUS_OF_NOISE * 2.0 * math.pi * h / perimeter) ** _GROWTH
    bent = _BENT * h * float(np.abs(np.where(contact, 0.0, fields.stiffness)).max())
    few = _FEW * (0.5 * perimeter * h / area) ** _FEW_POWER
    error = _SAFETY * perimeter * h * math.hypot(noise, bent, few)
    return ContactArea(radius, error / (2.0 * math.pi * radius), area, error, nodes, perimeter)


def _hidden(problem: GridProblem, gap: Array) -> float:
    """Radius of the contact that may lie between the node with the smallest gap and its neighbours."""
    last = len(gap) - 1
    i, j = divmod(int(np.argmin(gap)), last + 1)
    neighbours = [gap[min(i + 1, last), j], gap[max(i - 1, 0), j], gap[i, min(j + 1, last)], gap[i, max(j - 1, 0)]]
    # With the apex in the middle of four nodes of a paraboloid, their gap is a quarter of the rise to the next.
    rise = max(float(value) for value in neighbours) - float(gap[i, j])
    return math.sqrt(0.5) * problem.lattice.spacing if gap[i, j] < 0.3 * rise else 0.0


def rim_of(lattice: Lattice, contact: Mask, wall_pressure: Array, gap: Array) -> Rim:
    """Collect the pairs of nodes at the rim of a contact.

    Parameters
    ----------
    lattice : Lattice
    contact : array of bool
    wall_pressure, gap : array
        Of the lattice's shape; the gap is infinite on the padding.
    """
    margin, n, axes = _SMOOTHINGS + 1, lattice.size, []
    for axis in (1, 0):
        found = np.flatnonzero(contact.any(axis=axis))
        axes.append(np.arange(found[0] - margin, found[-1] + margin + 1) if found.size else np.arange(1))
    # By mirror symmetry or periodicity
    folds = [numbers % (2 * n if lattice.quarter else n) for numbers in axes]
    window = np.ix_(*(np.minimum(numbers, 2 * n - 1 - numbers) for numbers in folds))
    touching, pressure, opening = contact[window], wall_pressure[window], gap[window]
    owned = [(numbers >= 0) & (numbers < n) for numbers in axes]
    for one in owned:
        one[:margin] = one[-margin:] = False
    smooth = touching.astype(np.float64)
    for _ in range(_SMOOTHINGS):
        smooth = np.pad(smooth, 1, mode="edge")
        smooth = 0.25 * (smooth[:-2] + 2.0 * smooth[1:-1] + smooth[2:])
        smooth = 0.25 * (smooth[:, :-2] + 2.0 * smooth[:, 1:-1] + smooth[:, 2:])
    normal = np.gradient(smooth)
    parts = []
    for axis, step in ((0, (1, 0)), (0, (-1, 0)), (1, (0, 1)), (1, (0, -1))):
        beyond = np.roll(touching, (-step[0], -step[1]), (0, 1))
        i, j = near = np.nonzero(touching & np.logical_and.outer(*owned) & ~beyond)
        far = i + step[0], j + step[1]
        along = [0.5 * (one[near] + one[far]) for one in normal]
        parts.append((np.abs(along[axis]) / (np.hypot(*along) + 1e-300), pressure[near], opening[far]))
    cosine, inner, outer = (np.concatenate(part) for part in zip(*parts, strict=True))
    fraction = _fractions(inner, outer, lattice.spacing * np.maximum(cosine, 0.2))
    return Rim(lattice, int(contact.sum()), cosine, fraction)


def _fractions(pressure: Array, gap: Array, distance: Array) -> Array:
    """Solve p² y³ + (3g/4)^(2/3) y = distance, monotonic and convex in y = κ^(-2/3), by Newton from above."""
    first, second = pressure**2, (0.75 * np.maximum(gap, 0.0)) ** (2.0 / 3.0)
    known = (first + second > 0.0) & np.isfinite(second)
    a, b, d = np.where(known, first, 1.0), np.where(known, second, 1.0), distance
    y = np.minimum(np.cbrt(d / np.maximum(a, 1e-300)), d / np.maximum(b, 1e-300))
    for _ in range(12):
        y = y - (a * y**3 + b * y - d) / (3.0 * a * y * y + b)
    return np.where(known, np.clip(a * y**3 / d, 0.0, 1.0), 0.5)
