"""Identities that every equilibrium obeys: dV/dd = F, the virial of scaling, and translation."""

from __future__ import annotations

import numpy as np
import pytest
from followed import Followed

import contbranch as cb

CASES = [
    pytest.param(cb.Contact.reduced(cb.Exponential, 1.0), id="exponential"),
    pytest.param(cb.Contact.reduced(cb.Exponential, 16.0), id="exponential-16"),
    pytest.param(cb.Contact.reduced(cb.Exponential, 1.0, -1), id="exponential-repulsion"),
    pytest.param(cb.Contact.reduced(cb.Gauss, 1.0, -1), id="gauss-repulsion"),
    pytest.param(cb.Contact.reduced(cb.Gauss, 4.0, -1), id="gauss-repulsion-4"),
    pytest.param(cb.Contact.reduced(cb.Gauss, 4.0), id="gauss-4"),
    pytest.param(cb.Contact.reduced(cb.VanDerWaals, 1.0), id="van-der-waals"),
    pytest.param(cb.Contact.reduced(cb.VanDerWaals, 0.25, -1), id="van-der-waals-repulsion"),
    pytest.param(cb.Contact.reduced(cb.InverseSquare, 4.0), id="inverse-square-4"),
    pytest.param(
        cb.Contact(cb.Parabola(1.0), cb.VanDerWaals(1.0, 1.0) + cb.Exponential(-0.5, 0.5)).to_reduced(), id="sum"
    ),
]


TOLERANCE = 1e-8
"""Of the meshes of the trace, relative to max(1, |value|)."""


@pytest.fixture(scope="module", params=CASES)
def traced(request) -> Followed:
    return Followed(request.param, TOLERANCE, TOLERANCE, events=False)


def still(point):
    """The problem of a point on a mesh that does not move, the state there, and the parameter."""
    return *point.problem.still(point.x), point.parameter


def parts(problem, x, u):
    """Fields, load, displacement and energy of a solution."""
    equations = problem.equations
    fields = problem.fields(x, u)
    return fields, equations.load(fields), equations.displacement(fields), equations.energy(fields)


def work_scale(load: float, d: float) -> float:
    """What the errors of energies are compared with."""
    return max(1.0, abs(load)) * max(1.0, abs(d))


def test_the_trace_reaches_its_end(traced):
    assert traced.curve.complete, traced.curve.message
    assert (traced.curve.branch.load_error <= 1e-6 * np.maximum(1.0, np.abs(traced.curve.branch.load))).all()


def test_energy_is_the_work_of_the_load_along_the_branch(traced):
    """V grows by ∫ F dd from row to row: sixteen Gauss points a step, states solved anew."""
    z, w = np.polynomial.legendre.leggauss(16)
    curve, points = traced.curve, traced.points
    worst = []
    for k in range(len(points) - 1):
        start, end = points[k], points[k + 1]
        if start.parameter == end.parameter or start.parameter < -2.5:
            continue
        problem, x, _ = still(end)
        du = end.parameter - start.parameter
        work = 0.0
        for node, weight in zip(z[::-1], w[::-1], strict=True):
            share, width = (1 + node) / 2, weight * du / 2
            if start.parameter == 0.0:  # beyond first touch F and d have terms u^(3/2): smooth in the root of u
                share, width = share**2, width * 2 * share
            u = start.parameter + du * share
            x = problem.solve_at(x, u)
            slope = -np.linalg.solve(problem.jacobian(x, u), problem.parameter_derivative(x, u))
            _, rate = problem.rates(x, u, slope, 1.0)[:2]
            work += width * parts(problem, x, u)[1] * rate
        scale = work_scale(curve.branch.load[k + 1], curve.branch.displacement[k + 1])
        worst.append(abs(curve.branch.energy[k + 1] - curve.branch.energy[k] - work) / scale)
    assert len(worst) > 8
    assert max(worst) < 100 * TOLERANCE


def test_rates_and_the_derivative_of_the_energy(traced):
    """The rates of F and d are those of their values, and dV/du = F dd/du, by differences of fourth order."""
    for point in traced.points[2::3]:
        problem, x, u = still(point)
        step = 2e-3 * min(1.0, abs(u))
        if step == 0.0 or u < -2.5:
            continue
        if point.label and u == min(p.parameter for p in traced.points if p.parameter > 0.0):
            continue  # a fold between first touch and the next row, still on the mesh of the former
        x = problem.solve_at(x, u)  # rows are as exact as asked, differences of them would be less so
        tangent = -np.linalg.solve(problem.jacobian(x, u), problem.parameter_derivative(x, u))
        _, load, d, _ = parts(problem, x, u)
        load_rate, d_rate = problem.rates(x, u, tangent, 1.0)[:2]
        rows = []
        for shift in (-2, -1, 1, 2):
            v = u + shift * step
            rows.append(parts(problem, problem.solve_at(x + (v - u) * tangent, v), v)[1:])
        table = np.array(rows)
        slopes = (table[0] - table[3] - 8 * (table[1] - table[2])) / (12 * step)
        noise = np.abs(table).max(axis=0) * 1e-11 / step
        # Right behind first touch the rates of stiff contacts, too, are as exact as the mesh: to 5e-7 at worst.
        assert slopes[0] == pytest.approx(load_rate, rel=5e-7, abs=1e-8 + noise[0])
        assert slopes[1] == pytest.approx(d_rate, rel=5e-7, abs=1e-8 + noise[1])
        # The discretised energy is stationary up to the mesh's error, which is relative to the step's rates.
        scale = abs(load * d_rate) + abs(d * load_rate)
        assert slopes[2] == pytest.approx(load * d_rate, abs=1e-5 * scale + 1e3 * TOLERANCE + noise[2])


