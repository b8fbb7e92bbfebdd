"""Figure 7: pressures at zero load, Gauss model.

python studies/paper/fig07.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import contbranch as cb

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import COLOURS, DISTANCE, PRESSURE, Result, Statement, panels, run, solved

TABORS = (0.25, 4.0)


def rim(state: cb.State) -> tuple[float, float]:
    """Exponent n and prefactor of p_wall ∝ (a − r)^n: local ones between points of the profile, taken to the rim.

    Corrections are of the order of √(a − r).
    """
    depth = 1.0 - state.r / state.contact_radius
    near = depth > 0.0
    x, y = np.log(depth[near])[-4:], np.log(state.wall_pressure[near])[-4:]
    root = np.sqrt(depth[near])[-4:]
    middle = 0.5 * (root[1:] + root[:-1])
    power = np.polyfit(middle, np.diff(y) / np.diff(x), 1)[1]
    return float(power), float(np.exp(np.polyfit(root, y - 0.5 * x, 2)[2]))


def make(fast: bool = False) -> Result:
    """Draw the pressures of the wall and of adhesion; look at the rim."""
    states = {tabor: solved("Gauss", tabor, 0.0) for tabor in TABORS}
    with panels() as (figure, axes):
        axes.axhline(0.0, color="0.7", linewidth=0.8)
        for (tabor, state), dashes in zip(states.items(), ("-", "--"), strict=True):
            style = {"color": COLOURS[tabor], "linestyle": dashes}
            adhesion = state.pressure - state.wall_pressure
            axes.plot(state.r, state.wall_pressure, label=rf"$\mu_T = {tabor:g}$", **style)
            axes.plot(state.r, adhesion, **style)
            axes.plot(state.contact_radius, 0.0, "o", color=COLOURS[tabor], markersize=3.5, clip_on=False)
        axes.set(xlabel=DISTANCE, ylabel=PRESSURE, xlim=(0.0, 5.0))
        axes.legend(loc="lower right")
    inside = max(float(np.abs((s.pressure - s.wall_pressure)[s.r < s.contact_radius]).max()) for s in states.values())
    ends = {(law, tabor): rim(solved(law, tabor, 0.0)) for law in ("Gauss", "exponential") for tabor in TABORS}
    exponential = solved("exponential", 4.0, 0.0)
    at_rim = float(np.interp(exponential.contact_radius * (1.0 + 1e-9), exponential.r, exponential.pressure))
    gauss = max(abs(float(np.interp(s.contact_radius * (1.0 + 1e-9), s.r, s.pressure))) for s in states.values())
    statements = [
        Statement("no adhesive pressure inside the contact", "Fig. 7", f"at most {inside:.1e}", inside < 1e-9),
        Statement(
            "at $r = a_c$ the total pressure vanishes, but is finite in the exponential model",
            "Fig. 7",
            f"{gauss:.1e}; exponential, $\\mu_T = 4$: {at_rim:.3f}",
            gauss < 0.02 and abs(at_rim + 4.0) < 0.05,
        ),
        Statement(
            "the wall's pressure has a finite slope at $a_c$ in the Gauss model and diverges in the exponential model",
            "Fig. 7",
            "; ".join(
                f"{law}, $\\mu_T = {tabor:g}$: $p_c \\propto (a_c - r)^{{{power:.2f}}}$"
                for (law, tabor), (power, _) in ends.items()
            )
            + ": in both models a square root, with infinite slope; its prefactor in the Gauss model is "
            + " and ".join(f"{ends['Gauss', t][1] / ends['exponential', t][1]:.2f} ($\\mu_T = {t:g}$)" for t in TABORS)
            + " of that in the exponential model",
            False,
            "lattice: the square root is steep only within a spacing",
        ),
    ]
    caption = (
        "Pressure at zero load, Gauss model: that of the wall is positive, that of adhesion negative; dots: contact "
        "radii. The paper does not say which two Tabor coefficients it shows; these are those of its "
        "neighbouring figures."
    )
    return Result("fig07", "Pressure in the Gauss model", caption, figure, [], statements)


if __name__ == "__main__":
    run(make, __doc__)
