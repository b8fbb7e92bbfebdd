"""Folds in a second parameter, in any units, from folds at zero to the edge of a family, sparse and without matrix."""

from __future__ import annotations

import math

import numpy as np
import pytest
from continuation_problems import Bratu
from scipy import sparse

from contbranch.continuation import Options, Problem, trace_curve, trace_folds


class Sheared(Problem):
    """p + (e^Q − 1) sinh X − sinh(2X)/3, X and Q in units: a cusp where 3 (e^Q − 1) = 2, at X = p = 0."""

    def __init__(self, q, unit=1.0, unit_q=1.0):
        self.q, self.unit = np.expm1(q / unit_q), unit

    def residual(self, x, p):
        return p + self.q * np.sinh(x / self.unit) - np.sinh(2 * x / self.unit) / 3

    def jacobian(self, x, p):
        return np.diag((self.q * np.cosh(x / self.unit) - 2 / 3 * np.cosh(2 * x / self.unit)) / self.unit)


@pytest.mark.parametrize(("unit", "unit_q"), [(1e-9, 1.0), (1e-5, 1.0), (1.0, 1e-9), (1e6, 1e6)])
def test_cusps_are_met_in_any_units(unit, unit_q):
    def family(q):
        return Sheared(q, unit, unit_q)

    start = np.array([-2.0 * unit])
    curve = trace_curve(family(unit_q), start, -float(family(unit_q).residual(start, 0.0)[0]), (-30.0, 30.0))
    folds = trace_folds(family, curve.folds[0], unit_q, (-0.5 * unit_q, unit_q))
    (cusp,) = folds.cusps
    assert (folds.status, len(folds.q) < 30) == ("complete", True)
    assert cusp.q / unit_q == pytest.approx(math.log(5 / 3), abs=1e-11)
    assert cusp.x[0] / unit == pytest.approx(0.0, abs=5e-6)


class Moved(Problem):
    """(x − x0)² + p0 = p."""

    def __init__(self, x0, p0):
        self.x0, self.p0 = x0, p0

    def residual(self, x, p):
        return (x - self.x0) ** 2 + self.p0 - p

    def jacobian(self, x, p):
        return np.diag(2 * (x - self.x0))


@pytest.mark.parametrize("family", [lambda q: Moved(q - 1, 0.0), lambda q: Moved(np.sin(q - 1), q - 1 - 1e-17)])
def test_a_fold_at_zero_is_followed_as_far_as_any_other(family):
    curve = trace_curve(family(1.0), [1.0], 1.0, (-1.0, 4.0))
    folds = trace_folds(family, curve.folds[0], 1.0, (-2.0, 3.0))
    assert (folds.status, len(folds.q) < 30) == ("complete", True)
    assert folds.q[[0, -1]] == pytest.approx([-2.0, 3.0])
    for q, x, p in zip(folds.q, folds.x, folds.parameter, strict=True):
        assert (x[0], p) == pytest.approx((family(q).x0, family(q).p0), abs=1e-8)


@pytest.mark.parametrize("q", [0.0, 1.0])
def test_a_family_need_not_be_defined_outside_its_range(q):
    """√q is not defined below zero."""

    def family(q):
        return Moved(q, math.sqrt(q) ** 3)

    curve = trace_curve(family(q), [q + 1.0], 1.0 + q**1.5, (-1.0, 4.0))
    folds = trace_folds(family, curve.folds[0], q, (0.0, 2.0))
    assert folds.status == "complete"
    assert folds.q[[0, -1]] == pytest.approx([0.0, 2.0], abs=1e-8)
    assert folds.parameter == pytest.approx(folds.q**1.5, abs=1e-8)


class Loaded(Bratu):
    def __init__(self, q, kind):
        super().__init__(40, kind)
        self.q = q

    def residual(self, x, p):
        return super().residual(x, p) + self.q


def test_without_a_matrix_folds_are_those_with_one():
    ends = []
    for kind in ("dense", "matrix-free"):
        curve = trace_curve(Loaded(0.0, kind), np.zeros(40), 0.0, (0.0, 6.0))
        folds = trace_folds(lambda q, kind=kind: Loaded(q, kind), curve.folds[0], 0.0, (0.0, 2.0))
        assert folds.status == "complete"
        ends.append(folds.parameter[[0, -1]])
    assert ends[0] == pytest.approx(ends[1], abs=1e-8)


