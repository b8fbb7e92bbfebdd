"""Stability of an equilibrium on a lattice: the lowest eigenvalues of the second variation.

Variations x of u vanish in the contact and are free elsewhere (nodes I). If the displacement is held, the far field
answers the mean of x with the stiffness 1/C, which makes K̂(0) = 1/(C A) of an elasticity K_d that is positive definite,
and the second variation of the energy, for an area h² of a node, is ``h² x·(K_d + v'') x``. Eigenvalues are those of

    (K_d + v'')_II x = λ (K_d)_II x,

so λ = 1 - κ, κ the largest eigenvalues of (K_d)⁻¹(-v''): the ratio of what the interaction's softening yields to
what elasticity costs. They depend neither on the grid nor on the cell once these are fine and large, and gather at 1.
Negative ones are counted. On a quarter of the lattice variations are even about both middle lines.

Holding the load takes the positive term of rank one away again, so it adds one unstable mode at most, and does so if
and only if dF/dd < 0; a spring of stiffness k adds one if and only if dF/dd < -k.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from contbranch.arrays import Array

from .newton import Equilibrium
from .problem import GridProblem
from .variation import Precision, Variation, lowest

__all__ = ["Spectrum", "Stability", "as_stability"]


# Eigenvalues smaller than this have no sign: equilibria are not exact, nor are lattices round.
ZERO = 1e-6


@dataclass(frozen=True)
class Spectrum:
    """Lowest eigenvalues at fixed displacement.

    Attributes
    ----------
    eigenvalues, errors : array (k,)
        λ in increasing order (module), and error bounds. Empty where nothing softens.
    vectors : array (k, n, n)
        Variations x with x·K_d x = 1/h² (the energy's norm).
    complete : bool
        Whether all pairs reached the precision asked for.
    """

    eigenvalues: Array
    errors: Array
    vectors: Array
    complete: bool = True

    @property
    def index(self) -> int:
        """Number of negative eigenvalues."""
        return int((self.eigenvalues < 0.0).sum())

    @property
    def uncertain(self) -> bool:
        """Whether the sign of an eigenvalue is within its error, or precision was not reached."""
        return not self.complete or bool((np.abs(self.eigenvalues) <= self.errors + ZERO).any())


@dataclass
class Stability:
    """Stability of the equilibria of one problem.

    Attributes
    ----------
    problem : GridProblem
    precision : Precision
    previous : sequence of array
        Eigenvectors found last, where the next search starts. Clear it when the state is another one.
    """

    problem: GridProblem
    precision: Precision = field(default_factory=Precision)
    previous: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self._elastic = self.problem.lattice.held_symbol

    def variation(self, equilibrium: Equilibrium) -> Variation:
        """The second variation of a state."""
        return Variation(self.problem.transform, self._elastic, equilibrium.fields.stiffness, ~equilibrium.contact)

    def spectrum(self, equilibrium: Equilibrium, precision: Precision | None = None, count: int = 0) -> Spectrum:
        """Lowest eigenvalues, at least `count` of them."""
        variation = self.variation(equilibrium)
        if not count and bool((variation.softening >= 0.0).all()):
            empty = np.zeros(0)
            return Spectrum(empty, empty, np.zeros((0, 0, 0)))
        with as_stability(self.problem):
            values, errors, vectors, complete = lowest(
                variation, list(self.previous), self._seeds(equilibrium), precision or self.precision, count
            )
        vectors /= np.sqrt(self.problem.lattice.node_area)
        self.previous = vectors = vectors.reshape(-1, *variation.shape)
        return Spectrum(values, errors, vectors, complete)

    def index(self, equilibrium: Equilibrium) -> int:
        """Number of unstable modes with the symmetry of the tip, at fixed displacement."""
        spectrum = self.spectrum(equilibrium)
        negative = spectrum.vectors[: spectrum.index]
        if self.problem.lattice.quarter and self.problem.swapped:
            return sum(np.vdot(vector, vector.T) > 0.0 for vector in negative)
        return len(negative)

    def _seeds(self, equilibrium: Equilibrium) -> list[Array]:
        """The softening, which is of one sign; on a whole lattice with the signs of odd variations; random numbers.

        Where variations are even or odd about x = y, once more with that sign: on a fine lattice random numbers have
        next to nothing of cos 2θ.
        """
        lattice, softening = self.problem.lattice, np.maximum(-equilibrium.fields.stiffness, 0.0)
        x, y = lattice.axes
        seeds = [softening, softening * np.sign(np.abs(x)[:, None] - np.abs(y))]
        if not lattice.quarter:
            seeds += [softening * sign for sign in (np.sign(x)[:, None], np.sign(y), np.sign(np.outer(x, y)))]
        random = np.random.default_rng(softening.size)
        return [*seeds, softening * random.standard_normal(softening.shape)]


@contextmanager
def as_stability(problem: GridProblem) -> Iterator[None]:
    """Count all work as that on stability, equilibria included that are found for its sake."""
    before = problem.counter.target
    problem.counter.target = "stability"
    try:
        yield
    finally:
        problem.counter.target = before
