"""Quasi-static paths along a curve of equilibria: up and down, with a jump wherever stability is lost.

The curve under its control is a `CurveWalk`. The control is raised from where the curve starts to where it ends, then
lowered again. A stable part ends at a fold of the control; there the system jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
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

    @property
    def position(self) -> float:
        """Place along the curve in units of rows."""
        return self.piece + 0.5 if self.row is None else float(self.row)


@dataclass(frozen=True)
class Leg:
    """A stable part followed in one direction of the control (+1: raised), as the stops that are passed."""

    direction: int
    stops: tuple[Stop, ...]

    @property
    def begin(self) -> Stop:
        """The first stop."""
        return self.stops[0]

    @property
    def end(self) -> Stop:
        """The last stop."""
        return self.stops[-1]


@dataclass(frozen=True)
class Jump:
    """A jump at a fold: where from, and where to (None: to infinity, or not reached)."""

    direction: int
    begin: Stop
    end: Stop | None
    others: tuple[Stop, ...] = field(default=(), repr=False)


def quasi_static(walk: CurveWalk) -> tuple[list[Leg], list[Jump], str]:
    """The path up and down, as legs on stable parts and the jumps between them, and why it ends early if it does.

    The path starts at the curve's first row if that is stable, otherwise at the first stable part along the curve: at
    zero if the control has this value there, or where the part begins. Of an interrupted computation it is what has
    been found of it, up to the first jump at least.

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
        parts = _stable_parts(walk)
        if not parts:
            return
        part = parts[0]
        zero = [piece for piece in part if part.start and _passes(walk, piece, 0.0)]
        begin = walk.crossing(zero[0], 0.0) if zero else walk.stop(part.start)
    for direction in (1, -1):
        while True:
            leg = _followed(walk, part, begin, direction)
            legs.append(leg)
            fold = leg.end
            if fold.row not in walk.folds:
                _check_end(walk, fold)
                begin = fold  # the way back starts where this one has ended
                break
            if any(jump.begin is fold and jump.direction == direction for jump in jumps):
                raise ModelError(
                    f"the path comes again to the fold at {_place(fold)}: states there differ by less than their "
                    "errors; ask for a hundredth of the accuracy."
                )
            try:
                jump = _jump(walk, parts, fold, direction)
            except ModelError:
                jumps.append(Jump(direction, fold, None))
                raise
            jumps.append(jump)
            if jump.end is None:
                return
            if jump.end.piece < 0:
                legs.append(Leg(direction, (jump.end,)))
                return
            begin = jump.end
            part = next(part for part in parts if begin.piece in part)


def _place(stop: Stop) -> str:
    return f"load {stop.state.load:.6g}, displacement {stop.state.displacement:.6g} (reduced)"


def _stable_parts(walk: CurveWalk) -> list[range]:
    """The pieces of every stable part, in order along the curve; on each of them the control goes one way."""
    stable = walk.unstable == 0
    edges = {0, len(stable), *walk.folds, *(np.flatnonzero(np.diff(stable)) + 1).tolist()}
    return [range(*ends) for ends in pairwise(sorted(edges)) if stable[ends[0]]]


def _passes(walk: CurveWalk, piece: int, value: float) -> bool:
    """Whether the control passes a value on a piece."""
    low, high = sorted(walk.values[piece : piece + 2])
    return bool(low < value <= high)


def _followed(walk: CurveWalk, part: range, begin: Stop, direction: int) -> Leg:
    """A stable part followed from a stop on it to its end, while the control moves in a direction."""
    onward = (walk.rising[part.start] > 0) == (direction > 0)
    rows = range(begin.piece + 1, part.stop + 1) if onward else range(begin.piece, part.start - 1, -1)
    return Leg(direction, (begin, *(walk.stop(row) for row in rows if row != begin.row)))


def _check_end(walk: CurveWalk, end: Stop) -> None:
    """Check that a leg without a fold ends where the curve does, or where what is controlled rests.

    Raises
    ------
    ModelError
        If stability is lost there: where the path would go on is not known.
    """
    beside = np.abs(np.arange(len(walk.unstable)) + 0.5 - end.position) < 1.0
    if np.any(beside & (walk.unstable > 0) & (np.diff(walk.values) != 0.0)):
        raise ModelError(
            f"stability is lost next to {_place(end)}, where no fold was found; ask for another accuracy, or for "
            "another grid where the model has one."
        )


def _jump(walk: CurveWalk, parts: Sequence[range], fold: Stop, direction: int) -> Jump:
    """The jump from a fold to the state that overdamped relaxation reaches.

    The energy of system and drive falls during the relaxation: only states below the fold can be reached, and if there
    is just one that is stable, it is. Between several the relaxation itself decides.
    """
    control = walk.control
    value = control.of(fold.state)
    height = control.height(value, fold.state)
    error = control.weighted(fold.state.error["load"], fold.state.error["displacement"])
    # The stable part that ends here has the value nowhere else.
    elsewhere = [piece for part in parts if fold.row not in (part.start, part.stop) for piece in part]
    candidates = [walk.crossing(piece, value, error) for piece in elsewhere if _passes(walk, piece, value)]
    if walk.unstable[0] == 0 and value < walk.values[0] and (outside := walk.before(value)) is not None:
        candidates.insert(0, outside)
    above = [(stop, control.height(value, stop.state) - height) for stop in candidates]
    # Errors may hide what is lower, as next to a continuous onset.
    below = [stop for stop, more in above if more < 0.0]
    below = below or [stop for stop, more in above if more <= stop.uncertainty + fold.uncertainty]
    # Where the curve need not hold all states, relaxations are followed; under load they may have no end.
    followed = walk.relaxes_off_curve and (below or control.kind != "load")
    if len(below) < 2 and not followed:
        return Jump(direction, fold, below[0] if below else None)
    end = walk.relaxed(fold, below, direction)
    return Jump(direction, fold, end, tuple(stop for stop in below if stop is not end))


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
    row, value = fold.row or 0, walk.control.of(fold.state)
    sense = 1 if row > 0 and walk.unstable[row - 1] == 0 else -1  # in which rows follow beyond the fold
    height = walk.control.height(value, fold.state)
    # Pieces by how many rows beyond the fold they lie; less than zero is the side that the path comes from.
    places = {sense * (stop.piece + 0.5 - row): stop for stop in candidates}
    unstable = [piece for piece in np.flatnonzero(walk.unstable).tolist() if _passes(walk, piece, value)]
    saddles = {sense * (piece + 0.5 - row): piece for piece in unstable}
    beyond = sorted(place for place in places if place > 0)
    nearest = beyond[0] if beyond else max(places)

    def separated(low: float, high: float) -> bool:
        between = [piece for place, piece in saddles.items() if low < place < high]
        return any(walk.control.height(value, walk.crossing(piece, value).state) >= height for piece in between)

    behind = max((place for place in places if place < 0), default=None)
    certain = bool(beyond) and (behind is None or separated(behind, 0.0))
    return places[nearest], certain and (len(beyond) < 2 or separated(nearest, beyond[1]))
