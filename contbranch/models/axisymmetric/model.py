"""The axisymmetric model: which contacts it represents, and its results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import MaugisDugdale
from contbranch.control import LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.results.diagram import State

from .azimuthal import LARGEST_MODE
from .solve import find_all, solve_all
from .trace import Target, trace

__all__ = ["Axisymmetric"]

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Axisymmetric:
    """The axisymmetric model: Abel transforms on adaptive panels, errors measured on finer ones."""

    name: ClassVar[str] = "axisymmetric"

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        if not contact.tip.is_axisymmetric:
            return f"a tip of the shape {contact.tip.name or type(contact.tip).__name__} is not axisymmetric"
        laws = contact.interaction.terms if contact.interaction is not None else ()
        if any(isinstance(law, MaugisDugdale) for law in laws):
            if any(isinstance(law, MaugisDugdale) and law.work_of_adhesion < 0 for law in laws):
                return (
                    "the repulsive maugis-dugdale law has a ring on which the gap stays at the range of the law, a "
                    "second kind "
                    "of contact with an inequality of its own, which is not available yet"
                )
            return (
                "the pressure of the maugis-dugdale law jumps at the end of its range, which smooth "
                "panels cannot represent"
            )
        return None

    def trace(
        self,
        contact: Contact,
        accuracy: float,
        max_load: float | None,
        progress: Progress | None = None,
        control: Control = LOAD,
        modes: int = LARGEST_MODE,
    ) -> RawCurve:
        """The whole curve of a reduced contact."""
        return trace(contact, accuracy, Target(max_load), progress, control=control, modes=modes).curve

    def solve(
        self,
        contact: Contact,
        field: str,
        value: float,
        accuracy: float,
        progress: Progress | None = None,
        control: Control = LOAD,
    ) -> tuple[list[State], RawCurve]:
        """Every equilibrium of a reduced contact with a given load, displacement or contact radius."""
        states, traced = solve_all(contact, field, value, accuracy, progress, control)
        return states, traced.curve

    def find_all(
        self,
        contact: Contact,
        field: str,
        value: float,
        accuracy: float,
        window: tuple[float, float] | None,
        progress: Progress | None = None,
        control: Control = LOAD,
    ) -> tuple[list[State], list[bool], tuple[float, float], RawCurve]:
        """Every equilibrium with a load or displacement, which of them lie on the curve, and the window used."""
        states, connected, used, traced = find_all(contact, field, value, accuracy, window, progress, control)
        return states, connected, used, traced.curve
