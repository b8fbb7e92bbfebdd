"""Problems that are published with other continuation tools, or were reported to them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import optimize, sparse

from contbranch.continuation import Options, Outcome, Problem, StopAt, switch_branch, trace_curve
from contbranch.continuation.deflation import search


class Indexed(Problem):
    def morse_index(self, x, p):
        return int((np.linalg.eigvals(np.asarray(self.jacobian(x, p))).real > 0).sum())


class ABReaction(Indexed):
    """A to B reactions: demo ab of AUTO-07p, with its parameter p2."""

    def __init__(self, p2):
        self.p2 = p2

    def residual(self, u, p):
        rate = p * (1 - u[0]) * np.exp(u[1])
        return np.array([-u[0] + rate, -u[1] + self.p2 * rate - 3 * u[1]])


@pytest.mark.parametrize(
    ("p2", "folds", "hopf"),
    [(16.0, [], None), (17.0, [0.121901, 0.117015], None), (18.0, [0.111565, 0.0995741], [0.111153, 0.183834])],
)
def test_ab(p2, folds, hopf):
    """At p2 = 16 two folds have just met; a Hopf bifurcation lies next to a fold at p2 = 18 (E. Doedel, AUTO-07p)."""
    curve = trace_curve(ABReaction(p2), [0.0, 0.0], 0.0, (0.0, 0.25))
    assert [fold.parameter for fold in curve.folds] == pytest.approx(folds, rel=3e-6)
    if hopf:
        changes = [event.parameter for event in curve.events if event.kind == "index change"]
        assert changes == pytest.approx(hopf, rel=1e-5)


class NeuralMass(Indexed):
    """The model of synaptic plasticity in BifurcationKit's tutorial (B. Cortes et al., PNAS 110 (2013) 16610)."""

    def residual(self, z, drive):
        e, x, u = z
        q = 3.07 * u * x * e + drive
        return np.array(
            [
                (-e + 1.5 * np.log(1 + np.exp(q / 1.5))) / 0.013,
                (1 - x) / 0.2 - u * x * e,
                (0.3 - u) / 1.5 + 0.3 * (1 - u) * e,
            ]
        )


@pytest.mark.parametrize("angle", [0.3, 0.05])
def test_neural_mass(angle):
    curve = trace_curve(NeuralMass(), [0.238616, 0.982747, 0.367876], -2.0, (-4.0, -0.9), Options(angle=angle))
    found = sorted((event.parameter, event.kind) for event in curve.events)
    assert [kind for _, kind in found] == ["fold", "index change", "fold", "index change"]
    assert [p for p, _ in found] == pytest.approx([-1.86522, -1.85013, -1.46303, -1.15106], abs=1e-4)


def test_carbon_monoxide():
    """Oxidation of CO (V. I. Bykov, G. S. Yablonskii and V. F. Kim 1978; tutorials of Matcont and BifurcationKit)."""

    class Bykov(Problem):
        def residual(self, u, q2):
            x, y, s = u
            z = 1 - x - y - s
            return np.array(
                [
                    5 * z**2 - 2 * x**2 - 10 * x * y,
                    q2 * z - 0.1 * y - 10 * x * y,
                    0.0675 * (z - 0.4 * s),
                ]
            )

    curve = trace_curve(Bykov(), [0.001137, 0.891483, 0.062345], 2.2, (0.5, 2.3))
    assert sorted(fold.parameter for fold in curve.folds) == pytest.approx([1.04204851, 1.05220029], abs=2e-8)


def test_morris_lecar():
    """Folds of the current (C. Morris and H. Lecar, Biophys. J. 35 (1981) 193), parameters of class I."""

    class MorrisLecar(Problem):
        def residual(self, z, current):
            v, w = z
            m = 0.5 * (1 + np.tanh((v + 1.2) / 18))
            rest = 0.5 * (1 + np.tanh((v - 12) / 17.4))
            ions = 2 * (v + 60) + 8 * w * (v + 84) + 4 * m * (v - 120)
            return np.array([(current - ions) / 20, (rest - w) * np.cosh((v - 12) / 34.8) / 15])

    curve = trace_curve(MorrisLecar(), [-60.0, 0.0], -20.0, (-60.0, 100.0))
    assert sorted(fold.parameter for fold in curve.folds) == pytest.approx([-9.949, 39.963], abs=1e-3)


