"""The two Abel integrals and their dependence on the rim, against closed forms and adaptive quadrature."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import beta, ellipe, ellipkm1, i0e, j0

from contbranch.models.axisymmetric.mesh import Mesh
from contbranch.models.axisymmetric.rim import Rim

EDGES = np.concatenate([[0.0], 0.015625 * 2.0 ** np.arange(7), [1.6, 2.2, 2.8, 3.4, 4.0]])
END = EDGES[-1]
RADII = [0.0, 1e-9, 1e-5, 1e-3, 0.02, 0.031, 0.032, 0.3, 2.0, 40.0, 3e3]
"""On both sides of the innermost panel (1/64) and of twice its length, where the rule for it changes."""


def integral(function, places) -> float:
    """Adaptive quadrature from the first to the last of the places, split at those between."""
    edges = sorted({min(place, places[-1]) for place in places})
    return sum(quad(function, *piece, epsabs=1e-15, epsrel=1e-13)[0] for piece in pairwise(edges))


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return Mesh(EDGES, 18)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (lambda t: np.ones_like(t), lambda r: np.ones_like(r)),
        (lambda t: t**2, lambda r: r**2 / 2),
        (lambda t: t**6, lambda r: 5 * r**6 / 16),
        (lambda t: np.exp(-(t**2) / 2), lambda r: i0e(r**2 / 4)),
        (lambda t: np.cos(3 * t), lambda r: j0(3 * r)),
    ],
    ids=["1", "t^2", "t^6", "gauss", "cos"],
)
def test_plane_integral_of_known_functions(mesh, function, expected):
    # (2/π) ∫_0^{π/2} f(r sin θ) dθ: Wallis' product, e^{-r²/4} I0(r²/4), J0.
    expected = expected(mesh.nodes)
    assert mesh.plane @ function(mesh.nodes) == pytest.approx(expected, abs=2e-13 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (lambda s: np.ones_like(s), lambda x, t: 2 * x),
        (lambda s: s**2, lambda x, t: 2 * (x**3 / 3 + t**2 * x)),
        (lambda s: END**2 - s**2, lambda x, t: 4 * x**3 / 3),
        (lambda s: 1 / (1 + s**2), lambda x, t: 2 * np.arctan(x / np.sqrt(1 + t**2)) / np.sqrt(1 + t**2)),
    ],
    ids=["1", "s^2", "hertz-like", "lorentz"],
)
def test_abel_integral_up_to_the_last_edge(mesh, function, expected):
    # With s² = t² + x² it is 2 ∫_0^X p dx, X² = END² − t².
    t = mesh.nodes
    expected = expected(np.sqrt(END**2 - t**2), t)
    assert mesh.abel @ function(t) == pytest.approx(expected, abs=3e-12 * np.abs(expected).max())


def test_abel_undoes_plane(mesh):
    # f = w' of w(r) = e^{-r²}: h(t) = w(0) + t ∫ w'(s)/√(t²−s²) ds, and then plane h = w; h is Dawson's function.
    from scipy.special import dawsn

    t = mesh.nodes
    h = 1 - 2 * t * dawsn(t)
    assert mesh.plane @ h == pytest.approx(np.exp(-(t**2)), abs=1e-12)


def test_interpolation_derivative_and_the_finer_mesh(mesh):
    values = np.sin(2 * mesh.nodes) + mesh.nodes**3
    points = np.linspace(0.0, END, 37)
    assert mesh.interpolate(values, points) == pytest.approx(np.sin(2 * points) + points**3, abs=2e-11)
    assert mesh.interpolate(values, np.array([END + 1e-9])) == pytest.approx(0.0)
    slope = 2 * np.cos(2 * mesh.nodes) + 3 * mesh.nodes**2
    assert mesh.derivative(values) == pytest.approx(slope, abs=3e-9)
    fine = mesh.finer
    inside = fine.nodes <= END
    assert fine.edges[-1] > END
    carried = mesh.to_finer @ values
    assert carried[inside] == pytest.approx((np.sin(2 * fine.nodes) + fine.nodes**3)[inside], abs=2e-11)
    assert carried[~inside] == pytest.approx(0.0)


@pytest.mark.parametrize("a", RADII)
def test_rim_operators_of_polynomials(mesh, a):
    # Parabola and constant: theory (Sneddon) gives (2/π)[(r²/2 − a²) arccos(a/r) + aρ/2] and (2/π) arccos(a/r).
    rim, rho = Rim(mesh, a), mesh.nodes
    r2 = a * a + rho * rho
    angle = np.arctan2(rho, a)
    ones, square = np.ones_like(rho), rho**2
    assert rim.plane @ ones == pytest.approx(2 / np.pi * angle, rel=1e-12)
    if a < 3.0:  # beyond, the closed form loses digits
        expected = 2 / np.pi * ((r2 / 2 - a * a) * angle + a * rho / 2)
        assert rim.plane @ square == pytest.approx(expected, abs=1e-12 * expected.max())
    end = np.hypot(a, END)
    length = END**2 / (end + a)
    assert rim.weights @ ones == pytest.approx(length, rel=1e-13)
    # ∫ (t² − a²) dt = length² (a + length/3)
    assert rim.weights @ square == pytest.approx(length**2 * (a + length / 3), rel=1e-12)


@pytest.mark.parametrize("a", RADII)
def test_rim_operators_of_an_analytic_function(mesh, a):
    rim = Rim(mesh, a)
    values = np.exp(-mesh.nodes)  # not even: only the panels further out may see that it is not
    even = np.cos(mesh.nodes) * np.exp(-(mesh.nodes**2) / 4)
    result, total = rim.plane @ even, rim.weights @ even
    for k in (0, 9, 17, 18, 60, 119, 180, 215):
        rho = mesh.nodes[k]

        def integrand(tau, rho=rho):
            # tau = rho sin(theta); dt = tau dtau/t
            x = rho * np.sin(tau)
            factor = x / np.hypot(a, x) if a > 0 else 1.0
            return 2 / np.pi * np.cos(x) * np.exp(-(x**2) / 4) * factor

        split = [s * a / rho for s in (0.3, 1.0, 3.0, 10.0, 100.0, 1e3, 1e4, 1e5)] if a > 0 else []
        expected = integral(integrand, [0.0, *split, np.pi / 2])
        assert result[k] == pytest.approx(expected, rel=1e-11, abs=1e-15)

    def along(tau):
        return np.cos(tau) * np.exp(-(tau**2) / 4) * (tau / np.hypot(a, tau) if a > 0 else 1.0)

    expected = integral(along, [0.0, *(s * a for s in (0.1, 1.0, 10.0, 100.0, 1e4)), END])
    assert total == pytest.approx(expected, rel=1e-11)
    assert np.isfinite(rim.plane @ values).all()


@pytest.mark.parametrize("a", [1e-6, 1e-3, 0.02, 0.031, 0.032, 0.3, 2.0, 40.0])
def test_slopes_with_the_square_of_the_radius(mesh, a):
    # Derivatives, at fixed rho, of the closed forms for f = tau² by mpmath with 50 digits.
    rim, rho = Rim(mesh, a), mesh.nodes
    slope = rim.plane_slope(rho**2)
    with mpmath.workdps(50):
        for k in (0, 17, 18, 60, 215):
            x = mpmath.mpf(rho[k])

            def plane(c, x=x):
                b = mpmath.sqrt(c)
                return 2 / mpmath.pi * (((c + x * x) / 2 - c) * mpmath.atan2(x, b) + b * x / 2)

            expected = float(mpmath.diff(plane, mpmath.mpf(a) ** 2, h=mpmath.mpf(a) ** 2 * mpmath.mpf(10) ** -15))
            # near the centre of a tiny contact the slope is a difference of large numbers
            assert slope[k] == pytest.approx(expected, rel=1e-9, abs=1e-13)

        def total(c):
            b = mpmath.sqrt(c)
            end = mpmath.sqrt(c + mpmath.mpf(END) ** 2)
            return (end**3 - b**3) / 3 - c * (end - b)

        def ones(c):
            return mpmath.sqrt(c + mpmath.mpf(END) ** 2) - mpmath.sqrt(c)

        c = mpmath.mpf(a) ** 2
        step = c * mpmath.mpf(10) ** -15
        expected = float(mpmath.diff(total, c, h=step))
        # ∫ f dt moves by −f(0)/(2a) at its lower end, which is left out
        free = float(mpmath.diff(ones, c, h=step) + 1 / (2 * mpmath.mpf(a)))
    assert rim.weights_slope(rho**2) == pytest.approx(expected, rel=1e-11)
    assert rim.weights_slope(np.ones_like(rho)) == pytest.approx(free, rel=1e-10)


def test_slope_of_a_general_even_function_by_differences(mesh):
    rho = mesh.nodes
    f = rho**2 / (1 + rho**2) * np.cos(rho)
    for a in (0.005, 0.3, 2.0):
        c, step = a * a, 3e-3 * a * a

        def plane(c):
            return Rim(mesh, np.sqrt(c)).plane @ f

        expected = (8 * (plane(c + step) - plane(c - step)) - (plane(c + 2 * step) - plane(c - 2 * step))) / (12 * step)
        assert Rim(mesh, a).plane_slope(f) == pytest.approx(expected, abs=3e-9 * np.abs(expected).max() + 2e-9)


def test_first_touch_is_the_limit_of_small_contacts(mesh):
    even = np.exp(-(mesh.nodes**2))
    apart = Rim(mesh, 0.0)
    for a in (1e-3, 1e-5, 1e-7):
        near = Rim(mesh, a)
        assert near.weights @ even == pytest.approx(apart.weights @ even, abs=1.1 * a)
        far = mesh.nodes > 0.5
        assert (near.plane @ even)[far] == pytest.approx((apart.plane @ even)[far], abs=2 * a)


@pytest.mark.parametrize("order", [8, 11, 17])
def test_abel_integrals_of_polynomials_on_uneven_panels(order):
    """Polynomials of full degree, on panels of many shapes, against integrals in closed form: to rounding on each."""
    mesh = Mesh(np.array([0.0, 0.01, 0.2, 0.21, 0.5, 0.5004, 0.9, 2.0, 2.001, 5.0]), order)
    rho, last = mesh.nodes, mesh.edges[-1]

    def error(found, exact):
        off, scale = (np.abs(values).reshape(mesh.panels, order).max(axis=1) for values in (found - exact, exact))
        return float((off / scale).max())

    for k in (0, 1, order - 1):  # ∫_0^rho tau^k / √(rho² − tau²) dtau
        assert error(mesh.plane @ rho**k, rho**k * beta((k + 1) / 2, 0.5) / np.pi) < 1e-13
    for k in (0, 1, (order - 1) // 2):  # ∫_tau^R 2 sigma (R² − sigma²)^k / √(sigma² − tau²) dsigma
        exact = (last**2 - rho**2) ** (k + 0.5) * beta(k + 1, 0.5)
        assert error(mesh.abel @ (last**2 - rho**2) ** k, exact) < 1e-13


@pytest.mark.parametrize("roots", [(), (2,)])
def test_a_stretched_mesh_shares_its_matrices(roots):
    mesh = Mesh(np.array([0.0, 0.5, 1.0, 3.0]), 9, roots=roots)
    stretched, anew = mesh.stretched(2.0).stretched(1.5), Mesh(3.0 * mesh.edges, 9, roots=roots)
    assert stretched.plane is mesh.plane
    for name in ("plane", "abel", "nodes", "weights", "scale"):
        np.testing.assert_allclose(getattr(stretched, name), getattr(anew, name), rtol=1e-12)


ROOTED = np.array([0.0, 0.12, 0.3, 0.45, 0.6, 0.72, 0.95, 1.2, 1.4, 1.55, 2.0])
INNER, OUTER = 4, 8
"""Edges of a mesh at which functions are polynomials in the square root of the distance: of a ring."""


@pytest.fixture(scope="module")
def rooted() -> Mesh:
    return Mesh(ROOTED, 14, roots=(INNER, OUTER))


def distances(mesh: Mesh, edge: int) -> np.ndarray:
    """Distances of the nodes from an edge, to all their digits; (N,)."""
    found, length = np.abs(mesh.nodes - mesh.edges[edge]).reshape(mesh.panels, -1), np.diff(mesh.edges)
    found[edge - 1] = length[edge - 1] * mesh.shares[edge][::-1]
    found[edge] = length[edge] * mesh.shares[edge]
    return found.ravel()


def ring(mesh: Mesh) -> np.ndarray:
    """√((σ² − b²)(c² − σ²)) at the nodes from b to c, 0 elsewhere; (N,)."""
    b, c = mesh.edges[[INNER, OUTER]]
    product = distances(mesh, INNER) * (mesh.nodes + b) * distances(mesh, OUTER) * (mesh.nodes + c)
    return np.where((mesh.nodes > b) & (mesh.nodes < c), np.sqrt(product), 0.0)


def test_integrals_of_a_disc_that_ends_at_a_root(rooted):
    # Pressure 1 on a disc of radius e has h = 2 √(e² − τ²); its plane integral is that of an ellipse.
    e, r = rooted.edges[OUTER], rooted.nodes
    away = distances(rooted, OUTER) * (e + r)
    inside, root = r < e, np.sqrt(away)
    h = np.where(inside, 2 * root, 0.0)
    assert rooted.abel @ (1.0 * inside) == pytest.approx(h, abs=2e-14 * e)
    with np.errstate(invalid="ignore"):
        outside = r * ellipe((e / r) ** 2) - away / r * ellipkm1(away / r**2)
    exact = 4 / np.pi * np.where(inside, e * ellipe((r / e) ** 2), outside)
    assert rooted.plane @ h == pytest.approx(exact, abs=1e-12 * e)
    assert rooted.weights @ h == pytest.approx(np.pi * e**2 / 2, rel=1e-13)


def test_integral_of_a_ring_between_roots(rooted):
    # With σ² = τ² + v² it is 2 ∫ √((σ² − b²)(c² − σ²)) dv.
    (b, c), h = rooted.edges[[INNER, OUTER]], rooted.abel @ ring(rooted)
    with mpmath.workdps(30):
        inner, outer = mpmath.mpf(b) ** 2, mpmath.mpf(c) ** 2
        for k in (0, 20, 41, 50, 55, 56, 57, 63, 69, 70, 90, 111):
            square = mpmath.mpf(rooted.nodes[k]) ** 2

            def function(v, square=square):
                return 2 * mpmath.sqrt(abs((square + v * v - inner) * (outer - square - v * v)))

            begin, end = mpmath.sqrt(max(inner - square, 0)), mpmath.sqrt(outer - square)
            places = [begin + (end - begin) * mpmath.mpf(10) ** -j for j in (6, 4, 3, 2, 1)]
            exact = float(mpmath.quad(function, [begin, *places, end]))
            assert h[k] == pytest.approx(exact, abs=2e-11 * np.abs(h).max())
    assert h[112:] == pytest.approx(0.0)


def test_values_and_slopes_next_to_a_root(rooted):
    # √|r − e| (1 + r)
    e, away = rooted.edges[INNER], distances(rooted, INNER)
    near = slice((INNER - 1) * rooted.order, (INNER + 1) * rooted.order)
    values = np.sqrt(away) * (1 + rooted.nodes)
    slopes = np.sqrt(away) + np.sign(rooted.nodes - e) * (1 + rooted.nodes) / (2 * np.sqrt(away))
    assert rooted.derivative(values)[near] * np.sqrt(away)[near] == pytest.approx((slopes * np.sqrt(away))[near])
    points = np.array([0.46, 0.55, 0.599, 0.6, 0.6001, 0.65, 0.71])
    exact = np.sqrt(np.abs(points - e)) * (1 + points)
    assert rooted.interpolate(values, points) == pytest.approx(exact, abs=1e-12)
    nodes, weights = rooted.row(0.65)
    assert weights @ values[nodes] == pytest.approx(exact[5], abs=1e-12)
    assert rooted.jumps(values)[[INNER - 2, INNER - 1, INNER]] == pytest.approx(0.0, abs=1e-8)
    with pytest.raises(ValueError, match="root"):
        Mesh(ROOTED, 14, roots=(3, 4))


@pytest.mark.parametrize("bounded", [False, True])
def test_the_finer_mesh_tells_errors_next_to_roots(bounded):
    edges = ROOTED[: OUTER + 1] if bounded else ROOTED
    mesh = Mesh(edges, 10, bounded, (INNER, OUTER))
    fine = mesh.finer
    assert fine.edges[list(fine.roots)] == pytest.approx(edges[[INNER, OUTER]], abs=0)
    assert (fine.end == mesh.end) == bounded
    finest = fine.finer
    for function in (np.sqrt, lambda x: x**1.5, lambda x: x * np.log(x), lambda x: x**2 * np.log(x)):

        def plane(mesh, function=function):
            return mesh.plane @ (function(np.abs(mesh.nodes - ROOTED[INNER])) * np.cos(mesh.nodes) * (mesh.nodes < 1.4))

        best = finest.interpolate(plane(finest), fine.nodes)
        found, better = mesh.interpolate(plane(mesh), fine.nodes), plane(fine)
        off, left = (np.abs(values - best)[fine.nodes < 1.4].max() for values in (found, better))
        assert left < 0.1 * off + 1e-11
    values = np.sqrt(np.abs(mesh.nodes - ROOTED[INNER]))
    carried = np.where(fine.nodes <= mesh.end, np.sqrt(np.abs(fine.nodes - ROOTED[INNER])), 0.0)
    close = np.abs(fine.nodes - ROOTED[INNER]) < 0.1
    assert (mesh.to_finer @ values)[close] == pytest.approx(carried[close], abs=1e-12)
    assert mesh.from_finer(mesh.to_finer @ values) == pytest.approx(values, abs=1e-8)


@pytest.mark.parametrize("a", [0.0, 0.7])
def test_drift_of_a_mesh_with_roots(rooted, a):
    """Both integrals at fixed nodal values as edges move, those of roots among them, against differences."""
    rates = np.array([0.0, 0.0, 0.1, 0.5, 1.0, 0.9, -0.3, -0.2, 0.7, 0.4, 0.0])
    nodes = (rates[:-1, None] + np.diff(rates)[:, None] * rooted.shares).ravel()
    pressure = ring(rooted) + 0.3 * (rooted.nodes < ROOTED[OUTER])  # which jumps there
    profile = np.cos(rooted.nodes) + ring(rooted)

    def moved(step):
        mesh = Mesh(rooted.edges + step * rates, rooted.order, roots=rooted.roots)
        assert mesh.nodes == pytest.approx(rooted.nodes + step * nodes, abs=1e-15)
        return np.array([mesh.abel @ pressure, Rim(mesh, a).plane @ profile])

    h = 1e-4
    expected = (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h)
    found = rooted.abel_drift(pressure, rates[None], nodes[None])[0]
    assert found == pytest.approx(expected[0], abs=1e-9)
    targets = np.append(nodes, rates[list(rooted.roots)])
    found = Rim(rooted, a).drift(profile, rates[None], targets[None])[0][: rooted.size]
    assert found == pytest.approx(expected[1], abs=1e-9)


def test_rim_operators_with_roots(rooted):
    a, c, r = 0.7, rooted.edges[OUTER], rooted.nodes
    rim, root = Rim(rooted, a), np.sqrt(distances(rooted, OUTER) * (r + c))
    f = np.where(r < c, root, 0.0)
    assert rim.bent(f) == pytest.approx(rim.plane_to_targets @ f, abs=1e-14)
    for k in (0, 30, 60, 97, 98, 111, 112, 126, 139):
        end = min(1.0, c / r[k])

        def function(x, k=k, end=end):  # tau = rho sin(theta), and theta = its end − x²
            theta = np.arcsin(end) - x * x
            tau = r[k] * np.sin(theta)
            return 4 / np.pi * x * np.sqrt(max(c * c - tau * tau, 0.0)) * tau / np.hypot(a, tau)

        assert rim.plane[k] @ f == pytest.approx(integral(function, [0.0, np.sqrt(np.arcsin(end))]), abs=2e-12)
    square, step = a * a, 1e-3
    for name, slope in (("plane", rim.plane_slope(f - f[0])[: rooted.size]), ("weights", rim.weights_slope(f))):
        near = [
            getattr(Rim(rooted, np.sqrt(square + j * step)), name) @ (f - f[0] * (name == "plane"))
            for j in (-2, -1, 1, 2)
        ]
        expected = (8 * (near[2] - near[1]) - (near[3] - near[0])) / (12 * step)
        free = rooted.interpolate(f, np.zeros(1))[0] / (2 * a) * (name == "weights")
        assert slope == pytest.approx(expected + free, abs=1e-9)
