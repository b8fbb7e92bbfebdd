"""Passing from one layout to the next where an inequality fails: regions that are born, and regions that vanish."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Point
from contbranch.errors import ModelError

from .constraints import Breach
from .layout import Layout
from .legs import AdaptingProblem, Violation, oriented, solved, unit_metric
from .meshing import BOUNDED
from .panels import Grid, Panels
from .problem import RingProblem

__all__ = ["passed", "seeded"]

Array = NDArray[np.float64]

# Half-widths with which a region is born, as shares of the room there is for it; the first that succeeds counts.
SEEDS = (0.02, 0.05, 0.01, 0.1, 0.004, 0.2)
# Breaks taken over from other panels are at least this share of the outermost one apart; rounds of meshing of a state.
APART, MESHINGS = 0.02, 4


def pieces(layout: Layout, edges: Array, panels: Panels, grid: Grid) -> Panels:
    """Panels for a layout's regions: pieces next to edges that were there before are kept, others begin coarsely.

    Piece 2j lies inside of edge j and piece 2j + 1 outside of it; what lies outside of the last edge is no piece.
    """
    halves: list[tuple[float, ...]] = []
    for k in range(max(2 * layout.edges - 1, 0)):
        same = np.flatnonzero(grid.edges == edges[k // 2])
        old = 2 * int(same[0]) + k % 2 if len(same) else -1
        halves.append(panels.halves[old] if 0 <= old < len(panels.halves) else BOUNDED)
    outer = panels.outer
    last = float(edges[-1]) if layout.edges else 0.0
    if not layout.bounded and not (len(grid.edges) and layout.edges and last == grid.edges[-1]):
        radii = np.unique(grid.breaks[np.isfinite(grid.breaks)])
        kept: list[float] = []
        for radius in radii[radii > last]:
            y = float(math.sqrt(radius - last) if layout.edges else radius)
            if y - (kept[-1] if kept else 0.0) > APART * math.sqrt(radii[-1]) and y > 0:
                kept.append(y)
        outer = tuple(kept)
    return replace(panels, halves=tuple(halves), outer=outer)


def meshed(point: Point, row: tuple[Array, float] | None = None) -> Point:
    """The point on panels that resolve it, in the plane that the row (by default: its own tangent) is normal to.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    for _ in range(MESHINGS):
        problem = point.problem
        assert isinstance(problem, AdaptingProblem)
        offer = problem.adapt(point.x, point.parameter)
        if offer is None:
            break
        other = offer.problem
        assert isinstance(other, AdaptingProblem)
        assert offer.transfer is not None
        tangent = offer.transfer(point.tangent_x), point.tangent_parameter
        metric = unit_metric(other, offer.x)
        if row is None:
            across = metric.row(other, *tangent)
        else:  # rows of edges alone
            across = np.zeros(offer.x.size), row[1]
            count = problem.edges
            across[0][offer.x.size - count :] = row[0][row[0].size - count :]
        x, d = solved(other, offer.x, point.parameter, across)
        point = oriented(other, x, d, tangent)
    return point


def seeded(point: Point, breach: Breach) -> Point:
    """The state in which a narrow new region has been born, oriented towards its growth.

    Raises
    ------
    ModelError
        If none was found.
    """
    problem = point.problem
    assert isinstance(problem, RingProblem)
    fields = problem.fields(point.x, point.parameter)
    grid = fields.grid
    edges = grid.edges
    centre = breach.radius == 0.0
    layout = problem.layout.born(breach.region, breach.new, centre)
    before = edges[breach.region - 1] if breach.region else 0.0
    after = edges[breach.region] if breach.region < len(edges) else math.inf
    room = min(
        *([] if centre else [breach.radius - before]),
        after - breach.radius,
        max(edges[-1] if len(edges) else 0.0, math.sqrt(problem.setting.scale)),
    )
    for share in SEEDS:
        half = share * room
        if centre:
            new = np.concatenate([[half], edges])
        else:
            at = breach.radius + half * np.array([-1.0, 1.0])
            new = np.insert(edges, breach.region, at)
        trial = AdaptingProblem(problem.setting, layout, pieces(layout, new, problem.panels, grid))
        nodes = Grid(trial.panels, new, layout.bounded)
        x = np.concatenate([grid.interpolate(fields.pressure, nodes.r), new])
        row = np.zeros(x.size)
        row[nodes.size + breach.region] = 1.0
        if not centre:
            row[nodes.size + breach.region], row[nodes.size + breach.region + 1] = -1.0, 1.0
        try:
            x, d = solved(trial, x, point.parameter, (row, 0.0))
            born = meshed(oriented(trial, x, d, (row, 0.0)), (row, 0.0))
        except CorrectionError:
            continue
        if Violation().value(born) < -1e-3:
            continue
        return born
    raise ModelError("no state was found beyond the change of the contact set")


def passed(point: Point, limits: tuple[float, ...]) -> tuple[Point, bool]:
    """The state without the region that has all but vanished, oriented as before, and whether a jump takes its place.

    Parameters
    ----------
    limits : tuple of float
        The `thresholds` of the leg that ends at the point.

    Raises
    ------
    ModelError
        If the neighbours cannot be joined, or Newton's method fails.
    """
    problem = point.problem
    assert isinstance(problem, RingProblem)
    fields = problem.fields(point.x, point.parameter)
    edges = fields.grid.edges
    widths = problem.widths(fields)
    region = min((k for k, limit in enumerate(limits) if limit > 0), key=lambda k: widths[k] / limits[k])
    joined, collapsed = problem.layout.without(region), problem.layout.collapsed(region)
    layout = joined if joined is not None else collapsed
    assert layout is not None
    gone = [region] if region == 0 or joined is None else [region - 1, region]
    kept = np.delete(edges, gone)
    if joined is None:
        kept[region - 1] = (edges[region - 1] + edges[region]) / 2
    trial = AdaptingProblem(problem.setting, layout, pieces(layout, kept, problem.panels, fields.grid))
    nodes = Grid(trial.panels, kept, layout.bounded)
    n = fields.grid.size

    def carried(vector: Array) -> Array:
        return np.concatenate([fields.grid.interpolate(vector[:n], nodes.r), np.delete(vector[n:], gone)])

    tangent = carried(point.tangent_x)
    x = carried(point.x)
    x[nodes.size :] = kept
    metric = unit_metric(trial, x)
    # Close to the vanishing region rates of pressure are large and mean nothing for the joined state.
    tangent[: nodes.size] = 0.0
    if not np.abs(tangent[nodes.size :]).max(initial=0.0) + abs(point.tangent_parameter) > 0:
        raise ModelError("the direction of the curve was lost where a region vanished")
    row = metric.row(trial, tangent, point.tangent_parameter)
    try:
        x, d = solved(trial, x, point.parameter, row)
        return meshed(oriented(trial, x, d, (tangent, point.tangent_parameter))), joined is None
    except CorrectionError as error:
        raise ModelError(f"no state was found without the region that vanished {error.detail}") from error
