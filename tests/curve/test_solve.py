"""States where a curve has a value: next to first touch, next to a fold, and the lowest of several."""

import dataclasses

import numpy as np
import pytest

import contbranch as cb
from contbranch.continuation import CorrectionError, Outcome
from contbranch.curve import curves
from contbranch.curve.solve import crossings
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track


def next_to_touch(solution, touch):
    return min(solution.states, key=lambda state: abs(state.displacement - touch.displacement) + state.contact_radius)


@pytest.mark.parametrize(("law", "accuracy"), [(cb.VanDerWaals(-1.0, 1.0), 1e-10), (cb.Exponential(1.0, 0.5), 1e-6)])
def test_next_to_first_touch_errors_say_on_which_side_a_state_may_be(law, accuracy):
    """The state of a load next to touch, against that of the same load solved for by its radius, or displacement."""
    contact = cb.Contact(cb.Parabola(1.0), law)
    (touch,) = (event for event in cb.trace(contact, accuracy=1e-12, modes=0).events if event.kind == "touch")
    radii = [{"contact_radius": (times * accuracy) ** 0.5} for times in (0.1, 100.0)]
    below = np.sign(cb.solve(contact, contact_radius=1e-3).load - touch.load)  # loads beyond touch, with contact
    films = [{"displacement": touch.displacement - below * times * accuracy} for times in (0.1,)]
    for where in (*radii, *films):
        wanted = next_to_touch(cb.solve(contact, **where, accuracy=1e-12), touch)
        state = next_to_touch(cb.solve(contact, load=wanted.load, accuracy=accuracy), touch)
        assert state.load == wanted.load
        for name in ("displacement", "contact_radius", "central_gap"):
            off = abs(getattr(state, name) - getattr(wanted, name))
            assert off <= 3 * (state.error[name] + wanted.error[name]) + 1e-13, (where, name)
        if where == radii[-1]:
            assert state.contact_radius == pytest.approx(wanted.contact_radius, rel=0.1)


@pytest.mark.parametrize("law", [cb.Exponential(1.0, 0.5), cb.Gauss(-1.0, 0.7)])
def test_the_smallest_contacts_have_the_loads_of_their_radii(law):
    """Next to first touch the load changes with the contact's area: whatever the rounding of the first row's place."""
    contact = cb.Contact(cb.Parabola(1.0), law)
    (touch,) = (event for event in cb.trace(contact, accuracy=1e-12, modes=0).events if event.kind == "touch")
    (larger,) = cb.solve(contact, contact_radius=1e-4, accuracy=1e-12).states
    for radius in 10.0 ** -np.arange(5.0, 7.1, 0.25):
        (state,) = cb.solve(contact, contact_radius=radius, accuracy=1e-12).states
        change = (larger.load - touch.load) * radius**2 / 1e-8
        error = state.error["load"] + touch.error["load"] + 0.01 * abs(change)
        assert state.load - touch.load == pytest.approx(change, abs=2 * error)


def test_errors_beyond_the_accuracy_are_told():
    contact = cb.Contact.reduced("van-der-waals", 1.0, -1)
    folds = cb.trace(contact, accuracy=1e-12, max_load=12.0, modes=0).events
    fold = next(event for event in folds if event.name == "squeeze-out" and event.control == "load")
    found = cb.solve(contact, load=fold.load - 1e-11, accuracy=1e-10)
    worst = max(
        state.error[name] / max(1.0, getattr(state, name))
        for state in found.states
        for name in ("load", "displacement", "contact_radius", "central_gap")
    )
    assert worst > 1e-9
    assert f"An error estimate is {worst / 1e-10:.3g} times the accuracy asked" in found.message
    assert "times the accuracy" not in cb.solve(contact, load=fold.load - 0.1, accuracy=1e-10).message


def test_the_lowest_state_is_so_at_the_load_whatever_says_what_is_stable():
    contact = cb.Contact.reduced("gauss", 2.0, -1)
    found = cb.find_all(contact, load=15.0)
    lowest = min(found.stable, key=lambda state: state.energy - 15.0 * state.displacement)
    for control in ("load", "displacement", cb.Spring(3.0)):
        state = cb.solve(contact, load=15.0, control=control)
        assert state.displacement == pytest.approx(lowest.displacement, abs=1e-6)
    assert all(min(barrier.heights) > 0 for barrier in found.barriers)
    assert len(found.barriers) == 1
    assert not cb.find_all(contact, load=15.0, control="displacement").barriers
    assert not cb.find_all(contact, displacement=4.6, control=cb.Spring(0.5)).barriers


