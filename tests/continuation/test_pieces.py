"""The pieces by themselves: bordered solves, root finding, metric, segments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from continuation_problems import graph
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from contbranch.continuation import Balance, Metric, SingularBorderedError, factorise, find_root
from contbranch.continuation.bordered import DenseBordered, MatrixFreeBordered, SparseBordered
from contbranch.continuation.curve import Point
from contbranch.continuation.segment import Segment
from contbranch.continuation.step import Hermite, Predictor


def bordered_example(n, seed):
    generator = np.random.default_rng(seed)
    jacobian = sparse.random_array((n, n), density=0.1, rng=generator) + sparse.diags_array(generator.normal(size=n))
    b, c, f = generator.normal(size=(3, n))
    return jacobian.toarray(), b, c, 0.3, f, -0.7


@pytest.mark.parametrize("seed", range(8))
def test_all_backends_solve_the_bordered_system(seed):
    jacobian, b, c, d, f, g = bordered_example(30, seed)
    full = np.block([[jacobian, b[:, None]], [c[None, :], np.array([[d]])]])
    expected = np.linalg.solve(full, np.append(f, g))
    expected_transposed = np.linalg.solve(full.T, np.append(f, g))
    dense = DenseBordered(jacobian, b, c, d)
    thin = SparseBordered(sparse.csr_array(jacobian), b, c, d)
    free = MatrixFreeBordered(aslinearoperator(jacobian), b, c, d)
    for solver in (dense, thin, free):
        np.testing.assert_allclose(np.append(*solver.solve(f, g)), expected, rtol=1e-9, atol=1e-10)
    for solver in (dense, thin):
        np.testing.assert_allclose(
            np.append(*solver.solve_transposed(f, g)), expected_transposed, rtol=1e-9, atol=1e-10
        )
        assert solver.determinant_sign() == np.sign(np.linalg.det(full))
    assert free.determinant_sign() is None
    assert free.solve_transposed(f, g) is None


def test_preconditioner_lets_gmres_converge():
    n = 400
    laplace = sparse.csc_array((sparse.eye_array(n, k=1) + sparse.eye_array(n, k=-1) - 2 * sparse.eye_array(n)) * n**2)
    b, c = np.ones(n), np.linspace(0, 1, n)
    exact = np.linalg.solve(laplace.toarray(), np.eye(n))
    solver = MatrixFreeBordered(aslinearoperator(laplace), b, c, 1.0, preconditioner=lambda v: exact @ v)
    reference = DenseBordered(laplace.toarray(), b, c, 1.0)
    u, a = solver.solve(b, 2.0)
    v, e = reference.solve(b, 2.0)
    np.testing.assert_allclose(u, v, rtol=1e-8, atol=1e-10)
    assert a == pytest.approx(e, rel=1e-8)


def test_factorise_chooses_by_kind_and_size():
    small, large = sparse.eye_array(10, format="csc"), sparse.eye_array(1000, format="csc")
    assert isinstance(factorise(np.eye(3), np.ones(3), np.ones(3), 0.0), DenseBordered)
    assert isinstance(factorise(small, np.ones(10), np.ones(10), 0.0), DenseBordered)
    assert isinstance(factorise(large, np.ones(1000), np.ones(1000), 0.0), SparseBordered)
    assert isinstance(factorise(aslinearoperator(small), np.ones(10), np.ones(10), 0.0), MatrixFreeBordered)


@pytest.mark.parametrize("n", [5, 300])
def test_singular_matrix_is_told(n):
    jacobian = sparse.csc_array(sparse.diags_array(np.append(np.ones(n - 2), [0.0, 0.0])))
    with pytest.raises(SingularBorderedError):
        factorise(jacobian, np.ones(n), np.ones(n), 0.0)


@pytest.mark.parametrize(
    ("function", "root"),
    [
        (lambda s: s**3 - 0.2, 0.2 ** (1 / 3)),
        (lambda s: math.exp(8 * s) - 20.0, math.log(20) / 8),
        (lambda s: math.atan(100 * (s - 0.77)), 0.77),
        (lambda s: s - 1e-9, 1e-9),
    ],
)
def test_find_root_in_few_evaluations(function, root):
    count = 0

    def counted(s):
        nonlocal count
        count += 1
        return function(s)

    assert find_root(counted, (0.0, function(0.0)), (1.0, function(1.0))) == pytest.approx(root, rel=1e-12, abs=1e-15)
    assert count <= 14


def test_find_root_leaves_what_noise_hides_and_finds_a_jump():
    """Rounding hides where a slowly changing function vanishes, but not where one leaps across zero."""
    places = []

    def noisy(s):
        places.append(s)
        return 1e-3 * (s - 0.3) + 1e-8 * math.sin(1e9 * s)

    assert find_root(noisy, (0.0, noisy(0.0)), (1.0, noisy(1.0))) == pytest.approx(0.3, abs=3e-5)
    assert len(places) <= 16
    for leap in (lambda s: math.copysign(2.0 - s, s - 0.7), lambda s: math.copysign(1e-3 + (s - 0.7) ** 2, s - 0.7)):
        assert find_root(leap, (0.0, leap(0.0)), (1.0, leap(1.0))) == pytest.approx(0.7, abs=1e-14)


def test_find_root_wants_a_bracket():
    with pytest.raises(ValueError, match="opposite sign"):
        find_root(lambda s: s, (1.0, 1.0), (2.0, 2.0))


def test_angle_is_accurate_when_small(scalar_point):
    metric = Metric(2.0, 3.0)
    u, v = np.array([2.0]), np.array([2.0 * math.cos(1e-9)])
    angle = metric.angle(scalar_point.problem, u, 0.0, v, 3.0 * math.sin(1e-9))
    assert angle == pytest.approx(1e-9, rel=1e-6)


def test_balance_forgets_but_keeps_a_floor():
    balance = Balance(1.0, 1.0)
    for _ in range(200):
        balance = balance.advance(1e-3, 0.0)
    assert balance.state == pytest.approx(1e-2, rel=1e-6)  # ten steps of 1e-3
    balance = balance.advance(0.0, 5.0)
    for _ in range(200):
        balance = balance.advance(1e-3, 0.0)
    assert balance.parameter == pytest.approx(0.05)  # a hundredth of the whole path


def test_segment_reproduces_a_cubic(scalar_point):
    """x = s³ - s, p = s² between s = 0.2 and 0.7: the Hermite cubic is exact when scaled tangents are derivatives."""

    def at(s):
        return Point(scalar_point.problem, np.array([s**3 - s]), s * s, np.array([3 * s * s - 1]), 2 * s)

    begin, end = at(0.2), at(0.7)
    segment = Segment(begin, end, Metric(1.0, 1.0))
    segment.scale_begin = segment.scale_end = 0.5
    for theta in (0.1, 0.5, 1.3):
        s = 0.2 + 0.5 * theta
        x, p = segment.at(theta)
        assert x[0] == pytest.approx(s**3 - s)
        assert p == pytest.approx(s * s)
        dx, dp = segment.direction(theta)
        assert dx[0] == pytest.approx(0.5 * (3 * s * s - 1))
        assert dp == pytest.approx(0.5 * 2 * s)


@pytest.fixture
def scalar_point():
    from continuation_problems import circle

    return Point(circle(), np.array([1.0]), 0.0, np.array([0.0]), 1.0)


def test_polynomials_through_values_and_slopes():
    """Through k places a polynomial of degree 2k - 1 is met exactly, and the next power misses by Π (s - s_i)²."""
    places = [0.0, -0.7, -1.9]
    for power in range(7):
        values, slopes = [s**power for s in places], [power * s ** (power - 1) if power else 0.0 for s in places]
        for count, (value, slope) in enumerate(Hermite(places, values, slopes).at(0.8), start=1):
            if power < 2 * count:
                assert value == pytest.approx(0.8**power, abs=1e-12)
                assert slope == pytest.approx(power * 0.8 ** (power - 1) if power else 0.0, abs=1e-12)
            elif power == 2 * count:
                assert 0.8**power - value == pytest.approx(math.prod((0.8 - s) ** 2 for s in places[:count]))


def test_steps_on_a_polynomial_graph_are_foretold_exactly():
    """Along the flat tangent at p = 0 the curve x = p⁵ is a polynomial, which three points and tangents determine."""
    problem = graph(lambda x: x, lambda x: 1.0)
    metric = Metric(1.0, 1.0)
    points = [Point(problem, np.array([p**5]), p, np.array([5 * p**4]), 1.0) for p in (-0.4, -0.2, 0.0)]
    predictor = Predictor(points, metric)
    foretold = predictor.at(0.3)
    assert len(foretold) == 3
    assert foretold[2][1] == pytest.approx(0.3)
    assert foretold[2][0][0] == pytest.approx(0.3**5, abs=1e-14)
    end = Point(problem, np.array([0.3**5]), 0.3, np.zeros(1), 1.0)
    factor, count = predictor.longest(0.3, predictor.constants(0.3, foretold, end), 3.0)
    assert (factor, count) == (3.0, 3)


def test_a_rough_root_takes_few_evaluations():
    asked = []

    def function(s):
        asked.append(s)
        return math.exp(s) - 2.0

    root = find_root(function, (0.0, -1.0), (1.0, math.e - 2), 1e-2, guess=0.694)
    assert root == pytest.approx(math.log(2), abs=1e-2)
    assert len(asked) == 1
