"""Force curves read, refused and fitted: against contacts that made them, and a measured one."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.continuation import CorrectionError, Outcome
from contbranch.curve.track import Track
from contbranch.measure.comparison import legs
from contbranch.measure.features import features
from contbranch.measure.reduced import curve_of

SIN = Path(__file__).parents[1] / "studies" / "sin_force_curve.csv"
RAW = Path(__file__).parent / "reference" / "fmt-igor-fd_SiN_FD_plot.ibw"
TRUE = {"radius": 1000.0, "modulus": 0.02, "work_of_adhesion": 0.03, "range": 5.0}
SPRING = 5.0
NOISE = 0.3 * np.random.default_rng(0).standard_normal(800)


def contact(law="maugis-dugdale", **changes):
    values = TRUE | changes
    return cb.Contact.physical(interaction=law, **values)


def made(law="maugis-dugdale", spring=SPRING, noise=0.01, count=400, **options):
    """A curve made from the traced loop of a contact, contact point 30 nm, baseline 5 nN, tilt 0.02 nN/nm."""
    loop = cb.hysteresis(contact(law, **options), control=cb.Spring(spring), accuracy=1e-6, max_load=300.0)
    path, columns = loop.path, []
    place = path.displacement + path.load / spring
    top, low = place.max(), min([-120.0, *(1.2 * jump.position for jump in loop.jumps)])
    for direction in (1, -1):
        own = path.direction == direction
        way = np.linspace(low, top, count)[::direction]
        z, f = place[own][::direction], path.load[own][::direction]
        columns.append((way, np.interp(way, z + 1e-9 * np.arange(z.size), f, left=0.0)))
    piezo, force = (np.append(*pair) for pair in zip(*columns, strict=True))
    piezo = piezo + 30.0
    pull = -force.min()
    force = force + 5.0 + 0.02 * piezo + noise * pull * np.random.default_rng(1).standard_normal(piezo.size)
    return cb.ForceCurve(piezo=piezo, force=force, spring=spring, segment=np.repeat([0, 1], count))


@pytest.fixture(scope="module")
def curve():
    return made()


# -- reading ----------------------------------------------------------------------------------------------------------
def test_the_measured_curve_has_the_numbers_stated_for_it():
    """Stiffness, points, noise, baseline, jump-in and pull-off as they are known of this file."""
    curve = cb.read_force_curve(SIN, spring="1.1841 N/m")
    assert (curve.leg(False).size, curve.leg(True).size) == (1009, 1007)
    seen = features(curve, adhesive=True)
    assert seen.noise == pytest.approx(0.006, rel=0.3)
    assert seen.lines[0][0] + seen.lines[0][1] * curve.piezo[0] == pytest.approx(-3.9, abs=0.05)
    assert seen.jump_in.step == pytest.approx(-3.0, rel=0.06)
    assert seen.lowest == pytest.approx(-12.8, abs=0.1)  # from the retraction's own baseline
    assert seen.pull_off.after - seen.pull_off.before <= 3
    top = np.flatnonzero(curve.force > 3.0)
    assert np.polyfit(curve.piezo[top], curve.force[top], 1)[0] == pytest.approx(0.55, rel=0.05)


def test_an_instruments_file_is_read_like_its_csv(tmp_path):
    pytest.importorskip("afmformats")
    curve, listed = cb.read_force_curve(RAW), cb.read_force_curve(SIN)
    assert curve.spring == pytest.approx(1.1841)
    assert np.allclose(curve.piezo, listed.piezo, atol=1e-3)
    assert (curve.retract == listed.retract).all()
    (tmp_path / "x.ibw").write_bytes(b"nothing")
    with pytest.raises(cb.InputError, match="afmformats"):
        cb.read_force_curve(tmp_path / "x.ibw")


def test_units_columns_and_maps(tmp_path, curve):
    file = tmp_path / "map.csv"
    lines = ["# a comment", "curve,tip [um],deflection (nm),segment"]
    deflection = curve.force / SPRING
    tip = (curve.piezo - deflection) / 1000.0
    words = np.where(curve.retract, "retract", "approach")
    rows = [f"{k},{a},{b},{w}" for k in (0, 1) for a, b, w in zip(tip, deflection, words, strict=True)]
    file.write_text("\n".join([*lines, *rows]))
    with pytest.raises(cb.InputError, match="spring"):
        cb.read_force_curve(file)
    both = cb.read_force_curves(file, spring=f"{SPRING} N/m")
    assert len(both) == 2
    assert np.allclose(both[1].piezo, curve.piezo)
    assert np.allclose(both[1].force, curve.force)
    stiffer = both[0].with_spring(2 * SPRING)
    assert np.allclose(stiffer.force, 2 * curve.force)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("piezo [nm],force [nN]\n-244,015,2,52223\n", "row 2 has 4 values for 2 columns; decimal commas"),
        ("piezo [nm],force [nN],piezo [um]\n1,2,3\n", "more than one column piezo"),
        ("1.0 2.0\n3.0 4.0\n", r"no columns piezo \(or tip\) and force \(or deflection\) in its line '1.0 2.0'"),
    ],
)
def test_tables_that_could_be_misread(tmp_path, text, words):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(cb.InputError, match=words):
        cb.read_force_curve(tmp_path / "x.csv")


def test_a_file_of_no_instrument_is_an_input_error(tmp_path, capsys):
    """afmformats raises what is no Exception for it, and prints tracebacks for others."""
    pytest.importorskip("afmformats")
    for name in ("x.jpk-force", "x.h5", "x.ibw"):
        (tmp_path / name).write_text("garbage")
        with pytest.raises(cb.InputError, match="cannot be read by afmformats"):
            cb.read_force_curve(tmp_path / name)
    assert not capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda z, f: (z, f + np.where(np.arange(z.size) == 7, math.nan, 0.0)), "not finite"),
        (lambda z, f: (-z, f), "grow"),
        (lambda z, f: (f, z), "swapped"),
        (lambda z, f: (z, -f), "positive in repulsion"),
        (lambda z, f: (z, NOISE), "noise"),
        (lambda z, f: (z, np.maximum(f - 8.0 - 0.02 * z, 0.0) + NOISE), "no adhesion"),
        (lambda z, f: (z[::-1], f[::-1]), "reversed in time"),
        (lambda z, f: (z * 1e-9, f * 1e-9), r"such as m\?.*'m'"),
        (lambda z, f: (z, f * 1e-9), r"such as N\?.*'N'"),
        (lambda z, f: (z * 1e-3, f), "stiffer than its spring"),
        (lambda z, f: (z, 0.0 * f), "the same everywhere"),
    ],
    ids=["nan", "piezo reversed", "swapped", "force reversed", "noise", "no adhesion", "time reversed", "metres",
         "newtons", "micrometres", "constant"],
)  # fmt: skip
def test_what_cannot_be_fitted_ends_in_a_sentence(curve, change, words):
    piezo, force = change(curve.piezo, curve.force)
    with pytest.raises(cb.InputError, match=words):
        cb.fit(cb.ForceCurve(piezo=piezo, force=force, spring=SPRING, segment=curve.retract), contact())


@pytest.mark.parametrize("share", [0.4, 0.7, "top"])
@pytest.mark.parametrize("bend", ["sharp", "soft"])
def test_what_is_at_the_end_of_the_detector_is_left_out(share, bend):
    """A detector that ends at a share of the pull-off, or at half of the largest force, with noise behind it."""
    fine, rng = made(noise=0.0), np.random.default_rng(3)
    level = fine.force - 5.0 - 0.02 * fine.piezo
    end = 0.5 * level.max() if share == "top" else -share * level.min()
    sense = 1.0 if share == "top" else -1.0
    turned = sense * level
    knee = 0.8 * end if bend == "soft" else end
    bent = np.where(turned > knee, knee + (end - knee) * np.tanh((turned - knee) / max(end - knee, 1e-9)), turned)
    force = sense * bent + 0.005 * -level.min() * rng.standard_normal(level.size) + 5.0
    data = cb.ForceCurve(piezo=fine.piezo, force=force, spring=SPRING, segment=fine.retract)
    fit = cb.fit(data, contact(modulus=0.05, work_of_adhesion=0.02), ("work_of_adhesion", "modulus"))
    assert "detector is at its end" in fit.message
    assert np.isnan(fit.fitted).any()
    for name in ("work_of_adhesion", "modulus"):
        assert name not in fit.determined or abs(fit.values[name] - TRUE[name]) < 5 * fit.errors[name], name
    assert "modulus" in fit.determined


def test_a_smooth_minimum_before_the_pull_off_is_no_end_of_the_detector(curve):
    """A film's flat baseline neither."""
    fit = cb.fit(curve, contact(), ("work_of_adhesion", "modulus"))
    assert "detector" not in fit.message
    film = np.maximum(curve.force - 8.0 - 0.02 * curve.piezo, 0.0)
    data = cb.ForceCurve(piezo=curve.piezo, force=film, spring=SPRING, segment=curve.retract)
    seen = features(data, adhesive=False)
    assert seen.returned
    assert not any("detector" in note for note in seen.notes)


