"""`phase_diagram`: regions of a parameter and a control, whatever the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from contbranch.contact.contact import Contact
from contbranch.contact.family import Vary, family_of
from contbranch.control import as_control
from contbranch.curve.phase import Regions
from contbranch.errors import InputError
from contbranch.models.run import trace
from contbranch.results.diagram import Diagram
from contbranch.results.phase import PhaseDiagram

__all__ = ["phase_diagram"]

Progress = Callable[[float, str], None]


def phase_diagram(
    contact: Contact,
    vary: Vary = "tabor",
    between: Sequence[float] = (0.25, 4.0),
    control: str = "load",
    *,
    start: float | None = None,
    samples: int = 17,
    accuracy: float = 1e-6,
    progress: Progress | None = None,
) -> PhaseDiagram:
    """Find the regions of a parameter and a control by the number and kind of stable states.

    The contact is traced at values of the parameter; every fold of the control and every first touch met there is
    followed to both ends, unless it lies on a curve that is known. Folds that appear and vanish between neighbouring
    values are missed: ask for more samples.

    Parameters
    ----------
    contact : Contact
    vary : str or callable
        As for `follow`, apart from a stiffness.
    between : pair of floats
        Values of the parameter.
    control : {"load", "displacement"}
    start : float, optional
        Present value of the parameter of a function.
    samples : int
        Values at which the contact is traced, at least 3.
    accuracy : float
        Of the boundaries, as for `follow`.

    Returns
    -------
    PhaseDiagram

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    kind = as_control(control).kind
    if kind == "spring" or vary == "stiffness":
        raise InputError("control: a spring; phase diagrams are for load and displacement control")
    if len(between) != 2 or not between[0] < between[1]:
        raise InputError(f"between: {tuple(between)}; give two values, the lower one first")
    if samples < 3:
        raise InputError(f"samples: {samples}; must be at least 3")
    if contact.tip.axisymmetric is None:
        raise InputError("contact: its tip needs a grid; phase diagrams are made of curves that grids cannot follow")
    family = family_of(contact, vary, between[0], start)
    low, high = map(float, between)
    if family.spacing == "logarithmic" and low * high <= 0:
        raise InputError(f"between: {tuple(between)}; both must have the sign of the present {family.name}")

    def traced(member: Contact) -> Diagram:
        return trace(member, control=kind, accuracy=max(accuracy, 1e-5))

    return Regions(family, kind, (low, high), accuracy, traced).find(samples, progress)
