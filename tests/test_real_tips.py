"""Tips of real probes: waves, round ends, rough profiles; and JKR's theory for any of them."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

import contbranch as cb
from contbranch.theory import jkr

TIPS = [
    cb.WavySphere(1.0, 0.01, 0.2),
    cb.WavySphere(1.0, -0.0005, 0.2),
    cb.Hyperboloid(0.5, 0.3),
    cb.Hyperboloid.pyramid(35.0, 20.0),
]


def abel(tip, t):
    """ζ by its definition."""
    return t * quad(lambda angle: float(tip.height_derivative(t * np.sin(angle))), 0, np.pi / 2, limit=500)[0]


@pytest.mark.parametrize("tip", TIPS, ids=str)
def test_transforms_by_their_definition(tip):
    for t in np.array([0.05, 0.3, 1.7]) * tip.natural_length:
        assert float(tip.transform(t)) == pytest.approx(abel(tip, t), rel=1e-8)
        step = 1e-5 * t
        slope = (tip.transform(t + step) - tip.transform(t - step)) / (2 * step)
        assert float(tip.transform_derivative(t)) == pytest.approx(float(slope), rel=1e-7)
        steep = (tip.height(t + step) - tip.height(t - step)) / (2 * step)
        assert float(tip.height_derivative(t)) == pytest.approx(float(steep), rel=1e-7)
        assert float(tip.transform_integral(t)) == pytest.approx(quad(tip.transform, 0, t, limit=500)[0], rel=1e-9)


@pytest.mark.parametrize("tip", TIPS, ids=str)
def test_gaps_by_their_definition(tip):
    a = 0.7 * tip.natural_length
    rho = np.array([0.1, 0.5, 2.0, 8.0]) * tip.natural_length
    gap, slope = tip.shape_gap(rho, a)
    step = 1e-6 * a
    around = (tip.shape_gap(rho, a + step)[0] - tip.shape_gap(rho, a - step)[0]) / (2 * step)
    assert np.allclose(slope, around, rtol=1e-6, atol=1e-8 * abs(slope).max())
    for place, value in zip(rho, gap, strict=True):
        r = math.hypot(place, a)

        def rise(angle, r=r):
            return float(tip.transform(r * np.sin(angle)) - tip.transform(a))

        wanted = quad(rise, math.asin(a / r), math.pi / 2, limit=2000, epsabs=1e-12)[0]
        assert value == pytest.approx(2 / math.pi * wanted, rel=1e-9, abs=1e-10)
    assert np.allclose(tip.shape_gap(rho, 0.0)[0], tip.height(rho), rtol=1e-12)


def test_pressures_bear_the_load():
    tip, a = cb.WavySphere(1.0, 0.01, 0.2), 0.9
    angle, weights = np.polynomial.legendre.leggauss(200)
    angle = math.pi / 4 * (angle + 1)
    r = a * np.sin(angle)
    load = 2 * math.pi * (math.pi / 4 * weights * tip.contact_pressure(r, a) * r * a * np.cos(angle)).sum()
    expected = 2 * float(a * tip.transform(a) - tip.transform_integral(a))
    assert load == pytest.approx(expected, rel=1e-6)


def test_a_pyramid_has_the_sections_of_its_cone():
    tip, r = cb.Hyperboloid.pyramid(35.0, 20.0), 1e6
    side = 2 * float(tip.height(r)) * math.tan(math.radians(35.0))
    assert side**2 == pytest.approx(math.pi * r**2, rel=1e-3)
    assert float(tip.height(1e-3)) == pytest.approx(1e-6 / 40, rel=1e-6)


class Stairs(cb.Tip):
    """A user's tip whose transform is too rough for quadrature."""

    natural_length = 1.0

    def height(self, r):
        return np.asarray(r) ** 2 / 2

    def height_derivative(self, r):
        return np.asarray(r)

    def transform(self, t):
        return np.floor(1e4 * np.asarray(t) ** 2) / 1e4

    def transform_derivative(self, t):
        return 2 * np.asarray(t) * (1.0 + np.sign(np.sin(2e4 * np.asarray(t))))

    def scaled(self, in_plane, normal):
        return self


def test_a_tip_that_quadrature_does_not_resolve_says_so():
    assert "resolved" in Stairs().limitation
    assert not cb.WavySphere(1.0, 0.01, 0.2).limitation


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: cb.WavySphere(1.0, -0.1, 0.2), "amplitude"),
        (lambda: cb.WavySphere(1.0, 0.1, 0.0), "wavelength"),
        (lambda: cb.Hyperboloid.pyramid(95.0, 1.0), "half_angle"),
        (lambda: cb.Hyperboloid(0.0, 1.0), "slope"),
    ],
)
def test_impossible_tips(make, field):
    with pytest.raises(cb.InputError, match=field):
        make()


