"""Checks of what the closed forms are given."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.errors import InputError


def finite(field: str, value: ArrayLike) -> Array:
    """Return ``value`` as an array of floats, or raise `InputError` where it is not a finite number."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{field} must be a number or an array of numbers, not {value!r}") from None
    if not np.all(np.isfinite(array)):
        raise InputError(f"{field} must be finite, not {array[~np.isfinite(array)].flat[0]}")
    return array


def positive(field: str, value: ArrayLike) -> Array:
    """Return ``value`` as an array of floats, or raise `InputError` where it is not finite and greater than zero."""
    array = finite(field, value)
    if np.any(array <= 0.0):
        raise InputError(f"{field} must be greater than 0, not {array[array <= 0.0].flat[0]}")
    return array


def not_below(field: str, value: ArrayLike, lowest: ArrayLike, why: str) -> Array:
    """Return ``value`` as an array of floats, or raise `InputError` where it is less than ``lowest``.

    A value below by no more than rounding is taken for the lowest itself, so that a fold computed here can be passed
    back.
    """
    array, bound = np.broadcast_arrays(finite(field, value), np.asarray(lowest, dtype=float))
    slack = 8.0 * np.finfo(float).eps * np.abs(bound)
    low = array < bound - slack
    if np.any(low):
        raise InputError(f"{field} must be at least {bound[low].flat[0]:.12g} ({why}), not {array[low].flat[0]}")
    return np.asarray(np.maximum(array, bound))


def not_negative(field: str, value: ArrayLike) -> Array:
    """Return ``value`` as an array of floats, or raise `InputError` where it is negative."""
    return not_below(field, value, 0.0, "it is a length")
