"""Error estimates are honest, whole diagrams complete, and indices change at the folds and only there."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb

QUANTITIES = ("load", "displacement", "contact_radius", "central_gap")

CASES = [
    (cb.Exponential, 1, 1.0),
    (cb.Exponential, 1, 4.0),
    (cb.Exponential, -1, 1.0),
    (cb.Gauss, -1, 1.0),
    (cb.Gauss, -1, 4.0),
    (cb.Gauss, 1, 1.0),
    (cb.VanDerWaals, -1, 1.0),
    (cb.InverseSquare, 1, 1.0),
    (cb.InverseSquare, 1, 4.0),
]


def events_of(diagram):
    return [event for event in diagram.events if event.kind != "end"]


@pytest.fixture(scope="module")
def compared():
    """(case, accuracy, event, quantity, value, estimate, true error) of every number of every event."""
    rows = []
    for law, sign, tabor in CASES:
        contact = cb.Contact.reduced(law, tabor, sign)
        exact = cb.trace(contact, accuracy=1e-12, modes=0)
        for accuracy in (1e-6, 1e-8):
            diagram = cb.trace(contact, accuracy=accuracy, modes=0)
            assert diagram.status == "complete", diagram.message
            found, true = events_of(diagram), events_of(exact)
            names = [(event.kind, event.control, event.name) for event in found]
            assert names == [(event.kind, event.control, event.name) for event in true]
            for event, reference in zip(found, true, strict=True):
                for name in QUANTITIES:
                    value = getattr(event, name)
                    known = reference.error[name]
                    distance = max(0.0, abs(value - getattr(reference, name)) - known)
                    case = f"{law.name} {sign * tabor:+g} at {accuracy:g}: {event.control} {event.kind} {name}"
                    rows.append((case, accuracy, value, event.error[name], distance))
    return rows


def test_true_errors_are_within_the_estimates(compared):
    wrong = [f"{case} = {value}: {estimate:.1e} < {d:.1e}" for case, _, value, estimate, d in compared if d > estimate]
    assert not wrong, "\n".join(wrong)


def test_estimates_are_within_the_accuracy(compared):
    wrong = [f"{case} = {v}: {e:.1e}" for case, accuracy, v, e, _ in compared if e > accuracy * max(1.0, abs(v))]
    assert not wrong, "\n".join(wrong)


def test_estimates_are_not_much_larger_than_the_errors(compared):
    ratios = [estimate / distance for *_, estimate, distance in compared if distance > 1e-13]
    assert len(ratios) > 100
    assert np.median(ratios) < 100


def test_thresholds_are_the_events(compared):
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, 1.0, -1))
    values = {value for event in diagram.events for value in (event.load, event.displacement, event.contact_radius)}
    assert set(diagram.thresholds.values()) <= values
    assert set(diagram.thresholds) == {
        "touch_load",
        "touch_displacement",
        "squeeze_out_load",
        "squeeze_out_displacement",
        "wetting_load",
        "wetting_displacement",
        "wetting_radius",
    }


@pytest.mark.parametrize(
    ("law", "sign", "tabor"), [(cb.Exponential, 1, 1.0), (cb.Gauss, -1, 4.0), (cb.VanDerWaals, 1, 1.0)]
)
def test_errors_of_rows(law, sign, tabor):
    """Load and displacement of a row against a sharp solution with the row's contact radius."""
    contact = cb.Contact.reduced(law, tabor, sign)
    branch = cb.trace(contact, accuracy=1e-6).branches[0]
    rows = np.flatnonzero(branch.contact_radius > 1e-3)
    for row in rows[1 :: max(1, len(rows) // 5)]:
        true = cb.solve(contact, contact_radius=float(branch.contact_radius[row]), accuracy=1e-10)
        for name, estimate in (("load", branch.load_error), ("displacement", branch.displacement_error)):
            value = getattr(branch, name)[row]
            assert estimate[row] <= 1e-6 * max(1.0, abs(value))
            # signed differences of finer meshes without a safety factor: the estimate itself is known to a part
            assert abs(value - getattr(true, name)) <= 2 * estimate[row] + 1e-9 * max(1.0, abs(value))


LAWS = (cb.Exponential, cb.Gauss, cb.VanDerWaals, cb.InverseSquare)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("tabor", [1 / 64, 1 / 16, 1 / 4, 1.0, 4.0])
def test_diagrams_are_complete_and_their_indices_follow_the_folds(law, sign, tabor):
    diagram = cb.trace(cb.Contact.reduced(law, tabor, sign))
    assert diagram.status == "complete", diagram.message
    branch = diagram.branches[0]
    loads = np.diff(branch.load)
    approach = np.diff(branch.displacement)
    # Index between rows: that of the less stable end of a piece. It changes at rows that are folds, and only there.
    for control in ("load", "displacement"):
        index = branch.unstable(control)
        changes = np.flatnonzero(np.diff(index))
        folds = sorted(event.position for event in diagram.folds())
        for change in changes:
            assert any(change <= position <= change + 1 for position in folds), (control, change, folds)
        number = sum(event.control == "load" for event in diagram.folds())
        assert number % 2 == (1 if sign > 0 else 0)
    # n_load − n_displacement = [dF/dd < 0], by differences of rows between which neither index changes
    extra = branch.unstable_load - branch.unstable_displacement
    assert set(extra.tolist()) <= {0, 1}
    flat = 1e-5 * np.maximum(1.0, np.abs(branch.load[1:]))
    inside = (extra[1:] == extra[:-1]) & (np.abs(loads) > flat) & (np.abs(approach) > 1e-5)
    inside &= (np.diff(branch.unstable_displacement) == 0) & (np.diff(branch.unstable_load) == 0)
    positions = np.array([event.position for event in diagram.folds()])
    for row in np.flatnonzero(inside):
        if not ((positions >= row) & (positions <= row + 1)).any():
            assert (loads[row] * approach[row] < 0) == (extra[row] == 1), row
    # both ends of the curve are stable, far away and pressed together
    assert branch.unstable_load[-1] == branch.unstable_displacement[-1] == branch.unstable_displacement[0] == 0
    if law in (cb.Exponential, cb.InverseSquare) and sign < 0:  # v'' ≥ 0: a convex energy has no fold
        assert not list(diagram.folds())
        assert not branch.unstable_load.any()
        assert diagram.thresholds["squeeze_out_load"] == diagram.thresholds["wetting_load"]
        assert diagram.thresholds["squeeze_out_load"] == diagram.thresholds["touch_load"]


@pytest.mark.parametrize("accuracy", [1e-6, 1e-8])
@pytest.mark.parametrize("tabor", [1 / 16, 1 / 64])
def test_narrow_windows_are_resolved(tabor, accuracy):
    """Gauss repulsion: both folds exist at any Tabor coefficient and lie ever closer together."""
    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, tabor, -1), accuracy=accuracy)
    assert diagram.status == "complete", diagram.message
    squeeze, wetting = list(diagram.folds("load"))
    assert (squeeze.name, wetting.name) == ("squeeze-out", "wetting")
    width = squeeze.load - wetting.load
    assert width > squeeze.error["load"] + wetting.error["load"]
    assert width < 1e-4
    assert squeeze.central_gap > 0
    assert wetting.contact_radius > 0
    assert wetting.contact_radius > wetting.error["contact_radius"]
    touch = next(event for event in diagram.events if event.kind == "touch")
    sharp = cb.trace(cb.Contact.reduced(cb.Gauss, tabor, -1), accuracy=1e-9)
    fine = {event.name: event for event in sharp.folds("load")}
    assert fine["squeeze-out"].load - fine["wetting"].load == pytest.approx(width, rel=1e-2)
    assert touch.load <= wetting.load + touch.error["load"] or wetting.load < touch.load < squeeze.load


