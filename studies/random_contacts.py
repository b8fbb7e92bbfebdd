"""Contacts drawn at random: are they traced, in what time, and do their curves obey what every curve must obey?

python studies/random_contacts.py [--seed 1] [--count 100] [--limit 20] [--check 0.3] [--only K …] [--output FILE.jsonl]

Tips: parabola, power laws r^1.2 to r^6, cones, caps, measured profiles (coarse, noisy, ending early). Laws: every one
of the package, sums of either sign, layers, tables (fine, coarse, noisy, ending early), and laws that a user may write,
with kinks and steps among them. Tabor coefficients from 1e-3 to 60, three controls, three accuracies.

Every contact runs in a process of its own and prints one line of JSON; those that a FILE has already are not run again.
The number of a contact and the seed say all of it. Checked along each curve: gap ≥ 0 and wall pressure ≥ 0, dV = F dd,
the virial of scaling (tips z ∝ rⁿ), indices that change at folds alone, no turn of load or displacement without its
fold, no fold that is there twice, no row that turns back, finite error estimates no larger than what was asked. With
`--check` a share of the complete ones is traced anew at a hundredth of the accuracy, and thresholds are compared with
their stated errors; so are states that are solved for, at a load between two rows, next to first touch, next to folds.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import random
import resource
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

import contbranch as cb
from contbranch.contact.validity import energy_pole
from contbranch.continuation import CorrectionError
from contbranch.control import as_control
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.trace import Request
from contbranch.curve.track import Track, linked
from contbranch.curve.work import Piece, work_along
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.choice import choose

Array = NDArray[np.float64]

# Gap, in units of the shortest range, and wall pressure, in units of the largest pressure or the law's own, may be this
# much below zero, or this multiple of the accuracy.
PENETRATION, POINTWISE = 2e-3, 100.0
# Energies may differ from the work of the load by this multiple of the rows' errors, and what a quadrature leaves open.
WORK = 20.0
# The virial holds to this multiple of the accuracy of the rows, relative to load and displacement of 1 at least.
VIRIAL, ROWS = 100.0, 1e-6
# Rows whose fields are looked at.
LOOKED_AT = 25
# Largest distance of an event row from the followed curve, relative to max(1, |value|); the work between them is F Δd.
EVENT_ROW_SHIFT = 1e-3
# A curve that turns back has an angle between two chords whose cosine is below this.
BACK = -0.9
# Thresholds may differ by this multiple of their stated errors; the share of the accuracy at which they are recomputed.
HONEST, FINER = 3.0, 0.01


# -- laws that users may write ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Rational(cb.Interaction):
    """f = 1/(1 + x²)², no force at contact, a long tail."""

    name: ClassVar[str] = ""

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """f, f', f''."""
        base = 1 + x * x
        return base**-2, -4 * x * base**-3, (20 * x * x - 4) * base**-4


@dataclass(frozen=True)
class Screened(cb.Interaction):
    """f = (1 + x) exp(−x)."""

    name: ClassVar[str] = ""

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """f, f', f''."""
        fall = np.exp(-x)
        return (1 + x) * fall, -x * fall, (x - 1) * fall


@dataclass(frozen=True)
class Ramp(cb.Interaction):
    """A pressure that falls linearly to zero at x = 2: its slope jumps there."""

    name: ClassVar[str] = ""

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """f, f', f''."""
        left = np.maximum(1 - x / 2, 0.0)
        return left**2, -left, np.where(x < 2, 0.5, 0.0)


@dataclass(frozen=True)
class Step(cb.Interaction):
    """A pressure that falls steeply, over a tenth of the range, where x = 1."""

    name: ClassVar[str] = ""

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """f, f', f''."""
        width = 0.1
        y = (1 - x) / width
        whole = width * np.logaddexp(0.0, 1 / width)
        share = 1 / (1 + np.exp(-y))
        return width * np.logaddexp(0.0, y) / whole, -share / whole, share * (1 - share) / (width * whole)


