"""Laws that are lowest at a gap above zero, such as that of Lennard-Jones without a wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

import contbranch as cb
from contbranch.curve.naming import threshold_events

# Pull-off over 2πRγ by the Tabor coefficient: 600 rings, an independent program.
PULL_OFF = {0.5: 0.89374, 1.0: 0.83533, 2.0: 0.79180, 3.0: 0.77552}


@dataclass(frozen=True)
class LennardJones(cb.Interaction):
    """v = −γ (4y⁻² − y⁻⁸)/3, y = g/ε + start: lowest at y = 1, where it is −γ."""

    start: float = 0.8
    core: str = "soft"  # fields of a user's law bear what names they like

    def shape(self, x):
        y = x + self.start
        return (4.0 * y**-2 - y**-8) / 3.0, (8.0 * y**-9 - 8.0 * y**-3) / 3.0, 8.0 * y**-4 - 24.0 * y**-10


@dataclass(frozen=True)
class Morse(cb.Interaction):
    """v = γ ((1 − e^(1−x))² − 1): lowest at x = 1, where it is −γ."""

    def shape(self, x):
        e = np.exp(1.0 - np.minimum(x, 1e3))
        return 2.0 * e - e * e, 2.0 * e * e - 2.0 * e, 2.0 * e - 4.0 * e * e


def tabulated(law: cb.Interaction, rows: int = 200, until: float = 20.0) -> cb.Tabulated:
    gaps = (np.geomspace(0.8, until, rows) - 0.8) * law.range
    return cb.Tabulated(gaps=tuple(gaps), energies=tuple(law.evaluate(gaps).energy))


def contact(law: cb.Interaction) -> cb.Contact:
    return cb.Contact(cb.Parabola(1.0), law)


@pytest.mark.parametrize("tabor", PULL_OFF)
def test_curves_of_lennard_jones_end_in_its_core(tabor: float) -> None:
    law = LennardJones(1.0, 1.0 / tabor)
    diagram = cb.trace(contact(law), max_load=20.0, modes=0)
    assert (diagram.status, diagram.message) == ("complete", "")
    assert diagram.thresholds["pull_off_load"] == pytest.approx(-2.0 * math.pi * PULL_OFF[tabor], abs=4e-5)
    last = diagram.branches[0].state(-1)
    assert (last.load, last.contact_radius) == (pytest.approx(20.0, abs=1e-6), 0.0)
    assert 0.0 < last.central_gap < law.contact_gap
    assert "touch_load" not in diagram.thresholds


def test_jump_in_of_lennard_jones_given_by_a_table() -> None:
    """At α = −1.62921, counted from the gap ε of least energy, by the same independent program."""
    for start in (0.8, 0.9):
        law = tabulated(LennardJones(1.0, 1.0, start))
        diagram = cb.trace(contact(law), control="displacement", modes=0)
        assert (diagram.status, diagram.message) == ("complete", "")
        assert diagram.thresholds["jump_in_displacement"] == pytest.approx(-1.62921 - (1.0 - start), abs=1e-4)
        assert diagram.thresholds["pull_off_load"] == pytest.approx(-2.0 * math.pi * PULL_OFF[1.0], abs=1e-4)


def test_a_film_under_a_law_that_yields_before_the_wall_is_no_contact() -> None:
    """Its pressure is largest at a gap of 0.04 and 2 % lower at the wall: there the film is squeezed out."""
    law = cb.Layered(-1.0, 0.5, 1.5, 0.5)
    diagram, farther = (cb.trace(contact(law), max_load=load, modes=0) for load in (None, 600.0))
    assert law.lowest_gap > 0.0 == law.contact_gap
    assert diagram.status == farther.status == "complete"
    assert diagram.branches[0].contact_radius[-1] > 0.0
    assert diagram.thresholds["squeeze_out_load"] == pytest.approx(farther.thresholds["squeeze_out_load"], rel=1e-5)
    assert diagram.thresholds["squeeze_out_load"] > 400.0


def test_a_table_has_the_numbers_of_its_law_whatever_it_holds_of_the_core() -> None:
    """Depth of the minimum, and depth over the largest tension, (8/3)(3^(−1/2) − 3^(−3/2)) γ/ε."""
    steepest = 8.0 / 3.0 * (3.0**-0.5 - 3.0**-1.5)
    for start in (0.7, 0.8, 0.95):
        law = tabulated(LennardJones(2.0, 0.5, start), 400)
        assert law.work_of_adhesion == law.reference_work == pytest.approx(2.0, rel=1e-5)
        assert law.range == pytest.approx(0.5 / steepest, rel=1e-3)
        assert law.contact_gap == pytest.approx(0.5 * (1.0 - start), rel=1e-3)
    assert contact(tabulated(LennardJones(1.0, 1.0))).tabor == pytest.approx(steepest, rel=1e-3)


def test_the_core_of_a_sum() -> None:
    """2 e^(−x) and 1.2 e^(−4x) pull as much as they push at x = ln(2.4)/3."""
    law = cb.Exponential(2.0, 1.0) + cb.Exponential(-1.2, 0.25)
    place = math.log(2.4) / 3.0
    assert law.contact_gap == pytest.approx(place, rel=1e-12)
    assert law.net_adhesion == pytest.approx(2.0 * math.exp(-place) - 1.2 * math.exp(-4.0 * place), rel=1e-12)
    half = law.scaled(normal=2.0, energy=1.0)
    assert (half.contact_gap, half.net_adhesion) == (pytest.approx(place / 2.0), pytest.approx(law.net_adhesion))
    hump = cb.Gauss(1.0, 1.0) + cb.Gauss(-2.0, 0.3)  # has no pressure at the wall
    assert (hump.contact_gap, hump.lowest_gap > 0.5) == (0.0, True)
    for other in (cb.Gauss(1.0, 0.3), cb.Exponential(-1.0, 0.3), cb.MaugisDugdale(1.0, 0.3), cb.Layered(1.0, 0.5, 0.4)):
        assert (other.contact_gap, other.net_adhesion) == (0.0, pytest.approx(other.work_of_adhesion))


@pytest.mark.parametrize("law", [Morse(1.0, 0.5), tabulated(Morse(1.0, 0.5))])
def test_theories_are_judged_by_the_depth_of_the_minimum(law: cb.Interaction) -> None:
    """JKR's and DMT's pull-off loads are −3/2 and −2 times πRγ."""
    pull_off = cb.trace(contact(law), modes=0).thresholds["pull_off_load"]
    advice = cb.advise(contact(law), accuracy=0.01)
    errors = {one.model: one.errors.get("pull_off_load") for one in advice.candidates}
    for name, factor in (("jkr", 1.5), ("dmt", 2.0)):
        assert errors[name] == pytest.approx(abs(factor * math.pi / pull_off + 1.0), abs=2e-3)


def test_of_folds_with_one_name_the_outermost_counts_wherever_it_is_on_the_curve() -> None:
    def fold(name: str, place: float) -> cb.Event:
        return cb.Event("fold", -1.0, place, 0.5, 0.0, {}, control="displacement", name=name)

    inner = [fold("jump-in", 3.0), fold("pull-off", 2.0)]
    outer = [fold("jump-in", -1.0), fold("pull-off", -2.0)]
    for events in (inner + outer, outer + inner):
        found = threshold_events(events, repulsive=False)
        places = [found[f"{name}_displacement"][0].displacement for name in ("jump_in", "pull_off")]
        assert places == [-1.0, -2.0]
