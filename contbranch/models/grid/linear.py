"""Linear systems of an equilibrium on a lattice: changes of the field and of the load, bordered by what is held.

With the contact nodes A and the free nodes I of a state, the change (δu, δF) solves

    I:  K δu + v″ δu + δF/A = f,      A:  δu = f,      c·δu + ω δF = g.

The unknowns are the change of the pressure y = K δu + δF/A and that of the displacement of the far field δd: with K_d,
which is K but for K̂_d(0) = 1/(C A) (`lattice`), and S = K_d⁻¹, δu = S y - δd, and

    I:  y + v″ (S y - δd) = f,      A:  α (S y - δd) = α f,      (S c + ω a)·y - (Σ c) δd = g      (a: area of a node).

One product costs one pair of transforms. Where the law does not act y = f: the vectors live on the contact and where
v″ ≠ 0, the zone. The equations on clusters of nodes (`clusters`) precondition, and a generalised conjugate residual
method (S. C. Eisenstat, H. C. Elman and M. H. Schultz, SIAM J. Numer. Anal. 20, 345 (1983)) keeps its directions, so
that a second right-hand side begins with the best solution in the space that the first one left behind. SciPy's GMRES
forgets its space, and wants two products of which it makes one here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array, Flags

from .problem import GridProblem

__all__ = ["Border", "Change", "Linear"]

# v″ relative to the largest below which the law does not act, and that down to which clusters are made at once, so that
# they serve on as the film spreads: more squares need not have the symmetry of a state on the whole.
NOTHING, SPARE = 1e-6, 1e-8
# Memory for the directions of one matrix, and how many there is room for at first: fresh memory takes its time.
BASIS_BYTES, FEW = 2e8, 8
# Memory for their displacements on all nodes.
FIELD_BYTES = 1e8
# Part of its length that a direction's image keeps where it need not be made orthogonal twice.
KEPT = 0.5
# Part of the residual by which a direction lowers it at least: otherwise the next one does not begin from it.
STAGNANT = 0.1


class Change(NamedTuple):
    """A solution: δu, δF, the change of the pressure K δu + δF/A, and the relative residual that is left."""

    field: Array
    load: float
    pressure: Array
    residual: float


class Border:
    """What is held, ``c·δu + ω δF = g``, as an equation of the pressure: one pair where c is a field.

    Parameters
    ----------
    problem : GridProblem
    row : array, float or None
        c, a field or one number for all nodes; None: zero.
    load_weight : float
        ω.
    """

    def __init__(self, problem: GridProblem, row: Array | float | None, load_weight: float) -> None:
        self.row, self.load_weight = row, load_weight
        lattice = problem.lattice
        # S c + ω a on all nodes, and -Σ c
        self.along: Array | float = load_weight * lattice.node_area
        self.across = 0.0
        if isinstance(row, float):
            self.along += row * lattice.compliance * lattice.area
            self.across = -row * lattice.size
        elif row is not None:
            self.along += problem.displaced(row)
            self.across = -float(row.sum())

    def product(self, pressure: Array) -> float:
        """The part of a pressure in what is held."""
        if isinstance(self.along, float):
            return self.along * float(pressure.sum())
        return float(np.vdot(self.along, pressure))

    def met(self, change: Change) -> float:
        """What a change does to what is held."""
        row, own = self.row, self.load_weight * change.load
        if row is None:
            return own
        return own + (row * float(change.field.sum()) if isinstance(row, float) else float(np.vdot(row, change.field)))

    def on(self, zone: Flags) -> Array:
        """The entries on the nodes of a zone, and that of δd."""
        return np.append(np.broadcast_to(self.along, zone.shape)[zone], self.across)


class Linear:
    """The bordered matrix at a state, with its preconditioner and the directions found so far.

    Parameters
    ----------
    problem : GridProblem
    stiffness : array
        v″.
    contact : array of bool
    border : Border
    """

    def __init__(self, problem: GridProblem, stiffness: Array, contact: Flags, border: Border) -> None:
        self.problem, self.held = problem, border
        stiffness = np.where(contact, 0.0, stiffness)
        size = np.abs(stiffness)
        spare = NOTHING if problem.mirrored else SPARE
        zone, wider = (contact | (size > part * size.max()) for part in (NOTHING, spare))
        self.clusters = problem.clusters(contact, stiffness, zone, wider)
        self.zone = self.clusters.zone
        self.nodes = np.flatnonzero(self.zone)
        self.contact, self.stiffness = contact.take(self.nodes), stiffness.take(self.nodes)
        entries = border.on(self.zone)
        # What is held is to be met ten times as well.
        self.scale = 10.0 / (float(np.linalg.norm(entries)) or 1.0)
        self.border = self.scale * entries
        self.coarse_border = self.clusters.border(self.border)
        self._forget()

    def _forget(self) -> None:
        size = self.border.size
        self.most = int(max(10, min(200, BASIS_BYTES / (16 * size))))
        self.count = 0
        self.directions, self.images = np.empty((2, FEW, size))
        self.triangle = np.zeros((self.most, self.most))
        # S y on all nodes for every direction, as long as there is room.
        self.moved: list[Array] = []

    def product(self, vector: Array, outside: Array | None = None) -> tuple[Array, Array]:
        """The equations' left sides on the zone, for a pressure there (and outside) and δd, and S y; one pair."""
        y, displacement = vector[:-1], vector[-1]
        everywhere = self.problem.displaced(self._everywhere(y, outside))
        moved = everywhere.take(self.nodes) - displacement
        rows = np.where(self.contact, self.clusters.weight * moved, y + self.stiffness * moved)
        return np.append(rows, self.border @ vector), everywhere

    def _everywhere(self, y: Array, outside: Array | None = None) -> Array:
        """A pressure on the zone as one on all nodes."""
        whole = np.zeros(self.zone.shape) if outside is None else outside.copy()
        whole[self.zone] = y
        return whole

    def solve(
        self, f: Array, g: float, tolerance: float = 1e-9, limit: int = 200, near: Change | None = None
    ) -> Change:
        """Solve for a right-hand side, to a residual relative to it.

        Parameters
        ----------
        f : array
            On all nodes.
        g : float
        tolerance : float
        limit : int
            Products at most.
        near : Change, optional
            What is known to be near the solution.
        """
        problem = self.problem
        outside, right, far, size = self._sized(f, g)
        goal = tolerance * size
        if near is not None:
            own, moved = near.pressure.copy(), near.field.take(self.nodes)
            own.put(self.nodes, np.where(self.contact, moved, own.take(self.nodes) + self.stiffness * moved))
            g -= self.held.met(near)
            outside, right, far, _ = self._sized(f - own, g)
        solution, moved = np.zeros_like(right), np.zeros_like(outside)
        if far > 0.1 * goal:
            right[-1] -= self.scale * self.held.product(outside)
            solution = self._approximate(right)
            rows, moved = self.product(solution, outside)
            right -= rows
            limit -= 1
        else:
            # Left as it is: u and the pressure have to stay those of one state.
            outside[:] = 0.0
        found, more, left = self._reduced(right, goal, limit)
        solution += found
        y = self._everywhere(solution[:-1], outside)
        change = (problem.displaced(y) if more is None else moved + more) - solution[-1]
        load = problem.lattice.node_area * float(y.sum())
        row, weight = self.held.row, self.held.load_weight
        if row is None:
            # Exactly: a uniform pressure moves the far field alone.
            wanted = g / weight
            y += (wanted - load) / problem.lattice.area
            load = wanted
        elif isinstance(row, float):
            missed = g - weight * load - row * float(change.sum())
            if weight > 2.0 * problem.lattice.compliance:  # a soft spring: little pressure, but a long way
                y += missed / (weight * problem.lattice.area)
                load += missed / weight
            else:
                change += missed / (row * change.size)
        if near is not None:
            change, load, y = change + near.field, load + near.load, y + near.pressure
        return Change(change, load, y, left / size if size > 0.0 else 0.0)

    def _sized(self, f: Array, g: float) -> tuple[Array, Array, float, float]:
        """A right-hand side outside the zone and on it, weighted as the equations are, and norms: outside, all."""
        outside = np.where(self.zone, 0.0, f)
        right = np.append(f.take(self.nodes), self.scale * g)
        right[:-1][self.contact] *= self.clusters.weight
        far = float(np.linalg.norm(outside))
        return outside, right, far, math.hypot(float(np.linalg.norm(right)), far)

    def _approximate(self, vector: Array) -> Array:
        return self.clusters.solve(vector, self.coarse_border)

    def _reduced(self, residual: Array, goal: float, limit: int) -> tuple[Array, Array | None, float]:
        """The solution with a small residual, S y for it where that is known, and the residual's norm."""
        solution, forgotten = np.zeros_like(residual), False
        parts = self.images[: self.count] @ residual
        residual = residual - parts @ self.images[: self.count]
        norm, used = float(np.linalg.norm(residual)), 0
        begin = residual
        while norm > goal and np.isfinite(norm) and used < limit:
            if self.count == self.most:
                solution += self._weights(parts) @ self.directions[: self.count]
                self._forget()
                parts, forgotten = np.zeros(0), True
            if not self._extend(begin):
                break
            used += 1
            image = self.images[self.count - 1]
            part = float(image @ residual)
            residual -= part * image
            parts = np.append(parts, part)
            # Where a direction does nothing, the next one is that of a Krylov space.
            begin = residual if abs(part) > STAGNANT * norm else image
            norm = float(np.linalg.norm(residual))
        weights = self._weights(parts)
        moved = None
        if len(self.moved) == self.count and not forgotten:
            moved = np.zeros(self.zone.shape)
            for weight, one in zip(weights, self.moved, strict=True):
                moved += weight * one
        return solution + weights @ self.directions[: self.count], moved, norm

    def _weights(self, parts: Array) -> Array:
        """Of the directions, from those of their images."""
        k = len(parts)
        return np.asarray(np.linalg.solve(self.triangle[:k, :k], parts), np.float64)

    def _extend(self, vector: Array) -> bool:
        """One more direction, preconditioned; False if it adds nothing."""
        k = self.count
        direction = self._approximate(vector)
        image, moved = self.product(direction)
        before = length = float(np.linalg.norm(image))
        for _ in range(2):
            parts = self.images[:k] @ image
            image -= parts @ self.images[:k]
            self.triangle[:k, k] += parts
            last, length = length, float(np.linalg.norm(image))
            if length > KEPT * last:
                break
        if not length > 1e-13 * before:
            return False
        if k == len(self.images):
            self.directions, self.images = np.concatenate([[self.directions, self.images]] * 2, axis=1)
        self.triangle[k, k] = length
        self.directions[k], self.images[k] = direction, image / length
        self.count = k + 1
        if moved.nbytes * self.count <= FIELD_BYTES:
            self.moved.append(moved)
        return True
