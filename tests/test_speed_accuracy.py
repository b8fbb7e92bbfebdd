"""studies/speed_accuracy.py and elsewhere.py: true values, errors within estimates, ramps, fronts, what is quoted."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import elsewhere, speed_accuracy  # noqa: E402
from studies.elsewhere import Failure, Passed, Radial, Seen  # noqa: E402
from studies.speed_accuracy import Measured, Spot, Subject  # noqa: E402

METHODS = {method.name: method for method in speed_accuracy.methods()}


# True values and errors


def test_true_values():
    """Maugis' closed form; pull-off within 1e-3 of JKR's excess 0.339/μ_T² for a stiff law (measured from 12 to 64)."""
    assert speed_accuracy.truth(Subject("maugis-dugdale", 1.0))["pull_off_load"].value == pytest.approx(-4.98063009659)
    stiff = speed_accuracy.truth(Subject("exponential", 16.0))["pull_off_load"]
    assert stiff.value == pytest.approx(-1.5 * math.pi * (1.0 + 0.339 / 256.0), rel=1e-4)
    assert stiff.error < 1e-11


@pytest.mark.parametrize(("name", "setting", "law"), [
    ("exact", "1e-12", "maugis-dugdale"), ("axisymmetric", "1e-07", "gauss"), ("axisymmetric", "1e-07", "exponential"),
])  # fmt: skip
def test_models_without_grid(name, setting, law):
    """Errors are within the accuracy asked for and within the estimates."""
    subject = Subject(law, 1.0)
    for task in ("folds", "radius"):
        row = speed_accuracy.measure(METHODS[name], setting, subject, task, least=0.0)
        assert set(row.errors) == ({"radius"} if task == "radius" else set(subject.folds))
        for quantity, error in row.errors.items():
            assert error <= row.estimates[quantity] + 1e-12 <= float(setting) + 1.1e-12
        assert row.seconds > 0.0


def test_grid_and_closed_forms():
    """A grid of 64² nodes has the pull-off load within its own estimate; JKR's theory is 10 % off at μ_T = 1."""
    subject = Subject("exponential", 1.0)
    row = speed_accuracy.measure(METHODS["free grid"], "64", subject, "folds", least=0.0)
    assert row.errors["pull_off_load"] <= row.estimates["pull_off_load"] < 3e-3
    jkr = speed_accuracy.measure(METHODS["JKR"], "closed form", subject, "folds", least=0.0)
    assert jkr.errors["pull_off_load"] == pytest.approx(1.0 - 1.5 * math.pi / 5.227851609468, abs=1e-9)


@pytest.mark.parametrize("name", ["GFMD ramp", "FIRE ramp"])
def test_minimisers_jump_within_a_step(name):
    """Pull-off on a ramp of 20 steps of 0.4: off by half a step and the lattice's error, which is below 1 % here."""
    row = speed_accuracy.measure(METHODS[name], "64/20", Subject("exponential", 1.0), "folds", least=0.0)
    assert 5.227851609468 * row.errors["pull_off_load"] <= 0.2 + 0.05
    assert not row.estimates


def test_other_programs_take_part_or_say_why_not():
    row = speed_accuracy.measure(METHODS["tamaas ramp"], "64/20", Subject("exponential", 1.0), "radius", least=0.0)
    assert row.note.startswith("NotInstalled") or row.errors["radius"] < 0.03


# Pieces


def ramped(closeness: list[float]) -> Passed:
    states = tuple(Seen(0.0, 0.0, max(value, 0.0), max(-value, 0.0)) for value in closeness)
    return Passed(tuple(float(k) for k in range(len(states))), states)


def test_jumps_of_a_ramp():
    """A jump is in the middle of its step; a smooth ramp has none; one that is torn apart ends there."""
    assert elsewhere.jump(ramped([-1.0, -0.9, -0.8, 1.5, 1.6, 1.7])) == 2.5
    assert elsewhere.jump(ramped([-1.0, -0.8, -0.6, -0.4, -0.2, 0.0])) is None
    assert elsewhere.jump(ramped([-1.0, -0.9, -0.8, 1.5, 1.6, 1.7]), least=3.0) is None
    assert elsewhere.jump(Passed((0.0, 1.0), ramped([1.0, 0.9]).states, lost=2.0)) == 1.5
    assert elsewhere.touches(ramped([-1.0, -0.5, 0.1, 0.2])) == 1.5
    assert elsewhere.touches(ramped([-1.0, -0.5])) is None


