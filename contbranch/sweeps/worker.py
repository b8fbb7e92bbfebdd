"""What a worker does: the tasks of a batch one after the other, each written down as soon as it has ended."""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

_WATCHED = 0.2  # seconds between two looks at whether the sweep goes on
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Job(NamedTuple):
    """One input of the task, and the key of its result."""

    key: str
    given: Any


class Batch(NamedTuple):
    """Jobs for one worker.

    Attributes
    ----------
    task : Task
    jobs : sequence of Job
    token : Path
        Exists as long as the sweep goes on; its folder is where results are written.
    name : str
        Of the batch's file there.
    process : int
        Of the sweep: one that may not be killed.
    """

    task: Any
    jobs: Sequence[Job]
    token: Path
    name: str
    process: tuple[str, int]


def prepare(token: Path, parent: int) -> None:
    """Make a process a worker: one BLAS thread, Ctrl-C left to the sweep, and an end with the sweep's."""
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent and token.exists():
            time.sleep(_WATCHED)
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def work(batch: Batch) -> list[bytes]:
    """Do what is left of a batch; the records that could not be written to the sweep's folder.

    A job that an earlier attempt at the same batch has begun is left out: it may have killed its worker.
    """
    from contbranch.sweeps.journal import Records, encoded
    from contbranch.threads import one_thread

    records = Records(batch.token.parent / batch.name, wait=True) if batch.token.exists() else None
    known = set() if records is None else {entry.about["key"] for entry in records.entries}
    kept = []
    try:
        for job in batch.jobs:
            if job.key in known:
                continue
            if records is not None and not batch.token.exists():  # the sweep has ended
                break
            if records is not None:
                records.append(encoded({"key": job.key, "run": "", "begun": time.time()}, {}), sync=False)
            about, arrays = one_thread(_done)(batch, job.given)
            record = encoded({"key": job.key, "run": uuid.uuid4().hex, **about}, arrays)
            if records is None:
                kept.append(record)
            else:
                records.append(record)
    finally:
        if records is not None:
            records.close()
    return kept


def _done(batch: Batch, given: Any) -> tuple[dict[str, Any], Any]:
    """The outcome of a task, or why it has none."""
    began = time.perf_counter()
    end = _deadline(batch)
    try:
        about, arrays = batch.task(given)
    except (Exception, SystemExit) as error:  # whatever a law or tip of the user's raises
        about, arrays = {"status": "failed", "message": f"{type(error).__name__}: {error}".rstrip(": ")}, {}
    finally:
        end()
    return {"thresholds": {}, **about, "wall_s": time.perf_counter() - began}, arrays


def _deadline(batch: Batch) -> Any:
    """End this process where a task does not end by itself, some time after it should have; returns what calls it off.

    In a process that does one thing at a time even code that holds the interpreter's lock is ended.
    """
    limit = batch.task.time_limit
    if limit is None or batch.process == here():
        return lambda: None
    limit = patience(limit)
    if threading.current_thread() is threading.main_thread():
        faulthandler.dump_traceback_later(limit, exit=True)
        return faulthandler.cancel_dump_traceback_later
    timer = threading.Timer(limit, os._exit, (1,))
    timer.daemon = True
    timer.start()
    return timer.cancel


def patience(limit: float) -> float:
    """Seconds after which a task that should have ended by itself is not waited for any more."""
    return limit + min(max(0.5 * limit, 1.0), 30.0)


def here() -> tuple[str, int]:
    """This process, told from those of other machines."""
    import platform

    return platform.node(), os.getpid()
