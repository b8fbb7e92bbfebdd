"""Tips against their definitions: ζ(t) = t ∫_0^t z'(r)/√(t²-r²) dr and g = (2/π) ∫_a^r (ζ(t)-ζ(a))/√(r²-t²) dt.

The references are these integrals by mpmath at 34 digits, with the singular end removed by t = r sin θ or, near the
rim, by τ = ρ sin ψ.
"""

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad

from contbranch.contact.tips import TIPS, Cone, Parabola, PowerLaw, Profile, SphericalCap, Tip
from contbranch.errors import InputError

EPS = np.finfo(float).eps


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(34):
        yield


def _power(n, length, steepness=1):
    n, length, steepness = mp.mpf(n), mp.mpf(length), mp.mpf(steepness)
    return (
        lambda r: steepness * (r / length) ** (n - 1) * r / n,
        lambda t: steepness * length ** (1 - n) * t**n * mp.beta(n / 2, 0.5) / 2,
    )


def _cap(radius, steepness=1):
    radius, steepness = mp.mpf(radius), mp.mpf(steepness)
    return (
        lambda r: steepness * (radius - mp.sqrt(radius**2 - r**2)),
        lambda t: steepness * t * mp.atanh(t / radius),
    )


# tip, its profile and its transform at any precision
SHAPES = {
    "parabola": (Parabola(1.3), lambda r: r**2 / (2 * mp.mpf(1.3)), lambda t: t**2 / mp.mpf(1.3)),
    "cone": (Cone(0.7), lambda r: mp.mpf(0.7) * r, lambda t: mp.pi / 2 * mp.mpf(0.7) * t),
    "power-law": (PowerLaw(2.7, 1.4), *_power(2.7, 1.4)),
    "blunt": (PowerLaw(6, 0.9, 1.7), *_power(6, 0.9, 1.7)),
    "pointed": (PowerLaw(1.2, 1.4), *_power(1.2, 1.4)),
    "spherical-cap": (SphericalCap(70.0), *_cap(70.0)),
    "steep-cap": (SphericalCap(61.0, 2.5), *_cap(61.0, 2.5)),
}
shapes = pytest.mark.parametrize(("tip", "height", "transform"), SHAPES.values(), ids=SHAPES)


def _gap(transform, rho, a):
    """The gap by its definition; integrands of order one, because the integrator's tolerance is absolute."""
    rho, a = mp.mpf(rho), mp.mpf(a)
    r = mp.sqrt(a * a + rho * rho)
    unit = transform(r)
    if rho > a:
        rise = mp.quad(lambda theta: (transform(r * mp.sin(theta)) - transform(a)) / unit, [mp.asin(a / r), mp.pi / 2])
        return 2 / mp.pi * unit * rise
    unit *= (rho / a) ** 2

    def integrand(psi):
        tau = rho * mp.sin(psi)
        t = mp.sqrt(a * a + tau * tau)
        return (transform(t) - transform(a)) / unit * (mp.sin(psi) * a / t)

    return 2 / mp.pi * unit * (rho / a) * mp.quad(integrand, [0, mp.pi / 2])


@shapes
def test_height_and_its_derivative(tip, height, transform):
    for r in (1e-6, 0.3, 2.0, 40.0):
        assert float(tip.height(r)) == pytest.approx(float(height(mp.mpf(r))), rel=20 * EPS)
        slope = mp.diff(height, mp.mpf(r), h=mp.mpf(r) * mp.mpf("1e-10"))
        assert float(tip.height_derivative(r)) == pytest.approx(float(slope), rel=1e-13)
    assert float(tip.height(0.0)) == 0.0


@shapes
def test_transform_is_the_abel_transform_of_the_profile(tip, height, transform):
    for t in (1e-3, 0.8, 5.0, 40.0):
        t = mp.mpf(t)
        wanted = t * mp.quad(lambda theta, t=t: mp.diff(height, t * mp.sin(theta)), [0, mp.pi / 4, mp.pi / 2])
        assert float(tip.transform(float(t))) == pytest.approx(float(wanted), rel=1e-11)
        # the closed form that the gaps below are computed from is the same function
        assert float(transform(t)) == pytest.approx(float(wanted), rel=1e-11)


