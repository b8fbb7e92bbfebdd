"""Gap and pressures of a state as functions of the radius."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contbranch.results.diagram import Profile

from .equations import Equations, Fields
from .layout import Region
from .mesh import mesh_on

__all__ = ["profile_of"]

# Radii inside the contact, Chebyshev-spaced so that the rim, where the wall pressure is steep, is resolved.
INSIDE = np.sin(np.pi / 2 * np.arange(48) / 48)
# Where nothing is felt beyond the mesh the gap is given up to this multiple of its radius.
BEYOND = 2.0


def profile_of(equations: Equations, fields: Fields) -> Profile:
    """Gap, total pressure and wall pressure: inside the contact by the Abel inversion, outside from the gap."""
    mesh, a, free = equations.mesh, fields.rim.radius, Region(False, equations.law.outermost)
    if mesh.roots and mesh.roots[-1] == mesh.panels and BEYOND * mesh.end < equations.tip.extent:
        longer = mesh_on(np.append(mesh.edges, BEYOND * mesh.end), mesh.order, False, mesh.roots)
        whole = replace(equations, mesh=longer, regions=(*equations.regions, free))
        return profile_of(whole, whole.fields(equations.carried(fields.state, whole), fields.y))
    touches = np.zeros(mesh.size, dtype=bool)
    for nodes, region in equations.divided():
        touches[nodes] = region == Region(True, 0)
    r, gap, pressure = np.hypot(a, mesh.nodes), np.where(touches, 0.0, fields.gap), fields.pressure
    if a > 0.0:
        inside = np.maximum(a * INSIDE, 1e-6 * a)
        r, gap = np.append(inside, r), np.append(np.full_like(inside, equations.rest), gap)
        pressure = np.append(equations.inner_pressure(fields, inside), pressure)
        touches = np.append(np.full(len(inside), equations.level == 0), touches)
    wall = np.zeros_like(pressure)
    if touches.any():
        wall[touches] = pressure[touches] - equations.law.bounds(0)[0]
    return Profile(r, gap, pressure, wall)
