"""JSON document of a followed event."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from contbranch.output.document import VERSION, _contact, _cost, _event, _model, _number, _numbers, _units

if TYPE_CHECKING:
    from contbranch.results.followed import Followed, Special

__all__ = ["follow_document"]

_OBSERVABLES = ("load", "displacement", "contact_radius", "central_gap")


def follow_document(followed: Followed) -> dict[str, Any]:
    """Return a followed event as a JSON-able dictionary of format ``contbranch-follow``, version 1.

    Under `curve`, the parameter has its own name. Special points have their parameter under that name, too, and under
    `value`, with the error estimates of it and of the four observables in `error`.
    """
    return {
        "format": "contbranch-follow",
        "version": VERSION,
        "contact": _contact(followed.contact),
        **_units(followed.contact, {}),
        "model": _model(followed.model),
        "event": {name: value for name, value in _event(followed.event).items() if name != "exponent"},
        "parameter": followed.parameter,
        "accuracy": followed.accuracy,
        "curve": {name: _numbers(values) for name, values in followed.curve.items()},
        "error": {name: _numbers(values) for name, values in followed.error.items()},
        "special": [_special(one) for one in followed.special],
        "cost": _cost(followed.cost),
        "status": followed.status,
        "message": followed.message,
    }


def _special(one: Special) -> dict[str, Any]:
    return {
        "kind": one.kind,
        "control": one.control,
        "parameter": one.parameter,
        "value": _number(one.value),
        one.parameter: _number(one.value),
        **{name: _number(getattr(one, name)) for name in _OBSERVABLES},
        "error": {name: _number(value) for name, value in one.error.items()},
        "index": one.index,
        "message": one.message,
    }
