"""Gap and pressures of a state as functions of the radius."""

from __future__ import annotations

import numpy as np

from contbranch.diagram import Profile

from .problem import Fields, RingProblem

__all__ = ["profile_of"]


def profile_of(problem: RingProblem, fields: Fields) -> Profile:
    """Gap, total pressure and the wall's share of it: what exceeds the law's own pressure where the gap is closed."""
    grid, law = fields.grid, problem.setting.law
    rests, level = problem.resting(grid)
    wall = np.zeros(grid.size)
    for k, region in enumerate(problem.layout.regions):
        if region.rests and region.index == 0:
            own = grid.of_node == k
            wall[own] = fields.pressure[own] - law.pressure(0, 0)
    r, gap, pressure = grid.r, np.where(rests, level, fields.gap), fields.pressure
    if problem.layout.bounded:  # nothing but the tip's own shape and the elastic displacement beyond the last edge
        return Profile(r, gap, pressure, wall)
    return Profile(r, gap, pressure, wall)
