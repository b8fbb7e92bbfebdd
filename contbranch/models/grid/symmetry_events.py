"""Symmetry events as the diagram has them: observables, and how far the lattice may have moved them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from contbranch.curve.outcome import RawEvent

from .angular import angular_content
from .arrays import Array
from .newton import Settings
from .rows import difference, read
from .setup import Setup
from .stability import Stability, as_stability
from .symmetry import Breaking, distinct, eigenpair, located, precision_for
from .transforms import EVEN
from .walk import beside

if TYPE_CHECKING:
    from .rows import Row

__all__ = ["symmetry_events"]

# With which events on the coarser lattice are located: the difference is an estimate.
ACCURACY = 1e-5


def symmetry_events(
    setup: Setup, rows: Sequence[Row], breakings: Sequence[Breaking], errors: Array, settings: Settings
) -> list[RawEvent]:
    """Events in the order along the curve; those of an axisymmetric tip that differ by a turn count once.

    Parameters
    ----------
    setup : Setup
        On a quarter of the lattice.
    rows : sequence of Row
        Of the curve.
    breakings : sequence of Breaking
        With their rows.
    errors : array (M, 4)
        Of load, displacement, contact radius and central gap of every row.
    settings : Settings
        With which rows are solved.
    """
    axisymmetric = setup.contact.tip.is_axisymmetric
    stability = Stability(setup.problem)
    coarse = None if setup.coarse is None else Stability(setup.coarse.problem)
    found = []
    with as_stability(setup.problem):
        for event in distinct(breakings) if axisymmetric else breakings:
            reading, near = read(setup, event.equilibrium), slice(event.row, event.row + 2)
            shift = None if coarse is None else _shift(setup, rows[near], event, (stability, coarse), settings)
            error = np.array([event.load_error, event.displacement_error, 0.0, 0.0]) + reading.errors
            least = errors[near].max(axis=0)
            if shift is None:
                # Where the other lattice does not have it, all that is known is the distance of the rows.
                error += least + np.abs(difference(*(row.reading for row in rows[near])))
            else:
                # Nodes join the contact in another order on every lattice: errors fall slower than the spacing.
                error += least + 4.0 * shift if event.jump else shift + 1e-9
            load, displacement, radius, gap = np.where([1, 1, *reading.four[2:]], error, 0.0).tolist()
            found.append(
                RawEvent(
                    "symmetry",
                    event.row,
                    reading.four,
                    (load, displacement, radius, gap),
                    message=_message(event, axisymmetric),
                    point=event,
                    position=event.position,
                    mode=event.mode,
                    index=_number(stability, event),
                    mode_shape=event.shape,
                )
            )
    return found


def _message(event: Breaking, axisymmetric: bool) -> str:
    kind = "lost" if event.lost else "regained"
    if axisymmetric:
        what = f"variations cos({event.mode}θ)"
    else:
        odd = [axis for axis, parity in zip("xy", event.kind.sector, strict=True) if parity == "odd"]
        what = f"variations that are odd in {' and '.join(odd)}"
    jump = " The eigenvalue jumps through zero as the contact changes by a node." if event.jump else ""
    return f"Stability to {what} is {kind} along the curve.{jump}"


def _number(stability: Stability, event: Breaking) -> int:
    """Which eigenvalue of its mode passes zero, from the lowest, 1 for the first."""
    if event.kind.sector == EVEN or not event.number:
        return event.number + 1
    spectrum = stability.spectrum(event.equilibrium, event.kind.sector, count=event.number + 1)
    weight = np.abs(event.equilibrium.fields.stiffness)
    lattice = stability.problem.lattice
    lower = [angular_content(lattice, vector, weight, event.kind.sector) for vector in spectrum.vectors[: event.number]]
    return 1 + [int(content[1:].argmax()) + 1 for content in lower].count(event.mode)


def _shift(
    setup: Setup, rows: Sequence[Row], event: Breaking, spectra: tuple[Stability, Stability], settings: Settings
) -> Array | None:
    """By how much the event lies elsewhere on the lattice with half the nodes a side; None if it is not known.

    Where it does not lie between the same two rows there, the eigenvalue and the observables are taken as linear on
    both lattices.

    Parameters
    ----------
    rows : two Row
        Between which the event lies.
    spectra : two Stability
        Of this lattice and of the coarse one.
    """
    coarse = setup.coarse
    begin, end = (row.state(setup.problem) for row in rows)
    if coarse is None or begin is None or end is None:
        return None
    first, last = (beside(setup, coarse, state, (begin, end), settings) for state in (begin, end))
    if first is None or last is None:
        return None
    other = None if event.jump else located(spectra[1], first, last, event.kind, event.number, ACCURACY)
    if other is not None:
        return np.abs(difference(read(setup, event.equilibrium), read(coarse, other.equilibrium)))
    values: list[Array] = []
    for one, stability, pair in zip((setup, coarse), spectra, ((begin, end), (first, last)), strict=True):
        precision = precision_for(ACCURACY)
        low, high = (eigenpair(stability, state, event.kind, event.number, precision) for state in pair)
        if low is None or high is None or low[0] == high[0]:
            return None
        here, there = (np.array(read(one, state).four) for state in pair)
        values.append(here + low[0] / (low[0] - high[0]) * (there - here))
    return np.abs(values[0] - values[1])
