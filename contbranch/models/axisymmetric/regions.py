"""The inequalities of contact: where regions stop being right, and what comes instead."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre

from contbranch.arrays import Array, magnitude
from contbranch.models.quadrature import panel_rule

from .equations import Equations, Fields
from .layout import Layout, Region

__all__ = ["Breach", "layout_of", "least_margin", "radii_of"]

# Next to an edge gap and pressure come to their bounds; an extremum there counts only beyond this share of the largest
# value, and beyond this absolute share, which discretisation and rounding do not reach.
EDGE_NOISE, ROUNDING = 1e-6, 1e-8
# Next to an edge a pressure that answers a given gap is told to this share of what it changes by in its region; one
# below the second share of the outermost radius is all edge.
PRESSURE_NOISE, NARROW = 0.05, 0.02
# Radii in units of the disc's at which the pressure in it is looked at, denser next to the rim.
INSIDE = np.sqrt(1 - np.concatenate([np.linspace(1.0, 0.1, 16), np.geomspace(0.08, 1e-4, 20)]) ** 2)
# Where a jump takes the place of a narrow resting ring, the gap passes the level by the step of the pressure times the
# width left out over 2π, if that is straight: a tenth more.
PASSES = 1.1 / (2 * math.pi)
# Turning points of a panel's polynomial whose imaginary part is no larger are real: two may all but coincide.
REAL = 1e-6
# Nodes of the polynomial that tells a minimum between the neighbours of a node.
BETWEEN = 12


@dataclass(frozen=True)
class Breach:
    """The place in a region where an inequality is closest to failing.

    Attributes
    ----------
    margin : float
        Gap to the next level (in units of the interaction's range) or pressure to its bound (in units of the largest);
        negative: the regions are wrong.
    region : int
        Of `layout_of`.
    radius : float
        0: at the centre.
    new : Region
        What begins there.
    """

    margin: float
    region: int
    radius: float
    new: Region


def layout_of(equations: Equations) -> Layout:
    """All regions, the central disc among them."""
    mesh = equations.mesh
    disc = (Region(True, equations.level),) if equations.contact else ()
    return Layout((*disc, *equations.regions), bool(mesh.bounded and mesh.roots and mesh.roots[-1] == mesh.panels))


def radii_of(equations: Equations, fields: Fields) -> Array:
    """The radii of the edges between them."""
    mesh, a = equations.mesh, fields.rim.radius
    outside = np.hypot(mesh.edges[list(mesh.roots)], a)
    return np.append(a, outside) if equations.contact else outside


def least_margin(equations: Equations, fields: Fields, scale: float, narrow_ring: float) -> Breach | None:
    """The inequality closest to failing; None if no gap and no pressure has an extremum against its bound.

    `narrow_ring`: see `ContactProblem.narrow_ring`.
    """
    if "breach" not in fields.derived:
        found = list(_breaches(equations, fields, scale, narrow_ring))
        fields.derived["breach"] = min(found, key=lambda breach: breach.margin) if found else None
    breach: Breach | None = fields.derived["breach"]
    return breach


def _breaches(equations: Equations, fields: Fields, scale: float, narrow_ring: float) -> Iterator[Breach]:
    """The interior extrema of gaps and pressures against their bounds, in every region."""
    law, a, mesh = equations.law, fields.rim.radius, equations.mesh
    largest = max(magnitude(fields.pressure), 1.0 / scale)
    if equations.contact and a > 0.0:
        places = a * INSIDE
        inner = equations.inner_pressure(fields, places)
        low, high = law.bounds(equations.level)
        largest = max(largest, abs(low))
        for sign, bound, band in ((1.0, low, equations.level), (-1.0, high, equations.level - 1)):
            if not math.isfinite(bound):
                continue

            def apart(r: Array, sign: float = sign, bound: float = bound) -> Array:
                return sign * (equations.inner_pressure(fields, r) - bound) / largest

            margin = sign * (inner - bound) / largest
            if margin[0] <= margin[1]:
                yield Breach(float(margin[0]), 0, 0.0, Region(False, band))
            for i in np.flatnonzero((margin[1:-1] <= margin[:-2]) & (margin[1:-1] < margin[2:])) + 1:
                found = _lowest(apart, *places[[i - 1, i + 1]].tolist())
                value, place = min((float(margin[i]), float(places[i])), found)
                yield Breach(value, 0, place, Region(False, band))
    first = int(equations.contact)
    for k, (nodes, region) in enumerate(equations.divided()):
        at = partial(_extrema, equations, fields, nodes, k)
        pairs = pairwise(equations.regions[max(k - 1, 0) : k + 2])
        jumps = [max(one.index, other.index) for one, other in pairs if not (one.rests or other.rests)]
        width = narrow_ring * float(radii_of(equations, fields)[-1]) if jumps else 0.0
        if region.rests:
            low, high = law.bounds(region.index)
            pressure = fields.pressure[nodes]
            for sign, bound, band in ((1.0, low, region.index), (-1.0, high, region.index - 1)):
                for value, radius in at(sign * (pressure - bound) / largest, True) if math.isfinite(bound) else ():
                    yield Breach(value, first + k, radius, Region(False, band))
            continue
        bounds = [(law.levels[region.index], 1.0, region.index)]
        if region.index < law.outermost and not (k == len(equations.regions) - 1 and not mesh.bounded):
            bounds.append((law.levels[region.index + 1], -1.0, region.index + 1))
        flat = k == 0 and not equations.contact and equations.tip.apex_exponent > 2.0
        for level, sign, index in bounds:
            centre = (
                sign * (equations.central_gap(fields) - level) / scale if k == 0 and not equations.contact else math.nan
            )
            rests = law.holds(index)
            passes = 0.0
            if index in jumps:
                above, below = law.bounds(index)
                passes = PASSES * max(below - above, 0.0) * width
            ends = not (rests and (index or len(equations.resting)))  # there the range of the parameter does
            new = Region(True, index) if rests else Region(False, index if sign < 0.0 else index - 1)
            for value, radius in at(sign * (fields.gap[nodes] - level) / scale, False, centre, passes / scale):
                if (radius > 0.0 or not ends) and not (flat and 0.0 < radius < mesh.innermost / 2):
                    yield Breach(value, first + k, radius, new)
        if flat:
            yield from _dishes(equations, fields, scale)


def _dishes(equations: Equations, fields: Fields, scale: float) -> Iterator[Breach]:
    """Minima of the gap within the innermost panel of a film under a tip that begins flatter than the dish it presses
    into the surface; the gap less the tip's own height is smooth there."""
    mesh, law, tip = equations.mesh, equations.law, equations.tip
    index, places = equations.regions[0].index, equations.dish_places
    new = Region(True, index) if law.holds(index) else Region(False, index - 1)
    own = tip.height(mesh.nodes)
    lifted = np.where(np.isfinite(own), fields.gap - own, 0.0)

    def at(r: Array) -> Array:
        return mesh.interpolate(lifted, r) + tip.height(r)

    gap = at(places)
    for k in np.flatnonzero((gap[1:-1] < gap[:-2]) & (gap[1:-1] <= gap[2:])) + 1:
        if gap[k] < equations.central_gap(fields) - EDGE_NOISE * abs(fields.rim_value):
            least, place = _lowest(at, float(places[k - 1]), float(places[k + 1]))
            yield Breach((least - law.levels[index]) / scale, 0, place, new)


def _extrema(
    equations: Equations,
    fields: Fields,
    nodes: slice,
    region: int,
    values: Array,
    rests: bool,
    centre: float = math.nan,
    passes: float = 0.0,
) -> Iterator[tuple[float, float]]:
    """The minima of a margin, given at the nodes of a region and at the centre where that is in it, and their radii."""
    mesh, a = equations.mesh, fields.rim.radius
    whole, tau = np.zeros(mesh.size), mesh.nodes[nodes]
    whole[nodes] = np.where(np.isfinite(values), values, np.inf)
    finite = np.isfinite(values)
    whole[~np.isfinite(whole)] = 0.0
    ends = mesh.edges[[nodes.start // mesh.order, nodes.stop // mesh.order]]
    rooted = (
        region > 0 or equations.contact,
        region < len(equations.regions) - 1 or bool(mesh.bounded and mesh.root[-1] > 0),
    )
    share = float((np.hypot(ends[1], a) - np.hypot(ends[0], a)) / np.hypot(ends[1], a)) if rooted[1] else 1.0
    noise = (
        EDGE_NOISE * magnitude(values[finite]) + ROUNDING + (PRESSURE_NOISE * float(np.ptp(values)) if rests else 0.0)
    )
    narrow = share < NARROW
    if math.isfinite(centre) and centre <= values[0]:
        yield centre + noise * narrow, 0.0
    last = nodes.stop // mesh.order - 1
    lower = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:])) + 1
    if math.isfinite(centre) and values[0] < centre and values[0] < values[1]:
        lower = np.append(0, lower)
    at = partial(mesh.interpolate, whole)
    for i in lower:
        value, place = _lowest(at, float(tau[i - 1]) if i else 0.0, float(tau[i + 1]))
        panel = int(np.searchsorted(mesh.edges[1:-1], place))
        beside = narrow or (rooted[0] and panel == nodes.start // mesh.order) or (rooted[1] and panel == last)
        tail = magnitude(mesh.rule.to_legendre[-2:] @ whole[panel * mesh.order : (panel + 1) * mesh.order])
        yield value + passes + (noise + mesh.order * tail) * beside, math.hypot(place, a)


def _lowest(at: Callable[[Array], Array], low: float, high: float) -> tuple[float, float]:
    """The minimum of a smooth function between places, and where."""
    rule, half = panel_rule(BETWEEN), (high - low) / 2
    series = rule.to_legendre @ at(low + half * (1 + rule.nodes))
    slope = legendre.legder(series)
    turning = legendre.legroots(legendre.legtrim(slope, ROUNDING * np.abs(slope).max()))
    places = np.append(turning.real[(np.abs(turning.imag) < REAL) & (np.abs(turning) < 1)], [-1.0, 1.0])
    values = legendre.legval(places, series)
    least = int(np.argmin(values))
    return float(values[least]), float(low + half * (1 + places[least]))
