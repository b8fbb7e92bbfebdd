"""Text files that users give."""

from __future__ import annotations

from pathlib import Path

from contbranch.errors import InputError


def as_path(value: object, field: str = "path") -> Path:
    """The path of a file, or InputError for what is none."""
    if not isinstance(value, str | Path):
        raise InputError(f"{field}: {value!r}; must be the path of a file, a text or a Path")
    return Path(value)


def read_text(path: Path) -> str:
    """Return the text of a file; InputError, naming it, if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of an existing one") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise InputError(f"{path}: {reason}; must be a readable text file") from None
