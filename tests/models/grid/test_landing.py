"""Landing after folds and settling from bad starts, against the axisymmetric model, which shares no code with it."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb
from contbranch.models.grid.landing import ESCAPED, STEPS, land, stable
from contbranch.models.grid.lattice import Lattice
from contbranch.models.grid.newton import Hold, Settings, hold_control, newton
from contbranch.models.grid.problem import GridProblem


def parabola(kind, edge, grid, law, quarter=True):
    lattice = Lattice(kind, (edge, edge), (grid, grid), quarter)
    x = lattice.axes[0][: lattice.inside[0]]
    return GridProblem(lattice, lattice.fill(0.5 * (x[:, None] ** 2 + x[None, :] ** 2)), law)


def radius(problem, state):
    return np.sqrt(state.contact.sum() * problem.lattice.node_area / np.pi)


@pytest.fixture(scope="module")
def repulsion():
    """μ_T = 1: folds at 8.006511 (wetting) and 8.377051 (squeeze-out) in the axisymmetric model."""
    problem = parabola("free", 8.0, 64, cb.Gauss(-1.0, 1.0))
    film = land(problem, np.zeros(problem.shape), Hold(7.0))
    return problem, film


@pytest.fixture(scope="module")
def attraction():
    """μ_T = 1: jump-in at d = -1.696494, pull-off at -1.732627 in the axisymmetric model."""
    return parabola("free", 8.0, 96, cb.Exponential(1.0, 1.0))


def test_landing_in_contact_after_squeeze_out_and_in_the_film_after_wetting(repulsion):
    """Where there is one state in the axisymmetric model; the film to 1e-5, contact to a node's area."""
    problem, film = repulsion
    contact = cb.Contact.reduced("gauss", 1.0, -1)
    before = land(problem, film.u, Hold(8.36))
    assert before.converged
    assert not before.contact.any()
    after = land(problem, before.u, Hold(8.397))
    (exact,) = cb.find_all(contact, load=8.397).states
    assert after.converged
    assert after.displacement == pytest.approx(exact.displacement, abs=2e-3)
    assert radius(problem, after) == pytest.approx(exact.contact_radius, abs=0.04)

    before = land(problem, after.u, Hold(8.03))
    assert before.contact.any()
    after = land(problem, before.u, Hold(7.986))
    (exact,) = cb.find_all(contact, load=7.986).states
    assert after.converged
    assert not after.contact.any()
    assert after.displacement == pytest.approx(exact.displacement, abs=2e-5)


def test_landing_after_jump_in_and_pull_off(attraction):
    problem = attraction
    contact = cb.Contact.reduced("exponential", 1.0, 1)

    def at(d):
        return hold_control(problem, 0.0, 1.0, d)

    apart = land(problem, np.full(problem.shape, 3.0), at(-2.0))
    apart = land(problem, apart.u, at(-1.705))
    assert not apart.contact.any()
    (exact,) = cb.find_all(contact, displacement=-1.68).states
    touching = land(problem, apart.u, at(-1.68))
    assert touching.contact.any()
    assert touching.load == pytest.approx(exact.load, rel=0.01)
    touching = land(problem, touching.u, at(-1.72))
    assert touching.contact.any()
    (exact,) = cb.find_all(contact, displacement=-1.75).states
    apart = land(problem, touching.u, at(-1.75))
    assert not apart.contact.any()
    assert apart.load == pytest.approx(exact.load, rel=1e-3)


def test_coexisting_states_are_kept():
    """μ_T = 4, F = 60: film and contact are both stable in the axisymmetric model; a start near one gives that one."""
    problem = parabola("free", 11.0, 96, cb.Gauss(-1.0, 0.25))
    hold = Hold(60.0)
    film = land(problem, np.zeros(problem.shape), Hold(40.0))
    film = land(problem, film.u, hold)
    contact = land(problem, -np.minimum(problem.heights, 8.0), hold)
    exact = cb.find_all(cb.Contact.reduced("gauss", 4.0, -1), load=60.0).stable
    assert film.displacement == pytest.approx(min(s.displacement for s in exact), abs=0.02)
    assert contact.displacement == pytest.approx(max(s.displacement for s in exact), abs=0.05)
    noise = np.random.default_rng(5).standard_normal(problem.shape)
    noise = problem.transform.filter(problem.smoother(1.0), noise)
    noise *= 0.05 / np.abs(noise).max()
    for state in (film, contact):
        again = land(problem, state.u + noise, hold)
        assert again.converged
        assert again.contact.any() == state.contact.any()
        assert again.displacement == pytest.approx(state.displacement, abs=2e-3)


