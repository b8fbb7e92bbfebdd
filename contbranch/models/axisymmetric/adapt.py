"""Meshes that follow the solution: where the panels' polynomials have not converged, split; where they have, merge."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import lapack

from contbranch.arrays import Array, Flags, Indices, magnitude
from contbranch.curve.problem import Defect
from contbranch.models.fronts import SMOOTH

from .equations import Equations, Fields, felt
from .mesh import Mesh

__all__ = [
    "adapted_edges",
    "cuts",
    "defect_error",
    "factorised",
    "needed_reach",
    "panel_errors",
    "roughness",
    "too_long",
]

# Ratio of the innermost panel to the one it is split from: the solution has a tau⁴ log tau term at the rim, whose
# error falls with the fourth power of the panel's length, so few strongly graded panels suffice.
GRADING = 0.25
# Neighbouring panels differ in their outer ends by no more than this factor.
GROWTH = 4.5
# ... and from edges of regions.
BESIDE_EDGES = 4.5
# The mesh is shortened when this part of it would do.
SHORTEN = 0.9
# Length of the mesh in units of that on which elasticity answers the interaction, beyond which systems are refined.
STIFF = 1e5
# Length of the mesh in units of that on which elasticity answers the interaction, from which on films end abruptly.
STIFF_FILM = 1e3
# Panels are merged when the joint panel's error stays below this part of what is allowed, so that it is not split
# again soon.
MERGE = 0.1


def defect_error(equations: Equations, fields: Fields) -> Defect:
    """One step towards the solution on ``mesh.finer``, with the present mesh's linearisation.

    The solution is carried to the finer mesh, its residual there is brought back, and the correction it asks for
    changes load and displacement; so do the finer mesh's own integrals.
    """
    mesh, fine_equations = equations.mesh, equations.finer
    fine = fine_equations.fields(mesh.to_finer @ fields.h, fields.y)
    residual, solve = mesh.from_finer(fine.residual), factorised(equations.jacobian(fields))
    step = -solve(residual)
    if magnitude(fields.stiffness) * mesh.end > STIFF:  # rounding in the matrix would rule
        step -= solve(residual + equations.multiplied(fields, step))
    shift = float(equations.rim_gradient(fields) @ step)
    displacement = fine_equations.displacement(fine) - equations.displacement(fields) + shift
    load = fine_equations.load(fine) - equations.load(fields)
    load += equations.load_change(fields, step)
    longer = fine_equations.mesh.nodes > mesh.end  # where h, carried over, is 0 and the residual all there is
    load -= 2 * float(fine.rim.weights[longer] @ fine.residual[longer])
    return Defect(load, displacement, magnitude(step))


def factorised(matrix: Array) -> Callable[[Array], Array]:
    """What solves with a matrix, which is overwritten."""
    factors, pivots, _ = lapack.dgetrf(matrix.T, overwrite_a=1)  # LAPACK stores by columns
    return lambda f: lapack.dgetrs(factors, pivots, f, trans=1)[0]


def roughness(equations: Equations, fields: Fields, edges: Array, within: float) -> Array:
    """Tails of v'' on panels as shares of its largest value, in units of what a film bears, (P,); 0 beyond a radius.

    Where a stiff film is about to be squeezed out, and around a contact that begins in it, what happens at its centre
    decides on the branch, and on the load that goes with it, however little load it carries.
    """
    mesh, n = equations.mesh, equations.mesh.order
    nodes = _nodes(mesh, edges)
    tails = np.abs(mesh.interpolate(fields.stiffness, nodes).reshape(-1, n) @ mesh.rule.to_legendre[-2:].T).max(axis=1)
    share = tails / (SMOOTH * max(magnitude(fields.stiffness), 1e-300))
    return np.where(edges[1:] < within, share, 0.0)


def _nodes(mesh: Mesh, edges: Array) -> Array:
    """Nodes of panels with other edges, which have the mesh's root edges among them."""
    roots = np.abs(edges[:, None] - mesh.edges[list(mesh.roots)]).argmin(axis=0)
    return Mesh(edges, mesh.order, mesh.bounded, tuple(roots.tolist())).nodes


