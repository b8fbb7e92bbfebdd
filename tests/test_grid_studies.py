"""The studies of the grid models, on small grids."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import grid_convergence, hertz_radius  # noqa: E402
from studies.paper import fig03, fig04  # noqa: E402

IMAGES = 9.033621683100950  # Σ 1/R³ over the square lattice (Topping, Proc. R. Soc. Lond. A 114, 67, 1927)


# The paper's figures


def test_scaled_contacts_coincide_up_to_the_images(tmp_path):
    """Fig. 3: the gaps differ by the field of the images alone, Σ 1/R³ F r²/(4πE L³) to leading order.

    In reduced units F = 1e-4/0.64e-4 and L = (0.64e-4/w)^(-1/3); the difference is largest at the edge of the smaller
    cell. What the next orders and the lattice add is below a tenth of it.
    """
    pair = [fig03.collapse(scale, 512) for scale in fig03.SCALES]
    edges = [(0.64e-4 / scale) ** (-1 / 3) for scale in fig03.SCALES]
    radius = edges[1] / 2
    images = [IMAGES * 1.5625 * radius**2 / (4 * np.pi * edge**3) for edge in edges]
    assert fig03.difference(*pair) == pytest.approx(images[1] - images[0], rel=0.1)
    assert [1 / item.in_plane for item in pair] == pytest.approx(edges)
    assert max(item.exact for item in pair) < images[1]
    figure = fig03.draw(pair)
    assert len(figure.axes) == 2
    figure.savefig(tmp_path / "figure.png")


def test_displacement_at_infinity(tmp_path):
    """Fig. 4: a_c, the peak and d in three cells agree with the axisymmetric model within what the cells leave."""
    cells = [fig04.far_displacement(fig04.EDGE * f, 256) for f in fig04.FACTORS]
    exact, displacement = fig04.exact_displacement()
    top = exact.r[np.argmax(displacement)]
    assert exact.contact_radius == pytest.approx(2.2902, abs=5e-5)  # three other programs: 2.2902
    for cell in cells:
        far = cell.far
        assert cell.contact_radius == pytest.approx(exact.contact_radius, abs=4e-3)
        assert cell.peak == pytest.approx(top, abs=0.05)  # profiles are given at nodes and radii some 0.05 apart
        for value, error in (
            (far.displacement, far.error),
            (far.from_points, far.from_points_error),
            (far.rounded, far.rounded_error),
        ):
            assert abs(value - exact.displacement) <= error <= 10 * abs(value - exact.displacement)
    assert fig04.extrapolated(*cells[1:]) == pytest.approx(exact.displacement, abs=1e-3)
    figure = fig04.draw(cells)
    assert len(figure.axes) == 2
    figure.savefig(tmp_path / "figure.png")


def test_field_beyond_the_profile_is_continuous():
    """-u at the last radius is the last value, and goes to d as the field of a point force, F/(πEr)."""
    state, displacement = fig04.exact_displacement()
    far = np.array([state.r[-1], 1e6])
    near, limit = fig04.beyond(state, float(displacement[-1]), far)
    assert near == pytest.approx(displacement[-1], rel=1e-12)
    assert (state.displacement - limit) * np.pi * 1e6 == pytest.approx(state.load, rel=1e-6)


@pytest.mark.parametrize(("nodes", "allowed"), [(16, 2e-3), (32, 1e-3)])
def test_radius_of_hertz_below_the_spacing(nodes, allowed):
    """a³ = 3FR/(4E): counting nodes is worse by far, and the estimate holds up to what a few nodes leave to chance."""
    free = hertz_radius.hertz(nodes, cb.FreeSpace)
    assert free.fitted < allowed
    assert free.fitted < 0.2 * free.counted
    assert free.fitted <= 1.5 * free.estimate
    assert free.estimate < 2 * allowed


def test_images_of_hertz():
    """At a = L/8 the images make the radius smaller by Σ 1/R³ F/(6πE L³) = 0.125 % (F = 4a³/3)."""
    row = hertz_radius.hertz(32, cb.Periodic)
    images = IMAGES * 4 / 3 / (6 * np.pi) / 8**3
    assert row.fitted == pytest.approx(images, rel=0.5)
    assert row.corrected < 1e-3 < row.fitted + 5e-4


FOLDS_OF_THE_PAGE = ("squeeze-out", 8.3770514, "stays"), ("wetting", 8.0065114, "averaged")


def test_example_of_the_page(capsys):
    """docs/grid.md: its code runs, and its folds are those of the axisymmetric model (8.37705 and 8.00651)."""
    page = (ROOT / "docs" / "grid.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    exec(compile(example, "grid.md", "exec"), {"__name__": "__main__"})
    lines = capsys.readouterr().out.splitlines()
    for line, (name, exact, verdict) in zip(lines[:2], FOLDS_OF_THE_PAGE, strict=True):
        words = line.split()
        assert words[0] == name
        assert abs(float(words[1]) - exact) <= float(words[2]) < 2e-2
        assert words[3] == verdict


# Convergence, estimates and costs


@pytest.fixture(scope="module")
def traces():
    case = grid_convergence.GAUSS
    return [grid_convergence.traced(case, cb.FreeSpace(cell=case.cell, grid=grid)) for grid in (32, 64)]


def test_thresholds_converge_to_the_axisymmetric_ones(traces):
    """Folds of the Gauss repulsion, μ_T = 1: what is not touched by the lattice's rim has all digits at once."""
    coarse, fine = traces
    assert coarse.status == fine.status == "complete"
    assert {item.name for item in fine.thresholds} == set(grid_convergence.exact_thresholds(grid_convergence.GAUSS))
    assert fine.error("squeeze_out_load") < 1e-6
    assert fine.error("touch_load") < 1e-6
    assert fine.error("wetting_load") < 0.005 * 8.0065
    assert fine.error("wetting_load") < 0.3 * coarse.error("wetting_load")