class Chebyshev(Problem):
    """u'' + p exp(u) = 0, u(0) = u(1) = 0, by collocation: demo exp of AUTO-07p."""

    def __init__(self, n=20):
        k = np.arange(n + 1)
        x, c = np.cos(np.pi * k / n), np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
        first = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(n + 1))
        first -= np.diag(first.sum(1))
        self.second = 4 * (first @ first)[1:-1, 1:-1]

    def residual(self, u, p):
        return self.second @ u + p * np.exp(u)

    def jacobian(self, u, p):
        return self.second + np.diag(p * np.exp(u))

    def parameter_derivative(self, u, p):
        return np.exp(u)


def test_bratu_runs_to_infinity():
    """Past the fold (closed form 3.513830719) u grows without bound as p comes back to 0."""
    curve = trace_curve(Chebyshev(), np.zeros(19), 0.5, (-1.0, 5.0), Options(maximum_points=1500))
    assert [event.kind for event in curve.events] == ["fold"]
    assert curve.folds[0].parameter == pytest.approx(3.513830719, abs=2e-9)
    assert curve.ends[1].outcome is Outcome.RUNS_TO_INFINITY
    assert "infinity" in curve.message


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_poles_inside_the_range(power, unit):
    """x = (0.3 - p)^-power, without events on the way."""

    class Pole(Problem):
        def residual(self, x, p):
            return (x / unit) ** (1 / power) * (0.3 - p) - 1

        def jacobian(self, x, p):
            return np.diag((x / unit) ** (1 / power - 1) * (0.3 - p) / (power * unit))

    curve = trace_curve(Pole(), [unit / 1.3**power], -1.0, (-1.0, 1.0))
    assert curve.events == ()
    assert curve.outcome is Outcome.RUNS_TO_INFINITY
    assert curve.message.count("approaches 0.3.") == 1


def test_growth_over_many_magnitudes_is_no_run_to_infinity():
    class Grows(Problem):
        def residual(self, x, p):
            return x * np.exp(-40 * p) - 1e-20

    curve = trace_curve(Grows(), [1e-20], 0.0, (0.0, 4.0))
    assert curve.status == "complete"
    assert curve.x[-1] == pytest.approx(1e-20 * math.exp(160), rel=1e-6)


class AllenCahn(Problem):
    """0.1 u'' + p u + u³ - u⁵ = 0 on (-5, 5), u = 0 at the ends: demo acdc of pde2path."""

    def __init__(self, n=200):
        self.second = sparse.diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(n - 1, n - 1)) * (
            0.1 * n**2 / 100
        )
        self.second = sparse.csc_array(self.second)

    def residual(self, u, p):
        return self.second @ u + p * u + u**3 - u**5

    def jacobian(self, u, p):
        return self.second + sparse.diags_array(p + 3 * u**2 - 5 * u**4)

    def parameter_derivative(self, u, p):
        return u


def test_metastable_kink():
    """The kink's eigenvalue falls to 1e-10: along it Newton's corrections are rounding."""
    trivial = trace_curve(AllenCahn(), np.zeros(199), -0.3, (-0.5, 0.3))
    places = 0.1 * (np.arange(1, 6) * np.pi / 10) ** 2
    assert [point.parameter for point in trivial.branch_points] == pytest.approx(places, rel=5e-3)
    (kink,) = switch_branch(trivial, trivial.branch_points[1], (-0.5, 0.3))
    assert kink.status == "complete"
    assert list(kink.parameter[[0, -1]]) == [0.3, 0.3]
    assert [fold.parameter for fold in kink.folds] == pytest.approx([-0.1741148] * 2, abs=1e-6)
    u = kink.x[-1]
    assert np.abs(AllenCahn().residual(u, 0.3)).max() < 1e-9
    assert u[:99] == pytest.approx(-u[:99:-1], abs=1e-3)  # rounding of F over the eigenvalue, 1e-14/4e-11


def test_brusselator_turing_points():
    """A = 2, d = (1, 8) on (0, 16), no flux: mode k at B = (1 + d₁κ)(1 + A²/(d₂κ)), κ = (kπ/16)² (Prigogine, 1968)."""
    n, a, d1, d2, length = 40, 2.0, 1.0, 8.0, 16.0
    cosine = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(n)) / n)
    kappa = (np.arange(n) * np.pi / length) ** 2
    second = -cosine @ np.diag(kappa) @ np.linalg.inv(cosine)

    class Brusselator(Problem):
        def residual(self, z, b):
            u, v = z[:n], z[n:]
            return np.append(d1 * second @ u + a - (b + 1) * u + u**2 * v, d2 * second @ v + b * u - u**2 * v)

        def jacobian(self, z, b):
            u, v = z[:n], z[n:]
            own, other = np.diag(2 * u * v), np.diag(u**2)
            return np.block(
                [[d1 * second - (b + 1) * np.eye(n) + own, other], [b * np.eye(n) - own, d2 * second - other]]
            )

    start = np.append(np.full(n, a), np.full(n, 1.0 / a))
    curve = trace_curve(Brusselator(), start, 1.0, (1.0, 4.0))
    modes = (1 + d1 * kappa[1:]) * (1 + a**2 / (d2 * kappa[1:]))
    expected = np.sort(modes[modes < 4.0])
    assert len(expected) >= 5
    assert [point.parameter for point in curve.branch_points] == pytest.approx(expected, abs=1e-8)


