"""The curves of a contact on a lattice: what is asked of any model's, answered by walks of their own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.curve.curves import EXTENSIONS, Coexisting, Route, landed
from contbranch.curve.outcome import RawCurve, state_in_units
from contbranch.curve.quasi_static import Stop, quasi_static
from contbranch.curve.trace import Request
from contbranch.results.diagram import State
from contbranch.watch import kept, over

from .branches import with_branches
from .model import FreeSpace, Periodic
from .paths import GridWalk
from .size import announce, chosen_size
from .solve import find_all, solve_all
from .trace import trace

__all__ = ["LatticeCurves"]

# A curve is continued up to a load greater by this factor, until what a path jumps to lies on it.
FURTHER = 1.5


@dataclass(frozen=True)
class LatticeCurves:
    """Curves of a contact on a lattice (a `curve.curves.Curves`).

    Attributes
    ----------
    contact : Contact
        In its own units.
    given : Periodic or FreeSpace
        In the contact's units.
    """

    contact: Contact
    given: Periodic | FreeSpace
    followable = False

    @cached_property
    def model(self) -> Periodic | FreeSpace:
        """The model in reduced units."""
        return self.given.scaled(self.contact)

    @cached_property
    def reduced(self) -> Contact:
        """The contact in reduced units."""
        return self.contact.to_reduced()

    def trace(self, request: Request) -> RawCurve:
        """The whole curve with its events, and its branches if the model wants them."""
        setup = self.model.setup(self.reduced, None, request.target, request.accuracy)
        announce(setup.grid)
        traced = trace(setup, request)
        if not self.model.branches or over():
            return traced.curve
        return kept(lambda: with_branches(setup, traced, request), traced.curve)

    def solve(self, request: Request, field: str, value: float, near: State | None = None) -> Coexisting:
        """Equilibria with a load or displacement, one for every start that leads to one.

        Where `near` has the fields of this lattice, it is the start.
        """
        setup = self.model.setup(self.reduced, field, value, request.accuracy)
        return solve_all(setup, request, field, value, near)

    def find_all(self, request: Request, field: str, value: float, window: tuple[float, float] | None) -> Coexisting:
        """The equilibria on the curve with a value, in a window of displacements; others are not looked for."""
        model, contact = self.model, self.reduced
        setup = model.setup(contact, field, value, request.accuracy)
        if model.cell is None and not isinstance(contact.tip, HeightMap):
            # The curve goes on to the events, which may take more room than the value does.
            room, _ = chosen_size(contact, model.name, (None, setup.grid), (None, None), request.accuracy)
            if room > setup.edge:
                edge, grid = chosen_size(contact, model.name, (room, model.grid), (field, value), request.accuracy)
                setup = replace(setup, edge=edge, grid=grid)
        return find_all(setup, request, field, value, window)

    def path(self, request: Request) -> Route:
        """The quasi-static path under a control."""
        setup = self.model.setup(self.reduced, None, request.target, request.accuracy)
        announce(setup.grid)
        for _ in range(EXTENSIONS):
            traced = trace(setup, request)
            walk = GridWalk(traced, request.control, request.accuracy)
            legs, jumps = quasi_static(walk) if len(traced.rows) > 1 else ([], [])
            lost = any(jump.end is None and jump.direction > 0 for jump in jumps)
            if not lost or walk.astray or not traced.curve.complete or over():
                break
            request = replace(request, target=FURTHER * float(traced.curve.load[-1]))
        curve = traced.curve
        notes = chain((landed(self.contact, *note) for note in walk.notes), (self._astray(*one) for one in walk.astray))
        message = " ".join([curve.message, *notes]).strip()
        return Route(walk, legs, walk.appraised(jumps), curve, curve.complete and not walk.astray, message)

    def _astray(self, fold: Stop, end: State) -> str:
        """A sentence on a relaxation that has left the curve, in the contact's units."""
        begin, after = state_in_units(self.contact, fold.state), state_in_units(self.contact, end)
        return (
            f"The relaxation from the fold at load {begin.load:.6g}, displacement {begin.displacement:.6g} ends in a "
            f"state that is not on the traced curve (load {after.load:.6g}, displacement {after.displacement:.6g})."
        )
