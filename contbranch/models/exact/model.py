"""The exact model: a parabola with Maugis-Dugdale attraction, whose equilibria are known in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import MaugisDugdale
from contbranch.contact.tips import Parabola
from contbranch.errors import InputError

if TYPE_CHECKING:
    from contbranch.models.exact.problem import ExactProblem

__all__ = ["Exact"]


@dataclass(frozen=True)
class Exact:
    """The choice of the exact model: a parabola with Maugis-Dugdale attraction, without discretisation."""

    name: ClassVar[str] = "exact"

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        if contact.body is not None:
            return "the closed form holds for a half space, not for a layered body"
        if not isinstance(contact.tip.axisymmetric, Parabola):
            shape = contact.tip.name or type(contact.tip).__name__
            return f"the closed form holds for a parabola, not for a tip of the shape {shape}"
        if not isinstance(contact.interaction, MaugisDugdale):
            law = "no interaction" if contact.interaction is None else contact.interaction.name or "another law"
            return f"the closed form holds for the law maugis-dugdale alone, not for {law}"
        if contact.interaction.work_of_adhesion <= 0.0:
            return "for repulsion the true solution has a ring of constant gap that the closed form does not contain"
        return None

    def problem(self, contact: Contact, accuracy: float) -> ExactProblem:
        """The first piece of the curve of a contact, which is exact whatever the accuracy asked for.

        Raises
        ------
        InputError
            If the model does not represent the contact; the message says why.
        """
        from contbranch.curve.problem import Work
        from contbranch.models.exact.problem import Beyond, zone_of

        obstacle = self.obstacle(contact)
        if obstacle is not None:
            raise InputError(f"model exact does not represent this contact: {obstacle}; choose axisymmetric or auto")
        return Beyond(zone_of(contact), Work())
