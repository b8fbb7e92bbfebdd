"""Figure 18: displacement against the load, repulsion.

python studies/paper/fig18.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.output.smooth import smooth_path
from studies.paper.common import COLOURS, DISPLACEMENT, LOAD, TOP, Array, Result, Statement, panels, run, solved, traced

TABORS = (4.0, 1.0, 0.25)


def film(law: str, tabor: float, top: float = 60.0) -> tuple[Array, Array]:
    """Load and displacement of a rigid tip without contact: d ≪ 0 there."""
    rows = traced(law, tabor, -1, top).branches[0]
    kept = (rows.displacement < -2.0 / tabor) & (rows.load > 1e-4) & (rows.contact_radius == 0.0)
    return rows.load[kept], rows.displacement[kept]


def decay(law: str, tabor: float, top: float = 60.0) -> float:
    """ζ μ_T of F ∝ exp(d/ζ) (exponential) or exp(−d²/ζ²) (Gauss), where the tip hovers far from touch."""
    load, d = film(law, tabor, top)
    slope = np.polyfit(d if law == "exponential" else d**2, np.log(load), 1)[0]
    return float(tabor / slope) if law == "exponential" else float(tabor / np.sqrt(-slope))


def make(fast: bool = False) -> Result:
    """Draw the curves; how does the load grow while the tip hovers?"""
    top = TOP if fast else 60.0
    with panels(height=3.2) as (figure, axes):
        force = np.geomspace(0.01, 60.0, 200)
        axes.plot(force, np.cbrt(0.75 * force) ** 2, color="0.7", lw=2.4, label="Hertz, DMT")
        above = np.linspace(2.0 * np.pi, 60.0, 300)
        axes.plot(above, np.cbrt(0.75 * (above - 2.0 * np.pi)) ** 2, color="0.7", lw=2.4)
        for law, dashes in (("exponential", "-"), ("Gauss", (0, (5, 1.5)))):
            for tabor in TABORS:
                rows = traced(law, tabor, -1, top).branches[0]
                label = rf"{law}, $\mu_T = {tabor:g}$"
                path = smooth_path(rows.load, rows.displacement, bounded=False)
                axes.plot(*path, color=COLOURS[tabor], ls=dashes, label=label)
        axes.set(xlabel=LOAD, ylabel=DISPLACEMENT, xlim=(0.0, 20.0), ylim=(-2.0, 6.0))
        axes.legend(loc="lower right")
    largest = 60.0
    cases = [(law, tabor) for law in ("exponential", "Gauss") for tabor in (4.0, 1.0)]
    # both loads of a contact one after the other, of one curve
    spread, small = np.array([[solved(*case, load, -1).displacement for load in (largest, 1.0)] for case in cases]).T
    lengths = {(law, tabor): decay(law, tabor, top) for law, tabor in cases}
    statements = [
        Statement(
            "the displacement is insensitive to potential and $\\mu_T$ unless the load is small",
            "Fig. 18",
            f"spread over $\\mu_T$ = 1 and 4 and both models: {np.ptp(spread):.3f} of {np.mean(spread):.2f} "
            f"at $F_N$ = {largest:g}, "
            f"{np.ptp(small):.3f} of {np.mean(small):.2f} at 1",
            np.ptp(spread) / np.mean(spread) < 0.02 < np.ptp(small) / abs(np.mean(small)),
        ),
        Statement(
            "at small loads $F_N \\propto \\exp(-d/\\zeta)$ (exponential), with $\\zeta \\propto 1/\\mu_T$",
            "after Fig. 19",
            "$\\exp(+d/\\zeta)$, as $d$ is indentation; $\\zeta\\mu_T$ = "
            + " and ".join(f"{lengths['exponential', t]:.3f} ($\\mu_T = {t:g}$)" for t in (4.0, 1.0)),
            False,
            "misprint",
        ),
        Statement(
            "$F_N \\propto \\exp(-d^2/\\zeta^2)$ (Gauss), with $\\zeta \\propto 1/\\mu_T$, to leading order",
            "after Fig. 19",
            "$\\zeta\\mu_T$ = "
            + " and ".join(f"{lengths['Gauss', t]:.3f} ($\\mu_T = {t:g}$)" for t in (4.0, 1.0))
            + f"; $\\sqrt2$ = {np.sqrt(2.0):.3f} for a rigid tip",
            all(abs(lengths["Gauss", t] / np.sqrt(2.0) - 1.0) < 0.1 for t in (4.0, 1.0)),
        ),
    ]
    caption = (
        "Displacement against the load for repulsion; grey: the square of the contact radius of Hertz (upper) and DMT."
    )
    return Result("fig18", "Displacement against the load, repulsion", caption, figure, [], statements)


if __name__ == "__main__":
    run(make, __doc__)
