"""The study `benchmark_grid.py`: the residual by which solvers are judged, the iteration on the load, failures."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import contbranch

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import benchmark_grid, grid_peers  # noqa: E402
from studies.grid_peers import Answer, Case, NotAble, NotInstalled, examine  # noqa: E402

SMALL = Case(grid=12, cell=6.0, load=1.0, tabor=1.0)


def nodes(case):
    """Coordinates of all nodes from the middle of the cell, x and y, row by row."""
    one = [(i + 0.5) * case.cell / case.grid - 0.5 * case.cell for i in range(case.grid)]
    return np.array([(x, y) for x in one for y in one])


def dense_stiffness(case):
    """K as a matrix, by the sum over waves of |q|/2 cos q·(r_i - r_j), without a transform."""
    half = case.grid // 2
    waves = [(i, j) for i in range(-half, half) for j in range(-half, half)]
    matrix = np.zeros((case.grid**2, case.grid**2))
    place = nodes(case)
    for wave in waves:
        q = 2 * math.pi / case.cell * np.array(wave)
        phase = place @ q
        matrix += 0.5 * math.hypot(*q) * np.cos(phase[:, None] - phase[None, :])
    return matrix / case.grid**2


def dense_equilibrium(case, mean_gap=None):
    """Gap of the exponential attraction by active sets and dense Newton steps, at a mean gap or at the case's load."""
    z = 0.5 * (nodes(case) ** 2).sum(axis=1)
    n, stiffness = z.size, dense_stiffness(case)
    gap, load = np.maximum(z - 1.5, 0.0) * 0.5, case.load
    for _ in range(100):
        v1 = -case.tabor * np.exp(-gap * case.tabor)
        excess = stiffness @ (gap - z) + load / case.cell**2 - v1
        contact = (gap == 0.0) & (excess > 0.0)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = stiffness + np.diag(case.tabor * v1)
        matrix[:n, n] = 1.0 / case.cell**2
        right = np.append(-excess, 0.0)
        matrix[:n][contact] = 0.0
        matrix[np.flatnonzero(contact), np.flatnonzero(contact)] = 1.0
        right[:n][contact] = 0.0
        if mean_gap is None:
            matrix[n, n] = 1.0
        else:
            matrix[n, :n] = 1.0 / n
            right[n] = mean_gap - gap.mean()
        step = np.linalg.solve(matrix, right)
        step *= min(1.0, 0.3 / np.abs(step[:n]).max())
        gap, load = np.maximum(gap + step[:n], 0.0), load + step[n]
        if np.abs(step).max() < 1e-13:
            break
    return gap.reshape(case.grid, case.grid)


class Dense:
    """A solver made for these tests."""

    packages = ("numpy",)
    modules = ()

    def __init__(self, name, control):
        self.name, self.control = name, control

    def value(self, case, mean_gap):
        return case.load if self.control == "load" else mean_gap

    def solve(self, case, value, tolerance, start=None):
        return Answer(dense_equilibrium(case, None if self.control == "load" else value), 7)


class Broken(Dense):
    """One that fails."""

    def __init__(self, error):
        super().__init__("broken", "mean gap")
        self.error = error

    def solve(self, case, value, tolerance, start=None):
        raise self.error


# What an answer is worth


@pytest.mark.parametrize(("law", "sign"), [("exponential", 1), ("gauss", -1)])
def test_residual_of_one_wave(law, sign):
    """g - z = c + A cos(2πx/L) cos(4πy/L) bears |q|/2 A cos cos + F/L², |q| = 2π √5/L; there is no contact."""
    case = Case(grid=32, cell=5.0, load=0.7, tabor=1.5, law=law, sign=sign)
    x, y = nodes(case).T
    wave = np.cos(2 * math.pi * x / 5.0) * np.cos(4 * math.pi * y / 5.0)
    gap = (x**2 + y**2) / 2 + 0.4 + 0.3 * wave
    decay = np.exp(-1.5 * gap) if law == "exponential" else 1.5 * gap * np.exp(-((1.5 * gap) ** 2) / 2)
    interaction = -sign * 1.5 * decay
    excess = 0.3 * math.pi * math.sqrt(5.0) / 5.0 * wave + 0.7 / 25.0 - interaction
    scale = math.sqrt((interaction**2).mean())
    worth = examine(case, gap.reshape(32, 32))
    assert worth.residual == pytest.approx(math.sqrt((excess**2).mean()) / scale, rel=1e-12)
    assert worth.largest == pytest.approx(abs(excess).max() / scale, rel=1e-12)
    assert worth.load == pytest.approx(25.0 * (interaction.mean()), rel=1e-12)  # the wave has no mean
    assert (worth.contact_radius, worth.penetration) == (0.0, 0.0)
    assert worth.mean_gap == pytest.approx(25.0 / 12 * (1 - 1 / 32**2) + 0.4, rel=1e-12)


