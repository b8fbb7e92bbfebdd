"""Maugis-Dugdale attraction under any axisymmetric tip, alone and together with a smooth law.

All figures are those of `dugdale_reference`, to 30 digits without a smooth law and to 11 with one.
"""

import functools
import itertools
import math

import mpmath
import numpy as np
import pytest
from dugdale_reference import Dugdale, Panels, Powers, Sphere, least, rigid_pull_off
from scipy.optimize import brentq, minimize_scalar, root

import contbranch as cb
from contbranch.theory import maugis

# The share of a cubic term in the tip that is given by a table: its transform is a cubic, which the table's spline is.
CUBIC = 0.2
SPHERE = 100.0
# What rows are made for where events are to be more accurate.
ROWS = 1e-6


def table():
    r = np.linspace(0.0, 8.0, 33)
    return cb.Profile(tuple(r), tuple(r**2 / 2.0 + CUBIC * r**3 / 3.0))


def power(n):
    return Powers(((1.0, n),))


# The tip, the same by hand, and the units of load and of length along the normal in which its Tabor coefficient is one.
TIPS = {
    "cone": (cb.Cone(1.0), power(1.0), 1.0, 1.0),
    "n-1.5": (cb.PowerLaw(1.5, 1.0), power(1.5), 1.0, 1.0),
    "n-2": (cb.PowerLaw(2.0, 1.0), power(2.0), 1.0, 1.0),
    "n-3": (cb.PowerLaw(3.0, 1.0), power(3.0), 1.0, 1.0),
    "n-4": (cb.PowerLaw(4.0, 1.0), power(4.0), 1.0, 1.0),
    "table": (table(), Powers(((1.0, 2.0), (CUBIC, 3.0))), 1.0, 1.0),
    "sphere": (cb.SphericalCap(SPHERE), Sphere(SPHERE), SPHERE, SPHERE ** (1 / 3)),
}
# A sphere's attraction reaches its equator where the range is as long as for 0.05.
CASES = [(name, tabor) for name in TIPS for tabor in (0.3 if name == "sphere" else 0.05, 1.0, 20.0)] + [("cone", 0.3)]
EACH = pytest.mark.parametrize(("name", "tabor"), CASES, ids=lambda value: str(value))


@functools.cache
def reference(name, tabor):
    _, shape, _, normal = TIPS[name]
    return Dugdale(shape, 1.0, normal / tabor)


@functools.cache
def reference_folds(name, tabor, control):
    return reference(name, tabor).folds(control)


def contact(name, tabor):
    tip, _, _, normal = TIPS[name]
    return cb.Contact(tip, cb.MaugisDugdale(1.0, normal / tabor))


@functools.cache
def traced(name, tabor):
    return cb.trace(contact(name, tabor), accuracy=1e-10)


def touch(diagram):
    return next(event for event in diagram.events if event.kind == "touch")


def agree(found, truth, names, load_unit, length_unit):
    """Assert that values are true to 1e-9, and to their errors if these are given."""
    for name in names:
        unit = load_unit if name == "load" else length_unit
        own, true = getattr(found, name), float(getattr(truth, name))
        assert abs(own - true) <= 1e-9 * max(unit, abs(true)), name
        if name in found.error:
            assert abs(own - true) <= found.error[name] + 4e-16 * abs(true), name


# ---- the reference itself ----


@pytest.mark.parametrize("tabor", [1e-2, 0.3, 0.9, 4.0, 100.0])
def test_reference_of_a_parabola_is_maugis(tabor):
    own = Dugdale(power(2.0), 1.0, 1.0 / tabor)
    first = maugis.first_touch(interaction_range=1.0 / tabor)
    assert float(own.touch().load) == pytest.approx(float(first.load), rel=1e-12)
    assert float(own.touch().displacement) == pytest.approx(float(first.displacement), rel=1e-12)
    assert float(own.energy(own.touch())) == pytest.approx(float(first.energy), rel=1e-12)
    folds = {"load": maugis.load_fold, "displacement": maugis.displacement_fold}
    for control, theory in folds.items():
        (fold,), closed = own.folds(control), theory(interaction_range=1.0 / tabor)
        for name in ("load", "displacement", "contact_radius"):
            assert float(getattr(fold, name)) == pytest.approx(float(getattr(closed, name)), rel=1e-12, abs=1e-12)
    for a in (0.2, 1.7):
        state, closed = own.contact_of_radius(a), maugis.contact(a, interaction_range=1.0 / tabor)
        assert float(state.load) == pytest.approx(float(closed.load), rel=1e-12)
        assert float(state.displacement) == pytest.approx(float(closed.displacement), rel=1e-12)
        assert float(own.energy(state)) == pytest.approx(float(closed.energy), rel=1e-11)


