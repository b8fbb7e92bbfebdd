"""Morse indices along a curve from its folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Integers

__all__ = ["Indices", "morse_indices"]


@dataclass(frozen=True)
class Indices:
    """Morse indices along a curve.

    Attributes
    ----------
    load, displacement : integer array (M,)
        At the rows; a fold itself counts with its more stable side.
    load_pieces, displacement_pieces : integer array (M − 1,)
        Between the rows.
    loading, approaching : integer array (M − 1,)
        Signs of the changes of load and displacement between the rows.
    spring, spring_pieces, pulling : integer array
        The same under the control of a spring, and signs of the changes of the position of its far end; without a
        spring those of load control.
    """

    load: Integers
    displacement: Integers
    load_pieces: Integers
    displacement_pieces: Integers
    loading: Integers
    approaching: Integers
    spring: Integers
    spring_pieces: Integers
    pulling: Integers

    def pieces(self, control: str) -> tuple[Integers, Integers]:
        """Indices between the rows under a kind of control, and the signs of the changes of what is controlled."""
        if control == "displacement":
            return self.displacement_pieces, self.approaching
        return (self.load_pieces, self.loading) if control == "load" else (self.spring_pieces, self.pulling)


def morse_indices(
    count: int,
    folds: Sequence[tuple[int, str]],
    loading: int,
    approaching: int,
    start: int = 0,
    pulling: int | None = None,
) -> Indices:
    """Indices under all controls by counting folds along the curve.

    With the displacement fixed, the slope dF/dd is −(coupling)²/λ plus something finite, where λ is the eigenvalue that
    vanishes at a displacement fold: λ turns negative where the slope goes from −∞ to +∞, and positive where it goes
    from +∞ to −∞ (Poincaré's turning points). Freeing the displacement against a spring of stiffness K adds one where
    dF/dd + K is negative, which is where the far end of the spring and the displacement move in opposite directions:
    n_spring = n_displacement + [dF/dd + K < 0]. Load control is K = 0.

    Parameters
    ----------
    count : int
        Number of rows.
    folds : sequence of (row, control)
        Folds of load, displacement and spring control.
    loading, approaching : int
        Signs of the changes of load and displacement where the curve starts.
    start : int
        Index under displacement control there.
    pulling : int, optional
        Sign of the change of the position of the spring's far end; without a spring, leave it out.
    """
    pieces = max(count - 1, 0)
    sign = {"load": loading, "displacement": approaching, "spring": loading if pulling is None else pulling}
    index = start
    columns = np.zeros((6, pieces), dtype=np.int64)
    at: dict[int, list[str]] = {}
    for row, control in folds:
        at.setdefault(row, []).append(control)
        if control == "load" and pulling is None:
            at[row].append("spring")
    for k in range(pieces):
        for control in at.get(k, ()):
            if control == "displacement":
                index += 1 if sign["load"] * sign["displacement"] < 0 else -1
            sign[control] = -sign[control]
        by_load, by_spring = (int(sign[name] * sign["displacement"] < 0) for name in ("load", "spring"))
        columns[:, k] = index + by_load, index, sign["load"], sign["displacement"], index + by_spring, sign["spring"]
    load, displacement, forces, lengths, spring, ends = columns
    return Indices(_rows(load), _rows(displacement), load, displacement, forces, lengths, _rows(spring), spring, ends)


def _rows(pieces: Integers) -> Integers:
    if len(pieces) == 0:
        return np.zeros(1, dtype=np.int64)
    return np.minimum(np.append(pieces[:1], pieces), np.append(pieces, pieces[-1:]))
