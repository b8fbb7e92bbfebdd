"""Problems from the literature, and curves in closed form, through the public functions alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from continuation_problems import graph
from scipy import sparse
from scipy.optimize import brentq
from scipy.special import ellipk

from contbranch.continuation import Crossing, Outcome, Problem, StopAt, switch_branch, trace_curve, trace_folds


class FreudensteinRoth(Problem):
    """The homotopy F(x) - (1 - p) F(15, -2) of F. Freudenstein and B. Roth, J. ACM 10 (1963) 550; zero at (5, 4)."""

    def function(self, x):
        a, b = x
        return np.array([a - b**3 + 5 * b**2 - 2 * b - 13, a + b**3 + b**2 - 14 * b - 29])

    def residual(self, x, p):
        return self.function(x) - (1 - p) * self.function(np.array([15.0, -2.0]))


def test_freudenstein_roth():
    curve = trace_curve(FreudensteinRoth(), [15.0, -2.0], 0.0, (-2.0, 1.0))
    forward = [fold.parameter for fold in curve.folds]
    assert forward == pytest.approx([0.5875873254, -0.6863527575], abs=1e-9)
    assert curve.status == "complete"
    assert curve.x[-1] == pytest.approx([5.0, 4.0], abs=1e-9)
    assert curve.parameter[-1] == 1.0


class Cubic(Problem):
    """r + q x - x³/3 with parameter r: folds at x = ±√q, r = ∓(2/3) q^(3/2)."""

    def __init__(self, q=1.0):
        self.q = q

    def residual(self, x, p):
        return p + self.q * x - x**3 / 3


def test_folds_without_a_jacobian():
    curve = trace_curve(Cubic(), [-3.0], 6.0, (-6.0, 6.0))
    assert sorted(fold.parameter for fold in curve.folds) == pytest.approx([-2 / 3, 2 / 3], abs=1e-12)
    assert curve.x.shape == (len(curve.parameter), 1)


def test_folds_meet_in_a_cusp():
    fold = trace_curve(Cubic(), [-3.0], 6.0, (-6.0, 6.0)).folds[0]
    folds = trace_folds(Cubic, fold, q=1.0, q_range=(-0.5, 2.0))
    assert folds.status == "complete"
    assert folds.x[:, 0] ** 2 == pytest.approx(folds.q, abs=1e-8)
    assert folds.parameter == pytest.approx(-2 / 3 * folds.x[:, 0] ** 3, abs=1e-8)
    assert sorted(folds.x[[0, -1], 0]) == pytest.approx([-math.sqrt(2), math.sqrt(2)], abs=1e-8)
    (cusp,) = folds.cusps
    assert abs(cusp.q) < 1e-9
    assert abs(cusp.parameter) < 1e-9
    assert abs(cusp.x[0]) < 1e-5


class Aircraft(Problem):
    """Roll, pitch, yaw, angle of attack, sideslip, elevator and rudder over the aileron.

    R. K. Mehra, W. C. Kessel and J. V. Carroll, ONR Report CR-215-248 (1977); R. G. Melhem and W. C. Rheinboldt,
    Computing 29 (1982) 201, with the products of the angle of attack and the aileron.
    """

    linear = np.array(
        [
            [-3.933, 0.107, 0.126, 0, -9.99, 0, -7.64],
            [0, -0.987, 0, -22.95, 0, -28.37, 0],
            [0.002, 0, -0.235, 0, 5.67, 0, -6.51],
            [0, 1, 0, -1, 0, -0.168, 0],
            [0, 0, -1, 0, -0.196, 0, 0],
        ]
    )
    aileron = np.array([-45.83, 0, -0.921, 0, -0.0071])

    def __init__(self, elevator):
        self.elevator = elevator

    def residual(self, x, p):
        roll, pitch, yaw, attack, slip, elevator, rudder = x
        products = [
            -0.727 * pitch * yaw + 8.39 * yaw * attack - 684.4 * attack * slip + 63.5 * attack * p,
            0.949 * roll * yaw + 0.173 * roll * slip,
            -0.716 * roll * pitch - 1.578 * roll * attack + 1.132 * attack * p,
            -roll * slip,
            roll * attack,
        ]
        return np.append(self.linear @ x + self.aileron * p + products, [elevator - self.elevator, rudder])


# Limit points on the way to negative ailerons: the roll, four digits of Rheinboldt's list.
LIMITS = {
    -0.05: [2.9648],
    -0.008: [2.8173, 3.7579, 4.1638],
    0.0: [2.5873, 3.9005],
    0.05: [2.3639],
    0.1: [2.2992],
}


@pytest.mark.parametrize("elevator", LIMITS)
def test_limit_points_of_the_aircraft(elevator):
    start = np.array([0, 0, 0, 0, 0, elevator, 0])
    curve = trace_curve(Aircraft(elevator), start, 0.0, (-2.0, 2.0))
    start = int(np.argmin(np.abs(curve.x[:, 0]) + np.abs(curve.parameter)))
    rolls = [fold.x[0] for fold in curve.folds if fold.index < start]
    assert sorted(rolls) == pytest.approx(LIMITS[elevator], abs=2e-3)


class PlaneBratu(Problem):
    """Δu + λ eᵘ = 0 on the unit square, five-point formula on n x n interior points."""

    def __init__(self, n):
        one, other = sparse.eye_array(n), sparse.diags_array([np.full(n, 1.0)] * 2, offsets=[-1, 1], shape=(n, n))
        line = (other - 2 * one) * (n + 1.0) ** 2
        self.laplace = sparse.csc_array(sparse.kron(line, one) + sparse.kron(one, line))

    def residual(self, x, p):
        return self.laplace @ x + p * np.exp(x)

    def jacobian(self, x, p):
        return self.laplace + sparse.diags_array(p * np.exp(x))

    def parameter_derivative(self, x, p):
        return np.exp(x)


def test_bratu_on_the_square():
    curve = trace_curve(PlaneBratu(60), np.zeros(3600), 0.0, (0.0, 10.0), stop=StopAt(folds=1))
    assert curve.folds[0].parameter == pytest.approx(6.80772048, abs=5e-9)
    assert len(curve.points) <= 12


def test_bratu_on_the_square_loses_its_symmetries_where_eigenvalues_vanish():
    """Two of them at once first: next to that rounding hides the curve. Neither shows in Newton's corrections."""
    problem = PlaneBratu(30)
    curve = trace_curve(problem, np.zeros(900), 0.0, (0.0, 10.0))
    assert (curve.status, [event.kind for event in curve.events]) == ("complete", ["fold", *["branch point"] * 2])

    def growing(k):
        point = curve.points[k]
        return int((np.linalg.eigvalsh(problem.jacobian(point.x, point.parameter).toarray()) > 0.0).sum())

    found = [(growing(event.index - 1), growing(event.index + 1)) for event in curve.events]
    assert found == [(0, 1), (1, 3), (3, 4)]
    assert all(event.error < 1e-3 * event.parameter for event in curve.branch_points)


