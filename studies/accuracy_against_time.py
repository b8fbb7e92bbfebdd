"""What more digits cost: true and estimated errors of the thresholds against the time of the trace, for three laws.

    python studies/accuracy_against_time.py    # a table, and docs/figures/accuracy_against_time.png; half a minute

The true error is the difference from a trace with accuracy 1e-12. Times are those of one BLAS thread if the environment
says so: OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

import contbranch as cb

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "accuracy_against_time.png"
ACCURACIES = tuple(10.0**-digits for digits in range(3, 12))
REFERENCE = 1e-12
LAWS = {
    "Gauss repulsion, $\\mu_T = 4$": cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1),
    "Exponential attraction, $\\mu_T = 1$": cb.Contact.reduced(cb.Exponential, tabor=1.0),
    "Van der Waals attraction, $\\mu_T = 1$": cb.Contact.reduced(cb.VanDerWaals, tabor=1.0),
}
COLOURS, MARKERS = ("#0072B2", "#D55E00", "#009E73"), "osD"
ESTIMATED: Final[Any] = {"markersize": 4.5, "markerfacecolor": "white", "linewidth": 0.8, "linestyle": ":"}
STYLE: Final[Any] = {
    "font.size": 8.0,
    "legend.fontsize": 7.5,
    **{f"{axis}tick.direction": "in" for axis in "xy"},
    "xtick.top": True,
    "ytick.right": True,
}


@dataclass(frozen=True)
class Measurement:
    """One trace: the accuracy asked for, the largest errors of its thresholds, and its time.

    Errors are relative to max(1, |value|) in reduced units, as `accuracy` is.

    Attributes
    ----------
    accuracy : float
    true_error : float
        Largest difference from the reference, over all thresholds.
    estimated_error : float
        Largest error estimate, over all named folds and touches.
    seconds : float
    """

    accuracy: float
    true_error: float
    estimated_error: float
    seconds: float


def measure(contact: cb.Contact, accuracies: tuple[float, ...] = ACCURACIES, repetitions: int = 5) -> list[Measurement]:
    """Trace a contact in reduced units at several accuracies; of the repetitions the best time counts."""
    reference = cb.trace(contact, accuracy=REFERENCE)
    found = []
    for accuracy in accuracies:
        times = []
        for _ in range(repetitions):
            began = time.perf_counter()
            diagram = cb.trace(contact, accuracy=accuracy)
            times.append(time.perf_counter() - began)
        found.append(Measurement(accuracy, true_error(diagram, reference), estimated_error(diagram), min(times)))
    return found


def true_error(diagram: cb.Diagram, reference: cb.Diagram) -> float:
    """Largest difference of the thresholds of two diagrams.

    Raises
    ------
    ValueError
        If they do not have the same thresholds.
    """
    if set(diagram.thresholds) != set(reference.thresholds):
        raise ValueError(f"thresholds {sorted(diagram.thresholds)} are not {sorted(reference.thresholds)}")
    pairs = ((value, reference.thresholds[name]) for name, value in diagram.thresholds.items())
    return max(abs(value - exact) / max(1.0, abs(exact)) for value, exact in pairs)


def estimated_error(diagram: cb.Diagram) -> float:
    """Largest error estimate of the folds and touches that define thresholds."""
    events = [event for event in diagram.events if event.name or event.kind == "touch"]
    return max(error / max(1.0, abs(getattr(event, name))) for event in events for name, error in event.error.items())


def draw(measurements: dict[str, list[Measurement]]) -> Figure:
    """Errors against time, both logarithmic: full symbols for true errors, empty ones for estimates."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.6, 3.4), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        _draw_errors(axes, measurements)
        kinds = [
            Line2D([], [], color="0.3", marker="o", markersize=4.5, linewidth=1.0, label="true"),
            Line2D([], [], color="0.3", **ESTIMATED, marker="o", label="estimated"),
        ]
        handles = [*axes.get_legend_handles_labels()[0], *kinds]
        figure.legend(handles=handles, loc="outside upper center", ncols=2, frameon=False)
    return figure


def _draw_errors(axes: Axes, measurements: dict[str, list[Measurement]]) -> None:
    for (name, rows), colour, marker in zip(measurements.items(), COLOURS, MARKERS, strict=True):
        seconds = [row.seconds for row in rows]
        errors, estimates = [row.true_error for row in rows], [row.estimated_error for row in rows]
        axes.plot(seconds, errors, color=colour, marker=marker, markersize=4.5, linewidth=1.0, label=name)
        axes.plot(seconds, estimates, color=colour, marker=marker, **ESTIMATED)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("Time of the whole trace (s)")
    axes.set_ylabel("Largest error of the thresholds")
    axes.grid(True, which="major", color="0.9", linewidth=0.6)


def main() -> None:
    """Measure, print a table and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", default=str(FIGURE), metavar="FILE", help="where to draw (default: %(default)s)")
    arguments = parser.parse_args()
    measurements = {name: measure(contact) for name, contact in LAWS.items()}
    for name, rows in measurements.items():
        print(name)
        for row in rows:
            print(
                f"  accuracy {row.accuracy:.0e}: true {row.true_error:.1e}, estimated {row.estimated_error:.1e}, "
                f"{row.seconds:.3f} s"
            )
    draw(measurements).savefig(arguments.figure, dpi=200)


if __name__ == "__main__":
    main()
