"""Symmetry events as the diagram has them: observables, and how far the lattice may have moved them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from contbranch.curve.outcome import RawEvent

from .angular import angular_content
from .newton import Equilibrium, Settings, newton
from .reading import read
from .setup import Setup, coarsened
from .stability import Stability, as_stability
from .symmetry import Breaking, distinct, eigenpair, located, precision_for
from .transforms import EVEN
from .walk import Direction, Measure

if TYPE_CHECKING:
    from .rows import Row

__all__ = ["symmetry_events"]

Four = tuple[float, float, float, float]

# With which events on the coarser lattice are located: the difference is an estimate.
ACCURACY = 1e-5


def symmetry_events(
    setup: Setup, rows: Sequence[Row], breakings: Sequence[Breaking], errors: Sequence[Four], settings: Settings
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
    errors : sequence of 4 floats
        Of load, displacement, contact radius and central gap of every row.
    settings : Settings
        With which rows are solved.
    """
    axisymmetric = setup.contact.tip.is_axisymmetric
    stability, coarse = Stability(setup.problem), Stability(_coarse(setup).problem)
    found = []
    with as_stability(setup.problem):
        for event in distinct(breakings) if axisymmetric else breakings:
            reading = read(setup, event.equilibrium)
            shift = _shift(setup, rows, event, stability, coarse, settings)
            own = (
                event.load_error + reading.load_error,
                event.displacement_error + reading.displacement_error,
                0.0,
                reading.gap_error,
            )
            least = [max(pair) for pair in zip(errors[event.row], errors[event.row + 1], strict=True)]
            # Where the other lattice does not have it, all that is known is the distance of the rows.
            far = [abs(a - b) for a, b in zip(*(rows[event.row + k].reading.four for k in (0, 1)), strict=True)]
            if shift is None:
                error = [sum(parts) for parts in zip(own, least, far, strict=True)]
            elif event.jump:
                # Nodes join the contact in another order on every lattice: errors fall slower than the spacing.
                error = [one + two + 4.0 * moved for one, two, moved in zip(own, least, shift, strict=True)]
            else:
                error = [one + moved + 1e-9 for one, moved in zip(own, shift, strict=True)]
            error[2] = error[2] if reading.contact_radius > 0.0 else 0.0
            error[3] = error[3] if reading.central_gap > 0.0 else 0.0
            found.append(
                RawEvent(
                    "symmetry",
                    event.row,
                    reading.four,
                    (error[0], error[1], error[2], error[3]),
                    message=_message(event, axisymmetric),
                    point=event,
                    position=event.position,
                    mode=event.mode,
                    index=_number(stability, event),
                    mode_shape=event.shape,
                )
            )
    return found


def _coarse(setup: Setup) -> Setup:
    return setup.on(setup.grid // 2) if setup.grid % 4 == 0 and setup.grid >= 16 else setup


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
    lower = [
        int(angular_content(lattice, vector, weight, event.kind.sector)[1:].argmax()) + 1
        for vector in spectrum.vectors[: event.number]
    ]
    return 1 + lower.count(event.mode)


def _shift(
    setup: Setup, rows: Sequence[Row], event: Breaking, stability: Stability, coarse: Stability, settings: Settings
) -> Four | None:
    """By how much the event lies elsewhere on the lattice with half the nodes a side; None if it is not known.

    Where it does not lie between the same two rows there, the eigenvalue and the observables are taken as linear on
    both lattices.
    """
    if coarse.problem is setup.problem:
        return None
    fine = [rows[event.row + k].state(setup.problem) for k in (0, 1)]
    if fine[0] is None or fine[1] is None:
        return None
    ends = [_relative(setup, fine[0], fine[1], k, settings) for k in (0, 1)]
    if ends[0] is None or ends[1] is None:
        return None
    other = None if event.jump else located(coarse, ends[0], ends[1], event.kind, event.number, ACCURACY)
    if other is not None:
        values = [read(setup, event.equilibrium).four, read(_coarse(setup), other.equilibrium).four]
    else:
        values = []
        for one, spectra, pair in (
            (setup, stability, (fine[0], fine[1])),
            (_coarse(setup), coarse, (ends[0], ends[1])),
        ):
            low, high = (eigenpair(spectra, state, event.kind, event.number, precision_for(ACCURACY)) for state in pair)
            if low is None or high is None or low[0] == high[0]:
                return None
            share = low[0] / (low[0] - high[0])
            first, second = (read(one, state).four for state in pair)
            a, b, c, d = (x + share * (y - x) for x, y in zip(first, second, strict=True))
            values.append((a, b, c, d))
    load, displacement, radius, gap = (abs(a - b) for a, b in zip(*values, strict=True))
    return load, displacement, radius, gap


def _relative(setup: Setup, begin: Equilibrium, end: Equilibrium, which: int, settings: Settings) -> Equilibrium | None:
    """The coarse lattice's state in the plane through one of two states and across the way between them."""
    coarse = _coarse(setup)
    problem = coarse.problem
    state = (begin, end)[which]
    u = coarsened(state.u, setup.centred)
    contact = coarsened(state.contact.astype(np.float64), setup.centred) >= 0.5
    u = np.where(contact, -problem.heights, u)
    sketch = Equilibrium(problem.fields(u, state.load), contact, 0.0, 0.0, False)
    change = coarsened(end.u - begin.u, setup.centred)
    direction = Direction.along(Measure.at(sketch, setup.length), change, end.load - begin.load)
    slack = 1e-6 * abs(direction.value(change, end.load - begin.load))
    held = direction.hold(direction.value(u, state.load), slack)
    found = newton(problem, u, state.load, held, contact, settings)
    return found if found.converged else None
