"""A map of 64 synthetic force curves, fitted by one command; its pictures show the pattern that was put in.

    python -m studies.fit_map [--size 8] [--folder FOLDER] [--count COUNT]

A stiff square lies in a soft surface, and the work of adhesion grows from left to right. Written are the curves,
one file each, ``map.h5`` and ``map.png``. With a count so many Hertz curves of 600 samples are fitted instead, and it
is told how long that takes, from the files of the curves to that of the map.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import contbranch as cb
from contbranch.cli import main as command
from studies.fit_synthetic import force_curve

CONTACT = """[tip]
shape = "parabola"
radius = "1 um"
[material]
modulus = "30 MPa"
[[interaction]]
law = "maugis-dugdale"
work_of_adhesion = "20 mN/m"
range = "5 nm"
"""
SPRING, RANGE = 5.0, 5.0


def pattern(size: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Modulus (nN/nm²) and work of adhesion (nN/nm), rows by columns."""
    modulus = np.full((size, size), 0.02)
    inside = slice(max(1, size // 4), size - max(1, size // 4))
    modulus[inside, inside] = 0.08
    return modulus, np.tile(np.linspace(0.02, 0.05, size), (size, 1))


def written(folder: Path, size: int, count: int = 300) -> None:
    """Write the curves."""
    rng = np.random.default_rng(1)
    for row, (stiff, works) in enumerate(zip(*pattern(size), strict=True)):
        for column, (modulus, work) in enumerate(zip(stiff, works, strict=True)):
            contact = cb.Contact.physical(
                radius=1000.0, modulus=modulus, interaction="maugis-dugdale", work_of_adhesion=work, range=RANGE
            )
            loop = cb.hysteresis(contact, control=cb.Spring(SPRING), max_load=200.0)
            top = float((loop.path.displacement + loop.path.load / SPRING).max())
            low = min(jump.position for jump in loop.jumps) - 30.0
            way = np.linspace(low, top, count)
            ways = ((1, way), (-1, way[::-1]))
            force = np.concatenate([force_curve(loop, SPRING, one, direction) for direction, one in ways])
            force += 0.01 * -force.min() * rng.standard_normal(force.size) + rng.uniform(-5.0, 5.0)
            _write(folder / f"x{column}_y{row}.csv", way, force)


def _write(path: Path, way: np.ndarray[Any, Any], force: np.ndarray[Any, Any]) -> None:
    """Write a curve: there and back."""
    rows = zip(np.append(way, way[::-1]), force, np.repeat(["approach", "retract"], way.size), strict=True)
    path.write_text("\n".join(["piezo [nm],force [nN],segment", *(f"{z:.5f},{f:.5f},{w}" for z, f, w in rows)]))


def timed(count: int, folder: Path) -> None:
    """Fit a map of Hertz curves, with moduli of 1 to 100 kPa and a spring of 0.05 N/m, by two processes."""
    rng, depth = np.random.default_rng(1), np.linspace(0.0, 2000.0, 2000)
    for k, modulus in enumerate(1e-6 * 10.0 ** rng.uniform(0.0, 2.0, count)):
        load = 4.0 / 3.0 * modulus * np.sqrt(2500.0) * depth**1.5
        way = np.linspace(-1000.0, float(np.interp(5.0, load, depth + load / 0.05)), 300)
        force = np.interp(np.append(way, way[::-1]), depth + load / 0.05, load) + rng.normal(0.0, 0.02, 600)
        _write(folder / f"x{k % 64}_y{k // 64}.csv", way, force)
    contact, began = cb.Contact.physical(radius="2.5 um", modulus="10 kPa"), time.perf_counter()
    found = cb.fit_map(folder, contact, folder.parent / "map.h5", ("modulus",), spring="0.05 N/m", workers=2)
    seconds, own = (time.perf_counter() - began) / count, float(np.mean([one.wall_s for one in found.tasks]))
    print(found)
    print(f"{own:.3f} s a fit, {seconds - own / 2:.4f} s a curve beside it; 4096 curves: {68.3 * seconds:.1f} min")


def main() -> None:
    """Write the curves, fit them, and compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=8)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--count", type=int)
    asked = parser.parse_args()
    folder = asked.folder or Path(tempfile.mkdtemp())
    curves = folder / "curves"
    curves.mkdir(parents=True, exist_ok=True)
    if asked.count:
        timed(asked.count, curves)
        return
    written(curves, asked.size)
    contact, file = folder / "contact.toml", folder / "map.h5"
    contact.write_text(CONTACT)
    status = command(["fit", str(curves), str(contact), "--spring", f"{SPRING} N/m", "-o", str(file),
                      "--plot", str(folder / "map.png")])  # fmt: skip
    found = cb.load(file)
    for name, true in zip(("modulus", "work_of_adhesion"), pattern(asked.size), strict=True):
        values, errors = (found.picture(one).values for one in (name, f"{name}_error"))
        away = np.abs(values - true)
        print(f"{name}: within {100 * np.nanmax(away / true):.1f} %; inside ± 1.96 errors: "
              f"{np.mean(away <= 1.96 * errors):.2f}; not determined: {np.isnan(values).sum()}")  # fmt: skip
    print(f"exit status {status}; {found.told()}; {folder}")


if __name__ == "__main__":
    main()
