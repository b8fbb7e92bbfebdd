"""What makes an equilibrium an event, on the surface of equilibria of a family of contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_solve

from contbranch.contact.family import Family
from contbranch.contact.interactions import Interaction
from contbranch.contact.tips import Tip
from contbranch.continuation import Event, Point
from contbranch.control import Control

from .equations import ContactCoordinate, Equations, Fields
from .mesh import Mesh
from .problem import ContactProblem, Resolution

__all__ = ["Condition", "EventCondition", "FoldCondition", "Sheet", "Surface", "TouchCondition", "rates"]

Array = NDArray[np.float64]

# Members of the family that are kept.
RECENT = 8


@dataclass
class Surface:
    """The equilibria of a family of contacts, in the units of the one it starts from.

    Attributes
    ----------
    family : Family
    scale : float
        Range in the contact parameter u, ``y = scale · sinh(u)``: the same along the whole curve.
    power : float
        m in the contact coordinate y = a^m, the same along the whole curve.
    resolution : Resolution
    size : float
        √∫h² of a typical state: the unit of h in lengths.
    """

    family: Family
    scale: float
    power: float
    resolution: Resolution
    size: float
    _members: dict[float, tuple[Tip, Interaction | None]] = field(default_factory=dict)

    def problem(self, q: float, mesh: Mesh, contact: bool, sharpness: float = 1.0) -> ContactProblem:
        """The equilibrium problem of a member on a mesh, on one side of first touch."""
        if q not in self._members:
            if len(self._members) >= RECENT:
                self._members.pop(next(iter(self._members)))
            self._members[q] = self.family.reduced(q)[:2]
        tip, law = self._members[q]
        equations = Equations(tip, law, mesh, ContactCoordinate(tip, self.power), contact)
        return ContactProblem(equations, self.scale, self.resolution, sharpness)


@dataclass(frozen=True)
class Sheet:
    """The equilibria of one member around one state: linearisation and tangent.

    Attributes
    ----------
    problem : ContactProblem
    fields : Fields
    u : float
    tangent : (array (N,), float)
        v, of unit length.
    factors : tuple
        LU factors of the bordered matrix.
    """

    problem: ContactProblem
    fields: Fields
    u: float
    tangent: tuple[Array, float]
    factors: tuple[Array, NDArray[np.int32]]

    def solve(self, f: Array) -> tuple[Array, float]:
        """The (h, u) with ``R_h h + R_u u = f`` and no component along the border."""
        found = lu_solve(self.factors, np.append(f, 0.0), check_finite=False)
        return found[:-1], float(found[-1])


class Condition(Protocol):
    """What makes an equilibrium an event."""

    def value(self, sheet: Sheet, q: float) -> float:
        """A number that vanishes at the event, a smooth function of state and q."""

    def control(self, q: float) -> Control | None:
        """The control whose fold it is."""

    def weights(self, q: float) -> tuple[float, float]:
        """Weights of load and displacement in what is controlled."""


@dataclass(frozen=True)
class FoldCondition:
    """A fold: the rate of what is controlled along the tangent vanishes."""

    family: Family
    driven: Control

    def control(self, q: float) -> Control:
        """The control, of which the stiffness may be the parameter itself."""
        return self.family.control(q, self.driven)

    def weights(self, q: float) -> tuple[float, float]:
        """w; (cos q, sin q) where q is the angle arctan K, smooth beyond its ends, too."""
        if self.family.spacing == "angle":
            return math.cos(q), math.sin(q)
        return self.control(q).weights

    def value(self, sheet: Sheet, q: float) -> float:
        """``w·(F', d')`` along the unit tangent."""
        first, second = self.weights(q)
        load, displacement = rates(sheet)
        return first * load + second * displacement


@dataclass(frozen=True)
class TouchCondition:
    """First touch: u = 0."""

    def control(self, q: float) -> Control | None:
        """None."""
        return None

    def weights(self, q: float) -> tuple[float, float]:
        """Nothing is controlled."""
        return 0.0, 0.0

    def value(self, sheet: Sheet, q: float) -> float:
        """U."""
        return sheet.u


@dataclass(frozen=True)
class EventCondition:
    """Any other event of the curve at fixed q, of which points give a value: an eigenvalue of a mode that passes 1."""

    event: Event

    def control(self, q: float) -> Control | None:
        """None."""
        return None

    def weights(self, q: float) -> tuple[float, float]:
        """Nothing is controlled."""
        return 0.0, 0.0

    def value(self, sheet: Sheet, q: float) -> float:
        """The event's own value."""
        return self.event.value(Point(sheet.problem, sheet.fields.h, sheet.u, *sheet.tangent))


def rates(sheet: Sheet) -> tuple[float, float]:
    """Rates of load and displacement along the unit tangent of the equilibria at fixed q."""
    return sheet.problem.rates(sheet.fields.h, sheet.u, *sheet.tangent)
