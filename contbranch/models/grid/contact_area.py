"""Area, perimeter and radius of the contact on a lattice, with sub-grid resolution and error estimates.

Near a rim without singular pressure, at distance s from it on either side,

    p_c = κ s^(1/2)      inside,          g = (4κ/3E) s^(3/2)      outside,

to leading order. So a node in contact and a free one beside it place the rim between them: with y = κ^(-2/3) the two
distances p_c² y³ and (3g/4)^(2/3) y sum up to the distance of the nodes along the normal. Each such pair moves the
border of the square of the node in contact. That works for contacts of a few nodes and for any number of patches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import correlate1d

from contbranch.arrays import Array

from .newton import Equilibrium
from .problem import GridProblem

__all__ = ["FEW", "ContactArea", "contact_area", "rim_noise"]

# Smoothing of the contact's indicator whose gradient is the normal of the rim: binomial, of a width of two nodes.
SMOOTHING = np.array([1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0]) / 64.0
# Least cosine between normal and line of a pair that is believed: for distances, and for lengths of the rim.
STEEP, STEEPER = 0.2, 0.3
# Change of y, relative, after which Newton's method has converged, and its steps at most.
CLOSE, STEPS = 1e-6, 12
# Nodes of a contact from which on, and to which beyond, its rim is divided between the lines of both directions by the
# angle at which it crosses them, not in halves.
HALVES, ANGLES = 12.0, 60.0
# Error of the place of the rim in spacings: of a contact with a radius of so many of them, falling with its root; where
# the law is as stiff as a wave over eight nodes in addition (measured with all laws in contacts of 4 to 33 spacings,
# against Hertz and the axisymmetric model); and of a contact of one spacing, with the power with which it falls: few
# nodes carry their load on a disc that the lattice chooses.
NOISE, RADIUS, STIFF, FEW, FEW_POWER = 0.022, 32.0, 0.1, 0.5, 1.8


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


def contact_area(problem: GridProblem, equilibrium: Equilibrium) -> ContactArea:
    """Measure the contact of an equilibrium; without a node in contact all is zero."""
    contact, lattice = equilibrium.contact, problem.lattice
    count = int(np.count_nonzero(contact))
    if not count:
        return ContactArea()
    nodes, square = count * lattice.multiplicity, count * lattice.node_area
    distances, cosines, fractions = _pairs(problem, equilibrium)
    if not cosines.size:  # the whole cell
        return ContactArea(math.sqrt(square / math.pi), 0.0, square, 0.0, nodes)
    weights = np.ones(cosines.size) if lattice.line else _weights(cosines, nodes)
    area = square + lattice.node_area * float(weights @ (fractions - 0.5))
    area = area if area > 0.0 else square
    rim = lattice.node_area * float(np.sum(weights / (distances * np.maximum(cosines, STEEPER))))
    spacing, stiffness = lattice.spacing, np.abs(np.where(contact, 0.0, equilibrium.fields.stiffness)).max()
    few = FEW * (0.5 * rim * spacing / area) ** FEW_POWER
    # A circle has eight pairs for every spacing of its radius.
    noise = rim_noise(cosines.size * lattice.multiplicity / 8.0)
    error = rim * spacing * (noise + STIFF * stiffness * 8.0 * spacing / math.pi + few)
    radius = math.sqrt(area / math.pi)
    # Lines along x and y count a piece of the squares' rim |cos| and |sin| times; it is shrunk to the area.
    length = lattice.node_area * float(np.sum(cosines / distances)) * math.sqrt(area / square)
    return ContactArea(radius, error / (2.0 * math.pi * radius), area, error, nodes, length)


def rim_noise(radius: float) -> float:
    """Error of the place of the rim of a contact with a radius, all in spacings, that is the lattice's alone."""
    return NOISE * math.sqrt(RADIUS / max(radius, 1.0))


def _pairs(problem: GridProblem, equilibrium: Equilibrium) -> tuple[Array, Array, Array]:
    """Of the pairs of neighbours at the rim the distance, the cosine between their line and the rim's normal, and where
    the rim lies between the node in contact, 0, and the free one, 1."""
    lattice, contact, gap = problem.lattice, equilibrium.contact, equilibrium.fields.gap
    beyond: Literal["reflect", "wrap"] = "reflect" if lattice.quarter else "wrap"
    smooth = contact.astype(np.float64)
    for axis in (0, 1):
        smooth = correlate1d(smooth, SMOOTHING, axis, mode=beyond)
    slopes = [correlate1d(smooth, [-1.0, 0.0, 1.0], axis, mode=beyond) / lattice.spacings[axis] for axis in (0, 1)]
    wall = np.maximum(equilibrium.fields.excess, 0.0)
    found = []
    for axis, (size, spacing) in enumerate(zip(lattice.shape, lattice.spacings, strict=True)):
        for step in (1, -1):
            beside = np.arange(size) + step
            beside = beside.clip(0, size - 1) if lattice.quarter else beside % size
            inner = np.nonzero(contact & ~contact.take(beside, axis))
            outer = tuple(beside[k] if side == axis else k for side, k in enumerate(inner))
            normal = [slope[inner] + slope[outer] for slope in slopes]
            cosine = np.abs(normal[axis]) / (np.hypot(*normal) + 1e-300)
            fraction = _fractions(wall[inner], gap[outer], spacing * np.maximum(cosine, STEEP))
            found.append([np.full(cosine.size, spacing), cosine, fraction])
    distances, cosines, fractions = np.concatenate(found, axis=1)
    return distances, cosines, fractions


def _weights(cosine: Array, nodes: int) -> Array:
    """Partition of the rim between the lines of both directions, by the angle; in halves for a few nodes."""
    x = np.clip(2.0 * cosine**2 - 0.5, 0.0, 1.0)
    by_angle = x * x * (3.0 - 2.0 * x)
    share = np.clip((nodes - HALVES) / (ANGLES - HALVES), 0.0, 1.0)
    return np.asarray(share * by_angle + 0.5 * (1.0 - share))


def _fractions(pressure: Array, gap: Array, distance: Array) -> Array:
    """Solve p² y³ + (3g/4)^(2/3) y = distance, monotonic and convex in y = κ^(-2/3), by Newton from above."""
    first, second = pressure**2, (0.75 * np.maximum(gap, 0.0)) ** (2.0 / 3.0)
    known = (first + second > 0.0) & np.isfinite(second)
    a, b, d = np.where(known, first, 1.0), np.where(known, second, 1.0), distance
    y = np.minimum(np.cbrt(d / np.maximum(a, 1e-300)), d / np.maximum(b, 1e-300))
    for _ in range(STEPS):
        square, before = a * y * y, y
        y = (2.0 * square * y + d) / (3.0 * square + b)
        if (np.abs(y - before) <= CLOSE * y).all():
            break
    return np.where(known, np.clip(a * y**3 / d, 0.0, 1.0), 0.5)
