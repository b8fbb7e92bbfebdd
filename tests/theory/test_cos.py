"""COS (47), its modified form (48)-(49) and the fits at zero load (52)-(53), against the exact Maugis-Dugdale
solution.
"""

import numpy as np
import pytest

from contbranch.errors import InputError
from contbranch.theory import cos, dmt, jkr, maugis

UNIT = np.cbrt(2.0 * np.pi / 9.0)  # mu_T over Maugis' lambda, (43)
LENGTH = np.cbrt(3.0 * np.pi / 4.0)  # (44)


def exact(tabor):
    """Contact radii and loads from pull-off to a = 4, with the radius at zero load and the pull-off."""
    fold, free = maugis.load_fold(interaction_range=1.0 / tabor), maugis.zero_load(interaction_range=1.0 / tabor)
    a = np.linspace(float(fold.contact_radius), 4.0, 2000)
    return a, maugis.contact(a, interaction_range=1.0 / tabor).load, float(free.contact_radius), fold


def test_cos_contains_jkr_and_dmt():
    force = np.linspace(-4.7, 20.0, 7)
    found = cos.contact_radius(force, zero_load_radius=jkr.contact_radius(0.0), pull_off_load=1.5 * np.pi, alpha=1.0)
    np.testing.assert_allclose(found, jkr.contact_radius(force), rtol=1e-13)
    found = cos.contact_radius(force, zero_load_radius=dmt.contact_radius(0.0), pull_off_load=2.0 * np.pi, alpha=0.0)
    np.testing.assert_allclose(found, dmt.contact_radius(force), rtol=1e-13)


def test_modified_offset_is_three_pi_for_jkr():
    # (49) with the radius at pull-off; as printed, with the one at zero load, it gives 7.5 pi
    fold = jkr.load_fold()
    offset = cos.modified_offset(pull_off_load=-fold.load, pull_off_radius=fold.contact_radius)
    assert float(offset) == pytest.approx(3.0 * np.pi, rel=1e-14)
    printed = cos.modified_offset(pull_off_load=-fold.load, pull_off_radius=jkr.contact_radius(0.0))
    assert float(printed) == pytest.approx(7.5 * np.pi, rel=1e-14)


def test_modified_cos_contains_jkr_in_any_units():
    constants = {"radius": 2.0, "modulus": 3.0, "work_of_adhesion": 0.5}
    force = np.linspace(-4.7, 20.0, 7)
    fold, elastic = jkr.load_fold(**constants), {"radius": 2.0, "modulus": 3.0}
    peak = {"pull_off_load": -fold.load, "pull_off_radius": fold.contact_radius}
    alpha = cos.modified_alpha(zero_load_radius=jkr.contact_radius(0.0, **constants), **peak, **elastic)
    assert float(alpha) == pytest.approx(np.sqrt(6.0 * np.pi), rel=1e-13)
    found = cos.modified_contact_radius(force, alpha=alpha, **peak, **elastic)
    np.testing.assert_allclose(found, jkr.contact_radius(force, **constants), rtol=1e-12)


@pytest.mark.parametrize("tabor", [0.25, 1.0, 4.0])
def test_fitted_alpha_keeps_cos_within_one_percent(tabor):
    # (49), Fig. 13: relative errors below about 1 % with the parameter adjusted in -F_p < F < 2 F_p; both forms
    a, force, free, fold = exact(tabor)
    window = force < -2.0 * fold.load
    a, force = a[window], force[window]
    peak = float(-fold.load)

    def worst(radius):
        return np.max(np.abs(radius / a - 1.0))

    first = [
        worst(cos.contact_radius(force, zero_load_radius=free, pull_off_load=peak, alpha=x))
        for x in np.linspace(0.0, 1.2, 61)
    ]
    options = {"pull_off_load": peak, "pull_off_radius": fold.contact_radius}
    second = worst(
        cos.modified_contact_radius(force, alpha=cos.modified_alpha(zero_load_radius=free, **options), **options)
    )
    assert 1e-5 < min(first) < 0.01
    assert 1e-5 < second < 0.01


