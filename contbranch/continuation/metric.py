"""Lengths and angles in the space of states and parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation.problem import Array, Direction, Problem

ROUNDING = float(np.finfo(float).eps)

# Share of the earlier path that still counts after one more step: a memory of about ten steps follows a curve over
# many magnitudes, and is long enough that a fold, where the parameter rests for a few steps, does not upset it.
MEMORY = 0.9
# A scale never falls below this share of the whole path, lest a coordinate that has come to rest is blown up.
LEAST_SCALE_SHARE = 0.01
# A path shorter than this multiple of its coordinate's rounding sets no scale, lest rounding turn the curve.
SCALE_IN_ROUNDINGS = 1e6


@dataclass(frozen=True, slots=True)
class Metric:
    """The inner product <(u, a), (v, b)> = inner(u, v)/state_scale² + a b/parameter_scale².

    Attributes
    ----------
    state_scale, parameter_scale : float
        Lengths of state and parameter that count as one.
    """

    state_scale: float
    parameter_scale: float

    def dot(self, problem: Problem, u: Array, a: float, v: Array, b: float) -> float:
        """Return the inner product of two directions."""
        return problem.inner(u, v) / self.state_scale**2 + a * b / self.parameter_scale**2

    def norm(self, problem: Problem, u: Array, a: float) -> float:
        """Return the length of a direction."""
        return math.sqrt(max(self.dot(problem, u, a, u, a), 0.0))

    def unit(self, problem: Problem, u: Array, a: float) -> Direction:
        """Return the direction with the length one."""
        size = self.norm(problem, u, a)
        return u / size, a / size

    def row(self, problem: Problem, u: Array, a: float) -> Direction:
        """Return the border (c, d) with c @ v + d b = <(u, a), (v, b)>."""
        return problem.dual(u) / self.state_scale**2, a / self.parameter_scale**2

    def angle(self, problem: Problem, u: Array, a: float, v: Array, b: float) -> float:
        """Return the angle between two unit directions, accurate for small angles too."""
        half = self.norm(problem, u - v, a - b) / 2
        return 2 * math.asin(min(half, 1.0))


@dataclass(frozen=True, slots=True)
class Balance:
    """Scales of state and parameter taken from the path itself, so that neither rules the arclength.

    Each scale is the path length of its part over about the last ten steps. Both therefore carry their own units, and
    multiplying x or p by a constant changes nothing.
    """

    state: float
    parameter: float
    state_total: float = 0.0
    parameter_total: float = 0.0
    state_size: float = 0.0
    parameter_size: float = 0.0

    @classmethod
    def ahead(cls, state_slope: float, parameter_slope: float, size: float, p: float, width: float) -> Balance:
        """Return the scales with which a curve begins in a range of the parameter: how far both will go, by the tangent
        (slopes, at least 0); close to a fold it says nothing about how far the state will go."""
        parameter = width if math.isfinite(width) else max(1.0, abs(p))
        state = state_slope / parameter_slope * parameter if parameter_slope > 0 else math.inf
        if state > 10 * size > 1e3 * ROUNDING * state:
            state = 10 * size
            parameter = max(state * parameter_slope / state_slope, 1e-6 * parameter)
        return cls(state if math.isfinite(state) and state > 0 else size or 1.0, parameter)

    def sized(self, state: float, parameter: float) -> Balance:
        """Return the scales where a state of this size and a parameter have been: what is at rest has its size for one.

        At rest is what moves by less than a multiple of its rounding.
        """
        state, parameter = max(self.state_size, state), max(self.parameter_size, abs(parameter))
        least = SCALE_IN_ROUNDINGS * ROUNDING
        own = self.state if self.state > least * state else state
        other = self.parameter if self.parameter > least * parameter else parameter
        return replace(self, state=own, parameter=other, state_size=state, parameter_size=parameter)

    def advance(self, state_change: float, parameter_change: float) -> Balance:
        """Return the scales after a step with these changes of state (its norm) and of parameter."""
        state_total = self.state_total + state_change
        parameter_total = self.parameter_total + parameter_change
        return replace(
            self,
            state=max(MEMORY * self.state + state_change, LEAST_SCALE_SHARE * state_total),
            parameter=max(MEMORY * self.parameter + parameter_change, LEAST_SCALE_SHARE * parameter_total),
            state_total=state_total,
            parameter_total=parameter_total,
        )

    def metric(self, weight: float = 1.0, floor: float = 0.0) -> Metric:
        """Return the metric; weight > 1 lets the parameter count for more, the state's scale does not go below
        floor."""
        return Metric(max(self.state, floor), self.parameter / weight)
