"""Followed events and their special points where both are known in closed form, and the derivatives they rest on."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import contbranch as cb
from contbranch.contact.family import Family, family_of
from contbranch.continuation.edge import Range
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.augmented import Condition, EventProblem
from contbranch.curve.event_curve import EventCurve
from contbranch.curve.events import Reached
from contbranch.curve.problem import EquilibriumProblem, Rates, Values, Work, oriented
from contbranch.results.profile import Profile

# Closed forms: one unknown, the load; the contact's range is 1 + k.


class ClosedForm(EquilibriumProblem):
    """A load F(y; k) of the contact coordinate y = d, which is the parameter."""

    scale = 1.0

    def __init__(self, contact: cb.Contact) -> None:
        self.contact, self.k, self.work = contact, contact.interaction.range - 1.0, Work()

    def residual(self, x, p):
        return x - self.load(p)

    def jacobian(self, x, p):
        return np.eye(1)

    def parameter_derivative(self, x, p):
        return np.array([-self.slope(p)])

    def values(self, x, p):
        return Values(float(x[0]), p, math.sqrt(max(p, 0.0)), max(-p, 0.0), 0.0)

    def rates(self, x, p, x_rate, p_rate):
        return Rates(float(x_rate[0]), p_rate, 0.5 * p_rate / math.sqrt(p) if p > 0 else 0.0, -p_rate)

    def unstable(self, x, p):
        return 0

    def profile(self, x, p):
        return Profile(*np.zeros((4, 1)))

    def start(self, control):
        return self.at(-1.0)

    def member(self, contact, tolerance=None):
        return type(self)(contact)

    def at(self, p):
        return oriented(self, np.array([self.load(p)]), p, (np.zeros(1), 1.0))


class Swallowtail(ClosedForm):
    """F = y³/3 − k y: folds at y² = k, which merge in a cusp at k = 0."""

    def load(self, p):
        return p**3 / 3 - self.k * p

    def slope(self, p):
        return p**2 - self.k


class Apart(ClosedForm):
    """Before first touch F = −k y ± y²/2: a fold at y = ±k < 0."""

    bend = 1.0
    parameter_range = (-math.inf, 0.0)
    beyond_edge = True

    def load(self, p):
        return -self.k * p + 0.5 * self.bend * p**2

    def slope(self, p):
        return -self.k + self.bend * p

    def across(self, x, p):
        return (INSIDE[type(self)](self.contact).at(0.0),)


class Bent(Apart):
    bend = -1.0


class Inside(ClosedForm):
    """Behind it F = 2 y^(3/2)/3 − k y: a fold at the contact radius k > 0."""

    outside = Apart
    parameter_range = (0.0, math.inf)
    power = 2.0

    def load(self, p):
        return 2 * max(p, 0.0) ** 1.5 / 3 - self.k * p

    def slope(self, p):
        return math.sqrt(max(p, 0.0)) - self.k

    def across(self, x, p):
        return (self.outside(self.contact).at(0.0),)


class InsideBent(Inside):
    outside = Bent


INSIDE = {Apart: Inside, Bent: InsideBent}


def family(start: float) -> Family:
    def member(range_):
        return cb.Contact(cb.Parabola(1.0), cb.Gauss(1.0, range_))

    return Family("range", start, member(start), member, "linear")


def followed(kind, start: float, p: float, *to: float) -> EventCurve:
    own = family(start)
    curve = EventCurve(Condition(own, LOAD), to, 1e-9)
    curve.trace(kind(own.contact).at(p))
    return curve


def test_a_cusp_and_both_its_folds_are_those_of_the_closed_form():
    curve = followed(Swallowtail, 1.25, 0.5, 0.5)
    (cusp,) = curve.special
    assert (cusp.kind, cusp.index) == ("cusp", [row.value for row in curve.rows].index(cusp.value))
    assert cusp.value == pytest.approx(1.0, abs=1e-12)
    assert (cusp.load, cusp.displacement) == pytest.approx((0.0, 0.0), abs=1e-8)
    assert abs(cusp.displacement) <= cusp.error["displacement"]
    for row in curve.rows:
        assert row.load == pytest.approx(-2 * row.displacement**3 / 3, abs=1e-12)
        assert row.displacement**2 == pytest.approx(row.value - 1.0, abs=1e-12)
    assert [point.displacement for point in curve.at(1.09)] == pytest.approx([0.3, -0.3], abs=1e-12)
    assert "comes back to the present range" in curve.message


@pytest.mark.parametrize(
    ("kind", "p", "special", "end"),
    [
        (Inside, 0.25, "fold-through-touch", 0.5),
        (InsideBent, 0.25, "cusp-at-touch", 1.5),
        (Apart, -0.5, "fold-through-touch", 1.5),
    ],
)
def test_a_fold_passes_first_touch_where_the_closed_form_has_it(kind, p, special, end):
    start = 0.5 if kind is Apart else 1.5
    curve = followed(kind, start, p, 1.5 if kind is Apart else 0.5)
    (passage,) = curve.special
    assert passage.kind == special
    assert passage.value == pytest.approx(1.0, abs=1e-12)
    assert (passage.load, passage.contact_radius, passage.central_gap) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert curve.complete
    assert curve.rows[-1].value == end
    for row in [*curve.rows, *curve.at(1.001), *curve.at(0.999)]:
        k = row.value - 1.0
        expected = k if row.contact_radius > 0 else -abs(k) if special == "cusp-at-touch" else k
        assert (row.contact_radius or -row.central_gap) == pytest.approx(expected, abs=1e-9)
    assert len(curve.at(1.001)) == (2 if special == "cusp-at-touch" else 1)


# The disc's augmented system.

CONTACT = cb.Contact.reduced(cb.Gauss, tabor=2.0, sign=-1)


@cache
def folds() -> dict[tuple[str | None, str | None], cb.Event]:
    diagram = cb.trace(CONTACT, accuracy=1e-9, modes=0)
    return {(e.name, e.control): e for e in diagram.events if e.kind == "fold"}


def augmented(name: str, control: str) -> tuple[EventProblem, np.ndarray]:
    """The augmented system of a fold in the Tabor coefficient, and the state of the fold."""
    place = folds()[name, control].origin.raw.point
    tabor = family_of(CONTACT, "tabor", 1.0)
    condition = Condition(tabor, LOAD if control == "load" else DISPLACEMENT)
    made = EventProblem.around(condition, place, Range(-1.0, 0.5))
    return made, made.joined(place.x, place.parameter)


@pytest.mark.parametrize("name", ["squeeze-out", "wetting"])
def test_the_fold_solves_the_augmented_system(name):
    problem, x = augmented(name, "load")
    residual = problem.residual(x, 0.0)
    assert np.abs(residual[:-1]).max() < 1e-11
    assert abs(residual[-1]) < 1e-9


@pytest.mark.parametrize(("name", "control"), [("squeeze-out", "load"), ("wetting", "displacement")])
def test_the_jacobian_is_the_derivative_of_the_residual(name, control):
    """At an equilibrium that is no fold, along smooth directions, against central differences of the residual."""
    problem, x = augmented(name, control)
    tau = np.linspace(0.0, 3.0, x.size - 1)
    h, u = problem.split(x + np.append(np.zeros(tau.size), 0.05))
    x = problem.joined(problem.at(0.02).solve_at(h, u), u)
    linear = problem.linearise(x, 0.02)
    for vector, rate in ((np.append(np.exp(-(tau**2)), 0.3), 0.0), (np.zeros(x.size), 1.0)):
        step = 1e-5
        there, back = (problem.residual(x + s * vector, 0.02 + s * rate) for s in (step, -step))
        expected = (there - back) / (2 * step)
        found = linear.jacobian @ vector + rate * linear.parameter_derivative
        np.testing.assert_allclose(found[:-1], expected[:-1], atol=1e-6)
        assert found[-1] == pytest.approx(expected[-1], rel=2e-4)


def test_any_event_of_the_curve_can_be_followed():
    """The states of one displacement, as an event: they are those that `solve` finds."""
    found = folds()["wetting", "load"]
    tabor = family_of(CONTACT, "tabor", 1.0)
    curve = EventCurve(Condition(tabor, event=Reached(DISPLACEMENT, found.displacement)), (1.8,), 1e-8)
    curve.trace(found.origin.raw.point)
    assert curve.complete
    (point,) = curve.at(1.8)
    states = cb.solve(cb.Contact.reduced(cb.Gauss, 1.8, -1), displacement=found.displacement, accuracy=1e-8).states
    nearest = min(states, key=lambda state: abs(state.load - point.load))
    for name in ("load", "displacement", "contact_radius", "central_gap"):
        assert getattr(point, name) == pytest.approx(getattr(nearest, name), abs=1e-7)


def test_a_fold_that_only_nears_first_touch_is_followed_on():
    """Wetting of a soft film has ever smaller contact radii, but not none: as a separate trace has it."""
    contact = cb.Contact.reduced(cb.VanDerWaals, 0.25, -1)
    wetting = next(e for e in cb.trace(contact, accuracy=1e-8, modes=0).folds("load") if e.name == "wetting")
    followed = cb.follow(wetting, "tabor", to=0.16, accuracy=1e-8)
    assert (followed.status, followed.special) == ("complete", ())
    softer = cb.trace(cb.Contact.reduced(cb.VanDerWaals, 0.16, -1), accuracy=1e-8, modes=0)
    other = next(e for e in softer.folds("load") if e.name == "wetting")
    (point,) = followed.at(0.16)
    assert point.contact_radius == pytest.approx(other.contact_radius, abs=1e-7)
    assert point.load == pytest.approx(other.load, abs=point.error["load"] + other.error["load"])


def test_a_fold_that_passes_first_touch_beyond_the_range_ends_at_the_range():
    """The contact of so wide a law counts as next to first touch long before it comes there, at a share of 0.4998."""
    contact = cb.Contact(cb.Cone(0.22), cb.Exponential(-0.42, 426.374) + cb.VanDerWaals(0.58, 720.999))
    diagram = cb.trace(contact, accuracy=1e-5, max_load=1.0, modes=0)
    pulled = next(e for e in diagram.events if (e.name, e.control) == ("pull-off", "load"))
    followed = cb.follow(pulled, "share", 0.539, accuracy=1e-5)
    assert (followed.status, followed.special) == ("complete", ())
    assert followed.curve["share"].min() == followed.curve["share"][-1] == 0.539
    there = cb.Contact(cb.Cone(0.22), cb.Exponential(-0.461, 426.374) + cb.VanDerWaals(0.539, 720.999))
    expected = cb.trace(there, accuracy=1e-5, max_load=1.0, modes=0).thresholds["pull_off_load"]
    assert followed.curve["load"][-1] == pytest.approx(expected, rel=1e-6)
