"""What reduced units are worth in a contact's own."""

from typing import NamedTuple

__all__ = ["REDUCED_VALUES", "UnitValues"]


class UnitValues(NamedTuple):
    """One reduced unit of length in plane and along the normal, and of load, in a contact's own units."""

    in_plane: float
    normal: float
    load: float

    def of(self, field: str) -> float:
        """The unit of a load or displacement."""
        return self.load if field == "load" else self.normal


REDUCED_VALUES = UnitValues(1.0, 1.0, 1.0)
