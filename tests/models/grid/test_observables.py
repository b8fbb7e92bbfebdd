"""What is read off lattice equilibria: gaps, far field, profiles, energies; and what elasticity on a lattice is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lattice_cases import axisymmetric_start, displaced, from_axisymmetric, paraboloid, solved
from scipy.interpolate import PchipInterpolator
from scipy.special import erfc, ive

import contbranch as cb
from contbranch.models.grid import observables
from contbranch.models.grid.contact_area import contact_area
from contbranch.models.grid.lattice import IMAGE_SUM, Lattice
from studies.paper import fig04


def screened(exponent, x, y, terms=8):
    """Σ |R - (x, y)|^(-s) over the square lattice, s = 1 less its mean or s = 3, by the sum of Ewald.

    |R|^(-s) Γ(s/2) = ∫ t^(s/2-1) exp(-tR²) dt, cut at t = π, where both halves converge alike; with s = 1 the
    uniform background takes the term q = 0 away.
    """
    n = np.arange(-terms, terms + 1)
    first, second = np.meshgrid(n, n, indexing="ij")
    r = np.hypot(first - x, second - y)
    q = np.hypot(first, second)
    phase = np.cos(2.0 * math.pi * (first * x + second * y))
    far, waves = r > 1e-12, q > 0.0
    if exponent == 1:
        own = 0.0 if far.all() else -2.0
        near = np.sum(erfc(math.sqrt(math.pi) * r[far]) / r[far])
        return near + np.sum(phase[waves] * erfc(math.sqrt(math.pi) * q[waves]) / q[waves]) - 2.0 + own
    # s = 3: Γ(3/2, z)/Γ(3/2) = erfc(√z) + 2 √(z/π) e^(-z), and Γ(-1/2, z) = 2 e^(-z)/√z - 2 √π erfc(√z).
    z, k = math.pi * r[far] ** 2, math.pi * q**2
    near = np.sum((erfc(np.sqrt(z)) + 2.0 * np.sqrt(z / math.pi) * np.exp(-z)) / r[far] ** 3)
    safe = np.where(waves, k, 1.0)
    wave = np.where(waves, 2.0 * np.exp(-safe) / np.sqrt(safe) - 2.0 * math.sqrt(math.pi) * erfc(np.sqrt(safe)), 0.0)
    reciprocal = 2.0 * math.pi * np.sum(phase * np.sqrt(k) * wave) + 4.0 * math.pi
    return near + reciprocal - (0.0 if far.all() else 4.0 * math.pi / 3.0)


def test_sums_over_images():
    assert -screened(1, 0.0, 0.0) == pytest.approx(IMAGE_SUM, abs=1e-12)
    # Exact relations by the parity of the coordinates, which make (30) exact for a point force.
    corner, edge = screened(1, 0.5, 0.5), screened(1, 0.5, 0.0)
    assert corner == pytest.approx((math.sqrt(2.0) - 1.0) * -IMAGE_SUM, abs=1e-12)
    root = math.sqrt(2.0)
    assert (3.0 + 2.0 * root) * corner - (2.0 + 2.0 * root) * edge == pytest.approx(-IMAGE_SUM, abs=1e-11)
    assert screened(3, 0.0, 0.0) == pytest.approx(observables.CUBES, abs=1e-12)
    assert screened(3, 0.5, 0.5) == pytest.approx(fig04.AT_CORNER, abs=1e-11)
    assert screened(3, 0.5, 0.0) == pytest.approx(fig04.AT_EDGE, abs=1e-11)


def test_elasticity_is_positive_in_free_space():
    # E|q|/2 within 10 %, though the kernel ends at the edge of a square.
    lattice = Lattice("free", (3.0, 3.0), (128, 128), quarter=False)
    twice = Lattice("periodic", (6.0, 6.0), (256, 256), quarter=False)
    symbol, half = lattice.symbol, twice.symbol
    assert symbol[0, 0] == 0.0
    half[0, 0] = symbol[0, 0] = 1.0
    assert np.abs(symbol / half - 1.0).max() < 0.1
    # The mean of 1/(π r) over the square |x|, |y| < L.
    assert lattice.compliance == pytest.approx(2.0 * math.asinh(1.0) / (math.pi * 3.0), rel=2e-5)


def moved_in_free_space(pressure):
    """Displacements of the nodes of a cell of edge 1 in free space, which bear a pressure, by its transform."""
    grid = len(pressure)
    whole = np.pad(pressure, (0, grid))
    moved = np.fft.irfft2(np.fft.rfft2(whole) / Lattice("free", (1.0, 1.0), (grid, grid), quarter=False).held_symbol)
    return moved[:grid, :grid]


@pytest.mark.parametrize("grid", [32, 128])
def test_uniform_pressure_on_all_of_a_cell_in_free_space(grid):
    """Love's solution (Phil. Trans. R. Soc. A 228, 377, 1929); of first order, since the pressure jumps."""
    x = (np.arange(grid) + 0.5) / grid
    # Each node is a corner of four rectangles.
    sides = [(u[:, None], v[None, :]) for u in (x, 1.0 - x) for v in (x, 1.0 - x)]
    love = sum(u * np.arcsinh(v / u) + v * np.arcsinh(u / v) for u, v in sides) / math.pi
    assert np.abs(moved_in_free_space(np.ones((grid, grid))) / love - 1.0).max() < 0.1 / grid


