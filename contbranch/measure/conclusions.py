"""What a fit tells: values, errors, which of them the data determine, jumps measured and fitted, in words, too."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from contbranch.api import hysteresis
from contbranch.arrays import Array
from contbranch.contact.interaction_law import terms_of
from contbranch.control import Spring
from contbranch.measure.comparison import Leg
from contbranch.measure.features import BESIDE, Features
from contbranch.measure.minimum import Minimiser, Minimum, errors_of
from contbranch.measure.quantities import LINE, State
from contbranch.measure.reduced import TABOR, curve_of
from contbranch.results.diagram import Cost
from contbranch.results.fit import Correlations, Fit, FitJump

# Largest relative error of a value that the data determine, and the part of the length of the contact by which its
# place is to be known.
KNOWN, PLACED = 0.2, 0.3
# A contact that takes a part of the spring's motion: slope in contact over the stiffness.
COMPLIANT = 0.8
# Residuals beside the noise that are larger than this share of the pull-off, or of a fifth of the largest force.
ELSEWHERE = 0.1
# Jumps agree within this share of the force.
AGREE = 0.05


def concluded(minimiser: Minimiser, found: Minimum) -> Fit:
    """The minimum as a result."""
    problem = found.problem
    state, values = problem.state(found.x), problem.values(found.x)
    covariance, tied = _covariance(minimiser, found)
    errors = errors_of(covariance)
    safe = np.where(errors > 0, errors, 1.0)
    spreads = dict(zip(values, errors.tolist(), strict=True))
    fitted = np.full(len(minimiser.curve), math.nan)
    fitted[found.comparison.samples], _ = minimiser.model(problem, found.x, found.comparison)
    contact = state.contact
    control = "displacement" if math.isinf(state.spring) else Spring(state.spring)
    most = minimiser.seen.largest * state.sensitivity
    if contact.interaction is not None:
        most = max(most, 1e-3 * contact.scales.load)
    jumps = _jumps(minimiser, found.comparison.seen, state, *minimiser.legs(problem, state))
    result = Fit(
        values=values,
        errors=spreads,
        correlations=Correlations(tuple(values), covariance / np.outer(safe, safe)),
        identifiable=()
        if tied or not found.converged or _elsewhere(minimiser, found) or _late(minimiser, jumps)
        else _known(minimiser, found, values, spreads),
        jumps=jumps,
        rms=found.rms,
        noise=minimiser.seen.noise,
        contact=contact,
        law=problem.limit or next((law.name or "law" for law in terms_of(contact.interaction)), "hertz"),
        status="complete" if found.converged else "incomplete",
        message="",
        spring=state.spring,
        piezo=minimiser.curve.piezo,
        force=minimiser.curve.force,
        fitted=fitted,
        residuals=minimiser.curve.force - fitted,
        retract=minimiser.curve.retract,
        cost=Cost(0.0, 0),
        traced=None if problem.limit else lambda: hysteresis(contact, control, 1e-5, max_load=most),
    )
    return replace(result, message=_message(minimiser, found, result))


def _covariance(minimiser: Minimiser, found: Minimum) -> tuple[Array, bool]:
    """Covariance of the values, no smaller than what fits as well is apart, and whether it could not be had."""
    inverse, tied = minimiser.inverse(found)
    to_values = found.problem.derivatives(found.x)
    covariance = to_values @ inverse @ to_values.T
    apart = [np.abs(found.problem.numbers(x) - found.values) / math.sqrt(more) for x, more in found.near]
    errors = errors_of(covariance, 1e-300)
    factor = np.max([errors, *apart], axis=0) / errors
    return covariance * np.outer(factor, factor), tied


def _elsewhere(minimiser: Minimiser, found: Minimum) -> float:
    """What the model leaves of the curve, if that is too much for its values to mean anything; otherwise 0."""
    rest = math.sqrt(max(found.rms**2 - minimiser.seen.noise**2, 0.0))
    return rest if rest > ELSEWHERE * max(-minimiser.seen.lowest, 0.2 * minimiser.seen.largest) else 0.0


def _late(minimiser: Minimiser, jumps: tuple[FitJump, ...]) -> str:
    """What to say where a fitted jump out of contact lies many samples before the end of a retraction without one."""
    last = jumps[-1] if jumps and jumps[-1].name in ("pull-off", "wetting") else None
    if last is None or last.measured or not last.fitted or minimiser.seen.returned:
        return ""
    place, back = last.fitted["piezo"], minimiser.curve.piezo[minimiser.curve.leg(True)]
    if np.sum(back < place) <= BESIDE:
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
    sure |= {"contact_point": PLACED * length, "baseline": math.inf, "tilt": math.inf}
    apart = [np.abs(found.problem.numbers(x) - found.values) > 3 * np.array([*errors.values()]) for x in found.others]
    elsewhere = np.any([np.zeros(len(values), bool), *apart], axis=0)
    return tuple(
        name
        for k, name in enumerate(values)
        if errors[name] <= sure[name] and (inside[k] or name in LINE) and not elsewhere[k]
    )


def _jumps(minimiser: Minimiser, seen: Features, state: State, approach: Leg, retract: Leg) -> tuple[FitJump, ...]:
    """The jumps measured and fitted, in recorded forces less the baseline."""
    place, baseline, tilt = state.line
    attracts = minimiser.seen.lowest < -6 * minimiser.seen.noise
    names = ("jump-in", "pull-off") if attracts else ("squeeze-out", "wetting")
    found = []
    for name, leg, jump in ((names[0], approach, seen.jump_in), (names[1], retract, seen.pull_off)):
        measured = fitted = None
        if jump is not None:
            measured = {"piezo": jump.piezo, "force": jump.force - baseline - tilt * jump.piezo, "step": jump.step}
            measured["uncertainty"] = 4 * seen.noise + _change(leg, jump.width)
        own = leg.jump  # which is one if it was seen, or should have been
        if own is not None and (jump is not None or abs(own.step) > 8 * minimiser.seen.noise):
            gain = minimiser.gain(state)
            fitted = {"piezo": own.piezo + place, "force": gain * own.before, "step": gain * own.step}
        if measured or fitted:
            found.append(FitJump(name, measured, fitted))
    return tuple(found)


def _message(minimiser: Minimiser, found: Minimum, fit: Fit) -> str:
    """What the data tell, and what not."""
    values, errors, matrix, known = fit.values, fit.errors, fit.correlations.matrix, fit.identifiable
    names, problem, words = list(values), found.problem, []
    if not found.converged:
        words.append("The minimisation did not converge: values and errors are those of where it has come to.")
    rest = _elsewhere(minimiser, found)
    if rest:
        words.append(
            f"This is not a curve of such a contact: it is {rest:.3g} nN away from the closest one (pull-off "
            f"{-minimiser.seen.lowest:.3g} nN), and the values mean nothing."
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
        if abs(correlation := matrix[i, j]) > 0.9 and not {a, b} & {"baseline", "tilt"}
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
    elif minimiser.spread(found) > 2 * minimiser.seen.noise:
        words.append("The residuals vary slowly: the model is not all there is in the curve; errors allow for that.")
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
    ends = np.interp([0.0, width], leg.part(True)[0] - leg.part(True)[0][0], leg.part(True)[1])
    return float(abs(ends[1] - ends[0]))


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)