class SpaceBratu(PlaneBratu):
    """The same in the unit cube."""

    def __init__(self, n):
        super().__init__(n)
        line = sparse.diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)) * (n + 1.0) ** 2
        self.laplace = sparse.csc_array(
            sparse.kron(self.laplace, sparse.eye_array(n)) + sparse.kron(sparse.eye_array(n * n), line)
        )


def test_bratu_in_the_cube_has_nothing_but_its_fold():
    """Where λ falls to nothing while u grows, it is but rounding, and so are the folds that it might show."""
    curve = trace_curve(SpaceBratu(5), np.zeros(125), 0.0, (0.0, 14.0))
    assert curve.ends[1].outcome is Outcome.APPROACHES_EDGE
    assert [event.kind for event in curve.events] == ["fold"]
    assert curve.folds[0].parameter == pytest.approx(9.908353276, abs=1e-9)


class Waves(Problem):
    """A second derivative in the basis of its n lowest modes, on the points of a fast transform."""

    def __init__(self, modes, eigenvalues):
        self.modes = modes
        self.second = -modes @ np.diag(eigenvalues) @ np.linalg.inv(modes)


class ChafeeInfante(Waves):
    """u'' + λ (u - u³) = 0 on (0, π), u = 0 at the ends (N. Chafee and E. Infante, Applicable Anal. 4 (1974) 17)."""

    def __init__(self, n=40):
        numbers = np.arange(1, n + 1)
        super().__init__(np.sin(np.outer(numbers * np.pi / (n + 1), numbers)), numbers**2.0)

    def residual(self, x, p):
        return self.second @ x + p * (x - x**3)

    def jacobian(self, x, p):
        return self.second + p * np.diag(1 - 3 * x**2)


