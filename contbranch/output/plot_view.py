"""How figures look: fonts, lines and colours (those of Okabe and Ito), limits, axis labels, places of panels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import ScalarFormatter
from numpy.typing import NDArray

from contbranch.errors import InputError
from contbranch.output.plot_curve import COORDINATES, Line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from contbranch.contact.contact import Contact
    from contbranch.results.diagram import Diagram

__all__ = ["BLUE", "GREY", "ORANGE", "STYLE", "WIDTH", "Limits", "arrange_panels", "axis_label"]
__all__ += ["check_observables", "handle", "has_natural_units", "new_figure", "view"]

BLUE: Final = "#0072B2"
ORANGE: Final = "#D55E00"
GREY: Final = "#555555"
STYLE: Final[Any] = {
    "font.size": 8.0,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
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
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # text stays text in the file
    "svg.hashsalt": "contbranch",  # the same diagram gives the same file
}

# observable: (words, symbol, its unit where R = E = |Δγ| = 1, (23)-(26))
_AXES: Final = {
    "load": ("Load", "F_N", r"R\,|\Delta\gamma|"),
    "displacement": ("Displacement", "d", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "contact_radius": ("Contact radius", "a_c", r"(R^2|\Delta\gamma|/E)^{1/3}"),
    "central_gap": ("Central gap", "g(0)", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "energy": ("Energy", "V", r"(R^4|\Delta\gamma|^5/E^2)^{1/3}"),
    "gap": ("Gap", "g", ""),
    "pressure": ("Pressure", "p", ""),
    "r": ("Radius", "r", ""),
}
WIDTH: Final = 3.4  # inches, one column of a journal
_LEGEND_ROW, _TITLE, _BELOW, _RIGHT = 0.15, 0.21, 0.37, 0.11  # inches: a legend's row; above, below, right of a panel
_PAD: Final = 1.0  # of the extent of the events, shown on either side of them
_LEAST_PAD: Final = 0.05  # of the events' distance from zero: context for a narrow window
_MARGIN: Final = 0.07  # of the axis, so that no line lies on the frame


class Limits(NamedTuple):
    """Limits of the two axes."""

    x: tuple[float, float]
    y: tuple[float, float]


@contextmanager
def new_figure(height: float, layout: Literal["constrained"] | None = "constrained") -> Iterator[Figure]:
    """Make a figure, one column wide, in the style of all; with a layout it is drawn twice, to measure it first."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), layout=layout)
        FigureCanvasAgg(figure)
        yield figure


def handle(label: str, **style: Any) -> Line2D:
    """Return a line for a legend."""
    return Line2D([], [], label=label, **style)


def axis_label(name: str, unit_names: Mapping[str, str], natural: bool) -> str:
    """Return words, symbol and unit of an observable; `natural`: the unit is made of R, E and |Δγ|."""
    words, symbol, reduced_unit = _AXES[name]
    unit = unit_names.get({"r": "radius"}.get(name, name), "")
    if unit:
        return f"{words} ${symbol}$ ({unit})"
    if natural and reduced_unit:
        return f"${symbol}\\,/\\,{_bracketed(reduced_unit)}$"
    return f"{words} ${symbol}$"


def has_natural_units(contact: Contact) -> bool:
    """Whether a contact's numbers are in the units R, E and |Δγ| of a parabola, which axis labels can name."""
    if contact.units.physical or contact.interaction is None or contact.tip.name != "parabola":
        return False
    scales = contact.scales
    return bool(np.allclose([scales.in_plane, scales.normal, scales.modulus], 1.0, rtol=1e-12))


def _bracketed(unit: str) -> str:
    return unit if unit.startswith("(") else f"({unit})"


def check_observables(x: str, y: str) -> None:
    """Raise InputError unless both can be drawn."""
    for field, name in (("x", x), ("y", y)):
        if name not in COORDINATES:
            raise InputError(f"{field}: {name!r}; must be one of {', '.join(COORDINATES)}")


