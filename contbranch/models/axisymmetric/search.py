"""Equilibria that the traced curve does not reach, by deflated Newton's method at one value of a control."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Linearisation, Problem
from contbranch.continuation.deflation import search
from contbranch.control import Control

from .crossing import Crossing
from .equations import Equations
from .locate import Place, refine
from .mesh import Mesh
from .problem import ContactProblem, ControlReached
from .trace import Traced

__all__ = ["HeldProblem", "disconnected"]

Array = NDArray[np.float64]

# Neighbouring edges of the meshes that are joined for the search differ by this factor at least.
APART = 1.6
ORDER = 10
# Rows of the curve on either side of first touch from which the search starts, and undeformed states besides.
ROWS, BARE = 6, 4
# A gap may be this much below zero, in ranges of the interaction, on the mesh of the search.
PENETRATION = 1e-3
# A state whose error stays above this, relative to max(1, |value|), is one of the mesh and not of the contact.
VAGUE = 1e-3
# A trial step may propose any contact parameter; the gap is sinh of it, which overflows a little above this.
FARTHEST = 700.0
# States closer than this, relative to max(1, |value|), are one.
SAME = 1e-5


class HeldProblem(Problem):
    """R(h, u) = 0 and ``w·(F, d) = p`` for the state (h, u) on one mesh, one side of first touch."""

    def __init__(self, problem: ContactProblem, control: Control) -> None:
        self.problem, self.control = problem, control

    def residual(self, x: Array, p: float) -> Array:
        """Residuals of equilibrium and control, (N + 1,); infinite at a gap beyond all numbers."""
        if not abs(x[-1]) < FARTHEST:
            return np.full_like(x, np.inf)
        fields = self.problem.fields(x[:-1], float(x[-1]))
        equations = self.problem.equations
        held = self.control.weighted(equations.load(fields), equations.displacement(fields)) - p
        return np.append(fields.residual, held)

    def jacobian(self, x: Array, p: float) -> Array:
        """Derivatives with respect to (h, u), (N + 1, N + 1)."""
        problem, equations = self.problem, self.problem.equations
        u = float(x[-1])
        fields = problem.fields(x[:-1], u)
        y_rate = problem.scale * math.cosh(u)
        n = equations.mesh.size
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = equations.jacobian(fields)
        matrix[:n, n] = equations.slopes(fields)[1] * y_rate
        load, displacement = equations.gradients(fields)
        first, second = self.control.weights
        matrix[n, :n] = first * load + second * displacement
        matrix[n, n] = self.control.weighted(*equations.rates(fields, np.zeros(n), y_rate))
        return matrix

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual and Jacobian; the parameter enters the last equation alone."""
        residual = self.residual(x, p)
        if not np.isfinite(residual).all():
            return Linearisation(residual, np.empty((0, 0)), residual)
        derivative = np.zeros_like(residual)
        derivative[-1] = -1.0
        return Linearisation(residual, self.jacobian(x, p), derivative)

    def inner(self, u: Array, v: Array) -> float:
        """∫ h h' dtau over the width of the interaction, in units of its range, plus the product of the parameters."""
        scale = self.problem.scale
        return self.problem.inner(u[:-1], v[:-1]) / (scale**2 * math.sqrt(2 * scale)) + float(u[-1] * v[-1])


def disconnected(
    traced: Traced, known: Sequence[Crossing], control: Control, value: float, accuracy: float
) -> list[Crossing]:
    """Equilibria at a value of a control that are not among the known ones.

    Parameters
    ----------
    traced : Traced
        Where searches start from.
    known : sequence of Crossing
        What the curve has at this value.
    """
    found: list[Crossing] = []
    event = ControlReached(control, control.target(value))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # trial states may be anything
        for contact in (False, True):
            rows = [row for row in range(len(traced.points)) if traced.problem(row).equations.contact == contact]
            if not rows:
                continue
            problem = _search_problem(traced, rows)
            held = HeldProblem(problem, control)
            own = [c for c in known if c.place.problem.equations.contact == contact]
            centres = [_carried(held, crossing, control.target(value)) for crossing in own]
            starts = _starts(traced, rows, problem)
            for x in search(held, control.target(value), centres, starts):
                crossing = _settled(problem, x, event, accuracy)
                if crossing is not None and not any(_same(crossing.place, other.place) for other in [*known, *found]):
                    found.append(crossing)
    return found


