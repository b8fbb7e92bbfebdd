"""Does the exponent κ of a − a_p ∝ (F − F_p)^κ change continuously with μ_T, or is it a crossover? See docs/kappa.md.

    python studies/kappa.py    # tables, and docs/figures/kappa.png; a minute and a half

Normal forms at pull-off and wetting folds and at continuous first touch, local exponents far beyond them, and power
laws fitted over windows, as in Table 1 of M. H. Müser, Single-asperity contact mechanics with positive and negative
work of adhesion. Reduced units throughout.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import brentq

import contbranch as cb
from contbranch.curve.exponents import crossover_excess, fitted_window
from contbranch.results.diagram import LocalExponent, Window

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[1]))
from studies.near_touch import Side, fold_in_contact, fold_side, softening, touch_side
from studies.power_laws import PowerLaw, fit_power_law, rounded_up

Array = NDArray[np.float64]

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "kappa.png"


@dataclass(frozen=True)
class Case:
    """A law with a sign, and what is known of its limits.

    Attributes
    ----------
    law, sign : type, int
    kind : str
        ``fold`` (pull-off or wetting) or ``touch``: a continuous onset.
    small : (float, float)
        Crossover load prefactor · μ_T^exponent for μ_T → 0: (prefactor, exponent).
    large : float or None
        Crossover load for μ_T → ∞ where it has a limit.
    """

    law: type[cb.Interaction]
    sign: int
    kind: str
    small: tuple[float, float]
    large: float | None


# Laws that pull or push in contact (f'(0) = −1), and laws whose slope at touch is elastic: see docs/kappa.md.
FINITE = (18 * np.pi**3, 3.0)


def _flat(law: type[cb.Interaction]) -> tuple[float, float]:
    return 2.25 * softening(law(-1.0, 1.0)) ** 3, 7.5


JKR, FLAT_JKR = 54 * np.pi, 1350 * np.pi / 289
CASES: Final = {
    "Maugis-Dugdale, pull-off": Case(cb.MaugisDugdale, 1, "fold", FINITE, JKR),
    "exponential, pull-off": Case(cb.Exponential, 1, "fold", FINITE, JKR),
    "Gauss, pull-off": Case(cb.Gauss, 1, "fold", _flat(cb.Gauss), FLAT_JKR),
    "Gauss, wetting": Case(cb.Gauss, -1, "fold", _flat(cb.Gauss), None),
    "van der Waals, wetting": Case(cb.VanDerWaals, -1, "fold", _flat(cb.VanDerWaals), None),
    "exponential, touch": Case(cb.Exponential, -1, "touch", FINITE, None),
}
TABORS = tuple(2.0**k for k in range(-12, 5, 2))
# Curves are drawn for these.
CURVES = tuple(2.0**k for k in (-6, -4, -2, 0, 2, 4))
# Distance of the samples of a normal form, as a share of the contact radius at the fold (of `_unit` at touch).
STEP = 0.04
# Round-off of slopes; those of laws with f'(0) = 0 are what is left of terms larger by 1/ε = μ_T^(-3/2).
ROUNDING = 2e-15
# At a continuous first touch, share of `_unit` at which the load's second derivative is taken.
TINY = 1e-4
# Local exponents: growth of the distance from sample to sample, first distance as a share of the radius.
RATIO, FIRST = 1.3, 1e-3
# Excess loads beyond this share of the load are differences of loads, below it they are integrals of the slope.
DIRECT = 1e-5
# Relative error of such an integral, a sum over steps of RATIO with three Gauss nodes each.
SUMMED = 1e-6
# Excess loads up to which local exponents are followed; those of stiff repulsive films have their crossover far out.
LARGEST_EXCESS, STIFF_EXCESS = 3e3, 2e5
# A mesh is replaced where its error exceeds this.
ALLOWED = 1e-9


@dataclass(frozen=True)
class NormalForm:
    """F = F_p + c2 q²/2 + c3 q³/6 + … in q = a − a_p.

    Attributes
    ----------
    tabor, load, radius : float
        μ_T, F_p and a_p.
    second, third : float
    second_error, third_error : float
    """

    tabor: float
    load: float
    radius: float
    second: float
    second_error: float
    third: float
    third_error: float

    @property
    def crossover(self) -> float:
        """ΔF× = 18 |c2|³/c3²; NaN at a continuous onset."""
        found = crossover_excess(self.second, self.third)
        return np.inf if found is None else found

    @property
    def crossover_error(self) -> float:
        """Of ΔF×, to first order."""
        relative = 3 * self.second_error / abs(self.second) + 2 * self.third_error / abs(self.third)
        return self.crossover * relative


@cache
def place(case: Case, tabor: float) -> tuple[Side, float]:
    """The side in contact on a mesh made for the fold or the touch, and the contact radius there."""
    contact = cb.Contact.reduced(case.law, tabor=tabor, sign=case.sign)
    if case.kind == "touch":
        return touch_side(contact).graded(TINY * _unit(tabor)), 0.0
    if tabor > 1:
        return fold_side(contact)
    side = touch_side(contact)
    rough = fold_in_contact(side.graded(side.problem.equations.mesh.innermost))
    if rough is None:
        raise ValueError(f"the load has no minimum in contact at tabor {tabor:g}")
    side = side.graded(rough)
    return side, side.fold(0.8 * rough, 1.2 * rough)


def _unit(tabor: float) -> float:
    """Contact radius on which the load at a continuous onset stops being quadratic: 3π/2 μ_T, or a stiff film's."""
    return min(1.5 * np.pi * tabor, 0.5 / max(1.0, tabor))


