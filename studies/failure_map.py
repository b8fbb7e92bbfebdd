"""Where methods fail: method × law × sign × μ_T × resolution × control, and what becomes of each.

    python studies/failure_map.py --minutes 8        # goes on where it stopped; again until nothing is missing
    python studies/failure_map.py --draw             # figure and tables from what is known
    python studies/failure_map.py --update           # also writes the tables into docs/failure-map.md

A cell asks for the values of a control (load or displacement) at which the contact becomes unstable: pull-off, jump-in,
squeeze-out, wetting. Right is who finds those that there are and no others, within the error that he states; of methods
that state none, within 3 % of max(1, |value|) and a step. Methods are the default settings of the package (exact,
axisymmetric, rings, grids in free space and periodic), and what a user might choose elsewhere, in its plain form
(`studies/elsewhere.py`).

Every cell has a time limit, and is written to a journal as soon as it is known. Truth is a trace with an accuracy of
1e-9 and, for Maugis-Dugdale attraction, the closed form; where v'' ≥ 0 the energy is convex, and there is no fold.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import contbranch as cb
from contbranch.models.grid.resolution import Resolution
from contbranch.output.plot_view import STYLE
from contbranch.theory import maugis

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # run as a script, studies/ is not a package

from studies.benchmark_grid import start_with_one_thread, table  # noqa: E402
from studies.elsewhere import MINIMISERS, Failure, Held, Passed, Radial, Seen, jump, lattice, ramp, touches  # noqa: E402
from studies.speed_accuracy import update  # noqa: E402

RESULTS = ROOT / "studies" / "results" / "failure_map.jsonl"
TRUTHS = ROOT / "studies" / "results" / "failure_truths.json"
FIGURE = ROOT / "docs" / "figures" / "failure_map.png"
PAGE = ROOT / "docs" / "failure-map.md"

TABORS: Final = tuple(4.0**k for k in range(-3, 5))
CONTROLS: Final[tuple[Held, ...]] = ("load", "displacement")
KINDS: Final[dict[str, Any]] = {
    "exponential": cb.Exponential,
    "gauss": cb.Gauss,
    "van-der-waals": cb.VanDerWaals,
    "inverse-square": cb.InverseSquare,
    "maugis-dugdale": cb.MaugisDugdale,
}
CONVEX: Final = ("exponential", "inverse-square", "maugis-dugdale")  # where they repel
LOST: Final = ("pull-off", "jump-in", "squeeze-out", "wetting")
RISING: Final = ("jump-in", "squeeze-out")

RIGHT, WRONG, TRAPPED, RETRACED = "right", "wrong without a word", "trapped by the lattice", "retraced"
DIVERGED, ITERATIONS, TIME, REFUSED = "diverged", "out of iterations", "out of time", "refused with a reason"
OUTCOMES: Final = (RIGHT, REFUSED, TRAPPED, RETRACED, DIVERGED, ITERATIONS, TIME, WRONG)

# Relative errors of what the others are compared with, at most.
KNOWN = 1e-6
# Of methods that state no error; steps of a ramp; seconds of a cell, and of the package's own settings.
ALLOWED, STEPS = 0.03, 40
LIMIT, OWN_LIMIT = 5.0, 30.0
# What a fold on a grid may be off whatever its error estimate: it is said that such a one stays.
STAYS = 1e-3
# A stated error larger than this share of max(1, |value|) says that the value is worthless.
WORTHLESS = 0.1
# Σ 1/R³ over a square lattice: what the images of a periodic cell do to the curvature of a tip.
IMAGES = 9.033621683100950


@dataclass(frozen=True)
class Subject:
    """A contact, reduced units."""

    law: str
    sign: int
    tabor: float

    @property
    def contact(self) -> cb.Contact:
        """In reduced units."""
        return cb.Contact.reduced(KINDS[self.law], tabor=self.tabor, sign=self.sign)

    @property
    def convex(self) -> bool:
        """Whether the energy is, so that there is one equilibrium for every value, and no fold."""
        return self.sign < 0 and self.law in CONVEX


@dataclass(frozen=True)
class Truth:
    """What is known of a contact.

    Attributes
    ----------
    lost : dict
        By control: the names of the folds at which stability is lost, and their values.
    window : dict
        By control: smallest and largest value of all events.
    load : float
        The largest load of an event, at least 1.
    radius : float
        Contact radius at the end of the trace.
    depth : float
        Largest displacement of the trace.
    """

    lost: Mapping[str, Mapping[str, float]]
    window: Mapping[str, tuple[float, float]]
    load: float
    radius: float
    depth: float


@cache
def truth(subject: Subject) -> Truth | None:
    """What is known of a contact; None if nothing is. Kept in a file, as some take a minute."""
    key = f"{subject.law}|{subject.sign}|{subject.tabor:g}"
    known = json.loads(TRUTHS.read_text(encoding="utf-8")) if TRUTHS.exists() else {}
    if key not in known:
        found = _truth(subject)
        known[key] = None if found is None else asdict(found)
        TRUTHS.parent.mkdir(exist_ok=True)
        TRUTHS.write_text(json.dumps(known, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    return None if known[key] is None else Truth(**known[key])


def _clock(seconds: float) -> Callable[[float, str], None]:
    """A progress callback that ends a computation after so much processor time."""
    end = time.process_time() + seconds

    def check(fraction: float, text: str) -> None:
        if time.process_time() > end:
            raise cb.Stop

    return check


def _truth(subject: Subject) -> Truth | None:
    for accuracy in (1e-9, 1e-7, 3e-8):
        diagram = cb.trace(subject.contact, accuracy=accuracy, modes=0, progress=_clock(OWN_LIMIT))
        ended = bool(diagram.events) and diagram.events[-1].kind == "end"
        scaled = [e.error[control] / max(1.0, abs(getattr(e, control))) for e in diagram.events for control in CONTROLS]
        known = diagram.status == "complete" or (ended and max(scaled) < KNOWN)  # if not to the last digit asked
        if known:
            break
    events = [event for event in diagram.events if event.kind in ("fold", "touch")]
    if not known and not subject.convex:
        return None
    lost: dict[str, dict[str, float]] = {control: {} for control in CONTROLS}
    for event in events if not subject.convex else ():
        if event.name in LOST and event.control in lost:
            lost[event.control][event.name] = float(getattr(event, event.control))
    if subject.law == "maugis-dugdale" and subject.sign > 0:
        zone = {"work_of_adhesion": 1.0, "interaction_range": 1.0 / subject.tabor}
        lost["load"]["pull-off"] = float(maugis.load_fold(**zone).load)
        lost["displacement"]["pull-off"] = float(maugis.displacement_fold(**zone).displacement)
    window = {}
    for control in CONTROLS:
        values = [float(getattr(event, control)) for event in events]
        window[control] = (min(values, default=0.0), max(values, default=1.0))
    rows = diagram.branches[0]
    return Truth(
        lost, window, max(1.0, window["load"][1]), float(rows.contact_radius[-1]), float(rows.displacement.max())
    )


# -- methods ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Claim:
    """What a method says of one control.

    Attributes
    ----------
    folds : tuple of (name, value, error)
        Where stability is lost; an error that is not stated is None.
    reason : str
        What it says against its own answer; empty if nothing.
    step : float
        Of the control.
    whole : bool
        Whether it has come to its end, and calls none of its values worthless.
    """

    folds: tuple[tuple[str, float, float | None], ...]
    reason: str = ""
    step: float = 0.0
    whole: bool = True


Claims = Mapping[str, "Claim | Failure"]


@dataclass(frozen=True)
class Method:
    """How a contact is treated.

    Attributes
    ----------
    name : str
    resolution : str
    own : bool
        Whether it is a default setting of the package.
    laws : tuple of str
    claims : callable
        What is said of both controls.
    """

    name: str
    resolution: str
    own: bool
    laws: tuple[str, ...]
    claims: Callable[[Subject, Method], Claims]

    @property
    def nodes(self) -> int:
        """The resolution as a number."""
        return int(self.resolution)


def _traced(subject: Subject, method: Method) -> Claims:
    """By default settings: what a diagram says, and what it says against itself."""
    models = {"free grid": cb.FreeSpace, "periodic grid": cb.Periodic}
    model: Any = models[method.name](grid=method.nodes) if method.name in models else "auto"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            diagram = cb.trace(subject.contact, model=model, progress=_clock(OWN_LIMIT))
        except (cb.InputError, cb.ModelError) as error:
            return {control: Claim((), str(error), whole=False) for control in CONTROLS}
    reasons = [str(one.message) for one in caught if issubclass(one.category, cb.GridWarning)]
    if diagram.status != "complete":
        reasons.append(diagram.message)
    if "stopped by its progress callback" in diagram.message:
        return {control: Failure(TIME, diagram.message) for control in CONTROLS}
    claims = {}
    for control in CONTROLS:
        folds = [event for event in diagram.folds(control) if event.name in LOST]
        said = tuple((str(fold.name), float(getattr(fold, control)), float(fold.error[control])) for fold in folds)
        rough = [fold for fold in folds if fold.error[control] > WORTHLESS * max(1.0, abs(getattr(fold, control)))]
        doubts = [f"{fold.name} ± {fold.error[control]:.2g}" for fold in rough]
        whole = diagram.status == "complete" and not doubts
        claims[control] = Claim(said, " ".join(reasons + doubts), whole=whole)
    return claims


def _ramps(subject: Subject, control: Held, known: Truth) -> tuple[list[float], list[float]]:
    """Values of the control of a ramp up and of one down: beyond all events by a third of their distance."""
    low, high = known.window[control]
    margin = max((high - low) / 3.0, 0.3 * max(1.0, abs(low), abs(high)))
    top = high + margin
    if control == "load":
        top = max(1.0, top)
        # under a load that pulls there is nothing without contact
        up = np.linspace(0.0 if subject.sign > 0 else 0.02 * top, top, STEPS + 1)
        down = np.linspace(top, low - margin if subject.sign > 0 else 0.02 * top, STEPS + 1)
        return up.tolist(), down.tolist()
    values = np.linspace(low - margin, top, STEPS + 1)
    return values.tolist(), values[::-1].tolist()


def _named(subject: Subject, passed: Passed, falling: bool, least: float, expected: bool) -> tuple[Any, ...]:
    """The fold that a ramp shows: where it jumps; where one is expected, also where the contact appears or vanishes."""
    value = jump(passed, least)
    if value is None and expected:
        value = touches(passed)
    names = ("pull-off", "jump-in") if subject.sign > 0 else ("wetting", "squeeze-out")
    return () if value is None else ((names[0] if falling else names[1], value, None),)


def _relaxed(subject: Subject, method: Method) -> Claims:
    """A minimiser under a load or displacement that is raised and lowered."""
    known = truth(subject)
    assert known is not None
    claims: dict[str, Claim | Failure] = {}
    for control in CONTROLS:
        until = time.process_time() + LIMIT
        try:
            setup = lattice(subject.contact, "free", method.nodes)
            up, down = _ramps(subject, control, known)
            found: list[Any] = []
            for values, falling in ((up, False), (down, True)):
                if control == "load" and not falling and subject.sign > 0:
                    continue  # there is no stable state without contact under a load
                passed = ramp(setup.problem, MINIMISERS[method.name.split()[0]], control, values, until)
                names = [name for name in known.lost[control] if (name in RISING) is not falling]
                found += _named(subject, passed, falling, 2.0 * setup.lattice.spacing, bool(names))
            claims[control] = Claim(tuple(found), step=abs(up[1] - up[0]))
        except Failure as failure:
            claims[control] = failure
    return claims


def _radial(subject: Subject, method: Method, known: Truth) -> tuple[Radial, list[float]]:
    """A fixed mesh as long as what interacts, and values of the contact coordinate from far away to the end."""
    law = subject.contact.interaction
    assert law is not None
    far = law.reach(1e-6)
    reach = 1.2 * math.sqrt(2.0 * (max(known.depth, 0.0) + min(far, 30.0 / subject.tabor)))
    radial = Radial(subject.contact, method.nodes, max(reach, 1.2 * known.radius))
    end = max(known.radius, 0.3) ** 2
    near = 0.01 / subject.tabor
    outer = -np.geomspace(min(far, 30.0 / subject.tabor), near, 40)
    inner = np.linspace(0.0, math.sqrt(end), 41)[1:] ** 2
    return radial, [*outer.tolist(), *inner.tolist()]


def _turns(places: Sequence[float], values: Sequence[float]) -> list[tuple[bool, float]]:
    """Turning points of a polyline, whether they are maxima, and their values by parabolas through three points."""
    found = []
    for k in range(1, len(values) - 1):
        near, here = np.array(values[k - 1 : k + 2]), np.array(places[k - 1 : k + 2])
        if (near[1] - near[0]) * (near[2] - near[1]) < 0.0 and np.ptp(here) > 0.0 and len(set(here)) == 3:
            a, b, c = np.polyfit(here - here[1], near, 2)
            found.append((bool(near[1] > near[0]), float(c - b * b / (4.0 * a))))
    return found


def _careful(subject: Subject, method: Method) -> Claims:
    """A fixed uniform mesh, followed in the contact coordinate, which changes one way: all errors are the mesh's."""
    known = truth(subject)
    assert known is not None
    try:
        radial, coordinates = _radial(subject, method, known)
        states = [radial.seen(x) for x in radial.along(coordinates)]
    except Failure as failure:
        return dict.fromkeys(CONTROLS, failure)
    return {control: Claim(tuple(_of_curve(subject, control, states))) for control in CONTROLS}


