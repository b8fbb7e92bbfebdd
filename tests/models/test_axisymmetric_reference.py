"""Equilibria and their stability against an independent discretisation, and against the kernel in real space.

The reference represents h by global rational Chebyshev functions of xi = (tau² − L²)/(tau² + L²), tau² = t² − a². With
x = √(tau² + L²) tan(alpha) the Abel integral 2 ∫_0^∞ p(√(tau² + x²)) dx of such a function is a trigonometric
polynomial in alpha, so that the midpoint rule is exact. It has neither panels nor an end, and shares no code with the
model. In contact h has a tau⁴ log tau term, on which it converges algebraically: hence the tolerances there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebvander
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.special import ellipkm1

import contbranch as cb

Array = np.ndarray

leggauss = cache(np.polynomial.legendre.leggauss)


def composite(edges: Array, order: int = 24) -> tuple[Array, Array]:
    """Nodes and weights of Gauss–Legendre panels."""
    z, w = leggauss(order)
    half = np.diff(edges) / 2
    return (edges[:-1, None] + half[:, None] * (1 + z)).ravel(), (half[:, None] * w).ravel()


class Basis:
    """f(tau) = (1 − xi) Σ c_k T_k(xi), by its values at N Chebyshev nodes, for a rim of radius a."""

    def __init__(self, count: int, length: float, a: float) -> None:
        self.count, self.length, self.a = count, length, a
        angle = np.pi * (np.arange(count) + 0.5) / count
        coefficients = 2 / count * np.cos(np.outer(np.arange(count), angle))
        coefficients[0] /= 2
        self.to_coefficients = coefficients / (1 - np.cos(angle))
        self.tau = length / np.tan(angle / 2)
        self.centre = (2 * (-1.0) ** np.arange(count)) @ self.to_coefficients
        self.abel = self._abel()
        self.plane = np.array([self._plane_row(psi) for psi in np.pi - angle])
        self.integral = self._integral()

    def _functions(self, psi: Array) -> Array:
        """T_k at tau = L tan(psi/2), xi = −cos(psi)."""
        return chebvander(-np.cos(psi), self.count - 1)

    def _share(self, tau: Array) -> Array:
        """dt/dtau."""
        return tau / np.hypot(self.a, tau) if self.a > 0 else np.ones_like(tau)

    def _abel(self) -> Array:
        points = self.count + 2
        alpha = np.pi / 2 * (np.arange(points) + 0.5) / points
        root = np.hypot(self.tau, self.length)
        xi = 1 - 2 * (self.length / root)[:, None] ** 2 * np.cos(alpha) ** 2
        functions = chebvander(xi, self.count - 1)
        return (2 * np.pi * self.length**2 / root)[:, None] * functions.mean(axis=1) @ self.to_coefficients

    def _plane_row(self, end: float) -> Array:
        """(2/π) ∫_0^rho f dt/√(rho² − tau²), rho = L tan(end/2); psi = end (1 − u²) takes the root away."""
        uniform = np.linspace(0.0, 1.0, 2 + int(end * self.count / 8))
        graded = 1 - (1 - uniform[-2]) * 0.5 ** np.arange(1, 12)
        u, weights = composite(np.unique(np.concatenate([uniform, graded])))
        psi = end * (1 - u) * (1 + u)
        half = np.cos(psi / 2)
        root = np.sqrt(np.sin(end * u**2 / 2) * np.sin((end + psi) / 2)) / (np.cos(end / 2) * half)
        weights = weights * 2 * end * u / (2 * half**2) / root  # dtau / (L root)
        share = self._share(self.length * np.tan(psi / 2))
        return (2 / np.pi * weights * share * 2 * half**2) @ self._functions(psi) @ self.to_coefficients

    def _integral(self) -> Array:
        """∫_a^∞ f dt; (1 − xi) dtau = L dpsi."""
        uniform = np.linspace(0.0, np.pi, 2 + self.count // 6)
        psi, weights = composite(np.unique(np.concatenate([uniform, uniform[1] * 0.5 ** np.arange(1, 12)])))
        share = self._share(self.length * np.tan(psi / 2))
        return (self.length * weights * share) @ self._functions(psi) @ self.to_coefficients


@dataclass
class Reference:
    """An equilibrium of a unit parabola on a half space of modulus 1, at fixed contact radius or central gap."""

    load: float
    displacement: float
    index_displacement: int
    index_load: int
    distance: float  # of the eigenvalues from changing sign


def reference(law: cb.Interaction, state: cb.State, count: int, length: float) -> Reference:
    """The equilibrium with a state's contact radius (without contact: central gap); starts from its pressure."""
    a = state.contact_radius
    basis = Basis(count, length, a)
    rho, r = basis.tau, np.hypot(a, basis.tau)
    reach = 2 / np.pi * np.arctan2(rho, a) if a > 0 else np.ones(count)
    shape = r**2 / 2
    if a > 0:
        shape = 2 / np.pi * ((r**2 / 2 - a**2) * np.arctan2(rho, a) + a * rho / 2)
    shape = shape + (0.0 if a > 0 else state.central_gap)
    outside = state.r >= a
    h = basis.abel @ np.interp(r, state.r[outside], state.pressure[outside], right=0.0)
    gap_of = basis.plane - np.outer(reach, basis.centre)
    for _ in range(30):
        _, pressure, stiffness = law.evaluate(gap_of @ h + shape)
        matrix = np.eye(count) + (basis.abel * stiffness) @ gap_of
        step = np.linalg.solve(matrix, basis.abel @ pressure - h)
        h = h + step
        if np.abs(step).max() < 1e-11 * max(1.0, np.abs(h).max()):
            break
    else:
        raise AssertionError(f"the reference does not converge: {np.abs(step).max()}")
    d = float(basis.centre @ h) + (a * a if a > 0 else -state.central_gap)
    load = 2 * (d * a - a**3 / 3 + float(basis.integral @ h))
    # Second variation, in units of E: h and, under load control, d as one more unknown (k = −v'').
    stiffness = law.evaluate(gap_of @ h + shape).stiffness
    response = -(basis.abel * stiffness) @ basis.plane
    eigenvalues = 1 - np.linalg.eigvals(response).real
    # (π k s r dr)ᵀ A and a − π ∫ k s² r dr
    across = radial_integrals(basis, a)
    ring = -np.pi * stiffness * reach * across
    bordered = np.block(
        [
            [np.eye(count) - response, -(basis.abel @ (stiffness * reach))[:, None]],
            [(ring @ basis.plane)[None, :], np.array([[a - ring @ reach]])],
        ]
    )
    both = np.linalg.eigvals(bordered).real
    distance = min(np.abs(eigenvalues).min(), np.abs(both).min())
    return Reference(load, d, int((eigenvalues < 0).sum()), int((both < 0).sum()), float(distance))


