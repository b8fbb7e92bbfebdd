"""Indices counted from folds, checked by eigenvalues; and the modes along a curve that break a symmetry.

Folds are counted to know how many modes with the symmetry of the tip are unstable (`rows.morse_indices`).
A fold that was passed over, or one that is none, spoils the count from there on. So eigenvalues are found at the first
row, at the last, and at one row well inside every piece between two folds. Pieces without a row of their own follow
from those on both sides of them, and so do those along which the rim of the contact moves by less than two rows of
nodes: eigenvalues jump with every node that joins the contact, and what lies between is the lattice's own.

What breaks the symmetry passes through no fold. It can be unstable only where the displacement is not enough to hold a
state with the symmetry (see `stability`), so that only rows with an index under displacement control are examined,
every few of them and, where the numbers differ, all in between. Blunt axisymmetric tips cannot become unstable at all
(see `contbranch.models.axisymmetric.azimuthal`): there the rows that are checked anyway confirm it. Where the
interaction stiffens everywhere the energy is convex, and nothing is to be examined.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from contbranch.contact.height_map import HeightMap
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.angle import Hodograph

from .arrays import Integers, Mask
from .newton import Equilibrium
from .resolution import concavity
from .setup import Setup
from .stability import ZERO, Morse, Sector, Spectrum, Stability, as_stability
from .switching import Image, has_symmetry, lacking
from .symmetry import Breaking, Kind, counted, kinds, symmetry_breaking
from .transforms import EVEN

if TYPE_CHECKING:
    from .rows import Row

__all__ = ["Verification", "pieces", "verify_curve"]


# Rows from one that is examined for broken symmetry to the next.
STRIDE = 4
# Pairs of transforms for all this at most, relative to those of the curve: on a lattice that is too coarse eigenvalues
# can pass zero with every node that joins the contact.
SHARE = 1.0
# In contact no event is better known on a lattice than this, relative to max(1, |value|).
IN_CONTACT = 1e-4
# What a mode that lacks the symmetry of a branch is counted as.
WITHOUT = Kind(("odd", "odd"))
# Rows of nodes by which the rim moves at least along a piece that is checked.
RIM = 2.0
# Slopes smaller than this part of 1/C have no sign: they are those of the far field.
FLAT = 1e-6
# Rows of a piece that are examined until one confirms the count.
TRIES = 3
# Sectors that show all modes of an axisymmetric tip: (odd, odd) has sin mθ, m even, and (even, odd) sin mθ, m odd.
ROUND: tuple[Sector, ...] = (EVEN, ("odd", "even"))


@dataclass(frozen=True)
class Verification:
    """What eigenvalues say of a curve.

    Attributes
    ----------
    azimuthal : integer array (M,) or None
        Number of unstable modes that break a symmetry at every row; None where it was not examined.
    breakings : tuple of Breaking
        Symmetry events, with their rows.
    notes : tuple of str
        Sentences on what disagrees or is missing.
    contradicted : bool
        Whether a counted index is not that of the eigenvalues.
    """

    azimuthal: Integers | None = None
    breakings: tuple[Breaking, ...] = ()
    notes: tuple[str, ...] = ()
    contradicted: bool = False


def pieces(count: int, folds: Sequence[int]) -> list[tuple[int, int]]:
    """First and last row of the pieces between folds, ends of the curve included."""
    edges = sorted({0, count - 1, *folds})
    return list(pairwise(edges))


def verify_curve(
    setup: Setup,
    rows: Sequence[Row],
    indices: Hodograph,
    folds: Sequence[int],
    accuracy: float,
    modes: int = 1,
    kept: Image | None = None,
    unresolved: Sequence[Sequence[int]] = (),
) -> Verification:
    """Check the counted indices of a curve and find what breaks its symmetry.

    Parameters
    ----------
    setup : Setup
    rows : sequence of Row
        In the order along the curve.
    indices : Indices
        Counted.
    folds : sequence of int
        Rows that are folds of load or displacement.
    accuracy : float
        Of symmetry events, relative to max(1, |value|).
    modes : int
        0: modes that break a symmetry are not examined.
    kept : callable, optional
        On the whole lattice, the symmetry that all states have: the image of a field.
    unresolved : sequence of sequence of int
        For every control, rows that are folds of the lattice's own and were not counted: between the two of a pair
        eigenvalues are not to be compared.
    """
    if len(rows) < 2:
        return Verification()
    examined = bool(modes) and (setup.quarter or kept is not None)
    if concavity(setup.problem.law) == 0.0:
        return Verification(np.zeros(len(rows), dtype=np.int64) if examined else None)
    survey = _Survey(setup, rows, indices, examined, kept, _inside(unresolved))
    with as_stability(setup.problem):
        survey.check(folds)
        if not examined:
            return Verification(None, (), tuple(survey.notes), survey.contradicted)
        column = survey.broken(folds)
        breakings = survey.events(accuracy) if kept is None else []
    return Verification(column, tuple(breakings), tuple(survey.notes), survey.contradicted)


class _Found(NamedTuple):
    """Fewest and most unstable modes at a row, and dF/dd."""

    row: int
    least: int
    most: int
    slope: float


@dataclass
class _Survey:
    """Eigenvalues at some rows of a curve."""

    setup: Setup
    rows: Sequence[Row]
    indices: Hodograph
    breaking: bool
    kept: Image | None = None
    between: frozenset[int] = frozenset()
    notes: list[str] = field(default_factory=list)
    found: dict[int, Morse] = field(default_factory=dict)
    kinds: dict[int, Counter[Kind]] = field(default_factory=dict)
    contradicted: bool = False

    def __post_init__(self) -> None:
        self.stability = Stability(self.setup.problem)
        self.index = self.indices.rows(DISPLACEMENT)
        self.softening = self.indices.rows(LOAD) > self.index
        self.before = self.setup.problem.counter.stability
        self.axisymmetric = self.setup.contact.tip.is_axisymmetric and not isinstance(self.setup.contact.tip, HeightMap)

    def state(self, row: int) -> Equilibrium | None:
        """The equilibrium of a row, if its fields were kept; that of an average lies beside it, with ripples."""
        return None if self.rows[row].averaged else self.rows[row].state(self.setup.problem)

    @property
    def spent(self) -> bool:
        """Whether enough work has been done."""
        counter = self.setup.problem.counter
        return counter.stability - self.before > SHARE * counter.equilibrium

    def morse(self, row: int, slope: float | None = None) -> Morse | None:
        """Unstable modes at a row; the sign of its slope is that of the counted indices, if none is given."""
        if row in self.found:
            return self.found[row]
        state = self.state(row)
        if state is None:
            return None
        if slope is None:
            slope = -1.0 if self.softening[row] else 1.0
        if self.breaking:
            sectors = ROUND if self.axisymmetric and self.setup.quarter else None
            found = self.stability.morse(state, slope, sectors=sectors)
        else:
            sector = self.stability.sectors[0]
            found = Morse({sector: self.stability.spectrum(state, sector)}, slope, swapped=self.stability.swapped)
        self.found[row] = found
        return found

    # Modes with the symmetry of the tip

    def check(self, folds: Sequence[int]) -> None:
        """Compare counted indices and eigenvalues."""
        wrong: list[_Found] = []
        corners: list[_Found] = []
        unknown = 0
        for places in self._places(folds):
            tried: list[_Found] = []
            for row in places[:TRIES]:
                found = self._examined(row)
                tried += [] if found is None else [found]
                if not tried or self._agrees(tried[-1]):
                    break
            if not tried:
                unknown += 1
            elif not self._agrees(tried[-1]):
                # Between two corners of the lattice the slope can have another sign than across them.
                (corners if any(map(self._at_a_corner, tried)) else wrong).append(tried[0])
            elif len(tried) > 1:
                corners.append(tried[0])
        if wrong:
            self.contradicted = True
            self.notes.append(f"{self._disagreement(wrong)}: a fold was missed, or is none; try a finer grid.")
        if corners:
            self.notes.append(f"{self._disagreement(corners)}: folds of the lattice's own, at single nodes.")
        if unknown:
            self.notes.append(f"The indices of {unknown} pieces of the curve were not checked: memory was short.")

    def _places(self, folds: Sequence[int]) -> list[list[int]]:
        """The rows of every piece in the order in which they are to be examined, and the ends of the curve."""
        arcs = np.array([row.arc for row in self.rows])
        places = [[0]]
        for first, last in pieces(len(self.rows), folds):
            inner = np.array([row for row in range(first + 1, last) if self._comparable(row)], dtype=np.int64)
            if self._tiny(first, last):
                continue
            goals = arcs[first] + np.array([0.5, 0.3, 0.7]) * (arcs[last] - arcs[first])
            chosen = [int(inner[np.argmin(np.abs(arcs[inner] - goal))]) for goal in goals] if inner.size else []
            places += [list(dict.fromkeys(chosen))] if chosen else []
        return [*places, [len(self.rows) - 1]]

    def _comparable(self, row: int) -> bool:
        return row not in self.between and not self.rows[row].averaged

    def _tiny(self, first: int, last: int) -> bool:
        """Whether the rim of a contact hardly moves from one fold to the next."""
        radii = [self.rows[row].reading.contact_radius for row in range(first, last + 1)]
        spacing = self.setup.lattice.spacing
        return min(radii) > 0.0 and max(radii) - min(radii) < RIM * spacing and not self.setup.crowded

    def _examined(self, row: int) -> _Found | None:
        state = self.state(row)
        if state is None:
            return None
        slope = self.stability.slope(state)
        morse = self.morse(row, slope)
        assert morse is not None
        return _Found(row, *self.symmetric(state, morse), slope)

    def _index_agrees(self, found: _Found) -> bool:
        return bool(found.least <= self.index[found.row] <= found.most)

    def _at_a_corner(self, found: _Found) -> bool:
        """Whether nothing but the slope of the smooth piece disagrees, with contact, and not that of the rows."""
        row = found.row
        before, after = self.rows[max(row - 1, 0)].reading, self.rows[min(row + 1, len(self.rows) - 1)].reading
        rising = (after.load - before.load) * (after.displacement - before.displacement) > 0.0
        touching = self.rows[row].reading.contact_radius > 0.0
        return bool(self._index_agrees(found) and touching and rising != self.softening[row])

    def _agrees(self, found: _Found) -> bool:
        flat = abs(found.slope) * self.setup.lattice.compliance < FLAT
        return self._index_agrees(found) and (flat or self.softening[found.row] == (found.slope < 0.0))

    def symmetric(self, state: Equilibrium, morse: Morse) -> tuple[int, int]:
        """Fewest and most unstable modes with the symmetry of the tip that the eigenvalues allow."""
        spectrum = morse.spectra[self.stability.sectors[0]]
        own = self._own(state, spectrum)
        error = spectrum.errors + ZERO
        least = int((own & (spectrum.eigenvalues < -error)).sum())
        most = int((own & (spectrum.eigenvalues < error)).sum())
        # On the whole lattice modes with and without the symmetry of a tip are not told from each other.
        mixed = not self.setup.quarter and self.kept is None and self.setup.contact.tip.mirror_symmetric
        return (0 if mixed else least), (most if spectrum.complete else most + 1)

    def _own(self, state: Equilibrium, spectrum: Spectrum) -> Mask:
        if self.kept is not None:
            return has_symmetry(spectrum, self.kept)
        if spectrum.sector is None or not self.axisymmetric or not spectrum.index:
            return np.ones(len(spectrum.eigenvalues), dtype=bool)
        return np.array([kind is None for kind in kinds(self.setup.problem, state, spectrum)], dtype=bool)

    def _disagreement(self, wrong: Sequence[_Found]) -> str:
        row, least, most, slope = wrong[0]
        units, reading = self.setup.units, self.rows[row].reading
        load, displacement = reading.load * units.load, reading.displacement * units.normal
        slope *= units.load / units.normal
        number = f"{least}" if least == most else f"{least} to {most}"
        others = "" if len(wrong) == 1 else f" (and in {len(wrong) - 1} other pieces of the curve)"
        return (
            f"At load {load:.6g}, displacement {displacement:.6g}{others} eigenvalues find {number} "
            f"unstable modes under displacement control and a slope dF/dd of {slope:.3g}, while the folds say "
            f"{self.index[row]} and a {'negative' if self.softening[row] else 'positive'} slope"
        )

    # Modes that break the symmetry

    def broken(self, folds: Sequence[int]) -> Integers:
        """Number of unstable modes without the symmetry of the tip at every row."""
        column = np.zeros(len(self.rows), dtype=np.int64)
        suspected = self.index > (0 if self.kept is None else -1)
        unstable = [row for row in self.found if self.counts(row)]
        for first, last in pieces(len(self.rows), folds):
            if any(first <= row <= last for row in unstable):
                suspected[first : last + 1] = True
        if self.kept is None and self._blunt() and not unstable:
            return column
        unknown = 0
        for first, last in _runs(suspected):
            places = {*range(first, last + 1, STRIDE), last, *(row for row in self.found if first <= row <= last)}
            known = [row for row in sorted(places) if self.morse(row) is not None]
            unknown += not known
            for one, other in pairwise(known):
                self._between(one, other)
        all_known = np.array(sorted(self.found))
        for row in np.flatnonzero(suspected):
            # Rows that were not examined lie between two that agree.
            column[row] = self.counts(int(all_known[np.argmin(np.abs(all_known - row))])).total()
        if unknown:
            self.notes.append("What breaks the symmetry was not examined where the curve is an average.")
        return column

    def _between(self, one: int, other: int) -> None:
        """Examine rows between two that differ, until neighbours are known."""
        if other - one < 2 or self.counts(one) == self.counts(other) or self.spent:
            return
        middle = (one + other) // 2
        if self.morse(middle) is not None:
            self._between(one, middle)
            self._between(middle, other)

    def counts(self, row: int) -> Counter[Kind]:
        """Unstable modes of every kind that breaks the symmetry of the tip; none where it was not examined."""
        if row in self.found and row not in self.kinds:
            morse = self.found[row]
            state = self.state(row) if morse.displacement and self.kept is None else None
            if self.kept is not None:
                number = lacking(morse.spectra[None], self.kept, self.axisymmetric)
                self.kinds[row] = Counter({WITHOUT: number}) if number else Counter()
            else:
                self.kinds[row] = Counter() if state is None else counted(self.setup.problem, state, self._odd(row))
        return self.kinds.get(row, Counter())

    def _odd(self, row: int) -> Morse:
        """Without the sector whose modes have all symmetries of a tip that is not axisymmetric."""
        morse = self.found.get(row, Morse({}, 1.0))
        own = {sector: one for sector, one in morse.spectra.items() if sector != EVEN or self.axisymmetric}
        return replace(morse, spectra=own)

    def _blunt(self) -> bool:
        """Whether the shape of an axisymmetric tip forbids that it breaks the symmetry: ζ'(t)/t does not increase."""
        tip = self.setup.contact.tip.axisymmetric
        if tip is None or self.setup.kind != "free":
            return False
        t = np.linspace(0.0, 1.0, 201)[1:] * min(self.setup.edge, tip.extent)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            ratio = tip.transform_derivative(t) / t
        return bool((np.diff(ratio) <= 1e-12 * np.abs(ratio[1:])).all())

    def events(self, accuracy: float) -> list[Breaking]:
        """Symmetry events between neighbouring rows whose numbers differ."""
        events: list[Breaking] = []
        missed = 0
        for pair in pairwise(range(len(self.rows))):
            unknown = [row for row in pair if row not in self.found]
            # Rows that were not examined are stable or like their neighbours.
            like = len(unknown) == 2 or any(self.index[row] > 0 for row in unknown)
            if like or self.counts(pair[0]) == self.counts(pair[1]):
                continue
            begin, end = map(self.state, pair)
            if begin is None or end is None:
                continue
            if self.spent:
                missed += 1
                continue
            wanted = max(accuracy, IN_CONTACT) if begin.contact.any() or end.contact.any() else accuracy
            indices = [self._odd(row) for row in pair]
            found, lost = symmetry_breaking(self.setup.problem, [begin, end], indices, wanted, self.stability)
            events += [replace(event, row=pair[0]) for event in found]
            missed += len(lost)
        if missed:
            self.notes.append(f"{missed} symmetry events could not be located.")
        return events


def _inside(unresolved: Sequence[Sequence[int]]) -> frozenset[int]:
    """Rows between the two folds of every pair, these included."""
    rows: set[int] = set()
    for own in unresolved:
        for first, last in zip(own[::2], own[1::2], strict=False):
            rows.update(range(first, last + 1))
    return frozenset(rows)


def _runs(flags: Mask) -> list[tuple[int, int]]:
    """First and last index of every run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int64), [0]])))
    return [(int(first), int(last) - 1) for first, last in zip(edges[::2], edges[1::2], strict=True)]
