"""The page on sweeps, the sweep of the studies, and how sweeps grow."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import contbranch as cb
from contbranch.sweeps.design import read_sweep

ROOT = Path(__file__).parents[2]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import sweep_growth  # noqa: E402


def blocks(language: str) -> list[str]:
    text = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def test_the_examples_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    first, second = blocks("python")
    exec(compile(first, "sweeps.md", "exec"), {"__name__": "__main__"})
    exec(compile(second, "sweeps.md", "exec"), {})
    assert "3 tasks over tabor: 3 complete" in capsys.readouterr().out
    single = cb.trace(cb.Contact.reduced(cb.Gauss, tabor=2.0, sign=-1), accuracy=1e-4)
    assert cb.load("films.h5").tasks[1].thresholds == pytest.approx(single.thresholds, rel=1e-4)


def test_the_sweep_files_are_those_of_a_contact(tmp_path: Path) -> None:
    """What `studies/sweep.toml` varies is the contact of `omcts.toml`."""
    design, _ = read_sweep(ROOT / "studies" / "sweep.toml")
    assert design.contact == cb.Contact.from_file(ROOT / "studies" / "omcts.toml")
    assert design.shape == (3, 8)
    text = (ROOT / "studies" / "omcts.toml").read_text(encoding="utf-8")
    (tmp_path / "s.toml").write_text(text + blocks("toml")[0], encoding="utf-8")
    design, settings = read_sweep(tmp_path / "s.toml")
    assert len(design) == 40
    assert (settings["keep"], settings["task_limit"]) == ("curves", 600)


def test_growth_is_measured() -> None:
    found = sweep_growth.measured(60, 100, 1)
    assert (found.tasks, found.size) == (60, 100)
    assert 0.0 < found.own_seconds < found.seconds
    assert 60 * 100 * 8 / 1e6 / 20 < found.file_megabytes < 1.0
