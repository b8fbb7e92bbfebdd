"""Advice: errors of theories against closed forms and finer traces; the cheapest that is enough is chosen."""

import json

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.theory import maugis


def by_name(advice):
    return {one.model: one for one in advice.candidates}


def test_the_limits_of_maugis_dugdale():
    """DMT: −2π, JKR: −3π/2, relative to the exact pull-off of Maugis and Dugdale."""
    for tabor, chosen in ((0.02, "dmt"), (20.0, "jkr"), (1.0, "exact")):
        contact = cb.Contact.reduced("maugis-dugdale", tabor=tabor)
        exact = float(maugis.load_fold(interaction_range=1.0 / tabor).load)
        advice = cb.advise(contact, accuracy=0.01)
        found = by_name(advice)
        for name, limit in (("dmt", -2.0 * np.pi), ("jkr", -1.5 * np.pi)):
            wanted = abs(limit - exact) / abs(exact)
            assert found[name].errors["pull_off_load"] == pytest.approx(wanted, abs=1e-9)
        assert advice.chosen == chosen
        assert advice.thresholds == ("pull_off_load",)


@pytest.mark.parametrize(
    ("law", "tabor", "sign", "accuracy", "control"),
    [
        ("exponential", 0.1, 1, 0.05, "load"),
        ("van-der-waals", 3.0, 1, 0.1, "load"),
        ("gauss", 1.0, -1, 1e-3, "load"),
        ("exponential", 2.0, 1, 1e-6, "displacement"),
    ],
)
def test_the_choice_is_enough_and_nothing_cheaper_is(law, tabor, sign, accuracy, control):
    contact = cb.Contact.reduced(law, tabor=tabor, sign=sign)
    advice = cb.advise(contact, accuracy, control)
    found = by_name(advice)
    truth = cb.trace(contact, control, accuracy=1e-8, modes=0).thresholds
    assert set(advice.thresholds) == {name for name in truth if name.endswith(f"_{control}") and "touch" not in name}
    assert found[advice.chosen].worst <= accuracy
    for one in advice.candidates:
        if one.seconds < 0.1 * found[advice.chosen].seconds:
            assert one.worst is None or one.worst > accuracy
    if "maugis-dugdale" in found:
        other = cb.Contact.reduced("maugis-dugdale", tabor=tabor)
        there = cb.trace(other, control, modes=0).thresholds
        for name, error in found["maugis-dugdale"].errors.items():
            if error is not None:
                assert error == pytest.approx(abs(there[name] - truth[name]) / max(1.0, abs(truth[name])), rel=0.02)


def test_a_theory_with_a_fold_that_the_contact_has_not_is_out(tmp_path):
    """At small Tabor coefficients nothing jumps under displacement control; in JKR's theory it always does."""
    advice = cb.advise(cb.Contact.reduced("exponential", tabor=0.2), 0.1, "displacement")
    assert by_name(advice)["jkr"].worst is None
    assert "no fold" in advice.message
    advice.save(tmp_path / "advice.h5")
    read = cb.load(tmp_path / "advice.h5")
    assert (read, read.document()) == (advice, advice.document())
    assert by_name(read)["jkr"].errors == dict.fromkeys(("pull_off_displacement", "jump_in_displacement"))


def test_contacts_without_symmetry_need_a_grid():
    contact = cb.Contact(cb.EllipticParaboloid(1.0, 2.0), cb.Exponential(1.0, 1.0))
    assert cb.advise(contact, 0.01).chosen == "free"


def test_without_interaction_hertz_is_enough():
    assert cb.advise(cb.Contact(cb.Parabola(1.0)), 0.01).chosen == "hertz"


def test_the_command_line_speaks_of_it(capsys):
    assert main(["advise", "--interaction", "exponential", "--tabor", "3", "--accuracy", "0.05", "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["format"] == "contbranch-advice"
    assert document["chosen"] in [one["model"] for one in document["candidates"]]
    (own,) = (one["errors"] for one in document["candidates"] if one["model"] == "axisymmetric")
    assert own["pull_off_load"] < 1e-4  # as estimated, not as asked
    assert main(["advise", "--interaction", "exponential", "--tabor", "3"]) == 0
    told = capsys.readouterr().out
    assert "Take axisymmetric. The cheapest with errors up to 0.01" in told
    assert "Model" not in told  # that of the trace, which may be another than the one to take
    assert main(["advise", "--interaction", "exponential", "--tabor", "3", "--accuracy", "0.9"]) == 2


def test_units_do_not_matter():
    physical = cb.Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="exponential", work_of_adhesion="40 mN/m", range="1 nm"
    )
    reduced = cb.Contact.reduced("exponential", tabor=physical.tabor)
    one, other = (by_name(cb.advise(contact, 0.01))["jkr"].worst for contact in (physical, reduced))
    assert one == pytest.approx(other, rel=1e-6)
