"""Flat tips touch on a ring before they touch at the centre: against one Chebyshev polynomial for the whole half space.

The gap of a film is `g = A h + z − d` with `A h = (2/π) ∫ h(r sin θ) dθ`, and `h = B p` with
`B p = 2 ∫ p(√(t² + v²)) dv`; contact begins at the displacement where the smallest gap is 0. Theory: Sneddon, Int. J.
Eng. Sci. 3, 47 (1965). Displacements and loads stand besides, to all digits, as a Nyström method in the radius gives
them: the kernel `4/π K(m) s/(r + s)` with `m = 4rs/(r + s)²` by product integration, the same on chords.
"""

from functools import cache

import numpy as np
import pytest
from followed import virial
from scipy.optimize import brentq

import contbranch as cb

CASES = [
    (3.5, cb.Exponential(-1.0, 8.0), 6.8, (0.5, 0.62)),
    (3.855, cb.Exponential(-1.0, 5.5), 5.5, (0.6, 0.8)),
    (4.0, cb.Gauss(1.0, 10.0), 5.2, (-0.3, -0.1)),
]


@cache
def traced(contact, accuracy):
    return cb.trace(contact, "displacement", accuracy=accuracy, modes=0)


def first_contact(exponent, law, reach, bracket, count=80):
    """Displacement, load and radius at which the smallest gap of a tip rⁿ/n vanishes."""
    angles = np.pi * (np.arange(count) + 0.5) / count
    t, weights = reach * (np.cos(angles) + 1) / 2, (-1.0) ** np.arange(count) * np.sin(angles)
    x, w = np.polynomial.legendre.leggauss(110)
    x, w = (x + 1) / 2, w / 2

    def sampled(places):
        away = places[:, None] - t
        away[away == 0.0] = 1e-300
        rows = weights / away
        return rows / rows.sum(axis=1)[:, None]

    gaps = np.stack([w @ sampled(r * np.sin(np.pi / 2 * x)) for r in t])
    far = np.sqrt(reach**2 - t**2)
    abel = np.stack([2 * v * w @ sampled(np.sqrt(s * s + (v * x) ** 2)) for s, v in zip(t, far, strict=True)])
    radii = np.linspace(0.0, 1.0, 2001)
    fine, load = sampled(radii), 2 * reach * w @ sampled(reach * x)
    state = {"h": np.zeros(count)}

    def smallest(d):
        h = state["h"]
        for _ in range(50):
            gap = gaps @ h + t**exponent / exponent - d
            _, pressure, stiffness = law.evaluate(gap)
            step = np.linalg.solve(np.eye(count) + abel @ (stiffness[:, None] * gaps), abel @ pressure - h)
            h = h + step
            if np.abs(step).max() < 1e-13:
                break
        gap = fine @ (gaps @ h + t**exponent / exponent - d)
        k = int(np.clip(gap.argmin(), 1, len(radii) - 2))
        a, b, c = np.polyfit(radii[k - 1 : k + 2], gap[k - 1 : k + 2], 2)
        state.update(h=h, load=float(load @ h), radius=-b / (2 * a))
        return c - b * b / (4 * a)

    d = brentq(smallest, *bracket, xtol=1e-13)
    smallest(d)
    return d, state["load"], state["radius"]


@pytest.mark.parametrize(
    ("case", "d", "load", "accuracy", "most"),
    [
        (CASES[0], 0.58829332007392, 2.38743785595116, 1e-6, (1e-6, 3e-6)),
        (CASES[1], 0.73686707478392, 2.54289705454403, 1e-9, (1e-10, 1e-10)),
        (CASES[2], -0.13850519380490, -1.02051142122341, 1e-9, (1e-10, 1e-10)),
    ],
)
def test_contact_begins_on_a_ring_where_the_gap_says(case, d, load, accuracy, most):
    contact = cb.Contact(tip=cb.PowerLaw(case[0], 1.0), interaction=case[1], modulus=1.0)
    diagram = cb.trace(contact, accuracy=accuracy, modes=0)
    assert diagram.status == "complete", diagram.message
    first = next(event for event in diagram.events if event.kind != "fold")
    assert first.kind == "topology"
    assert first.contact_radius == 0.0
    assert abs(first.displacement - d) < first.error["displacement"] < most[0]
    assert abs(first.load - load) < first.error["load"] < most[1]
    *truth, radius = first_contact(*case)
    assert truth == pytest.approx((d, load), abs=2e-11)
    assert f"ring of radius {radius:.4f}"[:-1] in first.message


def test_a_stiff_contact_grows_from_a_ring():
    """Steps are as long as the curve allows; on tips z ∝ rⁿ (2n + 1) V_ela + 2 V_fr − n ∫ g p d²r = n F d."""
    exponent = 3.5
    contact = cb.Contact(cb.PowerLaw(exponent, 1.0), cb.Gauss(1.0, 0.3), 1.0)
    diagram = cb.trace(contact, accuracy=1e-4, modes=0)
    assert diagram.status == "complete", diagram.message
    assert len(diagram.branches[0].load) < 150
    topology = [event for event in diagram.events if event.kind == "topology"]
    assert topology
    for event in [*topology, diagram.events[-1]]:
        point = event.origin.raw.point
        energy = point.problem.values(point.x, point.parameter).energy
        surface, pressed = virial(point)
        work = exponent * event.load * event.displacement
        scaled = (2 * exponent + 1) * (energy - surface) + 2 * surface - exponent * pressed
        assert scaled == pytest.approx(work, rel=1e-5, abs=1e-4)


