"""Figure 10: displacement at zero load against a scaled Tabor coefficient.

python studies/paper/fig10.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.theory import cos
from studies.paper.common import (
    DISPLACEMENT,
    DMT_DISPLACEMENT,
    JKR_DISPLACEMENT,
    LAW_COLOURS,
    LAWS,
    MARKS,
    Array,
    Finding,
    Result,
    Statement,
    crossing,
    panels,
    run,
)
from studies.paper.fig09 import SIMULATED, exponent, tabors, zero_load

HALF = 0.5 * (DMT_DISPLACEMENT + JKR_DISPLACEMENT)


def half_way(law: str, within: float = 1e-13) -> float:
    """The Tabor coefficient at which the displacement is half-way between DMT and JKR."""
    low, high = np.log(0.02), np.log(4.0)
    return float(np.exp(crossing(lambda x: zero_load(law, float(np.exp(x)))[1] - HALF, low, high, within)))


def make(fast: bool = False) -> Result:
    """Draw the displacements over the Tabor coefficient in units of that at which they are half-way."""
    at = np.array(tabors(fast))
    middle = {law: half_way(law, 1e-2 if fast else 1e-13) for law in LAWS}
    fine = np.geomspace(2.0**-12, 2.0**7, 300)
    exact = np.array([zero_load("Maugis-Dugdale", float(t))[1] for t in fine])
    curve = make_interp_spline(np.log(fine / middle["Maugis-Dugdale"]), exact, k=3)
    apart: dict[str, Array] = {}
    with panels() as (figure, axes):
        for limit, name, align in ((DMT_DISPLACEMENT, "DMT", "bottom"), (JKR_DISPLACEMENT, "JKR", "bottom")):
            axes.axhline(limit, color="0.5", linewidth=0.8, linestyle="--")
            axes.annotate(name, (0.02, limit), xycoords=("axes fraction", "data"), va=align, fontsize=7)
        axes.plot(fine / middle["Maugis-Dugdale"], exact, color="black", label="Maugis-Dugdale")
        for law in SIMULATED:
            values = np.array([zero_load(law, float(t))[1] for t in at])
            apart[law] = np.abs(values - curve(np.log(at / middle[law])))
            style = {"color": LAW_COLOURS[law], "markersize": 4.0, "linestyle": "none"}
            filled = {} if law == "exponential" else {"markerfacecolor": "none"}
            axes.plot(at / middle[law], values, MARKS[law], label=law, **style, **filled)
        axes.set(
            xscale="log",
            xlabel=r"$\mu_T/\mu_T(\mathrm{half\ way})$",
            ylabel=DISPLACEMENT,
            xlim=(3e-3, 4e2),
            ylim=(1.88, 2.92),
        )
        axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9))
    low, high = np.array([1e-8, 1e-7]), np.array([100.0, 200.0])
    unit = np.cbrt(3.0 * np.pi / 4.0) ** 2
    rates = [
        exponent(np.array([zero_load("Maugis-Dugdale", t)[1] for t in pair]), limit, pair)
        for pair, limit in ((low, DMT_DISPLACEMENT), (high, JKR_DISPLACEMENT))
    ]
    to_lambda = np.cbrt(9.0 / (2.0 * np.pi))

    def off(index: int, limit: float, low: float, high: float) -> float:
        def share(x: float) -> float:
            return abs(zero_load("Maugis-Dugdale", float(np.exp(x)) / to_lambda)[index] / limit - 1.0) - 0.01

        return float(np.exp(crossing(share, np.log(low), np.log(high))))

    dmt = [off(0, cos_limit(0), 1e-6, 1.0), off(1, cos_limit(1), 1e-9, 1.0)]
    jkr = off(0, np.cbrt(4.5 * np.pi), 0.5, 1e3), off(1, JKR_DISPLACEMENT, 0.5, 1e3)
    findings = [
        Finding("$\\tilde d(0)$ of JKR, $(4/3)^{1/3}$", "(51)", np.cbrt(4.0 / 3.0), 1e-9, JKR_DISPLACEMENT / unit),
        Finding("$\\tilde d(0)$ of DMT, $2^{2/3}$", "(51)", np.cbrt(4.0), 1e-9, DMT_DISPLACEMENT / unit),
        Finding("exponent of the approach to DMT, MD", "(51)", 0.5, 0.005, rates[0]),
        Finding("exponent of the approach to JKR, MD", "(51)", -2.0, 0.01, rates[1]),
    ]
    worst = max(float(values.max()) for values in apart.values())
    statements = [
        Statement(
            "scaled to coincide half-way, $d(\\mu_T)$ hardly depends on the interaction",
            "Fig. 10",
            f"at most {worst:.3f} from the MD curve, {worst / (DMT_DISPLACEMENT - JKR_DISPLACEMENT):.0%} of "
            f"the distance of the "
            "limits ("
            + ", ".join(f"{law} {values.max():.3f}" for law, values in apart.items())
            + "); half-way at $\\mu_T$ = "
            + ", ".join(f"{value:.4f} ({law})" for law, value in middle.items()),
            worst < 0.1 * (DMT_DISPLACEMENT - JKR_DISPLACEMENT),
        ),
        Statement(
            "1 % of $a_c(0)$ and $d(0)$ from JKR takes $\\tilde\\mu_T \\approx 10$",
            "after (51)",
            f"{jkr[0]:.2f} and {jkr[1]:.2f} suffice",
            max(jkr) <= 10.0,
        ),
        Statement(
            "1 % from DMT takes $\\tilde\\mu_T \\approx 10^{-4}$",
            "after (51)",
            f"{dmt[1]:.1e} for $d$ ($c_5 = -8/(3\\sqrt\\pi)$ = {cos.ASYMPTOTIC_DISPLACEMENT_C5:.4f}), "
            f"{dmt[0]:.1e} for $a_c$",
            0.3e-4 < dmt[1] < 3e-4,
        ),
    ]
    caption = (
        "Displacement at zero load over the Tabor coefficient in units of that at which it is half-way "
        "between JKR and DMT."
    )
    return Result("fig10", "Displacement at zero load", caption, figure, findings, statements)


def cos_limit(index: int) -> float:
    """DMT's contact radius or displacement at zero load."""
    return (float(np.sqrt(DMT_DISPLACEMENT)), float(DMT_DISPLACEMENT))[index]


if __name__ == "__main__":
    run(make, __doc__)
