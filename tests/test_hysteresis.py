"""Hysteresis loops: jumps, landings and dissipated energies against closed forms, areas and energy differences."""

from __future__ import annotations

import json
import math
import re
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.continuation import CorrectionError, Outcome
from contbranch.control import as_control
from contbranch.curve import curves, paths
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.quasi_static import Stop, quasi_static
from contbranch.curve.trace import Request
from contbranch.errors import ModelError
from contbranch.results.diagram import State

LAMBDA = (2 * math.pi / 9) ** (1 / 3)
"""Reduced Tabor coefficient for Maugis' λ = 1, (43) with its misprint corrected."""


@pytest.mark.parametrize(("ratio", "loss"), [(1.0, 2.76091), (10.0, 6.62996)])
def test_the_loss_of_maugis_dugdale_contacts(ratio, loss):
    # Independent values, six digits, in R|Δγ| · R^(1/3) (|Δγ|/E)^(2/3), of displacement control.
    loop = cb.hysteresis(cb.Contact.reduced("maugis-dugdale", ratio * LAMBDA), control="displacement")
    assert loop.closed
    assert [jump.name for jump in loop.jumps] == ["jump-in", "pull-off"]
    assert loop.dissipated == pytest.approx(loss, abs=5.1e-6)
    # By quadrature, which at the corner where the tip leaves the zone knows loads and slopes at both ends only.
    assert loop.area == pytest.approx(loop.dissipated, abs=1e-9)


def test_the_loss_tends_to_that_of_jkr():
    # 7.09219597186 in the limit λ → ∞; the deficit is proportional to the range, 1/λ.
    deficits = [
        ratio
        * (
            7.09219597186
            - cb.hysteresis(cb.Contact.reduced("maugis-dugdale", ratio * LAMBDA), "displacement").dissipated
        )
        for ratio in (1e4, 1e5)
    ]
    assert deficits[0] == pytest.approx(deficits[1], rel=1e-3)
    assert 4.0 < deficits[1] < 5.5


CASES = [
    ("gauss", 1.0, -1, "load", 2),
    ("gauss", 1.0, -1, "displacement", 2),
    ("exponential", 1.0, 1, "spring:0.5", 2),
    ("maugis-dugdale", 1.0, 1, "spring:3", 2),
]


@cache
def loop_of(law, tabor, sign, control):
    return cb.hysteresis(cb.Contact.reduced(law, tabor, sign), as_python(control), accuracy=1e-9)


@pytest.mark.parametrize(("law", "tabor", "sign", "control", "jumps"), CASES)
def test_energy_lost_is_the_area_between_the_branches(law, tabor, sign, control, jumps):
    """dV/dd = F along the curve, so both agree; the areas are integrated along the unstable parts (jumps) and along the
    stable ones (loop)."""
    loop = loop_of(law, tabor, sign, control)
    assert loop.closed
    assert len(loop.jumps) == jumps
    for jump in loop.jumps:
        assert jump.dissipated > 0
        assert jump.area == pytest.approx(jump.dissipated, abs=1e-9 * max(1.0, jump.dissipated) + 3 * jump.error)
        assert jump.error < 1e-8 * max(1.0, abs(jump.start.energy))
        assert getattr(jump, "from") is jump.start
    assert loop.dissipated == pytest.approx(sum(jump.dissipated for jump in loop.jumps))
    largest = max(abs(jump.start.energy) for jump in loop.jumps)
    assert loop.area == pytest.approx(loop.dissipated, abs=1e-9 * max(1.0, largest) + 3 * loop.error)


def test_areas_are_as_accurate_as_the_energies_at_low_accuracy():
    # Changes of the mesh on the way, at the fold and at the landing, each shift the displacement a little.
    loop = cb.hysteresis(cb.Contact.reduced("gauss", 0.6, -1), accuracy=1e-5)
    for jump in loop.jumps:
        assert jump.area == pytest.approx(jump.dissipated, abs=2e-6)


def as_python(control):
    return cb.Spring(float(control.partition(":")[2])) if control.startswith("spring") else control


def test_areas_reach_through_a_touch_to_the_fold_behind_it():
    """The wetting fold shares its row with first touch, through which the area leads."""
    loop = cb.hysteresis(cb.Contact(cb.PowerLaw(2.93, 1.0), cb.Contact.reduced("gauss", 0.004, -1).interaction))
    wetting = loop.jumps[-1]
    assert (wetting.name, wetting.start.contact_radius > 0.0) == ("wetting", True)
    assert wetting.area == pytest.approx(wetting.dissipated, abs=1e-6)


