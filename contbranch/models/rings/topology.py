"""What a change of the contact set is called."""

from __future__ import annotations

from .constraints import Breach
from .equations import RingEquations

__all__ = ["change"]

CONE = "The Morse indices there are those of both sides: admissible variations form a cone."


def change(problem: RingEquations, breach: Breach, growing: bool) -> tuple[str, str]:
    """The kind of an event at which a region is born (or, not growing, vanishes), and a sentence.

    Parameters
    ----------
    problem : RingEquations
        With the layout without that region.
    breach : Breach
        Where it lies.
    growing : bool
    """
    new, around = breach.new, problem.layout.regions[breach.region]
    if not (new.rests or around.rests):  # the edge of the interaction's range comes to that of the tip
        return "", ""
    centre = breach.radius == 0.0
    place = "at the centre" if centre else f"on a ring of radius {breach.radius:.6g} (reduced)"
    level = (new if new.rests else around).index
    where = "the wall" if level == 0 else f"a gap of {problem.law.levels[level]:.6g} (reduced)"
    if new.rests:
        verb, shape = "comes to rest at" if growing else "leaves", ""
        alone = not any(region.rests and region.index == 0 for region in problem.layout.regions)
        kind = "touch" if level == 0 and centre and alone else "topology"
    else:
        verb, kind = "lifts from" if growing else "comes to rest at", "topology"
        opens = ("a disc opens into a ring", "an annulus opens")
        closes = ("a ring closes to a disc", "an annulus closes")
        shape = f": {(opens if growing else closes)[0 if centre else 1]}"
    sentence = f"The surface {verb} {where} {place}{shape}."
    return kind, sentence if kind == "touch" else f"{sentence} {CONE}"
