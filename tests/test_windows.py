"""Files under an `os` that behaves as that of Windows."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.output import files
from contbranch.sweeps.journal import Journal, encoded

O_BINARY = 1 << 30
DESCRIPTORS = 256
ATTRACTION = cb.Contact.reduced(cb.Exponential, tabor=1.0)


def is_open(path: Any) -> bool:
    """Whether this process has a file open."""
    try:
        wanted = os.stat(path)
    except FileNotFoundError:
        return False
    for number in range(3, DESCRIPTORS):
        with suppress(OSError):
            if os.path.samestat(os.fstat(number), wanted):
                return True
    return False


@pytest.fixture(autouse=True)
def windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """No locks and no pread; files that are open are neither renamed nor removed, and text unless opened as binary."""
    text = set[int]()
    opened, written, closed = os.open, os.write, os.close

    def refusing(call: Callable[..., None]) -> Callable[..., None]:
        def refused(*paths: Any, **how: Any) -> None:
            for path in paths:
                if is_open(path):
                    raise PermissionError(13, "The process cannot access the file", str(path))
            call(*paths, **how)

        return refused

    def open_(path: Any, flags: int, *mode: int, **how: Any) -> int:
        number = opened(path, flags & ~O_BINARY, *mode, **how)
        if not flags & O_BINARY:
            text.add(number)
        return number

    def write(number: int, content: Any) -> int:
        if number in text:
            written(number, bytes(content).replace(b"\n", b"\r\n"))
            return len(content)
        return written(number, content)

    def close(number: int) -> None:
        text.discard(number)
        closed(number)

    for name in ("replace", "rename", "unlink", "remove", "rmdir"):
        monkeypatch.setattr(os, name, refusing(getattr(os, name)))
    monkeypatch.setattr(os, "open", open_)
    monkeypatch.setattr(os, "write", write)
    monkeypatch.setattr(os, "close", close)
    monkeypatch.setattr(os, "O_BINARY", O_BINARY, raising=False)
    monkeypatch.delattr(os, "pread")
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setattr(files, "fcntl", None, raising=False)


def test_results_figures_and_tables(tmp_path: Path) -> None:
    diagram = cb.trace(ATTRACTION)
    for _ in range(2):  # the second file replaces the first
        diagram.save(tmp_path / "x.h5")
        diagram.to_csv(tmp_path / "x.csv")
        diagram.events_to_csv(tmp_path / "events.csv")
        assert main(["show", str(tmp_path / "x.h5"), "--plot", str(tmp_path / "x.png")]) == 0
    assert cb.load(tmp_path / "x.h5").events == diagram.events
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert b"\r\r" not in (tmp_path / "x.csv").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["events.csv", "x.csv", "x.h5", "x.png"]


def test_what_is_not_written_in_the_end_is_removed(tmp_path: Path) -> None:
    with files.reserved(tmp_path / "x.h5"):
        pass
    assert not list(tmp_path.iterdir())


def test_sweeps(tmp_path: Path) -> None:
    contacts = [cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor) for tabor in (0.5, 1.0, 2.0)]
    with ThreadPoolExecutor(1) as executor:
        first = cb.sweep(contacts[:2], tmp_path / "x.h5", executor=executor)
        second = cb.sweep(contacts, tmp_path / "x.h5", executor=executor, resume=True)
    assert (first.status, second.status, second.computed, second.reused) == ("complete", "complete", 1, 2)
    assert cb.load(tmp_path / "x.h5").tasks[1].thresholds == first.tasks[1].thresholds
    assert [path.name for path in tmp_path.iterdir()] == ["x.h5"]


def test_a_journal_is_read_where_it_is_still_written(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j")
    records = [encoded({"key": key, "run": key, "status": "complete"}, {"x": np.arange(3.0)}) for key in "ab"]
    journal.add(records[0])
    assert journal.record("a") == records[0]
    journal.add(records[1])
    assert [journal.record(key) for key in "ab"] == records
    journal.close(remove=True)
    assert not list(tmp_path.iterdir())
