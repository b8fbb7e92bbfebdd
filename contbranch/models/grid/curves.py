"""The curves of a contact on a lattice: those of its equilibrium problem, and single states without a curve."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from contbranch.contact.height_map import HeightMap
from contbranch.curve.curves import Coexisting, FollowedCurves
from contbranch.curve.outcome import RawCurve
from contbranch.curve.problem import EquilibriumProblem
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.results.diagram import State
from contbranch.watch import kept, over

from .branches import with_branches
from .equilibria import LatticeProblem
from .measure import quietly
from .model import FreeSpace, Periodic
from .ramp import jump_message, ramp_message
from .resolution import HOPELESS, Resolution, border_energy, repetition, warn
from .setup import Setup
from .size import announce, border_message, chosen_size
from .solve import solve_all

__all__ = ["LatticeCurves", "traced"]

# Where the law is stiffer than the lattice by this factor, a contact of many nodes cannot be followed, and one of few
# nodes is farther off than averages tell.
COARSE = 1.6
# The largest array of nodes on which the curve is followed instead.
LARGEST = 1024
SKIPPED = "Pairs of folds closer together than a step may have been passed over."


@dataclass(frozen=True)
class LatticeCurves(FollowedCurves):
    """Curves of a contact on a lattice.

    Attributes
    ----------
    contact : Contact
        In its own units.
    model : Periodic or FreeSpace
        In the contact's units.
    """

    model: Periodic | FreeSpace  # type: ignore[assignment]

    def setup(self, request: Request, field: str | None = None, value: float | None = None) -> Setup:
        """The lattice for a load or displacement, or for a trace to its largest load."""
        asked = request.target if field is None else value
        return self.model.scaled(self.contact).setup(self.reduced, field, asked, request.accuracy)

    def problem(self, request: Request) -> EquilibriumProblem:
        """The first problem of the curve."""
        return LatticeProblem(self.setup(request), tolerance(request))

    def track(self, request: Request) -> Track:
        """The curve, with what is to be said of the lattice; where it is too coarse, on twice the nodes a side."""
        return traced(self.setup(request), request)

    def recent(self, request: Request) -> Track:
        """The curve, followed anew: it takes too much memory to be kept."""
        return self.track(request)

    def trace(self, request: Request) -> RawCurve:
        """The whole curve with its events, and its branches if the model wants them."""
        track = self.track(request)
        with quietly():
            curve = raw_curve(track, request)
            if not self.model.branches or over():
                return curve
            return kept(lambda: with_branches(curve, request), curve)

    def solve(self, request: Request, field: str, value: float, near: State | None = None) -> Coexisting:
        """Equilibria with a load or displacement, one for every start that leads to one.

        Where `near` has the fields of this lattice, it is the start.
        """
        return solve_all(self.setup(request, field, value), request, field, value, near)

    def find_all(self, request: Request, field: str, value: float, window: tuple[float, float] | None) -> Coexisting:
        """The equilibria on the curve with a value, in a window of displacements; others are not looked for."""
        setup, contact, model = self.setup(request, field, value), self.reduced, self.model
        edge, grid = setup.edge, setup.grid
        if model.cell is None and not isinstance(contact.tip, HeightMap):
            # The curve goes on to the events, which may take more room than the value does.
            room, _ = chosen_size(contact, model.name, (None, grid), (None, None), request.accuracy)
            if room > edge:
                edge, grid = chosen_size(contact, model.name, (room, model.grid), (field, value), request.accuracy)
        sized = replace(model, cell=edge * self.contact.scales.in_plane, grid=grid)
        if field == "load":
            request = replace(request, target=max(value, 0.0) * 1.1 + 1.0)
        found = super(LatticeCurves, replace(self, model=sized)).find_all(request, field, value, window)
        return replace(found, excess=0.0)


def tolerance(request: Request) -> float:
    """Residual of the points of a curve, relative."""
    return min(max(request.accuracy, 1e-10), 1e-6)


def traced(setup: Setup, request: Request) -> Track:
    """The curve on a lattice, with what is to be said of that; where it is too coarse, on twice the nodes a side."""
    announce(setup.grid)
    resolution = Resolution.of(setup)
    notes = [resolution.message, repetition(setup), jump_message(setup.law)]
    for note in notes:
        warn(note)
    # Few nodes are cheap to double twice.
    stiffest = 4.0 * COARSE if 16 * setup.lattice.size <= LARGEST else HOPELESS
    fine = setup.averaging and not setup.crowded and 1.0 < resolution.ratio <= stiffest
    fine &= 2 * setup.lattice.size <= LARGEST
    coarse = fine and COARSE < resolution.ratio <= HOPELESS
    with quietly():
        track = None if coarse else trace(LatticeProblem(setup, tolerance(request)), request)
        if track is None or (fine and not track.complete and not over()):
            finer = traced(setup.fine, request)
            note = f"On a grid of {setup.grid} nodes the curve cannot be followed: this is that on twice as many."
            return replace(finer, message=f"{note} {finer.message}".strip())
        notes.append(_reaching(setup, track, request.target))
        warn(notes[-1])
    notes += [ramp_message(setup.law), no_comparison(setup)]
    if track.points and getattr(track.problem(len(track.points) - 1), "skipped", False):
        notes.append(SKIPPED)
    return replace(track, message=" ".join(filter(None, [track.message, *notes])))


def no_comparison(setup: Setup) -> str:
    """A sentence if there is no lattice with half the nodes to compare with; errors of points are then not known."""
    if setup.coarse is not None:
        return ""
    fitting = 2 * setup.grid if setup.crowded else max(16, 4 * math.ceil(setup.grid / 4))
    return f"Errors of points are not known on a grid of {setup.grid}: use one divisible by 4, such as {fitting}."


def _reaching(setup: Setup, track: Track, target: float | None) -> str:
    """Where along the curve the interaction reaches furthest beyond the border of the cell."""
    heights = setup.problem.heights
    known = (point for point in track.points if point.x.size == heights.size)
    gaps = ((heights + point.x.reshape(heights.shape), point.parameter) for point in known)
    worst = max(gaps, key=lambda gap: border_energy(setup.problem, gap[0]), default=None)
    return "" if setup.crowded or worst is None else border_message(setup, *worst, (None, target))
