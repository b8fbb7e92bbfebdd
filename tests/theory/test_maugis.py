"""Maugis-Dugdale, (33)-(42) with the misprints of (35) and (37) mended, with and without contact."""

import csv
import pathlib

import numpy as np
import pytest
from scipy.integrate import quad

from contbranch.errors import InputError
from contbranch.theory import hertz, maugis

REFERENCE = pathlib.Path(__file__).parents[1] / "reference" / "maugis_dugdale.csv"
CONSTANTS = {"radius": 2.0, "modulus": 3.0, "work_of_adhesion": 0.5, "interaction_range": 0.3}


def reference():
    """Return the rows of the independently computed table as dictionaries of numbers."""
    with REFERENCE.open() as file:
        return [
            {key: value if key.startswith("branch") else float(value) for key, value in row.items()}
            for row in csv.DictReader(file)
        ]


def assert_matches(found, row, event):
    """Compare a curve's point with the columns of one event, relative to max(1, |value|)."""
    names = ("F", "load"), ("a", "contact_radius"), ("c", "interaction_radius"), ("d", "displacement")
    for letter, attribute in names:
        key = f"{letter}_{event}_mueser"
        if key in row:
            assert abs(float(getattr(found, attribute)) - row[key]) <= 1e-14 * max(1.0, abs(row[key])), (
                key,
                row["lambda"],
            )


@pytest.mark.parametrize("row", reference(), ids=lambda row: f"lambda={row['lambda']:g}")
def test_reference_table(row):
    # tests/reference/maugis_dugdale.csv: independent high-precision computation, 16 digits
    options = {"interaction_range": 1.0 / row["mu_T"]}
    assert_matches(maugis.load_fold(**options), row, "pulloff_load")
    fold = maugis.displacement_fold(**options)
    assert_matches(fold, row, "pulloff_disp")
    assert (float(fold.contact_radius) > 0.0) == (row["branch_pulloff_disp"] == "contact")
    assert_matches(maugis.first_touch(**options), row, "touch")
    free = maugis.zero_load(**options)
    for letter, value in zip("acd", (free.contact_radius, free.interaction_radius, free.displacement), strict=True):
        key = f"{letter}0_mueser"
        assert abs(float(value) - row[key]) <= 1e-14 * max(1.0, abs(row[key])), key


def test_functions_of_m_have_the_printed_limits():
    # (37), (39), (41); f for m -> infinity is (pi/2)(m^2 - 2), printed as (pi/2)(m^2 - 1)
    near, far = 1.0 + 1e-8, 1e6
    found = maugis.auxiliary_functions(near)
    assert float(found.f) == pytest.approx(4.0 / 3.0 * (2.0 * (near - 1.0)) ** 1.5, rel=1e-7)
    assert float(found.g) == pytest.approx(near - 1.0, rel=1e-3)
    assert float(found.h) == pytest.approx(np.sqrt(8.0 * (near - 1.0)), rel=1e-7)
    found = maugis.auxiliary_functions(far)
    assert abs(float(found.f) - np.pi / 2.0 * (far**2 - 2.0)) < 1e-3 * np.pi / 2.0
    assert float(found.g) == pytest.approx((np.pi / 2.0 - 1.0) * far, rel=1e-5)
    m = np.array([1.2, 2.0, 5.0])
    found, root, angle = maugis.auxiliary_functions(m), np.sqrt(m**2 - 1.0), np.arccos(1.0 / m)
    np.testing.assert_allclose(found.f, root + (m**2 - 2.0) * angle, rtol=1e-13)
    np.testing.assert_allclose(found.g, root * angle - m + 1.0, rtol=1e-13)
    np.testing.assert_allclose(found.h, root + m**2 * angle, rtol=1e-14)


@pytest.mark.parametrize("tabor", [0.02, 0.5, 2.0, 300.0])
def test_maugis_own_equations_hold_with_the_factor_four_thirds(tabor):
    # (33)-(35) in Maugis' units, with d = a^2 - (4/3) a lambda j(m)
    a = np.array([0.3, 1.2, 3.0])
    found = maugis.contact(a, interaction_range=1.0 / tabor)
    lam, length = tabor / np.cbrt(2.0 * np.pi / 9.0), np.cbrt(3.0 * np.pi / 4.0)
    a = a / length
    m = 1.0 / np.cos(found.rim_angle)
    f, g, h, j = maugis.auxiliary_functions(m)
    loss = 1e-15 / np.min(m - 1.0) + 1e-12  # of forming m, not of the solution
    np.testing.assert_allclose(lam * a**2 / 2.0 * f + 4.0 * lam**2 * a / 3.0 * g, 1.0, rtol=loss)
    np.testing.assert_allclose(a**3 - lam * a**2 * h, found.load / np.pi, rtol=10.0 * loss)
    np.testing.assert_allclose(a**2 - 4.0 / 3.0 * a * lam * j, found.displacement / length**2, rtol=10.0 * loss)


