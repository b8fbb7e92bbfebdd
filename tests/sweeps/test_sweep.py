"""Sweeps: what varies, what is found, and that it is what single traces find."""

from __future__ import annotations

import json
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
from sweep_tasks import Number, Squares

import contbranch as cb
from contbranch.cli import main
from contbranch.control import DISPLACEMENT
from contbranch.output import sweep_file
from contbranch.sweeps.design import read_sweep
from contbranch.sweeps.tasks import Tracing, key_of

FILM = cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1)
TOML = """
[tip]
shape = "parabola"
radius = "1 um"
[material]
modulus = "5 GPa"
[[interaction]]
law = "maugis-dugdale"
work_of_adhesion = "40 mN/m"
range = "1 nm"
[trace]
control = "displacement"
[sweep]
task_limit = 100
[sweep.vary]
"interaction[0].range" = ["0.5 nm", "1 nm"]
"tip.radius" = { from = "0.5 um", to = "2 um", count = 3, spacing = "log" }
"""


class AtOnce(Executor):
    """Computes when it is asked to."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(fn(*args, **kwargs))
        return done


def numbers(count: int) -> list[Number]:
    return [Number(value) for value in range(count)]


def test_a_grid_has_all_combinations_the_last_parameter_changing_fastest() -> None:
    design = cb.varied(FILM, {"tip.radius": [1.0, 2.0], "interaction.range": [0.25, 0.5, 1.0]})
    assert (design.shape, len(design), len(design[1:3])) == ((2, 3), 6, 2)
    assert design[4] == cb.Contact(cb.Parabola(2.0), cb.Gauss(work_of_adhesion=-1.0, range=0.5))
    assert design.parameters(4) == {"tip.radius": 2.0, "interaction.range": 0.5}
    pairs = cb.varied(FILM, {"tip.radius": [1.0, 2.0], "interaction.range": [0.25, 0.5]}, mode="zip")
    assert [contact.tip.radius for contact in pairs] == [1.0, 2.0]
    assert pairs[-1] == design[4]


def test_sweep_files_have_units_and_ranges(tmp_path: Path) -> None:
    """The middle of three radii from 500 nm to 2 µm in equal ratios is 1 µm."""
    path = tmp_path / "s.toml"
    path.write_text(TOML)
    design, settings = read_sweep(path)
    assert design.axes["tip.radius"] == pytest.approx((500.0, 1000.0, 2000.0), rel=1e-14)
    assert design.axes["interaction[0].range"] == (0.5, 1.0)
    assert settings == {"task_limit": 100, "control": DISPLACEMENT}


def test_the_modulus_has_the_name_that_it_has_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(TOML.replace('"interaction[0].range" = ["0.5 nm", "1 nm"]', '"material.modulus" = ["1 GPa"]'))
    design, _ = read_sweep(path)
    assert [contact.modulus for contact in design] == [1.0, 1.0, 1.0]
    assert cb.varied(FILM, {"modulus": [2.0]})[0].modulus == 2.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"0.5 nm", "1 nm"]', "0.5, 1.0]", r"sweep.vary.interaction\[0\].range: 0.5; add the unit"),
        ("count = 3", "count = 0", "sweep.vary.tip.radius.count: 0; must be a whole number"),
        ("count = 3, ", "", "sweep.vary.tip.radius.count: missing"),
        ('from = "0.5 um"', 'from = "-0.5 um"', "spacing log"),
        ('"tip.radius"', '"tip.radios"', "sweep.vary: 'tip.radios'; Parabola has the numbers radius; did you mean"),
        ("task_limit", "tusk_limit", "sweep.tusk_limit: not known"),
        ('"1 nm"]', '"-1 nm"]', r"sweep.vary: interaction\[0\].range: -1; must be greater than zero"),
        ("[sweep.vary]", '[sweep]\nmode = "zip"\n[sweep.vary]', "TOML"),
        ("[sweep]", '[sweep]\nmode = "zip"', "sweep.vary: lists of different lengths"),
        ("[sweep]", '[sweep]\nmode = "box"', "sweep.mode: 'box'"),
    ],
)
def test_wrong_sweep_files_are_refused_by_field(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "s.toml"
    assert old in TOML
    path.write_text(TOML.replace(old, new))
    with pytest.raises(cb.InputError, match=words):
        read_sweep(path)


def test_contacts_of_a_list_may_have_tips_of_different_shapes(tmp_path: Path) -> None:
    shapes = [cb.Parabola(1.0), cb.Cone(1.0)]
    contacts = [cb.Contact(tip, cb.Exponential(-1.0, 1.0)) for tip in shapes]
    found = cb.sweep(contacts, tmp_path / "s.h5", executor=AtOnce(), accuracy=1e-4)
    assert found.status == "complete"
    assert found.axes["tip.slope"][1] == 1.0
    assert found.tasks[1].thresholds == cb.trace(contacts[1], accuracy=1e-4).thresholds
    assert [task.thresholds for task in cb.load(tmp_path / "s.h5").tasks] == [task.thresholds for task in found.tasks]


def test_a_sweep_finds_what_traces_find_bit_for_bit(tmp_path: Path) -> None:
    """On processes of this machine, for contacts without a grid; xarray has their parameters as coordinates."""
    contacts = [cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0), cb.Contact.reduced(cb.Gauss, tabor=2.0, sign=-1)]
    found = cb.sweep(contacts, tmp_path / "s.h5", workers=1, accuracy=1e-4)
    assert (found.status, found.computed, found.reused) == ("complete", 2, 0)
    assert found.parameters == ("interaction[0].work_of_adhesion", "interaction[0].range")
    assert cb.load(tmp_path / "s.h5").tasks == found.tasks
    for index, contact in enumerate(contacts):
        trace, kept = cb.trace(contact, accuracy=1e-4), found.diagram(index)
        assert kept.contact == contact
        assert kept.thresholds == trace.thresholds == found.tasks[index].thresholds
        assert [e.name for e in kept.events] == [e.name for e in trace.events]
        assert [e.error for e in kept.events] == [e.error for e in trace.events]
        for one, other in zip(kept.branches, trace.branches, strict=True):
            assert np.array_equal(one.load, other.load)
            assert np.array_equal(one.unstable_load, other.unstable_load)
            assert np.array_equal(one.state(-1).gap, other.state(-1).gap)
            assert np.array_equal(one.state(2).pressure, other.state(2).pressure)
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf") as data:
        assert data["interaction[0].range"].values.tolist() == [1.0, 0.5]
        assert data["touch_load"].dims == ("task",)
        assert data["touch_load"].values[1] == found.tasks[1].thresholds["touch_load"]
    assert repr(found).startswith("Sweep of")
    assert len(found.to_dataframe()) == 2


def test_the_command_writes_a_grid_in_units_and_computes_nothing_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "s.toml", tmp_path / "s.h5"
    path.write_text(TOML.replace("count = 3", "count = 1"))
    assert main(["sweep", str(path), "-o", str(out), "--workers", "1", "--json", "-"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["parameters"] == ["interaction[0].range", "tip.radius"]
    assert [task["parameters"]["tip.radius"] for task in first["tasks"]] == [500.0, 500.0]
    assert (first["computed"], first["reused"]) == (2, 0)
    assert main(["sweep", str(path), "-o", str(out)]) == 2
    assert "add --resume" in capsys.readouterr().err
    path.write_text(TOML.replace("count = 3", "count = 1").replace('"0.5 nm", "1 nm"', '"1 nm", "0.5 nm", "1 nm"'))
    assert main(["sweep", str(path), "-o", str(out), "--resume", "--json", "-"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert (again["computed"], again["reused"]) == (0, 3)
    assert again["tasks"][1]["thresholds"] == first["tasks"][0]["thresholds"]
    with xarray.open_dataset(out, engine="h5netcdf") as data:
        assert data["pull_off_load"].sizes == {"interaction[0].range": 3, "tip.radius": 1}
        assert data["pull_off_load"].attrs["units"] == "nN"
        assert data["tip.radius"].attrs["units"] == "nm"


@pytest.mark.parametrize("make", [AtOnce, lambda: ThreadPoolExecutor(3)])
def test_any_executor_will_do(tmp_path: Path, make: Any) -> None:
    with make() as executor:
        found = cb.sweep(numbers(40), tmp_path / "s.h5", executor, task=Squares(tmp_path / "notes"))
    assert [task.thresholds["touch_load"] for task in found.tasks] == [k * k for k in range(40)]
    with h5py.File(tmp_path / "s.h5") as file:
        assert file["tasks/point_count"][()].tolist() == [k % 7 for k in range(40)]
        assert file["tasks/point.load"][1:3].tolist() == [0.0, 4.0]  # 1 row of task 1, 2 of task 2


def test_equal_contacts_are_computed_once(tmp_path: Path) -> None:
    found = cb.sweep([Number(3)] * 4, tmp_path / "s.h5", AtOnce(), task=Squares(tmp_path / "notes"))
    assert (found.computed, found.reused) == (1, 3)
    assert (tmp_path / "notes").read_text() == "3\n"


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    cb.sweep(numbers(3), tmp_path / "s.h5", AtOnce(), task=Squares(tmp_path / "notes"))
    data = bytearray((tmp_path / "s.h5").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "s.h5").write_bytes(data)
    with pytest.raises(cb.InputError, match="damaged"):
        cb.load(tmp_path / "s.h5")


@pytest.mark.parametrize(
    ("contacts", "settings", "words"),
    [
        ([], {}, "contacts: none"),
        ([1], {}, "contacts: number 0 is int"),
        ([FILM], {"kep": "curves"}, "kep: not known"),
        ([FILM], {"keep": "all"}, "keep: 'all'"),
        ([FILM], {"task_limit": -1}, "task_limit"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path: Path, contacts: Any, settings: Any, words: str) -> None:
    with pytest.raises(cb.InputError, match=words):
        cb.sweep(contacts, tmp_path / "s.h5", AtOnce(), **settings)
    assert list(tmp_path.iterdir()) == []


def test_contacts_that_cannot_be_told_apart_or_compared_are_refused(tmp_path: Path) -> None:
    def law(slope: float) -> cb.Interaction:
        class Own(cb.Interaction):
            def shape(self, x: Any) -> Any:
                f = np.exp(-x)
                return f * (1 + slope * x), f * (slope - 1 - slope * x), f * (1 - 2 * slope + slope * x)

        return Own(1.0, 1.0)

    alike = [cb.Contact(cb.Parabola(1.0), law(slope)) for slope in (0.0, 0.3)]
    with pytest.raises(cb.InputError, match="numbers 0 and 1 differ by nothing that"):
        cb.sweep(alike, tmp_path / "s.h5")
    physical = cb.Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="1 mN/m", range="1 nm"
    )
    with pytest.raises(cb.InputError, match="number 1 has other units than number 0"):
        cb.sweep([physical, cb.Contact.reduced("gauss")], tmp_path / "s.h5")
    for names in (("modulus", "material.modulus"), ("interaction.range", "interaction[0].range")):
        with pytest.raises(cb.InputError, match="is there twice, under two names"):
            cb.varied(cb.Contact.reduced("gauss"), {name: [1.0, 2.0] for name in names})


def test_a_parameter_that_a_later_one_changes_is_refused() -> None:
    """The file would give a contact a Tabor coefficient that it does not have."""
    single = cb.Contact.reduced("exponential", tabor=1.0)
    vary = {"tabor": [1.0, 2.0], "interaction.work_of_adhesion": [1.0, 2.0]}
    with pytest.raises(cb.InputError, match=r"tabor is 3\.1748 and no longer 2 once interaction\.work_of_adhesion"):
        cb.varied(single, vary)
    turned = cb.varied(single, dict(reversed(vary.items())))
    assert [one.tabor for one in turned] == pytest.approx([1.0, 2.0, 1.0, 2.0])
    laws = [law(work_of_adhesion=-0.5, range=1.0) for law in (cb.Exponential, cb.Gauss)]
    both = cb.Contact(cb.Parabola(1.0), sum(laws[1:], laws[0]))
    vary = {"share": [0.0, 0.5, 1.0], "interaction[1].range": [0.5, 1.0]}
    with pytest.raises(cb.InputError, match="range cannot be set once share is 0; name it before"):
        cb.varied(both, vary)
    assert len(cb.varied(both, dict(reversed(vary.items())))) == 6


def test_springs_that_print_alike_have_results_of_their_own() -> None:
    contact = cb.Contact.reduced("gauss")
    one, other = (key_of(contact, Tracing(cb.Spring(stiffness))) for stiffness in (0.12345671, 0.12345672))
    assert one != other


def test_a_sweep_goes_on_with_no_map_and_with_no_later_version(tmp_path: Path) -> None:
    class Mapping(Squares):
        kind = cb.FitMap

    contacts, path = numbers(2), tmp_path / "s.h5"
    with ThreadPoolExecutor(1) as executor:
        cb.sweep(contacts, path, executor, task=Mapping(tmp_path / "notes"))
        with pytest.raises(cb.InputError, match="holds contbranch-fit-map; choose another file"):
            cb.sweep(contacts, path, executor, resume=True, task=Squares(tmp_path / "notes"))
    path.write_bytes(path.read_bytes()[:-512])
    with h5py.File(path, "a") as file:
        file.attrs["version"] = 2
    label = sweep_file._label(path, path.stat().st_size)
    path.write_bytes(path.read_bytes() + label)
    with pytest.raises(cb.InputError, match="has version 2 of contbranch-fit-map; must be at most 1"):
        cb.load(path)


@pytest.mark.parametrize("stopped", [False, True])
@pytest.mark.parametrize("keep", ["thresholds", "curves"])
def test_a_sweep_that_goes_on_keeps_what_it_has_kept(tmp_path: Path, keep: str, stopped: bool) -> None:
    """The default is profiles here; with it nothing known would be used, and all computed again."""
    path, films = tmp_path / "s.h5", [cb.Contact.reduced("maugis-dugdale", tabor=tabor) for tabor in (0.5, 1.0, 2.0)]

    def two(_: float, told: str) -> None:
        if told.startswith("2 of 3"):
            raise cb.Stop

    if stopped:
        first = cb.sweep(films, path, AtOnce(), keep=keep, accuracy=1e-4, workers=1, progress=two)
        assert (first.status, len(first.tasks), path.exists()) == ("incomplete", 2, False)
    else:
        cb.sweep(films[:2], path, AtOnce(), keep=keep, accuracy=1e-4)
    found = cb.sweep(films, path, AtOnce(), resume=True, accuracy=1e-4)
    assert (found.status, found.computed, found.reused) == ("complete", 1, 2)
    if keep == "curves":
        assert found.diagram(2).branches[0].load.size > 10
    with pytest.raises(cb.InputError, match="keep"):
        cb.sweep(films, path, AtOnce(), resume=True, accuracy=1e-4, keep="all")


def test_what_had_less_time_is_computed_again_where_what_failed_is(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with ThreadPoolExecutor(1) as executor:
        first = cb.sweep([FILM], path, executor, task_limit=1e-3)
        assert [one.status for one in first.tasks] == ["incomplete"]
        for limit, retry, computed in ((100.0, False, 0), (5e-4, True, 0), (100.0, True, 1), (200.0, True, 0)):
            found = cb.sweep([FILM], path, executor, resume=True, retry=retry, task_limit=limit)
            assert found.computed == computed
    assert [one.status for one in found.tasks] == ["complete"]