def _of_curve(subject: Subject, control: Held, states: Sequence[Seen]) -> list[tuple[str, float, None]]:
    """The folds of a curve that comes from far away: stability is lost at its first maximum and at its last minimum.

    Turning points between these are unstable on both sides. Under a load that attracts there is nothing stable before
    the first maximum.
    """
    turns = _turns([state.closeness for state in states], [getattr(state, control) for state in states])
    names = ("jump-in", "pull-off") if subject.sign > 0 else ("squeeze-out", "wetting")
    highest, lowest = ([value for above, value in turns if above is kind] for kind in (True, False))
    told: list[tuple[str, float, None]] = [(names[1], lowest[-1], None)] if lowest else []
    if highest and not (control == "load" and subject.sign > 0):
        told.append((names[0], highest[0], None))
    return told


def _stepped(subject: Subject, method: Method) -> Claims:
    """Natural-parameter stepping up and down."""
    known = truth(subject)
    assert known is not None
    claims: dict[str, Claim | Failure] = {}
    for control in CONTROLS:
        until = time.process_time() + LIMIT
        try:
            radial, coordinates = _radial(subject, method, known)
            states = radial.along(coordinates)
            up, down = _ramps(subject, control, known)
            found: list[Any] = []
            places = np.array([getattr(radial.seen(x), control) for x in states])
            for values, falling in ((up, False), (down, True)):
                if control == "load" and not falling and subject.sign > 0:
                    continue
                # on the stable part from which the ramp comes: the first state of that value, or the last
                order = np.argsort(np.abs(places - values[0]), kind="stable")[:3]
                start = states[max(order) if falling else min(order)]
                passed = radial.stepped(start, control, values, until)
                found += _named(subject, passed, falling, 0.0, False)
            claims[control] = Claim(tuple(found), step=abs(up[1] - up[0]))
        except Failure as failure:
            claims[control] = failure
    return claims


