"""The study `rough_cycle.py` on few nodes: a curve with hairpins, checked by spectra, by energies and by dynamics."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import rough_cycle  # noqa: E402


@pytest.fixture(scope="module")
def cycle() -> rough_cycle.Cycle:
    return rough_cycle.measure(rough_cycle.contact(48, 4.5, 7), max_load=0.1)


def test_cycle_closes_and_dissipates(cycle: rough_cycle.Cycle) -> None:
    assert cycle.closes()
    assert len(cycle.jumps) >= 4
    assert all(jump.begin.state.energy > jump.end.state.energy for jump in cycle.jumps)
    # the work done around the loop, from loads and displacements alone: ∫ F dd along the legs, none in the jumps
    work = 0.0
    for leg in cycle.legs:
        first, last = leg.begin, leg.end
        d = np.linspace(first.state.displacement, last.state.displacement, 2)
        assert leg.direction * (d[1] - d[0]) >= 0.0
        work += cycle.walk.work(first, last)
    assert work * cycle.contact.scales.energy == pytest.approx(cycle.dissipated, rel=2e-3)


def test_energy_is_the_integral_of_the_load(cycle: rough_cycle.Cycle) -> None:
    # splines through 119 rows leave 6e-4
    assert rough_cycle.energy_mismatch(cycle) < 1e-3


def test_spectra_confirm_morse_indices(cycle: rough_cycle.Cycle) -> None:
    found = rough_cycle.indices(cycle, 5)
    assert {index for _, index, _ in found} >= {0, 1}
    assert all(good for *_, good in found)


def test_dynamics_visit_stable_parts_alone() -> None:
    small = rough_cycle.measure(rough_cycle.contact(32, 3.5, 3))
    states = list(rough_cycle.by_dynamics(small, 12))
    assert all(apart < rough_cycle.AGREE for *_, apart in states)
    # both branches of a bistable range are visited: on approach and on retraction
    up, down = ([state.load for way, _, state, _ in states if way == sign] for sign in (1, -1))
    assert np.abs(np.array(up) - np.array(down[::-1])).max() > 0.1


def test_figure(cycle: rough_cycle.Cycle, tmp_path: Path) -> None:
    figure = rough_cycle.draw(cycle, tmp_path / "rough.png")
    assert (tmp_path / "rough.png").stat().st_size > 10_000
    assert len(figure.subfigs) == 2
