"""JSON documents of results: plain dictionaries, in the units of the contact, with null for what does not exist."""

from __future__ import annotations

from contbranch.arrays import plain
from contbranch.results.record import Result, Values

VERSION = 1


def document(result: Result) -> Values:
    """Return a result as a JSON-able dictionary: format and version, contact, units, and what the result describes.

    Numbers are in the contact's units (`units`, `unit_names`); NaN and infinity become None.
    """
    return {**head(result), **plain(result.body())}


def head(result: Result) -> Values:
    """What every document begins with: its format, the contact, and the unit of every quantity if it is physical."""
    contact = result.contact
    described = getattr(result, "description", None) or ({} if contact is None else contact.describe())
    names = dict(result.units)
    units = {"units": "physical", "unit_names": names} if names else {"units": "reduced"}
    return {"format": result.format, "version": VERSION, "contact": plain(described), **units}
