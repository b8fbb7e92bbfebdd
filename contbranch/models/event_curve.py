"""What every model hands over of a followed event, in the contact's own units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Four", "RawEventCurve", "RawPoint", "RawSpecial"]

Four = tuple[float, float, float, float]


@dataclass(frozen=True)
class RawPoint:
    """The event at one value of the parameter.

    Attributes
    ----------
    value : float
        Of the parameter.
    numbers, error : tuple of four floats
        Load, displacement, contact radius, central gap, and their error estimates.
    """

    value: float
    numbers: Four
    error: Four


@dataclass(frozen=True)
class RawSpecial:
    """A point of codimension two, or an end that says something.

    Attributes
    ----------
    index : int
        Its place among the curve's points.
    value_error : float
        Error estimate of the parameter.
    control : str or None
        Control of the fold that meets the event here, where it is another one's.
    """

    kind: str
    index: int
    point: RawPoint
    value_error: float
    control: str | None = None
    message: str = ""


@dataclass(frozen=True)
class RawEventCurve:
    """The event along the parameter.

    Attributes
    ----------
    points : tuple of RawPoint
    special : tuple of RawSpecial
    at : callable
        All points of the curve at a value of the parameter.
    start : int
        Place of the event that was followed among the points.
    """

    points: tuple[RawPoint, ...]
    special: tuple[RawSpecial, ...]
    at: Callable[[float], list[RawPoint]]
    complete: bool
    message: str
    newton: int
    unknowns: int
    start: int = 0
