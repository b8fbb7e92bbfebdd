"""The smallest model that represents a contact, and why it was chosen."""

from __future__ import annotations

from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.errors import InputError
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.exact.model import Exact
from contbranch.models.grid import FreeSpace, Periodic
from contbranch.models.rings import Rings

__all__ = ["Model", "choose"]

Model = Exact | Axisymmetric | Rings | Periodic | FreeSpace
NAMED: dict[str, type[Exact | Axisymmetric | Periodic | FreeSpace]] = {
    model.name: model for model in (Exact, Axisymmetric, Periodic, FreeSpace)
}


def choose(contact: Contact, model: str | Model = "auto") -> tuple[Model, str]:
    """The model for a contact and the reason, a sentence; the cell of a grid model is turned into reduced units.

    Parameters
    ----------
    contact : Contact
    model : str or model
        ``"auto"`` for the smallest that represents the contact; a name or a model object to insist on one.

    Raises
    ------
    InputError
        If the model is not known, or does not represent the contact: the message says why.
    """
    if isinstance(model, Exact | Axisymmetric | Rings | Periodic | FreeSpace):
        chosen: Model = model
    elif model == "auto" and not contact.tip.is_axisymmetric:
        grid, why = _grid_for(contact)
        return _scaled(grid, contact), why
    elif model == "auto":
        if Exact().obstacle(contact) is None:
            return Exact(), "A parabola with Maugis-Dugdale attraction is known in closed form."
        chosen = Axisymmetric()
    elif model in NAMED:
        chosen = NAMED[model]()
    else:
        raise InputError(f"model: {model!r}; must be one of auto, {', '.join(NAMED)}")
    obstacle = chosen.obstacle(contact)
    if isinstance(chosen, Axisymmetric) and obstacle is not None and Rings().obstacle(contact) is None:
        # Laws whose pressure jumps: the same model with free boundaries as unknowns.
        why = "Tip and interaction are axisymmetric; where the law's pressure jumps, the gap may rest."
        return Rings(), why if model == "auto" else "Asked for."
    if obstacle is not None:
        raise InputError(f"model: {chosen.name} does not represent this contact: {obstacle}")
    chosen = _scaled(chosen, contact)
    if model == "auto":
        return chosen, "Tip and interaction are axisymmetric; elasticity is then local in the Abel transform."
    return chosen, "Asked for."


def _scaled(model: Model, contact: Contact) -> Model:
    return model.scaled(contact) if isinstance(model, Periodic | FreeSpace) else model


def _grid_for(contact: Contact) -> tuple[Periodic | FreeSpace, str]:
    """The grid model for a tip without axial symmetry."""
    if isinstance(contact.tip, HeightMap):
        chosen: Periodic | FreeSpace = Periodic()
        why = "A map of heights has no axial symmetry: a grid, periodic as the map."
    else:
        chosen, why = FreeSpace(), "The tip has no axial symmetry: a grid, in free space."
    obstacle = chosen.obstacle(contact)
    if obstacle is not None:
        raise InputError(f"model: {chosen.name} does not represent this contact: {obstacle}")
    return chosen, why
