"""Where the exact model is sampled: points along the curve, and distances from the axis of one state."""

from __future__ import annotations

import math

import numpy as np

from contbranch.models.exact.results import ExactState
from contbranch.theory._inputs import FloatArray

__all__ = ["graded", "profile_grid"]


def graded(last: float, scale: float, count: int) -> FloatArray:
    """Return points from 0 to ``last``, evenly spaced below ``scale`` and evenly in their logarithm above."""
    grid = scale * np.sinh(np.linspace(0.0, math.asinh(last / scale), count))
    grid[-1] = last
    return np.asarray(grid)


def profile_grid(state: ExactState) -> FloatArray:
    """Return distances from the axis, graded towards the rims of contact and interaction, to three times the latter."""
    a, c = state.contact_radius, state.interaction_radius
    ease = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 81)))
    end = max(3.0 * c, c + 2.0)
    parts = [
        a * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 81)),
        a + (c - a) * ease,
        c + (end - c) * np.linspace(0.0, 1.0, 161) ** 2,
    ]
    return np.unique(np.concatenate(parts))
