"""A hundred synthetic force curves fitted: are the true values inside the intervals stated, and how long does it take?

    python studies/fit_synthetic.py [--count 100] [--seed 1]

Curves of three laws with μ_T from 0.1 to 20, soft and stiff springs, noise of 0.5 to 3 % of the pull-off, baseline and
tilt, 200 to 4,000 points; some begin behind the jump-in, some end before the pull-off. They are made from quasi-static
loops traced to 1e-7, not from the tables that fits use.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

import contbranch as cb

LAWS = ("maugis-dugdale", "exponential", "van-der-waals")
# Rows of a loop that are farther apart than this have others solved for between them.
WIDE = 0.12
FREE = ("work_of_adhesion", "modulus", "range")


@dataclass(frozen=True)
class Case:
    """A curve with what it was made of."""

    curve: cb.ForceCurve
    contact: cb.Contact
    truth: dict[str, float]
    kind: str


def force_curve(loop: cb.Hysteresis, spring: float, piezo: np.ndarray[Any, Any], direction: int) -> Any:
    """The force over piezo positions on one way of a loop: leg after leg, from jump to jump."""
    path = loop.path
    place = path.displacement + path.load / spring
    legs = [leg for leg in np.unique(path.leg) if path.direction[path.leg == leg][0] == direction]
    ends = [place[path.leg == leg][-1] for leg in legs[:-1]]
    force = np.zeros_like(piezo)
    began = -math.inf
    for leg, end in zip(legs, [*(direction * z for z in ends), math.inf], strict=True):
        inside = (direction * piezo >= began) & (direction * piezo < end)
        began = end
        z, f = drawn(loop, path.leg == leg, spring)
        force[inside] = np.interp(piezo[inside], z, f, left=0.0)
    return force


def drawn(loop: cb.Hysteresis, own: np.ndarray[Any, Any], spring: float) -> tuple[Any, Any]:
    """Piezo positions and forces of a leg, close enough to be joined by straight lines.

    On a scale of the contact's area or of the gap that ends at first touch, load and displacement are smooth.
    """
    path, contact = loop.path, loop.contact
    rows = np.array([getattr(path, name)[own] for name in ("displacement", "load", "contact_radius", "central_gap")])
    steps = np.abs(np.diff(scale(contact, rows)))
    for k in np.flatnonzero(steps > WIDE)[::-1]:
        between = np.linspace(*rows[0, k : k + 2], math.ceil(steps[k] / WIDE) + 1)[1:-1]
        solved = [cb.solve(contact, displacement=float(d)) for d in between]
        added = np.array([[one.displacement, one.load, one.contact_radius, one.central_gap] for one in solved]).T
        ends = np.sort(scale(contact, rows[:, k : k + 2]))
        same = (ends[0] < scale(contact, added)) & (scale(contact, added) < ends[1])  # not another equilibrium
        rows = np.insert(rows, [k + 1] * int(same.sum()), added[:, same], axis=1)
    at, columns = scale(contact, rows), []
    for side in (at <= 0.0, at >= 0.0):
        known, first = np.unique(at[side], return_index=True)
        if known.size > 1:
            spline = CubicSpline(known, rows[:2, side][:, first], axis=1)
            columns.append(spline(np.linspace(known[0], known[-1], 4000)))
    displacement, load = np.concatenate(columns or [rows[:2]], axis=1)
    z, first = np.unique(displacement + load / spring, return_index=True)
    return z, load[first]


def scale(contact: cb.Contact, rows: np.ndarray[Any, Any]) -> Any:
    """Where states are: roots of the logarithms of gap or contact area, from negative values to positive ones."""
    area = (rows[2] / contact.scales.in_plane) ** 2 - rows[3] / contact.scales.normal
    return np.sign(area) * np.sqrt(np.arcsinh(np.abs(area) * contact.tabor))


def make(rng: np.random.Generator, number: int) -> Case:
    """A case with random parameters."""
    law = LAWS[number % 3]
    tabor = float(np.exp(rng.uniform(math.log(0.1), math.log(20.0))))
    radius = float(np.exp(rng.uniform(math.log(20.0), math.log(5000.0))))
    work = float(np.exp(rng.uniform(math.log(0.005), math.log(0.2))))
    width = float(np.exp(rng.uniform(math.log(0.3), math.log(3.0))))
    modulus = math.sqrt(radius * work**2 / (tabor * width) ** 3)
    contact = cb.Contact.physical(radius=radius, modulus=modulus, interaction=law, work_of_adhesion=work, range=width)
    scales = contact.scales
    spring = scales.stiffness * float(np.exp(rng.uniform(math.log(0.05), math.log(5.0))))
    pull = 5.0 * scales.load
    most = pull * float(rng.uniform(0.5, 4.0))
    loop = cb.hysteresis(contact, control=cb.Spring(spring), accuracy=1e-7, max_load=most)
    place = loop.path.displacement + loop.path.load / spring
    high = float(place.max())
    low = min([jump.position for jump in loop.jumps] + [-3.0 * scales.normal, -8 * width])
    low -= 0.4 * (high - low)
    count = int(np.exp(rng.uniform(math.log(200), math.log(4000)))) // 2
    kind = ["whole", "whole", "whole", "no jump-in", "cut"][number % 5] if number >= 5 else "whole"
    up, down = np.linspace(low, high, count), np.linspace(high, low, count)
    if kind == "no jump-in":  # it begins behind it
        begin = max((jump.position for jump in loop.jumps[:1]), default=low)
        up = up[up > begin + 0.1 * (high - begin)]
    if kind == "cut":
        end = min([jump.position for jump in loop.jumps], default=low)
        down = down[down > end + 0.15 * (high - end)]
    force = np.append(*(force_curve(loop, spring, way, sign) for way, sign in ((up, 1), (down, -1))))
    piezo = np.append(up, down)
    segment = np.append(np.zeros(up.size), np.ones(down.size)).astype(int)
    truth = {
        "work_of_adhesion": work,
        "modulus": modulus,
        "range": width,
        "contact_point": float(rng.uniform(-200, 200)),
        "baseline": float(rng.uniform(-1, 1)) * pull,
        "tilt": float(rng.uniform(-0.05, 0.05)) * pull / (high - low),
    }
    noise = float(rng.uniform(0.005, 0.03)) * abs(float(force.min()))
    piezo = piezo + truth["contact_point"]
    force = force + truth["baseline"] + truth["tilt"] * piezo + noise * rng.standard_normal(piezo.size)
    curve = cb.ForceCurve(piezo=piezo, force=force, spring=spring, segment=segment)
    factors = [float(np.exp(rng.uniform(-1.0, 1.0))) for _ in range(3)]
    start = cb.Contact.physical(
        radius=radius,
        modulus=modulus * factors[0],
        interaction=law,
        work_of_adhesion=work * factors[1],
        range=width * factors[2],
    )
    return Case(curve, start, truth, f"{law} mu={tabor:.2f} K={spring / scales.stiffness:.2f} n={piezo.size} {kind}")


def main() -> None:
    """Fit the curves and print what has come of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    inside = outside = far = unknown = 0
    times = []
    for number in range(asked.first, asked.first + asked.count):
        case = make(np.random.default_rng((asked.seed, number)), number)
        began = time.process_time()
        try:
            fit = cb.fit(case.curve, case.contact, FREE)
        except (cb.InputError, cb.ModelError) as error:
            print(f"{number:3d} {case.kind}: {error}", flush=True)
            continue
        times.append(time.process_time() - began)
        marks = []
        for name, true in case.truth.items():
            sigma = (fit.values[name] - true) / fit.errors[name] if fit.errors[name] else math.inf
            if name not in fit.determined:
                unknown += 1
                marks.append(f"({name} {fit.values[name] / true:.2f})")
                continue
            inside += abs(sigma) <= 1.96
            outside += abs(sigma) > 1.96
            far += abs(sigma) > 5.0
            if abs(sigma) > 1.96:
                marks.append(f"{name} {sigma:+.1f}")
        print(
            f"{number:3d} {case.kind} {times[-1]:.1f} s {fit.status} {fit.rms / fit.noise:.2f} {' '.join(marks)}",
            flush=True,
        )
    total = inside + outside
    share = total / max(total + unknown, 1)
    print(f"inside {inside}/{total} = {inside / max(total, 1):.3f}; beyond 5 errors {far}; determined {share:.3f}")
    print(f"median time {np.median(times):.2f} s, largest {max(times):.1f} s")


if __name__ == "__main__":
    main()
