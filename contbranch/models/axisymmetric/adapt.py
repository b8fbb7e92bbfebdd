"""Meshes that follow the solution: where the panels' polynomials have not converged, split; where they have, merge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .equations import Equations, Fields
from .mesh import Mesh

__all__ = ["adapted_edges", "panel_errors"]

Array = NDArray[np.float64]

# Ratio of the innermost panel to the one it is split from: the solution has a tau⁴ log tau term at the rim, whose error falls
# with the fourth power of the panel's length, so few strongly graded panels suffice.
GRADING = 0.25
MAX_PANELS = 120


def panel_errors(equations: Equations, fields: Fields) -> Array:
    """Estimated error of the load that stems from each panel, (P,), reduced units.

    The tails of the Legendre series of the two functions that the panels represent, (h − h(0)) dt/dtau and p, weighted by the
    area they act on. Gauss nodes integrate the neglected terms to twice the order except on the innermost panel, whose
    functions are not analytic at the rim; hence the product with the relative tail elsewhere.
    """
    mesh = equations.mesh
    profile = (fields.h - fields.rim_value) * fields.rim.factor
    return _errors(mesh.edges, mesh, profile, fields.pressure, fields.stiffness)


def _errors(edges: Array, mesh: Mesh, profile: Array, pressure: Array, stiffness: Array) -> Array:
    n = mesh.order
    length, rho = np.diff(edges), edges[1:]
    stiff = np.abs(stiffness.reshape(-1, n)).max(axis=1)
    total = np.zeros(len(length))
    for values, weight in ((pressure, 1.0), (profile, stiff * np.sqrt(length / rho))):
        coefficients = np.abs(values.reshape(-1, n) @ mesh.rule.to_legendre.T)
        largest = coefficients.max(axis=1)
        tail = coefficients[:, -2:].max(axis=1)
        relative = np.divide(tail, largest, out=np.zeros_like(tail), where=largest > 0)
        relative = np.minimum(1.0, 10 * relative)
        relative[0] = 1.0
        total += 2 * np.pi * rho * length * weight * tail * relative
    return total


def adapted_edges(equations: Equations, fields: Fields, tolerance: float, reach: float) -> Array:
    """Panel edges from 0 to `reach` on which the solution's tails add up to about `tolerance`.

    The solution is sampled as it stands on its present mesh, so an unresolved one wants a second round.

    Parameters
    ----------
    tolerance : float
        Error of the load allowed in total, reduced units.
    reach : float
        Outer end of the mesh.
    """
    mesh = equations.mesh
    share = tolerance / 6
    edges = np.array([0.0, reach])
    settled = np.zeros(1, dtype=bool)
    for _ in range(60):
        bad = np.zeros(len(settled), dtype=bool)
        open_panels = np.flatnonzero(~settled)
        bad[open_panels] = _sampled_errors(equations, fields, edges, open_panels) > share
        # Panels may not grow faster than this outwards: the kernels' substitutions are exact for moderate ratios only.
        bad[1:] |= edges[2:] > 4.5 * edges[1:-1]
        settled = ~bad
        if not bad.any() or len(settled) >= MAX_PANELS:
            break
        cut = (edges[:-1] + edges[1:]) / 2
        cut[0] = GRADING * edges[1]
        order = np.argsort(np.concatenate([edges, cut[bad]]), kind="stable")
        state = np.concatenate([settled, [True], np.zeros(int(bad.sum()), dtype=bool)])
        # Both halves of a split panel are open again.
        halves = np.repeat(~bad, np.where(bad, 2, 1))
        edges = np.concatenate([edges, cut[bad]])[order]
        settled = halves
        del state
    del mesh
    return edges


def _sampled_errors(equations: Equations, fields: Fields, edges: Array, panels: NDArray[np.intp]) -> Array:
    mesh = equations.mesh
    left, right = edges[panels], edges[panels + 1]
    half = (right - left) / 2
    points = ((left + right)[:, None] / 2 + half[:, None] * mesh.rule.nodes).ravel()
    profile = mesh.interpolate(fields.h, points) - fields.rim_value
    a = fields.rim.radius
    if a > 0:
        profile = profile * points / np.sqrt(a * a + points * points)
    pressure = mesh.interpolate(fields.pressure, points)
    stiffness = mesh.interpolate(fields.stiffness, points)
    n = mesh.order
    length = right - left
    stiff = np.abs(stiffness.reshape(-1, n)).max(axis=1)
    total = np.zeros(len(length))
    for values, weight in ((pressure, 1.0), (profile, stiff * np.sqrt(length / right))):
        coefficients = np.abs(values.reshape(-1, n) @ mesh.rule.to_legendre.T)
        largest = coefficients.max(axis=1)
        tail = coefficients[:, -2:].max(axis=1)
        relative = np.divide(tail, largest, out=np.zeros_like(tail), where=largest > 0)
        relative = np.where(left == 0, 1.0, np.minimum(1.0, 10 * relative))
        total += 2 * np.pi * right * length * weight * tail * relative
    return total
