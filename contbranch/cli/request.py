"""What the command line asks for, as a contact and settings of a trace; every wrong value is named with its option."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from contbranch.contact.contact import Contact
from contbranch.contact.units import positive_number
from contbranch.control import Spring
from contbranch.errors import InputError
from contbranch.grid_size import GRID_MODELS, MODELS, grid_points

if TYPE_CHECKING:
    from contbranch.models.grid import FreeSpace, Periodic

__all__ = ["Request", "grid_model", "make_request"]


@dataclass(frozen=True)
class Request:
    """A contact and the settings of a computation, in the contact's units; `controlled`: the control was asked for."""

    contact: Contact
    control: str | Spring
    accuracy: float
    model: str
    max_load: float | None
    controlled: bool = True
    cell: float | None = None
    grid: int | None = None

    @property
    def chosen_model(self) -> str | Periodic | FreeSpace:
        """The model as the functions of the package take it: its name, or a grid model with its cell and grid."""
        return grid_model(self.model, self.cell, self.grid) if self.model in GRID_MODELS else self.model

    def quantity(self, text: str, dimension: str, option: str) -> float:
        """Return the value of an option: a bare number in the contact's units, or a quantity of a physical contact."""
        return self.contact.units.read(_bare(text), dimension, option)


def make_request(
    path: str | None,
    law: str | None,
    tabor: str | None,
    repulsive: bool,
    control: str | None,
    accuracy: str | None,
    model: str | None,
    cell: str | None,
    grid: str | None,
) -> Request:
    """Return the request of the options shared by all commands; None: not given, taken from the file or its default.

    Raises
    ------
    InputError
        If neither or both of a contact file and a law are given, or any value is wrong.
    """
    contact, settings = _contact(path, law, tabor, repulsive)
    given = {"control": control, "accuracy": None if accuracy is None else _bare(accuracy), "model": model}
    chosen = settings | {name: value for name, value in given.items() if value is not None}
    name = _choice(chosen.get("model", "auto"), MODELS, "--model")
    if cell is not None:
        _needs_grid(name, "--cell", "add --model")
        chosen["cell"] = positive_number(contact.units.read(_bare(cell), "length", "--cell"), "--cell")
    if grid is not None:
        _needs_grid(name, "--grid", "add --model")
        chosen["grid"] = grid_points(grid, "--grid")
    if model is not None and name not in GRID_MODELS:  # the option has put the file's model aside, with its cell
        chosen = {key: value for key, value in chosen.items() if key not in ("cell", "grid")}
    for key in ("cell", "grid"):
        if key in chosen:
            _needs_grid(name, f"trace.{key}", "write model =")
    return Request(
        contact=contact,
        control=_control(chosen.get("control", "load"), contact),
        accuracy=positive_number(_number(chosen.get("accuracy", 1e-6), "--accuracy"), "--accuracy"),
        model=name,
        max_load=settings.get("max_load"),
        controlled="control" in chosen,
        cell=chosen.get("cell"),
        grid=chosen.get("grid"),
    )


def grid_model(name: str, cell: float | None, grid: int | None) -> Periodic | FreeSpace:
    """Return the model of a cell called ``"periodic"`` or ``"free"``.

    Parameters
    ----------
    name
        ``"periodic"`` or ``"free"``.
    cell
        Edge of the cell in the contact's unit of length; None: chosen from the accuracy.
    grid
        Nodes along it; None: chosen from the accuracy.
    """
    from contbranch.models.grid import FreeSpace, Periodic  # heavy, and only for these models

    return (Periodic if name == "periodic" else FreeSpace)(cell=cell, grid=grid)


def _needs_grid(model: str, field: str, remedy: str) -> None:
    if model not in GRID_MODELS:
        raise InputError(f"{field}: the model {model} has none; {remedy} {' or '.join(GRID_MODELS)}, or leave it out")


def _contact(path: str | None, law: str | None, tabor: str | None, repulsive: bool) -> tuple[Contact, dict[str, Any]]:
    """Return the contact, and the settings of its file."""
    if path is not None:
        for option, given in (("--interaction", law), ("--tabor", tabor), ("--repulsive", repulsive or None)):
            if given is not None:
                raise InputError(f"CONTACT, {option}: give a contact file or --interaction and --tabor, not both")
        from contbranch.contact.file import read_contact

        contact, settings = read_contact(path)
        return contact, dict(settings)
    if law is None:
        raise InputError("CONTACT: missing; give a contact file, or --interaction NAME --tabor X")
    if tabor is None:
        raise InputError("--tabor: missing; give the Tabor coefficient of the interaction, a number above zero")
    value = positive_number(_number(_bare(tabor), "--tabor"), "--tabor")
    try:
        return Contact.reduced(law, tabor=value, sign=-1 if repulsive else 1), {}
    except InputError as error:
        raise InputError(f"--{error}") from None  # the field has the name of its option


def _bare(text: str) -> float | str:
    """Return a text that is only a number as a float, and any other as it is."""
    try:
        return float(text)
    except ValueError:
        return text


def _number(value: object, option: str) -> object:
    if isinstance(value, str):
        raise InputError(f"{option}: {value!r}; must be a number")
    return value


def _control(value: object, contact: Contact) -> str | Spring:
    """Return "load", "displacement" or a spring; a number is the stiffness of a spring, from a contact file."""
    from contbranch.contact.file import parse_control

    parsed = value if isinstance(value, float) else parse_control(value, contact.units, "--control")
    return Spring(parsed) if isinstance(parsed, float) else parsed


def _choice(value: object, known: tuple[str, ...], option: str) -> str:
    if value not in known:
        raise InputError(f"{option}: {value!r} is not available; choose {', '.join(known[:-1])} or {known[-1]}")
    return str(value)
