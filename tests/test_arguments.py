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