def test_corners_of_a_cell_in_free_space_feel_each_other():
    """A Gaussian pressure by the closed form of its displacement, a modified Bessel function."""
    grid, width, middle = 64, 0.03, 0.15
    x = (np.arange(grid) + 0.5) / grid
    bump = np.exp(-(((x - middle) / width) ** 2) / 2.0)
    found = moved_in_free_space(np.outer(bump, bump))
    for node in ((45, 45), (63, 63), (9, 63)):  # up to 1.2 edges away
        square = sum((x[k] - middle) ** 2 for k in node) / (4.0 * width**2)
        assert found[node] == pytest.approx(width * math.sqrt(2.0 * math.pi) * ive(0, square), rel=3e-6)


def test_displacement_field_of_hertz():
    # w = [(2a² - r²) arcsin(a/r) + a √(r² - a²)]/π outside, a² - r²/2 inside (Johnson, Contact Mechanics, 3.4); d = a².
    problem = paraboloid("free", 7.0, 224)
    equilibrium = solved(problem, 4.0 / 3.0)
    axis = problem.lattice.axes[0][: problem.lattice.inside[0]]
    r = np.hypot(axis[:, None], axis[None, :])
    outside = np.maximum(r, 1.0)
    field = ((2.0 - r**2) * np.arcsin(1.0 / outside) + np.sqrt(outside**2 - 1.0)) / math.pi
    field = np.where(r < 1.0, 1.0 - 0.5 * r**2, field)
    own = equilibrium.u[: len(axis), : len(axis)] + equilibrium.displacement
    disc = r < 3.5
    assert np.abs(own - field)[disc].max() < 4e-4
    assert np.abs(own - field)[disc & (np.abs(r - 1.0) > 0.3)].max() < 4e-5
    assert abs(equilibrium.displacement - 1.0) < 2e-5


def test_central_gap_without_contact():
    # The axisymmetric model's gap; the repulsion keeps the surfaces apart, and the lattice is spectrally accurate.
    for grid, allowed in ((64, 3e-6), (128, 3e-8)):
        problem, equilibrium, state = from_axisymmetric("free", 15.0, grid, cb.Gauss, 1.0, -1, 4.0)
        gap, error = observables.central_gap(problem, equilibrium)
        assert state.central_gap > 0.3
        assert abs(gap - state.central_gap) < allowed
        assert abs(equilibrium.displacement - state.displacement) < 10.0 * allowed
    assert error < 1e-7
    # Between the nodes, and at them.
    lattice, u = problem.lattice, equilibrium.u
    assert observables.interpolate(lattice, u, lattice.axes[0][3], lattice.axes[0][40]) == pytest.approx(
        u[3, 40], abs=1e-12
    )
    near = problem.heights[0, 0] + u[0, 0]
    assert gap < near == observables.smallest_gap(equilibrium)


def test_gaps_in_contact():
    problem, equilibrium, state = from_axisymmetric("periodic", 16.0, 96, cb.Exponential, 1.0, 1, 3.0)
    assert observables.central_gap(problem, equilibrium) == (0.0, 0.0)
    assert observables.smallest_gap(equilibrium) == 0.0
    # Mean of z less that of the displacement w - d, whose mean is C F - d.
    heights = 16.0**2 / 12.0 * (1.0 - 1.0 / 96**2)
    mean = heights + IMAGE_SUM * 3.0 / (math.pi * 16.0) - equilibrium.displacement
    assert observables.mean_gap(problem, equilibrium) == pytest.approx(mean, rel=1e-12)
    assert state.central_gap == 0.0


FAR = [(None, 1.0, 1, 4.0 / 3.0, 4.0), (cb.Gauss, 1.0, -1, 4.0, 6.0), (cb.Exponential, 1.0, 1, 1.5625, 8.0)]


@pytest.mark.parametrize(("law", "tabor", "sign", "load", "smallest"), FAR)
def test_far_field_in_cells_of_any_size(law, tabor, sign, load, smallest):
    # Displacement in free space: Hertz, d = a², or the axisymmetric model.
    for edge in smallest * np.array([1.0, 1.5, 2.5]):
        if law is None:
            problem = paraboloid("periodic", edge, int(24 * edge))
            equilibrium, exact = solved(problem, load), 1.0
        else:
            problem, equilibrium, state = from_axisymmetric("periodic", edge, 128, law, tabor, sign, load)
            exact = state.displacement
        found = fig04.far_field(problem, equilibrium)
        assert found.displacement == equilibrium.displacement
        pairs = (
            (found.displacement, found.error),
            (found.from_points, found.from_points_error),
            (found.rounded, found.rounded_error),
        )
        for value, error in pairs:
            assert abs(value - exact) < error < 12.0 * abs(value - exact)
        assert found.error < found.from_points_error < found.rounded_error


def test_far_field_without_cell():
    problem = paraboloid("free", 6.0, 64)
    assert observables.far_field_error(problem, solved(problem, 1.0)) == 0.0