def test_a_force_of_few_digits_is_known_to_its_steps():
    """Noise is an eighth of a step: most of the baseline is one number, and so is the lowest part of the retraction."""
    fine = made(noise=0.002)
    step = 8 * 0.002 * TRUE["work_of_adhesion"] * TRUE["radius"] * 1.5 * math.pi
    level = fine.force - 5.0 - 0.02 * fine.piezo
    coarse = cb.ForceCurve(piezo=fine.piezo, force=step * np.round(level / step), spring=SPRING, segment=fine.retract)
    assert features(coarse, adhesive=True).noise == pytest.approx(step / math.sqrt(12.0), rel=0.2)
    fit = cb.fit(coarse, contact(modulus=0.03, work_of_adhesion=0.02), ("work_of_adhesion", "modulus"))
    for name in ("work_of_adhesion", "modulus"):
        assert name in fit.determined
        assert abs(fit.values[name] - TRUE[name]) < 4 * fit.errors[name], name
    assert "exceed" not in fit.message


# -- the model --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("law", ["maugis-dugdale", "exponential", "van-der-waals"])
def test_interpolated_curves_have_the_jumps_of_traced_loops(law):
    """The loop on a spring from the table against one traced to 1e-7."""
    own = contact(law)
    loop = cb.hysteresis(own, control=cb.Spring(SPRING), accuracy=1e-7, max_load=300.0)
    for leg, jump in zip(legs(curve_of(own, 300.0), SPRING), loop.jumps, strict=True):
        assert leg.jump.piezo == pytest.approx(jump.position, abs=2e-3)
        assert leg.jump.before == pytest.approx(jump.start.load, abs=3e-2)
        assert leg.jump.after == pytest.approx(jump.to.load, abs=3e-2)