def _secants(subject: Subject, method: Method) -> Claims:
    """Pseudo-arclength along secants, without a guard."""
    known = truth(subject)
    assert known is not None
    claims: dict[str, Claim | Failure] = {}
    for control in CONTROLS:
        try:
            radial, coordinates = _radial(subject, method, known)
            start = radial.along(coordinates[:1])[0]
            states = radial.followed(start, coordinates[-1], control, time.process_time() + LIMIT)
        except Failure as failure:
            claims[control] = failure
            continue
        places = np.array([state[-1] for state in states])
        if (np.diff(places) < 0.0).sum() > 2:  # the coordinate of the true curve only grows
            claims[control] = Failure(RETRACED, f"turned round {int((np.diff(places) < 0.0).sum())} times")
        else:
            claims[control] = Claim(tuple(_of_curve(subject, control, [radial.seen(x) for x in states])))
    return claims


def _eigenvalues(subject: Subject, method: Method, kept: int = 4) -> Claims:
    """Folds where the number of negative ones among the few eigenvalues nearest to zero changes, along a good curve."""
    known = truth(subject)
    assert known is not None
    claims: dict[str, Claim | Failure] = {}
    for control in CONTROLS:
        try:
            radial, coordinates = _radial(subject, method, known)
            states = radial.along(coordinates)
            counts = [radial.indices(x, control, kept) for x in states]
        except Failure as failure:
            claims[control] = failure
            continue
        values = [getattr(radial.seen(x), control) for x in states]
        names = ("jump-in", "pull-off") if subject.sign > 0 else ("squeeze-out", "wetting")
        lost = [k for k in range(len(counts) - 1) if counts[k] == 0 < counts[k + 1]]
        won = [k for k in range(len(counts) - 1) if counts[k] > 0 == counts[k + 1]]
        told = [(names[0], max(values[k : k + 2]), None) for k in lost]
        told += [(names[1], min(values[k : k + 2]), None) for k in won]
        if control == "load" and subject.sign > 0:
            told = [one for one in told if one[0] != "jump-in"]
        claims[control] = Claim(tuple(told), step=0.02 * max(map(abs, values)))
    return claims


