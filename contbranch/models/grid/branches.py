"""Branches of less symmetry, followed on the whole lattice from the symmetry events at which they leave the curve.

A branch keeps one symmetry of the lattice: the other mirror where it breaks one, both mirrors where it breaks the
exchange of x and y, the exchange (or the turn by π) where it breaks both mirrors. Its folds are passed by modes that
have this symmetry, too; the others are counted as those that break it, but for the turn around the axis, along which
the branch of an axisymmetric tip is a whole family, and whose eigenvalue is all but zero.

The branch with the opposite amplitude is the image of this one and is not followed.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from contbranch.curve.outcome import RawCurve
from contbranch.curve.trace import Request

from .arrays import Array
from .setup import Setup
from .switching import Switched, kept_symmetry, mirrored, switch
from .symmetry import Breaking, distinct
from .trace import Traced, followed
from .transforms import EVEN
from .walk import Point, quietly

__all__ = ["POINTS", "follow_branch", "with_branches"]


# Points of a branch at most.
POINTS = 60
# A branch has come back if its asymmetry has fallen to this part of the largest, and to an event if load and
# displacement differ by less than this part of max(1, |value|): steps are not small there.
BACK, SAME = 0.3, 0.05


@dataclass
class _Ending:
    """Whether a branch has come back to the symmetric curve, or has as many points as were asked for."""

    switched: Switched
    points: int
    count: int = 2
    odd: Array | None = field(default=None, repr=False)

    def __call__(self, points: Sequence[Point]) -> tuple[str, bool] | None:
        """The message with which it ends, and whether the last point lies beyond."""
        lattice, sector = self.switched.problem.lattice, self.switched.sector
        u = points[-1].state.u
        odd = u - mirrored(lattice, u, sector)
        before, self.odd, self.count = self.odd, odd, self.count + 1
        if before is not None and np.vdot(before, odd) <= 0.0:
            return "The branch meets the symmetric curve again, and goes on as its own image.", True
        if self.count >= self.points:
            return f"The branch was followed over {self.points} points.", False
        return None


def follow_branch(setup: Setup, event: Breaking, request: Request, points: int | None = None) -> Traced | str:
    """Follow the branch that leaves a curve at a symmetry event; the reason, a sentence, if none was found.

    Parameters
    ----------
    setup : Setup
        With which the event was found, on a quarter of the lattice.
    event : Breaking
    request : Request
        As for `trace`. Without modes, those that break the symmetry of the branch are not counted.
    points : int, optional
        The branch ends after so many (default: `POINTS`), if it has not come back to the symmetric curve before.
    """
    sector = event.kind.sector
    what = f"at load {event.equilibrium.load * setup.units.load:.6g} with mode {event.mode}"
    if sector == EVEN and event.mode % 4 == 0:
        return f"The branch {what} has the symmetry of the lattice, which cannot tell it from the curve."
    with quietly():
        switched = switch(setup.problem, event)
    if switched is None:
        return f"No states of the branch {what} were found."
    whole = setup.whole()
    kept = kept_symmetry(whole.lattice, sector, setup.problem.swapped)
    ending = _Ending(switched, POINTS if points is None else points)
    return followed(whole, request, switched.states, ending, kept)


def with_branches(setup: Setup, traced: Traced, request: Request) -> RawCurve:
    """The raw result of a traced curve together with every branch that leaves it.

    A branch that comes back to the curve at another event is not followed again from there.
    """
    began, curve = time.perf_counter(), traced.curve
    known: list[tuple[Breaking, Traced]] = []
    notes = [curve.message] if curve.message else []
    missing = []
    if request.target is None and len(curve.load):
        request = replace(request, target=float(curve.load.max()))
    for event in distinct(traced.breakings) if setup.contact.tip.is_axisymmetric else traced.breakings:
        if any(_ends_at(branch, origin, event) for origin, branch in known):
            continue
        found = follow_branch(setup, event, request)
        if isinstance(found, str):
            missing.append(found)
        else:
            known.append((event, found))
    others = tuple(branch.curve for _, branch in known)
    missing += [f"Branch {number}: {one.message}" for number, one in enumerate(others, start=1) if one.message]
    return replace(
        curve,
        others=others,
        complete=curve.complete and not missing,
        message=" ".join(notes + missing),
        cost=setup.counter.cost(curve.cost.wall_s + time.perf_counter() - began),
    )


def _ends_at(branch: Traced, origin: Breaking, event: Breaking) -> bool:
    """Whether a branch that left at one event has come back at another."""
    if event.kind.sector != origin.kind.sector or event.mode != origin.mode:
        return False
    lattice, sector = branch.setup.lattice, origin.kind.sector
    sizes = [np.abs(row.u - mirrored(lattice, row.u, sector)).max() for row in branch.rows if row.u is not None]
    there = np.array([event.equilibrium.load, event.equilibrium.displacement])
    close = np.abs(there - branch.rows[-1].reading[:2]) <= SAME * np.maximum(1.0, np.abs(there))
    return bool(close.all() and sizes and sizes[-1] < BACK * max(sizes))
