"""The studies `onset.py` and `kappa.py`: exponents and prefactors against the perturbation theory of docs/onset.md."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import contbranch as cb

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import kappa, onset  # noqa: E402
from studies.near_touch import softening, touch_side  # noqa: E402
from studies.power_laws import fit_power_law  # noqa: E402


@pytest.fixture(autouse=True)
def _fewer_samples(monkeypatch):
    """Of local exponents, between which they are interpolated."""
    monkeypatch.setattr(kappa, "RATIO", 1.7)


# C of the Gauss and the van der Waals law: nested adaptive quadrature with P, P' and P'' written out, to 1e-12.
SOFTENING = {"Gauss": 1.69568033117, "van der Waals": 2.97824832350}


# How the window of coexistence closes


@pytest.mark.parametrize("name", SOFTENING)
def test_softening_constant(name):
    assert softening(onset.LAWS[name](-1.0, 1.0)) == pytest.approx(SOFTENING[name], rel=1e-10)


def test_displacement_in_the_centre():
    """To leading order the gap at the centre of first touch is opened by K(0) μ^(1/2), K(0) = 8^(3/4) Γ(3/4)/4 (Gauss).

    K(0) = ∫_0^∞ u² exp(−u⁴/8) du; the displacement at touch is that much, since there d = h(0).
    """
    exact = 8**0.75 * math.gamma(0.75) / 4
    assert quad(lambda u: u * u * math.exp(-(u**4) / 8), 0, 10)[0] == pytest.approx(exact, rel=1e-10)
    tabor = 2.0**-12
    touch = touch_side(cb.Contact.reduced(cb.Gauss, tabor=tabor, sign=-1)).at(0.0)
    assert touch.displacement / tabor**0.5 == pytest.approx(exact, rel=3 * tabor**1.5)


@pytest.fixture(scope="module")
def gauss():
    return [onset.measure(cb.Gauss, 2.0**-k) for k in (5, 8, 11)]


@pytest.mark.parametrize("quantity", onset.QUANTITIES)
def test_laws_of_the_onset(gauss, quantity):
    """Exponents 3, 1/2, 5/2, 5/2, 15/2 and their prefactors follow from C alone; fitted over 1.8 decades."""
    tabor, value, error = (
        np.array([o.tabor for o in gauss]),
        np.array([o.values[quantity] for o in gauss]),
        np.array([o.errors[quantity] for o in gauss]),
    )
    c = SOFTENING["Gauss"]
    power, prefactor = {
        "window": (3.0, c * c / (4 * math.pi)),
        "gap": (0.5, c / (2 * math.pi)),
        "radius": (2.5, c / 2),
        "slope": (2.5, c),
        "fall": (7.5, c**3 / 12),
    }[quantity]
    law = fit_power_law(tabor, value, error, power, (2.0**-5,), (1, 2))
    assert law.exponent == pytest.approx(power, abs=2e-6)
    assert law.exponent_error < 1e-4
    assert law.prefactor == pytest.approx(prefactor, rel=1e-6)


def test_van_der_waals_onset():
    """f''(0) = −2 enters: F_sq − F_sw → C² μ³/(8π), a_sw → C μ^(5/2)/2, up to O(ε)."""
    c, tabor = SOFTENING["van der Waals"], 2.0**-6
    found = onset.measure(cb.VanDerWaals, tabor)
    assert found.values["window"] == pytest.approx(c * c / (8 * math.pi) * tabor**3, rel=3 * tabor**1.5)
    assert found.values["radius"] == pytest.approx(c / 2 * tabor**2.5, rel=5 * tabor**1.5)


def test_onset_agrees_with_a_trace():
    """Differences of loads that a double still resolves, by an ordinary trace."""
    found = onset.measure(cb.Gauss, 1 / 16)
    thresholds = cb.trace(cb.Contact.reduced(cb.Gauss, tabor=1 / 16, sign=-1), accuracy=1e-11, modes=0).thresholds
    window = thresholds["squeeze_out_load"] - thresholds["wetting_load"]
    assert found.values["window"] == pytest.approx(window, abs=1e-11)
    assert found.values["radius"] == pytest.approx(thresholds["wetting_radius"], abs=1e-9)
    fall = thresholds["touch_load"] - thresholds["wetting_load"]
    assert found.values["fall"] == pytest.approx(fall, abs=1e-11)


def test_error_estimates_of_the_onset(gauss):
    """The errors stay far below the distance from the leading order, which is O(ε)."""
    for found in gauss:
        for quantity in onset.QUANTITIES:
            away = abs(found.values[quantity] / onset.predicted(cb.Gauss, quantity, found.tabor) - 1)
            assert found.errors[quantity] / found.values[quantity] < 1e-2 * away
            assert away < 3 * found.compliance


def test_pressure_in_contact_makes_the_onset_continuous():
    """With p0 = f'(0) ≠ 0 there is a critical Tabor coefficient, (2π p0/C)^(2/3) to leading order."""
    found, expected = onset.critical_tabor(0.003)
    assert found == pytest.approx(expected, rel=1.5 * expected**1.5)
    assert onset.folds(onset.mixture(0.003, 0.97 * found)) == 0
    assert onset.folds(onset.mixture(0.003, 1.03 * found)) == 2


