"""Figure 17: power laws fitted next to the spontaneous wetting.

python studies/paper/fig17.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.kappa import TABLE, WINDOWS, local_exponent, windowed
from studies.paper.common import COLOURS, LOAD, RADIUS, TOP, Result, Statement, branch, draw_branch, panels, run, traced

TABORS = (1.0, 0.25)


def make(fast: bool = False) -> Result:
    """Draw the Gauss model next to F_sw with our fit over a window and with the fit of Table 1."""
    top = TOP if fast else 12.0
    with panels() as (figure, axes):
        found = {}
        for tabor in TABORS:
            exact = branch("Gauss", tabor, -1, top)
            draw_branch(
                axes,
                exact,
                "radius",
                color=COLOURS[tabor],
                linewidth=2.4,
                alpha=0.5,
                label=rf"Gauss, $\mu_T = {tabor:g}$",
            )
            limits = traced("Gauss", tabor, -1, top).thresholds
            start, least = limits["wetting_load"], limits["wetting_radius"]
            window = windowed(local_exponent("Gauss, wetting", tabor), *WINDOWS[1])
            load = np.linspace(0.0, 12.0 - start, 400)
            axes.plot(start + load, least + window.prefactor * load**window.kappa, color="black", linewidth=0.9)
            row = next(row for row in TABLE if row.name == "Gauss, wetting" and row.tabor == tabor)
            theirs = np.linspace(0.0, 12.0 - row.load, 400)
            axes.plot(
                row.load + theirs, row.radius + row.prefactor * theirs**row.kappa, color="black", linewidth=0.9, ls=":"
            )
            stable = exact.load[exact.stable]
            kept = (stable > start + 0.05) & (stable < 12.0)
            printed = row.radius + row.prefactor * (stable[kept] - row.load) ** row.kappa
            found[tabor] = float(np.abs(printed - exact.radius[exact.stable][kept]).max())
            if tabor == 1.0:
                squeezed = limits["squeeze_out_load"]
                reached = float(exact.at_load(np.array([squeezed]))[0][0])
                axes.annotate(
                    "", (squeezed, reached), (squeezed, 0.0), arrowprops={"arrowstyle": "->", "color": COLOURS[1.0]}
                )
        axes.plot([], [], color="black", linewidth=0.9, label="fitted here")
        axes.plot([], [], color="black", linewidth=0.9, ls=":", label="Table 1")
        axes.set(xlabel=LOAD, ylabel=RADIUS, xlim=(6.0, 12.0), ylim=(0.0, 1.6))
        axes.legend(loc="lower right")
    statements = [
        Statement(
            "the radius follows (54) next to $F_{sw}$",
            "Fig. 17",
            "the fits as printed in Table 1 are within "
            + ", ".join(f"{value:.3f} ($\\mu_T = {tabor:g}$)" for tabor, value in found.items())
            + " of the exact radii from $F_N = F_{sw} + 0.05$ to 12",
            max(found.values()) < 0.05,
        )
    ]
    caption = (
        "Contact radius of the Gauss repulsion next to the spontaneous wetting, with power laws; they end at $a_{sw}$."
    )
    return Result("fig17", "Power laws next to wetting", caption, figure, [], statements)


if __name__ == "__main__":
    run(make, __doc__)