def panel_errors(equations: Equations, fields: Fields, edges: Array | None = None) -> Array:
    """Estimated error of the load that stems from each panel, (P,), reduced units: a guide where to refine.

    The tails of the Legendre series of the two functions that the panels represent, (h − h(0)) dt/dtau and p, weighted
    by the
    area they act on. Gauss nodes integrate the neglected terms to twice the order except on the innermost panel, whose
    functions are not analytic at the rim; hence the product with the relative tail elsewhere. An error of h(0) shifts
    the whole gap.

    Parameters
    ----------
    edges : array (P + 1,), optional
        Panels to judge, if not those of the mesh: the solution is then sampled on them.
    """
    mesh = equations.mesh
    rule, n = mesh.rule, mesh.order
    fields_here = (fields.h - fields.rim_value, fields.pressure, fields.stiffness)
    if edges is None:
        edges, nodes = mesh.edges, mesh.nodes
        profile, pressure, stiffness = fields_here
    else:
        nodes = _nodes(mesh, edges)
        profile, pressure, stiffness = map(mesh.sampler(nodes), fields_here)
    a = fields.rim.radius
    weighted = profile * nodes / np.hypot(a, nodes) if a > 0 else profile
    length, rho = np.diff(edges), edges[1:]
    stiff = np.abs(stiffness.reshape(-1, n)).max(axis=1)
    total = np.zeros(len(length))

    def add(error: Array, largest: Array, within: Array) -> None:
        relative = np.divide(error, largest, out=np.zeros_like(error), where=largest > 0)
        np.add(total, 2 * np.pi * rho * within * error * np.minimum(1.0, 10 * relative), out=total)

    for values, weight in ((pressure, 1.0), (weighted, stiff * np.sqrt(length / rho))):
        coefficients = np.abs(values.reshape(-1, n) @ rule.to_legendre.T)
        add(coefficients[:, -2:].max(axis=1), coefficients.max(axis=1), length * weight)
    if magnitude(fields.stiffness) * mesh.end > STIFF_FILM:
        # Where a film ends right beside an edge, with no node between, the panels' polynomials do not meet.
        ends = pressure.reshape(-1, n) @ rule.lagrange(np.array([-1.0, 1.0])).T
        jump, largest = np.abs(ends[:-1, 1] - ends[1:, 0]), np.abs(ends).max(axis=1)
        jump[np.isin(edges[1:-1], mesh.edges[list(mesh.roots)])] = 0.0  # where it may
        jump = np.pad(jump, 1)
        add(np.maximum(jump[:-1], jump[1:]), largest, length * (1 + rule.nodes[0]) / 2)
    misfit = magnitude(rule.to_even[-2:] @ profile[:n])
    response = min(2 * np.pi * float(mesh.weights @ (mesh.nodes * np.abs(fields.stiffness))), 2 * float(mesh.end))
    total[0] += misfit * response
    return total


def needed_reach(equations: Equations, fields: Fields, tolerance: float) -> float:
    """Smallest outer end of the mesh beyond which what is left out of the interaction amounts to less load than
    `tolerance`.

    The load beyond the mesh is taken into account with the undeformed tip's gap. What is left out is its change by the
    tip's deformation, and the displacement that the pressure out there causes inside. Without contact,
    from within the radius over which the interaction is felt, the load beyond is not known.
    """
    mesh = equations.mesh
    if equations.interaction is None:
        return float(mesh.end)
    length = abs(equations.displacement(fields)) + equations.interaction.range
    carried = np.abs(equations.load_beyond(fields)) * length / np.maximum(length, np.abs(fields.gap))
    response = 2 * (fields.rim.radius + np.sqrt(2 * length))
    left_out = carried + response * mesh.nodes * np.abs(fields.pressure)
    beyond = np.flatnonzero(~(left_out <= tolerance))
    last = int(beyond[-1]) if len(beyond) else -1
    if last + 1 == mesh.size:
        return 1.5 * float(mesh.end)
    least = 0.0 if equations.contact else min(float(mesh.end), felt(equations.tip, equations.interaction))
    return max(float(mesh.nodes[last + 1]) if len(beyond) else float(mesh.edges[1]), least)


