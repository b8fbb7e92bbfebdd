"""Single states of rough maps: they are found where the curve, or the contact without interaction, has them."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb


@pytest.mark.parametrize("load", [5e3, 6e4])
def test_a_spike_alone_bears_the_load(load: float) -> None:
    """All else is thirty ranges of the attraction away, so that the hard wall has the same state."""
    heights = np.array(cb.HeightMap.self_affine(64, 1e4, 0.8, rms_height=10.0, seed=1).heights)
    heights[20, 39] -= 1000.0
    tip = cb.HeightMap(heights, cell=1e4)
    contact = cb.Contact(tip, cb.Exponential(work_of_adhesion=0.02, range=10.0))
    with pytest.warns(cb.GridWarning, match=r"^The height map has 1 spike towards the wall, at \[20, 39\], like"):
        found = cb.solve(contact, load=load)
    with pytest.warns(cb.GridWarning, match=r"1 spike"):
        hard = cb.solve(cb.Contact(tip), load=load)
    assert found.mean_gap == pytest.approx(hard.mean_gap, rel=1e-9)


@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize(("load", "enthalpy"), [(-0.0969, -1.6306), (-1.615, -0.2988), (-1.8999, -0.0961)])
def test_states_under_tension_are_those_of_the_curve(load: float, enthalpy: float) -> None:
    """The pull-off load is -1.9387; V − F d of the lowest states on the curve."""
    tip = cb.HeightMap.self_affine(64, 12.0, 0.8, rms_height=0.5, seed=1, short_cutoff=3.0, radius=1.0)
    found = cb.solve(cb.Contact(tip, cb.Exponential(work_of_adhesion=0.05, range=0.2)), load=load)
    assert found.unstable_load == 0
    assert found.energy - load * found.displacement == pytest.approx(enthalpy, abs=1e-3)
