"""Quasi-static paths along a curve of equilibria: up and down, with a jump wherever stability is lost.

The curve under its control is a `CurveWalk`. The control is raised from where the curve starts to where it ends, then
lowered again. A stable part ends at a fold of the control; there the system jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from contbranch.errors import ModelError
from contbranch.results.diagram import State
from contbranch.watch import finishing, kept

if TYPE_CHECKING:
    from contbranch.curve.paths import CurveWalk

__all__ = ["Jump", "Leg", "Stop", "next_along", "quasi_static"]


@dataclass(frozen=True)
class Stop:
    """A state on the curve, exact within its error estimates.

    Attributes
    ----------
    piece : int
        It lies between the rows `piece` and ``piece + 1``; −1 for before the first row.
    state : State
        Reduced units.
    place : object
        Where the model has it.
    row : int or None
        Its row, if it is one.
    uncertainty : float
        Error estimate of V − F d at its load, which is stationary with respect to errors of the state.
    """

    piece: int
    state: State
    place: Any = None
    row: int | None = None
    uncertainty: float = 1e-14


@dataclass(frozen=True)
class Leg:
    """A stable part followed in one direction of the control (+1: raised), from a stop over rows to a stop."""

    direction: int
    rows: tuple[int, ...]
    begin: Stop | None
    end: Stop | None


@dataclass(frozen=True)
class Jump:
    """A jump at a fold: where from, where to (None: to infinity, or not reached), and at which row the fold is."""

    row: int
    direction: int
    begin: Stop
    end: Stop | None
    others: tuple[Stop, ...] = field(default=(), repr=False)


def quasi_static(walk: CurveWalk) -> tuple[list[Leg], list[Jump], str]:
    """The path up and down, as legs on stable parts and the jumps between them, and why it ends early if it does.

    The path starts at the curve's first row if that is stable, otherwise at the first stable part along the curve: at
    zero if the control has this value there, or at the fold where it begins. Of an interrupted computation it is what
    has been found of it, up to the first jump at least.

    Raises
    ------
    ModelError
        If no part of the path is found.
    """
    legs: list[Leg] = []
    jumps: list[Jump] = []
    try:
        kept(lambda: _follow(walk, legs, jumps), None)
    except ModelError as error:
        if not legs:
            raise
        return legs, jumps, f"The path ends early: {str(error).rstrip('.')}."
    return legs, jumps, ""


def _follow(walk: CurveWalk, legs: list[Leg], jumps: list[Jump]) -> None:
    """Append the legs and jumps of the path, one after the other.

    Raises
    ------
    ModelError
        If it comes to a fold again, stability is lost where there is none, or a state that it needs is not found; what
        has been appended stays.
    """
    with finishing():
        folds = walk.folds()
        start = _start(walk, folds)
    if start is None:
        return
    piece, begin, row = start
    for direction in (1, -1):
        while True:
            leg, fold_row = _followed(walk, folds, piece, direction, begin, row)
            legs.append(leg)
            if fold_row is None:
                _check_end(walk, leg)
                break
            if any((jump.row, jump.direction) == (fold_row, direction) for jump in jumps):
                state = folds[fold_row].state
                raise ModelError(
                    f"the path comes again to the fold at load {state.load:.6g}, displacement {state.displacement:.6g} "
                    "(reduced): states there differ by less than their errors; ask for a hundredth of the accuracy."
                )
            try:
                jump = _jump(walk, folds, fold_row, direction, leg)
            except ModelError:
                jumps.append(Jump(fold_row, direction, folds[fold_row], None))
                raise
            jumps.append(jump)
            if jump.end is None:
                return
            if jump.end.piece < 0:
                legs.append(Leg(direction, (), jump.end, None))
                return
            piece, begin, row = jump.end.piece, jump.end, None
        last = legs[-1]
        # The way back starts where this one has ended, a row at an end of the curve.
        row = last.rows[-1] if last.rows else None
        if row is not None:
            piece, begin = min(row, len(walk.unstable) - 1), None


def _start(walk: CurveWalk, folds: dict[int, Stop]) -> tuple[int, Stop | None, int | None] | None:
    """Piece, stop and row at which the path starts."""
    unstable, values = walk.unstable, walk.values
    stable = np.flatnonzero(unstable == 0)
    if len(stable) == 0:
        return None
    first = int(stable[0])
    if first == 0:
        return 0, None, 0
    piece = first
    while piece < len(unstable) and unstable[piece] == 0:
        if min(values[piece], values[piece + 1]) < 0.0 <= max(values[piece], values[piece + 1]):
            return piece, walk.crossing(piece, 0.0), None
        piece += 1
    return first, folds.get(first), None


def _followed(
    walk: CurveWalk, folds: dict[int, Stop], piece: int, direction: int, begin: Stop | None, row: int | None
) -> tuple[Leg, int | None]:
    """Follow a stable part while the control moves in a direction; return the leg, and the fold's row where it ends."""
    rows = [] if row is None else [row]
    sense = direction * (1 if walk.rising[piece] > 0 else -1)
    while True:
        ahead = piece + 1 if sense > 0 else piece
        if ahead in folds:
            return Leg(direction, tuple(rows), begin, folds[ahead]), ahead
        if not rows or rows[-1] != ahead:
            rows.append(ahead)
        piece += sense
        if not 0 <= piece < len(walk.unstable) or walk.unstable[piece] != 0:
            return Leg(direction, tuple(rows), begin, None), None


