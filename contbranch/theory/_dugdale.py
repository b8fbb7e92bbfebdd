"""The Maugis-Dugdale contact written in one angle, which makes the whole contact branch explicit.

With the rim angle theta = arccos(a/c), that is a = c cos(theta) and sqrt(c^2-a^2) = c sin(theta), Maugis' condition
g(c) = z0 becomes

    A(theta) c^2 / R + 2 (sigma/E) B(theta) c = pi z0 / 2,
    A = [sin(theta) cos(theta) - theta cos(2 theta)] / 2,      B = theta sin(theta) - [1 - cos(theta)],

a quadratic equation for c. Everything else follows without solving an equation and without cancellation: theta -> 0
is the JKR-like end (c - a = 2 c sin^2(theta/2)), theta = pi/2 is first touch. The coordinate kept is its tangent, tau
= tan(theta) = sqrt(m^2-1) of eq (42), because it resolves both ends; tau = inf is first touch. Both a and c fall
monotonically as tau grows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.theory._inputs import finite, positive
from contbranch.theory._roots import rising


def _either(number: Callable[..., Any], array: Callable[..., Any]) -> Callable[..., Array]:
    """A function of numbers, or of arrays if its last argument is one: of a number it takes a tenth of the time."""
    return lambda *values: (number if isinstance(values[-1], float) else array)(*values)


_sin, _cos, _sqrt = _either(math.sin, np.sin), _either(math.cos, np.cos), _either(math.sqrt, np.sqrt)
_arctan, _hypot, _least = _either(math.atan, np.arctan), _either(math.hypot, np.hypot), _either(min, np.minimum)
_where = _either(lambda condition, this, other: this if condition else other, np.where)


class Angle(NamedTuple):
    """The rim angle with its cosine and sine, each accurate at both ends."""

    theta: Array
    cos: Array
    sin: Array

    @classmethod
    def from_tangent(cls, tau: Array | float) -> Angle:
        """Return the angle whose tangent is ``tau``, which is greater than zero and may be infinite."""
        return cls(_arctan(tau), 1.0 / _hypot(1.0, tau), 1.0 / _hypot(1.0, 1.0 / tau))


class Slopes(NamedTuple):
    """Derivatives with respect to the rim angle; those of load and displacement have their factor cos(theta) taken
    out.
    """

    load: Array
    displacement: Array
    contact_radius: Array


# Tangents between which all rim angles lie.
_WIDEST = np.asarray(1e-30), np.asarray(1e30)
_OPENING_SERIES = [(-1) ** (k + 1) * 2 * k / math.factorial(2 * k + 1) for k in range(10)]


def opening_of_contact(angle: Angle) -> Array:
    """Return A(theta), the share of the parabola in the gap at the rim; (2/3) theta^3 for small angles."""
    x = 2.0 * angle.theta
    # sin x - x cos x cancels to third order, so its Taylor series is summed where the loss would exceed two bits
    square, series = _least(1.0, x) ** 2, 0.0 * x
    for coefficient in reversed(_OPENING_SERIES):
        series = series * square + coefficient
    series = series * x
    closed = 2.0 * angle.sin * angle.cos - x * (angle.cos - angle.sin) * (angle.cos + angle.sin)
    return 0.25 * _where(x < 1.0, series, closed)


def opening_of_zone(angle: Angle) -> Array:
    """Return B(theta), the share of the attraction in the gap at the rim; theta^2/2 for small angles."""
    half = 0.5 * angle.theta
    return 2.0 * _sin(half) * (angle.theta * _cos(half) - _sin(half))


@dataclass(frozen=True)
class Zone:
    """Dugdale's attraction between a parabola and an elastic body, all four constants as arrays that broadcast."""

    radius: Array
    modulus: Array
    work_of_adhesion: Array
    interaction_range: Array

    def __post_init__(self) -> None:
        if np.any(finite("work_of_adhesion", self.work_of_adhesion) <= 0.0):
            raise InputError(
                f"work_of_adhesion must be greater than 0 in Maugis' closed form, not {np.min(self.work_of_adhesion)}: "
                "for repulsion the jump of pressure at the rim of the interaction would give the gap an infinite "
                "negative slope there, so the true solution has a ring of constant gap z0 instead; use a smooth law"
            )
        for field in ("radius", "modulus", "work_of_adhesion", "interaction_range"):
            object.__setattr__(self, field, positive(field, getattr(self, field))[()])  # numbers stay numbers

    @cached_property
    def stress(self) -> Array:
        """The attraction w/z0 inside the zone."""
        return self.work_of_adhesion / self.interaction_range

    @cached_property
    def strain(self) -> Array:
        """The attraction in units of the modulus, sigma/E."""
        return self.stress / self.modulus

    @property
    def tabor(self) -> Array:
        """The Tabor coefficient, [R (w/E)^2]^(1/3) / z0."""
        return np.cbrt(self.radius * (self.work_of_adhesion / self.modulus) ** 2) / self.interaction_range

    def interaction_radius(self, angle: Angle) -> Array:
        """Return c, the positive root of the quadratic equation above."""
        b = self.strain * opening_of_zone(angle)
        u = 0.5 * np.pi * self.interaction_range
        return u / (b + _sqrt(b * b + u * opening_of_contact(angle) / self.radius))

    def touch_radius(self) -> Array:
        """Return c at first touch, the positive root of c^2/(2R) + (2-4/pi)(sigma/E) c = z0."""
        b = (2.0 - 4.0 / np.pi) * self.strain
        return 2.0 * self.interaction_range / (b + _sqrt(b * b + 2.0 * self.interaction_range / self.radius))

    def load(self, angle: Angle, c: Array) -> Array:
        """Return the load in contact, 4 E a^3/(3R) - 2 sigma c^2 [theta + sin(theta) cos(theta)] (eq 34)."""
        hertz = 4.0 / 3.0 * self.modulus / self.radius * (c * angle.cos) ** 3
        return hertz - 2.0 * self.stress * c * c * (angle.theta + angle.sin * angle.cos)

    def displacement(self, angle: Angle, c: Array) -> Array:
        """Return the displacement in contact, a^2/R - 2 (sigma/E) sqrt(c^2-a^2) (eq 35 with its factor 4/3)."""
        return (c * angle.cos) ** 2 / self.radius - 2.0 * self.strain * c * angle.sin

    def energy(self, angle: Angle, c: Array | float, displacement: Array) -> Array:
        """Return V_ela + V_fr, with or without contact (theta = pi/2).

        V_ela = E int_0^c h^2 dt with h = d - t^2/R inside the contact and -2 (sigma/E) sqrt(c^2-t^2) in the zone, and
        V_fr = -pi w c^2 + sigma G, where G = 4 int_a^c (t^2/R - d + h) sqrt(c^2-t^2) dt is the volume of the gap in
        the zone.
        """
        d, radius, strain = displacement, self.radius, self.strain
        theta, cos, sin = angle
        a = c * cos
        zone = (2.0 * c * _sin(0.5 * theta) ** 2) ** 2 * (2.0 * c + a) / 3.0
        elastic = a * (d * d - 2.0 / 3.0 * d * a * a / radius + 0.2 * a**4 / radius**2) + 4.0 * strain**2 * zone
        parabola = c**4 / (8.0 * radius) * (theta - sin * cos * (cos - sin) * (cos + sin))
        volume = 4.0 * (parabola - 0.5 * d * c * c * (theta - sin * cos) - 2.0 * strain * zone)
        return self.modulus * elastic - np.pi * self.work_of_adhesion * c * c + self.stress * volume

    def slopes(self, angle: Angle) -> Slopes:
        """Return dF/dtheta and dd/dtheta over cos(theta), and da/dtheta."""
        theta, cos, sin = angle
        c = self.interaction_radius(angle)
        bracket = opening_of_contact(angle) * c / self.radius + self.strain * opening_of_zone(angle)
        shrink = theta * c * (c * sin / self.radius + self.strain) / bracket  # -c'(theta) / cos(theta)
        rim = -(shrink * cos * cos + c * sin)  # a'(theta)
        f1 = 4.0 * c * c * cos * rim / self.radius
        f2 = 4.0 * self.strain * c * shrink * (theta + sin * cos)
        f3 = 4.0 * self.strain * c * c * cos
        d1 = 2.0 * c * rim / self.radius
        d2 = 2.0 * self.strain * shrink * sin
        d3 = 2.0 * self.strain * c

        return Slopes(self.modulus * (f1 + f2 - f3), d1 + d2 - d3, rim)

    def tangent_at(self, contact_radius: Array) -> Array:
        """Return tau for a contact radius, which falls as tau grows; infinite for none."""
        open_contact = contact_radius > 0.0
        a = np.where(open_contact, contact_radius, 1.0)
        tau = self.root(lambda angle: a - self.interaction_radius(angle) * angle.cos, *_WIDEST)
        return np.where(open_contact, tau, np.inf)

    def tangent_range(self) -> tuple[Array, Array]:
        """Return tangents far below and far above those of any fold: tau is 1.2/mu_T at the folds for short and
        mu_T^(-3/2)/sqrt(2) for long range.
        """
        mu = self.tabor
        return np.asarray(1e-3 / (1.0 + mu)), np.asarray(1e4 * (1.0 + mu**-1.5))

    def root(self, function: Callable[[Angle], Array], low: Array, high: Array) -> Array:
        """Return the tangent where ``function`` changes from negative at ``low`` to positive at ``high``."""
        return rising(lambda tau: function(Angle.from_tangent(tau)), low, high)
