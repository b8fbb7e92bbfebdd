"""Gap and pressures of a state as functions of the radius."""

from __future__ import annotations

import numpy as np

from contbranch.results.profile import Profile

from .equations import Fields, RingEquations

__all__ = ["profile_of"]

# Radii beyond the last edge, in units of it, at which the gap is given.
OUTSIDE = 1 + np.linspace(0.0, 1.0, 17)[1:] ** 2


def profile_of(problem: RingEquations, fields: Fields) -> Profile:
    """Gap, total pressure and the wall's share of it: what exceeds the law's own pressure where the gap is closed."""
    grid, law = fields.grid, problem.law
    rests, level = problem.resting(grid)
    touching = np.array([region.rests and region.index == 0 for region in problem.layout.regions])[grid.of_node]
    wall = np.where(touching, fields.pressure - law.pressure(0, 0), 0.0)
    r, gap, pressure = grid.r, np.where(rests, level, fields.gap), fields.pressure
    if problem.layout.bounded:  # beyond the last edge there is no pressure, but a gap
        beyond = np.unique(np.minimum(grid.edges[-1] * OUTSIDE, problem.tip.extent))
        none = np.zeros_like(beyond)
        r = np.concatenate([r, beyond])
        gap = np.concatenate([gap, problem.rise_at(fields, beyond) - problem.origin])
        pressure, wall = np.concatenate([pressure, none]), np.concatenate([wall, none])
    return Profile(r, gap, pressure, wall)
