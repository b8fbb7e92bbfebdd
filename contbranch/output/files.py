"""Files are written whole or not at all, by one writer at a time, whatever ends the program on the way."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from contbranch.contact.text import as_path
from contbranch.errors import InputError


@dataclass(frozen=True)
class Place:
    """A file to be written, which nobody else writes meanwhile.

    Attributes
    ----------
    path : Path
        Its name for the user.
    field : str
        What named it: the beginning of complaints.
    number : int
        Descriptor of what takes the file's name when it is complete, or of a device.
    unfinished : Path or None
        The name that it has until then; None for a device.
    """

    path: Path
    field: str
    number: int
    unfinished: Path | None

    def write(self, content: bytes) -> None:
        """Write the file, which replaces an older one only when it is complete.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        try:
            if self.unfinished is not None:
                os.ftruncate(self.number, 0)
            rest = memoryview(content)
            while rest:
                rest = rest[os.write(self.number, rest) :]
            if self.unfinished is not None:
                os.fsync(self.number)
                os.replace(self.unfinished, self.path.resolve())
        except OSError as error:
            raise _refused(self.path, self.field, error) from None


@contextmanager
def reserved(path: str | Path, field: str = "path") -> Iterator[Place]:
    """A place for a file, held against other writers; what is unfinished is removed in the end.

    Raises
    ------
    InputError
        If nothing can be written there, or another process is about to.
    """
    path = as_path(path, field)
    target = path.resolve()
    device = target.exists() and not target.is_file()
    unfinished = None if device else target.with_name(target.name + ".part")
    try:
        number = _opened(unfinished) if unfinished is not None else os.open(target, os.O_WRONLY)
    except BlockingIOError:
        raise InputError(f"{field}: '{path}' is being written by another process; choose another file") from None
    except OSError as error:
        raise _refused(path, field, error) from None
    try:
        yield Place(path, field, number, unfinished)
    finally:
        if unfinished is not None and _same(number, unfinished):
            unfinished.unlink()
        os.close(number)


def write(path: str | Path, content: bytes) -> None:
    """Write a file, which replaces an older one only when it is complete.

    Raises
    ------
    InputError
        If it cannot be written, or another process is about to.
    """
    with reserved(path) as place:
        place.write(content)


def _refused(path: Path, field: str, error: OSError) -> InputError:
    reason = error.strerror or " ".join(str(error).split())
    return InputError(f"{field}: '{path}' cannot be written ({reason}); give a writable file")


def _opened(path: Path) -> int:
    """Open an unfinished file and lock it; the lock dies with its process, and what that has left is written over."""
    while True:
        number = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            lock(number)
            if _same(number, path):  # otherwise its last writer has finished or removed it in between
                return number
        except BaseException:
            os.close(number)
            raise
        os.close(number)


def lock(number: int, wait: bool = False) -> None:
    """Lock an open file; BlockingIOError if another process has, unless that is waited for."""
    with suppress(ImportError):  # where there are no such locks, the last writer wins
        import fcntl

        fcntl.flock(number, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))


def _same(number: int, path: Path) -> bool:
    """Whether an open file has a name."""
    try:
        return os.path.samestat(os.fstat(number), path.stat())
    except FileNotFoundError:
        return False
