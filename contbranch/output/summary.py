"""What the command line prints for people: tables of events, thresholds and states, and progress."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbranch.contact.units import readable
from contbranch.errors import number_of
from contbranch.results.record import OBSERVABLES, Result, UnitNames
from contbranch.results.table import quantity, with_unit
from contbranch.watch import Progress

if TYPE_CHECKING:  # a result that is shown has been imported
    from contbranch.results.activated import Activated
    from contbranch.results.advice import Advice
    from contbranch.results.diagram import Diagram, Event, State
    from contbranch.results.equilibria import Equilibria
    from contbranch.results.fit import Fit
    from contbranch.results.followed import Followed, Special
    from contbranch.results.loop import Hysteresis
    from contbranch.results.phase import PhaseDiagram
    from contbranch.results.sweep import Sweep

_DIGITS = 15  # what a double can hold
SMALLEST = -6  # power of ten of numbers below which they are written with it
_SILENCE = 10.0  # seconds between two lines of progress
_ROWS = 12  # of a followed curve; all of it is in the JSON document
_LEFT = ("control", "unit", "stable under")  # columns of words, besides the first
_BRACKETS = "Digits in brackets: error estimate in units of the last digit."


class Cells(NamedTuple):
    """A table of texts."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def sides(self) -> list[str]:
        """Where the texts of each column stand: words to the left, numbers to the right."""
        return ["<" if i == 0 or heading in _LEFT else ">" for i, heading in enumerate(self.headings)]

    def lines(self) -> Iterator[str]:
        """The table as lines, its columns as wide as their longest cell."""
        lines = [self.headings, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.headings))]
        for line in lines:
            cells = (f"{cell:{side}{width}}" for cell, side, width in zip(line, self.sides, widths, strict=False))
            yield "  ".join(cells).rstrip()


Parts = Iterator[str | Cells]


def as_text(result: Result) -> str:
    """What a result holds, for people: its `parts` as lines."""
    return "\n".join(line for part in parts(result) for line in ([part] if isinstance(part, str) else part.lines()))


def parts(result: Result) -> Parts:
    """What a result holds as tables with error estimates, then its model, cost, status and message."""
    told: Any = result  # every result that is shown has a cost
    kind = type(result).__name__
    units = {name: unit.replace("nN·nm", "aJ") for name, unit in result.units.items()}  # the same, as one says it
    if kind in _SHOWN:
        yield from _SHOWN[kind](result, units)
    if hasattr(result, "model") and kind != "Advice":  # what it takes is said, and may be another
        model = told.model
        yield f"Model: {model.kind}, {number_of(model.unknowns, 'unknown')}. {model.why}".rstrip()
    if kind not in ("Advice", "Sweep", "FitMap") and told.contact is not None and told.contact.tabor is not None:
        from contbranch.advice import regime

        yield regime(told.contact, told.thresholds.get("pull_off_load") if kind == "Diagram" else None)
    points = ""
    if kind in ("Diagram", "Hysteresis", "Followed"):
        points = f"{number_of(len(next(iter(result.table().columns.values()), ())), 'point')} in "
    accuracy = f", accuracy {told.accuracy:g}" if hasattr(result, "accuracy") else ""
    yield f"{points}{told.cost.wall_s:.2f} s{accuracy}: {result.outcome}"
    if told.message:
        yield str(told.message)


def _diagram(diagram: Diagram, units: UnitNames) -> Parts:
    if diagram.events:
        rows = [[_title(event), event.control or "", *_cells(event)] for event in diagram.events]
        yield Cells(["event", "control", *_headings(units)], rows)
        yield _BRACKETS
    single = [branch.state(0) for branch in diagram.branches if len(branch) == 1]
    if single:  # saved by solve
        yield _states(single, units)
    spread = diagram.uncertainties or {}
    rows = []
    for name, value in diagram.thresholds.items():
        what = quantity(name)
        errors = (event.error.get(what) for event in diagram.events if getattr(event, what, None) == value)
        own = [f"{spread[name]:.3g}"] if spread else []
        rows.append([name.replace("_", " "), with_error(value, next(errors, None)), *own, units.get(what, "")])
    if rows:
        yield Cells(["threshold", "value", *(["uncertainty"] if spread else []), *(["unit"] if units else [])], rows)