def adapted_edges(
    equations: Equations,
    fields: Fields,
    tolerance: float,
    reach: float,
    unit: Mesh,
    within: float = 0.0,
    kept: Sequence[float] = (),
) -> Array:
    """Edges made from the mesh's own: panels with too large an error split, neighbours that one panel would serve
    merged.

    Parameters
    ----------
    tolerance : float
        Sum of `panel_errors` aimed at.
    reach : float
        Outer end wanted; panels beyond are dropped.
    unit : Mesh
        What the mesh was stretched from, whose edges are adapted.
    within : float
        Radius within which panels have to be smooth besides.
    kept : sequence of float
        Edges of `unit` that stay.
    """
    share = tolerance / 6
    edges, stretch = unit.edges, equations.mesh.end / unit.end
    reach /= stretch

    def guide(joined: Array | None = None) -> Array:
        found = panel_errors(equations, fields, joined)
        if within:
            own = equations.mesh.edges if joined is None else joined
            found = np.maximum(found, share * roughness(equations, fields, own, within))
        return found

    errors = guide()
    if reach < SHORTEN * edges[-1]:
        keep = max(1, int(np.searchsorted(edges, reach)))
        edges, errors = edges[: keep + 1], errors[:keep]
    bad = errors > share
    bad |= too_long(edges, unit)
    free = ~np.isin(edges, [*_kept(unit), *kept])
    superfluous = _mergeable(lambda edges: guide(stretch * edges), edges, errors, MERGE * share, unit, free)
    return np.sort(np.concatenate([np.delete(edges, superfluous), cuts(edges, unit)[bad]]))


def too_long(edges: Array, mesh: Mesh, growth: float = BESIDE_EDGES) -> Flags:
    """Whether panels are too long for where they lie: their ends' distances from the rim, or from an edge of regions,
    differ by too large a factor; across such an edge, their lengths do."""
    length = np.diff(edges)
    found = np.append(False, edges[2:] > GROWTH * edges[1:-1])
    for root in mesh.edges[list(mesh.roots)]:
        ends = np.sort(np.abs([edges[:-1] - root, edges[1:] - root]), axis=0)
        beside = ends[0] == 0.0
        found |= ~beside & (ends[1] > growth * ends[0])
        found |= beside & (length > growth * length[beside].min(initial=np.inf))
    return found


def cuts(edges: Array, mesh: Mesh) -> Array:
    """Where panels are cut, graded towards the rim, root edges and, on a mesh that ends there, a tip's edge."""
    length = np.diff(edges)
    found = edges[:-1] + length / 2
    found[0] = GRADING * edges[1]
    if mesh.bounded:
        found[-1] = edges[-1] - GRADING * length[-1]
    roots = mesh.edges[list(mesh.roots)]
    for left in np.flatnonzero(np.isin(edges[:-1], roots)):
        found[left] = edges[left] + GRADING * length[left]
    for right in np.flatnonzero(np.isin(edges[1:], roots)):
        found[right] = edges[right + 1] - GRADING * length[right]
    return found


def _kept(mesh: Mesh) -> Array:
    """Root edges of a mesh, and those without which a panel would end at two of them, or the innermost one at one."""
    rooted = np.isin(np.arange(mesh.panels + 1), [0, *mesh.roots])
    between = np.zeros_like(rooted)
    between[1:-1] = rooted[:-2] & rooted[2:]
    return mesh.edges[rooted | between]


def _mergeable(
    guide: Callable[[Array], Array], edges: Array, errors: Array, share: float, mesh: Mesh, free: Flags
) -> Indices:
    """Free inner edges, no two neighbouring, without which the panels' errors stay below `share`."""
    small = errors < share
    candidates = [k for k in range(1, len(edges) - 1) if small[k - 1] and small[k] and free[k]]
    chosen: list[int] = []
    for k in candidates:
        if chosen and k - chosen[-1] < 2:
            continue
        if k > 1 and edges[k + 1] > GROWTH * edges[k - 1]:
            continue
        if k == 1 and len(edges) > 3 and edges[3] > GROWTH * edges[2]:
            continue
        chosen.append(k)
    if not chosen:
        return np.array([], dtype=np.intp)
    pairs = np.array(chosen)
    joined = np.delete(edges, pairs)
    merged = guide(joined)
    if mesh.roots:
        merged[too_long(joined, mesh)] = math.inf
    places = np.searchsorted(joined, edges[pairs - 1])
    return np.asarray(pairs[merged[places] < share])
