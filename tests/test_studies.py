"""The scripts in `studies/`, and the links between pages; the code on them is run by `test_documentation.py`."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb
from contbranch.contact.file import read_contact

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import benchmark, readme_figure  # noqa: E402

PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "studies" / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted(page for page in (ROOT / "docs").rglob("*.md") if "generated" not in page.parts),
]
MADE = ROOT / "docs" / "generated"  # pages that are made when the others are built


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of one language on a page."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The names that a page's headings have in links."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


# omcts.toml


def test_experiment_of_the_paper():
    """R = 1 µm, E = 5 GPa, Δγ = −40 mN/m, z0 = 1 nm have μ_T = 0.40 (the paper's estimate for experiments).

    The loads were computed with accuracy 1e-10, estimated errors 3e-10 and 2e-11 nN; the file's 1e-6 allows
    1e-6 · 6.6 · R|Δγ| = 2.7e-4 nN.
    """
    contact, options = read_contact(ROOT / "studies" / "omcts.toml")
    assert contact.tabor == pytest.approx(0.4, rel=1e-12)
    diagram = cb.trace(contact, **options)
    assert diagram.status == "complete"
    assert diagram.thresholds["squeeze_out_load"] == pytest.approx(265.4236869315, abs=2.7e-4)
    assert diagram.thresholds["wetting_load"] == pytest.approx(264.7413193550, abs=2.7e-4)
    assert diagram.thresholds["wetting_radius"] == pytest.approx(1.1580843696, abs=3e-4)
    assert diagram.unit_names["load"] == "nN"
    assert [event.name for event in diagram.folds("load")] == ["squeeze-out", "wetting"]


# The scripts


def test_benchmark_measures_what_it_says(monkeypatch):
    """Its cases are complete; at a tenth of the size of the reference the report still has all its parts."""
    monkeypatch.setattr(benchmark, "ORDER", 50)
    cases = (benchmark.GAUSS, benchmark.EXPONENTIAL)
    timings = tuple(benchmark.measure(case, repetitions=1) for case in cases)
    assert all(timing.status == "complete" and timing.best > 0 and timing.points > 10 for timing in timings)
    growth = (benchmark.cost_against_digits(benchmark.EXPONENTIAL, (1e-4, 1e-8), repetitions=1),) * 2
    shares = dict.fromkeys((case.name for case in cases), benchmark.where_time_goes(benchmark.EXPONENTIAL, seconds=0.5))
    report = benchmark.Report("this machine", timings, growth, (0.5, 0.6), shares)
    assert "to F = 120, accuracy 1e-08" in benchmark.summary(report)
    assert all(kind in benchmark.details(report) for kind in shares[benchmark.GAUSS.name])


def test_benchmark_ends_where_it_says():
    """The diagram that is timed reaches the load 120 through both load folds."""
    diagram = benchmark.GAUSS.trace()
    assert diagram.branches[0].load[-1] == pytest.approx(120.0, rel=1e-6)
    assert [event.name for event in diagram.folds("load")] == ["squeeze-out", "wetting"]


def test_time_is_attributed_to_the_work_done():
    """Samples of a trace are spread over the kinds of work, and their shares add up to one."""
    shares = benchmark.where_time_goes(benchmark.EXPONENTIAL, seconds=0.6)
    events = shares.pop(benchmark.EVENTS)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert 0 < events < 1
    assert min(shares[benchmark.LINEARISATION], shares[benchmark.MESHES], shares[benchmark.ESTIMATES]) > 0


def test_power_of_the_digits():
    """Times 2 · digits³ have the power 3."""
    accuracies = (1e-4, 1e-6, 1e-8)
    growth = benchmark.Growth("made up", accuracies, tuple(2 * d**3 for d in (4.0, 6.0, 8.0)), (1, 2, 3))
    assert growth.power == pytest.approx(3.0)


def test_report_is_written_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- benchmark -->\nold\n<!-- end of benchmark -->\nafter\n")
    benchmark.update(page, "new")
    assert page.read_text() == "before\n<!-- benchmark -->\nnew\n<!-- end of benchmark -->\nafter\n"
    page.write_text("nothing\n")
    with pytest.raises(SystemExit, match="marks"):
        benchmark.update(page, "new")
    for path in benchmark.PAGES:
        assert "<!-- end of benchmark -->" in path.read_text(encoding="utf-8")


def test_figure_of_the_readme():
    """Its captions: coexistence on the left, an unstable part under displacement control on the right."""
    squeeze_out, adhesion = readme_figure.diagrams()
    assert squeeze_out.thresholds["wetting_load"] < squeeze_out.thresholds["squeeze_out_load"]
    assert adhesion.branches[0].unstable_displacement.max() == 1
    picture = readme_figure.picture()
    assert picture.dtype == np.uint8
    assert picture.shape[1] > 2 * picture.shape[0]  # two panels, side by side
    assert (picture[..., :3].min(axis=2) < 128).any(axis=0)[: picture.shape[1] // 2].any()


# The pages


def test_readme_commands():
    """Two commands set a fresh machine up; the first does the main job, on a file that exists, the second tests."""
    first, second = [block.strip() for block in blocks(ROOT / "README.md", "sh")]
    for command in (first, second):
        assert command.startswith("python3 -m venv")
        assert "\n" not in command
    assert "-m pytest -q -n auto" in second  # on all processors
    arguments = shlex.split(first.partition("bin/contbranch ")[2])
    assert arguments[0] == "trace"
    assert (ROOT / arguments[1]).is_file()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    """Every link that stays in the repository names a file that is there, and a heading that the page has."""
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if path.parent == MADE:
            continue
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), target


def test_documented_parameters_are_those_of_the_classes():
    """Every shape and law, and every parameter of theirs, is named in tips-and-laws.md."""
    from contbranch.contact.contact import dimensions
    from contbranch.contact.interactions import INTERACTIONS
    from contbranch.contact.tips import TIPS

    text = (ROOT / "docs" / "tips-and-laws.md").read_text(encoding="utf-8")
    for name, kind in (TIPS | INTERACTIONS).items():
        assert f"| `{name}` | `{kind.__name__}` |" in text
        for parameter in dimensions(kind):
            assert f"`{parameter}" in text, f"{name}: {parameter}"