@shapes
def test_transform_derivative_and_integrals(tip, height, transform):
    for t in (1e-3, 0.8, 5.0, 40.0):
        assert float(tip.transform_derivative(t)) == pytest.approx(float(mp.diff(transform, mp.mpf(t))), rel=1e-13)
        places = [0, mp.mpf(t) / 100, mp.mpf(t)]
        assert float(tip.transform_integral(t)) == pytest.approx(float(mp.quad(transform, places)), rel=1e-13)
        square = mp.quad(lambda s: transform(s) ** 2, places)
        assert float(tip.transform_square_integral(t)) == pytest.approx(float(square), rel=1e-13)
    assert float(tip.transform_integral(0.0)) == 0.0


@shapes
@pytest.mark.parametrize("a", [1e-8, 0.3, 30.0])
def test_gap_by_its_definition(tip, height, transform, a):
    rho = np.array([1e-6, 0.29, 0.31, 7.0, 50.0])
    gap, slope = tip.shape_gap(rho, a)
    step = mp.mpf(a) * mp.mpf("1e-7")
    for place, value, derivative in zip(rho, gap, slope, strict=True):
        wanted = _gap(transform, place, a)
        # rounding is relative to what cancels: ζ(a) ρ/r
        scale = float(wanted + transform(mp.mpf(a)) * place / math.hypot(place, a))
        assert value == pytest.approx(float(wanted), abs=8 * EPS * scale)
        if place in (0.31, 7.0):  # differences lose digits of the integrals for small a
            difference = (_gap(transform, place, a + step) - _gap(transform, place, a - step)) / (2 * step)
            cancels = float(mp.diff(transform, mp.mpf(a))) * place / math.hypot(place, a)
            assert derivative == pytest.approx(float(difference), rel=1e-12 + 1e-18 / a, abs=8 * EPS * cancels)


@shapes
def test_gap_without_contact_is_the_height(tip, height, transform):
    rho = np.array([0.0, 1e-6, 0.3, 7.0, 50.0])
    gap, slope = tip.shape_gap(rho, 0.0)
    np.testing.assert_allclose(gap, tip.height(rho), rtol=8 * EPS)
    # ∂g/∂a = -ζ'(0) (2/π) arccos(0) at a = 0: the rim moves on a cone only
    np.testing.assert_allclose(slope[1:], -float(tip.transform_derivative(0.0)), rtol=1e-13, atol=0.0)


@shapes
def test_contact_radius_inverts_the_transform(tip, height, transform):
    a = np.array([[0.0, 1e-7, 1e-3], [0.5, 3.0, 55.0]])
    np.testing.assert_allclose(tip.contact_radius(tip.transform(a)), a, rtol=1e-14)


@shapes
def test_radius_at_inverts_the_height(tip, height, transform):
    r = np.array([1e-3, 0.5, 3.0, 55.0])
    r = r[r < 0.5 * tip.extent]
    np.testing.assert_allclose([tip.radius_at(float(tip.height(one))) for one in r], r, rtol=1e-12)


@shapes
def test_scaled_tip_is_the_same_tip(tip, height, transform):
    in_plane, normal = 3.7, 0.45
    other = tip.scaled(in_plane, normal)
    r = np.array([0.1, 2.0, 11.0])
    np.testing.assert_allclose(other.height(r / in_plane), tip.height(r) / normal, rtol=1e-14)
    np.testing.assert_allclose(other.transform(r / in_plane), tip.transform(r) / normal, rtol=1e-14)
    gap, slope = tip.shape_gap(r, 1.5)
    scaled_gap, scaled_slope = other.shape_gap(r / in_plane, 1.5 / in_plane)
    np.testing.assert_allclose(scaled_gap, gap / normal, rtol=1e-12)
    np.testing.assert_allclose(scaled_slope, slope * in_plane / normal, rtol=1e-12)


