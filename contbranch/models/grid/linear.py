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

from typing import NamedTuple

import numpy as np
import scipy

from .arrays import Array, Mask
from .clusters import Clusters
from .problem import GridProblem

__all__ = ["Change", "Linear"]

# v″ relative to the largest below which the law does not act.
NOTHING = 1e-7
# Memory for the directions of one matrix.
BASIS_BYTES = 5e8
# Part of the residual by which a direction lowers it at least: otherwise the next one does not begin from it.
STAGNANT = 0.1


class Change(NamedTuple):
    """A solution: δu, δF, the change of the pressure K δu + δF/A, and the relative residual that is left."""

    field: Array
    load: float
    pressure: Array
    residual: float


class Linear:
    """The bordered matrix at a state, with its preconditioner and the directions found so far.

    Parameters
    ----------
    problem : GridProblem
    stiffness : array
        v″.
    contact : array of bool
    row : array, float or None
        c, a field or one number for all nodes; None: zero.
    load_weight : float
        ω.
    """

    def __init__(
        self, problem: GridProblem, stiffness: Array, contact: Mask, row: Array | float | None, load_weight: float
    ) -> None:
        self.problem = problem
        lattice = problem.lattice
        self.contact, self.row, self.load_weight = contact, row, load_weight
        stiffness = np.where(contact, 0.0, stiffness)
        largest = float(np.abs(stiffness).max())
        self.zone = contact | (np.abs(stiffness) > NOTHING * largest)
        self.held, self.stiffness = contact[self.zone], stiffness[self.zone]
        self.weight = 0.5 / lattice.spacing
        self.along, self.across = self._border()
        border = np.append(self.along if isinstance(self.along, float) else self.along[self.zone], self.across)
        if isinstance(self.along, float):
            border = np.append(np.full(self.stiffness.size, self.along), self.across)
        self.scale = 1.0 / (float(np.linalg.norm(border)) or 1.0)
        self.border = self.scale * border
        self.clusters = Clusters(problem.influence, (contact, stiffness, self.zone), self.weight, self.border)
        self._forget()

    def _border(self) -> tuple[Array | float, float]:
        """The last row: S c + ω a on all nodes, and -Σ c."""
        lattice = self.problem.lattice
        own = self.load_weight * lattice.node_area
        if self.row is None:
            return own, 0.0
        if isinstance(self.row, float):
            return own + self.row * lattice.compliance * lattice.area, -self.row * self.contact.size
        return own + self.problem.displaced(self.row), -float(self.row.sum())

    def _forget(self) -> None:
        size = self.border.size
        self.most = int(max(10, min(200, BASIS_BYTES / (16 * size))))
        self.count = 0
        self.directions, self.images = np.empty((2, 8, size))
        self.triangle = np.zeros((self.most, self.most))

    def product(self, y: Array, displacement: float) -> Array:
        """The equations' left sides on the zone for a pressure on all nodes; one pair."""
        moved = self.problem.displaced(y)[self.zone] - displacement
        rows = np.where(self.held, self.weight * moved, y[self.zone] + self.stiffness * moved)
        return np.append(rows, self.border[:-1] @ y[self.zone] + self.border[-1] * displacement)

    def solve(self, f: Array, g: float, tolerance: float = 1e-9, limit: int = 200) -> Change:
        """Solve for a right-hand side, to a residual relative to it.

        Parameters
        ----------
        f : array
            On all nodes.
        g : float
        tolerance : float
        limit : int
            Products at most.
        """
        zone, problem = self.zone, self.problem
        y = np.where(zone, 0.0, f)
        outside = self.along * float(y.sum()) if isinstance(self.along, float) else float(np.vdot(self.along, y))
        right = np.append(np.where(self.held, self.weight, 1.0) * f[zone], self.scale * (g - outside))
        size = float(np.hypot(np.linalg.norm(right), np.linalg.norm(y)))
        goal = tolerance * size
        solution = np.zeros_like(right)
        if np.linalg.norm(y) > 0.1 * goal:
            solution = self.clusters.solve(right)
            y[zone] = solution[:-1]
            right -= self.product(y, solution[-1])
            limit -= 1
        found, left = self._reduced(right, goal, limit)
        solution += found
        y[zone] = solution[:-1]
        change = problem.displaced(y) - solution[-1]
        load = problem.lattice.node_area * float(y.sum())
        if self.row is None:
            # Exactly: a uniform pressure moves the far field alone.
            wanted = g / self.load_weight
            y += (wanted - load) / problem.lattice.area
            load = wanted
        elif isinstance(self.row, float):
            change += (g - self.load_weight * load - self.row * float(change.sum())) / (self.row * change.size)
        return Change(change, load, y, left / size if size > 0.0 else 0.0)

    def _reduced(self, residual: Array, goal: float, limit: int) -> tuple[Array, float]:
        """The solution with a small residual, and that residual's norm."""
        solution = np.zeros_like(residual)
        parts = self.images[: self.count] @ residual
        residual = residual - parts @ self.images[: self.count]
        norm, used = float(np.linalg.norm(residual)), 0
        begin = residual
        while norm > goal and np.isfinite(norm) and used < limit:
            if self.count == self.most:
                solution += self._combined(parts)
                self._forget()
                parts = np.zeros(0)
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
        return solution + self._combined(parts), norm

    def _combined(self, parts: Array) -> Array:
        k = len(parts)
        weights = scipy.linalg.solve_triangular(self.triangle[:k, :k], parts) if k else parts
        return np.asarray(weights @ self.directions[:k])

    def _extend(self, vector: Array) -> bool:
        """One more direction, preconditioned; False if it adds nothing."""
        k = self.count
        if k == len(self.images):
            self.directions, self.images = (
                np.concatenate([a, np.empty_like(a)]) for a in (self.directions, self.images)
            )
        direction = self.clusters.solve(vector)
        y = np.zeros(self.zone.shape)
        y[self.zone] = direction[:-1]
        image = self.product(y, direction[-1])
        before = length = float(np.linalg.norm(image))
        for _ in range(2):
            parts = self.images[:k] @ image
            image -= parts @ self.images[:k]
            self.triangle[:k, k] += parts
            length = float(np.linalg.norm(image))
        if not length > 1e-13 * before:
            return False
        self.triangle[k, k] = length
        self.directions[k], self.images[k] = direction, image / length
        self.count = k + 1
        return True
