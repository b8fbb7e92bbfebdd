"""What the command line asks for, as a contact and settings of a trace; every wrong value is named with its option."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from optparse import Values
from typing import TYPE_CHECKING, Any

from contbranch.contact.contact import Contact
from contbranch.contact.family import dimension_of
from contbranch.contact.parameters import read_quantities
from contbranch.contact.units import positive_number
from contbranch.control import as_control
from contbranch.errors import InputError, nearest
from contbranch.grid_size import GRID_MODELS, MODELS, grid_points, named_model

if TYPE_CHECKING:
    from contbranch.results.diagram import Diagram, Event


_LOWEST = ("pull-off", "wetting")


@dataclass(frozen=True)
class Request:
    """A contact and the settings of a computation, in the contact's units.

    `controlled`: the control was asked for; `notes`: what the user is told besides the result.
    """

    contact: Contact
    control: Any
    accuracy: float
    model: Any
    max_load: float | None
    controlled: bool = True
    notes: list[str] = field(default_factory=list)

    def quantity(self, text: str, dimension: str, option: str) -> float:
        """Return the value of an option: a bare number in the contact's units, or a quantity of a physical contact."""
        value = _bare(text)
        unit = self.contact.units.name(dimension)
        if unit and isinstance(value, float):
            self.notes.append(f"{option} {text}: taken as {unit}; write '{text} {unit}'")
        return self.contact.units.read(value, dimension, option)

    def limit(self, max_load: str | None) -> float | None:
        """The largest load, from the option or the contact file; None for the default."""
        return self.max_load if max_load is None else self.quantity(max_load, "force", "--max-load")


def make_request(asked: Values) -> Request:
    """Return the request of the options shared by all commands; None: not given, taken from the file or its default.

    Raises
    ------
    InputError
        If neither or both of a contact file and a law are given, or any value is wrong.
    """
    contact, settings = _contact(asked)
    given = {"control": asked.control, "accuracy": asked.accuracy and _bare(asked.accuracy), "model": asked.model}
    chosen = settings | {name: value for name, value in given.items() if value is not None}
    name = chosen.get("model", "auto")
    if name not in MODELS:
        raise InputError(f"--model: {name!r} is not available; choose {', '.join(MODELS[:-1])} or {MODELS[-1]}")
    for key in ("cell", "grid"):
        option = getattr(asked, key) is not None
        if asked.model is not None and not option and name not in GRID_MODELS:
            chosen.pop(key, None)  # the option puts the file's model aside, with its cell
        if name not in GRID_MODELS and (option or key in chosen):
            field, remedy = (f"--{key}", "add --model") if option else (f"trace.{key}", "write model =")
            remedy = f"{remedy} {' or '.join(GRID_MODELS)}, or leave it out"
            raise InputError(f"{field}: the model {name} has none; {remedy}")
    if asked.cell is not None:
        chosen["cell"] = positive_number(contact.units.read(_bare(asked.cell), "length", "--cell"), "--cell")
    if asked.grid is not None:
        chosen["grid"] = grid_points(asked.grid, "--grid")
    return Request(
        contact=contact,
        control=as_control(chosen.get("control", "load"), contact.units, "--control"),
        accuracy=positive_number(chosen.get("accuracy", 1e-6), "--accuracy"),
        model=named_model(name, chosen.get("cell"), chosen.get("grid")),
        max_load=settings.get("max_load"),
        controlled="control" in chosen,
        notes=asked.notes,
    )


