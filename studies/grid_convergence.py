"""How errors of the grid models fall with grid and cell, whether their estimates are honest, and what they cost.

    python studies/grid_convergence.py                      # up to 256²: tables, docs/figures/grid_convergence.png
    python studies/grid_convergence.py --finest 512         # minutes
    python studies/grid_convergence.py --large              # costs at 2048² with their memory, too
    python studies/grid_convergence.py --stiff              # traces at μ_T = 4, too; many minutes, and 512² is needed

Every tip is axisymmetric, so that the axisymmetric model, which has no grid, gives the values without error.
Times are those of one thread if the environment says so: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import itertools
import json
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

import contbranch as cb
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves
from contbranch.output.plot_view import BLUE, GREY, ORANGE, STYLE, WIDTH

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))
from studies.benchmark_grid import machine, table  # noqa: E402

FIGURE = ROOT / "docs" / "figures" / "grid_convergence.png"
GREEN, PURPLE = "#009E73", "#CC79A7"
EXACT = 1e-9
Model = cb.Periodic | cb.FreeSpace


@dataclass(frozen=True)
class Case:
    """A contact in a cell in free space.

    Attributes
    ----------
    name : str
    law : str
        Class of the interaction.
    tabor : float
    sign : int
        1 attracts, -1 repels.
    cell : float
        Edge, large enough for what interacts at every event.
    loads : tuple of float
        At which single states are compared.
    max_load : float or None
        Load at which a trace ends.
    """

    name: str
    law: str
    tabor: float
    sign: int
    cell: float
    loads: tuple[float, ...]
    max_load: float | None = None

    @property
    def contact(self) -> cb.Contact:
        """The contact in reduced units."""
        return cb.Contact.reduced(getattr(cb, self.law), tabor=self.tabor, sign=self.sign)


GAUSS = Case("Gauss repulsion, μ_T = 1", "Gauss", 1.0, -1, 8.0, (3.0, 7.0, 8.2, 10.0), 10.0)
GAUSS_STIFF = Case("Gauss repulsion, μ_T = 4", "Gauss", 4.0, -1, 13.0, (10.0, 60.0), 88.0)
EXPONENTIAL = Case("Exponential attraction, μ_T = 1", "Exponential", 1.0, 1, 12.0, (-0.5, 1.5625, 6.0), 2.0)
CASES = (GAUSS, EXPONENTIAL, GAUSS_STIFF)


# Thresholds of a whole trace


@dataclass(frozen=True)
class Threshold:
    """One threshold on one grid.

    Attributes
    ----------
    name : str
        As in `Diagram.thresholds`.
    value, exact : float
        On the grid, and of the axisymmetric model.
    estimate : float
        Error estimate on the grid.
    verdict : str or None
        What becomes of the fold on the grid with twice the nodes.
    """

    name: str
    value: float
    exact: float
    estimate: float
    verdict: str | None

    @property
    def error(self) -> float:
        """True error."""
        return abs(self.value - self.exact)

    @property
    def ratio(self) -> float:
        """True error over the estimate."""
        return self.error / self.estimate


@dataclass(frozen=True)
class Trace:
    """A traced curve on one grid.

    Attributes
    ----------
    grid : int
    spacing : float
    seconds : float
        Of the whole trace, verdicts and error estimates included.
    pairs, points : int
    status : str
    thresholds : tuple of Threshold
    """

    grid: int
    spacing: float
    seconds: float
    pairs: int
    points: int
    status: str
    thresholds: tuple[Threshold, ...]

    def error(self, name: str) -> float | None:
        """True error of a threshold, None if the trace has not found it."""
        return next((item.error for item in self.thresholds if item.name == name), None)


@cache
def exact_thresholds(case: Case) -> dict[str, float]:
    """Thresholds of the axisymmetric model."""
    return dict(cb.trace(case.contact, accuracy=EXACT, model=cb.Axisymmetric(), modes=0).thresholds)


def bearer(diagram: cb.Diagram, name: str) -> tuple[cb.Event, str]:
    """The event and its attribute that a threshold is."""
    owner, _, quantity = name.rpartition("_")
    control = "load"
    if quantity == "displacement" or owner.endswith("_displacement"):
        control, owner = "displacement", owner.removesuffix("_displacement")
    attribute = "contact_radius" if quantity == "radius" else quantity
    for event in diagram.events:
        if owner == "touch" and event.kind == "touch":
            return event, attribute
        if event.name == owner.replace("_", "-") and event.control == control:
            return event, attribute
    raise LookupError(name)


def traced(case: Case, model: Model) -> Trace:
    """Trace a case and compare its thresholds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cb.GridWarning)
        diagram = cb.trace(case.contact, model=model, max_load=case.max_load)
    exact = exact_thresholds(case)
    found = []
    for name, value in diagram.thresholds.items():
        if name in exact:
            event, attribute = bearer(diagram, name)
            found.append(Threshold(name, value, exact[name], float(event.error[attribute]), event.verdict))
    assert model.cell is not None
    assert model.grid is not None
    points = sum(len(branch) for branch in diagram.branches)
    cost = diagram.cost
    return Trace(model.grid, model.cell / model.grid, cost.wall_s, cost.fft_pairs, points, diagram.status, tuple(found))


