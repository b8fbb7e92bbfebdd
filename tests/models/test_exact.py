"""The exact model: whole curve, events and their errors, stability, single equilibria, profiles and exponents."""

import csv
import functools
import pathlib
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

import contbranch as cb
from contbranch.theory import maugis

REFERENCE = pathlib.Path(__file__).parents[1] / "reference" / "maugis_dugdale.csv"
TABORS = [1e-3, 0.03, 0.8321, 4.0, 1e3]


def contact(tabor):
    return cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor)


@functools.cache
def traced(tabor):
    return cb.trace(contact(tabor))


def named(diagram, control, name="pull-off"):
    return next(event for event in diagram.events if event.control == control and event.name == name)


def touch(diagram):
    return next(event for event in diagram.events if event.kind == "touch")


def reference():
    with REFERENCE.open() as file:
        return [{k: v if k.startswith("branch") else float(v) for k, v in row.items()} for row in csv.DictReader(file)]


@pytest.mark.parametrize("row", reference(), ids=lambda row: f"lambda={row['lambda']:g}")
def test_reference_table(row):
    # tests/reference/maugis_dugdale.csv: independent high-precision computation, 16 digits; 1e-12 is asked for
    diagram = traced(row["mu_T"])
    assert diagram.status == "complete"
    found = {
        "pulloff_load": named(diagram, "load"),
        "pulloff_disp": named(diagram, "displacement"),
        "touch": touch(diagram),
        "0": cb.solve(contact(row["mu_T"]), load=0.0),
    }
    names = {"F": "load", "a": "contact_radius", "d": "displacement"}
    compared = 0
    for event, state in found.items():
        for letter, attribute in names.items():
            key = f"{letter}0_mueser" if event == "0" else f"{letter}_{event}_mueser"
            if key in row:
                assert abs(getattr(state, attribute) - row[key]) <= 2e-14 * max(1.0, abs(row[key])), key
                compared += 1
    assert compared == 10


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

        state = maugis.contact(start.contact_radius, interaction_range=1 / tabor)
        a, half = mpmath.mpf(start.contact_radius), mpmath.mpf(float(state.rim_angle)) / 2
        guess = a, a + 2 * mpmath.mpf(float(state.interaction_radius)) * mpmath.sin(half) ** 2
        a, c = mpmath.findroot(lambda a, c: conditions(a, c), guess, tol=1e-40)
        load, d, _ = values(a, c)
        return {"load": load, "displacement": d, "contact_radius": a}


@pytest.mark.parametrize("tabor", [1e-3, 0.05, 1.0, 20.0, 1e3])
@pytest.mark.parametrize("control", ["load", "displacement"])
def test_true_errors_of_folds_are_within_the_stated_bounds(tabor, control):
    event = named(traced(tabor), control)
    if event.contact_radius == 0.0:
        # without contact the fold is closed: c = 4 mu_T/pi
        with mpmath.workdps(40):
            c = 4 * mpmath.mpf(tabor) / mpmath.pi
            d = c * c / 2 - 1 / mpmath.mpf(tabor) - 4 * mpmath.mpf(tabor) * c / mpmath.pi
            truth = {"load": -mpmath.pi * tabor * c * c, "displacement": d, "central_gap": -d - 2 * tabor * c}
    else:
        truth = precise_fold(tabor, event, control)
    for name, value in truth.items():
        found = getattr(event, name)
        assert abs(found - value) <= event.error[name], name
        assert event.error[name] < 3e-13 * max(1.0, abs(found)), name


@pytest.mark.parametrize("tabor", TABORS)
def test_curve_runs_from_no_interaction_into_contact_and_meets_its_events(tabor):
    diagram = traced(tabor)
    branch = diagram.branches[0]
    assert diagram.model.unknowns == 1
    assert branch.load[0] == 0.0
    assert branch.displacement[0] == pytest.approx(-1.5 / tabor)
    assert branch.load[-1] == pytest.approx(10.0, rel=1e-8)
    kinds = [(event.kind, event.control, event.name) for event in diagram.events]
    assert kinds[0] == ("fold", "displacement", "jump-in")
    assert sorted(map(str, kinds)) == sorted(
        map(
            str,
            [kinds[0], ("touch", None, None), ("end", None, None)]
            + [("fold", control, "pull-off") for control in ("load", "displacement")],
        )
    )
    for event in diagram.events:
        assert branch.load[int(event.position)] == pytest.approx(event.load, rel=1e-2, abs=1e-2 / tabor)
    assert np.all(branch.load >= named(diagram, "load").load - 1e-13)
    # gap closes exactly at touch and never opens again
    first = int(touch(diagram).position)
    assert np.all((branch.central_gap > 0.0) == (np.arange(len(branch.load)) < first))
    assert not np.any(branch.unstable_azimuthal)


