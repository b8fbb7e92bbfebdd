"""Restarted GMRES for operators without a matrix."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from contbranch.models.grid.arrays import Array

__all__ = ["gmres"]


def gmres(
    apply: Callable[[Array], tuple[Array, Array]],
    right_side: Array,
    tolerance: float,
    limit: int = 200,
    restart: int = 60,
) -> Array:
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
    x, residual = np.zeros_like(right_side), right_side
    norm = np.linalg.norm(residual)
    goal, used = tolerance * norm, 0
    while norm > goal and np.isfinite(norm) and used < limit:
        step, residual, iterations = _cycle(apply, residual, norm, goal, min(restart, limit - used))
        if not iterations:
            break
        x += step
        used += iterations
        norm = np.linalg.norm(residual)
    return x


def _cycle(
    apply: Callable[[Array], tuple[Array, Array]], residual: Array, norm: np.floating, goal: np.floating, size: int
) -> tuple[Array, Array, int]:
    """One cycle: the correction, the residual that is left, and the iterations."""
    basis, smoothed = np.empty((size + 1, residual.size)), np.empty((size, residual.size))
    hessenberg = np.zeros((size + 1, size))
    # What is left of the residual is along the vector orthogonal to all columns, ‖residual‖ e₀/‖that vector‖ long.
    rest = np.eye(1, size + 1)[0]
    basis[0] = residual / norm
    count = 0
    for k in range(size):
        w, smoothed[k] = apply(basis[k])
        known, column = basis[: k + 1], hessenberg[: k + 1, k]
        before = length = np.linalg.norm(w)
        for _ in range(2):
            parts = known @ w
            w -= parts @ known
            column += parts
            length = np.linalg.norm(w)
            if length >= 0.1 * before:
                break
        if not np.isfinite(length) or not (length or column.any()):
            break
        count = k + 1
        hessenberg[count, k] = length
        basis[count] = w / (length or 1.0)
        if length <= 1e-14 * before:
            rest[:] = 0.0
            break
        rest[count] = -(rest[:count] @ column) / length
        if norm <= goal * np.linalg.norm(rest):
            break
    if not count:
        return residual, residual, 0
    weights = np.linalg.lstsq(hessenberg[: count + 1, :count], norm * np.eye(1, count + 1)[0])[0]
    left = norm / (rest @ rest or 1.0) * rest[: count + 1]
    return weights @ smoothed[:count], left @ basis[: count + 1], count
