"""The whole curve of a rough adhesive contact, and the jumps of its asperities in a cycle of displacement.

    python studies/rough_cycle.py                 # 256² nodes: a report, and docs/figures/rough_cycle.png; some minutes
    python studies/rough_cycle.py --points 128    # the same surface on fewer nodes

A self-affine surface with Gauss attraction, periodic. The curve of equilibria at rising and falling displacement turns
round at every jump of an asperity, so that a cycle passes its stable parts only. What is printed is checked in four
ways: Morse indices by the spectrum of the second variation, V from ∫ F dd, jumps by relaxation, and a whole cycle by
dynamics alone, whose states must lie on the stable parts of the curve. Lengths are in units of the radius that sets the
scales, energies per area in those of the effective modulus times that.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.control import DISPLACEMENT
from contbranch.curve.outcome import RawCurve
from contbranch.curve.paths import CurveWalk
from contbranch.curve.quasi_static import Jump, Leg
from contbranch.curve.trace import Request
from contbranch.models.grid import LatticeCurves
from contbranch.models.grid.equilibria import LatticeProblem
from contbranch.models.grid.landing import land
from contbranch.models.grid.newton import Equilibrium, hold_control
from contbranch.models.grid.observables import cell_fields
from contbranch.output.plot_view import BLUE, GREY, ORANGE, STYLE

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "rough_cycle.png"
ACCURACY = 1e-6
# Two fields agree if no gap differs by more than this part of the law's range.
AGREE = 0.01


def contact(points: int = 256, cell: float = 12.0, seed: int = 1) -> cb.Contact:
    """A self-affine surface (H = 0.8, waves from a quarter of 12 to 12) that attracts a flat over 0.08."""
    surface = cb.HeightMap.self_affine(
        points, cell, 0.8, rms_height=0.5, seed=seed, short_cutoff=3.0, long_cutoff=cell, radius=1.0
    )
    return cb.Contact(tip=surface, interaction=cb.Gauss(work_of_adhesion=0.05, range=0.08), modulus=1.0)


@dataclass(frozen=True)
class Cycle:
    """A traced curve and the quasi-static cycle of displacement on it, in reduced units.

    Attributes
    ----------
    contact : Contact
    curve : RawCurve
    walk : CurveWalk
    legs, jumps : list
    seconds : float
    """

    contact: cb.Contact
    curve: RawCurve
    walk: CurveWalk
    legs: list[Leg]
    jumps: list[Jump]
    seconds: float

    @property
    def problem(self) -> LatticeProblem:
        """The lattice's, in contact."""
        problem = self.walk.track.points[-1].problem
        if not isinstance(problem, LatticeProblem):
            raise TypeError("the curve does not end on the lattice")
        return problem

    @property
    def dissipated(self) -> float:
        """Energy dissipated in the cycle, in the contact's units."""
        lost = sum(jump.begin.state.energy - jump.end.state.energy for jump in self.jumps if jump.end is not None)
        return float(lost) * self.contact.scales.energy

    @property
    def error(self) -> float:
        """Its error estimate."""
        both = sum(
            jump.begin.uncertainty
            + jump.end.uncertainty
            + abs(jump.begin.state.load - jump.end.state.load) * jump.begin.state.error["displacement"]
            for jump in self.jumps
            if jump.end is not None
        )
        return float(both) * self.contact.scales.energy

    def closes(self) -> bool:
        """Whether every jump has ended on the curve."""
        return all(jump.end is not None for jump in self.jumps)


def measure(contact: cb.Contact, max_load: float = 0.3) -> Cycle:
    """Trace a contact up to a load (in its units) beyond which nothing happens, and follow the cycle."""
    began = time.perf_counter()
    request = Request(ACCURACY, DISPLACEMENT, max_load / contact.scales.load)
    route = LatticeCurves(contact, cb.Periodic()).path(request)
    walk = route.walk
    return Cycle(contact, route.curve, walk, list(route.legs), list(route.jumps), time.perf_counter() - began)


def energy_mismatch(cycle: Cycle) -> float:
    """Largest difference of V and ∫ F dd along the curve, by splines through the rows, relative to the range of V."""
    points = cycle.walk.track.points
    seen = np.array([[p.observables[name] for name in ("load", "displacement", "energy")] for p in points])
    steps = np.linalg.norm(np.diff([np.append(p.x, p.parameter) for p in points], axis=0), axis=1)
    kept = np.concatenate([[True], steps > 0.0])
    arcs = np.concatenate([[0.0], np.cumsum(steps)])
    load, displacement, energy = seen[kept].T
    arcs = arcs[kept]
    force, place = CubicSpline(arcs, load), CubicSpline(arcs, displacement)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle, half = 0.5 * (arcs[1:] + arcs[:-1]), 0.5 * np.diff(arcs)
    s = middle[:, None] + half[:, None] * nodes
    work = np.cumsum((force(s) * place(s, 1) * weights).sum(axis=1) * half)
    return float(np.abs(energy[1:] - energy[0] - work).max() / np.ptp(energy))


