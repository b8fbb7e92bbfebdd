"""Table 1: thresholds of repulsive contacts, and power laws fitted next to the wetting.

python studies/paper/table1.py [--fast] [--output DIR]
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import least_squares

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.results.diagram import LocalExponent
from studies.kappa import TABLE, WINDOWS, Printed, local_exponent, matching_windows, normal_form, refitted, windowed
from studies.paper.common import TOP, Array, Finding, Result, Statement, panels, run, solved, traced

# Printed F_sq, in the order of TABLE; elsewhere it is F_sw.
SQUEEZED = {("Gauss, wetting", 0.0625): 6.30, ("Gauss, wetting", 0.25): 6.44, ("Gauss, wetting", 1.0): 8.40,
            ("Gauss, wetting", 4.0): 86.0}  # fmt: skip
# Ends of the windows of excess loads over which all four numbers of (54) are fitted at once.
STARTS, STOPS = (1e-3, 1e-2, 1e-1), (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)


def law(row: Printed) -> str:
    """The law's name."""
    return row.name.split(",")[0]


def digits(value: float, zeros: float = 0.0) -> float:
    """Half a unit of the last digit printed; `zeros` is printed with two decimals, as are those of its size."""
    text = f"{value:.10g}"
    return 0.5 * 10.0 ** -max(2 if value == zeros or value < 10.0 else 0, len(text.partition(".")[2]))


@dataclass(frozen=True)
class Fit:
    """(54) with all four numbers free."""

    radius: float
    load: float
    prefactor: float
    kappa: float


@cache
def free_fits(row: Printed, fast: bool = False) -> tuple[Fit, ...]:
    """(54) fitted to exact radii over windows of the excess load, sampled evenly in its logarithm or in the "
    "load itself."""
    form, local = normal_form(row.name, row.tabor), local_exponent(row.name, row.tabor)
    found = []
    for start, stop in itertools.product(STARTS[1:2] if fast else STARTS, STOPS[1::2] if fast else STOPS):
        for sampled in (np.linspace, np.geomspace):
            if stop > local.excess[-1]:
                continue
            excess = sampled(start, stop, 40)
            radius = form.radius + windowed_radius(local, excess)
            guess = windowed(local, start, stop)

            def wrong(p: Array, excess: Array = excess, radius: Array = radius) -> Array:
                return np.asarray(p[0] + p[2] * np.maximum(excess - p[1], 1e-12) ** p[3] - radius)

            best = least_squares(
                wrong,
                [form.radius + 1e-6, 0.0, guess.prefactor, guess.kappa],
                bounds=([0.0, -np.inf, 0.0, 0.1], [np.inf, start, np.inf, 1.0]),
                x_scale=[0.01, 0.1 * start, 0.1, 0.1],
            ).x
            found.append(Fit(float(best[0]), form.load + float(best[1]), float(best[2]), float(best[3])))
    return tuple(found)


def windowed_radius(local: LocalExponent, excess: Array) -> Array:
    """The excess radius at excess loads."""
    logs = np.log(local.excess), np.log(local.order_parameter)
    return np.asarray(np.exp(make_interp_spline(*logs, k=3)(np.log(excess))))


def findings_of(row: Printed, fast: bool = False) -> list[Finding]:
    """The five numbers of a row beside ours."""
    form, local = normal_form(row.name, row.tabor), local_exponent(row.name, row.tabor)
    window, fits = windowed(local, *WINDOWS[1]), free_fits(row, fast)
    refit = refitted(row, *WINDOWS[1])
    limits = traced(law(row), row.tabor, -1, TOP if fast else None).thresholds
    head = f"{law(row)}, $\\mu_T$ = {row.tabor:g}: "
    squeezed = SQUEEZED.get((row.name, row.tabor), row.load)
    own = limits["squeeze_out_load"]
    states = [state for state in solved(law(row), row.tabor, squeezed, -1).states if state.stable("load")]
    late = squeezed > own > form.load + 1e-5 and len(states) == 1 and states[0].contact_radius > 0.0

    def fitted(name: str, value: float, printed: float, half: float) -> tuple[str, str, float]:
        """Window where fits reach the printed value, otherwise the table's caption: its last digit may be "
        "wrong by 4."""
        values = [getattr(fit, name) for fit in fits]
        if hasattr(refit, name):
            values += [getattr(refit, name), getattr(window, name)]
        inside = min(values) - half <= printed <= max(values) + half
        found = f"fits of (54) over windows give {round(min(values), 6):.4g} to {max(values):.4g}"
        if inside:
            return "window", found, abs(printed - value)
        return "last digit", f"{found}; the caption says that the last digit may not be significant", 8.0 * half

    match = matching_windows(row)
    where = f"; of three decades that end at {match[0]:.2g} … {match[1]:.2g} the printed value" if match else ""
    reading = 0.005  # of radii, exponents and prefactors with two decimals
    half_load, half_squeeze = digits(row.load, 8.0), digits(squeezed, 8.4)
    half_kappa, half_c = 0.5 * row.kappa_digit, digits(row.prefactor)
    why_c = fitted("prefactor", window.prefactor, row.prefactor, half_c)
    if row.prefactor < 0.9 * min(*(fit.prefactor for fit in fits), refit.prefactor):
        trend = f"it breaks the column's trend towards $(3/4)^{{1/3}}$ = {np.cbrt(0.75):.3f}"
        why_c = ("misprint", f"{why_c[1].split(';')[0]}; {trend}", np.inf)
    why_squeeze = fitted("load", own, squeezed, half_squeeze)
    if late:
        why_squeeze = (
            "metastability",
            "a load raised in steps: at the printed one, too, the film is gone",
            squeezed - own,
        )
    why_kappa = fitted("kappa", window.kappa, row.kappa, half_kappa)
    ours = f"ours: excess loads of {WINDOWS[1][0]:g} to {WINDOWS[1][1]:g}; "
    why_kappa = (why_kappa[0], f"{ours}{why_kappa[1]}{where}", why_kappa[2])
    why_radius = fitted("radius", form.radius, row.radius, reading)
    why_load = fitted("load", form.load, row.load, half_load)
    return [
        Finding(f"{head}$a_{{sw}}$", "Table 1", row.radius, reading, form.radius, 1e-8, *why_radius),
        Finding(f"{head}$F_{{sw}}$", "Table 1", row.load, half_load, form.load, 1e-6, *why_load),
        Finding(f"{head}$F_{{sq}}$", "Table 1", squeezed, half_squeeze, own, 1e-6, *why_squeeze),
        Finding(f"{head}$\\kappa$", "Table 1", row.kappa, half_kappa, window.kappa, 0.0, *why_kappa),
        Finding(f"{head}$c$", "Table 1", row.prefactor, half_c, window.prefactor, 0.0, *why_c),
    ]


