"""Inverses of what has no closed one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array


def rising(function: Callable[[Array], Array], low: ArrayLike, high: ArrayLike) -> Array:
    """Return where ``function`` changes from negative at ``low`` > 0 to positive at ``high``, by bisection of the log.

    Bisection costs 64 evaluations, works on whole arrays and ends on neighbouring numbers.
    """
    left, right = np.broadcast_arrays(np.log(low), np.log(high))
    for _ in range(64):
        middle = 0.5 * (left + right)
        beyond = function(np.exp(middle)) > 0.0
        left, right = np.where(beyond, left, middle), np.where(beyond, middle, right)
    return np.asarray(np.exp(0.5 * (left + right)))