@pytest.mark.parametrize("tabor", [1e-3, 0.1, 1.0, 30.0, 1e3])
def test_contact_and_separation_meet_at_first_touch_with_one_slope(tabor):
    # theory: the curve is C1 in (d, F) across first touch
    options = {"interaction_range": 1.0 / tabor}
    touch, contact = maugis.first_touch(**options), maugis.contact(0.0, **options)
    for x, y in zip(touch, contact, strict=True):
        assert float(x) == pytest.approx(float(y), rel=1e-13, abs=1e-13)
    step = 1e-3 * min(float(touch.interaction_radius), float(maugis.load_fold(**options).contact_radius))
    before = maugis.separated(touch.interaction_radius - step, **options)
    after = maugis.contact(2.0 * step, **options)
    slopes = [(x.load - touch.load) / (x.displacement - touch.displacement) for x in (before, after)]
    # the next term of the contact branch is (d - d_touch)^(3/2), so the slopes differ by the share of a in c
    assert float(slopes[0]) == pytest.approx(float(slopes[1]), rel=2e-2)


@pytest.mark.parametrize("tabor", [0.01, 0.3, 1.0, 7.0, 500.0])
def test_energy_is_the_work_done(tabor):
    # dV/dd = F along every branch; five-point differences in the contact radius
    weights = np.array([1.0, -8.0, 0.0, 8.0, -1.0])
    for a in (0.05, 0.5, 2.0, 5.0):
        near = maugis.contact(a * (1.0 + 1e-3 * np.arange(-2.0, 3.0)), interaction_range=1.0 / tabor)
        work = near.load[2] * (weights @ near.displacement)
        scale = np.max(np.abs(near.energy)) * 1e-14 + 1e-9 * abs(work)
        assert abs(weights @ near.energy - work) < 40.0 * scale
    c = float(maugis.first_touch(interaction_range=1.0 / tabor).interaction_radius)
    near = maugis.separated(c * np.array([0.3, 0.4, 0.5, 0.6, 0.7]), interaction_range=1.0 / tabor)
    # energy and displacement are polynomials in c without contact; Simpson's rule in c is exact for F dd/dc
    f, d = near.load, np.gradient(near.displacement, 0.1 * c, edge_order=2)
    work = 0.1 * c / 3.0 * (f[0] * d[0] + 4.0 * f[1] * d[1] + 2.0 * f[2] * d[2] + 4.0 * f[3] * d[3] + f[4] * d[4])
    assert float(near.energy[4] - near.energy[0]) == pytest.approx(float(work), rel=1e-10)


def volume_of_gap(state, **constants):
    """Return the volume of the gap inside the interaction, by quadrature of the gap itself."""
    a, c = float(state.contact_radius), float(state.interaction_radius)
    # r = a + (c-a) x^2 softens the rim of the contact
    return quad(
        lambda x: (
            4.0
            * np.pi
            * (a + (c - a) * x * x)
            * (c - a)
            * x
            * float(maugis.gap(a + (c - a) * x * x, state, **constants))
        ),
        0.0,
        1.0,
        epsabs=0.0,
        epsrel=1e-10,
    )[0]


@pytest.mark.parametrize("tabor", [0.1, 1.0, 40.0])
def test_scaling_identity_of_the_energy(tabor):
    # theory: 5 V = 2 d F + 3 V_fr + 2 int g p_fr for the parabola at fixed R, V_fr including -pi a^2 of the contact
    options = {"interaction_range": 1.0 / tabor}
    touch = float(maugis.first_touch(**options).interaction_radius)
    for state in (maugis.contact(1.3, **options), maugis.separated(0.7 * touch, **options)):
        volume = volume_of_gap(state, **options)
        finite_range = -np.pi * float(state.interaction_radius) ** 2 + tabor * volume
        right = 2.0 * state.displacement * state.load + 3.0 * finite_range - 2.0 * tabor * volume
        assert 5.0 * float(state.energy) == pytest.approx(float(right), rel=1e-8)


@pytest.mark.parametrize("tabor", [0.1, 2.0, 50.0])
def test_gap_agrees_with_its_defining_integral(tabor):
    # g = (2/pi) int_a^r [t^2 - d - 2 sigma sqrt(c^2-t^2)] / sqrt(r^2-t^2) dt, by quadrature in the angle
    options = {"interaction_range": 1.0 / tabor}
    touch = float(maugis.first_touch(**options).interaction_radius)
    for state in (maugis.contact(1.3, **options), maugis.separated(0.6 * touch, **options)):
        a, c, d = (float(x) for x in (state.contact_radius, state.interaction_radius, state.displacement))
        for r in (a + 0.4 * (c - a), c, a + 1.4 * (c - a), c + 3.0):

            def density(angle, a=a, c=c, d=d, r=r):
                t = np.hypot(a, np.sqrt(r * r - a * a) * np.sin(angle))
                film = 2.0 * tabor * np.sqrt(max(c * c - t * t, 0.0))
                return (t * t - d - film) * np.sqrt(r * r - a * a) * np.sin(angle) / t

            kink = [np.arcsin(np.sqrt((c * c - a * a) / (r * r - a * a)))] if r > c else None
            expected = 2.0 / np.pi * quad(density, 0.0, np.pi / 2.0, points=kink, epsabs=1e-12, limit=200)[0]
            assert float(maugis.gap(r, state, **options)) == pytest.approx(expected, rel=1e-9, abs=1e-11)
        assert float(maugis.gap(c, state, **options)) == pytest.approx(1.0 / tabor, rel=1e-11)


