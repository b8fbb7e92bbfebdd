"""What the command line prints for people: tables of events, thresholds and states, and a progress bar."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

from contbranch.results.diagram import Diagram, Event, Solution, State
from contbranch.results.followed import Followed
from contbranch.results.loop import Hysteresis
from contbranch.results.record import OBSERVABLES, Result

__all__ = ["print_result", "progress_bar", "with_error"]

_DIGITS: Final = 15  # what a double can hold
_ROWS: Final = 12  # of a followed curve; all of it is in the JSON document
_LEFT: Final = ("control", "unit", "stable under")  # columns of words, besides the first
_BRACKETS: Final = "Digits in brackets: error estimate in units of the last digit."


def print_result(result: Result) -> None:
    """Print what a result holds as tables with error estimates, then its model, cost, status and message."""
    told: Any = result  # every result that is printed has contact, model, cost, status and message
    units = getattr(result, "unit_names", {}) if told.contact is None else told.contact.units.names
    _PRINTED[type(result)](result, units)
    model = told.model
    print(f"Model: {model.kind}, {model.unknowns} unknowns. {model.why}".rstrip())
    size = {Diagram: lambda: sum(map(len, told.branches)), Hysteresis: lambda: len(told.path)}
    size[Followed] = lambda: len(told.curve["load"])
    points = f"{size[type(result)]()} points in " if type(result) in size else ""
    accuracy = f", accuracy {told.accuracy:g}" if hasattr(result, "accuracy") else ""
    print(f"{points}{told.cost.wall_s:.2f} s{accuracy}: {told.status}")
    if told.message:
        print(told.message)


def _print_diagram(diagram: Diagram, units: Mapping[str, str]) -> None:
    if diagram.events:
        rows = [[_title(event), event.control or "", *_cells(event)] for event in diagram.events]
        _print_table(["event", "control", *_headings(units)], rows)
        print(_BRACKETS)
    single = [branch.state(0) for branch in diagram.branches if len(branch) == 1]
    if single:  # saved by solve
        _print_states(single, units)
    if diagram.thresholds:
        rows, known = [], diagram.uncertainties
        for name, value in diagram.thresholds.items():
            quantity = "contact_radius" if name.endswith("radius") else name.rsplit("_", 1)[-1]
            errors = (event.error.get(quantity) for event in diagram.events if getattr(event, quantity, None) == value)
            spread = [f"{known[name]:.3g}"] if known else []
            rows.append(
                [name.replace("_", " "), with_error(value, next(errors, None)), *spread, units.get(quantity, "")]
            )
        _print_table(["threshold", "value", *(["uncertainty"] if known else []), *(["unit"] if units else [])], rows)


def _print_solution(solution: Solution, units: Mapping[str, str]) -> None:
    _print_states(solution.states or (solution,), units)


def _print_states(states: Sequence[State], units: Mapping[str, str]) -> None:
    rows = []
    for state in states:
        known = ("load", "displacement", *(() if state.unstable_spring is None else ("spring",)))
        controls = [control for control in known if state.stable(control)]
        rows.append([*_cells(state), f"{state.energy:.9g}", " and ".join(controls) or "neither"])
    _print_table([*_headings(units, (*OBSERVABLES, "energy")), "stable under"], rows)


def _print_loop(loop: Hysteresis, units: Mapping[str, str]) -> None:
    shown = OBSERVABLES[:3]
    if loop.jumps:
        unit = units.get("load" if loop.control == "load" else "displacement", "")
        position = "position of the spring" if loop.control == "spring" else loop.control
        rows = []
        for jump in loop.jumps:
            loss = "no bound" if jump.dissipated is None else with_error(jump.dissipated, jump.error)
            rows.append([jump.name or "jump", f"{jump.position:.9g}", "from", *_cells(jump.start, shown), loss])
            end = ["infinite separation", "", ""] if jump.to is None else _cells(jump.to, shown)
            rows.append(["", "", "to", *end, ""])
        headings = ["jump", _with_unit(position, unit), "", *_headings(units, (*shown, "dissipated"))]
        _print_table(headings, rows)
        print(_BRACKETS)
    if loop.dissipated is not None:
        print(f"Dissipated in the loop: {with_error(loop.dissipated, loop.error)} {units.get('energy', '')}".rstrip())


def _print_followed(followed: Followed, units: Mapping[str, str]) -> None:
    name, curve, error = followed.parameter, followed.curve, followed.error
    count = len(curve["load"])
    rows = []
    for i in sorted({round(i * (count - 1) / (min(count, _ROWS) - 1)) for i in range(min(count, _ROWS))}):
        cells = (with_error(float(curve[key][i]), float(error[key][i])) for key in OBSERVABLES)
        rows.append([str(i), f"{curve[name][i]:.9g}", *cells])
    _print_table(["", name, *_headings(units)], rows)
    print(_BRACKETS)
    if followed.special:
        rows = []
        for one in followed.special:
            title = f"{one.kind} ({one.control})" if one.control else one.kind
            rows.append([title, with_error(one.value, one.error[name] or None), *_cells(one)])
        _print_table(["special point", name, *_headings(units)], rows)
        for message in dict.fromkeys(one.message for one in followed.special if one.message):
            print(message)


_PRINTED: Final[Mapping[type, Callable[[Any, Mapping[str, str]], None]]] = {
    Diagram: _print_diagram,
    Solution: _print_solution,
    Hysteresis: _print_loop,
    Followed: _print_followed,
}


@contextmanager
def progress_bar() -> Iterator[Callable[[float, str], None]]:
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
    place = min(-math.floor(math.log10(error)), _DIGITS - 1 - max(lead, 0))
    last = math.ceil(error * 10.0**place * (1.0 - 1e-9))
    if last == 10:  # 0.96 in the last place is 1 in the one before
        place, last = place - 1, 1
    if place <= 0:
        return f"{round(value, place):.0f}({last * 10**-place})"
    return f"{value:.{place}f}({last})"


def _print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print columns as wide as their longest cell: words to the left, numbers to the right."""
    lines = [headings, *rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headings))]
    sides = ["<" if i == 0 or heading in _LEFT else ">" for i, heading in enumerate(headings)]
    for line in lines:
        cells = (f"{cell:{side}{width}}" for cell, side, width in zip(line, sides, widths, strict=False))
        print("  ".join(cells).rstrip())


def _cells(source: Any, names: Iterable[str] = OBSERVABLES) -> list[str]:
    return [with_error(getattr(source, name), source.error.get(name)) for name in names]


def _headings(units: Mapping[str, str], names: Iterable[str] = OBSERVABLES) -> list[str]:
    return [_with_unit(name.replace("_", " "), units.get(name, "")) for name in names]


def _with_unit(words: str, unit: str) -> str:
    return f"{words} ({unit})" if unit else words


def _title(event: Event) -> str:
    """Return what an event is called in a table."""
    kind = {"touch": "first touch", "symmetry": f"symmetry m = {event.mode}"}.get(event.kind, event.kind)
    return f"{kind} {event.name}" if event.name else kind