class Gelfand(Problem):
    """u'' + p exp(u/(1 + q u)) = 0 on (0, 1)."""

    asked = 0

    def __init__(self, q, n):
        self.q = q
        rows = np.ones(n - 1), -2 * np.ones(n), np.ones(n - 1)
        self.laplace = sparse.diags_array(rows, offsets=[-1, 0, 1]).tocsc() * (n + 1.0) ** 2

    def residual(self, x, p):
        Gelfand.asked += 1
        return self.laplace @ x + p * self.parameter_derivative(x, p)

    def jacobian(self, x, p):
        rate = self.parameter_derivative(x, p) / (1 + self.q * x) ** 2
        return (self.laplace + sparse.diags_array(p * rate)).tocsc()

    def parameter_derivative(self, x, p):
        return np.exp(x / (1 + self.q * x))


def test_a_sparse_family_takes_no_difference_for_each_unknown():
    """And its cusp converges with the square of the distance of nodes."""
    cusps = []
    for n in (150, 300, 600):
        curve = trace_curve(Gelfand(0.2, n), np.zeros(n), 0.0, (0.0, 10.0))
        Gelfand.asked = 0
        folds = trace_folds(lambda q, n=n: Gelfand(q, n), curve.folds[0], 0.2, (0.1, 0.3))
        cusps += [cusp.q for cusp in folds.cusps]
        assert Gelfand.asked < 2500
    assert (cusps[0] - cusps[1]) / (cusps[1] - cusps[2]) == pytest.approx(4.0, rel=0.05)


class Resting(Problem):
    """A fold at x = y = p = 0 for every q, the Jacobian by differences or given."""

    def __init__(self, q, kind):
        self.q, self.kind = q, kind

    def residual(self, u, p):
        x, y = u
        bent = self.q * y - x * x + x * y if self.kind == "bogdanov-takens" else y * y - x * x * (1 + self.q * x)
        return np.array([y, p + bent])


class RestingByHand(Resting):
    def jacobian(self, u, p):
        x, y = u
        if self.kind == "bogdanov-takens":
            return np.array([[0.0, 1.0], [y - 2 * x, self.q + x]])
        return np.array([[0.0, 1.0], [-2 * x - 3 * self.q * x * x, 2 * y]])


@pytest.mark.parametrize("problem", [Resting, RestingByHand])
@pytest.mark.parametrize("kind", ["bogdanov-takens", "cubic"])
@pytest.mark.parametrize("q", [-0.1, 0.0, 0.5])
def test_a_fold_that_rests_at_the_origin_is_followed(problem, kind, q):
    """The Bogdanov–Takens normal form x' = y, y' = p + q y − x² + x y has its fold at the origin for every q, and the
    Bogdanov–Takens point at q = 0: Yu. A. Kuznetsov, Elements of Applied Bifurcation Theory (Springer, 2004), sec. 8.4.
    """
    curve = trace_curve(problem(q, kind), [0.1, 0.0], 0.01, (-0.5, 0.5))
    folds = trace_folds(lambda q: problem(q, kind), curve.folds[0], q, (-1.0, 1.0))
    assert (folds.status, len(folds.q) < 50, folds.cusps) == ("complete", True, [])
    assert folds.q[[0, -1]] == pytest.approx([-1.0, 1.0])
    assert np.abs(folds.x).max() < 1e-8
    assert np.abs(folds.parameter).max() < 1e-15


class Random(Problem):
    """tanh(A x) − x + B(x, x)/2 + p c + q (d + L x) with random coefficients, x, p and q in units."""

    def __init__(self, q, units, coefficients):
        self.q, self.units, self.coefficients = q / units[2], units, coefficients

    def residual(self, x, p):
        a, b, c, d, e = self.coefficients
        x = x / self.units[0]
        return np.tanh(a @ x) - x + 0.5 * (b @ x) @ x + c * p / self.units[1] + self.q * (0.3 * d + e @ x)

    def jacobian(self, x, p):
        a, b, _, _, e = self.coefficients
        x = x / self.units[0]
        slope = (1 - np.tanh(a @ x) ** 2)[:, None] * a - np.eye(x.size) + 0.5 * (b + b.transpose(0, 2, 1)) @ x
        return (slope + self.q * e) / self.units[0]


