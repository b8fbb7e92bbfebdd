"""Polynomials through values and slopes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Hermite"]


class Hermite:
    """The polynomials through values and slopes at the first one, two, three ... of some places, in Newton's form.

    Parameters
    ----------
    places : sequence of float
        All different.
    values, slopes : sequence of float or (n,) arrays
    """

    def __init__(self, places: Sequence[float], values: Sequence[Any], slopes: Sequence[Any]) -> None:
        self._nodes = [place for place in places for _ in range(2)]
        # Divided differences with every place taken twice: the first differences at a double place are the slopes.
        column = [value for value in values for _ in range(2)]
        self._coefficients = [column[0]]
        for order in range(1, len(column)):
            column = [
                slopes[i // 2]
                if order == 1 and i % 2 == 0
                else (column[i + 1] - column[i]) / (self._nodes[i + order] - self._nodes[i])
                for i in range(len(column) - 1)
            ]
            self._coefficients.append(column[0])

    def at(self, s: float | npt.NDArray[np.float64]) -> list[tuple[Any, Any]]:
        """Return value and slope at s of the polynomials through one, two, ... places."""
        basis: Any = 1.0
        basis_slope: Any = 0.0
        value: Any = 0.0
        slope: Any = 0.0
        found = []
        for i, (coefficient, node) in enumerate(zip(self._coefficients, self._nodes, strict=True)):
            value = value + coefficient * basis
            slope = slope + coefficient * basis_slope
            basis, basis_slope = basis * (s - node), basis_slope * (s - node) + basis
            if i % 2:
                found.append((value, slope))
        return found
