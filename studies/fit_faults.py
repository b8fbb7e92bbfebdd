"""Synthetic force curves with one fault of an instrument each: is what their fits call determined true?

    python studies/fit_faults.py [--count 200] [--seed 1] [--kind NAME]

JKR's and Hertz' closed forms on a cantilever, 300 to 4,000 samples, noise of 0.2 to 3 % of the pull-off, in nm and nN.
Data could tell a value if one leg alone tells it to 5 %: the bound of Cramér and Rao for samples that the fault has not
spoilt and that are at no jump. Of legs that differ the approach has to tell the modulus, the retraction the adhesion.
"""

import argparse
import math
import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

import contbranch as cb

Array = np.ndarray[Any, Any]
# Kinds of faults; of ten curves so many are of JKR, the others of Hertz. "none" is drawn only if it is asked for.
KINDS = {
    "saturated-pull-off": 10, "saturated-top": 6, "begins-in-contact": 0, "staircase": 7, "dropouts": 6, "drag": 6,
    "drift": 6, "retract-only": 8, "approach-only": 5, "pause-unnamed": 7, "pause-named": 7, "unequal": 6, "order": 6,
    "repeated": 6, "legs-differ": 5, "steps-at-pull-off": 10, "tether": 6, "long-baseline": 5, "start-off": 5,
    "tilted": 5, "none": 5,
}  # fmt: skip
# The bound below which data could tell a value, errors beyond which a value is wrong, a step of derivatives.
ABLE, BEYOND, STEP = 0.05, 5.0, 1e-3


@dataclass(frozen=True)
class Contact:
    """A paraboloid on an elastic half-space, pressed by a spring up to a load; JKR's, or Hertz' without adhesion."""

    modulus: float
    work_of_adhesion: float
    radius: float
    spring: float
    top: float

    @cached_property
    def branch(self) -> tuple[Array, Array]:
        """Positions of the piezo from the contact point and forces, from where contact breaks to thrice the top."""
        modulus, work, radius = self.modulus, self.work_of_adhesion, self.radius
        largest = (0.75 * radius * (6 * self.top + 14 * math.pi * work * radius) / modulus) ** (1 / 3)
        wide = largest * np.linspace(0.0, 1.0, 20_000) ** 1.5
        load = 4 * modulus * wide**3 / (3 * radius) - np.sqrt(8 * math.pi * work * modulus * wide**3)
        place = wide**2 / radius - np.sqrt(2 * math.pi * wide * work / modulus) + load / self.spring
        stable = slice(int(np.argmin(place)), None)
        return place[stable], load[stable]

    def force(self, place: Array | float, retract: Array | bool) -> Array:
        """The force: on approach surfaces touch where they would without adhesion."""
        begin = np.where(retract, self.branch[0][0], 0.0)
        return np.where(place >= begin, np.interp(place, *self.branch), 0.0)

    def at(self, force: float) -> float:
        """The position at a force behind the least one."""
        place, load = (column[np.argmin(self.branch[1]) :] for column in self.branch)
        return float(np.interp(force, load, place))