@shapes
def test_reduced_scales_make_the_tip_one_without_parameters(tip, height, transform):
    adhesion_length = 0.02
    x, z = tip.reduced_scales(adhesion_length)
    assert z * z == pytest.approx(adhesion_length * x, rel=1e-14)  # then |Δγ| = 1 in units of E Z²/X
    n = tip.apex_exponent
    r = 1e-4
    # in these units z = r^n/n near the apex, which for n = 2 is R = 1, (23) and (24)
    assert float(tip.scaled(x, z).height(r)) == pytest.approx(r**n / n, rel=1e-7)


def test_scales_of_the_parabola_are_those_of_the_paper():
    # (23), (24) for R = 1000 nm, |Δγ| = 0.04 nN/nm, E = 5 nN/nm²: 1000^(2/3) 0.008^(1/3) and 1000^(1/3) 0.008^(2/3)
    assert Parabola(1000.0).reduced_scales(0.04 / 5.0) == pytest.approx((20.0, 0.4), rel=1e-15)


def test_power_law_contains_parabola_and_cone():
    rho = np.linspace(0.0, 4.0, 9)
    for power, other in ((PowerLaw(2, 1.3), Parabola(1.3)), (PowerLaw(1, 8.0, 0.7), Cone(0.7))):
        np.testing.assert_allclose(power.transform(rho), other.transform(rho), rtol=1e-14)
        for a in (0.0, 0.5, 3.0):
            for mine, wanted in zip(power.shape_gap(rho[1:], a), other.shape_gap(rho[1:], a), strict=True):
                np.testing.assert_allclose(mine, wanted, rtol=1e-12, atol=1e-15)


def test_spherical_cap_near_its_equator():
    tip, (_, transform) = SphericalCap(2.0), _cap(2.0)
    a = 1.2
    rho = np.sqrt(np.array([1.3, 1.9, 1.9999]) ** 2 - a * a)
    gap, slope = tip.shape_gap(rho, a)
    step = mp.mpf("1e-9")
    for place, value, derivative in zip(rho, gap, slope, strict=True):
        assert value == pytest.approx(float(_gap(transform, place, a)), rel=1e-12)
        difference = (_gap(transform, place, a + step) - _gap(transform, place, a - step)) / (2 * step)
        assert derivative == pytest.approx(float(difference), rel=1e-9)


@pytest.mark.parametrize(
    ("tip", "a"),
    [(PowerLaw(3.3, 1.0), 0.7), (PowerLaw(1.4, 1.0), 0.7), (PowerLaw(6.0, 1.0), 0.7), (SphericalCap(2.0), 1.1)],
    ids=["blunt", "pointed", "bluntest", "cap"],
)
def test_pressure_in_a_contact_without_interaction(tip, a):
    """π p(r) = ∫_r^a ζ'/√(t² − r²) dt, with t² = r² + s²."""
    for r in (0.0, 0.01 * a, 0.4 * a, 0.99 * a):

        def density(s, r=r):
            t = math.hypot(r, s)
            return float(tip.transform_derivative(t)) / t

        whole, _ = quad(density, 0.0, math.sqrt(a * a - r * r), epsabs=1e-13, epsrel=1e-12, limit=200)
        assert float(tip.contact_pressure(np.float64(r), a)) == pytest.approx(whole / math.pi, rel=1e-10)


def test_spherical_cap_ends_at_its_equator():
    tip = SphericalCap(2.0)
    assert tip.extent == 2.0
    assert np.all(np.isinf(tip.height([2.1, 3.0])))
    assert np.all(np.isinf(tip.transform([2.0, 3.0])))
    assert np.all(np.isinf(tip.shape_gap(np.array([1.9, 4.0]), 1.0)[0]))
    assert float(tip.height(2.0)) == 2.0
    assert Parabola(2.0).extent == math.inf


