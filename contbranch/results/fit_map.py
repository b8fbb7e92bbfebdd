"""The fits of the force curves of a map: values over the places of the curves. Plain data."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.results.diagram import Diagram
from contbranch.results.record import record
from contbranch.results.sweep import Sweep
from contbranch.results.table import Table, Tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Places closer than this share of all of them are one row or column.
SAME = 1e-3
# The outcome of a map of which nothing can be told.
NOTHING = "nothing is determined in any curve"
# What places up and across are called.
_AXES = (("y", "row"), ("x", "column", "number"))


class _Table(Table):
    """A table in whose CSV nothing stands where there is no value."""

    def csv(self) -> str:
        return re.sub(r"(?<=,)nan(?=[,\n])", "", super().csv())


class Picture(NamedTuple):
    """A value over the places of a map.

    Attributes
    ----------
    x, y : array (N,), array (M,)
        Places of columns and of rows.
    values : array (M, N)
        Not a number where the curve was not fitted, or does not determine the value.
    """

    x: Array
    y: Array
    values: Array


@record
class FitMap(Sweep):
    """What `contbranch.fit_map` returns, or what its file holds: a task for each curve.

    In place of thresholds, tasks have the values that their curves determine, with errors (``modulus``,
    ``modulus_error``, …), ``pull_off_force``, ``rms`` and ``noise``; a contact point is the height of the surface.
    """

    format = "contbranch-fit-map"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all that was found, and of all that was free."""
        return tuple(sorted({*super().names, *self.determined, *(f"{name}_error" for name in self.determined)}))

    @property
    def determined(self) -> dict[str, int]:
        """How many curves determine each of the values that were free."""
        free = [name for name in self.unit_names if f"{name}_error" in self.unit_names]
        return {name: sum(name in task.thresholds for task in self.tasks) for name in free}

    @property
    def outcome(self) -> str:
        """As of a sweep, or that no curve determines more than its baseline."""
        found = any(count for name, count in self.determined.items() if name not in ("baseline", "tilt"))
        return super().outcome if found or self.status == "incomplete" else NOTHING

    def tables(self) -> Tables:
        """A row a curve: where it is from, its place and values, its status; in a CSV cells of no value are empty."""
        return {name: _Table(*table) for name, table in super().tables().items()}

    def picture(self, name: str) -> Picture:
        """A value over the places of the curves.

        Raises
        ------
        InputError
            If the map has no such value, or two curves lie at one place.
        """
        if name not in self.names:
            raise InputError(f"name: {name!r}; this map has {', '.join(self.names) or 'no values'}")
        known = (next((one for one in names if one in self.parameters), "") for names in _AXES)
        places = (np.array([task.parameters.get(one, 0.0) for task in self.tasks]) for one in known)
        (y, rows), (x, columns) = map(places_of, places)
        if len(set(zip(rows.tolist(), columns.tolist(), strict=True))) < len(self.tasks):
            raise InputError("picture: two curves are at one place; say how curves lie with shape=(rows, columns)")
        found = np.full((y.size, x.size), np.nan)
        found[rows, columns] = [task.thresholds.get(name, np.nan) for task in self.tasks]
        return Picture(x, y, found)

    def diagram(self, index: int) -> Diagram:
        """Not there: curves were fitted, none traced.

        Raises
        ------
        InputError
            Always.
        """
        raise InputError("diagram: a map of fits has none; fit the curve alone, and take the loop of that")

    def plot(self, *names: str, **options: Any) -> Figure:
        """Draw values as pictures; by default modulus and work of adhesion, or the first two that there are."""
        from contbranch.output.plot_fit import map_figure

        values = [name for name, count in self.determined.items() if count]
        usual = [name for name in ("modulus", "work_of_adhesion") if name in values]
        return map_figure(self, names or usual or values[:2])


def places_of(values: Array) -> tuple[Array, np.ndarray[Any, Any]]:
    """Growing places of rows (or columns), and to which of them each value belongs."""
    order = np.argsort(values, kind="stable")
    label = np.zeros(values.size, dtype=int)
    label[order[1:]] = np.cumsum(np.diff(values[order]) > SAME * np.ptp(values)) if values.size > 1 else 0
    return np.bincount(label, values) / np.bincount(label), label
