"""The journal of a sweep: a file of records with checksums, each appended at once when a task has ended.

A record is a line ``contbranch LENGTH SHA256`` and its content, a line of JSON and the bytes of its arrays. What
follows the last record that is whole is dropped. Workers append to a file of their own for each batch, which is added
to the journal when the batch has ended, or when the sweep is resumed.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from contbranch.arrays import AnyArray, Columns
from contbranch.output.files import lock

_MARK = b"contbranch"
_LOST = 1.0  # seconds of work that are lost when the power fails; when the program is killed, none
# What is held in memory of a record; the rest is read when the sweep's file is written.
_HELD = ("key", "run", "begun", "status", "message", "thresholds", "wall_s")


def encoded(about: Mapping[str, Any], arrays: Columns) -> bytes:
    """A record as it is written."""
    known = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
    columns = [[name, values.dtype.str, len(values)] for name, values in known.items()]
    line = json.dumps({**about, "columns": columns}, ensure_ascii=False, allow_nan=False).encode()
    content = b"".join([line, b"\n", *(values.tobytes() for values in known.values()), b"\n"])
    return b"%s %d %s\n%s" % (_MARK, len(content), hashlib.sha256(content).hexdigest().encode(), content)


def decoded(record: bytes) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """What a record holds."""
    _, line, rest = record.split(b"\n", 2)
    about, found, place = json.loads(line), {}, 0
    for name, kind, length in about.pop("columns"):
        found[name] = np.frombuffer(rest, kind, length, place)
        place += found[name].nbytes
    return about, found


def _held(line: bytes) -> dict[str, Any]:
    about = json.loads(line)
    return {name: about[name] for name in _HELD if name in about}


class Entry(NamedTuple):
    """A record in a file: what is held of its line of JSON, and where all of it is."""

    about: dict[str, Any]
    start: int
    stop: int


class Records:
    """A file of records, appended to by one process at a time; the lock dies with its process."""

    def __init__(self, path: Path, wait: bool = False) -> None:
        self.path, self._synced = path, 0.0
        self._file: IO[bytes] = open(path, "a+b", buffering=0)  # noqa: SIM115  # closed by close
        lock(self._file, wait)
        self.entries, end = [], 0
        for entry in self._read():
            self.entries.append(entry)
            end = entry.stop
        if end < os.fstat(self._file.fileno()).st_size:  # torn: the program ended while it was written
            self._file.truncate(end)

    def _read(self) -> Iterator[Entry]:
        place = 0
        with open(self.path, "rb") as file:
            while True:
                head = file.readline(256)
                words = head.split()
                if len(words) != 3 or words[0] != _MARK or not words[1].isdigit():
                    return
                content = file.read(int(words[1]))
                if hashlib.sha256(content).hexdigest().encode() != words[2]:
                    return
                stop = place + len(head) + len(content)
                yield Entry(_held(content.partition(b"\n")[0]), place, stop)
                place = stop

    def append(self, record: bytes, sync: bool = True) -> None:
        """Write a record, and wait until it is on the disk, unless the one before was within the last second."""
        rest = memoryview(record)
        while rest:
            rest = rest[self._file.write(rest) :]
        if sync and time.monotonic() > self._synced + _LOST:
            self.sync()

    def sync(self) -> None:
        """Wait until all is on the disk."""
        os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def bytes_of(self, start: int, stop: int) -> bytes:
        """A part of the file."""
        self._file.seek(start)  # what is appended goes to the end all the same
        return self._file.read(stop - start)

    def close(self) -> None:
        """Close the file, which releases its lock."""
        if not self._file.closed:
            self.sync()
        self._file.close()


class Journal:
    """What has been computed of a sweep, in a folder beside its file.

    Attributes
    ----------
    folder : Path
    ended : dict of Entry
        The record of every task that has ended, by its key.
    computed : dict of int
        How often each of them was computed: once, unless something is wrong.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(exist_ok=True)
        self.ended: dict[str, Entry] = {}
        self.computed: dict[str, int] = {}
        self._runs: set[str] = set()
        self._records = Records(folder / "journal")
        self._end = self._records.entries[-1].stop if self._records.entries else 0
        for entry in self._records.entries:
            self._note(entry)
        self._records.entries.clear()
        for path in sorted(folder.glob("batch-*")):
            self.collect(path)

    def _note(self, entry: Entry) -> None:
        """Remember a record, unless it is a copy of one that is known."""
        key, run = entry.about["key"], entry.about["run"]
        if run not in self._runs:
            self._runs.add(run)
            self.computed[key] = self.computed.get(key, 0) + 1
            self.ended[key] = entry

    def add(self, record: bytes, sync: bool = True) -> None:
        """Append a record."""
        self._records.append(record, sync)
        self._note(Entry(_held(record.split(b"\n", 2)[1]), self._end, self._end + len(record)))
        self._end += len(record)

    def collect(self, path: Path) -> dict[str, float]:
        """Add the records of a batch, whose worker is waited for; return what it had begun and not ended, and when."""
        if not path.exists():
            return {}
        batch = Records(path, wait=True)
        begun: dict[str, float] = {}
        try:
            for entry in batch.entries:
                if "begun" in entry.about:
                    begun[entry.about["key"]] = entry.about["begun"]
                    continue
                begun.pop(entry.about["key"], None)
                if entry.about["run"] not in self._runs:
                    self.add(batch.bytes_of(entry.start, entry.stop), sync=False)
            self._records.sync()
        finally:
            batch.close()
        path.unlink()
        return begun

    def record(self, key: str) -> bytes:
        """The record of a task that has ended."""
        return self._records.bytes_of(*self.ended[key][1:])

    def forget(self, key: str) -> None:
        """Let a task be computed again."""
        del self.ended[key], self.computed[key]

    def close(self, remove: bool = False) -> None:
        """Close the journal; remove it when all of it is in the sweep's file."""
        self._records.close()
        if remove:
            for path in self.folder.iterdir():
                path.unlink()
            self.folder.rmdir()