def _contact(asked: Values) -> tuple[Contact, dict[str, Any]]:
    """Return the contact, and the settings of its file."""
    if asked.source is not None:
        for option in ("interaction", "tabor", "repulsive"):
            if getattr(asked, option):
                raise InputError(f"CONTACT, --{option}: give a contact file or --interaction and --tabor, not both")
        from contbranch.contact.file import read_contact

        return read_contact(asked.source)
    if asked.interaction is None:
        raise InputError("CONTACT: missing; give a contact file, or --interaction NAME --tabor X")
    if asked.tabor is None:
        raise InputError("--tabor: missing; give the Tabor coefficient of the interaction, a number above zero")
    value = positive_number(_bare(asked.tabor), "--tabor")
    try:
        return Contact.reduced(asked.interaction, tabor=value, sign=-1 if asked.repulsive else 1), {}
    except InputError as error:
        raise InputError(f"--{error}") from None  # the field has the name of its option


def seconds(text: str) -> float:
    """Return the value of --time-limit."""
    return positive_number(_bare(text), "--time-limit")


def whole_number(text: str, option: str) -> int:
    """Return the value of an option that counts something."""
    if not text.isdecimal() or int(text) < 1:
        raise InputError(f"{option}: {text!r}; must be a whole number, 1 or greater")
    return int(text)


def _bare(text: str) -> float | str:
    """Return a text that is only a number as a float, and any other as it is."""
    try:
        return float(text)
    except ValueError:
        return text


def parse_uncertainties(texts: Sequence[str], request: Request) -> dict[str, float]:
    """Return the standard uncertainties of ``NAME=X``, by parameter, in the contact's units.

    Raises
    ------
    InputError
        If a text is none.
    """
    pairs = [text.partition("=") for text in texts]
    for text, (name, _, value) in zip(texts, pairs, strict=True):
        if not (name.strip() and value.strip()):
            raise InputError(f"--uncertainty: {text!r}; write NAME=X, for example range=0.1nm")
    given: dict[str, str] = {}
    for name, _, value in pairs:
        if name.strip() in given:
            raise InputError(f"--uncertainty: {name.strip()} is given twice; give it once")
        given[name.strip()] = value.strip()
    return read_quantities(request.contact, given, "--uncertainty")


# What is followed, and where


def parse_vary(text: str, request: Request) -> tuple[str, tuple[float, ...]]:
    """Return the parameter of ``NAME=A:B`` or ``NAME=B`` and its values, in the contact's units.

    Raises
    ------
    InputError
        If the text is none.
    """
    name, equals, rest = text.partition("=")
    name, values = name.strip(), [part.strip() for part in rest.split(":")]
    if not (name and equals) or not 1 <= len(values) <= 2 or not all(values):
        raise InputError(f"--vary: {text!r}; write NAME=FROM:TO or NAME=TO, for example tabor=0.25:4")
    numbers = tuple(_value(value, name, request) for value in values)
    if len(numbers) == 2 and numbers[0] == numbers[1]:
        raise InputError(f"--vary: {text!r}; the two values must differ")
    return name, numbers


def _value(text: str, name: str, request: Request) -> float:
    if name == "stiffness" and text in ("inf", "infinity"):
        return float("inf")
    dimension = dimension_of(request.contact, name)
    if dimension != "dimensionless":
        return request.quantity(text, dimension, "--vary")
    number = _bare(text)
    if isinstance(number, str):
        raise InputError(f"--vary: {text!r}; {name} is a plain number")
    return number


def find_event(diagram: Diagram, name: str, kind: str) -> Event:
    """Return the event of that name under a control, the outermost if there are several; ``touch`` is first touch.

    Raises
    ------
    InputError
        If the diagram has none; the message says which ones it has.
    """
    events = [(event, "touch" if event.kind == "touch" else event.name) for event in diagram.events]
    there = [(event, called) for event, called in events if event.kind == "touch" or event.control == kind]
    found = [event for event, called in there if called == name]
    if found:
        key = "displacement" if kind == "spring" else kind
        return (min if name.rstrip("-0123456789") in _LOWEST else max)(found, key=lambda event: getattr(event, key))
    known = sorted({called for _, called in there if called})
    listed = ", ".join(known) or "none"
    raise InputError(f"--event: {name!r}; under {kind} control this contact has: {listed}{nearest(name, known)}")
