"""Linear systems with one border, for dense, sparse and matrix-free Jacobians.

Every step of a continuation solves

    [ J    b ] [ u ]   [ f ]
    [ cᵀ   d ] [ a ] = [ g ]

with J = dF/dx (n x n), the column b = dF/dp, and a row (cᵀ, d) that says along which direction the curve is
measured. The bordered matrix stays regular at folds, where J is singular; so it is factorised as a whole rather than
by elimination of J.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy
from scipy.linalg.lapack import dgetrf, dgetrs

from contbranch.arrays import AnyArray, Array, Indices
from contbranch.continuation.problem import Direction

# Below this size a dense factorisation costs less than setting up a sparse one (measured on tridiagonal matrices:
# 40 µs against 60 µs at n = 100, 200 µs against 80 µs at n = 200).
DENSE_UP_TO = 128


class SingularBorderedError(ArithmeticError):
    """The bordered matrix is singular or holds values that are not finite."""


class UnsolvedError(ArithmeticError):
    """An iteration for a linear system did not converge."""


class Bordered:
    """A factorised bordered matrix; this one is that of a problem that solves its systems itself."""

    def solve(self, f: Array, g: float) -> Direction:
        """Return (u, a) for the right-hand side (f, g)."""
        raise SingularBorderedError("The problem solves its systems itself.")

    def solve_transposed(self, f: Array, g: float) -> Direction | None:
        """Return the solution with the transposed matrix, None where that is not available."""
        return None

    def determinant_sign(self) -> int | None:
        """Return the sign of the determinant, None where it is not available."""
        return None


def border_scales(jacobian: Any, b: Array, c: Array, d: float) -> tuple[float, float]:
    """Return the powers of two that make column and row of a border as large as J, or the corner if that is larger.

    Pivots are then chosen among entries of like size.
    """
    size, *borders = (float(abs(part).max(initial=0.0)) for part in (jacobian, b, c))
    if not (size > 0.0 and math.isfinite(size + sum(borders) + d)):
        return 1.0, 1.0
    scales = [math.log2(size) - math.log2(part) if part else 0.0 for part in borders]
    excess = max(sum(scales) + math.log2(abs(d)) - math.log2(size), 0.0) / 2 if d else 0.0
    column, row = (2.0 ** round(min(max(scale - excess, -500.0), 500.0)) for scale in scales)
    return column, row


class Factorised(Bordered, ABC):
    """An LU factorisation of the whole matrix, with its border scaled by powers of two."""

    column_scale: float
    row_scale: float

    @abstractmethod
    def substituted(self, f: Array, g: float, transposed: bool) -> Direction:
        """Return the solution with the scaled matrix."""

    def solve(self, f: Array, g: float) -> Direction:
        """Return (u, a) for the right-hand side (f, g)."""
        u, a = self.substituted(f, g * self.row_scale, False)
        return u, a * self.column_scale

    def solve_transposed(self, f: Array, g: float) -> Direction | None:
        """Return the solution with the transposed matrix."""
        u, a = self.substituted(f, g * self.column_scale, True)
        return u, a * self.row_scale


class DenseBordered(Factorised):
    """LU factorisation of the whole (n+1) x (n+1) matrix."""

    def __init__(self, jacobian: Array, b: Array, c: Array, d: float):
        self._n = n = b.size
        self.column_scale, self.row_scale = border_scales(jacobian, b, c, d)
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = jacobian
        matrix[:n, n] = b * self.column_scale
        matrix[n, :n] = c * self.row_scale
        matrix[n, n] = d * self.column_scale * self.row_scale
        # LAPACK stores by columns, arrays are stored by rows: what is factorised is the transposed matrix.
        self._lu, self._pivots, info = dgetrf(matrix.T, overwrite_a=1)
        if info != 0:
            raise SingularBorderedError("The bordered matrix is singular.")

    def substituted(self, f: Array, g: float, transposed: bool) -> Direction:
        """Return the solution with the scaled matrix."""
        n = self._n
        rhs = np.empty(n + 1)
        rhs[:n] = f
        rhs[n] = g
        solution, _ = dgetrs(self._lu, self._pivots, rhs, trans=int(not transposed), overwrite_b=1)
        return solution[:n], float(solution[n])

    def determinant_sign(self) -> int | None:
        """Return the sign of the determinant: that of the pivots, times the parity of the exchanges."""
        negative = np.count_nonzero(self._lu.diagonal() < 0)
        exchanges = np.count_nonzero(self._pivots != np.arange(self._n + 1))
        return -1 if (negative + exchanges) % 2 else 1


class SparseBordered(Factorised):
    """Sparse LU factorisation (SuperLU) of the whole matrix."""

    def __init__(self, jacobian: Any, b: Array, c: Array, d: float):
        self._n = b.size
        csc = scipy.sparse.csc_array(jacobian)
        if not csc.has_canonical_format:
            csc = csc.copy()  # the caller's own stays as it is
            csc.sum_duplicates()
        self.column_scale, self.row_scale = border_scales(csc.data, b, c, d)
        # Elimination adds up to n terms to the row, which fills the matrix if it becomes the pivot.
        self.row_scale /= 2.0 ** self._n.bit_length()
        b, c, d = b * self.column_scale, c * self.row_scale, d * self.column_scale * self.row_scale
        frame = _frame(self._n, csc.indptr.astype(np.int32).tobytes(), csc.indices.astype(np.int32).tobytes())
        self._order = order = frame.order
        data = np.empty(frame.rows.size)
        data[frame.places] = csc.data[frame.source]
        data[frame.starts[1:-1] - 1], data[frame.starts[-2] : -1], data[-1] = c[order], b[order], d
        matrix = scipy.sparse.csc_array((data, frame.rows, frame.starts), shape=(self._n + 1, self._n + 1))
        try:
            self._lu: Any = scipy.sparse.linalg.splu(matrix, permc_spec="NATURAL")
        except RuntimeError as error:
            raise SingularBorderedError("The bordered matrix is singular.") from error

    def substituted(self, f: Array, g: float, transposed: bool) -> Direction:
        """Return the solution with the scaled matrix."""
        solved = self._lu.solve(np.append(f[self._order], g), "T" if transposed else "N")
        u = np.empty(self._n)
        u[self._order] = solved[:-1]
        return u, float(solved[-1])

    def determinant_sign(self) -> int | None:
        """Return the sign of the determinant: that of U's diagonal, times the parity of both permutations."""
        negative = int(np.count_nonzero(self._lu.U.diagonal() < 0))
        return -1 if (negative + _parity(self._lu.perm_r) + _parity(self._lu.perm_c)) % 2 else 1