def _states(states: Sequence[State], units: UnitNames) -> Cells:
    rows = []
    for state in states:
        known = ("load", "displacement", *(() if state.unstable_spring is None else ("spring",)))
        controls = [control for control in known if state.stable(control)]
        energy = with_error(state.energy, state.error.get("energy"))
        rows.append([*_cells(state), energy, " and ".join(controls) or "neither"])
    return Cells([*_headings(units, (*OBSERVABLES, "energy")), "stable under"], rows)


def _loop(loop: Hysteresis, units: UnitNames) -> Parts:
    shown = OBSERVABLES[:3]
    if loop.jumps:
        unit = units.get("load" if loop.control == "load" else "displacement", "")
        position = "position of the spring" if loop.control == "spring" else loop.control
        lost = ("no bound", "infinite separation") if loop.status == "complete" else ("not known", "not reached")
        rows = []
        for jump in loop.jumps:
            loss = lost[0] if jump.dissipated is None else with_error(jump.dissipated, jump.error)
            rows.append([jump.name or "jump", f"{jump.position:.9g}", "from", *_cells(jump.start, shown), loss])
            end = [lost[1], "", ""] if jump.to is None else _cells(jump.to, shown)
            rows.append(["", "", "to", *end, ""])
        yield Cells(["jump", with_unit(position, unit), "", *_headings(units, (*shown, "dissipated"))], rows)
        yield _BRACKETS
    if loop.dissipated is not None:
        yield f"Dissipated in the loop: {with_error(loop.dissipated, loop.error)} {units.get('energy', '')}".rstrip()


def _followed(followed: Followed, units: UnitNames) -> Parts:
    name, curve, error = followed.parameter, followed.curve, followed.error
    varied = with_unit(name, followed.table().units.get(name, ""))
    count = len(curve["load"])
    rows = []
    for i in np.linspace(0, count - 1, min(count, _ROWS)).round().astype(int).tolist():
        cells = (with_error(float(curve[key][i]), float(error[key][i])) for key in OBSERVABLES)
        rows.append([str(i), f"{curve[name][i]:.9g}", *cells])
    yield Cells(["", varied, *_headings(units)], rows)
    yield _BRACKETS
    yield from _special(followed.special, varied, units)


def _special(points: Sequence[Special], varied: str, units: UnitNames) -> Parts:
    if points:
        rows = []
        for one in points:
            title = f"{one.kind} ({one.control})" if one.control else one.kind
            rows.append([title, with_error(one.value, one.error[one.parameter] or None), *_cells(one)])
        yield Cells(["special point", varied, *_headings(units)], rows)
        yield from dict.fromkeys(one.message for one in points if one.message)


def _phase(phase: PhaseDiagram, units: UnitNames) -> Parts:
    name, ends = phase.parameter, "{:.6g} to {:.6g}"
    varied = with_unit(name, phase.table().units.get(name, ""))
    rows = [
        [_title(one.event), *(ends.format(*one.curve[key][[0, -1]]) for key in (name, phase.control))]
        for one in phase.boundaries
        if one.curve[name].size
    ]
    yield Cells(["boundary", varied, *_headings(units, [phase.control])], rows)
    yield from _special(phase.special, varied, units)


def _equilibria(found: Equilibria, units: UnitNames) -> Parts:
    yield _states(found.states, units)
    if found.barriers:
        rows = [
            [f"{one.name or one.stable}", f"{one.saddle}", *(f"{x:.6g}" if x is not None else "–" for x in one.heights)]
            for one in found.barriers
        ]
        heights = (with_unit(f"height from the {one}", units.get("energy", "")) for one in ("first", "second"))
        yield Cells(["barrier between states (from 0)", "over", *heights], rows)