def test_a_loop_closes_however_small_it_is():
    """Next to a continuous onset energies differ by less than their errors, and folds lie between rows."""
    loop = cb.hysteresis(cb.Contact.reduced("gauss", 0.005, -1))
    assert [jump.name for jump in loop.jumps] == ["squeeze-out", "wetting"]
    assert [jump.to.contact_radius > 0.0 for jump in loop.jumps] == [True, False]
    assert loop.closed
    assert abs(loop.dissipated) < 1e-8


@pytest.mark.parametrize(("law", "tabor", "sign", "control", "jumps"), CASES)
def test_jumps_keep_the_control_and_go_from_a_fold_to_a_stable_state(law, tabor, sign, control, jumps):
    contact = cb.Contact.reduced(law, tabor, sign)
    driven = as_control(as_python(control))
    loop = loop_of(law, tabor, sign, control)
    folds = {e.name: e for e in cb.trace(contact, as_python(control), modes=0).folds(driven.kind)}
    for jump in loop.jumps:
        fold = folds[jump.name]
        assert jump.start.load == pytest.approx(fold.load, abs=2e-6 * max(1.0, abs(fold.load)))
        for state in (jump.start, jump.to):
            value = driven.value(state.load, state.displacement)
            assert value == pytest.approx(jump.position, abs=1e-5 * max(1.0, abs(jump.position)))
        assert jump.to.unstable(driven) == 0
    up, down = loop.path.direction == 1, loop.path.direction == -1
    assert (np.diff(loop.path.position[up]) >= -1e-9).all()
    assert (np.diff(loop.path.position[down]) <= 1e-9).all()


def test_attraction_under_a_load_never_comes_back():
    loop = cb.hysteresis(cb.Contact.reduced("exponential", 1.0))
    assert not loop.closed
    assert loop.dissipated is None
    (jump,) = loop.jumps
    assert jump.name == "pull-off"
    assert jump.to is None
    assert jump.dissipated is None
    assert "infinite separation" in loop.message
    document = loop.document()
    assert document["dissipated"] is None
    assert document["jumps"][0]["to"] is None
    json.dumps(document, allow_nan=False)


def test_without_folds_the_path_is_reversible():
    # v'' ≥ 0 makes the energy convex
    loop = cb.hysteresis(cb.Contact.reduced("exponential", 4.0, -1))
    assert loop.closed
    assert loop.jumps == ()
    assert loop.dissipated == 0.0
    up = loop.path.direction == 1
    assert loop.path.load[up][-1] == loop.path.load[~up][0]


@pytest.mark.parametrize("law", ["exponential", "maugis-dugdale"])
def test_a_soft_spring_snaps_off_to_where_the_path_begins(law):
    """It lands farther away than the interaction reaches; a path that began there would leave the loop open."""
    loop = cb.hysteresis(cb.Contact.reduced(law, 2.0), cb.Spring(0.05), accuracy=1e-4)
    assert loop.closed
    path, last = loop.path, loop.jumps[-1]
    for name in ("position", "load", "displacement"):
        assert path[name][0] == path[name][-1]
    assert path.displacement[0] == last.to.displacement < path.displacement[1]
    assert np.all(np.diff(path.position[path.leg == 0]) > 0.0)
    assert loop.area == pytest.approx(loop.dissipated, rel=1e-3)


def test_the_path_shows_the_curve():
    """Between the path's points straight lines are close to the curve: here against the closed form."""
    contact = cb.Contact.reduced("maugis-dugdale", 1.0)
    path = cb.hysteresis(contact, "displacement").path
    touching = (path.contact_radius > 0) & (path.direction == 1)
    d, load = path.displacement[touching], path.load[touching]
    middle = (d[1:] + d[:-1]) / 2
    for k in range(5, len(middle), 9):
        exact = cb.find_all(contact, displacement=float(middle[k])).states[-1]
        assert (load[k] + load[k + 1]) / 2 == pytest.approx(exact.load, abs=0.01 * np.ptp(load))


def test_relaxation_goes_to_the_next_layer_and_not_to_the_lowest_state():
    """Three layers and more: beyond each fold many stable states are lower, and the system falls into the first.

    Far away, where a layer deforms nothing, folds of the load lie where v vanishes (Derjaguin: F = 2πR v), a
    half-wave apart; the state after the jump lies within the next wave.
    """
    contact = cb.Contact.reduced("layered", tabor=1.0, wavelength=3.0)
    loop = cb.hysteresis(contact, accuracy=1e-5)
    names = [jump.name for jump in loop.jumps]
    layers = [name for name in names if name.startswith("squeeze-out")]
    assert layers == [f"squeeze-out-{k}" for k in range(len(layers), 0, -1)]
    assert len(layers) >= 4
    gaps = [jump.start.central_gap for jump in loop.jumps[: len(layers)]]
    np.testing.assert_allclose(-np.diff(gaps)[:3], 3.0, atol=0.005)
    for jump in loop.jumps[: len(layers) - 1]:
        assert 1.5 < jump.start.central_gap - jump.to.central_gap < 3.0
        lowest = min(jump.others, key=lambda s: s.energy - jump.position * s.displacement)
        assert (
            lowest.energy - jump.position * lowest.displacement < jump.to.energy - jump.position * jump.to.displacement
        )


