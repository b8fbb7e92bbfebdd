"""Figure 6: gaps at zero load, exponential model.

python studies/paper/fig06.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import contbranch as cb

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import DISTANCE, GAP, Array, Result, Statement, gap_at, gap_spline, panels, run, solved

TABORS = (0.25, 4.0)


def curvature(state: cb.State, r: Array) -> Array:
    """d²g/dr² outside the contact: with ρ² = r² − a², g″ = g_ρρ r²/ρ² − g_ρ a²/ρ³."""
    spline, a = gap_spline(state), state.contact_radius
    rho = np.sqrt(r**2 - a**2)
    return np.asarray(spline.derivative(2)(rho) * (r / rho) ** 2 - spline.derivative()(rho) * a**2 / rho**3)


def make(fast: bool = False) -> Result:
    """Draw both gaps and the parabola; look at their curvatures beyond the rim."""
    states = {tabor: solved("exponential", tabor, 0.0) for tabor in TABORS}
    found = {}
    with panels() as (figure, axes):
        r = np.linspace(0.0, 4.0, 401)
        axes.plot(r, 0.5 * r**2, color="0.7", label="undeformed, $r^2/2$")
        for (tabor, state), dashes in zip(states.items(), ("-", "--"), strict=True):
            a = state.contact_radius
            axes.plot(r, gap_at(state, r), color="black", linestyle=dashes, label=rf"$\mu_T = {tabor:g}$")
            axes.annotate(
                "", (a, 0.0), (a, -0.55), arrowprops={"arrowstyle": "->", "linestyle": dashes, "linewidth": 0.8}
            )
            beyond = a + np.geomspace(1e-3, 1.5, 2000)
            negative = beyond[curvature(state, beyond) < 0.0]
            found[tabor] = (negative.min() - a, negative.max() - a) if len(negative) else None
        axes.set(xlabel=DISTANCE, ylabel=GAP, xlim=(0.0, 4.0), ylim=(-0.7, 6.0))
        axes.legend(loc="upper left")
    soft, stiff = (states[tabor] for tabor in TABORS)
    band = found[4.0]
    statements = [
        Statement(
            "$g(r)$ has positive curvature at $r \\gtrsim a_c$ for $\\mu_T = 1/4$",
            "Fig. 6",
            "positive everywhere" if found[0.25] is None else f"negative for $r - a_c$ in {found[0.25]}",
            found[0.25] is None,
        ),
        Statement(
            "negative curvature at $r \\gtrsim a_c$ for $\\mu_T = 4$",
            "Fig. 6",
            "nowhere"
            if band is None
            else f"from $r - a_c = {band[0]:.3f}$ to {band[1]:.3f}; closer to the rim "
            "$g \\propto (r - a_c)^{3/2}$ has positive curvature, as the pressure is finite there",
            band is not None and band[0] < 0.1,
        ),
        Statement(
            "the displacement is smaller for $\\mu_T = 4$ than for 1/4, although the contact radius is larger",
            "Fig. 6",
            f"$d$ = {stiff.displacement:.4f} and {soft.displacement:.4f}, $a_c$ = {stiff.contact_radius:.4f} and "
            f"{soft.contact_radius:.4f}",
            stiff.displacement < soft.displacement and stiff.contact_radius > soft.contact_radius,
        ),
    ]
    caption = "Gap at zero load, exponential model; arrows: contact radii."
    return Result("fig06", "Gap at zero load", caption, figure, [], statements)


if __name__ == "__main__":
    run(make, __doc__)
