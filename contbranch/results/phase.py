"""A phase diagram: which stable states there are, over a parameter and what is controlled. Plain data."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from contbranch.arrays import Array, Integers
from contbranch.contact.contact import Contact
from contbranch.errors import number_of
from contbranch.results.diagram import Cost
from contbranch.results.followed import Followed
from contbranch.results.record import Record, Result, described, record
from contbranch.results.table import Table, Tables, joined

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

    start: float = described(key="from", default=-np.inf)  # infinite where a document has null
    stop: float = described(key="to", default=np.inf)
    contact: bool = described(written=True, default=False)
    stable: bool = False

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
        fine = np.linspace(q[0], q[-1], FINE) if len(q) > 1 else q  # a time limit may leave one curve, or none
        levels = np.linspace(self.levels[0], self.levels[-1], FINE)
        kinds = [[part.kind for part in parts] for parts in self.parts]
        turns = [k + 1 for k in range(len(kinds) - 1) if kinds[k] != kinds[k + 1]]
        which = np.searchsorted([self._change(k - 1) for k in turns], fine, side="right")
        counts = np.zeros((2, len(fine), FINE), dtype=np.int64)
        for number, (first, stop) in enumerate(pairwise([0, *turns, len(kinds)] if kinds else [])):
            own = np.flatnonzero(which == number)
            for k, limits in zip(own, self._ends(q, first, stop, fine[own]), strict=True):
                counts[:, k] = counted(
                    [Part(a, b, *kind) for (a, b), kind in zip(pairwise(limits), kinds[first], strict=True)], levels
                )
        return (np.exp(fine) if self.logarithmic else fine), levels, counts[0], counts[1]

    def _coordinate(self, values: Array) -> Array:
        return np.log(values) if self.logarithmic else np.asarray(values)

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

    def _ends(self, q: Array, first: int, stop: int, at: Array) -> Array:
        """Ends of the parts, (N, parts + 1), at coordinates within (or close to) neighbouring curves with the same.

        They are interpolated; those that merge in a special point beside the curves go through it.
        """
        levels = np.array([[parts[0].start, *(part.stop for part in parts)] for parts in self.parts[first:stop]])
        places, width = q[first:stop], len(self.parts[first])
        for last, outer, row in ((first - 1, first - 1, levels[0]), (stop - 1, stop, levels[-1])):
            special = self._between(last) if 0 <= outer < len(q) else None
            count = 0 if special is None else MERGING.get(special.kind, 0)
            if special is not None and 0 < count < width and len(self.parts[outer]) <= width:
                level, merged = getattr(special, self.control), np.full(width + 1, np.nan)
                off = [np.abs(row[k : k + count] - level).max() for k in range(1, width - count + 1)]
                begin = 1 + int(np.argmin(off))
                merged[begin : begin + count] = level
                places, levels = np.append(places, self._change(last)), np.vstack([levels, merged])
        known = ~np.isnan(levels.T)
        return np.array([_through(places[own], one[own], at) for one, own in zip(levels.T, known, strict=True)]).T

    def told(self) -> str:
        """What bounds its regions."""
        lines, points = number_of(len(self.boundaries), "boundary line"), number_of(len(self.special), "special point")
        return f"{self.control} over {self.parameter}: {lines}, {points}"

    def tables(self) -> Tables:
        """The points of all boundaries."""
        parts = [one.table() for one in self.boundaries]
        points = joined("boundary", [part.columns for part in parts])
        return {"point": Table(points, parts[0].units if parts else {})}

    def plot(self) -> Figure:
        """Draw the regions, their boundaries, and the special points."""
        from contbranch.output.plot_follow import phase_figure

        return phase_figure(self)


def _through(places: Array, levels: Array, at: Array) -> Array:
    """Interpolation without overshoot; infinite levels stay."""
    from contbranch.output.smooth import smooth

    order = np.argsort(places)
    if len(order) < 2 or not np.isfinite(levels).all():
        return np.full(len(at), levels[order[0]])
    return smooth(places[order], levels[order], at)


def counted(parts: tuple[Part, ...] | list[Part], levels: Array) -> tuple[Integers, Integers]:
    """Numbers of stable states without and with contact at values of the control, (L,) each."""
    without, within = np.zeros((2, len(levels)), dtype=np.int64)
    for part in parts:
        if part.stable:
            low, high = min(part.start, part.stop), max(part.start, part.stop)
            inside = (levels > low) & (levels <= high)
            (within if part.contact else without)[inside] += 1
    return without, within
