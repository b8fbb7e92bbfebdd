"""Jumps by thermal activation: barriers, and when jumps happen. Plain data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from contbranch.arrays import Array
from contbranch.results.diagram import Cost
from contbranch.results.record import Record, Result, described, record
from contbranch.results.table import Tables, of_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@record
class ActivatedJump(Record):
    """How a stable state is left while the control goes on to its fold.

    Attributes
    ----------
    name : str
        Of the fold: ``pull-off``, ``jump-in``, ``squeeze-out``, ``wetting``, with the number of a layer.
    fold : float
        What is controlled at the fold, where the barrier vanishes.
    values : array (M,)
        What is controlled, from where both stable states have the same energy, or the barrier is that to infinite
        separation without load, to the fold.
    barriers : array (M,)
        Energy of contact and drive at the unstable state minus that at the stable one.
    survival : array (M,)
        Probability that the state has not been left.
    distribution : array (M,)
        Probability of the jump by what is controlled, per its unit; what is left at the fold jumps there.
    mean, std : float
        Of what is controlled when the jump happens.
    error : float
        What half as many states of the curve change of the mean.
    """

    name: str
    fold: float = described(unit="position")
    values: Array
    barriers: Array
    survival: Array
    distribution: Array
    mean: float
    std: float
    error: float

    @property
    def load(self) -> Array:
        """`values` under load control."""
        return self.values

    @property
    def displacement(self) -> Array:
        """`values` under displacement control and with a spring, whose end it is."""
        return self.values

    def barrier(self, value: float) -> float:
        """The barrier at a value of what is controlled; NaN outside of `values`."""
        order = np.argsort(self.values)
        found = np.interp(value, self.values[order], self.barriers[order], left=np.nan, right=np.nan)
        return float(found)


@record
class Activated(Result):
    """Jumps of a contact by thermal activation: what `contbranch.activated` returns; a sequence of its jumps.

    Attributes
    ----------
    jumps : tuple of ActivatedJump
        One for every named fold of the control.
    control : str
    thermal_energy : float
        k T.
    rate : float
        Of what is controlled, per second.
    attempt_frequency : float
        In 1/s.
    cost : Cost
        Of this alone, not of the trace.
    stiffness : float or None
        Of the spring.
    """

    format = "contbranch-activated"
    jumps: tuple[ActivatedJump, ...]
    control: str
    thermal_energy: float = described(unit="energy")
    rate: float
    attempt_frequency: float
    cost: Cost
    stiffness: float | None = described(written="if known", default=None)

    def __len__(self) -> int:
        return len(self.jumps)

    def __getitem__(self, number: int) -> ActivatedJump:
        return self.jumps[number]

    @property
    def quantity(self) -> str:
        """What `values` are: a load, or a displacement."""
        return "load" if self.control == "load" else "displacement"

    def told(self) -> str:
        """When each jump happens."""
        unit = self.units.get(self.quantity, "")
        listed = (f"{jump.name} at {jump.mean:.5g} ± {jump.std:.2g} {unit}".rstrip() for jump in self.jumps)
        return "; ".join(listed)

    def tables(self) -> Tables:
        """All jumps, one below the other."""
        parts = [(k, jump) for k, jump in enumerate(self.jumps)]
        columns = {
            "jump": np.concatenate([np.full(len(jump.values), k) for k, jump in parts] or [np.zeros(0, int)]),
            self.quantity: np.concatenate([jump.values for _, jump in parts] or [np.zeros(0)]),
            "energy": np.concatenate([jump.barriers for _, jump in parts] or [np.zeros(0)]),
            "survival": np.concatenate([jump.survival for _, jump in parts] or [np.zeros(0)]),
            "distribution": np.concatenate([jump.distribution for _, jump in parts] or [np.zeros(0)]),
        }
        return {"point": of_columns(columns, self.units)}

    def plot(self) -> Figure:
        """Draw barriers and distributions of all jumps against what is controlled."""
        from contbranch.output.plot_activated import activated_figure

        return activated_figure(self)
