"""The errors that contbranch raises on purpose."""

from __future__ import annotations

__all__ = ["InputError", "ModelError", "Stop"]


class InputError(ValueError):
    """A value given by the user cannot be used; the message names the field, the value and the remedy in one line."""


class Stop(Exception):
    """Raised by a progress callback: the computation ends, and returns the incomplete result."""


class ModelError(RuntimeError):
    """A computation could not deliver what was asked for; the message says what was reached and why it stopped."""
