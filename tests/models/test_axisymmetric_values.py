"""Known values and limits of the axisymmetric model: Hertz, DMT, JKR, and numbers computed elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

import contbranch as cb
from contbranch.theory import jkr


def test_exponential_attraction_at_a_contact_radius():
    # Computed with 180 nodes of another discretisation to 14 digits.
    state = cb.solve(cb.Contact.reduced(cb.Exponential, 1.0), contact_radius=2.0, accuracy=1e-10)
    assert state.load == pytest.approx(-1.77602806946951, abs=1e-10)
    assert state.displacement == pytest.approx(1.40063348264108, abs=1e-10)
    assert state.contact_radius == 2.0
    assert state.central_gap == 0.0
    assert abs(state.load + 1.77602806946951) <= state.error["load"] <= 1e-10 * 1.8
    assert abs(state.displacement - 1.40063348264108) <= state.error["displacement"] <= 1e-10 * 1.5


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9])
def test_gauss_repulsion_has_the_folds_known(accuracy):
    # Ten digits from a discretisation with 600 unknowns.
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, 1.0, -1), accuracy=accuracy)
    assert diagram.status == "complete"
    folds = {event.name: event for event in diagram.folds("load")}
    allowed = accuracy * 9 + 6e-10
    assert folds["wetting"].load == pytest.approx(8.006511412, abs=allowed)
    assert folds["wetting"].contact_radius == pytest.approx(0.257102062, abs=allowed)
    assert folds["squeeze-out"].load == pytest.approx(8.377051440, abs=allowed)
    assert folds["squeeze-out"].central_gap == pytest.approx(0.356424410, abs=allowed)
    assert diagram.thresholds["wetting_load"] == folds["wetting"].load
    assert diagram.thresholds["wetting_radius"] == folds["wetting"].contact_radius
    assert "squeeze_out_radius" not in diagram.thresholds


# Without interaction (Hertz, Galin, Sneddon): z = c rⁿ gives d and F by gamma functions, the sphere by logarithms.
def power_law(a, n, c, modulus):
    d = c * n * math.sqrt(math.pi) * math.gamma(n / 2) / (2 * math.gamma((n + 1) / 2)) * a**n
    return d, 2 * modulus * n / (n + 1) * d * a


def sphere(a, radius, modulus):
    logarithm = math.log((radius + a) / (radius - a))
    return a / 2 * logarithm, modulus * ((a * a + radius * radius) / 2 * logarithm - a * radius)


TIPS = [
    (cb.Parabola(2.5), lambda a, e: power_law(a, 2, 1 / 5.0, e)),
    (cb.Cone(0.3), lambda a, e: power_law(a, 1, 0.3, e)),
    (cb.PowerLaw(3.0, 2.0), lambda a, e: power_law(a, 3, 1 / 12.0, e)),
    (cb.PowerLaw(1.5, 1.0), lambda a, e: power_law(a, 1.5, 1 / 1.5, e)),
    (cb.SphericalCap(2.0), lambda a, e: sphere(a, 2.0, e)),
]


@pytest.mark.parametrize(("tip", "solution"), TIPS, ids=["parabola", "cone", "cubic", "n=1.5", "sphere"])
@pytest.mark.parametrize("modulus", [1.0, 3.0])
def test_contact_without_interaction(tip, solution, modulus):
    contact = cb.Contact(tip, None, modulus)
    for a in (0.05, 0.8):
        d, load = solution(a, modulus)
        state = cb.solve(contact, contact_radius=a, accuracy=1e-12)
        assert state.displacement == pytest.approx(d, rel=1e-12)
        assert state.load == pytest.approx(load, rel=1e-12)
        assert state.unstable_load == state.unstable_displacement == 0
        assert cb.solve(contact, load=load, accuracy=1e-12).contact_radius == pytest.approx(a, rel=1e-12)
        assert cb.solve(contact, displacement=d, accuracy=1e-12).contact_radius == pytest.approx(a, rel=1e-12)


@pytest.mark.parametrize("exponent", [1.0, 1.3, 2.0, 2.7, 4.4])
def test_pressure_down_to_the_apex(exponent):
    """p(r) = (1/π) ∫ ζ'(t)/√(t² − r²) dt with ζ = c tⁿ, for the cone a c arccosh(a/r)/π (Sneddon 1965)."""
    tip = cb.Cone(1.0) if exponent == 1.0 else cb.PowerLaw(exponent, 1.0)
    state = cb.solve(cb.Contact(tip, None), contact_radius=1.0, accuracy=1e-10)
    inside = state.r < 1.0
    c = state.displacement  # ζ(a) = d where nothing pulls
    wanted = [
        quad(lambda y, r=r: c * exponent * (r * math.cosh(y)) ** (exponent - 1), 0.0, math.acosh(1 / r), limit=200)[0]
        for r in state.r[inside]
    ]
    assert state.r[0] < 1e-5
    np.testing.assert_allclose(state.pressure[inside], np.array(wanted) / math.pi, rtol=1e-8)