def _activated(found: Activated, units: UnitNames) -> Parts:
    unit = units.get(found.quantity, "")
    rows = [[jump.name, *(f"{value:.6g}" for value in (jump.fold, jump.mean, jump.std))] for jump in found.jumps]
    yield Cells(["jump", *(with_unit(name, unit) for name in ("fold", "mean", "standard deviation"))], rows)


def _advice(advice: Advice, units: UnitNames) -> Parts:
    names = [name.replace("_", " ") for name in advice.thresholds]
    rows = []
    for one in advice.candidates:
        errors = [one.errors.get(name) for name in advice.thresholds]
        told = ["none" if error is None else f"{error:.1e}" for error in errors]
        rows.append([one.model, *told, f"{one.seconds:.2g}"])
    yield Cells(["candidate", *(f"error of {name}" for name in names), "seconds"], rows)
    if names:
        yield f"Errors, relative to max(1, |value|) in reduced units: of {advice.model.kind} as its trace estimates"
        yield "them, of theories against that trace, of grids as measured for the spacing of their nodes."
    yield f"Take {advice.chosen}. {advice.why}"


def _sweep(sweep: Sweep, units: UnitNames) -> Parts:
    yield f"{sweep.told()}; {sweep.computed} computed, {sweep.reused} known before"
    table = sweep.table()
    if hasattr(sweep, "determined"):
        yield from _map(sweep)
    elif sweep.names and len(sweep.tasks) <= _ROWS:
        shown = [name for name in table.columns if name != "message"]
        rows = [[f"{cell:.9g}" if isinstance(cell, float) else str(cell) for cell in row]
                for row in zip(*(table.columns[name].tolist() for name in shown), strict=True)]  # fmt: skip
        yield Cells([with_unit(name.replace("_", " "), table.units.get(name, "")) for name in shown], rows)
    for task in [task for task in sweep.tasks if task.status != "complete"][:_ROWS]:
        yield f"Task {task.index} {task.status}: {task.message}"


def _map(fits: Any) -> Parts:
    """Curves, if they are few, and how many of them tell what."""

    def cells(values: Mapping[str, float], names: Iterable[str]) -> Iterator[str]:
        for name in names:
            unit, error = fits.unit_names.get(name, ""), values.get(f"{name}_error")
            yield readable(values.get(name, math.nan), unit, error, name)

    names = [*fits.determined, *({"pull_off_force"} & {*fits.names})]
    if len(fits.tasks) <= _ROWS:
        shown = [*fits.parameters, *names]
        rows = [[str(one.index), *cells({**one.parameters, **one.thresholds}, shown), one.status, one.source or ""]
                for one in fits.tasks]  # fmt: skip
        yield Cells(["curve", *(name.replace("_", " ") for name in shown), "status", "source"], rows)
    rows = []
    for name in names:
        values = [one.thresholds[name] for one in fits.tasks if name in one.thresholds]
        ends = np.quantile(values or [math.nan], [0.5, 0.0, 1.0]).tolist()
        told = (cell for end in ends for cell in cells({name: end}, [name]))
        rows.append([name.replace("_", " "), f"{len(values)} of {len(fits.tasks)}", *told])
    yield Cells(["value", "curves that tell it", "median", "least", "most"], rows)


def _fit(fit: Fit, _: UnitNames) -> Parts:
    from contbranch.results.fit import unit_of_value

    legs = fit.legs or {}
    rows = []
    for name in fit.values:
        cells = (readable(one.values.get(name, math.nan), unit_of_value(name), one.errors.get(name), name)
                 for one in (fit, *legs.values()))  # fmt: skip
        rows.append([name, *cells, "" if name in fit.determined else "not determined"])
    yield Cells(["value", "fitted", *legs, ""], rows)
    if fit.jumps:
        force = partial(readable, unit="nN")
        said: Mapping[str, Callable[[float], str]] = {"piezo": "{:.6g}".format, "force": force, "step": force}
        rows = [
            [f"{jump.name} {word}", *(show(seen[key]) if seen else "–" for key, show in said.items())]
            for jump in fit.jumps
            for word, seen in (("measured", jump.measured), ("fitted", jump.fitted))
        ]
        yield Cells(["jump", "piezo (nm)", "force before", "step"], rows)
    if fit.laws:
        rows = [[one.law, readable(one.rms, "nN"), f"{one.criterion:.3g}"] for one in fit.laws]
        yield Cells(["law", "rms", "BIC above the best"], rows)
    yield f"Residuals: rms {readable(fit.rms, 'nN')}; noise {readable(fit.noise, 'nN')}. Law: {fit.law}."


