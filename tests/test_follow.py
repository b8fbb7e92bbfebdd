"""Events followed in a second parameter: against separate traces, closed forms, and each other."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.theory import maugis

REFERENCE = Path(__file__).parent / "reference" / "maugis_dugdale.csv"
KEYS = ("load", "displacement", "contact_radius", "central_gap")


def gauss(tabor: float) -> cb.Contact:
    return cb.Contact.reduced(cb.Gauss, tabor=tabor, sign=-1)


def mixed(share: float) -> cb.Contact:
    """(1 − β)·Exponential + β·Gauss, both repulsive, with one range and μ_T = 1."""
    if share == 1.0:
        return cb.Contact(cb.Parabola(1.0), cb.Gauss(-1.0, 1.0))
    return cb.Contact(cb.Parabola(1.0), cb.Exponential(-(1.0 - share), 1.0) + cb.Gauss(-share, 1.0))


def dlvo(amplitude: float) -> cb.Contact:
    return cb.Contact(cb.Parabola(1.0), cb.VanDerWaals(1.0, 0.5) + cb.Exponential(amplitude, 1.0))


def event(contact, name, control="load", accuracy=1e-9) -> cb.Event:
    """The event of a name ("touch" for first touch) in a trace."""
    found = traced(contact, control, accuracy).events
    kind = control if isinstance(control, str) else "spring"
    return next(e for e in found if (e.kind == name) or (e.name == name and e.control == kind))


@cache
def traced(contact, control="load", accuracy=1e-6, max_load=None) -> cb.Diagram:
    """A trace without what only a loss of symmetry is asked for."""
    return cb.trace(contact, control=control, accuracy=accuracy, modes=0, max_load=max_load)


def agrees(point, other, tolerance):
    """Whether two events agree within a tolerance, and within their error estimates."""
    for key in KEYS:
        difference = abs(getattr(point, key) - getattr(other, key))
        if difference > tolerance * max(1.0, abs(getattr(other, key))):
            return False
        if difference > point.error[key] + other.error[key]:
            return False
    return True


# Agreement with separate traces: they share no step with the curve that was followed.


@pytest.mark.parametrize(
    ("family", "start", "name", "control", "vary", "values"),
    [
        (gauss, 3.0, "squeeze-out", "load", "tabor", (0.8,)),
        (gauss, 1.0, "touch", "load", "tabor", (1.9,)),
        (
            lambda n: cb.Contact(cb.PowerLaw(n, 1.0), cb.Gauss(1.0, 0.5)),
            1.8,
            "pull-off",
            "load",
            "tip.exponent",
            (1.5,),
        ),
        (
            lambda modulus: cb.Contact.physical(
                radius=1000.0, modulus=modulus, interaction="gauss", work_of_adhesion=-0.04, range=1.0
            ),
            1.0,
            "wetting",
            cb.Spring(100.0),
            "modulus",
            (1.4,),
        ),
    ],
    ids=["squeeze-out", "touch", "exponent", "modulus"],
)
def test_a_followed_event_is_that_of_a_separate_trace(family, start, name, control, vary, values):
    accuracy = 1e-10 if start == 3.0 else 1e-9
    found = event(family(start), name, control, accuracy)
    followed = cb.follow(found, vary, to=values[-1], accuracy=accuracy)
    assert followed.status == "complete"
    assert followed.curve[vary][0] == start
    assert followed.curve[vary][-1] == values[-1]
    unit = max(1.0, family(start).scales.load)
    for value in values:
        (point,) = followed.at(value)
        assert agrees(point, event(family(value), name, control, accuracy), 1e-9 * unit)


@pytest.mark.parametrize(
    ("law", "tabor", "sign", "name", "to"),
    [("gauss", 0.028, -1, "wetting", 0.014), ("van-der-waals", 0.0835, 1, "pull-off", 0.036)],
)
def test_a_fold_is_followed_while_its_contact_becomes_tiny(law, tabor, sign, name, to):
    """Its radius falls to a third or less without ever coming to first touch: the onset becomes continuous."""
    start = event(cb.Contact.reduced(law, tabor, sign), name, accuracy=1e-6)
    followed = cb.follow(start, "tabor", to)
    other = event(cb.Contact.reduced(law, to, sign), name, accuracy=1e-6)
    assert (followed.status, followed.special) == ("complete", ())
    assert 0.0 < followed.curve["contact_radius"][-1] < start.contact_radius / 3
    for key in KEYS:
        error = followed.error[key][-1] + other.error[key]
        assert followed.curve[key][-1] == pytest.approx(getattr(other, key), abs=3 * error + 1e-12)


def test_units_stay_those_of_the_start():
    """The amplitude of a repulsion alone: load ∝ |Δγ| at fixed μ_T, so another route through the reduced problem."""
    contact = cb.Contact(cb.Parabola(1.0), cb.Gauss(-1.0, 1.0))
    followed = cb.follow(event(contact, "squeeze-out"), "interaction.work_of_adhesion", to=-2.0, accuracy=1e-9)
    # R = E = 1, |Δγ| = 2, z0 = 1: lengths Z = 2^(2/3), loads 2, so μ_T = Z/z0 = 2^(2/3).
    reduced = event(gauss(2.0 ** (2 / 3)), "squeeze-out")
    assert followed.curve["load"][-1] == pytest.approx(2.0 * reduced.load, rel=1e-8)
    assert followed.curve["displacement"][-1] == pytest.approx(2.0 ** (2 / 3) * reduced.displacement, rel=1e-8)


# Where coexistence ends.


def test_coexistence_of_a_mixed_repulsion_ends_at_first_touch_by_three_routes():
    start = mixed(0.85)
    squeeze = cb.follow(event(start, "squeeze-out"), "share", to=0.0, accuracy=1e-9)
    own = cb.follow(event(mixed(1.0), "wetting"), mixed, to=0.5, start=1.0, accuracy=1e-9)
    touch = cb.follow(event(start, "touch"), "share", to=0.7, accuracy=1e-9)
    ends = [one for followed in (squeeze, own) for one in followed.special]
    assert [one.kind for one in ends] == ["cusp-at-touch", "cusp-at-touch"]
    met = next(one for one in touch.special if one.control == "load")
    assert met.kind == "fold-through-touch"
    for one in (*ends[1:], met):
        assert one.value == pytest.approx(ends[0].value, abs=1e-8)
        assert one.load == pytest.approx(ends[0].load, abs=1e-8)
    assert max(one.error[one.parameter] for one in ends) < 1e-8
    # Both folds exist on one side and none on the other, by separate traces.
    beyond = [sum(1 for _ in traced(mixed(ends[0].value + d)).folds("load")) for d in (-1e-3, 1e-3)]
    assert beyond == [0, 2]
    # Past the cusp the curve is that of the other fold, back to where it began.
    assert squeeze.curve["contact_radius"][0] == 0.0
    assert agrees(squeeze.at(0.85)[-1], event(start, "wetting"), 1e-9)
    assert agrees(own.at(0.85)[-1], event(start, "squeeze-out"), 1e-9)


def test_two_folds_without_contact_merge_in_a_smooth_cusp():
    folds = {fold.name: fold for fold in traced(dlvo(-1.65), accuracy=1e-7).folds("displacement")}
    followed = cb.follow(folds["squeeze-out"], "interaction[1].work_of_adhesion", to=-1.7, accuracy=1e-7)
    (cusp,) = followed.special
    assert cusp.kind == "cusp"
    assert cusp.contact_radius == 0.0
    assert cusp.central_gap > 0.1
    assert agrees(followed.at(-1.65)[-1], folds["wetting"], 1e-6)
    beside = (-1e-3, 1e-3, 1e-5)
    counts = [sum(1 for _ in traced(dlvo(cusp.value + d)).folds("displacement")) for d in beside]
    assert counts == [0, 2, 2]


# The exact model.


def test_the_exact_displacement_fold_passes_first_touch_where_theory_says():
    """c_touch = 4 μ_T/π at μ_T³ = π/(8 (1 − 1/π))."""
    found = event(cb.Contact.reduced("maugis-dugdale", tabor=2.0), "pull-off", "displacement")
    followed = cb.follow(found, "tabor", to=0.2)
    (passage,) = followed.special
    assert passage.kind == "fold-through-touch"
    assert passage.value == pytest.approx((math.pi / (8 * (1 - 1 / math.pi))) ** (1 / 3), rel=1e-14)
    assert passage.contact_radius == passage.central_gap == 0.0
    with REFERENCE.open() as file:
        rows = {float(row["lambda"]): row for row in csv.DictReader(file)}
    for key in (0.5, 1.0, 2.0):
        (point,) = followed.at(float(rows[key]["mu_T"]))
        assert point.load == pytest.approx(float(rows[key]["F_pulloff_disp_mueser"]), rel=1e-13)
        assert point.displacement == pytest.approx(float(rows[key]["d_pulloff_disp_mueser"]), rel=1e-13)


def test_the_exact_model_follows_in_physical_units():
    def contact(reach):
        return cb.Contact.physical(
            radius="1 um", modulus="5 GPa", interaction="maugis-dugdale", work_of_adhesion="40 mN/m", range=reach
        )

    followed = cb.follow(event(contact(0.2), "pull-off", "displacement"), "interaction.range", to=1.0)
    (passage,) = followed.special
    unit = contact(1.0).scales.normal
    assert passage.value == pytest.approx(unit / (math.pi / (8 * (1 - 1 / math.pi))) ** (1 / 3), rel=1e-13)
    there = event(contact(passage.value * (1 + 1e-12)), "touch", "displacement")
    assert passage.load == pytest.approx(there.load, rel=1e-10)
    there = event(contact(1.0), "pull-off", "displacement")
    assert followed.curve["load"][-1] == pytest.approx(there.load, rel=1e-14)


# Stiffness: from load to displacement control on one curve.


@pytest.mark.parametrize("law", [cb.MaugisDugdale, cb.Exponential])
def test_the_fold_of_a_spring_leads_from_that_of_the_load_to_that_of_the_displacement(law):
    contact = cb.Contact.reduced(law, tabor=2.5)
    folds = {e.control: e for e in traced(contact, cb.Spring(2.0), 1e-9).folds() if e.name == "pull-off"}
    followed = cb.follow(folds["spring"], "stiffness", to=(0.0, math.inf), accuracy=1e-9)
    assert [one.kind for one in followed.special] == ["load-fold", "displacement-fold"]
    assert [followed.curve["stiffness"][k] for k in (0, -1)] == [0.0, math.inf]
    for k, control in ((0, "load"), (-1, "displacement")):
        for key in ("load", "displacement", "contact_radius"):
            assert followed.curve[key][k] == pytest.approx(getattr(folds[control], key), abs=2e-8)
    assert np.all(np.diff(followed.curve["load"]) > 0)


def test_folds_of_a_spring_merge_at_first_touch_or_leave_to_infinity():
    contact = cb.Contact.reduced(cb.Exponential, tabor=4.0)
    found = traced(contact, cb.Spring(3.0))
    inner = next(e for e in found.folds("spring") if e.name is None)
    (merged,) = cb.follow(inner, "stiffness", to=7.0).special
    assert merged.kind == "cusp-at-touch"
    # Both inner folds are there with a softer spring, and gone with a stiffer one.
    counts = [sum(1 for _ in traced(contact, cb.Spring(merged.value * s)).folds("spring")) for s in (0.98, 1.02)]
    assert counts == [4, 2]
    jump = next(e for e in found.folds("spring") if e.name == "jump-in")
    (left,) = cb.follow(jump, "stiffness", to=0.0).special
    assert left.kind == "infinite-separation"
    assert left.value < 1e-4


def test_the_fold_of_a_spring_passes_first_touch():
    """Separate traces with a slightly softer and a slightly stiffer spring have it on either side."""
    contact = cb.Contact.reduced(cb.Gauss, tabor=1.5)
    followed = cb.follow(event(contact, "pull-off", "load"), "stiffness", to=1.1, accuracy=1e-8)
    passage = next(one for one in followed.special if one.kind == "fold-through-touch")
    touch = event(contact, "touch")
    assert passage.load == pytest.approx(touch.load, abs=passage.error["load"] + touch.error["load"])
    softer, stiffer = (event(contact, "pull-off", cb.Spring(passage.value * s)) for s in (0.9999, 1.0001))
    assert softer.contact_radius > 0.0
    assert stiffer.central_gap > 0.0


def test_a_loss_of_symmetry_is_that_of_separate_traces_and_ends_in_a_turning_point():
    """A tip flatter than a parabola: mode 2 becomes unstable and stable again; with a longer range it never does."""

    def contact(reach):
        return cb.Contact(cb.PowerLaw(3.0, 1.0), cb.Gauss(-1.0, reach))

    def losses(reach):
        return [e for e in cb.trace(contact(reach), modes=2).events if e.kind == "symmetry" and e.mode == 2]

    begin, end = losses(0.45)
    followed = cb.follow(begin, "interaction.range", to=0.465)
    turn = next(one for one in followed.special if one.kind == "cusp")
    _, point = followed.at(0.45)
    assert point.load == pytest.approx(end.load, abs=point.error["load"] + end.error["load"])
    assert not losses(turn.value + 1e-3)


# What cannot be followed.


@pytest.mark.parametrize(
    ("vary", "to", "settings", "message"),
    [
        ("tabour", 2.0, {}, "did you mean 'tabor'"),
        ("tabor", -1.0, {}, "must be greater than zero"),
        ("tabor", 1.0, {}, "is the present value"),
        ("tabor", (2.0, 3.0), {}, "does not lie between"),
        ("tabor", (1.0, 2.0, 3.0), {}, "3 values"),
        ("share", 0.5, {}, "sum of two laws"),
        ("stiffness", -1.0, {}, "at least 0"),
        ("interaction[2].range", 2.0, {}, "1 laws, counted from 0"),
        ("interaction.width", 2.0, {}, "has the numbers"),
        ("interaction.work_of_adhesion", 0.0, {}, "must not be zero"),
        ("tip.radius", 2.0, {"start": 1.0}, "leave it out"),
        ("tabor", 2.0, {"accuracy": 1.0}, "must lie between"),
        (gauss, 2.0, {}, "give the present value"),
        (gauss, 2.0, {"start": 1.5}, "event's own contact"),
    ],
)
def test_what_cannot_be_varied_is_named(vary, to, settings, message):
    found = TABOR_ONE[0]
    with pytest.raises(cb.InputError, match=message):
        cb.follow(found, vary, to=to, **settings)


TABOR_ONE = [e for e in cb.trace(gauss(1.0), accuracy=1e-3, modes=0).events if e.kind == "fold"]


def test_only_folds_and_touches_of_a_trace_can_be_followed():
    found = cb.trace(cb.Contact.reduced("maugis-dugdale"))
    with pytest.raises(cb.InputError, match="only folds, first touch"):
        cb.follow(found.events[-1], "tabor", to=2.0)
    with pytest.raises(cb.InputError, match="must be an event"):
        cb.follow("pull-off", "tabor", to=2.0)
    touch = next(e for e in found.events if e.kind == "touch")
    with pytest.raises(cb.InputError, match="only folds of"):
        cb.follow(touch, "stiffness", to=2.0)
    plain = cb.trace(cb.Contact(cb.Parabola(1.0)))
    with pytest.raises(cb.InputError, match="without interaction"):
        cb.follow(next(e for e in plain.events if e.kind == "touch"), "tip.radius", to=2.0)
    bare = cb.Event("fold", 0.0, 0.0, 0.0, 0.0, {})
    with pytest.raises(cb.InputError, match="it was loaded"):
        cb.follow(bare, "tabor", to=2.0)


def test_a_value_beyond_the_curve_has_no_event():
    followed = cb.follow(event(cb.Contact.reduced("maugis-dugdale", tabor=2.0), "pull-off"), "tabor", to=1.0)
    assert followed.at(0.5) == ()


# Phase diagrams.


def test_regions_of_a_phase_diagram_are_those_of_single_solutions():
    contact = cb.Contact.reduced("maugis-dugdale", tabor=1.0)
    phase = cb.phase_diagram(contact, "tabor", (0.3, 3.0), "displacement", samples=5)
    assert {(f.event.kind, f.event.name) for f in phase.boundaries} == {
        ("touch", None),
        ("fold", "jump-in"),
        ("fold", "pull-off"),
    }
    counts = phase.counts
    for k, value in enumerate(phase.values):
        for j in range(3, len(phase.levels), 61):
            states = cb.solve(cb.Contact.reduced("maugis-dugdale", tabor=value), displacement=phase.levels[j]).states
            stable = [state for state in states if state.stable("displacement")]
            touching = sum(state.contact_radius > 0 for state in stable)
            assert counts["with_contact"][k, j] == touching
            assert counts["without_contact"][k, j] == len(stable) - touching
    # what is drawn between the curves traced, where folds pass first touch
    values, levels, without, within = phase.fine()
    for tabor, d in ((0.7, -1.65), (0.7, -1.95), (0.7, -1.77), (0.75, -1.5), (0.9, -1.7), (2.0, -1.0)):
        drawn = [own[np.argmin(abs(values - tabor)), np.argmin(abs(levels - d))] for own in (without, within)]
        states = cb.find_all(cb.Contact.reduced("maugis-dugdale", tabor=tabor), displacement=d).stable
        touching = sum(state.contact_radius > 0 for state in states)
        assert drawn == [len(states) - touching, touching], (tabor, d)


def test_a_phase_diagram_finds_folds_that_the_present_contact_does_not_have(tmp_path):
    phase = cb.phase_diagram(mixed(0.5), "share", (0.6, 0.9), "load", samples=3, accuracy=1e-4)
    assert phase.status == "complete"
    assert {one.kind for one in phase.special} == {"cusp-at-touch", "fold-through-touch"}
    assert repr(phase).endswith(
        f"load over share: {len(phase.boundaries)} boundary lines, {len(phase.special)} special points"
    )
    told = str(phase).splitlines()
    assert told[0].split() == ["boundary", "share", "load"]
    assert sum(line.startswith(("cusp-at-touch", "fold-through-touch")) for line in told) == len(phase.special)
    both = (phase.counts["without_contact"] > 0) & (phase.counts["with_contact"] > 0)
    end = next(one.value for one in phase.special if one.kind == "cusp-at-touch")
    clear = abs(phase.values - end) > 0.01  # the wedge is narrow there
    assert both.any(axis=1)[clear].tolist() == (phase.values > end)[clear].tolist()
    values, levels, without, within = phase.fine()
    assert without.shape == within.shape == (len(values), len(levels))
    coexisting = values[((without > 0) & (within > 0)).any(axis=1)]
    assert end < coexisting.min() < end + 0.03
    phase.plot().savefig(tmp_path / "phase.png")


def test_contact_that_begins_on_a_ring_is_a_region_of_its_own():
    contact = cb.Contact(cb.PowerLaw(3.5, 1.0), cb.Exponential(-1.0, 8.0))
    phase = cb.phase_diagram(contact, "tabor", (0.125 / 1.04, 0.125 * 1.04), "load", samples=3, accuracy=1e-4)
    assert not phase.boundaries  # neither a fold nor first touch
    for parts in phase.parts:
        assert [part.kind for part in parts] == [(False, True), (True, True)]
    # Where the ring begins is that of tests/models/test_flat_tips.py, from the opening of a film's gap.
    assert phase.parts[1][0].stop == pytest.approx(2.38743786, abs=3e-4)


def test_folds_beyond_a_ring_bound_regions_of_a_phase_diagram():
    contact = cb.Contact(cb.PowerLaw(4.266, 1.0), cb.Gauss(1.0, 0.25))
    events = cb.trace(contact, accuracy=1e-3, modes=0).events
    assert [event.kind for event in events].count("topology") == 2
    tabor = contact.tabor
    phase = cb.phase_diagram(contact, "tabor", (tabor, 1.001 * tabor), "load", samples=3, accuracy=1e-3)
    assert (phase.status, phase.message) == ("complete", "")
    folds = [event for event in events if event.kind == "fold" and event.control == "load"]
    # Between them lies where contact begins on a ring.
    assert [len(parts) for parts in phase.parts] == [len(folds) + 2] * 3
    assert len(phase.boundaries) == len(folds) == 3


def test_boundaries_next_to_each_other_are_all_there():
    """Pull-off and jump-in of a soft contact are 1e-4 apart where both are at −60: one does not stand for the other."""
    contact = cb.Contact(cb.Parabola(1.0), cb.MaugisDugdale(1.0, 60.88722610637245))
    phase = cb.phase_diagram(contact, "interaction[0].work_of_adhesion", (0.6, 1.5), "displacement", samples=3)
    assert [one.event.name for one in phase.boundaries if one.event.kind == "fold"] == ["jump-in", "pull-off"]
    for value in (0.7, 1.4):
        event = cb.trace(cb.Contact(cb.Parabola(1.0), cb.MaugisDugdale(value, 60.88722610637245))).events
        there = {one.name: one.displacement for one in event if one.kind == "fold" and one.control == "displacement"}
        for boundary in phase.boundaries[:2]:
            (point,) = boundary.at(value)
            assert point.displacement == pytest.approx(there[boundary.event.name], abs=1e-8)


# The command.


def test_the_command_follows_and_writes(tmp_path, capsys):
    arguments = ["follow", "--interaction", "maugis-dugdale", "--tabor", "1", "--control", "displacement"]
    arguments += ["--event", "pull-off", "--vary", "tabor=0.5:2", "--json", "-", "--plot", str(tmp_path / "a.svg")]
    assert main(arguments) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["format"] == "contbranch-follow"
    curve = document["curve"]
    assert set(curve) == {"tabor", *KEYS}
    assert (curve["tabor"][0], curve["tabor"][-1]) == (0.5, 2.0)
    (special,) = document["special"]
    assert special["kind"] == "fold-through-touch"
    assert special["tabor"] == special["value"] == pytest.approx(0.832065719951667)
    assert {"model", "cost", "status", "message", "units", "contact"} <= set(document)
    assert (tmp_path / "a.svg").stat().st_size > 1000


def test_the_command_prints_a_table(capsys):
    arguments = ["follow", "--interaction", "maugis-dugdale", "--tabor", "1", "--control", "spring:2"]
    assert main([*arguments, "--event", "pull-off", "--vary", "stiffness=0:inf"]) == 0
    printed = capsys.readouterr().out
    assert "displacement-fold" in printed
    assert "complete" in printed


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--vary", "tabor=2"], "--event: missing"),
        (["--event", "pull-off"], "--vary: missing"),
        (["--event", "pull-off", "--vary", "tabor"], "write NAME=FROM:TO"),
        (["--event", "pull-off", "--vary", "tabor=1:2:3"], "write NAME=FROM:TO"),
        (["--event", "pull-off", "--vary", "tabor=x"], "plain number"),
        (["--event", "pull-off", "--vary", "tabor=2:2"], "must differ"),
        (["--event", "pull-of", "--vary", "tabor=2"], "did you mean 'pull-off'"),
        (["--event", "pull-off", "--vary", "interaction.range=1 nm"], "reduced units"),
        (["--event", "pull-off", "--vary", "tip.radius=2", "--plot", "a.txt"], "--plot"),
    ],
)
def test_the_command_complains_in_one_line(options, message, capsys):
    assert main(["follow", "--interaction", "maugis-dugdale", "--tabor", "1", *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert captured.err.count("\n") == 1


def test_an_event_is_followed_as_far_as_the_table_of_its_law_goes():
    """With a growing Tabor coefficient the table shrinks, and with it the gap at which it ends, faster than the fold's;
    what lies beyond is not described."""
    gaps = np.linspace(0.0, 1.3, 30)
    law = cb.Tabulated(tuple(gaps), energies=tuple(-1.0 / (1.0 + gaps) ** 2))
    contact = cb.Contact(cb.Cone(0.2), law)
    fold = next(e for e in traced(contact, "displacement", max_load=0.1).folds("displacement") if e.name == "jump-in")
    followed = cb.follow(fold, "tabor", 10.0 * contact.tabor)
    (end,) = followed.special
    assert (followed.status, end.kind) == ("complete", "table-end")
    assert "table" in followed.message
    assert end.central_gap == pytest.approx(1.3 * contact.tabor / end.value, rel=1e-4)
    assert (followed.curve["central_gap"] <= 1.3001 * contact.tabor / followed.curve["tabor"]).all()


@dataclass(frozen=True)
class Ramp(cb.Interaction):
    """A pressure that begins at two ranges, and from there on grows linearly."""

    name: ClassVar[str] = ""

    def shape(self, x):
        left = np.maximum(1 - x / 2, 0.0)
        return left**2, -left, np.where(x < 2, 0.5, 0.0)


def test_a_jump_in_where_the_interaction_begins_does_not_leave():
    """Its load is a millionth there, which is not that of infinite separation."""
    contact = cb.Contact(cb.Parabola(1.0), Ramp(1.0, 0.0464843), 3.0)
    jump = traced(contact, max_load=0.01).events[0]
    assert jump.name == "jump-in"
    followed = cb.follow(jump, vary="tip.radius", to=1.1)
    assert followed.status == "complete"
    assert not followed.special
    there = traced(replace(contact, tip=cb.Parabola(1.1)), max_load=0.01).events[0]
    assert followed.curve["displacement"][-1] == pytest.approx(there.displacement, abs=1e-7)
    assert followed.curve["load"][-1] == pytest.approx(there.load, abs=1e-8)


def test_the_parameter_of_a_function_has_a_column_without_unit(tmp_path):
    """Maugis' pull-off in the range, by a function: the table's ends are closed forms."""
    contact = cb.Contact(cb.Parabola(1.0), cb.MaugisDugdale(1.0, 0.5))
    fold = event(contact, "pull-off")
    found = cb.follow(fold, lambda z: cb.Contact(cb.Parabola(1.0), cb.MaugisDugdale(1.0, z)), 0.25, start=0.5)
    found.to_csv(tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row, z in ((rows[0], 0.5), (rows[-1], 0.25)):
        assert float(row["parameter"]) == z
        assert float(row["load"]) == pytest.approx(maugis.load_fold(interaction_range=z).load, abs=1e-9)
    assert "parameter" in found._repr_html_()