LAWS: Final = tuple(KINDS)
TWO: Final = ("exponential", "gauss")
METHODS: Final = (
    Method("axisymmetric, exact", "auto", True, LAWS, _traced),
    Method("free grid", "48", True, LAWS[:3], _traced),
    Method("free grid", "64", True, TWO, _traced),
    Method("periodic grid", "48", True, LAWS[:3], _traced),
    Method("L-BFGS-B ramp", "32", False, TWO, _relaxed),
    Method("FIRE ramp", "32", False, TWO, _relaxed),
    Method("natural-parameter steps", "96", False, TWO, _stepped),
    Method("secant arclength", "96", False, TWO, _secants),
    Method("nearest-zero eigenvalues", "96", False, TWO, _eigenvalues),
    Method("fixed mesh", "48", False, TWO, _careful),
    Method("fixed mesh", "96", False, TWO, _careful),
)


# -- judging ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cell:
    """What became of one method with one contact, resolution and control.

    Attributes
    ----------
    method, resolution : str
    law : str
    sign : int
    tabor : float
    control : str
    outcome : str
        One of `OUTCOMES`.
    detail : str
        What was found, and what is right; or the reason.
    seconds : float
        Processor time of both controls together, at the first one; 0 at the other.
    own : bool
    """

    method: str
    resolution: str
    law: str
    sign: int
    tabor: float
    control: str
    outcome: str
    detail: str
    seconds: float
    own: bool

    @property
    def task(self) -> tuple[str, str, str, int, float]:
        """What both controls have in common."""
        return self.method, self.resolution, self.law, self.sign, self.tabor


