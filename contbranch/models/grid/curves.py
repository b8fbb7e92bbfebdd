"""The curves of a contact on a lattice: those of its equilibrium problem, and single states without a curve."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from contbranch.contact.height_map import HeightMap
from contbranch.control import Control
from contbranch.curve.curves import Coexisting, FollowedCurves
from contbranch.curve.outcome import RawCurve
from contbranch.curve.problem import EquilibriumProblem
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.results.diagram import State
from contbranch.results.loop import Hysteresis

from .equilibria import LatticeProblem
from .measure import quietly
from .model import FreeSpace, Periodic
from .ramp import jump_message, ramp_message
from .resolution import Resolution, border_energy, map_message, warn
from .setup import Setup
from .size import announce, border_message, chosen_size
from .solve import solve_all

__all__ = ["LatticeCurves", "traced"]


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
        return _problem(self.setup(request), request)

    def track(self, request: Request) -> Track:
        """The curve, with what is to be said of the lattice."""
        return traced(self.setup(request), request)

    def recent(self, request: Request) -> Track:
        """The curve, followed anew: it takes too much memory to be kept."""
        return self.track(request)

    def trace(self, request: Request) -> RawCurve:
        """The whole curve with its events."""
        track = self.track(request)
        with quietly():
            return raw_curve(track, request)

    def cycle(self, request: Request, control: Control, steps: int, file: Path | None) -> Hysteresis:
        """A quasi-static cycle by relaxation alone, under a control in the contact's units."""
        from .cycle import cycle

        setup = self.setup(request)
        notes = [map_message(setup), Resolution.of(setup).message]
        for note in notes:
            warn(note)
        found = cycle(setup, self.contact, control, request.target or 0.0, steps, file)
        return replace(found, message=" ".join(filter(None, [found.message, *notes])))

    def solve(self, request: Request, field: str, value: float, near: State | None = None) -> Coexisting:
        """Equilibria with a load or displacement, one for every start that leads to one.

        Where `near` has the fields of this lattice, it is the start.
        """
        return solve_all(self.setup(request, field, value), request, field, value, near)

    def find_all(self, request: Request, field: str, value: float, window: tuple[float, float] | None) -> Coexisting:
        """The equilibria on the curve with a value, in a window of displacements; others are not looked for."""
        setup, contact, model = self.setup(request, field, value), self.reduced, self.model
        sized = model
        if not isinstance(contact.tip, HeightMap):
            edge, grid = setup.edge, setup.grid
            if model.cell is None:
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


def _problem(setup: Setup, request: Request) -> LatticeProblem:
    return LatticeProblem(setup, tolerance(request), held=request.held, target=request.target)


def traced(setup: Setup, request: Request) -> Track:
    """The curve on a lattice, with what is to be said of that."""
    announce(setup.grid)
    notes = [Resolution.of(setup).message, map_message(setup), jump_message(setup.law)]
    for note in notes:
        warn(note)
    with quietly():
        track = trace(_problem(setup, request), request)
        notes.append(_reaching(setup, track, request.target))
        warn(notes[-1])
    notes += [ramp_message(setup.law), no_comparison(setup)]
    return replace(track, message=" ".join(filter(None, [track.message, *notes])))


def no_comparison(setup: Setup) -> str:
    """A sentence if there is no lattice with half the nodes to compare with; errors of points are then not known."""
    if setup.coarse is not None:
        return ""
    fitting = 2 * setup.grid if setup.crowded else max(16, 4 * math.ceil(setup.grid / 4))
    by = 2 if setup.crowded else 4
    return f"Errors of points are not known on a grid of {setup.grid}: use one divisible by {by}, such as {fitting}."


def _reaching(setup: Setup, track: Track, target: float | None) -> str:
    """Where along the curve the interaction reaches furthest beyond the border of the cell."""
    heights = setup.problem.heights
    known = (point for point in track.points if point.x.size == heights.size)
    gaps = ((heights + point.x.reshape(heights.shape), point.parameter) for point in known)
    worst = max(gaps, key=lambda gap: border_energy(setup.problem, gap[0]), default=None)
    return "" if setup.crowded or worst is None else border_message(setup, *worst, (None, target))