def test_a_single_state_is_found_from_any_start():
    """Exponential repulsion: the energy is convex, so there is one equilibrium for each load."""
    problem = parabola("periodic", 6.0, 24, cb.Exponential(-1.0, 0.25))
    rng = np.random.default_rng(4)
    starts = [np.full(problem.shape, value) for value in (0.0, -20.0, 100.0)]
    starts += [rng.standard_normal(problem.shape), 5.0 + 10.0 * rng.standard_normal(problem.shape)]
    ends = [land(problem, u, Hold(15.0)) for u in starts]
    assert all(end.converged for end in ends)
    assert np.ptp([end.displacement for end in ends]) < 1e-7
    assert max(end.steps for end in ends) < 60


def test_an_unstable_state_is_left(repulsion):
    """The film between its load fold and its displacement fold is stable under displacement control only."""
    problem, film = repulsion
    state = land(problem, film.u, hold_control(problem, 0.0, 1.0, 1.88))
    state = land(problem, state.u, hold_control(problem, 0.0, 1.0, 1.892))
    assert not state.contact.any()
    hold = Hold(state.load)
    there = newton(problem, state.u, state.load, hold, state.contact, Settings(1e-11))
    assert there.converged
    assert there.displacement == pytest.approx(1.892, abs=1e-6)
    assert not stable(problem, there, hold)
    end = land(problem, there.u, hold)
    assert end.converged
    assert abs(end.displacement - 1.892) > 0.01
    assert stable(problem, end, hold)


def test_stability_changes_where_the_load_is_largest(repulsion):
    """n(load control) = n(displacement control) + [dF/dd < 0]; the states have two displacements half a step apart."""
    problem, state = repulsion
    displacements = np.array([1.88, 1.884, 1.888, 1.892])
    loads, signs = [], []
    for d in displacements:
        hold = hold_control(problem, 0.0, 1.0, d)
        state = land(problem, state.u, hold)
        assert stable(problem, state, hold)
        slope = (land(problem, state.u, hold_control(problem, 0.0, 1.0, d + 1e-4)).load - state.load) / 1e-4
        loads.append(slope)
        signs.append(stable(problem, state, Hold(state.load)))
    assert min(loads) < 0.0 < max(loads)
    np.testing.assert_array_equal(signs, np.array(loads) > 0.0)


def test_pairs_of_stability_are_counted_apart(repulsion):
    problem, film = repulsion
    equilibrium, stability = problem.counter.equilibrium, problem.counter.stability
    assert stable(problem, film, Hold(7.0))
    assert problem.counter.stability > stability
    assert problem.counter.equilibrium == equilibrium


def test_reduced_and_whole_lattices_agree():
    states = []
    for quarter in (True, False):
        problem = parabola("free", 8.0, 32, cb.Gauss(-1.0, 1.0), quarter)
        state = land(problem, np.zeros(problem.shape), Hold(9.0), tolerance=1e-12)
        assert state.converged
        states.append(problem.lattice.unfold(state.u))
    np.testing.assert_allclose(states[0], states[1], atol=1e-10)


def test_detachment_and_too_few_steps_are_reported(attraction):
    gone = land(attraction, np.full(attraction.shape, 0.5), Hold(-7.0))
    assert (gone.converged, gone.reason) == (False, ESCAPED)
    few = land(attraction, np.full(attraction.shape, 20.0), Hold(1.0), steps=4)
    assert (few.converged, few.reason, few.steps) == (False, STEPS, 4)


def test_everything_in_contact():
    """A flat at rest on the wall: no node is free, nothing can be unstable."""
    lattice = Lattice("periodic", (4.0, 4.0), (16, 16))
    problem = GridProblem(lattice, np.zeros(lattice.shape), cb.Exponential(1.0, 0.5))
    state = land(problem, np.full(problem.shape, 0.5), Hold(1.0))
    assert state.converged
    assert state.contact.all()
    assert state.displacement == pytest.approx(lattice.compliance, rel=1e-12)  # d = C F