def test_a_tip_of_the_users_own_needs_no_integrals():
    @dataclasses.dataclass(frozen=True)
    class Mine(Tip):
        radius: float

        @property
        def natural_length(self):
            return self.radius

        def height(self, r):
            return np.asarray(r) ** 2 / (2 * self.radius)

        def height_derivative(self, r):
            return np.asarray(r) / self.radius

        def transform(self, t):
            return np.asarray(t) ** 2 / self.radius

        def transform_derivative(self, t):
            return 2 * np.asarray(t) / self.radius

    mine, known = Mine(1.3), Parabola(1.3)
    rho = np.linspace(0.0, 6.0, 13)
    for a in (0.0, 0.2, 5.0):
        for value, wanted in zip(mine.shape_gap(rho, a), known.shape_gap(rho, a), strict=True):
            np.testing.assert_allclose(value, wanted, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(mine.transform_integral(a), known.transform_integral(a), rtol=1e-14)
        np.testing.assert_allclose(mine.transform_square_integral(a), known.transform_square_integral(a), rtol=1e-14)
    y = np.array([0.0, 1e-9, 0.3, 1e4])
    np.testing.assert_allclose(mine.contact_radius(y), known.contact_radius(y), rtol=1e-14)


class TestProfile:
    radii = np.concatenate([np.linspace(0.0, 3.0, 25), np.linspace(3.3, 9.0, 20)])

    @pytest.mark.parametrize("relative", [False, True])
    @pytest.mark.parametrize("height", [lambda r: r**2 / 2, lambda r: np.sqrt(1 + r**2) - 1])
    def test_scatter_is_smoothed_away_and_told(self, height, relative):
        radii = np.linspace(0.0, 8.0, 41)
        off = 1e-3 * np.random.default_rng(3).normal(size=radii.size) * (height(radii) if relative else 1.0)
        tip = Profile(radii, np.append(0.0, (height(radii) + off)[1:]))
        assert "scatters by" in tip.limitation
        assert ("of themselves" in tip.limitation) is relative
        at = np.linspace(0.2, 8.0, 100)
        np.testing.assert_allclose(tip.height(at), height(at), rtol=2e-3, atol=2e-3)
        bends = 2 * np.gradient(np.gradient(height(at), at), at)[5:-5]
        np.testing.assert_allclose(np.gradient(2 * tip.height_derivative(at), at)[5:-5], bends, atol=0.1)
        assert Profile(radii, height(radii)).limitation == ""

    def test_heights_are_those_of_the_table(self):
        heights = np.sqrt(1.0 + self.radii**2) - 1.0
        tip = Profile(self.radii, heights)
        np.testing.assert_allclose(tip.height(self.radii), heights, rtol=1e-12, atol=1e-13)

    def test_parabola_and_cone_are_reproduced_and_continued(self):
        # their transforms, t²/R and (π/2) s t, are themselves splines
        t = np.linspace(0.0, 30.0, 40)
        tip = Profile(self.radii, self.radii**2 / 2.6)
        np.testing.assert_allclose(tip.transform(t), t**2 / 1.3, rtol=1e-10, atol=1e-12)
        assert tip.natural_length == pytest.approx(1.3, rel=1e-10)
        rho = np.linspace(0.0, 20.0, 21)
        for a in (0.0, 0.4, 12.0):
            for value, wanted in zip(tip.shape_gap(rho, a), Parabola(1.3).shape_gap(rho, a), strict=True):
                np.testing.assert_allclose(value, wanted, rtol=1e-9, atol=1e-10)
        tip = Profile(self.radii, 0.7 * self.radii, apex="sharp")
        np.testing.assert_allclose(tip.transform(t), Cone(0.7).transform(t), rtol=1e-8)
        assert tip.apex_exponent == 1.0

    def test_error_against_the_sphere_falls_with_the_fourth_power(self):
        def error(n):
            r = np.linspace(0.0, 3.0, n + 1)
            t = np.linspace(0.0, 2.9, 50)
            sphere = SphericalCap(5.0)
            return np.max(np.abs(Profile(r, sphere.height(r)).transform(t) - sphere.transform(t)))

        assert error(10) < 1e-3
        assert error(40) < error(10) / 4**3.5  # cubic spline: 4^4 asymptotically

    def test_height_and_transform_belong_together(self):
        # ζ(t) = t ∫ z'(t sin θ) dθ by adaptive quadrature with the knots as break points
        tip = Profile(self.radii, np.sqrt(1.0 + self.radii**2) - 1.0)
        for t in (0.9, 4.0, 14.0):
            knots = np.arcsin(self.radii[(self.radii > 0) & (self.radii < t)] / t)
            wanted = (
                t
                * quad(
                    lambda theta, t=t: float(tip.height_derivative(t * math.sin(theta))),
                    0.0,
                    math.pi / 2,
                    points=knots,
                    limit=400,
                    epsrel=1e-11,
                    epsabs=1e-13,
                )[0]
            )
            assert float(tip.transform(t)) == pytest.approx(wanted, rel=1e-10)
        assert float(tip.height_derivative(0.0)) == 0.0

    @pytest.mark.parametrize("a", [0.0, 0.4, 5.0, 11.0])
    def test_gap_by_its_definition(self, a):
        tip = Profile(self.radii, np.sqrt(1.0 + self.radii**2) - 1.0)
        rho = np.array([0.3, 2.0, 12.0, 40.0])  # the last far beyond the table
        gap, slope = tip.shape_gap(rho, a)
        assert np.transpose([tip.shape_gap(one, a) for one in rho]) == pytest.approx(np.array([gap, slope]), rel=1e-13)
        step = 1e-4
        above, below = tip.shape_gap(rho, a + step)[0], tip.shape_gap(rho, abs(a - step))[0]
        for k, place in enumerate(rho):

            def integrand(psi, place=place):
                tau = place * math.sin(psi)
                t = math.hypot(a, tau)
                return float(tip.transform(t) - tip.transform(a)) * tau / t if t > 0.0 else 0.0

            wanted = 2 / math.pi * quad(integrand, 0.0, math.pi / 2, limit=400, epsrel=1e-11, epsabs=1e-13)[0]
            assert gap[k] == pytest.approx(wanted, rel=1e-9)
            if a > 0.0:
                assert slope[k] == pytest.approx((above[k] - below[k]) / (2 * step), abs=1e-7)

    def test_integrals_of_the_transform(self):
        tip = Profile(self.radii, np.sqrt(1.0 + self.radii**2) - 1.0)
        for a in (0.7, 8.0, 13.0):
            inside = self.radii[(self.radii > 0) & (self.radii < a)]
            wanted = quad(lambda t: float(tip.transform(t)), 0.0, a, points=inside, limit=400)[0]
            square = quad(lambda t: float(tip.transform(t)) ** 2, 0.0, a, points=inside, limit=400)[0]
            assert float(tip.transform_integral(a)) == pytest.approx(wanted, rel=1e-12)
            assert float(tip.transform_square_integral(a)) == pytest.approx(square, rel=1e-12)
        np.testing.assert_allclose(tip.contact_radius(tip.transform([0.0, 0.7, 13.0])), [0.0, 0.7, 13.0], rtol=1e-13)

    def test_a_table_that_bends_down_ends_straight(self):
        # z = ln(1+r) is concave: continued with its curvature it would turn down
        tip = Profile(self.radii, np.log1p(self.radii), apex="sharp")
        slopes = tip.transform_derivative([9.5, 20.0, 90.0])
        assert np.all(slopes > 0.0)
        np.testing.assert_allclose(slopes, slopes[0], rtol=1e-12)
        r = np.geomspace(1e3, 1e15, 40)  # nothing cancels out there
        np.testing.assert_allclose(np.diff(tip.height(r)), np.diff(r) * slopes[0] * 2 / math.pi, rtol=1e-3)

    def test_scaled(self):
        tip = Profile(self.radii, np.sqrt(1.0 + self.radii**2) - 1.0)
        other = tip.scaled(2.0, 0.5)
        r = np.array([0.5, 4.0, 20.0])
        np.testing.assert_allclose(other.height(r / 2.0), tip.height(r) / 0.5, rtol=1e-12)

    @pytest.mark.parametrize(
        ("radii", "heights", "message"),
        [
            ([0, 1, 2], [0, 1, 2], "radii: shape"),
            ([0, 1, 2, 3], [0, 1, 2], "heights: shape"),
            ([0, 1, 2, 3], [0, 1, 2, 3, 4], "heights: 5 numbers for 4 radii"),
            ([1, 2, 3, 4], [0, 1, 2, 3], "radii: the first is 1; must start at 0"),
            ([0, 1, 2, 3], [1, 2, 3, 4], "heights: the first is 1; must start at 0"),
            ([0, 1, 1, 3], [0, 1, 2, 3], "radii: entry 3 is not above entry 2"),
            ([0, 1, 2, 3], [0, 1, 2, 1], "heights: entry 4 is not above entry 3"),
            ([0, 1, 2, math.nan], [0, 1, 2, 3], "radii: entry 4 is nan"),
            ([0, 1, 2, 3], [0, 1, "x", 3], "heights: not all are numbers"),
            ([[0, 1], [2, 3]], [0, 1, 2, 3], "radii: shape"),
            (np.arange(1001), np.arange(1001) ** 2, "radii: 1001 entries"),
        ],
    )
    def test_wrong_tables(self, radii, heights, message):
        with pytest.raises(InputError, match=message) as error:
            Profile(radii, heights)
        assert "\n" not in str(error.value)

    def test_wrong_apex(self):
        with pytest.raises(InputError, match="apex: 'round'; must be 'smooth' or 'sharp'"):
            Profile([0, 1, 2, 3], [0, 1, 4, 9], apex="round")


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "1 um", None, True, [1.0], 1j])
@pytest.mark.parametrize(
    ("kind", "name", "others"),
    [
        (Parabola, "radius", {}),
        (Cone, "slope", {}),
        (PowerLaw, "exponent", {"length": 1.0}),
        (PowerLaw, "length", {"exponent": 2.0}),
        (SphericalCap, "radius", {}),
        (SphericalCap, "steepness", {"radius": 1.0}),
    ],
)
def test_wrong_numbers_are_refused(kind, name, others, value):
    with pytest.raises(InputError, match=rf"^{name}: .*; must be") as error:
        kind(**{name: value}, **others)
    assert "\n" not in str(error.value)


def test_exponent_below_one_is_refused():
    with pytest.raises(InputError, match=r"^exponent: 0.5; must be at least 1"):
        PowerLaw(0.5, 1.0)


def test_tips_are_immutable_values():
    tips = [tip for tip, *_ in SHAPES.values()] + [Profile([0, 1, 2, 3], [0, 1, 4, 9])]
    assert len(set(tips)) == len(tips)
    for tip in tips:
        with pytest.raises(dataclasses.FrozenInstanceError):
            tip.name = "other"
        assert type(tip)(**tip.parameters()) == tip
        assert hash(type(tip)(**tip.parameters())) == hash(tip)
    assert Parabola(1) == Parabola(1.0) != Parabola(2.0)


def test_every_shape_is_found_by_its_name():
    axisymmetric = {"parabola", "cone", "power-law", "spherical-cap", "profile", "hyperboloid", "wavy-sphere"}
    assert set(TIPS) == {*axisymmetric, "elliptic-paraboloid", "height-map"}
    assert {name for name in TIPS if issubclass(TIPS[name], Tip)} == axisymmetric
    assert all(TIPS[name].name == name for name in TIPS)
