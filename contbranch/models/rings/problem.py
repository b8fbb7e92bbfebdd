"""The curve of a contact with discs and annuli, one layout of regions after the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Self

from contbranch.arrays import Array, magnitude
from contbranch.contact.contact import Contact
from contbranch.contact.validity import perhaps_in_pieces
from contbranch.continuation import Adaptation, Options, Point
from contbranch.continuation.metric import Balance
from contbranch.continuation.newton import border, linearise, solve
from contbranch.continuation.walk import unit_tangent
from contbranch.control import Control
from contbranch.curve.problem import STEPS, Count, Defect, Four, Succession
from contbranch.models.fronts import ENDURES, lasts
from contbranch.results.profile import Profile

from .changes import born, handed, left, vanished
from .constraints import least_margin, narrowness
from .disc import ALONE
from .equations import NARROW_RING, RingEquations
from .front import at_kink, fronted, preferred
from .law import BandedLaw
from .meshing import adapted, finer
from .profile import profile_of
from .stability import unstable_modes
from .start import beginning, farther

__all__ = ["RingProblem"]

# What a jump in place of a narrow resting ring leaves out as a share of the square of its width, that in units of the
# radius; relative to max(1, |value|).
JUMP = 0.1
# Noise of the pressure on regions at rest, and on such narrow rings.
NOISE, NOISE_ON_RINGS = 1e6, 1e8
# Rounding of values, relative to max(1, |value|).
ROUNDING = 1e-12
# Pressures below this share of the interaction's own, 1/range, do not matter for the steps of a curve without contact.
STATE_FLOOR = 0.02
# Part of a tolerance that may be left to what panels miss of the load.
AIM = 0.4
# Contact, or rest, up to this share of a tip's extent has come to its edge.
WHOLE = 0.999


class RingProblem(RingEquations):
    """Equilibria with one layout of regions: a piece of the curve."""

    @property
    def convex(self) -> bool:
        """Steps of the pressure are repulsive ones."""
        smooth = self.law.smooth
        return smooth is None or smooth.convex

    @property
    def pieced(self) -> bool:
        """Whether the law or the tip may be: where pieces meet is no end of panels."""
        return perhaps_in_pieces(self.tip, self.law.interaction)

    # -- the curve ----------------------------------------------------------------------------------------------------
    def start(self, control: Control) -> Point:
        """Far away, or where surfaces come to rest at the end of the interaction's range."""
        return beginning(self, control)

    def before(self, control: Control, value: float) -> Point | None:
        """A state farther away than the start."""
        return farther(self, control, value)

    def steps(self, start: Point) -> Options:
        """Step control; without free edges pressures far below the interaction's own do not shorten steps."""
        floor = 0.0 if self.free else STATE_FLOOR / self.scale
        rings = any(self.layout.collapsed(region) for region in range(self.layout.edges))
        noise = NOISE_ON_RINGS if rings else NOISE
        # A gap is a difference of lengths like the displacement, whose rounding is felt over the range.
        noise = min(noise * max(1.0, abs(start.parameter + self.origin) / self.scale), NOISE_ON_RINGS)
        return replace(STEPS, noise=noise, maximum_points=3_000, state_floor=floor)

    def balance(self, start: Point, step: float | None = None) -> Balance:
        """First scales; `step`: how far edges (without: the displacement) move in the first step."""
        if step is None:
            step = 0.3 * float(start.x[-1]) if self.free else self.scale
        slope, rate = math.sqrt(self.inner(start.tangent_x, start.tangent_x)), abs(start.tangent_parameter)
        length = step / STEPS.first_step
        if self.free:
            return Balance(length, max(length * rate / max(slope, 1e-300), 1e-9))
        return Balance(max(length * slope / max(rate, 1e-300), 1e-300), length)

    def leaving(self, start: Point, step: float | None) -> Point:
        """With a tangent along which the first step is as long as `balance` has it."""
        if step is None:
            return start
        options = self.steps(start)
        return unit_tangent(start, self.balance(start, step).metric(options.weight, options.state_floor))

    def margins(self, x: Array, p: float) -> Mapping[str, float]:
        """The inequalities of contact, and how far the narrowest region is from vanishing; at most 1."""
        fields = self.fields(x, p)
        breach = least_margin(self, fields)
        known = {"breach": 1.0 if breach is None else min(breach.margin, 1.0), "narrow": narrowness(self, fields)}
        if self.leaves:
            known["alone"] = ALONE - known["breach"]
        extent, resting = self.tip.extent, [region.rests for region in self.layout.regions[: self.layout.edges]]
        return known | (
            {"tip-edge": WHOLE - max(fields.grid.edges[resting], default=0.0) / extent} if math.isfinite(extent) else {}
        )

    def successor(self, name: str, points: Sequence[Point]) -> Succession | None:
        """The layout with a new region where an inequality fails, or without the region that has all but vanished."""
        if name == "tip-edge":
            return None
        if name in ("breach", "alone"):
            return (born if name == "breach" else left)(points[-1])
        return vanished(points)

    def otherwise(self, point: Point) -> tuple[Point, ...]:
        """The state of one disc of contact, or none, by the model of that."""
        regained = handed(point)
        return () if regained is None else (regained,)

    def ending(self, name: str, point: Point) -> str:
        """A sentence if the contact has come to the edge of a tip of finite extent, or a film that stays to the end."""
        if name == "end":
            return ENDURES if self.endures(point) else ""
        return "The contact has come to the edge of the tip, where its description ends." if name == "tip-edge" else ""

    @property
    def contact_gap(self) -> float:
        """That of the law."""
        return getattr(self.law.interaction, "contact_gap", 0.0)

    def endures(self, point: Point) -> bool:
        """Whether the pressure with which the middle rests on a film is out of reach of that which breaks it."""
        fields, middle = self.fields(point.x, point.parameter), self.layout.regions[0]
        rising = self.load_rate(fields, point.tangent_x)
        if not (middle.rests and middle.index and rising > 0.0):
            return False
        left = self.law.bounds(middle.index)[1] - float(fields.pressure[0])
        rate = float(point.tangent_x[0]) * self.load(fields) / rising
        return lasts(self.tip, point.parameter + self.origin, left, rate)

    # -- discretisations ----------------------------------------------------------------------------------------------
    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """Split and join panels where the solution asks for it."""
        panels = preferred(self, self.fields(x, p))
        if panels is None:
            return None
        other = self.on(panels)
        start = self.carried(x, x, p, other)
        self.forget()  # its points stay, but are seldom asked again
        if panels.front == self.panels.front:
            return Adaptation(other, start, lambda vector: self.carried(vector, x, p, other))

        def moved(x: Array, p: float, x_rate: Array, p_rate: float) -> tuple[Array, Array]:
            return self.carried(x, x, p, other), self.carried(x_rate, x, p, other)

        return Adaptation(other, start, moved=moved)

    def resolving(self, point: Point, tolerance: float) -> Self:
        """Panels made for a state, which stay where they are, but for a kink of the law."""
        tolerance = min(AIM * tolerance, self.setting.tolerance)  # coarser panels than the rows' hide their own errors
        panels = adapted(self, self.fields(point.x, point.parameter), tolerance)
        own = self if panels is None else self.on(panels)
        if not own.panels.front:
            return own
        fields = own.fields(self.carried(point.x, point.x, point.parameter, own), point.parameter)
        return own if at_kink(own, fields) else self.on(fronted(own, fields, 0.0))

    def finer(self) -> Self:
        """Panels on which the present ones' errors have all but vanished."""
        return self.on(finer(self.panels))

    def defect(self, point: Point) -> Defect:
        """One step of Newton's method on finer panels, across the curve; of the state the largest error of an edge."""
        fine = self.finer()
        x, tangent = (self.carried(vector, point.x, point.parameter, fine) for vector in (point.x, point.tangent_x))
        row = fine.metric(x).row(fine, tangent, point.tangent_parameter)
        at = linearise(fine, x, point.parameter)
        dx, dd = solve(border(fine, x, point.parameter, at, row), -at[0], 0.0, point.parameter)
        fields = fine.fields(x, point.parameter)
        load = fine.load(fields) + fine.load_rate(fields, dx) - self.load(self.fields(point.x, point.parameter))
        return Defect(load, dd, magnitude(dx[fields.grid.size :][: self.layout.edges]))

    @property
    def rounding(self) -> float:
        """Rounding errors of values."""
        return ROUNDING

    def left_out(self, x: Array, p: float) -> Four:
        """What jumps in place of narrow rings leave out."""
        share = JUMP * NARROW_RING**2 * self.layout.jumps
        load, displacement, radius, gap = (share * max(1.0, abs(value)) for value in self.values(x, p)[:4])
        return load, displacement, radius, gap

    def varied(self, contact: Contact) -> Self:
        """The same layout on the same panels."""
        setting = replace(self.setting, tip=contact.axisymmetric_tip, law=BandedLaw(contact.interaction), regained=None)
        return replace(self, setting=setting, leaves=False)

    # -- what is seen -------------------------------------------------------------------------------------------------
    def unstable(self, x: Array, p: float) -> int:
        """Morse index at fixed displacement."""
        return unstable_modes(self, self.fields(x, p))

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count | None:
        """No mode of any symmetry is unstable if v″ ≥ 0 wherever the gap floats; otherwise they are not examined."""
        return Count() if (self.fields(x, p).stiffness >= 0).all() else None

    def profile(self, x: Array, p: float) -> Profile:
        """Gap and pressures over the radius."""
        return profile_of(self, self.fields(x, p))
