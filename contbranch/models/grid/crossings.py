"""Where the rim of a contact crosses the lines of a lattice, and the area that this encloses.

Near a rim without singular pressure, at distance s from it on either side,

    p_c = κ s^(1/2)      inside,          g = (4κ/3E) s^(3/2)      outside,

to leading order. So the last node in contact and the first free one beside it place the rim between them: with
y = κ^(-2/3) the two distances p_c² y³ and (3g/4)^(2/3) y sum up to the distance of the nodes along the normal. This
uses nothing but the two nodes, hence it is the least sensitive to how the law bends both profiles further away, and
works for contacts of a few nodes and for any number of patches.

Along each line of the lattice that crosses the rim, p_c² or g^(2/3) is also fitted by a polynomial in the distance,
over the nodes nearest to the rim: its zero is where the profile of the wall pressure, or that of the gap, ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array, Flags, Integers

from .lattice import Lattice

__all__ = ["REACH", "Crossings", "find_crossings"]

REACH = 12
"""Nodes kept on either side of the rim."""

# Noise of p_c² and of g^(2/3), by the distance from the rim.
_FROM, _FALL, _NOISE, _FLOOR = np.array([(0.5, 0.3), (-1.3, -1.6), (0.05, 0.03), (0.0, 1e-3)])[..., None, None]
# Smoothings of the contact's indicator whose gradient is the normal of the rim: a width of about two nodes.
_SMOOTHINGS = 3
# Change of a zero, in nodes, after which the next one of Newton's method is rounding.
CLOSE = 1e-6


@dataclass(frozen=True)
class Crossings:
    """Pairs of neighbouring nodes, one in contact and one free.

    Attributes
    ----------
    spacing : float
        Distance of neighbouring nodes.
    node_area : float
        Area for which one node of the array stands.
    nodes : int
        Nodes of the array in contact.
    weight : array (M,)
        Share of the rim for which a crossing stands: lines that meet it steeply are preferred.
    cosine : array (M,)
        |cos| of the angle between line and normal.
    fraction : array (M,)
        Where the rim lies between the two nodes by their own values, 0 (contact) to 1.
    wall_pressure, gap : array (M, REACH)
        Along the line, from the rim inwards and outwards.
    inside, outside : array of bool (M, REACH)
        Whether these nodes are in contact, or free and near a tip.
    """

    spacing: float
    node_area: float
    nodes: int
    weight: Array
    cosine: Array
    fraction: Array
    wall_pressure: Array
    gap: Array
    inside: Flags
    outside: Flags

    @property
    def area(self) -> float:
        """Area within the rim placed by the pairs of nodes: each moves the border of the last node's square."""
        return self.node_area * (self.nodes + float(self.weight @ (self.fraction - 0.5)))

    @property
    def perimeter(self) -> float:
        """Length of the rim."""
        steepness = np.maximum(self.cosine, 0.3)
        return self.node_area / self.spacing * np.sum(self.weight / steepness)

    @property
    def length(self) -> float:
        """Length of a rim halfway between the pairs: lines along x and y count a piece of it |cos| and |sin| times."""
        return self.node_area / self.spacing * float(self.cosine.sum())

    def shifts(self, fits: Integers) -> tuple[Array, Array]:
        """How much fits of the profiles enlarge the area against `area`, and for which share of the rim they exist.

        Parameters
        ----------
        fits : array of int (2, F, 2)
            Nodes along each line and degree of the polynomial in the distance, 3 at most: of p_c² in contact, and of
            g^(2/3) outside.

        Returns
        -------
        enlarged, share : array (2, F)
        """
        steps, (count, degree) = np.arange(REACH), np.moveaxis(fits, -1, 0)
        own = np.stack([self.inside, self.outside]).swapaxes(1, 2)
        gap = np.cbrt(np.where(self.outside, self.gap, 0.0) ** 2)
        y = np.stack([self.wall_pressure**2, gap]).swapaxes(1, 2)
        x = steps[:, None] + np.stack([self.fraction, 1.0 - self.fraction])[:, None, :]
        from_rim = _FROM + np.maximum(x * self.cosine, 0.3)
        terms = x ** np.arange(5.0)[:, None, None, None]
        terms[4] = y
        terms /= _NOISE * from_rim**_FALL + _FLOOR
        used, last = steps < count[..., None], count - 1
        good = ~(used @ ~own) & (self.weight > 0.0) & (y[[[0], [1]], last] > 0.0)
        share = good @ self.weight / max(float(self.weight.sum()), 1e-300)
        zeros = np.zeros(good.shape)
        chosen = side, fit, line = np.nonzero(good)
        products = np.moveaxis(terms[:4, None] * terms, (0, 1), (3, 4)).reshape(2, REACH, -1)
        normal = (used.astype(float) @ products).reshape(*good.shape, 4, 5)[chosen]
        place = side, last[side, fit], line
        scale = y[place] / x[place]
        # What is of too high a degree has the coefficient zero.
        high = degree[side, fit, None] < np.arange(4)
        right = np.where(high, 0.0, normal[..., 4] / scale[:, None])
        own_terms = np.where(high[:, None] | high[..., None], np.eye(4), normal[..., :4])
        zeros[chosen] = _zeros(np.linalg.solve(own_terms, right[..., None])[..., 0])
        outwards = zeros * np.array([-1.0, 1.0])[:, None, None]
        # Crossings without a fit move as the others do.
        return self.node_area * (outwards @ self.weight) / np.where(share > 0.0, share, 1.0), share


