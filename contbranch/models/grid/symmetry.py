"""Where along a curve on a lattice an eigenvalue of a variation that breaks a symmetry passes zero.

Between two equilibria whose numbers of unstable modes differ in a class of variations (`Kind`), the eigenvalue is
followed along the curve: at the share s of the way an equilibrium is found that is held at ``row·u = (1 - s) row·u_0 +
s row·u_1``, row being the way from the one to the other where the interaction is felt, and the zero
is bracketed. Where nodes join or leave the contact the eigenvalue jumps, since a node more or less may vary: then the
bracket closes on the jump, which is what the lattice leaves of the event.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from contbranch.continuation.locate import find_root
from contbranch.results.diagram import ModeShape

from .angular import angular_content, mode_shape
from .arrays import Array
from .newton import Equilibrium, Hold, Settings, newton
from .problem import GridProblem
from .stability import Morse, Sector, Spectrum, Stability
from .transforms import EVEN
from .variation import Precision

__all__ = [
    "Breaking",
    "Kind",
    "axisymmetric_counts",
    "counted",
    "distinct",
    "eigenpair",
    "kinds",
    "located",
    "precision_for",
    "symmetry_breaking",
]


# Share of an even variation's square that is periodic around the axis, from which on it is no axisymmetric one.
PERIODIC = 0.5
# Part of the eigenvalue's change between two points that is a jump, if it is left where the bracket is closed.
JUMP = 1e-3
# Eigenvalues that are passed on the way need no more digits than a secant uses.
COARSELY = 1e-2


class Kind(NamedTuple):
    """A class of variations that mix with each other and with no others.

    Attributes
    ----------
    sector : (str, str)
    mode : int
        Number of periods around the axis, for variations with both mirror symmetries; 0 for the other sectors, which
        need no such distinction.
    """

    sector: Sector
    mode: int = 0


@dataclass(frozen=True)
class Breaking:
    """An equilibrium at which an eigenvalue of a variation without a symmetry of the state is zero.

    Attributes
    ----------
    row : int
        The event lies between this point of the curve and the next.
    share : float
        At this share of the way.
    kind : Kind
    mode : int
        Number of periods around the axis that dominates.
    number : int
        Which eigenvalue of its kind, from the lowest.
    lost : bool
        Whether stability is lost along the curve.
    equilibrium : Equilibrium
    eigenvalue : float
        What is left of it.
    vector : array (n, n)
        The variation, on the array of its sector, its largest value 1.
    load_error, displacement_error : float
        How far the event may be from the equilibrium, by the iteration alone: the lattice's own error is not in it,
        but for the size of a jump.
    jump : bool
        Whether the eigenvalue jumps through zero as the contact changes by a node.
    shape : ModeShape
    """

    row: int
    share: float
    kind: Kind
    mode: int
    number: int
    lost: bool
    equilibrium: Equilibrium
    eigenvalue: float
    vector: Array
    load_error: float
    displacement_error: float
    jump: bool
    shape: ModeShape

    @property
    def position(self) -> float:
        """Where on the curve, in rows."""
        return self.row + self.share


def kinds(problem: GridProblem, equilibrium: Equilibrium, spectrum: Spectrum) -> list[Kind | None]:
    """The kind of each eigenvector of a sector; None where it has all symmetries of the state."""
    if spectrum.sector is None:
        return [None] * len(spectrum.eigenvalues)
    if spectrum.sector != EVEN:
        return [Kind(spectrum.sector)] * len(spectrum.eigenvalues)
    weight = np.abs(equilibrium.fields.stiffness)
    found: list[Kind | None] = []
    for vector in spectrum.vectors:
        content = angular_content(problem.lattice, vector, weight, EVEN)
        mode = int(content.argmax())
        found.append(Kind(EVEN, mode) if mode and content[mode] > PERIODIC else None)
    return found


def axisymmetric_counts(problem: GridProblem, equilibrium: Equilibrium, morse: Morse) -> tuple[int, int]:
    """Unstable modes at fixed displacement of a state of an axisymmetric tip, as a model of that symmetry counts them.

    Returns
    -------
    axisymmetric, azimuthal : int
        m = 0, and all m ≥ 1, with cos mθ and sin mθ as one.
    """
    counts = counted(problem, equilibrium, morse)
    even = sum(number for kind, number in counts.items() if kind.sector == EVEN)
    return morse.spectra[EVEN].index - even, even + counts[Kind(("odd", "even"))]


def distinct(events: Sequence[Breaking]) -> list[Breaking]:
    """Events of an axisymmetric tip without those of sin mθ, m even, where there is one of cos mθ close to it.

    The lattice tells the two from each other, since the one is odd under both mirrors and the other is not; they pass
    zero at two places, which differ by the lattice's error.
    """
    kept = []
    for event in events:
        twins = (other for other in events if other.kind == Kind(EVEN, event.mode) and other.lost == event.lost)
        if event.kind.sector != ("odd", "odd") or not any(
            abs(other.position - event.position) < 1.0 for other in twins
        ):
            kept.append(event)
    return kept


def symmetry_breaking(
    problem: GridProblem,
    points: Sequence[Equilibrium],
    indices: Sequence[Morse],
    accuracy: float = 1e-6,
    stability: Stability | None = None,
) -> tuple[list[Breaking], list[tuple[int, Kind]]]:
    """Symmetry events along a curve.

    Parameters
    ----------
    problem : GridProblem
        On a quarter of the lattice.
    points : sequence of Equilibrium
        Of the curve, in order.
    indices : sequence of Morse
        Of the points.
    accuracy : float
        Of load and displacement, relative to max(1, |value|).
    stability : Stability, optional
        To keep its plans.

    Returns
    -------
    events : list of Breaking
        In the order along the curve.
    missed : list of (row, Kind)
        Changes that could not be located.
    """
    stability = stability or Stability(problem)
    counts = [counted(problem, point, index) for point, index in zip(points, indices, strict=True)]
    events, missed = [], []
    for row in range(len(points) - 1):
        for kind in sorted({*counts[row], *counts[row + 1]}):
            before, after = counts[row][kind], counts[row + 1][kind]
            if stability.swapped and kind.sector == ("even", "odd"):
                continue  # the same as (odd, even)
            for number in range(min(before, after), max(before, after)):
                found = located(stability, points[row], points[row + 1], kind, number, accuracy)
                if found is None:
                    missed.append((row, kind))
                else:
                    events.append(replace(found, row=row, lost=after > before))
    events.sort(key=lambda event: event.position)
    return events, missed


class _Sample(NamedTuple):
    share: float
    equilibrium: Equilibrium
    value: float
    vector: Array


def located(
    stability: Stability,
    begin: Equilibrium,
    end: Equilibrium,
    kind: Kind,
    number: int,
    accuracy: float = 1e-6,
) -> Breaking | None:
    """The equilibrium between two of a curve at which an eigenvalue passes zero; None if there is none to be found.

    Parameters
    ----------
    stability : Stability
        Of the problem.
    begin, end : Equilibrium
    kind : Kind
    number : int
        Which eigenvalue of that kind, from the lowest, 0 for the first.
    accuracy : float
        Of load and displacement, relative to max(1, |value|).
    """
    problem = stability.problem
    step = end.u - begin.u
    row = step * (np.abs(begin.fields.stiffness) + np.abs(end.fields.stiffness))
    norm = float(np.vdot(row, step))
    if norm == 0.0:
        return None
    row /= norm
    origin = float(np.vdot(row, begin.u))
    precision = precision_for(accuracy)
    settings = Settings(tolerance=min(1e-8, max(1e-10, 1e-2 * accuracy)))
    samples: list[_Sample] = []

    def sample(share: float, near: Equilibrium | None = None) -> float:
        if near is None:
            u, load = begin.u + share * step, begin.load + share * (end.load - begin.load)
            contact = begin.contact if share < 0.5 else end.contact
            near = newton(problem, u, load, Hold(origin + share, 0.0, row), contact, settings)
        found = eigenpair(stability, near, kind, number, precision) if near.converged else None
        if found is None:
            raise ValueError("there is no such eigenvalue")
        samples.append(_Sample(share, near, *found))
        return found[0]

    ways = _differences(begin, end)
    goals = accuracy * np.maximum(1.0, np.abs([end.load, end.displacement]))
    closed = min(JUMP / 10.0, *(goals / np.maximum(ways, 1e-300)))
    try:
        ends = (0.0, sample(0.0, begin)), (1.0, sample(1.0, end))
        find_root(sample, *ends, closed)
    except ValueError:
        return None
    best = min(samples, key=lambda one: abs(one.value))
    samples.sort(key=lambda one: one.share)
    brackets = [pair for pair in pairwise(samples) if (pair[0].value < 0.0) != (pair[1].value < 0.0)]
    low, high = min(brackets, key=lambda pair: pair[1].share - pair[0].share)
    errors = _differences(low.equilibrium, high.equilibrium)
    rest = abs((high.value - low.value) / (ends[1][1] - ends[0][1]))
    if rest > JUMP:
        # Where the eigenvalue would pass zero if it did not jump is not known better than this.
        errors += ways * rest
    vector = best.vector / best.vector.flat[np.argmax(np.abs(best.vector))]
    weight = np.abs(best.equilibrium.fields.stiffness)
    mode = int(angular_content(problem.lattice, vector, weight, kind.sector)[1:].argmax()) + 1
    shape = mode_shape(problem, best.equilibrium, vector, kind.sector, mode)
    load_error, displacement_error = errors.tolist()
    return Breaking(
        0,
        best.share,
        kind,
        mode,
        number,
        True,
        best.equilibrium,
        best.value,
        vector,
        load_error,
        displacement_error,
        rest > JUMP,
        shape,
    )


def _differences(one: Equilibrium, other: Equilibrium) -> Array:
    """Of load and displacement."""
    return np.abs(np.subtract([one.load, one.displacement], [other.load, other.displacement]))


def precision_for(accuracy: float) -> Precision:
    """Precision with which a zero is known to an accuracy: eigenvalues have the square of the vectors' errors."""
    return Precision(tolerance=min(1e-3, max(1e-5, 0.1 * accuracy**0.5)), share=COARSELY)


def eigenpair(
    stability: Stability, equilibrium: Equilibrium, kind: Kind, number: int, precision: Precision
) -> tuple[float, Array] | None:
    """The eigenvalue of that number, 0 for the lowest, among those of its kind, and its vector."""
    count = number + 1
    while count <= precision.basis // 2:
        spectrum = stability.spectrum(equilibrium, kind.sector, precision, count)
        own = [j for j, other in enumerate(kinds(stability.problem, equilibrium, spectrum)) if other == kind]
        if len(own) > number:
            j = own[number]
            return float(spectrum.eigenvalues[j]), spectrum.vectors[j]
        if kind.sector != EVEN:
            return None
        count = len(spectrum.eigenvalues) + 1
    return None


def counted(problem: GridProblem, equilibrium: Equilibrium, morse: Morse) -> Counter[Kind]:
    """Unstable modes of each kind."""
    counts: Counter[Kind] = Counter()
    for spectrum in morse.spectra.values():
        if spectrum.index:
            found = kinds(problem, equilibrium, spectrum)
            counts.update(kind for kind in found[: spectrum.index] if kind is not None)
    return counts