USERS = (Rational, Screened, Ramp, Step)


# -- what is drawn ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Drawn:
    """A contact, what is asked of it, and both in words."""

    contact: cb.Contact
    asked: Mapping[str, Any]
    words: str


def draw(seed: int, number: int) -> Drawn:
    """The contact of that number.

    Raises
    ------
    InputError
        If it is refused.
    """
    rng = random.Random(f"{seed}/{number}")
    tip, shape = draw_tip(rng)
    tabor = math.exp(rng.uniform(math.log(1e-3), math.log(60.0)))
    modulus = rng.choice([1.0, 1.0, 3.0])
    range_ = tip.reduced_scales(1.0 / modulus)[1] / tabor
    law, words = draw_law(rng, range_)
    asked: dict[str, Any] = {"accuracy": rng.choice([1e-4, 1e-6, 1e-8])}
    kind = rng.choice(["load", "displacement", "spring"])
    asked["control"] = cb.Spring(math.exp(rng.uniform(-2.0, 2.0))) if kind == "spring" else kind
    text = f"{shape}, {words}, tabor {tabor:.3g}, {kind}, accuracy {asked['accuracy']:g}"
    contact = cb.Contact(tip, law, modulus)
    if rng.random() < 0.2:
        share = math.exp(rng.uniform(-1.0, 4.0))
        asked["max_load"] = share * contact.scales.load
        text += f", up to {share:.3g}"
    return Drawn(contact, asked, text)


def draw_tip(rng: random.Random) -> tuple[cb.Tip, str]:
    """A tip and its description."""
    kind = rng.choice(["parabola", "parabola", "parabola", "cone", "power", "power", "cap", "profile"])
    if kind == "cone":
        slope = round(math.exp(rng.uniform(-2.0, 1.0)), 3)
        return cb.Cone(slope), f"cone {slope}"
    if kind == "power":
        exponent = round(rng.uniform(1.2, 6.0), 3)
        return cb.PowerLaw(exponent, 1.0), f"power {exponent}"
    if kind == "cap":
        radius = round(math.exp(rng.uniform(0.0, 4.0)), 3)
        return cb.SphericalCap(radius), f"cap {radius}"
    if kind == "parabola":
        return cb.Parabola(1.0), "parabola"
    way = rng.choice(["fine", "coarse", "noisy", "short"])
    count, end = {"fine": (40, 10.0), "coarse": (7, 8.0), "noisy": (25, 8.0), "short": (20, 2.0)}[way]
    radii = np.linspace(0.0, end, count)
    heights = np.sqrt(1 + radii**2) - 1 if rng.random() < 0.5 else radii**2 / 2
    if way == "noisy":
        heights[1:] *= 1 + 1e-3 * np.array([rng.gauss(0, 1) for _ in radii[1:]])
    return cb.Profile(tuple(radii.tolist()), tuple(heights.tolist())), f"profile {way}"


