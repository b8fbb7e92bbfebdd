"""A phase diagram: which stable states there are, over a parameter and what is controlled. Plain data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.contact.contact import Contact
from contbranch.results.diagram import Cost
from contbranch.results.followed import Followed
from contbranch.results.record import Record, Result, UnitNames, described, record

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FINE = 320
# Special points closer than this are one.
SAME = 1e-4
# Ends of parts that merge in a special point: two folds, or two folds with first touch between them.
MERGING = {"cusp": 2, "cusp-at-touch": 3}


@record
class Part(Record):
    """A part of one equilibrium curve between folds and first touch, on which the control is monotone.

    Attributes
    ----------
    start, stop : float
        The control at its ends; infinite where the curve goes on.
    contact, stable : bool
    """

    start: float = described(key="from")
    stop: float = described(key="to")
    contact: bool
    stable: bool

    @property
    def kind(self) -> tuple[bool, bool]:
        """Contact and stability."""
        return self.contact, self.stable


@record
class PhaseDiagram(Result):
    """Regions of a parameter and a control by the number and kind of stable states at finite separation.

    Attributes
    ----------
    parameter : str
    control : {"load", "displacement"}
    values : array (N,)
        Values of the parameter at which the contact was traced.
    parts : tuple of tuples of Part
        The parts of each of those curves.
    levels : array (L,)
        Values of the control.
    boundaries : tuple of Followed
        The folds of the control, and first touch, along the parameter.
    logarithmic : bool
        Whether equal ratios of the parameter count alike.
    """

    format = "contbranch-phase"
    parameter: str
    control: Literal["load", "displacement"]
    values: Array
    parts: tuple[tuple[Part, ...], ...]
    levels: Array
    boundaries: tuple[Followed, ...]
    contact: Contact = described(kw_only=True)
    cost: Cost
    logarithmic: bool = False
    unit_names: UnitNames = described(default_factory=dict)

    @property
    def counts(self) -> dict[str, Integers]:
        """Numbers of stable states ``without_contact`` and ``with_contact``, (N, L) each."""
        found = [counted(parts, self.levels) for parts in self.parts]
        return {
            "without_contact": np.array([pair[0] for pair in found]),
            "with_contact": np.array([pair[1] for pair in found]),
        }

    @property
    def special(self) -> tuple[Any, ...]:
        """Special points of all boundaries, each once: where two boundaries meet, the one that says more."""
        found: list[Any] = []
        every = [one for followed in self.boundaries for one in followed.special]
        for one in sorted(every, key=lambda one: one.kind == "fold-through-touch"):
            place = (one.value, one.load, one.displacement)
            if all(not np.allclose(place, (k.value, k.load, k.displacement), SAME, SAME, True) for k in found):
                found.append(one)
        return tuple(sorted(found, key=lambda one: float(one.value)))

    def fine(self) -> tuple[Array, Array, Integers, Integers]:
        """Values (V,) and levels (W,) of a finer grid with the numbers of stable states (V, W), for drawing.

        Between traced curves with the same parts their ends are interpolated; where the parts change, the change is put
        at the special point between the two.
        """
        q = self._coordinate(self.values)
        fine = np.linspace(q[0], q[-1], FINE)
        levels = np.linspace(self.levels[0], self.levels[-1], FINE)
        runs = self._runs()
        limits = [q[0], *(self._change(runs[i][-1]) for i in range(len(runs) - 1)), q[-1]]
        without, within = np.zeros((2, FINE, FINE), dtype=np.int64)
        for k, at in enumerate(fine):
            which = min(max(int(np.searchsorted(limits, at, side="right")) - 1, 0), len(runs) - 1)
            without[k], within[k] = counted(self._interpolated(q, runs[which], at), levels)
        return (np.exp(fine) if self.logarithmic else fine), levels, without, within

    def _coordinate(self, values: Array) -> Array:
        return np.log(values) if self.logarithmic else np.asarray(values)

    def _runs(self) -> list[list[int]]:
        """Neighbouring curves with the same parts."""
        runs: list[list[int]] = [[0]]
        for k in range(1, len(self.parts)):
            same = [p.kind for p in self.parts[k]] == [p.kind for p in self.parts[k - 1]]
            runs[-1].append(k) if same else runs.append([k])
        return runs

    def _between(self, last: int) -> Any | None:
        """The special point between a curve and the next, if there is one."""
        low, high = self.values[last : last + 2]
        found = [one for one in self.special if one.control is None and low < one.value < high]
        return found[0] if found else None

    def _change(self, last: int) -> float:
        """Coordinate at which the parts change after a curve."""
        special = self._between(last)
        q = self._coordinate(self.values[last : last + 2])
        if special is None:
            return float(q[0] + q[1]) / 2
        return float(self._coordinate(np.array([special.value]))[0])

    def _interpolated(self, q: Array, run: list[int], at: float) -> list[Part]:
        """The parts at a coordinate within (or close to) a run of curves with the same parts.

        Ends of parts are interpolated; those that merge in a special point beside the run go through it.
        """
        model = self.parts[run[0]]
        rows = [np.array([self.parts[k][0].start, *(part.stop for part in self.parts[k])]) for k in run]
        knots: list[dict[float, float]] = [
            {float(q[k]): float(row[j]) for k, row in zip(run, rows, strict=True)} for j in range(len(model) + 1)
        ]
        for inner, outer, row in ((run[0], run[0] - 1, rows[0]), (run[-1], run[-1] + 1, rows[-1])):
            if not 0 <= outer < len(self.parts) or len(self.parts[outer]) > len(model):
                continue
            special = self._between(min(inner, outer))
            count = MERGING.get(special.kind, 0) if special is not None else 0
            if special is None or not 0 < count <= len(model) - 1:
                continue
            place, level = self._change(min(inner, outer)), getattr(special, self.control)
            first = min(range(1, len(model) - count + 1), key=lambda k: float(np.abs(row[k : k + count] - level).max()))
            for j in range(first, first + count):
                knots[j][place] = level
        limits = [_through(knot, at) for knot in knots]
        return [Part(limits[j], limits[j + 1], part.contact, part.stable) for j, part in enumerate(model)]

    def plot(self) -> Figure:
        """Draw the regions, their boundaries, and the special points."""
        from contbranch.output.plot_follow import phase_figure

        return phase_figure(self)


def _through(knots: dict[float, float], at: float) -> float:
    """Interpolation without overshoot through knots."""
    from contbranch.output.smooth import smooth

    places = np.array(sorted(knots))
    levels = np.array([knots[place] for place in places])
    if len(places) < 2 or not np.isfinite(levels).all():
        return float(levels[0])
    return float(smooth(places, levels, np.array([at]))[0])


def counted(parts: tuple[Part, ...] | list[Part], levels: Array) -> tuple[Integers, Integers]:
    """Numbers of stable states without and with contact at values of the control, (L,) each."""
    without, within = np.zeros((2, len(levels)), dtype=np.int64)
    for part in parts:
        if part.stable:
            low, high = min(part.start, part.stop), max(part.start, part.stop)
            inside = (levels > low) & (levels <= high)
            (within if part.contact else without)[inside] += 1
    return without, within
