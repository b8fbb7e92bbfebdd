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
from numpy.typing import NDArray

from contbranch.control import DISPLACEMENT, Control

__all__ = ["Hodograph", "direction", "short_way"]

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


def direction(control: Control) -> float:
    """The direction α of (d', F') at a fold under a control, in [−π/2, 0]."""
    return -math.atan(control.stiffness)


def short_way(turn: float) -> float:
    """A difference of directions brought to (−π, π]."""
    turned = math.remainder(turn, 2 * math.pi)
    return math.pi if turned == -math.pi else turned


@dataclass(frozen=True)
class Hodograph:
    """Directions φ of (d', F') at both ends of the pieces of a curve, unwrapped.

    Attributes
    ----------
    leaving, arriving : array (M − 1,)
        φ where a piece begins and where it ends. No fold lies between; at a corner of the curve the next piece leaves
        in another direction.
    start : int
        Morse index under displacement control on the first piece.
    """

    leaving: Array
    arriving: Array
    start: int = 0

    @classmethod
    def empty(cls) -> Hodograph:
        """Of a curve without pieces."""
        return cls(np.empty(0), np.empty(0))

    def turns(self, control: Control) -> Integers:
        """⌊(φ − α)/π⌋ on the pieces, (M − 1,)."""
        middle = (self.leaving + self.arriving) / 2
        return np.floor((middle - direction(control)) / math.pi).astype(np.int64)

    def pieces(self, control: Control) -> tuple[Integers, Integers]:
        """Morse index under a control on the pieces, and the sign of the change of what is controlled, (M − 1,) each.

        Pieces along which what is controlled does not change count as rising.
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


def ordered_by_angle(controls: Sequence[Control], begin: float, clockwise: bool) -> list[Control]:
    """Controls in the order in which a direction passes theirs, turning from φ = begin by less than π.

    Parameters
    ----------
    controls : sequence of Control
        Whose directions are passed.
    begin : float
    clockwise : bool
    """
    sense = -1.0 if clockwise else 1.0

    def ahead(control: Control) -> float:
        return (sense * (direction(control) - begin)) % math.pi

    return sorted(controls, key=ahead)
