"""Figure 4: the displacement of the far field from a finite periodic cell.

python studies/paper/fig04.py [--fast] [--output DIR]
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.models.grid.contact_area import contact_area
from contbranch.models.grid.newton import Equilibrium
from contbranch.models.grid.observables import CUBES, far_field_error, images, interpolate
from contbranch.models.grid.problem import GridProblem
from contbranch.output.plot_view import BLUE, GREY, ORANGE

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from studies.hertz_radius import hertz, solved
from studies.paper.common import DISTANCE, Array, Finding, Result, Statement, crossing, gap_spline, panels, run, table

GREEN = "#009E73"
EDGE = 9.8825
FACTORS = (1.0, 2.0 ** (1.0 / 3.0), 2.0 ** (2.0 / 3.0))
CONTACT, PRESSED = cb.Contact.reduced(cb.Exponential, tabor=1.0), 1.5625
# Σ 1/R³ over the square lattice about the middle of the cells, and about the middle of their edges, by the parity of
# the coordinates; factors of the displacements at corner and edge that take the point force of every image away, (30).
AT_CORNER, AT_EDGE = (2.0 * np.sqrt(2.0) - 1.0) * CUBES, (4.0 - np.sqrt(2.0)) * CUBES
EXACT, ROUNDED = (3.0 + 2.0 * np.sqrt(2.0), -2.0 - 2.0 * np.sqrt(2.0)), (6.0, -5.0)


@dataclass(frozen=True)
class FarField:
    """Displacement of the far field of a single contact, three ways, with what the periodic cell leaves in each.

    Attributes
    ----------
    displacement, error : float
        From the mean of u and the finite-size shift, d = C F - mean(u).
    from_points, from_points_error : float
        d = (3+2√2) u_X - (2+2√2) u_M with the paper's displacement u = -(w - d) at the cell's corner X and the middle M
        of its edge: (30) in the form that is exact for a point force.
    rounded, rounded_error : float
        (30) as printed, 6 u_X - 5 u_M.
    """

    displacement: float
    error: float
    from_points: float
    from_points_error: float
    rounded: float
    rounded_error: float


def far_field(problem: GridProblem, equilibrium: Equilibrium) -> FarField:
    """Displacement of the far field in three ways.

    At the points X and M the spread of the pressure adds Q/(4π E L³) times the sums of 1/R³ about them.
    """
    lattice, half = problem.lattice, 0.5 * problem.lattice.edges[0]
    at = partial(interpolate, lattice, equilibrium.u)
    corner, edge = -at(half, half), -0.5 * (at(half, 0.0) + at(0.0, half))
    error = far_field_error(problem, equilibrium)
    spread = error + abs(EXACT[0] * AT_CORNER + EXACT[1] * AT_EDGE) * images(problem, equilibrium)
    ways = [one * corner + other * edge for one, other in (EXACT, ROUNDED)]
    # The point forces that the rounded factors leave.
    rounding = abs((ROUNDED[0] - EXACT[0]) * (corner - edge))
    return FarField(equilibrium.displacement, error, ways[0], spread, ways[1], spread + rounding)


@dataclass(frozen=True)
class FarDisplacement:
    """Displacements in one periodic cell of Figure 4.

    Attributes
    ----------
    edge : float
    radius, displacement : array (N/2,)
        -u(r) on the diagonal, up to the corner X.
    far : FarField
        Three estimates of the displacement at infinity.
    contact_radius : float
    peak : float
        Radius at which -u is largest.
    """

    edge: float
    radius: Array
    displacement: Array
    far: FarField
    contact_radius: float
    peak: float


def far_displacement(edge: float, grid: int = 512) -> FarDisplacement:
    """Solve the contact of Figure 4 in a periodic cell."""
    found = solved(CONTACT, cb.Periodic(cell=edge, grid=grid), PRESSED)
    problem, state = found.setup.problem, found.equilibrium
    lattice = problem.lattice
    height = partial(interpolate, lattice, -state.u)
    return FarDisplacement(
        edge,
        np.sqrt(2.0) * lattice.axes[0],
        -np.diagonal(state.u),
        far_field(problem, state),
        contact_area(problem, state).radius,
        peak(np.hypot(lattice.axes[0], 0.5 * lattice.spacing), -state.u[:, 0], height(0.0, 0.0)),
    )


def peak(radius: Array, displacement: Array, centre: float) -> float:
    """Radius of the largest displacement, by the parabola through the largest value and its neighbours."""
    values = np.concatenate([[centre], displacement])
    at = np.concatenate([[0.0], radius])
    k = int(np.argmax(values))
    a, b, _ = np.polyfit(at[k - 1 : k + 2] - at[k], values[k - 1 : k + 2], 2)
    return float(at[k] - 0.5 * b / a)


def exact_displacement() -> tuple[cb.Solution, Array]:
    """The axisymmetric model's state of Figure 4 and its -u = z - g."""
    state = cb.solve(CONTACT, load=PRESSED, model=cb.Axisymmetric(), accuracy=1e-9)
    return state, 0.5 * state.r**2 - state.gap


