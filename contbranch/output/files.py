"""Files are written whole or not at all, by one writer at a time, whatever ends the program on the way."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from contbranch.contact.text import as_path
from contbranch.errors import InputError

try:
    import fcntl
except ImportError:  # Windows has no such locks, and renames and removes no file that is open
    fcntl = None  # type: ignore[assignment]


@dataclass(frozen=True)
class Place:
    """A file to be written, which nobody else writes meanwhile.

    Attributes
    ----------
    path : Path
        Its name for the user.
    field : str
        What named it: the beginning of complaints.
    file : binary file without buffer
        What takes the file's name when it is complete, or a device.
    unfinished : Path or None
        The name that it has until then; None for a device.
    """

    path: Path
    field: str
    file: IO[bytes]
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
                self.file.truncate(0)
            rest = memoryview(content)
            while rest:
                rest = rest[self.file.write(rest) :]
            if self.unfinished is not None:
                os.fsync(self.file.fileno())
                if fcntl is None:
                    self.file.close()
                os.replace(self.unfinished, self.path.resolve())
        except OSError as error:
            raise _refused(self.path, self.field, error) from None

    def abandon(self) -> None:
        """Close the file, and remove it if it is unfinished."""
        path = None if self.file.closed else self.unfinished
        own = path is not None and _same(self.file, path)
        if fcntl is None:
            self.file.close()
        if path is not None and own:
            path.unlink()
        self.file.close()


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
        file = open(target, "wb", buffering=0) if unfinished is None else _opened(unfinished)  # noqa: SIM115
    except BlockingIOError:
        raise InputError(f"{field}: '{path}' is being written by another process; choose another file") from None
    except OSError as error:
        raise _refused(path, field, error) from None
    place = Place(path, field, file, unfinished)
    try:
        yield place
    finally:
        place.abandon()


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


def _opened(path: Path) -> IO[bytes]:
    """Open an unfinished file and lock it; the lock dies with its process, and what that has left is written over."""
    while True:
        file = open(path, "ab", buffering=0)  # noqa: SIM115  # closed by whoever has it
        try:
            lock(file)
            if _same(file, path):  # otherwise its last writer has finished or removed it in between
                return file
        except BaseException:
            file.close()
            raise
        file.close()


def lock(file: IO[bytes], wait: bool = False) -> None:
    """Lock an open file; BlockingIOError if another process has, unless that is waited for.

    Without locks the last writer wins.
    """
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))


def _same(file: IO[bytes], path: Path) -> bool:
    """Whether an open file has a name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False