def test_chart_of_the_onset(gauss, tmp_path):
    """Three panels with logarithmic axes."""
    figure = onset.draw({"Gauss": gauss, "van der Waals": gauss}, [(0.001, 0.0239, 0.0240), (0.01, 0.1105, 0.1145)])
    assert [axes.get_xscale() for axes in figure.axes] == ["log"] * 3
    figure.savefig(tmp_path / "onset.png")
    assert len(onset.onset_table(gauss)) == len(gauss) + 2


# κ


def test_normal_form_in_the_limits():
    """c2 → 6 a_p with a_p³ = 9π/8 and ΔF× → 54π (JKR); c2 → 4π μ and ΔF× → 18π³ μ³ (soft, f'(0) = −1)."""
    stiff = kappa.normal_form("Maugis-Dugdale, pull-off", 64.0)
    assert stiff.second == pytest.approx(6 * (9 * math.pi / 8) ** (1 / 3), rel=3e-4)
    assert stiff.crossover == pytest.approx(54 * math.pi, rel=3e-4)
    for name in ("Maugis-Dugdale, pull-off", "exponential, pull-off"):
        soft = kappa.normal_form(name, 2.0**-10)
        assert soft.second == pytest.approx(4 * math.pi * soft.tabor, rel=2e-4)
        assert soft.crossover == pytest.approx(18 * math.pi**3 * soft.tabor**3, rel=3e-4)


def test_normal_form_where_touch_is_elastic():
    """Attraction and repulsion have the same limit, ΔF× → (9/4) C³ μ^(15/2), from both sides."""
    limit = 2.25 * SOFTENING["Gauss"] ** 3 * (2.0**-6) ** 7.5
    pull_off = kappa.normal_form("Gauss, pull-off", 2.0**-6).crossover
    wetting = kappa.normal_form("Gauss, wetting", 2.0**-6).crossover
    assert wetting < limit < pull_off
    assert pull_off - wetting < 2e-2 * limit
    # The part of a JKR contact in which the pressure is positive: 1350π/289, reached from below.
    assert 0.95 * 1350 * math.pi / 289 > kappa.normal_form("Gauss, pull-off", 4.0).crossover > 0.8 * kappa.FLAT_JKR


def test_normal_form_agrees_with_the_diagram():
    """`Event.exponent`, from other samples on other meshes; κ = 1/2 because c2 is not zero."""
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1), accuracy=1e-9, modes=0)
    (event,) = (event for event in diagram.folds("load") if event.name == "wetting")
    form = kappa.normal_form("Gauss, wetting", 1.0)
    assert form.second > 1e4 * form.second_error
    assert form.second == pytest.approx(2 / event.exponent.prefactor**2, rel=1e-4)
    assert form.crossover == pytest.approx(event.exponent.crossover_load, rel=2e-3)
    local, own = diagram.local_exponent(event), kappa.local_exponent("Gauss, wetting", 1.0)
    inside = (local.excess > 1e-4) & (local.excess < 50)
    expected = np.interp(np.log(local.excess[inside]), np.log(own.excess), own.kappa)
    assert np.abs(local.kappa[inside] - expected).max() < 2e-3


