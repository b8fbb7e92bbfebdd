"""Publication plots of followed events: an observable against the parameter, and diagrams of regions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from contbranch.arrays import Array
from contbranch.errors import look_up
from contbranch.output.plot_labels import place_labels
from contbranch.output.plot_view import (
    BLUE,
    DASHES,
    END,
    GREY,
    ORANGE,
    axis_label,
    figure_of,
    handle,
    new_figure,
    said,
    unfinished,
)
from contbranch.output.smooth import smooth_path
from contbranch.results.followed import Followed, Special
from contbranch.results.phase import PhaseDiagram
from contbranch.results.record import OBSERVABLES, UnitNames
from contbranch.results.table import with_unit

_NAMES = {
    "tabor": r"Tabor coefficient $\mu_\mathrm{T}$",
    "share": r"Share $\beta$ of the second law",
    "stiffness": "Spring stiffness $K$",
    "modulus": "Modulus $E$",
    "tip.radius": "Tip radius $R$",
    "parameter": "Parameter",
}
_FIELDS = {
    "range": "Range $z_0$",
    "work_of_adhesion": r"Work of adhesion $\Delta\gamma$",
    "wavelength": r"Wavelength $\lambda$",
    "phase": r"Phase $\varphi$",
}
# Parts of a curve at which its drawn line may have a corner.
_CORNERS = ("cusp", "cusp-at-touch", "fold-through-touch", "through-touch")
_TOUCH = "#009E73"
_MARKERS = {
    "cusp": "o",
    "cusp-at-touch": "D",
    "fold-through-touch": "D",
    "coincidence": "s",
    "through-touch": "D",
}
_LOGARITHMIC = 4.0  # ratio of the largest to the least value from which the axis is logarithmic
# Colours of the regions (states without contact, states with contact).
_REGIONS = {
    (0, 0): "#F3F3F3",
    (1, 0): "#DCEAF7",
    (0, 1): "#FBE3D0",
    (1, 1): "#D5EBD8",
    (0, 2): "#F6C9A4",
    (2, 0): "#B5D3EE",
}
_MANY = "#E3D5EA"


def followed_curve(followed: Followed, y: str = "load") -> Figure:
    """Draw an observable of a followed event against the parameter: solid with contact, dashed without.

    Parameters
    ----------
    y : str
        ``load``, ``displacement``, ``contact_radius`` or ``central_gap``.

    Raises
    ------
    InputError
        For another observable.
    """
    look_up(y, dict.fromkeys(OBSERVABLES), "y")
    values = followed.curve[followed.parameter]
    if not len(values):
        return said(followed.message or "No point.")
    with new_figure(2.7) as figure:
        axes = figure.subplots()
        logarithmic = _spacing(axes, followed.parameter, values)
        for x, line, contact in _lines(followed, y, logarithmic):
            style, mark = "-" if contact else DASHES, "o" if len(x) == 1 else ""
            axes.plot(x, line, color=BLUE, linestyle=style, marker=mark, markersize=3.5, zorder=3)
        event, touching = followed.event, followed.curve["contact_radius"] > 0
        handles = [handle("with contact", color=BLUE)] if np.any(touching) else []
        handles += [] if np.all(touching) else [handle("without contact", color=BLUE, linestyle=DASHES)]
        if ends := unfinished(followed, followed.parameter, values[-1]):
            handles += ends
            axes.plot(values[-1], followed.curve[y][-1], **END, zorder=4)
        axes.legend(
            handles=handles,
            loc="best",
            title="first touch" if event.kind == "touch" else f"{event.name or 'fold'}, {event.control} control",
            title_fontsize=mpl.rcParams["legend.fontsize"],
            alignment="left",
        )
        _mark(axes, followed, y, [one for one in followed.special if np.isfinite(one.value)])
    return figure


def phase_figure(phase: PhaseDiagram) -> Figure:
    """Draw the regions of a phase diagram, their boundaries, and the special points on them."""
    y = phase.control
    with new_figure(3.0) as figure:
        axes = figure.subplots()
        logarithmic = _spacing(axes, phase.parameter, phase.values)
        values, levels, without, within = phase.fine()
        codes, index = np.unique(without * 10 + within, return_inverse=True)
        present = [divmod(code, 10) for code in codes.tolist()]
        colors = mpl.colors.ListedColormap([_REGIONS.get(pair, _MANY) for pair in present])
        if len(values) > 1:
            axes.pcolormesh(
                values, levels, index.reshape(without.shape).T, cmap=colors, vmin=-0.5, vmax=len(present) - 0.5,
                shading="nearest", zorder=0, rasterized=True,
            )  # fmt: skip
            axes.set_xlim(values[0], values[-1])
        for followed in phase.boundaries:
            touch = followed.event.kind == "touch"
            for x, line, contact in _lines(followed, y, logarithmic):
                style = "-" if contact or touch else DASHES
                axes.plot(x, line, color=_TOUCH if touch else BLUE if contact else ORANGE, linestyle=style, zorder=3)
        axes.set_ylim(levels[0], levels[-1])
        figure.legend(handles=_regions(phase, present), loc="outside upper center", ncols=2, columnspacing=1.2)
        _mark(axes, phase, y, [one for one in phase.special if one.control in (None, y)])
    return figure


def _spacing(axes: Axes, parameter: str, values: Array) -> bool:
    """Make the axis of the parameter logarithmic where its values ask for it.

    A stiffness runs from 0, load control, to infinity, displacement control; any other axis shows its zero.
    """
    finite = values[np.isfinite(values) & ((values != 0.0) | (parameter != "stiffness"))]
    return scale_axis(axes.xaxis, finite)


def scale_axis(axis: Axis, values: Array) -> bool:
    """Make an axis logarithmic where the values on it ask for it, with ticks at round numbers."""
    if not is_logarithmic(values):
        return False
    (axis.axes.set_xscale if axis is axis.axes.xaxis else axis.axes.set_yscale)("log")
    ratio = values.max() / values.min()
    if ratio < 100.0:
        axis.set_major_formatter(mpl.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(mpl.ticker.NullFormatter())
        axis.set_major_locator(mpl.ticker.LogLocator(subs=(1.0, 2.0, 3.0, 5.0) if ratio < 20.0 else (1.0, 2.0, 5.0)))
    return True


def _lines(followed: Followed, y: str, logarithmic: bool) -> list[tuple[Array, Array, bool]]:
    """Smooth lines between the corners of a curve: parameter, observable, and whether there is contact."""
    curve = followed.curve
    x, values = curve[followed.parameter], curve[y]
    corners = sorted({0, max(len(x) - 1, 0), *(one.index for one in followed.special if one.kind in _CORNERS)})
    lines = []
    for first, last in [*pairwise(corners)] or [(0, 0)] * len(x):
        part = slice(first, last + 1)
        at, level = x[part], values[part]
        shown = np.isfinite(at) & ((at > 0) | (not logarithmic))
        at, level = at[shown], level[shown]
        contact = bool(np.any(curve["contact_radius"][part] > 0))
        fine, level = smooth_path(np.log(at) if logarithmic else at, level, bounded=False)
        lines.append((np.exp(fine) if logarithmic else fine, level, contact))
    return lines


def _mark(axes: Axes, shown: Followed | PhaseDiagram, y: str, special: Sequence[Special]) -> None:
    """Label the axes, which are complete but for the special points, and mark and name these."""
    natural = shown.contact if shown.parameter in ("tabor", "stiffness", "share") else None
    axes.set_xlabel(parameter_label(shown.parameter, shown.unit_names))
    axes.set_ylabel(axis_label(y, shown.unit_names, natural))  # reduced units do not change along such a curve
    marked = [one for one in special if one.kind in _MARKERS]
    points = np.array([[one.value, getattr(one, y)] for one in marked]).reshape(-1, 2)
    for one, point in zip(marked, points, strict=True):
        face = _TOUCH if "touch" in one.kind else "black"
        axes.plot(
            *point, linestyle="none", marker=_MARKERS[one.kind], markersize=4.6, markerfacecolor=face,
            markeredgecolor="white", markeredgewidth=0.7, zorder=5,
        )  # fmt: skip
    figure = figure_of(axes)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    place_labels(axes, points, [one.kind.replace("-", " ") for one in marked], ["black"] * len(marked))


def is_logarithmic(values: Array) -> bool:
    """Whether values are shown on a logarithmic axis."""
    return bool(values.size and values.min() > 0 and values.max() > _LOGARITHMIC * values.min())


def parameter_label(parameter: str, units: UnitNames) -> str:
    """Words, symbol and unit of a parameter."""
    parameter = parameter.removeprefix("material.")
    words, unit = _NAMES.get(parameter, parameter), ""
    which, _, name = parameter.rpartition(".")
    if which.startswith("interaction") and name in _FIELDS:
        number = which.removeprefix("interaction").strip("[]")
        words = _FIELDS[name] + (f" of law {number}" if number else "")
    if units:
        length = name in ("radius", "range", "wavelength", "length")
        unit = units["radius"] if length else {"stiffness": "nN/nm", "modulus": "nN/nm²"}.get(parameter, "")
        unit = "nN/nm" if name == "work_of_adhesion" else unit
    return with_unit(words, unit)


def _regions(phase: PhaseDiagram, present: list[tuple[int, int]]) -> list[Patch | Line2D]:
    """A handle for each kind of region and of boundary."""
    handles: list[Patch | Line2D] = []
    for without, within in present:
        words = [f"{n} {kind}" for n, kind in ((without, "apart"), (within, "in contact")) if n]
        label = "stable: " + (", ".join(words) or "none")
        handles.append(
            Patch(facecolor=_REGIONS.get((without, within), _MANY), edgecolor=GREY, linewidth=0.4, label=label)
        )
    radii = [f.curve["contact_radius"] for f in phase.boundaries if f.event.kind != "touch"]
    touching = np.concatenate([np.zeros(0), *radii]) > 0
    if np.any(touching):
        handles.append(handle("fold with contact", color=BLUE))
    if not np.all(touching):
        handles.append(handle("fold without contact", color=ORANGE, linestyle=DASHES))
    if len(radii) < len(phase.boundaries):
        handles.append(handle("first touch", color=_TOUCH))
    if phase.status != "complete":
        handles.append(handle("incomplete", linestyle="none"))
    return handles
