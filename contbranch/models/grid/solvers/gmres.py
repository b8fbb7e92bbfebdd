"""Restarted GMRES for operators without a matrix."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

__all__ = ["Krylov", "gmres"]

Array = NDArray[np.float64]


class Krylov(NamedTuple):
    """Outcome of a Krylov solution: x, iterations, and the norm of the residual relative to that of the right side."""

    x: Array
    iterations: int
    ratio: float


def gmres(
    apply: Callable[[Array], tuple[Array, Array]],
    right_side: Array,
    tolerance: float,
    limit: int = 200,
    restart: int = 60,
) -> Krylov:
    """Solve A x = b with the smallest residual ‖b - A x‖ in each Krylov space of A M⁻¹.

    Parameters
    ----------
    apply : callable
        From y, (n,), to A M⁻¹ y and M⁻¹ y, both (n,) and new arrays: a preconditioner's products are kept, so that the
        solution costs no further one.
    right_side : array (n,)
    tolerance : float
        Residual to reach, relative to the right side's.
    limit, restart : int
        Iterations at most, in all and with one basis (which holds that many vectors).

    Notes
    -----
    Saad and Schultz, SIAM J. Sci. Stat. Comput. 7, 856 (1986); classical Gram-Schmidt, twice where it loses digits.
    """
    total = float(np.linalg.norm(right_side))
    x = np.zeros_like(right_side)
    if total == 0.0 or not math.isfinite(total):
        return Krylov(x, 0, 0.0 if total == 0.0 else math.inf)
    residual, norm, used = right_side, total, 0
    while True:
        step, image, iterations, norm = _cycle(apply, residual, norm, tolerance * total, min(restart, limit - used))
        x += step
        used += iterations
        if norm <= tolerance * total or used >= limit or iterations == 0:
            return Krylov(x, used, norm / total)
        residual = residual - image
        norm = float(np.linalg.norm(residual))


def _cycle(
    apply: Callable[[Array], tuple[Array, Array]],
    residual: Array,
    norm: float,
    goal: float,
    size: int,
) -> tuple[Array, Array, int, float]:
    """One cycle: the correction, A times it, its iterations, and the norm of the residual that is left."""
    basis, smoothed = [residual / norm], list[Array]()
    triangle = np.zeros((size, size))
    rotations: list[tuple[float, float]] = []
    rest = np.zeros(size + 1)
    rest[0] = norm
    count = 0
    for k in range(size):
        w, smooth = apply(basis[k])
        smoothed.append(smooth)
        before = float(np.linalg.norm(w))
        column = np.array([v @ w for v in basis])
        for v, h in zip(basis, column, strict=True):
            w -= h * v
        length = float(np.linalg.norm(w))
        if length < 0.1 * before:
            again = np.array([v @ w for v in basis])
            for v, h in zip(basis, again, strict=True):
                w -= h * v
            column += again
            length = float(np.linalg.norm(w))
        for i, (c, s) in enumerate(rotations):
            column[i : i + 2] = (
                (c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]) if i + 1 <= k else column[i]
            )
        radius = math.hypot(column[k], length)
        if radius == 0.0 or not math.isfinite(radius):
            break
        c, s = column[k] / radius, length / radius
        rotations.append((c, s))
        column[k] = radius
        triangle[: k + 1, k] = column
        rest[k + 1], rest[k] = -s * rest[k], c * rest[k]
        count = k + 1
        if abs(rest[k + 1]) <= goal or length <= 1e-14 * before:
            break
        basis.append(w / length)
    if count == 0:
        return np.zeros_like(residual), np.zeros_like(residual), 0, norm
    weights = solve_triangular(triangle[:count, :count], rest[:count])
    left = _combined(basis[: count + 1], _remainder(rest[count], rotations)) if len(basis) > count else 0.0 * residual
    return _combined(smoothed[:count], weights), residual - left, count, abs(float(rest[count]))


def _remainder(size: float, rotations: list[tuple[float, float]]) -> Array:
    """The residual's coefficients in the basis: the last unit vector, rotated back."""
    vector = np.zeros(len(rotations) + 1)
    vector[-1] = size
    for k in range(len(rotations) - 1, -1, -1):
        c, s = rotations[k]
        vector[k], vector[k + 1] = c * vector[k] - s * vector[k + 1], s * vector[k] + c * vector[k + 1]
    return vector


def _combined(vectors: list[Array], weights: Array) -> Array:
    total = weights[0] * vectors[0]
    for weight, vector in zip(weights[1:], vectors[1:], strict=True):
        total += weight * vector
    return np.asarray(total)