def test_chafee_infante():
    """Branch k has the amplitude a with √λ = (2k/π) K(m)/√(1 - a²/2), m = a²/(2 - a²), and an energy conserved."""
    problem, highest = ChafeeInfante(), 12.0
    curve = trace_curve(problem, np.zeros(40), 0.5, (0.5, highest))
    assert [point.parameter for point in curve.branch_points] == pytest.approx([1.0, 4.0, 9.0], abs=1e-10)
    for k, point in enumerate(curve.branch_points, start=1):
        (branch,) = switch_branch(curve, point, (0.5, highest))
        assert branch.status == "complete"
        assert list(branch.parameter[[0, -1]]) == [highest, highest]
        assert min(branch.parameter) == pytest.approx(k**2, abs=1e-10)
        assert [event.kind for event in branch.events] == ["branch point"]
        assert branch.x[0] == pytest.approx(-branch.x[-1], abs=1e-9)
        amplitude = brentq(
            lambda a, k=k: 2 * k / np.pi * ellipk(a**2 / (2 - a**2)) / np.sqrt(1 - a**2 / 2) - np.sqrt(highest),
            1e-6,
            0.999999,
        )
        slopes = np.cos(np.outer(np.arange(1, 41) * np.pi / 41, np.arange(1, 41))) * np.arange(1, 41)
        u, slope = branch.x[-1], slopes @ np.linalg.solve(problem.modes, branch.x[-1])
        energy = slope**2 + highest * (u**2 - u**4 / 2)
        assert energy == pytest.approx(np.full(40, highest * (amplitude**2 - amplitude**4 / 2)), rel=1e-5)


class Schnakenberg(Problem):
    """u'' - u + u²v = 0, d v'' + p - u²v = 0 on (0, 8), no flux at the ends (J. Theor. Biol. 81 (1979) 389)."""

    def __init__(self, n=30, ratio=60.0):
        self.n, self.ratio = n, ratio
        second = np.diag(np.full(n - 1, 1.0), 1) + np.diag(np.full(n - 1, 1.0), -1) - 2 * np.eye(n)
        second[0, 0] = second[-1, -1] = -1.0
        self.second = second * (n / 8.0) ** 2

    def residual(self, x, p):
        u, v = x[: self.n], x[self.n :]
        return np.append(self.second @ u - u + u * u * v, self.ratio * (self.second @ v) + p - u * u * v)

    def jacobian(self, x, p):
        u, v = x[: self.n], x[self.n :]
        own, other = np.diag(2 * u * v), np.diag(u * u)
        return np.block([[self.second - np.eye(self.n) + own, other], [-own, self.ratio * self.second - other]])


def test_branch_between_two_others_passes_both_pitchforks():
    """It leaves the constants, u = p, and joins a wave of half its length at its own extremum of the parameter.

    Next to both rounding hides the curve: neither that extremum nor an event at that very point ends it.
    """
    constants = trace_curve(Schnakenberg(), np.repeat([3.0, 1 / 3.0], 30), 3.0, (0.5, 3.0))
    first = min(constants.branch_points, key=lambda point: point.parameter)
    (branch,) = switch_branch(constants, first, (0.5, 3.0))
    asymmetry = Crossing(lambda x, p: x[0] - x[29], name="symmetric")
    start = branch.points[8]
    again = trace_curve(Schnakenberg(), start.x, start.parameter, (0.5, 3.0), events=[asymmetry])
    for curve in (branch, again):
        assert curve.closed
        assert not curve.folds
        joined, left = sorted(curve.branch_points, key=lambda point: point.parameter)
        assert left.parameter == pytest.approx(first.parameter, abs=1e-9)
        assert (joined.type, left.type) == ("pitchfork", "pitchfork")
        assert joined.x[:30] == pytest.approx(joined.x[29::-1], abs=1e-7)
    symmetric = sorted(event.parameter for event in again.named("symmetric"))
    assert symmetric == pytest.approx(sorted(point.parameter for point in again.branch_points), abs=1e-9)


class Arch(Problem):
    """A shallow sine arch of height h under a load of its own shape, in its first four modes."""

    squares = np.arange(1.0, 5.0) ** 2

    def __init__(self, height):
        self.height = height
        self.unloaded = np.array([height, 0.0, 0.0, 0.0])

    def _thrust(self, x):
        return float(self.squares @ (x**2 - self.unloaded**2)) / 4

    def residual(self, x, p):
        forces = self.squares**2 * (x - self.unloaded) + self._thrust(x) * self.squares * x
        return forces + np.array([p, 0.0, 0.0, 0.0])

    def jacobian(self, x, p):
        products = np.outer(self.squares * x, self.squares * x) / 2
        return np.diag(self.squares**2 + self._thrust(x) * self.squares) + products


def buckling_loads(height):
    """The thrust is k² where x₁² = h² - 4 k², p = h + (k² - 1) x₁; pairs of p."""
    modes = [k for k in (2, 3, 4) if 2 * k < height]
    return [[height + s * (k**2 - 1) * math.sqrt(height**2 - 4 * k**2) for s in (-1, 1)] for k in modes]


