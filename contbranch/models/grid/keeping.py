"""Fields of the rows of a curve: in memory as far as it is theirs, beyond that in a file without name."""

from __future__ import annotations

import tempfile
import weakref
from contextlib import suppress
from typing import Any

import numpy as np

from contbranch.arrays import Array

__all__ = ["Keeping"]

# Bytes that stay in memory, and the rows that a file has room for; it is as long as what was written.
IN_MEMORY, MOST = 600e6, 4096


class Keeping:
    """Takes arrays of one length, and gives back arrays that hold the same for as long as anyone needs them."""

    def __init__(self) -> None:
        self._held, self._rows = 0.0, 0
        self._file: Any = None

    def __call__(self, values: Array) -> Array:
        """Return the values, read from the file if there are many; from memory where there is no room on the disk."""
        self._held += values.nbytes
        if self._held <= IN_MEMORY or not values.nbytes:
            return values
        with suppress(OSError):  # a full disk: they stay where they are
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115  # arrays hold on to what it has
                weakref.finalize(self, self._file.close)
                self._file.truncate(MOST * values.nbytes)
                self._map = np.memmap(self._file, np.float64, "r", shape=(MOST, values.size))
            if self._rows < MOST and values.size == self._map.shape[1]:
                self._file.seek(self._rows * values.nbytes)
                self._file.write(values.tobytes())
                self._file.flush()
                self._rows += 1
                return np.asarray(self._map[self._rows - 1])
        return values
