"""Contacts as functions of one number."""

from __future__ import annotations

import math

import pytest

import contbranch as cb
from contbranch.contact.family import family_of

SUM = cb.Contact(cb.Parabola(2.0), cb.VanDerWaals(1.0, 0.5) + cb.Layered(-3.0, 1.0, wavelength=0.7), 2.0)


def test_the_tabor_coefficient_scales_all_lengths_of_the_interaction():
    family = family_of(SUM, "tabor", 2.0)
    assert family.start == SUM.tabor
    first, second = family.member(2.0 * SUM.tabor).interaction.terms
    assert (first.range, second.range, second.wavelength) == pytest.approx((0.25, 0.5, 0.35))
    assert (first.work_of_adhesion, second.work_of_adhesion) == (1.0, -3.0)
    assert family.member(2.0 * SUM.tabor).tabor == pytest.approx(2.0 * SUM.tabor)


def test_a_share_moves_between_two_laws_at_full_amplitude():
    family = family_of(SUM, "share", 1.0)
    assert family.start == 0.75
    works = [law.work_of_adhesion for law in family.member(0.25).interaction.terms]
    assert works == [3.0, -1.0]
    assert family.member(1.0).interaction == cb.Layered(-4.0, 1.0, wavelength=0.7)
    assert family.member(0.0).interaction == cb.VanDerWaals(4.0, 0.5)


@pytest.mark.parametrize(
    ("vary", "value", "read"),
    [
        ("tip.radius", 3.0, lambda contact: contact.tip.radius),
        ("modulus", 5.0, lambda contact: contact.modulus),
        ("interaction[0].range", 0.2, lambda contact: contact.interaction.terms[0].range),
        ("interaction[1].work_of_adhesion", -0.2, lambda contact: contact.interaction.terms[1].work_of_adhesion),
        ("interaction[1].phase", 0.4, lambda contact: contact.interaction.terms[1].phase),
    ],
)
def test_one_parameter_changes_and_nothing_else(vary, value, read):
    family = family_of(SUM, vary, value)
    assert read(family.member(value)) == value
    assert read(SUM) == family.start
    assert family.member(family.start) == SUM
    assert family.value(family.coordinate(value)) == pytest.approx(value, rel=1e-14)
    step = 1e-6
    q = family.coordinate(value)
    slope = (family.value(q + step) - family.value(q - step)) / (2 * step)
    assert family.rate(q) == pytest.approx(slope, rel=1e-8)


def test_a_stiffness_reaches_load_and_displacement_control():
    family = family_of(SUM, "stiffness", 0.0, 3.0)
    q = family.coordinate(math.inf)
    assert family.value(q) == math.inf
    assert family.control(q, None).kind == "displacement"
    assert family.control(family.coordinate(0.0), None).kind == "load"
    assert family.control(family.coordinate(3.0), None).stiffness == pytest.approx(3.0 / SUM.scales.stiffness)


def test_units_are_those_of_the_start():
    """The second law three times as strong would make other reduced units of its own contact."""
    family = family_of(SUM, "interaction[1].work_of_adhesion", -9.0)
    contact, scales = family.reduced(family.coordinate(-9.0))
    assert scales == SUM.scales
    assert contact.interaction.terms[1].work_of_adhesion == pytest.approx(-9.0 / SUM.scales.energy_per_area)


@pytest.mark.parametrize("broken", [lambda value: 1 / 0, lambda value: "contact"])
def test_a_function_that_fails_is_reported(broken):
    def function(value):
        return SUM if value == 1.0 else broken(value)

    family = family_of(SUM, function, 2.0, 1.0)
    with pytest.raises(cb.InputError, match="vary: the function"):
        family.member(2.0)
