"""The exact model: whole curve, events and their error bounds, stability, single equilibria, profiles and
derivatives.
"""

import csv
import pathlib

import mpmath
import numpy as np
import pytest

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import Gauss, MaugisDugdale
from contbranch.contact.tips import Cone, Parabola
from contbranch.errors import InputError
from contbranch.models.exact.model import Exact, ExactCurve
from contbranch.theory import maugis

REFERENCE = pathlib.Path(__file__).parents[1] / "reference" / "maugis_dugdale.csv"
TABORS = [1e-3, 0.03, 0.5, 0.8321, 1.0, 4.0, 64.0, 1e3]


def named(curve, control):
    return next(event for event in curve.events if event.control == control and event.name == "pull-off")


def reference():
    with REFERENCE.open() as file:
        return [{k: v if k.startswith("branch") else float(v) for k, v in row.items()} for row in csv.DictReader(file)]


@pytest.mark.parametrize("row", reference(), ids=lambda row: f"lambda={row['lambda']:g}")
def test_reference_table(row):
    # tests/reference/maugis_dugdale.csv: independent high-precision computation, 16 digits; 1e-12 is asked for
    curve = ExactCurve(row["mu_T"])
    touch = next(event for event in curve.events if event.kind == "touch")
    found = {
        "pulloff_load": named(curve, "load").state,
        "pulloff_disp": named(curve, "displacement").state,
        "touch": touch.state,
        "0": curve.zero_load_contact(),
    }
    names = {"F": "load", "a": "contact_radius", "c": "interaction_radius", "d": "displacement"}
    compared = 0
    for event, state in found.items():
        for letter, attribute in names.items():
            key = f"{letter}0_mueser" if event == "0" else f"{letter}_{event}_mueser"
            if key in row:
                assert abs(getattr(state, attribute) - row[key]) <= 2e-14 * max(1.0, abs(row[key])), key
                compared += 1
    assert compared == 14


def precise_fold(tabor, start, control):
    """Return load, displacement and contact radius of a fold in contact from theory.md's formulas in (a, c), to 40
    digits.
    """
    with mpmath.workdps(40):
        sigma = mpmath.mpf(tabor)
        z0 = 1 / mpmath.mpf(tabor)

        def values(a, c):
            s, angle = mpmath.sqrt(c * c - a * a), mpmath.acos(a / c)
            d = a * a - 2 * sigma * s
            load = 2 * d * a - 2 * a**3 / 3 - 2 * sigma * (c * c * angle - a * s)
            rim = 2 / mpmath.pi * ((c * c * angle + a * s) / 2 - d * angle - 2 * sigma * (c - a))
            return load, d, rim

        def conditions(a, c):
            def slopes(k):
                step = mpmath.mpf(10) ** -13
                da, dc = step * a, step * (c - a)
                return (
                    (values(a + da, c + da)[k] - values(a - da, c - da)[k]) / (2 * da),
                    (values(a, c + dc)[k] - values(a, c - dc)[k]) / (2 * dc),
                )

            # in (a, c - a) no direction is nearly parallel to another for c close to a
            (fx, fy), (rx, ry) = slopes(0 if control == "load" else 1), slopes(2)
            return values(a, c)[2] - z0, (fx * ry - fy * rx) / ry

        guess = mpmath.mpf(start.contact_radius), mpmath.mpf(start.interaction_radius)
        if start.interaction_radius - start.contact_radius < 1e-3:
            guess = guess[0], guess[0] + 2 * guess[1] * mpmath.sin(mpmath.mpf(start.rim_angle) / 2) ** 2
        a, c = mpmath.findroot(lambda a, c: conditions(a, c), guess, tol=1e-40)
        load, d, _ = values(a, c)
        return {"load": load, "displacement": d, "contact_radius": a}


