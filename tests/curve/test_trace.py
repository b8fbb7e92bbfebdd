"""Where a curve ends, and what its rows and events have in common, whatever the model."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import contbranch as cb
from contbranch.control import DISPLACEMENT
from contbranch.curve import curves
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.trace import Request
from contbranch.curve.track import linked
from contbranch.curve.work import Piece, work_along
from contbranch.models.axisymmetric.meshed import MeshedContact
from contbranch.models.choice import choose


@pytest.mark.parametrize("max_load", [60.0, 80.0, 100.0])
def test_max_load_ends_a_curve_in_contact_past_its_folds(max_load):
    """The film of the Gauss repulsion at μ_T = 4 carries 83.87; in contact the load falls to 47.4466601 and rises."""
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, 4.0, -1), max_load=max_load, modes=0)
    branch = diagram.branches[0]
    assert diagram.status == "complete"
    assert [event.name for event in diagram.folds("load")] == ["squeeze-out", "wetting"]
    assert diagram.thresholds["wetting_load"] == pytest.approx(47.4466601, abs=1e-6)
    assert branch.load[-1] == pytest.approx(max_load, rel=1e-6)
    assert branch.contact_radius[-1] > 0.0
    assert branch.unstable_load[-1] == 0


def test_max_load_below_first_touch_ends_where_there_is_contact():
    """A film without coexistence is followed until the surfaces touch, whatever it carries before."""
    contact = cb.Contact.reduced(cb.Exponential, 1.0, -1)
    touch = cb.trace(contact, modes=0).thresholds["touch_load"]
    diagram = cb.trace(contact, max_load=0.5 * touch, modes=0)
    assert diagram.status == "complete"
    assert diagram.branches[0].contact_radius[-1] > 0.0
    assert diagram.thresholds["touch_load"] == pytest.approx(touch, rel=1e-6)


@pytest.mark.parametrize(
    "contact",
    [
        cb.Contact.reduced(cb.Gauss, 2.0, -1),
        cb.Contact.reduced(cb.Exponential, 4.0),
        cb.Contact.reduced(cb.MaugisDugdale, 1.0),
        cb.Contact.reduced(cb.MaugisDugdale, 1.0, -1),
    ],
    ids=["disc, repulsion", "disc, attraction", "exact", "rings"],
)
def test_indices_change_at_folds_alone_and_as_the_slope_says(contact):
    """n_load = n_displacement + [dF/dd < 0] between neighbouring rows away from events (Poincaré)."""
    diagram = cb.trace(contact, modes=0)
    branch = diagram.branches[0]
    assert diagram.status == "complete", diagram.message
    events = {round(event.position) for event in diagram.events}
    rise, run = np.diff(branch.load), np.diff(branch.displacement)
    for k in range(len(branch) - 1):
        if not events & {k - 1, k, k + 1, k + 2} and abs(rise[k]) > 1e-9 and abs(run[k]) > 1e-9:
            assert branch.unstable_load[k] - branch.unstable_displacement[k] == int(rise[k] * run[k] < 0)
            assert branch.unstable_load[k] == branch.unstable_load[k + 1]


def test_folds_next_to_the_end_of_a_law():
    """What takes a table to zero beyond its last row is felt first: it repels by that row's energy, and no more.

    The well behind it attracts. At so weak a pull F = 2πR v (Derjaguin) to a tenth, elasticity included.
    """
    gaps = np.linspace(0.0, 3.0, 61)
    energies = np.exp(-3.0 * gaps) - 0.003 * np.exp(-30.0 * (gaps - 2.6) ** 2)
    diagram = cb.trace(cb.Contact(cb.Parabola(1.0), cb.Tabulated(tuple(gaps), tuple(energies))), modes=0)
    assert diagram.status == "complete", diagram.message
    outer, well = diagram.folds("load")
    assert outer.load == pytest.approx(2 * np.pi * energies[-1], rel=0.1)
    assert well.load == pytest.approx(2 * np.pi * energies.min(), rel=0.1)
    assert diagram.branches[0].load[0] > 0.0


def test_a_table_that_ends_in_nothing_but_scatter_has_decayed():
    """Where the rows no longer differ from that its curve does not end, and it says what is smoothed alone."""
    rng = np.random.default_rng(1)
    gaps = np.linspace(0.0, 6.0, 30)
    energies = np.exp(-(gaps**2) / 2) + 1e-3 * rng.normal(size=gaps.size)
    diagram = cb.trace(cb.Contact(cb.Parabola(1.0), cb.Tabulated(tuple(gaps), tuple(energies))), accuracy=1e-4)
    assert "table-end" not in [event.name for event in diagram.events]
    assert "scatters by" in diagram.message
    assert "ends at a gap" not in diagram.message
    short = cb.Tabulated(tuple(gaps[:8]), tuple(np.exp(-2.0 * gaps[:8])))
    assert cb.trace(cb.Contact(cb.Parabola(1.0), short), accuracy=1e-4).events[0].name == "table-end"


def test_folds_closer_than_rates_tell_come_in_their_order():
    """Their places in a step that was divided between them are those in the whole one, beside which rates are seen.

    A film wets from where displacement is least; the spring's fold lies between that and the load's, at the state at
    which the load falls as the displacement rises with the spring's stiffness.
    """
    law = cb.VanDerWaals(-0.784, 0.4851085858973332) + cb.InverseSquare(0.216, 0.5651515025703931)
    spring = cb.Spring(0.15662357669582755)
    diagram = cb.trace(cb.Contact(cb.SphericalCap(50.027), law), control=spring, accuracy=1e-8, modes=0)
    assert diagram.status == "complete", diagram.message
    folds = [event for event in diagram.folds() if event.contact_radius > 0]
    assert [(fold.control, fold.name) for fold in folds] == [
        (control, "wetting") for control in ("displacement", "spring", "load")
    ]
    radii = [fold.contact_radius for fold in folds]
    assert radii == sorted(radii)
    assert radii[2] - radii[1] < 2e-5 * radii[2]


def test_work_from_row_to_row_is_the_change_of_energy_across_meshes():
    """Where meshes change, a row carried to the one before lies up to 1e-3 farther along the curve: that piece counts.

    Discretisation errors of rows, up to 1e-7 here, are errors of energies, too.
    """
    contact = cb.Contact(cb.Parabola(1.0), cb.VanDerWaals(1.0, 0.3))
    points = FollowedCurves(contact, choose(contact)[0]).track(Request(1e-8, DISPLACEMENT, 3.0)).points
    changes = 0
    for first, last in pairwise(points):
        if not 1e-3 < abs(first.observables["load"]) < 2.0 or not first.problem.joins(last.problem):
            continue
        changes += first.problem is not last.problem
        work = work_along(first, [Piece(*linked(first, last))], last, 1e-10)
        assert work == pytest.approx(last.observables["energy"] - first.observables["energy"], abs=2e-7)
    assert changes > 5


def test_a_curve_that_is_lost_twice_says_so_and_is_the_one_at_the_accuracy_asked(monkeypatch):
    follow, asked = curves.trace, []

    def lost(problem, request):
        asked.append(problem.resolution.accuracy)
        return replace(follow(problem, request), complete=False, lost=True, message="Lost.")

    contact = cb.Contact.reduced(cb.Gauss, 1.0, -1)
    known = cb.trace(contact, accuracy=1e-4)
    monkeypatch.setattr(curves, "trace", lost)
    diagram = cb.trace(contact, accuracy=1e-4)
    assert asked == [1e-4, pytest.approx(1e-6)]
    assert (diagram.status, diagram.message) == (
        "incomplete",
        "Lost. At a hundredth of the accuracy it is incomplete, too: ask for less.",
    )
    assert diagram.events == known.events
    assert cb.trace(contact, accuracy=1e-12).message == "Lost."  # nothing finer may be asked for
    soft = cb.Axisymmetric().problem(contact, 1e-4)
    monkeypatch.setattr(curves, "trace", lambda problem, request: lost(soft, request))
    stiff = cb.trace(cb.Contact.reduced(cb.Gauss, 1e4, -1), accuracy=1e-4)
    assert len(asked) == 4
    assert stiff.message.startswith("Lost. Stiffer than what is followed to its end")


def test_a_curve_that_a_mesh_does_not_resolve_is_followed_with_finer_ones(monkeypatch):
    """The events are those of a trace that asks for so much."""
    error = MeshedContact.relative_error

    def unresolved(problem, x, p):
        given_up = problem.resolution.accuracy == 1e-4 and problem.fields(x, p).rim.radius > 1.0
        return np.inf if given_up else error(problem, x, p)

    monkeypatch.setattr(MeshedContact, "relative_error", unresolved)
    coarse, fine = (cb.trace(cb.Contact.reduced(cb.Exponential, 1.0), accuracy=accuracy) for accuracy in (1e-4, 1e-6))
    assert coarse.status == "complete"
    assert coarse.message == f"The curve was lost at this accuracy, but not at 1e-06. {fine.message}".strip()
    assert coarse.thresholds == pytest.approx(fine.thresholds, abs=1e-6)


def test_rows_for_a_path_are_no_coarser_than_those_of_a_trace():
    """At a low accuracy a trace's rows are better than asked, for the curve not to be lost."""
    problem = cb.Axisymmetric().problem(cb.Contact.reduced(cb.Gauss, 1.0, -1), 1e-4)
    assert problem.rows_within(1e-4).resolution.tolerance == problem.resolution.tolerance
    assert problem.rows_within(1e-8).resolution.tolerance < 1e-8


def test_a_fold_just_before_the_curve_begins_is_where_it_is():
    """Rows of a wave's tail have it behind the first of them; finer discretisations find it half a wave before."""
    layers = cb.Contact(cb.Parabola(1.0), cb.Layered(-1.0, 2.456, wavelength=4.912, phase=0.3))
    first, *_, last = list(cb.trace(layers, accuracy=1e-5, max_load=1.0).folds("load"))[:3]
    again = [fold for fold in cb.trace(layers, accuracy=1e-6, max_load=1.0).folds("load") if fold.name == first.name]
    assert first.displacement == pytest.approx(again[0].displacement, abs=3 * first.error["displacement"])
    assert last.displacement - first.displacement == pytest.approx(4.912, rel=1e-3)
    followed = cb.follow(first, vary="interaction.phase", to=0.2)
    assert "infinite separation" in followed.message