def _search_problem(traced: Traced, rows: Sequence[int]) -> ContactProblem:
    """A problem on a mesh that can hold what the rows hold: their edges joined, at a low order."""
    edges = np.unique(np.concatenate([traced.problem(row).equations.mesh.edges[1:] for row in rows]))
    kept = [float(edges[0])]
    for edge in edges[1:]:
        if edge > APART * kept[-1] or edge == edges[-1]:
            kept.append(float(edge))
    model = traced.problem(rows[len(rows) // 2])
    equations = model.equations.on(Mesh(np.array([0.0, *kept]), ORDER))
    return ContactProblem(equations, model.scale, model.resolution)


def _carried(held: HeldProblem, crossing: Crossing, target: float) -> Array:
    """A known state on the mesh of the search."""
    place, mesh = crossing.place, held.problem.equations.mesh
    x = np.append(place.problem.equations.mesh.interpolate(place.x, mesh.nodes), place.u)
    for _ in range(6):
        residual, jacobian, _ = held.linearise(x, target)
        step = np.linalg.solve(jacobian, -residual)
        if not np.isfinite(step).all() or held.inner(step, step) > 0.1:
            break
        x = x + step
    return x


def _starts(traced: Traced, rows: Sequence[int], problem: ContactProblem) -> Iterator[Array]:
    """States of the curve, and states with the pressure that the undeformed tip would feel."""
    mesh = problem.equations.mesh
    for row in sorted({rows[round(k * (len(rows) - 1) / (ROWS - 1))] for k in range(ROWS)}):
        point = traced.points[row]
        own = traced.problem(row).equations.mesh
        yield np.append(own.interpolate(point.x, mesh.nodes), point.parameter)
    ends = sorted(traced.points[row].parameter for row in (rows[0], rows[-1]))
    for k in range(BARE):
        u = ends[0] + (k + 0.5) / BARE * (ends[1] - ends[0])
        bare = np.zeros(mesh.size)
        fields = problem.fields(bare, u)
        felt = mesh.abel @ np.nan_to_num(fields.pressure, posinf=0.0, neginf=0.0)
        yield np.append(felt, u)


def _settled(problem: ContactProblem, x: Array, event: ControlReached, accuracy: float) -> Crossing | None:
    """What was found, to the accuracy asked; None if it is no equilibrium after all."""
    h, u = x[:-1], float(x[-1])
    equations: Equations = problem.equations
    if (u > 0.0) != equations.contact and u != 0.0:
        return None
    if equations.admissibility(problem.fields(h, u), problem.scale) < -PENETRATION:
        return None
    try:
        place = Place(problem, h, u, problem.direction(h, u))
        values, place = refine(place, event, accuracy)
    except (CorrectionError, np.linalg.LinAlgError):
        return None  # an artefact of the coarse mesh: it does not survive refinement
    fields = place.problem.fields(place.x, place.u)
    if (place.u > 0.0) != place.problem.equations.contact and place.u != 0.0:
        return None
    if place.problem.equations.admissibility(fields, place.problem.scale) < -PENETRATION:
        return None
    residual = float(np.abs(fields.residual).max()) if len(fields.residual) else math.inf
    if values.relative_error() > VAGUE:
        return None
    return Crossing(-1, values, place) if residual < 1e-6 * max(1.0, float(np.abs(fields.h).max())) else None


def _same(place: Place, other: Place) -> bool:
    """Whether two states are one."""
    first, second = ((p.problem.equations, p.problem.fields(p.x, p.u)) for p in (place, other))
    values = [(e.load(f), e.displacement(f), f.y) for e, f in (first, second)]
    return all(abs(a - b) <= SAME * max(1.0, abs(a)) for a, b in zip(*values, strict=True))
