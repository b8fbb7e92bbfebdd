"""Bounds of the round-off in the events of the exact model, whose only error it is."""

from __future__ import annotations

import math

import numpy as np

from contbranch.theory._dugdale import Angle, Zone
from contbranch.theory.maugis import without_contact

__all__ = ["error_apart", "error_in_contact"]

# Every value is a sum of a few terms, each good to a few units in the last place.
_ROUND_OFF = 16.0 * float(np.finfo(float).eps)


def error_apart(zone: Zone, c: float) -> dict[str, float]:
    """Bound the errors without contact, where the gap is a product, d = -gap - 2 (sigma/E) c and F = -pi sigma c^2."""
    gap = _ROUND_OFF * float(without_contact(zone, np.asarray(c)).central_gap)
    shift = 2.0 * float(zone.strain) * c
    return {
        "load": _ROUND_OFF * math.pi * float(zone.stress) * c * c,
        "displacement": gap + _ROUND_OFF * shift,
        "contact_radius": 0.0,
        "central_gap": gap,
    }


def error_in_contact(zone: Zone, tangent: float, rigid: float, compliance: float) -> dict[str, float]:
    """Bound the errors at the fold of rigid * d + compliance * F: of its place, times slopes, and of the values."""
    step = 1e-5
    angle = Angle.from_tangent(tangent * np.exp([-step, 0.0, step]))
    slopes = zone.slopes(angle)
    condition = rigid * slopes.displacement + compliance * slopes.load
    terms = rigid * slopes.displacement_terms + compliance * slopes.load_terms
    curvature = abs(condition[2] - condition[0]) / (2.0 * step)
    place = _ROUND_OFF * (terms[1] / curvature + 1.0 + abs(math.log(tangent)))  # of log(tangent)
    theta, cos, sin = (float(x[1]) for x in angle)
    c = float(zone.interaction_radius(angle)[1])
    a, s = c * cos, c * sin
    turn = place * sin * cos  # of the rim angle
    load_terms = 4.0 / 3.0 * float(zone.modulus / zone.radius) * a**3
    load_terms += 2.0 * float(zone.stress) * c * c * (theta + sin * cos)
    displacement_terms = a * a / float(zone.radius) + 2.0 * float(zone.strain) * s
    return {
        "load": float(abs(slopes.load[1]) * cos * turn + _ROUND_OFF * load_terms),
        "displacement": float(abs(slopes.displacement[1]) * cos * turn + _ROUND_OFF * displacement_terms),
        "contact_radius": float(abs(slopes.contact_radius[1]) * turn + _ROUND_OFF * a),
        "central_gap": 0.0,
    }
