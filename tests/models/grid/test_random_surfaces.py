"""Curves of rough surfaces: contacts of many asperities, whose nodes touch one by one."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb


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
