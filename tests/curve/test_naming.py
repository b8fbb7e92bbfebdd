"""Names of folds and thresholds, from hand-made events and from whole diagrams."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb
from contbranch.curve.naming import fold_name, number_layers, signs_of, tell_apart, threshold_events
from contbranch.results.diagram import Event

ATTRACTION, REPULSION = cb.Exponential(1.0, 1.0), cb.Gauss(-2.0, 1.0)


def fold(control, name, load, displacement=0.0, contact_radius=0.0):
    return Event(
        "fold", load, displacement, contact_radius, 0.0 if contact_radius else 1.0, {}, control=control, name=name
    )


def thresholds(events):
    return {name: getattr(event, key) for name, (event, key) in threshold_events(events, repulsive=True).items()}


@pytest.mark.parametrize(
    ("law", "control", "load", "increase", "name"),
    [
        (ATTRACTION, "displacement", -1.0, True, "jump-in"),
        (ATTRACTION, "load", -1.0, False, "pull-off"),
        (ATTRACTION, "displacement", -1.0, False, "pull-off"),
        (REPULSION, "load", 1.0, True, "squeeze-out"),
        (REPULSION, "displacement", 1.0, False, "wetting"),
        (ATTRACTION + REPULSION, "load", -1.0, False, "pull-off"),
        (ATTRACTION + REPULSION, "displacement", -1.0, True, "jump-in"),
        (ATTRACTION + REPULSION, "load", 1.0, True, "squeeze-out"),
        (ATTRACTION + REPULSION, "load", 1.0, False, "wetting"),
        (ATTRACTION + ATTRACTION, "load", 1.0, False, "pull-off"),
    ],
)
def test_fold_names(law, control, load, increase, name):
    assert fold_name(signs_of(law), control, load, increase) == name


def test_the_outermost_fold_is_the_threshold():
    events = [
        fold("load", "squeeze-out", 5.0),
        fold("load", "squeeze-out", 7.0, contact_radius=0.5),
        fold("load", "wetting", 4.0, contact_radius=1.0),
        fold("load", "wetting", 3.0, contact_radius=0.2),
        fold("displacement", "jump-in", -1.0, displacement=-2.0),
        fold("displacement", "jump-in", -1.0, displacement=-1.5, contact_radius=0.1),
        fold("load", None, 100.0),
    ]
    assert thresholds(events) == {
        "squeeze_out_load": 7.0,
        "squeeze_out_radius": 0.5,
        "wetting_load": 3.0,
        "wetting_radius": 0.2,
        "jump_in_displacement": -2.0,
    }


def test_layers_are_numbered_from_the_wall():
    law = cb.Layered(-1.0, 1.0, 0.5)
    names = ["squeeze-out", "squeeze-out", "squeeze-out", "wetting", None]
    controls = ["load", "displacement", "load", "load", "load"]
    numbered = number_layers(names, controls, law)
    assert numbered == ["squeeze-out-2", "squeeze-out-2", "squeeze-out-1", "wetting-1", None]
    names = ["squeeze-out", "wetting", "pull-off", "squeeze-out", "squeeze-out", "pull-off", "pull-off"]
    controls = ["load", "displacement", "load", "load", "displacement", "displacement", "load"]
    numbers = ["-2", "-2", "-2", "-1", "-1", "-1", "-1"]
    assert number_layers(names, controls, law) == [name + number for name, number in zip(names, numbers, strict=True)]
    assert number_layers(names, controls, REPULSION) == names
    events = [fold("load", "squeeze-out-2", 1.0), fold("load", "squeeze-out-1", 2.0)]
    assert thresholds(events)["squeeze_out_load"] == 2.0


def test_folds_of_one_kind_are_told_apart():
    names = ["pull-off", "squeeze-out", "pull-off", None, "pull-off", "squeeze-out", "pull-off"]
    controls = ["load", "load", "displacement", "load", "load", "load", "load"]
    values = [(-3.0, 0.0), (2.0, 0.0), (0.0, -1.0), (0.0, 0.0), (-5.0, 0.0), (4.0, 0.0), (-4.0, 0.0)]
    told = ["pull-off-3", "squeeze-out-2", "pull-off", None, "pull-off", "squeeze-out", "pull-off-2"]
    assert tell_apart(names, controls, values) == told


def test_folds_between_unstable_parts_have_no_name():
    diagram = cb.trace(cb.Contact.reduced(cb.Exponential, 4.0))
    branch = diagram.branches[0]
    for event in diagram.folds():
        index = branch.unstable(event.control)
        row = int(event.position)
        sides = {int(index[row - 1]), int(index[row + 1])}
        assert (event.name is None) == (0 not in sides), event
    assert "jump_in_load" not in diagram.thresholds
    assert diagram.thresholds["pull_off_load"] == pytest.approx(-4.794, abs=5e-4)
    assert set(diagram.thresholds) == {
        "touch_load",
        "touch_displacement",
        "pull_off_load",
        "pull_off_radius",
        "pull_off_displacement",
        "pull_off_displacement_radius",
        "jump_in_displacement",
    }


def test_stiff_attraction_has_no_displacement_fold():
    diagram = cb.trace(cb.Contact.reduced(cb.Exponential, 0.25))
    assert [(event.control, event.name) for event in diagram.folds()] == [("load", "pull-off")]
    assert "pull_off_displacement" not in diagram.thresholds
    assert diagram.branches[0].unstable_displacement.max() == 0


def test_a_secondary_minimum_over_a_repulsive_film_is_complete():
    """DLVO: attracted from far away (pull-off), then a barrier (squeeze-out or a continuous onset)."""
    law = cb.VanDerWaals(1.0, 1.0) + cb.Exponential(-0.5, 0.2)
    diagram = cb.trace(cb.Contact(cb.Parabola(1.0), law, 1.0))
    assert diagram.status == "complete", diagram.message
    assert diagram.thresholds["pull_off_load"] < 0
    assert all(event.load < 0 for event in diagram.folds() if event.name in ("pull-off", "jump-in"))
    assert all(event.load > 0 for event in diagram.folds() if event.name in ("squeeze-out", "wetting"))


def test_tables_that_change_sign_are_named_as_the_sums_they_are_of() -> None:
    """Van der Waals and double layer, as two laws and as a table of their energies."""
    gaps = np.linspace(0.0, 60.0, 2000)
    energies = -0.03 / (1.0 + (gaps / 0.5) ** 2) + 0.02 * np.exp(-gaps / 3.0)
    diagram = cb.trace(
        cb.Contact.physical(
            radius="1 um",
            modulus="10 GPa",
            interaction=cb.Tabulated(gaps=gaps.tolist(), energies=energies.tolist()),
        ),
        accuracy=1e-4,
    )
    assert diagram.thresholds["squeeze_out_load"] == pytest.approx(57.579, abs=0.02)
    assert diagram.thresholds["pull_off_load"] < -50.0
    assert signs_of(cb.Gauss(-1.0, 1.0)) == (False, True)
    assert signs_of(cb.Gauss(1.0, 1.0)) == (True, False)
    assert signs_of(None) == (False, False)
