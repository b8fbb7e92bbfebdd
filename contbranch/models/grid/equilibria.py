"""The equilibria of a contact on a lattice as a problem that `contbranch.curve` follows, judges and presents.

A state x is the field u on the nodes, the parameter the load. Nodes whose gap is zero are in contact; before first
touch there is no wall, so that what closes is found as the zero of a smooth function. Steps pass the corners where
single nodes join the contact; where they fail, the curve is followed from corner to corner (`corners`). Behind first
touch at the apex of a smooth tip the average over nodes takes its place (`averaging`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np

from contbranch.arrays import Array, Flags, magnitude
from contbranch.continuation import CorrectionError, Event, Options, Outcome, Point
from contbranch.continuation.problem import Solution, UnresolvedError
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.events import FoldEvent, Margin, Reached
from contbranch.curve.problem import (
    STEPS,
    AstrayError,
    Defect,
    EquilibriumProblem,
    Four,
    Rates,
    Succession,
    Values,
    equilibrium,
    values_of,
)
from contbranch.curve.refine import moved
from contbranch.results.diagram import State
from contbranch.results.profile import Profile

from .averaging import averaged
from .corners import ZERO_MARGIN, Corners
from .judged import OnNodes
from .landing import land
from .measure import Direction, Measure, following, quietly
from .newton import Equilibrium, Hold, Settings, control_held, newton, tangent
from .observables import cell_fields, interpolate, mean_gap, profile
from .ramp import has_ramps
from .readings import Reading, clearance, read
from .resolution import HOPELESS, Resolution, fills, tail_energy
from .setup import Setup, coarsened, doubled, refined
from .stability import Stability

__all__ = ["LatticeProblem"]

# The first gap at most, in heights of the tip at the border of the cell: from there on all of the cell acts alike.
FURTHEST = 1.0
# States whose fields are kept, since more than one question is asked of each.
RECENT = 8
# Least error of an event, relative to max(1, |value|); that for which no finer lattice is asked, of what is controlled
# and of what is not.
FLOOR, ENOUGH, ACROSS = 1e-8, 3e-7, 3e-6
# Two states are one if no gap differs by more than this part of the law's range: relaxations and Newton's method stop
# at different residuals, and soft states are far apart for the same one.
SAME = 0.02
# By how much the control is moved beyond a fold, relative to max(1, |value|), how often, and by how many times as much.
BEYOND, PUSHES, HARDER = 1e-6, 4, 4.0
# A fold whose load, displacement or position is as certain as this, relative to max(1, |value|), is said to stay.
STAYS = 1e-3
# How far beyond a fold a relaxation begins, in ranges of the law, and how often half of that is tried.
AWAY, HALVINGS = 0.1, 6
# A correction that changes a gap by so many ranges leads to another part of the curve.
NEAR = 2.0
# Step along the curve for a difference, in ranges of the law, and the factor that the error on twice the nodes, and of
# a single step to the event there, has.
STEP, SAFETY = 1e-3, 2.0
# Gap in ranges of the law that is rounding.
TOUCHING = 1e-11
# An excess of pressure that may be neglected.
NOTHING = 1e-12
# Steps along the curve: growth from one to the next, the shortest in a film and in contact, where then corners are
# followed, and the angles between tangents that corners leave.
GROWTH, SHORTEST_IN_FILM, SHORTEST_IN_CONTACT = 2.0, 1e-9, 1e-3
ANGLE, ANGLE_LIMIT = 0.3, 1.5
# Points of a piece at most: where rounding hides a stiff film's curve, steps get shorter without end.
MOST_POINTS = 1000
# Nodes up to which a curve in contact is followed from corner to corner: 350 corners on 32² take 1.1 times the pairs of
# transforms of steps.
CORNERED_NODES = 32**2
# Of a point at a corner, with the tangent before it.
CORNER = "corner"
# First touch this many rows of nodes from the middle is one at the apex.
AT_APEX = 1.5


class LatticeProblem(OnNodes):
    """Equilibria on one lattice.

    Parameters
    ----------
    setup : Setup
    tolerance : float
        Residual of every point, relative.
    wall : bool
        Whether gaps must not be negative.
    film : sequence of Point, optional
        The curve of the problem without a wall, up to first touch.
    held, target : Control or None, float or None
        Where the curve ends, see `Request`.
    """

    rounding = 1e-7
    fold_resolution = 1e-6

    def __init__(
        self,
        setup: Setup,
        tolerance: float = 1e-6,
        wall: bool = False,
        film: Sequence[Point] = (),
        held: Control | None = LOAD,
        target: float | None = None,
    ) -> None:
        self.setup, self.tolerance, self.wall, self.film = setup, tolerance, wall, film
        self.held, self.target = held, target
        self.nodes, self.scale, self.work = setup.problem, setup.length, setup.counter
        self.work.unknowns = self.size
        self._recent: deque[tuple[Array, Equilibrium]] = deque(maxlen=RECENT)
        self._known: deque[tuple[Array, Event, Array]] = deque(maxlen=RECENT)

    @property
    def size(self) -> int:
        """Nodes."""
        return self.setup.lattice.size

    @property
    def states_between(self) -> bool:
        """On few nodes."""
        return self.size <= 128**2

    @cached_property
    def settings(self) -> Settings:
        """Tolerances of corrections from a good prediction."""
        return replace(following(self.tolerance, self.setup.crowded), wall=self.wall)

    @cached_property
    def sharp(self) -> Settings:
        """Tolerances of states that are asked for."""
        return replace(self.settings, tolerance=min(self.tolerance, 1e-9), steps=30, growth=1e3, patience=30)

    # -- states -------------------------------------------------------------------------------------------------------
    def state(self, x: Array, p: float) -> Equilibrium:
        """The equilibrium of a point with all its fields; one pair of transforms unless it was asked for lately.

        Surfaces that are all at the wall differ in their load alone.
        """
        known = next((state for other, state in self._recent if state.load == p and np.array_equal(other, x)), None)
        if known is not None:
            return known
        u = x.reshape(self.nodes.shape)
        contact = self.contact(u)
        found = Equilibrium(self.nodes.fields(u, p, contact), contact, 0.0, self.nodes.displacement(u, p), True)
        self._recent.append((x, found))
        return found

    def contact(self, u: Array) -> Flags:
        """Nodes at the wall, by their gaps but for rounding."""
        return (self.nodes.heights + u <= TOUCHING * self.scale) & self.wall

    def with_fields(self, state: Equilibrium) -> Equilibrium:
        """A state with all its fields; one pair of transforms."""
        return replace(state, fields=self.nodes.fields(state.u, state.load, state.contact))

    def at(self, point: Point) -> Equilibrium:
        """The equilibrium of a point."""
        return self.state(point.x, point.parameter)

    def point(self, state: Equilibrium, direction: tuple[Array, float]) -> Point:
        """An equilibrium as a point, with a direction of the curve."""
        x = state.u.ravel()
        self._recent.append((x, state))
        change, load = np.where(state.contact, 0.0, direction[0].reshape(state.u.shape)), direction[1]
        return Point(self, x, state.load, change.ravel(), load, observables=self.observables(x, state.load))

    def reading(self, x: Array, p: float) -> Reading:
        """What is seen of a state."""
        return read(self.setup, self.state(x, p))

    # -- the equations ------------------------------------------------------------------------------------------------
    def residual(self, x: Array, p: float) -> Array:
        """The pressure that is not balanced: on free nodes all of it, in contact what would pull."""
        state = self.state(x, p)
        excess = state.fields.excess
        return np.where(state.contact, np.minimum(excess, 0.0), excess).ravel()

    @cached_property
    def _weights(self) -> Array:
        """Of the nodes in lengths along the curve: those that come near the tip, whatever the lattice."""
        weights = (1.0 + (np.minimum(self.nodes.heights, 1e6) / (2.0 * (1.0 + self.scale))) ** 2) ** -2
        return np.ravel(weights / weights.sum())

    def inner(self, u: Array, v: Array) -> float:
        """The mean over the nodes near the tip."""
        return float(np.einsum("i,i,i->", self._weights, u, v))

    def dual(self, u: Array) -> Array:
        """See `inner`."""
        return self._weights * u

    def in_plane(self, x: Array, p: float, row: tuple[Array, float], precise: bool) -> Solution:
        """By the semismooth Newton method of the lattice, which takes care of the contact."""
        along, weight = row[0].reshape(self.nodes.shape), row[1]
        value = float(row[0] @ x) + weight * p
        hold = Hold(value, weight, along, 1e-9 * max(1.0, abs(value)))
        with quietly():
            u = x.reshape(self.nodes.shape)
            settings = self.sharp if precise else replace(self.settings, tolerance=self.sharp.tolerance)
            found = newton(self.nodes, u, p, hold, self.contact(u), settings)
            if not found.converged and self.wall and precise:  # on the piece that has the contact of the start
                held = newton(self.nodes, u, p, hold, self.contact(u), replace(settings, frozen=True))
                found = held if held.converged and self.corners.margins(held).min() >= -ZERO_MARGIN else found
            near = np.abs(found.u.ravel() - x).max() <= NEAR * self.scale
            if not near or not (found.converged or found.residual <= self.tolerance):
                raise CorrectionError(Outcome.STEP_TOO_SMALL, "(No equilibrium was found on the lattice.)")
            u, load = tangent(self.nodes, found, hold, 1e-8 if precise else 1e-5)[:2]
            if not (load or u.any()):  # so far away that rounding is larger than the load
                raise CorrectionError(Outcome.STEP_TOO_SMALL, "(A load tells no equilibria there.)")
        point = self.point(found, (u, load))
        return Solution(point.x, point.parameter, point.tangent_x, load)

    # -- the curve ----------------------------------------------------------------------------------------------------
    def start(self, control: Control) -> Point:
        """Far away, where the interaction has decayed.

        Raises
        ------
        CorrectionError
            If there is no interaction, or no equilibrium without contact.
        """
        nodes, setup, law = self.nodes, self.setup, self.setup.law
        if law is None:
            lacking = "(There is no interaction with which the contact could begin; use the axisymmetric model.)"
            raise CorrectionError(Outcome.START_FAILED, lacking)
        inside = nodes.heights[setup.lattice.cell]
        most = max(10.0 * self.scale, FURTHEST * float(inside[np.isfinite(inside)].max()))
        displacement = -min(law.reach(self.tolerance), most)
        step = 0.05 * max(self.scale, 0.2 * abs(displacement))
        if not law.evaluate(np.array([-displacement])).pressure.any():
            displacement -= 1.5 * step  # a law that ends: two states beyond its end, from where the walk goes in
        u = np.full(nodes.shape, -displacement)
        load = nodes.lattice.node_area * float(nodes.respond(nodes.heights + u)[1].sum())
        with quietly():
            first = newton(nodes, u, load, control_held(nodes, DISPLACEMENT, displacement), None, self.settings)
            hold = control_held(nodes, DISPLACEMENT, displacement + step)
            second = newton(nodes, first.u - step, first.load, hold, None, self.settings)
        if not (first.converged and second.converged):
            raise CorrectionError(Outcome.START_FAILED, "(Far away there is no equilibrium; try a finer grid.)")
        return self.point(first, second.beyond(first))

    @property
    def contact_gap(self) -> float:
        """That of the law."""
        return 0.0 if self.setup.law is None else self.setup.law.contact_gap

    @property
    def cornered(self) -> bool:
        """In contact, where a node joins it."""
        return self.wall

    def steps(self, start: Point) -> Options:
        """In contact over the corners of the lattice, and over those of a law with ramps."""
        own = replace(STEPS, growth=GROWTH, smallest_step=SHORTEST_IN_FILM, detect_branch_points=False)
        own = replace(own, maximum_points=MOST_POINTS)
        if self.wall or has_ramps(self.setup.law):
            own = replace(own, angle=ANGLE, angle_limit=ANGLE_LIMIT)
        return replace(own, smallest_step=SHORTEST_IN_CONTACT) if self.wall else own

    def examine(self, x: Array, p: float) -> None:
        """Behind first touch, states without contact farther away are those of the film that led there.

        Raises
        ------
        UnresolvedError
            If the curve has turned back.
        """
        if not (self.wall and self.film) or self.contact(x.reshape(self.nodes.shape)).any():
            return
        if self.nodes.displacement(x, p) < self.film[-1].observables["displacement"]:
            raise UnresolvedError("behind first touch the curve turns back")

    @cached_property
    def corners(self) -> Corners:
        """Where nodes join the contact or leave it."""
        return Corners(self.nodes, self.scale, self.settings)

    def corner(self, point: Point) -> tuple[Point, Point] | None:
        """In contact, where the next node joins or leaves it."""
        if not self.wall:
            return None
        with quietly():
            state = self.at(point)
            way = self.corners.along(state, point.tangent_x.reshape(self.nodes.shape), point.tangent_parameter)
            ahead = self.corners.next(state, way)
            found = None if ahead is None else self.corners.behind(*ahead, way)
        if ahead is None or found is None:
            return None
        onward, (u, load) = self.point(found[0], found[1][1:3]), way.beyond(state, ahead[0])
        along = np.where(ahead[0].contact, 0.0, u).ravel()
        x = onward.x.copy()  # two points, whose tangents differ
        return replace(onward, x=x, tangent_x=along, tangent_parameter=load, label=CORNER), onward

    @property
    def by_corners(self) -> bool:
        """In contact on few nodes."""
        return self.wall and self.size <= CORNERED_NODES

    def corners_between(self, begin: Point, end: Point) -> int:
        """Nodes that have joined the contact or left it; none up to the next corner."""
        if not self.wall or end.label == CORNER:
            return 0
        return int(np.count_nonzero(self.at(begin).contact != self.at(end).contact))

    def margins(self, x: Array, p: float) -> Mapping[str, float]:
        """Without a wall, the gap that closes at first touch."""
        return {} if self.wall else {"touch": clearance(self.setup, self.state(x, p))}

    def successor(self, name: str, points: Sequence[Point]) -> Succession | None:
        """In contact behind first touch: the average where that is at the apex of a smooth tip."""
        if name != "touch":
            return None
        last, state = points[-1], self.at(points[-1])
        row, column = np.unravel_index(int(state.fields.gap.argmin()), self.nodes.shape)
        along = last.tangent_x.reshape(self.nodes.shape)
        towards = Direction.along(Measure.at(state, self.scale), along, last.tangent_parameter)
        with quietly():
            node = int(row), int(column)
            closed = self.corners.at(state, state.u, state.load, node)  # the apex may lie between the nodes
            found = None if closed is None else self.corners.behind(closed, node, towards)
            problem = LatticeProblem(self.setup, self.tolerance, True, points)
            if found is None or (not self.setup.crowded and self.resolution.ratio > HOPELESS):
                return Succession(name, last, ())
            lattice = self.setup.lattice
            if not self.setup.crowded and lattice.distance[node] < AT_APEX * lattice.spacing:
                average = averaged(problem, found, self.held, self.target)
                if average is not None:
                    return Succession(name, last, (average.start(LOAD),), same=False)
        return Succession(name, last, (problem.point(found[0], found[1][1:3]),))

    def ending(self, name: str, point: Point) -> str:
        """What to change."""
        if name == "end":
            return ""
        units, own, resolution = self.setup.units, point.observables, self.resolution
        load, displacement = own["load"] * units.load, own["displacement"] * units.normal
        if not self.setup.crowded and (
            own["contact_radius"] > 0.49 * self.setup.edge or fills(self.setup, equilibrium(point).at(point))  # type: ignore[attr-defined]
        ):
            return f"The contact has reached the border of the cell at load {load:.6g}; use a larger cell."
        remedy = "try a finer grid or a larger cell"
        if resolution.ratio > 1.0:
            remedy = f"the grid is too coarse for this interaction, {resolution.remedy}"
        return (
            f"The curve could not be followed beyond load {load:.6g}, displacement {displacement:.6g}: no equilibrium "
            f"was found within the smallest step; {remedy}."
        )

    def before(self, control: Control, value: float) -> Point | None:
        """Farther away than the start, where nothing but a rigid shift changes; a load does not tell states there.

        Raises
        ------
        CorrectionError
            If it was not found.
        """
        if control.kind == "load":
            return None
        start = self.start(control)
        near = self.at(start)
        u = near.u + (control.value(near.load, near.displacement) - value)
        with quietly():
            found = newton(self.nodes, u, near.load, control_held(self.nodes, control, value), None, self.sharp)
        # Residuals are relative to the pressure, of which rounding leaves little out there.
        if not found.converged and not found.residual * magnitude(found.fields.elastic) <= NOTHING:
            raise CorrectionError(Outcome.START_FAILED, f"where the control is {value:.6g}")
        return self.point(found, (start.tangent_x, start.tangent_parameter))

    def joins(self, other: EquilibriumProblem) -> bool:
        """On the same lattice, on both sides of first touch."""
        return isinstance(other, LatticeProblem)

    # -- what is seen -------------------------------------------------------------------------------------------------
    def values(self, x: Array, p: float) -> Values:
        """As read off the nodes."""
        return Values(*self.reading(x, p)[:5])

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """The values, the length of the rim, and the pairs of transforms that the state took."""
        seen = dict(zip((*Values._fields, "perimeter"), self.reading(x, p), strict=False))
        own = self.setup.of_cell(seen["load"], seen["displacement"], seen["energy"])
        return seen | own | {"fft_pairs": float(self.state(x, p).pairs)}

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Of load, displacement and gap; a contact grows by nodes, and has no rate."""
        u, gaps, gap = x_rate.reshape(self.nodes.shape), self.nodes.heights.ravel() + x, 0.0
        if not self.wall or gaps.min() > 0.0:
            lattice, crowded = self.setup.lattice, self.setup.crowded
            gap = float(x_rate[np.argmin(gaps)]) if crowded else interpolate(lattice, u, 0.0, 0.0)
        return Rates(p_rate, self.nodes.displacement(u, p_rate), 0.0, gap)

    @property
    def countable(self) -> bool:
        """Not where the law is stiffer than the lattice: they are those of single nodes."""
        return self.resolution.ratio <= 1.0

    @cached_property
    def resolution(self) -> Resolution:
        """The law's stiffness against the lattice's."""
        return Resolution.of(self.setup)

    @cached_property
    def stability(self) -> Stability:
        """That of its states."""
        return Stability(self.nodes)

    def unstable(self, x: Array, p: float) -> int:
        """Modes with the symmetry of the tip; those that break it are not looked for."""
        return self.stability.index(self.state(x, p))

    def profile(self, x: Array, p: float) -> Profile:
        """Means over circles."""
        return profile(self.nodes, self.state(x, p))

    def described(self, x: Array, p: float) -> Mapping[str, Any]:
        """Mean gap and the fields on the nodes."""
        state, centred = self.state(x, p), self.setup.centred
        own = self.setup.of_cell(state.load, state.displacement, self.nodes.total_energy(state.fields))
        fields = partial(cell_fields, self.nodes, state, centred)
        return {"mean_gap": mean_gap(self.nodes, state), "cell_energy": own.get("cell_energy"), "in_cell": fields}

    # -- other lattices -----------------------------------------------------------------------------------------------
    @cached_property
    def _finer(self) -> LatticeProblem:
        return LatticeProblem(self.setup.fine, self.tolerance, self.wall)

    def finer(self) -> Self:
        """On twice the nodes a side."""
        return self._finer  # type: ignore[return-value]

    @cached_property
    def _coarser(self) -> LatticeProblem | None:
        coarse = self.setup.coarse
        return None if coarse is None else LatticeProblem(coarse, self.tolerance, self.wall)

    def compared(self) -> Self:
        """On half the nodes a side."""
        return self._coarser or self  # type: ignore[return-value]

    def carried(self, vector: Array, x: Array, p: float, other: Self) -> Array:
        """By trigonometric interpolation, or by means; where there is contact it stays."""
        if other.setup.nodes == self.setup.nodes:
            return vector
        field, centred, finer = vector.reshape(self.nodes.shape), self.setup.centred, other.setup.grid > self.setup.grid
        moved = refined(field, self.setup.lattice, centred) if finer else coarsened(field, centred)
        if vector is x and self.wall:
            contact = self.nodes.heights + field <= 0.0
            stays = (
                doubled(contact, other.nodes.shape) if finer else coarsened(np.where(contact, 1.0, 0.0), centred) >= 0.5
            )
            moved = np.where(stays, -other.nodes.heights, moved)
        return np.ravel(moved)

    def left_out(self, x: Array, p: float) -> Four:
        """What the cell leaves out, and what reading off the nodes does."""
        return self.reading(x, p).errors

    def energy_left_out(self, x: Array, p: float) -> float:
        """That of the interaction outside the cell."""
        return tail_energy(self.setup, self.state(x, p))

    def shared(self, point: Point) -> tuple[float, float]:
        """What the cell leaves out."""
        load, displacement, *_ = self.reading(point.x, point.parameter).errors
        return load, displacement

    def difference(self, point: Point, control: Control | None = None) -> Array:
        """Change of load, displacement, radius and gap on half the nodes a side: at a value of a control, or across the
        curve; infinite where that is not known."""
        coarse = self._coarser
        unknown = np.full(4, np.inf)
        if coarse is None or self.resolution.fails(self.at(point)):
            return unknown
        here, state = self.reading(point.x, point.parameter), self.at(point)
        start, way = (
            self.carried(own, point.x, point.parameter, coarse).reshape(coarse.nodes.shape)
            for own in (point.x, point.tangent_x)
        )
        if control is not None:
            hold = control_held(coarse.nodes, control, control.value(here.load, here.displacement))
        else:
            measure = Measure.of(np.maximum(coarse.nodes.heights + start, 0.0), state.load, self.scale)
            along = Direction.along(measure, way, point.tangent_parameter)
            hold = along.hold(along.value(start, state.load), 1e-6 * abs(along.value(way, point.tangent_parameter)))
        with quietly():
            found = newton(coarse.nodes, start, state.load, hold, None, self.settings)
        if not found.converged:
            return unknown
        return np.abs(np.subtract(here[:4], read(coarse.setup, found, cell=False)[:4]))

    @cached_property
    def touch_error(self) -> Array:
        """Of load and displacement at first touch."""
        stated = equilibrium(self.film[-1]).stated(self.film[-1], Margin("touch")) if self.film else None
        return np.zeros(2) if stated is None else np.array(stated[:2])

    def _moved(self, point: Point, event: Event) -> Array:
        """By how much, and a little more, an event of the film lies elsewhere on another lattice.

        Without contact errors fall faster than any power of the spacing: where half the nodes a side change nothing,
        twice as many do not.
        """
        for x, one, error in self._known:
            if x is point.x and one == event:
                return error.copy()
        error = np.full(4, np.inf)
        own = np.array(event.control.weights if isinstance(event, FoldEvent) else (1.0, 1.0)) != 0.0
        floor = np.where(own, ENOUGH, ACROSS) * np.maximum(1.0, np.abs(self.reading(point.x, point.parameter)[:2]))
        for other in filter(None, (self._coarser, self._finer)):
            if (error[:2] > floor).any():
                error = self._move(point, event, other)
        self._known.append((point.x, event, error))
        return error.copy()

    def _move(self, point: Point, event: Event, other: LatticeProblem) -> Array:
        if self.resolution.fails(self.at(point)):
            return np.full(4, np.inf)
        there = moved(point, other)
        metric = other.metric(there.x)
        size = metric.norm(other, there.tangent_x, there.tangent_parameter)
        row = metric.row(other, there.tangent_x / size, there.tangent_parameter / size)
        ahead = STEP * self.scale / magnitude(there.tangent_x)
        try:
            found = []
            for step in (0.0, ahead):
                x, p = there.x + step * there.tangent_x, there.parameter + step * there.tangent_parameter
                one = other.in_plane(x, p, row, isinstance(event, FoldEvent))
                seen, rates = np.array(other.values(*one[:2])[:4]), np.array(other.rates(*one))
                found.append((event.value(Point(other, *one)), seen, rates))
        except CorrectionError:
            return self.difference(point) if other is self._finer else np.full(4, np.inf)
        (first, seen, rates), (last, _, further) = found
        share = -first / (last - first) if last != first else 0.0
        # From the state beside the event to the event itself, by slopes that change evenly.
        change = ahead * size * share * (rates + 0.5 * share * (further - rates))
        return np.asarray(SAFETY * np.abs(seen + change - self.values(point.x, point.parameter)[:4]))

    def defect(self, point: Point) -> Defect:
        """By the lattice with half the nodes a side."""
        load, displacement, _, _ = self.difference(point)
        return Defect(load, displacement, 0.0)

    def stated(self, point: Point, event: Event | None) -> Four | None:
        """By the lattice with half the nodes a side; events without contact by that with twice as many."""
        if not self.wall and isinstance(event, FoldEvent | Margin):
            error = self._moved(point, event)
        else:
            control = event.control if isinstance(event, Reached) else None
            error = self.difference(point, control)
            if isinstance(event, FoldEvent):
                error *= SAFETY
                error[2] += self.setup.lattice.spacing * max(1.0, self.resolution.ratio)  # nodes join by chance
        seen = np.abs(self.reading(point.x, point.parameter)[:4])
        floor = np.full(4, self.settings.tolerance if isinstance(event, Reached) else FLOOR)
        if isinstance(event, FoldEvent):
            floor[:2][np.array(event.control.weights) == 0.0] = ENOUGH
        error += floor * np.maximum(1.0, seen) + self.left_out(point.x, point.parameter)
        radius, gap = seen[2:] > 0.0
        error[2:] = np.where([(gap and not radius) or not self.wall, radius and not gap], 0.0, error[2:])
        if self.wall and not radius and seen[3] <= error[3] and not isinstance(event, Margin):
            error[2] = max(error[2], self.setup.lattice.spacing)  # what is not known to be open may be in contact
        return tuple(error.tolist())

    def verdict(self, point: Point, control: Control, error: Sequence[float]) -> tuple[str | None, str]:
        """Whether it stays on another lattice, by its error."""
        moved = control.value(*np.subtract(error[:2], self.shared(point)))
        value = control.value(*self.reading(point.x, point.parameter)[:2])
        what = "the position of the spring" if control.kind == "spring" else control.kind
        if not math.isfinite(moved):
            return None, "Whether it stays on another grid is not known."
        words = "stays" if moved <= STAYS * max(1.0, abs(value)) else "moves"
        return (
            words,
            f"On another grid it {words}: by {moved * self.setup.units.of(control.kind):.3g} in {what} at most.",
        )

    # -- jumps --------------------------------------------------------------------------------------------------------
    def relaxes_to(self, other: EquilibriumProblem) -> bool:
        """Whatever lies on the lattice."""
        return hasattr(other, "setup")

    def relaxed(self, fold: Point, control: Control, direction: int, others: Sequence[Point]) -> int | None:
        """By relaxation from the fold, the control moved a little beyond it and back.

        The error of the fold on other lattices does not matter here: beyond it by so much lie other folds.

        Raises
        ------
        AstrayError
            If it ends in a state at the fold's value that is none of the others.
        """
        return self.landed(self._past(fold, control), fold, control, direction, others, 0.0)

    def _past(self, fold: Point, control: Control) -> Equilibrium:
        """The state a little beyond a fold on the curve, on its unstable side; the fold if there is none.

        From the fold itself a relaxation takes for ever. On the unstable side the energy at the fold's value falls, by
        the cube of the distance.
        """
        begin, along = self.at(fold), fold.tangent_x.reshape(self.nodes.shape)
        way = Direction.along(Measure.at(begin, self.scale), along, fold.tangent_parameter)
        size, value = way.value(along, fold.tangent_parameter), control.of(begin)

        def tried(step: float) -> tuple[Equilibrium, float]:
            u, load = begin.u + step * along, begin.load + step * fold.tangent_parameter
            hold = way.hold(way.value(u, load), 1e-3 * abs(step) * size)
            found = newton(self.nodes, u, load, hold, None, self.settings) if step else begin
            seen = Values(*read(self.setup, found)[:5])
            return found, control.height(value, seen) if found.converged else math.nan

        with quietly():
            highest = tried(0.0)[1]
            for step in AWAY * self.scale / magnitude(along) * 0.5 ** np.arange(HALVINGS):
                for side in (step, -step):
                    (_, halfway), (state, lowest) = tried(0.5 * side), tried(side)
                    if lowest < halfway < highest:
                        return state
        return begin

    def landed(
        self,
        begin: Equilibrium,
        fold: Point,
        control: Control,
        direction: int,
        others: Sequence[Point],
        barrier: float,
    ) -> int | None:
        """As `relaxed`, from a state near the fold that is held by so much more of what is controlled."""
        value = control.value(*values_of(fold)[:2])
        push = barrier + BEYOND * max(1.0, abs(value))
        start = end = begin
        for _ in range(PUSHES):
            end = start
            with quietly():
                for position in (value + direction * push, value):
                    if end.converged or end is start:
                        hold = control_held(self.nodes, control, position)
                        end = land(self.nodes, end.u, hold, self.sharp.tolerance)
            apart = [equilibrium(other).away(other, end) for other in others]  # type: ignore[attr-defined]
            if end.converged and apart and min(apart) <= SAME:
                return apart.index(min(apart))
            push *= HARDER
            # Next to the fold it is slow: what has not come to rest goes on from where it is.
            start = begin if end.converged else end
        if not end.converged:
            return None
        raise AstrayError(State(*read(self.setup, end)[:5], 0, 0, 0.0))

    def away(self, point: Point, state: Equilibrium) -> float:
        """The same of a point's state and another."""
        return magnitude(point.x - state.u.ravel()) / self.scale
