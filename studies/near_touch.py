"""The curve close to first touch, or to a fold, with slopes that keep their digits.

Load folds of soft films lie so close to first touch that their loads agree to more digits than a double has. The slope
dF/dq of the load with the order parameter q (the contact radius, or the central gap) does not suffer from that: it is
a small number with small errors, and differences of loads are integrals of it. `kappa.py` and `onset.py` are made of
such slopes. Reduced units throughout; what is used here are the parts of the axisymmetric model, below the public
interface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import contbranch as cb
from contbranch.models.axisymmetric.equations import Fields
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.axisymmetric.trace import Target, trace

__all__ = ["Sample", "Side"]

Array = NDArray[np.float64]

# Errors of load and displacement allowed to the meshes.
TOLERANCE = 1e-13
# Gauss nodes for an integral of the slope; it is smooth in the order parameter.
NODES = 12


@dataclass(frozen=True)
class Sample:
    """One equilibrium: order parameter q, load, displacement, and the slopes of both with q."""

    order: float
    load: float
    displacement: float
    displacement_slope: float
    stiffness: float

    @property
    def load_slope(self) -> float:
        """dF/dq."""
        return self.stiffness * self.displacement_slope


class Side:
    """One side of first touch as functions of the order parameter q ≥ 0, on one mesh.

    Parameters
    ----------
    problem : ContactProblem
        With contact: q is the contact radius. Without: q is the central gap.
    x, u : array (N,), float
        A solution to start from.
    """

    def __init__(self, problem: ContactProblem, x: Array, u: float) -> None:
        self.problem = problem
        self.contact = problem.equations.contact
        self._known = [(u, problem.solve_at(x, u))]

    def coordinate(self, order: float) -> float:
        """Contact coordinate y: a² with contact, −g(0) without."""
        return order * order if self.contact else -order

    def at(self, order: float) -> Sample:
        """The equilibrium at one value of the order parameter."""
        problem = self.problem
        y = self.coordinate(order)
        u = problem.parameter(y)
        u0, x0 = min(self._known, key=lambda known: abs(known[0] - u))
        if u != u0:
            x0 = problem.solve_at(x0 + (u - u0) * problem.direction(x0, u0)[0], u)
            self._known.append((u, x0))
        equations, fields = problem.equations, problem.fields(x0, u)
        # dd/dy is of order one; the stiffness is not, and comes from the response at a fixed rim.
        rate = problem.rates(x0, u, problem.direction(x0, u)[0], 1.0)[1] / (problem.scale * np.cosh(u))
        return Sample(
            order,
            equations.load(fields),
            equations.displacement(fields),
            (2.0 * order if self.contact else -1.0) * rate,
            self._stiffness(fields),
        )

    def stiffness(self, order: float) -> float:
        """dF/dd, which is continuous across first touch."""
        return self.at(order).stiffness

    def _stiffness(self, fields: Fields) -> float:
        """dF/dd = 2 (a + ∫_a^∞ δh dt) with (1 − B k A) δh = −B k s: what the rim and its motion do not enter.

        s is the gap's answer to a rigid motion; algebraic tails of the law add what lies beyond the mesh.
        """
        equations = self.problem.equations
        response = equations.response(fields)
        answer = np.linalg.solve(np.eye(len(response)) + response, response.sum(axis=1))
        beyond = equations._beyond(fields)
        last = float(fields.rim.plane[-1] @ (answer - 1.0))
        load = 2.0 * (fields.rim.radius + float(fields.rim.weights @ answer))
        load += beyond.load_per_displacement - beyond.load_per_gap * last
        return load / (1.0 + beyond.shift_per_displacement - beyond.shift_per_gap * last)

    def rise(self, start: float, stop: float) -> float:
        """F(stop) − F(start), the integral of the slope: exact to the slope's own relative error."""
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = (stop - start) / 2
        return half * float(sum(w * self.at(start + half * (1 + z)).load_slope for z, w in zip(nodes, weights)))

    def finer(self) -> Side:
        """The same side on a mesh whose errors are far smaller."""
        u, x = self._known[-1]
        problem, x = self.problem.on(self.problem.equations.mesh.finer, x, u)
        return Side(problem, x, u)