def draw_law(rng: random.Random, range_: float) -> tuple[cb.Interaction, str]:
    """A law and its description."""
    sign = rng.choice([1.0, -1.0])
    smooth = (cb.Exponential, cb.Gauss, cb.VanDerWaals, cb.InverseSquare)
    kind = rng.choice(["alone"] * 4 + ["sum"] * 2 + ["layered", "tabulated", "user", "dugdale"])
    if kind == "alone":
        law = rng.choice(smooth)
        return law(sign, range_), f"{sign:+g} {law.name}"
    if kind == "dugdale":
        return cb.MaugisDugdale(sign, range_), f"{sign:+g} maugis-dugdale"
    if kind == "user":
        own = rng.choice(USERS)
        return own(sign, range_), f"{sign:+g} {own.__name__}"
    if kind == "layered":
        wave, phase = round(rng.uniform(1.0, 4.0), 2), rng.choice([0.0, 0.5])
        return cb.Layered(sign, range_, wave * range_, phase), f"{sign:+g} layered {wave} {phase}"
    if kind == "sum":
        first, second = rng.sample(smooth, 2)
        share, ratio = round(rng.uniform(0.1, 0.9), 3), round(math.exp(rng.uniform(-1.5, 1.5)), 3)
        law = first(sign * share, range_) + second(-sign * (1 - share), ratio * range_)
        return law, f"{sign * share:+.3g} {first.name} {-sign * (1 - share):+.3g} {second.name} of {ratio} ranges"
    way = rng.choice(["fine", "coarse", "noisy", "short"])
    count, end = {"fine": (60, 15.0), "coarse": (9, 8.0), "noisy": (40, 10.0), "short": (30, 2.0)}[way]
    law = rng.choice(smooth[:3])
    gaps = np.linspace(0.0, end, count) * range_
    energies = np.array(law(sign, range_).evaluate(gaps).energy)
    if way == "noisy":
        energies += 1e-3 * np.array([rng.gauss(0, 1) for _ in gaps])
    return cb.Tabulated(tuple(gaps.tolist()), tuple(energies.tolist())), f"{sign:+g} {law.name} tabulated {way}"


# -- what must hold ---------------------------------------------------------------------------------------------------
def violations(diagram: cb.Diagram) -> Iterator[str]:
    """What does not hold along a curve."""
    branch, scales = diagram.branches[0], diagram.contact.scales
    if len(branch.load) < 2:
        return
    yield from _rows(diagram)
    if diagram.status == "complete":
        for event in diagram.events:
            for name, unit in (("load", scales.load), ("displacement", scales.normal)):
                error, value = event.error[name] / unit, getattr(event, name) / unit
                if not error <= diagram.accuracy * max(1.0, abs(value)):
                    yield f"error of {name} {error:.2g} at {event.name or event.kind}"
        for control in ("load", "displacement", "spring"):  # as told by all that is seen of a state
            for first, second in pairwise(diagram.folds(control)):
                errors = {name: first.error[name] + second.error[name] for name in first.error}
                if all(abs(getattr(first, name) - getattr(second, name)) <= errors[name] for name in errors):
                    yield f"the fold of {control} at load {first.load:.6g} is there twice"
    allowed = max(PENETRATION, POINTWISE * diagram.accuracy)
    terms = diagram.contact.interaction.terms
    ranges, own = [term.range for term in terms], max(abs(term.work_of_adhesion) / term.range for term in terms)
    for row in dict.fromkeys(np.linspace(0, len(branch.load) - 1, LOOKED_AT).astype(int).tolist()):
        profile = branch.state(row).profile
        gap, largest = np.nan_to_num(profile.gap, posinf=1e300), max(own, float(np.abs(profile.pressure).max()))
        if not gap.min() >= -allowed * min(ranges):
            yield f"gap {gap.min() / min(ranges):.2g} ranges at row {row}"
            break
        if not profile.wall_pressure.min() >= -allowed * largest:
            yield f"wall pressure {profile.wall_pressure.min() / largest:.2g} at row {row}"
            break
    for event in diagram.events:
        wrong = _virial(event)
        if not wrong <= VIRIAL * max(ROWS, diagram.accuracy):
            yield f"virial {wrong:.2g} at {event.name or event.kind}"


