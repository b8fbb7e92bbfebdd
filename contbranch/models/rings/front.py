"""What moves with the panels besides edges: the front outside of all of these, where the gap rises steeply."""

from __future__ import annotations

import numpy as np

from contbranch.models.fronts import BEGINS, ENDS, FLATTER, STIFF

from .equations import Fields, RingEquations
from .meshing import pieces
from .panels import Panels

__all__ = ["fronted", "steepest"]

# A front is kept as long as the gap there rises by at least this share of itself over the front's radius; it is no
# closer to the last edge than this share of its radius.
RISES, CLOSE = 0.25, 1e-3


def steepest(problem: RingEquations, fields: Fields) -> float:
    """The gap at the front of a state: the present one as long as it serves, or where the pressure is steepest; 0."""
    grid, present = fields.grid, problem.panels.front
    if problem.layout.bounded or problem.setting.law.smooth is None:
        return 0.0
    own = np.flatnonzero((grid.of_node == problem.layout.edges) & (grid.sign != 2).repeat(grid.order))
    r, last = grid.r[own], float(grid.edges[-1]) if len(grid.edges) else 0.0
    if not np.abs(fields.stiffness[own]).max() * problem.setting.tip.radius_at(problem.scale) > STIFF:
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