def indices(cycle: Cycle, count: int) -> list[tuple[int, int, bool]]:
    """Rows, their Morse index under displacement control, and whether the second variation has as many negative modes.

    Rows are taken in the middle between folds: the longest such parts, as many unstable ones as stable ones.
    """
    folds = [0, *sorted(cycle.walk.folds), len(cycle.curve.branch.load) - 1]
    parts = sorted(pairwise(folds), key=lambda pair: pair[0] - pair[1])
    unstable = cycle.walk.unstable
    longest = [pair for pair in parts if unstable[pair[0]] == 0][: count // 2]
    longest += [pair for pair in parts if unstable[pair[0]] > 0][: count - count // 2]
    found = []
    for first, last in sorted(longest):
        row = (first + last) // 2
        expected, point = int(cycle.curve.branch.unstable_displacement[row]), cycle.walk.track.points[row]
        found.append((row, expected, cycle.problem.unstable(point.x, point.parameter) == expected))
    return found


def by_dynamics(cycle: Cycle, steps: int) -> Iterator[tuple[int, float, Equilibrium, float]]:
    """A cycle by relaxation alone: direction, displacement, state, and its distance from the stable parts of the curve.

    The displacement goes up and down in equal steps; every relaxation starts from the state before.
    """
    walk, problem = cycle.walk, cycle.problem.nodes
    low = min(jump.begin.state.displacement for jump in cycle.jumps)
    high = max(jump.begin.state.displacement for jump in cycle.jumps)
    margin = 0.5 * (high - low) / steps
    up = np.linspace(low - margin, high + margin, steps)
    first = walk.track.points[0]
    state = cycle.problem.state(first.x, first.parameter)
    for direction, values in ((1, up), (-1, up[::-1])):
        for value in values:
            hold = hold_control(problem, 0.0, 1.0, float(value))
            with np.errstate(over="ignore", invalid="ignore"):
                state = land(problem, state.u, hold)
            yield direction, float(value), state, distance(cycle, state)


def distance(cycle: Cycle, state: Equilibrium) -> float:
    """Largest difference of a state's gaps from those of the nearest stable one on the curve, in ranges of the law."""
    walk = cycle.walk
    value, values = state.displacement, walk.values
    low, high = np.minimum(values[:-1], values[1:]), np.maximum(values[:-1], values[1:])
    pieces = np.flatnonzero((walk.unstable == 0) & (low < value) & (value <= high))
    loads = np.array([abs(walk.row(k).load - state.load) for k in pieces])
    apart = np.inf
    for piece in pieces[np.argsort(loads)][:2]:
        other = walk.crossing(int(piece), value).place
        apart = min(apart, cycle.problem.away(other, state))
    return apart


def draw(cycle: Cycle, path: Path = FIGURE) -> Figure:
    """The curve with its jumps, and the gap before and after three of them."""
    scales = cycle.contact.scales
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 5.6), layout="constrained")
        FigureCanvasAgg(figure)
        top, bottom = figure.subfigures(2, 1, squeeze=False, height_ratios=(1.25, 1.0)).ravel()
        axes = top.subplots()
        _curve(axes, cycle)
        rising = [(jump.begin, jump.end) for jump in cycle.jumps if jump.direction > 0 and jump.end is not None]
        largest = sorted(rising, key=lambda ends: ends[1].state.energy - ends[0].state.energy)[:3]
        shown = sorted(largest, key=lambda ends: ends[0].state.displacement)
        panels = bottom.subplots(2, 3, squeeze=False)
        image: Any = None
        edge = cycle.problem.setup.edge * scales.in_plane
        for column, (ends, letter) in enumerate(zip(shown, "abc", strict=False)):
            state = ends[0].state
            axes.annotate(
                letter,
                (state.displacement * scales.normal, state.load * scales.load),
                xytext=(4, 4),
                textcoords="offset points",
                fontweight="bold",
            )
            for line, stop in enumerate(ends):
                gap = cell_fields(cycle.problem.nodes, cycle.problem.at(stop.place)).gap * scales.normal
                panel = panels[line, column]
                image = panel.imshow(
                    np.where(gap > 0.0, gap, np.nan).T,
                    origin="lower",
                    extent=(0.0, edge, 0.0, edge),
                    norm=LogNorm(0.01, 2.0, clip=True),
                    cmap="cividis",
                    interpolation="nearest",
                )
                panel.set_facecolor(ORANGE)
                panel.tick_params(labelbottom=line == 1, labelleft=column == 0, which="both", length=2.0)
                panel.set_title(f"{letter}, {'before' if line == 0 else 'after'}", fontsize=7.5, pad=2.0)
        for panel in panels[:, len(shown) :].ravel():
            panel.set_axis_off()
        if image is not None:
            bottom.colorbar(image, ax=panels, label="gap (contact: orange)", extend="both", shrink=0.95)
        figure.savefig(path, dpi=130, metadata={"Software": None})
    return figure


