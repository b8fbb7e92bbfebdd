"""Figure 11: contact radius against the load, attraction.

python studies/paper/fig11.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.theory import jkr, maugis
from studies.paper.common import (
    COLOURS,
    LOAD,
    RADIUS,
    Branch,
    Finding,
    Result,
    Statement,
    branch,
    dmt_branch,
    draw_branch,
    jkr_branch,
    panels,
    run,
    samples,
    solved,
    traced,
)

TABORS = (4.0, 1.0, 0.25)
LOADS = np.linspace(-4.0, 10.0, 281)


def apart(one: Branch, other: Branch, what: int = 0) -> float:
    """Largest difference of radius (0) or displacement (1) at loads from -4 to 10, away from all pull-offs."""
    return float(np.abs(one.at_load(LOADS)[what] - other.at_load(LOADS)[what]).max())


def draw(y: str, label: str) -> Figure:
    """Curves of all models, which Figures 11 and 12 share."""
    with panels(height=3.4) as (figure, axes):
        for limit, name, style in ((jkr_branch(), "JKR", "-"), (dmt_branch(), "DMT", "--")):
            axes.plot(
                limit.load[limit.stable], getattr(limit, y)[limit.stable], color="0.6", lw=2.0, ls=style, label=name
            )
        for tabor in TABORS:
            draw_branch(
                axes, branch("Maugis-Dugdale", tabor), y, color=COLOURS[tabor], label=rf"MD, $\mu_T = {tabor:g}$"
            )
            points = samples(branch("exponential", tabor), np.linspace(-6.0, 10.0, 33), y)
            axes.plot(*points, "o", color=COLOURS[tabor], markersize=3.0)
        for law, mark in (("Gauss", "x"), ("van der Waals", "s")):
            points = samples(branch(law, 1.0), np.linspace(-6.0, 10.0, 25), y)
            axes.plot(
                *points, mark, color=COLOURS[1.0], markersize=4.0, markerfacecolor="none", label=rf"{law}, $\mu_T = 1$"
            )
        axes.plot([], [], "o", color="0.4", markersize=3.0, label="exponential, same colours")
        axes.set(xlabel=LOAD, ylabel=label, xlim=(-2.1 * np.pi, 10.0))
        axes.set_ylim(None if y == "radius" else -4.5, None)
        axes.legend(loc="lower right")
    return figure


def make(fast: bool = False) -> Result:
    """Draw the curves and compare them."""
    same = {tabor: apart(branch("exponential", tabor), branch("Maugis-Dugdale", tabor)) for tabor in TABORS}
    flat = apart(branch("Gauss", 1.0), branch("van der Waals", 1.0))
    akin = {
        (law, other): apart(branch(law, 1.0), branch(other, 0.25))
        for law in ("Gauss", "van der Waals")
        for other in ("Maugis-Dugdale", "exponential")
    }
    own = {law: apart(branch(law, 1.0), branch("Maugis-Dugdale", 1.0)) for law in ("Gauss", "van der Waals")}
    peaks = [
        -traced(law, tabor, 1, 12.0).thresholds["pull_off_load"]
        for law in ("exponential", "Maugis-Dugdale")
        for tabor in TABORS
    ]
    peaks += [-traced(law, 1.0, 1, 12.0).thresholds["pull_off_load"] for law in ("Gauss", "van der Waals")]
    soft = {law: solved(law, 2.0**-16, 1.0).contact_radius for law in ("exponential", "Gauss")}
    stiff, load = 32.0 if fast else 64.0, 1.0
    limit = float(jkr.contact_radius(load))
    correction = solved("exponential", stiff, load).contact_radius - limit
    half = solved("exponential", 0.5 * stiff, load).contact_radius - limit
    findings = [
        *(
            Finding(
                f"$a_c^3$ at $F_N = 1$, {law}, $\\mu_T = 2^{{-16}}$",
                "(27)",
                0.75 * (load + 2.0 * np.pi),
                1e-3,
                value**3,
            )
            for law, value in soft.items()
        ),
        Finding(
            f"$a_c^3$ at $F_N = 1$, exponential, $\\mu_T$ = {0.5 * stiff:g} and {stiff:g} "
            "extrapolated in $\\mu_T^{-2}$",
            "(28)",
            0.75 * (load + 3.0 * np.pi + np.sqrt(6.0 * np.pi * load + 9.0 * np.pi**2)),
            2e-3,
            (limit + correction + (correction - half) / 3.0) ** 3,
        ),
    ]
    statements = [
        Statement(
            "$F_p$ varies between $1.5\\pi$ and $2\\pi$",
            "after (54)",
            f"{min(peaks) / np.pi:.4f}$\\pi$ to {max(peaks) / np.pi:.4f}$\\pi$ for the curves of the figure",
            min(peaks) >= 1.5 * np.pi and max(peaks) <= 2.0 * np.pi,
        ),
        Statement(
            "curves of the exponential and the MD model almost superimpose for a given $\\mu_T$",
            "Fig. 11",
            "for $F_N \\geq -4$ radii differ by at most "
            + ", ".join(f"{value:.3f} ($\\mu_T = {t:g}$)" for t, value in same.items()),
            max(same.values()) < 0.1,
        ),
        Statement(
            "Gauss and VDW coincide for the same $\\mu_T$",
            "Fig. 11",
            f"for $F_N \\geq -4$ within {flat:.3f}",
            flat < 0.25,
        ),
        Statement(
            "the $\\mu_T = 1$ curve for VDW and Gauss is akin to the $\\mu_T = 1/4$ curves of MD and exponential",
            "Fig. 11",
            "apart by "
            + ", ".join(f"{value:.2f} ({law} and {other})" for (law, other), value in akin.items())
            + "; from MD at $\\mu_T = 1$ by "
            + ", ".join(f"{value:.2f} ({law})" for law, value in own.items()),
            max(akin.values()) < min(own.values()),
        ),
    ]
    at = maugis.load_fold(interaction_range=1.0)
    caption = (
        "Contact radius against the load: Maugis-Dugdale (lines, thin and dashed where unstable under a "
        "load), exponential "
        "(dots), Gauss and van der Waals. MD at $\\mu_T = 1$ loses contact at "
        f"$F_N$ = {float(at.load):.4f}, $a_c$ = {float(at.contact_radius):.4f}."
    )
    return Result("fig11", "Contact radius against the load", caption, draw("radius", RADIUS), findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
