"""The exact model: a parabola with Maugis-Dugdale attraction in closed form, and tips on layers without interaction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import MaugisDugdale
from contbranch.contact.tips import Parabola
from contbranch.errors import InputError

if TYPE_CHECKING:
    from contbranch.curve.problem import EquilibriumProblem

__all__ = ["Exact"]


@dataclass(frozen=True)
class Exact:
    """The choice of the exact model: without discretisation along the surface.

    It has a parabola with Maugis-Dugdale attraction on a half space, and any axisymmetric tip without interaction on a
    layered body.
    """

    name: ClassVar[str] = "exact"

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        if contact.body is not None:
            if contact.interaction is not None:
                return "on a layered body an interaction needs a grid"
            return None if contact.tip.is_axisymmetric else "the tip is not axisymmetric"
        if not isinstance(contact.tip.axisymmetric, Parabola):
            shape = contact.tip.name or type(contact.tip).__name__
            return f"the closed form holds for a parabola, not for a tip of the shape {shape}"
        if not isinstance(contact.interaction, MaugisDugdale):
            law = "no interaction" if contact.interaction is None else contact.interaction.name or "another law"
            return f"the closed form holds for the law maugis-dugdale alone, not for {law}"
        if contact.interaction.work_of_adhesion <= 0.0:
            return "for repulsion the true solution has a ring of constant gap that the closed form does not contain"
        return None

    def reason(self, contact: Contact) -> str:
        """Why it represents a contact."""
        if contact.body is not None:
            return "A tip on a layered body without interaction: one integral equation on the contact."
        return "A parabola with Maugis-Dugdale attraction is known in closed form."

    def problem(self, contact: Contact, accuracy: float) -> EquilibriumProblem:
        """The first piece of the curve of a contact, which is exact whatever the accuracy asked for.

        Raises
        ------
        InputError
            If the model does not represent the contact; the message says why.
        """
        from contbranch.curve.problem import Work
        from contbranch.models.exact.layer import Above
        from contbranch.models.exact.problem import Beyond, zone_of

        obstacle = self.obstacle(contact)
        if obstacle is not None:
            raise InputError(f"model exact does not represent this contact: {obstacle}; choose axisymmetric or auto")
        return Beyond(zone_of(contact), Work()) if contact.body is None else Above(contact, Work())
