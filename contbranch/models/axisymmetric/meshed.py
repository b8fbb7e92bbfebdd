"""The equations of a contact on a mesh that follows the solution: h(tau) against the contact coordinate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from contbranch.contact.contact import Contact
from contbranch.continuation import (
    Adaptation,
    Linearisation,
    Point,
)
from contbranch.continuation.problem import UnresolvedError
from contbranch.curve.problem import (
    Defect,
    EquilibriumProblem,
    Values,
    Work,
)
from contbranch.errors import ModelError
from contbranch.models.fronts import CORE, STIFF
from contbranch.watch import check

from .adapt import Solver, adapted_edges, defect_error, needed_reach, panel_errors, roughness
from .equations import RECENT, Equations, Fields
from .front import Edge, Front, Kink, lifted, steepest
from .marks import SHORTER, creased, located, moved_with, shortened, velocities
from .mesh import Mesh, mesh_on

__all__ = ["MeshedContact", "Resolution", "order_for"]

Array = NDArray[np.float64]

# A new mesh aims below the tolerance by this factor, so that the solution can move on before it must be changed again.
SLACK = 0.06
# A step to a solution whose error exceeds the tolerance by this factor is repeated shorter, so that meshes can follow.
UNRESOLVED = 20.0
# ... unless it is as short as this from one that is resolved, relative to the parameter: errors jump where a node
# passes a tip's end.
JUMP = 1e-4
# A change of mesh may move the solution by this multiple of its error estimate.
LEAP = 30.0
# ... and ln of the stretch by this much.
STRETCHED = 0.1
# What serves no more is also left for a mesh whose load and displacement differ by this multiple of their errors.
SAFETY = 3.0
# A matrix factorised next to a state serves for its error if its answer is wrong by no more than this share.
SIMILAR = 1e-2
# Gaps, in ranges, that no solution has.
DEEPEST = 0.5
# Below this radius parameter meshes are graded down to this share of the radius, each panel longer by this factor than
# the one inside; if those are too many panels, by a larger one: the tinier the radius, the less its scale matters.
SMALL, SHARE, GRADING, PANELS = 1e-2, 0.5, 4.0, 8
# A coarser mesh is worth its while if it has fewer unknowns by this factor; rounds in which it is made.
FEWER, COARSENINGS = 0.8, 4
# Share of the tolerance below which a mesh is made coarser on the way.
FINE = 1e-2
# Rounds of meshing, solving and judging until a mesh satisfies its own error estimate, and the change by Newton's
# method after which the solution is good enough for that: the next one would be its square.
ROUNDS, NEARLY = 6, 1e-5
# The largest factor by which the guide can be too optimistic, and what a further round has to leave of an error then.
SHARPEST, HELPS = 1e6, 0.5
# Unknowns that a state may be given where it is not smooth, and where all panels are halved, since halving some leaves
# more than this share of the error.
MOST, FINEST, WORTH = 1000, 1400, 0.5
# ln of the largest stretch of a mesh; a pivot below this share of its column says that the front alone moves.
FARTHEST, TINY_PIVOT = 30.0, 1e-12
# Edges of panels below this share of the distance to the edge of a tip are kept where the mesh is to end there.
INSIDE = 0.97


@dataclass
class Resolution:
    """How fine the meshes of one trace are, and what it starts from.

    Attributes
    ----------
    tolerance : float
        Error allowed to load and displacement, relative to max(1, |value|), reduced units.
    order : int
        Nodes a panel.
    contact : Contact or None
        In reduced units, where a curve is to be started.
    accuracy : float
        Error allowed to events; the load at the start may be a share of it.
    far : float
        Parameter at which the curve starts.
    moving : float
        Radius over which the interaction is felt, where meshes may move with a front: where a whole curve is followed.
    """

    tolerance: float
    order: int
    contact: Contact | None = None
    accuracy: float = 1e-6
    far: float = -math.inf
    moving: float = 0.0
    work: Work = field(default_factory=Work)


def order_for(tolerance: float) -> int:
    """Nodes a panel for a tolerance: high orders pay when many digits are asked for."""
    return int(min(20, max(8, round(6 - math.log10(tolerance) * 0.8))))


class MeshedContact(EquilibriumProblem):
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
    front : Front, Edge or None
        With it a state is (h e^(−nσ), σ), and h belongs to the mesh of `equations` stretched by e^σ; n is the front's
        `power`.
    """

    def __init__(
        self,
        equations: Equations,
        scale: float,
        resolution: Resolution,
        sharpness: float = 1.0,
        front: Front | Edge | None = None,
    ) -> None:
        self.equations = equations
        self.scale = scale
        self.resolution = resolution
        self.sharpness = sharpness
        self.front = front
        mesh, law = equations.mesh, equations.interaction
        # Where the film is squeezed out on a ring, round a flat tip or at an edge, the central gap may grow again.
        layered = law is not None and math.isfinite(law.wave)
        self.ordered = not (layered or self.flat or isinstance(front, Edge))
        self._weights = mesh.weights if front is None else front.weights(mesh)
        self.marks = () if front is None else front.marks
        self._carried = velocities(self.marks, front.resting, mesh) if front and self.marks else None
        self._placed: list[tuple[Array, Equations]] = []
        self.film = front if front and front.film and equations.softens else None
        self.delicate = self.film is not None
        self._slopes = self.film.slopes(mesh) if self.film else None
        self._seen: list[tuple[Array, float, Equations, Fields]] = []
        self._corrected: tuple[Array, Solver] | None = None
        self._row = math.nan  # parameter of the last row that was resolved
        self.work = resolution.work
        self.work.unknowns = max(self.work.unknowns, mesh.size)

    def coordinate(self, u: float) -> float:
        """Contact coordinate y of the parameter."""
        y = self.scale * math.sinh(u)
        return max(y, 0.0) if self.equations.contact else y

    def parameter(self, y: float) -> float:
        """The parameter of a contact coordinate."""
        return math.asinh(y / self.scale)

    def seen(self, x: Array, u: float) -> tuple[Equations, Fields]:
        """Everything that follows from a state, and the equations on its mesh."""
        y = self.coordinate(u)
        if self.front is None:
            return self.equations, self.equations.fields(x, y)
        for state, place, equations, fields in self._seen:
            if state is x and place == y:
                return equations, fields
        n = self.size
        known = next((one[2] for one in self._seen if np.array_equal(one[0][n:], x[n:])), None)
        equations = known or self.placed(x).stretched(math.exp(min(max(float(x[n]), -FARTHEST), FARTHEST)))
        fields = equations.fields(self.growth(x) * x[:n], y)
        self._seen = [(x, y, equations, fields), *self._seen[: RECENT - 1]]
        return equations, fields

    def placed(self, x: Array) -> Equations:
        """The equations on the mesh with its marks where a state has them, before it is stretched."""
        by = x[self.size + 1 :]
        if self._carried is None or not by.any():
            return self.equations
        known = next((one[1] for one in self._placed if np.array_equal(one[0], by)), None)
        if known is None:
            known = self.equations.on(moved_with(self.equations.mesh, self._carried[0], by))
            self._placed = [(by, known), *self._placed[: RECENT - 1]]
        return known

    def growth(self, x: Array) -> float:
        """e^(nσ): what a state grows by where it keeps its shape as the front moves."""
        if self.front is None:
            return 1.0
        return math.exp(self.front.power * min(max(float(x[self.size]), -FARTHEST), FARTHEST))

    def fields(self, x: Array, u: float) -> Fields:
        """Everything that follows from a state."""
        return self.seen(x, u)[1]

    def residual(self, x: Array, p: float) -> Array:
        """Residual R, (N,), and how far the front and the marks are from their places, (1 + m,); e^(−nσ) times."""
        equations, fields = self.seen(x, p)
        if self.front is None:
            return fields.residual
        off = [self.front.off(self.equations.mesh, equations, fields, float(x[self.size]))]
        off += [float(row @ fields.gap[nodes]) for nodes, row in self._rows]
        return np.append(fields.residual, off) / self.growth(x)

    @cached_property
    def _rows(self) -> list[tuple[slice, Array]]:
        """What says how far marks are off."""
        return [mark.row(self.equations.mesh) for mark in self.marks]

    def jacobian(self, x: Array, p: float) -> Array:
        """dR/dx, (N, N); with a front bordered by the derivatives with respect to σ and those of its equation."""
        equations, fields = self.seen(x, p)
        if self.front is None:
            return equations.jacobian(fields)
        n, (rows, columns, corner) = self.size, self._border(x, p)
        matrix = np.empty((x.size, x.size))
        matrix[:n, :n] = equations.jacobian(fields)
        matrix[n:, :n], matrix[:n, n:], matrix[n:, n:] = rows, columns, corner
        return matrix

    def _border(self, x: Array, p: float) -> tuple[Array, Array, Array]:
        """What borders dR/dh: the derivatives of the equations of front and marks, (1 + m, N), those with respect to
        σ and to the motions of the marks, (N, 1 + m), and the corner.

        At a solution R vanishes between the nodes, too: where they move to, it is what h no longer is there.
        """
        equations, fields = self.seen(x, p)
        if "border" not in fields.derived:
            fields.derived["border"] = self._bordered(equations, fields, self.residual(x, p), self.growth(x))
        rows, columns, corner = fields.derived["border"]
        return rows, columns, corner

    def _bordered(
        self, equations: Equations, fields: Fields, residual: Array, growth: float
    ) -> tuple[Array, Array, Array]:
        assert self.front is not None
        unit, n, count = self.equations.mesh, self.size, 1 + len(self.marks)
        rows, corner = np.empty((count, n)), np.zeros((count, count))
        rows[0], corner[0, 0], _ = self.front.derivatives(unit, equations, fields)
        lift, stretched = equations.spread(fields, self.front.power)
        columns = stretched[:, None]
        for k, (nodes, row) in enumerate(self._rows, 1):
            rows[k], corner[k, 0] = lifted(equations, fields, nodes, row), row @ lift[nodes]
        if self.marks:
            gaps, taken = equations.drift(fields, *self._motion(equations))
            corner[0, 1:] = [self.front.passing(unit, gap) for gap in gaps]
            corner[1:, 1:] = [gaps[:, nodes] @ row for nodes, row in self._rows]
            columns = np.column_stack([stretched, taken.T])
        columns, corner = columns / growth, corner / growth
        columns[:, 0] -= self.front.power * residual[:n]
        corner[:, 0] -= self.front.power * residual[n:]
        return rows, columns, corner

    def _motion(self, equations: Equations) -> tuple[Array, Array]:
        """Rates of the edges and nodes of a mesh with the motions of the marks, (m, P + 1) and (m, N)."""
        assert self._carried is not None
        stretch = equations.mesh.edges[-1] / self.equations.mesh.edges[-1]
        return stretch * self._carried[0], stretch * self._carried[1]

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """dR/du, (N,), and that of the front's equation."""
        equations, fields = self.seen(x, p)
        residual = equations.slopes(fields)[1]
        if self.front is not None:
            off = [self.front.derivatives(self.equations.mesh, equations, fields)[2]]
            off += [float(row @ equations.slopes(fields)[0][nodes]) for nodes, row in self._rows]
            residual = np.append(residual, off) / self.growth(x)
        return residual * (self.scale * math.cosh(p))

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual and derivatives from one evaluation of the fields."""
        self.work.newton += 1
        fields = self.fields(x, p)
        if not fields.finite:
            return Linearisation(fields.residual, np.empty((0, 0)), fields.residual)
        return Linearisation(self.residual(x, p), self.jacobian(x, p), self.parameter_derivative(x, p))

    def product(self, x: Array, p: float) -> Callable[[Array], Array]:
        """What multiplies by dR/dx, without that matrix."""
        equations, fields = self.seen(x, p)
        if self.front is None:
            return partial(equations.multiplied, fields)
        n, (rows, columns, corner) = self.size, self._border(x, p)
        return lambda v: np.append(
            equations.multiplied(fields, v[:n]) + columns @ v[n:], rows @ v[:n] + corner @ v[n:]
        )

    def moving(self, x_rate: Array, x: Array) -> Array:
        """The rate of h where it is, (N,), of a direction of states: the mesh moves through it."""
        if self.front is None:
            return x_rate
        n = self.size
        return self.growth(x) * np.asarray(x_rate[:n] - self._passing(x) @ x_rate[n:])

    def _passing(self, x: Array) -> Array:
        """Rates of h, as a state has it, with σ and the motions of the marks where nothing changes but the mesh."""
        assert self.front is not None
        h, mesh = x[: self.size], self.placed(x).mesh
        slope = mesh.derivative(h)
        marks = () if self._carried is None else self._carried[1]
        return np.column_stack([mesh.nodes * slope - self.front.power * h, *(rate * slope for rate in marks)])

    def following(self, x_rate: Array, x: Array, p: float, p_rate: float) -> Array:
        """The same direction as one that goes with a mesh at rest, with the mesh moving as its front does."""
        if self.front is None:
            return x_rate
        n, taken = self.size, self._passing(x)
        rows, _, corner = self._border(x, p)
        off = rows @ x_rate[:n] + self.parameter_derivative(x, p)[n:] * p_rate
        rates = -np.linalg.lstsq(rows @ taken + corner, off)[0]
        return np.append(x_rate[:n] + taken @ rates, rates)

    def still(self, x: Array) -> tuple[Self, Array]:
        """The problem on the mesh of a state, which stays as it is, and the state."""
        if self.front is None:
            return self, x
        placed, n = self.placed(x), self.size
        equations = placed.on(placed.mesh.stretched(math.exp(float(x[n]))))
        return type(self)(equations, self.scale, self.resolution, self.sharpness), self.growth(x) * x[:n]

    def inner(self, u: Array, v: Array) -> float:
        """∫ u v dtau, which does not know the mesh, and the front's share; in a pressed film also of slopes."""
        return float(self.dual(u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        found = self._weights * u
        if self._slopes is not None:
            mesh = self.equations.mesh
            found[: self.size] += mesh.derivative_dual(self._slopes * mesh.derivative(u[: self.size]))
        return found

    def direction(self, x: Array, p: float) -> tuple[Array, float]:
        """A tangent of the curve where the parameter is monotone: (dh/du, 1)."""
        rate = np.linalg.solve(self.jacobian(x, p), -self.parameter_derivative(x, p))
        return np.asarray(rate, dtype=np.float64), 1.0

    def resolved(self, x: Array, p: float, tolerance: float) -> tuple[Self, Array]:
        """The problem on a mesh that resolves a solution, as far as that succeeds in some rounds, and the solution."""
        problem = self
        for _ in range(ROUNDS):
            if problem.relative_error(x, p) <= tolerance:
                break
            trial, found = problem.remeshed(x, p, tolerance)
            if trial.lost(found, p):
                break
            problem, x = trial, found
        return problem, x

    def lost(self, x: Array, p: float) -> bool:
        """Whether a solution lies where surfaces would have passed through one another, and laws mean nothing."""
        return float(self.fields(x, p).gap.min()) < -DEEPEST * self.scale

    def values(self, x: Array, p: float) -> Values:
        """Load, displacement, contact radius, central gap, energy."""
        equations, fields = self.seen(x, p)
        gap = 0.0 if equations.contact else max(0.0, -fields.y)
        load, displacement = equations.load(fields), equations.displacement(fields)
        return Values(load, displacement, fields.rim.radius, gap, equations.energy(fields))

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """The values, by name, where the mesh resolves them."""
        if self.relative_error(x, p) <= UNRESOLVED * self.resolution.tolerance:
            self._row = p
        elif not abs(p - self._row) < JUMP * abs(p):
            raise UnresolvedError("the mesh does not resolve the solution")
        return self.values(x, p)._asdict()

    def defect(self, point: Point) -> Defect:
        """One Newton step towards the solution on the finer mesh."""
        return self.error(point.x, point.parameter)

    def error(self, x: Array, p: float) -> Defect:
        """Discretisation error of a solution."""
        equations, fields = self.seen(x, p)
        if "error" not in fields.derived:
            solve, slopes = self._solver(x), equations.slopes(fields)[1]
            if solve is not None:
                off = equations.multiplied(fields, solve(slopes)) - slopes
                if not float(np.abs(off).max()) < SIMILAR * float(np.abs(slopes).max()):
                    solve = None  # what was factorised next to the state is not soft alike
            fields.derived["error"] = defect_error(equations, fields, solve)
        found: Defect = fields.derived["error"]
        return found

    def _solver(self, x: Array) -> Solver | None:
        """What solves with dR/dh at the point found last; None at any other."""
        found, solve = self._corrected or (None, None)
        if found is not x or solve is None or self.front is None:
            return solve if found is x else None
        n, solved = self.size, solve
        pushed = np.column_stack([solve(one) for one in np.eye(x.size)[n:]])
        if not float(np.linalg.svd(pushed[n:], compute_uv=False)[-1]) > TINY_PIVOT * float(np.abs(pushed).max()):
            return None

        def held(f: Array) -> Array:  # with the mesh where it is
            answer = solved(np.append(f, np.zeros(x.size - n)))
            return np.asarray(answer[:n] - pushed[:n] @ np.linalg.solve(pushed[n:], answer[n:]))

        return held

    def corrected(self, x: Array, p: float, solve: Solver) -> None:
        """Keep what the next error estimate is made with."""
        self._corrected = x, solve

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A better mesh where the error estimate exceeds the tolerance, or where far fewer panels would do."""
        problem, start = self._refitted(x, p)
        front = problem._fronted(start, p)
        if problem is self and front is self.front:
            return None
        transfer = moved = None
        if front is not problem.front:
            problem, start = problem.anchored(front, start, p)
        if front is not self.front:

            def moved(x: Array, p: float, x_rate: Array, p_rate: float) -> tuple[Array, Array]:
                state, rate = self.carried(x, x, p, problem), self.carried(x_rate, x, p, problem)
                return state, problem.following(rate, state, p, p_rate)

        if front is None is self.front:
            transfer = self.equations.mesh.sampler(problem.equations.mesh.nodes)
        elif not self.marks and (front is self.front or (self.moves and self._as_moved(front))):
            sampler, n = self.equations.mesh.sampler(problem.equations.mesh.nodes), self.size

            def transfer(vector: Array) -> Array:
                return np.append(sampler(vector[:n]), vector[n:])

        self._corrected = None
        self._seen, self._placed = [], []
        self.equations.forget()  # its points stay, by the thousand in cascades of layers, but are seldom asked again
        return Adaptation(problem, start, transfer, moved)

    def _refitted(self, x: Array, p: float) -> tuple[Self, Array]:
        """The problem on a mesh that satisfies the tolerance, if this one does not or is far finer, and the state."""
        equations, fields = self.seen(x, p)
        resolution, mesh = self.resolution, self.placed(x).mesh
        allowed = resolution.tolerance * max(1.0, abs(equations.load(fields)))
        reach = self._reach(equations, fields, 0.1 * allowed)
        error = self.relative_error(x, p)
        served = not self.rough(x, p) and error <= resolution.tolerance and reach <= equations.mesh.edges[-1]
        if served:
            if error > FINE * resolution.tolerance or mesh.panels <= 6:
                return self, x
            sharpness = self._sharpened(x, p, resolution.tolerance)
            edges = adapted_edges(equations, fields, SLACK * allowed / sharpness, reach, mesh, self.within(x, p))
            if len(edges) > 0.75 * mesh.panels:
                return self, x
        problem = self
        start = x
        for _ in range(ROUNDS):
            expected = problem.error(start, p).state
            trial, carried = problem.remeshed(start, p, solve=False)
            found = trial.solve_at(carried, p, enough=NEARLY)  # it is corrected by who asked
            change, told = found - carried, trial.told(problem)
            moves = trial.growth(found) * change[: trial.size], trial.moving(change, found)
            moved = min(float(np.abs(by[told]).max(initial=0.0)) for by in moves)
            lengths = [1.0, *(mark.place for mark in trial.marks)]
            astray = bool((np.abs(change[trial.size :]) > STRETCHED * np.array(lengths)[: x.size - self.size]).any())
            astray = astray or trial.lost(found, p)
            near = moved <= LEAP * expected + 1e-6 * self.scale
            if astray or not (near or (not served and trial._foretold(found, problem, start, p))):
                break  # Newton's method has left for another solution
            problem, start, last, error = trial, found, error, trial.relative_error(found, p)
            spent = problem.sharpness == SHARPEST and error > HELPS * last  # what is left is rounding
            if (error <= resolution.tolerance or spent) and not problem.rough(start, p):
                break
        return (self, x) if served and error > resolution.tolerance else (problem, start)

    def _foretold(self, x: Array, coarse: Self, before: Array, p: float) -> bool:
        """Whether load and displacement differ from those on a coarser mesh by no more than its errors: a steep front
        that moves a little changes the state by much."""
        defect, old, new = coarse.error(before, p), coarse.values(before, p), self.values(x, p)
        return all(
            abs(b - a) <= SAFETY * abs(error) + self.resolution.tolerance * max(1.0, abs(a))
            for a, b, error in zip(old[:2], new[:2], defect[:2], strict=True)
        )

    def within(self, x: Array, p: float) -> float:
        """Radius within which v'' has to be smooth: where a stiff contact may give way, a film as far as it bears much.

        Under a flat tip it is squeezed out next to its edge first.
        """
        equations, fields = self.seen(x, p)
        if not self.film or isinstance(self.film, Edge):
            stiff = float(np.abs(fields.stiffness).max()) * self.resolution.moving > STIFF
            return math.inf if self.film or stiff else 0.0
        return float(equations.mesh.nodes[fields.pressure > CORE * float(fields.pressure.max())].max(initial=0.0))

    def rough(self, x: Array, p: float) -> bool:
        """Whether v'' is not smooth where it has to be."""
        equations, fields = self.seen(x, p)
        within = self.within(x, p)
        return within > 0.0 and bool((roughness(equations, fields, equations.mesh.edges, within) > 1.0).any())

    def told(self, coarse: Self) -> slice:
        """Nodes at which a coarser mesh's panels tell the solution: not next to an edge, where it ends like a root."""
        mesh, own = coarse.equations.mesh, self.equations.mesh
        return slice(int(np.searchsorted(own.nodes, mesh.edges[-2])) if own.bounded else None)

    def _fronted(self, x: Array, p: float) -> Front | Edge | None:
        """What the mesh is to move with at a state: a front and its marks."""
        found = self._led(x, p)
        if found is None or isinstance(found, Kink):
            return found
        (equations, fields), now, known = self.seen(x, p), self.placed(x).mesh, x[self.size + 1 :]
        stretch, same = equations.mesh.edges[-1] / now.edges[-1], self._as_moved(found)
        scale = 1.0 if same else stretch
        followed = [replace(mark, place=mark.place + by) for mark, by in zip(self.marks, known, strict=True)]
        followed = [replace(mark, place=scale * mark.place, half=scale * mark.half) for mark in followed]
        weight = found.weight if isinstance(found, Front) else float(equations.mesh.weights @ fields.h**2)
        marks = creased(equations.mesh, fields, self.scale, found.place, stretch / scale, followed, weight)
        stay = same and {mark.key for mark in marks} == {mark.key for mark in self.marks}
        if stay and not (self.marks and shortened(self.equations.mesh, now.edges) < SHORTER):
            return found if found.marks is self.marks else replace(found, marks=self.marks)
        return replace(found, marks=marks)

    def _led(self, x: Array, p: float) -> Front | Edge | None:
        """The front at a state."""
        equations, fields = self.seen(x, p)
        present = self.front
        if math.isfinite(equations.tip.extent):
            allowed = self.resolution.tolerance * max(1.0, abs(equations.load(fields)))
            if (edge := Edge.needed((equations, fields), allowed, present)) is not None:
                return edge
        if not self.resolution.moving:
            return None if isinstance(present, Edge) else present
        if (kink := Kink.needed((equations, fields), present)) is not None:
            return kink
        if isinstance(present, Edge | Kink):
            present = None
        return steepest((equations, fields), present, self.placed(x).mesh, self.resolution.moving)

    def anchored(self, front: Front | Edge | None, x: Array, p: float) -> tuple[Self, Array]:
        """The problem with another front, or with none, and the state."""
        if front is not None and self._as_moved(front):
            equations, n = self.equations, self.size
            if front.marks is not self.marks:
                equations, x = self.placed(x), np.append(x[: n + 1], np.zeros(len(front.marks)))
            return type(self)(equations, self.scale, self.resolution, self.sharpness, front), x
        still, h = self.still(x)
        edges, ends = still.equations.mesh.edges, isinstance(front, Edge)
        if ends or isinstance(front, Kink) or isinstance(self.front, Edge):
            if isinstance(front, Edge):
                edges = edges[:-1] if still.equations.mesh.bounded else edges[edges < INSIDE * front.place]
                edges = np.append(edges, front.place)
            elif isinstance(front, Kink):
                edges = front.joined(still.equations.mesh, still.fields(h, p))
            mesh = mesh_on(edges, self.resolution.order, bounded=ends)
            h = still.equations.mesh.interpolate(h, mesh.nodes)
            still = still.on_mesh(mesh)
        if front is None:
            return still, h
        start = np.append(h, np.zeros(1 + len(front.marks)))
        return type(self)(still.equations, self.scale, self.resolution, self.sharpness, front), start

    def remeshed(self, x: Array, p: float, tolerance: float | None = None, solve: bool = True) -> tuple[Self, Array]:
        """The problem on a mesh made for this solution, and the solution there (or, unsolved, carried to it)."""
        equations, fields = self.seen(x, p)
        unit, tolerance = self.placed(x).mesh, self.resolution.tolerance if tolerance is None else tolerance
        allowed = tolerance * max(1.0, abs(equations.load(fields)))
        reach = self._reach(equations, fields, 0.03 * allowed)
        end = equations.mesh.edges[-1]
        sharpness = self.sharpness
        if reach > end:
            # The solution is not known out there: lengthen first, judge the panels in the next round.
            count = int(np.ceil(np.log2(reach / end)))
            edges = np.append(unit.edges, unit.edges[-1] * (reach / end) ** (np.arange(1, count + 1) / count))
        else:
            sharpness = self._sharpened(x, p, tolerance)
            edges = adapted_edges(equations, fields, SLACK * allowed / sharpness, reach, unit, self.within(x, p))
        return self.on(mesh_on(edges, self.resolution.order, unit.bounded), x, p, sharpness, solve)

    def _sharpened(self, x: Array, p: float, tolerance: float) -> float:
        """The factor by which the guide is too optimistic here: as it was, or as the error of a state shows."""
        (equations, fields), error = self.seen(x, p), self.relative_error(x, p)
        guide = float(panel_errors(equations, fields).sum()) / max(1.0, abs(equations.load(fields)))
        shown = min(max(2 * error / max(guide, 1e-16), 1.0), SHARPEST)
        return max(self.sharpness, shown) if error > tolerance else min(self.sharpness, shown)

    def _reach(self, equations: Equations, fields: Fields, tolerance: float) -> float:
        """How long the mesh is to be; a kink lies on it."""
        mesh = equations.mesh
        if mesh.bounded:
            return float(mesh.edges[-1])
        kink = self.front.place / self.equations.mesh.edges[-1] if isinstance(self.front, Kink) else 0.0
        return max(needed_reach(equations, fields, tolerance), kink * float(mesh.edges[-1]))

    def on(
        self, mesh: Mesh, x: Array, p: float, sharpness: float | None = None, solve: bool = True
    ) -> tuple[Self, Array]:
        """The problem on another mesh, and the solution of the same parameter there (or, unsolved, carried to it)."""
        problem, n = self.on_mesh(mesh, sharpness), self.size
        tail = x[n:]
        if self.front is not None and self.marks:  # which are at rest where they are
            marks = tuple(replace(mark, place=mark.place + by) for mark, by in zip(self.marks, x[n + 1 :], strict=True))
            problem, tail = problem._with(replace(self.front, marks=marks)), x[n : n + 1]
            tail = np.append(tail, np.zeros(len(marks)))
        carried = np.append(self.placed(x).mesh.interpolate(x[:n], mesh.nodes), tail)
        return problem, problem.solve_at(carried, p) if solve else carried

    def _with(self, front: Front | Edge | None) -> Self:
        """On the same mesh with another front."""
        return type(self)(self.equations, self.scale, self.resolution, self.sharpness, front)

    def on_mesh(self, mesh: Mesh, sharpness: float | None = None) -> Self:
        """The problem on another mesh, with the front where it is."""
        sharpness = self.sharpness if sharpness is None else sharpness
        return type(self)(self.equations.on(mesh), self.scale, self.resolution, sharpness, self.front)

    @property
    def moves(self) -> bool:
        """With a front; what is made for a state on a tip's edge ends there, too, and has its law's kink on an edge."""
        return isinstance(self.front, Front) and not isinstance(self.front, Kink)

    def _as_moved(self, front: Front | Edge | None) -> bool:
        """Whether a state is the same with another front, but for marks: the mesh moves alike."""
        if front is self.front or (isinstance(front, Edge) and isinstance(self.front, Edge)):
            return True
        if not isinstance(front, Front) or isinstance(front, Kink) or not isinstance(self.front, Front):
            return False
        return front.power == self.front.power

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.equations.mesh.size

    def finer(self) -> Self:
        """On panels of higher order."""
        return type(self)(self.equations.finer, self.scale, self.resolution, self.sharpness, self.front)

    def halved(self, point: Point, share: float) -> Self:
        """On panels halved where they do not resolve a state, of the trace's own order."""
        problem, x, u = self, point.x, point.parameter
        goal = max(share * self.relative_error(x, u), self.rounding)
        tried: list[tuple[float, Self]] = []
        for _ in range(ROUNDS):
            problem, x = problem.remeshed(x, u, goal)
            if problem.size > MOST and tried:
                break
            tried.append((problem.relative_error(x, u), problem))
            if tried[-1][0] <= goal:
                break
        (error, best), mesh = min(tried, key=lambda one: one[0]), self.equations.mesh
        if error > WORTH * self.relative_error(point.x, u) and 2 * self.size <= FINEST:
            # What is left is everywhere, as next to the many kinks of a table's derivatives: panels tell nothing of it.
            edges = np.union1d(mesh.edges, (mesh.edges[1:] + mesh.edges[:-1]) / 2)
            return self.on_mesh(mesh_on(edges, self.resolution.order, mesh.bounded))
        return best

    def carried(self, vector: Array, x: Array, p: float, other: EquilibriumProblem) -> Array:
        """A function of tau on another problem's mesh, stretched to have the state at its front."""
        if not isinstance(other, MeshedContact):
            raise TypeError(f"{type(other).__name__} is not a MeshedContact")
        front, n = other.front, self.size
        if front == self.front and not self.marks:
            return np.append(self.equations.mesh.interpolate(vector[:n], other.equations.mesh.nodes), vector[n:])
        equations, fields = self.seen(x, p)
        function = fields.h if vector is x else self.moving(vector, x)
        if front is None:
            return equations.mesh.interpolate(function, other.equations.mesh.nodes)
        kept = self.front is not None and (front.place, front.power) == (self.front.place, self.front.power)
        shift = float(x[n]) if kept else front.anchored(equations, fields)
        places = {mark.key: mark.place + by for mark, by in zip(self.marks, x[n + 1 :], strict=True)}
        stretch = equations.mesh.edges[-1] / self.equations.mesh.edges[-1]
        by = [
            (
                places[mark.key] * stretch
                if mark.key in places
                else located(equations.mesh, fields.gap, math.exp(shift) * mark.place, math.exp(shift) * mark.half)
            )
            / math.exp(shift)
            - mark.place
            for mark in front.marks
        ]
        state = np.concatenate([np.zeros(other.size), [shift], by])
        nodes = other.placed(state).mesh.nodes
        found = equations.mesh.interpolate(function, math.exp(shift) * nodes)
        return np.append(math.exp(-front.power * shift) * found, state[other.size :] * float(vector is x))

    def joins(self, other: EquilibriumProblem) -> bool:
        """Either side of first touch is a representation of its own."""
        return isinstance(other, MeshedContact) and other.equations.contact == self.equations.contact

    def resolving(self, point: Point, tolerance: float) -> Self:
        """A mesh made for a state; in a tiny contact with panels graded down to its radius.

        The gap's answer s = (2/π) arccos(a/r) to a rigid motion varies on the scale of the radius a; on panels far
        longer the radius of a fold has a relative error that further panels farther out do not cure.
        """
        if self.moves or self.marks:
            still, h = self.still(point.x)
            if edge := Edge.needed(still.seen(h, point.parameter), tolerance):
                still, h = still.anchored(edge, h, point.parameter)
            return still.resolving(replace(point, problem=still, x=h), tolerance)
        x, u = point.x, point.parameter
        if self.relative_error(x, u) > tolerance:
            return self.remeshed(x, u, tolerance, solve=False)[0]
        mesh = self.equations.mesh
        length = SHARE * self.equations.coordinate.radius(self.coordinate(u)) if 0.0 < u < SMALL else 0.0
        if not (self.equations.contact and 0.0 < length < mesh.innermost / GRADING):
            return self
        count = min(PANELS, math.ceil(math.log(mesh.innermost / length) / math.log(GRADING)))
        inner = mesh.innermost * (length / mesh.innermost) ** (np.arange(count, 0, -1) / count)
        return self.on_mesh(mesh_on(np.concatenate([[0.0], inner, mesh.edges[1:]]), mesh.order, mesh.bounded))

    def coarser(self, point: Point, tolerance: float) -> Self:
        """A mesh with clearly fewer nodes that serves a tolerance."""
        problem, x = self, point.x
        for _ in range(COARSENINGS):
            problem, x = problem.remeshed(x, point.parameter, tolerance)
            if problem.size > FEWER * self.size:
                break
            if problem.relative_error(x, point.parameter) <= tolerance:
                return problem
        return self

    @property
    def power(self) -> float:
        """In contact the load has a term of order a³ beside a²: it is smooth in the radius a and not in a^m ~ u."""
        return self.equations.coordinate.power if self.equations.contact else 1.0

    @property
    def beyond_edge(self) -> bool:
        """Without contact the equations go on into u > 0, where the gap would be negative at the centre."""
        return not self.equations.contact

    @property
    def flat(self) -> bool:
        """Whether the tip begins flatter than the dish that the film presses into the surface.

        However small, a ring of contact then comes before the disc, whose own slope at first touch means nothing.
        """
        return self.equations.tip.apex_exponent > 2.0

    def solve_at(self, x: Array, p: float, iterations: int = 12, enough: float = 1e-13) -> Array:
        """Newton's method at a fixed parameter, up to a relative change that is enough; the best that was reached."""
        best, size = x, math.inf
        for _ in range(iterations):
            check()
            self.work.newton += 1
            try:
                fields = self.fields(x, p)
            except ModelError:  # marks that leave the mesh
                return best
            if not fields.finite:
                return best
            solve = partial(_solved, *lapack.dgetrf(self.jacobian(x, p).T, overwrite_a=1)[:2])
            step = solve(-self.residual(x, p))
            change = float(np.abs(step).max())
            if change >= 0.7 * size and change < 1e-8 * max(1.0, float(np.abs(x).max())):
                return best  # rounding
            x = x + step
            self.corrected(x, p, solve)
            if not change < 1e3 * max(1.0, size):
                return best
            best, size = x, change
            if change < enough * max(1.0, float(np.abs(x).max())):
                return best
        return best

    def relative_error(self, x: Array, p: float) -> float:
        """Discretisation error of a solution relative to max(1, |value|): the larger of load's and displacement's."""
        equations, fields = self.seen(x, p)
        if "relative" not in fields.derived:
            load, displacement = equations.load(fields), equations.displacement(fields)
            fields.derived["relative"] = self.error(x, p).relative(Values(load, displacement, 0.0, 0.0, 0.0))
        return float(fields.derived["relative"])


def _solved(factors: Array, pivots: Array, f: Array) -> Array:
    """Solve with a matrix whose transposed one is factorised: LAPACK stores by columns."""
    return np.asarray(lapack.dgetrs(factors, pivots, f, trans=1)[0])