def through(height):
    """Stop where the arch hangs."""
    return StopAt(predicate=lambda point: point.x[0] < -1.5 * height)


@pytest.mark.parametrize("height", [5.0, 8.0, 12.0, 20.0])
def test_arch_buckles_into_its_other_modes(height):
    """On a branch from one point where the thrust is k² to the other.

    Loads are of another order than heights, and at the points themselves the branches have their extrema.
    """
    edges, pairs = (-1e3, 3e3), buckling_loads(height)
    curve = trace_curve(Arch(height), [height, 0.0, 0.0, 0.0], 0.0, edges, stop=through(height))
    assert len(curve.folds) == 2
    assert len(curve.branch_points) == 2 * len(pairs)
    for point in curve.branch_points:
        assert point.type == "pitchfork"
        assert point.error < 1e-8
        (branch,) = switch_branch(curve, point, edges)
        assert branch.closed
        assert not branch.folds
        (pair,) = [pair for pair in pairs if min(abs(p - point.parameter) for p in pair) < 1e-10]
        assert sorted(one.parameter for one in branch.branch_points) == pytest.approx(pair, abs=1e-8)


@pytest.mark.parametrize("height", [5.0, 12.0, 20.0])
def test_branch_points_without_a_jacobian(height):
    """They are as accurate as residuals, however rough the differences that stand for derivatives."""

    class Bare(Problem):
        arch = Arch(height)

        def residual(self, x, p):
            return self.arch.residual(x, p)

    curve = trace_curve(Bare(), [height, 0.0, 0.0, 0.0], 0.0, (-1e3, 3e3), stop=through(height))
    expected = sorted(np.ravel(buckling_loads(height)))
    assert sorted(point.parameter for point in curve.branch_points) == pytest.approx(expected, abs=1e-11)


class NeumannGelfand(Waves):
    """u'' - u + λ eᵘ = 0 on (0, 1) with u' = 0 at both ends."""

    def __init__(self, n=24):
        numbers = np.arange(n)
        super().__init__(np.cos(np.outer((numbers + 0.5) * np.pi / n, numbers)), (numbers * np.pi) ** 2)

    def residual(self, x, p):
        return self.second @ x - x + p * np.exp(x)

    def jacobian(self, x, p):
        return self.second - np.eye(x.size) + p * np.diag(np.exp(x))


def test_gelfand_with_neumann_conditions():
    """Constants, λ = u e⁻ᵘ, with a fold at u = 1 and waves of k half periods from u = 1 + k²π² on."""
    curve = trace_curve(NeumannGelfand(), np.zeros(24), 0.0, (0.0, 1.0), stop=StopAt(predicate=lambda q: q.x[0] > 12))
    (fold,) = curve.folds
    assert fold.parameter == pytest.approx(math.exp(-1), abs=1e-13)
    assert fold.x == pytest.approx(np.ones(24), abs=1e-7)
    (point,) = curve.branch_points
    height = 1 + math.pi**2
    assert point.x == pytest.approx(np.full(24, height), abs=1e-7)
    assert point.parameter == pytest.approx(height * math.exp(-height), rel=1e-9)
    (branch,) = switch_branch(curve, point, (1e-8, 1.0))
    assert list(branch.parameter[[0, -1]]) == [1e-8, 1e-8]
    # Of the two halves one is the other's mirror image.
    assert branch.x[0] == pytest.approx(branch.x[-1][::-1], rel=1e-4)


@pytest.mark.parametrize("first", range(0, 200, 20))
def test_every_fold_of_random_curves_once_and_in_order(first):
    """p = P(x), P' with five random zeros, two pairs of them 2e-3 to 0.6 apart: often several within one step."""
    for seed in range(first, first + 20):
        generator = np.random.default_rng(seed)
        centres = generator.uniform([-2.0, 0.2], [-0.2, 2.0])
        halves = 10 ** generator.uniform(-3.0, -0.5, 2)
        roots = np.sort([*(centres - halves), *(centres + halves), generator.uniform(-2.5, 2.5)])
        slope = np.poly(roots)
        height = np.polyint(slope)
        problem = graph(lambda x, c=height: np.polyval(c, x), lambda x, c=slope: np.polyval(c, x))
        end = StopAt(predicate=lambda point: abs(point.x[0]) > 3.5)
        curve = trace_curve(problem, [-3.0], float(np.polyval(height, -3.0)), (-1e4, 1e4), stop=end)
        found = np.array([fold.x[0] for fold in curve.folds])
        order = found if curve.x[0][0] < curve.x[-1][0] else found[::-1]
        assert order == pytest.approx(roots, abs=1e-8), seed
