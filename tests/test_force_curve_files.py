"""Force curves as instruments write them: legs, pauses, units, springs, and what is said of files that are none."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.measure.reading import Unread, curves_in

JPK = Path(__file__).parent / "reference" / "force_curves" / "fmt-jpk-fd_spot3-0192.jpk-force"
SPRING, SENSITIVITY, COUNT = 0.5, 50.0, 150


def hertz(piezo):
    """Force of 10 MPa on a bead of 2.5 µm on the spring, with noise."""
    depth = np.linspace(0.0, 400.0, 4000)
    load = 4 / 3 * 0.01 * np.sqrt(2500.0) * depth**1.5
    noise = np.random.default_rng(0).standard_normal(np.size(piezo))
    return np.interp(piezo, depth + load / SPRING, load, left=0.0) + 0.02 * noise


UP = np.linspace(-500.0, 200.0, COUNT)
PIEZO = np.append(UP, UP[::-1])
FORCE = hertz(PIEZO)
DEFLECTION = FORCE / SPRING
VOLTS = DEFLECTION / SENSITIVITY


def sizes(curve):
    return curve.leg(False).size, int(curve.pause.sum()), curve.leg(True).size


def written(path, heading, *columns, separator=",", decimal="."):
    rows = [separator.join(f"{x:.9g}".replace(".", decimal) for x in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([*([heading] if isinstance(heading, str) else heading), *rows]), encoding="utf-8")
    return path


# -- legs and pauses --------------------------------------------------------------------------------------------------
def test_a_pause_that_is_named_belongs_to_no_leg():
    words = ["approach"] * 140 + ["pause"] * 20 + ["retract"] * 140
    curve = cb.ForceCurve(piezo=PIEZO, force=FORCE, segment=words)
    assert sizes(curve) == (140, 20, 140)
    assert curve.leg(False).tolist() == list(range(140))
    assert curve.leg(True).tolist() == list(range(160, 300))
    plain = cb.ForceCurve(piezo=PIEZO, force=FORCE, segment=["approach"] * 160 + ["retract"] * 140)
    assert plain.describe() != curve.describe()
    with pytest.raises(cb.InputError, match="segment 'hold'; must be approach, retract, pause, 0 or 1"):
        cb.ForceCurve(piezo=PIEZO, force=FORCE, segment=["hold"] * 300)


@pytest.mark.parametrize("noise", [0.0, 0.05, 2.0])
@pytest.mark.parametrize("everywhere", [False, True])
def test_a_hold_at_the_turn_is_a_pause_and_a_turn_is_none(noise, everywhere):
    """Noise of the positions that are read while the piezo holds, or on the whole way; it moves by 4.7 nm a sample."""
    seed = np.random.default_rng(1)
    held = np.concatenate([UP, np.full(100, UP[-1]), UP[::-1]])
    part = slice(None) if everywhere else slice(COUNT, COUNT + 100)
    held[part] += noise * seed.standard_normal(held[part].size)
    approach, pause, retract = sizes(cb.ForceCurve(piezo=held, force=hertz(held)))
    assert abs(approach - COUNT) <= 6
    assert abs(retract - COUNT) <= 6
    assert approach + pause + retract == held.size
    turned = PIEZO + noise * seed.standard_normal(PIEZO.size) * everywhere
    assert sizes(cb.ForceCurve(piezo=turned, force=FORCE))[1] == 0


@pytest.mark.parametrize("named", [False, True])
def test_one_leg_is_enough(named):
    for own, legs in ((slice(None, COUNT), (COUNT, 0)), (slice(COUNT, None), (0, COUNT))):
        words = [("approach", "retract")[int(legs[0] == 0)]] * COUNT if named else None
        curve = cb.ForceCurve(piezo=PIEZO[own], force=FORCE[own], segment=words)
        approach, pause, retract = sizes(curve)
        assert pause == 0
        assert (approach, retract) == pytest.approx(legs, abs=1)
    with pytest.raises(
        cb.InputError, match="14 samples on approach and retraction, the others in pauses; must be at l"
    ):
        cb.ForceCurve(piezo=PIEZO, force=FORCE, segment=[0] * 7 + ["pause"] * 286 + [1] * 7)


def test_a_curve_may_begin_with_its_retraction_but_not_have_a_wrong_sign():
    order = np.append(np.arange(COUNT, 300), np.arange(COUNT))
    curve = cb.ForceCurve(piezo=PIEZO[order], force=FORCE[order])
    assert sizes(curve) == (COUNT, 0, COUNT)
    assert curve.retract[0]
    assert not curve.retract[-1]
    for own in (slice(None), slice(None, COUNT)):
        with pytest.raises(cb.InputError, match=r"force is larger where the piezo position .*give its negative"):
            cb.ForceCurve(piezo=-PIEZO[own], force=FORCE[own])
    with pytest.raises(cb.InputError, match="does not grow steadily on approach"):
        cb.ForceCurve(piezo=-PIEZO, force=FORCE, segment=np.repeat([0, 1], COUNT))


@pytest.mark.parametrize(
    "way",
    [
        np.repeat(np.linspace(-500.0, 200.0, 15), 10),
        np.append(np.linspace(-500.0, 150.0, 20), np.linspace(150.4, 200.0, 130)),
        np.concatenate([np.linspace(-500.0, 0.0, 30), np.zeros(90), np.linspace(0.0, 200.0, 30)]),
        np.sort(np.random.default_rng(2).uniform(-500.0, 200.0, 150)),
    ],
    ids=["staircase", "dense in contact", "a pause on the way", "random"],
)
def test_unequal_steps_are_steady(way):
    piezo = np.append(way, way[::-1])
    for words in (None, np.repeat([0, 1], way.size)):
        curve = cb.ForceCurve(piezo=piezo, force=hertz(piezo), segment=words)
        assert min(curve.leg(False).size, curve.leg(True).size) > 135


# -- files of instruments ---------------------------------------------------------------------------------------------
def test_a_jpk_file_has_its_legs_spring_and_place():
    pytest.importorskip("afmformats")
    curve = cb.read_force_curve(JPK)
    approach, between, retract = sizes(curve)
    assert (approach, retract) == (2000, 2000 - between)  # as it was told to turn, and as it did
    assert np.argmax(curve.piezo) == approach + between
    assert curve.spring == pytest.approx(0.0434937, rel=1e-6)
    assert curve.place == pytest.approx({"x": -16666.667, "y": -16666.667})
    assert float(np.ptp(curve.force)) == pytest.approx(4.67, abs=0.01)


def test_another_spring_or_sensitivity_changes_the_forces_of_an_instrument():
    pytest.importorskip("afmformats")
    curve = cb.read_force_curve(JPK)
    stiffer = cb.read_force_curve(JPK, spring=2 * curve.spring)
    assert np.allclose(stiffer.force, 2 * curve.force)
    assert stiffer.spring == 2 * curve.spring
    assert (stiffer.piezo == curve.piezo).all()
    other = cb.read_force_curve(JPK, sensitivity="35.00071811501491 nm/V")  # half of its own
    assert np.allclose(other.force, curve.force / 2)
    with pytest.raises(
        cb.InputError, match="sensitivity: '3 nm'; must be a length above zero per V, such as '50 nm/V'"
    ):
        cb.read_force_curve(JPK, sensitivity="3 nm")


def test_segments_of_a_file_are_legs_by_the_way_of_the_piezo(tmp_path):
    """A wait, an approach in two parts, creep by a hundredth of the way, and the retraction."""
    pytest.importorskip("afmformats")
    parts = [np.full(50, -500.0), UP[:100], UP[100:], 200.0 + 7.0 * np.sqrt(np.linspace(0.0, 1.0, 80)), UP[::-1]]
    piezo = np.concatenate(parts)
    with h5py.File(tmp_path / "creep.h5", "w") as file:
        file.attrs.update({"software": "afmformats", "software version": "0.18"})
        group = file.create_group("0")
        group.attrs.update({"imaging mode": "force-distance", "enum": 0})
        group["height (measured)"], group["force"] = -1e-9 * piezo, 1e-9 * hertz(piezo)
        group["segment"] = np.repeat(np.arange(5, dtype=np.uint8), [part.size for part in parts])
    curve = cb.read_force_curve(tmp_path / "creep.h5", spring=SPRING)
    assert sizes(curve) == (COUNT, 130, COUNT)
    assert np.allclose(curve.force, hertz(piezo))  # whose spring is not told: as they are
    with pytest.raises(cb.InputError, match="sensitivity: 50 nm/V; the file holds forces, not its own: leave it out"):
        cb.read_force_curve(tmp_path / "creep.h5", spring=SPRING, sensitivity="50 nm/V")


WORKSHOP = ["Force-Distance Curve", "File Format:\t3", "", "Date:\tWednesday, August 1, 2018", "Time:\t1:06:09 PM"]
WORKSHOP += ["Mode:\tSingle", "Point:\t1", "X, um:\t25.0", "Y, um:\t25.0", ""]


def test_what_a_file_lacks_is_given(tmp_path):
    pytest.importorskip("afmformats")
    heading = [*WORKSHOP, "Extend Z-Sense(nm),Extend T-B(V),Retract Z-Sense(nm),Retract T-B(V)"]
    file = written(tmp_path / "w.csv", heading, UP, VOLTS[:COUNT], UP[::-1], VOLTS[COUNT:])
    spring, volts = "--spring '0.5 N/m'", "--sensitivity '50 nm/V'"
    for given, lacks in (
        ({}, f"{spring} and {volts}"),
        ({"spring": "0.5 N/m"}, volts),
        ({"sensitivity": "50 nm/V"}, spring),
    ):
        with pytest.raises(cb.InputError, match=f"does not tell all that is needed: give {lacks} .*w.csv"):
            cb.read_force_curve(file, **given)
    curve = cb.read_force_curve(file, "0.5 N/m", sensitivity="50 nm/V")
    assert sizes(curve) == (COUNT, 0, COUNT)
    assert np.allclose(curve.force, FORCE)
    assert np.allclose(curve.piezo, PIEZO)
    nova = written(tmp_path / "n.txt", [], UP[::-1], VOLTS[COUNT:], VOLTS[COUNT:], separator="\t", decimal=",")
    assert np.allclose(cb.read_force_curve(nova, 0.5, sensitivity="50 nm/nA").force[-COUNT:], FORCE[COUNT:])
    with pytest.raises(cb.InputError, match="per nA, such as '50 nm/nA'"):
        cb.read_force_curve(nova, 0.5, sensitivity="50 nm/V")


# -- texts ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("heading", "scales", "style", "columns"),
    [
        (["In 2024", "", "Height (nm);Defl (V)"], (-1, 1), (";", ","), "piezo=-Height (nm),deflection=Defl (V)"),
        (["# Z measured [um],F [pN]"], (1e-3, 1e3), (",", "."), {"piezo": "Z measured", "force": "F"}),
        (["Z\tD", "um\tV"], (1e-3, 1), ("\t", "."), "piezo=z, deflection=d"),
        (["Z_nm D_V"], (1, 1), ("  ", "."), "piezo=Z_nm [nm],deflection=D_V [V]"),
        (["Height (measured),D"], (-1e-3, 1), (",", "."), "deflection=D [V],piezo=-Height (measured) [um]"),
        (["piezo [nm],deflection [V]"], (1, 1), (",", "."), None),
        (["piezo [nm]\tdeflection[V]"], (1, 1), ("\t", ","), None),
        (["# Force of a tip, by piezo", "# piezo [nm] deflection [V]"], (1, 1), ("  ", "."), None),
        (["# The force on a tip", "piezo [nm],deflection [V]"], (1, 1), (",", "."), None),
    ],
)  # fmt: skip
def test_columns_are_named(tmp_path, heading, scales, style, columns):
    """Names from any line, signs, decimal commas, and units in brackets, in a line below or added."""
    volts = "F [pN]" not in heading[0]
    values = scales[0] * PIEZO, scales[1] * (VOLTS if volts else FORCE)
    file = written(tmp_path / "x.txt", heading, *values, separator=style[0], decimal=style[1])
    sensitivity = "50 nm/V" if volts else None
    curve = cb.read_force_curve(file, "0.5 N/m", sensitivity=sensitivity, columns=columns)
    assert np.allclose(curve.piezo, PIEZO)
    assert np.allclose(curve.force, FORCE)
    assert sizes(curve) == (COUNT, 0, COUNT)
    assert curve.deflected == volts


def test_legs_side_by_side(tmp_path):
    """As NanoScope exports them, the retraction with fewer samples."""
    table = [f"{UP[k]}\t{UP[::-1][k]}\t{VOLTS[k]}\t{VOLTS[COUNT + k]}\t" for k in range(COUNT - 30)]
    table += [f"{UP[k]}\t\t{VOLTS[k]}\t\t" for k in range(COUNT - 30, COUNT)]
    file = tmp_path / "x.spm.txt"
    file.write_text("\n".join(["Calc_Ramp_Ex_nm\tCalc_Ramp_Rt_nm\tDefl_V_Ex\tDefl_V_Rt\t", *table]))
    curve = cb.read_force_curve(file, "0.5 N/m", sensitivity="50 nm/V")
    assert sizes(curve) == (COUNT, 0, COUNT - 30)
    assert np.allclose(curve.force, FORCE[:-30])
    file.write_text("\n".join(["a\tb\tc\td\t", *table]))
    same = cb.read_force_curve(
        file, "0.5 N/m", sensitivity=50.0, columns="piezo=a,deflection=c [V],piezo=b,deflection=d [V]"
    )
    assert same.describe() == curve.describe()


def jpk_text(unit, values, told="# springConstant: 0.5"):
    lines = ["# TEXT EXPORT", "# data-description.comment: none"]
    parts = ("extend", range(COUNT)), ("pause", [COUNT - 1] * 40), ("retract", range(COUNT, 300))
    for k, (word, own) in enumerate(parts):
        lines += ["# index: -1", f"# segmentIndex: {k}", f"# segment: {word}"]
        lines += ["# columns: verticalTipPosition vDeflection measuredHeight height", '# fancyNames: "Tip" "D" "H" "h"']
        lines += [told, "# calibrationSlots: nominal force nominal nominal", f"# units: m {unit} m m", "#"]
        lines += [f"0.0 {values[i]:.9E} {-1e-9 * PIEZO[i]:.9E} 1.0" for i in own] + [""]
    return "\n".join(lines)


def test_texts_of_jpk_have_segments_and_a_spring(tmp_path):
    file = tmp_path / "x.txt"
    file.write_text(jpk_text("N", 1e-9 * FORCE))
    curve = cb.read_force_curve(file)
    assert sizes(curve) == (COUNT, 40, COUNT)
    assert np.allclose(curve.force[curve.leg(False)], FORCE[:COUNT])
    assert curve.spring == 0.5
    assert np.allclose(cb.read_force_curve(file, "1 N/m").force, 2 * curve.force)
    file.write_text(jpk_text("V", VOLTS, "#"))
    curve = cb.read_force_curve(file, "0.5 N/m", sensitivity="50 nm/V")
    assert np.allclose(curve.force[curve.leg(True)], FORCE[COUNT:])


def test_texts_of_optics11(tmp_path):
    """Not UTF-8: µ of Windows in its head."""
    head = [
        "Date\t12/05/2025",
        "k (N/m)\t0,500",
        "Tip radius (um)\t2.500",
        "Device:\tChiaro",
        "Max load (µN)\t0.05",
        "",
    ]
    head += ["Time (s)\tLoad (uN)\tIndentation (nm)\tCantilever (nm)\tPiezo (nm)\tAuxiliary"]
    rows = [f"0.1\t{1e-3 * f:.6f}\t0.0\t{d}\t{z}\t0.0" for f, d, z in zip(FORCE, DEFLECTION, PIEZO, strict=True)]
    (tmp_path / "x.txt").write_bytes("\r\n".join(head + rows).encode("latin-1"))
    curve = cb.read_force_curve(tmp_path / "x.txt")
    assert sizes(curve) == (COUNT, 0, COUNT)
    assert (curve.spring, curve.deflected) == (0.5, True)
    assert np.allclose(curve.force, FORCE)


# -- what is no curve -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "given", "words"),
    [
        ("", {}, r"the file is empty \('x.csv'\)"),
        ("piezo [nm],force [nN]\n", {}, "has no rows below the names"),
        ("Z (nm),F (nN)\n1,2\n", {}, r"no columns piezo \(or tip\) .* in its line 'Z \(nm\),F \(nN\)'; .*--columns"),
        ("Z (nm),F (nN)\n1,2\n", {"columns": "piezo=z,force=G"}, r"no columns 'piezo=z,force=G' in its line 'Z \(nm\)"),
        ("Z (nm),Z (V),F\n1,2,3\n", {"columns": "piezo=Z,force=F"}, "more than one column Z; .* with its unit"),
        ("Z,F\n1,2\n", {"columns": "piezo=Z"}, "no columns 'piezo=Z' in its line 'Z,F'; .*piezo=NAME,force=NAME"),
        ("Z,F\n1,2\n", {"columns": "place=Z,force=F"}, "no columns 'place=Z,force=F' in its line 'Z,F'"),
        ("piezo,force\n" + "1,2\n" * 20 + "3,F5\n", {}, "force must be numbers .*'F5'"),
        ("piezo [nm];force [nN]\n1,0;2,0;3\n", {}, "row 2 has 3 values for 2 columns; decimal commas need another"),
        ("piezo,deflection [V]\n" + "1,2\n" * 20, {}, "sensitivity: missing; .* per V, such as '50 nm/V'"),
        ("piezo,deflection [V]\n" + "1,2\n" * 20, {"sensitivity": "2 V/nm"}, "sensitivity: '2 V/nm'; must be a length"),
        ("piezo,deflection\n" + "1,2\n" * 20, {"sensitivity": "2 nm/V"}, "no deflection is in volts: leave it out"),
        ("piezo,force\n" + "1,2\n" * 20, {"sensitivity": "2 nm/V"}, "no deflection is in volts: leave it out"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, monkeypatch, text, given, words):
    monkeypatch.chdir(tmp_path)
    Path("x.csv").write_text(text)
    with pytest.raises(cb.InputError, match=words) as found:
        cb.read_force_curve("x.csv", **given)
    assert "x.csv" in str(found.value) or "columns" in str(found.value)
    assert "\n" not in str(found.value)


def test_a_file_of_another_instrument_says_how_to_export(tmp_path, capsys):
    pytest.importorskip("afmformats")
    for name in ("x.spm", "x.000", "x.zip"):
        (tmp_path / name).write_bytes(b"\\*File list\r\n\\Version: 0x09\r\n\x1a\0\0\0")
        with pytest.raises(cb.InputError, match=r"cannot be read by afmformats.*export it as text.*--columns"):
            cb.read_force_curve(tmp_path / name)
    assert not capsys.readouterr().err


def test_a_folder_holds_files_of_all_kinds(tmp_path):
    pytest.importorskip("afmformats")
    written(tmp_path / "a1.csv", "piezo,force", PIEZO, FORCE)
    written(tmp_path / "a2.out", "piezo,force", PIEZO, FORCE)
    shutil.copy(JPK, tmp_path / "a3.jpk-force")
    (tmp_path / "a10.txt").write_text("notes")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\0\0")
    (tmp_path / "contact.toml").write_text("[tip]\n")
    found = list(curves_in(tmp_path, spring="0.5 N/m"))
    assert [Path(one.source).name for one in found] == ["a1.csv", "a2.out", "a3.jpk-force", "a10.txt"]
    assert [isinstance(one, Unread) for one in found] == [False, False, False, True]
    assert [one.spring for one in found[:3]] == [0.5] * 3


def test_the_command_passes_on_how_a_file_is_read(tmp_path, monkeypatch, capsys):
    seen = []

    def fit(curve, *_, **__):
        seen.append(curve)
        raise cb.ModelError("seen")

    monkeypatch.setattr("contbranch.measure.fit.fit", fit)
    contact = tmp_path / "c.toml"
    contact.write_text('[tip]\nshape = "parabola"\nradius = "2.5 um"\n[material]\nmodulus = "5 MPa"\n')
    file = written(tmp_path / "x.txt", "Height (nm);Defl (V)", -PIEZO, VOLTS, separator=";")
    given = ["fit", str(file), str(contact), "--spring", "0.5 N/m"]
    assert main([*given, "--sensitivity", "50 nm/V", "--columns", "piezo=-Height (nm),deflection=Defl (V)"]) == 1
    assert np.allclose(seen[0].force, FORCE)
    assert main(given) == 2
    assert "--columns 'piezo=NAME,force=NAME'" in capsys.readouterr().err
