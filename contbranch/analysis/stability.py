"""Morse indices along a curve from its folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Indices", "morse_indices"]

Integers = NDArray[np.int64]


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
    """

    load: Integers
    displacement: Integers
    load_pieces: Integers
    displacement_pieces: Integers
    loading: Integers
    approaching: Integers


def morse_indices(
    count: int, folds: Sequence[tuple[int, str]], loading: int, approaching: int, start: int = 0
) -> Indices:
    """Indices under both controls by counting folds along the curve.

    With the displacement fixed, the slope dF/dd is −(coupling)²/λ plus something finite, where λ is the eigenvalue that
    vanishes at a displacement fold: λ turns negative where the slope goes from −∞ to +∞, and positive where it goes
    from +∞ to −∞ (Poincaré's turning points). Freeing the displacement adds one where the slope is negative:
    n_load = n_displacement + [dF/dd < 0].

    Parameters
    ----------
    count : int
        Number of rows.
    folds : sequence of (row, control)
        Load and displacement folds.
    loading, approaching : int
        Signs of the changes of load and displacement where the curve starts.
    start : int
        Index under displacement control there.
    """
    pieces = max(count - 1, 0)
    load_sign, displacement_sign, index = loading, approaching, start
    columns = np.zeros((4, pieces), dtype=np.int64)
    at: dict[int, list[str]] = {}
    for row, control in folds:
        at.setdefault(row, []).append(control)
    for k in range(pieces):
        for control in at.get(k, ()):
            if control == "load":
                load_sign = -load_sign
            else:
                index += 1 if load_sign * displacement_sign < 0 else -1
                displacement_sign = -displacement_sign
        columns[:, k] = index + (load_sign * displacement_sign < 0), index, load_sign, displacement_sign
    return Indices(_rows(columns[0]), _rows(columns[1]), *columns)


def _rows(pieces: Integers) -> Integers:
    if len(pieces) == 0:
        return np.zeros(1, dtype=np.int64)
    return np.minimum(np.append(pieces[:1], pieces), np.append(pieces, pieces[-1:]))
