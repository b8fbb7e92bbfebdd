"""Speed against accuracy: true errors of thresholds and contact radii against processor time, for many methods.

    python studies/speed_accuracy.py --minutes 8          # goes on where it stopped; again until nothing is missing
    python studies/speed_accuracy.py --draw               # figure and tables from what has been measured
    python studies/speed_accuracy.py --update             # also writes them into README.md and docs/speed-accuracy.md
    python studies/speed_accuracy.py --grids 1024         # with grids of 1024² nodes at μ_T = 1/4, too

Contacts: exponential attraction (pull-off load; contact radius at F = 1) and Gauss repulsion (loads of squeeze-out and
wetting; contact radius at 1.3 times the former), μ_T = 1/4, 1, 4, 16, and Maugis-Dugdale attraction for the exact
model. True values are those of the axisymmetric model at its best, with its error estimates; the exact model's those of
the closed form. Methods that reach stable states only are given the ramp that a user would run: states at equidistant
loads (mean gaps, offsets), each started from the one before; the step is their accuracy.

Times are those of the processor (`time.process_time`), one thread, after import, caches of meshes empty, the shortest
of up to five. tamaas and Adhesion come with ``pip install 'contbranch[benchmark]'``; one that is missing is a note.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import contbranch as cb
from contbranch.models.axisymmetric import mesh
from contbranch.models.grid.newton import Hold
from contbranch.output.plot_view import STYLE
from contbranch.theory import dmt, jkr, maugis

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # run as a script, studies/ is not a package

from studies.benchmark_grid import machine, reach_load, start_with_one_thread, table  # noqa: E402
from studies.elsewhere import MINIMISERS, Failure, jump, lattice, pressed, ramp, seen, touches  # noqa: E402
from studies.grid_peers import AdhesionCG, Case, GridSolver, Tamaas, examine  # noqa: E402

RESULTS = ROOT / "studies" / "results" / "speed_accuracy.json"
FIGURE = ROOT / "docs" / "figures" / "speed_accuracy.png"
PAGES = {"summary": ROOT / "README.md", "details": ROOT / "docs" / "speed-accuracy.md"}

TABORS: Final = (0.25, 1.0, 4.0, 16.0)
ACCURACIES: Final = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
GRIDS: Final = (64, 128, 256, 512)
# The largest grid at each Tabor coefficient, 256² where it is not told: stiff laws are traced for minutes.
FINEST_GRID: Final = {0.25: 4096}
# Of ramps: nodes a side and steps.
RAMPS: Final = ((64, 20), (64, 80), (128, 40))
PEER_RAMPS: Final = ((64, 20), (64, 80))
LIMIT: Final = 30.0  # seconds that one measurement may take, between two of its steps
FINEST: Final = (1e-12, 1e-11, 1e-10, 1e-9)
Law = Literal["exponential", "gauss", "maugis-dugdale"]
KINDS: Final = {"exponential": cb.Exponential, "gauss": cb.Gauss, "maugis-dugdale": cb.MaugisDugdale}


@dataclass(frozen=True)
class Subject:
    """A contact, reduced units.

    Attributes
    ----------
    law : {"exponential", "gauss", "maugis-dugdale"}
        The first and the last attract, the second repels.
    tabor : float
    """

    law: Law
    tabor: float

    @property
    def sign(self) -> int:
        """Of the work of adhesion."""
        return -1 if self.law == "gauss" else 1

    @property
    def contact(self) -> cb.Contact:
        """In reduced units."""
        return cb.Contact.reduced(KINDS[self.law], tabor=self.tabor, sign=self.sign)

    @property
    def folds(self) -> tuple[str, ...]:
        """Thresholds that are compared."""
        return ("pull_off_load",) if self.sign > 0 else ("squeeze_out_load", "wetting_load")

    @property
    def load(self) -> float:
        """At which contact radii are compared, in contact, with one stable state."""
        return 1.0 if self.sign > 0 else float(f"{1.3 * truth(self)['squeeze_out_load'].value:.3g}")


class True_(NamedTuple):
    """A value and its error."""

    value: float
    error: float


@cache
def truth(subject: Subject) -> dict[str, True_]:
    """Thresholds as exactly as they can be had, and the contact radius at `Subject.load`; kept with the results."""
    kept = json.loads(RESULTS.read_text(encoding="utf-8"))["truth"] if RESULTS.exists() else {}
    known = kept.get(f"{subject.law}|{subject.tabor:g}")
    return _truth(subject) if known is None else {name: True_(*value) for name, value in known.items()}


def _truth(subject: Subject) -> dict[str, True_]:
    if subject.law == "maugis-dugdale":
        # a state is known by its contact radius: the other way round it is a root
        fold = maugis.load_fold(work_of_adhesion=1.0, interaction_range=1.0 / subject.tabor)
        return {"pull_off_load": True_(float(fold.load), 1e-14), "radius": _best_radius(subject, 1.0)}
    for accuracy in FINEST:
        diagram = cb.trace(subject.contact, accuracy=accuracy, modes=0)
        if diagram.status == "complete":
            break
    known = {}
    for event in diagram.folds("load"):
        name = f"{event.name}_load".replace("-", "_")
        if name in subject.folds:
            known[name] = True_(float(event.load), float(event.error["load"]))
    load = 1.0 if subject.sign > 0 else float(f"{1.3 * known['squeeze_out_load'].value:.3g}")
    return known | {"radius": _best_radius(subject, load)}


def _best_radius(subject: Subject, load: float) -> True_:
    for accuracy in FINEST:
        state = cb.solve(subject.contact, load=load, accuracy=accuracy)
        if state.status == "complete":
            break
    return True_(float(state.contact_radius), float(state.error["contact_radius"]))


# -- methods ----------------------------------------------------------------------------------------------------------


class Answer(NamedTuple):
    """Values of thresholds or of the radius, and their error estimates where a method has some."""

    values: dict[str, float]
    estimates: dict[str, float]
    note: str = ""


@dataclass(frozen=True)
class Method:
    """How a contact is treated.

    Attributes
    ----------
    name : str
    family : str
        ``own``, ``ramp``, ``peer`` or ``theory``.
    settings : tuple of str
        One measurement each.
    laws : tuple of str
    folds, radius : callable
        The answer for a subject and a setting.
    """

    name: str
    family: str
    settings: tuple[str, ...]
    laws: tuple[str, ...]
    folds: Callable[[Subject, str], Answer]
    radius: Callable[[Subject, str], Answer]


def _traced(subject: Subject, model: Any, accuracy: float = 1e-6) -> Answer:
    """Folds of a trace to the load at which radii are compared."""
    diagram = cb.trace(
        subject.contact, model=model, accuracy=accuracy, max_load=subject.load, modes=0, time_limit=LIMIT
    )
    values, estimates = {}, {}
    for event in diagram.folds("load"):
        name = f"{event.name}_load".replace("-", "_")
        if name in subject.folds and name not in values:
            values[name], estimates[name] = float(event.load), float(event.error["load"])
    return Answer(values, estimates, "" if diagram.status == "complete" else diagram.message)


def _solved(subject: Subject, model: Any, accuracy: float = 1e-6) -> Answer:
    """Contact radius of a solution."""
    state = cb.solve(subject.contact, load=subject.load, model=model, accuracy=accuracy, time_limit=LIMIT)
    return Answer({"radius": float(state.contact_radius)}, {"radius": float(state.error["contact_radius"])})


def _grid(kind: str) -> Callable[[str], Any]:
    model = {"free": cb.FreeSpace, "periodic": cb.Periodic}[kind]
    return lambda setting: model(grid=int(setting))


def _relaxed(name: str) -> tuple[Callable[[Subject, str], Answer], Callable[[Subject, str], Answer]]:
    """Ramps of the load, and single states, by a minimiser on a cell in free space."""

    def folds(subject: Subject, setting: str) -> Answer:
        grid, steps = map(int, setting.split("/"))
        problem = lattice(subject.contact, "free", grid).problem
        until = time.process_time() + LIMIT
        if subject.sign > 0:
            # DMT's load is the largest pull-off load of a parabola
            down = ramp(problem, MINIMISERS[name], "load", np.linspace(1.0, -7.0, steps + 1).tolist(), until)
            found = {"pull_off_load": jump(down)}
        else:
            up = np.linspace(0.05, 1.0, steps + 1) * subject.load
            raised = ramp(problem, MINIMISERS[name], "load", up.tolist(), until)
            lowered = ramp(problem, MINIMISERS[name], "load", up[::-1].tolist(), until)
            found = {"squeeze_out_load": touches(raised), "wetting_load": touches(lowered)}
        return Answer({key: value for key, value in found.items() if value is not None}, {})

    def radius(subject: Subject, setting: str) -> Answer:
        problem = lattice(subject.contact, "free", int(setting.split("/")[0])).problem
        start = pressed(problem, "load", subject.load + (6.3 if subject.sign > 0 else 0.0))
        state = MINIMISERS[name](problem, start, subject.load, Hold(subject.load))
        if not state.converged:
            raise Failure("out of iterations", state.reason)
        return Answer({"radius": seen(problem, state).contact_radius}, {})

    return folds, radius


def _peer(solver: GridSolver) -> tuple[Callable[[Subject, str], Answer], Callable[[Subject, str], Answer]]:
    """Ramps of the mean gap or of the offset in a periodic cell, and states at a load found by secants."""

    def case(subject: Subject, setting: str) -> Case:
        edge = lattice(subject.contact, "periodic", 64).edge
        return Case(int(setting.split("/")[0]), edge, subject.load, subject.tabor, subject.law, subject.sign)

    def passed(case: Case, gaps: Sequence[float], until: float) -> list[tuple[float, float]]:
        """Loads and contact radii."""
        found, gap = [], None
        for mean in gaps:
            if time.process_time() > until:
                raise Failure("out of time", f"after {len(found)} steps of {len(gaps)}")
            gap = solver.solve(case, solver.value(case, mean), 1e-6, gap).gap
            worth = examine(case, gap)
            found.append((worth.load, worth.contact_radius))
        return found

    def folds(subject: Subject, setting: str) -> Answer:
        this, steps = case(subject, setting), int(setting.split("/")[1])
        until = time.process_time() + LIMIT
        # from the mean gap at the load of the comparison to where the interaction is no longer felt
        near, far = this.mean_gap_guess, float(this.heights.mean()) + 4.0 / this.tabor
        gaps = np.linspace(far, near, steps + 1).tolist()
        lowered = passed(this, gaps[::-1], until)
        if subject.sign > 0:
            return Answer({"pull_off_load": min(load for load, _ in lowered)}, {})
        raised = passed(this, gaps, until)
        films = [load for load, radius in raised if radius == 0.0]
        contacts = [load for load, radius in lowered if radius > 0.0]
        found = {"squeeze_out_load": max(films, default=None), "wetting_load": min(contacts, default=None)}
        return Answer({name: value for name, value in found.items() if value is not None}, {})

    def radius(subject: Subject, setting: str) -> Answer:
        this = case(subject, setting)
        reached = reach_load(solver, this, 1e-6, 1e-5)
        worth = examine(this, solver.solve(this, reached.value, 1e-6).gap)
        return Answer({"radius": worth.contact_radius}, {})

    return folds, radius


def _theory(name: str) -> tuple[Callable[[Subject, str], Answer], Callable[[Subject, str], Answer]]:
    """Closed forms in place of the law."""

    def folds(subject: Subject, setting: str) -> Answer:
        values = {
            "DMT": lambda: dmt.pull_off_load(),
            "JKR": lambda: jkr.load_fold().load,
            "Maugis-Dugdale": lambda: maugis.load_fold(work_of_adhesion=1.0, interaction_range=1 / subject.tabor).load,
        }
        return Answer({"pull_off_load": float(values[name]())}, {})

    def radius(subject: Subject, setting: str) -> Answer:
        if name == "Maugis-Dugdale":
            other = cb.Contact.reduced(cb.MaugisDugdale, tabor=subject.tabor)
            return Answer({"radius": float(cb.solve(other, load=subject.load, model="exact").contact_radius)}, {})
        theory = dmt if name == "DMT" else jkr
        return Answer({"radius": float(theory.contact_radius(subject.load))}, {})

    return folds, radius


BOTH: Final = ("exponential", "gauss")


def methods(grids: Sequence[int] = GRIDS) -> tuple[Method, ...]:
    """All that is compared."""
    digits, nodes = tuple(f"{one:.0e}" for one in ACCURACIES), tuple(map(str, grids))
    found = [
        Method(
            "exact",
            "own",
            ("1e-12",),
            ("maugis-dugdale",),
            lambda subject, setting: _traced(subject, "exact", float(setting)),
            lambda subject, setting: _solved(subject, "exact", float(setting)),
        ),
        Method(
            "axisymmetric",
            "own",
            digits,
            BOTH,
            lambda subject, setting: _traced(subject, "axisymmetric", float(setting)),
            lambda subject, setting: _solved(subject, "axisymmetric", float(setting)),
        ),
    ]
    for kind in ("free", "periodic"):
        model = _grid(kind)
        found.append(
            Method(
                f"{kind} grid",
                "own",
                nodes,
                BOTH,
                lambda subject, setting, model=model: _traced(subject, model(setting)),
                lambda subject, setting, model=model: _solved(subject, model(setting)),
            )
        )
    ramps = tuple(f"{grid}/{steps}" for grid, steps in RAMPS)
    found += [Method(f"{name} ramp", "ramp", ramps, BOTH, *_relaxed(name)) for name in MINIMISERS]
    settings = tuple(f"{grid}/{steps}" for grid, steps in PEER_RAMPS)
    peers: tuple[tuple[str, GridSolver, tuple[str, ...]], ...] = (
        ("tamaas ramp", Tamaas(), BOTH),
        ("Adhesion ramp", AdhesionCG(), ("exponential",)),
    )
    found += [Method(name, "peer", settings, laws, *_peer(solver)) for name, solver, laws in peers]
    found += [Method(name, "theory", ("closed form",), ("exponential",), *_theory(name))
              for name in ("DMT", "JKR", "Maugis-Dugdale")]  # fmt: skip
    return tuple(found)


# -- measuring --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Measured:
    """One method with one setting on one contact.

    Attributes
    ----------
    method, family, setting : str
    law : str
    tabor : float
    task : {"folds", "radius"}
    seconds : float
        Processor time of the whole task.
    errors : dict
        True errors, relative to max(1, |value|); of a threshold that was not found there is none.
    estimates : dict
        Error estimates, relative likewise, where a method makes some.
    note : str
        What the method says of itself, or why it has failed.
    """

    method: str
    family: str
    setting: str
    law: str
    tabor: float
    task: str
    seconds: float
    errors: dict[str, float]
    estimates: dict[str, float]
    note: str

    @property
    def key(self) -> str:
        """What tells it from others."""
        return f"{self.method}|{self.setting}|{self.law}|{self.tabor:g}|{self.task}"


Task = tuple[str, Method, str, Subject, str]


def tasks(chosen: Iterable[Method], tabors: Sequence[float] = TABORS) -> list[Task]:
    """All measurements with their keys, coarse grids first."""
    found: list[tuple[int, Task]] = []
    for tabor in tabors:
        for method in chosen:
            for law in method.laws:
                for setting in method.settings:
                    nodes, _, steps = setting.partition("/")
                    size = int(nodes) if nodes.isdigit() else 0
                    if "grid" in method.name and size > FINEST_GRID.get(tabor, 256):
                        continue
                    for task in ("folds", "radius"):
                        if task == "radius" and steps == "20":
                            continue  # a single state knows no steps: one measurement a grid
                        key = f"{method.name}|{setting}|{law}|{tabor:g}|{task}"
                        found.append((size, (key, method, setting, Subject(law, tabor), task)))  # type: ignore[arg-type]
    return [task for _, task in sorted(found, key=lambda one: one[0])]


def measure(method: Method, setting: str, subject: Subject, task: str, least: float = 0.3) -> Measured:
    """Measure one; short ones are repeated, at most five times, and the shortest time counts."""
    exact = truth(subject)
    assert math.isfinite(subject.load)
    call = method.folds if task == "folds" else method.radius
    times: list[float] = []
    answer = Answer({}, {})
    while not times or (len(times) < 5 and sum(times) < least):
        mesh.forget()
        began = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                answer = call(subject, setting)
        except Exception as error:  # whatever a foreign solver raises is a result, not the end of the others
            kind = error.kind if isinstance(error, Failure) else type(error).__name__
            answer = Answer({}, {}, f"{kind}: {error}")
        times.append(time.process_time() - began)
        if answer.note and not answer.values:
            break
    scales = {name: max(1.0, abs(one.value)) for name, one in exact.items()}
    errors = {name: abs(value - exact[name].value) / scales[name] for name, value in answer.values.items()}
    estimates = {name: value / scales[name] for name, value in answer.estimates.items() if math.isfinite(value)}
    where = (method.name, method.family, setting, subject.law, subject.tabor, task)
    return Measured(*where, min(times), errors, estimates, answer.note)


def load_results(path: Path = RESULTS) -> dict[str, Measured]:
    """What has been measured."""
    if not path.exists():
        return {}
    rows = json.loads(path.read_text(encoding="utf-8"))["measured"]
    return {row.key: row for row in (Measured(**item) for item in rows)}


def save_results(found: dict[str, Measured], path: Path = RESULTS) -> None:
    """Write all of it, and what others have written meanwhile, with the machine and the true values."""
    found = load_results(path) | found
    subjects = sorted({(row.law, row.tabor) for row in found.values()})
    exact = {
        f"{law}|{tabor:g}": {name: list(value) for name, value in truth(Subject(law, tabor)).items()}  # type: ignore[arg-type]
        for law, tabor in subjects
    }
    about = {"machine": {key: value for key, value in machine().items() if key != "load_average"}, "truth": exact}
    path.parent.mkdir(exist_ok=True)
    rows = [asdict(row) for row in found.values()]
    text = json.dumps(about | {"measured": rows}, indent=0, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def run(chosen: Iterable[Method], minutes: float, path: Path = RESULTS) -> dict[str, Measured]:
    """Measure what is missing, as long as there is time."""
    found, end = load_results(path), time.monotonic() + 60.0 * minutes
    for key, method, setting, subject, task in tasks(chosen):
        if key in found:
            continue
        if time.monotonic() > end:
            print("not finished: go on with the same command")
            break
        found[key] = row = measure(method, setting, subject, task)
        told = ", ".join(f"{name} {error:.1e}" for name, error in row.errors.items())
        print(f"{key}: {row.seconds:.3f} s; {told or '-'} {row.note[:90]}", flush=True)
        if row.seconds > 1.0 or len(found) % 20 == 0:
            save_results(found, path)
    save_results(found, path)
    return found


# -- output -----------------------------------------------------------------------------------------------------------

QUANTITIES: Final = {
    ("exponential", "pull_off_load"): "pull-off load",
    ("exponential", "radius"): "contact radius\n(attraction)",
    ("gauss", "squeeze_out_load"): "squeeze-out load",
    ("gauss", "wetting_load"): "wetting load",
    ("gauss", "radius"): "contact radius\n(repulsion)",
}
# Colour, marker and filling of each method: those of Okabe and Ito, which the colour-blind tell apart.
LOOKS: Final[dict[str, tuple[str, str, bool]]] = {
    "exact": ("#000000", "*", True),
    "axisymmetric": ("#0072B2", "o", True),
    "free grid": ("#009E73", "s", True),
    "free grid, not averaged": ("#009E73", "s", False),
    "periodic grid": ("#56B4E9", "D", True),
    "periodic grid, not averaged": ("#56B4E9", "D", False),
    "L-BFGS-B ramp": ("#D55E00", "v", True),
    "FIRE ramp": ("#E69F00", "^", True),
    "GFMD ramp": ("#E69F00", "<", False),
    "tamaas ramp": ("#CC79A7", "P", True),
    "Adhesion ramp": ("#CC79A7", "X", False),
    "DMT": ("#555555", "$D$", True),
    "JKR": ("#555555", "$J$", True),
    "Maugis-Dugdale": ("#555555", "$M$", True),
}
ROUNDING: Final = 1e-15  # where an error of nothing is drawn
FASTEST: Final = 1e-5


class Spot(NamedTuple):
    """A measurement of one quantity: seconds, true error, and by what."""

    seconds: float
    error: float
    method: str
    family: str
    setting: str


def spots(found: Iterable[Measured], law: str, quantity: str, tabor: float) -> list[Spot]:
    """All measurements of a quantity; the exact model's, of its own law, besides those of the attraction."""
    task = "radius" if quantity == "radius" else "folds"
    laws = {law, "maugis-dugdale"} if law == "exponential" else {law}
    rows = (row for row in found if row.law in laws and row.tabor == tabor and row.task == task)
    return [
        Spot(max(row.seconds, FASTEST), max(row.errors[quantity], ROUNDING), row.method, row.family, row.setting)
        for row in rows
        if quantity in row.errors
    ]