@pytest.mark.parametrize("tabor", [1e-3, 0.05, 1.0, 20.0, 1e3])
@pytest.mark.parametrize("control", ["load", "displacement"])
def test_true_errors_of_folds_are_within_the_stated_bounds(tabor, control):
    curve = ExactCurve(tabor)
    event = named(curve, control)
    if event.state.contact_radius == 0.0:
        # without contact the fold is closed: c = 4 mu_T/pi
        with mpmath.workdps(40):
            c = 4 * mpmath.mpf(tabor) / mpmath.pi
            d = c * c / 2 - 1 / mpmath.mpf(tabor) - 4 * mpmath.mpf(tabor) * c / mpmath.pi
            truth = {"load": -mpmath.pi * tabor * c * c, "displacement": d, "central_gap": -d - 2 * tabor * c}
    else:
        truth = precise_fold(tabor, event.state, control)
    for name, value in truth.items():
        found = getattr(event.state, name)
        assert abs(found - value) <= event.error[name], name
        assert event.error[name] < 3e-13 * max(1.0, abs(found)), name


@pytest.mark.parametrize("tabor", TABORS)
def test_curve_runs_from_no_interaction_into_contact_and_meets_its_events(tabor):
    curve = ExactCurve(tabor)
    states = curve.sample()
    assert states.load[0] == 0.0
    assert states.displacement[0] == pytest.approx(-1.5 / tabor)
    assert states.load[-1] == pytest.approx(10.0, rel=1e-12)
    assert np.all(np.diff(states.parameter) > 0.0)
    for event in curve.events:
        assert event.state.parameter in states.parameter
    assert states.load.min() == named(curve, "load").state.load
    # gap closes exactly at touch and never opens again
    assert np.all((states.central_gap > 0.0) == (states.parameter < 0.0))
    # no visible steps: neighbours differ by little of the whole
    for column in (states.load, states.displacement):
        assert np.max(np.abs(np.diff(column))) < 0.13 * np.ptp(column)


@pytest.mark.parametrize("tabor", TABORS)
def test_work_along_the_curve_is_the_energy(tabor):
    # dV/dd = F: Gauss-Legendre quadrature of F dd over each interval of the parameter, through touch and both folds
    curve = ExactCurve(tabor)
    ends = curve.sample(100)
    start, stop = ends.parameter[:-1], ends.parameter[1:]
    x, weight = np.polynomial.legendre.leggauss(10)
    nodes = 0.5 * (start + stop)[:, None] + 0.5 * (stop - start)[:, None] * x
    inner = curve.states(nodes.ravel())
    # dd/ds from the polynomial through the nodes of each interval
    load, displacement = (v.reshape(nodes.shape) for v in (inner.load, inner.displacement))
    derivative = np.polynomial.legendre.legder(np.polynomial.legendre.legfit(x, displacement.T, 9))
    slope = np.polynomial.legendre.legval(x, derivative)
    work = np.sum(weight * load * slope, axis=1)
    scale = np.max(np.abs(ends.energy))
    np.testing.assert_allclose(np.diff(ends.energy), work, atol=1e-10 * scale)


@pytest.mark.parametrize("tabor", TABORS)
def test_morse_indices_are_those_of_the_slopes(tabor):
    # theory: n_displacement = [dd/dc < 0] (c the rim of the interaction), n_load = n_displacement + [dF/dd < 0]
    curve = ExactCurve(tabor)
    states = curve.sample(800)
    middle = curve.states(0.5 * (states.parameter[1:] + states.parameter[:-1]))
    steps = [np.diff(x) for x in (states.interaction_radius, states.displacement, states.load)]
    floors = 1e-9 * curve.touch_radius, 1e-12 * (1.0 + 1.0 / tabor), 1e-13
    clear = np.all([np.abs(step) > floor for step, floor in zip(steps, floors, strict=True)], axis=0)
    clear &= middle.parameter > -1.0
    assert np.count_nonzero(clear) > 400
    dc, dd, df = (step[clear] for step in steps)
    index = (dd * dc < 0.0).astype(int)
    np.testing.assert_array_equal(middle.unstable_displacement[clear], index)
    np.testing.assert_array_equal(middle.unstable_load[clear], index + (df * dd < 0.0))
    spring = curve.unstable_spring(middle, 2.0)
    np.testing.assert_array_equal(spring[clear], index + (df * dd + 2.0 * dd * dd < 0.0))
    far = curve.states([-2.0, -1.0])
    assert far.unstable_load.tolist() == far.unstable_displacement.tolist() == [0, 0]