def test_trace_without_interaction():
    diagram = cb.trace(cb.Contact(cb.Parabola(2.0), None, 3.0), accuracy=1e-12)
    branch, touch = diagram.branches[0], next(event for event in diagram.events if event.kind == "touch")
    assert diagram.status == "complete"
    assert (touch.load, touch.displacement) == (0.0, 0.0)
    assert not list(diagram.folds())
    radius = branch.contact_radius
    assert branch.displacement[radius > 0] == pytest.approx(radius[radius > 0] ** 2 / 2.0, rel=1e-12)
    assert branch.load == pytest.approx(4 * 3.0 * radius**3 / (3 * 2.0), rel=1e-12, abs=1e-12)
    # V = ∫ F dd = (8/15) E a⁵/R²
    assert branch.energy == pytest.approx(8 * 3.0 * radius**5 / (15 * 4.0), rel=1e-12, abs=1e-12)


def test_hertzian_pressure_without_interaction():
    # p = (2/π)(E/R) √(a² − r²) in the contact
    state = cb.solve(cb.Contact(cb.Parabola(2.0), None, 3.0), contact_radius=1.0, accuracy=1e-10)
    inside = state.r < 0.999
    expected = 2 / np.pi * 1.5 * np.sqrt(1 - state.r[inside] ** 2)
    assert state.pressure[inside] == pytest.approx(expected, rel=1e-10)
    assert state.wall_pressure[inside] == pytest.approx(expected, rel=1e-10)
    assert state.gap[inside] == pytest.approx(0.0)


def rate(values: dict[float, float]) -> float:
    """Exponent q of values ~ tabor^q between the last two Tabor coefficients."""
    (m0, v0), (m1, v1) = list(values.items())[-2:]
    return math.log(v1 / v0) / math.log(m1 / m0)


def test_jkr_limit_of_exponential_attraction():
    """Pull-off load and radius, pull-off displacement, and the radius at zero load: errors fall like 1/mu_T²."""
    quantities = {
        "pull_off_load": jkr.load_fold().load,
        "pull_off_radius": jkr.load_fold().contact_radius,
        "pull_off_displacement": jkr.displacement_fold().displacement,
        "zero_load_radius": jkr.contact_radius(0.0),
    }
    distance: dict[str, dict[float, float]] = {name: {} for name in quantities}
    for tabor in (16.0, 32.0):
        contact = cb.Contact.reduced(cb.Exponential, tabor)
        found = dict(cb.trace(contact, accuracy=1e-9, max_load=1.0, modes=0).thresholds)
        found["zero_load_radius"] = cb.solve(contact, load=0.0, accuracy=1e-9).contact_radius
        for name, limit in quantities.items():
            distance[name][tabor] = float(limit) - found[name]
    for name, values in distance.items():
        assert values[32.0] > 0, name
        assert rate(values) == pytest.approx(-2.0, abs=0.03), name
    assert distance["pull_off_load"][32.0] < 2e-3


@pytest.mark.parametrize(
    ("tip", "folds"),
    [
        (cb.Cone(0.7), (jkr.cone_load_fold(slope=0.7), jkr.cone_displacement_fold(slope=0.7))),
        (
            cb.PowerLaw(3.0, 1.0),
            (jkr.power_law_load_fold(exponent=3.0), jkr.power_law_displacement_fold(exponent=3.0)),
        ),
    ],
    ids=["cone", "cubic"],
)
def test_jkr_limit_of_other_tips(tip, folds):
    load, displacement = folds
    distance: dict[str, dict[float, float]] = {"load": {}, "radius": {}, "displacement": {}}
    for reach in (1 / 16, 1 / 32):
        contact = cb.Contact(tip, cb.Exponential(1.0, reach), 1.0)
        found = cb.trace(contact, accuracy=1e-8, max_load=1.0, modes=0).thresholds
        distance["load"][1 / reach] = float(load.load) - found["pull_off_load"]
        distance["radius"][1 / reach] = float(load.contact_radius) - found["pull_off_radius"]
        distance["displacement"][1 / reach] = float(displacement.displacement) - found["pull_off_displacement"]
    for values in distance.values():
        assert rate(values) == pytest.approx(-2.0, abs=0.06)


