"""What the scripts of the paper's figures share: laws and curves, findings with their verdicts, and how they are run.

The paper is M. H. Müser, "Single-asperity contact mechanics with positive and negative work of adhesion", Beilstein J.
Nanotechnol. 5, 419-437 (2014). Reduced units (23)-(26) throughout.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.special import ellipk

import contbranch as cb
from contbranch.output.plot_view import STYLE, WIDTH
from contbranch.theory import maugis
from contbranch.threads import one_thread

Array = NDArray[np.float64]
DOCS: Final = Path(__file__).resolve().parents[2] / "docs"

LAWS: Final = {
    "exponential": cb.Exponential,
    "Maugis-Dugdale": cb.MaugisDugdale,
    "Gauss": cb.Gauss,
    "van der Waals": cb.VanDerWaals,
}
# The paper's colours: 4 red, 1 green, 1/4 blue; those of Okabe and Ito.
COLOURS: Final = {4.0: "#D55E00", 1.0: "#009E73", 0.25: "#0072B2", 0.0625: "#CC79A7", 16.0: "#E69F00"}
LAW_COLOURS: Final = dict(zip(LAWS, ("#0072B2", "#000000", "#D55E00", "#009E73"), strict=True))
MARKS: Final = dict(zip(LAWS, "o-xs", strict=True))

# Limits of load, radius and displacement: (27), (28) and (51).
DMT_RADIUS, JKR_RADIUS = np.cbrt(1.5 * np.pi), np.cbrt(4.5 * np.pi)
DMT_DISPLACEMENT, JKR_DISPLACEMENT = DMT_RADIUS**2, JKR_RADIUS**2 / 3.0

# The largest load of Figures 16 to 18 and Table 1, to which fast modes trace each curve once for all of them.
TOP = 500.0

# axes labels
LOAD = r"load $F_N/(R\,|\Delta\gamma|)$"
RADIUS = r"contact radius $a_c/(R^2|\Delta\gamma|/E)^{1/3}$"
DISPLACEMENT = r"displacement $d/(R\,\Delta\gamma^2/E^2)^{1/3}$"
DISTANCE = r"radius $r/(R^2|\Delta\gamma|/E)^{1/3}$"
GAP = r"gap $g/(R\,\Delta\gamma^2/E^2)^{1/3}$"
PRESSURE = r"pressure $p/(|\Delta\gamma| E^2/R)^{1/3}$"
TABOR = r"Tabor coefficient $\mu_T$"


# Findings


@dataclass(frozen=True)
class Finding:
    """A number of the paper beside ours.

    Attributes
    ----------
    quantity, where : str
        What it is, and the figure, equation, table or section that prints it.
    printed, reading : float
        The value printed, and how accurately it is: half a unit of its last digit unless the text says "about".
    ours, error : float
        Our value with its error estimate.
    cause, reason : str
        What explains a difference (misprint, lattice, window, …), and how.
    covers : float
        The largest difference that the reason accounts for; a larger one has no explanation.
    """

    quantity: str
    where: str
    printed: float
    reading: float
    ours: float
    error: float = 0.0
    cause: str = ""
    reason: str = ""
    covers: float = 0.0

    @property
    def difference(self) -> float:
        """Ours minus the paper's."""
        return self.ours - self.printed

    @property
    def verdict(self) -> str:
        """``agrees``, the cause of a difference that is accounted for, or ``DIFFERS``."""
        off = abs(self.difference)
        # a value printed with so many digits may have been rounded or cut, and 0.5 stands for 0.500000001
        if off <= (self.reading + self.error) * (1.0 + 1e-9):
            return "agrees"
        return self.cause if self.cause and off <= self.reading + self.error + self.covers else "DIFFERS"


@dataclass(frozen=True)
class Statement:
    """A statement of the paper, and what is found.

    Attributes
    ----------
    said, where, found : str
    holds : bool
        Whether it was found to hold, by a test of numbers.
    cause : str
        Why a statement does not hold, where that is known.
    """

    said: str
    where: str
    found: str
    holds: bool
    cause: str = ""

    @property
    def verdict(self) -> str:
        """``holds``, the cause, or ``DIFFERS``."""
        return "holds" if self.holds else self.cause or "DIFFERS"


