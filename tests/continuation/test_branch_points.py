"""Branch points: told apart from folds, located, and their kind."""

from __future__ import annotations

import numpy as np
import pytest
from continuation_problems import Scalar, pitchfork

from contbranch.continuation import Options, Outcome, Problem, StopAt, switch_branch, trace_curve


@pytest.mark.parametrize("start", [-1.0, -1.037, -0.77])
def test_pitchfork_from_its_trivial_branch(start):
    curve = trace_curve(pitchfork(), [0.0], start, (-1.1, 1.0))
    assert curve.status == "complete"
    assert curve.folds == []
    (point,) = curve.branch_points
    assert point.type == "pitchfork"
    assert point.parameter == pytest.approx(0.0, abs=1e-9)
    # The other curve, x² = p, leaves along x.
    assert abs(point.other_parameter) < 1e-4 * abs(point.other_x[0])


def test_pitchfork_from_its_other_branch_is_no_fold():
    """Along x² = p the parameter has a minimum, but the Jacobian's border is singular there: a branch point."""
    curve = trace_curve(pitchfork(), [1.0], 1.0, (-1.0, 1.0))
    assert curve.status == "complete"
    assert curve.folds == []
    (point,) = curve.branch_points
    assert point.type == "pitchfork"
    assert point.parameter == pytest.approx(0.0, abs=1e-9)
    assert curve.x[-1][0] * curve.x[0][0] == pytest.approx(-1.0)  # passed through, to the opposite branch


@pytest.mark.parametrize("start", [-1.0, -0.83])
def test_transcritical_crossing(start):
    problem = Scalar(lambda x, p: p * x - x * x, lambda x, p: p - 2 * x, lambda x, p: x)
    curve = trace_curve(problem, [0.0], start, (-1.0, 1.0))
    (point,) = curve.branch_points
    assert point.type == "transcritical"
    assert point.parameter == pytest.approx(0.0, abs=1e-9)
    assert point.other_x[0] / point.other_parameter == pytest.approx(1.0, rel=1e-3)  # the other curve is x = p


class Ring(Problem):
    """Pitchforks of three coupled unknowns, x (p - L) - x³ with L of eigenvalues 0.5, 1.25 and 2."""

    vectors = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, -1.0, 1.0], [2.0, 0.1, 0.7]]))[0]
    matrix = vectors @ np.diag([0.5, 1.25, 2.0]) @ vectors.T

    def residual(self, x, p):
        return p * x - self.matrix @ x - x**3

    def jacobian(self, x, p):
        return p * np.eye(3) - self.matrix - np.diag(3 * x**2)

    def parameter_derivative(self, x, p):
        return x.copy()

    def morse_index(self, x, p):
        return int(np.sum(np.linalg.eigvalsh(self.jacobian(x, p)) > 0))


def test_every_branch_point_with_its_change_of_index():
    curve = trace_curve(Ring(), np.zeros(3), 0.0, (0.0, 3.0))
    assert [event.kind for event in curve.events] == ["branch point"] * 3
    assert [point.parameter for point in curve.branch_points] == pytest.approx([0.5, 1.25, 2.0], abs=1e-9)
    assert curve.morse_index[0] == 0
    assert curve.morse_index[-1] == 3


@pytest.mark.parametrize("of_equations", [1.0, 1e10])
@pytest.mark.parametrize("of_parameter", [1e-8, 1.0, 1e8])
def test_units_do_not_matter_to_branch_points(of_parameter, of_equations):
    class Scaled(Problem):
        def residual(self, x, p):
            return of_equations * Ring().residual(x, p / of_parameter)

        def jacobian(self, x, p):
            return of_equations * Ring().jacobian(x, p / of_parameter)

    curve = trace_curve(Scaled(), np.zeros(3), 0.0, (0.0, 3.0 * of_parameter))
    places = [point.parameter / of_parameter for point in curve.branch_points]
    assert places == pytest.approx([0.5, 1.25, 2.0], abs=1e-12)
    assert all(point.type == "pitchfork" for point in curve.branch_points)


class Double(Ring):
    """Two eigenvalues cross at once: the determinant keeps its sign, the Morse index does not."""

    matrix = Ring.vectors @ np.diag([0.7, 0.7, 2.0]) @ Ring.vectors.T


def test_double_branch_point_is_found_by_its_index():
    curve = trace_curve(Double(), np.zeros(3), 0.0, (0.0, 1.5))
    (event,) = curve.events
    assert event.kind == "index change"
    assert (event.before, event.after) == (0, 2)
    assert event.parameter == pytest.approx(0.7, abs=1e-9)
    assert curve.outcome is Outcome.REACHED_EDGE