@pytest.mark.parametrize("name", ["cone", "n-1.5", "n-3", "sphere"])
def test_reference_slopes_and_energy_are_those_of_the_curve(name):
    own = reference(name, 1.0)
    for theta in (0.4, 1.2):
        low, state, high = (own.contact(theta + step) for step in (1e-9, 0.0, -1e-9))
        apart = high.zone_radius - low.zone_radius
        for field in ("load", "displacement"):
            slope = (getattr(high, field) - getattr(low, field)) / apart
            assert float(slope) == pytest.approx(float(getattr(state, f"{field}_slope")), rel=1e-12)
        # dV = F dd
        work = (own.energy(high) - own.energy(low)) / (high.displacement - low.displacement)
        assert float(work) == pytest.approx(float(state.load), rel=1e-9)


def test_reference_rises_are_integrals():
    for shape in (power(1.5), Sphere(3.0)):
        with mpmath.workdps(30):
            c, theta = mpmath.mpf("1.7"), mpmath.mpf("0.8")

            def integral(c, theta=theta, shape=shape):
                level = shape.transform(c * mpmath.cos(theta))[0]
                return mpmath.quad(lambda phi: shape.transform(c * mpmath.cos(phi))[0] - level, [0, theta])

            value, slope = shape.rise(c, theta)
            assert abs(value - integral(c)) < 1e-25
            assert abs(slope - mpmath.diff(integral, c)) < 1e-12


@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0, 4.0])
def test_reference_has_the_jkr_limit(exponent):
    # h(a) = −√(2πa): F = 2 a [ζ(a) − √(2πa)] − 2 ∫ζ; under a cone of slope s, F = −54 w²/(π E s³) at its least
    shape = power(exponent)

    def load(a):
        level, _, integral = (float(value) for value in shape.transform(mpmath.mpf(a)))
        return 2.0 * (a * (level - math.sqrt(2.0 * math.pi * a)) - integral)

    limit = minimize_scalar(load, bounds=(0.05, 20.0), method="bounded", options={"xatol": 1e-9}).fun
    if exponent == 1.0:
        assert limit == pytest.approx(-54.0 / math.pi, rel=1e-13)
    near, far = (
        tabor**2 * (limit - float(Dugdale(shape, 1.0, 1 / tabor).folds("load")[0].load)) for tabor in (50, 200)
    )
    assert near > 0.0
    assert far == pytest.approx(near, rel=0.02)


@pytest.mark.parametrize(
    ("shape", "height", "closed"),
    [
        (power(2.0), lambda r: r * r / 2.0, -2.0 * math.pi),
        (power(1.0), lambda r: r, -math.pi),
        (power(1.5), lambda r: r**1.5 / 1.5, -math.pi * 1.5 ** (4 / 3)),
        (power(4.0), lambda r: r**4 / 4.0, -2.0 * math.pi),
        (Powers(((1.0, 2.0), (CUBIC, 3.0))), lambda r: r * r / 2.0 + CUBIC * r**3 / 3.0, None),
        (Sphere(3.0), lambda r: 3.0 - math.sqrt(9.0 - r * r), -math.pi * 5.0),
    ],
    ids=["parabola", "cone", "n-1.5", "n-4", "table", "sphere"],
)
def test_reference_has_the_rigid_limit(shape, height, closed):
    # in units of w, at the range 1; what remains falls like w/E at least
    limit = rigid_pull_off(height, 1.0, 1.0, 2.9)
    if closed is not None:
        assert limit == pytest.approx(closed, rel=1e-12)
    left = []
    for work in (1e-3, 1e-5):
        own = Dugdale(shape, work, 1.0)
        (fold,) = own.folds("load")
        left.append(abs(float(fold.load) / work - limit))
        assert left[-1] < 30.0 * work
    assert left[1] < 0.02 * left[0]


