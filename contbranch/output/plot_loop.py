"""Figure of a hysteresis loop: the two ways of the quasi-static path, with arrows, and its jumps."""

from __future__ import annotations

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from contbranch.output.plot_curve import observable
from contbranch.output.plot_view import (
    BLUE,
    END,
    GREY,
    ORANGE,
    axis_label,
    check_observables,
    figure_of,
    handle,
    said,
    stacked,
    styled,
    unfinished,
)
from contbranch.output.smooth import smooth_path
from contbranch.results.loop import Hysteresis

_UP, _DOWN = BLUE, ORANGE
_PAD = 0.6  # of the extent of the jumps, shown on either side of them
_ARROW = {"arrowstyle": "-|>", "shrinkA": 0.0, "shrinkB": 0.0}
_MARGIN = 0.05  # of the axes, so that nothing lies on the frame


def loop_figure(loop: Hysteresis, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Draw the path with its jumps: the way up and the way down differ in colour; jumps are dotted, with an arrow.

    Parameters
    ----------
    loop : Hysteresis
    x : str, optional
        Default: what is controlled. ``load``, ``displacement``, ``contact_radius``, ``central_gap``, ``energy``, and
        with a spring ``piezo`` (its far end, d + F/K) and ``deflection`` (F/K).
    y : str, optional
        Likewise. Default: two panels, with the load (under load control the displacement) and the contact radius (where
        there is no contact at all the central gap).
    ax : matplotlib.axes.Axes, optional
        Where to draw, beside what is there already; default: a figure of its own.

    Raises
    ------
    InputError
        For another observable.
    """
    x = x or {"spring": "piezo"}.get(loop.control, loop.control)
    for name in (x, y or x):
        check_observables(name, name, loop.stiffness)
    first = y or ("displacement" if loop.control == "load" else "load")
    if ax is not None:
        _draw(ax, loop, x, first)
        found: Figure = figure_of(ax)
        return found
    if len(loop.path) < 2:
        return said(loop.message or "No path.")
    touching = bool(np.any(loop.path.contact_radius > 0.0))
    shown = [y] if y else [first, "contact_radius" if touching else "central_gap"]
    up, down = ("loading", "unloading") if loop.control == "load" else ("approach", "retraction")
    with styled():
        handles = [handle(up, color=_UP), handle(down, color=_DOWN)]
        if loop.jumps:
            handles.append(handle("jump", color="black", linestyle=":"))
        handles += (ends := unfinished(loop, "load", loop.path.load[-1]))
        return stacked(len(shown), lambda axes, k: _draw(axes, loop, x, shown[k]), handles, 3 - len(ends))


def _draw(axes: Axes, loop: Hysteresis, across: str, name: str) -> None:
    path, stiffness = loop.path, loop.stiffness
    axes.set_xlabel(axis_label(across, loop.units, loop.contact))
    axes.set_ylabel(axis_label(name, loop.units, loop.contact))
    low, high = _window(loop)
    for number in np.unique(path.leg):
        here = path.leg == number
        if np.count_nonzero(here) < 2:
            continue
        columns = (path.position[here], *(observable(path, one, stiffness)[here] for one in (across, name)))
        folded = any(jump.position == columns[0][-1] for jump in loop.jumps)
        position, *line = smooth_path(*columns, flat=folded)
        x, y = np.array(line)[:, (position >= low) & (position <= high)]
        up = path.direction[here][0] > 0
        color = _UP if up else _DOWN
        axes.plot(x, y, color=color, linewidth=1.6 if up else 1.1, zorder=2.0 if up else 2.5)
        if k := len(x) // 2:  # the way it is passed
            axes.annotate(
                "", (x[k], y[k]), (x[k - 1], y[k - 1]), arrowprops={**_ARROW, "color": color, "linewidth": 0.0}
            )
    for jump in loop.jumps:
        states = [state for state in (jump.start, jump.to) if state is not None]
        ends = [(observable(s, across, stiffness), observable(s, name, stiffness)) for s in states]
        _draw_jump(axes, ends, "to infinity" if loop.status == "complete" else "")
    if loop.status != "complete":
        axes.plot(*(observable(path, one, stiffness)[-1] for one in (across, name)), **END, zorder=4)
    axes.margins(_MARGIN)
    seen = (axes.dataLim.intervalx, axes.axvline), (axes.dataLim.intervaly, axes.axhline)
    for one, ((low, high), zero) in zip((across, name), seen, strict=True):
        if one in ("load", "deflection") and min(abs(low), abs(high)) <= high - low:  # it would not dwarf the loop
            zero(0.0, color=GREY, linewidth=0.4, alpha=0.6, zorder=0)


def _window(loop: Hysteresis) -> tuple[float, float]:
    """Positions that are shown: jumps and zero load in contact, with some context; without jumps, the whole path."""
    path = loop.path
    low, high = float(path.position.min()), float(path.position.max())
    at = [jump.position for jump in loop.jumps]
    if not at:
        return low, high
    pad = _PAD * (max(at) - min(at)) if max(at) > min(at) else 0.3 * (high - low)
    turned = (path.load[1:] * path.load[:-1] <= 0.0) & (path.contact_radius[1:] > 0.0) & (np.diff(path.leg) == 0)
    at += path.position[1:][turned].tolist()
    pad = max(pad, 0.1 * (max(at) - min(at)), 0.02 * max(abs(value) for value in at))
    return max(low, min(at) - pad), min(high, max(at) + pad)


def _draw_jump(axes: Axes, ends: list[tuple[float, float]], nowhere: str) -> None:
    """A dotted line with an arrow from the fold to where the jump ends, or a mark and a word where it ends nowhere."""
    axes.plot(*ends[0], marker="o", markersize=3.5, color="black", zorder=4.0)
    if len(ends) < 2:
        size = rcParams["legend.fontsize"]
        axes.annotate(nowhere, ends[0], (4.0, 8.0), textcoords="offset points", fontsize=size)
        return
    if not np.allclose(ends[0], ends[1]):  # of an arrow without length the head would stand beside the place
        style = {**_ARROW, "linestyle": ":", "color": "black", "linewidth": 0.9}
        axes.annotate("", ends[1], ends[0], arrowprops=style, zorder=4.0)