def test_local_exponents_end_where_the_mesh_does():
    """At μ_T = 16 the mesh of the pull-off fold is lost in the rim's zone (1/512 wide) soon: nothing is reported there.

    κ_local falls from 1/2 to 1/3 (JKR, within the radius where its pressure is positive), so that none exceeds 1/2.
    """
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, tabor=16.0), modes=0, max_load=1.0)
    (event,) = (event for event in diagram.folds("load") if event.name == "pull-off")
    local = diagram.local_exponent(event)
    assert len(local.kappa) > 20
    assert (local.kappa - local.error <= 0.5).all()
    expected = kappa._flat_jkr_local()
    inside = (local.excess > 1e-5) & (local.excess < 0.05)
    assert local.kappa[inside] == pytest.approx(
        np.interp(np.log(local.excess[inside]), np.log(expected.excess), expected.kappa), abs=2e-3
    )


def test_continuous_onset():
    """F − F_t = 2π μ a² + …: c2 → 4π μ with a correction of order ε, κ = 1/2 at touch and 1/3 far beyond."""
    form = kappa.normal_form("exponential, touch", 2.0**-8)
    assert form.second == pytest.approx(4 * math.pi * 2.0**-8, rel=0.3 * (2.0**-8) ** 1.5)
    assert form.second > 1e6 * form.second_error
    local = kappa.local_exponent("exponential, touch", 1 / 16)
    assert local.kappa[0] == pytest.approx(0.5, abs=1e-3)
    assert local.kappa[-1] == pytest.approx(1 / 3, abs=0.01)


@pytest.mark.parametrize("name", ["Gauss, wetting", "exponential, pull-off"])
def test_local_exponents_collapse(name):
    """For soft films κ_local is one function of ΔF/ΔF×, that of A q² + B q³, over all of its range."""
    local, form = kappa.local_exponent(name, 1 / 16), kappa.normal_form(name, 1 / 16)
    share, universal = kappa.crossover_curve(400)
    expected = np.interp(np.log(local.excess / form.crossover), np.log(share), universal)
    assert np.abs(local.kappa - expected).max() < 0.01
    assert kappa.half_way(local) == pytest.approx(5 / 27 * form.crossover, rel=0.05)


def test_windows_make_exponents():
    """F − F_p = q² + q³ fitted over windows far below and far above its crossover: 1/2 and 1/3."""
    q = np.geomspace(1e-5, 1e5, 300)
    local = kappa.LocalExponent(q**2 + q**3, q, (1 + q) / (2 + 3 * q), np.zeros_like(q))
    assert kappa.windowed(local, 1e-9, 1e-7).kappa == pytest.approx(0.5, abs=1e-3)
    assert kappa.windowed(local, 1e9, 1e11).kappa == pytest.approx(1 / 3, abs=1e-3)
    between = kappa.windowed(local, 1e-2, 1e1)
    assert 0.36 < between.kappa < 0.48
    assert between.kappa_error > 0.03
    # The paper's 0.46 (Gauss, μ_T = 1) is such a fit.
    assert kappa.windowed(kappa.local_exponent("Gauss, wetting", 1.0), 1e-2, 1e1).kappa == pytest.approx(
        0.46, abs=0.005
    )


def test_jkr_exponent():
    """Half-way from 1/2 to 1/3 in JKR, from F(a) itself by bisection."""

    def exponent(x: float) -> float:
        excess = x**3 - 2 * x**1.5 + 1
        return excess / ((x - 1) * (3 * x**2 - 3 * x**0.5))

    low, high = 1.01, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if exponent(middle) > 5 / 12 else (low, middle)
    assert kappa.half_way(kappa._jkr_local()) == pytest.approx(1.5 * math.pi * (low**3 - 2 * low**1.5 + 1), rel=1e-3)


def test_chart_of_kappa(monkeypatch, tmp_path):
    """Four panels, here with two of the cases and one Tabor coefficient."""
    monkeypatch.setattr(kappa, "CURVES", (1.0,))
    names = ("Gauss, wetting", "exponential, touch")
    monkeypatch.setattr(kappa, "CASES", {name: kappa.CASES[name] for name in names})
    figure = kappa.draw()
    assert len(figure.axes) == 4
    figure.savefig(tmp_path / "kappa.png")
