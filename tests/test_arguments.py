"""Arguments that cannot be used, results of units, and files of what is not often kept."""

from dataclasses import replace

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.theory import cos

CONTACT = cb.Contact.reduced("gauss", 1.0, -1)
PHYSICAL = cb.Contact.physical(
    radius="1 um", modulus="5 GPa", interaction="exponential", work_of_adhesion="40 mN/m", range="0.2 nm"
)


@pytest.mark.parametrize(
    ("compute", "message"),
    [
        (lambda: cb.phase_diagram(CONTACT, "tabor", 1.0, "load"), "between: 1.0; give two values"),
        (lambda: cb.phase_diagram(CONTACT, "tabor", (2.0, 1.0), "load"), "between: .*first value must be the smaller"),
        (lambda: cb.phase_diagram(CONTACT, "tabor", (1.0, 2.0), "load", samples=3.5), "samples: 3.5; must be a whole"),
        (lambda: cb.phase_diagram(CONTACT, "tabor", (1.0, 2.0), "load", accuracy=0.0), "accuracy: 0; must lie"),
        (
            lambda: cb.phase_diagram(PHYSICAL, "tip.radius", ("1 um", "2 nN")),
            "between: '2 nN': 'nN' is not a unit of length",
        ),
        (lambda: cb.trace(CONTACT, progress=3), "progress: 3; must be called as"),
        (lambda: cb.advise(None), "contact: NoneType; must be a Contact"),
        (lambda: cb.varied(CONTACT, {"tip.radius": 3.0}), "vary: tip.radius is 3.0; must be a list"),
        (lambda: cb.varied(CONTACT, ["tip.radius"]), "vary: .'tip.radius'.; name at least one parameter"),
        (lambda: cb.trace(CONTACT, accuracy=1e-4).propagate(["range"]), "uncertainty: list; must be a mapping"),
        (lambda: cb.trace(CONTACT, accuracy=1e-4).local_exponent(None), "event: NoneType is not a fold or touch"),
        (lambda: cb.find_all(CONTACT, load=1.0, window=3.0), "window: 3.0; give two values"),
        (lambda: cb.find_all(CONTACT, load=1.0, window=("1 nm", "2 nm")), "window: '1 nm'; the contact is in reduced"),
    ],
)
def test_arguments_that_cannot_be_used_are_named(compute, message):
    with pytest.raises(cb.InputError, match=message):
        compute()


def test_a_name_that_no_file_system_takes_is_one_line(tmp_path, capsys):
    assert main(["trace", "--interaction", "gauss", "--tabor", "1", "--json", str(tmp_path / ("a" * 300))]) == 2
    assert "choose another name" in capsys.readouterr().err.strip().splitlines()[-1]


def test_values_of_a_parameter_that_is_followed_have_units():
    fold = next(cb.trace(PHYSICAL).folds("load"))
    one, other = (cb.follow(fold, "tip.radius", to, accuracy=1e-4) for to in ("1.1 um", 1100.0))
    assert one.curve["tip.radius"][-1] == 1100.0
    np.testing.assert_array_equal(one.curve["load"], other.curve["load"])
    with pytest.raises(cb.InputError, match=r"to: '1\.1 nN': 'nN' is not a unit of length"):
        cb.follow(fold, "tip.radius", "1.1 nN")
    assert one.at("1.05 um") == one.at(1050.0) != ()
    with pytest.raises(cb.InputError, match=r"value: '1 nN': 'nN' is not a unit of length"):
        one.at("1 nN")


def test_files_of_states_say_what_was_asked(tmp_path):
    spring = cb.solve(PHYSICAL, load=-100.0, control=cb.Spring(20.0), accuracy=1e-4)
    held = cb.solve(PHYSICAL, displacement=0.1, accuracy=1e-9)
    for state in (spring, held):
        state.save(tmp_path / "state.h5")
        loaded = cb.load(tmp_path / "state.h5")
        told = [(one.control, one.stiffness, one.accuracy) for one in (state, loaded)]
        assert told[0] == told[1] == (("spring", 20.0, 1e-4) if state is spring else ("displacement", None, 1e-9))


