"""Figure 8: gap and its slope in the Gauss model at a large Tabor coefficient.

python studies/paper/fig08.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

import contbranch as cb

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import (
    DISTANCE,
    GAP,
    JKR_RADIUS,
    Finding,
    Result,
    Statement,
    gap_at,
    gap_slope,
    panels,
    run,
    solved,
)

TABOR = 16.0


def steepest(state: cb.State) -> float:
    """Radius at which g′ has its local maximum next to the contact; NaN without one."""
    r = state.contact_radius + np.geomspace(1e-4, 0.999 * (float(state.r[-1]) - state.contact_radius), 4000)
    slope = gap_slope(state, r)
    peaks = np.flatnonzero((slope[1:-1] > slope[:-2]) & (slope[1:-1] >= slope[2:])) + 1
    if not len(peaks):
        return float("nan")
    k = peaks[np.argmax(slope[peaks])]
    found = minimize_scalar(
        lambda x: -float(gap_slope(state, np.array([x]))[0]), bounds=(r[k - 1], r[k + 1]), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    return float(found.x)


def make(fast: bool = False) -> Result:
    """Draw the gap, its logarithm and its slope; where does it close, and where is it steepest?"""
    gauss, other = solved("Gauss", TABOR, 0.0), solved("exponential", TABOR, 0.0)
    peak, a = steepest(gauss), gauss.contact_radius
    with panels(3) as (figure, (linear, logarithmic, slope)):
        r = a + np.unique(np.concatenate([np.geomspace(1e-6, 0.4, 400), np.linspace(0.4, 1.2, 1200)]))
        gap = gap_at(gauss, r)
        linear.plot(r, gap, color="black", label="$g$")
        linear.plot(r, 10.0 * gap, color="black", linestyle=":", label="$10\\,g$")
        logarithmic.plot(r, np.maximum(gap, 1e-12), color="black", label="Gauss")
        rest = other.contact_radius + np.geomspace(1e-6, 0.8, 1500)
        logarithmic.plot(rest, gap_at(other, rest), color="#0072B2", label="exponential")
        slope.plot(r, np.gradient(gap, r), color="black")
        for axes in (linear, logarithmic, slope):
            for place in (a, peak):
                axes.axvline(place, color="0.7", linewidth=0.7, zorder=0)
            axes.set(xlabel=DISTANCE, xlim=(1.9, 3.0))
        linear.set(ylabel=GAP, ylim=(0.0, 2.5))
        logarithmic.set(yscale="log", ylim=(1e-6, 3.0), ylabel=GAP)
        slope.set(ylabel=r"$g'\,(R\,E/|\Delta\gamma|)^{1/3}$", ylim=(0.0, 25.0))
        linear.legend(loc="upper left")
        logarithmic.legend(loc="lower right")
    closed = JKR_RADIUS * np.sqrt(2.0 / 3.0)
    way = 0.5 if fast else 2.0
    later = solved("Gauss", way * TABOR, 0.0)
    spacing = 4.0 * peak / 512
    findings = [
        Finding("radius at which the gap closes", "Fig. 8", 1.97, 0.005, a, 1e-8),
        Finding(
            "radius at which $g'$ is largest (the gap appears to close)",
            "Fig. 8",
            2.415,
            0.0005,
            peak,
            1e-4,
            "lattice",
            f"the neck is $1/\\mu_T^2$ = {TABOR**-2:.3f} wide, less than the spacing of a lattice of 512 "
            f"nodes over four contact "
            f"radii, {spacing:.3f}",
            spacing,
        ),
    ]
    statements = [
        Statement(
            "$g(r)$ takes its maximum at $r \\approx 2.415$",
            "discussion of Fig. 8",
            "$g'$ does; $g$ grows with $r$",
            False,
            "misprint",
        ),
        Statement(
            "the two radii do not approach each other quickly when $\\mu_T$ grows",
            "Fig. 8",
            f"$\\mu_T$ = 16: {a:.4f} and {peak:.4f}; {way * TABOR:g}: {later.contact_radius:.4f} and "
            f"{steepest(later):.4f}. They never do: the "
            f"gap closes where JKR's pressure is positive, at $\\sqrt{{2/3}}\\,a_{{JKR}}$ = {closed:.4f}; the "
            f"steepest gap tends "
            f"to $a_{{JKR}}$ = {JKR_RADIUS:.4f}",
            peak - a > 0.4 and steepest(later) - later.contact_radius > 0.4,
        ),
    ]
    caption = (
        "Gap of the Gauss model at zero load for $\\mu_T = 16$: linear (dotted: ten times enlarged), "
        "logarithmic with the "
        "exponential model for comparison, and its slope. Grey: where the gap closes, and where its slope is largest."
    )
    return Result("fig08", "Gap of the Gauss model", caption, figure, findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
