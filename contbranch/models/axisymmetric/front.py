"""A front that moves with the mesh: where the gap rises steeply, it does so at the same place of a stretched mesh.

Laws that do not pull at contact, the edge of a squeezed film and the rings of a layered liquid have a steep zone far
outside of the contact, which travels while everything else stays smooth. On the mesh ``tau = e^σ ξ`` with fixed ξ,
where σ is one more unknown and ``g(ξ_f) = g_f`` one more equation, it stands still, and steps are as long as the curve
in these coordinates allows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array

from .equations import Equations, Fields
from .mesh import Mesh

__all__ = ["Front", "steepest"]

# A front begins where a panel is shorter than this share of its distance from the rim, ends where none is shorter than
# the second, and is moved where another panel is shorter by the third factor than the one it lies on.
BEGINS, ENDS, SHORTER = 0.1, 0.3, 8.0


@dataclass(frozen=True)
class Front:
    """Where the front is in the mesh, and which gap it has there.

    Attributes
    ----------
    place : float
        ξ_f.
    gap : float
        g_f.
    weight : float
        Of σ in the inner product of states: ∫ h² dξ where the front began.
    """

    place: float
    gap: float
    weight: float

    def row(self, mesh: Mesh) -> tuple[slice, Array]:
        """The nodes of the panel on which the front lies, and their weights in a value at its place."""
        panel = int(np.searchsorted(mesh.edges[1:-1], self.place, side="right"))
        local = (self.place - mesh.edges[panel]) / mesh.half[panel] - 1.0
        return slice(panel * mesh.order, (panel + 1) * mesh.order), mesh.rule.lagrange(np.array([local]))[0]

    def anchored(self, equations: Equations, fields: Fields) -> float:
        """ln s for which the front lies where a state has its gap; nearest to where it would be unstretched."""
        mesh, above = equations.mesh, fields.gap > self.gap
        crossed = np.flatnonzero(above[1:] != above[:-1])
        if len(crossed) == 0:
            return 0.0
        places = mesh.nodes[crossed]
        k = int(crossed[np.argmin(np.abs(np.log(places / self.place)))])
        low, high = float(mesh.nodes[k]), float(mesh.nodes[k + 1])
        rising = bool(above[k + 1])
        for _ in range(60):
            middle = (low + high) / 2
            if (float(mesh.interpolate(fields.gap, np.array([middle]))[0]) > self.gap) == rising:
                high = middle
            else:
                low = middle
        return math.log(low / self.place)


def steepest(equations: Equations, fields: Fields, present: Front | None, unit: Mesh) -> Front | None:
    """The front of a state: the present one as long as it serves, or one on the shortest panel; None without.

    Parameters
    ----------
    unit : Mesh
        The mesh before it was stretched.
    """
    edges = unit.edges
    share = np.diff(edges) / edges[1:]
    share[0] = 1.0
    shortest = int(np.argmin(share))
    if present is not None:
        own = share[int(np.searchsorted(edges[1:-1], present.place, side="right"))]
        if share[shortest] > ENDS:
            return None
        if own <= SHORTER * share[shortest]:
            return present
    elif share[shortest] > BEGINS:
        return None
    place = float(edges[shortest] + edges[shortest + 1]) / 2
    nodes, row = Front(place, 0.0, 1.0).row(unit)
    gap = fields.gap[nodes]
    if not (bool((np.diff(gap) > 0).all()) or bool((np.diff(gap) < 0).all())):
        return present
    return Front(place, float(row @ gap), float(unit.weights @ fields.h**2))