@cache
def normal_form(name: str, tabor: float) -> NormalForm:
    """Normal form of a case, in closed form for Maugis–Dugdale and from slopes otherwise.

    The errors are those of the differences (two step widths), of the mesh and of round-off.
    """
    case = CASES[name]
    if case.law is cb.MaugisDugdale:
        return _exact(case, tabor)
    side, radius = place(case, tabor)
    if not radius:
        return _onset(side, tabor)
    second, third = _differences(side, radius, STEP * radius)
    wide = _differences(side, radius, 2 * STEP * radius)
    fine_side = side.finer()
    fine_radius = fine_side.fold(0.98 * radius, 1.02 * radius)
    fine = _differences(fine_side, fine_radius, STEP * radius)
    floor = ROUNDING / min(1.0, tabor**1.5) if case.small[1] > 3 else 5 * ROUNDING
    # Halving the step divides the error of the differences by 16: a fifth of the change is on the safe side.
    return NormalForm(
        tabor,
        side.at(radius).load,
        radius,
        second,
        abs(wide[0] - second) / 5 + 3 * abs(fine[0] - second) + floor * abs(second),
        third,
        abs(wide[1] - third) / 5 + 3 * abs(fine[1] - third) + floor / STEP * abs(third),
    )


def _onset(side: Side, tabor: float) -> NormalForm:
    """c2 = 2 dF/d(a²) at first touch; there is no c3, since a logarithm follows: F − F_t = c2 a²/2 + O(a³ ln a)."""
    radii = TINY * _unit(tabor) * np.array([1.0, 2.0, 4.0])

    def extrapolated(at: Side) -> tuple[float, float]:
        near, middle, far = (at.at(float(a)).load_slope / a for a in radii)
        return 2 * near - middle, abs(2 * near - middle - (2 * middle - far))

    second, change = extrapolated(side)
    fine, _ = extrapolated(side.finer())
    return NormalForm(tabor, side.at(0.0).load, 0.0, second, change + 3 * abs(fine - second), np.nan, np.nan)


def _differences(side: Side, radius: float, step: float) -> tuple[float, float]:
    """c2 and c3 from four slopes around a fold."""
    before2, before, after, after2 = (side.at(radius + k * step).load_slope for k in (-2, -1, 1, 2))
    second = (8 * (after - before) - (after2 - before2)) / (12 * step)
    return second, (16 * (after + before) - (after2 + before2)) / (12 * step**2)