def judge(subject: Subject, method: Method, control: Held, claim: Claim | Failure) -> tuple[str, str]:
    """The class of an answer, and what is to be said of it."""
    if isinstance(claim, Failure):
        return claim.kind, str(claim)
    known = truth(subject)
    told = ", ".join(
        f"{name} {value:.6g}" + ("" if error is None else f" ± {error:.1g}") for name, value, error in claim.folds
    )
    if known is None:
        return (REFUSED, claim.reason) if claim.reason else (WRONG, f"nothing is known to compare with: {told}")
    right = known.lost[control]
    wanted = ", ".join(f"{name} {value:.6g}" for name, value in right.items()) or "none"
    words = f"found {told or 'none'}; right: {wanted}"
    names = [name for name, _, _ in claim.folds]
    # A hysteresis narrower than what is allowed may be seen or not.
    narrow = len(right) == 2 and np.ptp(list(right.values())) < ALLOWED * max(1.0, *map(abs, right.values()))
    same = sorted(names) == sorted(right) or (narrow and not method.own and set(names) <= set(right))
    if same and all(_within(subject, method, control, one, right[one[0]], claim.step) for one in claim.folds):
        return (RIGHT, words) if claim.whole else (REFUSED, claim.reason)
    if claim.reason:
        return REFUSED, claim.reason
    if method.name.endswith("ramp") and Resolution.of(lattice(subject.contact, "free", method.nodes)).ratio > 1.0:
        return TRAPPED, words
    return WRONG, words


