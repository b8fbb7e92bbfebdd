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
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.control import DISPLACEMENT, Control

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
    """The direction φ of (d', F') on the pieces of a curve between its rows, unwrapped.

    Attributes
    ----------
    angles : array (M − 1,)
        A direction inside of every piece, between those of its ends: no fold lies there.
    start : int
        Morse index under displacement control on the first piece.
    """

    angles: Array
    start: int = 0

    @classmethod
    def empty(cls) -> Hodograph:
        """Of a curve without pieces."""
        return cls(np.empty(0))

    def turns(self, control: Control) -> Integers:
        """⌊(φ − α)/π⌋ on the pieces, (M − 1,)."""
        return np.floor((self.angles - alpha(control)) / math.pi).astype(np.int64)

    def pieces(self, control: Control) -> tuple[Integers, Integers]:
        """Morse index under a control on the pieces, and the sign of the change of what is controlled, (M − 1,) each.

        Pieces along which what is controlled rests count as rising.
        """
        turns, held = self.turns(control), self.turns(DISPLACEMENT)
        if len(turns) == 0:
            return turns, turns
        return self.start + held[0] - turns, 1 - 2 * (turns % 2)

    def rows(self, control: Control) -> Integers:
        """Morse index under a control at the rows, (M,); a fold counts with its more stable side."""
        pieces = self.pieces(control)[0]
        if len(pieces) == 0:
            return np.zeros(1, dtype=np.int64)
        return np.minimum(np.append(pieces[:1], pieces), np.append(pieces, pieces[-1:]))


class Turning:
    """Unwraps φ along the rows of a curve, row by row.

    Rows at folds have exactly their fold's direction, on the side from which and to which the signs of the rates tell:
    that keeps the order of folds that coincide to rounding.

    Parameters
    ----------
    controls : sequence of Control
    """

    def __init__(self, controls: Sequence[Control]) -> None:
        self.controls = controls
        self.angles: list[float] = []
        self.present = 0.0
        self.signs: dict[str, int] = {}

    def begin(self, load: float, displacement: float) -> None:
        """The first row, by its rates of load and displacement."""
        self.present = math.atan2(load, displacement)
        self._know(load, displacement)

    def row(self, load: float, displacement: float) -> list[Control]:
        """A row reached without a fold on the way, by its rates; the folds that were passed all the same, in order."""
        raw = math.atan2(load, displacement)
        turn = short_way(raw - self.present)
        crossed = [control for control in self.controls if self._back(control, raw)]
        crossed += in_passing(self.controls, self.present, turn)
        missed = [control for control in crossed if abs(math.sin(raw - alpha(control))) > ON]
        if missed:  # in the corner that this row is
            self._piece(self.present)
            self.corner(turn)
            self._know(load, displacement)
            return missed
        found = self.present + turn
        for control in self.controls:  # rounding beside a fold's direction
            sign = self.signs.get(control.kind, 0)
            if sign and math.sin(found - alpha(control)) * sign < 0:
                found = alpha(control) + math.pi * round((found - alpha(control)) / math.pi)
        self._piece(found)
        self._know(load, displacement)
        return []

    def _back(self, control: Control, raw: float) -> bool:
        """Whether a direction is behind that of the fold just left: the curve came to lie before it again."""
        off = self.present - alpha(control)
        return abs(math.sin(off)) < ON and math.sin(raw - alpha(control)) * self.signs.get(control.kind, 0) < 0

    def fold(self, control: Control) -> None:
        """A row at a fold."""
        clockwise = self.clockwise(control)
        place = (self.present - alpha(control)) / math.pi
        near = round(place)
        if abs(place - near) * math.pi > ON:
            near = math.floor(place) if clockwise else math.ceil(place)
        self._piece(alpha(control) + math.pi * near)
        self.signs[control.kind] = -self.signs.get(control.kind, -1 if clockwise else 1)

    def corner(self, turn: float) -> None:
        """The curve leaves a row in another direction than it came."""
        self.present += turn
        self.signs = {}
        self._know(math.sin(self.present), math.cos(self.present))

    def clockwise(self, control: Control) -> bool:
        """Which way the curve turns at a fold of a control that comes next.

        At the fold (d', F') is along ±(1, −K): d' does not vanish there (for a displacement fold F' does not), and
        F' + K d' changes its sign.
        """
        across = -self.signs.get("load", 1) if control.kind == "displacement" else self.signs.get("displacement", 1)
        return self.signs.get(control.kind, 1) * across > 0

    def _piece(self, angle: float) -> None:
        """Append the piece that ends in a direction."""
        middle = (self.present + angle) / 2
        for control in self.controls:  # both ends on one fold's direction: the piece lies on the side of its sign
            place = (middle - alpha(control)) / math.pi
            if abs(place - round(place)) * math.pi < ON / 2 and control.kind in self.signs:
                up = (round(place) % 2 == 0) == (self.signs[control.kind] > 0)
                middle = alpha(control) + math.pi * round(place) + (ON if up else -ON)
        self.angles.append(middle)
        self.present = angle

    def _know(self, load: float, displacement: float) -> None:
        for control in self.controls:
            rate = control.weighted(load, displacement)
            if rate:
                self.signs[control.kind] = 1 if rate > 0 else -1