@pytest.mark.parametrize(
    ("law", "tabor", "sign", "control"),
    [("exponential", 1.0, 1, "displacement"), ("gauss", 1.0, -1, "displacement")],
)
def test_relaxation_ends_where_energies_say_it_must(law, tabor, sign, control):
    """Where only one stable state is lower than the fold the relaxation has no choice; it is followed all the same."""
    driven = as_control(as_python(control))
    curves = FollowedCurves(cb.Contact.reduced(law, tabor, sign), cb.Axisymmetric())
    route = curves.path(Request(1e-6, driven))
    walk, jumps = route.walk, route.jumps
    assert len(jumps) == 2
    for jump in jumps:
        assert jump.others == ()
        assert walk.relaxed(jump.begin, [jump.end], jump.direction) is jump.end
    assert walk.assumed == []


def test_what_the_path_jumps_to_is_traced_however_far_it_is():
    """A soft spring jumps to a high load: the curve is followed until the landing lies on it."""
    loop = cb.hysteresis(cb.Contact.reduced("gauss", 4.0, -1), "displacement")
    assert loop.closed
    soft = cb.hysteresis(cb.Contact.reduced("exponential", 1.0), cb.Spring(0.02), max_load=1.0)
    assert soft.closed
    assert all(jump.to is not None for jump in soft.jumps)


def test_a_loop_whose_curve_ends_before_a_jump_does_is_incomplete(monkeypatch):
    """What is pressed does not leave for infinity."""
    monkeypatch.setattr(curves, "EXTENSIONS", 1)
    loop = cb.hysteresis(cb.Contact.reduced("gauss", 1.0, -1), max_load=1.0, accuracy=1e-4)
    assert (loop.status, loop.closed, loop.dissipated) == ("incomplete", False, None)
    assert "Where the jump from squeeze-out ends was not reached" in loop.message
    assert "infinite" not in str(loop)
    assert not [text for axes in loop.plot().axes for text in axes.texts if "infinity" in text.get_text()]


class Blind(paths.CurveWalk):
    """A walk along a curve that finds no landing."""

    def crossing(self, *_):
        raise ModelError("no state was found")


def test_a_loop_keeps_the_path_up_to_a_landing_that_is_not_found(tmp_path, monkeypatch):
    contact = cb.Contact.reduced("gauss", 3.0, -1)
    known = cb.hysteresis(contact, accuracy=1e-4)
    monkeypatch.setattr(curves, "CurveWalk", Blind)
    loop = cb.hysteresis(contact, accuracy=1e-4)
    assert (loop.status, loop.closed, loop.dissipated) == ("incomplete", False, None)
    assert (
        "The path ends early: no state was found. Where the jump from squeeze-out ends was not reached" in loop.message
    )
    (jump,) = loop.jumps
    assert jump.to is None
    assert jump.start == known.jumps[0].start
    assert loop.path.load[-1] == jump.start.load
    loop.save(tmp_path / "loop.h5")
    assert cb.load(tmp_path / "loop.h5") == loop


