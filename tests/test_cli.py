"""The command line: outputs, exit statuses and one-line complaints."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest

import contbranch
from contbranch.cli import main
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.errors import InputError, ModelError
from contbranch.output import summary
from contbranch.output.hdf5 import load
from contbranch.results.diagram import Cost, Diagram, ModelChoice, Solution
from contbranch.watch import tell

CONTACT = """
[tip]
shape = "parabola"
radius = "1 um"
[material]
modulus = "5 GPa"
[[interaction]]
law = "maugis-dugdale"
work_of_adhesion = "40 mN/m"
range = "1 nm"
"""


@pytest.fixture
def contact(tmp_path: Path) -> str:
    path = tmp_path / "contact.toml"
    path.write_text(CONTACT)
    return str(path)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch, attraction: Diagram, repulsion: Diagram) -> list[dict[str, Any]]:
    """What `trace` and `solve` were asked for; they answer with what is known already."""
    made: list[dict[str, Any]] = []

    def trace(contact, **settings):
        made.append({"contact": contact, **settings})
        return attraction if contact.units.physical else repulsion

    def solve(contact, **settings):
        made.append({"contact": contact, **settings})
        states = tuple(attraction.branches[0].state(i) for i in (100, 50))
        fields = {name: getattr(states[0], name) for name in states[0].__dataclass_fields__}
        model, cost = ModelChoice("exact", "closed form", 1), Cost(0.01, 4)
        return Solution(**fields, model=model, cost=cost, message="1 of 2", states=states, contact=attraction.contact)

    monkeypatch.setattr(contbranch, "trace", trace, raising=False)
    monkeypatch.setattr(contbranch, "solve", solve, raising=False)
    return made


Capture = pytest.CaptureFixture[str]
GAUSS = ["--interaction", "gauss", "--tabor", "1", "--repulsive"]


def test_json_alone_goes_to_standard_output(calls: list, capsys: Capture) -> None:
    assert main(["trace", *GAUSS, "--json", "-"]) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["format"] == "contbranch-diagram"
    assert err == ""
    contact = calls[0]["contact"]
    assert (contact.interaction.name, contact.interaction.work_of_adhesion, contact.tabor) == ("gauss", -1.0, 1.0)
    assert {name: calls[0][name] for name in ("control", "accuracy", "model", "max_load")} == {
        "control": LOAD,
        "accuracy": 1e-6,
        "model": "auto",
        "max_load": None,
    }


def test_all_outputs_are_written(
    calls: list, contact: str, tmp_path: Path, capsys: Capture, attraction: Diagram
) -> None:
    outputs = {suffix: str(tmp_path / f"out{suffix}") for suffix in (".json", ".png", ".h5")}
    options = ["--json", outputs[".json"], "--plot", outputs[".png"], "-o", outputs[".h5"]]
    assert main(["trace", contact, *options]) == 0
    assert json.loads(Path(outputs[".json"]).read_text())["units"] == "physical"
    assert Path(outputs[".png"]).stat().st_size > 5000
    assert load(outputs[".h5"]).events == attraction.events
    out, err = capsys.readouterr()
    assert err == ""
    assert "contact radius (nm)" in out
    assert "-218.4413980(2)" in out  # Maugis' pull-off of 1 µm, 5 GPa, 40 mN/m, 1 nm with an error of 2e-7 nN
    assert main(["show", outputs[".h5"], "--plot", str(tmp_path / "again.svg")]) == 0
    assert capsys.readouterr().out == out
    assert (tmp_path / "again.svg").exists()


def test_stability_at_a_displacement_is_that_of_displacement_control(capsys: pytest.CaptureFixture) -> None:
    """Attraction at μ_T = 4 between its displacement folds: three equilibria, the middle one unstable."""
    contact = ["--interaction", "maugis-dugdale", "--tabor", "4", "--displacement", "-1", "--json", "-"]
    for control, stable in ([], 2), (["--control", "load"], 1):  # the state far away has no load
        for every, count in ([], 1), (["--all"], 3):
            assert main(["solve", *contact, *every, *control]) == 0
            document = json.loads(capsys.readouterr().out)
            assert len(document["states"]) == count
            assert f" {stable} stable under {'load' if control else 'displacement'} control" in document["message"]


def test_quantities_and_bare_numbers(calls: list, contact: str) -> None:
    options = ["--control", "displacement", "--accuracy", "1e-8", "--model", "exact"]
    assert main(["trace", contact, "--max-load", "0.5 uN", *options]) == 0
    assert main(["trace", contact, "--max-load", "500"]) == 0
    assert main(["solve", contact, "--load", "-0.1 uN"]) == 0
    assert main(["solve", contact, "--displacement", "-2"]) == 0
    assert [call.get("max_load") for call in calls[:2]] == [500.0, 500.0]
    assert [calls[0][name] for name in ("control", "accuracy", "model")] == [DISPLACEMENT, 1e-8, "exact"]
    assert calls[2]["load"] == pytest.approx(-100.0, rel=1e-14)
    assert "displacement" not in calls[2]
    assert calls[3]["displacement"] == -2.0


def test_models_of_a_cell(calls: list, contact: str) -> None:
    from contbranch.models.grid import FreeSpace, Periodic

    assert main(["trace", contact, "--model", "periodic", "--cell", "2 um", "--grid", "256"]) == 0
    assert main(["solve", contact, "--load", "5", "--model", "free"]) == 0
    assert main(["trace", *GAUSS, "--model", "free", "--cell", "8"]) == 0
    wanted = [Periodic(cell=2000.0, grid=256), FreeSpace(), FreeSpace(cell=8.0)]
    assert [call["model"] for call in calls] == wanted


def test_cell_and_grid_of_the_contact_file(calls: list, contact: str, capsys: Capture) -> None:
    from contbranch.models.grid import FreeSpace, Periodic

    Path(contact).write_text(CONTACT + '[trace]\nmodel = "periodic"\ncell = "2 um"\ngrid = 128\n')
    assert main(["trace", contact]) == 0
    assert main(["trace", contact, "--grid", "64"]) == 0
    assert main(["trace", contact, "--model", "free", "--cell", "3 um"]) == 0
    assert main(["trace", contact, "--model", "exact"]) == 0  # puts the file's model aside, and its cell with it
    wanted = [
        Periodic(cell=2000.0, grid=128),
        Periodic(cell=2000.0, grid=64),
        FreeSpace(cell=3000.0, grid=128),
        "exact",
    ]
    assert [call["model"] for call in calls] == wanted
    Path(contact).write_text(CONTACT + "[trace]\ngrid = 128\n")
    capsys.readouterr()
    assert main(["trace", contact]) == 2
    assert capsys.readouterr().err == (
        "contbranch: trace.grid: the model auto has none; write model = periodic or free, or leave it out\n"
    )


def test_options_win_over_the_contact_file(calls: list, contact: str) -> None:
    Path(contact).write_text(CONTACT + '[trace]\ncontrol = "displacement"\naccuracy = 1e-7\nmax_load = "30 nN"\n')
    assert main(["trace", contact]) == 0
    assert main(["trace", contact, "--control", "load", "--accuracy", "1e-5", "--max-load", "60"]) == 0
    wanted = [("displacement", 1e-7, 30.0), ("load", 1e-5, 60.0)]
    assert [(str(call["control"]), call["accuracy"], call["max_load"]) for call in calls] == wanted


def test_solve_reports_one_state_or_all(calls: list, contact: str, tmp_path: Path, capsys: Capture) -> None:
    assert main(["solve", contact, "--load", "5", "--json", "-"]) == 0
    assert len(json.loads(capsys.readouterr().out)["states"]) == 1
    # every equilibrium at a load between pull-off and zero: the contact, and one without between its folds
    assert main(["solve", contact, "--load", "-100", "--json", "-", "--all"]) == 0
    states = json.loads(capsys.readouterr().out)["states"]
    assert [state["unstable_load"] for state in states] == [1, 0]
    files = ["--plot", str(tmp_path / "x.pdf"), "-o", str(tmp_path / "x.h5")]
    assert main(["solve", contact, "--load", "-100", "--all", *files]) == 0
    out = capsys.readouterr().out
    assert "load and displacement" in out
    assert "2 equilibria" in out
    assert (tmp_path / "x.pdf").read_bytes().startswith(b"%PDF")
    assert len(load(tmp_path / "x.h5").branches) == 2
    assert main(["show", str(tmp_path / "x.h5")]) == 0
    assert "load and displacement" in capsys.readouterr().out


def test_incomplete_trace_writes_everything_and_says_why(
    monkeypatch: pytest.MonkeyPatch, broken: Diagram, contact: str, tmp_path: Path, capsys: Capture
) -> None:
    monkeypatch.setattr(contbranch, "trace", lambda *_, **__: broken, raising=False)
    h5, png = tmp_path / "x.h5", tmp_path / "x.png"
    assert main(["trace", contact, "--json", "-", "-o", str(h5), "--plot", str(png)]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["status"] == "incomplete"
    assert err == "contbranch: incomplete: the law returned NaN at a gap of 0.5\n"
    assert h5.exists()
    assert png.exists()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["show", str(h5)]) == 0
    out, err = capsys.readouterr()
    assert "incomplete" in out
    assert "not at hand" in err  # the law is the test's own


WRONG = [
    ([], "Missing command"),
    (["loop"], "CONTACT: missing"),
    (["hop"], "No such command 'hop'"),
    (["trace"], "CONTACT: missing"),
    (["trace", "--foo"], "No such option: --foo"),
    (["trace", "FILE", "b"], "unexpected extra argument"),
    (["trace", "FILE", "--json"], "'--json' requires an argument"),
    (["trace", "missing.toml"], "missing.toml"),
    (["trace", "--interaction", "gauss"], "--tabor: missing"),
    (["trace", "--tabor", "1"], "CONTACT: missing"),
    (["trace", "FILE", "--interaction", "gauss"], "not both"),
    (["trace", "FILE", "--repulsive"], "not both"),
    (["trace", "--interaction", "nonsense", "--tabor", "1"], "--interaction: 'nonsense'; must be one of exponential"),
    (["trace", "--interaction", "tabulated", "--tabor", "1"], "--interaction: tabulated"),
    (["trace", "--interaction", "gauss", "--tabor", "-1"], "--tabor: -1; must be greater than zero"),
    (["trace", "--interaction", "gauss", "--tabor", "0"], "--tabor: 0; must be greater than zero"),
    (["trace", "--interaction", "gauss", "--tabor", "nan"], "--tabor: nan"),
    (["trace", "--interaction", "gauss", "--tabor", "four"], "--tabor: 'four'; must be a number"),
    (["trace", "FILE", "--accuracy", "0"], "--accuracy: 0; must be greater than zero"),
    (["trace", "FILE", "--accuracy", "inf"], "--accuracy: inf"),
    (["trace", "FILE", "--max-load", "3 nm"], "--max-load: '3 nm': 'nm' is not a unit of force"),
    (["trace", *GAUSS, "--max-load", "3 nN"], "--max-load: '3 nN'; the contact is in reduced units"),
    (["trace", "FILE", "--control", "force"], "--control: 'force'; must be load, displacement or spring:0.1 N/m"),
    (["trace", "FILE", "--control", "spring:0.1 nm"], "--control: '0.1 nm'"),
    (
        ["trace", "FILE", "--model", "grid"],
        "--model: 'grid' is not available; choose auto, exact, axisymmetric, periodic or free",
    ),
    (
        ["trace", "FILE", "--cell", "8"],
        "--cell: the model auto has none; add --model periodic or free, or leave it out",
    ),
    (["trace", "FILE", "--grid", "128", "--model", "exact"], "--grid: the model exact has none"),
    (["trace", "FILE", "--cell", "0 nm", "--model", "free"], "--cell: 0; must be greater than zero"),
    (["trace", "FILE", "--cell", "1 nN", "--model", "free"], "--cell: '1 nN': 'nN' is not a unit of length"),
    (["trace", *GAUSS, "--cell", "1 nm", "--model", "free"], "--cell: '1 nm'; the contact is in reduced units"),
    (["trace", "FILE", "--grid", "127", "--model", "periodic"], "--grid: 127; must be a whole and even number"),
    (["trace", "FILE", "--grid", "fine", "--model", "periodic"], "--grid: 'fine'; must be a whole number"),
    (["trace", "FILE", "--plot", "x.gif"], "--plot: 'x.gif' has no known suffix; must end in .pdf, .png or .svg"),
    (["trace", "FILE", "--plot", "no/x.png"], "--plot: the folder"),
    (["trace", "FILE", "--json", "no/x.json"], "--json: the folder"),
    (["trace", "FILE", "-o", "."], "-o: '.' is a folder"),
    (["trace", "FILE", "-o", "FILE"], "is also the input"),
    (["trace", "FILE", "-o", "same", "--json", "./same"], "is also the output of --json"),
    (["trace", "FILE", "-o", "x.csv"], "-o: 'x.csv' has the suffix .csv; must end in .h5 or .hdf5"),
    (["trace", "FILE", "--json", "x.h5"], "--json: 'x.h5' has the suffix .h5; must end in .json"),
    (["trace", "FILE", "--time-limit", "0"], "--time-limit: 0; must be greater than zero"),
    (["trace", "FILE", "--time-limit", "3 s"], "--time-limit: '3 s'; must be a number"),
    (["solve", "FILE"], "--load, --displacement: give one of them"),
    (["solve", "FILE", "--load", "1", "--displacement", "1"], "--load, --displacement: give one of them"),
    (["solve", "FILE", "--load", "nan"], "--load: nan"),
    (["show"], "Missing argument 'FILE.h5'"),
    (["show", "missing.h5"], "'missing.h5' is not a file"),
    (["show", "FILE"], "is not an HDF5 file"),
]


@pytest.mark.parametrize(("arguments", "words"), WRONG, ids=[" ".join(a) or "nothing" for a, _ in WRONG])
def test_wrong_input_is_one_line_and_status_2(
    arguments: list[str], words: str, calls: list, contact: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(Path(contact).parent)
    assert main([contact if a == "FILE" else a for a in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("contbranch: ")
    assert words in err
    assert calls == []  # found before anything is computed
    assert [path.name for path in Path().iterdir()] == ["contact.toml"]


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (
            InputError("load: -50; must be at least -5.03\n(pull-off)"),
            2,
            "load: -50; must be at least -5.03 (pull-off)",
        ),
        (ModelError("no equilibrium was reached"), 1, "no equilibrium was reached"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_errors_of_the_computation(
    error: BaseException, status: int, line: str, contact: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(contbranch, "solve", fails, raising=False)
    assert main(["solve", contact, "--load", "-50"]) == status
    out, err = capsys.readouterr()
    assert (out, err.strip()) == ("", f"contbranch: {line}")


def test_a_mistake_of_ours_is_not_called_wrong_input(contact: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(contbranch, "trace", fails, raising=False)
    with pytest.raises(ZeroDivisionError):
        main(["trace", contact])


def test_a_folder_without_permission(
    calls: list, contact: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)  # root may write everywhere
    assert main(["trace", contact, "-o", str(tmp_path / "x.h5")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert calls == []


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_a_bar_on_a_terminal_and_elsewhere_a_line_in_ten_seconds(
    terminal: bool, contact: str, attraction: Diagram, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]

    def trace(*_: object, **__: object) -> Diagram:
        for second in range(25):
            now[0] = float(second)
            tell(second / 25, "in contact")
        return attraction

    monkeypatch.setattr(contbranch, "trace", trace, raising=False)
    monkeypatch.setattr(summary.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    assert main(["trace", contact, "--json", "-"]) == 0
    shown = capsys.readouterr().err
    if terminal:
        assert shown.count("\r") > 20
        assert shown.endswith(" \r")
    else:
        assert shown.splitlines() == [f"contbranch: {4 * s}% after 0:{s}, in contact" for s in (10, 20)]


def test_help_names_every_option(capsys: Capture) -> None:
    assert main(["trace", "--help"]) == 0
    text = capsys.readouterr().out
    options = ["--interaction", "--tabor", "--repulsive", "--control", "--accuracy", "--model", "--max-load", "--json"]
    options += ["--cell", "--grid"]
    assert [option for option in [*options, "--plot", "-o"] if option not in text] == []
    assert "╭" not in text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (8.0065114123, 3e-9, "8.006511412(3)"),
        (8.0065114123, 2.1e-9, "8.006511412(3)"),
        (-218.44, 0.96, "-218(1)"),
        (-218.44, 0.02, "-218.44(2)"),
        (1234.0, 20.0, "1230(20)"),
        (0.0, 1e-9, "0.000000000(1)"),
        (1.5, None, "1.5"),
        (1.0 / 3.0, 0.0, "0.33333333333333"),
        (12.5, 1e-18, "12.5000000000000(1)"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_numbers_show_the_digits_that_their_error_leaves(value: float, error: float | None, text: str) -> None:
    assert summary.with_error(value, error) == text


def run(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)


def test_as_a_process(contact: str) -> None:
    done = run("import sys; from contbranch.cli import main; sys.exit(main())", "trace", contact, "--accuracy", "much")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "contbranch: --accuracy: 'much'; must be a number\n"
    module = subprocess.run([sys.executable, "-m", "contbranch", "--version"], capture_output=True, text=True)
    assert module.stdout.startswith("contbranch ")


LOADED = "import sys, contbranch.cli as c; c.main(sys.argv[1:]); print(*sorted(sys.modules), file=sys.stderr)"


@pytest.mark.parametrize(
    ("arguments", "unused"),
    [
        (["--help"], ["h5py", "matplotlib", "numpy", "pint", "scipy"]),
        (["trace", *GAUSS, "--plot", "x.gif"], ["h5py", "matplotlib", "numpy", "pint", "scipy"]),
        (["trace", "missing.toml"], ["h5py", "matplotlib", "numpy", "pint", "scipy"]),
        (["trace", *GAUSS, "--max-load", "far"], ["h5py", "matplotlib", "pint", "scipy.interpolate", "scipy.linalg"]),
    ],
)
def test_libraries_are_imported_only_where_needed(arguments: list[str], unused: list[str]) -> None:
    loaded = run(LOADED, *arguments).stderr.split()
    assert "contbranch.cli.commands" in loaded
    assert [name for name in unused if name in loaded] == []


def test_reader_that_leaves_early(contact: str) -> None:
    code = "import sys, contbranch; from contbranch.cli import main\nsys.exit(main(['--help']))"
    shell = f'{sys.executable} -c "{code}" | head -c 1'
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, check=False)
    assert done.stderr == ""
