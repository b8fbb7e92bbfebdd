"""Folds that lie next to first touch, and folds of load and displacement that all but coincide."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import pytest
import scipy
from followed import Followed

import contbranch as cb
from contbranch.continuation import CorrectionError
from contbranch.control import LOAD
from contbranch.curve import refine
from contbranch.curve.events import FoldEvent

SOFTENING = 1.6956803312
"""C of dF/dd = 2a − C μ_T^(5/2) at a tiny contact of the soft Gauss repulsion; quadrature of 3∫[(H(0) − H(t))/t²]² dt
with the closed form H(t) of the rigid tip."""


def wetting(diagram: cb.Diagram, control: str = "load") -> cb.Event:
    return next(event for event in diagram.folds(control) if event.name == "wetting")


@pytest.mark.parametrize(("power", "accuracy"), [(-10, 1e-12), (-10, 1e-9), (-12, 1e-11)])
def test_a_wetting_fold_in_a_tiny_contact(power, accuracy):
    """Its radius is (C/2) μ_T^(5/2) to leading order, with corrections of relative order μ_T^(3/2) (elasticity).

    The last range is 4096: of that, 1e-12 is a rounding error, and whether it is met depends on the machine's.
    """
    tabor = 2.0**power
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, tabor, -1), accuracy=accuracy, modes=0)
    fold = wetting(diagram)
    law = SOFTENING / 2 * tabor**2.5
    assert diagram.status == "complete", diagram.message
    assert fold.contact_radius == pytest.approx(law, rel=10 * tabor**1.5, abs=fold.error["contact_radius"])
    assert 0.0 < fold.error["contact_radius"] < min(accuracy, 1e-3 * law)


def test_a_small_fold_has_an_honest_error():
    """Against the same fold at a hundred times the accuracy; the panels are graded down to the radius 0.0008."""
    contact = cb.Contact.reduced(cb.Gauss, 2.0**-4, -1)
    coarse, fine = (wetting(cb.trace(contact, accuracy=accuracy, modes=0)) for accuracy in (1e-7, 1e-10))
    assert abs(coarse.contact_radius - fine.contact_radius) <= coarse.error["contact_radius"] <= 1e-7
    assert abs(coarse.load - fine.load) <= coarse.error["load"]


def assert_theory_allows(diagram: cb.Diagram) -> None:
    """Morse indices are never negative, and a load fold changes the load's index alone by one (Poincaré)."""
    branch = diagram.branches[0]
    assert diagram.status == "complete", diagram.message
    assert (branch.unstable_load >= branch.unstable_displacement).all()
    assert (branch.unstable_displacement >= 0).all()
    positions = [event.position for event in diagram.events]
    assert positions == sorted(positions)


def test_coinciding_folds_of_sums_at_a_coarse_accuracy():
    """Against a trace at a hundredth of the accuracy."""
    contact = cb.Contact(cb.Parabola(1.0), cb.Gauss(3.0, 0.6) + cb.Gauss(-5.0, 0.3), 1.0)
    coarse, fine = (cb.trace(contact, accuracy=accuracy, modes=0) for accuracy in (1e-5, 1e-7))
    for diagram in (coarse, fine):
        assert_theory_allows(diagram)
    assert [(e.name, e.control) for e in coarse.events] == [(e.name, e.control) for e in fine.events]
    for here, there in zip(coarse.events[:-1], fine.events[:-1], strict=True):
        for name in ("load", "displacement", "contact_radius", "central_gap"):
            assert abs(getattr(here, name) - getattr(there, name)) <= here.error[name] + there.error[name]


def test_a_fold_of_a_film_just_before_touch_is_not_taken_for_one_in_the_corner():
    """The load changes by 1e-10 between them, the displacement by 0.0017: against a trace at a thousandth."""
    law = cb.VanDerWaals(-0.262, 839.6) + cb.Gauss(0.738, 3618.6)
    coarse, fine = (cb.trace(cb.Contact(cb.Parabola(1.0), law, 1.0), accuracy=a, modes=0) for a in (1e-4, 1e-7))
    assert [(e.kind, e.name) for e in coarse.events] == [(e.kind, e.name) for e in fine.events]
    assert [e.position for e in coarse.events] == sorted(e.position for e in coarse.events)
    for here, there in zip(coarse.events[:-1], fine.events[:-1], strict=True):
        for name in ("load", "displacement", "contact_radius", "central_gap"):
            assert abs(getattr(here, name) - getattr(there, name)) <= here.error[name] + there.error[name]


def test_folds_a_billionth_apart():
    """The stiff Gauss repulsion: squeeze-out at 2e-9 in the gap, load first since the slope is positive around it."""
    traced = Followed(cb.Contact.reduced(cb.Gauss, 16.0, -1), 1e-6, modes=0)
    assert traced.curve.complete, traced.curve.message
    folds = [event.control for event in traced.curve.events if event.control]
    assert folds == ["load", "displacement", "displacement", "load"]
    # The inertia at the rows that are no events says the same, of which every fourth is asked.
    for row, point in list(enumerate(traced.points[:-1]))[::4]:
        if not point.label:
            found = traced.problem(row).unstable(point.x, point.parameter)
            assert found == traced.curve.branch.unstable_displacement[row]


