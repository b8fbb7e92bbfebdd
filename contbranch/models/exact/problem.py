"""The equilibria of a parabola with Maugis-Dugdale attraction in closed form, as pieces of one curve.

Load and displacement are explicit functions of a parameter p on each of three pieces,

    `Beyond`    p ≤ −1       beyond the range: the displacement is p z0, and there is no load
    `Apart`     −1 ≤ p ≤ 0   no contact: the radius c of the interaction grows from 0 to that of first touch
    `Touching`  p ≥ 0        contact: the angle arccos(a/c) of the rims falls from π/2 at first touch

and x = (F, d): the steps along the curve follow its bends in the plane. Where the range begins, at p = −1, the curve
has a corner.

Stability. The stiffness of the law is a delta function at c, of rank one, so the second variation at fixed displacement
has one negative direction at most, where the reduced energy's curvature d²V/dc² is negative. That has the sign of dd/dc
along the curve, and c grows along all of it.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import MaugisDugdale
from contbranch.contact.tips import Parabola
from contbranch.continuation import Options, Point
from contbranch.continuation.problem import Array, Linearisation
from contbranch.control import Control
from contbranch.curve.problem import STEPS, Count, EquilibriumProblem, Rates, Succession, Values, Work, oriented
from contbranch.errors import InputError
from contbranch.results.profile import Profile
from contbranch.theory import maugis
from contbranch.theory._dugdale import Angle, Zone

__all__ = ["Apart", "Beyond", "ExactProblem", "Touching", "zone_of"]

# Where the curve begins and where the interaction does, in ranges.
START, EDGE = -1.5, -1.0
# Corrections of a step that are small enough, as a share of its length scale.
LOOSE = 1e-2
CONSTANTS = "radius", "modulus", "work_of_adhesion", "interaction_range"


def zone_of(contact: Contact) -> Zone:
    """The constants of a contact.

    Raises
    ------
    InputError
        If it is not a parabola with Maugis-Dugdale attraction.
    """
    tip, law = contact.axisymmetric_tip, contact.interaction
    if not (isinstance(tip, Parabola) and isinstance(law, MaugisDugdale) and law.work_of_adhesion > 0.0):
        raise InputError("the closed form holds for a parabola with maugis-dugdale attraction alone")
    return Zone(*map(np.asarray, (tip.radius, contact.modulus, law.work_of_adhesion, law.range)))


class ExactProblem(EquilibriumProblem):
    """What the three pieces have in common.

    Parameters
    ----------
    zone : Zone
        The constants of the contact.
    work : Work
        What has been spent, counted by all pieces together.
    """

    ordered = True
    complete_by = "all there are, by the closed form"
    # Every value is a sum of a few terms, each good to a few units in the last place.
    rounding = 8e-15

    def __init__(self, zone: Zone, work: Work) -> None:
        self.zone, self.work, work.unknowns = zone, work, 1
        self.scale = float(zone.interaction_range)
        self._constants = {name: getattr(zone, name) for name in CONSTANTS}

    @abstractmethod
    def curve(self, p: float) -> maugis.Curve:
        """The closed form."""

    @abstractmethod
    def slopes(self, p: float) -> Rates:
        """Its derivatives with respect to p."""

    def state(self, p: float) -> Array:
        """Load and displacement of the closed form."""
        curve = self.curve(p)
        return np.array([float(curve.load), float(curve.displacement)])

    def residual(self, x: Array, p: float) -> Array:
        """How far load and displacement are from the closed form."""
        return x - self.state(p)

    def jacobian(self, x: Array, p: float) -> Array:
        """The identity."""
        return np.eye(2)

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Slopes of the closed form."""
        return -np.array(self.slopes(p)[:2])

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Counted as one step of Newton's method."""
        self.work.newton += 1
        return super().linearise(x, p)

    def steps(self, start: Point) -> Options:
        """Whatever the parameter, the values are exact: the corrector need only keep to the curve."""
        return replace(STEPS, tolerance=LOOSE)

    def values(self, x: Array, p: float) -> Values:
        """Of the closed form."""
        load, displacement, contact_radius, _, _, central_gap, energy = (float(one) + 0.0 for one in self.curve(p))
        return Values(load, displacement, contact_radius, central_gap, energy)

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Of the closed form."""
        return Rates(*(p_rate * slope for slope in self.slopes(p)))

    def unstable(self, x: Array, p: float) -> int:
        """One where the displacement falls while the interaction spreads."""
        return int(self.slopes(p).displacement < 0.0)

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count:
        """None: the gap of a parabola under attraction grows with the radius, and more so where symmetry is broken."""
        return Count()

    def profile(self, x: Array, p: float) -> Profile:
        """Gap and pressures on a grid graded towards the rims of contact and interaction."""
        state = self.curve(p)
        a, c = float(state.contact_radius), float(state.interaction_radius)
        end = max(3.0 * c, c + 2.0)
        ease = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 81)))
        inner, outer = a * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 81)), np.linspace(0.0, 1.0, 161) ** 2
        r = np.unique(np.concatenate([inner, a + (c - a) * ease, c + (end - c) * outer]))
        total, wall = maugis.pressure(r, state, **self._constants)
        return Profile(r, maugis.gap(r, state, **self._constants), total, wall)

    def at(self, p: float) -> Point:
        """The equilibrium of a parameter, with its tangent along the curve."""
        return oriented(self, self.state(p), p, (np.zeros(2), 1.0))

    def start(self, control: Control) -> Point:
        """Beyond the range, where no control feels the interaction."""
        return Beyond(self.zone, self.work).at(START)

    def before(self, control: Control, value: float) -> Point | None:
        """The displacement itself beyond the range, where a spring has no load; there a load does not tell states."""
        return None if control.kind == "load" or value >= -self.scale else self.at(value / self.scale)

    def member(self, contact: Contact, tolerance: float | None = None) -> Self:
        """The same piece of another contact's curve."""
        return type(self)(zone_of(contact), self.work)


