"""An event as a curve: equilibrium and the event's condition together, with one parameter of the contact free.

The augmented system of `contbranch.continuation.augmented` with the family's coordinate q as parameter: the condition
of a fold is the rate of what is controlled along the curve of equilibria at fixed q. Its state is z = (x, w), w being p
itself or that root of it in which conditions are smooth (`EquilibriumProblem.power`). Events of this curve, where q
turns round or first touch is passed, are those of codimension two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from contbranch.contact.family import Family
from contbranch.continuation import Adaptation, Event, Metric, Options, Point
from contbranch.continuation.augmented import Augmented, Sheet, tangent_of
from contbranch.continuation.edge import Range
from contbranch.continuation.metric import ROUNDING
from contbranch.continuation.problem import Array
from contbranch.continuation.walk import corrected_point
from contbranch.control import Control
from contbranch.curve import problem
from contbranch.curve.events import FoldEvent, rates
from contbranch.curve.problem import Defect, EquilibriumProblem, Rates, equilibrium
from contbranch.errors import ModelError

__all__ = ["Condition", "EventProblem", "augmented"]

# Differences along the curve of equilibria are taken over lengths of w itself, but not below this one.
LEAST_ROOT = 1e-2
# The parameter itself is the border where the tangent has at least this component of it; contacts that are all but none
# have no other direction along which states change evenly with w.
UPRIGHT_SHARE = 1e-3
# This far beyond an edge of the parameter is rounding.
EDGE_ROUNDING = 1e-12
# How far points on the curve are corrected.
PRECISE = Options(tolerance=1e-12, noise=1e8)
STEPS = replace(problem.STEPS, first_step=0.02, maximum_points=600)


@dataclass(frozen=True)
class Condition:
    """What makes an equilibrium of a family an event: a fold, an edge of the parameter, or another event.

    Attributes
    ----------
    family : Family
    control : Control or None
        Of a fold, reduced units of the family's start.
    event : Event or None
        Any other event of the curves of equilibria, such as an eigenvalue of a mode that passes 1.
    edge : float or None
        The parameter is held there: first touch, or (with a control) the fold in another corner of the curve.
    """

    family: Family
    control: Control | None = None
    event: Event | None = None
    edge: float | None = None

    @property
    def folds(self) -> bool:
        """Whether it is that of a fold."""
        return self.edge is None and self.event is None

    def at(self, q: float) -> Event | None:
        """What vanishes along the curve of equilibria at q; None where the parameter is held."""
        return FoldEvent(self.family.control(q, self.control)) if self.folds and self.control else self.event

    def weights(self, q: float) -> tuple[float, float]:
        """Those of the control of a fold; where q is the angle arctan K, smooth beyond its ends, too."""
        if self.family.spacing == "angle" or self.control is None:
            return math.cos(q), math.sin(q)
        return self.family.control(q, self.control).weights

    def value(self, point: Point, q: float) -> float:
        """A number that vanishes at a fold or another event; the point has its unit tangent at fixed q."""
        return self.event.value(point) if self.event is not None else float(np.dot(self.weights(q), rates(point)))


def _of_equilibrium(name: str) -> Callable[..., Any]:
    """A method of the augmented problem that asks the equilibrium's own of that name."""
    return lambda self, x, p: getattr(self.at(p), name)(*self.split(x))