class Multiple(Problem):
    """(p/k - 1) x - x³: BifurcationKit's test_bif_detection, k-fold at k = 1 ... 5, then 6, 6.5, 6.75 and 6.875."""

    rates = 1 / np.array([k for k in range(1, 6) for _ in range(k)] + [6, 6.5, 6.75, 6.875])

    def residual(self, x, p):
        return -x + self.rates * x * p - x**3


@pytest.mark.parametrize("start", [0.0, 0.95, 9.9])
@pytest.mark.parametrize("base", [Problem, Indexed])
def test_branch_points_of_all_multiplicities(base, start):
    kind = type("Kind", (Multiple, base), {})
    curve = trace_curve(kind(), np.zeros(19), start, (-1.0, 10.0))
    assert curve.status == "complete"
    expected = [1, 2, 3, 4, 5, 6, 6.5, 6.75, 6.875]
    assert [point.parameter for point in curve.branch_points] == pytest.approx(expected, abs=1e-7)
    for point, place in zip(curve.branch_points, expected, strict=True):
        assert abs(point.parameter - place) <= point.error


@pytest.mark.parametrize("unit", [1e6, 1.0, 1e-4, 1e-8])
@pytest.mark.parametrize("other", [False, True])
def test_type_of_a_branch_point_has_no_units(unit, other):
    class Transcritical(Problem):
        def residual(self, x, p):
            return x * (p - unit * x)

    start = -1.0 / unit if other else 0.0
    curve = trace_curve(Transcritical(), [start], -1.0, (-1.0, 1.0))
    assert [point.type for point in curve.branch_points] == ["transcritical"]


@pytest.mark.parametrize(("x", "rate"), [(0.4, 2.0), (0.3, 1.0), (0.0, 0.5), (0.2, 0.6)])
def test_sis(x, rate):
    """x' = b x (1 - x) - x."""

    class SIS(Problem):
        def residual(self, x, p):
            return p * x * (1 - x) - x

    curve = trace_curve(SIS(), [x], rate, (0.1, 3.0))
    (point,) = curve.branch_points
    assert (point.type, point.parameter) == ("transcritical", pytest.approx(1.0, abs=1e-9))


def test_a_start_on_a_bifurcation_is_told():
    class Crossing(Problem):
        def residual(self, x, p):
            return x * (p - x)

    curve = trace_curve(Crossing(), [0.0], 0.0, (-1.0, 1.0))
    assert curve.outcome is Outcome.START_FAILED
    assert "bifurcation" in curve.message


class Coral(Problem):
    """Coral, macroalgae and turf (P. J. Mumby, Nature 450 (2007) 98; issue 55 of BifurcationKit.jl)."""

    def residual(self, x, p):
        m, c = x
        t = 1 - m - c
        return np.array([0.1 * m * c - p * m / (m + t) + 0.8 * m * t, t * c - 0.44 * c - 0.1 * m * c])


@pytest.mark.parametrize("start", [[0.2, 0.6], [0.0, 0.56]])
def test_a_state_that_is_constant_but_for_rounding(start):
    curve = trace_curve(Coral(), start, 0.01, (0.01, 1.0))
    assert curve.status == "complete"
    assert [point.parameter for point in curve.branch_points] == pytest.approx([0.17952], abs=1e-9)


def test_constant_states_from_many_starts():
    """x (p - 1) - x² = 0 and y² = y₀²."""

    class Two(Problem):
        def __init__(self, y):
            self.y = y

        def residual(self, z, p):
            return np.array([z[0] * (p - 1) - z[0] ** 2, z[1] ** 2 - self.y**2])

    rng = np.random.default_rng(1)
    for _ in range(40):
        x, y, p = rng.uniform([-0.5, 0.1, -1.0], [0.5, 2.0, 0.5])
        curve = trace_curve(Two(y), [x, 1.2 * y], p, (-1.0, 3.0))
        assert curve.status == "complete"
        assert [point.parameter for point in curve.branch_points] == pytest.approx([1.0], abs=1e-9)