def test_a_fold_next_to_touch_does_not_depend_on_the_steps_that_led_there():
    """The first step beyond touch is long and its own measure of lengths small: where load turns is found all the same.

    Its displacement is where a polynomial through loads at given displacements has its minimum.
    """
    contact = cb.Contact(cb.PowerLaw(5.18, 1.0), cb.InverseSquare(1.0, 3.941580473254946), modulus=3.0)
    (fold,) = cb.trace(contact, accuracy=1e-4, max_load=9.5, modes=0).folds("load")
    given = fold.displacement + np.linspace(-6e-4, 6e-4, 5)
    states = [cb.solve(contact, displacement=d, accuracy=1e-10) for d in given]
    load = np.polynomial.Polynomial.fit(given, [state.load for state in states], 4)
    turn = min(load.deriv().roots(), key=lambda root: abs(root - fold.displacement)).real
    at_turn = cb.solve(contact, displacement=turn, accuracy=1e-9)
    assert abs(fold.displacement - turn) < fold.error["displacement"]
    assert abs(fold.contact_radius - at_turn.contact_radius) < fold.error["contact_radius"]


@pytest.mark.parametrize(
    ("contact", "accuracy"),
    [
        (cb.Contact(cb.PowerLaw(3.112, 1.0), cb.Layered(-1.0, 42.67454457989872, 117.78174304052047, 0.0)), 1e-4),
    ],
)
def test_behind_a_dish_too_shallow_to_be_seen_discs_have_no_folds_of_their_own(contact, accuracy):
    """The surfaces meet on a ring first, by less than is tolerated: smaller discs lose displacement as they grow.

    Truth is what the curve must be: states of given displacement are found on it with the radii that it says, all are
    stable, as many modes are unstable at its end as folds say, and the energy changes by the load's work.
    """
    diagram = traced(contact, accuracy)
    assert diagram.status == "complete", diagram.message
    (branch,) = diagram.branches
    touch = next(event for event in diagram.events if event.kind in ("touch", "topology"))
    assert not list(diagram.folds("displacement"))
    assert not branch.unstable_displacement.any()
    touched = np.flatnonzero(branch.contact_radius > 0.0)
    rows = [touched[0] - 1, *touched[:3]]
    d, energy = branch.displacement[rows], branch.energy[rows]
    assert d[0] == pytest.approx(touch.displacement, abs=touch.error["displacement"])
    assert np.all(np.diff(d) > 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    half = (d[-1] - d[0]) / 2
    states = [cb.solve(contact, displacement=d[0] + half * (1 + x), accuracy=accuracy) for x in nodes]
    radii = [state.contact_radius for state in states]
    assert np.all(np.diff([0.0, *radii, branch.contact_radius[rows[-1]]]) > 0.0)
    work = half * weights @ [state.load for state in states]
    assert energy[-1] - energy[0] == pytest.approx(work, abs=accuracy * np.abs(energy).max())
    again = next(event for event in traced(contact, accuracy / 30).events if event.kind == touch.kind)
    assert abs(touch.displacement - again.displacement) < touch.error["displacement"]


def test_a_fold_a_hair_behind_touch_is_found_from_steps_that_are_cut_short():
    """Load is least where contact is a few thousandths wide: less than a millionth of displacement to either side."""
    law = cb.Exponential(-0.822, 112.245) + cb.InverseSquare(0.178, 50.959)
    contact = cb.Contact(cb.PowerLaw(3.748, 1.0), law)
    folds = cb.trace(contact, control="displacement", accuracy=1e-8, modes=0).folds("load")
    fold = max(folds, key=lambda one: one.displacement)
    assert 0.0 < fold.contact_radius < 0.01
    given = fold.displacement + np.linspace(-1e-6, 1e-6, 5)
    loads = [cb.solve(contact, displacement=d, accuracy=1e-10).load for d in given]
    assert np.argmin(loads) == 2


def test_radii_that_a_ring_skips_are_no_states():
    """Contact begins on a ring of r = 0.1576, where the film's gap closes: no contact is smaller."""
    contact = cb.Contact(cb.PowerLaw(3.5, 1.0), cb.Exponential(-1.0, 8.0))
    with pytest.raises(cb.InputError, match=r"contact radii greater than 0\.157\d+ are reachable"):
        cb.solve(contact, contact_radius=0.15, accuracy=1e-5)
    state = cb.solve(contact, contact_radius=0.2, accuracy=1e-5)
    again = cb.solve(contact, displacement=state.displacement, accuracy=1e-5)
    assert again.contact_radius == pytest.approx(0.2, abs=1e-6)
    assert again.load == pytest.approx(state.load, abs=1e-6)


def test_a_stiff_film_under_a_flat_tip_breaks_on_a_ring_and_then_in_the_middle():
    """Gaps of 1e-6 tell pressures of a film whose surfaces are moved by hundreds of ranges.

    The ring is born where the film's pressure reaches its bound, and its hole closes where that all but rests.
    """
    contact = cb.Contact(cb.PowerLaw(2.5, 1.0), cb.InverseSquare(-1.0, 1.0 / 6.0))
    coarse, fine = (cb.trace(contact, accuracy=accuracy, max_load=12600.0, modes=0) for accuracy in (1e-4, 1e-6))
    for diagram in (coarse, fine):
        assert diagram.status == "complete", diagram.message
        assert len(diagram.branches[0].load) < 200
        assert [event.kind for event in diagram.events] == ["topology", "topology", "end"]
    for one, other in list(zip(coarse.events, fine.events, strict=True))[:2]:
        for name in ("load", "displacement"):
            assert abs(getattr(one, name) - getattr(other, name)) <= one.error[name] + other.error[name]
