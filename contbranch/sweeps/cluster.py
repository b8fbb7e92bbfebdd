"""Workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from contbranch.errors import InputError


class Connected(Executor):
    """The executor of a Dask client; what is handed to one that has lost its scheduler would be waited for for ever."""

    def __init__(self, client: Any) -> None:
        self._client, self._executor = client, client.get_executor(pure=False)

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Hand a call to the cluster.

        Raises
        ------
        RuntimeError
            If the scheduler is lost.
        """
        if self._client.status != "running":
            raise RuntimeError("the scheduler is lost")
        future: Future[Any] = self._executor.submit(fn, *args, **kwargs)
        return future


@contextmanager
def dask_executor(address: str) -> Iterator[tuple[Executor, int]]:
    """The executor of a Dask cluster, and the number of tasks that it computes at a time.

    Raises
    ------
    InputError
        If dask.distributed is not installed, or there is no scheduler.
    """
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise InputError("--scheduler: dask.distributed is not installed; install contbranch[cluster]") from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        told = " ".join(str(error).split())
        raise InputError(f"--scheduler: {address!r} ({told}); give the address of a running scheduler") from None
    with client:
        yield Connected(client), max(1, sum(client.ncores().values()))
