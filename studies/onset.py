"""Is there a Tabor coefficient below which a repulsion is squeezed out continuously? See docs/onset.md.

    python studies/onset.py    # tables, and docs/figures/onset.png; a minute and a half

Measures, for the Gauss and the van der Waals repulsion down to μ_T = 2^-13, how the window of coexisting solutions
closes, and compares it with the perturbation theory of `predicted`. Reduced units throughout.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from scipy.optimize import brentq

import contbranch as cb
from contbranch.contact.interaction_law import Interaction

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[1]))
from studies.near_touch import Side, contact_of, fold_in_contact, softening, touch_side
from studies.power_laws import PowerLaw, fit_power_law, rounded_up

Array = NDArray[np.float64]

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "onset.png"
LAWS: Final = {"Gauss": cb.Gauss, "van der Waals": cb.VanDerWaals}
TABORS = tuple(2.0**-k for k in range(14))
# Shares of the exponential law in a sum with the Gauss law: its pressure in contact, in units of |Δγ|/z0.
PRESSURES = (0.1, 0.03, 0.01, 0.003, 0.001, 0.0003)
# The finer mesh has an error of its own; rounding relative to the film's compliance.
SAFETY, ROUNDING = 3.0, 2e-15

# name of the quantity: (symbol, exponent of μ_T)
QUANTITIES: Final = {
    "window": ("F_sq - F_sw", 3.0),
    "gap": ("g_sq", 0.5),
    "radius": ("a_sw", 2.5),
    "slope": ("-dF/dd at touch", 2.5),
    "fall": ("F_t - F_sw", 7.5),
}


@dataclass(frozen=True)
class Onset:
    """First touch of one repulsion and the two load folds around it, in reduced units.

    Attributes
    ----------
    tabor : float
    values, errors : dict
        For each name in QUANTITIES: load between the folds, central gap at the squeeze-out fold, contact radius at the
        wetting fold, minus the slope dF/dd at first touch (negative where touch lies between displacement folds), load
        between first touch and the wetting fold; and the error estimate of each.
    """

    tabor: float
    values: dict[str, float]
    errors: dict[str, float]

    @property
    def compliance(self) -> float:
        """ε = μ_T^(3/2): elastic answer to the interaction's stiffness, over its range."""
        return float(self.tabor**1.5)


def curvature(law: type[Interaction]) -> float:
    """f''(0) of a law's shape."""
    return float(law(-1.0, 1.0).evaluate(np.zeros(1)).stiffness[0])


def measure(law: type[Interaction], tabor: float) -> Onset:
    """Find first touch and both load folds, with error estimates from finer meshes."""
    apart = touch_side(cb.Contact.reduced(law, tabor=tabor, sign=-1))
    rough = fold_in_contact(apart.graded(apart.problem.equations.mesh.innermost))
    if rough is None:
        raise ValueError(f"the load has no minimum in contact at tabor {tabor:g}")
    touching = apart.graded(rough)
    gap = predicted(law, "gap", tabor)
    coarse = _values(apart, touching, gap, rough)
    fine = _values(apart.finer(), touching.finer(), gap, rough)
    floor = ROUNDING / min(1.0, tabor**1.5)
    errors = {name: SAFETY * abs(fine[name] - coarse[name]) + floor * abs(coarse[name]) for name in coarse}
    return Onset(tabor, coarse, errors)


def _values(apart: Side, touching: Side, gap: float, radius: float) -> dict[str, float]:
    squeezed = apart.fold(0.3 * gap, 3.0 * gap)
    wetted = touching.fold(0.8 * radius, 1.2 * radius)
    fall = -touching.rise(0.0, wetted)
    return {
        "window": apart.rise(0.0, squeezed) + fall,
        "gap": squeezed,
        "radius": wetted,
        "slope": -apart.at(0.0).stiffness,
        "fall": fall,
    }


def predicted(law: type[Interaction], quantity: str, tabor: float) -> float:
    """Leading order in μ_T, for laws with f'(0) = 0 > f''(0); C is `near_touch.softening`.

    Without contact F = F_t + C μ^(3/2) G − π|f''(0)| G² in the gap's G = μ g; with contact F = F_t − C μ^(5/2) a² +
    (4/3) a³.
    """
    c, bend = softening(law(-1.0, 1.0)), abs(curvature(law))
    prefactor = {
        "window": c * c / (4 * np.pi * bend),
        "gap": c / (2 * np.pi * bend),
        "radius": c / 2,
        "slope": c,
        "fall": c**3 / 12,
    }[quantity]
    return float(prefactor * tabor ** QUANTITIES[quantity][1])


