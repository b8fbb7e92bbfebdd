"""Morse index of a state with any regions at rest, by eigenvalues on the floating nodes."""

from __future__ import annotations

import numpy as np

from .equations import Fields, RingEquations

__all__ = ["unstable_modes"]


def unstable_modes(problem: RingEquations, fields: Fields) -> int:
    """Number of unstable axisymmetric modes under displacement control; -1: unknown.

    Where the gap rests it cannot vary; there the pressure answers. With A the flexibility of the floating nodes that
    remains (a Schur complement of W, self-adjoint with 2πr dr) the second variation for changes of pressure is
    ``A + A v'' A``: as many are unstable as ``A v''``, whose eigenvalues are real, has below -1. Nodes show those as
    accurately as smooth functions; matrices made symmetric do not.
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
    matrix = flexibility * fields.stiffness[free]
    return int(np.count_nonzero(np.linalg.eigvals(matrix).real < -1.0)) if np.isfinite(matrix).all() else -1
