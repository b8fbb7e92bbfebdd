"""Where along a curve on a lattice an eigenvalue of a variation that breaks a symmetry passes zero.

Between two equilibria whose numbers of unstable modes differ in a class of variations (`Kind`), the eigenvalue is
followed along the curve: at the share s of the way an equilibrium is found that is held at ``row·u = (1 - s) row·u_0 +
s row·u_1``, row being the way from the one to the other where the interaction is felt, and a bracketed secant iteration
finds the zero. Where nodes join or leave the contact the eigenvalue jumps, since a node more or less may vary: then the
bracket closes on the jump, which is what the lattice leaves of the event.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

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
# Evaluations at most, for one event.
LIMIT = 40
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

    def sample(share: float, near: Equilibrium | None = None) -> _Sample | None:
        if near is None:
            u, load = begin.u + share * step, begin.load + share * (end.load - begin.load)
            contact = begin.contact if share < 0.5 else end.contact
            near = newton(problem, u, load, Hold(origin + share, 0.0, row), contact, settings)
            if not near.converged:
                return None
        found = eigenpair(stability, near, kind, number, precision)
        return None if found is None else _Sample(share, near, *found)

    low, high = sample(0.0, begin), sample(1.0, end)
    if low is None or high is None or (low.value < 0.0) == (high.value < 0.0):
        return None
    return _closed(problem, sample, low, high, kind, number, accuracy)


def _closed(
    problem: GridProblem,
    sample: Callable[[float], _Sample | None],
    low: _Sample,
    high: _Sample,
    kind: Kind,
    number: int,
    accuracy: float,
) -> Breaking | None:
    """Close the bracket: Illinois' secant iteration, and halving where it is slow, as it is at a jump."""
    heights = [low.value, high.value]
    start = abs(high.value - low.value)
    ways = _differences(low.equilibrium, high.equilibrium)
    side = 0
    best = min(low, high, key=lambda one: abs(one.value))
    for evaluation in range(LIMIT):
        share = (low.share * heights[1] - high.share * heights[0]) / (heights[1] - heights[0])
        if evaluation % 4 == 3:
            share = 0.5 * (low.share + high.share)
        new = sample(share)
        if new is None:
            return None
        older = best
        if (new.value < 0.0) == (low.value < 0.0):
            low, heights[0] = new, new.value
            heights[1] *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            high, heights[1] = new, new.value
            heights[0] *= 0.5 if side == 1 else 1.0
            side = 1
        best = min(best, new, key=lambda one: abs(one.value))
        # The zero as the line through the bracket has it, and how far the best state is from it.
        change = abs(new.value - older.value)
        off = min(1.0, abs(best.value) / change if change > 0.0 else 1.0)
        width = _differences(low.equilibrium, high.equilibrium)
        moved = _differences(older.equilibrium, new.equilibrium)
        errors = [min(one, off * other) for one, other in zip(width, moved, strict=True)]
        values = (best.equilibrium.load, best.equilibrium.displacement)
        goals = [accuracy * max(1.0, abs(value)) for value in values]
        if all(error <= goal for error, goal in zip(errors, goals, strict=True)):
            rest = abs(high.value - low.value)
            jump = rest > JUMP * start and all(one <= goal for one, goal in zip(width, goals, strict=True))
            if jump:
                # Where the eigenvalue would pass zero if it did not jump is not known better than this.
                errors = [error + way * rest / start for error, way in zip(errors, ways, strict=True)]
            return _breaking(problem, best, kind, number, errors, jump)
    return None


def _differences(one: Equilibrium, other: Equilibrium) -> list[float]:
    """Of load and displacement."""
    return [abs(one.load - other.load), abs(one.displacement - other.displacement)]


def _breaking(
    problem: GridProblem, best: _Sample, kind: Kind, number: int, errors: Sequence[float], jump: bool
) -> Breaking:
    vector = best.vector / best.vector.flat[np.argmax(np.abs(best.vector))]
    weight = np.abs(best.equilibrium.fields.stiffness)
    content = angular_content(problem.lattice, vector, weight, kind.sector)
    mode = int(content[1:].argmax()) + 1
    shape = mode_shape(problem, best.equilibrium, vector, kind.sector, mode)
    return Breaking(
        0, best.share, kind, mode, number, True, best.equilibrium, best.value, vector, errors[0], errors[1], jump, shape
    )


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
