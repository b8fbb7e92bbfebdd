"""How figures look: fonts, lines and colours (those of Okabe and Ito), limits, axis labels, places of panels."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context, rcParams, rcParamsDefault
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from contbranch.arrays import Array, Flags
from contbranch.contact.contact import Contact
from contbranch.errors import InputError, look_up
from contbranch.output.plot_curve import AREA, COORDINATES, OF_SPRINGS, Line, coordinate
from contbranch.results.diagram import Diagram
from contbranch.results.record import Result, UnitNames

# What matplotlib takes.
Style = dict[str, Any]

BLUE = "#0072B2"
ORANGE = "#D55E00"
GREY = "#555555"
# Colours that the colour-blind tell apart, for several curves.
SERIES = (BLUE, ORANGE, "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = (0, (3.2, 1.6))
# Where a curve ends that should go on.
END: Any = {"marker": "x", "markersize": 5.0, "color": "black", "linestyle": "none"}
STYLE: Any = {
    "font.size": 8.0,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.use_mathtext": True,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.minor.width": 0.5,
    "ytick.minor.width": 0.5,
    "lines.linewidth": 1.3,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "savefig.dpi": 300,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # text stays text in the file
    "svg.hashsalt": "contbranch",  # the same diagram gives the same file
}

# observable: (words, symbol, its unit where R = E = |Δγ| = 1, (23)-(26))
_AXES = {
    "load": ("Load", "F_N", r"R\,|\Delta\gamma|"),
    "displacement": ("Displacement", "d", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "contact_radius": ("Contact radius", "a_c", r"(R^2|\Delta\gamma|/E)^{1/3}"),
    "contact_area": ("Contact area", "A_c", r"(R^2|\Delta\gamma|/E)^{2/3}"),
    "central_gap": ("Central gap", "g(0)", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "piezo": ("Position of the spring", "d + F_N/K", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "deflection": ("Deflection", "F_N/K", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "energy": ("Energy", "V", r"(R^4|\Delta\gamma|^5/E^2)^{1/3}"),
    "gap": ("Gap", "g", ""),
    "pressure": ("Pressure", "p", ""),
    "r": ("Radius", "r", ""),
}
WIDTH = 3.4  # inches, one column of a journal
SCREEN = 120  # pixels an inch in notebooks, of two points each
_PAD = 1.0  # of the extent of the events, shown on either side of them
_LEAST_PAD = 0.05  # of the events' distance from zero: context for a narrow window
_MARGIN = 0.07  # of the axis, so that no line lies on the frame


class Limits(NamedTuple):
    """Limits of the two axes."""

    x: tuple[float, float]
    y: tuple[float, float]


class _Picture(Figure):
    """A figure that is saved in the style it was drawn in, and shows itself in a notebook."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write the figure to a file, with 300 points an inch unless another ``dpi`` or ``rcParams`` say otherwise."""
        with styled():
            super().savefig(fname, **options)

    def _repr_png_(self) -> tuple[bytes, dict[str, float]]:
        held = BytesIO()
        self.savefig(held, format="png", dpi=2 * SCREEN)
        return held.getvalue(), {"width": round(SCREEN * self.get_figwidth())}


def styled() -> Any:
    """The style of all figures, without what the user has set in ``matplotlib.rcParams``."""
    return rc_context({key: value for key, value in STYLE.items() if rcParams[key] == rcParamsDefault[key]})