def find_crossings(lattice: Lattice, contact: Flags, wall_pressure: Array, gap: Array) -> Crossings:
    """Collect the crossings of the rim with the lines of a lattice.

    Parameters
    ----------
    lattice : Lattice
    contact : array of bool
    wall_pressure, gap : array
        Of the lattice's shape; the gap is infinite on the padding.
    """
    rows, columns = np.nonzero(contact.any(axis=1))[0], np.nonzero(contact.any(axis=0))[0]
    margin = REACH + 1
    axes = [np.arange(found[0] - margin, found[-1] + margin + 1) for found in (rows, columns)]
    window = np.ix_(*(_wrapped(lattice, axis) for axis in axes))
    touching, pressure, opening = contact[window], wall_pressure[window], gap[window]
    owned = touching & np.logical_and.outer(*((axis >= 0) & (axis < lattice.size) for axis in axes))
    width, own, flat = touching.shape[1], owned.ravel(), touching.ravel()
    steps = (width, -width, 1, -1)
    found = [np.flatnonzero(own & ~np.roll(flat, -step)) for step in steps]
    place, step = np.concatenate(found), np.repeat(steps, [len(one) for one in found])
    smooth = _smoothed(touching).ravel()
    along = [smooth.take(at + one) - smooth.take(at - one) for one in (width, 1) for at in (place, place + step)]
    normal = along[0] + along[1], along[2] + along[3]
    cosine = np.abs(np.where(np.abs(step) > 1, *normal)) / (np.hypot(*normal) + 1e-300)
    away = step[:, None] * np.arange(REACH)
    near, far = place[:, None] - away, (place + step)[:, None] + away
    pressures, openings, inside = pressure.take(near), opening.take(far), touching.take(near)
    outside = ~touching.take(far) & np.isfinite(openings)
    nodes = int(contact.sum())
    return Crossings(
        spacing=lattice.spacing,
        node_area=lattice.node_area,
        nodes=nodes,
        weight=_weights(cosine, nodes * lattice.multiplicity),
        cosine=cosine,
        fraction=_fractions(pressures[:, 0], openings[:, 0], lattice.spacing * np.maximum(cosine, 0.2)),
        wall_pressure=pressures,
        gap=openings,
        inside=inside,
        outside=outside,
    )


def _wrapped(lattice: Lattice, numbers: Integers) -> Integers:
    """Numbers of the nodes for which any integers stand, by mirror symmetry or periodicity."""
    n = lattice.size
    if not lattice.quarter:
        return numbers % n
    folded = numbers % (2 * n)
    return np.minimum(folded, 2 * n - 1 - folded)


def _smoothed(contact: Flags) -> Array:
    field = contact.astype(np.float64)
    for _ in range(_SMOOTHINGS):
        rows = 0.25 * (field[:-2] + 2.0 * field[1:-1] + field[2:])
        field[1:-1, 1:-1] = 0.25 * (rows[:, :-2] + 2.0 * rows[:, 1:-1] + rows[:, 2:])
    return field


def _weights(cosine: Array, nodes: int) -> Array:
    """Partition of the rim between the lines of both directions, by the angle; in halves for a few nodes."""
    x = np.clip(2.0 * cosine**2 - 0.5, 0.0, 1.0)
    by_angle = x * x * (3.0 - 2.0 * x)
    share = np.clip((nodes - 12.0) / 48.0, 0.0, 1.0)
    return np.asarray(share * by_angle + 0.5 * (1.0 - share))


def _fractions(pressure: Array, gap: Array, distance: Array) -> Array:
    """Solve p² y³ + (3g/4)^(2/3) y = distance, monotonic and convex in y = κ^(-2/3), by Newton from above."""
    first, second = pressure**2, (0.75 * np.maximum(gap, 0.0)) ** (2.0 / 3.0)
    known = (first + second > 0.0) & np.isfinite(second)
    a, b, d = np.where(known, first, 1.0), np.where(known, second, 1.0), distance
    y = np.minimum(np.cbrt(d / np.maximum(a, 1e-300)), d / np.maximum(b, 1e-300))
    for _ in range(12):
        square, before = a * y * y, y
        y = (2.0 * square * y + d) / (3.0 * square + b)
        if (np.abs(y - before) <= CLOSE * y).all():
            break
    return np.where(known, np.clip(a * y**3 / d, 0.0, 1.0), 0.5)


def _zeros(coefficients: Array) -> Array:
    """The zero next to x = 0 of every polynomial, at most one node away."""
    x = np.zeros(len(coefficients))
    for _ in range(8):
        value, slope = coefficients[:, -1], np.zeros_like(x)
        for one in coefficients.T[-2::-1]:
            value, slope = value * x + one, slope * x + value
        # Profiles rise away from the rim; where noise makes them fall, nothing is learnt.
        step = np.where(slope > 1e-3, value / np.where(slope > 1e-3, slope, 1.0), 0.0)
        x, before = np.clip(x - step, -1.0, 1.0), x
        if (np.abs(x - before) < CLOSE).all():
            break
    return x