@pytest.mark.parametrize("seed", range(8))
def test_random_folds_are_followed_to_both_ends_in_any_units(seed):
    """All points solve F = 0, and their Jacobians are singular."""
    rng = np.random.default_rng(seed)
    n, units = int(rng.integers(2, 6)), 10.0 ** rng.uniform(-4.0, 4.0, 3)
    shapes = (n, n), (n, n, n), (n,), (n,), (n, n)
    coefficients = [size * rng.standard_normal(s) for size, s in zip((0.3, 0.3, 1, 1, 0.1), shapes, strict=True)]

    def family(q):
        return Random(q, units, coefficients)

    q = 0.2 * units[2]
    curve = trace_curve(family(q), np.zeros(n), 0.0, (-4.0 * units[1], 4.0 * units[1]), Options(maximum_points=300))
    for fold in curve.folds[:1]:
        folds = trace_folds(family, fold, q, (-units[2], 1.5 * units[2]))
        assert folds.status == "complete"
        for at, x, p in zip(folds.q, folds.x, folds.parameter, strict=True):
            assert np.abs(family(at).residual(x, p)).max() < 1e-8
            sizes = np.linalg.svd(family(at).jacobian(x, p), compute_uv=False)
            assert sizes[-1] < 1e-7 * sizes[0]


class Isola(Problem):
    """x² + (p − q)² = q − 0.3 + q x: closed curves that shrink to a point, the centre of an isola."""

    def __init__(self, q):
        self.q = q

    def residual(self, x, p):
        return x**2 + (p - self.q) ** 2 - self.q + 0.3 - self.q * x

    def jacobian(self, x, p):
        return np.diag(2 * x - self.q)


def test_folds_pass_the_centre_of_an_isola_which_is_no_cusp():
    """Folds at x = q/2, p = q ± √(q − 0.3 + q²/4) for as long as that is real: both meet at the centre."""
    curve = trace_curve(Isola(1.0), [0.5], 1.0 - math.sqrt(0.95), (-3.0, 3.0))
    folds = trace_folds(Isola, curve.folds[0], 1.0, (0.0, 1.5))
    assert (folds.status, folds.cusps) == ("complete", [])
    assert folds.q[[0, -1]] == pytest.approx([1.5, 1.5])
    assert folds.q.min() == pytest.approx(-2 + math.sqrt(5.2), abs=0.01)
    assert folds.x[:, 0] == pytest.approx(folds.q / 2, abs=1e-8)
    assert (folds.parameter - folds.q) ** 2 == pytest.approx(folds.q - 0.3 + folds.q**2 / 4, abs=1e-8)


class Imperfect(Problem):
    """p + q x − x³ = 0."""

    def __init__(self, q):
        self.q = q

    def residual(self, x, p):
        return p + self.q * x - x**3


def test_folds_end_in_the_cusp_of_the_imperfect_pitchfork():
    """Folds at p = ±2/(3√3) = ±0.38490 for q = 1 (demo ``cusp`` of AUTO-07p), which merge at the origin."""
    curve = trace_curve(Imperfect(1.0), [-1.5], -1.875, (-2.0, 2.0))
    assert sorted(fold.parameter for fold in curve.folds) == pytest.approx([-2 / 27**0.5, 2 / 27**0.5], abs=1e-13)
    folds = trace_folds(Imperfect, curve.folds[0], 1.0, (-1.0, 2.0))
    (cusp,) = folds.cusps
    assert (cusp.q, cusp.parameter) == pytest.approx((0.0, 0.0), abs=1e-10)  # of a Jacobian by differences
    assert np.sort(folds.parameter[[0, -1]]) == pytest.approx([-(32**0.5) / 27**0.5, 32**0.5 / 27**0.5], abs=1e-9)
    assert np.abs(27 * folds.parameter**2 - 4 * folds.q**3).max() < 1e-9


