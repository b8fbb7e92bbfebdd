"""Tables: CSV, pandas and xarray, with units and every digit."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import contbranch as cb
from contbranch.cli import main

CONTACT = cb.Contact.physical(
    radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="-40 mN/m", range="1 nm"
)


@pytest.fixture(scope="module")
def diagram():
    return cb.trace(CONTACT, accuracy=1e-4)


def test_the_points_of_all_branches_keep_all_digits(diagram, tmp_path):
    path = tmp_path / "points.csv"
    diagram.to_csv(path)
    first = path.read_text().splitlines()[0].split(",")
    assert first[:8] == [
        "load [nN]", "displacement [nm]", "contact_radius [nm]", "central_gap [nm]", "energy [nN·nm]", "branch",
        "unstable_load", "unstable_displacement",
    ]  # fmt: skip
    read = pd.read_csv(path)
    for heading, name in (("load [nN]", "load"), ("load_error [nN]", "load_error"), ("unstable_load", "unstable_load")):
        np.testing.assert_array_equal(read[heading], np.concatenate([getattr(b, name) for b in diagram.branches]))
    pd.testing.assert_frame_equal(read, diagram.to_dataframe())
    plain = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(plain[:, 1], read["displacement [nm]"])


def test_the_events_are_a_table_with_their_errors(diagram, tmp_path):
    path = tmp_path / "events.csv"
    diagram.events_to_csv(path)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == [event.kind for event in diagram.events]
    for row, event in zip(rows, diagram.events, strict=True):
        assert row["name"] == (event.name or "")
        assert float(row["load [nN]"]) == event.load
        assert float(row["load_error [nN]"]) == event.error["load"]


def test_xarray_has_units_and_the_contact(diagram, tmp_path):
    data = diagram.to_xarray()
    assert data["load"].attrs["units"] == "nN"
    assert data["contact_radius"].dims == ("point",)
    assert data.event_displacement.attrs["units"] == "nm"
    assert data.event_displacement.values.tolist() == [event.displacement for event in diagram.events]
    assert json.loads(data.attrs["contact"])["material"]["modulus"] == 5.0
    assert isinstance(data, xr.Dataset)


def test_a_reduced_contact_has_no_units(tmp_path):
    loop = cb.hysteresis(cb.Contact.reduced("maugis-dugdale", tabor=1.0), control="displacement")
    loop.to_csv(tmp_path / "loop.csv")
    read = pd.read_csv(tmp_path / "loop.csv")
    assert list(read)[:5] == ["load", "displacement", "contact_radius", "central_gap", "energy"]
    np.testing.assert_array_equal(read["position"], loop.path.position)
    assert set(read["direction"]) == {-1, 1}


def test_a_position_is_in_the_unit_of_what_is_controlled():
    contact = replace(CONTACT, interaction=cb.MaugisDugdale(0.04, 1.0))
    assert "position [nN]" in cb.hysteresis(contact, control="load").to_dataframe()
    assert "position [nm]" in cb.hysteresis(contact, control=cb.Spring(2000.0)).to_dataframe()


def test_followed_events_and_solutions_have_tables(diagram, tmp_path):
    fold = next(event for event in diagram.events if event.name == "squeeze-out")
    followed = cb.follow(fold, "interaction[0].range", to=1.05, accuracy=1e-4)
    frame = followed.to_dataframe()
    assert list(frame)[:2] == ["interaction[0].range [nm]", "load [nN]"]
    np.testing.assert_array_equal(frame["load_error [nN]"], followed.error["load"])
    found = cb.find_all(CONTACT, load=0.5 * fold.load, accuracy=1e-4)
    frame = found.to_dataframe()
    assert len(frame) == len(found)
    assert frame["connected"].tolist() == list(found.connected)
    assert frame["energy [nN·nm]"].tolist() == [state.energy for state in found]
    single = cb.solve(CONTACT, load=0.5 * fold.load, accuracy=1e-4).to_dataframe()
    assert single.shape[0] == 1


def test_the_command_line_writes_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    contact = ["--interaction", "maugis-dugdale", "--tabor", "1"]
    assert (
        main(["trace", *contact, "--csv", "t.csv", "--events-csv", "e.csv", "--plot", "a.png", "--plot", "b.svg"]) == 0
    )
    assert Path("a.png").stat().st_size > 1000 < Path("b.svg").stat().st_size
    assert "load" in pd.read_csv("t.csv")
    assert "touch" in set(pd.read_csv("e.csv")["kind"])
    assert main(["solve", *contact, "--load", "1", "--csv", "s.csv"]) == 0
    assert pd.read_csv("s.csv")["load"].tolist() == [1.0]
    written = {"--csv": "t.csv", "--events-csv": "e.csv"}
    for option, name in written.items():
        capsys.readouterr()
        assert main(["trace", *contact, option, "-"]) == 0
        assert capsys.readouterr().out == Path(name).read_text()
    assert main(["trace", *contact, "--csv", "-", "--json", "-"]) == 2
    assert main(["trace", *contact, "-o", "-"]) == 2
    assert capsys.readouterr().err.count("standard output takes one of") == 2
    assert not Path("-").exists()


@pytest.mark.parametrize(
    ("option", "name", "told"),
    [
        ("-o", "x.csv", ".h5"),
        ("--json", "x.h5", ".json"),
        ("--csv", "x.json", ".csv"),
        ("--events-csv", "x.png", ".csv"),
    ],
)
def test_a_suffix_of_another_option_is_refused(option, name, told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["trace", "--interaction", "gauss", "--tabor", "1", option, name]) == 2
    assert told in capsys.readouterr().err
    assert not Path(name).exists()


def test_exponents_are_found_only_for_who_asks(diagram, tmp_path):
    """They take as long as the trace; what is printed and the table of points have none."""
    asked = []
    own = replace(diagram, events=tuple(replace(event, critical=lambda: asked.append(1)) for event in diagram.events))
    assert "squeeze-out" in str(own)
    own.to_csv(tmp_path / "points.csv")
    assert not asked
    assert "exponent" not in own.tables()["event"].columns
    assert len(asked) == len(own.events)
