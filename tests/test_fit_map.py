"""Maps of force curves: what was put in is found where it was put, and one bad curve does no harm."""

import csv
import json
import math
import re
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.contact.file import read_contact
from contbranch.contact.units import readable
from contbranch.measure.maps import _laid_out
from contbranch.measure.reading import curves_in

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies.fit_map import CONTACT, pattern, written  # noqa: E402


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("map")
    (folder / "contact.toml").write_text(CONTACT)
    (folder / "curves").mkdir()
    written(folder / "curves", 2, count=80)
    return folder


def fitted(folder, **settings):
    contact, _ = read_contact(folder / "contact.toml")
    with ThreadPoolExecutor(1) as executor:
        return cb.fit_map(folder / "curves", contact, folder / "map.h5", executor=executor, spring=5.0, **settings)


def test_a_folder_is_fitted_and_a_bad_curve_fails_alone(folder):
    xarray = pytest.importorskip("xarray")
    found = fitted(folder)
    assert found.computed == 4
    assert found.mode == "grid"
    for name, true in zip(("modulus", "work_of_adhesion"), pattern(2), strict=True):
        x, y, values = found.picture(name)
        assert x.tolist() == y.tolist() == [0.0, 1.0]
        assert (np.abs(values - true) < 5 * found.picture(f"{name}_error").values).all()
    with xarray.open_dataset(folder / "map.h5", engine="h5netcdf") as data:
        assert data["modulus"].dims == ("row", "column")
        assert data["modulus"].attrs["units"] == "nN/nm²"
        assert data["modulus"].sel(row=1, column=0) == found.picture("modulus").values[1, 0]
    (folder / "curves" / "x0_y2.csv").write_text("piezo [nm],force [nN]\n1,nan\n2,3\n")
    again = fitted(folder, resume=True)
    assert (again.computed, again.reused, len(again.failed)) == (1, 4, 1)
    assert "at least 16" in again.failed[0].message
    assert "x0_y2.csv" in again.failed[0].message
    loaded = cb.load(folder / "map.h5")
    assert type(loaded) is cb.FitMap
    values = loaded.picture("modulus").values
    assert values.shape == (3, 2)
    assert np.isnan(values).tolist() == [[False, False], [False, False], [True, True]]
    assert np.array_equal(values[:2], found.picture("modulus").values)
    assert "modulus [nN/nm²]" in loaded.table().headings
    axes = loaded.plot().axes
    assert [one.get_title() for one in axes[:2]] == ["modulus (MPa)", "work of adhesion (mN/m)"]
    with pytest.raises(cb.InputError, match="none"):
        loaded.diagram(0)


def test_a_file_that_is_no_curve_leaves_the_others_their_places(folder, tmp_path):
    contact, _ = read_contact(folder / "contact.toml")
    for place in ("x0_y0", "x1_y0", "x0_y1", "x1_y1"):
        shutil.copy(folder / "curves" / "x0_y0.csv", tmp_path / f"{place}.csv")
    (tmp_path / "notes.txt").write_text("Tip 3, in air.\nAfter lunch.\n")
    with pytest.warns(UserWarning, match=r"Left out, .*notes\.txt"):
        design = _laid_out(contact, list(curves_in(tmp_path, 5.0)), None)
    assert (design.mode, len(design)) == ("grid", 4)
    assert design.parameters(3) == {"row": 1.0, "column": 1.0}


