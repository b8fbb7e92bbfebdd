"""The curve close to first touch and to load folds, with slopes that keep their digits; for kappa.py and onset.py.

Load folds of soft films lie so close to first touch that their loads agree to more digits than a double has. The slope
dF/dq of the load with the order parameter q (the contact radius, or the central gap) does not suffer from that: it is
a small number with a small error, and differences of loads are its integrals. What is used here lies below the public
interface: equilibria of the axisymmetric model on meshes made for this purpose. Reduced units throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import contbranch as cb
from contbranch.contact.interaction_law import Interaction
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.axisymmetric.mesh import Mesh
from contbranch.models.axisymmetric.problem import ContactProblem

__all__ = ["Sample", "Side", "contact_of", "fold_in_contact", "fold_side", "softening", "touch_side"]

Array = NDArray[np.float64]

# Accuracy of the trace that starts things, and tolerance of meshes made for a state away from first touch.
ACCURACY, TOLERANCE = 1e-8, 1e-12
# Panels in units of √(R z0), the width of the interaction zone at first touch; farther out each is half as long again.
PANELS = (0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.3, 4.0)
GROWTH, ORDER = 1.5, 16
# The innermost panel is shorter than this share of the contact radius, and each next one longer by this factor.
SHARE, GRADING = 0.5, 4.0
# Panels for integrals over a half-line.
HALF_LINE = 24
# Gauss nodes for integrals of the slope, which is smooth in q.
NODES = 12


@dataclass(frozen=True)
class Sample:
    """One equilibrium.

    Attributes
    ----------
    order : float
        The order parameter q.
    load, displacement, displacement_slope, stiffness : float
        F, d, dd/dq and dF/dd.
    """

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
        With contact: q is the contact radius a. Without: q is the central gap.
    x, u : array (N,), float
        A solution, to start from.
    """

    def __init__(self, problem: ContactProblem, x: Array, u: float) -> None:
        self.problem = problem
        self.contact = problem.equations.contact
        self._known = [(u, problem.solve_at(x, u))]

    def state(self, order: float) -> tuple[Array, float]:
        """Solution and parameter at q."""
        problem = self.problem
        u = problem.parameter(order * order if self.contact else -order)
        known, x = min(self._known, key=lambda found: abs(found[0] - u))
        if u != known:
            x = problem.solve_at(x + (u - known) * problem.direction(x, known)[0], u)
            self._known.append((u, x))
        return x, u

    def at(self, order: float) -> Sample:
        """The equilibrium at q."""
        problem = self.problem
        x, u = self.state(order)
        equations, fields = problem.equations, problem.fields(x, u)
        # dd/dy (y = a², or −q) is of order one; the stiffness is not, and comes from the response at a fixed rim.
        per_y = problem.rates(x, u, problem.direction(x, u)[0], 1.0)[1] / (problem.scale * np.cosh(u))
        return Sample(
            order,
            equations.load(fields),
            equations.displacement(fields),
            (2.0 * order if self.contact else -1.0) * per_y,
            equations.load_per_displacement(fields),
        )

    def rise(self, start: float, stop: float, count: int = NODES) -> float:
        """F(stop) − F(start) as the integral of the slope, which loses no digits; `count` Gauss nodes."""
        nodes, weights = np.polynomial.legendre.leggauss(count)
        half = (stop - start) / 2
        slopes = [self.at(start + half * (1 + z)).load_slope for z in nodes]
        return half * float(weights @ np.array(slopes))

    def fold(self, low: float, high: float) -> float:
        """The order parameter between two others where dF/dq vanishes."""

        def slope(q: float) -> float:
            return self.at(q).load_slope / (q if self.contact else 1.0)

        return float(brentq(slope, low, high, xtol=1e-14 * high, rtol=1e-14))

    def finer(self) -> Side:
        """The same side on a mesh whose discretisation errors are far smaller."""
        u, x = self._known[-1]
        problem, x = self.problem.on(self.problem.equations.mesh.finer, x, u)
        return Side(problem, x, u)

    def graded(self, radius: float) -> Side:
        """The side in contact, on panels graded down to a contact radius."""
        mesh = self.problem.equations.mesh
        count = max(1, int(np.ceil(np.log(mesh.innermost / (SHARE * radius)) / np.log(GRADING))))
        inner = mesh.innermost * GRADING ** np.arange(-count, 0.0)
        problem = self.problem
        if not self.contact:
            equations = problem.equations.touching(True)
            problem = ContactProblem(equations, problem.scale, problem.resolution, problem.sharpness)
        x, u = self.state(0.0)
        problem, x = problem.on(Mesh(np.concatenate([[0.0], inner, mesh.edges[1:]]), mesh.order), x, u)
        return Side(problem, x, u)

    def remeshed(self, order: float, tolerance: float = TOLERANCE) -> Side:
        """The same side on a mesh made for the state at q."""
        x, u = self.state(order)
        problem, x = self.problem.remeshed(x, u, tolerance)
        return Side(problem, x, u)

    def error(self, order: float) -> float:
        """Discretisation error of load and displacement at q, relative to max(1, |value|)."""
        x, u = self.state(order)
        return self.problem.relative_error(x, u)


