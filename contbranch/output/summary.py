"""What the command line prints for people: tables of events, thresholds and states, and a progress bar."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from contbranch.results.diagram import Diagram, Event, ModelChoice, Solution, State
    from contbranch.results.loop import Hysteresis

__all__ = ["print_diagram", "print_loop", "print_solution", "progress_bar", "with_error"]

_OBSERVABLES: Final = {
    "load": "load",
    "displacement": "displacement",
    "contact_radius": "contact radius",
    "central_gap": "central gap",
}
_DIGITS: Final = 15  # what a double can hold


def print_diagram(diagram: Diagram) -> None:
    """Print events and thresholds of a diagram with their error estimates, its model and its status."""
    console = _console()
    units = diagram.unit_names if diagram.contact is None else diagram.contact.units.names
    if diagram.events:
        table = _table(("event", "control", *_headings(units)))
        for event in diagram.events:
            cells = (with_error(getattr(event, name), event.error.get(name)) for name in _OBSERVABLES)
            table.add_row(_title(event), event.control or "", *cells)
        console.print(table)
        console.print(_line("Digits in brackets: error estimate in units of the last digit."))
    single = [branch.state(0) for branch in diagram.branches if len(branch) == 1]
    if single:  # saved by solve
        _print_states(console, single, units)
    if diagram.thresholds:
        table = _table(("threshold", "value", "unit") if units else ("threshold", "value"))
        for name, value in diagram.thresholds.items():
            quantity = _quantity(name)
            unit = [units.get(quantity, "")] if units else []
            table.add_row(name.replace("_", " "), with_error(value, _threshold_error(diagram, quantity, value)), *unit)
        console.print(table)
    points = sum(len(branch) for branch in diagram.branches)
    _print_model(console, diagram.model)
    effort = f"{points} points in {diagram.cost.wall_s:.2f} s, accuracy {diagram.accuracy:g}"
    console.print(_line(f"{effort}: {diagram.status}"))
    if diagram.message:
        console.print(_line(diagram.message))


def _print_states(console: Console, states: Sequence[State], units: Mapping[str, str]) -> None:
    energy = "energy" + (f" ({units['energy']})" if units else "")
    table = _table((*_headings(units), energy, "stable under"))
    for state in states:
        cells = (with_error(getattr(state, name), state.error.get(name)) for name in _OBSERVABLES)
        known = ("load", "displacement", *(() if state.unstable_spring is None else ("spring",)))
        controls = [control for control in known if state.stable(control)]
        table.add_row(*cells, f"{state.energy:.9g}", " and ".join(controls) or "neither")
    console.print(table)


def print_solution(solution: Solution, *, every: bool = False) -> None:
    """Print a solution, or with `every` all states found, with error estimates, model and status."""
    console = _console()
    units = {} if solution.contact is None else solution.contact.units.names
    _print_states(console, (solution.states or (solution,)) if every else (solution,), units)
    _print_model(console, solution.model)
    console.print(_line(f"{solution.cost.wall_s:.2f} s: {solution.status}"))
    if solution.message:
        console.print(_line(solution.message))


def print_loop(loop: Hysteresis) -> None:
    """Print the jumps of a loop with what they dissipate, the total, model and status."""
    console = _console()
    units = {} if loop.contact is None else loop.contact.units.names
    position = "position of the spring" if loop.control == "spring" else loop.control
    unit = units.get("load" if loop.control == "load" else "displacement", "")
    energy = "dissipated" + (f" ({units['energy']})" if units else "")
    names = [f"{words} ({units[name]})" if units.get(name) else words for name, words in _OBSERVABLES.items()]
    if loop.jumps:
        table = _table(("jump", f"{position} ({unit})" if unit else position, "", *names[:3], energy))
        for jump in loop.jumps:
            loss = "no bound" if jump.dissipated is None else with_error(jump.dissipated, jump.error)
            for state, side in ((jump.start, "from"), (jump.to, "to")):
                if state is None:
                    cells = ["infinite separation", "", ""]
                else:
                    cells = [with_error(getattr(state, n), state.error.get(n)) for n in list(_OBSERVABLES)[:3]]
                head = (jump.name or "jump", f"{jump.position:.9g}") if side == "from" else ("", "")
                table.add_row(*head, side, *cells, loss if side == "from" else "")
        console.print(table)
        console.print(_line("Digits in brackets: error estimate in units of the last digit."))
    if loop.dissipated is not None:
        unit = f" {units['energy']}" if units else ""
        console.print(_line(f"Dissipated in the loop: {with_error(loop.dissipated, loop.error)}{unit}"))
    _print_model(console, loop.model)
    console.print(_line(f"{len(loop.path)} points in {loop.cost.wall_s:.2f} s: {loop.status}"))
    if loop.message:
        console.print(_line(loop.message))


@contextmanager
def progress_bar() -> Iterator[Callable[[float, str], None]]:
    """Show a progress bar on standard error; yields what takes the fraction done and a text."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    texts = (TextColumn("{task.percentage:3.0f}%"), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Progress(BarColumn(), *texts, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)

        def report(fraction: float, text: str) -> None:
            progress.update(task, completed=fraction, description=text)

        yield report


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


def _console() -> Console:
    """Return a console on standard output; a table in a file or pipe is not folded at the width of a terminal."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else 200)


def _table(headings: tuple[str, ...]) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for i, heading in enumerate(headings):
        number = i > 0 and heading not in ("control", "unit", "stable under")
        table.add_column(heading, justify="right" if number else "left", no_wrap=True)
    return table


def _line(text: str) -> Text:
    """Return a text that is printed as it is: brackets are no markup."""
    return Text(text)


def _print_model(console: Console, model: ModelChoice) -> None:
    console.print(_line(f"Model: {model.kind}, {model.unknowns} unknowns. {model.why}".rstrip()))


def _headings(units: Mapping[str, str]) -> list[str]:
    return [words + (f" ({units[name]})" if units.get(name) else "") for name, words in _OBSERVABLES.items()]


def _title(event: Event) -> str:
    """Return what an event is called in a table."""
    kind = {"touch": "first touch", "symmetry": f"symmetry m = {event.mode}"}.get(event.kind, event.kind)
    return f"{kind} {event.name}" if event.name else kind


def _quantity(threshold: str) -> str:
    """Return the observable that a threshold is a value of."""
    last = threshold.rsplit("_", 1)[-1]
    return "contact_radius" if last == "radius" else last


def _threshold_error(diagram: Diagram, quantity: str, value: float) -> float | None:
    """Return the error estimate of the event from which a threshold was taken."""
    for event in diagram.events:
        if getattr(event, quantity, None) == value:
            return event.error.get(quantity)
    return None