class _Frame(NamedTuple):
    """Where the values of a bordered matrix are, by columns: an order of J's rows and columns, then c below, b beside.

    The dense row and column go last, where they fill nothing, behind an order found once for J's pattern.
    """

    order: Indices
    starts: AnyArray  # of 32 bits, as are rows
    rows: AnyArray
    places: Indices  # of J's values ...
    source: Indices  # ... in their order here


@lru_cache(maxsize=4)
def _frame(n: int, starts: bytes, rows: bytes) -> _Frame:
    """The frame for a pattern of J, in the order of minimum degree of Jᵀ + J, which suits meshes.

    The factorisation that finds it is that of a dominant diagonal, so that it does not pivot.
    """
    indptr, indices = np.frombuffer(starts, dtype=np.int32), np.frombuffer(rows, dtype=np.int32)
    pattern = scipy.sparse.csc_array((np.full(indices.size, 1e-3), indices, indptr), shape=(n, n))
    dominant = scipy.sparse.csc_array(pattern + scipy.sparse.eye_array(n) * n)
    order = np.argsort(scipy.sparse.linalg.splu(dominant, permc_spec="MMD_AT_PLUS_A").perm_c)
    numbered = scipy.sparse.csc_array((np.arange(indices.size), indices, indptr), shape=(n, n))[order][:, order]
    numbered.sort_indices()
    places = np.arange(indices.size) + np.repeat(np.arange(n), np.diff(numbered.indptr))
    below = numbered.indptr + np.arange(n + 1)
    found = np.full(indices.size + 2 * n + 1, n, dtype=np.int32)
    found[places] = numbered.indices
    found[below[-1] :] = np.arange(n + 1)
    return _Frame(order, np.append(below, found.size).astype(np.int32), found, places, numbered.data)


