"""The result of following an event in a second parameter, as plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.family import dimension_of
from contbranch.errors import InputError
from contbranch.results.diagram import Cost, Event, ModelChoice
from contbranch.results.record import Record, Result, Values, described, record
from contbranch.results.table import Tables, of_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@record
class FollowedPoint(Record):
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

    def items(self) -> Values:
        """What documents hold: the parameter under its own name, too."""
        return {**super().items(), self.parameter: self.value}


@record
class Special(FollowedPoint):
    """A point of codimension two on a followed event, or an end that means something.

    Attributes
    ----------
    kind : str
        ``cusp`` (two folds merge smoothly: the parameter has an extremum), ``fold-through-touch`` (a fold passes first
        touch and goes on with, or without, contact), ``cusp-at-touch`` (a fold with and one without contact meet at
        first touch and end), ``through-touch`` (another event passes it), ``coincidence`` (load and displacement folds
        at one state), ``infinite-separation``, ``table-end`` (what lies beyond is not described), ``load-fold`` and
        ``displacement-fold`` (what a spring's fold becomes at the stiffnesses 0 and ∞), ``inadmissible``.
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


@record
class Followed(Result):
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

    format = "contbranch-follow"
    parameter: str
    curve: Mapping[str, Array]
    error: Mapping[str, Array]
    special: tuple[Special, ...]
    event: Event
    contact: Contact = described(kw_only=True)
    model: ModelChoice
    cost: Cost
    accuracy: float
    solver: Callable[[float], tuple[FollowedPoint, ...]] | None = described(
        written=False, computed=lambda followed: None, default=None
    )

    def body(self) -> Values:
        """All but the exponent of what was followed, which changes along the curve and takes long."""
        return {**self.items(), "event": self.event.brief()}

    def told(self) -> str:
        """What was followed, and how far."""
        values = self.curve[self.parameter]
        if not len(values):
            return ""
        return f"{self.event.name or self.event.kind} for {self.parameter} from {values[0]:.5g} to {values[-1]:.5g}"

    def tables(self) -> Tables:
        """The points of the curve."""
        errors = {f"{name}_error": values for name, values in self.error.items()}
        names = dict(self.unit_names)
        if self.contact is not None:  # as of a file whose law is not at hand
            with suppress(InputError):  # the parameter of a function has no unit
                names[self.parameter] = self.contact.units.name(dimension_of(self.contact, self.parameter))
        return {"point": of_columns({**self.curve, **errors}, names)}

    def at(self, value: float) -> tuple[FollowedPoint, ...]:
        """The event at exactly one value of the parameter, as often as the curve passes it: solved, not interpolated.

        Raises
        ------
        InputError
            If the curve was pickled: follow the event again.
        ModelError
            If it is not found again.
        """
        if self.solver is None:
            raise InputError("followed: it was pickled without what solves it; follow the event again")
        return self.solver(value)

    def plot(self, y: str | None = None) -> Figure:
        """Draw an observable against the parameter, special points marked; default: the displacement for folds under
        displacement control, otherwise the load."""
        from contbranch.output.plot_follow import followed_curve

        return followed_curve(self, y or ("displacement" if self.event.control == "displacement" else "load"))