def beyond(state: cb.Solution, last: float, radius: Array) -> Array:
    """-u outside the profile, d - F/(π r) + c/r³ (29), with c from its last value."""
    end = float(state.r[-1])
    c = (last - state.displacement + state.load / (np.pi * end)) * end**3
    return np.asarray(state.displacement - state.load / (np.pi * radius) + c / radius**3)


def extrapolated(first: FarDisplacement, second: FarDisplacement) -> float:
    """The shifted mean without the images' next term, which falls with the cell's edge as L⁻³."""
    a, b = first.edge**-3, second.edge**-3
    return (second.far.displacement * a - first.far.displacement * b) / (a - b)


def draw(cells: Sequence[FarDisplacement]) -> Figure:
    """Displacement along the diagonal of three cells with the tip's shape, and enlarged with what is extrapolated."""
    state, exact = exact_displacement()
    with panels(2) as (figure, both):
        tip = np.linspace(0.0, 3.0, 100)
        for axes in both:
            axes.plot(tip, 0.5 * tip**2, color="black", linewidth=0.8, linestyle="--", label="tip")
            outer = np.linspace(state.r[-1], 12.0, 100)
            line = np.append(state.r, outer), np.append(exact, beyond(state, float(exact[-1]), outer))
            axes.plot(*line, color=GREY, linewidth=2.6, alpha=0.5, label="no cell")
            axes.axhline(state.displacement, color=GREY, linewidth=0.7, linestyle=":")
            for cell, colour in zip(cells, (BLUE, ORANGE, GREEN), strict=True):
                axes.plot(cell.radius, cell.displacement, color=colour, linewidth=1.0, label=f"$L = {cell.edge:.2f}$")
            axes.set_xlabel(DISTANCE)
        for cell, colour in zip(cells, (BLUE, ORANGE, GREEN), strict=True):
            style: dict[str, Any] = {
                "color": colour,
                "markersize": 4.5,
                "linestyle": "none",
                "clip_on": False,
                "zorder": 4,
            }
            both[1].plot([cell.radius[-1]], [cell.far.rounded], marker="s", markerfacecolor="none", **style)
            both[1].plot([cell.radius[-1]], [cell.far.displacement], marker="o", **style)
        both[1].plot([], [], color="0.3", marker="s", markerfacecolor="none", linestyle="none", label="$6u_X - 5u_M$")
        both[1].plot([], [], color="0.3", marker="o", linestyle="none", label="shifted mean")
        both[0].set(ylabel=r"$-u(r)/(R\,\Delta\gamma^2/E^2)^{1/3}$", xlim=(0.0, 12.0), ylim=(0.0, 3.4))
        both[1].set(ylabel=r"$-u(r)/(R\,\Delta\gamma^2/E^2)^{1/3}$", xlim=(1.8, 12.0), ylim=(2.3, 2.75))
        both[0].legend(loc="lower right")
        both[1].legend(*_last(both[1], 2), loc="upper right")
    return figure


def _last(axes: mpl.axes.Axes, count: int) -> tuple[list[mpl.artist.Artist], list[str]]:
    handles, labels = axes.get_legend_handles_labels()
    return handles[-count:], labels[-count:]