@pytest.mark.parametrize("tabor", [0.1, 2.0, 50.0])
def test_pressure_carries_the_load_and_the_wall_only_pushes(tabor):
    options = {"interaction_range": 1.0 / tabor}
    state = maugis.contact(1.3, **options)
    c = float(state.interaction_radius)
    # r = a sin(x) removes the square root at the rim
    wall = quad(
        lambda x: (
            2.0 * np.pi * 1.69 * np.sin(x) * np.cos(x) * float(maugis.pressure(1.3 * np.sin(x), state, **options)[1])
        ),
        0.0,
        np.pi / 2.0,
        epsabs=1e-11,
        limit=200,
    )[0]
    assert wall - np.pi * tabor * c**2 == pytest.approx(float(state.load), rel=1e-9)
    r = np.linspace(0.0, 2.0 * c, 101)
    total, wall = maugis.pressure(r, state, **options)
    assert np.all(wall >= 0.0)
    assert np.all(wall[r >= 1.3] == 0.0)
    np.testing.assert_array_equal(total[r >= 1.3], np.where(r[r >= 1.3] < c, -tabor, 0.0))


def test_general_constants_scale_as_the_reduced_units():
    # (23)-(25): lengths in R^(2/3) (w/E)^(1/3) and R^(1/3) (w/E)^(2/3), loads in R w
    plane, height, force = np.cbrt(4.0 * 0.5 / 3.0), np.cbrt(2.0 * 0.25 / 9.0), 2.0 * 0.5
    reduced = {"interaction_range": 0.3 / height}
    for found, expected in (
        (maugis.contact([0.5, 2.0], **CONSTANTS), maugis.contact(np.array([0.5, 2.0]) / plane, **reduced)),
        (maugis.separated([0.1, 0.4], **CONSTANTS), maugis.separated(np.array([0.1, 0.4]) / plane, **reduced)),
        (maugis.load_fold(**CONSTANTS), maugis.load_fold(**reduced)),
        (maugis.displacement_fold(**CONSTANTS), maugis.displacement_fold(**reduced)),
    ):
        scales = force, height, plane, plane, 1.0, height, force * height
        for x, y, scale in zip(found, expected, scales, strict=True):
            np.testing.assert_allclose(x, y * scale, rtol=2e-13, atol=1e-13)


def test_short_and_long_range_and_little_attraction():
    # with hardly any attraction the contact is Hertz'
    found = maugis.contact([0.5, 2.0], work_of_adhesion=1e-14)
    np.testing.assert_allclose(found.load, hertz.load([0.5, 2.0]), rtol=1e-6)
    # from 1/1000 to 1000, pull-off goes monotonically from DMT's -2 pi to JKR's -1.5 pi
    pull_off = maugis.load_fold(interaction_range=np.geomspace(1e3, 1e-3, 61)).load
    assert np.all(np.diff(pull_off) > 0.0)
    assert -2.0 * np.pi < pull_off[0] < -2.0 * np.pi + 1e-3
    assert -1.5 * np.pi - 1e-5 < pull_off[-1] < -1.5 * np.pi


def test_displacement_fold_changes_branch_at_the_critical_tabor_coefficient():
    # theory: [pi/(8(1-1/pi))]^(1/3) = 0.832065719951667, and c = 4 mu_T/pi below it
    assert pytest.approx(0.832065719951667, rel=1e-15) == maugis.CRITICAL_TABOR
    tabor = maugis.CRITICAL_TABOR * np.array([0.5, 1.0 - 1e-9, 1.0 + 1e-6])
    fold = maugis.displacement_fold(interaction_range=1.0 / tabor)
    assert (fold.contact_radius > 0.0).tolist() == [False, False, True]
    np.testing.assert_allclose(fold.interaction_radius[:2], 4.0 * tabor[:2] / np.pi, rtol=1e-14)


def test_wrong_input_is_refused_with_a_reason():
    with pytest.raises(InputError, match=r"work_of_adhesion must be greater than 0 .* ring of constant gap"):
        maugis.contact(1.0, work_of_adhesion=-1.0)
    with pytest.raises(InputError, match=r"^contact_radius must be at least 0"):
        maugis.contact(-1.0)
    with pytest.raises(InputError, match=r"^interaction_radius must be at most"):
        maugis.separated(10.0)
    with pytest.raises(InputError, match=r"^interaction_range must"):
        maugis.load_fold(interaction_range=float("inf"))
    with pytest.raises(InputError, match=r"^m = c/a must"):
        maugis.auxiliary_functions(1.0)
