"""Are curves of contacts without axial symmetry complete, and in what time? Random surfaces and ellipses on 64² nodes.

    python studies/random_surfaces.py                  # 100 contacts, some ten minutes
    python studies/random_surfaces.py --count 20 --seed 7
    python studies/random_surfaces.py --only 3,14      # some of them, by their number
    python studies/random_surfaces.py --maps --count 40  # maps like measured ones, up to half an hour

Half are self-affine surfaces with random spectra, half elliptic paraboloids with random ratios of their radii; laws,
their signs and ranges, cells and controls are drawn, too. Maps like measured ones have white noise, dust, terraces,
gratings with noise, or a part of a self-affine surface with the step that its cell repeats, on 64², 96 × 64 and 64 × 96
nodes, under laws a quarter to a half as stiff as a wave over eight nodes. A line each, and a summary.
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass

import numpy as np

import contbranch as cb

LAWS = cb.Gauss, cb.Exponential, cb.VanDerWaals
# CPU seconds that a trace may take, and one of a map like measured ones.
LIMIT, LIMIT_OF_MAPS = 20.0, 60.0
MAPS = "noise", "dust", "terraces", "grating", "cut"


@dataclass(frozen=True)
class Case:
    """One contact to be traced.

    Attributes
    ----------
    text : str
    contact : Contact
    model : Periodic or FreeSpace
    control : str
    """

    text: str
    contact: cb.Contact
    model: cb.Periodic | cb.FreeSpace
    control: str


def drawn(number: int, seed: int = 1) -> Case:
    """One of the cases, the same for the same numbers."""
    rng = np.random.default_rng([seed, number])
    rough = number % 2 == 0
    control = str(rng.choice(["load", "displacement"]))
    model = cb.Periodic() if rng.random() < 0.5 else cb.FreeSpace()
    name = type(model).__name__
    kind = LAWS[rng.integers(3)]
    sign = float(rng.choice([-1.0, 1.0]))
    if rough:
        hurst, slope, surface = rng.uniform(0.3, 0.9), rng.uniform(0.1, 0.6), int(rng.integers(1000))
        length = float(np.exp(rng.uniform(np.log(0.3), np.log(1.6))))
        work = 0.02
        tip: cb.EllipticParaboloid | cb.HeightMap = cb.HeightMap.self_affine(
            64, 10.0, hurst, rms_slope=slope, seed=surface
        )
        text = f"self_affine(64, 10., {hurst:.4f}, rms_slope={slope:.4f}, seed={surface})"
        name, model = "Periodic", cb.Periodic()
    else:
        ratio = float(np.exp(rng.uniform(np.log(1.1), np.log(4.0))))
        length, work = 1.0 / float(np.exp(rng.uniform(np.log(0.1), np.log(2.0)))), 1.0
        tip = cb.EllipticParaboloid(ratio, 1.0 / ratio)
        model = type(model)(grid=64)
        text = f"EllipticParaboloid({ratio:.4f}, 1/{ratio:.4f})"
    law = kind(sign * work, length)
    text += f" {kind.__name__}({sign * work:g}, {length:.4f})"
    if rng.random() < 0.2:
        law = law + cb.Exponential(-0.5 * sign * work, 2.0 * length)
        text += f" + Exponential({-0.5 * sign * work:g}, {2.0 * length:.4f})"
    return Case(f"{text} {name} {control}", cb.Contact(tip, interaction=law, modulus=1.0), model, control)


def like_measured(number: int, seed: int = 1) -> Case:
    """A map like a measured one, attractive or repulsive, under either control."""
    rng = np.random.default_rng([seed, number])
    kind, sign = MAPS[number % len(MAPS)], float(rng.choice([-1.0, 1.0]))
    rows, columns = ((64, 64), (96, 64), (64, 96))[int(rng.integers(3))]
    control = str(rng.choice(["load", "displacement"]))
    rough = cb.HeightMap.self_affine(96, 96.0, 0.8, rms_height=1.0, seed=int(rng.integers(1000)))
    heights = rough.heights[:rows, :columns].copy()
    if kind == "noise":
        heights = rng.standard_normal((rows, columns))
    elif kind == "dust":
        heights[rng.integers(rows, size=5), rng.integers(columns, size=5)] -= rng.uniform(1.0, 4.0, 5)
    elif kind == "terraces":
        heights = np.round(1.5 * heights) / 1.5 + 0.02 * rng.standard_normal((rows, columns))
    elif kind == "grating":
        ridges = np.sin(6.0 * np.pi * np.arange(rows) / rows) > 0.0
        heights = ridges[:, None] + 0.05 * rng.standard_normal((rows, columns))
    spacing, length = 10.0 / 64.0, heights.std() * rng.uniform(0.3, 1.0)
    work = sign * rng.uniform(0.25, 0.5) * np.pi / (8.0 * spacing) * length**2
    law = cb.Exponential(work, length) if sign > 0.0 else cb.Gauss(work, length)
    tip = cb.HeightMap(heights, (rows * spacing, columns * spacing))
    text = f"{kind} {rows} x {columns} {type(law).__name__}({work:.4g}, {length:.4g}) {control}"
    return Case(text, cb.Contact(tip, law), cb.Periodic(), control)


def named() -> list[Case]:
    """Contacts that have been hard."""
    rough = cb.HeightMap.self_affine
    ellipse = cb.EllipticParaboloid
    vdw, soft = cb.VanDerWaals(-1.0, 1.0 / 1.84075), cb.Gauss(-1.0, 1.0 / 0.1365)
    both = cb.Gauss(-0.02, 0.77) + cb.Exponential(0.01, 1.54)
    first, last = (
        rough(64, 10.0, 0.43096, rms_slope=0.502374, seed=178),
        rough(64, 10.0, 0.508, rms_slope=0.377, seed=529),
    )
    contacts = [
        (cb.Contact(first, interaction=cb.Gauss(-0.02, 0.545824), modulus=1.0), cb.Periodic()),
        (cb.Contact(ellipse(2.694677, 1.0 / 2.694677), interaction=vdw, modulus=1.0), cb.FreeSpace(grid=64)),
        (cb.Contact(ellipse(3.7, 1.0 / 3.7), interaction=soft, modulus=1.0), cb.Periodic(grid=64)),
        (cb.Contact(last, interaction=both, modulus=1.0), cb.Periodic()),
    ]
    return [
        Case(f"named {k} {control}", contact, model, control)
        for k, (contact, model) in enumerate(contacts)
        for control in ("load", "displacement")
    ]


def measured(case: Case, limit: float | None = None) -> tuple[str, float, str]:
    """Status, CPU seconds, and what is to be said of a trace."""
    began = time.process_time()
    try:
        found = cb.trace(case.contact, case.control, model=case.model, time_limit=limit)
    except (cb.ModelError, cb.InputError) as error:
        return type(error).__name__, time.process_time() - began, str(error)
    branch = found.branches[0]
    folds = [event for event in found.events if event.kind == "fold"]
    stays = sum(event.verdict == "stays" for event in folds)
    text = f"rows {len(branch)}, folds {len(folds)}, stay {stays}; {found.message}"
    return found.status, time.process_time() - began, text


def main() -> None:
    """Trace and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="contacts")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--only", default="", help="numbers of contacts, separated by commas; 'named' for known ones")
    parser.add_argument("--maps", action="store_true", help="maps like measured ones")
    given = parser.parse_args()
    draw, limit = (like_measured, LIMIT_OF_MAPS) if given.maps else (drawn, LIMIT)
    warnings.simplefilter("ignore", cb.GridWarning)
    numbers = [int(k) for k in given.only.split(",") if k.isdigit()] or list(range(given.count))
    cases = named() if given.only == "named" else [draw(k, given.seed) for k in numbers]
    good, seconds = 0, []
    for number, case in zip(numbers, cases, strict=False):
        status, taken, text = measured(case, limit if given.maps else None)
        good += status == "complete" and taken <= limit
        seconds.append(taken)
        print(f"{number:3d} {status:10s} {taken:5.1f} s  {case.text}: {text[:150]}", flush=True)
    print(
        f"{good} of {len(seconds)} complete in at most {limit:g} s of CPU; median {np.median(seconds):.1f} s, longest "
        f"{max(seconds):.1f} s"
    )


if __name__ == "__main__":
    main()