def test_an_event_that_cannot_be_located_says_so(monkeypatch):
    """Where Newton's method fails at the event itself, its distance is part of the error estimates."""
    contact = cb.Contact.reduced(cb.Gauss, 1.0, -1)
    sharp = wetting(cb.trace(contact, modes=0))
    mark = [mark for mark in Followed(contact, 1e-6, modes=0).track.marks if mark.control == LOAD][-1]
    aside = refine.further(mark.point, 1e-3)

    def failing(*_):
        raise CorrectionError(None, "made to fail")  # type: ignore[arg-type]

    monkeypatch.setattr(refine, "_located", failing)
    found = refine.refine(aside, FoldEvent(LOAD), 1e-6)
    assert found.relative_error() > 1e-6
    for value, error, name in zip(found.numbers, found.error, ("load", "displacement", "contact_radius"), strict=False):
        assert abs(value - getattr(sharp, name)) <= error
    assert abs(found.numbers[2] - sharp.contact_radius) > 1e-9  # it was indeed not located


def test_exponents_of_soft_folds_take_less_than_they_did():
    """The crossover of a soft fold needs fine meshes at the fold only; the local exponents are slopes of their own
    samples."""
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, 2.0**-4, -1), accuracy=1e-9, modes=0)
    event = wetting(diagram)
    began = time.process_time()
    exponent = event.exponent
    assert time.process_time() - began < 10.0  # half a minute on the fold's own mesh throughout
    assert exponent is not None
    assert exponent.window is not None
    assert abs(exponent.window.kappa - 1 / 3) < 0.01
    local = diagram.local_exponent(event)
    log_excess, log_order = np.log(local.excess), np.log(local.order_parameter)
    close = np.diff(log_excess) < 0.5
    secants = np.diff(log_order) / np.diff(log_excess)
    means = np.array([(a + b) / 2 for a, b in pairwise(local.kappa)])
    allowed = 1e-3 + local.error[:-1] + local.error[1:]
    assert (np.abs(secants - means) <= allowed)[close].all()


def test_every_layer_is_met_at_every_accuracy():
    """Layers bound the steps where they are: each has its two folds, with loads of either sign by turns.

    A coarse trace begins nearer, where the force is that small: what it has are the last folds of the fine one.
    """
    contact = cb.Contact(cb.Parabola(1.0), cb.Layered(1.0, 0.5, 1.0))
    coarse, fine = (cb.trace(contact, accuracy=accuracy, max_load=20.0, modes=0) for accuracy in (1e-4, 1e-5))
    assert coarse.status == fine.status == "complete"
    for control, count in (("load", 11), ("displacement", 4)):
        first, second = (list(diagram.folds(control)) for diagram in (coarse, fine))
        assert len(second) >= len(first) >= count
        for one, other in zip(first[::-1], second[::-1], strict=False):
            assert abs(one.load - other.load) <= 3 * (one.error["load"] + other.error["load"])
    film = np.array([fold.load for fold in fine.folds("load") if fold.central_gap > 0])
    assert (film[1:] * film[:-1] < 0).sum() >= len(film) - 2


@pytest.mark.parametrize(
    ("exponent", "law", "name", "tolerance"),
    [
        (5.0, cb.VanDerWaals(-1.0, 150.0), "wetting", 1e-3),
        (3.5, cb.Gauss(-1.0, 40.0), "wetting", 1e-2),
        (5.4, cb.InverseSquare(1.0, 900.0), "pull-off", 1e-4),  # at a radius of 1e-4, where all rates rest
    ],
    ids=["vdw", "gauss", "weak"],
)
def test_wetting_of_a_soft_film_under_a_flat_tip_lies_behind_the_touch(exponent, law, name, tolerance):
    """The load changes by 2π ∫ v''(z − d) r dr with d, a long range leaving the body all but rigid, and a contact adds
    2a: the fold is where both balance, up to the deformation by the film. Load and displacement rest next to it."""
    tip = cb.PowerLaw(exponent, 1.0)
    diagram = cb.trace(cb.Contact(tip, law), accuracy=1e-8)
    touch = next(event for event in diagram.events if event.kind == "touch")
    fold = list(diagram.folds("load"))[-1]

    def density(r):
        gap = tip.height(np.array([r])) - touch.displacement
        return 2 * np.pi * r * float(law.evaluate(gap).stiffness[0])

    slope = scipy.integrate.quad(density, 0.0, 20.0, limit=500, epsabs=1e-12)[0]
    assert diagram.status == "complete"
    assert fold.name == name
    assert fold.contact_radius == pytest.approx(-slope / 2, rel=tolerance)
    assert fold.error["contact_radius"] <= 1e-8


def test_a_convex_film_is_given_no_folds_by_rounding():
    """At loads of 1e7 the rates of so stiff a film are noise, which once looked like eight folds.

    Whether so large a load is reached at all depends on the rounding of the machine."""
    found = cb.trace(cb.Contact.reduced(cb.InverseSquare, 128.0, -1), accuracy=1e-4, modes=0)
    assert max(found.branches[0].load) > 1e7
    assert not list(found.folds("load"))
    assert not list(found.folds("displacement"))


def test_which_laws_are_known_to_be_convex():
    class Wavy(cb.Exponential):
        """Whatever it is made of, its shape is another."""

    repulsion = cb.Exponential(-1.0, 2.0), cb.InverseSquare(-0.3, 1.0)
    others = cb.Exponential(1.0, 2.0), cb.Gauss(-1.0, 1.0), cb.VanDerWaals(-1.0, 1.0), Wavy(-1.0, 2.0)
    assert all(law.convex for law in (*repulsion, repulsion[0] + repulsion[1]))
    assert not any(law.convex for law in (*others, repulsion[0] + others[1]))
