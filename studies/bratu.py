"""The Bratu problem u'' + λ eᵘ = 0, u(0) = u(1) = 0: its curve, its fold, and the time a point takes.

Run it with one BLAS thread: OPENBLAS_NUM_THREADS=1 python studies/bratu.py
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy import sparse

from contbranch.continuation import Curve, Options, Problem, trace_curve
from contbranch.continuation.problem import Array


class Bratu(Problem):
    """Central differences on n interior points, as (u'' + λ eᵘ) = 0 with a sparse Jacobian."""

    def __init__(self, n: int = 100):
        self.n = n
        self.curvature = float(n + 1) ** 2
        neighbours = sparse.eye_array(n, k=1) + sparse.eye_array(n, k=-1)
        self._jacobian = sparse.csc_array((neighbours - 2 * sparse.eye_array(n)) * self.curvature)
        self._diagonal = np.flatnonzero(
            self._jacobian.indices == np.repeat(np.arange(n), np.diff(self._jacobian.indptr))
        )

    def residual(self, x: Array, p: float) -> Array:
        """Return u'' + λ eᵘ at the interior points."""
        second = -2 * x
        second[1:] += x[:-1]
        second[:-1] += x[1:]
        return self.curvature * second + p * np.exp(x)

    def jacobian(self, x: Array, p: float) -> Any:
        """Return the tridiagonal Jacobian."""
        matrix = self._jacobian.copy()
        matrix.data[self._diagonal] += p * np.exp(x)
        return matrix

    def parameter_derivative(self, x: Array, p: float) -> Array:
        """Return eᵘ."""
        return np.exp(x)


def trace(n: int = 100, lowest: float = 0.0, options: Options | None = None) -> Curve:
    """Return the curve from λ = 0 through the fold and down the upper branch."""
    return trace_curve(Bratu(n), np.zeros(n), 0.0, parameter_range=(lowest, 4.0), options=options)


def milliseconds_a_point(n: int = 100, repetitions: int = 5) -> float:
    """Return the best of several measurements of the time a point of the whole curve."""
    best = np.inf
    for _ in range(repetitions):
        begin = time.perf_counter()
        curve = trace(n)
        best = min(best, (time.perf_counter() - begin) / len(curve.points))
    return 1e3 * best


def main() -> None:
    """Print the fold and the time a point."""
    curve = trace()
    fold = curve.folds[0]
    print(f"{len(curve.points)} points, {curve.status}: {curve.message}")
    print(f"fold at λ = {fold.parameter:.15f} ± {fold.error:.1e}, max u = {fold.x.max():.12f}")
    for other in curve.events[1:]:
        print(f"{other.kind} at λ = {other.parameter:.6e}")
    print(f"{milliseconds_a_point():.3f} ms a point")


if __name__ == "__main__":
    main()
