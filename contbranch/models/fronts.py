"""Steep fronts of the pressure, how smooth a film has to be, and how long it lasts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from contbranch.contact.tip_shape import Tip

__all__ = ["BEGINS", "CORE", "ENDS", "ENDURES", "FLATTER", "SMOOTH", "STIFF", "lasts"]

# A front begins where the pressure changes by more than this multiple of its largest value over its distance from the
# rim, ends where it changes by less than the second, and is moved where its own change is below this share.
BEGINS, ENDS, FLATTER = 1.5, 1.0, 0.2
# Radius over which the interaction is felt in units of the length on which elasticity answers it, from which on steps
# are limited by fronts.
STIFF = 16.0
# Share of its largest value up to which v'' may be unresolved inside a film, as far as that bears this share of its
# largest pressure.
SMOOTH, CORE = 1e-4, 0.7
# Logarithm of the factor of the load within which a film has to be squeezed out, under a power law and under a cone,
# whose loads say little more than their logarithm; and what is said where it is not.
BEYOND, UNDER_CONES = math.log(1e9), math.log(1e6)
ENDURES = "The film stays: under so sharp a tip, the load at which it is squeezed out is more than 1e6 times larger."


def lasts(tip: Tip, displacement: float, left: float, rate: float) -> bool:
    """Whether a film bears `left` more pressure in its middle than any load that can be computed brings there.

    That pressure grows by `rate` with the logarithm of the load: under a tip like r^n, as far as it is pressed, with
    the power (n − 1)/(n + 1) of the load; under a cone of slope z′ by z′E/4 with every factor e (I. N. Sneddon, Int. J.
    Eng. Sci. 3 (1965) 47), if not by more as yet.
    """
    pressed = min(tip.radius_at(max(displacement, 0.0)), 0.5 * tip.extent)
    half, full = tip.height_derivative(pressed * np.array([0.5, 1.0]))
    exponent = max(1.0 + math.log2(full / half), 1.0) if half > 0.0 else tip.apex_exponent
    power = (exponent - 1.0) / (exponent + 1.0)
    return bool(left > rate * (math.expm1(power * BEYOND) / power if power > 0.0 else UNDER_CONES))
