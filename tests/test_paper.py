"""The figures of the paper, `studies/paper`, in their fast modes: against closed forms and what the paper prints."""

from __future__ import annotations

import csv
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import quad

import contbranch as cb

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from contbranch.theory import jkr, maugis  # noqa: E402
from contbranch.threads import one_thread  # noqa: E402
from studies import kappa  # noqa: E402
from studies.paper import (  # noqa: E402
    all as every,
    common,
    cos_fits,
    fig04,
    fig08,
    fig12,
    fig18,
    table1,
)

# Of every figure some numbers that do not come from this package: closed forms, other programs, the paper.
KNOWN = {
    "fig03": {"mu_T/\\lambda": (2 * np.pi / 9) ** (1 / 3), "typical contact": 0.4},
    "fig04": {"contact radius at": 2.2902, "without adhesion": (0.75 * 1.5625) ** (1 / 3), "weight": 3 + 2 * 2**0.5},
    "fig05": {"T = 4": -4.0, "T = 0.25": -0.25},
    "fig08": {"gap closes": 1.97},
    "fig10": {"JKR, $(4/3)": (4 / 3) ** (1 / 3), "DMT, $2": 2 ** (2 / 3)},
    "fig11": {"mu_T = 2^{-16}": 0.75 * (1 + 2 * np.pi),
              "extrapolated": 0.75 * (1 + 3 * np.pi + (6 * np.pi + 9 * np.pi**2) ** 0.5)},
    "fig13": {"F_0": 3.0},
    "fig14": {"c_1": np.pi / 3, "c_5": -8 / (3 * np.pi**0.5), "c_6": 6 ** (1 / 3) / 36},
    "fig19": {"radius, Gauss": 1.73, "radius 1.73": 60.0},
    "table1": {"Gauss, $\\mu_T$ = 1: $F_{sw}": 8.0065, "Gauss, $\\mu_T$ = 1: $F_{sq}": 8.37705},
}  # fmt: skip


@pytest.fixture(autouse=True)
def _fewer_samples(monkeypatch):
    """Of local exponents, between which they are interpolated."""
    monkeypatch.setattr(kappa, "RATIO", 1.7)


@pytest.mark.parametrize("name", sorted(every.NAMES))
def test_figure(name, tmp_path):
    """Nothing differs from the paper without a reason that covers the difference, and known numbers come out."""
    result = one_thread(importlib.import_module(f"studies.paper.{name}").make)(True)
    assert result.name == name
    assert isinstance(result.figure, Figure)
    assert not [one for one in (*result.findings, *result.statements) if one.verdict == "DIFFERS"]
    for words, value in KNOWN.get(name, {}).items():
        found = [one.ours for one in result.findings if words in one.quantity]
        assert found, words
        assert found[0] == pytest.approx(value, rel=2e-3), words
    result.figure.set_layout_engine("none")
    for axes in result.figure.axes:  # ticks and the room for them take most of the time, and are matplotlib's own
        axes.set(xticks=[], yticks=[])
        axes.minorticks_off()
    assert common.save(result, tmp_path).stat().st_size > 5000
    assert result.told().text() == result.text()
    assert not set("$\\") & set(result.text())


def test_reasons_cover_what_they_cover():
    """A difference beyond the reading accuracy, the error and what a reason accounts for is none that is explained."""
    plain = common.Finding("q", "(1)", 1.0, 0.05, 1.04)
    assert plain.verdict == "agrees"
    explained = common.Finding("q", "(1)", 1.0, 0.05, 1.2, 0.0, "window", "so", 0.16)
    assert explained.verdict == "window"
    assert common.Finding("q", "(1)", 1.0, 0.05, 1.2, 0.0, "window", "so", 0.14).verdict == "DIFFERS"
    assert common.Finding("q", "(1)", 1.0, 0.05, 1.2).verdict == "DIFFERS"
    assert common.Statement("s", "(1)", "f", False).verdict == "DIFFERS"
    rows = common.findings_table([plain, explained])
    assert "| 1.00 ± 0.05 |" in rows
    assert "so" in rows.splitlines()[-1]
    assert "so" not in rows.splitlines()[-2]
    page = every.page([common.Result("fig02", "title", "caption", Figure(), [plain, explained])])
    assert "| numbers | 2 | 1 | 1 (1 window) | 0 |" in page


def test_formulas_are_written_in_unicode():
    """No TeX is left, so that a page needs no renderer of formulas."""
    text = (
        r"$\tilde\mu_T \approx 10^{-4}$, $\sqrt{{2/3}}\,a_{JKR}$, $6^{1/3}$, $a_c^3$, $v'_{fr}$, 1 $F_{sw}\pi$".replace(
            "{{", "{"
        )
    )
    text = text.replace("}}", "}")
    assert common.plain(text) == "μ̃_T ≈ 10⁻⁴, √(2/3) a_JKR, 6^(1/3), a_c³, v′_fr, 1 F_swπ"


def test_gap_beyond_the_profile():
    """Rings of pressure continue the gap of the profile, and that of Hertz' contact is Sneddon's."""
    state = common.solved("exponential", 4.0, 0.0)
    end = float(state.r[-1])
    before, after = common.gap_at(state, np.array([end, end * (1 + 1e-9)]))
    assert after == pytest.approx(before, abs=1e-5)
    force = 4 / 3
    hertz = cb.solve(cb.Contact(tip=cb.Parabola(1.0)), load=force, model=cb.Axisymmetric())
    r = np.array([1.2, 3.0, 6.0])
    found = common.gap_at(hertz, r)
    sneddon = [(2 / np.pi) * quad(lambda t, x=x: (t**2 - 1) / (x**2 - t**2) ** 0.5, 1, x)[0] for x in r]
    assert found == pytest.approx(sneddon, rel=1e-4)


