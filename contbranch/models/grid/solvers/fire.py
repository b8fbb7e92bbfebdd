"""FIRE, the fast inertial relaxation engine, with the mobility as metric.

Momentum is steered towards the force at constant length as long as it works with the force, in steps that grow; when
it works against it, half of the last change is taken back, momentum is dropped, and steps are halved:

    π' = (1 - α)(π + τ f) + α |π + τ f| f/|f|,      u' = u + τ W π'.

References: Bitzek, Koskinen, Gähler, Moseler & Gumbsch, Phys. Rev. Lett. 97, 170201 (2006); Guénolé et al., Comput.
Mater. Sci. 175, 109584 (2020) (semi-implicit steps, half a step back). The constants are theirs, but that steps are
bounded by the limit of stability.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .motion import DEFAULT, Ending, MotionSettings, Place, Relaxed, System, curvature, ending_of

__all__ = ["fire"]

Array = NDArray[np.float64]

_DELAY = 5  # steps with the force before the steps grow
_GROWTH = 1.1
_SHRINKING = 0.5
_STEERING = 0.1  # α at first
_FADING = 0.99  # of α


def fire(system: System[Place], place: Place, settings: MotionSettings = DEFAULT) -> Relaxed[Place]:
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
    longest = 2.0 * settings.safety / math.sqrt(stiffest)
    time, steering, along = 0.5 * longest, _STEERING, 0
    for step in range(settings.steps + 1):
        ending = ending_of(system, place, velocity, settings.tolerance)
        if ending is not None or step == settings.steps:
            return Relaxed(place, step, ending or Ending.STEPS)
        momentum = system.confine(place, momentum)
        if float(np.vdot(force, change)) < 0.0:
            # What is held stays: taken back, it would be held again at once, and nothing would have moved.
            place = system.move(place, None, system.confine(place, change), -0.5)
            force = system.force(place)
            momentum = np.zeros_like(force)
            time, steering, along = max(_SHRINKING * time, 0.02 * longest), _STEERING, 0
        else:
            along += 1
            if along > _DELAY:
                time, steering = min(_GROWTH * time, longest), _FADING * steering
        momentum = momentum + time * force
        size = float(np.linalg.norm(force))
        if size > 0.0:
            towards = float(np.linalg.norm(momentum)) / size
            momentum = (1.0 - steering) * momentum + (steering * towards) * force
        velocity = system.mobility(place, momentum)
        slowing = system.slowing(place, time * velocity)
        if slowing < 1.0:
            momentum, velocity = slowing * momentum, slowing * velocity
        before, start = force, place
        place = system.move(place, momentum, velocity, time)
        force, change = system.force(place), system.change(start, place)
        steep = curvature(before, force, change, momentum, velocity, time)
        if steep > stiffest:
            stiffest = steep
            longest = 2.0 * settings.safety / math.sqrt(stiffest)
            time = min(time, longest)
    raise AssertionError("unreachable")