def test_profile_and_fields():
    problem, equilibrium, state = from_axisymmetric("free", 16.0, 128, cb.Gauss, 1.0, 1, 3.0)
    for points in (100, 2000):
        found = observables.profile(problem, equilibrium, points)
        assert found.r.size <= points
        assert (np.diff(found.r) > 0.0).all()
        assert found.r[-1] <= 8.0
    # The axisymmetric model's profiles (its gap is interpolated, and its pressure outside is that of the law).
    gap = PchipInterpolator(state.r, state.gap)(found.r)
    outside = (found.r > state.contact_radius + 0.3) & (found.r < 5.0)
    assert np.abs(found.gap - gap)[outside].max() < 1e-3
    assert np.abs(found.pressure - problem.law.evaluate(gap).pressure)[outside].max() < 1e-3
    inside = found.r < state.contact_radius - 0.3
    pressure = PchipInterpolator(state.r, state.pressure)(found.r)
    assert np.abs(found.pressure - pressure)[inside].max() < 3e-3
    assert np.abs(found.wall_pressure - pressure + problem.law.evaluate(0.0).pressure)[inside].max() < 3e-3
    inside = found.r < state.contact_radius - 0.1
    assert (found.wall_pressure[inside] > 0.0).all()
    assert (found.wall_pressure[found.r > state.contact_radius + 0.2] == 0.0).all()

    fields = observables.cell_fields(problem, equilibrium)
    assert fields.gap.shape == (128, 128)
    assert fields.x[0] == pytest.approx(-8.0 + 0.5 * problem.lattice.spacing)
    assert problem.lattice.spacing**2 * fields.pressure.sum() == pytest.approx(3.0, abs=1e-6)
    assert np.array_equal(fields.gap, fields.gap[::-1, ::-1])
    assert np.abs(fields.gap - fields.gap.T).max() < 1e-9
    assert ((fields.wall_pressure > 0.0) <= (fields.gap == 0.0)).all()


ENERGY = [
    ("free", cb.Gauss, 1, 16.0),
    ("periodic", cb.Gauss, -1, 9.0),
    ("periodic", cb.Exponential, 1, 9.0),
    ("free", cb.Exponential, -1, 14.0),
]


@pytest.mark.parametrize(("kind", "law", "sign", "edge"), ENERGY)
def test_slope_of_the_energy_is_the_load(kind, law, sign, edge):
    # dV/dd = F, by Simpson's rule over neighbouring equilibria under displacement control.
    problem, equilibrium, _ = from_axisymmetric(kind, edge, 64, law, 0.5, sign, 4.0)
    step = 2e-3
    path = [equilibrium]
    for k in (1, 2):
        path.append(displaced(problem, path[-1], equilibrium.displacement + k * step))
    energies = [problem.total_energy(e.fields) for e in path]
    work = step / 3.0 * (path[0].load + 4.0 * path[1].load + path[2].load)
    assert energies[2] - energies[0] == pytest.approx(work, rel=2e-5)


def test_energy_of_the_axisymmetric_model():
    # Without contact, where the lattice is spectrally accurate, and with it.
    problem, equilibrium, state = from_axisymmetric("free", 15.0, 96, cb.Gauss, 1.0, -1, 4.0)
    assert problem.total_energy(equilibrium.fields) == pytest.approx(state.energy, rel=1e-6)
    problem, equilibrium, state = from_axisymmetric("free", 18.0, 192, cb.Gauss, 1.0, 1, 1.0)
    assert problem.total_energy(equilibrium.fields) == pytest.approx(state.energy, abs=2e-3)


@pytest.mark.parametrize("kind", ["free", "periodic"])
def test_quarter_and_whole_are_the_same(kind):
    quarter, first, state = from_axisymmetric(kind, 14.0, 64, cb.Gauss, 1.0, 1, 2.0)
    whole = paraboloid(kind, 14.0, 64, quarter.law, quarter=False)
    start = axisymmetric_start(whole, state)
    if kind == "free":
        # The array's padding lies on one side: distances across its border.
        axis = (whole.lattice.axes[0] + 14.0) % 28.0 - 14.0
        r = np.hypot(axis[:, None], axis[None, :])
        start = np.interp(r, state.r, state.gap - 0.5 * state.r**2)
    first, second = solved(quarter, 2.0, first.u, 1e-13), solved(whole, 2.0, start, 1e-13)
    measured = []
    for problem, equilibrium in ((quarter, first), (whole, second)):
        area = contact_area(problem, equilibrium)
        far = observables.far_field_error(problem, equilibrium)
        gap = observables.central_gap(problem, equilibrium)
        shapes = observables.profile(problem, equilibrium)
        measured.append(
            [
                *(area.radius, area.radius_error, area.perimeter, area.nodes),
                *(equilibrium.displacement, far, *gap),
                *(observables.mean_gap(problem, equilibrium), problem.total_energy(equilibrium.fields)),
                *(shapes.gap.sum(), shapes.pressure.sum(), shapes.r.size),
            ]
        )
    assert measured[0] == pytest.approx(measured[1], rel=1e-10)