def test_branches_are_those_of_the_closed_form():
    """Splines through the rows of a trace, and JKR for a large Tabor coefficient."""
    load = np.linspace(-4.0, 10.0, 29)
    radius, displacement = common.branch("exponential", 64.0).at_load(load)
    assert radius == pytest.approx(jkr.contact_radius(load), rel=2e-3)
    assert displacement == pytest.approx(jkr.contact_radius(load) ** 2 - np.sqrt(2 * np.pi * radius), abs=6e-3)
    limit = common.jkr_branch()
    assert limit.load[limit.stable][0] == pytest.approx(-1.5 * np.pi, rel=1e-9)
    soft = common.branch("exponential", 2.0**-14).at_load(load)
    assert soft == pytest.approx(np.array(common.dmt_branch().at_load(load)), abs=0.03)


def test_neck_and_closing_gap():
    """JKR's neck is at its contact radius; the Gauss gap closes where JKR's pressure is positive, at √(2/3) of it.

    Faster than 1/μ_T: what is left from 8 to 16 falls by a factor of three.
    """
    limits = common.JKR_RADIUS * np.array([1.0, (2 / 3) ** 0.5])
    states = [common.solved("Gauss", tabor, 0.0) for tabor in (8.0, 16.0)]
    far, near = (np.abs([fig08.steepest(one), one.contact_radius] / limits - 1) for one in states)
    assert (near < [4e-3, 2e-3]).all()
    assert (near < far / 3).all()
    assert np.isnan(fig08.steepest(common.solved("Gauss", 2.0**-4, 0.0)))


def test_energy_decides_about_a_prefactor():
    """dV/dd = F holds with 4/3 in (35), to the accuracy of differences."""
    printed, corrected = fig12.conditions()
    assert corrected < 1e-6 < 1e-2 < printed


def test_weight_of_point_forces_by_summation():
    """w of w u_X − (w − 1) u_M from Fourier sums of 1/q over a cell, as the displacement of periodic point forces."""
    n = np.arange(-400, 401)
    q = np.hypot(*np.meshgrid(n, n))
    kernel = np.exp(-((q / 120.0) ** 2)) / np.where(q > 0, q, np.inf)
    corner, middle = (np.sum(kernel * np.cos(np.pi * (k * n[:, None] + n))) for k in (1, 0))
    local = -3.90026492 / 1.0  # mean displacement less that of the far field, in F/(πEL)
    corner, middle = corner / 1.0, middle / 1.0
    assert (local - middle) / (corner - middle) == pytest.approx(fig04.point_force_weight(), rel=1e-3)


def test_rigid_tips():
    """Far from touch F = 2π f(−d): ζ μ_T is 1 and √2."""
    assert fig18.decay("exponential", 2.0**-4) == pytest.approx(1.0, abs=0.01)
    assert fig18.decay("Gauss", 2.0**-4) == pytest.approx(2**0.5, abs=0.02)


def test_fits_with_four_numbers_find_a_power_law(monkeypatch):
    """Of a = a_0 + c ΔF^κ, with the fold of the row."""
    row = table1.TABLE[2]
    form = table1.normal_form(row.name, row.tabor)
    excess = np.geomspace(1e-6, 2e3, 60)
    exact = 0.6 * excess**0.4
    law = table1.LocalExponent(excess, exact, np.full(60, 0.4), np.zeros(60))
    monkeypatch.setattr(table1, "local_exponent", lambda name, tabor: law)
    for fit in table1.free_fits.__wrapped__(row, True):
        assert (fit.radius, fit.prefactor, fit.kappa) == pytest.approx((form.radius, 0.6, 0.4), abs=2e-4)
        assert fit.load == pytest.approx(form.load, abs=1e-5)


# Tables for simulations


def test_tables_of_fits(tmp_path):
    """Pull-off is exact, errors are those of the closed form, and F(d) has the jumps of displacement control."""
    tabor = 4.0
    first, second = cos_fits.write(tmp_path, ("Maugis-Dugdale",), (tabor,))
    with first.open(encoding="utf-8") as file:
        fits = list(csv.DictReader(file))
    fold = maugis.load_fold(interaction_range=1 / tabor)
    assert [row["form"] for row in fits] == ["cos", "modified", "free"]
    for row in fits:
        assert float(row["pull_off_load"]) == pytest.approx(-float(fold.load), rel=1e-6)
        assert float(row["radius_error"]) < 1e-3
    with second.open(encoding="utf-8") as file:
        rows = [{key: float(value) for key, value in row.items() if key != "law"} for row in csv.DictReader(file)]
    approach = [row for row in rows if row["direction"] > 0]
    jump = next(k for k in range(len(approach)) if approach[k + 1]["contact_radius"] > 0)
    assert approach[jump]["displacement"] == approach[jump + 1]["displacement"]
    assert approach[jump + 1]["load"] < approach[jump]["load"]
    retraction = [row for row in rows if row["direction"] < 0 and row["contact_radius"] > 0]
    pull_off = maugis.displacement_fold(interaction_range=1 / tabor)
    assert retraction[-1]["displacement"] == pytest.approx(float(pull_off.displacement), rel=1e-6)
    assert retraction[-1]["load"] == pytest.approx(float(pull_off.load), rel=1e-3)
    for row in retraction:
        exact = maugis.contact(row["contact_radius"], interaction_range=1 / tabor)
        assert row["load"] == pytest.approx(float(exact.load), abs=2e-6)  # as the radius is rounded, to eight digits
        if row["displacement"] > float(fold.displacement):
            assert row["load_fitted"] == pytest.approx(row["load"], abs=2e-3 * float(-fold.load))
