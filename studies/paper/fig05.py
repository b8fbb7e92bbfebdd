"""Figure 5: pressures at zero load, exponential model.

python studies/paper/fig05.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import contbranch as cb

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import DISTANCE, PRESSURE, Array, Finding, Result, Statement, contact, panels, run, solved

TABORS = (0.25, 4.0)


def make(fast: bool = False) -> Result:
    """Draw the pressures of the wall and of adhesion, and their sum, for both Tabor coefficients."""
    findings, shares = [], {}
    with panels(2) as (figure, both):
        for axes, tabor in zip(both, TABORS, strict=True):
            state = solved("exponential", tabor, 0.0)
            a, r = state.contact_radius, state.r
            adhesion = state.pressure - state.wall_pressure
            axes.axhline(0.0, color="0.6", linewidth=0.6)
            axes.plot(r, state.wall_pressure, color="0.6", linewidth=2.2, label="wall")
            axes.plot(r, adhesion, color="0.75", linewidth=2.2, label="adhesion")
            axes.plot(r, state.pressure, color="black", linewidth=1.0, label="net")
            axes.axvline(a, color="0.3", linewidth=0.6, linestyle=":")
            axes.annotate("$a_c$", (a, axes.get_ylim()[1]), xytext=(3, -12), textcoords="offset points", fontsize=8)
            axes.set(xlabel=DISTANCE, ylabel=PRESSURE, xlim=(0.0, 4.0))
            axes.annotate(rf"$\mu_T = {tabor:g}$", (0.97, 0.94), xycoords="axes fraction", ha="right", va="top")
            law = contact("exponential", tabor).interaction
            findings.append(
                Finding(
                    rf"$p_{{adh}}(r < a_c)$, $\mu_T = {tabor:g}$",
                    "(32)",
                    -tabor,
                    1e-9,
                    float(law.evaluate(np.zeros(1)).pressure[0]),
                )
            )
            shares[tabor] = outside(law, state, r, a)
        both[1].legend(loc="lower right")
    statements = [
        Statement(
            "adhesion spreads to radii clearly exceeding $a_c$ for $\\mu_T = 1/4$ and is localized near $a_c$ for 4",
            "Fig. 5",
            "; ".join(
                f"$\\mu_T = {tabor:g}$: half of the adhesive load outside the contact lies beyond {half:.2f} $a_c$, "
                f"{share:.0%} of all of it outside"
                for tabor, (share, half) in shares.items()
            ),
            shares[0.25][1] > 1.3 and shares[4.0][1] < 1.05,
        )
    ]
    return Result(
        "fig05",
        "Pressure at zero load",
        "Pressure of the wall, of adhesion, and their sum (black) at zero load, exponential model.",
        figure,
        findings,
        statements,
    )


def outside(law: cb.Interaction, state: cb.State, r: Array, a: float) -> tuple[float, float]:
    """Share of the adhesive load outside the contact, and the radius, in a_c, beyond which half of that lies."""
    square = r[r >= a] ** 2
    pressure = law.evaluate(state.gap[r >= a]).pressure
    pieces = np.append(0.0, np.cumsum(np.pi * 0.5 * (pressure[1:] + pressure[:-1]) * np.diff(square)))
    inside = float(law.evaluate(np.zeros(1)).pressure[0]) * np.pi * a**2
    return float(pieces[-1] / (pieces[-1] + inside)), float(np.sqrt(np.interp(0.5, pieces / pieces[-1], square))) / a


if __name__ == "__main__":
    run(make, __doc__)
