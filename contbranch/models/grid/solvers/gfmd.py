"""Green's-function molecular dynamics: damped motion of modes whose masses are weighted with their stiffness.

Damped leapfrog, with the damping of the slowest mode that still moves, critical for it:

    (1 + γτ/2) π' = (1 - γτ/2) π + τ f,      u' = u + τ W π',      γ = 2ω,   ω² = v·Hv / v·π,

H the second variation, Hv from the change of the force in the last step. Momentum that works against the force is
dropped.

References: Campañá & Müser, Phys. Rev. B 74, 075420 (2006) (dynamics of the modes); Underwood, in Computational Methods
for Transient Analysis (1983), 245 (damping from Rayleigh's quotient); O'Donoghue & Candès, Found. Comput. Math. 15, 715
(2015) (restarts).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .motion import DEFAULT, Ending, MotionSettings, Place, Relaxed, System, curvature, ending_of

__all__ = ["gfmd"]

Array = NDArray[np.float64]


def gfmd(system: System[Place], place: Place, settings: MotionSettings = DEFAULT) -> Relaxed[Place]:
    """Relax from rest until the residual asked for is reached.

    Parameters
    ----------
    system : System
    place : Place
        Start.
    settings : MotionSettings

    Returns
    -------
    Relaxed
    """
    force = system.force(place)
    momentum = np.zeros_like(force)
    velocity = change = momentum
    stiffest = system.stiffest
    time = 2.0 * settings.safety / math.sqrt(stiffest)
    frequency = 0.0
    for step in range(settings.steps + 1):
        ending = ending_of(system, place, velocity, settings.tolerance)
        if ending is not None or step == settings.steps:
            return Relaxed(place, step, ending or Ending.STEPS)
        momentum = system.confine(place, momentum)
        if float(np.vdot(force, change)) < 0.0:
            momentum[...] = 0.0
        damping = min(frequency * time, 1.0)
        momentum *= (1.0 - damping) / (1.0 + damping)
        momentum += (time / (1.0 + damping)) * force
        velocity = system.mobility(place, momentum)
        slowing = system.slowing(place, time * velocity)
        if slowing < 1.0:
            momentum *= slowing
            velocity = slowing * velocity
        before, start = force, place
        place = system.move(place, momentum, velocity, time)
        force, change = system.force(place), system.change(start, place)
        steep = curvature(before, force, change, momentum, velocity, time)
        if steep > stiffest:
            stiffest = steep
            time = 2.0 * settings.safety / math.sqrt(stiffest)
        frequency = math.sqrt(max(steep, 0.0))
    raise AssertionError("unreachable")