def _rows(diagram: cb.Diagram) -> Iterator[str]:
    """What does not hold from row to row."""
    branch, scales = diagram.branches[0], diagram.contact.scales
    load, d = branch.load / scales.load, branch.displacement / scales.normal
    radius, gap = branch.contact_radius / scales.in_plane, branch.central_gap / scales.normal
    energy = branch.energy / scales.energy
    numbers = np.array([load, d, radius, gap, energy])
    if not np.isfinite(numbers).all():
        yield "rows are not finite"
        return
    marks = {kind: [event.position for event in diagram.folds(kind)] for kind in ("load", "displacement")}

    def near(kind: str, row: float) -> bool:
        return any(abs(place - row) <= 2 for place in marks[kind])

    error = {"load": branch.load_error / scales.load, "displacement": branch.displacement_error / scales.normal}
    corners = any(isinstance(term, cb.MaugisDugdale) for term in diagram.contact.interaction.terms)  # where these end
    for kind, values, index in (
        ("load", load, branch.unstable_load),
        ("displacement", d, branch.unstable_displacement),
    ):
        for row in np.flatnonzero(np.diff(index)):
            if not near(kind, row) and not corners:
                yield f"the index under {kind} changes at row {row} without a fold"
        steps, allowed = np.diff(values), error[kind][1:] + error[kind][:-1]
        clear = np.flatnonzero(np.abs(steps) > 3 * allowed)
        for first, second in pairwise(clear):
            if steps[first] * steps[second] < 0 and not any(first <= p <= second + 1 for p in marks[kind]):
                yield f"{kind} turns at row {second} without a fold"
    places = [event.position for event in diagram.events]
    chords = np.diff(np.array([load / max(1.0, np.ptp(load)), d / max(1.0, np.ptp(d)), radius, gap]), axis=1)
    lengths = np.linalg.norm(chords, axis=0)
    for row in range(len(lengths) - 1):
        if min(lengths[row : row + 2]) > 1e-4:
            cosine = float(chords[:, row] @ chords[:, row + 1] / (lengths[row] * lengths[row + 1]))
            if cosine < BACK and not any(abs(place - row) <= 2 for place in places):
                yield f"the curve turns back at row {row + 1}"
    yield from _work(diagram, load, d, energy, np.array(list(error.values())))


def _work(diagram: cb.Diagram, load: Array, d: Array, energy: Array, error: Array) -> Iterator[str]:
    """V grows by ∫ F dd; smooth between events of the contact set, by splines of two orders through the rows."""
    breaks = sorted({0, len(load) - 1, *(int(e.position) for e in diagram.events if e.kind in ("touch", "topology"))})
    for first, last in pairwise(breaks):
        own = slice(first, last + 1)
        count = last + 1 - first
        if count < 8:
            continue
        points = np.array([load[own], d[own]])
        spans = np.array([max(1e-12, np.ptp(row)) for row in points])[:, None]
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points / spans, axis=1), axis=0) + 1e-12)])
        near = np.arange(count - 1) < (3 if first else 0)  # next to a change of the contact set nothing is a polynomial
        work = []
        for order in (3, 5):
            try:
                pair = make_interp_spline(length, points.T, k=order)
            except (ValueError, np.linalg.LinAlgError):  # points that coincide
                return
            nodes, weights = np.polynomial.legendre.leggauss(6)
            width = np.diff(length)
            at = length[:-1, None] + width[:, None] * (nodes + 1) / 2
            product = pair(at)[..., 0] * pair.derivative()(at)[..., 1]
            work.append((product @ weights) * width / 2)
        rows = error[:, own]
        allowed = np.abs(points[0]) * rows[1] + np.abs(points[1]) * rows[0] + rows.prod(axis=0)
        far = np.abs(np.diff(np.arcsinh(points / 0.1), axis=1)).max(axis=0) > 0.4  # too far apart for a quadrature
        allowed = WORK * (allowed[1:] + allowed[:-1]) + 20 * np.abs(work[1] - work[0])
        allowed[far | near] = np.inf
        # Energies, whose errors are not stated, are known as well as loads are at best.
        known = np.maximum(1e-6, rows[0] / np.maximum(np.abs(points[0]), 1.0))
        allowed += np.maximum(known[1:], known[:-1]) * np.maximum(np.abs(energy[own][1:]), 1.0)
        change = np.diff(energy[own])
        off = np.abs(change - work[1])
        for worst in np.argsort(off / allowed)[::-1] if diagram.status == "complete" else ():
            if off[worst] <= allowed[worst]:
                break
            off[worst] = abs(change[worst] - _followed(diagram, first + worst, load, d))
            if not off[worst] <= allowed[worst]:
                yield f"dV − F dd = {off[worst]:.2g} (allowed {allowed[worst]:.2g}) at row {first + worst}"
                break