def test_contact_may_press_but_not_pull():
    """Where g = 0 only e < 0 counts; an overlap is reported and cut off. K from a sum over waves, node by node."""
    z = 0.5 * (nodes(SMALL) ** 2).sum(axis=1)
    gap = np.maximum(z - 1.5, 0.0)
    excess = dense_stiffness(SMALL) @ (gap - z) + 1.0 / 36.0 + np.exp(-gap)
    violation = [min(e, 0.0) if g == 0.0 else e for g, e in zip(gap, excess, strict=True)]
    assert any(e > 0 for g, e in zip(gap, excess, strict=True) if g == 0.0)
    scale = math.sqrt((np.exp(-2 * gap)).mean())
    overlapping = np.where(gap == 0.0, -1e-3, gap).reshape(12, 12)
    for field, penetration in ((gap.reshape(12, 12), 0.0), (overlapping, 1e-3)):
        worth = examine(SMALL, field)
        assert worth.residual == pytest.approx(math.sqrt(np.mean(np.square(violation))) / scale, rel=1e-11)
        assert worth.penetration == penetration
        assert worth.contact_radius == pytest.approx(math.sqrt((gap == 0).sum() * 0.25 / math.pi), rel=1e-12)


def test_pulling_contact_is_a_violation():
    """A disc held in contact that the equilibrium does not have: its edge is pulled, and the residual says so."""
    gap = dense_equilibrium(SMALL)
    assert examine(SMALL, gap).residual < 1e-12
    z = SMALL.heights
    held = np.where(z < 1.3 * z[gap == 0.0].max(), 0.0, gap)
    assert (held == 0.0).sum() > (gap == 0.0).sum()
    assert examine(SMALL, held).residual > 1e-3


def test_wrong_answers_are_refused():
    for gap in (np.ones((3, 3)), np.full((12, 12), np.nan)):
        with pytest.raises(NotAble, match="no finite gap"):
            examine(SMALL, gap)


# The iteration on the load, and the report


def test_load_is_reached_by_the_mean_gap():
    """The mean gap found is that of the equilibrium at the load; both by the same dense steps, other controls."""
    reached = benchmark_grid.reach_load(Dense("dense", "mean gap"), SMALL, 1e-10)
    assert reached.load_error <= 1e-9
    assert reached.value == pytest.approx(float(dense_equilibrium(SMALL).mean()), abs=1e-8)
    assert reached.solves <= 10


def test_load_that_does_not_depend_on_the_control():
    class Stuck(Dense):
        def solve(self, case, value, tolerance, start=None):
            return Answer(case.heights + 1.0)

    with pytest.raises(NotAble, match="not met by iterating on the mean gap"):
        benchmark_grid.reach_load(Stuck("stuck", "mean gap"), SMALL, 1e-8)


def test_report_with_failures(tmp_path):
    """A solver that is missing or raises is a row; the others are timed, and the ratio is that of the others' best."""
    missing, wrong = Broken(NotInstalled("no module; install it by: pip")), Broken(ValueError("singular"))
    solvers = [Dense("contbranch", "load"), Dense("dense", "mean gap"), missing, wrong]
    report = benchmark_grid.run(SMALL, solvers, repeats=2)
    own, dense, absent, broken = report.rows
    assert own.failure == dense.failure == ""
    assert len(own.told) == len(dense.told) == 2
    assert own.found is None
    assert dense.found is not None
    assert own.worth is not None
    assert own.worth.residual < 1e-8
    assert absent.failure == "not installed: no module; install it by: pip"
    assert broken.failure == "ValueError: singular"
    assert report.ratio == pytest.approx(min(dense.median, dense.found) / own.median)
    printed = benchmark_grid.summary(report)
    assert "The fastest of the others, dense, takes" in printed
    assert "ValueError: singular" in printed
    document = json.loads(benchmark_grid.as_json(report))
    assert document["rows"][1]["worth"]["mean_gap"] == pytest.approx(dense_equilibrium(SMALL).mean(), abs=1e-8)
    assert document["rows"][2]["median"] is None
    assert document["machine"]["nproc"] >= 1


def test_an_answer_above_the_accuracy_does_not_count():
    class Rough(Dense):
        def solve(self, case, value, tolerance, start=None):
            gap = dense_equilibrium(case, value)
            return Answer(gap * (1 + 1e-5 * np.cos(np.arange(12.0))), complaint="stalled")

    report = benchmark_grid.run(SMALL, [Dense("contbranch", "load"), Rough("rough", "mean gap")], repeats=1)
    assert report.rows[1].failure == "true residual above 1e-08; it says: stalled"
    assert report.ratio is None
    assert "No ratio" in benchmark_grid.summary(report)


