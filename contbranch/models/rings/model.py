"""Contacts that the model of discs and annuli represents from far away, and its results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from contbranch.contact import Contact
from contbranch.control import LOAD, Control
from contbranch.diagram import State
from contbranch.interactions import MaugisDugdale
from contbranch.models.outcome import RawCurve

from .journey import Target
from .solve import solve_all
from .trace import trace

__all__ = ["Rings"]

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Rings:
    """The axisymmetric model with free boundaries: any number of discs and annuli at rest, at the wall or above it."""

    name: ClassVar[str] = "axisymmetric"

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        laws = contact.interaction.terms if contact.interaction is not None else ()
        if any(isinstance(law, MaugisDugdale) and law.work_of_adhesion > 0 for law in laws):
            return (
                "the pressure of the maugis-dugdale attraction jumps at the end of its range, which only the exact "
                "model represents, for a parabola and that law alone"
            )
        if not laws:
            return "there is no interaction with which the contact could begin"
        return None

    def trace(
        self,
        contact: Contact,
        accuracy: float,
        max_load: float | None,
        progress: Progress | None = None,
        control: Control = LOAD,
    ) -> RawCurve:
        """The whole curve of a reduced contact."""
        return trace(contact, accuracy, Target(max_load), progress, control=control).curve

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