def _followed(diagram: cb.Diagram, row: int, load: Array, d: Array) -> float:
    """∫ F dd from a row to the next along the curve itself, followed anew; nan if there is no such piece of it.

    Rows that are events lie beside those of the curve as it was followed, as far as finer meshes have them elsewhere.
    """
    contact = diagram.contact
    held = as_control(diagram.control if diagram.stiffness is None else cb.Spring(diagram.stiffness))
    request = Request(diagram.accuracy, held.scaled(contact.scales.stiffness), load[-1])
    points = _track(contact, request).points
    places = np.array([[point.observables[name] for name in ("load", "displacement")] for point in points])
    away = np.abs(places - [load[row], d[row]]).sum(axis=1)
    begin = int(np.argmin(away))
    if not away[begin] <= EVENT_ROW_SHIFT * max(1.0, abs(load[row]), abs(d[row])):
        return math.nan
    try:
        first, last = points[begin : begin + 2]
        work = work_along(first, [Piece(*linked(first, last))], last, 1e-10)
    except CorrectionError:
        return math.nan
    (before, behind), (left, right) = places[begin : begin + 2].T
    return work + 0.5 * ((load[row] + before) * (left - d[row]) + (load[row + 1] + behind) * (d[row + 1] - right))


@lru_cache(1)
def _track(contact: cb.Contact, request: Request) -> Track:
    return FollowedCurves(contact, choose(contact)[0]).track(request)


def _virial(event: cb.Event) -> float:
    """How far the virial of scaling is from holding, for tips z ∝ rⁿ; 0 where that is not known.

    Lengths in the plane scaled by s and heights by sⁿ leave the tip alone:
    (2n + 1) V_ela + 2 V_fr − n ∫ g p d²r = n F d.
    """
    point = getattr(getattr(event.origin, "raw", None), "place", None)
    problem = getattr(point, "problem", None)
    if not isinstance(problem, ContactProblem) or not isinstance(
        problem.equations.tip, (cb.Parabola, cb.Cone, cb.PowerLaw)
    ):
        return 0.0
    equations, fields = problem.seen(point.x, point.parameter)
    n, mesh, law, a = equations.tip.apex_exponent, equations.mesh, equations.interaction, fields.rim.radius
    if energy_pole(equations.tip, law):
        return 0.0
    load, d, energy = equations.load(fields), equations.displacement(fields), equations.energy(fields)
    nodes, weights = np.polynomial.legendre.leggauss(10)
    panels = np.arange(25.0)[:, None] + (nodes + 1) / 2
    rho = float(mesh.edges[-1]) * np.exp(panels).ravel()
    ring = (np.pi * weights * np.exp(2 * panels)).ravel() * float(mesh.edges[-1]) ** 2
    reached = mesh.weights * mesh.nodes / np.hypot(a, mesh.nodes) / np.sqrt(rho[:, None] ** 2 - mesh.nodes**2)
    lifted = reached @ fields.h - fields.rim_value * np.arctan2(rho, a)  # no h beyond the mesh
    gap = equations.tip.shape_gap(rho, a)[0] + 2 / np.pi * lifted + (0.0 if equations.contact else -fields.y)
    far = law.evaluate(gap)
    area = 2 * np.pi * mesh.weights * mesh.nodes
    surface = area @ fields.energy_density + np.pi * a * a * float(law.evaluate(np.zeros(1)).energy[0])
    surface += ring @ far.energy
    virial = area @ (fields.gap * fields.pressure) + ring @ (gap * far.pressure)
    off = (2 * n + 1) * (energy - surface) + 2 * surface - n * virial - n * load * d
    return abs(off) / (max(1.0, abs(load)) * max(1.0, abs(d), abs(energy)))