def test_fixed_mesh_along_the_whole_curve():
    """Loads of both folds of the Gauss repulsion, μ_T = 1, by 96 nodes; indices change there and only there."""
    radial = Radial(cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1), 96, 8.0)
    places = np.concatenate([-np.geomspace(6.0, 0.01, 120), np.linspace(0.001, 1.0, 120)])
    states = radial.along(places.tolist())
    loads = np.array([radial.seen(x).load for x in states])
    turns = np.flatnonzero(np.diff(np.sign(np.diff(loads)))) + 1
    assert loads[turns] == pytest.approx([8.37705144, 8.00651141], abs=2e-3)
    indices = np.array([radial.indices(x, "load") for x in states[::8]])
    inside = (np.arange(0, 240, 8) > turns[0]) & (np.arange(0, 240, 8) < turns[1])
    assert (indices == inside).all()


def test_natural_parameter_steps_end_at_a_fold():
    """Under a falling load they reach 8.0065 from above, and stop there."""
    radial = Radial(cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1), 96, 8.0)
    start = radial.along([*-np.geomspace(6.0, 0.01, 40), *np.linspace(0.01, 1.3, 20)])[-1]
    with pytest.raises(Failure, match=r"no convergence beyond load 8\.00") as caught:
        radial.stepped(start, "load", np.linspace(11.0, 7.0, 21).tolist(), math.inf)
    assert caught.value.kind == "diverged"
    with pytest.raises(Failure, match="time was up"):
        radial.stepped(start, "load", [11.0, 10.0], 0.0)


def test_front_of_pareto():
    """What another one beats in both is left out, and so is the exact model, whose law is another one."""
    rows = [(3.0, 1e-3), (1.0, 1e-2), (2.0, 1e-1), (4.0, 1e-3), (5.0, 1e-6)]
    points = [Spot(*row, "axisymmetric", "own", "") for row in rows] + [Spot(0.1, 1e-9, "exact", "own", "")]
    assert [one[:2] for one in speed_accuracy.front(points)] == [(1.0, 1e-2), (3.0, 1e-3), (5.0, 1e-6)]
    assert speed_accuracy.fastest(points, 1e-3, "axisymmetric").seconds == 3.0
    assert speed_accuracy.fastest(points, 1e-7, "ramp") is None


def measured(method: str, family: str, seconds: float, error: float, law: str = "exponential") -> Measured:
    names = ("pull_off_load",) if law == "exponential" else ("squeeze_out_load", "wetting_load")
    values = dict.fromkeys(names, error)
    return Measured(method, family, "64", law, 1.0, "folds", seconds, values, dict.fromkeys(names, 2 * error), "")


def test_ratios_are_those_of_the_fastest_that_are_accurate():
    rows = [
        measured("axisymmetric", "own", 0.1, 1e-8),
        measured("axisymmetric", "own", 0.2, 1e-11),
        measured("tamaas ramp", "peer", 2.0, 1e-3),
        measured("tamaas ramp", "peer", 0.5, 1e-1),
        measured("GFMD ramp", "ramp", 1.0, 5e-3),
    ]
    assert speed_accuracy.ratios(rows, 1e-2, ("peer",), ("axisymmetric",)) == [pytest.approx(20.0)]
    assert speed_accuracy.ratios(rows, 1e-2, ("ramp",), ("axisymmetric",)) == [pytest.approx(10.0)]
    assert speed_accuracy.ratios(rows, 1e-4, ("peer",), ("axisymmetric",)) == []
    assert "1 cases" in speed_accuracy.summary(rows)


def test_measurements_go_on_where_they_stopped(tmp_path, monkeypatch):
    path, method = tmp_path / "results.json", METHODS["JKR"]
    monkeypatch.setattr(speed_accuracy, "TABORS", (1.0,))
    monkeypatch.setattr(speed_accuracy.tasks, "__defaults__", ((1.0,),))
    found = speed_accuracy.run([method], minutes=1.0, path=path)
    assert {row.task for row in found.values()} == {"folds", "radius"}
    monkeypatch.setattr(speed_accuracy, "measure", None)  # nothing is measured again
    assert speed_accuracy.run([method], minutes=1.0, path=path) == found


def test_chart(tmp_path):
    rows = [measured(name, "own", 0.1 * k, 10.0**-k) for k in (1, 3, 5) for name in speed_accuracy.LOOKS]
    figure = speed_accuracy.draw(rows, (1.0,))
    assert len(figure.axes) == 5
    assert figure.axes[0].get_xscale() == figure.axes[0].get_yscale() == "log"
    figure.savefig(tmp_path / "chart.png")


def test_pages_quote_the_results():
    """What README and page say stands in the results, of ten methods and two other programs at least."""
    found = list(speed_accuracy.load_results().values())
    able = {row.method for row in found if row.errors}
    assert len(able) >= 12
    assert {row.method for row in found if row.errors and row.family == "peer"} == {"tamaas ramp", "Adhesion ramp"}
    assert speed_accuracy.summary(found) in speed_accuracy.PAGES["summary"].read_text(encoding="utf-8")
    page = speed_accuracy.PAGES["details"].read_text(encoding="utf-8")
    assert all(table in page for table in speed_accuracy.details(found).split("\n\n")[1:])