@dataclass
class Case:
    """A curve with what it was made of; pairs are of approach and retraction, the leg of a pause is 2."""

    kind: str
    contacts: tuple[Contact, Contact]
    points: tuple[float, float]
    scale: float  # the pull-off, or without one the largest force
    noise: float
    piezo: Array  # where the samples truly are
    leg: Array
    told: Array  # whether samples tell of the contact
    start: dict[str, float]
    curve: cb.ForceCurve = field(init=False)

    def fitted(self, **settings: Any) -> cb.Fit:
        """The fit of the curve."""
        law: Any = {"interaction": "maugis-dugdale", "range": 0.5} if "work_of_adhesion" in self.start else {}
        contact = cb.Contact.physical(radius=self.contacts[0].radius, **(self.start | law))
        return cb.fit(self.curve, contact, [*self.start], law="jkr" if law else None, **settings)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def drawn(rng: np.random.Generator, adhesive: bool) -> tuple[Contact, float]:
    """A contact and a noise that go together: JKR's regime, no contact wider than the tip, springs of cantilevers."""
    while True:
        radius, modulus, work = log_uniform(rng, 10, 1e4), log_uniform(rng, 3e-7, 10), log_uniform(rng, 1e-3, 0.2)
        depth, pull = radius * log_uniform(rng, 0.02, 0.4), 1.5 * math.pi * work * radius
        top, spring = 4 / 3 * modulus * math.sqrt(radius) * depth**1.5, 2 * modulus * math.sqrt(radius * depth)
        possible = 1.0 < depth < 4000 and top > 0.03
        if adhesive:
            length = (radius * (work / modulus) ** 2) ** (1 / 3)
            top, spring = pull * log_uniform(rng, 0.7, 5), pull / (math.pi ** (2 / 3) * length)
            possible = length / 0.4 > 1.5 and work / (modulus * radius) < 0.012 and pull > 0.02
        spring *= log_uniform(rng, 0.15, 4)
        if possible and 0.02 <= spring <= 40:
            noise = (pull if adhesive else top / 30) * log_uniform(rng, 0.002, 0.03)
            return Contact(modulus, work * adhesive, radius, spring, top), noise


