"""Names of folds and the thresholds they define."""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Sequence

import numpy as np

from contbranch.contact.interaction_law import WEAK, terms_of
from contbranch.contact.interactions import Interaction, Layered
from contbranch.results.diagram import Event

__all__ = ["fold_name", "number_layers", "signs_of", "threshold_events"]

# Folds at which a control has a maximum along the curve, and a minimum.
MAXIMA, MINIMA = ("squeeze-out", "jump-in"), ("wetting", "pull-off")
ATTRACTIVE = (MAXIMA[1], MINIMA[1])
NAMES = ("pull-off", "jump-in", "squeeze-out", "wetting")
# Thresholds by the control whose folds they are: the end of the name, and the quantity.
THRESHOLDS = {
    "load": {"load": "load", "radius": "contact_radius"},
    "displacement": {"displacement": "displacement", "displacement_radius": "contact_radius"},
    "spring": {"spring_load": "load", "spring_displacement": "displacement", "spring_radius": "contact_radius"},
}


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

    Energies are looked at, but for a hundredth of the largest.
    """
    energies = [0.0]
    for term in terms_of(interaction):
        if isinstance(term, Layered):
            return True, True
        found = np.nan_to_num(term.sampled_energies[1])
        energies += found[np.abs(found) > WEAK * np.abs(found).max()].tolist()
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
    groups = {k: MAXIMA if name in MAXIMA else MINIMA for k, name in enumerate(names) if name in MAXIMA + MINIMA}
    most = max(Counter((group, controls[k]) for k, group in groups.items()).values(), default=0)
    numbered = list(names)
    if most < 2 or not any(isinstance(term, Layered) for term in terms_of(interaction)):
        return numbered
    for k, group in groups.items():
        alike = [j for j in groups if groups[j] is group]
        layers = [j for j in alike if controls[j] == "load"] or alike
        number = sum(j > k for j in layers) + (group is MAXIMA or k in layers)
        numbered[k] = f"{names[k]}-{min(max(number, 1), len(layers))}"
    return numbered


def tell_apart(
    names: Sequence[str | None], controls: Sequence[str | None], values: Sequence[tuple[float, float]]
) -> list[str | None]:
    """Names of folds of which several are alike: the outermost has the name, others a number, ``pull-off-2``, ….

    `values` are the loads and displacements. Outermost is the one that counts as threshold.
    """
    found = list(names)
    for name, control in {(name, control) for name, control in zip(names, controls, strict=True) if name in NAMES}:
        alike = [k for k, pair in enumerate(zip(names, controls, strict=True)) if pair == (name, control)]
        alike.sort(key=lambda k: values[k][control != "load"], reverse=name == "squeeze-out")
        for number, k in enumerate(alike[1:], start=2):
            found[k] = f"{name}-{number}"
    return found


def threshold_events(events: Sequence[Event], repulsive: bool) -> dict[str, tuple[Event, str]]:
    """Named loads, displacements and radii: the event and its quantity by the threshold's name, where it exists.

    Of several folds with one name the outermost counts: the lowest for pull-off, jump-in and wetting, the highest for
    squeeze-out. A repulsion without folds squeezes out continuously, at first touch. Folds of a spring have both a load
    and a displacement.
    """
    found: dict[str, tuple[Event, str]] = {}
    folds = [event for event in events if event.kind == "fold" and event.name]
    for control, quantities in THRESHOLDS.items():
        for name in NAMES:
            named = [e for e in folds if e.control == control and e.name and e.name.rstrip("-0123456789") == name]
            if not named or (control == "load" and name == "jump-in"):
                continue
            held = operator.attrgetter("load" if control == "load" else "displacement")
            event = max(named, key=held) if name == "squeeze-out" else min(named, key=held)
            touching = event.contact_radius > 0 and (control != "displacement" or name in ATTRACTIVE)
            for suffix, quantity in quantities.items():
                if touching or quantity != "contact_radius":
                    found[f"{name.replace('-', '_')}_{suffix}"] = event, quantity
    touch = next((event for event in events if event.kind == "touch"), None)
    if touch is not None:
        controls = ("load", "displacement")
        found |= {f"touch_{control}": (touch, control) for control in controls}
        folded = {event.control for event in events if event.kind == "fold"}
        continuous = [control for control in controls if repulsive and control not in folded]
        found |= {
            f"{name}_{control}": (touch, control) for control in continuous for name in ("squeeze_out", "wetting")
        }
    return found
