"""Stability of an equilibrium on a lattice: the lowest eigenvalues of the second variation, sector by sector.

Variations x of u vanish in the contact and are free elsewhere (nodes I). If the displacement is held, the far field
answers the mean of x with the stiffness 1/C, which makes K̂(0) = 1/(C A) of an elasticity K_d that is positive definite,
and the second variation of the energy, for an area h² of a node, is ``h² x·(K_d + v'') x``. Eigenvalues are those of

    (K_d + v'')_II x = λ (K_d)_II x,

so λ = 1 - κ, κ the largest eigenvalues of (K_d)⁻¹(-v''): the ratio of what the interaction's softening yields to
what elasticity costs. They depend neither on the grid nor on the cell once these are fine and large, gather at 1, and
in free space κ are the eigenvalues of the operators T_m of the axisymmetric model. Negative ones are counted.

- *Controls.* Holding the load takes the positive term of rank one away again, so it adds one unstable mode at most, and
  does so if and only if dF/dd < 0; a spring of stiffness k adds one if and only if dF/dd < -k.
- *Sectors.* In a state with both mirror symmetries variations that are even and odd about the two middle lines are
  independent. Only (even, even) ones have a mean, and feel the control.
- *Order.* |∇| has a kernel that is negative off the diagonal, on odd functions too if these are taken on half a plane.
  So the lowest eigenfunction of a sector has one sign in the quarter (Perron and Frobenius), and lowest eigenvalues of
  K + v'' have the order (even, even) < (odd, even), (even, odd) < (odd, odd): what is stable in one sector is stable in
  those after it. For the same reason a start of one sign cannot miss the lowest eigenvalue. This holds for the half
  space; a lattice follows it as far as it represents it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from contbranch.arrays import Array

from .newton import Equilibrium
from .problem import GridProblem
from .transforms import EVEN, Sector, Transform
from .variation import Precision, Variation, lowest

__all__ = ["SECTORS", "Sector", "Spectrum", "Stability", "as_stability"]

# In the order of their lowest eigenvalues.
SECTORS: tuple[Sector, ...] = (EVEN, ("odd", "even"), ("even", "odd"), ("odd", "odd"))


# Eigenvalues smaller than this have no sign: equilibria are not exact, nor are lattices round. A turn around the axis
# of a state that is not axisymmetric is an example.
ZERO = 1e-6


@dataclass(frozen=True)
class Spectrum:
    """Lowest eigenvalues of one sector, at fixed displacement.

    Attributes
    ----------
    sector : (str, str) or None
        None: the whole lattice, without symmetry.
    eigenvalues, errors : array (k,)
        λ in increasing order (module), and error bounds. Empty where the sector is stable because one before it in the
        order is, or because nothing softens.
    vectors : array (k, n, n)
        Variations x, on the array of the sector, with x·K_d x = 1/h² (the energy's norm).
    complete : bool
        Whether all pairs reached the precision asked for.
    """

    sector: Sector | None
    eigenvalues: Array
    errors: Array
    vectors: Array
    complete: bool = True

    @property
    def index(self) -> int:
        """Number of negative eigenvalues."""
        return int((self.eigenvalues < 0.0).sum())

    @property
    def stable(self) -> bool:
        """Whether the sector is stable for certain."""
        return self.index == 0 and not self.uncertain

    @property
    def uncertain(self) -> bool:
        """Whether the sign of an eigenvalue is within its error, or precision was not reached."""
        return not self.complete or bool((np.abs(self.eigenvalues) <= self.errors + ZERO).any())


@dataclass
class Stability:
    """Stability of the equilibria of one problem: plans of the sectors, and eigenvectors to start from.

    Attributes
    ----------
    problem : GridProblem
    precision : Precision
    swapped : bool
        Whether the tip is the same with x and y exchanged, so that two sectors are one.
    previous : dict
        Eigenvectors found last, where the next search starts. Clear it when the state is another one.
    """

    problem: GridProblem
    precision: Precision = field(default_factory=Precision)
    previous: dict[Sector | None, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.swapped = self.problem.swapped
        self._transforms: dict[Sector | None, tuple[Transform, Array]] = {}

    @property
    def sectors(self) -> tuple[Sector | None, ...]:
        """Sectors of the problem's lattice, in the order of their lowest eigenvalues."""
        return SECTORS if self.problem.lattice.quarter else (None,)

    def variation(self, equilibrium: Equilibrium, sector: Sector | None) -> Variation:
        """The second variation of a state in a sector."""
        problem = self.problem
        if sector not in self._transforms:
            lattice = problem.lattice
            own = sector in (EVEN, None)
            transform = (
                problem.transform if own else lattice.transform(problem.counter, problem.threads, sector or EVEN)
            )
            elastic = np.array(problem.symbol if own else lattice.symbol(sector))
            if own:
                elastic[0, 0] = 1.0 / (lattice.compliance * lattice.area)
            self._transforms[sector] = (transform, elastic)
        return Variation(*self._transforms[sector], equilibrium.fields.stiffness, ~equilibrium.contact)

    def spectrum(
        self,
        equilibrium: Equilibrium,
        sector: Sector | None,
        precision: Precision | None = None,
        count: int = 0,
    ) -> Spectrum:
        """Lowest eigenvalues of one sector, at least `count` of them.

        Raises
        ------
        ValueError
            If the problem's lattice does not have the sector.
        """
        if sector not in self.sectors:
            raise ValueError(f"sector: {sector}; the lattice has {self.sectors}")
        variation = self.variation(equilibrium, sector)
        if not count and bool((variation.softening >= 0.0).all()):
            return _settled(sector)
        start = list(self.previous.get(sector, ()))
        with as_stability(self.problem):
            values, errors, vectors, complete = lowest(
                variation, start, self._seeds(equilibrium, sector), precision or self.precision, count
            )
        vectors /= np.sqrt(self.problem.lattice.node_area)
        vectors = vectors.reshape(-1, *variation.shape)
        self.previous[sector] = vectors
        return Spectrum(sector, values, errors, vectors, complete=complete)

    def _seeds(self, equilibrium: Equilibrium, sector: Sector | None) -> list[Array]:
        """The softening, of one sign in the quarter, with the signs of all sectors; and random numbers.

        Where variations are even or odd about x = y, once more with that sign: on a fine lattice random numbers have
        next to nothing of cos 2θ.
        """
        softening, axis = np.maximum(-equilibrium.fields.stiffness, 0.0), self.problem.lattice.axis
        seeds, distance = [softening], np.abs(axis)
        if sector is None or sector[0] == sector[1]:
            seeds.append(softening * np.sign(distance[:, None] - distance))
        if sector is None:
            sign = np.sign(axis)
            seeds += [softening * sign[:, None], softening * sign, softening * sign[:, None] * sign]
        random = np.random.default_rng(softening.size)
        return [*seeds, softening * random.standard_normal(softening.shape)]

    def spectra(
        self, equilibrium: Equilibrium, sectors: Sequence[Sector], ordered: bool, count: int = 0
    ) -> dict[Sector, Spectrum]:
        """The spectra of some sectors, in the order of their lowest eigenvalues.

        Parameters
        ----------
        equilibrium : Equilibrium
        sectors : sequence
        ordered : bool
            Whether what is stable in one sector is so in those after it. The images in a periodic cell feel a mean
            displacement: there the order is that of the forms at fixed load.
        count : int
            Eigenvalues wanted even of stable sectors.
        """
        found: dict[Sector, Spectrum] = {}
        for sector in sectors:
            if ordered and any(found[other].stable for other in _before(sector) if other in found):
                found[sector] = _settled(sector)
            elif sector == ("even", "odd") and self.swapped and ("odd", "even") in found:
                # The first sector with x and y exchanged.
                other = found["odd", "even"]
                vectors = np.ascontiguousarray(other.vectors.transpose(0, 2, 1))
                found[sector] = replace(other, sector=sector, vectors=vectors)
            else:
                found[sector] = self.spectrum(equilibrium, sector, count=count)
        return found


def _settled(sector: Sector | None) -> Spectrum:
    empty = np.zeros(0)
    return Spectrum(sector, empty, empty, np.zeros((0, 0, 0)))


def _before(sector: Sector) -> list[Sector]:
    """Sectors whose lowest eigenvalue lies below that of another."""
    if sector == EVEN:
        return []
    return [EVEN] if "even" in sector else [EVEN, ("odd", "even"), ("even", "odd")]


@contextmanager
def as_stability(problem: GridProblem) -> Iterator[None]:
    """Count all work as that on stability, equilibria included that are found for its sake."""
    before = problem.counter.target
    problem.counter.target = "stability"
    try:
        yield
    finally:
        problem.counter.target = before