def positions(kind: str, rng: np.random.Generator, low: float, high: float, count: int) -> Array:
    """The piezo positions of an approach between two ends."""
    way, number, times = np.linspace(low, high, count), np.arange(count), rng.integers(2, 6)
    if kind == "unequal":  # at random, or denser near the contact point
        rate = np.cumsum(1 + rng.uniform(3, 8) * np.exp(-((way / (0.6 * high)) ** 2)))
        ways = np.sort(rng.uniform(low, high, count)), np.interp(np.linspace(rate[0], rate[-1], count), rate, way)
        return ways[times % 2]
    if kind == "repeated":  # each of them some times, or at random, or a few of them often
        few = np.append(number, np.repeat(rng.integers(5, count - 5, 3), 10))
        return way[np.sort([number // times * times, rng.integers(0, count, count), few][rng.integers(0, 3)])]
    return way


def make(kind: str, adhesive: bool, rng: np.random.Generator) -> Case:
    """A curve with a fault."""
    (contact, noise), uniform, sign = drawn(rng, adhesive), rng.uniform, rng.choice([-1, 1])
    top, count = contact.top, max(round(log_uniform(rng, 300, 4000)) // 2, 700 * (kind == "long-baseline"))
    scale = 1.5 * math.pi * contact.work_of_adhesion * contact.radius if adhesive else top
    high, end = contact.at(top), float(contact.branch[0][0])
    span, far = high - end, (high - end) * (uniform(8, 13) if kind == "long-baseline" else uniform(0.4, 1.5))
    low = contact.at(top * uniform(0.02, 0.3)) if kind == "begins-in-contact" else end - far
    stiffer = uniform(1.1, 1.6) if kind == "legs-differ" else 1.0
    apart, other = (high - low) / count, replace(contact, modulus=stiffer * contact.modulus)
    relaxed = uniform(0.05, 0.3) if kind.startswith("pause") and rng.random() < 0.7 else 0.0
    shift = high - other.at((1 - relaxed) * top)  # the retraction begins at the same force, or at the relaxed one
    up, down = positions(kind, rng, low, high, count), positions(kind, rng, low, high, count)[::-1]
    back, begin, level = down - shift, end, float(contact.branch[1][0])
    loads = [contact.force(up, False), other.force(back, True)]
    for _ in range(rng.integers(1, 3) if kind == "steps-at-pull-off" else 0):
        level, length = level * uniform(0.2, 0.6), uniform(0.06, 0.2) * span + 3 * apart
        part = (back < begin) & (back >= begin - length)
        loads[1][part] = level - 0.3 * contact.spring * uniform(0.02, 0.3) * (begin - back[part])
        begin -= length
    if kind == "tether":  # of one force, or of one that grows
        held, length = uniform(0.05, 0.3) * (scale if adhesive else 0.3 * top), uniform(0.15, 0.8) * far
        part = (back < end) & (back >= end - length)
        away, grown = (end - back[part]) / length, uniform(0.3, 1.0) * (rng.random() < 0.5)
        loads[1][part] -= held * (1 + grown * away) * (1.0 if adhesive else np.minimum(1.0, 5.0 * away))
    drag = uniform(0.01, 0.1) * scale * (kind == "drag")
    drift = sign * uniform(0.05, 0.25) * scale * (kind == "drift") * np.linspace(0, 1, down.size)
    stay = int(count * uniform(0.1, 0.8)) + 10 if kind.startswith("pause") else 0
    creep = (relaxed or uniform(0.05, 0.2)) * top * (1 - np.exp(-np.linspace(0, 4, stay)))
    point = sign * uniform(0, 1) * log_uniform(rng, 100, 5000)
    piezo = np.concatenate([up, high + 0.3 * apart * rng.standard_normal(stay), down]) + point
    tilt = uniform(0.3, 2.0) * (1.0 if adhesive else 0.3) if kind == "tilted" else uniform(-0.05, 0.05)
    start = {"work_of_adhesion": log_uniform(rng, 0.2, 5) * contact.work_of_adhesion} if adhesive else {}
    start["modulus"] = contact.modulus * (10.0 ** (3 * sign) if kind == "start-off" else log_uniform(rng, 0.2, 5))
    leg = np.repeat([0, 2, 1], [up.size, stay, down.size])
    case = Case(kind, (contact, other), (point, point + shift), scale, noise, piezo, leg, leg < 2, start)
    load = np.concatenate([loads[0] + drag, top - creep, loads[1] - drag + drift])
    record(case, rng, load, (uniform(-1, 1) * scale, sign * tilt * scale / (high - low)), apart)
    return case


def record(case: Case, rng: np.random.Generator, load: Array, line: tuple[float, float], apart: float) -> None:
    """Give a case the curve as an instrument records it: above a line, with noise, and with a fault of the record."""
    kind, contact, piezo, leg, uniform = case.kind, case.contacts[0], case.piezo, case.leg, rng.uniform
    noise, choice, shown = case.noise * rng.standard_normal(leg.size), rng.integers(0, 6), piezo
    if kind == "staircase":  # rounded in the record, or as the piezo moves
        step = apart * uniform(2, 9)
        shown = step * (np.floor if choice < 2 else np.round)(piezo / step)
        if choice > 3:
            piezo, load = shown, contact.force(shown - case.points[0], leg == 1)
    force = load + line[0] + line[1] * piezo + noise
    if kind.startswith("saturated"):  # the detector ends with a sharp or a soft bend; noise is before it or behind it
        low = kind == "saturated-pull-off"
        turn, end = (-1.0, uniform(0.35, 0.9) * case.scale) if low else (1.0, uniform(0.4, 0.85) * contact.top)
        knee, behind = end * (uniform(0.75, 0.95) if rng.random() < 0.6 else 1.0), choice % 2
        seen = turn * (load if behind else load + noise)
        bent = knee + (end - knee) * np.tanh((seen - knee) / max(end - knee, 1e-12))
        force = line[0] + turn * np.where(seen > knee, bent, seen) + behind * noise
        case.told &= turn * load <= knee - 2 * case.noise
    if kind == "dropouts":  # zeros or spikes
        bad = rng.random(piezo.size) < uniform(0.003, 0.02)
        bad[rng.integers(0, piezo.size)] = True
        spikes = force + rng.choice([-1, 1], piezo.size) * uniform(0.5, 4, piezo.size) * case.scale
        force, case.told = np.where(bad, 0.0 if choice % 2 else spikes, force), case.told & ~bad
    words, kept = np.array(["approach", "retract", "pause"])[leg], np.arange(piezo.size)
    if kind == "order":  # the retraction first, or both legs by growing positions
        kept = np.lexsort((piezo, leg)) if choice % 2 else np.argsort(leg == 0, kind="stable")
    if kind.endswith("-only"):
        kept = kept[words == kind.removesuffix("-only")]
    unnamed = kind == "pause-unnamed" or (kind == "approach-only" and choice % 2)
    case.piezo, case.leg, case.told = piezo[kept], leg[kept], case.told[kept]
    case.curve = cb.ForceCurve(shown[kept], force[kept], contact.spring, None if unnamed else words[kept])


def bounds(case: Case, leg: int) -> dict[str, float]:
    """Relative errors by Cramér and Rao of what a leg tells, with contact point and line unknown."""
    contact, place = case.contacts[leg], case.piezo - case.points[leg]
    (at, load), own = contact.branch, case.told & (case.leg == leg)
    begin = at[0] if leg else 0.0
    own &= np.abs(place - begin) > 3 * np.ptp(place) / max(own.sum(), 1)  # samples at jumps tell of their places only
    slopes = [np.interp(place, at, np.gradient(load, at))]
    for name in case.start:
        other = replace(contact, **{name: (1 + STEP) * getattr(contact, name)})
        slopes.append((np.interp(place, *other.branch) - np.interp(place, at, load)) / STEP)
    columns = np.vstack([np.array(slopes) * (place >= begin), np.ones(place.size), place / np.ptp(place)])
    errors = case.noise * np.linalg.norm(np.linalg.pinv(columns[:, own]), axis=0)
    return {name: float(error) or math.inf for name, error in zip(case.start, errors[1:], strict=False)}


def able(case: Case) -> set[str]:
    """The values that the data could tell."""
    legs, alike = [bounds(case, leg) for leg in (0, 1)], case.points[0] == case.points[1]
    told = {name: legs if alike else [legs[name == "work_of_adhesion"]] for name in case.start}
    return {name for name, own in told.items() if min(leg[name] for leg in own) < ABLE}


def deviations(case: Case, fit: cb.Fit) -> dict[str, float]:
    """By how many errors values called determined are off; of legs at once all between the two is true."""
    found = dict[str, float]()
    for leg, one in {"": fit, **(fit.legs or {})}.items():
        for name in {*case.start, "contact_point"} & {*one.determined}:
            own = [int(leg == "retract" or (name == "work_of_adhesion" and not leg))] if fit.legs else [0, 1]
            true = [case.points[k] if name == "contact_point" else getattr(case.contacts[k], name) for k in own]
            off = max(min(true) - one.values[name], one.values[name] - max(true), 0.0)
            found[f"{leg} {name}".strip()] = off / one.errors[name]
    return found


def main() -> None:
    """Fit the curves and print what has come of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS)
    asked = parser.parse_args()
    kinds = [asked.kind] if asked.kind else [*KINDS][:-1]
    rows: list[tuple[str, int, int, int, float]] = []
    for number in range(asked.count):
        turn, kind = number // len(kinds), kinds[number % len(kinds)]
        case = make(kind, 7 * turn % 10 < KINDS[kind], np.random.default_rng((asked.seed, [*KINDS].index(kind), turn)))
        could, off, known, began = able(case), dict[str, float](), set[str](), time.perf_counter()
        try:
            fit = case.fitted()
            off, known, words = deviations(case, fit), {*fit.determined}, fit.message
        except (cb.InputError, cb.ModelError) as error:
            words = str(error)
        said = [f"{name} {errors:.1f} errors off" for name, errors in off.items() if errors > BEYOND]
        rows.append((kind, len(could), len(could & known), len(said), time.perf_counter() - began))
        if said := said + [f"{name} not determined" for name in could - known]:
            print(f"{kind} {turn}, {' and '.join(case.start)}: {', '.join(said)}. {words}", flush=True)
    print("\nkind                 curves  values determined of those that could be  wrong  time: median, largest")
    for kind in (*kinds, "all"):
        _, many, told, wrong, times = zip(*(row for row in rows if kind in ("all", row[0])), strict=True)
        much = f"{sum(told):4d} of {sum(many):4d} ({100 * sum(told) / max(sum(many), 1):3.0f} %)"
        print(f"{kind:20s} {len(many):6d} {much:>41s} {sum(wrong):6d} {np.median(times):8.2f} {max(times):9.2f} s")


if __name__ == "__main__":
    main()