@dataclass(frozen=True)
class Result:
    """A figure reproduced.

    Attributes
    ----------
    name, title, caption : str
        Name of the picture, what is drawn, and how it is to be read.
    figure : Figure
    findings, statements : list
    tables : dict of (str, str)
        Tables in Markdown by their titles.
    """

    name: str
    title: str
    caption: str
    figure: Figure
    findings: list[Finding] = field(default_factory=list)
    statements: list[Statement] = field(default_factory=list)
    tables: dict[str, str] = field(default_factory=dict)

    def told(self) -> Result:
        """What was found, without the picture, which is saved already."""
        return replace(self, figure=Figure())

    def text(self) -> str:
        """Caption, findings and statements in Markdown."""
        parts = [self.caption, *(f"*{title}*\n\n{rows}" for title, rows in self.tables.items())]
        parts += [findings_table(self.findings)] if self.findings else []
        parts += [statements_table(self.statements)] if self.statements else []
        return plain("\n\n".join(parts))


RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
SIGNS: Final = {
    r"\\tilde\\mu": "μ̃", r"\\tilde a": "ã", r"\\tilde d": "d̃", r"\\mu": "μ", r"\\Delta": "Δ", r"\\gamma": "γ",
    r"\\kappa": "κ", r"\\pi": "π", r"\\zeta": "ζ", r"\\lambda": "λ", r"\\sigma": "σ", r"\\infty": "∞", r"\\propto": "∝",
    r"\\geq": "≥", r"\\approx": "≈", r"\\lesssim": "≲", r"\\gtrsim": "≳", r"\\to": "→", r"\\sqrt\{(.*?)\}": r"√(\1)",
    r"\\sqrt": "√", r"\\mathrm": "", r"\\exp": "exp", r"\\ln": "ln", r"\\,": " ", r"''": "″", r"'": "′",
    r"_\{(.*?)\}": r"_\1", r"\^\{(-?\d+)\}|\^(\d)": lambda found: (found[1] or found[2]).translate(RAISED),
    r"\^\{(.*?)\}": r"^(\1)", r"\^\*": "*", r"-": "−",
}  # fmt: skip


def plain(text: str) -> str:
    """Text with formulas between dollar signs written in Unicode."""

    def written(formula: re.Match[str]) -> str:
        found = formula[1]
        for sign, meaning in SIGNS.items():
            found = re.sub(sign, meaning, found)
        return found

    return re.sub(r"\$(.*?)\$", written, text)


