"""Where a curve begins: without contact, far enough away that the interaction is negligible."""

from __future__ import annotations

import numpy as np

from .newton import Equilibrium, Settings, hold_control, newton
from .setup import Setup

__all__ = ["beginning"]

# The first gap at most, in heights of the tip at the border of the cell: from there on all of the cell acts alike.
FURTHEST = 1.0


def beginning(setup: Setup, accuracy: float, settings: Settings) -> tuple[Equilibrium, Equilibrium] | str:
    """Two states without contact, one a little closer than the other; the reason if there are none."""
    problem = setup.problem
    law = setup.law
    if law is None:
        return "There is no interaction with which the contact could begin; use the axisymmetric model"
    inside = problem.heights[: setup.lattice.inside, : setup.lattice.inside]
    finite = inside[np.isfinite(inside)]
    most = max(10.0 * setup.length, FURTHEST * float(finite.max()))
    displacement = -min(law.reach(accuracy), most)
    step = 0.05 * max(setup.length, 0.2 * abs(displacement))
    if not law.evaluate(np.array([-displacement])).pressure.any():
        displacement -= 1.5 * step  # a law that ends: two states beyond its end, from where the walk goes in
    u = np.full(problem.shape, -displacement)
    load = problem.lattice.node_area * float(problem.respond(problem.heights + u)[1].sum())
    first = newton(problem, u, load, hold_control(problem, 0.0, 1.0, displacement), None, settings)
    onward = hold_control(problem, 0.0, 1.0, displacement + step)
    second = newton(problem, first.u - step, first.load, onward, None, settings)
    if not (first.converged and second.converged):
        return "No equilibrium without contact was found to begin with; try a finer grid"
    return first, second
