"""The second variation of an equilibrium on a lattice, and its lowest eigenvalues.

Eigenvalues are those of ``(K_d + v'')_II x = λ (K_d)_II x`` (see `stability`), by a block Davidson iteration: each step
adds K_d⁻¹ r, for every pair whose residual r is not small, to the space in which Ritz values are formed. Without
contact these are the vectors of a block Krylov space of K_d⁻¹ v''. Ritz values lie above the eigenvalues, so negative
ones are never counted in excess, and an eigenvalue lies within √(r·K_d⁻¹r) of a Ritz value, since
((K_d)_II)⁻¹ ≤ (K_d⁻¹)_II.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array, Flags, magnitude

from .transforms import Transform

__all__ = ["Precision", "Variation", "lowest"]


# Rounding of an eigenvalue, relative to the largest.
ROUNDING = 1e-13
# Square of the norm, relative, below which what orthogonalisation leaves of a vector is no new direction.
DEPENDENT = 1e-8
# Memory for a basis, bytes, and vectors that it holds in any case.
MEMORY = 2**29
LEAST = 12


@dataclass(frozen=True)
class Precision:
    """When eigenvalues are exact enough.

    Attributes
    ----------
    tolerance : float
        Norm of the residual below which a pair is left alone; the error of its eigenvalue is about the square of it.
    share : float
        The same, relative to the eigenvalue: its sign is all that an index asks for.
    guard : int
        Pairs above the negative ones that have to be exact, too.
    limit : int
        Iterations at most.
    basis : int
        Vectors kept, twice (the vector, and K_d times it), before a restart; more where many pairs are negative.
    """

    tolerance: float = 1e-3
    share: float = 0.2
    guard: int = 1
    limit: int = 60
    basis: int = 24


class Variation:
    """K_d, its inverse and v'' on the variations of one sector of one state.

    Parameters
    ----------
    transform : Transform
        Of the sector.
    elastic : array
        K̂_d of the sector.
    stiffness : array (n, n)
        v''.
    free : array of bool (n, n)
        I.
    """

    def __init__(self, transform: Transform, elastic: Array, stiffness: Array, free: Flags) -> None:
        self.transform = transform
        self.shape = free.shape
        self.size = free.size
        self.mask = free.ravel().astype(np.float64)
        self.unrestricted = bool(free.all())
        self.softening = stiffness.ravel() * self.mask
        self._forward = elastic * transform.normalisation
        self._inverse = transform.normalisation / elastic

    def elastic(self, x: Array) -> Array:
        """(K_d)_II x, one pair."""
        return self.transform.filter(self._forward, x.reshape(self.shape)).ravel() * self.mask

    def pressure(self, x: Array) -> Array:
        """K_d x, contact included, (n, n)."""
        return self.transform.filter(self._forward, x.reshape(self.shape))

    def inverse(self, r: Array) -> Array:
        """(K_d⁻¹)_II r, one pair: the inverse of `elastic` if there is no contact, and above it if there is."""
        return self.transform.filter(self._inverse, r.reshape(self.shape)).ravel() * self.mask

    def response(self, r: Array) -> tuple[Array, Array]:
        """``x = inverse(r)`` and ``elastic(x)``, without a transform for the latter if there is no contact."""
        x = self.inverse(r)
        return x, (np.array(r) if self.unrestricted else self.elastic(x))


class _Basis:
    """Vectors x_i with x_i·K_d x_j = δ_ij, their K_d x_i, and the matrix x_i·v'' x_j."""

    def __init__(self, variation: Variation, room: int) -> None:
        self.variation = variation
        self.vectors = np.empty((room, variation.size))
        self.elastic = np.empty((room, variation.size))
        self.matrix = np.zeros((room, room))
        self.count = 0

    def append(self, x: Array, elastic: Array) -> bool:
        """Take up a vector, unless it lies in the span of the others; `elastic` is K_d x. Both are overwritten."""
        before = x @ elastic
        if not before > 0.0 or self.count == len(self.vectors):
            return False
        n = self.count
        for _ in range(2):
            parts = self.elastic[:n] @ x
            x -= parts @ self.vectors[:n]
            elastic -= parts @ self.elastic[:n]
        norm = x @ elastic
        if norm <= DEPENDENT * before:
            return False
        self.vectors[n], self.elastic[n] = x / np.sqrt(norm), elastic / np.sqrt(norm)
        self.count = n + 1
        row = self.vectors[: n + 1] @ (self.variation.softening * self.vectors[n])
        self.matrix[n, : n + 1] = self.matrix[: n + 1, n] = row
        return True

    def ritz(self) -> tuple[Array, Array]:
        """Ritz values λ in increasing order, and coefficients, one column each."""
        values, coefficients = np.linalg.eigh(self.matrix[: self.count, : self.count])
        return 1.0 + values, coefficients

    def pair(self, coefficients: Array) -> tuple[Array, Array]:
        """A vector of the span, and K_d times it."""
        return coefficients @ self.vectors[: self.count], coefficients @ self.elastic[: self.count]

    def grow(self, room: int) -> None:
        """Make room for more vectors."""
        missing = room - len(self.vectors)
        self.vectors = np.concatenate([self.vectors, np.empty((missing, self.variation.size))])
        self.elastic = np.concatenate([self.elastic, np.empty((missing, self.variation.size))])
        self.matrix = np.pad(self.matrix, (0, missing))

    def restart(self, values: Array, coefficients: Array) -> None:
        """Keep the span of some Ritz vectors only."""
        kept = len(values)
        self.vectors[:kept] = coefficients.T @ self.vectors[: self.count]
        self.elastic[:kept] = coefficients.T @ self.elastic[: self.count]
        self.matrix[:kept, :kept] = np.diag(values - 1.0)
        self.count = kept


def lowest(
    variation: Variation, start: Sequence[Array], seeds: Sequence[Array], precision: Precision, count: int = 0
) -> tuple[Array, Array, Array, bool]:
    """Lowest eigenvalues: the negative ones, and as many above them as `precision` guards, or `count` in all.

    Parameters
    ----------
    variation : Variation
    start : sequence of array (n, n)
        Guesses of the eigenvectors.
    seeds : sequence of array (n, n)
        Pressures whose responses are taken up besides, so that no eigenvector is orthogonal to all.

    Returns
    -------
    eigenvalues, errors : array (k,)
    vectors : array (k, size)
    complete : bool
    """
    most = max(LEAST, MEMORY // (16 * variation.size))
    room = min(precision.basis, most)
    basis = _Basis(variation, room)
    for guess in start:
        x = guess.ravel() * variation.mask
        basis.append(x, variation.elastic(x))
    for seed in seeds:
        basis.append(*variation.response(seed.ravel() * variation.mask))
    iteration = 0
    while True:
        values, coefficients = basis.ritz()
        negative = int((values < 0.0).sum())
        wanted = min(max(negative + precision.guard, count), basis.count)
        bounds, steps = np.zeros(wanted), []
        for j in range(wanted):
            x, elastic = basis.pair(coefficients[:, j])
            residual = variation.softening * x + (1.0 - values[j]) * elastic
            step = variation.inverse(residual)
            bounds[j] = np.sqrt(max((residual @ step), 0.0))
            if bounds[j] > max(precision.tolerance, precision.share * min(abs(values[j]), 1.0)):
                steps.append((step, residual))
        if not steps or iteration == precision.limit:
            break
        if basis.count + len(steps) > room and 3 * wanted > room and 2 * room <= most:
            room *= 2
            basis.grow(room)
        elif basis.count + len(steps) > room:
            kept = min(wanted + 2, room // 2)
            basis.restart(values[:kept], coefficients[:, :kept])
        added = [
            basis.append(step, residual if variation.unrestricted else variation.elastic(step))
            for step, residual in steps
        ]
        iteration += 1
        if not any(added):
            break
    vectors = coefficients[:, :wanted].T @ basis.vectors[: basis.count]
    return values[:wanted], _errors(values, bounds), vectors, not steps


def _errors(values: Array, bounds: Array) -> Array:
    """Errors of Ritz values: the norm of the residual, or its square over the distance of the next eigenvalue.

    The next one may be 1, where eigenvalues gather, even if no Ritz value says so.
    """
    errors = np.array(bounds)
    for j, bound in enumerate(bounds):
        others = np.append(np.delete(values, j), 1.0)
        gap = np.abs(others - values[j]).min() - bound
        if gap > 0.0:
            errors[j] = min(bound, bound**2 / gap)
    return errors + ROUNDING * max(1.0, magnitude(values))