_SHOWN: Mapping[str, Callable[[Any, UnitNames], Parts]] = {
    "Activated": _activated,
    "Advice": _advice,
    "Diagram": _diagram,
    "Fit": _fit,
    "Solution": lambda solution, units: iter([_states(solution.known, units)]),
    "Equilibria": _equilibria,
    "Hysteresis": _loop,
    "Followed": _followed,
    "PhaseDiagram": _phase,
    "FitMap": _sweep,
    "Sweep": _sweep,
}


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show a progress bar on standard error; yields what takes the fraction done and a text."""
    began, width = time.monotonic(), 0

    def report(fraction: float, text: str) -> None:
        nonlocal width
        done = min(max(fraction, 0.0), 1.0)
        seconds = int(time.monotonic() - began)
        line = f"{'━' * round(40 * done):40s} {100 * done:3.0f}% {seconds // 60}:{seconds % 60:02d} {text}"
        print(f"\r{line:{width}s}", end="", file=sys.stderr, flush=True)
        width = len(line)

    try:
        yield report
    finally:
        print(f"\r{'':{width}s}\r", end="", file=sys.stderr, flush=True)


def progress_lines() -> Progress:
    """What prints, for those who read no terminal, a line on standard error every ten seconds."""
    began = last = time.monotonic()

    def report(fraction: float, text: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now >= last + _SILENCE:
            last, seconds = now, int(now - began)
            line = f"{100 * fraction:.0f}% after {seconds // 60}:{seconds % 60:02d}, {text}"
            print(f"contbranch: {line}", file=sys.stderr, flush=True)

    return report


def with_error(value: float, error: float | None) -> str:
    """Return a number with the digits its error estimate leaves, and that error in units of the last: 8.00651(3).

    The error is rounded up to one digit. Without an estimate, and where a double cannot hold all those digits, as many
    digits are given as are sure to be in the number itself. An infinite error, one that could not be estimated, is (?).
    """
    if not math.isfinite(value):
        return "–"
    if error == math.inf:
        return f"{value:.9g}(?)"
    if error is None or not math.isfinite(error) or error < 0.0:
        return f"{value:.9g}"
    lead = math.floor(math.log10(abs(value))) if value else 0
    if error == 0.0:
        return f"{value:.{_DIGITS - 1}g}"
    if lead < SMALLEST and error < abs(value):  # one would count zeros
        mantissa = with_error(value * 10.0**-lead, error * 10.0**-lead)
        return f"{mantissa}e{lead:03d}"
    place = min(-math.floor(math.log10(error)), _DIGITS - 1 - max(lead, 0))
    last = math.ceil(error * 10.0**place * (1.0 - 1e-9))
    if last == 10:  # 0.96 in the last place is 1 in the one before
        place, last = place - 1, 1
    if place <= 0:
        return f"{round(value, place):.0f}({last * 10**-place})"
    return f"{value:.{place}f}({last})"


def _cells(source: Any, names: Iterable[str] = OBSERVABLES) -> list[str]:
    return [with_error(getattr(source, name), source.error.get(name)) for name in names]


def _headings(units: UnitNames, names: Iterable[str] = OBSERVABLES) -> list[str]:
    return [with_unit(name.replace("_", " "), units.get(name, "")) for name in names]


def _title(event: Event) -> str:
    """Return what an event is called in a table."""
    kind = {"touch": "first touch", "symmetry": f"symmetry m = {event.mode}"}.get(event.kind, event.kind)
    return f"{kind} {event.name}" if event.name else kind
