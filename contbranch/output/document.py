"""JSON documents of results: plain dictionaries, in the units of the contact, with null for what does not exist."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from contbranch.results.record import Record, Result, Values

VERSION = 1


def document(result: Result) -> Values:
    """Return a result as a JSON-able dictionary: format and version, contact, units, and what the result describes.

    Numbers are in the contact's units (`units`, `unit_names`); NaN and infinity become None.
    """
    return {**head(result), **plain(result.body())}


def head(result: Result) -> Values:
    """What every document begins with: its format, the contact, and the unit of every quantity if it is physical."""
    contact: Any = getattr(result, "contact", None)
    described = getattr(result, "description", None) or ({} if contact is None else contact.describe())
    names = dict(result.units)
    units = {"units": "physical", "unit_names": names} if names else {"units": "reduced"}
    return {"format": result.format, "version": VERSION, "contact": plain(described), **units}


def plain(value: Any) -> Any:
    """Return a value, with all that it holds, as JSON can hold it: None in place of NaN and infinity."""
    if isinstance(value, Result):
        return plain(value.body())
    if isinstance(value, Record):
        return plain(value.items())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        listed = value.tolist()
        return plain(listed) if value.dtype.kind == "f" and not np.isfinite(value).all() else listed
    if isinstance(value, np.generic):
        return plain(value.item())
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)
