"""Types of arrays, and what JSON holds of them and of anything else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]
AnyArray = NDArray[Any]
# Arrays of one length by name.
Columns = Mapping[str, AnyArray]


def magnitude(values: Array) -> float:
    """The largest absolute value; 0 of none."""
    return float(np.abs(values).max(initial=0.0))


def plain(value: Any) -> Any:
    """Return a value, with all that it holds, as JSON can hold it: None in place of NaN and infinity.

    Results are what their documents hold, what JSON cannot hold is its representation.
    """
    if hasattr(value, "body"):
        return plain(value.body())
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if hasattr(value, "items"):  # of a mapping, or of a record
        return {str(key): plain(item) for key, item in dict(value.items()).items()}
    if isinstance(value, np.ndarray | np.generic):
        listed = value.tolist()
        return plain(listed) if value.dtype.kind == "f" and not np.isfinite(value).all() else listed
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else repr(value)
