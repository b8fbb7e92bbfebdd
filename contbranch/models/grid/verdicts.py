"""What folds on a lattice are worth: whether they are the contact's or the lattice's own, and their error estimates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contbranch.control import Control
from contbranch.curve.outcome import RawEvent
from contbranch.models.grid.indices import Indices

from .arrays import Array
from .folds import refine_fold
from .newton import Settings
from .reading import Reading, read
from .rows import Four, Mark, Row, difference
from .setup import Setup

__all__ = ["LARGEST_REFINED", "MOST_REFINED", "judge", "raw_event"]

Errors = tuple[Array, Array, Array, Array]

# Folds that are looked for on a finer lattice, and the largest array on which they are.
MOST_REFINED, LARGEST_REFINED = 12, 1024
# Least error of an event, relative to max(1, |value|).
FLOOR = 2e-8
# A fold that moves by less, relative to max(1, |value|), is said to stay.
STAYS = 1e-3


def judge(setup: Setup, rows: Sequence[Row], controls: Sequence[Control], errors: Errors, settings: Settings) -> None:
    """Look for the folds on a finer lattice, and tell pairs that are the lattice's own.

    Parameters
    ----------
    setup : Setup
    rows : sequence of Row
        In order along the curve; their marks are completed.
    controls : sequence of Control
        Whose folds are marked.
    errors : four arrays
        Error estimates of the rows' load, displacement, contact radius and central gap.
    settings : Settings
    """
    folds = [k for k, row in enumerate(rows) if row.mark is not None and row.mark.kind == "fold"]
    if len(folds) > MOST_REFINED:
        _pair(rows, folds, controls, errors)
    for k in folds:
        mark = rows[k].mark
        if mark is None or mark.around is None or mark.control is None:
            continue
        if not mark.unresolved and setup.lattice.size <= LARGEST_REFINED:
            mark.refined = refine_fold(setup, mark.around, mark.control, settings)
            if mark.refined.state is not None:
                fine = setup.on(2 * setup.grid)
                mark.shift = difference(read(fine, mark.refined.state), rows[k].reading)
        mark.around = None
    _pair(rows, folds, controls, errors)


def _pair(rows: Sequence[Row], folds: Sequence[int], controls: Sequence[Control], errors: Errors) -> None:
    """Mark neighbouring folds of a control as unresolved that differ by less than the lattice's error.

    Smallest differences first. A pair whose folds have hardly moved along the curve on the finer lattice stays.
    """
    for control in controls:
        own = [k for k in folds if (mark := rows[k].mark) is not None and mark.control == control]
        own = [k for k in own if not (mark := rows[k].mark) or not mark.unresolved]
        while len(own) > 1:
            value = [control.value(rows[k].reading.load, rows[k].reading.displacement) for k in own]
            heights = np.abs(np.diff(value))
            uncertain = np.array([_uncertainty(rows[k], control, errors, k) for k in own])
            doubtful = heights < np.maximum(uncertain[1:], uncertain[:-1])
            doubtful &= [not _steady(rows, first, second) for first, second in pairwise(own)]
            if not doubtful.any():
                break
            place = int(np.argmin(np.where(doubtful, heights, np.inf)))
            for k in own[place : place + 2]:
                mark = rows[k].mark
                if mark is not None:
                    mark.unresolved = True
            del own[place : place + 2]


def _steady(rows: Sequence[Row], first: int, second: int) -> bool:
    """Whether two folds have stayed apart on the finer lattice."""
    apart = rows[second].arc - rows[first].arc
    for k in (first, second):
        mark = rows[k].mark
        if mark is None or mark.refined is None or mark.refined.verdict != "found":
            return False
        if mark.refined.moved > 0.25 * apart:
            return False
    return True


def _uncertainty(fold: Row, control: Control, errors: Errors, row: int) -> float:
    """Error of what is controlled at a fold; where rows could not be compared, the fold's own if it is known."""
    load, displacement = float(errors[0][row]), float(errors[1][row])
    if not (math.isfinite(load) and math.isfinite(displacement)):
        shift = None if fold.mark is None else fold.mark.shift
        load, displacement = (0.0, 0.0) if shift is None else (2.0 * abs(shift[0]), 2.0 * abs(shift[1]))
    if control.kind == "spring":
        return displacement + load / control.stiffness
    return load if control.kind == "load" else displacement