@pytest.mark.parametrize("tabor", [0.5, 1.0, 5.0])
def test_energy_of_a_free_interaction_radius_has_the_curvature_of_the_index(tabor):
    # At fixed d, dV/dc = 2 pi c sigma [g(c) - z0] for a film of radius c, the rest relaxed: g(c) must fall where the
    # index is 1. g(c) from theory.md's contact formula, at the c of a state and slightly more.
    curve = ExactCurve(tabor)
    fold = named(curve, "displacement").state
    for parameter, expected in ((0.5 * (fold.parameter - 1.0), 1), (fold.parameter + 0.3, 0)):
        state = curve.states(parameter).state(0)
        assert state.unstable_displacement == expected
        c = state.interaction_radius * np.array([1.0 - 1e-5, 1.0 + 1e-5])
        rim = [film_gap(tabor, x, state.displacement) for x in c]
        assert (rim[1] < rim[0]) == bool(expected)


def film_gap(tabor, c, d):
    """Return the gap at the rim c of a film with the stress sigma = tabor, at the displacement d."""
    # the contact radius solves d = a^2 - 2 sigma sqrt(c^2-a^2); without a solution there is no contact
    low, high = 0.0, c
    if d <= -2.0 * tabor * c:
        return 0.5 * c * c - d - 4.0 / np.pi * tabor * c
    for _ in range(100):
        a = 0.5 * (low + high)
        low, high = (a, high) if a * a - 2.0 * tabor * np.sqrt(c * c - a * a) < d else (low, a)
    angle, s = np.arccos(a / c), np.sqrt(c * c - a * a)
    return 2.0 / np.pi * (0.5 * (c * c * angle + a * s) - d * angle - 2.0 * tabor * (c - a))