# -- fits -------------------------------------------------------------------------------------------------------------
def test_values_come_back_within_their_errors(curve):
    start = contact(modulus=0.05, work_of_adhesion=0.01, range=2.0)
    fit = cb.fit(curve, start, ("work_of_adhesion", "modulus", "range"))
    true = TRUE | {"contact_point": 30.0, "baseline": 5.0, "tilt": 0.02}
    assert fit.status == "complete"
    assert {"work_of_adhesion", "modulus"} <= set(fit.determined)
    for name in fit.determined:
        assert abs(fit.values[name] - true[name]) < 4 * fit.errors[name], name
    assert fit.rms == pytest.approx(fit.noise, rel=0.3)
    assert [jump.name for jump in fit.jumps] == ["jump-in", "pull-off"]
    for jump in fit.jumps:
        assert jump.fitted["piezo"] == pytest.approx(jump.measured["piezo"], abs=1.0)


def test_what_drifts_by_less_than_the_noise_is_in_the_errors(curve):
    """Over the whole curve the deflection drifts by four times the noise of a sample: 1.15 times its rms."""
    size = 0.01 * (curve.force.max() - curve.force.min()) / 3
    drift = 4 * size * np.linspace(0.0, 1.0, curve.force.size)
    data = cb.ForceCurve(piezo=curve.piezo, force=curve.force + drift, spring=SPRING, segment=curve.retract)
    start = contact(modulus=0.03, work_of_adhesion=0.02)
    at_once = {"leg": "both", "baseline": "one"}
    plain, fit = (cb.fit(one, start, ("work_of_adhesion", "modulus"), **at_once) for one in (curve, data))
    assert fit.errors["baseline"] > 2 * plain.errors["baseline"]
    assert "vary slowly" in fit.message or "exceed the noise" in fit.message
    assert "errors allow for that" not in plain.message
    true = TRUE | {"contact_point": 30.0, "baseline": 5.0 + float(drift.mean()), "tilt": 0.02}
    for name in ("baseline", "modulus", "contact_point"):
        assert abs(fit.values[name] - true[name]) < 5 * fit.errors[name], name