def radial_integrals(basis: Basis, a: float) -> Array:
    """Weights of ∫_0^∞ f rho drho for f that decays faster than (1 − xi)²: rho drho = L²/(1 − xi)² dxi."""
    nodes = np.cos(np.pi * (np.arange(basis.count) + 0.5) / basis.count)
    angle = np.pi * (np.arange(basis.count) + 0.5) / basis.count
    k = np.arange(1, basis.count // 2)
    fejer = 2 / basis.count * (1 - 2 * (np.cos(2 * np.outer(angle, k)) / (4 * k**2 - 1)).sum(axis=1))
    return fejer * basis.length**2 / (1 - nodes) ** 2


def contact_of(law: cb.Interaction) -> cb.Contact:
    return cb.Contact(tip=cb.Parabola(1.0), interaction=law, modulus=1.0)


DLVO = cb.VanDerWaals(1.0, 1.0) + cb.Exponential(-0.5, 0.5)
CASES = [
    # law, where, N, L, tolerance relative to max(1, |value|): what the reference still changes by with N
    pytest.param(cb.Exponential(1.0, 1.0), {"contact_radius": 2.0}, 160, 2.0, 3e-9, id="exponential-contact"),
    pytest.param(cb.Exponential(1.0, 0.25), {"contact_radius": 0.2}, 200, 1.0, 1e-8, id="exponential-small-contact"),
    pytest.param(cb.Exponential(-1.0, 1.0), {"displacement": 1.0}, 100, 2.0, 1e-11, id="exponential-film"),
    pytest.param(
        cb.Exponential(-1.0, 1.0), {"contact_radius": 0.5}, 160, 2.0, 1e-8, id="exponential-repulsion-contact"
    ),
    pytest.param(cb.Gauss(-1.0, 1.0), {"displacement": 1.8}, 100, 2.0, 1e-11, id="gauss-film"),
    pytest.param(cb.Gauss(-1.0, 1.0), {"contact_radius": 0.35}, 160, 2.0, 1e-8, id="gauss-contact"),
    pytest.param(cb.Gauss(-1.0, 0.25), {"contact_radius": 0.7}, 240, 3.0, 2e-8, id="gauss-sharp-film"),
    pytest.param(cb.Gauss(1.0, 1.0), {"contact_radius": 1.0}, 160, 2.0, 1e-8, id="gauss-attraction"),
    pytest.param(cb.VanDerWaals(1.0, 1.0), {"contact_radius": 1.0}, 200, 2.0, 3e-9, id="van-der-waals-contact"),
    pytest.param(cb.VanDerWaals(1.0, 1.0), {"displacement": -1.5}, 140, 2.0, 1e-9, id="van-der-waals-apart"),
    pytest.param(cb.VanDerWaals(-1.0, 0.25), {"displacement": 5.0}, 160, 4.0, 1e-9, id="van-der-waals-film"),
    pytest.param(cb.InverseSquare(1.0, 4.0), {"displacement": -2.5}, 160, 3.0, 1e-9, id="inverse-square-apart"),
    pytest.param(cb.InverseSquare(-1.0, 1.0), {"contact_radius": 1.0}, 200, 4.0, 1e-8, id="inverse-square-contact"),
    pytest.param(DLVO, {"displacement": -1.5}, 140, 2.0, 1e-9, id="sum-apart"),
    pytest.param(DLVO, {"contact_radius": 1.0}, 200, 3.0, 2e-8, id="sum-contact"),
]


@pytest.mark.parametrize(("law", "where", "count", "length", "tolerance"), CASES)
def test_states_of_an_independent_discretisation(law, where, count, length, tolerance):
    state = cb.solve(contact_of(law), accuracy=1e-11, **where)
    found = reference(law, state, count, length)
    assert state.load == pytest.approx(found.load, rel=tolerance, abs=tolerance)
    assert state.displacement == pytest.approx(found.displacement, rel=tolerance, abs=tolerance)
    assert (state.unstable_displacement, state.unstable_load) == (found.index_displacement, found.index_load)
    assert state.residual < 1e-9


@pytest.mark.parametrize(
    ("law", "sign", "tabor", "length"),
    [
        (cb.Exponential, 1, 4.0, 1.0),
        (cb.Gauss, -1, 1.0, 2.0),
        (cb.VanDerWaals, -1, 1.0, 2.0),
        (cb.InverseSquare, 1, 4.0, 1.0),
        (cb.Gauss, 1, 4.0, 1.0),
        (cb.Exponential, -1, 1.0, 2.0),
    ],
    ids=lambda value: value.__name__ if isinstance(value, type) else None,
)
def test_morse_indices_of_an_independent_discretisation(law, sign, tabor, length):
    """On every piece between two folds: the number of eigenvalues of B k A above 1, without and with d set free."""
    contact = cb.Contact.reduced(law, tabor, sign)
    branch = cb.trace(contact, accuracy=1e-8, modes=0).branches[0]
    pairs = np.stack([branch.unstable_displacement, branch.unstable_load], axis=1)
    pieces = np.split(np.arange(len(branch)), 1 + np.flatnonzero((np.diff(pairs, axis=0) != 0).any(axis=1)))
    checked = set()
    for piece in pieces:
        rows = [row for row in piece if branch.load[row] < 50 and branch.central_gap[row] < 3][1:-1]
        for row in {rows[0], rows[len(rows) // 2], rows[-1]} if rows else set():
            found = reference(contact.interaction, branch.state(int(row)), 140, length)
            if found.distance < 1e-3:
                continue  # too close to a fold for so few functions
            indices = int(branch.unstable_displacement[row]), int(branch.unstable_load[row])
            assert indices == (found.index_displacement, found.index_load), f"row {row} of {len(branch)}"
            checked.add(indices)
    assert checked >= {tuple(map(int, pairs[piece[len(piece) // 2]])) for piece in pieces if len(piece) > 4}


@pytest.mark.parametrize(
    ("law", "where"),
    [
        (cb.Exponential(1.0, 1.0), {"contact_radius": 1.5}),
        (cb.Exponential(-1.0, 1.0), {"contact_radius": 1.0}),
        (cb.Gauss(-1.0, 1.0), {"displacement": 1.8}),
        (cb.Gauss(1.0, 1.0), {"contact_radius": 1.0}),
    ],
    ids=["exponential-attraction", "exponential-repulsion", "gauss-film", "gauss-attraction"],
)
def test_profiles_obey_boussinesq_in_real_space(law, where):
    """A ring of pressure p moves the surface at r by (4/π) p s ds K(m)/(r + s), m = 4 r s/(r + s)² (E = 1)."""
    state = cb.solve(contact_of(law), accuracy=1e-9, **where)
    pressure = CubicSpline(state.r, state.pressure)
    end = state.r[-1]

    def ring(s, r):
        return 4 / np.pi * float(pressure(s)) * s / (r + s) * ellipkm1(((r - s) / (r + s)) ** 2)

    a = state.contact_radius
    for r in (0.4, 0.9, 1.3, 2.0):
        places = sorted({0.0, r, end, *(x for x in (a, 0.99 * a, 1.01 * a, r - 1e-3, r + 1e-3) if 0 < x < end)})
        shift = sum(quad(ring, lo, hi, (r,), epsabs=1e-9, limit=200)[0] for lo, hi in pairwise(places))
        gap = 0.0 if r <= a else float(CubicSpline(state.r, state.gap)(r))
        assert r * r / 2 - state.displacement + shift == pytest.approx(gap, abs=2e-4)
    load = quad(lambda s: 2 * np.pi * s * float(pressure(s)), 0, end, points=[a] if a else None, limit=300)[0]
    assert load == pytest.approx(state.load, abs=2e-4 * max(1.0, abs(state.load)))