@pytest.mark.filterwarnings("default:Left out")
def test_every_curve_says_its_file(folder, capsys, tmp_path, monkeypatch):
    """In table, CSV, JSON and HDF5, whether it was fitted or not; a map that is resumed takes over other names."""
    xarray = pytest.importorskip("xarray")
    monkeypatch.chdir(tmp_path)
    Path("c").mkdir()
    for name in ("x-1_y0.csv", "x0_y0.csv"):
        shutil.copy(folder / "curves" / "x0_y0.csv", Path("c", name))
    Path("c", "x0.5_y0.csv").write_text("piezo [nm],force [nN]\n" + "\n".join(f"{z},1" for z in range(99)))
    shutil.copy(folder / "curves" / "x0_y0.csv", Path("c", "reference.csv"))
    given = ["fit", "c", str(folder / "contact.toml"), "--free", "modulus", "--spring", "5 N/m", "--workers", "1"]
    given += ["-o", "m.h5", "--csv", "m.csv", "--json", "m.json"]
    assert main(given) == 0
    said, warned = capsys.readouterr()
    assert "Left out" in warned
    assert "reference.csv" in warned
    sources = [str(Path("c", name)) for name in ("x-1_y0.csv", "x0_y0.csv", "x0.5_y0.csv")]
    assert all(source in said for source in sources)
    assert f"there is no contact to fit ('{sources[2]}')" in said
    document = json.loads(Path("m.json").read_text())
    assert [task["source"] for task in document["tasks"]] == sources
    assert [task["parameters"]["column"] for task in document["tasks"]] == [-1.0, 0.0, 0.5]
    heading, *rows = Path("m.csv").read_text().splitlines()
    assert heading.startswith("index,source,row,column,")
    assert [row.split(",")[1] for row in rows] == sources
    assert [task.source for task in cb.load("m.h5").tasks] == sources
    with xarray.open_dataset("m.h5", engine="h5netcdf") as data:
        assert data["source"].dims == ("row", "column")
        assert data["source"].sel(row=0, column=-1) == sources[0]
    Path("c").rename("d")
    assert main(["d" if word == "c" else word for word in given] + ["--resume"]) == 0
    assert "0 computed, 3 known before" in capsys.readouterr().out
    assert [task.source for task in cb.load("m.h5").tasks] == [source.replace("c", "d", 1) for source in sources]


