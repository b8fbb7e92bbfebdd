"""Where equilibria off the curve are looked for: a mesh that can hold what the curve holds, and undeformed states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from contbranch.continuation import Point
from contbranch.curve.problem import Search

from .mesh import mesh_on

if TYPE_CHECKING:
    from .problem import ContactProblem

__all__ = ["search_from"]

# Neighbouring edges of the meshes that are joined differ by this factor at least; nodes a panel.
APART, ORDER = 1.6, 10
# Undeformed states from which to search.
BARE = 4


def search_from(problem: ContactProblem, points: Sequence[Point]) -> Search:
    """The search on one side of first touch, given the curve's rows there."""
    own = [(point.problem, point) for point in points if isinstance(point.problem, type(problem))]
    meshes = [one.seen(point.x, point.parameter)[0].mesh for one, point in own]
    problem, _ = own[-1][0].still(own[-1][1].x)
    edges = np.unique(np.concatenate([mesh.edges[1:] for mesh in meshes]))
    kept = [0.0, float(edges[0])]
    for edge in edges[1:]:
        if edge > APART * kept[-1] or edge == edges[-1]:
            kept.append(float(edge))
    coarse = problem.on_mesh(mesh_on(np.array(kept), ORDER))
    first, last = points[0].parameter, points[-1].parameter
    starts = []
    for k in range(BARE):
        u = first + (k + 0.5) / BARE * (last - first)
        # the pressure that the undeformed tip would feel
        pressure = coarse.fields(np.zeros(coarse.size), u).pressure
        starts.append((coarse.mesh.abel_of(np.nan_to_num(pressure, posinf=0.0, neginf=0.0)), u))
    # changes of h by the range of the interaction over its width √(2 range) count as much as one of u
    return Search(coarse, tuple(starts), problem.scale * (2 * problem.scale) ** 0.25)
