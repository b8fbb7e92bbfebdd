"""An event as a curve: equilibrium and the event's condition together, with one parameter of the contact free.

    R(x, p; q) = 0                  equilibrium
    G(x, p; q) = 0                  the condition: for a fold, the rate of what is controlled along the curve of
                                    equilibria at fixed q

with the state z = (x, w) and the family's coordinate q as parameter (a minimally augmented system: one equation more,
one unknown more). The tangent v of the curve of equilibria at fixed q comes from the bordered matrix

    [ R_x  R_p ] [ v_x ]   [ 0 ]
    [   c^T    ] [ v_p ] = [ 1 ].

G is taken at the state moved onto the equilibria by one Newton step with that matrix, at fixed c·(x, p). Its derivative
is then a multiple of c^T, and only its rates along the two tangents of the surface of equilibria (v, and the change
with q) are needed, which differences give. They enter the rate of convergence and the tangents, not the solutions.

Conditions are smooth in w, which is p itself or a root of it (`EquilibriumProblem.power`). Events of this curve, where
q turns round or first touch is passed, are those of codimension two.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np

from contbranch.contact.family import Family
from contbranch.continuation import Adaptation, Bordered, Event, Linearisation, Metric, Options, Point
from contbranch.continuation.newton import border, linearise, solve
from contbranch.continuation.problem import Array
from contbranch.control import Control
from contbranch.curve.events import FoldEvent, rates
from contbranch.curve.problem import Defect, EquilibriumProblem, Rates, equilibrium
from contbranch.errors import ModelError

__all__ = ["Augmented", "Condition", "Fold", "Held", "Locus", "Other", "augmented", "direction"]

# Central and one-sided differences of the condition: their steps, of second order while tracing, and of fourth order
# where tangents themselves are results.
STEP, FINE_STEP = 1e-4, 2e-3
# ... over lengths in w that are small against its own value, but not below this one; step of other differences.
LEAST_LENGTH, RATE_STEP = 1e-2, 1e-5
# A state farther from equilibrium than this, relative to itself, is moved onto it before the condition is taken.
NEAR = 1e-9
# The border is p itself where the tangent has at least this component of it; otherwise a reference direction, replaced
# when it is farther than this (cosine) from the tangent.
UPRIGHT, ALIGNED = 1e-3, 0.7
# This far beyond an edge of the parameter is rounding.
ZERO = 1e-12
# Linearisations and members that are kept.
SHEETS, MEMBERS = 2, 8
STEPS = Options(
    angle=0.3,
    angle_limit=0.8,
    tolerance=1e-9,
    noise=1e5,
    first_step=0.02,
    detect_folds=False,
    detect_branch_points=False,
    maximum_points=600,
)


class Condition(ABC):
    """What makes an equilibrium an event."""

    @abstractmethod
    def event(self, q: float) -> Event | None:
        """What vanishes along the curve of equilibria at q; None: its parameter is known."""

    @abstractmethod
    def value(self, point: Point, q: float) -> float:
        """A number that vanishes at the event, smooth; the point has its unit tangent at fixed q."""


@dataclass(frozen=True)
class Fold(Condition):
    """A fold: the rate of what is controlled along the tangent vanishes."""

    family: Family
    driven: Control

    def event(self, q: float) -> FoldEvent:
        """The fold of the control, of which the stiffness may be the parameter itself."""
        return FoldEvent(self.family.control(q, self.driven))

    def weights(self, q: float) -> tuple[float, float]:
        """w; (cos q, sin q) where q is the angle arctan K, smooth beyond its ends, too."""
        if self.family.spacing == "angle":
            return math.cos(q), math.sin(q)
        return self.event(q).control.weights

    def crossed(self, q: float) -> tuple[float, float]:
        """Weights of the control at a right angle."""
        first, second = self.weights(q)
        return -second, first

    def value(self, point: Point, q: float) -> float:
        """``w·(F', d')``."""
        return float(np.dot(self.weights(q), rates(point)))


@dataclass(frozen=True)
class Held(Condition):
    """First touch, or the fold in another corner of the curve: at an edge of the parameter."""

    parameter: float
    corner: bool = False

    def event(self, q: float) -> None:
        """None."""

    def value(self, point: Point, q: float) -> float:
        """Distance of the parameter."""
        return point.parameter - self.parameter


@dataclass(frozen=True)
class Other(Condition):
    """Any other event of the curves of equilibria: an eigenvalue of a mode that passes 1."""

    what: Event

    def event(self, q: float) -> Event:
        """It."""
        return self.what

    def value(self, point: Point, q: float) -> float:
        """The event's own value."""
        return self.what.value(point)


