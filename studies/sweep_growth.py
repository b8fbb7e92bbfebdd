"""How time and memory of a sweep grow with its tasks, their results and its workers.

The tasks do nothing but return an array, or are traces: ``python studies/sweep_growth.py`` measures the first,
``--traces N`` compares N traces in a bare loop with sweeps on one worker and on two. `docs/sweeps.md` has the results.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import contbranch as cb
from contbranch.sweeps.tasks import Outcome


@dataclass(frozen=True)
class Place:
    """A place in a table, which stands for a contact."""

    value: int

    def describe(self) -> dict[str, Any]:
        """What tells it from others."""
        return {"value": self.value}


@dataclass(frozen=True)
class Nothing:
    """A task whose result is `size` numbers, at once."""

    size: int
    time_limit: float | None = None

    def describe(self) -> dict[str, Any]:
        """What makes its results."""
        return {"task": "nothing", "size": self.size}

    def __call__(self, given: Place) -> Outcome:
        """Numbers that depend on the place."""
        about = {"status": "complete", "message": "", "thresholds": {"touch_load": float(given.value)}}
        return Outcome(about, {"point.load": np.arange(self.size) + float(given.value)})


class Growth(NamedTuple):
    """One sweep of tasks that do nothing: seconds in all; time and memory (in MB) of the process that runs it."""

    tasks: int
    size: int
    workers: int
    seconds: float
    own_seconds: float
    megabytes: float
    file_megabytes: float


def measured(tasks: int, size: int, workers: int) -> Growth:
    """Run a sweep in this process."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.h5"
        began, own = time.perf_counter(), time.process_time()
        found = cb.sweep([Place(k) for k in range(tasks)], path, task=Nothing(size), workers=workers)
        seconds, own = time.perf_counter() - began, time.process_time() - own
        assert found.computed == tasks
        written = path.stat().st_size / 1e6
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return Growth(tasks, size, workers, seconds, own, memory, written)


def apart(tasks: int, size: int, workers: int) -> Growth:
    """Run a sweep in a process of its own, whose memory is then that of the sweep alone."""
    command = [sys.executable, __file__, "--one", str(tasks), str(size), str(workers)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    numbers = done.stdout.split()
    return Growth(*map(int, numbers[:3]), *map(float, numbers[3:]))  # type: ignore[arg-type]


def film(count: int) -> cb.Design:
    """Repulsive films of as many ranges."""
    contact = cb.Contact.reduced(cb.Gauss, tabor=2.0, sign=-1)
    return cb.varied(contact, {"tabor": np.geomspace(0.5, 4.0, count).tolist()})


def compared(count: int) -> dict[str, tuple[float, float]]:
    """Seconds, and those of all processors, of a bare loop over traces and of sweeps on one worker and on two.

    Half of the loop comes before the sweeps and half after them, since a machine's speed drifts.
    """
    contacts = list(film(count))
    loop = [_loop(contacts[::2])]
    sweeps = {}
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            began = _clock()
            cb.sweep(film(count), Path(folder) / "s.h5", workers=workers)
            sweeps[f"sweep, {workers} worker{'s' * (workers > 1)}"] = _since(began)
    loop.append(_loop(contacts[1::2]))
    return {"bare loop": (loop[0][0] + loop[1][0], loop[0][1] + loop[1][1]), **sweeps}


def _loop(contacts: Sequence[cb.Contact]) -> tuple[float, float]:
    began = _clock()
    for contact in contacts:
        cb.trace(contact)
    return _since(began)


def _clock() -> tuple[float, float]:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return time.perf_counter(), sum(one.ru_utime + one.ru_stime for one in used)


def _since(began: tuple[float, float]) -> tuple[float, float]:
    now = _clock()
    return now[0] - began[0], now[1] - began[1]


def drawn(found: Sequence[Growth], path: Path) -> None:
    """Draw time and memory over the number of tasks, with straight lines on to a million."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(6.8, 2.9), layout="constrained")
    kinds = sorted({(one.size, one.workers) for one in found})
    far = np.geomspace(min(one.tasks for one in found), 1e6, 40)
    for number, (size, workers) in enumerate(kinds):
        own = sorted(one for one in found if (one.size, one.workers) == (size, workers))
        tasks = np.array([one.tasks for one in own])
        words = f"{size} numbers, {workers} worker{'s' * (workers > 1)}"
        columns = ([one.seconds for one in own], [one.own_seconds for one in own]), ([one.megabytes for one in own],)
        for place, lines in zip(axes, columns, strict=True):
            for values, mark in zip(lines, ("o", "s"), strict=False):
                label = words if place is axes[1] else None
                place.loglog(tasks, values, mark, color=f"C{number}", markersize=4, fillstyle="full" if mark == "o" else
                             "none", label=label)  # fmt: skip
                if tasks.size > 2:  # a share for each task beside what a sweep needs at all
                    slope, start = np.polyfit(tasks, values, 1)
                    place.loglog(
                        far, np.maximum(start, values[0] * 0.5) + slope * far, "--", color=f"C{number}", linewidth=0.8
                    )
    axes[0].set(xlabel="tasks", ylabel="seconds", title="squares: of the process that runs it")
    axes[1].set(xlabel="tasks", ylabel="MB", title="memory of that process")
    axes[1].legend(fontsize=7)
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--traces", type=int, help="compare so many traces with a bare loop")
    parser.add_argument("--most", type=int, default=10_000, help="tasks of the longest sweep that does nothing")
    parser.add_argument("--plot", type=Path, help="draw the chart there")
    parser.add_argument("--one", nargs=3, type=int, help=argparse.SUPPRESS)
    asked = parser.parse_args(arguments)
    if asked.one:
        print(*measured(*asked.one))
    elif asked.traces:
        for name, (seconds, used) in compared(asked.traces).items():
            print(f"{name:20s} {seconds:8.1f} s, {used:8.1f} s of processors")
    else:
        print(
            "| tasks | numbers each | workers | s | ms a task | of them here | MB | MB of the file |\n"
            + "|--:" * 8
            + "|"
        )
        cases, found = [(asked.most // k, 1000, 2) for k in (100, 10, 1)], []
        for case in [*cases, (asked.most, 1000, 1), (asked.most, 10, 2), (asked.most // 10, 35_000, 2)]:
            one = apart(*case)
            found.append(one)
            each, own = (1e3 * seconds / one.tasks for seconds in (one.seconds, one.own_seconds))
            print(f"| {one.tasks} | {one.size} | {one.workers} | {one.seconds:.1f} | {each:.2f} | {own:.2f} | "
                  f"{one.megabytes:.0f} | {one.file_megabytes:.1f} |", flush=True)  # fmt: skip
        if asked.plot is not None:
            drawn(found, asked.plot)


if __name__ == "__main__":
    main()