def test_boundaries_of_a_phase_diagram_are_a_table(tmp_path):
    phase = cb.phase_diagram(PHYSICAL, "tip.radius", ("0.9 um", "1.1 um"), samples=3, accuracy=1e-4)
    phase.to_csv(tmp_path / "phase.csv")
    first, *rows = (tmp_path / "phase.csv").read_text().splitlines()
    assert first.startswith("load [nN],displacement [nm]")
    assert "boundary,tip.radius [nm]" in first
    assert len(rows) == sum(len(one.curve["load"]) for one in phase.boundaries) > 0
    assert {part["contact"] for parts in phase.document()["parts"] for part in parts} == {True, False}
    phase.save(tmp_path / "phase.h5")
    again = cb.load(tmp_path / "phase.h5")
    assert again.document() == phase.document()
    assert (again.parts, again.contact) == (phase.parts, phase.contact)
    again.to_csv(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == (tmp_path / "phase.csv").read_text()


def test_equilibria_are_read_back(tmp_path):
    found = cb.find_all(cb.Contact.reduced(cb.Exponential, tabor=3.0), load=-4.0, accuracy=1e-5)
    found.save(tmp_path / "all.h5")
    again = cb.load(tmp_path / "all.h5")
    assert again.document() == found.document()
    assert (again.connected, again.window, again.accuracy) == (found.connected, found.window, 1e-5)
    assert len(again.stable) == len(found.stable) == 1


def test_exponents_at_folds_of_a_spring_count_lengths():
    """The excess of what a spring's end is held at, D = d + F/K, against states that are solved for."""
    diagram = cb.trace(PHYSICAL, control=cb.Spring(20.0))
    fold = next(event for event in diagram.folds("spring") if event.name == "pull-off")
    local = diagram.local_exponent(fold)
    place = len(local.excess) // 2
    state = cb.solve(PHYSICAL, contact_radius=fold.contact_radius + float(local.order_parameter[place]))
    ends = [one.displacement + one.load / 20.0 for one in (state, fold)]
    assert local.excess[place] == pytest.approx(ends[0] - ends[1], rel=1e-3)
    assert "crossover_load" not in PHYSICAL.units.names  # which has the unit of the control


@pytest.mark.parametrize("tabor", [0.226, 0.428])
def test_the_form_of_carpick_and_others_does_not_know_units(tabor):
    branch = cb.trace(cb.Contact.reduced("gauss", tabor)).branches[0]
    start = int(np.argmin(branch.load))
    load, radius = branch.load[start:], branch.contact_radius[start:]
    one = cos.fit(load, radius, form="cos")
    other = cos.fit(2.5e4 * load, 20 * radius, form="cos", radius=1e3, modulus=25e3 * 1e3 / 8e3)
    assert other.error == pytest.approx(one.error, rel=1e-6)
    assert other.alpha == pytest.approx(one.alpha, rel=1e-4)


def test_what_is_not_often_kept_is_kept(tmp_path):
    advice = cb.advise(CONTACT, 1e-3)
    advice.save(tmp_path / "advice.h5")
    assert (tmp_path / "advice.h5").stat().st_size > 0


def test_a_followed_curve_of_a_law_that_is_not_at_hand_is_shown(tmp_path):
    """As read from a file of a user's law without its class: the numbers are there, the parameter without its unit."""
    pull_off = cb.trace(cb.Contact.reduced("maugis-dugdale", 1.0)).folds("load")
    curve = cb.follow(next(iter(pull_off)), "tabor", to=(0.9, 1.1))
    bare = replace(curve, contact=None)
    assert "tabor" in str(bare)
    bare.to_csv(tmp_path / "bare.csv")
    assert (tmp_path / "bare.csv").read_text().splitlines()[0].startswith("tabor")


def test_warnings_name_the_line_that_was_written():
    """Not one of the package, which is not where anything is to be mended."""
    with pytest.warns(UserWarning, match="is taken in nm") as told:
        cb.Contact.physical(radius=1e-6, modulus=5.0, interaction="gauss", work_of_adhesion=0.04, range=1.0)
    assert [one.filename for one in told] == [__file__]
