"""The equations of a contact on a mesh that moves with the solution: h(tau) against the contact coordinate."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Self

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.continuation import Linearisation
from contbranch.curve.problem import Defect, EquilibriumProblem, Work

from .breakpoints import AstrayError, Breakpoint, EdgeRow, Motion, Row, moved_with
from .equations import RECENT, Equations, Fields
from .layered import LayeredEquations

__all__ = ["MovingContact", "Resolution", "order_for"]

# ln of the largest stretch of a mesh.
FARTHEST = 30.0


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
        Radius over which the interaction is felt, where meshes may move: where a whole curve is followed.
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


@dataclass(eq=False, repr=False)
class MovingContact(EquilibriumProblem):
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
    motion : Motion or None
        With it a state is (h e^(−nσ), σ, b), and h belongs to the mesh of `equations` with its breakpoints moved by b,
        stretched by e^σ; n is its `power`.
    """

    equations: Equations
    scale: float
    resolution: Resolution
    sharpness: float = 1.0
    motion: Motion | None = None

    def __post_init__(self) -> None:
        equations, motion = self.equations, self.motion
        self.mesh = mesh = equations.mesh
        law = equations.interaction
        # Where the film is squeezed out on a ring, round a flat tip, below a bump or at an edge, the central gap may
        # grow again.
        layered = law is not None and math.isfinite(law.wave)
        uneven = self.flat or math.isfinite(equations.tip.table_end)
        self.ordered = not (layered or uneven or (motion is not None and motion.ends))
        weights = mesh.weights if motion is None else motion.weights(mesh)
        self._weights = np.insert(weights, mesh.size, np.zeros(len(equations.resting)))
        self.others = () if motion is None else motion.others
        self._carried = (
            motion.velocities(mesh, equations.contact and not mesh.roots) if motion and self.others else None
        )
        self._placed: list[tuple[Array, Equations]] = []
        self._seen: list[tuple[Array, float, Equations, Fields]] = []
        self._judged: tuple[Array, float, Defect] | None = None  # the last state whose error was estimated
        self._row = math.nan  # parameter of the last row that was resolved
        self.work = self.resolution.work
        self.work.unknowns = max(self.work.unknowns, equations.size)

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
        if self.motion is None:
            return self.equations, self.equations.fields(x, y)
        for state, place, equations, fields in self._seen:
            if state is x and place == y:
                return equations, fields
        n = self.size
        known = next((one[2] for one in self._seen if np.array_equal(one[0][n:], x[n:])), None)
        equations = known or self.placed(x).stretched(self._stretch(x))
        fields = equations.fields(self.growth(x) * x[:n], y)
        self._seen = [(x, y, equations, fields), *self._seen[: RECENT - 1]]
        return equations, fields

    def placed(self, x: Array) -> Equations:
        """The equations on the mesh with its breakpoints where a state has them, before it is stretched."""
        by = x[self.size + 1 :]
        if self._carried is None or not by.any():
            return self.equations
        known = next((one[1] for one in self._placed if np.array_equal(one[0], by)), None)
        if known is None:
            known = self.equations.on(moved_with(self.mesh, self._carried[0], by))
            self._placed = [(by, known), *self._placed[: RECENT - 1]]
        return known

    def growth(self, x: Array) -> float:
        """e^(nσ): what a state grows by where it keeps its shape as the mesh is stretched."""
        return 1.0 if self.motion is None else float(self._stretch(x) ** self.motion.power)

    def _stretch(self, x: Array) -> float:
        sigma = float(x[self.size])
        if not abs(sigma) < FARTHEST:
            raise AstrayError("the leading breakpoint has left the mesh")
        return math.exp(sigma)

    def fields(self, x: Array, u: float) -> Fields:
        """Everything that follows from a state."""
        return self.seen(x, u)[1]

    def residual(self, x: Array, p: float) -> Array:
        """Residual R, (N,), and how far the breakpoints are from their places, (1 + m,); e^(−nσ) times."""
        equations, fields = self.seen(x, p)
        if self.motion is None:
            return fields.residual
        off = [row.off(equations, fields, float(x[self.size])) for row in self.rows]
        return np.append(fields.residual, off) / self.growth(x)

    @cached_property
    def rows(self) -> list[Row | EdgeRow]:
        """The equations of the breakpoints."""
        return [] if self.motion is None else [one.row(self.mesh, self.equations) for one in self.motion.all]

    def jacobian(self, x: Array, p: float) -> Array:
        """dR/dx, (N, N); bordered, where the mesh moves, by what `_border` gives."""
        equations, fields = self.seen(x, p)
        if self.motion is None:
            return equations.jacobian(fields)
        n, (rows, columns, corner) = self.size, self._border(x, p)
        matrix = np.empty((x.size, x.size))
        matrix[:n, :n] = equations.jacobian(fields)
        matrix[n:, :n], matrix[:n, n:], matrix[n:, n:] = rows, columns, corner
        return matrix

    def _border(self, x: Array, p: float) -> tuple[Array, Array, Array]:
        """What borders dR/dh: the derivatives of the breakpoints' equations, (1 + m, N), those with respect to their
        motions, (N, 1 + m), and the corner.

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
        assert self.motion is not None
        n, power = self.size, self.motion.power
        rows = np.array([row.by_state(equations, fields) for row in self.rows])
        corner = np.zeros((len(rows), len(rows)))
        corner[:, 0] = [row.by_stretch(equations, fields, power) for row in self.rows]
        columns = equations.spread(fields, power)[1][:, None]
        if self.others:
            gaps, taken = equations.drift(fields, *self._motion(equations))
            corner[:, 1:] = [row.by_gap(gaps) for row in self.rows]
            columns = np.column_stack([columns, taken.T])
        columns, corner = columns / growth, corner / growth
        columns[:, 0] -= power * residual[:n]
        corner[:, 0] -= power * residual[n:]
        return rows, columns, corner

    def _motion(self, equations: Equations) -> tuple[Array, Array]:
        """Rates of the edges and targets of a mesh with the motions of the others, (m, P + 1) and (m, N + R)."""
        assert self._carried is not None
        stretch = equations.mesh.end / self.mesh.end
        return stretch * self._carried[0], stretch * self._carried[1]

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """dR/du, (N,), and those of the breakpoints' equations."""
        equations, fields = self.seen(x, p)
        residual = equations.slopes(fields)[1]
        if self.motion is not None:
            off = [row.by_coordinate(equations, fields) for row in self.rows]
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
        if self.motion is None:
            return partial(equations.multiplied, fields)
        n, (rows, columns, corner) = self.size, self._border(x, p)
        return lambda v: np.append(equations.multiplied(fields, v[:n]) + columns @ v[n:], rows @ v[:n] + corner @ v[n:])

    def moving(self, x_rate: Array, x: Array) -> Array:
        """The rate of h where it is, (N,), of a direction of states: the mesh moves through it."""
        if self.motion is None:
            return x_rate
        n = self.size
        return self.growth(x) * (x_rate[:n] - self._passing(x) @ x_rate[n:])

    def _passing(self, x: Array) -> Array:
        """Rates of h, as a state has it, with the motions of the breakpoints where nothing changes but the mesh."""
        assert self.motion is not None
        state, placed = x[: self.size], self.placed(x)
        slope, nodes = placed.sloped(state), placed.with_resting(placed.mesh.nodes)
        others = () if self._carried is None else map(placed.with_resting, self._carried[1][:, : self.mesh.size])
        return np.column_stack([nodes * slope - self.motion.power * state, *(rate * slope for rate in others)])

    def following(self, x_rate: Array, x: Array, p: float, p_rate: float) -> Array:
        """The same direction as one that goes with a mesh at rest, with the mesh moving as its breakpoints do."""
        if self.motion is None:
            return x_rate
        n, taken = self.size, self._passing(x)
        rows, _, corner = self._border(x, p)
        off = rows @ x_rate[:n] + self.parameter_derivative(x, p)[n:] * p_rate
        rates = -np.linalg.lstsq(rows @ taken + corner, off)[0]
        return np.append(x_rate[:n] + taken @ rates, rates)

    def still(self, x: Array) -> tuple[Self, Array]:
        """The problem on the mesh of a state, which stays as it is, and the state."""
        if self.motion is None:
            return self, x
        placed, n = self.placed(x), self.size
        equations = placed.on(placed.mesh.stretched(math.exp(float(x[n]))))
        return replace(self, equations=equations, motion=None), self.growth(x) * x[:n]

    def inner(self, u: Array, v: Array) -> float:
        """∫ u v dtau, which does not know the mesh, and the breakpoints' share."""
        return float(self.dual(u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        return self._weights * u

    def direction(self, x: Array, p: float) -> tuple[Array, float]:
        """A tangent of the curve where the parameter is monotone: (dh/du, 1)."""
        rate = np.linalg.solve(self.jacobian(x, p), -self.parameter_derivative(x, p))
        return np.asarray(rate, dtype=np.float64), 1.0

    def others_at(self, x: Array) -> tuple[Breakpoint, ...]:
        """The other breakpoints where a state has them, on its mesh before that is stretched."""
        moved = zip(self.others, x[self.size + 1 :], strict=True)
        return tuple(replace(one, place=one.place + b) for one, b in moved)

    def motion_at(self, x: Array) -> Motion | None:
        """The motion with its other breakpoints where a state has them."""
        if self.motion is None or not self.others:
            return self.motion
        return replace(self.motion, others=self.others_at(x))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.equations.size

    @property
    def flat(self) -> bool:
        """Whether the tip begins flatter than the dish that the film presses into the surface.

        However small, a ring of contact then comes before the disc, whose own slope at first touch means nothing.
        """
        return self.equations.tip.apex_exponent > 2.0

    @property
    def layered(self) -> bool:
        """Whether the body is layered: lengths of its own do not stretch with the mesh."""
        return isinstance(self.equations, LayeredEquations)

    @property
    def kinked(self) -> bool:
        """Whether the law has kinks."""
        return bool(self.equations.kinks)

    @property
    def power(self) -> float:
        """In contact the load has a term of order a³ beside a²: it is smooth in the radius a and not in a^m ~ u."""
        return self.equations.coordinate.power if self.equations.contact else 1.0

    @property
    def beyond_edge(self) -> bool:
        """Without contact the equations go on into u > 0, where the gap would be negative at the centre."""
        return not self.equations.contact