def test_estimates_of_thresholds_are_honest(traces):
    """True errors are within the estimates, and no estimate of any size is a hundred times too large."""
    for row in traces:
        for item in row.thresholds:
            assert item.ratio <= 1.0, item
            assert item.ratio > 0.003 or item.estimate < 3e-6, item


def test_report_of_traces(traces):
    """The table has a line for every threshold, and the values of the axisymmetric model."""
    text = grid_convergence.report_traces(grid_convergence.GAUSS, traces)
    assert all(f"`{name}`" in text for name in grid_convergence.exact_thresholds(grid_convergence.GAUSS))
    assert "8.377051" in text


def test_single_states_against_the_axisymmetric_model():
    """Both states that coexist at F = 8.2 are found, and their errors are those estimated."""
    rows = grid_convergence.state_errors(grid_convergence.GAUSS, 64)
    assert {row.quantity for row in rows if row.load == 8.2} == {"displacement", "contact_radius", "central_gap"}
    assert max(row.ratio for row in rows) <= 1.0
    assert "8²" not in grid_convergence.report_states(rows)
    assert "64²" in grid_convergence.report_states(rows)


def test_periodic_cells_have_the_limit_of_free_space():
    """The folds' loads in two cells, extrapolated in 1/L³, are 15 times closer to the axisymmetric one than either."""
    case = grid_convergence.GAUSS
    rows = grid_convergence.periodic_rows(case, (10.0, 14.0), spacing=1 / 8)
    for name in ("squeeze_out_load", "wetting_load"):
        exact = grid_convergence.exact_thresholds(case)[name]
        errors = [abs(row.values[name] - exact) for row in rows]
        assert abs(grid_convergence.limit(rows, name) - exact) < errors[1] / 15 < errors[0] / 15


def test_costs_of_a_point():
    """At most 40 pairs of transforms for a point away from events."""
    cost = grid_convergence.cost(grid_convergence.GAUSS, 8.0, 64)
    assert cost.points > 20
    assert 1 < cost.typical <= cost.most <= 40


def test_unknown_errors_are_written_as_null():
    assert [grid_convergence.known(value) for value in (1.5, "x", float("inf"))] == [1.5, "x", None]


def test_rate_of_a_power_law():
    spacings = [0.4, 0.2, 0.1]
    assert grid_convergence.rate(spacings, [3 * s**1.5 for s in spacings]) == pytest.approx(1.5)


def test_chart_of_convergence(traces, tmp_path):
    """Four panels, errors on logarithmic axes."""
    cases = grid_convergence.CASES
    cells = [grid_convergence.CellRow(edge, {"squeeze_out_load": 8.4, "wetting_load": 8.0}) for edge in (8.0, 10.0)]
    spent = [grid_convergence.Cost(grid, 50, 15.0, 30.0, 20.0, 1.0, 0.2) for grid in (64, 128)]
    results = {case.name: traces if case is cases[0] else [] for case in cases}
    plain = {case.name: grid_convergence.without_grid(case, (1e-4,)) if case is cases[0] else [] for case in cases}
    assert max(item.error for item in plain[cases[0].name][0].thresholds) < 1e-3
    figure = grid_convergence.draw(results, plain, cells, spent)
    assert len(figure.axes) == 4
    assert figure.axes[0].get_yscale() == figure.axes[1].get_xscale() == "log"
    figure.savefig(tmp_path / "chart.png")
