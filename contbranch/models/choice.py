"""The smallest model that represents a contact, why it was chosen, and the curves that it gives."""

from __future__ import annotations

from contbranch.contact.contact import Contact
from contbranch.contact.height_map import HeightMap
from contbranch.curve.curves import FollowedCurves, Model
from contbranch.errors import InputError
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.exact.model import Exact
from contbranch.models.grid import FreeSpace, Periodic

__all__ = ["choose", "curves", "on_grid"]

Lattice = Periodic | FreeSpace
NAMED: dict[str, type[Exact | Axisymmetric | Lattice]] = {
    model.name: model for model in (Exact, Axisymmetric, Periodic, FreeSpace)
}


def choose(contact: Contact, model: str | Model | Lattice = "auto") -> tuple[Model | Lattice, str]:
    """The model for a contact and the reason, a sentence.

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
    if model == "auto":
        return _smallest(contact)
    if isinstance(model, str) and model in NAMED:
        chosen: Model | Lattice = NAMED[model]()
    elif isinstance(model, str) or not hasattr(model, "name"):
        raise InputError(f"model: {model!r}; must be one of auto, {', '.join(NAMED)}")
    else:
        chosen = model
    told = getattr(chosen, "obstacle", None)
    obstacle = None if told is None else told(contact)
    if obstacle is not None:
        raise InputError(f"model: {chosen.name} does not represent this contact: {obstacle}")
    return chosen, "Asked for."


def curves(contact: Contact, model: Model | Lattice) -> FollowedCurves:
    """The curves of a contact by a model: on a lattice, or of its equilibrium problem."""
    if not isinstance(model, Lattice):
        return FollowedCurves(contact, model)
    from contbranch.models.grid import LatticeCurves

    return LatticeCurves(contact, model)


def on_grid(model: Model | Lattice) -> bool:
    """Whether a model is one of lattices, whose events cannot be followed."""
    return isinstance(model, Lattice)


def _smallest(contact: Contact) -> tuple[Model | Lattice, str]:
    """The smallest model that represents a contact."""
    if isinstance(contact.tip, HeightMap):
        return Periodic(), "A map of heights has no axial symmetry: a grid, periodic as the map."
    if not contact.tip.is_axisymmetric:
        return FreeSpace(), "The tip has no axial symmetry: a grid, in free space."
    if Exact().obstacle(contact) is None:
        return Exact(), "A parabola with Maugis-Dugdale attraction is known in closed form."
    obstacle = Axisymmetric().obstacle(contact)
    if obstacle is not None and contact.body is not None:
        return FreeSpace(), f"A grid, in free space: {obstacle}."
    if obstacle is not None:
        raise InputError(f"model: {Axisymmetric.name} does not represent this contact: {obstacle}")
    return Axisymmetric(), "Tip and interaction are axisymmetric; elasticity is then local in the Abel transform."