def _exact(case: Case, tabor: float) -> NormalForm:
    diagram = cb.trace(cb.Contact.reduced(case.law, tabor=tabor, sign=case.sign))
    event = next(event for event in diagram.folds("load") if event.name == "pull-off")
    exponent = event.exponent
    assert exponent is not None
    assert exponent.prefactor is not None
    assert exponent.crossover_load is not None
    second = 2 / exponent.prefactor**2
    third = np.sqrt(18 * second**3 / exponent.crossover_load)
    rounding = 1e-12
    return NormalForm(tabor, event.load, event.contact_radius, second, rounding * second, third, rounding * third)


@cache
def local_exponent(name: str, tabor: float) -> LocalExponent:
    """κ_local = dln(a − a_p)/dlnΔF from a thousandth of the contact radius to far beyond the crossover.

    For Maugis–Dugdale it comes from the diagram (up to 100); otherwise contact radii are prescribed one after the
    other, on meshes made for them. Close to the fold ΔF is an integral of the slope, farther away a difference.
    """
    case = CASES[name]
    if case.law is cb.MaugisDugdale:
        diagram = cb.trace(cb.Contact.reduced(case.law, tabor=tabor, sign=case.sign))
        return diagram.local_exponent(next(event for event in diagram.folds("load") if event.name == "pull-off"))
    side, radius = place(case, tabor)
    largest = STIFF_EXCESS if case.sign < 0 and tabor > 1 else LARGEST_EXCESS
    start = side.at(radius)
    moved = FIRST * (radius or _unit(tabor))
    excess = side.rise(radius, radius + moved)
    rows = []
    while excess < largest:
        wrong = side.error(radius + moved)
        if wrong > ALLOWED:
            side = side.remeshed(radius + moved, 0.03 * ALLOWED)
            wrong = side.error(radius + moved)
        here = side.at(radius + moved)
        if excess > DIRECT * max(1.0, abs(start.load)):
            excess = here.load - start.load
            error = 3 * wrong * max(1.0, abs(here.load)) / excess
        else:
            error = SUMMED
        rows.append((excess, moved, excess / (moved * here.load_slope), error))
        further = RATIO * moved
        if rows[-1][3] == SUMMED:
            excess += side.rise(radius + moved, radius + further, 3)
        else:  # only whether to go on depends on it
            excess *= RATIO ** (1.0 / rows[-1][2])
        moved = further
    table = np.array(rows)
    return LocalExponent(table[:, 0], table[:, 1], table[:, 2], table[:, 2] * table[:, 3])


def crossover_curve(count: int = 200) -> tuple[Array, Array]:
    """ΔF/ΔF× and κ_local of F − F_p = A q² + B q³ with A, B > 0: κ = (1 + x)/(2 + 3x), ΔF/ΔF× = x² (1 + x)/4."""
    x = np.geomspace(1e-5, 1e5, count)
    return x**2 * (1 + x) / 4, (1 + x) / (2 + 3 * x)


def half_way(local: LocalExponent) -> float | None:
    """Largest excess at which κ_local falls through 5/12, half-way from 1/2 to 1/3; None if it does not."""
    below = local.kappa < 5 / 12
    falls = np.flatnonzero(~below[:-1] & below[1:])
    if falls.size == 0:
        return None
    k = int(falls[-1])
    share = (local.kappa[k] - 5 / 12) / (local.kappa[k] - local.kappa[k + 1])
    return float(np.exp((1 - share) * np.log(local.excess[k]) + share * np.log(local.excess[k + 1])))


def _stiff_half_way(pressure: float) -> float:
    """Excess/μ_T³ at which κ_local = 5/12 in the limit μ_T → ∞ of a film that yields at `pressure` · μ_T.

    The film is thin then, and the contact the inner part a² = A² − A_p² of a Hertzian one of radius A in which the
    pressure (2/π) √(A² − r²) exceeds the film's: with y = A/A_p, κ = (y² + y + 1)/(3y (y + 1)).
    """
    y = (np.sqrt(17) - 1) / 2
    return float(4 / 3 * (np.pi * pressure / 2) ** 3 * (y**3 - 1))