def without_grid(case: Case, accuracies: Sequence[float] = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)) -> list[Trace]:
    """The same by the axisymmetric model at several accuracies, for comparison; of three times the best."""
    rows = []
    for accuracy in accuracies:
        seconds = []
        for _ in range(3):
            began = time.perf_counter()
            diagram = cb.trace(
                case.contact, accuracy=accuracy, max_load=case.max_load, model=cb.Axisymmetric(), modes=0
            )
            seconds.append(time.perf_counter() - began)
        found = []
        for name, exact in exact_thresholds(case).items():
            event, attribute = bearer(diagram, name)
            found.append(Threshold(name, diagram.thresholds[name], exact, float(event.error[attribute]), None))
        points = sum(len(branch) for branch in diagram.branches)
        rows.append(Trace(0, 0.0, min(seconds), 0, points, diagram.status, tuple(found)))
    return rows


def grids(case: Case, finest: int) -> tuple[int, ...]:
    """Grids on which a case is traced: what cannot resolve the interaction at all is left out."""
    coarsest = 32 * max(1, round(case.tabor))
    return tuple(coarsest * 2**k for k in range(6) if coarsest * 2**k <= finest)


def rate(spacings: Sequence[float], errors: Sequence[float]) -> float:
    """Exponent of the spacing with which errors fall: the slope of a straight line through the logarithms."""
    return float(np.polyfit(np.log(spacings), np.log(errors), 1)[0])


# Single states


@dataclass(frozen=True)
class StateError:
    """Errors of one state at a given load: of its displacement, contact radius or central gap."""

    case: str
    grid: int
    load: float
    quantity: str
    error: float
    estimate: float

    @property
    def ratio(self) -> float:
        """True error over the estimate."""
        return self.error / self.estimate


@cache
def exact_states(case: Case, load: float) -> tuple[cb.State, ...]:
    """All states of the axisymmetric model at a load."""
    return cb.solve(case.contact, load=load, model=cb.Axisymmetric(), accuracy=1e-8).states


def state_errors(case: Case, grid: int) -> list[StateError]:
    """Solve a case at each of its loads, and compare every state found with its relative."""
    found = []
    for load in case.loads:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", cb.GridWarning)
            solution = cb.solve(case.contact, load=load, model=cb.FreeSpace(cell=case.cell, grid=grid))
        for state in solution.states:
            related = min(
                exact_states(case, load),
                key=lambda other: (
                    abs(other.displacement - state.displacement) + abs(other.contact_radius - state.contact_radius)
                ),
            )
            for name in ("displacement", "contact_radius", "central_gap"):
                value, exact = getattr(state, name), getattr(related, name)
                if (value > 0.0 and exact > 0.0) or name == "displacement":
                    found.append(StateError(case.name, grid, load, name, abs(value - exact), float(state.error[name])))
    return found


# The cell of a periodic array


@dataclass(frozen=True)
class CellRow:
    """Thresholds in a periodic cell of an edge."""

    edge: float
    values: dict[str, float]


def periodic_rows(case: Case, edges: Iterable[float], spacing: float = 1.0 / 16.0) -> list[CellRow]:
    """Trace a case in periodic cells with the same spacing."""
    rows = []
    for edge in edges:
        found = traced(case, cb.Periodic(cell=edge, grid=2 * round(0.5 * edge / spacing)))
        rows.append(CellRow(edge, {item.name: item.value for item in found.thresholds}))
    return rows


def limit(rows: Sequence[CellRow], name: str) -> float:
    """Value at infinite L from the last two cells, if what the images change falls as L⁻³."""
    (a, x), (b, y) = ((row.edge**-3, row.values[name]) for row in rows[-2:])
    return (y * a - x * b) / (a - b)


