"""Tables as CSV: a header of names with units, every digit of the numbers."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from contbranch.errors import InputError

__all__ = ["write_csv"]


def write_csv(path: str | Path, columns: Mapping[str, Sequence[Any] | Any]) -> None:
    """Write columns of one length, by their headings; what is missing stays empty.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    listed = [column.tolist() if hasattr(column, "tolist") else list(column) for column in columns.values()]
    try:
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*listed, strict=True))
    except OSError as error:
        raise InputError(f"path: '{path}' cannot be written ({error.strerror}); give a writable file") from None