def test_a_failure_of_any_kind_names_the_file(folder, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise cb.ModelError("lost")

    monkeypatch.setattr("contbranch.measure.maps.fit", broken)
    contact, _ = read_contact(folder / "contact.toml")
    with ThreadPoolExecutor(1) as executor:
        found = cb.fit_map(folder / "curves" / "x0_y0.csv", contact, tmp_path / "m.h5", executor=executor, spring=5.0)
    assert found.failed[0].message == f"ModelError: lost ('{folder / 'curves' / 'x0_y0.csv'}')"


@pytest.mark.parametrize(
    ("names", "places"),
    [
        (("x-1_y2", "x0_y-3"), ((-1.0, 2.0), (0.0, -3.0))),
        (("map_x0.5_y1.25", "map_x1_y2"), ((0.5, 1.25), (1.0, 2.0))),
        (("x-3-y-12", "x-0-y-1"), ((3.0, 12.0), (0.0, 1.0))),
        (("x_-1_y_2", "x 1 y 2,5"), ((-1.0, 2.0), (1.0, 2.5))),
        (("row2-col7", "r3c-1"), ((7.0, 2.0), (-1.0, 3.0))),
    ],
)
def test_places_in_names_may_be_negative_or_decimal(tmp_path, names, places):
    for name in names:
        (tmp_path / f"{name}.csv").write_text("no curve")
    found = [(one.place["column"], one.place["row"]) for one in curves_in(tmp_path)]
    assert sorted(found) == sorted(places)


def test_many_curves_are_never_taken_for_one(folder, capsys, tmp_path):
    """Neither a folder nor a file with two curves is fitted without a file for the results."""
    contact = str(folder / "contact.toml")
    assert main(["fit", str(folder / "curves"), contact, "--spring", "5 N/m"]) == 2
    lines = (folder / "curves" / "x0_y0.csv").read_text().splitlines()
    text = [f"curve,x [um],y [um],{lines[0]}"]
    text += [f"{k},{0.1 * k},0.5,{line}" for k in (0, 1) for line in lines[1:]]
    both = tmp_path / "both.csv"
    both.write_text("\n".join(text))
    assert [one.place for one in cb.read_force_curves(both, spring=5.0)] == [
        {"x": 0.0, "y": 500.0},
        {"x": pytest.approx(100.0), "y": 500.0},
    ]
    assert main(["fit", str(both), contact, "--spring", "5 N/m"]) == 2
    assert "2 curves" in capsys.readouterr().err
    assert main(["fit", str(both), contact, "-o", str(tmp_path / "m.h5"), "--shape", "1", "--spring", "5 N/m"]) == 2
    assert "ROWSxCOLUMNS" in capsys.readouterr().err
    options = ["--free", "modulus", "--spring", "5 N/m", "-o", tmp_path / "m.h5"]
    options += ["--shape", "2x1", "--workers", "1", "--json", "-"]
    assert main(["fit", str(both), contact, *map(str, options)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["format"] == "contbranch-fit-map"
    assert [task["parameters"] for task in document["tasks"]] == [
        {"row": 0.0, "column": 0.0},
        {"row": 1.0, "column": 0.0},
    ]


def test_digits_that_are_no_numbers_are_refused(folder, capsys):
    given = [str(folder / "curves"), str(folder / "contact.toml"), "-o", str(folder / "digits.h5")]
    for option, value in (("--shape", "²x2"), ("--workers", "²")):
        assert main(["fit", *given, option, value]) == 2
        assert capsys.readouterr().err.startswith(f"contbranch: {option}: '{value}'; ")


def test_a_map_of_which_nothing_is_determined_says_so(folder, capsys, tmp_path, monkeypatch):
    """In words, by its exit status, and with columns that are empty."""
    monkeypatch.chdir(tmp_path)
    Path("c").mkdir()
    for place in ("x0_y0", "x1_y0"):
        Path("c", f"{place}.csv").write_text("piezo [nm],force [nN]\n" + "\n".join(f"{z},1" for z in range(99)))
    given = ["fit", "c", str(folder / "contact.toml"), "--spring", "5 N/m", "--fixed", "tilt", "--workers", "1"]
    assert main([*given, "-o", "m.h5", "--csv", "m.csv"]) == 1
    said, told = capsys.readouterr()
    assert re.search(r"\nmodulus +0 of 2 +–", said)
    assert told.splitlines()[-1] == "contbranch: nothing is determined in any curve"
    names = {f"{name}{end}" for name in ("modulus", "work_of_adhesion", "contact_point", "baseline")
             for end in ("", "_error")}  # fmt: skip
    rows = list(csv.DictReader(Path("m.csv").read_text().splitlines()))
    columns = [column for column in rows[0] if column.partition(" [")[0] in names]
    assert len(columns) == len(names)
    assert {row[column] for row in rows for column in columns} == {""}
    found = cb.load("m.h5")
    assert set(found.names) == names
    assert "nothing is determined in any curve" in str(found)
    (words,) = (text.get_text() for text in found.plot().texts)
    assert words == "No curve determines a value."
    found.plot("modulus")


def test_settings_of_a_fit_and_of_the_reading_are_passed_on(folder, tmp_path, monkeypatch):
    heard = {}

    def noted(curve, contact, free, **settings):
        heard.update(settings)
        raise cb.ModelError("lost")

    monkeypatch.setattr("contbranch.measure.maps.fit", noted)
    wanted = {"leg": "approach", "baseline": "each", "max_indentation": "50 nm", "max_force": 2.0, "fixed": ("tilt",)}
    curve = cb.read_force_curve(folder / "curves" / "x0_y0.csv", 5.0)
    monkeypatch.setattr("contbranch.measure.maps.curves_in", lambda path, **how: heard.update(how) or [curve])
    with ThreadPoolExecutor(1) as executor:
        cb.fit_map("c", read_contact(folder / "contact.toml")[0], tmp_path / "m.h5", executor=executor, law=None,
                   sensitivity="50 nm/V", columns="piezo=Z", **wanted)  # fmt: skip
    assert heard == {**wanted, "time_limit": 600.0, "sensitivity": "50 nm/V", "columns": "piezo=Z"}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((1.234e-6, "nN/nm²", 4e-8), "1.234 ± 0.040 kPa"),
        ((1388.553, "nm", 0.17), "1388.55 ± 0.17 nm"),
        ((-3.4e-6, "nN/nm²", 9.96e-5), "0 ± 100 kPa"),
        ((0.02, "nN/nm", 0.0004), "20.00 ± 0.40 mN/m"),
        ((0.02, "nN/nm", None, "spring"), "0.02 N/m"),
        ((0.0, "nN", 0.0), "0 pN"),
        ((1.5, "", math.inf), "1.5 ± ∞"),
        ((math.nan, "nm", 1.0), "–"),
    ],
)
def test_values_are_said_in_units_for_people(given, said):
    assert readable(*given) == said


def test_samples_left_out_are_drawn_as_such(folder):
    curve = cb.read_force_curve(folder / "curves" / "x0_y0.csv", 5.0)
    fit = cb.fit(curve, read_contact(folder / "contact.toml")[0])
    part = np.arange(len(curve)) % 50 == 1
    out, none = (replace(fit, residuals=np.where(some, np.nan, curve.force)) for some in (part, ~part & part))
    labels = [[text.get_text() for text in one.plot().legends[0].texts] for one in (out, none)]
    assert ["left out" in one for one in labels] == [True, False]