def view(diagram: Diagram, lines: Sequence[Line], x: str, y: str) -> Limits | None:
    """Return limits that frame the events, or None if there is nothing to frame and all of the curve is to be seen.

    The part of the curve from the first to the last event (and, where the load changes sign in contact, to zero load)
    is widened on all sides. A trace that starts far away or ends under a large load then does not squeeze its events.
    The contact radius has no window of its own: it is shown over the whole window of the load.
    """
    check_observables(x, y)
    if not any(_positions(diagram, number) for number in range(len(lines))):
        return None
    bounds = {name for name in (x, y) if name not in ("contact_radius", "energy")} | {"load"}
    windows = {name: _window(diagram, lines, name) for name in bounds}
    limits = []
    for name in (x, y):
        seen = [line.columns[name][_inside(line, windows)] for line in lines]
        values = np.concatenate([*seen, _event_values(diagram, name)])
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        margin = _MARGIN * ((high - low) or abs(high) or 1.0)
        limits.append((low - margin, high + margin))
    return Limits(limits[0], limits[1])


def _positions(diagram: Diagram, number: int) -> list[float]:
    """Return the positions of folds, touches and losses of symmetry on a branch."""
    return [e.position for e in diagram.events if e.branch == number and e.kind in ("fold", "touch", "symmetry")]


def _event_values(diagram: Diagram, name: str) -> list[float]:
    if name == "energy":
        return []
    return [getattr(e, name) for e in diagram.events if e.kind in ("fold", "touch", "symmetry")]


def _window(diagram: Diagram, lines: Sequence[Line], name: str) -> tuple[float, float]:
    """Return the range of an observable that is worth showing."""
    values = [*_event_values(diagram, name)]
    for number, line in enumerate(lines):
        values += line.columns[name][_core(line, _positions(diagram, number))].tolist()
    low, high = min(values), max(values)
    least = _LEAST_PAD if any(diagram.folds()) else _PAD  # a first touch alone has no extent
    pad = max(_PAD * (high - low), least * max(abs(low), abs(high)))
    return low - pad, high + pad


def _core(line: Line, positions: Sequence[float]) -> NDArray[np.bool_]:
    """Return which points lie between the first and the last event, or before zero load in contact."""
    if not positions:
        return np.zeros(len(line.position), dtype=bool)
    first, last = min(positions), max(positions)
    sign = np.sign(line.columns["load"])
    crossing = np.flatnonzero((sign[1:] * sign[:-1] < 0) & (line.columns["contact_radius"][1:] > 0.0))
    if crossing.size:
        first, last = min(first, line.position[crossing[0]]), max(last, line.position[crossing[-1] + 1])
    return np.asarray((line.position >= first) & (line.position <= last))


def _inside(line: Line, windows: Mapping[str, tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which points lie in all windows."""
    inside = np.ones(len(line.position), dtype=bool)
    for name, (low, high) in windows.items():
        inside &= (line.columns[name] >= low) & (line.columns[name] <= high)
    return inside


class _PlainTicks(ScalarFormatter):
    """Labels of ticks as plain text, which is laid out in a tenth of the time of a formula that looks the same."""

    def format_ticks(self, values: Any) -> list[str]:
        """Return the labels without what makes them formulas."""
        return [label.removeprefix(r"$\mathdefault{").removesuffix("}$") for label in super().format_ticks(values)]


def arrange_panels(figure: Figure, panels: Sequence[Axes], rows: int) -> None:
    """Place panels one above the other below a legend of some rows.

    Only the width of the labels on the left is measured: a general layout engine takes as long as all of the drawing.
    """
    height = figure.get_figheight()
    slot = (height - _LEGEND_ROW * rows - 0.03) / len(panels)
    title = _TITLE if len(panels) > 1 else 0.08
    left = 0.55
    for axes in panels:
        # Written into the axes, since the number of ticks depends on it, also when the figure is saved.
        axes.tick_params(which="both", labelsize=mpl.rcParams["ytick.labelsize"])
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(_PlainTicks())
    for _ in range(2):  # the second time with the ticks that fit
        for i, axes in enumerate(panels):
            bottom = (len(panels) - 1 - i) * slot + _BELOW
            size = (WIDTH - left - _RIGHT, slot - _BELOW - title)
            axes.set_position((left / WIDTH, bottom / height, size[0] / WIDTH, size[1] / height))
        left = max(_label_width(axes) for axes in panels) + 0.06


def _label_width(axes: Axes) -> float:
    """Return how far the ticks' and the axis' labels reach out to the left, in inches."""
    figure: Any = axes.get_figure(root=True)
    extent = axes.yaxis.get_tightbbox(figure.canvas.get_renderer())
    frame = axes.get_window_extent()
    return 0.0 if extent is None else float(frame.x0 - extent.x0) / float(figure.dpi)
