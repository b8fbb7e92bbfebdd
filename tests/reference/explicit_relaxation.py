"""Quasi-static loops of a height map by explicit relaxation, which shares nothing with the package's solvers.

    python tests/reference/explicit_relaxation.py FROM TO STEP

raises the displacement of the map of `tests/models/grid/test_loops.py` in steps, lowers it again, and prints where the
load jumps. At every step the nodes move down the gradient of the energy, and no further than to the wall, until no
force is left: some minutes for a hundred steps.
"""

from __future__ import annotations

import sys

import numpy as np

import contbranch as cb

CELL, WORK, RANGE = 2000.0, 0.05, 3.0
# A load that changes by so many times the change on both sides of it has jumped; force at which nodes are at rest.
SHARPER, REST = 2.5, 1e-9


def ramp(heights: np.ndarray, displacements: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Loads at displacements one after the other from a field u, and the last field.

    The displacement d is held by the stiffness 1/C of the mean, d = C F − mean(u), in a periodic cell.
    """
    n = len(heights)
    waves = np.fft.fftfreq(n, CELL / n), np.fft.rfftfreq(n, CELL / n)
    stiffness = np.pi * np.hypot(waves[0][:, None], waves[1])
    compliance = 3.900264920001955 / (np.pi * CELL)
    stiffness[0, 0] = 1.0 / (compliance * CELL**2)
    step, loads = 1.0 / (stiffness.max() + WORK / RANGE**2), []
    for d in displacements:
        force = np.full_like(heights, np.inf)
        while np.abs(force).max() > REST:
            elastic = np.fft.irfft2(stiffness * np.fft.rfft2(u + d), heights.shape)
            moved = np.maximum(u - step * (elastic + WORK / RANGE * np.exp(-(heights + u) / RANGE)), -heights)
            force, u = (moved - u) / step, moved
        loads.append((d + u.mean()) / compliance)
    return np.array(loads), u


if __name__ == "__main__":
    start, stop, step = map(float, sys.argv[1:])
    surface = cb.HeightMap.self_affine(32, cell=CELL, hurst=0.8, rms_slope=0.05, seed=3)
    heights = np.array(cb.HeightMap(surface.heights, cell=CELL, peaks=True).heights)
    places = np.arange(start, stop, step)
    raised, u = ramp(heights, places, np.maximum(-heights, -start))
    lowered, _ = ramp(heights, places[::-1], u)
    for way, loads in ((places, raised), (places[::-1], lowered)):
        change = np.abs(np.diff(loads))
        for k in range(1, len(change) - 1):
            if change[k] > SHARPER * max(change[k - 1], change[k + 1]):
                print(f"{way[k]:.6g} to {way[k + 1]:.6g}: {loads[k]:.2f} to {loads[k + 1]:.2f}")
