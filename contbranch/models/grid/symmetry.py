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
from numpy.typing import NDArray

from contbranch.diagram import ModeShape

from .lattice import Lattice
from .newton import Equilibrium, Hold, Settings, newton
from .problem import GridProblem
from .stability import Morse, Sector, Spectrum, Stability
from .transforms import EVEN
from .variation import Precision

__all__ = [
    "Breaking",
    "Kind",
    "angular_content",
    "axisymmetric_counts",
    "distinct",
    "kinds",
    "located",
    "mode_shape",
    "symmetry_breaking",
]

Array = NDArray[np.float64]

# Largest number of periods around the axis that is told from others.
LARGEST = 32
# Share of an even variation's square that is periodic around the axis, from which on it is no axisymmetric one.
PERIODIC = 0.5
# Evaluations at most, for one event.
LIMIT = 40
# Part of the eigenvalue's change between two points that is a jump, if it is left where the bracket is closed.
JUMP = 1e-3
FINE = Precision(tolerance=1e-5, share=1e-5)
EXACT = Settings(tolerance=1e-10)


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


def angular_content(lattice: Lattice, values: Array, weight: Array, sector: Sector) -> Array:
    """Shares of cos mθ (sin mθ, if it is odd in y) in the square of a variation of a quarter, m = 0 … 32.

    Rings of the width of two nodes are projected one by one; a mode with more periods than half the nodes of a ring is
    left out there.

    Parameters
    ----------
    values, weight : array (n, n)
        The variation, and how much of it counts where.
    """
    counted = np.broadcast_to(weight, values.shape) > 0.0
    if not counted.any():
        return np.zeros(LARGEST + 1)
    r, theta = (coordinate[counted] for coordinate in _polar(lattice, values.shape))
    ring = (r / (2.0 * lattice.spacing)).astype(int)
    w, x = np.broadcast_to(weight, values.shape)[counted], values[counted]
    rings = int(ring.max()) + 1
    total = np.bincount(ring, w, rings)
    content = np.zeros(LARGEST + 1)
    for m in _numbers(sector):
        wave = _wave(sector, m, theta)
        norm = np.bincount(ring, w * wave**2, rings)
        product = np.bincount(ring, w * wave * x, rings)
        # On a ring around the axis mθ must be resolved, and cos² have its mean.
        seen = (total > 0.0) & (norm > 0.2 * total)
        content[m] = float((product[seen] ** 2 / norm[seen]).sum())
    return content / float((w * x * x).sum())


def mode_shape(problem: GridProblem, equilibrium: Equilibrium, vector: Array, sector: Sector, mode: int) -> ModeShape:
    """Gap and pressure of a variation against the radius, from its projections on rings of the width of one node."""
    lattice = problem.lattice
    r, theta = _polar(lattice, vector.shape)
    cell = np.zeros(vector.shape, dtype=bool)
    cell[: lattice.inside, : lattice.inside] = True
    cell &= r < 0.5 * lattice.edge
    ring = (r[cell] / lattice.spacing).astype(int)
    wave = _wave(sector, mode, theta[cell])
    norm = np.bincount(ring, wave**2)
    pressure = Stability(problem).variation(equilibrium, sector).pressure(vector)
    seen = norm > 0.0
    radius = np.bincount(ring, wave**2 * r[cell])[seen] / norm[seen]
    gap = np.bincount(ring, wave * vector[cell])[seen] / norm[seen]
    answer = np.bincount(ring, wave * pressure[cell])[seen] / norm[seen]
    scale = 1.0 / gap[np.argmax(np.abs(gap))]
    return ModeShape(mode, radius, scale * gap, scale * answer)


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
    counts = _counts(problem, equilibrium, morse)
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
    counts = [_counts(problem, point, index) for point, index in zip(points, indices, strict=True)]
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

    def sample(share: float, near: Equilibrium | None = None) -> _Sample | None:
        if near is None:
            u, load = begin.u + share * step, begin.load + share * (end.load - begin.load)
            contact = begin.contact if share < 0.5 else end.contact
            near = newton(problem, u, load, Hold(origin + share, 0.0, row), contact, EXACT)
            if not near.converged:
                return None
        found = _eigenpair(stability, near, kind, number)
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


def _eigenpair(stability: Stability, equilibrium: Equilibrium, kind: Kind, number: int) -> tuple[float, Array] | None:
    """The eigenvalue of that number among those of its kind."""
    count = number + 1
    while count <= FINE.basis // 2:
        spectrum = stability.spectrum(equilibrium, kind.sector, FINE, count)
        own = [j for j, other in enumerate(kinds(stability.problem, equilibrium, spectrum)) if other == kind]
        if len(own) > number:
            j = own[number]
            return float(spectrum.eigenvalues[j]), spectrum.vectors[j]
        if kind.sector != EVEN:
            return None
        count = len(spectrum.eigenvalues) + 1
    return None


def _counts(problem: GridProblem, equilibrium: Equilibrium, morse: Morse) -> Counter[Kind]:
    """Unstable modes of each kind."""
    counts: Counter[Kind] = Counter()
    for spectrum in morse.spectra.values():
        if spectrum.index:
            found = kinds(problem, equilibrium, spectrum)
            counts.update(kind for kind in found[: spectrum.index] if kind is not None)
    return counts


def _numbers(sector: Sector) -> range:
    """m of the waves that a sector contains."""
    if sector == EVEN:
        return range(0, LARGEST + 1, 2)
    return range(2, LARGEST + 1, 2) if sector == ("odd", "odd") else range(1, LARGEST + 1, 2)


def _wave(sector: Sector, m: int, theta: Array) -> Array:
    """cos mθ where the sector is even in y, else sin mθ."""
    return np.cos(m * theta) if sector[1] == "even" else np.sin(m * theta)


def _polar(lattice: Lattice, shape: tuple[int, ...]) -> tuple[Array, Array]:
    x = lattice.axis[: shape[0]]
    return np.hypot(x[:, None], x), np.arctan2(x[None, :], x[:, None])
