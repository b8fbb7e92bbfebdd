"""Figure 13: errors of the COS equation and of its modified forms.

python studies/paper/fig13.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.theory import cos, jkr, maugis
from studies.paper.common import LAWS, LOAD, Finding, Result, Statement, panels, run
from studies.paper.cos_fits import FORMS, TABORS, fits, table_of_fits

TABOR = 1.0
STYLES = dict(zip(FORMS, (("#0072B2", "-."), ("black", "-"), ("#D55E00", "--")), strict=True))
LABELS = dict(zip(FORMS, ("COS (47)", "modified (48)", "(48), free exponent"), strict=True))


def make(fast: bool = False) -> Result:
    """Fit the three forms to the MD model at μ_T = 1, draw their errors, and tabulate them over μ_T."""
    rows = dict(zip(FORMS, fits("Maugis-Dugdale", TABOR), strict=True))
    fold = maugis.load_fold(interaction_range=1.0 / TABOR)
    radius = float(fold.contact_radius) + np.concatenate([[0.0], np.geomspace(1e-6, 7.0, 3000)])
    load = np.asarray(maugis.contact(radius, interaction_range=1.0 / TABOR).load)
    load[0] = float(fold.load)
    error = {form: 100.0 * (row.fit.contact_radius(load) / radius - 1.0) for form, row in rows.items()}
    with panels(2) as (figure, (negative, positive)):
        for form, (colour, dashes) in STYLES.items():
            for axes, kept in ((negative, load <= 0.0), (positive, load > 1e-2)):
                axes.plot(load[kept], error[form][kept], color=colour, linestyle=dashes, label=LABELS[form])
        for axes in (negative, positive):
            axes.axhline(0.0, color="0.6", linewidth=0.6)
            axes.set(xlabel=LOAD, ylabel="error of the contact radius (%)")
        negative.set(xlim=(float(fold.load) - 0.1, 0.0))
        positive.set(xscale="log", xlim=(1e-2, 300.0), ylim=(-1.0, 1.2))
        positive.axvline(-2.0 * float(fold.load), color="0.7", linewidth=0.6, linestyle=":")
        negative.legend(loc="upper right")
    cos_row, modified, free = rows.values()
    worst = max(row.fit.error for row in (cos_row, modified))
    peak = jkr.load_fold()
    least = {"pull_off_load": -peak.load}
    far = {form: error[form][np.searchsorted(load, 100.0)] for form in FORMS}
    findings = [
        Finding(
            "$F_0$ of JKR, with $a_c(F_N = 0)$, in $\\pi$",
            "(49)",
            float(cos.modified_offset(pull_off_radius=jkr.contact_radius(0.0), **least)) / np.pi,
            1e-9,
            float(cos.modified_offset(pull_off_radius=peak.contact_radius, **least)) / np.pi,
            0.0,
            "misprint",
            "(28) has $3\\pi$, which takes the radius at $F_N = -F_p$ in (49)",
            4.5,
        ),
    ]
    statements = [
        Statement(
            "errors of COS equations are at most about 1 % even at $\\mu_T \\approx 1$",
            "Fig. 13",
            f"{100 * cos_row.fit.error:.2f} % (47), {100 * modified.fit.error:.2f} % (48) for $-F_p < F_N < 2F_p$",
            worst < 0.01,
        ),
        Statement(
            "the correct asymptotics of (48) does not necessarily improve the fit",
            "Fig. 13",
            f"root mean square error {100 * cos_row.mean:.3f} % (47), {100 * modified.mean:.3f} % (48)",
            modified.mean > cos_row.mean,
        ),
        Statement(
            "a free exponent reduces the mean or overall error by a little more than a factor of two",
            "after Fig. 15",
            f"largest error of (48) {modified.fit.error / free.fit.error:.2f} times smaller, mean error "
            f"{modified.mean / free.mean:.1f} times; against (47) {cos_row.fit.error / free.fit.error:.2f} and "
            f"{cos_row.mean / free.mean:.2f}; its exponent is {free.fit.exponent:.4f}",
            modified.fit.error / free.fit.error > 2.0,
        ),
        Statement(
            "convergence at large loads is slow even with (49)",
            "Fig. 13",
            "at $F_N = 100$: " + ", ".join(f"{value:+.3f} % {LABELS[form]}" for form, value in far.items()),
            abs(far["modified"]) > 1e-3,
        ),
    ]
    tabors = (0.25, 1.0, 4.0) if fast else TABORS
    laws = ("Maugis-Dugdale",) if fast else tuple(LAWS)
    caption = (
        "Relative error of the contact radius at $\\mu_T = 1$ against the MD model, fitted over $-F_p < F_N "
        "< 2F_p$ (dotted "
        "line) by least squares."
    )
    tables = {f"{law}: fits over the Tabor coefficient": table_of_fits(law, tabors) for law in laws}
    return Result(
        "fig13", "Errors of the COS equation and its modified forms", caption, figure, findings, statements, tables
    )


if __name__ == "__main__":
    run(make, __doc__)