def make(fast: bool = False) -> Result:
    """Solve the contact in three periodic cells and without one."""
    cells = [far_displacement(EDGE * factor, 128 if fast else 512) for factor in FACTORS]
    exact, values = exact_displacement()
    slope, gap = CubicSpline(exact.r, values).derivative(), gap_spline(exact)
    top = crossing(slope, 2.3, 3.0)
    five = crossing(lambda r: float(gap(np.sqrt(r**2 - exact.contact_radius**2))) - 5.0, 3.0, 6.0)
    spacing = np.sqrt(2.0) * cells[0].edge / 512
    lattice = f"the paper's lattice has spacings of {EDGE / 512:.3f} to {EDGE * FACTORS[-1] / 512:.3f}"
    row = hertz(32, cb.FreeSpace if fast else cb.Periodic)
    findings = [
        Finding(
            "contact radius at $F_N = 1.5625$",
            "Fig. 4",
            2.30,
            0.005,
            exact.contact_radius,
            1e-8,
            "lattice",
            lattice,
            spacing,
        ),
        Finding("contact radius without adhesion", "Fig. 4", 1.05, 0.005, solved_hertz()),
        Finding("radius of the largest $-u$", "Fig. 4", 2.52, 0.005, top, 1e-3, "lattice", lattice, spacing),
        Finding("radius at which the gap is $5 z_0$", "Fig. 4 (about)", 4.0, 0.5, five),
        Finding(
            "weight of $u_X$ that is exact for a point force ($3 + 2\\sqrt{2}$)",
            "(30), empirical",
            6.0,
            0.5,
            point_force_weight(),
        ),
        Finding(
            "$6u_X - 5u_M$ in the largest cell, against $d$ without a cell",
            "(30)",
            exact.displacement,
            cells[-1].far.rounded_error,
            cells[-1].far.rounded,
        ),
    ]
    rows = []
    for cell in cells:
        far = cell.far
        pairs = (
            (far.rounded, far.rounded_error),
            (far.from_points, far.from_points_error),
            (far.displacement, far.error),
        )
        texts = [f"{value:.4f} ± {error:.4f}" for value, error in pairs if value is not None]
        rows.append([f"{cell.edge:.4f}", f"{cell.contact_radius:.4f}", f"{cell.peak:.3f}", *texts])
    rows.append(["none", f"{exact.contact_radius:.4f}", f"{top:.3f}", *[f"{exact.displacement:.4f}"] * 3])
    limits = ", ".join(f"{extrapolated(*two):.5f}" for two in itertools.pairwise(cells))
    head = ("L", "a_c", "peak of −u at", "6u_X − 5u_M", "(3+2√2)u_X − (2+2√2)u_M", "shifted mean")
    return Result(
        "fig04",
        "Displacement of the far field from a finite cell",
        "Negative displacement along the diagonal of three periodic cells, exponential model, $\\mu_T = 1$, "
        "$F_N = 1.5625$; "
        f"grey: without a cell. The shifted mean, extrapolated in $1/L^3$ from neighbouring cells, gives {limits}.",
        draw(cells),
        findings,
        [
            Statement(
                "at $\\Delta a/a_c = 1/32$ and $a_c/L = 1/8$ the radius of Hertz' contact is accurate to "
                "less than 0.1 %",
                "Numerical Analysis",
                f"largest error {100.0 * row.fitted:.3f} %, {100.0 * row.corrected:.3f} % without the "
                f"curvature of the images",
                row.corrected < 1e-3,
            ),
            Statement(
                "$6u_X - 5u_M$ gives accurate estimates of $d_\\infty$ for cells whose corners are 10 away",
                "Fig. 4",
                f"{cells[-1].far.rounded - exact.displacement:+.3f} of {exact.displacement:.3f}; the shifted mean "
                f"{cells[-1].far.displacement - exact.displacement:+.3f}",
                abs(cells[-1].far.rounded / exact.displacement - 1.0) < 0.01,
            ),
        ],
        {"Displacement from cells": table(head, rows)},
    )


def solved_hertz() -> float:
    """Contact radius without an interaction."""
    return cb.solve(cb.Contact(tip=cb.Parabola(radius=1.0)), load=PRESSED, model=cb.Axisymmetric()).contact_radius


def point_force_weight() -> float:
    """Weight w of w u_X − (w − 1) u_M that is d for periodic point forces.

    With Z, P_X and P_M the sums of 1/r over the lattice seen from a node, X and M (less their mean), the lattice with
    its centres is another, 2^(1/2) Z = Z + P_X, and so are all half nodes together, 2Z = Z + P_X + 2 P_M.
    """
    centre = np.sqrt(2.0) - 1.0
    middle = 0.5 * (1.0 - centre)
    return float((1.0 - middle) / (centre - middle))


if __name__ == "__main__":
    run(make, __doc__)
