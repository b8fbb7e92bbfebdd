"""States of the axisymmetric model, and the same ones on a lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from followed import Followed

import contbranch as cb
from contbranch.models.axisymmetric.azimuthal import counted, eigenvalues
from contbranch.models.grid.lattice import Lattice
from contbranch.models.grid.newton import Equilibrium, Hold, newton
from contbranch.models.grid.problem import GridProblem


def traced(contact: cb.Contact, accuracy: float = 1e-7) -> Followed:
    return Followed(contact.to_reduced(), accuracy)


def grid_problem(contact: cb.Contact, kind: str, edge: float, grid: int, quarter: bool = True) -> GridProblem:
    reduced = contact.to_reduced()
    lattice = Lattice(kind, (edge, edge), (grid, grid), quarter)
    x = lattice.axes[0][: lattice.inside[0]]
    heights = np.asarray(reduced.tip.height(np.hypot(x[:, None], x)))
    return GridProblem(lattice, lattice.fill(heights), reduced.interaction)


@dataclass(frozen=True)
class Row:
    """A row of an axisymmetric curve."""

    contact: cb.Contact
    traced: Followed
    row: int

    @property
    def load(self) -> float:
        return float(self.traced.curve.branch.load[self.row])

    @property
    def fields(self):
        point = self.traced.points[self.row]
        return self.traced.problem(self.row).fields(point.x, point.parameter)

    @property
    def n_0(self) -> int:
        """Index under displacement control."""
        return int(self.traced.curve.branch.unstable_displacement[self.row])

    @property
    def n_load(self) -> int:
        return int(self.traced.curve.branch.unstable_load[self.row])

    @property
    def azimuthal(self) -> tuple[int, ...]:
        return counted(self.traced.problem(self.row).equations, self.fields, self.n_0).modes

    def eigenvalues(self, m: int, count: int = 1) -> np.ndarray:
        """1 - those of T_m."""
        return 1.0 - eigenvalues(self.traced.problem(self.row).equations, self.fields, m, count)

    def on(self, problem: GridProblem) -> Equilibrium:
        """The equilibrium of a lattice with the same load, by way of that with the same mean of u around the contact.

        At a fold of the load, where the former need not exist, it is the latter.
        """
        lattice = problem.lattice
        equations, fields = self.traced.problem(self.row).equations, self.fields
        r = np.hypot(lattice.axes[0][:, None], lattice.axes[0])
        known = np.hypot(fields.rim.radius, equations.mesh.nodes)
        profile = fields.gap - np.asarray(self.contact.to_reduced().tip.height(known))
        far = self.load / (np.pi * r) - float(self.traced.curve.branch.displacement[self.row])
        u = np.where(r < known[-1], np.interp(r, known, profile), far)
        u = np.where(r <= fields.rim.radius, -problem.heights, u)
        near = (r < max(2.0, 1.5 * fields.rim.radius)) & (r > fields.rim.radius)
        row = near / near.sum()
        found = newton(problem, u, self.load, Hold(float(np.vdot(row, u)), 0.0, row))
        assert found.converged
        assert abs(found.load - self.load) < 0.02 * (1.0 + abs(self.load))
        same = newton(problem, found.u, self.load, Hold(self.load), found.contact)
        return same if same.converged and np.abs(same.u - found.u)[near].max() < 0.1 else found