def test_backward_branch_reports_the_index_in_the_curves_direction():
    curve = trace_curve(Double(), np.zeros(3), 1.4, (0.0, 1.5))
    (event,) = curve.events
    assert (event.before, event.after) == (0, 2)
    assert curve.points[event.index] is not None
    assert curve.parameter[event.index] == event.parameter


class Crossed(Problem):
    """Curves y_k (p - λ_k - c_k y_k^n_k) = 0 that cross y = 0 at λ_k, in other coordinates and bent by sin(w p)."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 6))
        self.places = np.sort(rng.uniform(0.0, 1.0, n))
        self.share, self.power = rng.uniform(0.3, 3.0, n) * rng.choice([-1, 1], n), rng.integers(1, 3, n)
        self.mixed, self.weights = (rng.normal(size=(n, n)) + 2 * np.eye(n) for _ in range(2))
        self.bend, self.wave = rng.normal(size=n), rng.uniform(0.0, 3.0)

    def start(self, p):
        return np.linalg.solve(self.mixed, self.bend * np.sin(self.wave * p))

    def own(self, x, p):
        return self.mixed @ x - self.bend * np.sin(self.wave * p)

    def _slopes(self, y, p):
        return p - self.places - (self.power + 1) * self.share * y**self.power

    def residual(self, x, p):
        y = self.own(x, p)
        return self.weights @ (y * (p - self.places - self.share * y**self.power))

    def jacobian(self, x, p):
        return self.weights @ (self._slopes(self.own(x, p), p)[:, None] * self.mixed)

    def parameter_derivative(self, x, p):
        y = self.own(x, p)
        return self.weights @ (y - self._slopes(y, p) * self.bend * self.wave * np.cos(self.wave * p))


def test_all_branch_points_of_a_step():
    """However many lie in one step, all are found, and no step passes to another curve; of 30, one may fail."""
    missed = []
    for seed in range(30):
        problem = Crossed(seed)
        curve = trace_curve(problem, problem.start(-0.5), -0.5, (-0.5, 1.5))
        found = np.array([point.parameter for point in curve.branch_points])
        if len(found) != len(problem.places) or np.abs(found - problem.places).max() > 1e-8:
            missed.append((seed, found, problem.places))
    assert len(missed) <= 1, missed


@pytest.mark.parametrize(("seed", "apart"), [(5, 1e-5), (5, 1e-6), (8, 1e-6), (25, 1e-6), (1, 1e-7)])
def test_no_branch_points_where_curves_pass_each_other(seed, apart):
    """The same with constants of this order added to the equations, none of which keeps two curves crossing."""

    class Apart(Crossed):
        def residual(self, x, p):
            return super().residual(x, p) + apart * np.random.default_rng(seed + 999).normal(size=x.size)

    problem = Apart(seed)
    end = StopAt(predicate=lambda point: np.abs(problem.own(point.x, point.parameter)).max() > 3)
    curve = trace_curve(problem, problem.start(-0.5), -0.5, (-0.5, 1.5), stop=end)
    assert curve.status == "complete"
    assert curve.branch_points == []


def test_branch_points_beside_the_one_that_is_left():
    """The other curve is left so closely that what crosses it next to there is seen, too."""
    problem = Crossed(0)
    problem.places[:2], problem.share[0], problem.power[0] = (0.4, 0.4008), 1.0, 1
    curve = trace_curve(problem, problem.start(-0.5), -0.5, (-0.5, 1.5))
    first = min(curve.branch_points, key=lambda point: abs(point.parameter - 0.4))
    (branch,) = switch_branch(curve, first, (-0.5, 1.5))
    assert any(abs(point.parameter - 0.4008) < 1e-8 for point in branch.branch_points)


def test_branch_points_that_coincide_are_one():
    """Where the determinant keeps its sign and no index is known; four curves cross the one that is followed."""

    class Twice(Problem):
        def residual(self, x, p):
            return x * (p - 0.37 - x**2) * np.array([1.0, 2.0])

    curve = trace_curve(Twice(), [0.0, 0.0], -1.0, (-1.0, 2.0))
    (point,) = curve.branch_points
    assert abs(point.parameter - 0.37) <= point.error < 1e-4
    assert point.type == "branch point"
    ratios = sorted(abs(x[0]) / (abs(x[0]) + abs(x[1])) for x, _ in point.tangents[1:])
    assert ratios == pytest.approx([0.0, 0.5, 0.5, 1.0], abs=1e-2)
    branches = switch_branch(curve, point, (-1.0, 2.0))
    assert all(branch.status == "complete" for branch in branches)
    ends = np.sort([np.abs(branch.x[-1]) for branch in branches], axis=0)
    assert ends == pytest.approx(np.sqrt(1.63) * np.array([[0, 0], [1, 1], [1, 1], [1, 1]]), abs=1e-9)


def test_three_branch_points_in_one_place_are_no_simple_one():
    """The determinant changes its sign as at a single one; four curves have one cell apart, three have pairs."""

    class Cells(Problem):
        """Four cells alike: the mean loses its stability at p = 0, the three differences at p = -1/2."""

        def residual(self, x, p):
            return p * x + 0.4 * x**2 - x**3 + (x - x.mean()) / 2

    curve = trace_curve(Cells(), np.zeros(4), -1.0, (-1.0, 2.0))
    several, single = curve.branch_points
    assert abs(several.parameter + 0.5) <= several.error < 1e-4
    assert (several.type, single.type) == ("branch point", "transcritical")
    assert abs(single.parameter) <= single.error < 1e-11
    assert len(several.tangents) == 8
    branches = switch_branch(curve, several, (-1.0, 2.0))
    assert [branch.status for branch in branches] == ["complete"] * 7
    assert sorted(len(branch.folds) for branch in branches) == [0] * 3 + [1] * 4


class Triangle(Problem):
    """p z + z̄² - 0.3 |z|² z = 0 with z = x + i y: three transcritical curves, turned by 120°, cross z = 0 at p = 0."""

    def residual(self, x, p):
        z = complex(x[0], x[1])
        value = p * z + z.conjugate() ** 2 - 0.3 * abs(z) ** 2 * z
        return np.array([value.real, value.imag])

    def morse_index(self, x, p):
        return int((np.linalg.eigvals(self.jacobian(x, p)).real > 0).sum())


def test_an_index_is_told_beside_the_directions_of_several_curves():
    curve = trace_curve(Triangle(), np.zeros(2), -1.0, (-1.0, 1.0))
    (event,) = curve.events
    assert (event.kind, event.before, event.after) == ("index change", 0, 2)
    assert curve.branch_points == [event]
    angles = sorted(np.degrees(np.arctan2(u[1] * -np.sign(a), u[0] * -np.sign(a))) for u, a in event.tangents[1:])
    assert angles == pytest.approx([-120.0, 0.0, 120.0], abs=0.2)


@pytest.mark.parametrize("start", [1.9, 2.2, 2.5])
@pytest.mark.parametrize("apart", [1e-4, 1e-5, 1e-6, 1e-7])
def test_curves_that_all_but_cross_are_told_apart(start, apart):
    """x³ - 3 x + 2 (p² - 1) = ε turns beside (-1, 0), at p² = ε/2, rather than go straight on."""
    problem = Scalar(lambda x, p: x**3 - 3 * x + 2 * (p**2 - 1) - apart, lambda x, p: 3 * x**2 - 3, lambda x, p: 4 * p)
    curve = trace_curve(problem, [-2.5], start, (-3.0, 3.0))
    assert curve.status == "complete"
    assert curve.branch_points == []
    near, far = np.sqrt(apart / 2), np.sqrt(2 + apart / 2)
    assert sorted(fold.parameter for fold in curve.folds) == pytest.approx([-far, -near, near, far], abs=1e-10)


class Constants(Problem):
    """u″ + p (u - u³) = 0 on a few points, with Neumann conditions: at p = 0 all constants solve it."""

    def residual(self, x, p):
        return np.diff(np.concatenate([x[:1], x, x[-1:]]), 2) + p * (x - x**3)

    def jacobian(self, x, p):
        one = np.eye(x.size)
        return np.diff(np.vstack([one[:1], one, one[-1:]]), 2, axis=0) + np.diag(p * (1 - 3 * x**2))

    def parameter_derivative(self, x, p):
        return x - x**3


def test_a_curve_at_one_value_of_the_parameter_has_branch_points_but_no_folds():
    """Slopes of the parameter there are those of rounding. It meets u = -1, 0 and 1, and goes on without end."""
    curve = trace_curve(Constants(), np.zeros(6), -0.1, (-0.1, 0.1))
    (vertical,) = switch_branch(curve, curve.branch_points[0], (-0.1, 0.1), Options(maximum_points=12))
    assert (vertical.status, vertical.folds) == ("incomplete", [])
    assert sorted(event.x.mean() for event in vertical.branch_points) == pytest.approx([-1.0, 0.0, 1.0], abs=1e-9)
    for event in vertical.branch_points:
        assert abs(event.parameter) <= event.error < 1e-14
