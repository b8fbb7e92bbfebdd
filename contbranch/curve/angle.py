"""One angle for the folds and Morse indices of all controls: the direction of (d', F') along the curve.

A control of stiffness K holds d + F/K. Its folds are where the direction φ of (d', F') passes α = −arctan K modulo π:
0 for the load (K = 0), −π/2 for the displacement (K = ∞). The Morse index under K changes by one there, up where the
curve turns clockwise in the plane (d, F) and down where it turns the other way (Thompson 1979; Maddocks, Arch. Ration.
Mech. Anal. 99, 301 (1987)). So, with φ unwrapped along the curve and one constant c for all controls,

    index_K = c − ⌊(φ − α_K)/π⌋,

and what is controlled grows along the curve where that floor is even.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from contbranch.arrays import Integers
from contbranch.control import DISPLACEMENT, LOAD, Control

__all__ = ["Hodograph", "Turning", "alpha", "in_passing", "short_way"]

# A direction this close to a fold's is on neither side of it but for rounding.
ON = 1e-9
# Beyond this share of half a turn the short way round is no longer certain.
AMBIGUOUS = 0.9


def alpha(control: Control) -> float:
    """The direction of (d', F') at a fold under a control, in [−π/2, 0]."""
    return -math.atan(control.stiffness)


def short_way(turn: float) -> float:
    """A difference of directions brought to [−π, π]."""
    return math.remainder(turn, 2 * math.pi)


def in_passing(controls: Sequence[Control], begin: float, turn: float) -> list[Control]:
    """The controls whose directions are passed in a turn from `begin` by less than 2π, in order.

    A turn that begins on a direction does not pass it there.
    """
    passed: list[tuple[float, Control]] = []
    for control in controls:
        ahead = math.copysign(1.0, turn) * (alpha(control) - begin) % math.pi
        first = math.pi if ahead < ON or math.pi - ahead < ON else ahead
        passed += [(place, control) for place in (first, first + math.pi) if place < abs(turn)]
    return [control for _, control in sorted(passed, key=lambda one: one[0])]


@dataclass(frozen=True)
class Hodograph:
    """How often the direction φ of (d', F') has passed those of the folds, on the pieces of a curve between its rows.

    Attributes
    ----------
    turns : mapping of Control to array (M − 1,)
        ⌊(φ − α)/π⌋ on every piece: no fold lies inside of one.
    start : int
        Morse index under displacement control on the first piece.
    """

    turns: Mapping[Control, Integers] = field(default_factory=dict)
    start: int = 0

    def pieces(self, control: Control) -> tuple[Integers, Integers]:
        """Morse index under a control on the pieces, and the sign of the change of what is held, (M − 1,) each."""
        turns, held = (self.turns.get(one, np.zeros(0, dtype=np.int64)) for one in (control, DISPLACEMENT))
        return self.start + held[:1].sum() - turns, 1 - 2 * (turns % 2)

    def rows(self, control: Control) -> Integers:
        """Morse index under a control at the rows, (M,); a fold counts with its more stable side."""
        pieces = self.pieces(control)[0]
        if len(pieces) == 0:
            return np.zeros(1, dtype=np.int64)
        return np.minimum(np.append(pieces[:1], pieces), np.append(pieces, pieces[-1:]))


class Turning:
    """Counts the turns of φ along the rows of a curve, row by row.

    Parameters
    ----------
    controls : sequence of Control
    load, displacement : float
        Their rates at the first row.
    """

    def __init__(self, controls: Sequence[Control], load: float, displacement: float) -> None:
        self.controls, self.direction = controls, math.atan2(load, displacement)
        own = dict.fromkeys((LOAD, DISPLACEMENT, *controls))
        self.turns = {control: math.floor((self.direction - alpha(control)) / math.pi) for control in own}
        self._resting = {control for control in own if self._rests(control, self.direction)}
        self._pieces: list[list[int]] = []

    def row(self, load: float, displacement: float) -> list[Control]:
        """A row reached without a fold on the way, by its rates; the folds that were passed all the same, in order.

        They lie in the corner that the row is.
        """
        direction = math.atan2(load, displacement)
        turn = short_way(direction - self.direction)
        self._wake(self.direction + turn)
        self._piece()
        missed = [control for control in self.controls if self.contradicts(control, direction)]
        order = in_passing(missed, self.direction, turn)
        missed.sort(key=lambda control: order.index(control) if control in order else -1)
        self._pass(missed, turn)
        self.direction = direction
        return missed

    def fold(self, control: Control) -> list[Control]:
        """A row at a fold; no other is missed there.

        There (d', F') is along ±(1, −K), d' does not vanish (for a displacement fold F' does not), and F' + K d'
        changes its sign: that says which way the curve turns.
        """
        self._piece()
        across = -self.rises(LOAD) if control == DISPLACEMENT else self.rises(DISPLACEMENT)
        self.direction = alpha(control) + math.pi * round((self.direction - alpha(control)) / math.pi)
        self._pass([control], -self.rises(control) * across)
        return []

    def corner(self, turn: float) -> list[Control]:
        """The curve leaves a row in another direction than it came; the folds that are passed, in order."""
        passed = [one for one in in_passing(self.controls, self.direction, turn) if one not in self._resting]
        self._pass(passed, turn)
        self.direction += turn
        self._wake(self.direction)
        return passed

    def rested(self, direction: float) -> list[Control]:
        """The folds of what rests at a row, and changes the other way in the direction behind it."""
        turn = short_way(direction - self.direction)
        self._wake(self.direction + turn)
        found = [c for c in self.controls if self._rests(c, self.direction) and self.contradicts(c, direction)]
        self._pass(found, turn)
        return found

    def _rests(self, control: Control, direction: float) -> bool:
        return abs(math.sin(direction - alpha(control))) < ON

    def _wake(self, direction: float) -> None:
        """What has rested since the curve began changes one way from here on."""
        awake = [control for control in self._resting if not self._rests(control, direction)]
        self.turns |= {control: math.floor((direction - alpha(control)) / math.pi) for control in awake}
        self._resting.difference_update(awake)

    def rises(self, control: Control) -> int:
        """The sign of the change of what is controlled."""
        return 1 - 2 * (self.turns[control] % 2)

    def contradicts(self, control: Control, direction: float) -> bool:
        """Whether what is controlled changes the other way in a direction, by more than rounding."""
        return math.sin(direction - alpha(control)) * self.rises(control) < -ON

    def hodograph(self, start: int) -> Hodograph:
        """The turns so far, of a curve with a Morse index under displacement control on the first piece."""
        columns = np.array(self._pieces, dtype=np.int64).reshape(-1, len(self.turns)).T
        return Hodograph(dict(zip(self.turns, columns, strict=True)), start)

    def _piece(self) -> None:
        self._pieces.append([*self.turns.values()])

    def _pass(self, controls: Sequence[Control], turn: float) -> None:
        for control in controls:
            self.turns[control] += 1 if turn > 0 else -1
