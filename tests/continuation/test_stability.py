"""Eigenvalues along a curve, how many are unstable, and Hopf points: against closed forms and published values."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import root
from test_published import ChafeeInfante, PlaneBratu

from contbranch.continuation import Crossing, HopfPoint, Options, Outcome, StopAt, switch_branch, trace_curve
from contbranch.continuation.stability import _unstable_of_sparse

STEPS = [Options(), Options(largest_parameter_step=0.01), Options(angle=0.05)]


def reaction(ratio):
    """Demo ab of AUTO-07p: A. Uppal, W. H. Ray and A. B. Poore, Chem. Eng. Sci. 29 (1974) 967, with β = 3."""

    def f(x, p):
        e = p * (1 - x[0]) * math.exp(x[1])
        return [-x[0] + e, -x[1] + ratio * e - 3 * x[1]]

    def jacobian(x, p):
        e = math.exp(x[1])
        rate = np.array([-p * e, p * (1 - x[0]) * e])
        return np.array([rate, ratio * rate]) - np.diag([1.0, 4.0])

    return f, jacobian


def precisely(f, jacobian, near):
    """The Hopf point by Routh and Hurwitz: a coefficient condition on the characteristic polynomial, solved for."""

    def equations(z):
        c = np.poly(jacobian(z[:-1], z[-1]))
        return np.append(f(z[:-1], z[-1]), c[1] if len(c) == 3 else c[1] * c[2] - c[3])

    found = root(equations, near, tol=1e-14)
    assert np.abs(equations(found.x)).max() < 1e-9
    return found.x[-1]


@pytest.mark.parametrize("options", STEPS)
@pytest.mark.parametrize(
    ("ratio", "folds", "hopfs"),
    [(17, [0.121901, 0.117015], [0.120866, 0.217081]), (18, [0.111565, 0.0995741], [0.111153, 0.183834])],
)
def test_hopf_points_next_to_folds_of_the_reaction(ratio, folds, hopfs, options):
    """AUTO prints these limit points and Hopf points; the first of each lie in one step of the default length."""
    f, jacobian = reaction(ratio)
    curve = trace_curve(f, [0.0, 0.0], 0.0, (0.0, 0.25), options, jacobian=jacobian, stability=True)
    assert curve.status == "complete"
    assert [event.kind for event in curve.events] == ["hopf", "fold", "fold", "hopf"]
    assert [fold.parameter for fold in curve.folds] == pytest.approx(folds, abs=1e-6)
    assert [point.parameter for point in curve.hopf_points] == pytest.approx(hopfs, abs=1e-6)
    for point in curve.hopf_points:
        exact = precisely(f, jacobian, [*point.x, point.parameter])
        assert abs(point.parameter - exact) <= point.error < 1e-11
        values = np.linalg.eigvals(jacobian(point.x, point.parameter))
        assert abs(values.real).max() < 1e-11
        assert point.frequency == pytest.approx(abs(values[0].imag), rel=1e-9)
        assert curve.points[point.index] is point.point
        assert point.point.label == "hopf"


def test_unstable_parts_of_the_reaction():
    """At events the more stable side counts; between the points it is that of the eigenvalues half-way."""
    f, jacobian = reaction(18)
    curve = trace_curve(f, [0.0, 0.0], 0.0, (0.0, 0.25), jacobian=jacobian, stability=True)
    first, low, high, last = (event.index for event in curve.events)
    assert set(curve.unstable_between[:first]) == {0}
    assert list(curve.unstable_between[first:low]) == [2] * (low - first)
    assert set(curve.unstable_between[low:high]) == {1}
    assert set(curve.unstable_between[high:last]) == {2}
    assert set(curve.unstable_between[last:]) == {0}
    assert [curve.unstable[i] for i in (first, low, high, last)] == [0, 1, 1, 0]
    assert curve.eigenvalues.shape == (len(curve.points), 2)
    ordinary = np.setdiff1d(np.arange(len(curve.points)), [event.index for event in curve.events])
    assert np.array_equal((curve.eigenvalues.real > 0).sum(axis=1)[ordinary], curve.unstable[ordinary])
    assert np.all(np.diff(curve.eigenvalues.real, axis=1) <= 0)


def synapses(x, p):
    """M. Tsodyks, K. Pawelzik and H. Markram, Neural Comput. 10 (1998) 821; the tutorial of BifurcationKit.jl."""
    e, x, u = x
    z = (3.07 * u * x * e + p) / 1.5
    return [
        (-e + 1.5 * np.log1p(np.exp(z))) / 0.013,
        (1 - x) / 0.2 - u * x * e,
        (0.3 - u) / 1.5 + 0.3 * (1 - u) * e,
    ]


def synapses_jacobian(x, p):
    e, x, u = x
    gate = 1 / (1 + np.exp(-(3.07 * u * x * e + p) / 1.5))
    return np.array(
        [
            np.array([-1 + gate * 3.07 * u * x, gate * 3.07 * u * e, gate * 3.07 * x * e]) / 0.013,
            [-u * x, -1 / 0.2 - u * e, -x * e],
            [0.3 * (1 - u), 0.0, -1 / 1.5 - 0.3 * e],
        ]
    )


@pytest.mark.parametrize("options", STEPS)
def test_hopf_point_beside_the_fold_of_the_synapses(options):
    """Folds at E₀ = −1.46303 and −1.86522; Hopf points at −1.8501, behind the latter, and −1.1511."""
    start = [0.238616, 0.982747, 0.367876]
    curve = trace_curve(synapses, start, -2.0, (-4.0, -0.9), options, jacobian=synapses_jacobian, stability=True)
    assert [event.kind for event in curve.events] == ["fold", "hopf", "fold", "hopf"]
    assert [event.parameter for event in curve.events] == pytest.approx(
        [-1.46303, -1.8501, -1.86522, -1.1511], abs=1e-4
    )
    for point in curve.hopf_points:
        exact = precisely(synapses, synapses_jacobian, [*point.x, point.parameter])
        assert abs(point.parameter - exact) <= point.error < 1e-9
    ends = [0, *(event.index for event in curve.events), len(curve.points) - 1]
    parts = [set(curve.unstable_between[i:j]) for i, j in pairwise(ends)]
    assert parts == [{0}, {1}, {3}, {2}, {0}]


@pytest.mark.parametrize("gap", [0.2, 1e-2, 1e-4])
def test_a_pair_that_is_unstable_for_a_part_of_a_step(gap):
    """Real parts gap² − (p − 0.43)²: the ends of a longer step are alike. Errors hold, however flat the crossing."""

    def f(x, p):
        growth = gap**2 - (p - 0.43) ** 2
        return [growth * x[0] - 2 * x[1], 2 * x[0] + growth * x[1], p - x[2]]

    curve = trace_curve(f, np.zeros(3), 0.0, (0.0, 1.0), stability=True)
    exact = [0.43 - gap, 0.43 + gap]
    assert [event.kind for event in curve.events] == ["hopf", "hopf"]
    for point, p in zip(curve.hopf_points, exact, strict=True):
        assert abs(point.parameter - p) <= point.error
        assert point.frequency == pytest.approx(2.0, abs=1e-9)
    assert [curve.unstable[point.index] for point in curve.hopf_points] == [0, 0]
    assert 2 in curve.unstable_between


@pytest.mark.parametrize("seed", [0, 13, 22, 36, 67, 78, 85, 89, 111, 124])
def test_every_hopf_point_of_random_matrices(seed):
    """Along x = 0 eigenvalues collide, and change their order, within steps that see nothing of that."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(2, 7))
    parts = [generator.normal(size=(n, n)) for _ in range(3)]

    def matrix(p):
        return parts[0] + p * parts[1] + 0.5 * np.sin(3 * p) * parts[2]

    def jacobian(x, p):
        return matrix(p) - 3 * np.diag(x**2)

    curve = trace_curve(
        lambda x, p: matrix(p) @ x - x**3, np.zeros(n), -2.0, (-2.0, 2.0), jacobian=jacobian, stability=True
    )
    places = np.linspace(-2.0, 2.0, 4001)
    counts = (np.linalg.eigvals(np.array([matrix(p) for p in places])).real > 0).sum(axis=1)
    expected = places[:-1][np.abs(np.diff(counts)) == 2]
    assert [point.parameter for point in curve.hopf_points] == pytest.approx(list(expected), abs=1.1e-3)
    for point in curve.hopf_points:
        pair = np.linalg.eigvals(matrix(point.parameter))
        assert np.abs(pair.real).min() < 1e-11


