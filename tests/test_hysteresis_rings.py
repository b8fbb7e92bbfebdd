"""Loops along curves whose contact set is no disc: rings at rest above the wall, and tips that touch it on a ring."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
from scipy.optimize import brentq

import contbranch as cb
from contbranch.analysis.hysteresis import Stop, next_along, quasi_static
from contbranch.control import LOAD
from contbranch.diagram import State

STEP = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)
"""The repulsive Maugis–Dugdale law: the gap rests at z0 = 1 on a disc, then on a ring, before the wall is touched."""

BLUNT = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.Exponential(-1.0, 1.0))
"""A tip so blunt that its repulsive film is thinnest on a ring, where the wall is touched first; v'' > 0."""


@pytest.fixture(scope="module")
def step():
    return cb.hysteresis(STEP, max_load=20.0)


@pytest.fixture(scope="module")
def blunt():
    return cb.hysteresis(BLUNT, accuracy=1e-5)


@pytest.mark.parametrize("name", ["step", "blunt"])
def test_convex_energies_make_reversible_paths(name, request):
    loop = request.getfixturevalue(name)
    assert (loop.status, loop.closed, loop.jumps) == ("complete", True, ())
    assert loop.dissipated == 0.0
    path = loop.path
    up, down = path.direction == 1, path.direction == -1
    for key in ("load", "displacement", "contact_radius", "energy"):
        assert path[key][up] == pytest.approx(path[key][down][::-1], abs=1e-4)
    assert (np.diff(path.position[up]) > -1e-7).all()
    # The load is the energy's slope: with Simpson's rule out of reach, the trapezoid's error is that of the spacing.
    work = np.sum((path.load[up][1:] + path.load[up][:-1]) / 2 * np.diff(path.displacement[up]))
    assert work == pytest.approx(path.energy[up][-1] - path.energy[up][0], rel=1e-3)


def test_the_path_at_rest_above_the_wall_is_that_of_hertz(step):
    """Until the pressure at the centre reaches σ, at c = π/2, the disc at rest on z0 = 1 is that of Hertz' contact."""
    up = step.path.direction == 1
    resting = up & (step.path.load < 4 / 3 * (np.pi / 2) ** 3 * 0.999)
    assert resting.sum() > 10
    d = step.path.displacement[resting] + 1.0
    assert step.path.load[resting] == pytest.approx(4 / 3 * d**1.5, abs=1e-6)
    assert step.path.energy[resting] == pytest.approx(8 / 15 * d**2.5, abs=1e-6)
