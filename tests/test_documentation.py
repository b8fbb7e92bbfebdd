"""Every block of code in README and docs runs, in order, in one folder a page, and prints what the page shows."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.md") if "generated" not in p.parts)]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)
# What sets a machine up, or runs a study: the first is what `.ci/run` does, the second has tests of its own.
ELSEWHERE = re.compile(r"python3 -m venv |\.venv/bin/|pip install |python ")


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path) -> list[tuple[str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def fit_for_force_curves(folder: Path) -> None:
    """A curve and where its fit starts, under the names that the page gives them."""
    contact = cb.Contact.physical(
        radius="2 um", modulus="100 MPa", interaction="maugis-dugdale", work_of_adhesion="30 mN/m", range="1 nm"
    )
    loop = cb.hysteresis(contact, control=cb.Spring("0.5 N/m"), accuracy=1e-4, max_load=200.0)
    top = loop.path.position.max()
    rng, lines = np.random.default_rng(1), ["piezo [nm],force [nN],segment"]
    for segment, sense, ends in (("approach", 1, (-100.0, top)), ("retract", -1, (top, -700.0))):
        here = loop.path.direction == sense
        order = np.argsort(loop.path.position[here])
        piezo = np.linspace(*ends, 150)
        force = np.interp(piezo, loop.path.position[here][order], loop.path.load[here][order], left=0.0)
        lines += [f"{x},{f},{segment}" for x, f in zip(piezo, force + rng.normal(0.0, 0.1, 150), strict=True)]
    (folder / "curve.csv").write_text("\n".join(lines), encoding="utf-8")
    (folder / "contact.toml").write_text(
        '[tip]\nshape = "parabola"\nradius = "2 um"\n[material]\nmodulus = "100 MPa"\n'
        '[[interaction]]\nlaw = "maugis-dugdale"\nwork_of_adhesion = "30 mN/m"\nrange = "1 nm"\n',
        encoding="utf-8",
    )


def files_of_an_instrument(folder: Path) -> None:
    """A file of a cell, a folder of two, and what is in it as a text."""
    content = (ROOT / "tests" / "reference" / "force_curves" / "fmt-jpk-fd_spot3-0192.jpk-force").read_bytes()
    (folder / "cells").mkdir()
    for name in ("cell.jpk-force", "cells/1.jpk-force", "cells/2.jpk-force"):
        (folder / name).write_bytes(content)
    curve = cb.read_force_curve(folder / "cell.jpk-force")
    rows = zip(-curve.piezo, curve.force / curve.spring / 70.0, strict=True)
    lines = ["Height (nm)\tDefl (V)", *(f"{height:.3f}\t{volts:.6f}" for height, volts in rows)]
    (folder / "export.txt").write_text("\n".join(lines), encoding="utf-8")


# What is fitted may differ by less than its error.
TOLERANCE = {"docs/tutorial-force-curve.md": 0.06, "docs/howto/jpk.md": 0.06}
GIVEN = {"docs/force-curves.md": fit_for_force_curves, "docs/howto/jpk.md": files_of_an_instrument}


def run_commands(block: str) -> None:
    for line in block.replace("\\\n", " ").splitlines():
        if line.startswith("contbranch "):
            assert main(shlex.split(line)[1:]) == 0, line
        elif ELSEWHERE.match(line):
            for script in re.findall(r"\S+\.py", line):
                assert (ROOT / script).is_file(), line
        else:
            raise AssertionError(f"not known how to run: {line}")


def number(word: str) -> float | None:
    """The number that a word is, without the digits of its error in brackets."""
    try:
        return float(re.sub(r"\(\d+\)", "", word).strip("[],();:%"))
    except ValueError:
        return None


def alike(shown: str, printed: str, tolerance: float) -> bool:
    """Whether two words are the same; numbers may differ in their last digits, of which errors and times have few."""
    a, b = number(shown), number(printed)
    if a is None or b is None:
        return shown == printed
    digits = len(re.sub(r"\(.*|[eE].*|\D", "", shown).strip("0"))
    return abs(a - b) <= max((tolerance if digits > 3 else max(0.25, 10.0 * tolerance)) * abs(a), 1e-6)


def shown_in(text: str, printed: str, tolerance: float = 1e-3) -> str | None:
    """The first line of a block of text that is not, after those before it, among the printed ones; times aside."""
    lines = iter(printed.splitlines())
    timed = False
    for line in text.splitlines():
        words = line.split()
        if re.search(r"\d s[,:]", line):
            continue
        timed = timed or words[-1:] == ["seconds"]
        words = words[:-1] if timed and len(words) > 1 and number(words[-1]) is not None else words

        def found(candidate: str, words: list[str] = words, timed: bool = timed) -> bool:
            others = candidate.split()[: len(words)] if timed else candidate.split()
            return len(words) == len(others) and all(
                alike(*pair, tolerance) for pair in zip(words, others, strict=True)
            )

        if not any(map(found, lines)):
            return line
    return None


@pytest.fixture
def _fits_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a page fits by the command and in Python is fitted by whichever comes first."""
    made: dict[tuple[object, ...], cb.Fit] = {}
    fit = cb.fit

    def fitted(curve: cb.ForceCurve, contact: cb.Contact, free: str | Sequence[str], **how: Any) -> cb.Fit:
        data = (curve.piezo.tobytes(), curve.force.tobytes(), curve.retract.tobytes(), curve.spring, curve.deflected)
        names = free if isinstance(free, str) else ",".join(free)
        key = (*data, str(contact.describe()), names, str({key: value for key, value in how.items() if value}))
        if key not in made:
            made[key] = fit(curve, contact, free, **how)
        return made[key]

    monkeypatch.setattr(cb, "fit", fitted)
    monkeypatch.setattr("contbranch.measure.fit.fit", fitted)


@pytest.mark.usefixtures("_fits_made_once")
@pytest.mark.filterwarnings("ignore::contbranch.GridWarning")
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=name)
def test_the_code_of_a_page_runs_and_prints_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    GIVEN.get(name(page), lambda _: None)(tmp_path)
    namespace: dict[str, object] = {"__name__": "__main__"}
    printed: str | None = None
    for language, block in blocks(page):
        if language == "toml":
            tomllib.loads(block)
            file = re.match(r"# (\S+\.toml)\n", block)
            assert file, "the first line of a contact file is its name"
            Path(file[1]).write_text(block, encoding="utf-8")
        elif language == "sh":
            run_commands(block)
        elif language == "python":
            exec(compile(block, name(page), "exec"), namespace)
        elif language == "text" and printed is not None:
            missing = shown_in(block, printed, TOLERANCE.get(name(page), 1e-3))
            assert missing is None, f"{missing}\nis not in\n{printed}"
        else:
            assert language in ("", "text"), f"blocks of {language} are not run"
        printed = capsys.readouterr().out if language in ("sh", "python") else None


def test_the_reference_has_every_public_name() -> None:
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "api").glob("*.md"))
    assert [name for name in cb.__all__ if not re.search(rf"auto\w+:: {name}$", pages, re.MULTILINE)] == []
