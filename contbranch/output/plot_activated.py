"""Figure of jumps by thermal activation: barriers and distributions against what is controlled."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from contbranch.output.plot_view import BLUE, GREY, ORANGE, axis_label, handle, said, stacked, styled
from contbranch.results.activated import Activated

_COLOURS = (BLUE, ORANGE, GREY, "black")
# Barriers in units of kT that are shown, and the share of the largest probability that is.
_HIGH, _LOW = 60.0, 1e-3


def activated_figure(found: Activated) -> Figure:
    """Draw barriers in units of k T, and the distribution of each jump; the fold is where its barrier ends."""
    if not found.jumps:
        return said(found.message or "No jump.")
    with styled():
        handles = [handle(jump.name, color=_COLOURS[k % 4]) for k, jump in enumerate(found.jumps)]
        return stacked(2, lambda axes, k: (_barriers, _distributions)[k](axes, found), handles, 3)


def _seen(found: Activated) -> tuple[float, float]:
    """The range of what is controlled in which jumps happen."""
    ends = []
    for jump in found.jumps:
        likely = jump.values[jump.distribution > _LOW * jump.distribution.max()]
        ends += [float(likely.min()), float(likely.max()), jump.fold]
    room = 0.1 * max(max(ends) - min(ends), 1e-3 * abs(max(ends, key=abs)))
    return min(ends) - room, max(ends) + room


def _barriers(axes: Axes, found: Activated) -> None:
    for k, jump in enumerate(found.jumps):
        axes.plot(jump.values, jump.barriers / found.thermal_energy, color=_COLOURS[k % 4])
        axes.plot([jump.fold], [0.0], "o", color=_COLOURS[k % 4], clip_on=False)
    axes.set_ylabel(r"Barrier $\Delta H\,/\,k_B T$")
    axes.set_xlim(*_seen(found))
    axes.set_ylim(0.0, min(_HIGH, max(float(np.max(jump.barriers)) for jump in found.jumps) / found.thermal_energy))


def _distributions(axes: Axes, found: Activated) -> None:
    for k, jump in enumerate(found.jumps):
        axes.plot(jump.values, jump.distribution, color=_COLOURS[k % 4])
        axes.axvline(jump.mean, color=_COLOURS[k % 4], linestyle=":")
    unit = found.units.get(found.quantity, "")
    axes.set_xlabel(axis_label("piezo" if found.control == "spring" else found.quantity, found.units, found.contact))
    axes.set_ylabel(f"Probability density (1/{unit})" if unit else "Probability density")
    axes.set_xlim(*_seen(found))
    axes.set_ylim(bottom=0.0)