@contextmanager
def new_figure(height: float, width: float = 1.0) -> Iterator[Figure]:
    """Make a figure in the style of all, so many columns wide.

    Size, style and fonts that the user has set in ``matplotlib.rcParams`` have precedence.
    """
    own = list(rcParams["figure.figsize"]) != list(rcParamsDefault["figure.figsize"])
    size = rcParams["figure.figsize"] if own else (WIDTH, height)
    with styled():
        figure = _Picture(figsize=(size[0] * width, size[1]), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def stacked(count: int, draw: Callable[[Axes, int], None], handles: Sequence[Line2D], ncols: int) -> Figure:
    """A figure of panels one above the other, (a), (b), … if there are several, below a legend.

    Margins are those that labels of the size in use need: to measure them takes longer than all of the drawing.
    """
    with new_figure(2.7 if count == 1 else 4.9) as figure:
        figure.set_layout_engine(None)
        width, height = figure.get_size_inches()
        em = FontProperties(size=rcParams["axes.labelsize"]).get_size_in_points() / 72.0
        top = 1.6 * em * -(-len(handles) // ncols) + 2.0 * em  # powers of ten of the axis stand below the legend
        right = 1.0 - 1.5 * em / width  # half a number of five digits
        figure.subplots_adjust(5.8 * em / width, 3.4 * em / height, right, 1.0 - top / height, hspace=0.35)
        for number, axes in enumerate(figure.subplots(count, 1, squeeze=False)[:, 0].tolist()):
            draw(axes, number)
            axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]))
            # of ticks that are made later, outside of the style, too
            axes.tick_params(which="both", labelsize=rcParams["xtick.labelsize"])
            if count > 1:
                beside = {"loc": "left", "x": -0.22, "y": 1.0, "pad": 4.0}  # of the axis' power of ten
                axes.set_title(f"({'ab'[number]})", fontsize=rcParams["axes.labelsize"], **beside)
        figure.legend(handles=handles, loc="upper center", ncols=ncols, columnspacing=1.6, handletextpad=0.5)
    return figure


def said(words: str) -> Figure:
    """A figure that says why there is none."""
    with new_figure(1.2) as figure:
        figure.text(0.5, 0.5, textwrap.fill(words, 60), ha="center", va="center")
    return figure


def figure_of(axes: Axes) -> Any:
    """The figure in which axes are."""
    return axes.get_figure(root=True)


def heat_map(axes: Axes, x: Array, y: Array, values: Array, title: str, bar: bool = True, **style: Any) -> None:
    """Draw values, (M, N) at M places y and N places x or between them, as colours with a bar; `style` as pcolormesh's.

    The bar is as tall as a map of equal scales.
    """
    image = axes.pcolormesh(x, y, values, rasterized=True, **style)
    axes.set_title(title, fontsize=rcParams["axes.labelsize"], pad=4.0)
    if bar:
        tall = min(1.0, float(np.ptp(y) / np.ptp(x))) if axes.get_aspect() == 1.0 else 1.0
        figure_of(axes).colorbar(image, ax=axes, shrink=tall, aspect=22 * tall, pad=0.03).outline.set_linewidth(0.5)


def cell_edges(places: Array, width: float) -> Array:
    """Edges half-way between growing places, and as far beyond the outer ones; a single place is as wide as told."""
    if places.size == 1:
        return places + np.array([-0.5, 0.5]) * width
    between = 0.5 * (places[1:] + places[:-1])
    return np.array([2 * places[0] - between[0], *between, 2 * places[-1] - between[-1]])


def loud_radius(r: Array, values: Array, share: float) -> float:
    """The radius beyond which values are less than a share of the largest; the last one where all are nothing."""
    strength = np.abs(values)
    loud = np.flatnonzero(strength > share * np.max(strength, initial=0.0))
    return float(r[loud[-1] if loud.size else -1])


def mark_rim(panels: Sequence[Axes], contact_radius: float, named: bool, inwards: int) -> None:
    """Draw zero in the last panel, the rim of the contact in all of them, and name it in the first."""
    if contact_radius > 0.0:
        for axes in panels:
            axes.axvline(contact_radius, color=GREY, linewidth=0.6, linestyle=":", zorder=0)
    if contact_radius > 0.0 and named:
        panels[0].annotate(
            "$a_c$", (contact_radius, 1.0), (-3.0 * inwards, -3.0), xycoords=panels[0].get_xaxis_transform(),
            textcoords="offset points", va="top", ha="right" if inwards > 0 else "left", color=GREY,
        )  # fmt: skip


def handle(label: str, **style: Any) -> Line2D:
    """Return a line for a legend."""
    return Line2D([], [], label=label, **style)


def unfinished(result: Result, name: str, value: float) -> list[Line2D]:
    """A handle that says of an incomplete result where its curve ends, in words: it may be outside of what is shown."""
    if result.status == "complete":
        return []
    place = f"{name} {value:.3g} {result.table().units.get(name, '')}".rstrip()
    return [handle(f"stopped at {place}", **END)]


