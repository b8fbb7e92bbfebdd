"""Figures 3 and 4 of the paper on grids, and the contact radius of Hertz' contact below the spacing of the nodes.

    python studies/paper_grid_figures.py    # tables, and docs/figures/paper_fig3.png, paper_fig4.png; half a minute

The paper is M. H. Müser, "Single-asperity contact mechanics with positive and negative work of adhesion", Beilstein J.
Nanotechnol. 5, 419-437 (2014). What it has no numbers for is compared with the axisymmetric model, which has no grid.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.models.grid.contact_area import contact_area
from contbranch.models.grid.newton import Equilibrium, Hold, Settings
from contbranch.models.grid.observables import FarField, far_field, image_curvature, interpolate
from contbranch.models.grid.setup import Setup
from contbranch.models.grid.sketch import drawn, relatives
from contbranch.models.grid.solve import reached
from contbranch.output.plot_view import BLUE, GREY, ORANGE, STYLE, WIDTH

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
GREEN = "#009E73"
Array = NDArray[np.float64]
Model = cb.Periodic | cb.FreeSpace


# Figure 3: contacts that are scaled copies of each other

WORK, LOAD = 0.64e-4, 1e-4
# w, by which work of adhesion and load are divided.
SCALES = (1.0, 0.5)


@dataclass(frozen=True)
class Collapse:
    """The gap of one contact of Figure 3, in its own units and in those of (23) and (24).

    Attributes
    ----------
    scale : float
        w.
    radius, gap : array (M,)
        Up to the edge of the cell, E = L = 1.
    in_plane, normal : float
        (R²Δγ/E)^(1/3) and (RΔγ²/E²)^(1/3).
    exact : float
        Largest difference of the scaled gap from that of the axisymmetric model, as far as its profile goes.
    """

    scale: float
    radius: Array
    gap: Array
    in_plane: float
    normal: float
    exact: float

    def scaled(self) -> tuple[Array, Array]:
        """Radius and gap in reduced units."""
        return self.radius / self.in_plane, self.gap / self.normal


def contact_of_figure_3(scale: float) -> tuple[cb.Contact, float]:
    """E = L = R = μ_T = 1, Δγ = 0.64e-4/w, hence z0 = Δγ^(2/3); and its load 1e-4/w."""
    work = WORK / scale
    law = cb.Exponential(work_of_adhesion=work, range=work ** (2.0 / 3.0))
    return cb.Contact(tip=cb.Parabola(radius=1.0), interaction=law, modulus=1.0), LOAD / scale


def collapse(scale: float, grid: int = 512) -> Collapse:
    """Solve one contact of Figure 3 in the periodic cell of edge 1."""
    contact, load = contact_of_figure_3(scale)
    state = cb.solve(contact, load=load, model=cb.Periodic(cell=1.0, grid=grid))
    own = cb.solve(contact, load=load, model=cb.Axisymmetric())
    normal = contact.scales.normal
    common = state.r <= own.r[-1]
    exact = np.abs(CubicSpline(own.r, own.gap)(state.r[common]) - state.gap[common]).max() / normal
    return Collapse(scale, state.r, state.gap, contact.scales.in_plane, normal, float(exact))


def difference(one: Collapse, other: Collapse) -> float:
    """Largest difference of two scaled gaps where both are known, in reduced units."""
    radius, gap = one.scaled()
    at, values = other.scaled()
    common = radius <= at[-1]
    return float(np.abs(CubicSpline(at, values)(radius[common]) - gap[common]).max())


def draw_figure_3(pair: Sequence[Collapse]) -> Figure:
    """Both contacts: their gaps in the units of the cell, and on top of each other in those of (23) and (24)."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2 * WIDTH, 2.6), layout="constrained")
        FigureCanvasAgg(figure)
        raw, scaled = figure.subplots(1, 2)
        for item, marker, colour in zip(pair, "ox", (BLUE, ORANGE), strict=True):
            label = f"$w = {item.scale:g}$"
            for axes, (radius, gap) in ((raw, (item.radius, item.gap)), (scaled, item.scaled())):
                chosen = np.unique(np.searchsorted(radius, np.linspace(0.0, 5.5 * radius[-1] / 12.5, 26)))
                style: dict[str, Any] = {
                    "marker": marker,
                    "markersize": 4.0,
                    "linestyle": "none",
                    "markerfacecolor": "none",
                }
                axes.plot(radius[chosen], gap[chosen], color=colour, label=label, **style)
        line = pair[0].scaled()
        scaled.plot(*line, color=GREY, linewidth=0.7, linestyle=":", zorder=0)
        raw.set(xlabel="$r/L$", ylabel="$g(r)/L$", xlim=(0.0, 0.22), ylim=(-4e-4, 0.016))
        scaled.set(
            xlabel=r"$r/(R^2\Delta\gamma/E)^{1/3}$",
            ylabel=r"$g(r)/(R\,\Delta\gamma^2/E^2)^{1/3}$",
            xlim=(0.0, 5.0),
            ylim=(-0.25, 8.0),
        )
        raw.legend()
        scaled.legend()
        raw.set_title("(a)", loc="left", fontsize=8.5)
        scaled.set_title("(b)", loc="left", fontsize=8.5)
    return figure


