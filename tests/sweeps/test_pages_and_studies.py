"""The sweep of the studies, and how sweeps grow."""

from __future__ import annotations

import sys
from pathlib import Path

import contbranch as cb
from contbranch.sweeps.design import read_sweep

ROOT = Path(__file__).parents[2]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import sweep_growth  # noqa: E402


def test_the_sweep_file_is_that_of_a_contact() -> None:
    """What `studies/sweep.toml` varies is the contact of `omcts.toml`."""
    design, _ = read_sweep(ROOT / "studies" / "sweep.toml")
    assert design.contact == cb.Contact.from_file(ROOT / "studies" / "omcts.toml")
    assert design.shape == (3, 8)


def test_growth_is_measured() -> None:
    found = sweep_growth.measured(60, 100, 1)
    assert (found.tasks, found.size) == (60, 100)
    assert 0.0 < found.own_seconds < found.seconds
    assert 60 * 100 * 8 / 1e6 / 20 < found.file_megabytes < 1.0