def test_modified_cos_is_exact_at_pull_off_and_zero_load():
    _, _, free, fold = exact(1.0)
    options = {"pull_off_load": -fold.load, "pull_off_radius": fold.contact_radius}
    alpha = cos.modified_alpha(zero_load_radius=free, **options)
    assert float(cos.modified_contact_radius(0.0, alpha=alpha, **options)) == pytest.approx(free, rel=1e-13)
    at_pull_off = cos.modified_contact_radius(fold.load, alpha=alpha, **options)
    assert float(at_pull_off) == pytest.approx(float(fold.contact_radius), rel=1e-13)


def test_zero_load_fits_have_the_stated_accuracy():
    # (52), (53): the fits as printed stay below 0.28 % and 0.30 % for lambda in [1e-3, 1e3]
    lam = np.geomspace(1e-3, 1e3, 301)
    free = maugis.zero_load(interaction_range=1.0 / (UNIT * lam))
    radius = np.max(np.abs(cos.zero_load_radius(lam) * LENGTH / free.contact_radius - 1.0))
    displacement = np.max(np.abs(cos.zero_load_displacement(lam) * LENGTH**2 / free.displacement - 1.0))
    assert 0.0025 < radius < 0.0028
    assert 0.0028 < displacement < 0.0030


def test_exact_asymptotic_constants():
    # (52), (53): c1 = pi/3, c5 = -8/(3 sqrt(pi)) and c6 = 6^(1/3)/36, here extracted from the exact solution
    lam = np.array([1e-6, 1e-8])
    free = maugis.zero_load(interaction_range=1.0 / (UNIT * lam))
    c1 = (free.contact_radius / LENGTH - np.cbrt(2.0)) / lam
    c5 = (free.displacement / LENGTH**2 - np.cbrt(4.0)) / np.sqrt(lam)
    assert c1[0] == pytest.approx(cos.ASYMPTOTIC_RADIUS_C1, rel=2e-3)
    assert c5[1] == pytest.approx(cos.ASYMPTOTIC_DISPLACEMENT_C5, rel=3e-4)
    stiff = maugis.zero_load(interaction_range=1.0 / (UNIT * 100.0))
    c6 = (stiff.displacement / LENGTH**2 - np.cbrt(4.0 / 3.0)) * 1e4
    assert float(c6) == pytest.approx(cos.ASYMPTOTIC_DISPLACEMENT_C6, rel=2e-4)


def test_original_parameters_of_cos_are_less_accurate_than_the_fits():
    # below (53), Fig. 14: the maximum relative error at zero load falls from 1.5 % to 0.3 %
    lam = np.geomspace(1e-3, 1e3, 301)
    tabor = UNIT * lam
    free, fold = maugis.zero_load(interaction_range=1.0 / tabor), maugis.load_fold(interaction_range=1.0 / tabor)
    assert 0.01 < np.max(np.abs(cos.empirical_zero_load_radius(lam) * LENGTH / free.contact_radius - 1.0)) < 0.015
    assert np.max(np.abs(cos.pull_off(lam) * np.pi / -fold.load - 1.0)) < 0.02
    assert float(cos.alpha(1e-9)) == pytest.approx(1e-9 / (0.924 * 1.02), rel=1e-6)
    # (49), Fig. 13 with COS' own alpha: within 3 % for mu_T = 1, from pull-off upwards
    a, force, radius, peak = exact(1.0)
    found = cos.contact_radius(force, zero_load_radius=radius, pull_off_load=-peak.load, alpha=cos.alpha(1.0 / UNIT))
    assert np.max(np.abs(found / a - 1.0)) < 0.03


# Fits to branches


