"""Equilibrium of a contact with given regions, as a problem that the continuation can follow.

Unknowns are the pressure at the nodes and the edges of the regions; the parameter is the displacement d, counted from
an origin at which the undeformed apex is at a level of the gap: next to there weak films of long range begin.

    g = z − d + W p,        floating:  p = p_fr(g),        resting:  g = level,
    at every edge:          p = p_fr(level), the law's pressure in the floating region next to it.

The last equation says that the pressure is bounded (and with it continuous) at an edge; it determines the edge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from contbranch.arrays import Array, Flags, Indices
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.tips import Tip
from contbranch.continuation import Linearisation, Point
from contbranch.continuation.metric import Metric
from contbranch.curve.problem import EquilibriumProblem, Rates, Values, Work
from contbranch.errors import ModelError

from .law import BandedLaw
from .layout import Layout
from .panels import Grid, Panels

if TYPE_CHECKING:
    from .disc import Disc

__all__ = ["NARROW_RING", "Fields", "RingEquations", "Setting", "rings"]

# States whose fields are kept: the ends of a step and what is tried between them.
RECENT = 6
# Panels of the rows need not be as fine as those of the events, which are refined.
ROW_TOLERANCE = 1e-7
# A jump takes the place of a resting ring between two bands when that has become this narrow, as a share of its radius:
# it leaves out a tenth of the square, measured against the closed form.
NARROW_RING = 3e-5
# Parts of a panel for integrals over the gap of a tip.
PARTS = 8
# Displacements are measured in this share of the tip's height at the outermost edge at least.
TALL = 1e-3
# Nodes between those on both sides of a front that tell whether the gap rises there.
AROUND = 2
# Stiffness of a film times the radius of the contact from which on its pressure tells its gap.
FIRM = 30.0
# Halvings of an interval that leave a radius to rounding.
HALVINGS = 50


@dataclass(frozen=True)
class Setting:
    """A contact in reduced units, and what is counted over a whole curve.

    Attributes
    ----------
    tip : Tip
    law : BandedLaw
    accuracy : float
        Error allowed to every event, relative to max(1, |value|).
    work : Work
    regained : callable or None
        What takes over where there is one disc of contact, or none: the point of another model, from a `Disc`.
    """

    tip: Tip
    law: BandedLaw
    accuracy: float
    work: Work = field(default_factory=Work)
    regained: Callable[[Disc], Point] | None = field(default=None, compare=False)

    @property
    def tolerance(self) -> float:
        """Error allowed to rows."""
        return min(ROW_TOLERANCE, 10 * self.accuracy)

    @property
    def scale(self) -> float:
        """The shortest range of the interaction."""
        return min((term.range for term in terms_of(self.law.interaction)), default=1.0)


@dataclass(frozen=True)
class Fields:
    """All that follows from one (x, d), at the nodes."""

    x: Array
    parameter: float
    grid: Grid
    pressure: Array
    lift: Array  # elastic displacement w
    rise: Array  # z + w − p: the gap, and the origin of the displacement
    gap: Array
    law_pressure: Array  # floating regions' law; 0 where the gap rests
    stiffness: Array  # v'' there
    response: Array
    derived: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)


@dataclass(eq=False, repr=False)
class RingEquations(EquilibriumProblem):
    """R(p, e; d) = 0 for one layout on one set of panels.

    Parameters
    ----------
    setting : Setting
    layout : Layout
    panels : Panels
    vanishing : tuple of float
        Widths in shares of the outermost edge at which regions vanish on this piece of the curve; 0: never.
    origin : float
        Displacement at which the parameter is zero.
    leaves : bool
        Whether `Setting.regained` is to take over as soon as that is safe.
    """

    setting: Setting
    layout: Layout
    panels: Panels
    vanishing: tuple[float, ...] = ()
    origin: float = 0.0
    leaves: bool = False

    def __post_init__(self) -> None:
        setting = self.setting
        self.tip, self.law, self.scale, self.work = setting.tip, setting.law, setting.scale, setting.work
        self._recent: list[Fields] = []

    @property
    def edges(self) -> int:
        """Number of unknown radii: the edges, and the front."""
        return self.layout.edges + (self.panels.front > 0)

    @property
    def free(self) -> int:
        """How many edges can move."""
        return self.layout.edges - self.layout.whole

    # -- the equations ------------------------------------------------------------------------------------------------
    def fields(self, x: Array, p: float) -> Fields:
        """Grid, gap and pressures of (x, p).

        Raises
        ------
        ModelError
            If the edges are not in order, or the gap does not rise at the front, which the continuation answers by a
            shorter step.
        """
        for known in self._recent:
            if known.parameter == p and (known.x is x or np.array_equal(known.x, x)):
                return known
        same = next((k for k in self._recent if np.array_equal(k.x, x)), None)
        count = self.edges
        pressure, edges = x[: x.size - count], x[x.size - count :]
        if same is not None:
            grid, response, lift = same.grid, same.response, same.lift
        else:
            inside = self.layout.whole or not count or edges[-1] < self.tip.extent
            if count and not (edges[0] > 0 and np.all(np.diff(edges) > 0) and inside):
                raise ModelError("the edges of the contact are not in order")
            if self._recent:
                self._recent[0].grid.forget()
            grid = Grid(self.panels, edges, self.layout.bounded)
            response = grid.response()
            lift = response @ pressure
        rise = self.tip.height(grid.r) + lift - p
        gap = rise - self.origin
        if self.panels.front:  # where the gap comes to rest there, its place would turn round, and with it the curve
            outside = int(grid.r.searchsorted(edges[-1]))
            if not gap[outside + AROUND] > gap[outside - 1 - AROUND]:
                raise ModelError("the gap does not rise at the front")
        law_pressure, stiffness = np.zeros(grid.size), np.zeros(grid.size)
        for k, region in enumerate(self.layout.regions):
            if not region.rests:
                own = grid.of_node == k
                answer = self.law.evaluate(region.index, gap[own])
                law_pressure[own], stiffness[own] = answer.pressure, answer.stiffness
        found = Fields(x, p, grid, pressure, lift, rise, gap, law_pressure, stiffness, response)
        self._recent = [found, *self._recent[: RECENT - 1]]
        return found

    def forget(self) -> None:
        """Drop what has been kept to save work, matrices mostly; it is made again when it is asked for."""
        self._recent = []

    def resting(self, grid: Grid) -> tuple[Flags, Array]:
        """Which nodes rest, and their levels."""
        levels = [self.law.levels[region.index] if region.rests else 0.0 for region in self.layout.regions]
        rests = [region.rests for region in self.layout.regions]
        return np.array(rests)[grid.of_node], np.array(levels)[grid.of_node]

    def _edges(self, fields: Fields) -> tuple[Array, Array, Array, Array]:
        """Equations of the edges: residuals (E,), and their derivatives with respect to pressures, edges and d.

        Next to a resting region the pressure, extrapolated to the edge, is the floating region's; at a jump the gap is
        the level's, and its own at a front; the edge of the tip stays where it is.
        """
        grid, count, law = fields.grid, self.edges, self.law
        residual, rows = np.zeros(count), np.zeros((count, grid.size))
        moves, shifts = np.zeros((count, count)), np.zeros(count)
        for edge in range(count):
            front = edge == self.layout.edges
            if self.layout.ends(edge):
                residual[edge], moves[edge, edge] = grid.edges[edge] - self.tip.extent, 1.0
            elif front or self.layout.jump(edge):
                radius = np.float64(grid.anchors[edge])
                rows[edge], moves[edge] = grid.at_edge(edge, fields.pressure)
                level = self.panels.front if front else law.levels[self.layout.jump_level(edge)]
                rise = float(self.tip.height(radius)) + float(rows[edge] @ fields.pressure) - fields.parameter
                residual[edge] = rise - (level + self.origin)
                moves[edge, edge] += float(self.tip.height_derivative(radius))
                shifts[edge] = -1.0
            else:
                side, floating = self.layout.neighbour(edge)
                panels = np.flatnonzero(grid.region == edge + side)
                rows[edge] = grid.at_end(int(panels[-1] if side == 0 else panels[0]), outer=side == 0)
                wanted = law.pressure(floating.index, self.layout.resting(edge).index)
                residual[edge] = float(rows[edge] @ fields.pressure) - wanted
        return residual, rows, moves, shifts

    def _edge_equations(self, fields: Fields) -> tuple[Array, Array, Array, Array]:
        if "edges" not in fields.derived:
            fields.derived["edges"] = self._edges(fields)
        found: tuple[Array, Array, Array, Array] = fields.derived["edges"]
        return found

    def residual(self, x: Array, p: float) -> Array:
        """Residual, (N + E,)."""
        fields = self.fields(x, p)
        return np.concatenate([self._nodes(fields)[0], self._edge_equations(fields)[0]])

    def _nodes(self, fields: Fields) -> tuple[Array, Array, Array]:
        """Equations of the nodes: residuals, and their derivatives with respect to the gap and the pressure, (N,) each.

        A gap rests at its level. A floating one gives the law's pressure; where that is so stiff that a pressure,
        which is smooth, tells a gap better than the gap, a small difference of large lengths, tells the pressure, the
        gap is the one that the pressure asks for.
        """
        if "nodes" not in fields.derived:
            rests, level = self.resting(fields.grid)
            residual = np.where(rests, fields.rise - (level + self.origin), fields.pressure - fields.law_pressure)
            by_gap, by_pressure = np.where(rests, 1.0, fields.stiffness), np.where(rests, 0.0, 1.0)
            reach = float(fields.grid.edges[-1]) if len(fields.grid.edges) else 1.0
            for k, region in enumerate(self.layout.regions):
                firm = np.flatnonzero((fields.grid.of_node == k) & (fields.stiffness * reach > FIRM))
                if region.rests or not firm.size:
                    continue
                gap, stiffness = self.law.gap(region.index, fields.pressure[firm], fields.gap[firm])
                found = stiffness > 0.0
                firm = firm[found]
                residual[firm] = fields.gap[firm] - gap[found]
                by_gap[firm], by_pressure[firm] = 1.0, 1.0 / stiffness[found]
            fields.derived["nodes"] = residual, by_gap, by_pressure
        nodes: tuple[Array, Array, Array] = fields.derived["nodes"]
        return nodes

    def jacobian(self, x: Array, p: float) -> Array:
        """dR/dx, (N + E, N + E)."""
        fields = self.fields(x, p)
        n, count = fields.grid.size, self.edges
        _, factor, own = self._nodes(fields)
        matrix = np.empty((n + count, n + count))
        np.multiply(factor[:, None], fields.response, out=matrix[:n, :n])
        matrix.flat[: n * (n + count) : n + count + 1] += own
        matrix[:n, n:] = factor[:, None] * self._gap_moves(fields)
        _, matrix[n:, :n], matrix[n:, n:], _ = self._edge_equations(fields)
        return matrix

    def _gap_moves(self, fields: Fields) -> Array:
        """d(gap at the nodes)/d(edges), the nodes moving with the edges, (N, E)."""
        grid = fields.grid
        moves = grid.moved(fields.pressure)
        slope = self.tip.height_derivative(grid.r)
        for edge in range(self.edges):
            moves[:, edge] += slope * grid.motion(edge)[0]
        return moves

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """dR/dd, (N + E,)."""
        fields = self.fields(x, p)
        return np.concatenate([-self._nodes(fields)[1], self._edge_equations(fields)[3]])

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual and derivatives, counted."""
        self.work.newton += 1
        self.work.unknowns = max(self.work.unknowns, x.size)
        return super().linearise(x, p)

    # -- lengths ------------------------------------------------------------------------------------------------------
    def _weights(self, size: int) -> Array:
        """Weights of the inner product: all nodes alike, and the edges as all nodes together, but for that of a tip."""
        nodes = size - self.edges
        weights = np.ones(size)
        weights[:nodes] = 1.0 / max(nodes, 1)
        weights[nodes + self.free : nodes + self.layout.edges] = 0.0
        return weights

    def inner(self, u: Array, v: Array) -> float:
        """Mean of the products of pressures, plus the products of edges: meshes graded alike measure alike."""
        return float((self._weights(u.size) * u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        return self._weights(u.size) * u

    def metric(self, x: Array) -> Metric:
        """Lengths relative to the state (without pressure: to one), and to the range or a share of a tip's height."""
        tall = TALL * float(self.tip.height(x[-1])) if self.edges else 0.0
        return Metric(math.sqrt(self.inner(x, x)) or 1.0, max(self.scale, tall))

    # -- observables --------------------------------------------------------------------------------------------------
    def load(self, fields: Fields) -> float:
        """F = 2π ∫ p r dr."""
        grid = fields.grid
        return 2 * math.pi * float((grid.weights * grid.r) @ fields.pressure)

    def energy(self, fields: Fields) -> float:
        """V_ela + V_fr = π ∫ p w r dr + 2π ∫ v r dr."""
        grid = fields.grid
        return math.pi * float((grid.weights * grid.r) @ (fields.pressure * fields.lift)) + self.interaction(fields)

    def interaction(self, fields: Fields) -> float:
        """V_fr, the law's tail included; where the pressure is constant, panels know nothing of a rough tip's gap."""
        grid, law = fields.grid, self.law
        radius, area, values = grid.divided(PARTS)
        total = 0.0
        for k, region in enumerate(self.layout.regions):
            own = grid.region == k
            if region.rests:
                total += law.energy(region.index) * float(area[own].sum())
            else:
                lift = fields.lift.reshape(grid.count, -1)[own] @ values
                gap = self.tip.height(radius[own]) + lift - (fields.parameter + self.origin)
                total += float((area[own] * law.evaluate(region.index, gap).energy).sum())
        return total

    def _wall_edge(self) -> int | None:
        """The outermost edge of the contact with the wall."""
        walls = [k for k, region in enumerate(self.layout.regions) if region.rests and region.index == 0]
        return walls[-1] if walls else None

    def contact_radius(self, fields: Fields) -> float:
        """Outermost edge of the contact with the wall; 0 without."""
        wall = self._wall_edge()
        return 0.0 if wall is None else float(fields.grid.edges[wall])

    def central_gap(self, fields: Fields) -> float:
        """Gap at r = 0."""
        first = self.layout.regions[0]
        if first.rests:
            return self.law.levels[first.index]
        return self.apex(fields) - self.origin

    def apex(self, fields: Fields) -> float:
        """`Fields.rise` at r = 0, where the ring integral is 2 ∫ p ds."""
        lift = 2 * float(fields.grid.weights @ fields.pressure)
        return float(self.tip.height(np.float64(0.0))) + lift - fields.parameter

    def rise_at(self, fields: Fields, r: Array) -> Array:
        """`Fields.rise` at any radii above zero."""
        return self.tip.height(r) + fields.grid.lift_at(r, fields.pressure) - fields.parameter

    def ends(self, edges: Array) -> Array:
        """Where regions end: at the edges and, if nothing is felt beyond them, where the tip ends."""
        free = self.layout.bounded and not self.layout.whole and math.isfinite(self.tip.extent)
        return np.append(edges, self.tip.extent) if free else edges

    def widths(self, edges: Array) -> Array:
        """Widths of the regions that end somewhere."""
        return np.diff(self.ends(edges), prepend=0.0)

    def values(self, x: Array, p: float) -> Values:
        """Load, displacement, contact radius, central gap, energy."""
        fields = self.fields(x, p)
        radius, gap = self.contact_radius(fields), max(self.central_gap(fields), 0.0)
        return Values(self.load(fields), float(p) + self.origin, radius, gap, self.energy(fields))

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Derivatives of load, displacement, contact radius and central gap along a direction."""
        fields, n = self.fields(x, p), x.size - self.edges
        wall = self._wall_edge()
        gap, weights = 0.0, fields.grid.weights
        if not self.layout.regions[0].rests:
            gap = 2 * float(weights @ x_rate[:n]) - p_rate
            for edge in range(self.edges):  # panels are stretched, and the weights of ∫ p dr with them
                gap += 2 * float((weights * fields.grid.motion(edge)[1]) @ fields.pressure) * float(x_rate[n + edge])
        radius = 0.0 if wall is None else float(x_rate[n + wall])
        return Rates(self.load_rate(fields, x_rate), float(p_rate), radius, gap)

    def load_rate(self, fields: Fields, x_rate: Array) -> float:
        """Rate of the load along a direction."""
        grid = fields.grid
        n = grid.size
        rate = float((grid.weights * grid.r) @ x_rate[:n])
        for edge in range(self.edges):
            shift, stretch = grid.motion(edge)
            rate += float((grid.weights * (shift + grid.r * stretch)) @ fields.pressure) * x_rate[n + edge]
        return 2 * math.pi * rate

    # -- other regions and panels -------------------------------------------------------------------------------------
    def on(self, panels: Panels) -> Self:
        """The same regions on other panels."""
        return replace(self, panels=panels)

    def laid_out(
        self, layout: Layout, panels: Panels, vanishing: tuple[float, ...] = (), origin: float | None = None
    ) -> Self:
        """The same contact with other regions, and another origin."""
        return type(self)(self.setting, layout, panels, vanishing, self.origin if origin is None else origin)

    def joins(self, other: EquilibriumProblem) -> bool:
        """Whether the regions are the same."""
        same = isinstance(other, RingEquations) and (other.layout, other.origin) == (self.layout, self.origin)
        return bool(same)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        outer = 0 if self.layout.bounded else len(self.panels.outer) + self.panels.infinite
        return self.panels.order * (sum(len(piece) + 1 for piece in self.panels.halves) + outer) + self.edges

    def carried(self, vector: Array, x: Array, p: float, other: RingEquations) -> Array:
        """A vector of states (pressures, or their rates, and edges) on the other problem's panels, same edges."""
        n, front, bounded = x.size - self.edges, other.panels.front, self.layout.bounded
        if front == self.panels.front:
            here, there = (Grid(panels, x[n:], bounded) for panels in (self.panels, other.panels))
            return np.concatenate([here.interpolate(vector[:n], there.r, there.of_node), vector[n:]])
        fields = self.fields(x, p)
        here, anchors = fields.grid, fields.grid.edges
        if front:
            anchors = np.append(anchors, self.located(fields, front))
        there = Grid(other.panels, anchors, bounded)

        def at_rest(r: Array, region: Indices | None = None) -> Array:
            """Rates of the pressure where it is."""
            passing = here.slopes(fields.pressure, r, region) * here.motions(vector[n:], r, region)
            return here.interpolate(vector[:n], r, region) - passing

        if vector is x:
            return np.concatenate([here.interpolate(x[:n], there.r, there.of_node), anchors])
        rates = vector[n : n + self.layout.edges]
        if front:  # a gap, and with it a pressure of the law
            b = anchors[-1:]
            slope = here.slopes(fields.pressure, b)  # none where a law has just ended
            rates = np.append(rates, -np.divide(at_rest(b), slope, out=np.zeros(1), where=slope != 0.0))
        passing = here.slopes(fields.pressure, there.r, there.of_node) * there.motions(rates, there.r, there.of_node)
        return np.concatenate([at_rest(there.r, there.of_node) + passing, rates])

    def located(self, fields: Fields, front: float) -> float:
        """The outermost radius at which a state has a gap.

        Raises
        ------
        ModelError
            If there is none beyond the edges.
        """
        grid = fields.grid
        own = np.flatnonzero((grid.of_node == self.layout.edges) & np.isfinite(grid.breaks[:, 1]).repeat(grid.order))
        inside = own[fields.gap[own] < front]
        if len(inside) == 0 or inside[-1] == own[-1]:
            raise ModelError("the gap is nowhere that of the front")

        low, high = grid.r[inside[-1] : inside[-1] + 2]
        for _ in range(HALVINGS):
            middle = np.array([(low + high) / 2])
            gap = self.tip.height(middle) + grid.interpolate(fields.lift, middle) - fields.parameter
            low, high = (middle[0], high) if gap[0] - self.origin < front else (low, middle[0])
        return float(low)


def rings(point: Point) -> RingEquations:
    """The problem of a point of such a curve.

    Raises
    ------
    TypeError
        If it is another model's.
    """
    problem = point.problem
    if isinstance(problem, RingEquations):
        return problem
    raise TypeError(f"{type(problem).__name__} has no regions")