def fit(onsets: Sequence[Onset], quantity: str, largest: Sequence[float] = (2**-3, 2**-4, 2**-5, 2**-6)) -> PowerLaw:
    """Exponent, prefactor and first correction of one quantity; each window spans at least two decades of μ_T."""
    return fit_power_law(
        [onset.tabor for onset in onsets],
        [onset.values[quantity] for onset in onsets],
        [onset.errors[quantity] for onset in onsets],
        QUANTITIES[quantity][1],
        largest,
    )


# Laws that push in contact, too: there a critical Tabor coefficient exists


def mixture(pressure: float, tabor: float) -> cb.Contact:
    """Exponential and Gauss repulsion of one range whose pressure in contact is `pressure` · |Δγ|/z0."""
    return contact_of(cb.Exponential(-pressure, 1.0 / tabor) + cb.Gauss(pressure - 1.0, 1.0 / tabor))


def expected_tabor(pressure: float) -> float:
    """(2π p0/C)^(2/3), where dF/dd = 2π p0 μ − C μ^(5/2) at touch vanishes; C is that of the sum of both laws."""
    law = cb.Exponential(-pressure, 1.0) + cb.Gauss(pressure - 1.0, 1.0)
    return float((2 * np.pi * pressure / softening(law)) ** (2 / 3))


def critical_tabor(pressure: float) -> tuple[float, float]:
    """μ_T at which the slope of the load at first touch vanishes, measured, and to leading order."""
    expected = expected_tabor(pressure)

    def slope(logarithm: float) -> float:
        return touch_side(mixture(pressure, float(np.exp(logarithm)))).at(0.0).load_slope

    centre = np.log(expected)
    found = brentq(slope, centre - 0.7, centre + 0.3, xtol=1e-10)
    return float(np.exp(found)), expected


def folds(contact: cb.Contact, accuracy: float = 1e-9) -> int:
    """Number of load folds of a contact, by an ordinary trace."""
    return len(list(cb.trace(contact, accuracy=accuracy, modes=0).folds("load")))


# Tables and figure


