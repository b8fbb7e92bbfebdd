"""Thresholds of a sweep: against one parameter as curves, over two of them as maps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from contbranch.arrays import Array
from contbranch.contact.units import finite_number
from contbranch.errors import InputError
from contbranch.output.plot_follow import is_logarithmic, parameter_label, scale_axis
from contbranch.output.plot_view import SERIES, cell_edges, heat_map, new_figure
from contbranch.results.sweep import Sweep
from contbranch.results.table import quantity, with_unit

_MOST = 4  # maps beside each other, in so many rows as it takes
_NONE = "#E4E4E4"
_MARKERS = "osD^vPX*"

# Values at which there is a line, by the quantity that has them.
Levels = dict[str, list[float]]


def sweep_figure(sweep: Sweep, thresholds: Sequence[str] = (), level: float | None = None) -> Figure:
    """Draw thresholds over what varies.

    Parameters
    ----------
    sweep : Sweep
        Of one parameter, or of two.
    thresholds : sequence of str, optional
        Names among `sweep.names`; default: loads at which stability is lost, otherwise whatever there is.
    level : float, optional
        Where they have this value there is a line, as far as they are what the first of them is: loads, say.

    Raises
    ------
    InputError
        For a sweep over more parameters, a name that none of its tasks has, nothing to draw, or a level over two
        parameters that are no grid.
    """
    shown = _chosen(sweep, thresholds)
    if not 1 <= len(sweep.parameters) <= 2:
        over = ", ".join(sweep.parameters) or "nothing that is a number"
        raise InputError(f"plot: the sweep varies {over}; figures show one parameter or two: write contbranch view")
    values = {name: np.array([task.thresholds.get(name, np.nan) for task in sweep.tasks]) for name in shown}
    axes = [np.array([task.parameters[name] for task in sweep.tasks]) for name in sweep.parameters]
    lines: Levels = {} if level is None else {quantity(shown[0]): [finite_number(level, "level")]}
    if lines and len(axes) == 2 and (sweep.mode != "grid" or min(sweep.shape) < 2):
        raise InputError("level: a line over two parameters takes a grid with two values of each; leave it out")
    return _curves(sweep, axes[0], values, lines) if len(axes) == 1 else _maps(sweep, axes, values, lines)


def _chosen(sweep: Sweep, thresholds: Sequence[str]) -> list[str]:
    unknown = [name for name in thresholds if name not in sweep.names]
    if unknown or not sweep.names:
        raise InputError(f"thresholds: {', '.join(unknown) or 'none'}; there are {', '.join(sweep.names) or 'none'}")
    lost = [name for name in sweep.names if name.endswith("_load") and not name.startswith("touch")]
    return list(thresholds) or [name for name in lost if "_spring_" not in name] or lost or [sweep.names[0]]


def _label(sweep: Sweep, name: str) -> str:
    return with_unit(name.replace("_", " "), sweep.unit_names.get(quantity(name), ""))


def _curves(sweep: Sweep, x: Array, values: dict[str, Array], levels: Levels) -> Figure:
    """Every threshold against the only parameter; one axis for each quantity."""
    kinds = list(dict.fromkeys(map(quantity, values)))
    order, colours = np.argsort(x), cycle(SERIES)
    with new_figure(2.5 * len(kinds)) as figure:
        panels = figure.subplots(len(kinds), 1, sharex=True, squeeze=False)[:, 0]
        for panel, kind in zip(panels, kinds, strict=True):
            own = [name for name in values if quantity(name) == kind]
            for name, marker in zip(own, cycle(_MARKERS)):
                look = {"marker": marker, "markersize": 3.5, "color": next(colours), "label": name.replace("_", " ")}
                panel.plot(x[order], values[name][order], **look)
            for level in levels.get(kind, ()):
                panel.axhline(level, color="0.4", linewidth=0.8, linestyle="--")
            panel.set_ylabel(_label(sweep, own[0] if len(own) == 1 else kind))
            if len(own) > 1:
                panel.legend()
        scale_axis(panels[-1].xaxis, x)
        panels[-1].set_xlabel(parameter_label(sweep.parameters[0], sweep.unit_names))
    return figure


def _maps(sweep: Sweep, place: Sequence[Array], values: dict[str, Array], levels: Levels) -> Figure:
    """Every threshold over both parameters: cells of a grid, otherwise points; grey where there is none."""
    across = min(len(values), _MOST)
    down = -(-len(values) // across)
    with new_figure(2.9 * down, across) as figure:
        panels = figure.subplots(down, across, sharey=True, squeeze=False).ravel()
        for panel in panels[len(values) :]:
            panel.remove()
        for panel, (name, found) in zip(panels, values.items(), strict=False):
            title = _label(sweep, name)
            title += ", grey: none" if np.sum(np.isfinite(found)) < np.prod(sweep.shape) else ""
            if sweep.mode == "grid":
                x, y = (np.array(sweep.axes[parameter]) for parameter in sweep.parameters)
                panel.set_facecolor(_NONE)
                cells = np.full(sweep.shape, np.nan)  # also of tasks that are missing
                cells.flat[[task.index for task in sweep.tasks]] = found
                cells = cells[np.argsort(x)][:, np.argsort(y)].T
                heat_map(panel, _edges(x), _edges(y), cells, title)
                if own := levels.get(quantity(name)):
                    panel.contour(np.sort(x), np.sort(y), cells, own, colors="white", linewidths=1.2)
            else:
                panel.scatter(*place, color=_NONE, s=14.0)
                figure.colorbar(panel.scatter(*place, c=found, s=14.0), ax=panel)
                panel.set_title(title)
            panel.set_xlabel(parameter_label(sweep.parameters[0], sweep.unit_names))
            for axis, along in zip((panel.xaxis, panel.yaxis), place, strict=True):
                scale_axis(axis, along)
        for panel in panels[::across]:
            panel.set_ylabel(parameter_label(sweep.parameters[1], sweep.unit_names))
    return figure


def _edges(values: Array) -> Array:
    """Edges of the cells around values, halfway between them; in ratios where the axis is logarithmic."""
    ordered = np.sort(values)
    at = np.log(ordered) if is_logarithmic(ordered) else ordered
    edges = cell_edges(at, 0.2 * (abs(at[0]) or 1.0))
    return np.exp(edges) if is_logarithmic(ordered) else edges
