"""The two Abel integrals and their dependence on the rim, against closed forms and adaptive quadrature."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import beta, i0e, j0

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


def test_a_stretched_mesh_shares_its_matrices():
    mesh = Mesh(np.array([0.0, 0.5, 1.0, 3.0]), 9)
    stretched, anew = mesh.stretched(2.0).stretched(1.5), Mesh(3.0 * mesh.edges, 9)
    assert stretched.plane is mesh.plane
    for name in ("plane", "abel", "nodes", "weights"):
        np.testing.assert_allclose(getattr(stretched, name), getattr(anew, name), rtol=1e-12)