def test_panels_agree_with_the_closed_condition():
    for exponent in (1.0, 2.0, 3.0):
        shape = power(exponent)
        own = Dugdale(shape, 1.0, 1.0)
        panels = panels_of(exponent, 0.0, 0.3)
        apart = own.apart(0.5)
        found = panels.state(0.0, 0.5)
        assert found[:2] == pytest.approx((float(apart.load), float(apart.displacement)), abs=1e-11)
        state = own.contact_of_radius(1.2)
        found = panels.touching(1.2, (0.3, 2.0))
        assert found == pytest.approx((float(state.load), float(state.displacement)), abs=1e-11)


# ---- attraction alone ----


@EACH
def test_first_touch(name, tabor):
    diagram, truth = traced(name, tabor), reference(name, tabor).touch()
    _, _, load, normal = TIPS[name]
    assert diagram.status == "complete"
    found = touch(diagram)
    agree(found, truth, ("load", "displacement"), load, normal)
    assert found.contact_radius == 0.0
    assert abs(found.central_gap) <= 1e-9 * normal
    assert diagram.thresholds["touch_load"] == found.load
    assert diagram.thresholds["touch_displacement"] == found.displacement


@EACH
def test_folds(name, tabor):
    diagram, own = traced(name, tabor), reference(name, tabor)
    _, _, load, normal = TIPS[name]
    for control in ("load", "displacement"):
        truths = reference_folds(name, tabor, control)
        found = [event for event in diagram.folds(control) if event.load < 0.0]
        assert len(found) == len(truths)
        for event, truth in zip(found, truths, strict=True):
            # the control's value is stationary: the other values and the radius are known less well
            agree(event, truth, (control,), load, normal)
            for other in {"load", "displacement", "contact_radius", "central_gap"} - {control}:
                unit = load if other == "load" else normal
                assert abs(getattr(event, other) - float(getattr(truth, other))) <= max(
                    1e-8 * unit, event.error[other]
                ), other
            assert event.name == "pull-off"
    corners = [event for event in diagram.folds("displacement") if event.load == 0.0]
    assert [event.name for event in corners] == ["jump-in"] * own.jumps_in()
    for corner in corners:
        assert corner.displacement == pytest.approx(-normal / tabor, rel=1e-12)


@EACH
def test_thresholds(name, tabor):
    thresholds, own = traced(name, tabor).thresholds, reference(name, tabor)
    _, _, load, normal = TIPS[name]
    (fold,) = reference_folds(name, tabor, "load")
    assert thresholds["pull_off_load"] == pytest.approx(float(fold.load), rel=1e-9, abs=1e-9 * load)
    assert thresholds["pull_off_radius"] == pytest.approx(float(fold.contact_radius), rel=1e-7, abs=1e-8)
    folds = reference_folds(name, tabor, "displacement")
    # under a cone whose slope is more than 4σ/π nothing jumps
    assert ("pull_off_displacement" in thresholds) == bool(folds)
    assert ("jump_in_displacement" in thresholds) == own.jumps_in()
    if folds:
        least_displacement = float(folds[0].displacement)
        assert thresholds["pull_off_displacement"] == pytest.approx(least_displacement, rel=1e-9, abs=1e-9 * normal)


