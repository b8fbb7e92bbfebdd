"""What moves with the panels besides edges: the front outside of all of these, where the gap rises steeply.

Where the law has a kink, that is the front: across it pressures are not smooth.
"""

from __future__ import annotations

import math

import numpy as np

from contbranch.arrays import Indices
from contbranch.models.fronts import BEGINS, ENDS, FLATTER, STIFF

from .equations import Fields, RingEquations
from .meshing import adapted, pieces
from .panels import Grid, Panels

__all__ = ["at_kink", "fronted", "preferred", "steepest"]

# A front is kept as long as the gap there rises by at least this share of itself over the front's radius; it is no
# closer to the last edge than this share of its radius.
RISES, CLOSE = 0.25, 1e-3


def at_kink(problem: RingEquations, fields: Fields) -> bool:
    """Whether the gap rises through a kink of the law outside of all edges."""
    law, grid = problem.law.smooth, fields.grid
    if problem.layout.bounded or law is None or not math.isfinite(law.kink):
        return False
    gap = fields.gap[_outside(problem, grid)]
    inside = np.flatnonzero(gap < law.kink)
    return bool(inside.size and inside[-1] < gap.size - 1)


def _outside(problem: RingEquations, grid: Grid) -> Indices:
    """Nodes outside of all edges, on panels that end."""
    return np.flatnonzero((grid.of_node == problem.layout.edges) & (grid.sign != 2).repeat(grid.order))


def steepest(problem: RingEquations, fields: Fields) -> float:
    """The gap at the front of a state: the present one as long as it serves, or where the pressure is steepest; 0."""
    grid, present = fields.grid, problem.panels.front
    if problem.layout.bounded or problem.law.smooth is None:
        return 0.0
    if at_kink(problem, fields):
        return problem.law.smooth.kink
    own = _outside(problem, grid)
    r, last = grid.r[own], float(grid.edges[-1]) if len(grid.edges) else 0.0
    if not np.abs(fields.stiffness[own]).max(initial=0.0) * problem.tip.radius_at(problem.scale) > STIFF:
        return 0.0
    slope, rise = (grid.slopes(values, r, grid.of_node[own]) for values in (fields.pressure, fields.gap))
    steep = np.abs((r * r - last * last) / r * slope) / np.abs(fields.pressure).max()
    place = int(np.argmax(steep))
    if not steep[place] > (ENDS if present else BEGINS):
        return 0.0
    if present:
        at, near = float(grid.anchors[-1]), int(np.argmin(np.abs(r - grid.anchors[-1])))
        rises = rise[near] * at > RISES * present and at - last > CLOSE * at
        if rises and steep[max(near - grid.order, 0) : near + grid.order].max() > FLATTER * steep[place]:
            return present
    gap = fields.gap[own[max(place - 1, 0) : place + 2]]
    if r[place] - last > CLOSE * r[place] and (np.diff(gap) > 0).all():
        return float(gap[len(gap) // 2])
    return 0.0


def fronted(problem: RingEquations, fields: Fields, front: float) -> Panels:
    """Panels with a front, or without."""
    anchors = fields.grid.edges
    if front:
        anchors = np.append(anchors, problem.located(fields, front))
    return pieces(anchors, problem.panels, fields.grid, problem.layout.bounded, front)


def preferred(problem: RingEquations, fields: Fields) -> Panels | None:
    """Panels with the front that a state asks for, or else adapted to it; None: no change."""
    front = steepest(problem, fields)
    if front != problem.panels.front:
        return fronted(problem, fields, front)
    return adapted(problem, fields, problem.setting.tolerance)
