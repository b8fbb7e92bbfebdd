"""Folds along a traced curve whose marks the steps have missed."""

from __future__ import annotations

import pytest

import contbranch as cb


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9])
def test_folds_closer_than_a_step_are_located_between_its_rows(accuracy):
    """On a stiff film dF/dd is so steep that load and displacement turn within 1e-5 of the contact coordinate.

    The load is largest at its own fold, and the displacement at its own: which comes first follows from that.
    """
    diagram = cb.trace(cb.Contact.reduced("gauss", 6.0, -1), accuracy=accuracy, modes=0)
    assert diagram.status == "complete"
    squeeze_out = {event.control: event for event in diagram.events if event.name == "squeeze-out"}
    load, displacement = squeeze_out["load"], squeeze_out["displacement"]
    assert load.load > displacement.load
    assert displacement.displacement > load.displacement
    # Between the two folds the slope dF/dd is that of the film, so that both differences are small together.
    assert load.load - displacement.load < 1e-6
    assert load.error["load"] <= accuracy * load.load
