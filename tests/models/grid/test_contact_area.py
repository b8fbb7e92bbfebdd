"""Contact area below the spacing of the lattice, against Hertz' theory and the axisymmetric model."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from lattice_cases import from_axisymmetric, paraboloid, solved
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import contbranch as cb
from contbranch.models.grid.contact_area import contact_area
from contbranch.models.grid.lattice import Lattice
from contbranch.models.grid.newton import Equilibrium
from contbranch.models.grid.observables import central_gap
from studies.hertz_radius import image_curvature


def hertz(spacings, grid, kind="free"):
    """Measured contact of a paraboloid without interaction whose radius, a³ = 3F/4, is 1 = so many spacings."""
    problem = paraboloid(kind, grid / spacings, grid)
    return problem, solved(problem, 4.0 / 3.0)


@pytest.mark.parametrize("spacings", [16.2, 16.94, 22.4, 32.0, 32.23, 32.5, 32.79])
def test_radius_of_hertz(spacings):
    # F = 4a³/3: radius 1. Two thirds of 0.1 % at 32.5 spacings, the worst of places for the rim.
    measured = contact_area(*hertz(spacings, 128 if spacings < 20 else 224))
    assert abs(measured.radius - 1.0) < 0.025 / spacings
    assert abs(measured.radius - 1.0) < measured.radius_error < 0.06 / spacings


def test_nodes_alone_know_less():
    """They count the border a tenth of a spacing too far out."""
    measured = contact_area(*hertz(24.3, 144))
    counted = math.sqrt(measured.nodes / math.pi) / 24.3
    assert abs(counted - 1.0) > 4.0 * abs(measured.radius - 1.0)


def test_few_nodes_are_monotonic_and_known_to_be_rough():
    # Radii of 0.9 to 4 spacings, 4 nodes and more; a³ = 3F/4 for the reference.
    problem = paraboloid("free", 32.0, 32)
    radii = np.arange(0.9, 4.0, 0.15)
    measured = [contact_area(problem, solved(problem, 4.0 / 3.0 * a**3)) for a in radii]
    values = np.array([m.radius for m in measured])
    errors = np.array([m.radius_error for m in measured])
    assert measured[0].nodes == 4
    assert (np.diff(values) > 0.0).all()
    assert (np.abs(values - radii) < errors).all()
    assert errors[0] > 0.1


CASES = [
    (cb.Exponential, 0.5, 1, 3.0, 26.0),
    (cb.Exponential, 1.0, 1, -3.0, 19.0),
    (cb.Exponential, 1.0, -1, 60.0, 20.0),
    (cb.Gauss, 1.0, 1, 0.1, 19.0),
    (cb.Gauss, 1.0, -1, 12.0, 18.0),
    (cb.Gauss, 2.0, 1, 5.0, 15.3),
    (cb.Gauss, 2.0, -1, 30.0, 14.8),
    (cb.VanDerWaals, 1.0, 1, 12.0, 24.0),
    (cb.VanDerWaals, 0.5, -1, 20.0, 38.4),
]


@pytest.mark.parametrize(("law", "tabor", "sign", "load", "edge"), CASES)
def test_radius_with_interaction(law, tabor, sign, load, edge):
    # The axisymmetric model's contact radius, exact to 1e-8.
    problem, equilibrium, state = from_axisymmetric("free", edge, 192, law, tabor, sign, load)
    measured = contact_area(problem, equilibrium)
    spacing = problem.lattice.spacing
    assert abs(measured.radius - state.contact_radius) < 0.08 * spacing
    assert abs(measured.radius - state.contact_radius) < measured.radius_error
    assert 0.002 * spacing < measured.radius_error < 0.3 * spacing


def test_images_in_a_periodic_cell():
    # To leading order the images bend the tip's apex: R → R/(1 + κ), and a³ = 3FR/4.
    for edge in (6.0, 8.0):
        problem, equilibrium = hertz(24.0, int(24 * edge), "periodic")
        curvature = image_curvature(problem, equilibrium)
        measured = contact_area(problem, equilibrium)
        assert abs(measured.radius - (1.0 + curvature) ** (-1.0 / 3.0)) < 4e-4
    assert curvature == pytest.approx(3.0 * 0.00125, rel=0.01)


def hertz_ellipse(ratio_of_curvatures, load):
    """Area of the contact of k₁x² + k₂y², k₁ = 1, by the theory of Hertz (Johnson, Contact Mechanics, 4.2)."""
    a_over_b_of = lambda e: (ellipe(e) / (1.0 - e) - ellipk(e)) / (ellipk(e) - ellipe(e))  # noqa: E731
    e2 = brentq(lambda e: a_over_b_of(e) - ratio_of_curvatures, 1e-9, 1.0 - 1e-9)
    # A = k₁/2 = p0 b/(a² e²) [K - E] with p0 = 3F/(2πab), E* = 1 and b² = a²(1 - e²).
    a = (3.0 * load / math.pi * (ellipk(e2) - ellipe(e2)) / e2) ** (1.0 / 3.0)
    return math.pi * a * a * math.sqrt(1.0 - e2)


def test_area_of_an_ellipse():
    # The closed form tends to the circle, F = 4a³/3, and gives the area of the elliptic contact.
    assert hertz_ellipse(1.0 + 1e-6, 4.0 / 3.0) == pytest.approx(math.pi, rel=1e-5)
    for ratio in (2.0, 5.0):
        problem = paraboloid("free", 7.0, 160, curvatures=(1.0, ratio))
        measured = contact_area(problem, solved(problem, 1.7))
        exact = hertz_ellipse(ratio, 1.7)
        assert abs(measured.area / exact - 1.0) < 1.5e-3
        assert abs(measured.area - exact) < measured.area_error


def test_place_in_the_cell_does_not_matter():
    # Translations by fractions of the spacing, and across the border of the cell.
    areas, errors = [], []
    for centre in ((0.0, 0.0), (0.013, -0.021), (2.9, 0.04), (2.985, 2.99)):
        problem = paraboloid("periodic", 6.0, 120, quarter=False, centre=centre)
        measured = contact_area(problem, solved(problem, 4.0 / 3.0))
        areas.append(measured.area)
        errors.append(measured.area_error)
    assert np.ptp(areas) < 7e-3
    assert np.ptp(areas) < 2.0 * max(errors)


def test_two_patches():
    # Apices at (0, 0) and in the middle of the cells are a square lattice of edge L/√2, turned.
    one = paraboloid("periodic", 6.0, 144)
    single = contact_area(one, solved(one, 4.0 / 3.0))
    edge = 6.0 * math.sqrt(2.0)
    first = paraboloid("periodic", edge, 204)
    second = paraboloid("periodic", edge, 204, quarter=False, centre=(0.5 * edge, 0.5 * edge))
    first.heights = np.minimum(first.heights, second.heights[102:, 102:])
    double = contact_area(first, solved(first, 8.0 / 3.0))
    assert abs(double.area - 2.0 * single.area) < 4e-3
    assert abs(double.area - 2.0 * single.area) < double.area_error + 2.0 * single.area_error


def test_no_contact_and_full_contact():
    problem, equilibrium, _ = from_axisymmetric("free", 14.0, 64, cb.Gauss, 1.0, -1, 3.0)
    measured = contact_area(problem, equilibrium)
    assert (measured.radius, measured.radius_error, measured.nodes) == (0.0, 0.0, 0)
    # Waves pressed flat: F above the mean pressure E q h/2 of each of the two, q = 2π/L.
    wavy = paraboloid("periodic", 5.0, 32)
    axis = wavy.lattice.axes[0]
    wave = 0.1 * (1.0 - np.cos(2.0 * math.pi * axis / 5.0))
    wavy.heights = wave[:, None] + wave[None, :]
    full = contact_area(wavy, solved(wavy, 1.05 * 25.0 * 2.0 * 0.1 * math.pi / 5.0))
    assert full.area == pytest.approx(25.0, rel=1e-14)


@pytest.mark.parametrize("quarter", [True, False])
def test_contact_between_the_nodes(quarter):
    # A paraboloid's gap r²/2 + c has with c < 0 a contact of radius √(-2c): no node, at r > 0.7 spacings and more,
    # sees it.
    problem = paraboloid("periodic", 4.0, 32, quarter=quarter)
    spacing = problem.lattice.spacing
    for height in (-0.2 * spacing**2, 0.1 * spacing**2):
        fields = problem.fields(np.full(problem.shape, height), 0.0)
        state = Equilibrium(fields, np.zeros(problem.shape, dtype=bool), 0.0, 0.0, True)
        gap, _ = central_gap(problem, state)
        assert gap == pytest.approx(max(height, 0.0), abs=1e-14)
        assert contact_area(problem, state).radius == 0.0


def perimeter_of(lattice, contact):
    """That of nodes in contact with a rim about halfway to the free ones, by pressures and gaps next to it."""
    fields = SimpleNamespace(excess=2.2 * contact, gap=4.0 / 3.0 * ~contact, stiffness=np.zeros(contact.shape))
    return contact_area(SimpleNamespace(lattice=lattice), SimpleNamespace(contact=contact, fields=fields)).perimeter


class TestPerimeter:
    @pytest.mark.parametrize(
        ("a", "b", "turn"), [(4.0, 4.0, 0.0), (16.0, 16.0, 0.3), (8.0, 4.0, 0.4), (20.0, 5.0, 0.0)]
    )
    def test_of_discs_and_ellipses_anywhere_on_the_nodes(self, a, b, turn):
        """The perimeter 4 a E(1 - b²/a²) of an ellipse on whose nodes the contact is."""
        lattice = Lattice("periodic", (64.0, 64.0), (64, 64), False)
        nodes, random, found = np.arange(64.0), np.random.default_rng(0), []
        for _ in range(20):
            x, y = nodes[:, None] - 32.0 - random.uniform(), nodes - 32.0 - random.uniform()
            along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
            contact = (along / a) ** 2 + (across / b) ** 2 < 1.0
            found.append(perimeter_of(lattice, contact))
        assert np.mean(found) == pytest.approx(4.0 * a * ellipe(1.0 - (b / a) ** 2), rel=0.01)

    def test_of_a_round_contact(self):
        branch = cb.trace(
            cb.Contact.reduced(cb.Gauss, 1.0, -1), model=cb.FreeSpace(cell=8.0, grid=64), modes=0
        ).branches[0]
        radius = branch.contact_radius
        touching = radius > 2.0 * 8.0 / 64
        np.testing.assert_allclose(branch.contact_area, np.pi * radius**2)
        np.testing.assert_allclose(branch.contact_perimeter[touching], 2.0 * np.pi * radius[touching], rtol=0.03)