def compared(diagram: cb.Diagram, finer: cb.Diagram) -> tuple[float, str]:
    """The largest difference of thresholds in units of the stated errors, and whose it is; names that differ."""
    worst, whose = 0.0, ""
    missing = set(diagram.thresholds) ^ set(finer.thresholds)
    if missing:
        return math.inf, f"not in both: {', '.join(sorted(missing))}"
    for name, value in diagram.thresholds.items():
        error = sum(_error(one, name) for one in (diagram, finer))
        off = abs(value - finer.thresholds[name])
        if off > 0 and off / error > worst:
            worst, whose = off / error, name
    return worst, whose


def _error(diagram: cb.Diagram, name: str) -> float:
    """The stated error of a threshold: that of the event which has its value."""
    for event in diagram.events:
        for key in ("load", "displacement", "contact_radius", "central_gap"):
            if getattr(event, key) == diagram.thresholds[name]:
                return event.error[key]
    return 1e-12


def solved(drawn: Drawn, diagram: cb.Diagram, rng: random.Random) -> tuple[float, str]:
    """The same of states that are solved for: between two rows, next to first touch and next to a fold of the load."""
    accuracy, unit = drawn.asked["accuracy"], drawn.contact.scales.load
    rows, events = diagram.branches[0].load, diagram.events
    k = rng.randrange(1, len(rows))
    loads = {"between rows": rows[k - 1] + rng.random() * (rows[k] - rows[k - 1])}
    for event in (e for e in events if e.kind == "touch" or (e.kind == "fold" and e.control == "load")):
        away = rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 3) * accuracy
        loads[f"next to {event.kind} at {event.load:.6g}"] = event.load + away * max(unit, abs(event.load))
    worst, whose = 0.0, ""
    for name in ["between rows", *rng.sample(sorted(loads)[1:], min(2, len(loads) - 1))]:
        found = []
        for allowed in (accuracy, FINER * accuracy):
            try:
                states = cb.solve(drawn.contact, load=loads[name], accuracy=allowed, time_limit=30.0).states
            except cb.InputError:  # beyond a fold, or far away
                states = ()
            except cb.ModelError as error:
                if "lies beyond" not in str(error):
                    return math.inf, f"{error} {name}"
                states = ()
            found.append(states)
        beside = any(
            e.kind == "fold" and abs(e.load - loads[name]) < 10 * e.error["load"] + 10 * accuracy * unit for e in events
        )
        if len(found[0]) != len(found[1]):
            if not beside:  # whether it is beyond a fold, or so far away, may be open
                return math.inf, f"{len(found[0])} or {len(found[1])} states {name}"
            continue
        keys = ("displacement", "contact_radius", "central_gap")
        for own in found[0]:
            finer = min(found[1], key=lambda one: sum(abs(getattr(one, key) - getattr(own, key)) for key in keys))
            for key in keys:
                off = abs(getattr(own, key) - getattr(finer, key))
                error = own.error[key] + finer.error[key]
                if off > max(worst * error, 1e-14 * unit):
                    worst, whose = off / error if error else math.inf, f"{key} {name} (load {loads[name]!r})"
    return worst, whose


# -- runs -------------------------------------------------------------------------------------------------------------
def _limited(drawn: Drawn, limit: float, **changes: float) -> tuple[cb.Diagram, float, bool]:
    """The diagram, its CPU time, and whether that was the limit."""
    begin, late = time.process_time(), []

    def progress(fraction: float, text: str) -> None:
        if time.process_time() - begin > limit:
            late.append(True)
            raise cb.Stop

    diagram = cb.trace(drawn.contact, **{**drawn.asked, **changes}, progress=progress)
    return diagram, time.process_time() - begin, bool(late)


