"""One BLAS thread for matrices of a few hundred rows, which lose more by waiting for threads than they gain."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")
Parameters = ParamSpec("Parameters")


@cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController()


def one_thread(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Run a function with one BLAS thread, whatever the process has otherwise."""

    @wraps(function)
    def limited(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        with _blas().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