class Chan(Problem):
    """x'' + p (1 + (x + x²/2)/(1 + q x²)) = 0 on (0, 1), x = q at the ends."""

    def __init__(self, q, n):
        self.q, self.inner_nodes = q, np.ones(n)
        self.inner_nodes[[0, -1]] = 0.0
        rows = np.ones(n - 1), -2 * np.ones(n), np.ones(n - 1)
        second = sparse.diags_array(rows, offsets=[-1, 0, 1]) * (n - 1.0) ** 2
        self.linear = sparse.diags_array(self.inner_nodes) @ second + sparse.diags_array(1 - self.inner_nodes)

    def residual(self, x, p):
        return self.linear @ x - self.q * (1 - self.inner_nodes) + p * self.parameter_derivative(x, p)

    def jacobian(self, x, p):
        below = 1 + self.q * x * x
        slope = ((1 + x) * below - (x + x * x / 2) * 2 * self.q * x) / below**2
        return sparse.csr_array(self.linear + sparse.diags_array(p * self.inner_nodes * slope))

    def parameter_derivative(self, x, p):
        return self.inner_nodes * (1 + (x + x * x / 2) / (1 + self.q * x * x))


@pytest.mark.parametrize("n", [101, 201])
def test_the_folds_of_chan_are_followed_to_where_they_leave_to_infinity(n):
    """T. F. Chan's problem, of the tutorials of LOCA and BifurcationKit: a cusp at (0.0282077, 4.190666); one of its
    folds leaves to infinity as q falls to zero. Dense matrices are taken below 128 unknowns, sparse ones above."""
    start = np.array([i * (n - 1 - i) / n**2 + 0.1 for i in range(n)])
    fold = trace_curve(Chan(0.01, n), start, 3.3, (0.0, 4.2)).folds[0]
    folds = trace_folds(lambda q: Chan(q, n), fold, 0.01, (0.0, 0.1))
    (cusp,) = folds.cusps
    assert (cusp.q, cusp.parameter) == pytest.approx((0.0282077, 4.190666), rel=2e-4)
    assert (folds.status, len(folds.q) < 200) == ("complete", True)
    assert "approaches the edge of the parameter range" in folds.message
    assert folds.q.min() < 1e-8
    assert folds.x.max() > 1e4


class Circle(Problem):
    def __init__(self, centre):
        self.centre = centre

    def residual(self, x, p):
        return (x - self.centre) ** 2 + p * p - 1.0

    def jacobian(self, x, p):
        return np.diag(2 * (x - self.centre))


@pytest.mark.parametrize(("centre", "off"), [(0.0, 0.0), (2.0, 0.0), (2.0, 0.1), (2.0, 1e-6), (1000.0, 0.0)])
def test_a_curve_may_be_traced_from_its_fold(centre, off):
    curve = trace_curve(Circle(centre), [centre + off], 1.0, (-2.0, 2.0))
    assert curve.status == "complete"
    assert [fold.parameter for fold in curve.folds] == pytest.approx([1.0, -1.0], abs=1e-9)


def test_what_overflows_ends_a_curve_and_keeps_it():
    """Behind its fold at 1/e, x e^(−x) = p goes on to infinity as p falls to zero."""

    class Ricker(Problem):
        def residual(self, x, p):
            return p - x * np.exp(-x)

        def jacobian(self, x, p):
            return np.diag((x - 1) * np.exp(-x))

    curve = trace_curve(Ricker(), [0.5], 0.5 * math.exp(-0.5), (-1.0, 10.0))
    assert curve.status == "incomplete"
    assert [fold.parameter for fold in curve.folds] == pytest.approx([math.exp(-1)], abs=1e-12)


def test_an_interrupted_curve_is_kept():
    class Slow(Circle):
        left = 60

        def residual(self, x, p):
            self.left -= 1
            if not self.left:
                raise KeyboardInterrupt
            return super().residual(x, p)

    whole = trace_curve(Circle(0.0), [0.0], -1.0, (-2.0, 2.0))
    with pytest.raises(KeyboardInterrupt) as raised:
        trace_curve(Slow(0.0), [0.0], -1.0, (-2.0, 2.0))
    partial = raised.value.partial
    assert (partial.status, 2 < len(partial.points) < len(whole.points)) == ("incomplete", True)
