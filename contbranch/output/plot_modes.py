"""Figures of azimuthal modes: gap and pressure against the radius, and the gap seen from above."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from contbranch.output.plot_view import (
    BLUE,
    GREY,
    ORANGE,
    Style,
    axis_label,
    heat_map,
    loud_radius,
    mark_rim,
    new_figure,
)
from contbranch.results.diagram import ModeShape
from contbranch.results.record import UnitNames

_FAINT = 0.03  # the mode is shown out to where its gap, or its pressure, falls below this part of its largest
_NAMED = 0.1  # a contact of at least this part of what is shown has its radius named
_AROUND = 361  # angles of the map
_RIM = 0.97  # pressures nearer to the rim, in units of its radius, do not set the scale: they have no bound


def mode_figure(shape: ModeShape, contact_radius: float = 0.0, unit_names: UnitNames | None = None) -> Figure:
    """Draw a mode: its gap ``η(r) cos mθ`` from above, and η and its pressure against the radius.

    Parameters
    ----------
    shape : ModeShape
    contact_radius : float
        Of the state, in the unit of ``shape.r``; drawn as a circle.
    unit_names : mapping, optional
        As in ``contact.units.names``.
    """
    names = unit_names or {}
    reach = _reach(shape, contact_radius)
    with new_figure(4.5) as figure:
        panels = figure.subplot_mosaic([["map"], ["gap"], ["pressure"]], height_ratios=[2.3, 1, 1])
        above, gap, pressure = (panels[name] for name in ("map", "gap", "pressure"))
        _draw_map(above, shape, contact_radius, reach)
        gap.plot(np.append(0.0, shape.r), np.append(0.0, shape.gap), color=BLUE)
        gap.set_ylabel(r"$\delta g\,/\,\max|\delta g|$")
        _draw_pressure(pressure, shape, contact_radius)
        unit = f"{names['pressure']} per {names['displacement']}" if "pressure" in names else ""
        pressure.set_ylabel(r"$\delta p\,/\,\max|\delta g|$" + (f"\n({unit})" if unit else ""))
        pressure.set_xlabel(axis_label("r", names))
        gap.tick_params(labelbottom=False)
        for axes in (gap, pressure):
            axes.axhline(0.0, color=GREY, linewidth=0.5, zorder=0)
            axes.set_xlim(0.0, reach)
        mark_rim((gap, pressure), contact_radius, contact_radius > _NAMED * reach, 1)
        figure.align_ylabels([gap, pressure])
    return figure


def _reach(shape: ModeShape, contact_radius: float) -> float:
    """Return the radius out to which there is something to see."""
    outside = shape.r > contact_radius
    reach = [loud_radius(shape.r[outside], values[outside], _FAINT) for values in (shape.gap, shape.pressure)]
    return min(1.1 * max(1.2 * contact_radius, *reach), float(shape.r[-1]))


def _draw_map(axes: Axes, shape: ModeShape, contact_radius: float, reach: float) -> None:
    theta = np.linspace(0.0, 2.0 * np.pi, _AROUND)
    r = np.append(0.0, shape.r[shape.r <= reach])[:, None]
    values = np.append(0.0, shape.gap[shape.r <= reach])[:, None] * np.cos(shape.mode * theta)
    title = rf"$\delta g = \eta(r)\,\cos\,{shape.mode if shape.mode > 1 else ''}\theta$"
    axes.set_aspect("equal")
    axes.set_axis_off()
    style: Style = {"cmap": "RdBu_r", "vmin": -1, "vmax": 1, "shading": "gouraud"}
    heat_map(axes, r * np.cos(theta), r * np.sin(theta), values, title, **style)
    if contact_radius > 0.0:
        axes.add_patch(Circle((0.0, 0.0), contact_radius, facecolor="#D9D9D9", edgecolor=GREY, linewidth=0.6))


def _draw_pressure(axes: Axes, shape: ModeShape, contact_radius: float) -> None:
    """Draw the pressure, in two parts if there is a rim, where it has no bound from inside and jumps."""
    inside = shape.r < contact_radius
    if inside.any():
        axes.plot(shape.r[inside], shape.pressure[inside], color=ORANGE, linestyle="--", label="wall")
    axes.plot(shape.r[~inside], shape.pressure[~inside], color=ORANGE, label="interaction")
    bounded = shape.pressure[~inside | (shape.r < _RIM * contact_radius)]
    low, high = min(0.0, float(bounded.min())), max(0.0, float(bounded.max()))
    margin = 0.15 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    axes.legend(loc="best")