# Costs


@dataclass(frozen=True)
class Cost:
    """What a trace in a periodic cell takes at a grid.

    Attributes
    ----------
    grid : int
    points : int
    typical, most : float
        Median and largest number of pairs of transforms of the points away from events.
    near : float
        Median of those within two points of an event.
    seconds : float
        Of the trace.
    memory : float
        Largest memory of the process in GiB.
    """

    grid: int
    points: int
    typical: float
    most: float
    near: float
    seconds: float
    memory: float


def cost(case: Case, edge: float, grid: int) -> Cost:
    """Trace a case in a periodic cell; the memory is that of the whole process so far."""
    curves = LatticeCurves(case.contact, cb.Periodic(edge, grid))
    began = time.perf_counter()
    track = curves.track(Request(1e-6, target=case.max_load))
    seconds = time.perf_counter() - began
    marks = [mark.row for mark in track.marks]
    pairs = track.column("fft_pairs")
    away = [min((abs(k - mark) for mark in marks), default=9) > 2 for k in range(len(pairs))]
    ordinary, others = pairs[np.array(away)], pairs[~np.array(away)]
    return Cost(
        grid,
        len(pairs),
        float(np.median(ordinary)),
        float(ordinary.max()),
        float(np.median(others)),
        seconds,
        largest_memory(),
    )


def largest_memory() -> float:
    """Largest memory of this process so far, in GiB."""
    status = Path("/proc/self/status")
    if status.exists():  # unlike getrusage it does not count what the parent process had
        return next(int(line.split()[1]) / 2**20 for line in status.read_text().splitlines() if "VmHWM" in line)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**30 if sys.platform == "darwin" else 2**20)


def costs(case: Case, edge: float, sizes: Iterable[int]) -> list[Cost]:
    """`cost` at every grid, each in a process of its own."""
    found = []
    for grid in sizes:
        words = [sys.executable, __file__, "--cost", str(CASES.index(case)), str(edge), str(grid)]
        printed = subprocess.run(words, check=True, capture_output=True, text=True).stdout
        found.append(Cost(**json.loads(printed)))
    return found


# Output


def report_traces(case: Case, rows: Sequence[Trace]) -> str:
    """True errors, estimates and rates of the thresholds of a case."""
    names = [name for name in exact_thresholds(case) if any(row.error(name) is not None for row in rows)]
    head = ("threshold", "exact", *(f"{row.grid}²: error (estimate)" for row in rows), "rate")
    lines = []
    for name in names:
        found = {row.grid: item for row in rows for item in row.thresholds if item.name == name}
        errors = [
            f"{found[row.grid].error:.1e} ({found[row.grid].estimate:.1e})" if row.grid in found else "–"
            for row in rows
        ]
        known = [
            (row.spacing, found[row.grid].error) for row in rows if row.grid in found and found[row.grid].error > 1e-6
        ]
        slope = f"{rate(*zip(*known, strict=True)):.1f}" if len(known) > 2 else ""
        lines.append([f"`{name}`", f"{exact_thresholds(case)[name]:.6f}", *errors, slope])
    times = [f"{row.seconds:.1f} s, {row.points} points, {row.status}" for row in rows]
    lines.append(["time of the trace", "", *times, ""])
    return f"**{case.name}**, free space, L = {case.cell:g}\n\n{table(head, lines)}"


def report_honesty(title: str, ratios: Sequence[float]) -> str:
    """How many estimates hold, and how large they are."""
    values = np.array(ratios)
    held = f"{(values <= 1.0).sum()} of {len(values)}"
    quantiles = ", ".join(f"{np.quantile(values, share):.2g}" for share in (0.1, 0.5, 0.9))
    return (
        f"{title}: true error within the estimate: {held}; largest ratio {values.max():.2g}; "
        f"ratios at 10, 50 and 90 %: {quantiles}"
    )


def report_states(rows: Sequence[StateError]) -> str:
    """The largest ratio of every case, grid and quantity."""
    lines = []
    for key, group in itertools.groupby(rows, lambda row: (row.case, row.grid)):
        members = list(group)
        texts = []
        for name in ("displacement", "contact_radius", "central_gap"):
            own = [row for row in members if row.quantity == name]
            worst = max(own, key=lambda row: row.ratio, default=None)
            texts.append(f"{worst.error:.1e} ({worst.estimate:.1e})" if worst is not None else "–")
        lines.append([key[0], f"{key[1]}²", *texts])
    head = ("case", "grid", "displacement: error (estimate)", "contact radius", "central gap")
    return "Single states at given loads; of each case that with the largest ratio\n\n" + table(head, lines)