def table(head: tuple[str, ...], rows: list[list[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def findings_table(findings: list[Finding]) -> str:
    """Findings as a table; reasons stand where there is a difference."""
    head = ("quantity", "printed in", "paper", "ours", "verdict", "why it differs")
    rows = []
    for one in findings:
        digits = max(0, int(np.ceil(-np.log10(one.reading * 1.999)))) if one.reading > 0 else 3
        printed = f"{one.printed:.{digits}f} ± {one.reading:.1g}" if one.reading > 0 else f"{one.printed:.6g}"
        own = with_error(one.ours, one.error, digits + 2)
        rows.append([one.quantity, one.where, printed, own, one.verdict, one.reason if one.verdict != "agrees" else ""])
    return table(head, rows)


def statements_table(statements: list[Statement]) -> str:
    """Statements as a table."""
    return table(
        ("the paper says", "in", "found", "verdict"),
        [[one.said, one.where, one.found, one.verdict] for one in statements],
    )


def with_error(value: float, error: float, digits: int = 4) -> str:
    """A value to a number of decimals, or fewer where its error is larger than they show."""
    if error > 0.5 * 10.0**-digits:
        return f"{value:.{max(0, int(np.ceil(-np.log10(error))))}f} ± {error:.1g}"
    return f"{value:.{digits}f}"


# Curves


def contact(law: str, tabor: float, sign: int = 1) -> cb.Contact:
    """The contact of a parabola in reduced units."""
    return cb.Contact.reduced(LAWS[law], tabor=tabor, sign=sign)


@cache
def traced(law: str, tabor: float, sign: int = 1, max_load: float | None = None) -> cb.Diagram:
    """The whole curve of a contact."""
    found = cb.trace(contact(law, tabor, sign), accuracy=1e-8, max_load=max_load, modes=0)
    if found.status != "complete":
        raise RuntimeError(f"{law}, tabor {tabor:g}: {found.message}")
    return found


@cache
def solved(law: str, tabor: float, load: float, sign: int = 1) -> cb.Solution:
    """All equilibria at a load, the stable one of lowest energy first."""
    return cb.solve(contact(law, tabor, sign), load=load, accuracy=1e-8)


@dataclass(frozen=True)
class Branch:
    """The states in contact as functions of the contact radius, and what limits them.

    Attributes
    ----------
    radius, load, displacement : array (M,)
        Dense, from first touch (radius 0) on.
    start : float
        Radius at which the load is least: from there on the contact is stable under a load.
    """

    radius: Array
    load: Array
    displacement: Array
    start: float

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Where the contact is stable under a load."""
        return self.radius >= self.start

    def at_load(self, load: Array) -> tuple[Array, Array]:
        """Radius and displacement of stable contacts at loads."""
        kept = self.stable
        root = np.sqrt(np.maximum(self.load[kept] - self.load[kept][0], 0.0))
        at = np.sqrt(np.maximum(load - self.load[kept][0], 0.0))
        return np.interp(at, root, self.radius[kept]), np.interp(at, root, self.displacement[kept])


@cache
def branch(law: str, tabor: float, sign: int = 1, max_load: float = 12.0) -> Branch:
    """The states in contact: closed form for Maugis-Dugdale attraction, splines through the rows of a trace otherwise.

    The fold is a point of the curve; splines of fifth degree through rows err by 2e-5 at most.
    """
    diagram = traced(law, tabor, sign, max_load)
    rows = diagram.branches[0]
    touching = (rows.contact_radius > 0.0) | (np.arange(len(rows)) == np.flatnonzero(rows.contact_radius == 0.0)[-1])
    radius, order = np.unique(rows.contact_radius[touching], return_index=True)
    start = diagram.thresholds.get("pull_off_radius" if sign > 0 else "wetting_radius", 0.0)
    fine = np.unique(
        np.concatenate([np.linspace(0.0, radius[-1], 1500), [start], start + np.geomspace(1e-6, 1.0, 400)])
    )
    fine = fine[fine <= radius[-1]]
    if law == "Maugis-Dugdale" and sign > 0:
        exact = maugis.contact(fine, interaction_range=1.0 / tabor)
        return Branch(fine, np.asarray(exact.load), np.asarray(exact.displacement), start)
    columns = [
        make_interp_spline(radius, column[touching][order], k=5)(fine) for column in (rows.load, rows.displacement)
    ]
    return Branch(fine, *columns, start)


def jkr_branch(max_load: float = 12.0) -> Branch:
    """JKR (28): F = 4a³/3 − 2 √(2π) a^(3/2), d = a² − √(2π a)."""
    start = np.cbrt(9.0 * np.pi / 8.0)
    a = np.append(np.linspace(0.0, start, 300), np.linspace(start, 3.0 + np.cbrt(max_load), 1200)[1:])
    force = 4.0 / 3.0 * a**3 - 2.0 * np.sqrt(2.0 * np.pi) * a**1.5
    kept = force <= max_load
    return Branch(a[kept], force[kept], (a**2 - np.sqrt(2.0 * np.pi * a))[kept], float(start))


def dmt_branch(max_load: float = 12.0, sign: int = 1) -> Branch:
    """DMT (27): F = 4a³/3 ∓ 2π, d = a²."""
    a = np.linspace(0.0, np.cbrt(0.75 * (max_load + sign * 2.0 * np.pi)), 1500)
    return Branch(a, 4.0 / 3.0 * a**3 - sign * 2.0 * np.pi, a**2, 0.0)


def gap_spline(state: cb.State) -> Any:
    """The gap outside the contact as a spline in ρ = √(r² − a²), in which it is smooth up to the rim."""
    rho = np.sqrt(np.maximum(state.r**2 - state.contact_radius**2, 0.0))
    outside = state.r >= state.contact_radius
    rho, kept = np.unique(rho[outside], return_index=True)
    return make_interp_spline(rho, state.gap[outside][kept], k=5)


def gap_slope(state: cb.State, r: Array) -> Array:
    """dg/dr outside the contact."""
    rho = np.sqrt(r**2 - state.contact_radius**2)
    return np.asarray(gap_spline(state).derivative()(rho) * r / rho)


def gap_at(state: cb.State, r: Array) -> Array:
    """The gap at radii: 0 in contact, the profile's, and beyond it z − d + w with the surface's displacement w.

    w = (4/π) ∫ p(s) s K(m)/(r + s) ds, m = 4rs/(r + s)², of rings of pressure, in √|s² − a²|, in which p is smooth.
    """
    a, end = state.contact_radius, float(state.r[-1])
    outside = r > end
    gap = np.zeros_like(r)
    near = (r >= a) & ~outside
    gap[near] = gap_spline(state)(np.sqrt(np.maximum(r[near] ** 2 - a**2, 0.0)))
    nodes, weights = np.polynomial.legendre.leggauss(400)
    far = r[outside]
    gap[outside] = 0.5 * far**2 - state.displacement
    for inside in (True, False):
        part = state.r < a if inside else state.r >= a
        if part.sum() < 6:
            continue
        root = np.sqrt(np.abs(state.r[part] ** 2 - a**2))
        root, order = np.unique(root, return_index=True)
        low, high = (0.0, a) if inside else (0.0, root[-1])
        at = low + 0.5 * (high - low) * (1.0 + nodes)
        pressure = make_interp_spline(root, state.pressure[part][order], k=3)(at)
        s = np.sqrt(np.maximum(a**2 - at**2, 0.0) if inside else a**2 + at**2)
        m = 4.0 * far[:, None] * s / (far[:, None] + s) ** 2
        weight = 0.5 * (high - low) * weights * at * pressure  # s ds = ± root d(root)
        gap[outside] += 4.0 / np.pi * (ellipk(m) / (far[:, None] + s)) @ weight
    return gap


def crossing(function: Callable[[float], float], low: float, high: float, within: float = 1e-13) -> float:
    """The root of a function between two places."""
    return float(brentq(function, low, high, xtol=within, rtol=1e-12))


# Drawing and running


@contextmanager
def panels(columns: int = 1, rows: int = 1, height: float = 2.6) -> Iterator[tuple[Figure, Any]]:
    """A figure of panels a column of a journal wide each, lettered if there are several, in the package's style."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(columns * WIDTH, rows * height), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        if len(axes) > 1:
            for one, letter in zip(axes, "abcdefgh", strict=False):
                one.set_title(f"({letter})", loc="left", fontsize=8.5)
        yield figure, axes[0] if len(axes) == 1 else axes


def draw_branch(axes: Axes, found: Branch, y: str, **style: Any) -> None:
    """A branch against the load, its unstable part thin and dashed."""
    kept = found.stable
    values = getattr(found, y)
    axes.plot(found.load[kept], values[kept], **style)
    if not kept.all():
        thin = {**style, "label": None, "linewidth": 0.7, "linestyle": (0, (3, 2)), "marker": "none"}
        axes.plot(found.load[~kept], values[~kept], **thin)


def samples(found: Branch, loads: Array, y: str) -> tuple[Array, Array]:
    """A few stable states of a branch, for symbols."""
    loads = loads[(loads > found.load[found.stable][0]) & (loads < found.load[-1])]
    return loads, found.at_load(loads)[0 if y == "radius" else 1]


Maker = Callable[[bool], Result]


def save(result: Result, folder: Path) -> Path:
    """Write the picture of a result to ``folder/figures/paper``."""
    path = folder / "figures" / "paper" / f"{result.name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        result.figure.savefig(path, dpi=170)
    return path


def run(make: Maker, doc: str | None) -> None:
    """Run the script of one figure."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--fast", action="store_true", help="fewer curves and coarser grids")
    parser.add_argument(
        "--output", type=Path, default=DOCS, metavar="DIR", help="folder of figures/paper (%(default)s)"
    )
    given = parser.parse_args()
    began = time.process_time()
    result = one_thread(make)(given.fast)
    print(result.text())
    print(f"\n{save(result, given.output)}; {time.process_time() - began:.1f} s", file=sys.stderr)
