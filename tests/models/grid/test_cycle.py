"""Quasi-static loops by relaxation alone, against those along the curve; cycles that are interrupted and go on."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import contbranch as cb

TIP = cb.HeightMap.self_affine(32, 3.5, 0.8, rms_height=0.5, seed=3, short_cutoff=3.0, radius=1.0)
ROUGH = cb.Contact(TIP, cb.Gauss(work_of_adhesion=0.05, range=0.08))
HOW = {"control": "displacement", "max_load": 0.1, "method": "relaxation"}


@pytest.fixture(scope="module")
def relaxed() -> cb.Hysteresis:
    return cb.hysteresis(ROUGH, steps=30, **HOW)


def test_jumps_and_energies_are_those_of_the_curve(relaxed: cb.Hysteresis) -> None:
    curve = cb.hysteresis(ROUGH, "displacement", max_load=0.1)
    assert relaxed.status == curve.status == "complete"
    assert relaxed.closed
    large = [jump for jump in curve.jumps if jump.dissipated > 0.01 * curve.dissipated]
    assert large
    step = np.abs(np.diff(relaxed.path.position)).max()
    for jump in large:
        near = min(relaxed.jumps, key=lambda one: abs(one.position - jump.position))
        assert abs(near.position - jump.position) <= step
        assert abs(near.dissipated - jump.dissipated) <= near.error + 0.02 * jump.dissipated
    assert abs(relaxed.dissipated - curve.dissipated) <= relaxed.error


def test_the_path_is_a_loop_in_steps(relaxed: cb.Hysteresis) -> None:
    path = relaxed.path
    assert len(path) == 61
    np.testing.assert_allclose(path.position, path.position[::-1], atol=1e-12)
    assert path.direction.tolist() == [1] * 31 + [-1] * 30
    # The work of the drive around the loop, by the trapezoidal rule as every jump has it.
    work = np.sum(np.diff(path.displacement) * (path.load[1:] + path.load[:-1]) / 2.0)
    assert work == pytest.approx(relaxed.dissipated, abs=relaxed.error)
    jump = max(relaxed.jumps, key=lambda one: one.dissipated)
    assert jump.to.cell.gap.shape == (32, 32)
    assert jump.to.mean_gap == pytest.approx(jump.to.cell.gap.mean(), abs=1e-12)


def test_an_interrupted_cycle_goes_on_from_its_file(relaxed: cb.Hysteresis, tmp_path: Path) -> None:
    file = tmp_path / "cycle.h5"
    told: list[float] = []

    def progress(fraction: float, text: str) -> None:
        told.append(fraction)
        if len(told) > 12:
            raise cb.Stop

    part = cb.hysteresis(ROUGH, steps=30, file=file, progress=progress, **HOW)
    assert part.status == "incomplete"
    assert "stopped by its progress callback" in part.message
    assert 2 < len(part.path) < 61
    assert part.dissipated is None
    whole = cb.hysteresis(ROUGH, steps=30, file=file, **HOW)
    assert whole.status == "complete"
    np.testing.assert_allclose(whole.path.load, relaxed.path.load, atol=1e-7)
    assert whole.dissipated == pytest.approx(relaxed.dissipated, rel=1e-6)
    with h5py.File(file) as kept:
        assert kept["gap"].shape == (61, 32, 32)
        column = list(kept["rows"].attrs["columns"]).index("mean_gap")
        np.testing.assert_allclose(kept["gap"][()].mean((1, 2)), kept["rows"][:, column], rtol=1e-5)
    with pytest.raises(cb.InputError, match=r"^file: '.*cycle.h5' holds another cycle"):
        cb.hysteresis(ROUGH, steps=31, file=file, **HOW)
    with pytest.raises(cb.InputError, match=r"holds another cycle"):
        cb.hysteresis(ROUGH, steps=30, file=file, model=cb.Periodic(grid=64), **HOW)


def test_files_that_hold_something_else_are_left_alone(tmp_path: Path) -> None:
    text, other = tmp_path / "a.h5", tmp_path / "b.h5"
    text.write_text("no HDF5")
    with h5py.File(other, "w") as file:
        file["x"] = 1.0
    for path in (text, tmp_path / "nowhere" / "c.h5"):
        with pytest.raises(cb.InputError, match=r"^file: '.*' cannot be opened or made as HDF5"):
            cb.hysteresis(ROUGH, steps=30, file=path, **HOW)
    with pytest.raises(cb.InputError, match=r"holds another cycle"):
        cb.hysteresis(ROUGH, steps=30, file=other, **HOW)
    with h5py.File(other) as file:
        assert list(file) == ["x"]
    with pytest.raises(cb.InputError, match=r"^file: only relaxation keeps its states in one"):
        cb.hysteresis(ROUGH, file=other)


def test_a_limit_of_time_leaves_what_there_is() -> None:
    found = cb.hysteresis(ROUGH, steps=30, time_limit=1e-3, **HOW)
    assert (found.status, found.closed, found.jumps) == ("incomplete", False, ())
    assert found.message.startswith("The time limit of 0.001 s was reached.")


def test_under_load_the_surfaces_come_apart() -> None:
    found = cb.hysteresis(ROUGH, "load", max_load=0.1, method="relaxation", steps=10)
    assert (found.status, found.closed, found.dissipated) == ("complete", False, None)
    assert found.jumps[-1].to is None
    trace = cb.trace(ROUGH, max_load=0.1)
    step = 0.01
    assert trace.thresholds["pull_off_load"] <= found.path.load[-1] <= trace.thresholds["pull_off_load"] + step
    assert "come apart for good" in found.message


def test_without_adhesion_there_are_no_jumps() -> None:
    found = cb.hysteresis(cb.Contact(TIP), "load", max_load=0.1, method="relaxation", steps=5)
    assert (found.jumps, found.dissipated, found.error) == ((), 0.0, 0.0)
    np.testing.assert_allclose(found.path.load, [0.02, 0.04, 0.06, 0.08, 0.1, 0.08, 0.06, 0.04, 0.02], atol=1e-12)
    np.testing.assert_allclose(found.path.displacement, found.path.displacement[::-1], atol=1e-7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_load": None}, "max_load: missing; relaxation needs the load"),
        ({"steps": 1}, "steps: 1; must be a whole number of at least 2"),
        ({"method": "relax"}, "method: 'relax'"),
    ],
)
def test_arguments(options: dict[str, object], message: str) -> None:
    with pytest.raises(cb.InputError, match=f"^{message}"):
        cb.hysteresis(ROUGH, **{**HOW, **options})


def test_other_models_have_curves_alone() -> None:
    with pytest.raises(cb.InputError, match=r"^method: 'relaxation' is for grids"):
        cb.hysteresis(cb.Contact.reduced("gauss", tabor=1.0), **HOW)
