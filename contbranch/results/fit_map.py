"""The fits of the force curves of a map: values over the places of the curves. Plain data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.results.diagram import Diagram
from contbranch.results.record import record
from contbranch.results.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Places closer than this share of all of them are one row or column.
SAME = 1e-3


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

    def picture(self, name: str) -> Picture:
        """A value over the places of the curves.

        Raises
        ------
        InputError
            If no curve determines it, or two lie at one place.
        """
        if name not in self.names:
            raise InputError(f"name: {name!r}; this map has {', '.join(self.names) or 'no values'}")
        labels, axes = [], []
        for axis in (("y", "row"), ("x", "column", "number")):
            known = next((one for one in axis if one in self.parameters), None)
            values = np.array([0.0 if known is None else task.parameters[known] for task in self.tasks])
            centres, label = places_of(values)
            labels.append(label)
            axes.append(centres)
        if len(set(zip(*map(np.ndarray.tolist, labels), strict=True))) < len(self.tasks):
            raise InputError("picture: two curves are at one place; say how curves lie with shape=(rows, columns)")
        found = np.full((axes[0].size, axes[1].size), np.nan)
        found[labels[0], labels[1]] = [task.thresholds.get(name, np.nan) for task in self.tasks]
        return Picture(axes[1], axes[0], found)

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

        values = [name for name in self.names if f"{name}_error" in self.names]
        usual = [name for name in ("modulus", "work_of_adhesion") if name in values]
        return map_figure(self, names or usual or values[:2] or self.names[:2])


def places_of(values: Array) -> tuple[Array, np.ndarray[Any, Any]]:
    """Growing places of rows (or columns), and to which of them each value belongs."""
    order = np.argsort(values, kind="stable")
    label = np.zeros(values.size, dtype=int)
    label[order[1:]] = np.cumsum(np.diff(values[order]) > SAME * np.ptp(values)) if values.size > 1 else 0
    return np.bincount(label, values) / np.bincount(label), label
