"""The contact on meshes made for its solutions, finer where these ask for it, and coarser where they do not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np

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
    finer_error,
    needed_reach,
    panel_errors,
    roughness,
    similar,
    too_long,
)
from .creases import SHORTER, Crease, apart, creases_of, joined, located, shortened
from .equations import Equations, Fields
from .front import Edge, Front, Kink, kinks, steepest
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
JUMP = 1e-4
# By how much care may find a larger share of the error from one state to the next, and how often the last one counts:
# twice for a state.
SWELLS, TIMES = 1.5, 6
# A change of mesh may move the solution by this multiple of its error estimate.
LEAP = 30.0
# ... and ln of the stretch by this much, and creases by this share of their places.
STRETCHED = 0.1
# What serves no more is also left for a mesh whose load and displacement differ by this multiple of their errors.
SAFETY = 3.0
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
# Share of the wavelength of layers over which the gap changes where it passes from one to the next.
LAYER = 0.25
# A step between layers whose distance from the rim differs from the front's by this factor moves in a way of its own.
OF_ITS_OWN = 1.5
# Loads and lengths below this are nothing.
LEAST = 1e-12
# Ratio of neighbouring panels next to edges of regions that have moved, from which on a mesh is made anew.
OUTGROWN = 9.0
# A mesh is laid anew where panels between edges of regions are shortened down to this share.
RELAID = 0.1
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
        creases that have left their parts of the mesh."""
        try:
            return float(self.fields(x, p).gap.min()) < -DEEPEST * self.scale
        except ModelError:
            return True

    def values(self, x: Array, p: float) -> Values:
        """Load, displacement, contact radius, central gap, energy."""
        equations, fields = self.seen(x, p)
        gap = equations.rest if equations.contact else max(0.0, -fields.y)
        radius = fields.rim.radius if equations.contact and not equations.level else 0.0
        if any(region.rests and not region.index for region in equations.regions):
            radius = math.hypot(fields.rim.radius, equations.mesh.edges[equations.mesh.roots[self._wall_edge]])
        load, displacement = equations.load(fields), equations.displacement(fields)
        return Values(load, displacement, radius, gap, equations.energy(fields))

    @property
    def _wall_edge(self) -> int:
        """The number of the root edge that is the outermost of those of contact with the wall."""
        return max(k for k, region in enumerate(self.equations.regions) if region.rests and not region.index)

    def examine(self, x: Array, p: float) -> None:
        """Look whether the mesh resolves a row, or one as close to it as that."""
        if abs(p - self._row) < JUMP * abs(p):
            return
        if not self.relative_error(x, p, UNRESOLVED, shown=True) <= UNRESOLVED * self.resolution.tolerance:
            raise UnresolvedError("the mesh does not resolve the solution")
        self._row = p

    def defect(self, point: Point) -> Defect:
        """One Newton step towards the solution on the finer mesh."""
        return self.error(point.x, point.parameter)

    def error(self, x: Array, p: float, enough: float = 1.0, shown: bool = False) -> Defect:
        """Discretisation error; where a stiff contact pulls, with care if it exceeds a multiple of the tolerance.

        `shown`: or what care has shown of it at the last states on this mesh, if that leaves the mesh as it is.
        """
        equations, fields = self.seen(x, p)
        if self._judged and self._judged[0] is x and self._judged[1] == p:
            pass
        elif self.mesh.roots:
            self._judged = x, p, self._moving_error(x, p), False
        else:
            solve = self._solver(x)
            solve = None if solve is None else similar(equations, fields, solve)
            pulls = -float(fields.pressure.min()) > float(fields.pressure.max())
            self._judged = x, p, defect_error(equations, fields, solve), pulls and self._stiff(fields)
        found, doubtful = self._judged[2:]
        stated, tolerance = self._relative(found, equations, fields), self.resolution.tolerance
        if doubtful and stated > enough * tolerance:
            share, times = self._shown
            if shown and times and FINE * tolerance < share * stated <= enough * tolerance / SWELLS:
                self._shown = share, times - 1
                return Defect(*(share * error for error in found))
            careful = finer_error(equations, fields)
            if careful is not None:
                self._shown, found = (self._relative(careful, equations, fields) / stated, TIMES), careful
            self._judged = x, p, found, False
        return found

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
        front = problem._fronted(start, p)
        if problem is self and front is self.front:
            return None
        moved: Callable[[Array, float, Array, float], tuple[Array, Array]] | None = None
        transfer: Callable[[Array], Array] | None = None
        if front is not problem.front:
            problem, start = problem.anchored(front, start, p)
        else:
            problem.examine(start, p)  # whose error has been found, and will be nearly that of the row
        if front is not self.front:

            def moved(x: Array, p: float, x_rate: Array, p_rate: float) -> tuple[Array, Array]:
                state, rate = self.carried(x, x, p, problem), self.carried(x_rate, x, p, problem)
                return state, rate if self.mesh.roots else problem.following(rate, state, p, p_rate)

        if front is None is self.front:

            def transfer(vector: Array) -> Array:
                return self.equations.carried(vector, problem.equations)

        elif not self.creases and (front is self.front or (self.moves and self._as_moved(front))):
            n = self.size

            def transfer(vector: Array) -> Array:
                return np.append(self.equations.carried(vector[:n], problem.equations), vector[n:])

        self._corrected = None
        self._seen, self._placed = [], []
        self.equations.forget()  # its points stay, by the thousand in cascades of layers, but are seldom asked again
        return Adaptation(problem, start, transfer, moved)

    def _refitted(self, x: Array, p: float) -> tuple[Self, Array]:
        """The problem on a mesh that satisfies the tolerance, if this one does not or is far finer, and the state."""
        equations, fields = self.seen(x, p)
        resolution, mesh = self.resolution, self.placed(x).mesh
        allowed = resolution.tolerance * self._units(equations, fields)[0]
        reach = self._reach(equations, fields, 0.1 * allowed)
        error = self.relative_error(x, p, shown=True)
        served = not self.rough(x, p) and error <= resolution.tolerance and reach <= equations.mesh.end
        served = served and not (mesh.roots and too_long(mesh.edges, mesh, OUTGROWN).any())
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
            moved = min(magnitude(by[told]) for by in moves)
            away = np.abs(change[trial.size :])
            away[1:] /= [crease.place for crease in trial.creases]
            astray = bool((away > STRETCHED).any()) or trial.lost(found, p)
            near = moved <= LEAP * expected + 1e-6 * self.scale
            if astray or not (near or (not served and trial._foretold(found, problem, start, p))):
                break  # Newton's method has left for another solution
            problem, start, last, error = trial, found, error, trial.relative_error(found, p)
            spent = problem.sharpness == SHARPEST and error > HELPS * last  # what is left is rounding
            # What has kinks on no panel's edge never is smooth: one round towards it does.
            smooth = not (self.kinked or in_pieces(equations.tip, equations.interaction))
            if (error <= resolution.tolerance or spent) and not (smooth and problem.rough(start, p)):
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

    def _stiff(self, fields: Fields) -> bool:
        return magnitude(fields.stiffness) * self.resolution.moving > STIFF

    def within(self, x: Array, p: float) -> float:
        """Radius within which v'' has to be smooth: where a stiff contact may give way, a film as far as it bears much.

        Under a flat tip it is squeezed out next to its edge first.
        """
        equations, fields = self.seen(x, p)
        if not self.film or isinstance(self.film, Edge):
            return math.inf if self.film or self._stiff(fields) else 0.0
        return float(equations.mesh.nodes[fields.pressure > CORE * float(fields.pressure.max())].max(initial=0.0))

    def rough(self, x: Array, p: float) -> bool:
        """Whether v'' is not smooth where it has to be."""
        equations, fields = self.seen(x, p)
        within = self.within(x, p)
        return within > 0.0 and bool((roughness(equations, fields, equations.mesh.edges, within) > 1.0).any())

    def told(self, coarse: Self) -> slice:
        """Nodes at which a coarser mesh's panels tell the solution: not next to an edge, where it ends like a root."""
        mesh, own = coarse.mesh, self.mesh
        return slice(int(np.searchsorted(own.nodes, mesh.edges[-2])) if own.bounded else None)

    def _fronted(self, x: Array, p: float) -> Front | Edge | None:
        """What the mesh is to move with at a state: a front and its creases."""
        if self.mesh.roots and self.front is not None:
            short = self.creases and shortened(self.mesh, self.placed(x).mesh.edges) < RELAID
            return self._front_at(x) if short else self.front
        found = self._led(x, p)
        if found is None or (isinstance(found, Kink) and len(self.equations.kinks) == 1):
            return found
        (equations, fields), now, same = self.seen(x, p), self.placed(x).mesh, self._as_moved(found)
        stretch = equations.mesh.end / now.end
        unit = stretch if same else 1.0
        followed = [crease.stretched(stretch, 0.0) for crease in self._creases_at(x)]
        weight = found.weight if isinstance(found, Front) else float(equations.mesh.weights @ fields.h**2)
        law, own = equations.interaction, self.creases
        assert law is not None  # there is a front
        narrow, steps = min(self.scale, LAYER * law.wave), math.inf
        if self._stiff(fields):
            steps = 1.0 if isinstance(found, Edge) else OF_ITS_OWN
        others = [crease for crease in followed if not crease.kink]
        known = kinks((equations, fields), found, followed)
        if not isinstance(found, Kink):
            known = creases_of(equations.mesh, fields, narrow, unit * found.place, [*known, *others], steps)
        stay = same and {crease.key for crease in known} == {crease.key for crease in own}
        if stay and not (own and shortened(self.mesh, now.edges) < SHORTER):
            return found if found.creases is own else replace(found, creases=own)
        return replace(found, creases=tuple(crease.stretched(1 / unit, weight) for crease in known))

    def _led(self, x: Array, p: float) -> Front | Edge | None:
        """The front at a state."""
        equations, fields = self.seen(x, p)
        present = self.front
        if self.mesh.roots:
            return present
        if math.isfinite(equations.tip.extent):
            allowed = self.resolution.tolerance * self._units(equations, fields)[0]
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
            if front.creases is self.creases:
                return replace(self, front=front), x
            equations, n = self.placed(x), self.size
            h, edges = x[:n], joined(equations.mesh.edges, front.creases)
            if self.mesh.roots:
                roots, rooted = edges[list(equations.mesh.roots)], equations.mesh.root[-1] > 0
                edges = laid_edges(roots, edges, rooted, float(edges[-1]) if equations.mesh.bounded else None)
            if edges is not equations.mesh.edges:
                before, equations = equations, equations.on(self._mesh(edges, front, equations.mesh.bounded))
                h = before.carried(h, equations)
                front = self._about(front, equations.mesh) if self.mesh.roots else front
            start = np.append(h, [x[n], *np.zeros(len(front.creases))])
            return replace(self, equations=equations, front=front), start
        still, h = self.still(x)
        edges, ends = still.mesh.edges, isinstance(front, Edge)
        if ends or isinstance(front, Kink) or isinstance(self.front, Edge):
            if isinstance(front, Edge):
                edges = edges[:-1] if still.mesh.bounded else edges[edges < INSIDE * front.place]
                edges = joined(np.append(edges, front.place), front.creases)
            elif isinstance(front, Kink):
                edges = joined(front.joined(still.mesh, still.fields(h, p)), front.creases)
            before = still.equations
            still = still.on_mesh(self._mesh(edges, front, ends))
            h = before.carried(h, still.equations)
        if front is None:
            return still, h
        start = np.append(h, np.zeros(1 + len(front.creases)))
        return replace(still, front=front), start

    def remeshed(self, x: Array, p: float, tolerance: float | None = None, solve: bool = True) -> tuple[Self, Array]:
        """The problem on a mesh made for this solution, and the solution there (or, unsolved, carried to it)."""
        equations, fields = self.seen(x, p)
        unit, tolerance = self.placed(x).mesh, self.resolution.tolerance if tolerance is None else tolerance
        allowed = tolerance * self._units(equations, fields)[0]
        reach = self._reach(equations, fields, 0.03 * allowed)
        end = equations.mesh.end
        sharpness = self.sharpness
        if reach > end:
            # The solution is not known out there: lengthen first, judge the panels in the next round.
            count = int(np.ceil(np.log2(reach / end)))
            edges = np.append(unit.edges, unit.end * (reach / end) ** (np.arange(1, count + 1) / count))
        else:
            sharpness = self._sharpened(x, p, tolerance)
            edges = adapted_edges(equations, fields, SLACK * allowed / sharpness, reach, unit, self.within(x, p))
            edges = edges if unit.roots else joined(edges, self._creases_at(x))
        return self.on(self._mesh(edges, self._front_at(x), unit.bounded), x, p, sharpness, solve)

    def _sharpened(self, x: Array, p: float, tolerance: float) -> float:
        """The factor by which the guide is too optimistic here: as it was, or as the error of a state shows."""
        (equations, fields), error = self.seen(x, p), self.relative_error(x, p)
        guide = float(panel_errors(equations, fields).sum()) / self._units(equations, fields)[0]
        shown = min(max(2 * error / max(guide, 1e-16), 1.0), SHARPEST)
        return max(self.sharpness, shown) if error > tolerance else min(self.sharpness, shown)

    def _reach(self, equations: Equations, fields: Fields, tolerance: float) -> float:
        """How long the mesh is to be; a front lies on it."""
        mesh = equations.mesh
        if mesh.bounded:
            return float(mesh.end)
        front = self.front.place / self.mesh.end if isinstance(self.front, Front) else 0.0
        return max(needed_reach(equations, fields, tolerance), front * float(mesh.end))

    def on(
        self, mesh: Mesh, x: Array, p: float, sharpness: float | None = None, solve: bool = True
    ) -> tuple[Self, Array]:
        """The problem on another mesh, and the solution of the same parameter there (or, unsolved, carried to it)."""
        problem, n, tail = self.on_mesh(mesh, sharpness), self.size, x[self.size :]
        if self.front is not None and self.creases:  # which are at rest where they are
            fixed = mesh.innermost, self.front.place
            if mesh.roots:
                problem = replace(problem, front=self._front_at(x))
            else:
                problem = replace(problem, front=replace(self.front, creases=apart(self._creases_at(x), fixed)))
            tail = np.append(x[n : n + 1], np.zeros(len(self.creases)))
        carried = np.append(self.placed(x).carried(x[:n], problem.equations), tail)
        return problem, problem.solve_at(carried, p) if solve else carried

    def _front_at(self, x: Array) -> Front | Edge | None:
        """The front with its creases where a state has them."""
        if self.front is None or not self.creases:
            return self.front
        return self._about(replace(self.front, creases=self._creases_at(x)), self.mesh)

    def _about(self, front: Front | Edge, mesh: Mesh) -> Front | Edge:
        """The front with as much around its creases moving along as there is room for."""
        creases = [replace(crease, half=math.inf) for crease in front.creases]
        return replace(front, creases=apart(creases, (mesh.innermost, front.place)))

    def _mesh(self, edges: Array, front: Front | Edge | None, bounded: bool) -> Mesh:
        """The mesh of these edges, with roots where what moves with it has them."""
        places = np.array([] if front is None else sorted(one.place for one in (front, *front.creases) if one.root))
        roots = np.abs(edges[:, None] - places).argmin(axis=0)
        edges = edges.copy()
        edges[roots] = places  # from which rounding has taken them
        return mesh_on(edges, self.resolution.order, bounded, tuple(roots.tolist()))

    def on_mesh(self, mesh: Mesh, sharpness: float | None = None) -> Self:
        """The problem on another mesh, with the front where it is."""
        sharpness = self.sharpness if sharpness is None else sharpness
        return replace(self, equations=self.equations.on(mesh), sharpness=sharpness)

    @property
    def moves(self) -> bool:
        """With a front; what is made for a state on a tip's edge ends there, too, and moves with its law's kink."""
        return isinstance(self.front, Front) and not isinstance(self.front, Kink)

    def _as_moved(self, front: Front | Edge | None) -> bool:
        """Whether a state is the same with another front, but for creases: the mesh moves alike."""
        if front is self.front or (isinstance(front, Edge) and isinstance(self.front, Edge)):
            return True
        if isinstance(front, Kink) and isinstance(self.front, Kink):
            return replace(front, creases=self.creases) == self.front
        if not isinstance(front, Front) or isinstance(front, Kink) or not isinstance(self.front, Front):
            return False
        return front.power == self.front.power

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
        """On twice as many panels, with other edges unless creases are among these.

        What is not smooth right beside an edge, with no node between, is seen by no mesh that has it: all these agree.
        """
        mesh, edges = self.mesh, self.mesh.edges
        if 2 * self.size > FINEST:
            return self
        if self.kinked or self.creases:
            edges = np.union1d(edges, cuts(edges, mesh))
        else:
            inner = edges[:-1, None] + np.diff(edges)[:, None] * [0.25, 0.75]
            edges = np.concatenate([edges[:1], inner.ravel(), edges[-1:]])
        return self.on_mesh(self._mesh(edges, self.front, mesh.bounded))

    def carried(self, vector: Array, x: Array, p: float, other: EquilibriumProblem) -> Array:
        """A function of tau on another problem's mesh, stretched to have the state at its front."""
        if not isinstance(other, MeshedContact):
            raise TypeError(f"{type(other).__name__} is not a MeshedContact")
        front, n = other.front, self.size
        if front and self.mesh.roots and other.mesh.roots:  # what moves with the same edges of regions
            places = {crease.key: crease.place for crease in self._creases_at(x)}
            tail = np.array([x[n], *(places[crease.key] - crease.place for crease in front.creases)])
            there = other.placed(np.append(np.zeros(other.size), tail))
            return np.append(self.placed(x).carried(vector[:n], there), tail if vector is x else vector[n:])
        if front == self.front and not (self.creases and vector is x):
            return np.append(self.equations.carried(vector[:n], other.equations), vector[n:])
        here = self.placed(x).stretched(math.exp(float(x[n]))) if self.front else self.equations
        function, mesh = self.growth(x) * x[:n] if vector is x else self.moving(vector, x), here.mesh
        if front is None:
            return here.carried(function, other.equations)
        kept = self.front is not None and replace(front, creases=self.creases) == self.front
        about = float(x[n]) if self.front and self._as_moved(front) else 0.0
        shift = about if kept else front.anchored(*self.seen(x, p), about)
        places = {crease.key: crease.place for crease in self._creases_at(x)}
        stretch, beyond = float(mesh.end / self.mesh.end), math.exp(shift)

        def place(crease: Crease) -> float:
            if crease.key in places:
                return places[crease.key] * stretch
            return located(mesh, self.fields(x, p).gap, crease, beyond)

        by = [place(crease) / beyond - crease.place for crease in front.creases]
        state = np.concatenate([np.zeros(other.size), [shift], by])
        found = here.carried(function, other.placed(state), beyond)
        return np.append(math.exp(-front.power * shift) * found, state[other.size :] * float(vector is x))

    def joins(self, other: EquilibriumProblem) -> bool:
        """Either side of first touch is a representation of its own."""
        if not isinstance(other, MeshedContact):
            return False
        one, two = self.equations, other.equations
        return (one.contact, one.level, one.regions) == (two.contact, two.level, two.regions)

    def close_to(self, point: Point) -> Self:
        """With creases at rest where a state has them: they hardly move close by, and meshes need not be made anew."""
        if not self.creases or self.front is None or self.mesh.roots:
            return self
        return replace(self, equations=self.placed(point.x), front=replace(self.front, creases=()))

    def resolving(self, point: Point, tolerance: float) -> Self:
        """A mesh made for a state; in a tiny contact with panels graded down to its radius.

        The gap's answer s = (2/π) arccos(a/r) to a rigid motion varies on the scale of the radius a; on panels far
        longer the radius of a fold has a relative error that further panels farther out do not cure.
        """
        u = point.parameter
        problem, x = self._resting(point.x, u, tolerance)
        if problem.relative_error(x, u) > tolerance:
            return problem.remeshed(x, u, tolerance, solve=False)[0]
        mesh = problem.mesh
        length = SHARE * self.equations.coordinate.radius(self.coordinate(u)) if 0.0 < u < SMALL else 0.0
        length /= problem._stretch(x) if problem.front else 1.0
        if not (self.equations.contact and 0.0 < length < mesh.innermost / GRADING):
            return problem
        count = min(PANELS, math.ceil(math.log(mesh.innermost / length) / math.log(GRADING)))
        inner = mesh.innermost * (length / mesh.innermost) ** (np.arange(count, 0, -1) / count)
        edges = np.concatenate([[0.0], inner, mesh.edges[1:]])
        return problem.on_mesh(problem._mesh(edges, problem.front, mesh.bounded))

    def _resting(self, x: Array, p: float, tolerance: float) -> tuple[Self, Array]:
        """The problem on a mesh that moves with nothing but the edge of a tip and kinks of the law, and the state."""
        if self.mesh.roots:
            return self, x
        seen = self.seen(x, p)
        own = kinks(seen, self.front)
        fresh = self.front is None and bool(self.resolution.moving) and Kink.needed(seen, None) is not None
        if not (self.moves or fresh) and [crease.kink for crease in self.creases] == [True] * len(own):
            return self, x
        still, h = self.still(x)
        equations, fields = seen = still.seen(h, p)
        front: Edge | Kink | None = Edge.needed(seen, tolerance)
        if front is None and self.resolution.moving:
            front = Kink.needed(seen, None)
        if front is None:
            return still, h
        weight = float(equations.mesh.weights @ fields.h**2)
        front = replace(front, creases=tuple(crease.stretched(1.0, weight) for crease in kinks(seen, front)))
        return still.anchored(front, h, p)

    def solve_at(self, x: Array, p: float, iterations: int = 12, enough: float = 1e-13) -> Array:
        """Newton's method at a fixed parameter, up to a relative change that is enough; the best that was reached."""
        best, size, valid, stalls = x, math.inf, x, 0
        for _ in range(iterations):
            check()
            self.work.newton += 1
            try:
                fields, valid = self.fields(x, p), x
            except ModelError:  # creases have left the mesh
                return valid
            if not fields.finite:
                return best
            solve = factorised(self.jacobian(x, p))
            step = solve(-self.residual(x, p))
            change = magnitude(step)
            if change >= 0.7 * size:
                stalls += 1
                if stalls == STALLS or change < 1e-8 * max(1.0, magnitude(x)):
                    return best  # rounding, which a matrix that is all but singular blows up
            x = x + step
            self.corrected(x, p, solve)
            if not change < 1e3 * max(1.0, size):
                return best
            best, size = x, change
            if change < enough * max(1.0, magnitude(x)):
                return best
        return best

    def relative_error(self, x: Array, p: float, enough: float = 1.0, shown: bool = False) -> float:
        """Discretisation error of a solution relative to max(1, |value|): the larger of load's and displacement's."""
        return self._relative(self.error(x, p, enough, shown), *self.seen(x, p))

    def _relative(self, error: Defect, equations: Equations, fields: Fields) -> float:
        load, displacement = self._units(equations, fields)
        return max(abs(error.load) / load, abs(error.displacement) / displacement)

    def _units(self, equations: Equations, fields: Fields) -> tuple[float, float]:
        """What errors of load and displacement are relative to: max(1, |value|), or, where edges of regions move by
        what pressures do, what these bear and lift, if that is less."""
        load, displacement = (max(1.0, abs(v)) for v in (equations.load(fields), equations.displacement(fields)))
        if not self.mesh.roots:
            return load, displacement
        borne = 2 * math.pi * float((equations.mesh.weights * equations.mesh.nodes) @ np.abs(fields.pressure))
        return min(load, borne + LEAST), min(displacement, magnitude(fields.h) + LEAST)