class Beyond(ExactProblem):
    """Beyond the range of the interaction: the displacement is p z0."""

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Up to the range; nothing is asked of states farther away than the start."""
        return START, EDGE

    def curve(self, p: float) -> maugis.Curve:
        """Undeformed."""
        apart = maugis.without_contact(self.zone, 0.0)
        displacement = np.asarray(p * self.scale)
        return apart._replace(displacement=displacement, central_gap=-displacement)

    def slopes(self, p: float) -> Rates:
        """Only displacement and gap change."""
        return Rates(0.0, self.scale, 0.0, -self.scale)

    def steps(self, start: Point) -> Options:
        """One: there is nothing on the way."""
        return replace(STEPS, first_step=1e6, largest_parameter_step=1.0)

    def successor(self, name: str, points: Sequence[Point]) -> Succession:
        """The interaction begins: a corner of the curve."""
        return Succession("", points[-1], (Apart(self.zone, self.work).at(EDGE),))


class Apart(ExactProblem):
    """Without contact: the interaction's radius is ``c = b sinh((1 + p) asinh(c_touch/b))`` with b = 4σR/(πE).

    At c = b the displacement is least, if that is before first touch.
    """

    def __init__(self, zone: Zone, work: Work) -> None:
        super().__init__(zone, work)
        self.touch_radius = float(zone.touch_radius())
        self.bend = float(4.0 / math.pi * zone.strain * zone.radius)
        self.spread = math.asinh(self.touch_radius / self.bend)

    @property
    def parameter_range(self) -> tuple[float, float]:
        """From the range to first touch."""
        return EDGE, 0.0

    def radius(self, p: float) -> float:
        """Radius c of the interaction."""
        return self.touch_radius if p == 0.0 else self.bend * math.sinh((p - EDGE) * self.spread)

    def curve(self, p: float) -> maugis.Curve:
        """Quadratic in c."""
        return maugis.without_contact(self.zone, self.radius(p))

    def slopes(self, p: float) -> Rates:
        """``dF = −2πσc dc``, ``dd = (c − b) dc/R``, and the gap on the axis closes by ``dd + 2 (σ/E) dc``."""
        c = self.radius(p)
        growth = self.spread * math.hypot(c, self.bend)
        load = -2.0 * math.pi * float(self.zone.stress) * c * growth
        displacement = (c - self.bend) * growth / float(self.zone.radius)
        return Rates(load, displacement, 0.0, -displacement - 2.0 * float(self.zone.strain) * growth)

    @property
    def beyond_edge(self) -> bool:
        """The displacement goes on as a quadratic function of c."""
        return True

    def across(self, x: Array, p: float) -> tuple[Point, ...]:
        """First touch in contact."""
        return (Touching(self.zone, self.work).at(0.0),) if p == 0.0 else ()

    def successor(self, name: str, points: Sequence[Point]) -> Succession:
        """First touch."""
        return Succession("touch", points[-1], self.across(points[-1].x, 0.0))


class Touching(ExactProblem):
    """In contact: a = c cos θ with cot² θ = v sinh p, where v is about that of the pull-off, 1 at most."""

    def __init__(self, zone: Zone, work: Work) -> None:
        super().__init__(zone, work)
        self.unit = float(1.0 / (1.0 + 0.5 / zone.tabor**3))

    @property
    def parameter_range(self) -> tuple[float, float]:
        """From first touch on."""
        return 0.0, math.inf

    @property
    def power(self) -> float:
        """Load and displacement are smooth in the contact radius, of which p is about the square."""
        return 2.0

    def across(self, x: Array, p: float) -> tuple[Point, ...]:
        """First touch without contact."""
        return (Apart(self.zone, self.work).at(0.0),)

    def tangent(self, p: float) -> float:
        """tan θ."""
        return 1.0 / math.sqrt(self.unit * math.sinh(p)) if p > 0.0 else math.inf

    def curve(self, p: float) -> maugis.Curve:
        """Explicit in θ."""
        return maugis.in_contact(self.zone, self.tangent(p))

    def slopes(self, p: float) -> Rates:
        """``dθ = −(v/2) sin³ θ/cos θ cosh p dp``; the contact radius grows like √p behind first touch."""
        angle = Angle.from_tangent(self.tangent(p))
        cos, sin = float(angle.cos), float(angle.sin)
        turn = -0.5 * self.unit * math.cosh(p) * sin**3
        slopes = self.zone.slopes(angle)
        radius = float(slopes.contact_radius) * turn / cos if cos > 0.0 else math.inf
        return Rates(float(slopes.load) * turn, float(slopes.displacement) * turn, radius, 0.0)
