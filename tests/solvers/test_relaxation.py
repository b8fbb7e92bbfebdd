"""Damped dynamics on lattices: the energy they minimise, and that they end where Newton's method does."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb
from contbranch.errors import InputError
from contbranch.models.grid.lattice import Lattice
from contbranch.models.grid.newton import Hold, Settings, hold_control, newton
from contbranch.models.grid.problem import GridProblem
from studies.dynamics import Ending, LatticeMotion, Motion, MotionSettings
from studies.elsewhere import Fire, relax

METHODS = [Motion, Fire]


def parabola(kind, edge, grid, law, quarter=True):
    lattice = Lattice(kind, (edge, edge), (grid, grid), quarter)
    x = lattice.axes[0][: lattice.inside[0]]
    return GridProblem(lattice, lattice.fill(0.5 * (x[:, None] ** 2 + x[None, :] ** 2)), law)


CONTROLS = {
    "load": lambda problem: Hold(2.0),
    "displacement": lambda problem: hold_control(problem, 0.0, 1.0, 1.5),
    "spring": lambda problem: hold_control(problem, 1.0, 0.7, 4.0),
}
LAWS = [cb.Exponential(1.0, 0.5), cb.Gauss(-1.0, 0.5), None]


@pytest.mark.parametrize("kind", ["periodic", "free"])
@pytest.mark.parametrize("control", CONTROLS)
def test_the_force_is_the_slope_of_the_energy(kind, control):
    """Central differences of the energy and of the force; no node at the wall."""
    problem = parabola(kind, 6.0, 12, cb.Gauss(-1.0, 1.0))
    motion = LatticeMotion(problem, CONTROLS[control](problem))
    rng = np.random.default_rng(2)
    u, v = 0.5 + 0.3 * rng.random(problem.shape), rng.standard_normal(problem.shape)
    place, h = motion.place(u), 1e-4
    ahead, behind = motion.place(u + h * v), motion.place(u - h * v)
    slope = (motion.energy(ahead) - motion.energy(behind)) / (2.0 * h)
    assert slope == pytest.approx(-problem.lattice.node_area * np.vdot(place.force, v), rel=1e-6)
    np.testing.assert_allclose((behind.force - ahead.force) / (2.0 * h), motion.variation(place, v), atol=1e-6)


@pytest.mark.parametrize("control", CONTROLS)
def test_the_energy_is_the_problems_with_the_work_of_what_is_held(control):
    """Differences of V - F d at a constant load, of V at a constant d, of V + K (D - d)²/2 with a spring."""
    problem = parabola("free", 6.0, 12, cb.Gauss(-1.0, 1.0))
    motion = LatticeMotion(problem, CONTROLS[control](problem))
    rng = np.random.default_rng(3)
    found, expected = [], []
    for _ in range(2):
        place = motion.place(0.5 + 0.3 * rng.random(problem.shape))
        f = place.fields
        d = problem.displacement(f.u, f.load)
        found.append(motion.energy(place))
        spring = 0.5 * 0.7 * (4.0 / 0.7 - d) ** 2
        work = {"load": -f.load * d, "displacement": 0.0, "spring": spring}[control]
        expected.append(problem.total_energy(f) + work)
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], rel=1e-10)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_dynamics_end_in_the_state_of_newtons_method(law, control, method):
    problem = parabola("free", 6.0, 48, law)
    hold = CONTROLS[control](problem)
    end = relax(problem, np.zeros(problem.shape), 0.0, hold, method, MotionSettings(1e-10, 2000))
    assert end.converged
    assert end.residual <= 1e-10
    assert end.steps < 600
    exact = newton(problem, end.u + 1e-3, end.load, hold, end.contact, Settings(1e-11))
    assert exact.converged
    np.testing.assert_array_equal(end.contact, exact.contact)
    np.testing.assert_allclose(end.u, exact.u, atol=3e-8)
    assert end.displacement == pytest.approx(exact.displacement, abs=3e-8)
    assert end.load == pytest.approx(exact.load, abs=3e-8)
    assert end.fields.gap.min() >= 0.0


@pytest.mark.parametrize("method", METHODS)
def test_the_residual_is_that_of_the_state(method):
    """Elastic pressures followed without transforms, as is done without contact, have not drifted."""
    problem = parabola("free", 8.0, 32, cb.Gauss(-1.0, 1.0))
    end = relax(problem, np.zeros(problem.shape), 7.0, Hold(7.0), method, MotionSettings(1e-11, 1000))
    assert not end.contact.any()
    assert end.pairs < 1.3 * end.steps + 5
    again = newton(problem, end.u, 7.0, Hold(7.0), settings=Settings(1e-10, steps=0))
    assert again.residual <= 1.1e-11


def test_mass_weighting_removes_critical_slowing_down():
    """Modes of all wavelengths are equally fast: sixteen times the nodes take less than 1.3 times the steps."""
    steps = []
    for grid in (64, 256):
        problem = parabola("periodic", 8.0, grid, cb.Exponential(1.0, 1.0))
        end = relax(problem, np.zeros(problem.shape), 1.5, Hold(1.5))
        assert end.converged
        steps.append(end.steps)
    assert steps[1] < 1.3 * steps[0]
    assert steps[1] < 100


@pytest.mark.parametrize("method", METHODS)
def test_a_load_that_nothing_can_hold(method):
    """Pull-off of a short-ranged attraction needs less than 2πR|Δγ| = 6.28 (DMT); there is no state at -6.5."""
    problem = parabola("free", 6.0, 32, cb.Exponential(1.0, 0.5))
    end = relax(problem, -np.minimum(problem.heights, 0.5), 0.0, Hold(-6.5), method)
    assert not end.converged
    assert end.reason == Ending.ESCAPED
    assert end.fields.gap.min() > 0.5


def test_a_repulsive_contact_has_no_state_without_load():
    problem = parabola("periodic", 6.0, 16, cb.Gauss(-1.0, 0.5))
    end = relax(problem, np.zeros(problem.shape), 0.0, Hold(0.0))
    assert (end.converged, end.reason) == (False, Ending.ESCAPED)


def test_too_few_steps_are_no_convergence():
    problem = parabola("periodic", 6.0, 16, cb.Gauss(-1.0, 0.5))
    end = relax(problem, np.zeros(problem.shape), 2.0, Hold(2.0), settings=MotionSettings(1e-10, 3))
    assert (end.converged, end.reason, end.steps) == (False, Ending.STEPS, 3)


def test_only_loads_displacements_and_springs_can_be_held():
    problem = parabola("periodic", 6.0, 16, None)
    u = np.zeros(problem.shape)
    for hold in (Hold(1.0, 1.0, np.ones(problem.shape)), Hold(1.0, -1.0), Hold(1.0, 1.0, 0.5)):
        with pytest.raises(InputError, match="load, a displacement or a spring"):
            relax(problem, u, 0.0, hold)
