"""The axisymmetric model: which contacts it represents, and its equilibria."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import MaugisDugdale

from .problem import ROW_SAFETY, ContactProblem, first_problem

__all__ = ["Axisymmetric"]

# Meshes of a trace need not be as fine as those of its events, which are located anew; coarser ones than the second
# show events that are none, and hide others.
TRACE_TOLERANCE, COARSEST = 1e-6, 1e-5

# Share of the energy per area out to which curves begin, and how many thicknesses of a layer that may be: the layer's
# response is resolved as far, and takes a minute from there on.
FELT, THINNEST = 1e-9, 30.0


@dataclass(frozen=True)
class Axisymmetric:
    """The axisymmetric model: Abel transforms on adaptive panels, errors measured on finer ones."""

    name: ClassVar[str] = "axisymmetric"

    def obstacle(self, contact: Contact) -> str | None:
        """Return why the model does not represent a contact, as the end of a sentence, or None if it does."""
        if not contact.tip.is_axisymmetric:
            return f"a tip of the shape {contact.tip.name or type(contact.tip).__name__} is not axisymmetric"
        steps = [law.work_of_adhesion for law in terms_of(contact.interaction) if isinstance(law, MaugisDugdale)]
        if contact.body is not None and contact.interaction is not None:
            if steps:
                return "a law whose pressure jumps needs a grid on a layered body"
            reach = contact.axisymmetric_tip.radius_at(contact.interaction.reach(FELT))
            if reach > THINNEST * contact.body.thickness:
                thicknesses = f"{reach / contact.body.thickness:.3g} thicknesses"
                return f"the interaction reaches out to {thicknesses} of the layer, which needs a grid"
        if steps and min(steps) < 0.0 < max(steps):
            return "maugis-dugdale laws that attract and such that repel cannot be added"
        return None

    def problem(self, contact: Contact, accuracy: float) -> ContactProblem:
        """The equilibria of a reduced contact: the problem at which its curve starts."""
        return first_problem(contact, accuracy, min(max(TRACE_TOLERANCE, accuracy), COARSEST) / ROW_SAFETY)