def _within(
    subject: Subject, method: Method, control: Held, fold: tuple[str, float, float | None], exact: float, step: float
) -> bool:
    """Whether a value is right: within its own error, or within what is allowed to those that state none."""
    _, value, error = fold
    scale = max(1.0, abs(exact))
    if error is None:
        return abs(value - exact) <= ALLOWED * scale + step
    shift = 0.0
    if "grid" in method.name:
        error = max(error, STAYS * scale)
    if method.name == "periodic grid":
        # The array is another contact: images flatten the tip, and the loads of folds are those of another radius.
        edge = lattice(subject.contact, "periodic", method.nodes).edge
        known = truth(subject)
        assert known is not None
        load = max(map(abs, known.window["load"]))
        shift = IMAGES * load * scale / (math.pi * edge**3)
    return abs(value - exact) <= error + shift + 2e-9 * scale


def measured(subject: Subject, method: Method) -> list[Cell]:
    """Both controls' cells of one method and contact."""
    began = time.process_time()
    if not method.own and truth(subject) is None:
        return []
    began = time.process_time()
    claims: Claims
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            claims = method.claims(subject, method)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError) as error:
        claims = dict.fromkeys(CONTROLS, Failure(DIVERGED, f"{type(error).__name__}: {error}"))
    seconds = time.process_time() - began
    cells = []
    for k, control in enumerate(CONTROLS):
        outcome, detail = judge(subject, method, control, claims[control])
        where = (method.name, method.resolution, subject.law, subject.sign, subject.tabor, control)
        cells.append(Cell(*where, outcome, detail[:600], 0.0 if k else seconds, method.own))
    return cells


def tasks(chosen: Sequence[Method] = METHODS) -> Iterator[tuple[Method, Subject]]:
    """All that is to be done, ramps last: they take longest."""
    chosen = sorted(chosen, key=lambda method: method.name.endswith("ramp"))
    for method in chosen:
        for law in method.laws:
            for sign in (1, -1):
                for tabor in TABORS:
                    yield method, Subject(law, sign, tabor)


