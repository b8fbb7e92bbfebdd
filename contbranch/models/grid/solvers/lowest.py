"""The lowest eigenvalue of a symmetric operator H in the metric of a mobility W: that of W H."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal

from contbranch.models.grid.arrays import Array

__all__ = ["Lowest", "lowest"]


# Steps in which the value must not have decreased any more.
_STEADY = 6


class Lowest(NamedTuple):
    """The lowest Ritz value, an upper bound of the eigenvalue, its distance to an eigenvalue at most, and the steps."""

    value: float
    error: float
    steps: int


def lowest(
    operator: Callable[[Array], Array],
    mobility: Callable[[Array], Array],
    start: Array,
    accuracy: float = 0.1,
    limit: int = 100,
) -> Lowest:
    """Lanczos' iteration for W H, symmetric in the product x·Wy.

    It ends with a negative value, which is proof of a negative eigenvalue, or when a positive value has both an error
    and a decrease in the last steps below ``accuracy``, relatively. (The error alone is the distance to some
    eigenvalue, maybe not to the lowest one, if the start has little of its eigenvector.) Vectors are not
    orthogonalised again: that repeats eigenvalues, but adds none, and only a few vectors are kept.

    Parameters
    ----------
    operator, mobility : callable
        H and W; they return new arrays.
    start : array
        Any vector, with a component along the eigenvector.
    accuracy : float
        Relative.
    limit : int
        Steps at most.

    Returns
    -------
    Lowest
        Infinite if the mobility of the start vanishes.
    """
    y, v = start, mobility(start)
    norm = math.sqrt(float(np.vdot(y, v)))
    if norm == 0.0:
        return Lowest(math.inf, 0.0, 0)
    y, v = y / norm, v / norm
    before, link = np.zeros_like(y), 0.0
    diagonal: list[float] = []
    off: list[float] = []
    history: list[float] = []
    while True:
        w = operator(v) - link * before
        diagonal.append(float(np.vdot(v, w)))
        w -= diagonal[-1] * y
        u = mobility(w)
        link = math.sqrt(max(float(np.vdot(w, u)), 0.0))
        values, vectors = eigh_tridiagonal(diagonal, off, select="i", select_range=(0, 0))
        value, error = float(values[0]), link * abs(float(vectors[-1, 0]))
        exhausted = link <= 1e-14 * max(abs(x) for x in (*diagonal, *off, 1e-300))
        history.append(value)
        settled = len(history) > _STEADY and history[-1 - _STEADY] - value <= accuracy * value
        if value < 0.0 or (settled and error <= accuracy * value) or exhausted or len(diagonal) == limit:
            return Lowest(value, error, len(diagonal))
        off.append(link)
        before, y, v = y, w / link, u / link