@pytest.mark.parametrize("tabor", TABORS)
def test_solve_returns_every_state_at_a_load_or_displacement(tabor):
    curve = ExactCurve(tabor)
    states = curve.sample(200)
    steps = np.arange(7, len(states.load) - 1, 9)
    special = [event.state for event in curve.events]
    for i in steps:
        state = states.state(int(i))
        if state.parameter in [event.parameter for event in special]:
            continue
        for field in ("load", "displacement"):
            value = getattr(state, field)
            if value == 0.0 and field == "load":
                continue
            found = curve.solve(**{field: value})
            column = getattr(states, field) - value
            crossings = np.count_nonzero(np.diff(np.sign(column[np.abs(column) > 0.0])))
            beyond = field == "displacement" and value < -1.5 / tabor
            assert len(found) == crossings + beyond, (field, value)
            assert min(abs(x.parameter - state.parameter) for x in found) < 1e-6 * max(1.0, abs(state.parameter))
            for x in found:
                assert getattr(x, field) == pytest.approx(value, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("tabor", TABORS)
def test_solve_takes_back_the_values_of_events(tabor):
    curve = ExactCurve(tabor)
    for event in curve.events:
        if event.state.load != 0.0:
            found = curve.solve(load=event.state.load)
            assert min(abs(x.parameter - event.state.parameter) for x in found) < 1e-9
        nearest = min(curve.solve(displacement=event.state.displacement), key=lambda x: abs(x.load - event.state.load))
        # a fold's own value gives the fold itself, not the square root of the round-off beside it
        assert nearest.load == pytest.approx(event.state.load, rel=1e-9, abs=1e-11)
        assert nearest.contact_radius == pytest.approx(event.state.contact_radius, abs=1e-9)
    state = curve.solve(contact_radius=1.7)[0]
    assert state.contact_radius == 1.7
    assert state.load == pytest.approx(float(maugis.contact(1.7, interaction_range=1.0 / tabor).load), rel=1e-14)


def test_unreachable_and_ambiguous_requests_are_refused():
    curve = ExactCurve(1.0)
    with pytest.raises(InputError, match=r"^load must be at least -4\.98\d+ \(pull-off\), not -50"):
        curve.solve(load=-50.0)
    with pytest.raises(InputError, match=r"exactly one"):
        curve.solve()
    with pytest.raises(InputError, match=r"exactly one"):
        curve.solve(load=1.0, displacement=1.0)
    with pytest.raises(InputError, match=r"^contact_radius must be greater than 0"):
        curve.solve(contact_radius=0.0)
    with pytest.raises(InputError, match=r"^tabor must"):
        ExactCurve(-1.0)
    with pytest.raises(InputError, match=r"^load must be finite"):
        curve.solve(load=float("nan"))
    with pytest.raises(InputError, match=r"^state must lie within"):
        curve.expansion(curve.states(-2.0).state(0))


@pytest.mark.parametrize("stiffness", [0.05, 2.0, 30.0, 1e6])
@pytest.mark.parametrize("tabor", [0.1, 1.0, 30.0])
def test_spring_folds_are_the_extremes_of_the_spring_displacement(tabor, stiffness):
    curve = ExactCurve(tabor)
    jump_in, pull_off = curve.spring_events(stiffness)
    assert jump_in.state.displacement == pytest.approx(-1.0 / tabor)
    s = pull_off.state.parameter
    near = curve.states(s + 1e-3 * np.array([-1.0, 0.0, 1.0]) * max(abs(s), 0.01))
    left, middle, right = near.displacement + near.load / stiffness
    assert left > middle < right
    states = curve.sample(400)
    assert middle <= np.min((states.displacement + states.load / stiffness)[states.parameter > -1.0]) + 1e-9


@pytest.mark.parametrize("tabor", [0.01, 0.5, 1.0, 100.0])
@pytest.mark.parametrize("load", [-4.0, 3.0])
def test_profiles_are_admissible_and_carry_the_load(tabor, load):
    curve = ExactCurve(tabor)
    for state in curve.solve(load=load):
        profile = curve.profile(state)
        a, c = state.contact_radius, state.interaction_radius
        assert np.all(profile.gap >= 0.0)
        assert np.all(np.diff(profile.gap) >= -1e-12)
        assert profile.gap[0] == pytest.approx(state.central_gap, abs=1e-13)
        assert np.all(profile.wall_pressure >= 0.0)
        assert np.all((profile.wall_pressure > 0.0) == (profile.r < a))
        at_rim = curve.profile(state, r=[c])
        assert float(at_rim.gap[0]) == pytest.approx(1.0 / tabor, rel=1e-10)
        carried = np.trapezoid(2.0 * np.pi * profile.r * profile.wall_pressure, profile.r) - np.pi * tabor * c**2
        assert carried == pytest.approx(load, abs=3e-3 * (1.0 + np.pi * tabor * c**2))


def test_profile_beyond_the_range_is_that_of_the_undeformed_tip():
    curve = ExactCurve(2.0)
    state = curve.states(-1.5).state(0)
    profile = curve.profile(state)
    np.testing.assert_allclose(profile.gap, profile.r**2 / 2.0 + 0.75, rtol=1e-14)
    assert not np.any(profile.pressure)


@pytest.mark.parametrize("tabor", [0.05, 1.0, 50.0])
def test_derivatives_at_folds_agree_with_differences(tabor):
    # seven-point differences of the closed form in the contact radius, independent of the series arithmetic
    curve = ExactCurve(tabor)
    for control in ("load", "displacement"):
        state = named(curve, control).state
        expansion = curve.expansion(state)
        index = 0 if control == "load" else 1
        assert abs((expansion.load, expansion.displacement)[index][1]) < 1e-11 * max(1.0, abs(expansion.load[2]))
        if expansion.coordinate == "contact_radius":
            h = 0.004 * state.contact_radius
            near = curve.states(state.contact_radius + h * np.arange(-3.0, 4.0))
            for values, found in ((near.load, expansion.load), (near.displacement, expansion.displacement)):
                second = values @ np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180.0 * h * h)
                third = values @ np.array([1.0, -8.0, 13.0, 0.0, -13.0, 8.0, -1.0]) / (8.0 * h**3)
                assert found[2] == pytest.approx(second, rel=1e-6)
                assert found[3] == pytest.approx(third, rel=1e-4, abs=1e-4 * abs(found[2]) / state.contact_radius)
        else:
            assert expansion.value == pytest.approx(state.central_gap, rel=1e-13)
            # d = -g - 2 sigma c with g = z0 - (2-4/pi) sigma c - c^2/2: second derivative 1/dg^3 of the sum
            c, slope = state.interaction_radius, (2.0 - 4.0 / np.pi) * tabor + state.interaction_radius
            assert expansion.displacement[1] == pytest.approx(-1.0 + 2.0 * tabor / slope, abs=1e-12)
            assert expansion.displacement[2] == pytest.approx(2.0 * tabor / slope**3, rel=1e-12)
            assert expansion.load[1] == pytest.approx(2.0 * np.pi * tabor * c / slope, rel=1e-12)


