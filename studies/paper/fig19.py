"""Figure 19: gaps of repulsive contacts at a large and at an intermediate load.

python studies/paper/fig19.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
import contbranch as cb
from studies.paper.common import (
    COLOURS,
    DISTANCE,
    GAP,
    Finding,
    Result,
    Statement,
    crossing,
    gap_at,
    gap_spline,
    panels,
    run,
    solved,
)

CASES = tuple((law, tabor) for law in ("exponential", "Gauss") for tabor in (4.0, 1.0))
LARGE, INTERMEDIATE = 60.0, 7.5
STYLES = {"exponential": "-", "Gauss": (0, (5, 1.5))}


def make(fast: bool = False) -> Result:
    """Draw the stable gaps at both loads."""
    r = np.linspace(0.0, 8.0, 1601)
    stable = {
        (law, tabor, load): [s for s in solved(law, tabor, load, -1).states if s.stable("load")]
        for law, tabor in CASES
        for load in (LARGE, INTERMEDIATE)
    }
    views = (
        (LARGE, (0.0, 8.0), (-0.5, 20.0)),
        (LARGE, (0.0, 4.5), (-0.02, 0.7)),
        (INTERMEDIATE, (0.0, 3.0), (0.0, 2.0)),
    )
    with panels(3) as (figure, axes):
        for one, (load, horizontal, vertical) in zip(axes, views, strict=True):
            for law, tabor in CASES:
                for number, state in enumerate(stable[law, tabor, load]):
                    style = {"color": COLOURS[tabor], "linestyle": STYLES[law], "linewidth": 0.8 if number else 1.3}
                    label = rf"{law}, $\mu_T = {tabor:g}$" if not number else None
                    one.plot(r, gap_at(state, r), label=label, **style)
            one.set(xlabel=DISTANCE, ylabel=GAP, xlim=horizontal, ylim=vertical)
            one.annotate(f"$F_N = {load:g}$", (0.04, 0.94), xycoords="axes fraction", va="top")
        axes[0].legend(loc="center left", bbox_to_anchor=(0.0, 0.6))
    touching = next(s for s in stable["Gauss", 4.0, LARGE] if s.contact_radius > 0.0)
    hovering = [s for s in stable["Gauss", 4.0, LARGE] if s.contact_radius == 0.0]
    a = touching.contact_radius
    far = float(gap_at(touching, np.array([a + 0.1]))[0])
    gap = gap_spline(touching)
    half = 0.5 * float(gap(np.sqrt((a + 0.5) ** 2 - a**2)))
    width = crossing(lambda x: float(gap(np.sqrt(x**2 - a**2))) - half, a + 1e-9, a + 0.5) - a
    loads = [float(s.load) for s in stable["Gauss", 4.0, INTERMEDIATE]]
    contacts = [s.contact_radius for s in stable["Gauss", 4.0, INTERMEDIATE]]
    findings = [
        Finding("contact radius, Gauss, $\\mu_T = 4$, load lowered to 60", "after Fig. 18", 1.73, 0.005, a, 1e-7),
        Finding(
            "the load at which there is a contact of radius 1.73",
            "after Fig. 18",
            INTERMEDIATE,
            0.05,
            cb.solve(cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1), contact_radius=1.73).load,
            0.3,
            "misprint",
            "Fig. 19(b) is for $F_N$ = 60; at 7.5 there is one state, without contact",
            LARGE - INTERMEDIATE if contacts == [0.0] * len(loads) else 0.0,
        ),
        Finding("$a_c^{macro}$ (about), Hertz' radius", "after Fig. 18", 4.0, 0.5, np.cbrt(0.75 * LARGE)),
        Finding("width over which the gap opens (order)", "after Fig. 18", 0.1, 0.05, width),
        Finding("gap beyond the rim, in $1/\\mu_T$ (order of 1)", "after Fig. 18", 1.0, 0.5, 4.0 * far),
    ]
    apart = float(np.ptp([gap_at(s, np.array([5.0]))[0] for law, t in CASES for s in stable[law, t, LARGE]]))
    inner = float(np.ptp([gap_at(s, np.array([2.0]))[0] for law, t in CASES for s in stable[law, t, LARGE]]))
    statements = [
        Statement(
            "at the large load gaps of all models are indistinguishable at small magnification",
            "Fig. 19(a)",
            f"apart by {apart:.3f} at $r = 5$, where the gap is {gap_at(touching, np.array([5.0]))[0]:.2f}, "
            f"and by {inner:.3f} at 2: "
            f"{apart / views[0][2][1]:.1%} of the axis",
            apart < 0.02 * views[0][2][1],
        ),
        Statement(
            "the Gauss contact with $\\mu_T = 4$ is bistable",
            "Fig. 19(b)",
            f"stable at $F_N$ = 60: $a_c$ = {a:.4f}, and a film with a central gap of {hovering[0].central_gap:.4f}",
            len(stable["Gauss", 4.0, LARGE]) == 2,
        ),
        Statement(
            "an almost constant gap of order $1/\\mu_T$ surrounds the contact, as of one confined layer",
            "after Fig. 18",
            f"{gap_at(touching, np.array([a + 0.3]))[0]:.3f} at $r - a_c$ = 0.3, "
            f"{gap_at(touching, np.array([a + 1.0]))[0]:.3f} at 1",
            abs(gap_at(touching, np.array([a + 1.0]))[0] / gap_at(touching, np.array([a + 0.3]))[0] - 1.0) < 0.3,
        ),
    ]
    caption = "Gaps of repulsive contacts that are stable under a load; thin: the film that coexists with the contact."
    return Result("fig19", "Gaps of repulsive contacts", caption, figure, findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
