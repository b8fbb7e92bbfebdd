"""Functions along a curve whose zeros a user wants located."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from contbranch.continuation.curve import Point
from contbranch.continuation.problem import Array

__all__ = ["Crossing", "Event", "Extremum", "TangentCrossing"]

_CUBE_ROOT_OF_ROUNDING = 6e-6


class Event(ABC):
    """A number along the curve; its zeros are the event.

    Attributes
    ----------
    name : str
        Name of the located points.
    terminal : bool
        Whether the curve is to end at the first zero.
    hidden_pairs : bool
        Whether two zeros within one step are looked for, too. Without, a step whose ends have values of the same sign
        costs nothing more.
    resolution : float
        Share of the step to which zeros are located; the default is machine precision.
    relative_resolution : float
        The same relative to the position in the step, so that zeros right behind its start are still told from it.
    """

    name: str = "event"
    terminal: bool = False
    hidden_pairs: ClassVar[bool] = True
    resolution: ClassVar[float] = 1e-15
    relative_resolution: ClassVar[float] = 0.0

    @abstractmethod
    def value(self, point: Point) -> float:
        """Return the number at a point of the curve; `point` has problem, x, parameter and the unit tangent."""

    def primitive(self, point: Point) -> float | None:
        """Return a quantity whose derivative along the unit tangent is `value`, or None (the default).

        With it, pairs of zeros within a step are excluded from what is known at its ends, without evaluations inside.
        """
        return None


@dataclass(frozen=True)
class Crossing(Event):
    """Zeros of a function of state and parameter, function(x, p)."""

    function: Callable[[Array, float], float]
    name: str = "crossing"
    terminal: bool = False

    def value(self, point: Point) -> float:
        """Return function(x, p)."""
        return float(self.function(point.x, point.parameter))


@dataclass(frozen=True)
class TangentCrossing(Event):
    """Zeros of a function of state, parameter and unit tangent, function(x, p, tangent_x, tangent_p)."""

    function: Callable[[Array, float, Array, float], float]
    name: str = "crossing"
    terminal: bool = False

    def value(self, point: Point) -> float:
        """Return function(x, p, tangent_x, tangent_p)."""
        return float(self.function(point.x, point.parameter, point.tangent_x, point.tangent_parameter))


@dataclass(frozen=True)
class Extremum(Event):
    """Extrema of one of the problem's observables along the curve.

    The derivative along the curve is a central difference along the true tangent, so the position is good to about
    1e-10 and the extreme value to rounding. Where the observable is a component of x, a `TangentCrossing` on that
    component of the tangent is exact and costs nothing.
    """

    observable: str
    name: str = ""
    terminal: bool = False

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", f"extremum of {self.observable}")

    def value(self, point: Point) -> float:
        """Return the derivative of the observable along the unit tangent."""
        problem = point.problem
        size = math.sqrt(problem.inner(point.x, point.x) + point.parameter**2)
        slope = math.sqrt(problem.inner(point.tangent_x, point.tangent_x) + point.tangent_parameter**2)
        step = _CUBE_ROOT_OF_ROUNDING * max(size, slope) / slope
        dx, dp = step * point.tangent_x, step * point.tangent_parameter
        above = problem.observables(point.x + dx, point.parameter + dp)[self.observable]
        below = problem.observables(point.x - dx, point.parameter - dp)[self.observable]
        return (above - below) / (2 * step)
