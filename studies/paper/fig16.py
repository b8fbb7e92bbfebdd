"""Figure 16: contact radius against the load, repulsion.

python studies/paper/fig16.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import (
    COLOURS,
    LOAD,
    RADIUS,
    TOP,
    Result,
    Statement,
    branch,
    dmt_branch,
    draw_branch,
    panels,
    run,
    traced,
)

TABORS = (4.0, 1.0, 0.25)


def make(fast: bool = False) -> Result:
    """Draw both models for three Tabor coefficients; where are transitions continuous?"""
    with panels(2, height=3.0) as (figure, both):
        for axes, (low, high) in zip(both, ((5.5, 20.0), (10.0, 500.0)), strict=True):
            hertz = dmt_branch(high, -1)
            axes.plot(hertz.load, hertz.radius, color="0.6", lw=2.0, ls="--", label="DMT")
            for law, dashes in (("exponential", "-"), ("Gauss", (0, (5, 1.5)))):
                for tabor in TABORS:
                    found = branch(law, tabor, -1, TOP)
                    label = rf"{law}, $\mu_T = {tabor:g}$"
                    draw_branch(
                        axes, found, "radius", color=COLOURS[tabor], linestyle=dashes, linewidth=1.2, label=label
                    )
                    squeezed = traced(law, tabor, -1, TOP).thresholds["squeeze_out_load"]
                    if law == "Gauss" and low < squeezed < high and tabor > 0.5:
                        arrow = {"arrowstyle": "->", "color": COLOURS[tabor]}
                        reached = float(found.at_load(np.array([squeezed]))[0][0])
                        axes.annotate("", (squeezed, reached), (squeezed, 0.0), arrowprops=arrow)
            axes.set(xlabel=LOAD, ylabel=RADIUS, xlim=(low, high), ylim=(0.0, None))
        both[0].set_ylim(0.0, 2.2)
        both[1].set(xscale="log", ylim=(0.0, 6.5))
        both[1].legend(loc="upper left")
    limits = {(law, t): traced(law, t, -1, TOP).thresholds for law in ("exponential", "Gauss") for t in TABORS}
    gaps = {key: found["squeeze_out_load"] - found["wetting_load"] for key, found in limits.items()}
    folds = {key: len(list(traced(*key, -1, TOP).folds("load"))) for key in limits}
    statements = [
        Statement(
            "in the exponential model the transition is continuous, $F_{sw} = F_{sq}$",
            "Fig. 16",
            f"no fold of the load for $\\mu_T$ = {', '.join(f'{t:g}' for t in TABORS)}; its energy is convex "
            f"at every $\\mu_T$",
            all(folds["exponential", t] == 0 for t in TABORS),
        ),
        Statement(
            "in the Gauss model the transition is discontinuous above a critical $\\mu_T^*$",
            "Fig. 16",
            "$F_{sq} - F_{sw}$ = " + ", ".join(f"{gaps['Gauss', t]:.4g} ($\\mu_T = {t:g}$)" for t in TABORS),
            all(folds["Gauss", t] == 2 for t in TABORS),
        ),
        Statement(
            "below $\\mu_T^* \\lesssim 1$ it is continuous",
            "Fig. 16",
            f"two folds at $\\mu_T = 1/4$ as well, only {gaps['Gauss', 0.25]:.4f} of the load apart, with a "
            f"contact of radius "
            f"{limits['Gauss', 0.25]['wetting_radius']:.4f}; the window closes as $\\mu_T^3$ and never vanishes",
            folds["Gauss", 0.25] == 0,
            "lattice: see [onset](onset.md)",
        ),
        Statement(
            "$F_{sw}$ and $F_{sq}$ grow quickly for $\\mu_T \\geq 1$, much faster in the exponential model",
            "after (54)",
            "from $\\mu_T$ = 1 to 4 $F_{sw}$ grows "
            + " and ".join(
                f"{limits[law, 4.0]['wetting_load'] / limits[law, 1.0]['wetting_load']:.1f}-fold ({law})"
                for law in ("exponential", "Gauss")
            ),
            limits["exponential", 4.0]["wetting_load"] > 5.0 * limits["Gauss", 4.0]["wetting_load"],
        ),
    ]
    caption = (
        "Contact radius against the load for repulsion, dashed thin where unstable: small loads (a), all "
        "(b). Arrows: where the "
        "film of the Gauss model is squeezed out."
    )
    return Result("fig16", "Contact radius against the load, repulsion", caption, figure, [], statements)


if __name__ == "__main__":
    run(make, __doc__)