@pytest.mark.parametrize("sign", [1, -1])
def test_first_touch_of_a_stiff_contact(sign):
    """Bradley's load and its first correction for the exponential law, mu_T → 0.

    The undeformed tip's pressure bends the surface by w = −s √(2π/z0) e^(−r²/4z0) I0(r²/4z0), s the sign of the work;
    with ∫ e^(−3x/2) I0(x/2) dx = 1/√2 the load at first touch is −2πs + 4π √(π/2) (1 − 1/√2) mu^(3/2) + O(mu³).
    """
    correction = 4 * math.pi * math.sqrt(math.pi / 2) * (1 - math.sqrt(0.5))
    left = {}
    for tabor in (1 / 64, 1 / 256):
        found = cb.trace(cb.Contact.reduced(cb.Exponential, tabor, sign), accuracy=1e-10).thresholds["touch_load"]
        left[tabor] = sign * (found + 2 * math.pi * sign - correction * tabor**1.5)
    assert abs(left[1 / 256]) < 1e-6
    assert rate(left) == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("law", [cb.Gauss, cb.VanDerWaals, cb.InverseSquare], ids=lambda law: law.name)
def test_pull_off_of_a_stiff_contact_is_dmts(law):
    distance = {}
    for tabor in (1 / 64, 1 / 256):
        found = cb.trace(cb.Contact.reduced(law, tabor), accuracy=1e-9).thresholds["pull_off_load"]
        distance[tabor] = found + 2 * math.pi
    assert 0 < distance[1 / 256] < 3e-3
    assert rate(distance) == pytest.approx(1.5, abs=0.05)


def test_numbers_of_the_fold_list_of_a_strong_exponential_attraction():
    diagram = cb.trace(cb.Contact.reduced(cb.Exponential, 4.0), accuracy=1e-8)
    loads = [(round(event.load, 3), event.name) for event in diagram.folds("load")]
    assert loads == [(-0.536, None), (-0.503, None), (-4.794, "pull-off")]


def test_solve_returns_the_value_asked_for_and_agrees_with_itself():
    contact = cb.Contact.reduced(cb.Exponential, 1.0)
    by_load = cb.solve(contact, load=1.5625, accuracy=1e-10)
    assert by_load.load == 1.5625
    by_radius = cb.solve(contact, contact_radius=by_load.contact_radius, accuracy=1e-10)
    by_displacement = cb.solve(contact, displacement=by_load.displacement, accuracy=1e-10)
    assert by_displacement.displacement == by_load.displacement
    for name in ("load", "displacement", "contact_radius", "energy"):
        assert getattr(by_radius, name) == pytest.approx(getattr(by_load, name), abs=1e-9)
        assert getattr(by_displacement, name) == pytest.approx(getattr(by_load, name), abs=1e-9)
    assert by_load.contact_radius == pytest.approx(2.2902, abs=5e-5)  # three programs on grids of 512²


@pytest.mark.parametrize("beyond", [1e-4, 1e-2])
def test_states_just_beyond_first_touch_are_in_contact(beyond):
    contact = cb.Contact.reduced(cb.Exponential, 1.0, -1)  # convex: contact beyond the touch, and only there
    touch = cb.trace(contact, accuracy=1e-8).thresholds
    by_load = cb.solve(contact, load=touch["touch_load"] + beyond, accuracy=1e-8)
    by_displacement = cb.solve(contact, displacement=touch["touch_displacement"] + beyond, accuracy=1e-8)
    for state in (by_load, by_displacement):
        assert state.contact_radius > 0
        assert state.gap.min() >= -1e-9
        again = cb.solve(contact, contact_radius=state.contact_radius, accuracy=1e-8)
        assert again.load == pytest.approx(state.load, abs=3e-7)
        assert again.displacement == pytest.approx(state.displacement, abs=1e-7)
    before = cb.solve(contact, load=touch["touch_load"] - beyond, accuracy=1e-8)
    assert before.central_gap > 0
    assert before.contact_radius == 0


@pytest.mark.parametrize("below", [1e-3, 6e-3, 2e-2])
def test_states_on_both_sides_of_a_fold_are_found(below):
    """Under the jump-in of the exponential attraction, mu_T = 1 (d = −1.69649394): far away, unstable, in contact."""
    contact = cb.Contact.reduced(cb.Exponential, 1.0)
    found = cb.solve(contact, displacement=-1.696493939409 - below, accuracy=1e-8)
    states = sorted(found.states, key=lambda state: -state.load)
    assert len(states) == 3
    loads = [state.load for state in states]
    assert loads[0] > -2.72315677 > loads[1] > loads[2]  # the load at jump-in lies between the first two
    assert [state.unstable_displacement for state in states] == [0, 1, 0]
    assert [state.contact_radius > 0 for state in states] == [False, below > 0.0318, True]
