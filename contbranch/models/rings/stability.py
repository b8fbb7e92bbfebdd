"""Morse index of a state with any regions at rest, by inertia on the floating nodes."""

from __future__ import annotations

import math

import numpy as np

from .equations import Fields, RingEquations

__all__ = ["unstable_modes"]

# Eigenvalues of the floating nodes' own flexibility below this share of the largest are left to the discretisation.
SMALLEST = 1e-9


def unstable_modes(problem: RingEquations, fields: Fields) -> int:
    """Number of unstable axisymmetric modes under displacement control.

    Where the gap rests it cannot vary; there the pressure answers. With A the flexibility of the floating nodes that
    remains (a Schur complement of W, symmetric in the weights 2πr dr) the second variation for changes of pressure is
    ``A + A v'' A``, congruent to ``1 + √A v'' √A``.
    """
    grid = fields.grid
    rests, _ = problem.resting(grid)
    free = ~rests & (fields.stiffness != 0.0)
    if not free.any():
        return 0
    w = fields.response
    flexibility = w[np.ix_(free, free)]
    if rests.any():
        answer = np.linalg.solve(w[np.ix_(rests, rests)], w[np.ix_(rests, free)])
        flexibility = flexibility - w[np.ix_(free, rests)] @ answer
    root = np.sqrt(grid.weights[free] * grid.r[free])
    symmetric = root[:, None] * flexibility / root
    symmetric = (symmetric + symmetric.T) / 2
    values, vectors = np.linalg.eigh(symmetric)
    keep = values > SMALLEST * float(values[-1])
    half = vectors[:, keep] * np.sqrt(values[keep])
    matrix = half.T @ (fields.stiffness[free][:, None] * half)
    eigenvalues = np.linalg.eigvalsh(matrix)
    return int(np.count_nonzero(eigenvalues < -1.0)) if math.isfinite(float(eigenvalues.sum())) else -1