def contact_of(law: Interaction) -> cb.Contact:
    """A parabola with a law in reduced units (Σ|Δγ| = 1), whose range is 1/μ_T."""
    return cb.Contact(tip=cb.Parabola(radius=1.0), interaction=law, modulus=1.0)


def followed(contact: cb.Contact) -> Track:
    """The curve of a contact."""
    return trace(Axisymmetric().problem(contact, ACCURACY), Request(ACCURACY, events=False))


def touch_side(contact: cb.Contact) -> Side:
    """The side without contact of first touch."""
    traced = followed(contact)
    point = next(point for point in traced.points if point.parameter == 0.0)
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    problem, x = problem.anchored(None, point.x, 0.0)
    problem = ContactProblem(problem.equations.touching(False), problem.scale, problem.resolution)
    if problem.scale < 1.0:  # panels have to follow a stiff film
        return Side(problem, x, 0.0).remeshed(0.0).remeshed(0.0)
    width = np.sqrt(problem.scale)
    reach = problem.remeshed(x, 0.0, 0.1 * TOLERANCE)[0].equations.mesh.edges[-1] / width
    panels = list(PANELS)
    while panels[-1] < reach:
        panels.append(GROWTH * panels[-1])
    problem, x = problem.on(Mesh(width * np.array(panels), ORDER), x, 0.0)
    return Side(problem, x, 0.0)


def fold_in_contact(side: Side, largest: float = 1.0) -> float | None:
    """Contact radius of the load's minimum, searched from a radius beyond it towards first touch; None without one."""
    radius = largest
    while radius > 1e-14:
        if side.at(radius).load_slope < 0:
            return side.fold(radius, 2 * radius)
        radius /= 2
    return None


def fold_side(contact: cb.Contact) -> tuple[Side, float]:
    """The side in contact at the outermost load fold there, and the fold's contact radius, for any μ_T.

    Raises
    ------
    ValueError
        If the contact has no such fold.
    """
    traced = followed(contact)
    folds = [point for point in traced.points if point.label == "load" and point.parameter > 0.0]
    if not folds:
        raise ValueError("contact: the load has no fold in contact")
    problem = folds[-1].problem
    assert isinstance(problem, ContactProblem)
    radius = problem.fields(folds[-1].x, folds[-1].parameter).rim.radius
    problem, x = problem.anchored(None, folds[-1].x, folds[-1].parameter)
    side = Side(problem, x, folds[-1].parameter).remeshed(radius)
    side = side.remeshed(radius)
    return side, side.fold(0.98 * radius, 1.02 * radius)


@cache
def softening(law: Interaction) -> float:
    """C of the slope at first touch, dF/dd = 2π|f'(0)| μ_T − C μ_T^(5/2), for a law v = ±f(g/z0) with z0 = 1.

    With P = −f' and H(t) = 2 ∫_0^∞ P((t² + u²)/2) du, which is h at first touch of a rigid tip,

        C = 3 ∫_0^∞ [(H(0) − H(t))/t²]² dt > 0.

    Both integrals are done in x = t/(1 + t) with Gauss–Legendre nodes on panels; about eleven digits.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 / HALF_LINE
    x = (half * (2 * np.arange(HALF_LINE)[:, None] + 1 + nodes)).ravel()
    t, w = x / (1 - x), np.tile(half * weights, HALF_LINE) / (1 - x) ** 2

    def transform(start: Array) -> Array:
        return np.asarray(2.0 * (law.evaluate((start[:, None] ** 2 + t**2) / 2).pressure @ w))

    drop = (transform(np.zeros(1)) - transform(t)) / t**2
    return 3.0 * float(w @ drop**2)
