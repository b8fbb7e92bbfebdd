"""Self-affine surfaces: spectrum and moments measured on the heights, by sums and differences of them."""

import math

import numpy as np
import pytest

import contbranch as cb
from contbranch.contact.self_affine import self_affine_heights

CELL = 3.0


@pytest.mark.parametrize("hurst", [0.3, 0.8, 1.0])
def test_spectrum_falls_with_the_power_of_the_exponent(hurst):
    heights = self_affine_heights(128, CELL, hurst, rms_height=0.1, seed=3)
    power = np.abs(np.fft.fft2(heights)) ** 2
    number = np.fft.fftfreq(128, 1 / 128)
    order = np.hypot(number[:, None], number)
    inside = (order >= 1.0) & (order <= 32.0)  # the default cutoffs: the cell, and four of its 128 nodes
    slope = np.polyfit(np.log(order[inside]), np.log(power[inside]), 1)[0]
    assert slope == pytest.approx(-2.0 * (1.0 + hurst), abs=1e-6)
    assert power[~inside].max() < 1e-20 * power.max()


def test_rms_height_and_slope():
    heights = self_affine_heights(64, CELL, 0.7, rms_height=0.1)
    assert math.sqrt(np.mean(heights**2)) == pytest.approx(0.1, rel=1e-13)
    assert np.mean(heights) == pytest.approx(0.0, abs=1e-15)
    # √⟨|∇h|²⟩ by central differences over two nodes of a map whose waves have at least 64; their error is (qΔ)²/6
    heights = self_affine_heights(512, CELL, 0.7, rms_slope=0.2, short_cutoff=CELL / 8)
    slopes = [(np.roll(heights, -1, axis) - np.roll(heights, 1, axis)) / (2 * CELL / 512) for axis in (0, 1)]
    assert math.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2)) == pytest.approx(0.2, rel=2e-3)


def test_heights_are_gaussian():
    # many independent waves: kurtosis 3, skewness 0 (a cascade with H near 0 has no dominant one)
    heights = self_affine_heights(256, CELL, 0.0, rms_height=1.0, seed=5, long_cutoff=CELL / 8)
    assert np.mean(heights**3) == pytest.approx(0.0, abs=0.1)
    assert np.mean(heights**4) == pytest.approx(3.0, abs=0.2)


def test_a_seed_is_a_surface_on_every_grid():
    settings = {"rms_slope": 0.2, "short_cutoff": CELL / 10, "long_cutoff": CELL / 2}
    coarse, fine = (self_affine_heights(n, CELL, 0.8, seed=11, **settings) for n in (32, 128))
    np.testing.assert_allclose(fine[::4, ::4], coarse, atol=1e-14)
    assert np.abs(self_affine_heights(32, CELL, 0.8, seed=12, **settings) - coarse).max() > 0.1 * np.ptp(coarse)
    longer = self_affine_heights(32, CELL, 0.8, seed=11, rms_slope=0.2, short_cutoff=CELL / 10)
    power = np.abs(np.fft.fft2(longer)) ** 2
    assert power[0, 1] > 0.0
    assert np.abs(np.fft.fft2(coarse))[0, 1] ** 2 < 1e-20 * power[0, 1]


def test_as_a_tip():
    tip = cb.HeightMap.self_affine(32, CELL, 0.8, rms_slope=0.2, seed=1, radius=2.0)
    again = cb.HeightMap.self_affine(32, CELL, 0.8, rms_slope=0.2, seed=1, radius=2.0)
    assert tip == again
    assert tip != cb.HeightMap.self_affine(32, CELL, 0.8, rms_slope=0.2, seed=2, radius=2.0)
    assert tip.heights.min() == 0.0
    assert (tip.cell, tip.radius, tip.points) == (CELL, 2.0, (32, 32))
    assert tip.rms_slope == pytest.approx(0.2, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n": 7}, "n: 7; must be a whole number, at least 8"),
        ({"n": 32.0}, "n: 32.0; must be a whole number"),
        ({"cell": 0.0}, "cell: 0; must be greater than zero"),
        ({"hurst": 1.2}, "hurst: 1.2; must be from 0 to 1"),
        ({"rms_slope": None}, "rms_slope, rms_height: give exactly one"),
        ({"rms_height": 1.0}, "rms_slope, rms_height: give exactly one"),
        ({"rms_slope": -1.0}, "rms_slope: -1; must be greater than zero"),
        ({"seed": -1}, "seed: -1; must be a whole number, at least 0"),
        ({"short_cutoff": CELL / 16}, "short_cutoff: 0.1875; must be greater than two node spacings, 0.1875"),
        ({"long_cutoff": CELL / 20}, "short_cutoff, long_cutoff: 0.375, 0.15; no wave"),
    ],
)
def test_wrong_settings(change, message):
    settings = {"n": 32, "cell": CELL, "hurst": 0.8, "rms_slope": 0.2, **change}
    with pytest.raises(cb.InputError, match=f"^{message}"):
        cb.HeightMap.self_affine(**settings)
