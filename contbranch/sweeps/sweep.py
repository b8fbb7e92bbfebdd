"""`sweep`: many contacts on any executor, nothing lost and nothing computed twice."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from contbranch.contact.contact import Contact
from contbranch.contact.family import dimension_of
from contbranch.contact.text import as_path
from contbranch.contact.units import positive_number
from contbranch.errors import InputError, refuse_unknown
from contbranch.output.files import reserved
from contbranch.output.sweep_file import load_sweep, records_of, write_sweep
from contbranch.results.diagram import Cost
from contbranch.results.record import UnitNames
from contbranch.results.sweep import Sweep, SweepTask
from contbranch.sweeps.design import Design, listed
from contbranch.sweeps.journal import Journal, decoded, encoded
from contbranch.sweeps.run import Run
from contbranch.sweeps.tasks import Task, Tracing, key_of
from contbranch.watch import LATE, Progress, kept, told, watched

_FEW = 1000  # contacts whose profiles are kept unless something else is asked for
_TRACING = ("control", "accuracy", "max_load", "model", "keep", "task_limit")
_RUNNING = ("workers", "retry", "time_limit")


def sweep(
    contacts: Sequence[Any],
    path: str | Path,
    executor: Executor | None = None,
    resume: bool = False,
    *,
    task: Task | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Sweep:
    """Trace many contacts, on all cores of this machine or on any executor, and write what is found to one file.

    Every trace is written to a journal beside the file as soon as it has ended. Whatever ends the sweep, called again
    with ``resume=True`` it computes only what is missing. A contact whose trace fails, does not end or kills its worker
    is recorded as failed, with the reason. Results depend on nothing but contact, settings and version.

    Parameters
    ----------
    contacts : sequence of Contact
        Such as `contbranch.varied` makes; of a list, the numbers in which its contacts differ are the parameters.
    path : str or Path
        HDF5 file to be written, which xarray opens; the parameters are its dimensions, or coordinates of its tasks.
    executor : concurrent.futures.Executor, optional
        Whose workers can import contbranch; default: processes on this machine.
    resume : bool
        Go on with an earlier sweep of that file, if there is one. Otherwise one that exists is refused.
    task : Task, optional
        What is done with each contact, instead of a trace: see `contbranch.sweeps.tasks`.
    progress : callable, optional
        As of `contbranch.trace`.
    **settings
        Of the traces: ``control``, ``accuracy``, ``max_load``, ``model``; ``keep``: ``"thresholds"``, ``"curves"`` or
        ``"profiles"`` (default: what the sweep to be resumed has kept, otherwise profiles of up to 1,000 contacts,
        curves of more); ``task_limit``: seconds that a trace may take (3,600). Of the sweep: ``workers``: how many work
        at a time (default: one for each core, or as many as the executor says); ``retry=True``: what failed is computed
        again, and what was ended by a shorter ``task_limit``; ``time_limit``: seconds.

    Returns
    -------
    Sweep
        With status ``incomplete`` where not every task has ended.

    Raises
    ------
    InputError
        If an argument cannot be used, or the file exists, or another process writes it.
    """
    refuse_unknown(settings, (*_TRACING, *_RUNNING))
    path = as_path(path)
    if isinstance(contacts, Contact) or not (hasattr(contacts, "__len__") and hasattr(contacts, "__getitem__")):
        raise InputError(f"contacts: {type(contacts).__name__}; must be a list of contacts, or what cb.varied makes")
    workers = settings.get("workers")
    if workers is not None and not (type(workers) is int and workers > 0):
        raise InputError(f"workers: {workers!r}; must be a whole number, 1 or greater")
    if not len(contacts):
        raise InputError("contacts: none; give at least one")
    design = contacts if isinstance(contacts, Design) else listed(contacts)
    chosen: dict[str, Any] = {name: settings[name] for name in _TRACING[:4] if name in settings}
    limit = settings.get("task_limit", 3600.0)
    limit = limit and positive_number(limit, "task_limit")
    usual = ("profiles", "curves", "thresholds") if len(contacts) <= _FEW else ("curves", "profiles", "thresholds")
    choices: Sequence[Any] = (settings["keep"],) if settings.get("keep") else usual
    tasks = [Tracing(**chosen, keep=keep, time_limit=limit) for keep in choices] if task is None else [task]
    folder = path.with_name(path.name + ".journal")
    if not resume and (path.exists() or folder.exists()):
        what = f"'{path}' exists" if path.exists() else f"'{folder}' holds an unfinished sweep"
        raise InputError(f"path: {what}; resume that sweep, or choose another file")
    span = settings.get("time_limit")
    with reserved(path) as place, watched(progress, span and positive_number(span, "time_limit")) as watch:
        if place.unfinished is None:
            raise InputError(f"path: '{path}' is no file; give a name for one")
        try:
            found = _swept(design, path, tasks, executor, settings)
        except OSError as error:
            raise InputError(f"path: '{folder}' cannot be written ({error.strerror}); resume when it can") from None
    return watch.passed(found)


def _swept(
    design: Design, path: Path, tasks: Sequence[Task], executor: Executor | None, settings: dict[str, Any]
) -> Sweep:
    """Compute what is missing, and write the file when nothing is: by the task of an earlier sweep, or the first."""
    began = time.perf_counter()
    earlier = load_sweep(path) if path.exists() else None
    folder = path.with_name(path.name + ".journal")
    known = set() if earlier is None else {one.key for one in earlier.tasks}
    if folder.exists() and len(tasks) > 1:
        with closing(Journal(folder)) as journal:
            known.update(journal.ended)
    task, keys = _continued(tasks, design, known)
    places: dict[str, int] = {}
    for index, key in enumerate(keys):
        first = places.setdefault(key, index)
        if first != index and isinstance(design[index], Contact) and design[index] != design[first]:
            words = "differ by nothing that their descriptions hold; laws and tips of your own need fields that differ"
            raise InputError(f"contacts: numbers {first} and {index} {words}")
    if earlier is not None and earlier.format != getattr(task, "kind", Sweep).format:
        raise InputError(f"path: '{path}' holds {earlier.format}; choose another file")
    retry = settings.get("retry", False)
    wanted = [(key, design.source(index)) for index, key in enumerate(keys)]
    finished = earlier is not None and not folder.exists() and not retry
    if earlier is not None and finished and [(one.key, one.source) for one in earlier.tasks] == wanted:
        return replace(earlier, computed=0, reused=len(keys), path=path)
    with closing(Journal(folder)) as journal:
        if earlier is not None:
            again = [one for one in earlier.tasks if one.key in places and one.key not in journal.ended]
            _add(earlier, again, journal)
        if retry:
            for key in [key for key, entry in journal.ended.items() if _failed(entry.about, task.time_limit)]:
                journal.forget(key)
        missing = [key for key in places if key not in journal.ended]
        workers = settings.get("workers") or getattr(executor, "_max_workers", None) or os.cpu_count() or 1
        run = Run(task, lambda key: design[places[key]], journal, executor, workers, len(places))
        kept(lambda: run(missing), None)
        computed = sum(key in journal.ended for key in missing)
        result = _result(design, task, keys, journal, path)
        cost, message = Cost(time.perf_counter() - began, 0), told(run.failure or result.message)
        result = replace(result, computed=computed, reused=len(result.tasks) - computed, cost=cost, message=message)
        if result.status == "complete":
            write_sweep(result, lambda: (decoded(journal.record(key)) for key in keys), folder / "complete.h5")
            os.replace(folder / "complete.h5", path)
        journal.close(remove=result.status == "complete")
        return result


def _continued(tasks: Sequence[Task], design: Design, known: set[str]) -> tuple[Task, list[str]]:
    """The task by which some of what is known was computed, otherwise the first; and the keys of its results."""
    found = [(task, [key_of(contact, task) for contact in design]) for task in (tasks if known else tasks[:1])]
    return next((one for one in found if not known.isdisjoint(one[1])), found[0])


def _failed(about: dict[str, Any], limit: float | None) -> bool:
    """Whether a task failed, or was ended by a shorter limit than it has now."""
    late = about["status"] == "incomplete" and LATE in about["message"]
    return about["status"] == "failed" or (late and (limit is None or about["wall_s"] < limit))


def _add(earlier: Sweep, tasks: Sequence[SweepTask], journal: Journal) -> None:
    """Add what a finished file holds of tasks to the journal."""
    for one, (about, arrays) in zip(tasks, records_of(earlier, [one.index for one in tasks]), strict=True):
        journal.add(encoded({"key": one.key, "run": f"file-{one.key}", **about}, arrays), sync=False)


def _dimension(contact: Contact, name: str) -> str:
    """The dimension of a parameter; none of one that only other contacts of a list have."""
    with suppress(InputError):
        return dimension_of(contact, name)
    return "dimensionless"


def _result(design: Design, task: Task, keys: Sequence[str], journal: Journal, path: Path) -> Sweep:
    """What is known of the tasks."""
    tasks = []
    for index, key in enumerate(keys):
        if key in journal.ended:
            about = {k: v for k, v in journal.ended[key].about.items() if k not in ("key", "run")}
            count, source = journal.computed[key], design.source(index)
            if source and about["status"] != "complete" and Path(source).name not in about["message"]:
                about["message"] += f" ('{source}')"
            tasks.append(SweepTask(index, design.parameters(index), **about, key=key, computed=count, source=source))
    missing = len(keys) - len(tasks)
    contact: Any = getattr(task, "contact", design.contact)
    units: UnitNames = getattr(task, "unit_names", {})
    if isinstance(contact, Contact) and not units:
        units = {name: contact.units.name(_dimension(contact, name)) for name in design.axes}
        units = {**contact.units.names, **{name: unit for name, unit in units.items() if unit}}
    kind: type[Sweep] = getattr(task, "kind", Sweep)
    return kind(
        parameters=tuple(design.axes),
        axes=design.axes,
        mode=design.mode,
        tasks=tuple(tasks),
        computed=0,
        reused=0,
        cost=Cost(0.0, 0),
        path=path,
        contact=contact if isinstance(contact, Contact) else None,
        description=contact.describe(),
        unit_names=units,
        status="incomplete" if missing else "complete",
        message=f"{missing} of {len(keys)} tasks are missing: resume the sweep to compute them." if missing else "",
    )