class EventProblem(Augmented, EquilibriumProblem):
    """The augmented system of an event on one discretisation of one representation.

    Parameters
    ----------
    what : Condition
    base : EquilibriumProblem
        Of any member of the family.
    reference : array (n + 1,)
        Direction (x, p) to which tangents are compared: it borders the matrix, and orients them.
    interval : Range
        The family's coordinates between which the event is followed.
    unit : float
        Norm of a typical state: the unit of states in lengths.
    """

    def __init__(
        self, what: Condition, base: EquilibriumProblem, reference: Array, interval: Range, unit: float
    ) -> None:
        self.what, self.base, self.unit = what, base, unit
        self.scale, self.work = base.scale, base.work
        family, upright = what.family, abs(reference[-1]) > UPRIGHT_SHARE * math.sqrt(self.inner(reference, reference))
        if upright:
            self.aligned = 0.5 * UPRIGHT_SHARE
            reference = np.append(np.zeros(reference.size - 1), reference[-1])

        def at(q: float) -> EquilibriumProblem:
            return base if family.spacing == "angle" else base.varied(family.reduced(q)[0])

        super().__init__(at, reference, interval)

    @classmethod
    def around(cls, what: Condition, point: Point, interval: Range) -> Self:
        """The system at an event's equilibrium; a state may vanish there."""
        base = equilibrium(point)
        return cls(what, base, tangent_of(point), interval, base.metric(point.x).state_scale)

    def on(self, reference: Array, base: EquilibriumProblem | None = None) -> Self:
        """The same event with another border, on another discretisation or representation."""
        return type(self)(self.what, base or self.base, reference, self.interval, self.unit)

    def _on(self, base: EquilibriumProblem) -> Self:
        """The same event on another discretisation."""
        if base is self.base:
            return self
        x = self.reference[:-1]
        return self.on(np.append(self.base.carried(x, x, math.nan, base), self.reference[-1]), base)

    def condition(self, point: Point, q: float) -> float:
        """What vanishes at the event, smooth in w."""
        if self.what.edge is not None:
            return self.root(point.parameter) - self.root(self.what.edge)
        return self.what.value(point, q)

    # -- state --------------------------------------------------------------------------------------------------------
    @property
    def edges(self) -> tuple[float, float]:
        """Values of w between which this representation has states."""
        low, high = map(self.root, self.base.parameter_range)
        return (-math.inf, math.inf) if self.base.beyond_edge else (low, high)

    def parameter(self, w: float) -> float:
        """The parameter p of w; NaN where this representation has no states."""
        low, high = self.edges
        if not low - EDGE_ROUNDING <= w <= high + EDGE_ROUNDING:
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

    def stretch(self, w: float) -> float:
        """dp/dw."""
        return self.base.power * math.pow(abs(w), self.base.power - 1)

    def inside(self, p: float) -> float:
        """P, or the edge beyond which there are no states."""
        low, high = self.base.parameter_range
        return p if self.base.beyond_edge else min(max(p, low), high)

    def ahead(self, z: Array, point: Point, s: float) -> tuple[Array, float]:
        """(x, p) where w has changed by s times the tangent's component."""
        w, a = float(z[-1]), point.tangent_parameter
        p = self.parameter(w + s * a)
        share = (p - point.parameter) / a if abs(a) > 1e-8 else s * self.stretch(w)
        return point.x + share * point.tangent_x, p

    def room(self, z: Array, point: Point) -> tuple[float, float]:
        """Distances to the edges of the parameter."""
        return _room(float(z[-1]), point.tangent_parameter, self.edges)

    def length(self, z: Array, point: Point) -> float:
        """W itself, as far as that is not too short."""
        return min(1.0, max(abs(float(z[-1])), LEAST_ROOT))

    def inner(self, u: Array, v: Array) -> float:
        """Of the states in units of a typical one, plus the product of the last components."""
        return self.base.inner(u[:-1], v[:-1]) / self.unit**2 + float(u[-1] * v[-1])

    def dual(self, u: Array) -> Array:
        """Vector whose product with v is inner(u, v)."""
        return np.append(self.base.dual(u[:-1]) / self.unit**2, u[-1])

    def metric(self, x: Array) -> Metric:
        """States are measured in units of their own size, the family's coordinate in its own."""
        return Metric(1.0, 1.0)

    def sheet(self, x: Array, p: float, q: float) -> Sheet:
        """Linearisation and tangent at (x, p; q).

        Raises
        ------
        ModelError, CorrectionError
            If the state cannot be evaluated.
        """
        if not math.isfinite(p):
            raise ModelError("no equilibrium beyond the edge of its parameter")
        return super().sheet(x, p, q)

    def held(self, point: Point) -> Point:
        """The equilibrium of a point of this curve, with its unit tangent at fixed q."""
        return self.nearest(point.x, point.parameter)

    def solved(self, z: Array, q: float, place: bool = False) -> Point:
        """The event at q next to a state; with `place` that with the state's w, for which q is found.

        Raises
        ------
        CorrectionError
            If there is none close by.
        """
        held = np.append(np.zeros(z.size - 1), float(place)), float(not place)
        point, _ = corrected_point(self, (z, q), held, self.metric(z), PRECISE)
        return replace(point, x=np.append(point.x[:-1], z[-1])) if place else replace(point, parameter=q)

    # -- what is seen -------------------------------------------------------------------------------------------------
    def start(self, control: Control) -> Point:
        """None: an event is followed from where it was found."""
        raise NotImplementedError

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Of the family's coordinate."""
        return self.interval.low, self.interval.high

    values, observables, margins, unstable, profile = map(
        _of_equilibrium, ("values", "observables", "margins", "unstable", "profile")
    )

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Of the equilibrium, by differences; that of the radius by its square, smooth where contact begins."""

        def values(s: float) -> Array:
            load, displacement, radius, gap, _ = self.values(x + s * x_rate, p + s * p_rate)
            return np.array([load, displacement, radius**2, gap])

        low, high = _room(float(x[-1]), float(x_rate[-1]), self.edges)
        least, most = _room(p, p_rate, self.parameter_range)
        step = ROUNDING ** (1 / 3)
        found = self.difference(values, step, max(low, least), min(high, most))
        radius = self.values(x, p).contact_radius
        found[2] *= 0.5 / radius if radius > 0.0 else 0.0
        return Rates(*found.tolist())

    # -- discretisations ----------------------------------------------------------------------------------------------
    def adapt(self, x: Array, p: float) -> Adaptation | None:
        """A discretisation for this solution, and a border close to its tangent, where needed."""
        offer = self.at(p).adapt(*self.split(x))
        if not isinstance(offer, Adaptation) or offer.transfer is None:
            return super().adapt(x, p)
        transfer = offer.transfer
        base = equilibrium(Point(offer.problem, offer.x, p, offer.x, p))

        def carried(z: Array) -> Array:
            return np.append(transfer(z[:-1]), z[-1])

        tangent = tangent_of(self.nearest(x, p))
        return Adaptation(self.on(carried(tangent), base), np.append(offer.x, x[-1]), carried)

    def finer(self) -> Self:
        """On the finer discretisation."""
        return self._on(self.base.finer())

    def carried(self, vector: Array, x: Array, p: float, other: Self) -> Array:
        """A state or direction on another discretisation."""
        return np.append(self.base.carried(vector[:-1], *self.split(x), other.base), vector[-1])

    def resolving(self, point: Point, tolerance: float) -> Self:
        """A discretisation made for a state."""
        own = self.held(point)
        base = equilibrium(own).resolving(own, tolerance)
        return self if base is own.problem else self._on(base)

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


def _room(place: float, rate: float, edges: tuple[float, float]) -> tuple[float, float]:
    """Distances, backwards and forwards, over which what changes at a rate stays between two edges."""
    if rate == 0.0:
        return -math.inf, math.inf
    low, high = sorted((edge - place) / rate for edge in edges)
    return low, high


def augmented(point: Point) -> EventProblem:
    """The problem of a point of a followed event.

    Raises
    ------
    TypeError
        If it is none.
    """
    if isinstance(point.problem, EventProblem):
        return point.problem
    raise TypeError(f"{type(point.problem).__name__} is not an EventProblem")
