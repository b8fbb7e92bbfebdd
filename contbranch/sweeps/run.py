"""Jobs are handed to an executor in batches; whatever happens to its workers, every job ends with a record."""

from __future__ import annotations

import errno
import math
import multiprocessing
import os
import sys
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contbranch.errors import warned
from contbranch.sweeps.journal import Journal, encoded
from contbranch.sweeps.tasks import Task
from contbranch.sweeps.worker import Batch, Job, here, patience, prepare, work
from contbranch.watch import tell

Landing = Future[list[bytes]]

_BATCH = 10.0  # seconds that a batch is to take: a scheduler needs some ms for each
_MOST = 1000  # jobs in a batch
_AHEAD = 2  # batches for each worker, so that none waits for the next one
_TAIL = 4  # batches for each worker that the remaining jobs are divided into, so that all end together
_LOOK = 0.2  # seconds between two reports
_TRIES = 2  # batches that a job may lose without having begun, before it is tried alone
_FRUITLESS = 2  # broken pools in a row in which nothing has begun
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass
class Run:
    """A sweep's jobs on their way.

    Attributes
    ----------
    task : Task
    given : callable
        What the task takes, by its key.
    journal : Journal
    executor : Executor or None
        None: processes of this machine.
    workers : int
        How many work at a time.
    total : int
        Jobs of the whole sweep, those known included.
    failure : str
        Why the sweep had to end early.
    """

    task: Task
    given: Callable[[str], Any]
    journal: Journal
    executor: Executor | None
    workers: int
    total: int
    failure: str = ""

    def __post_init__(self) -> None:
        for old in self.journal.folder.glob("token-*"):
            old.unlink()
        self._token = self.journal.folder / f"token-{uuid.uuid4().hex}"
        self._spent, self._timed, self._sent, self._fruitless = 0.0, 0, 0, 0
        self._pending: deque[str] = deque()
        self._suspects: deque[str] = deque()
        self._flying: dict[Landing, tuple[Batch, bool]] = {}
        self._lost: Counter[str] = Counter()
        self._own: Executor | None = None

    def __call__(self, keys: Iterable[str]) -> None:
        """Compute jobs until all have ended, or `failure` says why not."""
        self._pending.extend(keys)
        self._token.touch()
        try:
            while (self._pending or self._suspects or self._flying) and not self.failure:
                self._submit()
                done, _ = wait(self._flying, _LOOK, FIRST_COMPLETED)
                broken = any(isinstance(_error(future), BrokenExecutor) for future in done)
                if broken:  # whatever else was under way is lost as well
                    done, _ = wait(self._flying)
                begun = [self._land(future) for future in done]
                if broken:
                    self._renew(fruitless=not any(begun))
                self._report()
        finally:
            if self._flying:
                self._token.unlink()  # whoever still works on this sweep ends
            self._close()
            self._token.unlink(missing_ok=True)

    def _submit(self) -> None:
        """Hand out batches; what may have killed a worker is handed out alone, when nothing else is under way."""
        if self._suspects:
            if not self._flying:
                self._send([self._suspects.popleft()], alone=True)
            return
        while self._pending and len(self._flying) < _AHEAD * self.workers:
            mean = self._spent / self._timed if self._timed else _BATCH
            share = math.ceil(len(self._pending) / (_TAIL * self.workers))
            size = max(1, min(_MOST, int(_BATCH / max(mean, 1e-9)), share))
            self._send([self._pending.popleft() for _ in range(min(size, len(self._pending)))], alone=False)

    def _send(self, keys: list[str], alone: bool) -> None:
        self._sent += 1
        jobs = [Job(key, self.given(key)) for key in keys]
        batch = Batch(self.task, jobs, self._token, f"batch-{self._token.name[-8:]}-{self._sent:06d}", here())
        try:
            future = self._pool().submit(work, batch)
        except RuntimeError as error:  # broken or shut down since
            future, alone = Future(), False
            future.set_exception(BrokenExecutor(str(error)))
        self._flying[future] = batch, alone

    def _pool(self) -> Executor:
        if self.executor is not None:
            return self.executor
        if self._own is None:
            script = sys.modules["__main__"]
            if not Path(getattr(script, "__file__", None) or __file__).exists():
                del script.__file__  # a script from standard input, which workers would try to import
            spawn = multiprocessing.get_context("spawn")
            self._own = ProcessPoolExecutor(self.workers, spawn, prepare, (self._token, os.getpid()))
        return self._own

    def _renew(self, fruitless: bool) -> None:
        """Make new workers; where an executor given has broken, go on with processes of this machine."""
        self._fruitless = self._fruitless + 1 if fruitless else 0
        if self._fruitless == _FRUITLESS:
            self.failure = "Workers die before they begin: a script needs if __name__ == '__main__' around its sweep."
        if self.executor is not None:
            self.executor, self.workers = None, min(self.workers, os.cpu_count() or 1)
            warned("executor: it has broken; the sweep goes on with processes of this machine")
        self._close()

    def _close(self) -> None:
        if self._own is not None:
            self._own.shutdown(wait=not self._flying, cancel_futures=True)
            self._own = None

    def _land(self, future: Landing) -> bool:
        """Take what a batch has given, and find out about the rest; whether any of it had begun."""
        batch, alone = self._flying.pop(future)
        error = _error(future)
        for record in [] if error is not None else future.result():
            self.journal.add(record)
        begun = self.journal.collect(self.journal.folder / batch.name)
        if isinstance(error, OSError) and error.errno in _FULL:
            self.failure = f"The journal cannot be written ({error.strerror})."
        for job in batch.jobs:
            if job.key not in self.journal.ended:
                self._judge(job.key, begun.get(job.key), alone, error)
            else:
                self._timed += 1
                self._spent += float(self.journal.ended[job.key].about["wall_s"])
        return bool(begun) or any(job.key in self.journal.ended for job in batch.jobs)

    def _judge(self, key: str, begun: float | None, alone: bool, error: BaseException | None) -> None:
        """What becomes of a job that a batch has left without a record."""
        limit, alone = self.task.time_limit, alone and not isinstance(error, CancelledError)
        if begun is not None and limit is not None and time.time() - begun >= patience(limit):
            self._fail(key, f"It did not end: its worker was stopped after the time limit of {limit:g} s.", begun)
        elif alone and not isinstance(error, BrokenExecutor | None):  # it, or its outcome, cannot be sent or written
            self._fail(key, f"{type(error).__name__}: {' '.join(str(error).split())}", begun)
        elif alone and (begun is not None or self.executor is not None):
            told = " ".join(str(error or "").split()) or "no reason is known"
            self._fail(key, f"Its worker died while it was computed alone ({told}).", begun)
        elif begun is not None or self._lost[key] >= _TRIES:
            self._suspects.append(key)
        else:
            self._lost[key] += error is not None
            self._pending.appendleft(key)

    def _fail(self, key: str, message: str, begun: float | None) -> None:
        spent = 0.0 if begun is None else time.time() - begun
        about = {"status": "failed", "message": message, "thresholds": {}, "wall_s": spent}
        self.journal.add(encoded({"key": key, "run": uuid.uuid4().hex, **about}, {}))

    def _report(self) -> None:
        """Tell how far the sweep is, and how long it will take if its tasks take as long as those so far."""
        ended = len(self.journal.ended)
        text = f"{ended} of {self.total} tasks"
        if self._timed and ended < self.total:
            text += f", {_duration(self._spent / self._timed * (self.total - ended) / self.workers)} left"
        tell(ended / max(self.total, 1), text)


def _error(future: Landing) -> BaseException | None:
    """What a batch raised."""
    return CancelledError("it was cancelled") if future.cancelled() else future.exception()


def _duration(seconds: float) -> str:
    """A time in words."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
