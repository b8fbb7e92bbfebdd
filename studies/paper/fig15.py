"""Figure 15: excess contact radius against the excess load, attraction.

python studies/paper/fig15.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.results.diagram import LocalExponent
from studies.kappa import JKR, WINDOWS, jkr_curve, local_exponent, normal_form, windowed
from studies.paper.common import COLOURS, Finding, Result, Statement, panels, run

TABORS = (4.0, 1.0, 0.25)
CASES = {"Maugis-Dugdale": "Maugis-Dugdale, pull-off", "exponential": "exponential, pull-off"}
QUOTED = {"Maugis-Dugdale": 0.469, "exponential": 0.435}


def reached(local: LocalExponent, kappa: float) -> tuple[float, float]:
    """The excess load at which κ_local is a value, and the radius there."""
    k = int(np.flatnonzero(local.kappa < kappa)[0])
    share = (local.kappa[k - 1] - kappa) / (local.kappa[k - 1] - local.kappa[k])
    at = (1.0 - share) * np.log(local.excess[k - 1]) + share * np.log(local.excess[k])
    return float(np.exp(at)), float(np.exp(np.interp(at, np.log(local.excess), np.log(local.order_parameter))))


def windows(local: LocalExponent) -> list[tuple[tuple[float, float], float]]:
    """Exponents fitted over windows of one to three decades that end at excess loads from 0.3 to 30, and "
    "the windows."""
    spans = [(stop / 10.0**decades, stop) for stop in np.geomspace(0.3, 30.0, 21) for decades in (1.0, 2.0, 3.0)]
    return [(span, windowed(local, *span).kappa) for span in spans if span[0] > local.excess[0]]


def make(fast: bool = False) -> Result:
    """Draw the excess radii and their local exponents; where are the printed exponents found?"""
    tabors = (1.0,) if fast else TABORS
    with panels(2, height=3.0) as (figure, (excess, local)):
        load = np.geomspace(1e-5, 100.0, 200)
        share, kappa = jkr_curve()
        scale = np.cbrt(9.0 * np.pi / 8.0)
        moved = np.geomspace(1e-4, 1e3, len(share))
        excess.plot(share * JKR, moved * scale, color="0.6", lw=2.0, label="JKR")
        excess.plot(load, np.cbrt(0.75 * load), color="0.6", lw=2.0, ls="--", label="DMT")
        local.plot(share * JKR, kappa, color="0.6", lw=2.0)
        for tabor in tabors:
            for law, dashes in (("Maugis-Dugdale", "-"), ("exponential", ":")):
                found = local_exponent(CASES[law], tabor)
                style = {"color": COLOURS[tabor], "linestyle": dashes}
                excess.plot(found.excess, found.order_parameter, label=rf"{law}, $\mu_T = {tabor:g}$", **style)
                local.plot(found.excess, found.kappa, **style)
        for value, text in ((1 / 2, "1/2"), (1 / 3, "1/3")):
            local.axhline(value, color="0.6", lw=0.7, ls=":")
            local.annotate(text, (1.005, value), xycoords=("axes fraction", "data"), va="center", fontsize=7)
        for law, value in QUOTED.items():
            at, _ = reached(local_exponent(CASES[law], 1.0), value)
            local.plot(at, value, "o" if law == "exponential" else "s", color=COLOURS[1.0], markersize=5, mfc="none")
        limits = {"xscale": "log", "xlim": (1e-4, 100.0), "xlabel": r"excess load $(F_N + F_p)/(R\,\Delta\gamma)$"}
        excess.set(yscale="log", ylim=(2e-4, 5.0), ylabel=r"$(a_c - a_p)/(R^2\Delta\gamma/E)^{1/3}$", **limits)
        local.set(ylim=(0.32, 0.52), ylabel=r"$\kappa_\mathrm{local} = d\ln(a_c - a_p)/d\ln(F_N + F_p)$", **limits)
        excess.legend(loc="lower right")
    findings, where = [], []
    for law, value in QUOTED.items():
        found = local_exponent(CASES[law], 1.0)
        window = windowed(found, *WINDOWS[1])
        at, _ = reached(found, value)
        spans, kappas = zip(*windows(found), strict=True)
        inside = min(kappas) - 0.0005 <= value <= max(kappas) + 0.0005
        best = spans[int(np.argmin(np.abs(np.array(kappas) - value)))]
        findings.append(
            Finding(
                f"$\\kappa$ at $\\mu_T = 1$, {law}",
                "after Fig. 15",
                value,
                0.0005,
                window.kappa,
                0.0,
                "window",
                f"ours: excess loads of {WINDOWS[1][0]:g} to {WINDOWS[1][1]:g}; other windows below 30 give "
                f"{min(kappas):.3f} to "
                f"{max(kappas):.3f}, {best[0]:.2g} to {best[1]:.2g} the printed value",
                abs(value - window.kappa) if inside else 0.0,
            )
        )
        where.append(f"{at:.2f} ({law})")
    rows = [normal_form(CASES[law], tabor) for law in CASES for tabor in tabors]
    statements = [
        Statement(
            "$\\kappa$ changes continuously from 1/3 to 1/2 with $\\mu_T$",
            "Fig. 15",
            "1/2 at every fold: $d^2F_N/da^2$ there is "
            + ", ".join(f"{row.second:.3f}" for row in rows)
            + f" (MD, then exponential; $\\mu_T$ = {', '.join(f'{t:g}' for t in tabors)}); what changes with $\\mu_T$ "
            "is the load of the crossover to 1/3, " + ", ".join(f"{row.crossover:.3g}" for row in rows),
            False,
            "window: see [kappa](kappa.md)",
        ),
        Statement(
            "at $\\mu_T = 1$ the exponential model has a smaller exponent than the MD model",
            "after Fig. 15",
            "its crossover comes earlier: the printed exponents are local ones at excess loads of "
            + " and ".join(where),
            findings[1].ours < findings[0].ours,
        ),
    ]
    caption = (
        "Excess of the contact radius over that at pull-off against the excess load (a), and its logarithmic "
        "slope (b). Symbols "
        "in (b): where the exponents that the paper prints for $\\mu_T = 1$ are found."
    )
    return Result("fig15", "Excess contact radius", caption, figure, findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
