"""The result of following an event in a second parameter, as plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from contbranch.contact.contact import Contact
from contbranch.results.diagram import Cost, Event, ModelChoice

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Followed", "FollowedPoint", "Special"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FollowedPoint:
    """An event at one value of a parameter; every number is in the contact's units.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    value : float
        Its value.
    load, displacement, contact_radius, central_gap : float
    error : mapping
        Error estimates of the four and, under its name, of the parameter.
    """

    parameter: str
    value: float
    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    error: Mapping[str, float]


@dataclass(frozen=True)
class Special(FollowedPoint):
    """A point of codimension two on a followed event, or an end that means something.

    Attributes
    ----------
    kind : str
        ``cusp`` (two folds merge smoothly: the parameter has an extremum), ``fold-through-touch`` (a fold passes first
        touch and goes on with, or without, contact), ``cusp-at-touch`` (a fold with and one without contact meet at
        first touch and end), ``through-touch`` (another event passes it), ``coincidence`` (load and displacement folds
        at one state), ``infinite-separation``, ``load-fold`` and ``displacement-fold`` (what a spring's fold becomes at
        the stiffnesses 0 and ∞), ``inadmissible``.
    index : int
        Its place among the curve's points.
    control : str or None
        Control of a fold that a followed first touch meets here.
    message : str
    """

    kind: str = ""
    index: int = 0
    control: str | None = None
    message: str = ""


@dataclass(frozen=True)
class Followed:
    """An event along a parameter.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    curve : mapping of arrays (M,)
        The parameter under its name, and ``load``, ``displacement``, ``contact_radius``, ``central_gap``, in the order
        of the curve, which begins at the event (or, followed both ways, at the end with the lower value). It need not
        be monotone: past a cusp it goes on as the other fold.
    error : mapping of arrays (M,)
        Error estimates of the four.
    special : tuple of Special
        Special points in the order of the curve.
    event : Event
        What was followed.
    """

    parameter: str
    curve: Mapping[str, Array]
    error: Mapping[str, Array]
    special: tuple[Special, ...]
    event: Event
    contact: Contact
    model: ModelChoice
    cost: Cost
    accuracy: float
    status: Literal["complete", "incomplete"] = "complete"
    message: str = ""
    unit_names: Mapping[str, str] = field(default_factory=dict)
    solver: Callable[[float], tuple[FollowedPoint, ...]] | None = field(default=None, repr=False)

    def at(self, value: float) -> tuple[FollowedPoint, ...]:
        """The event at exactly one value of the parameter, as often as the curve passes it: solved, not interpolated.

        Raises
        ------
        ModelError
            If it is not found again.
        """
        assert self.solver is not None
        return self.solver(value)

    def plot(self, y: str | None = None) -> Figure:
        """Draw an observable against the parameter, special points marked; default: the displacement for folds under
        displacement control, otherwise the load."""
        from contbranch.output.plot_follow import followed_curve

        return followed_curve(self, y or ("displacement" if self.event.control == "displacement" else "load"))

    def document(self) -> dict[str, Any]:
        """Return the JSON document, format ``contbranch-follow``."""
        from contbranch.output.document_follow import follow_document

        return follow_document(self)
