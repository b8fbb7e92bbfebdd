"""The inequalities of contact: where a layout of regions stops being right, and what comes instead."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.polynomial import legendre

from contbranch.arrays import Array, magnitude
from contbranch.continuation import Point
from contbranch.models.quadrature import panel_rule, peak_pressure

from .equations import NARROW_RING, Fields, RingEquations, rings
from .layout import Layout, Region

__all__ = ["Breach", "begun", "least_margin", "narrowness"]

At = Callable[[Array], Array]

# Next to an edge both gap and pressure come to their bounds; an extremum there counts only beyond this share of the
# largest value, which discretisation does not reach.
EDGE_NOISE = 1e-6
# ... nor beyond this absolute share, which rounding does not reach; regions narrower than this share of the outermost
# edge are all edge.
ROUNDING, NARROW = 1e-8, 0.02
# At a jump the gap passes the level by the step of the pressure times the width of the ring left out over 2π, if that
# is straight: a tenth more.
PASSES = 1.1 / (2 * math.pi)
# A pressure that answers a given gap is determined the worse the narrower the region; next to an edge that shows in the
# last coefficients of its panel.
PRESSURE_NOISE = 3e-8
# A region vanishes at this share of its width where the piece of the curve begins, or of the outermost edge if that is
# less.
SHRUNK, NARROWEST = 0.5, 1e-3
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
        negative: the layout is wrong.
    region : int
    radius : float
        0: at the centre.
    new : Region
        What begins there.
    """

    margin: float
    region: int
    radius: float
    new: Region


def begun(point: Point) -> Point:
    """The point as the start of a piece of curve, with the widths at which its regions vanish, and its own origin."""
    problem = rings(point)
    edges, tip = point.x[point.x.size - problem.edges :][: problem.layout.edges], problem.tip
    shares = problem.widths(edges) / edges[-1] if len(edges) else edges
    widths = []
    for k, share in enumerate(shares):
        joins, collapses = problem.layout.without(k) is not None, problem.layout.collapsed(k) is not None
        least = NARROWEST if joins else NARROW_RING if collapses else 0.0
        if joins and k == len(shares) - 1 and math.isfinite(tip.extent):  # counts by its height: caps end steeply
            least = 1 - tip.radius_at((1 - NARROWEST) * float(tip.height(np.float64(tip.extent)))) / tip.extent
        widths.append(float(min(least, SHRUNK * share)))
    origin = -min(problem.law.levels, key=lambda level: abs(level + problem.origin + point.parameter))
    own = problem.laid_out(problem.layout, problem.panels, tuple(widths), origin)
    return replace(point, problem=own, parameter=point.parameter + (problem.origin - origin))


def narrowness(problem: RingEquations, fields: Fields) -> float:
    """The smallest width over that at which its region vanishes, less 1; at most 1."""
    if not any(problem.vanishing):
        return 1.0
    least = np.array(problem.vanishing)
    shares = problem.widths(fields.grid.edges) / fields.grid.edges[-1]
    return min(1.0, float((shares[least > 0] / least[least > 0]).min()) - 1)


def breaches(problem: RingEquations, fields: Fields) -> Iterator[Breach]:
    """The interior extrema of gaps and pressures against their bounds, in every region."""
    law = problem.law
    scale = problem.scale
    largest = max(magnitude(fields.pressure), 1e-300)
    for k, region in enumerate(problem.layout.regions):
        if k >= fields.grid.region[-1] + 1:
            continue
        if region.rests:
            low, high = law.bounds(region.index)
            pressure = fields.pressure
            if problem.layout == Layout((region,), True) and problem.tip.apex_exponent < 2:
                pressure = np.append(pressure, peak_pressure(problem.tip, float(fields.grid.edges[0])))
            yield from _extrema(problem, fields, k, (pressure - low) / largest, Region(False, region.index))
            if math.isfinite(high):
                upper = Region(False, region.index - 1)
                yield from _extrema(problem, fields, k, (high - pressure) / largest, upper)
        else:
            rise = np.append(fields.rise, problem.apex(fields)) - problem.origin
            ceiling = law.ceiling(region.index)
            bounds = [(law.levels[region.index], 1, region.index)]
            outermost = k == len(problem.layout.regions) - 1 and not problem.layout.bounded
            if math.isfinite(ceiling) and not outermost:
                bounds.append((ceiling, -1, region.index + 1))
            for level, sign, index in bounds:
                at = partial(_apart, problem, fields, level, sign)
                yield from _extrema(problem, fields, k, sign * (rise - level) / scale, Region(True, index), at)
            if math.isfinite(ceiling) and problem.layout.ends(k):
                edge = fields.grid.edges[k:]
                left = float(_apart(problem, fields, ceiling, -1, edge)[0])
                yield Breach(left, k, float(edge[0]), Region(False, region.index + 1))


