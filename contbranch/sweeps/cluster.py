"""Workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from contbranch.errors import InputError


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
        yield client.get_executor(pure=False), max(1, sum(client.ncores().values()))
