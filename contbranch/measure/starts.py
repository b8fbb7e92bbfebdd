"""From where a contact is fitted to a force curve: guesses made from the curve itself, and the contact given."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.parameters import parameters_of
from contbranch.contact.tips import Parabola
from contbranch.errors import InputError, ModelError
from contbranch.measure.minimum import Minimiser, moved
from contbranch.measure.quantities import Problem, State
from contbranch.measure.reduced import bare_curve, tabulated

# Tabor coefficients from which fits start, where the range is free; and factors of the modulus otherwise.
STARTS, FACTORS = (0.2, 0.8, 3.0, 12.0), (0.2, 1.0, 5.0)
# Contact points that are tried; of contacts without an interaction, over all positions, with so many samples.
PLACES, SAMPLES = 64, 256
# Minima of such a scan that are looked at more closely, and followed if their sum of squares is within this factor.
TRIED, WITHIN = 4, 3.0


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
    return replace(state, contact=contact, line=(0.0, *seen.lines[0]), retracted=seen.lines[1])


def _modulus(minimiser: Minimiser, radius: float, pull: float) -> float:
    """E² = k³/(6 F R) of a contact of stiffness k under F, by Hertz."""
    slope = min(minimiser.slope[0], 0.95 * minimiser.stiffness) or 1e-9
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
        quick = "modulus" in problem.free and (tabulated(given) or problem.limit)
        contacts += [replace(contact, modulus=contact.modulus * f) for f in (FACTORS if quick else (1.0,))]
    low, high = problem.bounds()
    inside = 1e-6 * np.minimum(high - low, 1.0)
    begun: list[Array] = []
    for one in contacts:
        vector = np.clip(problem.vector(replace(guess, contact=one)), low + inside, high - inside)
        if not any(np.allclose(vector, other) for other in begun):
            begun.append(vector)
            yield _placed(minimiser, problem, vector)


def scanned(minimiser: Minimiser, problem: Problem) -> list[State]:
    """States of a contact without an interaction where the sum of squares is least along the contact point.

    At a contact point the load is F(δ) = E f(δ), with the indentation δ = z − F/K of the recorded force: modulus,
    baseline and tilt are linear, and what they leave is projected out (G. H. Golub, V. Pereyra 1973).
    """
    curve, start = minimiser.curve, problem.start
    samples = np.sort(minimiser.samples.samples)
    samples = samples[:: max(1, samples.size // SAMPLES)]
    piezo, measured, gain = curve.piezo[samples], curve.force[samples], minimiser.gain(start)
    lines = np.array(minimiser.seen.lines)[curve.retract[samples].astype(int)]
    depth = piezo - (measured - lines[:, 0] - lines[:, 1] * piezo) / gain / start.spring
    shape = bare_curve(start.contact.axisymmetric_tip, _largest(start.contact, 2.0 * float(np.ptp(depth))))
    based = minimiser.seen.begun or minimiser.seen.returned  # otherwise the noise in F/K makes up a tilt
    columns = {
        name: column for name, column in minimiser.columns(problem, samples).items() if based or "tilt" not in name
    }
    straight = np.array([*columns.values()]).T if columns else np.zeros((samples.size, 0))
    base, _ = np.linalg.qr(straight)
    rest = measured - base @ (base.T @ measured)

    def left(places: Array) -> tuple[Array, Array]:
        """Sums of squares and moduli at contact points."""
        shapes = gain * np.interp(depth - places[:, None], shape.displacement, shape.load)
        across = shapes - (shapes @ base) @ base.T
        moduli = across @ rest / np.maximum((across**2).sum(axis=1), 1e-300)
        if "modulus" not in problem.free:
            moduli[:] = start.contact.modulus
        return np.where(moduli > 0, ((rest - moduli[:, None] * across) ** 2).sum(axis=1), math.inf), moduli

    first = depth.min() - (0.0 if based else np.ptp(depth))  # it may lie before the data begin
    places = np.linspace(first, depth.max(), PLACES, endpoint=False)
    losses, _ = left(places)
    around = np.concatenate([[math.inf], losses, [math.inf]])
    minima = np.flatnonzero((losses <= around[:-2]) & (losses < around[2:]))
    least: list[tuple[float, float, float]] = []
    for k in minima[np.argsort(losses[minima])][:TRIED]:
        near = places[k] + (places[1] - places[0]) * np.linspace(-1.0, 1.0, PLACES // 4)
        losses, moduli = left(near)
        j = int(np.argmin(losses))
        least.append((float(losses[j]), float(near[j]), float(moduli[j])))
    found = []
    for loss, place, modulus in sorted(least):
        if loss > WITHIN * min(least)[0]:
            break
        load = modulus * gain * np.interp(depth - place, shape.displacement, shape.load)
        solved = np.linalg.lstsq(straight, measured - load, rcond=None)[0]
        own = dict(zip(columns, solved.tolist(), strict=True))
        height, tilt = own.get("baseline", 0.0), own.get("tilt", 0.0)
        back = own.get("baseline_retract", height), own.get("tilt_retract", tilt)
        (height, tilt), back = ((b - t * problem.middle, t) for b, t in ((height, tilt), back))
        contact = replace(start.contact, modulus=modulus)
        found.append(replace(start, contact=contact, line=(place, height, tilt), retracted=back))
    return found


def _largest(contact: Contact, depth: float) -> float:
    """A load over the modulus at which the indentation is at least so deep, or the tip ends."""
    tip, largest = contact.axisymmetric_tip, 1.0
    while (found := bare_curve(tip, largest)).displacement[-1] < depth and found.load[-1] >= largest:
        largest *= 10.0
    return largest


def _placed(minimiser: Minimiser, problem: Problem, x: Array) -> Array:
    """A vector with the contact point where the curve is closest, tried where jumps and extreme forces agree."""
    if "contact_point" not in problem.names:
        return x
    try:
        state = problem.state(x)
        approach, retract = minimiser.legs(problem, state)
    except (ModelError, InputError):
        return x
    comparison = minimiser.samples
    samples = comparison.samples
    piezo, force, way = minimiser.curve.piezo[samples], minimiser.curve.force[samples], retract.whole
    measured = [(retract, minimiser.seen.pull_off), (approach, minimiser.seen.jump_in)]
    places = [jump.piezo - leg.jump.piezo for leg, jump in measured if jump and leg.jump]
    lowest = int(np.argmin(way.force))
    deep = float(np.interp(minimiser.seen.largest, way.force[lowest:], way.piezo[lowest:]))
    places += [float(piezo[np.argmax(force)]) - deep, float(piezo[np.argmin(force)] - way.piezo[lowest])]
    if not places[:-2]:  # no jump to go by
        around = state.contact.scales.normal
        places += list(np.linspace(min(places) - around, max(places) + around, PLACES))
    k, losses = problem.names.index("contact_point"), []
    recorded = force - state.baseline(piezo, minimiser.curve.retract[samples])
    for place in places:
        own = comparison.forces(approach, retract, place)[0] * minimiser.gain(state)
        losses.append(float(np.abs(own - recorded).sum()))
    return moved(x, k, places[int(np.argmin(losses))])
