"""Rows of a curve on a lattice: what was read off a state, the state itself as far as memory allows, and events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from contbranch.control import Control
from contbranch.errors import InputError
from contbranch.results.diagram import Profile

from .arrays import Array, Mask
from .folds import Refined
from .newton import Equilibrium
from .observables import profile
from .problem import GridProblem
from .reading import Reading
from .setup import Setup

__all__ = ["Four", "Mark", "Row", "deferred_profile", "difference"]

Four = tuple[float, float, float, float]


@dataclass(eq=False)
class Row:
    """A point of the curve: what was read off it, and its state as far as memory allows."""

    arc: float
    reading: Reading
    pairs: int
    load: float
    u: Array | None = field(default=None, repr=False)
    contact: Mask | None = field(default=None, repr=False)
    mark: Mark | None = None

    def state(self, problem: GridProblem) -> Equilibrium | None:
        """The equilibrium, if its fields were kept."""
        if self.u is None or self.contact is None:
            return None
        return Equilibrium(problem.fields(self.u, self.load), self.contact, 0.0, self.reading.displacement, True)


@dataclass
class Mark:
    """An event at a row."""

    kind: Literal["fold", "touch", "end"]
    control: Control | None = None
    maximum: bool = False
    refined: Refined | None = None
    shift: Four | None = None
    message: str = ""
    around: tuple[Equilibrium, Equilibrium, Equilibrium] | None = field(default=None, repr=False)
    unresolved: bool = False


def difference(one: Reading, other: Reading) -> Four:
    """Changes of load, displacement, contact radius and central gap."""
    return tuple(a - b for a, b in zip(one.four, other.four, strict=True))  # type: ignore[return-value]


def deferred_profile(setup: Setup, row: Row) -> Callable[[], Profile]:
    """The profile of a row, computed when it is asked for."""

    def made() -> Profile:
        if row.u is None or row.contact is None:
            raise InputError("state: its fields were given up to save memory; solve for it with near=")
        problem = setup.problem
        fields = problem.fields(row.u, row.load)
        state = Equilibrium(fields, row.contact, 0.0, row.reading.displacement, True)
        return profile(problem, state)

    return made
