"""The contact on meshes made for its solutions, finer where these ask for it, and coarser where they do not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Self

import numpy as np
from scipy.optimize import brentq

from contbranch.arrays import Array, magnitude
from contbranch.contact.validity import in_pieces, perhaps_in_pieces
from contbranch.continuation import Adaptation, Point
from contbranch.continuation.problem import UnresolvedError
from contbranch.curve.problem import Defect, EquilibriumProblem, Values
from contbranch.errors import ModelError
from contbranch.models.fronts import CORE, STIFF
from contbranch.watch import check

from .adapt import (
    adapted_edges,
    cuts,
    defect_error,
    factorised,
    needed_reach,
    panel_errors,
    roughness,
    too_long,
)
from .breakpoints import STEEPEST, Motion, extent_leads, law_leads, of_law, shortened, steepest, with_edges
from .equations import Equations, Fields
from .laying import laid_edges
from .mesh import Mesh, mesh_on
from .moving import MovingContact

__all__ = ["MeshedContact"]

# A new mesh aims below the tolerance by this factor, so that the solution can move on before it must be changed again.
SLACK = 0.06
# A step to a solution whose error exceeds the tolerance by this factor is repeated shorter, so that meshes can follow.
UNRESOLVED = 20.0
# ... unless it is as short as this from one that is resolved, relative to the parameter: errors jump where a node
# passes a tip's end.
SAME_ROW = 1e-4
# A change of mesh may move the state by the first multiple of its error estimate, or load and displacement by the
# second of theirs, ln of the stretch by so much, and other breakpoints by this share of their places.
LEAP, SAFETY, STRETCHED = 30.0, 3.0, 0.1
# Gaps, in ranges, that no solution has.
DEEPEST = 0.5
# Below this radius parameter meshes are graded down to this share of the radius, each panel longer by this factor than
# the one inside; if those are too many panels, by a larger one: the tinier the radius, the less its scale matters.
SMALL, SHARE, GRADING, PANELS = 1e-2, 0.5, 4.0, 8
# Share of the tolerance below which a mesh is made coarser on the way.
FINE = 1e-2
# Rounds of meshing, solving and judging until a mesh satisfies its own error estimate, and the change by Newton's
# method after which the solution is good enough for that: the next one would be its square.
ROUNDS, NEARLY = 6, 1e-5
# The largest factor by which the guide can be too optimistic, and what a further round has to leave of an error then.
SHARPEST, HELPS = 1e6, 0.5
# Unknowns that a state may be given where it is not smooth, and where all panels are halved, since halving some leaves
# more than this share of the error.
MOST, FINEST, WORTH = 1000, 1600, 0.5
# Corrections that may be no smaller than the one before.
STALLS = 3
# Loads and lengths below this are nothing.
LEAST = 1e-12
# Step of the difference that gives the rate of the contact radius within a soft core, of the parameter and of h in
# ranges: the cube root of rounding.
SOFT_STEP = 6e-6
# Ratio of neighbouring panels next to edges of regions that have moved, from which on a mesh is made anew.
OUTGROWN = 9.0
# A mesh is laid anew where panels are shortened down to this share, between edges of regions to the second.
SHORTER, RELAID = 0.4, 0.1
# Edges of panels below this share of the distance to the edge of a tip are kept where the mesh is to end there.
INSIDE = 0.97


class MeshedContact(MovingContact):
    """The same on meshes made for the solution."""

    @property
    def pieced(self) -> bool:
        """Whether the law or the tip may be, or the law has a kink: where pieces meet is no edge of panels, and rates
        that go with a mesh that moves with a kink are rough where that has just begun to. Root edges are no pieces."""
        kinked = self.kinked and not self.mesh.roots
        return kinked or perhaps_in_pieces(self.equations.tip, self.equations.interaction)

    def resolved(self, x: Array, p: float, tolerance: float, most: float = math.inf) -> tuple[Self, Array]:
        """The problem on a mesh that resolves a solution, as far as some rounds, or `most` unknowns, do, and the
        solution."""
        problem = self
        for _ in range(ROUNDS):
            if problem.relative_error(x, p) <= tolerance or problem.size > most:
                break
            trial, found = problem.remeshed(x, p, tolerance)
            if trial.lost(found, p):
                break
            problem, x = trial, found
        return problem, x

    def lost(self, x: Array, p: float) -> bool:
        """Whether a solution lies where surfaces would have passed through one another, and laws mean nothing, or has
        breakpoints that have left their parts of the mesh."""
        try:
            return float(self.fields(x, p).gap.min()) < self.equations.wall - DEEPEST * self.scale
        except ModelError:
            return True

    def values(self, x: Array, p: float) -> Values:
        """Load, displacement, contact radius, central gap, energy."""
        equations, fields = self.seen(x, p)
        gap = max(equations.wall, equations.central_gap(fields))
        radius = fields.rim.radius if equations.contact and not equations.level else self._soft_radius(x, p)
        if any(region.rests and not region.index for region in equations.regions):
            radius = math.hypot(fields.rim.radius, equations.mesh.edges[equations.mesh.roots[self._wall_edge]])
        load, displacement = equations.load(fields), equations.displacement(fields)
        return Values(load, displacement, radius, gap, equations.energy(fields))

    def _soft_radius(self, x: Array, p: float) -> float:
        """The radius out to which the gap is less than at the rim of a soft core; 0 without."""
        equations, fields = self.seen(x, p)
        law, mesh = equations.interaction, equations.mesh
        if law is None or not law.wall or not equations.central_gap(fields) < law.rim_gap:
            return 0.0
        places = np.append(0.0, mesh.nodes)
        last = int(np.flatnonzero(fields.gap < law.rim_gap).max(initial=-1)) + 1

        def above(place: float) -> float:
            return float(mesh.interpolate(fields.gap, np.array([place]))[0]) - law.rim_gap

        if last == len(mesh.nodes):
            return float(mesh.end)
        return float(brentq(above, places[last], places[last + 1], xtol=1e-15))

    def _soft_rate(self, x: Array, p: float, x_rate: Array, p_rate: float) -> float:
        """The rate of that radius along a direction, by a difference."""
        step = SOFT_STEP / (abs(p_rate) + magnitude(x_rate) / self.scale)
        ahead, behind = (self._soft_radius(x + s * x_rate, p + s * p_rate) for s in (step, -step))
        return (ahead - behind) / (2.0 * step)

    @property
    def _wall_edge(self) -> int:
        """The number of the root edge that is the outermost of those of contact with the wall."""
        return max(k for k, region in enumerate(self.equations.regions) if region.rests and not region.index)

    def examine(self, x: Array, p: float) -> None:
        """Look whether the mesh resolves a row, or one as close to it as that."""
        if not self.mesh.roots and abs(p - self._row) < SAME_ROW * abs(p):
            return
        if not self.relative_error(x, p) <= UNRESOLVED * self.resolution.tolerance:
            raise UnresolvedError("the mesh does not resolve the solution")
        self._row = p

    def defect(self, point: Point) -> Defect:
        """One Newton step towards the solution on the finer mesh."""
        return self.error(point.x, point.parameter)

    def error(self, x: Array, p: float) -> Defect:
        """Discretisation error; that of the last state is kept."""
        if self._judged is None or self._judged[0] is not x or self._judged[1] != p:
            self._judged = x, p, self._moving_error(x, p) if self.mesh.roots else defect_error(*self.seen(x, p))
        return self._judged[2]

    def _moving_error(self, x: Array, p: float) -> Defect:
        """One Newton step on the finer mesh, with all that moves there."""
        fine, before = self.finer(), self.values(x, p)
        x = self.carried(x, x, p, fine)
        step: Array = np.asarray(np.linalg.solve(fine.jacobian(x, p), -fine.residual(x, p)), dtype=np.float64)
        after, rates = fine.values(x, p), fine.rates(x, p, step, 0.0)
        load, displacement = after.load - before.load + rates.load, after.displacement - before.displacement
        return Defect(load, displacement + rates.displacement, magnitude(step[: fine.mesh.size]))

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A better mesh where the error estimate exceeds the tolerance, or where far fewer panels would do."""
        problem, start = self._refitted(x, p)
        motion = problem.fitting(start, p)
        if problem is self and motion is self.motion:
            return None
        if motion is not problem.motion:
            problem, start = problem.anchored(motion, start, p)
        else:
            problem.examine(start, p)  # whose error has been found, and will be nearly that of the row

        def moved(x: Array, p: float, x_rate: Array, p_rate: float) -> tuple[Array, Array]:
            state, rate = self.carried(x, x, p, problem), self.carried(x_rate, x, p, problem)
            alike = self.mesh.roots or (problem.motion is not None and self._moves_alike(problem.motion))
            return state, rate if alike else problem.following(rate, state, p, p_rate)

        def transfer(vector: Array) -> Array:
            return np.append(self.equations.carried(vector[:n], problem.equations), vector[n:])

        n = self.size
        self._seen, self._placed = [], []
        self.equations.forget()  # its points stay, by the thousand in cascades of layers, but are seldom asked again
        same = problem.motion is self.motion
        return Adaptation(problem, start, transfer if same else None, None if same else moved)

    def _refitted(self, x: Array, p: float) -> tuple[Self, Array]:
        """The problem on a mesh that satisfies the tolerance, if this one does not or is far finer, and the state."""
        equations, fields = self.seen(x, p)
        resolution, mesh = self.resolution, self.placed(x).mesh
        allowed = resolution.tolerance * self._units(equations, fields)[0]
        reach = self._reach(x, equations, fields, 0.1 * allowed)
        error = self.relative_error(x, p)
        served = not self.rough(x, p) and error <= resolution.tolerance and reach <= equations.mesh.end
        served = served and not (mesh.roots and too_long(mesh.edges, mesh, OUTGROWN).any())
        if served:
            if error > FINE * resolution.tolerance or mesh.panels <= 6:
                return self, x
            sharpness = self._sharpened(x, p, resolution.tolerance)
            allowed *= SLACK / sharpness
            edges = adapted_edges(equations, fields, allowed, reach, mesh, self.within(x, p), self._kept(x))
            if len(edges) > 0.75 * mesh.panels:
                return self, x
        problem = self
        start = x
        for _ in range(ROUNDS):
            trial, carried = problem.remeshed(start, p, solve=False)
            found = trial.solve_at(carried, p, enough=NEARLY)  # it is corrected by who asked
            change = found - carried
            away = np.abs(change[trial.size :])
            away[1:] /= [one.place for one in trial.others]
            # Next to the edge of a tip, where h ends like a root, coarse panels tell nothing of it.
            told = int(np.searchsorted(trial.mesh.nodes, problem.mesh.edges[-2])) if trial.mesh.bounded else None
            moves = trial.growth(found) * change[: trial.size], trial.moving(change, found)
            near = min(magnitude(by[:told]) for by in moves) <= LEAP * problem.error(start, p).state + 1e-6 * self.scale
            astray = bool((away > STRETCHED).any()) or trial.lost(found, p)
            if astray or not (near or trial._foretold(found, problem, start, p)):
                break  # Newton's method has left for another solution
            problem, start, last, error = trial, found, error, trial.relative_error(found, p)
            spent = problem.sharpness == SHARPEST and error > HELPS * last  # what is left is rounding
            # What has kinks on no panel's edge never is smooth: one round towards it does.
            smooth = not (self.kinked or in_pieces(equations.tip, equations.interaction))
            if (error <= resolution.tolerance or spent) and not (smooth and problem.rough(start, p)):
                break
        return (self, x) if served and error > resolution.tolerance else (problem, start)

    def _foretold(self, x: Array, coarse: Self, before: Array, p: float) -> bool:
        """Whether load and displacement differ from those on a coarser mesh by no more than its errors."""
        defect, old, new = coarse.error(before, p), coarse.values(before, p), self.values(x, p)
        return all(
            abs(b - a) <= SAFETY * abs(error) + self.resolution.tolerance * max(1.0, abs(a))
            for a, b, error in zip(old[:2], new[:2], defect[:2], strict=True)
        )

    def _stiff(self, fields: Fields) -> bool:
        return magnitude(fields.stiffness) * self.resolution.moving > STIFF

    def within(self, x: Array, p: float) -> float:
        """Radius within which v'' has to be smooth: where a stiff contact may give way, a film as far as it bears much.

        Under a flat tip it is squeezed out next to its edge first.
        """
        equations, fields = self.seen(x, p)
        if not (self.motion and self.motion.power and equations.softens):
            return math.inf if self._stiff(fields) else 0.0
        return float(equations.mesh.nodes[fields.pressure > CORE * float(fields.pressure.max())].max(initial=0.0))

    def rough(self, x: Array, p: float) -> bool:
        """Whether v'' is not smooth where it has to be."""
        equations, fields = self.seen(x, p)
        within = self.within(x, p)
        return within > 0.0 and bool((roughness(equations, fields, equations.mesh.edges, within) > 1.0).any())

    def fitting(self, x: Array, p: float) -> Motion | None:
        """With what the mesh is to move at a state: the present motion as long as it serves."""
        if self.layered:
            return None
        if self.mesh.roots and self.motion is not None:
            crushed = self.others and shortened(self.mesh, self.placed(x).mesh.edges) < RELAID
            return self.motion_at(x) if crushed else self.motion
        found = self._led(x, p)
        if found is None or (found is self.motion and not self.resolution.moving):
            return found
        seen, now = self.seen(x, p), self.placed(x).mesh
        stretch, same = float(seen[0].mesh.end / now.end), found is self.motion
        unit = stretch if self._stretched_alike(found) else 1.0
        known = {one.key: stretch * one.place for one in self.others_at(x)}
        lead = replace(found.lead, place=unit * found.lead.place)
        stiff = self._stiff(seen[1])
        others = of_law(seen, lead, known, stiff) if seen[0].marks else ()
        if found.ends and stiff and not others:  # the steepest pressure moves besides
            present = self.others[0].stretched(known[STEEPEST], stretch) if STEEPEST in known else None
            inner = steepest(seen, Motion(present, (), 1.0) if present else None, seen[0].mesh, self.resolution.moving)
            others = () if inner is None else (inner.lead,)
        stay = same and {(one.key, one.gap) for one in others} == {(one.key, one.gap) for one in self.others}
        if stay and not (others and shortened(self.mesh, now.edges) < SHORTER):
            return self.motion
        weight = found.lead.weight or float(seen[0].mesh.weights @ seen[1].h ** 2)
        placed = [one.stretched(one.place / unit, 1.0 / unit) for one in others]
        return replace(found, others=tuple(replace(one, weight=weight / one.place**2) for one in placed))

    def _led(self, x: Array, p: float) -> Motion | None:
        """What leads at a state."""
        seen, present = self.seen(x, p), self.motion
        if math.isfinite(self.equations.tip.extent):
            allowed = self.resolution.tolerance * self._units(*seen)[0]
            if (edge := extent_leads(seen, allowed, present)) is not None:
                return edge
        if not self.resolution.moving:
            return None if present is None or present.ends else present
        if (kink := law_leads(seen, present)) is not None:
            return kink
        if present is not None and (present.ends or present.of_law):
            present = None
        return steepest(seen, present, self.placed(x).mesh, self.resolution.moving)

    def anchored(self, motion: Motion | None, x: Array, p: float) -> tuple[Self, Array]:
        """The problem with another motion, or with none, and the state."""
        if motion is self.motion:
            return self, x
        if motion is not None and self._stretched_alike(motion):
            base, state, sigma = replace(self, equations=self.placed(x)), x[: self.size], float(x[self.size])
        else:
            (base, state), sigma = self.still(x), 0.0
        before, edges = base.equations, base.mesh.edges
        bounded = base.mesh.bounded if base.mesh.roots else motion is not None and motion.ends
        if base.mesh.roots:
            rooted = bool(base.mesh.root[-1] > 0)
            edges = laid_edges(edges[list(base.mesh.roots)], edges, rooted, float(edges[-1]) if bounded else None)
        elif motion is not None:
            last = motion.lead.place
            if motion.ends:
                edges = np.append(edges[:-1] if base.mesh.bounded else edges[edges < INSIDE * last], last)
            elif motion.of_law and not self.fields(x, p).pressure[base.mesh.nodes > last].any():  # nothing lies beyond
                edges = np.append(edges[edges < last], last)
            edges = with_edges(edges, motion.edges)
        problem = replace(base, equations=before.on(self._mesh(edges, motion, bounded)), motion=motion)
        found = before.carried(state, problem.equations)
        return problem, found if motion is None else np.concatenate([found, [sigma], np.zeros(len(motion.others))])

    def remeshed(self, x: Array, p: float, tolerance: float | None = None, solve: bool = True) -> tuple[Self, Array]:
        """The problem on a mesh made for this solution, and the solution there (or, unsolved, carried to it)."""
        equations, fields = self.seen(x, p)
        unit, tolerance = self.placed(x).mesh, self.resolution.tolerance if tolerance is None else tolerance
        allowed = tolerance * self._units(equations, fields)[0]
        reach = self._reach(x, equations, fields, 0.03 * allowed)
        end = equations.mesh.end
        sharpness = self.sharpness
        if reach > end:
            # The solution is not known out there: lengthen first, judge the panels in the next round.
            count = int(np.ceil(np.log2(reach / end)))
            edges = np.append(unit.edges, unit.end * (reach / end) ** (np.arange(1, count + 1) / count))
        else:
            sharpness = self._sharpened(x, p, tolerance)
            kept, allowed = self._kept(x), SLACK * allowed / sharpness
            edges = adapted_edges(equations, fields, allowed, reach, unit, self.within(x, p), kept)
        return self.on(self._mesh(edges, self.motion_at(x), unit.bounded), x, p, sharpness, solve)

    def _kept(self, x: Array) -> list[float]:
        """Breakpoints that are edges of panels."""
        motion = self.motion_at(x)
        return [] if motion is None else motion.edges

    def _sharpened(self, x: Array, p: float, tolerance: float) -> float:
        """The factor by which the guide is too optimistic here: as it was, or as the error of a state shows."""
        (equations, fields), error = self.seen(x, p), self.relative_error(x, p)
        guide = float(panel_errors(equations, fields).sum()) / self._units(equations, fields)[0]
        shown = min(max(2 * error / max(guide, 1e-16), 1.0), SHARPEST)
        return max(self.sharpness, shown) if error > tolerance else min(self.sharpness, shown)

    def _reach(self, x: Array, equations: Equations, fields: Fields, tolerance: float) -> float:
        """How long the mesh is to be; all breakpoints lie on it."""
        mesh = equations.mesh
        if mesh.bounded:
            return float(mesh.end)
        motion = self.motion_at(x)
        farthest = 0.0 if motion is None else max(one.place for one in motion.all) / float(self.mesh.end)
        return max(needed_reach(equations, fields, tolerance), farthest * float(mesh.end))

    def on(
        self, mesh: Mesh, x: Array, p: float, sharpness: float | None = None, solve: bool = True
    ) -> tuple[Self, Array]:
        """The problem on another mesh, and the solution of the same parameter there (or, unsolved, carried to it)."""
        problem, n, motion = self.on_mesh(mesh, sharpness), self.size, self.motion_at(x)
        if motion is not self.motion:  # whose other breakpoints are where they are
            problem = replace(problem, motion=motion)
        carried = np.concatenate([self.placed(x).carried(x[:n], problem.equations), x[n : n + 1], 0.0 * x[n + 1 :]])
        return problem, problem.solve_at(carried, p) if solve else carried

    def _mesh(self, edges: Array, motion: Motion | None, bounded: bool) -> Mesh:
        """The mesh of these edges, with roots where what moves with it has them."""
        if bounded and len(edges) == 2:  # solutions are even at its begin, and end like a root
            edges = np.array([edges[0], 0.75 * edges[1], edges[1]])
        places = np.array([] if motion is None else sorted(one.place for one in motion.all if one.root))
        roots = np.abs(edges[:, None] - places).argmin(axis=0)
        edges = edges.copy()
        edges[roots] = places  # from which rounding has taken them
        return mesh_on(edges, self.resolution.order, bounded, tuple(roots.tolist()))

    def on_mesh(self, mesh: Mesh, sharpness: float | None = None) -> Self:
        """The problem on another mesh, with the motion as it is."""
        sharpness = self.sharpness if sharpness is None else sharpness
        return replace(self, equations=self.equations.on(mesh), sharpness=sharpness)

    @property
    def moves(self) -> bool:
        """Whether the steepest pressure leads."""
        return self.motion is not None and not (self.motion.ends or self.motion.of_law)

    def finer(self) -> Self:
        """On panels of higher order."""
        return replace(self, equations=self.equations.finer)

    def halved(self, point: Point, share: float) -> Self:
        """On panels halved where they do not resolve a state, or all, of the trace's own order."""
        problem, x, u = self, point.x, point.parameter
        if share == 0.0 and (doubled := self.doubled()) is not self:
            return doubled
        goal = max(share * self.relative_error(x, u), self.rounding)
        tried: list[tuple[float, Self]] = []
        for _ in range(ROUNDS):
            problem, x = problem.remeshed(x, u, goal)
            if problem.size > MOST and tried:
                break
            tried.append((problem.relative_error(x, u), problem))
            if tried[-1][0] <= goal:
                break
        error, best = min(tried, key=lambda one: one[0])
        if error > WORTH * self.relative_error(point.x, u) and (doubled := self.doubled()) is not self:
            # What is left is everywhere, as next to the many kinks of a table's derivatives: panels tell nothing of it.
            return doubled
        return best

    def doubled(self) -> Self:
        """On twice as many panels, with other edges unless breakpoints are among these.

        What is not smooth right beside an edge, with no node between, is seen by no mesh that has it: all these agree.
        """
        mesh, edges = self.mesh, self.mesh.edges
        if 2 * self.size > FINEST:
            return self
        if self.kinked or self.others:
            edges = np.union1d(edges, cuts(edges, mesh))
        else:
            inner = edges[:-1, None] + np.diff(edges)[:, None] * [0.25, 0.75]
            edges = np.concatenate([edges[:1], inner.ravel(), edges[-1:]])
        return self.on_mesh(self._mesh(edges, self.motion, mesh.bounded))

    def carried(self, vector: Array, x: Array, p: float, other: EquilibriumProblem) -> Array:
        """A state, or a direction at it, on another problem's mesh with the breakpoints where the state has them."""
        if not isinstance(other, MeshedContact):
            raise TypeError(f"{type(other).__name__} is not a MeshedContact")
        motion, n, is_state = other.motion, self.size, vector is x
        known = {one.key: one.place for one in self.others_at(x)}
        if motion == self.motion or (self.mesh.roots and other.mesh.roots) or (motion and self._moves_alike(motion)):
            tail = x[n:].copy()
            tail[1:] = [known[one.key] - one.place for one in motion.others] if motion else []
            there = other.placed(np.append(np.zeros(other.size), tail))
            return np.append(self.placed(x).carried(vector[:n], there), tail if is_state else vector[n:])
        here, h = self.still(x)
        h = h if is_state else self.moving(vector, x)
        if motion is None:
            return here.equations.carried(h, other.equations)
        stretch = float(here.mesh.end / self.placed(x).mesh.end)
        about = float(x[n]) if self._stretched_alike(motion) else 0.0
        tail = motion.located(self.seen(x, p), {key: stretch * place for key, place in known.items()}, about)
        found = here.equations.carried(h, other.placed(np.append(np.zeros(other.size), tail)), math.exp(tail[0]))
        return np.append(math.exp(-motion.power * tail[0]) * found, tail * float(is_state))

    def _stretched_alike(self, motion: Motion) -> bool:
        """Whether another motion is one of the same mesh before it is stretched: the steepest pressure may be another
        one."""
        own = self.motion
        if own is None or motion.lead == own.lead:
            return own is not None
        return self.moves and not (motion.ends or motion.of_law) and motion.power == own.power

    def _moves_alike(self, motion: Motion) -> bool:
        """Whether another motion has the same breakpoints, wherever the others are."""
        keys = [one.key for one in self.others], [one.key for one in motion.others]
        return self.motion is not None and self.motion.lead == motion.lead and keys[0] == keys[1]

    def joins(self, other: EquilibriumProblem) -> bool:
        """Either side of first touch is a representation of its own."""
        if not isinstance(other, MeshedContact):
            return False
        one, two = self.equations, other.equations
        return (one.contact, one.level, one.regions) == (two.contact, two.level, two.regions)

    def resolving(self, point: Point, tolerance: float) -> Self:
        """A mesh made for a state; in a tiny contact with panels graded down to its radius.

        The gap's answer s = (2/π) arccos(a/r) to a rigid motion varies on the scale of the radius a; on panels far
        longer the radius of a fold has a relative error that further panels farther out do not cure.
        """
        u = point.parameter
        problem, x = self.anchored(self.fitting(point.x, u), point.x, u)
        if problem.relative_error(x, u) > tolerance:
            return problem.remeshed(x, u, tolerance, solve=False)[0]
        mesh = problem.mesh
        length = SHARE * self.equations.coordinate.radius(self.coordinate(u)) if 0.0 < u < SMALL else 0.0
        length /= problem._stretch(x) if problem.motion else 1.0
        if not (self.equations.contact and 0.0 < length < mesh.innermost / GRADING):
            return problem
        count = min(PANELS, math.ceil(math.log(mesh.innermost / length) / math.log(GRADING)))
        inner = mesh.innermost * (length / mesh.innermost) ** (np.arange(count, 0, -1) / count)
        edges = np.concatenate([[0.0], inner, mesh.edges[1:]])
        return problem.on_mesh(problem._mesh(edges, problem.motion, mesh.bounded))

    def solve_at(self, x: Array, p: float, iterations: int = 12, enough: float = 1e-13) -> Array:
        """Newton's method at a fixed parameter, up to a relative change that is enough; the best that was reached."""
        best, size, valid, stalls = x, math.inf, x, 0
        for _ in range(iterations):
            check()
            self.work.newton += 1
            try:
                fields, valid = self.fields(x, p), x
            except ModelError:  # breakpoints have left the mesh
                return valid
            if not fields.finite:
                return best
            step = factorised(self.jacobian(x, p))(-self.residual(x, p))
            change = magnitude(step)
            if change >= 0.7 * size:
                stalls += 1
                if stalls == STALLS or change < 1e-8 * max(1.0, magnitude(x)):
                    return best  # rounding, which a matrix that is all but singular blows up
            x = x + step
            if not change < 1e3 * max(1.0, size):
                return best
            best, size = x, change
            if change < enough * max(1.0, magnitude(x)):
                return best
        return best

    def relative_error(self, x: Array, p: float) -> float:
        """Discretisation error of a solution relative to max(1, |value|): the larger of load's and displacement's."""
        error, (load, displacement) = self.error(x, p), self._units(*self.seen(x, p))
        return max(abs(error.load) / load, abs(error.displacement) / displacement)

    def _units(self, equations: Equations, fields: Fields) -> tuple[float, float]:
        """What errors of load and displacement are relative to: max(1, |value|), or, where edges of regions move by
        what pressures do, what these bear and lift, if that is less."""
        load, displacement = (max(1.0, abs(v)) for v in (equations.load(fields), equations.displacement(fields)))
        if not self.mesh.roots:
            return load, displacement
        borne = 2 * math.pi * float((equations.mesh.weights * equations.mesh.nodes) @ np.abs(fields.pressure))
        return min(load, borne + LEAST), min(displacement, magnitude(fields.h) + LEAST)
