"""Maps of a state on a square cell: gap, pressure, contact."""

from __future__ import annotations

import math

from matplotlib.colors import CenteredNorm, ListedColormap, Normalize
from matplotlib.figure import Figure

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.output.plot_view import Style, axis_label, heat_map, new_figure
from contbranch.results.diagram import State
from contbranch.results.record import UnitNames
from contbranch.results.table import with_unit

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
    contact, unit = cell.wall_pressure > 0.0, names.get("radius", "")
    area = f"{math.pi * state.contact_radius**2:.4g}{unit and f' {unit}²'}"  # by parts of nodes, as results have it
    x, y = cell.x, cell.y
    if len(x) < 2 or len(y) < 2:
        raise InputError("state: its cell has fewer than two nodes a side to be shown")
    fields: list[tuple[str, Array, Style]] = [
        (axis_label("gap", names), cell.gap, {"cmap": "viridis", "norm": Normalize(0.0)}),
        (axis_label("pressure", names), cell.pressure, _pressure_colours(cell.pressure)),
        (f"contact: area {area}", contact.astype(float), {"cmap": CONTACT, "bar": False}),
    ]
    with new_figure(2.3, 2.2) as figure:
        panels = figure.subplots(1, 3, sharey=True)
        for axes, (title, field, style) in zip(panels, fields, strict=True):
            axes.set(aspect="equal", xlabel=with_unit("$x$", unit))
            heat_map(axes, x, y, field.T, title, shading="nearest", **style)
            if contact.any() and not contact.all():
                axes.contour(x, y, contact.T, levels=[0.5], colors="k", linewidths=0.5)
        panels[0].set_ylabel(with_unit("$y$", unit))
    return figure


def _pressure_colours(pressure: Array) -> Style:
    """A scale with white at zero where attraction and repulsion are both there."""
    if pressure.min() < 0.0 < pressure.max():
        return {"cmap": "RdBu_r", "norm": CenteredNorm()}
    return {"cmap": "magma_r" if pressure.max() > 0.0 else "magma"}
