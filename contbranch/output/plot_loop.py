"""Figure of a hysteresis loop: the two ways of the quasi-static path, with arrows, and its jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contbranch.output.plot_view import (
    BLUE,
    ORANGE,
    arrange_panels,
    axis_label,
    handle,
    has_natural_units,
    new_figure,
)
from contbranch.output.smooth import smooth_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from contbranch.results.loop import Hysteresis, Jump

__all__ = ["loop_figure"]

Array = NDArray[np.float64]

_UP, _DOWN = BLUE, ORANGE
_PAD = 0.6  # of the extent of the jumps, shown on either side of them


def loop_figure(loop: Hysteresis) -> Figure:
    """Draw load (under load control the displacement) and contact radius against what is controlled.

    The way up and the way down differ in colour; jumps are dotted, with an arrow.
    """
    first = "displacement" if loop.control == "load" else "load"
    with new_figure(4.9, None) as figure:
        if len(loop.path) < 2:
            figure.text(0.5, 0.5, loop.message or "No path.", ha="center", va="center", wrap=True)
            return figure
        panels = list(figure.subplots(2, 1))
        names = loop.contact.units.names if loop.contact is not None else {}
        natural = loop.contact is not None and has_natural_units(loop.contact)
        for axes, name, letter in zip(panels, (first, "contact_radius"), "ab", strict=True):
            _draw(axes, loop, name)
            axes.set_ylabel(axis_label(name, names, natural))
            axes.set_xlabel(_position_label(loop, names, natural))
            axes.set_title(f"({letter})", loc="left", fontsize=8.5, pad=4.0, y=1.0)
        handles = [
            handle("approach" if loop.control != "load" else "loading", color=_UP),
            handle("retraction" if loop.control != "load" else "unloading", color=_DOWN),
        ]
        if loop.jumps:
            handles.append(handle("jump", color="black", linestyle=":"))
        figure.legend(handles=handles, loc="upper center", ncols=3, bbox_to_anchor=(0.5, 1.0), borderaxespad=0.2)
        arrange_panels(figure, panels, rows=1)
    return figure


def _position_label(loop: Hysteresis, names: dict[str, str], natural: bool) -> str:
    if loop.control != "spring":
        return axis_label(loop.control, names, natural)
    label = axis_label("displacement", names, natural)
    unit = f" ({names['displacement']})" if names else label.partition(r"\,/\,")[2].rstrip("$")
    if names:
        return f"Position of the spring $d + F_N/K${unit}"
    return f"$(d + F_N/K)\\,/\\,{unit}$" if unit else "Position of the spring $d + F_N/K$"


def _draw(axes: Axes, loop: Hysteresis, name: str) -> None:
    path = loop.path
    limits = _window(loop)
    shown: list[Array] = []
    for number in np.unique(path.leg):
        here = path.leg == number
        if np.count_nonzero(here) < 2:
            continue
        x, y = smooth_path(path.position[here], path[name][here])
        up = path.direction[here][0] > 0
        axes.plot(x, y, color=_UP if up else _DOWN, linewidth=1.6 if up else 1.1, zorder=2.0 if up else 2.5)
        inside = (x >= limits[0]) & (x <= limits[1])
        shown.append(y[inside])
        _arrow(axes, x[inside], y[inside], _UP if up else _DOWN)
    for jump in loop.jumps:
        shown.append(np.array([getattr(s, name) for s in (jump.start, jump.to) if s is not None]))
        _draw_jump(axes, jump, name)
    values = np.concatenate(shown)
    if values.size:
        margin = 0.07 * (np.ptp(values) or 1.0)
        axes.set_ylim(float(values.min()) - margin, float(values.max()) + margin)
    axes.set_xlim(*limits)


def _window(loop: Hysteresis) -> tuple[float, float]:
    """The jumps with some context; without jumps, the whole path."""
    position = loop.path.position
    low, high = float(position.min()), float(position.max())
    at = [jump.position for jump in loop.jumps]
    if not at:
        return low, high
    pad = _PAD * (max(at) - min(at)) if len(at) > 1 else 0.3 * (high - low)
    pad = max(pad, 0.02 * max(abs(value) for value in at))
    # A jump may be where the path ends: some room beside it all the same.
    first = min(max(low, min(at) - pad), min(at) - 0.1 * pad) if len(at) > 1 else min(low, at[0] - 0.3 * pad)
    return first, min(high, max(at) + pad)


def _arrow(axes: Axes, x: Array, y: Array, color: str) -> None:
    """An arrow head in the middle of a leg."""
    if len(x) < 3:
        return
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x) / np.ptp(x), np.diff(y) / (np.ptp(y) or 1.0)))])
    k = int(np.clip(np.searchsorted(length, 0.55 * length[-1]), 1, len(x) - 1))
    style = {"arrowstyle": "-|>", "color": color, "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 0.0}
    axes.annotate("", (x[k], y[k]), (x[k - 1], y[k - 1]), arrowprops=style)


def _draw_jump(axes: Axes, jump: Jump, name: str) -> None:
    """A dotted line with an arrow from the fold to where the jump ends, or a mark where it ends nowhere."""
    start = getattr(jump.start, name)
    axes.plot(jump.position, start, marker="o", markersize=3.5, color="black", zorder=4.0)
    if jump.to is None:
        axes.annotate("to infinity", (jump.position, start), (4.0, 8.0), textcoords="offset points", fontsize=7.0)
        return
    end = getattr(jump.to, name)
    style = {"arrowstyle": "-|>", "linestyle": ":", "color": "black", "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 0.9}
    axes.annotate("", (jump.position, end), (jump.position, start), arrowprops=style, zorder=4.0)