def load_cells(path: Path = RESULTS) -> list[Cell]:
    """What is known; of a cell that was done twice, the last."""
    if not path.exists():
        return []
    cells = [Cell(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines() if line]
    return list({(cell.task, cell.control): cell for cell in cells}.values())


def run(minutes: float, path: Path = RESULTS, chosen: Sequence[Method] = METHODS) -> list[Cell]:
    """Do what is missing, as long as there is time, and keep a journal."""
    cells, end = load_cells(path), time.monotonic() + 60.0 * minutes
    done = {cell.task for cell in cells}
    path.parent.mkdir(exist_ok=True)
    for method, subject in tasks(chosen):
        if (method.name, method.resolution, subject.law, subject.sign, subject.tabor) in done:
            continue
        if time.monotonic() > end:
            print("not finished: go on with the same command")
            break
        found = measured(subject, method)
        cells += found
        with path.open("a", encoding="utf-8") as journal:
            journal.writelines(json.dumps(asdict(cell), ensure_ascii=False) + "\n" for cell in found)
        for cell in found:
            where = f"{cell.method} {cell.resolution} {cell.law} {cell.sign:+d} {cell.tabor:g} {cell.control}"
            print(f"{where}: {cell.outcome} ({cell.seconds:.1f} s) {cell.detail[:150]}", flush=True)
    return cells


# -- output -----------------------------------------------------------------------------------------------------------

# Colour and letter of each outcome; the letter is for those who do not tell the colours apart.
LOOKS: Final = {
    RIGHT: ("#E3EEF6", ""),
    REFUSED: ("#9CC3DF", "r"),
    TRAPPED: ("#F0E442", "T"),
    RETRACED: ("#CC79A7", "B"),
    DIVERGED: ("#E69F00", "D"),
    ITERATIONS: ("#009E73", "I"),
    TIME: ("#888888", "t"),
    WRONG: ("#C43C00", "W"),
}
UNKNOWN: Final = "#FFFFFF"
NAMES: Final = {
    "exponential": "Exponential",
    "gauss": "Gauss",
    "van-der-waals": "Van der Waals",
    "inverse-square": "Inverse square",
    "maugis-dugdale": "Maugis-Dugdale",
}


def label(tabor: float) -> str:
    """A power of four as it is written."""
    return f"{tabor:g}" if tabor >= 1.0 else f"1/{1 / tabor:g}"


def draw(cells: Sequence[Cell]) -> Figure:
    """All methods on the two laws that each has been tried with; and the default settings on all laws."""
    rows = list(dict.fromkeys((cell.method, cell.resolution) for cell in cells))
    own = list(dict.fromkeys((cell.method, cell.resolution) for cell in cells if cell.own and cell.law not in TWO))
    blocks: list[tuple[list[tuple[str, str]], list[tuple[str, int]]]] = [
        (rows, [(law, sign) for law in TWO for sign in (1, -1)]),
        (own, [(law, sign) for law in LAWS if law not in TWO for sign in (1, -1)]),
    ]
    heights = [len(lines) for lines, subjects in blocks for _ in CONTROLS]
    with mpl.rc_context(STYLE | {"xtick.minor.visible": False, "ytick.minor.visible": False}):
        figure = Figure(figsize=(7.6, 0.165 * sum(heights) + 2.6), layout="constrained")
        FigureCanvasAgg(figure)
        parts = figure.subfigures(len(heights), 1, height_ratios=[height + 3.2 for height in heights])
        for part, ((lines, subjects), control) in zip(
            parts, ((block, control) for block in blocks for control in CONTROLS), strict=True
        ):
            panels = part.subplots(1, len(subjects), sharey=True, squeeze=False)[0]
            for axes, (law, sign) in zip(panels, subjects, strict=True):
                here = [c for c in cells if c.control == control and (c.law, c.sign) == (law, sign)]
                _panel(axes, here, lines)
                axes.set_title(f"{NAMES[law]},\n{'attraction' if sign > 0 else 'repulsion'}", fontsize=7.0)
            words = [f"{name}, {grid}" if grid.isdigit() else name for name, grid in lines]
            panels[0].set_yticks(range(len(lines)), words, fontsize=6.0)
            part.supylabel(f"{control} held", fontsize=7.5)
        handles = [Patch(facecolor=colour, edgecolor="0.6", label=f"{letter}: {name}".removeprefix(": "))
                   for name, (colour, letter) in LOOKS.items()]  # fmt: skip
        figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    return figure


def _panel(axes: Axes, cells: Sequence[Cell], rows: Sequence[tuple[str, str]]) -> None:
    codes = np.full((len(rows), len(TABORS)), -1)
    for cell in cells:
        if (cell.method, cell.resolution) in rows:
            i, j = rows.index((cell.method, cell.resolution)), TABORS.index(cell.tabor)
            codes[i, j] = list(LOOKS).index(cell.outcome)
            axes.text(j, i, LOOKS[cell.outcome][1], ha="center", va="center_baseline", fontsize=5.0)
    colours = ListedColormap([UNKNOWN, *(colour for colour, _ in LOOKS.values())])
    axes.imshow(codes, cmap=colours, vmin=-1, vmax=len(LOOKS) - 1, aspect="auto", interpolation="none")
    axes.set_xticks(range(len(TABORS)), [label(tabor) for tabor in TABORS], rotation=90, fontsize=5.5)
    axes.tick_params(length=0)
    axes.set_xticks(np.arange(0.5, len(TABORS) - 1), minor=True)
    axes.set_yticks(np.arange(0.5, len(rows) - 1), minor=True)
    axes.grid(True, which="minor", color="white", linewidth=0.6)
    axes.tick_params(which="minor", length=0)
    axes.set_xlabel("$\\mu_T$", labelpad=1.0, fontsize=7.0)


def summary(cells: Sequence[Cell]) -> str:
    """How often each method ends how, as Markdown."""
    head = ("method", "resolution", "cells", *OUTCOMES)
    rows = []
    for method, resolution in dict.fromkeys((cell.method, cell.resolution) for cell in cells):
        counts = Counter(cell.outcome for cell in cells if (cell.method, cell.resolution) == (method, resolution))
        rows.append([method, resolution, str(counts.total()), *(str(counts[one] or "") for one in OUTCOMES)])
    own = [cell for cell in cells if cell.own]
    bad = [cell for cell in own if cell.outcome not in (RIGHT, REFUSED)]
    minutes, wrong = sum(cell.seconds for cell in cells) / 60.0, sum(cell.outcome == WRONG for cell in own)
    said = (
        f"{len(cells)} cells in {minutes:.0f} minutes of one processor; {len(own)} of default settings, of which "
        f"{len(bad)} ({100.0 * len(bad) / max(1, len(own)):.1f} %) are neither right nor refused with a reason, and "
        f"{wrong} wrong without a word."
    )
    return "\n\n".join([said, table(head, rows)])


def failures(cells: Sequence[Cell]) -> str:
    """Cells of default settings that are neither right nor refused with a reason, as Markdown."""
    rows = [
        [cell.method, cell.resolution, f"{cell.law} {'attraction' if cell.sign > 0 else 'repulsion'}",
         label(cell.tabor), cell.control, cell.outcome, cell.detail]
        for cell in cells
        if cell.own and cell.outcome not in (RIGHT, REFUSED)
    ]  # fmt: skip
    return table(("method", "resolution", "contact", "μ_T", "control", "outcome", "detail"), rows) if rows else "None."


def main() -> None:
    """Run, draw, and write what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1e9, help="begin nothing more after so many")
    parser.add_argument("--only", default="", help="methods whose names begin like this")
    parser.add_argument("--draw", action="store_true", help="draw, and print tables, from what is known")
    parser.add_argument("--update", action="store_true", help="also write them into docs/failure-map.md")
    arguments = parser.parse_args()
    if not (arguments.draw or arguments.update):
        start_with_one_thread()
        run(arguments.minutes, chosen=[one for one in METHODS if one.name.startswith(arguments.only)])
        return
    order = [(method.name, method.resolution) for method in METHODS]
    cells = sorted(load_cells(), key=lambda cell: order.index((cell.method, cell.resolution)))
    print(summary(cells), failures(cells), sep="\n\n")
    draw(cells).savefig(FIGURE, dpi=200)
    if arguments.update:
        update(PAGE, "failure map", summary(cells))
        update(PAGE, "failures", failures(cells))


if __name__ == "__main__":
    main()