class Parabolic(cb.Interaction):
    """f = (1 - x/3)² up to x = 3, where f'' jumps."""

    def shape(self, x):
        u = np.maximum(1.0 - x / 3.0, 0.0)
        return u * u, -2.0 / 3.0 * u, 2.0 / 9.0 * (u > 0.0)


def test_place_of_a_fold_whose_film_reaches_a_kink_under_a_cap():
    """Against panels in √(t² - a²) with one end moved to the kink until it stays there: 56 panels of 16 nodes."""
    law = Parabolic(-1.0, 0.44) + cb.Gauss(0.6022674456636709, 0.33487382594835907)
    contact = cb.Contact(cb.SphericalCap(1.7524733743253385, 2.0376482142603796), law)
    fold = next(e for e in cb.trace(contact, accuracy=1e-6).events if e.name == "squeeze-out")
    assert abs(fold.central_gap - 0.6151355) <= 3.0 * fold.error["central_gap"] + 3e-7
    assert abs(fold.displacement - 0.01936102) <= 3.0 * fold.error["displacement"] + 1e-7


def test_two_meshes_that_agree_by_chance_next_to_a_fold():
    """The state at a load just below a fold, far away, was off by 150 stated errors."""
    law = cb.Gauss(0.231, 482.58448156771595) + cb.VanDerWaals(-0.769, 170.35232199340373)
    contact = cb.Contact(cb.Parabola(1.0), law)
    coarse, fine = (
        sorted(cb.find_all(contact, load=0.05000891609161658, accuracy=accuracy).states, key=lambda s: s.displacement)
        for accuracy in (1e-8, 1e-10)
    )
    assert len(coarse) == len(fine) == 3
    for here, there in zip(coarse, fine, strict=True):
        off = abs(here.displacement - there.displacement)
        assert off <= 3.0 * (here.error["displacement"] + there.error["displacement"])
