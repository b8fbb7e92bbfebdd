"""Damped dynamics on small problems whose answers come from dense linear algebra."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import nnls

from studies.dynamics import Ending, Motion, MotionSettings, curvature
from studies.elsewhere import Fire

METHODS = [Motion, Fire]


class Place(NamedTuple):
    u: np.ndarray
    held: np.ndarray
    force: np.ndarray


@dataclass
class Obstacle:
    """Minimise ½ u·Hu - b·u with u ≥ 0; masses M."""

    stiffness: np.ndarray
    load: np.ndarray
    masses: np.ndarray
    stiffest: float = 1.0
    end: int | None = None
    moves: int = 0

    def place(self, u):
        u = np.maximum(u, 0.0)
        force = self.load - self.stiffness @ u
        held = (u <= 0.0) & (force < 0.0)
        return Place(u, held, np.where(held, 0.0, force))

    def force(self, place):
        return place.force

    def residual(self, place):
        return float(np.linalg.norm(place.force) / np.linalg.norm(self.load))

    def confine(self, place, momentum):
        return np.where(place.held, 0.0, momentum)

    def mobility(self, place, momentum):
        return np.where(place.held, 0.0, np.linalg.solve(self.masses, momentum))

    def move(self, place, momentum, velocity, time):
        self.moves += 1
        return self.place(place.u + time * velocity)

    def change(self, before, after):
        return after.u - before.u

    def slowing(self, place, change):
        return 1.0

    def ending(self, place, velocity):
        return Ending.INTERRUPTED if self.moves >= (self.end or math.inf) else None


def a_spring_chain(n=60, seed=0):
    """Springs between neighbours and to the ground, softer by a thousand; masses like the springs', within 2."""
    rng = np.random.default_rng(seed)
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness = chain + np.diag(0.001 * (1.0 + rng.random(n)))
    return stiffness, rng.standard_normal(n) - 0.2, chain + 0.002 * np.eye(n)


@pytest.mark.parametrize("method", METHODS)
def test_obstacle_problem(method):
    """Compared with the active-set solution of the equivalent non-negative least squares, min |Lᵀu - L⁻¹b|²."""
    stiffness, load, masses = a_spring_chain()
    factor = np.linalg.cholesky(stiffness)
    exact, _ = nnls(factor.T, np.linalg.solve(factor, load))
    assert 5 < np.count_nonzero(exact) < 55  # some are held, some are free
    system = Obstacle(stiffness, load, masses)
    end = method(system, system.place(np.ones(60)), MotionSettings(1e-10, 3000)).run()
    assert end.ending is Ending.CONVERGED
    np.testing.assert_allclose(end.place.u, exact, atol=1e-7 * exact.max())


@pytest.mark.parametrize("method", METHODS)
def test_an_underestimate_of_the_stiffest_mode_is_corrected(method):
    # A time step four times that of marginal stability without the correction.
    stiffness, load, masses = a_spring_chain()
    system = Obstacle(stiffness, load + 5.0, masses, stiffest=1.0 / 16.0)
    end = method(system, system.place(np.ones(60)), MotionSettings(1e-8, 3000)).run()
    assert end.ending is Ending.CONVERGED


@pytest.mark.parametrize("method", METHODS)
def test_endings(method):
    stiffness, load, masses = a_spring_chain()
    system = Obstacle(stiffness, load, masses)
    start = system.place(np.ones(60))
    few = method(system, start, MotionSettings(1e-10, 7)).run()
    assert (few.ending, few.steps) == (Ending.STEPS, 7)
    nothing = method(system, system.place(np.full(60, math.nan)), MotionSettings(1e-10, 7)).run()
    assert (nothing.ending, nothing.steps) == (Ending.DIVERGED, 0)
    stopped = method(Obstacle(stiffness, load, masses, end=4), start).run()
    assert stopped.ending is Ending.INTERRUPTED


def test_rayleigh_quotient_of_a_mode():
    stiffness, _, masses = a_spring_chain()
    values, vectors = eigh(stiffness, masses)
    velocity = vectors[:, 3]
    before, time = np.full(60, 7.0), 0.1  # forces anywhere but zero
    after = before - time * (stiffness @ velocity)
    assert curvature(before, after, time * velocity, masses @ velocity, velocity, time) == pytest.approx(
        values[3], rel=1e-10
    )
