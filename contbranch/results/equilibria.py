"""All equilibria at one value of the load or the displacement, and the barriers between them. Plain data."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from contbranch.errors import number_of
from contbranch.results.diagram import Cost, ModelChoice, State
from contbranch.results.record import Record, Result, described, record
from contbranch.results.table import Tables, of_records

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@record
class Barrier(Record):
    """What separates two neighbouring stable states: the unstable one between them on the curve.

    Attributes
    ----------
    stable : (int, int or None)
        Numbers of the two states in `Equilibria.states`; None: infinite separation, under a load that pulls.
    saddle : int or None
        Number of the state between them, which has one unstable direction; None: at infinite separation without load.
    heights : (float, float or None)
        Energy of contact and drive at the saddle minus that at either state.
    name : str or None
        ``"detachment"`` of the one to infinite separation.
    """

    stable: tuple[int, int | None]
    saddle: int | None
    heights: tuple[float, float | None]
    name: str | None = None


@record
class Equilibria(Result):
    """Coexisting equilibria: what `contbranch.find_all` returns; a sequence of its states.

    Attributes
    ----------
    states : tuple of State
        Those on the traced curve in the order of the curve, then what is not connected to it.
    connected : tuple of bool
        Whether each lies on the traced curve.
    barriers : tuple of Barrier
        Between neighbouring stable states on the curve; none under a control other than of what was asked for, whose
        values then differ from state to state.
    window : (float, float)
        Displacements between which equilibria were looked for.
    control : str
        Whose stability counts.
    stiffness : float or None
        Of the spring.
    accuracy : float
        What was asked.
    model, cost, status, message
        As of a Diagram.
    """

    format = "contbranch-equilibria"
    states: tuple[State, ...]
    connected: tuple[bool, ...]
    barriers: tuple[Barrier, ...]
    window: tuple[float, float] = described(unit="displacement")
    control: str
    model: ModelChoice
    cost: Cost
    stiffness: float | None = described(written="if known", default=None)
    accuracy: float = 1e-6

    def __len__(self) -> int:
        return len(self.states)

    def __iter__(self) -> Iterator[State]:
        return iter(self.states)

    def __getitem__(self, number: int) -> State:
        return self.states[number]

    def told(self) -> str:
        """How many states there are."""
        return f"{number_of(len(self), 'state')}, {len(self.stable)} stable under {self.control} control"

    def tables(self) -> Tables:
        """The states, and whether each lies on the traced curve."""
        listed = of_records(State, self.states, self.units)
        return {"state": listed._replace(columns={**listed.columns, "connected": np.array(self.connected)})}

    def plot(self) -> Figure:
        """Draw gap and pressure of all states against the radius, dashed where they are not stable."""
        from contbranch.output.plot import coexisting

        return coexisting(self.states, self.control, self.units)

    @property
    def stable(self) -> tuple[State, ...]:
        """The stable ones under the control."""
        return tuple(state for state in self.states if state.stable(self.control))
