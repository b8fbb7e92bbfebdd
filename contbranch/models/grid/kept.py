"""The symmetry that a branch keeps where it breaks others, and its unstable modes with and without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .arrays import Array, Mask
from .lattice import Lattice
from .setup import Setup
from .stability import ZERO, Sector, Spectrum, Stability
from .switching import mirrored
from .transforms import EVEN

if TYPE_CHECKING:
    from .rows import Row

__all__ = ["Image", "first_index", "has_symmetry", "kept_symmetry", "lacking"]

# The image of a field of the whole lattice.
Image = Callable[[Array], Array]

# Eigenvalue of the turn around the axis at most: zero, but for the lattice.
TURN = 0.02


def kept_symmetry(lattice: Lattice, sector: Sector, swapped: bool) -> Image:
    """The symmetry of the whole lattice that a branch keeps which breaks those of a sector."""
    if sector == EVEN:
        return lambda values: mirrored(lattice, mirrored(lattice, values, ("even", "odd")), ("odd", "even"))
    if sector == ("odd", "odd"):
        if swapped:
            return lambda values: mirrored(lattice, values, EVEN)
        return lambda values: mirrored(lattice, mirrored(lattice, values, ("even", "odd")), ("odd", "even"))
    other: Sector = ("even", "odd") if sector[0] == "odd" else ("odd", "even")
    return lambda values: mirrored(lattice, values, other)


def has_symmetry(spectrum: Spectrum, kept: Image) -> Mask:
    """Which variations are rather even than odd under a symmetry of the whole lattice."""
    return np.array([float(np.vdot(vector, kept(vector))) > 0.0 for vector in spectrum.vectors], dtype=bool)


def first_index(setup: Setup, rows: Sequence[Row], folds: Sequence[int], kept: Image) -> int:
    """Index under displacement control with which a branch begins: by eigenvalues, at a row inside the first piece.

    At its very beginning an eigenvalue is all but zero; and rows without contact are preferred, since eigenvalues jump
    with the nodes of a contact.
    """
    last = min([*folds, len(rows) - 1])
    inside = [row for row in rows[1 : last + 1] if row.u is not None]
    free = [row for row in inside if row.reading.contact_radius == 0.0]
    chosen = free or inside
    state = chosen[len(chosen) // 2].state(setup.problem) if chosen else None
    if state is None:
        return 0
    stability = Stability(setup.problem)
    spectrum = stability.spectrum(state, None)
    return int((has_symmetry(spectrum, kept) & (spectrum.eigenvalues < 0.0)).sum())


def lacking(spectrum: Spectrum, kept: Image, turning: bool) -> int:
    """Number of unstable modes without a symmetry.

    Parameters
    ----------
    spectrum : Spectrum
        Of the whole lattice.
    kept : callable
    turning : bool
        Whether a turn around the axis leads to another state of the branch; its mode is then left out.
    """
    values = spectrum.eigenvalues[~has_symmetry(spectrum, kept)]
    if turning and values.size and float(np.abs(values).min()) < TURN:
        values = np.delete(values, np.abs(values).argmin())
    return int((values < -ZERO).sum())
