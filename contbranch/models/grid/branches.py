"""Branches of less symmetry, followed on the whole lattice from the symmetry events at which they leave the curve.

A branch keeps one symmetry of the lattice: the other mirror where it breaks one, both mirrors where it breaks the
exchange of x and y, the exchange (or the turn by π) where it breaks both mirrors. Its folds are passed by modes that
have this symmetry, too; the others are counted as those that break it, but for the turn around the axis, along which
the branch of an axisymmetric tip is a whole family, and whose eigenvalue is all but zero.

The branch with the opposite amplitude is the image of this one and is not followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self, cast

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import Point, StopAt
from contbranch.continuation.follow import Branch
from contbranch.curve.events import Ceiling, Folds
from contbranch.curve.outcome import RawCurve, RawEvent
from contbranch.curve.problem import Count
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request, follow_from
from contbranch.curve.track import Track

from .equilibria import LatticeProblem
from .measure import quietly
from .stability import Stability
from .switching import Departure, Switched, has_symmetry, kept_symmetry, lacking, mirrored, switch
from .transforms import EVEN

__all__ = ["POINTS", "departure", "follow_branch", "with_branches"]


# Points of a branch at most.
POINTS = 60
# A branch has come back if its asymmetry has fallen to this part of the largest, and to an event if load and
# displacement differ by less than this part of max(1, |value|): steps are not small there.
BACK, SAME = 0.3, 0.05


class BranchProblem(LatticeProblem):
    """Equilibria of a branch on the whole lattice.

    Parameters
    ----------
    origin : LatticeProblem
        Of the curve that it leaves.
    switched : Switched
        Its first states.
    points : int
        With which it ends.
    """

    tells_modes = False

    def __init__(self, origin: LatticeProblem, switched: Switched, points: int) -> None:
        super().__init__(origin.setup.whole(), origin.tolerance, wall=True)
        self.switched, self.points = switched, points
        self._image = kept_symmetry(self.setup.lattice, switched.sector, origin.nodes.swapped)
        self.stability, self.turning = Stability(self.nodes), origin.modes.axisymmetric
        self.message = ""

    def begin(self) -> Point:
        """The first state, towards the second."""
        first, last = self.switched.states
        return self.point(first, last.beyond(first))

    def finer(self) -> Self:
        """Itself: another lattice does not tell what breaks the symmetry of the branch."""
        return self

    def kept(self, u: Array) -> Array:
        """The image under the mirror, or the turn, that the branch keeps."""
        return self._image(u)

    def odd(self, x: Array) -> Array:
        """What the symmetry of the curve changes."""
        u = x.reshape(self.nodes.shape)
        return u - mirrored(self.setup.lattice, u, self.switched.sector)

    def walked(self, start: Point, folds: Folds, end: Ceiling, stop: StopAt) -> Branch:
        """Up to where it meets the curve again, or has as many points as were asked for."""
        odd, count = self.odd(start.x), 1

        def ended(point: Point) -> bool:
            nonlocal odd, count
            before, odd, count = odd, self.odd(point.x), count + 1
            if np.vdot(before, odd) <= 0.0:
                self.message = "The branch meets the symmetric curve again, and goes on as its own image."
            elif count >= self.points:
                self.message = f"The branch was followed over {self.points} points."
            return bool(self.message)

        return super().walked(start, folds, end, StopAt(predicate=ended))

    def ending(self, name: str, point: Point) -> str:
        """By what it was ended."""
        return self.message or super().ending(name, point)

    def unstable(self, x: Array, p: float) -> int:
        """Modes with the symmetry that the branch keeps; at its very beginning an eigenvalue is all but zero."""
        spectrum = self.stability.spectrum(self.state(x, p), None)
        return int((has_symmetry(spectrum, self.kept) & (spectrum.eigenvalues < 0.0)).sum())

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count | None:
        """Modes without it, but for the turn around the axis."""
        if not limit:
            return None
        number = lacking(self.stability.spectrum(self.state(x, p), None), self.kept, self.turning)
        return Count((number,) if number else ())


def departure(event: RawEvent) -> Departure:
    """Where a branch leaves at a symmetry event."""
    place, mode = event.point, event.mode or 0
    problem = cast(LatticeProblem, place.problem)
    state = problem.at(place)
    found = problem.modes.of(state, mode, event.index)
    return Departure(state, found.sector or EVEN, mode, found.vector)


def follow_branch(event: RawEvent, request: Request, points: int | None = None) -> Track | str:
    """Follow the branch that leaves a curve at a symmetry event; the reason, a sentence, if none was found.

    Parameters
    ----------
    event : RawEvent
        Found on a quarter of the lattice.
    request : Request
        As for `trace`. Without modes, those that break the symmetry of the branch are not counted.
    points : int, optional
        The branch ends after so many (default: `POINTS`), if it has not come back to the symmetric curve before.
    """
    origin = cast(LatticeProblem, event.point.problem)
    leaves = departure(event)
    what = f"at load {leaves.equilibrium.load * origin.setup.units.load:.6g} with mode {leaves.mode}"
    if leaves.sector == EVEN and leaves.mode % 4 == 0:
        return f"The branch {what} has the symmetry of the lattice, which cannot tell it from the curve."
    with quietly():
        switched = switch(origin.nodes, leaves)
        if switched is None:
            return f"No states of the branch {what} were found."
        problem = BranchProblem(origin, switched, POINTS if points is None else points)
        return follow_from(problem.begin(), request)


def with_branches(curve: RawCurve, request: Request) -> RawCurve:
    """The raw result of a traced curve together with every branch that leaves it.

    A branch that comes back to the curve at another event is not followed again from there.
    """
    known: list[tuple[RawEvent, Track]] = []
    notes, missing = [curve.message] if curve.message else [], []
    if request.target is None and len(curve.branch):
        request = replace(request, target=float(curve.branch.load.max()))
    for event in curve.events:
        if event.kind != "symmetry" or any(_ends_at(branch, origin, event) for origin, branch in known):
            continue
        found = follow_branch(event, request)
        if isinstance(found, str):
            missing.append(found)
        else:
            known.append((event, found))
    others = tuple(raw_curve(branch, request) for _, branch in known)
    missing += [f"Branch {number}: {one.message}" for number, one in enumerate(others, start=1) if one.message]
    complete, message = curve.complete and not missing, " ".join(notes + missing)
    return replace(curve, others=others, complete=complete, message=message)


def _ends_at(branch: Track, origin: RawEvent, event: RawEvent) -> bool:
    """Whether a branch that left at one event has come back at another."""
    problem = branch.problem(0)
    if event.mode != origin.mode or not isinstance(problem, BranchProblem):
        return False
    sizes = [np.abs(problem.odd(point.x)).max() for point in branch.points]
    there, last = np.array(event.numbers[:2]), branch.points[-1].observables
    close = np.abs(there - [last["load"], last["displacement"]]) <= SAME * np.maximum(1.0, np.abs(there))
    return bool(close.all() and sizes[-1] < BACK * max(sizes))
