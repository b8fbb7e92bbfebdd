"""A law that its user has written is tried at a few gaps before anything is computed with it."""

from __future__ import annotations

import numpy as np

from contbranch.contact.interaction_law import Evaluated, Interaction, Response, places_of, terms_of
from contbranch.contact.interactions import INTERACTIONS
from contbranch.errors import InputError, warned

# Gaps in ranges, and the distance over which differences are taken.
GAPS = (0.0, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0)
STEP = 1e-4
# What a derivative may differ from differences, relative to itself and to the largest of all.
SHARE = 1e-4
# What f(0) may differ from 1.
UNIT = 1e-6


def check_laws(interaction: Interaction | None) -> None:
    """Check every law that is not of the package.

    Raises
    ------
    InputError
        If a law returns no three arrays of the gap's shape, or its derivatives are not those of its first value.
    Exception
        Whatever a law raises at every gap.
    """
    laws = terms_of(interaction)
    for place, law in zip(places_of(laws), laws, strict=True):
        if INTERACTIONS.get(law.name) is not type(law):
            _check(law, place)


def jumping(interaction: Interaction | None) -> str:
    """What to do about a user's law whose pressure jumps, whose edge is not followed; empty without one."""
    laws = terms_of(interaction)
    for place, law in zip(places_of(laws), laws, strict=True):
        if INTERACTIONS.get(law.name) is not type(law) and (jumps := law.jumps(1)):
            at, remedy = f"x = {jumps[0]:.6g}", "let it fall over some share of the range, or use MaugisDugdale."
            return f"{place}: the pressure of {type(law).__name__} jumps at {at}: {remedy}"
    return ""


def _check(law: Interaction, field: str) -> None:
    name = f"{field}: {type(law).__name__}"
    gaps = np.array(GAPS) * law.range
    steps = STEP * law.range * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    found, failure = [], None
    for gap in gaps:
        try:
            answer = law.evaluate(gap + steps)
        except Exception as error:  # a law may fail where the contact never comes
            failure = error
            continue
        if len(answer) != 3 or any(np.shape(value) != steps.shape for value in answer):
            shapes = ", ".join(str(np.shape(value)) for value in answer)
            raise InputError(
                f"{name}: returns arrays of shapes {shapes} for x of shape {steps.shape}; must be the same"
            )
        found.append((gap / law.range, answer))
    if failure is not None and not found:
        failure.add_note(f"{name}: shape(x) is given an array, and must return f, f' and f'', each of its shape")
        raise failure
    _check_values(law, name, found)
    _check_derivatives(law, name, found)


def _check_values(law: Interaction, name: str, found: list[tuple[float, Response]]) -> None:
    """Warn where values are not finite, or not what is documented."""
    spoiled = [x for x, answer in found if not np.isfinite([value[2] for value in answer]).all()]
    if len(spoiled) == len(found):
        raise InputError(f"{name}: is finite at none of the gaps {', '.join(map(str, GAPS))} (in ranges)")
    if spoiled:
        warned(f"{name}: is not finite at gaps of {', '.join(f'{x:g}' for x in spoiled)} ranges")
    if isinstance(law, Evaluated) or not (law.lowest_gap or (found[0][0] == 0.0 and 0.0 not in spoiled)):
        return
    place, unit = law.lowest_gap / law.range, law.net_adhesion / law.work_of_adhesion
    if abs(unit - 1.0) > UNIT:
        text = f"{name}: f({place:.3g}) is {unit:.6g}, documented as 1: so many times the work of adhesion given are"
        warned(f"{text} gained")


@np.errstate(all="ignore")  # what is not finite is told apart
def _check_derivatives(law: Interaction, name: str, found: list[tuple[float, Response]]) -> None:
    """Refuse a law of which a derivative disagrees with differences at most gaps; at some it may have a kink."""
    places = np.array([x for x, _ in found])
    # f, f' and f'' (gaps, steps): v = -Δγ f
    shapes = np.array([answer for _, answer in found], dtype=float) / -law.work_of_adhesion
    shapes = np.moveaxis(shapes, 1, 0) * (np.array([1.0, -law.range, law.range**2])[:, None, None])
    for order, words in enumerate(("f' is not the derivative of f", "f'' is not the derivative of f'")):
        values, told = shapes[order], shapes[order + 1][:, 2]
        seen = (values[:, 3] - values[:, 1]) / STEP
        finite = np.isfinite(told + seen)
        off = np.where(finite, np.abs(told - seen), 0.0)
        wrong = off > SHARE * (np.abs(told) + np.abs(told[finite]).max(initial=0.0))
        if 2 * wrong.sum() > finite.sum():
            k = int(np.argmax(off * wrong))
            text = f"at x = {places[k]:g} it is {told[k]:.6g}, and differences give {seen[k]:.6g}"
            raise InputError(f"{name}: {words}: {text}")
