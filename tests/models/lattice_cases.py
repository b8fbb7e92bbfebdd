"""Equilibria on lattices for tests, started from what is known about them in closed form."""

from __future__ import annotations

import math

import numpy as np

import contbranch as cb
from contbranch.models.grid.lattice import Lattice
from contbranch.models.grid.newton import Equilibrium, Hold, Settings, hold_control, newton
from contbranch.models.grid.problem import GridProblem


def paraboloid(kind, edge, grid, law=None, *, quarter=True, curvatures=(1.0, 1.0), centre=(0.0, 0.0)) -> GridProblem:
    """A problem with the tip (k₁x² + k₂y²)/2, its apex anywhere in a periodic cell."""
    lattice = Lattice(kind, (edge, edge), (grid, grid), quarter)
    axis = lattice.axes[0][: lattice.inside[0]]
    x, y = ((axis - c + 0.5 * edge) % edge - 0.5 * edge for c in centre)
    heights = 0.5 * (curvatures[0] * x[:, None] ** 2 + curvatures[1] * y[None, :] ** 2)
    return GridProblem(lattice, lattice.fill(heights), law)


def solved(problem: GridProblem, load: float, start=None, tolerance: float = 1e-8) -> Equilibrium:
    """The equilibrium at a load; started flat at the indentation of Hertz, or from a displacement u(r)."""
    if start is None:
        indentation = (0.75 * max(load, 0.1)) ** (2.0 / 3.0)
        u = -np.minimum(np.where(np.isfinite(problem.heights), problem.heights, math.inf), indentation)
    else:
        u = start
    found = newton(problem, u, load, Hold(load), settings=Settings(tolerance=tolerance))
    assert found.converged
    return found


def axisymmetric_start(problem: GridProblem, state) -> np.ndarray:
    """u = g - z of an axisymmetric state, and that of a point force beyond its mesh."""
    axis = problem.lattice.axes[0]
    r = np.hypot(axis[:, None], axis[None, :])
    u = np.interp(r, state.r, state.gap - 0.5 * state.r**2)
    far = r > state.r[-1]
    u[far] = -state.displacement + state.load / (math.pi * r[far])
    return u


def from_axisymmetric(kind, edge, grid, law, tabor, sign, load):
    """An equilibrium on a lattice and the axisymmetric state at the same load, which is exact to 1e-8."""
    state = cb.solve(cb.Contact.reduced(law, tabor, sign), load=load)
    problem = paraboloid(kind, edge, grid, law(float(sign), 1.0 / tabor))
    return problem, solved(problem, load, axisymmetric_start(problem, state)), state


def displaced(problem: GridProblem, near: Equilibrium, displacement: float) -> Equilibrium:
    """The equilibrium at another displacement."""
    u = near.u + (near.displacement - displacement)
    found = newton(problem, u, near.load, hold_control(problem, 0.0, 1.0, displacement))
    assert found.converged
    return found


__all__ = ["axisymmetric_start", "displaced", "from_axisymmetric", "paraboloid", "solved"]