def raw_event(setup: Setup, rows: Sequence[Row], row: int, mark: Mark, error: Four, indices: Indices) -> RawEvent:
    """The event marked at a row, with its error estimates and its verdict.

    Parameters
    ----------
    error : four floats
        Error estimates of the row.
    indices : Indices
        Morse indices of the curve.
    """
    event = _event(setup, row, mark, rows[row].reading, error, indices)
    return replace(event, error=_along(rows, row, mark, event.error))


def _event(setup: Setup, row: int, mark: Mark, reading: Reading, error: Four, indices: Indices) -> RawEvent:
    if mark.kind == "touch" and mark.shift is not None:
        # At least the error that is left.
        size = FLOOR * max(1.0, abs(reading.load), abs(reading.displacement))
        load, displacement = abs(mark.shift[0]) + reading.load_error, abs(mark.shift[1]) + reading.displacement_error
        error = load + size, displacement + size, 0.0, 0.0
    if mark.kind != "fold" or mark.control is None:
        return RawEvent(mark.kind, row, reading.four, error, message=mark.message)
    pieces, _ = indices.pieces(mark.control.kind)
    before, after = max(row - 1, 0), min(row, len(pieces) - 1)
    verdict, message = _verdict(setup, mark, reading)
    if mark.shift is not None:
        # From N to 2N the error falls at least by half: it is at most twice the shift. In contact a shift can be small
        # by chance, and rows around know better.
        share = 0.5 if reading.contact_radius > 0.0 else 0.0
        parts = zip(mark.shift, error, reading.four, strict=True)
        found = [max(2.0 * abs(s), share * e) + FLOOR * max(1.0, abs(v)) for s, e, v in parts]
        error = (
            found[0] + reading.load_error,
            found[1] + reading.displacement_error,
            found[2] + reading.radius_error if reading.contact_radius + reading.radius_error > 0.0 else 0.0,
            0.0 if reading.contact_radius > 0.0 else found[3],
        )
    return RawEvent(
        "fold",
        row,
        reading.four,
        error,
        control=mark.control.kind,
        stiffness=mark.control.spring_stiffness,
        before=int(pieces[before]),
        after=int(pieces[after]),
        maximum=mark.maximum,
        message=message,
        verdict=verdict,
    )


def _verdict(setup: Setup, mark: Mark, reading: Reading) -> tuple[str | None, str]:
    if mark.unresolved:
        return "unresolved", "It differs from the fold next to it by less than the lattice's error."
    if mark.refined is None or mark.refined.verdict == "unknown" or mark.control is None:
        return None, "Whether it stays on a finer grid was not found."
    if mark.refined.verdict == "vanished" or mark.shift is None:
        return "vanishes", "It vanishes on the grid with twice the nodes: the lattice's own."
    moved = mark.control.value(mark.shift[0], mark.shift[1])
    value = mark.control.value(reading.load, reading.displacement)
    stays = abs(moved) <= STAYS * max(1.0, abs(value))
    words = "stays" if stays else "moves"
    unit = setup.units.of(mark.control.kind)
    what = "the position of the spring" if mark.control.kind == "spring" else mark.control.kind
    return words, f"On the grid with twice the nodes it {words}: by {moved * unit:.3g} in {what}."


def _along(rows: Sequence[Row], row: int, mark: Mark, error: Four) -> Four:
    """Add to a fold's errors what an error of its place along the curve makes of the other of load and displacement.

    The place is as uncertain as the contact radius is.
    """
    if mark.kind != "fold" or mark.control is None or not 0 < row < len(rows) - 1:
        return error
    one, other = rows[row - 1].reading, rows[row + 1].reading
    change = abs(other.contact_radius - one.contact_radius)
    if change == 0.0 or rows[row].reading.contact_radius == 0.0:
        return error
    load, displacement, radius, gap = error
    share = 0.5 * min(1.0, radius / change)
    if mark.control.kind != "load":
        load = max(load, share * abs(other.load - one.load))
    if mark.control.kind != "displacement":
        displacement = max(displacement, share * abs(other.displacement - one.displacement))
    return load, displacement, radius, gap