def _check_end(walk: CurveWalk, leg: Leg) -> None:
    """Check that a leg without a fold ends where the curve does, or where what is controlled rests.

    Raises
    ------
    ModelError
        If stability is lost there: where the path would go on is not known.
    """
    row = leg.rows[-1]
    beside = range(max(row - 1, 0), min(row + 1, len(walk.unstable)))
    if any(walk.unstable[piece] and walk.values[piece] != walk.values[piece + 1] for piece in beside):
        state = walk.row(row)
        raise ModelError(
            f"stability is lost next to load {state.load:.6g}, displacement {state.displacement:.6g} (reduced), where "
            "no fold was found; ask for another accuracy, or for another grid where the model has one."
        )


def _jump(walk: CurveWalk, folds: dict[int, Stop], row: int, direction: int, leg: Leg) -> Jump:
    """The jump from a fold to the state that overdamped relaxation reaches.

    The energy of system and drive falls during the relaxation: only states below the fold can be reached, and if there
    is just one that is stable, it is. Between several the relaxation itself decides.
    """
    fold, control = folds[row], walk.control
    value = control.of(fold.state)

    candidates = []
    outside = walk.before(value) if walk.unstable[0] == 0 and value < walk.values[0] else None
    if outside is not None:
        candidates.append(outside)
    ending = _ending(walk, folds, row)
    for piece in np.flatnonzero(walk.unstable == 0):
        low, high = sorted((walk.values[piece], walk.values[piece + 1]))
        if low < value <= high and piece not in ending:
            candidates.append(walk.crossing(int(piece), value))
    below = [stop for stop in candidates if _above(walk, stop, fold) < 0.0]
    if not below:  # errors may hide what is lower, as next to a continuous onset
        below = [stop for stop in candidates if _above(walk, stop, fold) <= stop.uncertainty + fold.uncertainty]
    # Where the curve need not hold all states, relaxations are followed; under load they may have no end.
    followed = walk.follows and (below or control.kind != "load")
    if len(below) < 2 and not followed:
        return Jump(row, direction, fold, below[0] if below else None)
    end = walk.relaxed(fold, below)
    return Jump(row, direction, fold, end, tuple(stop for stop in below if stop is not end))


def _above(walk: CurveWalk, stop: Stop, fold: Stop) -> float:
    """By how much the energy of system and drive is higher than at a fold, at the fold's value of the control."""
    value = walk.control.of(fold.state)
    return walk.control.height(value, stop.state) - walk.control.height(value, fold.state)


def _ending(walk: CurveWalk, folds: dict[int, Stop], row: int) -> set[int]:
    """The stable pieces up to a fold, along which what is controlled goes one way: none of them is there again."""
    found = set()
    for piece, sense in ((row - 1, -1), (row, 1)):
        while 0 <= piece < len(walk.unstable) and walk.unstable[piece] == 0:
            found.add(piece)
            if piece + (sense > 0) in folds:
                break
            piece += sense
    return found


def next_along(walk: CurveWalk, fold: Stop, candidates: Sequence[Stop]) -> tuple[Stop, bool]:
    """Of stable states lower than a fold the next one along the curve, and whether energies show that it is reached.

    Beyond the fold the curve goes on as the saddle that has just merged with the stable state; on its other side lies
    the next stable one. The relaxation goes downhill, and from there a neighbour can only be reached over the saddle
    between them: not if that is as high as the fold. (Saddles that are not on the curve are not considered.)

    Parameters
    ----------
    walk : CurveWalk
    fold : Stop
        With its row; the path comes from its stable side.
    candidates : sequence of Stop
        Stable states at the fold's value of the control; at least one.
    """
    row, control, unstable, values = fold.row, walk.control, walk.unstable, walk.values
    assert row is not None
    onward = row > 0 and unstable[row - 1] == 0
    value = control.of(fold.state)

    def beyond(stop: Stop) -> bool:
        return (stop.piece >= row) == onward

    def away(stop: Stop) -> float:
        return abs(stop.piece + 0.5 - row)

    ahead = [stop for stop in candidates if beyond(stop)]
    if not ahead:
        return min(candidates, key=away), False
    found = min(ahead, key=away)
    low, high = np.minimum(values[:-1], values[1:]), np.maximum(values[:-1], values[1:])
    passed = (low < value) & (value <= high) & (unstable > 0)

    def separated(other: Stop) -> bool:
        begin, end = (found.piece + 1, other.piece) if other.piece > found.piece else (other.piece + 1, found.piece)
        if not beyond(other):  # of the way there the part behind the fold; the other one leads to the state found
            begin, end = (begin, row - 1) if onward else (row + 1, end)
        saddles = [piece for piece in range(max(begin, 0), end) if passed[piece]]
        level = control.height(value, fold.state)
        return any(control.height(value, walk.crossing(piece, value).state) >= level for piece in saddles)

    neighbours = [
        min(group, key=away)
        for group in ([s for s in ahead if s is not found], [s for s in candidates if not beyond(s)])
        if group
    ]
    return found, all(separated(stop) for stop in neighbours)