@dataclass(frozen=True)
class Locus:
    """Where an event lies in a family.

    Attributes
    ----------
    family : Family
    condition : Condition
    interval : (float, float)
        The family's coordinates between which it is followed.
    size : float
        Norm of a typical state: the unit of states in lengths.
    """

    family: Family
    condition: Condition
    interval: tuple[float, float]
    size: float


@dataclass(frozen=True, eq=False)
class Sheet:
    """The equilibria of one member around a state: linearisation, bordered matrix, and the state with its tangent."""

    point: Point
    linear: Linearisation
    bordered: Bordered

    def solve(self, f: Array) -> tuple[Array, float]:
        """The (x, p) with ``R_x x + R_p p = f`` and no component along the border."""
        return solve(self.bordered, f, 0.0, self.point.parameter)


def _of_equilibrium(name: str) -> Callable[..., Any]:
    """A method of the augmented problem that asks the equilibrium's own of that name."""
    return lambda self, x, p: getattr(self.at(p), name)(*self.split(x))


class Augmented(EquilibriumProblem):
    """The augmented system on one discretisation of one representation.

    Parameters
    ----------
    locus : Locus
    base : EquilibriumProblem
        Of any member of the family.
    reference : array (n + 1,)
        Direction (x, p) to which tangents are compared: it borders the matrix, and orients them.
    fine : bool
        Whether derivatives of the condition are taken to fourth order.
    """

    def __init__(self, locus: Locus, base: EquilibriumProblem, reference: Array, fine: bool = False) -> None:
        self.locus, self.base, self.reference, self.fine = locus, base, reference, fine
        self.scale, self.work = base.scale, base.work
        unit = reference / math.sqrt(self.inner(reference, reference))
        self.upright = abs(unit[-1]) > UPRIGHT
        self._border = self.dual(unit)
        if self.upright:
            self._border = np.append(np.zeros(unit.size - 1), math.copysign(1.0, unit[-1]))
        self._member = lru_cache(MEMBERS)(lambda q: base.member(locus.family.reduced(q)[0]))
        self._kept: list[tuple[Array, float, Sheet, Sheet]] = []

    def on(self, base: EquilibriumProblem, reference: Array | None = None, fine: bool | None = None) -> Self:
        """The same event on another discretisation or representation."""
        if reference is None:
            x = self.reference[:-1]
            reference = np.append(self.base.carried(x, x, math.nan, base), self.reference[-1])
        return type(self)(self.locus, base, reference, self.fine if fine is None else fine)

    # -- state --------------------------------------------------------------------------------------------------------
    def parameter(self, w: float) -> float:
        """The parameter p of w; NaN where this representation has no states."""
        if not self.base.beyond_edge:
            low, high = map(self.root, self.base.parameter_range)
            if not low - ZERO <= w <= high + ZERO:
                return math.nan
            w = min(max(w, low), high)
        return math.copysign(abs(w) ** self.base.power, w)

    def root(self, p: float) -> float:
        """W of the parameter p."""
        return math.copysign(abs(p) ** (1 / self.base.power), p)

    def split(self, z: Array) -> tuple[Array, float]:
        """(x, p) of a state z."""
        return z[:-1], self.parameter(float(z[-1]))

    def joined(self, x: Array, p: float) -> Array:
        """The state z of (x, p)."""
        return np.append(x, self.root(p))

    def _stretch(self, w: float) -> float:
        """dp/dw."""
        return self.base.power * math.pow(abs(w), self.base.power - 1)

    def _clipped(self, p: float) -> float:
        """P, or the edge beyond which there are no states."""
        low, high = self.base.parameter_range
        return p if self.base.beyond_edge else min(max(p, low), high)

    def at(self, q: float) -> EquilibriumProblem:
        """The equilibrium problem at q."""
        return self._member(0.0 if self.locus.family.spacing == "angle" else q)

    def inner(self, u: Array, v: Array) -> float:
        """Of the states in units of a typical one, plus the product of the last components."""
        return self.base.inner(u[:-1], v[:-1]) / self.locus.size**2 + float(u[-1] * v[-1])

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        return np.append(self.base.dual(u[:-1]) / self.locus.size**2, u[-1])

    def metric(self, x: Array) -> Metric:
        """States are measured in units of their own size, the family's coordinate in its own."""
        return Metric(1.0, 1.0)

    # -- equilibria at fixed q ----------------------------------------------------------------------------------------
    def sheet(self, x: Array, p: float, q: float) -> Sheet:
        """Linearisation and tangent at (x, p; q).

        Raises
        ------
        ModelError, CorrectionError
            If the state cannot be evaluated.
        """
        if not math.isfinite(p):
            raise ModelError("no equilibrium beyond the edge of its parameter")
        problem = self.at(q)
        linear = linearise(problem, x, p)
        bordered = border(problem, x, p, linear, (self._border[:-1], float(self._border[-1])))
        tangent = np.append(*solve(bordered, np.zeros_like(x), 1.0, p))
        tangent /= math.sqrt(self.inner(tangent, tangent))
        return Sheet(Point(problem, x, p, tangent[:-1], float(tangent[-1])), linear, bordered)

    def sheets(self, z: Array, q: float) -> tuple[Sheet, Sheet]:
        """The linearisations at a state, and at the equilibrium next to it."""
        for known, value, own, nearest in self._kept:
            if known is z and value == q:
                return own, nearest
        own = self.sheet(*self.split(z), q)
        nearest = self._nearest(own, q)
        self._kept = [(z, q, own, nearest), *self._kept[: SHEETS - 1]]
        return own, nearest

    def _nearest(self, sheet: Sheet, q: float) -> Sheet:
        point = sheet.point
        dx, dp = sheet.solve(-sheet.linear.residual)
        largest = max(float(np.abs(point.x).max()), 1e-3 * self.scale)
        if float(np.abs(dx).max()) / largest + abs(dp) <= NEAR:
            return sheet
        return self.sheet(point.x + dx, self._clipped(point.parameter + dp), q)

    def held(self, point: Point) -> Point:
        """The equilibrium of a point of this curve, with its unit tangent at fixed q."""
        return self.sheets(point.x, point.parameter)[1].point

    def _level(self, x: Array, p: float, q: float) -> float:
        """The condition's value at the equilibrium next to (x, p)."""
        return self.locus.condition.value(self._nearest(self.sheet(x, p, q), q).point, q)

    # -- the augmented system -----------------------------------------------------------------------------------------
    def residual(self, x: Array, p: float) -> Array:
        """(R, G), (n + 1,)."""
        own, nearest = self.sheets(x, p)
        return np.append(own.linear.residual, self.locus.condition.value(nearest.point, p))

    def jacobian(self, x: Array, p: float) -> Array:
        """d(R, G)/d(x, w), (n + 1, n + 1)."""
        return np.asarray(self.linearise(x, p).jacobian)

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual, its derivatives with respect to state and parameter."""
        own, nearest = self.sheets(x, p)
        n, w = x.size - 1, float(x[-1])
        stretch = self._stretch(w)
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = own.linear.jacobian
        matrix[:n, n] = own.linear.parameter_derivative * stretch
        # G changes along the border alone, by its rate along (x, w)' = (dp/dw v_x, v_p).
        row = np.append(self._border[:-1] / max(stretch, 1e-8), self._border[-1])
        along = np.append(stretch * own.point.tangent_x, own.point.tangent_parameter)
        matrix[n] = self._along(own.point, w, p) * row / float(row @ along)
        residual_rate = self._residual_rate(*self.split(x), p)
        value = self.locus.condition.value(nearest.point, p)
        change = self._across(own, residual_rate, p)
        return Linearisation(np.append(own.linear.residual, value), matrix, np.append(residual_rate, change))

    def _residual_rate(self, x: Array, p: float, q: float) -> Array:
        """dR/dq at fixed (x, p)."""
        if self.locus.family.spacing == "angle":
            return np.zeros_like(x)
        above, below = (self.at(q + step).residual(x, p) for step in (RATE_STEP, -RATE_STEP))
        return np.asarray((above - below) / (2 * RATE_STEP))

    def _stencil(self, one_sided: bool) -> tuple[Array, Array]:
        """Offsets and weights of a difference over a unit length."""
        step, half = (FINE_STEP, 2) if self.fine else (STEP, 1)
        nodes = np.arange(2.0 * half + 1) - (0 if one_sided else half)
        weights = np.linalg.solve(np.vander(nodes, increasing=True).T, np.eye(len(nodes))[1])
        used = np.abs(weights) > ZERO
        return np.asarray(step * nodes[used]), np.asarray(weights[used] / step)

    def _along(self, point: Point, w: float, q: float) -> float:
        """Rate of the condition along the tangent at fixed q, times dp/dw."""
        x, p, v, a = point.x, point.parameter, point.tangent_x, point.tangent_parameter
        length = min(1.0, max(abs(w), LEAST_LENGTH))
        offsets, weights = self._stencil(False)
        outside = [math.isnan(self.parameter(w + s * length * a)) for s in (offsets[0], offsets[-1])]
        if any(outside):  # towards the side that has states
            offsets, weights = self._stencil(True)
            length = -length if outside[1] else length
        levels = []
        for offset in offsets * length:
            there = self.parameter(w + offset * a)
            share = (there - p) / a if abs(a) > 1e-8 else offset * self._stretch(w)
            levels.append(self._level(x + share * v, there, q))
        return float(weights @ levels) / length

    def _across(self, sheet: Sheet, residual_rate: Array, q: float) -> float:
        """Rate of the condition with q along the surface of equilibria, at fixed c·(x, p)."""
        x_rate, p_rate = sheet.solve(-residual_rate)
        x, p = sheet.point.x, sheet.point.parameter
        offsets, weights = self._stencil(False)
        levels = [self._level(x + s * x_rate, self._clipped(p + s * p_rate), q + s) for s in offsets]
        return float(weights @ levels)

    # -- what is seen -------------------------------------------------------------------------------------------------
    def start(self, control: Control) -> Point:
        """None: an event is followed from where it was found."""
        raise NotImplementedError

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Of the family's coordinate."""
        return self.locus.interval

    values, observables, margins, unstable, profile = map(
        _of_equilibrium, ("values", "observables", "margins", "unstable", "profile")
    )

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Of the equilibrium, by differences; to one side where the other has no states."""
        w, w_rate = float(x[-1]), float(x_rate[-1])
        one, other = [s for s in (RATE_STEP, -RATE_STEP, 0.0) if math.isfinite(self.parameter(w + s * w_rate))][:2]
        there, here = (self.values(x + s * x_rate, p + s * p_rate)[:4] for s in (one, other))
        return Rates(*((a - b) / (one - other) for a, b in zip(there, here, strict=True)))

    # -- discretisations ----------------------------------------------------------------------------------------------
    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A discretisation for this solution, and a reference direction close to its tangent, where needed."""
        tangent = direction(self.sheets(x, p)[1].point)
        offer = self.at(p).adapt(*self.split(x))
        if isinstance(offer, Adaptation) and offer.transfer is not None:
            transfer = offer.transfer
            base = equilibrium(Point(offer.problem, offer.x, p, offer.x, p))

            def carried(z: Array) -> Array:
                return np.append(transfer(z[:-1]), z[-1])

            return Adaptation(self.on(base, carried(tangent)), np.append(offer.x, x[-1]), carried)
        if abs(float(self._border @ tangent)) >= (0.5 * UPRIGHT if self.upright else ALIGNED):
            return None
        return Adaptation(self.on(self.base, tangent), x, lambda z: z)

    def finer(self) -> Self:
        """On the finer discretisation."""
        base = self.base.finer()
        return self if base is self.base else self.on(base)

    def carried(self, vector: Array, x: Array, p: float, other: Self) -> Array:
        """A state or direction on another discretisation."""
        return np.append(self.base.carried(vector[:-1], *self.split(x), other.base), vector[-1])

    def resolving(self, point: Point, tolerance: float) -> Self:
        """A discretisation made for a state."""
        own = self.held(point)
        base = equilibrium(own).resolving(own, tolerance)
        return self if base is own.problem else self.on(base)

    def defect(self, point: Point) -> Defect:
        """Of the equilibrium."""
        own = self.held(point)
        return equilibrium(own).defect(own)

    @property
    def size(self) -> int:
        """Number of unknowns of the equilibrium."""
        return self.base.size

    @property
    def rounding(self) -> float:
        """Of the equilibrium."""
        return self.base.rounding


def direction(point: Point) -> Array:
    """The tangent (x, p) of a point, (n + 1,)."""
    return np.append(point.tangent_x, point.tangent_parameter)


def augmented(point: Point) -> Augmented:
    """The problem of a point of a followed event.

    Raises
    ------
    TypeError
        If it is none.
    """
    if isinstance(point.problem, Augmented):
        return point.problem
    raise TypeError(f"{type(point.problem).__name__} is not an Augmented")
