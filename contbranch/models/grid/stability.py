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

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from .arrays import Array
from .linear import Border, Linear
from .newton import ALONE, Equilibrium, hold_control
from .problem import GridProblem
from .transforms import EVEN, Parity, Transform
from .variation import Precision, Variation, lowest

__all__ = ["SECTORS", "Morse", "Sector", "Spectrum", "Stability", "as_stability", "morse"]

Sector = tuple[Parity, Parity]

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
        λ in increasing order (module), and error bounds. Empty where `settled`.
    vectors : array (k, n, n)
        Variations x, on the array of the sector, with x·K_d x = 1/h² (the energy's norm).
    settled : bool
        Whether the sector is stable because one before it in the order is, or because nothing softens.
    complete : bool
        Whether all pairs reached the precision asked for.
    exchange : array (k,)
        In the sectors that it leaves alone, what an exchange of x and y does to a vector: 1 or -1, or in between where
        it is no symmetry of the state. Empty in the others.
    """

    sector: Sector | None
    eigenvalues: Array
    errors: Array
    vectors: Array
    settled: bool = False
    complete: bool = True
    exchange: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def index(self) -> int:
        """Number of negative eigenvalues."""
        return int((self.eigenvalues < 0.0).sum())

    @property
    def lowest(self) -> float:
        """Lowest eigenvalue; 1, where they gather, if none was needed."""
        return self.eigenvalues[0] if self.eigenvalues.size else 1.0

    @property
    def uncertain(self) -> bool:
        """Whether the sign of an eigenvalue is within its error, or precision was not reached."""
        return not self.complete or bool((np.abs(self.eigenvalues) <= self.errors + ZERO).any())


@dataclass(frozen=True)
class Morse:
    """Numbers of unstable modes of one equilibrium.

    Attributes
    ----------
    spectra : mapping
        `Spectrum` of each sector.
    slope : float
        dF/dd along the curve.
    pairs : int
        Pairs of transforms spent.
    swapped : bool
        Whether the state is the same with x and y exchanged.
    """

    spectra: Mapping[Sector | None, Spectrum]
    slope: float
    pairs: int = 0
    swapped: bool = False

    @property
    def displacement(self) -> int:
        """Index at fixed displacement, all sectors."""
        return sum(spectrum.index for spectrum in self.spectra.values())

    @property
    def load(self) -> int:
        """Index at fixed load, all sectors."""
        return self.spring(0.0)

    def spring(self, stiffness: float) -> int:
        """Index under the control of a spring of that stiffness: 0 is a load."""
        return self.displacement + int(self.slope + stiffness < 0.0)

    @property
    def breaking(self) -> int:
        """Unstable modes that lack a symmetry of the state: one of the mirrors, or the exchange of x and y."""
        odd = sum(found.index for sector, found in self.spectra.items() if sector not in (EVEN, None))
        even = self.spectra.get(EVEN)
        if even is None or not self.swapped:
            return odd
        return odd + int(((even.eigenvalues < 0.0) & (even.exchange < 0.0)).sum())

    @property
    def symmetric(self) -> int:
        """Index at fixed displacement of variations with the symmetry of the state."""
        return self.displacement - self.breaking

    @property
    def uncertain(self) -> bool:
        """Whether a sign is within its error."""
        return any(spectrum.uncertain for spectrum in self.spectra.values())


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
        exchange = np.zeros(0)
        if sector is None or sector[0] == sector[1]:
            exchange = np.einsum("kij,kji->k", vectors, vectors) / np.einsum("kij,kij->k", vectors, vectors)
        return Spectrum(sector, values, errors, vectors, complete=complete, exchange=exchange)

    def _seeds(self, equilibrium: Equilibrium, sector: Sector | None) -> list[Array]:
        """The softening, of one sign in the quarter, with the signs of all sectors; and random numbers."""
        softening = np.maximum(-equilibrium.fields.stiffness, 0.0)
        seeds = [softening]
        if sector is None:
            sign = np.sign(self.problem.lattice.axis)
            seeds += [softening * sign[:, None], softening * sign, softening * sign[:, None] * sign]
        random = np.random.default_rng(softening.size)
        return [*seeds, softening * random.standard_normal(softening.shape)]

    def slope(self, equilibrium: Equilibrium, tolerance: float = 1e-8) -> float:
        """dF/dd along the curve, from one linear solve; infinite at a fold of the displacement."""
        hold = hold_control(self.problem, 0.0, 1.0, 0.0)
        border = Border(self.problem, hold.row, hold.load_weight)
        with as_stability(self.problem):
            linear = Linear(self.problem, equilibrium.fields.stiffness, equilibrium.contact, border, ALONE)
            return linear.solve(np.zeros(self.problem.shape), 1.0, tolerance).load

    def morse(
        self,
        equilibrium: Equilibrium,
        slope: float | None = None,
        all_sectors: bool = False,
        sectors: Sequence[Sector | None] | None = None,
    ) -> Morse:
        """Index of a state.

        Parameters
        ----------
        equilibrium : Equilibrium
        slope : float, optional
            dF/dd; default: from one linear solve.
        all_sectors : bool
            Whether eigenvalues are found even in sectors that are known to be stable.
        sectors : sequence, optional
            Only these, in the order of `sectors`; the index is then that of their variations alone.
        """
        before = self.problem.counter.stability
        slope = self.slope(equilibrium) if slope is None else slope
        # The images in a periodic cell feel a mean displacement: there the order is that of the forms at fixed load.
        ordered = self.problem.lattice.kind == "free" or slope >= 0.0
        spectra: dict[Sector | None, Spectrum] = {}
        for sector in sectors or self.sectors:
            lower = [spectra[other] for other in _before(sector) if other in spectra]
            if not all_sectors and ordered and any(_stable(spectrum) for spectrum in lower):
                spectra[sector] = _settled(sector)
            elif sector == ("even", "odd") and self.swapped and ("odd", "even") in spectra:
                # The first sector with x and y exchanged.
                found = spectra["odd", "even"]
                vectors = np.ascontiguousarray(found.vectors.transpose(0, 2, 1))
                spectra[sector] = replace(found, sector=sector, vectors=vectors)
            else:
                spectra[sector] = self.spectrum(equilibrium, sector, count=1 if all_sectors else 0)
        return Morse(spectra, slope, self.problem.counter.stability - before, self.swapped)


def morse(problem: GridProblem, equilibrium: Equilibrium, slope: float | None = None) -> Morse:
    """Numbers of unstable modes of an equilibrium, see `Stability.morse`."""
    return Stability(problem).morse(equilibrium, slope)


def _settled(sector: Sector | None) -> Spectrum:
    empty = np.zeros(0)
    return Spectrum(sector, empty, empty, np.zeros((0, 0, 0)), settled=True)


def _stable(spectrum: Spectrum) -> bool:
    """Whether a sector is stable for certain."""
    return spectrum.index == 0 and not spectrum.uncertain


def _before(sector: Sector | None) -> list[Sector]:
    """Sectors whose lowest eigenvalue lies below that of another."""
    if sector is None or sector == EVEN:
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
