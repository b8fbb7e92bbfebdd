"""What a fit tells: values, errors, which of them the data determine, jumps measured and fitted, in words, too."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from contbranch.api import hysteresis
from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.parameters import parameters_of
from contbranch.contact.units import readable
from contbranch.control import Spring
from contbranch.measure.comparison import Leg
from contbranch.measure.features import NEIGHBOURS, Features
from contbranch.measure.minimum import Minimiser, Minimum, errors_of
from contbranch.measure.quantities import LINEAR, State
from contbranch.measure.reduced import TABOR, curve_of
from contbranch.results.diagram import Cost
from contbranch.results.fit import Correlations, Fit, FitJump
from contbranch.results.loop import Hysteresis

# Largest relative error of a value that the data determine, and the part of the length of the contact by which its
# place is to be known.
KNOWN, PLACED = 0.2, 0.3
# A contact that takes a part of the spring's motion: slope in contact over the stiffness.
COMPLIANT = 0.8
# A model leaves less than this share of the force in contact.
ELSEWHERE = 0.1
# Where a model leaves more than the noise, values are no better known than this share of what they change by when only
# forces up to half of the largest are fitted: moduli of 29 measured curves change by 0.1 to 0.7.
HALVED = 0.25
# Jumps agree within this share of the force.
AGREE = 0.05


def concluded(
    minimiser: Minimiser, found: Minimum, alone: Sequence[Fit] = (), halved: Mapping[str, float] | None = None
) -> Fit:
    """The minimum as a result.

    Parameters
    ----------
    alone : sequence of Fit
        The legs, each by itself.
    halved : mapping
        The values that forces up to half of the largest give, where that was asked for.
    """
    problem = found.problem
    state, values = problem.state(found.x), problem.values(found.x)
    jumps = _jumps(minimiser, found.comparison.seen, state, *minimiser.legs(problem, state))
    covariance, tied = _covariance(minimiser, found, jumps, alone, halved or {})
    errors = errors_of(covariance)
    safe = np.where(errors > 0, errors, 1.0)
    spreads = dict(zip(values, errors.tolist(), strict=True))
    fitted = np.full(len(minimiser.curve), math.nan)
    fitted[found.comparison.samples], _, _ = minimiser.model(problem, found.x, found.comparison)
    contact, most = state.contact, minimiser.seen.largest * state.sensitivity
    result = Fit(
        values=values,
        errors=spreads,
        correlations=Correlations(tuple(values), covariance / np.outer(safe, safe)),
        determined=()
        if tied or not found.converged or _elsewhere(minimiser, found) or _late(minimiser, jumps)
        else _known(minimiser, found, values, spreads),
        jumps=jumps,
        rms=found.rms,
        noise=minimiser.seen.noise,
        contact=contact,
        law=problem.limit or next((law.name or "law" for law in terms_of(contact.interaction)), "hertz"),
        status="complete" if found.converged else "incomplete",
        message="",
        leg=_leg(minimiser),
        legs=None,
        spring=state.spring,
        piezo=minimiser.curve.piezo,
        force=minimiser.curve.force,
        fitted=fitted,
        residuals=minimiser.curve.force - fitted,
        retract=minimiser.curve.retract,
        pause=minimiser.curve.pause,
        cost=Cost(0.0, minimiser.evaluations),
        traced=None if problem.limit else partial(_loop, contact, state.spring, most),
    )
    return replace(result, message=_message(minimiser, found, result, halved or {}))


def apart(approach: Fit, retract: Fit) -> Fit:
    """Legs that are fitted each by itself as one result: the approach's, with the retraction's work of adhesion."""
    one, other = approach, retract
    moved = {name for name in other.values if name.startswith("work_of_adhesion")}
    names = tuple(dict.fromkeys((*one.values, *moved)))
    values, errors = (
        {name: pair[name in moved][name] for name in names}
        for pair in ((one.values, other.values), (one.errors, other.errors))
    )
    matrix = np.eye(len(names))
    for fit in (one, other):
        own = [name for name in fit.values if (name in moved) == (fit is other)]
        rows, places = [names.index(name) for name in own], [fit.correlations.names.index(name) for name in own]
        matrix[np.ix_(rows, rows)] = fit.correlations.matrix[np.ix_(places, places)]
    contact = one.contact
    for name in moved:
        known = parameters_of(contact)
        contact = known[name].contact(values[name]) if name in known else other.contact
    samples = {
        name: np.where(retract.retract, getattr(other, name), getattr(one, name)) for name in ("fitted", "residuals")
    }
    jumps = (*(jump for jump in one.jumps if jump.name in ("jump-in", "squeeze-out")),
             *(jump for jump in other.jumps if jump.name in ("pull-off", "wetting")))  # fmt: skip
    return replace(
        one,
        values=values,
        errors=errors,
        correlations=Correlations(names, matrix),
        determined=tuple(name for name in names if name in (other if name in moved else one).determined),
        jumps=jumps,
        rms=float(np.sqrt(np.nanmean(samples["residuals"] ** 2))),
        contact=contact,
        law=other.law,
        status="complete" if one.status == other.status == "complete" else "incomplete",
        leg="each",
        legs={"approach": one, "retract": other},
        traced=other.traced and partial(_loop, contact, one.spring, float(np.max(one.force))),
        cost=replace(one.cost, newton=one.cost.newton + other.cost.newton),
        message=f"{_difference(one, other)} Approach: {one.message} Retraction: {other.message}",
        **samples,
    )


def _difference(approach: Fit, retract: Fit) -> str:
    """By how much legs differ, and what that means."""
    words = ["Approach and retraction are not those of one elastic contact, and are fitted each by itself"]
    shared = [
        name for name in ("modulus", "contact_point") if name in approach.determined and name in retract.determined
    ]
    for name in shared:
        one, other = approach.values[name], retract.values[name]
        differs = f"{100 * (other / one - 1):+.0f} %" if name == "modulus" else readable(other - one, "nm")
        words.append(f"the {name.replace('_', ' ')} of the retraction differs by {differs}")
    return (
        "; ".join(words) + ". Viscosity, plasticity, creep or drag do that; "
        "a modulus by elastic theory is that of the approach at its speed."
    )


def _loop(contact: Contact, spring: float, largest: float) -> Hysteresis:
    """The quasi-static loop of the contact on its spring."""
    control = "displacement" if math.isinf(spring) else Spring(spring)
    if contact.interaction is not None:
        largest = max(largest, 1e-3 * contact.scales.load)
    return hysteresis(contact, control, 1e-5, max_load=largest)


def _leg(minimiser: Minimiser) -> str:
    """Which legs were fitted."""
    legs = [name for name, back in (("approach", False), ("retract", True)) if minimiser.used(back).size]
    return legs[0] if len(legs) == 1 else "both"


def _covariance(
    minimiser: Minimiser, found: Minimum, jumps: Sequence[FitJump], alone: Sequence[Fit], halved: Mapping[str, float]
) -> tuple[Array, bool]:
    """Covariance of the values, and whether it could not be had.

    No smaller than what fits as well is apart, than legs that are fitted each by itself differ, than the distance of
    positions that are repeated allows, than an adhesion that the contact does not have, and than the share by which
    force and place of the pull-off, which the work of adhesion is proportional to, are not those measured.
    """
    inverse, tied = found.inverse
    to_values = found.problem.derivatives(found.x)
    covariance = to_values @ inverse @ to_values.T
    apart = [np.abs(found.problem.numbers(x) - found.values) / math.sqrt(more) for x, more in found.near]
    state, values = found.problem.state(found.x), found.problem.values(found.x)
    least = dict.fromkeys(found.problem.names, 0.0) | {"contact_point": minimiser.seen.resolution / math.sqrt(12.0)}
    for jump in jumps:
        seen = found.comparison.seen.pull_off
        if jump.name == "pull-off" and seen and jump.measured and jump.fitted:
            steps = minimiser.seen.resolution / math.sqrt(12.0)
            place = max(abs(jump.fitted["piezo"] - jump.measured["piezo"]) - seen.width, steps)
            force = abs(jump.fitted["force"] - jump.measured["force"]) - jump.measured["uncertainty"]
            beyond = math.hypot(minimiser.slope()[0] * place, 0.0 if math.isnan(force) else max(force, 0.0))
            share = beyond / abs(jump.fitted["force"])
            least |= {name: share * abs(values[name]) for name in values if name.startswith("work_of_adhesion")}
    if minimiser.seen.adhesion and minimiser.seen.largest > 0.0:  # which the contact does not have
        share, shape = minimiser.seen.adhesion / minimiser.seen.largest, curve_of(state.contact, minimiser.seen.largest)
        least["contact_point"] = max(least["contact_point"], share * shape.displacement[-1])
        least["modulus"] = share * values.get("modulus", 0.0)
    for name in {*values} - {*LINEAR[1:]}:
        single = [fit for fit in alone if name in fit.determined]  # half of what two values are apart
        distances = [abs(values[name] - fit.values[name]) - fit.errors[name] for fit in single]
        least[name] = max([least[name], *(0.5 * one for one in distances)])
    for name in {*halved} - {*LINEAR[1:]}:
        least[name] = max(least[name], HALVED * abs(halved[name] - values[name]))
    errors = errors_of(covariance, 1e-300)
    known = np.array([least[name] for name in found.problem.names])
    factor = np.max([errors, known, *apart], axis=0) / errors
    return covariance * np.outer(factor, factor), tied


def _elsewhere(minimiser: Minimiser, found: Minimum) -> float:
    """What the model leaves of the force in contact, if that is too much for values to mean anything; otherwise 0."""
    rest, force = minimiser.misfit(found)
    rest = math.sqrt(max(rest**2 - minimiser.seen.noise**2, 0.0))
    return rest if rest > ELSEWHERE * force else 0.0


def _late(minimiser: Minimiser, jumps: tuple[FitJump, ...]) -> str:
    """What to say where a fitted jump out of contact lies many samples before the end of a retraction without one."""
    last = jumps[-1] if jumps and jumps[-1].name in ("pull-off", "wetting") else None
    if last is None or last.measured or not last.fitted or minimiser.seen.returned:
        return ""
    place, back = last.fitted["piezo"], minimiser.curve.piezo[minimiser.used(True)]
    if np.sum(back < place) <= NEIGHBOURS:
        return ""
    return (
        f"This is not a curve of such a contact: its {last.name} is at {place:.5g} nm, and this one holds down to "
        f"{back.min():.5g} nm."
    )


def _known(minimiser: Minimiser, found: Minimum, values: dict[str, float], errors: dict[str, float]) -> tuple[str, ...]:
    """What the data determine."""
    low, high = found.problem.bounds()
    inside = np.minimum(found.x - low, high - found.x) >= 0.05
    state = found.problem.state(found.x)
    length = state.contact.scales.normal
    if state.contact.interaction is None:  # as deep as it was pressed
        length = curve_of(state.contact, minimiser.seen.largest).displacement[-1]
    sure = {name: KNOWN * abs(value) for name, value in values.items()}
    sure |= {"contact_point": PLACED * length, **dict.fromkeys((*LINEAR[1:],), math.inf)}
    apart = [np.abs(found.problem.numbers(x) - found.values) > 3 * np.array([*errors.values()]) for x in found.others]
    elsewhere = np.any([np.zeros(len(values), bool), *apart], axis=0)
    return tuple(
        name
        for k, name in enumerate(values)
        if errors[name] <= sure[name] and (inside[k] or name in LINEAR) and not elsewhere[k]
    )


def _jumps(minimiser: Minimiser, seen: Features, state: State, approach: Leg, retract: Leg) -> tuple[FitJump, ...]:
    """The jumps measured and fitted, in recorded forces less the baseline."""
    place = state.line[0]
    attracts = minimiser.seen.lowest < -6 * minimiser.seen.noise
    names = ("jump-in", "pull-off") if attracts else ("squeeze-out", "wetting")
    found = []
    for back, leg, jump in ((False, approach, seen.jump_in), (True, retract, seen.pull_off)):
        if not minimiser.used(back).size:
            continue
        name, measured, fitted = names[back], None, None
        if jump is not None:
            measured = {"piezo": jump.piezo, "step": jump.step}
            line = float(state.baseline(np.array(jump.piezo), np.array(back)))
            measured["force"] = math.nan if jump.cut else jump.force - line
            measured["uncertainty"] = 4 * seen.noise + _change(leg, jump.width)
        own = leg.jump  # which is one if it was seen, or should have been
        if own is not None and (jump is not None or abs(own.step) > 8 * minimiser.seen.noise):
            gain = minimiser.gain(state)
            fitted = {"piezo": own.piezo + place, "force": gain * own.before, "step": gain * own.step}
        if measured or fitted:
            found.append(FitJump(name, measured, fitted))
    return tuple(found)


def _message(minimiser: Minimiser, found: Minimum, fit: Fit, halved: Mapping[str, float]) -> str:
    """What the data tell, and what not."""
    values, errors, matrix, known = fit.values, fit.errors, fit.correlations.matrix, fit.determined
    names, problem, words = list(values), found.problem, [*minimiser.seen.notes]
    if not (minimiser.seen.begun or minimiser.seen.returned):
        words.append(
            "There is no baseline in the data: baseline, tilt and contact point follow from the shape of the curve in "
            "contact alone."
        )
    if not found.converged:
        words.append("The minimisation did not converge: values and errors are those of where it has come to.")
    rest = _elsewhere(minimiser, found)
    if rest:
        words.append(
            f"This is not a curve of such a contact: in contact it is {readable(rest, 'nN')} away from the closest "
            f"one, whose forces are {readable(minimiser.misfit(found)[1], 'nN')} there, and the values mean nothing."
        )
    if late := _late(minimiser, fit.jumps):
        words.append(late)
    if found.converged:
        words.append(f"The data determine {_listed(known)}." if known else "The data determine none of the values.")
    for name in (name for name in names if found.converged and name not in known):
        error = abs(errors[name] / values[name]) if values[name] else math.inf
        words.append(f"They do not determine {name}{f' (± {100 * error:.0f} %)' if KNOWN < error < 10 else ''}.")
    tied = [
        f"{a} and {b} are {correlation:.2f} correlated"
        for (i, a), (j, b) in combinations(enumerate(names), 2)
        if abs(correlation := matrix[i, j]) > 0.9 and not {a, b} & {*LINEAR[1:]}
    ]
    if tied:
        listed = "; ".join(tied)
        words.append(f"{listed[0].upper()}{listed[1:]}.")
    slope, _ = minimiser.slope()
    if "sensitivity" in names and slope < COMPLIANT * minimiser.stiffness:
        words.append(
            f"Pressed most, the force rises by {slope:.3g} nN/nm, {slope / minimiser.stiffness:.2f} of "
            "the spring's stiffness: a compliant contact, or a recorded deflection that is too small. The slope "
            "alone does not tell which; here the curve's bend and its jumps have decided."
        )
    if {"work_of_adhesion", "radius"} <= set(names) and not {"work_of_adhesion", "radius"} <= set(known):
        words.append("The pull-off fixes the product of work_of_adhesion and radius.")
    if problem.by_tabor:
        tabor = problem.state(found.x).contact.tabor or 0.0
        if tabor < 1.1 * TABOR[0] or tabor > TABOR[1] / 1.1:
            words.append(
                f"The range is at the end of what is tabulated: the {'DMT' if tabor < 1 else 'JKR'} limit fits."
            )
    if found.others:
        words.append("Another minimum fits as well, with other values.")
    if fit.rms > 2 * minimiser.seen.noise:
        words.append(
            f"The residuals (rms {fit.rms:.3g} nN) exceed the noise ({minimiser.seen.noise:.3g} nN): the model is not "
            "all there is in the curve; errors allow for that."
        )
    elif found.deviation > 2 * minimiser.seen.noise:
        words.append("The residuals vary slowly: the model is not all there is in the curve; errors allow for that.")
    if abs(change := halved.get("modulus", math.nan) / values.get("modulus", math.nan) - 1.0) > KNOWN:
        words.append(
            f"Up to half of the largest force the modulus differs by {100 * change:+.0f} %: it depends on how deep the "
            "tip is pressed, as on a layer, on a body that yields, or with a tip of another shape."
        )
    return " ".join([*words, *_disagreements(fit.jumps)])


def _disagreements(jumps: tuple[FitJump, ...]) -> Iterator[str]:
    """Sentences on jumps that are not fitted."""
    for jump in jumps:
        one, other = jump.measured, jump.fitted
        if one is None or other is None:
            yield f"The {jump.name} was {'fitted but not seen' if one is None else 'seen but not fitted'}."
            continue
        # just before a jump into contact the force is small, and steep
        behind = jump.name in ("jump-in", "squeeze-out")
        seen, had = (side["force"] + (side["step"] if behind else 0.0) for side in (one, other))
        if abs(had - seen) > max(AGREE * abs(seen), one["uncertainty"]):
            where, share = "behind" if behind else "before", 100 * (had / seen - 1.0)
            yield (
                f"No such contact has the {jump.name} measured beside all else: the force {where} it is {seen:.3g} nN, "
                f"the fitted one {had:.3g} nN ({share:+.0f} %)."
            )


def _change(leg: Leg, width: float) -> float:
    """Change of the force in contact within a distance from the jump out of it."""
    ends = np.interp([0.0, width], leg.above.piezo - leg.above.piezo[0], leg.above.force)
    return float(abs(ends[1] - ends[0]))


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)