def test_a_retraction_cut_in_contact_has_no_pull_off(curve):
    """Forces are large, and the last ones only a few hundredths of them: the contact is not broken there."""
    kept = ~curve.retract | (curve.piezo > curve.piezo[np.argmin(curve.force)] + 40.0)
    pressed = curve.force + np.where(curve.piezo > 60.0, 40.0 * (curve.piezo - 60.0), 0.0)
    cut = cb.ForceCurve(piezo=curve.piezo[kept], force=pressed[kept], segment=curve.retract[kept], spring=50.0)
    seen = features(cut, adhesive=True)
    assert abs(cut.force[-1] - 5.0) < 0.05 * np.ptp(cut.force)
    assert not seen.returned
    assert seen.pull_off is None


def test_a_contact_that_lets_go_before_the_curve_does_is_none_of_the_curves(curve):
    """A retraction that goes on falling and never comes off: no values are called determined."""
    lowest = curve.piezo[np.argmin(curve.force)]
    off = curve.retract & (curve.piezo < lowest)
    force = np.where(off, curve.force.min() - 1.5 * (lowest - curve.piezo), curve.force) + NOISE
    data = cb.ForceCurve(piezo=curve.piezo, force=force, spring=SPRING, segment=curve.retract)
    fit = cb.fit(data, contact(), ("work_of_adhesion", "modulus"), leg="both")
    assert fit.jumps[-1].measured is None
    assert fit.determined == ()
    assert "it lets go before the last" in fit.message


def test_few_samples_far_out_show_the_baseline():
    """Behind the jump off a soft spring, from 4 samples, which say nothing of a tilt."""
    count = 40
    values = {"radius": 2000.0, "modulus": 0.1, "work_of_adhesion": 0.03, "range": 1.0}
    contact = cb.Contact.physical(interaction="exponential", **values)
    path = cb.hysteresis(contact, control=cb.Spring(0.5), accuracy=1e-4, max_load=200.0).path
    top, legs = path.position.max(), []
    for direction, low in ((1, -100.0), (-1, -700.0)):
        own = path.direction == direction
        piezo = np.linspace(low, top, count)[::direction]
        order = np.argsort(path.position[own])
        legs.append((piezo, np.interp(piezo, path.position[own][order], path.load[own][order], left=0.0)))
    piezo, force = np.hstack(legs)
    force = force + np.random.default_rng(1).standard_normal(2 * count)
    curve = cb.ForceCurve(piezo=piezo, force=force, spring=0.5, segment=np.repeat([0, 1], count))
    fit = cb.fit(curve, contact, free=("work_of_adhesion", "modulus"))
    for name in ("work_of_adhesion", "modulus"):
        assert abs(fit.values[name] - values[name]) < 3 * fit.errors[name]
    assert "work_of_adhesion" in fit.determined


def test_the_same_minimum_from_values_ten_times_off():
    """100 MPa and 30 mN/m on 0.5 N/m, R = 2 µm: a least-squares script without bounds ends at 2.2 MPa."""
    values = {"radius": 2000.0, "modulus": 0.1, "range": 1.0, "work_of_adhesion": 0.03}
    data = made("exponential", 0.5, **values)
    start = contact("exponential", **values | {"modulus": 1.0, "work_of_adhesion": 0.3})
    fit = cb.fit(data, start)
    assert fit.determined[:2] == ("work_of_adhesion", "modulus")
    assert fit.values["modulus"] == pytest.approx(0.1, abs=4 * fit.errors["modulus"])
    assert fit.values["work_of_adhesion"] == pytest.approx(0.03, rel=0.01)


def test_what_the_data_cannot_tell_is_said(curve):
    fit = cb.fit(curve, contact(), ("work_of_adhesion", "modulus", "radius", "sensitivity"))
    assert not {"work_of_adhesion", "radius"} <= set(fit.determined)
    assert "not determine" in fit.message