def _maxwell_pressure() -> float:
    """Pressure, in |Δγ|/z0, at which a Gauss film and contact have the same enthalpy per area: f + x |f'| = 1."""
    square = brentq(lambda s: np.log1p(s) - s / 2, 1.0, 5.0)
    return float(np.sqrt(square) * np.exp(-square / 2))


STIFF: Final = {"exponential, touch": _stiff_half_way(1.0), "Gauss, wetting": _stiff_half_way(_maxwell_pressure())}


# Windows: how a fit turns the crossover into an exponent


@dataclass(frozen=True)
class Printed:
    """A row of the paper's Table 1."""

    name: str
    tabor: float
    radius: float
    load: float
    prefactor: float
    kappa: float
    kappa_digit: float = 0.01


TABLE = (
    Printed("Gauss, wetting", 1 / 16, 0.0, 6.30, 0.91, 0.333, 0.001),
    Printed("Gauss, wetting", 1 / 4, 0.01, 6.43, 0.86, 0.34),
    Printed("Gauss, wetting", 1.0, 0.25, 8.00, 0.56, 0.46),
    Printed("Gauss, wetting", 4.0, 0.66, 47.3, 0.30, 0.50),
    Printed("exponential, touch", 1 / 16, 0.0, 6.38, 0.62, 0.35),
    Printed("exponential, touch", 1 / 4, 0.0, 6.89, 0.68, 0.44),
    Printed("exponential, touch", 1.0, 0.0, 13.85, 0.46, 0.48),
    Printed("exponential, touch", 4.0, 0.0, 339.0, 0.28, 0.49),
)


def windowed(local: LocalExponent, start: float, stop: float) -> Window:
    """Power law over a window of the excess, sampled evenly in its logarithm."""
    excess = np.geomspace(start, stop, 41)
    kappa = np.interp(np.log(excess), np.log(local.excess), local.kappa)
    order = np.exp(_interpolated(np.log(excess), np.log(local.excess), np.log(local.order_parameter), local.kappa))
    window = fitted_window(LocalExponent(excess, order, kappa, np.zeros_like(kappa)), start, stop)
    assert window is not None
    return window


def _interpolated(x: Array, nodes: Array, values: Array, slopes: Array) -> Array:
    """Cubic Hermite interpolation."""
    k = np.clip(np.searchsorted(nodes, x) - 1, 0, len(nodes) - 2)
    width = nodes[k + 1] - nodes[k]
    t = (x - nodes[k]) / width
    return (
        values[k] * (1 + 2 * t) * (1 - t) ** 2
        + values[k + 1] * t**2 * (3 - 2 * t)
        + width * (slopes[k] * t * (1 - t) ** 2 - slopes[k + 1] * t**2 * (1 - t))
    )


def matching_windows(row: Printed, decades: float = 3.0) -> tuple[float, float] | None:
    """Range of upper ends of windows so many decades wide whose fit agrees with a row's κ in its last digit."""
    local = local_exponent(row.name, row.tabor)
    stops = np.geomspace(local.excess[0] * 10**decades * 1.01, local.excess[-1], 120)
    stops = stops[stops >= 1e-2]
    kappas = np.array([windowed(local, stop / 10**decades, stop).kappa for stop in stops])
    found = stops[np.abs(kappas - row.kappa) <= 0.5 * row.kappa_digit]
    return (float(found.min()), float(found.max())) if found.size else None