def report_cells(case: Case, rows: Sequence[CellRow]) -> str:
    """Thresholds in periodic cells and their limits."""
    names = [name for name in exact_thresholds(case) if all(name in row.values for row in rows)]
    head = ("threshold", *(f"L = {row.edge:g}" for row in rows), "extrapolated in 1/L³", "axisymmetric")
    lines = [
        [
            f"`{name}`",
            *(f"{row.values[name]:.5f}" for row in rows),
            f"{limit(rows, name):.5f}",
            f"{exact_thresholds(case)[name]:.5f}",
        ]
        for name in names
    ]
    return f"**{case.name}**, periodic cells\n\n{table(head, lines)}"


def report_costs(rows: Sequence[Cost]) -> str:
    """Pairs for a point, time and memory against the grid."""
    lines = []
    for k, row in enumerate(rows):
        growth = f"{row.typical / rows[k - 1].typical:.2f}" if k else ""
        lines.append(
            [
                f"{row.grid}²",
                str(row.points),
                f"{row.typical:.0f}",
                growth,
                f"{row.most:.0f}",
                f"{row.near:.0f}",
                f"{row.seconds:.1f} s",
                f"{row.memory:.2f} GiB",
            ]
        )
    head = ("grid", "points", "pairs a point: median", "growth", "largest", "near events: median", "time", "memory")
    return table(head, lines)


COLOURS = {"squeeze_out_load": BLUE, "wetting_load": ORANGE, "pull_off_load": GREEN}
MARKERS = dict(zip((case.name for case in CASES), "oDs", strict=True))


