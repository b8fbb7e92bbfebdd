"""The contact as a problem that the curve layer can follow: h(tau) against the contact coordinate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from contbranch.contact.contact import Contact
from contbranch.continuation import (
    Adaptation,
    Balance,
    CorrectionError,
    EventPoint,
    Linearisation,
    Options,
    Outcome,
    Point,
    StopAt,
)
from contbranch.continuation.edge import Range
from contbranch.continuation.follow import follow
from contbranch.control import Control
from contbranch.curve.events import Margin
from contbranch.curve.problem import (
    STEPS,
    Count,
    Defect,
    EquilibriumProblem,
    Rates,
    Search,
    Succession,
    Values,
    Work,
    equilibrium,
    oriented,
)
from contbranch.errors import ModelError
from contbranch.models.quadrature import start_edges
from contbranch.results.diagram import ModeShape, Profile
from contbranch.watch import check

from .adapt import CORE, Solver, adapted_edges, defect_error, needed_reach, panel_errors, roughness
from .azimuthal import counted, eigenvalues, mode_shape
from .equations import RECENT, ContactCoordinate, Equations, Fields, felt
from .front import Edge, Front, Kink, steepest
from .mesh import Mesh, mesh_on
from .profile import profile_of
from .relaxation import Release
from .search import search_from
from .slope import load_per_displacement

if TYPE_CHECKING:
    from contbranch.models.rings.handover import Disc

__all__ = ["ContactProblem", "Resolution", "first_problem", "order_for"]

Array = NDArray[np.float64]

# A new mesh aims below the tolerance by this factor, so that the solution can move on before it must be changed again.
SLACK = 0.06
# A step to a solution whose error exceeds the tolerance by this factor is repeated shorter, so that meshes can follow.
UNRESOLVED = 20.0
# ... unless it is as short as this already, relative to the parameter: errors jump where a node passes a tip's end.
JUMP = 1e-4
# A change of mesh may move the solution by this multiple of its error estimate.
LEAP = 30.0
# ... and ln of the stretch by this much.
STRETCHED = 0.1
# Gaps, in ranges, that no solution has.
DEEPEST = 0.5
# While tracing, a gap or a wall pressure may be this much below zero, in the interaction's own units: errors of the
# discretisation close to the rim are not to look like a wall that pulls.
TOLERATED = 1e-3
# Share of the accuracy that the load at the start of the trace may have.
START_SHARE = 0.5
# A law that begins with a stiffness does so abruptly where elasticity answers it within this share of a panel's length.
ABRUPT = 0.1
# A trace with a spring starts where the stiffness of the interaction is about this share of the spring's.
SOFTER = 0.05
# ... and that of the interaction at the start where it ends with a kink.
NEXT_TO_NOTHING = 1e-12
# Steps of the gap far away in units of the wavelength of layers.
LONGEST_IN_LAYERS = 0.15
# Changes of h small against the range of the interaction, over the width √(2 range), do not matter for the steps.
STATE_FLOOR = 0.3
# Below this radius parameter meshes are graded down to this share of the radius, each panel longer by this factor than
# the one inside; if those are too many panels, by a larger one: the tinier the radius, the less its scale matters.
SMALL, SHARE, GRADING, PANELS = 1e-2, 0.5, 4.0, 8
# Estimates of the rows' errors are those of one Newton step on a finer mesh.
ROW_SAFETY = 3.0
# Rows, from the last admissible one backwards, from which free boundaries take over until one succeeds; the first step
# from there as a share of the last one.
TRIES, HANDED = 4, 0.1
# A coarser mesh is worth its while if it has fewer unknowns by this factor; rounds in which it is made.
FEWER, COARSENINGS = 0.8, 4
# From first touch up to this parameter the rate of the load comes from the slope dF/dd, which keeps its digits
# there, unless the displacement all but stands still: its rate must be at least this share of its parts.
TINY, MOVING = 1e-2, 0.1
# Rounds of meshing, solving and judging until a mesh satisfies its own error estimate, and the change by Newton's
# method after which the solution is good enough for that: the next one would be its square.
ROUNDS, NEARLY = 6, 1e-5
# Unknowns that a state may be given where it is not smooth.
MOST = 1000
# ln of the largest stretch of a mesh; a pivot below this share of its column says that the front alone moves.
FARTHEST, TINY_PIVOT = 30.0, 1e-12
# Radius of a contact under a flat tip in which rings that have been passed over do not matter, as a share of the
# innermost panel.
DISHED = 1e-3
# A film whose response elasticity answers on a length below this is stiff; the contact behind first touch at which the
# direction of the curve is then taken, as a share of the radius of the front.
STIFF, SEEN = 1e-3, 0.01
# Residuals, as a share of the state, up to which such a contact is found; contacts that answer the radius by its
# square, as a share of the length on which elasticity answers.
SETTLED, BELOW = 1e-8, 0.1
# By how much less than the parameter the state counts there, whose rate changes around the rim all along the kink.
CALM = 10.0
# Multiple of rounding at which corrections may stop contracting: stiff films are ill-conditioned.
NOISE = 1e7
# Edges of panels below this share of the distance to the edge of a tip are kept where the mesh is to end there.
INSIDE = 0.97
# Share of a tip's extent up to which the contact may grow, and beyond which the gap closes at its edge.
WHOLE, OUTERMOST = 0.999, 0.9
# The rim of a contact in a stiff film rests where it is all but indifferent: eigenvalues up to this (of the elastic
# energy's) are the discretisation's.
INDIFFERENT = 1e-6
# Changes of the state are measured in at least this multiple of the rounding errors of its slopes.
LOUD = 1e5
# ln of the multiple of its load up to which a film is followed to its next fold, or to contact; gaps at which its
# pressure is looked at; the gap of a film that is pressed changes by less than this share of the displacement.
BEYOND, BARRIER, PRESSED = math.log(1e9), 400, 0.1
ENDURES = "The film stays: under so sharp a tip, the load at which it is squeezed out is more than 1e9 times larger."
# At first touch a mesh aims at this share of the tolerance, since tiny contacts ask for more than the touch itself.
AHEAD = 0.1


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


def first_problem(contact: Contact, accuracy: float, tolerance: float) -> ContactProblem:
    """The problem from which the curve of a reduced contact starts."""
    tip, law = contact.axisymmetric_tip, contact.interaction
    coordinate = ContactCoordinate(tip, min(tip.apex_exponent, 2.0))
    resolution = Resolution(tolerance, order_for(tolerance), contact, accuracy, moving=felt(tip, law))
    mesh = mesh_on(np.array([0.0, 1.0]), resolution.order)
    scale = 1.0 if law is None else min(term.range for term in law.terms)
    return ContactProblem(Equations(tip, law, mesh, coordinate, False), scale, resolution)


class ContactProblem(EquilibriumProblem):
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
        self.film = front if front and front.film and equations.softens else None
        self._slopes = self.film.slopes(mesh) if self.film else None
        self._seen: list[tuple[Array, float, Equations, Fields]] = []
        self._corrected: tuple[Array, Solver] | None = None
        self._row = math.nan  # parameter of the last row
        self.work = resolution.work
        self.work.unknowns = max(self.work.unknowns, mesh.size)

    # -- the equations ------------------------------------------------------------------------------------------------
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
        known = next((one[2] for one in self._seen if one[0][-1] == x[-1]), None)
        equations = known or self.equations.stretched(math.exp(min(max(float(x[-1]), -FARTHEST), FARTHEST)))
        fields = equations.fields(self.growth(x) * x[:-1], y)
        self._seen = [(x, y, equations, fields), *self._seen[: RECENT - 1]]
        return equations, fields

    def growth(self, x: Array) -> float:
        """e^(nσ): what a state grows by where it keeps its shape as the front moves."""
        return 1.0 if self.front is None else math.exp(self.front.power * min(max(float(x[-1]), -FARTHEST), FARTHEST))

    def fields(self, x: Array, u: float) -> Fields:
        """Everything that follows from a state."""
        return self.seen(x, u)[1]

    def residual(self, x: Array, p: float) -> Array:
        """Residual R, (N,), and how far the front is from its place; both e^(−nσ) times."""
        equations, fields = self.seen(x, p)
        if self.front is None:
            return fields.residual
        off = self.front.off(self.equations.mesh, equations, fields, float(x[-1]))
        return np.append(fields.residual, off) / self.growth(x)

    def jacobian(self, x: Array, p: float) -> Array:
        """dR/dx, (N, N); with a front bordered by the derivatives with respect to σ and those of its equation."""
        equations, fields = self.seen(x, p)
        if self.front is None:
            return equations.jacobian(fields)
        n, power = equations.mesh.size, self.front.power
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = equations.jacobian(fields)
        matrix[n, :n], spread, _ = self.front.derivatives(self.equations.mesh, equations, fields)
        matrix[:, n] = np.append(equations.spread(fields, power)[1], spread) / self.growth(x)
        matrix[:, n] -= power * self.residual(x, p)
        return matrix

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """dR/du, (N,), and that of the front's equation."""
        equations, fields = self.seen(x, p)
        residual = equations.slopes(fields)[1]
        if self.front is not None:
            off = self.front.derivatives(self.equations.mesh, equations, fields)[2]
            residual = np.append(residual, off) / self.growth(x)
        return residual * (self.scale * math.cosh(p))

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual and derivatives from one evaluation of the fields."""
        self.work.newton += 1
        fields = self.fields(x, p)
        if not fields.finite:
            return Linearisation(fields.residual, np.empty((0, 0)), fields.residual)
        return Linearisation(self.residual(x, p), self.jacobian(x, p), self.parameter_derivative(x, p))

    def product(self, x: Array, p: float, jacobian: Array) -> Callable[[Array], Array] | None:
        """What multiplies by dR/dx in a pressed film."""
        if not self.film:
            return None
        (equations, fields), n = self.seen(x, p), self.size

        def multiplied(v: Array) -> Array:
            own = equations.multiplied(fields, v[:n])
            return np.asarray(np.append(own, jacobian[n, :n] @ v[:n]) + jacobian[:, n] * v[n])

        return multiplied

    def moving(self, x_rate: Array, x: Array, through: bool = True) -> Array:
        """The rate of h where it is, (N,), of a direction of states: the mesh may move through it, or take h along."""
        if self.front is None:
            return x_rate
        mesh, h = self.equations.mesh, x[:-1]
        spread = self.front.power * h - (mesh.nodes * mesh.derivative(h) if through else 0.0)
        return self.growth(x) * np.asarray(x_rate[:-1] + spread * x_rate[-1])

    def following(self, x_rate: Array, x: Array, p: float, p_rate: float) -> Array:
        """The same direction as one that goes with a mesh at rest, with the mesh moving as its front does."""
        if self.front is None:
            return x_rate
        (equations, fields), mesh, h = self.seen(x, p), self.equations.mesh, x[:-1]
        taken = mesh.nodes * mesh.derivative(h) - self.front.power * h
        along, stretched, ahead = self.front.derivatives(mesh, equations, fields)
        along *= self.growth(x)
        off = along @ x_rate[:-1] + ahead * self.scale * math.cosh(p) * p_rate
        rate = -float(off / (along @ taken + stretched))
        return np.append(x_rate[:-1] + rate * taken, rate)

    def still(self, x: Array) -> tuple[ContactProblem, Array]:
        """The problem on the mesh of a state, which stays as it is, and the state."""
        if self.front is None:
            return self, x
        equations = self.equations.on(self.equations.mesh.stretched(math.exp(float(x[-1]))))
        return ContactProblem(equations, self.scale, self.resolution, self.sharpness), self.growth(x) * x[:-1]

    def inner(self, u: Array, v: Array) -> float:
        """∫ u v dtau, which does not know the mesh, and the front's share; in a pressed film also of slopes."""
        return float(self.dual(u) @ v)

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        found = self._weights * u
        if self._slopes is not None:
            mesh = self.equations.mesh
            found[:-1] += mesh.derivative_dual(self._slopes * mesh.derivative(u[:-1]))
        return found

    def direction(self, x: Array, p: float) -> tuple[Array, float]:
        """A tangent of the curve where the parameter is monotone: (dh/du, 1)."""
        rate = np.linalg.solve(self.jacobian(x, p), -self.parameter_derivative(x, p))
        return np.asarray(rate, dtype=np.float64), 1.0

    # -- the curve ----------------------------------------------------------------------------------------------------
    def start(self, control: Control) -> Point:
        """Far away, where the interaction is negligible at the accuracy asked, and softer than a spring."""
        contact = self.resolution.contact
        if contact is None:
            raise ModelError("this problem does not begin a curve")
        law, problem, ends = contact.interaction, self, math.inf
        if law is None:
            u = -math.asinh(1.0)
        else:
            negligible = min(0.1, START_SHARE * self.resolution.accuracy / (2 * math.pi))
            if control.spring_stiffness is not None:
                negligible = min(negligible, SOFTER * control.spring_stiffness * self.scale / (2 * math.pi))
            far = law.reach(max(negligible, np.finfo(float).tiny))
            if kinked := far < law.kink < math.inf:  # nothing lies beyond, and all may happen next to it
                far = law.reach(min(negligible, NEXT_TO_NOTHING))
            width = contact.axisymmetric_tip.radius_at(min(far, 4 * max(term.range for term in law.terms)))
            edges = start_edges(width, max(contact.axisymmetric_tip.radius_at(far), 2 * width))
            if kinked:
                first = float(contact.axisymmetric_tip.radius_at(law.kink - far))
                sharp = contact.axisymmetric_tip.apex_exponent < 2.0  # under which the load grows with few powers of r
                edges = np.union1d(_graded(edges, first) if sharp else edges, first)
            elif (stiff := abs(float(law.evaluate(np.array([far])).stiffness[0])) * edges[1]) > ABRUPT:
                # Elasticity answers as soon as the law begins: the curve is followed from there, before anything acts.
                far = law.reach(np.finfo(float).tiny)
                edges = _graded(edges, edges[1] * ABRUPT / stiff)
            problem = self.on_mesh(mesh_on(edges, self.resolution.order))
            u, ends = self.parameter(-max(far, self.scale)), law.ends
        self.resolution.far, x = u, np.zeros(problem.size)
        if isinstance(front := problem._fronted(x, u), Edge):
            problem, x = problem.anchored(front, x, u)
        problem, x = problem.resolved(problem.solve_at(x, u), u, self.resolution.tolerance)
        start = oriented(problem, x, u, (np.zeros(x.size), 1.0))
        return problem._nearer(start, self.parameter(-ends)) if self.parameter(-ends) > u else start

    def _nearer(self, start: Point, u: float) -> Point:
        """Where a law's description ends, on the curve from farther away."""
        options, far = self.steps(start), Range(start.parameter, u)
        self.resolution.far = u
        margins = [Margin(name) for name in self.margins(start.x, start.parameter)]
        branch = follow(start, self.balance(start), far, options, margins, StopAt())
        last = branch.points[-1] if branch.points else start
        if branch.end.outcome is not Outcome.REACHED_EDGE:
            why = "".join(event.name for event, _ in branch.events if isinstance(event, EventPoint))
            text = self.ending(why, last) if why else branch.end.message
            raise CorrectionError(branch.end.outcome, f"{text} That is beyond the law's table: continue it.")
        return oriented(equilibrium(last), last.x, u, (last.tangent_x, last.tangent_parameter))

    def resolved(self, x: Array, p: float, tolerance: float) -> tuple[ContactProblem, Array]:
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

    def balance(self, start: Point, step: float | None = None) -> Balance:
        """First scales; `step`: of the parameter, a kink at first touch long past, as it is where a contact begins."""
        if start.parameter > 0.0:
            step = start.parameter
        if step is None:
            return super().balance(start)
        length = step / STEPS.first_step
        return Balance(CALM * length * math.sqrt(self.inner(start.tangent_x, start.tangent_x)), length)

    @property
    def parameter_range(self) -> tuple[float, float]:
        """First touch, u = 0, is where either side ends; a contact grows no larger than the tip."""
        if not self.equations.contact:
            return self.resolution.far, 0.0
        coordinate, extent = self.equations.coordinate, self.equations.tip.extent
        return 0.0, self.parameter(coordinate.of(extent, 0.0)) if math.isfinite(extent) else math.inf

    def steps(self, start: Point) -> Options:
        """Far away a step may be long, since the elastic body answers little; not so long as to miss a layer."""
        floor = STATE_FLOOR * self.scale * (2 * self.scale) ** 0.25
        if self.film:
            rough = start.x * (-1.0) ** np.arange(start.x.size)
            floor = max(floor, LOUD * np.finfo(float).eps * math.sqrt(self.inner(rough, rough)))
        steps = replace(STEPS, state_floor=floor, noise=NOISE)
        law, u = self.equations.interaction, start.parameter
        if law is None or not math.isfinite(law.wave) or u == 0.0:
            return steps
        longest = LONGEST_IN_LAYERS * law.wave / (self.scale * math.cosh(u) * abs(u))
        return replace(steps, largest_parameter_step=min(steps.largest_parameter_step, longest))

    def margins(self, x: Array, p: float) -> Mapping[str, float]:
        """Whether a disc is right: smallest gap outside and wall pressure inside, in the interaction's own units."""
        equations, fields = self.seen(x, p)
        if "admissible" not in fields.derived:
            fields.derived["admissible"] = equations.admissibility(fields, self.scale)
        least, radius = fields.derived["admissible"]
        least, extent = least + (TOLERATED if self.equations.contact else 0.0), equations.tip.extent
        if not math.isfinite(extent):
            return {"inadmissible": least}
        outside = radius > OUTERMOST * extent  # the edge of a tip is a corner, at which films are squeezed out first
        return {
            "inadmissible": 1.0 if outside else least,
            "tip-edge": min(WHOLE - fields.rim.radius / extent, least if outside else 1.0),
        }

    def successor(self, name: str, points: Sequence[Point]) -> Succession | None:
        """First touch is followed by a disc of contact, a contact set that stops being a disc by any other.

        Raises
        ------
        ModelError
            If the curve is not found again with free boundaries.
        """
        last = points[-1]
        if name == "inadmissible":
            return self._freed(points)
        if last.parameter != 0.0 or self.equations.contact:
            return None
        still, h = self.still(last.x)
        disc = still._behind()
        start = disc.touching(h)
        problem = start.problem
        kinked = isinstance(problem, ContactProblem) and bool(start.label) and (problem.flat or disc.resists(h))
        step = problem.ahead() if isinstance(problem, ContactProblem) and kinked else None
        if step and step**2 * problem.inner(start.tangent_x, start.tangent_x) > problem.inner(start.x, start.x):
            step = None  # a dimple far smaller than the film touches
        starts = (start,) if start.label and not disc.flat else (*islice(disc.passed(start), 1), start)
        return Succession("touch", last, starts, step=step, others=lambda: chain(disc.graded(h), disc.passed(start)))

    def _behind(self) -> ContactProblem:
        """The problem on the other side of first touch."""
        other = self.equations.touching(not self.equations.contact)
        return ContactProblem(other, self.scale, self.resolution, self.sharpness)

    def across(self, x: Array, p: float) -> tuple[Point, ...]:
        """First touch on the other side.

        A stiff film answers a tiny contact on a length far below the innermost panel: then with graded panels.
        """
        if p != 0.0:
            return ()
        still, h = self.still(x)
        other = still._behind()
        if other.equations.contact:
            return other.touching(h), *other.graded(h)
        return (other.touching(other.solve_at(h, 0.0)),)

    def _freed(self, points: Sequence[Point]) -> Succession:
        """The curve with free boundaries, from the last row that is admissible."""
        from contbranch.models.rings.handover import taken_over

        failure = ModelError("no admissible state was left")
        # A fold is left to one of the two.
        right = [k for k, point in enumerate(points) if k and not point.label and _margin(point) > 0.0]
        for k in reversed(right[-TRIES:]):
            try:
                start = taken_over(
                    self.equations.tip,
                    self.equations.interaction,
                    self.resolution.accuracy,
                    _disc(points[k]),
                    self.work,
                )
            except ModelError as error:
                failure = error
                continue
            here, before = points[k].observables, points[k - 1].observables
            moved = math.hypot(*(here[name] - before[name] for name in ("contact_radius", "displacement")))
            return Succession("", points[k], (start,), dropped=len(points) - k, step=HANDED * max(moved, 1e-4))
        raise failure

    def touching(self, x: Array) -> Point:
        """First touch as a point of the side in contact, towards larger contacts, on a mesh that resolves it.

        Labelled, unless the contact that has passed the kink of a stiff film was not found.
        """
        problem, x = self.resolved(x, 0.0, AHEAD * self.resolution.tolerance)
        problem, x = problem.anchored(problem._fronted(x, 0.0), x, 0.0)
        kinked = problem.moves and problem.resists(x)
        if kinked and (found := problem._beyond(x)):
            return found
        rate, one = problem.direction(x, 0.0)
        seen = problem.values(x, 0.0)._asdict()
        return Point(problem, x, 0.0, rate, one, observables=seen, label="" if kinked else "start")

    def ahead(self) -> float:
        """Parameter of a contact that has long passed the kink, seen from the front."""
        radius = SEEN * (self.front.place if isinstance(self.front, Front) else 1.0)
        if self.flat:
            radius = min(radius, DISHED * self.equations.mesh.innermost)
        return self.parameter(self.equations.coordinate.of(radius, 0.0))

    def _beyond(self, x: Array) -> Point | None:
        """First touch in a stiff film, on a mesh made for a contact that has passed its kink; None if none is found.

        The limit of the slope at first touch holds for contacts below the length of elasticity's answer only.
        """
        ahead = self.ahead()
        here = self.solve_at(x, ahead)
        if not self._settled(here, ahead):
            return None
        problem, here = self.resolved(here, ahead, self.resolution.tolerance)
        x = problem.solve_at(here, 0.0)
        seen = problem.values(x, 0.0)._asdict()
        return Point(problem, x, 0.0, (here - x) / ahead, 1.0, observables=seen, label="start")

    def _small(self, x: Array) -> float:
        """Parameter of a contact far smaller than the length on which elasticity answers the interaction."""
        return self.parameter(self.equations.coordinate.of(BELOW * self.answer(x), 0.0))

    def _settled(self, x: Array, p: float) -> bool:
        """Whether Newton's method has found a solution."""
        off = float(np.abs(self.residual(x, p)).max())
        return off <= SETTLED * float(np.abs(x).max()) and not self.lost(x, p)

    def passed(self, start: Point) -> Iterator[Point]:
        """Contacts that have passed their kink.

        Rounding may hide the way from first touch to there, and the slope may vary all along it: under a tip like r^n
        the gap answers the radius as aⁿ does, and by far more as a² does, which rules from a tiny radius on.
        """
        problem = equilibrium(start)
        if not isinstance(problem, ContactProblem):
            return
        sizes = problem._small(start.x), problem.ahead()
        for ahead in reversed(sizes) if problem.flat else sizes:
            x = problem.solve_at(start.x + ahead * start.tangent_x / start.tangent_parameter, ahead)
            if not problem._settled(x, ahead):
                continue
            try:
                found, x = problem.resolved(x, ahead, problem.resolution.tolerance)
                rate, one = found.direction(x, ahead)
                seen = found.observables(x, ahead)
            except (CorrectionError, np.linalg.LinAlgError, ModelError):
                continue
            yield Point(found, x, ahead, rate, one, observables=seen, label="start")

    @property
    def begins(self) -> str | None:
        """The end of a law's table."""
        law = self.equations.interaction
        return None if law is None or math.isinf(law.ends) else "table-end"

    def ending(self, name: str, point: Point) -> str:
        """Why the curve ends."""
        if name == "end":
            return "" if self.equations.contact else ENDURES
        if name == "inadmissible":
            return (
                "The branch ends where the contact set stops being a disc: the gap would close outside the contact, or "
                "the wall would have to pull."
            )
        if name == "tip-edge":
            return "The contact has come to the edge of the tip, where its description ends."
        tip = self.equations.tip
        if not math.isfinite(tip.extent):
            return ""
        equations, fields = self.seen(point.x, point.parameter)
        r = np.hypot(equations.mesh.nodes, fields.rim.radius)
        felt = r[np.abs(fields.pressure) > 1e-3 * np.abs(fields.pressure).max()]
        if max(fields.rim.radius, float(felt.max(initial=0.0))) < 0.9 * tip.extent:
            return ""
        return "The contact, or the interaction around it, has reached the end of the tip."

    def endures(self, point: Point) -> bool:
        """Whether the film's next greatest pressure is out of reach: under a cone it is a logarithm of the load.

        Under a tip like r^n the pressure in the middle grows with the power (n − 1)/(n + 1) of the load; under a cone
        of slope z′ by z′E/4 with every factor e (I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47), if not by more as yet.
        """
        (equations, fields), law = self.seen(point.x, point.parameter), self.equations.interaction
        if equations.contact or law is None or equations.load(fields) <= 0.0:
            return False
        along = self.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        if not abs(along.central_gap) < PRESSED * abs(along.displacement):  # not yet pressed, but approached
            return False
        inwards = law.evaluate(np.linspace(-fields.y, 0.0, BARRIER))
        rate = -float(inwards.stiffness[0]) * along.central_gap * equations.load(fields) / along.load
        tip = equations.tip
        rate = max(rate, float(tip.height_derivative(np.float64(felt(tip, law)))) / 4)
        falls = np.flatnonzero(np.diff(inwards.pressure) < 0.0)
        left = float(inwards.pressure[falls[0] if falls.size else -1] - inwards.pressure[0])
        power = (tip.apex_exponent - 1.0) / (tip.apex_exponent + 1.0)
        return left > rate * (math.expm1(power * BEYOND) / power if power else BEYOND)

    def before(self, control: Control, value: float) -> Point | None:
        """Out there the tip feels next to nothing: its displacement is minus the gap, and so is a spring's position."""
        if control.kind == "load":
            return None
        u = self.parameter(value)
        none = np.zeros(self.size)
        return oriented(self, self.solve_at(none, u), u, (none, 1.0))

    # -- what is seen -------------------------------------------------------------------------------------------------
    def values(self, x: Array, p: float) -> Values:
        """Load, displacement, contact radius, central gap, energy."""
        equations, fields = self.seen(x, p)
        gap = 0.0 if equations.contact else max(0.0, -fields.y)
        load, displacement = equations.load(fields), equations.displacement(fields)
        return Values(load, displacement, fields.rim.radius, gap, equations.energy(fields))

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """The values, by name, where the mesh resolves them."""
        unresolved = self.relative_error(x, p) > UNRESOLVED * self.resolution.tolerance
        if unresolved and not abs(p - self._row) < JUMP * abs(p):
            raise ModelError("the mesh does not resolve the solution")  # which repeats the step shorter
        return self.values(x, p)._asdict()

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Rates of load, displacement, contact radius and central gap along a direction."""
        equations, fields = self.seen(x, p)
        y_rate, ends = self.scale * math.cosh(p) * p_rate, isinstance(self.front, Edge | Kink)
        h_rate = self.moving(x_rate, x, not ends)
        load, displacement = equations.rates(fields, h_rate, y_rate)
        if ends:  # where h ends as a square root does, its rate at a place is infinite, and at a kink ill told
            load += float(x_rate[-1]) * equations.load_per_stretch(fields)
        if 0.0 <= p < TINY and equations.interaction is not None:
            parts = abs(float(equations.rim_row @ h_rate))
            if abs(displacement) > MOVING * parts:
                if "slope" not in fields.derived:
                    fields.derived["slope"] = load_per_displacement(equations, fields, self._solver(x))
                load = fields.derived["slope"] * displacement
        if equations.contact:
            return Rates(load, displacement, equations.coordinate.slopes(fields.y)[0] * y_rate, 0.0)
        return Rates(load, displacement, 0.0, -y_rate)

    def unstable(self, x: Array, p: float) -> int:
        """Negative eigenvalues of the second variation at fixed displacement, by inertia.

        Deep in contact the rough answer is nearly always 0, which is what is expected; any other is checked finely.
        """
        equations, fields = self.seen(x, p)
        least = INDIFFERENT if self.film and equations.contact else 0.0
        return equations.unstable_modes(fields, finely=False) and equations.unstable_modes(fields, least=least)

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count | None:
        """Numbers of unstable modes cos mθ; none where no axisymmetric one is (see `azimuthal`, order in m)."""
        return counted(*self.seen(x, p), unstable, limit, near) if unstable else Count()

    def mode_eigenvalue(self, x: Array, p: float, mode: int, index: int = 1) -> float:
        """An eigenvalue of T_m on the present mesh; 0 where the interaction stiffens everywhere."""
        equations, fields = self.seen(x, p)
        if not bool((fields.stiffness < 0).any()):
            return 0.0
        return float(eigenvalues(equations, fields, mode, index)[-1])

    def mode_shape(self, x: Array, p: float, mode: int, index: int = 1) -> ModeShape:
        """Gap and pressure of the mode of that eigenvalue."""
        return mode_shape(*self.seen(x, p), mode, index)

    def profile(self, x: Array, p: float) -> Profile:
        """Gap and pressures over the radius."""
        return profile_of(*self.seen(x, p))

    # -- errors -------------------------------------------------------------------------------------------------------
    def defect(self, point: Point) -> Defect:
        """One Newton step towards the solution on the finer mesh."""
        return self.error(point.x, point.parameter)

    def error(self, x: Array, p: float) -> Defect:
        """Discretisation error of a solution."""
        equations, fields = self.seen(x, p)
        if "error" not in fields.derived:
            fields.derived["error"] = defect_error(equations, fields, self._solver(x))
        found: Defect = fields.derived["error"]
        return found

    def _solver(self, x: Array) -> Solver | None:
        """What solves with dR/dh at the point found last; None at any other."""
        found, solve = self._corrected or (None, None)
        if found is not x or solve is None or self.front is None:
            return solve if found is x else None
        solved, pushed = solve, solve(np.append(np.zeros(x.size - 1), 1.0))
        if not abs(pushed[-1]) > TINY_PIVOT * float(np.abs(pushed).max()):
            return None

        def held(f: Array) -> Array:  # with the mesh where it is
            answer = solved(np.append(f, 0.0))
            return np.asarray((answer - answer[-1] / pushed[-1] * pushed)[:-1])

        return held

    # -- meshes -------------------------------------------------------------------------------------------------------
    def corrected(self, x: Array, p: float, solve: Solver) -> None:
        """Keep what the next error estimate is made with."""
        self._corrected = x, solve

    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A better mesh where the error estimate exceeds the tolerance, or where far fewer panels would do."""
        self._row = p
        problem, start = self._refitted(x, p)
        front = problem._fronted(start, p)
        if problem is self and front is self.front:
            return None
        transfer = moved = None
        if front is not self.front:
            problem, start = problem.anchored(front, start, p)

            def moved(x: Array, p: float, x_rate: Array, p_rate: float) -> tuple[Array, Array]:
                state, rate = self.carried(x, x, p, problem), self.carried(x_rate, x, p, problem)
                return state, problem.following(rate, state, p, p_rate)

        if front is None is self.front:
            transfer = self.equations.mesh.sampler(problem.equations.mesh.nodes)
        elif front is self.front or (self.moves and problem.moves):  # another place to follow, which moves alike
            sampler = self.equations.mesh.sampler(problem.equations.mesh.nodes)

            def transfer(vector: Array) -> Array:
                return np.append(sampler(vector[:-1]), vector[-1])

        problem._row = p
        self._corrected = None
        self._seen = []
        self.equations.forget()  # its points stay, by the thousand in cascades of layers, but are seldom asked again
        return Adaptation(problem, start, transfer, moved)

    def _refitted(self, x: Array, p: float) -> tuple[ContactProblem, Array]:
        """The problem on a mesh that satisfies the tolerance, if this one does not or is far finer, and the state."""
        equations, fields = self.seen(x, p)
        resolution, mesh = self.resolution, self.equations.mesh
        allowed = resolution.tolerance * max(1.0, abs(equations.load(fields)))
        reach = self._reach(equations, fields, 0.1 * allowed)
        error = self.relative_error(x, p)
        if not self.rough(x, p) and error <= resolution.tolerance and reach <= equations.mesh.edges[-1]:
            if error > 1e-3 * resolution.tolerance or mesh.panels <= 6:
                return self, x
            edges = adapted_edges(equations, fields, SLACK * allowed / self.sharpness, reach, mesh, self.within(x, p))
            if len(edges) > 0.75 * mesh.panels:
                return self, x
        problem: ContactProblem = self
        start = x
        for _ in range(ROUNDS):
            expected = problem.error(start, p).state
            trial, carried = problem.remeshed(start, p, solve=False)
            found = trial.solve_at(carried, p, enough=NEARLY)  # it is corrected by who asked
            change, told = found - carried, trial.told(problem)
            moves = trial.growth(found) * change[: trial.size], trial.moving(change, found)
            moved = min(float(np.abs(by[told]).max(initial=0.0)) for by in moves)
            astray = bool((np.abs(change[trial.size :]) > STRETCHED).any()) or trial.lost(found, p)
            if astray or not moved <= LEAP * expected + 1e-6 * self.scale:
                break  # Newton's method has left for another solution
            problem, start = trial, found
            if problem.relative_error(start, p) <= resolution.tolerance and not problem.rough(start, p):
                break
        return problem, start

    def within(self, x: Array, p: float) -> float:
        """Radius within which a film that is pressed has to be smooth: as far as it bears much.

        Under a flat tip it is squeezed out next to its edge first.
        """
        if not self.film or isinstance(self.film, Edge):
            return math.inf if self.film else 0.0
        equations, fields = self.seen(x, p)
        return float(equations.mesh.nodes[fields.pressure > CORE * float(fields.pressure.max())].max(initial=0.0))

    def rough(self, x: Array, p: float) -> bool:
        """Whether a film that is pressed is not smooth."""
        equations, fields = self.seen(x, p)
        within = self.within(x, p)
        return within > 0.0 and bool((roughness(equations, fields, equations.mesh.edges, within) > 1.0).any())

    def told(self, coarse: ContactProblem) -> slice:
        """Nodes at which a coarser mesh's panels tell the solution: not next to an edge, where it ends like a root."""
        mesh, own = coarse.equations.mesh, self.equations.mesh
        return slice(int(np.searchsorted(own.nodes, mesh.edges[-2])) if own.bounded else None)

    def _fronted(self, x: Array, p: float) -> Front | Edge | None:
        """What the mesh is to move with at a state."""
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
        return steepest((equations, fields), present, self.equations.mesh, self.resolution.moving)

    def anchored(self, front: Front | Edge | None, x: Array, p: float) -> tuple[ContactProblem, Array]:
        """The problem with another front, or with none, and the state."""
        if isinstance(self.front, Edge if isinstance(front, Edge) else Front) and not isinstance(front, Kink | None):
            return ContactProblem(self.equations, self.scale, self.resolution, self.sharpness, front), x
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
        return ContactProblem(still.equations, self.scale, self.resolution, self.sharpness, front), np.append(h, 0.0)

    def remeshed(
        self, x: Array, p: float, tolerance: float | None = None, solve: bool = True
    ) -> tuple[ContactProblem, Array]:
        """The problem on a mesh made for this solution, and the solution there (or, unsolved, carried to it)."""
        equations, fields = self.seen(x, p)
        unit, tolerance = self.equations.mesh, self.resolution.tolerance if tolerance is None else tolerance
        allowed = tolerance * max(1.0, abs(equations.load(fields)))
        reach = self._reach(equations, fields, 0.03 * allowed)
        end = equations.mesh.edges[-1]
        sharpness = self.sharpness
        if reach > end:
            # The solution is not known out there: lengthen first, judge the panels in the next round.
            count = int(np.ceil(np.log2(reach / end)))
            edges = np.append(unit.edges, unit.edges[-1] * (reach / end) ** (np.arange(1, count + 1) / count))
        else:
            error = self.relative_error(x, p)
            if error > tolerance:
                guide = float(panel_errors(equations, fields).sum()) / max(1.0, abs(equations.load(fields)))
                sharpness = min(max(sharpness, 2 * error / max(guide, 1e-16)), 1e6)
            edges = adapted_edges(equations, fields, SLACK * allowed / sharpness, reach, unit, self.within(x, p))
        return self.on(mesh_on(edges, self.resolution.order, unit.bounded), x, p, sharpness, solve)

    def _reach(self, equations: Equations, fields: Fields, tolerance: float) -> float:
        """How long the mesh is to be; a kink lies on it."""
        mesh = equations.mesh
        if mesh.bounded:
            return float(mesh.edges[-1])
        kink = self.front.place / self.equations.mesh.edges[-1] if isinstance(self.front, Kink) else 0.0
        return max(needed_reach(equations, fields, tolerance), kink * float(mesh.edges[-1]))

    def on(
        self, mesh: Mesh, x: Array, p: float, sharpness: float | None = None, solve: bool = True
    ) -> tuple[ContactProblem, Array]:
        """The problem on another mesh, and the solution of the same parameter there (or, unsolved, carried to it)."""
        problem = self.on_mesh(mesh, sharpness)
        n = self.size
        carried = np.append(self.equations.mesh.interpolate(x[:n], mesh.nodes), x[n:])
        return problem, problem.solve_at(carried, p) if solve else carried

    def on_mesh(self, mesh: Mesh, sharpness: float | None = None) -> ContactProblem:
        """The problem on another mesh, with the front where it is."""
        sharpness = self.sharpness if sharpness is None else sharpness
        return ContactProblem(self.equations.on(mesh), self.scale, self.resolution, sharpness, self.front)

    @property
    def moves(self) -> bool:
        """With a front; what is made for a state on a tip's edge ends there, too, and has its law's kink on an edge."""
        return isinstance(self.front, Front) and not isinstance(self.front, Kink)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.equations.mesh.size

    def finer(self) -> ContactProblem:
        """On panels of higher order."""
        return ContactProblem(self.equations.finer, self.scale, self.resolution, self.sharpness, self.front)

    def halved(self, point: Point, share: float) -> ContactProblem:
        """On panels halved where they do not resolve a state, of the trace's own order."""
        problem, x, u = self, point.x, point.parameter
        goal = max(share * self.relative_error(x, u), self.rounding)
        tried: list[tuple[float, ContactProblem]] = []
        for _ in range(ROUNDS):
            problem, x = problem.remeshed(x, u, goal)
            if problem.size > MOST and tried:
                break
            tried.append((problem.relative_error(x, u), problem))
            if tried[-1][0] <= goal:
                break
        return min(tried, key=lambda one: one[0])[1]

    def carried(self, vector: Array, x: Array, p: float, other: EquilibriumProblem) -> Array:
        """A function of tau on another problem's mesh, stretched to have the state at its front."""
        if not isinstance(other, ContactProblem):
            raise TypeError(f"{type(other).__name__} is not a ContactProblem")
        mesh, nodes, front = self.equations.mesh, other.equations.mesh.nodes, other.front
        if front == self.front:
            n = self.size
            return np.append(mesh.interpolate(vector[:n], nodes), vector[n:])
        equations, fields = self.seen(x, p)
        shift = front.anchored(equations, fields) if front is not None else 0.0
        function = fields.h if vector is x else self.moving(vector, x)
        found = equations.mesh.interpolate(function, math.exp(shift) * nodes)
        if front is None:
            return found
        return np.append(math.exp(-front.power * shift) * found, shift if vector is x else 0.0)

    def joins(self, other: EquilibriumProblem) -> bool:
        """Either side of first touch is a representation of its own."""
        return isinstance(other, ContactProblem) and other.equations.contact == self.equations.contact

    def resolving(self, point: Point, tolerance: float) -> ContactProblem:
        """A mesh made for a state; in a tiny contact with panels graded down to its radius.

        The gap's answer s = (2/π) arccos(a/r) to a rigid motion varies on the scale of the radius a; on panels far
        longer the radius of a fold has a relative error that further panels farther out do not cure.
        """
        if self.moves:
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

    def coarser(self, point: Point, tolerance: float) -> ContactProblem:
        """A mesh with clearly fewer nodes that serves a tolerance."""
        problem, x = self, point.x
        for _ in range(COARSENINGS):
            problem, x = problem.remeshed(x, point.parameter, tolerance)
            if problem.size > FEWER * self.size:
                break
            if problem.relative_error(x, point.parameter) <= tolerance:
                return problem
        return self

    # -- off the curve ------------------------------------------------------------------------------------------------
    def gradients(self, x: Array, p: float) -> tuple[Array, Array]:
        """Derivatives of load and displacement with respect to h, (N,) each."""
        return self.equations.gradients(self.fields(x, p))  # a search has no front

    def search(self, points: Sequence[Point]) -> Search | None:
        """On one mesh, from rows and undeformed states; without interaction there is nothing to find."""
        return None if self.equations.interaction is None else search_from(self, points)

    def relaxed(
        self, fold: Point, control: Control, direction: int, others: Sequence[Point], guarded: bool
    ) -> int | None:
        """Followed with a viscous half space, see `relaxation`."""
        y, goals = self.coordinate(fold.parameter), [self.coordinate(other.parameter) for other in others]
        equations, fields = self.seen(fold.x, fold.parameter)
        return Release(equations, fields.h, y, self.scale, control, direction, guarded).nearest(goals)

    def rows_within(self, tolerance: float) -> ContactProblem:
        """The first problem of the chain with rows as accurate as this."""
        contact = self.resolution.contact
        if contact is None:
            return self
        return first_problem(contact, self.resolution.accuracy, tolerance / ROW_SAFETY)

    def member(self, contact: Contact, tolerance: float | None = None) -> ContactProblem:
        """The same mesh and side of first touch for another contact, with the contact coordinate's scale and power."""
        tip, old, resolution = contact.axisymmetric_tip, self.equations, self.resolution
        if tolerance is not None:
            resolution = Resolution(tolerance, order_for(tolerance), work=self.work)
        coordinate = ContactCoordinate(tip, old.coordinate.power)
        equations = Equations(tip, contact.interaction, old.mesh, coordinate, old.contact)
        return ContactProblem(equations, self.scale, resolution, self.sharpness, self.front)

    @property
    def power(self) -> float:
        """In contact the load has a term of order a³ beside a²: it is smooth in the radius a and not in a^m ~ u."""
        return self.equations.coordinate.power if self.equations.contact else 1.0

    @property
    def beyond_edge(self) -> bool:
        """Without contact the equations go on into u > 0, where the gap would be negative at the centre."""
        return not self.equations.contact

    def answer(self, x: Array) -> float:
        """The length on which elasticity answers the interaction at first touch."""
        return 0.5 / max(1.0, float(np.abs(self.fields(x, 0.0).stiffness).max()))

    def resists(self, x: Array) -> bool:
        """Whether the film at first touch is so stiff that a contact has a kink of its own."""
        return 0.5 / max(1.0, float(self.fields(x, 0.0).stiffness[0])) < STIFF

    @property
    def flat(self) -> bool:
        """Whether the tip begins flatter than the dish that the film presses into the surface.

        However small, a ring of contact then comes before the disc, whose own slope at first touch means nothing.
        """
        return self.equations.tip.apex_exponent > 2.0

    def graded(self, x: Array) -> list[Point]:
        """First touch with panels graded down to the length on which elasticity answers the interaction."""
        mesh, length = self.equations.mesh, self.answer(x)
        if length >= mesh.innermost:
            return []
        problem, x = self.on(mesh_on(_graded(mesh.edges, length), self.resolution.order, mesh.bounded), x, 0.0)
        return [problem.touching(x)]

    def solve_at(self, x: Array, p: float, iterations: int = 12, enough: float = 1e-13) -> Array:
        """Newton's method at a fixed parameter, up to a relative change that is enough; the best that was reached."""
        best, size = x, math.inf
        for _ in range(iterations):
            check()
            self.work.newton += 1
            fields = self.fields(x, p)
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