def refitted(row: Printed, start: float, stop: float) -> Window:
    """The fit with a row's own rounded a_p and F_p instead of the fold's."""
    local, form = local_exponent(row.name, row.tabor), normal_form(row.name, row.tabor)
    load, radius = form.load + local.excess, form.radius + local.order_parameter
    excess, moved = load - row.load, radius - row.radius
    kept = (excess >= start) & (excess <= stop) & (moved > 0)
    x, y = np.log(excess[kept]), np.log(moved[kept])
    found = fitted_window(
        LocalExponent(excess[kept], moved[kept], np.gradient(y, x), np.zeros(int(kept.sum()))), start, stop
    )
    assert found is not None
    return found


# Tables and figure


def _progress(text: str) -> None:
    print(text, file=sys.stderr)


def tabors_of(name: str) -> tuple[float, ...]:
    """Tabor coefficients at which the normal form of a case is computed."""
    return TABORS[:-1] if CASES[name].law is cb.VanDerWaals or CASES[name].kind == "touch" else TABORS


def curves_of(name: str) -> tuple[float, ...]:
    """Tabor coefficients at which the local exponent of a case is followed."""
    flat_attraction = CASES[name].law is cb.Gauss and CASES[name].sign > 0
    return CURVES[:-1] if CASES[name].law is cb.VanDerWaals or flat_attraction else CURVES


def power(tabor: float) -> str:
    """A power of two as text."""
    exponent = round(np.log2(tabor))
    return f"{tabor:g}" if exponent >= 0 else f"1/{2**-exponent}"


def normal_form_table() -> list[str]:
    """c2 and the crossover at every fold and onset."""
    rows = ["| law, event | μ_T | a_p | c2 | ΔF× = 18 c2³/c3² |", "| --- | --- | --- | --- | --- |"]
    for name in CASES:
        for tabor in tabors_of(name):
            _progress(f"normal form: {name}, tabor {tabor:g}")
            form = normal_form(name, tabor)
            crossover = "" if np.isnan(form.third) else f"{form.crossover:.6g} ± {rounded_up(form.crossover_error)}"
            rows.append(
                f"| {name} | {power(tabor)} | {form.radius:.6g} | {form.second:.8g} ± {rounded_up(form.second_error)} "
                f"| {crossover} |"
            )
    return rows


def fitted_crossover(name: str, largest: Sequence[float] = (2**-4, 2**-6)) -> PowerLaw:
    """ΔF× ∝ μ_T^p for small μ_T, fitted over more than two decades, with one and two corrections in μ_T^(3/2)."""
    forms = [normal_form(name, tabor) for tabor in tabors_of(name)]
    return fit_power_law(
        [form.tabor for form in forms],
        [form.crossover for form in forms],
        [form.crossover_error + 1e-13 * form.crossover for form in forms],
        CASES[name].small[1],
        largest,
        (1, 2),
    )


def fitted_onset(largest: Sequence[float] = (2**-4, 2**-6)) -> PowerLaw:
    """c2 ∝ μ_T at the continuous onset, from which ΔF× = 9 c2³/32 follows for small μ_T (c3 → 8)."""
    forms = [normal_form("exponential, touch", tabor) for tabor in tabors_of("exponential, touch")]
    return fit_power_law(
        [form.tabor for form in forms],
        [form.second for form in forms],
        [form.second_error for form in forms],
        1.0,
        largest,
        (1, 2),
    )