def test_virial_of_a_parabola(traced):
    """5V = 2dF + 3V_fr + 2 ∫ g p_fr d²r: lengths in the plane scaled by s, heights by s², at fixed R."""
    z, w = np.polynomial.legendre.leggauss(40)
    worst = []
    for point in traced.points[1:]:
        problem, x, u = still(point)
        equations = problem.equations
        fields, load, d, energy = parts(problem, x, u)
        a, mesh = fields.rim.radius, equations.mesh
        law = equations.interaction
        area = 2 * np.pi * mesh.weights * mesh.nodes
        touching = np.pi * a * a * float(law.evaluate(np.zeros(1)).energy[0])
        # Beyond the mesh the surface is that under a point force, w = F/(π r); r = end/x.
        end = np.hypot(a, mesh.edges[-1])
        x = (1 + z) / 2
        r = end / x
        gap = r * r / 2 - d + load / (np.pi * r)
        far = law.evaluate(gap)
        ring = 2 * np.pi * r * w / 2 * end / x**2
        surface = area @ fields.energy_density + touching + ring @ far.energy
        virial = area @ (fields.gap * fields.pressure) + ring @ (gap * far.pressure)
        worst.append(abs(5 * energy - 2 * d * load - 3 * surface - 2 * virial) / work_scale(load, d))
    assert max(worst) < 20 * TOLERANCE


def test_translation(traced):
    """h' = B_1 k A_1 (h' + ζ'), k = −v'': moved sideways, an equilibrium remains one; A_1 (h' + ζ') is g'."""
    distances = []
    for point in traced.points[1:]:
        problem, x, u = still(point)
        equations = problem.equations
        fields = problem.fields(x, u)
        if np.abs(fields.h).max() < 1e-2:
            continue
        a, mesh = fields.rim.radius, equations.mesh
        rho = mesh.nodes
        r = np.hypot(a, rho)
        # (A_1 f)(r) = (2/π) ∫_a^r (t/r) f dt/√(r² − t²), and h'(t) dt = h_τ dτ. For the parabola ζ' = 2t:
        slope = mesh.derivative(fields.h)
        gap_slope = mesh.plane @ (r * slope) / r
        gap_slope += 2 / np.pi * (r * np.arctan2(rho, a) + a * rho / r) if a > 0 else r
        # (B_1 f)(t) = 2 t ∫_t^∞ f ds/√(s² − t²), compared as functions of t
        moved = r * (mesh.abel @ (-fields.stiffness * gap_slope / r))
        weight = mesh.weights * rho / r
        distances.append(weight @ np.abs(slope * r / rho - moved) / (weight @ np.abs(moved)))
    assert len(distances) > 8
    assert max(distances) < 3e-3  # the derivative of the panels' polynomials at the sharp edge of a film
    assert np.median(distances) < 1e-4


def test_rates_of_a_mesh_that_misses_the_edge_of_its_tip_by_roundings():
    """Rates are derivatives of values; what a film would bear beyond the edge is none of them.

    A mesh that is stretched with a growing contact ends where the tip does but for many roundings.
    """
    contact = cb.Contact(cb.SphericalCap(2.0), cb.VanDerWaals(-1.0, 5.0)).to_reduced()
    traced = Followed(contact, TOLERANCE, TOLERANCE, events=False)
    points = [point for point in traced.points[1:-1] if point.problem.equations.contact]
    assert len(points) > 5
    for point in points[::3]:
        problem, h = point.problem.still(point.x)
        y = point.problem.fields(point.x, point.parameter).y
        rate = np.sin(1.0 + np.arange(h.size))
        for factor in (1.0, 1.0 - 3e-12):
            equations = problem.equations.stretched(factor)
            ahead, behind = (equations.fields(h + s * 1e-6 * rate, y + s * 1e-7) for s in (1.0, -1.0))
            load = (equations.load(ahead) - equations.load(behind)) / 2e-6
            displacement = (equations.displacement(ahead) - equations.displacement(behind)) / 2e-6
            fields = equations.fields(h, y)
            assert equations.rates(fields, rate, 0.1) == pytest.approx((load, displacement), abs=1e-6)
            # The edge stays where it is: stretching takes nothing over from beyond it.
            assert equations.rates(fields, rate, 0.1, 0.3)[1] == equations.rates(fields, rate, 0.1)[1]