def test_two_equal_pairs_are_one_hopf_point():
    """As where a symmetry makes them equal."""

    def f(x, p):
        block = np.array([[p, -3.0], [3.0, p]])
        return np.kron(np.eye(2), block) @ x

    curve = trace_curve(f, np.zeros(4), -1.0, (-1.0, 1.3), stability=True)
    (point,) = curve.hopf_points
    assert abs(point.parameter) <= point.error
    assert set(curve.unstable) == {0, 4}


@pytest.mark.parametrize("given", [True, False])
def test_eigenvalues_on_the_axis_all_along_are_no_hopf_points(given):
    """Oscillators without damping, in coordinates in which rounding moves their eigenvalues off the axis."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    springs = np.array([1.0, 2.0, 3.0]), np.array([1.0, 0.0, 0.0])

    def matrix(x, p):
        blocks = np.zeros((6, 6))
        blocks[:3, 3:], blocks[3:, :3] = np.eye(3), -np.diag(springs[0] + p * springs[1] + 3 * (turn.T @ x)[:3] ** 2)
        return turn @ blocks @ turn.T

    def f(x, p):
        q = turn.T @ x
        return turn @ np.append(q[3:], p - (springs[0] + p * springs[1]) * q[:3] - q[:3] ** 3)

    curve = trace_curve(f, np.zeros(6), 0.0, (-0.5, 2.0), jacobian=matrix if given else None, stability=True)
    assert curve.events == ()
    assert set(curve.unstable) == {0}


def test_neutral_saddles_are_no_hopf_points():
    """λ and −λ, real, pass p = 0."""
    curve = trace_curve(lambda x, p: [(1 + p) * x[0], -x[1]], np.zeros(2), -0.5, (-0.5, 1.0), stability=True)
    assert curve.events == ()
    assert set(curve.unstable) == {1}


@pytest.mark.parametrize("distance", [1.0, 1e-2, 1e-4])
def test_between_two_folds_of_one_step(distance):
    """p = x³ − 3 d² x: rows at both folds are those of the stable sides, what is between them is unstable."""
    curve = trace_curve(lambda x, p: p - x**3 + 3 * distance**2 * x, -2.0, -8.0, (-9.0, 9.0), stability=True)
    low, high = curve.folds
    assert set(curve.unstable_between[low.index : high.index]) == {1}
    assert set(curve.unstable_between[: low.index]) == set(curve.unstable_between[high.index :]) == {0}
    assert curve.unstable[low.index] == curve.unstable[high.index] == 0


def test_both_curves_through_a_pitchfork():
    problem = ChafeeInfante(20)
    trivial = trace_curve(problem, np.zeros(20), 0.5, (0.5, 12.0), stability=True)
    ends = [0, *(point.index for point in trivial.branch_points), len(trivial.points) - 1]
    parts = [set(trivial.unstable_between[i:j]) for i, j in pairwise(ends)]
    assert parts == [{0}, {1}, {2}, {3}]
    for k, point in enumerate(trivial.branch_points):
        (branch,) = switch_branch(trivial, point, (0.5, 12.0), stability=True)
        assert set(branch.unstable) == {k}


def brusselator(n, make):
    """X, Y with diffusion on (0, 1), fixed at the ends: M. Holodniok, P. Knedlík and M. Kubíček, Continuation of
    periodic solutions in parabolic differential equations (1987); the tutorial of BifurcationKit.jl. In the length."""
    a, b, own, other = 2.0, 5.45, 0.008, 0.004
    second = sparse.diags_array([np.ones(n - 1), np.full(n, -2.0), np.ones(n - 1)], offsets=[-1, 0, 1]) * (n + 1.0) ** 2
    edge = np.zeros(n)
    edge[[0, -1]] = (n + 1.0) ** 2

    def f(x, p):
        u, v = np.split(x, 2)
        rate = u * u * v
        return np.append(
            own / p**2 * (second @ u + a * edge) + rate - (b + 1) * u + a,
            other / p**2 * (second @ v + b / a * edge) + b * u - rate,
        )

    def jacobian(x, p):
        u, v = np.split(x, 2)
        cross, square = sparse.diags_array(2 * u * v), sparse.diags_array(u * u)
        one = sparse.eye_array(n)
        blocks = [
            [own / p**2 * second + cross - (b + 1) * one, square],
            [b * one - cross, other / p**2 * second - square],
        ]
        return make(sparse.block_array(blocks))

    def exact(k):
        """Where trace of mode k vanishes: b − 1 − a² = (own + other) μ/p², μ its eigenvalue of the differences."""
        return math.sqrt((own + other) * (2 * (n + 1) * math.sin(k * math.pi / (2 * n + 2))) ** 2 / (b - 1 - a * a))

    return f, jacobian, np.repeat([a, b / a], n), [exact(k) for k in (1, 2, 3)]


@pytest.mark.parametrize("make", [sparse.csr_array, sparse.coo_matrix, lambda matrix: matrix.toarray()])
def test_hopf_points_of_a_sparse_brusselator(make):
    """BifurcationKit has 0.512998, 1.0258 and 1.538 for its discretisation."""
    f, jacobian, start, exact = brusselator(66, make)
    curve = trace_curve(f, start, 0.3, (0.3, 1.7), jacobian=jacobian, stability=True)
    assert [event.kind for event in curve.events] == ["hopf"] * 3
    assert [point.parameter for point in curve.hopf_points] == pytest.approx([0.513, 1.0259, 1.5385], abs=2e-3)
    for point, p in zip(curve.hopf_points, exact, strict=True):
        assert abs(point.parameter - p) <= point.error + 1e-12
    assert curve.unstable[-1] == 6


def test_unstable_eigenvalues_of_a_sparse_matrix_far_from_zero():
    """As the solution peaks its one large eigenvalue is not among those nearest zero."""
    curve = trace_curve(PlaneBratu(14), np.zeros(196), 0.0, (0.0, 10.0), stability=True)
    ordinary = np.setdiff1d(np.arange(len(curve.points)), [event.index for event in curve.events])
    for i in ordinary:
        point = curve.points[i]
        values = np.linalg.eigvalsh(point.problem.jacobian(point.x, point.parameter).toarray())
        assert curve.unstable[i] == np.count_nonzero(values > 0)
    assert curve.unstable[-1] == 4
    assert curve.eigenvalues[-1].real.max() > 100


def test_bounds_that_do_not_help_are_said_to():
    """Eigenvalues of circulant advection fill an ellipse; no few of them hold the unstable ones."""
    n = 400
    shift = sparse.diags_array([1.0, 1.0], offsets=[-1, n - 1], shape=(n, n))
    assert _unstable_of_sparse(sparse.csc_array(5 * (shift - shift.T))) is None


def test_sparse_unstable_eigenvalues_of_random_matrices():
    for seed in range(5):
        generator = np.random.default_rng(seed)
        n = 300
        noise = sparse.random_array((n, n), density=0.01, rng=generator) * 4.0
        matrix = sparse.csc_array(noise - sparse.diags_array(generator.uniform(0, 400, n)))
        few, dense = _unstable_of_sparse(matrix), np.linalg.eigvals(matrix.toarray())
        assert few is not None
        assert np.sort(few.real[few.real > 0]) == pytest.approx(np.sort(dense.real[dense.real > 0]), abs=1e-8)


def test_hopf_points_among_other_events_and_with_a_stop():
    f, jacobian = reaction(18)
    level = Crossing(lambda x, p: x[0] - 0.31, name="level")
    how = {"jacobian": jacobian, "stability": True, "events": [level]}
    curve = trace_curve(f, [0.0, 0.0], 0.0, (0.0, 0.25), stop=StopAt(folds=1), **how)
    assert [event.kind for event in curve.events] == ["hopf", "level", "fold"]
    assert curve.outcome is Outcome.STOPPED_AT_FOLD
    assert isinstance(curve.events[0], HopfPoint)
    assert curve.unstable[-1] == 2  # on the side that was followed


def test_without_stability_nothing_is_computed():
    f, jacobian = reaction(18)
    curve = trace_curve(f, [0.0, 0.0], 0.0, (0.0, 0.25), jacobian=jacobian)
    assert curve.eigenvalues is None
    assert curve.unstable is None
    assert [event.kind for event in curve.events] == ["fold", "fold"]


def oxidation(x, p):
    """CO on platinum: V. I. Bykov, G. S. Yablonskii and V. F. Kim, Dokl. AN SSSR 242 (1978) 637; MatCont's manual."""
    a, b, c = x
    free = 1 - a - b - c
    return [
        2 * 2.5 * free**2 - 2 * a**2 - 10 * a * b,
        p * free - 0.1 * b - 10 * a * b,
        0.0675 * free - 0.4 * 0.0675 * c,
    ]


