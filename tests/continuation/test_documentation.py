"""The page on the engine: its code runs, and its assertions hold."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "continuation.md"


def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert len(examples) == 5
    exec(compile("\n".join(examples), PAGE.name, "exec"), {"__name__": "__main__"})
    assert (tmp_path / "curve.png").stat().st_size > 1000
