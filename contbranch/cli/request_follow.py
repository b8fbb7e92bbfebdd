"""What ``contbranch follow`` asks for: which event, and a parameter with the values between which it is followed."""

from __future__ import annotations

from dataclasses import dataclass

from contbranch.cli.request import Request
from contbranch.contact.contact import dimensions, nearest
from contbranch.control import as_control
from contbranch.errors import InputError
from contbranch.results.diagram import Diagram, Event

__all__ = ["Variation", "find_event", "parse_vary"]

_LOWEST = ("pull-off", "wetting")


@dataclass(frozen=True)
class Variation:
    """A parameter and one or two values of it, in the contact's units."""

    name: str
    values: tuple[float, ...]

    def to(self, present: float) -> tuple[float, ...]:
        """The values to follow an event to: both where the present value lies between them, else the farther one."""
        if len(self.values) == 2 and not min(self.values) < present < max(self.values):
            return (max(self.values, key=lambda value: abs(value - present)),)
        return self.values


def parse_vary(text: str, request: Request) -> Variation:
    """Return the variation of ``NAME=A:B`` or ``NAME=B``; values may have units for a physical contact.

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
    return Variation(name, numbers)


def _value(text: str, name: str, request: Request) -> float:
    if name == "stiffness" and text in ("inf", "infinity"):
        return float("inf")
    dimension = _dimension(name, request)
    if dimension == "dimensionless":
        try:
            return float(text)
        except ValueError:
            raise InputError(f"--vary: {text!r}; {name} is a plain number") from None
    return request.quantity(text, dimension, "--vary")


def _dimension(name: str, request: Request) -> str:
    """The dimension of a parameter."""
    if name in ("stiffness", "modulus"):
        return {"stiffness": "stiffness", "modulus": "pressure"}[name]
    field = name.rsplit(".", 1)[-1]
    contact = request.contact
    parts = [contact.tip] if name.startswith("tip.") else [*(contact.interaction.terms if contact.interaction else ())]
    for part in parts:
        if "." in name and field in dimensions(type(part)):
            return dimensions(type(part))[field]
    return "dimensionless"


def find_event(diagram: Diagram, name: str, control: object) -> Event:
    """Return the event of that name under a control, the outermost if there are several; ``touch`` is first touch.

    Raises
    ------
    InputError
        If the diagram has none; the message says which ones it has.
    """
    kind = as_control(control).kind
    if name == "touch":
        found = [event for event in diagram.events if event.kind == "touch"]
    else:
        found = [
            event for event in diagram.events if event.kind == "fold" and (event.name, event.control) == (name, kind)
        ]
    if found:
        key = kind if kind != "spring" else "displacement"
        return (min if name.rstrip("-0123456789") in _LOWEST else max)(found, key=lambda event: getattr(event, key))
    known = sorted({event.name for event in diagram.folds(kind) if event.name})
    known += ["touch"] if any(event.kind == "touch" for event in diagram.events) else []
    listed = ", ".join(known) or "none"
    raise InputError(f"--event: {name!r}; under {kind} control there are: {listed}{nearest(name, known)}")
