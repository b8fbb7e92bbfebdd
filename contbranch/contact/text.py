"""Text files that users give."""

from __future__ import annotations

from pathlib import Path

from contbranch.errors import InputError


def read_text(path: Path) -> str:
    """Return the text of a file; InputError, naming it, if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of an existing one") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise InputError(f"{path}: {reason}; must be a readable text file") from None
