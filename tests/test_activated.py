"""Barriers and jumps by thermal activation: against independent states, rate equations and ramps drawn at random."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbranch as cb
from contbranch.cli import main


@pytest.fixture(scope="module")
def contact():
    """A probe of 20 nm whose pull-off is some 200 kT deep at room temperature."""
    return cb.Contact.physical(
        modulus="10 GPa", radius="20 nm", interaction="exponential", work_of_adhesion="20 mN/m", range="0.3 nm"
    )


@pytest.fixture(scope="module")
def diagrams(contact):
    return {"load": cb.trace(contact), "spring": cb.trace(contact, cb.Spring("0.5 N/m"))}


@pytest.fixture(scope="module")
def pulled(diagrams):
    return cb.activated(diagrams["load"], "298 K", "100 nN/s", "1 MHz")[0]


def test_barriers_are_those_of_the_states(contact, pulled):
    for share in (0.2, 0.6, 0.9, 0.99):
        load = share * pulled.fold
        found = cb.find_all(contact, load=load)
        heights = [state.energy - load * state.displacement for state in found]
        assert pulled.barrier(load) == pytest.approx(heights[0] - heights[1], rel=5e-3)
        (barrier,) = found.barriers
        assert (barrier.name, barrier.stable, barrier.saddle) == ("detachment", (1, None), 0)
        assert barrier.heights[0] == pytest.approx(heights[0] - heights[1])
        assert found[1].barrier == barrier.heights[0]
        assert found[0].barrier is None
    assert math.isnan(pulled.barrier(0.1))


def test_without_load_the_barrier_is_the_energy_of_the_contact(contact, pulled, tmp_path):
    found = cb.find_all(contact, load=0.0)
    (barrier,) = [one for one in found.barriers if one.name == "detachment"]
    assert barrier.heights[0] == pytest.approx(-found[barrier.stable[0]].energy)
    assert barrier.heights[0] == pytest.approx(float(pulled.barriers[0]), rel=2e-3)
    found.save(tmp_path / "states.h5")
    assert cb.load(tmp_path / "states.h5").barriers == found.barriers
    assert "detachment" in str(found)


def test_a_barrier_next_to_a_fold_grows_with_the_power_three_halves(pulled):
    shares = np.array([1e-3, 1e-2])
    first, second = (pulled.barrier(pulled.fold * (1 - share)) for share in shares)
    assert math.log(second / first) / math.log(10) == pytest.approx(1.5, abs=0.03)


def test_survival_solves_the_rate_equation(diagrams):
    found = cb.activated(diagrams["spring"], "298 K", "100 nm/s", "1 MHz")
    assert [jump.name for jump in found] == ["jump-in", "pull-off"]
    for jump in found:
        sign = np.sign(jump.fold - jump.values[0])

        def leaving(path, left, jump=jump, sign=sign):
            barrier = max(jump.barrier(jump.values[0] + sign * path), 0.0)
            return -1e6 * math.exp(-barrier / found.thermal_energy) / 100.0 * left

        length = abs(jump.mean - jump.values[0])
        solved = solve_ivp(leaving, (0.0, length), [1.0], rtol=1e-8, atol=1e-10, max_step=length / 500)
        path = np.abs(jump.values - jump.values[0])
        assert np.interp(length, path, jump.survival) == pytest.approx(solved.y[0, -1], abs=2e-3)
        assert np.trapezoid(jump.distribution, path) == pytest.approx(1.0 - jump.survival[-1], abs=1e-4)


def test_ten_thousand_ramps(pulled):
    """Drawn by their own hazard in small steps of the load."""
    rng, kt = np.random.default_rng(3), 1.380649e-23 * 298 * 1e18
    loads = np.linspace(0.0, pulled.fold, 4001)
    barriers = np.array([pulled.barrier(load) for load in 0.5 * (loads[1:] + loads[:-1])])
    chance = 1e6 * np.exp(-np.maximum(barriers, 0.0) / kt) * abs(loads[1] - loads[0]) / 100.0
    passed = np.cumsum(chance)
    jumps = loads[np.minimum(np.searchsorted(passed, rng.exponential(size=10_000)) + 1, 4000)]
    assert pulled.mean == pytest.approx(jumps.mean(), abs=4 * jumps.std() / 100)
    assert pulled.std == pytest.approx(jumps.std(), rel=0.04)


def test_limits_of_cold_and_of_slow_ramps(diagrams):
    diagram = diagrams["spring"]
    cold = cb.activated(diagram, "0.01 K", "100 nm/s", "1 MHz")
    for jump in cold:
        assert jump.mean == pytest.approx(jump.fold, abs=0.01 * abs(jump.fold - jump.values[0]))
    slow = cb.activated(diagram, "298 K", 1e-30, "1 GHz", event="jump-in")
    back = cb.activated(diagram, "298 K", 1e-30, "1 GHz", event="pull-off")
    assert slow[0].mean == pytest.approx(slow[0].values[0], abs=1e-3)
    # Both ways exchange stability at one position, with one barrier.
    assert slow[0].values[0] == pytest.approx(back[0].values[0], abs=5e-3)
    assert slow[0].barriers[0] == pytest.approx(back[0].barriers[0], rel=5e-3)


def test_faster_ramps_jump_later(diagrams):
    means = [cb.activated(diagrams["load"], "298 K", rate, "1 MHz")[0].mean for rate in (1.0, 100.0, 1e4)]
    assert means[0] > means[1] > means[2] > diagrams["load"].thresholds["pull_off_load"]
    assert all(jump.error < 0.01 for jump in cb.activated(diagrams["load"], "298 K", 100.0, "1 MHz"))


def test_reduced_units(contact, diagrams, pulled):
    reduced = contact.to_reduced()
    scales = contact.scales
    kt = 1.380649e-23 * 298 * 1e18 / scales.energy
    found = cb.activated(cb.trace(reduced), kt, 100.0 / scales.load, 1e6)[0]
    assert found.mean * scales.load == pytest.approx(pulled.mean, rel=1e-4)


def test_documents_files_and_figures(diagrams, tmp_path):
    found = cb.activated(diagrams["spring"], "298 K", "100 nm/s", "1 MHz")
    found.save(tmp_path / "jumps.h5")
    again = cb.load(tmp_path / "jumps.h5")
    assert again == found
    assert again.document()["format"] == "contbranch-activated"
    found.to_csv(tmp_path / "jumps.csv")
    header = (tmp_path / "jumps.csv").read_text().splitlines()[0]
    assert header.startswith("jump,displacement [nm],energy [nN·nm],survival")
    found.plot().savefig(tmp_path / "jumps.png")
    assert "pull-off at -3." in repr(found)


def test_what_cannot_be_used(diagrams):
    for arguments, field in (
        (("298 nm", "100 nN/s", "1 MHz"), "temperature"),
        (("298 K", "100 nm/s", "1 MHz"), "rate"),
        (("298 K", "100 nN/s", "-1 Hz"), "attempt_frequency"),
        (("298 K", "100 nN/s", "1 MHz", "pul-off"), "pull-off"),
    ):
        with pytest.raises(cb.InputError, match=field):
            cb.activated(diagrams["load"], *arguments)
    assert len(cb.activated(replace(diagrams["load"], events=()), "298 K", "1 nN/s", "1 MHz")) == 0


def test_a_jump_without_a_barrier_is_named(diagrams):
    whole = diagrams["load"]
    (event,) = whole.folds("load")
    bare = replace(whole, contact=None, events=(replace(event, position=float(len(whole.branches[0]) - 1)),))
    found = cb.activated(bare, "298 K", "1 nN/s", "1 MHz")
    assert (len(found), found.status) == (0, "incomplete")
    assert "pull-off" in found.message


def test_on_the_command_line(diagrams, tmp_path, capsys):
    diagrams["load"].save(tmp_path / "trace.h5")
    options = ["--temperature", "298 K", "--rate", "100 nN/s", "--attempt-frequency", "1 MHz"]
    assert main(["activated", str(tmp_path / "trace.h5"), *options, "--plot", str(tmp_path / "a.png")]) == 0
    assert "pull-off" in capsys.readouterr().out
    assert (tmp_path / "a.png").exists()
    assert main(["activated", str(tmp_path / "trace.h5"), "--rate", "100 nN/s"]) == 2
    assert "--temperature" in capsys.readouterr().err
