"""Contacts that the model of discs and annuli represents from far away, and its results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import MaugisDugdale

if TYPE_CHECKING:
    from .problem import RingProblem

__all__ = ["Rings"]


@dataclass(frozen=True)
class Rings:
    """The axisymmetric model with free boundaries: any number of discs and annuli at rest, at the wall or above it."""

    name: ClassVar[str] = "axisymmetric"

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        if not contact.tip.is_axisymmetric:
            return f"a tip of the shape {contact.tip.name or type(contact.tip).__name__} is not axisymmetric"
        laws = terms_of(contact.interaction)
        if any(isinstance(law, MaugisDugdale) and law.work_of_adhesion > 0 for law in laws):
            return "maugis-dugdale laws that attract and such that repel cannot be added"
        if not laws:
            return "there is no interaction with which the contact could begin"
        return None

    def problem(self, contact: Contact, accuracy: float) -> RingProblem:
        """The first problem of a reduced contact's curve, with nothing at rest."""
        from .equations import Setting
        from .law import BandedLaw
        from .problem import RingProblem
        from .start import distance, floating

        setting = Setting(contact.axisymmetric_tip, BandedLaw(contact.interaction), accuracy)
        return RingProblem(setting, *floating(setting, distance(setting)))
