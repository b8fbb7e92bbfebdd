"""Types of arrays."""

from __future__ import annotations

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
