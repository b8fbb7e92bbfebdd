"""The contact as a problem that the continuation can follow: h(tau) against the contact coordinate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import Adaptation, Event, Linearisation, Point, Problem
from contbranch.control import LOAD, Control
from contbranch.errors import ModelError

from .adapt import DefectError, adapted_edges, defect_error, needed_reach, panel_errors
from .equations import Equations, Fields
from .mesh import Mesh
from .slope import load_per_displacement

__all__ = ["ContactProblem", "ControlReached", "FoldEvent", "InadmissibleEvent", "Resolution"]

Array = NDArray[np.float64]

# A new mesh aims below the tolerance by this factor, so that the solution can move on before it must be changed again.
SLACK = 0.06
# A step to a solution whose error exceeds the tolerance by this factor is repeated shorter, so that meshes can follow.
UNRESOLVED = 20.0
# A change of mesh may move the solution by this multiple of its error estimate.
LEAP = 30.0
# Relative to their place in a step, events are located so coarsely while tracing; they are located anew afterwards.
COARSE = 0.03
# From first touch up to this parameter the rate of the load comes from the slope dF/dd, which keeps its digits
# there, unless the displacement all but stands still: its rate must be at least this share of its parts.
TINY, MOVING = 1e-2, 0.1
# Rounds of meshing, solving and judging until a mesh satisfies its own error estimate.
ROUNDS = 6


@dataclass
class Resolution:
    """How fine the meshes of one trace are.

    Attributes
    ----------
    tolerance : float
        Error allowed to load and displacement, relative to max(1, |value|), reduced units.
    order : int
        Nodes a panel.
    """

    tolerance: float
    order: int
    newton: int = 0
    unknowns: int = 0


class ContactProblem(Problem):
    """R(h, y) = 0 with the parameter u, ``y = scale · sinh(u)``, on one side of first touch.

    The parameter is logarithmic far away and in deep contact, and linear within the interaction's range.

    Parameters
    ----------
    equations : Equations
    scale : float
        Range of the interaction.
    resolution : Resolution
    sharpness : float
        Factor by which the panels' own error guide was found too optimistic here.
    """

    def __init__(self, equations: Equations, scale: float, resolution: Resolution, sharpness: float = 1.0) -> None:
        self.equations = equations
        self.scale = scale
        self.resolution = resolution
        self.sharpness = sharpness
        mesh = equations.mesh
        self._weights = mesh.weights
        resolution.unknowns = max(resolution.unknowns, mesh.size)

    def in_contact(self) -> ContactProblem:
        """The same problem on the other side of first touch, with a contact disc."""
        return ContactProblem(self.equations.touching(True), self.scale, self.resolution, self.sharpness)

    # -- the equations ------------------------------------------------------------------------------------------------
    def coordinate(self, u: float) -> float:
        """Contact coordinate y of the parameter."""
        y = self.scale * math.sinh(u)
        return max(y, 0.0) if self.equations.contact else y

    def parameter(self, y: float) -> float:
        """The parameter of a contact coordinate."""
        return math.asinh(y / self.scale)

    def fields(self, x: Array, u: float) -> Fields:
        """Everything that follows from (h, u)."""
        return self.equations.fields(x, self.coordinate(u))

    def residual(self, x: Array, p: float) -> Array:
        """Residual R, (N,)."""
        return self.fields(x, p).residual

    def jacobian(self, x: Array, p: float) -> Array:
        """dR/dh, (N, N)."""
        return self.equations.jacobian(self.fields(x, p))

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """dR/du, (N,)."""
        return self.equations.slopes(self.fields(x, p))[1] * (self.scale * math.cosh(p))

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual and derivatives from one evaluation of the fields."""
        self.resolution.newton += 1
        fields = self.fields(x, p)
        if not fields.finite:
            return Linearisation(fields.residual, np.empty((0, 0)), fields.residual)
        slope = self.equations.slopes(fields)[1] * (self.scale * math.cosh(p))
        return Linearisation(fields.residual, self.equations.jacobian(fields), slope)

    def inner(self, u: Array, v: Array) -> float:
        """∫ u v dtau, which does not know the mesh."""
        return float((self._weights * u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        return self._weights * u

    def direction(self, x: Array, p: float) -> tuple[Array, float]:
        """A tangent of the curve where the parameter is monotone: (dh/du, 1)."""
        rate = np.linalg.solve(self.jacobian(x, p), -self.parameter_derivative(x, p))
        return np.asarray(rate, dtype=np.float64), 1.0

    # -- observables --------------------------------------------------------------------------------------------------
    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """Load, displacement and their error estimates."""
        fields = self.fields(x, p)
        error = self.error(fields)
        if self.relative_error(fields) > UNRESOLVED * self.resolution.tolerance:
            raise ModelError("the mesh does not resolve the solution")  # which repeats the step shorter
        return {
            "load": self.equations.load(fields),
            "displacement": self.equations.displacement(fields),
            "contact_radius": fields.rim.radius,
            "central_gap": 0.0 if self.equations.contact else max(0.0, -fields.y),
            "energy": self.equations.energy(fields),
            "load_error": error.load,
            "displacement_error": error.displacement,
        }

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> tuple[float, float]:
        """Rates of load and displacement along a direction."""
        fields = self.fields(x, p)
        known: list[tuple[Array, float, float, float]] = fields.derived.setdefault("rates", [])
        for direction, p_known, load_rate, displacement_rate in known:
            if direction is x_rate and p_known == p_rate:
                return load_rate, displacement_rate
        y_rate = self.scale * math.cosh(p) * p_rate
        load_rate, displacement_rate = self.equations.rates(fields, x_rate, y_rate)
        if 0.0 <= p < TINY and self.equations.interaction is not None:
            parts = abs(float(self.equations.rim_row @ x_rate))
            if abs(displacement_rate) > MOVING * parts:
                if "slope" not in fields.derived:
                    fields.derived["slope"] = load_per_displacement(self.equations, fields)
                load_rate = fields.derived["slope"] * displacement_rate
        known.append((x_rate, p_rate, load_rate, displacement_rate))
        return load_rate, displacement_rate

    def error(self, fields: Fields) -> DefectError:
        """Discretisation error of a solution."""
        if "error" not in fields.derived:
            fields.derived["error"] = defect_error(self.equations, fields)
        found = fields.derived["error"]
        assert isinstance(found, DefectError)
        return found

    # -- meshes -------------------------------------------------------------------------------------------------------
    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A better mesh where the error estimate exceeds the tolerance, or where far fewer panels would do."""
        fields = self.fields(x, p)
        resolution = self.resolution
        scale = max(1.0, abs(self.equations.load(fields)))
        allowed = resolution.tolerance * scale
        error = self.relative_error(fields)
        reach = needed_reach(self.equations, fields, 0.1 * allowed)
        mesh = self.equations.mesh
        if error <= resolution.tolerance and reach <= mesh.edges[-1]:
            if error > 1e-3 * resolution.tolerance or mesh.panels <= 6:
                return None
            edges = adapted_edges(self.equations, fields, SLACK * allowed / self.sharpness, reach)
            if len(edges) > 0.75 * mesh.panels:
                return None
        problem: ContactProblem = self
        start = x
        for _ in range(ROUNDS):
            expected = problem.error(problem.fields(start, p)).state
            trial, found = problem.remeshed(start, p)
            carried = problem.equations.mesh.interpolate(start, trial.equations.mesh.nodes)
            if not np.abs(found - carried).max() <= LEAP * expected + 1e-6 * self.scale:
                break  # Newton's method has left for another solution
            problem, start = trial, found
            if problem.relative_error(problem.fields(start, p)) <= resolution.tolerance:
                break
        if problem is self:
            return None
        nodes = problem.equations.mesh.nodes
        self.equations.forget()  # its points stay, by the thousand in cascades of layers, but are seldom asked again
        return Adaptation(problem, start, lambda vector: mesh.interpolate(vector, nodes))

    def remeshed(
        self, x: Array, p: float, tolerance: float | None = None, solve: bool = True
    ) -> tuple[ContactProblem, Array]:
        """The problem on a mesh made for this solution, and the solution there (or, unsolved, carried to it)."""
        fields = self.fields(x, p)
        tolerance = self.resolution.tolerance if tolerance is None else tolerance
        allowed = tolerance * max(1.0, abs(self.equations.load(fields)))
        reach = needed_reach(self.equations, fields, 0.03 * allowed)
        end = self.equations.mesh.edges[-1]
        sharpness = self.sharpness
        if reach > end:
            # The solution is not known out there: lengthen first, judge the panels in the next round.
            count = int(np.ceil(np.log2(reach / end)))
            edges = np.append(self.equations.mesh.edges, end * (reach / end) ** (np.arange(1, count + 1) / count))
        else:
            error = self.relative_error(fields)
            guide = float(panel_errors(self.equations, fields).sum()) / max(1.0, abs(self.equations.load(fields)))
            if error > tolerance:
                sharpness = min(max(sharpness, 2 * error / max(guide, 1e-16)), 1e6)
            edges = adapted_edges(self.equations, fields, SLACK * allowed / sharpness, reach)
        return self.on(Mesh(edges, self.resolution.order), x, p, sharpness, solve)

    def on(
        self, mesh: Mesh, x: Array, p: float, sharpness: float | None = None, solve: bool = True
    ) -> tuple[ContactProblem, Array]:
        """The problem on another mesh, and the solution of the same parameter there (or, unsolved, carried to it)."""
        equations = self.equations.on(mesh)
        sharpness = self.sharpness if sharpness is None else sharpness
        problem = ContactProblem(equations, self.scale, self.resolution, sharpness)
        carried = self.equations.mesh.interpolate(x, mesh.nodes)
        return problem, problem.solve_at(carried, p) if solve else carried

    def graded(self, x: Array) -> tuple[ContactProblem, Array]:
        """The problem at first touch with panels graded down to the length on which elasticity answers the
        interaction."""
        mesh = self.equations.mesh
        fields = self.fields(x, 0.0)
        length = 0.5 / max(1.0, float(np.abs(fields.stiffness).max()))
        count = max(1, math.ceil(math.log(mesh.innermost / length) / math.log(4)))
        edges = np.concatenate([[0.0], mesh.innermost * 4.0 ** np.arange(-count, 0), mesh.edges[1:]])
        return self.on(Mesh(edges, self.resolution.order), x, 0.0)

    def solve_at(self, x: Array, p: float, iterations: int = 12) -> Array:
        """Newton's method at a fixed parameter; the best that was reached, whatever that is."""
        best, size = x, math.inf
        for _ in range(iterations):
            self.resolution.newton += 1
            fields = self.fields(x, p)
            if not fields.finite:
                return best
            step = np.linalg.solve(self.equations.jacobian(fields), -fields.residual)
            change = float(np.abs(step).max())
            if change >= 0.7 * size and change < 1e-8 * max(1.0, float(np.abs(x).max())):
                return best  # rounding
            x = x + step
            if not change < 1e3 * max(1.0, size):
                return best
            best, size = x, change
            if change < 1e-13 * max(1.0, float(np.abs(x).max())):
                return best
        return best

    def relative_error(self, fields: Fields) -> float:
        """Discretisation error of a solution relative to max(1, |value|): the larger of load's and displacement's."""
        return self.error(fields).relative(self.equations.load(fields), self.equations.displacement(fields))


@dataclass(frozen=True)
class FoldEvent(Event):
    """Extrema of what is controlled along the curve, from the true tangent."""

    control: Control = LOAD
    name: str = "fold"
    terminal: bool = False
    relative_resolution: float = COARSE  # type: ignore[misc]

    def primitive(self, point: Point) -> float:
        """What is controlled, up to a positive factor."""
        return self.control.weighted(point.observables["load"], point.observables["displacement"])

    def value(self, point: Point) -> float:
        """Its rate along the unit tangent."""
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        rates = problem.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        return self.control.weighted(*rates)


class ControlReached(Event):
    """What is controlled reaches a value; as the end of a trace, `target` may be raised while the curve is followed.

    Parameters
    ----------
    control : Control
        Reduced units.
    target : float
        Value of ``control.weighted(load, displacement)``.
    """

    name = "end"
    terminal = True
    hidden_pairs = False
    relative_resolution = 1e-9

    def __init__(self, control: Control, target: float) -> None:
        self.control = control
        self.target = target

    def value(self, point: Point) -> float:
        """What is controlled minus its target."""
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        equations = problem.equations
        first, second = self.control.weights
        value = first * equations.load(fields) if first else 0.0
        return value + (second * equations.displacement(fields) if second else 0.0) - self.target


@dataclass(frozen=True)
class InadmissibleEvent(Event):
    """The contact set stops being a disc: the gap closes outside the rim, or the wall would have to pull inside."""

    tolerance: float = 1e-3
    name: str = "inadmissible"
    terminal: bool = True
    hidden_pairs: ClassVar[bool] = False
    relative_resolution: ClassVar[float] = COARSE

    def value(self, point: Point) -> float:
        """Smallest gap and wall pressure in units of the interaction's own, plus the tolerance; negative: inadmissible.

        While tracing, the tolerance keeps errors of the discretisation close to the rim from looking like a wall that
        pulls.
        """
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        fields = problem.fields(point.x, point.parameter)
        return problem.equations.admissibility(fields, problem.scale) + self.tolerance
