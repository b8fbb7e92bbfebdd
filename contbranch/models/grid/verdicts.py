"""What folds on a lattice are worth: whether they are the contact's or the lattice's own, and their error estimates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from contbranch.control import Control
from contbranch.curve.angle import Hodograph
from contbranch.curve.outcome import RawEvent

from .arrays import Array
from .folds import refine_fold
from .newton import Settings
from .rows import Mark, Reading, Row, difference, read
from .setup import Setup

__all__ = ["LARGEST_REFINED", "MOST_REFINED", "judge", "raw_event"]


# Folds that are looked for on a finer lattice, and the largest array on which they are.
MOST_REFINED, LARGEST_REFINED = 12, 1024
# Least error of an event, relative to max(1, |value|).
FLOOR = 3e-7
# Folds that stay apart on the finer lattice may be as close as this, in units of their errors.
MERGED = 0.25
# A fold that moves by less, relative to max(1, |value|), is said to stay.
STAYS = 1e-3


def judge(setup: Setup, rows: Sequence[Row], controls: Sequence[Control], errors: Array, settings: Settings) -> None:
    """Look for the folds on a finer lattice, and tell pairs that are the lattice's own.

    Parameters
    ----------
    setup : Setup
    rows : sequence of Row
        In order along the curve; their marks are completed.
    controls : sequence of Control
        Whose folds are marked.
    errors : array (M, 4)
        Error estimates of the rows' load, displacement, contact radius and central gap.
    settings : Settings
    """
    marked = [(k, row.mark) for k, row in enumerate(rows) if row.mark is not None]
    folds = [(k, mark) for k, mark in marked if mark.kind == "fold" and mark.errors is None]
    if len(folds) > MOST_REFINED:
        _pair(rows, folds, controls, errors)
    for k, mark in folds:
        if mark.around is None or mark.control is None:
            continue
        if not mark.unresolved and setup.lattice.size <= LARGEST_REFINED:
            mark.refined = refine_fold(setup, mark.around, mark.control, settings)
            if mark.refined.state is not None:
                mark.shift = difference(read(setup.fine, mark.refined.state), rows[k].reading)
        mark.around = None
    _pair(rows, folds, controls, errors)


def _pair(rows: Sequence[Row], folds: Sequence[tuple[int, Mark]], controls: Sequence[Control], errors: Array) -> None:
    """Mark neighbouring folds of a control as unresolved that differ by less than the lattice's error.

    Smallest differences first. A pair whose folds have hardly moved along the curve on the finer lattice stays.
    """
    for control in controls:
        own = [(k, mark) for k, mark in folds if mark.control == control and not mark.unresolved]
        while len(own) > 1:
            heights = np.abs(np.diff([control.value(*rows[k].reading[:2]) for k, _ in own]))
            uncertain = np.array([_uncertainty(mark, control, errors[k]) for k, mark in own])
            most = np.maximum(uncertain[1:], uncertain[:-1])
            steady = [_steady(pair, rows[pair[1][0]].arc - rows[pair[0][0]].arc) for pair in pairwise(own)]
            doubtful = heights < np.where(steady, MERGED, 1.0) * most
            if not doubtful.any():
                break
            place = int(np.argmin(np.where(doubtful, heights, np.inf)))
            for _, mark in own[place : place + 2]:
                mark.unresolved = True
            del own[place : place + 2]


def _steady(pair: Sequence[tuple[int, Mark]], apart: float) -> bool:
    """Whether two folds have stayed apart on the finer lattice."""
    refined = [mark.refined for _, mark in pair]
    return all(one is not None and one.verdict == "found" and one.moved <= 0.25 * apart for one in refined)


def _uncertainty(mark: Mark, control: Control, error: Array) -> float:
    """Error of what is controlled at a fold; where rows could not be compared, the fold's own if it is known."""
    if not np.isfinite(error[:2]).all():
        error = np.zeros(2) if mark.shift is None else 2.0 * np.abs(mark.shift)
    return control.value(*error[:2])


def raw_event(setup: Setup, rows: Sequence[Row], row: int, mark: Mark, error: Array, indices: Hodograph) -> RawEvent:
    """The event marked at a row, with its error estimates and its verdict.

    Parameters
    ----------
    error : array (4,)
        Error estimates of the row.
    indices : Hodograph
        Of the curve.
    """
    reading, control = rows[row].reading, mark.control
    four = np.array(reading.four)
    if mark.kind == "touch" and mark.shift is not None:
        # At least the error that is left.
        size = FLOOR * max(1.0, *np.abs(four[:2]))
        error = (np.abs(mark.shift) + reading.errors + size) * [1, 1, 0, 0]
    if control is None:
        return RawEvent(mark.kind, row, reading.four, _four(error), message=mark.message)
    pieces = indices.pieces(control)[0]
    verdict, message = (
        ("averaged", mark.message) if mark.errors is not None else _verdict(setup, mark, control, reading)
    )
    if mark.shift is not None:
        # From N to 2N the error falls at least by half: it is at most twice the shift. In contact a shift can be small
        # by chance, and rows around know better.
        share = 0.5 if reading.contact_radius > 0.0 else 0.0
        error = np.fmax(2.0 * np.abs(mark.shift), share * error) + FLOOR * np.maximum(1.0, np.abs(four))
        error += [*reading.errors[:3], 0.0]
        known = reading.contact_radius + reading.radius_error > 0.0, reading.contact_radius == 0.0
        error[2:] = np.where(known, error[2:], 0.0)
    return RawEvent(
        "fold",
        row,
        reading.four,
        _four(_along(rows, row, control, error) if mark.errors is None else mark.errors),
        control=control.kind,
        stiffness=control.spring_stiffness,
        before=int(pieces[max(row - 1, 0)]),
        after=int(pieces[min(row, len(pieces) - 1)]),
        maximum=mark.maximum,
        message=message,
        verdict=verdict,
    )


def _four(error: Array) -> tuple[float, float, float, float]:
    load, displacement, radius, gap = error.tolist()
    return load, displacement, radius, gap


def _verdict(setup: Setup, mark: Mark, control: Control, reading: Reading) -> tuple[str | None, str]:
    if mark.unresolved:
        return "unresolved", "It differs from the fold next to it by less than the lattice's error."
    if mark.refined is None or mark.refined.verdict == "unknown":
        return None, "Whether it stays on a finer grid was not found."
    if mark.shift is None:
        return "vanishes", "It vanishes on the grid with twice the nodes: the lattice's own."
    moved = control.value(*mark.shift[:2])
    stays = abs(moved) <= STAYS * max(1.0, abs(control.value(*reading[:2])))
    words = "stays" if stays else "moves"
    what = "the position of the spring" if control.kind == "spring" else control.kind
    return (
        words,
        f"On the grid with twice the nodes it {words}: by {moved * setup.units.of(control.kind):.3g} in {what}.",
    )


def _along(rows: Sequence[Row], row: int, control: Control, error: Array) -> Array:
    """Add to a fold's errors what an error of its place along the curve makes of the other of load and displacement.

    The place is as uncertain as the contact radius is.
    """
    if not 0 < row < len(rows) - 1 or rows[row].reading.contact_radius == 0.0:
        return error
    change = np.abs(difference(rows[row + 1].reading, rows[row - 1].reading))
    if change[2]:
        moved = 0.5 * min(1.0, error[2] / change[2]) * change[:2]
        moved *= [control.kind != "load", control.kind != "displacement"]
        return np.append(np.maximum(error[:2], moved), error[2:])
    return error