def neuron(x, p):
    """C. Morris and H. Lecar, Biophys. J. 35 (1981) 193, set of class I: J. Rinzel and G. B. Ermentrout, in C. Koch and
    I. Segev, Methods in Neuronal Modeling (1998)."""
    v, w = x
    calcium = 4.0 * (1 + math.tanh((v + 1.2) / 18)) / 2
    potassium, rate = (1 + math.tanh((v - 12) / 17.4)) / 2, math.cosh((v - 12) / 34.8) / 15
    return [(p - calcium * (v - 120) - 8 * w * (v + 84) - 2 * (v + 60)) / 20, rate * (potassium - w)]


PUBLISHED = {
    "oxidation": (
        (oxidation, [0.001137, 0.891483, 0.062345], 1.4, (0.8, 1.4)),
        [("hopf", 1.040991), ("fold", 1.052200), ("fold", 1.042049), ("hopf", 1.051556)],
    ),
    "neuron": ((neuron, [-60.0, 0.0], -20.0, (-60.0, 200.0)), [("fold", 39.963), ("fold", -9.949), ("hopf", 97.79)]),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_diagrams(name):
    given, expected = PUBLISHED[name]
    curve = trace_curve(*given, stability=True)
    assert curve.status == "complete"
    assert [event.kind for event in curve.events] == [kind for kind, _ in expected]
    for event, (_, p) in zip(curve.events, expected, strict=True):
        assert event.parameter == pytest.approx(p, rel=1e-4 if event.kind == "hopf" else 1e-5)
    jump = {"fold": 1, "hopf": 2}
    for event in curve.events:
        before, after = curve.unstable_between[event.index - 1 : event.index + 1]
        assert abs(int(after) - int(before)) == jump[event.kind]