def front(points: Iterable[Spot]) -> list[Spot]:
    """Those that no other beats in both time and error (Pareto), by time; laws that are not the same count apart."""
    best: list[Spot] = []
    for spot in sorted(one for one in points if one.method != "exact"):
        if not best or spot.error < best[-1].error:
            best.append(spot)
    return best


def draw(found: Sequence[Measured], tabors: Sequence[float] = TABORS) -> Figure:
    """True errors against processor time, a panel for each quantity and Tabor coefficient, with Pareto fronts."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 8.4), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(QUANTITIES), len(tabors), sharex=True, sharey=True, squeeze=False)
        for line, ((law, quantity), words) in zip(panels, QUANTITIES.items(), strict=True):
            for axes, tabor in zip(line, tabors, strict=True):
                _panel(axes, spots(found, law, quantity, tabor))
            line[0].set_ylabel(f"Error: {words}")
        for axes, tabor in zip(panels[0], tabors, strict=True):
            axes.set_title(f"$\\mu_T = {tabor:g}$")
        figure.supxlabel("Processor time (s)", fontsize=8.5)
        handles = [_handle(name) for name in LOOKS if any(row.method == name for row in found)]
        handles.append(Line2D([], [], color="0.6", linewidth=1.0, label="Pareto front"))
        figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    return figure


def _handle(name: str) -> Line2D:
    colour, marker, filled = LOOKS[name]
    label = {"exact": "exact (Maugis-Dugdale law)", "DMT": "DMT, closed form", "JKR": "JKR, closed form"}.get(
        name, name
    )
    look: dict[str, Any] = {"marker": marker, "markersize": 5.0, "linestyle": "", "color": colour}
    return Line2D([], [], **look, markerfacecolor=colour if filled else "white", label=label)


def _panel(axes: Axes, points: Sequence[Spot]) -> None:
    best = front(points)
    if best:
        axes.step([one.seconds for one in best], [one.error for one in best], where="post", color="0.6", zorder=1)
    for name, (colour, marker, filled) in LOOKS.items():
        own = [one for one in points if one.method == name]
        if own:
            look: dict[str, Any] = {"marker": marker, "markersize": 4.0, "linestyle": "", "color": colour, "zorder": 3}
            x, y = [one.seconds for one in own], [one.error for one in own]
            axes.plot(x, y, **look, markeredgewidth=0.8, markerfacecolor=colour if filled else "white")
    axes.set(xscale="log", yscale="log", xlim=(0.5 * FASTEST, 200.0), ylim=(0.3 * ROUNDING, 3.0))
    axes.set_xticks([1e-4, 1e-2, 1.0, 1e2])
    axes.set_yticks([1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
    axes.minorticks_off()
    axes.grid(True, which="major", color="0.92", linewidth=0.6)


def fastest(points: Iterable[Spot], error: float, *families: str) -> Spot | None:
    """The fastest measurement of some families (or of one method) with an error that is small enough."""
    able = [one for one in points if one.error <= error and (one.family in families or one.method in families)]
    return min(able, default=None)


GRIDS_HERE: Final = tuple(name for name in LOOKS if "grid" in name)


def ratios(found: Sequence[Measured], error: float, first: Sequence[str], second: Sequence[str]) -> list[float]:
    """Times of the fastest of the first over those of the fastest of the second, at an error, where both reach it."""
    values = []
    for law, quantity in QUANTITIES:
        for tabor in sorted({row.tabor for row in found}):
            here = spots(found, law, quantity, tabor)
            one, other = fastest(here, error, *first), fastest(here, error, *second)
            if one is not None and other is not None:
                values.append(one.seconds / other.seconds)
    return values


def _range(values: Sequence[float]) -> str:
    """Median, smallest and largest."""
    low, middle, high = (_short(float(np.quantile(values, share))) for share in (0.0, 0.5, 1.0))
    return f"{middle} ({low} to {high}, {len(values)} cases)"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def summary(found: Sequence[Measured]) -> str:
    """What is of most interest, in sentences, as Markdown."""
    subjects = len(QUANTITIES) * len({row.tabor for row in found})
    lines = []
    for name, families in (("ramps of minimisers", ("ramp",)), ("tamaas and Adhesion", ("peer",))):
        for error in (0.05, 0.01):
            values = ratios(found, error, families, ("axisymmetric",))
            grids = ratios(found, error, families, GRIDS_HERE)
            if values:
                text = f"- {name}, to {100 * error:g} %: {_range(values)} times the axisymmetric model's time"
                lines.append(text + (f", {_range(grids)} times the grids'" if grids else ""))
    reached = [
        (fastest(spots(found, *quantity, tabor), 1e-6, "axisymmetric"), spots(found, *quantity, tabor))
        for quantity in QUANTITIES
        for tabor in sorted({row.tabor for row in found})
    ]
    six = [one for one, _ in reached if one is not None]
    others = sum(fastest(here, 1e-3, "ramp", "peer") is not None for _, here in reached)
    tried = sum(any(one.family in ("ramp", "peer") for one in here) for _, here in reached)
    closing = (
        f"Of {subjects} values (pull-off, squeeze-out and wetting loads, contact radii; μ_T = 1/4 to 16) the "
        f"axisymmetric model gives {len(six)} to 1e-6, in {min(six).seconds:.2f} to {max(six).seconds:.2f} s; with any "
        f"other program or minimiser {others} of the {tried} that were tried were had to 1e-3."
    )
    return "\n".join(
        [closing, "", "Processor times of the fastest setting that is as accurate, median (range):", "", *lines]
    )


def details(found: Sequence[Measured]) -> str:
    """The fastest of every family for an error, as a table."""
    families = {
        "axisymmetric": ("axisymmetric",),
        "grids here": GRIDS_HERE,
        "minimisers": ("ramp",),
        "tamaas": ("tamaas ramp",),
        "Adhesion": ("Adhesion ramp",),
    }
    about = machine()
    text = [f"{about['processor']}, one thread, Python {about['python']}, numpy {about['numpy']}."]
    for error in (0.01, 1e-4):
        rows = []
        for (law, quantity), words in QUANTITIES.items():
            for tabor in sorted({row.tabor for row in found}):
                here = spots(found, law, quantity, tabor)
                cells = [_cell(fastest(here, error, *names)) for names in families.values()]
                rows.append([words.replace("\n", " "), f"{tabor:g}", *cells])
        head = ("quantity", "μ_T", *families)
        text += [f"The fastest with an error below {100 * error:g} %:", table(head, rows)]
    best = []
    for (law, quantity), words in QUANTITIES.items():
        for tabor in sorted({row.tabor for row in found}):
            here = spots(found, law, quantity, tabor)
            cells = [min((one.error for one in here if one.family in names or one.method in names), default=None)
                     for names in families.values()]  # fmt: skip
            best.append(
                [words.replace("\n", " "), f"{tabor:g}", *("–" if one is None else f"{one:.0e}" for one in cells)]
            )
    text += ["The smallest true errors that were reached:", table(("quantity", "μ_T", *families), best)]
    return "\n\n".join(text)


def _cell(spot: Spot | None) -> str:
    if spot is None:
        return "–"
    kind = spot.method.removesuffix(" ramp").replace("free grid", "free").replace("periodic grid", "periodic")
    name = "" if kind in ("axisymmetric", "tamaas", "Adhesion") else f"{kind} "
    return f"{spot.seconds:.2g} s ({name}{spot.setting})"


def honest(found: Iterable[Measured], *names: str) -> tuple[int, int]:
    """How many values of some methods lie within their error estimates, and of how many; truth has 2e-12 of its own."""
    pairs = [
        (error, row.estimates[quantity])
        for row in found
        for quantity, error in row.errors.items()
        if row.method in names and quantity in row.estimates
    ]
    return sum(error <= estimate + 2e-12 for error, estimate in pairs), len(pairs)


def update(path: Path, name: str, text: str) -> None:
    """Replace what stands between a name's marks in a page."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, _, rest = path.read_text(encoding="utf-8").partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise SystemExit(f"{path}: the marks {begin} and {end} are missing")
    path.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def main() -> None:
    """Measure, draw, and write what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further measurement after so many")
    parser.add_argument("--only", default="", help="methods with this in their names")
    parser.add_argument("--grids", type=int, nargs="*", default=[], help="further nodes a side, for example 1024")
    parser.add_argument("--draw", action="store_true", help="draw, and print tables, from what has been measured")
    parser.add_argument("--update", action="store_true", help="also write them into README.md and docs/")
    arguments = parser.parse_args()
    if not (arguments.draw or arguments.update):
        start_with_one_thread()
        chosen = methods((*GRIDS, *arguments.grids))
        run([method for method in chosen if arguments.only in method.name], arguments.minutes)
        return
    found = list(load_results().values())
    print(summary(found), details(found), sep="\n\n")
    draw(found).savefig(FIGURE, dpi=200)
    if arguments.update:
        for name, text in (("summary", summary(found)), ("details", details(found))):
            update(PAGES[name], "speed against accuracy", text)


if __name__ == "__main__":
    main()