# Figure 4: the displacement of the far field from a finite cell

EDGE = 9.8825
FACTORS = (1.0, 2.0 ** (1.0 / 3.0), 2.0 ** (2.0 / 3.0))
CONTACT, PRESSED = cb.Contact.reduced(cb.Exponential, tabor=1.0), 1.5625


@dataclass(frozen=True)
class Solved:
    """An equilibrium on a lattice with the setup it belongs to."""

    setup: Setup
    equilibrium: Equilibrium


def solved(contact: cb.Contact, model: Model, load: float, accuracy: float = 1e-6) -> Solved:
    """The equilibrium with a load next to the first one of the axisymmetric model; reduced units.

    Raises
    ------
    RuntimeError
        If none was found.
    """
    setup = model.setup(contact, "load", load, accuracy)
    related, _ = relatives(contact, "load", load)
    found = reached(setup, drawn(setup, related[0]), Hold(load), Settings(tolerance=1e-9))
    if found is None:
        raise RuntimeError(f"no equilibrium at load {load:g} with {model}")
    return Solved(setup, found)


@dataclass(frozen=True)
class FarDisplacement:
    """Displacements in one periodic cell of Figure 4.

    Attributes
    ----------
    edge : float
    radius, displacement : array (N/2,)
        -u(r) on the diagonal, up to the corner X.
    far : FarField
        Three estimates of the displacement at infinity.
    contact_radius : float
    peak : float
        Radius at which -u is largest.
    """

    edge: float
    radius: Array
    displacement: Array
    far: FarField
    contact_radius: float
    peak: float


def far_displacement(edge: float, grid: int = 512) -> FarDisplacement:
    """Solve the contact of Figure 4 in a periodic cell."""
    found = solved(CONTACT, cb.Periodic(cell=edge, grid=grid), PRESSED)
    problem, state = found.setup.problem, found.equilibrium
    lattice = problem.lattice
    height = partial(interpolate, lattice, -state.u)
    return FarDisplacement(
        edge,
        np.sqrt(2.0) * lattice.axis,
        -np.diagonal(state.u),
        far_field(problem, state),
        contact_area(problem, state).radius,
        peak(np.hypot(lattice.axis, 0.5 * lattice.spacing), -state.u[:, 0], height(0.0, 0.0)),
    )


def peak(radius: Array, displacement: Array, centre: float) -> float:
    """Radius of the largest displacement, by the parabola through the largest value and its neighbours."""
    values = np.concatenate([[centre], displacement])
    at = np.concatenate([[0.0], radius])
    k = int(np.argmax(values))
    a, b, _ = np.polyfit(at[k - 1 : k + 2] - at[k], values[k - 1 : k + 2], 2)
    return float(at[k] - 0.5 * b / a)


def exact_displacement() -> tuple[cb.Solution, Array]:
    """The axisymmetric model's state of Figure 4 and its -u = z - g."""
    state = cb.solve(CONTACT, load=PRESSED, model=cb.Axisymmetric(), accuracy=1e-9)
    return state, 0.5 * state.r**2 - state.gap


