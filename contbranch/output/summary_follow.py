"""What ``contbranch follow`` prints for people: a short table of the curve, and its special points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from contbranch.output.summary import _console, _headings, _line, _print_model, _table, with_error

if TYPE_CHECKING:
    from contbranch.results.followed import Followed

__all__ = ["print_followed"]

_ROWS: Final = 12  # of the curve; all of it is in the JSON document
_OBSERVABLES: Final = ("load", "displacement", "contact_radius", "central_gap")


def print_followed(followed: Followed) -> None:
    """Print some points of a followed event with their error estimates, its special points, model and status."""
    console = _console()
    units, name, curve = followed.unit_names, followed.parameter, followed.curve
    count = len(curve["load"])
    chosen = sorted({round(i * (count - 1) / (min(count, _ROWS) - 1)) for i in range(min(count, _ROWS))})
    table = _table(("", name, *_headings(units)))
    for i in chosen:
        cells = (with_error(float(curve[key][i]), float(followed.error[key][i])) for key in _OBSERVABLES)
        table.add_row(str(i), f"{curve[name][i]:.9g}", *cells)
    console.print(table)
    console.print(_line("Digits in brackets: error estimate in units of the last digit."))
    if followed.special:
        table = _table(("special point", name, *_headings(units)))
        for one in followed.special:
            title = f"{one.kind} ({one.control})" if one.control else one.kind
            cells = (with_error(getattr(one, key), one.error[key]) for key in _OBSERVABLES)
            table.add_row(title, with_error(one.value, one.error[name] or None), *cells)
        console.print(table)
        for message in dict.fromkeys(one.message for one in followed.special if one.message):
            console.print(_line(message))
    _print_model(console, followed.model)
    effort = f"{count} points in {followed.cost.wall_s:.2f} s, accuracy {followed.accuracy:g}"
    console.print(_line(f"{effort}: {followed.status}"))
    if followed.message:
        console.print(_line(followed.message))