@pytest.mark.parametrize("tabor", TABORS[::2])
def test_work_along_the_curve_is_the_energy(tabor):
    # dV/dd = F: by quadrature of the closed forms, over the radius of the interaction and then over that of the contact
    branch = traced(tabor).branches[0]
    scale = np.max(np.abs(branch.energy))
    c = float(maugis.first_touch(interaction_range=1 / tabor).interaction_radius)
    apart = quad(lambda c: -np.pi * tabor * c**2 * (c - 4 / np.pi * tabor), 0.0, c, epsabs=0, epsrel=1e-12)[0]
    assert float(maugis.first_touch(interaction_range=1 / tabor).energy) == pytest.approx(apart, abs=1e-10 * scale)
    rows = np.flatnonzero(branch.contact_radius > 0)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    work, start = apart, 0.0
    for row in rows[:: max(1, len(rows) // 4)]:
        end = branch.contact_radius[row]
        if start == 0.0:
            edges = np.append(0.0, end * np.geomspace(1e-9, 1.0, 60))
        else:
            edges = np.geomspace(start, end, 2 + int(7 * np.log10(end / start)))
        start = end
        for low, high in pairwise(edges):
            own = maugis.contact((low + high) / 2 + (high - low) / 2 * nodes, interaction_range=1 / tabor)
            path = np.polynomial.Legendre.fit(nodes, own.displacement, 20, domain=[-1, 1])
            work += float(weights @ (own.load * path.deriv()(nodes)))
        assert branch.energy[row] == pytest.approx(work, abs=1e-9 * scale)


@pytest.mark.parametrize("tabor", TABORS)
def test_morse_indices_are_those_of_the_slopes(tabor):
    # theory: n_displacement = [dd/dc < 0] (c the rim of the interaction), n_load = n_displacement + [dF/dd < 0]
    diagram = cb.trace(contact(tabor), control=cb.Spring(2.0))
    branch = diagram.branches[0]
    special = {int(event.position) for event in diagram.events}
    jump_in = named(diagram, "displacement", "jump-in")
    checked = 0
    for row in range(len(branch.load)):
        if row in special or row < jump_in.position:
            continue
        radius, rest = branch.contact_radius[row], {"interaction_range": 1 / tabor}
        step = 1e-6
        if radius > 0:
            low, high = (maugis.contact(radius * f, **rest) for f in (1 - step, 1 + step))
        else:
            c = np.sqrt(-branch.load[row] / (np.pi * tabor))
            low, high = (maugis.separated(c * f, **rest) for f in (1 - step, 1 - step / 2))
        load, displacement = float(high.load - low.load), float(high.displacement - low.displacement)
        if min(abs(load), abs(displacement), abs(load + 2 * displacement)) < 1e-13 * (1 + 1 / tabor):
            continue
        held = int(displacement < 0)
        assert branch.unstable_displacement[row] == held
        assert branch.unstable_load[row] == held + (load * displacement < 0)
        assert branch.unstable_spring[row] == held + ((load + 2 * displacement) * displacement < 0)
        checked += 1
    assert checked > 15
    far = slice(0, int(jump_in.position) + 1)
    assert not np.any(branch.unstable_load[far])
    assert not np.any(branch.unstable_displacement[far])


@pytest.mark.parametrize("tabor", [0.5, 1.0, 5.0])
def test_energy_of_a_free_interaction_radius_has_the_curvature_of_the_index(tabor):
    # At fixed d, dV/dc = 2 pi c sigma [g(c) - z0] for a film of radius c, the rest relaxed: g(c) must fall where the
    # index is 1. g(c) from theory.md's contact formula, at the c of a state and slightly more.
    branch = traced(tabor).branches[0]
    for index in (0, 1):
        row = np.flatnonzero((branch.unstable_displacement == index) & (branch.load < 0))[3]
        radius = branch.contact_radius[row]
        if radius > 0:
            c = float(maugis.contact(radius, interaction_range=1 / tabor).interaction_radius)
        else:
            c = np.sqrt(-branch.load[row] / (np.pi * tabor))
        rim = [film_gap(tabor, x, branch.displacement[row]) for x in c * np.array([1.0 - 1e-5, 1.0 + 1e-5])]
        assert (rim[1] < rim[0]) == bool(index)


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
def test_every_state_at_a_load_or_displacement_is_found(tabor):
    law, branch = contact(tabor), traced(tabor).branches[0]
    for row in range(4, len(branch.load) - 1, max(9, len(branch.load) // 6)):
        for field in ("load", "displacement"):
            values = getattr(branch, field)
            value = (values[row] + values[row + 1]) / 2
            if value == 0.0:
                continue
            found = cb.find_all(law, **{field: value})
            passes = np.count_nonzero((values[1:] - value) * (values[:-1] - value) < 0)
            beyond = field == "displacement" and value < values[0]
            assert len(found.states) == passes + beyond, (field, value)
            for state in found.states:
                assert getattr(state, field) == pytest.approx(value, rel=1e-12, abs=1e-13)
                if state.contact_radius > 0:
                    closed = maugis.contact(state.contact_radius, interaction_range=1 / tabor)
                    assert state.load == pytest.approx(float(closed.load), rel=1e-9, abs=1e-9)
                    assert state.displacement == pytest.approx(float(closed.displacement), rel=1e-9, abs=1e-9)


def test_a_contact_radius_selects_a_state():
    for tabor in (1e-3, 0.8321, 1e3):
        state = cb.solve(contact(tabor), contact_radius=1.7)
        closed = maugis.contact(1.7, interaction_range=1.0 / tabor)
        assert state.contact_radius == 1.7
        assert state.load == pytest.approx(float(closed.load), rel=1e-12)
        assert state.displacement == pytest.approx(float(closed.displacement), rel=1e-12)


def test_without_load_only_the_contact_is_found():
    # not the continuum of separations beyond the range
    found = cb.find_all(contact(1.0), load=0.0)
    assert [state.contact_radius for state in found.states] == pytest.approx([float(maugis.zero_load().contact_radius)])


def test_unreachable_loads_are_refused():
    with pytest.raises(
        cb.InputError, match=r"^load: -50 cannot be reached; loads from -4\.98\d+ upwards are reachable"
    ):
        cb.solve(contact(1.0), load=-50.0)


def test_beyond_the_range_a_displacement_is_that_of_the_undeformed_tip():
    state = cb.solve(contact(2.0), displacement=-7.0)
    assert (state.load, state.central_gap, state.unstable_displacement) == (0.0, 7.0, 0)
    profile = state.profile
    np.testing.assert_allclose(profile.gap, profile.r**2 / 2.0 + 7.0, rtol=1e-14)
    assert not np.any(profile.pressure)


@pytest.mark.parametrize("stiffness", [0.05, 2.0, 1e6])
@pytest.mark.parametrize("tabor", [0.1, 30.0])
def test_spring_folds_are_the_extremes_of_the_spring_displacement(tabor, stiffness):
    diagram = cb.trace(contact(tabor), control=cb.Spring(stiffness))
    jump_in, pull_off = (named(diagram, "spring", name) for name in ("jump-in", "pull-off"))
    assert jump_in.displacement == -1.0 / tabor
    least = pull_off.displacement + pull_off.load / stiffness
    grid = np.linspace(0.5, 1.5, 2001)
    if pull_off.contact_radius > 0:
        near = maugis.contact(pull_off.contact_radius * grid, interaction_range=1 / tabor)
    else:
        c = np.sqrt(-pull_off.load / (np.pi * tabor)) * grid
        end = float(maugis.first_touch(interaction_range=1 / tabor).interaction_radius)
        near = maugis.separated(c[c < end], interaction_range=1 / tabor)
    ends = near.displacement + near.load / stiffness
    assert np.min(ends) == pytest.approx(least, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("tabor", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("load", [-4.0, 3.0])
def test_profiles_are_admissible_and_carry_the_load(tabor, load):
    for state in cb.find_all(contact(tabor), load=load).states:
        profile, a = state.profile, state.contact_radius
        closed = maugis.contact(a, interaction_range=1 / tabor)
        c = float(closed.interaction_radius) if a > 0 else np.sqrt(-load / (np.pi * tabor))
        assert np.all(profile.gap >= 0.0)
        assert np.all(np.diff(profile.gap) >= -1e-12)
        assert profile.gap[0] == pytest.approx(state.central_gap, abs=1e-13)
        assert np.all(profile.wall_pressure >= 0.0)
        assert np.all((profile.wall_pressure > 0.0) == (profile.r < a))
        assert np.interp(c, profile.r, profile.gap) == pytest.approx(1.0 / tabor, rel=1e-6)
        carried = np.trapezoid(2.0 * np.pi * profile.r * profile.wall_pressure, profile.r) - np.pi * tabor * c**2
        assert carried == pytest.approx(load, abs=3e-3 * (1.0 + np.pi * tabor * c**2))


def test_exponents_of_folds_are_those_of_their_normal_forms():
    # JKR at a^3 = 9 pi/8: second and third derivatives of F = (4/3) a^3 - sqrt(8 pi a^3); from the closed form, F'' and
    # F''' by seven-point differences in the contact radius
    for tabor in (1.0, 50.0, 1e3):
        diagram = traced(tabor)
        exponent = named(diagram, "load").exponent
        a = named(diagram, "load").contact_radius
        h = 0.004 * a
        near = maugis.contact(a + h * np.arange(-3.0, 4.0), interaction_range=1 / tabor).load
        second = near @ np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180.0 * h * h)
        third = near @ np.array([1.0, -8.0, 13.0, 0.0, -13.0, 8.0, -1.0]) / (8.0 * h**3)
        assert exponent.kappa == 0.5
        assert exponent.crossover_load == pytest.approx(18 * second**3 / third**2, rel=1e-3)
        assert exponent.prefactor == pytest.approx(np.sqrt(2 / second), rel=1e-5)
    a = np.cbrt(9.0 * np.pi / 8.0)
    jkr = 8.0 * a - 0.75 * np.sqrt(8.0 * np.pi / a), 8.0 + 0.375 * np.sqrt(8.0 * np.pi / a**3)
    assert exponent.crossover_load == pytest.approx(18 * jkr[0] ** 3 / jkr[1] ** 2, rel=1e-3)


def test_a_corner_has_no_exponent_and_first_touch_is_a_square_root():
    diagram = traced(1.0)
    corner = named(diagram, "displacement", "jump-in")
    assert corner.exponent is None
    with pytest.raises(cb.InputError, match="jump-in has no exponent: it is a corner"):
        diagram.local_exponent(corner)
    local = diagram.local_exponent(touch(diagram))
    assert local.kappa[0] == pytest.approx(0.5, abs=1e-3)


def test_under_load_the_loop_does_not_close():
    loop = cb.hysteresis(contact(1.0))
    assert loop.dissipated is None
    assert [jump.start.load for jump in loop.jumps] == pytest.approx([traced(1.0).thresholds["pull_off_load"]])


def test_exact_names_why_it_does_not_represent_a_contact():
    exact = cb.Exact()
    law = cb.MaugisDugdale(work_of_adhesion=0.04, range=1.0)
    # mu_T = [R (w/E)^2]^(1/3) / z0
    physical = cb.trace(cb.Contact(cb.Parabola(1000.0), law, 5.0))
    assert physical.model.kind == "exact"
    assert physical.contact.tabor == pytest.approx(np.cbrt(1000.0 * 0.008**2), rel=1e-14)
    for other, reason in (
        (cb.Contact(cb.Cone(1.0), law, 1.0), "not for a tip of the shape cone"),
        (cb.Contact.reduced(cb.Gauss, tabor=1.0), "not for gauss"),
        (cb.Contact(cb.Parabola(1.0)), "not for no interaction"),
        (cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1), "ring of constant gap"),
    ):
        assert reason in str(exact.obstacle(other))
        with pytest.raises(cb.InputError, match=reason):
            cb.trace(other, model=exact)