@pytest.mark.parametrize("tip", [cb.Parabola(1000.0), cb.Cone(0.4), cb.SphericalCap(300.0)], ids=lambda tip: tip.name)
def test_a_contact_without_interaction_is_that_of_hertz_and_sneddon(tip):
    """F = 2E [a d − ∫ζ] and d = ζ(a), on a spring as stiff as the contact is where it is pressed most."""
    bare = replace(contact(), tip=tip, interaction=None)
    a = np.linspace(0.0, 100.0, 2000)
    depth = tip.transform(a)
    load = 2 * bare.modulus * (a * depth - tip.transform_integral(a))
    spring = 2 * bare.modulus * a[-1]
    piezo = depth + load / spring
    way = np.linspace(-piezo[-1], piezo[-1], 150)
    way = np.concatenate([way, way[::-1]])
    noise = 3e-3 * load[-1] * NOISE[:300] / 0.3
    force = np.interp(way, piezo, load, left=0.0) + noise + 0.1 * load[-1]
    curve = cb.ForceCurve(piezo=way + 7.0, force=force, spring=spring, segment=np.repeat([0, 1], 150))
    found = cb.fit(curve, replace(bare, modulus=5 * bare.modulus), "modulus")
    assert (found.status, found.law, found.jumps) == ("complete", "hertz", ())
    assert {"modulus", "contact_point"} <= set(found.determined)
    for name, true in (("modulus", bare.modulus), ("contact_point", 7.0)):
        assert abs(found.values[name] - true) < 3 * found.errors[name]
    assert found.errors["modulus"] < 0.1 * bare.modulus
    with pytest.raises(cb.InputError, match="law: the contact has no interaction"):
        cb.fit(curve, bare, "modulus", law="compare")
    with pytest.raises(cb.ModelError, match="at the edge of the tip"):
        cb.fit(curve, replace(bare, tip=cb.SphericalCap(3.0), modulus=1e-4), ())


def test_laws_are_compared(curve):
    fit = cb.fit(curve, contact("exponential"), ("work_of_adhesion", "modulus"), law="compare")
    assert fit.law == fit.laws[0].law
    assert {one.law for one in fit.laws} == {"maugis-dugdale", "exponential", "van-der-waals", "jkr", "dmt"}
    above = {one.law: one.criterion for one in fit.laws}
    assert above["maugis-dugdale"] < 3.0
    assert min(above["jkr"], above["dmt"], above["van-der-waals"]) > 10.0


GAPS = np.linspace(0.0, 40.0, 400)
EXPONENTIAL = cb.Exponential(work_of_adhesion=0.03, range=2.0)


@pytest.mark.parametrize(
    ("tip", "law"),
    [
        (cb.SphericalCap(1000.0), EXPONENTIAL),
        (cb.Parabola(1000.0), EXPONENTIAL + cb.Exponential(work_of_adhesion=-0.001, range=1.0)),
        (cb.Parabola(1000.0), cb.Tabulated(gaps=GAPS.tolist(), energies=(-0.03 * np.exp(-GAPS / 2.0)).tolist())),
    ],
)
def test_curves_that_are_traced_for_a_fit_have_the_jumps_of_loops(tip, law):
    contact = cb.Contact.physical(tip=tip, modulus=1.0, interaction=law)
    loop = cb.hysteresis(contact, control=cb.Spring(2.0), max_load=200.0)
    for leg, jump in zip(legs(curve_of(contact, 250.0), 2.0), loop.jumps, strict=True):
        assert leg.jump.piezo == pytest.approx(jump.position, abs=2e-3)
        assert leg.jump.before == pytest.approx(jump.start.load, abs=0.04)
        assert leg.jump.after == pytest.approx(jump.to.load, abs=0.01)


def test_rows_that_no_piece_of_curve_joins_leave_the_curve(monkeypatch):
    link = Track.link

    def broken(track, k):
        if k == len(track.points) // 2:
            raise CorrectionError(Outcome.EVALUATION_FAILED, "")
        return link(track, k)

    monkeypatch.setattr(Track, "link", broken)
    half = cb.Exponential(work_of_adhesion=0.5, range=0.9)
    curve = curve_of(cb.Contact.physical(tip=cb.Parabola(1.0), modulus=1.0, interaction=half + half), 5.0)
    pull = cb.trace(cb.Contact(cb.Parabola(1.0), cb.Exponential(1.0, 0.9))).thresholds["pull_off_load"]
    assert curve.load.min() == pytest.approx(pull, abs=1e-4)


