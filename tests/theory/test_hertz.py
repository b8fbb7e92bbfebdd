"""Hertz, Love, Galin and Sneddon: known values, and pressures that carry the load."""

import numpy as np
import pytest
from scipy.integrate import quad

from contbranch.errors import InputError
from contbranch.theory import hertz, jkr

A = np.array([0.01, 0.7, 3.0])


def test_parabola_load_and_displacement_satisfy_the_textbook_relation():
    # K. L. Johnson, Contact Mechanics (1985), eq. (4.23): F = (4/3) E sqrt(R) d^(3/2), a^2 = R d
    force = hertz.load(A, radius=2.0, modulus=3.0)
    d = hertz.displacement(A, radius=2.0)
    np.testing.assert_allclose(force, 4.0 / 3.0 * 3.0 * np.sqrt(2.0) * d**1.5, rtol=1e-14)
    np.testing.assert_allclose(hertz.contact_radius(force, radius=2.0, modulus=3.0), A, rtol=1e-14)
    np.testing.assert_allclose(hertz.contact_radius_at_displacement(d, radius=2.0), A, rtol=1e-14)


def test_parabola_peak_pressure_is_three_halves_of_the_mean():
    # Johnson (1985), eq. (4.24)
    mean = hertz.load(A, radius=2.0, modulus=3.0) / (np.pi * A**2)
    np.testing.assert_allclose(hertz.pressure(0.0, A, radius=2.0, modulus=3.0), 1.5 * mean, rtol=1e-14)


def test_gap_is_that_of_the_tip_far_away_and_zero_inside():
    assert np.all(hertz.gap([0.0, 0.5, 1.0], 1.0) == 0.0)
    np.testing.assert_array_less(0.0, hertz.gap([1.001, 1.5, 4.0], 1.0))
    r = 1e4
    # far away the elastic displacement is that of a point load, F / (pi E r)
    lift = hertz.gap(r, 1.0) - (r**2 / 2.0 - 1.0)
    assert lift == pytest.approx(hertz.load(1.0) / (np.pi * r), rel=1e-3)


def test_cone_follows_love_and_sneddon():
    # Sneddon (1965): F = (2/pi) E cot(alpha) d^2 with cot(alpha) the inverse slope, d = (pi/2) slope a
    d = hertz.cone_displacement(A, slope=0.3)
    np.testing.assert_allclose(d, np.pi / 2.0 * 0.3 * A, rtol=1e-15)
    np.testing.assert_allclose(hertz.cone_load(A, slope=0.3, modulus=2.0), 2.0 / np.pi * 2.0 / 0.3 * d**2, rtol=1e-14)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_power_law_contains_cone_and_parabola(exponent):
    options = {"exponent": exponent, "length": 1.7}
    r = np.array([0.01, 0.3, 0.69])
    if exponent == 1.0:
        expected = hertz.cone_load(A), hertz.cone_displacement(A), hertz.cone_pressure(r, 0.7)
    else:
        expected = hertz.load(A, radius=1.7), hertz.displacement(A, radius=1.7), hertz.pressure(r, 0.7, radius=1.7)
    np.testing.assert_allclose(hertz.power_law_load(A, **options), expected[0], rtol=1e-14)
    np.testing.assert_allclose(hertz.power_law_displacement(A, **options), expected[1], rtol=1e-14)
    np.testing.assert_allclose(hertz.power_law_pressure(r, 0.7, **options), expected[2], rtol=1e-13)


def test_quartic_tip_has_galins_constants():
    # zeta = t int_0^t r^3/sqrt(t^2-r^2) dr = (2/3) t^4 for z = r^4/4, so F = (16/15) E a^5 and d = (2/3) a^4
    np.testing.assert_allclose(hertz.power_law_displacement(A, exponent=4.0), 2.0 / 3.0 * A**4, rtol=1e-14)
    force = hertz.power_law_load(A, exponent=4.0)
    np.testing.assert_allclose(force, 16.0 / 15.0 * A**5, rtol=1e-14)
    np.testing.assert_allclose(hertz.power_law_contact_radius(force, exponent=4.0), A, rtol=1e-14)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0, 4.5])
def test_pressure_carries_the_load_and_load_does_work(exponent):
    def ring(r):
        return 2.0 * np.pi * r * hertz.power_law_pressure(r, 1.3, exponent=exponent, length=0.8, modulus=2.0)

    force = hertz.power_law_load(1.3, exponent=exponent, length=0.8, modulus=2.0)
    assert quad(ring, 1e-12, 1.3, epsabs=1e-12)[0] == pytest.approx(float(force), rel=1e-7)
    # dF/dd = 2 E a holds for every axisymmetric tip (Barber and Ciavarella)
    a = 1.3 * np.array([1.0 - 1e-5, 1.0 + 1e-5])
    step_f = np.diff(hertz.power_law_load(a, exponent=exponent, length=0.8, modulus=2.0))
    step_d = np.diff(hertz.power_law_displacement(a, exponent=exponent, length=0.8))
    np.testing.assert_allclose(step_f / step_d, 5.2, rtol=1e-8)


@pytest.mark.parametrize(
    ("function", "numbers"),
    [
        (hertz.load, {"radius": 2.0, "slope": 1.0}),
        (hertz.cone_load, {"radius": 1.0}),
        (hertz.power_law_load, {"radius": 1.0, "exponent": 3.0}),
        (jkr.load, {"slope": 1.0, "exponent": 3.0}),
    ],
)
def test_numbers_of_two_shapes_are_refused(function, numbers):
    with pytest.raises(InputError, match="of one shape"):
        function(1.0, **numbers)


def test_pressure_vanishes_outside():
    assert float(hertz.pressure(1.1, 1.0)) == 0.0
    assert float(hertz.cone_pressure(1.1, 1.0)) == 0.0
    assert float(hertz.power_law_pressure(1.1, 1.0, exponent=3.0)) == 0.0


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: hertz.load(-1.0), "contact_radius"),
        (lambda: hertz.load(1.0, radius=0.0), "radius"),
        (lambda: hertz.contact_radius(-1.0), "load"),
        (lambda: hertz.displacement(float("nan")), "contact_radius"),
        (lambda: hertz.power_law_load(1.0, exponent=0.5), "exponent"),
        (lambda: hertz.power_law_load(1.0), "exponent"),
        (lambda: hertz.cone_load(1.0, slope="steep"), "slope"),
    ],
)
def test_wrong_input_names_its_field(call, field):
    with pytest.raises(InputError, match=f"^{field} must"):
        call()
