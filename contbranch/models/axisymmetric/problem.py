"""The contact as a problem that the curve layer can follow: h(tau) against the contact coordinate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from typing import Any

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.contact.contact import Contact
from contbranch.continuation import (
    Balance,
    CorrectionError,
    EventPoint,
    Options,
    Outcome,
    Point,
    StopAt,
)
from contbranch.continuation.edge import Range
from contbranch.continuation.follow import follow
from contbranch.continuation.problem import UnresolvedError
from contbranch.continuation.walk import annotated, unit_tangent
from contbranch.control import Control
from contbranch.curve.events import Margin
from contbranch.curve.problem import (
    STEPS,
    Count,
    Four,
    Rates,
    Search,
    Succession,
    equilibrium,
    oriented,
)
from contbranch.errors import ModelError
from contbranch.models.fronts import ENDURES, lasts
from contbranch.models.quadrature import start_edges
from contbranch.results.diagram import ModeShape, Profile

from .azimuthal import counted, eigenvalues, mode_shape
from .breakpoints import Row
from .changes import begun, born, narrowness, positions, problem_of, vanished
from .equations import ContactCoordinate, Equations, felt
from .law import BandedLaw
from .layered import LayeredEquations
from .laying import Functions, laid_edges, led_by
from .layout import Region
from .mesh import mesh_on
from .meshed import MeshedContact
from .moving import Resolution, order_for
from .profile import profile_of
from .regions import least_margin, radii_of
from .relaxation import Release
from .search import search_from

__all__ = ["ContactProblem", "first_problem"]

# A disc is followed while gap and wall pressure, in the interaction's own units, are at most this much below zero: the
# rings that come before discs under tips flatter than a parabola are shallower than that where a film attracts.
PRESSURE_TOLERANCE = 1e-3
# From first touch up to this parameter the rate of the load comes from the slope dF/dd, which keeps its digits there,
# unless the displacement all but stands still: its rate must be at least this share of its parts, which may both stand
# still, and this share of the largest rate of h.
NEXT_TO_TOUCH, MOVING, AT_ALL = 1e-2, 0.1, 1e-3
# Share of the accuracy that the load at the start of the trace may have.
START_SHARE = 0.5
# A trace with a spring starts where the stiffness of the interaction is about this share of the spring's.
SOFTER = 0.05
# ... and that of the interaction at the start where it ends with a kink.
NEXT_TO_NOTHING = 1e-12
# Gaps among which a curve begins, in units of the wavelength of layers.
BEFORE = np.linspace(0.0, 0.5, 33)
# A law made of pieces may rise from nothing and fall again in few of them: the first step is so much shorter.
WITHIN_A_PIECE = 0.1
# Steps of the gap far away in units of the wavelength of layers.
LONGEST_IN_LAYERS = 0.15
# Angle at which steps aim among layers: the curve turns all along as rings move through the mesh, and as foretold.
TURNING = 0.6
# Changes of h small against the range of the interaction, over the width √(2 range), do not matter for the steps.
STATE_FLOOR = 0.3
# Estimates of the rows' errors are those of one Newton step on a finer mesh.
ROW_SAFETY = 3.0
# Radius of a contact under a flat tip, as a share of the innermost panel; at least this multiple of the dish in which
# the surfaces meet on a ring first. The displacement of a disc falls as that grows within the dish. Under a soft film
# it is back at that of first touch, where the contact really goes on, at (n/2)^(1/(n − 2)) < √e radii of the dish. So
# many radii are tried, each twice the last, until the contact is a disc.
DISHED, CLEAR, LARGER = 1e-3, 2.0, 4
# Rows are made no more accurate than this where a law consists of pieces, as tables do: meshes would have to show each.
PIECED = 3e-8
# A film whose response elasticity answers on a length below this is stiff; the contact behind first touch at which the
# direction of the curve is then taken, as a share of the radius of the front.
STIFF, SEEN = 1e-3, 0.01
# Residuals, as a share of the state, up to which such a contact is found; contacts that answer the radius by its
# square, as a share of the length on which elasticity answers.
SETTLED, BELOW = 1e-8, 0.1
# By how much less than the parameter the state counts there, whose rate changes around the rim all along the kink.
CALM = 10.0
# Multiple of rounding at which corrections may stop contracting: stiff films are ill-conditioned. Changes of the state
# are measured in at least the second multiple of its own: behind first touch of a stiff film the first is more than the
# state changes.
NOISE, NOISE_FLOOR = 1e7, 1e10
# Share of a tip's extent up to which the contact may grow, and beyond which the gap closes at its edge.
WHOLE, OUTERMOST = 0.999, 0.9
# Share by which a disc grows in the difference that tells how its pressure does.
GROWN = 1e-4
# Gaps at which a film's pressure is looked at; the gap of one that is pressed changes by less than this share of the
# displacement.
BARRIER, PRESSED = 400, 0.1
# Radius of the disc on which a jump of the pressure begins, as a share of that at which the displacement first turns,
# and the smallest one looked at as a share of the radius at which the undeformed tip has that gap.
BORN, LEAST_DISC = 1e-2, 1e-9
# Where a curve starts at least, in units of the outermost gap at which the pressure jumps.
BEYOND = 1.5
# Relative error of load and displacement where a jump takes the place of a ring, in units of the square of the ring's
# width, measured against the closed form; no ring is narrower than this.
LEFT_OUT, NARROWEST_RING = 0.1, 3e-5
# At first touch a mesh aims at this share of the tolerance, since tiny contacts ask for more than the touch itself.
AHEAD = 0.1


def first_problem(contact: Contact, accuracy: float, tolerance: float) -> ContactProblem:
    """The problem from which the curve of a reduced contact starts."""
    reach = felt(contact.axisymmetric_tip, contact.interaction)
    resolution = Resolution(tolerance, order_for(tolerance), contact, accuracy, moving=reach)
    return _begun(resolution, contact, np.array([0.0, 1.0]), False)


def _begun(resolution: Resolution, contact: Contact, edges: Array, touching: bool) -> ContactProblem:
    tip, law = contact.axisymmetric_tip, contact.interaction
    coordinate = ContactCoordinate(tip, min(tip.apex_exponent, 2.0))
    scale = 1.0 if law is None else min(term.range for term in law.terms)
    around, mesh = (Region(False, BandedLaw(law).outermost),), mesh_on(edges, resolution.order)
    own = tip, law, mesh, coordinate, touching, around
    equations = Equations(*own) if contact.body is None else LayeredEquations(*own, body=contact.body)
    return ContactProblem(equations, scale, resolution)


@dataclass(eq=False, repr=False)
class ContactProblem(MeshedContact):
    """The curve of a contact on one side of first touch, and what succeeds it.

    Parameters
    ----------
    vanishing : tuple of float
        Widths in shares of the outermost edge at which regions vanish on this piece of the curve; 0: never.
    """

    vanishing: tuple[float, ...] = ()

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
            far = max(law.reach(max(negligible, np.finfo(float).tiny)), BEYOND * self.equations.law.levels[-1])
            if far < law.kink < math.inf:  # all may happen next to it
                far = law.reach(min(negligible, NEXT_TO_NOTHING))
            width = contact.axisymmetric_tip.radius_at(min(far, 4 * max(term.range for term in law.terms)))
            edges = start_edges(width, max(contact.axisymmetric_tip.radius_at(far), 2 * width))
            if far < law.kink < math.inf:  # and nothing lies beyond
                first = float(contact.axisymmetric_tip.radius_at(law.kink - far))
                sharp = contact.axisymmetric_tip.apex_exponent < 2.0  # under which the load grows with few powers of r
                edges = np.union1d(_graded(edges, first) if sharp else edges, first)
            else:
                if math.isfinite(law.wave):  # between two layers, as far from either's fold as can be
                    places = far + law.wave * BEFORE
                    far = float(places[np.abs(law.evaluate(places).stiffness).argmax()])
            problem = self.on_mesh(mesh_on(edges, self.resolution.order))
            u, ends = self.at_gap(max(far, self.scale)), law.ends
        self.resolution.far, x = u, np.zeros(problem.size)
        if (motion := problem.fitting(x, u)) is not None and motion.ends:
            problem, x = problem.anchored(motion, x, u)
        problem, x = problem.resolved(problem.solve_at(x, u), u, self.resolution.tolerance)
        start = oriented(problem, x, u, (np.zeros(x.size), 1.0))
        return problem._nearer(start, self.at_gap(ends)) if self.at_gap(ends) > u else start

    def at_gap(self, gap: float) -> float:
        """The parameter of a film with a gap in the middle."""
        return self.parameter(self.equations.wall - gap)

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

    @property
    def convex(self) -> bool:
        """Without interaction, or where it is convex, too."""
        law = self.equations.interaction
        return law is None or law.convex

    def balance(self, start: Point, step: float | None = None) -> Balance:
        """First scales; `step`: of the parameter, a kink at first touch long past, as it is where a contact begins, or
        of the edges of regions."""
        if self.mesh.roots and step is not None:
            motion = magnitude(positions(self, start.x)[1] @ start.tangent_x[self.size :])
            length = step / max(motion, 1e-300) / STEPS.first_step
            state = math.sqrt(self.inner(start.tangent_x, start.tangent_x))
            return Balance(length * state, max(length * abs(start.tangent_parameter), 1e-9))
        if start.parameter > 0.0:
            step = start.parameter
        if step is None:
            return super().balance(start)
        length, slope = step / STEPS.first_step, math.sqrt(self.inner(start.tangent_x, start.tangent_x))
        return Balance(CALM * length * slope / abs(start.tangent_parameter), length)

    def leaving(self, start: Point, step: float | None) -> Point:
        """With a tangent along which the first step is as long as `balance` has it."""
        if step is None or not self.mesh.roots:
            return start
        options = self.steps(start)
        return unit_tangent(start, self.balance(start, step).metric(options.weight, options.state_floor))

    @property
    def parameter_range(self) -> tuple[float, float]:
        """First touch, u = 0, is where either side ends, or where the interaction jumps in the middle; a contact grows
        no larger than the tip."""
        if any(region.rests for region in self.equations.regions):
            return -math.inf, math.inf
        if not self.equations.contact:
            return self.resolution.far, self.at_gap(self._ahead) if self._ahead else 0.0
        coordinate, extent = self.equations.coordinate, self.equations.tip.extent
        return 0.0, self.parameter(coordinate.of(extent, 0.0)) if math.isfinite(extent) else math.inf

    def steps(self, start: Point) -> Options:
        """Far away a step may be long, since the elastic body answers little."""
        floor, rough = STATE_FLOOR * self.scale * (2 * self.scale) ** 0.25, start.x * (-1.0) ** np.arange(start.x.size)
        floor = max(floor, NOISE_FLOOR * np.finfo(float).eps * math.sqrt(self.inner(rough, rough)))
        steps = replace(STEPS, state_floor=floor, noise=NOISE)
        law = self.equations.interaction
        if law is not None and law.pieced and not self.equations.contact:
            steps = replace(steps, first_step=WITHIN_A_PIECE * steps.first_step)
        return steps if law is None or math.isinf(law.wave) else replace(steps, angle=TURNING)

    def farthest(self, p: float) -> float:
        """Steps of a film's gap shorter than layers, all of which would otherwise not be met far away."""
        law = self.equations.interaction
        if self.equations.contact or law is None or not math.isfinite(law.wave):
            return math.inf
        return LONGEST_IN_LAYERS * law.wave / (self.scale * math.cosh(p))

    def margins(self, x: Array, p: float) -> Mapping[str, float]:
        """The inequality of contact closest to failing, and how far the narrowest region is from vanishing."""
        equations, fields = self.seen(x, p)
        extent = equations.tip.extent
        breach = least_margin(equations, fields, self.scale, self.narrow_ring)
        tolerated = PRESSURE_TOLERANCE if self.tolerant else 0.0
        known = {"inadmissible": 1.0 if breach is None else min(breach.margin, 1.0) + tolerated}
        known |= {"narrow": narrowness(self.vanishing, radii_of(equations, fields))} if any(self.vanishing) else {}
        return known if math.isinf(extent) else known | {"tip-edge": WHOLE - self._outermost(x, p) / extent}

    def _outermost(self, x: Array, p: float) -> float:
        """Radius of the contact, or that up to which the pressure jumps."""
        equations, fields = self.seen(x, p)
        roots = equations.mesh.edges[list(equations.mesh.roots)]
        return math.hypot(fields.rim.radius, roots.max(initial=0.0))

    @property
    def narrow_ring(self) -> float:
        """Width, as a share of the outermost radius, below which a jump takes the place of a resting ring between two
        bands: what it leaves out, see `left_out`, is a tenth of the accuracy."""
        return max(NARROWEST_RING, math.sqrt(self.resolution.accuracy))

    def left_out(self, x: Array, p: float) -> Four:
        """What jumps in place of narrow rings leave out."""
        equations, share = self.equations, 0.0
        for inner, outer in pairwise(equations.regions):
            level = max(inner.index, outer.index)
            if not (inner.rests or outer.rests) and equations.law.holds(level):
                share += LEFT_OUT * self.narrow_ring**2
        load, displacement, radius, gap = (share * max(1.0, abs(value)) for value in self.values(x, p)[:4])
        return load, displacement, radius, gap

    @property
    def tolerant(self) -> bool:
        """Whether it is a disc at the wall under a smooth law: followed with tolerance."""
        return self.equations.contact and len(self.equations.law.levels) == 1 and not self.mesh.roots

    def cause(self, name: str, point: Point) -> str:
        """Next to the edge of a tip, a corner at which films are squeezed out first, no ring follows a disc."""
        if name != "inadmissible" or math.isinf(extent := self.equations.tip.extent):
            return name
        breach = least_margin(*self.seen(point.x, point.parameter), self.scale, self.narrow_ring)
        return "tip-edge" if breach and breach.new.rests and breach.radius > OUTERMOST * extent else name

    def margin(self, x: Array, p: float, name: str) -> float:
        """Also the inequalities of contact, not limited."""
        if name != "breach":
            return super().margin(x, p, name)
        breach = least_margin(*self.seen(x, p), self.scale, self.narrow_ring)
        return 1.0 if breach is None else breach.margin

    def successor(self, name: str, points: Sequence[Point]) -> Succession | None:
        """First touch is followed by a disc of contact, a contact set that stops being a disc by any other.

        Raises
        ------
        ModelError
            If the curve is not found again with free boundaries.
        """
        last = points[-1]
        if self.layered and name in ("inadmissible", "narrow"):
            return None  # rings are those of a half space
        if name == "inadmissible":
            return born(points)
        if name == "narrow":
            return vanished(points)
        if self._ahead and not self.equations.contact:
            start = self._entered(Functions(*self.seen(last.x, last.parameter)))
            # The disc grows by a factor of order one within next to no change of the gap where the body is stiff.
            growth = abs(start.tangent_parameter / float(start.tangent_x[equilibrium(start).size]))
            return Succession("", last, (start,), step=STEPS.first_step * growth)
        if last.parameter != 0.0 or self.equations.contact:
            return None
        still, h = (self, last.x) if self.mesh.roots else self.still(last.x)
        disc = still._behind()
        start = disc.touching(h)
        start = begun(start) if self.mesh.roots else start
        starts = (start,) if start.label and not disc.flat else (*islice(disc.passed(start), 1), start)
        return Succession("touch", last, starts, others=lambda: disc.passed(start))

    @property
    def _ahead(self) -> float:
        """The gap at which the middle is attracted next by a pressure that jumps; 0 without."""
        law, index = self.equations.law, self.equations.regions[0].index
        return 0.0 if law.holds(index) else law.levels[index]

    def _entered(self, before: Functions) -> Point:
        """The state in which the pressure has just jumped on a small disc in the middle, on its way to grow."""
        equations = before.equations
        if self.motion is not None and self.motion.ends:
            raise ModelError(
                "The law is felt up to the edge of the tip, where its description ends: this model does not represent "
                "that together with a pressure that jumps"
            )
        law, tip, around = equations.law, equations.tip, equations.regions
        band = around[0].index - 1
        vanishes = not equations.mesh.bounded and law.vanishes(around[-1].index)
        outer, bounded = around[:-1] if vanishes else around, equations.mesh.bounded or vanishes
        level, jump = law.levels[band + 1], law.pressure(band, band + 1) - law.pressure(band + 1, band + 1)
        # The displacement has its first fold where the tip's slope is that of what a uniform pressure lifts, and the
        # surfaces touch at the latest where that is the level.
        size = float(tip.radius_at(level))
        slope, places = 4.0 * abs(jump) / math.pi, size * np.geomspace(1.0, LEAST_DISC, 200)
        steep = places[tip.height_derivative(places) > slope]
        size = BORN * min(float(steep[-1]) if 0 < steep.size < places.size else size, level / slope)
        # At least one that hardly changes the displacement: what is smaller than that is not resolved.
        missed = START_SHARE * self.resolution.accuracy * max(1.0, level)
        size = max(size, min(float(tip.radius_at(missed)), missed / slope))
        roots = np.append(size, equations.mesh.edges[list(equations.mesh.roots)])
        edges = laid_edges(roots, before.ends, bounded)
        mesh = mesh_on(edges, self.resolution.order, bounded, tuple(np.flatnonzero(np.isin(edges, roots)).tolist()))
        own = replace(equations, mesh=mesh, regions=(Region(False, band), *outer))
        h = before.transformed(mesh.nodes) + mesh.abel_of(np.where(mesh.nodes < size, jump, 0.0))
        y = Row(*mesh.row(size), level).off(own, own.fields(h, 0.0), 0.0)
        motion = led_by(own, own.fields(h, y))
        problem = replace(self, equations=own, motion=motion)
        x, u = np.append(h, np.zeros(len(motion.all) if motion else 0)), self.parameter(y)
        problem, x = problem.resolved(problem.solve_at(x, u), u, self.resolution.tolerance)
        return oriented(problem, x, u, (np.zeros(x.size), 1.0))

    def displaced(self, x: Array, p: float) -> tuple[Array, float]:
        """The derivatives of the displacement, as far as the mesh gives it."""
        equations, fields = self.seen(x, p)
        row = equations.rim_gradient(fields), self.rates(x, p, np.zeros(x.size), 1.0).displacement
        if self.motion is None:
            return row
        return np.append(row[0] * self.growth(x), np.zeros(x.size - self.mesh.size)), row[1]

    def _behind(self) -> ContactProblem:
        """The problem on the other side of first touch."""
        motion = self.motion if self.mesh.roots else None
        other = self.equations.touching(not self.equations.contact)
        return replace(self, equations=other, motion=motion, vanishing=())

    def across(self, x: Array, p: float) -> tuple[Point, ...]:
        """First touch on the other side."""
        if p != 0.0:
            return ()
        still, h = (self, x) if self.mesh.roots else self.still(x)
        other = still._behind()
        if other.equations.contact:
            return (other.touching(h),)
        return (other.touching(other.solve_at(h, 0.0)),)

    def touching(self, x: Array) -> Point:
        """First touch as a point of the side in contact, towards larger contacts, on a mesh that resolves it.

        Labelled, unless a stiff film has a kink there.
        """
        problem, x = self.resolved(x, 0.0, AHEAD * self.resolution.tolerance)
        problem, x = problem.anchored(problem.fitting(x, 0.0), x, 0.0)
        rate, one = problem.direction(x, 0.0)
        kinked = (problem.moves or bool(problem.mesh.roots)) and problem.resists(x)
        return annotated(Point(problem, x, 0.0, rate, one, label="" if kinked else "start"))

    def sizes(self, x: Array) -> list[float]:
        """Parameters of contacts that have passed the kink at first touch x, from the likeliest on.

        One is far smaller than the length on which elasticity answers the interaction, others are shares of the radius
        of the film's front, or, under a flat tip, of the innermost panel. All are larger than a ring that comes first.
        """
        equations, fields = self.seen(x, 0.0)
        clear = CLEAR * equations.dish(fields) if self.flat else 0.0
        small, large = max(BELOW * 0.5 / max(1.0, magnitude(fields.stiffness)), clear), SEEN
        if self.motion is not None and not self.motion.ends:
            large = SEEN * self.motion.lead.place * self._stretch(x)
        if self.flat:
            large = max(min(large, DISHED * equations.mesh.innermost), clear)
        radii = [*(large * 2.0**k for k in range(LARGER if self.flat else 1)), small]
        return [self.parameter(equations.coordinate.of(radius, 0.0)) for radius in radii]

    def passed(self, start: Point) -> Iterator[Point]:
        """Contacts that have passed their kink.

        Rounding may hide the way from first touch to there, and the slope may vary all along it: under a tip like r^n
        the gap answers the radius as aⁿ does, and by far more as a² does, which rules from a tiny radius on. Below the
        radius of a ring that comes first, however shallow the dish, discs have folds that the contact has not.
        """
        problem = equilibrium(start)
        if not isinstance(problem, ContactProblem):
            return
        for ahead in problem.sizes(start.x):
            x = problem.solve_at(start.x + ahead * start.tangent_x / start.tangent_parameter, ahead)
            try:
                if not magnitude(problem.residual(x, ahead)) <= SETTLED * magnitude(x) or problem.lost(x, ahead):
                    continue
                equations, fields = problem.seen(x, ahead)
                if problem.flat and float(equations.opening(fields, np.zeros(1))[0]) < 0.0:  # a ring was passed over
                    continue
                found, x = problem.resolved(x, ahead, problem.resolution.tolerance)
                rate, one = found.direction(x, ahead)
                found.examine(x, ahead)
            except (CorrectionError, np.linalg.LinAlgError, UnresolvedError):
                continue
            yield annotated(Point(found, x, ahead, rate, one, label="start"))

    @property
    def described_to(self) -> float:
        """The end of a law's table."""
        law = self.equations.interaction
        return math.inf if law is None else law.ends

    def ending(self, name: str, point: Point) -> str:
        """Why the curve ends."""
        if name == "end":
            touches = self.equations.contact and not self.equations.level
            return "" if touches or point.observables["central_gap"] < self.contact_gap else ENDURES
        if name == "inadmissible":
            return (
                "The branch ends where the contact set stops being a disc: the gap would close outside the contact, or "
                "the wall would have to pull."
            )
        if name == "tip-edge":
            what = "range of the interaction" if self.mesh.roots else "contact"
            return f"The {what} has come to the edge of the tip, where its description ends."
        tip = self.equations.tip
        if not math.isfinite(tip.extent):
            return ""
        equations, fields = self.seen(point.x, point.parameter)
        r = np.hypot(equations.mesh.nodes, fields.rim.radius)
        felt = r[np.abs(fields.pressure) > 1e-3 * np.abs(fields.pressure).max()]
        if max(fields.rim.radius, float(felt.max(initial=0.0))) < 0.9 * tip.extent:
            return ""
        return "The contact, or the interaction around it, has reached the end of the tip."

    @property
    def contact_gap(self) -> float:
        """That of the law."""
        return getattr(self.equations.interaction, "contact_gap", 0.0)

    @property
    def wall_gap(self) -> float:
        """That of the law."""
        return self.equations.wall

    def endures(self, point: Point) -> bool:
        """Whether the film's next greatest pressure is out of reach, see `lasts`."""
        (equations, fields), law = self.seen(point.x, point.parameter), self.equations.interaction
        if law is None or (equations.contact and not equations.level) or equations.load(fields) <= 0.0:
            return False
        along = self.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        if equations.contact:  # at a level, up to the pressure that breaks it there
            if not along.load * point.tangent_parameter > 0.0:
                return False
            pressure, a = equations.tip.contact_pressure, fields.rim.radius
            growth = float(pressure(np.zeros(1), (1 + GROWN) * a)[0] - pressure(np.zeros(1), a)[0]) / (GROWN * a)
            growth *= equations.coordinate.slopes(fields.y)[0] * self.scale * math.cosh(point.parameter)
            rate = growth * point.tangent_parameter * equations.load(fields) / along.load
            left = equations.law.bounds(equations.level)[1] - equations.middle_pressure(fields)
            return lasts(equations.tip, equations.displacement(fields), left, rate)
        if not abs(along.central_gap) < PRESSED * abs(along.displacement):  # not yet pressed, but approached
            return False
        inwards = law.evaluate(np.linspace(equations.central_gap(fields), equations.wall, BARRIER))
        rate = -float(inwards.stiffness[0]) * along.central_gap * equations.load(fields) / along.load
        tip = equations.tip
        rate = max(rate, float(tip.height_derivative(np.float64(felt(tip, law)))) / 4)
        falls = np.flatnonzero(np.diff(inwards.pressure) < 0.0)
        left = float(inwards.pressure[falls[0] if falls.size else -1] - inwards.pressure[0])
        return lasts(tip, equations.displacement(fields), left, rate)

    def before(self, control: Control, value: float) -> Point | None:
        """Out there the tip feels next to nothing: its displacement is minus the gap, and so is a spring's position."""
        if control.kind == "load":
            return None
        problem, u, none = replace(self, motion=None), self.at_gap(-value), np.zeros(self.size)
        return oriented(problem, problem.solve_at(none, u), u, (none, 1.0))

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Rates of load, displacement, contact radius and central gap along a direction."""
        equations, fields = self.seen(x, p)
        y_rate, h_rate, stretching, power = self.scale * math.cosh(p) * p_rate, x_rate, 0.0, 0.0
        if self.motion is not None:
            n = self.mesh.size
            h_rate, stretching, power = self.growth(x) * x_rate[:n], float(x_rate[self.size]), self.motion.power
        load, displacement = equations.rates(fields, h_rate, y_rate, stretching, power)
        if self.others:
            edges, nodes = (x_rate[self.size + 1 :] @ rates for rates in self._motion(equations))
            own = equations.drift_rates(fields, edges, nodes)
            load, displacement = load + own[0], displacement + own[1]
        if 0.0 <= p < NEXT_TO_TOUCH and equations.interaction is not None and not self.mesh.roots:
            parts = abs(float(equations.rim_row @ h_rate))
            if abs(displacement) > max(MOVING * parts, AT_ALL * magnitude(h_rate)):
                load = self._slope(x, p) * displacement
        wall = 0.0
        if any(region.rests and not region.index for region in equations.regions):
            (places, moves), k = positions(self, x), self._wall_edge
            a, area = fields.rim.radius, equations.coordinate.slopes(fields.y)[1] * y_rate if equations.contact else 0.0
            wall = (0.5 * area + places[k] * (moves[k] @ x_rate[self.size :])) / math.hypot(a, places[k])
        elif equations.contact and not equations.level:
            wall = equations.coordinate.slopes(fields.y)[0] * y_rate
        elif equations.wall:
            wall = self._soft_rate(x, p, x_rate, p_rate)
        return Rates(load, displacement, wall, 0.0 if equations.contact else -y_rate)

    def _slope(self, x: Array, p: float) -> float:
        """dF/dd of the curve, from the response to a rigid motion at a fixed rim, which loses no digits."""
        equations, fields = self.seen(x, p)
        if "slope" not in fields.derived:
            fields.derived["slope"] = equations.load_per_displacement(fields)
        slope: float = fields.derived["slope"]
        return slope

    def unstable(self, x: Array, p: float) -> int:
        """Negative eigenvalues of the second variation at fixed displacement, by inertia.

        Deep in contact the rough answer is nearly always 0, which is what is expected; any other is checked finely.
        """
        equations, fields = self.seen(x, p)
        if self.mesh.roots:
            return equations.unstable_modes(fields) + self._unstable_jumps(x, p)
        return equations.unstable_modes(fields, finely=False) and equations.unstable_modes(fields)

    def _unstable_jumps(self, x: Array, p: float) -> int:
        """By how much places where the pressure jumps raise the Morse index at fixed displacement.

        The energy depends on h and on these places; where they are stationary each gap is its level. Its second
        derivatives by the places, once h has answered, are a Schur complement (Haynsworth: inertias add). The energy of
        an attraction is the least of all places, that of a repulsion the largest, which takes one direction each.
        """
        (equations, fields), n, breakpoints = self.seen(x, p), self.mesh.size, self.motion.all if self.motion else ()
        jumping = [k for k, one in enumerate(breakpoints) if one.root and not one.side]
        if not jumping:
            return 0
        columns = [equations.spread(fields, 0.0)]
        if self.others:
            columns += zip(*equations.drift(fields, *self._motion(equations)), strict=True)
        gaps, residuals = np.array([columns[k][0] for k in jumping]), np.array([columns[k][1][:n] for k in jumping])
        response = equations.response(fields)
        response.flat[:: n + 1] += 1.0
        gaps = gaps.T - fields.rim.plane_to_targets @ np.linalg.solve(response, residuals.T)
        gap_rates = np.array([breakpoints[k].slope * self.rows[k].by_gap(gaps.T) for k in jumping])
        stretch, own = self._stretch(x), self.motion_at(x)
        assert own is not None
        places = stretch * np.array([own.all[k].place for k in jumping])
        moves = stretch * np.equal.outer(jumping, jumping).astype(float)
        moves[:, np.equal(jumping, 0)] = places[:, None]  # with the leading one, all
        bounds = [equations.law.bounds(equations.law.levels.index(breakpoints[k].gap)) for k in jumping]
        steps = np.array([above - below for above, below in bounds])
        matrix = moves.T @ ((steps * places)[:, None] * gap_rates)
        return int((np.linalg.eigvalsh((matrix + matrix.T) / 2) < 0.0).sum()) - int((steps < 0.0).sum())

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count | None:
        """Numbers of unstable modes cos mθ; none where no axisymmetric one is (see `azimuthal`, order in m).

        Where an axisymmetric one is and the pressure jumps they are not known.
        """
        if unstable and (self.equations.steps or self.layered):
            return None
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

    def gradients(self, x: Array, p: float) -> tuple[Array, Array]:
        """Derivatives of load and displacement with respect to h, (N,) each."""
        return self.equations.gradients(self.fields(x, p))  # a search has no front

    def search(self, points: Sequence[Point]) -> Search | None:
        """On one mesh, from rows and undeformed states; without interaction there is nothing to find."""
        if self.equations.interaction is None or self.mesh.roots or self.layered:
            return None
        return search_from(self, points)

    def relaxed(self, fold: Point, control: Control, direction: int, others: Sequence[Point]) -> int | None:
        """Followed with a viscous half space, see `relaxation`."""
        if self.layered:
            return None
        states = [Functions(*problem_of(point).seen(point.x, point.parameter)) for point in (fold, *others)]
        return Release(states[0], self.scale, control, direction).nearest(states[1:])

    def rows_within(self, tolerance: float) -> ContactProblem:
        """The first problem of the chain with rows as accurate as this."""
        contact = self.resolution.contact
        if contact is None:
            return self
        law, own = contact.interaction, self.resolution  # which a coarse tolerance must not undo
        tolerance = max(tolerance / ROW_SAFETY, PIECED if law is not None and law.pieced else 0.0)
        return first_problem(contact, own.accuracy, min(tolerance, own.tolerance))

    def member(self, contact: Contact, tolerance: float | None = None) -> ContactProblem:
        """The same mesh and side of first touch for another contact, with the contact coordinate's scale and power."""
        tip, old, resolution = contact.axisymmetric_tip, self.equations, self.resolution
        if tolerance is not None:
            resolution = Resolution(tolerance, order_for(tolerance), work=self.work)
        coordinate = ContactCoordinate(tip, old.coordinate.power)
        changed: dict[str, Any] = {"tip": tip, "interaction": contact.interaction, "coordinate": coordinate}
        changed |= {} if contact.body is None else {"body": contact.body}
        return replace(self, equations=replace(old, **changed), resolution=resolution)

    def resists(self, x: Array) -> bool:
        """Whether the film at first touch is so stiff that a contact has a kink of its own, or the pressure jumps."""
        return bool(self.mesh.roots) or 0.5 / max(1.0, float(self.fields(x, 0.0).stiffness[0])) < STIFF


def _graded(edges: Array, length: float) -> Array:
    """Edges of panels with further ones inside, down to a length."""
    count = max(1, math.ceil(math.log(edges[1] / length) / math.log(4)))
    return np.concatenate([[0.0], edges[1] * 4.0 ** np.arange(-count, 0), edges[1:]])