def test_a_fit_without_time_for_a_curve_says_so(curve):
    contact = cb.Contact.physical(radius="1 um", modulus="1 GPa", interaction=EXPONENTIAL + EXPONENTIAL)
    with pytest.raises(cb.ModelError, match=r"^The time limit of 0.001 s was reached"):
        cb.fit(curve, contact, ("modulus",), time_limit=1e-3)


def test_a_fit_can_be_stopped_and_wrong_names_are_refused(curve):
    for limit in (0.001, 0.05, 0.09):
        fit = cb.fit(curve, contact(), time_limit=limit)
        assert fit.status == "incomplete"
        assert "time limit" in fit.message
    for wrong in (
        {"free": ("modulos",)},
        {"law": "magic"},
        {"law": "tabulated"},
        {"fixed": ("range",)},
        {"free": ("range[1]",)},
    ):
        with pytest.raises(cb.InputError, match="must be one of"):
            cb.fit(curve, contact(), **wrong)
    with pytest.raises(cb.InputError, match="free: range; the limit jkr has none"):
        cb.fit(curve, contact(), "work_of_adhesion,range", law="jkr")
    for law in ("jkr", "compare"):
        with pytest.raises(cb.InputError, match=f"law: {law}; is for attraction"):
            cb.fit(curve, contact(work_of_adhesion=-0.03), law=law)
    ellipse = replace(contact(), tip=cb.EllipticParaboloid(1000.0, 500.0))
    with pytest.raises(cb.InputError, match="without axial symmetry"):
        cb.fit(curve, ellipse)


def test_the_command_frees_the_modulus_of_a_contact_without_law(tmp_path, capsys):
    data, file = tmp_path / "curve.csv", tmp_path / "c.toml"
    depth = np.linspace(-50.0, 100.0, 150)
    load = 4 / 3 * 0.01 * np.sqrt(1000.0) * np.clip(depth, 0.0, None) ** 1.5 + 1e-3 * NOISE[:150]
    rows = [f"{z},{f}" for z, f in zip(depth + load / 5.0, load, strict=True)]
    data.write_text("\n".join(["piezo [nm],force [nN]", *rows]))
    file.write_text('[tip]\nshape = "parabola"\nradius = "1 um"\n[material]\nmodulus = "50 MPa"\n')
    assert main(["fit", str(data), str(file), "--spring", "5 N/m", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["values"]["modulus"] == pytest.approx(0.01, rel=0.01)


def test_the_command_writes_json_csv_and_a_figure(tmp_path, curve, capsys):
    data, file = tmp_path / "curve.csv", tmp_path / "c.toml"
    words = np.where(curve.retract, "retract", "approach")
    rows = [f"{z},{f},{w}" for z, f, w in zip(curve.piezo, curve.force, words, strict=True)]
    data.write_text("\n".join(["piezo [nm],force [nN],segment", *rows]))
    file.write_text(
        '[tip]\nshape = "parabola"\nradius = "1 um"\n[material]\nmodulus = "50 MPa"\n[[interaction]]\n'
        'law = "maugis-dugdale"\nwork_of_adhesion = "10 mN/m"\nrange = "5 nm"\n'
    )
    out, table, figure, kept = (tmp_path / name for name in ("f.json", "f.csv", "f.png", "fit.h5"))
    options = ["--spring", "5 N/m", "--json", out, "--csv", table, "--plot", figure, "-o", kept]
    assert main(["fit", str(data), str(file), *map(str, options)]) == 0
    assert "work_of_adhesion" in capsys.readouterr().out
    document = json.loads(out.read_text())
    assert document["format"] == "contbranch-fit"
    assert document["values"].keys() == {"work_of_adhesion", "modulus", "contact_point", "baseline", "tilt"}
    assert np.array(document["correlations"]["matrix"]).shape == (5, 5)
    assert {"piezo", "force"} <= document["jumps"][1]["measured"].keys()
    assert figure.stat().st_size > 10_000
    assert cb.load(kept).values == document["values"]  # one curve is no map
    again = cb.read_force_curve(table, spring=5.0)
    assert np.allclose(again.force, curve.force)
    assert main(["fit", str(data)]) == 2
    assert main(["fit", str(data), str(file)]) == 2  # without the stiffness
