"""The smallest model that represents a contact, and why it was chosen."""

from __future__ import annotations

from contbranch.contact import Contact
from contbranch.errors import InputError

from .axisymmetric import Axisymmetric
from .exact import Exact
from .rings import Rings

__all__ = ["Model", "choose"]

Model = Exact | Axisymmetric | Rings
MODELS: dict[str, type[Exact] | type[Axisymmetric]] = {"exact": Exact, "axisymmetric": Axisymmetric}


def choose(contact: Contact, model: str | Model = "auto") -> tuple[Model, str]:
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
    if isinstance(model, Exact | Axisymmetric | Rings):
        chosen: Model = model
    elif model == "auto":
        if Exact().obstacle(contact) is None:
            return Exact(), "A parabola with Maugis-Dugdale attraction is known in closed form."
        chosen = Axisymmetric()
    elif model in MODELS:
        chosen = MODELS[model]()
    else:
        raise InputError(f"model: {model!r}; must be one of auto, {', '.join(MODELS)}")
    obstacle = chosen.obstacle(contact)
    if isinstance(chosen, Axisymmetric) and obstacle is not None and Rings().obstacle(contact) is None:
        # Laws whose pressure jumps: the same model with free boundaries as unknowns.
        why = "Tip and interaction are axisymmetric; where the law's pressure jumps, the gap may rest."
        return Rings(), why if model == "auto" else "Asked for."
    if obstacle is not None:
        raise InputError(f"model: {chosen.name} does not represent this contact: {obstacle}")
    if model == "auto":
        return chosen, "Tip and interaction are axisymmetric; elasticity is then local in the Abel transform."
    return chosen, "Asked for."
