"""Curves of rough surfaces: contacts of many asperities, whose nodes touch one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import contbranch as cb
from contbranch.models.grid.equilibria import LatticeProblem


def test_a_fold_in_the_corner_where_the_first_node_touches() -> None:
    """The load falls until a node touches and rises behind it: its minimum is first touch itself."""
    surface = cb.HeightMap.self_affine(64, 10.0, 0.4932, rms_slope=0.3044, seed=631)
    law = cb.VanDerWaals(0.02, 0.5695) + cb.Exponential(-0.01, 1.1389)
    contact = cb.Contact(surface, interaction=law, modulus=1.0)
    found = cb.trace(contact, modes=0)
    assert found.status == "complete"
    (touch,) = (event for event in found.events if event.kind == "touch")
    (fold,) = (event for event in found.events if event.name == "pull-off")
    assert (fold.load, fold.displacement) == (touch.load, touch.displacement)
    branch = found.branches[0]
    row = int(np.argmin(np.abs(branch.displacement - touch.displacement)))
    assert branch.load[row] == branch.load.min()
    for neighbour in (row - 1, row + 1):
        displacement = float(0.9 * touch.displacement + 0.1 * branch.displacement[neighbour])
        beside = cb.solve(contact, displacement=displacement, model=cb.Periodic())
        assert beside.load > touch.load


@pytest.mark.parametrize(
    ("hurst", "slope", "seed", "law"),
    [
        (0.4957, 0.3197, 193, cb.Gauss(-0.02, 1.3036)),
        (0.43096, 0.502374, 178, cb.Gauss(-0.02, 0.545824)),
        (0.508, 0.377, 529, cb.Gauss(-0.02, 0.77) + cb.Exponential(0.01, 1.54)),
    ],
)
def test_curves_of_rough_surfaces_are_complete(hurst: float, slope: float, seed: int, law: cb.Interaction) -> None:
    """Behind first touch the curve turns within a few nodes: no step may leap back to where it came from."""
    surface = cb.HeightMap.self_affine(64, 10.0, hurst, rms_slope=slope, seed=seed)
    found = cb.trace(cb.Contact(surface, interaction=law, modulus=1.0), modes=0)
    branch = found.branches[0]
    assert found.status == "complete"
    assert (branch.unstable_displacement >= 0).all()
    assert (np.diff(branch.contact_radius[branch.load.argmin() :]) > -0.1).all()


def noisy(grid: int, seed: int) -> cb.Contact:
    """White noise: the summits are single nodes."""
    heights = 0.1 * np.random.default_rng(seed).standard_normal((grid, grid))
    return cb.Contact(cb.HeightMap(heights, cell=10.0), cb.Exponential(work_of_adhesion=2e-4, range=0.035))


@pytest.mark.parametrize(("grid", "seed"), [(16, 4), (16, 9), (24, 1), (32, 2)])
def test_behind_first_touch_of_a_single_node_it_is_pressed(grid: int, seed: int) -> None:
    """The load turns round there, the displacement does not; states solved for by themselves lie on the curve."""
    contact = noisy(grid, seed)
    found = cb.trace(contact, control="displacement", max_load=0.05)
    branch = found.branches[0]
    (touch,) = (event for event in found.events if event.kind == "touch")
    assert found.status == "complete"
    assert branch.load[-1] == pytest.approx(0.05)
    assert (np.diff(branch.displacement[int(touch.position) :]) > 0.0).all()
    for row in np.flatnonzero(branch.contact_radius > 0.0)[::3]:
        alone = cb.solve(contact, displacement=float(branch.displacement[row]))
        assert alone.load == pytest.approx(branch.load[row], abs=1e-6)


def test_corners_are_followed_on_from_the_node_that_changes() -> None:
    """Behind a corner the curve leaves at an acute angle to where it came from, which steps do not find."""
    heights = 0.031 * np.random.default_rng(983).standard_normal((32, 32))
    found = cb.trace(cb.Contact(cb.HeightMap(heights, cell=10.0), cb.VanDerWaals(-0.0089, 0.926)), modes=0)
    assert found.status == "complete"
    assert (found.branches[0].unstable_displacement >= 0).all()


def test_a_curve_that_turns_back_on_itself_ends_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the steps behind first touch began the wrong way."""
    succeeds = LatticeProblem.successor

    def backwards(self, name, points):
        found = succeeds(self, name, points)
        (start,) = found.starts
        return replace(found, starts=(replace(points[-1].turned(), problem=start.problem),))

    monkeypatch.setattr(LatticeProblem, "successor", backwards)
    found = cb.trace(noisy(16, 4), control="displacement", max_load=0.05)
    branch = found.branches[0]
    (touch,) = (event for event in found.events if event.kind == "touch")
    assert found.status == "incomplete"
    assert f"displacement {touch.displacement:.6g}" in found.message
    assert touch.position == len(branch) - 1
    assert (np.diff(branch.displacement) > 0.0).all()


def test_nodes_of_a_wave_join_the_contact_line_by_line() -> None:
    """Behind each corner 32 nodes are pressed at once, and no state knows where along the line it is."""
    heights = np.repeat(0.2 * np.cos(2 * np.pi * np.arange(32) / 32)[:, None], 32, axis=1)
    contact = cb.Contact(cb.HeightMap(heights, cell=8.0), cb.Exponential(work_of_adhesion=0.005, range=0.15))
    found = cb.trace(contact, control="displacement", max_load=3.0)
    branch = found.branches[0]
    assert found.status == "complete"
    assert branch.load[-1] == pytest.approx(3.0)
    for row in np.flatnonzero(branch.contact_radius > 0.0)[::6]:
        gap = branch.state(int(row)).cell.gap
        assert np.ptp(gap, axis=1).max() < 1e-6
        assert (gap == 0.0).any()