def beyond(state: cb.Solution, last: float, radius: Array) -> Array:
    """-u outside the profile, d - F/(π r) + c/r³ (29), with c from its last value."""
    end = float(state.r[-1])
    c = (last - state.displacement + state.load / (np.pi * end)) * end**3
    return np.asarray(state.displacement - state.load / (np.pi * radius) + c / radius**3)


def extrapolated(first: FarDisplacement, second: FarDisplacement) -> float:
    """The shifted mean without the images' next term, which falls with the cell's edge as L⁻³."""
    a, b = first.edge**-3, second.edge**-3
    return (second.far.displacement * a - first.far.displacement * b) / (a - b)


def draw_figure_4(cells: Sequence[FarDisplacement]) -> Figure:
    """Displacement along the diagonal of three cells with the tip's shape, and enlarged with what is extrapolated."""
    state, exact = exact_displacement()
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2 * WIDTH, 2.6), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, 2)
        tip = np.linspace(0.0, 3.0, 100)
        for axes in panels:
            axes.plot(tip, 0.5 * tip**2, color="black", linewidth=0.8, linestyle="--", label="tip")
            outer = np.linspace(state.r[-1], 12.0, 100)
            line = np.append(state.r, outer), np.append(exact, beyond(state, float(exact[-1]), outer))
            axes.plot(*line, color=GREY, linewidth=2.6, alpha=0.5, label="no cell")
            axes.axhline(state.displacement, color=GREY, linewidth=0.7, linestyle=":")
            for cell, colour in zip(cells, (BLUE, ORANGE, GREEN), strict=True):
                axes.plot(cell.radius, cell.displacement, color=colour, linewidth=1.0, label=f"$L = {cell.edge:.2f}$")
            axes.set_xlabel("$r$")
        for cell, colour in zip(cells, (BLUE, ORANGE, GREEN), strict=True):
            style: dict[str, Any] = {
                "color": colour,
                "markersize": 4.5,
                "linestyle": "none",
                "clip_on": False,
                "zorder": 4,
            }
            panels[1].plot([cell.radius[-1]], [cell.far.rounded], marker="s", markerfacecolor="none", **style)
            panels[1].plot([cell.radius[-1]], [cell.far.displacement], marker="o", **style)
        panels[1].plot([], [], color="0.3", marker="s", markerfacecolor="none", linestyle="none", label="$6u_X - 5u_M$")
        panels[1].plot([], [], color="0.3", marker="o", linestyle="none", label="shifted mean")
        panels[0].set(ylabel="$-u(r)$", xlim=(0.0, 12.0), ylim=(0.0, 3.4))
        panels[1].set(ylabel="$-u(r)$", xlim=(1.8, 12.0), ylim=(2.3, 2.75))
        panels[0].legend(loc="lower right")
        panels[1].legend(*_last(panels[1], 2), loc="upper right")
        panels[0].set_title("(a)", loc="left", fontsize=8.5)
        panels[1].set_title("(b)", loc="left", fontsize=8.5)
    return figure


def _last(axes: mpl.axes.Axes, count: int) -> tuple[list[mpl.artist.Artist], list[str]]:
    handles, labels = axes.get_legend_handles_labels()
    return handles[-count:], labels[-count:]


# Hertz' contact: the radius below the spacing

SHARE = 1.0 / 8.0
# Radii, in spacings about the nominal one, over which the largest error is taken: where the nodes lie is chance.
SHIFTS = (-0.4, -0.2, 0.0, 0.2, 0.4)


@dataclass(frozen=True)
class HertzRow:
    """Relative errors of the contact radius of Hertz' contact with a radius of an eighth of the cell.

    Attributes
    ----------
    nodes : int
        Spacings in the radius, a/Δa.
    counted, fitted : float
        Largest relative error of √(nodes in contact · Δa²/π), and of the radius with sub-grid resolution.
    corrected : float
        That of the latter when the images' curvature is taken off; the same as `fitted` in free space.
    estimate : float
        Largest error estimate of the radius, relative, which leaves the images out.
    """

    nodes: int
    counted: float
    fitted: float
    corrected: float
    estimate: float


