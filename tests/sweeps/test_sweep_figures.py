"""Figures of sweeps show the thresholds found, where they were found."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb
from contbranch.results.diagram import Cost
from contbranch.results.sweep import Sweep, SweepTask


def swept(axes: dict[str, tuple[float, ...]], mode: str = "grid") -> Sweep:
    """A sweep whose loads are products of its parameters, but for one task without a fold."""
    places = product(*axes.values()) if mode == "grid" else zip(*axes.values(), strict=True)
    tasks = []
    for index, place in enumerate(places):
        found = (
            {} if index == 1 else {"pull_off_load": -float(np.prod(place)), "pull_off_radius": 0.5, "touch_load": 1.0}
        )
        tasks.append(SweepTask(index, dict(zip(axes, place, strict=True)), "complete", "", found, 0.1))
    units = {"load": "nN", "contact_radius": "nm", "radius": "nm"}
    return Sweep(tuple(axes), axes, mode, tuple(tasks), len(tasks), 0, Cost(0.0, 0), Path("s.h5"), unit_names=units)


def test_over_two_parameters_a_map() -> None:
    """In the order of the axes, whatever that of the values; without a fold, nothing."""
    (panel, _) = swept({"tip.radius": (4.0, 1.0, 2.0), "material.modulus": (10.0, 1000.0)}).plot().axes
    cells = panel.collections[0].get_array().reshape(2, 3)
    assert np.array_equal(cells.filled(np.nan), [[-10.0, -20.0, -40.0], [-1000.0, -2000.0, np.nan]], equal_nan=True)
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("Tip radius $R$ (nm)", "Modulus $E$ (nN/nm²)")
    assert panel.get_title() == "pull off load (nN), grey: none"
    assert (panel.get_xscale(), panel.get_yscale()) == ("linear", "log")
    corners = panel.collections[0].get_coordinates()
    assert np.asarray(corners)[0, :, 0] == pytest.approx([0.5, 1.5, 3.0, 5.0])
    assert np.asarray(corners)[:, 0, 1] == pytest.approx([1.0, 100.0, 10000.0])


def test_over_one_parameter_curves() -> None:
    loads, radii = swept({"tabor": (1.0, 4.5, 2.0)}).plot("pull_off_load", "pull_off_radius").axes
    (line,) = loads.get_lines()
    assert line.get_xydata() == pytest.approx(np.array([[1.0, -1.0], [2.0, -2.0], [4.5, np.nan]]), nan_ok=True)
    assert (loads.get_ylabel(), radii.get_ylabel()) == ("pull off load (nN)", "pull off radius (nm)")
    assert loads.get_xscale() == "log"


def test_a_level_is_a_line() -> None:
    """-R E = -200 (the product that stands for a threshold here) on a map, and across curves."""
    axes = {"tip.radius": (1.0, 2.0, 4.0), "material.modulus": (25.0, 50.0, 100.0, 200.0)}
    (panel, _) = swept(axes).plot("pull_off_load", level=-200.0).axes
    (paths,) = (one.get_paths() for one in panel.collections[1:])
    ends = paths[0].vertices[[0, -1]]
    assert ends[ends[:, 0].argsort()] == pytest.approx(np.array([[1.0, 200.0], [4.0, 50.0]]))
    curves, radii = swept({"tabor": (1.0, 2.0)}).plot("pull_off_load", "pull_off_radius", level=-1.5).axes
    assert curves.get_lines()[-1].get_ydata() == [-1.5, -1.5]
    assert len(radii.get_lines()) == 1
    with pytest.raises(cb.InputError, match="level: a line over two parameters takes a grid"):
        swept(axes | {"material.modulus": (1.0, 2.0, 4.0)}, "zip").plot(level=-1.5)


def test_all_maps_are_drawn_and_what_is_missing_is_grey() -> None:
    """Five maps in two rows, of a sweep that was ended before its last two tasks."""
    names = [f"squeeze_out-{k}_load" for k in range(5)]
    whole = swept({"tip.radius": (1.0, 2.0), "material.modulus": (1.0, 2.0, 3.0)})
    tasks = [replace(task, thresholds=dict.fromkeys(names, 1.0)) for task in whole.tasks[:4]]
    panels = [one for one in replace(whole, tasks=tuple(tasks)).plot().axes if one.get_title()]
    assert [one.get_subplotspec().rowspan.start for one in panels] == [0, 0, 0, 0, 1]
    cells = panels[4].collections[0].get_array().reshape(3, 2)
    assert np.array_equal(cells.mask, [[False, False], [False, True], [False, True]])
    assert panels[4].get_title().endswith("grey: none")


def test_side_by_side_points() -> None:
    (panel, _) = swept({"tabor": (1.0, 2.0, 3.0), "tip.radius": (1.0, 5.0, 2.0)}, "zip").plot().axes
    assert np.asarray(panel.collections[1].get_offsets()) == pytest.approx(
        np.array([[1.0, 1.0], [2.0, 5.0], [3.0, 2.0]])
    )
    assert panel.collections[1].get_array().filled(np.nan) == pytest.approx([-1.0, np.nan, -6.0], nan_ok=True)


def test_a_sweep_says_what_became_of_its_tasks() -> None:
    one = swept({"tabor": (1.0,)})
    assert repr(one) == "Sweep: complete\n1 task over tabor: 1 complete"
    cut = replace(one, tasks=(replace(one.tasks[0], status="incomplete", message="The time limit was reached."),))
    assert repr(cut) == "Sweep: all tasks have ended\n1 task over tabor: 1 incomplete"
    assert str(cut).endswith("s: all tasks have ended")
    assert (cut.status, replace(cut, status="incomplete").outcome) == ("complete", "incomplete")


def test_what_cannot_be_drawn_is_said() -> None:
    with pytest.raises(
        cb.InputError, match="thresholds: squeeze; there are pull_off_load, pull_off_radius, touch_load"
    ):
        swept({"tabor": (1.0, 2.0)}).plot("squeeze")
    three = {"tabor": (1.0, 2.0), "tip.radius": (1.0, 2.0), "modulus": (1.0, 2.0)}
    with pytest.raises(cb.InputError, match="one parameter or two: write contbranch view"):
        swept(three).plot()