@EACH
def test_rows_are_on_the_curve(name, tabor):
    branch, own = traced(name, tabor).branches[0], reference(name, tabor)
    _, _, load, normal = TIPS[name]
    attracted = branch.load != 0.0
    apart = np.flatnonzero(attracted & (branch.contact_radius == 0.0) & (branch.central_gap > 0.0))
    touching = np.flatnonzero(branch.contact_radius > 0.0)
    assert apart.size > 2
    assert touching.size > 6
    special = {int(event.position) for event in traced(name, tabor).events}
    for row in [*apart[:: max(1, apart.size // 5)], *touching[:: max(1, touching.size // 5)]]:
        a = branch.contact_radius[row]
        truth = (
            own.contact_of_radius(float(a))
            if a > 0.0
            else own.apart(mpmath.sqrt(-branch.load[row] / (mpmath.pi * own.stress)))
        )
        wanted = {
            "load": (truth.load, load),
            "displacement": (truth.displacement, normal),
            "central_gap": (truth.central_gap, normal),
            "energy": (own.energy(truth), load * normal),
        }
        for field, (value, unit) in wanted.items():
            off = abs(getattr(branch, field)[row] - float(value))
            assert off <= ROWS * max(unit, abs(float(value))), (field, row)
            if field in ("load", "displacement"):
                assert off <= getattr(branch, f"{field}_error")[row], (field, row)
        if row not in special:
            # c grows along the curve: one mode is unstable where the displacement falls
            held = int(truth.displacement_slope < 0)
            assert branch.unstable_displacement[row] == held
            assert branch.unstable_load[row] == held + int(truth.load_slope * truth.displacement_slope < 0)


@pytest.mark.parametrize("tabor", [0.05, 1.0, 20.0])
def test_a_power_of_two_is_a_parabola(tabor):
    law = cb.MaugisDugdale(1.0, 1.0 / tabor)
    exact = cb.trace(cb.Contact(cb.Parabola(1.0), law), accuracy=1e-10)
    diagram = traced("n-2", tabor)
    assert set(diagram.thresholds) == set(exact.thresholds)
    for key, value in exact.thresholds.items():
        allowed = 1e-7 if key.endswith("radius") else 1e-9
        assert diagram.thresholds[key] == pytest.approx(value, rel=allowed, abs=allowed), key
    assert [(event.kind, event.control, event.name) for event in diagram.events] == [
        (event.kind, event.control, event.name) for event in exact.events
    ]
    branch = diagram.branches[0]
    rows = branch.contact_radius > 0.0
    closed = maugis.contact(branch.contact_radius[rows], interaction_range=1.0 / tabor)
    for field in ("load", "displacement", "energy"):
        np.testing.assert_allclose(getattr(branch, field)[rows], getattr(closed, field), rtol=ROWS, atol=ROWS)


@pytest.mark.parametrize("name", ["cone", "n-1.5", "n-3", "n-4", "table"])
def test_a_single_state_and_its_profile(name):
    own = reference(name, 1.0)
    truth = own.contact_of_radius(1.2)
    state = cb.solve(contact(name, 1.0), contact_radius=1.2, accuracy=1e-10)
    assert state.contact_radius == pytest.approx(1.2, rel=1e-12)
    assert state.load == pytest.approx(float(truth.load), rel=1e-9)
    assert state.displacement == pytest.approx(float(truth.displacement), rel=1e-9)
    c = float(truth.zone_radius)
    assert np.all(state.gap[state.r <= 1.2] <= 1e-9)
    assert np.all(np.diff(state.gap) >= -1e-9)
    assert np.interp(c, state.r, state.gap) == pytest.approx(1.0, rel=1e-2)
    around = (state.r > 1.2 * (1.0 + 1e-6)) & (state.r < c * (1.0 - 1e-6))
    assert np.any(around)
    np.testing.assert_allclose(state.pressure[around], -1.0, rtol=1e-9)
    assert not np.any(state.pressure[state.r > c * (1.0 + 1e-6)])


def test_states_at_a_displacement():
    # at 1.2 ranges before a cubic tip: far, and with attraction an unstable and a stable one
    found = cb.find_all(contact("n-3", 1.0), displacement=-1.2)
    assert sorted(state.unstable_displacement for state in found.states) == [0, 0, 1]
    # a cone with little attraction has one state whatever the displacement
    for displacement in (-2.0, 0.5, 3.0):
        assert len(cb.find_all(contact("cone", 0.3), displacement=displacement).states) == 1


def test_modulus_work_and_length():
    # z = r³/(3 ℓ²): loads over E are those of the work w/E
    modulus, work, reach, length = 7.0, 0.5, 0.3, 2.0
    own = Dugdale(Powers(((length**-2.0, 3.0),)), work / modulus, reach)
    diagram = cb.trace(cb.Contact(cb.PowerLaw(3.0, length), cb.MaugisDugdale(work, reach), modulus), accuracy=1e-10)
    (fold,) = own.folds("load")
    assert diagram.thresholds["pull_off_load"] == pytest.approx(modulus * float(fold.load), rel=1e-9)
    assert touch(diagram).load == pytest.approx(modulus * float(own.touch().load), rel=1e-9)
    assert touch(diagram).displacement == pytest.approx(float(own.touch().displacement), rel=1e-9)


@pytest.mark.parametrize("name", ["cone", "n-1.5", "n-3"])
def test_stated_errors_hold_at_a_low_accuracy(name):
    diagram = cb.trace(contact(name, 1.0), accuracy=1e-5)
    for control in ("load", "displacement"):
        (truth,) = reference_folds(name, 1.0, control)
        (found,) = [event for event in diagram.folds(control) if event.load < 0.0]
        for field in ("load", "displacement", "contact_radius"):
            assert abs(getattr(found, field) - float(getattr(truth, field))) <= found.error[field], (control, field)
        assert found.error[control] <= 1e-5 * max(1.0, abs(getattr(found, control)))


# ---- with a smooth law ----


def panels_of(exponent, strength, reach, **layout):
    """Attraction of the work and range 1, with the pressure (strength/reach) exp(−g/reach)."""
    factor = 0.5 * math.gamma(0.5 * exponent) * math.gamma(0.5) / math.gamma(0.5 * (exponent + 1.0))

    def smooth(gap):
        pressure = strength / reach * np.exp(-gap / reach)
        return pressure, -pressure / reach

    return Panels(
        lambda t: factor * t**exponent,
        lambda t: factor * t ** (exponent + 1.0) / (exponent + 1.0),
        1.0,
        1.0,
        smooth,
        far=8.0,
        **layout,
    )


def tip_of(exponent):
    return {1.0: cb.Cone(1.0), 2.0: cb.Parabola(1.0)}.get(exponent) or cb.PowerLaw(exponent, 1.0)


@pytest.mark.parametrize("strength", [1e-12, -1e-12])
@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.0])
def test_a_vanishing_law_changes_nothing(exponent, strength):
    law = cb.MaugisDugdale(1.0, 1.0) + cb.Exponential(-strength, 0.3)
    diagram = cb.trace(cb.Contact(tip_of(exponent), law), accuracy=1e-10)
    own = Dugdale(power(exponent), 1.0, 1.0)
    (fold,) = own.folds("load")
    (bend,) = own.folds("displacement")
    assert diagram.thresholds["pull_off_load"] == pytest.approx(float(fold.load), rel=1e-9)
    assert diagram.thresholds["pull_off_displacement"] == pytest.approx(float(bend.displacement), rel=1e-9)
    assert touch(diagram).load == pytest.approx(float(own.touch().load), rel=1e-9)
    assert touch(diagram).displacement == pytest.approx(float(own.touch().displacement), rel=1e-9)


def test_a_repulsive_core_without_contact():
    law = cb.MaugisDugdale(1.0, 1.0) + cb.Exponential(-1.0, 0.3)
    contact = cb.Contact(cb.Parabola(1.0), law)
    panels = panels_of(2.0, 1.0, 0.3)
    pull_off = least(lambda edge: panels.state(0.0, edge)[0], 0.9, 1.7)
    bend = least(lambda edge: panels.state(0.0, edge)[1], 0.4, 1.0)
    # a finer layout says how good these are
    finer = panels_of(2.0, 1.0, 0.3, order=16, grading=12)
    assert least(lambda edge: finer.state(0.0, edge)[0], 0.9, 1.7) == pytest.approx(pull_off, abs=1e-10)
    thresholds = cb.trace(contact, accuracy=1e-10).thresholds
    assert thresholds["pull_off_load"] == pytest.approx(pull_off, abs=2e-9)
    assert thresholds["pull_off_displacement"] == pytest.approx(bend, abs=2e-9)
    state = cb.solve(contact, displacement=1.0, accuracy=1e-10)
    assert state.load == pytest.approx(panels.apart(1.0, (1.7, 2.5))[0], abs=2e-9)
    assert state.contact_radius == 0.0


# Under a cubic tip with a stronger repulsion the surfaces meet on a ring first.
@pytest.mark.parametrize(
    ("exponent", "strength"), [(n, s) for n in (1.0, 2.0, 3.0) for s in (0.05, -0.05, 0.2) if n < 3.0 or s < 0.0]
)
def test_a_smooth_law_around_a_contact(exponent, strength):
    law = cb.MaugisDugdale(1.0, 1.0) + cb.Exponential(-strength, 0.3)
    state = cb.solve(cb.Contact(tip_of(exponent), law), contact_radius=1.2, accuracy=1e-10)
    load, displacement = panels_of(exponent, strength, 0.3).touching(1.2, (0.3, 2.0))
    assert state.load == pytest.approx(load, abs=2e-9)
    assert state.displacement == pytest.approx(displacement, abs=2e-9)


@pytest.mark.parametrize(("exponent", "strength"), [(2.0, 0.2)])
def test_first_touch_with_a_smooth_law(exponent, strength):
    law = cb.MaugisDugdale(1.0, 1.0) + cb.Exponential(-strength, 0.3)
    panels = panels_of(exponent, strength, 0.3)
    edge = brentq(lambda edge: panels.state(0.0, edge)[2], 0.5, 1.5, xtol=1e-13)
    load, displacement = panels.state(0.0, edge)[:2]
    found = touch(cb.trace(cb.Contact(tip_of(exponent), law), accuracy=1e-10))
    assert found.load == pytest.approx(load, abs=2e-9)
    assert found.displacement == pytest.approx(displacement, abs=2e-9)


def test_a_rigid_parabola_with_both_laws():
    # F = 2πR v(−d) without contact
    law = cb.MaugisDugdale(1.0, 1.0) + cb.Exponential(-1.0, 0.3)
    thresholds = cb.trace(cb.Contact(cb.Parabola(1.0), law, modulus=1e4), accuracy=1e-4, modes=0).thresholds
    deepest = minimize_scalar(lambda gap: gap - 1.0 + math.exp(-gap / 0.3), bounds=(0.0, 1.0), method="bounded").fun
    assert thresholds["pull_off_load"] == pytest.approx(2.0 * math.pi * deepest, rel=1e-3)


def two_attractions(exponent, radius, laws):
    """Load and displacement with h = −2 Σ σ √(c² − t²), each c where the gap is its law's range."""
    factor = 0.5 * math.gamma(0.5 * exponent) * math.gamma(0.5) / math.gamma(0.5 * (exponent + 1.0))
    x, w = np.polynomial.legendre.leggauss(100)
    angles, weights = math.pi / 4.0 * (x + 1.0), math.pi / 4.0 * w

    def lifted(t, edges):
        return -2.0 * sum(
            w / z * np.sqrt(np.maximum(c * c - t * t, 0.0)) for c, (w, z) in zip(edges, laws, strict=True)
        )

    def gap(r, edges):
        knots, total = sorted({radius, r, *(c for c in edges if radius < c < r)}), 0.0
        for low, high in itertools.pairwise(knots):
            t = low + (high - low) * np.sin(angles) ** 2
            rise = lifted(t, edges) - lifted(radius, edges) + factor * (t**exponent - radius**exponent)
            away = (r - high) + (high - low) * np.cos(angles) ** 2
            total += np.sum(weights * (high - low) * np.sin(2.0 * angles) * rise / np.sqrt(away * (r + t)))
        return 2.0 / math.pi * total

    start = [radius + 0.5 * z for _, z in laws]
    edges = root(lambda edges: [gap(c, edges) - z for c, (_, z) in zip(edges, laws, strict=True)], start, tol=1e-14).x
    displacement = factor * radius**exponent + float(lifted(np.float64(radius), edges))
    load = 2.0 * (displacement * radius - factor * radius ** (exponent + 1.0) / (exponent + 1.0))
    for c, (w, z) in zip(edges, laws, strict=True):
        load -= 2.0 * w / z * (c * c * math.acos(radius / c) - radius * math.sqrt(c * c - radius * radius))
    return load, displacement


@pytest.mark.parametrize("laws", [((1.0, 1.0), (0.5, 0.4)), ((1.0, 1.0), (0.2, 0.9)), ((0.5, 2.0), (1.0, 0.1))])
@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.0])
def test_two_attractions(exponent, laws):
    law = cb.MaugisDugdale(*laws[0]) + cb.MaugisDugdale(*laws[1])
    state = cb.solve(cb.Contact(tip_of(exponent), law), contact_radius=1.2, accuracy=1e-10)
    load, displacement = two_attractions(exponent, 1.2, laws)
    assert state.load == pytest.approx(load, abs=1e-9)
    assert state.displacement == pytest.approx(displacement, abs=1e-9)


def test_the_range_reaches_the_edge_of_a_tip():
    diagram = cb.trace(cb.Contact(cb.SphericalCap(3.0), cb.MaugisDugdale(1.0, 2.0)))
    assert (
        diagram.message == "The range of the interaction has come to the edge of the tip, where its description ends."
    )
    assert [event.name for event in diagram.events if event.kind == "end"] == ["tip-edge"]


@pytest.mark.parametrize(("tip", "limit"), [(cb.PowerLaw(2.0, 1.0), -2.0 * math.pi), (cb.Cone(1.0), -math.pi)])
def test_a_rigid_tip(tip, limit):
    thresholds = cb.trace(cb.Contact(tip, cb.MaugisDugdale(1.0, 1.0), modulus=1e4), accuracy=1e-4, modes=0).thresholds
    assert thresholds["pull_off_load"] == pytest.approx(limit, rel=1e-3)