def test_between_touch_and_the_narrowest_contact_that_is_followed_the_radius_may_be_either():
    """A law with a step under a cone: contact grows like the load beyond touch, here by 0.1 of it."""
    contact = cb.Contact(cb.Cone(1.561), cb.MaugisDugdale(-1.0, 1.0))
    for accuracy in (1e-4, 1e-6):
        (touch,) = (event for event in cb.trace(contact, accuracy=accuracy).events if event.kind == "touch")
        wide, narrow = (cb.solve(contact, load=touch.load * (1 + share), accuracy=accuracy) for share in (1e-2, 3e-5))
        grown = wide.contact_radius * (narrow.load - touch.load) / (wide.load - touch.load)
        assert abs(narrow.contact_radius - grown) <= narrow.error["contact_radius"] + 0.1 * grown


class Changing(cb.Interaction):
    """A law of the user's whose shape may be set anew."""

    decay = 1.0

    def shape(self, x):
        fall = np.exp(-self.decay * x)
        return fall, -self.decay * fall, self.decay**2 * fall


def test_a_curve_is_not_followed_again_for_the_next_state_asked_for(monkeypatch):
    """What was asked before changes no bit of what is found; a law of the user's may change, and its curve is new."""
    followed = []

    def counted(problem, request):
        followed.append(request)
        return trace(problem, request)

    monkeypatch.setattr(curves, "trace", counted)
    monkeypatch.setattr(curves, "_recent", {})
    contact = cb.Contact.reduced(cb.Gauss, 1.0, -1)
    alone = cb.solve(contact, load=3.0)
    between = cb.find_all(contact, load=4.0)
    again = cb.solve(contact, load=3.0)
    assert len(followed) == 1
    assert len(between) > 0
    assert [(s.displacement, s.energy, s.error) for s in again.states] == [
        (s.displacement, s.energy, s.error) for s in alone.states
    ]
    cb.solve(contact, load=3.0, accuracy=1e-5)
    assert len(followed) == 2
    own = cb.Contact(cb.Parabola(1.0), Changing(-1.0, 1.0))
    weak = cb.solve(own, load=1.0)
    monkeypatch.setattr(Changing, "decay", 1.01)
    assert cb.solve(own, load=1.0).displacement != weak.displacement


def test_a_curve_that_was_not_finished_is_not_kept(monkeypatch):
    monkeypatch.setattr(curves, "_recent", {})
    contact = cb.Contact.reduced(cb.Gauss, 1.0, -1)

    def stop(fraction, text):
        raise cb.Stop

    assert cb.solve(contact, load=3.0, progress=stop).status == "incomplete"
    assert cb.solve(contact, load=3.0).status == "complete"


class Apart(Track):
    """A curve whose rows are on discretisations of their own, of which none reaches the next row."""

    def link(self, piece):
        raise CorrectionError(Outcome.STEP_TOO_SMALL, "(a crease has left its part of the mesh)")


def test_states_are_found_between_rows_whose_discretisations_do_not_reach_each_other():
    contact, accuracy = cb.Contact(cb.Parabola(1.0), cb.Layered(-1.0, 0.525, 2.0)), 1e-6
    track = trace(cb.Axisymmetric().problem(contact, accuracy), Request(accuracy, target=3.0, events=False))
    apart = Apart(**{field.name: getattr(track, field.name) for field in dataclasses.fields(track)})
    for name, value in (("load", 1.0), ("load", 0.01), ("displacement", -0.5)):
        linked = crossings(track, name, value, accuracy)
        assert linked
        for one, other in zip(linked, crossings(apart, name, value, accuracy), strict=True):
            off, told = (
                np.abs(np.subtract(one.found.numbers, other.found.numbers)),
                np.add(one.found.error, other.found.error),
            )
            assert (off <= 2 * told).all()
            assert other.found.relative_error() <= accuracy
