"""Springs: folds where dF/dd = −K, between load and displacement control, and what they say about stability."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import chebyshev

import contbranch as cb
from contbranch.control import DISPLACEMENT, LOAD, as_control


def slope(contact: cb.Contact, radius: float) -> float:
    """dF/dd at a contact radius, from single equilibria at Chebyshev nodes around it: no event location involved."""
    nodes = chebyshev.chebpts1(8)
    states = [cb.solve(contact, contact_radius=float(radius + 0.03 * x), accuracy=1e-12) for x in nodes]
    fits = [chebyshev.chebfit(nodes, [getattr(s, name) for s in states], 7) for name in ("load", "displacement")]
    load, displacement = (chebyshev.chebval(0.0, chebyshev.chebder(fit)) for fit in fits)
    return float(load / displacement)


@pytest.mark.parametrize(("law", "tabor", "stiffness"), [("gauss", 2.0, 0.7)])
def test_the_slope_at_a_spring_fold_is_minus_the_stiffness(law, tabor, stiffness):
    contact = cb.Contact.reduced(law, tabor)
    diagram = cb.trace(contact, control=cb.Spring(stiffness), accuracy=1e-11, modes=0)
    folds = {event.name: event for event in diagram.folds("spring")}
    assert set(folds) == {"jump-in", "pull-off"}
    assert all(event.stiffness == stiffness for event in folds.values())
    assert slope(contact, folds["pull-off"].contact_radius) == pytest.approx(-stiffness, abs=1e-9)


@pytest.mark.parametrize("law", ["exponential", "maugis-dugdale"])
def test_folds_tend_to_those_of_load_and_displacement(law):
    """F' + K d' = 0: the fold differs from that of the load by O(K²) in F, from that of the displacement by O(1/K²)
    in d."""
    contact = cb.Contact.reduced(law, 1.0)
    ends = {
        event.control: event for event in cb.trace(contact, accuracy=1e-10, modes=0).events if event.name == "pull-off"
    }

    def fold(stiffness):
        diagram = cb.trace(contact, control=cb.Spring(stiffness), accuracy=1e-10, modes=0)
        return next(event for event in diagram.folds("spring") if event.name == "pull-off")

    soft = [fold(k).load - ends["load"].load for k in (1e-3, 2e-3)]
    assert 0 < soft[0] < 1e-5
    assert soft[1] / soft[0] == pytest.approx(4.0, rel=0.02)
    stiff = [fold(k).displacement - ends["displacement"].displacement for k in (2e3, 1e3)]
    assert 0 < stiff[0] < 1e-4
    assert stiff[1] / stiff[0] == pytest.approx(4.0, rel=0.05)


def test_one_formulation_for_all_controls():
    assert as_control("load") is LOAD
    assert as_control("displacement") is DISPLACEMENT
    spring = as_control(cb.Spring(3.0))
    assert as_control("spring:3") == spring
    assert LOAD.weights == (1.0, 0.0)
    assert DISPLACEMENT.weights == (0.0, 1.0)
    assert np.hypot(*spring.weights) == pytest.approx(1.0)
    # the far end is at d + F/K, and its energy is F²/(2K)
    assert spring.value(6.0, 1.0) == 3.0
    assert spring.potential(3.0, 6.0, 1.0) == 6.0
    assert spring.weighted(6.0, 1.0) == pytest.approx(spring.target(spring.value(6.0, 1.0)))


@pytest.mark.parametrize("control", ["force", 2.0, "spring:", "spring:-1", None])
def test_other_controls_are_refused(control):
    with pytest.raises(cb.InputError, match=r"control|stiffness"):
        cb.trace(cb.Contact.reduced("gauss", 1.0), control=control)


@pytest.mark.parametrize("stiffness", [0.0, -1.0, float("nan"), float("inf"), "stiff"])
def test_a_stiffness_is_a_positive_number(stiffness):
    with pytest.raises(cb.InputError, match="stiffness"):
        cb.Spring(stiffness)


def test_indices_lie_between_those_of_load_and_displacement():
    """n_displacement ≤ n_spring ≤ n_load: a stiffer spring leaves less freedom."""
    diagram = cb.trace(cb.Contact.reduced("gauss", 1.0, -1), control=cb.Spring(2.0))
    branch = diagram.branches[0]
    pieces = np.diff(branch.displacement) * np.diff(branch.displacement + branch.load / 2.0)
    assert (branch.unstable("spring") <= branch.unstable("load")).all()
    assert (branch.unstable("spring") >= branch.unstable("displacement")).all()
    assert branch.unstable("spring").max() == 1
    # the far end moves against the tip exactly where one direction more is unstable than with the displacement held
    more = (branch.unstable_spring > branch.unstable_displacement)[:-1]
    assert (more[1:-1] == (pieces < 0)[1:-1]).mean() > 0.85
    state = cb.solve(cb.Contact.reduced("gauss", 1.0, -1), load=8.1, control=cb.Spring(2.0))
    assert state.unstable_spring == 0
    assert state.stable("spring")
    assert {s.unstable_spring for s in state.states} == {0, 1}


def test_a_soft_spring_jumps_in_far_away():
    """Far away the interaction is that of an undeformed parabola, F = 2π z0 v(d)/z0: dF/dd = −2π z0 (Δγ/z0) e^(d/z0)/z0
    for the exponential law with z0 = 1, so d = ln(K/2π) (Derjaguin)."""
    stiffness = 1e-4
    diagram = cb.trace(cb.Contact.reduced("exponential", 1.0), control=cb.Spring(stiffness), accuracy=1e-9)
    jump = next(event for event in diagram.folds("spring") if event.name == "jump-in")
    assert jump.displacement == pytest.approx(np.log(stiffness / (2 * np.pi)), abs=1e-3)
    assert jump.load == pytest.approx(-stiffness, rel=1e-3)


def test_a_spring_survives_a_file(tmp_path):
    diagram = cb.trace(cb.Contact.reduced("maugis-dugdale", 1.0), control=cb.Spring(2.0))
    diagram.save(tmp_path / "spring.h5")
    again = cb.load(tmp_path / "spring.h5")
    assert (again.control, again.stiffness) == ("spring", 2.0)
    assert (again.branches[0].unstable_spring == diagram.branches[0].unstable_spring).all()
    assert [event.stiffness for event in again.events] == [event.stiffness for event in diagram.events]


def test_stiffness_has_the_units_of_the_contact():
    reduced = cb.Contact.reduced("exponential", 1.0)
    physical = cb.Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="exponential", work_of_adhesion="40 mN/m", range="1 nm"
    )
    scales = physical.scales
    same = cb.Contact.reduced("exponential", physical.tabor)
    own = cb.trace(physical, control=cb.Spring(2.0 * scales.stiffness))
    other = cb.trace(same, control=cb.Spring(2.0))
    assert reduced.scales.stiffness == 1.0
    for a, b in zip(own.folds("spring"), other.folds("spring"), strict=True):
        assert a.stiffness == pytest.approx(2.0 * scales.stiffness)
        assert a.load == pytest.approx(b.load * scales.load, rel=1e-6)


@pytest.mark.parametrize("control", [DISPLACEMENT, as_control(cb.Spring(3.0))], ids=str)
def test_the_energy_at_a_value_does_not_feel_that_a_state_is_a_little_off_it(control):
    """V = d³/3 with F = d²: relative to a load of 1e6 a displacement of 1e-9 would be felt."""

    def height(displacement: float, value: float) -> float:
        load, energy = displacement**2, displacement**3 / 3
        return energy + control.potential(value, load, displacement)

    value = control.value(1e6, 1e3)
    assert height(1e3 + 1e-6, value) - height(1e3, value) == pytest.approx(0.0, abs=1e-6)
