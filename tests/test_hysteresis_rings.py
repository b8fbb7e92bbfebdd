"""Loops along curves whose contact set is no disc: rings at rest above the wall, and tips that touch it on a ring."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

import contbranch as cb
from contbranch.control import LOAD
from contbranch.curve.quasi_static import Stop, next_along
from contbranch.results.diagram import State

STEP = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)
"""The repulsive Maugis–Dugdale law: the gap rests at z0 = 1 on a disc, then on a ring, before the wall is touched."""

BLUNT = cb.Contact(cb.PowerLaw(6.0, 1.0), cb.Exponential(-1.0, 1.0) + cb.Gauss(-0.3, 0.3))
"""A tip so blunt that its repulsive film is thinnest on a ring; squeezed out there, it stays in the middle."""


@pytest.fixture(scope="module")
def step():
    return cb.hysteresis(STEP, max_load=9.0)


@pytest.fixture(scope="module")
def blunt():
    # Squeezed out on the ring at 9.13; the load beyond which the film in the middle is squeezed out, too, is 9.54.
    return cb.hysteresis(BLUNT, accuracy=1e-3, max_load=9.14)


def test_convex_energies_make_reversible_paths(step):
    assert (step.status, step.closed, step.jumps) == ("complete", True, ())
    assert step.dissipated == 0.0
    path = step.path
    up, down = path.direction == 1, path.direction == -1
    for key in ("load", "displacement", "contact_radius", "energy"):
        assert path[key][up] == pytest.approx(path[key][down][::-1], abs=1e-4)
    assert (np.diff(path.position[up]) > 0.0).all()
    assert path.contact_radius.max() > 0.0
    # dV/dd = F, by the trapezoidal rule, whose error is that of the spacing.
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


def test_all_equilibria_of_a_convex_energy_are_one():
    found = cb.find_all(STEP, load=4.0)
    assert found.status == "complete"
    (state,) = found.states
    assert state.displacement == pytest.approx((3 * 4.0 / 4) ** (2 / 3) - 1, abs=1e-6)  # Hertz on z0 = 1
    assert state.central_gap == pytest.approx(1.0, abs=1e-6)
    assert (state.unstable_load, state.unstable_displacement) == (0, 0)


def test_a_film_squeezed_out_on_a_ring_stays_in_the_middle(blunt):
    assert blunt.closed
    assert [jump.name for jump in blunt.jumps] == ["squeeze-out", "wetting"]
    squeezed, wetted = blunt.jumps
    assert squeezed.start.contact_radius == 0.0
    assert squeezed.to.contact_radius > 0.0
    assert squeezed.to.central_gap > 0.0
    assert wetted.start.central_gap > 0.0
    assert wetted.start.contact_radius > 0.0 == wetted.to.contact_radius
    for jump in blunt.jumps:
        assert jump.to.load == pytest.approx(jump.start.load, abs=1e-4)
        assert jump.dissipated > 0
    # dV/dd = F: the area is integrated along the unstable part, through the change of the contact set.
    assert squeezed.area == pytest.approx(squeezed.dissipated, abs=1e-4)
    in_the_ring = blunt.path.leg == 1
    assert (blunt.path.central_gap[in_the_ring] > 0.1).all()
    assert (blunt.path.contact_radius[in_the_ring] > 1.0).all()


class OneCoordinate:
    """Equilibria F = U′(s) of one coordinate s = d under load, with U′ a polynomial."""

    control = LOAD

    def __init__(self, force: Polynomial, s: np.ndarray):
        self.force, self.s = force, s
        self.values = force(s)
        self.unstable = (force.deriv()((s[1:] + s[:-1]) / 2) < 0).astype(np.int64)

    def at(self, s: float, piece: int, row: int | None = None) -> Stop:
        load, unstable = float(self.force(s)), int(self.unstable[piece])
        return Stop(piece, State(load, s, 0.0, 0.0, float(self.force.integ()(s)), unstable, unstable, 0.0), row=row)

    def crossing(self, piece: int, value: float) -> Stop:
        return self.at(brentq(lambda s: self.force(s) - value, self.s[piece], self.s[piece + 1]), piece)


@pytest.mark.parametrize(("roots", "certain"), [((1.5, 3.0, 4.2), True), ((2.2, 2.8, 4.0), False)])
@pytest.mark.parametrize("backwards", [False, True])
def test_the_next_state_is_certain_if_the_saddle_behind_it_is_higher(roots, certain, backwards):
    """U′ = (s − 1)² (s − a)(s − b)(s − c) has a fold of the load 0 at s = 1, stable states a and c and the saddle b."""
    a, b, c = roots
    force = Polynomial.fromroots([1.0, 1.0, a, b, c])
    energy = force.integ()
    heights = [float(energy(s) - energy(1.0)) for s in (a, b, c)]
    assert max(heights[0], heights[2]) < 0  # both can be reached
    assert (heights[1] > 0) == certain
    s = np.concatenate([np.linspace(0.0, 1.0, 7), np.linspace(1.0, 5.0, 50)[1:]])
    if backwards:  # the same curve, followed the other way
        s = s[::-1]
    walk = OneCoordinate(force, s)
    row = int(np.flatnonzero(s == 1.0)[0])
    fold = walk.at(1.0, row, row)
    stable = [
        walk.crossing(int(k), 0.0)
        for k in np.flatnonzero((walk.values[:-1] * walk.values[1:] < 0) & (walk.unstable == 0))
    ]
    assert len(stable) == 2
    found, sure = next_along(walk, fold, stable)
    assert found.state.displacement == pytest.approx(a)
    assert sure == certain