def make(fast: bool = False) -> Result:
    """Compute all rows; draw the printed numbers beside ours."""
    rows = [row for row in TABLE if not fast or row.tabor == 1.0 or row.radius == 0.01]
    findings = [finding for row in rows for finding in findings_of(row, fast)]
    with panels(2) as (figure, (exponents, loads)):
        for name, colour in (("Gauss, wetting", "#D55E00"), ("exponential, touch", "#0072B2")):
            chosen = [row for row in rows if row.name == name]
            tabors = [row.tabor for row in chosen]
            local = [windowed(local_exponent(name, t), *WINDOWS[1]) for t in tabors]
            exponents.errorbar(tabors, [w.kappa for w in local], [w.kappa_error for w in local], color=colour, fmt="o-",
                               ms=4, lw=0.9, capsize=2, label=f"{law(chosen[0])}, window")  # fmt: skip
            exponents.plot(
                tabors, [row.kappa for row in chosen], "x", color=colour, ms=6, label=f"{law(chosen[0])}, Table 1"
            )
            exact = [normal_form(name, t).load for t in tabors]
            label = rf"{law(chosen[0])}, $F_\mathrm{{sw}}$"
            loads.plot(tabors, exact, "o-", color=colour, mfc="none", ms=5, lw=0.9, label=label)
            loads.plot(
                tabors, [row.load for row in chosen], "x", color=colour, ms=5, label=f"{law(chosen[0])}, Table 1"
            )
        loads.axhline(2.0 * np.pi, color="0.6", lw=0.7, ls=":")
        loads.annotate(
            r"$2\pi$", (0.97, 2.0 * np.pi), xycoords=("axes fraction", "data"), va="bottom", ha="right", fontsize=7
        )
        for value, text in ((1 / 2, "1/2"), (1 / 3, "1/3")):
            exponents.axhline(value, color="0.6", lw=0.7, ls=":")
            exponents.annotate(text, (1.005, value), xycoords=("axes fraction", "data"), va="center", fontsize=7)
        exponents.set(
            xscale="log",
            ylim=(0.32, 0.68),
            xlabel=r"Tabor coefficient $\mu_T$",
            ylabel=r"$\kappa$ fitted over a window",
        )
        loads.set(
            xscale="log",
            yscale="log",
            xlabel=r"Tabor coefficient $\mu_T$",
            ylabel=r"load $F_\mathrm{sw}/(R\,|\Delta\gamma|)$",
        )
        exponents.legend()
        loads.legend()
    soft = normal_form("Gauss, wetting", 2.0**-4)
    statements = [
        Statement(
            "$c$ and $F_{sw}$ approach $(3/4)^{1/3}$ and $2\\pi$ for small $\\mu_T$",
            "after (54)",
            f"$F_{{sw}}$ = {soft.load:.5f} at $\\mu_T = 1/16$ ($2\\pi$ = {2 * np.pi:.5f}); $c$ = "
            f"{windowed(local_exponent('Gauss, wetting', 1 / 16), *WINDOWS[1]).prefactor:.4f} ({np.cbrt(0.75):.4f})",
            abs(soft.load - 2.0 * np.pi) < 0.03,
        ),
        Statement(
            "$\\kappa$ changes continuously from 1/2 to 1/3",
            "after (54)",
            "1/2 at every fold and onset; the windowed exponent slides over the crossover",
            False,
            "window: see [kappa](kappa.md)",
        ),
    ]
    caption = (
        "Exponents (a) and wetting loads (b) of Table 1 (crosses) and ours; the bars are half the range of "
        "the local exponent."
    )
    return Result("table1", "Table 1", caption, figure, findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
