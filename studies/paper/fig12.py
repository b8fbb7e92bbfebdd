"""Figure 12: displacement against the load, attraction.

python studies/paper/fig12.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.theory import maugis
from studies.paper.common import (
    DISPLACEMENT,
    DMT_DISPLACEMENT,
    JKR_DISPLACEMENT,
    Finding,
    Result,
    Statement,
    branch,
    run,
    solved,
)
from studies.paper.fig11 import LOADS, TABORS, apart, draw


def fitted(law: str) -> tuple[float, float, float]:
    """The Tabor coefficient of the MD model whose d(F) fits a law's at μ_T = 1; errors left in d and in a_c."""
    radius, displacement = branch(law, 1.0).at_load(LOADS)

    def difference(log_tabor: float) -> float:
        return float(np.sum((branch("Maugis-Dugdale", float(np.exp(log_tabor))).at_load(LOADS)[1] - displacement) ** 2))

    best = float(np.exp(minimize_scalar(difference, bounds=(np.log(0.1), np.log(20.0)), method="bounded").x))
    other, theirs = branch("Maugis-Dugdale", best).at_load(LOADS)
    return best, float(np.abs(theirs - displacement).max()), float((other / radius - 1.0).max())


def conditions() -> tuple[float, float]:
    """dE/dd − F, relative to F, along MD contacts with the prefactor of (35) as printed, 1, and with 4/3."""
    a = np.linspace(1.4, 2.2, 4001)
    state = maugis.contact(a, interaction_range=1.0)
    lift = a**2 - state.displacement  # 2σ √(c² − a²), which is (4/3) a μ̃ j in Maugis' units
    middle = slice(10, -10)
    found = []
    for factor in (1.0, 4.0 / 3.0):
        d = a**2 - 0.75 * factor * lift
        force = np.gradient(state.energy, d)
        found.append(float(np.abs(force - state.load)[middle].max() / np.abs(state.load).max()))
    return found[0], found[1]


def make(fast: bool = False) -> Result:
    """Draw the curves and compare them."""
    printed, corrected = conditions()
    m = np.array([1e3, 1e4])
    f = maugis.auxiliary_functions(m).f
    same = {tabor: apart(branch("exponential", tabor), branch("Maugis-Dugdale", tabor), 1) for tabor in TABORS}
    flat = {
        law: apart(branch(law, 1.0), branch("Maugis-Dugdale", 1.0), 1)
        for law in ("Gauss", "van der Waals", "exponential")
    }
    soft = solved("exponential", 0.25, 0.0).displacement
    law_fits = {law: fitted(law) for law in (("Gauss",) if fast else ("Gauss", "van der Waals", "exponential"))}
    gauss = law_fits["Gauss"]
    between = [float(branch("Maugis-Dugdale", tabor).at_load(np.zeros(1))[0][0]) for tabor in (1.0, 4.0)]
    own = float(branch("Gauss", 1.0).at_load(np.zeros(1))[0][0])
    findings = [
        Finding(
            "$f(m) - (\\pi/2)m^2$ for $m \\to \\infty$, in $\\pi/2$",
            "(37)",
            -1.0,
            1e-2,
            float((f[1] - 0.5 * np.pi * m[1] ** 2) / (0.5 * np.pi)),
            0.0,
            "misprint",
            "the expansion of $f$ has $m^2 - 2$",
            1.0,
        ),
        Finding(
            "prefactor of $\\tilde a\\tilde\\mu_T j$ for which $dV/dd = F_N$",
            "(35)",
            1.0,
            1e-3,
            4.0 / 3.0,
            0.0,
            "misprint",
            f"$dV/dd - F_N$ is {printed:.0e} of $F_N$ as printed and {corrected:.0e} with 4/3",
            1.0 / 3.0 if corrected < 1e-4 < printed else 0.0,
        ),
    ]
    statements = [
        Statement(
            "all $\\mu_T = 1$ curves resemble each other closely, whatever the slope of the potential",
            "Fig. 12",
            "for $F_N \\geq -4$ from MD by at most " + ", ".join(f"{value:.2f} ({law})" for law, value in flat.items()),
            max(flat.values()) < 0.4 * (DMT_DISPLACEMENT - JKR_DISPLACEMENT),
        ),
        Statement(
            "the exponential and the MD model agree for a given $\\mu_T$",
            "Fig. 12",
            "by "
            + ", ".join(f"{value:.3f} ($\\mu_T = {t:g}$)" for t, value in same.items())
            + " at most for $F_N \\geq -4$",
            max(same.values()) < 0.2,
        ),
        Statement(
            "even the $\\mu_T = 1/4$ curve is closer to JKR than to DMT",
            "Fig. 12",
            f"at zero load {soft - JKR_DISPLACEMENT:.3f} from JKR and {DMT_DISPLACEMENT - soft:.3f} from DMT",
            soft - JKR_DISPLACEMENT < DMT_DISPLACEMENT - soft,
        ),
        Statement(
            "the MD model's parameters can be adjusted to fit $d(F_N)$ of other interactions",
            "Fig. 12",
            "; ".join(f"{law}: $\\mu_T$ = {t:.3f} leaves {e:.3f} in $d$" for law, (t, e, _) in law_fits.items()),
            all(e < 0.1 for _, e, _ in law_fits.values()),
        ),
        Statement(
            "contact areas deduced from such fits have non-negligible errors",
            "Fig. 12",
            "the radius comes out too large by "
            + ", ".join(f"{error:.0%} ({law})" for law, (_, _, error) in law_fits.items()),
            gauss[2] > 0.05,
        ),
        Statement(
            "it would be wrong to take the $\\mu_T = 1$ Gauss contact for half-way between MD at 1 and 4",
            "Fig. 12",
            f"at zero load $a_c$ = {own:.3f}; MD: {between[0]:.3f} and {between[1]:.3f}",
            own < min(between),
        ),
        Statement(
            "Fig. 12 shows the Gauss and the exponential model at $\\mu_T = 1$, over $F_L$",
            "Fig. 12, caption",
            "Gauss and VDW, as in Fig. 11, over $F_N$",
            False,
            "misprint",
        ),
    ]
    caption = "Displacement against the load, as in Fig. 11."
    return Result(
        "fig12", "Displacement against the load", caption, draw("displacement", DISPLACEMENT), findings, statements
    )


if __name__ == "__main__":
    run(make, __doc__)
