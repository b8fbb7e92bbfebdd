"""What folds on a lattice are worth, and where its rows are looked at more closely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contbranch.continuation import Point
from contbranch.control import Control
from contbranch.curve.outcome import RawEvent
from contbranch.curve.problem import EquilibriumProblem
from contbranch.results.record import OBSERVABLES

__all__ = ["OnNodes"]

# What a fold may be off where a contact begins on a lattice, in units of what changes from the row before.
BEGINNING = 1.1
# Errors are found at every so many rows, and indices at these shares of parts of the curve with more than a few rows.
STRIDE, SHARES, FEW = 6, (0.5, 0.3, 0.7), 6


class OnNodes(EquilibriumProblem):
    """Equilibria on nodes that are the user's: errors are stated, not brought below the accuracy asked."""

    refinable = False
    row_safety = 1.0  # the defect is the difference to half the nodes a side, whose error is the larger one by far

    def verdict(self, point: Point, control: Control, error: Sequence[float]) -> tuple[str | None, str]:
        """What a fold is worth on other lattices, and a sentence; None where nothing is to be said."""
        raise NotImplementedError

    def shared(self, point: Point) -> tuple[float, float]:
        """Errors of load and displacement that states near each other have in common."""
        raise NotImplementedError

    def error_rows(self, count: int) -> Sequence[int]:
        """Every few rows, since each costs a state on other nodes."""
        return sorted({*range(0, count, STRIDE), count - 1})

    def counted_rows(self, folds: Sequence[int], last: int) -> list[list[int]]:
        """The last row, and in every part between two folds some, of which one is to agree."""
        parts = [[last]]
        for first, behind in pairwise(sorted({0, *folds, last})):
            inner = [first + round(share * (behind - first)) for share in SHARES]
            parts += [[row for row in dict.fromkeys(inner) if first < row < behind]] if behind - first > FEW else []
        return parts

    def judged(
        self, events: Sequence[RawEvent], points: Sequence[Point], controls: Sequence[Control]
    ) -> list[RawEvent]:
        """Events with verdicts; folds that differ by less than errors, or cannot both be, are unresolved."""
        found = [_on_lattice(event, points, controls) if event.kind == "fold" else event for event in events]
        for control in controls:
            _unresolved(found, control)
        return found


def _on_lattice(event: RawEvent, points: Sequence[Point], controls: Sequence[Control]) -> RawEvent:
    """A fold with its verdict; where a contact begins with some nodes it may be anywhere between these and none."""
    error = event.error
    before = points[max(event.row - 1, 0)].observables
    if before["contact_radius"] == 0.0 < event.numbers[2]:
        moved = [BEGINNING * abs(here - before[name]) for here, name in zip(event.numbers, OBSERVABLES, strict=True)]
        load, displacement, radius, gap = map(max, error, moved)
        error = load, displacement, radius, gap
    (control,) = (one for one in controls if one.kind == event.control)
    verdict, message = _on_nodes(event.point).verdict(event.point, control, error)
    return replace(event, error=error, verdict=verdict, message=message)


def _unresolved(events: list[RawEvent], control: Control) -> None:
    """Mark folds next to each other that differ by less than the errors of both, or that cannot both be.

    Smallest differences come first, and belong to the error of what is left next to them. Maxima and minima of a
    control alternate; of two of a kind the less sure is marked.
    """
    own = [k for k, event in enumerate(events) if (event.kind, event.control) == ("fold", control.kind)]
    while len(own) > 1:
        at = {k: control.weighted(*events[k].numbers[:2]) for k in own}
        errors = np.array([_own_error(events[k], control) for k in own])
        apart = np.abs(np.diff(list(at.values()))) / np.minimum(errors[1:], errors[:-1])
        place = int(np.argmin(apart))
        if not apart[place] < 1.0:
            break
        pair = own[place : place + 2]
        del own[place : place + 2]
        ripple = np.abs(np.subtract(events[pair[0]].numbers, events[pair[1]].numbers))
        for k in sorted(own[max(place - 1, 0) : place + 1], key=lambda k: abs(at[k] - at[pair[0]]))[:1]:
            events[k] = replace(events[k], error=tuple(np.maximum(events[k].error, ripple).tolist()))
        for k in pair:
            message = "It differs from the fold next to it by less than the lattice's error."
            events[k] = replace(events[k], verdict="unresolved", message=message)
    for a, b in pairwise(own):
        if events[a].verdict and events[b].verdict and events[a].maximum == events[b].maximum:
            worse = max(a, b, key=lambda k: control.weighted(*events[k].error[:2]))
            message = "Between it and the fold next to it, which is of the same kind, there is no other."
            events[worse] = replace(events[worse], verdict="unresolved", message=message)


def _own_error(event: RawEvent, control: Control) -> float:
    """Error of a fold's control beside what states near each other have in common."""
    return control.weighted(*np.subtract(event.error[:2], _on_nodes(event.point).shared(event.point)))


def _on_nodes(point: Point) -> OnNodes:
    if isinstance(point.problem, OnNodes):
        return point.problem
    raise TypeError(f"{type(point.problem).__name__} is not on nodes")
