"""What a fit tells: values, errors, which of them the data determine, jumps measured and fitted, in words, too."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

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
from contbranch.measure.minimum import LONG, Minimiser, Minimum, errors_of
from contbranch.measure.quantities import LINEAR, State
from contbranch.measure.reduced import TABOR, curve_of
from contbranch.results.diagram import Cost
from contbranch.results.fit import Correlations, Fit, FitJump
from contbranch.results.loop import Hysteresis

# Largest relative error of a value that the data determine, and the part of the length of the contact by which its
# place is to be known.
KNOWN, PLACED = 0.2, 0.3
# A model leaves less than this share of the force in contact.
ELSEWHERE = 0.1
# Where a model leaves more than the noise, values are no better known than this share of what they change by when only
# forces up to half of the largest are fitted: moduli of 29 measured curves change by 0.1 to 0.7.
HALVED = 0.25
# Relative change of the modulus over that of the depth: 3/2 by Hertz at a known contact point, as much again where that
# is free.
SHAPE = 3.0
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
    fitted[found.comparison.samples], *_ = minimiser.model(problem, found.x, found.comparison)
    contact, most = state.contact, minimiser.seen.largest * state.sensitivity
    lost = _no_such_contact(minimiser, found, jumps)
    result = Fit(
        values=values,
        errors=spreads,
        correlations=Correlations(tuple(values), covariance / np.outer(safe, safe)),
        determined=() if tied or not found.converged or lost else _known(minimiser, found, values, spreads),
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
    return replace(result, message=_message(minimiser, found, result, lost, halved or {}))


def apart(approach: Fit, retract: Fit) -> Fit:
    """Legs that are fitted each by itself as one result: the approach's, with the retraction's work of adhesion."""
    legs = {False: approach, True: retract}
    moved = {name for name in retract.values if name.startswith("work_of_adhesion") or name not in approach.values}
    names = tuple(dict.fromkeys((*approach.values, *moved)))
    values, errors = (
        {name: getattr(legs[name in moved], kind)[name] for name in names} for kind in ("values", "errors")
    )
    matrix = np.eye(len(names))  # the fits share no sample
    for back, fit in legs.items():
        places = [k for k, name in enumerate(fit.values) if (name in moved) is back]
        rows = [names.index([*fit.values][k]) for k in places]
        matrix[np.ix_(rows, rows)] = fit.correlations.matrix[np.ix_(places, places)]
    contact = retract.contact  # the approach may be that of a bare contact
    for name, value in values.items():
        known = parameters_of(contact)
        contact = known[name].contact(value) if name in known else contact
    fitted = np.where(retract.retract, retract.fitted, approach.fitted)
    return replace(
        approach,
        values=values,
        errors=errors,
        correlations=Correlations(names, matrix),
        determined=tuple(name for name in names if name in legs[name in moved].determined),
        jumps=approach.jumps + retract.jumps,
        rms=float(np.sqrt(np.nanmean((approach.force - fitted) ** 2))),
        contact=contact,
        law=retract.law,
        status="complete" if approach.status == retract.status == "complete" else "incomplete",
        leg="each",
        legs={"approach": approach, "retract": retract},
        fitted=fitted,
        residuals=approach.force - fitted,
        traced=retract.traced and partial(_loop, contact, approach.spring, float(np.max(approach.force))),
        cost=replace(approach.cost, newton=approach.cost.newton + retract.cost.newton),
        message=f"{_difference(approach, retract)} Approach: {approach.message} Retraction: {retract.message}",
    )


def _leg(minimiser: Minimiser) -> str:
    """Which legs were fitted."""
    approach, retract = (minimiser.used(back).size > 0 for back in (False, True))
    return "both" if approach and retract else "approach" if approach else "retract"


def _difference(approach: Fit, retract: Fit) -> str:
    """By how much legs differ, and what that means."""
    words = "Approach and retraction are not those of one elastic contact, and are fitted each by itself"
    if "modulus" in approach.determined and "modulus" in retract.determined:
        share = retract.values["modulus"] / approach.values["modulus"] - 1.0
        words += f"; the modulus of the retraction differs by {100 * share:+.0f} %"
    return f"{words}. Viscosity, plasticity, creep and drag do that; the modulus is that of the approach at its speed."


def _loop(contact: Contact, spring: float, largest: float) -> Hysteresis:
    """The quasi-static loop of the contact on its spring."""
    control = "displacement" if math.isinf(spring) else Spring(spring)
    if contact.interaction is not None:
        largest = max(largest, 1e-3 * contact.scales.load)
    return hysteresis(contact, control, 1e-5, max_load=largest)


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
    values = found.problem.values(found.x)
    steps = minimiser.seen.resolution / math.sqrt(12.0)  # of positions that are repeated
    depth, share = _depth(minimiser, found), 0.0
    if steps:  # as many as the drive takes in contact
        travel = depth + minimiser.seen.largest / found.problem.state(found.x).spring
        share = SHAPE * steps / depth / math.sqrt(max(travel / minimiser.seen.resolution, 1.0))
    share += minimiser.seen.adhesion / max(
        minimiser.seen.largest, minimiser.seen.noise
    )  # of which the contact has none
    least = dict.fromkeys(found.problem.names, 0.0)
    least |= {"contact_point": steps + share * depth, "modulus": share * values.get("modulus", 0.0)}
    for jump in jumps:
        seen, share = found.comparison.seen.pull_off, 0.0
        if jump.name != "pull-off" or not jump.fitted:
            continue
        if not seen or not jump.measured:
            share = float(minimiser.seen.returned)  # the contact has a jump that the curve does not show
        else:
            place = max(abs(jump.fitted["piezo"] - jump.measured["piezo"]) - seen.width, steps)
            force = abs(jump.fitted["force"] - jump.measured["force"]) - jump.measured["uncertainty"]
            beyond = math.hypot(minimiser.slope[0] * place, 0.0 if math.isnan(force) else max(force, 0.0))
            share = beyond / abs(jump.fitted["force"])
        least |= {name: share * abs(values[name]) for name in values if name.startswith("work_of_adhesion")}
    for name in {*values} - {*LINEAR[1:]}:  # of legs half of what they are apart
        other = [(0.5, fit.values[name], fit.errors[name]) for fit in alone if name in fit.determined]
        other += [(HALVED, halved[name], 0.0)] if name in halved else []
        least[name] = max([least[name], *(part * (abs(values[name] - one) - error) for part, one, error in other)])
    errors = errors_of(covariance, 1e-300)
    known = np.array([least[name] for name in found.problem.names])
    factor = np.max([errors, known, *apart], axis=0) / errors
    return covariance * np.outer(factor, factor), tied


def _no_such_contact(minimiser: Minimiser, found: Minimum, jumps: Sequence[FitJump]) -> str:
    """Why values mean nothing, if they do: much of the force in contact is left, or the contact lets go too early."""
    words = "This is not a curve of such a contact, and the values mean nothing: "
    rest, force = minimiser.misfit(found)
    if rest**2 - minimiser.seen.noise**2 > (ELSEWHERE * force) ** 2:
        closest = f"{readable(rest, 'nN')} away from the closest one, whose forces are {readable(force, 'nN')} there"
        return f"{words}in contact it is {closest}."
    place = next((jump.fitted["piezo"] for jump in jumps[-1:] if jump.fitted and not jump.measured), -math.inf)
    beyond = int(np.sum(minimiser.curve.piezo[minimiser.used(True)] < place))
    if beyond > NEIGHBOURS and not minimiser.seen.returned:
        return f"{words}it lets go before the last {beyond} samples of the retraction."
    return ""


def _depth(minimiser: Minimiser, found: Minimum) -> float:
    """The displacement of the contact under the largest load."""
    contact, largest = found.problem.state(found.x).contact, minimiser.seen.largest
    load, displacement = curve_of(contact, largest, found.problem.limit)
    pressed = slice(int(np.argmin(load)), None)
    return max(float(np.interp(largest, load[pressed], displacement[pressed])), 1e-300)


def _known(minimiser: Minimiser, found: Minimum, values: dict[str, float], errors: dict[str, float]) -> tuple[str, ...]:
    """What the data determine."""
    low, high = found.problem.bounds()
    inside = np.minimum(found.x - low, high - found.x) >= 0.05
    contact = found.problem.state(found.x).contact
    length = contact.scales.normal if contact.interaction else _depth(minimiser, found)
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


def _message(minimiser: Minimiser, found: Minimum, fit: Fit, lost: str, halved: Mapping[str, float]) -> str:
    """What the data tell, and what not."""
    values, errors, known, problem, seen = fit.values, fit.errors, fit.determined, found.problem, minimiser.seen
    tabor = problem.state(found.x).contact.tabor or 0.0
    change = halved.get("modulus", math.nan) / values.get("modulus", math.nan) - 1.0
    unknown = [
        f"{name} (± {100 * errors[name] / abs(value):.0f} %)"
        if KNOWN * abs(value) < errors[name] < 10 * abs(value)
        else name
        for name, value in values.items()
        if name not in known
    ]
    left = f"The residuals (rms {readable(fit.rms, 'nN')}) exceed the noise ({readable(seen.noise, 'nN')})"
    if fit.rms <= LONG * seen.noise:
        left = "The residuals vary slowly"
    said = {
        "There is no baseline in the data: baseline, tilt and contact point follow from the shape of the curve in "
        "contact alone.": values.get("contact_point", math.inf) < minimiser.curve.piezo[seen.used].min()
        or not (seen.begun or seen.returned),
        "The minimisation did not converge: values and errors are those of where it has come to.": not found.converged,
        lost: lost,
        f"The data determine {_listed(known)}." if known else "The data determine none of the values.": found.converged,
        f"They do not determine {_listed(unknown)}.": found.converged and unknown,
        "The pull-off fixes the product of work_of_adhesion and radius.":
            {"work_of_adhesion", "radius"} <= {*values} and not {"work_of_adhesion", "radius"} <= {*known},
        f"The range is at the end of what is tabulated: the {'DMT' if tabor < 1 else 'JKR'} limit fits.":
            problem.by_tabor and not 1.1 * TABOR[0] < tabor < TABOR[1] / 1.1,
        "Another minimum fits as well, with other values.": found.others,
        f"{left}: the model is not all there is in the curve; errors allow for that.":
            max(fit.rms, found.deviation) > LONG * seen.noise,
        f"Up to half of the largest force the modulus differs by {100 * change:+.0f} %: it depends on how deep the tip "
        "is pressed, as on a layer, on a body that yields, or with a tip of another shape.": abs(change) > KNOWN / 2,
    }  # fmt: skip
    return " ".join([*seen.notes, *(text for text, so in said.items() if so), *_disagreements(fit.jumps)])


def _disagreements(jumps: tuple[FitJump, ...]) -> Iterator[str]:
    """Sentences on jumps that are not fitted."""
    for jump in jumps:
        one, other = jump.measured, jump.fitted
        if one is None or other is None:
            where, none = ("contact fitted", "curve") if one is None else ("curve", "contact fitted")
            yield f"The {where} has a {jump.name}, the {none} has none."
            continue
        # just before a jump into contact the force is small, and steep
        behind = jump.name in ("jump-in", "squeeze-out")
        seen, had = (side["force"] + (side["step"] if behind else 0.0) for side in (one, other))
        if abs(had - seen) > max(AGREE * abs(seen), one["uncertainty"]):
            forces = f"{readable(seen, 'nN')} measured, {readable(had, 'nN')} fitted"
            yield f"The {jump.name} is not fitted well: the force {'behind' if behind else 'before'} it is {forces}."


def _change(leg: Leg, width: float) -> float:
    """Change of the force in contact within a distance from the jump out of it."""
    ends = np.interp([0.0, width], leg.above.piezo - leg.above.piezo[0], leg.above.force)
    return float(abs(ends[1] - ends[0]))


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)
