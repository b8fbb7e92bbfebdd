"""Gap and pressures of a state as functions of the radius."""

from __future__ import annotations

import numpy as np

from contbranch.results.diagram import Profile

from .equations import Equations, Fields

__all__ = ["profile_of"]

# Radii inside the contact, Chebyshev-spaced so that the rim, where the wall pressure is steep, is resolved.
INSIDE = np.sin(np.pi / 2 * np.arange(48) / 48)


def profile_of(equations: Equations, fields: Fields) -> Profile:
    """Gap, total pressure and wall pressure: inside the contact by the Abel inversion, outside from the gap."""
    a = fields.rim.radius
    outside = np.hypot(a, equations.mesh.nodes)
    if a == 0:
        return Profile(outside, fields.gap, fields.pressure, np.zeros_like(outside))
    inside = np.maximum(a * INSIDE, 1e-6 * a)
    pressure = equations.inner_pressure(fields, inside)
    wall = pressure - equations.contact_pressure()
    return Profile(
        np.concatenate([inside, outside]),
        np.concatenate([np.zeros_like(inside), fields.gap]),
        np.concatenate([pressure, fields.pressure]),
        np.concatenate([wall, np.zeros_like(outside)]),
    )