def hertz(nodes: int, kind: type[Model]) -> HertzRow:
    """Solve Hertz' contact, 4 a³/3 = F, at radii of about so many spacings."""
    contact = cb.Contact(tip=cb.Parabola(radius=1.0))
    rows = []
    for shift in SHIFTS:
        radius = 1.0 + shift / nodes
        found = solved(contact, kind(cell=1.0 / SHARE, grid=round(nodes / SHARE)), 4.0 * radius**3 / 3.0)
        area = contact_area(found.setup.problem, found.equilibrium)
        counted = np.sqrt(area.nodes * found.setup.lattice.spacing**2 / np.pi)
        images = 1.0 + image_curvature(found.setup.problem, found.equilibrium) / 3.0
        values = np.array([counted, area.radius, area.radius * images]) / radius
        rows.append([*np.abs(values - 1.0), area.radius_error / radius])
    worst = np.array(rows).max(axis=0)
    return HertzRow(nodes, *(float(value) for value in worst))


# Output


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def report_figure_3(pair: Sequence[Collapse]) -> str:
    """The largest differences of the scaled gaps."""
    rows = [
        [f"{item.scale:g}", f"{1.0 / item.in_plane:.2f}", f"{item.exact:.1e}", f"{item.scaled()[1][-1]:.1f}"]
        for item in pair
    ]
    head = ("w", "cell in reduced units", "largest difference from the axisymmetric gap", "gap at the cell's edge")
    return f"{table(head, rows)}\n\nLargest difference of the two from each other: {difference(*pair):.1e}"


def report_figure_4(cells: Sequence[FarDisplacement]) -> str:
    """Contact radius, peak, and the three estimates of d for every cell."""
    exact, values = exact_displacement()
    spline = CubicSpline(exact.r, values)
    fine = np.linspace(2.3, 3.0, 7001)
    rows = []
    for cell in cells:
        far = cell.far
        estimates = [
            (far.rounded, far.rounded_error),
            (far.from_points, far.from_points_error),
            (far.displacement, far.error),
        ]
        texts = [f"{value:.4f} ± {error:.4f}" for value, error in estimates if value is not None]
        rows.append([f"{cell.edge:.4f}", f"{cell.contact_radius:.4f}", f"{cell.peak:.3f}", *texts])
    top = float(fine[np.argmax(spline(fine))])
    last = f"{exact.displacement:.4f}"
    rows.append(["none (axisymmetric)", f"{exact.contact_radius:.4f}", f"{top:.3f}", last, last, last])
    head = ("L", "a_c", "peak of -u at", "6u_X - 5u_M", "(3+2√2)u_X - (2+2√2)u_M", "shifted mean")
    pairs = [f"{extrapolated(*two):.5f}" for two in itertools.pairwise(cells)]
    return f"{table(head, rows)}\n\nShifted mean extrapolated in 1/L³ from neighbouring cells: {', '.join(pairs)}"


def report_hertz(counts: Sequence[int]) -> str:
    """Errors of the contact radius against the spacing, for both kinds of cell."""
    rows = []
    for nodes in counts:
        periodic, free = hertz(nodes, cb.Periodic), hertz(nodes, cb.FreeSpace)
        errors = (
            periodic.counted,
            periodic.fitted,
            periodic.corrected,
            periodic.estimate,
            free.counted,
            free.fitted,
            free.estimate,
        )
        rows.append([f"1/{nodes}", *(f"{100 * error:.3f} %" for error in errors)])
    head = (
        "Δa/a_c",
        "periodic: counted",
        "sub-grid",
        "without images",
        "estimate",
        "free: counted",
        "sub-grid",
        "estimate",
    )
    return table(head, rows)


def main() -> None:
    """Print the tables and draw the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--grid", type=int, default=512, help="nodes a side for Figures 3 and 4 (default: %(default)s)")
    parser.add_argument("--folder", default=str(FIGURES), help="where to draw (default: %(default)s)")
    given = parser.parse_args()
    pair = [collapse(scale, given.grid) for scale in SCALES]
    cells = [far_displacement(EDGE * factor, given.grid) for factor in FACTORS]
    for text in (report_figure_3(pair), report_figure_4(cells), report_hertz((8, 16, 32, 64))):
        print(text, end="\n\n")
    draw_figure_3(pair).savefig(Path(given.folder) / "paper_fig3.png", dpi=200)
    draw_figure_4(cells).savefig(Path(given.folder) / "paper_fig4.png", dpi=200)


if __name__ == "__main__":
    main()