def _curve(axes: Axes, cycle: Cycle) -> None:
    scales, walk = cycle.contact.scales, cycle.walk
    d, load = cycle.curve.branch.displacement * scales.normal, cycle.curve.branch.load * scales.load
    changes = np.flatnonzero(np.diff(walk.unstable > 0)) + 1
    for first, last in pairwise([0, *changes.tolist(), len(walk.unstable)]):
        stable = walk.unstable[first] == 0
        axes.plot(
            d[first : last + 1],
            load[first : last + 1],
            color=BLUE if stable else GREY,
            linestyle="-" if stable else (0, (3, 1.5)),
            linewidth=1.4 if stable else 0.7,
            zorder=3 if stable else 2,
        )
    for jump in cycle.jumps:
        if jump.end is None:
            continue
        x = jump.begin.state.displacement * scales.normal
        ends = [state.load * scales.load for state in (jump.begin.state, jump.end.state)]
        style: Any = {"arrowstyle": "-|>", "mutation_scale": 6.0, "shrinkA": 0.0, "shrinkB": 0.0, "lw": 0.8}
        colour = ORANGE if jump.direction > 0 else "#009E73"
        axes.annotate("", (x, ends[1]), xytext=(x, ends[0]), arrowprops={**style, "color": colour}, zorder=4)
    for label, colour, line in (
        ("stable", BLUE, "-"),
        ("unstable", GREY, (0, (3, 1.5))),
        ("jump on approach", ORANGE, "-"),
        ("jump on retraction", "#009E73", "-"),
    ):
        axes.plot([], [], color=colour, linestyle=line, linewidth=1.0, label=label)
    values = [jump.begin.state.displacement * scales.normal for jump in cycle.jumps]
    if values:
        margin = 0.08 * (max(values) - min(values))
        inside = (d >= min(values) - margin) & (d <= max(values) + margin)
        axes.set_xlim(min(values) - margin, max(values) + margin)
        room = 0.05 * np.ptp(load[inside])
        axes.set_ylim(load[inside].min() - room, load[inside].max() + room)
    axes.set_xlabel("displacement")
    axes.set_ylabel("load")
    axes.legend(loc="best")


def report(cycle: Cycle, checked: int, steps: int) -> Iterator[str]:
    """What was measured, line by line."""
    curve, folds = cycle.curve, cycle.walk.folds
    loads = sum(event.kind == "fold" and event.control == "load" for event in curve.events)
    ups = sum(jump.direction > 0 for jump in cycle.jumps)
    yield f"nodes: {cycle.problem.setup.grid}²; {curve.message or 'complete'}"
    yield (
        f"points: {len(curve.load)}; folds of displacement: {len(folds)}, of load: {loads}; largest index "
        f"{int(curve.unstable_displacement.max())}"
    )
    yield (f"pairs of transforms: {curve.cost.fft_pairs}; {cycle.seconds:.0f} s")
    yield f"jumps: {ups} on approach, {len(cycle.jumps) - ups} on retraction; closed: {cycle.closes()}"
    for jump in cycle.jumps:
        begin, end = jump.begin.state, jump.end.state if jump.end else None
        lost = "" if end is None else f"to load {end.load:.5f}, dissipated {begin.energy - end.energy:.3g} (reduced)"
        yield f"    {jump.direction:+d} displacement {begin.displacement:.5f}, from load {begin.load:.5f} {lost}"
    yield f"dissipated: {cycle.dissipated:.5g} ± {cycle.error:.1g}"
    yield f"V against ∫ F dd: {energy_mismatch(cycle):.2g} of its range"
    rows = indices(cycle, checked)
    yield f"Morse indices that the spectrum confirms: {sum(good for *_, good in rows)} of {len(rows)}: {rows}"
    states = list(by_dynamics(cycle, steps))
    on = sum(apart <= AGREE for *_, apart in states)
    yield f"dynamics: {on} of {len(states)} states on the stable parts, {steps} displacements each way"


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=256, help="nodes along the edge of the cell")
    parser.add_argument("--cell", type=float, default=12.0, help="edge of the cell")
    parser.add_argument("--figure", type=Path, default=FIGURE)
    given = parser.parse_args()
    cycle = measure(contact(given.points, given.cell))
    draw(cycle, given.figure)
    for line in report(cycle, checked=12, steps=60):
        print(line, flush=True)


if __name__ == "__main__":
    main()
