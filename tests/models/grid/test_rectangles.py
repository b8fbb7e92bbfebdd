"""Rectangular cells and line contacts: repeated cells, Love's rectangle, Westergaard's and Johnson's waves."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb
from contbranch.models.grid.lattice import Lattice

LAW = cb.Exponential(work_of_adhesion=0.02, range=0.3)
WAVE = 0.05


def solved(heights, cell, load, law=LAW, **options):
    return cb.solve(cb.Contact(cb.HeightMap(heights, cell, radius=1.0), law), load=load, **options)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_cell_twice_has_the_state_twice(axis):
    rough = cb.HeightMap.self_affine(24, 10.0, 0.8, rms_slope=0.1, seed=1).heights
    one = solved(rough, (10.0, 10.0), 0.2)
    two = solved(np.concatenate([rough, rough], axis), (20.0, 10.0) if axis == 0 else (10.0, 20.0), 0.4)
    assert two.mean_gap == pytest.approx(one.mean_gap, rel=1e-8)
    halves = np.split(two.cell.gap, 2, axis)
    np.testing.assert_allclose(halves[0], halves[1], atol=1e-7)
    np.testing.assert_allclose(halves[0], one.cell.gap, atol=1e-7)
    assert two.contact_radius**2 == pytest.approx(2.0 * one.contact_radius**2, rel=0.1)  # two small patches


@pytest.mark.parametrize("shape", [(96, 48), (48, 96), (95, 49)])
def test_spacings_of_its_own(shape):
    def sampled(n, m):
        x, y = (2.0 * np.pi * np.arange(nodes) / nodes for nodes in (n, m))
        return 0.3 * np.cos(x)[:, None] * np.cos(y) + 0.05 * np.cos(2.0 * x)[:, None]

    fine, own = (solved(sampled(*nodes), (10.0, 10.0), 1.0) for nodes in ((128, 128), shape))
    assert own.mean_gap == pytest.approx(fine.mean_gap, rel=3e-3)
    assert own.contact_radius == pytest.approx(fine.contact_radius, rel=3e-3)
    assert own.energy == pytest.approx(fine.energy, rel=1e-4)
    assert own.cell.x.shape, own.cell.y.shape == ((shape[0],), (shape[1],))


def test_a_line_is_a_cell_that_is_the_same_along_y():
    z = 0.3 * np.cos(2.0 * np.pi * np.arange(64) / 64) + 0.1 * np.cos(6.0 * np.pi * np.arange(64) / 64)
    along = solved(z[:, None], (10.0, 3.0), 0.1)
    wide = solved(np.tile(z[:, None], 12), (10.0, 3.0), 0.1)
    across = solved(z[None, :], (3.0, 10.0), 0.1)
    assert along.contact_radius > 0.0
    for other in (wide, across):
        assert other.mean_gap == pytest.approx(along.mean_gap, rel=1e-8)
    np.testing.assert_allclose(wide.cell.pressure, np.tile(along.cell.pressure, 12), atol=1e-7)
    np.testing.assert_allclose(across.cell.pressure.T, along.cell.pressure, atol=1e-9)
    # Twice the width bears twice the load at the same displacement.
    twice = solved(z[:, None], (10.0, 6.0), 0.2)
    assert twice.displacement == pytest.approx(along.displacement, rel=1e-9)
    assert twice.energy == pytest.approx(2.0 * along.energy, rel=1e-9)


def test_the_slope_of_a_lines_energy_is_its_load():
    z = 0.3 * np.cos(2.0 * np.pi * np.arange(64) / 64)
    below, here, above = (solved(z[:, None], (10.0, 3.0), load) for load in (0.0999, 0.1, 0.1001))
    slope = (above.energy - below.energy) / (above.displacement - below.displacement)
    assert slope == pytest.approx(here.load, rel=1e-6)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_westergaards_wave(share):
    """H. M. Westergaard, J. Appl. Mech. 6, A49 (1939): mean pressure p* sin²(πa/λ), with p* = π E h/λ."""
    n, edge = 512, 10.0
    mean = share * np.pi * WAVE / edge
    x = np.arange(n) / n
    state = solved(WAVE * (1.0 - np.cos(2.0 * np.pi * x))[:, None], (edge, 2.0), 2.0 * edge * mean, law=None)
    half_width = np.pi * state.contact_radius**2 / 4.0
    assert np.sin(np.pi * half_width / edge) ** 2 == pytest.approx(share, abs=5e-4)
    root = np.sqrt(np.maximum(share - np.sin(np.pi * x) ** 2, 0.0))
    exact = 2.0 * mean / share * np.abs(np.cos(np.pi * x)) * root
    off = np.abs(state.cell.pressure[:, 0] - exact) / exact.max()
    assert off.max() < 0.02  # at the rim, where the pressure begins as a root
    assert off.mean() < 1e-4


def test_johnsons_wave():
    """K. L. Johnson, Int. J. Solids Struct. 32, 423 (1995): p/p* = sin²ψ − α √(tan ψ), reached as the range falls.

    With α = 0.3 the extrema are −0.09594 and 0.38773; at a range of 0.15 h they are −0.0931 and 0.3756.
    """
    alpha, edge, unit = 0.3, 1.0, np.pi * WAVE
    work = 0.5 * (alpha * np.pi * WAVE) ** 2
    z = WAVE * (1.0 - np.cos(2.0 * np.pi * np.arange(256) / 256))
    contact = cb.Contact(cb.HeightMap(z[:, None], (edge, 1.0)), cb.Exponential(work, 0.15 * WAVE))
    diagram = cb.trace(contact, max_load=0.5 * unit)
    assert diagram.status == "complete"
    loads = diagram.branches[0].load / unit
    widths = np.pi * diagram.branches[0].contact_radius ** 2
    in_part = widths < 0.9
    assert loads.min() == pytest.approx(-0.0931, abs=4e-4)
    assert loads[in_part].max() == pytest.approx(0.3756, abs=1e-3)
    assert widths[-1] == pytest.approx(1.0, rel=1e-12)


def test_a_rectangle_pressed_in_free_space():
    """A. E. H. Love, Phil. Trans. R. Soc. A 228, 377 (1929): displacement by uniform pressure on all of the cell."""
    lattice = Lattice("free", (2.0, 3.0), (64, 96), quarter=False)
    pressure = np.zeros(lattice.shape)
    pressure[lattice.cell] = 1.0
    found = np.fft.irfft2(np.fft.rfft2(pressure) / lattice.held_symbol, s=lattice.shape)[lattice.cell]
    x, y = (axis[part] for axis, part in zip(lattice.axes, lattice.cell, strict=True))

    def corner(a, b):
        return a * np.arcsinh(b / a) + b * np.arcsinh(a / b)

    ends = [(1.0 + s * x, 1.5 + t * y) for s in (1, -1) for t in (1, -1)]
    exact = sum(corner(a[:, None], b) for a, b in ends) / np.pi
    assert np.abs(found / exact - 1.0).max() < 0.1 / 64


def test_mean_gap_and_energy_of_a_cell_by_itself():
    """Pressed flat, a wave has the energy of its deformation, E q h²/8 for an amplitude h, and no more than that."""
    h, edge, width = 0.05, 10.0, 2.0
    z = h * (1.0 - np.cos(2.0 * np.pi * np.arange(64) / 64))
    flat = solved(z[:, None], (edge, width), 2.0 * width * np.pi * h, law=None)
    assert flat.mean_gap == pytest.approx(0.0, abs=1e-12)
    assert flat.cell_energy == pytest.approx(np.pi / edge * h**2 / 4.0 * edge * width, rel=1e-9)
    assert flat.energy > 2.0 * flat.cell_energy
    contact = cb.Contact(cb.HeightMap(z[:, None], (edge, width), radius=1.0), LAW)
    branch = cb.trace(contact, max_load=0.1).branches[0]
    for row in (0, len(branch) // 2, len(branch) - 1):
        state = branch.state(row)
        assert state.mean_gap == pytest.approx(state.cell.gap.mean(), abs=1e-9)
    # Held at its mean plane, a cell does work by the change of its mean gap alone.
    loads, gaps = branch.load, branch.mean_gap
    work = -np.sum(np.diff(gaps) * (loads[1:] + loads[:-1]) / 2.0)
    assert branch.cell_energy[-1] - branch.cell_energy[0] == pytest.approx(work, rel=5e-2)


def test_patches():
    x = 2.0 * np.pi * np.arange(32) / 32
    egg_box = 0.3 * (1.0 + np.cos(x)[:, None] * np.cos(x))
    cell = solved(egg_box, (10.0, 10.0), 0.3, law=None).cell
    # Summits at (0, π) and (π, 0), both on a border.
    sizes = cell.patches()
    assert len(sizes) == 2
    assert sizes[0] == sizes[1] > 4
    assert sizes.sum() == np.count_nonzero(cell.gap <= 0.0)
    assert len(cell.patches(periodic=False)) == 4


@pytest.mark.parametrize("law", [None, LAW, cb.Gauss(-0.02, 0.3)])
def test_a_mean_gap_that_is_held(law):
    rough = cb.HeightMap.self_affine(32, 10.0, 0.8, rms_slope=0.1, seed=1)
    contact = cb.Contact(rough, law)
    wanted = cb.solve(contact, load=0.2)
    found = cb.solve(contact, mean_gap=wanted.mean_gap)
    assert found.mean_gap == pytest.approx(wanted.mean_gap, rel=1e-9)
    assert found.load == pytest.approx(wanted.load, rel=1e-6)
    with pytest.raises(cb.InputError, match=r"^mean_gap: only that of a periodic cell under a tip"):
        cb.solve(contact, mean_gap=0.1, model="free")
    with pytest.raises(cb.InputError, match=r"^mean_gap: only that of a periodic cell can be held"):
        cb.solve(cb.Contact.reduced("gauss", tabor=1.0), mean_gap=1.0)
