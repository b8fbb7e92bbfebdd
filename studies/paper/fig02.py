"""Figure 2: energies and pressures of the interaction models.

python studies/paper/fig02.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import LAW_COLOURS, LAWS, Finding, Result, Statement, panels, run

NAMES = {name: law(1.0, 1.0) for name, law in LAWS.items()}


def make(fast: bool = False) -> Result:
    """Draw f and -f' of the four laws; their values and slopes at contact are (12)."""
    x = np.linspace(0.0, 4.0, 401 if fast else 2001)
    findings, slopes = [], {}
    with panels(2) as (figure, (energy, force)):
        for name, law in NAMES.items():
            found = law.evaluate(x)
            energy.plot(x, found.energy, color=LAW_COLOURS[name], label=name)
            force.plot(x, found.pressure, color=LAW_COLOURS[name], label=name)
            findings.append(Finding(f"$v_{{fr}}(0)/\\Delta\\gamma$, {name}", "(12)", -1.0, 0.0, float(found.energy[0])))
            slopes[name] = float(-found.pressure[0])
        energy.set(xlabel="$g/z_0$", ylabel=r"energy $v_\mathrm{fr}/\Delta\gamma$", xlim=(0, 4), ylim=(-1.05, 0.05))
        force.set(
            xlabel="$g/z_0$", ylabel=r"pressure $p_\mathrm{fr}\,z_0/\Delta\gamma$", xlim=(0, 4), ylim=(-1.05, 0.05)
        )
        energy.legend(loc="lower right")
    flat = [name for name, slope in slopes.items() if abs(slope) < 1e-12]
    steep = [name for name, slope in slopes.items() if abs(slope - 1.0) < 1e-12]
    statements = [
        Statement(
            "$v'_{fr}$ vanishes at contact for Gauss and VDW and is finite for the exponential and the MD model",
            "after (12)",
            f"zero: {', '.join(flat)}; finite: {', '.join(steep)}",
            set(flat) == {"Gauss", "van der Waals"} and len(steep) == 2,
        ),
        Statement(
            "VDW and Gauss have finite slope, MD and exponential zero slope at $g = 0$",
            "discussion of Fig. 11",
            "the other way round",
            set(flat) != {"Gauss", "van der Waals"},
            "misprint",
        ),
    ]
    return Result(
        "fig02",
        "Interaction models",
        "Energy per area (a) and pressure (b) of the four models, Δγ > 0.",
        figure,
        findings,
        statements,
    )


if __name__ == "__main__":
    run(make, __doc__)
