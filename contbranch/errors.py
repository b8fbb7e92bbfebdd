"""Errors that contbranch raises on purpose, warnings, what is said of names that are not known, numbers of things."""

from __future__ import annotations

TYPE_CHECKING = False  # `typing` takes longer to import than all of this
if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any


class InputError(ValueError):
    """A value given by the user cannot be used; the message names the field, the value and the remedy in one line."""


class Stop(Exception):
    """Raised by a progress callback: the computation ends, and returns the incomplete result."""


class ModelError(RuntimeError):
    """A computation could not deliver what was asked for; the message says what was reached and why it stopped."""


def warned(text: str, category: type[Warning] = UserWarning) -> None:
    """Warn of the line of the user's from which the package was called."""
    import sys
    import warnings

    frame, level = sys._getframe(), 1
    while frame.f_back and frame.f_globals["__name__"].partition(".")[0] in ("contbranch", "numpy"):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, category, stacklevel=level)


def number_of(count: int, one: str, many: str = "") -> str:
    """Return how many there are, in words: 1 state, 2 states."""
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def nearest(name: object, known: Iterable[str]) -> str:
    """Return the end of a message that suggests the name nearest to `name`, empty if none is near."""
    import difflib

    near = difflib.get_close_matches(str(name).lower().replace(" ", "-"), list(known), n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else ""


def look_up(name: object, known: Mapping[str, Any], field: str) -> Any:
    """Return the entry of `known` called `name`; InputError, naming `field` and the nearest name, if there is none."""
    if isinstance(name, str) and name in known:
        return known[name]
    raise InputError(f"{field}: {name!r}; must be one of {', '.join(known)}{nearest(name, known)}")


def refuse_unknown(names: Iterable[str], known: Iterable[str], prefix: str = "") -> None:
    """Raise InputError, with `prefix` in front, for the first of `names` that is not among the `known` ones."""
    for name in names:
        if name not in known:
            if any(word in name.lower() for word in ("young", "poisson")):
                raise InputError(f"{prefix}{name}: give the effective modulus, E/(1 − ν²) for a rigid tip, as modulus")
            raise InputError(f"{prefix}{name}: not known; must be one of {', '.join(known)}{nearest(name, known)}")