def draw(
    results: dict[str, list[Trace]],
    plain: dict[str, list[Trace]],
    cells: Sequence[CellRow],
    spent: Sequence[Cost],
) -> Figure:
    """Errors against spacing and time, thresholds against the periodic cell, pairs against the grid.

    Parameters
    ----------
    results, plain : dict
        Traces of every case on grids and by the axisymmetric model.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2 * WIDTH, 4.9), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(2, 2)
        _draw_errors(panels[0, 0], results, "spacing")
        _draw_errors(panels[0, 1], plain, "seconds", markerfacecolor="white", linestyle=":")
        _draw_errors(panels[0, 1], results, "seconds")
        kinds: dict[str, dict[str, Any]] = {"grid": {}, "axisymmetric": {"markerfacecolor": "white", "linestyle": ":"}}
        for kind, look in kinds.items():
            panels[0, 1].plot([], [], color="0.3", marker="o", markersize=4.0, linewidth=1.0, label=kind, **look)
        panels[0, 1].legend(*(items[-2:] for items in panels[0, 1].get_legend_handles_labels()))
        _draw_cells(panels[1, 0], cells)
        _draw_costs(panels[1, 1], spent)
        for axes, letter in zip(panels.flat, "abcd", strict=True):
            axes.set_title(f"({letter})", loc="left", fontsize=8.5)
    return figure


def _draw_errors(axes: Axes, results: dict[str, list[Trace]], against: str, **look: Any) -> None:
    for case in CASES:
        for name, colour in COLOURS.items():
            rows = [(getattr(row, against), row.error(name)) for row in results[case.name]]
            known = [(x, error / max(1.0, abs(exact_thresholds(case)[name]))) for x, error in rows if error is not None]
            if known:
                law = f"{case.law}, $\\mu_T = {case.tabor:g}$: {name.removesuffix('_load').replace('_', '-')}"
                style: dict[str, Any] = {"marker": MARKERS[case.name], "markersize": 4.0, "linewidth": 1.0, **look}
                axes.plot(*zip(*known, strict=True), color=colour, label=law, **style)
    axes.set(xscale="log", yscale="log", ylabel="Relative error of the load")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if against == "spacing" else (1.0,)))
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("Spacing of the nodes" if against == "spacing" else "Time of the whole trace (s)")
    if against == "spacing":
        low, high = axes.get_xlim()
        line = np.array([0.02, 0.4])
        axes.plot(line, 1e-2 * (line / line[-1]) ** 2, color=GREY, linewidth=0.7, linestyle=":", label="second order")
        axes.set_xlim(low, high)
        axes.legend(fontsize=5.5)


def _draw_cells(axes: Axes, rows: Sequence[CellRow]) -> None:
    exact = exact_thresholds(GAUSS)
    inverse = np.array([row.edge**-3 for row in rows]) * 1e3
    for name, marker in (("squeeze_out_load", "o"), ("wetting_load", "D")):
        values = np.array([row.values[name] for row in rows])
        style: dict[str, Any] = {"color": COLOURS[name], "markersize": 4.0}
        axes.plot(
            inverse,
            values,
            marker=marker,
            linestyle="none",
            label=name.replace("_", "-").removesuffix("-load"),
            **style,
        )
        axes.plot([0.0, inverse[-1], inverse[-2]], [limit(rows, name), *values[-1:-3:-1]], linewidth=0.7, color=GREY)
        axes.plot([0.0], [exact[name]], marker="x", clip_on=False, zorder=4, **style)
    axes.plot([], [], color="0.3", marker="x", linestyle="none", markersize=4.0, label="axisymmetric")
    axes.set(xlabel="$10^3/L^3$ of the periodic cell", ylabel="Load of the fold")
    axes.set_xlim(0.0)
    axes.legend()


def _draw_costs(axes: Axes, spent: Sequence[Cost]) -> None:
    sizes = [row.grid for row in spent]
    axes.plot(sizes, [row.typical for row in spent], color=BLUE, marker="o", markersize=4.0, label="median")
    axes.plot(
        sizes,
        [row.most for row in spent],
        color=BLUE,
        marker="o",
        markersize=4.0,
        linestyle=":",
        markerfacecolor="white",
        label="largest",
    )
    axes.plot(sizes, [row.near for row in spent], color=ORANGE, marker="D", markersize=4.0, label="near events: median")
    axes.set(xscale="log", xlabel="Nodes along the cell", ylabel="Pairs of transforms a point")
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    axes.set_ylim(0.0)
    axes.legend()


def known(value: Any) -> Any:
    """A value for JSON, which has no infinity: None for an error that is not known."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--finest", type=int, default=256, help="largest grid of the traces (default: %(default)s)")
    parser.add_argument("--large", action="store_true", help="costs up to 2048²")
    parser.add_argument("--stiff", action="store_true", help="trace at μ_T = 4, too")
    parser.add_argument("--figure", default=str(FIGURE), metavar="FILE", help="where to draw (default: %(default)s)")
    parser.add_argument("--json", metavar="FILE", help="write all numbers to a file")
    parser.add_argument("--cost", nargs=3, metavar=("CASE", "EDGE", "GRID"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.cost:
        case, edge, grid = given.cost
        print(json.dumps(asdict(cost(CASES[int(case)], float(edge), int(grid)))))
        return
    print(", ".join(f"{name} {value}" for name, value in machine().items()), end="\n\n")
    results: dict[str, list[Trace]] = {}
    states: list[StateError] = []
    for case in CASES:
        results[case.name] = []
        if case is not GAUSS_STIFF or given.stiff:
            sizes = grids(case, given.finest)
            results[case.name] = [traced(case, cb.FreeSpace(cell=case.cell, grid=grid)) for grid in sizes]
            print(report_traces(case, results[case.name]), end="\n\n", flush=True)
        states += [row for grid in grids(case, given.finest) for row in state_errors(case, grid)]
    print(report_honesty("Thresholds", [t.ratio for rows in results.values() for row in rows for t in row.thresholds]))
    print(report_honesty("Single states", [row.ratio for row in states]), end="\n\n")
    print(report_states(states), end="\n\n")
    cells = periodic_rows(GAUSS, (8.0, 10.0, 12.0, 16.0))
    print(report_cells(GAUSS, cells), end="\n\n", flush=True)
    spent = costs(GAUSS, 10.0, (128, 256, 512, 1024, 2048) if given.large else (64, 128, 256, 512))
    print(report_costs(spent))
    plain = {case.name: without_grid(case) if results[case.name] else [] for case in CASES}
    draw(results, plain, cells, spent).savefig(given.figure, dpi=200)
    if given.json:
        numbers = {
            "machine": dict(machine()),
            "traces": {name: [asdict(row) for row in rows] for name, rows in results.items()},
            "states": [{name: known(value) for name, value in asdict(row).items()} for row in states],
            "cells": [asdict(row) for row in cells],
            "costs": [asdict(row) for row in spent],
        }
        Path(given.json).write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
