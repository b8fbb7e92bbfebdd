"""Numbers of nodes along the edge of a cell: which are possible, and which are fast to transform."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from contbranch.errors import InputError

LEAST_GRID = 8
GRID_MODELS = ("periodic", "free")
MODELS = ("auto", "exact", "axisymmetric", *GRID_MODELS)


def named_model(name: str, cell: float | None = None, grid: int | None = None) -> Any:
    """Return a model as computations take it: its name, or a grid model with its cell and grid."""
    if name not in GRID_MODELS:
        return name
    from contbranch.models.grid import FreeSpace, Periodic  # heavy, and only for these models

    return (Periodic if name == "periodic" else FreeSpace)(cell=cell, grid=grid)


def nearest_fast(n: float) -> int:
    """Return the even number without prime factors above 7, at least 8, that is nearest to `n`; of two the larger."""
    start = max(LEAST_GRID, 2 * round(n / 2))
    for distance in range(0, start, 2):
        for candidate in (start + distance, start - distance):
            if candidate >= LEAST_GRID and _fast(candidate):
                return candidate
    return LEAST_GRID


def _fast(n: int) -> bool:
    for prime in (2, 3, 5, 7):
        while n % prime == 0:
            n //= prime
    return n == 1


def grid_points(value: object, field: str) -> int:
    """Return a number of nodes: whole, even and at least 8; a transform is fast if its prime factors are small.

    Parameters
    ----------
    value
        A number, or the text of one.
    field
        The name of the field, for messages.

    Raises
    ------
    InputError
        If it is none; the message suggests the nearest number that is fast to transform.
    """
    number = math.nan
    with suppress(TypeError, ValueError):
        if not isinstance(value, bool):
            value = number = float(value)  # type: ignore[arg-type]
    if not math.isfinite(number):
        raise InputError(f"{field}: {value!r}; must be a whole number of nodes, for example 256")
    if number != int(number) or number < LEAST_GRID or int(number) % 2:
        raise InputError(
            f"{field}: {number:g}; must be a whole and even number of nodes, at least {LEAST_GRID}, best without prime "
            f"factors above 7: for example {nearest_fast(number)}"
        )
    return int(number)
