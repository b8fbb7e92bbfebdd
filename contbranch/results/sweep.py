"""What a sweep has found, task by task. Plain data; curves stay in the file until they are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from contbranch.errors import InputError, number_of
from contbranch.results.diagram import Cost, Diagram
from contbranch.results.record import Record, Result, described, record
from contbranch.results.table import Tables, of_columns, quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@record
class SweepTask(Record):
    """One contact of a sweep.

    Attributes
    ----------
    index : int
        Its place in the sweep.
    parameters : dict
        What varies, in the contact's units.
    status, message : str
        ``complete`` and ``incomplete`` are the trace's; ``failed``: there is none, and the message says why.
    thresholds : dict
    wall_s : float
    key : str
        A hash of contact, options and version.
    computed : int
        How often it was computed.
    source : str or None
        Where what was computed with is from, such as the file of a force curve.
    """

    index: int
    parameters: Mapping[str, float]
    status: str
    message: str
    thresholds: Mapping[str, float]
    wall_s: float
    key: str = described(written=False, default="")
    computed: int = described(default=1)
    source: str | None = described(written="if known", default=None)


@record
class Sweep(Result):
    """What `contbranch.sweep` returns, or what its file holds.

    Attributes
    ----------
    parameters : tuple of str
        Names of what varies.
    axes : dict of tuple of float
        Values of each: of a grid, along its dimensions (the last changes fastest); otherwise one a task.
    mode : {"grid", "zip"}
    tasks : tuple of SweepTask
    computed, reused : int
        Tasks computed by this call, and those that were known before.
    path : Path
        The file with the curves, once every task has ended.
    contact : Contact or None
        The one that was varied, or the first.
    status, message : str
        ``complete`` if every task has ended, though some may be incomplete or have failed: see `told` and `failed`.
    """

    format = "contbranch-sweep"
    parameters: tuple[str, ...]
    axes: Mapping[str, tuple[float, ...]]
    mode: Literal["grid", "zip"]
    tasks: tuple[SweepTask, ...]
    computed: int
    reused: int
    cost: Cost
    path: Path = described(written=False)

    def __len__(self) -> int:
        return len(self.tasks)

    @property
    def failed(self) -> tuple[SweepTask, ...]:
        """Tasks without a result."""
        return tuple(task for task in self.tasks if task.status == "failed")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all thresholds found."""
        return tuple(sorted({name for task in self.tasks for name in task.thresholds}))

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the dimensions: of the parameters of a grid, otherwise the number of tasks."""
        return tuple(map(len, self.axes.values())) if self.mode == "grid" else (len(self.tasks),)

    def diagram(self, index: int) -> Diagram:
        """The diagram of a task, as far as it was kept, read from the file: errors are those of its events.

        Raises
        ------
        InputError
            If the task failed, or the file is not there.
        """
        from contbranch.output.sweep_file import read_diagram

        if type(index) is not int or not -len(self) <= index < len(self):
            raise InputError(f"index: {index!r}; must be one of the numbers of {len(self)} tasks, from 0")
        if self.tasks[index].status == "failed":
            raise InputError(f"index: {index}; this task failed: {self.tasks[index].message}")
        return read_diagram(self, index)

    @property
    def outcome(self) -> str:
        """Whether there is anything left to do: that every task has ended does not say that all are complete."""
        whole = all(task.status == "complete" for task in self.tasks)
        return self.status if whole or self.status == "incomplete" else "all tasks have ended"

    def told(self) -> str:
        """How many tasks there are, and of what becomes."""
        counts = dict.fromkeys(("complete", "incomplete", "failed"), 0)
        for task in self.tasks:
            counts[task.status] += 1
        listed = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
        what = f"{number_of(len(self.tasks), 'task')} over {' × '.join(self.parameters) or 'contacts'}"
        return f"{what}: {listed or 'none ended'}"

    def tables(self) -> Tables:
        """A row a task: its source if any has one, parameters, thresholds and status."""
        blank = dict.fromkeys(self.names, float("nan"))
        ends = [{"status": task.status, "message": task.message} for task in self.tasks]
        rows = [{"index": task.index, "source": task.source or "", **task.parameters, **blank, **task.thresholds, **end}
                for task, end in zip(self.tasks, ends, strict=True)]  # fmt: skip
        source = ("source",) if any(task.source for task in self.tasks) else ()
        names = ("index", *source, *self.parameters, *self.names, "status", "message")
        found = {name: np.array([row[name] for row in rows]) for name in names}
        units = {name: quantity(name, self.unit_names) for name in self.names}
        return {"task": of_columns(found, self.unit_names, **units)}

    def plot(self, *thresholds: str, level: float | None = None) -> Figure:
        """Draw thresholds against the parameter, or as maps over two; a page (`contbranch view`) shows the curves.

        Parameters
        ----------
        *thresholds : str
            Some of `names`; default: the loads of the folds.
        level : float, optional
            A line where a threshold has this value: over two parameters the boundary of a phase diagram at that level.
            It is one of the quantity of the first threshold drawn: no line for radii at a level of the load.

        Raises
        ------
        InputError
            For a sweep over more than two parameters, an unknown name, or a level over two that are no grid.
        """
        from contbranch.output.plot_sweep import sweep_figure

        return sweep_figure(self, thresholds, level)


def values_at(axes: Mapping[str, tuple[float, ...]], mode: str, index: int) -> dict[str, float]:
    """The values of a grid, or of lists side by side, at an index."""
    shape = [len(values) for values in axes.values()]
    places: Any = np.unravel_index(index, shape) if mode == "grid" else [index] * len(axes)
    return {name: values[int(k)] for (name, values), k in zip(axes.items(), places, strict=True)}
