"""Figure 3: gaps of contacts that are scaled copies of each other coincide in the units (23) and (24).

python studies/paper/fig03.py [--fast] [--output DIR]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.output.plot_view import BLUE, GREY, ORANGE

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.paper.common import DISTANCE, GAP, Array, Finding, Result, Statement, panels, run, table

WORK, LOAD = 0.64e-4, 1e-4
# w, by which work of adhesion and load are divided.
SCALES = (1.0, 0.5)


@dataclass(frozen=True)
class Collapse:
    """The gap of one contact of Figure 3, in its own units and in those of (23) and (24).

    Attributes
    ----------
    scale : float
        w.
    radius, gap : array (M,)
        Up to the edge of the cell, E = L = 1.
    in_plane, normal : float
        (R²Δγ/E)^(1/3) and (RΔγ²/E²)^(1/3).
    exact : float
        Largest difference of the scaled gap from that of the axisymmetric model, as far as its profile goes.
    """

    scale: float
    radius: Array
    gap: Array
    in_plane: float
    normal: float
    exact: float

    def scaled(self) -> tuple[Array, Array]:
        """Radius and gap in reduced units."""
        return self.radius / self.in_plane, self.gap / self.normal


def contact_of_figure_3(scale: float) -> tuple[cb.Contact, float]:
    """E = L = R = μ_T = 1, Δγ = 0.64e-4/w, hence z0 = Δγ^(2/3); and its load 1e-4/w."""
    work = WORK / scale
    law = cb.Exponential(work_of_adhesion=work, range=work ** (2.0 / 3.0))
    return cb.Contact(tip=cb.Parabola(radius=1.0), interaction=law, modulus=1.0), LOAD / scale


def collapse(scale: float, grid: int = 512) -> Collapse:
    """Solve one contact of Figure 3 in the periodic cell of edge 1."""
    contact, load = contact_of_figure_3(scale)
    state = cb.solve(contact, load=load, model=cb.Periodic(cell=1.0, grid=grid))
    own = cb.solve(contact, load=load, model=cb.Axisymmetric())
    normal = contact.scales.normal
    common = state.r <= own.r[-1]
    exact = np.abs(CubicSpline(own.r, own.gap)(state.r[common]) - state.gap[common]).max() / normal
    return Collapse(scale, state.r, state.gap, contact.scales.in_plane, normal, float(exact))


def difference(one: Collapse, other: Collapse) -> float:
    """Largest difference of two scaled gaps where both are known, in reduced units."""
    radius, gap = one.scaled()
    at, values = other.scaled()
    common = radius <= at[-1]
    return float(np.abs(CubicSpline(at, values)(radius[common]) - gap[common]).max())


def draw(pair: Sequence[Collapse]) -> Figure:
    """Both contacts: their gaps in the units of the cell, and on top of each other in those of (23) and (24)."""
    with panels(2) as (figure, (raw, scaled)):
        for item, marker, colour in zip(pair, "ox", (BLUE, ORANGE), strict=True):
            style: dict[str, Any] = {
                "marker": marker,
                "markersize": 4.0,
                "linestyle": "none",
                "markerfacecolor": "none",
            }
            for axes, (radius, gap) in ((raw, (item.radius, item.gap)), (scaled, item.scaled())):
                chosen = np.unique(np.searchsorted(radius, np.linspace(0.0, 5.5 * radius[-1] / 12.5, 26)))
                axes.plot(radius[chosen], gap[chosen], color=colour, label=f"$w = {item.scale:g}$", **style)
        scaled.plot(*pair[0].scaled(), color=GREY, linewidth=0.7, linestyle=":", zorder=0)
        raw.set(
            xlabel="$r/L$", ylabel="$g(r)/L$", xlim=(0.0, 0.22), ylim=(-4e-4, 0.016), xticks=np.arange(0.0, 0.21, 0.05)
        )
        scaled.set(xlabel=DISTANCE, ylabel=GAP, xlim=(0.0, 5.0), ylim=(-0.25, 8.0))
        raw.legend()
        scaled.legend()
    return figure


def make(fast: bool = False) -> Result:
    """Solve both contacts and compare them in scaled units."""
    pair = [collapse(scale, 128 if fast else 512) for scale in SCALES]
    first, second = pair
    ranges = [contact_of_figure_3(scale)[0].interaction.range for scale in SCALES]
    drawn = [CubicSpline(*item.scaled())(np.linspace(0.0, 5.0, 201)) for item in pair]
    apart = float(np.abs(drawn[0] - drawn[1]).max())
    rows = [
        [f"{item.scale:g}", f"{1.0 / item.in_plane:.2f}", f"{item.exact:.1e}", f"{item.scaled()[1][-1]:.1f}"]
        for item in pair
    ]
    physical = cb.Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="-40 mN/m", range="1 nm"
    )
    findings = [
        Finding("$z_0$ for $w = 1$", "Fig. 3", 0.0016, 0.00005, ranges[0]),
        Finding("$z_0(w=1/2)/z_0(w=1)$", "Fig. 3", 2.0 ** (2.0 / 3.0), 1e-9, ranges[1] / ranges[0]),
        Finding("$t$, scale of normal lengths", "Fig. 3, (24)", 2.0 ** (2.0 / 3.0), 1e-9, second.normal / first.normal),
        Finding(
            "$s$, scale of lateral lengths", "Fig. 3, (23)", 2.0 ** (1.0 / 3.0), 1e-9, second.in_plane / first.in_plane
        ),
        Finding(
            "$\\mu_T$ of the typical contact (1 µm, 5 GPa, 40 mN/m, 10 Å)", "Conclusions", 0.40, 0.005, physical.tabor
        ),
        Finding(
            "$\\mu_T/\\lambda$ with Maugis' $\\lambda = 2\\sigma_0(R/(\\pi\\Delta\\gamma K^2))^{1/3}$, $K = 4E/3$",
            "(43)",
            np.cbrt(2.0 * np.pi / 9.0),
            1e-12,
            0.5 * np.cbrt(np.pi * (4.0 / 3.0) ** 2),
        ),
    ]
    statements = [
        Statement(
            "deviations due to finite size and discretization are not visible to the naked eye",
            "Fig. 3",
            f"at most {apart:.1e} for $r < 5$, where the gap reaches {drawn[0].max():.1f}; over the whole cell "
            f"{difference(*pair):.1e}, the curvature of the periodic images",
            apart < 3e-3 * drawn[0].max(),
        )
    ]
    return Result(
        "fig03",
        "Scaling of the gap",
        "Gaps of two contacts that are scaled copies of each other, exponential model, periodic cell.",
        draw(pair),
        findings,
        statements,
        {
            "Against the axisymmetric model, which has no cell": table(
                ("w", "cell in reduced units", "largest difference of the gap", "gap at the cell's edge"), rows
            )
        },
    )


if __name__ == "__main__":
    run(make, __doc__)
