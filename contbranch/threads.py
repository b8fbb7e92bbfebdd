"""How computations run: with one BLAS thread, as matrices of a few hundred rows lose more by waiting than they gain."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")
Parameters = ParamSpec("Parameters")


@cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController()


def one_thread(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Run a function with one BLAS thread; numbers too large are answered by shorter steps or reported."""

    @wraps(function)
    def limited(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        with _blas().limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return function(*args, **kwargs)

    return limited
