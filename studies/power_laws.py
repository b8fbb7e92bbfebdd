"""Power laws with corrections to scaling, fitted to measurements, with errors that contain those of the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["PowerLaw", "fit_power_law", "rounded_up"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PowerLaw:
    """Q = prefactor · μ^exponent · (1 + first ε + …) with ε = μ^(3/2).

    Each error is the largest change of the result with the window of μ and with the number of corrections.

    Attributes
    ----------
    exponent, exponent_error : float
    prefactor, prefactor_error : float
        With the exponent fixed at the value that theory gives.
    first, first_error : float
        Coefficient of ε, likewise.
    plain : float
        Exponent of a straight line through the logarithms, over the largest window.
    """

    exponent: float
    exponent_error: float
    prefactor: float
    prefactor_error: float
    first: float
    first_error: float
    plain: float


def fit_power_law(
    tabor: ArrayLike,
    value: ArrayLike,
    error: ArrayLike,
    power: float,
    largest: Sequence[float],
    corrections: Sequence[int] = (1, 2, 3),
) -> PowerLaw:
    """Fit ln Q = ln A + p ln μ + Σ_j b_j ε^j by weighted least squares.

    Parameters
    ----------
    tabor, value, error : array (M,)
        μ, Q and the errors of Q.
    power : float
        Exponent for the fits of the prefactor.
    largest : sequence of float
        Upper ends of the windows of μ, the largest first; all windows start at the smallest μ.
    corrections : sequence of int
        Numbers of corrections; the second one with the first window gives the result, all others its error.
    """
    x, q, noise = (np.asarray(values, dtype=np.float64) for values in (tabor, value, error))
    rows = []
    for stop in largest:
        inside = x <= stop
        for count in corrections:
            free = _solve(x[inside], q[inside], noise[inside], count, None)
            fixed = _solve(x[inside], q[inside], noise[inside], count, power)
            rows.append((free[0], np.exp(fixed[0]), fixed[1]))
    table = np.array(rows)
    best = table[min(1, len(corrections) - 1)]
    spread = np.abs(table - best).max(axis=0)
    inside = x <= largest[0]
    plain = np.polyfit(np.log(x[inside]), np.log(q[inside]), 1)[0]
    return PowerLaw(
        float(best[0]), float(spread[0]), float(best[1]), float(spread[1]), float(best[2]), float(spread[2]),
        float(plain),
    )  # fmt: skip


def _solve(tabor: Array, value: Array, noise: Array, corrections: int, power: float | None) -> Array:
    """(p,) ln A, b_1, …; what is left out, of order ε^(corrections + 1), counts as an error of each point, too."""
    columns = [np.ones_like(tabor), *(tabor ** (1.5 * j) for j in range(1, corrections + 1))]
    target = np.log(value)
    if power is None:
        columns.insert(0, np.log(tabor))
    else:
        target = target - power * np.log(tabor)
    weight = 1 / (noise / value + tabor ** (1.5 * (corrections + 1)))
    matrix = np.stack(columns, axis=1) * weight[:, None]
    return np.asarray(np.linalg.lstsq(matrix, target * weight, rcond=None)[0])


def rounded_up(error: float) -> str:
    """An error with one digit, rounded up."""
    power = np.floor(np.log10(max(error, 1e-300)))
    return f"{np.ceil(error / 10**power * (1 - 1e-9)) * 10**power:.0e}"