def test_normal_form_at_pull_off_approaches_that_of_jkr():
    # JKR at a^3 = 9 pi/8: second and third derivatives of F = (4/3) a^3 - sqrt(8 pi a^3)
    curve = ExactCurve(1e3)
    expansion = curve.expansion(named(curve, "load").state)
    a = np.cbrt(9.0 * np.pi / 8.0)
    assert expansion.load[2] == pytest.approx(8.0 * a - 0.75 * np.sqrt(8.0 * np.pi / a), rel=1e-5)
    assert expansion.load[3] == pytest.approx(8.0 + 0.375 * np.sqrt(8.0 * np.pi / a**3), rel=1e-5)


def test_first_touch_is_no_fold_though_the_slopes_in_the_radius_vanish():
    curve = ExactCurve(1.0)
    touch = next(event for event in curve.events if event.kind == "touch")
    inside = curve.expansion(touch.state)
    assert inside.coordinate == "contact_radius"
    assert abs(inside.load[1]) < 1e-14
    assert abs(inside.displacement[1]) < 1e-14
    before = curve.expansion(curve.states(-1e-12).state(0))
    # the slope dF/dd is the same on both sides: a^2 and the gap are both regular coordinates
    assert inside.load[2] / inside.displacement[2] == pytest.approx(before.load[1] / before.displacement[1], rel=1e-10)


def test_exact_names_why_it_does_not_represent_a_contact():
    exact = Exact()
    assert exact.curve(Contact.reduced(MaugisDugdale, tabor=2.0)).tabor == pytest.approx(2.0, rel=1e-15)
    law = MaugisDugdale(work_of_adhesion=0.04, range=1.0)
    # mu_T = [R (w/E)^2]^(1/3) / z0
    physical = exact.curve(Contact(Parabola(1000.0), law, 5.0))
    assert physical.tabor == pytest.approx(np.cbrt(1000.0 * 0.008**2), rel=1e-14)
    for contact, reason in (
        (Contact(Cone(1.0), law, 1.0), "not for a tip of the shape cone"),
        (Contact.reduced(Gauss, tabor=1.0), "not for gauss"),
        (Contact(Parabola(1.0)), "not for no interaction"),
        (Contact.reduced(MaugisDugdale, tabor=1.0, sign=-1), "ring of constant gap"),
    ):
        assert reason in str(exact.obstacle(contact))
        with pytest.raises(InputError, match=reason):
            exact.curve(contact)
