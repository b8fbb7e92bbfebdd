"""Fields of many rows are kept in a file where they would take much memory, and are the same there."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb
from contbranch.models.grid import keeping


def traced() -> cb.Diagram:
    contact = cb.Contact(cb.EllipticParaboloid(2.0, 0.5), cb.Exponential(0.5, 1.0))
    return cb.trace(contact, model=cb.FreeSpace(grid=32), max_load=1.0)


def test_a_curve_whose_fields_lie_in_a_file_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = traced()
    monkeypatch.setattr(keeping, "IN_MEMORY", 3e4)
    filed = traced()
    assert filed.branches == plain.branches
    assert filed.thresholds == plain.thresholds
    for row in (0, len(plain.branches[0]) - 1):
        assert filed.branches[0].state(row).cell == plain.branches[0].state(row).cell


def test_a_full_disk_leaves_them_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full:
        def __getattr__(self, name: str) -> object:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(keeping, "IN_MEMORY", 0.0)
    monkeypatch.setattr(keeping.tempfile, "TemporaryFile", Full)
    values = np.arange(3.0)
    assert keeping.Keeping()(values) is values