@pytest.mark.parametrize("form", cos.FORMS)
def test_fits_recover_jkr_in_any_units(form):
    """JKR is a member of all forms: a(F), d(F) and F(d) down to the loss of contact."""
    constants = {"radius": 2.0, "modulus": 3.0, "work_of_adhesion": 0.5}
    fold = jkr.load_fold(**constants)
    load = np.linspace(float(fold.load), 20.0, 101)
    a = jkr.contact_radius(load, **constants)
    d = a**2 / 2.0 - np.sqrt(2.0 * np.pi * 0.5 * a / 3.0)
    found = cos.fit(load, a, d, form=form, radius=2.0, modulus=3.0)
    assert found.exponent == pytest.approx(0.5, abs=1e-6)
    assert found.alpha == pytest.approx(1.0 if form == "cos" else np.sqrt(6.0 * np.pi * 0.5 * 2.0), rel=1e-5)
    assert found.lift == pytest.approx((0.0, 2.0 * np.pi * 0.5 / 3.0), abs=1e-9)
    assert max(found.error, found.displacement_error) < 1e-6
    np.testing.assert_allclose(found.contact_radius(load), a, rtol=1e-6)
    lost = np.cbrt(np.pi * 0.5 * 2.0**2 / (8.0 * 3.0))  # dd/da = 0
    assert found.detachment_radius == pytest.approx(lost, rel=1e-6)
    radii = np.linspace(1.02 * lost, a[-1], 50)
    force = 4.0 * radii**3 / 2.0 - np.sqrt(8.0 * np.pi * 0.5 * 3.0) * radii**1.5
    height = radii**2 / 2.0 - np.sqrt(2.0 * np.pi * 0.5 * radii / 3.0)
    np.testing.assert_allclose(found.load(radii), force, atol=1e-5)
    np.testing.assert_allclose(found.displacement(radii), height, atol=1e-8)
    np.testing.assert_allclose(found.force(height), force, atol=1e-4)
    assert float(found.force(float(height[0]) - 0.1)) == 0.0


def test_fit_with_a_free_exponent_is_the_best():
    """The paper, after Fig. 15: it reduces errors by a little more than a factor of two at mu_T = 1."""
    fold = maugis.load_fold(interaction_range=1.0)
    a = float(fold.contact_radius) + np.append(0.0, np.geomspace(1e-6, 2.0, 4000))
    exact = maugis.contact(a, interaction_range=1.0)
    load = np.linspace(float(fold.load), -2.0 * float(fold.load), 201)
    radius = np.interp(load, exact.load, a)
    radius[0] = a[0]
    modified, free = (cos.fit(load, radius, form=form) for form in ("modified", "free"))
    assert 2.0 < modified.error / free.error < 2.3
    assert np.isnan(free.displacement_error)
    assert float(free.contact_radius(float(fold.load))) == pytest.approx(float(fold.contact_radius), rel=1e-12)
    back = free.load(free.contact_radius(load))
    np.testing.assert_allclose(back, load, atol=1e-9)


def test_fits_refuse_what_is_no_branch():
    load, a = np.array([-1.0, 0.5, 1.0, 2.0]), np.array([1.0, 1.5, 1.7, 2.0])
    for field, arguments in {
        "form": (load, a, None, "jkr"),
        "load": (load[::-1], a, None, "cos"),
        "contact_radius": (load + 2.0, a, None, "cos"),
        "displacement": (load, a, a[:-1], "cos"),
    }.items():
        with pytest.raises(InputError, match=rf"^{field} must"):
            cos.fit(*arguments[:3], form=arguments[3])


def test_wrong_input_names_its_field():
    with pytest.raises(InputError, match=r"^load must be at least -3 "):
        cos.contact_radius(-3.1, zero_load_radius=1.0, pull_off_load=3.0, alpha=0.5)
    with pytest.raises(InputError, match=r"^maugis_lambda must"):
        cos.zero_load_radius(0.0)
    with pytest.raises(InputError, match=r"^constants must be 4 numbers"):
        cos.zero_load_radius(1.0, constants=(1.0, 2.0))