def test_a_rough_profile_whose_transform_does_not_rise():
    r = 6.0 * np.arange(16)
    z = r**2 / 60.0
    z[4:6] = z[3] + np.array([0.012, 0.032])
    tip = cb.Profile(tuple(r), tuple(z))
    assert (np.diff(tip.transform(np.linspace(1.0, 90.0, 800))) < 0.0).any()
    diagram = cb.trace(
        cb.Contact.physical(
            modulus="1 GPa", tip=tip, interaction="exponential", work_of_adhesion="50 mN/m", range="0.4 nm"
        )
    )
    assert diagram.status == "complete"
    assert diagram.thresholds["pull_off_load"] < 0.0


# -- JKR's theory of any tip ------------------------------------------------------------------------------------------
def test_jkr_of_any_tip_has_the_closed_forms():
    radii = np.linspace(0.01, 3.0, 300)
    for tip, shape in ((cb.Parabola(1.3), {"radius": 1.3}), (cb.PowerLaw(2.5, 0.8), {"exponent": 2.5, "length": 0.8})):
        load, displacement = jkr.curve(tip, radii, modulus=2.0, work_of_adhesion=0.7)
        constants = {"modulus": 2.0, "work_of_adhesion": 0.7}
        own = (jkr.load, jkr.displacement) if "radius" in shape else (jkr.power_law_load, jkr.power_law_displacement)
        assert np.allclose(load, own[0](radii, **constants, **shape), rtol=1e-12, atol=1e-12)
        assert np.allclose(displacement, own[1](radii, **constants, **shape), rtol=1e-12, atol=1e-12)
    (fold,) = jkr.folds(cb.Parabola(1.0), radii)
    assert float(fold.load) == pytest.approx(-1.5 * math.pi, rel=1e-12)
    (fold,) = jkr.folds(cb.Parabola(1.0), radii, "displacement")
    assert float(fold.load) == pytest.approx(-5 * math.pi / 6, rel=1e-12)
    with pytest.raises(cb.InputError, match="control"):
        jkr.folds(cb.Parabola(1.0), radii, "spring")
    with pytest.raises(cb.InputError, match="tip"):
        jkr.curve(cb.EllipticParaboloid(1.0, 2.0), radii)


def test_a_wavy_sphere_in_a_short_range_follows_jkr():
    """The pull-off of a contact that was pressed together is that of the theory, to what the range changes."""
    tip = cb.WavySphere(1.0, 0.003, 0.8)
    folds = jkr.folds(tip, np.linspace(0.05, 3.0, 400))
    theory = min(float(fold.load) for fold in folds)
    errors = []
    for tabor in (10.0, 40.0):
        diagram = cb.trace(cb.Contact(tip, cb.Exponential(1.0, 1 / tabor)), max_load=15.0)
        assert diagram.status == "complete"
        errors.append(abs(diagram.thresholds["pull_off_load"] / theory - 1))
    assert errors[1] < 0.4 * errors[0] < 0.02


def test_jkr_of_a_flat_punch_is_the_limit_of_powers():
    """F = √(8πEwa³) of a punch of radius a, which r^n becomes."""
    (fold,) = jkr.folds(cb.PowerLaw(400.0, 1.0), np.linspace(0.9, 1.1, 2000), modulus=2.0, work_of_adhesion=0.5)
    assert float(fold.load) == pytest.approx(-math.sqrt(8 * math.pi * 2.0 * 0.5), rel=0.02)


def test_jkr_of_a_cone_with_a_round_end_is_fitted():
    tip = cb.Hyperboloid(0.7, 30.0)
    a = np.linspace(1.0, 400.0, 600)
    load, depth = jkr.curve(tip, a, modulus=1e-3, work_of_adhesion=2e-3)
    load, depth = load[depth > 0.0], depth[depth > 0.0]
    force = np.concatenate([np.zeros(200), load]) + 2e-3 * np.random.default_rng(1).normal(size=200 + load.size)
    position = np.concatenate([np.linspace(-500.0, 0.0, 200), depth])
    curve = cb.ForceCurve(piezo=position + force / 0.05, force=force, spring="50 mN/m")
    contact = cb.Contact.physical(
        modulus="2 MPa", tip=tip, interaction="maugis-dugdale", work_of_adhesion="1 mN/m", range="1 nm"
    )
    fit = cb.fit(curve, contact, free=("modulus", "work_of_adhesion"), law="jkr", fixed=("tilt",))
    assert fit.values["modulus"] == pytest.approx(1e-3, rel=0.02)
    assert fit.values["work_of_adhesion"] == pytest.approx(2e-3, rel=0.05)
