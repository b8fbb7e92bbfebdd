"""Figure 9: contact radius at zero load against the Tabor coefficient.

python studies/paper/fig09.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.theory import cos, maugis
from studies.paper.common import (
    DMT_RADIUS,
    JKR_RADIUS,
    LAW_COLOURS,
    MARKS,
    RADIUS,
    TABOR,
    Array,
    Finding,
    Result,
    Statement,
    panels,
    run,
    solved,
)
from studies.paper.fig08 import steepest

SIMULATED = ("exponential", "Gauss", "van der Waals")
FLAT = ("Gauss", "van der Waals")


def tabors(fast: bool) -> tuple[float, ...]:
    """Powers of 2, or three of them."""
    return tuple(2.0**k for k in ((-4, 0, 3) if fast else range(-8, 6)))


@cache
def zero_load(law: str, tabor: float) -> tuple[float, float]:
    """Contact radius and displacement at zero load."""
    state = maugis.zero_load(interaction_range=1.0 / tabor) if law == "Maugis-Dugdale" else solved(law, tabor, 0.0)
    return float(state.contact_radius), float(state.displacement)


def exponent(values: Array, limit: float, at: Array) -> float:
    """Exponent of |value − limit| ∝ μ_T^n between two Tabor coefficients."""
    first, second = np.abs(values - limit)
    return float(np.log(second / first) / np.log(at[1] / at[0]))


def make(fast: bool = False) -> Result:
    """Draw the radii; how fast do they approach both limits?"""
    at = tabors(fast)
    fine = np.geomspace(at[0], at[-1], 200)
    with panels() as (figure, axes):
        for limit, name, x, side in ((DMT_RADIUS, "DMT", 0.98, "right"), (JKR_RADIUS, "JKR", 0.02, "left")):
            axes.axhline(limit, color="0.5", linewidth=0.8, linestyle="--")
            axes.annotate(name, (x, limit), xycoords=("axes fraction", "data"), va="bottom", ha=side, fontsize=7)
        exact = [zero_load("Maugis-Dugdale", float(tabor))[0] for tabor in fine]
        axes.plot(fine, exact, color=LAW_COLOURS["Maugis-Dugdale"], label="Maugis-Dugdale")
        for law in SIMULATED:
            style = {"color": LAW_COLOURS[law], "markersize": 4.0, "linestyle": "none"}
            filled = {} if law == "exponential" else {"markerfacecolor": "none"}
            axes.plot(at, [zero_load(law, t)[0] for t in at], MARKS[law], label=law, **style, **filled)
            if law in FLAT:
                axes.plot(at, [steepest(solved(law, t, 0.0)) for t in at], MARKS[law], **style, **filled)
        axes.set(xscale="log", xlabel=TABOR, ylabel=RADIUS, ylim=(1.6, 3.3))
        axes.legend(loc="upper left")
    low, high = np.array([2.0**-14, 2.0**-12]), np.array([16.0, 32.0])
    necks = np.array([4.0, 8.0]) if fast else high
    laws = FLAT[:1] if fast else FLAT
    soft = {law: exponent(np.array([zero_load(law, t)[0] for t in low]), DMT_RADIUS, low) for law in LAW_COLOURS}
    stiff = {
        law: exponent(np.array([zero_load(law, t)[0] for t in high]), JKR_RADIUS, high)
        for law in ("exponential", "Maugis-Dugdale")
    }
    flat = {law: exponent(np.array([steepest(solved(law, t, 0.0)) for t in necks]), JKR_RADIUS, necks) for law in laws}
    unit = np.cbrt(3.0 * np.pi / 4.0)
    first = (zero_load("Maugis-Dugdale", 1e-5)[0] - DMT_RADIUS) / 1e-5
    findings = [
        Finding("$\\tilde a_c(0)$ of JKR, $6^{1/3}$", "(50)", np.cbrt(6.0), 1e-9, JKR_RADIUS / unit),
        Finding("$\\tilde a_c(0)$ of JKR, from the MD model at $\\mu_T = 10^4$", "(50)", np.cbrt(6.0), 1e-7,
                zero_load("Maugis-Dugdale", 1e4)[0] / unit),
        Finding("$\\tilde a_c(0)$ of DMT, from the MD model at $\\mu_T = 10^{-6}$", "(50)", np.cbrt(2.0), 3e-6,
                zero_load("Maugis-Dugdale", 1e-6)[0] / unit),
        *(
            Finding(f"exponent of the approach to DMT, {law}", "Fig. 9", 1.0, 0.05, soft[law])
            for law in ("exponential", "Maugis-Dugdale")
        ),
        *(
            Finding(f"exponent of the approach to DMT, {law} (roughly)", "Fig. 9", 1.5, 0.05, soft[law])
            for law in FLAT
        ),
        *(
            Finding(f"exponent of the approach to JKR, {law}", "Fig. 9", -2.0, 0.05, stiff[law])
            for law in ("exponential", "Maugis-Dugdale")
        ),
    ]  # fmt: skip
    gap = {law: zero_load(law, at[-1])[0] for law in FLAT}
    closed = JKR_RADIUS * np.sqrt(2.0 / 3.0)
    statements = [
        Statement(
            "the exponential model approaches DMT and JKR as the MD model does",
            "Fig. 9",
            f"exponents {soft['exponential']:.3f} and {soft['Maugis-Dugdale']:.3f}; {stiff['exponential']:.3f} and "
            f"{stiff['Maugis-Dugdale']:.3f}; the MD model's $a_c$ grows by {first / unit * np.cbrt(2 * np.pi / 9):.4f} "
            f"$\\tilde\\mu_T$ ($c_1 = \\pi/3$ = {cos.ASYMPTOTIC_RADIUS_C1:.4f})",
            abs(soft["exponential"] - soft["Maugis-Dugdale"]) < 0.1
            and abs(stiff["exponential"] - stiff["Maugis-Dugdale"]) < 0.1,
        ),
        Statement(
            "Gauss and VDW converge poorly to JKR where the gap closes",
            "Fig. 9",
            f"not at all: $a_c$ = {gap['Gauss']:.4f} and {gap['van der Waals']:.4f} at $\\mu_T = {at[-1]:g}$ tend to "
            f"$\\sqrt{{2/3}}\\,a_{{JKR}}$ = {closed:.4f}, the radius in which JKR's pressure is positive",
            all(abs(value - closed) < 0.01 for value in gap.values()),
        ),
        Statement(
            "Gauss and VDW approach JKR at a rate of $1/\\mu_T$ only",
            "Conclusions",
            "where the gap is steepest, exponents "
            + ", ".join(f"{value:.2f} ({law})" for law, value in flat.items())
            + f" between $\\mu_T$ = {necks[0]:g} and {necks[1]:g}; where it closes, no convergence",
            all(abs(value + 1.0) < 0.1 for value in flat.values()),
            "not confirmed: lattices of 512 nodes do not resolve the front, which is $1/\\mu_T^2$ wide",
        ),
        Statement(
            "the definition by the steepest gap needs a neck, hence a large $\\mu_T$",
            "Fig. 9",
            "of those drawn, a local maximum of $g'$ exists from $\\mu_T$ = "
            + " and ".join(
                f"{min(t for t in at if np.isfinite(steepest(solved(law, t, 0.0)))):g} ({law})" for law in FLAT
            ),
            all(not np.isfinite(steepest(solved(law, 2.0**-4, 0.0))) for law in FLAT),
        ),
    ]
    caption = (
        "Contact radius at zero load. Gauss and van der Waals: lower symbols where the gap closes, upper "
        "ones where its slope "
        "is largest."
    )
    return Result("fig09", "Contact radius at zero load", caption, figure, findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
