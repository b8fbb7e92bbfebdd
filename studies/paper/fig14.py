"""Figure 14: errors of explicit fits at zero load.

python studies/paper/fig14.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.theory import cos, maugis
from studies.paper.common import Finding, Result, Statement, panels, run

UNIT, LENGTH = np.cbrt(2.0 * np.pi / 9.0), np.cbrt(3.0 * np.pi / 4.0)


def make(fast: bool = False) -> Result:
    """Compare (52), (53) and COS' fit with the exact MD solution."""
    lam = np.geomspace(1e-3, 1e3, 601 if fast else 6001)
    exact = maugis.zero_load(interaction_range=1.0 / (UNIT * lam))
    radius, displacement = exact.contact_radius / LENGTH, exact.displacement / LENGTH**2
    new = 100.0 * (cos.zero_load_radius(lam) / radius - 1.0)
    old = 100.0 * (cos.empirical_zero_load_radius(lam) / radius - 1.0)
    height = 100.0 * (cos.zero_load_displacement(lam) / displacement - 1.0)
    with panels(2) as (figure, (first, second)):
        first.plot(lam, new, color="black", label="(52)")
        first.plot(lam, old, color="#D55E00", linestyle=":", label="COS, empirical")
        second.plot(lam, height, color="black", label="(53)")
        for axes, name in ((first, "contact radius"), (second, "displacement")):
            axes.axhline(0.0, color="0.6", linewidth=0.6)
            axes.set(
                xscale="log",
                xlim=(1e-3, 1e3),
                xlabel=r"Maugis' $\tilde\mu_T = \lambda$",
                ylabel=f"error of the {name} (%)",
            )
            axes.legend()
    worst = float(np.abs(old).max())
    small = np.array([1e-6, 1e-8])
    limits = maugis.zero_load(interaction_range=1.0 / (UNIT * small))
    first_c1 = float((limits.contact_radius[0] / LENGTH - np.cbrt(2.0)) / small[0])
    first_c5 = float((limits.displacement[1] / LENGTH**2 - np.cbrt(4.0)) / np.sqrt(small[1]))
    large = maugis.zero_load(interaction_range=1.0 / (UNIT * 100.0))
    first_c6 = float((large.displacement / LENGTH**2 - np.cbrt(4.0 / 3.0)) * 1e4)
    fit = "the printed constants minimise the error over all $\\tilde\\mu_T$, exact are "
    findings = [
        Finding("largest error of (52), in per cent", "after (53)", 0.3, 0.05, float(np.abs(new).max())),
        Finding("largest error of (53), in per cent", "after (53)", 0.3, 0.05, float(np.abs(height).max())),
        Finding(
            "largest error of COS' fit for $a_c(0)$, in per cent",
            "after (53)",
            1.5,
            0.05,
            worst,
            0.0,
            "misprint",
            "the Conclusions print 1.2 %",
            1.5 - 1.2 + 0.05,
        ),
        Finding(
            "the same",
            "Conclusions",
            1.2,
            0.05,
            worst,
            0.0,
            "misprint",
            "1.5 % is printed after (53)",
            1.5 - 1.2 + 0.05,
        ),
        Finding("$c_1$", "after (53)", 0.8, 0.05, first_c1, 2e-3, "fit", f"{fit}$\\pi/3$", np.pi / 3.0 - 0.8),
        Finding("$c_5$", "after (53)", -1.5, 0.05, first_c5, 1e-3),
        Finding(
            "$c_6$",
            "after (53)",
            0.1845,
            0.00005,
            first_c6,
            1e-4,
            "fit",
            f"{fit}$6^{{1/3}}/36$",
            0.1845 - np.cbrt(6.0) / 36.0,
        ),
    ]
    leading = [abs(float(cos.zero_load_radius(x)) / np.cbrt(value) - 1.0) for x, value in ((1e-9, 2.0), (1e6, 6.0))] + [
        abs(float(cos.zero_load_displacement(x)) / np.cbrt(value) - 1.0)
        for x, value in ((1e-12, 4.0), (1e6, 4.0 / 3.0))
    ]
    statements = [
        Statement(
            "(52) and (53) contain the correct asymptotics",
            "Fig. 14",
            f"the limits, to {max(leading):.0e} at $\\tilde\\mu_T$ = 1e-12 … 1e6; of the corrections only "
            f"$c_5$ is right",
            max(leading) < 1e-5,
        )
    ]
    caption = "Relative errors at zero load, against the exact MD solution."
    return Result("fig14", "Explicit fits at zero load", caption, figure, findings, statements)


if __name__ == "__main__":
    run(make, __doc__)
