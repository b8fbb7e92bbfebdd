"""From where a contact is fitted to a force curve: guesses made from the curve itself, and the contact given."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.parameters import parameters_of
from contbranch.contact.tips import Parabola
from contbranch.errors import InputError, ModelError
from contbranch.measure.minimum import Minimiser, moved
from contbranch.measure.quantities import Problem, State
from contbranch.measure.reduced import tabulated

# Tabor coefficients from which fits start, where the range is free; and factors of the modulus otherwise.
STARTS, FACTORS = (0.2, 0.8, 3.0, 12.0), (0.2, 1.0, 5.0)
# Contact points that are tried.
PLACES = 24


def guessed(minimiser: Minimiser, problem: Problem) -> State:
    """A contact made from the curve: adhesion by the pull-off, modulus by the slope where it is pressed most."""
    seen, state = minimiser.seen, problem.start
    contact, known = state.contact, parameters_of(state.contact)
    pull = max(abs(seen.lowest), 6 * seen.noise)
    if isinstance(contact.tip, Parabola):
        radius = contact.tip.radius
        if "work_of_adhesion" in problem.free:
            work = math.copysign(pull / (1.75 * math.pi * radius), known["work_of_adhesion"].value)
            contact = known["work_of_adhesion"].contact(work)
        if "modulus" in problem.free:
            contact = replace(contact, modulus=_modulus(minimiser, radius, pull))
    return replace(state, contact=contact, line=(0.0, seen.baseline, seen.tilt))


def _modulus(minimiser: Minimiser, radius: float, pull: float) -> float:
    """E² = k³/(6 F R) of a contact of stiffness k under F, by Hertz."""
    slope = min(minimiser.slope()[0], 0.95 * minimiser.stiffness) or 1e-9
    stiffness = slope / (1.0 - slope / minimiser.stiffness)
    force = max(minimiser.seen.largest, 0.0) + pull
    return math.sqrt(stiffness**3 / (6.0 * force * radius))


def starts(minimiser: Minimiser, problem: Problem) -> Iterator[Array]:
    """Vectors from which to start: around the guess, and the contact given."""
    guess, given = problem.guess or problem.start, problem.start.contact
    contact, normal = guess.contact, guess.contact.scales.normal
    contacts = [given]
    if problem.by_tabor:
        contacts += [parameters_of(contact)["range"].contact(normal / tabor) for tabor in STARTS]
    else:
        quick = "modulus" in problem.free and (given.interaction is None or tabulated(given) or problem.limit)
        contacts += [replace(contact, modulus=contact.modulus * f) for f in (FACTORS if quick else (1.0,))]
    low, high = problem.bounds()
    inside = 1e-6 * np.minimum(high - low, 1.0)
    begun: list[Array] = []
    for one in contacts:
        vector = np.clip(problem.vector(replace(guess, contact=one)), low + inside, high - inside)
        if not any(np.allclose(vector, other) for other in begun):
            begun.append(vector)
            yield _placed(minimiser, problem, vector)


def _placed(minimiser: Minimiser, problem: Problem, x: Array) -> Array:
    """A vector with the contact point where the curve is closest, tried where jumps and extreme forces agree."""
    if "contact_point" not in problem.names:
        return x
    try:
        state = problem.state(x)
        approach, retract = minimiser.legs(problem, state)
    except (ModelError, InputError):
        return x
    piezo, force = minimiser.curve.piezo, minimiser.curve.force
    measured = [(retract, minimiser.seen.pull_off), (approach, minimiser.seen.jump_in)]
    places = [jump.piezo - leg.jump.piezo for leg, jump in measured if jump and leg.jump]
    lowest = int(np.argmin(retract.force))
    deep = float(np.interp(minimiser.seen.largest, retract.force[lowest:], retract.piezo[lowest:]))
    places += [float(piezo[np.argmax(force)]) - deep, float(piezo[np.argmin(force)] - retract.piezo[lowest])]
    if not places[:-2]:  # no jump to go by
        around = state.contact.scales.normal
        places += list(np.linspace(min(places) - around, max(places) + around, PLACES))
    k, losses = problem.names.index("contact_point"), []
    comparison, (_, baseline, tilt) = minimiser.samples, state.line
    recorded = force[comparison.samples] - baseline - tilt * piezo[comparison.samples]
    for place in places:
        own = comparison.forces(approach, retract, place) / state.sensitivity
        losses.append(float(np.abs(own - recorded).sum()))
    return moved(x, k, places[int(np.argmin(losses))])