def test_deflation_with_a_sparse_jacobian():
    class Squares(Problem):
        def residual(self, x, p):
            return x**2 - p

        def jacobian(self, x, p):
            return sparse.diags_array(2 * x)

    found = search(Squares(), 1.0, [np.array([1.0, 1.0])], [np.array([0.5, -0.7])])
    assert sorted(tuple(np.round(x)) for x in found) == [(-1, -1), (-1, 1), (1, -1)]


def test_catenary():
    """y y'' = 1 + y'² with y(0) = 1 and y(1) = p: the lowest end of a catenary, in closed form beside it.

    Of y = cosh(x cosh u - u) / cosh u the end is p(u), whose minimum is the fold, 0.58708493.
    """
    n = 24
    k = np.arange(n + 1)
    x, c = np.cos(np.pi * k / n), np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
    first = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(n + 1))
    first -= np.diag(first.sum(1))
    first *= 2.0

    def catenary(inner, end):
        y = np.concatenate([[end], inner, [1.0]])
        return (y * (first @ first @ y) - 1 - (first @ y) ** 2)[1:-1]

    def end(u):
        return np.cosh(np.cosh(u) - u) / np.cosh(u)

    lowest = optimize.minimize_scalar(end, bounds=(1.0, 2.0), method="bounded", options={"xatol": 1e-9}).fun
    start = np.cosh(0.5 * (x[1:-1] + 1.0) * np.cosh(0.5) - 0.5) / np.cosh(0.5)
    curve = trace_curve(catenary, start, end(0.5), (0.0, 2.0))
    assert curve.status == "complete"
    (fold,) = curve.folds
    assert lowest == pytest.approx(0.58708493, abs=5e-9)
    assert fold.parameter == pytest.approx(lowest, abs=1e-8)


def test_fronts_of_rolls_snake():
    """Folds of r u - (1 + ∂²)² u + 2 u³ - u⁵ = 0 with wide localised rolls: the ends of the pinning region.

    -0.7126 and -0.6267 (J. Burke and E. Knobloch, Chaos 17 (2007) 037102).
    """
    n, length = 96, 16 * np.pi
    x, wave = (np.arange(n) + 0.5) * length / n, np.arange(n) * np.pi / length
    cosine = np.cos(np.outer(x, wave))
    linear = cosine @ np.diag((1 - wave**2) ** 2) @ np.linalg.inv(cosine)

    class Rolls(Problem):
        def residual(self, u, r):
            return r * u - linear @ u + 2 * u**3 - u**5

        def jacobian(self, u, r):
            return np.diag(r + 6 * u**2 - 5 * u**4) - linear

    for width in (15.0, 20.0):
        front = 1.35 * np.cos(x) / (1 + np.exp((x - width) / 1.5))
        curve = trace_curve(
            Rolls(), front, -0.66, (-0.8, -0.5), Options(detect_branch_points=False), stop=StopAt(folds=4)
        )
        folds = [fold.parameter for fold in curve.folds][-6:]
        assert sorted(folds) == pytest.approx([-0.7126] * 3 + [-0.6267] * 3, abs=1e-4)


@pytest.mark.parametrize("start", [(0.8, 0.1), (0.3, 0.3), (1.0, 0.0)])
@pytest.mark.parametrize("recovery", [0.3, 1.0])
def test_sir(start, recovery):
    """S' = m (1 - S) - b S I, I' = b S I - (g + m) I: disease-free up to the threshold b = g + m, endemic beyond."""
    birth = 0.1

    def sir(x, contacts):
        s, i = x
        return np.array([birth * (1 - s) - contacts * s * i, contacts * s * i - (recovery + birth) * i])

    free = trace_curve(sir, start, 0.05, (0.0, 4.0))
    assert free.status == "complete"
    (threshold,) = free.branch_points
    assert threshold.parameter == pytest.approx(recovery + birth, abs=1e-9)
    assert threshold.type == "transcritical"
    (endemic,) = switch_branch(free, threshold, (0.0, 4.0))
    s, i = endemic.x[np.argmax(endemic.parameter)]
    assert endemic.parameter.max() == 4.0
    assert (s, i) == pytest.approx(((recovery + birth) / 4.0, birth / (recovery + birth) - birth / 4.0), abs=1e-9)