def test_ratio_takes_medians_and_the_friendlier_way():
    rows = [
        benchmark_grid.Row("contbranch", "", "load", told=[0.1, 0.2, 0.9]),
        benchmark_grid.Row("a", "", "offset", told=[3.0, 2.0, 2.5], found=9.0),
        benchmark_grid.Row("b", "", "offset", told=[4.0], found=2.25),
        benchmark_grid.Row("c", "", "offset", told=[0.5], failure="true residual above 1e-08"),
    ]
    assert benchmark_grid.Report(SMALL, 1e-8, {}, rows).ratio == pytest.approx(2.25 / 0.2)
    assert benchmark_grid.Report(SMALL, 1e-8, {}, rows[1:]).ratio is None


def test_growth_of_the_pairs():
    costs = [benchmark_grid.OwnCost(128, 60, 0.1, 20, 0.03), benchmark_grid.OwnCost(256, 70, 0.4, 25, 0.1)]
    assert "| 256² | 70 | 0.40 s | 25 | 1.25 | 0.10 s |" in benchmark_grid.scaling_table(costs)


def test_arguments():
    """The defaults are those of the case; every other solver can be named."""
    given = benchmark_grid.arguments([])
    assert (given.grid, given.cell, given.load, given.tabor, given.law) == (512, 9.8825, 1.5625, 1.0, "exponential")
    assert benchmark_grid.arguments(["--peers", "tamaas", "adhesion-cg"]).peers == ["tamaas", "adhesion-cg"]


def test_own_solver_is_told_the_case(monkeypatch):
    """The contact, the load and the model that go to `contbranch.solve`; its failure is one here."""
    asked = {}

    def solve(contact, *, load, model, near=None):
        asked.update(tabor=contact.tabor, load=load, model=model)
        gap = dense_equilibrium(SMALL)
        cost = SimpleNamespace(fft_pairs=40 if near is None else 9, wall_s=0.5)
        return SimpleNamespace(status=status, message="stuck", cell=SimpleNamespace(gap=gap), cost=cost)

    status = "complete"
    monkeypatch.setattr(contbranch, "solve", solve)
    monkeypatch.setattr(contbranch, "Periodic", lambda cell, grid: (cell, grid), raising=False)
    answer = grid_peers.Own().solve(SMALL, 1.0, 1e-8)
    assert asked == {"tabor": 1.0, "load": 1.0, "model": (6.0, 12)}
    assert answer.evaluations == 40
    assert examine(SMALL, answer.gap).residual < 1e-12
    (cost,) = benchmark_grid.scaling(SMALL, (16,))
    assert (cost.grid, cost.cold_pairs, cost.warm_pairs) == (16, 40, 9)
    assert asked["load"] == pytest.approx(1.01)
    assert asked["model"] == (6.0, 16)
    status = "incomplete"
    with pytest.raises(NotAble, match="stuck"):
        grid_peers.Own().solve(SMALL, 1.0, 1e-8)


# The others themselves


@pytest.mark.parametrize("name", ["tamaas", "adhesion-newton"])
def test_missing_package_says_what_to_install(name, monkeypatch):
    for module in ("tamaas", "ContactMechanics"):
        monkeypatch.setitem(sys.modules, module, None)  # as if it were not installed
    row, _ = benchmark_grid.prepare(grid_peers.SOLVERS[name], SMALL, 1e-8)
    assert row.failure.startswith("not installed")
    assert "pip install 'contbranch[benchmark]'" in row.failure


def test_law_that_adhesion_does_not_offer():
    pytest.importorskip("Adhesion")
    with pytest.raises(NotAble, match="no gauss law"):
        grid_peers.AdhesionNewton().solve(Case(grid=12, law="gauss"), 0.0, 1e-8)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["tamaas", "adhesion-newton", "adhesion-cg", "adhesion-lbfgs"])
def test_others_find_the_equilibrium(name):
    """Where they are installed: at the control's value that belongs to the dense solution, they return its gap."""
    pytest.importorskip("tamaas" if name == "tamaas" else "Adhesion")
    wanted = dense_equilibrium(SMALL)
    solver = grid_peers.SOLVERS[name]
    answer = solver.solve(SMALL, solver.value(SMALL, float(wanted.mean())), 1e-8)
    assert examine(SMALL, answer.gap).residual < 1e-6
    assert np.asarray(answer.gap) == pytest.approx(wanted, abs=1e-5)
