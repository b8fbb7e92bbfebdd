"""Names of folds and the thresholds they define."""

from __future__ import annotations

import operator
from collections.abc import Sequence

import numpy as np

from contbranch.contact.interaction_law import WEAK, terms_of
from contbranch.contact.interactions import INTERACTIONS, Interaction, Layered, Tabulated
from contbranch.results.diagram import Event

__all__ = ["fold_name", "number_layers", "signs_of", "threshold_events", "thresholds"]

# Folds at which a control has a maximum along the curve, and a minimum.
MAXIMA, MINIMA = ("squeeze-out", "jump-in"), ("wetting", "pull-off")
ATTRACTIVE = (MAXIMA[1], MINIMA[1])


def fold_name(signs: tuple[bool, bool], control: str | None, load: float, lost_on_increase: bool) -> str:
    """Name of a fold at which a stable part ends.

    Attraction: ``jump-in`` when stability is lost on approach, ``pull-off`` on retraction; repulsion: ``squeeze-out``
    when it
    is lost on increasing the control, ``wetting`` on decreasing it. Where both signs occur, the sign of the load
    decides (jump-in exists under displacement control only: under load control it would lie at infinite separation).

    Parameters
    ----------
    signs : (bool, bool)
        `signs_of` the interaction.
    lost_on_increase : bool
        Whether the stable part lies at smaller values of the control.
    """
    attracts, repels = signs
    if attracts and repels:
        attracts = load < 0 and not (control == "load" and lost_on_increase)
    return (MAXIMA if lost_on_increase else MINIMA)[attracts]


def signs_of(interaction: Interaction | None) -> tuple[bool, bool]:
    """Whether an interaction attracts, and whether it repels, at some gap each; of layers it does both.

    Tables and laws of the user's may change sign: their energies are looked at, but for a hundredth of the largest.
    """
    energies = [0.0]
    for term in terms_of(interaction):
        if isinstance(term, Layered):
            return True, True
        energies.append(-term.work_of_adhesion)
        if isinstance(term, Tabulated) or type(term) is not INTERACTIONS.get(term.name):
            found = np.nan_to_num(term.sampled_energies[1])
            energies[-1:] = found[np.abs(found) > WEAK * np.abs(found).max()].tolist()
            energies += [-term.net_adhesion] if term.lowest_gap else []  # however high its core is
    return min(energies) < 0.0, max(energies) > 0.0


def number_layers(
    names: Sequence[str | None], controls: Sequence[str | None], interaction: Interaction | None
) -> list[str | None]:
    """Names of a cascade of layers numbered from the wall: ``squeeze-out-1``, …; other names as they are.

    The curve comes from far away, so the last fold is closest to the wall. Along it every layer has a maximum of the
    load and then one of the displacement, a minimum of the displacement and then one of the load, the inner two only
    where displacement control is unstable, too: they bear the number of the load's. Maxima (``squeeze-out``,
    ``jump-in``) and minima (``wetting`` or, where the load is negative, ``pull-off``) are counted apart.
    """
    numbered = list(names)
    if not any(isinstance(term, Layered) for term in terms_of(interaction)):
        return numbered
    groups = {group: [k for k, name in enumerate(names) if name in group] for group in (MAXIMA, MINIMA)}
    by_load = {group: [k for k in members if controls[k] == "load"] for group, members in groups.items()}
    counts = [sum(controls[k] == c for k in members) for members in groups.values() for c in set(controls)]
    if max(counts, default=0) < 2:
        return numbered
    for group, members in groups.items():
        layers = {k: number for number, k in enumerate(reversed(by_load[group]), start=1)}
        alone = {k: number for number, k in enumerate(reversed(members), start=1)}
        for k in members:
            if k in layers:
                number = layers[k]
            elif not layers:
                number = alone[k]
            else:
                side = [j for j in layers if (j < k) == (group is MAXIMA)]
                number = layers[min(side or layers, key=lambda j, k=k: abs(j - k))]
            numbered[k] = f"{names[k]}-{number}"
    return numbered


def thresholds(events: Sequence[Event], repulsive: bool) -> dict[str, float]:
    """Named loads, displacements and radii of a diagram's events; no key for what does not exist."""
    return {name: getattr(event, key) for name, (event, key) in threshold_events(events, repulsive).items()}


def threshold_events(events: Sequence[Event], repulsive: bool) -> dict[str, tuple[Event, str]]:
    """Named loads, displacements and radii: the event and its quantity by the threshold's name, where it exists.

    Of several folds with one name the outermost counts: the lowest for pull-off, jump-in and wetting, the highest for
    squeeze-out. A repulsion without folds squeezes out continuously, at first touch. Folds of a spring have both a load
    and a displacement.
    """
    found: dict[str, tuple[Event, str]] = {}
    outer = {"load": ("pull-off", "squeeze-out", "wetting"), "displacement": ATTRACTIVE, "spring": MAXIMA + MINIMA}
    for control, with_radius in outer.items():
        for name in ("pull-off", "jump-in", "squeeze-out", "wetting"):
            named = [e for e in events if e.kind == "fold" and e.control == control and _base(e.name) == name]
            if not named or (name == "jump-in" and control == "load"):
                continue
            key, spring = name.replace("-", "_"), control == "spring"
            quantity = "displacement" if spring else control
            outermost = (max if name == "squeeze-out" else min)(named, key=operator.attrgetter(quantity))
            if spring:
                key += "_spring"
                found[f"{key}_load"] = outermost, "load"
            found[f"{key}_{quantity}"] = outermost, quantity
            if outermost.contact_radius > 0 and name in with_radius:
                radius = "displacement_radius" if control == "displacement" else "radius"
                found[f"{key}_{radius}"] = outermost, "contact_radius"
    touches = [e for e in events if e.kind == "touch"]
    if touches:
        found["touch_load"], found["touch_displacement"] = (touches[0], "load"), (touches[0], "displacement")
        for control in ("load", "displacement") if repulsive else ():
            if not any(e.kind == "fold" and e.control == control for e in events):
                for name in ("squeeze_out", "wetting"):
                    found[f"{name}_{control}"] = found[f"touch_{control}"]
    return found


def _base(name: str | None) -> str | None:
    """A fold's name without the number of its layer."""
    return name.rstrip("0123456789").rstrip("-") if name else None