def law_table() -> list[str]:
    """The crossover for small and large μ_T."""
    rows = [
        "| law, event | exponent: theory | fit | prefactor: theory | fit | ΔF× at μ_T = 16 | limit for μ_T → ∞ |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, case in CASES.items():
        if case.kind == "touch":
            continue
        found = fitted_crossover(name)
        last = f"{normal_form(name, 16.0).crossover:.5g}" if 16.0 in tabors_of(name) else ""
        limit = f"{case.large:.5g}" if case.large else ""
        rows.append(
            f"| {name} | {case.small[1]:g} | {found.exponent:.6f} ± {rounded_up(found.exponent_error)} "
            f"| {case.small[0]:.7g} | {found.prefactor:.7g} ± {rounded_up(found.prefactor_error)} | {last} | {limit} |"
        )
    return rows


def half_way_table() -> list[str]:
    """The excess at which κ_local falls through 5/12."""
    rows = [
        f"| law, event | {' | '.join(f'μ_T = {power(tabor)}' for tabor in CURVES)} |",
        f"| --- |{' --- |' * len(CURVES)}",
    ]
    for name in CASES:
        cells = []
        for tabor in CURVES:
            found = None
            if tabor in curves_of(name):
                _progress(f"local exponent: {name}, tabor {tabor:g}")
                found = half_way(local_exponent(name, tabor))
            cells.append(f"{found:.3g}" if found else "")
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return rows


WINDOWS = ((1e-5, 1e-2), (1e-2, 1e1), (1e1, 1e3))


def window_table() -> list[str]:
    """The paper's Table 1; fits with the true a_p and F_p, and with the printed ones."""
    rows = [
        "| case | μ_T | a, F printed | a, F computed | κ, c printed | κ, c fitted | κ, c with printed a, F "
        "| windows that give the printed κ end at |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in TABLE:
        form, local = normal_form(row.name, row.tabor), local_exponent(row.name, row.tabor)
        own, theirs = windowed(local, *WINDOWS[1]), refitted(row, *WINDOWS[1])
        match = matching_windows(row)
        ends = f"{match[0]:.2g} … {match[1]:.2g}" if match else "—"
        rows.append(
            f"| {row.name} | {power(row.tabor)} | {row.radius:g}, {row.load:g} | {form.radius:.4f}, {form.load:.3f} "
            f"| {row.kappa:g}, {row.prefactor:g} | {own.kappa:.3f} ± {own.kappa_error:.3f}, {own.prefactor:.3f} "
            f"| {theirs.kappa:.3f}, {theirs.prefactor:.3f} | {ends} |"
        )
    return rows


# Exponents for pull-off at μ_T = 1 in the paper's text on Fig. 15.
QUOTED: Final = {"Maugis-Dugdale, pull-off": 0.469, "exponential, pull-off": 0.435}


def main() -> None:
    """Compute, print tables and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", default=str(FIGURE), metavar="FILE", help="where to draw (default: %(default)s)")
    arguments = parser.parse_args()
    onset = fitted_onset()
    tables = {
        "Normal forms": normal_form_table(),
        "Laws of the crossover": law_table(),
        "Excess at which κ_local = 5/12": half_way_table(),
        "Table 1": window_table(),
    }
    for title, rows in tables.items():
        print(f"\n{title}\n")
        print("\n".join(rows))
    print(
        f"\nContinuous onset, c2: exponent {onset.exponent:.7f} ± {rounded_up(onset.exponent_error)} (theory 1), "
        f"prefactor {onset.prefactor:.7f} ± {rounded_up(onset.prefactor_error)} (theory 4π = {4 * np.pi:.7f})"
    )
    for name, kappa in QUOTED.items():
        row = Printed(name, 1.0, np.nan, np.nan, np.nan, kappa)
        found, match = windowed(local_exponent(name, 1.0), *WINDOWS[1]), matching_windows(row)
        ends = f"{match[0]:.2g} … {match[1]:.2g}" if match else "nowhere"
        print(f"\n{name}, μ_T = 1: κ = {found.kappa:.3f} ± {found.kappa_error:.3f} for ΔF = 1e-2 … 10;", end="")
        print(f" three decades that give the printed {kappa} end at {ends}")
    stiff = ", ".join(f"{name}: {value:.5g} μ_T³" for name, value in STIFF.items())
    print(f"\nExcess at κ_local = 5/12 for μ_T → ∞: {stiff}; JKR {half_way(_jkr_local()):.5g}", end="")
    print(f", JKR inside which p > 0 {half_way(_flat_jkr_local()):.5g}")
    draw().savefig(arguments.figure, dpi=200)


STYLE: Final[Any] = {
    "font.size": 8.0,
    "legend.fontsize": 6.5,
    **{f"{axis}tick.direction": "in" for axis in "xy"},
    "xtick.top": True,
    "ytick.right": True,
}
COLOURS = dict(zip(CASES, ("#000000", "#0072B2", "#009E73", "#D55E00", "#CC79A7", "#E69F00"), strict=True))
MARKS = dict(zip(CASES, "xsDo^v", strict=True))
SHADES = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#d8c21a")


def draw() -> Figure:
    """Local exponents, their collapse, the crossover against μ_T, and what fits over windows make of it."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.8), layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(2, 2)
        _draw_local(grid[0, 0])
        _draw_collapse(grid[0, 1])
        _draw_crossover(grid[1, 0])
        _draw_windows(grid[1, 1])
        for axes, letter in zip(grid.flat, "abcd", strict=True):
            axes.set_title(f"({letter})", loc="left", fontsize=8)
    return figure


def _limits(axes: Axes) -> None:
    for value, text in ((1 / 2, "1/2"), (1 / 3, "1/3")):
        axes.axhline(value, color="0.6", lw=0.7, ls=":", zorder=0)
        axes.annotate(text, (1.005, value), xycoords=("axes fraction", "data"), va="center", fontsize=7)


def _draw_local(axes: Axes) -> None:
    name = "Gauss, wetting"
    axes.axvspan(*WINDOWS[1], color="0.93", zorder=0)
    for tabor, colour in zip(CURVES, SHADES, strict=False):
        local = local_exponent(name, tabor)
        axes.plot(local.excess, local.kappa, color=colour, lw=1.2, label=power(tabor))
    _limits(axes)
    axes.set(xscale="log", xlim=(1e-14, 1e5), ylim=(0.31, 0.60))
    axes.set(xlabel=r"$\Delta F = F-F_\mathrm{sw}$", ylabel=r"$\kappa_\mathrm{local}$, Gauss repulsion")
    axes.legend(title=r"$\mu_T$", title_fontsize=7, frameon=False, ncols=2, loc="upper left")


def _draw_collapse(axes: Axes) -> None:
    for name in CASES:
        for tabor, filled in ((1 / 64, True), (1 / 16, False)):
            if tabor not in curves_of(name):
                continue
            local = local_exponent(name, tabor)
            form = normal_form(name, tabor)
            unit = 9 * form.second**3 / 32 if np.isnan(form.third) else form.crossover
            chosen = np.unique(np.searchsorted(local.excess / unit, np.geomspace(1e-6, 1e6, 25)))
            chosen = chosen[chosen < len(local.excess)]
            mark = MARKS[name]
            axes.plot(
                local.excess[chosen] / unit, local.kappa[chosen], mark, color=COLOURS[name], ms=3.2, mew=0.7,
                mfc=COLOURS[name] if filled else "white", label=name if filled else None,
            )  # fmt: skip
    axes.plot(*crossover_curve(), color="0.3", lw=0.9, label="$Aq^2+Bq^3$")
    axes.plot(*jkr_curve(), color="0.3", lw=0.9, ls="--", label="JKR")
    _limits(axes)
    axes.set(xscale="log", xlim=(1e-6, 1e6), ylim=(0.31, 0.52))
    axes.set(xlabel=r"$\Delta F/\Delta F_\times$", ylabel=r"$\kappa_\mathrm{local}$, $\mu_T=1/64$ and $1/16$")
    axes.legend(frameon=False, loc="upper right", bbox_to_anchor=(1.0, 0.9))


def jkr_curve(count: int = 200) -> tuple[Array, Array]:
    """ΔF/ΔF× and κ_local of JKR: F = (4/3) a³ − 2 √(2π) a^(3/2), a_p³ = 9π/8, ΔF× = 54π.

    In x = a/a_p: F = (3π/2)(x³ − 2 x^(3/2)).
    """
    moved = np.geomspace(1e-4, 1e3, count)
    x = 1 + moved
    excess = (np.expm1(1.5 * np.log1p(moved))) ** 2 * (1.5 * np.pi)
    slope = 1.5 * np.pi * (3 * x**2 - 3 * np.sqrt(x))
    return excess / JKR, excess / (moved * slope)


def _draw_crossover(axes: Axes) -> None:
    fine = np.geomspace(2**-7, 1, 50)
    for name, case in CASES.items():
        tabor, found = [], []
        for value in curves_of(name):
            half = half_way(local_exponent(name, value))
            if half:
                tabor.append(value)
                found.append(half)
        axes.plot(tabor, found, MARKS[name], color=COLOURS[name], ms=4, mew=0.9, mfc="none", label=name)
        axes.plot(fine, 5 / 27 * case.small[0] * fine ** case.small[1], color=COLOURS[name], lw=0.7)
    stiff = np.array([3.0, 24.0])
    for limit in (_jkr_local(), _flat_jkr_local()):
        axes.plot(stiff, np.full(2, half_way(limit)), color="0.3", lw=0.8, ls="--")
    for name in ("exponential, touch", "Gauss, wetting"):
        axes.plot(stiff, STIFF[name] * stiff**3, color=COLOURS[name], lw=0.8, ls=":")
    axes.set(xscale="log", yscale="log", xlabel=r"Tabor coefficient $\mu_T$", xlim=(0.01, 25), ylim=(1e-14, 1e6))
    axes.set(ylabel=r"$\Delta F$ at which $\kappa_\mathrm{local}=5/12$")
    axes.legend(frameon=False, loc="lower right")


def _jkr_local() -> LocalExponent:
    share, kappa = jkr_curve()
    return LocalExponent(share * JKR, share, kappa, np.zeros_like(kappa))


def _flat_jkr_local() -> LocalExponent:
    """JKR with the radius r inside which its pressure is positive: r² = a² − √(2π a)/2, r = a_p/√3 at pull-off."""
    scale = (9 * np.pi / 8) ** (1 / 3)
    moved = np.geomspace(1e-4, 1e3, 400)
    x = 1 + moved
    excess = (np.expm1(1.5 * np.log1p(moved))) ** 2 * (1.5 * np.pi)
    slope = 1.5 * np.pi * (3 * x**2 - 3 * np.sqrt(x))
    radius = scale * np.sqrt(x**2 - 2 / 3 * np.sqrt(x))
    radius_slope = scale**2 * (2 * x - np.sqrt(1 / x) / 3) / (2 * radius)
    away = radius - scale / np.sqrt(3)
    return LocalExponent(excess, away, excess * radius_slope / (away * slope), np.zeros_like(x))


def _draw_windows(axes: Axes) -> None:
    for name in ("Gauss, wetting", "exponential, touch"):
        for window, style in zip(WINDOWS, (":", "-", "--"), strict=True):
            tabors = [t for t in CURVES if local_exponent(name, t).excess[0] <= window[0]]
            kappas = [windowed(local_exponent(name, t), *window).kappa for t in tabors]
            axes.plot(
                tabors, kappas, MARKS[name], ls=style, color=COLOURS[name], ms=3.5, lw=1.0,
                mfc="white", label=name if window is WINDOWS[1] else None,
            )  # fmt: skip
        rows = [row for row in TABLE if row.name == name]
        axes.plot(
            [row.tabor for row in rows], [row.kappa for row in rows], "P", color=COLOURS[name], ms=6, mec="white",
            mew=0.5, label=f"{name}: Table 1",
        )  # fmt: skip
    for window, style in zip(WINDOWS, (":", "-", "--"), strict=True):
        low, high = (f"$10^{{{round(np.log10(end))}}}$" for end in window)
        axes.plot([], [], color="0.4", ls=style, lw=1.0, label=rf"$\Delta F$ = {low} … {high}")
    _limits(axes)
    axes.set(
        xscale="log", xlabel=r"Tabor coefficient $\mu_T$", ylabel=r"$\kappa$ fitted over a window", ylim=(0.32, 0.68)
    )
    axes.legend(frameon=False, loc="upper left", ncols=2)


if __name__ == "__main__":
    main()