def _graded(edges: Array, length: float) -> Array:
    """Edges of panels with further ones inside, down to a length."""
    count = max(1, math.ceil(math.log(edges[1] / length) / math.log(4)))
    return np.concatenate([[0.0], edges[1] * 4.0 ** np.arange(-count, 0), edges[1:]])


def _solved(factors: Array, pivots: Array, f: Array) -> Array:
    """Solve with a matrix whose transposed one is factorised: LAPACK stores by columns."""
    return np.asarray(lapack.dgetrs(factors, pivots, f, trans=1)[0])


def _margin(point: Point) -> float:
    """How far a disc is from being wrong, without tolerance."""
    margin = equilibrium(point).margins(point.x, point.parameter)["inadmissible"]
    return margin - (TOLERATED if point.observables["contact_radius"] > 0.0 else 0.0)


def _disc(point: Point) -> Disc:
    """What a model with free boundaries needs of a state."""
    from contbranch.models.rings.handover import Disc

    problem = point.problem
    if not isinstance(problem, ContactProblem):
        raise TypeError(f"{type(problem).__name__} is not a ContactProblem")
    equations, fields = problem.seen(point.x, point.parameter)
    a, mesh = fields.rim.radius, equations.mesh

    def pressure(r: Array) -> Array:
        found = mesh.interpolate(fields.pressure, np.sqrt(np.maximum(r * r - a * a, 0.0)))
        inside = r < a
        if inside.any():
            found[inside] = equations.inner_pressure(fields, r[inside])
        return found

    along = problem.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
    return Disc(a, equations.displacement(fields), np.hypot(mesh.edges[1:], a), pressure, along)
