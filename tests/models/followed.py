"""Curves of the axisymmetric model with the problems that solved their rows."""

from __future__ import annotations

from contbranch.contact.contact import Contact
from contbranch.control import LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.models.axisymmetric import Axisymmetric


def tracked(contact: Contact, accuracy: float) -> Track:
    """Rows of a reduced contact's curve without its modes, and without what is made of them: events are not located."""
    return trace(Axisymmetric().problem(contact, accuracy), Request(accuracy, modes=0))


class Followed:
    """Rows (points, each with its problem) and the raw result of a reduced contact's curve."""

    def __init__(self, contact, accuracy: float, tolerance: float | None = None, control: Control = LOAD, **asked):
        problem = Axisymmetric().problem(contact, accuracy)
        if tolerance is not None:
            problem = problem.rows_within(tolerance)
        request = Request(accuracy, control, **asked)
        self.track: Track = trace(problem, request)
        self.curve: RawCurve = raw_curve(self.track, request)
        self.points = self.track.points
        self.problem = self.track.problem
