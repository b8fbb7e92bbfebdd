"""Maps of a state on a square cell: gap, pressure, contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import CenteredNorm, ListedColormap, Normalize
from matplotlib.figure import Figure

from contbranch.errors import InputError
from contbranch.output.plot_view import WIDTH, Style, axis_label, new_figure
from contbranch.results.diagram import State
from contbranch.results.record import UnitNames

CONTACT = ListedColormap(["#F2F2F2", "#404040"])


def cell_maps(state: State, unit_names: UnitNames | None = None) -> Figure:
    """Draw gap, pressure and contact of a state on a cell as maps, as far as there is pressure.

    Parameters
    ----------
    state : State
        Of a grid model.
    unit_names : mapping, optional
        As ``contact.units.names``.

    Raises
    ------
    InputError
        If the state has no fields on a cell.
    """
    cell, names = state.cell.shown(), dict(unit_names or {})
    share, contact = (state.cell.wall_pressure > 0.0).mean(), cell.wall_pressure > 0.0
    x, y = cell.x, cell.y
    if len(x) < 2 or len(y) < 2:
        raise InputError("state: its cell has fewer than two nodes a side to be shown")
    fields: list[tuple[str, Any, Style]] = [
        (axis_label("gap", names), cell.gap, {"cmap": "viridis", "norm": Normalize(0.0)}),
        (axis_label("pressure", names), cell.pressure, _pressure_colours(cell.pressure)),
        (f"contact: {share:.3g} of the cell", contact, {"cmap": CONTACT, "vmin": 0, "vmax": 1}),
    ]
    unit = f" ({names['radius']})" if names.get("radius") else ""
    with new_figure(2.3) as figure:
        figure.set_figwidth(2.2 * WIDTH)
        for axes, (title, field, style) in zip(figure.subplots(1, 3, sharey=True), fields, strict=True):
            shown = np.asarray(field, dtype=float)
            image = axes.pcolormesh(x, y, shown.T, shading="nearest", rasterized=True, **style)
            if field is not contact:
                tall = 0.8 * min(1.0, float(np.ptp(y) / np.ptp(x)))
                bar = figure.colorbar(image, ax=axes, shrink=tall, aspect=22 * tall, pad=0.03)
                bar.outline.set_linewidth(0.5)
                if contact.any() and not contact.all():
                    axes.contour(x, y, contact.T, levels=[0.5], colors="k", linewidths=0.5)
            axes.set(aspect="equal", xlabel=f"$x${unit}")
            axes.set_title(title, fontsize=8.5, pad=3.0)
        figure.axes[0].set_ylabel(f"$y${unit}")
    return figure


def _pressure_colours(pressure: np.ndarray[Any, Any]) -> Style:
    """A scale with white at zero where attraction and repulsion are both there."""
    if pressure.min() < 0.0 < pressure.max():
        return {"cmap": "RdBu_r", "norm": CenteredNorm()}
    return {"cmap": "magma_r" if pressure.max() > 0.0 else "magma"}
