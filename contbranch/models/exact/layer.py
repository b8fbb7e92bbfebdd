"""The equilibria of an axisymmetric tip on a layered body without interaction, as pieces of one curve.

    `Above`     p ≤ 0   without load: the displacement is p times the scale
    `Pressed`   p ≥ 0   a contact of radius p^(1/m), m the apex exponent up to 2, with one integral equation for it

Both are stable.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Self

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.continuation import Point
from contbranch.continuation.problem import Array
from contbranch.control import Control
from contbranch.curve.problem import Rates, Succession, Values, Work
from contbranch.results.profile import Profile
from contbranch.theory.layer import Disc

from .problem import KnownProblem

__all__ = ["Above", "Pressed"]

# Where the curve begins, discs that are kept, and the radius at which slopes next to first touch are looked up.
START, KEPT, NEXT = -1.0, 8, 1e-9
# Radii in the contact and around it, of profiles.
INSIDE, OUTSIDE = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 81))[:-1], 1.0 + 2.0 * np.linspace(0.0, 1.0, 81) ** 2


class _OnLayer(KnownProblem):
    """What both pieces have in common.

    Parameters
    ----------
    contact : Contact
        Reduced.
    work : Work
    """

    # What the quadrature of the layer's response leaves.
    rounding = 1e-12

    def __init__(self, contact: Contact, work: Work) -> None:
        self.contact, self.work, work.unknowns = contact, work, 1
        self.scale = 1.0

    def unstable(self, x: Array, p: float) -> int:
        """None: nothing attracts."""
        return 0

    @property
    def convex(self) -> bool:
        """It is."""
        return True

    def start(self, control: Control) -> Point:
        """Without contact."""
        return Above(self.contact, self.work).at(START)

    def member(self, contact: Contact, tolerance: float | None = None) -> Self:
        """The same piece of another contact's curve."""
        return type(self)(contact, self.work)


class Above(_OnLayer):
    """Without contact."""

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Up to first touch."""
        return START, 0.0

    def before(self, control: Control, value: float) -> Point | None:
        """The displacement itself, where a spring has no load."""
        return None if control.kind == "load" or value >= 0.0 else self.at(value)

    def observed(self, p: float) -> Values:
        """Undeformed."""
        return Values(0.0, p, 0.0, -p, 0.0)

    def slopes(self, p: float) -> Rates:
        """Only displacement and gap change."""
        return Rates(0.0, 1.0, 0.0, -1.0)

    def across(self, x: Array, p: float) -> tuple[Point, ...]:
        """First touch in contact."""
        return (Pressed(self.contact, self.work).at(0.0),) if p == 0.0 else ()

    def successor(self, name: str, points: Sequence[Point]) -> Succession:
        """First touch."""
        return Succession("touch", points[-1], self.across(points[-1].x, 0.0))

    def profile(self, x: Array, p: float) -> Profile:
        """The tip itself."""
        r = OUTSIDE - 1.0
        nothing = np.zeros_like(r)
        return Profile(r, self.contact.axisymmetric_tip.height(r) - p, nothing, nothing)


class Pressed(_OnLayer):
    """In contact."""

    def __init__(self, contact: Contact, work: Work) -> None:
        super().__init__(contact, work)
        tip, body = contact.axisymmetric_tip, contact.body
        assert body is not None

        @lru_cache(maxsize=KEPT)
        def disc(p: float) -> Disc:
            work.newton += 1
            return Disc(tip, body, p ** (1.0 / self.power))

        self.disc, self.tip = disc, tip

    @property
    def power(self) -> float:
        """Load and displacement are smooth in the contact radius, of which p is this power."""
        return min(self.tip.apex_exponent, 2.0)

    @property
    def parameter_range(self) -> tuple[float, float]:
        """From first touch to the edge of the tip."""
        return 0.0, self.tip.extent**self.power

    def across(self, x: Array, p: float) -> tuple[Point, ...]:
        """First touch without contact."""
        return (Above(self.contact, self.work).at(0.0),)

    def observed(self, p: float) -> Values:
        """Of the integral equation."""
        if p <= 0.0:
            return Values(0.0, 0.0, 0.0, 0.0, 0.0)
        disc = self.disc(p)
        return Values(disc.load, disc.displacement, disc.radius, 0.0, disc.energy)

    def slopes(self, p: float) -> Rates:
        """By the change of the radius, p = aᵐ; at first touch those of the half space."""
        if p <= 0.0:
            growth = NEXT ** (1.0 - self.power) / self.power
            return Rates(0.0, float(self.tip.transform_derivative(NEXT)) * growth, growth, 0.0)
        disc = self.disc(p)
        growth = disc.radius ** (1.0 - self.power) / self.power
        load, displacement = disc.rates
        return Rates(load * growth, displacement * growth, growth, 0.0)

    def profile(self, x: Array, p: float) -> Profile:
        """Gap and pressure."""
        if p <= 0.0:
            return Above(self.contact, self.work).profile(x, 0.0)
        disc = self.disc(p)
        inside, outside = disc.radius * INSIDE, disc.radius * OUTSIDE
        pressure = np.concatenate([disc.pressure(inside), np.zeros_like(outside)])
        gap = np.concatenate([np.zeros_like(inside), disc.gap(outside)])
        return Profile(np.concatenate([inside, outside]), gap, pressure, pressure)