def _parity(permutation: Any) -> int:
    """Return 0 for an even and 1 for an odd permutation: its length minus its number of cycles, modulo 2."""
    n = permutation.size
    graph = scipy.sparse.csr_array((np.ones(n, dtype=np.int8), permutation, np.arange(n + 1)), shape=(n, n))
    cycles = scipy.sparse.csgraph.connected_components(graph, directed=False, return_labels=False)
    return int((n - cycles) % 2)


class MatrixFreeBordered(Bordered):
    """GMRES on the bordered operator, preconditioned by an approximate inverse of J.

    The transposed operator is not required of a problem, and one without matrix does not show its determinant.

    Parameters
    ----------
    operator : LinearOperator
        J, shape (n, n).
    b, c, d
        The border.
    preconditioner : callable, optional
        Applies an approximate inverse of J.
    """

    def __init__(
        self, operator: Any, b: Array, c: Array, d: float, preconditioner: Callable[[Array], Array] | None = None
    ):
        self._n = n = b.size

        def apply(y: Array) -> Array:
            return np.append(operator @ y[:n] + b * y[n], c @ y[:n] + d * y[n])

        def approximate(y: Array) -> Array:
            return np.append(preconditioner(y[:n]) if preconditioner else y[:n], y[n])

        shape = n + 1, n + 1
        self._operator = scipy.sparse.linalg.LinearOperator(shape, matvec=apply, dtype=np.float64)
        self._preconditioner = scipy.sparse.linalg.LinearOperator(shape, matvec=approximate, dtype=np.float64)

    def solve(self, f: Array, g: float) -> Direction:
        """Return (u, a) for the right-hand side (f, g)."""
        rhs = np.append(f, g)
        size = float(np.linalg.norm(rhs))
        if size == 0.0:
            return np.zeros(self._n), 0.0
        solution = self._gmres(rhs, 1e-9)
        # GMRES cannot reach rounding by itself: one refinement of the residual does, in few iterations.
        solution = solution + self._gmres(rhs - self._operator @ solution, 1e-4)
        if not np.linalg.norm(self._operator @ solution - rhs) <= 1e-6 * size:
            raise UnsolvedError("GMRES did not converge on the bordered system; give a preconditioner.")
        return solution[: self._n], float(solution[self._n])

    def _gmres(self, rhs: Array, tolerance: float) -> Array:
        restart = min(self._n + 1, 200)
        solution, _ = scipy.sparse.linalg.gmres(
            self._operator, rhs, rtol=tolerance, restart=restart, maxiter=5, M=self._preconditioner
        )
        return np.asarray(solution)


def factorise(
    jacobian: Any, b: Array, c: Array, d: float, preconditioner: Callable[[Array], Array] | None = None
) -> Bordered:
    """Return the bordered solver that suits the Jacobian: dense, sparse or matrix-free.

    Raises
    ------
    SingularBorderedError
        If the bordered matrix is singular to working precision.
    """
    if _sparse(jacobian):
        if b.size > DENSE_UP_TO:
            return SparseBordered(jacobian, b, c, d)
        jacobian = jacobian.toarray()
    if hasattr(jacobian, "matvec"):
        return MatrixFreeBordered(jacobian, b, c, d, preconditioner)
    return DenseBordered(np.asarray(jacobian, dtype=float), b, c, d)


def _sparse(matrix: Any) -> bool:
    return not isinstance(matrix, np.ndarray) and bool(scipy.sparse.issparse(matrix))


def as_matrix(jacobian: Any) -> Any:
    """Return a Jacobian as a matrix, dense or sparse by columns; an operator shows its columns."""
    if _sparse(jacobian):
        return scipy.sparse.csc_array(jacobian)
    if hasattr(jacobian, "matvec"):  # column by column: a user's function may take vectors alone
        return np.column_stack([jacobian.matvec(column) for column in np.eye(jacobian.shape[0])])
    return np.asarray(jacobian, dtype=float)


def bordered_matrix(jacobian: Any, b: Array, c: Array, d: float) -> Any:
    """Return the matrix [J b; cᵀ d], dense or sparse like J."""
    matrix, corner = as_matrix(jacobian), np.array([[d]])
    if _sparse(matrix):
        blocks = [
            [matrix, scipy.sparse.csc_array(b[:, None])],
            [scipy.sparse.csc_array(c[None, :]), scipy.sparse.csc_array(corner)],
        ]
        return scipy.sparse.block_array(blocks, format="csc")
    return np.block([[matrix, b[:, None]], [c[None, :], corner]])