def test_the_command_prints_a_document(capsys):
    arguments = ["--interaction", "maugis-dugdale", "--tabor", str(LAMBDA), "--control", "displacement"]
    assert main(["loop", *arguments, "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {"path", "jumps", "dissipated", "model", "cost", "status", "message"} <= set(document)
    assert document["dissipated"] == pytest.approx(2.76091, abs=1e-5)
    assert {"load", "displacement"} <= set(document["path"])
    assert {"from", "to", "dissipated"} <= set(document["jumps"][0])
    assert main(["loop", *arguments]) == 0
    assert "pull-off" in capsys.readouterr().out


def test_the_figure_of_a_loop(tmp_path):
    loop = cb.hysteresis(cb.Contact.reduced("maugis-dugdale", 1.0), cb.Spring(2.0))
    figure = loop.plot()
    above, below = figure.axes
    assert below.get_ylabel() != above.get_ylabel()
    figure.savefig(tmp_path / "loop.png")
    low, high = above.get_xlim()
    assert all(low < jump.position < high for jump in loop.jumps)


def test_a_jump_that_an_axis_does_not_show_has_no_arrow_there():
    """Neither end of the snap-off is in contact: the head of an arrow without length stood beside the place."""
    loop = cb.hysteresis(cb.Contact.reduced("gauss", 0.55), cb.Spring(0.8), accuracy=1e-4)
    assert [jump.start.contact_radius for jump in loop.jumps] == [0.0, 0.0]
    above, below = ([one for one in axes.texts if one.arrowprops.get("linestyle")] for axes in loop.plot().axes)
    assert (len(above), len(below)) == (2, 1)


def test_a_jump_from_a_load_that_all_but_vanishes_lands_one_layer_away():
    """e^(−g/z0) [1 + cos(2πg/λ)] repels everywhere but for its minima, whose folds have loads of next to nothing.

    Far away F = 2π v(g) (Derjaguin). As the load is lowered below a minimum at g₀ the tip moves out until 2π v has
    fallen to F again: the first such gap beyond the next maximum.
    """
    decay, layer = 0.8, 2.4
    law = cb.Layered(-1.0, decay, layer) + cb.Exponential(-1.0, decay)
    loop = cb.hysteresis(cb.Contact(cb.Parabola(1.0), law, 3.0), accuracy=1e-5)
    assert loop.status == "complete"
    far = [jump for jump in loop.jumps if jump.name.startswith("wetting") and jump.start.central_gap > 2.0 and jump.to]
    assert len(far) >= 3
    assert min(jump.position for jump in far) < 1e-8
    for jump in far:
        gap = np.linspace(jump.start.central_gap, jump.start.central_gap + 2 * layer, 20001)
        force = 2 * np.pi * np.exp(-gap / decay) * (1 + np.cos(2 * np.pi * gap / layer))
        falling = gap[int(np.argmax(force)) :][force[int(np.argmax(force)) :] < jump.position]
        assert jump.to.central_gap == pytest.approx(falling[0], abs=0.02 * layer)
        assert jump.to.load == pytest.approx(jump.position, abs=1e-9)


def test_work_where_nothing_is_found_between_rows_is_the_change_of_energy(monkeypatch):
    contact = cb.Contact.reduced("gauss", tabor=2.0, sign=-1)

    def nowhere(*_):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "")

    monkeypatch.setattr("contbranch.curve.paths.work_along", nowhere)
    loop = cb.hysteresis(contact, accuracy=1e-8)
    assert loop.dissipated > 0.1
    assert loop.area == pytest.approx(loop.dissipated, abs=1e-7)


def test_a_path_that_loses_its_stability_where_no_fold_is_known_ends_there(monkeypatch):
    """It is not closed, as one would be whose curve ends there."""
    contact = cb.Contact.reduced("gauss", tabor=2.5)
    monkeypatch.setattr(paths.CurveWalk, "folds", {})
    loop = cb.hysteresis(contact, "displacement", accuracy=1e-4)
    assert (loop.status, loop.closed, loop.dissipated, loop.jumps) == ("incomplete", False, None, ())
    told = re.search(r"stability is lost next to load (\S+), displacement (\S+) \(reduced\)", loop.message)
    assert [loop.path.load[-1], loop.path.displacement[-1]] == pytest.approx([*map(float, told.groups())], rel=1e-4)


@pytest.mark.parametrize(("last", "why"), [(3.0, "stability is lost next to load 2,"), (2.0, "")])
def test_a_path_may_end_where_what_is_controlled_rests(last, why):
    """As a load beyond the end of a finite law does: no fold is needed there."""
    walk = SimpleNamespace(
        folds={},
        unstable=np.array([0, 0, 1]),
        rising=np.array([1, 1, 1]),
        values=np.array([0.0, 1.0, 2.0, last]),
        stop=lambda row: Stop(min(row, 2), State(float(row), *(0.0,) * 4, 0, 0, 0.0), row=row),
    )
    legs, jumps, failed = quasi_static(walk)
    assert ([stop.row for stop in legs[0].stops], jumps) == ([0, 1, 2], [])
    assert why in failed
    assert bool(why) == bool(failed)


def test_a_state_that_leads_back_to_its_fold_is_not_jumped_to():
    """The outermost layers pull and push by less than the accuracy: there loads of rows and of folds differ."""
    law = cb.Layered(-1.0, 0.8, 1.6) + cb.Exponential(-1.0, 0.8)
    loop = cb.hysteresis(cb.Contact(cb.Parabola(1.0), law, 10.0), accuracy=1e-3)
    assert loop.jumps[-1].to is None
    loads = [jump.start.load for jump in loop.jumps if jump.name.startswith("wetting")]
    assert loads == sorted(loads, reverse=True)