def least_margin(problem: RingEquations, fields: Fields) -> Breach | None:
    """The inequality closest to failing; None if no gap and no pressure has an extremum against its bound."""
    if "breach" not in fields.derived:
        found = list(breaches(problem, fields))
        fields.derived["breach"] = min(found, key=lambda breach: breach.margin) if found else None
    breach: Breach | None = fields.derived["breach"]
    return breach


def _apart(problem: RingEquations, fields: Fields, level: float, sign: int, r: Array) -> Array:
    """How far the gap is from a level at radii, above it or (sign −1) below, in units of the range."""
    return sign * (problem.rise_at(fields, r) - problem.origin - level) / problem.scale


def _extrema(
    problem: RingEquations, fields: Fields, region: int, margin: Array, new: Region, at: At | None = None
) -> Iterator[Breach]:
    """The minima of a margin, given at the nodes, and at the centre where it is known there (last).

    Between them it is what `at` says: a gap answers all pressures, and panels that resolve these need not resolve it.
    By default it is the panels' own polynomial, whose last coefficients tell what is not known of it.
    """
    grid = fields.grid
    own = np.flatnonzero(grid.of_node == region)
    if len(own) < 3:
        return
    known, margin = margin[grid.size :], margin[: grid.size]
    values, radii = margin[own], grid.r[own]
    untold = np.zeros(grid.count) if at else grid.order * np.abs(grid.coefficients(margin)[:, -2:]).max(axis=1)
    at = at or partial(grid.interpolate, margin)
    inner_edge, outer_edge = region > 0, region < problem.layout.edges
    jumps = [e for e in (region - 1, region) if 0 <= e < problem.layout.edges and problem.layout.jump(e)]
    noise = EDGE_NOISE * magnitude(values) + ROUNDING
    for edge in jumps:
        low, high = problem.law.bounds(problem.layout.jump_level(edge))
        noise = max(noise, PASSES * (high - low) * NARROW_RING * float(grid.edges[-1]) / problem.scale)
    share = float(problem.widths(grid.edges)[region] / grid.edges[-1]) if outer_edge else 1.0
    narrow = share < NARROW
    if problem.layout.regions[region].rests:
        noise += PRESSURE_NOISE / share
    if region == 0:
        centre = float(known[0] if len(known) else grid.at_end(0, outer=False) @ margin)
        if centre <= values[0]:
            yield Breach(centre + noise if narrow else centre, region, 0.0, new)
        elif values[0] < values[1]:  # the extremum lies between the centre and the second node
            value, radius = _lowest(at, 0.0, radii[1])
            radius *= radius > ROUNDING * radii[0]
            yield Breach(value + noise if narrow else value, region, radius, new)
    lower = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:])) + 1
    for i in lower:
        value, radius = _lowest(at, *radii[[i - 1, i + 1]])
        panel = int(grid.breaks[:, 1].searchsorted(radius))
        first, last = grid.region.searchsorted(region), grid.region.searchsorted(region, side="right") - 1
        at_edge = narrow or (inner_edge and panel == first) or (outer_edge and panel == last)
        if region == 0 and i == 1 and values[0] < value:
            continue
        yield Breach(value + noise + untold[panel] if at_edge else value, region, radius, new)


def _lowest(at: At, low: float, high: float) -> tuple[float, float]:
    """The minimum of a smooth function between radii, and where."""
    rule, half = panel_rule(BETWEEN), (high - low) / 2
    series = rule.to_legendre @ at(low + half * (1 + rule.nodes))
    turning = legendre.legroots(legendre.legder(series))
    places = np.append(turning.real[(np.abs(turning.imag) < REAL) & (np.abs(turning) < 1)], [-1.0, 1.0])
    values = legendre.legval(places, series)
    least = int(np.argmin(values))
    return float(values[least]), float(low + half * (1 + places[least]))