def main() -> None:
    """Measure, print tables and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", default=str(FIGURE), metavar="FILE", help="where to draw (default: %(default)s)")
    arguments = parser.parse_args()
    measured: dict[str, list[Onset]] = {}
    for name, law in LAWS.items():
        measured[name] = []
        for tabor in TABORS:
            print(f"{name}, tabor {tabor:g}", file=sys.stderr)
            measured[name].append(measure(law, tabor))
    for name, onsets in measured.items():
        print(f"\n{name} repulsion: C = {softening(LAWS[name](-1.0, 1.0)):.10f}\n")
        print("\n".join(onset_table(onsets)))
        print()
        print("\n".join(law_table(LAWS[name], onsets)))
    criticals = []
    for pressure in PRESSURES:
        print(f"mixture, pressure {pressure:g}", file=sys.stderr)
        criticals.append((pressure, *critical_tabor(pressure)))
    print("\nExponential + Gauss\n")
    print("\n".join(mixture_table(criticals)))
    draw(measured, criticals).savefig(arguments.figure, dpi=200)


def onset_table(onsets: Sequence[Onset]) -> list[str]:
    """The measurements, a row for each second Tabor coefficient."""
    rows = [
        "| μ_T | F_sq − F_sw | g_sq | a_sw | −dF/dd at touch | F_t − F_sw | largest relative error |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for onset in onsets:
        cells = [f"{onset.values[name]:.8e}" for name in QUANTITIES]
        worst = max(onset.errors[name] / abs(onset.values[name]) for name in QUANTITIES)
        power = round(-np.log2(onset.tabor))
        rows.append(f"| {f'2^−{power}' if power else '1'} | {' | '.join(cells)} | {worst:.0e} |")
    return rows


def law_table(law: type[Interaction], onsets: Sequence[Onset]) -> list[str]:
    """Fitted laws against the prediction."""
    rows = [
        "| quantity | exponent: theory | plain fit | with corrections | prefactor: theory | fit | coefficient of ε |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, (symbol, power) in QUANTITIES.items():
        found = fit(onsets, name)
        rows.append(
            f"| {symbol} | {power:g} | {found.plain:.4f} | {found.exponent:.8f} ± {rounded_up(found.exponent_error)} "
            f"| {predicted(law, name, 1.0):.9f} | {found.prefactor:.9f} ± {rounded_up(found.prefactor_error)} "
            f"| {found.first:+.3f} ± {rounded_up(found.first_error)} |"
        )
    return rows


def mixture_table(criticals: Sequence[tuple[float, float, float]]) -> list[str]:
    """Critical Tabor coefficients, measured and to leading order, and the load folds on either side."""
    rows = [
        "| p0 z0/\\|Δγ\\| | μ_T* | (2π p0/C)^(2/3) | load folds at 0.97 μ_T* | at 1.03 μ_T* |",
        "| --- | --- | --- | --- | --- |",
    ]
    for pressure, found, expected in criticals:
        below, above = (folds(mixture(pressure, share * found)) for share in (0.97, 1.03))
        rows.append(f"| {pressure:g} | {found:.7f} | {expected:.7f} | {below} | {above} |")
    return rows


STYLE: Final[Any] = {
    "font.size": 8.0,
    "legend.fontsize": 7.0,
    **{f"{axis}tick.direction": "in" for axis in "xy"},
    "xtick.top": True,
    "ytick.right": True,
}
COLOURS = {"window": "#0072B2", "gap": "#009E73", "radius": "#D55E00", "slope": "#CC79A7"}
SYMBOLS = {
    "window": r"$F_\mathrm{sq}-F_\mathrm{sw}$",
    "gap": r"$g_\mathrm{sq}$",
    "radius": r"$a_\mathrm{sw}$",
    "slope": r"$-\mathrm{d}F/\mathrm{d}d$ at touch",
}


def draw(measured: dict[str, list[Onset]], criticals: Sequence[tuple[float, float, float]]) -> Figure:
    """How the window closes; deviations from the leading order; where a pressure in contact shuts it."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 2.9), layout="constrained")
        FigureCanvasAgg(figure)
        laws, deviations, phases = figure.subplots(1, 3)
        for name, onsets in measured.items():
            _draw_laws(laws, LAWS[name], onsets, hollow=name != "Gauss")
            _draw_deviations(deviations, LAWS[name], onsets, hollow=name != "Gauss")
        _draw_phases(phases, criticals)
        handles = [Line2D([], [], color=COLOURS[name], marker="o", ms=4, lw=1, label=SYMBOLS[name]) for name in SYMBOLS]
        handles += [
            Line2D([], [], color="0.4", marker="o", ms=4, lw=0, label="Gauss"),
            Line2D([], [], color="0.4", marker="o", ms=4, lw=0, mfc="white", label="van der Waals"),
            Line2D([], [], color="0.4", lw=1, label="theory, leading order"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=7, frameon=False, columnspacing=1.2)
        for axes, letter in zip((laws, deviations, phases), "abc", strict=True):
            axes.set_title(f"({letter})", loc="left", fontsize=8)
    return figure


def _draw_laws(axes: Axes, law: type[Interaction], onsets: Sequence[Onset], hollow: bool) -> None:
    tabor = np.array([onset.tabor for onset in onsets])
    for name, colour in COLOURS.items():
        value = np.array([onset.values[name] for onset in onsets])
        theory = [predicted(law, name, t) for t in tabor]
        axes.plot(tabor, theory, color=colour, lw=0.9, ls="--" if hollow else "-")
        axes.plot(tabor[value > 0], value[value > 0], "o", color=colour, ms=3.5, mfc="white" if hollow else colour)
    axes.set(xscale="log", yscale="log", xlabel=r"Tabor coefficient $\mu_T$", ylabel="Reduced units")


def _draw_deviations(axes: Axes, law: type[Interaction], onsets: Sequence[Onset], hollow: bool) -> None:
    epsilon = np.array([onset.compliance for onset in onsets])
    for name, colour in COLOURS.items():
        theory = np.array([predicted(law, name, onset.tabor) for onset in onsets])
        value = np.array([onset.values[name] for onset in onsets])
        error = np.array([onset.errors[name] for onset in onsets]) / theory
        away = np.abs(value / theory - 1)
        shown = value > 0
        axes.errorbar(
            epsilon[shown], away[shown], error[shown], fmt="o", color=colour, ms=3.5, mfc="white" if hollow else colour,
            lw=0.8,
        )  # fmt: skip
    if hollow:
        line = np.array([2e-6, 0.3])
        axes.plot(line, line, color="0.4", lw=0.9, ls=":")
        axes.annotate(r"$\propto\varepsilon$", (2e-4, 2e-4), (3e-4, 4e-5), fontsize=8)
    axes.set(xscale="log", yscale="log", xlabel=r"$\varepsilon=\mu_T^{3/2}$", ylabel="Deviation from leading order")


def _draw_phases(axes: Axes, criticals: Sequence[tuple[float, float, float]]) -> None:
    pressure, found, _ = np.array(criticals).T
    line = np.geomspace(1e-4, 0.15, 40)
    theory = [expected_tabor(p) for p in line]
    axes.plot(line, theory, color="0.4", lw=0.9)
    axes.plot(pressure, found, "o", color="#0072B2", ms=4)
    axes.text(3e-4, 0.5, "coexistence", fontsize=8)
    axes.text(9e-3, 0.012, "continuous\nonset", fontsize=8)
    axes.set(
        xscale="log", yscale="log", xlim=(1e-4, 0.2), ylim=(5e-3, 2.0), ylabel=r"Tabor coefficient $\mu_T$",
        xlabel=r"Pressure in contact $p_0\,z_0/|\Delta\gamma|$",
    )  # fmt: skip


if __name__ == "__main__":
    main()