def one(seed: int, number: int, limit: float, check: float) -> dict[str, Any]:
    """All that is found out about a contact."""
    warnings.simplefilter("ignore")
    found: dict[str, Any] = {"seed": seed, "number": number, "what": ""}
    try:
        drawn = draw(seed, number)
        found["what"] = drawn.words
        diagram, cpu, late = _limited(drawn, limit)
    except cb.InputError as error:
        return found | {"status": "refused", "message": str(error)}
    except Exception as error:  # whatever it is, it is counted
        return found | {"status": "raised", "message": f"{type(error).__name__}: {error}"}
    branch = diagram.branches[0]
    found |= {
        "status": "late" if late else diagram.status,
        "cpu": round(cpu, 2),
        "points": len(branch.load),
        "message": diagram.message,
        "events": " ".join(f"{e.kind[0]}{(e.control or '')[:1]}" for e in diagram.events[:40]),
        "violated": list(violations(diagram)),
    }
    if found["status"] == "complete" and random.Random(f"check {seed}/{number}").random() < check:
        again, _, late = _limited(drawn, 10 * limit, accuracy=FINER * drawn.asked["accuracy"])
        if late or again.status != "complete":
            found["finer"] = "late" if late else again.message
        else:
            worst, whose = compared(diagram, again)
            found["off"], found["threshold"] = worst, whose
            rng = random.Random(f"solve {seed}/{number}")
            found["off_solved"], found["state"] = solved(drawn, diagram, rng)
    return found


def _in_child(seed: int, number: int, limit: float, check: float, sender: Any) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (int(14 * limit) + 5, int(14 * limit) + 10))  # for what never asks
    sender.send(one(seed, number, limit, check))


def run(seed: int, number: int, limit: float, check: float) -> dict[str, Any]:
    """The same in a process of its own."""
    receiver, sender = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.Process(target=_in_child, args=(seed, number, limit, check, sender))
    child.start()
    sender.close()
    try:
        found: dict[str, Any] = receiver.recv()
    except EOFError:
        found = {"seed": seed, "number": number, "what": "", "status": "died", "message": ""}
    child.join()
    return found


def summary(lines: list[dict[str, Any]]) -> str:
    """Counts, and what is wrong."""
    status = Counter(line["status"] for line in lines)
    tried = len(lines) - status["refused"]
    wrong = [line for line in lines if line.get("violated")]
    checked = [line for line in lines if "off" in line]
    off = [line for line in checked if not line["off"] <= HONEST]
    times = sorted(line["cpu"] for line in lines if line["status"] == "complete")
    counts = ", ".join(f"{count} {name}" for name, count in status.most_common())
    text = f"{len(lines)} contacts: {counts}; {status['complete'] / max(1, tried):.1%} of those not refused complete\n"
    if times:
        text += f"CPU time of the complete ones: median {times[len(times) // 2]:.1f} s, largest {times[-1]:.1f} s\n"
    states = [line for line in checked if not line["off_solved"] <= HONEST]
    text += f"{len(wrong)} with a violated invariant; {len(off)} of {len(checked)} checked are off by more than stated,"
    text += f" {len(states)} in states that are solved for"
    return text


def main() -> None:
    """Run them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--limit", type=float, default=20.0, help="seconds of CPU time")
    parser.add_argument("--check", type=float, default=0.0, help="share of the complete ones traced anew")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of contacts")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    numbers = range(given.count) if given.only is None else given.only
    known: dict[tuple[int, int], dict[str, Any]] = {}
    if given.output is not None and given.output.exists():
        for text in given.output.read_text(encoding="utf-8").splitlines():
            line = json.loads(text)
            known[line["seed"], line["number"]] = line
    lines = []
    try:
        for number in numbers:
            line = known.get((given.seed, number))
            if line is None:
                line = run(given.seed, number, given.limit, given.check)
                text = json.dumps(line, ensure_ascii=False)
                print(text, flush=True)
                if given.output is not None:
                    with given.output.open("a", encoding="utf-8") as file:
                        file.write(text + "\n")
            lines.append(line)
    except KeyboardInterrupt:
        pass  # what was run is summed up
    print(summary(lines), file=sys.stderr)


if __name__ == "__main__":
    main()