def axis_label(name: str, unit_names: UnitNames, contact: Contact | None = None) -> str:
    """Return words, symbol and unit of an observable; that of a contact may be made of R, E and |Δγ|."""
    words, symbol, reduced_unit = _AXES[name]
    quantity = {"r": "radius", **dict.fromkeys(OF_SPRINGS, "displacement")}.get(name, name)
    unit = unit_names.get(quantity, "")
    if unit:
        return f"{words} ${symbol}$ ({unit})"
    if reduced_unit and contact is not None and has_natural_units(contact):
        bracketed = reduced_unit if reduced_unit.startswith("(") else f"({reduced_unit})"
        return f"${symbol}\\,/\\,{bracketed}$"
    return f"{words} ${symbol}$"


def has_natural_units(contact: Contact) -> bool:
    """Whether a contact's numbers are in the units R, E and |Δγ| of a parabola, which axis labels can name."""
    if contact.units.physical or contact.interaction is None or contact.tip.name != "parabola":
        return False
    scales = contact.scales
    return bool(np.allclose([scales.in_plane, scales.normal, scales.modulus], 1.0, rtol=1e-12))


def check_observables(x: str, y: str, stiffness: float | None) -> None:
    """Raise InputError unless both can be drawn; those of springs need the stiffness of one."""
    for field, name in (("x", x), ("y", y)):
        look_up(name, dict.fromkeys((*COORDINATES, AREA, *OF_SPRINGS)), field)
        if name in OF_SPRINGS and not stiffness:
            raise InputError(
                f"{field}: {name!r}; there is no spring here: compute it with control=cb.Spring(stiffness)"
            )


def view(diagram: Diagram, lines: Sequence[Line], x: str, y: str) -> Limits | None:
    """Return limits that frame the events, or None if there is nothing to frame and all of the curve is to be seen.

    The part of the curve from the first to the last event (and, where the load changes sign in contact, to zero load)
    is widened on all sides. A trace that starts far away or ends under a large load then does not squeeze its events.
    The contact radius has no window of its own: it is shown over the whole window of the load.
    """
    if not any(_positions(diagram, number) for number in range(len(lines))):
        return None
    bounds = {name for name in (x, y) if name not in ("contact_radius", "energy", AREA, *OF_SPRINGS)} | {"load"}
    windows = {name: _window(diagram, lines, name) for name in bounds}
    limits = []
    inside = [np.logical_and.reduce([(low <= line.columns[name]) & (line.columns[name] <= high)
                                     for name, (low, high) in windows.items()]) for line in lines]  # fmt: skip
    for name in (x, y):
        seen = [line.columns[name][shown] for line, shown in zip(lines, inside, strict=True)]
        values = np.concatenate([*seen, _event_values(diagram, name)])
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        margin = _MARGIN * ((high - low) or abs(high) or 1.0)
        limits.append((low - margin, high + margin))
    return Limits(*limits)


def _positions(diagram: Diagram, number: int) -> list[float]:
    """Return the positions of folds, touches and losses of symmetry on a branch."""
    return [e.position for e in diagram.events if e.branch == number and e.kind in ("fold", "touch", "symmetry")]


def _event_values(diagram: Diagram, name: str) -> list[float]:
    return [coordinate(diagram, e, name) for e in diagram.events if e.kind in ("fold", "touch", "symmetry")]


def _window(diagram: Diagram, lines: Sequence[Line], name: str) -> tuple[float, float]:
    """Return the range of an observable that is worth showing."""
    values = [*_event_values(diagram, name)]
    for number, line in enumerate(lines):
        values += line.columns[name][_core(line, _positions(diagram, number))].tolist()
    low, high = min(values), max(values)
    least = _LEAST_PAD if any(diagram.folds()) else _PAD  # a first touch alone has no extent
    pad = max(_PAD * (high - low), least * max(abs(low), abs(high)))
    return low - pad, high + pad


def _core(line: Line, positions: Sequence[float]) -> Flags:
    """Return which points lie between the first and the last event, or before zero load in contact."""
    if not positions:
        return np.zeros(len(line.position), dtype=bool)
    first, last = min(positions), max(positions)
    sign = np.sign(line.columns["load"])
    crossing = np.flatnonzero((sign[1:] * sign[:-1] < 0) & (line.columns["contact_radius"][1:] > 0.0))
    if crossing.size:
        first, last = min(first, line.position[crossing[0]]), max(last, line.position[crossing[-1] + 1])
    return (line.position >= first) & (line.position <= last)
