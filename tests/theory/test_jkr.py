"""JKR, eq. (28) of the paper, both folds, and the cone and power-law tips."""

import numpy as np
import pytest

from contbranch.errors import InputError
from contbranch.theory import hertz, jkr, maugis

CONSTANTS = {"radius": 2.0, "modulus": 3.0, "work_of_adhesion": 0.5}


def test_contact_radius_is_equation_28():
    force = np.array([-1.5 * np.pi, -4.0, 0.0, 10.0])
    expected = 0.75 * (force + 3.0 * np.pi + np.sqrt(6.0 * np.pi * force + 9.0 * np.pi**2))
    np.testing.assert_allclose(jkr.contact_radius(force) ** 3, expected, rtol=1e-14)


@pytest.mark.parametrize("stable", [True, False])
def test_load_and_contact_radius_are_inverse(stable):
    # no cancellation on the unstable part, down to loads of no size
    force = np.array([-2.3, -1.0, -1e-6, -1e-12])
    a = jkr.contact_radius(force, stable=stable, **CONSTANTS)
    tolerance = {"atol": 3e-14} if stable else {"rtol": 1e-13}
    np.testing.assert_allclose(jkr.load(a, **CONSTANTS), force, **({"rtol": 0.0} | tolerance))
    assert np.all((a > jkr.load_fold(**CONSTANTS).contact_radius) == stable)


def test_folds_of_the_parabola():
    # Johnson, Kendall and Roberts (1971): F = -(3/2) pi w R; Maugis (1992): F = -(5/6) pi w R with fixed grips
    fold = jkr.load_fold(**CONSTANTS)
    assert float(fold.load) == pytest.approx(-1.5 * np.pi, rel=1e-14)
    assert float(fold.contact_radius) ** 3 == pytest.approx(9.0 * np.pi * 0.5 * 4.0 / (8.0 * 3.0), rel=1e-14)
    assert float(fold.displacement) == pytest.approx(-(float(fold.contact_radius) ** 2) / (3.0 * 2.0), rel=1e-13)
    fold = jkr.displacement_fold(**CONSTANTS)
    assert float(fold.load) == pytest.approx(-5.0 / 6.0 * np.pi, rel=1e-14)
    assert float(fold.contact_radius) ** 3 == pytest.approx(np.pi * 0.5 * 4.0 / (8.0 * 3.0), rel=1e-14)
    assert float(fold.displacement) == pytest.approx(-3.0 * float(fold.contact_radius) ** 2 / 2.0, rel=1e-14)


def test_displacement_and_contact_radius_are_inverse_on_the_stable_part():
    fold = jkr.displacement_fold(**CONSTANTS)
    a = float(fold.contact_radius) * np.array([1.0, 1.0 + 1e-6, 1.3, 3.0, 1e4])
    d = jkr.displacement(a, **CONSTANTS)
    found = jkr.contact_radius_at_displacement(d, **CONSTANTS)
    np.testing.assert_allclose(found, a, rtol=3e-8)  # the square root of the round-off, at the fold
    np.testing.assert_allclose(found[2:], a[2:], rtol=1e-14)
    with pytest.raises(InputError, match=r"^displacement must be at least"):
        jkr.contact_radius_at_displacement(float(fold.displacement) - 0.1, **CONSTANTS)


def test_maugis_dugdale_approaches_it_for_short_range_as_the_square():
    # (50), (51): the corrections are O(mu_T^-2)
    a = np.array([0.8, 2.0])
    errors = [
        np.max(np.abs(maugis.contact(a, interaction_range=1.0 / mu).load - jkr.load(a))) for mu in (100.0, 1000.0)
    ]
    assert errors[0] < 3e-4
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.02)


def test_cone_follows_its_known_pull_off():
    # Maugis and Barquins, J. Phys. D 14, 1979 (1981): pull-off -54 w^2/(pi E slope^3) at a = 18 w/(pi E slope^2)
    options = {"slope": 0.4, "modulus": 3.0, "work_of_adhesion": 0.5}
    fold = jkr.cone_load_fold(**options)
    assert float(fold.load) == pytest.approx(-54.0 * 0.25 / (np.pi * 3.0 * 0.4**3), rel=1e-13)
    assert float(fold.contact_radius) == pytest.approx(18.0 * 0.5 / (np.pi * 3.0 * 0.16), rel=1e-13)
    assert float(fold.displacement) == pytest.approx(3.0 * 0.5 / (3.0 * 0.4), rel=1e-13)
    fold = jkr.cone_displacement_fold(**options)
    assert float(fold.displacement) == pytest.approx(-0.5 / (3.0 * 0.4), rel=1e-13)
    assert float(fold.contact_radius) == pytest.approx(2.0 * 0.5 / (np.pi * 3.0 * 0.16), rel=1e-13)


def test_power_law_contains_cone_and_parabola():
    a = np.array([0.01, 0.5, 3.0])
    for exponent, general in ((1.0, (jkr.cone_load, jkr.cone_displacement)), (2.0, (jkr.load, jkr.displacement))):
        np.testing.assert_allclose(jkr.power_law_load(a, exponent=exponent), general[0](a), rtol=1e-13)
        np.testing.assert_allclose(jkr.power_law_displacement(a, exponent=exponent), general[1](a), rtol=1e-13)
    for found, expected in (
        (jkr.power_law_load_fold(exponent=2.0), jkr.load_fold()),
        (jkr.power_law_displacement_fold(exponent=1.0), jkr.cone_displacement_fold()),
    ):
        np.testing.assert_allclose(np.array(found), np.array(expected), rtol=1e-13)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0, 4.0])
def test_power_law_folds_are_where_the_slopes_vanish(exponent):
    options = {"exponent": exponent, "length": 1.4, "modulus": 2.0, "work_of_adhesion": 0.7}
    near = np.array([1.0 - 1e-4, 1.0, 1.0 + 1e-4])
    for fold, curve in (
        (jkr.power_law_load_fold(**options), jkr.power_law_load),
        (jkr.power_law_displacement_fold(**options), jkr.power_law_displacement),
    ):
        left, middle, right = curve(fold.contact_radius * near, **options)
        assert left > middle < right
        assert abs(right - left) < 1e-3 * (right - 2.0 * middle + left)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.5])
def test_rim_has_the_fracture_toughness_of_griffith(exponent):
    # dF/da at fixed d by reciprocity: V_ela = E int h^2 gives dV/da = E [d - zeta(a)]^2 = 2 pi a w
    a, options = 0.9, {"exponent": exponent, "length": 1.4}
    excess = jkr.power_law_displacement(a, modulus=2.0, work_of_adhesion=0.7, **options)
    excess = excess - hertz.power_law_displacement(a, **options)
    assert 2.0 * float(excess) ** 2 == pytest.approx(2.0 * np.pi * a * 0.7, rel=1e-13)


def test_unreachable_loads_are_refused():
    with pytest.raises(InputError, match=r"^load must be at least -4\.712"):
        jkr.contact_radius(-4.8)
    with pytest.raises(InputError, match=r"the unstable part ends at load 0"):
        jkr.contact_radius(0.1, stable=False)
    with pytest.raises(InputError, match=r"^work_of_adhesion must"):
        jkr.load(1.0, work_of_adhesion=-1.0)
